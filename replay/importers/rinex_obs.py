"""RINEX observations, versions 2.11 to 4, as rows of `replay.GnssObservation`.

One row holds what one signal of one satellite gave at one epoch. What RINEX says
is absent is absent here: a blank field, and a value of 0.0 ("missing observations
are written as 0.0 or blanks", RINEX 3.05, 6.7). Zeros are counted in a note. The
loss-of-lock digit is the carrier phase's and is present where one is written,
0 included; the strength digit is the phase's, else the code's, and 0 means
unknown there.
"""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.rinex_epochs import Epochs, Event, walk_epochs
from replay.importers.rinex_files import Int64, Lines, split_lines, unpack
from replay.importers.rinex_header import MEND, ObservationHeader, read_observation_header
from replay.kernels.text_numbers import KIND_OTHER, parse_observations
from replay.log.columns import Columns

_KINDS: Final = "CLDS"
_FIELDS: Final = ("pseudorange_m", "carrier_phase_cycles", "doppler_hz", "cn0_dbhz")
_UNBOUNDED: Final = 1 << 30
_NO_CHANNEL: Final = -99
_MIXED: Final = "M"

Float64 = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RinexObservations:
    """A RINEX observation file.

    Attributes
    ----------
    header : ObservationHeader
        As it stands at the head of the file.
    columns : Columns
        Fields of `replay.GnssObservation`, sorted by time, satellite, signal.
        The valid time is the epoch in GPS time.
    epoch_ns : int64 array (n,)
        Of each epoch of observations, in the order of the file.
    epoch_flags : int64 array (n,)
        0, or 1 after a power failure.
    clock_offsets_s : float64 array (n,)
        Of the receiver, NaN where absent.
    epoch_lines : int64 array (n,)
        From 1.
    satellite_counts : int64 array (n,)
        As each epoch's line states it.
    events : tuple of Event
    later_headers : tuple of ObservationHeader
        What events made of the header.
    """

    header: ObservationHeader
    columns: Columns
    epoch_ns: Int64
    epoch_flags: Int64
    clock_offsets_s: Float64
    epoch_lines: Int64
    satellite_counts: Int64
    events: tuple[Event, ...]
    later_headers: tuple[ObservationHeader, ...]


@dataclasses.dataclass(slots=True)
class _Layouts:
    """What each field of each system's record is, header after header.

    Attributes
    ----------
    number : dict of (header number, system) to int
    starts, kinds, slots, scales : list
        As :func:`parse_observations` takes them.
    names : list of (system, type)
        Of each field.
    signals : list of list of str
        Of each layout, sorted.
    """

    number: dict[tuple[int, str], int] = dataclasses.field(default_factory=dict)
    starts: list[int] = dataclasses.field(default_factory=lambda: [0])
    kinds: list[int] = dataclasses.field(default_factory=list)
    slots: list[int] = dataclasses.field(default_factory=list)
    scales: list[float] = dataclasses.field(default_factory=list)
    names: list[tuple[str, str]] = dataclasses.field(default_factory=list)
    signals: list[list[str]] = dataclasses.field(default_factory=list)

    def add(self, index: int, system: str, header: ObservationHeader) -> None:
        """Fields of one system under one header."""
        types = header.types[system]
        known = [t for t in types if len(t) == 3 and t[0] in _KINDS]
        signals = sorted({t[1:] for t in known}) or ["??"]
        self.number[index, system] = len(self.signals)
        self.signals.append(signals)
        taken: set[str] = set()
        for name in types:
            usable = name in known and name not in taken
            taken.add(name)
            self.kinds.append(_KINDS.index(name[0]) if usable else KIND_OTHER)
            self.slots.append(signals.index(name[1:]) if usable else 0)
            self.scales.append(float(header.scale_factors.get((system, name), 1)))
            self.names.append((system, name))
        self.starts.append(len(self.kinds))


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Satellites:
    """One record of one satellite each, sorted by time and satellite."""

    times_ns: Int64
    names: npt.NDArray[np.bytes_]
    lines: Int64
    layouts: Int64


