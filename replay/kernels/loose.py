"""The loosely coupled GNSS/INS filter over a block of rows.

One call takes the inertial samples and fixes of a block and carries the state
record on; cutting the rows into other blocks changes no bit. An inertial interval
in which a fix lies is split at the fix's own time.
"""

from typing import Any

from numba import njit

from replay.kernels.alignment import align_fix
from replay.kernels.covariance import ATTITUDE, POSITION, VELOCITY
from replay.kernels.gnss_update import mark_epoch, position_update, velocity_update
from replay.kernels.inertial_samples import (
    ALIGNING,
    NOTE_FIX,
    SKIPPED,
    all_finite,
    arrive,
    begin_sample,
    end_outage,
    end_sample,
    refuse_early,
    refuse_late,
    set_out,
)
from replay.kernels.output_rows import close_inertial, emit_epoch, emit_solution
from replay.kernels.prediction import remove_sensor_errors
from replay.kernels.records import (
    EVENT_NOT_FINITE,
    EVENT_REJECTED,
    EVENT_RESET,
    RUNNING,
    STATUS_UPDATED,
)
from replay.kernels.tdcp_link import begin_chain, ready_to_align, use_link
from replay.kernels.transition import OWN, begin_trail
from replay.kernels.types import Array, Record
from replay.kernels.update import record_event


@njit(cache=True)
def _doubt(s: Record, cfg: Record, fix: Record) -> None:
    """Widen the covariance by what a fix that was refused again and again says.

    Without that the gain would be as small as the covariance that led to the refusals.
    """
    nav, P = s["nav"], s["P"]
    position = velocity = 0.0
    for i in range(3):
        d = fix["r"][i] - nav["r"][i]
        position += d * d
        if fix["has_v"] == 1:
            d = fix["v"][i] - nav["v"][i]
            velocity += d * d
    velocity += cfg["velocity_initial"] * cfg["velocity_initial"]
    attitude = cfg["heading_initial"] * cfg["heading_initial"]
    for i in range(3):
        P[POSITION + i, POSITION + i] += position
        P[VELOCITY + i, VELOCITY + i] += velocity
        P[ATTITUDE + i, ATTITUDE + i] += attitude


@njit(cache=True)
def _use_fix(
    s: Record, cfg: Record, work: Record, fix: Record, log_t: int, out: tuple[Any, ...]
) -> None:
    """Update with one fix at the filter's own time."""
    solutions, epochs, covariances, innovations, events, counts, nodes = out
    t = fix["t"]
    remove_sensor_errors(s, work)
    force = cfg["rejections"] > 0 and s["rejected"] >= cfg["rejections"]
    if force:
        _doubt(s, cfg, fix)
    used = position_update(s, cfg, work, fix, force, t, log_t, innovations, counts)
    if used:
        if force:
            record_event(events, counts, t, log_t, EVENT_RESET, float(s["rejected"]), NOTE_FIX)
        s["rejected"] = 0
        end_outage(s, t, log_t, events, counts)
    else:
        s["rejected"] += 1
        record_event(events, counts, t, log_t, EVENT_REJECTED, float(s["rejected"]), NOTE_FIX)
    if fix["has_v"] == 1 and cfg["use_velocity"] == 1:
        velocity_update(s, cfg, work, fix, force, t, log_t, innovations, counts)
    mark_epoch(s, fix)
    if work["trail"]["on"] == 1:
        close_inertial(s, cfg, work, log_t, OWN, nodes)
    emit_solution(s, work, STATUS_UPDATED, log_t, solutions, counts)
    emit_epoch(s, cfg, log_t, epochs, covariances, counts)


@njit(cache=True)
def _take_fixes(
    s: Record,
    cfg: Record,
    work: Record,
    fixes: Array,
    first: int,
    t: int,
    log_t: int,
    out: tuple[Any, ...],
) -> int:
    """Use every fix that is known by now and valid up to `t`; the number of the next one."""
    solutions, events, counts = out[0], out[4], out[5]
    recorded = work["trail"]["on"] == 1
    k = first
    early = 0
    while k < fixes.shape[0] and fixes[k]["t"] <= t and fixes[k]["log_t"] <= log_t:
        fix = fixes[k]
        k += 1
        if not (all_finite(fix["r"]) and all_finite(fix["R"]) and all_finite(fix["R"][3:])):
            record_event(events, counts, fix["t"], log_t, EVENT_NOT_FINITE, 0.0, NOTE_FIX)
            continue
        if s["mode"] != RUNNING:
            if fix["t"] < s["imu_t"]:
                early += 1
            elif (fix["chain"] == 0 or ready_to_align(s, fix)) and align_fix(
                s, cfg, work, fix, log_t, events, counts
            ):
                set_out(s, fix)
                if recorded:
                    begin_trail(work["trail"])
                    close_inertial(s, cfg, work, log_t, OWN, out[6])
                if fix["chain"] > 0:
                    begin_chain(s, cfg, work, fix)
                    s["chain_t"] = fix["t"]
                emit_solution(s, work, STATUS_UPDATED, log_t, solutions, counts)
                emit_epoch(s, cfg, log_t, out[1], out[2], counts)
            continue
        if fix["t"] < s["t"] or fix["t"] == s["moved_t"]:
            refuse_late(s, fix["t"], fix["t"], log_t, events, counts)
            continue
        arrive(s, cfg, work, fix["t"], log_t, out)
        if fix["chain"] > 0:
            use_link(s, cfg, work, fix, log_t, out)
        else:
            _use_fix(s, cfg, work, fix, log_t, out)
    refuse_early(early, t, log_t, events, counts)
    return k


@njit(cache=True)
def run_block(
    state: Array,
    config: Array,
    scratch: Array,
    imu_t: Array,
    imu_log_t: Array,
    imu_w: Array,
    imu_f: Array,
    fixes: Array,
    solutions: Array,
    epochs: Array,
    covariances: Array,
    innovations: Array,
    events: Array,
    counts: Array,
    nodes: tuple[Any, ...],
) -> int:
    """Carry the filter over a block.

    Parameters
    ----------
    state : array of one STATE_DTYPE
        Changed in place.
    config : array of one CONFIG_DTYPE
    scratch : array of one WORK_DTYPE
    imu_t, imu_log_t : int64 arrays (n,), ns
        Valid times and times of availability.
    imu_w : float64 array (n, 3), rad/s
    imu_f : float64 array (n, 3), m/s^2
    fixes : array (m,) of FIX_DTYPE
        In the order of their availability.
    solutions, epochs, innovations, events : arrays of their records
        With room for everything that the block can give.
    covariances : float64 array (as epochs, states (states + 1) / 2)
    counts : int64 array (5,)
        Rows written of solutions, epochs, innovations, events; events for which
        there was no room.
    nodes : tuple
        As :func:`replay.kernels.transition.close_node` takes it.

    Returns
    -------
    int
        How many of the fixes were taken; the others wait for later samples.
    """
    s = state[0]
    cfg = config[0]
    work = scratch[0]
    # What a step leaves in the scratch must not depend on where the block was cut.
    work["decay_dt"] = -1.0
    out = (solutions, epochs, covariances, innovations, events, counts, nodes)
    taken = 0
    for k in range(imu_t.shape[0]):
        t, log_t = imu_t[k], imu_log_t[k]
        begun = begin_sample(s, cfg, work, t, log_t, imu_w[k], imu_f[k], out)
        if begun == SKIPPED:
            continue
        taken = _take_fixes(s, cfg, work, fixes, taken, t, log_t, out)
        end_sample(s, cfg, work, t, log_t, begun == ALIGNING, out)
    return taken
