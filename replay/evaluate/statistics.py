"""Figures of a series of errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import msgspec
import numpy as np

from replay.evaluate.geometry import Floats

LOCAL_AXES: Final = ("east", "north", "up")
ANGLES: Final = ("roll", "pitch", "heading")
HORIZONTAL: Final = "horizontal"
SPATIAL: Final = "3d"
_PERCENTILE: Final = 95.0


class Statistics(msgspec.Struct, frozen=True, kw_only=True):
    """Figures of one component, in its unit.

    Attributes
    ----------
    mean : float
    std : float
        About the mean, divided by the count.
    rms : float
        About nought.
    p95, max : float
        Of absolute values; the percentile is interpolated.
    """

    mean: float
    std: float
    rms: float
    p95: float
    max: float


Axes = Mapping[str, Statistics]


def statistics_of(values: Floats) -> Statistics | None:
    """Figures of a series (n,); None where it is empty."""
    if len(values) == 0:
        return None
    size = np.abs(values)
    return Statistics(
        mean=float(np.mean(values)),
        std=float(np.std(values)),
        rms=float(np.sqrt(np.mean(values * values))),
        p95=float(np.percentile(size, _PERCENTILE)),
        max=float(size.max()),
    )


def by_axis(values: Floats, names: Sequence[str]) -> dict[str, Statistics] | None:
    """Figures of each column (n, k); None where there is no row."""
    found: dict[str, Statistics] = {}
    for index, name in enumerate(names):
        figures = statistics_of(values[:, index])
        if figures is None:
            return None
        found[name] = figures
    return found


def by_local_axis(enu: Floats) -> dict[str, Statistics] | None:
    """Figures of east, north, up (n, 3) and of the horizontal and spatial lengths."""
    return by_axis(
        np.column_stack([enu, np.hypot(enu[:, 0], enu[:, 1]), np.linalg.norm(enu, axis=1)]),
        (*LOCAL_AXES, HORIZONTAL, SPATIAL),
    )
