"""What a log is made of: blocks of messages, definitions, metadata, attachments.

:func:`read_structure` reads a file that is whole, and says where it is not.
"""

from __future__ import annotations

import dataclasses
import zlib
from typing import Final

import numpy as np

from replay.log import _scan, records
from replay.log.source import Block, DamageError, Loaded, Source, load

_RUN_BYTES: Final = 1 << 20
_PIECE: Final = 1 << 26


class Definitions:
    """Schemas and channels by id, as the records of a log define them."""

    def __init__(self) -> None:
        self.schemas: dict[int, records.Schema] = {}
        self.channels: dict[int, records.Channel] = {}
        self._known: set[tuple[int, bytes]] = set()

    def add(self, opcode: int, content: bytes, offset: int) -> None:
        """Take the content of a schema or channel record.

        Raises
        ------
        DamageError
            Where it cannot be read, or differs from one of the same id.
        """
        if (opcode, content) in self._known:
            return
        try:
            if opcode == records.SCHEMA:
                schema = records.Schema.parse(content)
                # The specification calls a schema of id 0 invalid and lets readers skip it.
                if schema.id and self.schemas.setdefault(schema.id, schema) != schema:
                    raise DamageError(f"schema {schema.id} is defined in two ways", offset)
            else:
                channel = records.Channel.parse(content)
                if self.channels.setdefault(channel.id, channel) != channel:
                    raise DamageError(f"channel {channel.id} is defined in two ways", offset)
        except records.RecordError as error:
            raise DamageError(f"a definition cannot be read ({error})", offset) from error
        self._known.add((opcode, content))


@dataclasses.dataclass(slots=True)
class Summary:
    """Records of the summary section.

    Attributes
    ----------
    start : int
        Where the summary begins; the footer, where there is none.
    verified : bool
        Whether its checksum is there and right.
    """

    start: int
    verified: bool
    definitions: list[tuple[int, bytes, int]] = dataclasses.field(default_factory=list)
    statistics: records.Statistics | None = None
    chunks: dict[int, records.ChunkIndex] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(slots=True)
class Structure:
    """What a log is made of.

    Attributes
    ----------
    header : Header
    blocks : list of Block
        In the order of the file.
    definitions : Definitions
    metadata : list of Metadata
    attachments : list of Attachment
    message_counts : dict of channel id to int
    verified : bool
        Whether a checksum covers every byte that this was read from.
    complete : bool
        Whether definitions, times and counts are known without opening the blocks.
    stated_span_ns : (int, int)
        First and last log time as the summary states them.
    """

    header: records.Header
    blocks: list[Block] = dataclasses.field(default_factory=list)
    definitions: Definitions = dataclasses.field(default_factory=Definitions)
    metadata: list[records.Metadata] = dataclasses.field(default_factory=list)
    attachments: list[records.Attachment] = dataclasses.field(default_factory=list)
    message_counts: dict[int, int] = dataclasses.field(default_factory=dict)
    verified: bool = False
    complete: bool = False
    stated_span_ns: tuple[int, int] = (0, 0)

    def span_ns(self) -> tuple[int, int]:
        """First and last log time, zeros where there is no message."""
        if self.complete:
            return self.stated_span_ns
        # Blocks that were opened know whether they hold messages at all.
        spans = [block for block in self.blocks if block.channels]
        first = min((block.start_ns for block in spans), default=0)
        return first, max((block.end_ns for block in spans), default=0)

    def notes(self) -> list[str]:
        """What no checksum vouches for, which the specification allows."""
        if self.verified:
            return []
        bare = sum(block.head is not None and block.head.crc == 0 for block in self.blocks)
        loose = sum(block.head is None for block in self.blocks)
        unsure = sum(not metadata.verified for metadata in self.metadata)
        unsure += sum(not attachment.verified for attachment in self.attachments)
        found = [
            (bare, "chunks carry no checksum"),
            (loose, "runs of messages stand outside chunks, where they have no checksum"),
            (unsure, "metadata or attachments carry no checksum"),
        ]
        return [f"{count} {what}" for count, what in found if count]


