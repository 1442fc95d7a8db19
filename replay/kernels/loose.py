"""The loosely coupled GNSS/INS filter over a block of rows.

One call takes the inertial samples and fixes of a block and carries the state
record on; cutting the rows into other blocks changes no bit. An inertial interval
in which a fix lies is split at the fix's own time.
"""

from numba import njit

from replay.kernels.alignment import align_fix, align_sample
from replay.kernels.constraints import (
    is_still,
    non_holonomic_update,
    push_sample,
    zero_rate_update,
    zero_velocity_update,
)
from replay.kernels.covariance import ATTITUDE, POSITION, VELOCITY, propagate
from replay.kernels.earth import EARTH_RATE_RAD_S, enu_axes
from replay.kernels.elementary import exp, sqrt
from replay.kernels.gnss_update import mark_epoch, position_update, velocity_update
from replay.kernels.records import (
    EVENT_IMU_GAP,
    EVENT_NOT_FINITE,
    EVENT_OUTAGE_BEGIN,
    EVENT_OUTAGE_END,
    EVENT_REJECTED,
    EVENT_RESET,
    EVENT_STOP_BEGIN,
    EVENT_STOP_END,
    EVENT_TIME_BACKWARD,
    RUNNING,
    STATUS_OUTAGE,
    STATUS_PREDICTED,
    STATUS_UPDATED,
)
from replay.kernels.rotation import euler_from_matrix, rotate3, rotate3_back
from replay.kernels.strapdown import mechanize
from replay.kernels.update import record_event, state_count

NOTE_IMU = 0
NOTE_FIX = 1


@njit(cache=True)
def _decay_and_noise(cfg, work, dt):
    """Fill the transition's diagonal and the noise of an interval; they repeat, so keep them."""
    if work["decay_dt"] == dt:
        return
    work["decay_dt"] = dt
    decay, noise = work["decay"], work["noise"]
    for i in range(3):
        noise[POSITION + i] = 0.0
        noise[VELOCITY + i] = cfg["accel_noise"][i] * cfg["accel_noise"][i] * dt
        noise[ATTITUDE + i] = cfg["gyro_noise"][i] * cfg["gyro_noise"][i] * dt
    _gauss_markov(decay, noise, 9, cfg["gyro_bias_sigma"], cfg["gyro_bias_tau"], dt)
    _gauss_markov(decay, noise, 12, cfg["accel_bias_sigma"], cfg["accel_bias_tau"], dt)
    if cfg["states"] == 21:
        _gauss_markov(decay, noise, 15, cfg["gyro_scale_sigma"], cfg["gyro_scale_tau"], dt)
        _gauss_markov(decay, noise, 18, cfg["accel_scale_sigma"], cfg["accel_scale_tau"], dt)
    if cfg["mounting"] == 1:
        for i in range(cfg["states"], cfg["states"] + 2):
            decay[i] = 1.0
            noise[i] = cfg["mounting_noise"] * cfg["mounting_noise"] * dt
    for i in range(cfg["states"] + 2 * cfg["mounting"], state_count(cfg)):
        decay[i] = 1.0
        noise[i] = 0.0


@njit(cache=True)
def _gauss_markov(decay, noise, first, sigma, tau, dt):
    """First-order Gauss-Markov process in three states; tau of nought or less is a constant."""
    d = 1.0
    if tau > 0.0:
        d = exp(-dt / tau)
    for i in range(3):
        decay[first + i] = d
        noise[first + i] = sigma[i] * sigma[i] * (1.0 - d * d)


@njit(cache=True)
def _remove_sensor_errors(s, work):
    """Rate and specific force of the sample at hand into the scratch."""
    w, f = work["w"], work["f"]
    w_raw, f_raw, bg, ba, sg, sa = s["w_raw"], s["f_raw"], s["bg"], s["ba"], s["sg"], s["sa"]
    for i in range(3):
        w[i] = (w_raw[i] - bg[i]) / (1.0 + sg[i])
        f[i] = (f_raw[i] - ba[i]) / (1.0 + sa[i])


