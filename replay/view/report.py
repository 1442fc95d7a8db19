"""A run log as one HTML page that loads nothing: for reading, mailing and printing.

The figures are the panels of the recording, drawn once as SVG. The same log and
evaluation give the same bytes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from replay.evaluate.station import Reference
from replay.schemas import replay_pb2
from replay.time import seconds_between, to_text
from replay.view import key_figures
from replay.view.about import manifest_of
from replay.view.charts import Clock, panels_chart
from replay.view.events import Event, events_of
from replay.view.files import write_page
from replay.view.gather import Batches, RunData, gather
from replay.view.histogram_chart import histogram_chart
from replay.view.imu_envelope import ImuEnvelope
from replay.view.labels import BOUNDS, NONE, SIGMA
from replay.view.markup import Table, figure, page, section, tiles
from replay.view.panels import Panel, Section
from replay.view.plan_chart import plan_chart
from replay.view.recording import all_panels
from replay.view.sky_chart import sky_chart, tracking_chart
from replay.view.source import open_run

_MOST_EVENTS: Final = 200
_BASE: Final = "base"
_STACKED: Final = {
    Section.POSITION_ERROR: f"Solution minus truth at the truth's point, with {BOUNDS}.",
    Section.POSITION_SIGMA: "There is no truth: the standard deviations that the filter states.",
    Section.CHANGE_ERROR: "Change of position from epoch to epoch, solution minus truth.",
    Section.VELOCITY_ERROR: f"Solution minus truth, with {BOUNDS} of the solution.",
    Section.ATTITUDE_ERROR: f"Solution minus truth, wrapped, with {BOUNDS} of the solution.",
}
_GROUPS: Final = (
    (
        "Convergence",
        (Section.CONVERGENCE,),
        "A receiver that stands still: solution minus its place, and the size of that.",
    ),
    (
        "Velocity and attitude",
        (Section.VELOCITY, Section.ATTITUDE),
        "Velocity in local east, north, up; roll, pitch and heading from true north.",
    ),
    (
        "Sensor errors",
        (
            Section.GYRO_BIAS,
            Section.ACCEL_BIAS,
            Section.GYRO_SCALE,
            Section.ACCEL_SCALE,
            Section.MOUNTING,
            Section.NON_SLIP,
            Section.SQUAT,
        ),
        f"Estimates with {BOUNDS} of the filter, in body axes.",
    ),
    (
        "Satellites and geometry",
        (Section.GEOMETRY,),
        "Satellites that the solution rests on, and dilution of precision.",
    ),
    (
        "Receiver clock",
        (Section.CLOCK,),
        "Receiver time less system time, as a length; the other systems against the first.",
    ),
    (
        "Carrier-phase displacement",
        (Section.DISPLACEMENT,),
        "Change of the antenna's position between epochs from carrier phases.",
    ),
    ("Ambiguities", (Section.AMBIGUITIES,), "Integer ambiguities, epoch by epoch."),
    (
        "Ambiguities of single phases",
        (Section.PHASES,),
        "What is estimated of each carrier phase, less what it came to at the end of its arc.",
    ),
    (
        "Atmosphere and biases",
        (Section.TROPOSPHERE, Section.IONOSPHERE, Section.RECEIVER_BIASES),
        f"Delays in the zenith and towards satellites, biases of codes, with {BOUNDS} or {SIGMA}.",
    ),
    (
        "Innovations",
        (Section.INNOVATIONS,),
        f"Measurement minus prediction, with {BOUNDS}; crosses were rejected.",
    ),
    (
        "Residuals per satellite",
        (Section.RESIDUALS,),
        "Measurement minus prediction of every measurement that was used.",
    ),
    ("Cycle slips", (Section.SLIPS,), "Breaks of carrier phases, by what found them."),
    (
        "Corrections per satellite",
        (Section.CORRECTIONS,),
        "Terms between range and pseudorange, as they add to the pseudorange.",
    ),
    (
        "Network of reference stations",
        (Section.NETWORK_CORRECTIONS, Section.NETWORK_ERRORS),
        "Corrections of the rover's phases, then errors between stations: as found and filtered.",
    ),
    ("GNSS", (Section.GNSS,), "What the receivers state."),
    ("Inertial samples", (Section.IMU,), "Least and greatest sample of each second."),
)


def write_report(
    run_log: Path,
    out_html: Path,
    *,
    evaluation: Mapping[str, Any] | None = None,
    title: str | None = None,
    reference: Reference | None = None,
) -> None:
    """Write the report of a run log.

    Parameters
    ----------
    run_log : Path
        MCAP log of a run; channels that it lacks are left out.
    out_html : Path
        Replaced once the page is whole.
    evaluation : mapping or None
        Figures of the run against truth, or one such mapping per run of the log; shown as far
        as they are there.
    title : str or None
        Heading; None takes the log's name.
    reference : "mean", or tuple of 3 float (m, ECEF), or None
        Where the receiver stands still, instead of the log's truth.

    Raises
    ------
    LogError
        Where the log cannot be read.
    """
    with open_run(run_log) as source:
        text = report_html(
            source.batches(),
            source.metadata,
            evaluation=evaluation,
            title=title or run_log.stem,
            reference=reference,
        )
    write_page(out_html, text)


def report_html(
    batches: Batches,
    metadata: Mapping[str, Mapping[str, str]],
    *,
    evaluation: Mapping[str, Any] | None = None,
    title: str,
    reference: Reference | None = None,
) -> str:
    """The report as text; see :func:`write_report`."""
    envelope = ImuEnvelope()
    data = gather(batches, metadata, on_imu=envelope, reference=reference)
    panels = [*_shown(data, all_panels(data)), *envelope.panels()]
    manifest = manifest_of(metadata)
    parts = [
        _header(data, manifest, title),
        _figures_section(data, evaluation or {}),
        _trajectory_section(data),
        *_panel_sections(data, panels),
        _events_section(data),
        _channels_section(data, manifest),
        _run_section(manifest),
    ]
    return page(title, "\n".join(part for part in parts if part))


def _header(data: RunData, manifest: replay_pb2.Manifest | None, title: str) -> str:
    lines = []
    if data.span_ns is not None:
        start, end = data.span_ns
        elapsed = float(seconds_between(end, start))
        lines.append(f"{to_text(start)} to {to_text(end)} GPS time, {elapsed:.1f} s")
    if data.runs:
        lines.append("runs: " + ", ".join(run.name for run in data.runs))
    if manifest is not None:
        lines.append(f"pipeline {manifest.pipeline}, version {manifest.package_version}")
    return f"<h1>{escape(title)}</h1><p class='sub'>{escape(' · '.join(lines))}</p>"


def _figures_section(data: RunData, evaluation: Mapping[str, Any]) -> str:
    """One block, or one per run where the evaluation is keyed by run."""
    names = [run.name for run in data.runs if run.name in evaluation]
    blocks = [(name, evaluation[name]) for name in names] or [("", evaluation)]
    parts: list[str] = []
    for name, figures in blocks:
        parts.append(f"<h3>{escape(name)}</h3>" if name else "")
        parts.append(tiles(key_figures.headline(figures)))
        parts += [table.html() for table in key_figures.tables(figures)]
    return section("Key figures", parts)


def _trajectory_section(data: RunData) -> str:
    chart = plan_chart(data)
    outages = tuple(
        (
            str(number),
            to_text(outage.start_ns),
            f"{float(seconds_between(outage.end_ns, outage.start_ns)):.1f}",
            "cut on purpose" if outage.cut else "gap between fixes",
        )
        for number, outage in enumerate(data.outages, start=1)
    )
    table = Table(("outage", "start, GPS time", "duration [s]", "why"), outages, text_columns=4)
    return section(
        "Trajectory",
        [
            figure(chart, "Plan of the trajectory with its outages") if chart else "",
            table.html() if outages else "",
        ],
    )


def _panel_sections(data: RunData, panels: Sequence[Panel]) -> list[str]:
    if data.span_ns is None:
        return []
    clock = Clock(*data.span_ns)
    parts = []
    for kind, about in _STACKED.items():
        chosen = [panel for panel in panels if panel.section is kind]
        parts.append(section(kind.value, [_panels_figure(data, chosen, clock, about, 1)]))
    for title, kinds, about in _GROUPS:
        chosen = [panel for kind in kinds for panel in panels if panel.section is kind]
        figures = [_panels_figure(data, chosen, clock, about, None)]
        if title == "Innovations":
            figures += _consistency_figures(data, panels, clock)
        if title == "Satellites and geometry":
            figures += _sky_figures(data, clock)
        parts.append(section(title, figures))
    return parts


def _panels_figure(
    data: RunData, panels: Sequence[Panel], clock: Clock, caption: str, columns: int | None
) -> str:
    if not panels:
        return ""
    chart = panels_chart(panels, clock, data.outages, caption=caption, columns=columns)
    names = ", ".join(panel.heading for panel in panels)
    return figure(chart, f"Plots over time: {names}")


def _consistency_figures(data: RunData, panels: Sequence[Panel], clock: Clock) -> list[str]:
    chart = histogram_chart(data)
    nis = [panel for panel in panels if panel.section is Section.NIS]
    about = "Sum of squares of an epoch's accepted normalised innovations over their number."
    return [
        figure(chart, "Histograms of normalised innovations") if chart else "",
        _panels_figure(data, nis, clock, about, 1),
    ]


def _users(data: RunData) -> list[str]:
    """Receivers whose satellites are shown: of a base only where there is no other."""
    names = list(data.satellites)
    return [name for name in names if name != _BASE] or names


def _shown(data: RunData, panels: Sequence[Panel]) -> list[Panel]:
    """Panels but those of a base's corrections, which are in the recording."""
    if all(name == _BASE for name in data.corrections):
        return list(panels)
    return [panel for panel in panels if not panel.key.startswith(f"corrections/{_BASE}/")]


