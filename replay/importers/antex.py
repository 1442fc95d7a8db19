"""ANTEX files: phase centres of receivers' and satellites' antennas.

Rothacher and Schmid, "ANTEX: The Antenna Exchange Format, Version 1.4", 2010. Absolute
patterns are read, of the antennas that are asked for. An antenna with a record that cannot
be read is left out whole: with a frequency less another one would stand in for it.
"""

from __future__ import annotations

import dataclasses
import datetime
import math
import re
from collections.abc import Collection
from typing import Final

from replay import time
from replay.errors import ForeignFileError
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.rinex_files import Lines, split_lines, unpack
from replay.importers.rinex_header import MEND, split_record

_VERSIONS: Final = (1.3, 1.4)
_M_PER_MM: Final = 0.001
_WIDTH: Final = 8
_NAME: Final = slice(0, 20)
_SERIAL: Final = slice(20, 40)
_CODE: Final = slice(40, 50)
_SATELLITE: Final = re.compile(r"[GRECJIS]\d\d")
_FREQUENCY: Final = re.compile(r"[GRECJIS]\d\d")
_SAME: Final = 1e-6


@dataclasses.dataclass(frozen=True, slots=True)
class Calibration:
    """One antenna on one frequency.

    Attributes
    ----------
    antenna, serial, frequency : str
        `serial` is the satellite, empty for the type of a receiver's antenna.
    offset_neu_m : tuple of 3 float
        North, east, up; of a satellite x, y, z.
    zenith_rad : tuple of 3 float
        First, last, step.
    azimuth_step_rad : float
    pattern_m, azimuth_pattern_m : tuple of float
        The latter row by row of one azimuth.
    valid_from_ns, valid_until_ns : int
        GPS time, 0 for always.
    """

    antenna: str
    serial: str
    frequency: str
    offset_neu_m: tuple[float, ...]
    zenith_rad: tuple[float, float, float]
    azimuth_step_rad: float
    pattern_m: tuple[float, ...]
    azimuth_pattern_m: tuple[float, ...]
    valid_from_ns: int
    valid_until_ns: int

    def within(self, span_ns: tuple[int, int] | None) -> bool:
        """Whether it is valid at some time of a span."""
        if span_ns is None:
            return True
        ended = self.valid_until_ns and self.valid_until_ns < span_ns[0]
        return not ended and self.valid_from_ns <= span_ns[1]


@dataclasses.dataclass(frozen=True, slots=True)
class _Block:
    """Lines of one antenna; `serial` is empty for a receiver's type, `end` -1 for no end."""

    antenna: str
    serial: str
    satellite: bool
    start: int
    end: int


class AntexFile:
    """An ANTEX file, its antennas found but not read yet.

    Parameters
    ----------
    file : File
        Plain or packed.
    findings : Findings

    Raises
    ------
    ForeignFileError
        Where it is not ANTEX of a known version with absolute patterns.
    """

    def __init__(self, file: File, findings: Findings) -> None:
        self._file = unpack(file, findings)
        self._findings = findings
        self._lines = split_lines(self._file)
        self._blocks = self._find(self._header())

    @property
    def receivers(self) -> frozenset[str]:
        """Types of receivers' antennas."""
        return frozenset(b.antenna for b in self._blocks if not b.satellite and not b.serial)

    def read(
        self, antennas: Collection[str], *, satellites: bool, span_ns: tuple[int, int] | None
    ) -> list[Calibration]:
        """Calibrations in the order of the file.

        Parameters
        ----------
        antennas : collection of str
            Types of receivers' antennas.
        satellites : bool
            Read those of all satellites too.
        span_ns : tuple of 2 int, or None
            Leave out what is not valid in this time.
        """
        found: list[Calibration] = []
        damaged: list[int] = []
        open_ended: list[int] = []
        for block in self._blocks:
            if not (satellites if block.satellite else block.antenna in antennas):
                continue
            if block.serial and not block.satellite:
                text = f"{self._file.name}: {block.antenna} {block.serial} is one piece, left out"
                self._findings.notes.append(text)
                continue
            if block.end < 0:
                open_ended.append(block.start + 1)
                continue
            reader = _Reader(self._lines, block)
            try:
                found += [part for part in reader.run() if part.within(span_ns)]
            except (ValueError, IndexError):
                damaged.append(reader.line + 1)
        what = "a record of an antenna cannot be read; antenna left out"
        self._findings.rows(what, self._file.name, damaged, MEND)
        what = "an antenna has no end; antenna left out"
        self._findings.rows(what, self._file.name, open_ended, MEND)
        return found

    def _header(self) -> int:
        """Check it; gives the line after it."""
        version, absolute = math.nan, False
        for line in range(len(self._lines)):
            label, text = split_record(self._lines.text(line))
            if label == "ANTEX VERSION / SYST":
                version = _float(text[:8])
            elif label == "PCV TYPE / REFANT":
                absolute = text[:1] == "A"
                if not absolute:
                    raise ForeignFileError(
                        f"the patterns are relative to {text[20:40].strip() or 'AOAD/M_T'}",
                        where=f"{self._file.name}:{line + 1}",
                        mend="take a file with absolute ones, PCV TYPE A",
                    )
            elif label == "END OF HEADER":
                break
        else:
            line = len(self._lines) - 1
        if version not in _VERSIONS or not absolute:
            raise ForeignFileError(
                "the file is no ANTEX with absolute patterns of version 1.3 or 1.4",
                where=f"{self._file.name}:1",
                mend="name an ANTEX file such as igs14.atx",
            )
        return line + 1

    def _find(self, first: int) -> list[_Block]:
        blocks: list[_Block] = []
        start, named, nameless = -1, ("", "", False), []
        for line in range(first, len(self._lines)):
            text = self._lines.raw(line)
            label = text[60:].rstrip()
            if label == b"START OF ANTENNA":
                if start >= 0:
                    blocks.append(_Block(*named, start, -1))
                start, named = line, ("", "", False)
            elif label == b"TYPE / SERIAL NO" and start >= 0:
                named = _named(self._lines.text(line))
            elif label == b"END OF ANTENNA" and start >= 0:
                blocks.append(_Block(*named, start, line))
                if not named[0]:
                    nameless.append(start + 1)
                start = -1
        if start >= 0:
            blocks.append(_Block(*named, start, -1))
        what = "an antenna has no name; antenna left out"
        self._findings.rows(what, self._file.name, nameless, MEND)
        return blocks


