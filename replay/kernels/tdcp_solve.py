"""Displacement of an antenna from time-differenced carrier phases of one pair of epochs.

Where the posterior variance of unit weight of :mod:`replay.kernels.tdcp_adjust` is too large,
robust least squares names the phases that slipped (Tang et al. 2021,
section 2.3). An extra parameter for each of them is its residual against the solution of
the others; where that is near whole cycles the jump is taken off and the phase used.
"""

from math import floor

from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SYSTEMS
from replay.kernels.least_squares import geometric_range
from replay.kernels.median import median
from replay.kernels.tdcp_adjust import (
    FOUND,
    REPAIRED,
    SUSPECTED,
    USED,
    adjust,
    again,
    assign_clocks,
    passes,
    residuals,
)
from replay.kernels.types import Array, Record
from replay.kernels.weighting import ROBUST_HUBER, ROBUST_NONE


@njit(cache=True)
def robust_factor(kind: int, v: float) -> float:
    """Weight factor of a residual over its deviation (Huber 1964; Yang 1999, IGG III)."""
    v = abs(v)
    if v <= 1.5:
        return 1.0
    if kind == ROBUST_HUBER:
        return 1.5 / v
    if v >= 5.0:
        return 1e-6
    ratio = (5.0 - v) / 3.5
    return 1.5 / v * ratio * ratio


@njit(cache=True)
def _reweight(
    rows: Array,
    phases: Array,
    cfg: Record,
    x: Array,
    clock: Array,
    work: Record,
    u: Array,
    buffer: Array,
) -> bool:
    """Iterate with robust weights of the phases in use."""
    for _ in range(20):
        count = 0
        for i in range(phases.shape[0]):
            p = phases[i]
            if p["state"] == USED:
                z = p["z"] - geometric_range(rows[p["row"]], x, u) - clock[p["system"]]
                buffer[count] = abs(z) / sqrt(p["variance"])
                count += 1
        # The median is not moved by slips of less than half of the phases.
        scale = max(1.0, 1.4826 * median(buffer, count))
        for i in range(phases.shape[0]):
            p = phases[i]
            if p["state"] == USED:
                z = p["z"] - geometric_range(rows[p["row"]], x, u) - clock[p["system"]]
                v = z / (sqrt(p["variance"]) * scale)
                p["weight"] = robust_factor(cfg["robust"], v) / p["variance"]
        before0, before1, before2 = x[0], x[1], x[2]
        if not adjust(rows, phases, cfg, x, clock, work, u):
            return False
        moved = abs(x[0] - before0) + abs(x[1] - before1) + abs(x[2] - before2)
        if moved < 1e-5:
            break
    return True


@njit(cache=True)
def find_slips(
    rows: Array,
    phases: Array,
    cfg: Record,
    x: Array,
    clock: Array,
    work: Record,
    u: Array,
    buffer: Array,
) -> bool:
    """Leave out the phases that do not fit, until the others do; False where it cannot be.

    Robust weights name all of them at once; then, one by one, that of the largest
    normalised residual, while the test is not passed.
    """
    if cfg["robust"] != ROBUST_NONE:
        if not _reweight(rows, phases, cfg, x, clock, work, u, buffer):
            return False
        for i in range(phases.shape[0]):
            p = phases[i]
            if p["state"] == USED:
                z = p["z"] - geometric_range(rows[p["row"]], x, u) - clock[p["system"]]
                if abs(z) > cfg["gate"] * sqrt(p["variance"]):
                    p["state"] = FOUND
        if not again(rows, phases, cfg, x, clock, work, u):
            return False
        # What was named because another one pulled is taken back.
        back = 0
        residuals(rows, phases, x, clock, work, u)
        for i in range(phases.shape[0]):
            p = phases[i]
            if p["state"] == FOUND and abs(p["residual"]) < 3.0 * p["spread"]:
                p["state"] = USED
                back += 1
        if back > 0 and not again(rows, phases, cfg, x, clock, work, u):
            return False
    for _ in range(cfg["exclusions"]):
        total, used = residuals(rows, phases, x, clock, work, u)
        freedom = used - work["unknowns"]
        if passes(total, freedom, cfg):
            return True
        place, worst = -1, 2.0
        for i in range(phases.shape[0]):
            p = phases[i]
            if p["weight"] > 0.0 and p["spread"] > 0.0:
                v = abs(p["residual"]) / p["spread"]
                if v > worst:
                    worst = v
                    place = i
        # With one degree of freedom all residuals are alike: nobody can be named.
        if freedom < 2 or place < 0:
            return True
        phases[place]["state"] = FOUND
        if not again(rows, phases, cfg, x, clock, work, u):
            return False
    return True


@njit(cache=True)
def _round_jump(p: Record, cfg: Record) -> bool:
    """Take whole cycles off a phase, or half ones; whether its jump is near enough to some."""
    sigma = p["spread"] / p["wavelength"]
    step = 1.0
    for _ in range(2):
        whole = floor(p["size"] / step + 0.5) * step
        off = abs(p["size"] - whole)
        near = off <= cfg["repair_gate"] * sigma and off < 0.25 * step
        if near and sigma <= cfg["repair_sigma"] * step:
            p["taken"] = whole
            return True
        if cfg["half"] == 0:
            return False
        step = 0.5
    return False


