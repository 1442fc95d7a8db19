"""The tightly coupled GNSS/INS filter over a block of rows.

The inertial part, its alignment and its constraints are those of the loosely coupled
filter; the satellites of an epoch are used one by one, so that three of them are still
worth something. One call takes the inertial samples and epochs of a block; cutting the
rows into other blocks changes no bit.
"""

from typing import Any

import numpy as np
from numba import njit

from replay.kernels.alignment import align_fix
from replay.kernels.antenna_measures import antenna
from replay.kernels.covariance import POSITION, VELOCITY
from replay.kernels.dilution import dilutions
from replay.kernels.earth import enu_axes, local_covariance
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SYSTEMS
from replay.kernels.inertial_samples import (
    ALIGNING,
    NOTE_FIX,
    SKIPPED,
    arrive,
    begin_sample,
    end_outage,
    end_sample,
    refuse_early,
    refuse_late,
    set_out,
)
from replay.kernels.output_rows import close_inertial, emit_epoch, emit_solution, name_extras
from replay.kernels.prediction import remove_sensor_errors
from replay.kernels.records import (
    EVENT_REJECTED,
    EVENT_RESET,
    FIX_DTYPE,
    RUNNING,
    STATUS_PREDICTED,
    STATUS_UPDATED,
)
from replay.kernels.single_records import SINGLE_STATE_DTYPE
from replay.kernels.single_solve import solve_epoch, solve_velocity, true_time
from replay.kernels.tight_phases import remember, use_phase_changes
from replay.kernels.tight_records import CLOCK, DRIFT, PHASE_EXTRA, PLAIN_EXTRA
from replay.kernels.tight_update import meet_clocks, use_codes, use_dopplers
from replay.kernels.transition import OWN, begin_trail, carry_rate
from replay.kernels.types import Array, Record
from replay.kernels.update import record_event, state_count, total_count

EVENT_CLOCK_JUMP = 21
_NAN = float("nan")
_EARTH_M = 6378137.0


@njit(cache=True)
def carry_clocks(s: Record, g: Record, cfg: Record, tcfg: Record, trail: Record) -> None:
    """Carry the clocks and the drift to the filter's time."""
    dt = (s["t"] - g["clock_t"]) * 1e-9
    g["clock_t"] = s["t"]
    if dt <= 0.0:
        return
    P, n, first, aux = s["P"], total_count(s, cfg), state_count(cfg), s["aux"]
    b = first + DRIFT
    for k in range(SYSTEMS):
        a = first + CLOCK + k
        aux[CLOCK + k] += dt * aux[DRIFT]
        for j in range(n):
            P[a, j] += dt * P[b, j]
    for k in range(SYSTEMS):
        a = first + CLOCK + k
        for j in range(n):
            P[j, a] += dt * P[j, b]
    # One oscillator drives all clocks: its noise is common to them.
    white = tcfg["clock_noise"] * dt + tcfg["drift_noise"] * dt * dt * dt / 3.0
    ramp = tcfg["drift_noise"] * dt * dt / 2.0
    for k in range(SYSTEMS):
        a = first + CLOCK + k
        for m in range(k, SYSTEMS):
            P[a, first + CLOCK + m] += white
        P[a, a] += 1e-6 * dt
        P[a, b] += ramp
        P[b, a] = P[a, b]
        for j in range(n):
            P[j, a] = P[a, j]
    P[b, b] += tcfg["drift_noise"] * dt
    if trail["on"] == 1:
        for k in range(SYSTEMS):
            carry_rate(trail, first + CLOCK + k, b, dt)


@njit(cache=True)
def epoch_time(s: Record, g: Record, epoch: Record) -> int:
    """True time (ns) of an epoch by the filter's clock, or by the coarse one before it has one."""
    aux = s["aux"]
    for k in range(SYSTEMS):
        if g["known"][k] == 1:
            dt = (epoch["t"] - g["clock_t"]) * 1e-9
            expected = aux[CLOCK + k] + dt * aux[DRIFT]
            # A receiver that has set its clock since says so in the coarse position.
            set_anew = epoch["placed"] == 1 and epoch["age"] == 0.0
            if set_anew and abs(epoch["clock"] - expected) > 3000.0:
                return true_time(epoch["t"], epoch["clock"])
            return true_time(epoch["t"], expected)
    return true_time(epoch["t"], epoch["clock"] if epoch["placed"] == 1 else 0.0)


