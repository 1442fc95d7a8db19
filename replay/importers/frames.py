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
from numba import njit

import replay.kernels  # noqa: F401  sets the folder of numba's cache
from replay.importers.files import File
from replay.importers.findings import Findings

UBX: Final = 0
RTCM: Final = 1
NOVATEL: Final = 2
SBF: Final = 3
NMEA: Final = 4
NAMES: Final = ("UBX", "RTCM 3", "NovAtel", "SBF", "NMEA")

_GOOD: Final = 0
_DAMAGED: Final = 1
_CUT: Final = 2
_NONE: Final = -1
_LONGEST_NMEA: Final = 128
_OFFSETS_SHOWN: Final = 5
_MEND: Final = "record it again over a line that keeps up; what is whole was read"

Int64 = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]
Whole = int | np.int64


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
    count = _scan(raw, kind, _CRC24Q, _CRC16, _CRC32, none)[0]
    found = np.zeros((count, 4), dtype=np.int64)
    _, stray, stray_at = _scan(raw, kind, _CRC24Q, _CRC16, _CRC32, found)
    good = found[found[:, 0] == _GOOD]
    bad = found[found[:, 0] == _DAMAGED]
    bad = bad[np.argsort(bad[:, 2])]
    cut = found[found[:, 0] == _CUT]
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
    return int(_crc24q(np.frombuffer(data, dtype=np.uint8), 0, len(data), _CRC24Q))


def _table(polynomial: int, width: int) -> npt.NDArray[np.uint32]:
    """Remainders of each byte, highest bit first."""
    top, mask = 1 << (width - 1), (1 << width) - 1
    table = np.zeros(256, dtype=np.uint32)
    for byte in range(256):
        rest = byte << (width - 8)
        for _ in range(8):
            rest = ((rest << 1) ^ polynomial) & mask if rest & top else (rest << 1) & mask
        table[byte] = rest
    return table


def _reflected(polynomial: int) -> npt.NDArray[np.uint32]:
    """Remainders of each byte, lowest bit first."""
    table = np.zeros(256, dtype=np.uint32)
    for byte in range(256):
        rest = byte
        for _ in range(8):
            rest = (rest >> 1) ^ polynomial if rest & 1 else rest >> 1
        table[byte] = rest
    return table


_CRC24Q: Final = _table(0x864CFB, 24)
_CRC16: Final = _table(0x1021, 16)
_CRC32: Final = _reflected(0xEDB88320)


@njit(cache=True)
def _crc24q(data: Bytes, start: Whole, end: Whole, table: npt.NDArray[np.uint32]) -> Whole:
    crc = np.uint32(0)
    for i in range(start, end):
        index = ((crc >> np.uint32(16)) ^ np.uint32(data[i])) & np.uint32(0xFF)
        crc = ((crc << np.uint32(8)) & np.uint32(0xFFFFFF)) ^ table[index]
    return np.int64(crc)


@njit(cache=True)
def _crc16(data: Bytes, start: Whole, end: Whole, table: npt.NDArray[np.uint32]) -> Whole:
    crc = np.uint32(0)
    for i in range(start, end):
        index = ((crc >> np.uint32(8)) ^ np.uint32(data[i])) & np.uint32(0xFF)
        crc = ((crc << np.uint32(8)) & np.uint32(0xFFFF)) ^ table[index]
    return np.int64(crc)


@njit(cache=True)
def _crc32(data: Bytes, start: Whole, end: Whole, table: npt.NDArray[np.uint32]) -> Whole:
    """CRC-32 without the usual inversions, as NovAtel writes it."""
    crc = np.uint32(0)
    for i in range(start, end):
        index = (crc ^ np.uint32(data[i])) & np.uint32(0xFF)
        crc = (crc >> np.uint32(8)) ^ table[index]
    return np.int64(crc)


@njit(cache=True)
def _le16(data: Bytes, at: Whole) -> Whole:
    return np.int64(data[at]) | (np.int64(data[at + 1]) << 8)


@njit(cache=True)
def _hex(byte: Whole) -> Whole:
    if 48 <= byte <= 57:
        return byte - 48
    if 65 <= byte <= 70:
        return byte - 55
    if 97 <= byte <= 102:
        return byte - 87
    return -1


@njit(cache=True)
def _ubx(data: Bytes, at: Whole, n: int) -> tuple[int, Whole]:
    """State and length of a UBX frame at a byte."""
    if at + 6 > n:
        return _CUT, n - at
    length: Whole = _le16(data, at + 4) + 8
    if at + length > n:
        return _CUT, length
    a: Whole = 0
    b: Whole = 0
    for i in range(at + 2, at + length - 2):
        a = (a + np.int64(data[i])) & 0xFF
        b = (b + a) & 0xFF
    good = a == data[at + length - 2] and b == data[at + length - 1]
    return (_GOOD if good else _DAMAGED), length


@njit(cache=True)
def _rtcm(data: Bytes, at: Whole, n: int, table: npt.NDArray[np.uint32]) -> tuple[int, Whole]:
    if at + 3 > n:
        return _CUT, n - at
    length = ((np.int64(data[at + 1]) << 8) | np.int64(data[at + 2])) + 6
    if at + length > n:
        return _CUT, length
    end = at + length - 3
    sent = np.int64(data[end]) << 16 | np.int64(data[end + 1]) << 8 | np.int64(data[end + 2])
    return (_GOOD if _crc24q(data, at, end, table) == sent else _DAMAGED), length


