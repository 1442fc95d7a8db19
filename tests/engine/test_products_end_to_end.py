"""Products from files to positions: each term as closed forms have it, and what it moves.

A receiver stands for two minutes under a sky without air. Small files are added to its log: tides
of the ocean (BLQ), of the pole (ERP), and a map of the ionosphere (IONEX) of a field that is told
by one formula. The formulas here are written from their sources once more, in numpy.
"""

from __future__ import annotations

import datetime
import math
from pathlib import Path
from typing import Any

import numpy as np
import pymap3d
import pytest

from replay import channels
from replay.engine.job import make_job
from replay.engine.run import replay_log, verify_run
from replay.errors import ExitCode
from replay.importers import import_log
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.log.writer import LogWriter
from replay.simulate import read_scenario
from replay.simulate.write import make_all
from tests.simulate import observing

C = 299792458.0
SECOND = 1_000_000_000
FREQUENCY = {b"1C": 1575.42e6, b"2W": 1227.60e6}
UTC = datetime.datetime(2020, 11, 30, 6) - datetime.timedelta(seconds=18)
PLACE = np.array(pymap3d.geodetic2ecef(30.5, 114.3, 25.0))
ROTATION = channels.EARTH_ROTATION.topic
# Of Onsala, IERS Conventions 2010, section 7.1.2: up, west, south.
TIDES = """\
$$ FES2004_PP ID: 2009-06-25 20:02:03
  ONSA
  .00352 .00123 .00080 .00032 .00187 .00112 .00063 .00003 .00082 .00044 .00037
  .00144 .00035 .00035 .00008 .00053 .00049 .00018 .00009 .00012 .00005 .00006
  .00086 .00023 .00023 .00006 .00029 .00028 .00010 .00007 .00004 .00002 .00001
   -64.7  -52.0  -96.2  -55.2  -58.8 -151.4  -65.6 -138.1    8.4    5.2    2.1
    85.5  114.5   56.5  113.6   99.4   19.1   94.1  -10.4 -167.4 -170.0 -177.7
   109.5  147.0   92.7  148.8  101.5   31.1   95.8   11.3  -22.9   -7.3    -.9
"""
POLE = """\
version 2
  MJD      Xpole   Ypole  UT1-UTC    LOD  Xsig  Ysig   UTsig  LODsig  Nr Nf Nt    Xrt    Yrt
             (10**-6")       (0.1 usec)    (10**-6")     (0.1 usec)          (10**-6"/d)
59182.50  -144000  683461 -1740292  -3800     7    10       7       5 181 181 76   866  -1716
59183.50  -145000  683000 -1740000   3800     7    10       7       5 181 181 76   866  -1716
"""
SPEC = """\
title = "with products"
origin = "simulated"
licence = "CC0-1.0"

[sources.log]
file = "plain.mcap"
format = "log"

[streams.log]
source = "log"

[sources.tides]
file = "rover.blq"
format = "blq"

[streams.tides]
source = "tides"
receiver = "rover"
site = "ONSA"

[sources.rotation]
file = "pole.erp"
format = "erp"

[streams.rotation]
source = "rotation"

[sources.maps]
file = "maps.20i"
format = "ionex"

[streams.maps]
source = "maps"
"""


def content(latitude: Any, longitude: Any, hours: Any) -> Any:
    """Vertical content (TECU) at a geocentric place: a field that turns with the Sun."""
    return 30.0 + 20.0 * np.cos(latitude) * np.cos(longitude + (hours - 14.0) * np.pi / 12.0)