def _sky_figures(data: RunData, clock: Clock) -> list[str]:
    figures: list[str] = []
    for receiver in _users(data):
        satellites = data.satellites[receiver]
        sky = sky_chart(receiver, satellites)
        if sky is not None:
            figures.append(figure(sky, f"Sky plot of {receiver}"))
        tracking = tracking_chart(receiver, satellites, data.slips.get(receiver), clock)
        if tracking is not None:
            figures.append(figure(tracking, f"Satellites of {receiver} along time"))
    return figures


def _events_section(data: RunData) -> str:
    sources = [(run.name, run.events) for run in data.runs]
    sources += [(f"GNSS {receiver}", events) for receiver, events in data.gnss_events.items()]
    found: list[tuple[Event, str]] = [
        (event, name)
        for name, columns in sources
        if columns is not None
        for event in events_of(columns)
    ]
    found.sort(key=lambda item: item[0].time_ns)
    rows = tuple(
        (to_text(event.time_ns)[11:], run, event.level, event.text)
        for event, run in found[:_MOST_EVENTS]
    )
    if not rows:
        return ""
    counts = Counter(event.kind for event, _ in found)
    said = ", ".join(f"{kind} {count}" for kind, count in counts.most_common())
    if len(found) > _MOST_EVENTS:
        said += f". The first {_MOST_EVENTS} of {len(found)}:"
    table = Table(("GPS time", "run", "level", "event"), rows, caption=said, text_columns=4)
    return section("Events", [table.html()])


