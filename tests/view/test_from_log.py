"""From a log on disk to a recording and a page."""

from __future__ import annotations

from pathlib import Path

import fake_run
import numpy as np
import pytest
from view_recordings import read_back, unix_like

from replay import channels as table
from replay.errors import LogError
from replay.log.columns import Columns
from replay.log.writer import LogWriter
from replay.view.recording import write_recording
from replay.view.report import write_report


@pytest.fixture(scope="module")
def run_log(
    channels: dict[str, Columns],
    metadata: dict[str, dict[str, str]],
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    path = tmp_path_factory.mktemp("log") / "drive.mcap"
    with LogWriter(path) as writer:
        for topic in channels:
            spec = table.find(topic)
            assert spec is not None
            writer.add_channel(topic, spec.message)
        writer.add_channel("/lidar/pose", "replay.Vector3")
        writer.add_channel("/gnss/base/fix", "replay.Vector3")  # not what the topic promises
        times = channels["/truth"].valid_time_ns[:7]
        strange = Columns.build(times, {axis: np.arange(7.0) for axis in "xyz"})
        odd = {"/lidar/pose": strange, "/gnss/base/fix": strange}
        for batch in fake_run.in_batches({**channels, **odd}):
            writer.write(batch)
        for name, values in metadata.items():
            writer.add_metadata(name, values)
    return path


def test_a_recording_of_a_log(run_log: Path, channels: dict[str, Columns], tmp_path: Path) -> None:
    out = tmp_path / "drive.rrd"
    write_recording(run_log, out)
    entities = read_back(out)
    for path, topic in (
        ("/imu/specific_force", "/imu/raw"),
        ("/world/run/tight/place", "/solution/tight"),
        ("/plots/accel_bias/z/tight/bound", "/filter/tight/state"),
    ):
        expected = unix_like(channels[topic].valid_time_ns)
        np.testing.assert_array_equal(entities[path].times_ns, expected)
    about = entities["/about"].static["TextDocument:text"].to_pylist()[0][0]
    assert "| /lidar/pose | 7 |" in about and "| /gnss/base/fix | 7 |" in about
    assert not any("lidar" in path or "base" in path for path in entities)
    assert list(tmp_path.iterdir()) == [out]


def test_a_page_of_a_log(run_log: Path, tmp_path: Path) -> None:
    out = tmp_path / "drive.html"
    write_report(run_log, out)
    text = out.read_text(encoding="utf-8")
    assert "<h1>drive</h1>" in text and "cut on purpose" in text
    write_report(run_log, tmp_path / "again.html", title="drive")
    assert (tmp_path / "again.html").read_bytes() == out.read_bytes()


def test_a_log_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(LogError):
        write_recording(tmp_path / "none.mcap", tmp_path / "none.rrd")
    assert list(tmp_path.iterdir()) == []
