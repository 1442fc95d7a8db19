"""Relative positioning on an inertial system: differences to a base, integers, one filter.

Error states are those of the inertial system and of the vehicle, then those of
:mod:`replay.kernels.rtk_states` but the rover's position, which the inertial system has.
A difference between the receivers measures the antenna, that is position and attitude; the
rest (pairs, breaks, weights, integers and their tests) is that of the filter without
inertial sensors, to which the antenna's predicted position is what comes before.
"""

from typing import Any, Final

import numpy as np
from numba import njit

from replay.kernels.alignment import align_fix
from replay.kernels.ambiguity import COUNT_LIMIT
from replay.kernels.covariance import ATTITUDE, POSITION
from replay.kernels.dilution import dilutions
from replay.kernels.double_difference import build_measures, pair_rows
from replay.kernels.earth import enu_axes
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SLOTS, SYSTEMS
from replay.kernels.gnss_update import mark_epoch
from replay.kernels.kalman import cholesky3, scalar_update
from replay.kernels.loose import NOTE_EARLY, NOTE_FIX
from replay.kernels.output_rows import close_inertial, emit_epoch, emit_solution
from replay.kernels.prediction import advance, remove_sensor_errors
from replay.kernels.records import (
    EVENT_OUTAGE_END,
    EVENT_TIME_BACKWARD,
    FIX_DTYPE,
    MAX_STATES,
    RUNNING,
    STATUS_OUTAGE,
    STATUS_PREDICTED,
)
from replay.kernels.rotation import cross3, rotate3
from replay.kernels.rtk import believe, heed_base, settle, update_epoch
from replay.kernels.rtk_output import (
    note,
    write_ambiguities,
    write_residuals,
    write_resolution,
)
from replay.kernels.rtk_records import (
    DGNSS,
    EVENT_BASE_LOST,
    EVENT_FIX_LOST,
    EVENT_FIXED,
    EVENT_SLIP,
    FIXED,
    FLOAT,
    FLOAT_ONLY,
    HOLD,
    INSTANTANEOUS,
    MEASURE_DTYPE,
    PAIR_DTYPE,
    PAIRS,
    ROOM,
)
from replay.kernels.rtk_resolve import ATTEMPT_DTYPE, CANDIDATE_DTYPE, resolve_epoch
from replay.kernels.rtk_states import (
    compare_frequencies,
    heed_breaks,
    heed_late,
    name_states,
    predict,
)
from replay.kernels.single_point import SINGLE_STATE_DTYPE, true_time
from replay.kernels.tight import ALIGNING, SKIPPED, begin_sample, end_sample, single_fix
from replay.kernels.tight_update import antenna
from replay.kernels.transition import (
    GIVEN_INTEGERS,
    OWN,
    add_correction,
    begin_trail,
    open_node,
    repack,
)
from replay.kernels.types import Array, Record
from replay.kernels.update import feed_back, record_event, state_count

LEAD: Final = 3
RTK_TIGHT_STATES: Final = MAX_STATES + ROOM - LEAD
"""Error states at most: those of the inertial system, and of the differences all but position."""
_LEAST_DIFFERENCES: Final = 4
_NAN = float("nan")


@njit(cache=True)
def _arm(s: Record, lever: Array, arm: Array) -> None:
    """Lever arm in ECEF into `arm` (3,)."""
    arm[0], arm[1], arm[2] = rotate3(s["nav"]["C"], lever[0], lever[1], lever[2])


@njit(cache=True)
def antenna_covariance(P: Array, n: int, first: int, arm: Array, out: Array) -> None:
    """Covariance of the antenna's position and the states from `first` on.

    Parameters
    ----------
    P : float64 array
        Joint covariance; states `first` to `n` - 1 are those of the differences.
    n, first : int
    arm : float64 array (3,), m
        Lever arm, ECEF.
    out : float64 array
        Filled up to 3 + n - first: position, then the states.
    """
    G = np.zeros((3, 6))
    for i in range(3):
        e0 = 1.0 if i == 0 else 0.0
        e1 = 1.0 if i == 1 else 0.0
        e2 = 1.0 if i == 2 else 0.0
        G[i, i] = 1.0
        G[i, 3], G[i, 4], G[i, 5] = cross3(arm[0], arm[1], arm[2], e0, e1, e2)
    for i in range(3):
        for j in range(i, 3):
            total = 0.0
            for a in range(6):
                p = POSITION + a if a < 3 else ATTITUDE + a - 3
                for b in range(6):
                    q = POSITION + b if b < 3 else ATTITUDE + b - 3
                    total += G[i, a] * P[p, q] * G[j, b]
            out[i, j] = total
            out[j, i] = total
        for k in range(first, n):
            total = 0.0
            for a in range(6):
                p = POSITION + a if a < 3 else ATTITUDE + a - 3
                total += G[i, a] * P[p, k]
            out[i, LEAD + k - first] = total
            out[LEAD + k - first, i] = total
    for j in range(first, n):
        for k in range(first, n):
            out[LEAD + j - first, LEAD + k - first] = P[j, k]


