"""Records of epochs and satellites to the columns that stages of orbits and corrections write."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from replay.gnss.measurements import SATELLITE_NAMES, Epochs, signal_names
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.log.columns import Columns

Array = np.ndarray[Any, Any]


def sight_columns(found: Epochs) -> Columns:
    """Where the satellites of the epochs are, of those that are known."""
    epoch = np.repeat(np.arange(len(found.epochs)), found.epochs["count"])
    seen = found.rows["seen"] == 1
    rows, at = found.rows[seen], found.epochs[epoch[seen]]
    return Columns.build(
        at["t"],
        {
            "satellite": SATELLITE_NAMES[rows["satellite"]],
            "position_ecef_m": np.ascontiguousarray(rows["position"]),
            "velocity_ecef_m_s": np.ascontiguousarray(rows["velocity"]),
            "clock_s": rows["clock"] / SPEED_OF_LIGHT_M_S,
            "clock_drift_s_s": rows["drift"] / SPEED_OF_LIGHT_M_S,
            "elevation_rad": np.ascontiguousarray(rows["elevation"]),
            "azimuth_rad": np.ascontiguousarray(rows["azimuth"]),
            "range_std_m": np.ascontiguousarray(rows["range_std"]),
            "ephemeris_age_s": np.ascontiguousarray(rows["age"]),
            "issue": rows["issue"].astype(np.int32),
            "health": rows["health"].astype(np.int32),
        },
        log_time_ns=at["log_t"],
    )


def coarse_columns(epochs: Array) -> Columns:
    """Where the receiver was, at the epochs that have a position."""
    rows = epochs[epochs["placed"] == 1]
    return Columns.build(
        rows["t"],
        {
            "position_ecef_m": np.ascontiguousarray(rows["x"]),
            "clock_offset_m": np.ascontiguousarray(rows["clock"]),
            "age_s": np.ascontiguousarray(rows["age"]),
            "satellite_count": rows["used"].astype(np.uint32),
        },
        log_time_ns=rows["log_t"],
    )


def correction_columns(found: Epochs, further: Mapping[str, Array]) -> Columns:
    """Every term between range and pseudorange.

    Parameters
    ----------
    found : Epochs
    further : mapping of a field's name to float64 array (rows, SLOTS) or (rows,), m
        Terms beyond those of `found.rows`, of a signal or of a satellite; NaN is absent.
    """
    epoch = np.repeat(np.arange(len(found.epochs)), found.epochs["count"])
    used = (found.rows["signal"] != 0) & (found.rows["seen"] == 1)[:, None]
    row, slot = np.nonzero(used)
    rows, at = found.rows[row], found.epochs[epoch[row]]
    more = {
        name: np.ascontiguousarray(values[row] if values.ndim == 1 else values[row, slot])
        for name, values in further.items()
    }
    delay = rows["group_delay"][np.arange(len(rows)), slot] if len(rows) else np.zeros(0)
    return Columns.build(
        at["t"],
        {
            "satellite": SATELLITE_NAMES[rows["satellite"]],
            "signal": signal_names(found.rows["signal"][row, slot]),
            "distance_m": np.ascontiguousarray(rows["distance"]),
            "sagnac_m": np.ascontiguousarray(rows["sagnac"]),
            "satellite_clock_m": -rows["polynomial"],
            "relativity_m": -rows["relativity"],
            # Where the message does not tell, nothing is modelled.
            "group_delay_m": np.where(np.isfinite(delay), delay, 0.0),
            "ionosphere_m": found.rows["ionosphere"][row, slot],
            "hydrostatic_m": np.ascontiguousarray(rows["hydrostatic"]),
            "wet_m": np.ascontiguousarray(rows["wet"]),
            "hydrostatic_mapping": np.ascontiguousarray(rows["hydrostatic_mapping"]),
            "wet_mapping": np.ascontiguousarray(rows["wet_mapping"]),
            "shapiro_m": np.ascontiguousarray(rows["shapiro"]),
            **more,
        },
        log_time_ns=at["log_t"],
        present={
            "shapiro_m": np.ascontiguousarray(rows["shapiro"] != 0.0),
            **{name: np.isfinite(values) for name, values in more.items()},
        },
    )
