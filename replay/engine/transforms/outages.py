"""Outages: stretches of time without GNSS, or with few satellites.

Rows of the base are left alone. What a log holds of orbits and corrections stays:
without observations nobody uses it.
"""

from __future__ import annotations

import dataclasses
import decimal
import json
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay import time
from replay.channels import GNSS_FIX, GNSS_OBS, SATELLITES
from replay.engine.manifest import DEFAULTS
from replay.engine.moments import parse_outage
from replay.errors import UsageError
from replay.log.columns import Columns
from replay.log.reader import LogReader

DEGRADE: Final = "replay.degrade"
_JSON: Final = "json"
_KEEP: Final = re.compile(r"(?P<outage>.*),keep=(?P<keep>[^,]*)")
_SATELLITE: Final = re.compile(r"[GRECJIS]\d\d")
_NUMBER: Final = re.compile(r"(?P<low>low:)?(?P<count>[1-9]\d*)")
_USUAL_BASE: Final = "base"

Gone = Callable[[Columns], npt.NDArray[np.bool_]]
"""Which observations a removal takes away, so that none of them is chosen to stay."""


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
        signals are strongest; with `,keep=low:3` the lowest or weakest; with
        `,keep=G05+G12` those.
    every_s : float, s
        Between repetitions; 0 for none.
    leave_last_s : float, s
        At the end of the log, where no repetition may reach.

    Raises
    ------
    UsageError
        Where a text is no outage, or there is no satellite to keep.
    """
    with LogReader(source) as reader:
        return outages_of(reader, texts, every_s=every_s, leave_last_s=leave_last_s)


def outages_of(
    reader: LogReader,
    texts: Sequence[str],
    *,
    every_s: float = 0.0,
    leave_last_s: float = 0.0,
    gone: Gone | None = None,
) -> list[Outage]:
    """Outages of :func:`plan_outages` for a log that is open; `gone` are never chosen to stay."""
    outages: list[Outage] = []
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
        outages += _keep(reader, planned, partial["keep"], gone) if partial else planned
    return outages


def _keep(
    reader: LogReader, outages: Sequence[Outage], words: str, gone: Gone | None
) -> list[Outage]:
    """Outages with the satellites that stay: names, or a number of those highest or lowest."""
    names = tuple(words.split("+"))
    if all(_SATELLITE.fullmatch(name) for name in names):
        return [dataclasses.replace(outage, keep=names) for outage in outages]
    number = _NUMBER.fullmatch(words)
    if number is None:
        raise UsageError(
            f"keep={words} is neither a number of satellites nor their names",
            mend="write --outage START,SECONDS,keep=3, keep=low:3 or keep=G05+G12+C20",
        )
    topics = [topic for topic in gnss_topics(reader) if GNSS_OBS.matches(topic)]
    if len(topics) != 1:
        raise UsageError(
            f"{len(topics)} channels of observations to choose satellites from",
            where=f"{reader.path}: {', '.join(topics) or 'none'}",
            mend="name the satellites, as in keep=G05+G12, or gnss.receiver in the log's defaults",
        )
    observations = reader.read(topics[0])
    if gone is not None:
        observations = observations.take(~gone(observations))
    topic = SATELLITES.at(**GNSS_OBS.parts(topics[0]))
    sights = reader.read(topic) if topic in reader.channels else None
    low, count = number["low"] is not None, int(number["count"])
    chosen: list[Outage] = []
    for outage in outages:
        names = _ordered(observations, sights, outage, low, reader.path)[:count]
        chosen.append(dataclasses.replace(outage, keep=names))
    return chosen


def _ordered(
    observations: Columns, sights: Columns | None, outage: Outage, low: bool, source: Path
) -> tuple[str, ...]:
    """Satellites at an outage's first epoch, best or worst first; equal ones by their names."""
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
    sign = 1.0 if low else -1.0
    # One of which nothing is known comes last either way.
    known = {n: (not np.isfinite(seen[n]), sign * seen[n]) for n in seen}
    return tuple(sorted(seen, key=lambda name: (*known[name], name)))


def _largest(names: npt.NDArray[Any], values: npt.NDArray[Any]) -> dict[str, float]:
    """Largest value of each name; one that is unknown comes last of all."""
    largest: dict[str, float] = {}
    for code, value in zip(names.tolist(), values.tolist(), strict=True):
        name = code.decode("ascii")
        known = value if np.isfinite(value) else -np.inf
        largest[name] = max(known, largest.get(name, -np.inf))
    return largest


def gnss_topics(reader: LogReader) -> list[str]:
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


class Cut:
    """Takes the rows of outages away, batch by batch.

    Parameters
    ----------
    reader : LogReader
        Whose fixes and observations of the receiver that is replayed are meant.
    outages : sequence of Outage
        Valid times within any of them are left out; where satellites are kept, their
        observations stay.

    Attributes
    ----------
    outages : list of Outage
        By their starts.
    decode : list of str
        Topics whose satellites have to be known.
    removed : dict of topic to int
        Rows left out so far.
    """

    def __init__(self, reader: LogReader, outages: Sequence[Outage]) -> None:
        self.outages = sorted(outages, key=lambda outage: outage.start_ns)
        self._path = reader.path
        self._affected = gnss_topics(reader)
        partial = any(outage.keep for outage in outages)
        self.decode = [t for t in self._affected if partial and GNSS_OBS.matches(t)]
        self.removed: dict[str, int] = {}
        self._hits = np.zeros(len(self.outages), dtype=np.int64)

    def apply(self, batch: dict[str, Columns]) -> dict[str, Columns]:
        """What stays of a batch."""
        kept = dict(batch)
        for topic in self._affected:
            if topic not in batch:
                continue
            times = batch[topic].valid_time_ns
            out = np.zeros(len(times), dtype=np.bool_)
            for index, outage in enumerate(self.outages):
                inside = (times >= outage.start_ns) & (times < outage.end_ns)
                if outage.keep and topic in self.decode:
                    names = np.array(outage.keep, dtype="S3")
                    inside &= ~np.isin(batch[topic]["satellite"], names)
                self._hits[index] += int(inside.sum())
                out |= inside
            self.removed[topic] = self.removed.get(topic, 0) + int(out.sum())
            kept[topic] = batch[topic].take(~out)
        return kept

    def check(self) -> None:
        """Refuse an outage that took nothing away.

        Raises
        ------
        UsageError
        """
        pairs = zip(self.outages, self._hits, strict=True)
        empty = [outage for outage, count in pairs if count == 0]
        if empty:
            raise UsageError(
                f"an outage of {len(empty)} takes no GNSS row away",
                where=f"{self._path}: first at {empty[0].start_ns} ns",
                mend="`replay info` shows the span of each channel",
            )


def outage_record(
    metadata: Mapping[str, Mapping[str, str]], outages: Sequence[Outage]
) -> dict[str, str]:
    """Metadata record of these outages and those that a log had before."""
    before = json.loads(metadata.get(DEGRADE, {}).get(_JSON, '{"outages": []}'))
    before["outages"] += [outage.table() for outage in outages]
    before["outages"].sort(key=lambda outage: outage["start_ns"])
    return {_JSON: json.dumps(before)}


def outage_text(outage: Outage) -> str:
    """An outage as :func:`plan_outages` takes it, exact and with its satellites by name."""
    seconds = decimal.Decimal(outage.end_ns - outage.start_ns) / time.NS_PER_S
    text = f"{outage.start_ns},{seconds:f}"
    return f"{text},keep={'+'.join(outage.keep)}" if outage.keep else text
