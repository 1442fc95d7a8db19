"""BLQ files: ocean loading of stations, as the service of Onsala gives it.

Eleven tides M2 S2 N2 K2 K1 O1 P1 Q1 Mf Mm Ssa; three lines of amplitudes (m) up, west, south,
three of phases (deg, lags). `$$` begins a comment (IERS Conventions 2010, section 7.1.2).
"""

from __future__ import annotations

import dataclasses
import math
from typing import Final

import numpy as np

from replay import channels
from replay.errors import ForeignFileError
from replay.importers.antex_streams import Known
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.product_files import UNKNOWN_NS, About, product_row
from replay.importers.rinex_files import Lines, split_lines, unpack
from replay.importers.rinex_header import MEND
from replay.importers.spec import Stream
from replay.log.columns import Columns, Ragged

TIDES: Final = 11
_LINES: Final = 6
_NAME_LETTERS: Final = 4


@dataclasses.dataclass(frozen=True, slots=True)
class Loading:
    """Of one station.

    Attributes
    ----------
    station, model : str
    amplitude_m, phase_rad : tuple of 33 float
        Up, west, south; eleven tides each.
    """

    station: str
    model: str
    amplitude_m: tuple[float, ...]
    phase_rad: tuple[float, ...]


def ocean_loading_stream(
    file: File, findings: Findings, stream: Stream, known: Known
) -> dict[str, Columns]:
    """A row for each receiver of the log whose marker begins with a station's name.

    Where the spec names a `site`, the row is that one's and the stream's receiver's.

    Raises
    ------
    ForeignFileError
        Where the file has no station of the log.
    """
    file = unpack(file, findings)
    stations = read_loading(split_lines(file), findings)
    wanted = {stream.receiver: stream.site} if stream.site else known.markers
    found: dict[str, Columns] = {}
    for receiver, marker in wanted.items():
        loading = _station(stations, marker)
        if loading is None and not stream.site:
            loading = _station(stations, receiver)
        if loading is None:
            findings.notes.append(f"{file.name}: no ocean loading of {receiver} ({marker})")
            continue
        found[channels.OCEAN_LOADING.at(receiver=receiver)] = _columns(loading)
    if not found:
        raise ForeignFileError(
            "the file has no station of the log",
            where=file.name,
            mend=f"it has {', '.join(one.station for one in stations) or 'none'}; name one as the "
            "stream's site and its receiver",
        )
    about = About(
        source=file.name.rpartition("/")[2],
        format="blq",
        time_system="UTC",
        detail="; ".join(dict.fromkeys(one.model for one in stations if one.model)),
    )
    return found | product_row(about, np.zeros(0, dtype=np.int64), len(found))


def _station(stations: list[Loading], name: str) -> Loading | None:
    """The station of a name, or the one that its first four letters name."""
    plain = name.strip().upper()
    for cut in (plain, plain[:_NAME_LETTERS]):
        for one in stations:
            if cut and one.station.upper().split()[0] == cut:
                return one
    return None


def read_loading(lines: Lines, findings: Findings) -> list[Loading]:
    """Every whole station of a file."""
    found: list[Loading] = []
    damaged: list[int] = []
    name, model, head = "", "", 0
    rows: list[tuple[float, ...]] = []
    for line in range(len(lines)):
        text = lines.text(line)
        if not text.strip():
            continue
        if text.startswith("$$"):
            words = text[2:].split()
            # "$$ FES2004_PP ID: 2009-06-25 20:02:03": the model stands before what is told of it.
            if len(words) > 1 and words[1].startswith("ID"):
                model = words[0]
            continue
        numbers = _numbers(text)
        if not numbers:
            if name:
                damaged.append(head)
            name, head, rows = text.strip(), line + 1, []
            continue
        rows.append(numbers)
        if len(rows) < _LINES or not name:
            continue
        if all(len(row) == TIDES for row in rows):
            amplitude = tuple(n for row in rows[:3] for n in row)
            phase = tuple(math.radians(n) for row in rows[3:] for n in row)
            found.append(Loading(name, model, amplitude, phase))
        else:
            damaged.append(head)
        name, model = "", ""
    if name:
        damaged.append(head)
    what = "a station's lines are not six of eleven numbers; station left out"
    findings.rows(what, lines.file.name, damaged, MEND)
    return found


def _numbers(text: str) -> tuple[float, ...]:
    """Finite numbers of a line; nothing where it has anything else."""
    try:
        numbers = tuple(float(word) for word in text.split())
    except ValueError:
        return ()
    return numbers if all(map(math.isfinite, numbers)) else ()


def _columns(loading: Loading) -> Columns:
    """The row of `replay.OceanLoading`; it has no time."""
    return Columns.build(
        np.array([UNKNOWN_NS], dtype=np.int64),
        {
            "station": Ragged.from_texts([loading.station]),
            "model": Ragged.from_texts([loading.model]),
            "amplitude_up_west_south_m": Ragged.from_matrix(np.array([loading.amplitude_m])),
            "phase_up_west_south_rad": Ragged.from_matrix(np.array([loading.phase_rad])),
        },
    )