def read_summary(source: Source, *, check_crc: bool) -> Summary:
    """Footer and summary of a file.

    Raises
    ------
    DamageError
        Where the end of the file is not what the specification asks for.
    """
    size = source.size
    if bytes(source.view[-8:]) != records.MAGIC:
        what = "the end is missing: the last bytes are not those of a log"
        raise DamageError(what, max(size - 8, 0))
    at = size - 8 - records.FOOTER_BYTES
    if at < 8 or records.HEAD.unpack_from(source.view, at) != (records.FOOTER, 20):
        raise DamageError("there is no footer", max(at, 0))
    footer = records.Footer.parse(source.content(at, records.FOOTER_BYTES))
    start = footer.summary_start or at
    if not 8 <= start <= at:
        raise DamageError("the footer points outside the file", at)
    summary = Summary(start, footer.crc != 0 and check_crc)
    if summary.verified and zlib.crc32(source.view[start : size - 12]) != footer.crc:
        raise DamageError("the checksum of the summary is wrong", start)
    place = start
    while place < at:
        opcode, length = records.HEAD.unpack_from(source.view, place)
        total = records.HEAD.size + length
        if total > at - place:
            raise DamageError("a record of the summary does not fit", place)
        try:
            _take_summary(summary, opcode, source.content(place, total), place)
        except records.RecordError as error:
            raise DamageError(f"a record of the summary cannot be read ({error})", place) from error
        place += total
    return summary


def _take_summary(summary: Summary, opcode: int, content: memoryview, place: int) -> None:
    if opcode in (records.SCHEMA, records.CHANNEL):
        summary.definitions.append((opcode, bytes(content), place))
    elif opcode == records.STATISTICS:
        summary.statistics = records.Statistics.parse(content)
    elif opcode == records.CHUNK_INDEX:
        index = records.ChunkIndex.parse(content)
        summary.chunks[index.offset] = index


@dataclasses.dataclass(frozen=True, slots=True)
class Entry:
    """A record of the data section, or a run of messages (see `_scan.walk_section`)."""

    opcode: int
    offset: int
    length: int
    count: int
    first_ns: int
    last_ns: int


def entries(source: Source, start: int, end: int) -> tuple[list[Entry], int]:
    """Records of `start..end` up to a DataEnd, and where the walk stopped."""
    none, nothing = np.empty(0, dtype=np.uint8), np.empty(0, dtype=np.int64)
    empty = [nothing] * 5
    count, stop = _scan.walk_section(source.array, start, end, _RUN_BYTES, none, *empty)
    opcode = np.empty(count, dtype=np.uint8)
    columns = [np.empty(count, dtype=np.int64) for _ in range(5)]
    if count:
        _scan.walk_section(source.array, start, end, _RUN_BYTES, opcode, *columns)
    # A look at the head of every record maps a good part of the file.
    source.forget(start, end - start)
    lists = [column.tolist() for column in columns]
    return [Entry(*row) for row in zip(opcode.tolist(), *lists, strict=True)], stop


def data_crc(source: Source, end: int) -> int:
    """Checksum of the file's first `end` bytes."""
    crc = 0
    for begin in range(0, end, _PIECE):
        crc = zlib.crc32(source.view[begin : min(begin + _PIECE, end)], crc)
        source.forget(begin, _PIECE)
    return crc


def read_structure(source: Source, *, check_crc: bool) -> Structure:
    """Structure of a file that is whole.

    Raises
    ------
    DamageError
        Where it is not.
    """
    if bytes(source.view[:8]) != records.MAGIC:
        raise DamageError("this is no MCAP file: it does not begin like one", 0)
    summary = read_summary(source, check_crc=check_crc)
    found, stop = entries(source, 8, summary.start)
    if not found or found[0].opcode != records.HEADER:
        raise DamageError("there is no header", 8)
    if found[-1].opcode != records.DATA_END or stop != summary.start:
        raise DamageError("a record does not fit where it stands", stop)
    try:
        header = records.Header.parse(source.content(found[0].offset, found[0].length))
    except records.RecordError as error:
        raise DamageError(f"the header cannot be read ({error})", 8) from error
    structure = Structure(header)
    crc = int.from_bytes(source.content(found[-1].offset, found[-1].length)[:4], "little")
    if crc and check_crc:
        if data_crc(source, found[-1].offset) != crc:
            raise DamageError("the checksum of the data section is wrong", 8)
        structure.verified = True
    for opcode, content, place in summary.definitions:
        structure.definitions.add(opcode, content, place)
    for entry in found[1:-1]:
        take_entry(source, structure, summary, entry)
        source.forget(entry.offset, 0)
    _check_totals(structure, summary)
    return structure


