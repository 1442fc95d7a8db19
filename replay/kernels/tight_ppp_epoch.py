"""An epoch of precise point positioning on an inertial system: update, integers, rows."""

from typing import Any, Final

from numba import njit

from replay.kernels.antenna_measures import antenna, widen
from replay.kernels.dilution import dilutions
from replay.kernels.earth import enu_axes
from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.inertial_samples import NOTE_FIX, end_outage
from replay.kernels.output_rows import close_inertial, emit_epoch, emit_solution
from replay.kernels.ppp_measures import build_measures, view_rows
from replay.kernels.ppp_output import (
    SOLUTIONS,
    write_clocks,
    write_innovations,
    write_states,
)
from replay.kernels.ppp_records import (
    EVENT_FIX_LOST,
    EVENT_FIXED,
    EVENT_RESET,
    EVENT_SLIP,
    FLOAT_ONLY,
    HOLD,
    PHASE,
)
from replay.kernels.ppp_resolve import resolve
from replay.kernels.ppp_slips import code_jump, compare_phases
from replay.kernels.ppp_states import predict
from replay.kernels.ppp_update import count_used, mark_satellites, settle, update_epoch
from replay.kernels.prediction import remove_sensor_errors
from replay.kernels.records import (
    STATUS_PREDICTED,
    STATUS_UPDATED,
)
from replay.kernels.rotation import rotate3
from replay.kernels.rtk_output import note
from replay.kernels.rtk_records import FIXED, FLOAT
from replay.kernels.rtk_states import heed_breaks
from replay.kernels.tight import (
    EVENT_CLOCK_JUMP,
)
from replay.kernels.tight_ppp_measures import (
    add_rates,
    clock_step,
    follow_turn,
    heading_of,
    step_clock,
    to_joint,
    unwind,
)
from replay.kernels.tight_ppp_records import LEAD, WALK
from replay.kernels.tight_ppp_states import (
    antenna_rows,
    antenna_view,
    carry_clock,
    doubt,
    name_states,
    repack_states,
)
from replay.kernels.tight_rtk_epoch import hold_integers, show_fixed
from replay.kernels.transition import (
    GIVEN_INTEGERS,
    OWN,
    add_correction,
    open_node,
)
from replay.kernels.types import Array, Record
from replay.kernels.update import feed_back, record_event, state_count

_LEAST_PHASES: Final = 4
_LOST: Final = 1
_SET_ANEW_M: Final = 3000.0


