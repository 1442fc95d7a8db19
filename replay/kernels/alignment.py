"""First attitude of an inertial system: level at rest, heading from the course.

At rest the mean specific force gives roll and pitch and the mean rate the gyro
bias; attitude then follows the gyros in a level frame of unknown heading until
the vehicle drives fast and straight enough for the course to be its heading, or the
opposite of it, as the push since the rest tells. A
log that begins in motion is levelled with the acceleration that GNSS sees.
"""

from numba import njit

from replay.kernels.constraints import is_still, push_sample, samples_in, window_mean
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
from replay.kernels.elementary import asin, atan2, sqrt
from replay.kernels.kalman import whitened_update
from replay.kernels.records import (
    EVENT_ALIGNED,
    EVENT_LEVELLED,
    LEVELLED,
    RUNNING,
    WAITING,
    WINDOW,
)
from replay.kernels.rotation import (
    cross3,
    euler_from_matrix,
    matrix_from_euler,
    matrix_from_quaternion,
    multiply3,
    quaternion_from_matrix,
    quaternion_from_vector,
    quaternion_multiply,
    quaternion_normalize,
    rotate3,
    rotate3_back,
)
from replay.kernels.types import Array, Record
from replay.kernels.update import diagonal, fill_covariance, record_event, state_count

_GRAVITY_M_S2 = 9.80665
_HALF_TURN_RAD = 3.141592653589793
_GUARD_BLOCKS = 2
_LARGEST_BIAS_RAD_S = 0.05  # 3 deg/s: what a gyro at rest may show
_RECENT_FIX_S = 2.0
_SET_OUT_M_S = 0.5  # since the last rest; what it gains steadily after that is no rest
_TURN_WINDOW_S = 0.2  # long enough to average an engine's shaking
_MOVING_TILT_FACTOR = 4.0  # levelling in motion is that much worse than at rest


@njit(cache=True)
def _square(x: float) -> float:
    return x * x


@njit(cache=True)
def _level(s: Record, work: Record) -> None:
    """Roll, pitch and gyro bias from the sums at rest."""
    total = s["rest_sum"]
    count = s["rest_count"]
    fx, fy, fz = total[3] / count, total[4] / count, total[5] / count
    roll = atan2(-fy, -fz)
    pitch = atan2(fx, sqrt(fy * fy + fz * fz))
    matrix_from_euler(roll, pitch, 0.0, work["M"])
    q = s["rest_q"]
    quaternion_from_matrix(work["M"], q)
    for i in range(4):
        s["align_q"][i] = q[i]
    for i in range(3):
        s["bg"][i] = total[i] / count
        s["rest_f"][i] = total[3 + i] / count


@njit(cache=True)
def _is_driven(s: Record, cfg: Record, work: Record, t: int) -> bool:
    """Whether what looks like rest is smooth motion: GNSS says so, or no bias is that large.

    A steady push looks like rest on a slope; that it set out just now tells them apart.
    """
    mean = work["mean"]
    rate = mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2]
    if rate > _LARGEST_BIAS_RAD_S * _LARGEST_BIAS_RAD_S:
        return True
    v = s["align_v"]
    if s["mode"] == LEVELLED and v[0] * v[0] + v[1] * v[1] > _SET_OUT_M_S * _SET_OUT_M_S:
        return True
    recent = s["align_fix_t"] >= 0 and (t - s["align_fix_t"]) * 1e-9 < _RECENT_FIX_S
    return recent and s["align_speed"] >= cfg["course_speed"]


