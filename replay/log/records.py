"""MCAP records as Python objects: those that are few, everything but messages.

After the MCAP specification, version 0. `parse` reads the content of a record
(what follows opcode and length) and ignores what a later version of the
specification may add behind the known fields; `build` gives a whole record.
"""

from __future__ import annotations

import dataclasses
import struct
import zlib
from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

MAGIC: Final = b"\x89MCAP0\r\n"

HEADER: Final = 0x01
FOOTER: Final = 0x02
SCHEMA: Final = 0x03
CHANNEL: Final = 0x04
MESSAGE: Final = 0x05
CHUNK: Final = 0x06
MESSAGE_INDEX: Final = 0x07
CHUNK_INDEX: Final = 0x08
ATTACHMENT: Final = 0x09
ATTACHMENT_INDEX: Final = 0x0A
STATISTICS: Final = 0x0B
METADATA: Final = 0x0C
METADATA_INDEX: Final = 0x0D
SUMMARY_OFFSET: Final = 0x0E
DATA_END: Final = 0x0F

HEAD: Final = struct.Struct("<BQ")  # opcode and length of the content
FOOTER_BYTES: Final = HEAD.size + 20  # a footer may not be extended
CRC_KEY: Final = "_crc32"

Buffer = memoryview | bytes


class RecordError(ValueError):
    """The content of a record does not follow the specification."""


class _Cursor:
    """Reads fields one after the other and never past the end."""

    def __init__(self, content: Buffer) -> None:
        self.content = memoryview(content)
        self.at = 0

    def take(self, count: int) -> memoryview:
        if count > len(self.content) - self.at:
            raise RecordError("a field runs past the end of its record")
        self.at += count
        return self.content[self.at - count : self.at]

    def number(self, width: int) -> int:
        return int.from_bytes(self.take(width), "little")

    def text(self) -> str:
        try:
            return str(self.take(self.number(4)), "utf-8")
        except UnicodeDecodeError as error:
            raise RecordError("a text is not UTF-8") from error

    def texts(self) -> dict[str, str]:
        inner = _Cursor(self.take(self.number(4)))
        found: dict[str, str] = {}
        while inner.at < len(inner.content):
            key = inner.text()
            found[key] = inner.text()
        return found

    def numbers(self, key_width: int) -> dict[int, int]:
        inner = _Cursor(self.take(self.number(4)))
        found: dict[int, int] = {}
        while inner.at < len(inner.content):
            key = inner.number(key_width)
            found[key] = inner.number(8)
        return found


def record(opcode: int, content: bytes) -> bytes:
    """A whole record."""
    return HEAD.pack(opcode, len(content)) + content


def _text(value: str) -> bytes:
    encoded = value.encode()
    return struct.pack("<I", len(encoded)) + encoded


def _texts(values: Mapping[str, str]) -> bytes:
    body = b"".join(_text(key) + _text(values[key]) for key in sorted(values))
    return struct.pack("<I", len(body)) + body


def _numbers(values: Mapping[int, int]) -> bytes:
    body = b"".join(struct.pack("<HQ", key, values[key]) for key in sorted(values))
    return struct.pack("<I", len(body)) + body


@dataclasses.dataclass(frozen=True, slots=True)
class Header:
    """First record of a file."""

    profile: str
    library: str

    @classmethod
    def parse(cls, content: Buffer) -> Header:
        """Read the content of a record."""
        cursor = _Cursor(content)
        return cls(cursor.text(), cursor.text())

    def build(self) -> bytes:
        """Whole record."""
        return record(HEADER, _text(self.profile) + _text(self.library))


@dataclasses.dataclass(frozen=True, slots=True)
class Footer:
    """Last record of a file; `crc` covers the summary and the footer up to itself."""

    summary_start: int
    summary_offset_start: int
    crc: int

    @classmethod
    def parse(cls, content: Buffer) -> Footer:
        """Read the content of a record."""
        cursor = _Cursor(content)
        return cls(cursor.number(8), cursor.number(8), cursor.number(4))

    @staticmethod
    def build(summary: bytes, summary_start: int, summary_offset_start: int) -> bytes:
        """Whole record behind the given summary."""
        head = HEAD.pack(FOOTER, 20) + struct.pack("<QQ", summary_start, summary_offset_start)
        return head + struct.pack("<I", zlib.crc32(head, zlib.crc32(summary)))


