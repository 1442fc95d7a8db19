"""Where a run's rows go: into a log, or into digests alone."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

from replay.errors import UsageError
from replay.log.channel_info import ChannelInfo
from replay.log.columns import Columns
from replay.log.digest import ChannelDigest, Digester


class Sink(Protocol):
    """Where rows go: a log, or digests alone."""

    def add_channel(self, topic: str, message: str, *, depth: int = 0) -> None:
        """Announce a channel of this project."""

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
        """Announce a channel whose rows are payloads."""

    def write(self, batch: Mapping[str, Columns]) -> None:
        """Take rows."""

    def digests(self) -> dict[str, ChannelDigest]:
        """Digest per topic so far."""


class DigestSink:
    """Keeps no row, only the digest of each channel: all that a verification needs."""

    def __init__(self) -> None:
        self._digesters: dict[str, Digester] = {}

    def add_channel(self, topic: str, message: str, *, depth: int = 0) -> None:
        """Announce a channel of this project."""
        del depth
        self._digesters[topic] = Digester(message)

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
        """Announce a channel whose rows are payloads."""
        del schema_encoding, schema_data, message_encoding, depth, metadata
        self._digesters[topic] = Digester(schema_name)

    def write(self, batch: Mapping[str, Columns]) -> None:
        """Digest rows; they must hold payloads."""
        for topic, rows in batch.items():
            if rows.payloads is None:
                raise ValueError(f"rows of {topic} hold no payloads")
            self._digesters[topic].update(rows.log_time_ns, rows.valid_time_ns, rows.payloads)

    def digests(self) -> dict[str, ChannelDigest]:
        """Digest per topic so far."""
        return {topic: d.result() for topic, d in sorted(self._digesters.items())}


def announce_as_recorded(sink: Sink, topic: str, info: ChannelInfo) -> None:
    """Announce a channel that passes through untouched."""
    sink.add_raw_channel(
        topic,
        schema_name=info.schema_name,
        schema_encoding=info.schema_encoding,
        schema_data=info.schema_data,
        message_encoding=info.message_encoding,
        depth=info.depth,
        metadata=info.metadata,
    )


def require_another_file(source: Path, target: Path) -> None:
    """Refuse to write a log onto the one that it is made from.

    Raises
    ------
    UsageError
    """
    if Path(source).resolve() == Path(target).resolve():
        raise UsageError("a log cannot be written onto its own input", where=str(target))
