"""RINEX files as lines: unix compress and Hatanaka are undone first."""

from __future__ import annotations

import dataclasses
import importlib
import warnings
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.errors import ForeignFileError
from replay.importers.files import File
from replay.importers.findings import Findings

_COMPRESS_MAGIC: Final = b"\x1f\x9d"
_CRINEX_LABEL: Final = b"CRINEX VERS"
_LABEL_AT: Final = 60
_NEWLINE: Final = 10
_RETURN: Final = 13

Int64 = npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """A text file by its lines, counted from 0.

    Attributes
    ----------
    file : File
    data : uint8 array
    starts, ends : int64 arrays (n,)
        First byte of each line and the byte after its last, line end left out.
    whole_end : bool
        Whether the last line has a line end.
    """

    file: File
    data: npt.NDArray[np.uint8]
    starts: Int64
    ends: Int64
    whole_end: bool

    def __len__(self) -> int:
        return len(self.starts)

    def raw(self, line: int) -> bytes:
        """Bytes of a line."""
        return self.file.data[self.starts[line] : self.ends[line]]

    def text(self, line: int) -> str:
        """A line for a person and for a header; bytes beyond ASCII are Latin-1."""
        return self.raw(line).decode("latin-1")


def split_lines(file: File) -> Lines:
    """Where the lines of a file stand."""
    data = np.frombuffer(file.data, dtype=np.uint8)
    ends = np.flatnonzero(data == _NEWLINE).astype(np.int64)
    whole_end = len(data) == 0 or data[-1] == _NEWLINE
    if not whole_end:
        ends = np.append(ends, len(data))
    starts = np.zeros(len(ends), dtype=np.int64)
    starts[1:] = ends[:-1] + 1
    returns = (ends > starts) & (data[np.maximum(ends - 1, 0)] == _RETURN)
    return Lines(file, data, starts, ends - returns, bool(whole_end))


def unpack(file: File, findings: Findings) -> File:
    """The RINEX text of a file that may be packed by unix compress or Hatanaka.

    Gzip is undone by :func:`replay.importers.files.read_file` already. What the
    package warns of is counted; it gives nothing of a Hatanaka file that is cut.

    Raises
    ------
    ForeignFileError
        Where the package that unpacks is missing or the packed bytes are damaged.
    """
    data = file.data
    if data.startswith(_COMPRESS_MAGIC):
        data = _call(file, "ncompress", "decompress", data, "run `uncompress` on it", findings)
    first = data[: max(data.find(b"\n"), 0)]
    if first[_LABEL_AT:].startswith(_CRINEX_LABEL):
        data = _call(file, "hatanaka", "crx2rnx", data, "run `crx2rnx` on it", findings)
    return file if data is file.data else dataclasses.replace(file, data=data)


def _call(
    file: File, package: str, function: str, data: bytes, instead: str, findings: Findings
) -> bytes:
    try:
        work: Any = getattr(importlib.import_module(package), function)
    except ImportError as error:
        raise ForeignFileError(
            f"the file is compressed and the package {package} is not installed",
            where=file.name,
            mend=f"pip install hatanaka, or {instead}",
        ) from error
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            unpacked: bytes = work(data)
    except Exception as error:  # each package has its own errors
        raise ForeignFileError(
            f"the compressed file is damaged: {error}", where=file.name, mend="fetch it again"
        ) from error
    for warning in caught:
        findings.loss(str(warning.message), file.name, 1, "warnings", "fetch it again")
    return unpacked
