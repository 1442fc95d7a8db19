"""Time propagation of the error covariance of an inertial navigation system in ECEF.

Error states, truth minus estimate, in this order: position (3, m), velocity (3, m/s),
attitude psi (3, rad; ECEF axes, see :mod:`replay.kernels.rotation`), gyro bias
(3, rad/s), accelerometer bias (3, m/s^2) and, with 21 states, gyro scale factor (3)
and accelerometer scale factor (3). Further states may follow; they are constants
or first-order Gauss-Markov processes here.

Only the first nine rows of the transition matrix differ from a diagonal one
(Groves 2e, eq. 14.48 and 14.49, psi-angle form of Lee (2010) eq. 9 to 11):

    d(dr)/dt = dv
    d(dv)/dt = -[f x] psi + G dr - 2 [w_ie x] dv - C (db_a + diag(f_b) ds_a)
    d(psi)/dt = -[w_ie x] psi - C (db_g + diag(w_b) ds_g)
"""

from numba import njit

from replay.kernels.earth import EARTH_RATE_RAD_S, GRAVITATIONAL_CONSTANT_M3_S2
from replay.kernels.elementary import sqrt
from replay.kernels.types import Array

POSITION = 0
VELOCITY = 3
ATTITUDE = 6
GYRO_BIAS = 9
ACCEL_BIAS = 12
GYRO_SCALE = 15
ACCEL_SCALE = 18


@njit(cache=True)
def _apply(
    row: Array,
    out: Array,
    dt: float,
    G: Array,
    C: Array,
    A: Array,
    W: Array,
    f: Array,
    scaled: bool,
) -> None:
    """One row of P times the transpose of the first nine rows of the transition matrix."""
    w = EARTH_RATE_RAD_S * dt
    w2 = 2.0 * w
    r0, r1, r2 = row[0], row[1], row[2]
    v0, v1, v2 = row[3], row[4], row[5]
    p0, p1, p2 = row[6], row[7], row[8]
    g0, g1, g2 = row[9], row[10], row[11]
    a0, a1, a2 = row[12], row[13], row[14]
    out[0] = r0 + dt * v0
    out[1] = r1 + dt * v1
    out[2] = r2 + dt * v2
    y0 = v0 + (G[0, 0] * r0 + G[0, 1] * r1 + G[0, 2] * r2) + w2 * v1
    y1 = v1 + (G[1, 0] * r0 + G[1, 1] * r1 + G[1, 2] * r2) - w2 * v0
    y2 = v2 + (G[2, 0] * r0 + G[2, 1] * r1 + G[2, 2] * r2)
    y0 -= f[1] * p2 - f[2] * p1
    y1 -= f[2] * p0 - f[0] * p2
    y2 -= f[0] * p1 - f[1] * p0
    y0 -= C[0, 0] * a0 + C[0, 1] * a1 + C[0, 2] * a2
    y1 -= C[1, 0] * a0 + C[1, 1] * a1 + C[1, 2] * a2
    y2 -= C[2, 0] * a0 + C[2, 1] * a1 + C[2, 2] * a2
    x0 = p0 + w * p1 - (C[0, 0] * g0 + C[0, 1] * g1 + C[0, 2] * g2)
    x1 = p1 - w * p0 - (C[1, 0] * g0 + C[1, 1] * g1 + C[1, 2] * g2)
    x2 = p2 - (C[2, 0] * g0 + C[2, 1] * g1 + C[2, 2] * g2)
    if scaled:
        s0, s1, s2 = row[15], row[16], row[17]
        x0 -= W[0, 0] * s0 + W[0, 1] * s1 + W[0, 2] * s2
        x1 -= W[1, 0] * s0 + W[1, 1] * s1 + W[1, 2] * s2
        x2 -= W[2, 0] * s0 + W[2, 1] * s1 + W[2, 2] * s2
        s0, s1, s2 = row[18], row[19], row[20]
        y0 -= A[0, 0] * s0 + A[0, 1] * s1 + A[0, 2] * s2
        y1 -= A[1, 0] * s0 + A[1, 1] * s1 + A[1, 2] * s2
        y2 -= A[2, 0] * s0 + A[2, 1] * s1 + A[2, 2] * s2
    out[3] = y0
    out[4] = y1
    out[5] = y2
    out[6] = x0
    out[7] = x1
    out[8] = x2


