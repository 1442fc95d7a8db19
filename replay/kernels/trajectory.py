"""Motion of a simulated car, aircraft or walker and what perfect sensors there would read.

Velocity and attitude are closed functions of time (:mod:`replay.kernels.manoeuvres`);
the position is the integral of the velocity in ECEF (Runge-Kutta of order 4), and
inertial increments are integrals of the exact specific force and angular rate
(Gauss-Legendre of order 6).
"""

from typing import Any

import numpy as np
from numba import njit

from replay.kernels.earth import (
    EARTH_RATE_RAD_S,
    ECCENTRICITY_SQUARED,
    SEMI_MAJOR_AXIS_M,
    enu_axes,
    gravity,
    surface_normal,
)
from replay.kernels.elementary import sincos, sqrt
from replay.kernels.manoeuvres import MOTION_DTYPE, move, piece_at
from replay.kernels.rotation import (
    euler_from_matrix,
    matrix_from_euler,
    multiply3,
    rotate3,
    rotate3_back,
)
from replay.kernels.types import Array, Record

# Where the vehicle is at a moment; the IMU is the point that moves.
POSE_DTYPE = np.dtype(
    [
        ("r", "<f8", 3),  # m, ECEF
        ("v", "<f8", 3),  # m/s, ECEF
        ("v_enu", "<f8", 3),  # m/s
        ("attitude", "<f8", 3),  # rad: roll, pitch, heading
        ("C", "<f8", (3, 3)),  # body to ECEF
        ("w_eb", "<f8", 3),  # rad/s, body relative to ECEF, body axes
    ],
    align=True,
)

# Nodes and weights of Gauss and Legendre's rule with three points on [0, 1].
_NODE = 0.5 * sqrt(0.6)
NODES = (0.5 - _NODE, 0.5, 0.5 + _NODE)
WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)


@njit(cache=True)
def _attitude(m: Record) -> None:
    """Body to north-east-down, and the angular rate relative to those axes, in body axes."""
    angle, rate = m["angle"], m["angle_rate"]
    matrix_from_euler(angle[0], angle[1], angle[2], m["C"])
    sr, cr = sincos(angle[0])
    sp, cp = sincos(angle[1])
    w = m["w"]
    # Groves 2e, eq. 2.58 inverted.
    w[0] = rate[0] - sp * rate[2]
    w[1] = cr * rate[1] + sr * (cp * rate[2])
    w[2] = cr * (cp * rate[2]) - sr * rate[1]


@njit(cache=True)
def _local_frame(x: Array, v: Array) -> tuple[float, float, float, float, float, float, float]:
    """Sine, cosine of latitude and longitude, and the transport rate (rad/s; east, north, up)."""
    sin_lat, cos_lat, sin_lon, cos_lon, height = surface_normal(x[0], x[1], x[2])
    k = 1.0 - ECCENTRICITY_SQUARED * sin_lat * sin_lat
    N = SEMI_MAJOR_AXIS_M / sqrt(k)
    M = N * (1.0 - ECCENTRICITY_SQUARED) / k
    east = -v[1] / (M + height)
    north = v[0] / (N + height)
    return sin_lat, cos_lat, sin_lon, cos_lon, east, north, north * sin_lat / cos_lat


@njit(cache=True)
def _sense(m: Record) -> None:
    """Specific force and angular rate at `m["x"]`, body axes (Groves 2e, eq. 5.53 for f)."""
    x, v, a, f, w, C = m["x"], m["v"], m["a"], m["f"], m["w"], m["C"]
    sin_lat, cos_lat, sin_lon, cos_lon, te, tn, tu = _local_frame(x, v)
    gx, gy, gz = gravity(x[0], x[1], x[2])
    along = cos_lon * gx + sin_lon * gy
    ge = cos_lon * gy - sin_lon * gx
    gn = cos_lat * gz - sin_lat * along
    gu = cos_lat * along + sin_lat * gz
    wn = EARTH_RATE_RAD_S * cos_lat
    wu = EARTH_RATE_RAD_S * sin_lat
    qe, qn, qu = te, tn + 2.0 * wn, tu + 2.0 * wu
    fe = a[0] + (qn * v[2] - qu * v[1]) - ge
    fn = a[1] + (qu * v[0] - qe * v[2]) - gn
    fu = a[2] + (qe * v[1] - qn * v[0]) - gu
    f[0], f[1], f[2] = rotate3_back(C, fn, fe, -fu)
    e0, e1, e2 = rotate3_back(C, tn + wn, te, -(tu + wu))
    w[0] += e0
    w[1] += e1
    w[2] += e2