@njit(cache=True)
def _advance(s, cfg, work, t):
    """Carry state and covariance to `t` (ns) with the sample at hand."""
    dt = (t - s["t"]) * 1e-9
    if dt <= 0.0:
        return
    nav = s["nav"]
    w, f = work["w"], work["f"]
    _remove_sensor_errors(s, work)
    r, moved = nav["r"], s["moved"]
    for i in range(3):
        moved[i] -= r[i]
    mechanize(nav, w[0] * dt, w[1] * dt, w[2] * dt, f[0] * dt, f[1] * dt, f[2] * dt, dt, work["q"])
    _decay_and_noise(cfg, work, dt)
    propagate(
        s["P"], state_count(cfg), cfg["states"] == 21, nav["r"], nav["C"], nav["f_e"], f, w, dt,
        work["decay"], work["noise"], work["T"],
    )  # fmt: skip
    smooth = 1.0
    if cfg["nhc_smoothing"] > 0.0:
        smooth = 1.0 - exp(-dt / cfg["nhc_smoothing"])
    w_smooth, f_smooth = s["w_smooth"], s["f_smooth"]
    for i in range(3):
        moved[i] += r[i]
        w_smooth[i] += smooth * (w[i] - w_smooth[i])
        f_smooth[i] += smooth * (f[i] - f_smooth[i])
    decay = work["decay"]
    bg, ba, sg, sa = s["bg"], s["ba"], s["sg"], s["sa"]
    for i in range(3):
        bg[i] *= decay[9 + i]
        ba[i] *= decay[12 + i]
        if cfg["states"] == 21:
            sg[i] *= decay[15 + i]
            sa[i] *= decay[18 + i]
    s["t"] = t


@njit(cache=True)
def _emit_solution(s, work, status, log_t, rows, counts):
    """Append the solution at the filter's time, in local axes."""
    nav = s["nav"]
    r, v, C, P = nav["r"], nav["v"], nav["C"], s["P"]
    u, M, N = work["axes"], work["M"], work["N"]
    row = rows[counts[0]]
    counts[0] += 1
    row["t"] = s["t"]
    row["log_t"] = log_t
    row["status"] = status
    enu_axes(r[0], r[1], r[2], u)
    e, nn, up = rotate3(u, v[0], v[1], v[2])
    row["v_enu"][0] = e
    row["v_enu"][1] = nn
    row["v_enu"][2] = up
    # C_b_n: rows north, east, down.
    for j in range(3):
        M[0, j] = u[1, 0] * C[0, j] + u[1, 1] * C[1, j] + u[1, 2] * C[2, j]
        M[1, j] = u[0, 0] * C[0, j] + u[0, 1] * C[1, j] + u[0, 2] * C[2, j]
        M[2, j] = -(u[2, 0] * C[0, j] + u[2, 1] * C[1, j] + u[2, 2] * C[2, j])
    roll, pitch, heading = euler_from_matrix(M)
    row["attitude"][0] = roll
    row["attitude"][1] = pitch
    row["attitude"][2] = heading
    e0, e1, e2 = rotate3_back(C, 0.0, 0.0, EARTH_RATE_RAD_S)
    w_raw, bg, sg = s["w_raw"], s["bg"], s["sg"]
    row["w_eb"][0] = (w_raw[0] - bg[0]) / (1.0 + sg[0]) - e0
    row["w_eb"][1] = (w_raw[1] - bg[1]) / (1.0 + sg[1]) - e1
    row["w_eb"][2] = (w_raw[2] - bg[2]) / (1.0 + sg[2]) - e2
    for i in range(3):
        row["r"][i] = r[i]
    _local_block(P, POSITION, u, N)
    row["cov"][0] = N[0, 0]
    row["cov"][1] = N[0, 1]
    row["cov"][2] = N[0, 2]
    row["cov"][3] = N[1, 1]
    row["cov"][4] = N[1, 2]
    row["cov"][5] = N[2, 2]
    _local_block(P, VELOCITY, u, N)
    for i in range(3):
        row["v_std"][i] = sqrt(max(0.0, N[i, i]))
    _local_block(P, ATTITUDE, u, N)
    for i in range(3):
        row["a_std"][i] = sqrt(max(0.0, N[i, i]))
    s["emitted_t"] = s["t"]


@njit(cache=True)
def _local_block(P, offset, u, out):
    """U P u' of the (3, 3) block at `offset` into `out`."""
    for i in range(3):
        for j in range(i, 3):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    total += u[i, a] * P[offset + a, offset + b] * u[j, b]
            out[i, j] = total
            out[j, i] = total


