"""An inertial sample at a filter, and the way to a fix or an epoch between two of them.

What is the same in all filters on an inertial system, whatever else they use.
"""

from typing import Any

from numba import njit

from replay.kernels.alignment import align_sample
from replay.kernels.constraints import (
    is_still,
    non_holonomic_update,
    push_sample,
    zero_rate_update,
    zero_velocity_update,
)
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_update import mark_epoch
from replay.kernels.output_rows import close_inertial, emit_solution
from replay.kernels.prediction import advance
from replay.kernels.records import (
    EVENT_IMU_GAP,
    EVENT_NOT_FINITE,
    EVENT_OUTAGE_BEGIN,
    EVENT_OUTAGE_END,
    EVENT_STOP_BEGIN,
    EVENT_STOP_END,
    EVENT_TIME_BACKWARD,
    RUNNING,
    STATUS_OUTAGE,
    STATUS_PREDICTED,
)
from replay.kernels.transition import OWN, SILENT
from replay.kernels.types import Array, Record
from replay.kernels.update import record_event

# What an inertial sample is to a filter.
SKIPPED = 0
ALIGNING = 1
NAVIGATING = 2

# What an event speaks of.
NOTE_IMU = 0
NOTE_FIX = 1
NOTE_EARLY = 2


@njit(cache=True)
def set_out(s: Record, fix: Record) -> None:
    """Begin at the fix that the alignment has taken."""
    s["fix_t"] = fix["t"]
    mark_epoch(s, fix)
    s["stop_last"] = fix["t"]
    s["nhc_last"] = fix["t"]


@njit(cache=True)
def arrive(s: Record, cfg: Record, work: Record, t: int, log_t: int, out: tuple[Any, ...]) -> None:
    """Carry the filter to a fix or an epoch that is valid at `t`."""
    if s["in_outage"] == 1 and s["emitted_t"] < s["t"]:
        # The last word before help arrives: this is where drift is read off.
        emit_solution(s, work, STATUS_OUTAGE, log_t, out[0], out[5])
        if work["trail"]["on"] == 1:
            close_inertial(s, cfg, work, log_t, OWN, out[6])
    advance(s, cfg, work, t)


@njit(cache=True)
def refuse_late(s: Record, valid_t: int, t: int, log_t: int, events: Array, counts: Array) -> None:
    """Say that what bears the time `t`, and is valid at `valid_t`, came after the filter's time."""
    late = (s["t"] - valid_t) * 1e-9
    record_event(events, counts, t, log_t, EVENT_TIME_BACKWARD, late, NOTE_FIX)


@njit(cache=True)
def refuse_early(early: int, t: int, log_t: int, events: Array, counts: Array) -> None:
    """Say how many fixes were valid before the inertial samples began."""
    if early > 0:
        record_event(events, counts, t, log_t, EVENT_TIME_BACKWARD, float(early), NOTE_EARLY)


@njit(cache=True)
def end_outage(s: Record, t: int, log_t: int, events: Array, counts: Array) -> None:
    """Help was used at `t`: an outage is over."""
    if s["in_outage"] == 1:
        away = (t - s["fix_t"]) * 1e-9
        record_event(events, counts, t, log_t, EVENT_OUTAGE_END, away, NOTE_FIX)
        s["in_outage"] = 0
    s["fix_t"] = t


