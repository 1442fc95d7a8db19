"""Panels of solutions as Lee (2010) plots them: navigation parameters, coordinate differences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from replay.evaluate.errors_enu import Errors
from replay.evaluate.geometry import Floats
from replay.log.columns import Columns
from replay.view.fields import doubles, optional
from replay.view.frame import LocalFrame, geodetic
from replay.view.palette import Ink, run_ink
from replay.view.panels import Curve, Panel, Section, broken, finite_curve, panel

_AXES: Final = (("north", 1, 0), ("east", 0, 1), ("height", 2, 2))
_CM: Final = 100.0


def navigation_parameter_panels(solution: Columns, *, key: str) -> list[Panel]:
    """Position from the first row, velocity and attitude of a solution, three beside each other."""
    ecef = doubles(solution, "position_ecef_m")
    place = LocalFrame.at(ecef[np.isfinite(ecef).all(axis=1)][0]).enu(ecef)
    place[:, 2] = geodetic(ecef)[:, 2]  # not the plane's, from which the Earth falls away
    velocity = optional(solution, "velocity_enu_m_s", 3)
    attitude = np.degrees(optional(solution, "attitude_rad", 3))
    panels: list[Panel] = []
    for group, section, names, values, unit, scale in (
        ("position", Section.GNSS, ("North", "East", "Up"), place[:, [1, 0, 2]], "km", 1e-3),
        ("velocity", Section.VELOCITY, ("North", "East", "Up"), velocity[:, [1, 0, 2]], "m/s", 1.0),
        ("attitude", Section.ATTITUDE, ("Heading", "Pitch", "Roll"), attitude[:, [2, 1, 0]],
         "deg", 1.0),
    ):  # fmt: skip
        for axis, name in enumerate(names):
            metres = group == "position" and name == "Up"
            factor, unit_of = (1.0, "m") if metres else (scale, unit)
            title = f"{name} from the start" if group == "position" else name
            title = "Height above the ellipsoid" if metres else title
            if group == "velocity":
                title = f"Velocity {name.lower()}"
            series = values[:, axis] * factor
            if name == "Heading":
                series = _unjumped(series)
            curve = Curve("line", "estimate", solution.valid_time_ns, series, run_ink(0))
            panels += panel(
                section, f"{key}/{group}/{name.lower()}", title, unit_of,
                [broken(finite_curve(curve))], row=group,
            )  # fmt: skip
    return panels


def _unjumped(angle_deg: Floats) -> Floats:
    """Between 0 and 360 degrees, a row that is not a number's neighbour of each jump left out."""
    turned = np.mod(angle_deg, 360.0)
    jumps = np.flatnonzero(np.abs(np.diff(turned)) > 180.0)
    turned[jumps] = np.nan
    return np.asarray(turned)


def difference_panels(errors: Mapping[str, Errors], *, key: str, title: str) -> list[Panel]:
    """Differences north, east and height [cm], a panel per mode beside each other.

    Parameters
    ----------
    errors : mapping of mode to Errors
        East, north, up [m].
    """
    panels: list[Panel] = []
    for mode, found in errors.items():
        curves = [
            broken(Curve(name, name, found.times_ns, found.values[:, column] * _CM, _ink(shade)))
            for name, column, shade in _AXES
        ]
        panels += panel(
            Section.POSITION_ERROR, f"{key}/{mode}", f"{title}, {mode}", "cm", curves, row=title
        )
    return panels


def _ink(number: int) -> Ink:
    return run_ink((2, 0, 1)[number])
