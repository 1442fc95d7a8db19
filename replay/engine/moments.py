"""Moments and stretches of a log as a person writes them."""

from __future__ import annotations

from replay import time
from replay.errors import UsageError

_LARGEST_RELATIVE_S = 1e8  # three years; larger numbers are GPS nanoseconds


def parse_time(text: str, start_ns: int) -> int:
    """A moment: seconds from the log's start, GPS nanoseconds, or a date of GPS time.

    Parameters
    ----------
    text : str
        `40`, `1436038461499000000` or `2025-07-08T19:35:00`.
    start_ns : int
        First log time of the log, GPS nanoseconds.

    Raises
    ------
    UsageError
    """
    try:
        if float(text) < _LARGEST_RELATIVE_S:
            return start_ns + round(float(text) * time.NS_PER_S)
        return int(text)
    except (ValueError, OverflowError):
        pass
    try:
        return time.parse_calendar(text)
    except ValueError:
        raise UsageError(
            f"{text!r} is no time",
            mend="write seconds from the log's start (40), a date of GPS time "
            "(2025-07-08T19:35:00) or GPS nanoseconds",
        ) from None


def parse_outage(text: str, start_ns: int) -> tuple[int, int]:
    """`T0,DT` as the start and the end in GPS nanoseconds.

    Raises
    ------
    UsageError
    """
    start, comma, duration = text.rpartition(",")
    try:
        if not comma:
            raise ValueError
        length_ns = round(float(duration) * time.NS_PER_S)
    except (ValueError, OverflowError):
        raise UsageError(
            f"{text!r} is no outage", mend="write --outage START,SECONDS, as in --outage 40,15"
        ) from None
    begin = parse_time(start, start_ns)
    return begin, begin + length_ns
