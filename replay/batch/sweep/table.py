"""Rows of a sweep as one table: a line per point of the grid, figures over its seeds."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from rich.table import Table

from replay.batch.sweep.file import SEED, SweepFile, label_of, load_sweep, word
from replay.batch.sweep.rows import ERROR, FIGURE, GRID, read_rows
from replay.batch.sweep.run import COPY
from replay.errors import UsageError

_USUAL: Final = (
    "position_error_m.horizontal.rms",
    "position_error_m.up.rms",
    "position_error_all_m.horizontal.rms",
    "velocity_error_m_s.3d.rms",
    "attitude_error_deg.heading.rms",
    "outage_summary.horizontal_rms_m",
)


@dataclasses.dataclass(frozen=True, slots=True)
class Line:
    """One point of the grid.

    Attributes
    ----------
    point : tuple of str, float, or None where a row does not tell
    rows, failed : int
    mean, spread : dict of figure to float
        Over its seeds; the spread, about the mean, where there are two or more.
    """

    point: tuple[str | float | None, ...]
    rows: int
    failed: int
    mean: dict[str, float]
    spread: dict[str, float]


@dataclasses.dataclass(frozen=True, slots=True)
class Pivot:
    """A sweep as a table.

    Attributes
    ----------
    title : str
    keys, figures : tuple of str
    lines : tuple of Line
    """

    title: str
    keys: tuple[str, ...]
    figures: tuple[str, ...]
    lines: tuple[Line, ...]


def pivot(folder: Path) -> Pivot:
    """Table of the rows in a folder.

    Raises
    ------
    UsageError
        Where there is none.
    """
    rows = read_rows(folder).to_pylist()
    if not rows:
        raise UsageError(
            "the folder has no rows of a sweep", where=str(folder), mend="run `replay sweep` first"
        )
    sweep = load_sweep(folder / COPY) if (folder / COPY).exists() else _found(rows)
    grid = [f"{GRID}{key}" for key in sweep.grid if key != SEED]
    keys = [key for key in ("sweep", "source", "pipeline") if len({row[key] for row in rows}) > 1]
    keys += [key for key in grid if any(row.get(key) is not None for row in rows)]
    figures = _figures(sweep, rows)
    groups: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in sorted(rows, key=lambda row: _place(sweep, row)):
        groups.setdefault(tuple(row.get(key) for key in keys), []).append(row)
    return Pivot(
        rows[0]["sweep"],
        tuple(key.removeprefix(GRID) for key in keys),
        tuple(figures),
        tuple(_line(point, group, figures) for point, group in groups.items()),
    )


def _found(rows: Sequence[Mapping[str, Any]]) -> SweepFile:
    """A sweep with the grid that rows of no one file have, values in their order."""
    grid: dict[str, list[Any]] = {}
    for name in rows[0]:
        if name.startswith(GRID):
            values = {row[name] for row in rows if row[name] is not None}
            grid[name.removeprefix(GRID)] = sorted(values, key=lambda v: (isinstance(v, str), v))
    return SweepFile(name=", ".join(dict.fromkeys(row["sweep"] for row in rows)), grid=grid)


def _place(sweep: SweepFile, row: Mapping[str, Any]) -> tuple[Any, ...]:
    """Where a row stands: values in the order of the file, those of another one last."""
    places = []
    for key, values in sweep.grid.items():
        labels = [label_of(value) for value in values]
        value = row.get(f"{GRID}{key}")
        places.append(labels.index(value) if value in labels else len(labels))
    return row["sweep"], row["source"], row["pipeline"], *places


def _figures(sweep: SweepFile, rows: Sequence[Mapping[str, Any]]) -> list[str]:
    known = {name for row in rows for name, value in row.items() if isinstance(value, float)}
    wanted = sweep.table or _USUAL
    missing = [name for name in sweep.table if f"{FIGURE}{name}" not in known]
    if missing and any(not row[ERROR] for row in rows):
        raise UsageError(
            f"no row has the figure {', '.join(missing)}",
            mend="the names are those of `replay evaluate --json`, joined by points",
        )
    return [name for name in wanted if f"{FIGURE}{name}" in known]


def _line(
    point: tuple[Any, ...], rows: Sequence[Mapping[str, Any]], figures: Sequence[str]
) -> Line:
    mean: dict[str, float] = {}
    spread: dict[str, float] = {}
    for name in figures:
        found = [row[f"{FIGURE}{name}"] for row in rows]
        values = [value for value in found if value is not None]
        if values:
            mean[name] = math.fsum(values) / len(values)
        if len(values) > 1:
            squares = math.fsum((value - mean[name]) ** 2 for value in values)
            spread[name] = math.sqrt(squares / (len(values) - 1))
    return Line(point, len(rows), sum(bool(row[ERROR]) for row in rows), mean, spread)


def render(made: Pivot) -> Table:
    """The table for a terminal."""
    table = Table(title=made.title, title_justify="left")
    for key in made.keys:
        table.add_column(key)
    table.add_column("rows", justify="right")
    for figure in made.figures:
        table.add_column(figure.replace(".", "\n"), justify="right")
    for line in made.lines:
        count = f"{line.rows}" + (f", {line.failed} failed" if line.failed else "")
        cells = [_cell(line, figure) for figure in made.figures]
        table.add_row(
            *("-" if value is None else word(value) for value in line.point), count, *cells
        )
    return table


def _cell(line: Line, figure: str) -> str:
    if figure not in line.mean:
        return "-"
    text = f"{line.mean[figure]:.4f}"
    return f"{text} ± {line.spread[figure]:.4f}" if figure in line.spread else text
