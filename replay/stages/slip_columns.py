"""Settings and rows of the search for cycle slips: what several stages share."""

from __future__ import annotations

from typing import Any

import numpy as np

from replay.gnss.measurements import SATELLITE_NAMES, signal_names
from replay.kernels.slip_records import SLIP_CONFIG_DTYPE
from replay.log.columns import Columns
from replay.stages.tdcp_config import Slips

Array = np.ndarray[Any, Any]


def slip_config(slips: Slips) -> Array:
    """Settings as the record that the compiled loop reads."""
    record = np.zeros(1, dtype=SLIP_CONFIG_DTYPE)
    record["lock"] = int(slips.loss_of_lock)
    record["lock_time"] = int(slips.lock_time)
    record["half"] = int(slips.half_cycles)
    for name in (
        "gap",
        "geometry_free",
        "geometry_free_rate",
        "wide_lane",
        "wide_lane_least",
        "wide_lane_sigma",
        "doppler",
        "doppler_sigma",
        "jerk",
        "clock_jump",
    ):
        record[name] = getattr(slips, name)
    return record


def slip_columns(rows: Array) -> Columns:
    """Cycle slips from records of SLIP_ROW_DTYPE."""
    return Columns.build(
        rows["t"],
        {
            "satellite": SATELLITE_NAMES[rows["satellite"]],
            "signal": signal_names(rows["signal"]),
            "detector": rows["detector"].astype(np.int32),
            "statistic": np.ascontiguousarray(rows["statistic"]),
            "threshold": np.ascontiguousarray(rows["threshold"]),
            "size_cycles": np.where(np.isfinite(rows["size"]), rows["size"], 0.0),
            "repaired": rows["repaired"] == 1,
        },
        log_time_ns=rows["log_t"],
        present={"size_cycles": np.isfinite(rows["size"])},
    )
