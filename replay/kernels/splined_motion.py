"""A motion through recorded poses: least-squares B-splines of degree five, uniform knots.

Position (ECEF) and the quaternion of attitude, which is scaled to length one where it is
taken, are splines in time: four times continuously differentiable. Velocity, acceleration
and angular rate are their exact derivatives, so that specific force and rate are exact too.
"""

import numpy as np
from numba import njit

from replay.kernels.earth import EARTH_RATE_RAD_S, enu_axes, gravity
from replay.kernels.elementary import sqrt
from replay.kernels.rotation import (
    euler_from_matrix,
    matrix_from_euler,
    matrix_from_quaternion,
    multiply3,
    quaternion_from_matrix,
    rotate3,
    rotate3_back,
)
from replay.kernels.trajectory import NODES, WEIGHTS
from replay.kernels.types import Array, Record

DEGREE = 5
COLUMNS = 7  # of a row: position (3), quaternion (4)

# A spline at one moment; scratch.
SPLINE_POINT_DTYPE = np.dtype(
    [
        ("weights", "<f8", DEGREE + 1),
        ("value", "<f8", COLUMNS),
        ("first", "<f8", COLUMNS),  # derivative by s
        ("second", "<f8", COLUMNS),
        ("q", "<f8", 4),
        ("C", "<f8", (3, 3)),  # body to ECEF
        ("w_eb", "<f8", 3),  # rad/s, body relative to ECEF, body axes
    ],
    align=True,
)


@njit(cache=True)
def rows_of_truth(
    positions: Array, attitudes: Array, levers: Array, origin: Array, rows: Array
) -> None:
    """Rows for :func:`fit_spline`: the IMU and its attitude from the truth of another point.

    Parameters
    ----------
    positions : float64 array (n, 3), m, ECEF
        At the lever arm.
    attitudes : float64 array (n, 3), rad
        Roll, pitch, heading.
    levers : float64 array (n, 3), m, body
        IMU to the point.
    origin : float64 array (3,), m, ECEF
        Subtracted.
    rows : float64 array (n, 7)
        Written: position of the IMU less `origin`, body-to-ECEF quaternion without jumps
        of its sign.
    """
    M = np.zeros((3, 3))
    N = np.zeros((3, 3))
    L = np.zeros((3, 3))
    C = np.zeros((3, 3))
    for n in range(rows.shape[0]):
        p, a, lever, row = positions[n], attitudes[n], levers[n], rows[n]
        matrix_from_euler(a[0], a[1], a[2], L)
        x, y, z = p[0], p[1], p[2]
        for _ in range(2):  # local axes are those of the IMU, which the first turn finds
            _north_east_down(x, y, z, M, N)
            multiply3(N, L, C)
            d0, d1, d2 = rotate3(C, lever[0], lever[1], lever[2])
            x, y, z = p[0] - d0, p[1] - d1, p[2] - d2
        row[0] = x - origin[0]
        row[1] = y - origin[1]
        row[2] = z - origin[2]
        q = row[3:]
        quaternion_from_matrix(C, q)
        if n > 0:
            b = rows[n - 1]
            if q[0] * b[3] + q[1] * b[4] + q[2] * b[5] + q[3] * b[6] < 0.0:
                for i in range(4):
                    q[i] = -q[i]


@njit(cache=True)
def _north_east_down(x: float, y: float, z: float, M: Array, out: Array) -> None:
    """Matrix (3, 3) from local north-east-down axes to ECEF into `out`; `M` is scratch."""
    enu_axes(x, y, z, M)
    for i in range(3):
        out[i, 0] = M[1, i]
        out[i, 1] = M[0, i]
        out[i, 2] = -M[2, i]


@njit(cache=True)
def _basis(u: float, degree: int, out: Array) -> None:
    """Weights of the `degree + 1` uniform B-splines at `u` of a knot interval (Cox, de Boor)."""
    out[0] = 1.0
    for d in range(1, degree + 1):
        saved = 0.0
        for r in range(d):
            part = out[r] / d
            out[r] = saved + (r + 1 - u) * part
            saved = (u + (d - 1 - r)) * part
        out[d] = saved


@njit(cache=True)
def _interval(t: float, spacing: float, count: int) -> int:
    """Number of the knot interval in which a time (s) lies."""
    return max(0, min(count - DEGREE - 1, int(t / spacing)))


