"""Satellite position, velocity and clock between the epochs of precise products.

Positions: Neville's polynomial through the epochs around the time that is asked for, in axes
that do not turn and coincide with ECEF at that time; there a satellite moves more smoothly than
in ECEF. The velocity is the polynomial's derivative, turned back. Clocks: a straight line.

Products stand in arrays, those of one satellite together from `first` to `end` in the order of
their times. A row's `gap` is 1 where nothing may be interpolated between the row before and it:
epochs lack there, or the satellite was moved, or its clock broke. No polynomial goes across.

A time is `time_ns`, GPS nanoseconds, plus `offset_s`, a small number of seconds, as in
:mod:`replay.kernels.orbits`. An array `state` has eight elements: position (3, m) and velocity
(3, m/s) of the centre of mass in ECEF at that time, clock (s, without the periodic relativity)
and its drift (s/s).
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.elementary import sincos, sqrt
from replay.kernels.orbits import MU_M3_S2, SPEED_OF_LIGHT_M_S
from replay.kernels.types import Array, Record

PRECISE_ORBIT_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns
        ("position", "<f8", 3),  # m, ECEF at the epoch, centre of mass
        ("std", "<f8"),  # m, of one axis; NaN where not stated
        ("gap", "<i8"),  # 1: nothing joins it to the row before
    ],
    align=True,
)
PRECISE_CLOCK_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns
        ("clock", "<f8"),  # s, without the periodic relativity
        ("std", "<f8"),  # s; NaN where not stated
        ("gap", "<i8"),
    ],
    align=True,
)
PRECISE_CONFIG_DTYPE: Final = np.dtype(
    [
        ("degree", "<i8"),  # of the polynomial, up to MOST_POINTS - 1
        ("least", "<i8"),  # points that must be there
        ("beyond", "<f8"),  # s for which an orbit is continued past its last epoch
        ("clock_beyond", "<f8"),  # s, the same of a clock
    ],
    align=True,
)

MOST_POINTS: Final = 16
WORK_SHAPE: Final = (MOST_POINTS, 7)
"""Shape of the scratch array that an interpolation needs."""

FOUND: Final = 0
NO_PRODUCT: Final = 1
"""The products do not have the satellite at all."""
OUTSIDE: Final = 2
"""The time is before the first or after the last epoch by more than is allowed."""
IN_GAP: Final = 3
"""The time is between two rows that nothing joins."""
TOO_FEW: Final = 4
"""Fewer points stand together than are asked for."""

_C2: Final = SPEED_OF_LIGHT_M_S * SPEED_OF_LIGHT_M_S


@njit(cache=True)
def row_before(rows: Array, first: int, end: int, time_ns: int) -> int:
    """Number of the last row that is not after a time; `first` - 1 where all are."""
    low, high = first, end
    while low < high:
        middle = (low + high) // 2
        if rows[middle]["t"] <= time_ns:
            low = middle + 1
        else:
            high = middle
    return low - 1


@njit(cache=True)
def _anchor(rows: Array, first: int, end: int, time_ns: int, beyond_s: float) -> tuple[int, int]:
    """Row at which the points are chosen, and a status.

    Inside a gap, a time that is near enough to either side counts as being past that side.
    """
    if first == end:
        return -1, NO_PRODUCT
    beyond = int(beyond_s * 1e9)
    j = row_before(rows, first, end, time_ns)
    if j < first:
        return first, FOUND if rows[first]["t"] - time_ns <= beyond else OUTSIDE
    if rows[j]["t"] == time_ns:
        return j, FOUND
    if j + 1 == end:
        return j, FOUND if time_ns - rows[j]["t"] <= beyond else OUTSIDE
    if rows[j + 1]["gap"] == 0:
        return j, FOUND
    if time_ns - rows[j]["t"] <= beyond:
        return j, FOUND
    if rows[j + 1]["t"] - time_ns <= beyond:
        return j + 1, FOUND
    return j, IN_GAP


@njit(cache=True)
def choose_points(
    rows: Array, first: int, end: int, time_ns: int, count: int, beyond_s: float
) -> tuple[int, int, int]:
    """Rows around a time that nothing parts: the first, the one after the last, a status.

    Parameters
    ----------
    rows : array with fields `t` and `gap`
        Those of one satellite stand from `first` to `end`.
    count : int
        Rows that are wanted; near a gap or an end there may be fewer.
    beyond_s : float, s
        How far past an end or into a gap an answer is given.

    Returns
    -------
    tuple of three int
        As many rows on each side of the time as there can be.
    """
    j, status = _anchor(rows, first, end, time_ns, beyond_s)
    if status != FOUND:
        return first, first, status
    low = j
    high = j + 1
    if rows[j]["t"] < time_ns and high < end and rows[high]["gap"] == 0 and count > 1:
        high += 1  # steps may differ: the time must lie between the points
    while high - low < count:
        left = low > first and rows[low]["gap"] == 0
        right = high < end and rows[high]["gap"] == 0
        if not left and not right:
            break
        # The nearer of the two neighbours; the later one of two that are as near.
        if right and (not left or rows[high]["t"] - time_ns <= time_ns - rows[low - 1]["t"]):
            high += 1
        else:
            low -= 1
    return low, high, FOUND


@njit(cache=True)
def precise_position(
    orbits: Array,
    first: int,
    end: int,
    time_ns: int,
    offset_s: float,
    cfg: Record,
    state: Array,
    work: Array,
) -> tuple[int, float]:
    """Position and velocity of a satellite.

    Parameters
    ----------
    orbits : array of PRECISE_ORBIT_DTYPE
        Those of the satellite stand from `first` to `end`.
    time_ns, offset_s : int and float, ns and s
    cfg : record of PRECISE_CONFIG_DTYPE
    state : float64 array (6 or more,), written where found
    work : float64 array WORK_SHAPE, overwritten

    Returns
    -------
    int
        FOUND, NO_PRODUCT, OUTSIDE, IN_GAP or TOO_FEW.
    float, m
        What the last point changed: about the error of one point less, an upper bound of this.
    """
    at = time_ns + int(offset_s * 1e9)
    wanted = min(cfg["degree"] + 1, MOST_POINTS)
    low, high, status = choose_points(orbits, first, end, at, wanted, cfg["beyond"])
    if status != FOUND:
        return status, 0.0
    n = high - low
    if n < cfg["least"] or n < 2:
        return TOO_FEW, 0.0
    for k in range(n):
        row = orbits[low + k]
        dt = (row["t"] - time_ns) / 1e9 - offset_s
        s, c = sincos(EARTH_RATE_RAD_S * dt)
        x, y = row["position"][0], row["position"][1]
        # ECEF of the epoch to ECEF of the time: the axes have turned on by -dt meanwhile.
        work[k, 0] = dt
        work[k, 1] = c * x - s * y
        work[k, 2] = s * x + c * y
        work[k, 3] = row["position"][2]
        work[k, 4] = 0.0
        work[k, 5] = 0.0
        work[k, 6] = 0.0
    change = 0.0
    for m in range(1, n):
        last = m == n - 1
        for k in range(n - m):
            a, b = work[k, 0], work[k + m, 0]
            width = 1.0 / (a - b)
            for i in range(1, 4):
                p, q = work[k, i], work[k + 1, i]
                value = (a * q - b * p) * width
                if last:
                    change += (value - p) * (value - p)
                rate = (p - q + a * work[k + 1, i + 3] - b * work[k, i + 3]) * width
                work[k, i] = value
                work[k, i + 3] = rate
    for i in range(3):
        state[i] = work[0, 1 + i]
        state[3 + i] = work[0, 4 + i]
    state[3] += EARTH_RATE_RAD_S * state[1]
    state[4] -= EARTH_RATE_RAD_S * state[0]
    return FOUND, sqrt(change)


@njit(cache=True)
def precise_clock(
    clocks: Array,
    first: int,
    end: int,
    time_ns: int,
    offset_s: float,
    beyond_s: float,
    state: Array,
) -> int:
    """Clock and drift of a satellite into elements 6 and 7 of `state`.

    Parameters
    ----------
    clocks : array of PRECISE_CLOCK_DTYPE
        Those of the satellite stand from `first` to `end`.
    time_ns, offset_s : int and float, ns and s
    beyond_s : float, s
        How far past an end or into a gap the line is continued.
    state : float64 array (8,), written where found

    Returns
    -------
    int
        FOUND, NO_PRODUCT, OUTSIDE, IN_GAP or TOO_FEW.
    """
    at = time_ns + int(offset_s * 1e9)
    low, high, status = choose_points(clocks, first, end, at, 2, beyond_s)
    if status != FOUND:
        return status
    if high - low < 2:
        return TOO_FEW
    a, b = clocks[low], clocks[low + 1]
    dt = (time_ns - a["t"]) / 1e9 + offset_s
    drift = (b["clock"] - a["clock"]) / ((b["t"] - a["t"]) / 1e9)
    state[6] = a["clock"] + drift * dt
    state[7] = drift
    return FOUND


@njit(cache=True)
def relativity(state: Array) -> float:
    """Periodic relativistic effect on a satellite's clock (s), -2 r.v / c^2.

    IS-GPS-200N, 20.3.3.3.3.1; precise clocks leave it out. It is the same in turning axes.
    """
    product = state[0] * state[3] + state[1] * state[4] + state[2] * state[5]
    return -2.0 * product / _C2


@njit(cache=True)
def relativity_rate(state: Array) -> float:
    """Rate of :func:`relativity` (s/s), for a satellite that the Earth's centre attracts."""
    vx = state[3] - EARTH_RATE_RAD_S * state[1]
    vy = state[4] + EARTH_RATE_RAD_S * state[0]
    v2 = vx * vx + vy * vy + state[5] * state[5]
    r = sqrt(state[0] * state[0] + state[1] * state[1] + state[2] * state[2])
    return -2.0 * (v2 - MU_M3_S2 / r) / _C2