@njit(cache=True)
def _to_ecef(x: float, y: float, z: float, v: Array, out: Array) -> None:
    """Local velocity (east, north, up) at an ECEF position, in ECEF axes."""
    sin_lat, cos_lat, sin_lon, cos_lon, _ = surface_normal(x, y, z)
    horizontal = cos_lat * v[2] - sin_lat * v[1]
    out[0] = cos_lon * horizontal - sin_lon * v[0]
    out[1] = sin_lon * horizontal + cos_lon * v[0]
    out[2] = sin_lat * v[2] + cos_lat * v[1]


@njit(cache=True)
def _step(
    pieces: Array,
    first: int,
    body: Record,
    t: float,
    h: float,
    r: Array,
    m: Record,
    k: Array,
    out: Array,
) -> None:
    """Carry a position over `h` seconds; velocities at both ends stay in `k[0]` and `k[4]`.

    Parameters
    ----------
    pieces : array of PIECE_DTYPE
    first : int
        Piece in which `t` lies.
    body : record of BODY_DTYPE
    t, h : float, s
    r : float64 array (3,), m, ECEF
    m : record of MOTION_DTYPE
        Overwritten.
    k : float64 array (5, 3), m/s, ECEF
        Overwritten.
    out : float64 array (3,), m, ECEF
    """
    v = m["v"]
    move(pieces[first], t, body, m)
    _to_ecef(r[0], r[1], r[2], v, k[0])
    middle = piece_at(pieces, t + 0.5 * h, first)
    move(pieces[middle], t + 0.5 * h, body, m)
    for i in range(1, 3):
        s = 0.5 * h
        p = k[i - 1]
        _to_ecef(r[0] + s * p[0], r[1] + s * p[1], r[2] + s * p[2], v, k[i])
    move(pieces[piece_at(pieces, t + h, middle)], t + h, body, m)
    p = k[2]
    _to_ecef(r[0] + h * p[0], r[1] + h * p[1], r[2] + h * p[2], v, k[3])
    for j in range(3):
        out[j] = r[j] + h / 6.0 * (k[0, j] + 2.0 * (k[1, j] + k[2, j]) + k[3, j])
    _to_ecef(out[0], out[1], out[2], v, k[4])


@njit(cache=True)
def sense_motion(
    pieces: Array,
    body: Record,
    step: float,
    positions: Array,
    rates: Array,
    forces: Array,
    motion: Array,
) -> None:
    """Positions on a grid of equal steps, and mean rate and specific force over each step.

    Parameters
    ----------
    pieces : array of PIECE_DTYPE
        In the order of time; the last one goes on beyond its end.
    body : record of BODY_DTYPE
    step : float, s
    positions : float64 array (n + 1, 3), m, ECEF
        The first row is the start; the others are written.
    rates, forces : float64 arrays (n, 3), rad/s and m/s^2, body axes
        Written: means over the step that ends at `positions[i + 1]`.
    motion : array of one record of :func:`new_motion`
        Overwritten.
    """
    m = motion[0]
    k = np.zeros((5, 3))
    piece = 0
    x, w, f = m["x"], m["w"], m["f"]
    for n in range(rates.shape[0]):
        t = n * step
        piece = piece_at(pieces, t, piece)
        r = positions[n]
        end = positions[n + 1]
        _step(pieces, piece, body, t, step, r, m, k, end)
        for i in range(3):
            rates[n, i] = 0.0
            forces[n, i] = 0.0
        for node in range(3):
            s = NODES[node]
            at = t + s * step
            move(pieces[piece_at(pieces, at, piece)], at, body, m)
            _attitude(m)
            # Cubic Hermite between the ends: off by less than a nanometre at 20 Hz.
            b = s * s * (3.0 - 2.0 * s)
            c = s * (1.0 - s) * (1.0 - s) * step
            d = s * s * (s - 1.0) * step
            for i in range(3):
                x[i] = r[i] + b * (end[i] - r[i]) + c * k[0, i] + d * k[4, i]
            _sense(m)
            for i in range(3):
                rates[n, i] += WEIGHTS[node] * w[i]
                forces[n, i] += WEIGHTS[node] * f[i]


