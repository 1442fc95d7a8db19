"""What is kept of one run: its errors at every epoch of GNSS, and where it drifted in outages.

Errors are against the simulator's truth. Those against the reference are their differences
from the reference's own, which is exact because both stand in the axes of the truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.batch.sweep.measure import Measures
from replay.evaluate import outages
from replay.evaluate.align import Rows, align, known_rows, truth_positions
from replay.evaluate.errors_enu import Errors, attitude_errors, position_errors, velocity_errors
from replay.evaluate.geometry import Floats
from replay.evaluate.read import RunChannels, read_run
from replay.evaluate.satellites import ALL, dilution, satellite_counts
from replay.evaluate.statistics import ANGLES, LOCAL_AXES
from replay.evaluate.status import updated
from replay.log.columns import Columns
from replay.time import NS_PER_S

POSITION, VELOCITY, ATTITUDE = "position_m", "velocity_m_s", "attitude_deg"
QUANTITIES: Final = {POSITION: LOCAL_AXES, VELOCITY: LOCAL_AXES, ATTITUDE: ANGLES}
TIME, UPDATED, SATELLITES, PDOP = "time_ns", "updated", "satellites", "pdop"
OUTAGES: Final = "outage_ns"  # first and last time of each; a figure would lose nanoseconds
PATH: Final = ("x_ecef_m", "y_ecef_m", "z_ecef_m")
END, MOST, BEFORE = "end_m", "most_m", "before_m"
_NEAR_NS: Final = NS_PER_S // 20  # between a row of the solution and its epoch


def measure(run_log: Path) -> Measures:
    """Errors at the epochs of GNSS of a run, and its drifts."""
    return measures_of(read_run(run_log))


def measures_of(data: RunChannels) -> Measures:
    """The same of channels that were read; epochs are truth's where there are no observations."""
    order = np.argsort(data.solution.valid_time_ns, kind="stable")
    solution = data.solution.take(order)
    seen = data.observations_ns
    times = np.unique(data.truth.valid_time_ns) if seen is None else seen
    position = position_errors(solution, data.truth, antenna_arm_m=data.antenna_arm_m)
    velocity = velocity_errors(solution, data.truth)
    attitude = attitude_errors(solution, data.truth)
    rows = rows_at(solution.valid_time_ns, times)
    found = {
        POSITION: _at(position, rows, len(solution)),
        VELOCITY: _at(velocity, rows, len(solution)),
        ATTITUDE: np.degrees(_at(attitude, rows, len(solution))),
    }
    series: dict[str, npt.NDArray[np.generic]] = {TIME: times}
    for quantity, axes in QUANTITIES.items():
        for index, axis in enumerate(axes):
            series[f"{quantity}.{axis}"] = found[quantity][:, index].astype(np.float32)
    used = np.append(updated(solution), False)
    series[UPDATED] = used[rows].astype(np.float32)
    series |= _sky(data.geometry, times)
    series |= _path(data.truth, times)
    figures: dict[str, float | str] = {"epochs": float(len(times))}
    for quantity, axes in QUANTITIES.items():
        for index, axis in enumerate(axes):
            known = found[quantity][:, index]
            known = known[np.isfinite(known)]
            if len(known):
                figures[f"{quantity}.{axis}.rms"] = float(np.sqrt(np.mean(known * known)))
    spans = outages.cut_spans(data.metadata) or ()
    series[OUTAGES] = np.array([t for s in spans for t in (s.start_ns, s.end_ns)], dtype=np.int64)
    figures |= _drifts(spans, solution, position, attitude)
    return Measures(figures, series)


def rows_at(solution_ns: Rows, epochs_ns: Rows) -> Rows:
    """Row of a solution at each epoch: the last of the nearest time; -1 where none is near.

    Parameters
    ----------
    solution_ns : int64 array (n,), GPS ns
        Ascending; a filter may write a row before and one after an update.
    epochs_ns : int64 array (m,), GPS ns
    """
    if len(solution_ns) == 0:
        return np.full(len(epochs_ns), -1)
    after = np.minimum(np.searchsorted(solution_ns, epochs_ns), len(solution_ns) - 1)
    before = np.maximum(after - 1, 0)
    later = np.abs(solution_ns[after] - epochs_ns) <= np.abs(epochs_ns - solution_ns[before])
    nearest = solution_ns[np.where(later, after, before)]
    rows = np.searchsorted(solution_ns, nearest, side="right") - 1
    return np.asarray(np.where(np.abs(nearest - epochs_ns) <= _NEAR_NS, rows, -1))


def _at(errors: Errors, rows: Rows, count: int) -> Floats:
    """Errors (m, 3) of rows of a solution of `count` rows; NaN where there is none."""
    every = np.full((count + 1, 3), np.nan)
    every[errors.rows] = errors.values
    return every[rows]  # row -1 is the one after the last


def _sky(geometry: Columns | None, times: Rows) -> dict[str, npt.NDArray[np.generic]]:
    if geometry is None or len(geometry) == 0:
        return {}
    order = np.argsort(geometry.valid_time_ns, kind="stable")
    rows = rows_at(geometry.valid_time_ns[order], times)
    values = (satellite_counts(geometry)[ALL], dilution(geometry, "pdop"))
    return {
        name: np.append(value[order], np.nan)[rows].astype(np.float32)
        for name, value in zip((SATELLITES, PDOP), values, strict=True)
    }


def _path(truth: Columns, times: Rows) -> dict[str, npt.NDArray[np.generic]]:
    known = known_rows(truth, "position_ecef_m")
    aligned = align(times, known.valid_time_ns)
    path = np.full((len(times), 3), np.nan)
    path[aligned.rows] = truth_positions(aligned, known)
    return {name: np.ascontiguousarray(path[:, index]) for index, name in enumerate(PATH)}


def _drifts(
    spans: Sequence[outages.Span], solution: Columns, position: Errors, attitude: Errors
) -> dict[str, float | str]:
    """Errors at the end of each outage that was cut, before it, and the most in it."""
    updates = np.unique(solution.valid_time_ns[updated(solution)])
    figures: dict[str, float | str] = {}
    for number, span in enumerate(spans, 1):
        found = outages.measure(span, solution, updates, position, attitude)
        name = f"outage.{number}"
        if found.drift_time_ns is None:
            continue
        during = (position.times_ns > span.start_ns) & (position.times_ns < span.end_ns)
        before = position.values[position.times_ns < span.start_ns]
        drift = (found.east_drift_m, found.north_drift_m, found.up_drift_m)
        for index, axis in enumerate(LOCAL_AXES):
            value = drift[index]
            if value is None:
                continue
            inside = np.abs(position.values[during, index])
            figures[f"{name}.{axis}.{END}"] = value
            figures[f"{name}.{axis}.{MOST}"] = max(
                abs(value), float(inside.max()) if len(inside) else 0.0
            )
            if len(before):
                figures[f"{name}.{axis}.{BEFORE}"] = float(before[-1, index])
    return figures
