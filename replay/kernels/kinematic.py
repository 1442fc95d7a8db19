"""Filtered single-point positioning: constant velocity, clocks with drift, code and Doppler.

States are position, velocity (ECEF) and, for each of the five systems, receiver clock
and drift (m, m/s). Tang et al. (2021), eqs 6 to 9, has ten of them for two systems.
"""

from typing import Any, Final

import numpy as np
from numba import njit

from replay.kernels.dilution import dilutions
from replay.kernels.earth import enu_axes, local_covariance
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SYSTEMS
from replay.kernels.kalman import scalar_update
from replay.kernels.least_squares import geometric_range, reduced_code
from replay.kernels.notes import note_epoch
from replay.kernels.single_records import KIND_DOPPLER, KIND_PSEUDORANGE, SINGLE_CONFIG_DTYPE
from replay.kernels.single_solve import (
    free_code,
    free_factor,
    predicted_range_rate,
    true_time,
    usable,
)
from replay.kernels.transition import (
    OWN,
    SILENT,
    add_correction,
    begin_trail,
    carry_rate,
    close_node,
    forget,
    open_node,
)
from replay.kernels.types import Array, Record
from replay.kernels.weighting import code_variance, noise_factor

STATES: Final = 6 + 2 * SYSTEMS
_CLOCK: Final = 6
_DRIFT: Final = 6 + SYSTEMS

KINEMATIC_CONFIG_DTYPE: Final = np.dtype(
    [
        ("single", SINGLE_CONFIG_DTYPE),
        ("velocity_noise", "<f8"),  # m^2/s^3, spectral density of acceleration
        ("clock_noise", "<f8"),  # m^2/s
        ("drift_noise", "<f8"),  # m^2/s^3
        ("gate", "<f8"),  # innovation over its deviation
        ("gap", "<f8"),  # s after which it begins anew
        ("jump", "<f8"),  # m by which a clock has jumped
        ("rejections", "<i8"),  # epochs in a row, most of whose ranges are rejected
    ],
    align=True,
)

KINEMATIC_STATE_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns, true time of the state; minus one before the first
        ("x", "<f8", STATES),
        ("P", "<f8", (STATES, STATES)),
        ("known", "<i8", SYSTEMS),  # whether a system's clock has been met
        ("rejected", "<i8"),
    ],
    align=True,
)

EVENT_CLOCK_JUMP: Final = 21
EVENT_RESET: Final = 11
EVENT_TIME_BACKWARD: Final = 9
EVENT_TOO_FEW: Final = 14
_WIDE_M2: Final = 1e8
_WIDE_DRIFT_M2_S2: Final = 1e6
_NAN = float("nan")
_NOTES = 2  # in `counts`


@njit(cache=True)
def begin(s: Record, epoch: Record) -> None:
    """Position and clock from the coarse ones, at rest, all uncertain."""
    for i in range(STATES):
        s["x"][i] = 0.0
        for j in range(STATES):
            s["P"][i, j] = 0.0
    for i in range(3):
        s["x"][i] = epoch["x"][i]
        s["P"][i, i] = 1e4
        s["P"][3 + i, 3 + i] = 1e4
    for k in range(SYSTEMS):
        s["known"][k] = 0
        s["x"][_CLOCK + k] = epoch["clock"]
        s["P"][_CLOCK + k, _CLOCK + k] = _WIDE_M2
        s["P"][_DRIFT + k, _DRIFT + k] = _WIDE_DRIFT_M2_S2
    s["rejected"] = 0


@njit(cache=True)
def meet(s: Record, system: int, clock: float, trail: Record) -> None:
    """First range of a system: its clock (m) begins there, as uncertain as at the start.

    What prediction has made of a clock that nothing measured would swamp the rounding.
    """
    s["known"][system] = 1
    s["x"][_CLOCK + system] = clock
    s["x"][_DRIFT + system] = 0.0
    P = s["P"]
    for a in (_CLOCK + system, _DRIFT + system):
        for j in range(STATES):
            P[a, j] = 0.0
            P[j, a] = 0.0
    P[_CLOCK + system, _CLOCK + system] = _WIDE_M2
    P[_DRIFT + system, _DRIFT + system] = _WIDE_DRIFT_M2_S2
    if trail["on"] == 1:
        forget(trail, _CLOCK + system, _WIDE_M2)
        forget(trail, _DRIFT + system, _WIDE_DRIFT_M2_S2)


@njit(cache=True)
def predict(s: Record, cfg: Record, dt: float, trail: Record) -> None:
    """Carry state and covariance over `dt` (s): constant velocity, constant drift."""
    x, P = s["x"], s["P"]
    for i in range(3):
        _pair(x, P, i, 3 + i, dt, 0.0, cfg["velocity_noise"])
    for k in range(SYSTEMS):
        _pair(x, P, _CLOCK + k, _DRIFT + k, dt, cfg["clock_noise"], cfg["drift_noise"])
    if trail["on"] == 1:
        for i in range(3):
            carry_rate(trail, i, 3 + i, dt)
        for k in range(SYSTEMS):
            carry_rate(trail, _CLOCK + k, _DRIFT + k, dt)


