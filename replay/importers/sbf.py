"""SBF of Septentrio receivers as channels.

Read are MeasEpoch (observations), PVTGeodetic or PVTCartesian with PosCovGeodetic and
VelCovGeodetic (fixes), GPSNav, GALNav, BDSNav and GLONav (ephemerides), ExtSensorMeas
(samples, in the sensor's axes). Others are counted. The layouts are those of the SBF
reference guide of the mosaic-X5, firmware 4.10; no recording was at hand, so the tests
build blocks and compare with pysbf2 and RTKLIB.
"""

from __future__ import annotations

import collections
import struct
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay import channels
from replay.errors import ForeignFileError
from replay.importers import frames as framing
from replay.importers import sbf_nav
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.receiver_rows import Navigation, epoch_columns, imu_columns
from replay.importers.sbf_meas import Measurements
from replay.importers.table import Float64, Int64
from replay.log.columns import Columns
from replay.time import NS_PER_WEEK

_MEAS_EPOCH: Final = 4027
_PVT_GEODETIC: Final = 4007
_PVT_CARTESIAN: Final = 4006
_POSITION_COVARIANCE: Final = 5906
_VELOCITY_COVARIANCE: Final = 5908
_SENSORS: Final = 4050
_NAVIGATION: Final[dict[int, tuple[np.dtype[np.void], Callable[[Any, int], Any]]]] = {
    5891: (sbf_nav.GPS_NAV, sbf_nav.gps),
    4002: (sbf_nav.GAL_NAV, sbf_nav.galileo),
    4081: (sbf_nav.BDS_NAV, sbf_nav.beidou),
    4004: (sbf_nav.GLO_NAV, sbf_nav.glonass),
}
_STAMP_BYTES: Final = 14  # block header and time stamp
_NO_TOW: Final = 4294967295
_NO_WEEK: Final = 65535
_MS: Final = 1_000_000


def read_sbf(
    file: File,
    findings: Findings,
    *,
    receiver: str,
    lever_arm_m: Sequence[float] = (0.0, 0.0, 0.0),
) -> dict[str, Columns]:
    """Channels of an SBF file.

    Parameters
    ----------
    file : File
    findings : Findings
    receiver : str
        Name in the topics.
    lever_arm_m : sequence of 3 float, m
        IMU to antenna, body, for fixes.

    Raises
    ------
    ForeignFileError
        Where the file holds no block.
    """
    frames = framing.scan(file, framing.SBF, findings)
    offsets, lengths = frames.of(framing.SBF)
    if not len(offsets):
        raise ForeignFileError(
            "the file holds no SBF block", where=file.name, mend="see the other formats"
        )
    run = _Run(file, findings)
    view = memoryview(file.data)
    for offset, length in zip(offsets.tolist(), lengths.tolist(), strict=True):
        run.block(offset, view[offset : offset + length])
    run.report()
    framing.note_others(file, frames, framing.SBF, findings)
    return run.columns(receiver, lever_arm_m)