@njit(cache=True)
def fit_spline(
    times: Array, rows: Array, spacing: float, smoothing: float, coefficients: Array
) -> None:
    """Least-squares spline through rows, by the banded normal equations.

    A penalty on third differences fills what no row tells. The fit is repeated on its own
    residuals, which takes the penalty's bias and the rounding out of what rows do tell.

    Parameters
    ----------
    times : float64 array (n,), s
        From 0 on.
    rows : float64 array (n, 7)
        Overwritten with what is left of them.
    spacing : float, s
        Between knots.
    smoothing : float
        Weight of the penalty; that of a row is 1.
    coefficients : float64 array (k + 5, 7)
        Of a spline of k intervals. Written.
    """
    count = coefficients.shape[0]
    band = DEGREE + 1
    # Column b of row i is the element (i, i + b); after the loop the same of a factor U'U.
    A = np.zeros((count, band))
    weights = np.zeros(band)
    for n in range(times.shape[0]):
        first = _interval(times[n], spacing, count)
        _basis(times[n] / spacing - first, DEGREE, weights)
        for i in range(band):
            for j in range(i, band):
                A[first + i, j - i] += weights[i] * weights[j]
    third = (-1.0, 3.0, -3.0, 1.0)
    for k in range(count - 3):
        for i in range(4):
            for j in range(i, 4):
                A[k + i, j - i] += smoothing * (third[i] * third[j])
    for i in range(count):
        for k in range(max(0, i - DEGREE), i):
            for b in range(band - (i - k)):
                A[i, b] -= A[k, i - k] * A[k, i - k + b]
        pivot = 1.0 / sqrt(A[i, 0])
        for b in range(band):
            A[i, b] *= pivot
    right = np.zeros((count, COLUMNS))
    for i in range(count):
        for c in range(COLUMNS):
            coefficients[i, c] = 0.0
    for _ in range(3):
        for i in range(count):
            for c in range(COLUMNS):
                right[i, c] = 0.0
        for n in range(times.shape[0]):
            first = _interval(times[n], spacing, count)
            _basis(times[n] / spacing - first, DEGREE, weights)
            for i in range(band):
                for c in range(COLUMNS):
                    right[first + i, c] += weights[i] * rows[n, c]
        _solve(A, right)
        for i in range(count):
            for c in range(COLUMNS):
                coefficients[i, c] += right[i, c]
        for n in range(times.shape[0]):
            first = _interval(times[n], spacing, count)
            _basis(times[n] / spacing - first, DEGREE, weights)
            for i in range(band):
                for c in range(COLUMNS):
                    rows[n, c] -= weights[i] * right[first + i, c]


@njit(cache=True)
def _solve(U: Array, b: Array) -> None:
    """Solve U'U x = b in place, for a banded factor as in :func:`fit_spline`."""
    count, band = U.shape
    for i in range(count):
        for c in range(b.shape[1]):
            total = b[i, c]
            for k in range(max(0, i - band + 1), i):
                total -= U[k, i - k] * b[k, c]
            b[i, c] = total / U[i, 0]
    for back in range(count):
        i = count - 1 - back
        for c in range(b.shape[1]):
            total = b[i, c]
            for k in range(i + 1, min(count, i + band)):
                total -= U[i, k - i] * b[k, c]
            b[i, c] = total / U[i, 0]


@njit(cache=True)
def _at(coefficients: Array, spacing: float, t: float, m: Record) -> None:
    """Spline, its two derivatives, attitude and its rate at a time (s) into scratch."""
    first = _interval(t, spacing, coefficients.shape[0])
    u = t / spacing - first
    weights, value, d1, d2 = m["weights"], m["value"], m["first"], m["second"]
    scale = 1.0 / spacing
    for c in range(COLUMNS):
        value[c] = 0.0
        d1[c] = 0.0
        d2[c] = 0.0
    _basis(u, DEGREE, weights)
    for i in range(DEGREE + 1):
        for c in range(COLUMNS):
            value[c] += weights[i] * coefficients[first + i, c]
    _basis(u, DEGREE - 1, weights)
    for i in range(DEGREE):
        for c in range(COLUMNS):
            step = coefficients[first + i + 1, c] - coefficients[first + i, c]
            d1[c] += weights[i] * (step * scale)
    _basis(u, DEGREE - 2, weights)
    for i in range(DEGREE - 1):
        k = first + i
        for c in range(COLUMNS):
            before = coefficients[k + 1, c] - coefficients[k, c]
            bend = (coefficients[k + 2, c] - coefficients[k + 1, c]) - before
            d2[c] += weights[i] * (bend * (scale * scale))
    q, w = m["q"], m["w_eb"]
    square = 0.0
    for i in range(4):
        square += value[3 + i] * value[3 + i]
    for i in range(4):
        q[i] = value[3 + i] / sqrt(square)
    matrix_from_quaternion(q, m["C"])
    # w = 2 q* q', of which scaling q to length one leaves the vector part as it is.
    a, b = value[3:], d1[3:]
    k2 = 2.0 / square
    w[0] = k2 * (a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2])
    w[1] = k2 * (a[0] * b[2] - a[2] * b[0] - a[3] * b[1] + a[1] * b[3])
    w[2] = k2 * (a[0] * b[3] - a[3] * b[0] - a[1] * b[2] + a[2] * b[1])


