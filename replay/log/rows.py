"""Rows as they stand between columns and records: times, sequence and payload bytes."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from replay.log import _scan
from replay.log.columns import Int64, Payloads, join_payloads


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Rows of one channel.

    Attributes
    ----------
    log_time_ns, valid_time_ns : int64 arrays (n,)
    sequence : uint32 array (n,)
    payloads : Payloads
    """

    log_time_ns: Int64
    valid_time_ns: Int64
    sequence: npt.NDArray[np.uint32]
    payloads: Payloads

    def __len__(self) -> int:
        return len(self.log_time_ns)

    def take(self, rows: npt.NDArray[np.int64] | slice) -> Rows:
        """Some of the rows; the payload bytes are shared."""
        return Rows(
            np.ascontiguousarray(self.log_time_ns[rows]),
            np.ascontiguousarray(self.valid_time_ns[rows]),
            np.ascontiguousarray(self.sequence[rows]),
            self.payloads.take(rows),
        )

    def ordered(self) -> Rows:
        """The rows by log time, then sequence, then as they stand."""
        if _scan.is_ordered(self.log_time_ns, self.sequence):
            return self
        return self.take(np.lexsort((self.sequence, self.log_time_ns)).astype(np.int64))


def compact(payloads: Payloads) -> Payloads:
    """The same payloads end to end in bytes of their own."""
    lengths = np.ascontiguousarray(payloads.lengths)
    ends = np.cumsum(lengths)
    data = np.empty(int(ends[-1]) if len(ends) else 0, dtype=np.uint8)
    _scan.gather(np.ascontiguousarray(payloads.offsets), lengths, payloads.data, data)
    return Payloads(ends - lengths, lengths, data)


def join_rows(parts: Sequence[Rows]) -> Rows:
    """Rows of all parts in their order."""
    if len(parts) == 1:
        return parts[0]
    return Rows(
        np.concatenate([part.log_time_ns for part in parts]),
        np.concatenate([part.valid_time_ns for part in parts]),
        np.concatenate([part.sequence for part in parts]),
        join_payloads([part.payloads for part in parts]),
    )