@njit(cache=True)
def precise_transmission(
    orbits: Array,
    orbit_starts: Array,
    clocks: Array,
    clock_starts: Array,
    satellite: int,
    time_ns: int,
    code_m: float,
    cfg: Record,
    state: Array,
    work: Array,
) -> tuple[int, float]:
    """State of a satellite when it sent what was received.

    Parameters
    ----------
    orbits, clocks : arrays of PRECISE_ORBIT_DTYPE and PRECISE_CLOCK_DTYPE
    orbit_starts, clock_starts : int64 arrays (SATELLITES + 1,)
        Where the rows of each satellite begin.
    satellite : int
        Dense number.
    time_ns : int, ns
        The receiver's clock at reception.
    code_m : float, m
        Pseudorange.
    cfg : record of PRECISE_CONFIG_DTYPE
    state : float64 array (8,), written where found
        ECEF at transmission; the clock and its drift without relativity.
    work : float64 array WORK_SHAPE, overwritten

    Returns
    -------
    int
        FOUND, or what lacks: see :func:`precise_position` and :func:`precise_clock`.
    float, s
        Periodic relativity of the clock.
    """
    first, end = clock_starts[satellite], clock_starts[satellite + 1]
    offset = -code_m / SPEED_OF_LIGHT_M_S
    status = precise_clock(clocks, first, end, time_ns, offset, cfg["clock_beyond"], state)
    if status != FOUND:
        return status, 0.0
    # So far the clock was read at the satellite's own time, which is off by the clock itself.
    state[6] -= state[7] * state[6]
    offset -= state[6]
    first, end = orbit_starts[satellite], orbit_starts[satellite + 1]
    status, _ = precise_position(orbits, first, end, time_ns, offset, cfg, state, work)
    if status != FOUND:
        return status, 0.0
    effect = relativity(state)
    # The clock's relativity moves the moment by some 20 ns, in which the orbit is straight.
    for i in range(3):
        state[i] -= state[3 + i] * effect
    return FOUND, effect
