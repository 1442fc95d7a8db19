"""Columns to payloads, one field at a time."""

from __future__ import annotations

import dataclasses
import functools
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.errors import DataError
from replay.log import _codec_loops as loops
from replay.log.columns import Array, Column, Columns, Ragged, starts
from replay.log.layout import Field, Kind

_NONE: Final = np.empty(0, dtype=np.uint8)
_Bytes = npt.NDArray[np.uint8]
_Int64 = npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Put:
    """A field that is ready to be written.

    Attributes
    ----------
    size : int64 array (n,) or int
        Bytes in each row that has the field.
    present : uint8 array (n,), or (0,) for all rows
        Which rows have it.
    loop : partial of a `put_*` loop
        Lacks what :meth:`run` gives it; None for a field that no row has.
    """

    size: _Int64 | int
    present: _Bytes
    loop: functools.partial[None] | None

    def add_size(self, lengths: _Int64) -> None:
        """Add the field's bytes to those of each row."""
        lengths += self.size * self.present.astype(np.int64) if len(self.present) else self.size

    def run(self, out: _Bytes, cursor: _Int64) -> None:
        """Write the field into each row at its cursor, which moves on."""
        if self.loop is not None:
            self.loop(self.present, out, cursor)


class FieldWriter:
    """Writes one field of a message.

    Parameters
    ----------
    message : str
        Full name, for errors.
    field : Field
    """

    def __init__(self, message: str, field: Field) -> None:
        self.field = field
        self.where = f"{message}.{field.name}"
        scalar = field.kind is Kind.SCALAR
        tag = _tag(field.number, field.wire if scalar else loops.DELIMITED)
        self.tag = np.frombuffer(tag, dtype=np.uint8)
        # Of a field of constant size: its bytes, and where the values go in.
        self.width = 8 if field.kind is Kind.VECTOR else field.dtype.itemsize
        template, at = tag + bytes(self.width), [len(tag)]
        if field.kind is Kind.VECTOR:
            inner = b"".join(_tag(k, loops.FIXED64) + bytes(8) for k in field.components)
            head = tag + _varint(len(inner))
            template, at = head + inner, [len(head) + 9 * k + 1 for k in range(len(inner) // 9)]
        self.template = np.frombuffer(template, dtype=np.uint8)
        self.slots = np.array(at, dtype=np.int64)

    def prepare(self, columns: Columns) -> Put:
        """Check the field's column and bring it into the shape that is written.

        Raises
        ------
        DataError
            Where the column is missing or does not fit the field.
        """
        count = len(columns)
        column = columns.values.get(self.field.name)
        mask = columns.present.get(self.field.name)
        if column is None:
            return self._nothing(count, mask)
        if len(column) != count or (mask is not None and len(mask) != count):
            raise DataError(f"a column or a mask has not {count} rows", where=self.where)
        present = _NONE
        if mask is not None and not mask.all():
            if not self.field.optional:
                what = "a field that is not optional is absent in some rows"
                raise DataError(what, where=self.where)
            present = np.ascontiguousarray(mask, dtype=np.bool_).view(np.uint8)
        if self.field.kind in (Kind.SCALAR, Kind.VECTOR):
            return self._numbers(column, present)
        if isinstance(column, Ragged):
            _check_offsets(column, self.where)
        make = _packed if self.field.kind is Kind.REPEATED else _texts
        offsets, lengths, data = make(column, self.field, self.where)
        size = np.empty(count, dtype=np.int64)
        loops.varint_sizes(lengths.view(np.uint64), size)
        size += lengths + len(self.tag)
        loop = functools.partial(loops.put_delimited, self.tag, offsets, lengths, data)
        return Put(size, present, loop)

    def _nothing(self, count: int, mask: npt.NDArray[np.bool_] | None) -> Put:
        if not self.field.optional:
            raise DataError("a field that is not optional has no column", where=self.where)
        if mask is not None and mask.any():
            raise DataError("rows are said to be present but have no column", where=self.where)
        return Put(0, np.zeros(count, dtype=np.uint8), None)

    def _numbers(self, column: Column, present: _Bytes) -> Put:
        if isinstance(column, Ragged):
            raise DataError("ragged where one value a row is due", where=self.where)
        given = _cast(np.asarray(column), self.field, self.where)
        inner = (len(self.field.components),) if self.field.kind is Kind.VECTOR else ()
        if given.shape[1:] != inner:
            due = (len(given), *inner)
            raise DataError(f"shape {given.shape} where {due} is due", where=self.where)
        if self.field.wire == loops.VARINT:
            words = _widen(given, self.field)
            sizes = np.empty(len(words), dtype=np.int64)
            loops.varint_sizes(words, sizes)
            sizes += len(self.tag)
            return Put(sizes, present, functools.partial(loops.put_varint, self.tag, words))
        body = np.ascontiguousarray(given).reshape(len(given), len(self.slots)).view(np.uint8)
        loop = functools.partial(loops.put_fixed, self.template, self.slots, self.width, body)
        return Put(len(self.template), present, loop)


def _widen(values: Array, field: Field) -> npt.NDArray[np.uint64]:
    """Numbers to the words that go onto the wire; a negative int32 takes ten bytes."""
    if field.dtype.kind in "bu":
        return values.astype(np.uint64)
    signed = values.astype(np.int64)
    if field.zigzag:
        signed = (signed << 1) ^ (signed >> 63)
    return signed.view(np.uint64)


def _cast(given: Array, field: Field, where: str) -> Array:
    if given.dtype == field.dtype:
        return given
    if field.dtype.kind == "f" and given.dtype.kind in "fiu":
        return given.astype(field.dtype)
    if given.dtype.kind in "iub" and field.dtype.kind in "iu":
        limits = np.iinfo(field.dtype.name)
        if not given.size or (int(given.min()) >= limits.min and int(given.max()) <= limits.max):
            return given.astype(field.dtype)
        raise DataError(f"a value does not fit into {field.dtype.name}", where=where)
    raise DataError(f"{given.dtype} where {field.dtype.name} is due", where=where)


def _packed(column: Column, field: Field, where: str) -> tuple[_Int64, _Int64, _Bytes]:
    if not isinstance(column, Ragged):
        if np.ndim(column) != 2:
            raise DataError("neither ragged nor a matrix", where=where)
        column = Ragged.from_matrix(np.asarray(column))
    values = np.ascontiguousarray(_cast(np.asarray(column.values), field, where))
    offsets = np.asarray(column.offsets, dtype=np.int64)
    if field.wire != loops.VARINT:
        offsets = offsets * field.dtype.itemsize
        data = values.view(np.uint8)
    else:
        words = _widen(values, field)
        sizes = np.empty(len(words), dtype=np.int64)
        loops.varint_sizes(words, sizes)
        ends = starts(sizes)
        data = np.empty(int(ends[-1]), dtype=np.uint8)
        loops.put_packed(words, data)
        offsets = ends[offsets]
    return offsets[:-1], np.diff(offsets), data


def _texts(column: Column, field: Field, where: str) -> tuple[_Int64, _Int64, _Bytes]:
    if not isinstance(column, Ragged):
        column = _ragged_text(np.asarray(column), where)
    if column.values.dtype != np.uint8:
        raise DataError(f"{column.values.dtype} where bytes are due", where=where)
    offsets = np.ascontiguousarray(column.offsets, dtype=np.int64)
    data = np.ascontiguousarray(column.values).view(np.uint8)
    if field.utf8:
        bad = np.zeros(len(column), dtype=np.uint8)
        loops.check_utf8(data, offsets, bad)
        if bad.any():
            row = int(np.argmax(bad))
            raise DataError("a text is not UTF-8", where=f"{where}, row {row}")
    lengths = np.diff(offsets)
    if field.kind is Kind.TEXT and len(lengths) and lengths.max() > field.dtype.itemsize:
        raise DataError(f"a text is longer than {field.dtype.itemsize} bytes", where=where)
    return offsets[:-1], lengths, data


def _check_offsets(column: Ragged, where: str) -> None:
    """The compiled loops trust offsets; a caller's need not be right."""
    offsets = column.offsets
    inside = offsets[0] >= 0 and offsets[-1] <= len(column.values)
    if not inside or (offsets[1:] < offsets[:-1]).any():
        raise DataError("offsets of a ragged column lie outside its values", where=where)


def _ragged_text(texts: Array, where: str) -> Ragged:
    if texts.dtype.kind == "U":
        return Ragged.from_texts([str(text) for text in texts])
    if texts.dtype.kind != "S" or texts.ndim != 1:
        raise DataError(f"{texts.dtype} where texts are due", where=where)
    width = texts.dtype.itemsize
    matrix = np.ascontiguousarray(texts).view(np.uint8).reshape(len(texts), width)
    lengths = np.char.str_len(texts.astype(np.bytes_)).astype(np.int64)
    if (lengths == width).all():
        return Ragged.from_matrix(matrix)
    kept = np.arange(width)[None, :] < lengths[:, None]
    return Ragged(starts(lengths), matrix[kept])


def _tag(number: int, kind: int) -> bytes:
    return _varint(number << 3 | kind)


def _varint(value: int) -> bytes:
    out = bytearray()
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])
