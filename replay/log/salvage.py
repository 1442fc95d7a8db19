"""What is whole in a log that is not.

Nothing is taken that no checksum vouches for: chunks and attachments by their own,
metadata by the one that our writer puts into it, everything where that of the data
section is right. Messages and definitions outside chunks have none, so they are lost
where the data section's cannot be checked. So is a chunk that is cut off: what could be
decompressed of it is not covered.

A record whose own length agrees with the lengths inside it is believed to reach as far
as it says even where its content is damaged, so that a log inside an attachment is not
mistaken for this one. Everything else is searched for records byte by byte.
"""

from __future__ import annotations

import dataclasses
from typing import Final

from replay.errors import LossReport
from replay.log import _scan, records
from replay.log.names import moment
from replay.log.source import Block, DamageError, Loaded, Source, open_chunk
from replay.log.structure import (
    Structure,
    Summary,
    count_block,
    data_crc,
    entries,
    read_summary,
    take_entry,
)

_SELF_CONSISTENT: Final = (records.CHUNK, records.ATTACHMENT, records.METADATA)
_NAMES: Final = {
    records.CHUNK: "a chunk",
    records.ATTACHMENT: "an attachment",
    records.METADATA: "metadata",
}


@dataclasses.dataclass(frozen=True, slots=True)
class Lost:
    """Something of a file that did not come back.

    Attributes
    ----------
    what : str
    offset, length : int
        Bytes of the file.
    count : int
        Of `unit`.
    unit : str
        "messages" or "bytes".
    start_ns, end_ns : int or None
        Log times that it states; nothing vouches for them.
    """

    what: str
    offset: int
    length: int
    count: int
    unit: str
    start_ns: int | None = None
    end_ns: int | None = None

    def place(self) -> str:
        """Where it is, for a person."""
        where = f"bytes {self.offset} to {self.offset + self.length}"
        if self.start_ns is None or self.end_ns is None:
            return where
        return f"{where}, log times {moment(self.start_ns)} to {moment(self.end_ns)}"


@dataclasses.dataclass(slots=True)
class Salvaged:
    """What came back and what did not.

    Attributes
    ----------
    structure : Structure
        Of verified pieces only.
    lost : list of Lost
        In the order of the file; never empty.
    """

    structure: Structure
    lost: list[Lost]

    @property
    def first_offset(self) -> int:
        """First damaged byte that could be made out."""
        return min(lost.offset for lost in self.lost)

    @property
    def last_good_ns(self) -> int:
        """Last log time before the first damage, 0 where there is none."""
        before = self.first_offset
        ends = [block.end_ns for block in self.structure.blocks if block.offset < before]
        return max(ends, default=0)

    def report(self, path: object) -> LossReport:
        """The losses as a report."""
        report = LossReport()
        for lost in self.lost:
            where = f"{path}, {lost.place()}"
            report.add(lost.what, where=where, count=lost.count, unit=lost.unit)
        return report


def read_damaged(source: Source, damage: DamageError) -> Salvaged:
    """Everything of a damaged file that a checksum vouches for.

    Parameters
    ----------
    source : Source
    damage : DamageError
        What was found to be wrong.
    """
    summary = _verified_summary(source)
    walk = _Walk(source, summary)
    if not walk.take_all_if_verified():
        walk.run()
    structure = walk.structure
    if summary is not None:
        for opcode, content, place in summary.definitions:
            _define(walk, opcode, content, place)
    _count(walk)
    if summary is not None and summary.statistics is not None:
        _compare_total(walk, summary.statistics.message_count)
    if not walk.lost:
        what = f"{damage.what}; all messages are there"
        walk.lost.append(Lost(what, damage.offset, 0, 0, "bytes"))
    walk.lost.sort(key=lambda lost: lost.offset)
    return Salvaged(structure, walk.lost)


def _verified_summary(source: Source) -> Summary | None:
    try:
        summary = read_summary(source, check_crc=True)
    except DamageError:
        return None
    return summary if summary.verified else None


def _define(walk: _Walk, opcode: int, content: bytes, offset: int) -> None:
    try:
        walk.structure.definitions.add(opcode, content, offset)
    except DamageError as damage:
        walk.lost.append(Lost(damage.what, offset, len(content), len(content), "bytes"))


def _count(walk: _Walk) -> None:
    """Drop the counts of channels that nothing defines any more, and report them."""
    counts, defined = walk.structure.message_counts, walk.structure.definitions.channels
    for channel_id in sorted(counts.keys() - defined.keys()):
        what = f"the definition of channel {channel_id} is lost, and with it its messages"
        walk.lost.append(Lost(what, 8, 0, counts.pop(channel_id), "messages"))


