"""Figures 3 to 10 of Kan (2022) as panels, which the report draws and the recording sends.

They are of the first seed that has all runs, of the first inertial unit, with samples
integrated; figure 10 has the decimated ones beside them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.batch.kan2022.measure import ATTITUDE, PDOP, POSITION, QUANTITIES, SATELLITES, VELOCITY
from replay.batch.kan2022.plan import ALONE, DECIMATE, INTEGRATE
from replay.batch.kan2022.runs import UNITS, Kind, Run, Runs, first_with
from replay.evaluate.geometry import Floats
from replay.evaluate.outages import Span
from replay.evaluate.statistics import LOCAL_AXES
from replay.time import NS_PER_S
from replay.view.palette import ALL_SYSTEMS, BOUND, Ink, run_ink
from replay.view.panels import (
    Curve,
    Panel,
    Section,
    broken,
    finite_curve,
    panel,
    robust_limits,
)

_SECTIONS: Final = {
    POSITION: (Section.POSITION_ERROR, "Position difference"),
    VELOCITY: (Section.VELOCITY_ERROR, "Velocity difference"),
    ATTITUDE: (Section.ATTITUDE_ERROR, "Attitude difference"),
}
_FIGURES: Final = {
    False: {POSITION: 4, VELOCITY: 5, ATTITUDE: 6},
    True: {POSITION: 7, VELOCITY: 8, ATTITUDE: 9},
}
METHODS: Final = {INTEGRATE: "integrated", DECIMATE: "decimated"}
_AXIS_SHARE: Final = 99.0  # of the values that an axis has to hold


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
    outages : tuple of Span
        Shaded.
    """

    number: int
    title: str
    caption: str
    panels: tuple[Panel, ...]
    columns: int
    outages: tuple[Span, ...] = ()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """The runs of one seed that figures are of.

    Attributes
    ----------
    runs : Runs
    seed : int
    grade : str
    begin_ns, end_ns : int, GPS ns
        Of the common epochs.
    """

    runs: Runs
    seed: int
    grade: str
    begin_ns: int
    end_ns: int

    def drawn(self, *, outage: bool) -> list[Run]:
        """PPP and the integrated rates, those that are there."""
        kinds = [Kind(ALONE, outage=outage), *self.of_method(INTEGRATE, outage=outage)]
        return [run for kind in kinds if (run := self.runs.find(kind, self.seed)) is not None]

    def of_method(self, method: str, *, outage: bool) -> list[Kind]:
        """Rates whose samples were made fewer in one way, the log's own first."""
        kinds = self.runs.tight(self.grade, outage=outage)
        return [kind for kind in kinds if kind.method == method or kind is kinds[0]]

    def spans(self) -> tuple[Span, ...]:
        """Outages of the seed."""
        for run in self.drawn(outage=True):
            if run.spans():
                return run.spans()
        return ()


def shown(runs: Runs) -> Shown | None:
    """What figures are of; None where nothing went well."""
    if not runs.runs:
        return None
    grades = runs.grades()
    grade = grades[0] if grades else ""
    seed = first_with(runs, runs.kinds)
    seed = runs.seeds[0] if seed is None else seed
    own = [run for run in runs.runs if run.seed == seed]
    return Shown(runs, seed, grade, runs.begin_ns(seed), max(int(run.times_ns[-1]) for run in own))


def rate_ink(rates: Sequence[int], rate_hz: int) -> Ink:
    """Colour of a rate; PPP alone is grey."""
    return run_ink((0, 1, 3, 2, 4, 5, 6, 7)[list(rates).index(rate_hz) % 8])


def figures_of(found: Shown) -> list[FigureOfPaper]:
    """Figures that have panels, in the paper's order."""
    made = [_sky(found)]
    for outage in (False, True):
        made += [_differences(found, quantity, outage=outage) for quantity in QUANTITIES]
    made.append(_drifts(found))
    return [item for item in made if item.panels]


