"""Precise products of analysis centres: against RTKLIB, against themselves decimated."""

from __future__ import annotations

import datetime
import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_import_products import ionex

from replay import time
from replay.gnss.measurements import SATELLITE_NAMES
from replay.gnss.products import (
    clock_series,
    interpolation_record,
    ionosphere_maps,
    orbit_series,
)
from replay.importers.antex_streams import Known
from replay.importers.files import File, read_file
from replay.importers.findings import Findings
from replay.importers.product_joins import join_series
from replay.importers.rinex_nav import read_rinex_nav
from replay.importers.spec import Stream
from replay.importers.streams import FORMATS
from replay.kernels import ionosphere_maps as maps_kernel
from replay.kernels import precise_orbits as kernel
from replay.kernels.orbits import satellite_state
from replay.log.columns import Columns

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
ESBC, CCJ2 = DATA / "ppp-esbc-2020-177", DATA / "ppp-ccj2-2021-210"
TOKYO, NETWORK = DATA / "tokyo-rtk-2021-265", DATA / "nl-network-2021-001"
DAYS = [ESBC / f"GRG0MGXFIN_2020{day}0000_01D_15M_ORB.SP3.gz" for day in (176, 177)]
CLOCKS = ESBC / "GRG0MGXFIN_20201770000_01D_30S_CLK.CLK.gz"
FIVE_MINUTES = TOKYO / "COD0MGXFIN_20212650000_01D_05M_ORB.SP3.gz"
ONE_MINUTE = CCJ2 / "WUM0MGXRAP_20212100000_01D_01M_ORB.SP3.gz"
FINAL = NETWORK / "igs21385.sp3.gz"
NAMES = [str(name, "ascii") if isinstance(name, bytes) else str(name) for name in SATELLITE_NAMES]
ECCENTRIC = ("E14", "E18")
C = 299_792_458.0

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no recordings at {DATA}")


def read(path: Path, form: str, findings: Findings | None = None) -> dict[str, Columns]:
    found = Findings() if findings is None else findings
    file = read_file(path, found, mend="")
    late = FORMATS[form].read_late
    assert late is not None
    return dict(late(file, found, Stream(source="x"), Known((), None)))


def plain(path: Path) -> list[str]:
    """Lines of a packed file."""
    return gzip.decompress(path.read_bytes()).decode("latin-1").splitlines()


@pytest.mark.parametrize("path", [*DAYS, FIVE_MINUTES, FINAL], ids=lambda path: path.name)
def test_every_number_of_sp3(path: Path) -> None:
    """Read again, in another way: by words."""
    orbits = read(path, "sp3")["/gnss/orbit"]
    moment, row = 0, 0
    for line in plain(path):
        if line.startswith("*"):
            y, mo, d, h, mi, s = line[1:].split()
            moment = time.from_calendar(datetime.datetime(*map(int, (y, mo, d, h, mi))))
            assert float(s) == 0.0
        elif line.startswith("P"):
            assert orbits.valid_time_ns[row] == moment
            assert orbits["satellite"][row].decode() == line[1:4]
            x, y, z, clock = (float(word) for word in line[4:60].split())
            np.testing.assert_allclose(
                orbits["position_ecef_m"][row], [1e3 * x, 1e3 * y, 1e3 * z], rtol=3e-16
            )
            bad = clock > 999_999.0
            assert orbits.is_present("clock_s")[row] == (not bad)
            assert bad or orbits["clock_s"][row] == pytest.approx(1e-6 * clock, rel=3e-16)
            row += 1
    assert row == len(orbits)


def test_every_number_of_a_clock_file() -> None:
    rows = read(CLOCKS, "rinex-clk")["/gnss/clock"]
    lines = [line.split() for line in plain(CLOCKS) if line.startswith("AS ")]
    assert len(rows) == len(lines) == 215_999
    assert rows["satellite"].tolist() == [words[1].encode() for words in lines]
    np.testing.assert_array_equal(rows["clock_s"], [float(words[9]) for words in lines])
    np.testing.assert_allclose(
        rows["clock_std_s"], [float(words[10]) for words in lines], rtol=5e-16
    )
    day = time.parse_calendar("2020-06-25T00:00:00")
    of_day = [60 * (60 * int(words[5]) + int(words[6])) + round(float(words[7])) for words in lines]
    np.testing.assert_array_equal((rows.valid_time_ns - day) / 1e9, of_day)


def joined() -> Columns:
    """Two days of 15-minute orbits."""
    parts = [read(path, "sp3")["/gnss/orbit"] for path in DAYS]
    return join_series("/gnss/orbit", parts, Findings())


