"""Position, clocks and velocity of one epoch from codes and Doppler alone.

Weighted least squares on pseudoranges, and on Doppler for the velocity; a chi-square
test of the residuals, with the satellite of the largest normalised residual left out
until it passes (Baarda 1968); robust weights instead of, or before, that.
"""

from math import floor

import numpy as np
from numba import njit

from replay.kernels.distributions import chi2_cdf
from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.elementary import sqrt
from replay.kernels.least_squares import (
    accumulate,
    clear_normal,
    geometric_range,
    iterate,
    reduced_code,
    solve_normal,
)
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.types import Array, Record
from replay.kernels.weighting import ROBUST_HUBER, ROBUST_NONE, code_variance, noise_factor

_NAN = float("nan")


@njit(cache=True)
def _second(row: Record) -> int:
    """Slot that makes a pair with slot 0: the next that has a range, else slot 1."""
    return 2 if row["code"][1] != row["code"][1] and row["code"][2] == row["code"][2] else 1


@njit(cache=True)
def free_code(row: Record) -> float:
    """Ionosphere-free pseudorange of two slots, every modelled term taken off (m)."""
    second = _second(row)
    f0, f1 = row["frequency"][0], row["frequency"][second]
    a = f0 * f0 / (f0 * f0 - f1 * f1)
    p0 = reduced_code(row, 0) + row["ionosphere"][0]
    p1 = reduced_code(row, second) + row["ionosphere"][second]
    return a * p0 - (a - 1.0) * p1


@njit(cache=True)
def free_factor(row: Record) -> float:
    """Variance of the ionosphere-free pair over that of one of its ranges."""
    f0, f1 = row["frequency"][0], row["frequency"][_second(row)]
    a = f0 * f0 / (f0 * f0 - f1 * f1)
    return a * a + (a - 1.0) * (a - 1.0)


@njit(cache=True)
def predicted_range_rate(row: Record, x: Array, v: Array, u: Array) -> float:
    """Rate of the range (m/s) in time of reception, without clocks; `u` becomes the line of sight.

    The satellite's clock of transmission runs slower by the range's own rate, and the
    Earth turns less while the flight gets shorter: together some millimetres per second.
    """
    geometric_range(row, x, u)
    p, w = row["position"], row["velocity"]
    first = u[0] * (w[0] - v[0]) + u[1] * (w[1] - v[1]) + u[2] * (w[2] - v[2])
    shrink = first / SPEED_OF_LIGHT_M_S
    turn = EARTH_RATE_RAD_S * shrink
    return (
        u[0] * (w[0] * (1.0 - shrink) + turn * p[1] - v[0])
        + u[1] * (w[1] * (1.0 - shrink) - turn * p[0] - v[1])
        + u[2] * (w[2] * (1.0 - shrink) - v[2])
    )


@njit(cache=True)
def usable(row: Record, cfg: Record) -> bool:
    """Whether a satellite may be used at all."""
    if row["seen"] == 0 or cfg["excluded"][row["satellite"]] == 1:
        return False
    if not row["elevation"] >= cfg["mask"] or row["code"][0] != row["code"][0]:
        return False
    second = row["code"][_second(row)]
    if cfg["free"] == 1 and second != second:
        return False
    return not row["cn0"][0] < cfg["cn0_mask"]


@njit(cache=True)
def _robust_factor(kind: int, v: float) -> float:
    """Weight factor of a residual `v` over its deviation (Huber 1964; Yang 1999, IGG III)."""
    v = abs(v)
    if kind == ROBUST_HUBER:
        return 1.0 if v <= 1.5 else 1.5 / v
    if v <= 1.5:
        return 1.0
    if v >= 6.0:
        return 1e-6
    ratio = (6.0 - v) / 4.5
    return 1.5 / v * ratio * ratio


@njit(cache=True)
def range_variance(work: Record, u: Array, clock: int) -> float:
    """Variance of a predicted range: h Q h' of minus the line of sight and a clock."""
    N = work["N"]
    total = N[clock, clock]
    for i in range(3):
        total -= 2.0 * u[i] * N[i, clock]
        for j in range(3):
            total += u[i] * u[j] * N[i, j]
    return total


@njit(cache=True)
def _worst(
    rows: Array, observed: Array, weight: Array, s: Record, work: Record, u: Array
) -> tuple[int, float, float, int]:
    """Satellite of the largest normalised residual, that residual, sum of squares, count."""
    place, worst, total, used = -1, 0.0, 0.0, 0
    for k in range(rows.shape[0]):
        if weight[k] > 0.0:
            used += 1
            system = rows[k]["system"]
            z = observed[k] - geometric_range(rows[k], s["x"], u) - s["clock"][system]
            total += weight[k] * z * z
            variance = 1.0 / weight[k] - range_variance(work, u, work["column"][system])
            # A residual of (nearly) no freedom says nothing.
            if variance * weight[k] > 1e-6:
                normal = abs(z) / sqrt(variance)
                if normal > worst:
                    worst = normal
                    place = k
    return place, worst, total, used


