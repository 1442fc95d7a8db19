"""Which row of A belongs to which row of B: by valid time and key, never by index."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from replay.diff.names import is_text
from replay.log.columns import Column, Columns, Ragged

Int64 = npt.NDArray[np.int64]
ABSENT = -1
_WORD = 8  # bytes that fit one integer


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """Rows of both runs side by side, sorted by valid time and key.

    Attributes
    ----------
    a, b : int64 arrays (n,)
        Row in A and in B; :data:`ABSENT` where a run has none.
    key : int64 array (n,)
        Number of the row's key; equal keys have equal numbers.
    """

    a: Int64
    b: Int64
    key: Int64

    def __len__(self) -> int:
        """Rows of the union."""
        return len(self.a)

    @property
    def matched(self) -> npt.NDArray[np.bool_]:
        """Rows that stand in both runs."""
        return np.asarray((self.a != ABSENT) & (self.b != ABSENT))

    @property
    def reordered(self) -> int:
        """How many matched rows come before the one that precedes them in the other run."""
        both = self.matched
        in_order_of_a = self.b[both][np.argsort(self.a[both], kind="stable")]
        return int(np.count_nonzero(np.diff(in_order_of_a) < 0))


def text_matrix(column: Column) -> tuple[npt.NDArray[np.uint8], Int64]:
    """Strings or bytes as a zero-padded matrix `(n, width)` and their lengths."""
    if isinstance(column, Ragged):
        lengths = np.diff(column.offsets)
        width = int(lengths.max(initial=0))
        matrix = np.zeros((len(column), width), dtype=np.uint8)
        filled = np.arange(width) < lengths[:, None]
        matrix[filled] = column.values[column.offsets[0] : column.offsets[-1]]
        return matrix, lengths
    width = column.dtype.itemsize
    matrix = np.ascontiguousarray(column).view(np.uint8).reshape(len(column), width)
    return matrix, np.char.str_len(column.astype(np.bytes_)).astype(np.int64)


def key_codes(keys: Sequence[str], a: Columns, b: Columns) -> tuple[Int64, Int64]:
    """One integer per row, equal where all key fields are."""
    codes = np.zeros(len(a) + len(b), dtype=np.int64)
    for key in keys:
        words = _words(a.values[key], b.values[key])
        words[~np.concatenate([a.is_present(key), b.is_present(key)])] = 0
        for word in words.T:
            _, inverse = np.unique(word, return_inverse=True)
            _, codes = np.unique(
                codes * (inverse.max(initial=0) + 1) + inverse, return_inverse=True
            )
    return codes[: len(a)], codes[len(a) :]


def _words(a: Column, b: Column) -> npt.NDArray[np.uint64]:
    """Column of both runs as rows of 64-bit words."""
    if not is_text(a):
        return (
            np.concatenate([np.asarray(a), np.asarray(b)]).astype(np.int64).view(np.uint64)[:, None]
        )
    parts = [text_matrix(column)[0] for column in (a, b)]
    width = -(-max(*(part.shape[1] for part in parts), 1) // _WORD) * _WORD
    padded = [np.pad(part, ((0, 0), (0, width - part.shape[1]))) for part in parts]
    return np.ascontiguousarray(np.concatenate(padded)).view(np.uint64)


def align(time_a: Int64, time_b: Int64, key_a: Int64, key_b: Int64) -> Alignment:
    """Match rows; duplicates of one time and key are matched in their order.

    Parameters
    ----------
    time_a, time_b : int64 arrays (n,), (m,)
        Valid times.
    key_a, key_b : int64 arrays (n,), (m,)
        From :func:`key_codes`.
    """
    count_a = len(time_a)
    if (
        np.array_equal(time_a, time_b)
        and np.array_equal(key_a, key_b)
        and bool(np.all(time_a[1:] >= time_a[:-1]))
    ):
        in_place = np.arange(count_a, dtype=np.int64)
        return Alignment(in_place, in_place, key_a)
    time = np.concatenate([time_a, time_b])
    key = np.concatenate([key_a, key_b])
    # A's rows come first in the concatenation and lexsort is stable, so in a group of one
    # time and key the rows of A stand before those of B, both in their order.
    order = np.lexsort((key, time))
    time, key, from_b = time[order], key[order], order >= count_a
    starts = np.ones(len(order), dtype=np.bool_)
    starts[1:] = (np.diff(time) != 0) | (np.diff(key) != 0)
    group = np.cumsum(starts) - 1
    first = np.flatnonzero(starts)
    group_a = np.bincount(group[~from_b], minlength=len(first))
    group_b = np.bincount(group[from_b], minlength=len(first))
    size = np.maximum(group_a, group_b)
    place = np.arange(len(order)) - first[group] - np.where(from_b, group_a[group], 0)
    slot = (np.cumsum(size) - size)[group] + place
    rows_a = np.full(int(size.sum()), ABSENT, dtype=np.int64)
    rows_b = rows_a.copy()
    rows_a[slot[~from_b]] = order[~from_b]
    rows_b[slot[from_b]] = order[from_b] - count_a
    return Alignment(rows_a, rows_b, np.repeat(key[first], size))
