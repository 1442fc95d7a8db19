"""How precise point positioning comes onto an inertial system.

Until the unit is aligned the receiver is positioned without it, so that ambiguities and
delays converge while a vehicle stands; what is known then of the antenna and of all
other states, correlations with it, becomes that of the joint filter.
"""

from typing import Any, Final

import numpy as np
from numba import njit

from replay.kernels.covariance import POSITION, VELOCITY
from replay.kernels.earth import EARTH_RATE_RAD_S, enu_axes
from replay.kernels.ppp import float_epoch
from replay.kernels.ppp_slips import code_jump
from replay.kernels.ppp_states import begin_again
from replay.kernels.ppp_update import count_used, settle
from replay.kernels.records import LEVELLED
from replay.kernels.rotation import cross3, rotate3
from replay.kernels.rtk_states import heed_breaks
from replay.kernels.single_solve import true_time
from replay.kernels.tight_ppp_records import LEAD
from replay.kernels.types import Array, Record
from replay.kernels.update import state_count

_LEAST_SATELLITES: Final = 4
# What an alignment asks of the antenna's position (m) and velocity (m/s), each axis.
_PLACE_SIGMA: Final = 30.0
_SPEED_SIGMA: Final = 0.5


@njit(cache=True)
def _rests(s: Record) -> bool:
    """Whether a unit that was levelled has not moved since."""
    v = s["align_v"]
    return s["mode"] == LEVELLED and v[0] == 0.0 and v[1] == 0.0 and v[2] == 0.0


@njit(cache=True)
def plain_epoch(
    s: Record, q: Record, pcfg: Record, rcfg: Record, solve: Record, epoch: Record, part: Array,
    fix: Record, room: tuple[Any, ...],
) -> tuple[int, int]:  # fmt: skip
    """Use an epoch without the inertial system, and offer what is found as a fix.

    Parameters
    ----------
    s, q : records of `state_dtype`, PPP_STATE_DTYPE
        The states rest in `s`, which is not in use yet.
    pcfg, rcfg, solve : records
    epoch, part : record of EPOCH_DTYPE, array of MEASURED_DTYPE
    fix : record of FIX_DTYPE
        Filled; its position and velocity are those of the antenna, ECEF.
    room : tuple
        As :func:`replay.kernels.tight_ppp.run_tight_ppp` makes it.

    Returns
    -------
    int, int
        Views and measurements; minus one and nought where there is no fix.
    """
    x, P, views, _, joint, broken = room[:6]
    up, u = room[11], room[12]
    heed_breaks(part, 0, q)
    if epoch["placed"] == 0 or (q["t"] >= 0 and epoch["t"] <= q["t"]):
        return -1, 0
    n = q["n"]
    for i in range(n):
        x[i] = s["aux"][i]
        for j in range(n):
            P[i, j] = s["P"][i, j]
    if n > 0 and q["t"] >= 0 and not _rests(s):
        # A vehicle under way may be anywhere: its acceleration within the interval is not told.
        for i in range(3):
            P[i, i] += rcfg["position_sigma"] * rcfg["position_sigma"]
    code_jump(part, epoch["t"], q, x, rcfg)
    axes = solve["axes"]
    enu_axes(epoch["x"][0], epoch["x"][1], epoch["x"][2], axes)
    for i in range(3):
        up[i] = axes[2, i]
    count, total, dropped = float_epoch(
        part, epoch["t"], epoch["clock"], q, x, P, rcfg, epoch["x"], epoch["x"], up, np.zeros(3),
        views, joint, broken, u,
    )  # fmt: skip
    satellites, used = count_used(joint, total)
    settle(joint, total, q)
    failed = dropped >= rcfg["rounds"] or dropped > used
    q["failed"] = q["failed"] + 1 if failed else 0
    if q["failed"] >= rcfg["failures"]:
        begin_again(q)
        return -1, 0
    n = q["n"]
    for i in range(n):
        s["aux"][i] = x[i]
        for j in range(n):
            s["P"][i, j] = P[i, j]
    worst = 0.0
    for i in range(3):
        worst = max(worst, P[i, i] / (_PLACE_SIGMA * _PLACE_SIGMA))
        worst = max(worst, P[3 + i, 3 + i] / (_SPEED_SIGMA * _SPEED_SIGMA))
    if satellites < _LEAST_SATELLITES or not worst < 1.0:
        return -1, 0
    fix["t"] = true_time(epoch["t"], x[q["clock"]])
    fix["log_t"] = epoch["log_t"]
    fix["has_v"] = 1
    for i in range(3):
        fix["r"][i] = x[i]
        fix["v"][i] = x[3 + i]
        fix["lever"][i] = pcfg["lever"][i]
    for i in range(6):
        # The joint filter takes the whole covariance.
        fix["R"][i] = 0.0
    return count, total


