"""Whole imports: the small recording by closed forms, the real ones by independent readings."""

from __future__ import annotations

import csv
import gzip
import itertools
import json
import math
import shutil
import struct
import tomllib
from pathlib import Path

import numpy as np
import pymap3d
import pytest
import small_recording
from scipy.spatial.transform import Rotation

from replay import time
from replay.errors import ExitCode
from replay.importers import ImportResult, import_log, load_spec
from replay.log.columns import Columns
from replay.log.reader import LogReader

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
SPECS = ROOT / "recordings" / "specs"
BOULDER = "boulder-drive-2025-189"
URBAN = "urban-short-turn-loop-nominal-001"
PARKING = "covered-parking-urban-drive-gnss-outage-001"
FOLDERS = {
    BOULDER: DATA / BOULDER,
    URBAN: DATA / "drives" / URBAN,
    PARKING: DATA / "drives" / PARKING,
}
TOPICS = ("/gnss/rover/fix", "/imu/raw", "/truth")


def test_the_small_recording_by_closed_forms(tmp_path: Path) -> None:
    steps: list[str] = []
    spec, out = small_recording.write(tmp_path), tmp_path / "out.mcap"
    result = import_log(spec, tmp_path, out, strict=True, progress=steps.append)
    assert result.exit_code is ExitCode.OK and not result.losses
    assert result.rows == {"/imu/raw": 200, "/gnss/rover/fix": 7}
    assert steps[0] == "imu: reading imu.csv" and steps[-1] == f"writing {out}"
    with LogReader(out) as log:
        imu, fix, metadata = log.read("/imu/raw"), log.read("/gnss/rover/fix"), log.metadata
        assert log.digests() == result.digests

    start = time.parse_calendar("2025-07-08T19:34:21.25")  # of the time tag
    np.testing.assert_array_equal(imu.valid_time_ns, start + 10_000_000 * np.arange(200))
    i = np.arange(200)
    rate = np.radians(np.stack([0.5 * i, np.full(200, 1.0), np.full(200, -90.0)], axis=1))
    np.testing.assert_allclose(imu["angular_rate_body_rad_s"], rate, atol=1e-14)
    force = 9.80665 * np.stack([np.full(200, 0.1), -0.001 * i, np.full(200, -1.0)], axis=1)
    np.testing.assert_allclose(imu["specific_force_body_m_s2"], force, atol=1e-14)

    seconds = np.arange(7) * time.NS_PER_S
    np.testing.assert_array_equal(fix.valid_time_ns, start + seconds)
    np.testing.assert_array_equal(fix.log_time_ns, start + seconds + 80_000_000)
    lon = -105.1 - 0.01 * np.arange(1, 8)
    expected = np.stack(pymap3d.geodetic2ecef(np.full(7, 40.1), lon, 1600.5), axis=1)
    np.testing.assert_allclose(fix["position_ecef_m"], expected, atol=3e-9)
    # RTKLIB's sdne = -0.004 means a covariance of -0.004^2 of north and east, and so on.
    triangle = [0.01**2, -(0.004**2), 0.005**2, 0.02**2, -(0.006**2), 0.03**2]
    np.testing.assert_allclose(fix["position_covariance_enu_m2"], [triangle] * 7, rtol=1e-14)
    triangle = [0.06**2, 0.001**2, -(0.002**2), 0.05**2, 0.003**2, 0.07**2]
    np.testing.assert_allclose(fix["velocity_covariance_enu_m2_s2"], [triangle] * 7, rtol=1e-14)
    velocity = np.stack(pymap3d.enu2ecefv(2.0, 1.0, -0.5, np.full(7, 40.1), lon), axis=1)
    np.testing.assert_allclose(fix["velocity_ecef_m_s"], velocity, atol=1e-13)
    np.testing.assert_allclose(fix["antenna_lever_arm_body_m"], [[0.1, -0.05, -0.65]] * 7)
    assert fix["quality"].tolist() == [5, 6, 5, 6, 5, 6, 5]
    assert fix["satellite_count"].tolist() == [21] * 7
    assert not fix.is_present("ambiguity_ratio").any()

    manifest = json.loads(metadata["replay.manifest"]["json"])
    assert manifest["command"] == "import"
    assert {o["topic"]: o["sha256"] for o in manifest["outputs"]} == {
        topic: digest.sha256 for topic, digest in result.digests.items()
    }
    assert any("scale 1.250000000" in note for note in manifest["notes"])
    assert str(tmp_path) not in metadata["replay.manifest"]["json"]
    defaults = tomllib.loads(metadata["replay.defaults"]["toml"])
    assert defaults == tomllib.loads(small_recording.SPEC)["defaults"]
    assert tomllib.loads(manifest["configuration"]) == tomllib.loads(small_recording.SPEC)
    source = json.loads(metadata["replay.sources"]["imu.csv"])
    assert source["bytes"] == (tmp_path / "imu.csv").stat().st_size


