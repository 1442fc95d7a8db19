"""Panels with a curve per satellite: residuals, corrections, slips, ambiguities."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.log.columns import Columns
from replay.view.fields import doubles, integers, optional, texts
from replay.view.gather import Run, RunData
from replay.view.labels import detector, measurement_kind, measurement_unit, system
from replay.view.palette import BOUND, REJECTED, run_ink, system_ink
from replay.view.panels import (
    Curve,
    Panel,
    Section,
    Shape,
    broken,
    finite_curve,
    panel,
    robust_limits,
    thinned,
)

_NO_SATELLITE: Final = "---"
_BINS: Final = 150  # of a curve of a correction in the recording: they are smooth
_CORRECTIONS: Final = (
    ("ionosphere_m", "Ionosphere", "path"),
    ("hydrostatic_m", "Troposphere, hydrostatic", "path"),
    ("wet_m", "Troposphere, wet", "path"),
    ("satellite_clock_m", "Satellite clock", "satellite"),
    ("relativity_m", "Relativity of the clock", "satellite"),
    ("group_delay_m", "Group delay", "satellite"),
    ("sagnac_m", "Earth's turning", "space"),
    ("shapiro_m", "Shapiro delay", "space"),
    ("antenna_m", "Receiver's antenna", "antennas"),
    ("satellite_antenna_m", "Satellite's antenna", "antennas"),
    ("wind_up_m", "Wind-up of the phase", "antennas"),
    ("solid_tide_m", "Tide of the solid Earth", "ground"),
    ("pole_tide_m", "Pole tide", "ground"),
    ("ocean_loading_m", "Ocean loading", "ground"),
    ("phase_bias_m", "Satellite's bias of the phase", "biases"),
    ("higher_ionosphere_m", "Ionosphere, second order", "biases"),
)
Names = npt.NDArray[np.str_]


def satellite_panels(data: RunData) -> list[Panel]:
    """Ambiguities, residuals and slips, then corrections."""
    panels: list[Panel] = []
    several = len(data.runs) > 1
    for index, run in enumerate(data.runs):
        name = f"{run.name}: " if several else ""
        panels += _resolution(run, name, index)
        if run.ambiguities is not None:
            panels += _float_ambiguities(run.name, run.ambiguities, name)
        if run.innovations is not None:
            panels += _residuals(run.name, run.innovations, name)
    for receiver, slips in data.slips.items():
        name = f"{receiver}: " if len(data.slips) > 1 else ""
        panels += _slips(receiver, slips, name)
    for receiver, corrections in data.corrections.items():
        name = f"{receiver}: " if len(data.corrections) > 1 else ""
        panels += _corrections(receiver, corrections, name)
    return panels


def _each(names: Names) -> Iterator[tuple[str, npt.NDArray[np.bool_]]]:
    for name in np.unique(names).tolist():
        yield name, names == name


def _of_satellite(
    name: str, times_ns: npt.NDArray[np.int64], values: npt.NDArray[np.float64], shape: Shape
) -> Curve:
    return finite_curve(
        Curve(name.replace(" ", "_"), name, times_ns, values, system_ink(name[:1]), shape,
              group=system(name[:1]))
    )  # fmt: skip


def _resolution(run: Run, name: str, index: int) -> list[Panel]:
    if run.resolution is None:
        return []
    rows = run.resolution
    times, ink = rows.valid_time_ns, run_ink(index)
    ratio = doubles(rows, "ratio")
    fixed = integers(rows, "fixed_count") > 0
    threshold = doubles(rows, "threshold")
    curves = [
        finite_curve(Curve("threshold", "threshold", times, threshold, BOUND)),
        finite_curve(Curve("fixed", "fixed", times[fixed], ratio[fixed], ink, Shape.DOTS)),
        finite_curve(
            Curve("not_fixed", "not fixed", times[~fixed], ratio[~fixed], REJECTED, Shape.DOTS)
        ),
    ]
    key = f"ambiguities/{run.name}"
    panels = panel(
        Section.AMBIGUITIES, f"{key}/ratio", f"{name}Ratio of second to best", "1", curves,
        row=f"{run.name} ratio", limits=robust_limits([ratio], share=95.0, from_nought=True),
    )  # fmt: skip
    counts = [
        Curve(field, label, times, integers(rows, field).astype(np.float64), shade)
        for field, label, shade in (
            ("candidate_count", "tried", BOUND),
            ("fixed_count", "fixed", ink),
        )
    ]
    panels += panel(
        Section.AMBIGUITIES, f"{key}/count", f"{name}Ambiguities tried and fixed", "1",
        map(broken, counts), row=f"{run.name} count",
    )  # fmt: skip
    return panels


def _float_ambiguities(run: str, rows: Columns, name: str) -> list[Panel]:
    """How far the real-valued ambiguities are from integers, and what they are believed to be."""
    labels = np.char.add(
        np.char.add(np.asarray(texts(rows, "satellite")), " "), np.asarray(texts(rows, "signal"))
    )
    values = doubles(rows, "float_cycles")
    integer = optional(rows, "integer_cycles")
    away = values - np.where(np.isfinite(integer), integer, np.rint(values))
    deviation = doubles(rows, "float_std_cycles")
    panels: list[Panel] = []
    for key, title, series in (
        ("away", "Float less integer, or nearest integer", away),
        ("sigma", "Standard deviation of float ambiguities", deviation),
    ):
        curves = [
            _of_satellite(label, rows.valid_time_ns[of], series[of], Shape.DOTS)
            for label, of in _each(labels)
        ]
        panels += panel(
            Section.AMBIGUITIES, f"ambiguities/{run}/{key}", f"{name}{title}", "cycle", curves,
            row=f"{run} {key}", limits=robust_limits([series], from_nought=key == "sigma"),
        )  # fmt: skip
    return panels


def _residuals(run: str, innovations: Columns, name: str) -> list[Panel]:
    """Innovations of each satellite by kind of measurement, those that were used."""
    satellites = np.asarray(texts(innovations, "satellite"))
    kinds = integers(innovations, "kind")
    used = innovations["accepted"].astype(np.bool_) & (satellites != _NO_SATELLITE)
    values = doubles(innovations, "innovation")
    panels: list[Panel] = []
    for kind in np.unique(kinds[used]).tolist():
        words = measurement_kind(kind)
        of_kind = used & (kinds == kind)
        curves = [
            _of_satellite(
                satellite, innovations.valid_time_ns[of & of_kind], values[of & of_kind], Shape.DOTS
            )
            for satellite, of in _each(satellites)
        ]
        panels += panel(
            Section.RESIDUALS, f"residuals/{run}/{words.replace(' ', '_').replace('-', '_')}",
            f"{name}{words.capitalize()} innovations, accepted", measurement_unit(kind), curves,
            row=f"{run} {words}", limits=robust_limits([values[of_kind]], share=99.5),
        )  # fmt: skip
    return panels


def _slips(receiver: str, slips: Columns, name: str) -> list[Panel]:
    """How many phases broke at an epoch, by what found it."""
    kinds = integers(slips, "detector")
    curves: list[Curve] = []
    for number, kind in enumerate(np.unique(kinds).tolist()):
        times, count = np.unique(slips.valid_time_ns[kinds == kind], return_counts=True)
        word = detector(kind)
        curves.append(
            Curve(word.replace(" ", "_"), word, times, count.astype(np.float64),
                  run_ink(number), Shape.DOTS)
        )  # fmt: skip
    return panel(
        Section.SLIPS, f"slips/{receiver}", f"{name}Cycle slips at an epoch, by detector", "1",
        curves,
    )  # fmt: skip


def _corrections(receiver: str, corrections: Columns, name: str) -> list[Panel]:
    """Each term, of the first signal of each satellite; nothing of terms that are nought."""
    satellites = np.asarray(texts(corrections, "satellite"))
    signals = np.asarray(texts(corrections, "signal"))
    times = corrections.valid_time_ns
    first = {
        satellite: of & (signals == np.unique(signals[of])[0])
        for satellite, of in _each(satellites)
    }
    panels: list[Panel] = []
    for field, title, row in _CORRECTIONS:
        unit, factor = ("km", 1e-3) if field == "satellite_clock_m" else ("m", 1.0)
        values = optional(corrections, field) * factor
        if not np.nan_to_num(values).any():
            continue
        curves = [
            thinned(broken(_of_satellite(satellite, times[of], values[of], Shape.LINE)), _BINS)
            for satellite, of in first.items()
        ]
        panels += panel(
            Section.CORRECTIONS, f"corrections/{receiver}/{field.removesuffix('_m')}",
            f"{name}{title}", unit, curves, row=f"{receiver} {row}",
        )  # fmt: skip
    return panels
