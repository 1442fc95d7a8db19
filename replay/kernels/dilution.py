"""Dilution of precision of an epoch, of all satellites and of each system's alone."""

from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SYSTEMS
from replay.kernels.least_squares import accumulate, clear_normal, geometric_range, solve_normal
from replay.kernels.types import Array, Record

_NAN = float("nan")


@njit(cache=True)
def dilutions(rows: Array, weight: Array, x: Array, work: Record, u: Array, out: Record) -> None:
    """Satellites by system and dilution of precision of an epoch, all and by system."""
    for s in range(SYSTEMS):
        out["count"][s] = 0
        out["system_pdop"][s] = _NAN
    for k in range(rows.shape[0]):
        if weight[k] > 0.0:
            out["count"][rows[k]["system"]] += 1
    for i in range(4):
        out["dop"][i] = _NAN
    axes = work["axes"]
    for chosen in range(SYSTEMS, -1, -1):
        if chosen < SYSTEMS and out["count"][chosen] < 4:
            continue
        work["unknowns"] = 3
        for s in range(SYSTEMS):
            work["column"][s] = -1
            if out["count"][s] > 0 and (chosen == SYSTEMS or s == chosen):
                work["column"][s] = work["unknowns"]
                work["unknowns"] += 1
        clear_normal(work)
        for k in range(rows.shape[0]):
            s = rows[k]["system"]
            if weight[k] > 0.0 and work["column"][s] > 0:
                geometric_range(rows[k], x, u)
                e = axes[0, 0] * u[0] + axes[0, 1] * u[1] + axes[0, 2] * u[2]
                n = axes[1, 0] * u[0] + axes[1, 1] * u[1] + axes[1, 2] * u[2]
                up = axes[2, 0] * u[0] + axes[2, 1] * u[1] + axes[2, 2] * u[2]
                accumulate(work, e, n, up, work["column"][s], 1.0, 0.0)
        if not solve_normal(work):
            continue
        Q = work["N"]
        horizontal = Q[0, 0] + Q[1, 1]
        if chosen < SYSTEMS:
            out["system_pdop"][chosen] = sqrt(horizontal + Q[2, 2])
            continue
        clocks = 0.0
        for i in range(3, work["unknowns"]):
            clocks += Q[i, i]
        out["dop"][0] = sqrt(horizontal + Q[2, 2] + clocks)
        out["dop"][1] = sqrt(horizontal + Q[2, 2])
        out["dop"][2] = sqrt(horizontal)
        out["dop"][3] = sqrt(Q[2, 2])
