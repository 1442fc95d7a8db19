"""RINEX files as channels: observations with what their header and events say, navigation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from replay import channels
from replay.gnss.ephemerides import ephemeris_columns
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.rinex_epochs import FLAG_CYCLE_SLIPS
from replay.importers.rinex_files import Int64, split_lines, unpack
from replay.importers.rinex_header import MEND, ObservationHeader, header_length
from replay.importers.rinex_nav import RinexNavigation, read_rinex_nav
from replay.importers.rinex_obs import RinexObservations, read_rinex_obs
from replay.importers.spec import Stream
from replay.log.columns import Columns, Ragged
from replay.schemas import navigation_pb2

UNKNOWN_NS: Final = -1
"""Time of a row whose time no file tells: it gets that of the log's start."""

_ALPHA, _BETA = "A", "B"
_KLOBUCHAR_NUMBERS: Final = 4
_MODELS: Final = {
    "GPS": ("G", navigation_pb2.IONOSPHERE_MODEL_KLOBUCHAR),
    "QZS": ("J", navigation_pb2.IONOSPHERE_MODEL_KLOBUCHAR),
    "IRN": ("I", navigation_pb2.IONOSPHERE_MODEL_KLOBUCHAR),
    "BDS": ("C", navigation_pb2.IONOSPHERE_MODEL_BEIDOU),
}
_GALILEO: Final = ("E", navigation_pb2.IONOSPHERE_MODEL_NEQUICK)


def rinex_obs_stream(file: File, findings: Findings, stream: Stream) -> dict[str, Columns]:
    """Observations, epochs and what is known of the receiver.

    The receiver's row of the header stands at the first epoch. Each event in the file
    that brings lines gives a row more, and an epoch of its flag without satellites; an
    event without a time stands at the last epoch before it.
    """
    file = unpack(file, findings)
    read = read_rinex_obs(file, findings)
    parts = {"receiver": stream.receiver}
    found = {channels.RECEIVER.at(**parts): _receivers(file, findings, stream, read)}
    epochs = _epochs(read)
    if len(epochs):
        found[channels.RECEIVER_EPOCH.at(**parts)] = epochs
    if len(read.columns):
        found[channels.GNSS_OBS.at(**parts)] = read.columns
    late = np.flatnonzero(read.epoch_ns < np.maximum.accumulate(read.epoch_ns))
    what = "time goes backward; epochs were put in order"
    findings.rows(what, file.name, read.epoch_lines[late], MEND)
    return found


def _event_times(read: RinexObservations) -> list[int]:
    times = []
    for event in read.events:
        before = int(np.searchsorted(read.epoch_lines, event.line)) - 1
        last = int(read.epoch_ns[max(before, 0)]) if len(read.epoch_ns) else UNKNOWN_NS
        times.append(last if event.valid_time_ns is None else event.valid_time_ns)
    return times


def _receivers(file: File, findings: Findings, stream: Stream, read: RinexObservations) -> Columns:
    first = int(read.epoch_ns.min()) if len(read.epoch_ns) else UNKNOWN_NS
    lines = split_lines(file)
    end = int(lines.starts[header_length(lines)]) if len(lines) > header_length(lines) else None
    headers, texts, times = [read.header], [file.data[:end]], [first]
    later = iter(read.later_headers)
    for event, moment in zip(read.events, _event_times(read), strict=True):
        # Lines of a cycle-slip event are observations, which leave the header as it is.
        headers.append(headers[-1] if event.flag == FLAG_CYCLE_SLIPS else next(later))
        texts.append(event.text.encode("latin-1"))
        times.append(moment)
    positions = [header.position_m for header in headers]
    if stream.position_ecef_m:
        stated = "none" if positions[0] is None else f"({', '.join(map(repr, positions[0]))}) m"
        findings.notes.append(
            f"{file.name}: the position {tuple(stream.position_ecef_m)} m of the spec stands in "
            f"for that of the header, {stated}"
        )
        positions = [stream.position_ecef_m] * len(headers)
    return receiver_columns(times, headers, positions, texts)


def receiver_columns(
    times: Sequence[int],
    headers: Sequence[ObservationHeader],
    positions: Sequence[Sequence[float] | None],
    texts: Sequence[bytes],
) -> Columns:
    """Rows of `replay.ReceiverInfo`."""
    order = np.argsort(np.array(times, dtype=np.int64), kind="stable")
    # Height, east, north of the file are east, north, up of the channel.
    offsets = [
        None if h.antenna_delta_hen_m is None else [h.antenna_delta_hen_m[k] for k in (1, 2, 0)]
        for h in headers
    ]
    intervals = [None if h.interval_s is None else [h.interval_s] for h in headers]
    position, has_position = _optional(positions, 3)
    offset, has_offset = _optional(offsets, 3)
    interval, has_interval = _optional(intervals, 1)
    return Columns.build(
        np.array(times, dtype=np.int64),
        {
            "marker": Ragged.from_texts([h.marker for h in headers]),
            "receiver": Ragged.from_texts([h.receiver[1] if h.receiver else "" for h in headers]),
            "antenna": Ragged.from_texts([h.antenna[1] if h.antenna else "" for h in headers]),
            "approximate_position_ecef_m": position,
            "antenna_offset_enu_m": offset,
            "interval_s": interval[:, 0],
            "header": Ragged.from_blobs(texts),
        },
        present={
            "approximate_position_ecef_m": has_position,
            "antenna_offset_enu_m": has_offset,
            "interval_s": has_interval,
        },
    ).take(order.astype(np.int64))


