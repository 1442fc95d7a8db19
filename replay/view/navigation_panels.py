"""Panels of position, velocity and attitude: values and errors against truth."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from replay.evaluate.errors_enu import (
    Errors,
    attitude_errors,
    position_change_errors,
    position_errors,
    velocity_errors,
)
from replay.evaluate.geometry import Floats, symmetric
from replay.evaluate.status import updated
from replay.log.columns import Columns
from replay.view.fields import doubles, optional
from replay.view.gather import Run, RunData
from replay.view.labels import ATTITUDE_ANGLES, BOUNDS, LOCAL_AXES, SIGMA
from replay.view.palette import TRUTH, run_ink
from replay.view.panels import (
    Curve,
    Panel,
    Section,
    broken,
    finite_curve,
    panel,
    robust_limits,
    sigma_band,
)
from replay.view.uncertainty import attitude_angle_sigmas

Measure = Callable[[Columns, Columns], Errors]
Sigma = Callable[[Columns], Floats]


def position_sigmas(solution: Columns) -> Floats:
    """Standard deviations of position east, north, up (n, 3) [m]."""
    packed = doubles(solution, "position_covariance_enu_m2")
    variances = np.diagonal(symmetric(packed), axis1=1, axis2=2)
    return np.sqrt(np.maximum(variances, 0.0))


def _velocity_sigmas(solution: Columns) -> Floats:
    return optional(solution, "velocity_std_enu_m_s", 3)


def _attitude_sigmas_deg(solution: Columns) -> Floats:
    attitude = optional(solution, "attitude_rad", 3)
    deviations = optional(solution, "attitude_std_rad", 3)
    return np.degrees(attitude_angle_sigmas(attitude, deviations))


def _attitude_errors_deg(solution: Columns, truth: Columns) -> Errors:
    found = attitude_errors(solution, truth)
    return Errors(found.rows, found.times_ns, np.degrees(found.values))


_ERRORS: Final[tuple[tuple[Section, str, str, tuple[str, ...], Measure, Sigma], ...]] = (
    (Section.POSITION_ERROR, "position_error", "m", LOCAL_AXES, position_errors, position_sigmas),
    (
        Section.VELOCITY_ERROR,
        "velocity_error",
        "m/s",
        LOCAL_AXES,
        velocity_errors,
        _velocity_sigmas,
    ),
    (
        Section.ATTITUDE_ERROR,
        "attitude_error",
        "deg",
        ATTITUDE_ANGLES,
        _attitude_errors_deg,
        _attitude_sigmas_deg,
    ),
)


def navigation_panels(data: RunData) -> list[Panel]:
    """Errors where there is truth, else standard deviations; then velocity and attitude."""
    panels: list[Panel] = []
    if data.truth is not None:
        for section, key, unit, axes, measure, sigma in _ERRORS:
            found = [
                (i, r, measure(r.solution, data.truth), sigma(r.solution))
                for i, r in enumerate(data.runs)
                if r.solution is not None
            ]
            for axis, name in enumerate(axes):
                curves: list[Curve] = []
                for index, run, errors, sigmas in found:
                    curves += _error_curves(run, index, errors, sigmas, axis)
                title = f"{section.value} {name}, {BOUNDS}"
                limits = _error_limits(found, axis) if section is Section.POSITION_ERROR else None
                panels += panel(section, f"{key}/{name}", title, unit, curves, limits=limits)
    if not any(p.section is Section.POSITION_ERROR for p in panels):
        panels += _position_sigma_panels(data)
    return panels + _change_panels(data) + _value_panels(data)


def _change_panels(data: RunData) -> list[Panel]:
    """Errors of the change from epoch to epoch, of runs over observations."""
    if data.truth is None:
        return []
    found = [
        (index, run, position_change_errors(run.solution, data.truth, updated(run.solution)))
        for index, run in enumerate(data.runs)
        if run.solution is not None and run.geometry is not None
    ]
    panels: list[Panel] = []
    for axis, name in enumerate(LOCAL_AXES):
        curves = [
            broken(
                Curve(run.name, run.name, errors.times_ns, errors.values[:, axis], run_ink(index))
            )
            for index, run, errors in found
        ]
        panels += panel(
            Section.CHANGE_ERROR,
            f"position_change_error/{name}",
            f"{Section.CHANGE_ERROR.value} {name}",
            "m",
            curves,
            limits=robust_limits([curve.values for curve in curves]),
        )
    return panels


def _error_limits(
    found: list[tuple[int, Run, Errors, Floats]], axis: int
) -> tuple[float, float] | None:
    """Of runs over observations, whose few wild epochs in towns would hide all others."""
    if any(run.geometry is None for _, run, _, _ in found):
        return None
    series = [errors.values[:, axis] for _, _, errors, _ in found]
    bounds = [3.0 * sigmas[errors.rows, axis] for _, _, errors, sigmas in found]
    return robust_limits([*series, *bounds, *(-bound for bound in bounds)])


def _error_curves(run: Run, index: int, errors: Errors, sigmas: Floats, axis: int) -> list[Curve]:
    ink = run_ink(index)
    sigma = sigmas[errors.rows, axis]
    band = sigma_band(
        f"{run.name}/bound",
        f"{run.name} {BOUNDS}",
        errors.times_ns,
        np.zeros(len(sigma)),
        sigma,
        ink,
    )
    error = Curve(
        f"{run.name}/error",
        f"{run.name} error",
        errors.times_ns,
        errors.values[:, axis],
        ink,
        outage_red=True,
    )
    return [band, broken(error)]


def _position_sigma_panels(data: RunData) -> list[Panel]:
    panels: list[Panel] = []
    for axis, name in enumerate(LOCAL_AXES):
        curves = [
            finite_curve(
                Curve(
                    f"{run.name}/sigma",
                    f"{run.name} {SIGMA}",
                    run.solution.valid_time_ns,
                    position_sigmas(run.solution)[:, axis],
                    run_ink(index),
                    outage_red=True,
                )
            )
            for index, run in enumerate(data.runs)
            if run.solution is not None
        ]
        title = f"{Section.POSITION_SIGMA.value} {name}"
        panels += panel(Section.POSITION_SIGMA, f"position_sigma/{name}", title, "m", curves)
    return panels


def _value_panels(data: RunData) -> list[Panel]:
    panels: list[Panel] = []
    for axis, name in enumerate(LOCAL_AXES):
        curves = _value_curves(data, "velocity_enu_m_s", axis, 1.0)
        title = f"Velocity {name}"
        panels += panel(Section.VELOCITY, f"velocity/{name}", title, "m/s", curves)
    for axis, name in enumerate(ATTITUDE_ANGLES):
        curves = _value_curves(data, "attitude_rad", axis, 180.0 / np.pi)
        if name == "heading":
            curves = [_turned_at_north(curve) for curve in curves]
        title = name.capitalize()
        panels += panel(Section.ATTITUDE, f"attitude/{name}", title, "deg", curves)
    return panels


def _value_curves(data: RunData, field: str, axis: int, factor: float) -> list[Curve]:
    curves: list[Curve] = []
    if data.truth is not None and field in data.truth.values:
        known = data.truth.take(data.truth.is_present(field))
        values = doubles(known, field)[:, axis] * factor
        curves.append(Curve("truth", "truth", known.valid_time_ns, values, TRUTH))
    for index, run in enumerate(data.runs):
        if run.solution is not None:
            values = optional(run.solution, field, 3)[:, axis] * factor
            curves.append(
                Curve(
                    f"run/{run.name}", run.name, run.solution.valid_time_ns, values, run_ink(index)
                )
            )
    return [finite_curve(curve) for curve in curves]


def _turned_at_north(curve: Curve) -> Curve:
    """Heading from 0 to 360 deg, with a gap in the line where it passes north.

    The gap is a row of its own (not a number, half way in time), because a line
    that runs down the whole plot at each pass hides what is behind it.
    """
    heading = np.mod(curve.values, 360.0)
    jumps = np.flatnonzero(np.abs(np.diff(heading)) > 180.0) + 1
    middle = curve.times_ns[jumps - 1] + (curve.times_ns[jumps] - curve.times_ns[jumps - 1]) // 2
    return Curve(
        curve.key,
        curve.label,
        np.insert(curve.times_ns, jumps, middle),
        np.insert(heading, jumps, np.nan),
        curve.ink,
    )
