"""A recorded truth flown again: the motion comes back, and its sensors are exact to it."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

from replay import channels
from replay.errors import ConfigurationError, DataError, MissingChannelError
from replay.importers import import_log
from replay.kernels.earth import EARTH_RATE_RAD_S, gravity
from replay.kernels.splined_motion import DEGREE, fit_spline
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.log.writer import LogWriter
from replay.simulate import load_scenario, make_channels, read_scenario, simulate
from replay.simulate.motion import Moved, move

ROOT = Path(__file__).parents[2]
DRIVE = ROOT / "recordings" / "drive" / "scenario.toml"
SPECS = ROOT / "recordings" / "specs"
TRUTH = channels.TRUTH.topic
ARCSECOND = math.pi / 648000.0
MM = 1e-3
CM = 1e-2


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("recorded")
    simulate(DRIVE, path / "drive.mcap")
    return path


def truth_of(path: Path) -> Columns:
    with LogReader(path) as reader:
        return reader.read(TRUTH)


def again(folder: Path, log: str = "drive.mcap", **sections: Any) -> Moved:
    table = {"trajectory": {"log": log, **sections.pop("trajectory", {})}, **sections}
    return move(read_scenario(table, folder))


def rewrite(source: Path, out: Path, change: Any) -> None:
    """A log of nothing but truth, whose columns a function has changed."""
    truth = truth_of(source)
    values = {name: np.array(column) for name, column in truth.values.items()}
    valid, values = change(truth.valid_time_ns, values)
    with LogWriter(out) as writer:
        writer.add_channel(TRUTH, "replay.Truth")
        writer.write({TRUTH: Columns.build(valid, values)})


def differences(moved: Moved, truth: Columns) -> tuple[np.ndarray[Any, Any], ...]:
    """Distances (m) and angles (rad) of a motion from the rows of truth in its span."""
    elapsed = (truth.valid_time_ns - moved.start_ns) * 1e-9
    end = len(moved.trajectory.rates) * moved.trajectory.interval_s
    inside = (elapsed >= 0.0) & (elapsed <= end)
    poses = moved.trajectory.poses(elapsed[inside])
    apart = np.linalg.norm(poses["r"] - truth["position_ecef_m"][inside], axis=1)
    angles = truth["attitude_rad"][inside][:, ::-1]
    body = Rotation.from_euler("ZYX", poses["attitude"][:, ::-1])
    return apart, (body.inv() * Rotation.from_euler("ZYX", angles)).magnitude()


@pytest.mark.parametrize(
    ("spacing", "distance", "angle"),
    [("0.2 s", 0.1 * MM, 20.0 * ARCSECOND), ("0.1 s", 0.001 * MM, 1.5 * ARCSECOND)],
)
def test_the_trajectory_comes_back(folder, spacing, distance, angle):
    moved = again(folder, trajectory={"spacing": spacing})
    apart, turned = differences(moved, truth_of(folder / "drive.mcap"))
    assert len(apart) > 14_000
    assert apart.max() < distance
    assert turned.max() < angle


def test_other_sensors_read_what_those_of_the_first_flight_would(folder):
    spaced = {"spacing": "0.1 s"}
    moved = again(folder, trajectory=spaced, imu={"rate": 50.0, "grade": "perfect"})
    first = move(load_scenario(DRIVE, [{"imu": {"rate": 50.0}}]))
    assert moved.start_ns == first.start_ns
    count = min(len(moved.trajectory.rates), len(first.trajectory.rates))
    off = moved.trajectory.forces[:count] - first.trajectory.forces[:count]
    assert np.abs(off).max() < 2e-3
    off = moved.trajectory.rates[:count] - first.trajectory.rates[:count]
    assert np.abs(off).max() < 2e-4


def test_forces_and_rates_are_derivatives_of_the_curve(folder):
    """Whatever the rows are, the sensors are exact to the motion that is the new truth."""
    moved = again(folder, imu={"rate": 200.0}).trajectory
    h = moved.interval_s
    middle = (np.arange(2000, len(moved.rates), 61) + 0.5) * h
    rows = np.rint(middle / h - 0.5).astype(int)
    pose = moved.poses(middle)
    e = 0.25 * h
    change = (moved.poses(middle + e)["v"] - moved.poses(middle - e)["v"]) / (2.0 * e)
    down = np.array([gravity(*r) for r in pose["r"]])
    coriolis = np.cross([0.0, 0.0, 2.0 * EARTH_RATE_RAD_S], pose["v"])
    force = np.einsum("nji,nj->ni", pose["C"], change - down + coriolis)
    np.testing.assert_allclose(moved.forces[rows], force, atol=5e-4)
    ends = [Rotation.from_matrix(moved.poses(middle + s * h)["C"]) for s in (-0.5, 0.5)]
    step = (ends[0].inv() * ends[1]).as_rotvec() / h
    earth = Rotation.from_matrix(pose["C"]).inv().apply([0.0, 0.0, EARTH_RATE_RAD_S])
    np.testing.assert_allclose(moved.rates[rows], step + earth, atol=2e-6)
    speed = (moved.poses(middle + e)["r"] - moved.poses(middle - e)["r"]) / (2.0 * e)
    np.testing.assert_allclose(pose["v"], speed, atol=2e-5)
    np.testing.assert_allclose(
        np.linalg.norm(pose["v_enu"], axis=1), np.linalg.norm(pose["v"], axis=1), atol=1e-12
    )


def test_truth_at_a_lever_arm_is_that_of_the_imu(folder):
    lever = np.array([1.2, -0.4, -1.5])
    source = folder / "drive.mcap"
    first = move(load_scenario(DRIVE))

    def at_the_lever(valid, values):
        elapsed = (valid - first.start_ns) * 1e-9
        C = first.trajectory.poses(elapsed)["C"]
        values["position_ecef_m"] = values["position_ecef_m"] + C @ lever
        values["lever_arm_body_m"] = np.tile(lever, (len(valid), 1))
        return valid, values

    rewrite(source, folder / "lever.mcap", at_the_lever)
    moved = again(folder, "lever.mcap", trajectory={"spacing": "0.1 s"})
    apart, turned = differences(moved, truth_of(source))
    assert apart.max() < 0.01 * MM
    assert turned.max() < 1.5 * ARCSECOND


def test_the_log_of_it_has_its_time_its_truth_and_what_it_came_from(folder, tmp_path):
    scenario = folder / "again.toml"
    scenario.write_text(
        'name = "again"\n[trajectory]\nlog = "drive.mcap"\nbegin = "10.3 s"\nend = "60 s"\n'
        '[imu]\ngrade = "tactical"\n[truth]\nrate = "10 Hz"\n'
    )
    results = [simulate(scenario, tmp_path / f"{i}.mcap") for i in range(2)]
    assert results[0].outputs == results[1].outputs
    truth, source = truth_of(results[0].path), truth_of(folder / "drive.mcap")
    # On a whole second of GPS time.
    assert truth.valid_time_ns[0] == source.valid_time_ns[0] + 11 * 10**9
    assert results[0].duration_s == pytest.approx(49.0, abs=0.02)
    at = np.searchsorted(source.valid_time_ns, truth.valid_time_ns)
    off = truth["position_ecef_m"] - source["position_ecef_m"][at]
    assert np.abs(off).max() < 0.1 * MM
    with LogReader(results[0].path) as reader:
        manifest = reader.metadata["replay.manifest"]["json"]
        with LogReader(folder / "drive.mcap") as original:
            assert original.digests()[TRUTH].sha256 in manifest
    assert "trajectory through 2486 rows" in manifest
    assert str(folder) not in manifest


def test_canonical_text_reads_back_equal(folder):
    scenario = read_scenario({"trajectory": {"log": "drive.mcap", "end": "20 s"}}, folder)
    assert read_scenario(tomllib.loads(scenario.to_toml())) == scenario


def test_the_spline_is_scipys_least_squares_fit():
    rng = np.random.default_rng(3)
    times = np.sort(rng.uniform(0.0, 10.0, 400))
    rows = rng.normal(size=(400, 7)) + 1e4
    count = 20
    coefficients = np.empty((count + DEGREE, 7))
    left = rows.copy()
    fit_spline(times, left, 0.5, 1e-9, coefficients)
    knots = (np.arange(count + 2 * DEGREE + 1) - DEGREE) * 0.5
    design = BSpline.design_matrix(times, knots, DEGREE).toarray()
    expected = np.linalg.lstsq(design, rows, rcond=None)[0]
    np.testing.assert_allclose(coefficients, expected, rtol=1e-9)
    np.testing.assert_allclose(left, rows - design @ expected, atol=1e-7)


def test_short_holes_are_bridged_and_long_ones_refused(folder):
    source = folder / "drive.mcap"

    def without(begin_s, end_s):
        def change(valid, values):
            elapsed = (valid - valid[0]) * 1e-9
            keep = (elapsed < begin_s) | (elapsed >= end_s)
            return valid[keep], {name: column[keep] for name, column in values.items()}

        return change

    rewrite(source, folder / "short.mcap", without(50.0, 50.9))
    apart, _ = differences(again(folder, "short.mcap"), truth_of(source))
    assert apart.max() < 10.0 * CM
    rewrite(source, folder / "long.mcap", without(50.0, 55.0))
    with pytest.raises(DataError, match=r"gap of 5.02 s from 49.98 s") as caught:
        again(folder, "long.mcap")
    assert "trajectory.end" in caught.value.mend


def test_truth_that_does_not_serve_is_refused(folder):
    source = folder / "drive.mcap"

    def no_attitude(valid, values):
        del values["attitude_rad"]
        return valid, values

    rewrite(source, folder / "track.mcap", no_attitude)
    with pytest.raises(DataError, match="no attitude"):
        again(folder, "track.mcap")

    def jump(valid, values):
        values["position_ecef_m"][3000:] += 5.0
        return valid, values

    rewrite(source, folder / "jump.mcap", jump)
    with pytest.raises(DataError, match=r"jumps: .* at (59|60) s") as caught:
        again(folder, "jump.mcap")
    assert "trajectory.spacing" in caught.value.mend

    with LogWriter(folder / "none.mcap") as writer:
        writer.add_channel(channels.IMU.topic, "replay.ImuSample")
    with pytest.raises(MissingChannelError, match="no /truth"):
        again(folder, "none.mcap")


@pytest.mark.parametrize(
    ("table", "what"),
    [
        ({"trajectory": {"log": "x", "begin": 5.0, "end": 4.0}}, "trajectory.end"),
        ({"trajectory": {"log": "x"}, "segments": [{"kind": "hold", "duration": 1.0}]}, "both"),
        ({"trajectory": {"log": "x"}, "start": {"height": 3.0}}, "start has no meaning"),
        ({"trajectory": {"log": "x"}, "repeat": 2}, "repeat has no meaning"),
        ({"trajectory": {"end": 4.0}}, "no log"),
    ],
)
def test_settings_that_contradict_are_refused(table, what):
    with pytest.raises(ConfigurationError, match=what):
        read_scenario(table)


def test_a_span_without_rows_and_knots_too_close_are_refused(folder):
    with pytest.raises(ConfigurationError, match="span holds 0 rows"):
        again(folder, trajectory={"begin": "1 h"})
    with pytest.raises(ConfigurationError, match=r"rows come every 0.02 s"):
        again(folder, trajectory={"spacing": "5 ms"})


def test_a_real_drive_flies_again(shared_data: Path, tmp_path: Path) -> None:
    name = "urban-short-turn-loop-nominal-001"
    data = shared_data / "drives" / name
    if not data.is_dir():
        pytest.skip(f"the drive is not here: {data}")
    import_log(SPECS / f"{name}.toml", data, tmp_path / "real.mcap")
    table = {"trajectory": {"log": "real.mcap", "spacing": "0.5 s"}, "imu": {"grade": "tactical"}}
    scenario = read_scenario(table, tmp_path)
    truth = truth_of(tmp_path / "real.mcap")
    known = np.isfinite(truth["attitude_rad"]).all(axis=1)
    moved = move(scenario)
    apart, turned = differences(moved, truth.take(np.flatnonzero(known)))
    # The receiver's solution steps by decimetres at its fixes: a smooth curve cannot follow.
    assert math.sqrt(np.mean(apart**2)) < 5.0 * CM
    assert math.sqrt(np.mean(turned**2)) < 0.2 * math.pi / 180.0
    rows = make_channels(scenario)
    assert rows[channels.IMU.topic].valid_time_ns[0] > truth.valid_time_ns[known][0]
    g = np.linalg.norm(moved.trajectory.forces.mean(axis=0))
    assert g == pytest.approx(9.8, abs=0.05)


def test_a_real_track_without_attitude_is_refused(shared_data: Path, tmp_path: Path) -> None:
    name = "boulder-drive-2025-189"
    data = shared_data / name
    if not data.is_dir():
        pytest.skip(f"the drive is not here: {data}")
    import_log(SPECS / f"{name}.toml", data, tmp_path / "real.mcap")
    with pytest.raises(DataError, match="no attitude"):
        again(tmp_path, "real.mcap")
