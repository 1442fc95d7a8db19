"""Columns of a table to the values of a field: units, signs, constants, absence."""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np

from replay import time
from replay.configuration import UNITS
from replay.errors import ConfigurationError
from replay.importers.spec import Code, Value
from replay.importers.table import Float64, Int64, Mask, Table
from replay.schemas import gnss_pb2

_PREFIX: Final = "FIX_QUALITY_"
_ONLY_UNIT: Final = {"degC": {"degC": 1.0}}


@dataclasses.dataclass(frozen=True, slots=True)
class Picked:
    """Values of a field.

    Attributes
    ----------
    values : float64 array (n, k)
        In the field's unit, NaN where absent.
    present : bool array (n,)
    """

    values: Float64
    present: Mask

    @property
    def scalar(self) -> Float64:
        """The only column."""
        return self.values[:, 0]


def pick(table: Table, times_ns: Int64, name: str, value: Value, unit: str, width: int) -> Picked:
    """Values of one field for every row of a table.

    Parameters
    ----------
    table : Table
    times_ns : int64 array (n,), ns
    name : str
        The field, for messages.
    value : Value
    unit : str
        Of the field.
    width : int
        Numbers per row.

    Raises
    ------
    ConfigurationError
        Where the spec has too few columns or a unit of another kind.
    ForeignFileError
        Where a column is missing in the file.
    """
    items = value.columns or value.constant
    if len(items) != width or (value.columns and value.constant):
        raise ConfigurationError(
            f"{name} takes {width} columns or {width} constants, not {len(items)}",
            mend=f"write {name} = {{ columns = [...], unit = ... }}",
        )
    factor = _factor(name, value.unit, unit)
    values = np.empty((len(table), width))
    for k, column in enumerate(value.columns):
        plain = table.number(column.removeprefix("-"))
        values[:, k] = -plain * factor if column.startswith("-") else plain * factor
    for k, constant in enumerate(value.constant):
        values[:, k] = constant * factor
    present = np.asarray(np.isfinite(values).all(axis=1))
    if value.absent_when.column:
        present &= table.number(value.absent_when.column) != value.absent_when.equals
    if value.absent_before:
        present &= times_ns >= _moment(name, value.absent_before)
    values[~present] = np.nan
    return Picked(values, present)


def pick_quality(table: Table, code: Code) -> tuple[Int64, Mask]:
    """Fix quality of every row, and which rows hold a code that the spec does not name.

    Raises
    ------
    ConfigurationError
        Where a name is no quality.
    """
    if not code.column:
        number = _quality(code.constant or "UNKNOWN")
        return np.full(len(table), number, dtype=np.int64), np.zeros(len(table), dtype=np.bool_)
    codes = table.number(code.column)
    quality = np.zeros(len(table), dtype=np.int64)
    known = np.zeros(len(table), dtype=np.bool_)
    for text, name in code.map.items():
        try:
            rows = codes == float(text)
        except ValueError as error:
            raise ConfigurationError(
                f"quality code {text!r} is no number", mend='write map = { 1 = "RTK_FIXED" }'
            ) from error
        quality[rows] = _quality(name)
        known |= rows
    return quality, ~known


def _quality(name: str) -> int:
    names = {key.removeprefix(_PREFIX): number for key, number in gnss_pb2.FixQuality.items()}
    if name not in names:
        raise ConfigurationError(
            f"{name!r} is no fix quality", mend=f"known are {', '.join(names)}"
        )
    return names[name]


def _factor(name: str, written: str, unit: str) -> float:
    known = {**UNITS, **_ONLY_UNIT}[unit]
    if written not in known and not (unit == "1" and not written):
        raise ConfigurationError(
            f"{name}: unit {written!r} is none of {unit}" if written else f"{name} has no unit",
            mend=f"unit is one of {', '.join(known)}",
        )
    return known.get(written, 1.0)


def _moment(name: str, text: str) -> int:
    try:
        return time.parse_calendar(text)
    except ValueError as error:
        raise ConfigurationError(
            f"{name}: absent_before {text!r} is no date", mend="write 2025-07-08T19:34:18 GPS time"
        ) from error
