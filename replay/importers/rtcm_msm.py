"""Multiple signal messages 4 to 7 of RTCM 3 (RTCM 10403.3, 3.5.16)."""

from __future__ import annotations

import dataclasses
from typing import Final

from replay import time
from replay.gnss.signals import wavelength_m
from replay.importers.navbits import Bits, near
from replay.importers.navbits_beidou import BDT_BEHIND_S
from replay.importers.receiver_rows import HALF_CYCLE, NO_CHANNEL
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S

# First number of a system's ten messages less one.
SYSTEMS: Final = {1070: "G", 1080: "R", 1090: "E", 1110: "J", 1120: "C"}
_LAYERS: Final = range(4, 8)
# RTCM 10403.3, tables 3.5-91, -96, -99, -105, -108: signal masks to RINEX codes.
SIGNALS: Final = {
    "G": {2: "1C", 3: "1P", 4: "1W", 8: "2C", 9: "2P", 10: "2W", 15: "2S", 16: "2L", 17: "2X",
          22: "5I", 23: "5Q", 24: "5X", 30: "1S", 31: "1L", 32: "1X"},
    "R": {2: "1C", 3: "1P", 8: "2C", 9: "2P"},
    "E": {2: "1C", 3: "1A", 4: "1B", 5: "1X", 6: "1Z", 8: "6C", 9: "6A", 10: "6B", 11: "6X",
          12: "6Z", 14: "7I", 15: "7Q", 16: "7X", 18: "8I", 19: "8Q", 20: "8X", 22: "5I",
          23: "5Q", 24: "5X"},
    "J": {2: "1C", 9: "6S", 10: "6L", 11: "6X", 15: "2S", 16: "2L", 17: "2X", 22: "5I",
          23: "5Q", 24: "5X", 30: "1S", 31: "1L", 32: "1X"},
    "C": {2: "2I", 3: "2Q", 4: "2X", 8: "6I", 9: "6Q", 10: "6X", 14: "7I", 15: "7Q", 16: "7X",
          22: "5D", 23: "5P", 24: "5X", 25: "7D", 30: "1D", 31: "1P", 32: "1X"},
}  # fmt: skip
_NAN: Final = float("nan")
_MS_M: Final = SPEED_OF_LIGHT_M_S * 1e-3
_NO_RANGE: Final = 255
_NO_RATE: Final = -8192
_MOSCOW_S: Final = 10_800
_DAY_S: Final = 86_400
_UNKNOWN_DAY: Final = 7
_UNKNOWN_CHANNEL: Final = 15


@dataclasses.dataclass(frozen=True, slots=True)
class Measurement:
    """One signal of one satellite, as :func:`receiver_rows.observation_columns` takes it."""

    time_ns: int
    satellite: str
    signal: str
    pseudorange_m: float
    carrier_phase_cycles: float
    doppler_hz: float
    cn0_dbhz: float
    lock_time_s: float
    loss_of_lock: int
    channel: int


def is_msm(number: int) -> bool:
    """Whether a message is one of those that are read here."""
    return number - number % 10 in SYSTEMS and number % 10 in _LAYERS


