"""Single-point position, clocks and velocity of each epoch of a block, and what is left over."""

import numpy as np
from numba import njit

from replay.kernels.dilution import dilutions
from replay.kernels.earth import enu_axes, local_covariance
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SYSTEMS
from replay.kernels.least_squares import geometric_range
from replay.kernels.notes import note_epoch
from replay.kernels.single_records import (
    EVENT_EXCLUDED,
    EVENT_NOT_CONVERGED,
    EVENT_TOO_FEW,
    KIND_PSEUDORANGE,
    SINGLE_STATE_DTYPE,
)
from replay.kernels.single_solve import range_variance, solve_epoch, solve_velocity, true_time
from replay.kernels.types import Array, Record

_NAN = float("nan")
_NOTES = 2  # in `counts`


@njit(cache=True)
def _emit_position(out: Record, epoch: Record, s: Record, work: Record, reference: int) -> None:
    """Time, position, covariance and clocks of a solution."""
    offset = s["clock"][reference]
    out["epoch_t"] = epoch["t"]
    out["log_t"] = epoch["log_t"]
    out["t"] = true_time(epoch["t"], offset)
    N, axes = work["N"], work["axes"]
    for i in range(3):
        out["r"][i] = s["x"][i]
    local_covariance(axes, N, out["cov"])
    for i in range(SYSTEMS):
        c = work["column"][i]
        out["clock"][i] = s["clock"][i] if c > 0 else _NAN
        out["clock_std"][i] = sqrt(N[c, c]) if c > 0 else _NAN


@njit(cache=True)
def _emit_residuals(
    epoch: Record,
    rows: Array,
    observed: Array,
    variance: Array,
    weight: Array,
    s: Record,
    cfg: Record,
    work: Record,
    u: Array,
    residuals: Array,
    counts: Array,
) -> None:
    """Residuals of the pseudoranges, those of satellites left out too."""
    for k in range(rows.shape[0]):
        system = rows[k]["system"]
        clock = work["column"][system]
        if observed[k] != observed[k] or clock < 0:
            continue
        z = observed[k] - geometric_range(rows[k], s["x"], u) - s["clock"][system]
        share = range_variance(work, u, clock)
        out = residuals[counts[1]]
        counts[1] += 1
        out["t"] = epoch["t"]
        out["log_t"] = epoch["log_t"]
        out["kind"] = KIND_PSEUDORANGE
        out["satellite"] = rows[k]["satellite"]
        out["signal"] = rows[k]["signal"][0]
        out["z"] = z
        # Of a satellite that was used the residual is smaller than its noise, of another larger.
        spread = variance[k] - share if weight[k] > 0.0 else variance[k] + share
        out["s"] = sqrt(spread) if spread > 1e-12 else 1e-6
        out["r"] = sqrt(variance[k])
        out["accepted"] = 1 if weight[k] > 0.0 else 0


@njit(cache=True)
def run_single(
    config: Array,
    epochs: Array,
    rows: Array,
    scratch: Array,
    solutions: Array,
    residuals: Array,
    notes: Array,
    counts: Array,
) -> None:
    """Solve all epochs of a block, each on its own.

    Parameters
    ----------
    config, scratch : arrays of one record each
        SINGLE_CONFIG_DTYPE, SOLVE_DTYPE.
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
    solutions : array of SINGLE_ROW_DTYPE
        Room for one per epoch.
    residuals : array of RESIDUAL_DTYPE
        Room for one per row.
    notes : array of NOTE_DTYPE
        Room for all that is left out and one per epoch.
    counts : int64 array (3,)
        Filled: solutions, residuals, notes.
    """
    cfg, work = config[0], scratch[0]
    u, v = np.zeros(3), np.zeros(3)
    state = np.zeros(1, dtype=SINGLE_STATE_DTYPE)
    s = state[0]
    observed, variance, weight = np.zeros(SATELLITES), np.zeros(SATELLITES), np.zeros(SATELLITES)
    dropped = np.zeros(SATELLITES, dtype=np.int64)
    for i in range(3):
        counts[i] = 0
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        if epoch["placed"] == 0:
            continue
        part = rows[epoch["first"] : epoch["first"] + epoch["count"]]
        for i in range(3):
            s["x"][i] = epoch["x"][i]
        for i in range(SYSTEMS):
            s["clock"][i] = epoch["clock"]
        status = solve_epoch(part, s, cfg, work, observed, variance, weight, dropped, u)
        used = 0
        for k in range(part.shape[0]):
            if dropped[k] == 1:
                note_epoch(notes, counts, _NOTES, epoch, EVENT_EXCLUDED, part[k]["satellite"], 0.0)
            if weight[k] > 0.0:
                used += 1
        if status < 0:
            kind = EVENT_TOO_FEW if status == -1 else EVENT_NOT_CONVERGED
            note_epoch(notes, counts, _NOTES, epoch, kind, -1, float(used))
            continue
        enu_axes(s["x"][0], s["x"][1], s["x"][2], work["axes"])
        reference = -1
        for i in range(SYSTEMS - 1, -1, -1):
            if work["column"][i] > 0:
                reference = i
        out = solutions[counts[0]]
        _emit_position(out, epoch, s, work, reference)
        _emit_residuals(epoch, part, observed, variance, weight, s, cfg, work, u, residuals, counts)
        out["has_v"] = 0
        out["drift"] = _NAN
        out["drift_std"] = _NAN
        if cfg["velocity"] == 1:
            drift = solve_velocity(part, weight, cfg, s, work, v, u)
            if drift == drift:
                N, axes = work["N"], work["axes"]
                out["has_v"] = 1
                out["drift"] = drift
                out["drift_std"] = sqrt(N[3, 3])
                for a in range(3):
                    total = 0.0
                    for i in range(3):
                        for j in range(3):
                            total += axes[a, i] * N[i, j] * axes[a, j]
                    out["v_std"][a] = sqrt(total)
                    out["v_enu"][a] = axes[a, 0] * v[0] + axes[a, 1] * v[1] + axes[a, 2] * v[2]
        dilutions(part, weight, s["x"], work, u, out)
        if out["dop"][1] <= cfg["pdop"]:
            counts[0] += 1
        else:
            note_epoch(notes, counts, _NOTES, epoch, EVENT_NOT_CONVERGED, -1, float(used))
