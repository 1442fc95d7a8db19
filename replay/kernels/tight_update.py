"""Codes and Doppler of single satellites on an inertial system, and the clocks in them."""

from numba import njit

from replay.kernels.antenna_measures import (
    begin_update,
    describe,
    end_update,
    position_row,
    use_scalar,
    velocity_row,
    widen,
)
from replay.kernels.gnss_records import SYSTEMS
from replay.kernels.least_squares import geometric_range, reduced_code
from replay.kernels.median import median
from replay.kernels.single_records import KIND_DOPPLER, KIND_PSEUDORANGE
from replay.kernels.single_solve import predicted_range_rate, usable
from replay.kernels.tight_records import CLOCK, DRIFT
from replay.kernels.types import Array, Record
from replay.kernels.update import state_count
from replay.kernels.weighting import code_variance, noise_factor


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
