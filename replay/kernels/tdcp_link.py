"""Displacements of an antenna as measurements of an inertial system.

The antenna's place at some epoch becomes three more error states, a clone (Roumeliotis
and Burdick 2002), which says by its correlation how wrong the place of then was. Place
now less place then is what a displacement measures; how wrong both are in common does not
matter, and cannot be learned from it. A new clone is a new beginning: what the inertial
system carried over a break of the phases stays as uncertain as it is.
"""

from typing import Any, Final

from numba import njit

from replay.kernels.covariance import ATTITUDE, POSITION, VELOCITY
from replay.kernels.earth import enu_axes
from replay.kernels.gnss_update import mark_epoch, position_update, velocity_update
from replay.kernels.inertial_samples import NOTE_FIX, end_outage
from replay.kernels.output_rows import close_inertial, emit_epoch, emit_solution, name_extras
from replay.kernels.prediction import remove_sensor_errors
from replay.kernels.records import (
    AXIS_EAST,
    EVENT_REJECTED,
    EVENT_RESET,
    LINK_EACH,
    LINK_SUM,
    STATUS_PREDICTED,
    STATUS_UPDATED,
)
from replay.kernels.rotation import cross3, rotate3
from replay.kernels.transition import OWN, copy_antenna
from replay.kernels.types import Array, Record
from replay.kernels.update import fill_covariance, record_event, state_count, update

KIND_DISPLACEMENT: Final = 11
CLONE_STATES: Final = 3


@njit(cache=True)
def ready_to_align(s: Record, fix: Record) -> bool:
    """Turn the mean velocity of an interval into that at its end; False where it cannot be.

    Means are velocities of the middles of their intervals: a straight line through the
    last two leads to the end.
    """
    before, span = s["chain_v"], fix["window"]
    known = fix["has_v"] == 1
    follows = known and s["chain_span"] > 0.0 and s["chain_t"] == fix["since"]
    s["chain_t"] = fix["t"]
    apart = 0.5 * (span + s["chain_span"])
    s["chain_span"] = span if known else 0.0
    for i in range(3):
        mean = fix["v"][i]
        if follows:
            fix["v"][i] = mean + (mean - before[i]) * 0.5 * span / apart
        before[i] = mean
    return follows


@njit(cache=True)
def begin_chain(s: Record, cfg: Record, work: Record, fix: Record) -> None:
    """Take the antenna's place now as the place that displacements are counted from."""
    nav, P, lever, aux = s["nav"], s["P"], fix["lever"], s["aux"]
    n = state_count(cfg)
    a0, a1, a2 = rotate3(nav["C"], lever[0], lever[1], lever[2])
    aux[0] = nav["r"][0] + a0
    aux[1] = nav["r"][1] + a1
    aux[2] = nav["r"][2] + a2
    s["extra"] = CLONE_STATES
    if work["trail"]["on"] == 1:
        name_extras(s, cfg, work)
        copy_antenna(work["trail"], n, a0, a1, a2)
    # The antenna's error is dr + psi x a.
    for j in range(n):
        c0, c1, c2 = cross3(P[ATTITUDE, j], P[ATTITUDE + 1, j], P[ATTITUDE + 2, j], a0, a1, a2)
        P[n, j] = P[POSITION, j] + c0
        P[n + 1, j] = P[POSITION + 1, j] + c1
        P[n + 2, j] = P[POSITION + 2, j] + c2
        for i in range(3):
            P[j, n + i] = P[n + i, j]
    for i in range(3):
        row = P[n + i]
        c0, c1, c2 = cross3(row[ATTITUDE], row[ATTITUDE + 1], row[ATTITUDE + 2], a0, a1, a2)
        P[n + i, n] = row[POSITION] + c0
        P[n + i, n + 1] = row[POSITION + 1] + c1
        P[n + i, n + 2] = row[POSITION + 2] + c2
    for i in range(3):
        for j in range(i):
            P[n + i, n + j] = P[n + j, n + i]
        s["chain_sum"][i] = 0.0