def ionex() -> str:
    """Maps of `content` at 4, 6 and 8 h UTC, every 2.5 by 5 degrees, to 0.01 TECU."""

    def record(text: str, label: str) -> str:
        return f"{text:<60}{label}\n"

    text = (
        record(f"{1.0:8.1f}{'':12}{'IONOSPHERE MAPS':<20}GPS", "IONEX VERSION / TYPE")
        + record("  6371.0", "BASE RADIUS")
        + record("   450.0 450.0   0.0", "HGT1 / HGT2 / DHGT")
        + record("    87.5 -87.5  -2.5", "LAT1 / LAT2 / DLAT")
        + record("  -180.0 180.0   5.0", "LON1 / LON2 / DLON")
        + record(f"{-2:6d}", "EXPONENT")
        + record("", "END OF HEADER")
    )
    longitudes = np.radians(np.arange(-180.0, 180.1, 5.0))
    for number, hour in enumerate((4, 6, 8), 1):
        text += record(f"{number:6d}", "START OF TEC MAP")
        text += record(f"  2020    11    30{hour:6d}     0     0", "EPOCH OF CURRENT MAP")
        for latitude in np.arange(87.5, -87.6, -2.5):
            place = f"  {latitude:6.1f}-180.0 180.0   5.0 450.0"
            text += record(place, "LAT/LON1/LON2/DLON/H")
            values = np.rint(100.0 * content(math.radians(latitude), longitudes, hour))
            for at in range(0, 73, 16):
                text += "".join(f"{value:5.0f}" for value in values[at : at + 16]) + "\n"
        text += record(f"{number:6d}", "END OF TEC MAP")
    return text + record("", "END OF FILE")


def write_plain(path: Path) -> None:
    """Two minutes of a receiver that stands, without errors; its log knows no pole."""
    rows, _ = make_all(
        read_scenario(
            {
                "seed": 4,
                "start": {"time": observing.START, **observing.HERE},
                "gnss": {"fixes": False},
                "sky": {"systems": "G", **observing.NO_AIR},
                "products": {"orbit_interval": "5 min"},
                "receivers": [
                    observing.base("rover", signals=["G1C", "G2W"], noise={"code_bias": 0.0})
                ],
                "segments": [{"kind": "hold", "duration": 120.0}],
            }
        )
    )
    rows = {topic: part for topic, part in rows.items() if topic != ROTATION}
    with LogWriter(path) as writer:
        for topic in rows:
            spec = channels.find(topic)
            assert spec is not None
            writer.add_channel(topic, spec.message)
        writer.write(rows)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files, the log without them and the log with them."""
    where = tmp_path_factory.mktemp("products")
    write_plain(where / "plain.mcap")
    for name, text in {
        "rover.blq": TIDES,
        "pole.erp": POLE,
        "maps.20i": ionex(),
        "add.toml": SPEC,
    }.items():
        (where / name).write_text(text)
    result = import_log(where / "add.toml", where, where / "log.mcap")
    assert result.exit_code is ExitCode.OK
    return where


def run(folder: Path, name: str, *tables: dict[str, Any], start_ns: int | None = None) -> Path:
    """A run of `ppp` with all terms but for what the tables say."""
    target = folder / f"{name}.mcap"
    if target.exists():
        return target
    everything = {
        "gnss": {"signals": ["G1C", "G2W"]},
        "terms": {"higher_ionosphere": True},
        "atmosphere": {"ionosphere": "map", "troposphere": "none"},
        "ppp": {"measurements": {"code_gate": 1e3, "phase_gate": 1e3}},
    }
    with LogReader(folder / "log.mcap") as reader:
        job = make_job(reader, "ppp", tables=[everything, *tables], start_ns=start_ns)
        replay_log(reader, target, job)
    return target


def read(path: Path, topic: str) -> Columns:
    with LogReader(path) as reader:
        return reader.read(topic)


@pytest.fixture(scope="module")
def corrections(folder: Path) -> Columns:
    return read(run(folder, "all"), "/gnss/rover/corrections")


@pytest.fixture(scope="module")
def angles(folder: Path, corrections: Columns) -> tuple[np.ndarray, np.ndarray]:
    """Elevation and azimuth of each row of the corrections."""
    sights = read(run(folder, "all"), "/gnss/rover/satellites")
    at = {
        (t, name): row
        for row, (t, name) in enumerate(
            zip(sights.valid_time_ns.tolist(), sights["satellite"].tolist(), strict=True)
        )
    }
    rows = [
        at[key]
        for key in zip(
            corrections.valid_time_ns.tolist(), corrections["satellite"].tolist(), strict=True
        )
    ]
    return sights["elevation_rad"][rows], sights["azimuth_rad"][rows]


def towards(angles: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Directions to the satellites, rows east, north, up."""
    elevation, azimuth = angles
    level = np.cos(elevation)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)], axis=-1)


