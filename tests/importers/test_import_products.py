"""Precise products: small files by hand, what is damaged in them, days that meet."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import small_products as small
from small_products import clock_head, clock_row, record, seconds, sp3_epoch, sp3_head, sp3_row

from replay import channels, time
from replay.errors import ConfigurationError, ExitCode, ForeignFileError
from replay.importers.antex_streams import Known
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.spec import Stream
from replay.importers.streams import FORMATS
from replay.log.codec import codec_for
from replay.schemas import products_pb2

ORBIT, CLOCK, BIAS = "/gnss/orbit", "/gnss/clock", "/gnss/bias"
ROTATION, MAPS, PRODUCTS = "/gnss/earth_rotation", "/gnss/ionosphere_map", "/gnss/products"
A = (-22460.658230, -13161.332399, -14082.686747)
B = (22531.478336, 13120.836730, 14007.021991)


@pytest.fixture
def recording(tmp_path: Path) -> small.Recording:
    return small.Recording(tmp_path)


def losses(result: object) -> list[str]:
    return [str(loss) for loss in result.losses.losses]  # type: ignore[attr-defined]


def whole_sp3() -> str:
    return (
        sp3_head(["G05", "E11", "R03"])
        + sp3_epoch(0)
        + sp3_row("G05", A, -884.022138, "  9  7  5 109")
        + sp3_row("E11", (0.0, 0.0, 0.0), 12.5)
        + sp3_epoch(15)
        + sp3_row("G05", B, 999999.999999, f"{'':14}EP  MP")
        + sp3_row("E11", B, 142.534229, f"{'':18}M")
        + "EOF\n"
    )


def test_sp3(recording: small.Recording) -> None:
    result = recording.run(("orbits", "sp3", whole_sp3()))
    assert result.exit_code is ExitCode.OK
    rows = recording.read(ORBIT)
    start = recording.read("/gnss/rover/epochs").log_time_ns[0]
    assert (rows.log_time_ns == start).all()  # all of it is known from the first row on
    np.testing.assert_array_equal(seconds(rows), [0, 0, 900, 900])
    assert rows["satellite"].tolist() == [b"G05", b"E11", b"G05", b"E11"]
    assert rows.is_present("position_ecef_m").tolist() == [True, False, True, True]
    np.testing.assert_allclose(rows["position_ecef_m"][0], np.array(A) * 1e3, rtol=1e-15)
    assert rows.is_present("clock_s").tolist() == [True, True, False, True]
    np.testing.assert_allclose(
        rows["clock_s"][[0, 1, 3]], [-884.022138e-6, 12.5e-6, 142.534229e-6], rtol=1e-15
    )
    assert rows.is_present("position_std_ecef_m").tolist() == [True, False, False, False]
    expected = [1.25**9 * 1e-3, 1.25**7 * 1e-3, 1.25**5 * 1e-3]
    np.testing.assert_allclose(rows["position_std_ecef_m"][0], expected, rtol=1e-14)
    assert rows["clock_std_s"][0] == pytest.approx(1.025**109 * 1e-12, rel=1e-13)
    assert rows["clock_event"].tolist() == [False, False, True, False]
    assert rows["clock_predicted"].tolist() == [False, False, True, False]
    assert rows["manoeuvre"].tolist() == [False, False, True, True]
    assert rows["orbit_predicted"].tolist() == [False, False, True, False]
    assert any("R03 are named but have no value" in note for note in result.notes)
    assert any("1 of 4 positions are absent" in note for note in result.notes)
    assert any("1 of 4 clocks are absent" in note for note in result.notes)
    about = recording.read(PRODUCTS)
    said = {name: about.ragged(name).texts()[0] for name in
            ("source", "format", "version", "agency", "frame", "time_system", "kind")}  # fmt: skip
    assert said == {"source": "product0", "format": "sp3", "version": "c", "agency": "IGS",
                    "frame": "IGb14", "time_system": "GPS", "kind": "HLM"}  # fmt: skip
    assert about["interval_s"][0] == 900.0 and about["row_count"][0] == 4
    assert about["last_ns"][0] - about["first_ns"][0] == 900 * time.NS_PER_S


@pytest.mark.parametrize(
    ("scale", "shift"),
    [("GPS", 0), ("UTC", 18), ("GLO", 18), ("BDT", 14), ("TAI", -19), ("ccc", 0)],
)
def test_time_systems(recording: small.Recording, scale: str, shift: int) -> None:
    text = whole_sp3().replace("cc GPS", f"cc {scale}")
    recording.run(("orbits", "sp3", text))
    np.testing.assert_array_equal(
        seconds(recording.read(ORBIT)), np.array([0, 0, 900, 900]) + shift
    )


def test_versions_a_and_d(recording: small.Recording) -> None:
    """Version a names GPS satellites by number and has other cells in %c."""
    old = (
        sp3_head(["  5"], version="a").replace("cc GPS", "cc ccc")
        + sp3_epoch(0) + sp3_row("  5", A, 1.0)
        + sp3_epoch(15) + sp3_row("  5", A, 2.0) + "EOF"
    )  # fmt: skip
    result = recording.run(("orbits", "sp3", old))
    assert result.exit_code is ExitCode.OK
    assert recording.read(ORBIT)["satellite"].tolist() == [b"G05", b"G05"]
    # Version d may have velocities, and times between seconds.
    moving = (
        sp3_head(["E11"], version="d")
        + sp3_epoch(0, second=30.25) + sp3_row("E11", A, 1.0)
        + sp3_row("E11", (-20298.880364, -18462.044804, 1381.387685), 1.0).replace("P", "V", 1)
        + "EP   55   55   55     222  1234567 -1234567  5999999\n"
        + sp3_epoch(15) + sp3_row("E11", A, 2.0) + "EOF\n"
    )  # fmt: skip
    result = recording.run(("orbits", "sp3", moving))
    rows = recording.read(ORBIT)
    assert seconds(rows).tolist() == [30.25, 900.0]
    assert rows.is_present("velocity_ecef_m_s").tolist() == [True, False]
    np.testing.assert_allclose(
        rows["velocity_ecef_m_s"][0], [-2029.8880364, -1846.2044804, 138.1387685], rtol=1e-12
    )
    assert any("1 records of correlations" in note for note in result.notes)


@pytest.mark.parametrize(
    ("old", "new", "what", "line"),
    [
        ("PG05 -22460.658230", "PG05 -2246x.658230", "cannot be read", 11),
        ("*  2020  7 12  0 15", "*  2020  7 42  0 15", "cannot be read", 13),
        ("*  2020  7 12  0 15", "*  2020  7 42  0 15", "belongs to no epoch", 14),
        ("  9  7  5 109", "  9  x  5 109", "cannot be read", 11),
        ("EOF\n", "", "no end mark", 15),
        ("*  2020  7 12  0 15", "*  2020  7 12  0  0", "an epoch twice", 14),
        ("PE11  22531", "XE11  22531", "cannot be read", 15),
    ],
)
def test_damaged_sp3(recording: small.Recording, old: str, new: str, what: str, line: int) -> None:
    text = whole_sp3()
    assert old in text
    result = recording.run(("orbits", "sp3", text.replace(old, new, 1)))
    assert result.exit_code is ExitCode.LOSS
    assert any(what in loss and "product0" in loss and str(line) in loss for loss in losses(result))
    with pytest.raises(ForeignFileError):
        recording.run(("orbits", "sp3", text.replace(old, new, 1)), strict=True)


def test_cut_anywhere(recording: small.Recording) -> None:
    """Whatever is left is either read, and told of, or refused; no number is cut short."""
    text = whole_sp3()
    for cut in range(len(text) - 60, len(text) - 2, 7):
        result = recording.run(("orbits", "sp3", text[:cut]))
        assert result.exit_code is ExitCode.LOSS
        rows = recording.read(ORBIT)
        assert len(rows) in (3, 4)
        np.testing.assert_allclose(rows["position_ecef_m"][2], np.array(B) * 1e3, rtol=1e-15)


def test_gaps_are_told(recording: small.Recording) -> None:
    text = sp3_head(["G05", "E11"], epochs=6)
    for minute in (0, 15, 30, 60, 75, 90):
        text += sp3_epoch(minute) + sp3_row("G05", A, 1.0)
        text += sp3_row("E11", B, 1.0) if minute != 75 else ""
    result = recording.run(("orbits", "sp3", text + "EOF\n"))
    assert any(
        "1 gaps of all satellites (2020-07-12T00:30:00.000 to 2020-07-12T01:00" in note
        for note in result.notes
    )
    assert any("1 lack some of 6 epochs (E11 1)" in note for note in result.notes)


def test_no_products(recording: small.Recording) -> None:
    for form in ("sp3", "rinex-clk", "sinex-bias", "erp", "ionex", "blq"):
        with pytest.raises(ForeignFileError):
            recording.run(("product", form, "no such thing\n"))
    with pytest.raises(ForeignFileError, match="gives no rows"):
        recording.run(("orbits", "sp3", sp3_head(["G05"]) + "EOF\n"))
    late = whole_sp3().replace("2020  7 12", "2020  7 19")
    with pytest.raises(ForeignFileError, match=r"of 2020-07-19T00:00.* not the log's time"):
        recording.run(("orbits", "sp3", late), options='margin = "24 h"')
    with pytest.raises(ForeignFileError, match="time system"):
        recording.run(("orbits", "sp3", whole_sp3().replace("cc GPS", "cc XYZ")))


def two_days(step_m: float, frame: str = "IGb14", clock_us: float = 0.0) -> tuple[str, str]:
    """A day that ends at midnight and one that begins there; the second is off by a step."""
    moved = (A[0] + step_m / 1e3, A[1], A[2])
    first = (
        sp3_head(["G05"], day=11) + sp3_epoch(1425, day=11) + sp3_row("G05", B, 1.0)
        + sp3_epoch(0) + sp3_row("G05", A, 2.0) + "EOF\n"
    )  # fmt: skip
    second = (
        sp3_head(["G05"], frame=frame) + sp3_epoch(0) + sp3_row("G05", moved, 2.0 + clock_us)
        + sp3_epoch(15) + sp3_row("G05", B, 3.0) + "EOF\n"
    )  # fmt: skip
    return first, second


@pytest.mark.parametrize("turned", [False, True])
def test_days_that_meet(recording: small.Recording, turned: bool) -> None:
    days = two_days(0.25)
    files = [("orbits", "sp3", day) for day in (days[::-1] if turned else days)]
    result = recording.run(*files)
    assert result.exit_code is ExitCode.OK
    rows = recording.read(ORBIT)
    assert seconds(rows).tolist() == [-900.0, 0.0, 900.0]
    assert rows["position_ecef_m"][1, 0] == pytest.approx(A[0] * 1e3 + 0.25, abs=1e-6)
    (note,) = (note for note in result.notes if ORBIT in note)
    assert "1 rows stand in two files and 1 differ, positions by 0.2500 m" in note
    assert "2020-07-12T00:00" in note and "begins later" in note


def test_days_that_agree_and_clocks(recording: small.Recording) -> None:
    first, second = two_days(0.0)
    result = recording.run(("orbits", "sp3", first), ("more", "sp3", second))
    assert any("1 rows stand in two files, the same in both" in note for note in result.notes)
    assert len(recording.read(ORBIT)) == 3 and len(recording.read(PRODUCTS)) == 2
    names = ("G05", "G07", "E11")
    day = clock_head() + "".join(clock_row("AS", name, 0.0, 1e-4) for name in names)
    # All clocks move by 2 ns, one by 1 ns more: only the latter is felt.
    next_day = clock_head() + "".join(
        clock_row("AS", name, 0.0, 1e-4 + 2e-9 + (1e-9 if name == "E11" else 0.0)) for name in names
    )
    next_day += clock_row("AS", "G05", 30.0, 1e-4)
    early = clock_row("AS", "G05", 86_370.0, 1e-4, day=11)
    result = recording.run(("clocks", "rinex-clk", day + early), ("clocks", "rinex-clk", next_day))
    (note,) = (note for note in result.notes if note.startswith(CLOCK))
    assert "3 differ, clocks by 2.000 ns in the middle and 0.2998 m around it" in note
    rows = recording.read(CLOCK)
    assert seconds(rows).tolist() == [-30.0, 0.0, 0.0, 0.0, 30.0]


def test_reference_frames(recording: small.Recording) -> None:
    first, second = two_days(0.0, frame="IGS14")
    result = recording.run(("orbits", "sp3", first), ("orbits", "sp3", second))
    assert result.exit_code is ExitCode.OK
    assert any("same realization" in note for note in result.notes)
    first, second = two_days(0.0, frame="IGS20")
    files = (("orbits", "sp3", first), ("orbits", "sp3", second))
    result = recording.run(*files)
    assert result.exit_code is ExitCode.LOSS
    assert any("different reference frames" in loss and "IGS20" in loss for loss in losses(result))
    with pytest.raises(ForeignFileError):
        recording.run(*files, strict=True)
    clocks = clock_head(frame="ITRF2014") + clock_row("AS", "G05", 0.0, 1e-4)
    result = recording.run(("orbits", "sp3", two_days(0.0)[0]), ("clocks", "rinex-clk", clocks))
    assert result.exit_code is ExitCode.OK


def test_a_margin_around_the_log(recording: small.Recording) -> None:
    """The log's rows are of 01:36."""
    minutes = (0, 90, 105, 180)
    text = sp3_head(["G05"], epochs=4)
    text += "".join(sp3_epoch(m) + sp3_row("G05", A, 1.0) for m in minutes) + "EOF\n"
    result = recording.run(("orbits", "sp3", text), options='margin = "30 min"')
    assert (seconds(recording.read(ORBIT)) / 60).tolist() == [90.0, 105.0]
    assert any("2 of 4 rows lie more than 1800 s" in note for note in result.notes)
    assert recording.read(PRODUCTS)["row_count"][0] == 2


