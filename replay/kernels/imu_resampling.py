"""Inertial samples at a lower rate: every n-th as it stands, or n of them made one.

What n samples are to become is found by carrying them through the same equations that
the strapdown uses (Bortz 1971; Savage 1998, parts 1 and 2), in axes that do not turn:

    phi_i = a_i + k_i a_(i-1) x a_i                    rotation vector of one interval
    s_i = u_i + a_i x u_i / 2 + a_i x (a_i x u_i) / 6
          + k_i (a_(i-1) x u_i + u_(i-1) x a_i)        velocity, axes of its start
    k_i = dt_i^2 / (6 dt_(i-1) (dt_(i-1) + dt_i))      1/12 for equal intervals

with a and u the integrals of angular rate and specific force over an interval. Rotations
are multiplied and velocities turned into the axes of the start of the n, which gives the
rotation Phi and the velocity S of the long interval, coning and sculling inside it
included. The long sample's own integrals A and U are those with which the same two
equations, given the long sample before, yield Phi and S:

    A + K (A_before x A) = Phi
    U + A x U / 2 + A x (A x U) / 6 + K (A_before x U + U_before x A) = S

Both are linear in what is sought. So coning that a long interval still shows by itself is
not counted twice, and about one fixed axis A is the plain sum of the short integrals.
"""

import numpy as np
from numba import njit

from replay.kernels.elementary import atan2, sqrt
from replay.kernels.rotation import (
    cross3,
    matrix_from_quaternion,
    quaternion_from_vector,
    quaternion_multiply,
    quaternion_normalize,
    rotate3,
)
from replay.kernels.types import Array, Record

# What is carried from one sample to the next.
RESAMPLING_DTYPE = np.dtype(
    [
        ("t", "<i8"),  # ns, last sample; -1 before the first
        ("log_t", "<i8"),  # ns, when it became available
        ("start", "<i8"),  # ns, where the open long interval begins
        ("count", "<i8"),  # samples in it
        ("w", "<f8", 3),  # rad/s, body, last sample
        ("f", "<f8", 3),  # m/s^2, body, last sample
        ("temperature", "<f8"),  # degC, last sample, NaN where there is none
        ("q", "<f8", 4),  # rotation since the start of the open interval
        ("C", "<f8", (3, 3)),  # the same as a matrix
        ("s", "<f8", 3),  # m/s, axes of the start
        ("a", "<f8", 3),  # rad, the short interval before
        ("u", "<f8", 3),  # m/s
        ("dt", "<f8"),  # s; 0 where there is none
        ("A", "<f8", 3),  # rad, the long interval before, as it was written
        ("U", "<f8", 3),  # m/s
        ("T", "<f8"),  # s; 0 where there is none
        ("bad", "<i8"),  # samples with a value that is no number
        ("late", "<i8"),  # samples that are not after the one before
        ("gaps", "<i8"),  # intervals that are too long
    ],
    align=True,
)

# One sample that is written.
SAMPLE_DTYPE = np.dtype(
    [
        ("t", "<i8"),  # ns
        ("log_t", "<i8"),  # ns
        ("w", "<f8", 3),  # rad/s, body
        ("f", "<f8", 3),  # m/s^2, body
        ("temperature", "<f8"),  # degC, NaN where there is none
    ],
    align=True,
)


def new_resampling() -> Array:
    """State before the first sample, an array of one record."""
    state = np.zeros(1, dtype=RESAMPLING_DTYPE)
    state["t"] = -1
    return state


