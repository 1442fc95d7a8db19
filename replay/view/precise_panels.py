"""Panels of precise point positioning: what is estimated besides position and clock."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from replay.evaluate.geometry import Floats
from replay.log.columns import Columns
from replay.view.fields import doubles, integers, optional, texts
from replay.view.gather import Run, RunData
from replay.view.labels import BOUNDS, SIGMA, system
from replay.view.palette import Ink, run_ink, system_ink
from replay.view.panels import (
    Curve,
    Panel,
    Section,
    Shape,
    broken,
    finite_curve,
    panel,
    robust_limits,
    sigma_band,
    thinned,
)

_BINS: Final = 200  # of a curve of one satellite in the recording
_LATE: Final = 0.25  # of the run, after which its standard deviations set the axis
Names = npt.NDArray[np.str_]


def precise_panels(data: RunData) -> list[Panel]:
    """Troposphere, slant ionosphere, receiver's biases, ambiguities, of the runs that have them."""
    panels: list[Panel] = []
    several = sum(run.troposphere is not None or run.phases is not None for run in data.runs) > 1
    for index, run in enumerate(data.runs):
        name = f"{run.name}: " if several else ""
        if run.troposphere is not None:
            panels += _troposphere(run.name, run.troposphere, name, run_ink(index))
        if run.ionosphere is not None:
            panels += _ionosphere(run.name, run.ionosphere, name)
        if run.biases is not None:
            panels += _biases(run.name, run.biases, name)
        if run.phases is not None:
            panels += _phases(run, run.phases, name)
    return panels


def _with_band(key: str, label: str, rows: Columns, field: str, ink: Ink) -> list[Curve]:
    """An estimate and three standard deviations to each side."""
    times, values = rows.valid_time_ns, optional(rows, f"{field}_m")
    sigma = optional(rows, f"{field}_std_m")
    band = sigma_band(f"{key}_bound", f"{label} {BOUNDS}", times, values, sigma, ink)
    return [band, broken(finite_curve(Curve(key, label, times, values, ink)))]


def _settled_limits(curves: list[Curve]) -> tuple[float, float] | None:
    """Axis for what bands and lines hold after the first quarter: at first they are wide."""
    late: list[Floats] = []
    for curve in curves:
        if len(curve.times_ns):
            begin, end = int(curve.times_ns[0]), int(curve.times_ns[-1])
            values = curve.values[curve.times_ns >= begin + int(_LATE * (end - begin))]
            late.append(values[np.isfinite(values)].ravel())
    known = [values for values in late if len(values)]
    if not known:
        return None
    low = min(float(values.min()) for values in known)
    high = max(float(values.max()) for values in known)
    room = 0.25 * max(high - low, 1e-6)
    return low - room, high + room


def _troposphere(run: str, rows: Columns, name: str, ink: Ink) -> list[Panel]:
    key, row = f"troposphere/{run}", f"{run} troposphere"
    curves = _with_band("wet", "wet", rows, "wet", ink)
    panels = panel(
        Section.TROPOSPHERE, f"{key}/wet", f"{name}Zenith wet delay, {BOUNDS}", "m", curves,
        row=row, limits=_settled_limits(curves),
    )  # fmt: skip
    gradients = [
        curve
        for number, side in enumerate(("north", "east"))
        for curve in _with_band(side, side, rows, f"gradient_{side}", run_ink(number))
    ]
    panels += panel(
        Section.TROPOSPHERE, f"{key}/gradient", f"{name}Gradients, {BOUNDS}", "m", gradients,
        row=row, limits=_settled_limits(gradients),
    )  # fmt: skip
    hydrostatic = Curve("hydrostatic", "hydrostatic, modelled", rows.valid_time_ns,
                        optional(rows, "hydrostatic_m"), ink)  # fmt: skip
    return panels + panel(
        Section.TROPOSPHERE, f"{key}/hydrostatic", f"{name}Zenith hydrostatic delay", "m",
        [broken(finite_curve(hydrostatic))], row=row,
    )  # fmt: skip


def _labelled(rows: Columns, labels: Names, values: Floats) -> list[Curve]:
    """A line for each label, in the colour of its system."""
    return [
        thinned(
            broken(
                finite_curve(
                    Curve(
                        label.replace(" ", "_"),
                        label,
                        rows.valid_time_ns[labels == label],
                        values[labels == label],
                        system_ink(label[:1]),
                        group=system(label[:1]),
                    )
                )
            ),
            _BINS,
        )
        for label in np.unique(labels).tolist()
    ]


