"""Delimited text to columns: pyarrow where a file is clean, line by line where it is not.

The fast reader gives up at the first thing that it does not understand; the slow
one then reads the same bytes and names every damaged line. Both give the same
numbers, because both round a decimal correctly.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.csv

from replay.errors import ForeignFileError
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.table import Float64, Table

_ABSENT: Final = ("", "nan", "NaN", "NAN")
_COMMENTS: Final = ("#", "%")


def read_csv(
    file: File,
    columns: Sequence[str],
    texts: frozenset[str],
    findings: Findings,
    delimiter: str = ",",
) -> Table:
    """Rows of a delimited file.

    Parameters
    ----------
    file : File
    columns : sequence of str
        Names in the order of the file; empty where its first line holds them.
    texts : set of str
        Columns that are kept as text.
    findings : Findings
        Damaged lines are counted here and left out.
    delimiter : str
        One character.

    Raises
    ------
    ForeignFileError
        Where there is no header or no row, or a line is damaged and the import strict.
    """
    if columns:
        return read_rows(file, file.data, columns, texts, findings, delimiter, first_line=1)
    head, _, body = file.data.partition(b"\n")
    names = [
        name.strip().strip('"') for name in head.decode("utf-8-sig", "replace").split(delimiter)
    ]
    if not any(names) or all(_is_number(name) for name in names):
        raise ForeignFileError(
            "the first line names no columns",
            where=f"{file.name}:1",
            mend="give their names as `columns` of the source",
        )
    return read_rows(file, body, names, texts, findings, delimiter, first_line=2)


def read_rows(
    file: File,
    body: bytes,
    names: Sequence[str],
    texts: frozenset[str],
    findings: Findings,
    delimiter: str,
    first_line: int,
) -> Table:
    """Rows of delimited bytes that begin at a line of a file.

    Raises
    ------
    ForeignFileError
        Where there is no row, or a line is damaged and the import strict.
    """
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ForeignFileError(
            f"two columns are named {twice[0]!r}",
            where=file.name,
            mend="names have to differ; `columns` of a source can give others",
        )
    table = _fast(file, body, names, texts, delimiter, first_line)
    if table is None:
        table = _slow(file, body, names, texts, findings, delimiter, first_line)
    if len(table) == 0:
        raise ForeignFileError(
            "the file holds no row that can be read",
            where=file.name,
            mend=f"{len(names)} fields a line are expected: {', '.join(names)}",
        )
    return table


def _fast(
    file: File,
    body: bytes,
    names: Sequence[str],
    texts: frozenset[str],
    delimiter: str,
    first_line: int,
) -> Table | None:
    kinds = {name: pa.string() if name in texts else pa.float64() for name in names}
    try:
        read = pyarrow.csv.read_csv(
            io.BytesIO(body),
            read_options=pyarrow.csv.ReadOptions(column_names=list(names), use_threads=False),
            parse_options=pyarrow.csv.ParseOptions(delimiter=delimiter, ignore_empty_lines=False),
            convert_options=pyarrow.csv.ConvertOptions(
                column_types=kinds, null_values=list(_ABSENT), strings_can_be_null=False
            ),
        )
    except pa.ArrowInvalid:
        return None
    if len(read) != body.count(b"\n") + (not body.endswith(b"\n")):
        return None  # a line end inside quotes: line numbers would be wrong
    numbers: dict[str, Float64] = {}
    kept: dict[str, list[str]] = {}
    for name in names:
        column = read.column(name)
        if name in texts:
            kept[name] = column.to_pylist()
        else:
            numbers[name] = np.asarray(column.to_numpy(), dtype=np.float64)  # null is NaN
    lines = np.arange(first_line, first_line + len(read), dtype=np.int64)
    return Table(file, numbers, kept, lines)


def _slow(
    file: File,
    body: bytes,
    names: Sequence[str],
    texts: frozenset[str],
    findings: Findings,
    delimiter: str,
    first_line: int,
) -> Table:
    rows: list[list[float | str]] = []
    lines: list[int] = []
    damaged: dict[str, list[int]] = {}
    for line, raw in enumerate(body.split(b"\n"), first_line):
        text = raw.decode("utf-8", "replace").strip("\r")
        if not text.strip() or text.startswith(_COMMENTS):
            continue
        fields = [field.strip().strip('"') for field in text.split(delimiter)]
        if len(fields) != len(names):
            what = f"a line has not the {len(names)} fields that are expected; skipped"
            damaged.setdefault(what, []).append(line)
            continue
        try:
            rows.append(
                [f if n in texts else _number(f) for n, f in zip(names, fields, strict=True)]
            )
        except ValueError:
            bad = next(
                n
                for n, f in zip(names, fields, strict=True)
                if n not in texts and not (_is_number(f) or f in _ABSENT)
            )
            damaged.setdefault(f"a field of column {bad} is no number; skipped", []).append(line)
            continue
        lines.append(line)
    for what, hit in sorted(damaged.items(), key=lambda item: item[1][0]):
        mend = f"mend or remove the line; fields are {', '.join(names)}"
        findings.rows(what, file.name, hit, mend)
    numbers = {
        name: np.array([row[i] for row in rows], dtype=np.float64)
        for i, name in enumerate(names)
        if name not in texts
    }
    kept = {name: [str(row[i]) for row in rows] for i, name in enumerate(names) if name in texts}
    return Table(file, numbers, kept, np.array(lines, dtype=np.int64))


def _number(text: str) -> float:
    if "_" in text:  # Python reads 1_000, nobody else does
        raise ValueError(text)
    return math.nan if text in _ABSENT else float(text)


def _is_number(text: str) -> bool:
    try:
        _number(text)
    except ValueError:
        return False
    return text not in _ABSENT
