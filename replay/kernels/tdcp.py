"""Time-differenced carrier phases: displacements, and positions chained from them.

Phase less everything that is modelled is range, receiver clock and a constant. Its change
since the last solved epoch, the reference, gives the displacement from there (Tang et al.
2021, eqs 10 to 13).
"""

import numpy as np
from numba import njit

from replay.kernels.dilution import dilutions
from replay.kernels.earth import enu_axes, local_covariance
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SLOTS, SYSTEMS
from replay.kernels.notes import note_epoch
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.single_records import EVENT_EXCLUDED
from replay.kernels.single_solve import true_time
from replay.kernels.slip_records import TIME_DIFFERENCE
from replay.kernels.slips import append_slip, detect_slips
from replay.kernels.tdcp_adjust import FOUND, PHASE_DTYPE, REPAIRED, USED
from replay.kernels.tdcp_difference import differences, refer
from replay.kernels.tdcp_records import (
    EVENT_CHAIN_BROKEN,
    EVENT_CLOCK_JUMP,
    EVENT_CYCLE_SLIP,
    EVENT_SLIP_REPAIRED,
    KIND_TIME_DIFFERENCED,
    STATUS_CHAINED,
    STATUS_PREDICTED,
    STATUS_SINGLE,
)
from replay.kernels.tdcp_solve import solve_displacement
from replay.kernels.types import Array, Record

_NOTES = 4  # in `counts`


@njit(cache=True)
def _emit_place(
    s: Record, epoch: Record, true_t: int, status: int, axes: Array, solutions: Array, counts: Array
) -> None:
    """Append the chain's place."""
    out = solutions[counts[0]]
    counts[0] += 1
    out["t"] = true_t
    out["epoch_t"] = epoch["t"]
    out["log_t"] = epoch["log_t"]
    out["has_v"] = 0
    out["status"] = status
    for i in range(3):
        out["r"][i] = s["place"][i]
    enu_axes(s["place"][0], s["place"][1], s["place"][2], axes)
    local_covariance(axes, s["P"], out["cov"])


@njit(cache=True)
def _begin(s: Record, cfg: Record, epoch: Record, true_t: int, axes: Array) -> None:
    """Begin a chain at the coarse position."""
    s["begin_t"] = true_t
    s["solved_t"] = true_t
    s["moving"] = 0
    for i in range(3):
        s["place"][i] = epoch["x"][i]
        s["x"][i] = epoch["x"][i]
    enu_axes(s["place"][0], s["place"][1], s["place"][2], axes)
    for i in range(3):
        for j in range(3):
            total = 0.0
            for a in range(3):
                sigma = cfg["initial_std"][a]
                total += axes[a, i] * axes[a, j] * sigma * sigma
            s["P"][i, j] = total


@njit(cache=True)
def _tell_phases(
    epoch: Record,
    rows: Array,
    phases: Array,
    cfg: Record,
    first_slip: int,
    residuals: Array,
    slips: Array,
    notes: Array,
    counts: Array,
    slip_count: Array,
) -> None:
    """Residuals of an epoch, its slips with their sizes, and what is worth an event."""
    for i in range(phases.shape[0]):
        p = phases[i]
        row = rows[p["row"]]
        sat, slot = row["satellite"], p["slot"]
        used = p["state"] == USED or p["state"] == REPAIRED
        out = residuals[counts[2]]
        counts[2] += 1
        out["t"] = epoch["t"]
        out["log_t"] = epoch["log_t"]
        out["kind"] = KIND_TIME_DIFFERENCED
        out["satellite"] = sat
        out["signal"] = row["signal"][slot]
        out["z"] = p["residual"]
        out["s"] = max(p["spread"], 1e-6)
        out["r"] = sqrt(p["variance"])
        out["accepted"] = 1 if used else 0
        if p["state"] == USED:
            continue
        known = False
        for k in range(first_slip, slip_count[0]):
            if slips[k]["satellite"] == sat and slips[k]["signal"] == row["signal"][slot]:
                slips[k]["size"] = p["taken"] if used else p["size"]
                slips[k]["repaired"] = 1 if used else 0
                known = True
        if not known:
            limit = cfg["gate"] * p["spread"] / p["wavelength"]
            size = p["taken"] if used else p["size"]
            append_slip(
                slips, slip_count, epoch, row, slot, TIME_DIFFERENCE, p["size"], limit, size
            )
            slips[slip_count[0] - 1]["repaired"] = 1 if used else 0
        if used:
            if p["taken"] != 0.0:
                note_epoch(notes, counts, _NOTES, epoch, EVENT_SLIP_REPAIRED, sat, p["taken"])
        elif p["state"] == FOUND:
            note_epoch(notes, counts, _NOTES, epoch, EVENT_EXCLUDED, sat, p["size"])
        else:
            note_epoch(notes, counts, _NOTES, epoch, EVENT_CYCLE_SLIP, sat, p["size"])


