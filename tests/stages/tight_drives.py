"""Short drives with observations, and runs of `gnss-ins-tc` over them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pymap3d
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from replay import channels
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.schemas import filter_pb2
from replay.simulate import read_scenario, write_log
from tests.engine.drives import SECOND, rewrite
from tests.simulate import observing

PIPELINE = "gnss-ins-tc"
LEVER = [-0.4, 0.15, -1.2]
OBSERVATIONS = channels.GNSS_OBS.at(receiver="rover")
TURNS = [
    {"kind": "hold", "duration": 8.0},
    {"kind": "speed", "to": 12.0},
    {"kind": "turn", "angle": "90 deg", "radius": 40.0},
    {"kind": "straight", "duration": 6.0},
    {"kind": "turn", "angle": "-120 deg", "radius": 30.0},
    {"kind": "speed", "to": 5.0},
    {"kind": "speed", "to": 14.0},
    {"kind": "turn", "angle": "60 deg", "radius": 50.0},
    {"kind": "straight", "duration": 5.0},
]
PERFECT = {"rate": 100.0, "grade": "perfect"}
QUIET = {"code": 0.5, "carrier": 0.002, "rate": 0.03}
EMPTY = {"atmosphere": {"ionosphere": "none", "troposphere": "none", "shapiro": False}}
HONEST = {
    **EMPTY,
    "spp": {"weighting": "sine", "range_std_scale": 0.0, "troposphere_std": 0.0},
    "tight": {"code_sigma": 0.5, "doppler_sigma": 0.03, "phase_sigma": 0.002},
}
"""Settings that fit a receiver of `QUIET` noise under an empty sky."""
PHASE = {**HONEST, "tight": {**HONEST["tight"], "phase": True}}


def write_drive(path: Path, *, segments: Any = None, imu: Any = None, **over: Any) -> Path:
    """Log of a drive with one receiver; `over` goes to the receiver, `imu` to the unit."""
    table = {
        "seed": over.pop("seed", 7),
        "start": {"time": observing.START, **observing.HERE, "heading": "20 deg"},
        "gnss": {"fixes": False, "receiver": "rover"},
        "imu": imu or PERFECT,
        "truth": {"rate": 50.0},
        "sky": {**observing.NO_AIR, **over.pop("sky", {})},
        "receivers": [observing.receiver(lever_arm=LEVER, rate=5.0, **over)],
        "segments": segments or TURNS,
        "defaults": {"gnss": {"receiver": "rover"}},
    }
    write_log(read_scenario(table), path)
    return path


@dataclasses.dataclass(frozen=True)
class TightRun:
    """Outputs of a run with errors against truth, at rows that have both.

    Attributes
    ----------
    time_s : (n,), s since the first row of truth
    position, velocity, attitude : (n, 3)
        Estimate minus truth, ECEF, m and m/s; truth minus estimate turned about ECEF axes, rad.
    status : (n,)
    """

    outputs: dict[str, Columns]
    path: Path
    time_s: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    attitude: np.ndarray
    status: np.ndarray

    def innovations(self, kind: str) -> Columns:
        """Innovations of one kind, by the end of its name in the schema."""
        rows = self.outputs["FILTER_INNOVATIONS"]
        return rows.take(
            rows["kind"] == filter_pb2.MeasurementKind.Value(f"MEASUREMENT_KIND_{kind}")
        )

    def events(self, kind: str) -> list[tuple[float, float]]:
        """Time since the first row of truth and value of events of a kind."""
        rows = self.outputs["FILTER_EVENTS"]
        mine = rows["kind"] == filter_pb2.EventKind.Value(f"EVENT_KIND_{kind}")
        times = (rows.valid_time_ns[mine] - observing.START_NS) / SECOND
        return list(zip(times.tolist(), rows["value"][mine].tolist(), strict=True))

    def covariances(self) -> np.ndarray:
        """(n, states, states), of the inertial system, full."""
        rows = self.outputs["FILTER_COVARIANCE"]
        size = int(rows["dimension"][0])
        triangles = rows.ragged("upper_triangle").values.reshape(len(rows), -1)
        full = np.zeros((len(rows), size, size))
        upper = np.triu_indices(size)
        full[:, upper[0], upper[1]] = triangles
        full[:, upper[1], upper[0]] = triangles
        return full


def run(source: Path, *tables: Mapping[str, Any], **more: Any) -> TightRun:
    """Replay a log and compare it with its truth."""
    target = source.with_name(f"{source.stem}-run.mcap")
    with LogReader(source) as reader:
        job = make_job(reader, PIPELINE, tables=list(tables), **more)
        replay_log(reader, target, job)
    return read(target)


def read(path: Path) -> TightRun:
    """A run's log against the truth in it."""
    outputs: dict[str, Columns] = {}
    with LogReader(path) as reader:
        for topic in reader.channels:
            spec = channels.find(topic)
            if spec is not None and spec.name.startswith(("FILTER", "SOLUTION", "TRUTH")):
                outputs[spec.name] = reader.read(topic)
    solution, truth = outputs["SOLUTION"], outputs["TRUTH"]
    times = truth.valid_time_ns
    at = np.searchsorted(times, solution.valid_time_ns)
    inside = (at > 0) & (at < len(times))
    solution, at = solution.take(inside), at[inside]
    part = ((solution.valid_time_ns - times[at - 1]) / (times[at] - times[at - 1]))[:, None]
    place = spline(times, truth, solution.valid_time_ns)
    latitude, longitude, _ = pymap3d.ecef2geodetic(*truth["position_ecef_m"][0])
    enu = truth["velocity_enu_m_s"]
    velocity = solution["velocity_enu_m_s"] - (enu[at - 1] * (1.0 - part) + enu[at] * part)
    east = np.array(pymap3d.enu2uvw(*velocity.T, latitude, longitude)).T
    return TightRun(
        outputs=outputs,
        path=path,
        time_s=(solution.valid_time_ns - times[0]) / SECOND,
        position=solution["position_ecef_m"] - place,
        velocity=east,
        attitude=attitudes(solution["attitude_rad"], truth["attitude_rad"], at, part),
        status=solution["status"],
    )


def spline(times: np.ndarray, truth: Columns, at_ns: np.ndarray) -> np.ndarray:
    """Truth's position at other times, to micrometres."""
    first = times[0]
    origin = truth["position_ecef_m"][0]
    curve = CubicSpline((times - first) / SECOND, truth["position_ecef_m"] - origin)
    return np.asarray(curve((at_ns - first) / SECOND) + origin)


def attitudes(mine: np.ndarray, truth: np.ndarray, at: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Truth minus estimate as small turns about north, east, down."""
    step = np.remainder(truth[at] - truth[at - 1] + np.pi, 2.0 * np.pi) - np.pi
    true = truth[at - 1] + part * step
    ours = Rotation.from_euler("ZYX", mine[:, ::-1])
    theirs = Rotation.from_euler("ZYX", true[:, ::-1])
    return np.asarray((theirs * ours.inv()).as_rotvec())


def edited(source: Path, name: str, edit: Callable[[Columns], Columns]) -> Path:
    """The log with other observations."""
    target = source.with_name(f"{name}.mcap")
    return rewrite(source, target, lambda rows: {**rows, OBSERVATIONS: edit(rows[OBSERVATIONS])})


def with_values(columns: Columns, **values: np.ndarray) -> Columns:
    """Rows with some columns replaced, to be encoded anew."""
    return dataclasses.replace(columns, values={**columns.values, **values}, payloads=None)
