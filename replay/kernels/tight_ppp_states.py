"""States of satellites and receiver on an inertial system: the clock's way, births and ends.

The states of precise point positioning stand behind those of the inertial system and the
vehicle; where an epoch brings or ends satellites they are packed anew. What the inertial
system is to them is the antenna: its position and velocity with the lever arm.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.covariance import (
    ATTITUDE,
    GYRO_BIAS,
    GYRO_SCALE,
    POSITION,
    VELOCITY,
)
from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.ppp_states import begin_again
from replay.kernels.rotation import cross3, rotate3, rotate3_back
from replay.kernels.state_names import name_precise
from replay.kernels.tight_ppp_records import LEAD, WALK
from replay.kernels.transition import carry_rate, repack
from replay.kernels.types import Array, Record
from replay.kernels.update import state_count, total_count

ANTENNA_STATES: Final = 15
"""States that the antenna's position and velocity depend on, at most."""
_DOUBT_M2: Final = 1e4
_DOUBT_M2_S2: Final = 1e2


@njit(cache=True)
def carry_clock(s: Record, g: Record, q: Record, cfg: Record, pcfg: Record, trail: Record) -> None:
    """Carry the receiver's clock and its drift to the filter's time.

    Parameters
    ----------
    s, g, q : records of `state_dtype`, TIGHT_PPP_STATE_DTYPE, PPP_STATE_DTYPE
    cfg, pcfg : records of CONFIG_DTYPE, TIGHT_PPP_CONFIG_DTYPE
    trail : record
    """
    dt = (s["t"] - g["clock_t"]) * 1e-9
    g["clock_t"] = s["t"]
    if dt <= 0.0 or q["clock"] < 0 or q["drift"] < 0:
        return
    P, n, first, aux = s["P"], total_count(s, cfg), state_count(cfg), s["aux"]
    c, d = q["clock"] - LEAD, q["drift"] - LEAD
    a, b = first + c, first + d
    if pcfg["clock"] == WALK:
        aux[c] += dt * aux[d]
        for j in range(n):
            P[a, j] += dt * P[b, j]
        for j in range(n):
            P[j, a] += dt * P[j, b]
        P[a, a] += pcfg["clock_noise"] * dt + pcfg["drift_noise"] * dt * dt * dt / 3.0
        P[a, b] += pcfg["drift_noise"] * dt * dt / 2.0
        P[b, a] = P[a, b]
        for j in range(n):
            P[j, a] = P[a, j]
        if trail["on"] == 1:
            carry_rate(trail, a, b, dt)
    P[b, b] += pcfg["drift_noise"] * dt


@njit(cache=True)
def repack_states(
    s: Record, cfg: Record, A: Array, n: int, source: Array, grow: Array, J: Array, trail: Record
) -> int:
    """Bring the joint covariance into the order that the states have now.

    Parameters
    ----------
    s, cfg : records of `state_dtype`, CONFIG_DTYPE
        With the covariance of the order before; changed.
    A : float64 array (n, n)
        Its diagonal is the prior of states that are new.
    n : int
        States, those of the antenna's motion included.
    source : int64 array
        Which state before each one was, minus one where it is new.
    grow : float64 array
        Variance that each one gains.
    J : float64 array
        Scratch for the joint covariance.
    trail : record

    Returns
    -------
    int
        Joint states now.
    """
    P, first = s["P"], state_count(cfg)
    size = first + n - LEAD
    same = s["extra"] == n - LEAD
    for j in range(LEAD, n):
        same = same and source[j] == j
    if not same:
        old = first + s["extra"]
        for i in range(old):
            for j in range(old):
                J[i, j] = P[i, j]
        for i in range(size):
            a = i if i < first else first + source[i - first + LEAD] - LEAD
            if i >= first and source[i - first + LEAD] < LEAD:
                for j in range(size):
                    P[i, j] = 0.0
                P[i, i] = A[i - first + LEAD, i - first + LEAD]
                continue
            for j in range(first):
                P[i, j] = J[a, j]
            for j in range(LEAD, n):
                b = source[j]
                P[i, first + j - LEAD] = J[a, first + b - LEAD] if b >= LEAD else 0.0
        if trail["on"] == 1:
            places = np.empty(size, dtype=np.int64)
            for j in range(LEAD, n):
                b = source[j]
                places[first + j - LEAD] = first + b - LEAD if b >= LEAD else -1
            repack(trail, first, size, places)
    for j in range(LEAD, n):
        if source[j] >= LEAD:
            P[first + j - LEAD, first + j - LEAD] += grow[j]
    s["extra"] = n - LEAD
    return size


