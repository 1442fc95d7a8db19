"""What an epoch of precise point positioning writes."""

from typing import Final

from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SLOTS, SYSTEMS
from replay.kernels.ppp_records import CODE, DOPPLER, IONOSPHERE
from replay.kernels.ppp_states import ionosphere_factor
from replay.kernels.types import Array, Record

_KIND_CODE: Final = 7
_KIND_PHASE: Final = 8
_KIND_DOPPLER: Final = 9
_KIND_IONOSPHERE: Final = 12
_NAN: Final = float("nan")
# Where each output's number of rows stands in `counts`.
SOLUTIONS: Final = 0
BASELINES: Final = 1  # none; the place that relative positioning counts them at
INNOVATIONS: Final = 2
AMBIGUITIES: Final = 3
RESOLUTIONS: Final = 4
NOTES: Final = 5
ZENITHS: Final = 6
SLANTS: Final = 7
BIASES: Final = 8
PHASES: Final = 9
COUNTS: Final = 10


@njit(cache=True)
def _deviation(P: Array, i: int) -> float:
    return sqrt(P[i, i]) if P[i, i] > 0.0 else 0.0


@njit(cache=True)
def write_innovations(
    measures: Array, total: int, views: Array, rows: Array, t: int, log_t: int, out: Array,
    counts: Array,
) -> None:  # fmt: skip
    """What is left of each measurement (RESIDUAL_DTYPE)."""
    for k in range(total):
        m = measures[k]
        row = out[counts[INNOVATIONS]]
        counts[INNOVATIONS] += 1
        row["t"] = t
        row["log_t"] = log_t
        kind = m["kind"]
        if kind == CODE:
            row["kind"] = _KIND_CODE
        elif kind == IONOSPHERE:
            row["kind"] = _KIND_IONOSPHERE
        else:
            row["kind"] = _KIND_DOPPLER if kind == DOPPLER else _KIND_PHASE
        row["satellite"] = m["satellite"]
        row["signal"] = rows[views[m["pair"]]["rover"]]["signal"][m["slot"]]
        row["z"] = m["residual"]
        # Of a measurement that alone speaks of a state nothing is left.
        row["s"] = sqrt(m["spread"]) if m["spread"] > 1e-8 else 1e-4
        row["r"] = sqrt(m["r"])
        row["accepted"] = m["use"]


@njit(cache=True)
def write_states(
    rows: Array, views: Array, count: int, t: int, log_t: int, s: Record, cfg: Record, x: Array,
    P: Array, zeniths: Array, slants: Array, biases: Array, phases: Array, counts: Array,
) -> None:  # fmt: skip
    """Wet delay, slant delays, biases and ambiguities of an epoch."""
    if count > 0:
        row = rows[views[0]["rover"]]
        out = zeniths[counts[ZENITHS]]
        counts[ZENITHS] += 1
        out["t"] = t
        out["log_t"] = log_t
        dry, wet = row["hydrostatic_mapping"], row["wet_mapping"]
        out["hydrostatic"] = row["hydrostatic"] / dry if dry > 0.0 else 0.0
        out["wet"] = x[s["wet"]] + (row["wet"] / wet if wet > 0.0 else 0.0)
        out["wet_sigma"] = _deviation(P, s["wet"])
        for c in range(2):
            there = s["gradient"] >= 0
            out["gradient"][c] = x[s["gradient"] + c] if there else _NAN
            out["gradient_sigma"][c] = _deviation(P, s["gradient"] + c) if there else _NAN
    for system in range(SYSTEMS):
        for slot in range(SLOTS):
            state = s["bias"][system, slot]
            signal = 0
            for v in range(count):
                if views[v]["system"] == system and signal == 0:
                    signal = rows[views[v]["rover"]]["signal"][slot]
            if state < 0 or signal == 0:
                continue
            out = biases[counts[BIASES]]
            counts[BIASES] += 1
            out["t"] = t
            out["log_t"] = log_t
            out["system"] = system
            out["signal"] = signal
            out["value"] = x[state]
            out["sigma"] = _deviation(P, state)
    for v in range(count):
        row = rows[views[v]["rover"]]
        sat = views[v]["satellite"]
        state = s["slant"][sat]
        if state >= 0 and row["frequency"][0] == row["frequency"][0]:
            factor = ionosphere_factor(row["frequency"][0])
            out = slants[counts[SLANTS]]
            counts[SLANTS] += 1
            out["t"] = t
            out["log_t"] = log_t
            out["satellite"] = sat
            out["value"] = factor * x[state] + row["ionosphere"][0]
            out["sigma"] = factor * _deviation(P, state)
        for slot in range(cfg["slots"]):
            state = s["amb"][sat, slot]
            if state < 0 or row["phase"][slot] != row["phase"][slot]:
                continue
            out = phases[counts[PHASES]]
            counts[PHASES] += 1
            out["t"] = t
            out["log_t"] = log_t
            out["satellite"] = sat
            out["signal"] = row["signal"][slot]
            out["value"] = x[state]
            out["sigma"] = _deviation(P, state)
            out["age"] = s["age"][sat, slot]


@njit(cache=True)
def write_clocks(out: Record, s: Record, x: Array, P: Array) -> None:
    """Clocks of the systems, and the drift, of a solution (SINGLE_ROW_DTYPE)."""
    for system in range(SYSTEMS):
        out["clock"][system] = _NAN
        out["clock_std"][system] = _NAN
        if out["count"][system] == 0:
            continue
        value, variance = x[s["clock"]], P[s["clock"], s["clock"]]
        between = s["between"][system]
        if system != s["reference"] and between >= 0:
            value += x[between]
            variance += P[between, between] + 2.0 * P[s["clock"], between]
        out["clock"][system] = value
        out["clock_std"][system] = sqrt(variance) if variance > 0.0 else 0.0
    out["drift"] = x[s["drift"]] if s["drift"] >= 0 else _NAN
    out["drift_std"] = _deviation(P, s["drift"]) if s["drift"] >= 0 else _NAN
