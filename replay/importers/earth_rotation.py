"""ERP files of the IGS, version 2: pole, rotation and length of day."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from replay import channels
from replay.errors import ForeignFileError
from replay.importers.antex_streams import Known
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.product_files import About, from_julian, product_row
from replay.importers.rinex_files import Lines, split_lines, unpack
from replay.importers.rinex_header import MEND
from replay.importers.spec import Stream
from replay.log.columns import Column, Columns

_MICROARCSECOND: Final = math.pi / (180.0 * 3600.0 * 1e6)
_TENTH_MICROSECOND: Final = 1e-7
_DAY_S: Final = 86_400.0
_FIRST_DAY: Final = 44_245.0  # MJD; GPS time begins the day before
_LAST_DAY: Final = 88_069.0  # of the year 2100
# Names of the columns, which differ in case and dashes, to the field and its unit.
_FIELDS: Final = {
    "xpole": ("polar_x_rad", _MICROARCSECOND),
    "ypole": ("polar_y_rad", _MICROARCSECOND),
    "ut1utc": ("ut1_utc_s", _TENTH_MICROSECOND),
    "lod": ("length_of_day_s", _TENTH_MICROSECOND),
    "xrt": ("polar_x_rate_rad_s", _MICROARCSECOND / _DAY_S),
    "yrt": ("polar_y_rate_rad_s", _MICROARCSECOND / _DAY_S),
    "xsig": ("polar_x_std_rad", _MICROARCSECOND),
    "ysig": ("polar_y_std_rad", _MICROARCSECOND),
    "utsig": ("ut1_utc_std_s", _TENTH_MICROSECOND),
    "lodsig": ("length_of_day_std_s", _TENTH_MICROSECOND),
}
# CODE's names.
_OTHER: Final = {
    "xp": "xpole", "yp": "ypole", "sx": "xsig", "sy": "ysig", "sut": "utsig", "sld": "lodsig",
}  # fmt: skip
_NEEDED: Final = ("mjd", "xpole", "ypole", "ut1utc", "lod")
_REGULARIZED: Final = "ut1rutc"


def earth_rotation_stream(
    file: File, findings: Findings, stream: Stream, known: Known
) -> dict[str, Columns]:
    """Rows of the table, in the order of their epochs, which are of UTC.

    Raises
    ------
    ForeignFileError
        Where it is no ERP file of version 2.
    """
    del stream, known
    file = unpack(file, findings)
    lines = split_lines(file)
    names, first = _table(lines)
    rows: list[list[float]] = []
    damaged: list[int] = []
    for line in range(first, len(lines)):
        words = lines.text(line).split()
        if not words:
            continue
        try:
            numbers = [float(word) for word in words[: len(names)]]
            if len(words) < len(names) or not all(map(math.isfinite, numbers)):
                raise ValueError
            if not _FIRST_DAY <= numbers[names.index("mjd")] <= _LAST_DAY:
                raise ValueError
            rows.append(numbers)
        except ValueError:
            if lines.text(line).strip("- "):
                damaged.append(line + 1)
    findings.rows("a line of the table cannot be read; skipped", file.name, damaged, MEND)
    if not rows:
        raise ForeignFileError("the table has no rows", where=f"{file.name}:{first}", mend=MEND)
    table = np.array(rows)
    times = from_julian(table[:, names.index("mjd")])
    values: dict[str, Column] = {}
    present = {}
    for name, (field, unit) in _FIELDS.items():
        there = name in names
        column = table[:, names.index(name)] * unit if there else np.full(len(rows), np.nan)
        values[field] = np.ascontiguousarray(column)
        if name not in _NEEDED:
            present[field] = np.full(len(rows), there)
    order = np.argsort(times, kind="stable").astype(np.int64)
    about = About(
        source=file.name.rpartition("/")[2],
        format="erp",
        version="2",
        time_system="UTC",
        detail="; ".join(
            text for line in range(1, first) if (text := lines.text(line).strip("- "))
            and not text.lower().startswith(("mjd", "("))
        ),
    )  # fmt: skip
    found = product_row(about, times, len(rows))
    found[channels.EARTH_ROTATION.topic] = Columns.build(times, values, present=present).take(order)
    return found


def _table(lines: Lines) -> tuple[list[str], int]:
    """Names of the columns and the line of the first row.

    Raises
    ------
    ForeignFileError
        Where there is no such table, or its units are others.
    """
    name = lines.file.name
    head = lines.text(0).lower().split() if len(lines) else []
    if head[:2] != ["version", "2"]:
        raise ForeignFileError(
            "the first line is not that of an ERP file of version 2",
            where=f"{name}:1",
            mend="name a file that begins with `version 2`",
        )
    for line in range(1, len(lines)):
        words = lines.text(line).lower().split()
        if words[:1] != ["mjd"]:
            continue
        names = [word.replace("-", "").replace('"', "") for word in words]
        names = [_OTHER.get(word, word) for word in names]
        units = lines.text(line + 1).lower() if line + 1 < len(lines) else ""
        known = all(word in names for word in _NEEDED)
        if _REGULARIZED in names or not known or not _usual(units):
            raise ForeignFileError(
                "the table of the Earth's rotation has other columns or units than the IGS's",
                where=f"{name}:{line + 1}",
                mend="MJD, Xpole, Ypole, UT1-UTC and LOD in 1e-6 arc seconds and 1e-7 s are read",
            )
        return names, line + 2
    raise ForeignFileError("the file has no line that names columns", where=f"{name}:1", mend=MEND)


def _usual(units: str) -> bool:
    """Whether the line below the names states microarcseconds and tenths of microseconds."""
    plain = units.replace(" ", "").replace("**", "").replace("^", "")
    angle = '10-6"' in plain or 'e-6"' in plain
    seconds = "0.1usec" in plain or "e-7s" in plain or ".1us" in plain
    return angle and seconds
