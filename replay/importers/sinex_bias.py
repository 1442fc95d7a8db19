"""SINEX-BIAS files, version 1.00: biases of signals, absolute (OSB) or differential (DSB).

Schaer, "SINEX_BIAS - Solution (Software/technique) INdependent EXchange Format for GNSS
BIASes, Version 1.00", 2016.
"""

from __future__ import annotations

import dataclasses
import datetime
import math
import re
from typing import Final

import numpy as np

from replay import channels, time
from replay.errors import ForeignFileError
from replay.gnss.signals import frequency_hz
from replay.importers.antex_streams import Known
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.product_files import (
    UNKNOWN_NS,
    About,
    off_time,
    product_row,
    time_system,
    to_gps,
)
from replay.importers.rinex_files import Lines, split_lines, unpack
from replay.importers.rinex_header import MEND
from replay.importers.spec import Stream
from replay.log.columns import Columns, Ragged
from replay.schemas import products_pb2

_KINDS: Final = {
    "OSB": products_pb2.BIAS_KIND_OSB,
    "DSB": products_pb2.BIAS_KIND_DSB,
    "ISB": products_pb2.BIAS_KIND_ISB,
}
_S_PER_NS: Final = 1e-9
_OBSERVATION: Final = re.compile(r"[CL]\d[A-Z]?")
_SATELLITE: Final = re.compile(r"[GRECJIS]\d\d")
_MOMENT: Final = re.compile(r"(\d{4}):(\d{3}):(\d{5})")
_OPEN: Final = "0000:000:00000"


@dataclasses.dataclass(frozen=True, slots=True)
class Bias:
    """A row; as `replay.SignalBias`."""

    satellite: str
    station: str
    system: str
    kind: int
    first: str
    second: str
    value_s: float
    std_s: float | None
    slope_s_s: float | None
    valid_ns: tuple[int, int]


class _CyclesError(ValueError):
    """A value in cycles of a frequency that is not known."""


def sinex_bias_stream(
    file: File, findings: Findings, stream: Stream, known: Known
) -> dict[str, Columns]:
    """Biases in the order of the file.

    Raises
    ------
    ForeignFileError
        Where it is no SINEX-BIAS file of version 1.
    """
    del stream
    file = unpack(file, findings)
    lines = split_lines(file)
    head = lines.text(0) if len(lines) else ""
    if not head.startswith("%=BIA 1."):
        raise ForeignFileError(
            "the first line is not that of a SINEX-BIAS file of version 1",
            where=f"{file.name}:1",
            mend="name a file that begins with %=BIA 1.00",
        )
    said = _description(lines)
    scale = time_system(said.get("TIME_SYSTEM", [""])[0], f"{file.name}:1")
    biases, damaged, cycles, closed = _rows(lines, scale)
    findings.rows("a bias cannot be read; skipped", file.name, damaged, MEND)
    what = "a bias in cycles is of a frequency that depends on the channel; skipped"
    findings.rows(what, file.name, cycles, "take a file in nanoseconds")
    if not closed:
        findings.rows("the file has no end mark %=ENDBIA; what is whole is kept", file.name,
                      [len(lines)], "fetch the file again")  # fmt: skip
    within = [bias for bias in biases if _overlaps(bias.valid_ns, known.span_ns)]
    if not biases:
        return {}
    if not within:
        raise off_time(file.name, np.array([t for bias in biases for t in bias.valid_ns]))
    if len(within) < len(biases):
        findings.notes.append(
            f"{file.name}: {len(biases) - len(within)} of {len(biases)} biases are valid at no "
            "time of the log and are left out"
        )
    references = said.get("SATELLITE_CLOCK_REFERENCE_OBSERVABLES", [])
    about = About(
        source=file.name.rpartition("/")[2],
        format="sinex-bias",
        version=head[6:10].strip(),
        agency=head[11:14].strip(),
        time_system=scale,
        kind=said.get("BIAS_MODE", [""])[0],
        detail="; ".join(
            ["clocks refer to " + " ".join(one.split()) for one in references if one[1:].strip()]
        ),
    )
    ends = {t for bias in biases for t in bias.valid_ns if t}
    found = product_row(about, np.array(sorted(ends), dtype=np.int64), len(within))
    found[channels.SIGNAL_BIAS.topic] = bias_columns(within)
    return found


def _overlaps(valid_ns: tuple[int, int], span_ns: tuple[int, int] | None) -> bool:
    if span_ns is None:
        return True
    return valid_ns[0] <= span_ns[1] and not 0 < valid_ns[1] < span_ns[0]


def _description(lines: Lines) -> dict[str, list[str]]:
    """Values of BIAS/DESCRIPTION by keyword."""
    said: dict[str, list[str]] = {}
    inside = False
    for line in range(len(lines)):
        raw = lines.raw(line)
        if raw.startswith(b"+BIAS/"):
            inside = raw.startswith(b"+BIAS/DESCRIPTION")
        elif raw.startswith(b"-BIAS/DESCRIPTION"):
            break
        elif inside and raw.startswith(b" "):
            keyword, _, value = raw.decode("latin-1").strip().partition(" ")
            said.setdefault(keyword, []).append(value.strip())
    return said


