"""What an epoch of relative positioning writes."""

from numba import njit

from replay.kernels.earth import enu_axes, local_covariance
from replay.kernels.elementary import atan2, sqrt
from replay.kernels.gnss_records import SYSTEMS
from replay.kernels.notes import append_note
from replay.kernels.rtk_records import (
    AMBIGUITY_FIXED,
    AMBIGUITY_FLOAT,
    AMBIGUITY_HELD,
    AMBIGUITY_REJECTED,
)
from replay.kernels.single_records import KIND_PSEUDORANGE
from replay.kernels.types import Array, Record

_KIND_PHASE = 8
_NAN = float("nan")


@njit(cache=True)
def note(
    notes: Array, counts: Array, t: int, log_t: int, kind: int, satellite: int, value: float
) -> None:
    """One event (NOTE_DTYPE)."""
    append_note(notes, counts, 5, t, log_t, kind, satellite, value)


@njit(cache=True)
def write_residuals(
    measures: Array, total: int, pairs: Array, rover: Array, t: int, log_t: int, out: Array,
    counts: Array,
) -> None:  # fmt: skip
    """Residuals of the single differences about their group's clock (RESIDUAL_DTYPE)."""
    for k in range(total):
        m = measures[k]
        row = out[counts[2]]
        counts[2] += 1
        row["t"] = t
        row["log_t"] = log_t
        row["kind"] = _KIND_PHASE if m["kind"] == 1 else KIND_PSEUDORANGE
        row["satellite"] = m["satellite"]
        row["signal"] = rover[pairs[m["pair"]]["rover"]]["signal"][m["slot"]]
        row["z"] = m["residual"]
        row["s"] = sqrt(m["spread"]) if m["spread"] > 1e-8 else 1e-4
        row["r"] = sqrt(m["r"])
        row["accepted"] = m["use"]


@njit(cache=True)
def write_ambiguities(
    candidates: Array, count: int, measures: Array, pairs: Array, rover: Array, whole: bool,
    fixed: bool, held: bool, t: int, log_t: int, out: Array, counts: Array,
) -> None:  # fmt: skip
    """Double-difference ambiguities of an epoch (AMBIGUITY_ROW_DTYPE)."""
    for k in range(count):
        c = candidates[k]
        row = out[counts[3]]
        counts[3] += 1
        row["t"] = t
        row["log_t"] = log_t
        row["satellite"] = c["satellite"]
        row["reference"] = c["reference"]
        pair = pairs[measures[c["measure"]]["pair"]]
        row["signal"] = rover[pair["rover"]]["signal"][c["slot"]]
        row["value"] = c["value"]
        row["sigma"] = sqrt(c["variance"]) if c["variance"] > 0.0 else 0.0
        row["integer"] = float(c["integer"]) if whole else _NAN
        if not whole:
            row["status"] = AMBIGUITY_FLOAT
        elif held:
            row["status"] = AMBIGUITY_HELD
        else:
            row["status"] = AMBIGUITY_FIXED if fixed else AMBIGUITY_REJECTED


@njit(cache=True)
def write_resolution(
    tried: Record, threshold: float, fixed: bool, held: bool, t: int, log_t: int, out: Array,
    counts: Array,
) -> None:  # fmt: skip
    """What an attempt at the integers gave (RESOLUTION_ROW_DTYPE)."""
    row = out[counts[4]]
    counts[4] += 1
    row["t"] = t
    row["log_t"] = log_t
    row["candidates"] = tried["count"]
    row["fixed"] = tried["fixed"] if fixed else 0
    row["ratio"] = tried["ratio"]
    row["w_ratio"] = tried["w_ratio"]
    row["threshold"] = threshold
    row["success"] = tried["success"]
    if held:
        row["status"] = AMBIGUITY_HELD
    else:
        row["status"] = AMBIGUITY_FIXED if fixed else AMBIGUITY_REJECTED


@njit(cache=True)
def write_solution(
    out: Record, epoch: Record, t: int, log_t: int, status: int, position: Array, cov: Array,
    v: Array, velocity_cov: Array, moves: bool, work: Record,
) -> None:  # fmt: skip
    """Position and velocity (SINGLE_ROW_DTYPE); `work` holds the axes of the horizon."""
    axes = work["axes"]
    out["t"] = t
    out["epoch_t"] = epoch["t"]
    out["log_t"] = log_t
    out["status"] = status
    for i in range(3):
        out["r"][i] = position[i]
    local_covariance(axes, cov, out["cov"])
    out["has_v"] = 1 if moves else 0
    for a in range(3):
        if moves:
            total = 0.0
            for i in range(3):
                for j in range(3):
                    total += axes[a, i] * velocity_cov[i, j] * axes[a, j]
            out["v_std"][a] = sqrt(total)
            out["v_enu"][a] = axes[a, 0] * v[0] + axes[a, 1] * v[1] + axes[a, 2] * v[2]
    for i in range(SYSTEMS):
        out["clock"][i] = _NAN


@njit(cache=True)
def write_baseline(
    out: Record,
    t: int,
    log_t: int,
    status: int,
    position: Array,
    cov: Array,
    base: Array,
    age: float,
    axes: Array,
) -> None:
    """Position relative to the base (BASELINE_ROW_DTYPE); `axes` (3, 3) is overwritten."""
    enu_axes(base[0], base[1], base[2], axes)
    out["t"] = t
    out["log_t"] = log_t
    out["status"] = status
    out["age"] = age
    length2 = 0.0
    for i in range(3):
        out["ecef"][i] = position[i] - base[i]
        length2 += out["ecef"][i] * out["ecef"][i]
    length = sqrt(length2)
    for a in range(3):
        out["enu"][a] = (
            axes[a, 0] * out["ecef"][0] + axes[a, 1] * out["ecef"][1] + axes[a, 2] * out["ecef"][2]
        )
    local_covariance(axes, cov, out["cov"])
    e, n, up = out["enu"][0], out["enu"][1], out["enu"][2]
    ee, en, eu = out["cov"][0], out["cov"][1], out["cov"][2]
    nn, nu, uu = out["cov"][3], out["cov"][4], out["cov"][5]
    flat2 = e * e + n * n
    flat = sqrt(flat2)
    out["length"] = length
    out["heading"] = _NAN
    out["heading_sigma"] = _NAN
    out["pitch"] = _NAN
    out["pitch_sigma"] = _NAN
    out["length_sigma"] = _NAN
    if length > 0.0:
        value = e * e * ee + n * n * nn + up * up * uu
        value += 2.0 * (e * n * en + e * up * eu + n * up * nu)
        out["length_sigma"] = sqrt(value) / length if value > 0.0 else 0.0
    if flat > 0.0:
        heading = atan2(e, n)
        out["heading"] = heading if heading >= 0.0 else heading + 6.283185307179586
        value = n * n * ee - 2.0 * e * n * en + e * e * nn
        out["heading_sigma"] = sqrt(value) / flat2 if value > 0.0 else 0.0
        out["pitch"] = atan2(up, flat)
        # Across the line of sight in its vertical plane.
        a, b, c = -up * e / flat, -up * n / flat, flat
        value = a * a * ee + b * b * nn + c * c * uu
        value += 2.0 * (a * b * en + a * c * eu + b * c * nu)
        out["pitch_sigma"] = sqrt(value) / length2 if value > 0.0 else 0.0