@njit(cache=True)
def _link(
    s: Record,
    cfg: Record,
    epoch: Record,
    rows: Array,
    true_t: int,
    scratch: tuple[Array, ...],
    work: Record,
    out: tuple[Array, ...],
    slip_count: Array,
    first_slip: int,
) -> int:
    """Try a displacement from the reference to this epoch; as `solve_displacement` answers."""
    phases, weight, x, clock, u, nought, buffer, kept, P = scratch
    solutions, displacements, residuals, slips, notes, counts = out
    dt = (true_t - s["true_t"]) * 1e-9
    count = differences(s, cfg, epoch, rows, dt, phases, nought, u)
    for i in range(3):
        x[i] = s["x"][i]
    for i in range(SYSTEMS):
        clock[i] = 0.0
    part = phases[:count]
    status, unit, freedom = solve_displacement(rows, part, cfg, x, clock, work, u, buffer, kept)
    if status < 0:
        return status
    # A contradiction that could not be traced is shared by all.
    scale = unit * unit if freedom > 0 and unit > cfg["unit_limit"] else 1.0
    for i in range(3):
        for j in range(3):
            P[i, j] = scale * work["N"][i, j]
    for k in range(rows.shape[0]):
        weight[k] = 0.0
    for i in range(count):
        if part[i]["weight"] > 0.0:
            weight[part[i]["row"]] = 1.0
    axes = work["axes"]
    enu_axes(x[0], x[1], x[2], axes)
    dilutions(rows, weight, x, work, u, solutions[counts[0]])
    if not solutions[counts[0]]["dop"][1] <= cfg["pdop"]:
        return -1
    out_d = displacements[counts[1]]
    out_d["t"] = true_t
    out_d["log_t"] = epoch["log_t"]
    out_d["since"] = s["true_t"]
    out_d["count"] = status
    out_d["unit"] = unit
    local_covariance(axes, P, out_d["cov"])
    for i in range(3):
        moved = x[i] - s["x"][i]
        out_d["d"][i] = moved
        s["place"][i] += moved
        s["v"][i] = moved / dt
        for j in range(3):
            s["P"][i, j] += P[i, j]
    _emit_place(s, epoch, true_t, STATUS_CHAINED, axes, solutions, counts)
    counts[1] += 1
    s["moving"] = 1
    s["solved_t"] = true_t
    _tell_phases(epoch, rows, part, cfg, first_slip, residuals, slips, notes, counts, slip_count)
    for i in range(3):
        s["x"][i] = epoch["x"][i] if epoch["age"] == 0.0 else x[i]
    return status


@njit(cache=True)
def _carry(s: Record, cfg: Record, true_t: int) -> bool:
    """Go on with the last velocity, where that is allowed for so long."""
    if s["moving"] == 0 or (true_t - s["solved_t"]) * 1e-9 > cfg["carry"]:
        return False
    dt = (true_t - s["true_t"]) * 1e-9
    sigma = 0.5 * cfg["carry_acceleration"] * dt * dt
    for i in range(3):
        s["place"][i] += s["v"][i] * dt
        s["P"][i, i] += sigma * sigma
    return True