@njit(cache=True)
def transition_columns(T: Array, count: int, scaled: bool, work: Array) -> None:
    """The nine busy rows of the transition matrix times what each row of `T` says of the states.

    Parameters
    ----------
    T : float64 array (at least count, at least 21 or 15)
        Row by row; the first nine columns are changed, those of states 9 and on are not.
    count : int
        Rows.
    scaled : bool
        Whether states 15 to 20 are scale factors.
    work : float64 array
        As :func:`propagate` has left it: the same interval.
    """
    out = work[22]
    for k in range(count):
        _apply(T[k], out, work[23, 0], work[9:12], work[12:15], work[15:18], work[18:21],
               work[21], scaled)  # fmt: skip
        for i in range(9):
            T[k, i] = out[i]


@njit(cache=True)
def _add_body_noise(P: Array, first: int, C: Array, noise: Array) -> None:
    """Add C diag(noise) C' to the (3, 3) block at `first`."""
    a, b, c = noise[first], noise[first + 1], noise[first + 2]
    for i in range(3):
        for j in range(i, 3):
            value = P[first + i, first + j] + (
                C[i, 0] * a * C[j, 0] + C[i, 1] * b * C[j, 1] + C[i, 2] * c * C[j, 2]
            )
            P[first + i, first + j] = value
            P[first + j, first + i] = value


@njit(cache=True)
def _take(out: Array, n: int, a: float, x: Array, b: float, y: Array, c: float, z: Array) -> None:
    """Take a x + b y + c z off a row."""
    for j in range(n):
        out[j] -= a * x[j] + b * y[j] + c * z[j]


@njit(cache=True)
def _busy_rows(P: Array, n: int, scaled: bool, dt: float, work: Array) -> None:
    """The nine busy rows of Phi P into the first rows of `work`.

    Number for number what `_apply` does to a row of P, which is symmetric, but along rows, so
    that several columns are done at once.
    """
    w = EARTH_RATE_RAD_S * dt
    w2 = 2.0 * w
    f = work[21]
    r0, r1, r2 = P[0], P[1], P[2]
    v0, v1, v2 = P[3], P[4], P[5]
    p0, p1, p2 = P[6], P[7], P[8]
    for i in range(3):
        row, rate, out = P[i], P[3 + i], work[i]
        for j in range(n):
            out[j] = row[j] + dt * rate[j]
    y0, y1, y2 = work[3], work[4], work[5]
    a, b, c = work[9, 0], work[9, 1], work[9, 2]
    for j in range(n):
        y0[j] = v0[j] + (a * r0[j] + b * r1[j] + c * r2[j]) + w2 * v1[j]
    a, b, c = work[10, 0], work[10, 1], work[10, 2]
    for j in range(n):
        y1[j] = v1[j] + (a * r0[j] + b * r1[j] + c * r2[j]) - w2 * v0[j]
    a, b, c = work[11, 0], work[11, 1], work[11, 2]
    for j in range(n):
        y2[j] = v2[j] + (a * r0[j] + b * r1[j] + c * r2[j])
    a, b, c = f[0], f[1], f[2]
    for j in range(n):
        y0[j] -= b * p2[j] - c * p1[j]
    for j in range(n):
        y1[j] -= c * p0[j] - a * p2[j]
    for j in range(n):
        y2[j] -= a * p1[j] - b * p0[j]
    x0, x1, x2 = work[6], work[7], work[8]
    for j in range(n):
        x0[j] = p0[j] + w * p1[j]
    for j in range(n):
        x1[j] = p1[j] - w * p0[j]
    for j in range(n):
        x2[j] = p2[j]
    for i in range(3):
        a, b, c = work[12 + i, 0], work[12 + i, 1], work[12 + i, 2]
        _take(work[3 + i], n, a, P[12], b, P[13], c, P[14])
        _take(work[6 + i], n, a, P[9], b, P[10], c, P[11])
        if scaled:
            a, b, c = work[18 + i, 0], work[18 + i, 1], work[18 + i, 2]
            _take(work[6 + i], n, a, P[15], b, P[16], c, P[17])
            a, b, c = work[15 + i, 0], work[15 + i, 1], work[15 + i, 2]
            _take(work[3 + i], n, a, P[18], b, P[19], c, P[20])


