"""I/NAV and F/NAV of Galileo: words and pages to ephemerides (OS SIS ICD 2.1, section 4)."""

from __future__ import annotations

from typing import Any, Final

from replay.importers.frames import crc24q
from replay.importers.navbits import (
    NO_ACCURACY_M,
    SEMICIRCLE_RAD,
    Bits,
    Ionosphere,
    near,
    new_record,
)
from replay.kernels.ephemeris import SYSTEM_GALILEO

GST_WEEKS_BEHIND: Final = 1024  # week 0 of Galileo began with week 1024 of GPS time
# Data sources as RINEX 3.05, table A8, says them.
SOURCE_INAV_E1: Final = 1 << 0 | 1 << 9
SOURCE_INAV_E5B: Final = 1 << 2 | 1 << 9
SOURCE_FNAV: Final = 1 << 1 | 1 << 8
_INAV_CRC_AT: Final = 82
_FNAV_BITS: Final = 244
_NS_PER_S: Final = 1_000_000_000


def inav_word(even: Bits, odd: Bits) -> Bits | None:
    """The 128 bits of a nominal I/NAV page pair's word.

    Parameters
    ----------
    even, odd : Bits
        Page parts from their even/odd bit on, 114 and 106 bits or more.

    Returns
    -------
    Bits or None
        None for an alert page.

    Raises
    ------
    ValueError
        Where the parts are not even and odd, or the CRC fails.
    """
    even.at = odd.at = 0
    parts, alerts = (even.u(1), odd.u(1)), (0, 0)
    alerts = (even.u(1), odd.u(1))
    if parts != (0, 1):
        raise ValueError("the parts of an I/NAV page are not in order")
    top, low = even.u(112), odd.u(16)
    even.at = odd.at = 0
    checked = even.u(114) << _INAV_CRC_AT | odd.u(_INAV_CRC_AT)
    if crc24q(checked.to_bytes(25, "big")) != odd.u(24):
        raise ValueError("the CRC of an I/NAV page fails")
    return None if any(alerts) else Bits(top << 16 | low, 128)


def fnav_page(bits: Bits) -> Bits:
    """The 214 bits of an F/NAV page.

    Raises
    ------
    ValueError
        Where the CRC fails.
    """
    bits.at = 0
    value = bits.u(214)
    if crc24q(value.to_bytes(27, "big")) != bits.u(24):
        raise ValueError("the CRC of an F/NAV page fails")
    return Bits(value, 214)


class InavAssembler:
    """Words 1 to 5 of each satellite, put together where their issues agree.

    Parameters
    ----------
    source : int
        As RINEX says it: of E1-B or of E5b-I.
    """

    def __init__(self, source: int = SOURCE_INAV_E1) -> None:
        self.source = source
        self._held: dict[int, dict[int, Bits]] = {}

    def add(self, prn: int, word: Bits, now_ns: int) -> tuple[Any | None, Ionosphere | None]:
        """What a word completes: an ephemeris, an ionosphere."""
        word.at = 0
        number = word.u(6)
        if number not in (1, 2, 3, 4, 5):
            return None, None
        held = self._held.setdefault(prn, {})
        held[number] = word
        ionosphere = _ionosphere(word, 6, now_ns) if number == 5 else None
        return (self._ephemeris(prn, held, now_ns) if len(held) == 5 else None), ionosphere

    def _ephemeris(self, prn: int, held: dict[int, Bits], now_ns: int) -> Any | None:
        one, two, three, four, five = (held[n] for n in (1, 2, 3, 4, 5))
        for word in held.values():
            word.at = 6
        issues = {word.u(10) for word in (one, two, three, four)}
        if len(issues) > 1 or four.u(6) != prn:
            return None
        record = new_record(SYSTEM_GALILEO, prn)
        record["iode"] = record["iodc"] = issues.pop()
        record["source"] = self.source
        toe = one.u(14) * 60.0
        record["m0"] = one.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["eccentricity"], record["sqrt_a"] = one.u(32) * 2.0**-33, one.u(32) * 2.0**-19
        record["omega0"] = two.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["i0"] = two.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["omega"] = two.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["i_dot"] = two.s(14) * 2.0**-43 * SEMICIRCLE_RAD
        record["omega_dot"] = three.s(24) * 2.0**-43 * SEMICIRCLE_RAD
        _corrections(record, three)
        record["accuracy_m"] = sisa_m(three.u(8))
        record["cic"], record["cis"] = four.s(16) * 2.0**-29, four.s(16) * 2.0**-29
        toc = four.u(14) * 60.0
        _clock(record, four)
        five.at = 6 + 11 + 11 + 14 + 5
        record["group_delay_1_s"] = five.s(10) * 2.0**-32
        record["group_delay_2_s"] = five.s(10) * 2.0**-32
        e5b, e1, e5b_valid, e1_valid = five.u(2), five.u(2), five.u(1), five.u(1)
        record["health"] = e1_valid | e1 << 1 | e5b_valid << 6 | e5b << 7
        week, of_week = five.u(12), five.u(20)
        return _dated(record, toe, toc, week, of_week, now_ns)