@njit(cache=True)
def _emit_epoch(s, cfg, log_t, rows, covariances, counts):
    """Append the whole state and the upper triangle of its covariance."""
    nav = s["nav"]
    row = rows[counts[1]]
    triangle = covariances[counts[1]]
    counts[1] += 1
    row["t"] = s["t"]
    row["log_t"] = log_t
    for i in range(3):
        row["r"][i] = nav["r"][i]
        row["v"][i] = nav["v"][i]
        row["bg"][i] = s["bg"][i]
        row["ba"][i] = s["ba"][i]
        row["sg"][i] = s["sg"][i]
        row["sa"][i] = s["sa"][i]
    for i in range(4):
        row["q"][i] = nav["q"][i]
    row["mount"][0] = 0.0
    row["mount"][1] = s["mount"][0]
    row["mount"][2] = s["mount"][1]
    for i in range(3):
        row["point"][i] = s["point"][i]
    row["squat"] = s["squat"]
    n = state_count(cfg)
    k = 0
    P = s["P"]
    for i in range(n):
        for j in range(i, n):
            triangle[k] = P[i, j]
            k += 1


@njit(cache=True)
def _use_fix(s, cfg, work, fix, log_t, out):
    """Update with one fix at the filter's own time."""
    solutions, epochs, covariances, innovations, events, counts = out
    t = fix["t"]
    _remove_sensor_errors(s, work)
    force = cfg["rejections"] > 0 and s["rejected"] >= cfg["rejections"]
    used = position_update(s, cfg, work, fix, force, t, log_t, innovations, counts)
    if used:
        if force:
            record_event(events, counts, t, log_t, EVENT_RESET, float(s["rejected"]), NOTE_FIX)
        s["rejected"] = 0
        if s["in_outage"] == 1:
            record_event(
                events, counts, t, log_t, EVENT_OUTAGE_END, (t - s["fix_t"]) * 1e-9, NOTE_FIX
            )
            s["in_outage"] = 0
        s["fix_t"] = t
    else:
        s["rejected"] += 1
        record_event(events, counts, t, log_t, EVENT_REJECTED, float(s["rejected"]), NOTE_FIX)
    if fix["has_v"] == 1 and cfg["use_velocity"] == 1:
        velocity_update(s, cfg, work, fix, force, t, log_t, innovations, counts)
    mark_epoch(s, fix)
    _emit_solution(s, work, STATUS_UPDATED, log_t, solutions, counts)
    _emit_epoch(s, cfg, log_t, epochs, covariances, counts)


@njit(cache=True)
def _constrain(s, cfg, work, t, log_t, out):
    """Stops and non-holonomic updates at an inertial sample."""
    _, _, _, innovations, events, counts = out
    interval = cfg["stop_interval"]
    if (cfg["zero_velocity"] == 1 or cfg["zero_rate"] == 1) and (
        t - s["stop_last"]
    ) * 1e-9 >= interval - 1e-6:
        s["stop_last"] = t
        v = s["nav"]["v"]
        speed = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        still = speed <= cfg["stop_speed"] and is_still(s, cfg, work, True)
        if still != (s["stopped"] == 1):
            kind = EVENT_STOP_BEGIN if still else EVENT_STOP_END
            record_event(events, counts, t, log_t, kind, speed, NOTE_IMU)
            s["stopped"] = 1 if still else 0
        if still:
            if cfg["zero_velocity"] == 1:
                zero_velocity_update(s, cfg, work, t, log_t, innovations, counts)
            if cfg["zero_rate"] == 1:
                zero_rate_update(s, cfg, work, t, log_t, innovations, counts)
    if (
        cfg["non_holonomic"] == 1
        and s["stopped"] == 0
        and (t - s["nhc_last"]) * 1e-9 >= cfg["nhc_interval"] - 1e-6
    ):
        s["nhc_last"] = t
        non_holonomic_update(s, cfg, work, t, log_t, innovations, counts)


@njit(cache=True)
def _finite(a):
    total = a[0] + a[1] + a[2]
    return total - total == 0.0


