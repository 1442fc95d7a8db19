"""Least squares on the time-differenced carrier phases of one pair of epochs.

Unknown are the antenna's place now, with the place at the earlier epoch held, and the
change of the receiver's clock. The posterior variance of unit weight is tested.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.distributions import chi2_cdf
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SYSTEMS
from replay.kernels.least_squares import accumulate, clear_normal, geometric_range, solve_normal
from replay.kernels.types import Array, Record
from replay.kernels.weighting import WEIGHT_DTYPE

# What became of a phase.
USED: Final = 0
SUSPECTED: Final = 1  # by a detector, before
FOUND: Final = 2  # by its residual
REPAIRED: Final = 3
TDCP_CONFIG_DTYPE: Final = np.dtype(
    [
        ("mask", "<f8"),  # rad
        ("cn0_mask", "<f8"),  # dB-Hz
        ("excluded", "<i8", SATELLITES),
        ("phase_sigma", "<f8"),  # m, of one phase in the zenith
        ("drift_sigma", "<f8"),  # m/s in the zenith, of what is not modelled
        ("weight", WEIGHT_DTYPE),
        ("clocks", "<i8"),  # 0: one change for all systems, 1: one for each
        ("confidence", "<f8"),  # probability that a good epoch passes the test
        ("robust", "<i8"),
        ("gate", "<f8"),  # deviations from which a phase is left out
        ("exclusions", "<i8"),  # at most, one after the other
        ("repair", "<i8"),
        ("half", "<i8"),  # 1: half cycles too
        ("repair_sigma", "<f8"),  # cycle, largest deviation of a jump that is rounded
        ("repair_gate", "<f8"),  # deviations off the integer
        ("satellites", "<i8"),  # least
        ("freedom", "<i8"),  # least
        ("unit_limit", "<f8"),  # unit-weight deviation that is put up with
        ("pdop", "<f8"),
        ("max_gap", "<f8"),  # s
        ("carry", "<f8"),  # s
        ("carry_acceleration", "<f8"),  # m/s^2
        ("initial_std", "<f8", 3),  # m, east, north, up
    ],
    align=True,
)
PHASE_DTYPE: Final = np.dtype(
    [
        ("row", "<i8"),
        ("slot", "<i8"),
        ("system", "<i8"),
        ("wavelength", "<f8"),  # m
        ("z", "<f8"),  # m, range now and change of the clock
        ("variance", "<f8"),  # m^2
        ("weight", "<f8"),
        ("state", "<i8"),
        ("residual", "<f8"),  # m, without a jump that was taken off
        ("spread", "<f8"),  # m, its deviation
        ("size", "<f8"),  # cycle, real jump
        ("taken", "<f8"),  # cycle, jump that was taken off
    ],
    align=True,
)


@njit(cache=True)
def assign_clocks(rows: Array, phases: Array, cfg: Record, work: Record) -> tuple[int, int, int]:
    """Give each clock its unknown; phases, satellites and unknowns that count."""
    column = work["column"]
    used, satellites, n = 0, 0, 3
    last = -1
    for s in range(SYSTEMS):
        column[s] = -1
    for i in range(phases.shape[0]):
        if phases[i]["weight"] > 0.0:
            used += 1
            if phases[i]["row"] != last:
                last = phases[i]["row"]
                satellites += 1
            column[phases[i]["system"]] = 0
    for s in range(SYSTEMS):
        if cfg["clocks"] == 0:
            column[s] = n
        elif column[s] == 0:
            column[s] = n
            n += 1
    if cfg["clocks"] == 0:
        n += 1
    work["unknowns"] = n
    return used, satellites, n


@njit(cache=True)
def adjust(
    rows: Array, phases: Array, cfg: Record, x: Array, clock: Array, work: Record, u: Array
) -> bool:
    """Weighted least squares from `x` (3,) and `clock` (5,) on, which are changed."""
    used, _, n = assign_clocks(rows, phases, cfg, work)
    if used < n:
        return False
    column, dx = work["column"], work["dx"]
    for _ in range(6):
        clear_normal(work)
        for i in range(phases.shape[0]):
            p = phases[i]
            if p["weight"] > 0.0:
                row = rows[p["row"]]
                z = p["z"] - geometric_range(row, x, u) - clock[p["system"]]
                accumulate(work, u[0], u[1], u[2], column[p["system"]], p["weight"], z)
        if not solve_normal(work):
            return False
        for i in range(3):
            x[i] += dx[i]
        for s in range(SYSTEMS):
            if column[s] > 0:
                clock[s] += dx[column[s]]
        step = dx[0] * dx[0] + dx[1] * dx[1] + dx[2] * dx[2]
        if step < 1e-6:
            return True
        if not step < 1e12:
            return False
    return False


@njit(cache=True)
def residuals(
    rows: Array, phases: Array, x: Array, clock: Array, work: Record, u: Array
) -> tuple[float, int]:
    """Fill residuals and their deviations; weighted sum of squares and number of those used."""
    N, column = work["N"], work["column"]
    total, used = 0.0, 0
    for i in range(phases.shape[0]):
        p = phases[i]
        c = column[p["system"]]
        z = p["z"] - geometric_range(rows[p["row"]], x, u) - clock[p["system"]]
        p["residual"] = z
        if c < 0:
            # No other phase of this system: with a clock of its own nothing can be said.
            p["spread"] = 1e6
            continue
        share = N[c, c]
        for a in range(3):
            share -= 2.0 * u[a] * N[a, c]
            for b in range(3):
                share += u[a] * u[b] * N[a, b]
        if p["weight"] > 0.0:
            total += p["weight"] * z * z
            used += 1
            spread = 1.0 / p["weight"] - share
        else:
            spread = p["variance"] + share
        p["spread"] = sqrt(spread) if spread > 1e-6 * p["variance"] else 0.0
    return total, used


@njit(cache=True)
def passes(total: float, freedom: int, cfg: Record) -> bool:
    """Whether a variance of unit weight is that of good phases."""
    return freedom < 1 or chi2_cdf(total, freedom) <= cfg["confidence"]


@njit(cache=True)
def again(
    rows: Array, phases: Array, cfg: Record, x: Array, clock: Array, work: Record, u: Array
) -> bool:
    """Plain least squares of the phases that are in use."""
    for i in range(phases.shape[0]):
        p = phases[i]
        good = p["state"] == USED or p["state"] == REPAIRED
        p["weight"] = 1.0 / p["variance"] if good else 0.0
    return adjust(rows, phases, cfg, x, clock, work, u)
