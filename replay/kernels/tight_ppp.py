"""Precise point positioning on an inertial system: codes, phases and Doppler, one filter.

Kan et al. (2022), eqs. 2 to 7. Error states are those of the inertial system and of the
vehicle, then those of :mod:`replay.kernels.ppp_states` but the antenna's motion, which the
inertial system has. What is observed measures the antenna: its position and attitude, its
velocity and rate. Three satellites are still worth something; what a satellite was before
a gap, its ambiguities with it, lives on as long as they may.
"""

from typing import Any, Final

import numpy as np
from numba import njit

from replay.kernels.alignment import align_fix
from replay.kernels.ambiguity import COUNT_LIMIT
from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.inertial_samples import (
    ALIGNING,
    SKIPPED,
    arrive,
    begin_sample,
    end_sample,
    refuse_early,
    refuse_late,
    set_out,
)
from replay.kernels.integers import ATTEMPT_DTYPE, CANDIDATE_DTYPE
from replay.kernels.ppp_records import (
    MEASURES,
    PPP_MEASURE_DTYPE,
    ROOM,
    VIEW_DTYPE,
    VIEWS,
)
from replay.kernels.prediction import remove_sensor_errors
from replay.kernels.records import (
    FIX_DTYPE,
    RUNNING,
)
from replay.kernels.rtk_states import heed_breaks, heed_late
from replay.kernels.single_solve import true_time
from replay.kernels.tight_ppp_begin import join, plain_epoch
from replay.kernels.tight_ppp_epoch import say_epoch, use_epoch
from replay.kernels.tight_ppp_measures import heading_of
from replay.kernels.tight_ppp_records import LEAD, PPP_TIGHT_STATES
from replay.kernels.tight_ppp_states import (
    ANTENNA_STATES,
    antenna_rows,
    name_states,
)
from replay.kernels.transition import (
    begin_trail,
)
from replay.kernels.types import Array, Record
from replay.kernels.update import state_count

_LEAST_PHASES: Final = 4
_SET_ANEW_M: Final = 3000.0


@njit(cache=True)
def epoch_time(s: Record, g: Record, q: Record, epoch: Record) -> int:
    """True time (ns) of an epoch by the filter's clock, or by the coarse one before it has one."""
    coarse = epoch["clock"] if epoch["placed"] == 1 else 0.0
    if q["clock"] < 0 or q["drift"] < 0:
        return true_time(epoch["t"], coarse)
    aux = s["aux"]
    dt = (epoch["t"] - g["clock_t"]) * 1e-9
    expected = aux[q["clock"] - LEAD] + dt * aux[q["drift"] - LEAD]
    # A receiver that has set its clock since says so in the coarse position.
    set_anew = epoch["placed"] == 1 and epoch["age"] == 0.0
    if set_anew and abs(epoch["clock"] - expected) > _SET_ANEW_M:
        return true_time(epoch["t"], epoch["clock"])
    return true_time(epoch["t"], expected)


@njit(cache=True)
def _take_over(
    s: Record, q: Record, cfg: Record, pcfg: Record, work: Record, room: tuple[Any, ...]
) -> None:
    """Bring what the receiver alone has found onto the unit that was aligned just now."""
    x, P, place, speed = room[0], room[1], room[9], room[10]
    G, index = room[14]
    remove_sensor_errors(s, work)
    known = antenna_rows(s, cfg, work, pcfg["lever"], G, index)
    join(s, q, cfg, work, pcfg["lever"], G, index, known, x, P)
    for c in range(3):
        place[c] = x[c]
        speed[c] = x[3 + c]
    trail = work["trail"]
    if trail["on"] == 1:
        name_states(q, state_count(cfg), trail["name"])


@njit(cache=True)
def _take_epochs(
    s: Record, g: Record, q: Record, cfg: Record, pcfg: Record, rcfg: Record, work: Record,
    solve: Record, epochs: Array, rows: Array, first: int, t: int, log_t: int, fix: Record,
    weight: Array, room: tuple[Any, ...], found: tuple[Any, ...], out: tuple[Any, ...],
) -> int:  # fmt: skip
    """Use every epoch up to an inertial sample at `t`; the number of the next one."""
    events, counts = out[4], out[5]
    k = first
    early = 0
    while k < epochs.shape[0] and epochs[k]["log_t"] <= log_t:
        epoch = epochs[k]
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        at = epoch_time(s, g, q, epoch)
        if at > t:
            break
        k += 1
        if s["mode"] != RUNNING:
            count, total = plain_epoch(s, q, pcfg, rcfg, solve, epoch, part, fix, room)
            if count < 0:
                continue
            if fix["t"] < s["imu_t"]:
                early += 1
                continue
            if not align_fix(s, cfg, work, fix, log_t, events, counts):
                continue
            set_out(s, fix)
            g["clock_t"] = s["t"]
            g["heading"] = heading_of(s["nav"]["C"], solve["axes"])
            g["turn"] = 0.0
            begin_trail(work["trail"])
            _take_over(s, q, cfg, pcfg, work, room)
        elif at < s["t"] or (q["t"] >= 0 and epoch["t"] <= q["t"]):
            heed_late(part, q)
            refuse_late(s, at, epoch["t"], log_t, events, counts)
            continue
        elif epoch["placed"] == 0:
            heed_breaks(part, 0, q)
            continue
        else:
            arrive(s, cfg, work, at, log_t, out)
            count, total = use_epoch(
                s, g, q, cfg, pcfg, rcfg, work, solve, epoch, part, room, log_t, out
            )
        say_epoch(
            s, q, cfg, pcfg, rcfg, work, solve, epoch, part, count, total, room, found, weight,
            log_t, out,
        )  # fmt: skip
    refuse_early(early, t, log_t, events, counts)
    return k


