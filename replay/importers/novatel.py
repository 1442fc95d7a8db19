"""NovAtel OEM binary messages as channels.

Read are RANGE and RANGECMP (observations), BESTPOS with BESTVEL (fixes), GPSEPHEM and
RAWEPHEM (ephemerides), RAWIMU(S)(X), CORRIMUDATA(S) and IMURATECORRIMUS (samples), and
INSPVA(S)(X) (truth: the receiver's own fused solution). Others are counted. Headers and
bodies are numpy records after OEM7 commands and logs; ASCII messages are not read.
"""

from __future__ import annotations

import collections
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from replay import channels
from replay.errors import ForeignFileError
from replay.importers import frames as framing
from replay.importers import novatel_ins, novatel_nav, novatel_range
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.receiver_rows import Navigation, epoch_columns
from replay.importers.table import Int64
from replay.log.columns import Columns
from replay.time import NS_PER_WEEK

_SHORT: Final = 0x13
_LONG_HEAD: Final = np.dtype(
    [
        ("sync", "u1", 3), ("length", "u1"), ("id", "<u2"), ("kind", "u1"), ("port", "u1"),
        ("body", "<u2"), ("sequence", "<u2"), ("idle", "u1"), ("status", "u1"), ("week", "<u2"),
        ("ms", "<i4"),
    ]
)  # fmt: skip
_SHORT_HEAD: Final = np.dtype(
    [("sync", "u1", 3), ("body", "u1"), ("id", "<u2"), ("week", "<u2"), ("ms", "<i4")]
)
_ROW_READERS: Final = (novatel_range.RANGE, novatel_range.RANGECMP)
_BODIES: Final = {
    **dict.fromkeys(novatel_ins.RAWIMU, novatel_ins.RAW_BODY),
    **dict.fromkeys(novatel_ins.RAWIMUX, novatel_ins.RAWX_BODY),
    **dict.fromkeys(novatel_ins.CORRECTED, novatel_ins.CORRECTED_BODY),
    **dict.fromkeys(novatel_ins.INSPVA, novatel_ins.PVA_BODY),
    **dict.fromkeys(novatel_ins.INSPVAX, novatel_ins.PVAX_BODY),
    novatel_nav.BESTPOS: novatel_nav.POS_BODY,
    novatel_nav.BESTVEL: novatel_nav.VEL_BODY,
    novatel_nav.GPSEPHEM: novatel_nav.EPHEM_BODY,
    novatel_nav.RAWEPHEM: novatel_nav.RAW_BODY,
}
_MS: Final = 1_000_000


def read_novatel(
    file: File,
    findings: Findings,
    *,
    receiver: str,
    lever_arm_m: Sequence[float] = (0.0, 0.0, 0.0),
    gyro_scale_rad: float = 0.0,
    accel_scale_m_s: float = 0.0,
) -> dict[str, Columns]:
    """Channels of a NovAtel file.

    Parameters
    ----------
    file : File
    findings : Findings
    receiver : str
        Name in the topics.
    lever_arm_m : sequence of 3 float, m
        IMU to antenna, body, for fixes.
    gyro_scale_rad, accel_scale_m_s : float, rad and m/s per count
        Of RAWIMU, after the IMU's type ("raw IMU scale factors" of the manual).

    Raises
    ------
    ForeignFileError
        Where the file holds no message.
    """
    frames = framing.scan(file, framing.NOVATEL, findings)
    offsets, lengths = frames.of(framing.NOVATEL)
    if not len(offsets):
        raise ForeignFileError(
            "the file holds no NovAtel binary message",
            where=file.name,
            mend="is it ASCII, or another receiver's?",
        )
    run = _Run(file, frames, offsets, lengths, findings)
    found: dict[str, list[Columns]] = {}
    for kind in _ROW_READERS:
        rows = np.flatnonzero(run.ids == kind)
        if len(rows):
            observed = novatel_range.decode_range(
                frames,
                run.bodies[rows],
                run.lengths[rows],
                run.times[rows],
                kind == novatel_range.RANGECMP,
                file.name,
                findings,
            )
            if observed is not None:
                found.setdefault(channels.GNSS_OBS.at(receiver=receiver), []).append(observed)
                topic = channels.RECEIVER_EPOCH.at(receiver=receiver)
                found.setdefault(topic, []).append(_epochs(observed))
    pva, _ = run.of(novatel_ins.INSPVA)
    pvax, pvax_times = run.of(novatel_ins.INSPVAX)
    none = (0.0, 0.0, 0.0)
    truth = novatel_ins.solutions(pva, pvax, pvax_times, none, file.name, findings)
    if truth is not None:
        found[channels.TRUTH.topic] = [truth]
    samples = _samples(run, truth, gyro_scale_rad, accel_scale_m_s)
    if samples is not None:
        found[channels.IMU.topic] = [samples]
    fixes = novatel_nav.fixes(
        *run.of((novatel_nav.BESTPOS,)),
        *run.of((novatel_nav.BESTVEL,)),
        lever_arm_m,
        file.name,
        findings,
    )
    if fixes is not None:
        found[channels.GNSS_FIX.at(receiver=receiver)] = [fixes]
    navigation = Navigation()
    parsed, raw = run.of((novatel_nav.GPSEPHEM,)), run.of((novatel_nav.RAWEPHEM,))
    novatel_nav.add_ephemerides(*parsed, *raw, navigation)
    run.report()
    framing.note_others(file, frames, framing.NOVATEL, findings)
    joined = {topic: parts[0] for topic, parts in found.items() if len(parts) == 1}
    both = {topic: parts for topic, parts in found.items() if len(parts) > 1}
    if both:
        findings.notes.append(f"{file.name}: RANGE stands beside RANGECMP; RANGE is used")
        joined |= {topic: parts[0] for topic, parts in both.items()}
    return joined | navigation.columns()


