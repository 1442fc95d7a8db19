"""What the columns of a protobuf message are: one :class:`Field` per field, in order of number."""

from __future__ import annotations

import dataclasses
import enum
from typing import Final

import numpy as np
import numpy.typing as npt
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.descriptor_pb2 import DescriptorProto

from replay.errors import SchemaError
from replay.log import _codec_loops as wire

# Texts of this project that have one length in every row and become numpy `S` columns.
FIXED_TEXTS: Final = {"satellite": 3, "signal": 2}
_OWN_PACKAGE = "replay."

_D = FieldDescriptor
_SCALARS: Final[dict[int, tuple[str, int]]] = {
    _D.TYPE_DOUBLE: ("<f8", wire.FIXED64),
    _D.TYPE_FLOAT: ("<f4", wire.FIXED32),
    _D.TYPE_FIXED64: ("<u8", wire.FIXED64),
    _D.TYPE_SFIXED64: ("<i8", wire.FIXED64),
    _D.TYPE_FIXED32: ("<u4", wire.FIXED32),
    _D.TYPE_SFIXED32: ("<i4", wire.FIXED32),
    _D.TYPE_INT64: ("<i8", wire.VARINT),
    _D.TYPE_UINT64: ("<u8", wire.VARINT),
    _D.TYPE_INT32: ("<i4", wire.VARINT),
    _D.TYPE_UINT32: ("<u4", wire.VARINT),
    _D.TYPE_SINT64: ("<i8", wire.VARINT),
    _D.TYPE_SINT32: ("<i4", wire.VARINT),
    _D.TYPE_ENUM: ("<i4", wire.VARINT),
    _D.TYPE_BOOL: ("?", wire.VARINT),
}


class Kind(enum.Enum):
    """How a field becomes a column."""

    SCALAR = "scalar"  # array (n,)
    VECTOR = "vector"  # nested message of doubles: float64 array (n, k)
    TEXT = "text"  # array (n,) of dtype S2 or S3
    BYTES = "bytes"  # Ragged of uint8
    REPEATED = "repeated"  # Ragged of numbers


@dataclasses.dataclass(frozen=True, slots=True)
class Field:
    """One field of a message.

    Attributes
    ----------
    name : str
        Name of the column.
    number : int
        Field number.
    kind : Kind
        How it becomes a column.
    dtype : numpy dtype
        Of the column, or of the values of a ragged one.
    wire : int
        Wire type of a value; of one element, where the field is repeated.
    optional : bool
        Whether a row may lack it: then the column has a mask.
    zigzag : bool
        Whether varints are zigzag-coded.
    utf8 : bool
        Whether the bytes are text.
    components : tuple of int
        Field numbers of a vector's doubles, in column order.
    """

    name: str
    number: int
    kind: Kind
    dtype: np.dtype[np.generic]
    wire: int
    optional: bool
    zigzag: bool = False
    utf8: bool = False
    components: tuple[int, ...] = ()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """All fields of a message, and the tables that the compiled loops read.

    Attributes
    ----------
    message : str
        Full name.
    fields : tuple of Field
        In order of field number.
    slot_of, wire_of, joins : int64 arrays
        As :func:`replay.log._codec_loops.locate` takes them.
    """

    message: str
    fields: tuple[Field, ...]
    slot_of: npt.NDArray[np.int64]
    wire_of: npt.NDArray[np.int64]
    joins: npt.NDArray[np.int64]


def layout_of(descriptor: Descriptor) -> Layout:
    """Columns of a message.

    Raises
    ------
    SchemaError
        Where a field's shape has no column: a map, a repeated text or message, or a
        nested message that holds anything but doubles.
    """
    proto = DescriptorProto()
    descriptor.CopyToProto(proto)
    # The synthetic oneof of a proto3 `optional` shows only in the proto. A nested message
    # always has presence on the wire; here it counts as optional only where it says so.
    declared = {field.name: field.proto3_optional for field in proto.field}
    fields = tuple(
        _field(descriptor, field, declared[field.name])
        for field in sorted(descriptor.fields, key=lambda field: field.number)
    )
    return Layout(
        descriptor.full_name,
        fields,
        slots({field.number: slot for slot, field in enumerate(fields)}),
        np.array([_outer_wire(field) for field in fields], dtype=np.int64),
        np.array([_joins(field) for field in fields], dtype=np.int64),
    )


def slots(slot_of: dict[int, int]) -> npt.NDArray[np.int64]:
    """Table from field number to slot, -1 where there is none.

    Numbers stay below 4096: :func:`layout_of` refuses others.
    """
    table = np.full(max(slot_of, default=0) + 1, -1, dtype=np.int64)
    for number, slot in slot_of.items():
        table[number] = slot
    return table


def _outer_wire(field: Field) -> int:
    return field.wire if field.kind is Kind.SCALAR else wire.DELIMITED


def _joins(field: Field) -> int:
    if field.kind is Kind.REPEATED:
        return field.wire
    return wire.DELIMITED if field.kind is Kind.VECTOR else -1


def _field(message: Descriptor, field: FieldDescriptor, proto3_optional: bool) -> Field:
    where = f"{message.full_name}.{field.name}"
    if field.number >= 4096:
        raise SchemaError(f"field number {field.number} is too large for columns", where=where)
    nested = field.type in (_D.TYPE_MESSAGE, _D.TYPE_GROUP)
    optional = proto3_optional or (field.has_presence and not nested)
    if field.containing_oneof is not None:
        optional = True
    common = (field.name, field.number)
    if field.is_repeated:
        if field.type not in _SCALARS:
            raise SchemaError("repeated texts and messages have no column", where=where)
        code, wire_type = _SCALARS[field.type]
        return Field(*common, Kind.REPEATED, np.dtype(code), wire_type, False, _is_zigzag(field))
    if field.type in _SCALARS:
        code, wire_type = _SCALARS[field.type]
        return Field(*common, Kind.SCALAR, np.dtype(code), wire_type, optional, _is_zigzag(field))
    if nested:
        numbers = _components(field, where)
        double = np.dtype("<f8")
        return Field(*common, Kind.VECTOR, double, wire.DELIMITED, optional, components=numbers)
    utf8 = field.type == _D.TYPE_STRING
    width = FIXED_TEXTS.get(field.name, 0) if message.full_name.startswith(_OWN_PACKAGE) else 0
    if utf8 and width:
        return Field(*common, Kind.TEXT, np.dtype(f"S{width}"), wire.DELIMITED, optional, utf8=True)
    return Field(*common, Kind.BYTES, np.dtype("u1"), wire.DELIMITED, optional, utf8=utf8)


def _is_zigzag(field: FieldDescriptor) -> bool:
    return field.type in (_D.TYPE_SINT32, _D.TYPE_SINT64)


def _components(field: FieldDescriptor, where: str) -> tuple[int, ...]:
    inner = field.message_type
    if inner is None:
        raise SchemaError("a nested message has no description", where=where)
    ordered = sorted(inner.fields, key=lambda component: component.number)
    doubles = all(
        component.type == _D.TYPE_DOUBLE
        and not component.is_repeated
        and not component.has_presence
        and component.number < 16
        for component in ordered
    )
    if field.type == _D.TYPE_GROUP or not ordered or not doubles:
        raise SchemaError(f"nested {inner.full_name} is not all doubles", where=where)
    return tuple(component.number for component in ordered)
