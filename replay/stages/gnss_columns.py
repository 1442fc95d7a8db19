"""Records of GNSS kernels to columns: what several stages write alike."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from replay.gnss.measurements import SATELLITE_NAMES, signal_names
from replay.kernels.gnss_records import SYSTEM_LETTERS
from replay.log.columns import Columns, Ragged

Array = np.ndarray[Any, Any]

EVENT_TEXT: Final = {
    12: "{satellite} left out: its residual",
    13: "{satellite}: no usable broadcast message",
    14: "{value:.0f} satellites are too few for a position",
    15: "no position from {value:.0f} satellites",
    16: "{satellite} left out: its phase jumped by {value:.2f} cycles",
    17: "{satellite}: a jump of {value:.1f} cycles is taken off its phase",
    18: "chain of displacements broken after {value:.1f} s",
    21: "the receiver's clock jumped by {value:.4f} ms",
}
_COUNTS: Final = ("gps_count", "glonass_count", "galileo_count", "beidou_count", "qzss_count")
_DOPS: Final = ("gdop", "pdop", "hdop", "vdop")
_SYSTEM_PDOPS: Final = ("gps_pdop", "glonass_pdop", "galileo_pdop", "beidou_pdop")


def event_columns(notes: Array, texts: dict[int, str]) -> Columns:
    """Events from records with `t`, `log_t`, `kind`, `satellite` (or -1) and `value`."""
    details = [
        texts[int(row["kind"])].format(
            value=float(row["value"]),
            satellite=SATELLITE_NAMES[row["satellite"]].decode() if row["satellite"] >= 0 else "",
        )
        for row in notes
    ]
    return Columns.build(
        notes["t"],
        {
            "kind": notes["kind"].astype(np.int32),
            "value": np.ascontiguousarray(notes["value"]),
            "detail": Ragged.from_texts(details),
        },
        log_time_ns=notes["log_t"],
    )


def residual_columns(rows: Array) -> Columns:
    """Innovations from records of RESIDUAL_DTYPE."""
    return Columns.build(
        rows["t"],
        {
            "kind": rows["kind"].astype(np.int32),
            "axis": np.zeros(len(rows), dtype=np.int32),
            "satellite": SATELLITE_NAMES[rows["satellite"]],
            "signal": signal_names(rows["signal"]),
            "innovation": np.ascontiguousarray(rows["z"]),
            "innovation_std": np.ascontiguousarray(rows["s"]),
            "measurement_std": np.ascontiguousarray(rows["r"]),
            "normalized": rows["z"] / rows["s"],
            "accepted": rows["accepted"] == 1,
        },
        log_time_ns=rows["log_t"],
    )


def clock_columns(rows: Array) -> Columns:
    """Receiver clocks, one row per system that was used."""
    row, system = np.nonzero(np.isfinite(rows["clock"]))
    moving = np.isfinite(rows["drift"][row])
    return Columns.build(
        rows["t"][row],
        {
            "system": Ragged.from_texts([SYSTEM_LETTERS[s] for s in system]),
            "offset_m": rows["clock"][row, system],
            "offset_std_m": rows["clock_std"][row, system],
            "drift_m_s": rows["drift"][row],
            "drift_std_m_s": rows["drift_std"][row],
        },
        log_time_ns=rows["log_t"][row],
        present={"drift_m_s": moving, "drift_std_m_s": moving},
    )


def geometry_columns(rows: Array) -> Columns:
    """Satellites by system and dilution of precision."""
    values: dict[str, Any] = {}
    present: dict[str, Any] = {}
    for place, name in enumerate(_COUNTS):
        values[name] = rows["count"][:, place].astype(np.uint32)
    for names, field in ((_DOPS, "dop"), (_SYSTEM_PDOPS, "system_pdop")):
        for place, name in enumerate(names):
            values[name] = np.ascontiguousarray(rows[field][:, place])
            present[name] = np.isfinite(values[name])
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"], present=present)


def antenna_solution_columns(rows: Array) -> Columns:
    """Solutions of an antenna: position, and velocity where there is one."""
    moving = rows["has_v"] == 1
    nothing = np.zeros(len(rows), dtype=np.bool_)
    absent = np.zeros((len(rows), 3))
    return Columns.build(
        rows["t"],
        {
            "position_ecef_m": np.ascontiguousarray(rows["r"]),
            "velocity_enu_m_s": np.ascontiguousarray(rows["v_enu"]),
            "attitude_rad": absent,
            "angular_rate_body_rad_s": absent,
            "position_covariance_enu_m2": np.ascontiguousarray(rows["cov"]),
            "velocity_std_enu_m_s": np.ascontiguousarray(rows["v_std"]),
            "attitude_std_rad": absent,
            "status": rows["status"].astype(np.int32),
        },
        log_time_ns=rows["log_t"],
        present={
            "velocity_enu_m_s": moving,
            "velocity_std_enu_m_s": moving,
            "attitude_rad": nothing,
            "angular_rate_body_rad_s": nothing,
            "attitude_std_rad": nothing,
        },
    )
