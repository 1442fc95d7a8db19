"""Events of precise products: what a satellite lacks, and frames that differ."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from replay.gnss.measurements import SATELLITE_NAMES, signal_names
from replay.kernels import precise_orbits
from replay.kernels import precise_records as records
from replay.log.columns import Columns, Ragged
from replay.schemas import filter_pb2
from replay.stages.gnss_columns import EVENT_TEXT

Array = np.ndarray[Any, Any]

_KIND: Final = records.KIND
_NONE: Final = _KIND * precise_orbits.NO_PRODUCT
_OUTSIDE: Final = _KIND * precise_orbits.OUTSIDE
_GAP: Final = _KIND * precise_orbits.IN_GAP
_FEW: Final = _KIND * precise_orbits.TOO_FEW
_CLOCK: Final = records.CLOCK
_TEXT: Final = {
    **EVENT_TEXT,
    **{
        records.NO_SATELLITE + number: text
        for number, text in (
            (_NONE, "{satellite}: the products have no orbit of it"),
            (_NONE + _CLOCK, "{satellite}: the products have no clock of it"),
            (_OUTSIDE, "{satellite}: its orbit begins later or ended before"),
            (_OUTSIDE + _CLOCK, "{satellite}: its clock begins later or ended before"),
            (_GAP, "{satellite}: in a gap of its orbit"),
            (_GAP + _CLOCK, "{satellite}: in a gap of its clock"),
            (_FEW, "{satellite}: too few epochs of its orbit stand together"),
            (_FEW + _CLOCK, "{satellite}: too few epochs of its clock stand together"),
            (
                _KIND * records.CONTINUED,
                "{satellite}: its orbit is continued past the epochs of the products",
            ),
            (
                _KIND * records.CONTINUED + _CLOCK,
                "{satellite}: its clock is continued past the epochs of the products",
            ),
            (_KIND * records.NO_BIAS, "{satellite}: the products have no bias of C{signal}"),
            (_KIND * records.NO_MAP, "no map of the ionosphere, or a gap in it"),
        )
    },
}
# What is not told as NO_SATELLITE: that the satellite cannot be used.
_OTHER_KINDS: Final = {
    records.CONTINUED: filter_pb2.EVENT_KIND_PRODUCT_CONTINUED,
    records.NO_BIAS: filter_pb2.EVENT_KIND_PRODUCT_LACKING,
    records.NO_MAP: filter_pb2.EVENT_KIND_PRODUCT_LACKING,
}


def precise_event_columns(notes: Array) -> Columns:
    """Events of the loop's notes, each with what it was in its text."""
    details, kinds = [], []
    for row in notes:
        reason = int(row["kind"]) % _CLOCK // _KIND
        kinds.append(_OTHER_KINDS.get(reason, int(row["kind"]) % _KIND))
        number = row["satellite"]
        name = SATELLITE_NAMES[number].decode() if number >= 0 else ""
        signal = signal_names(row["value"].astype(np.int64).reshape(1))[0].decode()
        text = _TEXT[int(row["kind"])]
        details.append(text.format(satellite=name, value=float(row["value"]), signal=signal))
    plain = notes["kind"] < _KIND
    return Columns.build(
        notes["t"],
        {
            "kind": np.array(kinds, dtype=np.int32),
            "value": np.where(plain, notes["value"], 0.0),
            "detail": Ragged.from_texts(details),
        },
        log_time_ns=notes["log_t"],
    )


def frame_events(known: list[str], files: Columns) -> Columns | None:
    """An event for each file of products in another frame than the first that states one.

    Parameters
    ----------
    known : list of str
        Frames so far; those of `files` (rows of `replay.ProductInfo`) are added.
    files : Columns
    """
    rows: list[int] = []
    details: list[str] = []
    sources, frames = files.ragged("source").texts(), files.ragged("frame").texts()
    for row, (source, frame) in enumerate(zip(sources, frames, strict=True)):
        if not frame or frame in known:
            continue
        if known:
            rows.append(row)
            details.append(f"products in the frames {known[0]} and {frame} ({source})")
        known.append(frame)
    if not rows:
        return None
    log_t = files.log_time_ns[rows]
    return Columns.build(
        log_t,
        {
            "kind": np.full(len(rows), filter_pb2.EVENT_KIND_FRAMES_DIFFER, dtype=np.int32),
            "value": np.zeros(len(rows)),
            "detail": Ragged.from_texts(details),
        },
        log_time_ns=log_t,
    )
