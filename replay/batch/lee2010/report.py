"""The page of the study: the paper's tables and figures, and what had to be assumed."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from replay.batch.lee2010.figures import CaseRuns, FigureOfPaper, span_of
from replay.batch.lee2010.published import TITLES
from replay.batch.lee2010.tables import Cases, all_tables, mode_figures, seeds_said, span_said
from replay.batch.workers import Workers
from replay.engine.manifest import MANIFEST, read_manifest
from replay.evaluate.geometry import Floats
from replay.view.charts import Chart, Clock, panels_chart
from replay.view.markup import Table, figure, page, section, tiles
from replay.view.network_charts import Track, layout_chart, trajectory_chart

TITLE: Final = "Lee (2010): GPS/INS with a network of reference stations"
_PAPER: Final = (
    "H. Lee, An Integration of GPS with INS Sensors for Precise Long-Baseline Kinematic"
    " Positioning, Sensors 10 (2010) 9424-9438. Three simulated cases; the same log of each is"
    " processed with the network's corrections and with the master station alone."
)
_LEFT_OUT: Final = ("segments",)


def report_html(
    cases: Cases,
    runs: Sequence[CaseRuns],
    figures: Sequence[FigureOfPaper],
    *,
    command: str,
    workers: Workers,
) -> str:
    """The page as text.

    Parameters
    ----------
    cases : mapping of case to sequence of Done
    runs : sequence of CaseRuns
        The first seed of each case.
    figures : sequence of FigureOfPaper
    command : str
        That makes it again.
    workers : Workers
        They draw the charts.
    """
    made = all_tables(cases)
    places, charts = _charts(runs, figures, workers)
    parts = [
        f"<h1>{escape(TITLE)}</h1><p class='sub'>{escape(_PAPER)}</p>",
        tiles(_headline(cases)),
        section(
            "Tables, ours beside the published",
            [
                f"<p>{escape(seeds_said(cases))} {escape(span_said(cases))}</p>",
                *(f"<div class='dense'>{table.html()}</div>" for table in made),
            ],
        ),
        places,
        *(_section_of(item, chart) for item, chart in zip(figures, charts, strict=True)),
        _assumptions(cases, runs),
        section("How it was made", [f"<pre>{escape(command)}</pre>", _configuration(runs)]),
    ]
    return page(TITLE, "\n".join(part for part in parts if part))


def _headline(cases: Cases) -> Iterator[tuple[str, str, str]]:
    for case, members in cases.items():
        figures = mode_figures(members[0], "network")
        if figures is not None and figures.epochs is not None and figures.position_cm:
            greatest = max(item.std for item in figures.position_cm.values())
            title = TITLES.get(case, case)
            yield f"{title}: integers right", f"{100 * figures.epochs.success:.1f}", "%"
            yield f"{title}: greatest std of N, E, H", f"{greatest:.1f}", "cm"


def stations_of(runs: Sequence[CaseRuns]) -> dict[str, Floats]:
    """Positions of the stations, the master first."""
    return runs[0].any_run.stations


def tracks_of(runs: Sequence[CaseRuns]) -> list[Track]:
    """True paths of the cases."""
    return [dataclasses.replace(case.any_run.track, name=case.title) for case in runs]


def _charts(
    runs: Sequence[CaseRuns], figures: Sequence[FigureOfPaper], workers: Workers
) -> tuple[str, list[Chart]]:
    """Sections of the places, and a chart of each figure; drawn beside each other."""
    stations, tracks = stations_of(runs), tracks_of(runs)
    clock = Clock(*span_of(runs))
    first = sorted(range(len(figures)), key=lambda i: -len(figures[i].panels))
    tasks: list[tuple[Callable[..., Chart], tuple[Any, ...]]]
    tasks = [(_chart_of, (figures[i], clock)) for i in first]
    tasks.append((trajectory_chart, (tracks,)))
    if stations:
        tasks.append((layout_chart, (stations, tracks)))
    drawn = workers.call(tasks)
    by_figure = dict(zip(first, drawn, strict=False))
    others = drawn[len(first) :]
    places = section(
        "Figure 4. Trajectories", [figure(others[0], "Trajectories of the cases in space")]
    )
    if stations:
        words = "Plan of reference stations, baselines and paths"
        places = (
            section("Figure 3. Reference stations and test areas", [figure(others[1], words)])
            + places
        )
    return places, [by_figure[i] for i in range(len(figures))]


def _chart_of(item: FigureOfPaper, clock: Clock) -> Chart:
    return panels_chart(item.panels, clock, (), caption=item.caption, columns=item.columns)


def _section_of(item: FigureOfPaper, chart: Chart) -> str:
    names = ", ".join(panel.heading for panel in item.panels)
    return section(
        f"Figure {item.number}. {item.title}", [figure(chart, f"Plots over time: {names}")]
    )


def _assumptions(cases: Cases, runs: Sequence[CaseRuns]) -> str:
    """Comments and settings of the scenarios: the paper does not tell most of them."""
    parts = [
        "<p>The paper names its simulator, the kinds of errors and the grade of the inertial unit,"
        " not the sizes of the errors. What follows is what the scenarios take.</p>"
    ]
    tables: dict[str, dict[str, str]] = {}
    told: dict[str, None] = {}
    for case in cases:
        path = cases[case][0].member.scenario
        told[_comment(path)] = None
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        rest = {key: value for key, value in table.items() if key not in _LEFT_OUT}
        tables[case] = dict(_flat(rest))
    parts += [f"<p>{escape(text)}</p>" for text in told if text]
    names = dict.fromkeys(name for table in tables.values() for name in table)
    rows: list[tuple[str, ...]] = []
    for name in names:
        values = [table.get(name, "") for table in tables.values()]
        alike = len(set(values)) == 1
        rows.append((name, *([values[0]] + [""] * (len(values) - 1) if alike else values)))
    head = ("setting", *(TITLES.get(case, case) for case in tables))
    caption = "Settings of the scenarios; one value where all cases have the same."
    body = Table(head, tuple(rows), caption=caption, text_columns=len(head)).html()
    parts.append(f"<details><summary>{len(rows)} settings</summary>{body}</details>")
    return section("Assumptions", parts)


def _comment(path: Path) -> str:
    """The comment that a scenario begins with, as one paragraph."""
    lines: list[str] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.removeprefix("#").strip())
    return " ".join(lines)


def _flat(table: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, str]]:
    for key, value in table.items():
        name = f"{path}.{key}" if path else key
        if isinstance(value, Mapping):
            yield from _flat(value, name)
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            for number, item in enumerate(value):
                yield from _flat(item, f"{name}.{item.get('name', number)}")
        else:
            yield name, str(value)


def _configuration(runs: Sequence[CaseRuns]) -> str:
    """Settings of the first case's run in network mode, as its manifest has them."""
    metadata = runs[0].any_run.metadata
    if MANIFEST not in metadata:
        return ""
    text = read_manifest(metadata, runs[0].title).configuration
    return (
        f"<details><summary>Settings of the run in network mode, {escape(runs[0].title.lower())}"
        f"</summary><pre>{escape(text.strip())}</pre></details>"
    )
