"""RXM-SFRBX of u-blox: words of navigation messages (interface description, 3.17.7)."""

from __future__ import annotations

import collections
from typing import Any, Final

import numpy as np

from replay.importers import navbits_beidou, navbits_galileo, navbits_gps
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.frames import Frames
from replay.importers.navbits import Bits, Ionosphere
from replay.importers.navbits_glonass import StringAssembler
from replay.importers.receiver_rows import Navigation
from replay.importers.table import Int64
from replay.importers.ubx_rawx import BEIDOU, GALILEO, GLONASS, GPS, LETTERS, QZSS

_PAYLOAD: Final = 6
_HEAD_BYTES: Final = 8
_FNAV: Final = 3
_INAV_E5B: Final = 5
_OLD_OR_E1B: Final = (0, 1)  # receivers before series 9 name no signal
_D1_OR_D2: Final = (0, 1, 2, 3, 4, 10)
_UNKNOWN_SLOT: Final = 255


class SubframeDecoder:
    """Frames of RXM-SFRBX in the order of the file.

    Parameters
    ----------
    file : File
    navigation : Navigation
        Takes what is found.
    """

    def __init__(self, file: File, navigation: Navigation) -> None:
        self._file = file
        self._navigation = navigation
        self._lnav = {GPS: navbits_gps.LnavAssembler("G"), QZSS: navbits_gps.LnavAssembler("J")}
        self._inav = {
            _INAV_E5B: navbits_galileo.InavAssembler(navbits_galileo.SOURCE_INAV_E5B),
            **dict.fromkeys(_OLD_OR_E1B, navbits_galileo.InavAssembler()),
        }
        self._fnav = navbits_galileo.FnavAssembler()
        self._d1, self._d2 = navbits_beidou.D1Assembler(), navbits_beidou.D2Assembler()
        self._strings = StringAssembler()
        self._unread: collections.Counter[str] = collections.Counter()
        self._failed: list[int] = []

    def run(self, frames: Frames, offsets: Int64, lengths: Int64, times_ns: Int64) -> None:
        """Decode all frames.

        Parameters
        ----------
        frames : Frames
        offsets, lengths : int64 array (n,)
            Of the frames.
        times_ns : int64 array (n,), ns
            When each came, GPS time.
        """
        data = self._file.data
        rows = zip(offsets.tolist(), lengths.tolist(), times_ns.tolist(), strict=True)
        for offset, length, now_ns in rows:
            at = offset + _PAYLOAD
            system, satellite, signal, frequency = (
                data[at],
                data[at + 1],
                data[at + 2],
                data[at + 3],
            )
            count = data[at + 4]
            if length != 8 + _HEAD_BYTES + 4 * count:
                self._failed.append(offset)
                continue
            begin = at + _HEAD_BYTES
            words = np.frombuffer(data, dtype="<u4", count=count, offset=begin).tolist()
            try:
                read = self._message(system, satellite, signal, frequency - 7, words, now_ns)
            except ValueError:
                self._failed.append(offset)
                continue
            if not read:
                self._unread[f"{LETTERS.get(system, system)} signal {signal}"] += 1

    def report(self, findings: Findings) -> None:
        """Count what failed and what is not read."""
        if self._failed:
            shown = ", ".join(str(at) for at in self._failed[:5])
            findings.loss(
                "the parity or CRC of a navigation message fails; skipped",
                f"{self._file.name}, bytes {shown}",
                len(self._failed),
                "messages",
                "the receiver read weak signals; nothing is to be done",
            )
        if self._unread:
            kinds = ", ".join(f"{what}: {n}" for what, n in sorted(self._unread.items()))
            findings.notes.append(
                f"{self._file.name}: navigation messages (RXM-SFRBX) of kinds that are not read: "
                f"{kinds}"
            )

    def _message(
        self, system: int, satellite: int, signal: int, channel: int, words: list[int], now_ns: int
    ) -> bool:
        """Read one message; False where its kind is not known."""
        if system in self._lnav and signal == 0 and len(words) == 10:
            if words[0] >> 22 & 0xFF != navbits_gps.PREAMBLE:
                return False
            lnav = navbits_gps.strip_parity(words)
            if lnav is None:
                raise ValueError("parity")
            self._keep(self._lnav[system].add(satellite, lnav, now_ns), now_ns)
        elif system == GALILEO and signal in self._inav and len(words) >= 8:
            pages = [_joined(words[:4]), _joined(words[4:8])]
            word = navbits_galileo.inav_word(Bits(pages[0], 128), Bits(pages[1], 128))
            if word is not None:
                self._keep(self._inav[signal].add(satellite, word, now_ns), now_ns)
        elif system == GALILEO and signal == _FNAV and len(words) >= 8:
            page = navbits_galileo.fnav_page(Bits(_joined(words[:8]), 256))
            self._keep(self._fnav.add(satellite, page, now_ns), now_ns)
        elif system == BEIDOU and signal in _D1_OR_D2 and len(words) == 10:
            bits = navbits_beidou.strip_parity(words)
            geostationary = satellite <= 5 or satellite >= 59
            assembler = self._d2 if geostationary else self._d1
            self._keep(assembler.add(satellite, bits, now_ns), now_ns)
        elif system == GLONASS and satellite != _UNKNOWN_SLOT and len(words) >= 4:
            string = Bits(_joined(words[:4]), 128)
            self._keep(self._strings.add(satellite, channel, string, now_ns), now_ns)
        else:
            return False
        return True

    def _keep(self, found: tuple[Any | None, Ionosphere | None], now_ns: int) -> None:
        record, ionosphere = found
        if record is not None:
            self._navigation.add(record, now_ns)
        if ionosphere is not None:
            self._navigation.add_ionosphere(ionosphere)


def _joined(words: list[int]) -> int:
    """Words of 32 bits as one number."""
    value = 0
    for word in words:
        value = value << 32 | word
    return value