@njit(cache=True)
def run_tight_ppp(
    state: Array, own_state: Array, ppp_state: Array, config: Array, own_config: Array,
    ppp_config: Array, scratch: Array, solve_scratch: Array, imu_t: Array, imu_log_t: Array,
    imu_w: Array, imu_f: Array, epochs: Array, rows: Array, out: tuple[Any, ...],
) -> int:  # fmt: skip
    """Carry the filter over a block.

    Parameters
    ----------
    state, own_state, ppp_state : arrays of one record each
        Of `state_dtype(PPP_TIGHT_STATES)`, TIGHT_PPP_STATE_DTYPE and PPP_STATE_DTYPE;
        changed in place.
    config, own_config, ppp_config : arrays of one record each
        Of CONFIG_DTYPE, TIGHT_PPP_CONFIG_DTYPE and PPP_CONFIG_DTYPE.
    scratch, solve_scratch : arrays of one `work_dtype(PPP_TIGHT_STATES)`, one SOLVE_DTYPE
    imu_t, imu_log_t, imu_w, imu_f, epochs, rows
        As :func:`replay.kernels.tight.run_tight` takes them.
    out : tuple of arrays
        Solutions, epochs, covariances, innovations, events, counts and nodes as
        :func:`replay.kernels.loose.run_block` fills them; SINGLE_ROW_DTYPE, RESIDUAL_DTYPE,
        AMBIGUITY_ROW_DTYPE, RESOLUTION_ROW_DTYPE, NOTE_DTYPE, ZENITH_ROW_DTYPE,
        SLANT_ROW_DTYPE, BIAS_ROW_DTYPE, PHASE_ROW_DTYPE; int64 array (10,): rows of them as
        :mod:`replay.kernels.ppp_output` numbers them.

    Returns
    -------
    int
        How many of the epochs were taken; the others wait for later samples.
    """
    s, g, q = state[0], own_state[0], ppp_state[0]
    cfg, pcfg, rcfg = config[0], own_config[0], ppp_config[0]
    work, solve = scratch[0], solve_scratch[0]
    # What a step leaves in the scratch must not depend on where the block was cut.
    work["decay_dt"] = -1.0
    fix = np.zeros(1, dtype=FIX_DTYPE)[0]
    weight = np.zeros(SATELLITES)
    room = (
        np.zeros(ROOM),
        np.zeros((ROOM, ROOM)),
        np.zeros(VIEWS, dtype=VIEW_DTYPE),
        np.zeros(MEASURES, dtype=PPP_MEASURE_DTYPE),
        np.zeros(MEASURES, dtype=PPP_MEASURE_DTYPE),
        np.zeros((SATELLITES, SLOTS), dtype=np.int64),
        np.zeros(ROOM, dtype=np.int64),
        np.zeros(ROOM),
        np.zeros((PPP_TIGHT_STATES, PPP_TIGHT_STATES)),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros(MEASURES),
        (np.zeros((LEAD, ANTENNA_STATES)), np.zeros(ANTENNA_STATES, dtype=np.int64)),
    )
    found = (
        np.zeros(COUNT_LIMIT, dtype=CANDIDATE_DTYPE),
        np.zeros(2, dtype=ATTEMPT_DTYPE),
        np.zeros(3),
    )
    taken = 0
    for k in range(imu_t.shape[0]):
        begun = begin_sample(s, cfg, work, imu_t[k], imu_log_t[k], imu_w[k], imu_f[k], out[:7])
        if begun == SKIPPED:
            continue
        taken = _take_epochs(
            s, g, q, cfg, pcfg, rcfg, work, solve, epochs, rows, taken, imu_t[k], imu_log_t[k],
            fix, weight, room, found, out,
        )  # fmt: skip
        end_sample(s, cfg, work, imu_t[k], imu_log_t[k], begun == ALIGNING, out[:7])
    return taken