def _optional(
    rows: Sequence[Sequence[float] | None], width: int
) -> tuple[np.typing.NDArray[np.float64], np.typing.NDArray[np.bool_]]:
    values = np.full((len(rows), width), np.nan)
    for row, numbers in enumerate(rows):
        if numbers is not None:
            values[row] = numbers
    return values, np.array([numbers is not None for numbers in rows], dtype=np.bool_)


def _epochs(read: RinexObservations) -> Columns:
    events = _event_times(read)
    times = np.concatenate([read.epoch_ns, np.array(events, dtype=np.int64)])
    flags = [*read.epoch_flags.tolist(), *(event.flag for event in read.events)]
    none: Int64 = np.zeros(len(events), dtype=np.int64)
    offsets = np.concatenate([read.clock_offsets_s, np.full(len(events), np.nan)])
    columns = Columns.build(
        times,
        {
            "flag": np.array(flags, dtype=np.uint32),
            "satellite_count": np.concatenate([read.satellite_counts, none]).astype(np.uint32),
            "clock_offset_s": offsets,
        },
        present={"clock_offset_s": np.isfinite(offsets)},
    )
    return columns.take(np.argsort(times, kind="stable").astype(np.int64))


def rinex_nav_stream(file: File, findings: Findings, stream: Stream) -> dict[str, Columns]:
    """Ephemerides, ionosphere and time corrections.

    The log time is when each message was sent. A file does not say that of its
    ionosphere and time corrections: they are known from the file's first ephemeris
    and their valid time is unknown.
    """
    read = read_rinex_nav(file, findings)
    found = {}
    ephemerides = ephemeris_columns(read.ephemerides)
    first = UNKNOWN_NS
    if len(ephemerides):
        found[channels.NAV.topic] = ephemerides
        first = int(ephemerides.valid_time_ns.min())
    ionosphere = _ionosphere(file, findings, read, first)
    if len(ionosphere):
        found[channels.NAV_IONOSPHERE.topic] = ionosphere
    if read.time_corrections:
        found[channels.NAV_TIME.topic] = _corrections(read, first)
    return found


def _ionosphere(file: File, findings: Findings, read: RinexNavigation, time_ns: int) -> Columns:
    rows: list[tuple[str, int, tuple[float, ...]]] = []
    taken = set()
    for prefix, (system, model) in _MODELS.items():
        alpha, beta = (read.ionosphere.get(prefix + letter) for letter in (_ALPHA, _BETA))
        if alpha is not None and beta is not None:
            rows.append((system, model, (*alpha, *beta)))
            taken |= {prefix + _ALPHA, prefix + _BETA}
    if "GAL" in read.ionosphere:
        rows.append((*_GALILEO, read.ionosphere["GAL"]))
        taken.add("GAL")
    for label in sorted(read.ionosphere.keys() - taken):
        what = f"ionosphere coefficients {label} lack their other half or are of no known model"
        findings.loss(what, file.name, len(read.ionosphere[label]), "values", MEND)
    return Columns.build(
        np.full(len(rows), UNKNOWN_NS),
        {
            "system": Ragged.from_texts([system for system, _, _ in rows]),
            "model": np.array([model for _, model, _ in rows], dtype=np.int64),
            "coefficients": Ragged(
                np.cumsum([0, *(len(numbers) for _, _, numbers in rows)]).astype(np.int64),
                np.array([n for _, _, numbers in rows for n in numbers], dtype=np.float64),
            ),
        },
        log_time_ns=np.full(len(rows), time_ns),
    )


def _corrections(read: RinexNavigation, time_ns: int) -> Columns:
    scales = sorted(read.time_corrections)
    rows = [read.time_corrections[scale] for scale in scales]
    return Columns.build(
        np.full(len(rows), UNKNOWN_NS),
        {
            "scales": Ragged.from_texts(scales),
            "a0_s": np.array([row.a0_s for row in rows]),
            "a1": np.array([row.a1 for row in rows]),
            "reference_s": np.array([float(row.reference_s) for row in rows]),
            "week": np.array([row.week for row in rows], dtype=np.int64),
        },
        log_time_ns=np.full(len(rows), time_ns),
    )
