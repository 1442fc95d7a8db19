"""What a vehicle does not do: move when it stands, slip sideways when it drives.

The stop detector looks at a window of inertial samples; the filter's own speed is
asked only to rule out a smooth constant speed.
"""

from numba import njit

from replay.kernels.covariance import ATTITUDE, GYRO_BIAS, GYRO_SCALE, VELOCITY
from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.elementary import sqrt
from replay.kernels.records import (
    AXIS_FORWARD,
    AXIS_RIGHT,
    KIND_NON_HOLONOMIC,
    KIND_ZERO_RATE,
    KIND_ZERO_VELOCITY,
    WINDOW,
)
from replay.kernels.rotation import cross3, rotate3, rotate3_back
from replay.kernels.types import Array, Record
from replay.kernels.update import diagonal, update


@njit(cache=True)
def push_sample(s: Record, w: Array, f: Array) -> None:
    """Put one sample (rad/s, m/s^2; body) into the window."""
    head = s["window_head"]
    row = s["window"][head]
    for i in range(3):
        row[i] = w[i]
        row[3 + i] = f[i]
    s["window_head"] = (head + 1) % WINDOW
    if s["window_count"] < WINDOW:
        s["window_count"] += 1


@njit(cache=True)
def samples_in(seconds: float, cfg: Record) -> int:
    """Number of samples in a stretch of time, at least one and at most the window."""
    return min(WINDOW, max(1, int(seconds / cfg["imu_interval"] + 0.5)))


@njit(cache=True)
def window_mean(s: Record, skip: int, length: int, mean: Array) -> None:
    """Mean (6: rad/s, m/s^2) of `length` samples that end `skip` samples ago into `mean`."""
    window = s["window"]
    start = s["window_head"] - skip - length + 2 * WINDOW
    for i in range(6):
        mean[i] = 0.0
    for k in range(length):
        row = window[(start + k) % WINDOW]
        for i in range(6):
            mean[i] += row[i]
    for i in range(6):
        mean[i] /= length


@njit(cache=True)
def is_still(s: Record, cfg: Record, work: Record, bias_known: bool) -> bool:
    """Whether the window of the stop detector shows rest.

    Samples are averaged in short blocks first: an idling engine shakes a sensor by
    more than a slow start does, but not over a few of its turns.
    """
    block = cfg["stop_block"]
    blocks = samples_in(cfg["stop_window"], cfg) // block
    if blocks < 2 or s["window_count"] < blocks * block:
        return False
    mean, part = work["mean"], work["part"]
    window_mean(s, 0, blocks * block, mean)
    if bias_known and abs(mean[2] - s["bg"][2]) > cfg["stop_rate"]:
        return False
    for k in range(blocks):
        window_mean(s, k * block, block, part)
        if abs(part[2] - mean[2]) > cfg["stop_gyro"]:
            return False
        for i in range(3, 6):
            if abs(part[i] - mean[i]) > cfg["stop_accel"]:
                return False
    return True


@njit(cache=True)
def zero_velocity_update(
    s: Record, cfg: Record, work: Record, t: int, log_t: int, innovations: Array, counts: Array
) -> bool:
    """The vehicle stands: its velocity is nought, in body axes."""
    nav = s["nav"]
    v, C = nav["v"], nav["C"]
    H, index, z = work["H"], work["index"], work["z"]
    variance = cfg["zero_velocity_sigma"] * cfg["zero_velocity_sigma"]
    diagonal(work["R"], variance, variance, variance)
    for i in range(3):
        index[i] = VELOCITY + i
        z[i] = -(C[0, i] * v[0] + C[1, i] * v[1] + C[2, i] * v[2])
        for j in range(3):
            H[i, j] = C[j, i]
    return update(
        s,
        cfg,
        work,
        3,
        3,
        0.0,
        True,
        KIND_ZERO_VELOCITY,
        AXIS_FORWARD,
        t,
        log_t,
        innovations,
        counts,
    )


@njit(cache=True)
def zero_rate_update(
    s: Record, cfg: Record, work: Record, t: int, log_t: int, innovations: Array, counts: Array
) -> bool:
    """The vehicle stands: the gyros sense the Earth's rate and their bias alone."""
    nav = s["nav"]
    C, bg = nav["C"], s["bg"]
    H, index, z = work["H"], work["index"], work["z"]
    length = samples_in(cfg["stop_interval"], cfg)
    if s["window_count"] < length:
        return False
    mean = work["mean"]
    window_mean(s, 0, length, mean)
    sigma = cfg["zero_rate_sigma"]
    diagonal(work["R"], sigma[0] * sigma[0], sigma[1] * sigma[1], sigma[2] * sigma[2])
    e0, e1, e2 = rotate3_back(C, 0.0, 0.0, EARTH_RATE_RAD_S)
    for i in range(3):
        index[i] = GYRO_BIAS + i
        for j in range(3):
            H[i, j] = 1.0 if i == j else 0.0
    z[0] = mean[0] - bg[0] - e0
    z[1] = mean[1] - bg[1] - e1
    z[2] = mean[2] - bg[2] - e2
    return update(
        s, cfg, work, 3, 3, 0.0, True, KIND_ZERO_RATE, AXIS_FORWARD, t, log_t, innovations, counts
    )


