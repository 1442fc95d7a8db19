"""Compiled loops over bytes: where frames begin and whether their checks agree."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

Bytes = npt.NDArray[np.uint8]
Whole = int | np.int64

GOOD: Final = 0
DAMAGED: Final = 1
CUT: Final = 2
_NONE: Final = -1
_LONGEST_NMEA: Final = 128


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


CRC24Q: Final = _table(0x864CFB, 24)
CRC16: Final = _table(0x1021, 16)
CRC32: Final = _reflected(0xEDB88320)


@njit(cache=True)
def crc24q_of(data: Bytes, start: Whole, end: Whole, table: npt.NDArray[np.uint32]) -> Whole:
    """CRC-24Q of some bytes."""
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
        return CUT, n - at
    length: Whole = _le16(data, at + 4) + 8
    if at + length > n:
        return CUT, length
    a: Whole = 0
    b: Whole = 0
    for i in range(at + 2, at + length - 2):
        a = (a + np.int64(data[i])) & 0xFF
        b = (b + a) & 0xFF
    good = a == data[at + length - 2] and b == data[at + length - 1]
    return (GOOD if good else DAMAGED), length


@njit(cache=True)
def _rtcm(data: Bytes, at: Whole, n: int, table: npt.NDArray[np.uint32]) -> tuple[int, Whole]:
    if at + 3 > n:
        return CUT, n - at
    length = ((np.int64(data[at + 1]) << 8) | np.int64(data[at + 2])) + 6
    if at + length > n:
        return CUT, length
    end = at + length - 3
    sent = np.int64(data[end]) << 16 | np.int64(data[end + 1]) << 8 | np.int64(data[end + 2])
    return (GOOD if crc24q_of(data, at, end, table) == sent else DAMAGED), length


@njit(cache=True)
def _novatel(data: Bytes, at: Whole, n: int, table: npt.NDArray[np.uint32]) -> tuple[int, Whole]:
    if at + 12 > n:
        return CUT, n - at
    if data[at + 2] == 0x13:
        length = 12 + np.int64(data[at + 3]) + 4
    else:
        length = np.int64(data[at + 3]) + _le16(data, at + 8) + 4
    if at + length > n:
        return CUT, length
    end = at + length - 4
    sent = _le16(data, end) | (_le16(data, end + 2) << 16)
    return (GOOD if _crc32(data, at, end, table) == sent else DAMAGED), length


@njit(cache=True)
def _sbf(data: Bytes, at: Whole, n: int, table: npt.NDArray[np.uint32]) -> tuple[int, Whole]:
    if at + 8 > n:
        return CUT, n - at
    length = _le16(data, at + 6)
    if length < 8 or length % 4:
        return _NONE, 0
    if at + length > n:
        return CUT, length
    good = _crc16(data, at + 4, at + length, table) == _le16(data, at + 2)
    return (GOOD if good else DAMAGED), length


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
        return (CUT if last == n else _NONE), n - at
    if i >= last:
        return _NONE, 0
    high, low = _hex(data[i + 1]), _hex(data[i + 2])
    if high < 0 or low < 0:
        return _NONE, 0
    end = i + 3
    while end < n and end < i + 5 and (data[end] == 13 or data[end] == 10):
        end += 1
    return (GOOD if total == high * 16 + low else DAMAGED), end - at


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
def scan_bytes(
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
        if state == GOOD:
            if cut_at >= 0:
                # The frame claimed more than there is, but whole ones follow: it is damaged.
                if count < room:
                    found[count, 0], found[count, 1], found[count, 2] = DAMAGED, cut_kind, cut_at
                count += 1
                cut_at = -1
            if count < room:
                found[count, 0], found[count, 1] = GOOD, kind
                found[count, 2], found[count, 3] = at, length
            count += 1
            at += length
            claimed = at
            continue
        if at >= claimed:
            ours = kind == wanted or kind == 4
            if state == DAMAGED and ours:
                if count < room:
                    found[count, 0], found[count, 1] = DAMAGED, kind
                    found[count, 2], found[count, 3] = at, length
                count += 1
                claimed = at + length
            elif state == CUT and ours:
                cut_kind, cut_at = kind, at
                claimed = n
            else:
                stray += 1
                if stray_at < 0:
                    stray_at = at
        at += 1
    if cut_at >= 0:
        if count < room:
            found[count, 0], found[count, 1] = CUT, cut_kind
            found[count, 2], found[count, 3] = cut_at, n - cut_at
        count += 1
    return count, stray, stray_at
