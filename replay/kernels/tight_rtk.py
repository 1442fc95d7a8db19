"""Relative positioning on an inertial system: differences to a base, integers, one filter.

Error states are those of the inertial system and of the vehicle, then those of
:mod:`replay.kernels.rtk_states` but the rover's position, which the inertial system has.
A difference between the receivers measures the antenna, that is position and attitude; the
rest (pairs, breaks, weights, integers and their tests) is that of the filter without
inertial sensors, to which the antenna's predicted position is what comes before.
"""

from typing import Any

import numpy as np
from numba import njit

from replay.kernels.alignment import align_fix
from replay.kernels.ambiguity import COUNT_LIMIT
from replay.kernels.gnss_records import SATELLITES, SLOTS, SYSTEMS
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
from replay.kernels.records import FIX_DTYPE, RUNNING
from replay.kernels.rtk_records import MEASURE_DTYPE, PAIR_DTYPE, PAIRS, ROOM
from replay.kernels.rtk_states import heed_breaks, heed_late
from replay.kernels.single_records import SINGLE_STATE_DTYPE
from replay.kernels.single_solve import true_time
from replay.kernels.tight import single_fix
from replay.kernels.tight_rtk_epoch import use_differences
from replay.kernels.transition import begin_trail
from replay.kernels.types import Array, Record


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
            set_out(s, fix)
            s["extra"] = 0
            q["t"] = -1
            begin_trail(work["trail"])
        elif epoch["placed"] == 0:
            heed_breaks(part, 0, q)
            continue
        elif at < s["t"]:
            heed_late(part, q)
            refuse_late(s, at, epoch["t"], log_t, events, counts)
            continue
        else:
            arrive(s, cfg, work, at, log_t, out)
        use_differences(
            s, q, cfg, tcfg, rcfg, work, solve, epoch, part, base_epochs, base_rows,
            partner[k - 1], base_x, room, found, single[3], log_t, out,
        )  # fmt: skip
    refuse_early(early, t, log_t, events, counts)
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
