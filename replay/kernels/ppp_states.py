"""States of precise point positioning from one epoch to the next: births, growth, ends.

The states of an epoch are packed anew, position first: those that live on are copied, new
ones begin with a prior. The order is position, velocity, clock, drift, the other systems'
clocks, wet delay, gradients, biases, slant delays, ambiguities.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import sin
from replay.kernels.gnss_records import SATELLITES, SLOTS, SYSTEMS
from replay.kernels.ppp_records import (
    IONOSPHERE_COMBINATION,
    IONOSPHERE_CONSTRAINED,
    KINEMATIC,
    ROOM,
    VELOCITY,
)
from replay.kernels.types import Array, Record

_JOIN_S: Final = 10.0
_L1_HZ: Final = 1575.42e6
SECOND: Final = 1
"""Slot that the first one makes an ionosphere-free pair with."""


@njit(cache=True)
def leading_states(dynamics: int) -> int:
    """How many states describe the antenna's motion."""
    return 6 if dynamics == VELOCITY else 3


@njit(cache=True)
def ionosphere_factor(frequency: float) -> float:
    """Delay on a frequency (Hz) over that on L1."""
    ratio = _L1_HZ / frequency
    return ratio * ratio


@njit(cache=True)
def excess_variance(row: Record, cfg: Record) -> float:
    """What orbit and clock add to a code (m^2), where they deviate more than usual.

    They are wrong by nearly the same from one epoch to the next, and by the same on all
    frequencies: codes have it as noise, phases in their ambiguities, which walk with it.
    """
    more = cfg["range_scale"] * (row["range_std"] - cfg["range_usual"])
    return float(more * more) if more > 0.0 else 0.0


@njit(cache=True)
def _level(row: Record, slot: int) -> float:
    """Phase less code of a slot, or less that of another one where it has none (m)."""
    code = row["code"][slot]
    for other in range(SLOTS):
        if code != code:
            code = row["code"][other]
    return row["phase"][slot] - code


@njit(cache=True)
def begin_again(s: Record) -> None:
    """Forget all states; what is known of the phases' continuity stays."""
    s["t"] = -1
    s["n"] = 0
    s["reference"] = -1
    s["clock"] = -1
    s["drift"] = -1
    s["wet"] = -1
    s["gradient"] = -1
    s["failed"] = 0
    for system in range(SYSTEMS):
        s["between"][system] = -1
        for slot in range(SLOTS):
            s["bias"][system, slot] = -1
    for sat in range(SATELLITES):
        s["slant"][sat] = -1
        for slot in range(SLOTS):
            s["amb"][sat, slot] = -1
            s["known"][sat, slot] = 0


@njit(cache=True)
def predict(
    rows: Array, views: Array, count: int, t: int, clock: float, s: Record, cfg: Record, x: Array,
    P: Array, place: Array, velocity: Array, broken: Array, source: Array, grow: Array,
) -> tuple[Array, int]:  # fmt: skip
    """States and covariance of the epoch before its measurements.

    Parameters
    ----------
    rows : array of MEASURED_DTYPE
    views : array of VIEW_DTYPE
    count : int
    t : int, ns
    clock : float, m
        The receiver's, coarse.
    s, cfg : records of PPP_STATE_DTYPE, PPP_CONFIG_DTYPE
    x : float64 array (ROOM,)
        States; changed.
    P : float64 array (ROOM, ROOM)
        Covariance of the epoch before, its upper triangle at least.
    place, velocity : float64 arrays (3,), m, m/s, ECEF
        Where a motion begins.
    broken : int64 array (SATELLITES, SLOTS)
        Filled: 1 where an ambiguity in use was broken.
    source : int64 array (ROOM,)
        Filled: which state of the epoch before each one was, minus one where it is new.
    grow : float64 array (ROOM,)
        Filled: variance that each state that lives on gained.

    Returns
    -------
    A : float64 array (n, n)
        Predicted covariance.
    n : int
    """
    dt = (t - s["t"]) * 1e-9
    fresh = s["t"] < 0 or dt <= 0.0
    if fresh:
        begin_again(s)
        dt = 0.0
    lead = leading_states(cfg["dynamics"])
    begin, prior = np.zeros(ROOM), np.zeros(ROOM)
    for i in range(ROOM):
        source[i] = -1
        grow[i] = 0.0
    keep = not fresh and cfg["dynamics"] != KINEMATIC
    if cfg["dynamics"] == VELOCITY and dt > max(_JOIN_S, cfg["gap"]):
        keep = False
    for c in range(lead):
        if keep:
            source[c] = c
        begin[c] = place[c] if c < 3 else velocity[c - 3]
        sigma = cfg["position_sigma"] if c < 3 else cfg["velocity_sigma"]
        prior[c] = sigma * sigma
        if c >= lead - 3 and cfg["dynamics"] != KINEMATIC:
            grow[c] = cfg["process_noise"] * cfg["process_noise"] * dt
    n = lead
    n = _common(views, count, clock, keep, dt, s, cfg, source, begin, prior, grow, n)
    if cfg["ionosphere"] != IONOSPHERE_COMBINATION:
        n = _slants(views, count, t, s, cfg, source, prior, grow, dt, n)
    n = _ambiguities(rows, views, count, t, s, cfg, source, begin, prior, grow, dt, n, broken)
    A = _pack(x, P, n, source, begin, prior)
    if keep and lead == 6:
        _move(A, x, n, dt)
    for i in range(n):
        if source[i] >= 0:
            A[i, i] += grow[i]
        else:
            grow[i] = 0.0
    s["t"] = t
    s["n"] = n
    return A, n


