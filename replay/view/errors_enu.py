"""How far a solution is from the truth.

Truth is interpolated to the times of the solution, never past its ends and
never across a gap of more than twice its median interval. The solution is
moved to the point that the truth is about, with its own attitude.
"""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.log.columns import Columns
from replay.time import NS_PER_S
from replay.view.fields import doubles
from replay.view.frame import (
    Floats,
    body_to_enu_matrices,
    ecef_to_enu_matrices,
    geodetic,
    rotate,
    shifted_ecef,
)

MAX_GAP_INTERVALS: Final = 2.0
_FEWEST_ROWS: Final = 2


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Solution minus truth where both are known.

    Attributes
    ----------
    rows : int64 array (m,)
        Rows of the solution that the errors belong to.
    times_ns : int64 array (m,), GPS ns
    values : array (m, 3)
        East, north, up or roll, pitch, heading; unit after the function.
    """

    rows: npt.NDArray[np.int64]
    times_ns: npt.NDArray[np.int64]
    values: Floats


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Bracket:
    """Between which two rows of truth each usable row of the solution lies."""

    rows: npt.NDArray[np.int64]
    left: npt.NDArray[np.int64]
    fraction: Floats
    interval_s: Floats

    def linear(self, values: Floats) -> Floats:
        weight = self.fraction[:, None]
        return values[self.left] * (1.0 - weight) + values[self.left + 1] * weight

    def hermite(self, values: Floats, rates: Floats) -> Floats:
        s, h = self.fraction[:, None], self.interval_s[:, None]
        before, after = self.left, self.left + 1
        return (
            (1 + 2 * s) * (1 - s) ** 2 * values[before]
            + s * (1 - s) ** 2 * h * rates[before]
            + s**2 * (3 - 2 * s) * values[after]
            + s**2 * (s - 1) * h * rates[after]
        )


def _bracket(times_ns: npt.NDArray[np.int64], truth_ns: npt.NDArray[np.int64]) -> _Bracket:
    if len(truth_ns) < _FEWEST_ROWS or len(times_ns) == 0:
        none = np.empty(0, dtype=np.int64)
        return _Bracket(none, none, np.empty(0), np.empty(0))
    intervals = np.diff(truth_ns)
    left = np.clip(np.searchsorted(truth_ns, times_ns, side="right") - 1, 0, len(truth_ns) - 2)
    elapsed = times_ns - truth_ns[left]
    interval = intervals[left]
    usable = (elapsed >= 0) & (elapsed <= interval) & (interval > 0)
    exact = (elapsed == 0) | (elapsed == interval)  # a gap next to a row of truth does no harm
    usable &= exact | (interval <= MAX_GAP_INTERVALS * np.median(intervals))
    rows = np.flatnonzero(usable)
    return _Bracket(rows, left[rows], elapsed[rows] / interval[rows], interval[rows] / NS_PER_S)


def _known(truth: Columns, *fields: str) -> Columns:
    """Rows of truth that hold the fields, finite, one per time, in the order of time."""
    keep = np.ones(len(truth), dtype=np.bool_)
    for field in fields:
        if field not in truth.values:
            return truth.take(slice(0, 0))
        keep &= truth.is_present(field) & np.isfinite(doubles(truth, field)).all(axis=1)
    rows = np.flatnonzero(keep)
    _, first = np.unique(truth.valid_time_ns[rows], return_index=True)
    return truth.take(rows[first])


def position_errors(solution: Columns, truth: Columns) -> Errors:
    """Position errors at the truth's point.

    Between rows of truth the position is a cubic Hermite curve where truth has
    velocity in every row, else a straight line.

    Parameters
    ----------
    solution : Columns of replay.Solution
    truth : Columns of replay.Truth

    Returns
    -------
    Errors
        East, north, up at the truth's point [m].
    """
    known = _known(truth, "position_ecef_m")
    bracket = _bracket(solution.valid_time_ns, known.valid_time_ns)
    if len(bracket.rows) == 0:
        return _no_errors()
    position = doubles(known, "position_ecef_m")
    if len(_known(known, "velocity_enu_m_s")) == len(known):
        here = geodetic(position)
        to_enu = ecef_to_enu_matrices(here[:, 0], here[:, 1])
        velocity = rotate(np.swapaxes(to_enu, 1, 2), doubles(known, "velocity_enu_m_s"))
        reference = bracket.hermite(position, velocity)
    else:
        reference = bracket.linear(position)
    point, _ = shifted_ecef(
        doubles(solution, "position_ecef_m")[bracket.rows],
        doubles(solution, "attitude_rad")[bracket.rows],
        bracket.linear(doubles(known, "lever_arm_body_m")),
    )
    at = geodetic(reference)
    enu = rotate(ecef_to_enu_matrices(at[:, 0], at[:, 1]), point - reference)
    return _finite(solution, bracket.rows, enu)


def velocity_errors(solution: Columns, truth: Columns) -> Errors:
    """Velocity errors east, north, up [m/s] at the truth's point, truth interpolated linearly."""
    known = _known(truth, "velocity_enu_m_s")
    bracket = _bracket(solution.valid_time_ns, known.valid_time_ns)
    if len(bracket.rows) == 0:
        return _no_errors()
    lever = bracket.linear(doubles(known, "lever_arm_body_m"))
    rate = doubles(solution, "angular_rate_body_rad_s")[bracket.rows]
    turn = body_to_enu_matrices(doubles(solution, "attitude_rad")[bracket.rows])
    at_imu = doubles(solution, "velocity_enu_m_s")[bracket.rows]
    velocity = at_imu + rotate(turn, np.cross(rate, lever))
    reference = bracket.linear(doubles(known, "velocity_enu_m_s"))
    return _finite(solution, bracket.rows, velocity - reference)


def attitude_errors(solution: Columns, truth: Columns) -> Errors:
    """Differences of roll, pitch and heading [rad], wrapped, truth interpolated linearly."""
    known = _known(truth, "attitude_rad")
    bracket = _bracket(solution.valid_time_ns, known.valid_time_ns)
    if len(bracket.rows) == 0:
        return _no_errors()
    reference = bracket.linear(np.unwrap(doubles(known, "attitude_rad"), axis=0))
    difference = doubles(solution, "attitude_rad")[bracket.rows] - reference
    return _finite(solution, bracket.rows, np.mod(difference + np.pi, 2 * np.pi) - np.pi)


def _finite(solution: Columns, rows: npt.NDArray[np.int64], values: Floats) -> Errors:
    keep = np.isfinite(values).all(axis=1)
    return Errors(rows[keep], solution.valid_time_ns[rows[keep]], values[keep])


def _no_errors() -> Errors:
    none = np.empty(0, dtype=np.int64)
    return Errors(none, none, np.empty((0, 3)))
