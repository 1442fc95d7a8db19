"""Charts of a network that are no plots over time: where its stations are, how a rover flew."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from replay.evaluate.geometry import Floats
from replay.log.columns import Columns
from replay.time import seconds_between
from replay.view.charts import Chart, draw
from replay.view.fields import doubles
from replay.view.frame import LocalFrame, geodetic
from replay.view.network_scene import STATION
from replay.view.palette import run_ink
from replay.view.thinning import dot_stride

_KM: Final = 1e-3
_MOST_POINTS: Final = 1500
_GROUND: Final = "#c9ccd2"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A true path.

    Attributes
    ----------
    name : str
    times_ns : int64 array (n,), GPS ns
    ecef_m : float64 array (n, 3), m
    """

    name: str
    times_ns: np.ndarray[tuple[int], np.dtype[np.int64]]
    ecef_m: Floats

    @classmethod
    def of(cls, name: str, truth: Columns) -> Track:
        """Of the channel of truth, thinned for paper."""
        finite = np.isfinite(doubles(truth, "position_ecef_m")).all(axis=1)
        known = truth.take(np.flatnonzero(finite))
        stride = dot_stride(len(known), _MOST_POINTS)
        kept = known.take(slice(None, None, stride))
        return cls(name, kept.valid_time_ns, doubles(kept, "position_ecef_m"))


def layout_chart(stations: Mapping[str, Floats], tracks: Sequence[Track]) -> Chart:
    """Stations, baselines from the first of them, and the paths, from above.

    Parameters
    ----------
    stations : mapping of name to float64 array (3,), m
        ECEF; the master first.
    tracks : sequence of Track
    """
    names = list(stations)
    ecef = np.array([stations[name] for name in names])
    frame = LocalFrame.at(ecef[0])
    places = frame.enu(ecef) * _KM

    def paint(figure: Figure) -> None:
        ax = figure.subplots()
        for name, place in zip(names[1:], places[1:], strict=True):
            ax.plot(*zip(places[0, :2], place[:2], strict=True), color="#8a8f98", linewidth=0.8,
                    linestyle="--")  # fmt: skip
            middle = 0.5 * (places[0] + place)
            length = float(np.linalg.norm(stations[name] - stations[names[0]])) * _KM
            ax.annotate(f"{length:.1f} km", (middle[0], middle[1]), fontsize=7, color="#5b616b",
                        xytext=(4, 4), textcoords="offset points")  # fmt: skip
        for index, track in enumerate(tracks):
            path = frame.enu(track.ecef_m) * _KM
            ax.plot(path[:, 0], path[:, 1], color=run_ink(index).hexadecimal, linewidth=1.2,
                    label=track.name)  # fmt: skip
        ax.plot(places[:, 0], places[:, 1], "^", color=STATION.hexadecimal, markersize=9,
                label="reference station")  # fmt: skip
        for name, place in zip(names, places, strict=True):
            ax.annotate(name, (place[0], place[1]), xytext=(8, 4), textcoords="offset points",
                        fontsize=8, fontweight="bold")  # fmt: skip
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.12)
        ax.set_xlabel("east of the master [km]")
        ax.set_ylabel("north of the master [km]")
        figure.legend(loc="outside upper left", ncols=6, handlelength=1.4)

    spans = ", ".join(f"{track.name} {_distances(stations[names[0]], track)}" for track in tracks)
    latitude, longitude, _ = frame.origin_geodetic
    return Chart(
        draw(5.6, "layout", paint),
        f"Local east and north of the master {names[0]} (latitude {latitude:.4f}°, longitude"
        f" {longitude:.4f}°), equal scales. Dashed: baselines. Distance of the rover from the"
        f" master: {spans}.",
    )


def _distances(master: Floats, track: Track) -> str:
    away = np.linalg.norm(track.ecef_m - master, axis=1) * _KM
    return f"{away.min():.1f} to {away.max():.1f} km"


def trajectory_chart(tracks: Sequence[Track]) -> Chart:
    """Each path in space with its shadow on the ground, and its height along time."""

    def paint(figure: Figure) -> None:
        count = len(tracks)
        for index, track in enumerate(tracks):
            frame = LocalFrame.at(track.ecef_m[0])
            path = frame.enu(track.ecef_m) * _KM
            height = geodetic(track.ecef_m)[:, 2]
            color = run_ink(index).hexadecimal
            ax = figure.add_subplot(2, count, index + 1, projection="3d")
            _space(ax, path, height, color, track.name)
            below = figure.add_subplot(2, count, count + index + 1)
            below.plot(seconds_between(track.times_ns, track.times_ns[0]), height, color=color,
                       linewidth=1.0)  # fmt: skip
            below.set_xlabel("time since start [s]")
            below.set_title(f"{track.name}: height above the ellipsoid [m]")

    return Chart(
        draw(5.6, "trajectory", paint),
        "Above: true paths in local east and north of their start [km] and height above the"
        " ellipsoid [m], which is stretched; grey is the shadow at the lowest height. Below: the"
        " height along time.",
    )


def _space(ax: Axes, path: Floats, height: Floats, color: str, name: str) -> None:
    low = float(height.min())
    ax.plot(path[:, 0], path[:, 1], np.full(len(path), low), color=_GROUND, linewidth=0.8)
    ax.plot(path[:, 0], path[:, 1], height, color=color, linewidth=1.0)
    ax.set_title(name)
    ax.set_xlabel("east [km]", labelpad=-4)
    ax.set_ylabel("north [km]", labelpad=-4)
    ax.tick_params(labelsize=6, pad=-2)
