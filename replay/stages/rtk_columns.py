"""Records of relative positioning to columns."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from replay.gnss.measurements import SATELLITE_NAMES, signal_names
from replay.kernels import rtk_records
from replay.log.columns import Columns

Array = np.ndarray[Any, Any]

RTK_EVENT_TEXT: Final = {
    rtk_records.EVENT_TOO_FEW: "{value:.0f} differences to the base are too few",
    rtk_records.EVENT_SLIP: "{satellite}: the phase broke, its ambiguity begins anew",
    rtk_records.EVENT_FIXED: "{value:.0f} ambiguities fixed",
    rtk_records.EVENT_FIX_LOST: "no integers after {value:.0f} fixed epochs",
    rtk_records.EVENT_BASE_LOST: "no epoch of the base that serves, {value:.1f} s after its last",
}


def ambiguity_columns(rows: Array) -> Columns:
    """Columns from records of AMBIGUITY_ROW_DTYPE."""
    return Columns.build(
        rows["t"],
        {
            "satellite": SATELLITE_NAMES[rows["satellite"]],
            "reference": SATELLITE_NAMES[rows["reference"]],
            "signal": signal_names(rows["signal"]),
            "float_cycles": np.ascontiguousarray(rows["value"]),
            "float_std_cycles": np.ascontiguousarray(rows["sigma"]),
            "integer_cycles": np.ascontiguousarray(rows["integer"]),
            "status": rows["status"].astype(np.int32),
        },
        log_time_ns=rows["log_t"],
        present={"integer_cycles": np.isfinite(rows["integer"])},
    )


def resolution_columns(rows: Array) -> Columns:
    """Columns from records of RESOLUTION_ROW_DTYPE."""
    return Columns.build(rows["t"], _attempts(rows), log_time_ns=rows["log_t"])


def step_columns(rows: Array) -> Columns:
    """Columns from records of STEP_ROW_DTYPE."""
    values = {
        "signal": signal_names(rows["signal"]),
        "known_count": rows["known"].astype(np.uint32),
        **_attempts(rows),
    }
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"])


def _attempts(rows: Array) -> dict[str, Any]:
    """What attempts at integers gave."""
    return {
        "candidate_count": rows["candidates"].astype(np.uint32),
        "fixed_count": rows["fixed"].astype(np.uint32),
        "ratio": np.ascontiguousarray(rows["ratio"]),
        "w_ratio": np.ascontiguousarray(rows["w_ratio"]),
        "threshold": np.ascontiguousarray(rows["threshold"]),
        "success_rate": np.ascontiguousarray(rows["success"]),
        "status": rows["status"].astype(np.int32),
    }


def baseline_columns(rows: Array) -> Columns:
    """Columns from records of BASELINE_ROW_DTYPE."""
    values: dict[str, Any] = {
        "baseline_ecef_m": np.ascontiguousarray(rows["ecef"]),
        "baseline_enu_m": np.ascontiguousarray(rows["enu"]),
        "covariance_enu_m2": np.ascontiguousarray(rows["cov"]),
        "length_m": np.ascontiguousarray(rows["length"]),
        "length_std_m": np.ascontiguousarray(rows["length_sigma"]),
        "base_age_s": np.ascontiguousarray(rows["age"]),
        "status": rows["status"].astype(np.int32),
    }
    present = {}
    for name, field in (
        ("heading_rad", "heading"),
        ("heading_std_rad", "heading_sigma"),
        ("pitch_rad", "pitch"),
        ("pitch_std_rad", "pitch_sigma"),
    ):
        values[name] = np.ascontiguousarray(rows[field])
        present[name] = np.isfinite(rows[field])
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"], present=present)
