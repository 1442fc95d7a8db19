"""A comparison of methods as one table: for a terminal, for Markdown, for a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from rich.console import Console
from rich.table import Table

from replay.evaluate.compare import Method
from replay.evaluate.satellites import ALL, Spread
from replay.evaluate.statistics import HORIZONTAL, LOCAL_AXES, Statistics

_ABSENT: Final = "-"
_LETTERS: Final = ("E", "N", "U")
ERROR_HEADS: Final = ("position STD", "position RMS", "change STD", "change RMS")
OTHER_HEADS: Final = (
    "horizontal 95 % [m]", "satellites", "PDOP", "available [%]", "fixed [%]",
)  # fmt: skip
_SHORT: Final = {  # for a terminal
    "position": "pos.", "horizontal": "hor.", "satellites": "sats", "available": "avail.",
}  # fmt: skip
ABOUT: Final = (
    "Solution minus truth at epochs of GNSS outside outages, each method at its own epochs;"
    " change is that of the position from one epoch to the next. Satellites are the mean, PDOP"
    " the median over epochs; available are epochs with a solution over epochs of observation."
)


def axis_head(name: str) -> str:
    """Heading of three figures in one cell: "position STD E / N / U [m]"."""
    return f"{name} {' / '.join(_LETTERS)} [m]"


def rows(methods: Sequence[Method]) -> list[tuple[str, tuple[tuple[str, ...], ...], list[str]]]:
    """Per method its name, E, N, U of each of ERROR_HEADS, and the OTHER_HEADS."""
    return [(m.name, _errors(m), _others(m)) for m in methods]


def _errors(method: Method) -> tuple[tuple[str, ...], ...]:
    position = method.evaluation.position_error_m
    change = method.evaluation.position_change_error_m
    return tuple(
        _axes(axes, figure)
        for axes, figure in (
            (position, "std"),
            (position, "rms"),
            (change, "std"),
            (change, "rms"),
        )
    )


def _axes(axes: Mapping[str, Statistics] | None, figure: str) -> tuple[str, ...]:
    if axes is None:
        return (_ABSENT,) * len(LOCAL_AXES)
    return tuple(metres(getattr(axes[axis], figure)) for axis in LOCAL_AXES)


def _others(method: Method) -> list[str]:
    found = method.evaluation
    horizontal = found.position_error_m
    geometry = found.geometry
    satellites = None if geometry is None else geometry.satellites.get(ALL)
    pdop = None if geometry is None else geometry.pdop.get(ALL)
    ambiguities, availability = found.ambiguities, found.availability
    return [
        _ABSENT if horizontal is None else metres(horizontal[HORIZONTAL].p95),
        _mean(satellites),
        _ABSENT if pdop is None else f"{pdop.median:.2f}",
        _ABSENT if availability is None else _percent(availability.share),
        _ABSENT if ambiguities is None else _percent(ambiguities.share["fixed"]),
    ]


def _mean(spread: Spread | None) -> str:
    return _ABSENT if spread is None else f"{spread.mean:.1f}"


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f}"


def metres(value: float) -> str:
    """A length in metres to the millimetre."""
    return f"{value:.3f}"


def print_comparison(methods: Sequence[Method], console: Console) -> None:
    """Print the table, a line per axis, so that it fits a narrow terminal too."""
    table = Table(title="Methods against truth", title_justify="left")
    table.add_column("method")
    table.add_column("")
    for name in (*(f"{head} [m]" for head in ERROR_HEADS), *OTHER_HEADS):
        for long, short in _SHORT.items():
            name = name.replace(long, short)
        table.add_column(name.replace(" ", "\n", 1).replace("[", r"\["), justify="right")
    for name, errors, others in rows(methods):
        for index, letter in enumerate(_LETTERS):
            first = index == 0
            table.add_row(
                name if first else "",
                letter,
                *(figures[index] for figures in errors),
                *(others if first else [""] * len(others)),
            )
        table.add_section()
    console.print(table)
    console.print(f"[dim]{ABOUT}[/dim]")


def markdown(methods: Sequence[Method]) -> str:
    """The table as Markdown, a row per method."""
    head = ("method", *(axis_head(name) for name in ERROR_HEADS), *OTHER_HEADS)
    lines = ["| " + " | ".join(head) + " |", "|---|" + "---:|" * (len(head) - 1)]
    lines += [
        "| " + " | ".join((name, *(" / ".join(cell) for cell in errors), *others)) + " |"
        for name, errors, others in rows(methods)
    ]
    return "\n".join([*lines, "", ABOUT])