def test_clocks(recording: small.Recording) -> None:
    text = (
        clock_head()
        + clock_row("AS", "G05", 0.0, -0.136260695850e-03, 0.654554563419e-11)
        + clock_row("AR", "BRUX", 0.0, 1e-7)
        + clock_row("AS", "E11", 30.0, 2.5e-4)
        + "AS G07  2020  7 12  0  0 30.000000  4    1.000000000000E-06  2.000000000000E-12\n"
        + "                                         3.000000000000E-15  4.000000000000E-18\n"
        + "DR BRUX 2020  7 12  0  0 30.000000  1    1.000000000000E-06\n"
    )
    result = recording.run(("clocks", "rinex-clk", text))
    assert result.exit_code is ExitCode.OK
    rows = recording.read(CLOCK)
    assert rows["satellite"].tolist() == [b"G05", b"", b"E11", b"G07"]
    assert rows.is_present("satellite").tolist() == [True, False, True, True]
    assert rows.ragged("station").texts() == ["", "BRUX", "", ""]
    assert seconds(rows).tolist() == [0.0, 0.0, 30.0, 30.0]
    assert rows["clock_s"].tolist() == [-0.136260695850e-03, 1e-7, 2.5e-4, 1e-6]
    np.testing.assert_allclose(rows["clock_std_s"][[0, 3]], [0.654554563419e-11, 2e-12], rtol=1e-15)
    assert rows.is_present("clock_std_s").tolist() == [True, False, False, True]
    assert any("2 lines of rates" in note for note in result.notes)
    about = recording.read(PRODUCTS)
    assert about.ragged("frame").texts() == ["IGb14"] and about.ragged("agency").texts() == ["GRG"]


