"""What importers of precise products share: times, names, what a file says of itself."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from replay import channels, time
from replay.errors import ForeignFileError
from replay.importers.findings import Findings
from replay.log.columns import Columns, Int64, Ragged

UNKNOWN_NS: Final = -1
"""Time of a row whose time no file tells: it gets that of the log's start."""

TIME_SYSTEMS: Final = ("GPS", "GLO", "GAL", "BDT", "QZS", "IRN", "TAI", "UTC")
_BDT_BEHIND_S: Final = 14  # BDS-SIS-ICD 2.1, 3.3: GPS - BDT
_UTC: Final = ("UTC", "GLO")
_DAY_NS: Final = 86_400 * time.NS_PER_S
_UNIX_OF_GPS_EPOCH_NS: Final = 315_964_800 * time.NS_PER_S
_NAMES: Final = {"BDS": "BDT", "GLN": "GLO", "G": "GPS", "R": "GLO", "E": "GAL", "C": "BDT"}
_SHOWN: Final = 6

Float64 = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]


@dataclasses.dataclass(frozen=True, slots=True)
class About:
    """What a file of products says of itself; as `replay.ProductInfo`."""

    source: str
    format: str
    version: str = ""
    agency: str = ""
    frame: str = ""
    time_system: str = "GPS"
    kind: str = ""
    detail: str = ""


def time_system(text: str, where: str) -> str:
    """Name of a time system; blank and `ccc` are GPS, as before files said it.

    Raises
    ------
    ForeignFileError
        Where it is unknown.
    """
    name = text.strip().upper()
    name = _NAMES.get(name, name) or "GPS"
    name = "GPS" if name == "CCC" else name
    if name not in TIME_SYSTEMS:
        raise ForeignFileError(
            f"the time system {name!r} is unknown",
            where=where,
            mend=f"known are {', '.join(TIME_SYSTEMS)}",
        )
    return name


