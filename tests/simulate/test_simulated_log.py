"""The log: the same bytes from the same scenario, exact truth, outages, what it brings along."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from replay import channels, time
from replay.configuration import build
from replay.log.reader import LogReader
from replay.simulate import load_scenario, make_channels, read_scenario, simulate
from replay.simulate.defaults import defaults_toml, fitting_defaults
from replay.simulate.imu import IMU_GRADES
from replay.stages.loose_config import LooseConfig

DRIVE = Path(__file__).parents[2] / "recordings" / "drive" / "scenario.toml"
FIX = channels.GNSS_FIX.at(receiver="rover")
SHORT = {
    "seed": 5,
    "segments": [
        {"kind": "hold", "duration": 3.0},
        {"kind": "speed", "to": 10.0},
        {"kind": "turn", "angle": "60 deg", "radius": 20.0},
        {"kind": "straight", "duration": 5.0},
    ],
}
SHA = """
import sys
from pathlib import Path
from replay.simulate import simulate
result = simulate(Path(sys.argv[1]), Path(sys.argv[2]))
print(" ".join(result.outputs[topic].sha256 for topic in sorted(result.outputs)))
"""


def digests_elsewhere(out: Path, **environment: str) -> str:
    return subprocess.run(
        [sys.executable, "-c", SHA, str(DRIVE), str(out)],
        env={**os.environ, **environment},
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()


def digests_here(out: Path) -> str:
    outputs = simulate(DRIVE, out).outputs
    return " ".join(outputs[topic].sha256 for topic in sorted(outputs))


def test_another_process_writes_the_same_bytes(tmp_path):
    here = digests_here(tmp_path / "a.mcap")
    there = digests_elsewhere(tmp_path / "b.mcap", PYTHONHASHSEED="17", TZ="Asia/Tokyo")
    assert here == there
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


@pytest.mark.heavy
def test_a_lesser_processor_writes_the_same_bytes(tmp_path):
    """Neither numba nor numpy may use what only some processors have."""
    there = digests_elsewhere(
        tmp_path / "b.mcap",
        NUMBA_CPU_NAME="generic",
        NUMBA_CPU_FEATURES="",
        NPY_DISABLE_CPU_FEATURES=disabled_features(),
    )
    assert digests_here(tmp_path / "a.mcap") == there


def disabled_features() -> str:
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    return " ".join(name for name in __cpu_dispatch__ if __cpu_features__.get(name))


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    path = tmp_path_factory.mktemp("simulated") / "drive.mcap"
    return simulate(DRIVE, path)


def test_the_drive_is_what_it_says(drive):
    scenario = load_scenario(DRIVE)
    with LogReader(drive.path) as reader:
        imu, fixes = reader.read(channels.IMU.topic), reader.read(FIX)
        truth = reader.read(channels.TRUTH.topic)
    assert 280.0 < drive.duration_s < 330.0
    assert len(imu) == round(drive.duration_s * 100)
    np.testing.assert_array_equal(np.diff(imu.valid_time_ns), 10_000_000)
    assert np.unique(np.diff(truth.valid_time_ns)) == [20_000_000]
    elapsed = fixes.valid_time_ns - time.parse_calendar(scenario.settings.start.time)
    ((begin, end),) = scenario.settings.gnss.outages
    assert not ((elapsed >= begin * 1e9) & (elapsed < end * 1e9)).any()
    assert end * 1e9 in elapsed
    assert np.diff(elapsed).max() == (end - begin + 0.25) * 1e9
    speed = np.linalg.norm(truth["velocity_enu_m_s"], axis=1)
    assert speed[: 10 * 50].max() < 1e-6
    assert 14.0 < speed.max() < 16.0
    assert (truth["lever_arm_body_m"] == 0.0).all()


def test_the_manifest_tells_how_to_make_it_again(drive):
    with LogReader(drive.path) as reader:
        manifest = json.loads(reader.metadata["replay.manifest"]["json"])
    assert manifest["command"] == "simulate"
    again = read_scenario(tomllib.loads(manifest["configuration"]))
    assert again == load_scenario(DRIVE)
    listed = {item["topic"]: item["sha256"] for item in manifest["outputs"]}
    assert listed == {topic: digest.sha256 for topic, digest in drive.outputs.items()}


@pytest.mark.parametrize("grade", sorted(IMU_GRADES))
def test_defaults_are_settings_of_the_pipeline(grade):
    settings = read_scenario({**SHORT, "imu": {"grade": grade}}).settings
    table = tomllib.loads(defaults_toml(settings))
    config = build(LooseConfig, [table])
    wanted = fitting_defaults(settings)
    assert config.filter.gyro_noise == wanted["filter"]["gyro_noise"]
    assert config.stops.zero_velocity
    assert min(config.filter.gyro_noise) > 0.0


def short_with_errors(**errors):
    imu = {"grade": "perfect", "errors": errors}
    return make_channels(read_scenario({**SHORT, "imu": imu}))


def test_truth_holds_the_biases_of_its_sample():
    rows = short_with_errors(gyro_bias=0.01)
    imu, truth = rows[channels.IMU.topic], rows[channels.TRUTH.topic]
    rest = imu["angular_rate_body_rad_s"][:200].mean(axis=0)
    np.testing.assert_allclose(truth["gyro_bias_body_rad_s"][0], rest, atol=1e-4)
    drifting = short_with_errors(accel_drift=0.1, accel_drift_tau=0.5)
    force = drifting[channels.IMU.topic]["specific_force_body_m_s2"]
    bias = drifting[channels.TRUTH.topic]["accel_bias_body_m_s2"]
    # At rest the specific force is gravity and the bias; truth runs at half the rate.
    np.testing.assert_allclose(bias[1:100] - bias[1], force[1:199:2] - force[1], atol=1e-9)


def test_an_outage_takes_fixes_away_and_changes_no_other():
    whole = make_channels(read_scenario(SHORT))[FIX]
    cut = make_channels(read_scenario({**SHORT, "gnss": {"outages": [[4.0, 6.0]]}}))[FIX]
    kept = np.isin(whole.valid_time_ns, cut.valid_time_ns)
    assert np.count_nonzero(~kept) == 8
    np.testing.assert_array_equal(whole["position_ecef_m"][kept], cut["position_ecef_m"])


def test_latency_delays_availability_not_validity():
    fixes = make_channels(read_scenario({**SHORT, "gnss": {"latency": "200 ms"}}))[FIX]
    np.testing.assert_array_equal(fixes.log_time_ns - fixes.valid_time_ns, 200_000_000)


def test_a_receiver_without_velocity_writes_none():
    fixes = make_channels(read_scenario({**SHORT, "gnss": {"velocity": False}}))[FIX]
    assert "velocity_ecef_m_s" not in fixes.values


def test_perfect_fixes_are_truth_at_the_lever_arm():
    rows = make_channels(
        read_scenario({**SHORT, "gnss": {"grade": "perfect", "lever_arm": [0.0, 0.0, -2.0]}})
    )
    fixes, truth = rows[FIX], rows[channels.TRUTH.topic]
    at = np.searchsorted(truth.valid_time_ns, fixes.valid_time_ns)
    exact = truth.valid_time_ns[np.minimum(at, len(truth) - 1)] == fixes.valid_time_ns
    off = fixes["position_ecef_m"][exact] - truth["position_ecef_m"][at[exact]]
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), 2.0, atol=1e-8)


def test_repeating_lengthens_and_leaves_the_beginning_alone():
    once = make_channels(read_scenario(SHORT))[channels.TRUTH.topic]
    segments = [*SHORT["segments"], {"kind": "speed", "to": 0.0}]
    thrice = make_channels(read_scenario({**SHORT, "segments": segments, "repeat": 3}))
    truth = thrice[channels.TRUTH.topic]
    assert len(truth) > 3 * len(once)
    np.testing.assert_array_equal(
        truth["position_ecef_m"][: len(once) - 1], once["position_ecef_m"][:-1]
    )
