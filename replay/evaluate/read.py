"""Channels of a run, read from its log."""

from __future__ import annotations

import dataclasses
import json
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

import numpy as np

from replay import channels
from replay.errors import MissingChannelError, UsageError
from replay.evaluate.align import Rows
from replay.evaluate.geometry import Floats
from replay.evaluate.station import Reference, reference_rows
from replay.log.columns import Columns, concatenate
from replay.log.reader import LogReader

_MANIFEST: Final = "replay.manifest"
_ROVER: Final = "rover"
_BASE: Final = "base"
Metadata = Mapping[str, Mapping[str, str]]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RunChannels:
    """Channels of one run.

    Attributes
    ----------
    run : str
    solution, truth : Columns
    innovations, fixes, geometry, resolution : Columns or None
        None where the log does not have them.
    observations_ns : int64 array (n,) or None, GPS ns
        Epochs of observation of the run's receiver, ascending.
    antenna_arm_m : float64 array (3,) or None
        Body, IMU to antenna, as the run's configuration has it.
    metadata : mapping of record name to mapping
        Of the log.
    """

    run: str
    solution: Columns
    truth: Columns
    innovations: Columns | None = None
    fixes: Columns | None = None
    geometry: Columns | None = None
    resolution: Columns | None = None
    observations_ns: Rows | None = None
    antenna_arm_m: Floats | None = None
    metadata: Metadata = dataclasses.field(default_factory=dict)


def read_run(
    run_log: Path, *, run: str | None = None, reference: Reference | None = None
) -> RunChannels:
    """Channels of a run in a log.

    Parameters
    ----------
    run_log : Path
    run : str, optional
        Name of the run; may be left out where the log has one, or one of the name that
        its manifest gives.
    reference : "mean", or tuple of 3 float (m, ECEF), optional
        Truth of a point that stands still, instead of the log's.

    Raises
    ------
    MissingChannelError
        Where the log has no solution, or no truth.
    UsageError
        Where it has several runs and none was named.
    LogError
        Where it cannot be read.
    """
    with LogReader(run_log) as reader:
        topics = sorted(reader.channels)
        name = _run_name(run_names(topics), run, reader.metadata, str(run_log))
        if channels.TRUTH.topic not in topics and reference is None:
            raise MissingChannelError(
                "the log has no truth",
                where=f"{run_log}, {channels.TRUTH.topic}",
                mend="import or simulate the input with truth and run again, or give the place of"
                " a receiver that stands still (`replay evaluate --reference`)",
            )

        optional = (
            channels.FILTER_INNOVATIONS,
            channels.FILTER_GEOMETRY,
            channels.FILTER_RESOLUTION,
        )
        of_run = {spec.name: spec.at(run=name) for spec in (channels.SOLUTION, *optional)}
        found = read_channels(
            reader, (*of_run.values(), channels.TRUTH.topic), (channels.GNSS_FIX,)
        )
        fixes = [found[topic] for topic in topics if channels.GNSS_FIX.matches(topic)]
        return RunChannels(
            run=name,
            solution=found[of_run["SOLUTION"]],
            truth=(
                found[channels.TRUTH.topic]
                if reference is None
                else reference_rows(found[of_run["SOLUTION"]], reference)
            ),
            innovations=found.get(of_run["FILTER_INNOVATIONS"]),
            fixes=concatenate(fixes) if fixes else None,
            geometry=found.get(of_run["FILTER_GEOMETRY"]),
            resolution=found.get(of_run["FILTER_RESOLUTION"]),
            observations_ns=_observation_times(reader, topics),
            antenna_arm_m=_antenna_arm(reader.metadata),
            metadata={key: dict(values) for key, values in reader.metadata.items()},
        )


def read_channels(
    reader: LogReader, topics: Iterable[str], kinds: Iterable[channels.ChannelSpec] = ()
) -> dict[str, Columns]:
    """Channels of those topics and kinds that the log has, in one pass through it."""
    chosen = [topic for topic in topics if topic in reader.channels]
    kinds = tuple(kinds)
    chosen += [t for t in sorted(reader.channels) if any(spec.matches(t) for spec in kinds)]
    parts: dict[str, list[Columns]] = {topic: [] for topic in chosen}
    for batch in reader.batches(chosen):
        for topic, columns in batch.items():
            parts[topic].append(columns)
    return {
        topic: concatenate(found) if found else reader.read(topic) for topic, found in parts.items()
    }


def run_names(topics: list[str]) -> list[str]:
    """Names of the runs whose solutions are among topics, ascending."""
    return sorted(channels.SOLUTION.parts(t)["run"] for t in topics if channels.SOLUTION.matches(t))


def runs_of(run_log: Path) -> list[str]:
    """Names of the runs of a log, the run of its manifest first."""
    with LogReader(run_log) as reader:
        names = run_names(list(reader.channels))
        own = own_run(reader.metadata)
    return sorted(names, key=lambda name: (name != own, name))


def _run_name(names: list[str], run: str | None, metadata: Metadata, where: str) -> str:
    if run is None and len(names) == 1:
        return names[0]
    if run in names:
        return str(run)
    if run is not None or not names:
        raise MissingChannelError(
            f"the log has no solution of {run}" if run else "the log has no solution",
            where=where,
            mend=f"it has {', '.join(names)}" if names else "evaluate a log that `replay run` made",
        )
    own = own_run(metadata)
    if own in names:
        return own
    raise UsageError(
        "the log has several runs", where=where, mend=f"choose one of {', '.join(names)}"
    )


def own_run(metadata: Metadata) -> str:
    """Name of the run that made a log, as its manifest tells; empty where it does not."""
    manifest, config = _manifest(metadata)
    return str(config.get("name") or manifest.get("pipeline") or "")


def _manifest(metadata: Metadata) -> tuple[Mapping[str, object], Mapping[str, object]]:
    """The manifest and the configuration in it; empty where there is none to be read."""
    try:
        manifest = json.loads(metadata.get(_MANIFEST, {}).get("json", "{}"))
        return manifest, tomllib.loads(str(manifest.get("configuration", "")))
    except (ValueError, AttributeError):
        return {}, {}


def _antenna_arm(metadata: Metadata) -> Floats | None:
    """Lever arm of the antenna, where the configuration has one that is not zero."""
    section = _manifest(metadata)[1].get("antenna")
    arm = section.get("lever_arm") if isinstance(section, Mapping) else None
    if not isinstance(arm, list) or len(arm) != 3 or not any(arm):
        return None
    return np.array(arm, dtype=np.float64)


def _observation_times(reader: LogReader, topics: list[str]) -> Rows | None:
    """Epochs of the receiver that the run was about: the configured, the rover, the only one."""
    spec = channels.GNSS_OBS
    receivers = [spec.parts(topic)["receiver"] for topic in topics if spec.matches(topic)]
    section = _manifest(reader.metadata)[1].get("gnss")
    chosen = str(section.get("receiver", "")) if isinstance(section, Mapping) else ""
    others = [name for name in receivers if name != _BASE]
    name = next((n for n in (chosen, _ROVER, *others[:1]) if n in receivers), None)
    if name is None:
        return None
    topic = spec.at(receiver=name)
    times = [batch[topic].valid_time_ns for batch in reader.batches([topic], decode=[])]
    return np.unique(np.concatenate(times)) if times else None
