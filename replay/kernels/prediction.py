"""Carrying the filter's state and covariance over a stretch of time."""

from numba import njit

from replay.kernels.covariance import ATTITUDE, POSITION, VELOCITY, propagate
from replay.kernels.elementary import exp
from replay.kernels.strapdown import mechanize
from replay.kernels.transition import carry_inertial
from replay.kernels.types import Array, Record
from replay.kernels.update import total_count


@njit(cache=True)
def _decay_and_noise(cfg: Record, work: Record, dt: float) -> None:
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
    for i in range(cfg["states"] + 2 * cfg["mounting"], decay.shape[0]):
        decay[i] = 1.0
        noise[i] = 0.0
    work["busy"] = cfg["states"]
    if cfg["mounting"] == 1 and cfg["mounting_noise"] != 0.0:
        work["busy"] += 2


@njit(cache=True)
def _gauss_markov(
    decay: Array, noise: Array, first: int, sigma: Array, tau: float, dt: float
) -> None:
    """First-order Gauss-Markov process in three states; tau of nought or less is a constant."""
    d = 1.0
    if tau > 0.0:
        d = exp(-dt / tau)
    for i in range(3):
        decay[first + i] = d
        noise[first + i] = sigma[i] * sigma[i] * (1.0 - d * d)


@njit(cache=True)
def remove_sensor_errors(s: Record, work: Record) -> None:
    """Rate and specific force of the sample at hand into the scratch."""
    w, f = work["w"], work["f"]
    w_raw, f_raw, bg, ba, sg, sa = s["w_raw"], s["f_raw"], s["bg"], s["ba"], s["sg"], s["sa"]
    for i in range(3):
        w[i] = (w_raw[i] - bg[i]) / (1.0 + sg[i])
        f[i] = (f_raw[i] - ba[i]) / (1.0 + sa[i])


@njit(cache=True)
def advance(s: Record, cfg: Record, work: Record, t: int) -> None:
    """Carry state and covariance to `t` (ns) with the sample at hand."""
    dt = (t - s["t"]) * 1e-9
    if dt <= 0.0:
        return
    nav = s["nav"]
    w, f = work["w"], work["f"]
    remove_sensor_errors(s, work)
    r, moved = nav["r"], s["moved"]
    for i in range(3):
        moved[i] -= r[i]
    mechanize(nav, w[0] * dt, w[1] * dt, w[2] * dt, f[0] * dt, f[1] * dt, f[2] * dt, dt, work["q"])
    _decay_and_noise(cfg, work, dt)
    propagate(
        s["P"], total_count(s, cfg), cfg["states"] == 21, nav["r"], nav["C"], nav["f_e"], f, w, dt,
        work["decay"], work["noise"], work["busy"], work["T"],
    )  # fmt: skip
    trail = work["trail"]
    if trail["on"] == 1:
        trail["open"] = 0
        carry_inertial(trail, cfg["states"], cfg["states"] == 21, work["decay"], work["T"])
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
