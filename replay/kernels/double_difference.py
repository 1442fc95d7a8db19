"""Differences between two receivers as measurements of a filter.

Each single difference (rover less base) of a system and slot shares one unknown, the
difference of the receivers' clocks and delays. It is given no prior at all: the first
measurement of the group sets it, the others meet it as a state with its covariance, and
after the group it is dropped. That is the double difference to that first satellite,
correlations and all, and whichever satellite comes first gives the same result; yet every
measurement stays a scalar of its own variance.

Of the rest after an update: with weights w = 1/r the clock's posterior mean is the weighted
mean of the group's residuals, and the variance of what the model says of a measurement
is (h - m) P (h - m)' + 1 / sum(w), m being the weighted mean of the rows h.
"""

import numpy as np
from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SYSTEMS
from replay.kernels.kalman import scalar_update
from replay.kernels.least_squares import geometric_range
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.rtk_records import PAIRS
from replay.kernels.types import Array, Record
from replay.kernels.weighting import noise_factor

# Parts of a delay by which it falls with a metre of height: the hydrostatic one with
# pressure (5.2 * 2.26e-5), the wet one with the vapour of the standard atmosphere.
_HYDROSTATIC_FALL = 1.18e-4
_WET_FALL = 4.4e-4
_L1_HZ = 1575.42e6
_UNTESTABLE = 0.01


@njit(cache=True)
def pair_rows(
    rover: Array, base: Array, gap: float, cfg: Record, x: Array, coarse: Array, base_x: Array,
    up: Array, pairs: Array, u: Array,
) -> int:  # fmt: skip
    """Satellites that both receivers see, and what is computed of each.

    Parameters
    ----------
    rover, base : arrays of MEASURED_DTYPE
        Each in the order of satellites.
    gap : float, s
        Rover's epoch less the base's.
    cfg : record of RTK_CONFIG_DTYPE
    x, coarse, base_x : float64 arrays (3,), m, ECEF
        The rover, where its delays were computed, and the base.
    up : float64 array (3,)
        Of the rover's horizon, ECEF.
    pairs : array of PAIR_DTYPE
        Filled.
    u : float64 array (3,)
        Scratch.

    Returns
    -------
    int
        How many; at most PAIRS.
    """
    count = 0
    j = 0
    higher = 0.0
    for c in range(3):
        higher += up[c] * (x[c] - coarse[c])
    for i in range(rover.shape[0]):
        satellite = rover[i]["satellite"]
        while j < base.shape[0] and base[j]["satellite"] < satellite:
            j += 1
        if j == base.shape[0] or count == PAIRS:
            break
        if base[j]["satellite"] != satellite or cfg["excluded"][satellite] == 1:
            continue
        if rover[i]["seen"] == 0 or base[j]["seen"] == 0:
            continue
        if not rover[i]["elevation"] >= cfg["mask"] or not base[j]["elevation"] > 0.0:
            continue
        # Two messages of one satellite differ by decimetres and more.
        if rover[i]["issue"] != base[j]["issue"]:
            continue
        if abs(rover[i]["age"] - base[j]["age"] - gap) > 1.0:
            continue
        pair = pairs[count]
        count += 1
        pair["rover"] = i
        pair["base"] = j
        pair["satellite"] = satellite
        pair["system"] = rover[i]["system"]
        pair["elevation"] = rover[i]["elevation"]
        far = geometric_range(base[j], base_x, u) + _delays(base[j])
        pair["computed"] = geometric_range(rover[i], x, u) + _delays(rover[i]) - far
        fall = _HYDROSTATIC_FALL * rover[i]["hydrostatic"] + _WET_FALL * rover[i]["wet"]
        # Codes alone put the rover some metres, without an ionosphere some tens, off its height.
        pair["computed"] -= fall * higher
        for c in range(3):
            pair["u"][c] = -u[c] - fall * up[c]
    return count


@njit(cache=True)
def _delays(row: Record) -> float:
    return row["hydrostatic"] + row["wet"] + row["shapiro"] - row["clock"]


@njit(cache=True)
def difference(rover: Record, base: Record, slot: int, phase: bool) -> float:
    """Single difference (m) of a code or phase, the modelled ionosphere taken off."""
    if phase:
        return (
            rover["phase"][slot]
            - base["phase"][slot]
            + (rover["ionosphere"][slot] - base["ionosphere"][slot])
        )
    return (
        rover["code"][slot]
        - base["code"][slot]
        - (rover["ionosphere"][slot] - base["ionosphere"][slot])
    )


