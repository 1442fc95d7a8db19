"""Sensors that are polled: readings that repeat, and the clock behind a poll's jitter.

A host that polls a little faster than the sensor samples reads some samples twice,
and its times jitter by up to a period. A repeated reading holds nothing new, but a
filter would take it for a second measurement; and a jittering interval is, at a
rate of turn, an error of attitude. So a spec may ask to leave repeats out, and to
stamp what is left by a second-order phase-locked loop that follows the poll's
times with a time constant. The loop looks back only, so it could run live.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from replay import time
from replay.importers.table import Int64, Mask
from replay.log.columns import Column, Ragged

_SETTLE_ROWS: Final = 1000  # the loop starts with the mean interval of these
_LOST_INTERVALS: Final = 20.0  # further off than that, the sensor paused: start anew


def repeats(values: Mapping[str, Column], rows: Int64) -> Mask:
    """Which of the rows hold exactly what the row before holds.

    Parameters
    ----------
    values : mapping of field to column
    rows : int64 array (n,)
        Rows in the order of time.

    Returns
    -------
    bool array (n,)
    """
    same = np.ones(len(rows), dtype=np.bool_)
    same[:1] = False
    for column in values.values():
        if isinstance(column, Ragged):
            raise TypeError("a polled sensor gives numbers of one length")
        picked = column[rows].reshape(len(rows), -1)
        same[1:] &= (picked[1:] == picked[:-1]).all(axis=1)
    return same


def steady_times(times_ns: Int64, time_constant_s: float) -> Int64:
    """Times of a steady sensor from the jittering ones of its poll.

    Parameters
    ----------
    times_ns : int64 array (n,)
        Ascending.
    time_constant_s : float, s
        Of the critically damped loop.

    Returns
    -------
    int64 array (n,), ns
        Ascending; a pause in the times stays a pause.
    """
    if len(times_ns) < 2:
        return times_ns
    settle = min(len(times_ns), _SETTLE_ROWS)
    mean = int(times_ns[settle - 1] - times_ns[0]) / (settle - 1)
    ratio = mean / (time_constant_s * time.NS_PER_S)
    phase_gain, period_gain = 2.0 * ratio, ratio * ratio
    origin = int(times_ns[0])
    result = np.empty(len(times_ns), dtype=np.int64)
    result[0] = origin
    phase, period = 0.0, mean
    for row, read in enumerate((times_ns[1:] - origin).tolist(), start=1):
        phase += period
        error = read - phase
        if abs(error) > _LOST_INTERVALS * period:
            phase = float(read)
        else:
            phase += phase_gain * error
            period += period_gain * error
        result[row] = max(origin + round(phase), int(result[row - 1]) + 1)
    return result