def loading() -> np.ndarray:
    """Displacement east, north, up (m) at 06:00 GPS by the routine ARG2 of the IERS Conventions."""
    speed = np.array(
        [1.40519e-4, 1.45444e-4, 1.37880e-4, 1.45842e-4, 0.72921e-4, 0.67598e-4, 0.72523e-4,
         0.64959e-4, 0.053234e-4, 0.026392e-4, 0.003982e-4]
    )  # fmt: skip
    factors = np.array(
        [(2, -2, 0, 0), (0, 0, 0, 0), (2, -3, 1, 0), (2, 0, 0, 0), (1, 0, 0, 0.25),
         (1, -2, 0, -0.25), (-1, 0, 0, -0.25), (1, -3, 1, -0.25), (0, 2, 0, 0), (0, 1, -1, 0),
         (2, 0, 0, 0)]
    )  # fmt: skip
    day = UTC.timetuple().tm_yday
    days = day + 365 * (UTC.year - 1975) + (UTC.year - 1973) // 4
    t = (27392.500528 + 1.000000035 * days) / 36525.0
    h = 279.69668 + (36000.768930485 + 3.03e-4 * t) * t
    s = ((1.9e-6 * t - 0.001133) * t + 481267.88314137) * t + 270.434358
    p = ((-1.2e-5 * t - 0.010325) * t + 4069.0340329577) * t + 334.329653
    seconds = UTC.hour * 3600 + UTC.minute * 60 + UTC.second
    argument = speed * seconds + factors @ np.radians([h, s, p, 360.0])
    table = np.array([[float(w) for w in line.split()] for line in TIDES.splitlines()[2:]])
    up, west, south = (table[:3] * np.cos(argument - np.radians(table[3:]))).sum(axis=1)
    return np.array([-west, -south, up])


def test_what_was_recorded_is_as_it_was(folder: Path) -> None:
    with LogReader(folder / "plain.mcap") as plain, LogReader(folder / "log.mcap") as log:
        before, after = plain.digests(), log.digests()
        products = channels.PRODUCTS.topic
        assert {t: after[t] for t in before if t != products} == {
            t: d for t, d in before.items() if t != products
        }
        assert set(after) - set(before) == {
            "/gnss/rover/ocean_loading",
            channels.IONOSPHERE_MAP.topic,
            ROTATION,
        }
        assert len(log.read(products)) == len(plain.read(products)) + 3
        for topic in set(after) - set(before):
            # Known from the first moment on.
            assert np.all(log.read(topic).log_time_ns == plain.start_ns)


def test_ocean_loading_is_that_of_the_iers_routine(
    corrections: Columns, angles: tuple[np.ndarray, np.ndarray]
) -> None:
    due = -towards(angles) @ loading()
    assert corrections.is_present("ocean_loading_m").all()
    # 3e-4 rad of argument and two minutes of tide, of 6 mm.
    np.testing.assert_allclose(corrections["ocean_loading_m"], due, atol=8e-5)
    assert np.abs(due).max() > 1e-3


def test_the_pole_tide_is_that_of_the_conventions(
    corrections: Columns, angles: tuple[np.ndarray, np.ndarray]
) -> None:
    """IERS Conventions 2010, eq. 7.26, with the secular pole of 2018; half-way between rows."""
    years = 20.0 + 334.25 / 366.0
    x, y = -0.144 - 0.00025 * 3.0, 0.683461 - 0.000461 * 0.75
    m1 = x - (0.055 + 0.001677 * years)
    m2 = -(y - (0.3205 + 0.00346 * years))
    latitude = np.arctan2(PLACE[2], np.hypot(PLACE[0], PLACE[1]))
    longitude = np.radians(114.3)
    theta = np.pi / 2 - latitude
    along = m1 * np.cos(longitude) + m2 * np.sin(longitude)
    across = m1 * np.sin(longitude) - m2 * np.cos(longitude)
    up = -0.033 * np.sin(2 * theta) * along
    north = 0.009 * np.cos(2 * theta) * along
    east = 0.009 * np.cos(theta) * across
    due = -towards(angles) @ [east, north, up]
    # Radial is not quite up, and the rates of the file may bend what lies between its rows.
    np.testing.assert_allclose(corrections["pole_tide_m"], due, atol=1e-4)
    assert np.abs(due).max() > 2e-3