@njit(cache=True)
def float_update(
    s: Record, g: Record, q: Record, cfg: Record, pcfg: Record, rcfg: Record, work: Record,
    epoch: Record, part: Array, room: tuple[Any, ...],
) -> tuple[int, int, int, float]:  # fmt: skip
    """Predict and update the states.

    Returns
    -------
    int, int, int
        Views, measurements, and how many of those were left out.
    float
        Step of the receiver's clock, m, or 0.
    """
    (
        x,
        P,
        views,
        measures,
        joint,
        broken,
        source,
        grow,
        J,
        place,
        speed,
        up,
        u,
        values,
        antenna_of,
    ) = room
    G, index = antenna_of
    first, aux, trail = state_count(cfg), s["aux"], work["trail"]
    antenna(s, work, pcfg["lever"], place, speed)
    count = view_rows(part, rcfg, place, epoch["x"], up, views, u)
    compare_phases(part, views, count, epoch["t"], q, rcfg)
    dt = (epoch["t"] - q["t"]) * 1e-9 if q["t"] >= 0 else 0.0
    clock, drift, value, rate = q["clock"], q["drift"], epoch["clock"], 0.0
    if q["t"] < 0:
        clock, drift = -1, -1
    if clock >= 0:
        value = aux[clock - LEAD]
        rate = aux[drift - LEAD]
    A, n = predict(
        part, views, count, epoch["t"], value, q, rcfg, x, P, place, speed, broken, source, grow
    )
    for c in range(3):
        x[c] = place[c]
        x[3 + c] = speed[c]
    if clock >= 0:
        # They have been carried on already, along the filter's own time.
        source[q["drift"]] = drift
        x[q["drift"]] = rate
        grow[q["drift"]] = 0.0
        if pcfg["clock"] == WALK:
            source[q["clock"]] = clock
            grow[q["clock"]] = 0.0
        x[q["clock"]] = value
    m = repack_states(s, cfg, A, n, source, grow, J, trail)
    total = build_measures(part, views, count, q, rcfg, x, dt, measures, values)
    if pcfg["wind_up"] == 1:
        unwind(measures, total, views, part, rcfg, g["turn"])
    if pcfg["doppler"] == 1:
        total = add_rates(part, views, count, q, rcfg, x, measures, total, u)
    place_of = first + q["clock"] - LEAD
    step = clock_step(measures, total, s["P"][place_of, place_of], pcfg["jump"], values)
    if step != 0.0:
        step_clock(measures, total, step)
        x[q["clock"]] += step
        sigma = rcfg["clock_sigma"]
        widen(s, cfg, q["clock"] - LEAD, sigma * sigma, trail)
    for c in range(s["extra"]):
        aux[c] = x[LEAD + c]
    if trail["on"] == 1:
        name_states(q, first, trail["name"])
        open_node(trail, s["P"], m)
    known = antenna_rows(s, cfg, work, pcfg["lever"], G, index)
    to_joint(measures, total, first, G, index, known, joint)
    dropped = 0
    if total > 0:
        dx = work["dx"]
        dropped = update_epoch(joint, total, s["P"], m, rcfg, dx)
        feed_back(s, cfg, dx, work["q"])
        if trail["on"] == 1:
            add_correction(trail, dx, m)
        remove_sensor_errors(s, work)
        known = antenna_rows(s, cfg, work, pcfg["lever"], G, index)
    # The antenna and the states behind it, for what is said of them and for the integers.
    antenna(s, work, pcfg["lever"], place, speed)
    antenna_view(s, cfg, G, index, known, x, P)
    for c in range(3):
        x[c] = place[c]
        x[3 + c] = speed[c]
    return count, total, dropped, step


@njit(cache=True)
def use_epoch(
    s: Record, g: Record, q: Record, cfg: Record, pcfg: Record, rcfg: Record, work: Record,
    solve: Record, epoch: Record, part: Array, room: tuple[Any, ...], log_t: int,
    out: tuple[Any, ...],
) -> tuple[int, int]:  # fmt: skip
    """Update with the satellites of an epoch at the filter's own time; views, measurements."""
    x, joint, up = room[0], room[4], room[11]
    aux = s["aux"]
    remove_sensor_errors(s, work)
    carry_clock(s, g, q, cfg, pcfg, work["trail"])
    for c in range(s["extra"]):
        x[LEAD + c] = aux[c]
    heed_breaks(part, 0, q)
    code_jump(part, epoch["t"], q, x, rcfg)
    for c in range(s["extra"]):
        aux[c] = x[LEAD + c]
    enu_axes(epoch["x"][0], epoch["x"][1], epoch["x"][2], solve["axes"])
    for i in range(3):
        up[i] = solve["axes"][2, i]
    follow_turn(g, heading_of(s["nav"]["C"], solve["axes"]))
    count, total, dropped, step = float_update(s, g, q, cfg, pcfg, rcfg, work, epoch, part, room)
    if step != 0.0:
        record_event(out[4], out[5], s["t"], log_t, EVENT_CLOCK_JUMP, step, NOTE_FIX)
    _, used = count_used(joint, total)
    failed = dropped >= rcfg["rounds"] or dropped > used
    q["failed"] = q["failed"] + 1 if failed else 0
    settle(joint, total, q)
    return count, total


