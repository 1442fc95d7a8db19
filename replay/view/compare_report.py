"""A comparison of methods as one HTML page that loads nothing."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Final

from replay.evaluate.compare import Method
from replay.evaluate.compare_table import ABOUT, ERROR_HEADS, OTHER_HEADS, axis_head, rows
from replay.time import seconds_between, to_text
from replay.view.charts import Clock, panels_chart
from replay.view.compare_charts import distribution_chart, overlay_chart, scenes_chart
from replay.view.compare_panels import compare_panels, span_of
from replay.view.files import write_page
from replay.view.labels import NONE
from replay.view.markup import Table, figure, page, section
from replay.view.panels import Panel, Section
from replay.view.scenes import Stretch, choose_scenes

_STACKED: Final = {
    Section.POSITION_ERROR: "Solution minus truth at each method's epochs.",
    Section.CHANGE_ERROR: "Change of position from epoch to epoch, solution minus truth.",
    Section.GEOMETRY: "Satellites that each method rests on, and their dilution of precision.",
}


def write_comparison(
    methods: Sequence[Method],
    out_html: Path,
    *,
    scenes: Sequence[Stretch] | None = None,
    title: str = "Comparison of methods",
) -> None:
    """Write the page; see :func:`comparison_html`.

    Raises
    ------
    ReplayError
        Where it cannot be written.
    """
    write_page(out_html, comparison_html(methods, scenes=scenes, title=title))


def comparison_html(
    methods: Sequence[Method],
    *,
    scenes: Sequence[Stretch] | None = None,
    title: str = "Comparison of methods",
) -> str:
    """The page as text; the same methods give the same bytes.

    Parameters
    ----------
    methods : sequence of Method
        At least one.
    scenes : sequence of Stretch or None
        Shown closely; None chooses them.
    title : str
    """
    if scenes is None:
        scenes = automatic_scenes(methods)
    clock = Clock(*span_of(methods))
    panels = compare_panels(methods)
    distribution = distribution_chart(methods)
    close = scenes_chart(methods, scenes)
    parts = [
        _header(methods, title, clock),
        section(
            "Figures",
            [f"<div class='dense'>{_table(methods).html()}</div>", f"<p>{escape(ABOUT)}</p>"],
        ),
        _stacked(panels, Section.POSITION_ERROR, clock),
        section(
            "Distribution",
            [figure(distribution, "Cumulative distribution of the horizontal error")]
            if distribution
            else [],
        ),
        _stacked(panels, Section.CHANGE_ERROR, clock),
        section(
            "Trajectories",
            [
                figure(overlay_chart(methods, scenes), "Trajectories of truth and all methods"),
                figure(close, "Trajectories in scenes, closely") if close else "",
            ],
        ),
        _stacked(panels, Section.GEOMETRY, clock),
        section("What was compared", [_logs(methods).html()]),
    ]
    return page(title, "\n".join(part for part in parts if part))


def automatic_scenes(methods: Sequence[Method]) -> list[Stretch]:
    """Scenes of the first method's truth and of the satellites that the methods used."""
    geometry = [m.data.geometry for m in methods if m.data.geometry is not None]
    return choose_scenes(methods[0].data.truth, geometry)


def _header(methods: Sequence[Method], title: str, clock: Clock) -> str:
    elapsed = float(seconds_between(clock.end_ns, clock.start_ns))
    text = (
        f"{to_text(clock.start_ns)} to {to_text(clock.end_ns)} GPS time, {elapsed:.1f} s"
        f" · {len(methods)} methods"
    )
    return f"<h1>{escape(title)}</h1><p class='sub'>{escape(text)}</p>"


def _table(methods: Sequence[Method]) -> Table:
    head = ("method", *(axis_head(name) for name in ERROR_HEADS), *OTHER_HEADS)
    body = tuple(
        tuple(
            NONE if set(cell) <= set("- /") else cell
            for cell in (name, *(" / ".join(cell) for cell in errors), *others)
        )
        for name, errors, others in rows(methods)
    )
    return Table(head, body)


def _stacked(panels: Sequence[Panel], kind: Section, clock: Clock) -> str:
    chosen = [panel for panel in panels if panel.section is kind]
    if not chosen:
        return ""
    chart = panels_chart(chosen, clock, (), caption=_STACKED[kind], columns=1)
    names = ", ".join(panel.heading for panel in chosen)
    return section(kind.value, [figure(chart, f"Plots over time: {names}")])


def _logs(methods: Sequence[Method]) -> Table:
    body = tuple(
        (
            m.name,
            m.data.run,
            m.log.name,
            m.evaluation.solution_of,
            str(m.evaluation.counts.solution_rows),
            str(m.evaluation.counts.epoch_rows),
            str(m.evaluation.counts.change_pairs),
            str(m.evaluation.counts.truth_rows),
        )
        for m in methods
    )
    head = (
        "method", "run", "log", "position of", "rows", "epochs compared", "pairs", "rows of truth",
    )  # fmt: skip
    return Table(head, body, text_columns=4)
