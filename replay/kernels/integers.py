"""Integers of an epoch, whatever filter they belong to: search, test, memory, hold.

A filter lists its candidates; what follows is the same for differences to a base and for
differences between satellites.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.ambiguity import OK, bootstrapped_success
from replay.kernels.ambiguity_search import resolve, resolve_partial, w_ratio
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.kalman import scalar_update
from replay.kernels.rtk_records import PARTIAL_SUCCESS, TEST_W_RATIO
from replay.kernels.types import Array, Record

CANDIDATE_DTYPE: Final = np.dtype(
    [
        ("measure", "<i8"),
        ("satellite", "<i8"),
        ("reference", "<i8"),  # satellite
        ("slot", "<i8"),
        ("state", "<i8"),
        ("base", "<i8"),  # state of the reference
        ("wavelength", "<f8"),  # m
        ("elevation", "<f8"),  # rad
        ("value", "<f8"),  # cycle
        ("variance", "<f8"),  # cycle^2
        ("integer", "<i8"),
    ],
    align=True,
)

# What an attempt at the integers gave.
ATTEMPT_DTYPE: Final = np.dtype(
    [
        ("count", "<i8"),
        ("fixed", "<i8"),
        ("ratio", "<f8"),
        ("w_ratio", "<f8"),
        ("success", "<f8"),
        ("passed", "<i8"),
        ("whole", "<i8"),  # 1 where every candidate has an integer
        ("x", "<f8", 3),  # m, ECEF, position given the integers
        ("cov", "<f8", (3, 3)),  # m^2, ECEF
    ],
    align=True,
)

# What a search does next; else the number of satellites that it has left out.
DONE: Final = -2
_ALL_AGAIN: Final = -1

_NODES: Final = 20_000
_APART_SIGMAS: Final = 4.0
_LARGEST_RATIO: Final = 9999.9


@njit(cache=True)
def difference_floats(
    candidates: Array, count: int, x: Array, P: Array, a: Array, Q: Array, Qx: Array
) -> None:
    """Float double differences (cycle), their covariance, and that with the position.

    Parameters
    ----------
    candidates : array of CANDIDATE_DTYPE
    count : int
    x, P
        States and covariance.
    a, Q, Qx : float64 arrays (count,), (count, count), (3, count)
        Filled; `Qx` in m cycle.
    """
    for i in range(count):
        p, q = candidates[i]["state"], candidates[i]["base"]
        scale = 1.0 / candidates[i]["wavelength"]
        a[i] = (x[p] - x[q]) * scale
        for j in range(i + 1):
            u, v = candidates[j]["state"], candidates[j]["base"]
            value = (P[p, u] - P[p, v]) - (P[q, u] - P[q, v])
            value *= scale / candidates[j]["wavelength"]
            Q[i, j] = value
            Q[j, i] = value
        for c in range(3):
            Qx[c, i] = (P[c, p] - P[c, q]) * scale
        candidates[i]["value"] = a[i]
        candidates[i]["variance"] = Q[i, i]


@njit(cache=True)
def condition(
    miss: Array, Qx: Array, L: Array, D: Array, Zt: Array, first: int, x: Array, P: Array,
    out: Record,
) -> None:  # fmt: skip
    """Position and covariance given that z = Zt a has integers from `first` on.

    Parameters
    ----------
    miss : float64 array (n,)
        Float less integer, decorrelated, from `first` on.
    Qx : float64 array (3, n)
        Covariance of the position with the ambiguities.
    L, D, Zt
        Zt Q Zt' = L' D L.
    x, P
        Float states and covariance; the position comes first.
    out : record of ATTEMPT_DTYPE
    """
    n = D.shape[0]
    w = np.empty((4, n))
    for k in range(n - 1, first - 1, -1):
        for c in range(4):
            value = miss[k] if c == 3 else 0.0
            if c < 3:
                for i in range(n):
                    value += Qx[c, i] * Zt[k, i]
            for i in range(k + 1, n):
                value -= L[i, k] * w[c, i]
            w[c, k] = value
    for c in range(3):
        value = x[c]
        for k in range(first, n):
            value -= w[c, k] * w[3, k] / D[k]
        out["x"][c] = value
        for d in range(3):
            value = P[c, d]
            for k in range(first, n):
                value -= w[c, k] * w[d, k] / D[k]
            out["cov"][c, d] = value


@njit(cache=True)
def clear_attempt(out: Record, count: int) -> None:
    """An attempt at so many candidates that has found nothing."""
    out["count"] = count
    out["fixed"] = 0
    out["passed"] = 0
    out["whole"] = 0
    out["ratio"] = 0.0
    out["w_ratio"] = 0.0
    out["success"] = 0.0


@njit(cache=True)
def search_integers(
    a: Array, Q: Array, Qx: Array, x: Array, P: Array, cfg: Record, integers: Array, out: Record
) -> None:
    """Search for the integers of float ambiguities, test the best ones, give the position then.

    Parameters
    ----------
    a, Q, Qx : float64 arrays (n,), (n, n), (3, n)
        Ambiguities (cycle), their covariance, that of the position with them (m cycle).
    x, P
        Float states and covariance; the position comes first.
    cfg : record
        With `partial`, `success`, `test`, `threshold` and `least` of RTK_CONFIG_DTYPE.
    integers : int64 array (n,)
        Filled where all are known (`whole`).
    out : record of ATTEMPT_DTYPE
        Cleared by :func:`clear_attempt`; filled.
    """
    count = a.shape[0]
    fixed, norms = np.zeros((2, count), dtype=np.int64), np.zeros(2)
    L, D = np.zeros((count, count)), np.zeros(count)
    Zt = np.zeros((count, count), dtype=np.int64)
    inverse = np.zeros((count, count), dtype=np.int64)
    first = 0
    if cfg["partial"] == PARTIAL_SUCCESS:
        conditional, covariance = np.zeros(count), np.zeros((count, count))
        status, first, separation = resolve_partial(
            a, Q, cfg["success"], _NODES, fixed, norms, conditional, covariance, L, D, Zt, inverse
        )
    else:
        status, separation = resolve(a, Q, _NODES, fixed, norms, L, D, Zt, inverse)
    if status != OK:
        return
    out["ratio"] = _LARGEST_RATIO
    if norms[0] * _LARGEST_RATIO > norms[1]:
        out["ratio"] = norms[1] / norms[0]
    out["w_ratio"] = w_ratio(norms[0], norms[1], separation)
    out["success"] = bootstrapped_success(D, first)
    statistic = out["w_ratio"] if cfg["test"] == TEST_W_RATIO else out["ratio"]
    sure = statistic >= cfg["threshold"] and out["success"] >= cfg["success"]
    miss = np.zeros(count)
    for k in range(first, count):
        total = 0.0
        for i in range(count):
            total += Zt[k, i] * a[i]
        if cfg["partial"] == PARTIAL_SUCCESS:
            # Candidates of a partial search are combinations already.
            miss[k] = total - fixed[0, k]
        else:
            whole = 0
            for i in range(count):
                whole += Zt[k, i] * fixed[0, i]
            miss[k] = total - whole
    condition(miss, Qx, L, D, Zt, first, x, P, out)
    if first == 0:
        out["whole"] = 1
        for i in range(count):
            value = fixed[0, i]
            if cfg["partial"] == PARTIAL_SUCCESS:
                value = 0
                for k in range(count):
                    value += fixed[0, k] * inverse[k, i]
            integers[i] = value
    if sure and count - first >= cfg["least"]:
        out["passed"] = 1
        out["fixed"] = count - first


@njit(cache=True)
def next_try(
    measures: Array, total: int, seen: Array, eligible: Array, s: Record, cfg: Record,
    drops: int, count: int, turn: int, left_out: Array, tries: Array,
) -> int:  # fmt: skip
    """After an attempt at the integers: whether to try again, and without which satellites.

    Where all candidates fail, satellites are left out one after another: the newest ambiguity
    goes first, among those of one age the lowest satellite. Where that helps nobody, all are
    tried again, so that candidates and attempt are those of all.

    Parameters
    ----------
    measures : array
        With `pair`, `satellite` and `slot`.
    total : int
        Measures.
    seen : array
        Pairs of the measures, with `elevation`.
    eligible : int64 array (total,)
        1 where the satellite of a measure may be left out for its sake.
    s : record
        With `lock`, the epochs in use of each ambiguity.
    cfg : record
        With `least` and `proven`.
    drops : int
        Satellites to leave out at most.
    count : int
        Candidates of the attempt.
    turn : int
        0 for the first attempt, else what the call before returned.
    left_out : int64 array (SATELLITES,)
        1 where a satellite is left out; changed.
    tries : array (2,) of ATTEMPT_DTYPE
        The attempt is in the first one, or, while satellites are left out (`turn` > 0), in the
        second one. At the end the first one holds.

    Returns
    -------
    int
        DONE, or with what to try again.
    """
    if turn == _ALL_AGAIN:
        return DONE
    if turn == 0 and (tries[0]["passed"] == 1 or drops == 0):
        return DONE
    if turn > 0 and count >= cfg["least"] and tries[1]["passed"] == 1:
        tries[0] = tries[1]
        return DONE
    worst, lowest, young = -1, 0.0, 0
    if turn < drops and (turn == 0 or count >= cfg["least"]):
        for k in range(total):
            m = measures[k]
            satellite = m["satellite"]
            if eligible[k] == 0 or left_out[satellite] == 1:
                continue
            elevation = seen[m["pair"]]["elevation"]
            age = min(s["lock"][satellite, m["slot"]], cfg["proven"])
            if worst < 0 or age < young or (age == young and elevation < lowest):
                worst, lowest, young = satellite, elevation, age
    if worst < 0:
        left_out[:] = 0
        return _ALL_AGAIN
    left_out[worst] = 1
    return turn + 1


@njit(cache=True)
def same_integers(candidates: Array, count: int, s: Record) -> bool:
    """Whether the integers agree with the last ones of the same satellites.

    References may have changed: of each group the integers may differ by one number.
    """
    begin = 0
    while begin < count:
        base, slot = candidates[begin]["base"], candidates[begin]["slot"]
        reference = candidates[begin]["reference"]
        known = s["known"][reference, slot] == 1
        offset = -s["integer"][reference, slot] if known else 0
        i = begin
        while i < count and candidates[i]["base"] == base:
            satellite = candidates[i]["satellite"]
            if s["known"][satellite, slot] == 1:
                gap = candidates[i]["integer"] - s["integer"][satellite, slot]
                if not known:
                    known = True
                    offset = gap
                if gap != offset:
                    return False
            i += 1
        begin = i
    return True


@njit(cache=True)
def keep_integers(candidates: Array, count: int, s: Record) -> None:
    """Remember the integers of an epoch; a reference has zero."""
    for satellite in range(SATELLITES):
        for slot in range(SLOTS):
            s["known"][satellite, slot] = 0
    for i in range(count):
        c = candidates[i]
        s["integer"][c["satellite"], c["slot"]] = c["integer"]
        s["known"][c["satellite"], c["slot"]] = 1
        s["integer"][c["reference"], c["slot"]] = 0
        s["known"][c["reference"], c["slot"]] = 1


@njit(cache=True)
def near_float(tried: Record, x: Array, P: Array, cfg: Record) -> bool:
    """Whether the position given the integers is one that the float one allows."""
    for c in range(3):
        spread = P[c, c] - tried["cov"][c, c]
        limit = cfg["apart"] + _APART_SIGMAS * sqrt(spread if spread > 0.0 else 0.0)
        if not abs(tried["x"][c] - x[c]) <= limit:
            return False
    return True


@njit(cache=True)
def prove(candidates: Array, count: int, s: Record, cfg: Record, first: int) -> bool:
    """Compare integers with those before and keep them; False where proven ones outweigh them.

    Like ones add to the proof. Others begin with a proof of `first`, where what was before is
    not proven or was doubted often enough in a row.
    """
    if same_integers(candidates, count, s):
        s["doubt"] = 0
        s["proof"] += 1
    elif s["proof"] >= cfg["proven"] and s["doubt"] < cfg["confirm"]:
        s["doubt"] += 1
        return False
    else:
        s["doubt"] = 0
        s["proof"] = first
    keep_integers(candidates, count, s)
    return True


@njit(cache=True)
def hold(candidates: Array, count: int, x: Array, P: Array, n: int, cfg: Record) -> None:
    """Feed the integers back as measurements of the ambiguities."""
    h, index = np.zeros(2), np.zeros(2, dtype=np.int64)
    b, gain, dx = np.zeros(n), np.zeros(n), np.zeros(n)
    for i in range(count):
        c = candidates[i]
        if not c["elevation"] >= cfg["hold_mask"]:
            continue
        weight = 1.0 / (cfg["hold_sigma"] * c["wavelength"])
        index[0], index[1] = c["state"], c["base"]
        h[0], h[1] = weight, -weight
        z = c["wavelength"] * c["integer"] - (x[c["state"]] - x[c["base"]])
        scalar_update(P, n, h, index, 2, weight * z, dx, b, gain)
    for i in range(n):
        x[i] += dx[i]
