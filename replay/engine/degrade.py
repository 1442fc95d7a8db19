"""Log transforms: what if there had been no fixes, or few satellites, for a while.

A transform writes a new log whose metadata says what was done; rows that stay keep
their bytes. Rows of the base are left alone. What a log holds of orbits and corrections
stays: without observations nobody uses it.
"""

from __future__ import annotations

import dataclasses
import json
import re
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay import time
from replay.channels import GNSS_FIX, GNSS_OBS, SATELLITES
from replay.configuration import literal
from replay.engine.manifest import DEFAULTS, MANIFEST, make_manifest, manifest_metadata
from replay.engine.moments import parse_outage
from replay.engine.sink import announce_as_recorded, require_another_file
from replay.errors import UsageError
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.log.writer import LogWriter

DEGRADE: Final = "replay.degrade"
_JSON: Final = "json"
_KEEP: Final = re.compile(r"(?P<outage>.*),keep=(?P<keep>[^,]*)")
_SATELLITE: Final = re.compile(r"[GRECJ]\d\d")
_USUAL_BASE: Final = "base"


@dataclasses.dataclass(frozen=True, slots=True)
class Outage:
    """A stretch of valid time, from the first included to the last not.

    Attributes
    ----------
    start_ns, end_ns : int, GPS ns
    keep : tuple of str
        Satellites whose observations stay; with none it is a full outage.
    """

    start_ns: int
    end_ns: int
    keep: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.end_ns <= self.start_ns:
            raise UsageError(
                "an outage ends after it begins", mend="write --outage START,SECONDS, SECONDS > 0"
            )

    def table(self) -> dict[str, Any]:
        """As the metadata and the manifest tell it: `keep` only where there is one."""
        table: dict[str, Any] = {"start_ns": self.start_ns, "end_ns": self.end_ns}
        return {**table, "keep": list(self.keep)} if self.keep else table


def plan_outages(
    source: Path, texts: Sequence[str], *, every_s: float = 0.0, leave_last_s: float = 0.0
) -> list[Outage]:
    """Outages as a person writes them, each maybe repeated to near the end of a log.

    Parameters
    ----------
    source : Path
        The log that they are meant for.
    texts : sequence of str
        `START,SECONDS` each; a number as START counts from the log's first row. With
        `,keep=3` as many satellites stay: those that stand highest at the first epoch of
        each outage by the log's channel of satellites, or where it has none those whose
        signals are strongest; with `,keep=G05+G12` those.
    every_s : float, s
        Between repetitions; 0 for none.
    leave_last_s : float, s
        At the end of the log, where no repetition may reach.

    Raises
    ------
    UsageError
        Where a text is no outage, or there is no satellite to keep.
    """
    outages: list[Outage] = []
    with LogReader(source) as reader:
        first_ns = reader.start_ns
        period_ns = round(every_s * time.NS_PER_S)
        latest_ns = reader.end_ns - round(leave_last_s * time.NS_PER_S)
        for text in texts:
            partial = _KEEP.fullmatch(text)
            start_ns, end_ns = parse_outage(partial["outage"] if partial else text, first_ns)
            planned = [Outage(start_ns, end_ns)]
            while period_ns > 0 and end_ns + period_ns <= latest_ns:
                start_ns, end_ns = start_ns + period_ns, end_ns + period_ns
                planned.append(Outage(start_ns, end_ns))
            outages += _keep(reader, source, planned, partial["keep"]) if partial else planned
    return outages


def _keep(reader: LogReader, source: Path, outages: Sequence[Outage], words: str) -> list[Outage]:
    """Outages with the satellites that stay: names, or a number of those that are best."""
    names = tuple(words.split("+"))
    if all(_SATELLITE.fullmatch(name) for name in names):
        return [dataclasses.replace(outage, keep=names) for outage in outages]
    if not words.isdecimal() or int(words) == 0:
        raise UsageError(
            f"keep={words} is neither a number of satellites nor their names",
            mend="write --outage START,SECONDS,keep=3 or keep=G05+G12+C20",
        )
    topics = [topic for topic in _degradable(reader) if GNSS_OBS.matches(topic)]
    if len(topics) != 1:
        raise UsageError(
            f"{len(topics)} channels of observations to choose satellites from",
            where=f"{source}: {', '.join(topics) or 'none'}",
            mend="name the satellites, as in keep=G05+G12, or gnss.receiver in the log's defaults",
        )
    observations = reader.read(topics[0])
    topic = SATELLITES.at(**GNSS_OBS.parts(topics[0]))
    sights = reader.read(topic) if topic in reader.channels else None
    return [
        dataclasses.replace(outage, keep=_best(observations, sights, outage, int(words), source))
        for outage in outages
    ]


def _best(
    observations: Columns, sights: Columns | None, outage: Outage, count: int, source: Path
) -> tuple[str, ...]:
    """Best satellites at an outage's first epoch, best first; equal ones by their names."""
    times = observations.valid_time_ns
    inside = times[(times >= outage.start_ns) & (times < outage.end_ns)]
    if len(inside) == 0:
        raise UsageError(
            "an outage has no observation to keep",
            where=f"{source}: at {outage.start_ns} ns",
            mend="`replay info` shows the span of each channel",
        )
    now = observations.take(times == inside.min())
    now = now.take(np.isfinite(now["pseudorange_m"]))
    seen = _largest(now["satellite"], now["cn0_dbhz"])
    if sights is not None and (sights.valid_time_ns == inside.min()).any():
        row = sights.take(sights.valid_time_ns == inside.min())
        heights = _largest(row["satellite"], row["elevation_rad"])
        seen = {name: heights.get(name, -np.inf) for name in seen}
    return tuple(sorted(seen, key=lambda name: (-seen[name], name))[:count])