@njit(cache=True)
def _pack(x: Array, P: Array, n: int, source: Array, begin: Array, prior: Array) -> Array:
    """Copy what lives on to its new place, and set the rest to its prior."""
    A = np.empty((n, n))
    new = np.empty(n)
    for i in range(n):
        a = source[i]
        new[i] = x[a] if a >= 0 else begin[i]
        row = A[i]
        if a < 0:
            for j in range(n):
                row[j] = 0.0
            row[i] = prior[i]
            continue
        old = P[a]
        for j in range(n):
            b = source[j]
            row[j] = old[b] if b >= 0 else 0.0
    for i in range(n):
        x[i] = new[i]
    return A


@njit(cache=True)
def _move(A: Array, x: Array, n: int, dt: float) -> None:
    """Propagate position by velocity."""
    for c in range(3):
        x[c] += dt * x[3 + c]
        for j in range(n):
            A[c, j] += dt * A[3 + c, j]
    for j in range(n):
        for c in range(3):
            A[j, c] += dt * A[j, 3 + c]


@njit(cache=True)
def _common(
    views: Array, count: int, clock: float, keep: bool, dt: float, s: Record, cfg: Record,
    source: Array, begin: Array, prior: Array, grow: Array, n: int,
) -> int:  # fmt: skip
    """The states that all satellites share; how many states there are then."""
    # The clock is white: whatever a receiver does with it does not matter.
    begin[n] = clock
    prior[n] = cfg["clock_sigma"] * cfg["clock_sigma"]
    s["clock"] = n
    n += 1
    if cfg["dynamics"] == VELOCITY:
        source[n] = s["drift"] if keep else -1
        prior[n] = 1e6
        grow[n] = cfg["drift_noise"] * cfg["drift_noise"] * dt
        s["drift"] = n
        n += 1
    seen = np.zeros(SYSTEMS, dtype=np.int64)
    for v in range(count):
        seen[views[v]["system"]] = 1
    for system in range(SYSTEMS):
        if s["reference"] < 0 and seen[system] == 1:
            s["reference"] = system
    for system in range(SYSTEMS):
        old = s["between"][system]
        if system == s["reference"] or (old < 0 and seen[system] == 0):
            continue
        source[n] = old
        prior[n] = cfg["clock_sigma"] * cfg["clock_sigma"]
        grow[n] = cfg["system_noise"] * cfg["system_noise"] * dt
        s["between"][system] = n
        n += 1
    source[n] = s["wet"]
    prior[n] = cfg["wet_sigma"] * cfg["wet_sigma"]
    grow[n] = cfg["wet_noise"] * cfg["wet_noise"] * dt
    s["wet"] = n
    n += 1
    if cfg["gradients"] == 1:
        for c in range(2):
            source[n + c] = s["gradient"] + c if s["gradient"] >= 0 else -1
            prior[n + c] = cfg["gradient_sigma"] * cfg["gradient_sigma"]
            grow[n + c] = cfg["gradient_noise"] * cfg["gradient_noise"] * dt
        s["gradient"] = n
        n += 2
    if cfg["ionosphere"] == IONOSPHERE_COMBINATION:
        return n
    # A free ionosphere takes the bias of the second code with it.
    first = 1 if cfg["ionosphere"] == IONOSPHERE_CONSTRAINED else 2
    for system in range(SYSTEMS):
        for slot in range(first, cfg["slots"]):
            old = s["bias"][system, slot]
            if old < 0 and seen[system] == 0:
                continue
            source[n] = old
            prior[n] = cfg["bias_sigma"] * cfg["bias_sigma"]
            grow[n] = cfg["bias_noise"] * cfg["bias_noise"] * dt
            s["bias"][system, slot] = n
            n += 1
    return n


