"""Tables and tiles of a point that stands still, of an evaluation as plain values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from replay.view.labels import NONE
from replay.view.markup import Table

_AXES: Final = ("east", "north", "up", "horizontal", "3d", "each")
_LOCAL: Final = _AXES[:3]
_FIGURES: Final = ("mean", "std", "rms")
_MM: Final = 1e3


def station_tiles(station: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Time to convergence, and standard deviations once started."""
    sessions = station.get("sessions") or ()
    if not sessions:
        return []
    found: list[tuple[str, str, str]] = []
    convergence = sessions[0].get("convergence")
    if convergence:
        limit = f"{100.0 * convergence['limit_m']:g} cm"
        found.append(
            (f"Within {limit} for good after", _minutes(convergence["to_the_end_s"]["each"]), "min")
        )
    started = sessions[0].get("started_error_m")
    if started:
        words = " / ".join(f"{_MM * started[axis]['std']:.1f}" for axis in _LOCAL)
        found.append(("Std E / N / U", words, "mm"))
    return found


def station_tables(station: Mapping[str, Any]) -> list[Table]:
    """Convergence, scatter by session, repeatability; nothing of a run that moves."""
    sessions = station.get("sessions") or ()
    rows: list[tuple[str, ...]] = []
    started = f"after {_start_up_minutes(station)} min of the run"
    for session in sessions:
        span = f"{session['start_s'] / 3600.0:.2f} to {session['end_s'] / 3600.0:.2f} h"
        for words, key in (
            ("once converged", "converged_error_m"),
            (started, "started_error_m"),
            ("float", "float_error_m"),
            (f"fixed, {100.0 * session['fixed_share']:.1f} %", "fixed_error_m"),
        ):
            axes = session.get(key)
            if axes:
                rows.append((span, words, *_millimetres(axes)))
                span = ""
    heads = tuple(f"{figure} {axis}" for figure in _FIGURES for axis in "ENU")
    about = ", ".join(f"{value:.4f}" for value in station.get("reference_ecef_m", ()))
    tables = [_convergence(session) for session in sessions if session.get("convergence")]
    if rows:
        caption = f"Against {station['reference']}: {about} m, ECEF."
        tables.append(
            Table(
                ("stands still [mm]", "rows", *heads), tuple(rows), caption=caption, text_columns=2
            )
        )
    found = station.get("repeatability")
    if found:
        names = tuple(found["std_m"])
        tables.append(
            Table(
                (f"means of {found['sessions']} sessions about their mean [mm]", *names),
                tuple(
                    (words, *(f"{_MM * found[key][name]:.1f}" for name in names))
                    for words, key in (("std", "std_m"), ("greatest", "greatest_m"))
                ),
            )
        )
    return tables


def _convergence(session: Mapping[str, Any]) -> Table:
    found = session["convergence"]
    rows = (
        ("to the end", *(_minutes(found["to_the_end_s"][name]) for name in _AXES)),
        (
            f"for {found['hold_s'] / 60.0:g} min",
            *(_minutes(found["held_s"][name]) for name in _AXES),
        ),
    )
    heads = ("east", "north", "up", "horizontal", "3D", "east, north, up each")
    return Table((f"minutes until errors keep within {found['limit_m']:g} m", *heads), rows)


def _millimetres(axes: Mapping[str, Any]) -> list[str]:
    return [f"{_MM * axes[axis][figure]:.1f}" for figure in _FIGURES for axis in _LOCAL]


def _start_up_minutes(station: Mapping[str, Any]) -> str:
    return f"{station.get('options', {}).get('start_up_s', 0.0) / 60.0:g}"


def _minutes(seconds: float | None) -> str:
    return NONE if seconds is None else f"{seconds / 60.0:.1f}"
