"""LNAV of GPS and QZSS: subframes to ephemerides (IS-GPS-200N, 20.3; IS-QZSS-PNT, 4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from replay import time
from replay.importers.navbits import (
    SEMICIRCLE_RAD,
    Bits,
    Ionosphere,
    accuracy_m,
    near,
    new_record,
)
from replay.kernels.ephemeris import SYSTEM_GPS

PREAMBLE: Final = 0x8B
_SUBFRAME_S: Final = 6
_IONOSPHERE_PAGE: Final = 56  # SV identity of subframe 4, page 18
_FIT_HOURS: Final = (  # IS-GPS-200N, table 20-XII: issues of data of longer fits
    (range(240, 248), 8),
    (range(248, 256), 14),
    (range(496, 497), 14),
    (range(497, 504), 26),
    (range(504, 511), 50),
    (range(511, 512), 74),
    (range(752, 757), 74),
    (range(757, 764), 98),
    (range(764, 768), 122),
    (range(1008, 1011), 122),
    (range(1011, 1021), 146),
)
_SHORT_FIT_S: Final = {"G": 4 * 3600.0, "J": 2 * 3600.0}
# Bits of a word that each of its six parity bits covers, d1 on top; IS-GPS-200N, table 20-XIV.
_PARITY: Final = (0xEC7CD2, 0x763E69, 0xBB1F34, 0x5D8F9A, 0xAEC7CD, 0x2DEA27)
_LAST_STAR: Final = (29, 30, 29, 30, 30, 29)


def strip_parity(words: Sequence[int]) -> Bits | None:
    """The 240 data bits of ten words of 30 bits, or None where a parity fails.

    Parameters
    ----------
    words : sequence of int
        Data bits with their true sign, in the lowest 30 bits. Where the word before
        ended in a one, parity bits are as they were sent, or turned with the data bits.
    """
    if not (_agree(words, turned=True) or _agree(words, turned=False)):
        return None
    value = 0
    for word in words:
        value = value << 24 | (word >> 6 & 0xFFFFFF)
    return Bits(value, 240)


def _agree(words: Sequence[int], *, turned: bool) -> bool:
    d29, d30 = 0, 0  # subframes begin after two zeros: IS-GPS-200N, 20.3.3.2
    for word in words:
        data = word >> 6 & 0xFFFFFF
        parity = 0
        for mask, star in zip(_PARITY, _LAST_STAR, strict=True):
            bit = ((data & mask).bit_count() + (d29 if star == 29 else d30)) & 1
            parity = parity << 1 | bit
        sent = word & 0x3F
        if turned and d30:
            sent ^= 0x3F
        if parity != sent:
            return False
        d29, d30 = sent >> 1 & 1, sent & 1
    return True


class LnavAssembler:
    """Subframes 1 to 3 of each satellite, put together where their issues agree.

    Parameters
    ----------
    system : str
        "G" or "J".
    """

    def __init__(self, system: str) -> None:
        self.system = system
        self._held: dict[int, dict[int, tuple[int, Bits]]] = {}

    def add(self, prn: int, bits: Bits, now_ns: int) -> tuple[Any | None, Ionosphere | None]:
        """What a subframe completes: an ephemeris, an ionosphere.

        Parameters
        ----------
        prn : int
        bits : Bits
            The 240 data bits.
        now_ns : int, ns
            GPS time of reception, right within half a week.
        """
        bits.at = 24
        begin_ns = near(float((bits.u(17) - 1) * _SUBFRAME_S % 604_800), now_ns)
        bits.skip(2)
        number = bits.u(3)
        if number in (1, 2, 3):
            held = self._held.setdefault(prn, {})
            held[number] = (begin_ns, bits)
            if len(held) == 3:
                return self._ephemeris(prn, held), None
        elif number == 4:
            return None, self._ionosphere(bits, begin_ns + _SUBFRAME_S * time.NS_PER_S)
        return None, None

    def _ionosphere(self, bits: Bits, end_ns: int) -> Ionosphere | None:
        bits.at = 48
        if self.system != "G" or bits.u(2) != 1 or bits.u(6) != _IONOSPHERE_PAGE:
            return None
        return Ionosphere(self.system, 1, klobuchar(bits), end_ns)

    def _ephemeris(self, prn: int, held: dict[int, tuple[int, Bits]]) -> Any | None:
        one, two, three = (held[n][1] for n in (1, 2, 3))
        record = new_record(ord(self.system), prn)
        one.at = 48
        week = one.u(10)
        one.skip(2)
        accuracy, record["health"] = one.u(4), one.u(6)
        iodc_top = one.u(2)
        one.at = 160
        record["group_delay_1_s"] = one.s(8) * 2.0**-31
        iodc = iodc_top << 8 | one.u(8)
        toc = one.u(16) * 16.0
        record["af2"], record["af1"] = one.s(8) * 2.0**-55, one.s(16) * 2.0**-43
        record["af0"] = one.s(22) * 2.0**-31
        record["accuracy_m"] = accuracy_m(accuracy)

        two.at = 48
        issue = two.u(8)
        record["crs"] = two.s(16) * 2.0**-5
        record["delta_n"] = two.s(16) * 2.0**-43 * SEMICIRCLE_RAD
        record["m0"] = two.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["cuc"], record["eccentricity"] = two.s(16) * 2.0**-29, two.u(32) * 2.0**-33
        record["cus"], record["sqrt_a"] = two.s(16) * 2.0**-29, two.u(32) * 2.0**-19
        toe, long_fit = two.u(16) * 16.0, two.u(1)

        three.at = 48
        record["cic"] = three.s(16) * 2.0**-29
        record["omega0"] = three.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["cis"] = three.s(16) * 2.0**-29
        record["i0"] = three.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["crc"] = three.s(16) * 2.0**-5
        record["omega"] = three.s(32) * 2.0**-31 * SEMICIRCLE_RAD
        record["omega_dot"] = three.s(24) * 2.0**-43 * SEMICIRCLE_RAD
        if three.u(8) != issue or iodc & 0xFF != issue:
            return None  # a new issue has begun: wait for its other subframes
        record["i_dot"] = three.s(14) * 2.0**-43 * SEMICIRCLE_RAD

        sent = held[1][0]
        if (sent // time.NS_PER_WEEK - week) % 1024:
            return None  # the week of reception is not that of the message
        record["iode"], record["iodc"], record["toe_s"] = issue, iodc, toe
        record["toe_ns"], record["toc_ns"] = near(toe, sent), near(toc, sent)
        record["transmitted_ns"] = sent
        record["fit_s"] = fit_s(self.system, long_fit, iodc)
        return record


def fit_s(system: str, long_fit: int, iodc: int) -> float:
    """For how long an LNAV message is meant (s); 0 where QZSS does not say."""
    if not long_fit:
        return _SHORT_FIT_S[system]
    if ord(system) != SYSTEM_GPS:
        return 0.0
    return 3600.0 * next((hours for issues, hours in _FIT_HOURS if iodc in issues), 6)


def klobuchar(bits: Bits) -> tuple[float, ...]:
    """Alpha 0 to 3 and beta 0 to 3, eight bits each; s and s per semicircle to the power."""
    alpha = (bits.s(8) * 2.0**-30, bits.s(8) * 2.0**-27, bits.s(8) * 2.0**-24, bits.s(8) * 2.0**-24)
    beta = (bits.s(8) * 2.0**11, bits.s(8) * 2.0**14, bits.s(8) * 2.0**16, bits.s(8) * 2.0**16)
    return (*alpha, *beta)
