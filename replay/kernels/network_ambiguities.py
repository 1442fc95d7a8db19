"""A baseline between two reference stations, epoch after epoch: integers and what is left.

The float filter never learns of integers, so that it goes on to judge them: a search from
nothing at every epoch that disagrees with what is believed for long enough replaces it. A
satellite that rises is looked for with the others' integers as known.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.ambiguity import COUNT_LIMIT
from replay.kernels.double_difference import (
    build_measures,
    difference,
    difference_variance,
    pair_rows,
)
from replay.kernels.earth import enu_axes
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import GLONASS, SATELLITES, SLOTS, SYSTEMS
from replay.kernels.network_records import (
    EVENT_INTEGER_REPAIRED,
    EVENT_STATION_FOUND,
    EVENT_STATION_LOST,
    INTEGER_DTYPE,
    STEP_ROW_DTYPE,
    WIDE_LANE_SIGNAL,
)
from replay.kernels.network_search import FIRST, SECOND, WIDE, condition_on, floats, search_integers
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.rtk import heed_base, update_epoch
from replay.kernels.rtk_output import note
from replay.kernels.rtk_records import (
    AMBIGUITY_FIXED,
    AMBIGUITY_FLOAT,
    AMBIGUITY_REJECTED,
    EVENT_SLIP,
    EVENT_TOO_FEW,
    MEASURE_DTYPE,
    PAIR_DTYPE,
    PAIRS,
    ROOM,
)
from replay.kernels.rtk_states import compare_frequencies, heed_breaks, predict
from replay.kernels.types import Array, Record

_LEAST_DIFFERENCES: Final = 4
_NAN = float("nan")

# Places in `counts`; events stand where :func:`replay.kernels.rtk_output.note` counts them.
AMBIGUITIES: Final = 0
STEPS: Final = 1
RESIDUALS: Final = 2
NOTES: Final = 5


@njit(cache=True)
def _forget(k: Record, satellite: int) -> None:
    k["known"][satellite] = 0
    k["pending"][satellite] = 0
    k["doubt"][satellite] = 0


@njit(cache=True)
def _settle(measures: Array, total: int, s: Record) -> None:
    """Count epochs in use and rejections of each ambiguity."""
    for i in range(total):
        m = measures[i]
        if m["kind"] == 1:
            satellite, slot = m["satellite"], m["slot"]
            if m["use"] == 1:
                s["lock"][satellite, slot] += 1
                s["rejected"][satellite, slot] = 0
            else:
                s["rejected"][satellite, slot] += 1
                s["lock"][satellite, slot] = 0


@njit(cache=True)
def _usable(
    measures: Array, total: int, pairs: Array, count: int, station: Array, s: Record,
    cfg: Record, found: Array,
) -> int:  # fmt: skip
    """Satellites with both phases in use, each system's together, as INTEGER_DTYPE."""
    phases = np.zeros((SATELLITES, SLOTS), dtype=np.int64)
    for i in range(total):
        m = measures[i]
        if m["kind"] == 1 and m["use"] == 1:
            phases[m["satellite"], m["slot"]] = 1
    n = 0
    for system in range(SYSTEMS):
        if system == GLONASS:
            continue
        for p in range(count):
            satellite = pairs[p]["satellite"]
            if pairs[p]["system"] != system or not pairs[p]["elevation"] >= cfg["mask"]:
                continue
            if phases[satellite, 0] == 0 or phases[satellite, 1] == 0 or n == COUNT_LIMIT:
                continue
            half = False
            for end in range(2):
                for slot in range(2):
                    if s["half"][end, satellite, slot] == 1:
                        half = True
            if half:
                continue
            c = found[n]
            n += 1
            c["satellite"] = satellite
            c["system"] = system
            c["pair"] = p
            c["elevation"] = pairs[p]["elevation"]
            c["age"] = min(s["lock"][satellite, 0], s["lock"][satellite, 1])
            row = station[pairs[p]["rover"]]
            for slot in range(2):
                c["state"][slot] = s["amb"][satellite, slot]
                c["wavelength"][slot] = SPEED_OF_LIGHT_M_S / row["frequency"][slot]
    return n


