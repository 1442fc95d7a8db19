"""From differences row by row to the figures of one field."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt
import pymap3d

from replay.channels import Difference
from replay.diff.fields import NAN, VALUE, WITHIN, FieldOutcome
from replay.diff.join import Joined, column
from replay.diff.names import enum_names, is_text, value_text
from replay.diff.result import ComponentDiff, FieldDiff, finite
from replay.log.columns import Columns

Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

POSITION: Final = "position_ecef_m"
LOCAL_COMPONENTS: Final = ("east", "north", "up", "horizontal", "3d")
_MOST_COMPONENTS: Final = 12  # of one field, in a table for a person


def describe_field(joined: Joined, outcome: FieldOutcome) -> FieldDiff:
    """Figures of one field that differs."""
    counts = np.bincount(outcome.severity, minlength=NAN + 1)
    components = [
        _component(
            f"{outcome.name}.{name}" if name and name[0] != "[" else outcome.name + name,
            outcome.unit,
            outcome.difference[:, k],
            outcome.differs[:, k],
            joined,
            functools.partial(_shown, joined, outcome, k),
        )
        for k, name in enumerate(outcome.components)
        if outcome.differs[:, k].any()
    ]
    components.sort(key=lambda c: -np.inf if c.max is None else -c.max)
    return FieldDiff(
        field=outcome.name,
        unit=outcome.unit,
        rule=outcome.tolerance.difference.value,
        tolerance=finite(outcome.tolerance.absolute),
        compared=len(outcome.severity),
        within=int(counts[WITHIN]),
        value=int(counts[VALUE]),
        nan=int(counts[NAN]),
        presence=int(np.count_nonzero(outcome.presence)),
        components=components[:_MOST_COMPONENTS],
        omitted_components=max(0, len(components) - _MOST_COMPONENTS),
        indefinite_a=outcome.indefinite_a,
        indefinite_b=outcome.indefinite_b,
    )


def shown_value(joined: Joined, name: str, columns: Columns, row: int, part: int | None) -> str:
    """Show a field of one row to a person; `part` picks a component of a vector."""
    if not columns.is_present(name)[row]:
        return "absent"
    tolerance = joined.spec.tolerances.get(name)
    if tolerance is not None and tolerance.difference is Difference.COVARIANCE:
        return ""  # hundreds of numbers say nothing to a person
    values = column(columns, name)
    component = None if is_text(values) else part
    return value_text(values, row, component=component, enum=enum_names(joined.spec.message, name))


def _shown(joined: Joined, outcome: FieldOutcome, k: int, columns: Columns, row: int) -> str:
    return shown_value(joined, outcome.name, columns, row, component_of(joined, outcome, k))


def component_of(joined: Joined, outcome: FieldOutcome, k: int) -> int | None:
    """Which component of the field a column of the difference belongs to, if one does."""
    values = column(joined.a, outcome.name)
    width = values.shape[1] if isinstance(values, np.ndarray) and values.ndim > 1 else 0
    return k if width == len(outcome.components) else None


def _component(
    name: str,
    unit: str,
    difference: Float64,
    differs: Bool,
    joined: Joined,
    shown: Callable[[Columns, int], str] | None,
) -> ComponentDiff:
    number = np.isfinite(difference)
    values = difference[number]
    size = np.where(np.isnan(difference), -1.0, np.abs(difference))
    size[~differs] = -1.0
    number_differs = bool(size.max() >= 0.0)
    row = int(np.argmax(size if number_differs else differs))
    a, b = int(joined.matched_a[row]), int(joined.matched_b[row])
    return ComponentDiff(
        name=name,
        unit=unit,
        differing=int(np.count_nonzero(differs)),
        mean=float(np.mean(values)) if len(values) else None,
        rms=float(np.sqrt(np.mean(values * values))) if len(values) else None,
        max=finite(size[row]) if number_differs else None,
        at=joined.matched_place(row),
        a=shown(joined.a, a) if shown else "",
        b=shown(joined.b, b) if shown else "",
    )


def local_positions(joined: Joined) -> Float64 | None:
    """Subtract matched positions `(m, 3)`: metres east, north and up at A's position."""
    if POSITION not in joined.a.values or POSITION not in joined.b.values:
        return None
    a = np.asarray(joined.a[POSITION], dtype=np.float64)[joined.matched_a]
    b = np.asarray(joined.b[POSITION], dtype=np.float64)[joined.matched_b]
    latitude, longitude, _ = pymap3d.ecef2geodetic(a[:, 0], a[:, 1], a[:, 2])
    delta = a - b
    enu = pymap3d.ecef2enuv(delta[:, 0], delta[:, 1], delta[:, 2], latitude, longitude)
    return np.stack(enu, axis=1)


def describe_local(joined: Joined) -> list[ComponentDiff]:
    """Position difference as a person measures it; empty where positions are equal."""
    outcome = joined.outcomes.get(POSITION)
    if outcome is None:
        return []
    enu = local_positions(joined)
    if enu is None:
        return []
    squares = enu * enu
    horizontal = np.sqrt(squares[:, 0] + squares[:, 1])
    total = np.sqrt(squares.sum(axis=1))
    columns = np.column_stack([enu, horizontal, total])
    differs = outcome.severity > 0
    return [
        _component(name, "m", columns[:, k], differs, joined, None)
        for k, name in enumerate(LOCAL_COMPONENTS)
    ]
