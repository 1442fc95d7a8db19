"""Panels of a network of reference stations: errors between them, corrections of a rover."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.evaluate.geometry import Floats
from replay.evaluate.network_residuals import DoubleResiduals
from replay.evaluate.signal_table import Labels, labels
from replay.log.columns import Columns
from replay.view.fields import doubles
from replay.view.gather import RunData
from replay.view.labels import SIGMA
from replay.view.palette import BOUND, Ink, run_ink
from replay.view.panels import Curve, Panel, Section, Shape, broken, finite_curve, panel

_CM: Final = 100.0
_INKS: Final = 8
_STATES: Final = (
    ("error", "Error", "error_m", "error_std_m", "cm", 1e2),
    ("rate", "Rate of the error", "error_rate_m_s", "error_rate_std_m_s", "mm/s", 1e3),
    (
        "acceleration",
        "Acceleration of the error",
        "error_acceleration_m_s2",
        "error_acceleration_std_m_s2",
        "µm/s²",
        1e6,
    ),
    ("multipath", "Multipath", "multipath_m", "multipath_std_m", "cm", 1e2),
)
Inks = Mapping[str, Ink]


def satellite_inks(satellites: Sequence[str]) -> dict[str, Ink]:
    """A colour for each satellite; after eight, paler ones."""
    names = sorted(set(satellites))
    return {
        name: run_ink(i) if i // _INKS % 2 == 0 else run_ink(i).faint()
        for i, name in enumerate(names)
    }


def satellites_of(*channels: Columns) -> list[str]:
    """Satellites that occur, ascending."""
    names = {n for columns in channels for n in np.unique(labels(columns, "satellite")).tolist()}
    return sorted(name.decode() for name in names)


def network_panels(data: RunData) -> list[Panel]:
    """Per baseline residuals against filtered errors, per rover its corrections."""
    known = [
        *data.network_errors.values(),
        *data.network_residuals.values(),
        *data.network_corrections.values(),
    ]
    inks = satellite_inks(satellites_of(*known))
    panels: list[Panel] = []
    for rover, corrections in data.network_corrections.items():
        panels += correction_panels(corrections, inks, key=f"network/{rover}", row=rover)
    names = sorted({*data.network_residuals, *data.network_errors})
    for name in names:
        panels += baseline_panels(
            name, data.network_residuals.get(name), data.network_errors.get(name), inks
        )
    return panels


def baseline_panels(
    name: str, residuals: Columns | None, errors: Columns | None, inks: Inks
) -> list[Panel]:
    """Residuals (dots) and filtered errors (lines) of all satellites, a panel per signal."""
    panels: list[Panel] = []
    for signal in _signals(residuals, errors):
        curves: list[Curve] = []
        if residuals is not None:
            curves += _curves(
                residuals, "residual_m", signal, inks, Shape.DOTS, "residual", pale=True
            )
        if errors is not None:
            curves += _curves(errors, "error_m", signal, inks, Shape.LINE, "")
        panels += panel(
            Section.NETWORK_ERRORS, f"network/{name}/{signal}",
            f"{name} {signal}: residuals (dots) and filtered errors", "cm", curves, row=name,
        )  # fmt: skip
    return panels


def correction_panels(
    corrections: Columns, inks: Inks, *, key: str, row: str, title: str = ""
) -> list[Panel]:
    """Corrections of a rover's phases, a line per satellite, a panel per signal."""
    panels: list[Panel] = []
    reference = labels(corrections, "satellite") == labels(corrections, "reference")
    rows = corrections.take(~reference)
    for signal in _signals(rows):
        curves = _curves(rows, "correction_m", signal, inks, Shape.LINE, "")
        panels += panel(
            Section.NETWORK_CORRECTIONS, f"{key}/corrections/{signal}",
            f"{title or row} {signal}: network corrections", "cm", curves, row=row,
        )  # fmt: skip
    return panels


def state_panels(
    errors: Columns, satellite: str, signal: str, ink: Ink, *, key: str
) -> list[Panel]:
    """The four states of the filter of one satellite, each beside its standard deviation."""
    chosen = _chosen(errors, satellite, signal)
    times = chosen.valid_time_ns
    panels: list[Panel] = []
    for state, title, field, deviation, unit, factor in _STATES:
        for side, name, words, shade in (
            ("value", field, title, ink),
            ("sigma", deviation, f"{title}, {SIGMA}", BOUND),
        ):
            label = "state" if side == "value" else "standard deviation"
            curve = Curve("line", label, times, doubles(chosen, name) * factor, shade)
            panels += panel(
                Section.NETWORK_ERRORS, f"{key}/{signal}/{state}/{side}",
                f"{satellite} {signal}: {words[0].lower()}{words[1:]}", unit,
                [_parted(curve, labels(chosen, "reference"))], row=f"{signal} {state}",
            )  # fmt: skip
    return panels


