"""RINEX navigation: small files by hand, real ones against RTKLIB."""

import datetime
import random
from pathlib import Path

import numpy as np
import pytest

from replay.errors import ForeignFileError
from replay.importers.files import File, read_file
from replay.importers.findings import Findings
from replay.importers.rinex_nav import RinexNavigation, TimeCorrection, read_rinex_nav
from replay.kernels.ephemeris import EPHEMERIS_DTYPE

DATA = Path(__file__).parents[2] / ".." / "shared" / "data"
S = 1_000_000_000
WEEK = 604_800 * S
KEPLER = ("crs", "delta_n", "m0", "cuc", "eccentricity", "cus", "sqrt_a", "toe_s", "cic", "omega0",
          "cis", "i0", "crc", "omega", "omega_dot", "i_dot")  # fmt: skip


def gps_ns(*parts: int) -> int:
    delta = datetime.datetime(*parts) - datetime.datetime(1980, 1, 6)
    return (delta.days * 86_400 + delta.seconds) * S


def file_of(text: str | bytes) -> File:
    data = text.encode() if isinstance(text, str) else text
    return File("x.nav", data, "", len(data))


def record(text: str, label: str) -> str:
    return f"{text:<60}{label}\n"


def head(version: str, kind: str, *records: tuple[str, str]) -> str:
    text = record(f"{version:>9}{'':11}{kind:<20}M", "RINEX VERSION / TYPE")
    return text + "".join(record(*one) for one in records) + record("", "END OF HEADER")


def field(number: float | None, letter: str = "E") -> str:
    return " " * 19 if number is None else f"{number:19.12E}".replace("E", letter)


def body(first: str, numbers: list[float | None], indent: int, letter: str = "E") -> str:
    """First line with 3 numbers, then 4 to a line."""
    text = first + "".join(field(n, letter) for n in numbers[:3]) + "\n"
    for at in range(3, len(numbers), 4):
        row = "".join(field(n, letter) for n in numbers[at : at + 4])
        text += " " * indent + row.rstrip() + "\n"
    return text


# Week 2114, Sunday 2020-07-12; 5280 s is 01:28.
def kepler(toe_s: float, last: list[float | None]) -> list[float | None]:
    clock: list[float | None] = [2.25e-5, 4.5e-12, 0.125]
    orbit: list[float | None] = [17.0, *(n + 0.5 for n in range(1, 8)), toe_s]
    orbit += [n + 0.5 for n in range(9, 17)]
    return clock + orbit + last


GPS_LAST: list[float | None] = [1.0, 2114.0, 0.0, 2.4, 63.0, -1e-8, 529.0, 5000.0, 4.0]
GLONASS: list[float | None] = [
    -1.5e-4, 9.5e-13, 3600.0, 1.5, 2.5, 3.5e-9, 1.0, 4.5, 5.5, 6.5e-9, -7.0, 7.5, 8.5, 9.5e-9, 2.0,
]  # fmt: skip


def check_kepler(e: np.void, system: str, prn: int, toe_s: float) -> None:
    assert (chr(e["system"]), e["prn"], e["toe_s"]) == (system, prn, toe_s)
    for n, name in enumerate(KEPLER, 1):
        assert e[name] == (toe_s if name == "toe_s" else n + 0.5)
    assert (e["af0"], e["af1"], e["af2"], e["iode"]) == (2.25e-5, 4.5e-12, 0.125, 17)


def check_gps(e: np.void, system: str, prn: int) -> None:
    check_kepler(e, system, prn, 7200.0)
    assert e["toc_ns"] == e["toe_ns"] == gps_ns(2020, 7, 12, 2)
    assert e["transmitted_ns"] == gps_ns(2020, 7, 12) + 5000 * S
    assert (e["accuracy_m"], e["health"], e["group_delay_1_s"], e["iodc"]) == (2.4, 63, -1e-8, 529)


