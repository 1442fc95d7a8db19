"""The orbit and clock that a simulated satellite really has, from one message or several.

A single message is taken as it is, however far from its reference time. Of several, each
holds at its reference time, and between two the state goes over from one to the other by
a share that begins and ends without a slope, so that ranges and their rates are continuous
where a receiver that changes its message sees a step.
"""

import math
from typing import Final

import numpy as np
from numba import njit

from replay.kernels.orbits import SPEED_OF_LIGHT_M_S, satellite_state, state_at_reception
from replay.kernels.sight import line_of_sight
from replay.kernels.types import Array

_PER_NS: Final = 1e-9
_NAN = math.nan


@njit(cache=True)
def between_messages(
    messages: Array, time_ns: int, offset_s: float, limit_s: float
) -> tuple[int, float, float]:
    """Which message holds, the share of the one after it, and how fast that share grows.

    Parameters
    ----------
    messages : array (n,) of EPHEMERIS_DTYPE, n > 0
        Of one satellite, by `toe_ns`, rising.
    time_ns, offset_s : int, ns and float, s
    limit_s : float, s
        A message is not used farther from its reference time.

    Returns
    -------
    number : int
        Minus one where no message is near enough.
    share : float
        0 to 1, of message `number` + 1; 0 where there is none or it is too far.
    rate : float, 1/s
    """
    count = messages.shape[0]
    i = 0
    while i + 1 < count and messages[i + 1]["toe_ns"] <= time_ns:
        i += 1
    since = (time_ns - messages[i]["toe_ns"]) * _PER_NS + offset_s
    if i + 1 == count or since < 0.0:
        return (i if -limit_s <= since <= limit_s else -1), 0.0, 0.0
    span = (messages[i + 1]["toe_ns"] - messages[i]["toe_ns"]) * _PER_NS
    if span > 2.0 * limit_s:
        if since <= limit_s:
            return i, 0.0, 0.0
        return (i + 1 if span - since <= limit_s else -1), 0.0, 0.0
    f = since / span
    if f > 1.0:
        f = 1.0
    return i, f * f * (3.0 - 2.0 * f), 6.0 * f * (1.0 - f) / span


@njit(cache=True)
def true_state(
    messages: Array,
    time_ns: int,
    offset_s: float,
    limit_s: float,
    x: float,
    y: float,
    z: float,
    state: Array,
    other: Array,
) -> float:
    """Satellite at the transmission of what arrives at a place and time, ECEF at reception.

    Parameters
    ----------
    messages, limit_s
        As in :func:`between_messages`, which must have found one.
    time_ns, offset_s : int, ns and float, s
        System time of reception.
    x, y, z : float, m
        Antenna of the receiver, ECEF.
    state : float64 array (8,)
        Filled as :mod:`replay.kernels.orbits` says.
    other : float64 array (8,)
        Scratch.

    Returns
    -------
    float, s
        Travel time in vacuum. Each of two messages has a light time of its own; their
        difference of nanoseconds moves neither by more than some micrometres.
    """
    i, share, rate = between_messages(messages, time_ns, offset_s, limit_s)
    travel = state_at_reception(messages[i], time_ns, offset_s, x, y, z, state)
    if share == 0.0:
        return travel
    state_at_reception(messages[i + 1], time_ns, offset_s, x, y, z, other)
    for k in range(3):
        difference = other[k] - state[k]
        state[k] += share * difference
        state[3 + k] += share * (other[3 + k] - state[3 + k]) + rate * difference
    difference = other[6] - state[6]
    state[6] += share * difference
    state[7] += share * (other[7] - state[7]) + rate * difference
    distance, _, _, _ = line_of_sight(x, y, z, state[0], state[1], state[2])
    return distance / SPEED_OF_LIGHT_M_S


@njit(cache=True)
def states_at(messages: Array, limit_s: float, times_ns: Array, out: Array) -> None:
    """Satellite at system times, ECEF at the same time.

    Parameters
    ----------
    messages, limit_s
        As in :func:`between_messages`.
    times_ns : int64 array (n,), ns, GPS
    out : float64 array (n, 8)
        Rows as :mod:`replay.kernels.orbits` says; NaN where no message is near enough.
    """
    other = np.empty(8)
    for n in range(times_ns.shape[0]):
        state = out[n]
        i, share, rate = between_messages(messages, times_ns[n], 0.0, limit_s)
        if i < 0:
            state[:] = _NAN
            continue
        satellite_state(messages[i], times_ns[n], 0.0, state)
        if share == 0.0:
            continue
        satellite_state(messages[i + 1], times_ns[n], 0.0, other)
        for j in (0, 1, 2, 6):
            k = j + 3 if j < 3 else 7
            difference = other[j] - state[j]
            state[j] += share * difference
            state[k] += share * (other[k] - state[k]) + rate * difference


@njit(cache=True)
def broadcast_errors(
    messages: Array,
    available: Array,
    times_ns: Array,
    known_ns: Array,
    offsets_s: Array,
    positions: Array,
    sights: Array,
    out: Array,
) -> None:
    """True less broadcast range and satellite clock, as a receiver has them.

    Parameters
    ----------
    messages : array (n,) of EPHEMERIS_DTYPE
        What one satellite broadcasts.
    available : int64 array (n,), ns
        When each is known.
    times_ns, known_ns : int64 arrays (e,)
        Epochs by the receiver's clock, and when they are there.
    offsets_s : float64 array (e,)
        True minus the receiver's time.
    positions : float64 array (e, 3), m, ECEF
    sights : array (e,) of SIGHT_DTYPE
    out : float64 array (e,), m
        (range - clock) of the truth less that of the known healthy message nearest in
        time, the later of two; NaN without one, and where the satellite is not seen.
    """
    state = np.empty(8)
    for k in range(times_ns.shape[0]):
        out[k] = _NAN
        if sights[k]["seen"] == 0:
            continue
        best = -1
        nearest = 0
        for i in range(messages.shape[0]):
            if available[i] > known_ns[k] or messages[i]["health"] != 0:
                continue
            distance = abs(times_ns[k] - messages[i]["toe_ns"])
            if best < 0 or distance <= nearest:
                best = i
                nearest = distance
        if best < 0:
            continue
        r = positions[k]
        travel = state_at_reception(
            messages[best], times_ns[k], offsets_s[k], r[0], r[1], r[2], state
        )
        true = sights[k]["travel_s"] - sights[k]["clock_s"]
        out[k] = SPEED_OF_LIGHT_M_S * (true - (travel - state[6]))
