"""Commands about studies: run one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from replay.cli.app import app, leave, out, say, warn
from replay.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from replay.batch.study import Done


@app.command()
def study(
    name: Annotated[
        str | None, typer.Argument(help="Name; without it the studies are listed.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder for report, recording, tables.")
    ] = None,
    seeds: Annotated[int, typer.Option(help="Simulate each case so often, each time anew.")] = 1,
    cases: Annotated[str, typer.Option(help="Some cases alone, as 1,3; all without it.")] = "",
    jobs: Annotated[int, typer.Option(help="Processes that work beside each other.")] = 2,
    discard_logs: Annotated[
        bool, typer.Option("--discard-logs", help="Keep no log; else those of the first seed.")
    ] = False,
) -> None:
    """Simulate, run and measure the cases of a study; write its report and recording."""
    from replay.batch.study import STUDIES, Options, find_study, run_study
    from replay.batch.workers import Workers

    if name is None:
        table = Table("study", "what it does")
        for known in STUDIES:
            table.add_row(known, find_study(known).about)
        out.print(table)
        return
    if output is None:
        raise UsageError("a study needs a folder", mend="say -o DIR")
    found = find_study(name)
    labels = tuple(part.strip() for part in cases.split(",") if part.strip())
    options = Options(output, seeds, labels, jobs, not discard_logs)
    with Workers(jobs) as workers:
        done = run_study(found, options, workers=workers, told=_told)
        files = found.present(done, options, workers)
    for what, path in files.items():
        say(f"{what}: {path}")
    losses = [loss for member in done for loss in member.losses]
    for loss in losses:
        warn(f"loss: {loss}")
    leave(ExitCode.LOSS if losses else ExitCode.OK)


def _told(done: Done) -> None:
    warn(f"case {done.member.folder}: {done.elapsed_s:.1f} s")
