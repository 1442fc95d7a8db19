"""Integers of a baseline between two known positions: wide lane, then L1, then L2.

The float filter is that of :mod:`replay.kernels.rtk_states` with the position held, slant
ionospheric delays and wet delays among the states, so that its ambiguities on both
frequencies are those of the ionosphere-free and the geometry-free combinations at once.
Lee (2010), section 3: the wide lane N1 - N2 (0.86 m) is looked for first; given it, N1 is
what the ionosphere-free phase tells (0.11 m); N2 follows. Each step is a search among all
satellites (LAMBDA) whose best vector has to stand apart from the second one.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.ambiguity import OK, bootstrapped_success
from replay.kernels.ambiguity_search import resolve, w_ratio
from replay.kernels.kalman import scalar_update
from replay.kernels.rtk_records import TEST_W_RATIO
from replay.kernels.types import Array, Record

WIDE: Final = 0
FIRST: Final = 1
SECOND: Final = 2

_NODES: Final = 20_000
_LARGEST_RATIO: Final = 9999.9
_HOLD_M: Final = 1e-4  # deviation of what is taken as known


@njit(cache=True)
def _weights(c: Record, level: int, index: Array, weight: Array) -> int:
    """States and weights (1/m) of a double difference: of the wide lane, or of one frequency."""
    slot = 1 if level == SECOND else 0
    index[0] = c["state"][slot]
    index[1] = c["base"][slot]
    weight[0] = 1.0 / c["wavelength"][slot]
    weight[1] = -weight[0]
    if level != WIDE:
        return 2
    index[2] = c["state"][1]
    index[3] = c["base"][1]
    weight[2] = -1.0 / c["wavelength"][1]
    weight[3] = -weight[2]
    return 4


@njit(cache=True)
def floats(
    found: Array, chosen: Array, count: int, level: int, x: Array, P: Array, a: Array, Q: Array
) -> None:
    """Float double differences (cycle) and their covariance.

    Parameters
    ----------
    found : array of INTEGER_DTYPE
    chosen : int64 array
        Which of them.
    count, level : int
    x, P : float64 arrays
        States and covariance of the baseline.
    a, Q : float64 arrays (count,), (count, count)
        Filled.
    """
    index, weight = np.zeros((count, 4), dtype=np.int64), np.zeros((count, 4))
    terms = 0
    for i in range(count):
        terms = _weights(found[chosen[i]], level, index[i], weight[i])
        a[i] = 0.0
        for c in range(terms):
            a[i] += weight[i, c] * x[index[i, c]]
    for i in range(count):
        for j in range(i + 1):
            total = 0.0
            for c in range(terms):
                for d in range(terms):
                    total += weight[i, c] * weight[j, d] * P[index[i, c], index[j, d]]
            Q[i, j] = total
            Q[j, i] = total


@njit(cache=True)
def condition_on(
    c: Record, level: int, value: int, x: Array, P: Array, n: int,
    b: Array, gain: Array, dx: Array,
) -> None:  # fmt: skip
    """Take one double difference as known.

    Parameters
    ----------
    c : record of INTEGER_DTYPE
    level, value : int
        Wide lane or first frequency, and its integer.
    x, P : float64 arrays
        Changed.
    n : int
        States.
    b, gain, dx : float64 arrays (n,)
        Scratch.
    """
    index, weight = np.zeros(4, dtype=np.int64), np.zeros(4)
    terms = _weights(c, level, index, weight)
    scale = c["wavelength"][0] / _HOLD_M
    z = float(value)
    for k in range(terms):
        z -= weight[k] * x[index[k]]
        weight[k] *= scale
    for i in range(n):
        dx[i] = 0.0
    scalar_update(P, n, weight, index, terms, z * scale, dx, b, gain)
    for i in range(n):
        x[i] += dx[i]


@njit(cache=True)
def _clear(out: Record, cfg: Record) -> None:
    """A step that has tried nothing."""
    out["candidates"] = 0
    out["fixed"] = 0
    out["ratio"] = 0.0
    out["w_ratio"] = 0.0
    out["success"] = 0.0
    out["threshold"] = cfg["threshold"]


@njit(cache=True)
def search_step(
    found: Array, count: int, least: int, level: int, x: Array, P: Array, cfg: Record, out: Record
) -> bool:
    """Look for the integers of one step; leave out satellites until the test passes.

    The youngest go first, among those of one age the lowest.

    Parameters
    ----------
    found : array of INTEGER_DTYPE
        Those with ``active`` take part; of those that are left out it is cleared. Integers
        are filled.
    count, least, level : int
    x, P : float64 arrays
    cfg : record of INTEGERS_CONFIG_DTYPE
    out : record of STEP_ROW_DTYPE
        Filled but for times, signal and what is known; that of the first try where none passes.

    Returns
    -------
    bool
        Whether a set of integers passed.
    """
    chosen = np.zeros(count, dtype=np.int64)
    _clear(out, cfg)
    turn = 0
    while True:
        m = 0
        for k in range(count):
            if found[k]["active"] == 1:
                chosen[m] = k
                m += 1
        if turn == 0:
            out["candidates"] = m
        if m < least or m == 0:
            return False
        a, Q = np.empty(m), np.empty((m, m))
        floats(found, chosen, m, level, x, P, a, Q)
        fixed, norms = np.zeros((2, m), dtype=np.int64), np.zeros(2)
        L, D = np.zeros((m, m)), np.zeros(m)
        Zt, inverse = np.zeros((m, m), dtype=np.int64), np.zeros((m, m), dtype=np.int64)
        status, separation = resolve(a, Q, _NODES, fixed, norms, L, D, Zt, inverse)
        passed = False
        if status == OK:
            ratio = _LARGEST_RATIO
            if norms[0] * _LARGEST_RATIO > norms[1]:
                ratio = norms[1] / norms[0]
            w = w_ratio(norms[0], norms[1], separation)
            success = bootstrapped_success(D, 0)
            statistic = w if cfg["test"] == TEST_W_RATIO else ratio
            passed = statistic >= cfg["threshold"] and success >= cfg["success"]
            if turn == 0 or passed:
                out["ratio"] = ratio
                out["w_ratio"] = w
                out["success"] = success
        if passed:
            out["fixed"] = m
            for i in range(m):
                if level == WIDE:
                    found[chosen[i]]["wide"] = fixed[0, i]
                else:
                    found[chosen[i]]["first"] = fixed[0, i]
            return True
        turn += 1
        worst = chosen[0]
        for i in range(1, m):
            one, other = found[chosen[i]], found[worst]
            if one["age"] < other["age"] or (
                one["age"] == other["age"] and one["elevation"] < other["elevation"]
            ):
                worst = chosen[i]
        found[worst]["active"] = 0


@njit(cache=True)
def search_integers(
    found: Array, count: int, least: int, x: Array, P: Array, n: int, cfg: Record, steps: Array
) -> bool:
    """Both steps; `active` tells afterwards whose integers were found.

    Parameters
    ----------
    found : array of INTEGER_DTYPE
    count, least : int
    x, P : float64 arrays
        Changed: the wide lanes that passed are taken as known.
    n : int
        States.
    cfg : record of INTEGERS_CONFIG_DTYPE
    steps : array (2,) of STEP_ROW_DTYPE
        Filled.

    Returns
    -------
    bool
        Whether any integers were found.
    """
    for k in range(count):
        found[k]["active"] = 1
    _clear(steps[FIRST], cfg)
    if not search_step(found, count, least, WIDE, x, P, cfg, steps[WIDE]):
        for k in range(count):
            found[k]["active"] = 0
        return False
    b, gain, dx = np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(count):
        if found[k]["active"] == 1:
            condition_on(found[k], WIDE, found[k]["wide"], x, P, n, b, gain, dx)
    if not search_step(found, count, least, FIRST, x, P, cfg, steps[FIRST]):
        for k in range(count):
            found[k]["active"] = 0
        return False
    return True
