"""The tool that finds a sensor's time offset, on a drive whose offset is known."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path

import numpy as np
import pymap3d
import pytest

from replay import channels, time
from replay.log.columns import Columns
from replay.log.writer import LogWriter

TOOL = Path(__file__).resolve().parents[2] / "tools" / "estimate_time_offset.py"
START = time.from_week(2130, 364514.0)
OFFSET_S = 0.137
AHEAD_M = 1.0


def write_drive(path: Path) -> None:
    """400 s of turns and changing speed; the antenna rides before the axle, the IMU is early."""
    t = np.arange(0.0, 400.0, 0.02)
    speed = 11.0 + 4.0 * np.sin(0.31 * t) + 1.5 * np.sin(0.83 * t + 1.0)
    gain = 4.0 * 0.31 * np.cos(0.31 * t) + 1.5 * 0.83 * np.cos(0.83 * t + 1.0)
    rate = 0.2 * np.sin(0.23 * t) + 0.15 * np.sin(0.71 * t + 0.4)
    heading = -0.2 / 0.23 * np.cos(0.23 * t) - 0.15 / 0.71 * np.cos(0.71 * t + 0.4)
    rng = np.random.default_rng(11)
    moves = np.column_stack([np.sin(heading) * speed, np.cos(heading) * speed])
    axle = np.vstack([[0.0, 0.0], np.cumsum(0.5 * (moves[1:] + moves[:-1]) * 0.02, axis=0)])
    antenna = axle + AHEAD_M * np.column_stack([np.sin(heading), np.cos(heading)])
    antenna = antenna[::10] + rng.normal(scale=0.003, size=(len(t[::10]), 2))
    ecef = np.stack(
        pymap3d.enu2ecef(antenna[:, 0], antenna[:, 1], 0 * antenna[:, 0], 35.7, 139.8, 60.0), 1
    )
    force = np.column_stack([gain, speed * rate, np.full(len(t), -9.8)])
    turning = np.column_stack([0 * t, 0 * t, rate])
    force += rng.normal(scale=0.02, size=force.shape)
    turning += rng.normal(scale=0.002, size=turning.shape) + 0.003
    stamps = START + np.rint((t - OFFSET_S) * 1e9).astype(np.int64)
    # A sample is the mean since the one before: its middle is half an interval earlier.
    stamps += 10_000_000
    truth = START + np.rint(t[::10] * 1e9).astype(np.int64)
    count = len(truth)
    batch = {
        "/imu/raw": Columns.build(
            stamps, {"angular_rate_body_rad_s": turning, "specific_force_body_m_s2": force}
        ),
        "/truth": Columns.build(
            truth,
            {
                "position_ecef_m": ecef,
                "lever_arm_body_m": np.zeros((count, 3)),
                "quality": np.full(count, 6, dtype=np.int64),
            },
        ),
    }
    with LogWriter(path) as writer:
        writer.add_channel("/imu/raw", channels.IMU.message)
        writer.add_channel("/truth", channels.TRUTH.message)
        writer.write(batch)


def test_a_known_offset_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_drive(tmp_path / "drive.mcap")
    spec = importlib.util.spec_from_file_location("estimate_time_offset", TOOL)
    assert spec is not None and spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, tool)
    spec.loader.exec_module(tool)
    monkeypatch.setattr(sys, "argv", ["tool", str(tmp_path / "drive.mcap")])
    tool.main()
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0].strip() for line in lines] == ["turning", "speeding up"]
    for line in lines:
        found = re.search(r": ([-+][\d.]+) s, standard deviation ([\d.]+) s", line)
        assert found is not None
        offset, sigma = float(found[1]), float(found[2])
        # Half a sample is what the tool promises.
        assert sigma < 0.01 and abs(offset - OFFSET_S) < 0.01, line
    turning = re.search(r"coefficients ([-\d.]+), ([-\d.]+)", lines[0])
    assert turning is not None
    assert abs(float(turning[1]) - 1.0) < 0.02 and abs(float(turning[2]) - AHEAD_M) < 0.2
