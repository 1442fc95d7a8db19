"""Inertial messages of NovAtel SPAN: samples and solutions (OEM7 commands and logs, 5).

Axes of SPAN are right, forward, up; those of the log forward, right, down.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.importers.findings import Findings
from replay.importers.geodesy import Places, gravity_reaction
from replay.importers.receiver_rows import imu_columns, truth_columns
from replay.importers.table import Float64, Int64
from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.elementary import sincos
from replay.log.columns import Columns
from replay.schemas import gnss_pb2
from replay.time import NS_PER_S, from_week

RAWIMU: Final = (268, 325)
RAWIMUX: Final = (1461, 1462)
CORRECTED: Final = (812, 813, 1362)  # CORRIMUDATA, CORRIMUDATAS, IMURATECORRIMUS
INSPVA: Final = (507, 508)
INSPVAX: Final = (1465,)

RAW_BODY: Final = np.dtype(
    [
        ("week", "<u4"),
        ("seconds", "<f8"),
        ("status", "<u4"),
        ("accel", "<i4", 3),
        ("gyro", "<i4", 3),
    ]
)
RAWX_BODY: Final = np.dtype(
    [
        ("error", "u1"), ("kind", "u1"), ("week", "<u2"), ("seconds", "<f8"), ("status", "<u4"),
        ("accel", "<i4", 3), ("gyro", "<i4", 3),
    ]
)  # fmt: skip
CORRECTED_BODY: Final = np.dtype(
    [("week", "<u4"), ("seconds", "<f8"), ("gyro", "<f8", 3), ("accel", "<f8", 3)]
)
PVA_BODY: Final = np.dtype(
    [
        ("week", "<u4"), ("seconds", "<f8"), ("place", "<f8", 3), ("velocity", "<f8", 3),
        ("attitude", "<f8", 3), ("status", "<u4"),
    ]
)  # fmt: skip
PVAX_BODY: Final = np.dtype(
    [
        ("status", "<u4"), ("kind", "<u4"), ("place", "<f8", 3), ("undulation", "<f4"),
        ("velocity", "<f8", 3), ("attitude", "<f8", 3), ("place_std", "<f4", 3),
        ("velocity_std", "<f4", 3), ("attitude_std", "<f4", 3), ("extended", "<u4"),
        ("since", "<u2"),
    ]
)  # fmt: skip
_SOLVED: Final = (2, 3, 6, 7)  # high variance, good, free, alignment complete
_RAD: Final = math.pi / 180.0
_GRAVITY: Final = 9.80665
_NEAR_NS: Final = NS_PER_S


def times_of(rows: npt.NDArray[np.void]) -> Int64:
    """GPS nanoseconds of weeks and seconds."""
    times = np.zeros(len(rows), dtype=np.int64)
    for week in np.unique(rows["week"]):
        at = rows["week"] == week
        times[at] = from_week(int(week), rows["seconds"][at])
    return times


def sample_rate_hz(times_ns: Int64) -> float:
    """Rate of samples, to a hundredth of a hertz, from the median of their distances.

    Zero where there are no two times.
    """
    steps = np.diff(np.unique(times_ns))
    return round(NS_PER_S / float(np.median(steps)) * 100.0) / 100.0 if len(steps) else 0.0


def raw_samples(
    rows: npt.NDArray[np.void], gyro_scale_rad: float, accel_scale_m_s: float
) -> Columns:
    """Samples of RAWIMU and its kin: increments of z, minus y, x in counts."""
    times = times_of(rows)
    rate = sample_rate_hz(times)
    gyro, accel = rows["gyro"].astype(np.float64), rows["accel"].astype(np.float64)
    # z, -y, x as they stand to forward (y), right (x), down (-z).
    gyro = np.stack([-gyro[:, 1], gyro[:, 2], -gyro[:, 0]], axis=1) * (gyro_scale_rad * rate)
    accel = np.stack([-accel[:, 1], accel[:, 2], -accel[:, 0]], axis=1) * (accel_scale_m_s * rate)
    return imu_columns(times, gyro, accel)


def corrected_samples(
    rows: npt.NDArray[np.void], solution: Columns | None, where: str, findings: Findings
) -> Columns | None:
    """Samples of CORRIMUDATA and IMURATECORRIMUS: increments of rate and acceleration.

    The receiver has taken gravity and the Earth's rotation off. Both are put back by
    its own attitude, without which the increments are no inertial sample and are lost.
    """
    times = times_of(rows)
    rate = sample_rate_hz(times)
    # Pitch, roll, yaw; lateral, longitudinal, vertical.
    gyro = np.stack([rows["gyro"][:, 1], rows["gyro"][:, 0], -rows["gyro"][:, 2]], axis=1) * rate
    accel = np.stack([rows["accel"][:, 1], rows["accel"][:, 0], -rows["accel"][:, 2]], axis=1)
    accel = accel * rate
    near = np.zeros(len(times), dtype=np.bool_)
    if solution is not None:
        reference = solution.valid_time_ns
        after = np.searchsorted(reference, times)
        before_ns = reference[np.maximum(after - 1, 0)]
        after_ns = reference[np.minimum(after, len(reference) - 1)]
        near = np.minimum(np.abs(times - before_ns), np.abs(times - after_ns)) <= _NEAR_NS
    if not near.all():
        findings.loss(
            "samples without gravity, and no attitude within a second to put it back; skipped",
            where,
            int((~near).sum()),
            "rows",
            "record RAWIMU, or INSPVA at 1 Hz or more beside them",
        )
    if solution is None or not near.any():
        return None
    times, gyro, accel = times[near], gyro[near], accel[near]
    attitude = _interpolated(times, solution)
    sine_lat = float(
        Places.from_ecef(np.asarray(solution["position_ecef_m"], dtype=np.float64)[:1]).sin_lat[0]
    )
    findings.notes.append(
        f"{where}: gravity ({_GRAVITY} m/s^2) and the Earth's rotation, which the receiver took "
        f"off its inertial samples, were put back by its own attitude ({rate:g} Hz)"
    )
    accel = accel + gravity_reaction(attitude[:, 0], attitude[:, 1], _GRAVITY)
    return imu_columns(times, gyro + _earth_rate(attitude, sine_lat), accel)


def _interpolated(times: Int64, solution: Columns) -> Float64:
    """Roll, pitch, heading (n, 3) at times, along straight lines."""
    reference = solution.valid_time_ns
    x = (reference - reference[0]) / NS_PER_S
    at = (times - reference[0]) / NS_PER_S
    attitude = np.asarray(solution["attitude_rad"], dtype=np.float64)
    turn = 2.0 * math.pi
    columns = []
    for k in range(3):
        steps = np.diff(attitude[:, k])
        steps = steps - turn * np.floor(steps / turn + 0.5)
        total = attitude[0, k] + np.concatenate([[0.0], np.cumsum(steps)])
        columns.append(np.interp(at, x, total))
    return np.stack(columns, axis=1)


def _earth_rate(attitude: Float64, sine_lat: float) -> Float64:
    """The Earth's rotation (n, 3) in body axes, rad/s."""
    north = EARTH_RATE_RAD_S * math.sqrt(1.0 - sine_lat * sine_lat)
    down = -EARTH_RATE_RAD_S * sine_lat
    out = np.empty_like(attitude)
    for i, (roll, pitch, heading) in enumerate(attitude.tolist()):
        (sr, cr), (sp, cp), (sh, ch) = sincos(roll), sincos(pitch), sincos(heading)
        out[i] = (
            cp * ch * north - sp * down,
            (sr * sp * ch - cr * sh) * north + sr * cp * down,
            (cr * sp * ch + sr * sh) * north + cr * cp * down,
        )
    return out


