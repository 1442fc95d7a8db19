"""Comparison of log files, and what a person sees of it."""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from google.protobuf import json_format
from rich.console import Console
from small_runs import (
    EVENTS,
    OBS,
    SOLUTION,
    STATE,
    TRACE,
    Channels,
    channels,
    complete,
    edited,
    manifest,
    run,
    without_rows,
)

from replay.channels import find, rank
from replay.diff import (
    Verdict,
    diff_logs,
    diff_runs,
    from_json,
    render_markdown,
    render_terminal,
    to_json,
)
from replay.diff.recording import record_runs, write_rrd
from replay.diff.result import ChannelStatus, DiffResult
from replay.errors import LogError
from replay.log.writer import LogWriter
from replay.schemas.replay_pb2 import Manifest

GOOD = channels()


def write(path: Path, made: Channels, told: Manifest | None = None) -> Path:
    with LogWriter(path) as log:
        for topic in sorted(made, key=lambda t: (rank(t), t)):
            spec = find(topic)
            assert spec is not None
            log.add_channel(topic, spec.message)
        log.write({topic: complete(topic, columns) for topic, columns in made.items()})
        if told is not None:
            text = json_format.MessageToJson(told, preserving_proto_field_name=True)
            log.add_metadata("replay.manifest", {"json": text})
    return path


def spoiled() -> Channels:
    bad = edited(GOOD, SOLUTION, "position_ecef_m", 4, 0.0, 1)
    bad = edited(bad, STATE, "velocity_ecef_m_s", 5, np.nan, 2)
    bad = without_rows(without_rows(bad, OBS, [6, 7]), EVENTS, [1])
    return edited(bad, TRACE, "output_digest", 9, np.uint64(3))


def in_memory(made: Channels = GOOD) -> DiffResult:
    a = run(made, "a.mcap", manifest=manifest(noise=1.0))
    return diff_runs(a, run(spoiled(), "b.mcap", manifest=manifest(noise=2.0)))


def test_logs_of_equal_rows_are_identical_whatever_their_bytes(tmp_path: Path) -> None:
    a = write(tmp_path / "a.mcap", GOOD, manifest(noise=1.0))
    b = write(tmp_path / "b.mcap", GOOD, manifest(noise=2.0))
    assert a.read_bytes() != b.read_bytes()
    result = diff_logs(a, b)
    assert result.verdict is Verdict.IDENTICAL
    assert result.a.manifest
    assert result.a.rows == sum(map(len, GOOD.values()))
    assert [change.key for change in result.configuration] == ["filter.noise"]


def test_logs_say_what_memory_says(tmp_path: Path) -> None:
    a = write(tmp_path / "a.mcap", GOOD, manifest(noise=1.0))
    b = write(tmp_path / "b.mcap", spoiled(), manifest(noise=2.0))
    from_files, from_memory = diff_logs(a, b), in_memory()
    assert from_files.verdict is Verdict.CHANGED
    assert from_files.culprit == from_memory.culprit
    assert from_files.first_change == from_memory.first_change
    for mine in from_files.channels:
        other = from_memory.channel(mine.topic)
        assert (mine.status, mine.rows) == (other.status, other.rows)
        assert [f for f in mine.fields if f.value + f.nan] == [
            f for f in other.fields if f.value + f.nan
        ]
    write_rrd(from_files, tmp_path / "diff.rrd")
    assert (tmp_path / "diff.rrd").stat().st_size > 10_000


def test_damaged_log_is_an_error(tmp_path: Path) -> None:
    a = write(tmp_path / "a.mcap", GOOD)
    broken = bytearray(a.read_bytes())
    broken[len(broken) // 2] ^= 0xFF
    (tmp_path / "b.mcap").write_bytes(broken)
    with pytest.raises(LogError):
        diff_logs(a, tmp_path / "b.mcap")


def test_terminal_and_markdown_name_verdict_culprit_and_fields() -> None:
    result = in_memory()
    console = Console(file=io.StringIO(), width=160)
    render_terminal(result, console)
    assert isinstance(console.file, io.StringIO)
    for text in (console.file.getvalue(), render_markdown(result)):
        for word in (
            "CHANGED",
            "stage 'filter' at step 4",
            "position_ecef_m.y",
            "velocity_ecef_m_s.z",
            "filter.noise",
            "G05 1C",
            "a row that only A has",
        ):
            assert word in text
    assert render_markdown(result).count("<details>") == render_markdown(result).count("</details>")
    same = diff_runs(run(GOOD), run(GOOD))
    assert "equal bit for bit" in render_markdown(same)


def test_json_keeps_its_keys() -> None:
    result = in_memory()
    assert from_json(to_json(result)) == result
    keys = to_json(result).decode()
    for key in ("verdict", "exit_code", "first_change", "culprit", "configuration", "channels"):
        assert f'\n  "{key}": ' in keys


def test_recording_holds_both_runs_and_their_difference(tmp_path: Path) -> None:
    path = tmp_path / "diff.rrd"
    bad = spoiled()
    result = diff_runs(run(GOOD), run(bad))
    record_runs(result, run(GOOD), run(bad), path)
    viewer = Path(sys.executable).with_name("rerun")
    said = subprocess.run(
        [viewer, "rrd", "print", path], capture_output=True, text=True, check=True
    ).stdout
    for entity in (
        "plan/A/track",
        "plan/B/now",
        f"channels{SOLUTION}/position_enu/difference/lines",
        f"channels{SOLUTION}/position_enu/values/B",
        f"channels{STATE}/velocity_ecef_m_s/difference/tolerance",
    ):
        assert entity in said
    assert "log_time" not in said


def test_recording_of_identical_runs_opens_too(tmp_path: Path) -> None:
    result = diff_runs(run(GOOD), run(GOOD))
    assert all(c.status is ChannelStatus.IDENTICAL for c in result.channels)
    record_runs(result, run(GOOD), run(GOOD), tmp_path / "same.rrd")
    assert (tmp_path / "same.rrd").stat().st_size > 0
