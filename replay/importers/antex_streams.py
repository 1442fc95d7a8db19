"""ANTEX files as a channel: the antennas that the log's receivers name, and satellites'."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Final

import numpy as np

from replay import channels
from replay.errors import ForeignFileError
from replay.gnss.antennas import without_radome
from replay.importers.antex import AntexFile, Calibration
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.spec import Stream
from replay.log.columns import Columns, Ragged

_UNKNOWN_NS: Final = -1  # gets the time of the log's start


@dataclasses.dataclass(frozen=True, slots=True)
class Known:
    """What the streams that are read before tell.

    Attributes
    ----------
    antennas : tuple of str
        Of the receivers, type and radome.
    span_ns : tuple of 2 int, or None
        First and last time.
    markers : mapping of receiver to str
        As the first header of each states it.
    """

    antennas: tuple[str, ...]
    span_ns: tuple[int, int] | None
    markers: Mapping[str, str] = dataclasses.field(default_factory=dict)


def antex_stream(
    file: File, findings: Findings, stream: Stream, known: Known
) -> dict[str, Columns]:
    """Calibrations of the receivers' antennas, and of the satellites where the spec says so.

    Raises
    ------
    ForeignFileError
        Where the file has none of them.
    """
    antex = AntexFile(file, findings)
    wanted = set()
    for name in known.antennas:
        bare = without_radome(name)
        if name in antex.receivers:
            wanted.add(name)
        elif bare in antex.receivers:
            text = f"{file.name}: {name} is not calibrated, {bare} stands in as the IGS does it"
            findings.notes.append(text)
            wanted.add(bare)
        else:
            findings.notes.append(f"{file.name}: {name} is not calibrated")
    found = antex.read(wanted, satellites=stream.satellites, span_ns=known.span_ns)
    if not found and not findings.losses.losses:
        raise ForeignFileError(
            "the file calibrates no antenna of the log",
            where=file.name,
            mend=f"the log has {', '.join(known.antennas) or 'no receiver with an antenna'}; "
            "take another file, or leave the stream out",
        )
    return {channels.ANTENNAS.topic: calibration_columns(found)} if found else {}


def calibration_columns(calibrations: list[Calibration]) -> Columns:
    """Rows of `replay.AntennaCalibration` without a time."""
    angles = np.array([c.zenith_rad for c in calibrations])
    return Columns.build(
        np.full(len(calibrations), _UNKNOWN_NS),
        {
            "antenna": Ragged.from_texts([c.antenna for c in calibrations]),
            "serial": Ragged.from_texts([c.serial for c in calibrations]),
            "frequency": Ragged.from_texts([c.frequency for c in calibrations]),
            "offset_neu_m": np.array([c.offset_neu_m for c in calibrations]),
            "zenith_start_rad": np.ascontiguousarray(angles[:, 0]),
            "zenith_end_rad": np.ascontiguousarray(angles[:, 1]),
            "zenith_step_rad": np.ascontiguousarray(angles[:, 2]),
            "azimuth_step_rad": np.array([c.azimuth_step_rad for c in calibrations]),
            "pattern_m": _ragged([c.pattern_m for c in calibrations]),
            "azimuth_pattern_m": _ragged([c.azimuth_pattern_m for c in calibrations]),
            "valid_from_ns": np.array([c.valid_from_ns for c in calibrations], dtype=np.int64),
            "valid_until_ns": np.array([c.valid_until_ns for c in calibrations], dtype=np.int64),
        },
    )


def _ragged(rows: list[tuple[float, ...]]) -> Ragged:
    ends = np.cumsum([0, *(len(row) for row in rows)]).astype(np.int64)
    return Ragged(ends, np.array([n for row in rows for n in row], dtype=np.float64))
