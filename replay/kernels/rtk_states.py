"""States of relative positioning from one epoch to the next: breaks, births, growth.

The states of an epoch are packed anew: those that live on are copied, new ones begin
with a prior. What a receiver says of broken phases is remembered until it was acted on,
also from epochs that the filter does not use.
"""

import numpy as np
from numba import njit

from replay.kernels.double_difference import difference
from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.rtk_records import (
    ACCELERATION,
    INSTANTANEOUS,
    KINEMATIC,
    ROOM,
    STATIC,
    VELOCITY,
)
from replay.kernels.state_names import name_differences
from replay.kernels.types import Array, Record

_HALF_CYCLE = 2
_LOST = 1
_JOIN_S = 10.0
_CLOCK_SPACE = 1


@njit(cache=True)
def heed_breaks(rows: Array, end: int, s: Record) -> None:
    """Remember what one receiver's epoch says of breaks in its phases.

    Parameters
    ----------
    rows : array of MEASURED_DTYPE
    end : int
        0 for the rover, 1 for the base.
    s : record of RTK_STATE_DTYPE
    """
    half, signal, lock_time, slip = s["half"], s["signal"], s["lock_time"], s["slip"]
    for k in range(rows.shape[0]):
        row = rows[k]
        satellite = row["satellite"]
        for slot in range(SLOTS):
            if row["signal"][slot] == 0:
                continue
            if row["lock_lost"][slot] & _LOST:
                slip[satellite, slot] = 1
            if row["phase"][slot] != row["phase"][slot]:
                continue
            open_half = 1 if row["lock_lost"][slot] & _HALF_CYCLE else 0
            if half[end, satellite, slot] >= 0 and half[end, satellite, slot] != open_half:
                slip[satellite, slot] = 1
            half[end, satellite, slot] = open_half
            if signal[end, satellite, slot] != row["signal"][slot]:
                slip[satellite, slot] = 1
            signal[end, satellite, slot] = row["signal"][slot]
            if row["lock_time"][slot] < lock_time[end, satellite, slot]:
                slip[satellite, slot] = 1
            lock_time[end, satellite, slot] = row["lock_time"][slot]


@njit(cache=True)
def heed_late(rows: Array, q: Record) -> None:
    """Remember breaks that the rover told in an epoch that comes after newer ones.

    They are true of the phases since; its lock times and open half cycles are past.
    """
    for k in range(rows.shape[0]):
        for slot in range(SLOTS):
            if rows[k]["lock_lost"][slot] & _LOST:
                q["slip"][rows[k]["satellite"], slot] = 1


@njit(cache=True)
def compare_frequencies(
    rover: Array, base: Array, pairs: Array, count: int, t: int, s: Record, cfg: Record
) -> None:
    """Find jumps between two phases of one satellite, from which the geometry drops out.

    Parameters
    ----------
    rover, base : arrays of MEASURED_DTYPE
    pairs : array of PAIR_DTYPE
    count : int
    t : int, ns
    s, cfg : records of RTK_STATE_DTYPE, RTK_CONFIG_DTYPE
    """
    limit = cfg["geometry_free"]
    join = max(_JOIN_S, cfg["gap"])
    for p in range(count):
        a, b = rover[pairs[p]["rover"]], base[pairs[p]["base"]]
        satellite = pairs[p]["satellite"]
        first = difference(a, b, 0, True)
        for slot in range(1, SLOTS):
            value = first - difference(a, b, slot, True)
            if value != value:
                continue
            recent = (t - s["free_t"][satellite, slot]) * 1e-9 < join
            if recent and abs(value - s["free"][satellite, slot]) > limit:
                s["slip"][satellite, 0] = 1
                s["slip"][satellite, slot] = 1
            s["free"][satellite, slot] = value
            s["free_t"][satellite, slot] = t


@njit(cache=True)
def leading_states(dynamics: int) -> int:
    """How many states describe the rover's motion."""
    if dynamics == VELOCITY:
        return 6
    return 9 if dynamics == ACCELERATION else 3


