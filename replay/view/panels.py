"""A plot as data: what the recording sends to Rerun and the report draws on paper.

Both show the same panels, so a figure in one is the figure in the other.
"""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Iterable
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.evaluate.geometry import Floats
from replay.view.palette import Ink
from replay.view.thinning import line_rows

_GAP_INTERVALS: Final = 3.0
_GAP_LEAST_NS: Final = 1.5e9


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
    CHANGE_ERROR = "Position change error"
    GEOMETRY = "Satellites and geometry"
    CLOCK = "Receiver clock"
    DISPLACEMENT = "Carrier-phase displacement"
    AMBIGUITIES = "Ambiguities"
    PHASES = "Ambiguities of single phases"
    TROPOSPHERE = "Troposphere"
    IONOSPHERE = "Ionosphere"
    RECEIVER_BIASES = "Biases of the receiver"
    CONVERGENCE = "Convergence"
    RESIDUALS = "Residuals per satellite"
    SLIPS = "Cycle slips"
    CORRECTIONS = "Corrections per satellite"
    NETWORK_ERRORS = "Errors between reference stations"
    NETWORK_CORRECTIONS = "Network corrections"
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
    group : str
        Name in the legend of the page where many curves share one, as those of a system's
        satellites; empty for the label.
    """

    key: str
    label: str
    times_ns: npt.NDArray[np.int64]
    values: Floats
    ink: Ink
    shape: Shape = Shape.LINE
    outage_red: bool = False
    group: str = ""


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
    limits : (float, float) or None
        Of the y axis, where rare great values would hide the rest; None for what fits.
    logarithmic : bool
        Whether the y axis is; all values are above nought then. The recording, whose axes are
        linear, shows the logarithm to the base ten.
    """

    section: Section
    row: str
    key: str
    title: str
    unit: str
    curves: tuple[Curve, ...]
    limits: tuple[float, float] | None = None
    logarithmic: bool = False

    @property
    def heading(self) -> str:
        """Title and unit."""
        return f"{self.title} [{self.unit}]"

    @property
    def linear_heading(self) -> str:
        """Title and unit where the axis is linear."""
        return f"{self.title} [log₁₀ {self.unit}]" if self.logarithmic else self.heading

    def linear(self, values: Floats) -> Floats:
        """Values of a curve for a linear axis."""
        return np.log10(values) if self.logarithmic else values


def panel(
    section: Section,
    key: str,
    title: str,
    unit: str,
    curves: Iterable[Curve],
    *,
    row: str = "",
    limits: tuple[float, float] | None = None,
    logarithmic: bool = False,
) -> list[Panel]:
    """A list of one panel of the curves that have rows; an empty list where none has."""
    kept = tuple(curve for curve in curves if len(curve.times_ns))
    heading = row or section.value
    return [Panel(section, heading, key, title, unit, kept, limits, logarithmic)] if kept else []


def broken(curve: Curve) -> Curve:
    """The line with a row that is not a number in each gap, so that it does not run across.

    A gap is longer than three median intervals and than a second and a half.
    """
    steps = np.diff(curve.times_ns)
    if len(steps) == 0:
        return curve
    limit = max(_GAP_INTERVALS * float(np.median(steps)), _GAP_LEAST_NS)
    after = np.flatnonzero(steps > limit) + 1
    if len(after) == 0:
        return curve
    middle = curve.times_ns[after - 1] + steps[after - 1] // 2
    return dataclasses.replace(
        curve,
        times_ns=np.insert(curve.times_ns, after, middle),
        values=np.insert(curve.values, after, np.nan, axis=0),
    )


def thinned(curve: Curve, bins: int) -> Curve:
    """The line with the first, least, greatest and last row of each of so many spans."""
    rows = line_rows(curve.values, bins)
    return dataclasses.replace(curve, times_ns=curve.times_ns[rows], values=curve.values[rows])


def robust_limits(
    series: Iterable[Floats], *, share: float = 99.5, from_nought: bool = False
) -> tuple[float, float] | None:
    """Limits of a y axis that hold the given percentage of each series, and some room.

    None where there is nothing to limit: no value lies further out than the limits are apart.
    """
    known = [values[np.isfinite(values)] for values in series]
    known = [values for values in known if len(values)]
    if not known:
        return None
    low = min(float(np.percentile(values, 100.0 - share)) for values in known)
    high = max(float(np.percentile(values, share)) for values in known)
    low = 0.0 if from_nought else low
    room = 0.25 * max(high - low, 1e-9)
    least = min(float(values.min()) for values in known)
    most = max(float(values.max()) for values in known)
    if most <= high + 4.0 * room and least >= low - 4.0 * room:
        return None
    return (low if from_nought else low - room, high + room)


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
