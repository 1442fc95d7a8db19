"""Truth at the times of a solution: interpolated, never the nearest row, never across a gap.

A row of truth 10 ms off is 15 cm off at 15 m/s. A time is served where it lies
between two rows of truth that are at most twice the median interval apart (with a
thousandth of it as tolerance for jitter), or on a row.
"""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.evaluate.geometry import Floats, enu_axes, turn_back
from replay.log.columns import Columns
from replay.schemas import gnss_pb2
from replay.time import NS_PER_S

Rows = npt.NDArray[np.int64]

MAX_GAP_INTERVALS: Final = 2.0
_GAP_TOLERANCE: Final = 1e-3  # of an interval
_FIXED: Final = (gnss_pb2.FIX_QUALITY_RTK_FIXED, gnss_pb2.FIX_QUALITY_PPP_FIXED)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Aligned:
    """Between which rows of truth each usable row of a solution lies.

    Attributes
    ----------
    rows : int64 array (m,)
        Rows of the solution.
    before, after : int64 array (m,)
        Rows of truth; equal where the times are.
    fraction : float64 array (m,)
        Of the interval that has elapsed.
    interval_s : float64 array (m,), s
    """

    rows: Rows
    before: Rows
    after: Rows
    fraction: Floats
    interval_s: Floats

    def linear(self, values: Floats) -> Floats:
        """Values (n, k) of truth on straight lines, (m, k)."""
        weight = self.fraction[:, None]
        return values[self.before] * (1.0 - weight) + values[self.after] * weight

    def angles(self, values_rad: Floats) -> Floats:
        """Angles (n, k), rad of truth, the short way round between two rows."""
        first = values_rad[self.before]
        step = values_rad[self.after] - first
        step = np.mod(step + np.pi, 2.0 * np.pi) - np.pi
        return np.asarray(first + step * self.fraction[:, None])

    def cubic(self, values: Floats, rates: Floats) -> Floats:
        """Values (n, k) on cubic Hermite curves with rates (n, k) per second.

        Where a row of truth has no rate (NaN), the curve is a straight line.
        """
        s, h = self.fraction[:, None], self.interval_s[:, None]
        before, after = self.before, self.after
        step = values[after] - values[before]
        curve = (
            values[before]
            + s * s * (3.0 - 2.0 * s) * step
            + s * (1.0 - s) * h * ((1.0 - s) * rates[before] - s * rates[after])
        )
        known = np.asarray(np.isfinite(curve).all(axis=1))
        return np.asarray(np.where(known[:, None], curve, self.linear(values)))


def known_rows(truth: Columns, *fields: str, fixed_only: bool = False) -> Columns:
    """Rows of truth that hold the fields, finite, one per time, in the order of time.

    Parameters
    ----------
    truth : Columns of replay.Truth
    fields : str
        Vector fields; a row without one of them is left out.
    fixed_only : bool
        Leave out rows whose ambiguities are not fixed.
    """
    keep = np.ones(len(truth), dtype=np.bool_)
    for field in fields:
        if field not in truth.values:
            keep[:] = False
            break
        keep &= truth.is_present(field) & np.isfinite(truth[field]).all(axis=1)
    if fixed_only:
        keep &= np.isin(truth["quality"], _FIXED)
    rows = np.flatnonzero(keep)
    _, first = np.unique(truth.valid_time_ns[rows], return_index=True)
    return truth.take(rows[first])


def align(times_ns: Rows, truth_ns: Rows) -> Aligned:
    """Brackets of times between rows of truth.

    Parameters
    ----------
    times_ns : int64 array (n,), GPS ns
        In any order.
    truth_ns : int64 array (m,), GPS ns
        Ascending, each once.
    """
    if len(truth_ns) == 0 or len(times_ns) == 0:
        none = np.empty(0, dtype=np.int64)
        return Aligned(none, none, none, np.empty(0), np.empty(0))
    last = len(truth_ns) - 1
    before = np.clip(np.searchsorted(truth_ns, times_ns, side="right") - 1, 0, last)
    elapsed = times_ns - truth_ns[before]
    exact = elapsed == 0
    after = np.where(exact, before, np.minimum(before + 1, last))
    interval = truth_ns[after] - truth_ns[before]
    longest = 0.0
    if last > 0:
        longest = (MAX_GAP_INTERVALS + _GAP_TOLERANCE) * float(np.median(np.diff(truth_ns)))
    inside = (elapsed >= 0) & (elapsed <= interval)
    rows = np.flatnonzero(exact | (inside & (interval <= longest)))
    lengths = interval[rows]
    fraction = np.where(lengths > 0, elapsed[rows] / np.maximum(lengths, 1), 0.0)
    return Aligned(rows, before[rows], after[rows], fraction, lengths / NS_PER_S)


def truth_positions(aligned: Aligned, truth: Columns) -> Floats:
    """Truth's ECEF positions (m, 3), m at aligned times.

    Parameters
    ----------
    aligned : Aligned
        Of the times of `truth`.
    truth : Columns of replay.Truth
        Rows of :func:`known_rows`; velocities, where they are, shape the curve.
    """
    position = truth["position_ecef_m"].astype(np.float64)
    if "velocity_enu_m_s" not in truth.values:
        return aligned.linear(position)
    velocity = np.where(
        truth.is_present("velocity_enu_m_s")[:, None],
        truth["velocity_enu_m_s"].astype(np.float64),
        np.nan,
    )
    return aligned.cubic(position, turn_back(enu_axes(position), velocity))
