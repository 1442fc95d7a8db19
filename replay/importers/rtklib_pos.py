"""RTKLIB solution text (`.pos`): columns are told by its header.

Blanks separate fields. The time takes the first two: a date and a time of day,
which become the text column `time`, or week and seconds, which become the
columns `week` and `tow`. Names lose their unit: `sdn(m)` is `sdn`.
"""

from __future__ import annotations

import re
from typing import Final

from replay.errors import ForeignFileError
from replay.importers.delimited import read_rows
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.table import Table

_SCALES: Final = ("GPST", "UTC")
_BLANKS: Final = re.compile(rb"[ \t]+")
_OUTER_BLANKS: Final = re.compile(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)")
_MEND: Final = "rtkpost writes such a line where `out-outhead` is on"


def read_pos(file: File, findings: Findings) -> Table:
    """Rows of an RTKLIB solution.

    Raises
    ------
    ForeignFileError
        Where the header is missing or names angles that are not decimal degrees.
    """
    head, body, first_line = _split(file)
    scale, *titles = head.removeprefix("%").split()
    if scale not in _SCALES:
        raise ForeignFileError(
            f"the header's time scale is {scale!r}",
            where=f"{file.name}:{first_line - 1}",
            mend=f"known are {', '.join(_SCALES)}",
        )
    if any(title.startswith("latitude") and title != "latitude(deg)" for title in titles):
        raise ForeignFileError(
            "latitude and longitude are not in decimal degrees",
            where=f"{file.name}:{first_line - 1}",
            mend="write the solution with `out-outsolformat = llh` and `out-degform = deg`",
        )
    names = [title.partition("(")[0] for title in titles]
    calendar = b"/" in body.split(maxsplit=1)[0] if body.strip() else False
    stamp = ["date", "clock"] if calendar else ["week", "tow"]
    # Blanks become commas line by line, so that line numbers stay.
    text = _BLANKS.sub(b",", _OUTER_BLANKS.sub(b"", body))
    texts = frozenset(stamp) if calendar else frozenset[str]()
    table = read_rows(file, text, [*stamp, *names], texts, findings, ",", first_line)
    joined = {}
    if calendar:
        pairs = zip(table.texts["date"], table.texts["clock"], strict=True)
        joined["time"] = [f"{date} {clock}" for date, clock in pairs]
    return Table(file, table.numbers, joined, table.lines, scale)


def _split(file: File) -> tuple[str, bytes, int]:
    """The line of titles, what follows it, and the number of the first line that follows."""
    at, number, title = 0, 1, ""
    while file.data.startswith(b"%", at):
        end = file.data.find(b"\n", at)
        end = len(file.data) if end < 0 else end
        line = file.data[at:end].decode("utf-8", "replace")
        if "latitude" in line or "x-ecef" in line:
            title = line
        at, number = end + 1, number + 1
    if not title:
        raise ForeignFileError("no header line names the columns", where=file.name, mend=_MEND)
    return title, file.data[at:], number