@njit(cache=True)
def say_epoch(
    s: Record, q: Record, cfg: Record, pcfg: Record, rcfg: Record, work: Record, solve: Record,
    epoch: Record, part: Array, count: int, total: int, room: tuple[Any, ...],
    found: tuple[Any, ...], weight: Array, log_t: int, out: tuple[Any, ...],
) -> None:  # fmt: skip
    """Look for the integers of an epoch that was used, and write everything about it."""
    solutions, states, covariances, _, events, counts, nodes = out[:7]
    gnss, residuals, ambiguities, resolutions, notes = out[7:12]
    zeniths, slants, biases, phases, tally = out[12:]
    x, P, views, _, joint, broken = room[:6]
    place, u = room[9], room[12]
    candidates, tries, arm = found
    t = s["t"]
    for satellite in range(SATELLITES):
        for slot in range(SLOTS):
            if broken[satellite, slot] == 1:
                note(notes, tally, t, log_t, EVENT_SLIP, satellite, float(slot))
    _, used = count_used(joint, total)
    write_innovations(joint, total, views, part, t, log_t, residuals, tally)
    settled = 0
    for k in range(total):
        settled += 1 if joint[k]["kind"] == PHASE and joint[k]["use"] == 1 else 0
    status = 0
    if used > 0:
        status = FLOAT if settled >= _LEAST_PHASES else STATUS_UPDATED
        end_outage(s, t, log_t, events, counts)
    write_states(
        part, views, count, t, log_t, q, rcfg, x, P, zeniths, slants, biases, phases, tally
    )
    row = gnss[tally[SOLUTIONS]]
    tally[SOLUTIONS] += 1
    row["t"] = t
    row["epoch_t"] = epoch["t"]
    row["log_t"] = log_t
    mark_satellites(views, joint, total, weight)
    enu_axes(place[0], place[1], place[2], solve["axes"])
    dilutions(part, weight, place, solve, u, row)
    write_clocks(row, q, x, P)
    held = False
    tries[0]["fixed"] = 0
    if (
        status == FLOAT
        and rcfg["mode"] != FLOAT_ONLY
        and resolve(
            part, joint, total, views, q, rcfg, x, P, candidates, tries, t, log_t, ambiguities,
            resolutions, tally,
        )
    ):  # fmt: skip
        status = FIXED
        whole = tries[0]["whole"] == 1
        held = whole and rcfg["mode"] == HOLD and q["fixed"] + 1 >= rcfg["hold_count"]
    if status == FIXED and q["status"] != FIXED:
        note(notes, tally, t, log_t, EVENT_FIXED, -1, float(tries[0]["fixed"]))
    if status != FIXED and q["status"] == FIXED:
        note(notes, tally, t, log_t, EVENT_FIX_LOST, -1, float(q["fixed"]))
    if held:
        _hold(s, cfg, rcfg, work, candidates, tries[0]["count"])
    q["status"] = status
    q["fixed"] = q["fixed"] + 1 if status == FIXED else 0
    shown = status if status > 0 else STATUS_PREDICTED
    if work["trail"]["on"] == 1:
        own = GIVEN_INTEGERS if status == FIXED and not held else OWN
        close_inertial(s, cfg, work, log_t, own, nodes)
    emit_solution(s, work, shown, log_t, solutions, counts)
    if status == FIXED and not held:
        lever = pcfg["lever"]
        arm[0], arm[1], arm[2] = rotate3(s["nav"]["C"], lever[0], lever[1], lever[2])
        show_fixed(s, work, tries[0], x, P, arm, solutions[counts[0] - 1])
    emit_epoch(s, cfg, log_t, states, covariances, counts)
    if q["failed"] >= rcfg["failures"]:
        note(notes, tally, t, log_t, EVENT_RESET, -1, float(q["failed"]))
        doubt(s, q)


@njit(cache=True)
def _hold(
    s: Record, cfg: Record, rcfg: Record, work: Record, candidates: Array, count: int
) -> None:
    """Feed integers back; relative positioning leads with a position alone."""
    for i in range(count):
        candidates[i]["state"] -= LEAD - 3
        candidates[i]["base"] -= LEAD - 3
    hold_integers(s, cfg, rcfg, work, candidates, count, state_count(cfg))
