"""Filters of the errors between two reference stations that grow with their distance.

One filter for each double difference on each signal, with four states (Lee 2010, eqs 1 to 4):
the error (m), its rate (m/s), its acceleration (m/s^2) and multipath (m). The first three are
driven by white noise on the derivative of the acceleration, the fourth is a first-order
Gauss-Markov process; what is measured is the error, multipath and white noise together. They
are told apart by how they move alone: what changes within the correlation time is multipath.

When the reference satellite of a system changes, what is known is carried over to the new one:
double differences to the old one are subtracted. The filters know nothing of each other, so
the covariance of a difference is taken as the sum of both. That is more than it is: both
filters hold the old reference's own errors, with the same sign and nearly the same gains, and
these fall out of the difference. For satellites of equal noise the sum is twice the truth;
measurements to the new reference bring it back.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import exp, sqrt
from replay.kernels.kalman import scalar_update
from replay.kernels.types import Array, Record

STATES: Final = 4
_MULTIPATH: Final = 3
_NS: Final = 1e-9
_NAN: Final = float("nan")

ERRORS_CONFIG_DTYPE: Final = np.dtype(
    [
        ("sigma", "<f8", 3),  # m, m/s, m/s^2, before the first residual
        ("noise", "<f8"),  # (m/s^2)/sqrt(s)
        ("tau", "<f8"),  # s
        ("gate", "<f8"),  # innovation over its deviation, 0 lets all in
        ("rejections", "<i8"),  # in a row, after which a filter begins anew
        ("gap", "<i8"),  # ns without a residual that ends a filter
    ],
    align=True,
)

RESIDUAL_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns
        ("log_t", "<i8"),  # ns
        ("satellite", "<i8"),  # dense number
        ("reference", "<i8"),  # dense number
        ("system", "<i8"),
        ("signal", "<i8"),  # two characters, first one low
        ("z", "<f8"),  # m
        ("noise", "<f8"),  # m^2, variance of what is white
        ("multipath", "<f8"),  # m^2, variance of multipath
    ],
    align=True,
)

ERROR_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("satellite", "<i8"),
        ("reference", "<i8"),
        ("system", "<i8"),
        ("signal", "<i8"),
        ("x", "<f8", STATES),  # m, m/s, m/s^2, m
        ("sigma", "<f8", STATES),
        ("innovation", "<f8"),  # m, NaN where a filter begins
        ("innovation_sigma", "<f8"),  # m
    ],
    align=True,
)

FILTER_DTYPE: Final = np.dtype(
    [
        ("satellite", "<i8"),  # dense number, or minus one: over
        ("reference", "<i8"),
        ("system", "<i8"),
        ("signal", "<i8"),
        ("used_t", "<i8"),  # ns, its last residual
        ("rejected", "<i8"),  # residuals in a row
        ("multipath", "<f8"),  # m^2, stationary variance
        ("x", "<f8", STATES),
        ("P", "<f8", (STATES, STATES)),
    ],
    align=True,
)


@njit(cache=True)
def motion_noise(q: float, T: float, Q: Array) -> None:
    """Covariance that white noise on the acceleration's derivative adds in a time.

    The exact integral of the triple integrator, so that two steps add what one of both
    times adds.

    Parameters
    ----------
    q : float, (m/s^2)/sqrt(s)
    T : float, s
    Q : float64 array (3, 3)
        Filled: error, rate, acceleration.
    """
    v = q * q
    T2 = T * T
    Q[0, 0] = v * T2 * T2 * T / 20.0
    Q[0, 1] = v * T2 * T2 / 8.0
    Q[0, 2] = v * T2 * T / 6.0
    Q[1, 1] = v * T2 * T / 3.0
    Q[1, 2] = v * T2 / 2.0
    Q[2, 2] = v * T
    Q[1, 0] = Q[0, 1]
    Q[2, 0] = Q[0, 2]
    Q[2, 1] = Q[1, 2]


@njit(cache=True)
def begin(f: Record, row: Record, cfg: Record) -> None:
    """What is believed of a double difference before its first residual."""
    f["satellite"] = row["satellite"]
    f["reference"] = row["reference"]
    f["system"] = row["system"]
    f["signal"] = row["signal"]
    f["rejected"] = 0
    f["multipath"] = row["multipath"]
    for i in range(STATES):
        f["x"][i] = 0.0
        for j in range(STATES):
            f["P"][i, j] = 0.0
    for i in range(3):
        f["P"][i, i] = cfg["sigma"][i] * cfg["sigma"][i]
    f["P"][_MULTIPATH, _MULTIPATH] = row["multipath"]


@njit(cache=True)
def predict(f: Record, Q: Array, T: float, fade: float) -> None:
    """Carry a filter over a time.

    Parameters
    ----------
    f : record of FILTER_DTYPE
    Q : float64 array (3, 3)
        Of :func:`motion_noise`.
    T : float, s
    fade : float
        What is left of multipath, exp(-T / tau).
    """
    x, P = f["x"], f["P"]
    half = 0.5 * T * T
    x[0] += T * x[1] + half * x[2]
    x[1] += T * x[2]
    x[_MULTIPATH] *= fade
    for j in range(STATES):
        P[0, j] += T * P[1, j] + half * P[2, j]
        P[1, j] += T * P[2, j]
        P[_MULTIPATH, j] *= fade
    for i in range(STATES):
        P[i, 0] += T * P[i, 1] + half * P[i, 2]
        P[i, 1] += T * P[i, 2]
        P[i, _MULTIPATH] *= fade
    for i in range(3):
        for j in range(3):
            P[i, j] += Q[i, j]
    P[_MULTIPATH, _MULTIPATH] += f["multipath"] * (1.0 - fade * fade)
    # Rows and columns are summed in different orders: one triangle serves.
    for i in range(STATES):
        for j in range(i):
            P[i, j] = P[j, i]


@njit(cache=True)
def follow(filters: Array, count: int, system: int, signal: int, reference: int) -> None:
    """Carry the filters of a system's signal over to another reference satellite.

    Parameters
    ----------
    filters : array of FILTER_DTYPE
        All at one time. The filter of the new reference becomes that of the old one; filters
        that cannot follow, because the new reference has none, are over.
    count : int
    system, signal, reference : int
    """
    bridge = -1
    for i in range(count):
        f = filters[i]
        if f["system"] != system or f["signal"] != signal or f["reference"] == reference:
            continue
        if f["satellite"] == reference:
            bridge = i
    for i in range(count):
        f = filters[i]
        if f["system"] != system or f["signal"] != signal or f["reference"] == reference:
            continue
        if i == bridge:
            continue
        if bridge < 0 or f["reference"] != filters[bridge]["reference"]:
            f["satellite"] = -1
            continue
        for a in range(STATES):
            f["x"][a] -= filters[bridge]["x"][a]
            for b in range(STATES):
                f["P"][a, b] += filters[bridge]["P"][a, b]
        f["reference"] = reference
    if bridge >= 0:
        f = filters[bridge]
        f["satellite"] = f["reference"]
        f["reference"] = reference
        f["rejected"] = 0
        for a in range(STATES):
            f["x"][a] = -f["x"][a]


@njit(cache=True)
def _find(filters: Array, count: int, row: Record) -> int:
    """The filter of a residual, or minus one."""
    for i in range(count):
        f = filters[i]
        if (
            f["satellite"] == row["satellite"]
            and f["signal"] == row["signal"]
            and f["reference"] == row["reference"]
        ):
            return i
    return -1


@njit(cache=True)
def _update(f: Record, row: Record, dx: Array, h: Array, index: Array, b: Array, k: Array) -> None:
    """Use a residual."""
    sigma = sqrt(row["noise"])
    for i in range(STATES):
        dx[i] = 0.0
    h[0] = 1.0 / sigma
    h[1] = h[0]
    z = (row["z"] - f["x"][0] - f["x"][_MULTIPATH]) / sigma
    scalar_update(f["P"], STATES, h, index, 2, z, dx, b, k)
    for i in range(STATES):
        f["x"][i] += dx[i]


@njit(cache=True)
def _usable(row: Record) -> bool:
    z, noise, multipath = row["z"], row["noise"], row["multipath"]
    return z - z == 0.0 and noise > 0.0 and noise - noise == 0.0 and multipath - multipath == 0.0


@njit(cache=True)
def _drop_ended(filters: Array, count: int, t: int, gap: int) -> int:
    """Close the ranks of the filters; how many are left."""
    left = 0
    for i in range(count):
        if filters[i]["satellite"] < 0 or t - filters[i]["used_t"] > gap:
            continue
        if left != i:
            filters[left] = filters[i]
        left += 1
    return left


@njit(cache=True)
def run_errors(
    filters: Array, count: int, last_t: int, cfg: Record, rows: Array, out: Array
) -> tuple[int, int, int]:
    """Take residuals, epoch after epoch.

    Parameters
    ----------
    filters : array of FILTER_DTYPE
        Those in use first; room for one more per row.
    count : int
        Filters in use.
    last_t : int, ns
        Last epoch, to which all filters are predicted; minus one before the first. Epochs
        that are not later are passed over.
    cfg : record of ERRORS_CONFIG_DTYPE
    rows : array of RESIDUAL_ROW_DTYPE
        In the order of log time, valid time, satellite and signal.
    out : array of ERROR_ROW_DTYPE
        Filled; room for one per row.

    Returns
    -------
    tuple of three ints
        Filters in use, last epoch (ns), rows of `out`.
    """
    n = rows.shape[0]
    Q = np.zeros((3, 3))
    dx, b, gain = np.zeros(STATES), np.zeros(STATES), np.zeros(STATES)
    h = np.zeros(2)
    index = np.array([0, _MULTIPATH])
    written = 0
    first = 0
    while first < n:
        t = rows[first]["t"]
        end = first
        while end < n and rows[end]["t"] == t and rows[end]["log_t"] == rows[first]["log_t"]:
            end += 1
        if last_t >= 0 and t <= last_t:
            first = end
            continue
        count = _drop_ended(filters, count, t, cfg["gap"])
        if last_t >= 0:
            T = (t - last_t) * _NS
            motion_noise(cfg["noise"], T, Q)
            fade = exp(-T / cfg["tau"])
            for i in range(count):
                predict(filters[i], Q, T, fade)
        last_t = t
        for r in range(first, end):
            row = rows[r]
            known = False
            for p in range(first, r):
                if rows[p]["system"] == row["system"] and rows[p]["signal"] == row["signal"]:
                    known = True
            # The first row of a system's signal says what all are differences to.
            if not known:
                follow(filters, count, row["system"], row["signal"], row["reference"])
        for r in range(first, end):
            row = rows[r]
            if not _usable(row):
                continue
            place = _find(filters, count, row)
            fresh = place < 0
            if fresh:
                place = count
                count += 1
            f = filters[place]
            innovation, spread = _NAN, _NAN
            use = True
            if not fresh:
                f["multipath"] = row["multipath"]
                P = f["P"]
                innovation = row["z"] - f["x"][0] - f["x"][_MULTIPATH]
                spread = sqrt(P[0, 0] + 2.0 * P[0, _MULTIPATH] + P[_MULTIPATH, _MULTIPATH]
                              + row["noise"])  # fmt: skip
                far = abs(innovation) > cfg["gate"] * spread
                if cfg["gate"] > 0.0 and far:
                    f["rejected"] += 1
                    use = False
                    fresh = f["rejected"] >= cfg["rejections"]
                else:
                    f["rejected"] = 0
            if fresh:
                begin(f, row, cfg)
                innovation, spread = _NAN, _NAN
                use = True
            f["used_t"] = t
            if use:
                _update(f, row, dx, h, index, b, gain)
            result = out[written]
            written += 1
            result["t"] = t
            result["log_t"] = row["log_t"]
            result["satellite"] = row["satellite"]
            result["reference"] = row["reference"]
            result["system"] = row["system"]
            result["signal"] = row["signal"]
            result["innovation"] = innovation
            result["innovation_sigma"] = spread
            for i in range(STATES):
                result["x"][i] = f["x"][i]
                result["sigma"][i] = sqrt(f["P"][i, i])
        first = end
    return count, last_t, written
