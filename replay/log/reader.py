"""Reading a log: MCAP in, columns out."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator, Mapping, Sequence
from types import TracebackType
from typing import NoReturn, Self

import numpy as np

from replay.errors import CorruptLogError, LossReport, MissingChannelError, SchemaError
from replay.log import merge, records
from replay.log.channel_info import ChannelInfo, describe_channels
from replay.log.codec import FAULTS, NO_PAYLOADS, Codec
from replay.log.columns import Column, Columns, concatenate
from replay.log.digest import ChannelDigest, Digester
from replay.log.names import moment, nearest
from replay.log.rows import Rows, compact
from replay.log.salvage import read_damaged
from replay.log.source import Block, DamageError, Loaded, Source, load
from replay.log.structure import Structure, count_block, read_structure


@dataclasses.dataclass(frozen=True, slots=True)
class CompressionStats:
    """Chunks of one compression.

    Attributes
    ----------
    chunks : int
    compressed_bytes, uncompressed_bytes : int
    """

    chunks: int
    compressed_bytes: int
    uncompressed_bytes: int


class LogReader:
    """Reads a log; also one that this project did not write.

    Parameters
    ----------
    path : path
        Of the log.
    check_crc : bool
        Whether checksums are compared. Leave it on: it costs a few percent.
    strict : bool
        Whether damage raises. Otherwise what is whole is read and what is lost is in
        `report`.

    Attributes
    ----------
    channels : mapping of topic to ChannelInfo
        In the order of topics.
    metadata_records : list of Metadata
        `metadata` as it stands in the log, where a name may occur twice.
    attachments : list of Attachment
    report : LossReport
        What was lost so far; rows that are no protobuf are found when they are read.
    start_ns, end_ns : int
        First and last log time, 0 where there is no message.
    structure : Structure
        Blocks, checksums and definitions of the file.

    Raises
    ------
    LogError
        Where the file cannot be read at all.
    CorruptLogError
        Where it is damaged, and `strict`.
    SchemaError
        Where one topic carries two kinds of message.
    """

    def __init__(
        self, path: str | os.PathLike[str], *, check_crc: bool = True, strict: bool = True
    ) -> None:
        self.report = LossReport()
        self.strict = strict
        self._check_crc = check_crc
        self._source = Source(path)
        self.path = self._source.path
        try:
            self.structure = self._read_structure()
            self.channels = describe_channels(self.structure, self._lose_kind)
        except BaseException:
            self._source.close()
            raise
        self.metadata_records = self.structure.metadata
        self.attachments = self.structure.attachments
        self.start_ns, self.end_ns = self.structure.span_ns()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the file back."""
        self._source.close()

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """Named texts of the log; of two records of one name the later counts."""
        return {record.name: record.values for record in self.metadata_records}

    @property
    def file_bytes(self) -> int:
        """Size of the file."""
        return self._source.size

    @property
    def compression(self) -> dict[str, CompressionStats]:
        """Chunks by their compression: "lz4", "zstd", "none"."""
        found: dict[str, CompressionStats] = {}
        for block in self.structure.blocks:
            if block.head is not None:
                name = block.head.compression or "none"
                so_far = found.get(name, CompressionStats(0, 0, 0))
                found[name] = CompressionStats(
                    so_far.chunks + 1,
                    so_far.compressed_bytes + block.head.compressed_bytes,
                    so_far.uncompressed_bytes + block.head.uncompressed_bytes,
                )
        return found

    def batches(
        self,
        topics: Sequence[str] | None = None,
        *,
        decode: Sequence[str] | None = None,
        payloads: Sequence[str] = (),
        start_ns: int | None = None,
        end_ns: int | None = None,
        target_rows: int = 65536,
    ) -> Iterator[dict[str, Columns]]:
        """Rows in the order of log time, in bounded memory.

        Parameters
        ----------
        topics : sequence of str, optional
            Channels to read, all by default.
        decode : sequence of str, optional
            Channels whose values are decoded, by default all that can be.
        payloads : sequence of str
            Channels whose payloads are kept; those that cannot be decoded always are.
        start_ns, end_ns : int, optional
            Log times, half open.
        target_rows : int
            Rows of a batch, of all channels together. Rows of one log time stay
            together even where they are more.

        Yields
        ------
        dict of topic to Columns
            Channels that have rows, in the order of topics. Every row precedes those
            of the next batch by log time.

        Raises
        ------
        MissingChannelError
            Where the log lacks a topic.
        SchemaError
            Where a topic of `decode` cannot be decoded.
        CorruptLogError
            Where a block or a payload is damaged, and `strict`.
        """
        if target_rows < 1:
            raise ValueError("a batch has one row at least")
        wanted = list(self.channels) if topics is None else [self.channel(t).topic for t in topics]
        codecs = self._codecs(wanted, decode)
        for topic in payloads:
            self.channel(topic)
        keep = {t for t in wanted if t in payloads or self.channels[t].codec is None}
        for pieces in self._pieces(wanted, start_ns, end_ns, target_rows):
            batch = {
                topic: self._columns(topic, rows, codecs.get(topic), topic in keep)
                for topic, rows in pieces.items()
            }
            yield {topic: columns for topic, columns in batch.items() if len(columns)}

    def read(
        self,
        topic: str,
        *,
        payloads: bool = False,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> Columns:
        """All rows of one channel.

        Parameters
        ----------
        topic : str
        payloads : bool
            Whether the payloads are kept.
        start_ns, end_ns : int, optional
            Log times, half open.

        Raises
        ------
        MissingChannelError, CorruptLogError
            As :meth:`batches`.
        """
        keep = [topic] if payloads else []
        parts = [
            batch[topic]
            for batch in self.batches(
                [topic], payloads=keep, start_ns=start_ns, end_ns=end_ns, target_rows=1 << 18
            )
            if topic in batch
        ]
        if parts:
            return concatenate(parts)
        info = self.channels[topic]
        none = [_NO_ROWS]
        return self._columns(topic, none, info.codec, payloads or info.codec is None)

    def digests(self) -> dict[str, ChannelDigest]:
        """Digest of every channel, by topic, in one pass."""
        digesters = {t: Digester(info.schema_name) for t, info in self.channels.items()}
        for pieces in self._pieces(list(self.channels), None, None, 65536):
            for topic, parts in pieces.items():
                for rows in parts:
                    digesters[topic].update(rows.log_time_ns, rows.valid_time_ns, rows.payloads)
        return {topic: digester.result() for topic, digester in digesters.items()}

    def channel(self, topic: str) -> ChannelInfo:
        """Channel of a topic.

        Raises
        ------
        MissingChannelError
            Where the log lacks it; the nearest is named.
        """
        try:
            return self.channels[topic]
        except KeyError:
            raise MissingChannelError(
                f"the log has no channel {topic}{nearest(topic, self.channels)}",
                where=str(self.path),
                mend=f"it has {', '.join(self.channels) or 'none'}",
            ) from None

    def _codecs(self, wanted: Sequence[str], decode: Sequence[str] | None) -> dict[str, Codec]:
        if decode is None:
            chosen = [topic for topic in wanted if self.channels[topic].codec is not None]
        else:
            chosen = [self.channel(topic).topic for topic in decode]
        found = {}
        for topic in chosen:
            info = self.channels[topic]
            if info.codec is None:
                raise SchemaError(
                    f"{topic} cannot be decoded: {info.undecodable}",
                    where=str(self.path),
                    mend="read it as payloads",
                )
            found[topic] = info.codec
        return found

    def _pieces(
        self, wanted: Sequence[str], start_ns: int | None, end_ns: int | None, target_rows: int
    ) -> Iterator[merge.Pieces]:
        topic_of = {i: topic for topic in wanted for i in self.channels[topic].ids}
        return merge.stream(
            self.structure.blocks,
            self._load,
            topic_of,
            start_ns=start_ns,
            end_ns=end_ns,
            target_rows=target_rows,
        )

    def _load(self, block: Block) -> Loaded | None:
        try:
            return load(self._source, block, check_crc=self._check_crc)
        except DamageError as damage:
            if self.strict:
                ends = [b.end_ns for b in self.structure.blocks if b.end_ns < block.start_ns]
                self._raise(damage, damage.offset, max(ends, default=0))
            self._report(damage, block)
            return None

    def _columns(self, topic: str, parts: list[Rows], codec: Codec | None, keep: bool) -> Columns:
        made = [self._decode(topic, rows, codec, keep) for rows in parts]
        return made[0] if len(made) == 1 else concatenate(made)

    def _decode(self, topic: str, rows: Rows, codec: Codec | None, keep: bool) -> Columns:
        values: Mapping[str, Column] = {}
        present: Mapping[str, np.ndarray[tuple[int, ...], np.dtype[np.bool_]]] = {}
        bad = None
        if codec is not None:
            decoded = codec.decode(rows.payloads)
            values, present = decoded.values, decoded.present
            bad = decoded.bad if decoded.bad.any() else None
        payloads = compact(rows.payloads) if keep else None
        columns = Columns(
            rows.log_time_ns, rows.valid_time_ns, rows.sequence, values, present, payloads
        )
        if bad is None:
            return columns
        row = int(np.argmax(bad))
        what = f"{np.count_nonzero(bad)} payloads are no {self.channels[topic].schema_name}"
        why = f"the first: {FAULTS[int(bad[row])]}"
        at = moment(int(rows.log_time_ns[row]))
        if self.strict:
            raise CorruptLogError(
                f"{what} ({why})",
                where=f"{self.path}, {topic}, log time {at}, sequence {rows.sequence[row]}",
                mend="read with strict=False to leave them out",
            )
        self.report.add(
            f"{what} ({why})", where=f"{topic} from {at}", count=int((bad != 0).sum()), unit="rows"
        )
        return columns.take(bad == 0)

    def _read_structure(self) -> Structure:
        try:
            structure = read_structure(self._source, check_crc=self._check_crc)
        except DamageError as damage:
            return self._read_damaged(damage)
        if structure.complete and (self.strict or structure.verified):
            return structure
        structure.message_counts = {}
        blocks, structure.blocks = structure.blocks, []
        for block in blocks:
            try:
                counted = count_block(self._source, structure, block, check_crc=self._check_crc)
                structure.blocks.append(counted)
            except DamageError as damage:
                if self.strict:
                    ends = [good.end_ns for good in structure.blocks]
                    self._raise(damage, damage.offset, max(ends, default=0))
                self._report(damage, block)
        self._check_definitions(structure)
        return structure

    def _read_damaged(self, damage: DamageError) -> Structure:
        salvaged = read_damaged(self._source, damage)
        structure = salvaged.structure
        nothing = not (structure.blocks or structure.metadata or structure.attachments)
        if self.strict or (nothing and bytes(self._source.view[:8]) != records.MAGIC):
            # The checksum of a section only says that something in it is wrong.
            self._raise(damage, salvaged.first_offset, salvaged.last_good_ns)
        self.report.losses += salvaged.report(self.path).losses
        return structure

    def _check_definitions(self, structure: Structure) -> None:
        counts = structure.message_counts
        for channel_id in sorted(counts.keys() - structure.definitions.channels.keys()):
            what = f"nothing defines channel {channel_id}, which has messages"
            if self.strict:
                self._raise(DamageError(what, 8), 8, 0)
            count = counts.pop(channel_id)
            self.report.add(what, where=f"{self.path}", count=count, unit="messages")

    def _lose_kind(self, topic: str, count: int) -> None:
        what = f"{topic} carries two kinds of message"
        if self.strict:
            mend = "read with strict=False to keep the first"
            raise SchemaError(what, where=str(self.path), mend=mend)
        self.report.add(f"{what}; the first is kept", where=topic, count=count, unit="messages")

    def _report(self, damage: DamageError, block: Block) -> None:
        span = f"{moment(block.start_ns)} to {moment(block.end_ns)}"
        self.report.add(
            f"a block of messages is lost: {damage.what}",
            where=f"{self.path}, byte {damage.offset}, {span}",
            count=block.length,
            unit="bytes",
        )

    def _raise(self, damage: DamageError, offset: int, last_good_ns: int) -> NoReturn:
        until = moment(last_good_ns) if last_good_ns else "none"
        raise CorruptLogError(
            damage.what,
            where=f"{self.path}, byte {offset}, last good log time {until}",
            mend=f"replay recover {self.path} keeps what is whole",
        ) from damage


_NO_ROWS = Rows(
    np.empty(0, dtype=np.int64),
    np.empty(0, dtype=np.int64),
    np.empty(0, dtype=np.uint32),
    NO_PAYLOADS,
)
