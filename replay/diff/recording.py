"""One Rerun recording of two runs: A, B and A - B on one timeline.

Times are the calendar of GPS time. The time cursor opens at the first
divergence, where a marker stands too.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
import pymap3d
import rerun as rr
import rerun.blueprint as rrb

from replay.channels import FILTER_STATE, GNSS_FIX, SOLUTION, TRUTH, Difference
from replay.diff import words
from replay.diff.fields import FieldOutcome, numbers
from replay.diff.join import Joined, column, join
from replay.diff.match import ABSENT
from replay.diff.names import component_names, is_text
from replay.diff.result import ChannelDiff, ChannelStatus, DiffResult, Divergence
from replay.diff.runs import Run, open_run
from replay.diff.statistics import LOCAL_COMPONENTS, POSITION, local_positions
from replay.diff.topics import spec_of
from replay.time import NS_PER_S, to_datetime64

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

TIMELINE: Final = "gps_time"
_MOST_FIELDS: Final = 4  # of one channel, so that every plot stays readable
_COLOUR_A: Final = (0, 150, 255)
_COLOUR_B: Final = (255, 140, 0)
_COLOUR_BAND: Final = (120, 120, 120)
_COLOUR_MARK: Final = (255, 0, 80)
_COLOURS: Final = ((230, 70, 70), (70, 200, 90), (90, 130, 255), (230, 200, 60))
_FADED: Final = 0.55  # B's lines are A's colours, darker
_BEFORE_NS: Final = 20 * NS_PER_S  # of the first divergence, that plots show at first
_AFTER_NS: Final = 60 * NS_PER_S
_EYE_HEIGHT: Final = 1.2  # over the extent of the trajectory, so that all of it is seen
_MOST_LINES: Final = 6  # of one plot
_TRAJECTORIES: Final = (SOLUTION, FILTER_STATE, TRUTH, GNSS_FIX)


def write_rrd(result: DiffResult, path: str | os.PathLike[str]) -> None:
    """Write the recording of a comparison of two logs, reading both again.

    Parameters
    ----------
    result : DiffResult
        From :func:`replay.diff.compare.diff_logs`.
    path : path
        The `.rrd` file.
    """
    with open_run(result.a.path) as a, open_run(result.b.path) as b:
        record_runs(result, a, b, path)


def record_runs(result: DiffResult, a: Run, b: Run, path: str | os.PathLike[str]) -> None:
    """Write the recording of a comparison of two runs, from files or from memory."""
    stream = rr.RecordingStream("replay_diff", recording_id="diff")
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.save(os.fspath(path))
    pen = _Pen(stream, result.first_change or result.first_difference)
    trajectory = _trajectory_channel(result)
    tabs: list[rrb.Vertical] = []
    active = 0
    track: Float64 | None = None
    for channel in result.channels:
        if channel is not trajectory and not channel.fields:
            continue
        spec = spec_of(channel.topic, channel.message)
        joined = join(spec, a.read(channel.topic), b.read(channel.topic_b))
        if channel is trajectory:
            track = pen.trajectory(joined)
        views = pen.position(joined) if channel.local else []
        views += pen.fields(joined, channel)
        if views:
            if pen.first is not None and pen.first.topic == channel.topic:
                active = len(tabs)
            tabs.append(rrb.Vertical(*views, name=words.topic(channel)))
    pen.summary(result)
    stream.send_blueprint(_blueprint(tabs, active, pen.first, track))
    stream.flush()
    stream.disconnect()


def _trajectory_channel(result: DiffResult) -> ChannelDiff | None:
    """Find the channel to draw as a plan: the best kind of position that both runs have."""
    one_sided = (ChannelStatus.MISSING, ChannelStatus.EXTRA, ChannelStatus.SCHEMA)
    for spec in _TRAJECTORIES:
        for channel in result.channels:
            if spec.message == channel.message and channel.status not in one_sided:
                return channel
    return None


def _blueprint(
    tabs: Sequence[rrb.Vertical], active: int, first: Divergence | None, track: Float64 | None
) -> rrb.Blueprint:
    text = rrb.TextDocumentView(origin="summary", name="What differs")
    left: rrb.View | rrb.Container = text
    if track is not None and len(track):
        low, high = track.min(axis=0), track.max(axis=0)
        centre = 0.5 * (low + high)
        height = _EYE_HEIGHT * max(float((high - low).max()), 1.0)
        view = rrb.Spatial3DView(
            origin="plan",
            name="Plan, local east and north (A blue, B orange)",
            # Looking straight down, north up: a plan.
            eye_controls=rrb.EyeControls3D(
                position=[*centre[:2], height], look_target=[*centre[:2], 0.0], eye_up=[0, 1, 0]
            ),
        )
        left = rrb.Vertical(view, text, row_shares=[3, 2])
    parts: list[rrb.View | rrb.Container] = [left]
    if tabs:
        parts.append(rrb.Tabs(*tabs, active_tab=active))
    return rrb.Blueprint(
        rrb.Horizontal(*parts, column_shares=[2, 3][: len(parts)]),
        _time_panel(first),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _time_panel(first: Divergence | None) -> rrb.TimePanel:
    """Put the cursor on the first divergence.

    A blueprint of Rerun 0.41 has no field for the cursor. A viewer that plays a
    looped selection takes the cursor into it, and one of a nanosecond holds it there.
    """
    if first is None:
        return rrb.TimePanel(state="collapsed", timeline=TIMELINE)
    begin = _unix_ns(first.at.time_ns)
    return rrb.TimePanel(
        state="collapsed",
        timeline=TIMELINE,
        play_state="playing",
        loop_mode="selection",
        time_selection=rrb.components.AbsoluteTimeRange(begin, begin + 1),
    )


def _unix_ns(gps_ns: int) -> int:
    return int(to_datetime64(gps_ns).astype(np.int64))


@dataclasses.dataclass(frozen=True, slots=True)
class _Pen:
    """Draws channels into one recording and hands out the views that show them."""

    stream: rr.RecordingStream
    first: Divergence | None

    def summary(self, result: DiffResult) -> None:
        """Write the findings as a list."""
        text = "\n".join(f"- {line}" for line in words.headlines(result))
        document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
        self.stream.log("summary", document, static=True, strict=True)

    def trajectory(self, joined: Joined) -> Float64 | None:
        """Draw both trajectories in metres from A's first position; return A's."""
        positions = [numbers(columns.values[POSITION]) for columns in (joined.a, joined.b)]
        origin = _origin(joined)
        if origin is None:
            return None
        for name, columns, position, colour, width, level in (
            ("A", joined.a, positions[0], _COLOUR_A, 3.0, 0.0),
            ("B", joined.b, positions[1], _COLOUR_B, 1.0, 0.5),
        ):
            # Flat, for heights would tilt what is to be read as a plan; B thin and on top,
            # so that A shows at its sides where the two are one.
            plan = local_offsets(position, origin) * [1.0, 1.0, 0.0] + [0.0, 0.0, level]
            track = rr.LineStrips3D([plan], colors=[colour], radii=rr.Radius.ui_points(width))
            self.stream.log(f"plan/{name}/track", track, static=True, strict=True)
            style = rr.Points3D.from_fields(colors=[colour], radii=rr.Radius.ui_points(6.0))
            self.stream.log(f"plan/{name}/now", style, static=True, strict=True)
            self._send(
                f"plan/{name}/now", columns.valid_time_ns, rr.Points3D.columns(positions=plan)
            )
            if name == "A" and self.first is not None:
                nearest = int(np.argmin(np.abs(columns.valid_time_ns - self.first.at.time_ns)))
                mark = rr.Points3D(
                    [plan[nearest]],
                    colors=[_COLOUR_MARK],
                    radii=rr.Radius.ui_points(8.0),
                    labels=["first divergence"],
                )
                self.stream.log("plan/first_divergence", mark, static=True, strict=True)
        track_of_a = local_offsets(positions[0], origin)
        return track_of_a[np.isfinite(track_of_a).all(axis=1)]

    def position(self, joined: Joined) -> list[rrb.View | rrb.Container]:
        """Draw positions of A and B in metres from A's first one, and A - B of each moment."""
        enu = local_positions(joined)
        if enu is None:
            return []
        base = f"{_entity(joined)}/position_enu"
        tolerance = joined.spec.tolerances.get(POSITION)
        limit = None if tolerance is None else tolerance.absolute
        times = joined.a.valid_time_ns[joined.matched_a]
        self._lines(f"{base}/difference", times, enu, ("A-B east", "A-B north", "A-B up"))
        self._band(f"{base}/difference", times, limit)
        self._mark(f"{base}/difference")
        start = _origin(joined)
        if start is not None:
            for name, columns, fade in (("A", joined.a, 1.0), ("B", joined.b, _FADED)):
                offsets = local_offsets(numbers(columns.values[POSITION]), start)
                parts = [f"{name} {part}" for part in LOCAL_COMPONENTS[:3]]
                self._lines(f"{base}/values/{name}", columns.valid_time_ns, offsets, parts, fade)
        return [
            rrb.Horizontal(
                self._series(f"{base}/values", "A, B position east, north, up [m]"),
                self._series(f"{base}/difference", "A-B position east, north, up [m]"),
            )
        ]

    def fields(self, joined: Joined, channel: ChannelDiff) -> list[rrb.View | rrb.Container]:
        """Draw the fields that differ most often: A and B, and A - B."""
        ranked = sorted(
            (
                field
                for field in channel.fields
                if not is_text(column(joined.a, field.field))
                and not (channel.local and field.field == POSITION)
            ),
            key=lambda field: -(field.value + field.nan),
        )
        drawn = [joined.outcomes[field.field] for field in ranked[:_MOST_FIELDS]]
        return [self._field(joined, outcome) for outcome in drawn]

    def _field(self, joined: Joined, outcome: FieldOutcome) -> rrb.View | rrb.Container:
        base = f"{_entity(joined)}/{outcome.name}"
        key, label = _worst_key(joined, outcome)
        chosen = joined.alignment.key == key
        matched = joined.alignment.key[joined.alignment.matched] == key
        is_covariance = outcome.tolerance.difference is Difference.COVARIANCE
        prefix = "" if is_covariance else "A-B "
        names = [f"{prefix}{name}".rstrip() for name in outcome.components]
        limit = outcome.tolerance.absolute
        times = joined.a.valid_time_ns[joined.matched_a][matched]
        self._lines(f"{base}/difference", times, outcome.difference[matched], names)
        self._band(f"{base}/difference", times, limit if np.isfinite(limit) and limit else None)
        self._mark(f"{base}/difference")
        title = " ".join([outcome.name, f"[{outcome.unit}]", *label])
        if is_covariance:
            title = f"{outcome.name}: eigenvalues of B in A's measure, minus one"
            return self._series(f"{base}/difference", title)
        difference = self._series(f"{base}/difference", f"A-B {title}")
        for name, columns, rows, fade in (
            ("A", joined.a, joined.alignment.a[chosen], 1.0),
            ("B", joined.b, joined.alignment.b[chosen], _FADED),
        ):
            rows = rows[rows != ABSENT]
            values = numbers(column(columns, outcome.name))[rows]
            parts = [f"{name} {part}".rstrip() for part in component_names(values.shape[1])]
            self._lines(f"{base}/values/{name}", columns.valid_time_ns[rows], values, parts, fade)
        return rrb.Horizontal(self._series(f"{base}/values", f"A, B {title}"), difference)

    def _lines(
        self,
        entity: str,
        time_ns: Int64,
        values: Float64,
        names: Sequence[str],
        fade: float = 1.0,
    ) -> None:
        shown = values[:, :_MOST_LINES]
        colours = [_faded(_COLOURS[i % len(_COLOURS)], fade) for i in range(shown.shape[1])]
        style = rr.SeriesLines(names=list(names[:_MOST_LINES]), colors=colours)
        self.stream.log(f"{entity}/lines", style, static=True, strict=True)
        self._send(f"{entity}/lines", time_ns, rr.Scalars.columns(scalars=shown))

    def _band(self, entity: str, time_ns: Int64, tolerance: float | None) -> None:
        """Draw the tolerance as a line above and one below zero."""
        if tolerance is None or not len(time_ns):
            return
        style = rr.SeriesLines(names=["+ tolerance", "- tolerance"], colors=[_COLOUR_BAND] * 2)
        self.stream.log(f"{entity}/tolerance", style, static=True, strict=True)
        ends = np.array([time_ns.min(), time_ns.max()])
        levels = np.array([[tolerance, -tolerance]] * 2)
        self._send(f"{entity}/tolerance", ends, rr.Scalars.columns(scalars=levels))

    def _mark(self, entity: str) -> None:
        """Put a point on the zero line at the first divergence."""
        if self.first is None:
            return
        style = rr.SeriesPoints(
            names=["first divergence"], colors=[_COLOUR_MARK], markers=["diamond"], marker_sizes=[6]
        )
        self.stream.log(f"{entity}/first_divergence", style, static=True, strict=True)
        time = np.array([self.first.at.time_ns])
        self._send(f"{entity}/first_divergence", time, rr.Scalars.columns(scalars=np.zeros(1)))

    def _series(self, entity: str, title: str) -> rrb.TimeSeriesView:
        """Show an entity over time, from shortly before the first divergence."""
        axis = None
        if self.first is not None:
            here = _unix_ns(self.first.at.time_ns)
            start, end = (
                rrb.TimeRangeBoundary.absolute(nanos=here + shift)
                for shift in (-_BEFORE_NS, _AFTER_NS)
            )
            axis = rrb.TimeAxis(view_range=rrb.TimeRange(start=start, end=end))
        legend = rrb.PlotLegend(corner="RightTop")  # clear of the first divergence, on the left
        return rrb.TimeSeriesView(origin=entity, name=title, axis_x=axis, plot_legend=legend)

    def _send(self, entity: str, time_ns: Int64, columns: rr.ComponentColumnList) -> None:
        index = rr.TimeColumn(TIMELINE, timestamp=to_datetime64(time_ns))
        self.stream.send_columns(entity, indexes=[index], columns=columns, strict=True)