def solutions(
    pva: npt.NDArray[np.void],
    pvax: npt.NDArray[np.void],
    pvax_times: Int64,
    lever_arm_m: Sequence[float],
    where: str,
    findings: Findings,
) -> Columns | None:
    """INSPVA and INSPVAX as truth; of one time, INSPVAX, which has deviations."""
    times = np.concatenate([pvax_times, times_of(pva)])
    status = np.concatenate([pvax["status"], pva["status"]])
    place = np.concatenate([pvax["place"], pva["place"]])
    # INSPVAX gives the height above the geoid, INSPVA above the ellipsoid.
    place[: len(pvax), 2] += pvax["undulation"]
    velocity = np.concatenate([pvax["velocity"], pva["velocity"]])
    attitude = np.concatenate([pvax["attitude"], pva["attitude"]])
    std = np.concatenate([pvax["place_std"], np.full((len(pva), 3), np.nan)])
    solved = np.isin(status, _SOLVED)
    if not solved.all():
        left = int((~solved).sum())
        findings.notes.append(f"{where}: {left} INS solutions are not aligned and left out")
    if not solved.any():
        return None
    times, place, velocity = times[solved], place[solved], velocity[solved]
    attitude, std = attitude[solved] * _RAD, std[solved]
    places = Places.from_geodetic(place[:, 0] * _RAD, place[:, 1] * _RAD, place[:, 2])
    heading = attitude[:, 2]
    attitude[:, 2] = np.where(heading >= 2.0 * math.pi, 0.0, heading)
    return truth_columns(
        times,
        places.ecef_m,
        np.full(len(times), gnss_pb2.FIX_QUALITY_FUSED, dtype=np.int64),
        lever_arm_m,
        velocity_enu=velocity[:, [1, 0, 2]],
        attitude_rad=attitude,
        position_std_enu_m=std[:, [1, 0, 2]].astype(np.float64),
    )
