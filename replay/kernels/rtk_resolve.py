"""Integers of an epoch of relative positioning: candidates, search, tests, hold.

Candidates are differences of single-difference ambiguities to that of the highest
satellite of their system and slot. GLONASS takes no part: its satellites differ in
frequency, and receivers in their delays on it.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.ambiguity import COUNT_LIMIT
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import GLONASS, SATELLITES, SLOTS, SYSTEMS
from replay.kernels.integers import (
    DONE,
    clear_attempt,
    difference_floats,
    hold,
    near_float,
    next_try,
    prove,
    search_integers,
)
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.rtk_output import write_ambiguities, write_resolution
from replay.kernels.rtk_records import HOLD, PARTIAL_ELEVATION
from replay.kernels.transition import add_correction
from replay.kernels.types import Array, Record

# Cycles: a phase whose own deviation is more tells no integer.
_BLUR: Final = 0.25


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
def resolve_epoch(
    measures: Array, total: int, pairs: Array, rover: Array, s: Record, cfg: Record,
    x: Array, P: Array, candidates: Array, tries: Array,
) -> int:  # fmt: skip
    """Try all candidates; where they fail, leave out satellites one after another.

    Which ones :func:`replay.kernels.integers.next_try` tells. The attempt is in ``tries[0]``
    (ATTEMPT_DTYPE), that with all candidates where none passed.

    Returns
    -------
    int
        Candidates of the attempt.
    """
    left_out = np.zeros(SATELLITES, dtype=np.int64)
    eligible = np.zeros(total, dtype=np.int64)
    for k in range(total):
        eligible[k] = 1 if measures[k]["kind"] != 0 and measures[k]["use"] != 0 else 0
    drops = cfg["drops"] if cfg["partial"] == PARTIAL_ELEVATION else 0
    count, turn = 0, 0
    while turn != DONE:
        count = find_candidates(measures, total, pairs, rover, s, cfg, left_out, candidates)
        attempt(candidates, count, x, P, cfg, tries[1 if turn > 0 else 0])
        turn = next_try(
            measures, total, pairs, eligible, s, cfg, drops, count, turn, left_out, tries
        )
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
def believe(
    measures: Array, candidates: Array, count: int, s: Record, cfg: Record, tried: Record,
    x: Array, P: Array, before: Array, base_x: Array,
) -> bool:  # fmt: skip
    """Whether integers that passed the test of the search agree with all else."""
    if tried["passed"] == 0 or not near_float(tried, x, P, cfg):
        return False
    step = np.zeros(3)
    for c in range(3):
        step[c] = tried["x"][c] - before[c]
    if cfg["length"] > 0.0:
        length2 = 0.0
        for c in range(3):
            length2 += (tried["x"][c] - base_x[c]) * (tried["x"][c] - base_x[c])
        if not abs(sqrt(length2) - cfg["length"]) <= 0.02 + 4.0 * cfg["length_sigma"]:
            return False
    if tried["whole"] == 0:
        return True
    if s["wet"] < 0 and cfg["ionosphere"] == 0:
        unit = fixed_unit_weight(measures, candidates, count, before, step)
        if unit > cfg["unit_weight"]:
            return False
    return prove(candidates, count, s, cfg, 0)


@njit(cache=True)
def resolve(
    part: Array, measures: Array, total: int, pairs: Array, s: Record, cfg: Record, x: Array,
    P: Array, before: Array, base_x: Array, candidates: Array, tries: Array, t: int, log_t: int,
    ambiguities: Array, resolutions: Array, counts: Array, trail: Record,
) -> bool:  # fmt: skip
    """The integers of an epoch; whether they are believed."""
    count = resolve_epoch(measures, total, pairs, part, s, cfg, x, P, candidates, tries)
    tried = tries[0]
    if tried["count"] == 0:
        return False
    fixed = believe(measures, candidates, count, s, cfg, tried, x, P, before, base_x)
    held = False
    if fixed and cfg["mode"] == HOLD and s["fixed"] + 1 >= cfg["hold_count"]:
        held = tried["whole"] == 1
    write_ambiguities(
        candidates, count, measures, pairs, part, tried["whole"] == 1, fixed, held, t, log_t,
        ambiguities, counts,
    )  # fmt: skip
    write_resolution(tried, cfg["threshold"], fixed, held, t, log_t, resolutions, counts)
    if held:
        n = s["n"]
        was = x[:n].copy()
        hold(candidates, count, x, P, n, cfg)
        if trail["on"] == 1:
            add_correction(trail, x[:n] - was, n)
    return fixed
