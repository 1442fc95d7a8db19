"""An evaluation for a person at a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from rich.console import Console
from rich.table import Table

from replay.evaluate.consistency import Consistency
from replay.evaluate.outages import Outage
from replay.evaluate.report import Evaluation
from replay.evaluate.satellites import Geometry, Spread
from replay.evaluate.station_table import print_station
from replay.evaluate.statistics import Statistics

_FIGURES: Final = ("mean", "std", "rms", "p95", "max")
_ABSENT: Final = "-"


def print_evaluation(evaluation: Evaluation, console: Console) -> None:
    """Print errors, outages and consistency as tables."""
    counts = evaluation.counts
    console.print(
        f"[bold]{evaluation.run}[/bold]: {counts.compared_rows} of {counts.solution_rows} rows"
        f" against {counts.truth_rows} rows of truth, {counts.epoch_rows} of them GNSS epochs"
        f" outside outages; {counts.without_truth_rows} without truth"
    )
    console.print(_error_table("at GNSS epochs outside outages", _at_epochs(evaluation)))
    console.print(_error_table("at all rows", _at_all(evaluation)))
    if evaluation.solution_of != "imu":
        console.print(
            "[dim]position: rows without attitude are about an antenna; truth is moved there where"
            " its lever arm and the truth's attitude are known[/dim]"
        )
    _print_gnss(evaluation, console)
    if evaluation.station is not None:
        print_station(evaluation.station, console)
    if evaluation.outages:
        console.print(_outage_table(evaluation.outages))
        summary = evaluation.outage_summary
        console.print(
            f"{summary.count} outages, horizontal drift: median"
            f" {_number(summary.horizontal_median_m)} m, rms {_number(summary.horizontal_rms_m)} m,"
            f" max {_number(summary.horizontal_max_m)} m"
        )
    console.print(_consistency_table(evaluation))
    for caution in evaluation.nees.cautions:
        console.print(f"[dim]NEES: {caution}[/dim]")


_Group = tuple[str, str, Mapping[str, Statistics] | None]


def _at_epochs(evaluation: Evaluation) -> tuple[_Group, ...]:
    return (
        ("position", "m", evaluation.position_error_m),
        (
            f"position change, {evaluation.counts.change_pairs} pairs",
            "m",
            evaluation.position_change_error_m,
        ),
        *(
            [("position, fixed", "m", evaluation.position_error_fixed_m)]
            if evaluation.position_error_fixed_m is not None
            else []
        ),
        ("velocity", "m/s", evaluation.velocity_error_m_s),
        ("attitude", "deg", evaluation.attitude_error_deg),
    )


def _at_all(evaluation: Evaluation) -> tuple[_Group, ...]:
    return (
        ("position", "m", evaluation.position_error_all_m),
        ("velocity", "m/s", evaluation.velocity_error_all_m_s),
        ("attitude", "deg", evaluation.attitude_error_all_deg),
    )


def _error_table(where: str, groups: tuple[_Group, ...]) -> Table:
    table = Table(title=f"Errors, solution minus truth, {where}", title_justify="left")
    table.add_column("quantity")
    table.add_column("axis")
    for name in _FIGURES:
        table.add_column(name, justify="right")
    for name, unit, axes in groups:
        if axes is None:
            table.add_row(f"{name} [{unit}]".replace("[", r"\["), "not known to both")
            continue
        for index, (axis, figures) in enumerate(axes.items()):
            head = f"{name} [{unit}]".replace("[", r"\[") if index == 0 else ""
            table.add_row(head, axis, *(_number(getattr(figures, key)) for key in _FIGURES))
        table.add_section()
    return table


def _print_gnss(evaluation: Evaluation, console: Console) -> None:
    """Geometry, ambiguities and availability, of which a run over positions has none."""
    if evaluation.geometry is not None:
        console.print(_geometry_table(evaluation.geometry))
    ambiguities = evaluation.ambiguities
    if ambiguities is not None:
        shares = ", ".join(f"{100.0 * s:.1f} % {name}" for name, s in ambiguities.share.items())
        console.print(f"Ambiguities, {ambiguities.epochs} epochs: {shares}")
        console.print(
            f"wrong fixes: {_count(ambiguities.wrong_fixes)} of {ambiguities.fixed_with_truth} over"
            f" {ambiguities.wrong_fix_limit_m:g} m horizontally, at most"
            f" {_count(ambiguities.longest_wrong_run)} in a row; " + _ratio(ambiguities.ratio)
        )
    if evaluation.availability is not None:
        found = evaluation.availability
        console.print(
            f"Availability: a solution at {found.solution_epochs} of {found.observation_epochs}"
            f" epochs of observation, {100.0 * found.share:.1f} %"
        )


def _ratio(ratio: Spread | None) -> str:
    if ratio is None:
        return "no ratios told"
    return f"ratio median {ratio.median:.2f}, mean {ratio.mean:.2f}, least {ratio.min:.2f}"


def _geometry_table(geometry: Geometry) -> Table:
    table = Table(title=f"Satellites used and PDOP, {geometry.epochs} epochs", title_justify="left")
    table.add_column("system")
    for name in ("satellites mean", "least", "most"):
        table.add_column(name, justify="right")
    for name in ("PDOP epochs", "mean", "median", "p95", "max"):
        table.add_column(name, justify="right")
    for system, counts in geometry.satellites.items():
        pdop = geometry.pdop.get(system)
        table.add_row(
            system,
            f"{counts.mean:.2f}",
            f"{counts.min:.0f}",
            f"{counts.max:.0f}",
            *([_ABSENT] * 5 if pdop is None else [f"{pdop.count}", *_dops(pdop)]),
        )
    return table


def _dops(dop: Spread) -> list[str]:
    return [f"{value:.2f}" for value in (dop.mean, dop.median, dop.p95, dop.max)]


def _count(value: int | None) -> str:
    return _ABSENT if value is None else str(value)


def _outage_table(outages: tuple[Outage, ...]) -> Table:
    table = Table(title="Outages, drift at the end of each", title_justify="left")
    heads = ("start s", "length s", "east m", "north m", "up m", "horizontal m", "3d m")
    for name in (*heads, "heading deg", "worst horizontal m"):
        table.add_column(name, justify="right")
    for outage in outages:
        table.add_row(
            f"{outage.start_s:.1f}",
            f"{outage.duration_s:.1f}" + ("" if outage.ended else " to the end"),
            _number(outage.east_drift_m),
            _number(outage.north_drift_m),
            _number(outage.up_drift_m),
            _number(outage.horizontal_drift_m),
            _number(outage.drift_3d_m),
            _number(outage.heading_drift_deg),
            _number(outage.horizontal_max_m),
        )
    return table


def _consistency_table(evaluation: Evaluation) -> Table:
    table = Table(title="Consistency, normalised squares", title_justify="left")
    table.add_column("of")
    for name in ("due", "mean", "95 % of the mean", "inside 95 %", "samples", "left out"):
        table.add_column(name, justify="right")
    nees = evaluation.nees
    for name, found in (
        ("NEES position", nees.position),
        ("NEES velocity", nees.velocity),
        ("NEES attitude", nees.attitude),
    ):
        _add_consistency(table, name, found)
    table.add_section()
    for kind, axes in (evaluation.nis or {}).items():
        for axis, of_axis in axes.items():
            side = "" if axis == "none" else f" {axis}"
            _add_consistency(table, f"NIS {kind.replace('_', ' ')}{side}", of_axis)
    return table


def _add_consistency(table: Table, name: str, found: Consistency | None) -> None:
    if found is None:
        table.add_row(name, *[_ABSENT] * 6)
        return
    low, high = found.bounds_95
    style = "" if low <= found.mean <= high else "yellow"
    table.add_row(
        name,
        f"{found.dimension}",
        f"{found.mean:.2f}",
        f"{low:.2f} to {high:.2f}",
        f"{100.0 * found.inside_fraction:.1f} %",
        f"{found.count}",
        f"{found.rejected}",
        style=style,
    )


def _number(value: float | None) -> str:
    return _ABSENT if value is None else f"{value:.4f}"
