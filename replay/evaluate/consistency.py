"""Whether a filter knows how good it is: normalised errors against chi-square bounds.

NEES is e' P^-1 e of an error and its covariance; its mean over independent samples of
dimension d is chi-square distributed with n d degrees of freedom, divided by n
(Bar-Shalom, Li and Kirubarajan 2001, section 5.4.2). Errors of neighbouring rows are
not independent, so that the bounds of a mean are tighter than they ought to be: a
value outside is a hint, a value far outside is a finding. NIS is the same of an
innovation, component by component.
"""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np
from scipy import stats

from replay.evaluate.errors_enu import Errors
from replay.evaluate.geometry import Floats, symmetric
from replay.log.columns import Columns
from replay.schemas import filter_pb2

CONFIDENCE: Final = 0.95
_DIMENSION: Final = 3
_KINDS: Final = {
    value.number: value.name.removeprefix("MEASUREMENT_KIND_").lower()
    for value in filter_pb2.MeasurementKind.DESCRIPTOR.values
}
_AXES: Final = {
    value.number: value.name.removeprefix("MEASUREMENT_AXIS_").lower()
    for value in filter_pb2.MeasurementAxis.DESCRIPTOR.values
}
CAUTION_MEASUREMENT: Final = (
    "truth is itself a measurement at the times of the fixes: errors are not independent of the"
    " filter's inputs, and its own noise is in them"
)
CAUTION_CORRELATED: Final = (
    "errors of neighbouring rows are correlated: the bounds of the mean hold for independent ones"
)


class Consistency(msgspec.Struct, frozen=True, kw_only=True):
    """Normalised squares against what chi-square says of them.

    Attributes
    ----------
    dimension : int
        Degrees of freedom of one sample, which is the mean that is due.
    count : int
    mean : float
    bounds_95 : tuple of two floats
        Two-sided, of the mean of `count` independent samples.
    sample_bound_95 : float
        One-sided, of one sample.
    inside_fraction : float
        Of samples within that bound; 0.95 is due.
    rejected : int
        Samples that are not in these figures: innovations that the filter refused, or
        rows whose covariance is not positive definite.
    """

    dimension: int
    count: int
    mean: float
    bounds_95: tuple[float, float]
    sample_bound_95: float
    inside_fraction: float
    rejected: int


class Nees(msgspec.Struct, frozen=True, kw_only=True):
    """Normalised estimation errors squared, by block of states.

    Attributes
    ----------
    position, velocity, attitude : Consistency or None
        Position with its full covariance, the others with standard deviations only;
        None where truth or the solution does not have the quantity.
    truth_is_measurement : bool
        Whether truth was measured together with the fixes.
    cautions : tuple of str
        What to keep in mind.
    """

    position: Consistency | None
    velocity: Consistency | None
    attitude: Consistency | None
    truth_is_measurement: bool
    cautions: tuple[str, ...]


def consistency_of(squares: Floats, dimension: int, rejected: int = 0) -> Consistency | None:
    """Figures of normalised squares (n,); None where there is none."""
    count = len(squares)
    if count == 0:
        return None
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = stats.chi2.ppf([tail, 1.0 - tail], count * dimension) / count
    bound = float(stats.chi2.ppf(CONFIDENCE, dimension))
    return Consistency(
        dimension=dimension,
        count=count,
        mean=float(np.mean(squares)),
        bounds_95=(float(low), float(high)),
        sample_bound_95=bound,
        inside_fraction=float(np.mean(squares <= bound)),
        rejected=rejected,
    )


def covariance_squares(errors: Errors, packed: Floats) -> tuple[Floats, int]:
    """Normalised squares of errors with full covariances.

    Parameters
    ----------
    errors : Errors
        Values (m, 3).
    packed : float64 array (n, 6)
        Upper triangles, by row of the solution, in the axes and units of the errors.

    Returns
    -------
    squares : float64 array (k,)
    rejected : int
        Rows whose covariance is not positive definite.
    """
    matrices = symmetric(packed[errors.rows].astype(np.float64))
    usable = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    usable[usable] = np.linalg.eigvalsh(matrices[usable])[:, 0] > 0.0
    values = errors.values[usable]
    solved = np.linalg.solve(matrices[usable], values[:, :, None])[:, :, 0]
    return np.asarray((values * solved).sum(axis=1)), int(np.count_nonzero(~usable))


def deviation_squares(errors: Errors, deviations: Floats | None) -> tuple[Floats, int]:
    """Normalised squares of errors with standard deviations (n, 3), otherwise as above.

    None where the solution states no deviations: then there is no square and no rejection.
    """
    if deviations is None:
        return np.empty(0), 0
    sigma = deviations[errors.rows].astype(np.float64)
    usable = (np.isfinite(sigma) & (sigma > 0.0)).all(axis=1)
    ratio = errors.values[usable] / sigma[usable]
    return np.asarray((ratio * ratio).sum(axis=1)), int(np.count_nonzero(~usable))


def nees(
    solution: Columns,
    position: Errors,
    velocity: Errors,
    rotation: Errors,
    *,
    truth_is_measurement: bool,
) -> Nees:
    """NEES of the three blocks.

    Parameters
    ----------
    solution : Columns of replay.Solution
    position, velocity : Errors
        East, north, up [m], [m/s].
    rotation : Errors
        About east, north, up [rad].
    truth_is_measurement : bool
    """
    blocks = (
        covariance_squares(position, np.asarray(solution["position_covariance_enu_m2"])),
        deviation_squares(velocity, _deviations(solution, "velocity_std_enu_m_s")),
        deviation_squares(rotation, _deviations(solution, "attitude_std_rad")),
    )
    found = [consistency_of(squares, _DIMENSION, rejected) for squares, rejected in blocks]
    cautions = (CAUTION_CORRELATED, *((CAUTION_MEASUREMENT,) if truth_is_measurement else ()))
    return Nees(
        position=found[0],
        velocity=found[1],
        attitude=found[2],
        truth_is_measurement=truth_is_measurement,
        cautions=cautions,
    )


def _deviations(solution: Columns, field: str) -> Floats | None:
    if field not in solution.values:
        return None
    return solution[field].astype(np.float64)


def nis(innovations: Columns) -> dict[str, dict[str, Consistency]]:
    """NIS by kind of measurement and axis, of the innovations that were used.

    Parameters
    ----------
    innovations : Columns of replay.Innovation

    Returns
    -------
    dict of dict of Consistency
        Keys are lower-case words of the schema: "position", "east". `rejected` counts
        what the filter refused.
    """
    kinds, axes = innovations["kind"], innovations["axis"]
    normalized = innovations["normalized"].astype(np.float64)
    accepted = innovations["accepted"].astype(np.bool_)
    found: dict[str, dict[str, Consistency]] = {}
    for kind in np.unique(kinds):
        for axis in np.unique(axes[kinds == kind]):
            rows = (kinds == kind) & (axes == axis)
            used = rows & accepted & np.isfinite(normalized)
            rejected = int(np.count_nonzero(rows) - np.count_nonzero(used))
            figures = consistency_of(normalized[used] * normalized[used], 1, rejected)
            if figures is not None:
                name = _KINDS.get(int(kind), str(kind))
                found.setdefault(name, {})[_AXES.get(int(axis), str(axis))] = figures
    return found