@njit(cache=True)
def sense_spline(
    coefficients: Array,
    origin: Array,
    spacing: float,
    offset: float,
    step: float,
    positions: Array,
    rates: Array,
    forces: Array,
) -> None:
    """Positions on a grid of equal steps, and mean rate and specific force over each step.

    Parameters
    ----------
    coefficients : float64 array (k + 5, 7)
    origin : float64 array (3,), m, ECEF
        Added to positions.
    spacing : float, s
        Between knots.
    offset : float, s
        From the spline's start to the grid's.
    step : float, s
    positions : float64 array (n + 1, 3), m, ECEF
        Written.
    rates, forces : float64 arrays (n, 3), rad/s and m/s^2, body axes
        Written: means over the step that ends at `positions[i + 1]`.
    """
    m = np.zeros(1, dtype=SPLINE_POINT_DTYPE)[0]
    r, v, a, C, w = m["value"], m["first"], m["second"], m["C"], m["w_eb"]
    for n in range(positions.shape[0]):
        _at(coefficients, spacing, offset + n * step, m)
        for i in range(3):
            positions[n, i] = origin[i] + r[i]
    w2 = 2.0 * EARTH_RATE_RAD_S
    for n in range(rates.shape[0]):
        for i in range(3):
            rates[n, i] = 0.0
            forces[n, i] = 0.0
        for node in range(3):
            _at(coefficients, spacing, offset + (n + NODES[node]) * step, m)
            gx, gy, gz = gravity(origin[0] + r[0], origin[1] + r[1], origin[2] + r[2])
            f = rotate3_back(C, a[0] - w2 * v[1] - gx, a[1] + w2 * v[0] - gy, a[2] - gz)
            e = rotate3_back(C, 0.0, 0.0, EARTH_RATE_RAD_S)
            for i in range(3):
                rates[n, i] += WEIGHTS[node] * (w[i] + e[i])
                forces[n, i] += WEIGHTS[node] * f[i]


@njit(cache=True)
def spline_poses(
    coefficients: Array,
    origin: Array,
    spacing: float,
    offset: float,
    times: Array,
    poses: Array,
) -> None:
    """Poses at any times.

    Parameters
    ----------
    coefficients, origin, spacing, offset
        As in :func:`sense_spline`.
    times : float64 array (m,), s
        Since the grid's start.
    poses : array (m,) of POSE_DTYPE
        Written.
    """
    m = np.zeros(1, dtype=SPLINE_POINT_DTYPE)[0]
    M = np.zeros((3, 3))
    N = np.zeros((3, 3))
    L = np.zeros((3, 3))
    for n in range(times.shape[0]):
        _at(coefficients, spacing, offset + times[n], m)
        pose = poses[n]
        r = pose["r"]
        for i in range(3):
            r[i] = origin[i] + m["value"][i]
            pose["v"][i] = m["first"][i]
            pose["w_eb"][i] = m["w_eb"][i]
            for j in range(3):
                pose["C"][i, j] = m["C"][i, j]
        _north_east_down(r[0], r[1], r[2], M, N)
        east, north, up = rotate3(M, m["first"][0], m["first"][1], m["first"][2])
        pose["v_enu"][0] = east
        pose["v_enu"][1] = north
        pose["v_enu"][2] = up
        # Body to north-east-down is N' C.
        for i in range(3):
            for j in range(3):
                L[i, j] = N[0, i] * m["C"][0, j] + N[1, i] * m["C"][1, j] + N[2, i] * m["C"][2, j]
        roll, pitch, heading = euler_from_matrix(L)
        pose["attitude"][0] = roll
        pose["attitude"][1] = pitch
        pose["attitude"][2] = heading