@dataclasses.dataclass(frozen=True, slots=True)
class Schema:
    """What the messages of a channel look like."""

    id: int
    name: str
    encoding: str
    data: bytes

    @classmethod
    def parse(cls, content: Buffer) -> Schema:
        """Read the content of a record."""
        cursor = _Cursor(content)
        schema_id, name, encoding = cursor.number(2), cursor.text(), cursor.text()
        return cls(schema_id, name, encoding, bytes(cursor.take(cursor.number(4))))

    def build(self) -> bytes:
        """Whole record."""
        head = struct.pack("<H", self.id) + _text(self.name) + _text(self.encoding)
        return record(SCHEMA, head + struct.pack("<I", len(self.data)) + self.data)


@dataclasses.dataclass(frozen=True, slots=True)
class Channel:
    """A stream of messages on a topic."""

    id: int
    schema_id: int
    topic: str
    message_encoding: str
    metadata: dict[str, str]

    @classmethod
    def parse(cls, content: Buffer) -> Channel:
        """Read the content of a record."""
        cursor = _Cursor(content)
        ids = cursor.number(2), cursor.number(2)
        return cls(*ids, cursor.text(), cursor.text(), cursor.texts())

    def build(self) -> bytes:
        """Whole record."""
        head = struct.pack("<HH", self.id, self.schema_id) + _text(self.topic)
        return record(CHANNEL, head + _text(self.message_encoding) + _texts(self.metadata))


@dataclasses.dataclass(frozen=True, slots=True)
class ChunkHead:
    """Everything of a chunk but its records, which begin `head_bytes` into the content.

    `crc` is of the records when decompressed; 0 says that there is none.
    """

    start_ns: int
    end_ns: int
    uncompressed_bytes: int
    crc: int
    compression: str
    compressed_bytes: int
    head_bytes: int

    @classmethod
    def parse(cls, content: Buffer) -> ChunkHead:
        """Read the content of a record; the records need not fit into it."""
        cursor = _Cursor(content)
        start, end, size, crc = (cursor.number(width) for width in (8, 8, 8, 4))
        return cls(start, end, size, crc, cursor.text(), cursor.number(8), cursor.at)

    @staticmethod
    def build(
        start_ns: int, end_ns: int, plain: Buffer, compression: str, compressed_bytes: int
    ) -> bytes:
        """Record up to where the compressed records follow."""
        fixed = struct.pack("<QQQI", start_ns, end_ns, len(plain), zlib.crc32(plain))
        content = fixed + _text(compression) + struct.pack("<Q", compressed_bytes)
        return HEAD.pack(CHUNK, len(content) + compressed_bytes) + content


@dataclasses.dataclass(frozen=True, slots=True)
class ChunkIndex:
    """Where a chunk is, in the summary."""

    start_ns: int
    end_ns: int
    offset: int
    length: int
    message_index_offsets: dict[int, int]
    message_index_bytes: int
    compression: str
    compressed_bytes: int
    uncompressed_bytes: int

    @classmethod
    def parse(cls, content: Buffer) -> ChunkIndex:
        """Read the content of a record."""
        cursor = _Cursor(content)
        where = [cursor.number(8) for _ in range(4)]
        offsets, index_bytes = cursor.numbers(2), cursor.number(8)
        sizes = cursor.text(), cursor.number(8), cursor.number(8)
        return cls(where[0], where[1], where[2], where[3], offsets, index_bytes, *sizes)

    def build(self) -> bytes:
        """Whole record."""
        where = struct.pack("<QQQQ", self.start_ns, self.end_ns, self.offset, self.length)
        index = _numbers(self.message_index_offsets) + struct.pack("<Q", self.message_index_bytes)
        sizes = struct.pack("<QQ", self.compressed_bytes, self.uncompressed_bytes)
        return record(CHUNK_INDEX, where + index + _text(self.compression) + sizes)


def message_index(
    channel_id: int, log_time_ns: npt.NDArray[np.int64], offsets: npt.NDArray[np.int64]
) -> bytes:
    """Whole MessageIndex record."""
    pairs = np.stack([log_time_ns, offsets], axis=1).astype("<i8")
    return record(MESSAGE_INDEX, struct.pack("<HI", channel_id, pairs.nbytes) + pairs.tobytes())


def message_index_count(content: Buffer) -> tuple[int, int]:
    """Channel id and number of messages of a MessageIndex record."""
    cursor = _Cursor(content)
    channel_id, size = cursor.number(2), cursor.number(4)
    cursor.take(size)
    return channel_id, size // 16


