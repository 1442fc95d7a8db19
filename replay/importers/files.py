"""Files as bytes: gzip or plain by their first bytes, with digest and size."""

from __future__ import annotations

import dataclasses
import gzip
import hashlib
import zlib
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.errors import ForeignFileError
from replay.importers.findings import Findings

_GZIP_MAGIC: Final = b"\x1f\x8b"
_GZIP_WINDOW: Final = 31  # zlib: largest window, gzip wrapper
_STEP_BYTES: Final = 4096
_NEWLINE: Final = 10
_RETURN: Final = 13


@dataclasses.dataclass(frozen=True, slots=True)
class File:
    """A file in memory.

    Attributes
    ----------
    name : str
        Path for messages.
    data : bytes
        Unpacked.
    sha256 : str
        Of the file as it is stored.
    size : int
        Of the file as it is stored, bytes.
    """

    name: str
    data: bytes
    sha256: str
    size: int

    def recorded_ends(self, line_end_bytes: int) -> npt.NDArray[np.int64]:
        """Where each line ended in the recorder's file, whatever line ends are stored now.

        Parameters
        ----------
        line_end_bytes : int
            Length of a line end when the file was recorded: 1 or 2.

        Returns
        -------
        int64 array (lines,), bytes
        """
        raw = np.frombuffer(self.data, dtype=np.uint8)
        ends = np.flatnonzero(raw == _NEWLINE).astype(np.int64)
        if len(raw) and raw[-1] != _NEWLINE:
            ends = np.append(ends, len(raw))
        lengths = np.diff(ends, prepend=-1) - 1
        lengths -= (ends > 0) & (raw[ends - 1] == _RETURN)
        return np.cumsum(lengths + line_end_bytes)


def read_file(path: Path, findings: Findings, *, mend: str) -> File:
    """A file's bytes, unpacked.

    Of a gzip file that ends early or is damaged, the whole lines before the
    damage are kept and a loss is counted.

    Raises
    ------
    ForeignFileError
        Where the file is missing, or damaged and the import is strict.
    """
    try:
        stored = path.read_bytes()
    except OSError as error:
        raise ForeignFileError(
            f"the file cannot be read: {error.strerror}", where=str(path), mend=mend
        ) from error
    data = stored
    if stored.startswith(_GZIP_MAGIC):
        try:
            data = gzip.decompress(stored)
        except (EOFError, OSError, zlib.error) as error:
            data = _salvage(stored)
            findings.loss(
                f"the gzip file is damaged ({error}); read up to the damage",
                str(path),
                len(data),
                "bytes kept",
                "fetch the file again",
            )
    return File(str(path), data, hashlib.sha256(stored).hexdigest(), len(stored))


def _salvage(stored: bytes) -> bytes:
    """What unpacks before the damage, up to its last whole line."""
    unpacker = zlib.decompressobj(_GZIP_WINDOW)
    data = bytearray()
    for at in range(0, len(stored), _STEP_BYTES):
        before, piece = unpacker.copy(), stored[at : at + _STEP_BYTES]
        try:
            data += unpacker.decompress(piece)
        except zlib.error:
            data += _bytewise(before, piece)
            break
    return bytes(data[: data.rfind(b"\n") + 1])


def _bytewise(unpacker: zlib._Decompress, piece: bytes) -> bytes:
    """What a damaged piece still gives: the error of a whole piece hides all of its output."""
    data = bytearray()
    for at in range(len(piece)):
        try:
            data += unpacker.decompress(piece[at : at + 1])
        except zlib.error:
            break
    return bytes(data)