def to_gps(calendar_ns: Int64, system: str) -> Int64:
    """Nanoseconds since 1980-01-06 of a time system's calendar to GPS nanoseconds."""
    if system == "BDT":
        return calendar_ns + _BDT_BEHIND_S * time.NS_PER_S
    if system == "TAI":
        return calendar_ns - time.TAI_MINUS_GPS_S * time.NS_PER_S
    if system not in _UTC:
        return calendar_ns
    days, place = np.unique(calendar_ns // _DAY_NS, return_inverse=True)
    shifts = [time.from_unix(int(d) * _DAY_NS + _UNIX_OF_GPS_EPOCH_NS) for d in days]
    ahead = np.array(shifts, dtype=np.int64) - days * _DAY_NS
    return np.asarray(calendar_ns + ahead[place], dtype=np.int64)


def from_julian(mjd: Float64) -> Int64:
    """Modified Julian dates of UTC to GPS nanoseconds."""
    whole = np.floor(mjd)
    day = (whole.astype(np.int64) - 44_244) * _DAY_NS  # of 1980-01-06
    # Files give days to two or more decimals: what is less than a millisecond is rounding.
    part = np.rint((mjd - whole) * 86_400_000.0).astype(np.int64) * 1_000_000
    return to_gps(day + part, "UTC")


def product_row(about: About, epochs_ns: Int64, rows: int) -> dict[str, Columns]:
    """Row of the channel of products; `epochs_ns` are those of the file, in any order."""
    epochs = np.unique(epochs_ns)
    first, last = (int(epochs[0]), int(epochs[-1])) if len(epochs) else (0, 0)
    steps = np.diff(epochs)
    texts = ("source", "format", "version", "agency", "frame", "time_system", "kind", "detail")
    return {
        channels.PRODUCTS.topic: Columns.build(
            np.array([first if len(epochs) else UNKNOWN_NS], dtype=np.int64),
            {
                **{name: Ragged.from_texts([getattr(about, name)]) for name in texts},
                "first_ns": np.array([first], dtype=np.int64),
                "last_ns": np.array([last], dtype=np.int64),
                "interval_s": np.array([np.median(steps) / time.NS_PER_S if len(steps) else 0.0]),
                "row_count": np.array([rows], dtype=np.int32),
            },
        )
    }


def within(
    times_ns: Int64,
    span_ns: tuple[int, int] | None,
    margin_s: float,
    what: str,
    findings: Findings,
) -> Bool:
    """Which rows are near enough to the rows of the log; a margin of zero keeps all.

    Raises
    ------
    ForeignFileError
        Where there are rows, but none is near.
    """
    keep = np.ones(len(times_ns), dtype=np.bool_)
    if span_ns is None or not margin_s > 0.0:
        return keep
    margin = round(margin_s * time.NS_PER_S)
    keep = (times_ns >= span_ns[0] - margin) & (times_ns <= span_ns[1] + margin)
    left = len(keep) - int(keep.sum())
    if left == len(keep) > 0:
        raise off_time(what, times_ns)
    if left:
        findings.notes.append(
            f"{what}: {left} of {len(keep)} rows lie more than {margin_s:g} s from the rows of "
            "the log and are left out, as the spec says"
        )
    return keep


def off_time(name: str, times_ns: Int64) -> ForeignFileError:
    """The error of a file whose rows are of another time than the log's."""
    first, last = time.to_text(int(times_ns.min())), time.to_text(int(times_ns.max()))
    return ForeignFileError(
        f"the file is of {first} to {last}, which is not the log's time",
        where=name,
        mend="take the file of the log's day, or leave the stream out",
    )


def name_numbers(names: npt.NDArray[np.bytes_]) -> Int64:
    """A number for each different name, of up to sixteen bytes."""
    wide = np.ascontiguousarray(names, dtype="S16").view(np.int64).reshape(-1, 2)
    number: Int64 = np.zeros(len(wide), dtype=np.int64)
    for k in range(2):
        if (wide[:, k] != wide[:1, k]).any():
            _, place = np.unique(wide[:, k], return_inverse=True)
            number = number * (int(place.max()) + 1) + place
    return number


def first_of_each(times_ns: Int64, names: npt.NDArray[np.bytes_]) -> Int64:
    """Rows, in order of time, without those that give a name's time again."""
    number = name_numbers(names)
    order = np.lexsort((number, times_ns))
    t, n = times_ns[order], number[order]
    again = np.zeros(len(order), dtype=np.bool_)
    again[1:] = (t[1:] == t[:-1]) & (n[1:] == n[:-1])
    kept = np.sort(order[~again])
    if (np.diff(times_ns[kept]) < 0).any():
        kept = kept[np.argsort(times_ns[kept], kind="stable")]
    return kept.astype(np.int64)


def missing_note(
    what: str, names: npt.NDArray[np.bytes_], times_ns: Int64, stated: Sequence[str] = ()
) -> list[str]:
    """Notes on epochs that lack, and on satellites that lack some or all of those there are."""
    moments = np.unique(times_ns)
    epochs, steps = len(moments), np.diff(moments)
    notes = []
    late = np.flatnonzero(steps > 1.5 * np.median(steps)) if epochs > 2 else np.zeros(0, int)
    if len(late):
        text = ", ".join(
            f"{time.to_text(int(moments[k]))} to {time.to_text(int(moments[k + 1]))}"
            for k in late[:_SHOWN]
        )
        notes.append(f"{what}: {len(late)} gaps of all satellites ({text})")
    _, firsts, counts = np.unique(name_numbers(names), return_index=True, return_counts=True)
    in_order = np.argsort(names[firsts])
    found, counts = names[firsts][in_order], counts[in_order]
    few = [
        f"{name.decode()} {epochs - count}"
        for name, count in zip(found, counts, strict=True)
        if count < epochs
    ]
    if few:
        text = ", ".join(few[:_SHOWN]) + (", …" if len(few) > _SHOWN else "")
        notes.append(f"{what}: {len(few)} lack some of {epochs} epochs ({text})")
    absent = sorted(set(stated) - {name.decode() for name in found})
    if absent:
        notes.append(f"{what}: {', '.join(absent)} are named but have no value")
    return notes
