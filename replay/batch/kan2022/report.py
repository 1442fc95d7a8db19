"""The page of the study: the paper's tables and figures beside ours, and the claim tested."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from html import escape
from typing import Any, Final

from replay.batch.kan2022 import published
from replay.batch.kan2022.charts import (
    comparison_chart,
    drift_chart,
    greatest_chart,
    trajectory_chart,
)
from replay.batch.kan2022.claim import claim_said
from replay.batch.kan2022.figures import METHODS, FigureOfPaper, Shown
from replay.batch.kan2022.measure import POSITION
from replay.batch.kan2022.plan import ALONE, Plan
from replay.batch.kan2022.runs import Kind, Runs, drift_sizes_cm, improvement_percent, rms_of
from replay.batch.kan2022.tables import (
    accuracy_tables,
    aim_table,
    comparison_table,
    drift_table,
    reference_table,
    seeds_said,
)
from replay.batch.workers import Workers
from replay.evaluate.statistics import LOCAL_AXES
from replay.view.charts import Chart, Clock, panels_chart
from replay.view.markup import Table, figure, page, section, tiles

TITLE: Final = "Kan (2022): PPP/INS, and the rate of the inertial samples"
_PAPER: Final = (
    "J. Kan, Z. Gao, Y. Min, Evaluation on Tightly Coupled Integration of GPS PPP and Different"
    " Interval IMU Data, Work-in-Progress Proceedings, September 2022. The paper's drive is real;"
    " ours is simulated, of its speed, satellites and inertial unit, so that truth is known and the"
    " drive can be had again with other errors."
)
_STYLE: Final = (
    "<style>.runs td { white-space: nowrap } .runs table { font-size: 12px }"
    " .runs th, .runs td { padding-right: 9px }</style>"
)


def report_html(
    runs: Runs,
    found: Shown | None,
    figures: Sequence[FigureOfPaper],
    plan: Plan,
    *,
    command: str,
    workers: Workers,
) -> str:
    """The page as text."""
    parts = [
        _STYLE,
        f"<h1>{escape(TITLE)}</h1><p class='sub'>{escape(_PAPER)}</p>",
        tiles(_headline(runs)),
        _failed(runs),
        _claim(runs),
        section(
            "Tables, ours beside the published",
            [
                f"<p>{escape(seeds_said(runs))} {escape(_basis(plan))}</p>",
                *_tables([aim_table(runs), *accuracy_tables(runs), reference_table(runs)]),
                *_tables([drift_table(runs, grade) for grade in runs.grades()]),
            ],
        ),
    ]
    if found is not None:
        parts += _figures(found, figures, workers)
    parts += [_contradictions(), _runs_said(plan), _made(command)]
    return page(TITLE, "\n".join(part for part in parts if part))


def _tables(tables: Sequence[Table]) -> list[str]:
    return [f"<div class='dense runs'>{table.html()}</div>" for table in tables if table.rows]


def _headline(runs: Runs) -> Iterator[tuple[str, str, str]]:
    grade = runs.grades()[0] if runs.grades() else ""
    for kind in runs.tight(grade, outage=False)[:1]:
        found, alone = rms_of(runs, kind), rms_of(runs, Kind(ALONE))
        if found is None:
            return
        values = found.mean(POSITION)
        told = " / ".join(f"{value:.1f}" for value in values)
        yield f"Position rms E / N / U, {kind.words()}", told, "cm"
        if alone is not None:
            better = improvement_percent(values, alone.mean(POSITION))
            yield "Better than PPP alone", " / ".join(f"{value:.0f}" for value in better), "%"
    for kind in runs.tight(grade, outage=True)[:1]:
        sizes = drift_sizes_cm(runs, kind)
        told = " / ".join(f"{value:.0f}" for value in sizes.mean(axis=0)[:3])
        yield f"Drift after the outage, {kind.words()}", told, "cm"
    yield "Seeds", str(len(runs.seeds)), ""


def _failed(runs: Runs) -> str:
    if not runs.failed:
        return ""
    items = "".join(f"<li>{escape(text)}</li>" for text in runs.failed)
    return section("Missing", [f"<p>{len(runs.failed)} runs are not in here:</p><ul>{items}</ul>"])


def _claim(runs: Runs) -> str:
    parts: list[str] = []
    for grade in runs.grades():
        said = claim_said(runs, grade)
        if said:
            parts.append(f"<p><b>{escape(grade)}.</b> {escape(said)}</p>")
            chart = comparison_chart(runs, grade)
            if chart is not None:
                parts.append(figure(chart, "Paired differences of drifts with their intervals"))
            parts += _tables(
                [comparison_table(runs, grade, added=added) for added in (True, False)]
            )
    if parts:
        words = (
            "The paper says that with lower rates of the inertial samples the position drifts less"
            " in outages, and takes it for less accumulation of sensor errors. Here each rate is"
            " had in two ways from the same 200 Hz: integrated, where a sample is the sum of all"
            " that it stands for, and decimated, where it is one of them and the others are lost."
            " What is judged is what an outage added to the position difference: that at its"
            " end, which the paper calls drift, is mostly what PPP has not converged from, and an"
            " error may make it smaller."
        )
        parts.insert(0, f"<p>{escape(words)}</p>")
    return section("Does a slower unit drift less?", parts)


def _basis(plan: Plan) -> str:
    return (
        f"Runs: {plan.alone} without inertial samples, {plan.tight} with them; the reference is"
        f" {' and '.join([plan.reference, *plan.then])} with the high-grade unit. All figures of a"
        " seed begin at the first epoch that all its runs share. PPP alone has no position with"
        " three satellites: those epochs are not in its root mean square, but they are in those of"
        " the tightly coupled runs."
    )


def _figures(found: Shown, figures: Sequence[FigureOfPaper], workers: Workers) -> list[str]:
    clock = Clock(found.begin_ns, found.end_ns)
    over_day = [item for item in figures if item.number < 10]
    tasks: list[tuple[Callable[..., Chart | None], tuple[Any, ...]]] = [
        (_chart_of, (item, clock)) for item in over_day
    ]
    drawn = workers.call(tasks)
    charts: list[tuple[str, Chart | None, str]] = [
        ("Figure 2. Trajectory", trajectory_chart(found), "Plan of the path")
    ]
    for item, chart in zip(over_day, drawn, strict=True):
        names = ", ".join(panel.heading for panel in item.panels)
        charts.append((f"Figure {item.number}. {item.title}", chart, f"Plots over time: {names}"))
    charts += [
        *(
            (
                f"Figure 10. Drift in the outages, samples {words}",
                drift_chart(found, method),
                "Drift along time",
            )
            for method, words in METHODS.items()
        ),
        ("Figure 11. Greatest drifts", greatest_chart(found), "Bars of greatest drifts"),
    ]
    return [
        section(title, [figure(chart, words)])
        for title, chart, words in charts
        if chart is not None
    ]


def _chart_of(item: FigureOfPaper, clock: Clock) -> Chart | None:
    return panels_chart(
        item.panels, clock, item.outages, caption=item.caption, columns=item.columns
    )


def _contradictions() -> str:
    implied = published.implied_ppp_cm(
        published.POSITION_CM[200], published.IMPROVEMENT_PERCENT[200]
    )
    told = ", ".join(f"{a} {v:.2f}" for a, v in zip(LOCAL_AXES, implied, strict=True))
    items = "".join(f"<li>{escape(text)}</li>" for text in published.CONTRADICTIONS)
    return section(
        "What the paper prints",
        [
            "<p>Only figures that stand in the paper's sentences are in the tables; those of its"
            " tables are pictures in the source that was read. PPP alone without outages is not"
            f" stated; the improvements over it mean {escape(told)} cm.</p>",
            f"<ul>{items}</ul>",
        ],
    )


def _runs_said(plan: Plan) -> str:
    rows = (
        ("scenario", plan.scenario.name),
        ("inertial units", ", ".join(plan.units)),
        ("rates", ", ".join(f"{rate} Hz" for rate in plan.rates_hz)),
        ("outages", "; ".join(plan.outages)),
        ("PPP alone", plan.alone),
        ("tightly coupled", plan.tight),
        ("reference", ", ".join([plan.reference, *plan.reference_settings, *plan.then])),
    )
    text = plan.scenario.read_text(encoding="utf-8")
    return section(
        "Runs",
        [
            Table(("what", "value"), rows, text_columns=2).html(),
            f"<details><summary>The scenario</summary><pre>{escape(text)}</pre></details>",
        ],
    )


def _made(command: str) -> str:
    return section("How it was made", [f"<pre>{escape(command)}</pre>"])
