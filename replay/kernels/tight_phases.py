"""Changes of carrier phases since the epoch before, on an inertial system with a clone of then."""

from numba import njit

from replay.kernels.antenna_measures import (
    begin_update,
    describe,
    end_update,
    position_row,
    use_scalar,
    widen,
)
from replay.kernels.covariance import ATTITUDE, POSITION
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SLOTS
from replay.kernels.least_squares import geometric_range, reduced_phase
from replay.kernels.median import median
from replay.kernels.rotation import cross3, rotate3
from replay.kernels.tight_records import CHANGE, CLONE, KIND_TIME_DIFFERENCE
from replay.kernels.transition import copy_antenna
from replay.kernels.types import Array, Record
from replay.kernels.update import state_count, total_count
from replay.kernels.weighting import noise_factor


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
