"""Where the satellites stood, on paper: tracks over the sky and along time."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from replay.evaluate.geometry import Floats
from replay.log.columns import Columns
from replay.view.charts import WIDTH_IN, Chart, Clock, draw
from replay.view.fields import doubles, texts
from replay.view.labels import system
from replay.view.palette import REJECTED, system_ink
from replay.view.thinning import dot_stride

_MOST_POINTS: Final = 200  # of a track
_ROW_IN: Final = 0.16
_GAP_INTERVALS: Final = 3.0
_MARGIN_IN: Final = 0.9
_NEAR_DEG: Final = 15.0
_POINTS_PER_DEG: Final = 1.75  # of the sky plot's radius
_FREE_POINTS: Final = 12.0
_MOST_OBSTACLES: Final = 1500
Names = npt.NDArray[np.str_]


def sky_chart(receiver: str, satellites: Columns) -> Chart | None:
    """Azimuth and elevation of each satellite; None where no direction is known.

    Parameters
    ----------
    receiver : str
    satellites : Columns of replay.SatelliteSight
    """
    names = np.asarray(texts(satellites, "satellite"))
    azimuth = doubles(satellites, "azimuth_rad")
    elevation = np.degrees(doubles(satellites, "elevation_rad"))
    known = np.isfinite(azimuth) & np.isfinite(elevation) & (elevation >= 0.0)
    if not known.any():
        return None

    def paint(figure: Figure) -> None:
        ax = figure.add_subplot(projection="polar")
        assert isinstance(ax, PolarAxes)
        ax.set_theta_zero_location("N")
        ax.set_theta_direction(-1)
        ax.set_rlim(0.0, 90.0)
        ends = _last_seen(names, known)
        ax.set_rgrids(
            [0, 30, 60, 90], labels=["", "60°", "30°", ""], angle=_free_side(azimuth[known]),
            fontsize=7, color="#8a8f98",
        )  # fmt: skip
        ax.set_thetagrids(
            np.arange(0, 360, 45), labels=["N", "NE", "E", "SE", "S", "SW", "W", "NW"]
        )
        told: set[str] = set()
        for name in np.unique(names[known]).tolist():
            rows = np.flatnonzero((names == name) & known)
            rows = rows[:: dot_stride(len(rows), _MOST_POINTS)]
            theta, radius = np.unwrap(azimuth[rows]), 90.0 - elevation[rows]
            ink = system_ink(name[0]).hexadecimal
            label = None if name[0] in told else system(name[0])
            told.add(name[0])
            times = satellites.valid_time_ns[rows]
            steps = np.diff(times)
            if len(steps):
                cut = np.flatnonzero(steps > _GAP_INTERVALS * np.median(steps)) + 1
                theta, radius = np.insert(theta, cut, np.nan), np.insert(radius, cut, np.nan)
            ax.plot(theta, radius, color=ink, linewidth=1.6, label=label)
            ax.plot(theta[-1], radius[-1], "o", color=ink, markersize=4.5)
        seen = np.flatnonzero(known)
        seen = seen[:: dot_stride(len(seen), _MOST_OBSTACLES)]
        places = _label_places(
            _on_paper(azimuth[ends], elevation[ends]), _on_paper(azimuth[seen], elevation[seen])
        )
        for row, (x, y) in zip(ends, places, strict=True):
            name = str(names[row])
            ax.annotate(
                name, (azimuth[row], 90.0 - elevation[row]), xytext=(x, y), ha="center",
                va="center", textcoords="offset points", fontsize=7,
                color=system_ink(name[0]).hexadecimal,
            )  # fmt: skip
        figure.legend(loc="outside right upper", handlelength=1.4)

    caption = (
        f"Tracks of the satellites over {receiver}, zenith in the middle; a dot is where each was "
        "seen last."
    )
    return Chart(draw(5.2, f"sky {receiver}", paint), caption)


def _last_seen(names: Names, known: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Last known row of each satellite, in the order of their names."""
    return np.array([np.flatnonzero((names == n) & known)[-1] for n in np.unique(names[known])])


