"""Commands that look at runs: evaluate, diff, view, report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from replay.cli.app import app, leave, out, say, warn
from replay.cli.arguments import Output
from replay.errors import ExitCode, MissingChannelError, UsageError


@app.command()
def evaluate(
    log: Annotated[Path, typer.Argument(help="Log of a run, with truth.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    run: Annotated[str | None, typer.Option(help="Name of the run, where there are several.")] = (
        None
    ),
    fixed_truth_only: Annotated[
        bool, typer.Option("--fixed-truth-only", help="Leave out truth that is not fixed.")
    ] = False,
) -> None:
    """Compare a run with the truth in its log."""
    from replay.evaluate import evaluate_run, print_evaluation

    evaluation = evaluate_run(log, run=run, fixed_truth_only=fixed_truth_only)
    if as_json:
        typer.echo(json.dumps(evaluation.to_json_dict(), indent=2))
    else:
        print_evaluation(evaluation, out)


@app.command()
def diff(
    a: Annotated[Path, typer.Argument(help="Log of a run.")],
    b: Annotated[Path, typer.Argument(help="Log of another run over the same input.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    as_markdown: Annotated[
        bool, typer.Option("--markdown", help="Print Markdown for a pull request.")
    ] = False,
    rrd: Annotated[Path | None, typer.Option(help="Write a recording of A, B and A-B.")] = None,
    map_run: Annotated[
        list[str] | None, typer.Option(help="NAME_IN_A=NAME_IN_B; may be repeated.")
    ] = None,
    topic: Annotated[list[str] | None, typer.Option(help="Compare only these topics.")] = None,
    allow_different_inputs: Annotated[
        bool, typer.Option("--allow-different-inputs", help="Compare runs over different logs.")
    ] = False,
) -> None:
    """Compare two runs, down to the stage and step where they first part."""
    from replay.diff import DiffOptions, diff_logs, render_markdown, render_terminal, to_json

    names: dict[str, str] = {}
    for pair in map_run or []:
        first, sign, second = pair.partition("=")
        if not sign:
            raise UsageError(f"{pair!r} maps nothing", mend="write --map-run NAME_IN_A=NAME_IN_B")
        names[first] = second
    options = DiffOptions(
        run_names=names,
        topics=tuple(topic or ()),
        allow_different_inputs=allow_different_inputs,
    )
    result = diff_logs(a, b, options)
    if as_json:
        typer.echo(to_json(result).decode())
    elif as_markdown:
        typer.echo(render_markdown(result))
    else:
        render_terminal(result, out)
    if rrd is not None:
        from replay.diff.recording import write_rrd

        write_rrd(result, rrd)
        warn(f"recording: {rrd}")
    leave(ExitCode(result.exit_code))


@app.command()
def view(
    log: Annotated[Path, typer.Argument(help="Log of a run.")],
    output: Output,
    png: Annotated[Path | None, typer.Option(help="Render the recording to a picture too.")] = None,
) -> None:
    """Write a Rerun recording of a run."""
    from replay.view.recording import write_recording

    write_recording(log, output)
    say(f"recording: {output} (open it with: rerun {output})")
    if png is not None:
        from replay.view.picture import render_png

        render_png(output, png)
        say(f"picture: {png}")


@app.command()
def report(
    log: Annotated[Path, typer.Argument(help="Log of a run.")],
    output: Output,
    title: Annotated[str | None, typer.Option(help="Title of the page.")] = None,
) -> None:
    """Write one self-contained HTML page about a run."""
    from replay.evaluate import evaluate_run
    from replay.view.report import write_report

    try:
        evaluation = evaluate_run(log).to_json_dict()
    except MissingChannelError as error:
        evaluation = None
        warn(f"no figures against truth: {error.what}")
    write_report(log, output, evaluation=evaluation, title=title)
    say(f"report: {output}")
