"""Payloads to columns, one field at a time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from replay.log import _codec_loops as loops
from replay.log import _scan
from replay.log.columns import Array, Column, Payloads, Ragged, starts
from replay.log.layout import Field, Kind, slots

_Bytes = npt.NDArray[np.uint8]
_Int64 = npt.NDArray[np.int64]


def take_column(rows: Payloads, field: Field, where: _Int64, size: _Int64, bad: _Bytes) -> Column:
    """Column of a field that :func:`replay.log._codec_loops.locate` found.

    Parameters
    ----------
    rows : Payloads
    field : Field
    where, size : int64 arrays (n,)
        The field's rows of what `locate` found.
    bad : uint8 array (n,)
        Gets why a row is not protobuf.
    """
    if field.kind is Kind.SCALAR:
        return _take_scalar(rows, field, where)
    if field.kind is Kind.VECTOR:
        return _take_vector(rows, field, where, size, bad)
    if field.kind is Kind.REPEATED:
        return _take_repeated(rows, field, where, size, bad)
    if field.kind is Kind.TEXT:
        text = np.zeros((len(where), field.dtype.itemsize), dtype=np.uint8)
        loops.take_text(rows.data, where, size, text, bad)
        short: Array = text.view(field.dtype).reshape(-1)
        return short
    lengths = np.where(where >= 0, size, 0)
    offsets = starts(lengths)
    data = np.empty(int(offsets[-1]), dtype=np.uint8)
    _scan.gather(np.maximum(where, 0), lengths, rows.data, data)
    if field.utf8:
        loops.check_utf8(data, offsets, bad)
    return Ragged(offsets, data)


def _take_scalar(rows: Payloads, field: Field, where: _Int64) -> Array:
    raw = np.zeros(len(where), dtype=np.uint64)
    if field.wire == loops.VARINT:
        loops.take_varint(rows.data, rows.offsets, rows.lengths, where, raw)
    elif field.wire == loops.FIXED64:
        loops.take_fixed64(rows.data, where, raw)
    else:
        loops.take_fixed32(rows.data, where, raw)
    column = _narrow(raw, field)
    if field.optional and column.dtype.kind == "f":
        column[where == loops.ABSENT] = np.nan
    return column


def _narrow(raw: npt.NDArray[np.uint64], field: Field) -> Array:
    """Words as they stood on the wire to the field's type, as protobuf cuts them."""
    column: Array
    if field.dtype.kind == "b":
        column = raw != 0
        return column
    if field.zigzag:
        # Of a sint32 only the low 32 bits count, before as after the zigzag.
        raw = raw if field.dtype.itemsize == 8 else raw & np.uint64(0xFFFFFFFF)
        raw = (raw >> np.uint64(1)) ^ (np.uint64(0) - (raw & np.uint64(1)))
    if field.dtype.itemsize == 4:
        return raw.astype(np.uint32).view(field.dtype)
    return raw.view(field.dtype)


def _take_vector(
    rows: Payloads, field: Field, where: _Int64, size: _Int64, bad: _Bytes
) -> npt.NDArray[np.float64]:
    width = len(field.components)
    out = np.empty((len(where), width), dtype=np.uint64)
    absent = where == loops.ABSENT
    if absent.any():
        out.view(np.float64)[absent] = np.nan if field.optional else 0.0
    tags = np.array([number << 3 | loops.FIXED64 for number in field.components], dtype=np.uint8)
    table = slots({number: k for k, number in enumerate(field.components)})
    loops.take_vector(
        rows.data, rows.offsets, rows.lengths, field.number, table, tags, where, size, out, bad
    )
    return out.view(np.float64)


def _take_repeated(
    rows: Payloads, field: Field, where: _Int64, size: _Int64, bad: _Bytes
) -> Ragged:
    counts = np.zeros(len(where), dtype=np.int64)
    arguments = (
        rows.data, rows.offsets, rows.lengths, field.number, field.wire, where, size,
    )  # fmt: skip
    empty = np.empty(0, dtype=np.uint64)
    loops.take_repeated(*arguments, counts, counts, empty, bad)
    offsets = starts(counts)
    out = np.empty(int(offsets[-1]), dtype=np.uint64)
    loops.take_repeated(*arguments, offsets[:-1], counts, out, bad)
    return Ragged(offsets, _narrow(out, field))
