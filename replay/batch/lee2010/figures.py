"""Figures 5 to 10 of Lee (2010) as panels, which the report draws and the recording sends."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from replay.batch.lee2010.picture import Filtered, RunPicture
from replay.evaluate.signal_table import labels
from replay.view.network_panels import (
    correction_panels,
    impact_panels,
    residual_panels,
    satellite_inks,
    shifted,
    state_panels,
)
from replay.view.network_solution import difference_panels, navigation_parameter_panels
from replay.view.palette import Ink, run_ink
from replay.view.panels import Panel


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class CaseRuns:
    """One case, its first seed.

    Attributes
    ----------
    label : str
        "case1".
    title : str
    runs : mapping of mode to RunPicture
    """

    label: str
    title: str
    runs: Mapping[str, RunPicture]

    @property
    def any_run(self) -> RunPicture:
        """The run in network mode, else another."""
        return self.runs.get("network") or next(iter(self.runs.values()))

    @property
    def start_ns(self) -> int:
        """First solution of all runs, GPS ns."""
        return min(int(run.solution.valid_time_ns.min()) for run in self.runs.values())

    @property
    def end_ns(self) -> int:
        """Last solution of all runs, GPS ns."""
        return max(int(run.solution.valid_time_ns.max()) for run in self.runs.values())


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class FigureOfPaper:
    """Panels of one figure.

    Attributes
    ----------
    number : int
        Of the paper.
    title, caption : str
    panels : tuple of Panel
    columns : int
        Panels beside each other.
    """

    number: int
    title: str
    caption: str
    panels: tuple[Panel, ...]
    columns: int


def figures_of(cases: Sequence[CaseRuns]) -> list[FigureOfPaper]:
    """Figures that have panels, in the paper's order; times are those of the first case."""
    inks = _inks(cases)
    made = (
        *_filter_figures(cases[0]),
        _corrections(cases, inks),
        _residuals(cases, inks),
        _navigation(cases[0]),
        _differences(cases),
    )
    return [figure for figure in made if figure is not None and figure.panels]


def span_of(cases: Sequence[CaseRuns]) -> tuple[int, int]:
    """From the start of the first case to the end of the longest."""
    start = cases[0].start_ns
    return start, start + max(case.end_ns - case.start_ns for case in cases)


def _inks(cases: Sequence[CaseRuns]) -> dict[str, Ink]:
    names = {name for case in cases for run in case.runs.values() for name in run.satellites}
    return satellite_inks(sorted(names))


def _moved(panels: Sequence[Panel], case: CaseRuns, cases: Sequence[CaseRuns]) -> list[Panel]:
    by_ns = cases[0].start_ns - case.start_ns
    return [shifted(item, by_ns) if by_ns else item for item in panels]


def _filter_figures(case: CaseRuns) -> list[FigureOfPaper]:
    """Figures 5 and 6: one satellite of the first baseline."""
    chosen = case.any_run.filtered
    if chosen is None:
        return []
    errors, residuals, satellite = chosen.errors, chosen.residuals, chosen.satellite
    signals = sorted({s.decode() for s in np.unique(labels(errors, "signal")).tolist()})
    states = [
        item
        for signal in signals
        for item in state_panels(errors, satellite, signal, run_ink(0), key="figure5")
    ]
    where = f"{satellite}, baseline {chosen.baseline}, {case.title.lower()}"
    references = _references(chosen)
    return [
        FigureOfPaper(
            5, f"States of the filter of baseline errors: {where}",
            f"Left the states, right their standard deviations, {' and '.join(signals)}."
            f" Reference satellites: {references}.",
            tuple(states), 2,
        ),
        FigureOfPaper(
            6, f"Residuals as found and as filtered: {where}",
            "Left, dots: double-difference residual, station less master; line: its estimate"
            " without multipath. Right: the one less the other, what the filter takes for multipath"
            " and noise."
            f" Reference satellites: {references}.",
            tuple(impact_panels(residuals, errors, satellite, run_ink(0), key="figure6")), 2,
        ),
    ]  # fmt: skip


def _references(chosen: Filtered) -> str:
    names = labels(chosen.errors, "reference")
    return ", ".join(name.decode() for name in dict.fromkeys(names.tolist()))


def _corrections(cases: Sequence[CaseRuns], inks: Mapping[str, Ink]) -> FigureOfPaper:
    panels: list[Panel] = []
    for case in cases:
        corrections = case.any_run.corrections
        if corrections is not None and len(corrections):
            found = correction_panels(
                corrections, inks, key=f"figure7/{case.label}", row=case.label, title=case.title
            )
            panels += _moved(found, case, cases)
    return FigureOfPaper(
        7, "Network corrections of the rover, satellite by satellite",
        "What is taken off the rover's double-differenced phases; a line ends where the"
        " reference satellite changes.",
        tuple(panels), 2,
    )  # fmt: skip


def _residuals(cases: Sequence[CaseRuns], inks: Mapping[str, Ink]) -> FigureOfPaper:
    panels: list[Panel] = []
    for case in cases:
        residuals = case.any_run.residuals
        if residuals is not None:
            found = residual_panels(residuals, inks, key=f"figure8/{case.label}", title=case.title)
            for pair in found.values():
                panels += _moved(pair, case, cases)
    return FigureOfPaper(
        8, "Double-difference residuals of the rover",
        "Phases less the range at the true position, the true integers and the modelled delays."
        " Left: as in single mode. Right: the network's corrections taken off.",
        tuple(panels), 2,
    )  # fmt: skip


def _navigation(case: CaseRuns) -> FigureOfPaper:
    return FigureOfPaper(
        9, f"Navigation parameters, {case.title.lower()}",
        "Estimates in network mode: position from the first solution, velocity, attitude.",
        tuple(navigation_parameter_panels(case.any_run.solution, key="figure9")), 3,
    )  # fmt: skip


def _differences(cases: Sequence[CaseRuns]) -> FigureOfPaper:
    panels: list[Panel] = []
    for case in cases:
        errors = {mode: run.differences for mode, run in case.runs.items()}
        found = difference_panels(errors, key=f"figure10/{case.label}", title=case.title)
        panels += _moved(found, case, cases)
    return FigureOfPaper(
        10, "Coordinate differences in both modes",
        "Estimate less truth at the epochs of GNSS of the tables' span. The axes of both modes"
        " differ.",
        tuple(panels), len(cases[0].runs),
    )  # fmt: skip
