"""RTKLIB time-tag files (`.tag`): when bytes of a stream arrived in a file.

Layout (RTKLIB demo5, stream.c): 60 bytes of text, uint32 host tick (ms), uint32
seconds since 1970 of the start as a GPS calendar date, float64 fraction of it;
then records of uint32 milliseconds since the start and uint32 file position
after the write. Little endian.
"""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np

from replay import time
from replay.errors import ForeignFileError
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.table import Int64

_MAGIC: Final = b"TIMETAG RTKLIB"
_HEAD_BYTES: Final = 76
_GPS_EPOCH_S: Final = 315_964_800  # 1980-01-06 as seconds since 1970 of the same calendar
_HEAD: Final = np.dtype([("tick", "<u4"), ("seconds", "<u4"), ("fraction", "<f8")])


@dataclasses.dataclass(frozen=True, slots=True)
class Tag:
    """Arrivals.

    Attributes
    ----------
    start_ns : int
        GPS nanoseconds of the start.
    elapsed_ms : int64 array (n,)
        Since the start.
    position : int64 array (n,)
        Bytes of the file that were there by then.
    """

    start_ns: int
    elapsed_ms: Int64
    position: Int64


def read_tag(file: File, findings: Findings) -> Tag:
    """Arrivals from a time-tag file.

    Raises
    ------
    ForeignFileError
        Where it is none, or holds no record, or is cut and the import strict.
    """
    if not file.data.startswith(_MAGIC) or len(file.data) < _HEAD_BYTES:
        raise ForeignFileError(
            "no RTKLIB time-tag file",
            where=file.name,
            mend=f"one begins with {_MAGIC.decode()!r} and has {_HEAD_BYTES} bytes of header",
        )
    whole, rest = divmod(len(file.data) - _HEAD_BYTES, 8)
    if rest:
        findings.loss(
            "the time-tag file ends within a record",
            f"{file.name}, byte {len(file.data) - rest}",
            rest,
            "bytes",
            "records of 8 bytes are expected (32-bit positions)",
        )
    if whole < 2:
        raise ForeignFileError("fewer than two time tags", where=file.name, mend="fetch it again")
    head = np.frombuffer(file.data, dtype=_HEAD, count=1, offset=60)[0]
    records = np.frombuffer(file.data, dtype="<u4", count=2 * whole, offset=_HEAD_BYTES)
    pairs = records.reshape(-1, 2).astype(np.int64)
    start = (int(head["seconds"]) - _GPS_EPOCH_S) * time.NS_PER_S
    return Tag(start + round(float(head["fraction"]) * time.NS_PER_S), pairs[:, 0], pairs[:, 1])
