"""Panels of how many satellites stood where, and of the clock that they steer."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from replay.evaluate.geometry import Floats
from replay.evaluate.satellites import ALL, SYSTEMS, dilution, satellite_counts
from replay.log.columns import Columns
from replay.view.fields import doubles, integers, optional, texts
from replay.view.gather import Run, RunData
from replay.view.labels import SYSTEMS as SYSTEM_NAMES
from replay.view.labels import system
from replay.view.palette import ALL_SYSTEMS, BOUND, Ink, run_ink, system_ink
from replay.view.panels import (
    Curve,
    Panel,
    Section,
    Shape,
    broken,
    finite_curve,
    panel,
    robust_limits,
)

_LETTERS: Final = dict(zip(SYSTEMS, "GRECJ", strict=True))
_DOPS: Final = ("gdop", "pdop", "hdop", "vdop")
_MS_PER_M: Final = 1e3 / 299_792_458.0
_SAME_M_S: Final = 1e-3
_MOST_DOP: Final = 20.0  # of an axis: a worse geometry is of no use


def geometry_panels(data: RunData) -> list[Panel]:
    """Satellites used, dilution of precision, receiver clock, displacements."""
    panels: list[Panel] = []
    several = sum(run.geometry is not None or run.clocks is not None for run in data.runs) > 1
    for run in data.runs:
        name = f"{run.name}: " if several else ""
        if run.geometry is not None:
            panels += _geometry(run, run.geometry, name)
        if run.clocks is not None:
            panels += _clocks(run, run.clocks, name)
    for index, (receiver, displacements) in enumerate(data.displacements.items()):
        name = f"{receiver}: " if len(data.displacements) > 1 else ""
        panels += _displacements(receiver, displacements, name, run_ink(index))
    return panels


def _geometry(run: Run, geometry: Columns, name: str) -> list[Panel]:
    times = geometry.valid_time_ns
    counts = satellite_counts(geometry)
    several = len(counts) > 2  # one system and the sum, which are the same
    curves = [
        broken(Curve(key, _name(key), times, counts[key], _ink(key)))
        for key in counts
        if several or key == ALL
    ]
    panels = panel(
        Section.GEOMETRY, f"geometry/{run.name}/satellites", f"{name}Satellites used", "1",
        curves, row=f"{run.name} satellites",
    )  # fmt: skip
    pdops = {ALL: dilution(geometry, "pdop")}
    pdops |= {key: dilution(geometry, f"{key}_pdop") for key in counts if key != ALL}
    lines = [
        broken(finite_curve(Curve(key, _name(key), times, values, _ink(key))))
        for key, values in pdops.items()
        if several or key == ALL
    ]
    panels += panel(
        Section.GEOMETRY, f"geometry/{run.name}/pdop", f"{name}PDOP", "1", lines,
        row=f"{run.name} pdop", limits=dop_limits([line.values for line in lines]),
    )  # fmt: skip
    return panels + _dops(run, geometry, name)


def _dops(run: Run, geometry: Columns, name: str) -> list[Panel]:
    inks = (BOUND, ALL_SYSTEMS, run_ink(4), run_ink(2))
    lines = [
        broken(
            finite_curve(
                Curve(key, key.upper(), geometry.valid_time_ns, dilution(geometry, key), ink)
            )
        )
        for key, ink in zip(_DOPS, inks, strict=True)
    ]
    return panel(
        Section.GEOMETRY, f"geometry/{run.name}/dop", f"{name}Dilution of precision", "1", lines,
        row=f"{run.name} dop", limits=dop_limits([line.values for line in lines]),
    )  # fmt: skip


def dop_limits(series: list[Floats]) -> tuple[float, float] | None:
    """Axis from nought, cut where the geometry is hopeless."""
    found = robust_limits(series, from_nought=True)
    most = max((float(np.nanmax(v)) for v in series if np.isfinite(v).any()), default=0.0)
    high = min(_MOST_DOP, found[1] if found is not None else 1.15 * most)
    return (0.0, high) if high > 0.0 else None


def _name(key: str) -> str:
    return "all" if key == ALL else SYSTEM_NAMES[_LETTERS[key]]


def _ink(key: str) -> Ink:
    return ALL_SYSTEMS if key == ALL else system_ink(_LETTERS[key])


def _clocks(run: Run, clocks: Columns, name: str) -> list[Panel]:
    """The first system's clock as it stands, the others against it: they lie close together."""
    letters = np.asarray(texts(clocks, "system"))
    kinds = sorted(set(letters.tolist()), key=lambda k: ("GECRJ".find(k) % 9, k))
    offset, drift = doubles(clocks, "offset_m"), optional(clocks, "drift_m_s")
    first = letters == kinds[0]
    base_times, base = clocks.valid_time_ns[first], offset[first]
    own = Curve("offset", system(kinds[0]), base_times, base * _MS_PER_M, system_ink(kinds[0]))
    row = f"{run.name} clock"
    panels = panel(
        Section.CLOCK, f"clock/{run.name}/offset", f"{name}Offset from {system(kinds[0])} time",
        "ms", [broken(finite_curve(own))], row=row,
    )  # fmt: skip
    between: list[Curve] = []
    for kind in kinds[1:]:
        of = letters == kind
        shared, at, reference = np.intersect1d(
            clocks.valid_time_ns[of], base_times, return_indices=True
        )
        values = offset[of][at] - base[reference]
        line = Curve(kind, system(kind), shared, values, system_ink(kind))
        between.append(broken(finite_curve(line)))
    panels += panel(
        Section.CLOCK, f"clock/{run.name}/between", f"{name}Others less {system(kinds[0])}", "m",
        between, row=row, limits=robust_limits([curve.values for curve in between]),
    )  # fmt: skip
    drifts = [
        broken(
            finite_curve(
                Curve(
                    kind,
                    system(kind),
                    clocks.valid_time_ns[letters == kind],
                    drift[letters == kind],
                    system_ink(kind),
                )
            )
        )
        for kind in _distinct(kinds, letters, drift)
    ]
    return panels + panel(
        Section.CLOCK, f"clock/{run.name}/drift", f"{name}Drift", "m/s", drifts, row=row,
        limits=robust_limits([curve.values for curve in drifts]),
    )  # fmt: skip


