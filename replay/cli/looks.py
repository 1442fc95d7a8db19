"""Commands that look at runs: evaluate, compare, diff, view, report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from replay.cli.app import app, leave, out, say, warn
from replay.cli.arguments import Output
from replay.errors import ExitCode, MissingChannelError, UsageError

if TYPE_CHECKING:
    from replay.evaluate.compare import Method
    from replay.view.scenes import Stretch

WrongFixLimit = Annotated[
    float,
    typer.Option("--wrong-fix-limit", help="Horizontal error in metres over which a fix is wrong."),
]


ReferencePoint = Annotated[
    str | None,
    typer.Option(
        "--reference",
        help="Where a receiver stands still, instead of the log's truth: X,Y,Z in metres, ECEF,"
        " or `mean` for the mean of the last half of the run.",
    ),
]


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
    wrong_fix_limit: WrongFixLimit = 0.10,
    reference: ReferencePoint = None,
    limit: Annotated[
        str, typer.Option(help="Within which a receiver that stands still has converged.")
    ] = "10 cm",
    hold: Annotated[str, typer.Option(help="For how long, besides to the end.")] = "10 min",
    start_up: Annotated[
        str, typer.Option(help="Left out of the figures of a receiver that stands still.")
    ] = "1 h",
    session: Annotated[
        str | None, typer.Option(help="Cut such a run into sessions so long, as 6 h.")
    ] = None,
) -> None:
    """Compare a run with the truth in its log, or with where its receiver stands still."""
    from replay.evaluate import evaluate_run, print_evaluation
    from replay.evaluate.station_options import station_options

    evaluation = evaluate_run(
        log,
        run=run,
        fixed_truth_only=fixed_truth_only,
        wrong_fix_limit_m=wrong_fix_limit,
        station=station_options(
            reference=reference, limit=limit, hold=hold, start_up=start_up, session=session
        ),
    )
    if as_json:
        typer.echo(json.dumps(evaluation.to_json_dict(), indent=2))
    else:
        print_evaluation(evaluation, out)


@app.command()
def compare(
    logs: Annotated[list[Path], typer.Argument(help="Logs of runs, with truth.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    as_markdown: Annotated[bool, typer.Option("--markdown", help="Print Markdown.")] = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write one self-contained HTML page.")
    ] = None,
    rrd: Annotated[Path | None, typer.Option(help="Write a Rerun recording.")] = None,
    png: Annotated[Path | None, typer.Option(help="Render the recording to a picture too.")] = None,
    scene: Annotated[
        list[str] | None,
        typer.Option(
            help="START,END of a stretch to show closely, seconds as on the page's axes or"
            " dates; may be repeated. Without it three are chosen."
        ),
    ] = None,
    title: Annotated[str | None, typer.Option(help="Title of the page.")] = None,
    fixed_truth_only: Annotated[
        bool, typer.Option("--fixed-truth-only", help="Leave out truth that is not fixed.")
    ] = False,
    wrong_fix_limit: WrongFixLimit = 0.10,
) -> None:
    """Compare methods: every run of every log against truth, in one table."""
    from replay.evaluate.compare import read_methods, to_json_dict
    from replay.evaluate.compare_table import markdown, print_comparison

    if png is not None and rrd is None:
        raise UsageError("--png renders a recording", mend="give --rrd FILE too")
    methods = read_methods(
        logs, fixed_truth_only=fixed_truth_only, wrong_fix_limit_m=wrong_fix_limit
    )
    scenes = _scenes(methods, scene) if scene else None
    if as_json:
        typer.echo(json.dumps(to_json_dict(methods), indent=2))
    elif as_markdown:
        typer.echo(markdown(methods))
    else:
        print_comparison(methods, out)
    if output is not None:
        from replay.view.compare_report import write_comparison

        write_comparison(methods, output, scenes=scenes, title=title or "Comparison of methods")
        warn(f"report: {output}")
    if rrd is not None:
        from replay.view.compare_recording import write_compared

        write_compared(methods, rrd, scenes=scenes)
        warn(f"recording: {rrd} (open it with: rerun {rrd})")
        if png is not None:
            from replay.view.picture import render_png

            render_png(rrd, png)
            warn(f"picture: {png}")


def _scenes(methods: list[Method], texts: list[str]) -> list[Stretch]:
    """Stretches that a person wrote; seconds count from the first solution."""
    from replay.engine.moments import parse_time
    from replay.view.compare_panels import span_of
    from replay.view.scenes import Stretch

    start_ns, _ = span_of(methods)
    found: list[Stretch] = []
    for text in texts:
        first, comma, last = text.partition(",")
        if not comma:
            raise UsageError(f"{text!r} is no scene", mend="write --scene START,END, as in 40,55")
        begin, end = parse_time(first, start_ns), parse_time(last, start_ns)
        if end <= begin:
            raise UsageError(f"the scene {text!r} ends before it begins", mend="write START,END")
        found.append(Stretch("Scene", begin, end))
    return found


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
    reference: ReferencePoint = None,
) -> None:
    """Write a Rerun recording of a run."""
    from replay.evaluate.station_options import parse_reference
    from replay.view.recording import RecordingOptions, write_recording

    place = None if reference is None else parse_reference(reference)
    write_recording(log, output, options=RecordingOptions(reference=place))
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
    reference: ReferencePoint = None,
) -> None:
    """Write one self-contained HTML page about a run."""
    from replay.evaluate import evaluate_run, runs_of
    from replay.evaluate.station import StationOptions
    from replay.evaluate.station_options import parse_reference
    from replay.view.report import write_report

    place = None if reference is None else parse_reference(reference)
    station = StationOptions(reference=place)
    evaluation: dict[str, Any] | None
    try:
        names = runs_of(log)
        if len(names) > 1:
            evaluation = {
                name: evaluate_run(log, run=name, station=station).to_json_dict() for name in names
            }
        else:
            evaluation = evaluate_run(log, station=station).to_json_dict()
    except MissingChannelError as error:
        evaluation = None
        warn(f"no figures against truth: {error.what}")
    write_report(log, output, evaluation=evaluation, title=title, reference=place)
    say(f"report: {output}")