@njit(cache=True)
def _move(A: Array, x: Array, n: int, lead: int, dt: float) -> None:
    """Propagate position by velocity, velocity by acceleration."""
    half = 0.5 * dt * dt
    if lead >= 6:
        for c in range(3):
            x[c] += dt * x[3 + c]
            if lead == 9:
                x[c] += half * x[6 + c]
                x[3 + c] += dt * x[6 + c]
        for c in range(3):
            for j in range(n):
                A[c, j] += dt * A[3 + c, j]
                if lead == 9:
                    A[c, j] += half * A[6 + c, j]
                    A[3 + c, j] += dt * A[6 + c, j]
        for c in range(3):
            for j in range(n):
                A[j, c] += dt * A[j, 3 + c]
                if lead == 9:
                    A[j, c] += half * A[j, 6 + c]
                    A[j, 3 + c] += dt * A[j, 6 + c]


@njit(cache=True)
def predict(
    rover: Array, base: Array, pairs: Array, count: int, t: int, baseline: float,
    s: Record, cfg: Record, x: Array, P: Array, place: Array, velocity: Array,
    has_velocity: bool, broken: Array, source: Array,
) -> tuple[Array, int]:  # fmt: skip
    """States and covariance of the epoch before its measurements.

    Parameters
    ----------
    rover, base : arrays of MEASURED_DTYPE
    pairs : array of PAIR_DTYPE
    count : int
    t : int, ns
    baseline : float, m
    s, cfg : records of RTK_STATE_DTYPE, RTK_CONFIG_DTYPE
    x : float64 array (ROOM,)
        States; changed.
    P : float64 array (ROOM, ROOM)
        Covariance of the epoch before.
    place, velocity : float64 arrays (3,), m, m/s, ECEF
        The rover's own position and velocity.
    has_velocity : bool
    broken : int64 array (SATELLITES, SLOTS)
        Filled: 1 where an ambiguity in use was broken.
    source : int64 array (ROOM,)
        Filled: which state of the epoch before each one was, minus one where it is new.

    Returns
    -------
    A : float64 array (n, n)
        Predicted covariance; its last state is room for a clock.
    n : int
    """
    dt = (t - s["t"]) * 1e-9
    fresh = s["t"] < 0 or dt <= 0.0
    lead = leading_states(cfg["dynamics"])
    source[:] = -1
    begin = np.zeros(ROOM)
    prior = np.zeros(ROOM)
    grow = np.zeros(ROOM)
    keep_motion = not fresh and cfg["dynamics"] != KINEMATIC
    if cfg["dynamics"] != STATIC and dt > _JOIN_S:
        keep_motion = False
    for c in range(lead):
        if keep_motion:
            source[c] = c
        elif c < 3:
            begin[c] = place[c]
            prior[c] = cfg["position_sigma"] * cfg["position_sigma"]
        elif c < 6:
            begin[c] = velocity[c - 3] if has_velocity else 0.0
            prior[c] = cfg["velocity_sigma"] * cfg["velocity_sigma"]
        else:
            prior[c] = cfg["acceleration_sigma"] * cfg["acceleration_sigma"]
        if c >= lead - 3 and cfg["dynamics"] != KINEMATIC:
            grow[c] = cfg["process_noise"] * cfg["process_noise"] * dt
    n = lead
    if cfg["troposphere"] == 1:
        for end in range(2):
            source[n + end] = s["wet"] + end if s["wet"] >= 0 and not fresh else -1
            prior[n + end] = cfg["wet_sigma"] * cfg["wet_sigma"]
            grow[n + end] = cfg["wet_noise"] * cfg["wet_noise"] * dt
        s["wet"] = n
        n += 2
    if cfg["ionosphere"] == 1:
        sigma = cfg["ionosphere_sigma"] * baseline
        rate = cfg["ionosphere_noise"] * baseline
        old = s["slant"].copy()
        for satellite in range(SATELLITES):
            s["slant"][satellite] = -1
        for p in range(count):
            satellite = pairs[p]["satellite"]
            source[n] = old[satellite] if not fresh else -1
            prior[n] = sigma * sigma
            grow[n] = rate * rate * dt
            s["slant"][satellite] = n
            n += 1
    n = _ambiguities(
        rover, base, pairs, count, t, fresh, s, cfg, x, source, begin, prior, grow, dt, n, broken
    )
    A = np.empty((n + _CLOCK_SPACE, n + _CLOCK_SPACE))
    new = np.empty(n)
    for i in range(n):
        a = source[i]
        new[i] = x[a] if a >= 0 else begin[i]
        for j in range(n):
            b = source[j]
            A[i, j] = P[a, b] if a >= 0 and b >= 0 else 0.0
        if a < 0:
            A[i, i] = prior[i]
        A[i, n] = 0.0
        A[n, i] = 0.0
    A[n, n] = 0.0
    for i in range(n):
        x[i] = new[i]
    if keep_motion:
        _move(A, x, n, lead, dt)
    for i in range(n):
        if source[i] >= 0:
            A[i, i] += grow[i]
    s["t"] = t
    s["n"] = n
    return A, n + _CLOCK_SPACE