def _samples(
    run: _Run, truth: Columns | None, gyro_scale_rad: float, accel_scale_m_s: float
) -> Columns | None:
    """Raw samples where there are some, else the corrected ones."""
    for kinds in (novatel_ins.RAWIMU, novatel_ins.RAWIMUX):
        rows, _ = run.of(kinds)
        if _timed(rows) and gyro_scale_rad > 0.0 and accel_scale_m_s > 0.0:
            return novatel_ins.raw_samples(rows, gyro_scale_rad, accel_scale_m_s)
        if len(rows):
            run.findings.loss(
                "raw inertial samples without scale factors or without a rate; skipped",
                run.file.name,
                len(rows),
                "messages",
                "give `gyro_scale` and `accel_scale` of the IMU's type in the stream",
            )
    rows, _ = run.of(novatel_ins.CORRECTED)
    if _timed(rows):
        return novatel_ins.corrected_samples(rows, truth, run.file.name, run.findings)
    if len(rows):
        what = "inertial samples without a rate; skipped"
        run.findings.loss(what, run.file.name, len(rows), "messages", "record two or more")
    return None


def _timed(rows: npt.NDArray[np.void]) -> bool:
    """Whether samples tell their rate, without which increments are none."""
    return len(rows) > 1 and novatel_ins.sample_rate_hz(novatel_ins.times_of(rows)) > 0.0


def _epochs(observed: Columns) -> Columns:
    pairs = np.unique(np.rec.fromarrays([observed.valid_time_ns, observed["satellite"]]))
    times, counts = np.unique(pairs["f0"], return_counts=True)
    return epoch_columns(times, np.zeros(len(times), dtype=np.int64), counts)


class _Run:
    """Headers of all messages.

    Attributes
    ----------
    ids, bodies, lengths, times : int64 array (n,)
        Number, first byte and length of the body, GPS nanoseconds of the header.
    """

    def __init__(
        self,
        file: File,
        frames: framing.Frames,
        offsets: Int64,
        lengths: Int64,
        findings: Findings,
    ) -> None:
        self.file, self.frames, self.findings = file, frames, findings
        short = frames.data[offsets + 2] == _SHORT
        size = np.where(short, _SHORT_HEAD.itemsize, frames.data[offsets + 3].astype(np.int64))
        self.bodies = offsets + size
        self.lengths = lengths - size - 4
        self.ids = np.zeros(len(offsets), dtype=np.int64)
        self.times = np.zeros(len(offsets), dtype=np.int64)
        for mask, head in ((short, _SHORT_HEAD), (~short, _LONG_HEAD)):
            heads = frames.records(offsets[mask], head)
            self.ids[mask] = heads["id"]
            ms = heads["ms"].astype(np.int64)
            self.times[mask] = heads["week"].astype(np.int64) * NS_PER_WEEK + ms * _MS

    def of(self, kinds: Sequence[int]) -> tuple[npt.NDArray[np.void], Int64]:
        """Bodies of messages of some numbers that share a shape, and their times."""
        dtype = _BODIES[kinds[0]]
        rows = np.flatnonzero(np.isin(self.ids, kinds) & (self.lengths == dtype.itemsize))
        return self.frames.records(self.bodies[rows], dtype), self.times[rows]

    def report(self) -> None:
        """Count messages that are not read, and those of another length than known."""
        sizes = {kind: dtype.itemsize for kind, dtype in _BODIES.items()}
        unread: collections.Counter[int] = collections.Counter()
        odd: collections.Counter[int] = collections.Counter()
        for number, length in zip(self.ids.tolist(), self.lengths.tolist(), strict=True):
            if number not in sizes and number not in _ROW_READERS:
                unread[number] += 1
            elif sizes.get(number, length) != length:
                odd[number] += 1
        if unread:
            kinds = ", ".join(f"{number}: {n}" for number, n in sorted(unread.items()))
            self.findings.notes.append(f"{self.file.name}: messages that are not read: {kinds}")
        for number, n in sorted(odd.items()):
            what = f"messages {number} have not the length of their kind; skipped"
            self.findings.loss(what, self.file.name, n, "messages", "is the firmware newer?")