@njit(cache=True)
def _slants(
    views: Array, count: int, t: int, s: Record, cfg: Record, source: Array, prior: Array,
    grow: Array, dt: float, n: int,
) -> int:  # fmt: skip
    """One slant delay for each satellite in view, and those that were not long ago."""
    for v in range(count):
        s["slant_t"][views[v]["satellite"]] = t
    rate = cfg["ionosphere_noise"]
    place = np.full(SATELLITES, -1, dtype=np.int64)
    for v in range(count):
        place[views[v]["satellite"]] = v
    for sat in range(SATELLITES):
        v = place[sat]
        old = s["slant"][sat]
        if v < 0 and (old < 0 or (t - s["slant_t"][sat]) * 1e-9 > cfg["gap"]):
            s["slant"][sat] = -1
            continue
        source[n] = old if rate >= 0.0 else -1
        prior[n] = cfg["ionosphere_sigma"] * cfg["ionosphere_sigma"]
        slope = sin(views[v]["elevation"]) if v >= 0 else 0.3
        slope = rate / max(0.15, slope)
        grow[n] = slope * slope * dt
        s["slant"][sat] = n
        n += 1
    return n


@njit(cache=True)
def _ambiguities(
    rows: Array, views: Array, count: int, t: int, s: Record, cfg: Record, source: Array,
    begin: Array, prior: Array, grow: Array, dt: float, n: int, broken: Array,
) -> int:  # fmt: skip
    """Say which ambiguities live on and which begin; how many states there are then."""
    combined = cfg["ionosphere"] == IONOSPHERE_COMBINATION
    place = np.full(SATELLITES, -1, dtype=np.int64)
    for v in range(count):
        place[views[v]["satellite"]] = v
    for sat in range(SATELLITES):
        v = place[sat]
        lost = False
        for slot in range(cfg["slots"]):
            broken[sat, slot] = 0
            lost = lost or s["rejected"][sat, slot] >= cfg["rejections"]
        # A pair's ambiguity is broken with either phase.
        if combined and v >= 0 and s["slip"][sat, SECOND] == 1:
            s["slip"][sat, 0] = 1
        for slot in range(cfg["slots"]):
            if combined and slot > 0:
                break
            old = s["amb"][sat, slot]
            here = False
            if v >= 0:
                row = rows[views[v]["rover"]]
                level = _level(row, slot)
                here = level == level and row["group_delay"][slot] == row["group_delay"][slot]
                if combined and here:
                    level = _level(row, SECOND)
                    here = level == level
            if old >= 0:
                over = (t - s["used_t"][sat, slot]) * 1e-9 > cfg["gap"]
                slipped = here and s["slip"][sat, slot] == 1
                if over or slipped or lost:
                    broken[sat, slot] = 1 if slipped or lost else 0
                    old = -1
                    s["amb"][sat, slot] = -1
                    s["known"][sat, slot] = 0
            if old < 0 and not here:
                continue
            if n >= ROOM:
                s["amb"][sat, slot] = -1
                continue
            if old < 0:
                begin[n] = _level(rows[views[v]["rover"]], slot)
                s["lock"][sat, slot] = 0
                s["age"][sat, slot] = 0
                s["rejected"][sat, slot] = 0
            source[n] = old
            prior[n] = cfg["ambiguity_sigma"] * cfg["ambiguity_sigma"]
            grow[n] = cfg["ambiguity_noise"] * cfg["ambiguity_noise"] * dt
            if v >= 0:
                walk = cfg["range_walk"] * cfg["range_walk"]
                grow[n] += walk * excess_variance(rows[views[v]["rover"]], cfg) * dt
            s["amb"][sat, slot] = n
            if here:
                s["used_t"][sat, slot] = t
                s["slip"][sat, slot] = 0
                if combined:
                    s["slip"][sat, SECOND] = 0
            n += 1
    return n
