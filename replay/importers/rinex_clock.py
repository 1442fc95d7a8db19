"""RINEX clock files, versions 2 to 3.04: clocks of satellites and stations.

Ray and Gurtner, "RINEX Extensions to Handle Clock Information", 2010, and version 3.04, 2017,
whose longer names shift the columns: records are read by words.
"""

from __future__ import annotations

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
from replay.importers.rinex_header import MEND, header_length, read_version
from replay.importers.spec import Stream
from replay.kernels import product_text as text
from replay.log.columns import Columns

_LABELS = (
    "TIME SYSTEM ID", "ANALYSIS CENTER", "SYS / DCBS APPLIED", "SYS / PCVS APPLIED",
    "# OF SOLN STA / TRF", "# / TYPES OF DATA", "ANALYSIS CLK REF",
)  # fmt: skip


def rinex_clock_stream(
    file: File, findings: Findings, stream: Stream, known: Known
) -> dict[str, Columns]:
    """Clocks in the order of their epochs.

    Raises
    ------
    ForeignFileError
        Where it is no clock file, or its time system is unknown.
    """
    file = unpack(file, findings)
    lines = split_lines(file)
    version, kind, _ = read_version(lines)
    if "C" not in (kind, _late_type(lines)) or int(version) not in (2, 3):
        raise ForeignFileError(
            f"RINEX {version:g} of type {kind!r} is no clock file that is known",
            where=f"{file.name}:1",
            mend="type C of versions 2 and 3 is read",
        )
    start = header_length(lines)
    said = _header(lines, start)
    # Before 3.00 nothing but GPS time is meant where nothing is stated.
    scale = time_system(_first(said, "TIME SYSTEM ID"), f"{file.name}:1")
    columns, epochs = _read(lines, start, scale, findings)
    near = within(columns.valid_time_ns, known.span_ns, stream.margin, file.name, findings)
    detail = []
    for label in ("SYS / PCVS APPLIED", "SYS / DCBS APPLIED", "ANALYSIS CLK REF"):
        detail += [" ".join(value.split()) for value in said.get(label, [])]
    if not near.any():
        return {}
    about = About(
        source=file.name.rpartition("/")[2],
        format="rinex-clk",
        version=f"{version:g}",
        agency=_first(said, "ANALYSIS CENTER")[:3].strip(),
        frame=_first(said, "# OF SOLN STA / TRF")[6:].strip(),
        time_system=scale,
        kind=" ".join(_first(said, "# / TYPES OF DATA").split()[1:]),
        detail="; ".join(detail),
    )
    found = product_row(about, epochs, int(near.sum()))
    found[channels.PRECISE_CLOCK.topic] = columns.take(near)
    return found


def _late_type(lines: Lines) -> str:
    """Type of a 3.04 file, which stands a byte later."""
    return lines.text(0)[21:22]


def _header(lines: Lines, count: int) -> dict[str, list[str]]:
    """Texts of the lines by label; the label stands from column 61, or 66 in 3.04."""
    said: dict[str, list[str]] = {}
    for line in range(count):
        row = lines.text(line)
        for label in _LABELS:
            if row.rstrip().endswith(label):
                said.setdefault(label, []).append(row.rstrip()[: -len(label)])
    return said


def _first(said: dict[str, list[str]], label: str) -> str:
    return said.get(label, [""])[0]


def _read(
    lines: Lines, start: int, scale: str, findings: Findings
) -> tuple[Columns, np.typing.NDArray[np.int64]]:
    """Rows of `replay.PreciseClock` and their epochs."""
    size, name = len(lines), lines.file.name
    last = size if lines.whole_end else size - 1
    times, numbers = np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.int64)
    names = np.zeros((size, text.NAME_BYTES), dtype=np.uint8)
    values, status = np.zeros((size, 2)), np.zeros(size, dtype=np.int8)
    is_satellite = np.zeros(size, dtype=np.bool_)
    count = text.parse_clocks(
        lines.data, lines.starts, lines.ends, start, last, times, names, is_satellite, values,
        numbers, status,
    )  # fmt: skip
    for code, what in (
        (text.LINE_DAMAGED, "a record of a clock cannot be read; skipped"),
        (text.LINE_STRAY, "a line belongs to no record; skipped"),
    ):
        findings.rows(what, name, np.flatnonzero(status == code) + 1, MEND)
    if last < size:
        what = "the file ends inside a line; what is whole is kept"
        mend = "fetch the file again; where it is whole, end it with a line end"
        findings.rows(what, name, [size], mend)
    unread = int((status == text.LINE_UNREAD).sum())
    if unread:
        findings.notes.append(
            f"{name}: {unread} lines of rates, calibrations and discontinuities are not read"
        )
    times = to_gps(times[:count], scale)
    whole = names[:count].view(f"S{text.NAME_BYTES}").reshape(-1)
    keep = first_of_each(times, whole)
    again = np.setdiff1d(np.arange(count), keep)
    what = "a clock has an epoch twice; the first is kept"
    findings.rows(what, name, numbers[again] + 1, MEND)
    of_satellite = is_satellite[keep]
    short = whole[keep].astype("S3")
    findings.notes += missing_note(name, short[of_satellite], times[keep][of_satellite])
    values = values[keep]
    columns = Columns.build(
        times[keep],
        {
            "satellite": np.where(of_satellite, short, b"").astype("S3"),
            "station": np.where(of_satellite, b"", whole[keep]).astype(whole.dtype),
            "clock_s": np.ascontiguousarray(values[:, 0]),
            "clock_std_s": np.ascontiguousarray(values[:, 1]),
        },
        present={"satellite": of_satellite, "clock_std_s": np.isfinite(values[:, 1])},
    )
    return columns, times[keep]
