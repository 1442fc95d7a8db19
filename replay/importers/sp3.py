"""SP3 files, versions a to d: precise orbits.

Hilla, "The Extended Standard Product 3 Orbit Format (SP3-d)", 2016. Positions of zero and
clocks of 999999.999999 are absent, as the format says.
"""

from __future__ import annotations

import math
import re
from typing import Final

import numpy as np

from replay import channels
from replay.errors import ForeignFileError
from replay.importers.antex_streams import Known
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.product_files import (
    About,
    first_of_each,
    missing_note,
    product_row,
    time_system,
    to_gps,
    within,
)
from replay.importers.rinex_files import Lines, split_lines, unpack
from replay.importers.rinex_header import MEND
from replay.importers.spec import Stream
from replay.kernels import product_text as text
from replay.log.columns import Columns

_M_PER_KM: Final = 1000.0
_M_S_PER_DM_S: Final = 0.1
_S_PER_US: Final = 1e-6
_BAD_CLOCK_US: Final = 999_999.0
_M_PER_MM: Final = 1e-3
_S_PER_PS: Final = 1e-12
_SATELLITE: Final = re.compile(r"([A-Z ])([ \d]\d)")


class _Header:
    """Lines before the first epoch."""

    def __init__(self, lines: Lines) -> None:
        where = f"{lines.file.name}:1"
        head = lines.text(0) if len(lines) else ""
        if re.match(r"#[abcd][PV]\d{4}", head) is None:
            raise ForeignFileError(
                "the first line is not that of an SP3 file of version a to d",
                where=where,
                mend="name an SP3 file, such as IGS0OPSFIN_…_ORB.SP3",
            )
        self.version = head[1]
        self.epochs = int(head[32:39]) if head[32:39].strip().isdigit() else -1
        self.used, self.frame = head[40:45].strip(), head[46:51].strip()
        self.orbit, self.agency = head[52:55].strip(), head[56:60].strip()
        self.satellites: list[str] = []
        self.bases = (0.0, 0.0)
        self.scale = "GPS"
        comments: list[str] = []
        systems, bases = 0, 0
        self.first = len(lines)
        for line in range(1, len(lines)):
            row = lines.text(line)
            if row.startswith("*"):
                self.first = line
                break
            if row.startswith("+ "):
                self._names(row)
            elif row.startswith("%c"):
                systems += 1
                if systems == 1 and self.version in "cd":
                    self.scale = time_system(row[9:12], f"{lines.file.name}:{line + 1}")
            elif row.startswith("%f"):
                bases += 1
                if bases == 1:
                    self.bases = (_base(row[3:13]), _base(row[14:26]))
            elif row.startswith("/*"):
                comments.append(row[2:].strip())
        self.comments = "; ".join(c for c in comments if c.strip("C"))

    def _names(self, row: str) -> None:
        for at in range(9, 60, 3):
            match = _SATELLITE.fullmatch(row[at : at + 3])
            if match and int(match[2]):
                self.satellites.append(match[1].replace(" ", "G") + match[2].replace(" ", "0"))


def _base(field: str) -> float:
    """Base of the exponents of standard deviations, 0 where none is meant."""
    try:
        value = float(field)
    except ValueError:
        return 0.0
    return value if math.isfinite(value) and value > 1.0 else 0.0


def _powers(base: float) -> np.typing.NDArray[np.float64]:
    """Powers 0 to 999 by products alone, which are the same on every machine."""
    return np.multiply.accumulate(np.concatenate([[1.0], np.full(999, min(base, 2.0))]))


def sp3_stream(file: File, findings: Findings, stream: Stream, known: Known) -> dict[str, Columns]:
    """Orbits of all satellites, in the order of their epochs.

    Raises
    ------
    ForeignFileError
        Where it is no SP3 file, or its time system is unknown.
    """
    file = unpack(file, findings)
    lines = split_lines(file)
    header = _Header(lines)
    rows = _Rows(lines, header, findings)
    times = to_gps(rows.times, header.scale)
    keep = first_of_each(times, rows.names)
    again = np.setdiff1d(np.arange(len(times)), keep)
    what = "a satellite has an epoch twice; the first is kept"
    findings.rows(what, file.name, rows.lines[again] + 1, MEND)
    findings.notes += missing_note(file.name, rows.names[keep], times, header.satellites)
    near = within(times[keep], known.span_ns, stream.margin, file.name, findings)
    if not near.any():
        return {}
    about = About(
        source=file.name.rpartition("/")[2],
        format="sp3",
        version=header.version,
        agency=header.agency,
        frame=header.frame,
        time_system=header.scale,
        kind=header.orbit,
        detail="; ".join(part for part in (header.used, header.comments) if part),
    )
    found = product_row(about, times[keep], int(near.sum()))
    found[channels.PRECISE_ORBIT.topic] = rows.columns(times).take(keep[near])
    return found


