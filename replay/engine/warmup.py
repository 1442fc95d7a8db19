"""Compile every kernel by running a log of a few rows through every pipeline."""

from __future__ import annotations

import tempfile
import time as clock
from pathlib import Path

import numpy as np

from replay.channels import GNSS_FIX, IMU
from replay.engine.job import make_job
from replay.engine.pipelines import PIPELINES
from replay.engine.run import replay_log
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.log.writer import LogWriter

_ROWS = 8
_STEP_NS = 10_000_000


def compile_kernels() -> float:
    """Compile what is not in the cache yet; the seconds that it took."""
    begin = clock.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        source = Path(scratch) / "in.mcap"
        _write_small_log(source)
        for name in PIPELINES:
            with LogReader(source) as reader:
                job = make_job(reader, name, tables=[])
                replay_log(reader, Path(scratch) / f"{name}.mcap", job)
    return clock.perf_counter() - begin


def _write_small_log(path: Path) -> None:
    times = np.arange(_ROWS, dtype=np.int64) * _STEP_NS
    level = np.tile([0.0, 0.0, -9.8], (_ROWS, 1))
    imu = {
        "angular_rate_body_rad_s": np.zeros((_ROWS, 3)),
        "specific_force_body_m_s2": level,
    }
    fix = {
        "position_ecef_m": np.tile([6378137.0, 0.0, 0.0], (_ROWS, 1)),
        "position_covariance_enu_m2": np.tile([1.0, 0.0, 0.0, 1.0, 0.0, 1.0], (_ROWS, 1)),
        "antenna_lever_arm_body_m": np.zeros((_ROWS, 3)),
        "quality": np.zeros(_ROWS, dtype=np.int32),
    }
    topics = {IMU.topic: (IMU, imu), GNSS_FIX.at(receiver="rover"): (GNSS_FIX, fix)}
    with LogWriter(path) as writer:
        for topic, (spec, _) in topics.items():
            writer.add_channel(topic, spec.message)
        writer.write({t: Columns.build(times, values) for t, (_, values) in topics.items()})
