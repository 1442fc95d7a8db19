"""Measurements of single satellites on an inertial system: ranges, range rates, phase changes.

All innovations of a kind are formed with the same state and used one after another;
the correction is fed back once (Groves 2e, 14.3.2). The antenna stands at r + C l and
moves with v + C (w_ib x l) - w_ie x (C l).
"""

from numba import njit

from replay.kernels.covariance import ATTITUDE, GYRO_BIAS, GYRO_SCALE, POSITION, VELOCITY
from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SLOTS, SYSTEMS
from replay.kernels.kalman import scalar_update
from replay.kernels.least_squares import geometric_range, reduced_code
from replay.kernels.rotation import cross3, rotate3, rotate3_back
from replay.kernels.single_point import (
    KIND_DOPPLER,
    KIND_PSEUDORANGE,
    predicted_range_rate,
    usable,
)
from replay.kernels.tight_records import (
    CHANGE,
    CLOCK,
    CLONE,
    DRIFT,
    KIND_TIME_DIFFERENCE,
)
from replay.kernels.transition import add_correction, copy_antenna, forget, open_node
from replay.kernels.types import Array, Record
from replay.kernels.update import feed_back, state_count, total_count
from replay.kernels.weighting import code_variance, noise_factor


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
def median(values: Array, n: int) -> float:
    """Middle of the first `n` values, which are put in order."""
    for i in range(1, n):
        value = values[i]
        j = i - 1
        while j >= 0 and values[j] > value:
            values[j + 1] = values[j]
            j -= 1
        values[j + 1] = value
    if n % 2 == 1:
        return values[n // 2]
    return 0.5 * (values[n // 2 - 1] + values[n // 2])


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


@njit(cache=True)
def meet_clocks(
    s: Record, g: Record, cfg: Record, tcfg: Record, rows: Array, x: Array, u: Array,
    scratch: Array, trail: Record,
) -> float:  # fmt: skip
    """Begin the clocks of systems that are new; by how much the receiver set its clock (m), or 0.

    A clock has been set where the middle innovation is more than `jump` and than four
    deviations of the clock, and three quarters of the others are near it; reflected signals
    are late by different lengths.
    """
    aux, P, first = s["aux"], s["P"], state_count(cfg) + CLOCK
    shift, spread = 0.0, 0.0
    n = 0
    for k in range(rows.shape[0]):
        row = rows[k]
        system = row["system"]
        if usable(row, tcfg["single"]) and g["known"][system] == 1:
            z = reduced_code(row, 0)
            if z == z:
                scratch[n] = z - geometric_range(row, x, u) - aux[CLOCK + system]
                spread = max(spread, P[first + system, first + system])
                n += 1
    if n > 0:
        middle = median(scratch, n)
        near = 0
        for k in range(n):
            if abs(scratch[k] - middle) < 0.4 * abs(middle):
                near += 1
        surprising = abs(middle) > tcfg["jump"] and middle * middle > 16.0 * spread
        if surprising and 4 * near >= 3 * n:
            shift = middle
            for system in range(SYSTEMS):
                aux[CLOCK + system] += middle
                widen(s, cfg, CLOCK + system, 1e6, trail)
    for system in range(SYSTEMS):
        if g["known"][system] == 1:
            continue
        n = 0
        for k in range(rows.shape[0]):
            row = rows[k]
            if row["system"] == system and usable(row, tcfg["single"]):
                z = reduced_code(row, 0)
                if z == z:
                    scratch[n] = z - geometric_range(row, x, u)
                    n += 1
        if n > 0:
            aux[CLOCK + system] = median(scratch, n)
            widen(s, cfg, CLOCK + system, 1e6, trail)
            g["known"][system] = 1
    return shift


@njit(cache=True)
def use_codes(
    s: Record,
    g: Record,
    cfg: Record,
    tcfg: Record,
    work: Record,
    epoch: Record,
    rows: Array,
    weight: Array,
    x: Array,
    u: Array,
    innovations: Array,
    counts: Array,
) -> int:
    """Use the pseudoranges of an epoch; how many were offered.

    `weight` (n,) becomes 1 for a satellite whose range was used, else 0.
    """
    h, index, aux = work["h"][0], work["index"], s["aux"]
    single, lever = tcfg["single"], tcfg["lever"]
    first = state_count(cfg)
    offered = 0
    begin_update(s, cfg, work)
    for k in range(rows.shape[0]):
        row = rows[k]
        weight[k] = 0.0
        if not usable(row, single):
            continue
        z = reduced_code(row, 0)
        if z != z:
            continue
        system = row["system"]
        z -= geometric_range(row, x, u) + aux[CLOCK + system]
        for i in range(3):
            u[i] = -u[i]
        count = position_row(s, lever, u, h, index)
        h[count] = 1.0
        index[count] = first + CLOCK + system
        scale = single["system_scale"][system]
        variance = code_variance(row, 0, single["code_sigma"] * scale, single["weight"])
        out = innovations[counts[0]]
        counts[0] += 1
        offered += 1
        describe(out, epoch, row, 0, KIND_PSEUDORANGE)
        if use_scalar(s, cfg, work, count + 1, z, variance, tcfg["code_gate"], h, index, out):
            weight[k] = 1.0
    end_update(s, cfg, work)
    return offered


@njit(cache=True)
def use_dopplers(
    s: Record,
    g: Record,
    cfg: Record,
    tcfg: Record,
    work: Record,
    epoch: Record,
    rows: Array,
    x: Array,
    v: Array,
    u: Array,
    scratch: Array,
    innovations: Array,
    counts: Array,
) -> None:
    """Use the range rates of an epoch."""
    h, index, aux = work["h"][0], work["index"], s["aux"]
    single, lever = tcfg["single"], tcfg["lever"]
    first = state_count(cfg)
    if g["drift_known"] == 0:
        n = 0
        for k in range(rows.shape[0]):
            row = rows[k]
            rate = row["range_rate"][0]
            if usable(row, single) and rate == rate:
                scratch[n] = rate + row["drift"] - predicted_range_rate(row, x, v, u)
                n += 1
        if n == 0:
            return
        aux[DRIFT] = median(scratch, n)
        widen(s, cfg, DRIFT, 1e4, work["trail"])
        g["drift_known"] = 1
    begin_update(s, cfg, work)
    for k in range(rows.shape[0]):
        row = rows[k]
        rate = row["range_rate"][0]
        if not usable(row, single) or rate != rate:
            continue
        z = rate + row["drift"] - predicted_range_rate(row, x, v, u) - aux[DRIFT]
        for i in range(3):
            u[i] = -u[i]
        count = velocity_row(s, cfg, work, lever, u, h, index)
        h[count] = 1.0
        index[count] = first + DRIFT
        sigma = single["doppler_sigma"]
        model = single["weight"]["model"]
        variance = sigma * sigma * noise_factor(model, row["elevation"], row["cn0"][0])
        out = innovations[counts[0]]
        counts[0] += 1
        describe(out, epoch, row, 0, KIND_DOPPLER)
        use_scalar(s, cfg, work, count + 1, z, variance, tcfg["doppler_gate"], h, index, out)
    end_update(s, cfg, work)


@njit(cache=True)
def reduced_phase(row: Record, slot: int) -> float:
    """Carrier phase (m) with every modelled term but range, clock and ambiguity taken off."""
    return (
        row["phase"][slot]
        + row["clock"]
        + row["ionosphere"][slot]
        - row["hydrostatic"]
        - row["wet"]
        - row["shapiro"]
    )


@njit(cache=True)
def use_phase_changes(
    s: Record,
    g: Record,
    cfg: Record,
    tcfg: Record,
    work: Record,
    epoch: Record,
    rows: Array,
    x: Array,
    u: Array,
    scratch: Array,
    innovations: Array,
    counts: Array,
) -> int:
    """Use the changes of carrier phases since the epoch before; how many were used.

    A change measures the antenna's position now against the cloned one, whatever both
    are worth: that is what carries a drift-free displacement through a partial outage.
    """
    if g["clone_t"] < 0 or (s["t"] - g["clone_t"]) * 1e-9 > tcfg["phase_gap"]:
        return 0
    h, index, aux = work["h"][0], work["index"], s["aux"]
    single, lever = tcfg["single"], tcfg["lever"]
    first = state_count(cfg)
    clone = aux[CLONE : CLONE + 3]
    n = 0
    for turn in range(2):
        if turn == 1:
            if n == 0:
                return 0
            # The receiver's clock moved by what most phases say.
            aux[CHANGE] = median(scratch, n)
            widen(s, cfg, CHANGE, 1e2, work["trail"])
            begin_update(s, cfg, work)
            n = 0
        for k in range(rows.shape[0]):
            row = rows[k]
            earlier = g["earlier"][row["satellite"]]
            if row["seen"] == 0 or earlier["t"] != g["epoch_t"]:
                continue
            if single["excluded"][row["satellite"]] == 1 or row["elevation"] < single["mask"]:
                continue
            now = geometric_range(row, x, u)
            d0 = earlier["position"][0] - clone[0]
            d1 = earlier["position"][1] - clone[1]
            d2 = earlier["position"][2] - clone[2]
            then = sqrt(d0 * d0 + d1 * d1 + d2 * d2)
            for slot in range(SLOTS):
                same = row["signal"][slot] != 0 and row["signal"][slot] == earlier["signal"][slot]
                if not same or row["lock_lost"][slot] & 1 == 1:
                    continue
                z = reduced_phase(row, slot) - earlier["phase"][slot] - (now - then)
                if z != z:
                    continue
                if turn == 0:
                    scratch[n] = z
                    n += 1
                    continue
                for i in range(3):
                    u[i] = -u[i]
                count = position_row(s, lever, u, h, index)
                # The same line of sight for both ends: what its turning tells of the position
                # itself is less than what the errors of phases, which are not white, feign.
                for i in range(3):
                    u[i] = -u[i]
                    h[count + i] = u[i]
                    index[count + i] = first + CLONE + i
                h[count + 3] = 1.0
                index[count + 3] = first + CHANGE
                sigma = tcfg["phase_sigma"]
                model = single["weight"]["model"]
                variance = (
                    2.0 * sigma * sigma * noise_factor(model, row["elevation"], row["cn0"][slot])
                )
                out = innovations[counts[0]]
                counts[0] += 1
                describe(out, epoch, row, slot, KIND_TIME_DIFFERENCE)
                z -= aux[CHANGE]
                gate = tcfg["phase_gate"]
                if use_scalar(s, cfg, work, count + 4, z, variance, gate, h, index, out):
                    n += 1
    end_update(s, cfg, work)
    return n


@njit(cache=True)
def remember(
    s: Record, g: Record, cfg: Record, tcfg: Record, work: Record, epoch: Record, rows: Array,
    x: Array,
) -> None:  # fmt: skip
    """Keep the phases of this epoch, and clone the antenna's position `x` (3,)."""
    for k in range(rows.shape[0]):
        row = rows[k]
        if row["seen"] == 1:
            earlier = g["earlier"][row["satellite"]]
            earlier["t"] = epoch["t"]
            for slot in range(SLOTS):
                earlier["signal"][slot] = row["signal"][slot]
                earlier["phase"][slot] = reduced_phase(row, slot)
            for i in range(3):
                earlier["position"][i] = row["position"][i]
    g["epoch_t"] = epoch["t"]
    g["clone_t"] = s["t"]
    P, n, first = s["P"], total_count(s, cfg), state_count(cfg) + CLONE
    lever, C = tcfg["lever"], s["nav"]["C"]
    a0, a1, a2 = rotate3(C, lever[0], lever[1], lever[2])
    if work["trail"]["on"] == 1:
        copy_antenna(work["trail"], first, a0, a1, a2)
    for i in range(3):
        s["aux"][CLONE + i] = x[i]
        # Row of G: the unit vector on position, a x e on attitude.
        e0 = 1.0 if i == 0 else 0.0
        e1 = 1.0 if i == 1 else 0.0
        e2 = 1.0 if i == 2 else 0.0
        b0, b1, b2 = cross3(a0, a1, a2, e0, e1, e2)
        for j in range(n):
            if not first <= j < first + 3:
                value = P[POSITION + i, j] + b0 * P[ATTITUDE, j]
                value += b1 * P[ATTITUDE + 1, j] + b2 * P[ATTITUDE + 2, j]
                P[first + i, j] = value
                P[j, first + i] = value
    for i in range(3):
        e0 = 1.0 if i == 0 else 0.0
        e1 = 1.0 if i == 1 else 0.0
        e2 = 1.0 if i == 2 else 0.0
        b0, b1, b2 = cross3(a0, a1, a2, e0, e1, e2)
        for j in range(i, 3):
            value = P[first + j, POSITION + i] + b0 * P[first + j, ATTITUDE]
            value += b1 * P[first + j, ATTITUDE + 1] + b2 * P[first + j, ATTITUDE + 2]
            P[first + i, first + j] = value
            P[first + j, first + i] = value