def take_entry(source: Source, structure: Structure, summary: Summary, entry: Entry) -> None:
    """Take a record of the data section into the structure.

    Raises
    ------
    DamageError
        Where the record cannot be read, or the summary says otherwise.
    """
    content = source.content(entry.offset, entry.length)
    try:
        if entry.opcode == records.CHUNK:
            structure.blocks.append(_chunk_block(content, summary, entry))
        elif entry.opcode == records.MESSAGE:
            times = (entry.first_ns, entry.last_ns)
            structure.blocks.append(Block(entry.offset, entry.length, *times, None))
        elif entry.opcode in (records.SCHEMA, records.CHANNEL):
            structure.definitions.add(entry.opcode, bytes(content), entry.offset)
        elif entry.opcode == records.METADATA:
            structure.metadata.append(records.Metadata.parse(content))
        elif entry.opcode == records.ATTACHMENT:
            structure.attachments.append(records.Attachment.parse(content))
    except records.RecordError as error:
        raise DamageError(str(error), entry.offset) from error


def _chunk_block(content: memoryview, summary: Summary, entry: Entry) -> Block:
    head = records.ChunkHead.parse(content)
    if head.compressed_bytes > len(content) - head.head_bytes:
        raise DamageError("a chunk is longer than its record", entry.offset)
    channels = None
    if summary.chunks:
        index = summary.chunks.get(entry.offset)
        if index is None:
            raise DamageError("the summary does not know this chunk", entry.offset)
        stated = (index.start_ns, index.end_ns, index.compressed_bytes, index.uncompressed_bytes)
        if stated != (head.start_ns, head.end_ns, head.compressed_bytes, head.uncompressed_bytes):
            raise DamageError("chunk and summary state different times or sizes", entry.offset)
        if index.message_index_offsets:
            channels = frozenset(index.message_index_offsets)
    return Block(entry.offset, entry.length, head.start_ns, head.end_ns, head, channels)


def _check_totals(structure: Structure, summary: Summary) -> None:
    """Compare what was found with what the summary counts."""
    chunks = sum(block.head is not None for block in structure.blocks)
    if summary.chunks and chunks != len(summary.chunks):
        known = len(summary.chunks)
        raise DamageError(f"{chunks} chunks where the summary knows {known}", summary.start)
    statistics = summary.statistics
    if statistics is None:
        return
    parts = (chunks, len(structure.attachments), len(structure.metadata))
    stated = (statistics.chunk_count, statistics.attachment_count, statistics.metadata_count)
    if parts != stated:
        raise DamageError(
            f"{parts} chunks, attachments, metadata where the summary counts {stated}",
            summary.start,
        )
    counts = structure.message_counts = dict(statistics.channel_message_counts)
    structure.stated_span_ns = statistics.start_ns, statistics.end_ns
    channels, schemas = structure.definitions.channels, structure.definitions.schemas
    structure.complete = (
        # Times are those that chunks state: the summary or the checksum must agree.
        (structure.verified or len(summary.chunks) == len(structure.blocks))
        and len(channels) >= statistics.channel_count
        and all(c.schema_id in schemas or not c.schema_id for c in channels.values())
        and channels.keys() >= counts.keys()
        and sum(counts.values()) == statistics.message_count
    )


def count_block(
    source: Source,
    structure: Structure,
    block: Block,
    loaded: Loaded | None = None,
    *,
    check_crc: bool = True,
) -> Block:
    """Take definitions and counts from the messages of a block.

    Parameters
    ----------
    source, structure, block
        What is read, what it goes into, and which part.
    loaded : Loaded, optional
        The block's messages, where it is open already.
    check_crc : bool
        Whether the block's checksum is compared.

    Returns
    -------
    Block
        With the times and channels of its messages.

    Raises
    ------
    DamageError
        Where the block is not whole.
    """
    if loaded is None:
        loaded = load(source, block, check_crc=check_crc)
        for opcode, content in loaded.definitions:
            structure.definitions.add(opcode, content, block.offset)
    ids, counts = np.unique(loaded.channel, return_counts=True)
    for channel_id, count in zip(ids.tolist(), counts.tolist(), strict=True):
        structure.message_counts[channel_id] = structure.message_counts.get(channel_id, 0) + count
    times = loaded.rows.log_time_ns
    span = (int(times.min()), int(times.max())) if len(times) else (0, 0)
    return dataclasses.replace(
        block, start_ns=span[0], end_ns=span[1], channels=frozenset(ids.tolist())
    )
