"""The one time type: `int64` nanoseconds of GPS time since 1980-01-06 00:00:00.

GPS time has no leap seconds, so differences are elapsed time. Never a float of
seconds: a float64 of seconds since 1980 resolves 0.2 µs, which is 3 µm at 15 m/s
but enough to make two machines cut a log differently.
"""

from __future__ import annotations

import datetime
from typing import Final

import erfa
import numpy as np
import numpy.typing as npt

NS_PER_S: Final = 1_000_000_000
NS_PER_WEEK: Final = 7 * 86_400 * NS_PER_S
GPS_EPOCH: Final = datetime.datetime(1980, 1, 6)
TAI_MINUS_GPS_S: Final = 19  # IS-GPS-200N, 3.3.4: GPS time began with UTC, TAI - UTC being 19 s
_UNIX_OF_GPS_EPOCH_NS: Final = 315_964_800 * NS_PER_S

TimeArray = npt.NDArray[np.int64]


def from_week(week: int, time_of_week_s: npt.ArrayLike) -> TimeArray:
    """GPS week and seconds of the week to GPS nanoseconds.

    Parameters
    ----------
    week : int
        GPS week since 1980, roll-overs counted.
    time_of_week_s : array_like, s
        Rounded to the nanosecond.

    Returns
    -------
    int64 array, ns
    """
    seconds = np.asarray(time_of_week_s, dtype=np.float64)
    whole = np.floor(seconds)
    fraction = np.rint((seconds - whole) * NS_PER_S)
    return np.asarray(
        week * NS_PER_WEEK + whole.astype(np.int64) * NS_PER_S + fraction.astype(np.int64)
    )


def from_calendar(moment: datetime.datetime) -> int:
    """Calendar date of GPS time (no zone) to GPS nanoseconds, exact to the microsecond."""
    if moment.tzinfo is not None:
        raise ValueError("a calendar date of GPS time has no zone")
    delta = moment - GPS_EPOCH
    return (delta.days * 86_400 + delta.seconds) * NS_PER_S + delta.microseconds * 1000


def parse_calendar(text: str) -> int:
    """`2025-07-08T19:34:18.499` or `2025/07/08 19:34:18.499` of GPS time to nanoseconds.

    Raises
    ------
    ValueError
        Where the text is no date and time.
    """
    cleaned = text.strip().replace("/", "-").replace("T", " ")
    head, _, fraction = cleaned.partition(".")
    moment = datetime.datetime.strptime(head, "%Y-%m-%d %H:%M:%S")
    if fraction and not fraction.isdigit():
        raise ValueError(f"no fraction of a second: {fraction!r}")
    return from_calendar(moment) + int((fraction + "0" * 9)[:9])


def leap_seconds(gps_ns: int) -> int:
    """GPS minus UTC in seconds at a moment of GPS time (from erfa's table)."""
    # The GPS calendar turns its days before UTC does: ask again with what comes out.
    return _leap_seconds_of_utc(gps_ns - _leap_seconds_of_utc(gps_ns) * NS_PER_S)


def _leap_seconds_of_utc(utc_ns: int) -> int:
    """GPS minus UTC, given nanoseconds of UTC that are counted without leap seconds."""
    moment = GPS_EPOCH + datetime.timedelta(microseconds=utc_ns // 1000)
    tai_minus_utc = erfa.dat(moment.year, moment.month, moment.day, 0.0)
    return int(tai_minus_utc) - TAI_MINUS_GPS_S


def from_unix(unix_ns: int) -> int:
    """Nanoseconds of Unix time (UTC) to GPS nanoseconds."""
    utc_ns = unix_ns - _UNIX_OF_GPS_EPOCH_NS
    return utc_ns + _leap_seconds_of_utc(utc_ns) * NS_PER_S


def to_datetime64(gps_ns: npt.ArrayLike) -> npt.NDArray[np.datetime64]:
    """GPS nanoseconds to the calendar date of GPS time (not of UTC)."""
    shifted = np.asarray(gps_ns, dtype=np.int64) + _UNIX_OF_GPS_EPOCH_NS
    return shifted.astype("datetime64[ns]")


def to_text(gps_ns: int) -> str:
    """A moment for a person: calendar date of GPS time, to the millisecond."""
    return str(np.datetime_as_string(to_datetime64(gps_ns), unit="ms"))


def seconds_between(later_ns: npt.ArrayLike, earlier_ns: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Elapsed seconds, subtracted as integers first."""
    difference = np.asarray(later_ns, dtype=np.int64) - np.asarray(earlier_ns, dtype=np.int64)
    return np.asarray(difference / NS_PER_S, dtype=np.float64)