def _free_side(azimuth_rad: Floats) -> float:
    """Azimuth [deg] of the labels of the circles: where fewest satellites are."""
    sides = np.arange(11.25, 360.0, 22.5)
    away = np.abs(np.mod(np.degrees(azimuth_rad)[:, None] - sides + 180.0, 360.0) - 180.0)
    return float(sides[np.argmin((away < _NEAR_DEG).sum(axis=0))])


def _on_paper(azimuth_rad: Floats, elevation_deg: Floats) -> Floats:
    """Places (n, 2) on the sky plot, right and up of its middle [points]."""
    radius = (90.0 - elevation_deg) * _POINTS_PER_DEG
    return np.column_stack([radius * np.sin(azimuth_rad), radius * np.cos(azimuth_rad)])


def _label_places(dots: Floats, tracks: Floats) -> list[tuple[float, float]]:
    """Where names stand beside their dots [points], each as far from all else as it can."""
    around = np.radians(np.arange(0.0, 360.0, 45.0))
    offsets = np.column_stack([13.0 * np.cos(around), 8.0 * np.sin(around)])
    taken = [*dots, *tracks]
    places: list[tuple[float, float]] = []
    for dot in dots:
        others = np.asarray([t for t in taken if (t != dot).any()] or [dot + 1e3])
        away = (dot + offsets)[:, None, :] - others[None]
        free = np.hypot(away[:, :, 0] / 1.6, away[:, :, 1]).min(axis=1)  # names are wide
        best = offsets[np.argmax(np.minimum(free, _FREE_POINTS))]
        places.append((float(best[0]), float(best[1])))
        taken.append(dot + best)
    return places


def tracking_chart(
    receiver: str, satellites: Columns, slips: Columns | None, clock: Clock
) -> Chart | None:
    """When each satellite was in use, with breaks of its carrier phase; None without satellites.

    Parameters
    ----------
    receiver : str
    satellites : Columns of replay.SatelliteSight
    slips : Columns of replay.CycleSlip, or None
    clock : Clock
    """
    names = np.asarray(texts(satellites, "satellite"))
    broken = np.asarray(texts(slips, "satellite")) if slips is not None else np.empty(0, np.str_)
    order = np.unique(np.concatenate([names, broken]))[::-1].tolist()
    if not order:
        return None
    steps = np.diff(np.unique(satellites.valid_time_ns))
    limit = _GAP_INTERVALS * float(np.median(steps)) if len(steps) else 0.0

    def paint(figure: Figure) -> None:
        ax = figure.subplots()
        for row, name in enumerate(order):
            times = np.unique(satellites.valid_time_ns[names == name])
            for piece in np.split(times, np.flatnonzero(np.diff(times) > limit) + 1):
                if len(piece):
                    ends = clock.elapsed(piece[[0, -1]])
                    ax.plot(ends, [row, row], color=system_ink(name[0]).hexadecimal, linewidth=3.0,
                            solid_capstyle="butt")  # fmt: skip
        if slips is not None:
            repaired = slips["repaired"].astype(np.bool_)
            at = np.searchsorted(order[::-1], broken)
            height = len(order) - 1 - at
            for mask, marker, label in (
                (~repaired, "x", "slip"),
                (repaired, "+", "slip, repaired"),
            ):
                if mask.any():
                    ax.plot(clock.elapsed(slips.valid_time_ns[mask]), height[mask], marker,
                            color=REJECTED.hexadecimal, markersize=4.0, markeredgewidth=0.9,
                            label=label)  # fmt: skip
            figure.legend(loc="outside upper left", ncols=2)
        ax.set_yticks(range(len(order)), order, fontsize=6.5)
        ax.set_ylim(-0.8, len(order) - 0.2)
        ax.set_xlim(float(clock.elapsed(clock.start_ns)), float(clock.elapsed(clock.end_ns)))
        ax.set_xlabel(clock.label)
        ax.grid(visible=False, axis="y")

    height_in = min(_MARGIN_IN + _ROW_IN * len(order), WIDTH_IN)
    caption = f"When {receiver} saw each satellite with a known orbit"
    caption += "; red marks are breaks of the carrier phase." if slips is not None else "."
    return Chart(draw(height_in, f"tracking {receiver}", paint), caption)
