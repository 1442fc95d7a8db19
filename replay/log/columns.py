"""Rows of one channel as columns: what every reader hands out and every writer takes.

A scalar field is an array `(n,)`; a nested message that holds nothing but
doubles (Vector3, Quaternion, SymmetricMatrix3) is a float64 array `(n, k)`; a
`repeated` numeric field, a string and bytes are :class:`Ragged`, but a string
that every row holds in the same short length may also be given as a numpy
`S` array. Absent floating-point values are NaN in the arrays; `present` tells
absent from a NaN that was recorded.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.generic]
Int64 = npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Ragged:
    """Rows of different lengths, end to end.

    Attributes
    ----------
    offsets : int64 array (n + 1,)
        Row `i` is `values[offsets[i]:offsets[i + 1]]`.
    values : array (m,)
        `uint8` for strings and bytes.
    """

    offsets: Int64
    values: Array

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def row(self, index: int) -> Array:
        """Values of one row."""
        return self.values[self.offsets[index] : self.offsets[index + 1]]

    def texts(self) -> list[str]:
        """Rows of bytes as UTF-8 strings."""
        return [self.row(i).tobytes().decode("utf-8") for i in range(len(self))]

    def blobs(self) -> list[bytes]:
        """Rows of bytes."""
        return [self.row(i).tobytes() for i in range(len(self))]

    def take(self, index: npt.ArrayLike) -> Ragged:
        """Rows of the given numbers, in the given order."""
        rows = np.asarray(index, dtype=np.int64)
        lengths = (self.offsets[1:] - self.offsets[:-1])[rows]
        offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
        source = np.repeat(self.offsets[:-1][rows] - offsets[:-1], lengths)
        return Ragged(offsets, self.values[source + np.arange(offsets[-1])])

    @classmethod
    def from_texts(cls, texts: Sequence[str]) -> Ragged:
        """One row per string."""
        return cls.from_blobs([text.encode("utf-8") for text in texts])

    @classmethod
    def from_blobs(cls, blobs: Sequence[bytes]) -> Ragged:
        """One row per bytes object."""
        offsets = np.concatenate([[0], np.cumsum([len(blob) for blob in blobs])]).astype(np.int64)
        return cls(offsets, np.frombuffer(b"".join(blobs), dtype=np.uint8))

    @classmethod
    def from_matrix(cls, matrix: Array) -> Ragged:
        """Rows of equal length from a matrix `(n, k)`."""
        count, width = matrix.shape
        return cls(
            np.arange(count + 1, dtype=np.int64) * width, np.ascontiguousarray(matrix).reshape(-1)
        )


Column = Array | Ragged


def starts(lengths: Int64) -> Int64:
    """Offsets `(n + 1,)` of rows of the given lengths, end to end."""
    offsets = np.zeros(len(lengths) + 1, dtype=np.int64)
    np.cumsum(lengths, out=offsets[1:])
    return offsets


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Payloads:
    """Message bytes as they stood in the log, so that a channel passes through untouched.

    Attributes
    ----------
    offsets : int64 array (n,)
        Where each payload begins in `data`.
    lengths : int64 array (n,)
    data : uint8 array
    """

    offsets: Int64
    lengths: Int64
    data: npt.NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.offsets)

    def blobs(self) -> list[bytes]:
        """Payloads as bytes objects."""
        ends = self.offsets + self.lengths
        return [self.data[a:b].tobytes() for a, b in zip(self.offsets, ends, strict=True)]

    def take(self, rows: npt.NDArray[np.int64] | slice) -> Payloads:
        """Payloads of the given rows; the bytes are shared."""
        return Payloads(self.offsets[rows], self.lengths[rows], self.data)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Rows of one channel, in the order of the log.

    Attributes
    ----------
    log_time_ns : int64 array (n,)
        When each row became available, GPS nanoseconds (MCAP `log_time`).
    valid_time_ns : int64 array (n,)
        When each row's value is valid, GPS nanoseconds (MCAP `publish_time`).
    sequence : uint32 array (n,)
        Number of the row in its channel.
    values : mapping of field name to column
        Empty where only the payloads were asked for.
    present : mapping of field name to bool array (n,)
        For each `optional` field. A field that is not named here is in every row.
    payloads : Payloads or None
        The bytes as they were read.
    """

    log_time_ns: Int64
    valid_time_ns: Int64
    sequence: npt.NDArray[np.uint32]
    values: Mapping[str, Column]
    present: Mapping[str, npt.NDArray[np.bool_]] = dataclasses.field(default_factory=dict)
    payloads: Payloads | None = None

    def __len__(self) -> int:
        return len(self.log_time_ns)

    def __getitem__(self, name: str) -> Array:
        """Column of a field that is not ragged."""
        column = self.values[name]
        if isinstance(column, Ragged):
            raise TypeError(f"{name} is ragged: use ragged({name!r})")
        return column

    def ragged(self, name: str) -> Ragged:
        """Column of a ragged field."""
        column = self.values[name]
        if not isinstance(column, Ragged):
            raise TypeError(f"{name} is not ragged: use [{name!r}]")
        return column

    def is_present(self, name: str) -> npt.NDArray[np.bool_]:
        """Which rows hold the field."""
        mask = self.present.get(name)
        return np.ones(len(self), dtype=np.bool_) if mask is None else mask

    def take(self, rows: npt.NDArray[np.int64] | npt.NDArray[np.bool_] | slice) -> Columns:
        """Some of the rows."""
        if isinstance(rows, slice):
            index = np.arange(len(self), dtype=np.int64)[rows]
            view: npt.NDArray[np.int64] | slice = rows
        else:
            index = np.flatnonzero(rows) if rows.dtype == np.bool_ else rows.astype(np.int64)
            view = index
        return Columns(
            self.log_time_ns[view],
            self.valid_time_ns[view],
            self.sequence[view],
            {
                k: v.take(index) if isinstance(v, Ragged) else v[view]
                for k, v in self.values.items()
            },
            {k: v[view] for k, v in self.present.items()},
            None if self.payloads is None else self.payloads.take(view),
        )

    @classmethod
    def build(
        cls,
        valid_time_ns: npt.ArrayLike,
        values: Mapping[str, Column],
        *,
        log_time_ns: npt.ArrayLike | None = None,
        sequence_start: int = 0,
        present: Mapping[str, npt.NDArray[np.bool_]] | None = None,
    ) -> Columns:
        """Columns of new rows, available at once unless `log_time_ns` says otherwise."""
        valid = np.ascontiguousarray(valid_time_ns, dtype=np.int64)
        log = valid if log_time_ns is None else np.ascontiguousarray(log_time_ns, dtype=np.int64)
        sequence = np.arange(sequence_start, sequence_start + len(valid), dtype=np.uint32)
        for name, column in values.items():
            if len(column) != len(valid):
                raise ValueError(f"{name} has {len(column)} rows, the times have {len(valid)}")
        return cls(log, valid, sequence, dict(values), dict(present or {}))


