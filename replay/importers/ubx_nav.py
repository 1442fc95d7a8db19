"""NAV-PVT and NAV-HPPOSLLH of u-blox: the receiver's own solution (interface description, 3.15)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from replay import time
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.frames import Frames
from replay.importers.geodesy import Places
from replay.importers.receiver_rows import fix_columns
from replay.importers.table import Int64, Mask
from replay.log.columns import Columns
from replay.schemas import gnss_pb2

_PVT: Final = np.dtype(
    [
        ("tow_ms", "<u4"), ("year", "<u2"), ("month", "u1"), ("day", "u1"), ("hour", "u1"),
        ("minute", "u1"), ("second", "u1"), ("valid", "u1"), ("time_accuracy_ns", "<u4"),
        ("nano", "<i4"), ("fix", "u1"), ("flags", "u1"), ("flags2", "u1"), ("satellites", "u1"),
        ("longitude", "<i4"), ("latitude", "<i4"), ("height_mm", "<i4"), ("sea_mm", "<i4"),
        ("horizontal_mm", "<u4"), ("vertical_mm", "<u4"), ("north", "<i4"), ("east", "<i4"),
        ("down", "<i4"), ("speed", "<i4"), ("course", "<i4"), ("speed_std", "<u4"),
        ("course_std", "<u4"), ("pdop", "<u2"), ("flags3", "<u2"), ("reserved", "u1", 4),
        ("vehicle", "<i4"), ("declination", "<i2"), ("declination_std", "<u2"),
    ]
)  # fmt: skip
_PRECISE: Final = np.dtype(
    [
        ("version", "u1"), ("reserved", "u1", 2), ("flags", "u1"), ("tow_ms", "<u4"),
        ("longitude", "<i4"), ("latitude", "<i4"), ("height_mm", "<i4"), ("sea_mm", "<i4"),
        ("longitude_low", "i1"), ("latitude_low", "i1"), ("height_low", "i1"), ("sea_low", "i1"),
        ("horizontal", "<u4"), ("vertical", "<u4"),
    ]
)  # fmt: skip
_PAYLOAD: Final = 6
_DATE_AND_TIME: Final = 3  # bits of `valid`
_FIX_OK: Final = 1
_DIFFERENTIAL: Final = 2
_FLOAT: Final = 1
_FIXED: Final = 2
_RAD: Final = np.pi / 180.0
_WITH_FIX: Final = (1, 2, 3, 4)  # dead reckoning, 2-D, 3-D, both


def decode_pvt(
    file: File,
    frames: Frames,
    pvt: tuple[Int64, Int64],
    precise: tuple[Int64, Int64],
    lever_arm_m: Sequence[float],
    findings: Findings,
) -> tuple[Columns | None, Int64, Int64]:
    """Fixes of all NAV-PVT frames, with the finer position where NAV-HPPOSLLH gives one.

    The time is that of UTC in the message with its nanoseconds, to which the leap
    seconds are added: `iTOW` is rounded to the millisecond or more. `hAcc` is taken
    as the root of the sum of two equal variances, `sAcc` of three.

    Parameters
    ----------
    pvt, precise : (offsets, lengths) of frames
    lever_arm_m : sequence of 3 float, m

    Returns
    -------
    Columns or None
        None where there is no fix.
    int64 array (n,), int64 array (n,)
        Offset and GPS nanoseconds of each frame that tells its time.
    """
    whole = pvt[1] == 8 + _PVT.itemsize
    rows = frames.records(pvt[0][whole] + _PAYLOAD, _PVT)
    dated = (rows["valid"] & _DATE_AND_TIME) == _DATE_AND_TIME
    times = np.zeros(len(rows), dtype=np.int64)
    times[dated] = _times(rows[dated])
    usable = dated & ((rows["flags"] & _FIX_OK) > 0) & np.isin(rows["fix"], _WITH_FIX)
    if not usable.all() or not whole.all():
        left = len(rows) - int(usable.sum()) + int((~whole).sum())
        findings.notes.append(f"{file.name}: {left} NAV-PVT messages hold no fix or no date")
    known_offsets, known_times = pvt[0][whole][dated], times[dated]
    if not usable.any():
        return None, known_offsets, known_times
    rows, times = rows[usable], times[usable]
    latitude, longitude = rows["latitude"] * 1e-7, rows["longitude"] * 1e-7
    height = rows["height_mm"] * 1e-3
    horizontal, vertical = rows["horizontal_mm"] * 1e-3, rows["vertical_mm"] * 1e-3
    fine, at = _finer(frames, precise, rows["tow_ms"])
    if len(at):
        latitude[at] = fine["latitude"] * 1e-7 + fine["latitude_low"] * 1e-9
        longitude[at] = fine["longitude"] * 1e-7 + fine["longitude_low"] * 1e-9
        height[at] = fine["height_mm"] * 1e-3 + fine["height_low"] * 1e-4
        horizontal[at], vertical[at] = fine["horizontal"] * 1e-4, fine["vertical"] * 1e-4
    places = Places.from_geodetic(latitude * _RAD, longitude * _RAD, height)
    covariance = np.zeros((len(rows), 6))
    covariance[:, 0] = covariance[:, 3] = horizontal * horizontal / 2.0
    covariance[:, 5] = vertical * vertical
    velocity = np.stack([rows["east"], rows["north"], -rows["down"]], axis=1) * 1e-3
    spread = np.zeros((len(rows), 6))
    speed = rows["speed_std"] * 1e-3
    spread[:, 0] = spread[:, 3] = spread[:, 5] = speed * speed / 3.0
    columns = fix_columns(
        times,
        places,
        covariance,
        _quality(rows),
        lever_arm_m,
        velocity_enu=velocity,
        velocity_covariance=spread,
        satellite_count=rows["satellites"].astype(np.int64),
    )
    return columns, known_offsets, known_times


def _times(rows: npt.NDArray[np.void]) -> Int64:
    """GPS nanoseconds of dates of UTC."""
    months = (rows["year"].astype(np.int64) - 1970) * 12 + rows["month"] - 1
    days = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
    days += rows["day"].astype(np.int64) - 1
    # The leap seconds are those of noon: at the end of a day the message is a second early.
    shift = {d: time.from_unix(d * 86_400 * time.NS_PER_S) for d in np.unique(days).tolist()}
    seconds = rows["hour"].astype(np.int64) * 3600 + rows["minute"].astype(np.int64) * 60
    seconds += rows["second"]
    start = np.array([shift[d] for d in days.tolist()], dtype=np.int64)
    return np.asarray(start + seconds * time.NS_PER_S + rows["nano"], dtype=np.int64)


def _finer(
    frames: Frames, precise: tuple[Int64, Int64], tow_ms: Int64
) -> tuple[npt.NDArray[np.void], Int64]:
    """NAV-HPPOSLLH that are valid, and the rows of NAV-PVT that each belongs to."""
    whole = precise[1] == 8 + _PRECISE.itemsize
    rows = frames.records(precise[0][whole] + _PAYLOAD, _PRECISE)
    rows = rows[(rows["flags"] & 1) == 0]
    order = np.argsort(tow_ms, kind="stable")
    place = np.searchsorted(tow_ms[order], rows["tow_ms"])
    found: Mask = place < len(order)
    at = order[np.minimum(place, len(order) - 1)]
    found &= tow_ms[at] == rows["tow_ms"]
    return rows[found], at[found].astype(np.int64)


def _quality(rows: npt.NDArray[np.void]) -> Int64:
    carrier = rows["flags"] >> 6
    quality = np.full(len(rows), gnss_pb2.FIX_QUALITY_SINGLE, dtype=np.int64)
    quality[(rows["flags"] & _DIFFERENTIAL) > 0] = gnss_pb2.FIX_QUALITY_DGNSS
    quality[carrier == _FLOAT] = gnss_pb2.FIX_QUALITY_RTK_FLOAT
    quality[carrier == _FIXED] = gnss_pb2.FIX_QUALITY_RTK_FIXED
    quality[np.isin(rows["fix"], (1, 4))] = gnss_pb2.FIX_QUALITY_FUSED
    return quality
