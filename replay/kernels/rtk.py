"""Relative positioning of a rover against a base, epoch after epoch.

An epoch: what both receivers say of broken phases, the rover's own position and velocity
from its codes and Doppler, single differences to the base, the filter's update with the
measurements that disagree left out, and the integers. See
:mod:`replay.kernels.double_difference` for the receivers' clocks,
:mod:`replay.kernels.rtk_states` for the states and :mod:`replay.kernels.rtk_resolve` for
the integers.
"""

from typing import Any

import numpy as np
from numba import njit

from replay.kernels.ambiguity import COUNT_LIMIT
from replay.kernels.dilution import dilutions
from replay.kernels.double_difference import build_measures, pair_rows
from replay.kernels.earth import enu_axes
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SLOTS, SYSTEMS
from replay.kernels.integers import ATTEMPT_DTYPE, CANDIDATE_DTYPE
from replay.kernels.kalman import scalar_update
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.rtk_output import note, write_baseline, write_residuals, write_solution
from replay.kernels.rtk_records import (
    DGNSS,
    EVENT_BASE_LOST,
    EVENT_FIX_LOST,
    EVENT_FIXED,
    EVENT_SLIP,
    EVENT_TOO_FEW,
    FIXED,
    FLOAT,
    FLOAT_ONLY,
    HOLD,
    KINEMATIC,
    MEASURE_DTYPE,
    PAIR_DTYPE,
    PAIRS,
    ROOM,
    SINGLE,
    VELOCITY,
)
from replay.kernels.rtk_resolve import resolve
from replay.kernels.rtk_states import (
    compare_frequencies,
    heed_breaks,
    leading_states,
    name_states,
    predict,
)
from replay.kernels.rtk_update import heed_base, satellite_differences, settle, update_epoch
from replay.kernels.single_records import SINGLE_STATE_DTYPE
from replay.kernels.single_solve import solve_epoch, solve_velocity, true_time
from replay.kernels.state_names import BASELINE
from replay.kernels.transition import (
    GIVEN_INTEGERS,
    OWN,
    SILENT,
    add_correction,
    carry_rate,
    close_node,
    open_node,
    repack,
)
from replay.kernels.types import Array, Record

_FAR_M = 20.0
_LEAST_DIFFERENCES = 4
# Largest part of a baseline's length that its deviation may be for the length to be used.
_SURE_PART = 0.1


@njit(cache=True)
def _own_position(
    rows: Array, epoch: Record, single: Record, s: Record, work: Record, arrays: Array,
    dropped: Array, u: Array, v: Array, cov: Array, velocity_cov: Array,
) -> tuple[bool, float, bool]:  # fmt: skip
    """One receiver alone: whether it has a position, its clock (m), whether it has a velocity."""
    for i in range(3):
        s["x"][i] = epoch["x"][i]
        v[i] = 0.0
    for i in range(SYSTEMS):
        s["clock"][i] = epoch["clock"]
    status = solve_epoch(rows, s, single, work, arrays[0], arrays[1], arrays[2], dropped, u)
    clock = epoch["clock"]
    if status < 0:
        for i in range(3):
            s["x"][i] = epoch["x"][i]
        return False, clock, False
    N = work["N"]
    for i in range(3):
        for j in range(3):
            cov[i, j] = N[i, j]
    for i in range(SYSTEMS - 1, -1, -1):
        if work["column"][i] > 0:
            clock = s["clock"][i]
    drift = solve_velocity(rows, arrays[2], single, s, work, v, u)
    for i in range(3):
        for j in range(3):
            velocity_cov[i, j] = N[i, j]
        if drift != drift:
            v[i] = 0.0
    return True, clock, drift == drift


@njit(cache=True)
def _constrain_length(
    x: Array, P: Array, n: int, base_x: Array, cfg: Record, trail: Record
) -> None:
    """Use the known length of the baseline, where the float one is sure enough to be linear."""
    length2, spread = 0.0, 0.0
    for c in range(3):
        length2 += (x[c] - base_x[c]) * (x[c] - base_x[c])
        spread += P[c, c]
    length = sqrt(length2)
    if not sqrt(spread) < _SURE_PART * cfg["length"] or length == 0.0:
        return
    h, index = np.zeros(3), np.zeros(3, dtype=np.int64)
    b, gain, dx = np.zeros(n), np.zeros(n), np.zeros(n)
    for c in range(3):
        index[c] = c
        h[c] = (x[c] - base_x[c]) / length / cfg["length_sigma"]
    scalar_update(P, n, h, index, 3, (cfg["length"] - length) / cfg["length_sigma"], dx, b, gain)
    for i in range(n):
        x[i] += dx[i]
    if trail["on"] == 1:
        add_correction(trail, dx, n)


