"""Epochs of a RINEX observation file: where their satellites stand, and events."""

from __future__ import annotations

import dataclasses
import datetime
import re
from typing import Final

import numpy as np

from replay import time
from replay.importers.findings import Findings
from replay.importers.rinex_files import Int64, Lines
from replay.importers.rinex_header import MEND, ObservationHeader, amend_header, split_record

_UNIX_DAY: Final = datetime.date(1970, 1, 1).toordinal()
_GPS_EPOCH_UNIX_NS: Final = int((time.GPS_EPOCH.toordinal() - _UNIX_DAY) * 86_400 * time.NS_PER_S)
_MINUTE_NS: Final = 60 * time.NS_PER_S
_BDT_BEHIND_S: Final = 14  # BDS-SIS-ICD 2.1, 3.3: BDT began with UTC at 2006, GPS - UTC being 14 s
_UTC_SCALES: Final = ("GLO", "UTC")
_SECONDS: Final = re.compile(rb" *(\d{1,2})\.(\d{1,9}) *")
_YEAR_PIVOT: Final = 80

FLAG_POWER_FAILURE: Final = 1
FLAG_NEW_HEADER: Final = 4
FLAG_CYCLE_SLIPS: Final = 6
_LAST_OBSERVATION_FLAG: Final = 1
_FIRST_NUMBERED_SATELLITE: Final = 32  # of a RINEX 2 epoch line
_SATELLITES_PER_LINE: Final = 12
_FIELDS_PER_LINE: Final = 5


@dataclasses.dataclass(frozen=True, slots=True)
class Event:
    """A record that is no observation: epoch flags 2 to 6.

    Attributes
    ----------
    line : int
        Of the epoch line, from 1.
    flag : int
    valid_time_ns : int or None
        None where the epoch line has no time.
    text : str
        The lines that follow it.
    """

    line: int
    flag: int
    valid_time_ns: int | None
    text: str


@dataclasses.dataclass(slots=True)
class Epochs:
    """What a walk over the body found.

    Attributes
    ----------
    times_ns, flags, lines : list of int
        Of each epoch of observations; lines from 1.
    clock_offsets_s : list of float
        NaN where absent.
    headers : list of ObservationHeader
        In force one after the other: an event may bring new lines.
    satellite_positions, satellite_lines : list of int
        Byte of each satellite's number, first line of its record (from 0).
    satellite_counts : list of int
        Of each epoch.
    header_numbers : list of int
        Of each epoch, into `headers`.
    events : list of Event
    """

    headers: list[ObservationHeader]
    times_ns: list[int] = dataclasses.field(default_factory=list)
    flags: list[int] = dataclasses.field(default_factory=list)
    lines: list[int] = dataclasses.field(default_factory=list)
    clock_offsets_s: list[float] = dataclasses.field(default_factory=list)
    satellite_positions: list[int] = dataclasses.field(default_factory=list)
    satellite_lines: list[int] = dataclasses.field(default_factory=list)
    satellite_counts: list[int] = dataclasses.field(default_factory=list)
    header_numbers: list[int] = dataclasses.field(default_factory=list)
    events: list[Event] = dataclasses.field(default_factory=list)


@dataclasses.dataclass(frozen=True, slots=True)
class _Head:
    """An epoch line."""

    time_ns: int | None
    flag: int
    count: int
    offset_s: float