def gtime(rtklib: Any, time_ns: int) -> Any:
    week, rest = divmod(time_ns, time.NS_PER_WEEK)
    return rtklib.gpst2time(week, rest / 1e9)


def satellite_number(rtklib: Any, name: str) -> int:
    return int(rtklib.satid2no(name))


def test_orbits_and_clocks_against_rtklib(tmp_path: Path) -> None:
    """Over midnight, where two files meet, and in the middle of the day."""
    rtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
    nav = rtklib.nav_t()
    for number, path in enumerate(DAYS):
        copy = tmp_path / f"day{number}.sp3"
        copy.write_bytes(gzip.decompress(path.read_bytes()))
        rtklib.readsp3(str(copy), nav, 0)
    copy = tmp_path / "day.clk"
    copy.write_bytes(gzip.decompress(CLOCKS.read_bytes()))
    assert rtklib.readrnxc(str(copy), nav) == 2880
    orbits = orbit_series(joined())
    clocks = clock_series(read(CLOCKS, "rinex-clk")["/gnss/clock"])
    config = interpolation_record()[0]
    midnight = time.parse_calendar("2020-06-25T00:00:00")
    state, work = np.zeros(8), np.zeros(kernel.WORK_SHAPE)
    compared = 0
    for offset in (7.5, 423.0, 887.0, 36_007.5, 70_431.0):
        now = midnight + round(offset * 1e9)
        for satellite, name in enumerate(NAMES):
            first, end = orbits.starts[satellite : satellite + 2]
            status, _ = kernel.precise_position(
                orbits.rows, first, end, now, 0.0, config, state, work
            )
            first, end = clocks.starts[satellite : satellite + 2]
            clock = kernel.precise_clock(clocks.rows, first, end, now, 0.0, 0.0, state)
            rs, dts, var = (rtklib.Arr1Ddouble(size) for size in (6, 2, 1))
            sat = satellite_number(rtklib, name)
            known = rtklib.peph2pos(gtime(rtklib, now), sat, nav, 0, rs, dts, var) if sat else 0
            assert (kernel.FOUND == status == clock) == bool(known), name
            if not known:
                continue
            compared += 1
            theirs = np.array([rs[k] for k in range(6)])
            # In the first half of a step RTKLIB takes the same eleven points, in the second half
            # another one, which changes E18 by 0.6 mm. Its speed is a difference over 1 ms.
            same = offset % 900.0 < 450.0
            np.testing.assert_allclose(state[:3], theirs[:3], rtol=0, atol=2e-6 if same else 1e-3)
            np.testing.assert_allclose(state[3:6], theirs[3:], rtol=0, atol=5e-4)
            ours = state[6] + kernel.relativity(state)
            assert ours * C == pytest.approx(dts[0] * C, abs=1e-4)
    assert compared > 5 * 70


def test_against_broadcast_orbits() -> None:
    """Frames, time systems and signs of four systems: messages are good to some metres.

    A message gives the antenna, a product the centre of mass, up to 3 m away.
    """
    findings = Findings()
    path = ESBC / "ESBC00DNK_R_20201770000_01D_MN.rnx.gz"
    messages = read_rinex_nav(read_file(path, findings, mend=""), findings).ephemerides
    orbits, clocks = orbit_series(joined()), clock_series(joined())
    config = interpolation_record()[0]
    state, told, work = np.zeros(8), np.zeros(8), np.zeros(kernel.WORK_SHAPE)
    errors: dict[str, list[float]] = {}
    clock_errors: dict[str, list[float]] = {}
    noon = time.parse_calendar("2020-06-25T12:00:00")
    for message in messages:
        name = f"{chr(message['system'])}{message['prn']:02d}"
        # Galileo's clock of the F/NAV message is of E1 and E5a, as the products' is.
        inav = name[0] == "E" and not message["source"] & 2
        if name not in NAMES or message["health"] != 0 or inav:
            continue
        if abs(message["toe_ns"] - noon) > 3600 * time.NS_PER_S:
            continue
        satellite, at = NAMES.index(name), int(message["toe_ns"]) + 300 * time.NS_PER_S
        first, end = orbits.starts[satellite : satellite + 2]
        status, _ = kernel.precise_position(orbits.rows, first, end, at, 0.0, config, state, work)
        first, end = clocks.starts[satellite : satellite + 2]
        clock = kernel.precise_clock(clocks.rows, first, end, at, 0.0, 0.0, state)
        if kernel.FOUND == status == clock:
            satellite_state(message, at, 0.0, told)
            errors.setdefault(name[0], []).append(float(np.linalg.norm(state[:3] - told[:3])))
            np.testing.assert_allclose(state[3:6], told[3:6], rtol=0, atol=0.01)
            late = kernel.relativity(state) if name[0] != "R" else 0.0
            clock_errors.setdefault(name[0], []).append(C * (state[6] + late - told[6]))
    for system, most in (("G", 4.0), ("E", 3.0), ("R", 10.0)):
        assert len(errors[system]) > 10
        assert max(errors[system]) < most, system
    # What all clocks of a system share is the product's reference.
    for system, most in (("G", 3.0), ("E", 2.0)):
        spread = np.array(clock_errors[system]) - np.median(clock_errors[system])
        assert np.abs(spread).max() < most, system


