"""Measurements of precise point positioning on an inertial system.

Codes and phases measure the antenna's position, range rates its velocity and, by the way
that the lines of sight turn, its position; here they become measurements of the inertial
system's error states (Kan et al. 2022, eqs. 5 to 7).
"""

from math import floor
from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import atan2
from replay.kernels.least_squares import geometric_range
from replay.kernels.median import median
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.ppp_records import CODE, DOPPLER, IONOSPHERE_COMBINATION, PHASE
from replay.kernels.ppp_states import SECOND
from replay.kernels.single_solve import predicted_range_rate
from replay.kernels.tight_ppp_records import LEAD
from replay.kernels.types import Array, Record
from replay.kernels.weighting import noise_factor

_TWO_PI: Final = 6.283185307179586


@njit(cache=True)
def add_rates(
    rows: Array, views: Array, count: int, q: Record, cfg: Record, x: Array, measures: Array,
    total: int, u: Array,
) -> int:  # fmt: skip
    """Range rates of every signal, after the other measurements of an epoch.

    Parameters
    ----------
    rows : array of MEASURED_DTYPE
    views : array of VIEW_DTYPE
    count : int
        Views.
    q, cfg : records of PPP_STATE_DTYPE, PPP_CONFIG_DTYPE
    x : float64 array
        Predicted states, the antenna's position and velocity first.
    measures : array of PPP_MEASURE_DTYPE
    total : int
        Measurements so far.
    u : float64 array (3,)
        Scratch.

    Returns
    -------
    int
        Measurements.
    """
    away = np.zeros(3)
    drift = q["drift"]
    for v in range(count):
        row = rows[views[v]["rover"]]
        distance = geometric_range(row, x, u)
        predicted = predicted_range_rate(row, x[:3], x[3:6], u)
        along = 0.0
        for c in range(3):
            away[c] = row["velocity"][c] - x[3 + c]
            along += u[c] * away[c]
        for slot in range(cfg["slots"]):
            rate = row["range_rate"][slot]
            if rate != rate or row["cn0"][slot] < cfg["cn0_mask"]:
                continue
            sigma = cfg["doppler_sigma"]
            m = measures[total]
            total += 1
            m["kind"] = DOPPLER
            m["pair"] = v
            m["slot"] = slot
            m["satellite"] = views[v]["satellite"]
            m["z"] = rate + row["drift"] - predicted - x[drift]
            m["r"] = sigma * sigma * noise_factor(
                cfg["weighting"], row["elevation"], row["cn0"][slot]
            )  # fmt: skip
            for c in range(3):
                m["index"][c] = c
                m["h"][c] = (u[c] * along - away[c]) / distance
                m["index"][3 + c] = 3 + c
                m["h"][3 + c] = -u[c]
            m["index"][6] = drift
            m["h"][6] = 1.0
            m["count"] = 7
            m["use"] = 1
    return total


@njit(cache=True)
def clock_step(measures: Array, total: int, variance: float, jump: float, values: Array) -> float:
    """By how much the receiver has set its clock, as its codes tell (m); 0 where it has not.

    The middle innovation of the codes is more than `jump` and than four deviations of the
    clock, and three quarters of the others are near it; reflected signals are late by
    different lengths.

    Parameters
    ----------
    measures : array of PPP_MEASURE_DTYPE
        With innovations of the predicted states.
    total : int
    variance : float, m^2
        Of the predicted clock.
    jump : float, m
    values : float64 array (total,)
        Scratch.
    """
    n = 0
    for k in range(total):
        if measures[k]["kind"] == CODE:
            values[n] = measures[k]["z"]
            n += 1
    if n == 0:
        return 0.0
    middle = median(values, n)
    if not abs(middle) > jump or middle * middle <= 16.0 * variance:
        return 0.0
    near = 0
    for k in range(n):
        if abs(values[k] - middle) < 0.4 * abs(middle):
            near += 1
    return middle if 4 * near >= 3 * n else 0.0


