"""Rows of several files of products as one: days that meet, frames that differ."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import numpy as np

from replay import channels, time
from replay.importers.findings import Findings
from replay.importers.product_files import Bool, Float64, name_numbers
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.log.codec import codec_for
from replay.log.columns import Columns, Int64, Ragged, concatenate

SERIES: Final = (
    channels.PRECISE_ORBIT.topic,
    channels.PRECISE_CLOCK.topic,
    channels.EARTH_ROTATION.topic,
    channels.IONOSPHERE_MAP.topic,
)
"""Channels that hold one value of a thing at a time."""

_FRAME: Final = re.compile(r"I?(?:GS|GB|TRF|GSR)?[A-Z]*?(\d+)$")


def join_series(topic: str, parts: Sequence[Columns], findings: Findings) -> Columns:
    """Rows in the order of their valid times, one value of each thing at a time.

    Where files give the same time of the same thing, as two days do at midnight, the value of
    the file that begins later stands. What that replaces is told, with its size.
    """
    order = sorted(range(len(parts)), key=lambda k: int(parts[k].valid_time_ns.min()))
    ordered = [parts[k] for k in order]
    number = np.repeat(np.arange(len(ordered)), [len(part) for part in ordered])
    whole = concatenate(ordered)
    identity = _identity(whole)
    rows = np.lexsort((number, identity, whole.valid_time_ns))
    t, n = whole.valid_time_ns[rows], identity[rows]
    replaced = np.zeros(len(rows), dtype=np.bool_)
    replaced[:-1] = (t[1:] == t[:-1]) & (n[1:] == n[:-1])
    if replaced.any():
        findings.notes.append(_told(topic, whole, rows, replaced))
    kept = np.sort(rows[~replaced])
    kept = kept[np.argsort(whole.valid_time_ns[kept], kind="stable")]
    return whole.take(kept.astype(np.int64))


def _identity(columns: Columns) -> Int64:
    """Number of the thing of each row: satellite, station or height."""
    number = np.zeros(len(columns), dtype=np.int64)
    for name in ("satellite", "station", "height_m"):
        if name in columns.values:
            column = columns.values[name]
            if isinstance(column, Ragged):
                column = np.array(column.blobs(), dtype=np.bytes_)
            if column.dtype.kind == "S":
                place = name_numbers(column.astype("S16"))
            else:
                place = np.unique(column, return_inverse=True)[1]
            number = number * (int(place.max(initial=0)) + 1) + place
    return number


def _told(topic: str, whole: Columns, rows: Int64, replaced: Bool) -> str:
    """How many rows were replaced and by how much at most."""
    at = np.flatnonzero(replaced)
    before, after = whole.take(rows[at]), whole.take(rows[at + 1])
    spec = channels.find(topic)
    encode = codec_for(spec.message if spec else "").encode
    pairs = zip(encode(before).blobs(), encode(after).blobs(), strict=True)
    differing = np.array([one != other for one, other in pairs])
    text = f"{topic}: {len(at)} rows stand in two files"
    if not differing.any():
        return f"{text}, the same in both"
    size = ""
    if "position_ecef_m" in whole.values:
        step = _numbers(after, "position_ecef_m") - _numbers(before, "position_ecef_m")
        distance = np.sqrt((step * step).sum(axis=1))
        if np.isfinite(distance).any():
            size = f", positions by {float(np.nanmax(distance)):.4f} m at most"
    elif "clock_s" in whole.values:
        step = _numbers(after, "clock_s") - _numbers(before, "clock_s")
        step = step[np.isfinite(step)] if np.isfinite(step).any() else np.zeros(1)
        # What all clocks share is their reference's, and no receiver feels it.
        rest = step - np.median(step)
        size = (
            f", clocks by {float(np.median(step)) * 1e9:.3f} ns in the middle and "
            f"{float(np.abs(rest).max()) * SPEED_OF_LIGHT_M_S:.4f} m around it at most"
        )
    moments = ", ".join(time.to_text(int(t)) for t in np.unique(after.valid_time_ns)[:3])
    return (
        f"{text} and {int(differing.sum())} differ{size} ({moments}); those of the file that "
        "begins later stand"
    )


def _numbers(columns: Columns, name: str) -> Float64:
    return np.asarray(columns[name], dtype=np.float64)


def check_frames(products: Columns, findings: Findings) -> None:
    """Tell of files in different reference frames; those of one realization are the same."""
    names = products.ragged("source").texts()
    frames = products.ragged("frame").texts()
    stated = {name: frame for name, frame in zip(names, frames, strict=True) if frame}
    if len(set(stated.values())) < 2:
        return
    text = ", ".join(f"{name} {frame}" for name, frame in stated.items())
    if len({_realization(frame) for frame in stated.values()}) == 1:
        findings.notes.append(
            f"reference frames have different names for the same realization: {text}"
        )
        return
    findings.loss(
        "files of products are in different reference frames, which centimetres lie between",
        text,
        len(stated),
        "files",
        "take products of one series",
    )


def _realization(frame: str) -> str:
    """Year of a frame's realization: IGS14, IGb14 and ITRF2014 are the same."""
    match = _FRAME.search(frame.strip().upper())
    return match[1][-2:] if match else frame.strip().upper()
