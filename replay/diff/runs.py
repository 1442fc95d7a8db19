"""What the comparison asks of a run, answered by a log file or by columns in memory."""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Iterator, Mapping
from typing import Final, Protocol

from google.protobuf import json_format

from replay.channels import find
from replay.errors import DataError
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.schemas.replay_pb2 import Manifest

MANIFEST_RECORD: Final = "replay.manifest"
MANIFEST_KEY: Final = "json"


class Run(Protocol):
    """A run to be compared: what it holds, and the rows of one channel at a time."""

    @property
    def path(self) -> str:
        """What a person calls it."""

    @property
    def schemas(self) -> Mapping[str, str]:
        """Topic to full name of the message."""

    @property
    def manifest(self) -> Manifest | None:
        """What the run was made from, where it says."""

    def count(self, topic: str) -> int:
        """Rows of a channel."""

    def digest(self, topic: str) -> str | None:
        """Digest of a channel's times and payloads, where it is known without its fields."""

    def read(self, topic: str) -> Columns:
        """Rows of a channel."""


@dataclasses.dataclass(frozen=True, slots=True)
class MemoryRun:
    """A run of columns in memory.

    Attributes
    ----------
    path : str
    channels : mapping of topic to Columns
    schemas : mapping of topic to str
        Left empty, it follows from the table of channels.
    manifest : Manifest or None
    """

    path: str
    channels: Mapping[str, Columns]
    schemas: Mapping[str, str] = dataclasses.field(default_factory=dict)
    manifest: Manifest | None = None

    def __post_init__(self) -> None:
        """Name the message of each topic by the table of channels."""
        if not self.schemas:
            specs = {topic: find(topic) for topic in self.channels}
            names = {topic: spec.message if spec else "" for topic, spec in specs.items()}
            object.__setattr__(self, "schemas", names)

    def count(self, topic: str) -> int:
        """Rows of a channel."""
        return len(self.channels[topic])

    def digest(self, topic: str) -> str | None:
        """None: rows in memory are compared as they are."""
        return None

    def read(self, topic: str) -> Columns:
        """Rows of a channel."""
        return self.channels[topic]


class LogRun:
    """A run in an MCAP log."""

    def __init__(self, reader: LogReader, path: str) -> None:
        self._reader = reader
        self._digests = reader.digests()
        self.path = path
        self.schemas = {topic: info.schema_name for topic, info in reader.channels.items()}
        self.manifest = _manifest(reader, path)

    def count(self, topic: str) -> int:
        """Rows of a channel."""
        return int(self._digests[topic].message_count)

    def digest(self, topic: str) -> str | None:
        """Digest of a channel's times and payloads."""
        return str(self._digests[topic].sha256)

    def read(self, topic: str) -> Columns:
        """Rows of a channel."""
        return self._reader.read(topic)


def _manifest(reader: LogReader, path: str) -> Manifest | None:
    record = reader.metadata.get(MANIFEST_RECORD)
    if record is None:
        return None
    try:
        return json_format.Parse(record[MANIFEST_KEY], Manifest(), ignore_unknown_fields=True)
    except (json_format.ParseError, KeyError) as error:
        raise DataError(
            f"the manifest cannot be read: {error}",
            where=f'{path}, metadata "{MANIFEST_RECORD}"',
            mend="record the run again with this version",
        ) from error


@contextlib.contextmanager
def open_run(path: str | os.PathLike[str]) -> Iterator[LogRun]:
    """Open a log as a run; a damaged log is an error, because what is lost cannot be compared."""
    name = os.fspath(path)
    with LogReader(name, strict=True) as reader:
        yield LogRun(reader, name)