def _sky(found: Shown) -> FigureOfPaper:
    panels: list[Panel] = []
    for outage in (False, True):
        run = found.runs.find(Kind(ALONE, outage=outage), found.seed)
        if run is None or SATELLITES not in run.series:
            continue
        words = "with the outages" if outage else "as simulated"
        for name, title, ink in (
            (SATELLITES, "Satellites used", ALL_SYSTEMS),
            (PDOP, "PDOP", run_ink(0)),
        ):
            values = run.series[name].astype(np.float64)
            curve = broken(finite_curve(Curve(words, name, run.times_ns, values, ink)))
            limits = robust_limits([values], share=_AXIS_SHARE, from_nought=True)
            panels += panel(
                Section.GEOMETRY, f"figure3/{name}/{'outages' if outage else 'all'}",
                f"{title}, {words}", "1", [curve], row=words, limits=limits,
            )  # fmt: skip
    return FigureOfPaper(
        3, "Satellites and dilution of precision",
        "What PPP alone used at each epoch.", tuple(panels), 2, found.spans(),
    )  # fmt: skip


def _differences(found: Shown, quantity: str, *, outage: bool) -> FigureOfPaper:
    number = _FIGURES[outage][quantity]
    runs = found.drawn(outage=outage)
    if quantity != POSITION:  # PPP has no attitude, and its velocity is another matter
        runs = [run for run in runs if run.kind.run != ALONE]
    unit, scale = UNITS[quantity]
    section, title = _SECTIONS[quantity]
    panels: list[Panel] = []
    for index, axis in enumerate(QUANTITIES[quantity]):
        curves: list[Curve] = []
        for run in runs:
            keep = run.times_ns >= found.begin_ns
            values = run.errors(quantity)[keep, index] * scale
            words = run.kind.words()
            curve = Curve(words, words, run.times_ns[keep], values, _ink(found, run.kind))
            curves.append(broken(finite_curve(curve)))
        limits = robust_limits([c.values for c in curves], share=_AXIS_SHARE)
        panels += panel(
            section, f"figure{number}/{axis}", f"{title}, {axis}", unit, curves,
            row=axis, limits=limits,
        )  # fmt: skip
    words = " with the partial outages" if outage else ""
    return FigureOfPaper(
        number, f"{title}s{words}",
        f"Estimate less truth at the epochs of GNSS, {found.grade}, samples integrated.",
        tuple(panels), 1, found.spans() if outage else (),
    )  # fmt: skip


def _ink(found: Shown, kind: Kind) -> Ink:
    if kind.run == ALONE:
        return BOUND
    return rate_ink([k.rate_hz for k in found.of_method(INTEGRATE, outage=kind.outage)],
                    kind.rate_hz)  # fmt: skip


def drift_curves(found: Shown, kind: Kind, span: Span) -> tuple[npt.NDArray[np.int64], Floats]:
    """Times (n,) and position differences (n, 3) [cm] in an outage, from the epoch before it.

    The last row is that before the first epoch with all satellites.
    """
    run = found.runs.find(kind, found.seed)
    none = np.empty(0, dtype=np.int64), np.empty((0, 3))
    if run is None:
        return none
    number = found.spans().index(span)
    outages = run.outages()
    inside = (run.times_ns >= span.start_ns - NS_PER_S) & (run.times_ns < span.end_ns)
    times = run.times_ns[inside]
    values = run.errors(POSITION)[inside]
    if number < len(outages) and outages[number]:
        end = [outages[number].get(f"{axis}.end_m", np.nan) for axis in LOCAL_AXES]
        times = np.append(times, span.end_ns)
        values = np.vstack([values, end])
    return times, values * UNITS[POSITION][1]


def _drifts(found: Shown) -> FigureOfPaper:
    panels: list[Panel] = []
    for method, words in METHODS.items():
        kinds = found.of_method(method, outage=True)
        if len(kinds) <= 1 and method == DECIMATE:
            continue
        for index, axis in enumerate(LOCAL_AXES):
            curves: list[Curve] = []
            for kind in kinds:
                parts = [drift_curves(found, kind, span) for span in found.spans()]
                if not parts:
                    continue
                times = np.concatenate([times for times, _ in parts])
                values = np.concatenate([part[:, index] for _, part in parts])
                label = kind.words()
                curve = Curve(label, label, times, values, _ink(found, _integrated(kind)))
                curves.append(broken(finite_curve(curve)))
            panels += panel(
                Section.POSITION_ERROR, f"figure10/{method}/{axis}",
                f"Drift {axis}, samples {words}", "cm", curves, row=words,
            )  # fmt: skip
    return FigureOfPaper(
        10, "Drift in the outages",
        "Position differences along the time since each outage began.",
        tuple(panels), len(LOCAL_AXES), found.spans(),
    )  # fmt: skip


def _integrated(kind: Kind) -> Kind:
    return dataclasses.replace(kind, method=INTEGRATE)
