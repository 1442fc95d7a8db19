"""What a vehicle does not do: move when it stands, slip sideways when it drives.

The stop detector looks at a window of inertial samples alone and asks for the
filter's consent only to rule out a smooth constant speed.
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
from replay.kernels.update import diagonal, update


@njit(cache=True)
def push_sample(s, w, f):
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
def window_statistics(s, length):
    """Mean (6) and spread of the last `length` samples.

    Returns
    -------
    tuple
        Six means (rad/s, m/s^2), root sum square of the three gyro deviations
        (rad/s) and standard deviation of the length of the specific force (m/s^2).
    """
    window = s["window"]
    m0 = m1 = m2 = m3 = m4 = m5 = mf = 0.0
    start = s["window_head"] - length + WINDOW
    for k in range(length):
        row = window[(start + k) % WINDOW]
        m0 += row[0]
        m1 += row[1]
        m2 += row[2]
        m3 += row[3]
        m4 += row[4]
        m5 += row[5]
        mf += sqrt(row[3] * row[3] + row[4] * row[4] + row[5] * row[5])
    m0 /= length
    m1 /= length
    m2 /= length
    m3 /= length
    m4 /= length
    m5 /= length
    mf /= length
    vg = vf = 0.0
    for k in range(length):
        row = window[(start + k) % WINDOW]
        a = row[0] - m0
        b = row[1] - m1
        c = row[2] - m2
        vg += a * a + b * b + c * c
        d = sqrt(row[3] * row[3] + row[4] * row[4] + row[5] * row[5]) - mf
        vf += d * d
    return m0, m1, m2, m3, m4, m5, sqrt(vg / length), sqrt(vf / length)


@njit(cache=True)
def is_still(s, cfg, bias_known):
    """Whether the window of the stop detector shows rest."""
    length = min(WINDOW, max(2, int(cfg["stop_window"] / cfg["imu_interval"] + 0.5)))
    if s["window_count"] < length:
        return False
    m0, m1, m2, _, _, _, gyro, accel = window_statistics(s, length)
    if gyro > cfg["stop_gyro"] or accel > cfg["stop_accel"]:
        return False
    if bias_known:
        bg = s["bg"]
        m0 -= bg[0]
        m1 -= bg[1]
        m2 -= bg[2]
        return sqrt(m0 * m0 + m1 * m1 + m2 * m2) <= cfg["stop_rate"]
    return True


@njit(cache=True)
def zero_velocity_update(s, cfg, work, t, log_t, innovations, counts):
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
def zero_rate_update(s, cfg, work, t, log_t, innovations, counts):
    """The vehicle stands: the gyros sense the Earth's rate and their bias alone."""
    nav = s["nav"]
    C, bg = nav["C"], s["bg"]
    H, index, z = work["H"], work["index"], work["z"]
    length = min(WINDOW, max(2, int(cfg["stop_interval"] / cfg["imu_interval"] + 0.5)))
    if s["window_count"] < length:
        return False
    m0, m1, m2, _, _, _, _, _ = window_statistics(s, length)
    variance = cfg["zero_rate_sigma"] * cfg["zero_rate_sigma"]
    diagonal(work["R"], variance, variance, variance)
    e0, e1, e2 = rotate3_back(C, 0.0, 0.0, EARTH_RATE_RAD_S)
    for i in range(3):
        index[i] = GYRO_BIAS + i
        for j in range(3):
            H[i, j] = 1.0 if i == j else 0.0
    z[0] = m0 - bg[0] - e0
    z[1] = m1 - bg[1] - e1
    z[2] = m2 - bg[2] - e2
    return update(
        s, cfg, work, 3, 3, 0.0, True, KIND_ZERO_RATE, AXIS_FORWARD, t, log_t, innovations, counts
    )


@njit(cache=True)
def non_holonomic_update(s, cfg, work, t, log_t, innovations, counts):
    """Wheels roll forward: no velocity to the right or down at a point of the vehicle.

    With mounting pitch p and yaw y, small angles from vehicle to body axes, the
    vehicle's velocity at the point is v_right = v_y - y v_x and v_down = v_z + p v_x,
    where v_b = C' v + (w_ib - w_ie) x l.
    """
    nav = s["nav"]
    v, C = nav["v"], nav["C"]
    lever = cfg["nhc_lever"]
    mount = s["mount"]
    w = work["w"]
    H, index, z, u = work["H"], work["index"], work["z"], work["axes"]
    e0, e1, e2 = rotate3_back(C, 0.0, 0.0, EARTH_RATE_RAD_S)
    w0, w1, w2 = w[0] - e0, w[1] - e1, w[2] - e2
    b0, b1, b2 = rotate3_back(C, v[0], v[1], v[2])
    c0, c1, c2 = cross3(w0, w1, w2, lever[0], lever[1], lever[2])
    b0 += c0
    b1 += c1
    b2 += c2
    if b0 < cfg["nhc_speed"]:
        return False
    turning = cfg["nhc_rate_sigma"] * sqrt(w0 * w0 + w1 * w1 + w2 * w2)
    right = cfg["nhc_right_sigma"]
    down = cfg["nhc_down_sigma"]
    diagonal(work["R"], right * right + turning * turning, down * down + turning * turning, 1.0)
    pitch, yaw = mount[0], mount[1]
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
    if cfg["mounting"] == 1:
        index[count] = cfg["states"]
        index[count + 1] = cfg["states"] + 1
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
        if cfg["mounting"] == 1:
            H[i, count] = b0 if i == 1 else 0.0
            H[i, count + 1] = -b0 if i == 0 else 0.0
    if cfg["mounting"] == 1:
        count += 2
    return update(
        s, cfg, work, 2, count, cfg["nhc_gate"], False, KIND_NON_HOLONOMIC, AXIS_RIGHT, t, log_t,
        innovations, counts,
    )  # fmt: skip
