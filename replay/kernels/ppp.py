"""Precise point positioning of one receiver, epoch after epoch.

An epoch: what the receiver and its two frequencies say of broken phases, the states
before it, codes and phases as measurements, the update with those that disagree left
out, and the integers. See :mod:`replay.kernels.ppp_states` for the states,
:mod:`replay.kernels.ppp_measures` for the measurements and
:mod:`replay.kernels.ppp_resolve` for the integers.
"""

from typing import Any, Final

import numpy as np
from numba import njit

from replay.kernels.ambiguity import COUNT_LIMIT
from replay.kernels.dilution import dilutions
from replay.kernels.earth import enu_axes
from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.integers import ATTEMPT_DTYPE, CANDIDATE_DTYPE
from replay.kernels.ppp_measures import add_doppler, build_measures, view_rows
from replay.kernels.ppp_output import (
    COUNTS,
    SOLUTIONS,
    write_clocks,
    write_innovations,
    write_states,
)
from replay.kernels.ppp_records import (
    EVENT_CLOCK_JUMP,
    EVENT_FIX_LOST,
    EVENT_FIXED,
    EVENT_RESET,
    EVENT_SLIP,
    EVENT_TIME_BACKWARD,
    EVENT_TOO_FEW,
    FLOAT_ONLY,
    HOLD,
    KINEMATIC,
    MEASURES,
    PPP_MEASURE_DTYPE,
    ROOM,
    VELOCITY,
    VIEW_DTYPE,
    VIEWS,
)
from replay.kernels.ppp_resolve import resolve
from replay.kernels.ppp_slips import code_jump, compare_phases
from replay.kernels.ppp_states import begin_again, leading_states, predict
from replay.kernels.ppp_update import count_used, mark_satellites, settle, update_epoch
from replay.kernels.rtk_output import note, write_solution
from replay.kernels.rtk_records import FIXED, FLOAT, SINGLE
from replay.kernels.rtk_states import heed_breaks
from replay.kernels.single_solve import true_time
from replay.kernels.state_names import name_precise
from replay.kernels.transition import (
    GIVEN_INTEGERS,
    OWN,
    SILENT,
    add_correction,
    begin_trail,
    carry_rate,
    close_node,
    open_node,
    part_trail,
    repack,
)
from replay.kernels.types import Array, Record

_FAR_M: Final = 20.0
_LEAST_SATELLITES: Final = 4
_TURNS: Final = 4


@njit(cache=True)
def predict_epoch(
    rows: Array, t: int, clock: float, s: Record, x: Array, P: Array, cfg: Record, place: Array,
    coarse: Array, up: Array, velocity: Array, views: Array, broken: Array, source: Array, u: Array,
) -> tuple[int, float, Array, int]:  # fmt: skip
    """States and covariance of an epoch before its measurements.

    Parameters
    ----------
    rows, t, clock, s, x, P, cfg, place, coarse, up, velocity, views, broken, u
        As :func:`float_epoch` takes them.
    source : int64 array (ROOM,)
        Filled: which state of the epoch before each one was, minus one where it is new.

    Returns
    -------
    count : int
        Views.
    dt : float, s
        Since the epoch before.
    A : float64 array (n, n)
        Predicted covariance.
    n : int
    """
    count = view_rows(rows, cfg, place, coarse, up, views, u)
    compare_phases(rows, views, count, t, s, cfg)
    dt = (t - s["t"]) * 1e-9 if s["t"] >= 0 else 0.0
    A, n = predict(
        rows, views, count, t, clock, s, cfg, x, P, place, velocity, broken, source, np.empty(ROOM)
    )
    return count, dt, A, n


@njit(cache=True)
def use_epoch(
    rows: Array, views: Array, count: int, dt: float, s: Record, x: Array, P: Array, cfg: Record,
    coarse: Array, up: Array, A: Array, n: int, source: Array, measures: Array, dx: Array, u: Array,
) -> tuple[int, int]:  # fmt: skip
    """Update a predicted epoch; how many measurements, and how many left out.

    Parameters
    ----------
    rows, views, s, x, P, cfg, coarse, up, measures, u
        As :func:`float_epoch` takes them.
    count, dt, A, n, source
        Of :func:`predict_epoch`.
    dx : float64 array (n,)
        Filled: correction of the predicted states.
    """
    new, slopes = np.empty((n, n)), np.zeros(2)
    # Where the prior says next to nothing of the position, it may as well be about a nearer one.
    loose = cfg["dynamics"] == KINEMATIC or source[0] < 0
    total, dropped = 0, 0
    for turn in range(_TURNS):
        view_rows(rows, cfg, x[:3], coarse, up, views, u)
        total = build_measures(rows, views, count, s, cfg, x, dt, measures, slopes)
        total = add_doppler(rows, views, count, s, cfg, x, measures, total, u)
        for i in range(n):
            for j in range(i, n):
                new[i, j] = A[i, j]
        dropped = update_epoch(measures, total, new, n, cfg, dx)
        far2 = dx[0] * dx[0] + dx[1] * dx[1] + dx[2] * dx[2]
        if not loose or not far2 > _FAR_M * _FAR_M or turn == _TURNS - 1:
            break
        for c in range(3):
            x[c] += dx[c]
    for i in range(n):
        x[i] += dx[i]
        target, row = P[i], new[i]
        for j in range(n):
            target[j] = row[j]
    return total, dropped


