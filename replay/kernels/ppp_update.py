"""Measurement update of precise point positioning, and what is believed of an epoch.

All measurements are used first. What is then left of each, over its deviation, says which
one disagrees most: it is taken out again, which costs no more than its use did, and the
rest is looked at anew.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.ppp_records import CODE, DOPPLER, IONOSPHERE, PHASE
from replay.kernels.sequential import mirror, take_out, update
from replay.kernels.types import Array, Record

_UNTESTABLE: Final = 0.01


@njit(cache=True)
def look_at_residuals(measures: Array, total: int, P: Array, dx: Array, cfg: Record) -> int:
    """Fill what is left of each measurement and its variance; the worst used one, or minus one.

    Of a measurement that was used the variance is its own less what the model explains,
    of one that was not it is the sum.

    Parameters
    ----------
    measures : array of PPP_MEASURE_DTYPE
    total : int
    P, dx
        After the update; of the covariance the upper triangle.
    cfg : record of PPP_CONFIG_DTYPE
    """
    place, worst = -1, 1.0
    for k in range(total):
        m = measures[k]
        h, index, count = m["h"], m["index"], m["count"]
        e, share = m["z"], 0.0
        for c in range(count):
            i = index[c]
            e -= h[c] * dx[i]
            half = 0.5 * h[c] * P[i, i]
            for d in range(c):
                j = index[d]
                half += h[d] * (P[j, i] if j < i else P[i, j])
            share += 2.0 * h[c] * half
        m["residual"] = e
        if m["use"] == 0:
            m["spread"] = m["r"] + share
            continue
        m["spread"] = m["r"] - share
        # What nearly nothing else speaks about cannot be tested.
        if not m["spread"] > _UNTESTABLE * m["r"]:
            continue
        gate = cfg["phase_gate"] if m["kind"] == PHASE else cfg["code_gate"]
        size = abs(e) / (gate * sqrt(m["spread"]))
        if size > worst:
            place, worst = k, size
    return place


@njit(cache=True)
def update_epoch(measures: Array, total: int, P: Array, n: int, cfg: Record, dx: Array) -> int:
    """Use all measurements that agree; those that do not are left out, the worst one first.

    Parameters
    ----------
    measures : array of PPP_MEASURE_DTYPE
        `use` says which may be used, and in the end which were.
    total : int
    P : float64 array (at least n, at least n)
        Predicted covariance, its upper triangle; changed, both triangles.
    n : int
    cfg : record of PPP_CONFIG_DTYPE
    dx : float64 array (n,)
        Filled: correction of the predicted states.

    Returns
    -------
    int
        Measurements left out.
    """
    b = np.empty(n)
    for i in range(n):
        dx[i] = 0.0
    for k in range(total):
        m = measures[k]
        if m["use"] == 1:
            update(P, n, m["h"], m["index"], m["count"], m["z"], m["r"], dx, b)
    dropped = 0
    while True:
        worst = look_at_residuals(measures, total, P, dx, cfg)
        if worst < 0 or dropped == cfg["rounds"]:
            break
        m = measures[worst]
        take_out(P, n, m["h"], m["index"], m["count"], m["z"], m["r"], dx, b)
        m["use"] = 0
        dropped += 1
    mirror(P, n)
    return dropped


@njit(cache=True)
def settle(measures: Array, total: int, s: Record) -> int:
    """Count epochs in use and rejections of each ambiguity; the number of phases in use."""
    phases = 0
    for k in range(total):
        m = measures[k]
        if m["kind"] != PHASE:
            continue
        sat, slot = m["satellite"], m["slot"]
        s["age"][sat, slot] += 1
        if m["use"] == 1:
            phases += 1
            s["lock"][sat, slot] += 1
            s["rejected"][sat, slot] = 0
        else:
            s["rejected"][sat, slot] += 1
            s["lock"][sat, slot] = 0
            for other in range(SLOTS):
                s["known"][sat, other] = 0
    return phases


@njit(cache=True)
def count_used(measures: Array, total: int) -> tuple[int, int]:
    """Satellites with a code or phase in use, and how many codes and phases are."""
    seen = np.zeros(SATELLITES, dtype=np.int64)
    satellites, used = 0, 0
    for k in range(total):
        m = measures[k]
        if m["use"] == 0 or m["kind"] == IONOSPHERE or m["kind"] == DOPPLER:
            continue
        used += 1
        if seen[m["satellite"]] == 0:
            seen[m["satellite"]] = 1
            satellites += 1
    return satellites, used


@njit(cache=True)
def mark_satellites(views: Array, measures: Array, total: int, weight: Array) -> None:
    """1 in `weight` for each row of the epoch that the position rests on, else 0."""
    for k in range(weight.shape[0]):
        weight[k] = 0.0
    for k in range(total):
        m = measures[k]
        if m["use"] == 1 and (m["kind"] == PHASE or m["kind"] == CODE):
            weight[views[m["pair"]]["rover"]] = 1.0
