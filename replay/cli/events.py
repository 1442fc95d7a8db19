"""What a run said of itself, in a few lines for the terminal."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from replay import channels, time


def event_summary(log: Path) -> Iterator[str]:
    """A line per kind of event of every run and receiver: how many, and the first of them.

    Parameters
    ----------
    log : Path
        Log of a run.

    Yields
    ------
    str
    """
    from replay.log.reader import LogReader
    from replay.schemas import filter_pb2

    with LogReader(log) as reader:
        for topic in reader.channels:
            if channels.find(topic) not in (channels.FILTER_EVENTS, channels.GNSS_EVENTS):
                continue
            events = reader.read(topic)
            details = events.ragged("detail").texts()
            for kind in np.unique(events["kind"]).tolist():
                rows = np.flatnonzero(events["kind"] == kind)
                name = filter_pb2.EventKind.Name(kind).removeprefix("EVENT_KIND_").lower()
                first = int(rows[0])
                yield (
                    f"{len(rows)} x {name.replace('_', ' ')}, first at "
                    f"{time.to_text(int(events.valid_time_ns[first]))}: {details[first]}"
                )
