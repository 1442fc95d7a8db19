"""Log transforms: what if there had been no fixes for a while.

A transform writes a new log whose metadata says what was done; rows that stay keep
their bytes.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from replay import time
from replay.channels import GNSS_FIX, GNSS_OBS
from replay.engine.manifest import MANIFEST, make_manifest, manifest_metadata
from replay.engine.moments import parse_outage
from replay.engine.sink import announce_as_recorded, require_another_file
from replay.errors import UsageError
from replay.log.reader import LogReader
from replay.log.writer import LogWriter

DEGRADE: Final = "replay.degrade"
_JSON: Final = "json"


@dataclasses.dataclass(frozen=True, slots=True)
class Outage:
    """A stretch of valid time, from the first included to the last not.

    Attributes
    ----------
    start_ns, end_ns : int, GPS ns
    """

    start_ns: int
    end_ns: int

    def __post_init__(self) -> None:
        if self.end_ns <= self.start_ns:
            raise UsageError(
                "an outage ends after it begins", mend="write --outage START,SECONDS, SECONDS > 0"
            )


def plan_outages(
    source: Path, texts: Sequence[str], *, every_s: float = 0.0, leave_last_s: float = 0.0
) -> list[Outage]:
    """Outages as a person writes them, each maybe repeated to near the end of a log.

    Parameters
    ----------
    source : Path
        The log that they are meant for.
    texts : sequence of str
        `START,SECONDS` each; a number as START counts from the log's first row.
    every_s : float, s
        Between repetitions; 0 for none.
    leave_last_s : float, s
        At the end of the log, where no repetition may reach.

    Raises
    ------
    UsageError
        Where a text is no outage.
    """
    with LogReader(source) as reader:
        first_ns, last_ns = reader.start_ns, reader.end_ns
    period_ns = round(every_s * time.NS_PER_S)
    latest_ns = last_ns - round(leave_last_s * time.NS_PER_S)
    outages: list[Outage] = []
    for text in texts:
        start_ns, end_ns = parse_outage(text, first_ns)
        outages.append(Outage(start_ns, end_ns))
        while period_ns > 0 and end_ns + period_ns <= latest_ns:
            start_ns, end_ns = start_ns + period_ns, end_ns + period_ns
            outages.append(Outage(start_ns, end_ns))
    return outages


def remove_fixes(source: Path, target: Path, outages: Sequence[Outage]) -> dict[str, int]:
    """Write a log without the GNSS rows of some stretches of time.

    Parameters
    ----------
    source, target : Path
    outages : sequence of Outage
        Valid times within any of them are left out of fixes and observations.

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
        affected = [t for t in reader.channels if GNSS_FIX.matches(t) or GNSS_OBS.matches(t)]
        topics = list(reader.channels)
        for batch in reader.batches(topics, decode=[], payloads=topics):
            kept = dict(batch)
            for topic in affected:
                if topic not in batch:
                    continue
                times = batch[topic].valid_time_ns
                out = np.zeros(len(times), dtype=np.bool_)
                for index, outage in enumerate(ordered):
                    inside = (times >= outage.start_ns) & (times < outage.end_ns)
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
    before["outages"] += [dataclasses.asdict(outage) for outage in outages]
    before["outages"].sort(key=lambda outage: outage["start_ns"])
    for name, values in sorted(reader.metadata.items()):
        if name not in (MANIFEST, DEGRADE):
            writer.add_metadata(name, values)
    writer.add_metadata(DEGRADE, {_JSON: json.dumps(before)})
    for attachment in reader.attachments:
        writer.add_attachment(attachment.name, attachment.data, media_type=attachment.media_type)
    lines = [f"[[outage]]\nstart_ns = {o.start_ns}\nend_ns = {o.end_ns}\n" for o in outages]
    manifest = make_manifest(
        command="degrade",
        configuration="\n".join(lines),
        inputs=reader.digests(),
        outputs=writer.digests(),
        notes=[f"{count} rows left out of {topic}" for topic, count in sorted(removed.items())],
    )
    writer.add_metadata(MANIFEST, manifest_metadata(manifest))