def check_glonass(e: np.void, prn: int) -> None:
    assert (chr(e["system"]), e["prn"], e["frequency_channel"], e["health"]) == ("R", prn, -7, 1)
    assert e["toe_ns"] == e["toc_ns"] == gps_ns(2020, 7, 12, 1, 15, 18)
    assert e["transmitted_ns"] == gps_ns(2020, 7, 12, 1, 0, 18)
    assert (e["af0"], e["af1"]) == (-1.5e-4, 9.5e-13)
    assert e["position_m"].tolist() == [1500.0, 4500.0, 7500.0]
    assert e["velocity_m_s"].tolist() == [2500.0, 5500.0, 8500.0]
    assert e["acceleration_m_s2"].tolist() == [3.5e-9 * 1e3, 6.5e-9 * 1e3, 9.5e-9 * 1e3]
    assert e["iode"] == (4500 + 10_800) // 900 and e["toe_s"] == 4500.0


@pytest.mark.parametrize("letter", ["D", "E", "d"])
def test_rinex_2_gps(letter: str) -> None:
    text = head(
        "2.11",
        "N: GPS NAV DATA",
        ("  " + "   .1118D-07   .0000D+00  -.5960D-07   .0000D+00", "ION ALPHA"),
        ("  " + "   .9011D+05   .0000D+00  -.1966D+06   .0000D+00", "ION BETA"),
        (
            "   " + "  .133179128170D-06  .107469588780D-12   552960     2114",
            "DELTA-UTC: A0,A1,T,W",
        ),
        ("    18", "LEAP SECONDS"),
    ) + body(" 6 20  7 12  2  0  0.0", kepler(7200.0, GPS_LAST), 3, letter)
    got = read_rinex_nav(file_of(text), Findings(strict=True))
    check_gps(got.ephemerides[0], "G", 6)
    assert got.ephemerides.dtype == EPHEMERIS_DTYPE and got.ephemerides[0]["fit_s"] == 14_400
    assert got.ionosphere["GPSA"] == (1.118e-8, 0.0, -5.96e-8, 0.0)
    assert got.ionosphere["GPSB"] == (90110.0, 0.0, -196600.0, 0.0)
    assert got.time_corrections == {
        "GPUT": TimeCorrection(1.3317912817e-7, 1.0746958878e-13, 552_960, 2114)
    }
    assert got.leap_seconds == 18 and got.version == 2.11


def test_rinex_2_glonass() -> None:
    text = head("2.10", "GLONASS NAV DATA") + body(" 3 20  7 12  1 15  0.0", GLONASS, 3, "D")
    got = read_rinex_nav(file_of(text), Findings(strict=True))
    check_glonass(got.ephemerides[0], 3)


def mixed(version: str) -> str:
    """One ephemeris of each system, in the wrong order."""
    four = version.startswith("4")

    def one(satellite: str, stamp: str, message: str, numbers: list[float | None]) -> str:
        top = f"> EPH {satellite} {message}\n" if four else ""
        return top + body(f"{satellite} {stamp}", numbers, 4)

    text = one("R24", "2020 07 12 01 15 00", "FDMA",
               GLONASS + ([1.0, None, 0.0, 0.0] if version > "3.04" else []))  # fmt: skip
    text += one("J02", "2020 07 12 02 00 00", "LNAV",
                kepler(7200.0, [*GPS_LAST[:8], 0.0]))  # fmt: skip
    text += one("E05", "2020 07 12 01 50 00", "INAV",
                kepler(6600.0, [517.0, 2114.0, None, 3.12, 0.0, -1e-9, -2e-9,
                                0.9999e9]))  # fmt: skip
    text += one("C21", "2020 07 11 23 59 46", "D1",
                kepler(604_786.0, [None, 757.0, None, 2.0, 1.0, 3e-9, 4e-9, 0.0, 5.0]))  # fmt: skip
    text += one("S20", "2020 07 12 02 00 00", "SBAS", GLONASS)
    return text + one("G06", "2020 07 12 02 00 00", "LNAV", kepler(7200.0, GPS_LAST))


