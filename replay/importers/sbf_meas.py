"""MeasEpoch of Septentrio receivers: observations (SBF reference guide, 4.2.1)."""

from __future__ import annotations

import struct
from typing import Final

import numpy as np

from replay.gnss.signals import frequency_hz
from replay.importers.findings import Findings
from replay.importers.receiver_rows import (
    HALF_CYCLE,
    LOST,
    NO_CHANNEL,
    lost_lock,
    observation_columns,
)
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.log.columns import Columns

HEAD_BYTES: Final = 20  # block header, time stamp, counts and flags
_FIRST: Final = struct.Struct("<BBBBIiHbBHBB")
_SECOND: Final = struct.Struct("<BBBBbBHHH")
# SBF reference guide, 4.1.10: signal numbers, with the codes of RINEX 3.05.
SIGNALS: Final = {
    0: "1C", 1: "1W", 2: "2W", 3: "2L", 4: "5Q", 5: "1L", 6: "1C", 7: "2L", 8: "1C", 9: "1P",
    10: "2P", 11: "2C", 12: "3Q", 13: "1P", 14: "5P", 15: "5A", 17: "1C", 19: "6C", 20: "5Q",
    21: "7Q", 22: "8Q", 24: "1C", 25: "5I", 26: "5Q", 27: "6L", 28: "2I", 29: "7I", 30: "6I",
    32: "1L", 33: "1Z", 34: "7D", 38: "1E", 39: "5P",
}  # fmt: skip
_HIGH: Final = 31  # the signal's number stands elsewhere
_GLONASS_SIGNALS: Final = range(8, 12)
_P_CODES: Final = (1, 2)  # whose strength has no offset of 10 dB
_NAN: Final = float("nan")
# First number of a range of SVID, its last, letter, what is taken off (4.1.9).
_RANGES: Final = (
    (1, 37, "G", 0), (38, 61, "R", 37), (63, 68, "R", 38), (71, 106, "E", 70),
    (120, 140, "S", 100), (141, 180, "C", 140), (181, 190, "J", 180), (191, 197, "I", 190),
    (198, 215, "S", 157), (216, 222, "I", 208), (223, 245, "C", 182),
)  # fmt: skip

Row = tuple[int, str, str, float, float, float, float, float, int, int]


def satellite(number: int) -> str:
    """RINEX 3 satellite of an SVID, or nothing."""
    for first, last, letter, less in _RANGES:
        if first <= number <= last:
            return f"{letter}{number - less:02d}"
    return ""


class Measurements:
    """MeasEpoch blocks in the order of the file."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.unknown = 0

    def add(self, block: memoryview, time_ns: int) -> None:
        """One block.

        Raises
        ------
        struct.error
            Where it is shorter than it says.
        """
        count, first_bytes, second_bytes = block[14], block[15], block[16]
        at = HEAD_BYTES
        for _ in range(count):
            first = _FIRST.unpack_from(block, at)
            at += first_bytes
            base = self._first(first, time_ns)
            for _ in range(first[11]):
                self._second(_SECOND.unpack_from(block, at), base, time_ns)
                at += second_bytes

    def _first(self, row: tuple[int, ...], time_ns: int) -> tuple[int, float, float, float, int]:
        """The channel's main signal; gives what the others are told against."""
        _, kind, number, misc, code, doppler, low, high, cn0, lock, info, _ = row
        signal, channel = _signal(kind, info)
        hertz = _hertz(number, signal, channel)
        code_m = ((misc & 15) * 4294967296 + code) * 1e-3 if (misc & 15) or code else _NAN
        rate = doppler * 1e-4 if doppler != -(1 << 31) else _NAN
        cycles = _NAN
        if not (high == -128 and low == 0):
            cycles = code_m * hertz / SPEED_OF_LIGHT_M_S + (high * 65536 + low) * 1e-3
        seconds = float(lock) if lock != 65535 else _NAN
        self._put(time_ns, number, signal, code_m, cycles, rate, cn0, seconds, info, channel)
        return number, hertz, code_m, rate, channel

    def _second(
        self, row: tuple[int, ...], base: tuple[int, float, float, float, int], time_ns: int
    ) -> None:
        kind, lock, cn0, offsets, high, info, code_low, low, doppler_low = row
        number, base_hertz, base_code_m, base_rate, channel = base
        signal, own = _signal(kind, info)
        channel = own if own != NO_CHANNEL else channel
        hertz = _hertz(number, signal, channel)
        code_high = _signed(offsets & 7, 3)
        doppler_high = _signed(offsets >> 3, 5)
        code_m = base_code_m + (code_high * 65536 + code_low) * 1e-3
        if code_high == -4 and code_low == 0:
            code_m = _NAN
        rate = base_rate * hertz / base_hertz + (doppler_high * 65536 + doppler_low) * 1e-4
        if doppler_high == -16 and doppler_low == 0:
            rate = _NAN
        cycles = _NAN
        if not (high == -128 and low == 0):
            cycles = code_m * hertz / SPEED_OF_LIGHT_M_S + (high * 65536 + low) * 1e-3
        seconds = float(lock) if lock != 255 else _NAN
        self._put(time_ns, number, signal, code_m, cycles, rate, cn0, seconds, info, channel)

    def _put(
        self, time_ns: int, number: int, signal: int, code_m: float, cycles: float, rate: float,
        cn0: int, lock_s: float, info: int, channel: int,
    ) -> None:  # fmt: skip
        name, code = satellite(number), SIGNALS.get(signal, "")
        if not name or not code:
            self.unknown += 1
            return
        strength = _NAN
        if cn0 != 255:
            strength = cn0 * 0.25 + (0.0 if signal in _P_CODES else 10.0)
        half = HALF_CYCLE if info & 4 else 0
        self.rows.append(
            (time_ns, name, code, code_m, cycles, rate, strength, lock_s, half, channel)
        )

    def columns(self, where: str, findings: Findings) -> Columns | None:
        """Rows of `replay.GnssObservation`."""
        if self.unknown:
            what = "measurements of satellites or signals without a RINEX code; skipped"
            findings.loss(what, where, self.unknown, "rows", "none is known")
        if not self.rows:
            return None
        fields = list(zip(*self.rows, strict=True))
        times = np.array(fields[0], dtype=np.int64)
        names, codes = np.array(fields[1], dtype="S3"), np.array(fields[2], dtype="S2")
        keys = ("pseudorange_m", "carrier_phase_cycles", "doppler_hz", "cn0_dbhz", "lock_time_s")
        values = {key: np.array(fields[3 + k], dtype=np.float64) for k, key in enumerate(keys)}
        lost = lost_lock(times, names, codes, values["lock_time_s"], exact=False)
        loss = np.array(fields[8], dtype=np.int64) | lost * np.int64(LOST)
        channel = np.array(fields[9], dtype=np.int64)
        return observation_columns(times, names, codes, values, loss, channel, where, findings)


def _signal(kind: int, info: int) -> tuple[int, int]:
    """Number of the signal and GLONASS frequency number."""
    low = kind & 31
    if low == _HIGH:
        return (info >> 3) + 32, NO_CHANNEL
    return low, (info >> 3) - 8 if low in _GLONASS_SIGNALS else NO_CHANNEL


def _hertz(number: int, signal: int, channel: int) -> float:
    name, code = satellite(number), SIGNALS.get(signal, "")
    if not name or not code:
        return _NAN
    letter = "G" if name[0] in "SI" else name[0]
    return frequency_hz(letter, int(code[0]), channel if letter == "R" and channel > -8 else 0)


def _signed(value: int, width: int) -> int:
    return value - (1 << width) if value >> (width - 1) else value
