"""Valid times: what a file calls time, to GPS nanoseconds.

The scales of a spec's `time` table:

================ ========================================== ===========================
scale            columns                                    also
================ ========================================== ===========================
`gps_week`       week and seconds of it, or the seconds      `week` where it is constant
`gps_calendar`   text, a calendar date of GPS time
`utc_calendar`   text, a calendar date of UTC                leap seconds are added
`unix`           a count since 1970, UTC; read exactly       `unit`
`relative`       a count since `epoch`                       `unit`, `epoch` (GPS date)
`ticks`          a free counter                              `unit`, `host_tag`, `fit`
================ ========================================== ===========================

`offset` is added to what was read: valid time = time read + offset, so a sensor
that is stamped too late has a negative one. `repeats` and `steady` are for polled
sensors: see :mod:`replay.importers.poll`.
"""

from __future__ import annotations

import decimal
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from replay import time
from replay.errors import ConfigurationError, ForeignFileError
from replay.importers.host_time import fit_ticks
from replay.importers.rtklib_tag import Tag
from replay.importers.spec import Time
from replay.importers.table import Float64, Int64, Mask, Table

_NS: Final = {
    "ns": 1,
    "us": 1000,
    "ms": 1_000_000,
    "s": time.NS_PER_S,
    "min": 60 * time.NS_PER_S,
    "h": 3600 * time.NS_PER_S,
}
_NS_PER_DAY: Final = 86_400 * time.NS_PER_S
_GPS_EPOCH: Final = np.datetime64(time.GPS_EPOCH, "ns")
_UNIX_EPOCH: Final = np.datetime64(0, "ns")
_LONGEST_S: Final = 4.0e9  # more seconds than this do not fit int64 nanoseconds with an epoch
_TEXT_SCALES: Final = ("gps_calendar", "utc_calendar", "unix")
_FILE_SCALE: Final = {"gps_week": "GPST", "gps_calendar": "GPST", "utc_calendar": "UTC"}


def text_columns(spec: Time) -> frozenset[str]:
    """Columns of the time that have to be read as text."""
    return frozenset(spec.columns) if spec.scale in _TEXT_SCALES else frozenset()


def valid_times(
    table: Table, spec: Time, tag_of: Callable[[str], Tag], note: Callable[[str], None]
) -> tuple[Int64, Mask]:
    """Valid time of each row.

    Parameters
    ----------
    table : Table
    spec : Time
    tag_of : function
        Reads a time-tag file of the recording.
    note : function
        Takes what was done.

    Returns
    -------
    int64 array (n,), ns
    bool array (n,)
        Rows that have a time.

    Raises
    ------
    ConfigurationError
        Where the spec's columns do not suit its scale.
    ForeignFileError
        Where a column is missing, or the file says that its scale is another one.
    """
    stated = _FILE_SCALE.get(spec.scale, "")
    if table.time_scale and stated and table.time_scale != stated:
        raise ForeignFileError(
            f"the file says {table.time_scale}, the spec's time scale is {spec.scale}",
            where=table.file.name,
            mend="set `scale` of the channel's time to what the file says",
        )
    most = 2 if spec.scale == "gps_week" and not spec.week else 1
    if len(spec.columns) != most:
        raise ConfigurationError(
            f"time scale {spec.scale} takes {most} column(s), not {len(spec.columns)}",
            where=table.file.name,
            mend="see replay.importers.clock for the scales",
        )
    if spec.scale == "ticks":
        ns, good = _from_ticks(table, spec, tag_of, note)
    elif spec.scale == "gps_week":
        ns, good = _from_week(table, spec)
    elif spec.scale == "relative":
        count, good = _count_ns(table.number(spec.columns[0]), spec.unit)
        ns = count + _epoch(spec, table.file.name)
    elif spec.scale == "unix":
        ns, good = _exact_ns(table.text(spec.columns[0]), spec.unit)
        ns = _utc_to_gps(ns)
    else:
        dates, good = _dates(table.text(spec.columns[0]))
        if spec.scale == "gps_calendar":
            ns = (dates - _GPS_EPOCH).astype(np.int64)
        else:
            ns = _utc_to_gps((dates - _UNIX_EPOCH).astype(np.int64))
    if spec.offset:
        note(f"{table.file.name}: {spec.offset!r} s were added to the times that were read")
    ns = ns + round(spec.offset * time.NS_PER_S)
    return ns, good & (ns >= 0)