def _distinct(kinds: list[str], letters: npt.NDArray[np.str_], drift: Floats) -> list[str]:
    """The first system alone where all tell the same drift, which is the oscillator's."""
    first = drift[letters == kinds[0]]
    for kind in kinds[1:]:
        other = drift[letters == kind]
        if len(other) != len(first) or np.nanmax(np.abs(other - first), initial=0.0) > _SAME_M_S:
            return kinds
    return kinds[:1]


def _displacements(receiver: str, rows: Columns, name: str, ink: Ink) -> list[Panel]:
    times = rows.valid_time_ns
    length = np.linalg.norm(doubles(rows, "displacement_ecef_m"), axis=1)
    weight = doubles(rows, "unit_weight_std")
    count = integers(rows, "satellite_count").astype(np.float64)
    panels: list[Panel] = []
    for key, title, unit, values, shape in (
        ("length", "Length of displacement", "m", length, Shape.LINE),
        ("unit_weight", "Posterior standard deviation of unit weight", "1", weight, Shape.DOTS),
        ("satellites", "Satellites of the displacement", "1", count, Shape.LINE),
    ):
        curve = finite_curve(Curve(receiver, receiver, times, values, ink, shape))
        panels += panel(
            Section.DISPLACEMENT, f"displacement/{receiver}/{key}", f"{name}{title}", unit,
            [broken(curve) if shape is Shape.LINE else curve], row=receiver,
            limits=robust_limits([values], from_nought=True) if key != "satellites" else None,
        )  # fmt: skip
    return panels
