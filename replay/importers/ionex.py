"""IONEX files, versions 1.0 and 1.1: maps of the ionosphere's electron content.

Schaer, Gurtner and Feltens, "IONEX: The IONosphere Map EXchange Format Version 1", 1998.
A map with a line that cannot be read is left out whole: the loop in time goes on without it.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Final

import numpy as np

from replay import channels, time
from replay.errors import ForeignFileError
from replay.importers.antex_streams import Known
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.product_files import About, Float64, product_row, to_gps, within
from replay.importers.rinex_files import Lines, split_lines, unpack
from replay.importers.rinex_header import MEND, header_length, read_version, split_record
from replay.importers.spec import Stream
from replay.kernels.product_text import calendar_ns
from replay.log.columns import Columns, Ragged

_ABSENT: Final = 9999
_WIDTH: Final = 5
_PER_LINE: Final = 16
_M_PER_KM: Final = 1000.0
_START: Final = {"START OF TEC MAP": "tec", "START OF RMS MAP": "rms"}
_END: Final = ("END OF TEC MAP", "END OF RMS MAP")


@dataclasses.dataclass(frozen=True, slots=True)
class Grid:
    """Places of the values: first, last and step of heights (km), latitudes, longitudes (deg)."""

    heights: tuple[float, float, float]
    latitudes: tuple[float, float, float]
    longitudes: tuple[float, float, float]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of heights, latitudes and longitudes."""
        return _count(self.heights), _count(self.latitudes), _count(self.longitudes)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Map:
    kind: str
    calendar_ns: int
    values: Float64


def _count(axis: tuple[float, float, float]) -> int:
    first, last, step = axis
    if step == 0.0:
        return 1
    count = round((last - first) / step) + 1
    if count < 1 or abs(first + (count - 1) * step - last) > 1e-6:
        raise ValueError("no grid")
    return count


def ionex_stream(
    file: File, findings: Findings, stream: Stream, known: Known
) -> dict[str, Columns]:
    """Maps in the order of their epochs and heights; epochs are of UTC.

    Raises
    ------
    ForeignFileError
        Where it is no IONEX file with a grid.
    """
    file = unpack(file, findings)
    lines = split_lines(file)
    version, kind, _ = read_version(_as_rinex(lines, file))
    start = header_length(lines)
    said = _header(lines, start)
    grid, radius = _grid(said, file.name)
    reader = _Reader(lines, start, grid, _exponent(said))
    reader.run()
    reader.report(findings)
    maps = {(m.calendar_ns, m.kind): m for m in reader.found}
    epochs = sorted({m.calendar_ns for m in reader.found if m.kind == "tec"})
    times = to_gps(np.array(epochs, dtype=np.int64), "UTC")
    near = within(times, known.span_ns, stream.margin, file.name, findings)
    if not near.any():
        return {}
    about = About(
        source=file.name.rpartition("/")[2],
        format="ionex",
        version=f"{version:g}",
        agency=said.get("PGM / RUN BY / DATE", "")[20:40].strip(),
        time_system="UTC",
        kind=said.get("MAPPING FUNCTION", "").strip(),
        detail=kind,
    )
    found = product_row(about, times, int(near.sum()) * grid.shape[0])
    rows = [(int(times[k]), epochs[k]) for k in np.flatnonzero(near)]
    found[channels.IONOSPHERE_MAP.topic] = _columns(rows, maps, grid, radius)
    return found


def _as_rinex(lines: Lines, file: File) -> Lines:
    """The lines, where the first is that of an IONEX file."""
    first = lines.text(0) if len(lines) else ""
    if split_record(first)[0] != "IONEX VERSION / TYPE":
        raise ForeignFileError(
            "the first line is not that of an IONEX file",
            where=f"{file.name}:1",
            mend="name an IONEX file, such as codg0010.21i",
        )
    data = first.replace("IONEX VERSION / TYPE", "RINEX VERSION / TYPE").encode("latin-1")
    return split_lines(dataclasses.replace(file, data=data + b"\n"))


def _header(lines: Lines, count: int) -> dict[str, str]:
    return dict(split_record(lines.text(line)) for line in range(count))


def _grid(said: dict[str, str], name: str) -> tuple[Grid, float]:
    """Grid and radius of the sphere (m)."""
    try:
        axes = []
        for label in ("HGT1 / HGT2 / DHGT", "LAT1 / LAT2 / DLAT", "LON1 / LON2 / DLON"):
            first, last, step = (float(word) for word in said[label].split())
            axes.append((first, last, step))
        grid = Grid(*axes)
        if min(grid.shape[1:]) < 2:
            raise ValueError("no grid")
        return grid, float(said["BASE RADIUS"]) * _M_PER_KM
    except (KeyError, ValueError) as error:
        raise ForeignFileError(
            "the header states no grid of heights, latitudes and longitudes",
            where=f"{name}:1",
            mend=MEND,
        ) from error


def _exponent(said: dict[str, str]) -> int:
    text = said.get("EXPONENT", "").strip()
    return int(text) if text.lstrip("-").isdigit() else -1