@njit(cache=True)
def poses_at(
    pieces: Array,
    body: Record,
    step: float,
    positions: Array,
    times: Array,
    motion: Array,
    poses: Array,
) -> None:
    """Poses at any times, from the grid of :func:`sense_motion`.

    Parameters
    ----------
    pieces, body, step, motion
        As in :func:`sense_motion`.
    positions : float64 array (n + 1, 3), m, ECEF
    times : float64 array (m,), s
        Ascending, not before zero.
    poses : array (m,) of POSE_DTYPE
        Written.
    """
    m = motion[0]
    k = np.zeros((5, 3))
    M = np.zeros((3, 3))
    N = np.zeros((3, 3))
    piece = 0
    last = positions.shape[0] - 1
    for n in range(times.shape[0]):
        t = times[n]
        grid = min(last, int(t / step))
        base = grid * step
        piece = piece_at(pieces, base, piece)
        pose = poses[n]
        r, w = pose["r"], pose["w_eb"]
        _step(pieces, piece, body, base, t - base, positions[grid], m, k, r)
        _attitude(m)
        _, _, _, _, te, tn, tu = _local_frame(r, m["v"])
        e0, e1, e2 = rotate3_back(m["C"], tn, te, -tu)
        w[0] = m["w"][0] + e0
        w[1] = m["w"][1] + e1
        w[2] = m["w"][2] + e2
        enu_axes(r[0], r[1], r[2], M)
        for i in range(3):
            N[i, 0] = M[1, i]
            N[i, 1] = M[0, i]
            N[i, 2] = -M[2, i]
        multiply3(N, m["C"], pose["C"])
        roll, pitch, heading = euler_from_matrix(m["C"])
        pose["attitude"][0] = roll
        pose["attitude"][1] = pitch
        pose["attitude"][2] = heading
        for i in range(3):
            pose["v"][i] = k[4, i]
            pose["v_enu"][i] = m["v"][i]


def new_motion() -> np.ndarray[Any, Any]:
    """Scratch of one record for the functions above."""
    return np.zeros(1, dtype=MOTION_DTYPE)


@njit(cache=True)
def antenna_fixes(
    poses: Array,
    lever: Array,
    position_errors: Array,
    velocity_errors: Array,
    positions: Array,
    velocities: Array,
) -> None:
    """Position and velocity of an antenna, with errors given in local axes.

    Parameters
    ----------
    poses : array (n,) of POSE_DTYPE
    lever : float64 array (3,), m, body
    position_errors, velocity_errors : float64 arrays (n, 3), m and m/s, east, north, up
    positions, velocities : float64 arrays (n, 3), m and m/s, ECEF
        Written.
    """
    M = np.zeros((3, 3))
    for n in range(poses.shape[0]):
        pose = poses[n]
        r, v, C, w = pose["r"], pose["v"], pose["C"], pose["w_eb"]
        a0, a1, a2 = rotate3(C, lever[0], lever[1], lever[2])
        b0, b1, b2 = rotate3(
            C,
            w[1] * lever[2] - w[2] * lever[1],
            w[2] * lever[0] - w[0] * lever[2],
            w[0] * lever[1] - w[1] * lever[0],
        )
        enu_axes(r[0], r[1], r[2], M)
        p, q = position_errors[n], velocity_errors[n]
        c0, c1, c2 = rotate3_back(M, p[0], p[1], p[2])
        d0, d1, d2 = rotate3_back(M, q[0], q[1], q[2])
        positions[n, 0] = r[0] + a0 + c0
        positions[n, 1] = r[1] + a1 + c1
        positions[n, 2] = r[2] + a2 + c2
        velocities[n, 0] = v[0] + b0 + d0
        velocities[n, 1] = v[1] + b1 + d1
        velocities[n, 2] = v[2] + b2 + d2