@njit(cache=True)
def _float_epoch(
    part: Array, base_part: Array, t: int, age: float, s: Record, x: Array, P: Array, cfg: Record,
    place: Array, coarse: Array, base_x: Array, up: Array, v: Array, velocity_cov: Array,
    moves: bool, pairs: Array, measures: Array, starts: Array, broken: Array, before: Array,
    u: Array, trail: Record,
) -> int:  # fmt: skip
    """Predict and update one epoch; how many measurements there were.

    `before` is filled with the predicted states, which `z` of the measures is about.
    """
    count = pair_rows(part, base_part, age, cfg, place, coarse, base_x, up, pairs, u)
    compare_frequencies(part, base_part, pairs, count, t, s, cfg)
    baseline2 = 0.0
    for c in range(3):
        baseline2 += (place[c] - base_x[c]) * (place[c] - base_x[c])
    baseline = sqrt(baseline2)
    source = np.empty(ROOM, dtype=np.int64)
    since = s["t"]
    A, n = predict(
        part, base_part, pairs, count, t, baseline, s, cfg, x, P, place, v, moves, broken, source
    )
    if trail["on"] == 1:
        _record_prediction(s, cfg, trail, A, n - 1, (t - since) * 1e-9, source)
    for i in range(n - 1):
        before[i] = x[i]
    new, dx = np.empty((n, n)), np.zeros(n)
    speed = np.full(3, np.nan)
    if moves and cfg["dynamics"] >= VELOCITY:
        for c in range(3):
            speed[c] = v[c]
    total = 0
    for turn in range(2):
        if turn == 1 or cfg["dynamics"] != KINEMATIC:
            pair_rows(part, base_part, age, cfg, before[:3], coarse, base_x, up, pairs, u)
        groups = build_measures(
            part, base_part, pairs, count, abs(age), baseline, s, cfg, before, measures, starts
        )
        total = starts[groups]
        update_epoch(measures, starts, groups, A, n, cfg, speed, velocity_cov, before, new, dx)
        far2 = dx[0] * dx[0] + dx[1] * dx[1] + dx[2] * dx[2]
        if cfg["dynamics"] != KINEMATIC or far2 < _FAR_M * _FAR_M:
            break
        # Its prior says next to nothing of the position: it may as well be about a nearer one.
        for c in range(3):
            before[c] += dx[c]
    for i in range(n - 1):
        x[i] = before[i] + dx[i]
        for j in range(n - 1):
            P[i, j] = new[i, j]
    if trail["on"] == 1:
        add_correction(trail, dx, n - 1)
    return total


@njit(cache=True)
def _record_prediction(
    s: Record, cfg: Record, trail: Record, A: Array, n: int, dt: float, source: Array
) -> None:
    """Tell the smoother what :func:`replay.kernels.rtk_states.predict` has done."""
    lead = leading_states(cfg["dynamics"])
    repack(trail, 0, n, source)
    if lead >= 6 and source[0] >= 0:
        for c in range(3):
            carry_rate(trail, c, 3 + c, dt)
            if lead == 9:
                carry_rate(trail, c, 6 + c, 0.5 * dt * dt)
                carry_rate(trail, 3 + c, 6 + c, dt)
    name_states(s, lead, 0, trail["name"])
    open_node(trail, A, n)


@njit(cache=True)
def _count_satellites(
    part: Array, measures: Array, total: int, pairs: Array, status: int, weight: Array
) -> None:
    """Mark the satellites that the position rests on, for the dilution of precision."""
    if status <= SINGLE:
        return
    for k in range(part.shape[0]):
        weight[k] = 0.0
    for k in range(total):
        if measures[k]["use"] == 1 and (measures[k]["kind"] == 1 or status == DGNSS):
            weight[pairs[measures[k]["pair"]]["rover"]] = 1.0


