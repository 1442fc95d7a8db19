"""Messages on their way into a chunk."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from replay.log import _scan, records
from replay.log.columns import Payloads
from replay.log.rows import Rows

RECORD_BYTES = _scan.HEADER_BYTES + _scan.MESSAGE_HEAD_BYTES


class ChunkBuilder:
    """Packs message records until the chunk is full.

    Parameters
    ----------
    limit_bytes : int
        Messages go in while the chunk stays within this; a larger one has its own.
    """

    def __init__(self, limit_bytes: int) -> None:
        self.limit_bytes = limit_bytes
        self.size = 0
        self._packed: list[npt.NDArray[np.uint8]] = []
        self._channels: list[npt.NDArray[np.uint16]] = []
        self._times: list[npt.NDArray[np.int64]] = []
        self._begins: list[npt.NDArray[np.int64]] = []

    def add(
        self, rows: Rows, channels: npt.NDArray[np.uint16], order: npt.NDArray[np.int64]
    ) -> int:
        """Take as many of the rows `order` as go in, one at least into an empty chunk.

        Returns
        -------
        int
            How many went in.
        """
        payloads: Payloads = rows.payloads
        # No chunk holds more rows than empty messages would fill.
        order = order[: self.limit_bytes // RECORD_BYTES + 1]
        ends = np.cumsum(payloads.lengths[order] + RECORD_BYTES)
        count = int(np.searchsorted(ends, self.limit_bytes - self.size, side="right"))
        if count == 0:
            if self.size:
                return 0
            count = 1
        order = np.ascontiguousarray(order[:count])
        packed = np.empty(int(ends[count - 1]), dtype=np.uint8)
        begins = np.empty(count, dtype=np.int64)
        _scan.pack_messages(
            order, channels, rows.sequence, rows.log_time_ns, rows.valid_time_ns,
            payloads.offsets, payloads.lengths, payloads.data, packed, begins,
        )  # fmt: skip
        self._packed.append(packed)
        self._channels.append(channels[order])
        self._times.append(rows.log_time_ns[order])
        self._begins.append(begins + self.size)
        self.size += len(packed)
        return count

    def used(self) -> list[int]:
        """Ids of the channels in the chunk, rising."""
        return sorted({int(i) for part in self._channels for i in np.unique(part)})

    def finish(self, prefix: bytes) -> tuple[bytes, int, int, list[tuple[int, bytes]]]:
        """Records of the chunk behind `prefix`, and begin again.

        Returns
        -------
        tuple
            Records, first and last log time [ns] (0 where there is no message), and per
            channel id its MessageIndex record.
        """
        plain = b"".join([prefix, *(part.data for part in self._packed)])
        indexes: list[tuple[int, bytes]] = []
        first = last = 0
        if self._times:
            channels, times = np.concatenate(self._channels), np.concatenate(self._times)
            begins = np.concatenate(self._begins) + len(prefix)
            first, last = int(times.min()), int(times.max())
            for channel_id in self.used():
                rows = channels == channel_id
                index = records.message_index(channel_id, times[rows], begins[rows])
                indexes.append((channel_id, index))
        self.size = 0
        for parts in (self._packed, self._channels, self._times, self._begins):
            parts.clear()
        return plain, first, last, indexes
