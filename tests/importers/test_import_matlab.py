"""MATLAB matrices: as tables, and corrected ranges whose truth is a closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pymap3d
import pytest
import scipy.io

from replay import time
from replay.errors import ConfigurationError, ExitCode, ForeignFileError
from replay.importers import ImportResult, import_log
from replay.log.columns import Columns
from replay.log.reader import LogReader

SPECS = Path(__file__).resolve().parents[2] / "recordings" / "specs"
TOKYO = "tokyo-car-2020-310"
C = 299792458.0
EARTH_RATE = 7.292115e-5
WAVELENGTH = C / 1575.42e6
RECEIVER = np.array(pymap3d.geodetic2ecef(35.67, 139.79, 60.0))
EPOCHS = 1000.193 + 0.2 * np.arange(4)  # of the receiver's clock, seconds of week 2130
CLOCK = -7.088e-3 + 1.17e-6 * np.arange(4)
DIRECTIONS = [(20, 70, 5), (110, 40, 12), (200, 25, 18), (290, 55, 2), (45, 60, 2), (330, 15, 24)]
QZSS_ROW = 4  # of the two satellites of number 2
OBS, SATELLITES, CORRECTIONS = (
    f"/gnss/rover/{name}" for name in ("obs", "satellites", "corrections")
)

SPEC = """\
title = "small"
origin = "https://example.org/small"
licence = "CC0-1.0"
[sources.ranges]
file = "ranges.mat"
format = "corrected-ranges-mat"
[sources.imu]
file = "imu.mat"
format = "matlab"
variable = "IMU"
columns = ["tow", "fx", "fy", "fz", "wx", "wy", "wz"]
[streams.rover]
source = "ranges"
[channels.imu]
kind = "imu"
source = "imu"
mounting = ["axes right-forward-up"]
[channels.imu.time]
columns = ["tow"]
scale = "gps_week"
week = 2130
offset = "18 s"
[channels.imu.fields]
angular_rate_body_rad_s = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
specific_force_body_m_s2 = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }
"""


def turn(vector: np.ndarray, elapsed_s: float) -> np.ndarray:
    """Into the Earth-fixed axes of a later time."""
    s, c = np.sin(EARTH_RATE * elapsed_s), np.cos(EARTH_RATE * elapsed_s)
    return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ vector


def true_rows() -> list[dict[str, object]]:
    """Satellites as they are, in the axes of reception; the receiver is at rest."""
    rows = []
    for number, clock in enumerate(CLOCK):
        for index, (azimuth, elevation, prn) in enumerate(DIRECTIONS):
            name = f"{'J' if index == QZSS_ROW else 'G'}{prn:02d}"
            span = 37.0e6 if name[0] == "J" else 21.0e6 + 1e5 * index
            lat, lon, height = pymap3d.ecef2geodetic(*RECEIVER)
            position = np.array(pymap3d.aer2ecef(azimuth, elevation, span, lat, lon, height))
            velocity = np.array([500.0 * index - 900, 1200.0 - 300 * index, 2000.0 - 700 * index])
            rows.append(
                {
                    "epoch": number,
                    "name": name,
                    "position": position,
                    "velocity": velocity,
                    "distance": np.linalg.norm(position - RECEIVER),
                    "pseudorange": np.linalg.norm(position - RECEIVER) + C * clock,
                    "azimuth": np.radians(azimuth),
                    "elevation": elevation,
                }
            )
    return rows


def matrix() -> np.ndarray:
    """The same as the program writes it."""
    out = []
    for row in true_rows():
        number, span = row["epoch"], row["pseudorange"]
        travel = row["distance"] / C
        sent = turn(row["position"], -travel)
        outward = row["position"] * [1, 1, 0]
        velocity = turn(row["velocity"], -travel) - EARTH_RATE**2 * travel * outward
        out.append(
            [number + 1, 2130, EPOCHS[number] - CLOCK[number], int(row["name"][1:]), span]
            + [*turn(sent, span / C), -350.5 - number, 3e-12, *velocity]
            + [row["elevation"], 40 + number, 348.0]
        )
    return np.array(out)


class Case:
    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.spec = folder / "small.toml"
        self.spec.write_text(SPEC)
        self.ranges(matrix())
        self.imu = np.column_stack([990.0 + 0.02 * np.arange(50), np.tile(np.arange(6), (50, 1))])
        scipy.io.savemat(folder / "imu.mat", {"IMU": self.imu, "more": np.eye(2)})

    def ranges(self, rows: np.ndarray) -> None:
        scipy.io.savemat(self.folder / "ranges.mat", {"Data": rows})

    def edit(self, old: str, new: str) -> None:
        text = self.spec.read_text()
        assert old in text
        self.spec.write_text(text.replace(old, new, 1))

    def run(self, *, strict: bool = False) -> ImportResult:
        return import_log(self.spec, self.folder, self.folder / "out.mcap", strict=strict)

    def read(self, topic: str) -> Columns:
        with LogReader(self.folder / "out.mcap") as log:
            return log.read(topic)


@pytest.fixture
def case(tmp_path: Path) -> Case:
    return Case(tmp_path)


def test_ranges_by_closed_forms(case: Case) -> None:
    result = case.run(strict=True)
    assert result.exit_code is ExitCode.OK
    obs, sat, rest = (case.read(topic) for topic in (OBS, SATELLITES, CORRECTIONS))
    expected = sorted(true_rows(), key=lambda row: (row["epoch"], row["name"]))
    number = np.array([row["epoch"] for row in expected])
    # The receiver's own epochs, whole milliseconds, to the nanosecond.
    ns = time.from_week(2130, 0.0) + np.rint(EPOCHS * 1e3).astype(np.int64)[number] * 1_000_000
    for columns in (obs, sat, rest):
        np.testing.assert_array_equal(columns.valid_time_ns, ns)
        np.testing.assert_array_equal(columns.log_time_ns, ns)
        assert [name.decode() for name in columns["satellite"]] == [r["name"] for r in expected]
    assert set(obs["signal"]) == set(rest["signal"]) == {b"1C"}
    np.testing.assert_array_equal(obs["pseudorange_m"], [r["pseudorange"] for r in expected])
    np.testing.assert_allclose(obs["doppler_hz"], (350.5 + number) / WAVELENGTH, rtol=1e-15)
    np.testing.assert_array_equal(obs["cn0_dbhz"], 40.0 + number)
    assert not obs.is_present("carrier_phase_cycles").any()

    position = np.array([r["position"] for r in expected])
    np.testing.assert_allclose(sat["position_ecef_m"], position, atol=1e-6)
    velocity = np.array([r["velocity"] for r in expected])
    np.testing.assert_allclose(sat["velocity_ecef_m_s"], velocity, atol=1e-7)
    np.testing.assert_allclose(sat["azimuth_rad"], [r["azimuth"] for r in expected], atol=1e-12)
    elevation = np.radians([r["elevation"] for r in expected])
    np.testing.assert_allclose(sat["elevation_rad"], elevation, rtol=1e-15)
    assert set(sat["clock_drift_s_s"]) == {3e-12} and set(sat["clock_s"]) == {0.0}
    assert set(sat["issue"]) == {-1} and set(sat["health"]) == {0}
    distance = [r["distance"] for r in expected]
    np.testing.assert_allclose(rest["distance_m"], distance, atol=1e-5)
    for name in ("sagnac_m", "satellite_clock_m", "ionosphere_m", "hydrostatic_m", "wet_m"):
        assert not rest[name].any()
    epochs = case.read("/gnss/rover/epochs")
    assert epochs["satellite_count"].tolist() == [len(DIRECTIONS)] * 4


def test_a_matrix_is_a_table_for_channels(case: Case) -> None:
    case.run(strict=True)
    imu = case.read("/imu/raw")
    expected = time.from_week(2130, 1008.0) + 20_000_000 * np.arange(50)
    np.testing.assert_array_equal(imu.valid_time_ns, expected)
    # Right, forward, up to forward, right, down.
    assert imu["specific_force_body_m_s2"][0].tolist() == [1.0, 0.0, -2.0]
    assert imu["angular_rate_body_rad_s"][0].tolist() == [4.0, 3.0, -5.0]


def test_epochs_of_a_clock_between_milliseconds_keep_what_was_found(case: Case) -> None:
    rows = matrix()
    rows[:, 2] += 3e-4
    case.ranges(rows)
    result = case.run()
    found = np.unique(case.read(OBS).valid_time_ns) - time.from_week(2130, 0.0)
    np.testing.assert_allclose(found, (EPOCHS + 3e-4) * 1e9, atol=2.0)
    assert any("with the error of least squares" in note for note in result.notes)


def test_rows_that_cannot_be_used_are_counted(case: Case) -> None:
    rows = matrix()
    rows[3, 4] = np.nan
    rows[7, 3] = 5.5
    case.ranges(np.vstack([rows, rows[:2]]))
    result = case.run()
    assert result.exit_code is ExitCode.LOSS and result.rows[OBS] == len(rows) - 2
    told = {loss.what: (loss.where.split(", ")[-1], loss.count) for loss in result.losses.losses}
    assert told == {
        "a number is missing; row skipped": ("line 4", 1),
        "the satellite or the week is no whole number; row skipped": ("line 8", 1),
        "a row stands twice; the first one kept": ("26", 2),
    }


def test_an_epoch_of_few_satellites_is_kept(case: Case) -> None:
    rows = matrix()
    case.ranges(np.delete(rows, np.flatnonzero((rows[:, 0] == 2) & (rows[:, 3] > 2)), axis=0))
    case.run(strict=True)
    rest = case.read(CORRECTIONS)
    expected = {(r["epoch"], r["name"]): r["distance"] for r in true_rows()}
    number = np.unique(rest.valid_time_ns, return_inverse=True)[1]
    assert np.bincount(number).tolist() == [6, 2, 6, 6]
    due = [expected[n, s.decode()] for n, s in zip(number, rest["satellite"], strict=True)]
    # Its clock is that of the epoch before, which turns the satellites 0.01 mm too little.
    np.testing.assert_allclose(rest["distance_m"], due, atol=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ('"IMU"', '"imu"', ForeignFileError, "no variable 'imu'"),
        ('variable = "IMU"\n', "", ForeignFileError, "no variable ''"),
        ('"wy", "wz"]\n[streams', '"wy"]\n[streams', ForeignFileError, "50 rows of 7 columns"),
        (
            'columns = ["tow", "fx", "fy", "fz", "wx", "wy", "wz"]\n',
            "",
            ConfigurationError,
            "columns of a matrix have no names",
        ),
    ],
)
def test_a_spec_that_does_not_suit_the_matrix(
    case: Case, old: str, new: str, error: type[Exception], message: str
) -> None:
    case.edit(old, new)
    with pytest.raises(error, match=message):
        case.run()


@pytest.mark.parametrize("name", ["imu.mat", "ranges.mat"])
def test_damaged_files_are_told(case: Case, name: str) -> None:
    path = case.folder / name
    whole = path.read_bytes()
    for damaged in (b"", whole[:100], whole[: len(whole) // 2], b"x" * 400):
        path.write_bytes(damaged)
        with pytest.raises(ForeignFileError) as raised:
            case.run()
        assert raised.value.where == str(path) and raised.value.mend


def test_what_is_no_matrix_of_numbers(case: Case) -> None:
    scipy.io.savemat(case.folder / "imu.mat", {"IMU": "text"})
    with pytest.raises(ForeignFileError, match="IMU is no matrix of numbers"):
        case.run()
    case.ranges(matrix()[:3])
    scipy.io.savemat(case.folder / "imu.mat", {"IMU": case.imu})
    with pytest.raises(ForeignFileError, match="no epoch has four satellites"):
        case.run()


def least_squares(design: np.ndarray, right: np.ndarray, weight: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(design * weight[:, None], right * weight, rcond=None)[0]


def test_tokyo_at_rest_stands_still_where_the_truth_is(shared_data: Path, tmp_path: Path) -> None:
    out = tmp_path / "tokyo.mcap"
    result = import_log(SPECS / f"{TOKYO}.toml", shared_data / TOKYO, out)
    assert result.exit_code is ExitCode.OK and result.mismatches == ()
    raw = scipy.io.loadmat(shared_data / TOKYO / "GNSSTCData_GQ.mat")["GNSSTCData"]
    assert result.rows[OBS] == result.rows[SATELLITES] == len(raw)
    assert result.rows["/imu/raw"] == 20258 and result.rows["/truth"] == 1878
    with LogReader(out) as log:
        obs, sat, truth = log.read(OBS), log.read(SATELLITES), log.read("/truth")
    far = np.char.startswith(obs["satellite"].astype(str), "J")
    assert far.sum() == (np.hypot(np.hypot(raw[:, 5], raw[:, 6]), raw[:, 7]) > 34e6).sum()
    assert set(obs["satellite"][far].tolist()) == {b"J01", b"J02", b"J03", b"J07"}
    place = np.median(truth["position_ecef_m"][:500], axis=0)
    lat, lon, _ = pymap3d.ecef2geodetic(*place)

    epochs, number = np.unique(obs.valid_time_ns, return_inverse=True)
    np.testing.assert_array_equal(epochs % 200_000_000, 193_000_000)
    rows = (number < 500) & (sat["elevation_rad"] > np.radians(15))
    toward = sat["position_ecef_m"] - place
    distance = np.linalg.norm(toward, axis=1)
    u = toward / distance[:, None]
    az, el, _ = pymap3d.ecef2aer(*sat["position_ecef_m"][rows].T, *pymap3d.ecef2geodetic(*place))
    np.testing.assert_allclose(sat["elevation_rad"][rows], np.radians(el), atol=2e-6)
    np.testing.assert_allclose(sat["azimuth_rad"][rows], np.radians(az), atol=1e-5)

    weight = np.sin(sat["elevation_rad"])
    speed = -WAVELENGTH * obs["doppler_hz"] - (u * sat["velocity_ecef_m_s"]).sum(axis=1)
    drift = C * sat["clock_drift_s_s"]
    moves, velocities, plain, rates = [], [], [], []
    for epoch in range(500):
        use = rows & (number == epoch)
        design = np.column_stack([-u[use], np.ones(use.sum())])
        span = obs["pseudorange_m"][use] - distance[use]
        moves.append(least_squares(design, span, weight[use])[:3])
        velocities.append(least_squares(design, (speed + drift)[use], weight[use])[:3])
        plain.append(speed[use] - speed[use].mean())
        rates.append(drift[use] - drift[use].mean())
    east, north, _ = pymap3d.ecef2enuv(*np.mean(moves, axis=0), lat, lon)
    # Satellites as they stand in the file would put the receiver 2.5 m to the east.
    assert abs(east) < 0.5 and abs(north) < 0.5
    # At rest, to some standard deviations of the mean: 0.7, 0.8 and 1.5 mm/s.
    east, north, up = pymap3d.ecef2enuv(*np.mean(velocities, axis=0), lat, lon)
    assert abs(east) < 0.003 and abs(north) < 0.003 and abs(up) < 0.006
    # The satellites' drift enters the range rate with the factor -c.
    a, y = np.concatenate(rates), np.concatenate(plain)
    factor, sigma = (a @ y) / (a @ a), np.std(y) / np.sqrt(a @ a)
    assert abs(factor + 1.0) < 3.0 * sigma < 0.9
