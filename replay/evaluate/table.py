"""An evaluation for a person at a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from rich.console import Console
from rich.table import Table

from replay.evaluate.consistency import Consistency
from replay.evaluate.outages import Outage
from replay.evaluate.report import Evaluation
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
            table.add_row(f"{name} [{unit}]".replace("[", r"\["), "no truth")
            continue
        for index, (axis, figures) in enumerate(axes.items()):
            head = f"{name} [{unit}]".replace("[", r"\[") if index == 0 else ""
            table.add_row(head, axis, *(_number(getattr(figures, key)) for key in _FIGURES))
        table.add_section()
    return table


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
            _add_consistency(table, f"NIS {kind.replace('_', ' ')} {axis}", of_axis)
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