@njit(cache=True)
def propagate(
    P: Array,
    n: int,
    scaled: bool,
    r: Array,
    C: Array,
    f_e: Array,
    f_b: Array,
    w_b: Array,
    dt: float,
    decay: Array,
    noise: Array,
    busy: int,
    work: Array,
) -> None:
    """P becomes Phi P Phi' + Q over one interval, exactly symmetric.

    Parameters
    ----------
    P : float64 array (n, n)
        Symmetric; changed in place.
    n : int
        Number of states.
    scaled : bool
        Whether states 15 to 20 are scale factors.
    r : float64 array (3,), m, ECEF
    C : float64 array (3, 3)
        Body to ECEF.
    f_e, f_b : float64 array (3,), m/s^2
        Specific force in ECEF and in body axes.
    w_b : float64 array (3,), rad/s
        Angular rate, body axes.
    dt : float, s
    decay : float64 array (n,)
        Diagonal of the transition matrix of states 9 and on.
    noise : float64 array (n,)
        Variance that each state gains over the interval; that of velocity and
        attitude along body axes.
    busy : int
        States that time changes; those behind them are constants, with a decay of one and no
        noise: what they are to each other stays as it is.
    work : float64 array (at least 25, at least max(n, 9))
        Overwritten.
    """
    G = work[9:12]
    Cd = work[12:15]
    A = work[15:18]
    W = work[18:21]
    f = work[21]
    out = work[22]
    r2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    k = GRAVITATIONAL_CONSTANT_M3_S2 / (r2 * sqrt(r2)) * dt
    centrifugal = EARTH_RATE_RAD_S * EARTH_RATE_RAD_S * dt
    for i in range(3):
        for j in range(3):
            G[i, j] = 3.0 * k * r[i] * r[j] / r2
            Cd[i, j] = C[i, j] * dt
            A[i, j] = C[i, j] * f_b[j] * dt
            W[i, j] = C[i, j] * w_b[j] * dt
        G[i, i] -= k
        f[i] = f_e[i] * dt
    G[0, 0] += centrifugal
    G[1, 1] += centrifugal
    work[23, 0] = dt
    _busy_rows(P, n, scaled, dt, work)
    for i in range(9):
        _apply(work[i], out, dt, G, Cd, A, W, f, scaled)
        for j in range(i, 9):
            P[i, j] = out[j]
            P[j, i] = out[j]
        P[i, i] += noise[i] if i < VELOCITY else 0.0
    _add_body_noise(P, VELOCITY, C, noise)
    _add_body_noise(P, ATTITUDE, C, noise)
    last = min(busy, n)
    for i in range(9):
        row, out = work[i], P[i]
        for j in range(9, last):
            out[j] = row[j] * decay[j]
        for j in range(last, n):
            out[j] = row[j]
    for j in range(9, last):
        row = P[j]
        d = decay[j]
        for m in range(j, last):
            row[m] = row[m] * d * decay[m]
        for m in range(last, n):
            row[m] = row[m] * d
        row[j] += noise[j]
    # What stands above the diagonal goes below it.
    for j in range(9, n):
        column = P[j]
        for i in range(9):
            column[i] = P[i, j]
        for m in range(9, min(j, last)):
            column[m] = P[m, j]