@njit(cache=True)
def single_fix(
    s: Record,
    tcfg: Record,
    epoch: Record,
    rows: Array,
    fix: Record,
    solve: Record,
    work: tuple[Any, ...],
) -> bool:
    """A single-point solution as a fix that the alignment can take."""
    state, observed, variance, weight, dropped, u, v = work
    p = state[0]
    for i in range(3):
        p["x"][i] = epoch["x"][i] if epoch["placed"] == 1 else 0.0
    for k in range(SYSTEMS):
        p["clock"][k] = epoch["clock"] if epoch["placed"] == 1 else 0.0
    status = solve_epoch(rows, p, tcfg["single"], solve, observed, variance, weight, dropped, u)
    if status < 0:
        return False
    enu_axes(p["x"][0], p["x"][1], p["x"][2], solve["axes"])
    clock = 0.0
    for k in range(SYSTEMS - 1, -1, -1):
        if solve["column"][k] > 0:
            clock = p["clock"][k]
    N, axes = solve["N"], solve["axes"]
    local_covariance(axes, N, fix["R"])
    fix["t"] = true_time(epoch["t"], clock)
    fix["log_t"] = epoch["log_t"]
    drift = solve_velocity(rows, weight, tcfg["single"], p, solve, v, u)
    fix["has_v"] = 1 if drift == drift else 0
    for i in range(3):
        fix["r"][i] = p["x"][i]
        fix["lever"][i] = tcfg["lever"][i]
        fix["v"][i] = v[i]
    return True


@njit(cache=True)
def _begin(s: Record, g: Record, cfg: Record, tcfg: Record, work: Record) -> None:
    """Room for the clocks and, with phases, for the clone."""
    s["extra"] = PHASE_EXTRA if tcfg["phase"] == 1 else PLAIN_EXTRA
    P, aux = s["P"], s["aux"]
    first, n = state_count(cfg), total_count(s, cfg)
    for k in range(first, n):
        aux[k - first] = 0.0
        for j in range(n):
            P[k, j] = 0.0
            P[j, k] = 0.0
    for k in range(SYSTEMS):
        P[first + CLOCK + k, first + CLOCK + k] = 1e6
        g["known"][k] = 0
    P[first + DRIFT, first + DRIFT] = 1e4
    g["drift_known"] = 0
    g["clock_t"] = s["t"]
    g["clone_t"] = -1
    g["epoch_t"] = -1
    g["refused"] = 0
    begin_trail(work["trail"])
    name_extras(s, cfg, work)


@njit(cache=True)
def _doubt(s: Record, g: Record, cfg: Record, work: Record) -> None:
    """Widen position and velocity, and forget the clocks: the ranges were refused too often."""
    P = s["P"]
    for i in range(3):
        P[POSITION + i, POSITION + i] += 1e4
        P[VELOCITY + i, VELOCITY + i] += 1e2
    for k in range(SYSTEMS):
        g["known"][k] = 0
    g["drift_known"] = 0
    g["clone_t"] = -1


@njit(cache=True)
def _emit_satellites(
    s: Record,
    g: Record,
    cfg: Record,
    epoch: Record,
    rows: Array,
    weight: Array,
    x: Array,
    u: Array,
    solve: Record,
    out: Record,
) -> None:
    """Clocks and geometry of an epoch, as a record of SINGLE_ROW_DTYPE."""
    out["t"] = s["t"]
    out["epoch_t"] = epoch["t"]
    out["log_t"] = epoch["log_t"]
    P, first, aux = s["P"], state_count(cfg), s["aux"]
    for k in range(SYSTEMS):
        known = g["known"][k] == 1
        place = first + CLOCK + k
        out["clock"][k] = aux[CLOCK + k] if known else _NAN
        out["clock_std"][k] = sqrt(P[place, place]) if known else _NAN
    known = g["drift_known"] == 1
    out["drift"] = aux[DRIFT] if known else _NAN
    out["drift_std"] = sqrt(P[first + DRIFT, first + DRIFT]) if known else _NAN
    enu_axes(x[0], x[1], x[2], solve["axes"])
    dilutions(rows, weight, x, solve, u, out)