class _Rows:
    """Records as arrays; rows without position and clock are counted and left out."""

    def __init__(self, lines: Lines, header: _Header, findings: Findings) -> None:
        size = len(lines)
        self.times = np.zeros(size, dtype=np.int64)
        names = np.zeros((size, 3), dtype=np.uint8)
        self.positions, self.velocities = np.zeros((size, 3)), np.full((size, 3), np.nan)
        self.clocks = np.zeros(size)
        self.deviations = np.zeros((size, 4), dtype=np.int64)
        self.flags, self.lines = np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.int64)
        status = np.zeros(size, dtype=np.int8)
        # A last line without an end may lack digits as well as its end, but for the end mark.
        whole = lines.whole_end or lines.text(size - 1).strip() == "EOF"
        last = size if whole else size - 1
        count, epochs, end = text.parse_sp3(
            lines.data, lines.starts[:last], lines.ends[:last], header.first, self.times, names,
            self.positions, self.velocities, self.clocks, self.deviations, self.flags,
            self.lines, status,
        )  # fmt: skip
        self.bases = header.bases
        self._report(lines, header, findings, status, epochs, end)
        no_position = (self.positions[:count] == 0.0).all(axis=1)
        no_clock = ~(np.abs(self.clocks[:count]) < _BAD_CLOCK_US)
        self.positions[:count][no_position] = np.nan
        self.clocks[:count][no_clock] = np.nan
        name = lines.file.name
        for mask, what in ((no_position, "positions"), (no_clock, "clocks")):
            if mask.any():
                findings.notes.append(f"{name}: {int(mask.sum())} of {count} {what} are absent")
        kept = np.flatnonzero(~(no_position & no_clock))
        self.times, self.lines = self.times[kept], self.lines[kept]
        self.positions, self.velocities = self.positions[kept], self.velocities[kept]
        self.clocks, self.deviations = self.clocks[kept], self.deviations[kept]
        self.flags = self.flags[kept]
        self.names = np.ascontiguousarray(names[kept]).view("S3").reshape(-1)

    def _report(
        self,
        lines: Lines,
        header: _Header,
        findings: Findings,
        status: np.typing.NDArray[np.int8],
        epochs: int,
        end: int,
    ) -> None:
        name = lines.file.name
        for code, what in (
            (text.LINE_DAMAGED, "a record of an orbit cannot be read; skipped"),
            (text.LINE_STRAY, "a record belongs to no epoch or satellite; skipped"),
        ):
            findings.rows(what, name, np.flatnonzero(status == code) + 1, MEND)
        unread = int((status == text.LINE_UNREAD).sum())
        if unread:
            findings.notes.append(f"{name}: {unread} records of correlations are not read")
        if end < 0:
            findings.rows("the file has no end mark EOF; what is whole is kept", name,
                          [len(lines)], "fetch the file again")  # fmt: skip
        if header.epochs >= 0 and epochs != header.epochs:
            findings.notes.append(
                f"{name}: the header states {header.epochs} epochs, the file has {epochs}"
            )

    def columns(self, times_ns: np.typing.NDArray[np.int64]) -> Columns:
        """Rows of `replay.PreciseOrbit`."""
        exponents = np.maximum(self.deviations, 0)
        position_std = _M_PER_MM * _powers(self.bases[0])[exponents[:, :3]]
        clock_std = _S_PER_PS * _powers(self.bases[1])[exponents[:, 3]]
        has_std = (self.deviations[:, :3].min(axis=1, initial=0) >= 0) & (self.bases[0] > 0.0)
        has_clock = np.isfinite(self.clocks)
        has_clock_std = (self.deviations[:, 3] >= 0) & (self.bases[1] > 0.0) & has_clock
        has_velocity = np.isfinite(self.velocities[:, 0])
        has_position = np.isfinite(self.positions[:, 0])
        return Columns.build(
            times_ns,
            {
                "satellite": self.names,
                "position_ecef_m": self.positions * _M_PER_KM,
                "velocity_ecef_m_s": self.velocities * _M_S_PER_DM_S,
                "clock_s": self.clocks * _S_PER_US,
                "position_std_ecef_m": np.where(has_std[:, None], position_std, np.nan),
                "clock_std_s": np.where(has_clock_std, clock_std, np.nan),
                "orbit_predicted": (self.flags & text.FLAG_ORBIT_PREDICTED) != 0,
                "manoeuvre": (self.flags & text.FLAG_MANOEUVRE) != 0,
                "clock_predicted": (self.flags & text.FLAG_CLOCK_PREDICTED) != 0,
                "clock_event": (self.flags & text.FLAG_CLOCK_EVENT) != 0,
            },
            present={
                "position_ecef_m": has_position,
                "velocity_ecef_m_s": has_velocity,
                "clock_s": has_clock,
                "position_std_ecef_m": has_std,
                "clock_std_s": has_clock_std,
            },
        )