@njit(cache=True)
def solve_epoch(
    rows: Array,
    s: Record,
    cfg: Record,
    work: Record,
    observed: Array,
    variance: Array,
    weight: Array,
    dropped: Array,
    u: Array,
) -> int:
    """Position and clocks of one epoch, with its exclusions.

    Parameters
    ----------
    rows : array (n,) of MEASURED_DTYPE
    s : record of SINGLE_STATE_DTYPE
        Where to begin; changed.
    cfg, work : records
    observed, variance, weight : float64 arrays (n,)
        Filled: reduced ranges, their variances, the weights used in the end.
    dropped : int64 array (n,)
        1 where the satellite was left out by its residual.
    u : float64 array (3,)

    Returns
    -------
    int
        As :func:`replay.kernels.least_squares.iterate`.
    """
    for k in range(rows.shape[0]):
        row = rows[k]
        dropped[k] = 0
        weight[k] = 0.0
        variance[k] = _NAN
        observed[k] = _NAN
        if not usable(row, cfg):
            continue
        sigma = cfg["code_sigma"] * cfg["system_scale"][row["system"]]
        if cfg["free"] == 1:
            # The pair's noise is larger; orbit and troposphere are the same in both ranges.
            observed[k] = free_code(row)
            sigma *= sqrt(free_factor(row))
        else:
            observed[k] = reduced_code(row, 0)
        variance[k] = code_variance(row, 0, sigma, cfg["weight"])
        if observed[k] == observed[k]:
            weight[k] = 1.0 / variance[k]
    status = iterate(rows, observed, weight, 10, 1e-4, s["x"], s["clock"], work, u)
    if status < 0:
        return status
    if cfg["robust"] != ROBUST_NONE:
        for _ in range(10):
            for k in range(rows.shape[0]):
                if weight[k] > 0.0:
                    system = rows[k]["system"]
                    z = observed[k] - geometric_range(rows[k], s["x"], u) - s["clock"][system]
                    factor = _robust_factor(cfg["robust"], z / sqrt(variance[k]))
                    weight[k] = factor / variance[k]
            turn = iterate(rows, observed, weight, 5, 1e-4, s["x"], s["clock"], work, u)
            if turn < 0:
                return turn
            if turn == 1:
                break
    if cfg["raim"] == 1:
        for _ in range(cfg["exclusions"]):
            place, worst, total, used = _worst(rows, observed, weight, s, work, u)
            freedom = used - work["unknowns"]
            if freedom < 1 or chi2_cdf(total, freedom) <= cfg["confidence"]:
                break
            # With one degree of freedom all residuals are alike: nobody can be named.
            if freedom < 2 or place < 0 or worst < 2.0:
                break
            weight[place] = 0.0
            dropped[place] = 1
            status = iterate(rows, observed, weight, 10, 1e-4, s["x"], s["clock"], work, u)
            if status < 0:
                return status
    return status


@njit(cache=True)
def solve_velocity(
    rows: Array, weight: Array, cfg: Record, s: Record, work: Record, v: Array, u: Array
) -> float:
    """Velocity (m/s, ECEF, into `v`) from Doppler; the clock's drift (m/s), NaN where it fails.

    One drift serves all systems. Satellites of the position are used; the largest residual
    is left out while it is over five deviations and others remain.
    """
    kept = np.zeros(rows.shape[0])
    sigma2 = cfg["doppler_sigma"] * cfg["doppler_sigma"]
    used = 0
    for k in range(rows.shape[0]):
        rate = rows[k]["range_rate"][0]
        if weight[k] > 0.0 and rate == rate:
            w = cfg["weight"]["model"]
            kept[k] = 1.0 / (sigma2 * noise_factor(w, rows[k]["elevation"], rows[k]["cn0"][0]))
            used += 1
    drift = 0.0
    for i in range(3):
        v[i] = 0.0
    while True:
        if used < 4:
            return _NAN
        work["unknowns"] = 4
        for _ in range(3):
            clear_normal(work)
            for k in range(rows.shape[0]):
                if kept[k] > 0.0:
                    row = rows[k]
                    z = row["range_rate"][0] + row["drift"] - drift
                    z -= predicted_range_rate(row, s["x"], v, u)
                    accumulate(work, u[0], u[1], u[2], 3, kept[k], z)
            if not solve_normal(work):
                return _NAN
            dx = work["dx"]
            for i in range(3):
                v[i] += dx[i]
            drift += dx[3]
        place, worst = -1, 0.0
        for k in range(rows.shape[0]):
            if kept[k] > 0.0:
                row = rows[k]
                z = row["range_rate"][0] + row["drift"] - drift
                z -= predicted_range_rate(row, s["x"], v, u)
                variance = 1.0 / kept[k] - range_variance(work, u, 3)
                if variance * kept[k] > 1e-6 and abs(z) / sqrt(variance) > worst:
                    worst = abs(z) / sqrt(variance)
                    place = k
        if cfg["raim"] == 0 or worst < 5.0 or used <= 5:
            return drift
        kept[place] = 0.0
        used -= 1


@njit(cache=True)
def true_time(t: int, clock: float) -> int:
    """Time (ns) of an epoch that a receiver's clock, off by `clock` (m), read as `t`."""
    return t - floor(clock / SPEED_OF_LIGHT_M_S * 1e9 + 0.5)
