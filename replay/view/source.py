"""A run log opened for viewing: the only place of this package that reads files."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from replay import channels
from replay.log.reader import LogReader
from replay.view.gather import KEPT, Batches

_DECODED = (*KEPT, channels.IMU, channels.FILTER_COVARIANCE)


class RunSource:
    """Batches and metadata of an open log.

    Parameters
    ----------
    reader : LogReader
    """

    def __init__(self, reader: LogReader) -> None:
        self._reader = reader

    @property
    def metadata(self) -> Mapping[str, Mapping[str, str]]:
        """Metadata records of the log."""
        return self._reader.metadata

    def batches(self) -> Batches:
        """Every channel in the order of time; decoded are those that the views draw.

        A topic that bears another message than its name promises is not decoded, so it is
        counted and not drawn.
        """
        drawn = [
            topic
            for topic, info in self._reader.channels.items()
            if info.codec is not None
            and any(s.matches(topic) and s.message == info.schema_name for s in _DECODED)
        ]
        return self._reader.batches(decode=drawn)


@contextlib.contextmanager
def open_run(path: Path) -> Iterator[RunSource]:
    """The log at a path; closed at the end."""
    with LogReader(path) as reader:
        yield RunSource(reader)
