"""The study as a Rerun recording: tables, layout with trajectories, a tab for each figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from replay.batch.lee2010.figures import CaseRuns, FigureOfPaper, span_of
from replay.batch.lee2010.report import TITLE, stations_of
from replay.batch.lee2010.tables import Cases, all_tables, markdown_of, seeds_said, span_said
from replay.view.blueprint import panel_rows, station_views
from replay.view.gather import Run, RunData
from replay.view.network_scene import draw_places
from replay.view.panels import Panel
from replay.view.recording import recording_file
from replay.view.scene import draw_scene
from replay.view.sink import TIMELINE

_MOST_POINTS = 20_000
_MOST_ROWS = 6  # of a tab: more are too low to be read


def write_study_recording(
    cases: Cases, runs: Sequence[CaseRuns], figures: Sequence[FigureOfPaper], out_rrd: Path
) -> None:
    """Write the recording; see the module.

    Raises
    ------
    ReplayError
        Where it cannot be written.
    """
    span = span_of(runs)
    with recording_file(out_rrd, TITLE, {}) as sink:
        text = "\n\n".join(
            [
                f"# {TITLE}",
                seeds_said(cases),
                span_said(cases),
                *map(markdown_of, all_tables(cases)),
            ]
        )
        sink.static("tables", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
        tabs: list[rrb.Container] = [
            rrb.Vertical(
                rrb.TextDocumentView(origin="/tables", name="Tables 1 to 3"), name="Tables"
            )
        ]
        scene = draw_scene(
            sink, _paths(runs), exaggeration=1, max_path_points=_MOST_POINTS, bodies=False
        )
        stations = draw_places(sink, stations_of(runs), scene)
        if scene is not None and stations is not None:
            views = station_views(stations, scene)
            tabs.append(rrb.Vertical(rrb.Horizontal(*views), name="3, 4 Layout"))
        for item in figures:
            for panel in item.panels:
                sink.panel(panel, "plots", ())
            for number, part in enumerate(_parts(item)):
                name = f"{item.number} {_short(item)}" + (f" ({number + 1})" if number else "")
                tabs.append(rrb.Vertical(*panel_rows(part, span), name=name))
        sink.recording.send_blueprint(
            rrb.Blueprint(
                rrb.Tabs(*tabs, active_tab=1 if len(tabs) > 1 else 0),
                rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="paused"),
                rrb.BlueprintPanel(state="collapsed"),
                rrb.SelectionPanel(state="collapsed"),
                auto_views=False,
            )
        )


def _parts(item: FigureOfPaper) -> list[tuple[Panel, ...]]:
    """Panels of each tab of a figure, alike in number."""
    rows = -(-len(item.panels) // item.columns)
    size = -(-rows // -(-rows // _MOST_ROWS)) * item.columns
    return [item.panels[at : at + size] for at in range(0, len(item.panels), size)]


def _short(item: FigureOfPaper) -> str:
    return {
        5: "Filter states", 6: "Filtered residuals", 7: "Corrections", 8: "Rover residuals",
        9: "Navigation", 10: "Differences",
    }.get(item.number, item.title)  # fmt: skip


def _paths(runs: Sequence[CaseRuns]) -> RunData:
    """The solutions of all cases, each under its title, thinned to a row a second."""
    found: list[Run] = []
    for case in runs:
        solution = case.any_run.solution
        seconds = solution.valid_time_ns // 1_000_000_000
        first = np.flatnonzero(np.append(True, np.diff(seconds) > 0))
        kept = solution.take(first)
        by_ns = runs[0].start_ns - case.start_ns
        if by_ns:
            kept = type(kept)(
                kept.log_time_ns + by_ns, kept.valid_time_ns + by_ns, kept.sequence, kept.values,
                kept.present,
            )  # fmt: skip
        found.append(Run(case.title, solution=kept))
    return RunData(
        truth=None, fixes={}, observations={}, runs=tuple(found), stats={}, outages=(), metadata={}
    )
