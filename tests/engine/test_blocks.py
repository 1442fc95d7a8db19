"""Where a log is cut into blocks changes no bit of what comes out."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from replay import channels
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.stages.base import Context
from tests.engine.drives import (
    FIX,
    FULL,
    IMU,
    SECOND,
    StageRun,
    changed,
    log_times,
    run_digests,
    shifted,
    short_config,
    short_rows,
)

LATE = {"gnss": {"latency": 0.13}}
CASES: dict[str, tuple[dict[str, Any], list[dict[str, Any]]]] = {
    "15 states": ({}, [{"filter": {"states": 15}}]),
    "21 states, vehicle": ({}, [FULL]),
    "late fixes": ({"gnss": {"latency": 0.1}}, [FULL, LATE]),
    "some later than waited for": ({}, [{"gnss": {"latency": 0.1}}]),
    "mean velocity": ({}, [{"gnss": {"velocity_window": 0.25}}]),
    "faulty rows": ({}, [FULL, {"gnss": {"latency": 0.1, "rejections": 2, "position_gate": 16.0}}]),
}


def spoil(rows: dict[str, Columns]) -> dict[str, Columns]:
    """A bit of every fault."""
    imu, fix = rows[IMU], rows[FIX]
    imu = changed(imu, "angular_rate_body_rad_s", 700, np.nan)
    imu = changed(imu, "specific_force_body_m_s2", 1301, np.inf)
    imu = shifted(imu, 900, valid_ns=-3 * SECOND)
    imu = shifted(imu, 1100, valid_ns=-20_000_000)
    imu = imu.take(~np.isin(np.arange(len(imu)), np.arange(1500, 1520)))
    fix = changed(fix, "position_ecef_m", 50, np.nan)
    for row in (150, 151, 152, 153):
        fix = changed(fix, "position_ecef_m", row, fix["position_ecef_m"][row] + 30.0)
    for row, late_ns in ((70, 60_000_000), (75, 100_000_000), (80, 3 * SECOND)):
        fix = shifted(fix, row, log_ns=late_ns)
    return {**rows, IMU: imu, FIX: fix}


def delay(rows: dict[str, Columns]) -> dict[str, Columns]:
    """Fixes that come up to 0.3 s late, now and then after the next one."""
    fix = rows[FIX]
    late = np.random.default_rng(3).integers(0, 30, len(fix)) ** 2 // 3 * 1_000_000
    log_ns = fix.log_time_ns + late
    order = np.argsort(log_ns, kind="stable").astype(np.int64)
    return {**rows, FIX: dataclasses.replace(fix, log_time_ns=log_ns).take(order)}


@functools.cache
def whole(case: str) -> tuple[dict[str, Columns], Any, StageRun]:
    """Rows, settings and the outputs when all rows come in one block."""
    scenario, tables = CASES[case]
    rows = short_rows(**scenario)
    if case == "faulty rows":
        rows = spoil(rows)
    if case == "some later than waited for":
        rows = delay(rows)
    config = short_config(*tables)
    return rows, config, StageRun(rows, config)


def edges_of(rows: dict[str, Columns], kind: str, rng: np.random.Generator) -> np.ndarray:
    """Log times to cut after."""
    times = log_times(rows)
    if kind == "each row":
        return times
    if kind == "after each fix":
        return rows[FIX].log_time_ns
    if kind == "before each fix":
        return rows[FIX].log_time_ns - 1
    density = float(rng.choice([0.002, 0.02, 0.3]))
    return times[rng.random(len(times)) < density]


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("kind", ["each row", "after each fix", "before each fix"])
def test_regular_blocks_change_nothing(case: str, kind: str) -> None:
    rows, config, one = whole(case)
    cut_up = StageRun(rows, config, edges_of(rows, kind, np.random.default_rng(0)))
    assert len(cut_up.blocks) > 100
    assert cut_up.bytes() == one.bytes()


@given(case=st.sampled_from(sorted(CASES)), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40, suppress_health_check=[HealthCheck.too_slow])
def test_random_blocks_change_nothing(case: str, seed: int) -> None:
    rows, config, one = whole(case)
    edges = edges_of(rows, "random", np.random.default_rng(seed))
    assert StageRun(rows, config, edges).bytes() == one.bytes()


@pytest.mark.parametrize("case", CASES)
def test_the_case_is_worth_cutting(case: str) -> None:
    """The drive has what the cut could break, so that equal outputs mean something."""
    _, _, one = whole(case)
    assert len(one.solution) > 400
    for kind in ("ALIGNMENT_COMPLETE", "OUTAGE_BEGIN", "OUTAGE_END", "STOP_BEGIN", "STOP_END"):
        assert one.events_of(kind), kind
    if case == "faulty rows":
        for kind in ("NOT_FINITE", "TIME_BACKWARD", "IMU_GAP", "MEASUREMENT_REJECTED", "RESET"):
            assert one.events_of(kind), kind
    if case == "some later than waited for":
        assert one.events_of("TIME_BACKWARD")
    vehicle = FULL in CASES[case][1]
    assert one.covariances.shape[1] == (26 if vehicle else 15 if case == "15 states" else 21)
    assert np.any(one.states["squat_rad_s2_m"] != 0.0) == vehicle


def test_state_survives_a_dump_at_any_time() -> None:
    """Dump and restore in mid-log, into a fresh state, and go on as if nothing had been."""
    rows, config, one = whole("faulty rows")
    times = log_times(rows)
    for at in (3, 600, 1333, 2000):
        edges = [int(times[at])]
        resumed = StageRun(rows, config, edges)
        stage = resumed.stage
        first = stage.start(config, _context(rows))
        first, _ = stage.step(first, resumed.blocks[0])
        dumped = stage.dump(first)
        restored = stage.restore(stage.start(config, _context(rows)), dumped)
        assert stage.dump(restored) == dumped
        restored, outputs = stage.step(restored, resumed.blocks[1])
        assert stage.dump(restored) == stage.dump(resumed.state) == stage.dump(one.state)
        solution = outputs[channels.SOLUTION.name]
        rest = one.solution.take(slice(len(one.solution) - len(solution), None))
        assert solution["position_ecef_m"].tobytes() == rest["position_ecef_m"].tobytes()


def test_restore_refuses_another_dump() -> None:
    _, _, one = whole("15 states")
    dumped = one.stage.dump(one.state)
    with pytest.raises(ValueError):
        one.stage.restore(one.state, dumped.replace(b"filter", b"folder", 1))


def _context(rows: dict[str, Columns]) -> Context:
    heads = {"IMU": rows[IMU].take(slice(0, 1024)), "GNSS_FIX": rows[FIX].take(slice(0, 1024))}
    return Context({"IMU": IMU, "GNSS_FIX": FIX}, heads)


@pytest.mark.parametrize("rows_per_batch", [1, 7, 1000])
def test_batches_of_the_reader_change_nothing(short_log: Path, rows_per_batch: int) -> None:
    class Cut(LogReader):
        def batches(self, topics=None, *, target_rows=0, **more):  # type: ignore[no-untyped-def]
            del target_rows
            return super().batches(topics, target_rows=rows_per_batch, **more)

    with LogReader(short_log) as reader:
        end_ns = reader.start_ns + 25 * SECOND
    assert run_digests(short_log, FULL, reader=Cut, end_ns=end_ns) == run_digests(
        short_log, FULL, end_ns=end_ns
    )