def test_a_second_import_from_elsewhere_gives_the_same_bytes(tmp_path: Path) -> None:
    first = tmp_path / "first"
    first.mkdir()
    spec = small_recording.write(first)
    second = tmp_path / "second"
    shutil.copytree(first, second)
    one = import_log(spec, first, tmp_path / "one.mcap")
    two = import_log(spec, second, tmp_path / "two.mcap")
    assert one.digests == two.digests
    assert (tmp_path / "one.mcap").read_bytes() == (tmp_path / "two.mcap").read_bytes()


@pytest.mark.parametrize("name", FOLDERS)
def test_specs_are_whole(name: str) -> None:
    spec = load_spec(SPECS / f"{name}.toml")
    assert spec.origin.startswith("https://github.com/") and spec.licence
    assert set(spec.expect) <= set(spec.channels) and len(spec.expect) == 3


def real(name: str, folder: Path) -> tuple[ImportResult, dict[str, Columns]]:
    if not FOLDERS[name].is_dir():
        pytest.skip(f"the recording is not at {FOLDERS[name]}")
    out = folder / "in.mcap"
    result = import_log(SPECS / f"{name}.toml", FOLDERS[name], out)
    assert result.mismatches == ()
    with LogReader(out) as log:
        assert log.digests() == result.digests
        return result, {topic: log.read(topic) for topic in TOPICS}


def rows_of(name: str, file: str) -> list[dict[str, str]]:
    with gzip.open(FOLDERS[name] / f"{file}.csv.gz", "rt") as stream:
        return list(csv.DictReader(stream))


def span_s(columns: Columns) -> float:
    return float(columns.valid_time_ns[-1] - columns.valid_time_ns[0]) * 1e-9


def test_boulder(tmp_path: Path) -> None:
    result, log = real(BOULDER, tmp_path)
    assert result.exit_code is ExitCode.OK
    with gzip.open(FOLDERS[BOULDER] / "imu_1934.csv.gz", "rt") as stream:
        readings = [line.rpartition(",")[0] for line in stream]
    fresh = sum(a != b for a, b in itertools.pairwise(["", *readings]))
    assert (len(readings), fresh) == (54860, 53722)
    assert result.rows == {"/imu/raw": fresh, "/gnss/rover/fix": 2197, "/truth": 2197}
    imu, fix, truth = log["/imu/raw"], log["/gnss/rover/fix"], log["/truth"]

    # The README's start, and the span of the tag's own host times.
    tag = (FOLDERS[BOULDER] / "imu_1934.csv.tag").read_bytes()
    seconds, fraction = struct.unpack_from("<Id", tag, 64)
    host = np.frombuffer(tag, "<u4", offset=76).reshape(-1, 2)[:, 0]
    start = (seconds - 315_964_800) * 10**9 + round(fraction * 1e9)
    assert time.to_text(start) == "2025-07-08T19:34:21.854"
    assert span_s(imu) == pytest.approx(float(host[-1] - host[0]) * 1e-3, abs=0.03)
    assert float(imu.valid_time_ns[0] - start) * 1e-9 == pytest.approx(0.131 - 0.27, abs=0.02)
    note = next(note for note in result.notes if "linear fit" in note)
    assert "scale 1.000013" in note and "residual 2.9" in note

    rest = imu["specific_force_body_m_s2"][:500].mean(axis=0)
    np.testing.assert_allclose(rest, [0.0, 0.19, -9.93], atol=0.03)
    with gzip.open(FOLDERS[BOULDER] / "imu_1934.csv.gz", "rt") as stream:
        raw = np.array([float(x) for x in stream.readline().split(",")])
    first = np.linalg.norm(imu["angular_rate_body_rad_s"][0])
    assert first == pytest.approx(np.linalg.norm(np.radians(raw[3:6])), rel=1e-12)

    place = pymap3d.geodetic2ecef(40.0966268, -105.1474483, 1601.474)
    np.testing.assert_allclose(fix["position_ecef_m"][0], place, atol=3e-9)
    np.testing.assert_array_equal(truth["position_ecef_m"], fix["position_ecef_m"])
    assert time.to_text(int(fix.valid_time_ns[0])) == "2025-07-08T19:34:18.499"
    assert span_s(fix) == pytest.approx(549.0)
    assert np.mean(fix["quality"] == 6) == pytest.approx(0.996, abs=0.001)
    np.testing.assert_allclose(fix["antenna_lever_arm_body_m"][0], [0.0, -0.05, 0.0])