@njit(cache=True)
def align_sample(
    s: Record,
    cfg: Record,
    work: Record,
    dt: float,
    t: int,
    log_t: int,
    events: Array,
    counts: Array,
) -> None:
    """Take one inertial sample (in `s["w_raw"]`, `s["f_raw"]`) while the attitude is unknown."""
    w, f = s["w_raw"], s["f_raw"]
    push_sample(s, w, f)
    still = is_still(s, cfg, work, False) and not _is_driven(s, cfg, work, t)
    if still:
        # A sample of a little earlier: the first ones of a start pass for rest.
        total = s["rest_sum"]
        older = s["window"][
            (s["window_head"] - 1 - _GUARD_BLOCKS * cfg["stop_block"] + WINDOW) % WINDOW
        ]
        for i in range(6):
            total[i] += older[i]
        s["rest_count"] += 1
        if s["rest_count"] * cfg["imu_interval"] >= cfg["rest_time"]:
            _level(s, work)
            if s["mode"] == WAITING:
                s["mode"] = LEVELLED
                record_event(events, counts, t, log_t, EVENT_LEVELLED, cfg["rest_time"], 0)
    elif s["mode"] == WAITING:
        s["rest_count"] = 0
        for i in range(6):
            s["rest_sum"][i] = 0.0
    if still:
        for i in range(3):
            s["align_v"][i] = 0.0
    if s["mode"] == LEVELLED and not still:
        v = s["align_v"]
        if v[0] == 0.0 and v[1] == 0.0 and v[2] == 0.0:
            # It began before it was seen: the samples that were kept out of the rest are motion.
            guard = _GUARD_BLOCKS * cfg["stop_block"]
            for k in range(min(guard, s["window_count"] - 1), 0, -1):
                old = s["window"][(s["window_head"] - 1 - k + WINDOW) % WINDOW]
                _turn(s, work, old[:3], old[3:], cfg["imu_interval"])
        _turn(s, work, w, f, dt)


@njit(cache=True)
def _turn(s: Record, work: Record, w: Array, f: Array, dt: float) -> None:
    """Carry attitude and velocity since the rest over a sample, in a level frame."""
    bg = s["bg"]
    q, scratch = s["align_q"], work["q"]
    quaternion_from_vector(
        (w[0] - bg[0]) * dt, (w[1] - bg[1]) * dt, (w[2] - bg[2]) * dt, scratch[0]
    )
    quaternion_multiply(q, scratch[0], scratch[1])
    for i in range(4):
        q[i] = scratch[1, i]
    quaternion_normalize(q)
    # Gravity is what the specific force was at rest, so that the bias goes with it.
    M, v = work["M"], s["align_v"]
    matrix_from_quaternion(q, M)
    a0, a1, a2 = rotate3(M, f[0], f[1], f[2])
    rest = s["rest_f"]
    v[0] += a0 * dt
    v[1] += a1 * dt
    v[2] += (a2 + sqrt(rest[0] * rest[0] + rest[1] * rest[1] + rest[2] * rest[2])) * dt