def test_clocks_of_version_304(recording: small.Recording) -> None:
    """Names of nine characters, columns shifted, an exponent after D."""
    text = (
        clock_head(version=3.04).replace("GPS  ", "BDT  ")
        + "AS C19        2020 07 12 00 00 00.000000  1    1.234567890123D-04\n"
        + "AR BRUX00BEL  2020 07 12 00 00 00.000000  2   -1.234567890123456E-04  1.0E-11\n"
    )
    recording.run(("clocks", "rinex-clk", text))
    rows = recording.read(CLOCK)
    assert seconds(rows).tolist() == [14.0, 14.0]
    assert rows.ragged("station").texts() == ["", "BRUX00BEL"]
    np.testing.assert_allclose(
        rows["clock_s"], [1.234567890123e-4, -1.234567890123456e-4], rtol=4e-16
    )


@pytest.mark.parametrize(
    ("bad", "what"),
    [
        ("AS G05  2020  7 12  0  1 30.000000  1    1.0000000x0000E-06\n", "cannot be read"),
        ("AS G05  2020  7 12 25  1 30.000000  1    1.000000000000E-06\n", "cannot be read"),
        ("AS G05  2020  7 12  0  1 30.000000  2    1.000000000000E-06\n", "cannot be read"),
        ("AS 5    2020  7 12  0  1 30.000000  1    1.000000000000E-06\n", "cannot be read"),
        ("XX G05  2020  7 12  0  1 30.000000  1    1.000000000000E-06\n", "cannot be read"),
        ("         3.000000000000E-15\n", "belongs to no record"),
        ("AS G05  2020  7 12  0  0  0.000000  1    1.000000000000E-06\n", "an epoch twice"),
        ("AS G05  2020  7 12  0  1 30.000000  1    1.0000000000", "ends inside a line"),
    ],
)
def test_damaged_clocks(recording: small.Recording, bad: str, what: str) -> None:
    text = clock_head() + clock_row("AS", "G05", 0.0, 1e-4) + bad
    result = recording.run(("clocks", "rinex-clk", text))
    assert result.exit_code is ExitCode.LOSS
    assert any(what in loss and "line 8" in loss for loss in losses(result))
    assert len(recording.read(CLOCK)) == 1


