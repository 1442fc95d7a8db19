"""NMEA 0183 sentences as fixes.

GGA gives time of day, place, quality; RMC and ZDA the date; GST the deviations. A
velocity is left out: sentences give none that is vertical. Times are of UTC. pynmeagps
is the reference of the tests.
"""

from __future__ import annotations

import collections
import datetime
import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from replay import channels, time
from replay.errors import ForeignFileError
from replay.importers import frames as framing
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.geodesy import Places
from replay.importers.receiver_rows import fix_columns, truth_of_fixes
from replay.log.columns import Columns
from replay.schemas import gnss_pb2

_READ: Final = ("GGA", "RMC", "ZDA", "GST")
_DAY_NS: Final = 86_400 * time.NS_PER_S
_UNIX_DAY: Final = datetime.date(1970, 1, 1).toordinal()
_RAD: Final = math.pi / 180.0
_QUALITY: Final[dict[int, int]] = {
    1: gnss_pb2.FIX_QUALITY_SINGLE,
    2: gnss_pb2.FIX_QUALITY_DGNSS,
    3: gnss_pb2.FIX_QUALITY_SINGLE,
    4: gnss_pb2.FIX_QUALITY_RTK_FIXED,
    5: gnss_pb2.FIX_QUALITY_RTK_FLOAT,
    6: gnss_pb2.FIX_QUALITY_FUSED,
}
# Where there is no GST: metres of one unit of HDOP, by quality.
_METRES: Final[dict[int, float]] = {
    gnss_pb2.FIX_QUALITY_SINGLE: 3.0,
    gnss_pb2.FIX_QUALITY_DGNSS: 1.0,
    gnss_pb2.FIX_QUALITY_RTK_FIXED: 0.02,
    gnss_pb2.FIX_QUALITY_RTK_FLOAT: 0.5,
    gnss_pb2.FIX_QUALITY_FUSED: 3.0,
}
_VERTICAL: Final = 1.5  # deviation of heights over that of places, where nothing says it


def read_nmea(
    file: File,
    findings: Findings,
    *,
    receiver: str,
    lever_arm_m: Sequence[float] = (0.0, 0.0, 0.0),
    approximate_ns: int | None = None,
    truth: bool = False,
) -> dict[str, Columns]:
    """Fixes of a file of sentences, which may lie among other protocols.

    Parameters
    ----------
    file : File
    findings : Findings
        Sentences whose check fails or whose fields cannot be read are losses.
    receiver : str
        Name in the topics.
    lever_arm_m : sequence of 3 float, m
        IMU to antenna, body.
    approximate_ns : int, optional
        GPS nanoseconds within half a day of the first GGA, for files without a date.
    truth : bool
        Whether the fixes are given as truth too.

    Raises
    ------
    ForeignFileError
        Where the file holds no fix, or no date and none is given.
    """
    frames = framing.scan(file, framing.NMEA, findings)
    run = _Run()
    offsets, lengths = frames.of(framing.NMEA)
    for row, (at, length) in enumerate(zip(offsets.tolist(), lengths.tolist(), strict=True)):
        run.sentence(row, at, file.data[at + 1 : at + length].partition(b"*")[0].decode("latin-1"))
    if run.damaged:
        lines = [file.data.count(b"\n", 0, at) + 1 for at in run.damaged]
        what = "fields of a sentence cannot be read; skipped"
        findings.rows(what, file.name, lines, "is it NMEA 0183?")
    if run.unread:
        kinds = ", ".join(f"{kind}: {n}" for kind, n in sorted(run.unread.items()))
        findings.notes.append(f"{file.name}: sentences that are not read: {kinds}")
    framing.note_others(file, frames, framing.NMEA, findings)
    if not run.places:
        raise ForeignFileError(
            "the file holds no GGA sentence with a fix", where=file.name, mend="record GGA"
        )
    times = run.times(approximate_ns)
    if times is None:
        raise ForeignFileError(
            "no RMC or ZDA sentence tells the date",
            where=file.name,
            mend='give `approximate_time = "2025-08-28T17:30:00"` in the stream, GPS time '
            "within half a day",
        )
    fix = run.columns(times, lever_arm_m, file, findings)
    found = {channels.GNSS_FIX.at(receiver=receiver): fix}
    if truth:
        found[channels.TRUTH.topic] = truth_of_fixes(fix)
    return found


