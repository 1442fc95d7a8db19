"""Reference stations on map and plan of a recording."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Final

import numpy as np
import rerun as rr

from replay.evaluate.geometry import Floats
from replay.view.fields import optional
from replay.view.frame import geodetic
from replay.view.gather import RunData
from replay.view.palette import Ink
from replay.view.scene import Scene
from replay.view.sink import Sink, radius, rgba

STATION: Final = Ink((255, 176, 32), (214, 128, 0))
DRAWN: Final = ("stations", "baselines")
"""Entities below `map` and `world` that are of stations alone."""
_ROOM: Final = 0.06


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Stations:
    """What was drawn.

    Attributes
    ----------
    names : tuple of str
    low_m, high_m : array (3,), m
        Corners of the box around all paths and stations, east, north, up.
    """

    names: tuple[str, ...]
    low_m: Floats
    high_m: Floats


def station_positions(data: RunData) -> dict[str, Floats]:
    """ECEF positions (3,) [m] of the stations at the ends of baselines, the master first."""
    baselines = sorted({*data.network_residuals, *data.network_errors})
    masters = [name.partition("-")[0] for name in baselines]
    others = [name.partition("-")[2] for name in baselines]
    found: dict[str, Floats] = {}
    for name in dict.fromkeys([*masters, *others]):
        if name in data.receivers and len(data.receivers[name]):
            place = optional(data.receivers[name], "approximate_position_ecef_m", 3)[0]
            if np.isfinite(place).all():
                found[name] = place
    return found


def draw_stations(sink: Sink, data: RunData, scene: Scene | None) -> Stations | None:
    """Send the stations of a log's network; None where there are none, or no path beside."""
    return draw_places(sink, station_positions(data), scene)


def draw_places(sink: Sink, places: Mapping[str, Floats], scene: Scene | None) -> Stations | None:
    """Send named places, the first of them the master, with lines from it to the others."""
    if scene is None or not places:
        return None
    names = list(places)
    ecef = np.array([places[name] for name in names])
    enu, lat_lon = scene.frame.enu(ecef), geodetic(ecef)[:, :2]
    color = rgba(STATION.dark)
    sink.static(
        "world/stations",
        rr.Points3D(enu, labels=names, radii=radius(5.0), colors=color, show_labels=True),
    )
    sink.static("map/stations", rr.GeoPoints(lat_lon=lat_lon, radii=radius(5.0), colors=color))
    lines = [enu[[0, i]] for i in range(1, len(enu))]
    if lines:
        faint = rgba(STATION.faint().dark)
        geographic = [lat_lon[[0, i]] for i in range(1, len(enu))]
        sink.static("world/baselines", rr.LineStrips3D(lines, radii=radius(0.6), colors=faint))
        sink.static(
            "map/baselines",
            rr.GeoLineStrings(lat_lon=geographic, radii=radius(0.6), colors=faint),
        )
    low = np.minimum(enu.min(axis=0), scene.low_m)
    high = np.maximum(enu.max(axis=0), scene.high_m)
    room = _ROOM * (high - low)
    return Stations(tuple(names), low - room, high + room)