@njit(cache=True)
def displacement_update(
    s: Record,
    cfg: Record,
    work: Record,
    fix: Record,
    force: bool,
    t: int,
    log_t: int,
    innovations: Array,
    counts: Array,
) -> bool:
    """Use the sum of displacements since the clone; whether it was used."""
    nav, aux, moved = s["nav"], s["aux"], s["chain_sum"]
    r, C, lever = nav["r"], nav["C"], fix["lever"]
    H, index, z, u = work["H"], work["index"], work["z"], work["axes"]
    fill_covariance(work["R"], fix["D"], 1.0, cfg["position_floor"])
    a0, a1, a2 = rotate3(C, lever[0], lever[1], lever[2])
    d0 = aux[0] + moved[0] - r[0] - a0
    d1 = aux[1] + moved[1] - r[1] - a1
    d2 = aux[2] + moved[2] - r[2] - a2
    enu_axes(r[0], r[1], r[2], u)
    n = state_count(cfg)
    for i in range(3):
        index[i] = POSITION + i
        index[3 + i] = ATTITUDE + i
        index[6 + i] = n + i
    for i in range(3):
        z[i] = u[i, 0] * d0 + u[i, 1] * d1 + u[i, 2] * d2
        H[i, 3], H[i, 4], H[i, 5] = cross3(a0, a1, a2, u[i, 0], u[i, 1], u[i, 2])
        for j in range(3):
            H[i, j] = u[i, j]
            H[i, 6 + j] = -u[i, j]
    return update(
        s, cfg, work, 3, 9, cfg["position_gate"], force, KIND_DISPLACEMENT, AXIS_EAST, t, log_t,
        innovations, counts,
    )  # fmt: skip


@njit(cache=True)
def _doubt(s: Record, cfg: Record) -> None:
    """Widen what a displacement is about, after it was refused again and again."""
    P = s["P"]
    velocity = 100.0 * cfg["velocity_initial"] * cfg["velocity_initial"]
    attitude = cfg["heading_initial"] * cfg["heading_initial"]
    for i in range(3):
        P[POSITION + i, POSITION + i] += velocity
        P[VELOCITY + i, VELOCITY + i] += velocity
        P[ATTITUDE + i, ATTITUDE + i] += attitude


@njit(cache=True)
def _link(
    s: Record, cfg: Record, work: Record, fix: Record, log_t: int, out: tuple[Any, ...]
) -> bool:
    """Use one displacement; whether it was used."""
    innovations, events, counts = out[3], out[4], out[5]
    t = fix["t"]
    force = cfg["rejections"] > 0 and s["rejected"] >= cfg["rejections"]
    if force:
        _doubt(s, cfg)
    for i in range(3):
        s["chain_sum"][i] += fix["d"][i]
    used = displacement_update(s, cfg, work, fix, force, t, log_t, innovations, counts)
    if not used:
        s["rejected"] += 1
        record_event(events, counts, t, log_t, EVENT_REJECTED, float(s["rejected"]), NOTE_FIX)
        return False
    if force:
        record_event(events, counts, t, log_t, EVENT_RESET, float(s["rejected"]), NOTE_FIX)
    s["rejected"] = 0
    end_outage(s, t, log_t, events, counts)
    if fix["has_v"] == 1 and cfg["use_velocity"] == 1:
        velocity_update(s, cfg, work, fix, force, t, log_t, innovations, counts)
    return True


@njit(cache=True)
def use_link(
    s: Record, cfg: Record, work: Record, fix: Record, log_t: int, out: tuple[Any, ...]
) -> None:
    """Update with one epoch of a chain at the filter's own time, or begin a chain there.

    A displacement counts where it begins at the epoch that was used last. One that is
    refused ends the chain: the inertial system carries the place on.
    """
    solutions, epochs, covariances, innovations, _, counts, nodes = out
    remove_sensor_errors(s, work)
    linked = fix["chain"] == LINK_SUM or fix["chain"] == LINK_EACH
    used = False
    if linked and s["extra"] == CLONE_STATES and s["chain_t"] == fix["since"]:
        used = _link(s, cfg, work, fix, log_t, out)
    elif fix["anchor"] == 1:
        position_update(s, cfg, work, fix, False, fix["t"], log_t, innovations, counts)
    status = STATUS_UPDATED if used else STATUS_PREDICTED
    if work["trail"]["on"] == 1:
        close_inertial(s, cfg, work, log_t, OWN, nodes)
    if not used or fix["chain"] == LINK_EACH:
        begin_chain(s, cfg, work, fix)
    s["chain_t"] = fix["t"]
    mark_epoch(s, fix)
    emit_solution(s, work, status, log_t, solutions, counts)
    emit_epoch(s, cfg, log_t, epochs, covariances, counts)