@njit(cache=True)
def _pair(x: Array, P: Array, a: int, b: int, dt: float, first: float, second: float) -> None:
    """Value `a` with rate `b`: Phi P Phi' and white noise on the value and on the rate."""
    x[a] += dt * x[b]
    for j in range(STATES):
        P[a, j] += dt * P[b, j]
    for j in range(STATES):
        P[j, a] += dt * P[j, b]
    P[a, a] += first * dt + second * dt * dt * dt / 3.0
    P[a, b] += second * dt * dt / 2.0
    P[b, a] = P[a, b]
    P[b, b] += second * dt


@njit(cache=True)
def _use(
    s: Record,
    count: int,
    z: float,
    variance: float,
    gate: float,
    h: Array,
    index: Array,
    scratch: Array,
    out: Record,
    trail: Record,
) -> bool:
    """One scalar measurement: gate, update, and what is to be said of it."""
    P, x = s["P"], s["x"]
    total = variance
    for a in range(count):
        for b in range(count):
            total += h[a] * P[index[a], index[b]] * h[b]
    deviation = sqrt(total)
    out["z"] = z
    out["s"] = deviation
    out["r"] = sqrt(variance)
    accepted = gate <= 0.0 or abs(z) <= gate * deviation
    out["accepted"] = 1 if accepted else 0
    if not accepted:
        return False
    inverse = 1.0 / sqrt(variance)
    for a in range(count):
        h[a] *= inverse
    dx = scratch[0]
    for i in range(STATES):
        dx[i] = 0.0
    scalar_update(P, STATES, h, index, count, z * inverse, dx, scratch[1], scratch[2])
    for i in range(STATES):
        x[i] += dx[i]
    if trail["on"] == 1:
        add_correction(trail, dx, STATES)
    return True


@njit(cache=True)
def _describe(out: Record, epoch: Record, row: Record, kind: int) -> None:
    out["t"] = epoch["t"]
    out["log_t"] = epoch["log_t"]
    out["kind"] = kind
    out["satellite"] = row["satellite"]
    out["signal"] = row["signal"][0]


@njit(cache=True)
def update_epoch(
    s: Record,
    cfg: Record,
    epoch: Record,
    rows: Array,
    weight: Array,
    innovations: Array,
    counts: Array,
    u: Array,
    h: Array,
    index: Array,
    scratch: Array,
    trail: Record,
) -> int:
    """Use an epoch's ranges and range rates; how many ranges were believed.

    `weight` (n,) becomes 1 for a satellite whose range was used.
    """
    single = cfg["single"]
    x = s["x"]
    used, offered = 0, 0
    if trail["on"] == 1:
        open_node(trail, s["P"], STATES)
    for k in range(rows.shape[0]):
        row = rows[k]
        weight[k] = 0.0
        if not usable(row, single):
            continue
        system = row["system"]
        sigma = single["code_sigma"] * single["system_scale"][system]
        if single["free"] == 1:
            z = free_code(row)
            sigma *= sqrt(free_factor(row))
        else:
            z = reduced_code(row, 0)
        if z != z:
            continue
        z -= geometric_range(row, x[:3], u)
        if s["known"][system] == 0:
            meet(s, system, z, trail)
        for i in range(3):
            h[i] = -u[i]
            index[i] = i
        h[3] = 1.0
        index[3] = _CLOCK + system
        variance = code_variance(row, 0, sigma, single["weight"])
        out = innovations[counts[1]]
        counts[1] += 1
        offered += 1
        _describe(out, epoch, row, KIND_PSEUDORANGE)
        z -= x[_CLOCK + system]
        if _use(s, 4, z, variance, cfg["gate"], h, index, scratch, out, trail):
            weight[k] = 1.0
            used += 1
    for k in range(rows.shape[0]):
        row = rows[k]
        rate = row["range_rate"][0]
        if not usable(row, single) or rate != rate or single["velocity"] == 0:
            continue
        system = row["system"]
        z = rate + row["drift"] - predicted_range_rate(row, x[:3], x[3:6], u) - x[_DRIFT + system]
        for i in range(3):
            h[i] = -u[i]
            index[i] = 3 + i
        h[3] = 1.0
        index[3] = _DRIFT + system
        sigma = single["doppler_sigma"]
        model = single["weight"]["model"]
        variance = sigma * sigma * noise_factor(model, row["elevation"], row["cn0"][0])
        out = innovations[counts[1]]
        counts[1] += 1
        _describe(out, epoch, row, KIND_DOPPLER)
        _use(s, 4, z, variance, cfg["gate"], h, index, scratch, out, trail)
    if offered >= 4 and 2 * used < offered:
        s["rejected"] += 1
    else:
        s["rejected"] = 0
    return used


