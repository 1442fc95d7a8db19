"""Rows of a sweep: one small Parquet file each, in folders by the grid's first key."""

from __future__ import annotations

import urllib.parse
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from replay.batch.sweep.file import Case, word
from replay.errors import LogError

Row = dict[str, Any]

FIGURE: Final = "figure."
GRID: Final = "grid."
SERIES: Final = "series."
ERROR: Final = "error"
CODE: Final = "code"
_SUFFIX: Final = ".parquet"


def flatten(value: Any, name: str = "") -> Iterator[tuple[str, float | str]]:
    """Numbers and texts of nested tables and lists, names joined by points; None is left out."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from flatten(inner, f"{name}.{key}" if name else str(key))
    elif isinstance(value, list | tuple):
        for index, inner in enumerate(value):
            yield from flatten(inner, f"{name}.{index}")
    elif isinstance(value, bool | int | float):
        yield name, float(value)
    elif isinstance(value, str):
        yield name, value


def row_path(folder: Path, case: Case) -> Path:
    """File of a case's row."""
    key, value = case.partition
    place = f"{_quoted(key)}={_quoted(word(value))}"
    return folder / place / f"{case.key}{_SUFFIX}"


def write_row(path: Path, row: Row) -> None:
    """Write a row, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.part")
    pq.write_table(pa.table({name: [value] for name, value in row.items()}), part)
    part.replace(path)


def row_files(folder: Path) -> list[Path]:
    """Files of rows, by path."""
    return sorted(folder.glob(f"*=*/*{_SUFFIX}"))


def read_rows(folder: Path) -> pa.Table:
    """All rows of a sweep without their series; a figure that a row lacks is null.

    Raises
    ------
    LogError
        Where a file is no Parquet.
    """
    tables = []
    for path in row_files(folder):
        try:
            names = pq.read_schema(path).names
            wanted = [name for name in names if not name.startswith(SERIES)]
            tables.append(pq.read_table(path, columns=wanted, partitioning=None))
        except (OSError, pa.ArrowException) as error:
            raise LogError(
                f"a row cannot be read: {error}",
                where=str(path),
                mend="remove the file and go on with --resume",
            ) from error
    return pa.concat_tables(tables, promote_options="permissive") if tables else pa.table({})


def read_series(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Series of one row, each an array, by its name without the prefix.

    Raises
    ------
    LogError
        Where the file is no Parquet.
    """
    try:
        names = [name for name in pq.read_schema(path).names if name.startswith(SERIES)]
        table = pq.read_table(path, columns=names, partitioning=None)
    except (OSError, pa.ArrowException) as error:
        raise LogError(
            f"a row cannot be read: {error}", where=str(path), mend="remove the file and run again"
        ) from error
    return {
        name.removeprefix(SERIES): np.asarray(table.column(name)[0].values.to_numpy())
        for name in names
    }


def _quoted(text: str) -> str:
    return urllib.parse.quote(text, safe=" ,;+-_")
