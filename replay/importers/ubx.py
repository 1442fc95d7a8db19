"""UBX of u-blox receivers as channels.

Read are RXM-RAWX (observations), RXM-SFRBX (ephemerides, ionosphere) and NAV-PVT with
NAV-HPPOSLLH (the receiver's own fixes). Messages of other kinds are counted in a note;
NMEA and RTCM in the same file too.

Frames are found by a compiled scan and fields read as numpy records: in one run on one
machine some 25 000 messages a second, where pyubx2, which makes an object of each, read
400. It serves as the reference of the tests.
"""

from __future__ import annotations

import collections
from collections.abc import Sequence
from typing import Final

import numpy as np

from replay import channels
from replay.errors import ForeignFileError
from replay.importers import frames as framing
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.receiver_rows import Navigation, truth_of_fixes
from replay.importers.table import Int64
from replay.importers.ubx_nav import decode_pvt
from replay.importers.ubx_rawx import decode_rawx
from replay.importers.ubx_sfrbx import SubframeDecoder
from replay.log.columns import Columns

_RAWX: Final = 0x0215
_SFRBX: Final = 0x0213
_PVT: Final = 0x0107
_HPPOSLLH: Final = 0x0114
_READ: Final = (_RAWX, _SFRBX, _PVT, _HPPOSLLH)
_NAMES: Final = {
    0x0103: "NAV-STATUS", 0x0122: "NAV-CLOCK", 0x0135: "NAV-SAT", 0x0143: "NAV-SIG",
    0x013C: "NAV-RELPOSNED", 0x0161: "NAV-EOE", 0x0214: "RXM-MEASX", 0x0232: "RXM-RTCM",
    0x0234: "RXM-COR", 0x0D01: "TIM-TP", 0x0D03: "TIM-TM2 (time marks)",
    0x1002: "ESF-MEAS", 0x1003: "ESF-RAW", 0x1010: "ESF-STATUS", 0x1014: "ESF-ALG",
    0x1015: "ESF-INS", 0x0A04: "MON-VER", 0x0A09: "MON-HW",
}  # fmt: skip


def read_ubx(
    file: File,
    findings: Findings,
    *,
    receiver: str,
    lever_arm_m: Sequence[float] = (0.0, 0.0, 0.0),
    approximate_ns: int | None = None,
    truth: bool = False,
) -> dict[str, Columns]:
    """Channels of a UBX file.

    Parameters
    ----------
    file : File
    findings : Findings
        Damaged frames are losses; messages that are not read are notes.
    receiver : str
        Name in the topics.
    lever_arm_m : sequence of 3 float, m
        IMU to antenna, body, for the receiver's fixes.
    approximate_ns : int, optional
        A time near the file's, GPS nanoseconds, for subframes of a file without
        RXM-RAWX and NAV-PVT, which alone tell the time.
    truth : bool
        Whether the receiver's fixes are given as truth too.

    Raises
    ------
    ForeignFileError
        Where the file holds no UBX frame, or something is damaged and the import strict.
    """
    frames = framing.scan(file, framing.UBX, findings)
    offsets, lengths = frames.of(framing.UBX)
    if not len(offsets):
        raise ForeignFileError(
            "the file holds no UBX frame",
            where=file.name,
            mend="is it another receiver's? see the formats of replay.importers.streams",
        )
    kinds = frames.data[offsets + 2].astype(np.int64) << 8 | frames.data[offsets + 3]

    def of(kind: int) -> tuple[Int64, Int64]:
        rows = kinds == kind
        return offsets[rows], lengths[rows]

    found: dict[str, Columns] = {}
    observed, epochs = decode_rawx(file, frames, *of(_RAWX), receiver, findings)
    found.update(observed)
    fixes, at, at_ns = decode_pvt(file, frames, of(_PVT), of(_HPPOSLLH), lever_arm_m, findings)
    if fixes is not None:
        found[channels.GNSS_FIX.at(receiver=receiver)] = fixes
        if truth:
            found[channels.TRUTH.topic] = truth_of_fixes(fixes)
    raw_at = of(_RAWX)[0]
    if len(raw_at) == len(epochs):
        at, at_ns = np.concatenate([at, raw_at]), np.concatenate([at_ns, epochs])
    subframes = of(_SFRBX)
    if len(subframes[0]):
        times = _times_at(subframes[0], at, at_ns, approximate_ns)
        if times is None:
            findings.loss(
                "nothing in the file tells the time of its navigation messages; skipped",
                file.name,
                len(subframes[0]),
                "messages",
                'give `approximate_time = "2025-08-28T17:30:00"` in the stream, GPS time',
            )
        else:
            navigation = Navigation()
            decoder = SubframeDecoder(file, navigation)
            decoder.run(frames, *subframes, times)
            decoder.report(findings)
            found.update(navigation.columns())
    unread = collections.Counter(kinds[~np.isin(kinds, _READ)].tolist())
    if unread:
        names = [f"{_NAMES.get(k, f'{k >> 8:02X} {k & 255:02X}')}: {n}" for k, n in unread.items()]
        findings.notes.append(
            f"{file.name}: messages that are not read: {', '.join(sorted(names))}"
        )
    framing.note_others(file, frames, framing.UBX, findings)
    return found


def _times_at(
    offsets: Int64, known: Int64, known_ns: Int64, approximate_ns: int | None
) -> Int64 | None:
    """Time of frames that do not tell it: that of the last one before them that does."""
    if not len(known):
        return None if approximate_ns is None else np.full(len(offsets), approximate_ns)
    order = np.argsort(known)
    place = np.searchsorted(known[order], offsets) - 1
    return known_ns[order][np.maximum(place, 0)]