@njit(cache=True)
def joint_prior(P: Array, first: int, A: Array, n: int, source: Array, J: Array) -> None:
    """Joint covariance with the states packed as the differences' prediction has them.

    Parameters
    ----------
    P : float64 array
        Joint covariance as it is packed now.
    first : int
        States of the inertial system and the vehicle.
    A : float64 array (n + 1, n + 1)
        Predicted covariance of position, other states and room for a clock.
    n : int
    source : int64 array
        Which state before each one was, minus one where it is new.
    J : float64 array (first + n - 2, first + n - 2)
        Filled; the last state is room for a clock.
    """
    size = first + n - LEAD
    for i in range(first):
        for j in range(first):
            J[i, j] = P[i, j]
        for j in range(LEAD, n):
            old = source[j]
            value = P[i, first + old - LEAD] if old >= LEAD else 0.0
            J[i, first + j - LEAD] = value
            J[first + j - LEAD, i] = value
    for i in range(LEAD, n):
        for j in range(LEAD, n):
            J[first + i - LEAD, first + j - LEAD] = A[i, j]
    for i in range(size + 1):
        J[i, size] = 0.0
        J[size, i] = 0.0


@njit(cache=True)
def to_joint(measures: Array, total: int, first: int, arm: Array, joint: Array) -> None:
    """The same measurements on the joint states: the antenna is position and attitude."""
    for k in range(total):
        m, out = measures[k], joint[k]
        out["kind"] = m["kind"]
        out["pair"] = m["pair"]
        out["slot"] = m["slot"]
        out["group"] = m["group"]
        out["satellite"] = m["satellite"]
        out["z"] = m["z"]
        out["r"] = m["r"]
        out["use"] = m["use"]
        h = m["h"]
        for c in range(3):
            out["index"][c] = POSITION + c
            out["index"][3 + c] = ATTITUDE + c
            out["h"][c] = h[c]
        b0, b1, b2 = cross3(arm[0], arm[1], arm[2], h[0], h[1], h[2])
        out["h"][3] = b0
        out["h"][4] = b1
        out["h"][5] = b2
        for c in range(3, m["count"]):
            out["index"][3 + c] = first + m["index"][c] - LEAD
            out["h"][3 + c] = h[c]
        out["count"] = m["count"] + 3


@njit(cache=True)
def hold_integers(
    s: Record, cfg: Record, rcfg: Record, work: Record, candidates: Array, count: int, first: int
) -> None:
    """Feed the integers back as measurements of the joint states."""
    h, index = np.zeros(2), np.zeros(2, dtype=np.int64)
    n = first + s["extra"]
    dx, aux = work["dx"], s["aux"]
    for i in range(n):
        dx[i] = 0.0
    for i in range(count):
        c = candidates[i]
        if not c["elevation"] >= rcfg["hold_mask"]:
            continue
        weight = 1.0 / (rcfg["hold_sigma"] * c["wavelength"])
        p, q = c["state"] - LEAD, c["base"] - LEAD
        index[0] = first + p
        index[1] = first + q
        h[0] = weight
        h[1] = -weight
        z = c["wavelength"] * c["integer"] - (aux[p] - aux[q])
        scalar_update(s["P"], n, h, index, 2, weight * z, dx, work["b"], work["gain"])
    feed_back(s, cfg, dx, work["q"])
    if work["trail"]["on"] == 1:
        add_correction(work["trail"], dx, n)


