"""What a log knew before a moment: rows that hold from their log time on.

A run that begins in the middle of a log begins with them, as one over the whole log would know
them there: ephemerides, precise products, calibrations, what a receiver said of its antenna.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from replay import channels
from replay.log.columns import Columns
from replay.log.reader import LogReader

STANDING: Final = (
    channels.NAV,
    channels.NAV_IONOSPHERE,
    channels.NAV_TIME,
    channels.PRODUCTS,
    channels.PRECISE_ORBIT,
    channels.PRECISE_CLOCK,
    channels.SIGNAL_BIAS,
    channels.EARTH_ROTATION,
    channels.IONOSPHERE_MAP,
    channels.OCEAN_LOADING,
    channels.ANTENNAS,
    channels.RECEIVER,
)
"""Kinds of channels whose rows serve from their log time on, until better ones come."""


def standing_topics(reader: LogReader) -> list[str]:
    """Topics of a log whose rows hold from their log time on."""
    return [topic for topic in reader.channels if channels.find(topic) in STANDING]


def standing_rows(
    reader: LogReader, before_ns: int, *, decode: list[str] | None = None
) -> Iterator[dict[str, Columns]]:
    """Rows that hold, of log times before a moment, with their payloads.

    Parameters
    ----------
    reader : LogReader
    before_ns : int, GPS ns
    decode : list of str, optional
        Topics whose values are decoded, by default all.
    """
    topics = standing_topics(reader)
    if not topics:
        return
    wanted = None if decode is None else [topic for topic in topics if topic in decode]
    yield from reader.batches(topics, decode=wanted, payloads=topics, end_ns=before_ns)
