"""Words for what the arrays hold: enumerations, components, units, keys, values."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from google.protobuf import descriptor, descriptor_pool

# Importing the modules is what puts the messages into the default pool.
from replay.log.columns import Column, Columns, Ragged
from replay.schemas import (  # noqa: F401
    filter_pb2,
    gnss_pb2,
    imu_pb2,
    replay_pb2,
    solution_pb2,
)
from replay.schemas.catalog import FIELD_NOTES

# The three shapes of geometry.proto are told apart by their width.
_COMPONENTS: Final[Mapping[int, tuple[str, ...]]] = {
    1: ("",),
    3: ("x", "y", "z"),
    4: ("w", "x", "y", "z"),
    6: ("xx", "xy", "xz", "yy", "yz", "zz"),
}
_LONGEST_TEXT: Final = 60


def component_names(width: int) -> tuple[str, ...]:
    """Names of the components of a vector field; a scalar's only one is nameless."""
    return _COMPONENTS.get(width) or tuple(f"[{i}]" for i in range(width))


@functools.cache
def enum_names(message: str, field: str) -> Mapping[int, str] | None:
    """Value to short name of an enumeration field, or None for any other field."""
    try:
        found = descriptor_pool.Default().FindMessageTypeByName(message)
    except KeyError:
        return None
    entry: descriptor.FieldDescriptor | None = found.fields_by_name.get(field)
    if entry is None or entry.enum_type is None:
        return None
    snake = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", entry.enum_type.name).upper() + "_"
    return {v.number: v.name.removeprefix(snake) for v in entry.enum_type.values}


def unit(message: str, field: str) -> str:
    """Look up the unit of a numeric field in its .proto file; empty where the field is unknown."""
    note = FIELD_NOTES.get(f"{message}.{field}", "")
    return note.partition(";")[0].strip()


def is_text(column: Column) -> bool:
    """Whether a column holds strings or bytes."""
    if isinstance(column, Ragged):
        return column.values.dtype == np.uint8
    return column.dtype.kind == "S"


def _bytes_text(raw: bytes) -> str:
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        text = raw.hex()
    return text if len(text) <= _LONGEST_TEXT else f"{text[:_LONGEST_TEXT]}… ({len(raw)} bytes)"


def value_text(
    column: Column, row: int, *, component: int | None = None, enum: Mapping[int, str] | None = None
) -> str:
    """One value for a person, with every digit that tells it from its neighbour."""
    if isinstance(column, Ragged):
        values = column.row(row)
        if is_text(column):
            return _bytes_text(values.tobytes())
    else:
        if is_text(column):
            return _bytes_text(bytes(column[row]))
        values = np.atleast_1d(column[row])
    if component is not None:
        values = values[component : component + 1]
    texts = [str(v.item()) for v in values[:6]]
    if enum is not None:
        texts = [enum.get(int(v), str(v)) for v in values]
    if len(values) > len(texts):
        texts.append(f"… ({len(values)} values)")
    return texts[0] if len(texts) == 1 else f"({', '.join(texts)})"


def key_text(message: str, keys: Sequence[str], columns: Columns, row: int) -> dict[str, str]:
    """Key fields of one row, by name."""
    return {
        key: value_text(columns.values[key], row, enum=enum_names(message, key)) for key in keys
    }
