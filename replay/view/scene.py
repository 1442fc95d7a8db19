"""Map and local plan: paths, fixes, the moving body and its uncertainty.

Two trees hold the same things: `/map` in latitude and longitude (float64), and
`/world` in a local east-north-up frame, because Rerun's 3D positions are
float32, which resolves half a metre in ECEF.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
import rerun as rr
from scipy.spatial.transform import Rotation

from replay.evaluate.geometry import Floats
from replay.log.columns import Columns
from replay.view.fields import doubles, optional
from replay.view.frame import LocalFrame, geodetic
from replay.view.gather import RunData
from replay.view.outages import inside
from replay.view.palette import OUTAGE, TRUTH, Ink, receiver_ink, run_ink
from replay.view.sink import Sink, Times, radius, rgba
from replay.view.uncertainty import ellipsoids

ELLIPSOID_SIGMAS: Final = 3.0
_GAP_INTERVALS: Final = 5.0
_SEEN_SIZE_M: Final = 1.0  # smaller than this an ellipsoid is not seen beside a vehicle
_EXAGGERATIONS: Final = (1, 10, 100, 1000)
AXIS_LENGTH_M: Final = 4.0


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What was drawn, for the blueprint.

    Attributes
    ----------
    frame : LocalFrame
    low_m, high_m : array (3,), m
        Corners of the box around all paths, east, north, up.
    bodies : tuple of str
        Entities that move along with the runs, their axes east, north, up.
    exaggeration : int
        How many times larger than three sigmas the ellipsoids are drawn.
    path_stride : int
        Every how manieth point the paths have.
    left_out : int
        Rows whose position is not finite.
    has_axes : bool
        Whether any run has an attitude.
    """

    frame: LocalFrame
    low_m: Floats
    high_m: Floats
    bodies: tuple[str, ...]
    exaggeration: int
    path_stride: int
    left_out: int
    has_axes: bool = True


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Track:
    """Finite positions of one channel."""

    key: str
    label: str
    ink: Ink
    columns: Columns
    ecef_m: Floats
    is_run: bool = False
    is_fix: bool = False