def _origin(joined: Joined) -> Float64 | None:
    """Find A's first position that is a number."""
    positions = numbers(joined.a.values[POSITION])
    usable = np.flatnonzero(np.isfinite(positions).all(axis=1))
    return positions[usable[0]] if len(usable) else None


def local_offsets(position: Float64, origin: Float64) -> Float64:
    """ECEF positions `(n, 3)` as metres east, north and up of an origin."""
    latitude, longitude, _ = pymap3d.ecef2geodetic(*origin)
    delta = position - origin
    enu = pymap3d.ecef2enuv(delta[:, 0], delta[:, 1], delta[:, 2], latitude, longitude)
    return np.stack(enu, axis=1)


def _worst_key(joined: Joined, outcome: FieldOutcome) -> tuple[int, list[str]]:
    """Choose the one key whose rows are drawn: that of the worst row; and its words."""
    size = np.where(np.isnan(outcome.difference), 0.0, np.abs(outcome.difference)).max(axis=1)
    row = int(np.lexsort((size, outcome.severity))[-1])
    slot = int(np.flatnonzero(joined.alignment.matched)[row])
    return int(joined.alignment.key[slot]), list(joined.matched_place(row).key.values())


def _entity(joined: Joined) -> str:
    return f"channels{joined.spec.topic}"


def _faded(colour: tuple[int, int, int], fade: float) -> tuple[int, ...]:
    return tuple(int(part * fade) for part in colour)
