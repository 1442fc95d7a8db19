"""Columns of a channel in the one type that the views compute with."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from replay.log.columns import Columns, Ragged


def doubles(columns: Columns, field: str) -> npt.NDArray[np.float64]:
    """A numeric field as float64, (n,) or (n, k)."""
    return columns[field].astype(np.float64)


def optional(columns: Columns, field: str, width: int = 0) -> npt.NDArray[np.float64]:
    """An optional numeric field as float64, (n,) or (n, width); NaN where it is absent."""
    if field not in columns.values:
        return np.full((len(columns), width) if width else len(columns), np.nan)
    values = doubles(columns, field)
    values[~columns.is_present(field)] = np.nan
    return values


def integers(columns: Columns, field: str) -> npt.NDArray[np.int64]:
    """A field of numbers or enumerations as int64 (n,)."""
    return columns[field].astype(np.int64)


def texts(columns: Columns, field: str) -> list[str]:
    """A field of strings, however the reader keeps them."""
    column = columns.values[field]
    if isinstance(column, Ragged):
        return column.texts()
    return [value.decode("utf-8") for value in column.astype(np.bytes_).tolist()]
