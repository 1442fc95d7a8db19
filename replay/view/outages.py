"""Spans without GNSS: those that were cut on purpose and those that show as gaps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.evaluate.outages import GAP_INTERVALS, Span, cut_spans

_FEWEST_FIXES: Final = 3


def find_outages(
    metadata: Mapping[str, Mapping[str, str]],
    fix_times_ns: Iterable[npt.NDArray[np.int64]],
    end_ns: int | None,
) -> tuple[Span, ...]:
    """Outages in the order of time.

    Parameters
    ----------
    metadata : mapping
        Metadata records of the log.
    fix_times_ns : iterable of int64 arrays, GPS ns
        Valid times of each receiver's fixes.
    end_ns : int or None, GPS ns
        End of the run, so that fixes which stop early count too.

    Returns
    -------
    tuple of Span
        A gap that a cut outage explains is not told twice.
    """
    cut = list(cut_spans(metadata) or ())
    gaps = [
        gap
        for gap in _gaps(list(fix_times_ns), end_ns)
        if not any(gap.start_ns < c.end_ns and c.start_ns < gap.end_ns for c in cut)
    ]
    return tuple(sorted(cut + gaps))


def _gaps(fix_times_ns: list[npt.NDArray[np.int64]], end_ns: int | None) -> list[Span]:
    times = np.unique(np.concatenate(fix_times_ns)) if fix_times_ns else np.empty(0, np.int64)
    if len(times) < _FEWEST_FIXES:
        return []
    limit = GAP_INTERVALS * float(np.median(np.diff(times)))
    if end_ns is not None and end_ns > times[-1]:
        times = np.append(times, end_ns)
    wide = np.flatnonzero(np.diff(times) > limit)
    return [Span(int(times[i]), int(times[i + 1])) for i in wide]


def inside(times_ns: npt.NDArray[np.int64], outages: Iterable[Span]) -> npt.NDArray[np.bool_]:
    """Which times lie within an outage, ends included."""
    mask = np.zeros(len(times_ns), dtype=np.bool_)
    for outage in outages:
        mask |= (times_ns >= outage.start_ns) & (times_ns <= outage.end_ns)
    return mask