@njit(cache=True)
def size_jumps(
    rows: Array, phases: Array, x: Array, clock: Array, work: Record, u: Array
) -> tuple[float, int]:
    """Jump of every phase that is not in use, as the others see it."""
    total, used = residuals(rows, phases, x, clock, work, u)
    for i in range(phases.shape[0]):
        p = phases[i]
        if p["weight"] == 0.0:
            p["size"] = p["residual"] / p["wavelength"]
    return total, used


@njit(cache=True)
def repair(
    rows: Array,
    phases: Array,
    cfg: Record,
    x: Array,
    clock: Array,
    work: Record,
    u: Array,
    kept: Array,
) -> bool:
    """Use phases whose jumps are whole cycles; False where there is no solution any more.

    Only with a solution that has been tested, and only if the test is passed with them.
    `kept` (3 + SYSTEMS,) is scratch.
    """
    count = 0
    for i in range(phases.shape[0]):
        p = phases[i]
        if (p["state"] == SUSPECTED or p["state"] == FOUND) and _round_jump(p, cfg):
            # A phase that was found, and jumped by nothing, is simply a bad one.
            if p["state"] == FOUND and p["taken"] == 0.0:
                continue
            p["z"] -= p["taken"] * p["wavelength"]
            p["state"] += 10
            count += 1
    if count == 0:
        return True
    for i in range(3):
        kept[i] = x[i]
    for s in range(SYSTEMS):
        kept[3 + s] = clock[s]
    for i in range(phases.shape[0]):
        p = phases[i]
        good = p["state"] == USED or p["state"] >= 10
        p["weight"] = 1.0 / p["variance"] if good else 0.0
    fine = adjust(rows, phases, cfg, x, clock, work, u)
    if fine:
        total, used = residuals(rows, phases, x, clock, work, u)
        fine = passes(total, used - work["unknowns"], cfg)
    for i in range(phases.shape[0]):
        p = phases[i]
        if p["state"] >= 10:
            if fine:
                p["state"] = REPAIRED
            else:
                p["state"] -= 10
                p["z"] += p["taken"] * p["wavelength"]
                p["taken"] = 0.0
    if fine:
        return True
    for i in range(3):
        x[i] = kept[i]
    for s in range(SYSTEMS):
        clock[s] = kept[3 + s]
    return again(rows, phases, cfg, x, clock, work, u)


@njit(cache=True)
def solve_displacement(
    rows: Array,
    phases: Array,
    cfg: Record,
    x: Array,
    clock: Array,
    work: Record,
    u: Array,
    buffer: Array,
    kept: Array,
) -> tuple[int, float, int]:
    """Place of the antenna now, and what became of each phase.

    Parameters
    ----------
    rows : array of MEASURED_DTYPE
    phases : array of PHASE_DTYPE
        State USED or SUSPECTED; changed.
    cfg, work : records of TDCP_CONFIG_DTYPE and SOLVE_DTYPE
        `work` keeps the cofactor matrix.
    x : float64 array (3,), m, ECEF
        In: to some metres. Out: the place at the earlier epoch and the displacement.
    clock : float64 array (5,), m
        In: nought. Out: change of the receiver's clock.
    u, buffer, kept : float64 arrays (3,), (SATELLITES * SLOTS,), (3 + SYSTEMS,)
        Scratch.

    Returns
    -------
    status : int
        Satellites in use; minus one: too few; minus two: the phases contradict each other.
    unit : float
        Square root of the posterior variance of unit weight; 1 without redundancy.
    freedom : int
    """
    for i in range(phases.shape[0]):
        p = phases[i]
        p["size"] = 0.0
        p["taken"] = 0.0
        p["weight"] = 1.0 / p["variance"] if p["state"] == USED else 0.0
    used, satellites, n = assign_clocks(rows, phases, cfg, work)
    if satellites < cfg["satellites"] or used - n < cfg["freedom"]:
        return -1, 0.0, 0
    if not adjust(rows, phases, cfg, x, clock, work, u):
        return -1, 0.0, 0
    total, used = residuals(rows, phases, x, clock, work, u)
    good = passes(total, used - work["unknowns"], cfg)
    if not good:
        if not find_slips(rows, phases, cfg, x, clock, work, u, buffer):
            return -2, 0.0, 0
        total, used = residuals(rows, phases, x, clock, work, u)
        good = passes(total, used - work["unknowns"], cfg)
    size_jumps(rows, phases, x, clock, work, u)
    if cfg["repair"] == 1 and good and used > work["unknowns"]:
        if not repair(rows, phases, cfg, x, clock, work, u, kept):
            return -2, 0.0, 0
        total, used = residuals(rows, phases, x, clock, work, u)
    _, satellites, n = assign_clocks(rows, phases, cfg, work)
    freedom = used - n
    unit = sqrt(total / freedom) if freedom > 0 else 1.0
    if satellites < cfg["satellites"] or freedom < cfg["freedom"]:
        return -1, unit, freedom
    if not good and unit > cfg["unit_limit"]:
        return -2, unit, freedom
    return satellites, unit, freedom
