"""An import: spec and folder in, log out."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from replay import channels, time
from replay.engine.manifest import DEFAULTS, MANIFEST, make_manifest, manifest_metadata
from replay.errors import ConfigurationError, ForeignFileError, SchemaError
from replay.importers.canonical import to_toml
from replay.importers.clock import text_columns, valid_times
from replay.importers.delimited import read_csv
from replay.importers.files import File, read_file
from replay.importers.findings import Findings
from replay.importers.log_streams import FORMAT as LOG
from replay.importers.log_streams import log_metadata, own_defaults
from replay.importers.matlab import read_mat
from replay.importers.messages import Rows, build_rows
from replay.importers.ordering import join_tables, order_rows
from replay.importers.poll import repeats, steady_times
from replay.importers.result import ImportResult, compare_digests
from replay.importers.rtklib_pos import read_pos
from replay.importers.rtklib_tag import Tag, read_tag
from replay.importers.spec import Channel, Spec
from replay.importers.spec_file import load_spec
from replay.importers.streams import Streams, check_formats, reading_order
from replay.importers.table import Int64, Mask, Table
from replay.log.columns import Columns
from replay.log.writer import LogWriter

SOURCES = "replay.sources"
Progress = Callable[[str], None]


def import_log(
    spec_path: Path,
    data: Path,
    out: Path,
    *,
    strict: bool = False,
    progress: Progress | None = None,
) -> ImportResult:
    """Make a log of a foreign recording.

    Parameters
    ----------
    spec_path : Path
        The import spec.
    data : Path
        Folder that holds the spec's files.
    out : Path
        The log; it appears when it is whole.
    strict : bool
        Whether the first row that would be skipped, put in order or doubted ends
        the import instead of being counted.
    progress : function, optional
        Takes a line for each step.

    Returns
    -------
    ImportResult

    Raises
    ------
    ConfigurationError
        Where the spec is off.
    ForeignFileError
        Where a file is missing or cannot be read as the spec says.
    """
    spec = load_spec(spec_path)
    check_formats(spec)
    run = _Import(spec, data, Findings(strict=strict), progress or _silent)
    batch: dict[str, Columns] = {}
    topics: dict[str, str] = {}
    for name in spec.primary():
        used = run.choose(name)
        batch[spec.channels[used].topic] = run.channel(used)
        topics[used] = spec.channels[used].topic
    streams, named = run.streams(batch)
    batch |= streams
    topics |= named
    return run.write(out, batch, topics)


def _silent(_: str) -> None:
    """Say nothing."""


@dataclasses.dataclass(slots=True)
class _Import:
    spec: Spec
    data: Path
    findings: Findings
    progress: Progress
    files: dict[str, File] = dataclasses.field(default_factory=dict)
    tables: dict[tuple[str, frozenset[str]], Table] = dataclasses.field(default_factory=dict)

    def choose(self, name: str) -> str:
        """The channel itself, or its fallback where a file of it is missing."""
        channel = self.spec.channels[name]
        missing = [
            str(self.data / self.spec.sources[source].file)
            for source in (channel.source, *channel.join)
            if not (self.data / self.spec.sources[source].file).exists()
        ]
        if not missing or not channel.fallback:
            return name
        self.findings.loss(
            f"the file is missing, so channel {channel.fallback} stands in for {name}",
            missing[0],
            len(missing),
            "files",
            f"fetch it from {self.spec.origin}",
        )
        return self.choose(channel.fallback)

    def channel(self, name: str) -> Columns:
        """Rows of one channel."""
        channel = self.spec.channels[name]
        self.progress(f"{name}: reading {self.spec.sources[channel.source].file}")
        table = self._table(channel.source, channel)
        times, good = self._times(table, channel)
        for source in channel.join:
            table = self._join(table, times, source, channel)
        rows = build_rows(table, times, channel)
        kept = self._keep(table, good, rows, channel)
        if channel.loss:
            where, mend = table.file.name, f"see {self.spec.path}, [channels.{name}]"
            self.findings.loss(channel.loss, where, len(kept), "rows", mend)
        for field, mask in rows.present.items():
            absent = len(kept) - int(mask[kept].sum())
            if absent:
                self._note_once(f"{channel.topic}: {absent} of {len(kept)} rows have no {field}")
        place = (table.file.name, channel.topic)
        order = kept[order_rows(times[kept], table.lines[kept], *place, self.findings)]
        self.progress(f"{name}: {len(order)} of {len(table)} rows for {channel.topic}")
        if channel.time.repeats == "drop":
            repeated = repeats(rows.values, order)
            self._note_once(
                f"{channel.topic}: {int(repeated.sum())} of {len(order)} rows repeat the "
                "reading before them and are left out, as the spec says"
            )
            order = order[~repeated]
        valid = times[order]
        if channel.time.steady > 0.0:
            steady = steady_times(valid, channel.time.steady)
            moved = float(np.abs(steady - valid).max()) / time.NS_PER_S
            self._note_once(
                f"{channel.topic}: times follow the sensor's own clock (time constant "
                f"{channel.time.steady:g} s), by up to {moved:.4f} s"
            )
            valid = steady
        return Columns.build(
            valid,
            {field: np.ascontiguousarray(column[order]) for field, column in rows.values.items()},
            log_time_ns=valid + round(channel.time.latency * time.NS_PER_S),
            present={field: mask[order] for field, mask in rows.present.items()},
        )

    def streams(self, others: dict[str, Columns]) -> tuple[dict[str, Columns], dict[str, str]]:
        """Rows of all streams by topic, and the topic of each of their names.

        Raises
        ------
        ConfigurationError
            Where a channel gives a stream's topic too.
        """
        streams = Streams(self.findings)
        for name, stream in reading_order(self.spec):
            for source in stream.sources:
                file = self.spec.sources[source].file
                self.progress(f"{name}: reading {file}")
                form = self.spec.sources[source].format
                count = streams.add(name, stream, form, self._file(file))
                self.progress(f"{name}: {count} rows")
        topics = streams.topics()
        for name, topic in topics.items():
            if topic in others:
                raise ConfigurationError(
                    f"{name.split()[0]} and a channel are both {topic}",
                    where=str(self.spec.path),
                    mend="give one another receiver",
                )
        return streams.join(others.values()), topics

    def write(self, out: Path, batch: dict[str, Columns], topics: dict[str, str]) -> ImportResult:
        """The log, with what it was made from."""
        self.progress(f"writing {out}")
        with LogWriter(out) as writer:
            for topic in topics.values():
                kind = channels.find(topic)
                if kind is None:
                    raise SchemaError(f"{topic} is no channel", where=str(self.spec.path))
                writer.add_channel(topic, kind.message)
            writer.write(batch)
            digests = writer.digests()
            notes = (*self.spec.notes, *self.findings.notes, *map(str, self.findings.losses.losses))
            described = {key: item for key, item in self.spec.table.items() if key != "expect"}
            manifest = make_manifest(
                command="import",
                configuration=to_toml(described),
                outputs=digests,
                notes=self._local(notes),
            )
            writer.add_metadata(MANIFEST, manifest_metadata(manifest))
            writer.add_metadata(
                SOURCES,
                {
                    name: json.dumps({"sha256": file.sha256, "bytes": file.size})
                    for name, file in sorted(self.files.items())
                },
            )
            defaults = self._metadata(writer)
            if defaults:
                writer.add_metadata(DEFAULTS, {"toml": to_toml(defaults)})
        return ImportResult(
            out=out,
            rows={topic: len(columns) for topic, columns in batch.items()},
            digests=digests,
            topics=topics,
            losses=self.findings.losses,
            notes=(*self.spec.notes, *self.findings.notes),
            mismatches=compare_digests(self.spec.expect, topics, digests),
        )

    def _metadata(self, writer: LogWriter) -> dict[str, dict[str, Any]]:
        """Take over what logs among the sources say; the settings, those of the spec over them."""
        told: dict[str, dict[str, str]] = {}
        defaults: dict[str, dict[str, Any]] = {}
        used = [source for stream in self.spec.streams.values() for source in stream.sources]
        for name in dict.fromkeys(used):
            if self.spec.sources[name].format == LOG:
                metadata = log_metadata(self.data / self.spec.sources[name].file)
                for section, values in own_defaults(metadata).items():
                    defaults[section] = {**defaults.get(section, {}), **values}
                told |= metadata
        for name, values in sorted(told.items()):
            if name not in (DEFAULTS, SOURCES):
                writer.add_metadata(name, values)
        for section, values in self.spec.defaults.items():
            defaults[section] = {**defaults.get(section, {}), **values}
        return defaults

    def _local(self, notes: tuple[str, ...]) -> list[str]:
        """Notes without the folder, so that a log does not depend on where its files lay."""
        return [note.replace(f"{self.data}/", "") for note in notes]

    def _file(self, name: str) -> File:
        if name not in self.files:
            mend = f"put it there; it comes from {self.spec.origin}"
            self.files[name] = read_file(self.data / name, self.findings, mend=mend)
        return self.files[name]

    def _tag(self, name: str) -> Tag:
        return read_tag(self._file(name), self.findings)

    def _table(self, name: str, channel: Channel) -> Table:
        texts = text_columns(channel.time)
        key = (name, texts)
        if key not in self.tables:
            source = self.spec.sources[name]
            file = self._file(source.file)
            if source.format == "rtklib-pos":
                self.tables[key] = read_pos(file, self.findings)
            elif source.format == "matlab":
                self.tables[key] = read_mat(file, source.variable, source.columns)
            else:
                self.tables[key] = read_csv(
                    file, source.columns, texts, self.findings, source.delimiter
                )
        return self.tables[key]

    def _times(self, table: Table, channel: Channel) -> tuple[Int64, Mask]:
        return valid_times(table, channel.time, self._tag, self._note_once)

    def _note_once(self, text: str) -> None:
        if text not in self.findings.notes:
            self.findings.notes.append(text)

    def _join(self, table: Table, times: Int64, source: str, channel: Channel) -> Table:
        other = self._table(source, channel)
        other_times, good = self._times(other, channel)
        joined, found = join_tables(
            table, times, other, other_times, good, set(channel.time.columns)
        )
        alone = int((~found).sum())
        if alone:
            self._note_once(
                f"{table.file.name}: {alone} rows have no row of their time in {other.file.name}"
            )
        return joined

    def _keep(self, table: Table, good: Mask, rows: Rows, channel: Channel) -> Int64:
        """Rows that make messages; the others are counted, each by its first reason."""
        name = table.file.name
        zero = np.zeros(len(table), dtype=np.bool_)
        if channel.skip_when_zero:
            columns = [table.number(column) for column in channel.skip_when_zero]
            zero = np.all([column == 0.0 for column in columns], axis=0)
        listed = ", ".join(channel.skip_when_zero)
        reasons = {
            "the time is empty or no time; row skipped": ~good,
            f"{listed} are all zero, which means no measurement; row skipped": zero,
            **rows.unusable,
        }
        keep = np.ones(len(table), dtype=np.bool_)
        for reason, hit in reasons.items():
            lines = table.lines[keep & hit]
            self.findings.rows(f"{channel.topic}: {reason}", name, lines, "mend the line")
            keep &= ~hit
        for reason, hit in rows.doubtful.items():
            mend = "name the code in the spec's quality map"
            lines = table.lines[keep & hit]
            self.findings.rows(f"{channel.topic}: {reason}", name, lines, mend)
        if not keep.any():
            raise ForeignFileError(
                f"no row of the file can be used for {channel.topic}",
                where=name,
                mend="; ".join(str(loss) for loss in self.findings.losses.losses),
            )
        return np.flatnonzero(keep).astype(np.int64)
