"""Scenarios: units, grades, canonical text, and errors that say how to mend them."""

from __future__ import annotations

import copy
import math
import tomllib
from pathlib import Path

import pytest

from replay.errors import ConfigurationError, UsageError
from replay.simulate.scenario import load_scenario, read_scenario

DRIVE = Path(__file__).parents[2] / "recordings" / "drive" / "scenario.toml"
LEAST = {"segments": [{"kind": "hold", "duration": "2 s"}]}


def with_(**sections):
    return {**copy.deepcopy(LEAST), **sections}


def test_quantities_become_si():
    settings = read_scenario(
        with_(
            start={"latitude": "52 deg"},
            imu={"rate": "0.2 kHz", "errors": {"gyro_bias": "36 deg/h", "accel_bias": "1 mg"}},
            gnss={"lever_arm": ["10 cm", 0.0, "-1 m"]},
        )
    ).settings
    assert settings.start.latitude == pytest.approx(math.radians(52.0))
    assert settings.imu.rate == 200.0
    assert settings.imu.errors.gyro_bias == pytest.approx(math.radians(0.01))
    assert settings.imu.errors.accel_bias == pytest.approx(9.80665e-3)
    assert settings.gnss.lever_arm == (0.1, 0.0, -1.0)


def test_errors_go_over_those_of_the_grade():
    plain = read_scenario(with_(imu={"grade": "tactical"})).settings.imu.errors
    over = read_scenario(
        with_(imu={"grade": "tactical", "errors": {"gyro_bias": 0.0}})
    ).settings.imu.errors
    assert plain.gyro_bias > 0.0
    assert over.gyro_bias == 0.0
    assert over.gyro_noise == plain.gyro_noise


def test_canonical_text_reads_back_equal():
    scenario = load_scenario(DRIVE)
    text = scenario.to_toml()
    again = read_scenario(tomllib.loads(text))
    assert again == scenario
    assert again.to_toml() == text


def test_tables_go_over_the_file():
    scenario = load_scenario(DRIVE, [{"repeat": 3, "imu": {"rate": 50.0}}])
    assert scenario.settings.repeat == 3
    assert scenario.settings.imu.rate == 50.0
    assert scenario.settings.imu.grade == load_scenario(DRIVE).settings.imu.grade


@pytest.mark.parametrize(
    ("table", "what", "mend"),
    [
        (with_(sede=1), "sede", "seed"),
        (with_(imu={"rat": 1.0}), "imu.rat", "imu.rate"),
        (with_(imu={"grade": "tactica"}), "tactica", "'tactical'"),
        (with_(imu={"errors": {"gyro_nose": 1.0}}), "gyro_nose", "gyro_noise"),
        (with_(imu={"errors": {"gyro_noise": "5 m"}}), "gyro_noise", "deg/sqrt(h)"),
        (with_(imu={"rate": 1.0}), "imu.rate", "10 Hz"),
        (with_(gnss={"outages": [[20.0, 10.0]]}), "outages", "begin"),
        (with_(gnss={"lever_arm": [1.0]}), "lever_arm", "forward"),
        (with_(gnss={"receiver": "a/b"}), "receiver", "slash"),
        (with_(start={"latitude": 52.0}), "latitude", "deg"),
        (with_(start={"time": "noon"}), "start.time", "GPS time"),
        (with_(repeat=0), "repeat", "1"),
        ({"name": "empty"}, "segments", "hold"),
        ({"segments": [{"kind": "jump"}]}, "jump", "straight"),
        ({"segments": [{"kind": "hold", "duratio": 1.0}]}, "duratio", "duration"),
        ({"segments": [{"kind": "hold"}]}, "duration", ""),
    ],
)
def test_what_is_off_is_named_with_its_mend(table, what, mend):
    with pytest.raises(ConfigurationError) as caught:
        read_scenario(table)
    assert what in caught.value.what
    assert mend in caught.value.mend


def test_files_that_are_none_are_refused(tmp_path):
    with pytest.raises(UsageError, match="cannot be read"):
        load_scenario(tmp_path / "nothing.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("a = ")
    with pytest.raises(ConfigurationError, match="no TOML") as caught:
        load_scenario(broken)
    assert str(broken) in caught.value.where