@njit(cache=True)
def difference_variance(
    rover: Record, base: Record, slot: int, phase: bool, age: float, baseline: float, cfg: Record
) -> float:
    """Variance (m^2) of a single difference.

    What grows with the distance is in it where no network has taken it off.
    """
    sigma = cfg["phase_sigma"][slot]
    if not phase:
        sigma = cfg["code_sigma"][slot] * cfg["system_scale"][rover["system"]]
    model = cfg["weighting"]
    factor = noise_factor(model, rover["elevation"], rover["cn0"][slot])
    factor += noise_factor(model, base["elevation"], base["cn0"][slot])
    clock = cfg["clock_stability"] * SPEED_OF_LIGHT_M_S * age
    distance = cfg["baseline_noise"] * baseline
    variance = sigma * sigma * factor + clock * clock
    if rover["network_known"][slot] == 1:
        return variance + rover["network_std"][slot] * rover["network_std"][slot]
    return variance + 2.0 * distance * distance


@njit(cache=True)
def build_measures(
    rover: Array, base: Array, pairs: Array, count: int, age: float, baseline: float,
    s: Record, cfg: Record, x: Array, measures: Array, starts: Array,
) -> int:  # fmt: skip
    """All single differences of an epoch, by group: codes first, then phases.

    Parameters
    ----------
    rover, base : arrays of MEASURED_DTYPE
    pairs : array of PAIR_DTYPE
    count : int
        Pairs.
    age, baseline : float, s, m
    s, cfg : records of RTK_STATE_DTYPE, RTK_CONFIG_DTYPE
    x : float64 array
        Predicted states.
    measures : array of MEASURE_DTYPE
        Filled.
    starts : int64 array (2 * SYSTEMS * SLOTS + 1,)
        Filled: where each group begins, and the end.

    Returns
    -------
    int
        Groups.
    """
    groups = 0
    total = 0
    for kind in range(2):
        for system in range(SYSTEMS):
            for slot in range(cfg["slots"]):
                begin = total
                for p in range(count):
                    if pairs[p]["system"] != system:
                        continue
                    a, b = rover[pairs[p]["rover"]], base[pairs[p]["base"]]
                    value = difference(a, b, slot, kind == 1)
                    value -= a["network"][slot] if kind == 1 else a["network_code"][slot]
                    satellite = pairs[p]["satellite"]
                    state = s["amb"][satellite, slot]
                    if value != value or (kind == 1 and state < 0):
                        continue
                    if (
                        a["cn0"][slot] < cfg["cn0_mask"]
                        or a["frequency"][slot] != b["frequency"][slot]
                    ):
                        continue
                    m = measures[total]
                    total += 1
                    m["kind"] = kind
                    m["pair"] = p
                    m["slot"] = slot
                    m["group"] = groups
                    m["satellite"] = satellite
                    m["z"] = value - pairs[p]["computed"]
                    m["r"] = difference_variance(a, b, slot, kind == 1, age, baseline, cfg)
                    m["use"] = 1
                    for c in range(3):
                        m["index"][c] = c
                        m["h"][c] = pairs[p]["u"][c]
                    k = 3
                    if kind == 1:
                        m["index"][k] = state
                        m["h"][k] = 1.0
                        m["z"] -= x[state]
                        k += 1
                    if s["slant"][satellite] >= 0:
                        ratio = _L1_HZ / a["frequency"][slot]
                        m["index"][k] = s["slant"][satellite]
                        m["h"][k] = -ratio * ratio if kind == 1 else ratio * ratio
                        m["z"] -= m["h"][k] * x[s["slant"][satellite]]
                        k += 1
                    if s["wet"] >= 0:
                        for end in range(2):
                            m["index"][k] = s["wet"] + end
                            m["h"][k] = a["wet_mapping"] if end == 0 else -b["wet_mapping"]
                            m["z"] -= m["h"][k] * x[s["wet"] + end]
                            k += 1
                    m["count"] = k
                if total - begin >= 2:
                    starts[groups] = begin
                    groups += 1
                else:
                    total = begin
    starts[groups] = total
    return groups