@njit(cache=True)
def align_fix(
    s: Record, cfg: Record, work: Record, fix: Record, log_t: int, events: Array, counts: Array
) -> bool:
    """Take one fix while the heading is unknown; True where the filter begins to run."""
    u = work["axes"]
    enu_axes(fix["r"][0], fix["r"][1], fix["r"][2], u)
    before_t = s["align_fix_t"]
    before_speed = s["align_speed"]
    between = (fix["t"] - before_t) * 1e-9
    known = True
    if fix["has_v"] == 1:
        ve, vn, vu = rotate3(u, fix["v"][0], fix["v"][1], fix["v"][2])
    elif before_t >= 0 and 0.0 < between <= 2.0:
        p = s["align_fix_r"]
        ve, vn, vu = rotate3(
            u,
            (fix["r"][0] - p[0]) / between,
            (fix["r"][1] - p[1]) / between,
            (fix["r"][2] - p[2]) / between,
        )
    else:
        ve = vn = vu = 0.0
        known = False
    speed = sqrt(ve * ve + vn * vn)
    s["align_fix_t"] = fix["t"]
    for i in range(3):
        s["align_fix_r"][i] = fix["r"][i]
    s["align_speed"] = speed if known else -1.0
    if not known or speed < cfg["course_speed"]:
        return False
    bg, mean = s["bg"], work["mean"]
    if s["window_count"] == 0:
        return False
    window_mean(s, 0, min(s["window_count"], samples_in(_TURN_WINDOW_S, cfg)), mean)
    if abs(mean[2] - bg[2]) > cfg["course_turn_rate"]:
        return False
    course = atan2(ve, vn)
    M = work["M"]
    factor = 1.0
    roll0 = pitch0 = heading0 = turned = 0.0
    if s["mode"] == LEVELLED:
        matrix_from_quaternion(s["align_q"], M)
        roll, pitch, heading = euler_from_matrix(M)
        v = s["align_v"]
        if M[0, 0] * v[0] + M[1, 0] * v[1] + M[2, 0] * v[2] < 0.0:
            course += _HALF_TURN_RAD  # it set out backward
        turned = course - heading
        # The mean rate at rest holds the Earth's rate: take it out with the attitude of then.
        matrix_from_quaternion(s["rest_q"], M)
        roll0, pitch0, heading0 = euler_from_matrix(M)
        matrix_from_euler(roll0, pitch0, heading0 + turned, M)
        north = EARTH_RATE_RAD_S * u[1, 2]
        down = -EARTH_RATE_RAD_S * u[2, 2]
        e0, e1, e2 = rotate3_back(M, north, 0.0, down)
        bg[0] -= e0
        bg[1] -= e1
        bg[2] -= e2
    else:
        if before_t < 0 or before_speed < 0.0 or not 0.0 < between <= 2.0:
            return False
        length = min(s["window_count"], samples_in(between, cfg))
        window_mean(s, 0, length, mean)
        forward = (speed - before_speed) / between
        ratio = (mean[3] - forward) / _GRAVITY_M_S2
        pitch = asin(min(0.5, max(-0.5, ratio)))
        roll = atan2(-(mean[4] - speed * mean[2]), -mean[5])
        factor = _MOVING_TILT_FACTOR
    _start(s, cfg, work, fix, roll, pitch, course, ve, vn, vu, factor)
    if s["mode"] == LEVELLED and cfg["rest_sigma"] > 0.0:
        M, N, u = work["M"], work["N"], work["axes"]
        matrix_from_euler(roll0, pitch0, heading0 + turned, N)
        _north_east_down(u, work["S"])
        multiply3(work["S"], N, M)
        _tie_tilt_to_bias(s, cfg, work)
    s["mode"] = RUNNING
    record_event(events, counts, fix["t"], log_t, EVENT_ALIGNED, course, 0)
    return True


@njit(cache=True)
def _north_east_down(u: Array, out: Array) -> None:
    """C_n_e into `out` from the rows of east, north and up."""
    for i in range(3):
        out[i, 0] = u[1, i]
        out[i, 1] = u[0, i]
        out[i, 2] = -u[2, i]


