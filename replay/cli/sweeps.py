"""Commands about sweeps: run one, look at its rows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from replay.cli.app import app, leave, out, say, warn
from replay.cli.runs import ShowProgress, progress_bar
from replay.errors import UsageError

if TYPE_CHECKING:
    from replay.batch.sweep.file import Case


def warn_outdated(rows: int) -> None:
    """Say that rows are of other code than this, where some are."""
    if rows:
        warn(
            f"note: {rows} rows were made by another state of this program;"
            " remove their files to have them made anew"
        )


@app.command()
def sweep(
    file: Annotated[
        Path | None, typer.Argument(help="TOML file: inputs, transforms, pipelines, a grid.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Folder of the Parquet data set.")
    ] = None,
    jobs: Annotated[int, typer.Option(help="Processes that work beside each other.")] = 2,
    scheduler: Annotated[
        str, typer.Option(help="Dask scheduler that runs already, as tcp://HOST:8786.")
    ] = "",
    resume: Annotated[
        bool, typer.Option("--resume", help="Leave cases alone that have a row.")
    ] = False,
    table: Annotated[
        Path | None, typer.Option(help="Show the rows in a folder; runs nothing.")
    ] = None,
    progress: ShowProgress = None,
) -> None:
    """Run every combination of a grid: transform, run, evaluate, one row each.

    A case that fails is a row with its error; then the exit code is 3.
    """
    from replay.batch.sweep.file import cases_of, load_sweep
    from replay.batch.sweep.rows import ERROR
    from replay.batch.sweep.run import Options, pending_cases, run_sweep
    from replay.batch.sweep.table import pivot, render

    if table is not None:
        if file is not None or output is not None:
            raise UsageError("--table runs nothing", mend="say `replay sweep --table DIR` alone")
        out.print(render(pivot(table)))
        return
    if file is None or output is None:
        raise UsageError("a sweep needs its file and a folder", mend="replay sweep FILE -o DIR")
    options = Options(output, jobs, scheduler, resume)
    cases = cases_of(load_sweep(file), file.parent)
    count = len(pending_cases(cases, options))
    say(f"{len(cases)} cases, {len(cases) - count} of them have a row")
    done = 0
    with progress_bar(f"{count} cases", progress) as bar:

        def told(case: Case, row: dict[str, Any]) -> None:
            nonlocal done
            done += 1
            bar(done / count)
            if row[ERROR]:
                warn(f"failed: {case.label}: {row[ERROR]}")

        swept = run_sweep(file, cases, options, told=told)
    out.print(render(pivot(output)))
    say(f"{swept.done} cases run now, rows in {output}")
    if swept.foreign:
        warn(f"note: {swept.foreign} rows belong to no case of this sweep as it is now")
    warn_outdated(swept.outdated)
    if swept.failed:
        warn(f"loss: {swept.failed} cases failed; without its row's file --resume runs one again")
    if swept.lossy:
        warn(f"loss: {swept.lossy} runs lost something; see the column losses")
    leave(swept.exit_code)