@njit(cache=True)
def _float_update(
    s: Record, q: Record, cfg: Record, tcfg: Record, rcfg: Record, work: Record, epoch: Record,
    part: Array, base_part: Array, base_x: Array, age: float, room: tuple[Any, ...],
) -> int:  # fmt: skip
    """Predict the differences' states and update the joint ones; how many measurements."""
    x, P, pairs, measures, joint, starts, broken, source, place, speed, arm, up, u, before = room
    antenna(s, work, tcfg["lever"], place, speed)
    _arm(s, tcfg["lever"], arm)
    count = pair_rows(part, base_part, age, rcfg, place, epoch["x"], base_x, up, pairs, u)
    compare_frequencies(part, base_part, pairs, count, epoch["t"], q, rcfg)
    baseline2 = 0.0
    for c in range(3):
        baseline2 += (place[c] - base_x[c]) * (place[c] - base_x[c])
    baseline = sqrt(baseline2)
    first = state_count(cfg)
    n = first + s["extra"]
    antenna_covariance(s["P"], n, first, arm, P)
    for c in range(3):
        x[c] = place[c]
    for c in range(s["extra"]):
        x[LEAD + c] = s["aux"][c]
    A, size = predict(
        part, base_part, pairs, count, epoch["t"], baseline, q, rcfg, x, P, place, speed, False,
        broken, source,
    )  # fmt: skip
    n = size - 1
    # A filter that begins takes the inertial system's position all the same.
    for c in range(3):
        x[c] = place[c]
    J = np.empty((first + n - LEAD + 1, first + n - LEAD + 1))
    joint_prior(s["P"], first, A, n, source, J)
    trail = work["trail"]
    if trail["on"] == 1:
        places = np.empty(first + n - LEAD, dtype=np.int64)
        for c in range(LEAD, n):
            places[first + c - LEAD] = first + source[c] - LEAD if source[c] >= LEAD else -1
        repack(trail, first, first + n - LEAD, places)
        name_states(q, LEAD, first - LEAD, trail["name"])
        open_node(trail, J, first + n - LEAD)
    groups = build_measures(
        part, base_part, pairs, count, abs(age), baseline, q, rcfg, x, measures, starts
    )
    total = starts[groups]
    to_joint(measures, total, first, arm, joint)
    m = first + n - LEAD
    new, dx = np.empty((m + 1, m + 1)), np.zeros(m + 1)
    update_epoch(
        joint, starts, groups, J, m + 1, rcfg, np.full(3, np.nan), np.zeros((3, 3)), x, new, dx
    )
    joint_P, gathered = s["P"], work["dx"]
    for i in range(m):
        gathered[i] = dx[i]
        for j in range(m):
            joint_P[i, j] = new[i, j]
    s["extra"] = n - LEAD
    for c in range(n):
        before[c] = x[c]
        if c >= LEAD:
            s["aux"][c - LEAD] = x[c]
    feed_back(s, cfg, gathered, work["q"])
    if trail["on"] == 1:
        add_correction(trail, gathered, m)
    for k in range(total):
        measures[k]["use"] = joint[k]["use"]
        measures[k]["residual"] = joint[k]["residual"]
        measures[k]["spread"] = joint[k]["spread"]
    # What the integers are looked for with: the antenna and the states behind it.
    antenna(s, work, tcfg["lever"], place, speed)
    _arm(s, tcfg["lever"], arm)
    antenna_covariance(joint_P, m, first, arm, P)
    for c in range(3):
        x[c] = place[c]
    for c in range(s["extra"]):
        x[LEAD + c] = s["aux"][c]
    return total


