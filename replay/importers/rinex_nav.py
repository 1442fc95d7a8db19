"""RINEX navigation files, versions 2.11 to 4, as ephemerides.

Read are GPS and QZSS LNAV, GLONASS FDMA, Galileo INAV and FNAV, BeiDou D1 and D2.
Messages of other kinds and systems are counted. Of a GLONASS record, the age of
the data and what RINEX 3.05 adds in a fourth line have no field.
"""

from __future__ import annotations

import dataclasses
import re
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.errors import ForeignFileError
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.rinex_ephemeris import Clocks, Message, ephemeris
from replay.importers.rinex_files import Lines, split_lines, unpack
from replay.importers.rinex_header import MEND, header_length, read_version, split_record
from replay.kernels.ephemeris import EPHEMERIS_DTYPE

_WIDTH: Final = 19
_NUMBER: Final = re.compile(rb" *[-+]?(\d+\.?\d*|\.\d+)([DEde][-+]? ?\d{1,3})? *")
_SYSTEMS: Final = "GREJC"
_TWO_LETTER: Final = {"N": "G", "G": "R"}
_KNOWN_MESSAGES: Final = ("LNAV", "FDMA", "INAV", "FNAV", "D1", "D2", "D1D2")
_ORBIT_LINES: Final = {"R": 3}
_KEPLER_LINES: Final = 7
_KLOBUCHAR: Final = {"G": "GPS", "J": "QZS", "C": "BDS"}
_RECORD_TEXT: Final = {"EPH": "ephemerides", "STO": "time offsets", "ION": "ionosphere models"}


@dataclasses.dataclass(frozen=True, slots=True)
class TimeCorrection:
    """Polynomial between two time scales.

    Attributes
    ----------
    a0_s, a1 : float
        Offset and its rate, s and s/s.
    reference_s, week : int
        Reference time, of the scale's week.
    """

    a0_s: float
    a1: float
    reference_s: int
    week: int


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RinexNavigation:
    """A RINEX navigation file.

    Attributes
    ----------
    version : float
    ephemerides : array (n,) of EPHEMERIS_DTYPE
        Sorted by system, number, reference time; equals in the order of the file.
    ionosphere : dict of str to tuple of float
        GPSA, GPSB, GAL, BDSA, BDSB, QZSA, QZSB, ...: the last that the file gives.
    time_corrections : dict of str to TimeCorrection
        GPUT, GAUT, GAGP, ...
    leap_seconds : int or None
    records : tuple of (label, text)
        Lines of the header.
    """

    version: float
    ephemerides: npt.NDArray[Any]
    ionosphere: dict[str, tuple[float, ...]]
    time_corrections: dict[str, TimeCorrection]
    leap_seconds: int | None
    records: tuple[tuple[str, str], ...]


def read_rinex_nav(file: File, findings: Findings) -> RinexNavigation:
    """A RINEX navigation file, plain or packed.

    Raises
    ------
    ForeignFileError
        Where the header cannot be read, or the first loss where `findings` is strict.
    """
    file = unpack(file, findings)
    lines = split_lines(file)
    version, file_type, _ = read_version(lines)
    two = version < 3.0
    if int(version) not in (2, 3, 4) or file_type not in (_TWO_LETTER if two else ("N",)):
        raise ForeignFileError(
            f"RINEX {version:g} of type {file_type!r} is no navigation file that is known",
            where=f"{file.name}:1",
            mend="type N of versions 2 to 4 and type G of version 2 are read",
        )
    start = header_length(lines)
    body = _Body(lines, version, _TWO_LETTER[file_type] if two else "")
    records = tuple(split_record(lines.text(line)) for line in range(start))
    leap = body.header(records)
    body.run(start)
    body.report(findings)
    table = np.array(body.found, dtype=EPHEMERIS_DTYPE)
    order = np.lexsort((table["toe_ns"], table["prn"], table["system"]))
    return RinexNavigation(version, table[order], body.ionosphere, body.corrections, leap, records)


