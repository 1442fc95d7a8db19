"""Commands that run things: run, verify, pipelines, degrade, simulate, baseline, warmup."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from replay.cli.app import app, err, leave, out, say, warn
from replay.cli.arguments import Output, read_toml
from replay.cli.events import event_summary
from replay.errors import ExitCode, UsageError

ShowProgress = Annotated[
    bool | None, typer.Option("--progress/--no-progress", help="Default: on a terminal only.")
]


@contextmanager
def progress_bar(words: str, show: bool | None) -> Iterator[Callable[[float], None]]:
    """A bar on the error stream; the value is told the fraction done."""
    visible = err.is_terminal if show is None else show
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=err, disable=not visible) as bar:
        task = bar.add_task(words, total=1.0)
        yield lambda fraction: bar.update(task, completed=fraction)


@app.command()
def run(
    pipeline: Annotated[str, typer.Argument(help="Name; `replay pipelines` lists them.")],
    log: Annotated[Path, typer.Argument(help="Log to run over.")],
    output: Output,
    rrd: Annotated[Path | None, typer.Option(help="Write a Rerun recording too.")] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="section.key=value, with units: '5 deg/h'.")
    ] = None,
    config: Annotated[Path | None, typer.Option(help="TOML file of settings.")] = None,
    start: Annotated[str | None, typer.Option("--from", help="Log time to begin at.")] = None,
    end: Annotated[str | None, typer.Option("--to", help="Log time to end before.")] = None,
    checkpoint_every: Annotated[int, typer.Option(help="Seconds of log time; 0 for none.")] = 0,
    resume: Annotated[
        Path | None, typer.Option(help="Earlier log of this run, to go on from its checkpoint.")
    ] = None,
    progress: ShowProgress = None,
) -> None:
    """Run a pipeline over a log and write everything it says to a new log."""
    from replay.configuration import parse_assignments
    from replay.engine.job import make_job
    from replay.engine.moments import parse_time
    from replay.engine.run import replay_log
    from replay.log.reader import LogReader

    if checkpoint_every < 0:
        raise UsageError("--checkpoint-every is a number of seconds, 0 or more")
    tables = []
    if config is not None:
        tables.append(read_toml(config))
    tables.append(parse_assignments(settings or []))
    with LogReader(log) as reader:
        job = make_job(
            reader,
            pipeline,
            tables=tables,
            start_ns=None if start is None else parse_time(start, reader.start_ns),
            end_ns=None if end is None else parse_time(end, reader.start_ns),
            checkpoint_every_s=checkpoint_every,
        )
        with progress_bar(f"{pipeline}", progress) as told:
            result = replay_log(reader, output, job, resume=resume, progress=told)
    table = Table("channel", "rows", "sha256", title=f"{output}", title_justify="left")
    for topic, digest in result.outputs.items():
        table.add_row(topic, f"{digest.message_count:,}", digest.sha256[:16])
    out.print(table)
    if result.first_ns >= 0:
        say(f"{(result.last_ns - result.first_ns) / 1e9:,.1f} s of log")
    for line in event_summary(output):
        say(line)
    for note in result.notes:
        warn(f"note: {note}")
    if rrd is not None:
        from replay.view.recording import write_recording

        write_recording(output, rrd)
        say(f"recording: {rrd}")
    leave(result.losses.exit_code)


@app.command()
def verify(
    log: Annotated[Path, typer.Argument(help="Log of a run.")],
    source: Annotated[Path, typer.Option("--input", help="Log that the run was made from.")],
    progress: ShowProgress = None,
) -> None:
    """Run a recorded run again and compare every output channel, bit for bit."""
    from replay.engine.run import verify_run

    with progress_bar("verify", progress) as told:
        verification = verify_run(log, source, progress=told)
    table = Table("channel", "recorded", "run again", "")
    for channel in verification.channels:
        word = "[green]equal[/]" if channel.equal else "[bold red]different[/]"
        table.add_row(channel.topic, channel.recorded[:16], channel.found[:16], word)
    out.print(table)
    if verification.exit_code is not ExitCode.OK:
        say("`replay diff` of both runs shows where they part")
    leave(verification.exit_code)


@app.command()
def pipelines(
    name: Annotated[str | None, typer.Argument(help="One pipeline, with its settings.")] = None,
) -> None:
    """List the pipelines, or the settings of one."""
    from replay.configuration import describe
    from replay.engine.pipelines import PIPELINES, find_pipeline

    if name is None:
        table = Table("pipeline", "what it does")
        for pipeline in PIPELINES.values():
            table.add_row(pipeline.name, pipeline.about)
        out.print(table)
        return
    found = find_pipeline(name)
    table = Table("setting", "default", "unit", "meaning", title=found.about)
    for row in describe(found.config):
        table.add_row(*row)
    out.print(table)


@app.command()
def degrade(
    log: Annotated[Path, typer.Argument(help="Log to change.")],
    output: Output,
    outage: Annotated[
        list[str],
        typer.Option(
            help="T0,DT: from T0 for DT seconds no GNSS; with ,keep=3 the three best satellites "
            "stay, with ,keep=G05+G12 these. May be repeated."
        ),
    ],
    every: Annotated[
        float, typer.Option(help="Repeat each outage every so many seconds; 0 for once.")
    ] = 0.0,
    leave_last: Annotated[
        float, typer.Option(help="With --every: seconds at the end that stay whole.")
    ] = 30.0,
) -> None:
    """Write a log without GNSS, or with few satellites, for some stretches of time."""
    from replay.engine.degrade import plan_outages, remove_fixes

    outages = plan_outages(log, outage, every_s=every, leave_last_s=leave_last)
    removed = remove_fixes(log, output, outages)
    for topic, count in removed.items():
        say(f"{topic}: {count:,} rows left out in {len(outages)} outages")


@app.command()
def simulate(
    scenario: Annotated[Path, typer.Argument(help="TOML file that describes the drive.")],
    output: Output,
) -> None:
    """Make a log of a simulated drive with its truth."""
    from replay.simulate import simulate as make

    result = make(scenario, output)
    for topic, digest in result.outputs.items():
        say(f"{topic}: {digest.message_count:,} rows, sha256 {digest.sha256[:16]}")


@app.command()
def warmup(
    pipelines: Annotated[
        list[str] | None, typer.Argument(help="Pipelines that are wanted; all where none is named.")
    ] = None,
) -> None:
    """Compile kernels now, so that the next command starts fast."""
    from replay.engine.warmup import compile_kernels

    say(f"compiled kernels in {compile_kernels(pipelines or []):.1f} s")
