"""Commands about studies: run one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from replay.cli.app import app, leave, out, say, warn
from replay.cli.runs import ShowProgress, progress_bar
from replay.cli.sweeps import warn_outdated
from replay.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from replay.batch.study import Done, Options, Study
    from replay.batch.sweep.file import Case
    from replay.batch.sweep_study import SweepStudy


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
    scheduler: Annotated[
        str, typer.Option(help="Dask scheduler that runs already; for a study that is a sweep.")
    ] = "",
    discard_logs: Annotated[
        bool, typer.Option("--discard-logs", help="Keep no log; else those of the first seed.")
    ] = False,
    progress: ShowProgress = None,
) -> None:
    """Simulate, run and measure the cases of a study; write its report and recording.

    A study that is a sweep keeps a row of each run and goes on where it stopped.
    """
    from replay.batch.studies import STUDIES, find_study
    from replay.batch.study import Options
    from replay.batch.sweep_study import SweepStudy

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
    options = Options(output, seeds, labels, jobs, not discard_logs, scheduler)
    if isinstance(found, SweepStudy):
        leave(_run_sweep(found, options, progress))
    else:
        leave(_run_members(found, options, progress))


def _run_members(found: Study, options: Options, progress: bool | None) -> ExitCode:
    from replay.batch.study import chosen_members, run_study
    from replay.batch.workers import Workers

    if options.scheduler:
        raise UsageError(
            f"{found.name} is no sweep, so no scheduler runs it", mend="leave --scheduler out"
        )
    count = len(chosen_members(found, options))
    ended = 0
    with Workers(options.jobs) as workers:
        with progress_bar(f"{count} cases", progress) as bar:

            def told(done: Done) -> None:
                nonlocal ended
                ended += 1
                bar(ended / count)
                warn(f"case {done.member.folder}: {done.elapsed_s:.1f} s")

            done = run_study(found, options, workers=workers, told=told)
        files = found.present(done, options, workers)
    for what, path in files.items():
        say(f"{what}: {path}")
    losses = [loss for member in done for loss in member.losses]
    for loss in losses:
        warn(f"loss: {loss}")
    return ExitCode.LOSS if losses else ExitCode.OK


def _run_sweep(found: SweepStudy, options: Options, progress: bool | None) -> ExitCode:
    from replay.batch.sweep.rows import ERROR
    from replay.batch.sweep_study import rows_folder, run_sweep_study, study_cases
    from replay.batch.workers import Workers

    cases, count = study_cases(found, options)
    say(f"{len(cases)} runs, {len(cases) - count} of them have a row")
    ended = 0
    with progress_bar(f"{count} runs", progress) as bar:

        def told(case: Case, row: dict[str, Any]) -> None:
            nonlocal ended
            ended += 1
            bar(ended / count)
            if row[ERROR]:
                warn(f"failed: {case.label}: {row[ERROR]}")

        swept = run_sweep_study(cases, options, told=told)
    with Workers(options.jobs) as workers:
        files = found.present(cases, options, workers)
    say(f"rows: {rows_folder(options)}")
    for what, path in files.items():
        say(f"{what}: {path}")
    warn_outdated(swept.outdated)
    if swept.failed:
        warn(f"loss: {swept.failed} runs failed; the same command tries them again")
    if swept.lossy:
        warn(f"loss: {swept.lossy} runs lost something; see the column losses")
    return swept.exit_code
