"""A baseline between two reference stations, epoch after epoch: integers and what is left.

The float filter never learns of integers, so that it goes on to judge them; see
:mod:`replay.kernels.network_integers`.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.ambiguity import COUNT_LIMIT
from replay.kernels.double_difference import (
    build_measures,
    difference,
    difference_variance,
    pair_rows,
)
from replay.kernels.earth import enu_axes
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SLOTS, SYSTEMS
from replay.kernels.network_integers import forget, refer, search, usable_satellites
from replay.kernels.network_records import (
    EVENT_STATION_FOUND,
    EVENT_STATION_LOST,
    INTEGER_DTYPE,
    STEP_ROW_DTYPE,
    WIDE_LANE_SIGNAL,
)
from replay.kernels.network_search import FIRST, SECOND, WIDE, floats
from replay.kernels.rtk_output import note
from replay.kernels.rtk_records import (
    AMBIGUITY_FIXED,
    AMBIGUITY_FLOAT,
    AMBIGUITY_REJECTED,
    EVENT_SLIP,
    EVENT_TOO_FEW,
    MEASURE_DTYPE,
    PAIR_DTYPE,
    PAIRS,
    ROOM,
)
from replay.kernels.rtk_states import compare_frequencies, heed_breaks, predict
from replay.kernels.rtk_update import heed_base, settle, update_epoch
from replay.kernels.types import Array, Record

_LEAST_DIFFERENCES: Final = 4
_NAN = float("nan")

# Places in `counts`; events stand where :func:`replay.kernels.rtk_output.note` counts them.
AMBIGUITIES: Final = 0
STEPS: Final = 1
RESIDUALS: Final = 2
NOTES: Final = 5


@njit(cache=True)
def _write(
    usable: Array, n: int, pairs: Array, station: Array, master: Array, x: Array, P: Array,
    k: Record, rcfg: Record, cfg: Record, age: float, t: int, log_t: int,
    ambiguities: Array, residuals: Array, counts: Array,
) -> None:  # fmt: skip
    """Ambiguities of an epoch, and what is left of the phases whose integers are known."""
    found = np.zeros(COUNT_LIMIT, dtype=INTEGER_DTYPE)
    chosen = np.zeros(1, dtype=np.int64)
    a, Q = np.zeros(1), np.zeros((1, 1))
    count = refer(usable, n, k, False, False, 0, found)
    for i in range(count):
        c = found[i]
        chosen[0] = i
        satellite, reference = c["satellite"], c["reference"]
        known = k["known"][satellite] == 1 and k["known"][reference] == 1
        p, q = pairs[c["pair"]], pairs[c["reference_pair"]]
        integer = np.zeros(3)
        integer[0] = float(k["first"][satellite] - k["first"][reference])
        integer[1] = float(k["second"][satellite] - k["second"][reference])
        integer[2] = integer[0] - integer[1]
        for level in range(3):
            step = WIDE
            if level < 2:
                step = FIRST if level == 0 else SECOND
            floats(found, chosen, 1, step, x, P, a, Q)
            row = ambiguities[counts[AMBIGUITIES]]
            counts[AMBIGUITIES] += 1
            row["t"] = t
            row["log_t"] = log_t
            row["satellite"] = satellite
            row["reference"] = reference
            signal = WIDE_LANE_SIGNAL
            if level < 2:
                signal = station[p["rover"]]["signal"][level]
            row["signal"] = signal
            row["value"] = a[0]
            row["sigma"] = sqrt(Q[0, 0]) if Q[0, 0] > 0.0 else 0.0
            row["integer"] = integer[level] if known else _NAN
            row["status"] = AMBIGUITY_FIXED if known else AMBIGUITY_FLOAT
            if not known or level == 2:
                continue
            left = 0.0
            spread = 0.0
            for end in range(2):
                one = p if end == 0 else q
                sign = 1.0 if end == 0 else -1.0
                u, v = station[one["rover"]], master[one["base"]]
                left += sign * (difference(u, v, level, True) - one["computed"])
                # Errors of orbits are what is looked for, not noise.
                spread += difference_variance(u, v, level, True, age, 0.0, rcfg)
            out = residuals[counts[RESIDUALS]]
            counts[RESIDUALS] += 1
            out["t"] = t
            out["log_t"] = log_t
            out["satellite"] = satellite
            out["reference"] = reference
            out["signal"] = signal
            out["residual"] = left - c["wavelength"][level] * integer[level]
            out["sigma"] = sqrt(spread) / cfg["phase_scale"]


@njit(cache=True)
def run_baseline(
    state: Array, integers: Array, x: Array, P: Array, config: Array, integers_config: Array,
    epochs: Array, rows: Array, base_epochs: Array, base_rows: Array, partner: Array,
    release: Array, ambiguities: Array, steps: Array, residuals: Array, notes: Array,
    counts: Array,
) -> None:  # fmt: skip
    """Work on all epochs of a station that are ready.

    Parameters
    ----------
    state, integers, config, integers_config : arrays of one record each
        RTK_STATE_DTYPE, INTEGERS_STATE_DTYPE, RTK_CONFIG_DTYPE, INTEGERS_CONFIG_DTYPE.
    x, P : float64 arrays (ROOM,), (ROOM, ROOM)
        States and covariance; changed.
    epochs, rows, base_epochs, base_rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
        Of the station and of the master.
    partner, release : int64 arrays (epochs,)
        As :func:`replay.kernels.epoch_matching.match_epochs` filled them.
    ambiguities : array (3 * rows,) of AMBIGUITY_ROW_DTYPE
    steps : array (2 * epochs,) of STEP_ROW_DTYPE
    residuals : array (2 * rows,) of RESIDUAL_ROW_DTYPE
    notes : array of NOTE_DTYPE
    counts : int64 array (6,)
        Filled: rows of each output.
    """
    s, k, rcfg, cfg = state[0], integers[0], config[0], integers_config[0]
    pairs = np.zeros(PAIRS, dtype=PAIR_DTYPE)
    measures = np.zeros(2 * PAIRS * SLOTS, dtype=MEASURE_DTYPE)
    starts = np.zeros(2 * SYSTEMS * SLOTS + 1, dtype=np.int64)
    broken = np.zeros((SATELLITES, SLOTS), dtype=np.int64)
    source = np.empty(ROOM, dtype=np.int64)
    place, base_x, up, u = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    still, nothing, axes = np.zeros(3), np.full(3, np.nan), np.zeros((3, 3))
    none = np.zeros((3, 3))
    usable = np.zeros(COUNT_LIMIT, dtype=INTEGER_DTYPE)
    tried = np.zeros(2, dtype=STEP_ROW_DTYPE)
    span = int(rcfg["max_age"] * 1e9)
    for i in range(6):
        counts[i] = 0
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        log_t = release[e]
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        heed_breaks(part, 0, s)
        here = partner[e] >= 0 and epoch["placed"] == 1
        if here:
            heed_base(base_epochs, base_rows, partner[e], span, s)
            here = base_epochs[partner[e]]["placed"] == 1
        if not here:
            if s["lost"] == 0:
                note(notes, counts, epoch["t"], log_t, EVENT_STATION_LOST, -1, 0.0)
            s["lost"] = 1
            continue
        other = base_epochs[partner[e]]
        t = other["t"]
        if s["lost"] == 1:
            away = (t - s["t"]) * 1e-9 if s["t"] >= 0 else 0.0
            note(notes, counts, t, log_t, EVENT_STATION_FOUND, -1, away)
        s["lost"] = 0
        base_part = base_rows[other["first"] : other["first"] + other["count"]]
        baseline2 = 0.0
        for i in range(3):
            place[i] = epoch["x"][i]
            base_x[i] = other["x"][i]
            baseline2 += (place[i] - base_x[i]) * (place[i] - base_x[i])
        baseline = sqrt(baseline2)
        enu_axes(place[0], place[1], place[2], axes)
        for i in range(3):
            up[i] = axes[2, i]
        age = (epoch["t"] - other["t"]) * 1e-9
        count = pair_rows(part, base_part, age, rcfg, place, place, base_x, up, pairs, u)
        compare_frequencies(part, base_part, pairs, count, t, s, rcfg)
        fresh = s["t"] < 0 or t <= s["t"]
        A, n = predict(
            part, base_part, pairs, count, t, baseline, s, rcfg, x, P, place, still, False,
            broken, source,
        )  # fmt: skip
        for satellite in range(SATELLITES):
            if fresh or s["amb"][satellite, 0] < 0 or s["amb"][satellite, 1] < 0:
                forget(k, satellite)
            for slot in range(SLOTS):
                if broken[satellite, slot] == 1:
                    forget(k, satellite)
                    note(notes, counts, t, log_t, EVENT_SLIP, satellite, float(slot))
            # An ambiguity that began anew has another integer.
            for slot in range(2):
                state_of = s["amb"][satellite, slot]
                if state_of >= 0 and source[state_of] < 0:
                    forget(k, satellite)
        groups = build_measures(
            part, base_part, pairs, count, abs(age), baseline, s, rcfg, x, measures, starts
        )
        total = starts[groups]
        new, dx = np.empty((n, n)), np.zeros(n)
        update_epoch(measures, starts, groups, A, n, rcfg, nothing, none, x, new, dx)
        for i in range(n - 1):
            x[i] += dx[i]
            for j in range(n - 1):
                P[i, j] = new[i, j]
        settle(measures, total, s)
        if total < _LEAST_DIFFERENCES:
            note(notes, counts, t, log_t, EVENT_TOO_FEW, -1, float(total))
            continue
        many = usable_satellites(measures, total, pairs, count, part, s, cfg, usable)
        search(usable, many, x, P, n - 1, k, cfg, tried, t, log_t, notes, counts)
        known = 0
        for i in range(many):
            known += k["known"][usable[i]["satellite"]]
        for level in range(2):
            steps[counts[STEPS]] = tried[level]
            row = steps[counts[STEPS]]
            counts[STEPS] += 1
            row["t"] = t
            row["log_t"] = log_t
            row["signal"] = WIDE_LANE_SIGNAL
            if level == FIRST and many > 0:
                row["signal"] = part[pairs[usable[0]["pair"]]["rover"]]["signal"][0]
            row["known"] = known
            row["status"] = AMBIGUITY_FIXED if row["fixed"] > 0 else AMBIGUITY_REJECTED
        _write(
            usable, many, pairs, part, base_part, x, P, k, rcfg, cfg, abs(age), t, log_t,
            ambiguities, residuals, counts,
        )  # fmt: skip