def _epoch(spec: Time, where: str) -> int:
    try:
        return time.parse_calendar(spec.epoch)
    except ValueError as error:
        raise ConfigurationError(
            f"the epoch {spec.epoch!r} is no date", where=where, mend="write 2025-07-08T19:34:18"
        ) from error


def _count_ns(values: Float64, unit: str) -> tuple[Int64, Mask]:
    """Counts of a unit as nanoseconds; whole and fraction apart, so that nothing is lost."""
    factor = _NS[unit]
    good = np.abs(values) < _LONGEST_S * time.NS_PER_S / factor
    values = np.where(good, values, 0.0)
    whole = np.floor(values)
    fraction = np.rint((values - whole) * factor).astype(np.int64)
    return whole.astype(np.int64) * factor + fraction, good


def _from_week(table: Table, spec: Time) -> tuple[Int64, Mask]:
    seconds = table.number(spec.columns[-1])
    fixed = np.full(len(seconds), float(spec.week))
    weeks = fixed if spec.week else table.number(spec.columns[0])
    good = (np.abs(seconds) < _LONGEST_S) & (weeks == np.floor(weeks)) & (np.abs(weeks) < 1e4)
    ns = np.zeros(len(seconds), dtype=np.int64)
    for week in np.unique(weeks[good]):
        rows = good & (weeks == week)
        ns[rows] = time.from_week(int(week), seconds[rows])
    return ns, good


def _from_ticks(
    table: Table, spec: Time, tag_of: Callable[[str], Tag], note: Callable[[str], None]
) -> tuple[Int64, Mask]:
    name = table.file.name
    if not spec.host_tag:
        raise ConfigurationError(
            "ticks need a host_tag", where=name, mend="name the time-tag file of this file"
        )
    ticks = table.number(spec.columns[0]) * (_NS[spec.unit] / _NS["ms"])
    good = np.isfinite(ticks)
    tag = tag_of(spec.host_tag)
    ends = table.file.recorded_ends(2 if spec.recorded_line_end == "crlf" else 1)
    fit = fit_ticks(tag, ends[table.lines - 1], ticks, spec.fit, name)
    note(
        f"{name}: ticks to host time by {spec.fit} fit to {fit.pairs} time tags: "
        f"scale {fit.scale:.9f}, tick 0 at {time.to_text(_tick_zero(fit.times_ns, tag))}, "
        f"residual {fit.residual_ms:.3f} ms"
    )
    unread = int(tag.position[-1]) - int(ends[-1])
    if unread:
        note(f"{name}: the time tags end {unread} bytes after the file's last line")
    return fit.times_ns(tag, np.where(good, ticks, 0.0)), good


def _tick_zero(times_ns: Callable[[Tag, Float64], Int64], tag: Tag) -> int:
    return int(times_ns(tag, np.zeros(1))[0])


def _exact_ns(texts: Sequence[str], unit: str) -> tuple[Int64, Mask]:
    """Decimal counts as nanoseconds, exactly: a float64 of Unix seconds resolves 0.24 us only."""
    ns = np.zeros(len(texts), dtype=np.int64)
    good = np.zeros(len(texts), dtype=np.bool_)
    for row, text in enumerate(texts):
        try:
            exact = decimal.Decimal(text) * _NS[unit]
        except decimal.InvalidOperation:
            continue
        if abs(exact) < _LONGEST_S * time.NS_PER_S:
            ns[row] = int(exact.to_integral_value())
            good[row] = True
    return ns, good


def _dates(texts: Sequence[str]) -> tuple[np.typing.NDArray[np.datetime64], Mask]:
    plain = [text.strip().rstrip("Z").replace("/", "-").replace(" ", "T") for text in texts]
    try:
        return np.array(plain, dtype="datetime64[ns]"), np.ones(len(plain), dtype=np.bool_)
    except ValueError:
        pass  # some of them are no dates: one by one
    dates = np.full(len(plain), _GPS_EPOCH)
    good = np.zeros(len(plain), dtype=np.bool_)
    for row, text in enumerate(plain):
        try:
            dates[row] = np.datetime64(text, "ns")
        except ValueError:
            continue
        good[row] = True
    return dates, good


def _utc_to_gps(unix_ns: Int64) -> Int64:
    """Unix nanoseconds to GPS ones; leap seconds are looked up once per day."""
    days, row = np.unique(unix_ns // _NS_PER_DAY, return_inverse=True)
    shift = [time.from_unix(int(day) * _NS_PER_DAY) - int(day) * _NS_PER_DAY for day in days]
    return unix_ns + np.array(shift, dtype=np.int64)[row]