@njit(cache=True)
def _refer(
    usable: Array, n: int, k: Record, only_known: bool, anyone: bool, lock: int, found: Array
) -> int:
    """Double differences to the highest satellite of each system, known ones first.

    Parameters
    ----------
    usable : array of INTEGER_DTYPE
    n : int
    k : record of INTEGERS_STATE_DTYPE
    only_known : bool
        Leave out systems without a known satellite.
    anyone : bool
        Whether the reference need not be a known one.
    lock : int, epochs
        Age from which a satellite takes part.
    found : array of INTEGER_DTYPE
        Filled.
    """
    count = 0
    for system in range(SYSTEMS):
        best, sure = -1, False
        for i in range(n):
            c = usable[i]
            if c["system"] != system or c["age"] < lock:
                continue
            known = k["known"][c["satellite"]] == 1 and not anyone
            if best < 0 or (known and not sure):
                best, sure = i, known
            elif known == sure and c["elevation"] > usable[best]["elevation"]:
                best = i
        if best < 0 or (only_known and not sure):
            continue
        for i in range(n):
            c = usable[i]
            if c["system"] != system or i == best or c["age"] < lock:
                continue
            found[count] = c
            found[count]["reference"] = usable[best]["satellite"]
            found[count]["reference_pair"] = usable[best]["pair"]
            for slot in range(2):
                found[count]["base"][slot] = usable[best]["state"][slot]
            found[count]["active"] = 0
            count += 1
    return count


@njit(cache=True)
def _datum(found: Array, count: int, system: int, k: Record) -> tuple[bool, int, int]:
    """Shift of a search's integers against those believed, by majority, on both frequencies."""
    votes, first, second = 0, 0, 0
    for i in range(count + 1):
        satellite, one, two = _single(found, count, system, i)
        if satellite < 0 or k["known"][satellite] == 0:
            continue
        shift = one - k["first"][satellite]
        other = two - k["second"][satellite]
        same = 0
        for j in range(count + 1):
            again, three, four = _single(found, count, system, j)
            if again < 0 or k["known"][again] == 0:
                continue
            if three - k["first"][again] == shift and four - k["second"][again] == other:
                same += 1
        if same > votes:
            votes, first, second = same, shift, other
    return votes > 0, first, second


@njit(cache=True)
def _single(found: Array, count: int, system: int, i: int) -> tuple[int, int, int]:
    """Satellite and integers of a found difference; at `count` those of the reference."""
    if i < count:
        c = found[i]
        if c["active"] == 0 or c["system"] != system:
            return -1, 0, 0
        return c["satellite"], c["first"], c["first"] - c["wide"]
    for j in range(count):
        if found[j]["active"] == 1 and found[j]["system"] == system:
            return found[j]["reference"], 0, 0
    return -1, 0, 0


@njit(cache=True)
def _compare(
    found: Array, count: int, k: Record, cfg: Record, t: int, log_t: int, notes: Array,
    counts: Array,
) -> None:  # fmt: skip
    """Hold a search from nothing against what is believed; repair what it contradicts long."""
    for system in range(SYSTEMS):
        any_known, first, second = _datum(found, count, system, k)
        if not any_known:
            continue
        for i in range(count + 1):
            satellite, one, two = _single(found, count, system, i)
            if satellite < 0 or k["known"][satellite] == 0:
                continue
            one -= first
            two -= second
            if one == k["first"][satellite] and two == k["second"][satellite]:
                k["doubt"][satellite] = 0
                continue
            same = one == k["doubt_first"][satellite] and two == k["doubt_second"][satellite]
            k["doubt"][satellite] = k["doubt"][satellite] + 1 if same else 1
            k["doubt_first"][satellite] = one
            k["doubt_second"][satellite] = two
            if k["doubt"][satellite] >= cfg["doubt"]:
                change = float(one - k["first"][satellite])
                note(notes, counts, t, log_t, EVENT_INTEGER_REPAIRED, satellite, change)
                k["first"][satellite] = one
                k["second"][satellite] = two
                k["doubt"][satellite] = 0