@njit(cache=True)
def use_group(
    measures: Array, begin: int, end: int, P: Array, n: int, dx: Array,
    h: Array, index: Array, b: Array, gain: Array,
) -> None:  # fmt: skip
    """Update with one group; its clock lives in state `n` - 1 meanwhile.

    Parameters
    ----------
    measures : array of MEASURE_DTYPE
        The group stands from `begin` to `end`.
    P : float64 array (n, n)
        Changed.
    dx : float64 array (n,)
        Correction so far; added to.
    h, index : arrays (8,)
    b, gain : float64 arrays (n,)
        Scratch.
    """
    clock = n - 1
    first = -1
    for k in range(begin, end):
        if measures[k]["use"] == 1 and (first < 0 or measures[k]["r"] < measures[first]["r"]):
            first = k
    if first < 0:
        return
    m = measures[first]
    z = m["z"]
    for i in range(clock):
        value = 0.0
        for c in range(m["count"]):
            value += P[i, m["index"][c]] * m["h"][c]
        b[i] = value
    spread = m["r"]
    for c in range(m["count"]):
        z -= m["h"][c] * dx[m["index"][c]]
        spread += m["h"][c] * b[m["index"][c]]
    for i in range(clock):
        P[i, clock] = -b[i]
        P[clock, i] = -b[i]
    P[clock, clock] = spread
    dx[clock] = z
    for k in range(begin, end):
        m = measures[k]
        if m["use"] == 0 or k == first:
            continue
        weight = 1.0 / sqrt(m["r"])
        count = m["count"]
        for c in range(count):
            index[c] = m["index"][c]
            h[c] = weight * m["h"][c]
        index[count] = clock
        h[count] = weight
        scalar_update(P, n, h, index, count + 1, weight * m["z"], dx, b, gain)
    # Forget the clock.
    dx[clock] = 0.0
    for i in range(n):
        P[i, clock] = 0.0
        P[clock, i] = 0.0


@njit(cache=True)
def residuals(
    measures: Array, starts: Array, groups: int, P: Array, n: int, dx: Array,
    mean: Array, g: Array,
) -> None:  # fmt: skip
    """Fill what is left of each measurement after the update, and its variance.

    Of a measurement that was used the variance is its own less what the model explains,
    of one that was not it is the sum.

    Parameters
    ----------
    measures : array of MEASURE_DTYPE
    starts : int64 array
    groups : int
    P, n, dx
        After the update.
    mean, g : float64 arrays (n,)
        Scratch.
    """
    for group in range(groups):
        begin, end = starts[group], starts[group + 1]
        for i in range(n):
            mean[i] = 0.0
        clock, total = 0.0, 0.0
        for k in range(begin, end):
            m = measures[k]
            e = m["z"]
            for c in range(m["count"]):
                e -= m["h"][c] * dx[m["index"][c]]
            m["residual"] = e
            if m["use"] == 1:
                w = 1.0 / m["r"]
                total += w
                clock += w * e
                for c in range(m["count"]):
                    mean[m["index"][c]] += w * m["h"][c]
        if total == 0.0:
            for k in range(begin, end):
                measures[k]["spread"] = np.nan
            continue
        clock /= total
        for i in range(n):
            mean[i] /= total
        middle = 0.0
        for i in range(n):
            g[i] = 0.0
        for j in range(n):
            if mean[j] != 0.0:
                for i in range(n):
                    g[i] += P[j, i] * mean[j]
        for i in range(n):
            middle += mean[i] * g[i]
        for k in range(begin, end):
            m = measures[k]
            m["residual"] -= clock
            share = middle + 1.0 / total
            for c in range(m["count"]):
                i = m["index"][c]
                share -= 2.0 * m["h"][c] * g[i]
                for d in range(m["count"]):
                    share += m["h"][c] * m["h"][d] * P[i, m["index"][d]]
            m["spread"] = m["r"] - share if m["use"] == 1 else m["r"] + share


@njit(cache=True)
def worst_measure(measures: Array, total: int, code_gate: float, phase_gate: float) -> int:
    """The used measurement that is furthest beyond its gate, or minus one."""
    place, worst = -1, 1.0
    for k in range(total):
        m = measures[k]
        # What nearly nothing else speaks about cannot be tested.
        if m["use"] == 0 or not m["spread"] > _UNTESTABLE * m["r"]:
            continue
        gate = phase_gate if m["kind"] == 1 else code_gate
        size = abs(m["residual"]) / (gate * sqrt(m["spread"]))
        if size > worst:
            place, worst = k, size
    return place
