"""Which integers of a baseline between two reference stations are believed.

A search from nothing at every epoch that disagrees with what is believed for long enough
replaces it. A satellite that rises is looked for with the others' integers as known.
"""

import numpy as np
from numba import njit

from replay.kernels.ambiguity import COUNT_LIMIT
from replay.kernels.gnss_records import GLONASS, SATELLITES, SLOTS, SYSTEMS
from replay.kernels.network_records import EVENT_INTEGER_REPAIRED, INTEGER_DTYPE, STEP_ROW_DTYPE
from replay.kernels.network_search import FIRST, WIDE, condition_on, search_integers
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.rtk_output import note
from replay.kernels.types import Array, Record


@njit(cache=True)
def forget(k: Record, satellite: int) -> None:
    """Take back what was believed of a satellite, and what was about to be."""
    k["known"][satellite] = 0
    k["pending"][satellite] = 0
    k["doubt"][satellite] = 0


@njit(cache=True)
def usable_satellites(
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
def refer(
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
def search(
    usable: Array, n: int, x: Array, P: Array, states: int, k: Record, cfg: Record,
    steps: Array, t: int, log_t: int, notes: Array, counts: Array,
) -> None:  # fmt: skip
    """Look for integers, from nothing and with the known ones."""
    found = np.zeros(COUNT_LIMIT, dtype=INTEGER_DTYPE)
    more = np.zeros(COUNT_LIMIT, dtype=INTEGER_DTYPE)
    spare = np.zeros(2, dtype=STEP_ROW_DTYPE)
    xc, Pc = x[:states].copy(), P[:states, :states].copy()
    tried = refer(usable, n, k, False, True, cfg["lock"], found)
    search_integers(found, tried, cfg["least"], xc, Pc, states, cfg, steps)
    _compare(found, tried, k, cfg, t, log_t, notes, counts)
    # Of a system with known satellites the others are looked for given those.
    unknown = 0
    count = refer(usable, n, k, True, False, cfg["lock"], more)
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
