"""A drive in closed form with everything that a run log can hold.

No filter made it: errors are drawn with the standard deviations that the
channels state, so that errors lie in their bands and innovations are normal.
"""

from __future__ import annotations

import json

import numpy as np

from replay.log.columns import Columns, Ragged
from replay.schemas import filter_pb2, gnss_pb2, solution_pb2
from replay.time import NS_PER_S, from_week

START_NS = int(from_week(2375, 243_278.5)) + 123_456_789
ORIGIN = (np.radians(40.015), np.radians(-105.27), 1650.0)
TRUTH_LEVER = np.array([0.3, -0.2, -0.9])
ANTENNA_LEVER = np.array([0.1, 0.4, -1.3])
OUTAGES_S = ((100.0, 130.0), (200.0, 230.0))
STATES = [
    f"{group}_{axis}"
    for group in (
        "position_ecef",
        "velocity_ecef",
        "attitude_ecef",
        "gyro_bias",
        "accel_bias",
        "gyro_scale",
        "accel_scale",
    )
    for axis in "xyz"
]


def _ecef_origin() -> tuple[np.ndarray, np.ndarray]:
    a, f = 6378137.0, 1 / 298.257223563
    lat, lon, h = ORIGIN
    e2 = f * (2 - f)
    n = a / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    point = np.array(
        [
            (n + h) * np.cos(lat) * np.cos(lon),
            (n + h) * np.cos(lat) * np.sin(lon),
            (n * (1 - e2) + h) * np.sin(lat),
        ]
    )
    east = [-np.sin(lon), np.cos(lon), 0]
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    up = [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]
    return point, np.array([east, north, up])


def _travelled(t: np.ndarray) -> np.ndarray:
    """Path length [m]: 20 s still, then up to 14 m/s with a stop in the middle."""
    grid = np.arange(-5.0, t.max() + 5.0, 0.01)
    ramp = np.clip((grid - 20) / 10, 0, 1)
    stop = 1 - np.exp(-(((grid - 170) / 6.0) ** 4))
    speed = 14.0 * ramp * stop * (0.75 + 0.25 * np.sin(grid / 11.0))
    speed = np.convolve(speed, np.ones(100) / 100, mode="same")
    return np.interp(t, grid, np.cumsum(speed) * 0.01)


def _enu(t: np.ndarray) -> np.ndarray:
    s = _travelled(t) / 640.0
    return np.column_stack(
        [500 * np.sin(s), 320 * np.sin(2 * s) + 60 * np.cos(5 * s) - 60, 12 * np.sin(s * 1.3)]
    )


