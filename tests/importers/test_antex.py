"""ANTEX: a small file by hand, the IGS's own against RTKLIB."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
import small_rinex

from replay import time
from replay.errors import ExitCode, ForeignFileError
from replay.importers import ImportResult, import_log
from replay.importers.antex import AntexFile, Calibration
from replay.importers.files import File, read_file
from replay.importers.findings import Findings
from replay.log.columns import Columns
from replay.log.reader import LogReader

TOPIC = "/gnss/antennas"
WORN = "TRM57971.00     NONE"
MM = 1e-3


def record(text: str, label: str) -> str:
    return f"{text:<60}{label}\n"


def numbers(first: str, values: list[float]) -> str:
    return f"{first:>8}" + "".join(f"{value:8.2f}" for value in values) + "\n"


def frequency(name: str, offset: tuple[float, ...], rows: list[tuple[str, list[float]]]) -> str:
    text = record(f"   {name}", "START OF FREQUENCY")
    text += record("".join(f"{part:10.2f}" for part in offset), "NORTH / EAST / UP")
    text += "".join(numbers(*row) for row in rows)
    return text + record(f"   {name}", "END OF FREQUENCY")


def antenna(
    name: str, *frequencies: str, azimuth: float = 0.0, satellite: str = "", more: str = ""
) -> str:
    serial = f"{satellite:<20}{'G037':<10}1993-032A " if satellite else f"{'':40}"
    return (
        record("", "START OF ANTENNA")
        + record(f"{name:<20}{serial}", "TYPE / SERIAL NO")
        + record(
            "ROBOT               X                        5    26-JUN-15", "METH / BY / # / DATE"
        )
        + record(f"  {azimuth:6.1f}", "DAZI")
        + record(f"  {0:6.1f}{90:6.1f}{45:6.1f}", "ZEN1 / ZEN2 / DZEN")
        + record(f"{len(frequencies):6d}", "# OF FREQUENCIES")
        + more
        + "".join(frequencies)
        + record("", "END OF ANTENNA")
    )


HEADER = (
    record(f"{1.4:8.1f}{'':12}M", "ANTEX VERSION / SYST")
    + record("A", "PCV TYPE / REFANT")
    + record("", "END OF HEADER")
)
MEAN = ("NOAZI", [0.0, -1.25, 2.5])
TURN = [("0.0", [0.0, 1.0, 2.0]), ("180.0", [0.0, -1.0, -2.0]), ("360.0", [0.0, 1.0, 2.0])]
PLAIN = frequency("G01", (1.5, -0.25, 80.0), [MEAN])
WHOLE = antenna(
    WORN, frequency("G01", (1.5, -0.25, 80.0), [MEAN, *TURN]),
    frequency("R 2", (0.0, 0.0, 90.0), [MEAN, *TURN]), azimuth=180.0,
)  # fmt: skip
OTHER = antenna("AOAD/M_T        NONE", PLAIN)


def validity(start: str, end: str = "") -> str:
    return record(start, "VALID FROM") + (record(end, "VALID UNTIL") if end else "")


def day(year: int, month: int, last: bool = False) -> str:
    return f"{year:6}{month:6}{1:6}" + (
        "    23    59   59.9999999" if last else "     0     0    0.0000000"
    )


EARLY = antenna(
    "BLOCK IIA", PLAIN, satellite="G01", more=validity(day(1992, 11), day(2009, 1, True))
)
NOW = antenna("BLOCK IIF", PLAIN, satellite="G01", more=validity(day(2011, 7)))


class Case:
    """A small recording with an ANTEX file, and what its import gives."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.spec = small_rinex.write(folder)
        text = small_rinex.SPEC.replace(
            "[streams.rover]", '[streams.antennas]\nsource = "antennas"\n\n[streams.rover]'
        )
        self.spec.write_text(text + '\n[sources.antennas]\nfile = "small.atx"\nformat = "antex"\n')

    def run(self, antex: str | bytes, *, strict: bool = False) -> ImportResult:
        data = antex if isinstance(antex, bytes) else antex.encode()
        (self.folder / "small.atx").write_bytes(data)
        return import_log(self.spec, self.folder, self.folder / "out.mcap", strict=strict)

    def edit(self, old: str, new: str) -> None:
        for path in (self.spec, self.folder / "rover.obs"):
            path.write_text(path.read_text().replace(old, new))

    def read(self) -> Columns:
        with LogReader(self.folder / "out.mcap") as log:
            return log.read(TOPIC)