def read_rinex_obs(file: File, findings: Findings) -> RinexObservations:
    """A RINEX observation file, plain or packed.

    Parameters
    ----------
    file : File
        As :func:`replay.importers.files.read_file` gives it.
    findings : Findings
        Damage, and values that have no field, are counted here.

    Raises
    ------
    ForeignFileError
        Where the header cannot be read, or the first loss where `findings` is strict.
    """
    file = unpack(file, findings)
    lines = split_lines(file)
    header, start = read_observation_header(lines, findings)
    epochs = walk_epochs(lines, start, header, findings)
    layouts = _Layouts()
    for index, one in enumerate(epochs.headers):
        for system in one.types:
            layouts.add(index, system, one)
    satellites = _satellites(lines, epochs, layouts, findings)
    columns = _parse(lines, header, epochs, layouts, satellites, findings)
    return RinexObservations(
        header,
        columns,
        np.array(epochs.times_ns, dtype=np.int64),
        np.array(epochs.flags, dtype=np.int64),
        np.array(epochs.clock_offsets_s, dtype=np.float64),
        np.array(epochs.lines, dtype=np.int64),
        np.array(epochs.satellite_counts, dtype=np.int64),
        tuple(epochs.events),
        tuple(epochs.headers[1:]),
    )


def _satellites(lines: Lines, epochs: Epochs, layouts: _Layouts, findings: Findings) -> _Satellites:
    """Satellites whose numbers can be read, each once per epoch."""
    name, header = lines.file.name, epochs.headers[0]
    at = np.array(epochs.satellite_positions, dtype=np.int64)
    first = np.array(epochs.satellite_lines, dtype=np.int64)
    counts = np.array(epochs.satellite_counts, dtype=np.int64)
    times = np.repeat(np.array(epochs.times_ns, dtype=np.int64), counts)
    headers = np.repeat(np.array(epochs.header_numbers, dtype=np.int64), counts)

    padded = np.append(lines.data, np.full(3, ord("\n"), dtype=np.uint8))
    letters = padded[at[:, None] + np.arange(3)]
    alone = "G" if header.system == _MIXED else header.system
    if header.version < 3.0:
        letters[letters[:, 0] == ord(" "), 0] = ord(alone)
    letters[letters[:, 1] == ord(" "), 1] = ord("0")
    digits = (letters[:, 1:] >= ord("0")) & (letters[:, 1:] <= ord("9"))
    table = np.full((len(epochs.headers), 256), -1, dtype=np.int64)
    for (index, system), layout in layouts.number.items():
        table[index, ord(system)] = layout
    layout_of = table[headers, letters[:, 0]]
    readable = digits.all(axis=1) & (layout_of >= 0)
    what = "a satellite's number or system is unknown; its record skipped"
    findings.rows(what, name, np.sort(first[~readable]) + 1, MEND)

    names = np.ascontiguousarray(letters).view("S3").reshape(-1)
    keep = np.flatnonzero(readable)
    if not _sorted(times[keep], names[keep]):
        keep = keep[np.lexsort((names[keep], times[keep]))]
    twice = np.zeros(len(keep), dtype=np.bool_)
    twice[1:] = (times[keep][1:] == times[keep][:-1]) & (names[keep][1:] == names[keep][:-1])
    what = "a satellite stands twice in an epoch; the first record kept"
    findings.rows(what, name, np.sort(first[keep[twice]]) + 1, MEND)
    keep = keep[~twice]
    return _Satellites(times[keep], names[keep], first[keep], layout_of[keep])


def _sorted(times: Int64, names: npt.NDArray[np.bytes_]) -> bool:
    step = np.diff(times)
    return bool(((step > 0) | ((step == 0) & (names[1:] >= names[:-1]))).all())