def _motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position [m] and velocity [m/s] east, north, up; roll, pitch, heading [rad]."""
    h = 0.05
    velocity = (_enu(t + h) - _enu(t - h)) / (2 * h)
    s = _travelled(t)
    ahead = _enu_of_length(s + 0.5) - _enu_of_length(s - 0.5)
    heading = np.arctan2(ahead[:, 0], ahead[:, 1])
    roll = np.radians(2.0) * np.sin(s / 25.0)
    pitch = np.arctan2(ahead[:, 2], np.hypot(ahead[:, 0], ahead[:, 1]))
    pitch = pitch + np.radians(0.6) * np.sin(s / 9.0)
    return _enu(t), velocity, np.column_stack([roll, pitch, heading])


def _enu_of_length(length: np.ndarray) -> np.ndarray:
    s = length / 640.0
    return np.column_stack(
        [500 * np.sin(s), 320 * np.sin(2 * s) + 60 * np.cos(5 * s) - 60, 12 * np.sin(s * 1.3)]
    )


def body_to_enu(rpy: np.ndarray) -> np.ndarray:
    r, p, h = rpy.T
    out = np.empty((len(r), 3, 3))
    cr, sr, cp, sp, ch, sh = np.cos(r), np.sin(r), np.cos(p), np.sin(p), np.cos(h), np.sin(h)
    n = np.stack([ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr], -1)
    e = np.stack([sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr], -1)
    d = np.stack([-sp, cp * sr, cp * cr], -1)
    out[:, 0], out[:, 1], out[:, 2] = e, n, -d
    return out


def _smooth(rng: np.random.Generator, count: int, width: int) -> np.ndarray:
    noise = rng.standard_normal((count + width, 3))
    kernel = np.hanning(width)
    kernel /= np.sqrt((kernel**2).sum())
    return np.stack([np.convolve(noise[:, i], kernel, mode="same")[:count] for i in range(3)], 1)


def _since_outage(t: np.ndarray) -> np.ndarray:
    out = np.zeros_like(t)
    for a, b in OUTAGES_S:
        inside = (t >= a) & (t <= b)
        out[inside] = t[inside] - a
        after = (t > b) & (t < b + 3)
        out[after] = (b - a) * (1 - (t[after] - b) / 3)
    return out


def ns(t: np.ndarray) -> np.ndarray:
    return START_NS + np.rint(t * NS_PER_S).astype(np.int64)


def _packed(sigma: np.ndarray, correlation: float = 0.0) -> np.ndarray:
    e, n, u = sigma.T
    return np.stack([e * e, correlation * e * n, 0 * e, n * n, 0 * n, u * u], axis=-1)


def make_channels(
    duration_s: float = 300.0,
    *,
    imu_hz: int = 200,
    runs: tuple[str, ...] = ("tight",),
    seed: int = 7,
) -> dict[str, Columns]:
    """Every channel of a run log."""
    rng = np.random.default_rng(seed)
    origin, axes = _ecef_origin()
    out: dict[str, Columns] = {}

    t = np.arange(0, duration_s, 1 / imu_hz)
    _, v, rpy = _motion(t)
    turn = body_to_enu(rpy)
    acceleration = np.gradient(v, t, axis=0) + np.array([0, 0, 9.80])
    force = np.einsum("nji,nj->ni", turn, acceleration) + rng.normal(0, 0.02, (len(t), 3))
    rate = np.gradient(np.unwrap(rpy, axis=0), t, axis=0) + rng.normal(0, 2e-3, (len(t), 3))
    out["/imu/raw"] = Columns.build(
        ns(t),
        {
            "angular_rate_body_rad_s": rate,
            "specific_force_body_m_s2": force,
            "temperature_c": 31 + 4 * (1 - np.exp(-t / 90)),
        },
        present={"temperature_c": np.ones(len(t), dtype=bool)},
    )

    t = np.arange(0, duration_s, 0.1)
    p, v, rpy = _motion(t)
    at = p + np.einsum("nij,j->ni", body_to_enu(rpy), TRUTH_LEVER)
    gyro_bias = np.radians(np.array([8.0, -5.0, 3.0]) / 3600)
    accel_bias = np.array([1.2, -0.8, 2.0]) * 9.80665e-3
    out["/truth"] = Columns.build(
        ns(t),
        {
            "position_ecef_m": origin + at @ axes,
            "lever_arm_body_m": np.tile(TRUTH_LEVER, (len(t), 1)),
            "quality": np.full(len(t), gnss_pb2.FIX_QUALITY_FUSED, dtype=np.int32),
            "velocity_enu_m_s": v,
            "attitude_rad": _wrapped(rpy),
            "position_std_enu_m": np.full((len(t), 3), 0.01),
            "gyro_bias_body_rad_s": np.tile(gyro_bias, (len(t), 1)),
            "accel_bias_body_m_s2": np.tile(accel_bias, (len(t), 1)),
        },
        present={
            name: np.ones(len(t), dtype=bool)
            for name in (
                "velocity_enu_m_s",
                "attitude_rad",
                "position_std_enu_m",
                "gyro_bias_body_rad_s",
                "accel_bias_body_m_s2",
            )
        },
    )
    out["/gnss/rover/fix"] = _fixes(rng, duration_s, origin, axes)
    for index, run in enumerate(runs):
        out |= _run(rng, duration_s, origin, axes, run, 1.0 + 0.8 * index, gyro_bias, accel_bias)
    return out


def _wrapped(rpy: np.ndarray) -> np.ndarray:
    return np.mod(rpy + np.pi, 2 * np.pi) - np.pi


def _fixes(
    rng: np.random.Generator, duration_s: float, origin: np.ndarray, axes: np.ndarray
) -> Columns:
    t = np.arange(0, duration_s, 1.0)
    t = t[~np.any([(t > a) & (t < b) for a, b in OUTAGES_S], axis=0)]
    p, v, rpy = _motion(t)
    fixed = np.sin(t / 17) > -0.6
    sigma = np.where(fixed[:, None], [0.01, 0.01, 0.02], [0.3, 0.3, 0.6])
    at = p + np.einsum("nij,j->ni", body_to_enu(rpy), ANTENNA_LEVER)
    return Columns.build(
        ns(t),
        {
            "position_ecef_m": origin + (at + sigma * rng.standard_normal((len(t), 3))) @ axes,
            "position_covariance_enu_m2": _packed(sigma),
            "antenna_lever_arm_body_m": np.tile(ANTENNA_LEVER, (len(t), 1)),
            "quality": np.where(
                fixed, gnss_pb2.FIX_QUALITY_RTK_FIXED, gnss_pb2.FIX_QUALITY_RTK_FLOAT
            ).astype(np.int32),
            "velocity_ecef_m_s": (v + rng.normal(0, 0.03, v.shape)) @ axes,
            "velocity_covariance_enu_m2_s2": _packed(np.full((len(t), 3), 0.03)),
            "satellite_count": (14 + rng.integers(-3, 4, len(t))).astype(np.uint32),
            "differential_age_s": 1.0 + np.mod(t, 3),
            "ambiguity_ratio": np.where(fixed, 8 + rng.random(len(t)), np.nan),
        },
        log_time_ns=ns(t) + 80_000_000,
        present={
            "velocity_ecef_m_s": np.ones(len(t), dtype=bool),
            "velocity_covariance_enu_m2_s2": np.ones(len(t), dtype=bool),
            "satellite_count": np.ones(len(t), dtype=bool),
            "differential_age_s": np.ones(len(t), dtype=bool),
            "ambiguity_ratio": fixed,
        },
    )


def _run(
    rng: np.random.Generator,
    duration_s: float,
    origin: np.ndarray,
    axes: np.ndarray,
    name: str,
    worse: float,
    gyro_bias: np.ndarray,
    accel_bias: np.ndarray,
) -> dict[str, Columns]:
    out: dict[str, Columns] = {}
    t = np.arange(2.0, duration_s - 0.5, 0.1) + 0.005
    p, v, rpy = _motion(t)
    lost = _since_outage(t)[:, None]
    sp = worse * (np.array([0.02, 0.02, 0.03]) + np.array([2e-3, 2.4e-3, 1e-3]) * lost**2)
    sv = worse * (np.array([0.02, 0.02, 0.015]) + np.array([4e-3, 4.8e-3, 2e-3]) * lost)
    sa = np.radians(worse * (np.array([0.04, 0.04, 0.25]) + np.array([1e-3, 1e-3, 4e-3]) * lost))
    attitude = rpy + sa[:, [1, 0, 2]] * _smooth(rng, len(t), 400)
    in_outage = np.any([(t >= a + 2) & (t < b) for a, b in OUTAGES_S], axis=0)
    out[f"/solution/{name}"] = Columns.build(
        ns(t),
        {
            "position_ecef_m": origin + (p + sp * _smooth(rng, len(t), 120)) @ axes,
            "velocity_enu_m_s": v + sv * _smooth(rng, len(t), 60),
            "attitude_rad": _wrapped(attitude),
            "angular_rate_body_rad_s": np.gradient(np.unwrap(rpy, axis=0), t, axis=0),
            "position_covariance_enu_m2": _packed(sp, 0.4),
            "velocity_std_enu_m_s": sv,
            "attitude_std_rad": sa,
            "status": np.where(
                in_outage,
                solution_pb2.SOLUTION_STATUS_OUTAGE,
                solution_pb2.SOLUTION_STATUS_PREDICTED,
            ).astype(np.int32),
        },
    )
    out |= _filter(rng, duration_s, name, worse, gyro_bias, accel_bias)
    return out


def _filter(
    rng: np.random.Generator,
    duration_s: float,
    name: str,
    worse: float,
    gyro_bias: np.ndarray,
    accel_bias: np.ndarray,
) -> dict[str, Columns]:
    t = np.arange(2.0, duration_s - 0.5, 1.0)
    n = len(t)
    shrink = 1 / np.sqrt(1 + t / 15.0)[:, None]
    sigma = np.ones((n, 21))
    sigma[:, 9:12] = np.radians(20.0 / 3600) * shrink * worse
    sigma[:, 12:15] = 3.0 * 9.80665e-3 * shrink * worse
    sigma[:, 15:18] = 400e-6 * shrink
    sigma[:, 18:21] = 600e-6 * shrink
    settle = np.exp(-t / 30.0)[:, None]
    wobble = 0.4 * _smooth(rng, n, 60)
    out: dict[str, Columns] = {
        f"/filter/{name}/state": Columns.build(
            ns(t),
            {
                "position_ecef_m": np.zeros((n, 3)),
                "velocity_ecef_m_s": np.zeros((n, 3)),
                "q_body_to_ecef": np.tile([1.0, 0, 0, 0], (n, 1)),
                "gyro_bias_body_rad_s": gyro_bias * (1 - settle) + wobble * sigma[:, 9:12],
                "accel_bias_body_m_s2": accel_bias * (1 - settle) + wobble * sigma[:, 12:15],
                "gyro_scale_factor": wobble * sigma[:, 15:18],
                "accel_scale_factor": wobble * sigma[:, 18:21],
                "mounting_angles_rad": np.zeros((n, 3)),
                "squat_rad_s2_m": np.zeros(n),
                "non_slip_point_body_m": np.tile([-1.2, 0.0, 0.8], (n, 1)),
            },
        )
    }
    upper = np.triu_indices(21)
    triangles = np.zeros((n, len(upper[0])))
    triangles[:, upper[0] == upper[1]] = sigma**2
    text = ",".join(STATES)
    out[f"/filter/{name}/covariance"] = Columns.build(
        ns(t),
        {
            "dimension": np.full(n, 21, dtype=np.uint32),
            "state_names": Ragged.from_texts([text] * n),
            "upper_triangle": Ragged.from_matrix(triangles),
        },
    )
    out[f"/filter/{name}/innovations"] = _innovations(rng, t)
    out[f"/filter/{name}/events"] = _events()
    return out


def _innovations(rng: np.random.Generator, t: np.ndarray) -> Columns:
    fixes = t[~np.any([(t > a) & (t < b) for a, b in OUTAGES_S], axis=0)]
    groups = [
        (filter_pb2.MEASUREMENT_KIND_POSITION, (1, 2, 3), fixes, 0.05),
        (filter_pb2.MEASUREMENT_KIND_VELOCITY, (1, 2, 3), fixes, 0.06),
        (filter_pb2.MEASUREMENT_KIND_NON_HOLONOMIC, (5, 6), t, 0.1),
    ]
    times, kinds, axes, sigmas = [], [], [], []
    for kind, sides, at, scale in groups:
        for side in sides:
            times.append(at)
            kinds.append(np.full(len(at), kind))
            axes.append(np.full(len(at), side))
            sigmas.append(scale * (1 + 0.5 * np.sin(at / 23) + _since_outage(at) / 20))
    time = np.concatenate(times)
    kind, axis, sigma = (np.concatenate(x) for x in (kinds, axes, sigmas))
    normalized = rng.standard_normal(len(time))
    wild = rng.random(len(time)) < 0.015
    normalized[wild] *= 6
    order = np.lexsort([axis, kind, time])
    n = len(time)
    return Columns.build(
        ns(time[order]),
        {
            "kind": kind[order].astype(np.int32),
            "axis": axis[order].astype(np.int32),
            "satellite": Ragged.from_texts(["---"] * n),
            "signal": Ragged.from_texts(["--"] * n),
            "innovation": (normalized * sigma)[order],
            "innovation_std": sigma[order],
            "measurement_std": sigma[order] * 0.8,
            "normalized": normalized[order],
            "accepted": (np.abs(normalized) < 3.5)[order],
        },
    )


def _events() -> Columns:
    rows = [
        (1.0, filter_pb2.EVENT_KIND_ALIGNMENT_LEVELLED, 0.05, "roll 0.02 deg, pitch -0.11 deg"),
        (
            24.0,
            filter_pb2.EVENT_KIND_ALIGNMENT_COMPLETE,
            1.2,
            "heading 57.3 deg, 1.2 deg (1 sigma)",
        ),
        (61.0, filter_pb2.EVENT_KIND_MEASUREMENT_REJECTED, 5.1, "position north, 5.1 sigma"),
        (102.0, filter_pb2.EVENT_KIND_OUTAGE_BEGIN, 2.0, "no position for 2.0 s"),
        (130.0, filter_pb2.EVENT_KIND_OUTAGE_END, 30.0, "after 30.0 s"),
        (164.0, filter_pb2.EVENT_KIND_STOP_BEGIN, 0.0, ""),
        (176.0, filter_pb2.EVENT_KIND_STOP_END, 12.0, "stood 12.0 s"),
        (202.0, filter_pb2.EVENT_KIND_OUTAGE_BEGIN, 2.0, "no position for 2.0 s"),
        (230.0, filter_pb2.EVENT_KIND_OUTAGE_END, 30.0, "after 30.0 s"),
        (251.0, filter_pb2.EVENT_KIND_IMU_GAP, 0.035, "7 samples, 0.035 s"),
    ]
    return Columns.build(
        ns(np.array([row[0] for row in rows])),
        {
            "kind": np.array([row[1] for row in rows], dtype=np.int32),
            "value": np.array([row[2] for row in rows]),
            "detail": Ragged.from_texts([row[3] for row in rows]),
        },
    )


def make_metadata() -> dict[str, dict[str, str]]:
    """Metadata records of the log."""
    manifest = {
        "command": "run",
        "packageVersion": "0.1.0",
        "pipeline": "loose",
        "configuration": '[filter]\nstates = 21\ngate_sigma = 3.5\n\n[imu]\ngrade = "tactical"\n',
        "stages": [
            {"name": "align", "version": 1, "inputs": ["/imu/raw"], "outputs": []},
            {
                "name": "filter",
                "version": 3,
                "inputs": ["/imu/raw", "/gnss/rover/fix"],
                "outputs": ["/solution/tight"],
            },
        ],
        "inputs": [
            {"topic": "/imu/raw", "schema": "replay.ImuSample", "messageCount": "60000",
             "sha256": "0f" * 32},
            {"topic": "/gnss/rover/fix", "schema": "replay.GnssFix", "messageCount": "242",
             "sha256": "a7" * 32},
        ],
        "outputs": [
            {"topic": "/solution/tight", "schema": "replay.Solution", "messageCount": "2975",
             "sha256": "3c" * 32},
        ],
        "notes": ["two outages of 30 s were cut into /gnss/rover/fix"],
    }  # fmt: skip
    outages = [
        {"start_ns": int(ns(np.array(a))), "end_ns": int(ns(np.array(b)))} for a, b in OUTAGES_S
    ]
    return {
        "replay.manifest": {"json": json.dumps(manifest)},
        "replay.degrade": {"json": json.dumps({"outages": outages})},
    }


def in_batches(channels: dict[str, Columns], seconds: float = 20.0) -> list[dict[str, Columns]]:
    """Channels cut into batches of time, as a reader hands them out."""
    start = min(int(c.log_time_ns[0]) for c in channels.values() if len(c))
    stop = max(int(c.log_time_ns[-1]) for c in channels.values() if len(c))
    step = int(seconds * NS_PER_S)
    out = []
    for begin in range(start, stop + 1, step):
        batch = {
            topic: columns.take(
                (columns.log_time_ns >= begin) & (columns.log_time_ns < begin + step)
            )
            for topic, columns in channels.items()
        }
        out.append({topic: columns for topic, columns in batch.items() if len(columns)})
    return out