def _largest(names: npt.NDArray[Any], values: npt.NDArray[Any]) -> dict[str, float]:
    """Largest value of each name; one that is unknown comes last of all."""
    largest: dict[str, float] = {}
    for code, value in zip(names.tolist(), values.tolist(), strict=True):
        name = code.decode("ascii")
        known = value if np.isfinite(value) else -np.inf
        largest[name] = max(known, largest.get(name, -np.inf))
    return largest


def _degradable(reader: LogReader) -> list[str]:
    """Topics of fixes and observations of the receiver that is replayed.

    It is the one that the log's defaults name; where they name none, every one but the base.
    """
    gnss = tomllib.loads(reader.metadata.get(DEFAULTS, {}).get("toml", "")).get("gnss", {})
    rover, base = gnss.get("receiver", ""), gnss.get("base", "") or _USUAL_BASE
    found = {
        topic: spec.parts(topic)["receiver"]
        for topic in reader.channels
        for spec in (GNSS_FIX, GNSS_OBS)
        if spec.matches(topic)
    }
    if rover in found.values():
        return [topic for topic, name in found.items() if name == rover]
    return [topic for topic, name in found.items() if name != base or len(found) == 1]


def remove_fixes(source: Path, target: Path, outages: Sequence[Outage]) -> dict[str, int]:
    """Write a log without the GNSS rows of some stretches of time.

    Parameters
    ----------
    source, target : Path
    outages : sequence of Outage
        Valid times within any of them are left out of fixes and observations of the
        receiver that is replayed; where satellites are kept, their observations stay.

    Returns
    -------
    dict of topic to int
        Rows left out.

    Raises
    ------
    UsageError
        Where an outage takes nothing away, or both paths are the same.
    """
    require_another_file(source, target)
    ordered = sorted(outages, key=lambda outage: outage.start_ns)
    removed: dict[str, int] = {}
    hits = np.zeros(len(ordered), dtype=np.int64)
    with LogReader(source) as reader, LogWriter(target) as writer:
        for topic, info in reader.channels.items():
            announce_as_recorded(writer, topic, info)
        affected = _degradable(reader)
        partial = any(outage.keep for outage in ordered)
        named = [topic for topic in affected if partial and GNSS_OBS.matches(topic)]
        topics = list(reader.channels)
        for batch in reader.batches(topics, decode=named, payloads=topics):
            kept = dict(batch)
            for topic in affected:
                if topic not in batch:
                    continue
                times = batch[topic].valid_time_ns
                out = np.zeros(len(times), dtype=np.bool_)
                for index, outage in enumerate(ordered):
                    inside = (times >= outage.start_ns) & (times < outage.end_ns)
                    if outage.keep and topic in named:
                        inside &= ~np.isin(
                            batch[topic]["satellite"], np.array(outage.keep, dtype="S3")
                        )
                    hits[index] += int(inside.sum())
                    out |= inside
                removed[topic] = removed.get(topic, 0) + int(out.sum())
                kept[topic] = batch[topic].take(~out)
            writer.write({topic: rows for topic, rows in kept.items() if len(rows)})
        empty = [outage for outage, count in zip(ordered, hits, strict=True) if count == 0]
        if empty:
            raise UsageError(
                f"an outage of {len(empty)} takes no GNSS row away",
                where=f"{source}: first at {empty[0].start_ns} ns",
                mend="`replay info` shows the span of each channel",
            )
        _copy_metadata(reader, writer, ordered, removed)
    return removed


def _copy_metadata(
    reader: LogReader, writer: LogWriter, outages: Sequence[Outage], removed: dict[str, int]
) -> None:
    before = json.loads(reader.metadata.get(DEGRADE, {}).get(_JSON, '{"outages": []}'))
    before["outages"] += [outage.table() for outage in outages]
    before["outages"].sort(key=lambda outage: outage["start_ns"])
    for name, values in sorted(reader.metadata.items()):
        if name not in (MANIFEST, DEGRADE):
            writer.add_metadata(name, values)
    writer.add_metadata(DEGRADE, {_JSON: json.dumps(before)})
    for attachment in reader.attachments:
        writer.add_attachment(attachment.name, attachment.data, media_type=attachment.media_type)
    lines = ["[[outage]]\n" + "".join(_lines(outage.table())) for outage in outages]
    manifest = make_manifest(
        command="degrade",
        configuration="\n".join(lines),
        inputs=reader.digests(),
        outputs=writer.digests(),
        notes=[f"{count} rows left out of {topic}" for topic, count in sorted(removed.items())],
    )
    writer.add_metadata(MANIFEST, manifest_metadata(manifest))


def _lines(table: dict[str, Any]) -> Iterable[str]:
    return (f"{key} = {literal(value)}\n" for key, value in table.items())
