"""Frames of receivers' binary protocols in a stream of bytes.

Receivers mix protocols in one stream, so one scan knows them all, and each reader
takes those of its own. A frame counts only where its check agrees:

======== ================== ============================== =================
kind     begins with        length from                    check
======== ================== ============================== =================
UBX      B5 62              16 bits at 4                   Fletcher, 8 bits
RTCM     D3, 6 bits zero    10 bits at 14 bits             CRC-24Q
NOVATEL  AA 44 12, AA 44 13 header length, 16 bits at 8    CRC-32
                            (short header: 8 bits at 3)
SBF      24 40 ("$@")       16 bits at 6                   CRC-16, CCITT
NMEA     "$", a letter      up to its line end             exclusive or
======== ================== ============================== =================

u-blox interface description, section 3.4; RTCM 10403.3, section 4; NovAtel OEM7
commands and logs, messages; Septentrio SBF reference, section 4.1; NMEA 0183.
"""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.importers.files import File
from replay.importers.findings import Findings
from replay.kernels.frame_loops import (
    CRC16,
    CRC24Q,
    CRC32,
    CUT,
    DAMAGED,
    GOOD,
    Bytes,
    crc24q_of,
    scan_bytes,
)

UBX: Final = 0
RTCM: Final = 1
NOVATEL: Final = 2
SBF: Final = 3
NMEA: Final = 4
NAMES: Final = ("UBX", "RTCM 3", "NovAtel", "SBF", "NMEA")

_OFFSETS_SHOWN: Final = 5
_MEND: Final = "record it again over a line that keeps up; what is whole was read"

Int64 = npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Frames:
    """What a scan found.

    Attributes
    ----------
    data : uint8 array
        Of the file.
    kinds, offsets, lengths : int64 array (n,)
        Of each whole frame, in the order of the file.
    damaged_kinds, damaged_offsets : int64 array (m,)
        Frames whose check fails.
    stray_bytes, stray_offset : int
        How many bytes belong to no frame, not even to a damaged one; the first of them.
    cut_kind, cut_offset : int
        Of a frame that the file's end cuts, -1 where there is none.
    """

    data: Bytes
    kinds: Int64
    offsets: Int64
    lengths: Int64
    damaged_kinds: Int64
    damaged_offsets: Int64
    stray_bytes: int
    stray_offset: int
    cut_kind: int
    cut_offset: int

    def of(self, kind: int) -> tuple[Int64, Int64]:
        """Offsets and lengths of the frames of one kind."""
        rows = self.kinds == kind
        return self.offsets[rows], self.lengths[rows]

    def records(self, offsets: Int64, dtype: np.dtype[np.void]) -> npt.NDArray[np.void]:
        """Packed records that begin at the given bytes, array (n,) of `dtype`."""
        index = offsets[:, None] + np.arange(dtype.itemsize, dtype=np.int64)
        return np.ascontiguousarray(self.data[index]).view(dtype).reshape(-1)


def scan(file: File, kind: int, findings: Findings) -> Frames:
    """Frames of a file; what is damaged is counted.

    Parameters
    ----------
    file : File
    kind : int
        The protocol that is read.
    findings : Findings

    Raises
    ------
    ForeignFileError
        Where something is damaged and the import strict.
    """
    frames = find_frames(file.data, kind)
    for number in sorted({kind, NMEA}):
        at = frames.damaged_offsets[frames.damaged_kinds == number]
        if len(at):
            what = f"the check of {NAMES[number]} frames fails; skipped"
            findings.loss(what, _where(file.name, at), len(at), "frames", _MEND)
    if frames.stray_bytes:
        findings.loss(
            "bytes belong to no frame; skipped",
            f"{file.name}, from byte {frames.stray_offset}",
            frames.stray_bytes,
            "bytes",
            _MEND,
        )
    if frames.cut_offset >= 0:
        findings.loss(
            f"the file ends inside a frame of {NAMES[frames.cut_kind]}; skipped",
            f"{file.name}, byte {frames.cut_offset}",
            len(file.data) - frames.cut_offset,
            "bytes",
            "fetch the file again",
        )
    return frames


def _where(name: str, offsets: Int64) -> str:
    shown = ", ".join(str(at) for at in offsets[:_OFFSETS_SHOWN].tolist())
    label = "byte" if len(offsets) == 1 else "bytes"
    return f"{name}, {label} {shown}{', …' if len(offsets) > _OFFSETS_SHOWN else ''}"


def note_others(file: File, frames: Frames, kind: int, findings: Findings) -> None:
    """Say how many frames of other protocols the file holds."""
    for other, name in enumerate(NAMES):
        count = int((frames.kinds == other).sum())
        if other != kind and count:
            findings.notes.append(f"{file.name}: {count} {name} frames are not of this format")


def find_frames(data: bytes, kind: int) -> Frames:
    """Frames of all protocols in a stream of bytes; damaged ones of `kind` and of NMEA."""
    raw = np.frombuffer(data, dtype=np.uint8)
    none = np.zeros((0, 4), dtype=np.int64)
    count = scan_bytes(raw, kind, CRC24Q, CRC16, CRC32, none)[0]
    found = np.zeros((count, 4), dtype=np.int64)
    _, stray, stray_at = scan_bytes(raw, kind, CRC24Q, CRC16, CRC32, found)
    good = found[found[:, 0] == GOOD]
    bad = found[found[:, 0] == DAMAGED]
    bad = bad[np.argsort(bad[:, 2])]
    cut = found[found[:, 0] == CUT]
    return Frames(
        raw,
        np.ascontiguousarray(good[:, 1]),
        np.ascontiguousarray(good[:, 2]),
        np.ascontiguousarray(good[:, 3]),
        np.ascontiguousarray(bad[:, 1]),
        np.ascontiguousarray(bad[:, 2]),
        int(stray),
        int(stray_at),
        int(cut[0, 1]) if len(cut) else -1,
        int(cut[0, 2]) if len(cut) else -1,
    )


def crc24q(data: bytes) -> int:
    """CRC-24Q of bytes, as RTCM 3 and Galileo use it: polynomial 0x1864CFB, start 0."""
    return int(crc24q_of(np.frombuffer(data, dtype=np.uint8), 0, len(data), CRC24Q))
