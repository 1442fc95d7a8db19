"""Digest of a channel: SHA-256 over times and payloads, whatever file or chunks they lie in."""

from __future__ import annotations

import dataclasses
import hashlib

import numpy as np
import numpy.typing as npt

from replay.log import _scan
from replay.log.columns import Payloads

_ROW_HEAD_BYTES = 20
_BLOCK_ROWS = 16384  # a few MB: what is packed is hashed before it leaves the cache


@dataclasses.dataclass(frozen=True, slots=True)
class ChannelDigest:
    """What a channel holds, in one line.

    Attributes
    ----------
    schema : str
        Full name of the message.
    message_count : int
    sha256 : str
        Hexadecimal; over `<qqI` of log time, publish time and payload length, then the
        payload, row by row.
    """

    schema: str
    message_count: int
    sha256: str


class Digester:
    """Digest of a channel whose rows come bit by bit.

    Parameters
    ----------
    schema : str
        Full name of the message.
    """

    def __init__(self, schema: str) -> None:
        self.schema = schema
        self.count = 0
        self._hash = hashlib.sha256()

    def update(
        self,
        log_time_ns: npt.NDArray[np.int64],
        valid_time_ns: npt.NDArray[np.int64],
        payloads: Payloads,
    ) -> None:
        """Add rows in the order of the channel."""
        count = len(log_time_ns)
        for begin in range(0, count, _BLOCK_ROWS):
            rows = slice(begin, min(begin + _BLOCK_ROWS, count))
            offset, length = payloads.offsets[rows], payloads.lengths[rows]
            packed = np.empty(int(length.sum()) + _ROW_HEAD_BYTES * len(offset), dtype=np.uint8)
            _scan.pack_digest_rows(
                log_time_ns[rows], valid_time_ns[rows], offset, length, payloads.data, packed
            )
            self._hash.update(packed.data)
        self.count += count

    def result(self) -> ChannelDigest:
        """Digest of the rows so far."""
        return ChannelDigest(self.schema, self.count, self._hash.hexdigest())
