"""What a pass backwards through a log found, kept on disk for the pass forwards after it."""

from __future__ import annotations

import dataclasses
import os
import tempfile
from typing import Any, Final

import numpy as np

Array = np.ndarray[Any, Any]

_WORD: Final = np.dtype("<i8").itemsize


@dataclasses.dataclass(frozen=True, slots=True)
class Found:
    """Smoothed nodes of a slice of the log, in its order.

    Attributes
    ----------
    shown : int64 array (nodes,)
        States that the covariance is of; minus one where nothing was asked for.
    error_starts, covariance_starts : int64 arrays (nodes + 1,)
    errors, covariances : float64 arrays
        Errors of all states, upper triangles.
    """

    shown: Array
    error_starts: Array
    errors: Array
    covariance_starts: Array
    covariances: Array

    def __len__(self) -> int:
        return len(self.shown)


class Spool:
    """Slices that are put in from the last to the first and taken out from the first on.

    One slice at a time is in memory; of the others it is known where they lie.
    """

    def __init__(self) -> None:
        # It lives as long as the spool.
        self._file = tempfile.TemporaryFile()  # noqa: SIM115
        self._places: list[int] = []
        self._slice: Found | None = None
        self._begin = 0
        self.row = 0

    def put(self, found: Found) -> None:
        """Keep the slice that comes before all others."""
        self._places.append(self._file.seek(0, os.SEEK_END))
        for field in dataclasses.fields(found):
            array = getattr(found, field.name)
            self._file.write(len(array).to_bytes(_WORD, "little"))
            self._file.write(np.ascontiguousarray(array).data)

    def skip(self, rows: int) -> None:
        """Go on at a row, counted from the first, as after a checkpoint."""
        while self.row < rows:
            self.take(min(rows - self.row, 1 << 12))

    def take(self, count: int) -> Found:
        """The next so many nodes.

        Raises
        ------
        ValueError
            Where there are not as many.
        """
        parts: list[Found] = []
        left = count
        while left > 0:
            if self._slice is None or self._begin == len(self._slice):
                self._slice, self._begin = self._next(), 0
            stop = min(self._begin + left, len(self._slice))
            parts.append(_part(self._slice, self._begin, stop))
            left -= stop - self._begin
            self._begin = stop
        self.row += count
        return _join(parts)

    def _next(self) -> Found:
        if not self._places:
            raise ValueError("the pass backwards found fewer nodes than the one forwards")
        self._file.seek(self._places.pop())
        arrays = []
        for field in dataclasses.fields(Found):
            length = int.from_bytes(self._file.read(_WORD), "little")
            kind = "<f8" if field.name in ("errors", "covariances") else "<i8"
            arrays.append(np.frombuffer(self._file.read(_WORD * length), dtype=kind))
        return Found(*arrays)


def _part(found: Found, begin: int, stop: int) -> Found:
    errors = found.error_starts[begin : stop + 1]
    covariances = found.covariance_starts[begin : stop + 1]
    return Found(
        found.shown[begin:stop],
        errors - errors[0],
        found.errors[errors[0] : errors[-1]],
        covariances - covariances[0],
        found.covariances[covariances[0] : covariances[-1]],
    )


def _join(parts: list[Found]) -> Found:
    if len(parts) == 1:
        return parts[0]
    errors = [0, *np.cumsum([len(part.errors) for part in parts]).tolist()]
    covariances = [0, *np.cumsum([len(part.covariances) for part in parts]).tolist()]

    def offsets(starts: list[Array], shifts: list[int]) -> Array:
        moved = [s[:-1] + shift for s, shift in zip(starts, shifts, strict=False)]
        return np.concatenate([*moved, [shifts[-1]]]).astype(np.int64)

    return Found(
        np.concatenate([part.shown for part in parts]),
        offsets([part.error_starts for part in parts], errors),
        np.concatenate([part.errors for part in parts]),
        offsets([part.covariance_starts for part in parts], covariances),
        np.concatenate([part.covariances for part in parts]),
    )