class _Run:
    """Sentences in the order of the file."""

    def __init__(self) -> None:
        self.rows: list[int] = []
        self.of_day: list[int] = []
        self.places: list[tuple[float, float, float]] = []
        self.quality: list[int] = []
        self.count: list[int] = []
        self.hdop: list[float] = []
        self.age: list[float] = []
        self.dates: list[tuple[int, int]] = []  # sentence, UTC nanoseconds since 1970
        self.deviations: list[tuple[int, int, tuple[float, float, float]]] = []
        self.unread: collections.Counter[str] = collections.Counter()
        self.damaged: list[int] = []
        self.empty = 0

    def sentence(self, row: int, offset: int, text: str) -> None:
        """One sentence without its check."""
        fields = text.split(",")
        kind = fields[0][2:]
        if kind not in _READ or fields[0].startswith("P"):
            self.unread[fields[0]] += 1
            return
        try:
            if kind == "GGA":
                self._gga(row, fields)
            elif kind == "RMC" and fields[1] and fields[9]:
                day, month, year = (int(fields[9][k : k + 2]) for k in (0, 2, 4))
                year += 1900 if year >= 80 else 2000
                self._date(row, year, month, day, fields[1])
            elif kind == "ZDA" and fields[1] and fields[4]:
                self._date(row, int(fields[4]), int(fields[3]), int(fields[2]), fields[1])
            elif kind == "GST" and fields[1] and all(fields[6:9]):
                north, east, up = (float(field) for field in fields[6:9])
                self.deviations.append((row, _of_day(fields[1]), (east, north, up)))
        except (ValueError, IndexError):
            self.damaged.append(offset)

    def _gga(self, row: int, fields: list[str]) -> None:
        quality = int(fields[6] or 0)
        if quality not in _QUALITY or not fields[2]:
            self.empty += 1
            return
        moment = _of_day(fields[1])
        latitude, longitude = _degrees(fields[2], 2), _degrees(fields[4], 3)
        place = (
            -latitude if fields[3] == "S" else latitude,
            -longitude if fields[5] == "W" else longitude,
            float(fields[9]) + float(fields[11] or 0.0),
        )
        used = int(fields[7]) if fields[7] else -1
        hdop = float(fields[8]) if fields[8] else 1.0
        age = float(fields[13]) if fields[13] else math.nan
        self.rows.append(row)
        self.of_day.append(moment)
        self.places.append(place)
        self.quality.append(_QUALITY[quality])
        self.count.append(used)
        self.hdop.append(hdop)
        self.age.append(age)

    def _date(self, row: int, year: int, month: int, day: int, clock: str) -> None:
        days = datetime.date(year, month, day).toordinal() - _UNIX_DAY
        self.dates.append((row, days * _DAY_NS + _of_day(clock)))

    def times(self, approximate_ns: int | None) -> list[int] | None:
        """GPS nanoseconds of each place, on the day that the nearest date tells."""
        if self.dates:
            at = np.array([row for row, _ in self.dates])
            place = np.searchsorted(at, self.rows)
            before = np.maximum(place - 1, 0)
            after = np.minimum(place, len(at) - 1)
            rows = np.array(self.rows)
            near = np.where(rows - at[before] <= at[after] - rows, before, after)
            references = [self.dates[k][1] for k in near.tolist()]
        elif approximate_ns is not None:
            leap_ns = time.leap_seconds(approximate_ns) * time.NS_PER_S
            start = approximate_ns - leap_ns + 315_964_800 * time.NS_PER_S
            references = []
            for of_day in self.of_day:
                references.append(start)
                start = _nearest(of_day, start)
        else:
            return None
        return [
            time.from_unix(_nearest(of_day, reference))
            for of_day, reference in zip(self.of_day, references, strict=True)
        ]

    def columns(
        self, times: list[int], lever_arm_m: Sequence[float], file: File, findings: Findings
    ) -> Columns:
        """Rows of `replay.GnssFix`."""
        if self.empty:
            findings.notes.append(f"{file.name}: {self.empty} GGA sentences hold no fix")
        place = np.array(self.places)
        places = Places.from_geodetic(place[:, 0] * _RAD, place[:, 1] * _RAD, place[:, 2])
        std = np.array(
            [
                (h * _METRES[q], h * _METRES[q], h * _METRES[q] * _VERTICAL)
                for h, q in zip(self.hdop, self.quality, strict=True)
            ]
        )
        stated = self._stated()
        for row, deviation in stated.items():
            std[row] = deviation
        bare = len(std) - len(stated)
        if bare:
            findings.notes.append(
                f"{file.name}: {bare} fixes have no GST; their deviation is HDOP times 3 m "
                "(single), 1 m (differential), 0.5 m (float) or 0.02 m (fixed), heights 1.5 of it"
            )
        covariance = np.zeros((len(std), 6))
        covariance[:, [0, 3, 5]] = std * std
        return fix_columns(
            np.array(times, dtype=np.int64),
            places,
            covariance,
            np.array(self.quality, dtype=np.int64),
            lever_arm_m,
            satellite_count=np.array(self.count, dtype=np.int64),
            differential_age_s=np.array(self.age),
        )

    def _stated(self) -> dict[int, tuple[float, float, float]]:
        """Deviations of places: the nearest GST of the same time of day."""
        by_time: dict[int, list[int]] = {}
        for index, (_, of_day, _) in enumerate(self.deviations):
            by_time.setdefault(of_day, []).append(index)
        found = {}
        for number, (row, of_day) in enumerate(zip(self.rows, self.of_day, strict=True)):
            same = by_time.get(of_day, [])
            if same:
                nearest = min(same, key=lambda k: abs(self.deviations[k][0] - row))
                found[number] = self.deviations[nearest][2]
        return found


def _of_day(text: str) -> int:
    """`173021.75` as nanoseconds of the day."""
    head, _, fraction = text.partition(".")
    if len(head) != 6 or not head.isdigit() or (fraction and not fraction.isdigit()):
        raise ValueError("no time of day")
    seconds = int(head[:2]) * 3600 + int(head[2:4]) * 60 + int(head[4:])
    return seconds * time.NS_PER_S + int((fraction + "0" * 9)[:9])


def _degrees(text: str, whole: int) -> float:
    """`4005.8014957`: degrees and minutes."""
    return int(text[:whole]) + float(text[whole:]) / 60.0


def _nearest(of_day: int, reference: int) -> int:
    return of_day + (reference - of_day + _DAY_NS // 2) // _DAY_NS * _DAY_NS