def draw_scene(
    sink: Sink,
    data: RunData,
    *,
    exaggeration: int | None,
    max_path_points: int,
    bodies: bool = True,
) -> Scene | None:
    """Send map and world.

    Parameters
    ----------
    sink : Sink
    data : RunData
    exaggeration : int or None
        Of the ellipsoids; None takes the power of ten that makes them seen.
    max_path_points : int
        A path of more points is thinned, and its name says so.
    bodies : bool
        Whether each run gets body axes and an ellipsoid that move along.

    Returns
    -------
    Scene or None
        None where the log has no position.
    """
    tracks, left_out = _tracks(data)
    if not tracks:
        return None
    frame = LocalFrame.at(tracks[0].ecef_m[0])
    longest = max(len(track.ecef_m) for track in tracks)
    stride = -(-longest // max_path_points)
    scale = exaggeration or _seen_exaggeration(tracks)
    sink.static("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    places: list[str] = []
    corners: list[Floats] = []
    for track in tracks:
        enu = frame.enu(track.ecef_m)
        corners += [enu.min(axis=0), enu.max(axis=0)]
        if track.is_fix:
            _draw_fixes(sink, track, enu)
        else:
            _draw_path(sink, track, enu, data, stride)
        _draw_now(sink, track, enu)
        if track.is_run and bodies:
            places.append(_draw_body(sink, track, enu, frame, scale))
    _draw_legend(sink, tracks, frame)
    return Scene(
        frame,
        np.min(corners, axis=0),
        np.max(corners, axis=0),
        tuple(places),
        scale,
        stride,
        left_out,
        any(
            np.isfinite(optional(track.columns, "attitude_rad", 3)).any()
            for track in tracks
            if track.is_run
        ),
    )


def _tracks(data: RunData) -> tuple[list[_Track], int]:
    sources: list[tuple[str, str, Ink, Columns, bool, bool]] = []
    if data.truth is not None:
        sources.append(("truth", "truth", TRUTH, data.truth, False, False))
    for index, (name, fix) in enumerate(data.fixes.items()):
        sources.append((f"gnss/{name}", f"GNSS {name}", receiver_ink(index), fix, False, True))
    for index, run in enumerate(data.runs):
        if run.solution is not None:
            ink = run_ink(index)
            sources.append((f"run/{run.name}", run.name, ink, run.solution, True, False))
    tracks: list[_Track] = []
    left_out = 0
    for key, label, ink, columns, is_run, is_fix in sources:
        finite = np.asarray(np.isfinite(doubles(columns, "position_ecef_m")).all(axis=1))
        left_out += int((~finite).sum())
        kept = columns.take(finite)
        if len(kept):
            ecef = doubles(kept, "position_ecef_m")
            tracks.append(_Track(key, label, ink, kept, ecef, is_run, is_fix))
    return tracks, left_out


def _strips(times_ns: Times, keep: npt.NDArray[np.bool_], stride: int) -> list[Times]:
    """Rows of each unbroken piece of a path; a piece ends where `keep` does or at a gap."""
    rows = np.arange(len(times_ns), dtype=np.int64)
    if len(rows) > 1:
        intervals = np.diff(times_ns)
        gap = intervals > _GAP_INTERVALS * np.median(intervals)
        # One row beyond the change, so that pieces of different colours touch.
        pieces = np.split(rows, np.flatnonzero(gap | (keep[1:] != keep[:-1])) + 1)
        touching = [
            np.append(a, b[0]) if keep[a[0]] != keep[b[0]] else a
            for a, b in itertools.pairwise(pieces)
        ]
        pieces = [*touching, pieces[-1]]
    else:
        pieces = [rows]
    thinned = [np.append(p[:-1:stride], p[-1]) for p in pieces if keep[p[0]]]
    return [piece for piece in thinned if len(piece) > 1]


def _draw_path(sink: Sink, track: _Track, enu: Floats, data: RunData, stride: int) -> None:
    lat_lon = geodetic(track.ecef_m)[:, :2]
    times = track.columns.valid_time_ns
    dark = inside(times, data.outages) if track.is_run else np.zeros(len(times), dtype=np.bool_)
    suffix = f"_every_{stride}th_point" if stride > 1 else ""
    width = 2.2 if track.is_run else 0.8  # a thin truth shows within a wide solution
    pieces = ((~dark, "path", track.ink, width), (dark, "outage", OUTAGE, 2.6))
    for mask, name, ink, points in pieces:
        strips = _strips(times, mask, stride)
        if not strips:
            continue
        color, size = rgba(ink.dark), radius(points)
        geographic = [lat_lon[rows] for rows in strips]
        local = [enu[rows] for rows in strips]
        sink.static(
            f"map/{track.key}/{name}{suffix}",
            rr.GeoLineStrings(lat_lon=geographic, radii=size, colors=color),
        )
        sink.static(
            f"world/{track.key}/{name}{suffix}",
            rr.LineStrips3D(local, radii=size, colors=color),
        )


def _draw_fixes(sink: Sink, track: _Track, enu: Floats) -> None:
    color = rgba(track.ink.dark)
    lat_lon = geodetic(track.ecef_m)[:, :2]
    sink.static(
        f"map/{track.key}/fixes", rr.GeoPoints(lat_lon=lat_lon, radii=radius(2.0), colors=color)
    )
    sink.static(f"world/{track.key}/fixes", rr.Points3D(enu, radii=radius(1.6), colors=color))


def _draw_now(sink: Sink, track: _Track, enu: Floats) -> None:
    """The point that moves with the time cursor."""
    lat_lon = geodetic(track.ecef_m)[:, :2]
    times = track.columns.valid_time_ns
    map_path, world_path = f"map/{track.key}/now", f"world/{track.key}/now"
    sink.columns(map_path, times, lambda rows: rr.GeoPoints.columns(positions=lat_lon[rows]))
    sink.columns(world_path, times, lambda rows: rr.Points3D.columns(positions=enu[rows]))
    color = rgba(track.ink.dark)
    sink.static(map_path, rr.GeoPoints.from_fields(colors=color, radii=radius(6.0)))
    sink.static(world_path, rr.Points3D.from_fields(colors=color, radii=radius(5.0)))


def _draw_body(sink: Sink, track: _Track, enu: Floats, frame: LocalFrame, exaggeration: int) -> str:
    """Place, and at it body axes and position ellipsoid, of a run at the time cursor.

    The place has no rotation: a view with its origin there moves along with north ahead.
    """
    times = track.columns.valid_time_ns
    attitude = optional(track.columns, "attitude_rad", 3)
    turn = frame.attitude_matrices(attitude, track.ecef_m)
    known = np.isfinite(attitude).all(axis=1)
    quaternions = np.tile([0.0, 0.0, 0.0, 1.0], (len(times), 1))
    if known.any():
        quaternions[known] = Rotation.from_matrix(turn[known]).as_quat()
    place = f"world/{track.key}/place"
    sink.columns(place, times, lambda rows: rr.Transform3D.columns(translation=enu[rows]))
    if known.any():  # an antenna has no axes
        sink.columns(
            f"{place}/body",
            times,
            lambda rows: rr.Transform3D.columns(quaternion=quaternions[rows]),
        )
        sink.static(f"{place}/body", rr.TransformAxes3D(AXIS_LENGTH_M))
    _draw_ellipsoids(sink, track, f"{place}/{ellipsoid_name(exaggeration)}", frame, exaggeration)
    return place


def _draw_ellipsoids(
    sink: Sink, track: _Track, path: str, frame: LocalFrame, exaggeration: int
) -> None:
    packed = doubles(track.columns, "position_covariance_enu_m2")
    known = np.isfinite(packed).all(axis=1)
    if not known.any():
        return
    axes = ellipsoids(frame.covariance_matrices(packed[known], track.ecef_m[known]))
    sizes = axes.half_sizes * (ELLIPSOID_SIGMAS * exaggeration)
    sink.columns(
        path,
        track.columns.valid_time_ns[known],
        lambda rows: rr.Ellipsoids3D.columns(
            half_sizes=sizes[rows], quaternions=axes.quaternions_xyzw[rows]
        ),
    )
    sink.static(
        path,
        rr.Ellipsoids3D.from_fields(
            colors=rgba(track.ink.dark, alpha=90),
            fill_mode=rr.components.FillMode.TransparentFillMajorWireframe,
            line_radii=radius(0.8),
        ),
    )


def ellipsoid_name(exaggeration: int) -> str:
    """Name that tells the size: "position_3_sigma", "position_3_sigma_x10"."""
    return "position_3_sigma" + (f"_x{exaggeration}" if exaggeration > 1 else "")


def _seen_exaggeration(tracks: Iterable[_Track]) -> int:
    """Smallest power of ten that makes the middle ellipsoid seen."""
    sizes = [
        ELLIPSOID_SIGMAS * float(np.sqrt(np.nanmedian(packed[:, [0, 3, 5]].sum(axis=1))))
        for packed in (doubles(t.columns, "position_covariance_enu_m2") for t in tracks if t.is_run)
        if np.isfinite(packed).any()
    ]
    size = max(sizes, default=_SEEN_SIZE_M)
    return next((x for x in _EXAGGERATIONS if size * x >= _SEEN_SIZE_M), _EXAGGERATIONS[-1])


def _draw_legend(sink: Sink, tracks: Sequence[_Track], frame: LocalFrame) -> None:
    """One name per track, each at another place along its path so that none hides another."""
    at = [
        frame.enu(track.ecef_m[[len(track.ecef_m) * (2 * i + 1) // (2 * len(tracks))]])[0]
        for i, track in enumerate(tracks)
    ]
    sink.static(
        "world/names",
        rr.Points3D(
            at,
            labels=[track.label for track in tracks],
            colors=rgba(*(track.ink.dark for track in tracks)),
            radii=radius(3.0),
            show_labels=True,
        ),
    )