@njit(cache=True)
def use_differences(
    s: Record, q: Record, cfg: Record, tcfg: Record, rcfg: Record, work: Record, solve: Record,
    epoch: Record, part: Array, base_epochs: Array, base_rows: Array, partner: int,
    base_x: Array, room: tuple[Any, ...], found: tuple[Any, ...], weight: Array, log_t: int,
    out: tuple[Any, ...],
) -> None:  # fmt: skip
    """Update with the differences of an epoch at the filter's own time."""
    solutions, states, covariances, _, events, counts = out[:6]
    gnss, residuals, ambiguities, resolutions, notes, tally = out[7:]
    x, P, pairs, measures, place, up, u, before = (
        room[0], room[1], room[2], room[3], room[8], room[11], room[12], room[13],
    )  # fmt: skip
    broken = room[6]
    candidates, tries = found
    t = s["t"]
    remove_sensor_errors(s, work)
    heed_breaks(part, 0, q)
    here = partner >= 0
    if here:
        heed_base(base_epochs, base_rows, partner, int(rcfg["max_age"] * 1e9), q)
        here = base_epochs[partner]["placed"] == 1
    if not here and q["lost"] == 0:
        since = (epoch["t"] - q["base_t"]) * 1e-9 if q["base_t"] >= 0 else 0.0
        note(notes, tally, t, log_t, EVENT_BASE_LOST, -1, since)
    q["lost"] = 0 if here else 1
    total, status = 0, 0
    r = s["nav"]["r"]
    enu_axes(r[0], r[1], r[2], solve["axes"])
    for i in range(3):
        up[i] = solve["axes"][2, i]
    for k in range(part.shape[0]):
        weight[k] = 0.0
    if here:
        base = base_epochs[partner]
        base_part = base_rows[base["first"] : base["first"] + base["count"]]
        for i in range(3):
            base_x[i] = base["x"][i]
        age = (epoch["t"] - base["t"]) * 1e-9
        total = _float_update(
            s, q, cfg, tcfg, rcfg, work, epoch, part, base_part, base_x, age, room
        )
        for satellite in range(SATELLITES):
            for slot in range(SLOTS):
                if broken[satellite, slot] == 1:
                    note(notes, tally, t, log_t, EVENT_SLIP, satellite, float(slot))
    if total > 0:
        write_residuals(measures, total, pairs, part, t, log_t, residuals, tally)
        phases = settle(measures, total, q)
        status = FLOAT if phases >= _LEAST_DIFFERENCES else DGNSS
        for k in range(total):
            if measures[k]["use"] == 1:
                weight[pairs[measures[k]["pair"]]["rover"]] = 1.0
        if s["in_outage"] == 1:
            record_event(
                events, counts, t, log_t, EVENT_OUTAGE_END, (t - s["fix_t"]) * 1e-9, NOTE_FIX
            )
            s["in_outage"] = 0
        s["fix_t"] = t
    held = False
    tries[0]["fixed"] = 0
    if status == FLOAT and rcfg["mode"] != FLOAT_ONLY:
        count = resolve_epoch(measures, total, pairs, part, q, rcfg, x, P, candidates, tries)
        tried = tries[0]
        if tried["count"] > 0:
            if believe(measures, candidates, count, q, rcfg, tried, x, P, before, base_x):
                status = FIXED
                whole = tried["whole"] == 1
                often = rcfg["mode"] == HOLD and q["fixed"] + 1 >= rcfg["hold_count"]
                held = whole and (often or rcfg["mode"] == INSTANTANEOUS)
            write_ambiguities(
                candidates, count, measures, pairs, part, tried["whole"] == 1, status == FIXED,
                held, t, log_t, ambiguities, tally,
            )  # fmt: skip
            write_resolution(
                tried, rcfg["threshold"], status == FIXED, held, t, log_t, resolutions, tally
            )
            if held:
                hold_integers(s, cfg, rcfg, work, candidates, count, state_count(cfg))
    if status == FIXED and q["status"] != FIXED:
        note(notes, tally, t, log_t, EVENT_FIXED, -1, float(tries[0]["fixed"]))
    if status != FIXED and q["status"] == FIXED:
        note(notes, tally, t, log_t, EVENT_FIX_LOST, -1, float(q["fixed"]))
    q["status"] = status
    q["fixed"] = q["fixed"] + 1 if status == FIXED else 0
    shown = status if status > 0 else STATUS_PREDICTED
    if work["trail"]["on"] == 1:
        own = GIVEN_INTEGERS if status == FIXED and not held else OWN
        close_inertial(s, cfg, work, log_t, own, out[6])
    emit_solution(s, work, shown, log_t, solutions, counts)
    if status == FIXED and not held:
        show_fixed(s, work, tries[0], x, P, room[10], solutions[counts[0] - 1])
    emit_epoch(s, cfg, log_t, states, covariances, counts)
    row = gnss[tally[0]]
    tally[0] += 1
    row["t"] = t
    row["epoch_t"] = epoch["t"]
    row["log_t"] = log_t
    for i in range(SYSTEMS):
        row["clock"][i] = _NAN
    enu_axes(r[0], r[1], r[2], solve["axes"])
    dilutions(part, weight, place, solve, u, row)


