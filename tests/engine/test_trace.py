"""The trace: one row per step, and the first step at which two runs part."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from replay.log.columns import Columns, Ragged
from replay.log.reader import LogReader
from tests.engine.drives import (
    FIX,
    FULL,
    IMU,
    PIPELINE,
    SECOND,
    TRACE,
    TRUTH,
    changed,
    first_difference,
    rewrite,
    run_to_file,
)


def trace_of(path: Path) -> Columns:
    with LogReader(path) as reader:
        return reader.read(TRACE)


def traced(source: Path, target: Path, *tables: dict) -> Columns:  # type: ignore[type-arg]
    run_to_file(source, target, *tables)
    return trace_of(target)


def parts(a: Columns, b: Columns) -> tuple[int, int]:
    """First step at which inputs, and outputs, differ; the number of steps where they do not."""
    return (
        first_difference(a["input_digest"].tolist(), b["input_digest"].tolist()),
        first_difference(a["output_digest"].tolist(), b["output_digest"].tolist()),
    )


def test_one_row_for_each_trigger_time_and_one_at_the_end(short_log: Path, short_run: Path) -> None:
    trace = trace_of(short_run)
    with LogReader(short_log) as reader:
        times = np.unique(reader.read(FIX).log_time_ns)
        last = max(reader.read(topic).log_time_ns[-1] for topic in (IMU, FIX))
    assert np.array_equal(trace.log_time_ns, [*times, last])
    assert np.array_equal(trace["step"], np.arange(len(times) + 1))
    assert set(trace.ragged("stage").texts()) == {PIPELINE}


def test_equal_runs_have_equal_traces(short_log: Path, short_run: Path, tmp_path: Path) -> None:
    again = traced(short_log, tmp_path / "run.mcap")
    assert parts(again, trace_of(short_run)) == (len(again), len(again))


def step_after(trace: Columns, log_ns: int) -> int:
    """The step that a row of this log time belongs to."""
    return int(np.searchsorted(trace.log_time_ns, log_ns))


def test_a_changed_input_shows_at_its_step(
    short_log: Path, short_run: Path, tmp_path: Path
) -> None:
    whole = trace_of(short_run)
    for topic, field, row in (
        (IMU, "specific_force_body_m_s2", 1601),
        (FIX, "position_ecef_m", 90),
    ):
        log_ns = 0

        def nudge(rows, topic=topic, field=field, row=row):  # type: ignore[no-untyped-def]
            nonlocal log_ns
            log_ns = int(rows[topic].log_time_ns[row])
            value = rows[topic][field][row] + 1e-9
            return {**rows, topic: changed(rows[topic], field, row, value)}

        other = rewrite(short_log, tmp_path / "other.mcap", nudge)
        inputs, outputs = parts(traced(other, tmp_path / "run.mcap"), whole)
        assert inputs == step_after(whole, log_ns), topic
        assert inputs <= outputs <= inputs + 1, topic


def test_changed_settings_show_in_outputs_only(
    short_log: Path, short_run: Path, tmp_path: Path
) -> None:
    whole = trace_of(short_run)
    # The limit is first asked for in the outage, which is noticed 1.5 s after 24 s.
    other = traced(short_log, tmp_path / "run.mcap", {"gnss": {"outage_limit": 2.5}})
    inputs, outputs = parts(other, whole)
    assert inputs == len(whole)
    with LogReader(short_log) as reader:
        noticed_ns = reader.start_ns + round(25.3 * SECOND)
    # Within the outage no fix ends a step: the next one does.
    assert outputs == step_after(whole, noticed_ns)
    assert 0 < outputs < len(whole)


def test_what_no_stage_reads_is_not_traced(
    short_log: Path, short_run: Path, tmp_path: Path
) -> None:
    other = rewrite(
        short_log,
        tmp_path / "other.mcap",
        lambda rows: {**rows, TRUTH: rows[TRUTH].take(slice(5, None))},
    )
    trace = traced(other, tmp_path / "run.mcap")
    assert parts(trace, trace_of(short_run)) == (len(trace), len(trace))


def test_times_and_order_are_part_of_the_digest(short_log: Path, tmp_path: Path) -> None:
    """Rows with the same payloads but other times, and rows that changed places."""
    whole = traced(short_log, tmp_path / "whole.mcap", FULL)

    def later(rows):  # type: ignore[no-untyped-def]
        valid = rows[FIX].valid_time_ns.copy()
        valid[40] += 1
        return {**rows, FIX: dataclasses.replace(rows[FIX], valid_time_ns=valid)}

    def swapped(rows):  # type: ignore[no-untyped-def]
        order = np.arange(len(rows[IMU]))
        order[[500, 501]] = [501, 500]
        imu = rows[IMU]
        values = {
            name: column.take(order) if isinstance(column, Ragged) else column[order]
            for name, column in imu.values.items()
        }
        return {**rows, IMU: dataclasses.replace(imu, values=values, payloads=None)}

    for edit in (later, swapped):
        other = rewrite(short_log, tmp_path / "other.mcap", edit)
        inputs, _ = parts(traced(other, tmp_path / "run.mcap", FULL), whole)
        assert 0 < inputs < len(whole)


def test_an_idle_log_has_no_step(short_log: Path, tmp_path: Path) -> None:
    with LogReader(short_log) as reader:
        start_ns = reader.start_ns
    run_to_file(
        short_log,
        tmp_path / "run.mcap",
        {"imu": {"interval": 0.02}},
        start_ns=start_ns,
        end_ns=start_ns,
    )
    assert len(trace_of(tmp_path / "run.mcap")) == 0