def bias(
    kind: str, prn: str, station: str, first: str, second: str, value: str, *,
    unit: str = "ns", std: str = "0.0062", span: str = "2020:194:00000 2020:195:00000",
    slope: str = "",
) -> str:  # fmt: skip
    return (
        f" {kind:<4} {'G063':<4} {prn:<3} {station:<9} {first:<4} {second:<4} {span} {unit:<4} "
        f"{value:>21} {std:>11} {slope:>21}"
    ).rstrip() + "\n"


def bias_file(*rows: str, mark: str = "%=ENDBIA\n", scale: str = "G") -> str:
    return (
        "%=BIA 1.00 COD 2020:200:00000 IGS 2020:194:00000 2020:195:00000 A 00000002\n"
        "+BIAS/DESCRIPTION\n"
        " BIAS_MODE                               ABSOLUTE\n"
        f" TIME_SYSTEM                             {scale}\n"
        " SATELLITE_CLOCK_REFERENCE_OBSERVABLES   G  C1W  C2W\n"
        "-BIAS/DESCRIPTION\n"
        "+BIAS/SOLUTION\n"
        "*BIAS SVN_ PRN STATION__ OBS1 OBS2 BIAS_START____ BIAS_END______ UNIT\n"
        + "".join(rows)
        + "-BIAS/SOLUTION\n"
        + mark
    )