@njit(cache=True)
def float_epoch(
    rows: Array, t: int, clock: float, s: Record, x: Array, P: Array, cfg: Record, place: Array,
    coarse: Array, up: Array, velocity: Array, views: Array, measures: Array, broken: Array,
    u: Array,
) -> tuple[int, int, int]:  # fmt: skip
    """Predict and update one epoch; how many views and measurements, and how many left out.

    Parameters
    ----------
    rows : array of MEASURED_DTYPE
    t : int, ns
    clock : float, m
        The receiver's, coarse.
    s, cfg : records of PPP_STATE_DTYPE, PPP_CONFIG_DTYPE
    x, P
        States and covariance; changed.
    place, coarse : float64 arrays (3,), m, ECEF
        Where a motion begins, and where the delays were computed.
    up, velocity : float64 arrays (3,)
    views, measures : arrays of VIEW_DTYPE and PPP_MEASURE_DTYPE
        Filled.
    broken : int64 array (SATELLITES, SLOTS)
        Filled: 1 where an ambiguity in use was broken.
    u : float64 array (3,)
        Scratch.
    """
    source = np.empty(ROOM, dtype=np.int64)
    count, dt, A, n = predict_epoch(
        rows, t, clock, s, x, P, cfg, place, coarse, up, velocity, views, broken, source, u
    )
    total, dropped = use_epoch(
        rows, views, count, dt, s, x, P, cfg, coarse, up, A, n, source, measures, np.zeros(n), u
    )
    return count, total, dropped


@njit(cache=True)
def _record_prediction(
    s: Record, cfg: Record, trail: Record, A: Array, n: int, dt: float, source: Array
) -> None:
    """Tell the smoother what :func:`replay.kernels.ppp_states.predict` has done."""
    lead = leading_states(cfg["dynamics"])
    repack(trail, 0, n, source)
    if lead == 6 and source[0] >= 0:
        for c in range(3):
            carry_rate(trail, c, 3 + c, dt)
    for i in range(lead):
        trail["name"][i] = i
    name_precise(s, 0, trail["name"])
    open_node(trail, A, n)


@njit(cache=True)
def _close(
    s: Record, trail: Record, x: Array, P: Array, t: int, log_t: int, told: int,
    nodes: tuple[Any, ...],
) -> None:  # fmt: skip
    """Write the node of an epoch, where nodes are recorded."""
    if trail["on"] == 1:
        for i in range(s["n"]):
            trail["estimate"][i] = x[i]
        close_node(trail, P, s["n"], t, log_t, told, nodes)


