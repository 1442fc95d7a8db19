"""Integers of an epoch of precise point positioning: candidates, search, tests, hold.

Candidates are differences of a satellite's ambiguities to those of the highest satellite
of its system in the same slot, where the biases of both satellites' phases are known: the
receiver's own bias, which all satellites of a system share, drops out. GLONASS takes no
part: its satellites differ in frequency. Wide lanes are rounded first
(:mod:`replay.kernels.ppp_lanes`); given these, what the carrier combinations tell of the first
slot has the wavelength of the narrow lane, and is searched for.
"""

import numpy as np
from numba import njit

from replay.kernels.ambiguity import COUNT_LIMIT
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
from replay.kernels.ppp_lanes import find_lanes, fix_lanes, integers_of, keep_known
from replay.kernels.ppp_records import HOLD, PHASE
from replay.kernels.rtk_output import write_ambiguities, write_resolution
from replay.kernels.rtk_records import PARTIAL_NONE
from replay.kernels.types import Array, Record

# Cycles: a phase whose own deviation is more tells no integer.
_BLUR = 0.25


@njit(cache=True)
def _eligible(m: Record, views: Array, rows: Array, s: Record, cfg: Record) -> bool:
    """Whether a measurement is a phase whose ambiguity may be an integer."""
    if m["kind"] != PHASE or m["use"] == 0:
        return False
    view = views[m["pair"]]
    sat, slot = m["satellite"], m["slot"]
    row = rows[view["rover"]]
    if view["system"] == GLONASS or not view["elevation"] >= cfg["mask_resolve"]:
        return False
    if row["phase_known"][slot] == 0 or s["half"][0, sat, slot] == 1:
        return False
    wavelength = SPEED_OF_LIGHT_M_S / row["frequency"][slot]
    blurred = not m["r"] < _BLUR * _BLUR * wavelength * wavelength
    return not blurred and bool(s["lock"][sat, slot] >= cfg["lock"])


@njit(cache=True)
def _mark_chains(
    measures: Array, total: int, views: Array, rows: Array, s: Record, cfg: Record,
    left_out: Array, chains: Array, place: Array,
) -> None:  # fmt: skip
    """How many slots from the first on of each satellite may have integers.

    `chains` (SATELLITES,) is filled, and `place` (SATELLITES, SLOTS) with the measurement of
    each. Where two slots are used, a satellite with the first alone does not count: without a
    wide lane the ionosphere parts it from an integer.
    """
    place[:] = -1
    for k in range(total):
        m = measures[k]
        if left_out[m["satellite"]] == 0 and _eligible(m, views, rows, s, cfg):
            place[m["satellite"], m["slot"]] = k
    for satellite in range(SATELLITES):
        chain = 0
        while chain < SLOTS and place[satellite, chain] >= 0:
            chain += 1
        chains[satellite] = chain if chain >= min(2, cfg["slots"]) else 0


@njit(cache=True)
def find_candidates(
    measures: Array, total: int, views: Array, rows: Array, s: Record, cfg: Record,
    left_out: Array, candidates: Array,
) -> int:  # fmt: skip
    """List the differences between satellites that may be integers.

    Parameters
    ----------
    measures, views, rows : arrays of PPP_MEASURE_DTYPE, VIEW_DTYPE, MEASURED_DTYPE
    total : int
        Measures.
    s, cfg : records of PPP_STATE_DTYPE, PPP_CONFIG_DTYPE
    left_out : int64 array (SATELLITES,)
        1 where a satellite is not wanted.
    candidates : array (COUNT_LIMIT,) of CANDIDATE_DTYPE
        Filled, grouped by system and slot; all slots of a system have one reference.
    """
    chains = np.zeros(SATELLITES, dtype=np.int64)
    place = np.empty((SATELLITES, SLOTS), dtype=np.int64)
    _mark_chains(measures, total, views, rows, s, cfg, left_out, chains, place)
    highest = np.full(SYSTEMS, -1, dtype=np.int64)
    for satellite in range(SATELLITES):
        if chains[satellite] == 0:
            continue
        view = views[measures[place[satellite, 0]]["pair"]]
        best = highest[view["system"]]
        if best < 0 or view["elevation"] > views[measures[place[best, 0]]["pair"]]["elevation"]:
            highest[view["system"]] = satellite
    count = 0
    for system in range(SYSTEMS):
        reference = highest[system]
        if reference < 0:
            continue
        for slot in range(chains[reference]):
            for k in range(total):
                satellite = measures[k]["satellite"]
                if satellite == reference or slot >= chains[satellite]:
                    continue
                view = views[measures[k]["pair"]]
                if k != place[satellite, slot] or view["system"] != system:
                    continue
                if count == COUNT_LIMIT:
                    return count
                c = candidates[count]
                count += 1
                c["measure"] = k
                c["satellite"] = satellite
                c["reference"] = reference
                c["slot"] = slot
                c["state"] = s["amb"][satellite, slot]
                c["base"] = s["amb"][reference, slot]
                c["wavelength"] = SPEED_OF_LIGHT_M_S / rows[view["rover"]]["frequency"][slot]
                c["elevation"] = view["elevation"]
    return count