def pierced(
    corrections: Columns, angles: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slant content (TECU), and places (m) where rays meet the layer, by vectors.

    IONEX is of spheres: the receiver stands on that of 6371 km, the layer is 450 km above it.
    """
    latitude = np.arctan2(PLACE[2], np.hypot(PLACE[0], PLACE[1]))
    longitude = np.radians(114.3)
    sl, cl, sb, cb = np.sin(longitude), np.cos(longitude), np.sin(latitude), np.cos(latitude)
    axes = np.array([[-sl, cl, 0.0], [-sb * cl, -sb * sl, cb], [cb * cl, cb * sl, sb]])
    u = towards(angles) @ axes
    start = 6371e3 * axes[2]
    along = u @ start
    distance = np.sqrt(along**2 - 6371e3**2 + 6821e3**2) - along
    places = start + distance[:, None] * u
    cosine = (u * places).sum(axis=1) / 6821e3
    hours = (corrections.valid_time_ns - observing.START_NS) / SECOND / 3600.0 + 6.0 - 18.0 / 3600
    vertical = content(np.arcsin(places[:, 2] / 6821e3), np.arctan2(places[:, 1], places[:, 0]),
                       hours)  # fmt: skip
    return vertical / cosine, places, u


def test_the_ionosphere_is_that_of_the_field(
    corrections: Columns, angles: tuple[np.ndarray, np.ndarray]
) -> None:
    slant, _, _ = pierced(corrections, angles)
    frequency = np.array([FREQUENCY[s] for s in corrections["signal"].tolist()])
    due = 40.3e16 * slant / frequency**2
    # A bilinear cell of 5 degrees leaves 0.02 TECU of the field.
    np.testing.assert_allclose(corrections["ionosphere_m"], due, rtol=1e-3)
    assert due.min() > 3.0


def test_the_second_order_is_that_of_a_dipole(
    corrections: Columns, angles: tuple[np.ndarray, np.ndarray]
) -> None:
    """Bassiri and Hajj (1993): 7527 c TEC B cos / f^3 on the code, B from a dipole's potential."""
    slant, _, _ = pierced(corrections, angles)
    axes = np.array(pymap3d.enu2uvw(*np.eye(3), 30.5, 114.3)).T
    u = towards(angles) @ axes
    along = u @ PLACE
    reach = np.sqrt(along**2 - PLACE @ PLACE + (6371.2e3 + 450e3) ** 2) - along
    places = PLACE + reach[:, None] * u

    def potential(x: np.ndarray) -> np.ndarray:
        r = np.linalg.norm(x, axis=1)
        g = np.array([-1450.9, 4652.5, -29404.8]) * 1e-9  # IGRF-13, 2020
        return 6371.2e3**3 * (x @ g) / r**3

    step = 1000.0
    field = -np.stack(
        [
            (potential(places + step * e) - potential(places - step * e)) / (2.0 * step)
            for e in np.eye(3)
        ],
        axis=-1,
    )
    travel = -(field * u).sum(axis=1)
    frequency = np.array([FREQUENCY[s] for s in corrections["signal"].tolist()])
    due = 7527.0 * C * slant * 1e16 * travel / frequency**3
    np.testing.assert_allclose(corrections["higher_ionosphere_m"], due, rtol=2e-3, atol=2e-5)
    assert np.abs(due).max() > 5e-3


def moved(one: Path, other: Path, topic: str) -> np.ndarray:
    """Positions of a run less those of another, east, north, up, of each epoch."""
    positions = [read(path, topic)["position_ecef_m"] for path in (one, other)]
    step = positions[0] - positions[1]
    return np.stack(pymap3d.uvw2enu(*step.T, 30.5, 114.3), axis=-1)


def test_a_tide_moves_the_position_back_by_itself(folder: Path) -> None:
    """Where the ground stands high by d, the position without the tide is d lower."""
    without = run(folder, "no-loading", {"terms": {"ocean_loading": False}})
    step = moved(run(folder, "all"), without, "/solution/ppp")
    assert len(step) == 120
    np.testing.assert_allclose(step.mean(axis=0), -loading(), atol=1e-4)
    told = read(without, "/gnss/rover/corrections")
    assert not told.is_present("ocean_loading_m").any()


def test_a_map_moves_a_position_from_codes(folder: Path, corrections: Columns, angles: Any) -> None:
    """The coarse position is least squares with sin^2 of the elevation: so is what moves it."""
    without = run(folder, "no-map", {"atmosphere": {"ionosphere": "none"}},
                  {"terms": {"higher_ionosphere": False}})  # fmt: skip
    step = moved(run(folder, "all"), without, "/gnss/rover/coarse")
    last = corrections.valid_time_ns.max()
    rows = (corrections.valid_time_ns == last) & (corrections["signal"] == b"1C")
    design = np.hstack([-towards(angles)[rows], np.ones((rows.sum(), 1))])
    weight = np.sin(angles[0][rows])[:, None]
    delay = corrections["ionosphere_m"][rows, None]
    due = -np.linalg.lstsq(design * weight, delay * weight, rcond=None)[0][:3, 0]
    np.testing.assert_allclose(step[-1], due, atol=0.02 * np.abs(due).max())
    assert np.abs(due).max() > 1.0


def test_a_run_from_the_middle_knows_what_the_log_knew(folder: Path) -> None:
    """Terms do not depend on where a run begins; the coarse position is iterated to 1 cm."""
    whole = run(folder, "all")
    start_ns = observing.START_NS + 60 * SECOND
    late = run(folder, "late", start_ns=start_ns)
    one, other = (read(path, "/gnss/rover/corrections") for path in (whole, late))
    one = one.take(np.flatnonzero(one.log_time_ns >= start_ns))
    assert other["satellite"].tolist() == one["satellite"].tolist()
    assert np.array_equal(other.valid_time_ns, one.valid_time_ns)
    for name in ("satellite_clock_m", "relativity_m", "group_delay_m", "shapiro_m",
                 "solid_tide_m", "pole_tide_m", "ocean_loading_m", "wind_up_m"):  # fmt: skip
        np.testing.assert_allclose(other[name], one[name], atol=1e-9, err_msg=name)
    for name in ("distance_m", "ionosphere_m"):
        np.testing.assert_allclose(other[name], one[name], atol=0.02, err_msg=name)
    np.testing.assert_allclose(other["higher_ionosphere_m"], one["higher_ionosphere_m"], atol=1e-6)
    solution = read(late, "/solution/ppp")
    assert len(solution) == 61
    assert solution.valid_time_ns.min() >= start_ns - SECOND // 1000
    # What was known is taken along as it was, and the run can be made again from its own log.
    with LogReader(folder / "log.mcap") as source, LogReader(late) as log:
        for topic in (channels.PRECISE_ORBIT.topic, channels.PRECISE_CLOCK.topic, ROTATION,
                      channels.IONOSPHERE_MAP.topic, "/gnss/rover/ocean_loading",
                      "/gnss/rover/receiver", channels.NAV.topic):  # fmt: skip
            assert log.digests()[topic] == source.digests()[topic], topic
        assert log.read("/gnss/rover/obs").log_time_ns.min() >= start_ns
    assert verify_run(late, folder / "log.mcap").exit_code is ExitCode.OK


def test_checkpoints_of_a_run_from_the_middle(folder: Path, tmp_path: Path) -> None:
    """Gone on with after a crash: the same bytes, with what was known before the start."""
    start_ns = observing.START_NS + 60 * SECOND
    with LogReader(folder / "log.mcap") as reader:
        job = make_job(reader, "spp", tables=[], start_ns=start_ns, checkpoint_every_s=25)
        replay_log(reader, tmp_path / "whole.mcap", job)
        early = make_job(reader, "spp", tables=[], start_ns=start_ns, checkpoint_every_s=25)
        result = replay_log(reader, tmp_path / "again.mcap", early, resume=tmp_path / "whole.mcap")
        assert result.first_ns >= start_ns
    checkpoints = read(tmp_path / "whole.mcap", channels.CHECKPOINT.topic)
    assert np.unique(checkpoints.valid_time_ns).tolist() == [
        start_ns + 25 * SECOND, start_ns + 50 * SECOND
    ]  # fmt: skip
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "whole.mcap").read_bytes()
    assert len(read(tmp_path / "whole.mcap", "/solution/spp")) == 61
