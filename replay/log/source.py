"""A log's bytes, and the pieces of it that hold messages."""

from __future__ import annotations

import contextlib
import dataclasses
import mmap
import os
import zlib
from pathlib import Path

import numpy as np
import numpy.typing as npt

from replay.errors import LogError
from replay.log import _scan, records
from replay.log.chunks import ChunkError, decompress
from replay.log.columns import Payloads
from replay.log.rows import Rows

_AROUND = 1 << 16  # bytes; Linux's usual fault_around_bytes


class DamageError(Exception):
    """Bytes that are not what they should be.

    Parameters
    ----------
    what : str
        What is wrong.
    offset : int
        First byte of the record or section where it shows.
    """

    def __init__(self, what: str, offset: int) -> None:
        super().__init__(what)
        self.what = what
        self.offset = offset


class Source:
    """A mapped file.

    Parameters
    ----------
    path : path
        Of the log.

    Raises
    ------
    LogError
        Where there is no such file or it cannot be read.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        try:
            with self.path.open("rb") as file:
                self.size = os.fstat(file.fileno()).st_size
                # An empty file cannot be mapped.
                self._map = (
                    mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if self.size else None
                )
        except OSError as error:
            raise LogError(f"the log cannot be read: {error}", where=str(path)) from error
        self.view = memoryview(self._map or b"")
        self.array: npt.NDArray[np.uint8] = np.frombuffer(self.view, dtype=np.uint8)

    def close(self) -> None:
        """Give the file back, once no rows that were handed out look into it any more."""
        self.array = np.empty(0, dtype=np.uint8)
        with contextlib.suppress(BufferError):
            self.view.release()
            if self._map is not None:
                self._map.close()

    def forget(self, start: int, length: int) -> None:
        """Let the system take back the memory of bytes that were read, not the bytes themselves.

        Pages of a mapped file count as this process's until they are needed elsewhere, so
        that a long log would look like a leak. A later look at them reads them again.
        """
        if self._map is None or not hasattr(mmap, "MADV_DONTNEED"):
            return
        # The system maps the neighbours of a page that is looked at along with it, those of
        # bytes that were forgotten before as well.
        first = max(0, start - _AROUND) // mmap.PAGESIZE * mmap.PAGESIZE
        last = min(self.size, start + length + _AROUND)
        if last > first:
            self._map.madvise(mmap.MADV_DONTNEED, first, last - first)

    def content(self, offset: int, length: int) -> memoryview:
        """Content of the record of `length` bytes at `offset`."""
        return self.view[offset + records.HEAD.size : offset + length]

    def opcode(self, offset: int) -> int:
        """Opcode of the record at `offset`."""
        return self.view[offset]


@dataclasses.dataclass(frozen=True, slots=True)
class Block:
    """A chunk, or a run of messages that stand outside chunks.

    Attributes
    ----------
    offset, length : int
        Bytes of the file, record headers included.
    start_ns, end_ns : int
        Within which the log times lie.
    head : ChunkHead or None
        None for a run.
    channels : frozenset of int or None
        Ids of the channels that have messages in it, where they are known without
        opening it.
    """

    offset: int
    length: int
    start_ns: int
    end_ns: int
    head: records.ChunkHead | None
    channels: frozenset[int] | None = None


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Loaded:
    """Messages of a block, in the order of the file.

    Attributes
    ----------
    channel : uint16 array (n,)
        Channel ids.
    rows : Rows
        Payloads look into the block's bytes.
    definitions : list of (int, bytes)
        Opcode and content of the schema and channel records in the block.
    """

    channel: npt.NDArray[np.uint16]
    rows: Rows
    definitions: list[tuple[int, bytes]]


def load(source: Source, block: Block, *, check_crc: bool) -> Loaded:
    """Messages of a block.

    Raises
    ------
    DamageError
        Where a checksum or a record in it is wrong.
    """
    if block.head is None:
        return walk(source.array, block.offset, block.offset + block.length, block.offset)
    loaded = open_chunk(source, block.offset, block.head, check_crc=check_crc)
    times = loaded.rows.log_time_ns
    if len(times) and (times.min() < block.start_ns or times.max() > block.end_ns):
        raise DamageError("messages lie outside the times that their chunk states", block.offset)
    return loaded


def open_chunk(source: Source, offset: int, head: records.ChunkHead, *, check_crc: bool) -> Loaded:
    """Messages of the chunk record at `offset`, whatever times its head states.

    Raises
    ------
    DamageError
        As :func:`load`.
    """
    begin = offset + records.HEAD.size + head.head_bytes
    packed = source.view[begin : begin + head.compressed_bytes]
    if len(packed) < head.compressed_bytes:
        raise DamageError("a chunk runs past the end of the file", offset)
    try:
        plain = decompress(head.compression, packed, head.uncompressed_bytes)
    except ChunkError as error:
        raise DamageError(f"a chunk cannot be decompressed ({error})", offset) from error
    if check_crc and head.crc and zlib.crc32(plain) != head.crc:
        raise DamageError("the checksum of a chunk is wrong", offset)
    source.forget(begin, head.compressed_bytes)
    data = np.frombuffer(plain, dtype=np.uint8)
    return walk(data, 0, len(data), offset)


def walk(data: npt.NDArray[np.uint8], start: int, end: int, offset: int) -> Loaded:
    """Messages of `data[start:end]`, which stands for bytes at `offset` of the file."""
    messages, others, stop = _scan.count_records(data, start, end)
    if stop != end:
        where = f"{stop - start} bytes into the block"
        raise DamageError(f"a record does not fit or its time lies beyond 2262, {where}", offset)
    channel = np.empty(messages, dtype=np.uint16)
    sequence = np.empty(messages, dtype=np.uint32)
    log, publish, begins, lengths = (np.empty(messages, dtype=np.int64) for _ in range(4))
    places = np.empty(others, dtype=np.int64)
    _scan.fill_records(data, start, stop, channel, sequence, log, publish, begins, lengths, places)
    definitions = []
    for place in places.tolist():
        opcode, length = records.HEAD.unpack_from(data.data, place)
        if opcode in (records.SCHEMA, records.CHANNEL):
            begin = place + records.HEAD.size
            definitions.append((opcode, data[begin : begin + length].tobytes()))
    return Loaded(
        channel, Rows(log, publish, sequence, Payloads(begins, lengths, data)), definitions
    )