def _parse(
    lines: Lines,
    header: ObservationHeader,
    epochs: Epochs,
    layouts: _Layouts,
    satellites: _Satellites,
    findings: Findings,
) -> Columns:
    """Rows of every signal that has anything."""
    two = header.version < 3.0
    width = np.array([len(signals) for signals in layouts.signals], dtype=np.int64)
    per_satellite = width[satellites.layouts]
    ends = np.cumsum(per_satellite)
    total = int(ends[-1]) if len(ends) else 0
    values = np.full((total, len(_FIELDS)), np.nan)
    present = np.zeros((total, len(_FIELDS)), dtype=np.bool_)
    loss_of_lock = np.full(total, -1, dtype=np.int8)
    strength = np.full(total, -1, dtype=np.int8)
    others = np.zeros(len(layouts.kinds), dtype=np.int64)
    damaged = np.full(len(satellites.lines), -1, dtype=np.int64)
    counts = parse_observations(
        lines.data,
        lines.starts,
        lines.ends,
        satellites.lines,
        satellites.layouts,
        ends - per_satellite,
        np.array(layouts.starts, dtype=np.int64),
        np.array(layouts.kinds, dtype=np.int64),
        np.array(layouts.slots, dtype=np.int64),
        np.array(layouts.scales, dtype=np.float64),
        5 if two else _UNBOUNDED,
        0 if two else 3,
        values,
        present,
        loss_of_lock,
        strength,
        others,
        damaged,
    )
    _report(lines.file.name, layouts, others, damaged, counts, findings)

    keep = np.flatnonzero(present.any(axis=1) | (loss_of_lock >= 0) | (strength >= 0))
    owner = np.repeat(np.arange(len(satellites.lines)), per_satellite)[keep]
    flat = [signal for signals in layouts.signals for signal in signals]
    slot = keep - (ends - per_satellite)[owner]
    layout_start = np.cumsum(width) - width
    number = layout_start[satellites.layouts[owner]] + slot
    signals = np.array(flat, dtype="S2")[number]
    names = satellites.names[owner]
    columns = {"satellite": names, "signal": signals}
    masks = {}
    fields: dict[str, npt.NDArray[np.generic]] = {}
    for index, field in enumerate(_FIELDS):
        fields[field] = np.ascontiguousarray(values[keep, index])
        masks[field] = np.ascontiguousarray(present[keep, index])
    for field, digits in (("loss_of_lock", loss_of_lock), ("signal_strength", strength)):
        masks[field] = digits[keep] >= 0
        fields[field] = np.where(masks[field], digits[keep], 0).astype(np.uint32)
    channels = _channels(names, epochs)
    masks["glonass_channel"] = channels != _NO_CHANNEL
    fields["glonass_channel"] = np.where(masks["glonass_channel"], channels, 0).astype(np.int32)
    return Columns.build(satellites.times_ns[owner], {**columns, **fields}, present=masks)


def _channels(names: npt.NDArray[np.bytes_], epochs: Epochs) -> npt.NDArray[np.int64]:
    """GLONASS frequency number of each row."""
    table = np.full(100, _NO_CHANNEL, dtype=np.int64)
    for satellite, channel in epochs.headers[-1].glonass_channels.items():
        if satellite[0] == "R":
            table[int(satellite[1:])] = channel
    letters = np.ascontiguousarray(names).view(np.uint8).reshape(-1, 3).astype(np.int64)
    number = (letters[:, 1] - ord("0")) * 10 + letters[:, 2] - ord("0")
    return np.where(letters[:, 0] == ord("R"), table[number], _NO_CHANNEL)


def _report(
    name: str,
    layouts: _Layouts,
    others: Int64,
    damaged: Int64,
    counts: tuple[int, int, int],
    findings: Findings,
) -> None:
    what = "a field is no number; that value left out"
    findings.rows(what, name, np.sort(damaged[damaged >= 0]) + 1, MEND)
    lost: dict[tuple[str, str], int] = {}
    for key, count in zip(layouts.names, others.tolist(), strict=True):
        lost[key] = lost.get(key, 0) + count
    for (system, kind), count in lost.items():
        if count:
            what = f"observations of type {kind} of system {system} have no field"
            findings.loss(what, name, count, "values", "leave the type out when converting")
    zeros, stray, differing = counts
    for count, what in (
        (zeros, "values of 0.0 are absent, as RINEX says"),
        (stray, "loss-of-lock digits beside no carrier phase were left out"),
        (differing, "code strength digits differ from the carrier's, which is kept"),
    ):
        if count:
            findings.notes.append(f"{name}: {count} {what}")