@njit(cache=True)
def _ambiguities(
    rover: Array, base: Array, pairs: Array, count: int, t: int, fresh: bool,
    s: Record, cfg: Record, x: Array, source: Array, begin: Array, prior: Array, grow: Array,
    dt: float, n: int, broken: Array,
) -> int:  # fmt: skip
    """Say which ambiguities live on and which begin; how many states there are then."""
    amb, lock = s["amb"], s["lock"]
    paired = np.full(SATELLITES, -1, dtype=np.int64)
    for p in range(count):
        paired[pairs[p]["satellite"]] = p
    anew = fresh or cfg["mode"] == INSTANTANEOUS
    for slot in range(SLOTS):
        shift = np.zeros(5)
        shared = np.zeros(5)
        for turn in range(2):
            for satellite in range(SATELLITES):
                broken[satellite, slot] = 0 if turn == 0 else broken[satellite, slot]
                p = paired[satellite]
                here = False
                phase, code = 0.0, 0.0
                if p >= 0 and slot < cfg["slots"]:
                    a, b = rover[pairs[p]["rover"]], base[pairs[p]["base"]]
                    phase = difference(a, b, slot, True)
                    code = _code(a, b, slot)
                    here = phase == phase and code == code
                old = amb[satellite, slot]
                if turn == 0:
                    if old >= 0 and (anew or _over(s, satellite, slot, t, here, cfg)):
                        if not anew and s["slip"][satellite, slot] == 1:
                            broken[satellite, slot] = 1
                        amb[satellite, slot] = -1
                        s["known"][satellite, slot] = 0
                    elif old >= 0 and here:
                        system = pairs[p]["system"]
                        shift[system] += phase - code - x[old]
                        shared[system] += 1.0
                    continue
                if old < 0 and not here:
                    continue
                if n >= ROOM - 1:
                    amb[satellite, slot] = -1
                    continue
                if old < 0:
                    # Receivers may keep code and phase apart by any time: new ambiguities
                    # stand where the old ones do.
                    system = pairs[p]["system"]
                    mean = shift[system] / shared[system] if shared[system] > 0.0 else 0.0
                    begin[n] = phase - code - mean
                    lock[satellite, slot] = 0
                    s["rejected"][satellite, slot] = 0
                else:
                    source[n] = old
                prior[n] = cfg["ambiguity_sigma"] * cfg["ambiguity_sigma"]
                grow[n] = cfg["ambiguity_noise"] * cfg["ambiguity_noise"] * dt
                amb[satellite, slot] = n
                if here:
                    s["used_t"][satellite, slot] = t
                    s["slip"][satellite, slot] = 0
                n += 1
    return n


@njit(cache=True)
def name_states(s: Record, lead: int, shift: int, name: Array) -> None:
    """Number the names of the states: those of the motion, of delays and of ambiguities.

    Parameters
    ----------
    s : record of RTK_STATE_DTYPE
    lead : int
        States of the motion.
    shift : int
        How far behind the places in `s` the states stand; with `shift` the motion is left out.
    name : int64 array
        Filled: the place within the motion, else as :mod:`replay.kernels.state_names` has it.
    """
    if shift == 0:
        for i in range(lead):
            name[i] = i
    name_differences(s, shift, name)


@njit(cache=True)
def _over(s: Record, satellite: int, slot: int, t: int, here: bool, cfg: Record) -> bool:
    """Whether an ambiguity has ended: broken, or its phase was away for too long."""
    if here and s["slip"][satellite, slot] == 1:
        return True
    if s["rejected"][satellite, slot] >= cfg["rejections"]:
        return True
    return (t - s["used_t"][satellite, slot]) * 1e-9 > cfg["gap"]


@njit(cache=True)
def _code(a: Record, b: Record, slot: int) -> float:
    """Code of a slot, or of another one where it has none."""
    value = difference(a, b, slot, False)
    for other in range(SLOTS):
        if value != value:
            value = difference(a, b, other, False)
    return value