def check_mixed(got: RinexNavigation, findings: Findings) -> None:
    e = got.ephemerides
    assert [chr(s) for s in e["system"]] == list("CEGJR")
    beidou, galileo, gps, qzss, glonass = e
    check_gps(gps, "G", 6)
    assert gps["fit_s"] == 14_400
    check_gps(qzss, "J", 2)
    assert qzss["fit_s"] == 7200
    check_glonass(glonass, 24)
    check_kepler(galileo, "E", 5, 6600.0)
    assert galileo["toe_ns"] == gps_ns(2020, 7, 12, 1, 50) and galileo["transmitted_ns"] == 0
    assert (galileo["source"], galileo["accuracy_m"]) == (517, 3.12)
    assert (galileo["group_delay_1_s"], galileo["group_delay_2_s"]) == (-1e-9, -2e-9)
    check_kepler(beidou, "C", 21, 604_786.0)
    assert beidou["toe_ns"] == beidou["toc_ns"] == gps_ns(2020, 7, 12)
    assert beidou["transmitted_ns"] == gps_ns(2020, 7, 12, 0, 0, 14)
    assert (beidou["accuracy_m"], beidou["health"], beidou["iodc"]) == (2.0, 1, 5)
    assert (beidou["group_delay_1_s"], beidou["group_delay_2_s"]) == (3e-9, 4e-9)
    assert "ephemerides of system 'S'" in str(findings.losses.losses[0])


