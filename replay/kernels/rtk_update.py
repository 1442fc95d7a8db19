"""What all filters of differences to a base do with an epoch: breaks, update, who was used."""

import numpy as np
from numba import njit

from replay.kernels.double_difference import residuals, use_group, worst_measure
from replay.kernels.gnss_records import SATELLITES, SYSTEMS
from replay.kernels.kalman import whitened_update
from replay.kernels.rtk_records import MEASURE_STATES
from replay.kernels.rtk_states import heed_breaks
from replay.kernels.types import Array, Record

_ROUNDS = 12


@njit(cache=True)
def heed_base(epochs: Array, rows: Array, until: int, span: int, s: Record) -> None:
    """Breaks of all base epochs since the one looked at last, those not used too.

    Those that are `span` (ns) older than the one in use are past caring.
    """
    begin = epochs[until]["t"] - span
    for j in range(until + 1):
        if epochs[j]["t"] > s["base_t"] and epochs[j]["t"] >= begin:
            first = epochs[j]["first"]
            heed_breaks(rows[first : first + epochs[j]["count"]], 1, s)
            s["base_t"] = epochs[j]["t"]


@njit(cache=True)
def update_epoch(
    measures: Array, starts: Array, groups: int, A: Array, n: int, cfg: Record,
    velocity: Array, velocity_cov: Array, x: Array, P: Array, dx: Array,
) -> int:  # fmt: skip
    """Use all measurements that agree; those that do not are left out, the worst one first.

    Parameters
    ----------
    measures : array of MEASURE_DTYPE
    starts : int64 array
    groups : int
    A : float64 array (n, n)
        Predicted covariance; its last state is room for a clock.
    n : int
    cfg : record of RTK_CONFIG_DTYPE
    velocity : float64 array (3,), m/s, ECEF
        NaN where there is none, or no velocity among the states.
    velocity_cov : float64 array (3, 3)
    x : float64 array
        Predicted states.
    P : float64 array (n, n)
        Filled.
    dx : float64 array (n,)
        Filled.

    Returns
    -------
    int
        Measurements left out.
    """
    total = starts[groups]
    h, index = np.zeros(MEASURE_STATES + 1), np.zeros(MEASURE_STATES + 1, dtype=np.int64)
    b, gain = np.zeros(n), np.zeros(n)
    dropped = 0
    while True:
        for i in range(n):
            dx[i] = 0.0
            for j in range(n):
                P[i, j] = A[i, j]
        if velocity[0] == velocity[0]:
            H, z = np.zeros((3, 3)), np.zeros(3)
            for c in range(3):
                index[c] = 3 + c
                H[c, c] = 1.0
                z[c] = velocity[c] - x[3 + c]
            whitened_update(
                P, n, H, index, 3, z, velocity_cov, 3, dx, np.zeros((3, 3)), np.zeros((3, 8)),
                b, gain,
            )  # fmt: skip
        for group in range(groups):
            use_group(measures, starts[group], starts[group + 1], P, n, dx, h, index, b, gain)
        residuals(measures, starts, groups, P, n, dx, b, gain)
        if dropped == _ROUNDS:
            return dropped
        worst = worst_measure(measures, total, cfg["code_gate"], cfg["phase_gate"])
        if worst < 0:
            return dropped
        measures[worst]["use"] = 0
        dropped += 1


@njit(cache=True)
def settle(measures: Array, total: int, s: Record) -> int:
    """Count epochs in use and rejections of each ambiguity; the number of phases in use."""
    phases = 0
    for k in range(total):
        m = measures[k]
        if m["kind"] == 1:
            satellite, slot = m["satellite"], m["slot"]
            if m["use"] == 1:
                phases += 1
                s["lock"][satellite, slot] += 1
                s["rejected"][satellite, slot] = 0
            else:
                s["rejected"][satellite, slot] += 1
                s["lock"][satellite, slot] = 0
                s["known"][satellite, slot] = 0
    return phases


@njit(cache=True)
def satellite_differences(measures: Array, total: int, pairs: Array) -> int:
    """Satellites in use less the systems that they are of: what a position needs three of.

    Frequencies do not count: they see the same direction.
    """
    seen = np.zeros(SATELLITES, dtype=np.int64)
    systems = np.zeros(SYSTEMS, dtype=np.int64)
    count = 0
    for k in range(total):
        m = measures[k]
        if m["use"] == 1 and seen[m["satellite"]] == 0:
            seen[m["satellite"]] = 1
            count += 1
            system = pairs[m["pair"]]["system"]
            if systems[system] == 0:
                systems[system] = 1
                count -= 1
    return count
