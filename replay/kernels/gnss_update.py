"""Position and velocity of a GNSS antenna as measurements of an inertial system (Groves 2e, 14.3).

The antenna stands at a lever arm l from the IMU: r_a = r + C l and
v_a = v + C (w_ib x l) - w_ie x (C l).
"""

from numba import njit

from replay.kernels.covariance import (
    ACCEL_BIAS,
    ATTITUDE,
    GYRO_BIAS,
    GYRO_SCALE,
    POSITION,
    VELOCITY,
)
from replay.kernels.earth import EARTH_RATE_RAD_S, enu_axes
from replay.kernels.records import AXIS_EAST, KIND_POSITION, KIND_VELOCITY
from replay.kernels.rotation import cross3, rotate3, rotate3_back
from replay.kernels.types import Array, Record
from replay.kernels.update import fill_covariance, update

_WINDOW_SLACK = 0.1  # how far the last epoch may be off, as a part of the window


@njit(cache=True)
def position_update(
    s: Record,
    cfg: Record,
    work: Record,
    fix: Record,
    force: bool,
    t: int,
    log_t: int,
    innovations: Array,
    counts: Array,
) -> bool:
    """Use the position of a fix; whether it was used."""
    nav = s["nav"]
    r, C, lever = nav["r"], nav["C"], fix["lever"]
    H, index, z, u = work["H"], work["index"], work["z"], work["axes"]
    fill_covariance(work["R"], fix["R"], cfg["position_scale"], cfg["position_floor"])
    a0, a1, a2 = rotate3(C, lever[0], lever[1], lever[2])
    d0 = fix["r"][0] - r[0] - a0
    d1 = fix["r"][1] - r[1] - a1
    d2 = fix["r"][2] - r[2] - a2
    enu_axes(r[0], r[1], r[2], u)
    for i in range(3):
        index[i] = POSITION + i
        index[3 + i] = ATTITUDE + i
    for i in range(3):
        z[i] = u[i, 0] * d0 + u[i, 1] * d1 + u[i, 2] * d2
        H[i, 0] = u[i, 0]
        H[i, 1] = u[i, 1]
        H[i, 2] = u[i, 2]
        H[i, 3], H[i, 4], H[i, 5] = cross3(a0, a1, a2, u[i, 0], u[i, 1], u[i, 2])
    return update(
        s, cfg, work, 3, 6, cfg["position_gate"], force, KIND_POSITION, AXIS_EAST, t, log_t,
        innovations, counts,
    )  # fmt: skip


@njit(cache=True)
def mark_epoch(s: Record, fix: Record) -> None:
    """Begin to sum displacement at this fix, for the mean velocity at the next one."""
    nav = s["nav"]
    lever = fix["lever"]
    s["moved_t"] = s["t"]
    a0, a1, a2 = rotate3(nav["C"], lever[0], lever[1], lever[2])
    s["moved_lever"][0] = a0
    s["moved_lever"][1] = a1
    s["moved_lever"][2] = a2
    for i in range(3):
        s["moved"][i] = 0.0


@njit(cache=True)
def velocity_update(
    s: Record,
    cfg: Record,
    work: Record,
    fix: Record,
    force: bool,
    t: int,
    log_t: int,
    innovations: Array,
    counts: Array,
) -> bool:
    """Use the velocity of a fix; whether it was used.

    A receiver that averages velocity over a window before the epoch (from carrier
    differences, say) is compared with the mean velocity over that window. That needs
    the last epoch to lie a window ago; where it does not, the velocity is left out.
    """
    nav = s["nav"]
    r, v, C, lever = nav["r"], nav["v"], nav["C"], fix["lever"]
    w = work["w"]
    window = cfg["velocity_window"]
    if fix["window"] > 0.0:
        window = fix["window"]
    span = (t - s["moved_t"]) * 1e-9
    if window > 0.0 and (s["moved_t"] < 0 or abs(span - window) > _WINDOW_SLACK * window):
        return False
    H, index, z, u = work["H"], work["index"], work["z"], work["axes"]
    fill_covariance(work["R"], fix["V"], cfg["velocity_scale"], cfg["velocity_floor"])
    wl0, wl1, wl2 = cross3(w[0], w[1], w[2], lever[0], lever[1], lever[2])
    b0, b1, b2 = rotate3(C, wl0, wl1, wl2)
    a0, a1, a2 = rotate3(C, lever[0], lever[1], lever[2])
    if window > 0.0:
        moved, before = s["moved"], s["moved_lever"]
        d0 = fix["v"][0] - (moved[0] + a0 - before[0]) / span
        d1 = fix["v"][1] - (moved[1] + a1 - before[1]) / span
        d2 = fix["v"][2] - (moved[2] + a2 - before[2]) / span
    else:
        d0 = fix["v"][0] - v[0] - b0 - EARTH_RATE_RAD_S * a1
        d1 = fix["v"][1] - v[1] - b1 + EARTH_RATE_RAD_S * a0
        d2 = fix["v"][2] - v[2] - b2
    enu_axes(r[0], r[1], r[2], u)
    count = 15 if cfg["states"] == 21 else 12
    for i in range(3):
        index[i] = VELOCITY + i
        index[3 + i] = ATTITUDE + i
        index[6 + i] = GYRO_BIAS + i
        index[9 + i] = ACCEL_BIAS + i
        index[12 + i] = GYRO_SCALE + i
    # The mean over the window is the velocity of its middle: older than the state by half.
    half = 0.5 * window
    f = nav["f_e"]
    for i in range(3):
        z[i] = u[i, 0] * d0 + u[i, 1] * d1 + u[i, 2] * d2
        H[i, 0] = u[i, 0]
        H[i, 1] = u[i, 1]
        H[i, 2] = u[i, 2]
        H[i, 3], H[i, 4], H[i, 5] = cross3(
            b0 - half * f[0], b1 - half * f[1], b2 - half * f[2], u[i, 0], u[i, 1], u[i, 2]
        )
        ub0, ub1, ub2 = rotate3_back(C, u[i, 0], u[i, 1], u[i, 2])
        g0, g1, g2 = cross3(ub0, ub1, ub2, lever[0], lever[1], lever[2])
        H[i, 6] = g0
        H[i, 7] = g1
        H[i, 8] = g2
        H[i, 9] = half * ub0
        H[i, 10] = half * ub1
        H[i, 11] = half * ub2
        H[i, 12] = g0 * w[0]
        H[i, 13] = g1 * w[1]
        H[i, 14] = g2 * w[2]
    return update(
        s, cfg, work, 3, count, cfg["velocity_gate"], force, KIND_VELOCITY, AXIS_EAST, t, log_t,
        innovations, counts,
    )  # fmt: skip
