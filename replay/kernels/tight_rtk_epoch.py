"""One epoch of relative positioning on an inertial system: differences, integers, a solution."""

from typing import Any, Final

import numpy as np
from numba import njit

from replay.kernels.antenna_measures import antenna
from replay.kernels.covariance import ATTITUDE, POSITION
from replay.kernels.dilution import dilutions
from replay.kernels.double_difference import build_measures, pair_rows
from replay.kernels.earth import enu_axes, local_covariance
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SLOTS, SYSTEMS
from replay.kernels.inertial_samples import end_outage
from replay.kernels.kalman import cholesky3, scalar_update
from replay.kernels.output_rows import close_inertial, emit_epoch, emit_solution
from replay.kernels.prediction import remove_sensor_errors
from replay.kernels.records import STATUS_PREDICTED
from replay.kernels.rotation import cross3
from replay.kernels.rtk_output import note, write_ambiguities, write_residuals, write_resolution
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
)
from replay.kernels.rtk_resolve import believe, resolve_epoch
from replay.kernels.rtk_states import compare_frequencies, heed_breaks, name_states, predict
from replay.kernels.rtk_update import heed_base, settle, update_epoch
from replay.kernels.tight_rtk_states import (
    LEAD,
    antenna_covariance,
    joint_prior,
    lever_arm,
    to_joint,
)
from replay.kernels.transition import GIVEN_INTEGERS, OWN, add_correction, open_node, repack
from replay.kernels.types import Array, Record
from replay.kernels.update import feed_back, state_count

_NAN = float("nan")
_LEAST_DIFFERENCES: Final = 4


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
    lever_arm(s, tcfg["lever"], arm)
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
    lever_arm(s, tcfg["lever"], arm)
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
        end_outage(s, t, log_t, events, counts)
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
    local_covariance(axes, N, row["cov"])