def test_biases(recording: small.Recording) -> None:
    text = bias_file(
        bias("OSB", "G05", "", "C1C", "", "-1.4777"),
        bias("DSB", "E11", "", "C1C", "C5Q", ".250000000000000E+01", slope="0.5"),
        bias("DSB", "G", "BRUX", "C1C", "C1W", "12.5", std=""),
        bias("OSB", "G05", "", "L1C", "", "0.25", unit="cyc"),
        bias("OSB", "G07", "", "C1C", "", "1.0", span="0000:000:00000 0000:000:00000"),
        bias("OSB", "G09", "", "C1C", "", "1.0", span="2020:194:00000 2020:194:86400"),
        bias("OSB", "G08", "", "C1C", "", "1.0", span="2019:194:00000 2019:195:00000"),
    )
    result = recording.run(("biases", "sinex-bias", text))
    assert result.exit_code is ExitCode.OK
    rows = recording.read(BIAS)
    order = np.argsort(rows["satellite"], kind="stable")
    rows = rows.take(order)
    assert rows["satellite"].tolist() == [b"", b"E11", b"G05", b"G05", b"G07", b"G09"]
    assert rows.ragged("station").texts() == ["BRUX", "", "", "", "", ""]
    assert rows.ragged("system").texts() == ["G", "E", "G", "G", "G", "G"]
    osb, dsb = products_pb2.BIAS_KIND_OSB, products_pb2.BIAS_KIND_DSB
    assert rows["kind"].tolist() == [dsb, dsb, osb, osb, osb, osb]
    assert rows.ragged("observation").texts() == ["C1C", "C1C", "C1C", "L1C", "C1C", "C1C"]
    assert rows.ragged("second_observation").texts() == ["C1W", "C5Q", "", "", "", ""]
    expected = [12.5e-9, 2.5e-9, -1.4777e-9, 0.25 / 1575.42e6, 1e-9, 1e-9]
    np.testing.assert_allclose(rows["value_s"], expected, rtol=1e-14)
    assert rows.is_present("value_std_s").tolist() == [False, True, True, True, True, True]
    assert rows["slope_s_s"][1] == pytest.approx(0.5e-9)
    day = time.parse_calendar("2020-07-12T00:00:00")
    assert rows["valid_from_ns"].tolist() == [day, day, day, day, 0, day]
    after = day + 86_400 * time.NS_PER_S
    assert rows["valid_until_ns"].tolist() == [after, after, after, after, 0, after]
    assert any("1 of 7 biases are valid at no time" in note for note in result.notes)
    about = recording.read(PRODUCTS)
    assert "clocks refer to G C1W C2W" in about.ragged("detail").texts()[0]