def _compare_total(walk: _Walk, due: int) -> None:
    """Report messages that are missing and that no index behind a lost chunk counted."""
    missing = due - sum(walk.structure.message_counts.values())
    counted = sum(lost.count for lost in walk.lost if lost.unit == "messages")
    if missing > counted:
        what = "messages that the summary counts and that did not come back"
        walk.lost.append(Lost(what, 8, walk.end - 8, missing - counted, "messages"))


class _Walk:
    """Goes through the data section from firm record to firm record."""

    def __init__(self, source: Source, summary: Summary | None) -> None:
        self.source = source
        self.summary = summary
        self.end = source.size if summary is None else summary.start
        self.structure = Structure(records.Header("", ""))
        self.lost: list[Lost] = []
        self.firm_end = 8  # behind the last record that is believed to reach as far as it says

    def take_all_if_verified(self) -> bool:
        """Take every record where the damage lies behind a data section that is right."""
        found, stop = entries(self.source, 8, self.end)
        if not found or found[-1].opcode != records.DATA_END:
            return False
        last = found[-1]
        crc = int.from_bytes(self.source.content(last.offset, last.length)[:4], "little")
        if crc == 0 or data_crc(self.source, last.offset) != crc:
            return False
        unknown = Summary(stop, verified=False)
        structure = self.structure
        structure.verified = True
        for entry in found[1:-1]:
            try:
                take_entry(self.source, structure, unknown, entry)
            except DamageError as damage:
                self.lost.append(
                    Lost(damage.what, entry.offset, entry.length, entry.length, "bytes")
                )
        blocks, structure.blocks = structure.blocks, []
        for block in blocks:
            try:
                structure.blocks.append(count_block(self.source, structure, block))
            except DamageError as damage:
                size = block.length
                self.lost.append(Lost(damage.what, block.offset, size, size, "bytes"))
        return True

    def run(self) -> None:
        """Walk to the end of the data section."""
        p = 8
        while p < self.end and not self._is_data_end(p):
            after = self._step(p)
            if after is None:
                found = self._search(max(self.firm_end, p + 1 if p == self.firm_end else 0))
                if found < 0:
                    break
                after = found
                self._lose("bytes that are no record", self.firm_end, found)
                self.firm_end = found
            p = after
        if p < self.end and not self._is_data_end(p):
            self._lose("the rest of the file is no whole record", p, self.end)
        elif p >= self.end and self.summary is None:
            self._lose("the end of the file is missing", self.source.size, self.source.size)

    def _is_data_end(self, p: int) -> bool:
        return self._head(p) == (records.DATA_END, 4)

    def _head(self, p: int) -> tuple[int, int]:
        if p + records.HEAD.size > self.source.size:
            return 0, 0
        opcode, length = records.HEAD.unpack_from(self.source.view, p)
        return int(opcode), int(length)

    def _plausible(self, p: int) -> bool:
        """Whether a record may begin here."""
        if p == self.end:
            return True
        opcode, length = self._head(p)
        known = 0 < opcode <= records.DATA_END or opcode >= 0x80
        fits = length <= self.source.size - p - records.HEAD.size
        return (known and fits) or self._cut_off(p)

    def _search(self, start: int) -> int:
        return int(_scan.find_record(self.source.array, start, self.end, self.end))

    def _step(self, p: int) -> int | None:
        """Take the record at `p`; where the next one begins, or None where that is unknown."""
        opcode, length = self._head(p)
        framed_end = p + records.HEAD.size + length
        inner_end = self._chunk(p, opcode, framed_end)
        if inner_end is None and opcode == records.ATTACHMENT:
            inner_end = self._attachment(p)
        if inner_end is None and opcode == records.METADATA:
            inner_end = self._metadata(p, framed_end)
        if inner_end is not None:
            self._search_between(self.firm_end, p)
            self.firm_end = inner_end
            return inner_end
        if _scan.find_record(self.source.array, p, p + 1, self.end) == p or self._cut_off(p):
            self._lose_record(p, min(framed_end, self.end))
            self.firm_end = min(framed_end, self.end)
            return self.firm_end
        if not self._plausible(framed_end) or opcode == 0:
            return None
        if opcode == records.MESSAGE:
            self._lose_message(p, framed_end)
            self.firm_end = framed_end
        elif opcode in _SELF_CONSISTENT:
            self._lose_record(p, framed_end)
        return framed_end

    def _search_between(self, start: int, stop: int) -> None:
        """Take chunks that a damaged length led past."""
        p = start
        while (p := int(_scan.find_record(self.source.array, p, stop, stop))) >= 0:
            after = self._chunk(p, *self._framed(p))
            p = p + 1 if after is None else after

    def _framed(self, p: int) -> tuple[int, int]:
        opcode, length = self._head(p)
        return opcode, p + records.HEAD.size + length

    def _chunk(self, p: int, opcode: int, framed_end: int) -> int | None:
        """Take a chunk that its checksum vouches for; where it ends.

        Opcode or record length may be damaged, one of them, without harm.
        """
        try:
            head = records.ChunkHead.parse(self.source.view[p + records.HEAD.size : self.end])
        except records.RecordError:
            return None
        inner_end = p + records.HEAD.size + head.head_bytes + head.compressed_bytes
        if (opcode != records.CHUNK and framed_end != inner_end) or inner_end > self.end:
            return None
        if head.crc == 0 or (self.summary and self.summary.chunks and not self._listed(p)):
            return None
        try:
            loaded = open_chunk(self.source, p, head, check_crc=True)
        except DamageError:
            return None
        self._add(p, inner_end, head, loaded)
        return inner_end

    def _listed(self, p: int) -> bool:
        return self.summary is not None and p in self.summary.chunks

    def _add(self, p: int, end: int, head: records.ChunkHead, loaded: Loaded) -> None:
        times = loaded.rows.log_time_ns
        span = (int(times.min()), int(times.max())) if len(times) else (0, 0)
        block = Block(p, end - p, *span, head)
        for opcode, content in loaded.definitions:
            _define(self, opcode, content, p)
        self.structure.blocks.append(count_block(self.source, self.structure, block, loaded))

    def _attachment(self, p: int) -> int | None:
        content = self.source.view[p + records.HEAD.size : self.end]
        try:
            attachment, used = records.Attachment.parse_counted(content)
        except records.RecordError:
            return None
        if not attachment.verified:
            return None
        self.structure.attachments.append(attachment)
        return p + records.HEAD.size + used

    def _metadata(self, p: int, framed_end: int) -> int | None:
        try:
            metadata = records.Metadata.parse(
                self.source.view[p + records.HEAD.size : min(framed_end, self.end)]
            )
        except records.RecordError:
            return None
        if not metadata.verified:
            return None
        self.structure.metadata.append(metadata)
        return framed_end

    def _cut_off(self, p: int) -> bool:
        """Whether a chunk or attachment that agrees with itself runs past the end of the file."""
        opcode, length = self._head(p)
        content = self.source.view[p + records.HEAD.size :]
        if length <= len(content):
            return False
        try:
            if opcode == records.CHUNK:
                head = records.ChunkHead.parse(content)
                return head.head_bytes + head.compressed_bytes == length
            return opcode == records.ATTACHMENT and records.attachment_bytes(content) == length
        except records.RecordError:
            return False

    def _lose(self, what: str, start: int, end: int) -> None:
        self.lost.append(Lost(what, start, end - start, end - start, "bytes"))

    def _lose_message(self, p: int, end: int) -> None:
        """Count a message outside chunks, together with those before it."""
        what = "messages outside chunks, which have no checksum of their own"
        last = self.lost[-1] if self.lost else None
        if last is not None and last.what == what and last.offset + last.length == p:
            self.lost[-1] = dataclasses.replace(
                last, length=end - last.offset, count=last.count + 1
            )
        else:
            self.lost.append(Lost(what, p, end - p, 1, "messages"))

    def _lose_record(self, p: int, end: int) -> None:
        opcode = self.source.opcode(p)
        what = f"{_NAMES[opcode]} whose checksum is wrong or missing"
        if opcode != records.CHUNK:
            self._lose(what, p, end)
            return
        try:
            head = records.ChunkHead.parse(self.source.view[p + records.HEAD.size :])
        except records.RecordError:
            self._lose(what, p, end)
            return
        count = self._indexed(end)
        unit = "messages" if count else "bytes"
        span = (head.start_ns, head.end_ns)
        self.lost.append(Lost(what, p, end - p, count or end - p, unit, *span))

    def _indexed(self, p: int) -> int:
        """Messages that the index records behind a chunk list."""
        total = 0
        while p < self.end and self._head(p)[0] == records.MESSAGE_INDEX and self._plausible(p):
            after = p + records.HEAD.size + self._head(p)[1]
            try:
                total += records.message_index_count(self.source.content(p, after - p))[1]
            except records.RecordError:
                break
            p = after
        return total