class Clock:
    """Calendar epochs of one time system to GPS nanoseconds."""

    def __init__(self, system: str) -> None:
        self._utc = system in _UTC_SCALES
        self._ahead_ns = _BDT_BEHIND_S * time.NS_PER_S if system == "BDT" else 0
        self._minutes: dict[bytes, int] = {}

    def read(self, text: bytes) -> int:
        """Date, hour, minute and seconds; years of two digits are of 1980 to 2079.

        Raises
        ------
        ValueError
            Where they cannot be read.
        """
        minute_text, seconds_text = text[:-11], text[-11:]
        minute = self._minutes.get(minute_text)
        if minute is None:
            minute = self._minutes[minute_text] = self._minute(minute_text)
        match = _SECONDS.fullmatch(seconds_text)
        if match is None or int(match[1]) > 60:
            raise ValueError("no seconds")
        return minute + int(match[1]) * time.NS_PER_S + int(match[2].ljust(9, b"0"))

    def _minute(self, text: bytes) -> int:
        year, month, day, hour, minute = (int(part) for part in text.split())
        if year < 100:
            year += 1900 if year >= _YEAR_PIVOT else 2000
        if not (1980 <= year < 2200 and 0 <= hour < 24 and 0 <= minute < 60):
            raise ValueError("no date")
        days = datetime.date(year, month, day).toordinal() - _UNIX_DAY
        unix_ns = (days * 1440 + hour * 60 + minute) * _MINUTE_NS
        if self._utc:
            return time.from_unix(unix_ns)
        return unix_ns - _GPS_EPOCH_UNIX_NS + self._ahead_ns


def walk_epochs(lines: Lines, start: int, header: ObservationHeader, findings: Findings) -> Epochs:
    """Every whole epoch after the header; what is between them is counted."""
    walk = _Walk(lines, start, header)
    walk.run()
    name = lines.file.name
    findings.rows("the epoch line cannot be read; epoch skipped", name, walk.unreadable, MEND)
    findings.rows(
        "an epoch has fewer or more lines than it says; epoch skipped", name, walk.uneven, MEND
    )
    findings.rows(
        "lines that belong to no epoch were skipped; these follow one that can be read",
        name,
        walk.strays,
        MEND,
    )
    findings.rows("a header line in an event cannot be read", name, walk.damaged, MEND)
    if walk.cut:
        findings.rows(
            f"the file ends inside an epoch; {len(walk.found.times_ns)} whole epochs are kept",
            name,
            [walk.cut],
            "fetch the file again; where it is whole, end it with a line end",
        )
    return walk.found


