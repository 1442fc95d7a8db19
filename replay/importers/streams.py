"""Streams: files that have times of their own and give several channels at once.

To add a format, write a function that takes a file's bytes, the findings and the
spec's table and gives columns by topic, each in the order of its log times, and name
it in :data:`FORMATS`. Rows of several files are joined here. A format that must know
what the others gave is read after them.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Iterable, Mapping
from typing import Final, Literal

import numpy as np

from replay import channels, time
from replay.errors import ConfigurationError, ForeignFileError
from replay.importers import receiver_streams
from replay.importers.antex_streams import Known, antex_stream
from replay.importers.corrected_ranges import corrected_ranges_stream
from replay.importers.earth_rotation import earth_rotation_stream
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.ionex import ionex_stream
from replay.importers.log_streams import FORMAT as LOG
from replay.importers.log_streams import log_stream
from replay.importers.ocean_loading import ocean_loading_stream
from replay.importers.product_joins import SERIES, check_frames, join_series
from replay.importers.rinex_clock import rinex_clock_stream
from replay.importers.rinex_streams import UNKNOWN_NS, rinex_nav_stream, rinex_obs_stream
from replay.importers.sinex_bias import sinex_bias_stream
from replay.importers.sp3 import sp3_stream
from replay.importers.spec import Spec, Stream
from replay.log.codec import codec_for
from replay.log.columns import Columns, Int64, concatenate

Reader = Callable[[File, Findings, Stream], Mapping[str, Columns]]
LateReader = Callable[[File, Findings, Stream, Known], Mapping[str, Columns]]


@dataclasses.dataclass(frozen=True, slots=True)
class Format:
    """A kind of file.

    Attributes
    ----------
    read : function
        File, findings and stream to columns by topic. A time of -1 is unknown.
        None for one that is read late.
    available : str
        When a navigation message is known where the spec does not say.
    read_late : function
        As `read`, after all other streams, given what they tell.
    """

    read: Reader | None
    available: Literal["start", "transmitted"] = "transmitted"
    read_late: LateReader | None = None


FORMATS: Final[dict[str, Format]] = {
    LOG: Format(log_stream),
    "rinex-obs": Format(rinex_obs_stream),
    "rinex-nav": Format(rinex_nav_stream, available="start"),
    "corrected-ranges-mat": Format(corrected_ranges_stream),
    "ubx": Format(receiver_streams.ubx_stream),
    "rtcm3": Format(receiver_streams.rtcm_stream),
    "sbf": Format(receiver_streams.sbf_stream),
    "novatel": Format(receiver_streams.novatel_stream),
    "nmea": Format(receiver_streams.nmea_stream),
    "antex": Format(None, available="start", read_late=antex_stream),
    "sp3": Format(None, available="start", read_late=sp3_stream),
    "rinex-clk": Format(None, available="start", read_late=rinex_clock_stream),
    "sinex-bias": Format(None, available="start", read_late=sinex_bias_stream),
    "erp": Format(None, available="start", read_late=earth_rotation_stream),
    "ionex": Format(None, available="start", read_late=ionex_stream),
    "blq": Format(None, available="start", read_late=ocean_loading_stream),
}
TABLE_FORMATS: Final = ("csv", "rtklib-pos", "matlab")
_NAVIGATION: Final = (
    channels.NAV.topic,
    channels.NAV_IONOSPHERE.topic,
    channels.NAV_TIME.topic,
    channels.ANTENNAS.topic,
    channels.PRODUCTS.topic,
    channels.SIGNAL_BIAS.topic,
    *SERIES,
)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """Rows of one topic of one file."""

    stream: str
    columns: Columns


def check_formats(spec: Spec) -> None:
    """Whether every source is of a format that its channels and streams can read.

    Raises
    ------
    ConfigurationError
        Where one is not.
    """
    for users, known, what in (
        ({n: (c.source, *c.join) for n, c in spec.channels.items()}, TABLE_FORMATS, "channels"),
        ({n: s.sources for n, s in spec.streams.items()}, tuple(FORMATS), "streams"),
    ):
        for name, sources in users.items():
            for source in sources:
                if spec.sources[source].format not in known:
                    raise ConfigurationError(
                        f"source {source} is of format {spec.sources[source].format!r}",
                        where=f"{spec.path}, [{what}.{name}]",
                        mend=f"{what} read {', '.join(known)}",
                    )


def reading_order(spec: Spec) -> list[tuple[str, Stream]]:
    """Streams in the order of the spec, but those that must know of others last."""

    def late(item: tuple[str, Stream]) -> bool:
        forms = (spec.sources[source].format for source in item[1].sources)
        return any(FORMATS[form].read_late is not None for form in forms)

    return sorted(spec.streams.items(), key=late)


class Streams:
    """Rows of all streams of a spec, topic by topic.

    Parameters
    ----------
    findings : Findings
    """

    def __init__(self, findings: Findings) -> None:
        self._findings = findings
        self._parts: dict[str, list[_Part]] = {}

    def add(self, name: str, stream: Stream, form: str, file: File) -> int:
        """Read a file of a stream; gives the number of its rows.

        Raises
        ------
        ConfigurationError
            Where another stream gives the same channel of a receiver.
        ForeignFileError
            Where the file gives nothing, or cannot be read.
        """
        count = 0
        available = stream.available or FORMATS[form].available
        for topic, columns in self._read(form, file, stream).items():
            parts = self._parts.setdefault(topic, [])
            if topic not in _NAVIGATION and any(part.stream != name for part in parts):
                raise ConfigurationError(
                    f"streams {parts[0].stream} and {name} are both {topic}",
                    where=file.name,
                    mend="give one another receiver",
                )
            columns = _shift(columns, round(stream.time_offset * time.NS_PER_S))
            if topic in _NAVIGATION and available == "start":
                unknown = np.full(len(columns), UNKNOWN_NS, dtype=np.int64)
                columns = dataclasses.replace(columns, log_time_ns=unknown)
            parts.append(_Part(name, columns))
            count += len(columns)
        if not count:
            raise ForeignFileError(
                "the file gives no rows",
                where=file.name,
                mend="; ".join(str(loss) for loss in self._findings.losses.losses),
            )
        if stream.time_offset:
            text = f"{file.name}: {stream.time_offset!r} s were added to the times that were read"
            self._findings.notes.append(text)
        return count

    def _read(self, form: str, file: File, stream: Stream) -> Mapping[str, Columns]:
        late, read = FORMATS[form].read_late, FORMATS[form].read
        if late is not None:
            return late(file, self._findings, stream, self._known())
        assert read is not None
        return read(file, self._findings, stream)

    def _known(self) -> Known:
        """Antennas and markers of the receivers so far, and the time that their rows span."""
        antennas: dict[str, None] = {}
        markers: dict[str, str] = {}
        times = []
        for topic, parts in self._parts.items():
            for part in parts:
                if channels.RECEIVER.matches(topic):
                    texts = part.columns.ragged("antenna").texts()
                    antennas |= dict.fromkeys(text.rstrip() for text in texts)
                    marker = part.columns.ragged("marker").texts()[0]
                    markers.setdefault(channels.RECEIVER.parts(topic)["receiver"], marker)
                if topic not in _NAVIGATION:
                    valid = part.columns.valid_time_ns
                    times += valid[valid >= 0].tolist()
        antennas.pop("", None)
        return Known(tuple(antennas), (min(times), max(times)) if times else None, markers)

    def topics(self) -> dict[str, str]:
        """Topic of each name, which is that of the stream and the topic."""
        return {f"{parts[0].stream} {topic}": topic for topic, parts in self._parts.items()}

    def join(self, others: Iterable[Columns]) -> dict[str, Columns]:
        """Rows by topic, in the order of their log times.

        Parameters
        ----------
        others : iterable of Columns
            What else the log holds: it starts with the first row that is no navigation
            message.
        """
        known = [columns.log_time_ns for columns in others]
        for topic, parts in self._parts.items():
            if topic not in _NAVIGATION:
                known += [part.columns.log_time_ns for part in parts]
        start = _first(known)
        if start == UNKNOWN_NS:
            every = [part.columns for parts in self._parts.values() for part in parts]
            start = _first([columns.valid_time_ns for columns in every])
        if channels.PRODUCTS.topic in self._parts:
            products = self._parts[channels.PRODUCTS.topic]
            files = _alike(channels.PRODUCTS.topic, [part.columns for part in products])
            check_frames(concatenate(files), self._findings)
        return {topic: self._join(topic, parts, start) for topic, parts in self._parts.items()}

    def _join(self, topic: str, parts: list[_Part], start: int) -> Columns:
        found = _alike(topic, [part.columns for part in parts])
        columns = (
            join_series(topic, found, self._findings) if topic in SERIES else concatenate(found)
        )
        log = np.where(columns.log_time_ns < 0, start, columns.log_time_ns)
        valid = np.where(columns.valid_time_ns < 0, start, columns.valid_time_ns)
        columns = dataclasses.replace(columns, log_time_ns=log, valid_time_ns=valid)
        order = np.lexsort((valid, log)).astype(np.int64)
        if (np.diff(order) != 1).any():
            columns = columns.take(order)
        if topic not in SERIES and (topic in _NAVIGATION or len(parts) > 1):
            columns = columns.take(self._distinct(topic, columns))
        sequence = np.arange(len(columns), dtype=np.uint32)
        return dataclasses.replace(columns, sequence=sequence)

    def _distinct(self, topic: str, columns: Columns) -> Int64:
        """Rows without those that repeat an earlier one in valid time and every byte."""
        spec = channels.find(topic)
        payloads = codec_for(spec.message if spec else "").encode(columns)
        seen: set[tuple[int, bytes]] = set()
        rows = []
        for row, blob in enumerate(payloads.blobs()):
            key = (int(columns.valid_time_ns[row]), hashlib.sha256(blob).digest())
            if key not in seen:
                seen.add(key)
                rows.append(row)
        again = len(columns) - len(rows)
        if again:
            text = (
                f"{topic}: {again} of {len(columns)} rows repeat another exactly and are left out"
            )
            self._findings.notes.append(text)
        return np.array(rows, dtype=np.int64)


def _alike(topic: str, parts: list[Columns]) -> list[Columns]:
    """Parts with the same fields in the same form: those of a log have every field."""
    forms = [{name: type(c) for name, c in part.values.items()} for part in parts]
    if all(form == forms[0] for form in forms):
        return parts
    spec = channels.find(topic)
    codec = codec_for(spec.message if spec else "")
    alike = []
    for part in parts:
        decoded = codec.decode(codec.encode(part))
        alike.append(dataclasses.replace(part, values=decoded.values, present=decoded.present))
    return alike


def _shift(columns: Columns, by_ns: int) -> Columns:
    """Rows with all known times moved."""
    if not by_ns:
        return columns
    log, valid = columns.log_time_ns, columns.valid_time_ns
    return dataclasses.replace(
        columns,
        log_time_ns=np.where(log < 0, log, log + by_ns),
        valid_time_ns=np.where(valid < 0, valid, valid + by_ns),
    )


def _first(times: Iterable[Int64]) -> int:
    """Earliest known time, or UNKNOWN_NS."""
    firsts = [int(known.min()) for part in times if len(known := part[part >= 0])]
    return min(firsts, default=UNKNOWN_NS)
