"""Records of precise point positioning to columns."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from replay.gnss.measurements import SATELLITE_NAMES, signal_names
from replay.kernels import ppp_records
from replay.kernels.gnss_records import SYSTEM_LETTERS
from replay.log.columns import Columns, Ragged

Array = np.ndarray[Any, Any]

PPP_EVENT_TEXT: Final = {
    ppp_records.EVENT_TIME_BACKWARD: "an epoch {value:.3f} s before the last one is left out",
    ppp_records.EVENT_RESET: "the filter begins anew after {value:.0f} epochs that did not fit",
    ppp_records.EVENT_TOO_FEW: "{value:.0f} satellites are too few for a position",
    ppp_records.EVENT_SLIP: "{satellite}: the phase broke, its ambiguity begins anew",
    ppp_records.EVENT_FIXED: "{value:.0f} ambiguities fixed",
    ppp_records.EVENT_FIX_LOST: "no integers after {value:.0f} fixed epochs",
    ppp_records.EVENT_CLOCK_JUMP: "the receiver set its codes by {value:.0f} ms",
}


def _plain(rows: Array, names: dict[str, str]) -> dict[str, Any]:
    return {name: np.ascontiguousarray(rows[field]) for name, field in names.items()}


def zenith_columns(rows: Array) -> Columns:
    """Columns from records of ZENITH_ROW_DTYPE."""
    values = _plain(
        rows, {"hydrostatic_m": "hydrostatic", "wet_m": "wet", "wet_std_m": "wet_sigma"}
    )
    present = {}
    for place, axis in enumerate(("north", "east")):
        for name, field in (("m", "gradient"), ("std_m", "gradient_sigma")):
            full = f"gradient_{axis}_{name}"
            values[full] = np.ascontiguousarray(rows[field][:, place])
            present[full] = np.isfinite(values[full])
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"], present=present)


def slant_columns(rows: Array) -> Columns:
    """Columns from records of SLANT_ROW_DTYPE."""
    values = {
        "satellite": SATELLITE_NAMES[rows["satellite"]],
        **_plain(rows, {"delay_m": "value", "delay_std_m": "sigma"}),
    }
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"])


def bias_columns(rows: Array) -> Columns:
    """Columns from records of BIAS_ROW_DTYPE."""
    values = {
        "system": Ragged.from_texts([SYSTEM_LETTERS[s] for s in rows["system"]]),
        "signal": signal_names(rows["signal"]),
        **_plain(rows, {"bias_m": "value", "bias_std_m": "sigma"}),
    }
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"])


def phase_columns(rows: Array) -> Columns:
    """Columns from records of PHASE_ROW_DTYPE."""
    values = {
        "satellite": SATELLITE_NAMES[rows["satellite"]],
        "signal": signal_names(rows["signal"]),
        **_plain(rows, {"ambiguity_m": "value", "ambiguity_std_m": "sigma"}),
        "epoch_count": rows["age"].astype(np.uint32),
    }
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"])
