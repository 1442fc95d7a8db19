"""Getting back what is whole of a damaged log, and saying what is not."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

from replay.errors import ExitCode, LossReport, UsageError
from replay.log.reader import LogReader
from replay.log.writer import LogWriter


@dataclasses.dataclass(frozen=True, slots=True)
class Diagnosis:
    """Health of a log.

    Attributes
    ----------
    path : Path
    file_bytes : int
    report : LossReport
        What is damaged, with byte offsets and times.
    message_counts : dict of topic to int
        Rows that can be read.
    start_ns, end_ns : int
        First and last log time that can be read.
    notes : tuple of str
        What no checksum vouches for, although nothing is known to be wrong with it.
    """

    path: Path
    file_bytes: int
    report: LossReport
    message_counts: dict[str, int]
    start_ns: int
    end_ns: int
    notes: tuple[str, ...]

    @property
    def exit_code(self) -> ExitCode:
        """3 where something is damaged, else 0."""
        return self.report.exit_code


def recover(path: str | os.PathLike[str], out: str | os.PathLike[str]) -> LossReport:
    """Write what is whole of a log to a new one.

    Every message of a chunk whose checksum is right comes back with its bytes as they
    were, and so do attachments and metadata that verify. Messages of a chunk that is
    cut off or damaged do not, because nothing would tell which of them are right.

    Parameters
    ----------
    path : path
        Of the damaged log; a whole one is copied.
    out : path
        Of the new log.

    Returns
    -------
    LossReport
        What did not come back, each with its bytes and log times. Empty for a whole log.

    Raises
    ------
    UsageError
        Where both paths are the same.
    LogError
        Where a file cannot be read or written.
    CorruptLogError
        Where nothing of it looks like a log.
    """
    if Path(out).resolve() == Path(path).resolve():
        raise UsageError("a log cannot be recovered onto itself", where=str(path))
    with LogReader(path, strict=False) as reader, LogWriter(out) as writer:
        for topic, info in reader.channels.items():
            writer.add_raw_channel(
                topic,
                schema_name=info.schema_name,
                schema_encoding=info.schema_encoding,
                schema_data=info.schema_data,
                message_encoding=info.message_encoding,
                depth=info.depth,
                metadata=info.metadata,
            )
        for metadata in reader.metadata_records:
            writer.add_metadata(metadata.name, metadata.values)
        for attachment in reader.attachments:
            writer.add_attachment(
                attachment.name,
                attachment.data,
                media_type=attachment.media_type,
                log_time_ns=attachment.log_time_ns,
                create_time_ns=attachment.create_time_ns,
            )
        for batch in reader.batches(decode=(), payloads=list(reader.channels)):
            writer.write(batch)
        return reader.report


def diagnose(path: str | os.PathLike[str]) -> Diagnosis:
    """Read a log to its end, payloads decoded, and say what is wrong with it.

    Parameters
    ----------
    path : path
        Of the log.

    Raises
    ------
    LogError
        Where the file cannot be read.
    CorruptLogError
        Where nothing of it looks like a log.
    """
    with LogReader(path, strict=False) as reader:
        counts = dict.fromkeys(reader.channels, 0)
        for batch in reader.batches():
            for topic, columns in batch.items():
                counts[topic] += len(columns)
        return Diagnosis(
            reader.path,
            reader.file_bytes,
            reader.report,
            counts,
            reader.start_ns,
            reader.end_ns,
            tuple(reader.structure.notes()),
        )