@njit(cache=True)
def resample(
    samples: Array,
    ratio: int,
    integrate: bool,
    longest_ns: int,
    state: Array,
    scratch: Array,
    out: Array,
) -> int:
    """Take samples and write those of the lower rate.

    The first sample is written as it stands, since nobody knows where its interval
    begins; then one at the end of each `ratio` intervals. At an interval over
    `longest_ns` what is open is written, shorter than the others, and the sample after
    it as it stands, so that the gap stays a gap.

    Parameters
    ----------
    samples : array (n,) of SAMPLE_DTYPE
    ratio : int
        Samples that become one, 2 or more.
    integrate : bool
        Else the last of them is taken as it stands.
    longest_ns : int, ns
    state : array (1,) of RESAMPLING_DTYPE
        Changed in place.
    scratch : float64 array (2, 4)
        Overwritten.
    out : array (n + 1,) of SAMPLE_DTYPE
        Written.

    Returns
    -------
    int
        How many were written.
    """
    s = state[0]
    written = 0
    for n in range(samples.shape[0]):
        sample = samples[n]
        finite = True
        for i in range(3):
            if not (abs(sample["w"][i]) < np.inf and abs(sample["f"][i]) < np.inf):
                finite = False
        if not finite:
            s["bad"] += 1
            continue
        since = sample["t"] - s["t"]
        if s["t"] >= 0 and since <= 0:
            s["late"] += 1
            continue
        first = s["t"] < 0
        gap = not first and since > longest_ns
        if gap:
            s["gaps"] += 1
            written += close_interval(state, integrate, scratch, out[written:])
        dt = 0.0 if first else since * 1e-9
        if not (first or gap):
            if s["count"] == 0:
                _open(s)
            _add(s, sample, dt, scratch)
        _remember(s, sample, dt)
        if first or gap:
            _as_it_stands(s, dt, out[written])
            written += 1
        elif s["count"] == ratio:
            written += close_interval(state, integrate, scratch, out[written:])
    return written


@njit(cache=True)
def close_interval(state: Array, integrate: bool, scratch: Array, out: Array) -> int:
    """Write the long interval that is open, 1; or nothing where none is, 0."""
    s = state[0]
    if s["count"] == 0:
        return 0
    long_s = (s["t"] - s["start"]) * 1e-9
    s["count"] = 0
    if not integrate:
        _as_it_stands(s, long_s, out[0])
        return 1
    phi = scratch[0]
    _rotation_vector(s["q"], phi)
    A, U = s["A"], s["U"]
    k = 0.0
    if s["T"] > 0.0:
        k = long_s * long_s / (6.0 * s["T"] * (s["T"] + long_s))
    # (I + [c x]) A = phi, whose inverse is (I + c c' - [c x]) / (1 + c c).
    cx, cy, cz = k * A[0], k * A[1], k * A[2]
    along = cx * phi[0] + cy * phi[1] + cz * phi[2]
    mx, my, mz = cross3(cx, cy, cz, phi[0], phi[1], phi[2])
    scale = 1.0 / (1.0 + cx * cx + cy * cy + cz * cz)
    ax = (phi[0] + cx * along - mx) * scale
    ay = (phi[1] + cy * along - my) * scale
    az = (phi[2] + cz * along - mz) * scale
    # M U = S - k U_before x A with M = I + [A/2 + c x] + [A x]^2 / 6.
    bx, by, bz = cross3(U[0], U[1], U[2], ax, ay, az)
    rx, ry, rz = s["s"][0] - k * bx, s["s"][1] - k * by, s["s"][2] - k * bz
    hx, hy, hz = 0.5 * ax + cx, 0.5 * ay + cy, 0.5 * az + cz
    square = ax * ax + ay * ay + az * az
    m00 = 1.0 + (ax * ax - square) / 6.0
    m11 = 1.0 + (ay * ay - square) / 6.0
    m22 = 1.0 + (az * az - square) / 6.0
    m01, m10 = ax * ay / 6.0 - hz, ax * ay / 6.0 + hz
    m02, m20 = ax * az / 6.0 + hy, ax * az / 6.0 - hy
    m12, m21 = ay * az / 6.0 - hx, ay * az / 6.0 + hx
    # Columns of the adjugate are cross products of the rows.
    px, py, pz = cross3(m10, m11, m12, m20, m21, m22)
    qx, qy, qz = cross3(m20, m21, m22, m00, m01, m02)
    wx, wy, wz = cross3(m00, m01, m02, m10, m11, m12)
    over = 1.0 / (m00 * px + m01 * py + m02 * pz)
    A[0], A[1], A[2] = ax, ay, az
    U[0] = (rx * px + ry * qx + rz * wx) * over
    U[1] = (rx * py + ry * qy + rz * wy) * over
    U[2] = (rx * pz + ry * qz + rz * wz) * over
    s["T"] = long_s
    row = out[0]
    row["t"] = s["t"]
    row["log_t"] = s["log_t"]
    row["temperature"] = s["temperature"]
    for i in range(3):
        row["w"][i] = A[i] / long_s
        row["f"][i] = U[i] / long_s
    return 1