@njit(cache=True)
def use_epoch(
    s: Record,
    g: Record,
    cfg: Record,
    tcfg: Record,
    work: Record,
    epoch: Record,
    rows: Array,
    solve: Record,
    room: tuple[Any, ...],
    log_t: int,
    out: tuple[Any, ...],
) -> None:
    """Update with the satellites of an epoch at the filter's own time."""
    solutions, states, covariances, _, events, counts, nodes, gnss, residuals, tally = out
    _, observed, scratch, weight, _, u, v = room
    x = observed[:3]
    first = tally[0]
    t = s["t"]
    remove_sensor_errors(s, work)
    carry_clocks(s, g, cfg, tcfg, work["trail"])
    for k in range(rows.shape[0]):
        weight[k] = 0.0
    force = tcfg["rejections"] > 0 and g["refused"] >= tcfg["rejections"]
    if force:
        _doubt(s, g, cfg, work)
        record_event(events, counts, t, log_t, EVENT_RESET, float(g["refused"]), NOTE_FIX)
        g["refused"] = 0
    used, offered = 0, 0
    antenna(s, work, tcfg["lever"], x, v)
    if tcfg["code"] == 1:
        shift = meet_clocks(s, g, cfg, tcfg, rows, x, u, scratch, work["trail"])
        if shift != 0.0:
            record_event(events, counts, t, log_t, EVENT_CLOCK_JUMP, shift, NOTE_FIX)
        offered = use_codes(s, g, cfg, tcfg, work, epoch, rows, weight, x, u, residuals, tally)
        for k in range(rows.shape[0]):
            if weight[k] > 0.0:
                used += 1
    if tcfg["doppler"] == 1:
        antenna(s, work, tcfg["lever"], x, v)
        use_dopplers(s, g, cfg, tcfg, work, epoch, rows, x, v, u, scratch, residuals, tally)
    if tcfg["phase"] == 1:
        antenna(s, work, tcfg["lever"], x, v)
        phases = use_phase_changes(
            s, g, cfg, tcfg, work, epoch, rows, x, u, scratch, residuals, tally
        )
        if tcfg["code"] == 0:
            used = phases
        antenna(s, work, tcfg["lever"], x, v)
    status = STATUS_UPDATED if used > 0 else STATUS_PREDICTED
    if work["trail"]["on"] == 1:
        close_inertial(s, cfg, work, log_t, OWN, nodes)
    if tcfg["phase"] == 1:
        remember(s, g, cfg, tcfg, work, epoch, rows, x)
    if offered >= 4 and 4 * used < offered:
        g["refused"] += 1
        record_event(events, counts, t, log_t, EVENT_REJECTED, float(g["refused"]), NOTE_FIX)
    else:
        g["refused"] = 0
    if used > 0:
        end_outage(s, t, log_t, events, counts)
    # What is said of the epoch was known when the sample after it came, not before.
    for k in range(first, tally[0]):
        residuals[k]["log_t"] = log_t
    _emit_satellites(s, g, cfg, epoch, rows, weight, x, u, solve, gnss[tally[1]])
    gnss[tally[1]]["log_t"] = log_t
    tally[1] += 1
    emit_solution(s, work, status, log_t, solutions, counts)
    emit_epoch(s, cfg, log_t, states, covariances, counts)


