"""Biases of signals and the Earth's rotation at a time."""

import math
from typing import Final

import numpy as np
from numba import njit

from replay.kernels.precise_orbits import row_before
from replay.kernels.types import Array

BIAS_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns, valid from; 0 for always
        ("until", "<i8"),  # ns, valid to before this; 0 for always
        ("first", "<i8"),  # observation, as `observation_number`
        ("second", "<i8"),  # observation that is taken off, 0 for none
        ("value", "<f8"),  # s
        ("std", "<f8"),  # s; NaN where not stated
    ],
    align=True,
)
ROTATION_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns
        ("value", "<f8", 4),  # rad, rad, s, s: pole x, pole y, UT1 - UTC, length of day
        ("rate", "<f8", 2),  # rad/s, of the pole; NaN where not stated
    ],
    align=True,
)

_DAY_S: Final = 86_400.0
_HALF_S: Final = 0.5


@njit(cache=True)
def observation_number(kind: int, band: int, attribute: int) -> int:
    """Number of an observation from the three bytes of its RINEX 3 name."""
    return kind + 256 * (band + 256 * attribute)


@njit(cache=True)
def signal_bias(
    biases: Array, first: int, end: int, observation: int, second: int, time_ns: int
) -> float:
    """Bias (s) of an observation, or of one less another, NaN where none is known.

    It is subtracted from what was observed, times c.

    Parameters
    ----------
    biases : array of BIAS_DTYPE
        Those of the satellite stand from `first` to `end`.
    observation, second : int
        As :func:`observation_number`; `second` is 0 for the bias of one observation alone. A
        difference that is known the other way round is turned.
    time_ns : int, ns
    """
    found = math.nan
    for k in range(first, end):
        row = biases[k]
        if row["t"] > time_ns or (row["until"] != 0 and row["until"] <= time_ns):
            continue
        if row["first"] == observation and row["second"] == second:
            found = row["value"]
        elif second != 0 and row["first"] == second and row["second"] == observation:
            found = -row["value"]
    return found


@njit(cache=True)
def earth_rotation(rows: Array, time_ns: int, beyond_s: float, out: Array) -> bool:
    """Pole (rad), UT1 - UTC (s) and length of day (s) at a time.

    Between two epochs along a straight line, a leap second of UT1 - UTC aside; beyond them by
    the rates of the nearest.

    Parameters
    ----------
    rows : array of ROTATION_DTYPE, in the order of time
    time_ns : int, ns
    beyond_s : float, s
        How far from the nearest epoch an answer is given.
    out : float64 array (4,), written where known

    Returns
    -------
    bool
        Whether it is known.
    """
    n = rows.shape[0]
    if n == 0:
        return False
    k = row_before(rows, 0, n, time_ns)
    if 0 <= k < n - 1:
        a, b = rows[k], rows[k + 1]
        weight = (time_ns - a["t"]) / (b["t"] - a["t"])
        for i in range(4):
            step = b["value"][i] - a["value"][i]
            if i == 2:
                step -= math.floor(step + _HALF_S)
            out[i] = a["value"][i] + weight * step
        return True
    row = rows[max(k, 0)]
    dt = (time_ns - row["t"]) / 1e9
    if abs(dt) > beyond_s:
        return False
    for i in range(4):
        out[i] = row["value"][i]
    for i in range(2):
        if row["rate"][i] == row["rate"][i]:
            out[i] += row["rate"][i] * dt
    # The length of day is what UT1 loses in a day.
    out[2] -= row["value"][3] * dt / _DAY_S
    return True