def test_damaged_biases(recording: small.Recording) -> None:
    good = bias("OSB", "G05", "", "C1C", "", "1.0")
    bad = [
        bias("OSB", "G05", "", "C1C", "", "1.x"),
        bias("XSB", "G05", "", "C1C", "", "1.0"),
        bias("OSB", "G", "", "C1C", "", "1.0"),
        bias("DSB", "G05", "", "C1C", "", "1.0"),
        bias("OSB", "G05", "", "C1C", "", "1.0", unit="m"),
        bias("OSB", "G05", "", "C1C", "", "1.0", span="2020:400:x0000 2020:195:00000"),
    ]
    result = recording.run(("biases", "sinex-bias", bias_file(good, *bad)))
    assert result.exit_code is ExitCode.LOSS
    assert any("6 rows" in loss and "lines 10, 11, 12, 13, 14" in loss for loss in losses(result))
    assert len(recording.read(BIAS)) == 1
    glonass = bias("OSB", "R03", "", "L1C", "", "0.5", unit="cyc")
    result = recording.run(("biases", "sinex-bias", bias_file(good, glonass)))
    assert any("depends on the channel" in loss and "line 10" in loss for loss in losses(result))
    result = recording.run(("biases", "sinex-bias", bias_file(good, mark="")))
    assert any("no end mark" in loss for loss in losses(result))


ERP = """version 2
FINAL
  MJD      Xpole   Ypole  UT1-UTC    LOD  Xsig  Ysig   UTsig  LODsig  Nr Nf Nt    Xrt    Yrt
             (10**-6")       (0.1 usec)    (10**-6")     (0.1 usec)          (10**-6"/d)
59042.50  244688  383461 -1440292  -3800     7    10       7       5 181 181 76   866  -1716
59043.50  245000  383000 -1440000   3800     7    10       7       5 181 181 76   866  -1716
"""


def test_earth_rotation(recording: small.Recording) -> None:
    result = recording.run(("rotation", "erp", ERP))
    assert result.exit_code is ExitCode.OK
    rows = recording.read(ROTATION)
    # MJD 59042 is 2020-07-12; UTC is 18 s behind GPS.
    assert seconds(rows).tolist() == [43_218.0, 129_618.0]
    arcsecond = math.pi / 648_000.0
    assert rows["polar_x_rad"][0] == pytest.approx(0.244688 * arcsecond, rel=1e-12)
    assert rows["polar_y_rad"][0] == pytest.approx(0.383461 * arcsecond, rel=1e-12)
    assert rows["ut1_utc_s"][0] == pytest.approx(-0.1440292, rel=1e-12)
    assert rows["length_of_day_s"].tolist() == pytest.approx([-3.8e-4, 3.8e-4], rel=1e-12)
    assert rows["polar_y_rate_rad_s"][0] == pytest.approx(-1.716e-3 * arcsecond / 86400, rel=1e-12)
    assert rows["polar_x_std_rad"][0] == pytest.approx(7e-6 * arcsecond, rel=1e-12)
    assert rows["ut1_utc_std_s"][0] == pytest.approx(7e-7, rel=1e-12)
    damaged = recording.run(("rotation", "erp", ERP.replace("245000", "24500x")))
    assert any("line 6" in loss for loss in losses(damaged))
    with pytest.raises(ForeignFileError, match="other columns or units"):
        recording.run(("rotation", "erp", ERP.replace("0.1 usec", "msec")))