class FnavAssembler:
    """Pages 1 to 4 of each satellite, put together where their issues agree."""

    def __init__(self) -> None:
        self._held: dict[int, dict[int, Bits]] = {}

    def add(self, prn: int, page: Bits, now_ns: int) -> tuple[Any | None, Ionosphere | None]:
        """What a page completes: an ephemeris, an ionosphere."""
        page.at = 0
        number = page.u(6)
        if number not in (1, 2, 3, 4):
            return None, None
        held = self._held.setdefault(prn, {})
        held[number] = page
        ionosphere = _ionosphere(page, 102, now_ns) if number == 1 else None
        return (self._ephemeris(prn, held, now_ns) if len(held) == 4 else None), ionosphere

    def _ephemeris(self, prn: int, held: dict[int, Bits], now_ns: int) -> Any | None:
        one, two, three, four = (held[n] for n in (1, 2, 3, 4))
        for page in held.values():
            page.at = 6
        satellite = one.u(6)
        issues = {page.u(10) for page in (one, two, three, four)}
        if len(issues) > 1 or satellite != prn:
            return None
        record = new_record(SYSTEM_GALILEO, prn)
        record["iode"] = record["iodc"] = issues.pop()
        record["source"] = SOURCE_FNAV
        toc = one.u(14) * 60.0
        _clock(record, one)
        record["accuracy_m"] = sisa_m(one.u(8))
        one.skip(11 + 11 + 14 + 5)
        record["group_delay_1_s"] = one.s(10) * 2.0**-32
        health, week, of_week = one.u(2), one.u(12), one.u(20)
        record["health"] = one.u(1) << 3 | health << 4
        record["m0"] = two.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["omega_dot"] = two.s(24) * 2.0**-43 * SEMICIRCLE_RAD
        record["eccentricity"], record["sqrt_a"] = two.u(32) * 2.0**-33, two.u(32) * 2.0**-19
        record["omega0"] = two.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["i_dot"] = two.s(14) * 2.0**-43 * SEMICIRCLE_RAD
        record["i0"] = three.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["omega"] = three.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        _corrections(record, three)
        toe = three.u(14) * 60.0
        record["cic"], record["cis"] = four.s(16) * 2.0**-29, four.s(16) * 2.0**-29
        return _dated(record, toe, toc, week, of_week, now_ns)


def _corrections(record: Any, bits: Bits) -> None:
    record["delta_n"] = bits.s(16) * 2.0**-43 * SEMICIRCLE_RAD
    record["cuc"], record["cus"] = bits.s(16) * 2.0**-29, bits.s(16) * 2.0**-29
    record["crc"], record["crs"] = bits.s(16) * 2.0**-5, bits.s(16) * 2.0**-5


def _clock(record: Any, bits: Bits) -> None:
    record["af0"] = bits.s(31) * 2.0**-34
    record["af1"], record["af2"] = bits.s(21) * 2.0**-46, bits.s(6) * 2.0**-59


def _dated(record: Any, toe: float, toc: float, week: int, of_week: int, now_ns: int) -> Any | None:
    """The record with its times; the message's own week needs no help within 78 years."""
    sent = ((week + GST_WEEKS_BEHIND) * 604_800 + of_week) * _NS_PER_S
    if now_ns >= 0:
        sent = near(float(of_week), now_ns)
    record["toe_s"] = toe
    record["toe_ns"], record["toc_ns"] = near(toe, sent), near(toc, sent)
    record["transmitted_ns"] = sent
    return record


def _ionosphere(bits: Bits, at: int, now_ns: int) -> Ionosphere:
    """Effective ionisation level and storm flags, as RINEX gives them: flags as one number."""
    bits.at = at
    a0, a1, a2 = bits.u(11) * 2.0**-2, bits.s(11) * 2.0**-8, bits.s(14) * 2.0**-15
    return Ionosphere("E", 3, (a0, a1, a2, float(bits.u(5))), now_ns)


def sisa_m(index: int) -> float:
    """Signal-in-space accuracy (m): OS SIS ICD 2.1, table 89; -1 for no prediction."""
    if index <= 49:
        return index * 0.01
    if index <= 74:
        return 0.5 + (index - 50) * 0.02
    if index <= 99:
        return 1.0 + (index - 75) * 0.04
    if index <= 125:
        return 2.0 + (index - 100) * 0.16
    return NO_ACCURACY_M