@njit(cache=True)
def _open(s: Record) -> None:
    s["start"] = s["t"]
    for i in range(3):
        s["s"][i] = 0.0
        s["q"][i + 1] = 0.0
    s["q"][0] = 1.0
    matrix_from_quaternion(s["q"], s["C"])


@njit(cache=True)
def _add(s: Record, sample: Record, dt: float, scratch: Array) -> None:
    """Carry rotation and velocity over one short interval."""
    w, f = sample["w"], sample["f"]
    tx, ty, tz = w[0] * dt, w[1] * dt, w[2] * dt
    ux, uy, uz = f[0] * dt, f[1] * dt, f[2] * dt
    pt, pu = s["a"], s["u"]
    k = 0.0
    if s["dt"] > 0.0:
        k = dt * dt / (6.0 * s["dt"] * (s["dt"] + dt))
    cx, cy, cz = cross3(pt[0], pt[1], pt[2], tx, ty, tz)
    ax, ay, az = cross3(pt[0], pt[1], pt[2], ux, uy, uz)
    bx, by, bz = cross3(pu[0], pu[1], pu[2], tx, ty, tz)
    rx, ry, rz = cross3(tx, ty, tz, ux, uy, uz)
    qx, qy, qz = cross3(tx, ty, tz, rx, ry, rz)
    dx, dy, dz = rotate3(
        s["C"],
        ux + 0.5 * rx + qx / 6.0 + k * (ax + bx),
        uy + 0.5 * ry + qy / 6.0 + k * (ay + by),
        uz + 0.5 * rz + qz / 6.0 + k * (az + bz),
    )
    s["s"][0] += dx
    s["s"][1] += dy
    s["s"][2] += dz
    turn, product = scratch[0], scratch[1]
    quaternion_from_vector(tx + k * cx, ty + k * cy, tz + k * cz, turn)
    quaternion_multiply(s["q"], turn, product)
    for i in range(4):
        s["q"][i] = product[i]
    quaternion_normalize(s["q"])
    matrix_from_quaternion(s["q"], s["C"])
    s["count"] += 1


@njit(cache=True)
def _remember(s: Record, sample: Record, dt: float) -> None:
    s["t"] = sample["t"]
    s["log_t"] = sample["log_t"]
    s["temperature"] = sample["temperature"]
    s["dt"] = dt
    for i in range(3):
        s["w"][i] = sample["w"][i]
        s["f"][i] = sample["f"][i]
        s["a"][i] = sample["w"][i] * dt
        s["u"][i] = sample["f"][i] * dt


@njit(cache=True)
def _as_it_stands(s: Record, long_s: float, row: Record) -> None:
    """Write the last sample, whose interval is `long_s` now."""
    row["t"] = s["t"]
    row["log_t"] = s["log_t"]
    row["temperature"] = s["temperature"]
    s["T"] = long_s
    for i in range(3):
        row["w"][i] = s["w"][i]
        row["f"][i] = s["f"][i]
        s["A"][i] = s["w"][i] * long_s
        s["U"][i] = s["f"][i] * long_s


@njit(cache=True)
def _rotation_vector(q: Array, out: Array) -> None:
    """Rotation vector (rad) of a unit quaternion of less than half a turn into `out`."""
    square = q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    if square < 1e-4:
        # asin(x) / x to x^8: what is left out is less than 1e-17 at a half-angle of 0.01.
        scale = 2.0 * (1.0 + square * (1.0 / 6.0 + square * (3.0 / 40.0 + square * (15.0 / 336.0))))
        if q[0] < 0.0:
            scale = -scale
    else:
        length = sqrt(square)
        scale = 2.0 * atan2(length, q[0]) / length
    for i in range(3):
        out[i] = scale * q[i + 1]
