"""Rows of inertial filters as columns: innovations, states, covariances, events, solutions."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from replay.kernels import inertial_samples, records
from replay.log.columns import Columns, Ragged
from replay.schemas import filter_pb2

Array = np.ndarray[Any, Any]

_NOTES: Final = ("inertial sample", "GNSS fix")
_EARLY_TEXT: Final = "{value:.0f} GNSS fixes skipped: older than the inertial samples at hand"
_EVENT_TEXT: Final = {
    records.EVENT_LEVELLED: "levelled after {value:.1f} s at rest",
    records.EVENT_ALIGNED: "heading from course: {value:.4f} rad",
    records.EVENT_REJECTED: "position rejected by its innovation, {value:.0f} in a row",
    records.EVENT_OUTAGE_BEGIN: "no position for {value:.2f} s",
    records.EVENT_OUTAGE_END: "position again after {value:.2f} s",
    records.EVENT_STOP_BEGIN: "stop, filter speed {value:.3f} m/s",
    records.EVENT_STOP_END: "moving, filter speed {value:.3f} m/s",
    records.EVENT_IMU_GAP: "interval of {value:.3f} s between inertial samples",
    records.EVENT_TIME_BACKWARD: "{note} skipped: {value:.6f} s before the filter's time",
    records.EVENT_NOT_FINITE: "{note} skipped: not a finite number",
    records.EVENT_RESET: "position believed after {value:.0f} rejections in a row",
    int(filter_pb2.EVENT_KIND_CLOCK_JUMP): "the receiver set its clock by {value:.3f} m",
}


def _columns(rows: Array, values: dict[str, Array | Ragged]) -> Columns:
    contiguous = {
        name: value if isinstance(value, Ragged) else np.ascontiguousarray(value)
        for name, value in values.items()
    }
    return Columns.build(rows["t"], contiguous, log_time_ns=rows["log_t"])


def innovation_columns(rows: Array) -> Columns:
    """Innovations from records of INNOVATION_DTYPE."""
    count = len(rows)
    return _columns(
        rows,
        {
            "kind": rows["kind"].astype(np.int32),
            "axis": rows["axis"].astype(np.int32),
            "satellite": np.full(count, b"---", dtype="S3"),
            "signal": np.full(count, b"--", dtype="S2"),
            "innovation": rows["z"],
            "innovation_std": rows["s"],
            "measurement_std": rows["r"],
            "normalized": rows["z"] / rows["s"],
            "accepted": rows["accepted"].astype(np.bool_),
        },
    )


def state_columns(rows: Array) -> Columns:
    """States from records of EPOCH_DTYPE."""
    return _columns(
        rows,
        {
            "position_ecef_m": rows["r"],
            "velocity_ecef_m_s": rows["v"],
            "q_body_to_ecef": rows["q"],
            "gyro_bias_body_rad_s": rows["bg"],
            "accel_bias_body_m_s2": rows["ba"],
            "gyro_scale_factor": rows["sg"],
            "accel_scale_factor": rows["sa"],
            "mounting_angles_rad": rows["mount"],
            "non_slip_point_body_m": rows["point"],
            "squat_rad_s2_m": rows["squat"],
        },
    )


def covariance_columns(rows: Array, triangles: Array, names: tuple[str, ...]) -> Columns:
    """Covariances from upper triangles, one row each."""
    return _columns(
        rows,
        {
            "dimension": np.full(len(rows), len(names), dtype=np.uint32),
            "state_names": Ragged.from_texts([",".join(names)] * len(rows)),
            "upper_triangle": Ragged.from_matrix(triangles),
        },
    )


def event_columns(rows: Array) -> Columns:
    """Events from records of EVENT_DTYPE."""
    details = [
        _EARLY_TEXT.format(value=float(row["value"]))
        if row["note"] == inertial_samples.NOTE_EARLY
        else _EVENT_TEXT[int(row["kind"])].format(
            value=float(row["value"]), note=_NOTES[int(row["note"])]
        )
        for row in rows
    ]
    return _columns(
        rows,
        {
            "kind": rows["kind"].astype(np.int32),
            "value": rows["value"],
            "detail": Ragged.from_texts(details),
        },
    )


def solution_columns(rows: Array) -> Columns:
    """Solutions from records of SOLUTION_DTYPE."""
    return _columns(
        rows,
        {
            "position_ecef_m": rows["r"],
            "velocity_enu_m_s": rows["v_enu"],
            "attitude_rad": rows["attitude"],
            "angular_rate_body_rad_s": rows["w_eb"],
            "position_covariance_enu_m2": rows["cov"],
            "velocity_std_enu_m_s": rows["v_std"],
            "attitude_std_rad": rows["a_std"],
            "status": rows["status"].astype(np.int32),
        },
    )