@njit(cache=True)
def _start(
    s: Record,
    cfg: Record,
    work: Record,
    fix: Record,
    roll: float,
    pitch: float,
    heading: float,
    ve: float,
    vn: float,
    vu: float,
    factor: float,
) -> None:
    """Navigation state and covariance at a fix (velocity in east, north, up)."""
    nav = s["nav"]
    u, M, N = work["axes"], work["M"], work["N"]
    matrix_from_euler(roll, pitch, heading, M)
    _north_east_down(u, N)
    C = nav["C"]
    multiply3(N, M, C)
    quaternion_from_matrix(C, nav["q"])
    matrix_from_quaternion(nav["q"], C)
    r, v = nav["r"], nav["v"]
    lever = fix["lever"]
    a0, a1, a2 = rotate3(C, lever[0], lever[1], lever[2])
    w, bg = s["w_raw"], s["bg"]
    c0, c1, c2 = cross3(w[0] - bg[0], w[1] - bg[1], w[2] - bg[2], lever[0], lever[1], lever[2])
    b0, b1, b2 = rotate3(C, c0, c1, c2)
    r[0] = fix["r"][0] - a0
    r[1] = fix["r"][1] - a1
    r[2] = fix["r"][2] - a2
    v[0] = u[0, 0] * ve + u[1, 0] * vn + u[2, 0] * vu - b0
    v[1] = u[0, 1] * ve + u[1, 1] * vn + u[2, 1] * vu - b1
    v[2] = u[0, 2] * ve + u[1, 2] * vn + u[2, 2] * vu - b2
    nav["dt"] = 0.0
    s["t"] = fix["t"]
    P = s["P"]
    n = state_count(cfg)
    for i in range(n):
        for j in range(n):
            P[i, j] = 0.0
    R = work["R"]
    fill_covariance(R, fix["R"], cfg["position_scale"], cfg["position_floor"])
    _rotate_block(P, POSITION, u, R)
    variance = cfg["velocity_initial"] * cfg["velocity_initial"]
    for i in range(3):
        for j in range(3):
            R[i, j] = 0.0
        R[i, i] = variance
    _rotate_block(P, VELOCITY, u, R)
    tilt = cfg["tilt_initial"] * factor
    R[0, 0] = tilt * tilt
    R[1, 1] = tilt * tilt
    R[2, 2] = cfg["heading_initial"] * cfg["heading_initial"]
    _rotate_block(P, ATTITUDE, u, R)
    for i in range(3):
        P[GYRO_BIAS + i, GYRO_BIAS + i] = _square(cfg["gyro_bias_initial"][i]) * factor
        P[ACCEL_BIAS + i, ACCEL_BIAS + i] = _square(cfg["accel_bias_initial"][i])
        if cfg["states"] == 21:
            P[GYRO_SCALE + i, GYRO_SCALE + i] = _square(cfg["gyro_scale_sigma"][i])
            P[ACCEL_SCALE + i, ACCEL_SCALE + i] = _square(cfg["accel_scale_sigma"][i])
        s["point"][i] = cfg["nhc_lever"][i]
    k = cfg["states"]
    if cfg["mounting"] == 1:
        P[k, k] = _square(cfg["mounting_sigma"])
        P[k + 1, k + 1] = P[k, k]
        k += 2
    if cfg["lever"] == 1:
        P[k, k] = _square(cfg["lever_sigma"][0])
        P[k + 1, k + 1] = _square(cfg["lever_sigma"][1])
    if cfg["squat"] == 1:
        P[n - 1, n - 1] = _square(cfg["squat_sigma"])


@njit(cache=True)
def _tie_tilt_to_bias(s: Record, cfg: Record, work: Record) -> None:
    """What levelling at rest leaves: tilt and accelerometer bias are wrong together.

    The specific force of then, turned with the attitude of then, stands against
    gravity: its horizontal part is nought. The heading found since turns both alike.
    """
    C, u, f = work["M"], work["axes"], s["rest_f"]
    H, index, z = work["H"], work["index"], work["z"]
    f0, f1, f2 = rotate3(C, f[0], f[1], f[2])
    variance = _square(cfg["rest_sigma"])
    diagonal(work["R"], variance, variance, 1.0)
    for i in range(3):
        index[i] = ATTITUDE + i
        index[3 + i] = ACCEL_BIAS + i
    for i in range(2):
        z[i] = 0.0
        H[i, 0], H[i, 1], H[i, 2] = cross3(f0, f1, f2, u[i, 0], u[i, 1], u[i, 2])
        b0, b1, b2 = rotate3_back(C, u[i, 0], u[i, 1], u[i, 2])
        H[i, 3] = -b0
        H[i, 4] = -b1
        H[i, 5] = -b2
    n = state_count(cfg)
    dx = work["dx"]
    for i in range(n):
        dx[i] = 0.0
    whitened_update(
        s["P"], n, H, index, 6, z, work["R"], 2, dx, work["L"], work["h"], work["b"], work["gain"]
    )


@njit(cache=True)
def _rotate_block(P: Array, offset: int, u: Array, R: Array) -> None:
    """Put u' R u (3, 3) on the diagonal of P at `offset`."""
    for i in range(3):
        for j in range(i, 3):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    total += u[a, i] * R[a, b] * u[b, j]
            P[offset + i, offset + j] = total
            P[offset + j, offset + i] = total
