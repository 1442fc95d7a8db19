"""Rotations. The one place where the conventions are written.

Frames: `i` inertial, `e` ECEF (WGS-84), `b` body (forward, right, down), `n`
local north-east-down, `l` local east-north-up.

* `C_b_e` is the matrix that turns body components into ECEF ones: v_e = C_b_e v_b.
* `q_b_e` is the same rotation as a unit quaternion (w, x, y, z), Hamilton product,
  w not negative after normalisation is *not* forced: q and -q are the same attitude.
* Roll, pitch, heading (Groves 2e, eq. 2.22 to 2.24): C_n_b = R1(roll) R2(pitch) R3(heading);
  heading counts clockwise from true north, in [0, 2 pi); pitch in [-pi/2, pi/2].
* The attitude error psi is a small rotation in ECEF axes from the estimate to the
  truth: C_b_e(true) = (I + [psi x]) C_b_e(estimated). The computer frame is ECEF
  itself, so that the psi-angle and phi-angle models coincide.
* A correction is always truth minus estimate, so that feedback is an addition.
"""

from numba import njit

from replay.kernels.elementary import asin, atan2, cos, sin, sincos, sqrt
from replay.kernels.types import Array

# Below this half-angle the series of sin(x)/x to x^10 is exact to the last bit or two.
_SERIES_HALF_ANGLE_RAD = 0.25


@njit(cache=True)
def half_angle_terms(angle_squared: float) -> tuple[float, float]:
    """cos(a/2) and sin(a/2)/a of a rotation angle whose square is given (rad^2)."""
    u = 0.25 * angle_squared
    if u < _SERIES_HALF_ANGLE_RAD * _SERIES_HALF_ANGLE_RAD:
        c = 1.0 - u / 2.0 * (
            1.0
            - u / 12.0 * (1.0 - u / 30.0 * (1.0 - u / 56.0 * (1.0 - u / 90.0 * (1.0 - u / 132.0))))
        )
        s = 0.5 * (
            1.0
            - u / 6.0 * (1.0 - u / 20.0 * (1.0 - u / 42.0 * (1.0 - u / 72.0 * (1.0 - u / 110.0))))
        )
        return c, s
    angle = sqrt(angle_squared)
    half = 0.5 * angle
    return cos(half), sin(half) / angle


@njit(cache=True)
def quaternion_from_vector(x: float, y: float, z: float, out: Array) -> None:
    """Quaternion of a rotation vector (rad) into `out` (4,)."""
    c, s = half_angle_terms(x * x + y * y + z * z)
    out[0] = c
    out[1] = s * x
    out[2] = s * y
    out[3] = s * z


@njit(cache=True)
def quaternion_multiply(p: Array, q: Array, out: Array) -> None:
    """Hamilton product p q into `out`, which may be neither p nor q."""
    out[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    out[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    out[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    out[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]


@njit(cache=True)
def quaternion_normalize(q: Array) -> None:
    """Scale `q` to length one in place."""
    scale = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] *= scale


@njit(cache=True)
def matrix_from_quaternion(q: Array, out: Array) -> None:
    """Matrix (3, 3) of a unit quaternion into `out`."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    out[0, 0] = w * w + x * x - y * y - z * z
    out[0, 1] = 2.0 * (x * y - w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[1, 1] = w * w - x * x + y * y - z * z
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[2, 1] = 2.0 * (y * z + w * x)
    out[2, 2] = w * w - x * x - y * y + z * z


@njit(cache=True)
def quaternion_from_matrix(C: Array, out: Array) -> None:
    """Unit quaternion of a rotation matrix, by the largest of the four components."""
    trace = C[0, 0] + C[1, 1] + C[2, 2]
    if trace >= C[0, 0] and trace >= C[1, 1] and trace >= C[2, 2]:
        w = 0.5 * sqrt(1.0 + trace)
        k = 0.25 / w
        out[0] = w
        out[1] = (C[2, 1] - C[1, 2]) * k
        out[2] = (C[0, 2] - C[2, 0]) * k
        out[3] = (C[1, 0] - C[0, 1]) * k
    elif C[0, 0] >= C[1, 1] and C[0, 0] >= C[2, 2]:
        x = 0.5 * sqrt(1.0 + C[0, 0] - C[1, 1] - C[2, 2])
        k = 0.25 / x
        out[0] = (C[2, 1] - C[1, 2]) * k
        out[1] = x
        out[2] = (C[0, 1] + C[1, 0]) * k
        out[3] = (C[0, 2] + C[2, 0]) * k
    elif C[1, 1] >= C[2, 2]:
        y = 0.5 * sqrt(1.0 - C[0, 0] + C[1, 1] - C[2, 2])
        k = 0.25 / y
        out[0] = (C[0, 2] - C[2, 0]) * k
        out[1] = (C[0, 1] + C[1, 0]) * k
        out[2] = y
        out[3] = (C[1, 2] + C[2, 1]) * k
    else:
        z = 0.5 * sqrt(1.0 - C[0, 0] - C[1, 1] + C[2, 2])
        k = 0.25 / z
        out[0] = (C[1, 0] - C[0, 1]) * k
        out[1] = (C[0, 2] + C[2, 0]) * k
        out[2] = (C[1, 2] + C[2, 1]) * k
        out[3] = z
    quaternion_normalize(out)


@njit(cache=True)
def matrix_from_euler(roll: float, pitch: float, heading: float, out: Array) -> None:
    """C_b_n (3, 3) of roll, pitch, heading (rad) into `out` (Groves 2e, eq. 2.24)."""
    sr, cr = sincos(roll)
    sp, cp = sincos(pitch)
    sh, ch = sincos(heading)
    out[0, 0] = cp * ch
    out[0, 1] = -cr * sh + sr * sp * ch
    out[0, 2] = sr * sh + cr * sp * ch
    out[1, 0] = cp * sh
    out[1, 1] = cr * ch + sr * sp * sh
    out[1, 2] = -sr * ch + cr * sp * sh
    out[2, 0] = -sp
    out[2, 1] = sr * cp
    out[2, 2] = cr * cp


@njit(cache=True)
def euler_from_matrix(C: Array) -> tuple[float, float, float]:
    """Roll, pitch, heading (rad) of C_b_n, heading in [0, 2 pi)."""
    s = -C[2, 0]
    if s > 1.0:
        s = 1.0
    elif s < -1.0:
        s = -1.0
    heading = atan2(C[1, 0], C[0, 0])
    if heading < 0.0:
        heading += 6.283185307179586
    return atan2(C[2, 1], C[2, 2]), asin(s), heading


@njit(cache=True)
def multiply3(A: Array, B: Array, out: Array) -> None:
    """Product of two (3, 3) matrices into `out`, which may be neither."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@njit(cache=True)
def rotate3(C: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """C times a vector, as three numbers."""
    return (
        C[0, 0] * x + C[0, 1] * y + C[0, 2] * z,
        C[1, 0] * x + C[1, 1] * y + C[1, 2] * z,
        C[2, 0] * x + C[2, 1] * y + C[2, 2] * z,
    )


@njit(cache=True)
def rotate3_back(C: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Transpose of C times a vector, as three numbers."""
    return (
        C[0, 0] * x + C[1, 0] * y + C[2, 0] * z,
        C[0, 1] * x + C[1, 1] * y + C[2, 1] * z,
        C[0, 2] * x + C[1, 2] * y + C[2, 2] * z,
    )


@njit(cache=True)
def cross3(
    a0: float, a1: float, a2: float, b0: float, b1: float, b2: float
) -> tuple[float, float, float]:
    """Vector product, as three numbers."""
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
