"""A counter of ticks to GPS time, through the host times of arrivals.

Each time tag says how much of the file had arrived; the last line that was whole
by then gives a pair of tick and host time. A straight line through the pairs
mends the counter's scale. Arrivals are late by transport and buffering: what
remains of that is the spec's `offset`.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Literal

import numpy as np

from replay.errors import ForeignFileError
from replay.importers.rtklib_tag import Tag
from replay.importers.table import Float64, Int64

_NS_PER_MS = 1_000_000


@dataclasses.dataclass(frozen=True, slots=True)
class Fit:
    """Host time = start + at_ms + scale (tick - tick_ms).

    Attributes
    ----------
    scale : float
        Host milliseconds per tick millisecond.
    tick_ms, at_ms : float, ms
        A point of the line, the host's from the start of the tag.
    residual_ms : float, ms
        Root mean square of host time minus line.
    pairs : int
    """

    scale: float
    tick_ms: float
    at_ms: float
    residual_ms: float
    pairs: int

    def times_ns(self, tag: Tag, tick_ms: Float64) -> Int64:
        """GPS nanoseconds of ticks, int64 array (n,)."""
        elapsed = self.at_ms + self.scale * (tick_ms - self.tick_ms)
        return tag.start_ns + np.rint(elapsed * _NS_PER_MS).astype(np.int64)


def fit_ticks(
    tag: Tag, ends: Int64, tick_ms: Float64, method: Literal["linear", "span"], where: str
) -> Fit:
    """Line through pairs of tick and host time.

    Parameters
    ----------
    tag : Tag
    ends : int64 array (n,)
        Position in the recorded file at which each row's line ended.
    tick_ms : float64 array (n,), ms
    method : "linear" or "span"
        Least squares, or through the first and the last pair.
    where : str
        File, for messages.

    Raises
    ------
    ForeignFileError
        Where fewer than two ticks can be paired.
    """
    row = np.searchsorted(ends, tag.position, side="right") - 1
    # Beyond the last line the tag speaks of rows that this file has not.
    paired = (row >= 0) & (tag.position <= ends[-1])
    paired[paired] = np.isfinite(tick_ms[row[paired]])
    x, y = tick_ms[row[paired]], tag.elapsed_ms[paired].astype(np.float64)
    if len(x) < 2 or x[0] == x[-1]:
        raise ForeignFileError(
            "fewer than two ticks can be paired with host times",
            where=where,
            mend="is it the tag of this file, and does recorded_line_end fit?",
        )
    if method == "span":
        at_x, at_y = float(x[0]), float(y[0])
        scale = float((y[-1] - y[0]) / (x[-1] - x[0]))
    else:
        # math.fsum rounds once, so the sums are the same on every machine.
        at_x, at_y = math.fsum(x) / len(x), math.fsum(y) / len(y)
        dx, dy = x - at_x, y - at_y
        scale = math.fsum(dx * dy) / math.fsum(dx * dx)
    error = (y - at_y) - scale * (x - at_x)
    return Fit(scale, at_x, at_y, math.sqrt(math.fsum(error * error) / len(x)), len(x))
