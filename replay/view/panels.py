"""A plot as data: what the recording sends to Rerun and the report draws on paper.

Both show the same panels, so a figure in one is the figure in the other.
"""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from replay.evaluate.geometry import Floats
from replay.view.palette import Ink


class Shape(enum.Enum):
    """How a curve is drawn."""

    LINE = "line"
    BAND = "band"  # values (n, 2): lower and upper bound
    DOTS = "dots"
    CROSSES = "crosses"


class Section(enum.Enum):
    """What a panel is about; the value is its heading."""

    POSITION_ERROR = "Position error"
    POSITION_SIGMA = "Position standard deviation"
    VELOCITY_ERROR = "Velocity error"
    ATTITUDE_ERROR = "Attitude error"
    VELOCITY = "Velocity"
    ATTITUDE = "Attitude"
    GYRO_BIAS = "Gyro bias"
    ACCEL_BIAS = "Accelerometer bias"
    GYRO_SCALE = "Gyro scale factor"
    ACCEL_SCALE = "Accel. scale factor"
    MOUNTING = "Mounting angle"
    NON_SLIP = "Non-slip point"
    SQUAT = "Squat"
    INNOVATIONS = "Innovations"
    NIS = "Normalised innovation squared"
    GNSS = "GNSS"
    IMU = "Inertial samples"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One series.

    Attributes
    ----------
    key : str
        Path of its entity below the panel's, "run/error".
    label : str
        Its name in a legend.
    times_ns : int64 array (n,), GPS ns
    values : array (n,), or (n, 2) for a band
        In the unit of the panel.
    ink : Ink
    shape : Shape
    outage_red : bool
        Whether the recording draws its rows in outages again in red.
    """

    key: str
    label: str
    times_ns: npt.NDArray[np.int64]
    values: Floats
    ink: Ink
    shape: Shape = Shape.LINE
    outage_red: bool = False


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One plot.

    Attributes
    ----------
    section : Section
    row : str
        Panels of one row stand beside each other; the row's heading.
    key : str
        Path of its entity, "position_error/east".
    title : str
        What it shows, without the unit.
    unit : str
    curves : tuple of Curve
        From back to front; none is empty.
    """

    section: Section
    row: str
    key: str
    title: str
    unit: str
    curves: tuple[Curve, ...]

    @property
    def heading(self) -> str:
        """Title and unit."""
        return f"{self.title} [{self.unit}]"


def panel(
    section: Section, key: str, title: str, unit: str, curves: Iterable[Curve], *, row: str = ""
) -> list[Panel]:
    """A list of one panel of the curves that have rows; an empty list where none has."""
    kept = tuple(curve for curve in curves if len(curve.times_ns))
    return [Panel(section, row or section.value, key, title, unit, kept)] if kept else []


def finite_curve(curve: Curve) -> Curve:
    """The curve without rows that are not a number (an absent value is no point)."""
    columns = tuple(range(1, curve.values.ndim))
    keep = np.asarray(np.isfinite(curve.values).all(axis=columns))
    if keep.all():
        return curve
    return dataclasses.replace(curve, times_ns=curve.times_ns[keep], values=curve.values[keep])


def sigma_band(
    key: str, label: str, times_ns: npt.NDArray[np.int64], centre: Floats, sigma: Floats, ink: Ink
) -> Curve:
    """Band of three standard deviations to each side of a centre."""
    values = np.column_stack([centre - 3.0 * sigma, centre + 3.0 * sigma])
    return finite_curve(Curve(key, label, times_ns, values, ink.faint(), Shape.BAND))