@pytest.mark.parametrize("version", ["3.03", "3.05"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_rinex_3(version: str, line_end: str) -> None:
    text = head(
        version,
        "N: GNSS NAV DATA",
        ("GAL    6.6250e+01 -1.6410e-01 -2.4720e-03  0.0000e+00", "IONOSPHERIC CORR"),
        ("BDSA   1.1180E-08  0.0000E+00 -5.9600E-08  0.0000E+00 A 05", "IONOSPHERIC CORR"),
        ("GAGP  2.3574102670E-09 3.996802889E-15 345600 2111", "TIME SYSTEM CORR"),
        ("    18    18  2185     7GPS", "LEAP SECONDS"),
    ) + mixed(version)
    findings = Findings()
    got = read_rinex_nav(file_of(text.replace("\n", line_end)), findings)
    check_mixed(got, findings)
    assert len(findings.losses.losses) == 1
    assert got.ionosphere == {
        "GAL": (66.25, -0.1641, -0.002472, 0.0), "BDSA": (1.118e-8, 0.0, -5.96e-8, 0.0),
    }  # fmt: skip
    assert got.time_corrections["GAGP"] == TimeCorrection(
        2.357410267e-9, 3.996802889e-15, 345_600, 2111
    )


def test_rinex_4() -> None:
    text = head("4.00", "NAVIGATION DATA") + mixed("4.00")
    text += body("> EPH G06 CNAV\nG06 2020 07 12 02 00 00", kepler(7200.0, GPS_LAST), 4)
    text += body("> ION G07 LNAV\n    2020 07 12 02 00 00", [float(n) for n in range(1, 10)], 4)
    text += body("> ION E07 IFNV\n    2020 07 12 02 00 00", [1.0, 2.0, 3.0, 0.0], 4)
    text += (
        "> STO G07 LNAV\n    2020 07 12 00 00 02 GPUT                                UTC(USNO)\n"
    )
    text += "    " + "".join(field(n) for n in (5000.0, 1e-9, 2e-15, 0.0)) + "\n"
    text += "> EOP J04 CNVX\n    2020 07 12 00 00 02\n"
    findings = Findings()
    got = read_rinex_nav(file_of(text), findings)
    check_mixed(got, findings)
    assert got.ionosphere == {
        "GPSA": (1.0, 2.0, 3.0, 4.0), "GPSB": (5.0, 6.0, 7.0, 8.0), "GAL": (1.0, 2.0, 3.0, 0.0),
    }  # fmt: skip
    assert got.time_corrections == {"GPUT": TimeCorrection(1e-9, 2e-15, 2, 2114)}
    text_of_losses = "\n".join(str(loss) for loss in findings.losses.losses)
    assert "ephemerides of system 'G' CNAV are not read: 1 rows" in text_of_losses
    assert "records of kind 'EOP' are not read: 1 rows" in text_of_losses
    assert len(findings.losses.losses) == 3


def gps_file(count: int = 4) -> bytes:
    text = head("3.04", "N: GNSS NAV DATA")
    for n in range(count):
        text += body(f"G{n + 1:02d} 2020 07 12 02 00 00", kepler(7200.0, GPS_LAST), 4)
    return text.encode()


def test_truncation_keeps_whole_records() -> None:
    data = gps_file()
    whole = read_rinex_nav(file_of(data), Findings(strict=True)).ephemerides
    start = data.index(b"END OF HEADER\n") + 14
    for cut in range(start, len(data), 11):
        findings = Findings()
        got = read_rinex_nav(file_of(data[:cut]), findings).ephemerides
        lines = data[start:cut].count(b"\n")
        assert got.tobytes() == whole[: lines // 8].tobytes()
        if lines % 8 or not data[:cut].endswith(b"\n"):
            assert f"{lines // 8} whole ephemerides" in str(findings.losses.losses[0])
        else:
            assert not findings.losses
    with pytest.raises(ForeignFileError, match="inside a record"):
        read_rinex_nav(file_of(data[:-3]), Findings(strict=True))


def test_damaged_characters_are_counted() -> None:
    data = gps_file()
    whole = read_rinex_nav(file_of(data), Findings()).ephemerides
    start = data.index(b"END OF HEADER\n") + 14
    choose = random.Random(3)
    for _ in range(200):
        at = choose.randrange(start, len(data) - 1)
        if data[at : at + 1] == b"\n":
            continue
        findings = Findings()
        got = read_rinex_nav(file_of(data[:at] + b"#" + data[at + 1 :]), findings).ephemerides
        kept = {int(e["prn"]): e.tobytes() for e in got}
        assert kept.items() <= {int(e["prn"]): e.tobytes() for e in whole}.items()
        assert len(kept) >= 2
        assert len(kept) == 4 or findings.losses


def test_a_missing_line_costs_one_record() -> None:
    lines = gps_file().splitlines(keepends=True)
    for at in range(10, 17):
        findings = Findings()
        got = read_rinex_nav(file_of(b"".join(lines[:at] + lines[at + 1 :])), findings)
        assert len(got.ephemerides) == 3
        assert "line 11" in str(findings.losses.losses[0]) or at == 10


def test_what_is_no_navigation_file() -> None:
    for text in ("", "hello\n", head("3.04", "OBSERVATION DATA"), head("3.04", "N")[:70]):
        with pytest.raises(ForeignFileError):
            read_rinex_nav(file_of(text), Findings())


@pytest.mark.parametrize(
    "name",
    [
        "riverside-drive-2020-193/rover.nav",
        "nl-network-2021-001/AMEL00NLD_R_20210010000_01D_MN.rnx.gz",
        "tokyo-rtk-2021-265/SEPT2650.21P.gz",
        "tokyo-car-2020-310/base_GQ_L1.nav",
        "tokyo-car-2020-310/base.nav",
        "ppp-esbc-2020-177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
    ],
)
def test_real_files_against_rtklib(name: str, tmp_path: Path) -> None:
    rtk = pytest.importorskip("pyrtklib", reason="pyrtklib is not installed")
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is absent")
    file = read_file(path, Findings(strict=True), mend="")
    got = read_rinex_nav(file, Findings())
    plain = tmp_path / "x.nav"
    plain.write_bytes(file.data)
    nav = rtk.nav_t()
    assert rtk.readrnx(str(plain), 1, "", rtk.obs_t(), nav, rtk.sta_t()) == 1
    letters = {rtk.SYS_GPS: "G", rtk.SYS_GLO: "R", rtk.SYS_GAL: "E", rtk.SYS_CMP: "C",
               rtk.SYS_QZS: "J"}  # fmt: skip
    prn = rtk.Arr1Dint(1)

    def ns(moment: object) -> int:
        seconds = (moment.time - 315_964_800) * S  # type: ignore[attr-defined]
        return int(seconds + round(moment.sec * 1e9))  # type: ignore[attr-defined]

    def identity(sat: int) -> tuple[int, int]:
        letter = letters[rtk.satsys(sat, prn)]
        return ord(letter), prn[0] - (192 if letter == "J" else 0)

    kepler_ = got.ephemerides[got.ephemerides["system"] != ord("R")]
    theirs = [nav.eph[n] for n in range(nav.n)]
    theirs.sort(key=lambda e: (*identity(e.sat), ns(e.toe)))
    assert len(kepler_) == len(theirs)
    pairs = {"crs": "crs", "delta_n": "deln", "m0": "M0", "cuc": "cuc", "eccentricity": "e",
             "cus": "cus", "toe_s": "toes", "cic": "cic", "omega0": "OMG0", "cis": "cis",
             "i0": "i0", "crc": "crc", "omega": "omg", "omega_dot": "OMGd", "i_dot": "idot",
             "af0": "f0", "af1": "f1", "af2": "f2", "iode": "iode", "iodc": "iodc",
             "health": "svh"}  # fmt: skip
    for ours, e in zip(kepler_, theirs, strict=True):
        assert (ours["system"], ours["prn"]) == identity(e.sat)
        for mine, other in pairs.items():
            assert ours[mine] == getattr(e, other), (mine, ours["prn"])
        assert ours["sqrt_a"] * ours["sqrt_a"] == e.A
        assert (ours["toe_ns"], ours["toc_ns"]) == (ns(e.toe), ns(e.toc))
        assert ours["transmitted_ns"] in (0, ns(e.ttr))
        assert ours["group_delay_1_s"] == e.tgd[0]
        if chr(ours["system"]) in "EC":
            assert ours["group_delay_2_s"] == e.tgd[1]
        if chr(ours["system"]) == "E":
            assert ours["source"] == e.code
        if chr(ours["system"]) == "G":
            assert ours["fit_s"] == e.fit * 3600
    glonass = got.ephemerides[got.ephemerides["system"] == ord("R")]
    theirs = [nav.geph[n] for n in range(nav.ng)]
    theirs.sort(key=lambda g: (*identity(g.sat), ns(g.toe)))
    assert len(glonass) == len(theirs)
    for ours, g in zip(glonass, theirs, strict=True):
        assert (ours["system"], ours["prn"]) == identity(g.sat)
        assert (ours["toe_ns"], ours["transmitted_ns"]) == (ns(g.toe), ns(g.tof))
        assert (ours["af0"], ours["af1"]) == (-g.taun, g.gamn)
        assert ours["position_m"].tolist() == [g.pos[k] for k in range(3)]
        assert ours["velocity_m_s"].tolist() == [g.vel[k] for k in range(3)]
        assert ours["acceleration_m_s2"].tolist() == [g.acc[k] for k in range(3)]
        assert (ours["frequency_channel"], ours["health"]) == (g.frq, g.svh)
        assert ours["iode"] == g.iode
    if "GPSA" in got.ionosphere:
        both = got.ionosphere["GPSA"] + got.ionosphere["GPSB"]
        assert both == tuple(nav.ion_gps[k] for k in range(8))
    if "GAL" in got.ionosphere:
        assert got.ionosphere["GAL"] == tuple(nav.ion_gal[k] for k in range(4))