@pytest.fixture
def case(tmp_path: Path) -> Case:
    return Case(tmp_path)


@pytest.mark.parametrize("packed", [False, True])
def test_the_antennas_of_the_receivers_come_with_every_number(case: Case, packed: bool) -> None:
    text = HEADER + OTHER + WHOLE + EARLY + NOW
    result = case.run(gzip.compress(text.encode()) if packed else text, strict=True)
    assert result.exit_code is ExitCode.OK and result.rows[TOPIC] == 2
    rows = case.read()
    assert rows.ragged("antenna").texts() == [WORN, WORN]
    assert rows.ragged("serial").texts() == ["", ""]
    assert rows.ragged("frequency").texts() == ["G01", "R02"]
    np.testing.assert_allclose(rows["offset_neu_m"], MM * np.array([[1.5, -0.25, 80], [0, 0, 90]]))
    angles = [rows[f"zenith_{name}_rad"][0] for name in ("start", "end", "step")]
    np.testing.assert_allclose(angles, [0.0, np.pi / 2, np.pi / 4])
    np.testing.assert_allclose(rows["azimuth_step_rad"], np.pi)
    np.testing.assert_allclose(rows.ragged("pattern_m").row(0), MM * np.array(MEAN[1]))
    due = MM * np.concatenate([row for _, row in TURN])
    np.testing.assert_allclose(rows.ragged("azimuth_pattern_m").row(1), due)
    assert rows["valid_from_ns"].tolist() == rows["valid_until_ns"].tolist() == [0, 0]
    # Known from the first row of the log on, the receiver's antenna being known there too.
    assert set(rows.log_time_ns.tolist()) == set(rows.valid_time_ns.tolist()) == {small_rinex.FIRST}


def test_satellites_come_where_they_are_asked_for_and_valid(case: Case) -> None:
    case.edit('source = "antennas"', 'source = "antennas"\nsatellites = true')
    case.run(HEADER + WHOLE + EARLY + NOW, strict=True)
    rows = case.read()
    assert rows.ragged("antenna").texts() == [WORN, WORN, "BLOCK IIF"]
    assert rows.ragged("serial").texts()[-1] == "G01"
    assert rows["valid_from_ns"][-1] == time.parse_calendar("2011-07-01T00:00:00")
    assert len(rows.ragged("azimuth_pattern_m").row(2)) == 0


def test_the_end_of_validity_is_read_to_a_hundred_nanoseconds() -> None:
    found = read(HEADER + EARLY).read((), satellites=True, span_ns=None)
    due = time.parse_calendar("2009-01-01T23:59:59.9999999")
    assert [part.valid_until_ns for part in found] == [due]
    assert not found[0].within((due + 1, due + 2)) and found[0].within((due, due + 2))
    assert not found[0].within((0, found[0].valid_from_ns - 1))


def read(text: str, findings: Findings | None = None) -> AntexFile:
    data = text.encode()
    return AntexFile(File("x.atx", data, "", len(data)), findings or Findings())


def test_without_its_radome_the_bare_antenna_serves_and_a_note_says_so(case: Case) -> None:
    case.edit("TRM57971.00     NONE", "TRM57971.00     SNOW")
    result = case.run(HEADER + WHOLE, strict=True)
    assert case.read().ragged("antenna").texts() == [WORN, WORN]
    assert any(
        "TRM57971.00     SNOW is not calibrated" in note and WORN in note for note in result.notes
    )


