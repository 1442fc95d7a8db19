"""What the filter says of itself: solutions in local axes, whole states, nodes for a smoother."""

from typing import Any, Final

from numba import njit

from replay.kernels.covariance import (
    ACCEL_BIAS,
    ACCEL_SCALE,
    ATTITUDE,
    GYRO_BIAS,
    GYRO_SCALE,
    POSITION,
    VELOCITY,
)
from replay.kernels.earth import EARTH_RATE_RAD_S, enu_axes
from replay.kernels.elementary import sqrt
from replay.kernels.rotation import euler_from_matrix, rotate3, rotate3_back
from replay.kernels.transition import close_node
from replay.kernels.types import Array, Record
from replay.kernels.update import state_count, total_count

EXTRA_NAME: Final = 1000
"""Number of the name of the first state behind those of the inertial system and the vehicle."""


@njit(cache=True)
def emit_solution(
    s: Record, work: Record, status: int, log_t: int, rows: Array, counts: Array
) -> None:
    """Append the solution at the filter's time, in local axes."""
    nav = s["nav"]
    r, v, C, P = nav["r"], nav["v"], nav["C"], s["P"]
    u, M, N = work["axes"], work["M"], work["N"]
    row = rows[counts[0]]
    counts[0] += 1
    row["t"] = s["t"]
    row["log_t"] = log_t
    row["status"] = status
    enu_axes(r[0], r[1], r[2], u)
    e, nn, up = rotate3(u, v[0], v[1], v[2])
    row["v_enu"][0] = e
    row["v_enu"][1] = nn
    row["v_enu"][2] = up
    # C_b_n: rows north, east, down.
    for j in range(3):
        M[0, j] = u[1, 0] * C[0, j] + u[1, 1] * C[1, j] + u[1, 2] * C[2, j]
        M[1, j] = u[0, 0] * C[0, j] + u[0, 1] * C[1, j] + u[0, 2] * C[2, j]
        M[2, j] = -(u[2, 0] * C[0, j] + u[2, 1] * C[1, j] + u[2, 2] * C[2, j])
    roll, pitch, heading = euler_from_matrix(M)
    row["attitude"][0] = roll
    row["attitude"][1] = pitch
    row["attitude"][2] = heading
    e0, e1, e2 = rotate3_back(C, 0.0, 0.0, EARTH_RATE_RAD_S)
    w_raw, bg, sg = s["w_raw"], s["bg"], s["sg"]
    row["w_eb"][0] = (w_raw[0] - bg[0]) / (1.0 + sg[0]) - e0
    row["w_eb"][1] = (w_raw[1] - bg[1]) / (1.0 + sg[1]) - e1
    row["w_eb"][2] = (w_raw[2] - bg[2]) / (1.0 + sg[2]) - e2
    for i in range(3):
        row["r"][i] = r[i]
    local_block(P, POSITION, u, N)
    row["cov"][0] = N[0, 0]
    row["cov"][1] = N[0, 1]
    row["cov"][2] = N[0, 2]
    row["cov"][3] = N[1, 1]
    row["cov"][4] = N[1, 2]
    row["cov"][5] = N[2, 2]
    local_block(P, VELOCITY, u, N)
    for i in range(3):
        row["v_std"][i] = sqrt(max(0.0, N[i, i]))
    local_block(P, ATTITUDE, u, N)
    for i in range(3):
        row["a_std"][i] = sqrt(max(0.0, N[i, i]))
    s["emitted_t"] = s["t"]


@njit(cache=True)
def local_block(P: Array, offset: int, u: Array, out: Array) -> None:
    """U P u' of the (3, 3) block at `offset` into `out`."""
    for i in range(3):
        for j in range(i, 3):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    total += u[i, a] * P[offset + a, offset + b] * u[j, b]
            out[i, j] = total
            out[j, i] = total


@njit(cache=True)
def emit_epoch(
    s: Record, cfg: Record, log_t: int, rows: Array, covariances: Array, counts: Array
) -> None:
    """Append the whole state and the upper triangle of its covariance."""
    nav = s["nav"]
    row = rows[counts[1]]
    triangle = covariances[counts[1]]
    counts[1] += 1
    row["t"] = s["t"]
    row["log_t"] = log_t
    for i in range(3):
        row["r"][i] = nav["r"][i]
        row["v"][i] = nav["v"][i]
        row["bg"][i] = s["bg"][i]
        row["ba"][i] = s["ba"][i]
        row["sg"][i] = s["sg"][i]
        row["sa"][i] = s["sa"][i]
    for i in range(4):
        row["q"][i] = nav["q"][i]
    row["mount"][0] = 0.0
    row["mount"][1] = s["mount"][0]
    row["mount"][2] = s["mount"][1]
    for i in range(3):
        row["point"][i] = s["point"][i]
    row["squat"] = s["squat"]
    n = state_count(cfg)
    k = 0
    P = s["P"]
    for i in range(n):
        for j in range(i, n):
            triangle[k] = P[i, j]
            k += 1


@njit(cache=True)
def close_inertial(
    s: Record,
    cfg: Record,
    work: Record,
    log_t: int,
    solution: int,
    nodes: tuple[Any, ...],
) -> None:
    """Write a node at the filter's time: see :func:`replay.kernels.transition.close_node`.

    States of the inertial system and the vehicle have their places as names; those behind
    them must have got theirs.
    """
    trail, nav = work["trail"], s["nav"]
    estimate, name, q = trail["estimate"], trail["name"], trail["q"]
    m, n = state_count(cfg), total_count(s, cfg)
    for i in range(m):
        name[i] = i
        estimate[i] = 0.0
    for i in range(3):
        estimate[POSITION + i] = nav["r"][i]
        estimate[VELOCITY + i] = nav["v"][i]
        estimate[GYRO_BIAS + i] = s["bg"][i]
        estimate[ACCEL_BIAS + i] = s["ba"][i]
        if cfg["states"] == 21:
            estimate[GYRO_SCALE + i] = s["sg"][i]
            estimate[ACCEL_SCALE + i] = s["sa"][i]
    k = cfg["states"]
    if cfg["mounting"] == 1:
        estimate[k] = s["mount"][0]
        estimate[k + 1] = s["mount"][1]
        k += 2
    if cfg["lever"] == 1:
        estimate[k] = s["point"][0]
        estimate[k + 1] = s["point"][2]
        k += 2
    if cfg["squat"] == 1:
        estimate[k] = s["squat"]
    for i in range(n - m):
        estimate[m + i] = s["aux"][i]
    trail["inertial"] = 1
    for i in range(4):
        q[i] = nav["q"][i]
    close_node(trail, s["P"], n, s["t"], log_t, solution, nodes)


@njit(cache=True)
def name_extras(s: Record, cfg: Record, work: Record) -> None:
    """Number the names of the states behind those of the inertial system and the vehicle."""
    name, m = work["trail"]["name"], state_count(cfg)
    for i in range(s["extra"]):
        name[m + i] = EXTRA_NAME + i