@njit(cache=True)
def _wait(found: Array, count: int, k: Record, cfg: Record) -> None:
    """Believe integers that were found alike for long enough."""
    for i in range(count):
        c = found[i]
        satellite = c["satellite"]
        if k["known"][satellite] == 1:
            continue
        if c["active"] == 0:
            k["pending"][satellite] = 0
            continue
        second = c["first"] - c["wide"]
        same = (
            k["pending"][satellite] > 0
            and k["pending_reference"][satellite] == c["reference"]
            and k["pending_first"][satellite] == c["first"]
            and k["pending_second"][satellite] == second
        )
        k["pending"][satellite] = k["pending"][satellite] + 1 if same else 1
        k["pending_reference"][satellite] = c["reference"]
        k["pending_first"][satellite] = c["first"]
        k["pending_second"][satellite] = second
    for i in range(count):
        c = found[i]
        satellite, reference = c["satellite"], c["reference"]
        if k["known"][satellite] == 1 or k["pending"][satellite] < cfg["confirm"]:
            continue
        if k["known"][reference] == 0:
            if _known_in_system(found, count, c["system"], k):
                continue
            # The first of its system: the reference is the datum.
            k["known"][reference] = 1
            k["first"][reference] = 0
            k["second"][reference] = 0
        k["known"][satellite] = 1
        k["doubt"][satellite] = 0
        k["first"][satellite] = k["first"][reference] + k["pending_first"][satellite]
        k["second"][satellite] = k["second"][reference] + k["pending_second"][satellite]


@njit(cache=True)
def _known_in_system(found: Array, count: int, system: int, k: Record) -> bool:
    for i in range(count):
        if found[i]["system"] == system and k["known"][found[i]["satellite"]] == 1:
            return True
    return False


@njit(cache=True)
def _search(
    usable: Array, n: int, x: Array, P: Array, states: int, k: Record, cfg: Record,
    steps: Array, t: int, log_t: int, notes: Array, counts: Array,
) -> None:  # fmt: skip
    """Look for integers, from nothing and with the known ones."""
    found = np.zeros(COUNT_LIMIT, dtype=INTEGER_DTYPE)
    more = np.zeros(COUNT_LIMIT, dtype=INTEGER_DTYPE)
    spare = np.zeros(2, dtype=STEP_ROW_DTYPE)
    xc, Pc = x[:states].copy(), P[:states, :states].copy()
    tried = _refer(usable, n, k, False, True, cfg["lock"], found)
    search_integers(found, tried, cfg["least"], xc, Pc, states, cfg, steps)
    _compare(found, tried, k, cfg, t, log_t, notes, counts)
    # Of a system with known satellites the others are looked for given those.
    unknown = 0
    count = _refer(usable, n, k, True, False, cfg["lock"], more)
    for i in range(count):
        if k["known"][more[i]["satellite"]] == 0:
            unknown += 1
    if unknown > 0:
        xc[:] = x[:states]
        Pc[:, :] = P[:states, :states]
        b, gain, dx = np.zeros(states), np.zeros(states), np.zeros(states)
        place = 0
        for i in range(count):
            c = more[i]
            satellite, reference = c["satellite"], c["reference"]
            if k["known"][satellite] == 1:
                first = k["first"][satellite] - k["first"][reference]
                second = k["second"][satellite] - k["second"][reference]
                condition_on(c, WIDE, first - second, xc, Pc, states, b, gain, dx)
                condition_on(c, FIRST, first, xc, Pc, states, b, gain, dx)
        for i in range(count):
            if k["known"][more[i]["satellite"]] == 0:
                more[place] = more[i]
                place += 1
        search_integers(more, place, 1, xc, Pc, states, cfg, spare)
        _wait(more, place, k, cfg)
    # Of the others the search from nothing is all there is.
    place = 0
    for i in range(tried):
        if not _known_in_system(usable, n, found[i]["system"], k):
            found[place] = found[i]
            place += 1
    _wait(found, place, k, cfg)