SITE = """$$ Ocean loading displacement
$$
$$ COLUMN ORDER:  M2  S2  N2  K2  K1  O1  P1  Q1  MF  MM SSA
$$ END HEADER
$$
  {name}
$$ FES2004_PP ID: 2009-06-25 20:02:03
$$ Computed by OLMPP by H G Scherneck, Onsala Space Observatory, 2009
$$ Onsala,                    RADI TANG  lon/lat:   11.9264   57.3958
  .00352 .00123 .00080 .00032 .00187 .00112 .00063 .00003 .00082 .00044 .00037
  .00144 .00035 .00035 .00008 .00053 .00049 .00018 .00009 .00012 .00005 .00006
  .00086 .00023 .00023 .00006 .00029 .00028 .00010 .00007 .00004 .00002 .00001
   -64.7  -52.0  -96.2  -55.2  -58.8 -151.4  -65.6 -138.1    8.4    5.2    2.1
    85.5  114.5   56.5  113.6   99.4   19.1   94.1  -10.4 -167.4 -170.0 -177.7
   109.5  147.0   92.7  148.8  101.5   31.1   95.8   11.3  -22.9   -7.3    -.9
$$ END TABLE
"""


def test_ocean_loading(recording: small.Recording) -> None:
    """The example of the IERS Conventions 2010, section 7.1.2; the marker is MARK."""
    topic = "/gnss/rover/ocean_loading"
    text = SITE.format(name="ONSA") + SITE.format(name="MARK 10402M004").replace(".00352", ".00400")
    assert recording.run(("tides", "blq", text)).exit_code is ExitCode.OK
    row = recording.read(topic)
    assert row.ragged("station").texts() == ["MARK 10402M004"]
    assert row.ragged("model").texts() == ["FES2004_PP"]
    amplitude = row.ragged("amplitude_up_west_south_m").row(0).reshape(3, 11)
    phase = row.ragged("phase_up_west_south_rad").row(0).reshape(3, 11)
    np.testing.assert_allclose(amplitude[:, 0], [0.004, 0.00144, 0.00086])
    np.testing.assert_allclose(amplitude[:, 10], [0.00037, 0.00006, 0.00001])
    np.testing.assert_allclose(np.degrees(phase[:, 5]), [-151.4, 19.1, 31.1])
    recording.run(("tides", "blq", text), options='site = "onsa"')
    assert recording.read(topic).ragged("station").texts() == ["ONSA"]
    with pytest.raises(ForeignFileError, match="no station of the log"):
        recording.run(("tides", "blq", SITE.format(name="ONSA")))
    short = SITE.format(name="MARK").replace("   109.5", "        ")
    result = recording.run(
        ("tides", "blq", SITE.format(name="ROVE") + short), options='site="rove"'
    )
    assert any("six of eleven numbers" in loss and "line 22" in loss for loss in losses(result))


