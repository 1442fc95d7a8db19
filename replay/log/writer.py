"""Writing a log: columns in, MCAP out."""

from __future__ import annotations

import dataclasses
import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import numpy as np

from replay import channels, time
from replay.errors import DataError, LogError, MissingChannelError
from replay.log import codec, records, schema
from replay.log.chunk_builder import ChunkBuilder
from replay.log.chunks import Compression, Compressor
from replay.log.columns import Columns
from replay.log.digest import ChannelDigest, Digester
from replay.log.names import DEPTH_KEY, nearest
from replay.log.rows import Rows, compact, join_rows

LIBRARY: Final = "gnss-ins-replay"
_DRAIN_ROWS: Final = 8192  # rows that wait: below this the cost per call outweighs that per row


@dataclasses.dataclass(slots=True, eq=False)
class _Channel:
    record: records.Channel
    order: tuple[int, int, str]
    codec: codec.Codec | None
    digester: Digester
    pending: list[Rows] = dataclasses.field(default_factory=list)


class LogWriter:
    """Writes a log, in the total order (log time, depth, rank, topic, sequence).

    Bytes go to `PATH.part`, which takes the name `PATH` when the log is closed whole
    and is removed when an exception ends the `with` block.

    Rows may wait inside until later ones are written, so that rows of one log time
    are put in order although they came by several calls.

    Parameters
    ----------
    path : path
        Of the log.
    compression : "lz4", "zstd" or "none"
        Of the chunks.
    chunk_bytes : int
        Size that chunks are filled up to, before compression. A log that is cut off
        loses its last chunk, so larger ones are faster and lose more.

    Raises
    ------
    LogError
        Where the file cannot be made.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        compression: Compression = "zstd",
        chunk_bytes: int = 1 << 18,
    ) -> None:
        self.path = Path(path)
        self._part = self.path.with_name(self.path.name + ".part")
        try:
            self._file = self._part.open("wb")
        except OSError as error:
            raise LogError(f"the log cannot be written: {error}", where=str(path)) from error
        self._compress = Compressor(compression)
        self._chunk = ChunkBuilder(chunk_bytes)
        self._offset = 0
        self._crc = 0
        self._channels: dict[str, _Channel] = {}
        self._schemas: dict[tuple[str, str, bytes], records.Schema] = {}
        self._announced: set[int] = set()
        self._latest_ns = 0
        self._pending_rows = 0
        self._pending_bytes = 0
        self._chunk_indexes: list[records.ChunkIndex] = []
        self._attachment_indexes: list[bytes] = []
        self._metadata_indexes: list[bytes] = []
        self._emit(records.MAGIC)
        self._emit(records.Header("", LIBRARY).build())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.discard()

    def add_channel(
        self, topic: str, message: str, *, depth: int = 0, metadata: Mapping[str, str] | None = None
    ) -> None:
        """Announce a channel of a message of this project.

        Parameters
        ----------
        topic : str
        message : str
            Full name, such as "replay.ImuSample".
        depth : int
            Depth of the stage that makes it, 0 for what was recorded.
        metadata : mapping, optional
            Texts for the channel record.

        Raises
        ------
        SchemaError
            Where there is no such message.
        LogError
            Where the topic was announced before.
        """
        made = codec.codec_for(message)
        data = schema.descriptor_set(message)
        described = (message, schema.PROTOBUF, data)
        self._add(topic, described, schema.PROTOBUF, depth, metadata or {}, made)

    def add_raw_channel(
        self,
        topic: str,
        *,
        schema_name: str,
        schema_encoding: str,
        schema_data: bytes,
        message_encoding: str,
        depth: int = 0,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        """Announce a channel whose rows come as payloads, in whatever encoding.

        Parameters
        ----------
        topic, schema_name, schema_encoding, schema_data, message_encoding
            As MCAP's schema and channel records hold them.
        depth : int
            As in :meth:`add_channel`.
        metadata : mapping, optional
            Texts for the channel record.

        Raises
        ------
        LogError
            Where the topic was announced before.
        """
        described = (schema_name, schema_encoding, schema_data)
        self._add(topic, described, message_encoding, depth, metadata or {}, None)

    def _add(
        self,
        topic: str,
        described: tuple[str, str, bytes],
        message_encoding: str,
        depth: int,
        metadata: Mapping[str, str],
        made: codec.Codec | None,
    ) -> None:
        if topic in self._channels:
            raise LogError(f"{topic} is announced twice", where=str(self.path))
        schema_id = 0
        if described != ("", "", b""):
            if described not in self._schemas:
                self._schemas[described] = records.Schema(len(self._schemas) + 1, *described)
            schema_id = self._schemas[described].id
        texts = dict(metadata)
        if depth:
            texts[DEPTH_KEY] = str(depth)
        channel_id = len(self._channels) + 1
        if channel_id > 0xFFFF:
            raise LogError("a log holds at most 65535 channels", where=str(self.path))
        self._channels[topic] = _Channel(
            records.Channel(channel_id, schema_id, topic, message_encoding, texts),
            (depth, channels.rank(topic), topic),
            made,
            Digester(described[0]),
        )

    def write(self, batch: Mapping[str, Columns]) -> None:
        """Write rows of some channels.

        Columns that hold payloads are written as those bytes, any others are encoded.

        Parameters
        ----------
        batch : mapping of topic to Columns
            Rows in the order of their log times.

        Raises
        ------
        MissingChannelError
            Where a topic was not announced.
        DataError
            Where a log time lies before one that was written, or a column does not
            fit its field.
        """
        encoded = {topic: self._encode(topic, columns) for topic, columns in batch.items()}
        for topic, rows in encoded.items():
            if len(rows) == 0:
                continue
            self._channels[topic].pending.append(rows)
            self._latest_ns = max(self._latest_ns, int(rows.log_time_ns[-1]))
            self._pending_rows += len(rows)
            self._pending_bytes += int(rows.payloads.lengths.sum())
        if self._pending_rows >= _DRAIN_ROWS or self._pending_bytes >= self._chunk.limit_bytes:
            self._drain(before_ns=self._latest_ns)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write named texts about the log, with a checksum of their own."""
        built = records.Metadata(name, dict(values))
        at = self._offset
        self._emit(built.build())
        self._metadata_indexes.append(built.index(at, self._offset - at))

    def add_attachment(
        self,
        name: str,
        data: bytes,
        *,
        media_type: str,
        log_time_ns: int = 0,
        create_time_ns: int = 0,
    ) -> None:
        """Write a file into the log."""
        built = records.Attachment(name, media_type, data, log_time_ns, create_time_ns)
        at = self._offset
        self._emit(built.build())
        self._attachment_indexes.append(built.index(at, self._offset - at))

    def digests(self) -> dict[str, ChannelDigest]:
        """Digest of every channel, by topic, of all rows so far.

        Rows that waited for others of their log time wait no longer.
        """
        self._drain(before_ns=None)
        return {topic: self._channels[topic].digester.result() for topic in sorted(self._channels)}

    def close(self) -> None:
        """Write what waits and the summary, and give the file its name."""
        if self._file.closed:
            return
        try:
            self._drain(before_ns=None)
            if self._chunk.size or len(self._announced) < len(self._channels):
                self._flush_chunk()
            self._finish()
            self._file.close()
            self._part.replace(self.path)
        except BaseException:
            self.discard()
            raise

    def discard(self) -> None:
        """Remove what was written."""
        self._file.close()
        self._part.unlink(missing_ok=True)

    def _encode(self, topic: str, columns: Columns) -> Rows:
        channel = self._channels.get(topic)
        if channel is None:
            raise MissingChannelError(
                f"{topic} was not announced",
                where=str(self.path),
                mend=f"add_channel first{nearest(topic, self._channels)}",
            )
        log = np.ascontiguousarray(columns.log_time_ns, dtype=np.int64)
        valid = np.ascontiguousarray(columns.valid_time_ns, dtype=np.int64)
        sequence = np.ascontiguousarray(columns.sequence, dtype=np.uint32)
        if len(log) == 0:
            return Rows(log, valid, sequence, codec.NO_PAYLOADS)
        floor = np.concatenate([[self._latest_ns], log[:-1]])
        backward = log < floor
        if backward.any():
            row = int(np.argmax(backward))
            raise DataError(
                f"log time goes backward by {floor[row] - log[row]} ns",
                where=f"{topic}, row {row}, {time.to_text(int(log[row]))}",
                mend="write rows in the order of their log times",
            )
        if valid.min() < 0:
            row = int(np.argmin(valid))
            raise DataError("a valid time lies before the GPS epoch", where=f"{topic}, row {row}")
        if columns.payloads is not None:
            return Rows(log, valid, sequence, codec.checked(columns.payloads, len(log)))
        if channel.codec is None:
            raise DataError("a raw channel takes rows as payloads only", where=topic)
        return Rows(log, valid, sequence, channel.codec.encode(columns))

    def _drain(self, *, before_ns: int | None) -> None:
        """Put waiting rows into chunks: those before a log time, or all."""
        due: list[Rows] = []
        ids: list[int] = []
        for channel in sorted(self._channels.values(), key=lambda channel: channel.order):
            if not channel.pending:
                continue
            rows = join_rows(channel.pending).ordered()
            channel.pending.clear()
            if before_ns is not None:
                cut = int(np.searchsorted(rows.log_time_ns, before_ns))
                rest = rows.take(slice(cut, None))
                if len(rest):
                    own = compact(rest.payloads)
                    channel.pending.append(dataclasses.replace(rest, payloads=own))
                rows = rows.take(slice(0, cut))
            if len(rows):
                channel.digester.update(rows.log_time_ns, rows.valid_time_ns, rows.payloads)
                due.append(rows)
                ids.append(channel.record.id)
        waiting = [rows for channel in self._channels.values() for rows in channel.pending]
        self._pending_rows = sum(len(rows) for rows in waiting)
        self._pending_bytes = sum(len(rows.payloads.data) for rows in waiting)
        if due:
            self._append(due, ids)

    def _append(self, due: list[Rows], ids: list[int]) -> None:
        rows = join_rows(due)
        of = np.repeat(np.array(ids, dtype=np.uint16), [len(part) for part in due])
        # Channels stand in their order and each in its own, so a stable sort is enough.
        if len(due) == 1:
            order = np.arange(len(rows), dtype=np.int64)
        else:
            order = np.argsort(rows.log_time_ns, kind="stable").astype(np.int64)
        begin = 0
        while begin < len(order):
            taken = self._chunk.add(rows, of, order[begin:])
            begin += taken
            if taken == 0 or self._chunk.size >= self._chunk.limit_bytes:
                self._flush_chunk()

    def _flush_chunk(self) -> None:
        """Write the chunk with the definitions of its channels, so that its checksum covers them.

        Channels that were announced since the last chunk come along, so that a log
        whose end is lost still names those that had no rows yet.
        """
        used = set(self._chunk.used())
        wanted = [
            channel.record
            for channel in self._channels.values()
            if channel.record.id in used or channel.record.id not in self._announced
        ]
        schema_ids = {channel.schema_id for channel in wanted}
        schemas = [item for item in self._schemas.values() if item.id in schema_ids]
        prefix = b"".join([*(s.build() for s in schemas), *(c.build() for c in wanted)])
        self._announced |= {channel.id for channel in wanted}
        plain, first, last, indexes = self._chunk.finish(prefix)
        packed = self._compress(plain)
        at = self._offset
        self._emit(records.ChunkHead.build(first, last, plain, self._compress.name, len(packed)))
        self._emit(packed)
        length = self._offset - at
        offsets: dict[int, int] = {}
        for channel_id, index in indexes:
            offsets[channel_id] = self._offset
            self._emit(index)
        index_bytes = self._offset - at - length
        sizes = (self._compress.name, len(packed), len(plain))
        self._chunk_indexes.append(
            records.ChunkIndex(first, last, at, length, offsets, index_bytes, *sizes)
        )

    def _finish(self) -> None:
        self._emit(records.record(records.DATA_END, self._crc.to_bytes(4, "little")))
        start = self._offset
        counts = {c.record.id: c.digester.count for c in self._channels.values()}
        total = sum(counts.values())
        spans = [index for index in self._chunk_indexes if index.message_index_offsets]
        statistics = records.Statistics(
            total,
            len(self._schemas),
            len(self._channels),
            len(self._attachment_indexes),
            len(self._metadata_indexes),
            len(self._chunk_indexes),
            min((index.start_ns for index in spans), default=0),
            max((index.end_ns for index in spans), default=0),
            {channel_id: count for channel_id, count in counts.items() if count},
        )
        groups: list[tuple[int, list[bytes]]] = [
            (records.SCHEMA, [item.build() for item in self._schemas.values()]),
            (records.CHANNEL, [channel.record.build() for channel in self._channels.values()]),
            (records.STATISTICS, [statistics.build()]),
            (records.CHUNK_INDEX, [index.build() for index in self._chunk_indexes]),
            (records.ATTACHMENT_INDEX, self._attachment_indexes),
            (records.METADATA_INDEX, self._metadata_indexes),
        ]
        summary, offsets = b"", b""
        for opcode, group in groups:
            body = b"".join(group)
            if body:
                offsets += records.summary_offset(opcode, start + len(summary), len(body))
            summary += body
        footer = records.Footer.build(summary + offsets, start, start + len(summary))
        self._emit(summary + offsets + footer + records.MAGIC)

    def _emit(self, data: bytes | memoryview) -> None:
        try:
            self._file.write(data)
        except OSError as error:
            raise LogError(f"the log cannot be written: {error}", where=str(self._part)) from error
        self._crc = zlib.crc32(data, self._crc)
        self._offset += len(data)