@njit(cache=True)
def constrain(
    s: Record, cfg: Record, work: Record, t: int, log_t: int, out: tuple[Any, ...]
) -> None:
    """Stops and non-holonomic updates at an inertial sample."""
    innovations, events, counts = out[3], out[4], out[5]
    interval = cfg["stop_interval"]
    if (cfg["zero_velocity"] == 1 or cfg["zero_rate"] == 1) and (
        t - s["stop_last"]
    ) * 1e-9 >= interval - 1e-6:
        s["stop_last"] = t
        v = s["nav"]["v"]
        speed = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        still = speed <= cfg["stop_speed"] and is_still(s, cfg, work, True)
        if still != (s["stopped"] == 1):
            kind = EVENT_STOP_BEGIN if still else EVENT_STOP_END
            record_event(events, counts, t, log_t, kind, speed, NOTE_IMU)
            s["stopped"] = 1 if still else 0
        if still:
            if cfg["zero_velocity"] == 1:
                zero_velocity_update(s, cfg, work, t, log_t, innovations, counts)
            if cfg["zero_rate"] == 1:
                zero_rate_update(s, cfg, work, t, log_t, innovations, counts)
    if (
        cfg["non_holonomic"] == 1
        and s["stopped"] == 0
        and (t - s["nhc_last"]) * 1e-9 >= cfg["nhc_interval"] - 1e-6
    ):
        s["nhc_last"] = t
        non_holonomic_update(s, cfg, work, t, log_t, innovations, counts)


@njit(cache=True)
def say_where(
    s: Record, cfg: Record, work: Record, t: int, log_t: int, out: tuple[Any, ...]
) -> None:
    """A predicted solution where one is due; a node for the smoother there, or after an update."""
    slot = t // cfg["solution_interval"]
    shown = SILENT
    status = STATUS_OUTAGE if s["in_outage"] == 1 else STATUS_PREDICTED
    if slot > s["emitted_slot"]:
        s["emitted_slot"] = slot
        shown = OWN
        emit_solution(s, work, status, log_t, out[0], out[5])
    trail = work["trail"]
    if trail["on"] == 1 and (shown == OWN or trail["updated"] == 1):
        close_inertial(s, cfg, work, log_t, shown, out[6])


@njit(cache=True)
def all_finite(a: Array) -> bool:
    """Whether three numbers are neither NaN nor infinite."""
    total = a[0] + a[1] + a[2]
    return total - total == 0.0


@njit(cache=True)
def begin_sample(
    s: Record,
    cfg: Record,
    work: Record,
    t: int,
    log_t: int,
    rate: Array,
    force: Array,
    out: tuple[Any, ...],
) -> int:
    """Take an inertial sample at hand: SKIPPED, ALIGNING or NAVIGATING."""
    events, counts = out[4], out[5]
    if not (all_finite(rate) and all_finite(force)):
        record_event(events, counts, t, log_t, EVENT_NOT_FINITE, 0.0, NOTE_IMU)
        return SKIPPED
    if s["imu_t"] < 0:
        s["imu_t"] = t
        s["t"] = t
        return SKIPPED
    if t <= s["imu_t"]:
        late = (s["imu_t"] - t) * 1e-9
        record_event(events, counts, t, log_t, EVENT_TIME_BACKWARD, late, NOTE_IMU)
        return SKIPPED
    dt = (t - s["imu_t"]) * 1e-9
    if dt > cfg["imu_gap"]:
        record_event(events, counts, t, log_t, EVENT_IMU_GAP, dt, NOTE_IMU)
    w_raw, f_raw = s["w_raw"], s["f_raw"]
    for i in range(3):
        w_raw[i] = rate[i]
        f_raw[i] = force[i]
    if s["mode"] == RUNNING:
        return NAVIGATING
    align_sample(s, cfg, work, dt, t, log_t, events, counts)
    return ALIGNING


@njit(cache=True)
def end_sample(
    s: Record, cfg: Record, work: Record, t: int, log_t: int, aligning: bool, out: tuple[Any, ...]
) -> None:
    """Carry the filter to the sample's time: outage, constraints, a predicted solution."""
    events, counts = out[4], out[5]
    s["imu_t"] = t
    if s["mode"] != RUNNING:
        s["t"] = t
        return
    since = (t - s["fix_t"]) * 1e-9
    if s["in_outage"] == 0 and since > cfg["outage_limit"]:
        s["in_outage"] = 1
        record_event(events, counts, t, log_t, EVENT_OUTAGE_BEGIN, since, NOTE_FIX)
    advance(s, cfg, work, t)
    if not aligning:
        push_sample(s, s["w_raw"], s["f_raw"])
    constrain(s, cfg, work, t, log_t, out[:7])
    say_where(s, cfg, work, t, log_t, out[:7])