@njit(cache=True)
def attempt(candidates: Array, count: int, x: Array, P: Array, cfg: Record, out: Record) -> int:
    """Round the wide lanes, search for the integers of the first slot, and test the best ones.

    Parameters
    ----------
    candidates : array of CANDIDATE_DTYPE
        Values, variances and integers are filled; those whose lanes are not sure are taken out.
    count : int
    x, P
        Float states and covariance, the position first.
    cfg : record of PPP_CONFIG_DTYPE
    out : record of ATTEMPT_DTYPE
        Filled.

    Returns
    -------
    int
        Candidates that are left.
    """
    clear_attempt(out, count)
    if count == 0:
        return 0
    a, Q, Qx = np.empty(count), np.empty((count, count)), np.empty((3, count))
    difference_floats(candidates, count, x, P, a, Q, Qx)
    if count < cfg["least"]:
        return count
    place, cov = np.empty(3), np.empty((3, 3))
    for c in range(3):
        place[c] = x[c]
        for d in range(3):
            cov[c, d] = P[c, d]
    lower, known = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    lanes, places = np.zeros(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    find_lanes(candidates, count, lower)
    fix_lanes(candidates, lower, cfg["lane_sigma"], a, Q, Qx, place, cov, lanes, known)
    kept = keep_known(candidates, count, lower, known, places)
    first = 0
    for i in range(kept):
        if candidates[i]["slot"] == 0:
            first += 1
    out["count"] = kept
    if first < cfg["least"] or first == 0:
        return kept
    b, R, Rx = np.empty(first), np.empty((first, first)), np.empty((3, first))
    chosen = np.empty(first, dtype=np.int64)
    n = 0
    for i in range(kept):
        if candidates[i]["slot"] == 0:
            chosen[n] = places[i]
            n += 1
    for i in range(first):
        b[i] = a[chosen[i]]
        for j in range(first):
            # Symmetric to the last bit, which conditioning keeps only nearly.
            R[i, j] = Q[chosen[max(i, j)], chosen[min(i, j)]]
        for c in range(3):
            Rx[c, i] = Qx[c, chosen[i]]
    integers = np.zeros(first, dtype=np.int64)
    search_integers(b, R, Rx, place, cov, cfg, integers, out)
    if out["whole"] == 1:
        integers_of(candidates, kept, places, lower, lanes, integers)
    if out["passed"] == 1:
        out["fixed"] += kept - first
    return kept


@njit(cache=True)
def _search(
    measures: Array, total: int, views: Array, rows: Array, s: Record, cfg: Record, x: Array,
    P: Array, candidates: Array, tries: Array,
) -> int:  # fmt: skip
    """Try all candidates; where they fail, leave out satellites one after another.

    Which ones :func:`replay.kernels.integers.next_try` tells. The attempt is in ``tries[0]``,
    that with all candidates where none passed.
    """
    left_out = np.zeros(SATELLITES, dtype=np.int64)
    eligible = np.zeros(total, dtype=np.int64)
    for k in range(total):
        eligible[k] = 1 if _eligible(measures[k], views, rows, s, cfg) else 0
    drops = 0 if cfg["partial"] == PARTIAL_NONE else cfg["drops"]
    count, turn = 0, 0
    while turn != DONE:
        count = find_candidates(measures, total, views, rows, s, cfg, left_out, candidates)
        count = attempt(candidates, count, x, P, cfg, tries[1 if turn > 0 else 0])
        turn = next_try(
            measures, total, views, eligible, s, cfg, drops, count, turn, left_out, tries
        )
    return count


@njit(cache=True)
def believe(
    candidates: Array, count: int, s: Record, cfg: Record, tried: Record, x: Array, P: Array
) -> bool:
    """Whether integers that passed the test of the search agree with all else."""
    if tried["passed"] == 0 or not near_float(tried, x, P, cfg):
        return False
    if tried["whole"] == 0:
        return True
    return prove(candidates, count, s, cfg, 1) and bool(s["proof"] >= cfg["agree"])


@njit(cache=True)
def resolve(
    rows: Array, measures: Array, total: int, views: Array, s: Record, cfg: Record, x: Array,
    P: Array, candidates: Array, tries: Array, t: int, log_t: int, ambiguities: Array,
    resolutions: Array, counts: Array,
) -> bool:  # fmt: skip
    """The integers of an epoch; whether they are believed.

    Parameters
    ----------
    rows, measures, views : arrays of MEASURED_DTYPE, PPP_MEASURE_DTYPE, VIEW_DTYPE
    total : int
        Measures.
    s, cfg : records of PPP_STATE_DTYPE, PPP_CONFIG_DTYPE
    x, P
        States and covariance after the update; changed where integers are held.
    candidates : array (COUNT_LIMIT,) of CANDIDATE_DTYPE
    tries : array (2,) of ATTEMPT_DTYPE
        The first one is filled: position and covariance given the integers.
    t, log_t : int, ns
    ambiguities, resolutions : arrays of AMBIGUITY_ROW_DTYPE, RESOLUTION_ROW_DTYPE
    counts : int64 array
    """
    count = _search(measures, total, views, rows, s, cfg, x, P, candidates, tries)
    tried = tries[0]
    if tried["count"] == 0:
        return False
    fixed = believe(candidates, count, s, cfg, tried, x, P)
    held = False
    if fixed and cfg["mode"] == HOLD and s["fixed"] + 1 >= cfg["hold_count"]:
        held = tried["whole"] == 1
    write_ambiguities(
        candidates, count, measures, views, rows, tried["whole"] == 1, fixed, held, t, log_t,
        ambiguities, counts,
    )  # fmt: skip
    write_resolution(tried, cfg["threshold"], fixed, held, t, log_t, resolutions, counts)
    if held:
        hold(candidates, count, x, P, s["n"], cfg)
    return fixed
