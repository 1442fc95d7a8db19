"""RTCM 3 streams as channels.

Read are multiple signal messages 4 to 7 of GPS, GLONASS, Galileo, QZSS and BeiDou, the
station's position (1005, 1006) and ephemerides (1019, 1020, 1042, 1044 to 1046). The
others are counted. The stream tells the time of the week only: the spec has to give an
approximate date. pyrtcm, which makes an attribute of each field and takes four times as
long, is the reference of the tests.
"""

from __future__ import annotations

import collections

import numpy as np

from replay import channels
from replay.errors import ForeignFileError
from replay.importers import frames as framing
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.navbits import Bits
from replay.importers.receiver_rows import (
    LOST,
    Navigation,
    epoch_columns,
    lost_lock,
    observation_columns,
    position_columns,
)
from replay.importers.rtcm_msm import Measurement, is_msm, measurements, system_week_time
from replay.importers.rtcm_nav import MESSAGES, WrongWeekError, ephemeris
from replay.log.columns import Columns

_HEAD_BYTES = 3
_CHECK_BYTES = 3


def read_rtcm(
    file: File, findings: Findings, *, receiver: str, approximate_ns: int | None
) -> dict[str, Columns]:
    """Channels of an RTCM 3 file.

    Parameters
    ----------
    file : File
    findings : Findings
    receiver : str
        Name in the topics.
    approximate_ns : int or None
        GPS nanoseconds within half a week of the first message.

    Raises
    ------
    ForeignFileError
        Where the approximate time is missing, or the file holds no message.
    """
    if approximate_ns is None:
        raise ForeignFileError(
            "RTCM tells the time of the week, not which week",
            where=file.name,
            mend='give `approximate_time = "2025-08-28T17:30:00"` in the stream, GPS time '
            "within half a week",
        )
    frames = framing.scan(file, framing.RTCM, findings)
    offsets, lengths = frames.of(framing.RTCM)
    if not len(offsets):
        raise ForeignFileError(
            "the file holds no RTCM 3 message", where=file.name, mend="see the other formats"
        )
    run = _Run(approximate_ns)
    for offset, length in zip(offsets.tolist(), lengths.tolist(), strict=True):
        payload = file.data[offset + _HEAD_BYTES : offset + length - _CHECK_BYTES]
        run.message(offset, payload)
    run.report(file, findings)
    framing.note_others(file, frames, framing.RTCM, findings)
    return run.columns(file, receiver, findings)


class _Run:
    """Messages in the order of the file."""

    def __init__(self, now_ns: int) -> None:
        self.now_ns = now_ns
        self.navigation = Navigation()
        self.rows: list[Measurement] = []
        self.glonass: dict[str, int] = {}
        self.positions: list[tuple[int, tuple[float, float, float], str]] = []
        self.unread: collections.Counter[int] = collections.Counter()
        self.short: list[int] = []
        self.wrong_week: list[int] = []
        self.unknown_cells = 0

    def message(self, offset: int, payload: bytes) -> None:
        """One message."""
        bits = Bits(int.from_bytes(payload, "big"), 8 * len(payload))
        try:
            number = bits.u(12)
            if is_msm(number):
                bits.skip(12)
                self.now_ns = system_week_time(number, bits, self.now_ns)
                rows, unknown = measurements(number, bits, self.now_ns, self.glonass)
                self.rows += rows
                self.unknown_cells += unknown
            elif number in MESSAGES:
                record = ephemeris(number, bits, self.now_ns)
                if number == 1020:
                    name = f"R{int(record['prn']):02d}"
                    self.glonass[name] = int(record["frequency_channel"])
                self.navigation.add(record, self.now_ns)
            elif number in (1005, 1006):
                self._position(bits)
            else:
                self.unread[number] += 1
        except WrongWeekError:
            self.wrong_week.append(offset)
        except ValueError:
            self.short.append(offset)

    def _position(self, bits: Bits) -> None:
        station = bits.u(12)
        bits.skip(6 + 4)
        x = bits.s(38) * 1e-4
        bits.skip(2)
        y = bits.s(38) * 1e-4
        bits.skip(2)
        place = (x, y, bits.s(38) * 1e-4)
        if not self.positions or self.positions[-1][1] != place:
            self.positions.append((self.now_ns, place, f"RTCM station {station}"))

    def report(self, file: File, findings: Findings) -> None:
        """What could not be used."""
        for offsets, what, mend in (
            (self.short, "a message is shorter than its fields; skipped", "is it RTCM 10403.3?"),
            (
                self.wrong_week,
                "the week of an ephemeris is not that of the approximate time; skipped",
                "mend `approximate_time` of the stream",
            ),
        ):
            if offsets:
                shown = ", ".join(map(str, offsets[:5]))
                where = f"{file.name}, bytes {shown}"
                findings.loss(what, where, len(offsets), "messages", mend)
        if self.unknown_cells:
            findings.loss(
                "signals without a RINEX code, or carriers of GLONASS satellites whose channel "
                "no message before tells",
                file.name,
                self.unknown_cells,
                "values",
                "MSM 5 or 7, or message 1020, tell the channel",
            )
        if self.unread:
            kinds = ", ".join(f"{number}: {n}" for number, n in sorted(self.unread.items()))
            findings.notes.append(f"{file.name}: messages that are not read: {kinds}")

    def columns(self, file: File, receiver: str, findings: Findings) -> dict[str, Columns]:
        """Rows by topic."""
        found = self.navigation.columns()
        if self.positions:
            stamps, places, names = zip(*self.positions, strict=True)
            topic = channels.RECEIVER.at(receiver=receiver)
            found[topic] = position_columns(stamps, places, names)
        if not self.rows:
            return found
        times = np.array([row.time_ns for row in self.rows], dtype=np.int64)
        satellites = np.array([row.satellite for row in self.rows], dtype="S3")
        signals = np.array([row.signal for row in self.rows], dtype="S2")
        values = {
            name: np.array([getattr(row, name) for row in self.rows])
            for name in (
                "pseudorange_m", "carrier_phase_cycles", "doppler_hz", "cn0_dbhz", "lock_time_s",
            )
        }  # fmt: skip
        bits = np.array([row.loss_of_lock for row in self.rows], dtype=np.int64)
        lost = lost_lock(times, satellites, signals, values["lock_time_s"], exact=False)
        observed = observation_columns(
            times,
            satellites,
            signals,
            values,
            bits | lost * np.int64(LOST),
            np.array([row.channel for row in self.rows], dtype=np.int64),
            file.name,
            findings,
        )
        found[channels.GNSS_OBS.at(receiver=receiver)] = observed
        pairs = np.unique(np.rec.fromarrays([times, satellites]))
        epochs, counts = np.unique(pairs["f0"], return_counts=True)
        topic = channels.RECEIVER_EPOCH.at(receiver=receiver)
        found[topic] = epoch_columns(epochs, np.zeros(len(epochs), dtype=np.int64), counts)
        return found
