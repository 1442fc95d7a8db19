"""Position and clocks of an epoch from pseudoranges, by iterated weighted least squares.

Unknowns are the antenna's three coordinates and one clock for each system that is
used. The normal equations are eliminated in a written order; at most eight unknowns.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SYSTEMS
from replay.kernels.sight import invert_positive
from replay.kernels.types import Array, Record

UNKNOWNS: Final = 3 + SYSTEMS

# Scratch of one solution; what is in it never outlives an epoch.
SOLVE_DTYPE: Final = np.dtype(
    [
        ("N", "<f8", (UNKNOWNS, UNKNOWNS)),  # normal matrix, then its inverse
        ("b", "<f8", UNKNOWNS),
        ("dx", "<f8", UNKNOWNS),
        ("column", "<i8", SYSTEMS),  # unknown of each system's clock, -1 where not used
        ("unknowns", "<i8"),
        ("axes", "<f8", (3, 3)),
    ],
    align=True,
)


@njit(cache=True)
def assign_clocks(rows: Array, weight: Array, work: Record) -> int:
    """Give each system that has a weighted satellite an unknown; how many satellites count."""
    column = work["column"]
    used = 0
    for s in range(SYSTEMS):
        column[s] = -1
    for k in range(rows.shape[0]):
        if weight[k] > 0.0:
            column[rows[k]["system"]] = 0
            used += 1
    n = 3
    for s in range(SYSTEMS):
        if column[s] == 0:
            column[s] = n
            n += 1
    work["unknowns"] = n
    return used


@njit(cache=True)
def accumulate(
    work: Record, ux: float, uy: float, uz: float, clock: int, weight: float, z: float
) -> None:
    """Add one measurement of minus the line of sight and a clock to the normal equations."""
    N, b = work["N"], work["b"]
    wx, wy, wz = weight * ux, weight * uy, weight * uz
    N[0, 0] += wx * ux
    N[1, 0] += wy * ux
    N[1, 1] += wy * uy
    N[2, 0] += wz * ux
    N[2, 1] += wz * uy
    N[2, 2] += wz * uz
    N[clock, 0] -= wx
    N[clock, 1] -= wy
    N[clock, 2] -= wz
    N[clock, clock] += weight
    b[0] -= wx * z
    b[1] -= wy * z
    b[2] -= wz * z
    b[clock] += weight * z


@njit(cache=True)
def clear_normal(work: Record) -> None:
    """Normal equations without a measurement."""
    n = work["unknowns"]
    N, b = work["N"], work["b"]
    for i in range(n):
        b[i] = 0.0
        for j in range(n):
            N[i, j] = 0.0


@njit(cache=True)
def solve_normal(work: Record) -> bool:
    """Turn the normal matrix into the cofactor matrix and fill `dx`; False if singular."""
    n = work["unknowns"]
    N, b, dx = work["N"], work["b"], work["dx"]
    if not invert_positive(N[:n, :n]):
        return False
    for i in range(n):
        s = 0.0
        for j in range(n):
            s += N[i, j] * b[j]
        dx[i] = s
    return True


@njit(cache=True)
def geometric_range(row: Record, x: Array, u: Array) -> float:
    """Distance (m) from `x` (3,) to the satellite; `u` (3,) becomes the line of sight."""
    dx = row["position"][0] - x[0]
    dy = row["position"][1] - x[1]
    dz = row["position"][2] - x[2]
    r = sqrt(dx * dx + dy * dy + dz * dz)
    u[0] = dx / r
    u[1] = dy / r
    u[2] = dz / r
    return r


@njit(cache=True)
def reduced_code(row: Record, slot: int) -> float:
    """Pseudorange with every modelled term but the range and the receiver's clock taken off."""
    return (
        row["code"][slot]
        + row["clock"]
        - row["group_delay"][slot]
        - row["ionosphere"][slot]
        - row["hydrostatic"]
        - row["wet"]
        - row["shapiro"]
    )


@njit(cache=True)
def iterate(
    rows: Array,
    observed: Array,
    weight: Array,
    rounds: int,
    limit: float,
    x: Array,
    clock: Array,
    work: Record,
    u: Array,
) -> int:
    """Solve for position and clocks.

    Parameters
    ----------
    rows : array (n,) of MEASURED_DTYPE
    observed : float64 array (n,), m
        Range and receiver clock, as :func:`reduced_code` leaves them.
    weight : float64 array (n,)
        Inverse variance; zero leaves a satellite out.
    rounds : int
        At most.
    limit : float, m
        Step of the position below which it is done.
    x : float64 array (3,), m, ECEF
        Changed in place.
    clock : float64 array (5,), m
        Receiver clock by system; changed.
    work : record of SOLVE_DTYPE
        Keeps the cofactor matrix of the last round.
    u : float64 array (3,)
        Scratch.

    Returns
    -------
    int
        Rounds taken; minus one where there are too few satellites, minus two where it
        does not converge, minus three where it is singular.
    """
    if assign_clocks(rows, weight, work) < work["unknowns"]:
        return -1
    column, dx = work["column"], work["dx"]
    for turn in range(rounds):
        clear_normal(work)
        for k in range(rows.shape[0]):
            w = weight[k]
            if w > 0.0:
                s = rows[k]["system"]
                z = observed[k] - geometric_range(rows[k], x, u) - clock[s]
                accumulate(work, u[0], u[1], u[2], column[s], w, z)
        if not solve_normal(work):
            return -3
        for i in range(3):
            x[i] += dx[i]
        for s in range(SYSTEMS):
            if column[s] > 0:
                clock[s] += dx[column[s]]
        if not abs(x[0]) + abs(x[1]) + abs(x[2]) < 1e9:
            return -2
        if dx[0] * dx[0] + dx[1] * dx[1] + dx[2] * dx[2] < limit * limit:
            return turn + 1
    return -2


@njit(cache=True)
def reduced_phase(row: Record, slot: int) -> float:
    """Carrier phase (m) with every modelled term but range, clock and ambiguity taken off."""
    return (
        row["phase"][slot]
        + row["clock"]
        + row["ionosphere"][slot]
        - row["hydrostatic"]
        - row["wet"]
        - row["shapiro"]
    )
