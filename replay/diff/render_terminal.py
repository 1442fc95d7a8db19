"""The result for a person at a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from replay.diff import words
from replay.diff.result import ChannelStatus, DiffResult, Divergence, SettingChange, Verdict

_COLOURS: Final = {
    Verdict.IDENTICAL: "green",
    Verdict.WITHIN_TOLERANCE: "cyan",
    Verdict.CHANGED: "red",
    Verdict.INCOMPARABLE: "magenta",
}
_STATUS_COLUMN: Final = 1
_TEXT_COLUMNS: Final = ("channel", "field", "status", "worst at", "A", "B", "key", "kind", "row")
_WHOLE_COLUMNS: Final = ("field", "worst at", "row")  # that a narrow terminal must not fold


def render_terminal(result: DiffResult, console: Console | None = None) -> None:
    """Print verdict, culprit, and tables of what differs.

    Parameters
    ----------
    result : DiffResult
    console : rich.console.Console, optional
        Standard output where none is given.
    """
    console = console or Console()
    colour = _COLOURS[result.verdict]
    lines = words.headlines(result)
    console.print(Text(lines[0], style=f"bold {colour}"))
    for line in lines[1:]:
        console.print(Text(line))
    console.print(Text(f"A {result.a.path}\nB {result.b.path}", style="dim"))
    _print_channels(result, console)
    _print_fields(result, console)
    divergence = result.first_change or result.first_difference
    if divergence is not None and divergence.around:
        _print_context(divergence, console)
    for title, settings in (
        ("configuration", result.configuration),
        ("versions", result.versions),
        ("input channels (sha256)", result.inputs),
    ):
        _print_settings(title, settings, console)
    for channel in result.channels:
        for note in channel.notes:
            console.print(Text(f"{channel.topic}: {note}", style="dim"))


def _print_table(
    console: Console, title: str, header: Iterable[str], rows: Iterable[Sequence[Text | str]]
) -> None:
    table = Table(header_style="bold", box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    for name in header:
        table.add_column(
            name,
            justify="left" if name in _TEXT_COLUMNS else "right",
            overflow="fold",
            no_wrap=name in _WHOLE_COLUMNS,
        )
    for row in rows:
        table.add_row(*(Text(cell) if isinstance(cell, str) else cell for cell in row))
    # A table's own title is folded to the width of the table.
    console.print(Text(title, style="bold"))
    console.print(table)


def _print_channels(result: DiffResult, console: Console) -> None:
    rows: list[list[Text | str]] = []
    for channel in result.channels:
        cells: list[Text | str] = list(words.channel_row(channel))
        style = _COLOURS[channel.status.verdict]
        cells[_STATUS_COLUMN] = Text(words.channel_row(channel)[_STATUS_COLUMN], style=style)
        rows.append(cells)
    header, rows = _without_empty_columns(words.CHANNEL_HEADER, rows)
    _print_table(console, "channels", header, rows)


def _without_empty_columns(
    header: Sequence[str], rows: list[list[Text | str]]
) -> tuple[list[str], list[list[Text | str]]]:
    kept = [i for i in range(len(header)) if any(str(row[i]) for row in rows)]
    return [header[i] for i in kept], [[row[i] for i in kept] for row in rows]


def _print_fields(result: DiffResult, console: Console) -> None:
    for channel in words.differing(result):
        rows: list[list[Text | str]] = [list(row[1:]) for row in words.field_rows(channel)]
        for name, run in ((f, "A") for f in channel.fields_missing):
            console.print(Text(f"{channel.topic}: field {name} is in {run} only"))
        for name, run in ((f, "B") for f in channel.fields_extra):
            console.print(Text(f"{channel.topic}: field {name} is in {run} only"))
        if rows and channel.status is not ChannelStatus.SCHEMA:
            header, rows = _without_empty_columns(words.FIELD_HEADER[1:], rows)
            _print_table(console, words.topic(channel), header, rows)


def _print_context(divergence: Divergence, console: Console) -> None:
    field = words.component(divergence.field, divergence.component)
    title = f"rows around the first: {divergence.topic} {field}".rstrip()
    rows: list[list[Text | str]] = [
        [
            Text("▶" if row.here else ""),
            words.clock(row.at),
            row.kind.value,
            row.a,
            row.b,
            "" if row.difference is None else words.number(row.difference, divergence.unit),
        ]
        for row in divergence.around
    ]
    header, rows = _without_empty_columns(("", "row", "kind", "A", "B", "A-B"), rows)
    _print_table(console, title, header, rows)


def _print_settings(title: str, settings: Sequence[SettingChange], console: Console) -> None:
    if settings:
        rows = [[s.key, s.a or "—", s.b or "—"] for s in settings]
        _print_table(console, f"{title} that differ", ("key", "A", "B"), rows)