@njit(cache=True)
def show_fixed(
    s: Record, work: Record, tried: Record, x: Array, A: Array, arm: Array, row: Record
) -> None:
    """The solution's position given the integers, which the filter itself does not keep.

    With r and a the positions of the inertial unit and of the antenna, and N the covariance
    of the antenna's once the integers are known, r + K (a_fixed - a) and
    P_rr - K (P_aa - N) K', where K = P_ra P_aa^-1.

    Parameters
    ----------
    s, work : records
    tried : record of ATTEMPT_DTYPE
    x, A : float64 arrays
        Float states and covariance, that of the antenna first.
    arm : float64 array (3,), m
        Lever arm, ECEF.
    row : record of SOLUTION_DTYPE
        Changed.
    """
    axes, P, N, K, L = work["axes"], s["P"], work["N"], work["M"], work["L"]
    for i in range(3):
        for j in range(3):
            K[i, j] = 1.0 if i == j else 0.0
    if cholesky3(A, 3, L):
        for i in range(3):
            p, q = POSITION + i, ATTITUDE
            c0, c1, c2 = cross3(P[p, q], P[p, q + 1], P[p, q + 2], arm[0], arm[1], arm[2])
            y0 = (P[p, POSITION] + c0) / L[0, 0]
            y1 = (P[p, POSITION + 1] + c1 - L[1, 0] * y0) / L[1, 1]
            y2 = (P[p, POSITION + 2] + c2 - L[2, 0] * y0 - L[2, 1] * y1) / L[2, 2]
            K[i, 2] = y2 / L[2, 2]
            K[i, 1] = (y1 - L[2, 1] * K[i, 2]) / L[1, 1]
            K[i, 0] = (y0 - L[1, 0] * K[i, 1] - L[2, 0] * K[i, 2]) / L[0, 0]
    r = s["nav"]["r"]
    for a in range(3):
        row["r"][a] = r[a]
        for i in range(3):
            row["r"][a] += K[a, i] * (tried["x"][i] - x[i])
        for b in range(3):
            total = P[POSITION + a, POSITION + b]
            for i in range(3):
                for j in range(3):
                    total -= K[a, i] * (A[i, j] - tried["cov"][i, j]) * K[b, j]
            N[a, b] = total
    place = 0
    for a in range(3):
        for b in range(a, 3):
            total = 0.0
            for i in range(3):
                for j in range(3):
                    total += axes[a, i] * N[i, j] * axes[b, j]
            row["cov"][place] = total
            place += 1


@njit(cache=True)
def _take_epochs(
    s: Record, q: Record, cfg: Record, tcfg: Record, rcfg: Record, work: Record, solve: Record,
    epochs: Array, rows: Array, base_epochs: Array, base_rows: Array, partner: Array,
    first: int, t: int, log_t: int, fix: Record, single: tuple[Any, ...],
    base_x: Array, room: tuple[Any, ...], found: tuple[Any, ...], out: tuple[Any, ...],
) -> int:  # fmt: skip
    """Use every epoch up to an inertial sample at `t`; the number of the next one."""
    events, counts = out[4], out[5]
    k = first
    early = 0
    while k < epochs.shape[0] and epochs[k]["log_t"] <= log_t:
        epoch = epochs[k]
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        at = true_time(epoch["t"], epoch["clock"] if epoch["placed"] == 1 else 0.0)
        if at > t:
            break
        k += 1
        if s["mode"] != RUNNING:
            heed_breaks(part, 0, q)
            if not single_fix(s, tcfg, epoch, part, fix, solve, single):
                continue
            if fix["t"] < s["imu_t"]:
                early += 1
                continue
            if not align_fix(s, cfg, work, fix, log_t, events, counts):
                continue
            s["fix_t"] = fix["t"]
            mark_epoch(s, fix)
            s["stop_last"] = fix["t"]
            s["nhc_last"] = fix["t"]
            s["extra"] = 0
            q["t"] = -1
            begin_trail(work["trail"])
        elif epoch["placed"] == 0:
            heed_breaks(part, 0, q)
            continue
        elif at < s["t"]:
            heed_late(part, q)
            late = (s["t"] - at) * 1e-9
            record_event(events, counts, epoch["t"], log_t, EVENT_TIME_BACKWARD, late, NOTE_FIX)
            continue
        else:
            if s["in_outage"] == 1 and s["emitted_t"] < s["t"]:
                emit_solution(s, work, STATUS_OUTAGE, log_t, out[0], counts)
                if work["trail"]["on"] == 1:
                    close_inertial(s, cfg, work, log_t, OWN, out[6])
            advance(s, cfg, work, at)
        use_differences(
            s, q, cfg, tcfg, rcfg, work, solve, epoch, part, base_epochs, base_rows,
            partner[k - 1], base_x, room, found, single[3], log_t, out,
        )  # fmt: skip
    if early > 0:
        record_event(events, counts, t, log_t, EVENT_TIME_BACKWARD, float(early), NOTE_EARLY)
    return k


