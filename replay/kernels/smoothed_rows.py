"""Solutions from what a filter estimated and how wrong a smoother found it."""

import numpy as np
from numba import njit

from replay.kernels.covariance import ATTITUDE, GYRO_BIAS, GYRO_SCALE, POSITION, VELOCITY
from replay.kernels.earth import EARTH_RATE_RAD_S, enu_axes
from replay.kernels.elementary import sqrt
from replay.kernels.output_rows import local_block
from replay.kernels.rotation import (
    euler_from_matrix,
    matrix_from_quaternion,
    quaternion_from_vector,
    quaternion_multiply,
    quaternion_normalize,
    rotate3,
    rotate3_back,
)
from replay.kernels.rtk_output import write_baseline
from replay.kernels.types import Array, Record


@njit(cache=True)
def smoothed_solutions(
    estimates: tuple[Array, Array],
    attitudes: tuple[Array, Array],
    errors: tuple[Array, Array],
    covariances: tuple[Array, Array],
    shown: Array,
    moving: Array,
    scaled: Array,
    rates: Array,
    q: Array,
    rows: Array,
) -> None:
    """Solutions at nodes.

    Parameters
    ----------
    estimates, errors : int64 offsets (nodes + 1,), values
        Of all states at a node: the first three are the position (m, ECEF).
    attitudes : int64 offsets (nodes + 1,), values
        Body to ECEF, none without an inertial system.
    covariances : int64 offsets (nodes + 1,), values
        Smoothed, upper triangles of the first `shown` states.
    shown : int64 array (nodes,)
        At least three; with an attitude at least nine.
    moving : int64 array (nodes,)
        1 where states 3 to 5 are the velocity (m/s, ECEF).
    scaled : int64 array (nodes,)
        1 where states 15 to 17 are scale factors of the gyros.
    rates : float64 array (nodes, 3), rad/s
        Body relative to ECEF, as the filter estimated it.
    q : float64 array (nodes, 4)
        Filled: body to ECEF.
    rows : array (nodes,) of SOLUTION_DTYPE
        Filled but for times and status.
    """
    size = 3
    for k in range(shown.shape[0]):
        size = max(size, min(9, shown[k]))
    P = np.zeros((size, size))
    room = (np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)))
    turn = np.zeros((2, 4))
    for k in range(rows.shape[0]):
        x = estimates[1][estimates[0][k] : estimates[0][k + 1]]
        dx = errors[1][errors[0][k] : errors[0][k + 1]]
        at = covariances[0][k]
        count = min(9, shown[k])
        for i in range(count):
            for j in range(i, count):
                P[i, j] = covariances[1][at + j - i]
                P[j, i] = P[i, j]
            at += shown[k] - i
        row, u, N = rows[k], room[0], room[1]
        r = row["r"]
        for i in range(3):
            r[i] = x[POSITION + i] + dx[POSITION + i]
        enu_axes(r[0], r[1], r[2], u)
        local_block(P, POSITION, u, N)
        place = 0
        for i in range(3):
            for j in range(i, 3):
                row["cov"][place] = N[i, j]
                place += 1
        if moving[k] == 1:
            v0 = x[VELOCITY] + dx[VELOCITY]
            v1 = x[VELOCITY + 1] + dx[VELOCITY + 1]
            v2 = x[VELOCITY + 2] + dx[VELOCITY + 2]
            e, n, up = rotate3(u, v0, v1, v2)
            row["v_enu"][0] = e
            row["v_enu"][1] = n
            row["v_enu"][2] = up
            local_block(P, VELOCITY, u, N)
            for i in range(3):
                row["v_std"][i] = sqrt(max(0.0, N[i, i]))
        if attitudes[0][k + 1] > attitudes[0][k]:
            was = attitudes[1][attitudes[0][k] : attitudes[0][k + 1]]
            _attitude(x, dx, was, scaled[k] == 1, rates[k], q[k], row, room, turn)
            local_block(P, ATTITUDE, u, N)
            for i in range(3):
                row["a_std"][i] = sqrt(max(0.0, N[i, i]))


@njit(cache=True)
def smoothed_relative(
    estimates: tuple[Array, Array],
    errors: tuple[Array, Array],
    covariances: tuple[Array, Array],
    shown: Array,
    absolute: Array,
    positions: Array,
    baselines: Array,
    rows: Array,
) -> None:
    """Positions relative to a base at nodes.

    Parameters
    ----------
    estimates, errors, covariances : int64 offsets (nodes + 1,), values
    shown : int64 array (nodes,)
        As :func:`smoothed_solutions` takes them; the first three states are a position (m, ECEF).
    absolute : int64 array (nodes,)
        1 where it is a place, 0 where it is relative to the base.
    positions, baselines : float64 arrays (nodes, 3), m, ECEF
        The run's own: their difference is the base's place.
    rows : array (nodes,) of BASELINE_ROW_DTYPE
        With times, age and status; the rest is filled.
    """
    place, base, P, axes = np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
    for k in range(rows.shape[0]):
        row, at = rows[k], covariances[0][k]
        for i in range(3):
            for j in range(i, 3):
                P[i, j] = covariances[1][at + j - i]
                P[j, i] = P[i, j]
            at += shown[k] - i
            base[i] = positions[k, i] - baselines[k, i]
            place[i] = estimates[1][estimates[0][k] + i] + errors[1][errors[0][k] + i]
            if absolute[k] == 0:
                place[i] += base[i]
        write_baseline(row, row["t"], row["log_t"], row["status"], place, P, base, row["age"], axes)


@njit(cache=True)
def _attitude(
    x: Array, dx: Array, was: Array, scaled: bool, rate: Array, q: Array, row: Record,
    room: tuple[Array, Array, Array, Array], turn: Array,
) -> None:  # fmt: skip
    """Attitude turned by its error, angular rate less the errors of the gyros."""
    u, _, C, M = room
    matrix_from_quaternion(was, C)
    e0, e1, e2 = rotate3_back(C, 0.0, 0.0, EARTH_RATE_RAD_S)
    quaternion_from_vector(dx[ATTITUDE], dx[ATTITUDE + 1], dx[ATTITUDE + 2], turn[0])
    quaternion_multiply(turn[0], was, turn[1])
    for i in range(4):
        q[i] = turn[1, i]
    quaternion_normalize(q)
    matrix_from_quaternion(q, C)
    for j in range(3):
        M[0, j] = u[1, 0] * C[0, j] + u[1, 1] * C[1, j] + u[1, 2] * C[2, j]
        M[1, j] = u[0, 0] * C[0, j] + u[0, 1] * C[1, j] + u[0, 2] * C[2, j]
        M[2, j] = -(u[2, 0] * C[0, j] + u[2, 1] * C[1, j] + u[2, 2] * C[2, j])
    roll, pitch, heading = euler_from_matrix(M)
    row["attitude"][0] = roll
    row["attitude"][1] = pitch
    row["attitude"][2] = heading
    c0, c1, c2 = rotate3_back(C, 0.0, 0.0, EARTH_RATE_RAD_S)
    before, after = (e0, e1, e2), (c0, c1, c2)
    for i in range(3):
        sensed = rate[i] + before[i]
        scale, change = 0.0, 0.0
        if scaled:
            scale, change = x[GYRO_SCALE + i], dx[GYRO_SCALE + i]
        sensed = (sensed * (1.0 + scale) - dx[GYRO_BIAS + i]) / (1.0 + scale + change)
        row["w_eb"][i] = sensed - after[i]
