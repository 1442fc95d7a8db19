"""Small channels of a run and its truth, made in memory."""

from __future__ import annotations

import numpy as np
import pymap3d

from replay.evaluate.geometry import body_to_enu, enu_axes, turn, turn_back
from replay.log.columns import Columns
from replay.schemas import filter_pb2, gnss_pb2, solution_pb2

NS = 1_000_000_000
T0 = 1_400_000_000 * NS
UPDATED = solution_pb2.SOLUTION_STATUS_UPDATED
PREDICTED = solution_pb2.SOLUTION_STATUS_PREDICTED
OUTAGE = solution_pb2.SOLUTION_STATUS_OUTAGE
FIXED = gnss_pb2.FIX_QUALITY_RTK_FIXED
FLOAT = gnss_pb2.FIX_QUALITY_RTK_FLOAT
ORIGIN = np.array(pymap3d.geodetic2ecef(52.0, 4.4, 44.0))


def at(seconds):
    """GPS ns of seconds since the start."""
    return T0 + np.rint(np.asarray(seconds, dtype=np.float64) * NS).astype(np.int64)


def place(enu):
    """ECEF of points (n, 3) in the local axes of the origin."""
    return ORIGIN + np.asarray(enu, dtype=np.float64) @ enu_axes(ORIGIN[None])[0]


def local_velocity(points, velocity):
    """Velocity in the axes of the origin to the local axes of each point."""
    ecef = np.asarray(velocity) @ enu_axes(ORIGIN[None])[0]
    return turn(enu_axes(points), ecef)


def solution_rows(
    seconds,
    position,
    *,
    velocity=None,
    attitude=None,
    rate=None,
    status=UPDATED,
    sigma=(1.0, 1.0, 1.0),
):
    n = len(seconds)
    nought = np.zeros((n, 3))
    packed = np.zeros((n, 6))
    packed[:, [0, 3, 5]] = np.square(sigma)
    return Columns.build(
        at(seconds),
        {
            "position_ecef_m": np.asarray(position, dtype=np.float64),
            "velocity_enu_m_s": nought.copy() if velocity is None else np.asarray(velocity),
            "attitude_rad": nought.copy() if attitude is None else np.asarray(attitude),
            "angular_rate_body_rad_s": nought.copy() if rate is None else np.asarray(rate),
            "position_covariance_enu_m2": packed,
            "velocity_std_enu_m_s": np.tile(sigma, (n, 1)),
            "attitude_std_rad": np.tile(sigma, (n, 1)),
            "status": np.broadcast_to(np.asarray(status, dtype=np.int32), (n,)).copy(),
        },
    )


def truth_rows(seconds, position, *, velocity=None, attitude=None, lever=(0, 0, 0), quality=0):
    n = len(seconds)
    values = {
        "position_ecef_m": np.asarray(position, dtype=np.float64),
        "lever_arm_body_m": np.tile(np.asarray(lever, dtype=np.float64), (n, 1)),
        "quality": np.broadcast_to(np.asarray(quality, dtype=np.int32), (n,)).copy(),
    }
    if velocity is not None:
        values["velocity_enu_m_s"] = np.asarray(velocity, dtype=np.float64)
    if attitude is not None:
        values["attitude_rad"] = np.asarray(attitude, dtype=np.float64)
    return Columns.build(at(seconds), values)


def moved(position, attitude, lever):
    """Points at a lever arm of IMU positions."""
    offset = turn(
        body_to_enu(attitude), np.tile(np.asarray(lever, dtype=float), (len(position), 1))
    )
    return position + turn_back(enu_axes(position), offset)


def innovation_rows(seconds, kind, axis, normalized, accepted=True):
    n = len(seconds)
    normalized = np.asarray(normalized, dtype=np.float64)
    return Columns.build(
        at(seconds),
        {
            "kind": np.broadcast_to(np.asarray(kind, dtype=np.int32), (n,)).copy(),
            "axis": np.broadcast_to(np.asarray(axis, dtype=np.int32), (n,)).copy(),
            "innovation": normalized,
            "innovation_std": np.ones(n),
            "measurement_std": np.ones(n),
            "normalized": normalized,
            "accepted": np.broadcast_to(np.asarray(accepted, dtype=np.bool_), (n,)).copy(),
        },
    )


def position_innovations(seconds, accepted=True):
    return innovation_rows(
        seconds,
        filter_pb2.MEASUREMENT_KIND_POSITION,
        filter_pb2.MEASUREMENT_AXIS_EAST,
        np.zeros(len(seconds)),
        accepted,
    )