def _channels_section(data: RunData, manifest: replay_pb2.Manifest | None) -> str:
    digests = (
        {item.topic: item for item in (*manifest.inputs, *manifest.outputs)} if manifest else {}
    )
    rows = tuple(
        (
            topic,
            digests[topic].sha256[:16] if topic in digests else NONE,
            str(stats.count),
            NONE if stats.rate_hz is None else f"{stats.rate_hz:.2f}",
            to_text(stats.first_ns)[11:],
            to_text(stats.last_ns)[11:],
        )
        for topic, stats in data.stats.items()
    )
    head = ("topic", "SHA-256, first 16", "rows", "rate [Hz]", "first", "last")
    return section("Channels", [Table(head, rows, text_columns=2).html()] if rows else [])


def _run_section(manifest: replay_pb2.Manifest | None) -> str:
    if manifest is None:
        return section("What was run", ["<p>The log has no manifest.</p>"])
    facts = (
        ("command", manifest.command),
        ("pipeline", manifest.pipeline),
        ("package version", manifest.package_version),
        *(("note", note) for note in manifest.notes),
    )
    stages = tuple(
        (stage.name, str(stage.version), ", ".join(stage.inputs), ", ".join(stage.outputs))
        for stage in manifest.stages
    )
    digests = tuple(
        (side, item.topic, item.schema, item.sha256, str(item.message_count))
        for side, items in (("in", manifest.inputs), ("out", manifest.outputs))
        for item in items
    )
    stage_table = Table(("stage", "version", "inputs", "outputs"), stages, text_columns=4)
    digest_head = ("", "topic", "message", "SHA-256 of the content", "messages")
    return section(
        "What was run",
        [
            Table(("what", ""), facts, text_columns=2).html(),
            stage_table.html() if stages else "",
            Table(digest_head, digests, text_columns=4).html() if digests else "",
            f"<pre>{escape(manifest.configuration.strip())}</pre>"
            if manifest.configuration
            else "",
        ],
    )