@njit(cache=True)
def antenna_rows(s: Record, cfg: Record, work: Record, lever: Array, G: Array, index: Array) -> int:
    """Sensitivity of the antenna's position and velocity (ECEF) to the error states.

    With a = C l and b = C (w_ib x l), position: dr + psi x a; velocity: dv + psi x b
    - w_ie x (psi x a) + C (dw x l), where dw of the rate is minus bias and minus scale
    factor times rate, over one plus scale factor (Kan et al. 2022, eq. 7; Groves 14.126).

    Parameters
    ----------
    s, cfg, work : records
        `work["w"]` is the rate (3,) with its errors taken off.
    lever : float64 array (3,), m, body
    G : float64 array (6, 15)
        Filled.
    index : int64 array (15,)
        Filled: the states.

    Returns
    -------
    int
        How many states.
    """
    C, w, sg = s["nav"]["C"], work["w"], s["sg"]
    a0, a1, a2 = rotate3(C, lever[0], lever[1], lever[2])
    c0, c1, c2 = cross3(w[0], w[1], w[2], lever[0], lever[1], lever[2])
    b0, b1, b2 = rotate3(C, c0, c1, c2)
    count = ANTENNA_STATES if cfg["states"] == 21 else 12
    for i in range(3):
        index[i] = POSITION + i
        index[3 + i] = VELOCITY + i
        index[6 + i] = ATTITUDE + i
        index[9 + i] = GYRO_BIAS + i
        index[12 + i] = GYRO_SCALE + i
    for i in range(6):
        for j in range(count):
            G[i, j] = 1.0 if i == j else 0.0
    for i in range(3):
        e0 = 1.0 if i == 0 else 0.0
        e1 = 1.0 if i == 1 else 0.0
        e2 = 1.0 if i == 2 else 0.0
        G[i, 6], G[i, 7], G[i, 8] = cross3(a0, a1, a2, e0, e1, e2)
        p0, p1, p2 = cross3(b0, b1, b2, e0, e1, e2)
        q0, q1, q2 = cross3(a0, a1, a2, -e1 * EARTH_RATE_RAD_S, e0 * EARTH_RATE_RAD_S, 0.0)
        G[3 + i, 6] = p0 + q0
        G[3 + i, 7] = p1 + q1
        G[3 + i, 8] = p2 + q2
        f0, f1, f2 = rotate3_back(C, e0, e1, e2)
        g0, g1, g2 = cross3(f0, f1, f2, lever[0], lever[1], lever[2])
        g0 /= 1.0 + sg[0]
        g1 /= 1.0 + sg[1]
        g2 /= 1.0 + sg[2]
        G[3 + i, 9] = g0
        G[3 + i, 10] = g1
        G[3 + i, 11] = g2
        if count == ANTENNA_STATES:
            G[3 + i, 12] = g0 * w[0]
            G[3 + i, 13] = g1 * w[1]
            G[3 + i, 14] = g2 * w[2]
    return count


@njit(cache=True)
def antenna_view(
    s: Record, cfg: Record, G: Array, index: Array, count: int, x: Array, P: Array
) -> int:
    """Covariance of the antenna and the states behind it, as a filter without a unit has it.

    Parameters
    ----------
    s, cfg : records of `state_dtype`, CONFIG_DTYPE
    G, index, count
        As :func:`antenna_rows` gives them.
    x : float64 array
        Its states behind the motion are filled.
    P : float64 array
        Filled: position and velocity first.

    Returns
    -------
    int
        States.
    """
    joint, first = s["P"], state_count(cfg)
    n = LEAD + s["extra"]
    for i in range(LEAD):
        for j in range(i, LEAD):
            total = 0.0
            for a in range(count):
                if G[i, a] != 0.0:
                    part = 0.0
                    for b in range(count):
                        part += joint[index[a], index[b]] * G[j, b]
                    total += G[i, a] * part
            P[i, j] = total
            P[j, i] = total
        for k in range(s["extra"]):
            total = 0.0
            for a in range(count):
                total += G[i, a] * joint[index[a], first + k]
            P[i, LEAD + k] = total
            P[LEAD + k, i] = total
    for j in range(s["extra"]):
        x[LEAD + j] = s["aux"][j]
        for k in range(s["extra"]):
            P[LEAD + j, LEAD + k] = joint[first + j, first + k]
    return n


@njit(cache=True)
def doubt(s: Record, q: Record) -> None:
    """Widen position and velocity, and forget all states of satellites and receiver."""
    P = s["P"]
    for i in range(3):
        P[POSITION + i, POSITION + i] += _DOUBT_M2
        P[VELOCITY + i, VELOCITY + i] += _DOUBT_M2_S2
    begin_again(q)
    s["extra"] = 0


@njit(cache=True)
def name_states(q: Record, first: int, name: Array) -> None:
    """Number the names of the states behind those of the inertial system and the vehicle.

    Parameters
    ----------
    q : record of PPP_STATE_DTYPE
    first : int
        States of the inertial system and the vehicle.
    name : int64 array
        Filled.
    """
    name_precise(q, first - LEAD, name)
