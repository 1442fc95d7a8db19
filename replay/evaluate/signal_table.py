"""Rows of a channel that are found by epoch, satellite and signal."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from replay.evaluate.align import Rows
from replay.evaluate.geometry import Floats
from replay.log.columns import Columns, Ragged
from replay.time import NS_PER_S

Labels = npt.NDArray[np.bytes_]
WIDE_LANE: Final = "WL"
TOLERANCE_S: Final = 0.1  # by which receivers' clocks may put one nominal epoch apart


def labels(columns: Columns, field: str) -> Labels:
    """A field of strings as an array (n,) of bytes, however the reader keeps it."""
    column = columns.values[field]
    if not isinstance(column, Ragged):
        return column.astype(np.bytes_)
    lengths = np.diff(column.offsets)
    if len(lengths) and int(lengths[0]) > 0 and bool((lengths == lengths[0]).all()):
        packed = column.values[column.offsets[0] : column.offsets[-1]]
        return np.ascontiguousarray(packed, dtype=np.uint8).view(f"S{int(lengths[0])}")
    return np.array(column.blobs(), dtype=np.bytes_)


class SignalTable:
    """Finds rows of one channel.

    Parameters
    ----------
    times_ns : int64 array (n,), GPS ns
    satellites, signals : bytes array (n,)
    tolerance_s : float, s
        A row serves times that are at most so far from its own.
    """

    def __init__(
        self, times_ns: Rows, satellites: Labels, signals: Labels, tolerance_s: float = TOLERANCE_S
    ) -> None:
        self._tolerance_ns = round(tolerance_s * NS_PER_S)
        self._epochs, epoch = np.unique(times_ns, return_inverse=True)
        joined = np.char.add(satellites, signals) if len(satellites) else np.array([], dtype="S1")
        self._names, code = np.unique(joined, return_inverse=True)
        self._signals = sorted(set(zip(satellites.tolist(), signals.tolist(), strict=True)))
        keys = epoch.astype(np.int64) * len(self._names) + code
        self._order = np.argsort(keys, kind="stable")
        self._keys = keys[self._order]

    @classmethod
    def of(cls, columns: Columns, tolerance_s: float = TOLERANCE_S) -> SignalTable:
        """Of a channel with the fields `satellite` and `signal`."""
        return cls(
            columns.valid_time_ns,
            labels(columns, "satellite"),
            labels(columns, "signal"),
            tolerance_s,
        )

    def rows(self, times_ns: Rows, satellites: Labels, signals: Labels) -> Rows:
        """Row of each (time, satellite, signal), (m,); -1 where there is none."""
        missing = np.full(len(times_ns), -1, dtype=np.int64)
        if len(self._keys) == 0 or len(times_ns) == 0:
            return missing
        last = len(self._epochs) - 1
        after = np.clip(np.searchsorted(self._epochs, times_ns), 0, last)
        before = np.maximum(after - 1, 0)
        nearer = np.abs(self._epochs[before] - times_ns) < np.abs(self._epochs[after] - times_ns)
        epoch = np.where(nearer, before, after)
        known = np.abs(self._epochs[epoch] - times_ns) <= self._tolerance_ns
        joined = np.char.add(satellites, signals)
        code = np.minimum(np.searchsorted(self._names, joined), len(self._names) - 1)
        known &= self._names[code] == joined
        key = epoch.astype(np.int64) * len(self._names) + code
        place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        known &= self._keys[place] == key
        return np.asarray(np.where(known, self._order[place], missing))

    def lanes(self) -> dict[bytes, tuple[bytes, bytes]]:
        """The first two signals of each system, by its letter: those of the wide lane."""
        found: dict[bytes, list[bytes]] = {}
        for satellite, signal in self._signals:
            known = found.setdefault(satellite[:1], [])
            if signal not in known:
                known.append(signal)
        return {
            system: (sorted(known)[0], sorted(known)[1])
            for system, known in found.items()
            if len(known) > 1
        }


def picked(values: Floats, rows: Rows) -> Floats:
    """Values at rows; NaN where a row is -1."""
    if len(values) == 0:
        return np.full(len(rows), np.nan)
    return np.asarray(np.where(rows >= 0, values[np.maximum(rows, 0)], np.nan))
