"""Wide lanes of an epoch of precise point positioning, and what follows from them.

A wide lane is the difference of a satellite's ambiguities in two slots, less that of its
system's reference. Its wavelength is long (0.75 m for E1/E5a, 0.86 m for L1/L2, 5.9 m for L2/L5)
and codes tell it without the geometry, but to what they are biased by: the biases of codes that
products state are good to some centimetres, and reflections last. The lane is therefore
rounded with a deviation of its own beside the filter's. What is known of position and
ambiguities given the lanes is what a filter would know had its codes been without that error.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.types import Array

# Odds for the nearest integer against the next one, as a logarithm: ten thousand to one.
_ODDS: Final = 9.2


@njit(cache=True)
def find_lanes(candidates: Array, count: int, lower: Array) -> int:
    """For each candidate that of the same satellite in the slot before, or minus one.

    Parameters
    ----------
    candidates : array of CANDIDATE_DTYPE
    count : int
    lower : int64 array (count,)
        Filled.

    Returns
    -------
    int
        How many have one.
    """
    lanes = 0
    for i in range(count):
        lower[i] = -1
        for j in range(count):
            same = candidates[j]["satellite"] == candidates[i]["satellite"]
            if same and candidates[j]["slot"] == candidates[i]["slot"] - 1:
                lower[i] = j
                lanes += 1
    return lanes


@njit(cache=True)
def sure_integer(value: float, variance: float) -> bool:
    """Whether the odds for the integer nearest to `value` are high.

    With f the distance to it and a normal error they are exp((1 - 2 f) / (2 variance)).
    """
    fraction = abs(value - np.floor(value + 0.5))
    return bool(0.5 - fraction > _ODDS * variance)


@njit(cache=True)
def _given(
    i: int, j: int, miss: float, variance: float, a: Array, Q: Array, Qx: Array, x: Array,
    P: Array, gain: Array,
) -> None:  # fmt: skip
    """Condition all on a_j - a_i being less by `miss`."""
    n = a.shape[0]
    w = 1.0 / variance
    for k in range(n):
        gain[k] = Q[k, j] - Q[k, i]
    for c in range(3):
        gain[n + c] = Qx[c, j] - Qx[c, i]
    for k in range(n):
        a[k] -= gain[k] * w * miss
        for m in range(n):
            Q[k, m] -= gain[k] * gain[m] * w
    for c in range(3):
        x[c] -= gain[n + c] * w * miss
        for k in range(n):
            Qx[c, k] -= gain[n + c] * gain[k] * w
        for d in range(3):
            P[c, d] -= gain[n + c] * gain[n + d] * w


@njit(cache=True)
def fix_lanes(
    candidates: Array, lower: Array, sigma: float, a: Array, Q: Array, Qx: Array, x: Array,
    P: Array, lanes: Array, known: Array,
) -> int:  # fmt: skip
    """Round the wide lanes, surest first, and condition all else on them.

    Parameters
    ----------
    candidates : array of CANDIDATE_DTYPE
    lower : int64 array (n,)
        Of :func:`find_lanes`.
    sigma : float, m
        Deviation of a lane beside that which the filter knows.
    a, Q, Qx : float64 arrays (n,), (n, n), (3, n)
        Ambiguities (cycle), their covariance and that with the position (m cycle); changed.
    x, P : float64 arrays (3,), (3, 3)
        Position (m, ECEF) and covariance; changed.
    lanes, known : int64 arrays (n,)
        Filled: ambiguity of the slot before less this one, and 1 where it is known.

    Returns
    -------
    int
        How many are known.
    """
    n = a.shape[0]
    gain = np.empty(n + 3)
    for i in range(n):
        known[i] = 0
    found = 0
    while True:
        best, least = -1, 0.0
        for i in range(n):
            j = lower[i]
            if j < 0 or known[i] == 1:
                continue
            # Cycles of the lane in a metre.
            scale = 1.0 / candidates[j]["wavelength"] - 1.0 / candidates[i]["wavelength"]
            own = Q[j, j] - 2.0 * Q[i, j] + Q[i, i]
            total = (own if own > 0.0 else 0.0) + sigma * sigma * scale * scale
            if (best < 0 or total < least) and sure_integer(a[j] - a[i], total):
                best, least = i, total
        if best < 0:
            return found
        j = lower[best]
        lane = a[j] - a[best]
        whole = int(np.floor(lane + 0.5))
        lanes[best] = whole
        known[best] = 1
        found += 1
        own = Q[j, j] - 2.0 * Q[best, j] + Q[best, best]
        if own > 0.0:
            _given(best, j, lane - whole, own, a, Q, Qx, x, P, gain)


@njit(cache=True)
def keep_known(candidates: Array, count: int, lower: Array, known: Array, places: Array) -> int:
    """Take satellites out of the candidates whose lanes are not all known.

    Parameters
    ----------
    candidates : array of CANDIDATE_DTYPE
        Those that are kept move to the front.
    count : int
    lower, known : int64 arrays (count,)
    places : int64 array (count,)
        Filled: where each that is kept stood.

    Returns
    -------
    int
        How many are kept.
    """
    kept = 0
    for i in range(count):
        whole = True
        for j in range(count):
            if candidates[j]["satellite"] == candidates[i]["satellite"]:
                whole = whole and (lower[j] < 0 or known[j] == 1)
        if whole:
            places[kept] = i
            kept += 1
    for k in range(kept):
        # Places never decrease below k: nothing is overwritten before it is read.
        if places[k] != k:
            candidates[k] = candidates[places[k]]
    return kept


@njit(cache=True)
def integers_of(
    candidates: Array, count: int, places: Array, lower: Array, lanes: Array, known_first: Array
) -> None:
    """Integers of all slots from those of the first and the lanes.

    Parameters
    ----------
    candidates : array of CANDIDATE_DTYPE
        Integers are filled.
    count : int
    places, lower, lanes : int64 arrays
        Of :func:`keep_known`, :func:`find_lanes`, :func:`fix_lanes`, before any was taken out.
    known_first : int64 array
        Integers of the first slot, in the order of the candidates.
    """
    before = np.zeros(lower.shape[0], dtype=np.int64)
    first = 0
    for i in range(count):
        if candidates[i]["slot"] == 0:
            candidates[i]["integer"] = known_first[first]
            before[places[i]] = known_first[first]
            first += 1
    slot = 1
    left = count - first
    while left > 0:
        for i in range(count):
            if candidates[i]["slot"] == slot:
                place = places[i]
                before[place] = before[lower[place]] - lanes[place]
                candidates[i]["integer"] = before[place]
                left -= 1
        slot += 1
