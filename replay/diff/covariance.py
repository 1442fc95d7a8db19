"""Two covariance matrices: is each positive definite, and how far apart are they.

The generalised eigenvalues of (P_a, P_b), the stationary values of
x' P_b x / x' P_a x, say by which factor B believes more or less than A in the
worst direction, whatever the units of the states.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Final

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]

COMPONENTS: Final = ("eigenvalue_min - 1", "eigenvalue_max - 1")
_BLOCK: Final = 2048  # rows whose full matrices are in memory at once


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """How pairs of covariances compare.

    Attributes
    ----------
    departure : float64 array (n, 2)
        Least and greatest generalised eigenvalue minus one; NaN where a matrix
        is not positive definite.
    indefinite_a, indefinite_b : int
        How many matrices are not positive definite.
    """

    departure: Float64
    indefinite_a: int
    indefinite_b: int


def dimension(entries: int) -> int | None:
    """Order of the matrix whose upper triangle has so many entries, if there is one."""
    order = (math.isqrt(8 * entries + 1) - 1) // 2
    return order if order * (order + 1) // 2 == entries else None


def full(triangle: Float64, order: int) -> Float64:
    """Symmetric matrices `(n, order, order)` from upper triangles, row by row."""
    rows, columns = np.triu_indices(order)
    matrices = np.empty((len(triangle), order, order))
    matrices[:, rows, columns] = triangle
    matrices[:, columns, rows] = triangle
    return matrices


def distance(departure: Float64) -> Float64:
    """How far eigenvalues stand from one, the same for (A, B) and (B, A)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.maximum(np.abs(departure), np.abs(1.0 / (1.0 + departure) - 1.0))


def compare(a: Float64, b: Float64) -> Spread:
    """Compare upper triangles `(n, m)` row by row.

    Rows of a width that is no triangle, or that hold a number that is not
    finite, count as indefinite.
    """
    departure = np.full((len(a), 2), np.nan)
    order = dimension(a.shape[1])
    if order is None or order == 0:
        return Spread(departure, len(a), len(b))
    bad_a = bad_b = 0
    for start in range(0, len(a), _BLOCK):
        part = slice(start, start + _BLOCK)
        left, right = full(a[part], order), full(b[part], order)
        _fill_idle_states(left, right)
        scale = np.sqrt(np.abs(np.einsum("nii->ni", left)))
        scale[~(scale > 0.0)] = 1.0
        products = scale[:, :, None] * scale[:, None, :]
        left, right = left / products, right / products
        root, definite_a = roots(left)
        _, definite_b = roots(right)
        bad_a += int(np.count_nonzero(~definite_a))
        bad_b += int(np.count_nonzero(~definite_b))
        good = definite_a & definite_b
        departure[np.flatnonzero(good) + start] = _extremes(root[good], right[good] - left[good])
    return Spread(departure, bad_a, bad_b)


def _fill_idle_states(left: Float64, right: Float64) -> None:
    """Give states that neither run estimates (all zero) a variance of one in both."""
    idle = ~(left.any(axis=2) | right.any(axis=2))
    row, state = np.nonzero(idle)
    left[row, state, state] = 1.0
    right[row, state, state] = 1.0


def roots(matrices: Float64) -> tuple[Float64, Bool]:
    """Lower Cholesky factors, and which matrices have one."""
    definite: Bool = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    factors = np.zeros_like(matrices)
    try:
        factors[definite] = np.linalg.cholesky(matrices[definite])
    except np.linalg.LinAlgError:
        # One bad matrix spoils a stacked call, so find the bad ones singly.
        for i in np.flatnonzero(definite):
            try:
                factors[i] = np.linalg.cholesky(matrices[i])
            except np.linalg.LinAlgError:
                definite[i] = False
    return factors, definite


def _extremes(root: Float64, change: Float64) -> Float64:
    """Extreme eigenvalues of L^-1 (P_b - P_a) L^-T, which are those of the pencil minus one.

    Working on the change keeps the digits that subtracting one would lose.
    """
    half = np.linalg.solve(root, change)
    whitened = np.linalg.solve(root, np.swapaxes(half, 1, 2))
    values = np.linalg.eigvalsh(0.5 * (whitened + np.swapaxes(whitened, 1, 2)))
    return np.asarray(values[:, [0, -1]])