def concatenate(parts: Sequence[Columns]) -> Columns:
    """Rows of all parts in their order; payloads are kept where every part has them.

    Raises
    ------
    ValueError
        Where there is no part, or the parts hold different fields.
    """
    if not parts:
        raise ValueError("nothing to concatenate")
    first = parts[0]
    if any(part.values.keys() != first.values.keys() for part in parts):
        raise ValueError("parts hold different fields")
    payloads = [part.payloads for part in parts if part.payloads is not None]
    masks = {name for part in parts for name in part.present}
    return Columns(
        np.concatenate([part.log_time_ns for part in parts]),
        np.concatenate([part.valid_time_ns for part in parts]),
        np.concatenate([part.sequence for part in parts]),
        {name: _join([part.values[name] for part in parts]) for name in first.values},
        {name: np.concatenate([part.is_present(name) for part in parts]) for name in sorted(masks)},
        join_payloads(payloads) if len(payloads) == len(parts) else None,
    )


def join_payloads(parts: Sequence[Payloads]) -> Payloads:
    """Payloads of all parts in their order; the bytes are copied."""
    starts = np.cumsum([0] + [len(part.data) for part in parts])
    offsets = [part.offsets + start for part, start in zip(parts, starts, strict=False)]
    return Payloads(
        np.concatenate(offsets).astype(np.int64),
        np.concatenate([part.lengths for part in parts]),
        np.concatenate([part.data for part in parts]),
    )


def _join(columns: Sequence[Column]) -> Column:
    if isinstance(columns[0], Ragged):
        ragged = [column for column in columns if isinstance(column, Ragged)]
        values = [c.values[c.offsets[0] : c.offsets[-1]] for c in ragged]
        starts = np.cumsum([0] + [len(v) for v in values])
        offsets = [c.offsets[:-1] - c.offsets[0] + s for c, s in zip(ragged, starts, strict=False)]
        return Ragged(
            np.concatenate([*offsets, [starts[-1]]]).astype(np.int64), np.concatenate(values)
        )
    return np.concatenate([np.asarray(column) for column in columns])