@njit(cache=True)
def _take_fixes(s, cfg, work, fixes, first, t, log_t, out):
    """Use every fix that is known by now and valid up to `t`; the number of the next one."""
    solutions, _, _, _, events, counts = out
    k = first
    while k < fixes.shape[0] and fixes[k]["t"] <= t and fixes[k]["log_t"] <= log_t:
        fix = fixes[k]
        k += 1
        if not (_finite(fix["r"]) and _finite(fix["R"]) and _finite(fix["R"][3:])):
            record_event(events, counts, fix["t"], log_t, EVENT_NOT_FINITE, 0.0, NOTE_FIX)
            continue
        if s["mode"] != RUNNING:
            if fix["t"] < s["imu_t"]:
                record_event(
                    events, counts, fix["t"], log_t, EVENT_TIME_BACKWARD,
                    (s["imu_t"] - fix["t"]) * 1e-9, NOTE_FIX,
                )  # fmt: skip
            elif align_fix(s, cfg, work, fix, log_t, events, counts):
                s["fix_t"] = fix["t"]
                mark_epoch(s, fix)
                s["stop_last"] = fix["t"]
                s["nhc_last"] = fix["t"]
                _emit_solution(s, work, STATUS_UPDATED, log_t, solutions, counts)
                _emit_epoch(s, cfg, log_t, out[1], out[2], counts)
            continue
        if fix["t"] < s["t"]:
            late = (s["t"] - fix["t"]) * 1e-9
            record_event(events, counts, fix["t"], log_t, EVENT_TIME_BACKWARD, late, NOTE_FIX)
            continue
        if s["in_outage"] == 1 and s["emitted_t"] < s["t"]:
            # The last word before help arrives: this is where drift is read off.
            _emit_solution(s, work, STATUS_OUTAGE, log_t, solutions, counts)
        _advance(s, cfg, work, fix["t"])
        _use_fix(s, cfg, work, fix, log_t, out)
    return k


@njit(cache=True)
def run_block(
    state, config, scratch, imu_t, imu_log_t, imu_w, imu_f, fixes,
    solutions, epochs, covariances, innovations, events, counts,
):  # fmt: skip
    """Carry the filter over a block.

    Parameters
    ----------
    state : array of one STATE_DTYPE
        Changed in place.
    config : array of one CONFIG_DTYPE
    scratch : array of one WORK_DTYPE
    imu_t, imu_log_t : int64 arrays (n,), ns
        Valid times and times of availability.
    imu_w : float64 array (n, 3), rad/s
    imu_f : float64 array (n, 3), m/s^2
    fixes : array (m,) of FIX_DTYPE
        In the order of their availability.
    solutions, epochs, innovations, events : arrays of their records
        With room for everything that the block can give.
    covariances : float64 array (as epochs, states (states + 1) / 2)
    counts : int64 array (5,)
        Rows written of solutions, epochs, innovations, events; events for which
        there was no room.

    Returns
    -------
    int
        How many of the fixes were taken; the others wait for later samples.
    """
    s = state[0]
    cfg = config[0]
    work = scratch[0]
    # What a step leaves in the scratch must not depend on where the block was cut.
    work["decay_dt"] = -1.0
    out = (solutions, epochs, covariances, innovations, events, counts)
    taken = 0
    for k in range(imu_t.shape[0]):
        t = imu_t[k]
        log_t = imu_log_t[k]
        if not (_finite(imu_w[k]) and _finite(imu_f[k])):
            record_event(events, counts, t, log_t, EVENT_NOT_FINITE, 0.0, NOTE_IMU)
            continue
        if s["imu_t"] < 0:
            s["imu_t"] = t
            s["t"] = t
            continue
        if t <= s["imu_t"]:
            late = (s["imu_t"] - t) * 1e-9
            record_event(events, counts, t, log_t, EVENT_TIME_BACKWARD, late, NOTE_IMU)
            continue
        dt = (t - s["imu_t"]) * 1e-9
        if dt > cfg["imu_gap"]:
            record_event(events, counts, t, log_t, EVENT_IMU_GAP, dt, NOTE_IMU)
        w_raw, f_raw = s["w_raw"], s["f_raw"]
        for i in range(3):
            w_raw[i] = imu_w[k, i]
            f_raw[i] = imu_f[k, i]
        aligning = s["mode"] != RUNNING
        if aligning:
            align_sample(s, cfg, work, dt, t, log_t, events, counts)
        taken = _take_fixes(s, cfg, work, fixes, taken, t, log_t, out)
        s["imu_t"] = t
        if s["mode"] != RUNNING:
            s["t"] = t
            continue
        since = (t - s["fix_t"]) * 1e-9
        if s["in_outage"] == 0 and since > cfg["outage_limit"]:
            s["in_outage"] = 1
            record_event(events, counts, t, log_t, EVENT_OUTAGE_BEGIN, since, NOTE_FIX)
        _advance(s, cfg, work, t)
        if not aligning:
            push_sample(s, w_raw, f_raw)
        _constrain(s, cfg, work, t, log_t, out)
        slot = t // cfg["solution_interval"]
        if slot > s["emitted_slot"]:
            s["emitted_slot"] = slot
            status = STATUS_OUTAGE if s["in_outage"] == 1 else STATUS_PREDICTED
            _emit_solution(s, work, status, log_t, solutions, counts)
    return taken