def _estimate_and_sigma(
    section: Section,
    key: str,
    titles: tuple[str, str],
    rows: Columns,
    labels: Names,
    series: tuple[Floats, Floats],
) -> list[Panel]:
    """An estimate of each label, and its standard deviation beside it."""
    panels: list[Panel] = []
    for part, title, values in zip(("estimate", "sigma"), titles, series, strict=True):
        panels += panel(
            section, f"{key}/{part}", title, "m", _labelled(rows, labels, values), row=key,
            limits=robust_limits([values], share=97.0, from_nought=part == "sigma"),
        )  # fmt: skip
    return panels


def _ionosphere(run: str, rows: Columns, name: str) -> list[Panel]:
    return _estimate_and_sigma(
        Section.IONOSPHERE,
        f"ionosphere/{run}",
        (f"{name}Slant ionosphere on the first signal", f"{name}{SIGMA} of the slant ionosphere"),
        rows,
        np.asarray(texts(rows, "satellite")),
        (doubles(rows, "delay_m"), doubles(rows, "delay_std_m")),
    )


def _biases(run: str, rows: Columns, name: str) -> list[Panel]:
    labels = _joined(rows, "system", "signal")
    kinds = np.unique(labels).tolist()
    panels: list[Panel] = []
    for part, title, field in (
        ("estimate", "Receiver's code bias", "bias_m"),
        ("sigma", f"{SIGMA} of code biases", "bias_std_m"),
    ):
        values = doubles(rows, field)
        curves = [
            broken(
                finite_curve(
                    Curve(
                        label.replace(" ", "_"),
                        f"{system(label[:1])} {label[2:]}",
                        rows.valid_time_ns[labels == label],
                        values[labels == label],
                        _bias_ink(label, kinds),
                    )
                )
            )
            for label in kinds
        ]
        panels += panel(
            Section.RECEIVER_BIASES, f"receiver_biases/{run}/{part}", f"{name}{title}", "m", curves,
            row=run, limits=robust_limits([values], share=97.0, from_nought=part == "sigma"),
        )  # fmt: skip
    return panels


def _bias_ink(label: str, kinds: list[str]) -> Ink:
    """The colour of a system, paler from its second signal on."""
    first = next(kind for kind in kinds if kind[:1] == label[:1])
    ink = system_ink(label[:1])
    return ink if label == first else ink.faint()


def _phases(run: Run, rows: Columns, name: str) -> list[Panel]:
    labels = _joined(rows, "satellite", "signal")
    values = doubles(rows, "ambiguity_m")
    away = np.full(len(rows), np.nan)
    for label in np.unique(labels).tolist():
        of = np.flatnonzero(labels == label)
        away[of] = less_last(values[of], integers(rows, "epoch_count")[of])
    panels = _estimate_and_sigma(
        Section.PHASES,
        f"phases/{run.name}",
        (f"{name}Ambiguity less its last value", f"{name}{SIGMA} of ambiguities"),
        rows,
        labels,
        (away, doubles(rows, "ambiguity_std_m")),
    )
    times, count = np.unique(rows.valid_time_ns, return_counts=True)
    began, new = np.unique(
        rows.valid_time_ns[integers(rows, "epoch_count") <= 1], return_counts=True
    )
    curves = [
        broken(Curve("all", "estimated", times, count.astype(np.float64), run_ink(0))),
        Curve("new", "begun", began, new.astype(np.float64), run_ink(3), Shape.DOTS),
    ]
    return panels + panel(
        Section.PHASES, f"phases/{run.name}/count", f"{name}Ambiguities", "1", curves,
        row=f"{run.name} ambiguities",
    )  # fmt: skip


def less_last(values: Floats, epoch_count: npt.NDArray[np.int64]) -> Floats:
    """Values (n,) of one phase less the last value of their arc; an arc counts its epochs up."""
    starts = np.flatnonzero(np.diff(epoch_count, prepend=np.iinfo(np.int64).max) <= 0)
    ends = np.append(starts[1:], len(values))
    return np.asarray(values - np.repeat(values[ends - 1], ends - starts))


def _joined(rows: Columns, first: str, second: str) -> Names:
    pairs = zip(texts(rows, first), texts(rows, second), strict=True)
    return np.array([f"{a} {b}" for a, b in pairs], dtype=np.str_)
