"""D1 and D2 of BeiDou: subframes and pages to ephemerides (BDS-SIS-ICD B1I 3.0, section 5)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from replay import time
from replay.importers.navbits import (
    SEMICIRCLE_RAD,
    WEEK_S,
    Bits,
    Ionosphere,
    accuracy_m,
    near,
    new_record,
)
from replay.importers.navbits_gps import klobuchar
from replay.kernels.ephemeris import SYSTEM_BEIDOU

BDT_BEHIND_S: Final = 14
WEEKS_BEHIND: Final = 1356  # week 0 of BeiDou began with week 1356 of GPS time
_HEAD: Final = 11 + 4 + 3 + 20
_D2_PAGES: Final = (1, 3, 4, 5, 6, 7, 8, 9, 10)
_SUBFRAME_S: Final = 6


def strip_parity(words: Sequence[int]) -> Bits:
    """The 224 data bits of ten words of 30 bits, in the lowest 30 bits."""
    value = words[0] >> 4 & 0x3FFFFFF
    for word in words[1:]:
        value = value << 22 | (word >> 8 & 0x3FFFFF)
    return Bits(value, 26 + 22 * (len(words) - 1))


class D1Assembler:
    """Subframes 1 to 3 of each satellite, put together where they follow each other."""

    def __init__(self) -> None:
        self._held: dict[int, dict[int, tuple[int, Bits]]] = {}

    def add(self, prn: int, bits: Bits, now_ns: int) -> tuple[Any | None, Ionosphere | None]:
        """What a subframe completes: an ephemeris, an ionosphere."""
        bits.at = 15
        number, of_week = bits.u(3), bits.u(20)
        if number not in (1, 2, 3) or of_week >= WEEK_S:
            return None, None
        held = self._held.setdefault(prn, {})
        held[number] = (of_week, bits)
        sent_ns = near(float(of_week), now_ns, BDT_BEHIND_S)
        ionosphere = None
        if number == 1:
            bits.at = _HEAD + 1 + 5 + 4 + 13 + 17 + 10 + 10
            end_ns = sent_ns + _SUBFRAME_S * time.NS_PER_S
            ionosphere = Ionosphere("C", 2, klobuchar(bits), end_ns)
        follow = len(held) == 3 and held[1][0] + 12 == held[2][0] + 6 == held[3][0]
        return (self._ephemeris(prn, held, sent_ns) if follow else None), ionosphere

    def _ephemeris(self, prn: int, held: dict[int, tuple[int, Bits]], now_ns: int) -> Any:
        one, two, three = (held[n][1] for n in (1, 2, 3))
        for bits in (one, two, three):
            bits.at = _HEAD
        record = new_record(SYSTEM_BEIDOU, prn)
        toc = _clock_head(record, one)
        one.skip(64)
        record["af2"], record["af0"] = one.s(11) * 2.0**-66, one.s(24) * 2.0**-33
        record["af1"], record["iode"] = one.s(22) * 2.0**-50, one.u(5)

        record["delta_n"] = two.s(16) * 2.0**-43 * SEMICIRCLE_RAD
        record["cuc"] = two.s(18) * 2.0**-31
        record["m0"] = two.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["eccentricity"], record["cus"] = two.u(32) * 2.0**-33, two.s(18) * 2.0**-31
        record["crc"], record["crs"] = two.s(18) * 2.0**-6, two.s(18) * 2.0**-6
        record["sqrt_a"] = two.u(32) * 2.0**-19
        toe = float((two.u(2) << 15 | three.u(15)) * 8)

        record["i0"] = three.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["cic"] = three.s(18) * 2.0**-31
        record["omega_dot"] = three.s(24) * 2.0**-43 * SEMICIRCLE_RAD
        record["cis"] = three.s(18) * 2.0**-31
        record["i_dot"] = three.s(14) * 2.0**-43 * SEMICIRCLE_RAD
        record["omega0"] = three.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["omega"] = three.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        return _dated(record, toe, toc, held[1][0], now_ns)


class D2Assembler:
    """Pages 1 to 10 of subframe 1 of each geostationary satellite."""

    def __init__(self) -> None:
        self._held: dict[int, dict[int, tuple[int, Bits]]] = {}

    def add(self, prn: int, bits: Bits, now_ns: int) -> tuple[Any | None, Ionosphere | None]:
        """What a page completes: an ephemeris, an ionosphere."""
        bits.at = 15
        number, of_week, page = bits.u(3), bits.u(20), bits.u(4)
        if number != 1 or of_week >= WEEK_S:
            return None, None
        sent_ns = near(float(of_week), now_ns, BDT_BEHIND_S)
        if page == 2:
            bits.at = _HEAD + 4
            return None, Ionosphere("C", 2, klobuchar(bits), sent_ns + time.NS_PER_S)
        held = self._held.setdefault(prn, {})
        held[page] = (of_week, bits)
        if page != 10 or any(n not in held for n in _D2_PAGES):
            return None, None
        # One page every 3 s: what is of another round belongs to another message.
        if any(held[n][0] != held[1][0] + 3 * (n - 1) for n in _D2_PAGES):
            return None, None
        return self._ephemeris(prn, held, sent_ns), None

    def _ephemeris(self, prn: int, held: dict[int, tuple[int, Bits]], now_ns: int) -> Any:
        pages = {n: bits for n, (_, bits) in held.items()}
        for bits in pages.values():
            bits.at = _HEAD + 4
        record = new_record(SYSTEM_BEIDOU, prn)
        toc = _clock_head(record, pages[1])
        pages[3].at = 80
        record["af0"] = pages[3].s(24) * 2.0**-33
        record["af1"] = (pages[3].s(4) << 18 | pages[4].u(18)) * 2.0**-50
        four, five, six = pages[4], pages[5], pages[6]
        record["af2"], record["iode"] = four.s(11) * 2.0**-66, four.u(5)
        record["delta_n"] = four.s(16) * 2.0**-43 * SEMICIRCLE_RAD
        record["cuc"] = (four.s(14) << 4 | five.u(4)) * 2.0**-31
        record["m0"] = five.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["cus"] = five.s(18) * 2.0**-31
        record["eccentricity"] = (five.u(10) << 22 | six.u(22)) * 2.0**-33
        record["sqrt_a"] = six.u(32) * 2.0**-19
        seven, eight, nine, ten = pages[7], pages[8], pages[9], pages[10]
        record["cic"] = (six.s(10) << 8 | seven.u(8)) * 2.0**-31
        record["cis"] = seven.s(18) * 2.0**-31
        toe = seven.u(17) * 8.0
        record["i0"] = (seven.s(21) << 11 | eight.u(11)) * 2.0**-31 * SEMICIRCLE_RAD
        record["crc"], record["crs"] = eight.s(18) * 2.0**-6, eight.s(18) * 2.0**-6
        record["omega_dot"] = (eight.s(19) << 5 | nine.u(5)) * 2.0**-43 * SEMICIRCLE_RAD
        record["omega0"] = nine.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["omega"] = (nine.s(27) << 5 | ten.u(5)) * 2.0**-31 * SEMICIRCLE_RAD
        record["i_dot"] = ten.s(14) * 2.0**-43 * SEMICIRCLE_RAD
        return _dated(record, toe, toc, held[1][0], now_ns)


def _clock_head(record: Any, bits: Bits) -> float:
    """Health, issue, accuracy and group delays; gives the clock's reference time (s)."""
    record["health"], record["iodc"] = bits.u(1), bits.u(5)
    record["accuracy_m"] = accuracy_m(bits.u(4))
    bits.skip(13)
    toc = bits.u(17) * 8.0
    record["group_delay_1_s"] = bits.s(10) * 1e-10
    record["group_delay_2_s"] = bits.s(10) * 1e-10
    return toc


def _dated(record: Any, toe: float, toc: float, of_week: int, now_ns: int) -> Any:
    sent = near(float(of_week), now_ns, BDT_BEHIND_S)
    record["toe_s"] = toe
    record["toe_ns"] = near(toe, sent, BDT_BEHIND_S)
    record["toc_ns"] = near(toc, sent, BDT_BEHIND_S)
    record["transmitted_ns"] = sent
    return record
