"""The commands `transform` and `sweep` as a person types them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from replay.engine.manifest import read_manifest
from replay.log.reader import LogReader
from tests.batch.test_sweep import DRIVE, SWEEP
from tests.cli import test_commands
from tests.cli.test_commands import Command, complaint
from tests.engine.drives import FIX, IMU, SECOND

replay = test_commands.replay


def test_transform(replay: Command, short_log: Path, tmp_path: Path) -> None:
    target, again = tmp_path / "out.mcap", tmp_path / "again.mcap"
    words = ["--imu-rate", "25", "--imu-method", "decimate", "--outage", "12,2"]
    words += ["--noise", "/imu/raw.angular_rate=0.1 deg/s", "--seed", "4"]
    words += ["--time-offset", f"{FIX}=20 ms"]
    answer = replay("transform", short_log, "-o", target, *words)
    assert answer.code == 0, answer.err
    assert "decimated to" in answer.out
    assert f"8 rows left out of {FIX}" in answer.out
    with LogReader(target) as reader:
        manifest = read_manifest(reader.metadata, "out")
        fixes = reader.read(FIX).valid_time_ns
        steps = np.diff(reader.read(IMU).valid_time_ns)
    with LogReader(short_log) as reader:
        begin = reader.start_ns + 12 * SECOND + 20_000_000
    assert set(steps[:-1].tolist()) == {SECOND // 25}
    assert not ((fixes >= begin) & (fixes < begin + 2 * SECOND)).any()
    settings = tmp_path / "settings.toml"
    settings.write_text(manifest.configuration)
    answer = replay("transform", short_log, "-o", again, "--config", settings)
    assert answer.code == 0, answer.err
    assert again.read_bytes() == target.read_bytes()


def test_transform_complains(replay: Command, short_log: Path, tmp_path: Path) -> None:
    target = tmp_path / "out.mcap"

    def of(*words: str) -> str:
        answer = replay("transform", short_log, "-o", target, *words)
        complaint(answer, 2)
        return " ".join(answer.err.split())

    assert "does nothing" in of()
    assert "whole number of times" in of("--imu-rate", "30")
    assert "no observations" in of("--remove-systems", "R,C")
    assert "known: angular_rate" in of("--noise", "/imu/raw.rate=1")
    settings = tmp_path / "settings.toml"
    settings.write_text("imu_speed = 20.0\n")
    assert "did you mean imu_" in of("--config", str(settings))
    assert not target.exists()


def test_sweep(replay: Command, tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text(DRIVE)
    file, folder = tmp_path / "sweep.toml", tmp_path / "out"
    file.write_text(SWEEP.replace('["", "25,5"]', '["", "500,5"]'))
    answer = replay("sweep", file, "-o", folder, "--jobs", "1")
    assert answer.code == 3
    assert "4 cases, 0 of them have a row" in answer.out
    assert answer.err.count("no GNSS row") == 2
    assert "loss: 2 cases failed" in answer.err
    complaint(replay("sweep", file, "-o", folder), 2, mend="--resume")
    file.write_text(SWEEP)
    answer = replay("sweep", file, "-o", folder, "--jobs", "1", "--resume")
    assert answer.code == 0, answer.err
    assert "4 cases, 2 of them have a row" in answer.out
    assert "2 rows belong to no case" in answer.err
    answer = replay("sweep", "--table", folder)
    assert answer.code == 0, answer.err
    assert "imu_rate" in answer.out and "25,5" in answer.out
    complaint(replay("sweep", file), 2)
    complaint(replay("sweep", file, "--table", folder), 2)