def check_drive(name: str, log: dict[str, Columns]) -> None:
    fix, truth = log["/gnss/rover/fix"], log["/truth"]
    gnss, reference = rows_of(name, "gnss"), rows_of(name, "reference_position")
    assert (len(fix), len(truth)) == (len(gnss), len(reference))
    epoch = time.parse_calendar("2026-05-06T00:00:00")
    for columns, rows in ((fix, gnss), (truth, reference)):
        expected = [epoch + round(float(row["t_s"]) * 1e9) for row in rows]
        np.testing.assert_array_equal(columns.valid_time_ns, expected)
        geodetic = [[float(row[k]) for row in rows] for k in ("lat_deg", "lon_deg", "height_m")]
        place = np.stack(pymap3d.geodetic2ecef(*map(np.array, geodetic)), axis=1)
        np.testing.assert_allclose(columns["position_ecef_m"], place, atol=4e-9)
    assert fix["position_covariance_enu_m2"][0, 5] == float(gnss[0]["pos_std_d_m"]) ** 2
    down = [float(row["vd_mps"]) for row in reference]
    np.testing.assert_array_equal(truth["velocity_enu_m_s"][:, 2], -np.array(down))
    assert set(truth["quality"].tolist()) == {7}
    # Heading is the course where the car moves: wheels hardly slip.
    east, north = truth["velocity_enu_m_s"][:, 0], truth["velocity_enu_m_s"][:, 1]
    moving = truth.is_present("attitude_rad") & (np.hypot(east, north) > 5.0)
    off = np.arctan2(east, north) - truth["attitude_rad"][:, 2]
    assert moving.sum() > 500
    assert np.degrees(np.abs(np.angle(np.exp(1j * off[moving])))).max() < 5.0


def test_urban(tmp_path: Path) -> None:
    result, log = real(URBAN, tmp_path)
    assert result.exit_code is ExitCode.OK
    check_drive(URBAN, log)
    imu, truth = log["/imu/raw"], log["/truth"]
    assert len(imu) == 17604 and span_s(imu) == pytest.approx(176.919, abs=0.001)
    rest = imu["specific_force_body_m_s2"][-300:].mean(axis=0)
    np.testing.assert_allclose(rest, [0.07, -0.14, -9.93], atol=0.02)

    # Axes: turned samples against the receiver's own rates and gravity-free accelerations.
    motion = rows_of(URBAN, "reference_motion")
    at = time.parse_calendar("2026-05-06T00:00:00") * 1e-9
    t = np.array([float(row["t_s"]) for row in motion])
    settled = t > 100.0
    when = (imu.valid_time_ns - int(at * 1e9)) * 1e-9 + 0.025  # the reference is that much late
    for field, names, low in (
        ("angular_rate_body_rad_s", ("wx_radps", "wy_radps", "wz_radps"), 0.97),
        ("specific_force_body_m_s2", ("ax_mps2", "ay_mps2"), 0.94),
    ):
        for k, name in enumerate(names):
            total = np.concatenate([[0.0], np.cumsum(imu[field][:, k])])
            mean = np.diff(np.interp(t, when, total[1:]))
            reference = np.array([float(row[name]) for row in motion])[1:]
            assert np.corrcoef(mean[settled[1:]], reference[settled[1:]])[0, 1] > low, name
    assert span_s(truth) == pytest.approx(176.88)


def test_parking_with_its_rebuilt_sensor(tmp_path: Path) -> None:
    result, log = real(PARKING, tmp_path)
    assert result.topics["imu_rebuilt"] == "/imu/raw"
    assert result.exit_code is ExitCode.LOSS
    told = [loss.what for loss in result.losses.losses]
    assert any("the file is missing" in what for what in told)
    assert any("not independent of the truth" in what for what in told)
    check_drive(PARKING, log)
    imu, truth = log["/imu/raw"], log["/truth"]
    motion = rows_of(PARKING, "reference_motion")
    names = ("wx_radps", "wy_radps", "wz_radps", "ax_mps2", "ay_mps2", "az_mps2")
    used = [row for row in motion if any(float(row[name]) for name in names)]
    assert len(imu) == len(used) == 42711

    # Thirty seconds of free integration stay near the receiver's velocity.
    attitude = {row["t_s"]: row for row in rows_of(PARKING, "reference_attitude")}
    epoch = time.parse_calendar("2026-05-06T00:00:00")
    begin = int(np.searchsorted(imu.valid_time_ns, epoch + 1600 * 10**9))
    end = int(np.searchsorted(imu.valid_time_ns, epoch + 1630 * 10**9))
    row = attitude[used[begin]["t_s"]]
    angles = [math.radians(float(row[k])) for k in ("yaw_deg", "pitch_deg", "roll_deg")]
    drift = integrate(imu, begin, end, angles, north_east_down(truth, imu, begin))
    assert np.linalg.norm(drift - north_east_down(truth, imu, end)) < 1.5


def north_east_down(truth: Columns, imu: Columns, row: int) -> np.ndarray:
    at = int(np.searchsorted(truth.valid_time_ns, imu.valid_time_ns[row]))
    east, north, up = truth["velocity_enu_m_s"][at]
    return np.array([north, east, -up])


def integrate(
    imu: Columns, begin: int, end: int, angles: list[float], velocity: np.ndarray
) -> np.ndarray:
    attitude, gravity = Rotation.from_euler("ZYX", angles), np.array([0.0, 0.0, 9.8045])
    for row in range(begin + 1, end + 1):
        dt = float(imu.valid_time_ns[row] - imu.valid_time_ns[row - 1]) * 1e-9
        turned = attitude * Rotation.from_rotvec(imu["angular_rate_body_rad_s"][row] * dt)
        force = imu["specific_force_body_m_s2"][row]
        mean = 0.5 * (attitude.apply(force) + turned.apply(force))
        velocity = velocity + (mean + gravity) * dt
        attitude = turned
    return velocity
