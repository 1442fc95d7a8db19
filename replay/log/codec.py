"""Protobuf messages to columns and back, whole channels at a time.

Fields are written in the order of their numbers. A field that is not `optional`
is always written, zeros too, so that a message of fixed-width fields has one
length; proto3 allows that. Reading takes whatever protobuf allows: any order,
missing zeros, repeated numbers packed or not, unknown fields.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Final

import numpy as np
import numpy.typing as npt
from google.protobuf.descriptor import Descriptor

from replay.errors import DataError
from replay.log import _codec_loops as loops
from replay.log import schema
from replay.log.columns import Column, Columns, Payloads
from replay.log.decoding import take_column
from replay.log.encoding import FieldWriter
from replay.log.layout import Layout, layout_of

FAULTS: Final = {
    loops.TRUNCATED: "a value runs past the end of the message",
    loops.MALFORMED: "a tag is not one of protobuf",
    loops.NOT_UTF8: "a text is not UTF-8",
    loops.TOO_LONG: "a text is longer than its field allows",
}
NO_PAYLOADS: Final = Payloads(
    np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), np.empty(0, dtype=np.uint8)
)
_Bytes = npt.NDArray[np.uint8]
_Int64 = npt.NDArray[np.int64]
_Mask = npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """Columns of some payloads.

    Attributes
    ----------
    values, present : mappings of field name to column and to mask
        As in :class:`~replay.log.columns.Columns`.
    bad : uint8 array (n,)
        0, or why a row is not protobuf (a key of `FAULTS`); its values mean nothing.
    """

    values: dict[str, Column]
    present: dict[str, _Mask]
    bad: _Bytes


class Codec:
    """Columns of one message.

    Parameters
    ----------
    descriptor : Descriptor
        Of the message.

    Raises
    ------
    SchemaError
        Where the message has a field that has no column.
    """

    def __init__(self, descriptor: Descriptor) -> None:
        self.layout: Layout = layout_of(descriptor)
        self._names = {field.name for field in self.layout.fields}
        self._writers = [FieldWriter(self.message, field) for field in self.layout.fields]

    @property
    def message(self) -> str:
        """Full name of the message."""
        return self.layout.message

    def decode(self, payloads: Payloads) -> Decoded:
        """Columns of payloads; no payload raises, a broken one is marked in `bad`."""
        count = len(payloads)
        rows = checked(payloads, count)
        where = np.empty((len(self.layout.fields), count), dtype=np.int64)
        size = np.zeros_like(where)
        bad = np.zeros(count, dtype=np.uint8)
        layout = self.layout
        loops.locate(
            rows.data, rows.offsets, rows.lengths,
            layout.slot_of, layout.wire_of, layout.joins, where, size, bad,
        )  # fmt: skip
        if bad.any():
            where[:, bad != 0] = loops.ABSENT
        values: dict[str, Column] = {}
        present: dict[str, _Mask] = {}
        for slot, field in enumerate(layout.fields):
            if field.optional:
                present[field.name] = where[slot] != loops.ABSENT
            values[field.name] = take_column(rows, field, where[slot], size[slot], bad)
        return Decoded(values, present, bad)

    def encode(self, columns: Columns) -> Payloads:
        """Payloads of columns.

        Raises
        ------
        DataError
            Where a column is missing, unknown, of another shape or type than its
            field, or holds a value that the field cannot.
        """
        count = len(columns)
        unknown = columns.values.keys() - self._names
        if unknown:
            raise DataError(f"{self.message} has no field {', '.join(sorted(unknown))}")
        puts = [writer.prepare(columns) for writer in self._writers]
        lengths = np.zeros(count, dtype=np.int64)
        for put in puts:
            put.add_size(lengths)
        ends = np.cumsum(lengths)
        offsets = ends - lengths
        data = np.empty(int(ends[-1]) if count else 0, dtype=np.uint8)
        cursor = offsets.copy()
        for put in puts:
            put.run(data, cursor)
        return Payloads(offsets, lengths, data)


def checked(payloads: Payloads, count: int) -> Payloads:
    """The payloads as arrays that the compiled loops take, every row inside the data.

    Raises
    ------
    DataError
        Where a row lies outside, or there are not `count` rows.
    """
    offsets = np.ascontiguousarray(payloads.offsets, dtype=np.int64)
    lengths = np.ascontiguousarray(payloads.lengths, dtype=np.int64)
    data = np.ascontiguousarray(payloads.data, dtype=np.uint8)
    if len(offsets) != count or len(lengths) != count:
        raise DataError(f"{len(offsets)} payloads for {count} rows")
    if count and (offsets.min() < 0 or lengths.min() < 0 or (offsets + lengths).max() > len(data)):
        raise DataError("payloads lie outside their data")
    return Payloads(offsets, lengths, data)


@functools.cache
def codec_for(message: str) -> Codec:
    """Codec of a message of this project, by its full name."""
    return Codec(schema.descriptor(message))
