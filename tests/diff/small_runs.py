"""A small run in memory with one channel of every kind, and the tools to spoil it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from google.protobuf import descriptor, descriptor_pool

from replay.channels import find
from replay.diff.runs import MemoryRun
from replay.log.columns import Columns, Ragged
from replay.schemas.replay_pb2 import Manifest

START = 1_400_000_000 * 1_000_000_000
EPOCHS = 8
STEP = 200_000_000
SATELLITES = ("G05", "G07", "E11")
SIGNALS = ("1C", "5Q")
STATE = "/filter/ekf/state"
COVARIANCE = "/filter/ekf/covariance"
EVENTS = "/filter/ekf/events"
SOLUTION = "/solution/ekf"
OBS = "/gnss/rover/obs"
IMU = "/imu/raw"
TRACE = "/replay/trace"
ORDER = 15
STATE_NAMES = ",".join(
    f"{group}_{axis}"
    for group in ("position_ecef", "velocity_ecef", "attitude_ecef", "gyro_bias", "accel_bias")
    for axis in "xyz"
)
STAGES = ("mechanise", "filter")

Channels = dict[str, Columns]


def _quaternions(rng: np.random.Generator, count: int) -> np.ndarray:
    q = rng.normal(size=(count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def _covariances(rng: np.random.Generator, count: int) -> np.ndarray:
    root = rng.normal(size=(count, ORDER, ORDER)) * 0.1
    full = root @ root.transpose(0, 2, 1) + np.eye(ORDER)
    return full[(slice(None), *np.triu_indices(ORDER))]


def channels(seed: int = 0) -> Channels:
    """The channels of one run."""
    rng = np.random.default_rng(seed)
    epochs = START + STEP * np.arange(1, EPOCHS + 1)
    position = np.array([3.9e6, 0.3e6, 5.0e6]) + rng.normal(size=(EPOCHS, 3)) * 100
    imu_times = START + 20_000_000 * np.arange(1, 10 * EPOCHS + 1)
    obs_keys = [(s, c) for _ in range(EPOCHS) for s in SATELLITES for c in SIGNALS]
    obs_count = len(obs_keys)
    present = np.ones(obs_count, dtype=np.bool_)
    present[3] = False
    doppler = rng.normal(size=obs_count) * 1000
    doppler[3] = np.nan
    events = epochs[[0, 2, 5]]
    steps = np.repeat(np.arange(EPOCHS, dtype=np.uint64), len(STAGES))
    digests = rng.integers(1, 2**63, size=(len(steps), 2)).astype(np.uint64)
    return {
        IMU: Columns.build(
            imu_times,
            {
                "angular_rate_body_rad_s": rng.normal(size=(len(imu_times), 3)),
                "specific_force_body_m_s2": rng.normal(size=(len(imu_times), 3)),
            },
        ),
        OBS: Columns.build(
            np.repeat(epochs, len(SATELLITES) * len(SIGNALS)),
            {
                "satellite": np.array([s.encode() for s, _ in obs_keys], dtype="S3"),
                "signal": Ragged.from_texts([c for _, c in obs_keys]),
                "pseudorange_m": 2.2e7 + rng.normal(size=obs_count) * 1e6,
                "doppler_hz": doppler,
                "loss_of_lock": np.zeros(obs_count, dtype=np.uint32),
            },
            present={"doppler_hz": present},
        ),
        STATE: Columns.build(
            epochs,
            {
                "position_ecef_m": position,
                "velocity_ecef_m_s": rng.normal(size=(EPOCHS, 3)),
                "q_body_to_ecef": _quaternions(rng, EPOCHS),
                "gyro_bias_body_rad_s": rng.normal(size=(EPOCHS, 3)) * 1e-4,
                "accel_bias_body_m_s2": rng.normal(size=(EPOCHS, 3)) * 1e-2,
                "gyro_scale_factor": np.zeros((EPOCHS, 3)),
                "accel_scale_factor": np.zeros((EPOCHS, 3)),
                "mounting_angles_rad": np.zeros((EPOCHS, 3)),
            },
        ),
        COVARIANCE: Columns.build(
            epochs,
            {
                "dimension": np.full(EPOCHS, ORDER, dtype=np.uint32),
                "state_names": Ragged.from_texts([STATE_NAMES] * EPOCHS),
                "upper_triangle": Ragged.from_matrix(_covariances(rng, EPOCHS)),
            },
        ),
        EVENTS: Columns.build(
            events,
            {
                "kind": np.array([2, 4, 5], dtype=np.int32),
                "value": np.array([1.0, 2.0, 3.0]),
                "detail": Ragged.from_texts(["aligned", "no fix", "fix again"]),
            },
        ),
        SOLUTION: Columns.build(
            epochs,
            {
                "position_ecef_m": position.copy(),
                "velocity_enu_m_s": rng.normal(size=(EPOCHS, 3)),
                "attitude_rad": rng.uniform(-1.5, 1.5, size=(EPOCHS, 3)),
                "status": np.full(EPOCHS, 2, dtype=np.int32),
            },
        ),
        TRACE: Columns.build(
            np.repeat(epochs, len(STAGES)),
            {
                "stage": Ragged.from_texts(list(STAGES) * EPOCHS),
                "step": steps,
                "input_digest": digests[:, 0],
                "output_digest": digests[:, 1],
            },
        ),
    }


def manifest(**settings: object) -> Manifest:
    """A manifest whose configuration has a section `[filter]`."""
    lines = ["[filter]", *(f"{key} = {value}" for key, value in settings.items())]
    made = Manifest(
        command="run", pipeline="loose", package_version="1", configuration="\n".join(lines)
    )
    made.stages.add(name="mechanise", version=1, inputs=[IMU], outputs=[])
    made.stages.add(name="filter", version=1, inputs=[OBS], outputs=[STATE, COVARIANCE, SOLUTION])
    made.inputs.add(topic=IMU, sha256="aa")
    return made


def run(made: Mapping[str, Columns], path: str = "run", **more: object) -> MemoryRun:
    """A run of these channels."""
    return MemoryRun(path, made, **more)  # type: ignore[arg-type]


def edited(
    made: Channels, topic: str, field: str, row: int, value: object, part: int | None = None
) -> Channels:
    """The channels with one value replaced."""
    columns = made[topic]
    column = columns.values[field]
    if isinstance(column, Ragged):
        if column.values.dtype == np.uint8:
            texts = column.texts()
            texts[row] = str(value)
            new: object = Ragged.from_texts(texts)
        else:
            values = column.values.copy()
            first, last = column.offsets[row], column.offsets[row + 1]
            values[first:last] = value
            new = Ragged(column.offsets, values)
    else:
        new = column.copy()
        if part is None:
            new[row] = value
        else:
            new[row, part] = value
    changed = dataclasses.replace(columns, values={**columns.values, field: new})
    return {**made, topic: changed}


def without_rows(made: Channels, topic: str, rows: list[int]) -> Channels:
    """The channels with rows of one of them taken out."""
    keep = np.setdiff1d(np.arange(len(made[topic])), rows)
    return {**made, topic: made[topic].take(keep)}


def complete(topic: str, columns: Columns) -> Columns:
    """The columns with a zero for each field that a log must hold and a test does not need."""
    spec = find(topic)
    assert spec is not None
    count = len(columns)
    values = dict(columns.values)
    for field in descriptor_pool.Default().FindMessageTypeByName(spec.message).fields:
        nested = field.message_type
        if field.name in values or field.containing_oneof is not None:
            continue  # proto3 keeps what is optional in a oneof of its own
        if nested is not None:
            values[field.name] = np.zeros((count, len(nested.fields)))
        elif field.cpp_type == descriptor.FieldDescriptor.CPPTYPE_STRING:
            values[field.name] = Ragged.from_texts([""] * count)
        else:
            values[field.name] = np.zeros(count)
    return dataclasses.replace(columns, values=values)
