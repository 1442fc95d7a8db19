"""A comparison of methods as a Rerun recording with its layout inside."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import rerun as rr

from replay.evaluate.compare import Method
from replay.evaluate.compare_table import markdown
from replay.time import to_text
from replay.view.blueprint import Contents, make_blueprint
from replay.view.compare_panels import compare_panels, compared_data, span_of
from replay.view.compare_report import automatic_scenes
from replay.view.recording import RecordingOptions, recording_file
from replay.view.scene import draw_scene
from replay.view.scenes import Stretch
from replay.view.states import draw_states


def write_compared(
    methods: Sequence[Method],
    out_rrd: Path,
    *,
    scenes: Sequence[Stretch] | None = None,
    options: RecordingOptions | None = None,
) -> None:
    """Draw methods over one another into a `.rrd` file: map, plan, errors, geometry.

    Parameters
    ----------
    methods : sequence of Method
        At least one.
    out_rrd : Path
        Replaced once the recording is whole.
    scenes : sequence of Stretch or None
        Told in the last tab; None chooses them.
    options : RecordingOptions or None

    Raises
    ------
    ReplayError
        Where it cannot be written.
    """
    chosen = options or RecordingOptions()
    data = compared_data(methods)
    name = "comparison of " + ", ".join(m.name for m in methods)
    told = automatic_scenes(methods) if scenes is None else scenes
    with recording_file(out_rrd, name, {}) as sink:
        scene = draw_scene(
            sink, data, exaggeration=1, max_path_points=chosen.max_path_points, bodies=False
        )
        panels = compare_panels(methods)
        for panel in panels:
            sink.panel(panel, "plots", ())
        sink.static(
            "about",
            rr.TextDocument(_about(methods, told), media_type=rr.MediaType.MARKDOWN),
        )
        contents = Contents(
            panels,
            scene,
            (),
            has_events=False,
            has_states=bool(draw_states(sink, data)),
            run_count=len(methods),
            span_ns=span_of(methods),
        )
        sink.recording.send_blueprint(make_blueprint(contents, active_tab=chosen.active_tab))


def _about(methods: Sequence[Method], scenes: Sequence[Stretch]) -> str:
    logs = [f"- {m.name}: run {m.data.run} of {m.log.name}" for m in methods]
    stretches = [
        f"- {scene.title}: {to_text(scene.start_ns)} to {to_text(scene.end_ns)}" for scene in scenes
    ]
    return "\n".join(
        ["# Methods", markdown(methods), "", "# Scenes, GPS time", *stretches, "", "# Logs", *logs]
    )