@njit(cache=True)
def run_tight_rtk(
    state: Array, rtk_state: Array, config: Array, tight_config: Array, rtk_config: Array,
    scratch: Array, solve_scratch: Array, imu_t: Array, imu_log_t: Array, imu_w: Array,
    imu_f: Array, epochs: Array, rows: Array, base_epochs: Array, base_rows: Array,
    partner: Array, out: tuple[Any, ...],
) -> int:  # fmt: skip
    """Carry the filter over a block.

    Parameters
    ----------
    state, rtk_state : arrays of one record each
        Of `state_dtype(RTK_TIGHT_STATES)` and RTK_STATE_DTYPE; changed in place.
    config, tight_config, rtk_config : arrays of one record each
    scratch, solve_scratch : arrays of one `work_dtype(RTK_TIGHT_STATES)`, one SOLVE_DTYPE
    imu_t, imu_log_t, imu_w, imu_f
        As :func:`replay.kernels.tight.run_tight` takes them.
    epochs, rows, base_epochs, base_rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
        The rover's epochs bear the log time of their release.
    partner : int64 array (epochs,)
        Base epoch of each, or minus one.
    out : tuple of arrays
        Solutions, epochs, covariances, innovations, events, counts as
        :func:`replay.kernels.loose.run_block` fills them; nodes; SINGLE_ROW_DTYPE, RESIDUAL_DTYPE,
        AMBIGUITY_ROW_DTYPE, RESOLUTION_ROW_DTYPE, NOTE_DTYPE; int64 (6,) rows of them as
        :mod:`replay.kernels.rtk_output` counts: geometry 0, residuals 2, ambiguities 3,
        resolutions 4, notes 5.

    Returns
    -------
    int
        How many of the epochs were taken.
    """
    s, q, cfg, tcfg, rcfg = state[0], rtk_state[0], config[0], tight_config[0], rtk_config[0]
    work, solve = scratch[0], solve_scratch[0]
    # What a step leaves in the scratch must not depend on where the block was cut.
    work["decay_dt"] = -1.0
    fix = np.zeros(1, dtype=FIX_DTYPE)[0]
    single = (
        np.zeros(1, dtype=SINGLE_STATE_DTYPE),
        np.zeros(SATELLITES),
        np.zeros(SATELLITES),
        np.zeros(SATELLITES),
        np.zeros(SATELLITES, dtype=np.int64),
        np.zeros(3),
        np.zeros(3),
    )
    room = (
        np.zeros(ROOM),
        np.zeros((ROOM, ROOM)),
        np.zeros(PAIRS, dtype=PAIR_DTYPE),
        np.zeros(2 * PAIRS * SLOTS, dtype=MEASURE_DTYPE),
        np.zeros(2 * PAIRS * SLOTS, dtype=MEASURE_DTYPE),
        np.zeros(2 * SYSTEMS * SLOTS + 1, dtype=np.int64),
        np.zeros((SATELLITES, SLOTS), dtype=np.int64),
        np.zeros(ROOM, dtype=np.int64),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros(ROOM),
    )
    found = (
        np.zeros(COUNT_LIMIT, dtype=CANDIDATE_DTYPE),
        np.zeros(2, dtype=ATTEMPT_DTYPE),
    )
    base_x = np.zeros(3)
    taken = 0
    for k in range(imu_t.shape[0]):
        begun = begin_sample(s, cfg, work, imu_t[k], imu_log_t[k], imu_w[k], imu_f[k], out[:7])
        if begun == SKIPPED:
            continue
        taken = _take_epochs(
            s, q, cfg, tcfg, rcfg, work, solve, epochs, rows, base_epochs, base_rows, partner,
            taken, imu_t[k], imu_log_t[k], fix, single, base_x, room, found, out,
        )  # fmt: skip
        end_sample(s, cfg, work, imu_t[k], imu_log_t[k], begun == ALIGNING, out[:7])
    return taken