@njit(cache=True)
def _write(
    usable: Array, n: int, pairs: Array, station: Array, master: Array, x: Array, P: Array,
    k: Record, rcfg: Record, cfg: Record, age: float, t: int, log_t: int,
    ambiguities: Array, residuals: Array, counts: Array,
) -> None:  # fmt: skip
    """Ambiguities of an epoch, and what is left of the phases whose integers are known."""
    found = np.zeros(COUNT_LIMIT, dtype=INTEGER_DTYPE)
    chosen = np.zeros(1, dtype=np.int64)
    a, Q = np.zeros(1), np.zeros((1, 1))
    count = _refer(usable, n, k, False, False, 0, found)
    for i in range(count):
        c = found[i]
        chosen[0] = i
        satellite, reference = c["satellite"], c["reference"]
        known = k["known"][satellite] == 1 and k["known"][reference] == 1
        p, q = pairs[c["pair"]], pairs[c["reference_pair"]]
        integer = np.zeros(3)
        integer[0] = float(k["first"][satellite] - k["first"][reference])
        integer[1] = float(k["second"][satellite] - k["second"][reference])
        integer[2] = integer[0] - integer[1]
        for level in range(3):
            step = WIDE
            if level < 2:
                step = FIRST if level == 0 else SECOND
            floats(found, chosen, 1, step, x, P, a, Q)
            row = ambiguities[counts[AMBIGUITIES]]
            counts[AMBIGUITIES] += 1
            row["t"] = t
            row["log_t"] = log_t
            row["satellite"] = satellite
            row["reference"] = reference
            signal = WIDE_LANE_SIGNAL
            if level < 2:
                signal = station[p["rover"]]["signal"][level]
            row["signal"] = signal
            row["value"] = a[0]
            row["sigma"] = sqrt(Q[0, 0]) if Q[0, 0] > 0.0 else 0.0
            row["integer"] = integer[level] if known else _NAN
            row["status"] = AMBIGUITY_FIXED if known else AMBIGUITY_FLOAT
            if not known or level == 2:
                continue
            left = 0.0
            spread = 0.0
            for end in range(2):
                one = p if end == 0 else q
                sign = 1.0 if end == 0 else -1.0
                u, v = station[one["rover"]], master[one["base"]]
                left += sign * (difference(u, v, level, True) - one["computed"])
                # Errors of orbits are what is looked for, not noise.
                spread += difference_variance(u, v, level, True, age, 0.0, rcfg)
            out = residuals[counts[RESIDUALS]]
            counts[RESIDUALS] += 1
            out["t"] = t
            out["log_t"] = log_t
            out["satellite"] = satellite
            out["reference"] = reference
            out["signal"] = signal
            out["residual"] = left - c["wavelength"][level] * integer[level]
            out["sigma"] = sqrt(spread) / cfg["phase_scale"]