@njit(cache=True)
def non_holonomic_update(
    s: Record, cfg: Record, work: Record, t: int, log_t: int, innovations: Array, counts: Array
) -> bool:
    """Wheels roll forward: no velocity to the right or down at a point of the vehicle.

    With mounting pitch p and yaw y, small angles of the vehicle relative to the body, the
    vehicle's velocity at the point is v_right = v_y - y v_x and v_down = v_z + p v_x,
    where v_b = C' v + (w_ib - w_ie) x l. Forward and down coordinates of the point can
    be states too; it need not be the rear axle (tyres slip, suspensions lean). On its
    springs a vehicle pitches with the forward specific force: the pitch p grows by
    squat times that force.
    """
    nav = s["nav"]
    v, C = nav["v"], nav["C"]
    lever = s["point"]
    mount = s["mount"]
    w = s["w_smooth"]
    H, index, z, u = work["H"], work["index"], work["z"], work["axes"]
    e0, e1, e2 = rotate3_back(C, 0.0, 0.0, EARTH_RATE_RAD_S)
    w0, w1, w2 = w[0] - e0, w[1] - e1, w[2] - e2
    b0, b1, b2 = rotate3_back(C, v[0], v[1], v[2])
    c0, c1, c2 = cross3(w0, w1, w2, lever[0], lever[1], lever[2])
    b0 += c0
    b1 += c1
    b2 += c2
    if abs(b0) < cfg["nhc_speed"]:
        return False
    turning = cfg["nhc_rate_sigma"] * sqrt(w0 * w0 + w1 * w1 + w2 * w2)
    right = cfg["nhc_right_sigma"]
    down = cfg["nhc_down_sigma"]
    diagonal(work["R"], right * right + turning * turning, down * down + turning * turning, 1.0)
    pitch, yaw = mount[0] + s["squat"] * s["f_smooth"][0], mount[1]
    z[0] = -(b1 - yaw * b0)
    z[1] = -(b2 + pitch * b0)
    for i in range(3):
        index[i] = VELOCITY + i
        index[3 + i] = ATTITUDE + i
        index[6 + i] = GYRO_BIAS + i
    count = 9
    if cfg["states"] == 21:
        for i in range(3):
            index[count + i] = GYRO_SCALE + i
        count += 3
    for i in range(2 * cfg["mounting"] + 2 * cfg["lever"] + cfg["squat"]):
        index[count + i] = cfg["states"] + i
    for i in range(2):
        x0 = -yaw if i == 0 else pitch
        x1 = 1.0 if i == 0 else 0.0
        x2 = 0.0 if i == 0 else 1.0
        u0, u1, u2 = rotate3(C, x0, x1, x2)
        u[i, 0] = u0
        u[i, 1] = u1
        u[i, 2] = u2
        H[i, 0] = u0
        H[i, 1] = u1
        H[i, 2] = u2
        H[i, 3], H[i, 4], H[i, 5] = cross3(u0, u1, u2, v[0], v[1], v[2])
        g0, g1, g2 = cross3(x0, x1, x2, lever[0], lever[1], lever[2])
        H[i, 6] = g0
        H[i, 7] = g1
        H[i, 8] = g2
        if cfg["states"] == 21:
            H[i, 9] = g0 * w[0]
            H[i, 10] = g1 * w[1]
            H[i, 11] = g2 * w[2]
        column = count
        if cfg["mounting"] == 1:
            H[i, column] = b0 if i == 1 else 0.0
            H[i, column + 1] = -b0 if i == 0 else 0.0
            column += 2
        if cfg["lever"] == 1:
            # Columns of [w x] that belong to the forward and the down coordinate.
            H[i, column] = x1 * w2 - x2 * w1
            H[i, column + 1] = x0 * w1 - x1 * w0
            column += 2
        if cfg["squat"] == 1:
            H[i, column] = b0 * s["f_smooth"][0] if i == 1 else 0.0
    if cfg["mounting"] == 1:
        count += 2
    if cfg["lever"] == 1:
        count += 2
    count += cfg["squat"]
    return update(
        s, cfg, work, 2, count, cfg["nhc_gate"], False, KIND_NON_HOLONOMIC, AXIS_RIGHT, t, log_t,
        innovations, counts,
    )  # fmt: skip