def ionex(hours: tuple[int, ...] = (0, 2), exponent: int = -1, scale: float = 1.0) -> str:
    """Maps of 5 latitudes and 73 longitudes: 100 + 10 row + column + 1000 hour, in units."""
    text = (
        record(f"{1.0:8.1f}{'':12}{'IONOSPHERE MAPS':<20}GPS", "IONEX VERSION / TYPE")
        + record(f"{'ADDNEQ':<20}{'AIUB':<20}", "PGM / RUN BY / DATE")
        + record("  COSZ", "MAPPING FUNCTION")
        + record("  6371.0", "BASE RADIUS")
        + record("   450.0 450.0   0.0", "HGT1 / HGT2 / DHGT")
        + record("    20.0 -20.0 -10.0", "LAT1 / LAT2 / DLAT")
        + record("  -180.0 180.0   5.0", "LON1 / LON2 / DLON")
        + record(f"{exponent:6d}", "EXPONENT")
        + record("", "END OF HEADER")
    )
    number = 0
    for kind in ("TEC", "RMS"):
        for hour in hours:
            number += 1
            text += record(f"{number:6d}", f"START OF {kind} MAP")
            text += record(f"  2020     7    12{hour:6d}     0     0", "EPOCH OF CURRENT MAP")
            for row in range(5):
                place = f"  {20.0 - 10.0 * row:6.1f}-180.0 180.0   5.0 450.0"
                text += record(place, "LAT/LON1/LON2/DLON/H")
                values = [100 + 10 * row + column % 72 + 1000 * hour for column in range(73)]
                if kind == "RMS":
                    values = [int(value * scale) // 10 for value in values]
                for at in range(0, 73, 16):
                    text += "".join(f"{value:5d}" for value in values[at : at + 16]) + "\n"
            text += record(f"{number:6d}", f"END OF {kind} MAP")
    return text + record("", "END OF FILE")


def test_ionosphere_maps(recording: small.Recording) -> None:
    absent = ionex().replace("  100  101", " 9999  101", 1)
    assert recording.run(("maps", "ionex", absent)).exit_code is ExitCode.OK
    rows = recording.read(MAPS)
    assert seconds(rows).tolist() == [18.0, 7218.0]
    assert rows["height_m"].tolist() == [450e3] * 2
    assert rows["base_radius_m"].tolist() == [6371e3] * 2
    assert rows["latitude_count"].tolist() == [5] * 2
    assert rows["longitude_count"].tolist() == [73] * 2
    np.testing.assert_allclose(np.degrees(rows["latitude_first_rad"]), 20.0)
    np.testing.assert_allclose(np.degrees(rows["latitude_step_rad"]), -10.0)
    np.testing.assert_allclose(np.degrees(rows["longitude_step_rad"]), 5.0)
    tec = rows.ragged("tec_tecu").row(1).reshape(5, 73)
    np.testing.assert_allclose(tec[3, 7], 0.1 * (100 + 30 + 7 + 2000))
    assert math.isnan(rows.ragged("tec_tecu").row(0)[0])
    np.testing.assert_allclose(rows.ragged("rms_tecu").row(1)[3 * 73 + 7], 0.1 * 213)
    about = recording.read(PRODUCTS)
    assert about.ragged("kind").texts() == ["COSZ"] and about["interval_s"][0] == 7200.0


def test_damaged_maps(recording: small.Recording) -> None:
    text = ionex((0, 2, 4))
    lines = text.splitlines(keepends=True)
    starts = [k for k, line in enumerate(lines) if "START OF TEC" in line]
    for edit, kept in (
        (lambda k: lines[: k + 4] + ["x" + lines[k + 4][1:]] + lines[k + 5 :], [18.0, 14418.0]),
        (lambda k: lines[: k + 2] + lines[k + 8 :], [18.0, 14418.0]),  # a row of the map lacks
        (lambda k: lines[: starts[2] - 1] + lines[starts[2] :], [18.0, 14418.0]),  # no END
    ):
        result = recording.run(("maps", "ionex", "".join(edit(starts[1]))))
        assert result.exit_code is ExitCode.LOSS
        assert any(
            "a map cannot be read" in loss and f"line {starts[1] + 1}" in loss
            for loss in losses(result)
        )
        assert seconds(recording.read(MAPS)).tolist() == kept
    result = recording.run(("maps", "ionex", text[: len(text) // 3]))
    assert any("no END OF FILE" in loss for loss in losses(result))


FORMS = {
    "sp3": whole_sp3,
    "rinex-clk": lambda: (
        clock_head() + "".join(clock_row("AS", "G05", 30.0 * k, 1e-4, 1e-11) for k in range(5))
    ),
    "sinex-bias": lambda: bias_file(bias("OSB", "G05", "", "C1C", "", "-1.4777") * 3),
    "erp": lambda: ERP,
    "ionex": ionex,
    "blq": lambda: SITE.format(name="MARK"),
}


@pytest.mark.parametrize("form", FORMS)
def test_bytes_at_random(form: str) -> None:
    """Whatever stands in a file is read, counted as damaged or refused."""
    rng = np.random.default_rng(len(form))
    text = FORMS[form]().encode()
    late = FORMATS[form].read_late
    assert late is not None
    known = Known((), None, {"rover": "MARK"})
    outcomes = set()
    for turn in range(300):
        data = bytearray(text)
        for _ in range(1 + turn % 4):
            at = int(rng.integers(0, len(data)))
            if turn % 3 == 0:
                del data[at : at + int(rng.integers(1, 90))]
            else:
                data[at] = int(rng.integers(0, 256)) if turn % 3 == 1 else b"0 9.\n-*PVE"[turn % 10]
            data = data or bytearray(b" ")
        findings = Findings()
        try:
            found = late(File("x", bytes(data), "", 0), findings, Stream(source="x"), known)
        except ForeignFileError:
            outcomes.add("refused")
            continue
        for topic, columns in found.items():
            spec = channels.find(topic)
            assert spec is not None
            assert len(codec_for(spec.message).encode(columns)) == len(columns)
        outcomes.add("lossy" if findings.losses.losses else "read")
    assert {"refused", "lossy", "read"} <= outcomes or form in ("blq", "erp")


def test_unknown_options(recording: small.Recording) -> None:
    with pytest.raises(ConfigurationError):
        recording.run(("orbits", "sp3", whole_sp3()), options='margin = "30 m"')