def _rows(lines: Lines, scale: str) -> tuple[list[Bias], list[int], list[int], bool]:
    """Biases, lines that are damaged or in cycles, and whether the end mark is there."""
    biases: list[Bias] = []
    damaged: list[int] = []
    cycles: list[int] = []
    inside = closed = False
    moments: dict[str, int] = {_OPEN: 0}
    for line in range(len(lines)):
        raw = lines.raw(line)
        if raw.startswith((b"+BIAS/SOLUTION", b"-BIAS/SOLUTION")):
            inside = raw.startswith(b"+")
        elif raw.startswith(b"%=END"):
            closed = True
        elif inside and raw.strip() and not raw.startswith(b"*"):
            try:
                biases.append(_bias(raw.decode("latin-1"), scale, moments))
            except _CyclesError:
                cycles.append(line + 1)
            except ValueError:
                damaged.append(line + 1)
    return biases, damaged, cycles, closed


def _bias(row: str, scale: str, moments: dict[str, int]) -> Bias:
    """A line by its columns.

    Raises
    ------
    ValueError
        Where it cannot be read.
    """
    kind, prn, station = _KINDS.get(row[1:5].strip(), 0), row[11:14].strip(), row[15:24].strip()
    first, second = row[25:29].strip(), row[30:34].strip()
    satellite = prn if _SATELLITE.fullmatch(prn) else ""
    if not kind or prn[:1] not in ("G", "R", "E", "C", "J", "I", "S"):
        raise ValueError("no bias")
    if not satellite and (len(prn) > 1 or not station):
        raise ValueError("neither satellite nor station")
    if not _OBSERVATION.fullmatch(first):
        raise ValueError("no observation")
    if kind != products_pb2.BIAS_KIND_OSB and not _OBSERVATION.fullmatch(second):
        raise ValueError("no second observation")
    valid = []
    for text in (row[35:49], row[50:64]):
        if text not in moments:
            moments[text] = _moment(text, scale)
        valid.append(moments[text])
    unit = row[65:69].strip()
    numbers = [_number(row[a:b]) for a, b in ((70, 91), (92, 103), (104, 125))]
    if unit == "cyc":
        factor = 1.0 / _frequency(prn[0], first)
    elif unit == "ns":
        factor = _S_PER_NS
    else:
        raise ValueError("no unit")
    value, std, slope = (None if n is None else factor * n for n in numbers)
    if value is None:
        raise ValueError("no value")
    return Bias(
        satellite, station, prn[0], kind, first, second, value, std, slope, (valid[0], valid[1])
    )


def _frequency(system: str, observation: str) -> float:
    if system == "R" and observation[1] in "12":
        raise _CyclesError
    try:
        return frequency_hz(system, int(observation[1]))
    except KeyError as error:
        raise ValueError("no frequency") from error


def _number(text: str) -> float | None:
    if not text.strip():
        return None
    value = float(text)
    if not math.isfinite(value):
        raise ValueError("no number")
    return value


def _moment(text: str, scale: str) -> int:
    """Year, day of the year and seconds to GPS nanoseconds."""
    match = _MOMENT.fullmatch(text)
    if match is None:
        raise ValueError("no time")
    days = datetime.timedelta(days=int(match[2]) - 1)
    day = time.from_calendar(datetime.datetime(int(match[1]), 1, 1) + days)
    calendar = np.array([day + int(match[3]) * time.NS_PER_S], dtype=np.int64)
    return int(to_gps(calendar, scale)[0])


def bias_columns(biases: list[Bias]) -> Columns:
    """Rows of `replay.SignalBias`; the valid time is the start of each one's validity."""
    starts = [bias.valid_ns[0] or UNKNOWN_NS for bias in biases]
    std = np.array([np.nan if b.std_s is None else b.std_s for b in biases])
    slope = np.array([np.nan if b.slope_s_s is None else b.slope_s_s for b in biases])
    satellites = np.array([b.satellite for b in biases], dtype="S3")
    return Columns.build(
        np.array(starts, dtype=np.int64),
        {
            "satellite": satellites,
            "station": Ragged.from_texts([b.station for b in biases]),
            "system": Ragged.from_texts([b.system for b in biases]),
            "kind": np.array([b.kind for b in biases], dtype=np.int64),
            "observation": Ragged.from_texts([b.first for b in biases]),
            "second_observation": Ragged.from_texts([b.second for b in biases]),
            "value_s": np.array([b.value_s for b in biases]),
            "value_std_s": std,
            "slope_s_s": slope,
            "valid_from_ns": np.array([b.valid_ns[0] for b in biases], dtype=np.int64),
            "valid_until_ns": np.array([b.valid_ns[1] for b in biases], dtype=np.int64),
        },
        present={
            "satellite": satellites != b"",
            "value_std_s": np.isfinite(std),
            "slope_s_s": np.isfinite(slope),
        },
    )