@njit(cache=True)
def run_ppp(
    state: Array, x: Array, P: Array, config: Array, scratch: Array, epochs: Array, rows: Array,
    solutions: Array, innovations: Array, ambiguities: Array, resolutions: Array, notes: Array,
    zeniths: Array, slants: Array, biases: Array, phases: Array, counts: Array, trails: Array,
    nodes: tuple[Any, ...],
) -> None:  # fmt: skip
    """Work on all epochs of a block.

    Parameters
    ----------
    state, config, scratch : arrays of one record each
        PPP_STATE_DTYPE, PPP_CONFIG_DTYPE, SOLVE_DTYPE.
    x, P : float64 arrays (ROOM,), (ROOM, ROOM)
        States and covariance; changed.
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
    solutions : array (epochs,) of SINGLE_ROW_DTYPE
    innovations : array (8 * rows,) of RESIDUAL_DTYPE
    ambiguities : array (3 * rows,) of AMBIGUITY_ROW_DTYPE
    resolutions : array (epochs,) of RESOLUTION_ROW_DTYPE
    notes : array (4 * epochs + 3 * rows,) of NOTE_DTYPE
    zeniths : array (epochs,) of ZENITH_ROW_DTYPE
    slants : array (rows,) of SLANT_ROW_DTYPE
    biases : array (15 * epochs,) of BIAS_ROW_DTYPE
    phases : array (3 * rows,) of PHASE_ROW_DTYPE
    counts : int64 array (10,)
        Filled: rows of each output, as :mod:`replay.kernels.ppp_output` numbers them.
    trails : array of one `trail_dtype(ROOM)`
        Changed where it is on.
    nodes : tuple
        As :func:`replay.kernels.transition.close_node` takes it.
    """
    s, cfg, work, trail = state[0], config[0], scratch[0], trails[0]
    u, up, place, velocity = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    still = np.zeros(3)
    position, cov, moving = np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
    views = np.zeros(VIEWS, dtype=VIEW_DTYPE)
    measures = np.zeros(MEASURES, dtype=PPP_MEASURE_DTYPE)
    candidates = np.zeros(COUNT_LIMIT, dtype=CANDIDATE_DTYPE)
    tries = np.zeros(2, dtype=ATTEMPT_DTYPE)
    broken = np.zeros((SATELLITES, SLOTS), dtype=np.int64)
    weight = np.zeros(SATELLITES)
    source = np.empty(ROOM, dtype=np.int64)
    for i in range(COUNTS):
        counts[i] = 0
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        log_t = epoch["log_t"]
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        if s["t"] >= 0 and epoch["t"] <= s["t"]:
            back = (s["t"] - epoch["t"]) * 1e-9
            note(notes, counts, epoch["t"], log_t, EVENT_TIME_BACKWARD, -1, back)
            continue
        heed_breaks(part, 0, s)
        jump = code_jump(part, epoch["t"], s, x, cfg)
        if epoch["placed"] == 0:
            continue
        enu_axes(epoch["x"][0], epoch["x"][1], epoch["x"][2], work["axes"])
        for i in range(3):
            up[i] = work["axes"][2, i]
            place[i] = epoch["x"][i]
        count, dt, A, n = predict_epoch(
            part, epoch["t"], epoch["clock"], s, x, P, cfg, place, epoch["x"], up, still, views,
            broken, source, u,
        )  # fmt: skip
        if trail["on"] == 1:
            _record_prediction(s, cfg, trail, A, n, dt, source)
        dx = np.zeros(n)
        total, dropped = use_epoch(
            part, views, count, dt, s, x, P, cfg, epoch["x"], up, A, n, source, measures, dx, u
        )
        if trail["on"] == 1:
            add_correction(trail, dx, n)
        t = true_time(epoch["t"], x[s["clock"]])
        if jump != 0.0:
            milliseconds = jump / 299792.458
            note(notes, counts, t, log_t, EVENT_CLOCK_JUMP, -1, milliseconds)
        for satellite in range(SATELLITES):
            for slot in range(SLOTS):
                if broken[satellite, slot] == 1:
                    note(notes, counts, t, log_t, EVENT_SLIP, satellite, float(slot))
        satellites, used = count_used(measures, total)
        write_innovations(measures, total, views, part, t, log_t, innovations, counts)
        found = settle(measures, total, s)
        if satellites < _LEAST_SATELLITES and cfg["dynamics"] == KINEMATIC:
            note(notes, counts, t, log_t, EVENT_TOO_FEW, -1, float(satellites))
            _close(s, trail, x, P, t, log_t, SILENT, nodes)
            s["fixed"] = 0
            s["status"] = 0
            continue
        if dropped >= cfg["rounds"] or dropped > used:
            s["failed"] += 1
            # It is in the states, but would spoil what was before.
            part_trail(trail)
            if s["failed"] >= cfg["failures"]:
                note(notes, counts, t, log_t, EVENT_RESET, -1, float(s["failed"]))
                begin_again(s)
                begin_trail(trail)
                s["fixed"] = 0
                s["status"] = 0
                continue
        else:
            s["failed"] = 0
        write_states(
            part, views, count, t, log_t, s, cfg, x, P, zeniths, slants, biases, phases, counts
        )
        status = FLOAT if found >= _LEAST_SATELLITES else SINGLE
        for i in range(3):
            position[i] = x[i]
            for j in range(3):
                cov[i, j] = P[i, j]
        tries[0]["fixed"] = 0
        told = OWN
        floats = x[:n].copy() if trail["on"] == 1 else x[:0]
        if (
            status == FLOAT
            and cfg["mode"] != FLOAT_ONLY
            and resolve(
                part, measures, total, views, s, cfg, x, P, candidates, tries, t, log_t,
                ambiguities, resolutions, counts,
            )
        ):  # fmt: skip
            status = FIXED
            held = cfg["mode"] == HOLD and s["fixed"] + 1 >= cfg["hold_count"]
            if not held or tries[0]["whole"] == 0:
                told = GIVEN_INTEGERS
            elif trail["on"] == 1:
                add_correction(trail, x[:n] - floats, n)
            for i in range(3):
                position[i] = tries[0]["x"][i]
                for j in range(3):
                    cov[i, j] = tries[0]["cov"][i, j]
        _close(s, trail, x, P, t, log_t, told, nodes)
        if status == FIXED and s["status"] != FIXED:
            note(notes, counts, t, log_t, EVENT_FIXED, -1, float(tries[0]["fixed"]))
        if status != FIXED and s["status"] == FIXED:
            note(notes, counts, t, log_t, EVENT_FIX_LOST, -1, float(s["fixed"]))
        s["status"] = status
        s["fixed"] = s["fixed"] + 1 if status == FIXED else 0
        moves = cfg["dynamics"] == VELOCITY
        if moves:
            for i in range(3):
                velocity[i] = x[3 + i]
                for j in range(3):
                    moving[i, j] = P[3 + i, 3 + j]
        enu_axes(position[0], position[1], position[2], work["axes"])
        out = solutions[counts[SOLUTIONS]]
        counts[SOLUTIONS] += 1
        write_solution(out, epoch, t, log_t, status, position, cov, velocity, moving, moves, work)
        mark_satellites(views, measures, total, weight)
        dilutions(part, weight, position, work, u, out)
        write_clocks(out, s, x, P)