def decimated(
    columns: Columns, keep: int, *, degree: int = 10, beyond_s: float = 0.0
) -> dict[str, np.ndarray]:
    """Errors (m) of every satellite at the epochs that are left out.

    `inner`: half a polynomial's points or more from the ends; `outer`: nearer than that;
    `beyond`: after the last epoch. Satellites on eccentric orbits have their own.
    """
    full = orbit_series(columns)
    epochs = np.unique(columns.valid_time_ns)
    kept = epochs[::keep]
    part = orbit_series(columns.take(np.isin(columns.valid_time_ns, kept)))
    config = interpolation_record(degree=degree, beyond_s=beyond_s)[0]
    state, work = np.zeros(8), np.zeros(kernel.WORK_SHAPE)
    found: dict[str, list[float]] = {}
    margin = (degree // 2) * int(kept[1] - kept[0])
    for satellite, name in enumerate(NAMES):
        first, end = part.starts[satellite : satellite + 2]
        if end - first < len(kept):
            continue
        for row in full.rows[full.starts[satellite] : full.starts[satellite + 1]]:
            t = int(row["t"])
            if t in kept:
                continue
            status, _ = kernel.precise_position(part.rows, first, end, t, 0.0, config, state, work)
            if status != kernel.FOUND:
                assert t > kept[-1]
                continue
            where = "inner" if kept[0] + margin <= t <= kept[-1] - margin else "outer"
            where = "beyond" if t > kept[-1] else where
            kind = "eccentric " if name in ECCENTRIC else ""
            error = float(np.linalg.norm(state[:3] - row["position"]))
            found.setdefault(kind + where, []).append(error)
    return {name: np.array(errors) for name, errors in found.items()}


def rms(errors: np.ndarray) -> float:
    return float(np.sqrt((errors * errors).mean()))


def test_five_minute_orbits_from_ten() -> None:
    """The file's own digits are of a millimetre: three axes of two files give 1 mm."""
    errors = decimated(read(FIVE_MINUTES, "sp3")["/gnss/orbit"], 2)
    assert rms(errors["inner"]) < 0.0015 and errors["inner"].max() < 0.005
    assert rms(errors["outer"]) < 0.003 and errors["outer"].max() < 0.012
    assert errors["eccentric inner"].max() < 0.005


def test_five_minute_orbits_from_fifteen() -> None:
    """The interval that analysis centres used to give."""
    columns = read(FIVE_MINUTES, "sp3")["/gnss/orbit"]
    errors = decimated(columns, 3)
    assert rms(errors["inner"]) < 0.0015 and errors["inner"].max() < 0.005
    assert rms(errors["outer"]) < 0.005 and errors["outer"].max() < 0.03
    # An eccentricity of 0.16 asks for more points near the perigee.
    assert 0.008 < errors["eccentric inner"].max() < 0.02
    assert decimated(columns, 3, degree=12)["eccentric inner"].max() < 0.005


@pytest.mark.parametrize(("minutes", "least", "most"), [(2, 0.003, 0.02), (10, 0.05, 0.2)])
def test_what_lies_beyond_the_last_epoch(minutes: int, least: float, most: float) -> None:
    """15-minute orbits that are continued: what an allowance costs, which is none unless asked."""
    columns = read(ONE_MINUTE, "sp3")["/gnss/orbit"]
    last = columns.valid_time_ns[0] + (225 + minutes) * 60 * time.NS_PER_S
    part = columns.take(columns.valid_time_ns <= last)
    assert least < rms(decimated(part, 15, beyond_s=60.0 * minutes)["beyond"]) < most
    assert "beyond" not in decimated(part, 15)


def test_clocks_from_every_second_epoch() -> None:
    """30-second clocks from 60-second ones: what clocks do meanwhile is no one's to know."""
    columns = read(CLOCKS, "rinex-clk")["/gnss/clock"]
    epochs = np.unique(columns.valid_time_ns)
    series = clock_series(columns.take(np.isin(columns.valid_time_ns, epochs[::2])))
    full = clock_series(columns)
    state = np.zeros(8)
    errors: dict[str, list[float]] = {}
    for satellite, name in enumerate(NAMES):
        first, end = series.starts[satellite : satellite + 2]
        for row in full.rows[full.starts[satellite] : full.starts[satellite + 1]][1:-1:2]:
            status = kernel.precise_clock(series.rows, first, end, int(row["t"]), 0.0, 0.0, state)
            if status == kernel.FOUND:
                errors.setdefault(name[0], []).append(C * (state[6] - float(row["clock"])))
    # Masers of Galileo; rubidium and caesium of the others.
    for system, most in (("E", 0.002), ("G", 0.02), ("R", 0.02)):
        assert 0.3 * most < rms(np.array(errors[system])) < most, system


def test_biases_of_wuhan() -> None:
    rows = read(CCJ2 / "WUM0MGXRAP_20212100000_01D_01D_ABS.BIA.gz", "sinex-bias")["/gnss/bias"]
    assert len(rows) == 1072
    names = rows.ragged("observation").texts()
    found = {
        (satellite.decode(), name): value
        for satellite, name, value in zip(rows["satellite"], names, rows["value_s"], strict=True)
    }
    assert found["G01", "C1C"] == pytest.approx(9.7876e-9, rel=1e-12)
    assert found["G01", "L2W"] == pytest.approx(-1.94099438406839e-9, rel=1e-12)
    assert found["J03", "C5X"] == pytest.approx(1.3291e-9, rel=1e-12)
    day = time.parse_calendar("2021-07-29T00:00:00")
    assert set(rows["valid_from_ns"].tolist()) == {day}
    assert set(rows["valid_until_ns"].tolist()) == {day + 86_400 * time.NS_PER_S}


def test_rotation_against_rtklib(tmp_path: Path) -> None:
    rtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
    path = CCJ2 / "WUM0MGXRAP_20212100000_01D_01D_ERP.ERP.gz"
    row = read(path, "erp")["/gnss/earth_rotation"]
    copy = tmp_path / "day.erp"
    copy.write_bytes(gzip.decompress(path.read_bytes()))
    table, values = rtklib.erp_t(), rtklib.Arr1Ddouble(4)
    assert rtklib.readerp(str(copy), table) == 1
    assert rtklib.geterp(table, gtime(rtklib, int(row.valid_time_ns[0])), values) == 1
    ours = [row[name][0] for name in ("polar_x_rad", "polar_y_rad", "ut1_utc_s", "length_of_day_s")]
    np.testing.assert_allclose(ours, [values[k] for k in range(4)], rtol=1e-9)
    assert row.valid_time_ns[0] == time.parse_calendar("2021-07-29T12:00:18")


@pytest.mark.parametrize("model", [maps_kernel.THIN_LAYER, maps_kernel.MODIFIED_LAYER])
def test_ionosphere_against_rtklib(tmp_path: Path, model: int) -> None:
    rtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
    text = ionex()
    copy = tmp_path / "maps.20i"
    copy.write_text(text)
    nav = rtklib.nav_t()
    rtklib.readtec(str(copy), nav, 1)
    assert nav.nt == 2
    late = FORMATS["ionex"].read_late
    assert late is not None
    file = File("maps.20i", text.encode(), "", len(text))
    columns = late(file, Findings(), Stream(source="x"), Known((), None))["/gnss/ionosphere_map"]
    maps = ionosphere_maps(columns)
    # RTKLIB reads the maps' times, which are UTC, as GPS time.
    start = int(columns.valid_time_ns[0])
    theirs_start = time.parse_calendar("2020-07-12T00:00:00")
    rng = np.random.default_rng(5)
    for _ in range(40):
        lat, lon = rng.uniform(-0.15, 0.15), rng.uniform(-3.1, 3.1)
        azimuth, elevation = rng.uniform(0.0, 6.28), rng.uniform(0.5, 1.5)
        after = round(rng.uniform(0.0, 7200.0) * 1e9)
        place, angles = rtklib.Arr1Ddouble(3), rtklib.Arr1Ddouble(2)
        place[0], place[1], place[2] = lat, lon, 0.0
        angles[0], angles[1] = azimuth, elevation
        delay, variance = rtklib.Arr1Ddouble(1), rtklib.Arr1Ddouble(1)
        options = 1 + (2 if model == maps_kernel.MODIFIED_LAYER else 0)
        when = gtime(rtklib, theirs_start + after)
        assert rtklib.iontec(when, nav, place, angles, options, delay, variance) == 1
        ours, deviation = maps_kernel.slant_tec(
            maps.maps, maps.tec, maps.rms, start + after, lat, lon, azimuth, elevation, model
        )
        scale = maps_kernel.tecu_delay(1575.42e6)
        assert ours * scale == pytest.approx(delay[0], rel=1e-6)
        assert deviation > 0.0
