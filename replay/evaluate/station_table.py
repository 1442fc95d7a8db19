"""Figures of a point that stands still, for a person at a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from rich.console import Console
from rich.table import Table

from replay.evaluate.convergence import EACH
from replay.evaluate.station import Session, Station
from replay.evaluate.statistics import HORIZONTAL, LOCAL_AXES, SPATIAL, Statistics

_ABSENT: Final = "-"
_MM: Final = 1e3
_AXES: Final = (*LOCAL_AXES, HORIZONTAL, SPATIAL, EACH)


def print_station(station: Station, console: Console) -> None:
    """Print convergence, scatter and repeatability as tables."""
    x, y, z = station.reference_ecef_m
    console.print(
        f"Stands still at {x:.4f} {y:.4f} {z:.4f} m, ECEF"
        f" ({'as given' if station.reference == 'given' else station.reference})"
    )
    for session in station.sessions:
        if session.convergence is not None:
            console.print(_convergence_table(session))
    console.print(_scatter_table(station))
    found = station.repeatability
    if found is not None:
        table = Table(
            title=f"Means of {found.sessions} sessions about their mean, mm", title_justify="left"
        )
        table.add_column("")
        for name in found.std_m:
            table.add_column(name, justify="right")
        for words, values in (("std", found.std_m), ("greatest", found.greatest_m)):
            table.add_row(words, *(f"{_MM * value:.1f}" for value in values.values()))
        console.print(table)
        console.print("[dim]sessions of one run: the filter goes on from one to the next[/dim]")


def _convergence_table(session: Session) -> Table:
    found = session.convergence
    assert found is not None
    table = Table(
        title=f"Minutes until errors keep within {found.limit_m:g} m", title_justify="left"
    )
    table.add_column("")
    for name in _AXES:
        table.add_column("east, north, up each" if name == EACH else name, justify="right")
    for words, times in (
        ("to the end", found.to_the_end_s),
        (f"for {found.hold_s / 60.0:g} min", found.held_s),
    ):
        table.add_row(words, *(minutes(times[name]) for name in _AXES))
    return table


def _scatter_table(station: Station) -> Table:
    table = Table(title="Errors of the position that stands still, mm", title_justify="left")
    for name in ("session", "rows"):
        table.add_column(name)
    for figure in ("mean", "std", "rms"):
        for axis in "ENU":
            table.add_column(f"{figure} {axis}", justify="right")
    several = len(station.sessions) > 1
    for session in station.sessions:
        span = f"{session.start_s / 3600.0:.2f} to {session.end_s / 3600.0:.2f} h"
        after = f"after {station.options.start_up_s / 60.0:g} min"
        for words, axes in (
            ("once converged", session.converged_error_m),
            (f"{after} of the run" if several else after, session.started_error_m),
            ("float", session.float_error_m),
            (f"fixed, {100.0 * session.fixed_share:.1f} %", session.fixed_error_m),
        ):
            if axes is not None:
                table.add_row(span, words, *_millimetres(axes))
                span = ""
        if session.first_fix_s is not None:
            table.add_row("", f"first fix after {minutes(session.first_fix_s)} min")
        table.add_section()
    return table


def _millimetres(axes: Mapping[str, Statistics]) -> list[str]:
    return [
        f"{_MM * getattr(axes[axis], figure):.1f}"
        for figure in ("mean", "std", "rms")
        for axis in LOCAL_AXES
    ]


def minutes(seconds: float | None) -> str:
    """Minutes for a table; a dash for never."""
    return _ABSENT if seconds is None else f"{seconds / 60.0:.1f}"