@njit(cache=True)
def run_tdcp(
    state: Array,
    config: Array,
    slip_config: Array,
    epochs: Array,
    rows: Array,
    work_array: Array,
    solutions: Array,
    displacements: Array,
    residuals: Array,
    slips: Array,
    notes: Array,
    counts: Array,
) -> None:
    """Carry the chain over the epochs of a block.

    Parameters
    ----------
    state, config, slip_config, work_array : arrays of one record each
        TDCP_STATE_DTYPE, TDCP_CONFIG_DTYPE, SLIP_CONFIG_DTYPE, SOLVE_DTYPE.
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
    solutions, displacements : arrays of SINGLE_ROW_DTYPE and DISPLACEMENT_DTYPE
        Room for one per epoch, and one more.
    residuals : array of RESIDUAL_DTYPE
        Room for one per phase.
    slips : array of SLIP_ROW_DTYPE
        Room for five per phase.
    notes : array of NOTE_DTYPE
        Room for one per phase and two per epoch.
    counts : int64 array (5,)
        Filled: rows of the five.
    """
    s, cfg, slip_cfg, work = state[0], config[0], slip_config[0], work_array[0]
    phases = np.zeros(SATELLITES * SLOTS, dtype=PHASE_DTYPE)
    weight = np.zeros(SATELLITES)
    buffer = np.zeros(SATELLITES * SLOTS)
    x, clock, u, nought = np.zeros(3), np.zeros(SYSTEMS), np.zeros(3), np.zeros(3)
    kept = np.zeros(3 + SYSTEMS)
    broken = np.zeros((SATELLITES, SLOTS), dtype=np.int64)
    slip_count = np.zeros(1, dtype=np.int64)
    scratch = (phases, weight, x, clock, u, nought, buffer, kept, np.zeros((3, 3)))
    out = (solutions, displacements, residuals, slips, notes, counts)
    for i in range(5):
        counts[i] = 0
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        first_slip = slip_count[0]
        jump = detect_slips(s["slips"], slip_cfg, epoch, part, broken, slips, slip_count, buffer)
        if jump != 0.0:
            note_epoch(
                notes, counts, _NOTES, epoch, EVENT_CLOCK_JUMP, -1, jump / SPEED_OF_LIGHT_M_S * 1e3
            )
        _remember_breaks(s, part, broken)
        if epoch["placed"] == 0:
            continue
        true_t = true_time(epoch["t"], epoch["clock"])
        _step(s, cfg, epoch, part, true_t, scratch, work, out, slip_count, first_slip)
    counts[3] = slip_count[0]


@njit(cache=True)
def _remember_breaks(s: Record, rows: Array, broken: Array) -> None:
    """Add what broke at this epoch to what broke since the reference."""
    for k in range(rows.shape[0]):
        sat = rows[k]["satellite"]
        for slot in range(SLOTS):
            if broken[k, slot] > s["broken"][sat, slot]:
                s["broken"][sat, slot] = broken[k, slot]


@njit(cache=True)
def _step(
    s: Record,
    cfg: Record,
    epoch: Record,
    rows: Array,
    true_t: int,
    scratch: tuple[Array, ...],
    work: Record,
    out: tuple[Array, ...],
    slip_count: Array,
    first_slip: int,
) -> None:
    """One epoch: a link, a wait for the next one, a carry, or a new beginning."""
    u, nought = scratch[4], scratch[5]
    solutions, _, _, _, notes, counts = out
    axes = work["axes"]
    if s["t"] >= 0:
        if true_t <= s["true_t"]:
            return
        status = -1
        within = (true_t - s["true_t"]) * 1e-9 <= cfg["max_gap"]
        if within:
            status = _link(s, cfg, epoch, rows, true_t, scratch, work, out, slip_count, first_slip)
        if status >= 0:
            refer(s, epoch, rows, true_t, nought, u)
            return
        if status == -2 and within:
            # Phases that contradict each other now may agree at the next epoch.
            return
        if _carry(s, cfg, true_t):
            for i in range(3):
                s["x"][i] = epoch["x"][i] if epoch["age"] == 0.0 else s["place"][i]
            _emit_place(s, epoch, true_t, STATUS_PREDICTED, axes, solutions, counts)
            refer(s, epoch, rows, true_t, nought, u)
            return
        lasted = (s["solved_t"] - s["begin_t"]) * 1e-9
        note_epoch(notes, counts, _NOTES, epoch, EVENT_CHAIN_BROKEN, -1, lasted)
        s["t"] = -1
    if epoch["age"] != 0.0:
        return
    _begin(s, cfg, epoch, true_t, axes)
    _emit_place(s, epoch, true_t, STATUS_SINGLE, axes, solutions, counts)
    refer(s, epoch, rows, true_t, nought, u)