class _Body:
    """One pass over the records."""

    def __init__(self, lines: Lines, version: float, system: str) -> None:
        self.lines = lines
        self.version = version
        self.system = system
        self.clocks = Clocks()
        self.found: list[Any] = []
        self.ionosphere: dict[str, tuple[float, ...]] = {}
        self.corrections: dict[str, TimeCorrection] = {}
        self.damaged: list[int] = []
        self.damaged_header: list[int] = []
        self.strays: list[int] = []
        self.skipped: dict[str, list[int]] = {}
        self.cut = 0

    def header(self, records: tuple[tuple[str, str], ...]) -> int | None:
        """Ionosphere and time corrections into the body's; gives the leap seconds."""
        leap = None
        for index, (label, text) in enumerate(records):
            try:
                if label == "LEAP SECONDS":
                    leap = int(text[:6])
                elif label == "IONOSPHERIC CORR":
                    self.ionosphere[text[:4].strip()] = _numbers(text[5:], 12, 4)
                elif label in ("ION ALPHA", "ION BETA"):
                    name = "GPSA" if label == "ION ALPHA" else "GPSB"
                    self.ionosphere[name] = _numbers(text[2:], 12, 4)
                elif label == "TIME SYSTEM CORR":
                    a0, a1 = _number(text[5:22]), _number(text[22:38])
                    late = text[38:45], text[45:50]
                    self.corrections[text[:4].strip()] = _correction(a0, a1, *late)
                elif label == "DELTA-UTC: A0,A1,T,W":
                    a0, a1 = _numbers(text[3:], _WIDTH, 2)
                    late = text[41:50], text[50:59]
                    self.corrections["GPUT"] = _correction(a0, a1, *late)
                elif label == "CORR TO SYSTEM TIME":
                    a0 = _number(text[21:40])
                    self.corrections["GLUT"] = TimeCorrection(a0, 0.0, 0, 0)
            except ValueError:
                self.damaged_header.append(index + 1)
        return leap

    def run(self, start: int) -> None:
        """Every record."""
        end = len(self.lines) if self.lines.whole_end else len(self.lines) - 1
        heads = [line for line in range(start, end) if self._is_head(self.lines.raw(line))]
        first = heads[0] if heads else end
        self.strays += [n + 1 for n in range(start, first) if self.lines.raw(n).strip()]
        for head, after in zip(heads, [*heads, end][1:], strict=True):
            at_end = after == end
            while after > head + 1 and not self.lines.raw(after - 1).strip():
                after -= 1
            self._record(head, after, at_end)
        if not self.lines.whole_end and not self.cut:
            self.cut = len(self.lines)

    def report(self, findings: Findings) -> None:
        """What was not understood."""
        name = self.lines.file.name
        findings.rows("a header line cannot be read; left out", name, self.damaged_header, MEND)
        findings.rows("a navigation record is damaged; skipped", name, self.damaged, MEND)
        findings.rows("lines belong to no record; skipped", name, self.strays, MEND)
        for what, lines in self.skipped.items():
            findings.rows(f"{what} are not read", name, lines, "leave them out when converting")
        if self.cut:
            findings.rows(
                f"the file ends inside a record; {len(self.found)} whole ephemerides are kept",
                name,
                [self.cut],
                "fetch the file again; where it is whole, end it with a line end",
            )

    def _is_head(self, raw: bytes) -> bool:
        if self.version >= 4.0:
            return raw.startswith(b">")
        return raw[:2].strip() != b"" if self.version < 3.0 else raw[:1].strip() != b""

    def _record(self, head: int, after: int, at_end: bool) -> None:
        """One record from its first line to the line after its last."""
        kind, message, begin = "EPH", "", head
        if self.version >= 4.0:
            words = self.lines.text(head)[1:].split()
            kind, satellite, message = (*words, "", "", "")[:3]
            system, begin = satellite[:1], head + 1
        else:
            system = self.system or self.lines.text(head)[:1]
        unread = self._unread(kind, system, message)
        if unread:
            self.skipped.setdefault(unread, []).append(head + 1)
            return
        try:
            if kind == "EPH":
                self._ephemeris(system, begin, after)
            elif kind == "ION":
                self._ionosphere(system, message, begin, after)
            else:
                self._offset(begin, after)
        except _TooShortError:
            if at_end:
                self.cut = head + 1
            else:
                self.damaged.append(head + 1)
        except ValueError:
            self.damaged.append(head + 1)

    def _unread(self, kind: str, system: str, message: str) -> str:
        """What a record that is not read is called, or nothing."""
        if kind not in _RECORD_TEXT:
            return f"records of kind {kind!r}"
        if kind == "STO":
            return ""
        known = {*_KLOBUCHAR, "E"} if kind == "ION" else set(_SYSTEMS)
        models = ("LNAV", "D1D2", "IFNV") if kind == "ION" else _KNOWN_MESSAGES
        if system in known and (message in models or not message):
            return ""
        return f"{_RECORD_TEXT[kind]} of system {system!r} {message}".rstrip()

    def _ephemeris(self, system: str, begin: int, after: int) -> None:
        two = self.version < 3.0
        needed = _ORBIT_LINES.get(system, _KEPLER_LINES)
        if after - begin < 1 + needed:
            raise _TooShortError
        # RINEX 3.05 and 4 give GLONASS one line more.
        allowed = needed + (system == "R" and not two)
        self.strays += range(begin + allowed + 2, after + 1)
        raw = self.lines.raw(begin)
        number, stamp = (raw[0:2], raw[2:22]) if two else (raw[1:3], raw[3:23])
        clock = _fields(raw, 22 if two else 23, 3)
        orbit: list[float | None] = []
        for line in range(begin + 1, begin + 1 + needed):
            orbit += _fields(self.lines.raw(line), 3 if two else 4, 4)
        if self.version >= 4.0 and raw[:1] != system.encode():
            raise ValueError("the satellite differs from that of the record's head")
        message = Message(system, int(number), stamp, clock, orbit)
        self.found.append(ephemeris(message, self.clocks))

    def _ionosphere(self, system: str, message: str, begin: int, after: int) -> None:
        """RINEX 4: the model's numbers follow the time of the first line."""
        galileo = message == "IFNV"
        count = 2 if galileo else 3
        if after - begin < count:
            raise _TooShortError
        numbers = _fields(self.lines.raw(begin), 23, 3)
        for line in range(begin + 1, begin + count):
            numbers += _fields(self.lines.raw(line), 4, 4)
        whole = [0.0 if number is None else number for number in numbers]
        if galileo:
            self.ionosphere["GAL"] = tuple(whole[:4])
        else:
            name = _KLOBUCHAR[system]
            self.ionosphere[f"{name}A"] = tuple(whole[:4])
            self.ionosphere[f"{name}B"] = tuple(whole[4:8])

    def _offset(self, begin: int, after: int) -> None:
        """RINEX 4: time system offset, its reference time as a date."""
        if after - begin < 2:
            raise _TooShortError
        first = self.lines.raw(begin)
        name = first[24:28].decode("latin-1").strip()
        parts = first[4:23].split()
        moment = self.clocks.of("G").read(b" ".join(parts[:5]) + (parts[5] + b".0").rjust(11))
        numbers = _fields(self.lines.raw(begin + 1), 4, 3)
        a0, a1 = numbers[1], numbers[2]
        if a0 is None or not name:
            raise ValueError("no offset")
        seconds = moment // 1_000_000_000
        self.corrections[name] = TimeCorrection(
            a0, a1 or 0.0, seconds % 604_800, seconds // 604_800
        )


class _TooShortError(ValueError):
    """A record has fewer lines than its kind."""


def _correction(a0: float, a1: float, seconds: str, week: str) -> TimeCorrection:
    return TimeCorrection(a0, a1, int(seconds.strip() or 0), int(week.strip() or 0))


def _number(text: str) -> float:
    value = _value(text.encode("latin-1"))
    if value is None:
        raise ValueError("a number is missing")
    return value


def _numbers(text: str, width: int, count: int) -> tuple[float, ...]:
    """Numbers of equal width; blank ones at the end are zero."""
    values = [_value(text[n * width : (n + 1) * width].encode("latin-1")) for n in range(count)]
    return tuple(0.0 if value is None else value for value in values)


def _fields(raw: bytes, start: int, count: int) -> list[float | None]:
    """Numbers of a record's line."""
    return [_value(raw[at : at + _WIDTH]) for at in range(start, start + count * _WIDTH, _WIDTH)]


def _value(field: bytes) -> float | None:
    """A number with its exponent after D or E; None where blank."""
    if not field.strip():
        return None
    if _NUMBER.fullmatch(field) is None:
        raise ValueError("no number")
    return float(field.replace(b"D", b"E").replace(b"d", b"E").replace(b" ", b""))
