"""What is in a log: per channel how many, how often, where not, and what is odd."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

from replay.errors import LossReport
from replay.log import _scan
from replay.log.columns import Columns
from replay.log.digest import ChannelDigest, Digester
from replay.log.reader import CompressionStats, LogReader

_Int64 = npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, slots=True)
class ChannelDescription:
    """One channel of a log.

    Attributes
    ----------
    topic, schema : str
    depth : int
        Depth of the stage that made it.
    digest : ChannelDigest
        With the number of rows.
    log_span_ns, valid_span_ns : (int, int)
        First and last time; zeros where there is no row.
    median_interval_ns : int
        Between valid times that differ; 0 where there are fewer than two.
    gaps_ns : int64 array (m, 2)
        Valid times between which there is no row for more than some medians.
    backward : int
        Rows whose valid time lies before that of the row before.
    duplicates : int
        Rows that repeat the valid time and the payload of another.
    not_finite : dict of field name to int
        Rows in which a floating-point field that is present holds a NaN or an infinity.
    undecodable : str
        Why values cannot be decoded; empty where they can.
    """

    topic: str
    schema: str
    depth: int
    digest: ChannelDigest
    log_span_ns: tuple[int, int]
    valid_span_ns: tuple[int, int]
    median_interval_ns: int
    gaps_ns: _Int64
    backward: int
    duplicates: int
    not_finite: dict[str, int]
    undecodable: str

    @property
    def rate_hz(self) -> float:
        """Inverse of the median interval, 0 where there is none."""
        return 1e9 / self.median_interval_ns if self.median_interval_ns else 0.0


@dataclasses.dataclass(frozen=True, slots=True)
class LogDescription:
    """A whole log.

    Attributes
    ----------
    path : Path
    file_bytes : int
    library : str
        What the file says wrote it.
    channels : tuple of ChannelDescription
        In the order of topics.
    compression : dict of str to CompressionStats
    metadata : dict of str to dict
    attachments : tuple of (str, str, int)
        Name, media type and bytes of each.
    notes : tuple of str
        What no checksum vouches for.
    report : LossReport
        What is damaged.
    """

    path: Path
    file_bytes: int
    library: str
    channels: tuple[ChannelDescription, ...]
    compression: dict[str, CompressionStats]
    metadata: dict[str, dict[str, str]]
    attachments: tuple[tuple[str, str, int], ...]
    notes: tuple[str, ...]
    report: LossReport


class _Gatherer:
    """Notes of one channel while its rows go by: 16 bytes a row."""

    def __init__(self, schema: str) -> None:
        self.digester = Digester(schema)
        self.log_span: tuple[int, int] | None = None
        self.valid: list[_Int64] = []
        self.hashes: list[npt.NDArray[np.uint64]] = []
        self.not_finite: dict[str, int] = {}

    def add(self, columns: Columns) -> None:
        payloads = columns.payloads
        if payloads is None:
            raise ValueError("the payloads are needed")
        log, valid = columns.log_time_ns, columns.valid_time_ns
        self.digester.update(log, valid, payloads)
        first = int(log[0]) if self.log_span is None else self.log_span[0]
        self.log_span = (first, int(log[-1]))
        self.valid.append(valid)
        hashes = np.empty(len(valid), dtype=np.uint64)
        _scan.hash_rows(valid, payloads.offsets, payloads.lengths, payloads.data, hashes)
        self.hashes.append(hashes)
        for name, column in columns.values.items():
            # Of a ragged column the values stand for its rows: enough to see that there are some.
            values = np.asarray(column if isinstance(column, np.ndarray) else column.values)
            if values.dtype.kind != "f":
                continue
            odd = ~np.isfinite(values)
            if isinstance(column, np.ndarray):
                odd = odd.reshape(len(columns), -1).any(axis=1) & columns.is_present(name)
            count = int(np.count_nonzero(odd))
            if count:
                self.not_finite[name] = self.not_finite.get(name, 0) + count


def describe(path: str | os.PathLike[str], *, gap_factor: float = 3.0) -> LogDescription:
    """Read a log to its end and describe it; damage is part of the description.

    Parameters
    ----------
    path : path
        Of the log.
    gap_factor : float
        An interval of more than so many medians is a gap.

    Raises
    ------
    LogError
        Where the file cannot be read.
    CorruptLogError
        Where nothing of it looks like a log.
    """
    with LogReader(path, strict=False) as reader:
        gatherers = {t: _Gatherer(info.schema_name) for t, info in reader.channels.items()}
        for batch in reader.batches(payloads=list(reader.channels)):
            for topic, columns in batch.items():
                gatherers[topic].add(columns)
        return LogDescription(
            reader.path,
            reader.file_bytes,
            reader.structure.header.library,
            tuple(_channel(reader, topic, gatherers[topic], gap_factor) for topic in gatherers),
            reader.compression,
            reader.metadata,
            tuple((a.name, a.media_type, len(a.data)) for a in reader.attachments),
            tuple(reader.structure.notes()),
            reader.report,
        )


def _channel(
    reader: LogReader, topic: str, gathered: _Gatherer, gap_factor: float
) -> ChannelDescription:
    info = reader.channels[topic]
    valid = np.concatenate([np.empty(0, dtype=np.int64), *gathered.valid])
    times = np.unique(valid)
    intervals = np.diff(times)
    median = int(np.median(intervals)) if len(intervals) else 0
    wide = np.flatnonzero(intervals > gap_factor * median)
    hashes = np.concatenate([np.empty(0, dtype=np.uint64), *gathered.hashes])
    return ChannelDescription(
        topic,
        info.schema_name,
        info.depth,
        gathered.digester.result(),
        gathered.log_span or (0, 0),
        (int(times[0]), int(times[-1])) if len(times) else (0, 0),
        median,
        np.stack([times[wide], times[wide + 1]], axis=1) if len(wide) else _NO_GAPS,
        int(np.count_nonzero(np.diff(valid) < 0)),
        len(hashes) - len(np.unique(hashes)),
        gathered.not_finite,
        info.undecodable,
    )


_NO_GAPS = np.empty((0, 2), dtype=np.int64)
