"""RINEX observations: small files by hand, real ones against RTKLIB and a plain reader."""

import datetime
import gzip
import math
import random
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from replay.errors import ForeignFileError
from replay.importers.files import File, read_file
from replay.importers.findings import Findings
from replay.importers.rinex2_codes import rinex3_types
from replay.importers.rinex_obs import RinexObservations, read_rinex_obs

DATA = Path(__file__).parents[2] / ".." / "shared" / "data"
NAMES = ("pseudorange_m", "carrier_phase_cycles", "doppler_hz", "cn0_dbhz")
S = 1_000_000_000


def gps_ns(*parts: int) -> int:
    delta = datetime.datetime(*parts) - datetime.datetime(1980, 1, 6)
    return (delta.days * 86_400 + delta.seconds) * S


def file_of(text: str | bytes) -> File:
    data = text.encode() if isinstance(text, str) else text
    return File("x.obs", data, "", len(data))


def record(text: str, label: str) -> str:
    return f"{text:<60}{label}\n"


def head(version: str, system: str, *records: tuple[str, str]) -> str:
    first = f"{version:>9}{'':11}{'OBSERVATION DATA':<20}{system}"
    lines = [record(first, "RINEX VERSION / TYPE")]
    lines += [record(text, label) for text, label in records]
    return "".join(lines) + record("", "END OF HEADER")


def value(number: float | None, lli: str = " ", strength: str = " ") -> str:
    return (" " * 14 if number is None else f"{number:14.3f}") + lli + strength


def rows(got: RinexObservations) -> dict[tuple[int, str, str], dict[str, float]]:
    c = got.columns
    masks = {name: c.is_present(name) for name in c.present}
    found = {}
    for n in range(len(c)):
        key = (int(c.valid_time_ns[n]), c["satellite"][n].decode(), c["signal"][n].decode())
        found[key] = {name: c[name][n].item() for name in masks if masks[name][n]}
    assert list(found) == sorted(found) and len(found) == len(c)
    return found


def losses(findings: Findings) -> str:
    return "\n".join(str(loss) for loss in findings.losses.losses)


V3_RECORDS = (
    ("G    5 C1C L1C D1C S1C C2W", "SYS / # / OBS TYPES"),
    ("R    2 C1C L1C", "SYS / # / OBS TYPES"),
    ("C    2 C2I L2I", "SYS / # / OBS TYPES"),
    ("MARK", "MARKER NAME"),
    ("123                 TRIMBLE NETR9       5.37", "REC # / TYPE / VERS"),
    ("7                   TRM57971.00     NONE", "ANT # / TYPE"),
    ("  3582105.2910   532589.7313  5232754.8054", "APPROX POSITION XYZ"),
    ("        0.0550        0.0000        0.0010", "ANTENNA: DELTA H/E/N"),
    ("     1.000", "INTERVAL"),
    ("  2 R01  1 R24 -7", "GLONASS SLOT / FRQ #"),
    ("G L2W  0.25000", "SYS / PHASE SHIFT"),
    ("C   10  1 C2I", "SYS / SCALE FACTOR"),
    ("  2020     7    12     1    36   23.9940000     GPS", "TIME OF FIRST OBS"),
    ("    18", "LEAP SECONDS"),
)
V3_BODY = (
    "> 2020  7 12  1 36 23.9940000  0  3       0.000000123456\n"
    f"G 5{value(21710986.981, ' ', '1')}{value(-114092012.053, '1', '7')}"
    f"{value(-1528.782)}{value(40.5)}{value(21710990.1)}\n"
    f"R24{value(19069484.695)}{value(0.0)}\n"
    f"C11{value(230694846.95)}{value(None, '2')}\n"
    "> 2020  7 12  1 36 24.4940000  4  1\n"
    + record("G    1 C5Q", "SYS / # / OBS TYPES")
    + ">                              5  0\n"
    "> 2020  7 12  1 36 24.9940000  1  1\n"
    f"G05{value(21710000.5)}\n"
)


