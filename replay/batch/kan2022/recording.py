"""The study as a Rerun recording: tables, trajectory, a tab for each figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from replay.batch.kan2022.charts import path_ecef_m, solution_ecef_m
from replay.batch.kan2022.claim import claim_said
from replay.batch.kan2022.figures import FigureOfPaper, Shown, rate_ink
from replay.batch.kan2022.report import TITLE
from replay.batch.kan2022.runs import Run, Runs, greatest_drifts_cm
from replay.batch.kan2022.tables import all_tables, method_said, seeds_said
from replay.batch.lee2010.tables import markdown_of
from replay.evaluate.geometry import Floats
from replay.evaluate.statistics import LOCAL_AXES
from replay.log.columns import Columns
from replay.view.blueprint import panel_rows, plan_eye
from replay.view.gather import Run as Drawn
from replay.view.gather import RunData
from replay.view.recording import recording_file
from replay.view.scene import draw_scene
from replay.view.sink import TIMELINE, Sink

_MOST_POINTS: Final = 20_000
_SHORT: Final = {
    3: "Satellites", 4: "Position", 5: "Velocity", 6: "Attitude", 7: "Position, outages",
    8: "Velocity, outages", 9: "Attitude, outages", 10: "Drift",
}  # fmt: skip


def write_study_recording(
    runs: Runs, found: Shown, figures: Sequence[FigureOfPaper], out_rrd: Path
) -> None:
    """Write the recording; see the module.

    Raises
    ------
    ReplayError
        Where it cannot be written.
    """
    span = (found.begin_ns, found.end_ns)
    with recording_file(out_rrd, TITLE, {}) as sink:
        text = "\n\n".join(
            [
                f"# {TITLE}",
                seeds_said(runs),
                *(f"**{grade}**: {claim_said(runs, grade)}" for grade in runs.grades()),
                *map(markdown_of, all_tables(runs)),
            ]
        )
        sink.static("tables", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
        tabs: list[rrb.Container] = [
            rrb.Vertical(rrb.TextDocumentView(origin="/tables", name="Tables"), name="Tables")
        ]
        tabs += _trajectory(sink, found)
        for item in figures:
            for panel in item.panels:
                sink.panel(panel, "plots", item.outages)
            shown = span
            if item.number == 10 and item.outages:
                shown = (item.outages[0].start_ns, item.outages[-1].end_ns)
            name = f"{item.number} {_SHORT.get(item.number, item.title)}"
            tabs.append(rrb.Vertical(*panel_rows(item.panels, shown), name=name))
        tabs += _greatest(sink, found)
        sink.recording.send_blueprint(
            rrb.Blueprint(
                rrb.Tabs(*tabs, active_tab=min(3, len(tabs) - 1)),
                rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="paused"),
                rrb.BlueprintPanel(state="collapsed"),
                rrb.SelectionPanel(state="collapsed"),
                auto_views=False,
            )
        )


def _trajectory(sink: Sink, found: Shown) -> list[rrb.Container]:
    runs = found.drawn(outage=True) or found.drawn(outage=False)
    if not runs:
        return []
    scene = draw_scene(
        sink,
        RunData(
            truth=_columns(runs[0], path_ecef_m(runs[0])), fixes={}, observations={},
            runs=tuple(
                Drawn(run.kind.words(), solution=_columns(run, solution_ecef_m(run)))
                for run in runs
            ),
            stats={}, outages=found.spans(), metadata={},
        ),
        exaggeration=1, max_path_points=_MOST_POINTS, bodies=False,
    )  # fmt: skip
    if scene is None:
        return []
    plan = rrb.Spatial3DView(
        origin="/world",
        name="Plan, local east-north-up [m], north up, outages red",
        eye_controls=plan_eye(scene.low_m, scene.high_m),
    )
    return [rrb.Vertical(plan, name="2 Trajectory")]


def _columns(run: Run, ecef_m: Floats) -> Columns:
    known = np.isfinite(ecef_m).all(axis=1)
    times = run.times_ns[known]
    return Columns.build(
        times, {"position_ecef_m": np.ascontiguousarray(ecef_m[known])}, log_time_ns=times
    )


def _greatest(sink: Sink, found: Shown) -> list[rrb.Container]:
    """Figure 11: a bar of each rate and way, in the order that the view's name tells."""
    kinds = found.runs.tight(found.grade, outage=True)
    if not kinds:
        return []
    rates = sorted({kind.rate_hz for kind in kinds}, reverse=True)
    order = ", ".join(f"{kind.rate_hz} {method_said(kind)[:3]}." for kind in kinds)
    views: list[rrb.View] = []
    for index, axis in enumerate(LOCAL_AXES):
        views.append(rrb.BarChartView(origin=f"/greatest/{axis}", name=f"{axis} [cm]: {order}"))
        for place, kind in enumerate(kinds):
            value = float(np.nanmean(greatest_drifts_cm(found.runs, kind)[:, index]))
            color = rate_ink(rates, kind.rate_hz).dark
            sink.static(
                f"greatest/{axis}/{place}_{kind.rate_hz}_{kind.method}",
                rr.BarChart([value], abscissa=[place], color=color),
            )
    return [rrb.Vertical(*views, name="11 Greatest drifts")]
