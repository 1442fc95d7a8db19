"""Rows of one channel from the end of a log to its beginning, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator

from replay.log.columns import Columns
from replay.log.reader import LogReader

_FAR = (1 << 63) - 1
_CHUNKS = 16


def backwards(
    reader: LogReader,
    topic: str,
    *,
    start_ns: int | None = None,
    end_ns: int | None = None,
    chunks: int = _CHUNKS,
) -> Iterator[Columns]:
    """Rows of a channel in slices of log time, the last slice first.

    A slice reaches from the first log time of one chunk that holds the channel to that of some
    chunks later, so that it is as large, however long the log.

    Parameters
    ----------
    reader : LogReader
    topic : str
    start_ns, end_ns : int, optional
        Log times, half open.
    chunks : int
        Chunks of a slice.

    Yields
    ------
    Columns
        Rows of a slice in the order of the log; every row follows those of the next slice by
        log time.

    Raises
    ------
    MissingChannelError, CorruptLogError
        As :meth:`replay.log.reader.LogReader.batches`.
    """
    ids = frozenset(reader.channel(topic).ids)
    begin = 0 if start_ns is None else start_ns
    end = _FAR if end_ns is None else end_ns
    edges = sorted(
        {
            max(begin, block.start_ns)
            for block in reader.structure.blocks
            if (block.channels is None or block.channels & ids)
            and block.start_ns < end
            and block.end_ns >= begin
        }
    )
    stop = end
    for edge in edges[::chunks][::-1]:
        rows = reader.read(topic, start_ns=edge, end_ns=stop)
        if len(rows):
            yield rows
        stop = edge
