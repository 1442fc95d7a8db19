"""Compile kernels by running a log of a few rows through pipelines."""

from __future__ import annotations

import tempfile
import time as clock
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from replay.channels import (
    FILTER_TRANSITION,
    GNSS_FIX,
    GNSS_OBS,
    IMU,
    NAV,
    PRECISE_ORBIT,
    RECEIVER,
    SOLUTION,
    ChannelSpec,
)
from replay.engine.job import make_job
from replay.engine.manifest import DEFAULTS
from replay.engine.pipelines import PIPELINES, find_pipeline
from replay.engine.run import replay_log
from replay.gnss.ephemerides import ephemeris_columns
from replay.ins.states import state_names
from replay.kernels.ephemeris import EPHEMERIS_DTYPE
from replay.log.columns import Column, Columns, Ragged
from replay.log.reader import LogReader
from replay.log.writer import LogWriter

_ROWS = 8
_STEP_NS = 10_000_000
_PLACE = (6378137.0, 0.0, 0.0)


def compile_kernels(pipelines: Sequence[str] = ()) -> float:
    """Compile what is not in the cache yet; the seconds that it took.

    Parameters
    ----------
    pipelines : sequence of str
        Those whose kernels are wanted; none stands for all.
    """
    begin = clock.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        source = Path(scratch) / "in.mcap"
        _write_small_log(source)
        recorded = Path(scratch) / "recorded.mcap"
        _write_recorded_run(recorded)
        for name in pipelines or PIPELINES:
            find_pipeline(name)
            with LogReader(recorded if name == "smooth" else source) as reader:
                job = make_job(reader, name, tables=[])
                replay_log(reader, Path(scratch) / f"{name}.mcap", job)
    return clock.perf_counter() - begin


def _write_small_log(path: Path) -> None:
    times = np.arange(_ROWS, dtype=np.int64) * _STEP_NS
    rows: dict[str, tuple[ChannelSpec, Columns]] = {
        IMU.topic: (IMU, _inertial(times)),
        GNSS_FIX.at(receiver="rover"): (GNSS_FIX, _fixes(times)),
        NAV.topic: (NAV, _messages()),
        PRECISE_ORBIT.topic: (PRECISE_ORBIT, _orbits()),
    }
    for receiver in ("rover", "base", "station"):
        rows[GNSS_OBS.at(receiver=receiver)] = (GNSS_OBS, _observations(times))
        rows[RECEIVER.at(receiver=receiver)] = (RECEIVER, _receiver(times[:1]))
    with LogWriter(path) as writer:
        for topic, (spec, _) in rows.items():
            writer.add_channel(topic, spec.message)
        writer.add_metadata(DEFAULTS, {"toml": '[gnss]\nreceiver = "rover"\nbase = "base"\n'})
        writer.write({topic: columns for topic, (_, columns) in rows.items()})


