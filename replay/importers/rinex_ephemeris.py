"""Navigation records of RINEX to ephemerides, one function per kind of orbit."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from replay import time
from replay.importers.rinex_epochs import Clock
from replay.kernels.ephemeris import EPHEMERIS_DTYPE

_WEEK_S: Final = 604_800
_HALF_WEEK_NS: Final = time.NS_PER_WEEK // 2
_DAY_NS: Final = 86_400 * time.NS_PER_S
_UNKNOWN_TIME_S: Final = 0.9998e9  # RINEX 3.05, A6: 0.9999E9 where not known
_MOSCOW_S: Final = 10_800
_TB_S: Final = 900
_QZSS_FIT_S: Final = 7200.0
_HOUR_S: Final = 3600.0

# Place of each number after the clock's three, RINEX 3.05 tables A6 to A16.
_ORBIT: Final = {
    "crs": 1, "delta_n": 2, "m0": 3, "cuc": 4, "eccentricity": 5, "cus": 6, "sqrt_a": 7,
    "toe_s": 8, "cic": 9, "omega0": 10, "cis": 11, "i0": 12, "crc": 13, "omega": 14,
    "omega_dot": 15, "i_dot": 16,
}  # fmt: skip
_ACCURACY: Final = 20
_HEALTH: Final = {"G": 21, "J": 21, "C": 21, "E": 21}
_DELAY_1: Final = 22
_DELAY_2_OR_IODC: Final = 23
_TRANSMITTED: Final = 24
_LAST: Final = 25
_KEPLER_NUMBERS: Final = 28
_GLONASS_NUMBERS: Final = 12


@dataclasses.dataclass(frozen=True, slots=True)
class Message:
    """A navigation record.

    Attributes
    ----------
    system : str
        RINEX letter.
    prn : int
    epoch : bytes
        Date and time as they stand.
    clock : sequence of float
        The three numbers of the first line.
    orbit : sequence of float or None
        The numbers of the other lines, None where blank.
    """

    system: str
    prn: int
    epoch: bytes
    clock: Sequence[float | None]
    orbit: Sequence[float | None]


class Clocks:
    """Clock of each system's records; minutes are remembered."""

    def __init__(self) -> None:
        self._gps = Clock("GPS")
        self._own = {"R": Clock("UTC"), "C": Clock("BDT")}

    def of(self, system: str) -> Clock:
        """Clock of one system."""
        return self._own.get(system, self._gps)


def ephemeris(message: Message, clocks: Clocks) -> Any:
    """A record of EPHEMERIS_DTYPE.

    Raises
    ------
    ValueError
        Where a number is missing that the orbit or clock needs, or the date is none.
    """
    record = np.zeros((), dtype=EPHEMERIS_DTYPE)
    record["system"], record["prn"] = ord(message.system), message.prn
    toc = _epoch(message.epoch, clocks.of(message.system))
    record["toc_ns"] = toc
    record["af0"], record["af1"] = _needed(message.clock, 0), _needed(message.clock, 1)
    if message.system == "R":
        _glonass(record, message, toc)
    else:
        record["af2"] = _needed(message.clock, 2)
        _kepler(record, message, toc)
    return record


def _epoch(text: bytes, clock: Clock) -> int:
    """`2021 09 22 02 00 00` or `21  1  1  0  0  0.0`."""
    parts = text.split()
    if len(parts) != 6:
        raise ValueError("no date")
    seconds = parts[5] if b"." in parts[5] else parts[5] + b".0"
    return clock.read(b" ".join(parts[:5]) + seconds.rjust(11))


def _needed(numbers: Sequence[float | None], index: int) -> float:
    value = numbers[index] if index < len(numbers) else None
    if value is None:
        raise ValueError(f"number {index + 1} is missing")
    return value


def _optional(numbers: Sequence[float | None], index: int) -> float:
    value = numbers[index] if index < len(numbers) else None
    return 0.0 if value is None else value


def _near(seconds: float, toc_ns: int, offset_s: int) -> int:
    """Seconds of a system's week as the moment nearest to the clock's time.

    The week's number in the file may be cut to ten bits or be the wrong one
    around its end; the clock's date has neither trouble.
    """
    offset_ns = offset_s * time.NS_PER_S
    in_week = int(time.from_week(0, seconds)) + offset_ns
    turns = (toc_ns - in_week + _HALF_WEEK_NS) // time.NS_PER_WEEK
    return in_week + turns * time.NS_PER_WEEK


def _kepler(record: Any, message: Message, toc: int) -> None:
    system, orbit = message.system, message.orbit
    offset_s = 14 if system == "C" else 0
    for name, index in _ORBIT.items():
        record[name] = _needed(orbit, index)
    toe_s = float(record["toe_s"])
    if not 0.0 <= toe_s <= _WEEK_S:
        raise ValueError("the time of ephemeris is outside of a week")
    record["toe_ns"] = _near(toe_s, toc, offset_s)
    sent = _optional(orbit, _TRANSMITTED)
    if len(orbit) > _TRANSMITTED and orbit[_TRANSMITTED] is not None and sent < _UNKNOWN_TIME_S:
        record["transmitted_ns"] = _near(sent, toc, offset_s)
    record["iode"] = round(_needed(orbit, 0))
    record["accuracy_m"] = _optional(orbit, _ACCURACY)
    record["health"] = round(_optional(orbit, _HEALTH[system]))
    record["group_delay_1_s"] = _optional(orbit, _DELAY_1)
    if system in "GJ":
        record["iodc"] = round(_optional(orbit, _DELAY_2_OR_IODC))
        fit = _optional(orbit, _LAST)
        if system == "G":
            record["fit_s"] = fit * _HOUR_S
        elif len(orbit) > _LAST and orbit[_LAST] == 0.0:
            record["fit_s"] = _QZSS_FIT_S
    else:
        record["group_delay_2_s"] = _optional(orbit, _DELAY_2_OR_IODC)
        if system == "C":
            record["iodc"] = round(_optional(orbit, _LAST))
        else:
            record["source"] = round(_optional(orbit, 17))


def _glonass(record: Any, message: Message, toc: int) -> None:
    orbit = message.orbit
    record["toe_ns"] = toc
    for axis in range(3):
        for at, name in enumerate(("position_m", "velocity_m_s", "acceleration_m_s2")):
            record[name][axis] = _needed(orbit, 4 * axis + at) * 1e3
    record["health"] = round(_needed(orbit, 3))
    record["frequency_channel"] = round(_needed(orbit, 7))
    leap_s = time.leap_seconds(toc)
    utc_ns = toc - leap_s * time.NS_PER_S  # weeks of UTC begin as those of GPS time
    of_day_s = utc_ns % _DAY_NS // time.NS_PER_S
    record["iode"] = round((of_day_s + _MOSCOW_S) % 86_400 / _TB_S)
    record["toe_s"] = utc_ns % time.NS_PER_WEEK / time.NS_PER_S
    sent = message.clock[2]
    if sent is not None and 0.0 <= sent < _UNKNOWN_TIME_S:
        # RINEX 2 gives it in seconds of the day, later ones of the week, some writers of either.
        in_day = int(time.from_week(0, sent)) % _DAY_NS
        days = (utc_ns - in_day + _DAY_NS // 2) // _DAY_NS
        record["transmitted_ns"] = in_day + days * _DAY_NS + leap_s * time.NS_PER_S
