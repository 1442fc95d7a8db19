"""Integers of an epoch of relative positioning: candidates, search, tests, hold.

Candidates are differences of single-difference ambiguities to that of the highest
satellite of their system and slot. GLONASS takes no part: its satellites differ in
frequency, and receivers in their delays on it.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.ambiguity import COUNT_LIMIT, OK, bootstrapped_success
from replay.kernels.ambiguity_search import resolve, resolve_partial, w_ratio
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import GLONASS, SATELLITES, SLOTS, SYSTEMS
from replay.kernels.kalman import scalar_update
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.rtk_records import PARTIAL_ELEVATION, PARTIAL_SUCCESS, TEST_W_RATIO
from replay.kernels.types import Array, Record

_NODES: Final = 20_000
_LARGEST_RATIO: Final = 9999.9
# Cycles: a phase whose own deviation is more tells no integer.
_BLUR: Final = 0.25

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


@njit(cache=True)
def find_candidates(
    measures: Array, total: int, pairs: Array, rover: Array, s: Record, cfg: Record,
    left_out: Array, candidates: Array,
) -> int:  # fmt: skip
    """List the double differences that may be integers.

    Parameters
    ----------
    measures, pairs, rover : arrays of MEASURE_DTYPE, PAIR_DTYPE, MEASURED_DTYPE
    total : int
        Measures.
    s, cfg : records of RTK_STATE_DTYPE, RTK_CONFIG_DTYPE
    left_out : int64 array (SATELLITES,)
        1 where a satellite is not wanted.
    candidates : array (COUNT_LIMIT,) of CANDIDATE_DTYPE
        Filled.
    """
    highest = np.full((SYSTEMS, SLOTS), -1, dtype=np.int64)
    count = 0
    for turn in range(2):
        for k in range(total):
            m = measures[k]
            satellite, slot = m["satellite"], m["slot"]
            if m["kind"] == 0 or m["use"] == 0 or left_out[satellite] == 1:
                continue
            pair = pairs[m["pair"]]
            system = pair["system"]
            if system == GLONASS or not pair["elevation"] >= cfg["mask_resolve"]:
                continue
            if s["half"][0, satellite, slot] == 1 or s["half"][1, satellite, slot] == 1:
                continue
            if s["lock"][satellite, slot] < cfg["lock"]:
                continue
            wavelength = SPEED_OF_LIGHT_M_S / rover[pair["rover"]]["frequency"][slot]
            if not m["r"] < _BLUR * _BLUR * wavelength * wavelength:
                continue
            best = highest[system, slot]
            if turn == 0:
                if best < 0 or pair["elevation"] > pairs[measures[best]["pair"]]["elevation"]:
                    highest[system, slot] = k
            elif k != best and count < COUNT_LIMIT:
                c = candidates[count]
                count += 1
                reference = measures[best]["satellite"]
                c["measure"] = k
                c["satellite"] = satellite
                c["reference"] = reference
                c["slot"] = slot
                c["state"] = s["amb"][satellite, slot]
                c["base"] = s["amb"][reference, slot]
                c["wavelength"] = wavelength
                c["elevation"] = pair["elevation"]
    return count


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
def attempt(candidates: Array, count: int, x: Array, P: Array, cfg: Record, out: Record) -> None:
    """Search for the integers of some candidates and test the best ones.

    Parameters
    ----------
    candidates : array of CANDIDATE_DTYPE
        Values, variances and integers are filled.
    count : int
    x, P
        Float states and covariance.
    cfg : record of RTK_CONFIG_DTYPE
    out : record of ATTEMPT_DTYPE
        Filled.
    """
    clear_attempt(out, count)
    if count < cfg["least"] or count == 0:
        return
    a, Q, Qx = np.empty(count), np.empty((count, count)), np.empty((3, count))
    difference_floats(candidates, count, x, P, a, Q, Qx)
    integers = np.zeros(count, dtype=np.int64)
    search_integers(a, Q, Qx, x, P, cfg, integers, out)
    if out["whole"] == 1:
        for i in range(count):
            candidates[i]["integer"] = integers[i]


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
def resolve_epoch(
    measures: Array, total: int, pairs: Array, rover: Array, s: Record, cfg: Record,
    x: Array, P: Array, candidates: Array, tries: Array,
) -> int:  # fmt: skip
    """Try all candidates; where they fail, leave out satellites one after another.

    The newest ambiguity goes first, among those of one age the lowest satellite. The
    attempt is in ``tries[0]`` (ATTEMPT_DTYPE), that with all candidates where none passed.

    Returns
    -------
    int
        Candidates of the attempt.
    """
    left_out = np.zeros(SATELLITES, dtype=np.int64)
    count = find_candidates(measures, total, pairs, rover, s, cfg, left_out, candidates)
    attempt(candidates, count, x, P, cfg, tries[0])
    if tries[0]["passed"] == 1 or cfg["partial"] != PARTIAL_ELEVATION:
        return count
    for _ in range(cfg["drops"]):
        worst, lowest, young = -1, 0.0, 0
        for k in range(total):
            m = measures[k]
            satellite = m["satellite"]
            if m["kind"] == 0 or m["use"] == 0 or left_out[satellite] == 1:
                continue
            elevation = pairs[m["pair"]]["elevation"]
            age = min(s["lock"][satellite, m["slot"]], cfg["proven"])
            if worst < 0 or age < young or (age == young and elevation < lowest):
                worst, lowest, young = satellite, elevation, age
        if worst < 0:
            break
        left_out[worst] = 1
        count = find_candidates(measures, total, pairs, rover, s, cfg, left_out, candidates)
        if count < cfg["least"]:
            break
        attempt(candidates, count, x, P, cfg, tries[1])
        if tries[1]["passed"] == 1:
            tries[0] = tries[1]
            return count
    left_out[:] = 0
    count = find_candidates(measures, total, pairs, rover, s, cfg, left_out, candidates)
    attempt(candidates, count, x, P, cfg, tries[0])
    return count


@njit(cache=True)
def fixed_unit_weight(
    measures: Array, candidates: Array, count: int, x: Array, step: Array
) -> float:
    """Root of the weighted mean square of the phases' residuals with their integers.

    Parameters
    ----------
    measures : array of MEASURE_DTYPE
        `z` is about the predicted state.
    candidates : array of CANDIDATE_DTYPE
        With integers.
    count : int
    x : float64 array
        Predicted states.
    step : float64 array (3,), m
        Fixed position less the predicted one.

    Returns
    -------
    float
        NaN where nothing is left over.
    """
    weight = np.zeros(COUNT_LIMIT)
    e = np.zeros(COUNT_LIMIT)
    total = 0.0
    freedom = count - 3
    if freedom < 1:
        return np.nan
    begin = 0
    while begin < count:
        # The reference's own residual is the origin of its group.
        end = begin
        base, base_slot = candidates[begin]["base"], candidates[begin]["slot"]
        while end < count and candidates[end]["base"] == base:
            end += 1
        sum_w, sum_e = 0.0, 0.0
        for i in range(begin, end + 1):
            k = _reference(measures, candidates[begin]["reference"], base_slot)
            ambiguity = 0.0
            if i < end:
                k = candidates[i]["measure"]
                ambiguity = candidates[i]["wavelength"] * candidates[i]["integer"]
            m = measures[k]
            place = i if i < end else COUNT_LIMIT - 1
            # z has the predicted ambiguity taken off.
            e[place] = m["z"] + x[m["index"][3]] - ambiguity
            for c in range(3):
                e[place] -= m["h"][c] * step[c]
            weight[place] = 1.0 / m["r"]
            sum_w += weight[place]
            sum_e += weight[place] * e[place]
        mean = sum_e / sum_w
        for i in range(begin, end + 1):
            place = i if i < end else COUNT_LIMIT - 1
            total += weight[place] * (e[place] - mean) * (e[place] - mean)
        begin = end
    return sqrt(total / freedom)


@njit(cache=True)
def _reference(measures: Array, satellite: int, slot: int) -> int:
    for k in range(measures.shape[0]):
        m = measures[k]
        if m["kind"] == 1 and m["satellite"] == satellite and m["slot"] == slot:
            return k
    return 0


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