@njit(cache=True)
def join(
    s: Record, q: Record, cfg: Record, work: Record, lever: Array, G: Array, index: Array,
    known: int, x: Array, P: Array,
) -> None:  # fmt: skip
    """Make the joint states of an aligned unit and of what the receiver alone has found.

    Errors of the antenna are G times those of the unit: position and velocity of the unit
    are as wrong as the antenna's, less what attitude and gyroscopes make of the lever arm.

    Parameters
    ----------
    s, q : records of `state_dtype`, PPP_STATE_DTYPE
        `s` is aligned; its position and velocity, their covariance and the states behind
        those of the vehicle are filled.
    cfg, work : records of CONFIG_DTYPE, `work_dtype`
    lever : float64 array (3,), m
    G, index, known
        As :func:`replay.kernels.tight_ppp_states.antenna_rows` gives them.
    x, P : float64 arrays
        States and covariance of the receiver alone, the antenna's motion first.
    """
    nav, joint, first = s["nav"], s["P"], state_count(cfg)
    C, w = nav["C"], work["w"]
    a0, a1, a2 = rotate3(C, lever[0], lever[1], lever[2])
    c0, c1, c2 = cross3(w[0], w[1], w[2], lever[0], lever[1], lever[2])
    b0, b1, b2 = rotate3(C, c0, c1, c2)
    r, v = nav["r"], nav["v"]
    r[0] = x[0] - a0
    r[1] = x[1] - a1
    r[2] = x[2] - a2
    v[0] = x[3] - b0 - EARTH_RATE_RAD_S * a1
    v[1] = x[4] - b1 + EARTH_RATE_RAD_S * a0
    v[2] = x[5] - b2
    n = q["n"]
    size = first + n - LEAD
    for i in range(LEAD):
        for j in range(size):
            joint[POSITION + i, j] = 0.0
            joint[j, POSITION + i] = 0.0
    for i in range(first, size):
        s["aux"][i - first] = x[i - first + LEAD]
        for j in range(size):
            joint[i, j] = 0.0
            joint[j, i] = 0.0
    for i in range(LEAD, n):
        for j in range(LEAD, n):
            joint[first + i - LEAD, first + j - LEAD] = P[i, j]
        for j in range(LEAD):
            joint[first + i - LEAD, POSITION + j] = P[i, j]
            joint[POSITION + j, first + i - LEAD] = P[i, j]
    for i in range(LEAD):
        for j in range(VELOCITY + 3, first):
            total = 0.0
            for a in range(LEAD, known):
                total -= G[i, a] * joint[index[a], j]
            joint[POSITION + i, j] = total
            joint[j, POSITION + i] = total
    for i in range(LEAD):
        for j in range(i, LEAD):
            total = P[i, j]
            for a in range(LEAD, known):
                # That of G times what was just filled, which has a minus.
                total -= G[i, a] * joint[index[a], POSITION + j]
            joint[POSITION + i, POSITION + j] = total
            joint[POSITION + j, POSITION + i] = total
    s["extra"] = n - LEAD
