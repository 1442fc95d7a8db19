"""States of relative positioning on an inertial system: one joint covariance.

Error states are those of the inertial system and of the vehicle, then those of
:mod:`replay.kernels.rtk_states` but the rover's position, which the inertial system has.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.covariance import ATTITUDE, POSITION
from replay.kernels.records import MAX_STATES
from replay.kernels.rotation import cross3, rotate3
from replay.kernels.rtk_records import ROOM
from replay.kernels.types import Array, Record

LEAD: Final = 3
RTK_TIGHT_STATES: Final = MAX_STATES + ROOM - LEAD
"""Error states at most: those of the inertial system, and of the differences all but position."""


@njit(cache=True)
def lever_arm(s: Record, lever: Array, arm: Array) -> None:
    """Lever arm in ECEF into `arm` (3,)."""
    arm[0], arm[1], arm[2] = rotate3(s["nav"]["C"], lever[0], lever[1], lever[2])


@njit(cache=True)
def antenna_covariance(P: Array, n: int, first: int, arm: Array, out: Array) -> None:
    """Covariance of the antenna's position and the states from `first` on.

    Parameters
    ----------
    P : float64 array
        Joint covariance; states `first` to `n` - 1 are those of the differences.
    n, first : int
    arm : float64 array (3,), m
        Lever arm, ECEF.
    out : float64 array
        Filled up to 3 + n - first: position, then the states.
    """
    G = np.zeros((3, 6))
    for i in range(3):
        e0 = 1.0 if i == 0 else 0.0
        e1 = 1.0 if i == 1 else 0.0
        e2 = 1.0 if i == 2 else 0.0
        G[i, i] = 1.0
        G[i, 3], G[i, 4], G[i, 5] = cross3(arm[0], arm[1], arm[2], e0, e1, e2)
    for i in range(3):
        for j in range(i, 3):
            total = 0.0
            for a in range(6):
                p = POSITION + a if a < 3 else ATTITUDE + a - 3
                for b in range(6):
                    q = POSITION + b if b < 3 else ATTITUDE + b - 3
                    total += G[i, a] * P[p, q] * G[j, b]
            out[i, j] = total
            out[j, i] = total
        for k in range(first, n):
            total = 0.0
            for a in range(6):
                p = POSITION + a if a < 3 else ATTITUDE + a - 3
                total += G[i, a] * P[p, k]
            out[i, LEAD + k - first] = total
            out[LEAD + k - first, i] = total
    for j in range(first, n):
        for k in range(first, n):
            out[LEAD + j - first, LEAD + k - first] = P[j, k]


@njit(cache=True)
def joint_prior(P: Array, first: int, A: Array, n: int, source: Array, J: Array) -> None:
    """Joint covariance with the states packed as the differences' prediction has them.

    Parameters
    ----------
    P : float64 array
        Joint covariance as it is packed now.
    first : int
        States of the inertial system and the vehicle.
    A : float64 array (n + 1, n + 1)
        Predicted covariance of position, other states and room for a clock.
    n : int
    source : int64 array
        Which state before each one was, minus one where it is new.
    J : float64 array (first + n - 2, first + n - 2)
        Filled; the last state is room for a clock.
    """
    size = first + n - LEAD
    for i in range(first):
        for j in range(first):
            J[i, j] = P[i, j]
        for j in range(LEAD, n):
            old = source[j]
            value = P[i, first + old - LEAD] if old >= LEAD else 0.0
            J[i, first + j - LEAD] = value
            J[first + j - LEAD, i] = value
    for i in range(LEAD, n):
        for j in range(LEAD, n):
            J[first + i - LEAD, first + j - LEAD] = A[i, j]
    for i in range(size + 1):
        J[i, size] = 0.0
        J[size, i] = 0.0


@njit(cache=True)
def to_joint(measures: Array, total: int, first: int, arm: Array, joint: Array) -> None:
    """The same measurements on the joint states: the antenna is position and attitude."""
    for k in range(total):
        m, out = measures[k], joint[k]
        out["kind"] = m["kind"]
        out["pair"] = m["pair"]
        out["slot"] = m["slot"]
        out["group"] = m["group"]
        out["satellite"] = m["satellite"]
        out["z"] = m["z"]
        out["r"] = m["r"]
        out["use"] = m["use"]
        h = m["h"]
        for c in range(3):
            out["index"][c] = POSITION + c
            out["index"][3 + c] = ATTITUDE + c
            out["h"][c] = h[c]
        b0, b1, b2 = cross3(arm[0], arm[1], arm[2], h[0], h[1], h[2])
        out["h"][3] = b0
        out["h"][4] = b1
        out["h"][5] = b2
        for c in range(3, m["count"]):
            out["index"][3 + c] = first + m["index"][c] - LEAD
            out["h"][3 + c] = h[c]
        out["count"] = m["count"] + 3
