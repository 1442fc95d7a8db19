"""What an antenna on an inertial system measures: its place and velocity, one number at a time.

All innovations of a kind are formed with the same state and used one after another;
the correction is fed back once (Groves 2e, 14.3.2). The antenna stands at r + C l and
moves with v + C (w_ib x l) - w_ie x (C l).
"""

from numba import njit

from replay.kernels.covariance import ATTITUDE, GYRO_BIAS, GYRO_SCALE, POSITION, VELOCITY
from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.elementary import sqrt
from replay.kernels.kalman import scalar_update
from replay.kernels.rotation import cross3, rotate3, rotate3_back
from replay.kernels.transition import add_correction, forget, open_node
from replay.kernels.types import Array, Record
from replay.kernels.update import feed_back, state_count, total_count


@njit(cache=True)
def antenna(s: Record, work: Record, lever: Array, x: Array, v: Array) -> None:
    """Position (m) and velocity (m/s) of the antenna, ECEF, into `x` and `v` (3,)."""
    nav, w = s["nav"], work["w"]
    r, u, C = nav["r"], nav["v"], nav["C"]
    a0, a1, a2 = rotate3(C, lever[0], lever[1], lever[2])
    c0, c1, c2 = cross3(w[0], w[1], w[2], lever[0], lever[1], lever[2])
    b0, b1, b2 = rotate3(C, c0, c1, c2)
    x[0] = r[0] + a0
    x[1] = r[1] + a1
    x[2] = r[2] + a2
    v[0] = u[0] + b0 + EARTH_RATE_RAD_S * a1
    v[1] = u[1] + b1 - EARTH_RATE_RAD_S * a0
    v[2] = u[2] + b2


@njit(cache=True)
def position_row(s: Record, lever: Array, e: Array, h: Array, index: Array) -> int:
    """Sensitivity of the antenna's position along `e` (3,); how many states it names."""
    C = s["nav"]["C"]
    a0, a1, a2 = rotate3(C, lever[0], lever[1], lever[2])
    for i in range(3):
        h[i] = e[i]
        index[i] = POSITION + i
        index[3 + i] = ATTITUDE + i
    h[3], h[4], h[5] = cross3(a0, a1, a2, e[0], e[1], e[2])
    return 6


@njit(cache=True)
def velocity_row(
    s: Record, cfg: Record, work: Record, lever: Array, e: Array, h: Array, index: Array
) -> int:
    """Sensitivity of the antenna's velocity along `e` (3,); how many states it names."""
    C, w = s["nav"]["C"], work["w"]
    c0, c1, c2 = cross3(w[0], w[1], w[2], lever[0], lever[1], lever[2])
    b0, b1, b2 = rotate3(C, c0, c1, c2)
    e0, e1, e2 = rotate3_back(C, e[0], e[1], e[2])
    g0, g1, g2 = cross3(e0, e1, e2, lever[0], lever[1], lever[2])
    for i in range(3):
        h[i] = e[i]
        index[i] = VELOCITY + i
        index[3 + i] = ATTITUDE + i
        index[6 + i] = GYRO_BIAS + i
        index[9 + i] = GYRO_SCALE + i
    h[3], h[4], h[5] = cross3(b0, b1, b2, e[0], e[1], e[2])
    h[6] = g0
    h[7] = g1
    h[8] = g2
    if cfg["states"] != 21:
        return 9
    h[9] = g0 * w[0]
    h[10] = g1 * w[1]
    h[11] = g2 * w[2]
    return 12


@njit(cache=True)
def use_scalar(
    s: Record,
    cfg: Record,
    work: Record,
    count: int,
    z: float,
    variance: float,
    gate: float,
    h: Array,
    index: Array,
    out: Record,
) -> bool:
    """Gate one measurement and use it; `work["dx"]` gathers the correction.

    `out` (a record of RESIDUAL_DTYPE) gets the innovation as it stands after the
    measurements before it.
    """
    P, dx = s["P"], work["dx"]
    now = z
    total = variance
    for a in range(count):
        now -= h[a] * dx[index[a]]
        for b in range(count):
            total += h[a] * P[index[a], index[b]] * h[b]
    deviation = sqrt(total)
    out["z"] = now
    out["s"] = deviation
    out["r"] = sqrt(variance)
    good = gate <= 0.0 or abs(now) <= gate * deviation
    out["accepted"] = 1 if good else 0
    if not good:
        return False
    inverse = 1.0 / sqrt(variance)
    for a in range(count):
        h[a] *= inverse
    scalar_update(P, total_count(s, cfg), h, index, count, z * inverse, dx, work["b"], work["gain"])
    return True


@njit(cache=True)
def begin_update(s: Record, cfg: Record, work: Record) -> None:
    """Nothing gathered yet."""
    dx, n, trail = work["dx"], total_count(s, cfg), work["trail"]
    for i in range(n):
        dx[i] = 0.0
    if trail["on"] == 1:
        open_node(trail, s["P"], n)


@njit(cache=True)
def end_update(s: Record, cfg: Record, work: Record) -> None:
    """Feed back what was gathered."""
    feed_back(s, cfg, work["dx"], work["q"])
    if work["trail"]["on"] == 1:
        add_correction(work["trail"], work["dx"], total_count(s, cfg))


@njit(cache=True)
def describe(out: Record, epoch: Record, row: Record, slot: int, kind: int) -> None:
    """Which measurement a record of RESIDUAL_DTYPE speaks of."""
    out["t"] = epoch["t"]
    out["log_t"] = epoch["log_t"]
    out["kind"] = kind
    out["satellite"] = row["satellite"]
    out["signal"] = row["signal"][slot]


@njit(cache=True)
def widen(s: Record, cfg: Record, k: int, variance: float, trail: Record) -> None:
    """Make extra state `k` independent of all others, with a variance."""
    P, n, place = s["P"], total_count(s, cfg), state_count(cfg) + k
    for i in range(n):
        P[place, i] = 0.0
        P[i, place] = 0.0
    P[place, place] = variance
    if trail["on"] == 1:
        forget(trail, place, variance)