@njit(cache=True)
def run_rtk(
    state: Array, x: Array, P: Array, config: Array, single_config: Array, scratch: Array,
    epochs: Array, rows: Array, base_epochs: Array, base_rows: Array, partner: Array,
    release: Array, solutions: Array, baselines: Array, innovations: Array, ambiguities: Array,
    resolutions: Array, notes: Array, counts: Array, trails: Array, nodes: tuple[Any, ...],
) -> None:  # fmt: skip
    """Work on all rover epochs of a block that are ready.

    Parameters
    ----------
    state, config, single_config, scratch : arrays of one record each
        RTK_STATE_DTYPE, RTK_CONFIG_DTYPE, SINGLE_CONFIG_DTYPE, SOLVE_DTYPE.
    x, P : float64 arrays (ROOM,), (ROOM, ROOM)
        States and covariance; changed.
    epochs, rows, base_epochs, base_rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
    partner, release : int64 arrays (epochs,)
        As :func:`replay.kernels.epoch_matching.match_epochs` filled them.
    solutions : array (epochs,) of SINGLE_ROW_DTYPE
    baselines : array (epochs,) of BASELINE_ROW_DTYPE
    innovations : array (6 * rows,) of RESIDUAL_DTYPE
    ambiguities : array (3 * rows,) of AMBIGUITY_ROW_DTYPE
    resolutions : array (epochs,) of RESOLUTION_ROW_DTYPE
    notes : array (4 * epochs + 3 * rows,) of NOTE_DTYPE
    counts : int64 array (6,)
        Filled: rows of each of the six outputs, in the order above.
    trails : array of one `trail_dtype(ROOM)`
        Changed where it is on.
    nodes : tuple
        As :func:`replay.kernels.transition.close_node` takes it.
    """
    s, cfg, single, work = state[0], config[0], single_config[0], scratch[0]
    trail = trails[0]
    u, v, base_v = np.zeros(3), np.zeros(3), np.zeros(3)
    own = np.zeros(2, dtype=SINGLE_STATE_DTYPE)
    arrays, base_arrays = np.zeros((3, SATELLITES)), np.zeros((3, SATELLITES))
    dropped = np.zeros(SATELLITES, dtype=np.int64)
    pairs = np.zeros(PAIRS, dtype=PAIR_DTYPE)
    measures = np.zeros(2 * PAIRS * SLOTS, dtype=MEASURE_DTYPE)
    candidates = np.zeros(COUNT_LIMIT, dtype=CANDIDATE_DTYPE)
    tries = np.zeros(2, dtype=ATTEMPT_DTYPE)
    starts = np.zeros(2 * SYSTEMS * SLOTS + 1, dtype=np.int64)
    broken = np.zeros((SATELLITES, SLOTS), dtype=np.int64)
    base_x, up, before, axes = np.zeros(3), np.zeros(3), np.zeros(ROOM), np.zeros((3, 3))
    cov, velocity_cov = np.zeros((3, 3)), np.zeros((3, 3))
    position, unused, unused_cov = np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
    span = int(cfg["max_age"] * 1e9)
    for i in range(6):
        counts[i] = 0
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        log_t = release[e]
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        heed_breaks(part, 0, s)
        if epoch["placed"] == 0:
            continue
        alone, clock, moves = _own_position(
            part, epoch, single, own[0], work, arrays, dropped, u, v, cov, velocity_cov
        )
        t = true_time(epoch["t"], clock)
        enu_axes(own[0]["x"][0], own[0]["x"][1], own[0]["x"][2], work["axes"])
        for i in range(3):
            up[i] = work["axes"][2, i]
            position[i] = own[0]["x"][i]
        here = partner[e] >= 0
        if here:
            heed_base(base_epochs, base_rows, partner[e], span, s)
            here = base_epochs[partner[e]]["placed"] == 1
        if not here and s["lost"] == 0:
            since = (epoch["t"] - s["base_t"]) * 1e-9 if s["base_t"] >= 0 else 0.0
            note(notes, counts, t, log_t, EVENT_BASE_LOST, -1, since)
        s["lost"] = 0 if here else 1
        status = SINGLE if alone else 0
        total = 0
        if here:
            base_epoch = base_epochs[partner[e]]
            base_part = base_rows[base_epoch["first"] : base_epoch["first"] + base_epoch["count"]]
            age = (epoch["t"] - base_epoch["t"]) * 1e-9
            base_clock = base_epoch["clock"]
            for i in range(3):
                base_x[i] = base_epoch["x"][i]
                base_v[i] = 0.0
            if cfg["moving"] == 1:
                here, base_clock, _ = _own_position(
                    base_part, base_epoch, single, own[1], work, base_arrays, dropped, u, base_v,
                    unused, unused_cov,
                )  # fmt: skip
                for i in range(3):
                    base_x[i] = own[1]["x"][i]
        if here:
            total = _float_epoch(
                part, base_part, epoch["t"], age, s, x, P, cfg, own[0]["x"], epoch["x"], base_x,
                up, v, velocity_cov, moves, pairs, measures, starts, broken, before, u, trail,
            )  # fmt: skip
            for satellite in range(SATELLITES):
                for slot in range(SLOTS):
                    if broken[satellite, slot] == 1:
                        note(notes, counts, t, log_t, EVENT_SLIP, satellite, float(slot))
            few = cfg["dynamics"] == KINEMATIC and satellite_differences(measures, total, pairs) < 3
            if total < _LEAST_DIFFERENCES or few:
                note(notes, counts, t, log_t, EVENT_TOO_FEW, -1, float(total))
                total = 0
        if total > 0:
            if cfg["length"] > 0.0:
                _constrain_length(x, P, s["n"], base_x, cfg, trail)
            write_residuals(measures, total, pairs, part, t, log_t, innovations, counts)
            phases = settle(measures, total, s)
            status = FLOAT if phases >= _LEAST_DIFFERENCES else DGNSS
            tries[0]["fixed"] = 0
            tried = status == FLOAT and cfg["mode"] != FLOAT_ONLY
            if tried and resolve(
                part, measures, total, pairs, s, cfg, x, P, before, base_x, candidates, tries,
                t, log_t, ambiguities, resolutions, counts, trail,
            ):  # fmt: skip
                status = FIXED
            for i in range(3):
                if status == FIXED:
                    position[i] = tries[0]["x"][i]
                else:
                    position[i] = x[i]
                for j in range(3):
                    if status == FIXED:
                        unused[i, j] = tries[0]["cov"][i, j]
                    else:
                        unused[i, j] = P[i, j]
            # The base moves on until the rover's epoch.
            ahead = age - (clock - base_clock) / SPEED_OF_LIGHT_M_S
            for i in range(3):
                base_x[i] += base_v[i] * ahead
            write_baseline(
                baselines[counts[1]], t, log_t, status, position, unused, base_x, age, axes
            )
            counts[1] += 1
        if here and trail["on"] == 1:
            told = SILENT
            if total > 0:
                held = cfg["mode"] == HOLD and s["fixed"] + 1 >= cfg["hold_count"]
                held = held and tries[0]["whole"] == 1
                told = GIVEN_INTEGERS if status == FIXED and not held else OWN
            for i in range(s["n"]):
                trail["estimate"][i] = x[i]
            if cfg["moving"] == 1:
                # Where the base is, no state knows: the position is about where it was taken to be.
                for i in range(3):
                    trail["estimate"][i] -= base_x[i]
                    trail["name"][i] = BASELINE + i
            close_node(trail, P, s["n"], t, log_t, told, nodes)
        if status == FIXED and s["status"] != FIXED:
            note(notes, counts, t, log_t, EVENT_FIXED, -1, float(tries[0]["fixed"]))
        if status != FIXED and s["status"] == FIXED:
            note(notes, counts, t, log_t, EVENT_FIX_LOST, -1, float(s["fixed"]))
        s["status"] = status
        s["fixed"] = s["fixed"] + 1 if status == FIXED else 0
        if status == 0:
            continue
        out = solutions[counts[0]]
        counts[0] += 1
        if cfg["moving"] == 1 and status > SINGLE:
            # Where the base is, is known no better than a single receiver tells.
            status = SINGLE
            for i in range(3):
                position[i] = own[0]["x"][i]
        if status == SINGLE:
            write_solution(
                out, epoch, t, log_t, status, position, cov, v, velocity_cov, moves, work
            )
        else:
            write_solution(
                out, epoch, t, log_t, status, position, unused, v, velocity_cov, moves, work
            )
        _count_satellites(part, measures, total, pairs, status, arrays[2])
        dilutions(part, arrays[2], own[0]["x"], work, u, out)
