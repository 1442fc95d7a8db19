"""A run log as a Rerun recording with its layout inside."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import rerun as rr

from replay.errors import ReplayError
from replay.evaluate.geometry import Floats
from replay.evaluate.station import Reference
from replay.log.columns import Columns
from replay.time import to_text
from replay.view import labels
from replay.view.about import about_markdown
from replay.view.blueprint import Contents, make_blueprint
from replay.view.convergence_panels import convergence_panels
from replay.view.events import events_of
from replay.view.fields import doubles
from replay.view.filter_panels import innovation_panels, sensor_panels
from replay.view.gather import Batches, RunData, gather
from replay.view.geometry_panels import geometry_panels
from replay.view.gnss_panels import gnss_panels
from replay.view.navigation_panels import navigation_panels
from replay.view.network_panels import network_panels
from replay.view.network_scene import draw_stations
from replay.view.palette import AXES
from replay.view.panels import Panel
from replay.view.precise_panels import precise_panels
from replay.view.satellite_panels import satellite_panels
from replay.view.scene import Scene, draw_scene
from replay.view.sink import Sink, Times, rgba
from replay.view.source import open_run
from replay.view.states import draw_states

APPLICATION = "gnss-ins-replay"
_NAMESPACE = uuid.UUID("7b0c8a54-51c4-4b5e-8f0e-3f2d1c9a6e11")
_GYRO, _ACCEL, _TEMPERATURE = "imu/angular_rate", "imu/specific_force", "imu/temperature"


@dataclasses.dataclass(frozen=True, slots=True)
class RecordingOptions:
    """How a recording is made.

    Attributes
    ----------
    ellipsoid_exaggeration : int or None
        How many times larger than 3 sigma the position ellipsoids are drawn; None takes the
        power of ten that makes them seen. The name of the entity and of the view tell it.
    max_path_points : int
        Longer paths on map and plan are thinned, and their names say so. Plots and the moving
        body have every row.
    imu : bool
        Whether inertial samples are drawn.
    active_tab : str or None
        Tab that is open at first.
    reference : "mean", or tuple of 3 float (m, ECEF), or None
        Where the receiver stands still, instead of the log's truth.
    """

    ellipsoid_exaggeration: int | None = None
    max_path_points: int = 200_000
    imu: bool = True
    active_tab: str | None = None
    reference: Reference | None = None


def write_recording(
    run_log: Path, out_rrd: Path, *, options: RecordingOptions | None = None
) -> None:
    """Draw a run log into a `.rrd` file.

    Inertial samples stream through in batches; what stays in memory are the solution, the
    states and the innovations.

    Parameters
    ----------
    run_log : Path
        MCAP log of a run; channels that it lacks are left out of the layout.
    out_rrd : Path
        Replaced once the recording is whole.
    options : RecordingOptions or None

    Raises
    ------
    LogError
        Where the log cannot be read.
    """
    with open_run(run_log) as source:
        record(source.batches(), source.metadata, out_rrd, name=run_log.stem, options=options)


def record(
    batches: Batches,
    metadata: Mapping[str, Mapping[str, str]],
    out_rrd: Path,
    *,
    name: str,
    options: RecordingOptions | None = None,
) -> None:
    """Draw batches of columns into a `.rrd` file; see :func:`write_recording`."""
    chosen = options or RecordingOptions()
    with recording_file(out_rrd, name, metadata) as sink:
        imu = _ImuPlots(sink) if chosen.imu else None
        data = gather(batches, metadata, on_imu=imu, reference=chosen.reference)
        scene = draw_scene(
            sink,
            data,
            exaggeration=chosen.ellipsoid_exaggeration,
            max_path_points=chosen.max_path_points,
        )
        panels = all_panels(data)
        _draw_panels(sink, data, panels)
        contents = Contents(
            panels,
            scene,
            imu.headings if imu else (),
            has_events=_draw_events(sink, data),
            has_states=bool(draw_states(sink, data)),
            run_count=len(data.runs),
            span_ns=data.span_ns,
            stations=draw_stations(sink, data, scene),
        )
        _draw_about(sink, data, scene)
        sink.recording.send_blueprint(make_blueprint(contents, active_tab=chosen.active_tab))


def all_panels(data: RunData) -> list[Panel]:
    """Every plot of a run but the inertial ones, in the order of the tabs."""
    return [
        *navigation_panels(data),
        *convergence_panels(data),
        *sensor_panels(data),
        *geometry_panels(data),
        *innovation_panels(data),
        *satellite_panels(data),
        *precise_panels(data),
        *network_panels(data),
        *gnss_panels(data),
    ]


@contextlib.contextmanager
def recording_file(
    out_rrd: Path, name: str, metadata: Mapping[str, Mapping[str, str]]
) -> Iterator[Sink]:
    """A sink into a file that takes its name only when it is whole."""
    manifest = metadata.get("replay.manifest", {}).get("json", "")
    part = out_rrd.with_name(out_rrd.name + ".part")
    recording = rr.RecordingStream(
        APPLICATION,
        recording_id=uuid.uuid5(_NAMESPACE, f"{name}\n{manifest}"),
        send_properties=False,
    )
    try:
        part.touch()  # a path that cannot be written fails here, with a plain error
        recording.save(part)
        recording.send_recording_name(name)
        yield Sink(recording)
        recording.flush()
        recording.disconnect()
        os.replace(part, out_rrd)
    except OSError as error:
        raise ReplayError(
            f"the recording cannot be written: {error.strerror or error}",
            where=str(out_rrd),
            mend="choose a folder that exists and has room",
        ) from error
    finally:
        recording.disconnect()
        part.unlink(missing_ok=True)


class _ImuPlots:
    """Sends inertial samples as they come."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self.headings: list[tuple[str, str]] = []

    def __call__(self, samples: Columns) -> None:
        times = samples.valid_time_ns
        rate = np.degrees(doubles(samples, "angular_rate_body_rad_s"))
        force = doubles(samples, "specific_force_body_m_s2")
        self._send(_GYRO, "Angular rate, body, every sample [deg/s]", times, rate)
        self._send(_ACCEL, "Specific force, body, every sample [m/s²]", times, force)
        if "temperature_c" in samples.values and samples.is_present("temperature_c").any():
            mask = samples.is_present("temperature_c")
            value = doubles(samples, "temperature_c")[mask]
            self._send(_TEMPERATURE, "IMU temperature [°C]", times[mask], value)

    def _send(self, path: str, heading: str, times: Times, values: Floats) -> None:
        if path not in (known for known, _ in self.headings):
            self.headings.append((path, heading))
            if values.ndim > 1:
                colors = rgba(*(ink.dark for ink in AXES))
                style = rr.SeriesLines(names=labels.BODY_AXES, colors=colors, widths=[1.0] * 3)
            else:
                style = rr.SeriesLines(names="temperature", colors=rgba(AXES[0].dark))
            self._sink.static(path, style)
        self._sink.scalars(path, times, values)


def _draw_panels(sink: Sink, data: RunData, panels: list[Panel]) -> None:
    for panel in panels:
        sink.panel(panel, "plots", data.outages)


def _draw_events(sink: Sink, data: RunData) -> bool:
    with_events = [run for run in data.runs if run.events is not None]
    for run in with_events:
        assert run.events is not None
        _draw_run_events(sink, run.name, run.events)
    for receiver, events in data.gnss_events.items():
        _draw_run_events(sink, f"gnss/{receiver}", events)
    return bool(with_events or data.gnss_events)


def _draw_run_events(sink: Sink, name: str, columns: Columns) -> None:
    events = events_of(columns)
    texts = [f"{to_text(event.time_ns)[11:]}  {event.text}" for event in events]
    levels = [event.level for event in events]
    sink.columns(
        f"events/{name}",
        columns.valid_time_ns,
        lambda rows: rr.TextLog.columns(text=texts[rows], level=levels[rows]),
    )


def _draw_about(sink: Sink, data: RunData, scene: Scene | None) -> None:
    text = about_markdown(data, scene)
    sink.static("about", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