class _Walk:
    """One pass over the lines of the body, epoch by epoch."""

    def __init__(self, lines: Lines, start: int, header: ObservationHeader) -> None:
        self.lines = lines
        self.two = header.version < 3.0
        self.clock = Clock(header.time_system)
        self.found = Epochs([header])
        self.unreadable: list[int] = []
        self.uneven: list[int] = []
        self.strays: list[int] = []
        self.damaged: list[int] = []
        self.cut = 0
        # A last line without an end may lack digits as well as its end.
        self.end = len(lines) if lines.whole_end else len(lines) - 1
        self.marks = _marks(lines, self.two)
        self.marks = self.marks[(self.marks >= start) & (self.marks < self.end)]
        self.at = start

    def run(self) -> None:
        """Walk to the end."""
        while self.at < self.end:
            if len(self.lines.raw(self.at).strip()) == 0:
                self.at += 1
                continue
            head = self._head(self.at)
            if head is None:
                self._skip()
            else:
                self._take(head)
        if not self.lines.whole_end and not self.cut:
            self.cut = len(self.lines)

    def _next_mark(self, line: int) -> int:
        index = int(np.searchsorted(self.marks, line))
        return int(self.marks[index]) if index < len(self.marks) else self.end

    def _skip(self) -> None:
        """Pass what cannot be read, up to the next epoch line."""
        index = int(np.searchsorted(self.marks, self.at))
        is_mark = index < len(self.marks) and self.marks[index] == self.at
        (self.unreadable if is_mark else self.strays).append(self.at + 1)
        self.at = self._next_mark(self.at + 1)

    def _head(self, line: int) -> _Head | None:
        """An epoch line, or None where it is not one."""
        raw = self.lines.raw(line)
        if self.two:
            stamp, flag, count, offset = raw[1:26], raw[28:29], raw[29:32], raw[68:80]
        elif raw[:1] == b">":
            stamp, flag, count, offset = raw[2:29], raw[31:32], raw[32:35], raw[41:56]
        else:
            return None
        try:
            number = int(flag)
            moment = None
            if number <= _LAST_OBSERVATION_FLAG or stamp.strip():
                moment = self.clock.read(stamp)
            satellites = int(count)
            if not (0 <= number <= FLAG_CYCLE_SLIPS and satellites >= 0):
                return None
            seconds = float(offset) if offset.strip() else float("nan")
            return _Head(moment, number, satellites, seconds)
        except ValueError:
            return None

    def _take(self, head: _Head) -> None:
        """An epoch or an event whose line was read."""
        records = head.flag <= _LAST_OBSERVATION_FLAG or head.flag == FLAG_CYCLE_SLIPS
        continued, per_satellite = 0, 1
        if self.two and records:
            continued = max(-(-head.count // _SATELLITES_PER_LINE) - 1, 0)
            types = len(next(iter(self.found.headers[-1].types.values())))
            per_satellite = -(-types // _FIELDS_PER_LINE)
        first = self.at + 1 + continued
        after = first + head.count * per_satellite
        following = self._next_mark(self.at + 1)
        if after > self.end and following == self.end:
            self.cut = self.at + 1
            self.at = self.end
        elif following < after or not self._ends_well(after, following):
            self.uneven.append(self.at + 1)
            self.at = following
        else:
            if head.flag <= _LAST_OBSERVATION_FLAG and head.time_ns is not None:
                self._observations(head, head.time_ns, first, per_satellite)
            else:
                self._event(head, first, after)
            self.at = after

    def _ends_well(self, after: int, following: int) -> bool:
        """Whether no line is too many; satellites of RINEX 2 would have each other's values.

        More than one line too many are another epoch, whose own line is damaged.
        """
        while after < following and not self.lines.raw(after).strip():
            after += 1
        return not self.two or following - after != 1 or self._head(after) is not None

    def _observations(self, head: _Head, moment: int, first: int, per_satellite: int) -> None:
        found, starts = self.found, self.lines.starts
        found.times_ns.append(moment)
        found.flags.append(head.flag)
        found.lines.append(self.at + 1)
        found.clock_offsets_s.append(head.offset_s)
        found.satellite_counts.append(head.count)
        found.header_numbers.append(len(found.headers) - 1)
        found.satellite_lines.extend(
            range(first, first + head.count * per_satellite, per_satellite)
        )
        if not self.two:
            found.satellite_positions.extend(starts[first : first + head.count].tolist())
            return
        for at in range(0, head.count, _SATELLITES_PER_LINE):
            begin = int(starts[self.at + at // _SATELLITES_PER_LINE]) + _FIRST_NUMBERED_SATELLITE
            here = min(head.count - at, _SATELLITES_PER_LINE)
            found.satellite_positions.extend(range(begin, begin + 3 * here, 3))

    def _event(self, head: _Head, first: int, after: int) -> None:
        lines = range(self.at + 1, after)
        text = "\n".join(self.lines.text(line).rstrip() for line in lines)
        self.found.events.append(Event(self.at + 1, head.flag, head.time_ns, text))
        if head.flag == FLAG_CYCLE_SLIPS:
            return
        records = [split_record(self.lines.text(line)) for line in range(first, after)]
        damaged: list[int] = []
        header = amend_header(self.found.headers[-1], records, damaged)
        self.damaged.extend(first + index + 1 for index in damaged)
        self.found.headers.append(header)


def _marks(lines: Lines, two: bool) -> Int64:
    """Lines that look like an epoch line."""
    data = lines.data
    if not two:
        long = np.flatnonzero(lines.ends > lines.starts)
        return np.asarray(long[data[lines.starts[long]] == ord(">")], dtype=np.int64)
    found = np.flatnonzero(lines.ends - lines.starts >= _FIRST_NUMBERED_SATELLITE)
    for at, allowed in (
        (18, b"."),  # no value of an observation line has its point here
        (26, b" "), (27, b" "), (28, b"0123456"), (31, b"0123456789"),
        (0, b" "), (3, b" "), (6, b" "), (9, b" "), (12, b" "),
        (2, b"0123456789"), (17, b"0123456789"),
    ):  # fmt: skip
        byte = data[lines.starts[found] + at]
        found = found[np.isin(byte, np.frombuffer(allowed, dtype=np.uint8))]
    return np.asarray(found, dtype=np.int64)
