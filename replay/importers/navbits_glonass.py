"""Immediate data of GLONASS: strings 1 to 4 to ephemerides (GLONASS ICD 5.1, section 4.4)."""

from __future__ import annotations

from typing import Any, Final

from replay import time
from replay.importers.navbits import Bits, new_record
from replay.kernels.ephemeris import SYSTEM_GLONASS

_MOSCOW_NS: Final = 10_800 * time.NS_PER_S
_DAY_NS: Final = 86_400 * time.NS_PER_S
_ACCURACY_M: Final = (1.0, 2.0, 2.5, 4.0, 5.0, 7.0, 10.0, 12.0, 14.0, 16.0, 32.0, 64.0, 128.0,
                      256.0, 512.0, 0.0)  # ICD table 4.4; 15 is none  # fmt: skip
_FRAME_NS: Final = 30 * time.NS_PER_S


class StringAssembler:
    """Strings 1 to 4 of each satellite, put together where they are of one frame."""

    def __init__(self) -> None:
        self._held: dict[int, dict[int, tuple[int, Bits]]] = {}

    def add(self, slot: int, channel: int, string: Bits, now_ns: int) -> tuple[Any | None, None]:
        """What a string completes: an ephemeris.

        Parameters
        ----------
        slot : int
            Satellite, 1 on.
        channel : int
            Frequency number.
        string : Bits
            85 bits from the idle bit on.
        now_ns : int, ns
            GPS time of reception.
        """
        string.at = 1
        number = string.u(4)
        if number not in (1, 2, 3, 4):
            return None, None
        held = self._held.setdefault(slot, {})
        held[number] = (now_ns, string)
        if number != 4 or len(held) < 4:
            return None, None
        if now_ns - min(at for at, _ in held.values()) > _FRAME_NS:
            return None, None
        strings = {n: bits for n, (_, bits) in held.items()}
        return self._ephemeris(slot, channel, strings, now_ns), None

    def _ephemeris(self, slot: int, channel: int, held: dict[int, Bits], now_ns: int) -> Any | None:
        one, two, three, four = (held[n] for n in (1, 2, 3, 4))
        record = new_record(SYSTEM_GLONASS, slot)
        one.at = 9
        frame = one.u(5) * 3600 + one.u(6) * 60 + one.u(1) * 30
        two.at = 5
        health = two.u(3) >> 2
        two.skip(1)
        interval = two.u(7)
        three.at = 6
        gamma = three.sign_magnitude(11) * 2.0**-40
        one.at = two.at = three.at = 21
        for axis, bits in enumerate((one, two, three)):
            record["velocity_m_s"][axis] = bits.sign_magnitude(24) * 2.0**-20 * 1e3
            record["acceleration_m_s2"][axis] = bits.sign_magnitude(5) * 2.0**-30 * 1e3
            record["position_m"][axis] = bits.sign_magnitude(27) * 2.0**-11 * 1e3
        four.at = 5
        record["af0"] = -four.sign_magnitude(22) * 2.0**-30
        record["af1"] = gamma
        four.at = 52
        record["accuracy_m"] = _ACCURACY_M[four.u(4)]
        four.at = 70
        if four.u(5) not in (0, slot):
            return None  # strings of another satellite
        return dated(record, channel, health, interval, frame, now_ns)


def dated(record: Any, channel: int, health: int, interval: int, frame_s: int, now_ns: int) -> Any:
    """A record with its times, from intervals of 15 minutes and seconds of the Moscow day."""
    leap_ns = time.leap_seconds(now_ns) * time.NS_PER_S
    moscow = now_ns - leap_ns + _MOSCOW_NS
    toe = _of_day(interval * 900 * time.NS_PER_S, moscow)
    sent = _of_day(frame_s * time.NS_PER_S, moscow)
    record["toe_ns"] = record["toc_ns"] = toe - _MOSCOW_NS + leap_ns
    record["transmitted_ns"] = sent - _MOSCOW_NS + leap_ns
    record["toe_s"] = (toe - _MOSCOW_NS) % time.NS_PER_WEEK / time.NS_PER_S
    record["iode"], record["health"], record["frequency_channel"] = interval, health, channel
    return record


def _of_day(in_day_ns: int, near_ns: int) -> int:
    """A time of the day on the day that brings it nearest."""
    return in_day_ns + (near_ns - in_day_ns + _DAY_NS // 2) // _DAY_NS * _DAY_NS