@njit(cache=True)
def run_baseline(
    state: Array, integers: Array, x: Array, P: Array, config: Array, integers_config: Array,
    epochs: Array, rows: Array, base_epochs: Array, base_rows: Array, partner: Array,
    release: Array, ambiguities: Array, steps: Array, residuals: Array, notes: Array,
    counts: Array,
) -> None:  # fmt: skip
    """Work on all epochs of a station that are ready.

    Parameters
    ----------
    state, integers, config, integers_config : arrays of one record each
        RTK_STATE_DTYPE, INTEGERS_STATE_DTYPE, RTK_CONFIG_DTYPE, INTEGERS_CONFIG_DTYPE.
    x, P : float64 arrays (ROOM,), (ROOM, ROOM)
        States and covariance; changed.
    epochs, rows, base_epochs, base_rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
        Of the station and of the master.
    partner, release : int64 arrays (epochs,)
        As :func:`replay.kernels.epoch_matching.match_epochs` filled them.
    ambiguities : array (3 * rows,) of AMBIGUITY_ROW_DTYPE
    steps : array (2 * epochs,) of STEP_ROW_DTYPE
    residuals : array (2 * rows,) of RESIDUAL_ROW_DTYPE
    notes : array of NOTE_DTYPE
    counts : int64 array (6,)
        Filled: rows of each output.
    """
    s, k, rcfg, cfg = state[0], integers[0], config[0], integers_config[0]
    pairs = np.zeros(PAIRS, dtype=PAIR_DTYPE)
    measures = np.zeros(2 * PAIRS * SLOTS, dtype=MEASURE_DTYPE)
    starts = np.zeros(2 * SYSTEMS * SLOTS + 1, dtype=np.int64)
    broken = np.zeros((SATELLITES, SLOTS), dtype=np.int64)
    source = np.empty(ROOM, dtype=np.int64)
    place, base_x, up, u = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    still, nothing, axes = np.zeros(3), np.full(3, np.nan), np.zeros((3, 3))
    none = np.zeros((3, 3))
    usable = np.zeros(COUNT_LIMIT, dtype=INTEGER_DTYPE)
    tried = np.zeros(2, dtype=STEP_ROW_DTYPE)
    span = int(rcfg["max_age"] * 1e9)
    for i in range(6):
        counts[i] = 0
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        log_t = release[e]
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        heed_breaks(part, 0, s)
        here = partner[e] >= 0 and epoch["placed"] == 1
        if here:
            heed_base(base_epochs, base_rows, partner[e], span, s)
            here = base_epochs[partner[e]]["placed"] == 1
        if not here:
            if s["lost"] == 0:
                note(notes, counts, epoch["t"], log_t, EVENT_STATION_LOST, -1, 0.0)
            s["lost"] = 1
            continue
        other = base_epochs[partner[e]]
        t = other["t"]
        if s["lost"] == 1:
            away = (t - s["t"]) * 1e-9 if s["t"] >= 0 else 0.0
            note(notes, counts, t, log_t, EVENT_STATION_FOUND, -1, away)
        s["lost"] = 0
        base_part = base_rows[other["first"] : other["first"] + other["count"]]
        baseline2 = 0.0
        for i in range(3):
            place[i] = epoch["x"][i]
            base_x[i] = other["x"][i]
            baseline2 += (place[i] - base_x[i]) * (place[i] - base_x[i])
        baseline = sqrt(baseline2)
        enu_axes(place[0], place[1], place[2], axes)
        for i in range(3):
            up[i] = axes[2, i]
        age = (epoch["t"] - other["t"]) * 1e-9
        count = pair_rows(part, base_part, age, rcfg, place, place, base_x, up, pairs, u)
        compare_frequencies(part, base_part, pairs, count, t, s, rcfg)
        fresh = s["t"] < 0 or t <= s["t"]
        A, n = predict(
            part, base_part, pairs, count, t, baseline, s, rcfg, x, P, place, still, False,
            broken, source,
        )  # fmt: skip
        for satellite in range(SATELLITES):
            if fresh or s["amb"][satellite, 0] < 0 or s["amb"][satellite, 1] < 0:
                _forget(k, satellite)
            for slot in range(SLOTS):
                if broken[satellite, slot] == 1:
                    _forget(k, satellite)
                    note(notes, counts, t, log_t, EVENT_SLIP, satellite, float(slot))
            # An ambiguity that began anew has another integer.
            for slot in range(2):
                state_of = s["amb"][satellite, slot]
                if state_of >= 0 and source[state_of] < 0:
                    _forget(k, satellite)
        groups = build_measures(
            part, base_part, pairs, count, abs(age), baseline, s, rcfg, x, measures, starts
        )
        total = starts[groups]
        new, dx = np.empty((n, n)), np.zeros(n)
        update_epoch(measures, starts, groups, A, n, rcfg, nothing, none, x, new, dx)
        for i in range(n - 1):
            x[i] += dx[i]
            for j in range(n - 1):
                P[i, j] = new[i, j]
        _settle(measures, total, s)
        if total < _LEAST_DIFFERENCES:
            note(notes, counts, t, log_t, EVENT_TOO_FEW, -1, float(total))
            continue
        many = _usable(measures, total, pairs, count, part, s, cfg, usable)
        _search(usable, many, x, P, n - 1, k, cfg, tried, t, log_t, notes, counts)
        known = 0
        for i in range(many):
            known += k["known"][usable[i]["satellite"]]
        for level in range(2):
            steps[counts[STEPS]] = tried[level]
            row = steps[counts[STEPS]]
            counts[STEPS] += 1
            row["t"] = t
            row["log_t"] = log_t
            row["signal"] = WIDE_LANE_SIGNAL
            if level == FIRST and many > 0:
                row["signal"] = part[pairs[usable[0]["pair"]]["rover"]]["signal"][0]
            row["known"] = known
            row["status"] = AMBIGUITY_FIXED if row["fixed"] > 0 else AMBIGUITY_REJECTED
        _write(
            usable, many, pairs, part, base_part, x, P, k, rcfg, cfg, abs(age), t, log_t,
            ambiguities, residuals, counts,
        )  # fmt: skip
