"""Inertial samples at a lower rate, batch by batch."""

from __future__ import annotations

from typing import Final

import numpy as np

from replay.channels import IMU
from replay.engine.transforms.settings import Method
from replay.errors import LossReport, UsageError
from replay.kernels.imu_resampling import (
    SAMPLE_DTYPE,
    close_interval,
    new_resampling,
    resample,
)
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.time import NS_PER_S

GAP_INTERVALS: Final = 5.0  # longer is a gap, as it is for the pipelines
_RATIO_SLACK: Final = 0.01  # of clocks that do not tell seconds well
_HEAD_ROWS: Final = 4096
_PATIENCE_NS: Final = 10 * NS_PER_S  # an interval that is open for longer is written as it is


class Resampling:
    """Makes samples fewer.

    Parameters
    ----------
    reader : LogReader
    rate : float, Hz
    method : Method

    Attributes
    ----------
    ratio : int
        Samples that become one; 1 where the log has this rate already.
    taken, written : int
        Samples.

    Raises
    ------
    MissingChannelError
        Where the log has no inertial samples.
    UsageError
        Where their rate is no whole multiple of the one that is wanted.
    """

    def __init__(self, reader: LogReader, rate: float, method: Method) -> None:
        interval_ns = _interval_ns(reader)
        found = NS_PER_S / interval_ns
        exact = found / rate
        self.ratio = round(exact)
        if self.ratio < 1 or abs(exact - self.ratio) > _RATIO_SLACK * max(1, self.ratio):
            near = ", ".join(f"{found / n:.10g}" for n in (1, 2, 4, 5, 10, 20))
            raise UsageError(
                f"samples at {found:.10g} Hz cannot become samples at {rate:.10g} Hz",
                where=f"{reader.path}, {IMU.topic}",
                mend=f"take a rate that goes into theirs a whole number of times: {near}",
            )
        self._integrate = method is Method.INTEGRATE
        self._longest_ns = round(GAP_INTERVALS * interval_ns)
        self._state = new_resampling()
        self._scratch = np.zeros((2, 4))
        self._warm = "temperature_c" in _fields(reader)
        self.taken = 0
        self.written = 0

    @property
    def open_since_ns(self) -> int | None:
        """Log time of the last sample of an interval that is not written yet."""
        state = self._state[0]
        return int(state["log_t"]) if state["count"] else None

    def apply(self, batch: dict[str, Columns], latest_ns: int) -> dict[str, Columns]:
        """The batch, which reaches to a log time, with fewer samples."""
        if self.ratio == 1:
            return batch
        rows = batch.get(IMU.topic)
        made = np.zeros(1 + (0 if rows is None else len(rows)), dtype=SAMPLE_DTYPE)
        count = 0
        if rows is not None:
            self.taken += len(rows)
            count = resample(
                _samples(rows), self.ratio, self._integrate, self._longest_ns,
                self._state, self._scratch, made,
            )  # fmt: skip
        waiting = self.open_since_ns
        if count == 0 and waiting is not None and latest_ns - waiting > _PATIENCE_NS:
            count = close_interval(self._state, self._integrate, self._scratch, made)
        return self._put(batch, made[:count])

    def finish(self) -> dict[str, Columns]:
        """The interval that is open at the end of the log, shorter than the others."""
        made = np.zeros(1, dtype=SAMPLE_DTYPE)
        count = close_interval(self._state, self._integrate, self._scratch, made)
        return self._put({}, made[:count])

    def losses(self) -> LossReport:
        """Samples that no interval could hold."""
        report = LossReport()
        state = self._state[0]
        for name, what in (
            ("bad", "samples with a value that is no number"),
            ("late", "samples that are not after the one before"),
        ):
            if state[name]:
                report.add(what, where=IMU.topic, count=int(state[name]), unit="rows")
        return report

    def notes(self) -> list[str]:
        """What was done, for a person."""
        if self.ratio == 1:
            return [f"{IMU.topic} has the rate that is wanted"]
        word = "integrated" if self._integrate else "decimated"
        gaps = int(self._state[0]["gaps"])
        return [
            f"{self.taken} rows of {IMU.topic} {word} to {self.written}, {self.ratio} to one,"
            f" {gaps} gaps kept"
        ]

    def _put(self, batch: dict[str, Columns], made: np.ndarray) -> dict[str, Columns]:
        rest = {topic: rows for topic, rows in batch.items() if topic != IMU.topic}
        if len(made) == 0:
            return rest
        values = {
            "angular_rate_body_rad_s": np.ascontiguousarray(made["w"]),
            "specific_force_body_m_s2": np.ascontiguousarray(made["f"]),
        }
        present = {}
        if self._warm:
            values["temperature_c"] = np.ascontiguousarray(made["temperature"])
            present["temperature_c"] = np.isfinite(made["temperature"])
        columns = Columns.build(
            made["t"],
            values,
            log_time_ns=made["log_t"],
            sequence_start=self.written,
            present=present,
        )
        self.written += len(made)
        return {**rest, IMU.topic: columns}


def _interval_ns(reader: LogReader) -> int:
    """Usual interval between the first samples."""
    parts: list[np.ndarray] = []
    count = 0
    reader.channel(IMU.topic)
    for batch in reader.batches([IMU.topic], decode=[], target_rows=_HEAD_ROWS):
        parts.append(batch[IMU.topic].valid_time_ns)
        count += len(parts[-1])
        if count >= _HEAD_ROWS:
            break
    steps = np.diff(np.concatenate(parts)) if parts else np.zeros(0, dtype=np.int64)
    steps = np.sort(steps[steps > 0])
    if len(steps) == 0:
        raise UsageError(
            "the interval of the inertial samples cannot be told",
            where=f"{reader.path}, {IMU.topic}: {count} rows",
            mend="leave the rate as it is",
        )
    return int(steps[len(steps) // 2])


def _samples(rows: Columns) -> np.ndarray:
    samples = np.zeros(len(rows), dtype=SAMPLE_DTYPE)
    samples["t"] = rows.valid_time_ns
    samples["log_t"] = rows.log_time_ns
    samples["w"] = rows["angular_rate_body_rad_s"]
    samples["f"] = rows["specific_force_body_m_s2"]
    samples["temperature"] = np.nan
    if "temperature_c" in rows.values:
        known = rows.is_present("temperature_c")
        samples["temperature"][known] = rows["temperature_c"][known]
    return samples


def _fields(reader: LogReader) -> list[str]:
    """Fields of the log's own kind of inertial sample."""
    codec = reader.channel(IMU.topic).codec
    return [] if codec is None else [field.name for field in codec.layout.fields]
