"""Two columns of one field, row beside row: which differ, by how much, how badly."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.channels import Difference, Tolerance
from replay.diff import covariance
from replay.diff.match import text_matrix
from replay.diff.names import component_names, is_text
from replay.log.columns import Array, Column, Ragged

Bool = npt.NDArray[np.bool_]
Float64 = npt.NDArray[np.float64]
Severity = npt.NDArray[np.uint8]

# Ordered, so that the worst field of a row is its maximum.
EQUAL: Final = 0
WITHIN: Final = 1
VALUE: Final = 2
NAN: Final = 3

_QUATERNION: Final = ("w", "x", "y", "z")


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class FieldOutcome:
    """How one field compares.

    Attributes
    ----------
    name : str
    unit : str
    tolerance : Tolerance
    components : tuple of str
        Names of the columns of `difference`.
    severity : uint8 array (n,)
        EQUAL, WITHIN, VALUE or NAN.
    difference : float64 array (n, k)
        A - B: zero where equal, NaN where one side is not a number or not there.
    differs : bool array (n, k)
        Where bits differ, so also where two zeros or two quaternions differ in sign alone.
    presence : bool array (n,)
        Rows in which one run lacks the field.
    indefinite_a, indefinite_b : int
        Of a covariance: differing rows that are not positive definite.
    """

    name: str
    unit: str
    tolerance: Tolerance
    components: tuple[str, ...]
    severity: Severity
    difference: Float64
    differs: Bool
    presence: Bool
    indefinite_a: int = 0
    indefinite_b: int = 0


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """One field of both runs, matched rows only.

    Attributes
    ----------
    a, b : column (n,)
    present_a, present_b : bool arrays (n,)
    """

    a: Column
    b: Column
    present_a: Bool
    present_b: Bool


def compare_field(
    name: str, unit: str, tolerance: Tolerance, pair: Pair, enum: Mapping[int, str] | None = None
) -> FieldOutcome:
    """Compare one field of matched rows.

    Parameters
    ----------
    name, unit : str
    tolerance : Tolerance
    pair : Pair
    enum : mapping of int to str, optional
        Given for an enumeration, the numbers of which have no distance.
    """
    both = pair.present_a & pair.present_b
    compared = (
        _compare_texts(pair, tolerance)
        if is_text(pair.a)
        else _compare_numbers(pair, tolerance, both, is_enum=enum is not None)
    )
    presence = pair.present_a != pair.present_b
    compared.severity[~both] = EQUAL
    compared.differs[~both] = False
    compared.severity[presence] = VALUE
    compared.differs[presence] = True
    compared.difference[~both] = 0.0
    compared.difference[presence] = np.nan
    return FieldOutcome(
        name,
        unit,
        tolerance,
        compared.components,
        compared.severity,
        compared.difference,
        compared.differs,
        presence,
        compared.indefinite_a,
        compared.indefinite_b,
    )


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Compared:
    """What a rule of subtraction makes of the rows, presence aside."""

    components: tuple[str, ...]
    severity: Severity
    difference: Float64
    differs: Bool
    indefinite_a: int = 0
    indefinite_b: int = 0


def _compare_numbers(pair: Pair, tolerance: Tolerance, both: Bool, *, is_enum: bool) -> _Compared:
    a, b, same_length = _matrices(pair.a, pair.b)
    differs = _bits_differ(a, b) & (both & same_length)[:, None]
    nan_one: Bool = np.asarray((np.isnan(a) ^ np.isnan(b)) & differs)
    row_differs: Bool = np.asarray(differs.any(axis=1))
    rows = np.flatnonzero(row_differs)
    components = component_names(a.shape[1])
    indefinite = (0, 0)
    rule = tolerance.difference
    if rule is Difference.ROTATION and a.shape[1] == len(_QUATERNION):
        components = ("angle", "norm")
        difference = np.zeros((len(a), 2))
        difference[rows] = _rotation(_float(a[rows]), _float(b[rows]))
    elif rule is Difference.COVARIANCE:
        components = covariance.COMPONENTS
        difference = np.zeros((len(a), 2))
        spread = covariance.compare(_float(a[rows]), _float(b[rows]))
        difference[rows] = spread.departure
        indefinite = (spread.indefinite_a, spread.indefinite_b)
    else:
        difference = _subtract(a, b, differs, rule, is_enum=is_enum)
        difference[np.isnan(a) & np.isnan(b)] = 0.0
    is_covariance = rule is Difference.COVARIANCE
    if difference.shape != differs.shape or is_covariance:
        differs = np.broadcast_to(row_differs[:, None], difference.shape).copy()
    distance = covariance.distance(difference) if is_covariance else np.abs(difference)
    severity = np.where(row_differs, WITHIN, EQUAL).astype(np.uint8)
    inside: Bool = np.asarray((distance <= tolerance.absolute).all(axis=1))
    severity[row_differs & ~inside] = VALUE
    severity[np.asarray(nan_one.any(axis=1))] = NAN
    other_length = both & ~same_length
    severity[other_length] = VALUE
    differs[other_length] = True
    difference[other_length] = np.nan
    return _Compared(components, severity, difference, differs, *indefinite)


def same_bits(pair: Pair) -> bool:
    """Whether a field is equal bit for bit in every row, the quick way out."""
    if not np.array_equal(pair.present_a, pair.present_b):
        return False
    a, b = pair.a, pair.b
    if isinstance(a, Ragged) or isinstance(b, Ragged):
        return (
            isinstance(a, Ragged)
            and isinstance(b, Ragged)
            and np.array_equal(np.diff(a.offsets), np.diff(b.offsets))
            and _flat(a).tobytes() == _flat(b).tobytes()
        )
    return a.dtype == b.dtype and a.shape == b.shape and not _bits_differ(a, b).any()


def numbers(column: Column) -> Float64:
    """Numeric column as a float64 matrix `(n, k)`; rows of other lengths end in NaN."""
    matrix, _, _ = _matrices(column, column)
    return _float(matrix)


def _float(matrix: Array) -> Float64:
    return matrix.astype(np.float64)


def _flat(column: Ragged) -> Array:
    return column.values[column.offsets[0] : column.offsets[-1]]


def _matrices(a: Column, b: Column) -> tuple[Array, Array, Bool]:
    """Both columns as matrices of one width, and which rows have one length in both."""
    if isinstance(a, Ragged) and isinstance(b, Ragged):
        lengths_a, lengths_b = np.diff(a.offsets), np.diff(b.offsets)
        width = int(max(lengths_a.max(initial=0), lengths_b.max(initial=0)))
        padded = []
        for column, lengths in ((a, lengths_a), (b, lengths_b)):
            matrix = np.full((len(column), width), np.nan)
            matrix[np.arange(width) < lengths[:, None]] = _flat(column)
            padded.append(matrix)
        return padded[0], padded[1], lengths_a == lengths_b
    flat_a, flat_b = (np.asarray(column).reshape(len(column), -1) for column in (a, b))
    if flat_a.dtype != flat_b.dtype:
        common = np.result_type(flat_a, flat_b)
        flat_a, flat_b = flat_a.astype(common), flat_b.astype(common)
    return flat_a, flat_b, np.ones(len(flat_a), dtype=np.bool_)


def _bits_differ(a: Array, b: Array) -> Bool:
    word = f"u{a.dtype.itemsize}"
    left, right = np.ascontiguousarray(a).view(word), np.ascontiguousarray(b).view(word)
    return np.asarray(left != right)


def _compare_texts(pair: Pair, tolerance: Tolerance) -> _Compared:
    """Texts are equal or not: the difference of two that are not counts as one."""
    matrix_a, lengths_a = text_matrix(pair.a)
    matrix_b, lengths_b = text_matrix(pair.b)
    width = max(matrix_a.shape[1], matrix_b.shape[1])
    matrix_a, matrix_b = (
        np.pad(m, ((0, 0), (0, width - m.shape[1]))) for m in (matrix_a, matrix_b)
    )
    differs = (lengths_a != lengths_b) | (matrix_a != matrix_b).any(axis=1)
    bad = VALUE if tolerance.absolute < 1.0 else WITHIN
    severity = np.where(differs, bad, EQUAL).astype(np.uint8)
    return _Compared(("",), severity, differs.astype(np.float64)[:, None], differs[:, None])


def _subtract(a: Array, b: Array, differs: Bool, rule: Difference, *, is_enum: bool) -> Float64:
    """Subtract B from A where bits differ; elsewhere the difference is zero."""
    difference = np.zeros(a.shape)
    left, right = a[differs], b[differs]
    if is_enum or a.dtype == np.bool_:
        difference[differs] = 1.0
        return difference
    if a.dtype.kind in "iu":
        # Unsigned integers wrap and 64-bit ones do not fit a float: subtract the lesser first.
        greater, lesser = np.maximum(left, right), np.minimum(left, right)
        magnitude = (greater - lesser).astype(np.float64)
        difference[differs] = np.where(left == greater, magnitude, -magnitude)
        return difference
    with np.errstate(invalid="ignore"):
        raw = left.astype(np.float64) - right.astype(np.float64)
        if rule is Difference.ANGLE:
            raw = np.remainder(raw + np.pi, 2.0 * np.pi) - np.pi
    difference[differs] = raw
    return difference


def _rotation(a: Float64, b: Float64) -> Float64:
    """Angle between the attitudes of two quaternions (w, x, y, z), and their norms' difference.

    The norm is compared too, because a quaternion that is not of unit length has
    an angle all the same.
    """
    scalar = np.einsum("ij,ij->i", a, b)
    vector = a[:, :1] * b[:, 1:] - b[:, :1] * a[:, 1:] - np.cross(a[:, 1:], b[:, 1:])
    angle = 2.0 * np.arctan2(np.linalg.norm(vector, axis=1), np.abs(scalar))
    norm = np.linalg.norm(a, axis=1) - np.linalg.norm(b, axis=1)
    return np.stack([angle, norm], axis=1)
