"""A simulated log: from scenario to channels, the same bytes from the same scenario."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay import channels, time
from replay.engine.manifest import DEFAULTS, MANIFEST, make_manifest, manifest_metadata
from replay.log.columns import Columns
from replay.log.digest import ChannelDigest
from replay.log.writer import LogWriter
from replay.schemas import gnss_pb2
from replay.simulate import gnss, imu
from replay.simulate.defaults import defaults_toml, unit_toml
from replay.simulate.motion import Moved, move
from replay.simulate.observations import SIMULATED, observe
from replay.simulate.scenario import Scenario, load_scenario
from replay.simulate.settings import Settings, Unit
from replay.simulate.trajectory import Trajectory
from replay.simulate.truth import Scene

Times = npt.NDArray[np.int64]

_BATCH_NS: Final = 60 * time.NS_PER_S


@dataclasses.dataclass(frozen=True, slots=True)
class SimulationResult:
    """What was written.

    Attributes
    ----------
    path : Path
    duration_s : float, s
        From the start to the last inertial sample.
    outputs : mapping of topic to ChannelDigest
        Equal for equal scenarios.
    """

    path: Path
    duration_s: float
    outputs: Mapping[str, ChannelDigest]


def simulate(
    scenario: Path, out: Path, *, tables: Iterable[Mapping[str, Any]] = ()
) -> SimulationResult:
    """Write the log of a scenario.

    Parameters
    ----------
    scenario : Path
        TOML.
    out : Path
        Log to write.
    tables : iterable of mapping
        Go over the scenario's, key by key: `{"repeat": 12}`.

    Raises
    ------
    ConfigurationError
        Where the scenario is off.
    LogError
        Where the log cannot be written.
    """
    return write_log(load_scenario(scenario, tables), out)


def write_log(scenario: Scenario, out: Path) -> SimulationResult:
    """Write the log of a scenario that was read."""
    moved = move(scenario)
    rows, told = make_all(scenario, moved)
    toml = scenario.to_toml()
    with LogWriter(out) as writer:
        for topic in rows:
            writer.add_channel(topic, _message(topic))
        defaults = defaults_toml(scenario.settings, scenario.defaults, scenario.setup)
        writer.add_metadata(DEFAULTS, {"toml": defaults})
        for unit in scenario.units:
            writer.add_metadata(
                f"{DEFAULTS}.{unit.name}", {"toml": unit_toml(scenario.settings, unit)}
            )
        if told:
            writer.add_metadata(SIMULATED, told)
        for batch in _batches(rows):
            writer.write(batch)
        digests = writer.digests()
        manifest = make_manifest(
            command="simulate",
            configuration=toml,
            outputs=digests,
            inputs=moved.inputs,
            notes=[f"scenario {scenario.settings.name}", *moved.notes],
        )
        writer.add_metadata(MANIFEST, manifest_metadata(manifest))
    last = int(rows[channels.IMU.topic].valid_time_ns[-1])
    return SimulationResult(out, (last - moved.start_ns) / time.NS_PER_S, digests)


def _message(topic: str) -> str:
    spec = channels.find(topic)
    if spec is None:
        raise KeyError(topic)
    return spec.message


def make_channels(scenario: Scenario) -> dict[str, Columns]:
    """Rows of every channel of a scenario, by topic; errors as of :func:`make_all`."""
    return make_all(scenario)[0]


def make_all(
    scenario: Scenario, moved: Moved | None = None
) -> tuple[dict[str, Columns], dict[str, str]]:
    """Rows of every channel of a scenario, by topic, and what observations hide.

    The second is the metadata record `replay.simulated`: JSON texts of cycle slips and
    of the whole cycles in carrier phases; empty without observations.

    Raises
    ------
    ConfigurationError
        Where a manoeuvre cannot be driven, or the drive is too short for a sample.
    """
    settings = scenario.settings
    moved = moved or move(scenario)
    trajectory, start_ns, period_ns = moved.trajectory, moved.start_ns, moved.period_ns
    samples, interval_s, origin = len(trajectory.rates), trajectory.interval_s, moved.origin
    data = imu.measure(
        trajectory.rates,
        trajectory.forces,
        trajectory.speeds(),
        interval_s,
        settings.imu.errors,
        settings.seed,
    )
    elapsed_ns = np.arange(1, samples + 1, dtype=np.int64) * period_ns
    end_ns = int(elapsed_ns[-1])
    rows = {
        channels.IMU.topic: Columns.build(
            start_ns + elapsed_ns,
            {"angular_rate_body_rad_s": data.rates, "specific_force_body_m_s2": data.forces},
        )
    }
    for unit in scenario.units:
        rows[channels.IMU_UNIT.at(unit=unit.name)] = _unit(unit, moved, end_ns, settings.seed)
    if settings.gnss.fixes:
        fixes = _fixes(settings, trajectory, start_ns, end_ns)
        rows[channels.GNSS_FIX.at(receiver=settings.gnss.receiver)] = fixes
    told: dict[str, str] = {}
    if scenario.setup.receivers:
        signals = settings.truth.signals
        scene = Scene(trajectory, origin, start_ns, end_ns, settings.seed, signals)
        observed, told = observe(scenario.setup, scene)
        rows.update(observed)
    rows[channels.TRUTH.topic] = _truth(settings, trajectory, data, start_ns, end_ns)
    return rows, told


def _unit(unit: Unit, moved: Moved, end_ns: int, seed: int) -> Columns:
    """Samples of a further inertial unit until the last one of the first."""
    period_ns = round(time.NS_PER_S / unit.rate)
    samples, interval_s = end_ns // period_ns, period_ns / time.NS_PER_S
    trajectory = Trajectory.follow(moved.trajectory.motion, interval_s, samples)
    data = imu.measure(
        trajectory.rates,
        trajectory.forces,
        trajectory.speeds(),
        interval_s,
        unit.errors,
        seed,
        f"imu.{unit.name}",
    )
    return Columns.build(
        moved.start_ns + np.arange(1, samples + 1, dtype=np.int64) * period_ns,
        {"angular_rate_body_rad_s": data.rates, "specific_force_body_m_s2": data.forces},
    )


def _fixes(settings: Settings, trajectory: Trajectory, start_ns: int, end_ns: int) -> Columns:
    """Fixes at every epoch after the start that no outage covers."""
    receiver = settings.gnss
    period_ns = round(time.NS_PER_S / receiver.rate)
    elapsed_ns = np.arange(1, end_ns // period_ns + 1, dtype=np.int64) * period_ns
    poses = trajectory.poses(elapsed_ns / time.NS_PER_S)
    made = gnss.fix(
        poses, receiver.lever_arm, period_ns / time.NS_PER_S, receiver.errors, settings.seed
    )
    seen = np.ones(len(elapsed_ns), dtype=np.bool_)
    for begin_s, end_s in receiver.outages:
        begin, end = round(begin_s * time.NS_PER_S), round(end_s * time.NS_PER_S)
        seen &= (elapsed_ns < begin) | (elapsed_ns >= end)
    count = int(np.count_nonzero(seen))
    values = {
        "position_ecef_m": made.positions[seen],
        "position_covariance_enu_m2": made.position_covariances[seen],
        "antenna_lever_arm_body_m": np.tile(np.array(receiver.lever_arm), (count, 1)),
        "quality": np.full(count, gnss.quality(receiver.grade), dtype=np.int32),
    }
    if receiver.velocity:
        values["velocity_ecef_m_s"] = made.velocities[seen]
        values["velocity_covariance_enu_m2_s2"] = made.velocity_covariances[seen]
    valid_ns = start_ns + elapsed_ns[seen]
    latency_ns = round(receiver.latency * time.NS_PER_S)
    return Columns.build(valid_ns, values, log_time_ns=valid_ns + latency_ns)


def _truth(
    settings: Settings, trajectory: Trajectory, data: imu.ImuData, start_ns: int, end_ns: int
) -> Columns:
    """The exact motion of the IMU, with the biases of the sample that each time lies in."""
    period_ns = round(time.NS_PER_S / settings.truth.rate)
    elapsed_ns = np.arange(0, end_ns // period_ns + 1, dtype=np.int64) * period_ns
    poses = trajectory.poses(elapsed_ns / time.NS_PER_S)
    sample_ns = end_ns // len(data.rates)
    sample = np.maximum((elapsed_ns + sample_ns - 1) // sample_ns - 1, 0)
    count = len(elapsed_ns)
    values = {
        "position_ecef_m": np.ascontiguousarray(poses["r"]),
        "lever_arm_body_m": np.zeros((count, 3)),
        "quality": np.full(count, gnss_pb2.FIX_QUALITY_UNKNOWN, dtype=np.int32),
        "velocity_enu_m_s": np.ascontiguousarray(poses["v_enu"]),
        "attitude_rad": np.ascontiguousarray(poses["attitude"]),
        "gyro_bias_body_rad_s": data.gyro_bias[sample],
        "accel_bias_body_m_s2": data.accel_bias[sample],
    }
    return Columns.build(start_ns + elapsed_ns, values)


def _batches(rows: Mapping[str, Columns]) -> Iterable[dict[str, Columns]]:
    """Rows of all channels, cut into spans of log time."""
    first = min(int(columns.log_time_ns[0]) for columns in rows.values() if len(columns))
    last = max(int(columns.log_time_ns[-1]) for columns in rows.values() if len(columns))
    for begin in range(first, last + 1, _BATCH_NS):
        yield {
            topic: columns.take(
                slice(*np.searchsorted(columns.log_time_ns, [begin, begin + _BATCH_NS]).tolist())
            )
            for topic, columns in rows.items()
        }