def system_week_time(number: int, bits: Bits, now_ns: int) -> int:
    """GPS nanoseconds of a message's epoch; reads its 30 bits."""
    system = SYSTEMS[number - number % 10]
    if system != "R":
        return near(bits.u(30) / 1e3, now_ns, BDT_BEHIND_S if system == "C" else 0)
    day, of_day = bits.u(3), bits.u(27) / 1e3
    leap_s = time.leap_seconds(now_ns)
    # Week of UTC, which begins as that of GPS time does; Moscow is three hours ahead.
    if day == _UNKNOWN_DAY:
        moscow_s = (now_ns // time.NS_PER_S - leap_s + _MOSCOW_S) % (7 * _DAY_S)
        day = int((moscow_s - of_day + _DAY_S / 2) // _DAY_S)
    return near(day * _DAY_S + of_day - _MOSCOW_S, now_ns, leap_s)


def measurements(
    number: int, bits: Bits, time_ns: int, channels: dict[str, int]
) -> tuple[list[Measurement], int]:
    """Cells of a message.

    Parameters
    ----------
    number : int
    bits : Bits
        After the epoch's time.
    time_ns : int, ns
    channels : dict of satellite to GLONASS frequency number
        What is known of earlier messages; this one's are added.

    Returns
    -------
    list of Measurement
    int
        Cells of signals without a RINEX code, or without a known carrier.

    Raises
    ------
    ValueError
        Where the message is too short.
    """
    system, layer = SYSTEMS[number - number % 10], number % 10
    fine = layer >= 6
    rates = layer in (5, 7)
    bits.skip(1 + 3 + 7 + 2 + 2 + 1 + 3)
    satellite_mask, signal_mask = bits.u(64), bits.u(32)
    numbers = [n + 1 for n in range(64) if satellite_mask >> (63 - n) & 1]
    kinds = [n + 1 for n in range(32) if signal_mask >> (31 - n) & 1]
    cells = [(n, kind) for n in range(len(numbers)) for kind in kinds if bits.u(1)]

    whole = [bits.u(8) for _ in numbers]
    extended = [bits.u(4) for _ in numbers] if rates else [_UNKNOWN_CHANNEL] * len(numbers)
    rough = [whole_ms + bits.u(10) * 2.0**-10 for whole_ms in whole]
    speed = [bits.s(14) for _ in numbers] if rates else [_NO_RATE] * len(numbers)
    if system == "R":
        for n, channel in zip(numbers, extended, strict=True):
            if channel < 14:
                channels[f"R{n:02d}"] = channel - 7

    code_bits, carrier_bits = (20, 24) if fine else (15, 22)
    code = [_fine(bits, code_bits, 2.0**-29 if fine else 2.0**-24) for _ in cells]
    carrier = [_fine(bits, carrier_bits, 2.0**-31 if fine else 2.0**-29) for _ in cells]
    lock = [lock_extended_s(bits.u(10)) if fine else lock_s(bits.u(4)) for _ in cells]
    half = [bits.u(1) for _ in cells]
    strength = [bits.u(10) * 2.0**-4 if fine else float(bits.u(6)) for _ in cells]
    rate = [_fine(bits, 15, 1e-4) if rates else _NAN for _ in cells]

    found, unknown = [], 0
    for row, (n, kind) in enumerate(cells):
        signal = SIGNALS[system].get(kind)
        if signal is None:
            unknown += 1
            continue
        name = f"{system}{numbers[n]:02d}"
        channel = channels.get(name, NO_CHANNEL) if system == "R" else NO_CHANNEL
        length = _NAN
        if system != "R" or channel != NO_CHANNEL:
            length = wavelength_m(system, int(signal[0]), channel if system == "R" else 0)
        elif carrier[row] == carrier[row]:
            unknown += 1
        rough_ms = rough[n] if whole[n] != _NO_RANGE else _NAN
        rough_m_s = float(speed[n]) if speed[n] != _NO_RATE else _NAN
        found.append(
            Measurement(
                time_ns,
                name,
                signal,
                (rough_ms + code[row]) * _MS_M,
                (rough_ms + carrier[row]) * _MS_M / length,
                -(rough_m_s + rate[row]) / length,
                strength[row] or _NAN,
                lock[row],
                HALF_CYCLE if half[row] else 0,
                channel,
            )
        )
    return found, unknown


def _fine(bits: Bits, width: int, scale: float) -> float:
    """A number whose lowest value says that there is none."""
    number = bits.s(width)
    return _NAN if number == -(1 << (width - 1)) else number * scale


def lock_s(indicator: int) -> float:
    """Lower bound of the lock time (s): table 3.5-74 (DF402)."""
    return 0.0 if indicator == 0 else float(1 << (indicator + 4)) * 1e-3


def lock_extended_s(indicator: int) -> float:
    """Lower bound of the lock time (s): table 3.5-75 (DF407)."""
    if indicator < 64:
        return indicator * 1e-3
    block = min((indicator - 64) // 32 + 1, 21)
    return float((min(indicator, 704) - 32 * block) << block) * 1e-3