class _Reader:
    """One pass over the maps."""

    def __init__(self, lines: Lines, start: int, grid: Grid, exponent: int) -> None:
        self.lines = lines
        self.start = start
        self.grid = grid
        self.exponent = exponent
        self.found: list[_Map] = []
        self.damaged: list[int] = []
        self.other: dict[str, int] = {}
        self.ended = False

    def run(self) -> None:
        """Every map."""
        line = self.start
        while line < len(self.lines):
            label = split_record(self.lines.text(line))[0]
            if label in _START:
                line = self._map(line, _START[label])
            elif label == "END OF FILE":
                self.ended = True
                break
            elif label.startswith("START OF"):
                self.other[label[9:]] = self.other.get(label[9:], 0) + 1
            line += 1

    def report(self, findings: Findings) -> None:
        """What was not understood."""
        name = self.lines.file.name
        findings.rows("a map cannot be read; left out", name, self.damaged, MEND)
        for what, count in self.other.items():
            findings.notes.append(f"{name}: {count} of {what} are not read")
        if not self.ended:
            findings.rows("the file has no END OF FILE; whole maps are kept", name,
                          [len(self.lines)], "fetch the file again")  # fmt: skip

    def _map(self, first: int, kind: str) -> int:
        """A map from its first line; gives its last line."""
        heights, rows, columns = self.grid.shape
        values = np.full((heights, rows, columns), np.nan)
        filled = np.zeros((heights, rows), dtype=np.bool_)
        moment, line, exponent = -1, first, self.exponent
        scale = _power(exponent)
        try:
            while True:
                line += 1
                label, text = split_record(self.lines.text(line))
                if label in _END:
                    break
                if label == "EPOCH OF CURRENT MAP":
                    parts = [int(word) for word in text.split()]
                    moment = calendar_ns(*parts[:5])
                    moment += parts[5] * time.NS_PER_S if moment >= 0 else 0
                elif label == "EXPONENT":
                    scale = _power(int(text))
                elif label == "LAT/LON1/LON2/DLON/H":
                    row, layer = self._place(text)
                    count = -(-columns // _PER_LINE)
                    rest = b"".join(
                        self.lines.raw(line + k).ljust(_PER_LINE * _WIDTH)
                        for k in range(1, count + 1)
                    )
                    numbers = [int(rest[_WIDTH * k : _WIDTH * (k + 1)]) for k in range(columns)]
                    whole = np.array(numbers, dtype=np.float64)
                    values[layer, row] = np.where(whole == _ABSENT, np.nan, whole * scale)
                    filled[layer, row] = True
                    line += count
                elif label.startswith("START OF"):
                    raise ValueError("the map has no end")
            if moment < 0 or not filled.all():
                raise ValueError("the map is not whole")
            self.found.append(_Map(kind, moment, values))
        except (ValueError, IndexError, TypeError):
            self.damaged.append(first + 1)
            return first  # the next map begins where its first line is found
        return line

    def _place(self, text: str) -> tuple[int, int]:
        """Row and layer of a line of numbers."""
        latitude, first, last, step, height = (float(text[k : k + 6]) for k in range(2, 32, 6))
        if (first, last, step) != self.grid.longitudes:
            raise ValueError("another grid")
        row = _index(latitude, self.grid.latitudes)
        return row, _index(height, self.grid.heights)


def _index(value: float, axis: tuple[float, float, float]) -> int:
    place = (value - axis[0]) / axis[2] if axis[2] else value - axis[0]
    index = round(place)
    if abs(place - index) > 1e-6 or not 0 <= index < _count(axis):
        raise ValueError("off the grid")
    return index


def _power(exponent: int) -> float:
    """Power of ten of the values' unit."""
    return 10.0**exponent if exponent >= 0 else 1.0 / 10.0**-exponent


def _columns(
    rows: list[tuple[int, int]], maps: dict[tuple[int, str], _Map], grid: Grid, radius: float
) -> Columns:
    """Rows of `replay.IonosphereMap`."""
    layers, latitudes, longitudes = grid.shape
    count = len(rows) * layers
    first, _, step = grid.heights
    heights = [(first + layer * step) * _M_PER_KM for layer in range(layers)]
    tec, rms = [], []
    for _, epoch in rows:
        tec.append(maps[epoch, "tec"].values.reshape(layers, -1))
        other = maps.get((epoch, "rms"))
        rms += [other.values[k].reshape(-1) if other else np.zeros(0) for k in range(layers)]
    ends = np.cumsum([0, *(len(part) for part in rms)]).astype(np.int64)
    return Columns.build(
        np.repeat(np.array([t for t, _ in rows], dtype=np.int64), layers),
        {
            "height_m": np.tile(np.array(heights), len(rows)),
            "base_radius_m": np.full(count, radius),
            "latitude_first_rad": np.full(count, math.radians(grid.latitudes[0])),
            "latitude_step_rad": np.full(count, math.radians(grid.latitudes[2])),
            "latitude_count": np.full(count, latitudes, dtype=np.int64),
            "longitude_first_rad": np.full(count, math.radians(grid.longitudes[0])),
            "longitude_step_rad": np.full(count, math.radians(grid.longitudes[2])),
            "longitude_count": np.full(count, longitudes, dtype=np.int64),
            "tec_tecu": Ragged.from_matrix(np.concatenate(tec)),
            "rms_tecu": Ragged(ends, np.concatenate(rms)),
        },
    )