@dataclasses.dataclass(frozen=True, slots=True)
class Attachment:
    """A file inside the log.

    Attributes
    ----------
    name, media_type : str
    data : bytes
    log_time_ns, create_time_ns : int
        GPS nanoseconds; 0 where it means nothing.
    verified : bool
        Whether a checksum of its own was there and right.
    """

    name: str
    media_type: str
    data: bytes = dataclasses.field(repr=False)
    log_time_ns: int = 0
    create_time_ns: int = 0
    verified: bool = True

    @classmethod
    def parse(cls, content: Buffer) -> Attachment:
        """Read the content of a record.

        Raises
        ------
        RecordError
            Also where the checksum is there and wrong.
        """
        return cls.parse_counted(content)[0]

    @classmethod
    def parse_counted(cls, content: Buffer) -> tuple[Attachment, int]:
        """As :meth:`parse`, from bytes that may go on behind the record; how many it takes."""
        cursor = _Cursor(content)
        log_time, create_time = cursor.number(8), cursor.number(8)
        name, media_type = cursor.text(), cursor.text()
        data = bytes(cursor.take(cursor.number(8)))
        covered = cursor.content[: cursor.at]
        crc = cursor.number(4)
        if crc and crc != zlib.crc32(covered):
            raise RecordError("the checksum of the attachment is wrong")
        return cls(name, media_type, data, log_time, create_time, crc != 0), cursor.at

    def build(self) -> bytes:
        """Whole record."""
        head = struct.pack("<QQ", self.log_time_ns, self.create_time_ns) + _text(self.name)
        content = head + _text(self.media_type) + struct.pack("<Q", len(self.data)) + self.data
        return record(ATTACHMENT, content + struct.pack("<I", zlib.crc32(content)))

    def index(self, offset: int, length: int) -> bytes:
        """AttachmentIndex record for the summary."""
        numbers = (offset, length, self.log_time_ns, self.create_time_ns, len(self.data))
        names = _text(self.name) + _text(self.media_type)
        return record(ATTACHMENT_INDEX, struct.pack("<5Q", *numbers) + names)


def attachment_bytes(content: Buffer) -> int:
    """Length that an attachment's content must have after what its beginning says."""
    cursor = _Cursor(content)
    cursor.take(16)
    cursor.text()
    cursor.text()
    return cursor.number(8) + cursor.at + 4


@dataclasses.dataclass(frozen=True, slots=True)
class Metadata:
    """Named texts of the log as a whole.

    MCAP gives these records no checksum. Ours carry one among the texts, under
    `CRC_KEY`, so that they can be told from damaged ones in a file whose end is lost.
    """

    name: str
    values: dict[str, str]
    verified: bool = True

    @classmethod
    def parse(cls, content: Buffer) -> Metadata:
        """Read the content of a record.

        Raises
        ------
        RecordError
            Also where the checksum is there and wrong.
        """
        cursor = _Cursor(content)
        name, values = cursor.text(), cursor.texts()
        crc = values.pop(CRC_KEY, None)
        if crc is not None and crc != cls._crc(name, values):
            raise RecordError("the checksum of the metadata is wrong")
        return cls(name, values, crc is not None)

    @staticmethod
    def _crc(name: str, values: Mapping[str, str]) -> str:
        return f"{zlib.crc32(_text(name) + _texts(values)):08x}"

    def build(self) -> bytes:
        """Whole record."""
        values = {**self.values, CRC_KEY: self._crc(self.name, self.values)}
        return record(METADATA, _text(self.name) + _texts(values))

    def index(self, offset: int, length: int) -> bytes:
        """MetadataIndex record for the summary."""
        return record(METADATA_INDEX, struct.pack("<QQ", offset, length) + _text(self.name))


@dataclasses.dataclass(frozen=True, slots=True)
class Statistics:
    """Totals of a file."""

    message_count: int
    schema_count: int
    channel_count: int
    attachment_count: int
    metadata_count: int
    chunk_count: int
    start_ns: int
    end_ns: int
    channel_message_counts: dict[int, int]

    @classmethod
    def parse(cls, content: Buffer) -> Statistics:
        """Read the content of a record."""
        cursor = _Cursor(content)
        counts = cursor.number(8), cursor.number(2), cursor.number(4)
        others = cursor.number(4), cursor.number(4), cursor.number(4)
        return cls(*counts, *others, cursor.number(8), cursor.number(8), cursor.numbers(2))

    def build(self) -> bytes:
        """Whole record."""
        counts = (self.message_count, self.schema_count, self.channel_count)
        others = (self.attachment_count, self.metadata_count, self.chunk_count)
        fixed = struct.pack("<QHIIIIQQ", *counts, *others, self.start_ns, self.end_ns)
        return record(STATISTICS, fixed + _numbers(self.channel_message_counts))


def summary_offset(opcode: int, start: int, length: int) -> bytes:
    """Whole SummaryOffset record for a group of records."""
    return record(SUMMARY_OFFSET, struct.pack("<BQQ", opcode, start, length))