def _named(text: str) -> tuple[str, str, bool]:
    """Antenna, serial number or satellite, and whether it is a satellite's."""
    serial = text[_SERIAL].strip()
    satellite = bool(_SATELLITE.fullmatch(serial)) and bool(text[_CODE].strip())
    return text[_NAME].rstrip(), serial, satellite


class _Reader:
    """One pass over the lines of an antenna; `line` is where it stands."""

    def __init__(self, lines: Lines, block: _Block) -> None:
        self.lines = lines
        self.block = block
        self.line = block.start
        self.azimuth_step = 0.0
        self.zenith = (0.0, 0.0, 0.0)
        self.valid_ns = [0, 0]
        self.offset: tuple[float, ...] = ()
        self.mean: tuple[float, ...] = ()
        self.rows: list[tuple[float, ...]] = []

    def run(self) -> list[Calibration]:
        """Its frequencies.

        Raises
        ------
        ValueError, IndexError
            Where a record cannot be read or one is missing.
        """
        found: list[Calibration] = []
        expected, frequency, statistics = -1, "", False
        for line in range(self.block.start + 1, self.block.end):
            self.line = line
            label, text = split_record(self.lines.text(line))
            if label == "START OF FREQ RMS":
                statistics = True
            elif label == "END OF FREQ RMS":
                statistics = False
            elif statistics or label == "COMMENT":
                continue
            elif label == "DAZI":
                self.azimuth_step = _float(text[:8])
            elif label == "ZEN1 / ZEN2 / DZEN":
                start, end, step = (_float(text[k : k + 6]) for k in (2, 8, 14))
                self.zenith = (start, end, step)
            elif label == "# OF FREQUENCIES":
                expected = int(text[:6])
            elif label in ("VALID FROM", "VALID UNTIL"):
                self.valid_ns[label == "VALID UNTIL"] = _moment(text)
            elif label == "START OF FREQUENCY":
                frequency = text[3:6].replace(" ", "0")
                _need(_FREQUENCY.fullmatch(frequency) is not None)
                self.offset, self.mean, self.rows = (), (), []
            elif label == "NORTH / EAST / UP":
                self.offset = tuple(_M_PER_MM * _float(text[k : k + 10]) for k in (0, 10, 20))
            elif label == "END OF FREQUENCY":
                _need(text[3:6].replace(" ", "0") == frequency)
                found.append(self._calibration(frequency))
                frequency = ""
            elif frequency:
                self._values(self.lines.text(self.line))
        self.line = self.block.end
        _need(len(found) == expected)
        return found

    def _values(self, text: str) -> None:
        """A line of a pattern, which may be longer than a label's place."""
        start, end, step = self.zenith
        _need(step > 0.0 and end > start)
        count = round((end - start) / step) + 1
        _need(abs(start + (count - 1) * step - end) < _SAME)
        numbers = tuple(
            _M_PER_MM * _float(text[at : at + _WIDTH])
            for at in range(_WIDTH, _WIDTH * (count + 1), _WIDTH)
        )
        _need(not text[_WIDTH * (count + 1) :].strip())
        if text[:_WIDTH].strip() == "NOAZI":
            self.mean = numbers
        else:
            azimuth = len(self.rows) * self.azimuth_step
            _need(self.azimuth_step > 0.0 and abs(_float(text[:_WIDTH]) - azimuth) < _SAME)
            self.rows.append(numbers)

    def _calibration(self, frequency: str) -> Calibration:
        _need(len(self.offset) == 3 and len(self.mean) > 0)
        if self.azimuth_step > 0.0:
            _need(abs((len(self.rows) - 1) * self.azimuth_step - 360.0) < _SAME)
        start, end, step = (math.radians(angle) for angle in self.zenith)
        return Calibration(
            self.block.antenna,
            self.block.serial,
            frequency,
            self.offset,
            (start, end, step),
            math.radians(self.azimuth_step),
            self.mean,
            tuple(number for row in self.rows for number in row),
            *self.valid_ns,
        )


def _need(true: bool) -> None:
    if not true:
        raise ValueError


def _float(text: str) -> float:
    """A number; the format's are plain and finite."""
    number = float(text)
    _need(math.isfinite(number))
    return number


def _moment(text: str) -> int:
    """Year, month, day, hour, minute, second of GPS time to nanoseconds."""
    year, month, day, hour, minute = (int(text[k : k + 6]) for k in range(0, 30, 6))
    minutes = time.from_calendar(datetime.datetime(year, month, day, hour, minute))
    return minutes + round(_float(text[30:43]) * time.NS_PER_S)
