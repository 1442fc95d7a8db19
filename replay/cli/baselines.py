"""Commands about baselines: check, update."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Column, Table
from rich.text import Text

from replay.cli.app import app, leave, out, say, warn
from replay.errors import ExitCode

if TYPE_CHECKING:
    from replay.batch.baseline import CaseCheck
    from replay.batch.baseline_file import Digest
    from replay.batch.figures import Number

baseline = typer.Typer(
    help="Compare runs over recordings with what they gave before.", no_args_is_help=True
)
app.add_typer(baseline, name="baseline")

Recordings = Annotated[Path, typer.Option(help="Folder of recordings and their baselines.")]
Only = Annotated[
    list[str] | None, typer.Option(help="This recording alone; may be repeated.", metavar="NAME")
]
Data = Annotated[
    Path | None, typer.Option(help="Folder of the files of real recordings; else they are skipped.")
]
_RECORDINGS = Path("recordings")
_SHOWN_DIGITS = 12


@baseline.command("check")
def check_(
    recordings: Recordings = _RECORDINGS,
    only: Only = None,
    data: Data = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Run every recording again and say what differs from its baseline."""
    import msgspec

    from replay.batch.baseline import check
    from replay.batch.recordings import find_recordings

    found: list[CaseCheck] = []
    for case in check(find_recordings(recordings, only or ()), data):
        found.append(case)
        if not as_json:
            _show(case)
    if as_json:
        typer.echo(msgspec.json.format(msgspec.json.encode(found), indent=2).decode())
    worst = max((case.exit_code for case in found), default=ExitCode.OK)
    if worst is not ExitCode.OK:
        warn("if this is meant: replay baseline update --reason TEXT")
    leave(worst)


@baseline.command("update")
def update_(
    reason: Annotated[str, typer.Option(help="Why the results are to be others now.")],
    recordings: Recordings = _RECORDINGS,
    only: Only = None,
    data: Data = None,
) -> None:
    """Run every recording and write what it gives into its baseline."""
    from replay.batch.baseline import update
    from replay.batch.recordings import find_recordings

    for line in update(find_recordings(recordings, only or ()), reason, data):
        say(line)


def _show(case: CaseCheck) -> None:
    color = "green" if case.exit_code is ExitCode.OK else "bold red"
    name = f"{case.recording}/{case.case}: "
    out.print(Text.assemble(name, (case.verdict.value, color)), soft_wrap=True)
    for note in case.notes:
        say(f"  {note}")
    if case.channels:
        table = Table(_whole("channel that differs"), "", "recorded", "found")
        for channel in case.channels:
            sides = (_digest(channel.recorded), _digest(channel.found))
            table.add_row(channel.topic, channel.kind, *sides)
        out.print(table)
    if case.figures:
        table = Table(_whole("figure that moved"), "recorded", "found", "by")
        for figure in case.figures:
            old, new = figure.recorded, figure.found
            by = "" if old is None or new is None else f"{new - old:+.6g}"
            table.add_row(figure.name, _number(old), _number(new), by)
        out.print(table)


def _whole(title: str) -> Column:
    """A column whose names stay whole on a narrow terminal: the others give way."""
    return Column(title, no_wrap=True)


def _digest(digest: Digest | None) -> str:
    return f"{digest.rows:,} rows {digest.sha256[:_SHOWN_DIGITS]}" if digest else "none"


def _number(value: Number | None) -> str:
    return "none" if value is None else f"{value:g}"
