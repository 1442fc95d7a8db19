"""Rows that wait from block to block: inertial samples for epochs, epochs for a base.

States of stages that hold such rows build on these.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.gnss.measurements import Epochs, Selection, characters, gather_epochs
from replay.kernels import gathering
from replay.kernels.epoch_matching import LATE_NS, match_epochs
from replay.kernels.gnss_records import EPOCH_DTYPE, MEASURED_DTYPE, NOT_YET
from replay.log.columns import Columns
from replay.stages.base import BASE, RECEIVER, Block, Context, Port

Array = np.ndarray[Any, Any]

SAMPLE_TYPES: Final[dict[str, np.dtype[Any]]] = {
    "held_t": np.dtype(np.int64),
    "held_log_t": np.dtype(np.int64),
    "held_w": np.dtype(np.float64),
    "held_f": np.dtype(np.float64),
}
"""Of the fields of :class:`HeldSamples`, for dumps."""

EPOCH_READS: Final = (
    channels.GNSS_OBS,
    channels.SATELLITES,
    channels.CORRECTIONS,
    channels.COARSE,
)
"""What makes whole epochs of a receiver."""

_NS: Final = 1_000_000_000
_INTERVALS: Final = 2.5


@dataclasses.dataclass(kw_only=True)
class HeldSamples:
    """Inertial samples that wait for what may come late."""

    held_t: Array = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    held_log_t: Array = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    held_w: Array = dataclasses.field(default_factory=lambda: np.zeros((0, 3)))
    held_f: Array = dataclasses.field(default_factory=lambda: np.zeros((0, 3)))

    def hold(self, imu: Columns, latency_s: float) -> None:
        """Keep samples until `latency_s` after their log times."""
        latency = round(latency_s * _NS)
        self.held_t = np.concatenate([self.held_t, imu.valid_time_ns])
        self.held_log_t = np.concatenate([self.held_log_t, imu.log_time_ns + latency])
        self.held_w = np.concatenate([self.held_w, imu["angular_rate_body_rad_s"]])
        self.held_f = np.concatenate([self.held_f, imu["specific_force_body_m_s2"]])

    def ready(self, now_ns: int) -> int:
        """How many have waited long enough at a log time."""
        return int(np.searchsorted(self.held_log_t, now_ns, side="right"))

    def release(self, count: int) -> None:
        """Let the first ones go."""
        self.held_t, self.held_log_t = self.held_t[count:], self.held_log_t[count:]
        self.held_w, self.held_f = self.held_w[count:], self.held_f[count:]


@dataclasses.dataclass(kw_only=True)
class HeldEpochs:
    """Epochs of a rover that wait for a base's, and epochs of the base."""

    epochs: Array = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=EPOCH_DTYPE))
    rows: Array = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=MEASURED_DTYPE))
    base_epochs: Array = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=EPOCH_DTYPE))
    base_rows: Array = dataclasses.field(default_factory=lambda: np.zeros(0, dtype=MEASURED_DTYPE))
    # ns, one element each: log time of the last row, and of the last epoch's release.
    now: Array = dataclasses.field(default_factory=lambda: np.zeros(1, dtype=np.int64))
    released: Array = dataclasses.field(default_factory=lambda: np.zeros(1, dtype=np.int64))

    def take(
        self, block: Block, selection: Selection, roles: tuple[str, str] = (RECEIVER, BASE)
    ) -> None:
        """Take the epochs of both receivers in a block."""
        for role in roles:
            found = read_epochs(block, selection, role)
            if found is None:
                continue
            log_times = block[Port(channels.GNSS_OBS, role).name].log_time_ns
            self.now[0] = max(int(self.now[0]), int(log_times[-1]))
            if role == roles[0]:
                self.epochs, self.rows = join_epochs(self.epochs, self.rows, found)
            else:
                self.base_epochs, self.base_rows = join_epochs(
                    self.base_epochs, self.base_rows, found
                )

    def correct(self, block: Block) -> None:
        """Take what a network says of the rover's epochs in a block, those that came before too."""
        rows = block.get(channels.NETWORK_CORRECTIONS.name)
        if rows is None:
            return
        self.now[0] = max(int(self.now[0]), int(rows.log_time_ns[-1]))
        gathering.join_network(
            self.epochs,
            self.rows,
            rows.valid_time_ns,
            rows.log_time_ns,
            characters(rows["satellite"], 3),
            characters(rows["signal"], 2),
            np.stack([rows["correction_m"], rows["correction_std_m"]], axis=1),
        )

    def expect_corrections(self, start: int) -> None:
        """Let the rover's epochs from `start` on wait for what a network says of them."""
        self.epochs["needed"][start:] = NOT_YET

    def late_corrections(self, release: Array) -> None:
        """Take off the epochs released what came only after their release."""
        for place in np.flatnonzero(self.epochs["needed"][: len(release)] > release):
            first, count = self.epochs["first"][place], self.epochs["count"][place]
            for name in ("network_known", "network", "network_code", "network_std"):
                self.rows[name][first : first + count] = 0

    def match(
        self, now_ns: int, tolerance_ns: int, wait_ns: int, max_age_ns: int
    ) -> tuple[Array, Array, int]:
        """Base epoch (or minus one) and log time of release of each epoch, and how many are ready.

        See :func:`replay.kernels.epoch_matching.match_epochs`.
        """
        return self.match_times(
            self.base_epochs["t"],
            self.base_epochs["log_t"],
            now_ns,
            tolerance_ns,
            wait_ns,
            max_age_ns,
        )

    def match_times(
        self, base_t: Array, base_log: Array, now_ns: int, tolerance_ns: int, wait_ns: int,
        max_age_ns: int,
    ) -> tuple[Array, Array, int]:  # fmt: skip
        """The same with base epochs of given valid and log times."""
        count = len(self.epochs)
        partner = np.full(count, -1, dtype=np.int64)
        release = np.zeros(count, dtype=np.int64)
        ready = match_epochs(
            np.ascontiguousarray(self.epochs["t"]), np.ascontiguousarray(self.epochs["log_t"]),
            np.ascontiguousarray(base_t), np.ascontiguousarray(base_log),
            np.ascontiguousarray(self.epochs["needed"]), now_ns, int(self.released[0]),
            tolerance_ns, wait_ns, max_age_ns, partner, release,
        )  # fmt: skip
        return partner, release, ready

    def forget_unasked(self, max_age_ns: int) -> None:
        """Drop base epochs that no epoch of the rover can ask for any more."""
        if len(self.base_epochs):
            self.forget_base(int(self.base_epochs["t"].max()) - LATE_NS - max_age_ns)

    def forget(self, count: int) -> None:
        """Drop the rover's first epochs."""
        self.epochs, self.rows = forget_epochs(self.epochs, self.rows, count)

    def forget_base(self, oldest_ns: int) -> None:
        """Drop the base's epochs before the first one that is not older than a time."""
        if len(self.base_epochs):
            self.base_epochs, self.base_rows = forget_epochs(
                self.base_epochs, self.base_rows, int(np.argmax(self.base_epochs["t"] >= oldest_ns))
            )


