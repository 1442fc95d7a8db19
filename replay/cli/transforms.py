"""The command that makes a log worse, or other, on purpose."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from replay.cli.app import app, leave, say, warn
from replay.cli.arguments import Output, read_toml
from replay.cli.runs import ShowProgress, progress_bar

if TYPE_CHECKING:
    from replay.engine.transforms import Transform

_LISTS: Final = ("remove_systems", "remove_satellites", "remove_signals")


@app.command()
def transform(
    log: Annotated[Path, typer.Argument(help="Log to change.")],
    output: Output,
    remove_systems: Annotated[
        list[str] | None, typer.Option(help="Letters of systems that go, as R,C.")
    ] = None,
    remove_satellites: Annotated[
        list[str] | None, typer.Option(help="Satellites that go, as G05,G12.")
    ] = None,
    remove_signals: Annotated[
        list[str] | None, typer.Option(help="Signals of a system that go, as G2W,E5Q.")
    ] = None,
    outage: Annotated[
        list[str] | None,
        typer.Option(
            help="T0,DT: from T0 for DT seconds no GNSS; with ,keep=3 the three highest "
            "satellites stay, with ,keep=low:3 the lowest, with ,keep=G05+G12 these. May be "
            "repeated."
        ),
    ] = None,
    every: Annotated[
        float | None, typer.Option(help="Repeat each outage every so many seconds.")
    ] = None,
    leave_last: Annotated[
        float | None, typer.Option(help="With --every: seconds at the end that stay whole [30].")
    ] = None,
    imu_rate: Annotated[
        float | None, typer.Option(help="Hertz; theirs must be a whole multiple of it.")
    ] = None,
    imu_method: Annotated[
        str | None, typer.Option(help="integrate (default), or decimate: every n-th sample.")
    ] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option(
            help="TOPIC.FIELD=DEVIATION, white, of each sample that is written: "
            "'/imu/raw.angular_rate=0.1 deg/s', '/gnss/rover/obs.pseudorange=2 m'."
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Of the noise [0].")] = None,
    time_offset: Annotated[
        list[str] | None,
        typer.Option(help="TOPIC=SECONDS added to a channel's times: '/imu/raw=5 ms'."),
    ] = None,
    config: Annotated[
        Path | None, typer.Option(help="TOML file of the same words, or of a log's manifest.")
    ] = None,
    progress: ShowProgress = None,
) -> None:
    """Write a log with something taken away, made coarser, added or moved.

    Always in this order: systems, satellites and signals go, then outages; inertial samples
    become fewer; noise is added; channels are moved in time. Results of runs do not stay.
    """
    from replay.engine.transforms import transform_log

    words = {
        "remove_systems": remove_systems,
        "remove_satellites": remove_satellites,
        "remove_signals": remove_signals,
        "outage": outage,
        "every": every,
        "leave_last": leave_last,
        "imu_rate": imu_rate,
        "imu_method": imu_method,
        "noise": noise,
        "seed": seed,
        "time_offset": time_offset,
    }
    settings = _settings({name: word for name, word in words.items() if word is not None}, config)
    with progress_bar("transform", progress) as told:
        done = transform_log(log, output, settings, progress=told)
    for note in done.notes:
        say(note)
    for loss in done.losses.losses:
        warn(f"loss: {loss}")
    leave(done.losses.exit_code)


def _settings(words: dict[str, Any], config: Path | None) -> Transform:
    from replay.configuration import build
    from replay.engine.transforms import Transform
    from replay.engine.transforms.settings import comma_separated

    for name in _LISTS:
        if name in words:
            words[name] = comma_separated(words[name])
    tables: list[dict[str, Any]] = [words]
    if config is not None:
        tables.insert(0, read_toml(config))
    return build(Transform, tables)