@njit(cache=True)
def _novatel(data: Bytes, at: Whole, n: int, table: npt.NDArray[np.uint32]) -> tuple[int, Whole]:
    if at + 12 > n:
        return _CUT, n - at
    if data[at + 2] == 0x13:
        length = 12 + np.int64(data[at + 3]) + 4
    else:
        length = np.int64(data[at + 3]) + _le16(data, at + 8) + 4
    if at + length > n:
        return _CUT, length
    end = at + length - 4
    sent = _le16(data, end) | (_le16(data, end + 2) << 16)
    return (_GOOD if _crc32(data, at, end, table) == sent else _DAMAGED), length


@njit(cache=True)
def _sbf(data: Bytes, at: Whole, n: int, table: npt.NDArray[np.uint32]) -> tuple[int, Whole]:
    if at + 8 > n:
        return _CUT, n - at
    length = _le16(data, at + 6)
    if length < 8 or length % 4:
        return _NONE, 0
    if at + length > n:
        return _CUT, length
    good = _crc16(data, at + 4, at + length, table) == _le16(data, at + 2)
    return (_GOOD if good else _DAMAGED), length


@njit(cache=True)
def _nmea(data: Bytes, at: Whole, n: int) -> tuple[int, Whole]:
    """A sentence with its line end; one without a check is none."""
    total = 0
    last = min(n, at + _LONGEST_NMEA)
    i = at + 1
    while i < last:
        byte = data[i]
        if byte == 42:  # '*'
            break
        if byte < 32 or byte > 126 or byte == 36:
            return _NONE, 0
        total ^= byte
        i += 1
    if i + 2 >= n:
        return (_CUT if last == n else _NONE), n - at
    if i >= last:
        return _NONE, 0
    high, low = _hex(data[i + 1]), _hex(data[i + 2])
    if high < 0 or low < 0:
        return _NONE, 0
    end = i + 3
    while end < n and end < i + 5 and (data[end] == 13 or data[end] == 10):
        end += 1
    return (_GOOD if total == high * 16 + low else _DAMAGED), end - at


@njit(cache=True)
def _frame(
    data: Bytes,
    at: Whole,
    n: int,
    crc24: npt.NDArray[np.uint32],
    crc16: npt.NDArray[np.uint32],
    crc32: npt.NDArray[np.uint32],
) -> tuple[int, int, Whole]:
    """State, kind and length of a frame that begins at a byte."""
    first = data[at]
    second = data[at + 1] if at + 1 < n else 0
    if first == 0xB5 and second == 0x62:
        state, length = _ubx(data, at, n)
        return state, 0, length
    if first == 0xD3 and second & 0xFC == 0:
        state, length = _rtcm(data, at, n, crc24)
        return state, 1, length
    if first == 0xAA and second == 0x44 and at + 2 < n and data[at + 2] in (0x12, 0x13):
        state, length = _novatel(data, at, n, crc32)
        return state, 2, length
    if first == 0x24:
        if second == 0x40:
            state, length = _sbf(data, at, n, crc16)
            return state, 3, length
        if 65 <= second <= 90:
            state, length = _nmea(data, at, n)
            return state, 4, length
    return _NONE, 0, 0


@njit(cache=True)
def _scan(
    data: Bytes,
    wanted: int,
    crc24: npt.NDArray[np.uint32],
    crc16: npt.NDArray[np.uint32],
    crc32: npt.NDArray[np.uint32],
    found: npt.NDArray[np.int64],
) -> tuple[int, int, Whole]:
    """Write state, kind, offset and length of each frame; without room, only count them.

    A frame whose check fails hides the bytes that it claims until the next whole
    frame: they are counted with it, not as strays. So does one that the end cuts.
    What looks like a damaged frame of a protocol that is neither `wanted` nor NMEA
    is more likely no frame at all, and counts as strays.
    """
    n = len(data)
    room = len(found)
    count = 0
    stray = 0
    stray_at: Whole = -1
    claimed: Whole = 0  # end of the bytes that a damaged frame claims
    cut_kind = -1
    cut_at: Whole = -1
    at: Whole = 0
    while at < n:
        state, kind, length = _frame(data, at, n, crc24, crc16, crc32)
        if state == _GOOD:
            if cut_at >= 0:
                # The frame claimed more than there is, but whole ones follow: it is damaged.
                if count < room:
                    found[count, 0], found[count, 1], found[count, 2] = _DAMAGED, cut_kind, cut_at
                count += 1
                cut_at = -1
            if count < room:
                found[count, 0], found[count, 1] = _GOOD, kind
                found[count, 2], found[count, 3] = at, length
            count += 1
            at += length
            claimed = at
            continue
        if at >= claimed:
            ours = kind == wanted or kind == 4
            if state == _DAMAGED and ours:
                if count < room:
                    found[count, 0], found[count, 1] = _DAMAGED, kind
                    found[count, 2], found[count, 3] = at, length
                count += 1
                claimed = at + length
            elif state == _CUT and ours:
                cut_kind, cut_at = kind, at
                claimed = n
            else:
                stray += 1
                if stray_at < 0:
                    stray_at = at
        at += 1
    if cut_at >= 0:
        if count < room:
            found[count, 0], found[count, 1] = _CUT, cut_kind
            found[count, 2], found[count, 3] = cut_at, n - cut_at
        count += 1
    return count, stray, stray_at