@njit(cache=True)
def emit(s: Record, epoch: Record, reference: int, axes: Array, out: Record) -> None:
    """One solution: position, velocity, clocks and their uncertainty."""
    x, P = s["x"], s["P"]
    out["epoch_t"] = epoch["t"]
    out["t"] = s["t"]
    out["log_t"] = epoch["log_t"]
    enu_axes(x[0], x[1], x[2], axes)
    local_covariance(axes, P, out["cov"])
    for a in range(3):
        out["r"][a] = x[a]
        v, spread = 0.0, 0.0
        for i in range(3):
            v += axes[a, i] * x[3 + i]
            for j in range(3):
                spread += axes[a, i] * P[3 + i, 3 + j] * axes[a, j]
        out["v_enu"][a] = v
        out["v_std"][a] = sqrt(spread)
    out["has_v"] = 1
    for k in range(SYSTEMS):
        known = s["known"][k] == 1
        out["clock"][k] = x[_CLOCK + k] if known else _NAN
        out["clock_std"][k] = sqrt(P[_CLOCK + k, _CLOCK + k]) if known else _NAN
    out["drift"] = x[_DRIFT + reference]
    out["drift_std"] = sqrt(P[_DRIFT + reference, _DRIFT + reference])


@njit(cache=True)
def prepare(
    s: Record, cfg: Record, epoch: Record, notes: Array, counts: Array, trail: Record
) -> bool:
    """Bring the state to an epoch, anew after a gap; False where there is nothing to begin with."""
    reference = first_known(s)
    placed = epoch["placed"] == 1 and epoch["age"] == 0.0
    if reference >= 0 and s["t"] >= 0:
        clock, drift = s["x"][_CLOCK + reference], s["x"][_DRIFT + reference]
        dt = (true_time(epoch["t"], clock) - s["t"]) * 1e-9
        expected = clock + drift * dt
        if placed and abs(epoch["clock"] - expected) > cfg["jump"]:
            # The receiver set its clock: all systems' clocks move by as much.
            step = epoch["clock"] - expected
            note_epoch(notes, counts, _NOTES, epoch, EVENT_CLOCK_JUMP, -1, step)
            for k in range(SYSTEMS):
                s["x"][_CLOCK + k] += step
                s["P"][_CLOCK + k, _CLOCK + k] += 1e4
            expected = epoch["clock"]
        now = true_time(epoch["t"], expected)
        dt = (now - s["t"]) * 1e-9
        if 0.0 < dt <= cfg["gap"] and s["rejected"] < cfg["rejections"]:
            predict(s, cfg, dt, trail)
            s["t"] = now
            return True
        if -cfg["gap"] <= dt <= 0.0:
            note_epoch(notes, counts, _NOTES, epoch, EVENT_TIME_BACKWARD, -1, dt)
            return False
        if placed:
            note_epoch(notes, counts, _NOTES, epoch, EVENT_RESET, -1, dt)
    if not placed:
        note_epoch(notes, counts, _NOTES, epoch, EVENT_TOO_FEW, -1, float(epoch["used"]))
        return False
    begin(s, epoch)
    begin_trail(trail)
    s["t"] = true_time(epoch["t"], epoch["clock"])
    return True


@njit(cache=True)
def first_known(s: Record) -> int:
    """The first system whose clock is known, or minus one."""
    for k in range(SYSTEMS):
        if s["known"][k] == 1:
            return k
    return -1


@njit(cache=True)
def run_kinematic(
    state: Array,
    config: Array,
    epochs: Array,
    rows: Array,
    scratch_solve: Array,
    solutions: Array,
    innovations: Array,
    notes: Array,
    counts: Array,
    trails: Array,
    nodes: tuple[Any, ...],
) -> None:
    """Carry the filter over the epochs of a block.

    Parameters
    ----------
    state, config, scratch_solve : arrays of one record each
        KINEMATIC_STATE_DTYPE, KINEMATIC_CONFIG_DTYPE, SOLVE_DTYPE.
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
    solutions : array of SINGLE_ROW_DTYPE
        Room for one per epoch; `status` becomes the number of ranges used.
    innovations : array of RESIDUAL_DTYPE
        Room for two per row.
    notes : array of NOTE_DTYPE
        Room for two per epoch.
    counts : int64 array (3,)
        Filled: solutions, innovations, notes.
    trails : array of one `trail_dtype(STATES)`
        Changed where it is on.
    nodes : tuple
        As :func:`replay.kernels.transition.close_node` takes it.
    """
    s, cfg, work, trail = state[0], config[0], scratch_solve[0], trails[0]
    u, h = np.zeros(3), np.zeros(4)
    index = np.zeros(4, dtype=np.int64)
    scratch = np.zeros((3, STATES))
    weight = np.zeros(SATELLITES)
    for i in range(3):
        counts[i] = 0
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        if not prepare(s, cfg, epoch, notes, counts, trail):
            continue
        used = update_epoch(
            s, cfg, epoch, part, weight, innovations, counts, u, h, index, scratch, trail
        )
        reference = first_known(s)
        if trail["on"] == 1:
            for i in range(STATES):
                trail["estimate"][i] = s["x"][i]
                trail["name"][i] = i
            own = OWN if reference >= 0 else SILENT
            close_node(trail, s["P"], STATES, s["t"], epoch["log_t"], own, nodes)
        if reference >= 0:
            out = solutions[counts[0]]
            emit(s, epoch, reference, work["axes"], out)
            out["status"] = used
            dilutions(part, weight, s["x"][:3], work, u, out)
            counts[0] += 1
