"""Panels of what the receivers say about themselves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from replay.evaluate.geometry import Floats, symmetric
from replay.log.columns import Columns
from replay.view.fields import doubles, texts
from replay.view.frame import geodetic
from replay.view.gather import RunData
from replay.view.labels import SIGMA, system
from replay.view.palette import TRUTH, Ink, receiver_ink, run_ink, system_ink
from replay.view.panels import Curve, Panel, Section, Shape, broken, finite_curve, panel

_OPTIONAL: Final = (
    ("satellite_count", "satellites", "Satellites used", "1", "Fixes"),
    ("differential_age_s", "differential_age", "Age of corrections", "s", "Corrections"),
    ("ambiguity_ratio", "ambiguity_ratio", "Ambiguity ratio", "1", "Corrections"),
)
_ROW: Final = "Fixes"


def gnss_panels(data: RunData) -> list[Panel]:
    """Height, standard deviations and quality of fixes; satellites and C/N0 of observations."""
    panels = panel(
        Section.GNSS, "gnss/height", "Height above the ellipsoid", "m", _heights(data), row=_ROW
    )
    panels += panel(
        Section.GNSS,
        "gnss/sigma",
        f"Fix {SIGMA}, horizontal and up",
        "m",
        _of_receivers(data, _sigma_curves),
        row=_ROW,
    )
    for field, key, title, unit, row in _OPTIONAL:
        curves = [
            Curve(receiver, receiver, *_present(fix, field), receiver_ink(index), Shape.DOTS)
            for index, (receiver, fix) in enumerate(data.fixes.items())
            if field in fix.values
        ]
        panels += panel(
            Section.GNSS, f"gnss/{key}", title, unit, map(finite_curve, curves), row=row
        )
    for index, (receiver, observations) in enumerate(data.observations.items()):
        panels += _observation_panels(receiver, observations, receiver_ink(index))
    return panels


def _present(
    columns: Columns, field: str
) -> tuple[np.ndarray[tuple[int], np.dtype[np.int64]], Floats]:
    mask = columns.is_present(field)
    return columns.valid_time_ns[mask], doubles(columns, field)[mask]


def _of_receivers(data: RunData, curves: Callable[[str, Columns, Ink], list[Curve]]) -> list[Curve]:
    return [
        finite_curve(curve)
        for index, (receiver, fix) in enumerate(data.fixes.items())
        for curve in curves(receiver, fix, receiver_ink(index))
    ]


def _sigma_curves(receiver: str, fix: Columns, ink: Ink) -> list[Curve]:
    packed = doubles(fix, "position_covariance_enu_m2")
    east, north, up = np.diagonal(symmetric(packed), axis1=1, axis2=2).T
    times = fix.valid_time_ns
    return [
        Curve(f"{receiver}/up", f"{receiver} up", times, np.sqrt(np.maximum(up, 0.0)),
              ink.faint(), Shape.DOTS),
        Curve(f"{receiver}/horizontal", f"{receiver} horizontal", times,
              np.sqrt(np.maximum(east + north, 0.0)), ink, Shape.DOTS),
    ]  # fmt: skip


def _heights(data: RunData) -> list[Curve]:
    def height(columns: Columns) -> Floats:
        return geodetic(doubles(columns, "position_ecef_m"))[:, 2]

    curves = _of_receivers(
        data,
        lambda name, fix, ink: [
            Curve(f"gnss/{name}", name, fix.valid_time_ns, height(fix), ink, Shape.DOTS)
        ],
    )
    if data.truth is not None:
        curves.append(Curve("truth", "truth", data.truth.valid_time_ns, height(data.truth), TRUTH))
    for index, run in enumerate(data.runs):
        if run.solution is not None:
            curves.append(
                Curve(f"run/{run.name}", run.name, run.solution.valid_time_ns,
                      height(run.solution), run_ink(index), outage_red=True)
            )  # fmt: skip
    return [finite_curve(curve) for curve in curves]


def _observation_panels(receiver: str, observations: Columns, ink: Ink) -> list[Panel]:
    satellites = np.asarray(texts(observations, "satellite"))
    signals = np.asarray(texts(observations, "signal"))
    times = observations.valid_time_ns
    names, number = np.unique(satellites, return_inverse=True)
    epochs = np.unique(np.column_stack([times, number.astype(np.int64)]), axis=0)[:, 0]
    at, count = np.unique(epochs, return_counts=True)
    tracked = Curve(receiver, receiver, at, count.astype(np.float64), ink)
    panels = panel(
        Section.GNSS, f"gnss/{receiver}/tracked", f"{receiver}: satellites tracked", "1",
        [tracked], row=receiver,
    )  # fmt: skip
    if "cn0_dbhz" not in observations.values:
        return panels
    strength = doubles(observations, "cn0_dbhz")
    known = observations.is_present("cn0_dbhz")
    curves: list[Curve] = []
    for name in names.tolist():
        first = np.unique(signals[satellites == name])[0]
        rows = (satellites == name) & (signals == first) & known
        line = Curve(
            f"{name}_{first}", f"{name} {first}", times[rows], strength[rows],
            system_ink(name[:1]), group=system(name[:1]),
        )  # fmt: skip
        curves.append(broken(finite_curve(line)))
    return panels + panel(
        Section.GNSS, f"gnss/{receiver}/cn0",
        f"{receiver}: C/N0, first signal of each satellite", "dB-Hz", curves, row=receiver,
    )  # fmt: skip