EPOCH_TYPES: Final[dict[str, np.dtype[Any]]] = {
    "epochs": EPOCH_DTYPE,
    "rows": MEASURED_DTYPE,
    "base_epochs": EPOCH_DTYPE,
    "base_rows": MEASURED_DTYPE,
    "now": np.dtype(np.int64),
    "released": np.dtype(np.int64),
}
"""Of the fields of :class:`HeldEpochs`, for dumps."""


def nominal_interval(context: Context, observations: Port) -> float:
    """Seconds between a receiver's epochs, as its first rows tell; 1 where they do not."""
    rows = context.heads.get(observations.name)
    times = np.unique(rows.valid_time_ns) if rows is not None else np.zeros(0, dtype=np.int64)
    return float(np.diff(times).min()) / _NS if len(times) > 1 else 1.0


def longest_gap(least_s: float, interval_s: float) -> float:
    """Seconds without a phase that end its ambiguity: what is set, and two missing epochs."""
    return max(least_s, _INTERVALS * interval_s)


def read_epochs(
    block: Block, selection: Selection, role: str = RECEIVER, codes: Selection | None = None
) -> Epochs | None:
    """Epochs of one receiver in a block with what is known of them; None without any.

    Codes of `codes`, where it is given, replace others of their frequencies.
    """
    observations, *known = (block.get(Port(channel, role).name) for channel in EPOCH_READS)
    if observations is None:
        return None
    return gather_epochs(observations, selection, *known, codes=codes)


def join_epochs(epochs: Array, rows: Array, more: Epochs) -> tuple[Array, Array]:
    """Epochs with their rows, the first numbers of rows set right."""
    if len(epochs) == 0:
        return more.epochs, more.rows
    later = more.epochs.copy()
    later["first"] += len(rows)
    return np.concatenate([epochs, later]), np.concatenate([rows, more.rows])


def forget_epochs(epochs: Array, rows: Array, count: int) -> tuple[Array, Array]:
    """Epochs from `count` on with their rows."""
    if count == len(epochs):
        return epochs[:0].copy(), rows[:0].copy()
    start = int(epochs["first"][count])
    epochs = epochs[count:].copy()
    epochs["first"] -= start
    return epochs, rows[start:].copy()
