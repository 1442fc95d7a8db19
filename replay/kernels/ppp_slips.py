"""Breaks of one receiver's phases that two frequencies show against each other.

The geometry-free phase (first slot less another one) is carried on along its own rate, as
the ionosphere lets it at 30 s, and across missing epochs as long as an ambiguity may
live; the Melbourne-Wuebbena combination is held against its running mean (Blewitt 1990).
Both begin anew after a break.
"""

from math import floor
from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import sin
from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.median import median
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.slips import wide_lane
from replay.kernels.types import Array, Record

_RATE_GAIN: Final = 0.3
_WIDE_MEMORY: Final = 200
# Epochs after which a mean and a rate are believed as they stand.
_YOUNG: Final = 4
_MS_M: Final = SPEED_OF_LIGHT_M_S * 1e-3
_MS_TOLERANCE_M: Final = 30.0
_LEAST_COMMON: Final = 3


@njit(cache=True)
def code_jump(rows: Array, t: int, s: Record, x: Array, cfg: Record) -> float:
    """Whole milliseconds (m) by which a receiver set its codes and not its phases.

    The ambiguities in `x` and what the combinations are held against are set with them.

    Parameters
    ----------
    rows : array of MEASURED_DTYPE
    t : int, ns
    s, cfg : records of PPP_STATE_DTYPE, PPP_CONFIG_DTYPE
    x : float64 array
        States; changed.
    """
    changes = np.empty(rows.shape[0])
    count = 0
    for k in range(rows.shape[0]):
        sat = rows[k]["satellite"]
        level = rows[k]["code"][0] - rows[k]["phase"][0]
        change = level - s["level"][sat]
        if change == change and (t - s["level_t"][sat]) * 1e-9 <= cfg["gap"]:
            changes[count] = change
            count += 1
        if level == level:
            s["level"][sat] = level
            s["level_t"][sat] = t
    if count < _LEAST_COMMON:
        return 0.0
    middle = median(changes, count)
    jump = floor(middle / _MS_M + 0.5) * _MS_M
    if jump == 0.0 or abs(middle - jump) > _MS_TOLERANCE_M:
        return 0.0
    for sat in range(SATELLITES):
        for slot in range(SLOTS):
            if s["amb"][sat, slot] >= 0:
                x[s["amb"][sat, slot]] -= jump
    for k in range(rows.shape[0]):
        row = rows[k]
        for slot in range(1, SLOTS):
            if row["frequency"][slot] == row["frequency"][slot]:
                cycles = jump * (row["frequency"][0] - row["frequency"][slot]) / SPEED_OF_LIGHT_M_S
                s["wide"][row["satellite"], slot] -= cycles
    return jump


@njit(cache=True)
def compare_phases(rows: Array, views: Array, count: int, t: int, s: Record, cfg: Record) -> None:
    """Mark ambiguities whose phases jumped against each other.

    Parameters
    ----------
    rows : array of MEASURED_DTYPE
    views : array of VIEW_DTYPE
    count : int
    t : int, ns
    s, cfg : records of PPP_STATE_DTYPE, PPP_CONFIG_DTYPE
    """
    slip = s["slip"]
    for v in range(count):
        row = rows[views[v]["rover"]]
        sat = views[v]["satellite"]
        scale = max(0.25, sin(views[v]["elevation"]))
        told = slip[sat, 0]
        for slot in range(1, SLOTS):
            free = row["phase"][0] - row["phase"][slot]
            if free != free:
                continue
            wide = wide_lane(row, slot)
            dt = (t - s["free_t"][sat, slot]) * 1e-9
            known = s["free_count"][sat, slot]
            anew = told == 1 or slip[sat, slot] == 1 or known == 0
            if anew or dt <= 0.0 or dt > cfg["gap"]:
                _begin(s, sat, slot, free, wide, t)
                continue
            miss = free - s["free"][sat, slot] - s["free_rate"][sat, slot] * dt
            limit = cfg["geometry_free"] / scale + cfg["geometry_free_rate"] * dt
            if known < _YOUNG:
                limit += cfg["geometry_free_rate"] * dt
            broken = cfg["geometry_free"] > 0.0 and abs(miss) > limit
            epochs = s["wide_count"][sat, slot]
            if cfg["wide_lane"] > 0.0 and epochs > 0 and wide == wide:
                off = abs(wide - s["wide"][sat, slot])
                factor = 1.0 if epochs >= _YOUNG else 1.5
                broken = broken or off > factor * cfg["wide_lane"] / scale
            if broken:
                slip[sat, 0] = 1
                slip[sat, slot] = 1
                _begin(s, sat, slot, free, wide, t)
                continue
            s["free_rate"][sat, slot] += _RATE_GAIN * miss / dt
            s["free"][sat, slot] = free
            s["free_t"][sat, slot] = t
            s["free_count"][sat, slot] = known + 1
            if wide == wide:
                epochs = min(epochs + 1, _WIDE_MEMORY)
                s["wide_count"][sat, slot] = epochs
                if epochs == 1:
                    s["wide"][sat, slot] = wide
                else:
                    s["wide"][sat, slot] += (wide - s["wide"][sat, slot]) / epochs


@njit(cache=True)
def _begin(s: Record, sat: int, slot: int, free: float, wide: float, t: int) -> None:
    s["free"][sat, slot] = free
    s["free_rate"][sat, slot] = 0.0
    s["free_t"][sat, slot] = t
    s["free_count"][sat, slot] = 1
    s["wide"][sat, slot] = wide
    s["wide_count"][sat, slot] = 1 if wide == wide else 0
