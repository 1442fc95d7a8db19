"""Least and greatest inertial sample of every second, gathered as samples stream by."""

from __future__ import annotations

import numpy as np

from replay.evaluate.geometry import Floats
from replay.log.columns import Columns
from replay.time import NS_PER_S
from replay.view.fields import doubles
from replay.view.palette import AXES
from replay.view.panels import Curve, Panel, Section, Shape
from replay.view.sink import Times

_FIELDS = (
    ("angular_rate_body_rad_s", "Angular rate", "deg/s", np.degrees(1.0)),
    ("specific_force_body_m_s2", "Specific force", "m/s²", 1.0),
)
_AXES = ("x forward", "y right", "z down")


class ImuEnvelope:
    """Takes batches of inertial samples and gives panels of their envelopes."""

    def __init__(self) -> None:
        self._seconds: list[Times] = []
        self._low: list[Floats] = []
        self._high: list[Floats] = []

    def __call__(self, samples: Columns) -> None:
        """Take a batch; a second may go on in the next."""
        values = np.column_stack([doubles(samples, f) * k for f, _, _, k in _FIELDS])
        seconds, low, high = _extremes(samples.valid_time_ns // NS_PER_S, values, values)
        self._seconds.append(seconds)
        self._low.append(low)
        self._high.append(high)

    def panels(self) -> list[Panel]:
        """A panel per sensor axis; none where there were no samples."""
        if not self._seconds:
            return []
        seconds, low, high = _extremes(
            np.concatenate(self._seconds), np.concatenate(self._low), np.concatenate(self._high)
        )
        times = seconds * NS_PER_S + NS_PER_S // 2
        panels = []
        for index in range(low.shape[1]):
            _, name, unit, _ = _FIELDS[index // 3]
            axis = _AXES[index % 3]
            band = np.column_stack([low[:, index], high[:, index]])
            curve = Curve(
                "envelope",
                "least to greatest of each second",
                times,
                band,
                AXES[index % 3],
                Shape.BAND,
            )
            panels.append(
                Panel(Section.IMU, name, f"imu/{index}", f"{name} {axis}", unit, (curve,))
            )
        return panels


def _extremes(seconds: Times, low: Floats, high: Floats) -> tuple[Times, Floats, Floats]:
    order = np.argsort(seconds, kind="stable")
    bins, starts = np.unique(seconds[order], return_index=True)
    return (
        bins,
        np.minimum.reduceat(low[order], starts, axis=0),
        np.maximum.reduceat(high[order], starts, axis=0),
    )
