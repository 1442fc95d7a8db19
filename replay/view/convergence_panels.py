"""Panels of a receiver that stands still: how its errors come down."""

from __future__ import annotations

from typing import Final

import numpy as np

from replay.evaluate.convergence import LIMIT_M
from replay.evaluate.errors_enu import Errors, position_errors
from replay.evaluate.geometry import Floats
from replay.evaluate.station import still_point
from replay.evaluate.status import updated
from replay.log.columns import Columns
from replay.view.gather import RunData
from replay.view.labels import LOCAL_AXES, STATUS_INKS, status
from replay.view.palette import AXES, BOUND
from replay.view.panels import Curve, Panel, Section, Shape, broken, panel

_LEAST_M: Final = 1e-4  # errors below it are drawn on it
_NEAR: Final = 3.0  # limits of convergence that the linear axis shows


def convergence_panels(data: RunData) -> list[Panel]:
    """Errors of each run along time, linear and logarithmic; nothing where truth moves."""
    if data.truth is None or still_point(data.truth) is None:
        return []
    several = len(data.runs) > 1
    panels: list[Panel] = []
    for run in data.runs:
        if run.solution is None:
            continue
        errors = position_errors(run.solution, data.truth)
        errors = errors.take(updated(run.solution)[errors.rows])
        if len(errors):
            name = f"{run.name}: " if several else ""
            panels += _of_run(run.name, name, run.solution, errors)
    return panels


def _of_run(run: str, name: str, solution: Columns, errors: Errors) -> list[Panel]:
    times, enu = errors.times_ns, errors.values
    ends = times[[0, -1]]
    signed = [
        Curve(f"{side}_limit", f"{LIMIT_M:g} m", ends, np.full(2, value), BOUND)
        for side, value in (("upper", LIMIT_M), ("lower", -LIMIT_M))
    ]
    signed += [
        broken(Curve(axis, axis, times, enu[:, number], AXES[number]))
        for number, axis in enumerate(LOCAL_AXES)
    ]
    panels = panel(
        Section.CONVERGENCE, f"convergence/{run}/enu", f"{name}Error east, north, up", "m", signed,
        row=run, limits=(-_NEAR * LIMIT_M, _NEAR * LIMIT_M),
    )  # fmt: skip
    sizes = [Curve("limit", f"{LIMIT_M:g} m", ends, np.full(2, LIMIT_M), BOUND)]
    sizes += [
        broken(Curve(axis, axis, times, _size(enu[:, number]), AXES[number]))
        for number, axis in enumerate(LOCAL_AXES)
    ]
    panels += panel(
        Section.CONVERGENCE, f"convergence/{run}/size", f"{name}Size of the error", "m", sizes,
        row=run, logarithmic=True,
    )  # fmt: skip
    words = np.array([status(int(number)) for number in solution["status"][errors.rows]])
    length = _size(np.linalg.norm(enu, axis=1))
    by_status = [
        Curve(word.replace(" ", "_"), word, times[words == word], length[words == word],
              STATUS_INKS.get(word, BOUND), Shape.DOTS)
        for word in np.unique(words).tolist()
    ]  # fmt: skip
    return panels + panel(
        Section.CONVERGENCE, f"convergence/{run}/status", f"{name}3D error by status", "m",
        by_status, row=run, logarithmic=True,
    )  # fmt: skip


def _size(values: Floats) -> Floats:
    return np.maximum(np.abs(values), _LEAST_M)