def _write_recorded_run(path: Path) -> None:
    """Two nodes of a filter that stands still: what smoothing reads."""
    times = np.arange(2, dtype=np.int64) * _STEP_NS
    states = 9
    names = state_names(15, mounting=False, lever=False, squat=False)[:states]
    triangle = np.eye(states)[np.triu_indices(states)]
    each = Ragged.from_matrix
    none = np.zeros(1, dtype=np.uint32)
    transition: dict[str, Column] = {
        "since_ns": np.array([0, 0], dtype=np.int64),
        "dimension_before": np.array([0, states], dtype=np.uint32),
        "dimension": np.full(2, states, dtype=np.uint32),
        "state_names": Ragged.from_texts([",".join(names)] * 2),
        "row": Ragged(np.array([0, 0, 1], dtype=np.int64), none),
        "column": Ragged(np.array([0, 0, 1], dtype=np.int64), none),
        "value": Ragged(np.array([0, 0, 1], dtype=np.int64), np.ones(1)),
        "predicted_upper_triangle": each(np.tile(triangle, (2, 1))),
        "correction": each(np.zeros((2, states))),
        "updated_upper_triangle": each(np.tile(triangle, (2, 1))),
        "estimate": each(np.tile([*_PLACE, *np.zeros(states - 3)], (2, 1))),
        "q_body_to_ecef": each(np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))),
        "solution": np.ones(2, dtype=np.uint32),
    }
    solution: dict[str, Column] = {
        "position_ecef_m": np.tile(_PLACE, (2, 1)),
        "velocity_enu_m_s": np.zeros((2, 3)),
        "attitude_rad": np.zeros((2, 3)),
        "angular_rate_body_rad_s": np.zeros((2, 3)),
        "position_covariance_enu_m2": np.tile([1.0, 0.0, 0.0, 1.0, 0.0, 1.0], (2, 1)),
        "velocity_std_enu_m_s": np.ones((2, 3)),
        "attitude_std_rad": np.ones((2, 3)),
        "status": np.ones(2, dtype=np.int32),
    }
    rows = {
        FILTER_TRANSITION.at(run="still"): (FILTER_TRANSITION, Columns.build(times, transition)),
        SOLUTION.at(run="still"): (SOLUTION, Columns.build(times, solution)),
    }
    with LogWriter(path) as writer:
        for topic, (spec, _) in rows.items():
            writer.add_channel(topic, spec.message)
        writer.write({topic: columns for topic, (_, columns) in rows.items()})


def _inertial(times: np.ndarray) -> Columns:
    level = np.tile([0.0, 0.0, -9.8], (_ROWS, 1))
    values = {
        "angular_rate_body_rad_s": np.zeros((_ROWS, 3)),
        "specific_force_body_m_s2": level,
    }
    return Columns.build(times, values)


def _fixes(times: np.ndarray) -> Columns:
    return Columns.build(
        times,
        {
            "position_ecef_m": np.tile(_PLACE, (_ROWS, 1)),
            "position_covariance_enu_m2": np.tile([1.0, 0.0, 0.0, 1.0, 0.0, 1.0], (_ROWS, 1)),
            "antenna_lever_arm_body_m": np.zeros((_ROWS, 3)),
            "quality": np.zeros(_ROWS, dtype=np.int32),
        },
    )


def _messages() -> Columns:
    """One satellite straight above: too few for a position, enough for the compiler."""
    record = np.zeros(1, dtype=EPHEMERIS_DTYPE)
    record["system"] = ord("G")
    record["prn"] = 1
    record["sqrt_a"] = 5153.7
    return ephemeris_columns(record, np.zeros(1, dtype=np.int64))


def _orbits() -> Columns:
    """The same satellite in a product: too few epochs for an orbit."""
    no = np.zeros(1, dtype=np.bool_)
    return Columns.build(
        np.zeros(1, dtype=np.int64),
        {
            "satellite": np.full(1, b"G01"),
            "position_ecef_m": np.array([[26.6e6, 0.0, 0.0]]),
            "velocity_ecef_m_s": np.zeros((1, 3)),
            "clock_s": np.zeros(1),
            "position_std_ecef_m": np.zeros((1, 3)),
            "clock_std_s": np.zeros(1),
            **dict.fromkeys(("orbit_predicted", "manoeuvre", "clock_predicted", "clock_event"), no),
        },
    )


def _observations(times: np.ndarray) -> Columns:
    return Columns.build(
        times,
        {
            "satellite": np.full(_ROWS, b"G01"),
            "signal": np.full(_ROWS, b"1C"),
            "pseudorange_m": np.full(_ROWS, 2.0e7),
            "carrier_phase_cycles": np.full(_ROWS, 1.0e8),
            "doppler_hz": np.zeros(_ROWS),
            "cn0_dbhz": np.full(_ROWS, 45.0),
        },
    )


def _receiver(times: np.ndarray) -> Columns:
    nothing = Ragged.from_texts([""])
    return Columns.build(
        times,
        {
            "marker": nothing,
            "receiver": nothing,
            "antenna": nothing,
            "approximate_position_ecef_m": np.array([_PLACE]),
            "header": nothing,
        },
    )