@njit(cache=True)
def step_clock(measures: Array, total: int, step: float) -> None:
    """Take a step of the receiver's clock off the innovations of codes and phases."""
    for k in range(total):
        if measures[k]["kind"] == CODE or measures[k]["kind"] == PHASE:
            measures[k]["z"] -= step


@njit(cache=True)
def heading_of(C: Array, axes: Array) -> float:
    """Heading (rad) of a body from its matrix to ECEF and the rows of east, north and up."""
    east, north = 0.0, 0.0
    for i in range(3):
        east += axes[0, i] * C[i, 0]
        north += axes[1, i] * C[i, 0]
    return atan2(east, north)


@njit(cache=True)
def follow_turn(g: Record, heading: float) -> None:
    """Add to the turn since the alignment what the heading (rad) has changed."""
    change = heading - g["heading"]
    g["turn"] += change - _TWO_PI * floor(change / _TWO_PI + 0.5)
    g["heading"] = heading


@njit(cache=True)
def unwind(
    measures: Array, total: int, views: Array, rows: Array, cfg: Record, turn: float
) -> None:
    """Take off the phases what turning the antenna about the vertical adds to them.

    That is the turn itself, of whatever elevation (Wu et al. 1993): phases of two frequencies
    differ by it in metres, which looks like the ionosphere.

    Parameters
    ----------
    measures : array of PPP_MEASURE_DTYPE
    total : int
    views, rows : arrays of VIEW_DTYPE, MEASURED_DTYPE
    cfg : record of PPP_CONFIG_DTYPE
    turn : float, rad
        Clockwise as seen from above.
    """
    cycles = turn / _TWO_PI
    for k in range(total):
        m = measures[k]
        if m["kind"] == PHASE:
            frequency = rows[views[m["pair"]]["rover"]]["frequency"]
            whole = frequency[m["slot"]]
            if cfg["ionosphere"] == IONOSPHERE_COMBINATION:
                # A cycle of both phases is one of the narrow lane.
                whole = frequency[0] + frequency[SECOND]
            m["z"] -= cycles * SPEED_OF_LIGHT_M_S / whole


@njit(cache=True)
def to_joint(
    measures: Array, total: int, first: int, G: Array, index: Array, count: int, joint: Array
) -> None:
    """The same measurements on the joint states: the antenna is what `G` makes of them.

    Parameters
    ----------
    measures : array of PPP_MEASURE_DTYPE
    total : int
    first : int
        States of the inertial system and the vehicle.
    G, index, count
        As :func:`replay.kernels.tight_ppp_states.antenna_rows` gives them.
    joint : array of PPP_MEASURE_DTYPE
        Filled.
    """
    for k in range(total):
        m, out = measures[k], joint[k]
        out["kind"] = m["kind"]
        out["pair"] = m["pair"]
        out["slot"] = m["slot"]
        out["satellite"] = m["satellite"]
        out["z"] = m["z"]
        out["r"] = m["r"]
        out["use"] = m["use"]
        place, moving = False, False
        for c in range(m["count"]):
            place = place or m["index"][c] < 3
            moving = moving or 3 <= m["index"][c] < LEAD
        n = 0
        if place or moving:
            for a in range(count):
                # A place depends on position and attitude alone.
                if not moving and 3 <= a < 6:
                    continue
                if not moving and a >= 9:
                    break
                value = 0.0
                for c in range(m["count"]):
                    if m["index"][c] < LEAD:
                        value += m["h"][c] * G[m["index"][c], a]
                out["index"][n] = index[a]
                out["h"][n] = value
                n += 1
        for c in range(m["count"]):
            if m["index"][c] >= LEAD:
                out["index"][n] = first + m["index"][c] - LEAD
                out["h"][n] = m["h"][c]
                n += 1
        out["count"] = n
