"""Strapdown mechanisation in ECEF with coning and sculling (Savage 1998; Groves 2e, ch. 5).

Specific force and angular rate are taken as linear in time over an interval and
the one before it, whose lengths may differ: that is what splitting an interval at
a GNSS time needs. With equal intervals the terms are the familiar ones with 1/12.
"""

import numpy as np
from numba import njit

from replay.kernels.earth import EARTH_RATE_RAD_S, gravity
from replay.kernels.rotation import (
    cross3,
    matrix_from_quaternion,
    quaternion_from_vector,
    quaternion_multiply,
    quaternion_normalize,
    rotate3,
)
from replay.kernels.types import Array, Record

# Position, velocity, attitude and the increments of the interval before.
NAVIGATION_DTYPE = np.dtype(
    [
        ("r", "<f8", 3),  # m, ECEF
        ("v", "<f8", 3),  # m/s, ECEF
        ("q", "<f8", 4),  # body to ECEF
        ("C", "<f8", (3, 3)),  # the same as a matrix
        ("dtheta", "<f8", 3),  # rad, body, previous interval
        ("dvel", "<f8", 3),  # m/s, body, previous interval
        ("dt", "<f8"),  # s, previous interval; 0 where there is none
        ("f_e", "<f8", 3),  # m/s^2, ECEF, mean specific force of the last interval
        ("w_b", "<f8", 3),  # rad/s, body relative to inertial, last interval
    ],
    align=True,
)


@njit(cache=True)
def mechanize(
    nav: Record,
    tx: float,
    ty: float,
    tz: float,
    ux: float,
    uy: float,
    uz: float,
    dt: float,
    scratch: Array,
) -> None:
    """Carry position, velocity and attitude over one interval.

    Parameters
    ----------
    nav : record of NAVIGATION_DTYPE
        Changed in place.
    tx, ty, tz : float, rad
        Integral of the angular rate over the interval, body axes, sensor errors removed.
    ux, uy, uz : float, m/s
        Integral of the specific force over the interval, body axes, sensor errors removed.
    dt : float, s
        Length of the interval, more than zero.
    scratch : float64 array (2, 4)
        Overwritten.
    """
    r, v, q, C = nav["r"], nav["v"], nav["q"], nav["C"]
    pt, pu = nav["dtheta"], nav["dvel"]
    # Coning and sculling from the change since the interval before.
    k = 0.0
    if nav["dt"] > 0.0:
        k = dt * dt / (6.0 * nav["dt"] * (nav["dt"] + dt))
    cx, cy, cz = cross3(pt[0], pt[1], pt[2], tx, ty, tz)
    ax, ay, az = cross3(pt[0], pt[1], pt[2], ux, uy, uz)
    bx, by, bz = cross3(pu[0], pu[1], pu[2], tx, ty, tz)
    # The body turns while it is pushed: to second order in the angle.
    rx, ry, rz = cross3(tx, ty, tz, ux, uy, uz)
    qx, qy, qz = cross3(tx, ty, tz, rx, ry, rz)
    sx = ux + 0.5 * rx + qx / 6.0 + k * (ax + bx)
    sy = uy + 0.5 * ry + qy / 6.0 + k * (ay + by)
    sz = uz + 0.5 * rz + qz / 6.0 + k * (az + bz)
    # Velocity increment in ECEF axes of the middle of the interval: the Earth turned half-way.
    dx, dy, dz = rotate3(C, sx, sy, sz)
    half = 0.5 * EARTH_RATE_RAD_S * dt
    ex = dx + half * dy
    ey = dy - half * dx
    # Gravity and Coriolis at the middle, from a predictor with the values at the start.
    gx, gy, gz = gravity(r[0], r[1], r[2])
    w2 = 2.0 * EARTH_RATE_RAD_S
    mx = v[0] + 0.5 * (ex + dt * (gx + w2 * v[1]))
    my = v[1] + 0.5 * (ey + dt * (gy - w2 * v[0]))
    mz = v[2] + 0.5 * (dz + dt * gz)
    gx, gy, gz = gravity(
        r[0] + 0.25 * dt * (v[0] + mx),
        r[1] + 0.25 * dt * (v[1] + my),
        r[2] + 0.25 * dt * (v[2] + mz),
    )
    vx = v[0] + ex + dt * (gx + w2 * my)
    vy = v[1] + ey + dt * (gy - w2 * mx)
    vz = v[2] + dz + dt * gz
    r[0] += 0.5 * dt * (v[0] + vx)
    r[1] += 0.5 * dt * (v[1] + vy)
    r[2] += 0.5 * dt * (v[2] + vz)
    v[0] = vx
    v[1] = vy
    v[2] = vz
    # Attitude: body rotation from the right, Earth rotation from the left.
    body = scratch[0]
    product = scratch[1]
    quaternion_from_vector(tx + k * cx, ty + k * cy, tz + k * cz, body)
    quaternion_multiply(q, body, product)
    quaternion_from_vector(0.0, 0.0, -EARTH_RATE_RAD_S * dt, body)
    quaternion_multiply(body, product, q)
    quaternion_normalize(q)
    matrix_from_quaternion(q, C)
    for i in range(3):
        pt[i] = (tx, ty, tz)[i]
        pu[i] = (ux, uy, uz)[i]
    nav["dt"] = dt
    f = nav["f_e"]
    f[0] = ex / dt
    f[1] = ey / dt
    f[2] = dz / dt
    w = nav["w_b"]
    w[0] = tx / dt
    w[1] = ty / dt
    w[2] = tz / dt
