"""A log through transforms into a log: in the order in which :class:`Transform` names them."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import msgspec

from replay import channels
from replay.channels import CHECKPOINT, GNSS_FIX, GNSS_OBS, IMU, SIGNAL_TRUTH, TRACE
from replay.configuration import to_toml
from replay.engine.manifest import DEFAULTS, MANIFEST, make_manifest, manifest_metadata
from replay.engine.replayer import Progress
from replay.engine.run import JOB
from replay.engine.sink import announce_as_recorded, require_another_file
from replay.engine.transforms.noise import Noise
from replay.engine.transforms.order import Reordering
from replay.engine.transforms.outages import (
    DEGRADE,
    Cut,
    Outage,
    outage_record,
    outage_text,
    outages_of,
)
from replay.engine.transforms.removal import Removal
from replay.engine.transforms.resampling import Resampling
from replay.engine.transforms.settings import (
    Transform,
    parse_noise,
    parse_time_offset,
)
from replay.errors import LossReport, UsageError
from replay.log.codec import Codec
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.log.writer import LogWriter

TRANSFORM: Final = "replay.transform"
_JSON: Final = "json"
_TOML: Final = "toml"


@dataclasses.dataclass(frozen=True, slots=True)
class Transformed:
    """What was done to a log.

    Attributes
    ----------
    removed : dict of topic to int
        Rows of fixes and observations that were left out.
    notes : tuple of str
        All that was done, for a person; in the manifest too.
    losses : LossReport
        What could not be taken over although nobody asked for that.
    """

    removed: dict[str, int]
    notes: tuple[str, ...]
    losses: LossReport


def transform_log(
    source: Path,
    target: Path,
    settings: Transform,
    *,
    outages: tuple[Outage, ...] = (),
    keep_results: bool = False,
    command: str = "transform",
    progress: Progress | None = None,
) -> Transformed:
    """Write a log with something taken away, made coarser, added or moved.

    Removal of satellites and signals, outages, a lower rate of inertial samples, noise and
    time offsets are done in this order, whatever the order of words: times of outages are
    those of `source`, satellites that stay are chosen among those that are left, and noise
    is of the samples that are written.

    Parameters
    ----------
    source, target : Path
    settings : Transform
    outages : tuple of Outage
        Further ones, known already.
    keep_results : bool
        Whether channels that stages made stay. They are true of the log as it was.
    command : str
        As the manifest tells it.
    progress : callable, optional
        Told the fraction done.

    Raises
    ------
    UsageError
        Where a transform does not fit the log or does nothing, or both paths are the same.
    MissingChannelError
        Where the log lacks a channel that is named.
    """
    require_another_file(source, target)
    settings.check()
    if settings.nothing and not outages:
        raise UsageError(
            "a transform that does nothing",
            mend="say what is to be done: `replay transform --help`",
        )
    with LogReader(source) as reader, LogWriter(target) as writer:
        return _Passage(reader, settings, outages, keep_results).run(writer, command, progress)


class _Passage:
    """One log on its way through."""

    def __init__(
        self, reader: LogReader, settings: Transform, outages: tuple[Outage, ...], keep: bool
    ) -> None:
        self.reader = reader
        self.keep = keep
        self.topics = [topic for topic in reader.channels if keep or not self._is_result(topic)]
        self.earlier: list[str] = json.loads(
            reader.metadata.get(TRANSFORM, {}).get(_JSON, '{"transforms": []}')
        )["transforms"]
        self.removal = Removal(reader, settings)
        planned = outages_of(
            reader,
            settings.outage,
            every_s=settings.every,
            leave_last_s=settings.leave_last,
            gone=self.removal.gone if self.removal.wanted else None,
        )
        self.cut = Cut(reader, [*outages, *planned])
        self.resampling = (
            Resampling(reader, settings.imu_rate, settings.method) if settings.imu_rate else None
        )
        terms = [parse_noise(text, self._kind) for text in settings.noise]
        _once([(term.topic, term.field) for term in terms], "noise")
        self.noises = [Noise(term, settings.seed, len(self.earlier)) for term in terms]
        offsets = [parse_time_offset(text) for text in settings.time_offset]
        _once([topic for topic, _ in offsets], "time offset")
        for topic, _ in offsets:
            self._kind(topic)
        self.order = Reordering(dict(offsets))
        self.moves = bool(offsets) or self.resampling is not None
        # The same transform with nothing left to choose.
        self.settings = msgspec.structs.replace(
            settings,
            outage=tuple(outage_text(outage) for outage in self.cut.outages),
            every=0.0,
            noise=tuple(str(term) for term in terms),
            time_offset=tuple(f"{topic}={ns * 1e-9:.9f}" for topic, ns in offsets),
        )

    def run(self, writer: LogWriter, command: str, progress: Progress | None) -> Transformed:
        reader = self.reader
        for topic in self.topics:
            announce_as_recorded(writer, topic, reader.channels[topic])
        begin, end = reader.start_ns, reader.end_ns
        batches = reader.batches(self.topics, decode=self._decode(), payloads=self.topics)
        for batch in batches:
            latest_ns = max(int(rows.log_time_ns[-1]) for rows in batch.values())
            self._write(writer, self._through(batch, latest_ns), latest_ns)
            if progress is not None and end > begin:
                progress((latest_ns - begin) / (end - begin))
        if self.resampling is not None:
            rest = self.resampling.finish()
            for noise in self.noises:
                rest = noise.apply(rest)
            self._write(writer, rest, end)
        writer.write(self.order.finish())
        if self.removal.wanted:
            self.removal.check()
        self.cut.check()
        losses = LossReport([*reader.report.losses])
        if self.resampling is not None:
            losses.losses += self.resampling.losses().losses
        notes = (*self._notes(), *(str(loss) for loss in losses.losses))
        self._finish(writer, command, notes)
        removed = dict(self.cut.removed)
        for topic, count in self.removal.removed.items():
            removed[topic] = removed.get(topic, 0) + count
        return Transformed(removed, notes, losses)

    def _through(self, batch: dict[str, Columns], latest_ns: int) -> dict[str, Columns]:
        if self.removal.wanted:
            batch = self.removal.apply(batch)
        if self.cut.outages:
            batch = self.cut.apply(batch)
        if self.resampling is not None:
            batch = self.resampling.apply(batch, latest_ns)
        for noise in self.noises:
            batch = noise.apply(batch)
        return batch

    def _write(self, writer: LogWriter, batch: Mapping[str, Columns], latest_ns: int) -> None:
        rows = {topic: self._encoded(topic, part) for topic, part in batch.items() if len(part)}
        if self.moves:
            since = None if self.resampling is None else self.resampling.open_since_ns
            rows = self.order.apply(rows, latest_ns, since, IMU.topic)
        writer.write(rows)

    def _encoded(self, topic: str, rows: Columns) -> Columns:
        if rows.payloads is not None:
            return rows
        return dataclasses.replace(rows, payloads=self._codec(topic).encode(rows))

    def _codec(self, topic: str) -> Codec:
        codec = self.reader.channels[topic].codec
        if codec is None:  # it was decoded, so it has one
            raise KeyError(topic)
        return codec

    def _decode(self) -> list[str]:
        """Topics whose values are looked at."""
        wanted = set(self.cut.decode)
        if self.removal.wanted:
            wanted |= set(self.removal.decode)
        if self.resampling is not None and self.resampling.ratio > 1:
            wanted.add(IMU.topic)
        wanted |= {noise.term.topic for noise in self.noises}
        return [topic for topic in self.topics if topic in wanted]

    def _kind(self, topic: str) -> str:
        """Kind of a channel that stays."""
        self.reader.channel(topic)
        if topic not in self.topics:
            raise UsageError(
                f"{topic} is a result of a run, which does not stay",
                where=str(self.reader.path),
                mend="change what was recorded, and run again",
            )
        spec = channels.find(topic)
        return "" if spec is None else spec.name

    def _is_result(self, topic: str) -> bool:
        if self.reader.channels[topic].depth > 0:
            return True
        return channels.find(topic) in (TRACE, CHECKPOINT)

    def _notes(self) -> list[str]:
        notes: list[str] = []
        if self.removal.wanted:
            words = (
                *self.settings.remove_systems,
                *self.settings.remove_satellites,
                *self.settings.remove_signals,
            )
            notes += [
                f"{count} rows of {', '.join(words)} left out of {topic}"
                for topic, count in sorted(self.removal.removed.items())
            ]
            fixes = [topic for topic in self.topics if GNSS_FIX.matches(topic)]
            notes += [f"{topic} is as it was, with what was removed in it" for topic in fixes]
        notes += [
            f"{count} rows left out of {topic}" for topic, count in sorted(self.cut.removed.items())
        ]
        if self.resampling is not None:
            notes += self.resampling.notes()
        notes += [noise.note() for noise in self.noises]
        for topic, text in zip(self.order.moved, self.settings.time_offset, strict=True):
            notes.append(f"{self.order.moved[topic]} rows moved: {text} s")
        changed = {noise.term.topic for noise in self.noises} | self.order.moved.keys()
        for topic in sorted(t for t in changed if GNSS_OBS.matches(t)):
            truth = SIGNAL_TRUTH.at(**GNSS_OBS.parts(topic))
            if truth in self.topics:
                notes.append(f"{truth} does not know what was done to {topic}")
        for topic, info in self.reader.channels.items():
            if topic not in self.topics:
                notes.append(f"{info.message_count} rows of {topic} dropped: results of a run")
        return notes

    def _finish(self, writer: LogWriter, command: str, notes: tuple[str, ...]) -> None:
        reader = self.reader
        replaced = {MANIFEST, TRANSFORM} if self.keep else {MANIFEST, TRANSFORM, JOB}
        if self.cut.outages:
            replaced.add(DEGRADE)
        for name, values in sorted(reader.metadata.items()):
            if name == DEFAULTS and self.resampling is not None and self.resampling.ratio > 1:
                values = {**values, _TOML: _without_interval(values.get(_TOML, ""))}
            if name not in replaced:
                writer.add_metadata(name, values)
        if self.cut.outages:
            writer.add_metadata(DEGRADE, outage_record(reader.metadata, self.cut.outages))
        text = to_toml(self.settings)
        # Outages alone are told by their own record, which is the same in whatever steps.
        told = self.earlier if self._outages_alone() else [*self.earlier, text]
        if told:
            writer.add_metadata(TRANSFORM, {_JSON: json.dumps({"transforms": told})})
        for attachment in reader.attachments:
            writer.add_attachment(
                attachment.name,
                attachment.data,
                media_type=attachment.media_type,
                log_time_ns=attachment.log_time_ns,
                create_time_ns=attachment.create_time_ns,
            )
        manifest = make_manifest(
            command=command,
            configuration=text,
            inputs=reader.digests(),
            outputs=writer.digests(),
            notes=notes,
        )
        writer.add_metadata(MANIFEST, manifest_metadata(manifest))

    def _outages_alone(self) -> bool:
        return msgspec.structs.replace(self.settings, outage=()).nothing


def _once(names: list[tuple[str, str]] | list[str], what: str) -> None:
    for name in names:
        if names.count(name) > 1:  # type: ignore[arg-type]
            place = name if isinstance(name, str) else ".".join(name)
            raise UsageError(f"{what} of {place} is told twice", mend="say it once")


def _without_interval(defaults: str) -> str:
    """Canonical TOML of a log's defaults without the interval of its inertial samples."""
    kept: list[str] = []
    section = ""
    for line in defaults.splitlines():
        if line.startswith("["):
            section = line.strip()
        if not (section == "[imu]" and line.startswith("interval =")):
            kept.append(line)
    return "\n".join(kept) + "\n"
