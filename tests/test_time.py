"""GPS time in integer nanoseconds, against published dates, erfa and the calendar."""

from __future__ import annotations

import datetime

import erfa
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay import time

SECOND = 1_000_000_000
DAY = 86_400 * SECOND
# IERS Bulletin C: each day on which a leap second had just been added, and TAI - UTC from then.
LEAPS = [
    ((1981, 7, 1), 20),
    ((1982, 7, 1), 21),
    ((1983, 7, 1), 22),
    ((1985, 7, 1), 23),
    ((1988, 1, 1), 24),
    ((1990, 1, 1), 25),
    ((1991, 1, 1), 26),
    ((1992, 7, 1), 27),
    ((1993, 7, 1), 28),
    ((1994, 7, 1), 29),
    ((1996, 1, 1), 30),
    ((1997, 7, 1), 31),
    ((1999, 1, 1), 32),
    ((2006, 1, 1), 33),
    ((2009, 1, 1), 34),
    ((2012, 7, 1), 35),
    ((2015, 7, 1), 36),
    ((2017, 1, 1), 37),
]


def gps_of_utc(year: int, month: int, day: int) -> int:
    """GPS nanoseconds of a UTC midnight, by erfa's chain of scales."""
    utc1, utc2 = erfa.dtf2d("UTC", year, month, day, 0, 0, 0.0)
    tai1, tai2 = erfa.utctai(utc1, utc2)
    days = (tai1 - 2444244.5) + tai2  # since 1980-01-06 00:00
    return round(days * 86_400) * SECOND - 19 * SECOND


@pytest.mark.parametrize(
    ("text", "week", "second"),
    [
        ("1980-01-06T00:00:00", 0, 0),
        ("1999-08-22T00:00:00", 1024, 0),  # first roll-over of the ten-bit week
        ("2019-04-07T00:00:00", 2048, 0),  # second one
        ("2025-06-01T12:00:00", 2369, 43_200),  # a Sunday
        ("2025-07-08T19:34:18.499", 2374, 243_258.499),
    ],
)
def test_weeks_and_dates(text: str, week: int, second: float) -> None:
    assert time.parse_calendar(text) == int(time.from_week(week, second))


def test_week_of_an_array() -> None:
    seconds = np.array([0.0, 0.005, 604_799.999999999, 345_600.1])
    expected = [0, 5_000_000, 604_799_999_999_999, 345_600_100_000_000]
    found = time.from_week(2300, seconds)
    assert found.dtype == np.int64
    assert (found - 2300 * 7 * DAY).tolist() == pytest.approx(expected, abs=60)
    assert (found - 2300 * 7 * DAY)[:2].tolist() == expected[:2]


@given(
    week=st.integers(0, 5000),
    ticks=st.integers(0, 604_800 * 1000 - 1),
    scale=st.sampled_from([1000, 200, 64]),
)
def test_seconds_of_the_week_are_exact(week: int, ticks: int, scale: int) -> None:
    """Decimal seconds come to the nanosecond that they were written for."""
    if ticks >= 604_800 * scale:
        ticks %= 604_800 * scale
    exact = week * 7 * DAY + ticks * SECOND // scale
    assert int(time.from_week(week, ticks / scale)) == exact


@given(st.datetimes(datetime.datetime(1980, 1, 6), datetime.datetime(2200, 1, 1)))
def test_dates_go_round(moment: datetime.datetime) -> None:
    ns = time.from_calendar(moment)
    assert ns == (moment - datetime.datetime(1980, 1, 6)) // datetime.timedelta(microseconds=1) * (
        1000
    )
    assert time.parse_calendar(moment.isoformat()) == ns
    assert time.parse_calendar(f"{moment:%Y/%m/%d %H:%M:%S.%f}") == ns
    assert time.to_datetime64(ns) == np.datetime64(moment)
    assert time.to_text(ns) == moment.isoformat(timespec="milliseconds")


@given(st.integers(0, 6_000_000_000 * SECOND))
def test_nanoseconds_of_a_date(ns: int) -> None:
    text = str(np.datetime_as_string(time.to_datetime64(ns), unit="ns"))
    assert time.parse_calendar(text) == ns


@pytest.mark.parametrize(
    "text",
    [
        "",
        "2025-07-08",
        "19:34:18",
        "2025-13-08T00:00:00",
        "2025-02-30T00:00:00",
        "2025-07-08T24:00:00",
        "2025-07-08T19:34:18.5Z",
        "2025-07-08T19:34:18.-5",
        "2025-07-08T19:34:18+02:00",
    ],
)
def test_words_that_are_no_date(text: str) -> None:
    with pytest.raises(ValueError):
        time.parse_calendar(text)


def test_a_date_with_a_zone_is_refused() -> None:
    with pytest.raises(ValueError, match="zone"):
        time.from_calendar(datetime.datetime(2025, 1, 1, tzinfo=datetime.UTC))


@pytest.mark.parametrize(("date", "tai_minus_utc"), LEAPS)
def test_leap_seconds(date: tuple[int, int, int], tai_minus_utc: int) -> None:
    """GPS - UTC is TAI - UTC less 19 s, from the very second on which it changes."""
    at = gps_of_utc(*date)
    assert time.leap_seconds(at + DAY) == tai_minus_utc - 19
    assert time.leap_seconds(at - DAY) == tai_minus_utc - 20
    unix = round(datetime.datetime(*date, tzinfo=datetime.UTC).timestamp()) * SECOND
    assert time.from_unix(unix + DAY) == at + DAY


@pytest.mark.parametrize(("date", "tai_minus_utc"), LEAPS[-3:])
def test_unix_time_on_both_sides_of_a_leap_second(
    date: tuple[int, int, int], tai_minus_utc: int
) -> None:
    """The Unix second before midnight is two seconds of GPS time before it, not one."""
    unix = round(datetime.datetime(*date, tzinfo=datetime.UTC).timestamp()) * SECOND
    midnight = gps_of_utc(*date)
    assert time.from_unix(unix) == midnight
    assert time.from_unix(unix - SECOND) == midnight - 2 * SECOND
    assert time.from_unix(unix + 10 * SECOND) == midnight + 10 * SECOND
    assert time.leap_seconds(midnight) == tai_minus_utc - 19
    assert time.leap_seconds(midnight - 2 * SECOND) == tai_minus_utc - 20


def test_unix_time_of_the_gps_epoch() -> None:
    assert time.from_unix(315_964_800 * SECOND) == 0


@given(st.integers(1_500_000_000, 1_780_000_000), st.integers(0, SECOND - 1))
def test_unix_time_since_the_last_leap_second(seconds: int, nanoseconds: int) -> None:
    """18 s since 2017, as every receiver shows."""
    unix = seconds * SECOND + nanoseconds
    assert time.from_unix(unix) == unix - 315_964_800 * SECOND + 18 * SECOND


@given(st.integers(0, 2**62), st.integers(-(2**53), 2**53))
def test_differences_are_of_integers(start: int, step: int) -> None:
    assert time.seconds_between(start + step, start) == step / SECOND
