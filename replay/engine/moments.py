"""Moments and stretches of a log as a person writes them."""

from __future__ import annotations

import decimal
from typing import Final

from replay import time
from replay.errors import UsageError

_LARGEST_RELATIVE_S: Final = 100_000_000  # three years of log
_LARGEST_SECONDS: Final = 100_000_000_000  # larger numbers are nanoseconds


def parse_time(text: str, start_ns: int) -> int:
    """A moment as a number or as a date of GPS time.

    Parameters
    ----------
    text : str
        Seconds from the log's start (`40`), seconds (`1436038498.5`) or nanoseconds
        (`1436038498500000000`) of GPS time since 1980, told apart by their size, or a
        date (`2025-07-08T19:35:00`). Exact to the nanosecond.
    start_ns : int
        First log time of the log, GPS nanoseconds.

    Raises
    ------
    UsageError
    """
    try:
        number = decimal.Decimal(text)
        if abs(number) < _LARGEST_RELATIVE_S:
            return start_ns + round(number * time.NS_PER_S)
        if abs(number) < _LARGEST_SECONDS:
            return round(number * time.NS_PER_S)
        return int(text)
    except (decimal.InvalidOperation, ValueError, OverflowError):
        pass
    try:
        return time.parse_calendar(text)
    except ValueError:
        raise UsageError(
            f"{text!r} is no time",
            mend="write seconds from the log's start (40), a date of GPS time "
            "(2025-07-08T19:35:00), or seconds or nanoseconds of GPS time since 1980",
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