@pytest.mark.parametrize("version", ["3.02", "3.04", "4.01"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_rinex_3_and_4(version: str, line_end: str) -> None:
    text = head(version, "M", *V3_RECORDS) + V3_BODY
    findings = Findings(strict=True)
    got = read_rinex_obs(file_of(text.replace("\n", line_end)), findings)
    first = gps_ns(2020, 7, 12, 1, 36, 23) + 994_000_000
    assert rows(got) == {
        (first, "C11", "2I"): {"pseudorange_m": 23069484.695, "loss_of_lock": 2},
        (first, "G05", "1C"): {
            "pseudorange_m": 21710986.981,
            "carrier_phase_cycles": -114092012.053,
            "doppler_hz": -1528.782,
            "cn0_dbhz": 40.5,
            "loss_of_lock": 1,
            "signal_strength": 7,
        },
        (first, "G05", "2W"): {"pseudorange_m": 21710990.1},
        (first, "R24", "1C"): {"pseudorange_m": 19069484.695, "glonass_channel": -7},
        (first + S, "G05", "5Q"): {"pseudorange_m": 21710000.5},
    }
    assert np.isnan(got.columns["doppler_hz"][~got.columns.is_present("doppler_hz")]).all()
    assert got.epoch_flags.tolist() == [0, 1]
    assert got.clock_offsets_s[0] == 1.23456e-7 and math.isnan(got.clock_offsets_s[1])
    assert [(e.flag, e.line, e.valid_time_ns) for e in got.events] == [
        (4, 21, first + S // 2),
        (5, 23, None),
    ]
    assert "OBS TYPES" in got.events[0].text
    assert got.later_headers[0].types["G"] == ("C5Q",)
    assert any("1 values of 0.0" in note for note in findings.notes)
    h = got.header
    assert (h.version, h.file_type, h.system, h.marker) == (float(version), "O", "M", "MARK")
    assert h.receiver == ("123", "TRIMBLE NETR9", "5.37")
    assert h.antenna == ("7", "TRM57971.00     NONE")
    assert h.position_m == (3582105.2910, 532589.7313, 5232754.8054)
    assert h.antenna_delta_hen_m == (0.055, 0.0, 0.001)
    assert (h.time_system, h.interval_s, h.leap_seconds) == ("GPS", 1.0, 18)
    assert h.glonass_channels == {"R01": 1, "R24": -7}
    assert h.phase_shifts == ("G L2W  0.25000",)
    assert h.scale_factors == {("C", "C2I"): 10}
    assert h.types["R"] == ("C1C", "L1C")


@pytest.mark.parametrize(
    ("system", "offset_s"), [("GPS", 0), ("GAL", 0), ("BDT", 14), ("GLO", 18), ("UTC", 18)]
)
def test_time_systems(system: str, offset_s: int) -> None:
    first = f"  2020     7    12     1    36   23.0000000     {system}"
    text = head("3.04", "M", ("G    1 C1C", "SYS / # / OBS TYPES"), (first, "TIME OF FIRST OBS"))
    text += f"> 2020  7 12  1 36 23.1234567  0  1\nG05{value(2e7)}\n"
    got = read_rinex_obs(file_of(text), Findings(strict=True))
    want = gps_ns(2020, 7, 12, 1, 36, 23) + 123_456_700 + offset_s * S
    assert got.columns.valid_time_ns.tolist() == [want]


def test_leap_second_of_utc() -> None:
    text = head("3.04", "R", ("R    1 C1C", "SYS / # / OBS TYPES"))
    for stamp in ("2016 12 31 23 59 59", "2016 12 31 23 59 60", "2017 01 01 00 00 00"):
        text += f"> {stamp}.0000000  0  1\nR05{value(2e7)}\n"
    got = read_rinex_obs(file_of(text), Findings(strict=True))
    assert np.diff(got.columns.valid_time_ns).tolist() == [S, S]
    assert got.columns.valid_time_ns[2] == gps_ns(2017, 1, 1, 0, 0, 18)


V2_TYPES = (
    ("     7    C1    L1    L2    P2    S1    C2    T1", "# / TYPES OF OBSERV"),
    ("    14" + "".join(f"    {t}" for t in ("C1", "P1", "L1", "D1", "S1", "C2", "P2", "L2", "D2")),
     "# / TYPES OF OBSERV"),
)  # fmt: skip


def test_rinex_2() -> None:
    numbers = [None, 7, 10, *range(14, 24)]
    satellites = [f"G{n:02d}" if n else "  5" for n in numbers] + ["R 7"]
    text = head("2.11", "M", V2_TYPES[0])
    text += f" 99 12 31 23 59 59.5000000  0{len(satellites):3d}{''.join(satellites[:12])}"
    text += "  .000000789\n" + " " * 32 + "".join(satellites[12:]) + "\n"
    for n in range(len(satellites)):
        text += value(2e7 + n) + value(1e8 + n, "0", "5") + value(8e7) + value(2e7) + value(45.25)
        text += "\n" + value(2.5e7) + "\n"
    text += " " * 28 + "4  1\n" + record("a word", "COMMENT")
    text += " 00  1  1  0  0  0.5000000  6  1G05\n" + value(None) * 5 + "\n" + value(None) + "\n"
    text += " 00  1  1  0  0  1.5000000  1  1R 7\n" + value(2e7) + "\n\n"
    findings = Findings(strict=True)
    got = read_rinex_obs(file_of(text), findings)
    first = gps_ns(1999, 12, 31, 23, 59, 59) + S // 2
    found = rows(got)
    assert len(found) == 14 * 3 + 1
    assert found[first, "G05", "1C"] == {
        "pseudorange_m": 2e7,
        "carrier_phase_cycles": 1e8,
        "cn0_dbhz": 45.25,
        "loss_of_lock": 0,
        "signal_strength": 5,
    }
    assert found[first, "G23", "2W"] == {"pseudorange_m": 2e7, "carrier_phase_cycles": 8e7}
    assert found[first, "G23", "2X"] == {"pseudorange_m": 2.5e7}
    assert found[first, "R07", "2P"] == {"pseudorange_m": 2e7, "carrier_phase_cycles": 8e7}
    assert found[first, "R07", "1C"]["carrier_phase_cycles"] == 1e8 + 13
    assert found[first + 2 * S, "R07", "1C"] == {"pseudorange_m": 2e7}
    assert got.epoch_flags.tolist() == [0, 1] and got.clock_offsets_s[0] == 7.89e-7
    assert [event.flag for event in got.events] == [4, 6]


def test_rinex_2_counts_a_type_without_signal() -> None:
    text = head("2.11", "G", ("     2    C1    T1", "# / TYPES OF OBSERV"))
    text += " 20  1  1  0  0  0.0000000  0  1  5\n" + value(2e7) + value(3.0) + "\n"
    findings = Findings()
    got = read_rinex_obs(file_of(text), findings)
    assert list(rows(got).values()) == [{"pseudorange_m": 2e7}]
    assert "type T1 of system G have no field: 1 values" in losses(findings)


@pytest.mark.parametrize(
    ("system", "types", "want"),
    [
        ("G", "C1 P1 L1 C2 P2 L2 L5", "C1C C1W L1C C2X C2W L2W L5X"),
        ("G", "P1 L1 D1 C2 L2 S2", "C1W L1W D1W C2X L2X S2X"),
        ("G", "L1 L2", "L1C L2W"),
        ("R", "C1 P1 L1 C2 L2", "C1C C1P L1C C2C L2C"),
        ("E", "C1 L1 C7 L7 L8", "C1X L1X C7X L7X L8X"),
        ("C", "C1 L1 C2 L2 L7", "C1 L1 C2X L2X L7X"),
        ("J", "C1 L1 L2 L5 L6", "C1C L1C L2X L5X L6X"),
    ],
)
def test_rinex_2_codes(system: str, types: str, want: str) -> None:
    assert " ".join(rinex3_types(system, types.split())) == want


def test_types_over_several_lines_are_counted() -> None:
    thirteen = "G   14" + "".join(f" C{n}C" for n in range(1, 8)) + " L1C L2C L3C L4C L5C L6C"
    more = (thirteen, "SYS / # / OBS TYPES"), ("       L7C", "SYS / # / OBS TYPES")
    got = read_rinex_obs(file_of(head("3.04", "G", *more)), Findings(strict=True))
    assert got.header.types["G"][-1] == "L7C" and len(got.columns) == 0
    with pytest.raises(ForeignFileError, match="no observation types"):
        read_rinex_obs(file_of(head("3.04", "G", more[0])), Findings())


def small(version: str, epochs: int = 6) -> bytes:
    """Epochs of 3 satellites, 2 values each."""
    if version == "2.11":
        text = head(version, "G", ("     6    C1    L1    P2    L2    S1    S2",
                                   "# / TYPES OF OBSERV"))  # fmt: skip
        for n in range(epochs):
            text += f" 20  1  1  0  0{n:11.7f}  0  3G01G02G03\n"
            text += (value(2e7) * 5 + "\n" + value(2e7) + "\n") * 3
    else:
        text = head(version, "G", ("G    2 C1C L1C", "SYS / # / OBS TYPES"))
        for n in range(epochs):
            text += f"> 2020  1  1  0  0{n:11.7f}  0  3\n"
            text += "".join(f"G0{s}{value(2e7)}{value(1e8)}\n" for s in (1, 2, 3))
    return text.encode()


@pytest.mark.parametrize("version", ["2.11", "3.04"])
def test_truncation_keeps_whole_epochs(version: str) -> None:
    data = small(version)
    whole = rows(read_rinex_obs(file_of(data), Findings(strict=True)))
    body = data.index(b"END OF HEADER\n") + 14
    lines_of_epoch = 7 if version == "2.11" else 4
    head_lines = data[:body].count(b"\n")
    per_epoch = len(whole) // 6
    for cut in range(body, len(data), 7):
        findings = Findings()
        got = rows(read_rinex_obs(file_of(data[:cut]), findings))
        complete = data[body:cut].count(b"\n") // lines_of_epoch
        assert got == dict(list(whole.items())[: complete * per_epoch])
        rest = data[body:cut].count(b"\n") % lines_of_epoch
        if rest or not data[:cut].endswith(b"\n"):
            line = head_lines + complete * lines_of_epoch + 1
            assert f"inside an epoch; {complete} whole epochs are kept" in losses(findings)
            assert f"line {line})" in losses(findings)
        else:
            assert not findings.losses
    with pytest.raises(ForeignFileError, match="inside an epoch"):
        read_rinex_obs(file_of(data[:-3]), Findings(strict=True))


@pytest.mark.parametrize("version", ["2.11", "3.04"])
def test_a_missing_or_doubled_line_costs_one_epoch(version: str) -> None:
    data = small(version)
    whole = rows(read_rinex_obs(file_of(data), Findings()))
    lines = data.splitlines(keepends=True)
    first = lines.index(next(line for line in lines if b"END OF" in line)) + 1
    of_epoch = 7 if version == "2.11" else 4
    for at in range(first + of_epoch, first + 2 * of_epoch):
        findings = Findings()
        got = rows(read_rinex_obs(file_of(b"".join(lines[:at] + lines[at + 1 :])), findings))
        assert findings.losses
        assert {k: v for k, v in got.items() if k[0] != min(whole)[0] + S} == {
            k: v for k, v in whole.items() if k[0] != min(whole)[0] + S
        }
        assert got.items() <= whole.items()
        findings = Findings()
        got = rows(read_rinex_obs(file_of(b"".join(lines[:at] + lines[at - 1 :])), findings))
        assert findings.losses and got.items() <= whole.items()
        assert len(got) >= len(whole) * 4 // 6


@pytest.mark.parametrize("version", ["2.11", "3.04"])
def test_damaged_characters_are_counted(version: str) -> None:
    data = small(version)
    whole = rows(read_rinex_obs(file_of(data), Findings()))
    body = data.index(b"END OF HEADER\n") + 14
    choose = random.Random(1)
    for _ in range(200):
        at = choose.randrange(body, len(data) - 1)
        if data[at : at + 1] == b"\n":
            continue
        findings = Findings()
        got = rows(read_rinex_obs(file_of(data[:at] + b"#" + data[at + 1 :]), findings))
        # Blanks before a list, between fields and in an epoch line carry nothing.
        assert findings.losses or got == whole
        changed = [key for key in whole if got.get(key) != whole[key]]
        assert len({key[0] for key in changed}) <= 1
        assert got.keys() <= whole.keys()
        if findings.losses:
            line = data[:at].count(b"\n") + 1
            shown = [int(n) for n in losses(findings).split("line")[-1].strip("s )").split(",")[:1]]
            assert abs(shown[0] - line) <= 7


def test_a_number_cut_short_is_not_taken() -> None:
    text = head("3.04", "G", ("G    2 C1C L1C", "SYS / # / OBS TYPES"))
    text += "> 2020  1  1  0  0  0.0000000  0  1\nG01  20000000.0\n"
    findings = Findings()
    assert len(read_rinex_obs(file_of(text), findings).columns) == 0
    assert "a field is no number; that value left out: 1 rows (x.obs, line 5)" in losses(findings)


def test_what_is_no_observation_file() -> None:
    for text in ("", "hello\n", head("3.04", "G")[:40], head("1.00", "G")):
        with pytest.raises(ForeignFileError):
            read_rinex_obs(file_of(text), Findings())
    nav = record("     3.04           NAVIGATION DATA     M", "RINEX VERSION / TYPE")
    with pytest.raises(ForeignFileError, match="no observation file"):
        read_rinex_obs(file_of(nav), Findings())


def test_unix_compress() -> None:
    ncompress = pytest.importorskip("ncompress", reason="ncompress is not installed")
    data = small("3.04")
    got = read_rinex_obs(file_of(ncompress.compress(data)), Findings(strict=True))
    assert rows(got) == rows(read_rinex_obs(file_of(data), Findings(strict=True)))


def test_hatanaka() -> None:
    hatanaka = pytest.importorskip("hatanaka", reason="hatanaka is not installed")
    data = small("3.04")
    got = read_rinex_obs(file_of(hatanaka.rnx2crx(data)), Findings(strict=True))
    assert rows(got) == rows(read_rinex_obs(file_of(data), Findings(strict=True)))


def test_a_cut_hatanaka_file_says_where() -> None:
    hatanaka = pytest.importorskip("hatanaka", reason="hatanaka is not installed")
    packed = hatanaka.rnx2crx(small("3.04"))
    with pytest.raises(ForeignFileError, match="line"):
        read_rinex_obs(file_of(packed[: len(packed) * 3 // 4]), Findings())


def test_warnings_of_an_unpacker_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    hatanaka = pytest.importorskip("hatanaka", reason="hatanaka is not installed")
    data = small("3.04")

    def warn(packed: bytes) -> bytes:
        warnings.warn("line 7: strange epoch", stacklevel=2)
        return data

    packed = hatanaka.rnx2crx(data)
    monkeypatch.setattr(hatanaka, "crx2rnx", warn)
    findings = Findings()
    read_rinex_obs(file_of(packed), findings)
    assert "line 7: strange epoch" in losses(findings)


def test_a_missing_unpacker_names_the_mend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ncompress", None)
    with pytest.raises(ForeignFileError, match="pip install hatanaka"):
        read_rinex_obs(file_of(b"\x1f\x9d\x90abc"), Findings())


REAL = [
    "riverside-drive-2020-193/rover.obs.gz",
    "riverside-drive-2020-193/base.obs.gz",
    "nl-network-2021-001/zegv0010.21o.gz",
    "tokyo-rtk-2021-265/SEPT265G.21O.gz",
    "tokyo-rtk-2021-265/3034265G.21O.gz",
    "ppp-ccj2-2021-210/ccj22100.21o.gz",
    "ppp-esbc-2020-177/ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz",
]


def real(name: str) -> File:
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is absent")
    file = read_file(path, Findings(strict=True), mend="")
    if ".crx" in name:
        hatanaka = pytest.importorskip("hatanaka", reason="hatanaka is not installed")
        file = File(file.name, hatanaka.crx2rnx(file.data), "", 0)
    return file


@pytest.mark.parametrize("name", REAL)
def test_real_files_against_rtklib(name: str, tmp_path: Path) -> None:
    rtk = pytest.importorskip("pyrtklib", reason="pyrtklib is not installed")
    file = real(name)
    result = read_rinex_obs(file, Findings())
    found = rows(result)
    plain = tmp_path / "x.obs"
    plain.write_bytes(file.data)
    obs = rtk.obs_t()
    assert rtk.readrnx(str(plain), 1, "", obs, rtk.nav_t(), rtk.sta_t()) == 1
    slots = rtk.NFREQ + rtk.NEXOBS
    prn = rtk.Arr1Dint(1)
    letters = {rtk.SYS_GPS: "G", rtk.SYS_GLO: "R", rtk.SYS_GAL: "E", rtk.SYS_CMP: "C",
               rtk.SYS_QZS: "J", rtk.SYS_SBS: "S"}  # fmt: skip
    first_of = {"J": 192, "S": 100}
    satellites: dict[int, str] = {}
    signals = {code: rtk.code2obs(code) for code in range(70)}
    near: dict[tuple[int, str], list[tuple[str, dict[str, float]]]] = {}
    for (at, satellite, signal), row in found.items():
        near.setdefault((at, satellite), []).append((signal, row))
    compared = 0
    for n in range(obs.n):
        o = obs.data[n]
        if o.sat not in satellites:
            letter = letters[rtk.satsys(o.sat, prn)]
            satellites[o.sat] = f"{letter}{prn[0] - first_of.get(letter, 0):02d}"
        ns = (o.time.time - 315_964_800) * S + round(o.time.sec * 1e9)
        for k in range(slots):
            if not o.code[k]:
                continue
            want = (o.P[k], o.L[k], o.D[k], o.SNR[k], o.LLI[k])
            if not any(want):
                continue
            got = found[ns, satellites[o.sat], signals[o.code[k]]]
            assert got.get("pseudorange_m", 0.0) == want[0]
            if result.header.version < 3:
                # RTKLIB puts the one carrier of a RINEX 2 frequency beside whichever code it took.
                band = signals[o.code[k]][0]
                for signal, row in near[ns, satellites[o.sat]]:
                    if signal[0] == band and signal != signals[o.code[k]]:
                        got = {**row, "loss_of_lock": 0, **got}
                        if "carrier_phase_cycles" in row:
                            got["loss_of_lock"] = row.get("loss_of_lock", 0)
            assert got.get("carrier_phase_cycles", 0.0) == want[1]
            assert np.float32(got.get("doppler_hz", 0.0)) == np.float32(want[2])
            assert round(got.get("cn0_dbhz", 0.0) * 1000) == want[3]
            if want[1]:  # RTKLIB drops the digit where there is no phase
                assert int(got.get("loss_of_lock", 0)) & 3 == want[4]
            compared += 1
    assert compared > 0.35 * len(found)


@pytest.mark.parametrize("name", REAL)
def test_real_files_against_a_plain_reader(name: str) -> None:
    """Every value, those that RTKLIB has no slot for as well."""
    file = real(name)
    got = read_rinex_obs(file, Findings(strict=True))
    text = file.data.decode("latin-1").splitlines()
    c = got.columns
    keys = zip(c.valid_time_ns.tolist(), c["satellite"].tolist(), c["signal"].tolist(), strict=True)
    row_of = {key: n for n, key in enumerate(keys)}
    seen = [np.full(len(c), np.nan) for _ in NAMES]
    lli = np.full(len(c), -1)
    two = got.header.version < 3
    times = iter(got.epoch_ns.tolist())
    at = next(n for n, line in enumerate(text) if "END OF HEADER" in line) + 1
    while at < len(text):
        count = int(text[at][29:32] if two else text[at][32:35])
        now = next(times)
        at += 1
        if two:
            listed = text[at - 1][32:68]
            for _ in range((count - 1) // 12):
                listed += text[at][32:68]
                at += 1
        for n in range(count):
            satellite = (listed[3 * n : 3 * n + 3] if two else text[at][:3]).replace(" ", "0")
            types = got.header.types[satellite[0]]
            body = "" if two else text[at][3:]
            for _ in range(-(-len(types) // 5) if two else 1):
                body += f"{text[at]:<80}" if two else ""
                at += 1
            for k, kind in enumerate(types):
                field = body[16 * k : 16 * k + 16]
                if field[:14].strip() in ("", "0.000"):
                    continue
                row = row_of[now, satellite.encode(), kind[1:].encode()]
                seen["CLDS".index(kind[0])][row] = float(field[:14])
                if kind[0] == "L" and field[14:15].strip():
                    lli[row] = int(field[14])
    for name_, column in zip(NAMES, seen, strict=True):
        assert np.array_equal(column, c[name_], equal_nan=True)
    ours = np.where(c.is_present("loss_of_lock"), c["loss_of_lock"].astype(np.int64), -1)
    phase = c.is_present("carrier_phase_cycles")
    assert np.array_equal(lli[phase], ours[phase])


def test_real_file_cut_at_random_lines() -> None:
    file = real("nl-network-2021-001/zegv0010.21o.gz")
    lines = file.data.splitlines(keepends=True)[:6000]
    whole = rows(read_rinex_obs(file_of(b"".join(lines)), Findings()))
    choose = random.Random(2)
    for _ in range(10):
        cut = choose.randrange(60, len(lines))
        got = rows(read_rinex_obs(file_of(b"".join(lines[:cut])), Findings()))
        last = max((key[0] for key in got), default=0)
        assert got == {key: row for key, row in whole.items() if key[0] <= last}


def test_gzip_is_undone_by_the_file(tmp_path: Path) -> None:
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress(small("2.11")))
    file = read_file(path, Findings(strict=True), mend="")
    assert len(read_rinex_obs(file, Findings(strict=True)).epoch_ns) == 6