@njit(cache=True)
def _take_epochs(
    s: Record,
    g: Record,
    cfg: Record,
    tcfg: Record,
    work: Record,
    epochs: Array,
    rows: Array,
    first: int,
    t: int,
    log_t: int,
    fix: Record,
    solve: Record,
    room: tuple[Any, ...],
    out: tuple[Any, ...],
) -> int:
    """Use every epoch up to an inertial sample at `t`; the number of the next one."""
    events, counts = out[4], out[5]
    k = first
    early = 0
    while k < epochs.shape[0] and epochs[k]["log_t"] <= log_t:
        epoch = epochs[k]
        at = epoch_time(s, g, epoch)
        if at > t:
            break
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        k += 1
        if s["mode"] != RUNNING:
            if not single_fix(s, tcfg, epoch, part, fix, solve, room):
                continue
            if fix["t"] < s["imu_t"]:
                early += 1
            elif align_fix(s, cfg, work, fix, log_t, events, counts):
                set_out(s, fix)
                _begin(s, g, cfg, tcfg, work)
                use_epoch(s, g, cfg, tcfg, work, epoch, part, solve, room, log_t, out)
            continue
        if at < s["t"]:
            refuse_late(s, at, epoch["t"], log_t, events, counts)
            continue
        arrive(s, cfg, work, at, log_t, out)
        use_epoch(s, g, cfg, tcfg, work, epoch, part, solve, room, log_t, out)
    refuse_early(early, t, log_t, events, counts)
    return k


@njit(cache=True)
def run_tight(
    state: Array,
    tight_state: Array,
    config: Array,
    tight_config: Array,
    scratch: Array,
    solve_scratch: Array,
    imu_t: Array,
    imu_log_t: Array,
    imu_w: Array,
    imu_f: Array,
    epochs: Array,
    rows: Array,
    out: tuple[Any, ...],
) -> int:
    """Carry the filter over a block.

    Parameters
    ----------
    state, tight_state : arrays of one record each
        Of `state_dtype(TIGHT_STATES)` and TIGHT_STATE_DTYPE; changed in place.
    config, tight_config : arrays of one CONFIG_DTYPE, one TIGHT_CONFIG_DTYPE
    scratch, solve_scratch : arrays of one `work_dtype(TIGHT_STATES)`, one SOLVE_DTYPE
    imu_t, imu_log_t : int64 arrays (n,), ns
        Valid times and times of availability.
    imu_w, imu_f : float64 arrays (n, 3), rad/s and m/s^2
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
        In the order of their availability.
    out : tuple of arrays
        Solutions, epochs, covariances, innovations, events and counts as
        :func:`replay.kernels.loose.run_block` fills them; nodes; clocks and geometry
        (SINGLE_ROW_DTYPE); innovations of satellites (RESIDUAL_DTYPE); int64 (2,): rows
        of the last two in the order satellites, clocks.

    Returns
    -------
    int
        How many of the epochs were taken; the others wait for later samples.
    """
    s, g, cfg, tcfg = state[0], tight_state[0], config[0], tight_config[0]
    work, solve = scratch[0], solve_scratch[0]
    # What a step leaves in the scratch must not depend on where the block was cut.
    work["decay_dt"] = -1.0
    fix = np.zeros(1, dtype=FIX_DTYPE)[0]
    room = (
        np.zeros(1, dtype=SINGLE_STATE_DTYPE),
        np.zeros(SATELLITES),
        np.zeros(3 * SATELLITES),
        np.zeros(SATELLITES),
        np.zeros(SATELLITES, dtype=np.int64),
        np.zeros(3),
        np.zeros(3),
    )
    taken = 0
    for k in range(imu_t.shape[0]):
        state_of = begin_sample(s, cfg, work, imu_t[k], imu_log_t[k], imu_w[k], imu_f[k], out)
        if state_of == SKIPPED:
            continue
        taken = _take_epochs(
            s, g, cfg, tcfg, work, epochs, rows, taken, imu_t[k], imu_log_t[k], fix, solve, room,
            out,
        )  # fmt: skip
        end_sample(s, cfg, work, imu_t[k], imu_log_t[k], state_of == ALIGNING, out)
    return taken