class _Run:
    """Blocks in the order of the file."""

    def __init__(self, file: File, findings: Findings) -> None:
        self.file, self.findings = file, findings
        self.measurements = Measurements()
        self.navigation = Navigation()
        self.solutions: dict[int, list[tuple[int, memoryview]]] = {}
        self.sensors: list[tuple[int, memoryview]] = []
        self.unread: collections.Counter[int] = collections.Counter()
        self.short: list[int] = []
        self.undated = 0

    def block(self, offset: int, block: memoryview) -> None:
        """One block."""
        number = int.from_bytes(block[4:6], "little") & 0x1FFF
        known = (_MEAS_EPOCH, _SENSORS, _PVT_GEODETIC, _PVT_CARTESIAN, _POSITION_COVARIANCE,
                 _VELOCITY_COVARIANCE, *_NAVIGATION)  # fmt: skip
        if number not in known:
            self.unread[number] += 1
            return
        try:
            tow, week = struct.unpack_from("<IH", block, 8)
            if tow == _NO_TOW or week == _NO_WEEK:
                self.undated += 1
                return
            time_ns = week * NS_PER_WEEK + tow * _MS
            if number == _MEAS_EPOCH:
                self.measurements.add(block, time_ns)
            elif number == _SENSORS:
                self.sensors.append((time_ns, block))
            elif number in _NAVIGATION:
                dtype, reader = _NAVIGATION[number]
                row = np.frombuffer(block, dtype=dtype, count=1, offset=_STAMP_BYTES)[0]
                self.navigation.add(reader(row, time_ns), time_ns)
            else:
                self.solutions.setdefault(number, []).append((time_ns, block))
        except (struct.error, ValueError, IndexError):
            self.short.append(offset)

    def report(self) -> None:
        """What could not be used."""
        if self.short:
            shown = ", ".join(map(str, self.short[:5]))
            what = "a block is shorter than its fields; skipped"
            where = f"{self.file.name}, bytes {shown}"
            self.findings.loss(what, where, len(self.short), "blocks", "is the firmware older?")
        if self.undated:
            text = f"{self.file.name}: {self.undated} blocks of before the receiver knew the time"
            self.findings.notes.append(text)
        if self.unread:
            kinds = ", ".join(f"{number}: {n}" for number, n in sorted(self.unread.items()))
            self.findings.notes.append(f"{self.file.name}: blocks that are not read: {kinds}")

    def columns(self, receiver: str, lever_arm_m: Sequence[float]) -> dict[str, Columns]:
        """Rows by topic."""
        found = self.navigation.columns()
        name = self.file.name
        observed = self.measurements.columns(name, self.findings)
        if observed is not None:
            found[channels.GNSS_OBS.at(receiver=receiver)] = observed
            pairs = np.unique(np.rec.fromarrays([observed.valid_time_ns, observed["satellite"]]))
            epochs, counts = np.unique(pairs["f0"], return_counts=True)
            flags = np.zeros(len(epochs), dtype=np.int64)
            topic = channels.RECEIVER_EPOCH.at(receiver=receiver)
            found[topic] = epoch_columns(epochs, flags, counts)
        number = _PVT_GEODETIC if _PVT_GEODETIC in self.solutions else _PVT_CARTESIAN
        rows, times = self._rows(number, sbf_nav.PVT)
        if len(rows):
            fixes = sbf_nav.fixes(
                rows,
                times,
                number == _PVT_GEODETIC,
                self._covariances(_POSITION_COVARIANCE),
                self._covariances(_VELOCITY_COVARIANCE),
                lever_arm_m,
                name,
                self.findings,
            )
            if fixes is not None:
                found[channels.GNSS_FIX.at(receiver=receiver)] = fixes
        samples = sbf_nav.sensors(self.sensors)
        if len(samples[0]):
            found[channels.IMU.topic] = imu_columns(*samples)
        return found

    def _rows(self, number: int, dtype: np.dtype[np.void]) -> tuple[npt.NDArray[np.void], Int64]:
        blocks = self.solutions.get(number, [])
        whole = [(t, b) for t, b in blocks if len(b) >= _STAMP_BYTES + dtype.itemsize]
        if len(whole) < len(blocks):
            what = f"blocks {number} are shorter than their fields; skipped"
            count = len(blocks) - len(whole)
            self.findings.loss(what, self.file.name, count, "blocks", "is the firmware older?")
        data = b"".join(b[_STAMP_BYTES : _STAMP_BYTES + dtype.itemsize] for _, b in whole)
        return np.frombuffer(data, dtype=dtype), np.array([t for t, _ in whole], dtype=np.int64)

    def _covariances(self, number: int) -> dict[int, Float64]:
        rows, times = self._rows(number, sbf_nav.COVARIANCE)
        good = (rows["error"] == 0) & (rows["c"] > -1.9e10).all(axis=1)
        values = rows["c"].astype(np.float64)
        return {t: values[i] for i, t in enumerate(times.tolist()) if good[i]}