def test_a_file_that_has_none_of_the_antennas_is_named(case: Case) -> None:
    with pytest.raises(ForeignFileError, match="no antenna of the log") as caught:
        case.run(HEADER + OTHER)
    assert WORN in caught.value.mend


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("   -1.25", "   -1.2x", 12),  # a number
        ("    2.50", "        ", 12),  # one number too few
        ("NORTH / EAST / UP", "COMMENT", 16),  # a record is missing, told at the end
        ("     2                ", "     3                ", 24),  # a frequency too few
        ("   180.0    0.00", "   170.0    0.00", 14),  # an azimuth that is not the next
    ],
)
def test_a_damaged_record_leaves_its_antenna_out(case: Case, old: str, new: str, line: int) -> None:
    """Whole, and the line is named; another one comes all the same."""
    case.edit('source = "antennas"', 'source = "antennas"\nsatellites = true')
    text = WHOLE.replace(old, new, 1)
    assert text != WHOLE
    result = case.run(HEADER + text + NOW)
    assert result.exit_code is ExitCode.LOSS
    (loss,) = result.losses.losses
    assert "antenna left out" in loss.what and loss.count == 1
    assert loss.where.endswith(f"small.atx, line {line}")
    assert case.read().ragged("antenna").texts() == ["BLOCK IIF"]
    with pytest.raises(ForeignFileError, match="antenna left out"):
        case.run(HEADER + text + NOW, strict=True)


def test_an_antenna_without_an_end_is_left_out() -> None:
    findings = Findings()
    text = HEADER + OTHER + WHOLE[: WHOLE.rindex("   R 2")]
    found = read(text, findings).read(
        {WORN, "AOAD/M_T        NONE"}, satellites=False, span_ns=None
    )
    assert [part.antenna for part in found] == ["AOAD/M_T        NONE"]
    (loss,) = findings.losses.losses
    assert loss.where == f"x.atx, line {4 + OTHER.count(chr(10))}"


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("A        ", "R        ", "relative"),
        ("     1.4", "     9.9", "no ANTEX"),
        ("ANTEX VERSION / SYST", "RINEX VERSION / TYPE", "no ANTEX"),
    ],
)
def test_another_kind_of_file_is_refused(old: str, new: str, what: str) -> None:
    assert old in HEADER
    with pytest.raises(ForeignFileError, match=what):
        read(HEADER.replace(old, new, 1) + WHOLE)


@pytest.fixture(scope="module")
def igs14(shared_data: Path) -> Path:
    path = shared_data / "antex" / "igs14.atx.gz"
    if not path.exists():
        pytest.skip(f"the calibrations of the IGS are not here: {path}")
    return path


def test_the_igss_numbers_are_rtklibs(igs14: Path, tmp_path: Path) -> None:
    """Offsets and mean patterns on L1 and L2 of all receivers' antennas that both read."""
    rtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
    plain = tmp_path / "igs14.atx"
    plain.write_bytes(gzip.decompress(igs14.read_bytes()))
    theirs = rtklib.pcvs_t()
    assert rtklib.readpcv(str(plain), theirs) == 1
    findings = Findings()
    antex = AntexFile(read_file(igs14, findings, mend=""), findings)
    ours: dict[tuple[str, str], Calibration] = {
        (part.antenna, part.frequency): part
        for part in antex.read(antex.receivers, satellites=False, span_ns=None)
    }
    assert not findings.losses.losses
    assert len(antex.receivers) > 350
    compared = 0
    for k in range(0, theirs.n, 7):
        pcv = theirs.pcv[k]
        name = str(pcv.type[0]).rstrip()
        if pcv.sat or name not in antex.receivers:
            continue
        for place, text in enumerate(("G01", "G02")):
            part = ours.get((name, text))
            if part is None:
                continue
            east, north, up = (pcv.off[place, axis] for axis in range(3))
            assert part.offset_neu_m == pytest.approx((north, east, up), abs=1e-9)
            count = len(part.pattern_m)
            if part.zenith_rad[2] == pytest.approx(np.radians(5.0)):
                due = [pcv.var[place, i] for i in range(count)]
                assert part.pattern_m == pytest.approx(due, abs=1e-9)
            compared += 1
    assert compared > 50


def test_the_igss_satellites_of_a_day_are_one_for_each_place_in_orbit(igs14: Path) -> None:
    findings = Findings()
    antex = AntexFile(read_file(igs14, findings, mend=""), findings)
    noon = time.parse_calendar("2021-01-01T12:00:00")
    found = antex.read((), satellites=True, span_ns=(noon, noon))
    first = [part.serial for part in found if part.serial[0] == "G" and part.frequency == "G01"]
    assert len(first) == len(set(first)) and len(first) >= 31
    assert {part.serial[0] for part in found} >= set("GREC")
    # A whole antenna lies some decimetres to metres before the centre of mass.
    assert all(0.0 < part.offset_neu_m[2] < 4.0 for part in found if part.serial[0] == "G")
