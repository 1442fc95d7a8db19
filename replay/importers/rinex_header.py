"""Header of a RINEX observation file."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable
from typing import Final

from replay.errors import ForeignFileError
from replay.importers.findings import Findings
from replay.importers.rinex2_codes import SYSTEMS, rinex3_types
from replay.importers.rinex_files import Lines

_LABEL_AT: Final = 60
_TYPES_AT: Final = 6
_SATELLITE: Final = re.compile(r"([A-Z])( \d|\d\d)\s*(-?\d+)")
# RINEX 3.02 calls BeiDou's B1I band 1, every other version calls it 2.
_BEIDOU_ONE_VERSION: Final = 3.02
_BEIDOU_ONE: Final = re.compile(r"^([CLDS])1([IQX])$")
_SCALES: Final = {"G": "GPS", "R": "GLO", "E": "GAL", "C": "BDT", "J": "QZS", "I": "IRN"}
MEND: Final = "fetch the file again, or correct the line"


@dataclasses.dataclass(frozen=True, slots=True)
class ObservationHeader:
    """What a RINEX observation file says about itself.

    Attributes
    ----------
    version : float
    file_type, system : str
        "O" and the letter of the satellite system, "M" for several.
    marker, marker_number : str
    receiver, antenna : tuple of str
        Number, type and, of the receiver, version.
    position_m : tuple of 3 float or None
        Approximate marker position, ECEF.
    antenna_delta_hen_m : tuple of 3 float or None
        Height, east, north of the antenna's reference point over the marker.
    time_system : str
        GPS, GLO, GAL, BDT, QZS, IRN or UTC.
    interval_s : float or None
    clock_offset_applied : bool
    glonass_channels : dict of satellite to int
    phase_shifts : tuple of str
        As they stand.
    leap_seconds : int or None
    types : dict of system letter to tuple of str
        RINEX 3 types in the order of the records; one of RINEX 2 that has no
        signal stays as it is.
    scale_factors : dict of (system, type) to int
        What stored values are to be divided by.
    records : tuple of (label, text)
        Every line, understood or not.
    """

    version: float
    file_type: str
    system: str
    marker: str = ""
    marker_number: str = ""
    receiver: tuple[str, ...] = ()
    antenna: tuple[str, ...] = ()
    position_m: tuple[float, ...] | None = None
    antenna_delta_hen_m: tuple[float, ...] | None = None
    time_system: str = "GPS"
    interval_s: float | None = None
    clock_offset_applied: bool = False
    glonass_channels: dict[str, int] = dataclasses.field(default_factory=dict)
    phase_shifts: tuple[str, ...] = ()
    leap_seconds: int | None = None
    types: dict[str, tuple[str, ...]] = dataclasses.field(default_factory=dict)
    scale_factors: dict[tuple[str, str], int] = dataclasses.field(default_factory=dict)
    records: tuple[tuple[str, str], ...] = ()


def split_record(line: str) -> tuple[str, str]:
    """Label and text of a header line."""
    return line[_LABEL_AT:].strip(), line[:_LABEL_AT].rstrip()


def read_version(lines: Lines) -> tuple[float, str, str]:
    """Version, file type and system letter.

    Raises
    ------
    ForeignFileError
        Where the first line is not that of a RINEX file.
    """
    line = lines.text(0) if len(lines) else ""
    try:
        if not split_record(line)[0].startswith("RINEX VERSION"):
            raise ValueError
        version = float(line[:9])
    except ValueError as error:
        raise ForeignFileError(
            "the first line names no RINEX version", where=f"{lines.file.name}:1", mend=MEND
        ) from error
    return version, line[20:21].strip(), line[40:41].strip()


def header_length(lines: Lines) -> int:
    """Number of lines up to END OF HEADER.

    Raises
    ------
    ForeignFileError
        Where the header has no end.
    """
    for line in range(len(lines)):
        if split_record(lines.text(line))[0] == "END OF HEADER":
            return line + 1
    raise ForeignFileError(
        "the header has no END OF HEADER",
        where=f"{lines.file.name}:{max(len(lines), 1)}",
        mend="the file is cut inside its header: fetch it again",
    )


def read_observation_header(lines: Lines, findings: Findings) -> tuple[ObservationHeader, int]:
    """Header and the number of its lines.

    Raises
    ------
    ForeignFileError
        Where the file is not RINEX 2, 3 or 4 observations, has no end of its
        header or lists no observation types.
    """
    version, file_type, system = read_version(lines)
    where = f"{lines.file.name}:1"
    if file_type != "O" or int(version) not in (2, 3, 4):
        raise ForeignFileError(
            f"RINEX {version:g} of type {file_type!r} is no observation file that is known",
            where=where,
            mend="versions 2 to 4 of type O are read",
        )
    count = header_length(lines)
    records = [split_record(lines.text(line)) for line in range(count)]
    first = ObservationHeader(
        version, file_type, system or "G", time_system=_SCALES.get(system or "G", "GPS")
    )
    damaged: list[int] = []
    header = amend_header(first, records, damaged)
    findings.rows(
        "a header line cannot be read; left out",
        lines.file.name,
        [number + 1 for number in damaged],
        MEND,
    )
    if not header.types:
        raise ForeignFileError("the header lists no observation types", where=where, mend=MEND)
    return header, count


def amend_header(
    header: ObservationHeader, records: Iterable[tuple[str, str]], damaged: list[int]
) -> ObservationHeader:
    """A header after further lines, as those of an event in the file's body.

    Parameters
    ----------
    header : ObservationHeader
    records : iterable of (label, text)
    damaged : list of int
        Indices of records that cannot be read are appended.
    """
    records = list(records)
    changes: dict[str, object] = {}
    channels = dict(header.glonass_channels)
    shifts: list[str] = []
    for index, (label, text) in enumerate(records):
        try:
            _simple(label, text, changes)
            if label == "GLONASS SLOT / FRQ #":
                for system, number, channel in _SATELLITE.findall(text[4:]):
                    channels[f"{system}{int(number):02d}"] = int(channel)
            elif label == "SYS / PHASE SHIFT":
                shifts.append(text)
        except (ValueError, IndexError):
            damaged.append(index)
    types = _types(header, records, damaged)
    changes["glonass_channels"] = channels
    changes["types"] = {**header.types, **types}
    changes["scale_factors"] = {**header.scale_factors, **_scale_factors(records, types, damaged)}
    changes["phase_shifts"] = (*header.phase_shifts, *shifts)
    changes["records"] = (*header.records, *records)
    return dataclasses.replace(header, **changes)  # type: ignore[arg-type]


def _simple(label: str, text: str, changes: dict[str, object]) -> None:
    """Fields that one line gives."""
    if label == "MARKER NAME":
        changes["marker"] = text.strip()
    elif label == "MARKER NUMBER":
        changes["marker_number"] = text[:20].strip()
    elif label == "REC # / TYPE / VERS":
        changes["receiver"] = tuple(text[at : at + 20].strip() for at in (0, 20, 40))
    elif label == "ANT # / TYPE":
        changes["antenna"] = tuple(text[at : at + 20].strip() for at in (0, 20))
    elif label == "APPROX POSITION XYZ":
        changes["position_m"] = _three(text)
    elif label == "ANTENNA: DELTA H/E/N":
        changes["antenna_delta_hen_m"] = _three(text)
    elif label == "INTERVAL":
        changes["interval_s"] = float(text[:10])
    elif label == "RCV CLOCK OFFS APPL":
        changes["clock_offset_applied"] = int(text[:6]) == 1
    elif label == "LEAP SECONDS":
        changes["leap_seconds"] = int(text[:6])
    elif label == "TIME OF FIRST OBS" and text[48:51].strip():
        changes["time_system"] = text[48:51].strip()


def _three(text: str) -> tuple[float, ...]:
    return tuple(float(text[at : at + 14]) for at in (0, 14, 28))


def _types(
    header: ObservationHeader, records: list[tuple[str, str]], damaged: list[int]
) -> dict[str, tuple[str, ...]]:
    """Observation types of every system that the records name."""
    two = header.version < 3.0
    wanted = "# / TYPES OF OBSERV" if two else "SYS / # / OBS TYPES"
    found: dict[str, list[str]] = {}
    announced: dict[str, int] = {}
    last: dict[str, int] = {}
    system = ""
    for index, (label, text) in enumerate(records):
        if label != wanted:
            continue
        number = text[:6] if two else text[3:6]
        try:
            if number.strip():
                system = "" if two else text[0]
                announced[system] = int(number)
                found[system] = []
            found[system] += text[_TYPES_AT:].split()
            last[system] = index
        except (ValueError, IndexError, KeyError):
            damaged.append(index)
    for key, names in list(found.items()):
        if len(names) != announced[key]:
            damaged.append(last[key])
            del found[key]
    if two:
        names = found.get("", [])
        return {letter: rinex3_types(letter, names) for letter in SYSTEMS} if names else {}
    if "C" in found and round(header.version, 2) == _BEIDOU_ONE_VERSION:
        found["C"] = [_BEIDOU_ONE.sub(r"\g<1>2\2", name) for name in found["C"]]
    return {key: tuple(names) for key, names in found.items()}


def _scale_factors(
    records: list[tuple[str, str]], types: dict[str, tuple[str, ...]], damaged: list[int]
) -> dict[tuple[str, str], int]:
    factors: dict[tuple[str, str], int] = {}
    system, factor = "", 1
    for index, (label, text) in enumerate(records):
        if label != "SYS / SCALE FACTOR":
            continue
        try:
            if text[:1].strip():
                system, factor = text[0], int(text[2:6])
            names = text[10:].split() or list(types.get(system, ()))
            if factor < 1:
                raise ValueError
            factors.update({(system, name): factor for name in names})
        except ValueError:
            damaged.append(index)
    return factors
