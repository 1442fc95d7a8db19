"""How the recording opens: tabs of views with what they show and its unit in their names."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from replay.evaluate.geometry import Floats
from replay.time import to_datetime64
from replay.view.labels import SIGMA, TIMES
from replay.view.network_scene import DRAWN, Stations
from replay.view.panels import Panel, Section
from replay.view.scene import ELLIPSOID_SIGMAS, Scene
from replay.view.sink import TIMELINE, entity

OVERVIEW: Final = "Overview"
MOTION: Final = "Attitude & velocity"
SENSORS: Final = "Sensor errors"
INNOVATIONS: Final = "Innovations"
RAW: Final = "Raw"
SATELLITES: Final = "Satellites"
AMBIGUITIES: Final = "Ambiguities"
CORRECTIONS: Final = "Corrections"
CONVERGENCE: Final = "Convergence"
ESTIMATES: Final = "Atmosphere & biases"
NETWORK: Final = "Network"
NETWORK_ERRORS: Final = "Network errors"
ABOUT: Final = "About"

_MOTION_SECTIONS: Final = (
    Section.VELOCITY, Section.VELOCITY_ERROR, Section.ATTITUDE, Section.ATTITUDE_ERROR,
)  # fmt: skip
_SENSOR_SECTIONS: Final = (
    Section.GYRO_BIAS, Section.ACCEL_BIAS, Section.GYRO_SCALE, Section.ACCEL_SCALE,
    Section.MOUNTING,
    Section.NON_SLIP,
    Section.SQUAT,
)  # fmt: skip
_SETTLING_SECTIONS: Final = (
    *_SENSOR_SECTIONS, Section.CONVERGENCE, Section.TROPOSPHERE, Section.PHASES,
)  # fmt: skip
_SATELLITE_SECTIONS: Final = (
    Section.GEOMETRY, Section.CLOCK, Section.DISPLACEMENT, Section.SLIPS,
)  # fmt: skip
_ESTIMATE_SECTIONS: Final = (Section.TROPOSPHERE, Section.IONOSPHERE, Section.RECEIVER_BIASES)
Part = rrb.Container | rrb.View
_MAX_CURVES_IN_LEGEND: Final = 12
_EQUATOR_M: Final = 40_075_016.7  # 2 pi times the semi-major axis of WGS 84
_TILE_POINTS: Final = 256
_MAP_WIDTH, _MAP_HEIGHT = 440.0, 360.0  # points of the view in a window of 1600 by 1000, less a rim
_LOW_MAP_HEIGHT: Final = 250.0  # where two rows of plots stand below it
_VIEW_ASPECT: Final = 1.2  # of the plan's view in such a window
_EYE_HEIGHT: Final = 1.15  # of the plan's height, for the viewer's field of view of 55 degrees
_SMALLEST_PLAN_M: Final = 20.0
_EYE_BESIDE_M: Final = np.array([-7.0, -12.0, 7.0])


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """What the recording holds, as far as the layout asks.

    Attributes
    ----------
    panels : sequence of Panel
    scene : Scene or None
    imu : sequence of (str, str)
        Entity and heading of each inertial plot.
    has_events, has_states : bool
    run_count : int
    span_ns : (int, int) or None, GPS ns
        First and last time, so that plots open with the whole run.
    stations : Stations or None
        Reference stations that were drawn on map and plan.
    """

    panels: Sequence[Panel]
    scene: Scene | None
    imu: Sequence[tuple[str, str]]
    has_events: bool
    has_states: bool
    run_count: int
    span_ns: tuple[int, int] | None
    stations: Stations | None = None


def make_blueprint(contents: Contents, *, active_tab: str | None = None) -> rrb.Blueprint:
    """Tabs for everything that is there; a tab of nothing is left out.

    Parameters
    ----------
    contents : Contents
    active_tab : str or None
        Name of the tab that is open at first; None or a tab that is not there opens the first.
    """
    tabs: list[tuple[str, list[Part]]] = [
        (OVERVIEW, _overview(contents)),
        (CONVERGENCE, _rows(contents, (Section.CONVERGENCE,))),
        (MOTION, _rows(contents, _MOTION_SECTIONS)),
        (SENSORS, _rows(contents, _SENSOR_SECTIONS)),
        (SATELLITES, _rows(contents, _SATELLITE_SECTIONS)),
        (AMBIGUITIES, _rows(contents, (Section.AMBIGUITIES, Section.PHASES))),
        (ESTIMATES, _rows(contents, _ESTIMATE_SECTIONS)),
        (INNOVATIONS, _rows(contents, (Section.INNOVATIONS, Section.NIS, Section.RESIDUALS))),
        (CORRECTIONS, _rows(contents, (Section.CORRECTIONS,))),
        (NETWORK, _network(contents)),
        (NETWORK_ERRORS, _rows(contents, (Section.NETWORK_ERRORS,))),
        (RAW, _raw(contents)),
        (ABOUT, [rrb.TextDocumentView(origin="/about", name="About this recording")]),
    ]
    shown = [rrb.Vertical(*parts, name=name) for name, parts in tabs if parts]
    names = [name for name, parts in tabs if parts]
    active = names.index(active_tab) if active_tab in names else 0
    return rrb.Blueprint(
        rrb.Tabs(*shown, active_tab=active),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="paused"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def _time_axis(contents: Contents) -> rrb.TimeAxis:
    """The whole run; zooming one plot zooms all."""
    if contents.span_ns is None:
        return rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal)
    start, end = (
        rrb.TimeRangeBoundary.absolute(nanos=int(to_datetime64(ns).astype(np.int64)))
        for ns in contents.span_ns
    )
    return rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=end))


def _plot(
    contents: Contents,
    path: str,
    heading: str,
    *,
    legend: bool = True,
    corner: rrb.Corner2D = rrb.Corner2D.LeftTop,
    limits: tuple[float, float] | None = None,
) -> rrb.View:
    return rrb.TimeSeriesView(
        origin="/" + entity(path),
        name=heading,
        axis_x=_time_axis(contents),
        axis_y=None if limits is None else rrb.ScalarAxis(range=limits),
        plot_legend=rrb.PlotLegend(corner, visible=legend),
    )


def _rows(contents: Contents, sections: Sequence[Section]) -> list[Part]:
    """Panels of one section and row beside each other."""
    panels = [p for section in sections for p in contents.panels if p.section is section]
    return [
        rrb.Horizontal(*_row(contents, list(group)))
        for _, group in itertools.groupby(panels, key=lambda p: (p.section, p.row))
    ]


def _row(contents: Contents, panels: Sequence[Panel]) -> list[Part]:
    """Views of panels; one legend serves all that show nothing else."""
    views: list[Part] = []
    told: set[str] = set()
    for panel in panels:
        names = {curve.label for curve in panel.curves}
        legend = not names <= told and len(panel.curves) <= _MAX_CURVES_IN_LEGEND
        told |= names
        # Bounds of what settles are wide at first, those of all else in the middle or at the end.
        settles = panel.section in _SETTLING_SECTIONS
        corner = rrb.Corner2D.RightTop if settles else rrb.Corner2D.LeftTop
        views.append(
            _plot(
                contents,
                f"plots/{panel.key}",
                panel.linear_heading,
                legend=legend,
                corner=corner,
                limits=panel.limits,
            )
        )
    return views


def _overview(contents: Contents) -> list[Part]:
    parts: list[Part] = []
    if contents.scene is not None:
        more = any(p.section is Section.CHANGE_ERROR for p in contents.panels)
        height = _LOW_MAP_HEIGHT if more else _MAP_HEIGHT
        parts.append(rrb.Horizontal(*_scene_views(contents.scene, height)))
    shown = (Section.POSITION_ERROR, Section.POSITION_SIGMA, Section.CHANGE_ERROR)
    parts += _rows(contents, shown)
    lanes: list[Part] = []
    if contents.has_states:
        lanes.append(
            rrb.StateTimelineView(
                origin="/state", name="Fix quality and status", time_view=_time_axis(contents)
            )
        )
    if contents.has_events:
        lanes.append(
            rrb.TextLogView(
                origin="/events", name="Events", columns=_event_columns(contents.run_count)
            )
        )
    if lanes:
        parts.append(rrb.Horizontal(*lanes))
    return (
        [rrb.Vertical(*parts, row_shares=_shares(len(parts), contents.run_count))] if parts else []
    )


def _network(contents: Contents) -> list[Part]:
    """Map and plan with the stations, then the corrections."""
    parts: list[Part] = []
    if contents.stations is not None and contents.scene is not None:
        parts.append(rrb.Horizontal(*station_views(contents.stations, contents.scene)))
    return parts + _rows(contents, (Section.NETWORK_CORRECTIONS,))


def station_views(stations: Stations, scene: Scene) -> list[rrb.View]:
    """Map and plan that hold the paths and all stations."""
    east, north, _ = np.maximum(stations.high_m - stations.low_m, _SMALLEST_PLAN_M)
    spacing = 10.0 ** np.floor(np.log10(max(east, north) / 2.0))
    return [
        rrb.MapView(
            origin="/map",
            name="Stations and paths, map",
            zoom=_map_zoom(east, north, scene, _MAP_HEIGHT),
        ),
        rrb.Spatial3DView(
            origin="/world",
            contents=["$origin/**", *(f"- /{entity(body)}/**" for body in scene.bodies)],
            name=f"Stations and paths, local east-north-up [m], north up, grid {spacing:g} m",
            line_grid=rrb.LineGrid3D(visible=True, spacing=spacing),
            eye_controls=plan_eye(stations.low_m, stations.high_m),
        ),
    ]


def panel_rows(panels: Sequence[Panel], span_ns: tuple[int, int] | None) -> list[Part]:
    """Views of panels, those of one section and row beside each other."""
    contents = Contents(panels, None, (), has_events=False, has_states=False, run_count=1,
                        span_ns=span_ns)  # fmt: skip
    return _rows(contents, list(dict.fromkeys(panel.section for panel in panels)))


def _shares(count: int, runs: int) -> list[float]:
    """Heights of the rows of the overview: plan, plots, lanes (one per run)."""
    middle = count - 2
    lanes = 1.1 + 0.55 * runs
    return [5.0, 3.0, 2.0][:count] if middle <= 1 else [5.0, *[2.6] * middle, max(1.6, lanes)]


def _scene_views(scene: Scene, map_height: float) -> list[rrb.View]:
    east, north, _ = np.maximum(scene.high_m - scene.low_m, _SMALLEST_PLAN_M)
    spacing = 10.0 ** np.floor(np.log10(max(east, north) / 2.0))
    views: list[rrb.View] = [
        rrb.MapView(
            origin="/map",
            contents=["$origin/**", *_without_stations("/map")],
            name="Map",
            zoom=_map_zoom(east, north, scene, map_height),
        ),
        rrb.Spatial3DView(
            origin="/world",
            contents=[
                "$origin/**",
                *(f"- /{entity(body)}/**" for body in scene.bodies),
                *_without_stations("/world"),
            ],
            name=f"Plan, local east-north-up [m], north up, grid {spacing:g} m",
            line_grid=rrb.LineGrid3D(visible=True, spacing=spacing),
            eye_controls=plan_eye(scene.low_m, scene.high_m),
        ),
    ]
    if scene.bodies:
        place = "/" + entity(scene.bodies[0])
        what = "Body axes and position" if scene.has_axes else "Position"
        scale = f" {TIMES}{scene.exaggeration}" if scene.exaggeration > 1 else ""
        views.append(
            rrb.Spatial3DView(
                origin=place,
                contents=["/world/**", "- /world/names", *_without_stations("/world")],
                name=f"{what} {ELLIPSOID_SIGMAS:g}{SIGMA} ellipsoid{scale}, moving along",
                line_grid=rrb.LineGrid3D(visible=True, spacing=1.0),
                eye_controls=rrb.EyeControls3D(
                    kind=rrb.Eye3DKind.Orbital,
                    position=_EYE_BESIDE_M,
                    look_target=[0.0, 0.0, 0.0],
                    eye_up=[0.0, 0.0, 1.0],
                ),
            )
        )
    return views


def _without_stations(root: str) -> list[str]:
    """Reference stations are some ten kilometres away: a map of them is no map of the path."""
    return [f"- {root}/{name}" for name in DRAWN]


def plan_eye(low_m: Floats, high_m: Floats) -> rrb.EyeControls3D:
    """Eye straight above the box between two corners (3,), north ahead."""
    east, north, _ = np.maximum(high_m - low_m, _SMALLEST_PLAN_M)
    centre = (low_m + high_m) / 2.0
    above = max(north, east / _VIEW_ASPECT) * _EYE_HEIGHT
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=centre + np.array([0.0, 0.0, above]),
        look_target=centre,
        eye_up=[0.0, 1.0, 0.0],
    )


def _map_zoom(east_m: float, north_m: float, scene: Scene, height: float) -> float:
    """Zoom level that shows the box (a level has 256 * 2^zoom points around the equator)."""
    around_m = _EQUATOR_M * float(np.cos(np.radians(scene.frame.origin_geodetic[0])))
    points_per_m = min(_MAP_WIDTH / east_m, height / north_m)
    return float(np.clip(np.log2(around_m * points_per_m / _TILE_POINTS), 0.0, 19.0))


def _event_columns(run_count: int) -> rrb.TextLogColumns:
    """Level and text, which begins with the time (the time column is too narrow for one)."""
    kind = rrb.encodings.TextLogColumnKind
    kinds = [kind.LogLevel, *([kind.EntityPath] if run_count > 1 else []), kind.Body]
    return rrb.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn(TIMELINE, visible=False)],
        text_log_columns=[rrb.encodings.TextLogColumn(item) for item in kinds],
    )


def _raw(contents: Contents) -> list[Part]:
    imu = [_plot(contents, path, heading) for path, heading in contents.imu]
    rows: list[Part] = [rrb.Horizontal(*imu)] if imu else []
    return rows + _rows(contents, (Section.GNSS,))