def impact_panels(
    residuals: Columns, errors: Columns, satellite: str, ink: Ink, *, key: str
) -> list[Panel]:
    """Residual of one satellite as found and as filtered, a panel per signal."""
    panels: list[Panel] = []
    for signal in _signals(residuals, errors):
        raw, filtered = (_chosen(c, satellite, signal) for c in (residuals, errors))
        curves = [
            finite_curve(Curve("raw", "double-difference residual", raw.valid_time_ns,
                               doubles(raw, "residual_m") * _CM, BOUND, Shape.DOTS)),
            _parted(
                Curve("filtered", "filtered error", filtered.valid_time_ns,
                      doubles(filtered, "error_m") * _CM, ink),
                labels(filtered, "reference"),
            ),
        ]  # fmt: skip
        panels += panel(
            Section.NETWORK_ERRORS, f"{key}/{signal}/both", f"{satellite} {signal}", "cm", curves,
            row=f"{satellite} {signal}",
        )  # fmt: skip
        times, at, other = np.intersect1d(
            raw.valid_time_ns, filtered.valid_time_ns, return_indices=True
        )
        rest = (doubles(raw, "residual_m")[at] - doubles(filtered, "error_m")[other]) * _CM
        panels += panel(
            Section.NETWORK_ERRORS, f"{key}/{signal}/rest",
            f"{satellite} {signal}: residual less filtered error", "cm",
            [finite_curve(Curve("rest", "residual less filtered error", times, rest, BOUND,
                                Shape.DOTS))],
            row=f"{satellite} {signal}",
        )  # fmt: skip
    return panels


def residual_panels(
    residuals: DoubleResiduals, inks: Inks, *, key: str, title: str
) -> dict[str, list[Panel]]:
    """By signal: the rover's residuals before, then after the network's corrections."""
    found: dict[str, list[Panel]] = {}
    for side, words, values in (
        ("before", "before correction", residuals.before_m),
        ("after", "after correction", residuals.after_m),
    ):
        curves: dict[str, list[Curve]] = {}
        for satellite, signal, rows in residuals.each():
            line = Curve(satellite, satellite, residuals.times_ns[rows], values[rows] * _CM,
                         inks.get(satellite, BOUND))  # fmt: skip
            curves.setdefault(signal, []).append(_parted(line, residuals.references[rows]))
        for signal, lines in curves.items():
            found.setdefault(signal, []).extend(
                panel(
                    Section.RESIDUALS,
                    f"{key}/{signal}/{side}",
                    f"{title} {signal}, {words}",
                    "cm",
                    lines,
                    row=f"{title} {signal}",
                )
            )
    return found


def shifted(item: Panel, by_ns: int) -> Panel:
    """The same panel at other times, so that drives of different days share an axis."""
    curves = tuple(
        dataclasses.replace(curve, times_ns=curve.times_ns + by_ns) for curve in item.curves
    )
    return dataclasses.replace(item, curves=curves)


def _parted(curve: Curve, references: Labels) -> Curve:
    """A line that ends where a gap or another reference satellite begins."""
    finite = np.isfinite(curve.values)
    line, names = finite_curve(curve), references[finite]
    after = np.flatnonzero(names[1:] != names[:-1]) + 1
    times = line.times_ns
    middle = times[after - 1] + (times[after] - times[after - 1]) // 2
    return broken(
        dataclasses.replace(
            line,
            times_ns=np.insert(times, after, middle),
            values=np.insert(line.values, after, np.nan),
        )
    )


def _signals(*channels: Columns | None) -> list[str]:
    names: set[bytes] = set()
    for columns in channels:
        if columns is not None and len(columns):
            names |= set(np.unique(labels(columns, "signal")).tolist())
    return sorted(name.decode() for name in names)


def _chosen(columns: Columns, satellite: str, signal: str) -> Columns:
    return columns.take(_mask(columns, satellite, signal))


def _mask(columns: Columns, satellite: str, signal: str) -> npt.NDArray[np.bool_]:
    of = labels(columns, "satellite") == satellite.encode()
    return np.asarray(of & (labels(columns, "signal") == signal.encode()))


def _curves(
    columns: Columns, field: str, signal: str, inks: Inks, shape: Shape, words: str,
    *, pale: bool = False,
) -> list[Curve]:  # fmt: skip
    values: Floats = doubles(columns, field) * _CM
    names, references = labels(columns, "satellite"), labels(columns, "reference")
    of_signal = labels(columns, "signal") == signal.encode()
    curves: list[Curve] = []
    for name in np.unique(names[of_signal]).tolist():
        rows = of_signal & (names == name)
        satellite = name.decode()
        ink = inks.get(satellite, BOUND)
        label = f"{satellite} {words}".strip()
        curve = Curve(
            label.replace(" ", "_"), label, columns.valid_time_ns[rows], values[rows],
            ink.faint() if pale else ink, shape, group="residuals" if pale else "",
        )  # fmt: skip
        line = shape is Shape.LINE
        curves.append(_parted(curve, references[rows]) if line else finite_curve(curve))
    return curves
