"""Compare two runs: pair channels, compare each, find where they part, judge.

One pair of channels is in memory at a time, and channels of equal digests are
not read at all.
"""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np
from msgspec.structs import replace

from replay.channels import (
    CHECKPOINT,
    FILTER_COVARIANCE,
    FILTER_STATE,
    TRACE,
    ChannelSpec,
    Difference,
    Tolerance,
    rank,
)
from replay.diff.divergence import first_row
from replay.diff.join import KINDS, Joined, join
from replay.diff.lineage import lineage
from replay.diff.result import (
    ChannelDiff,
    ChannelStatus,
    Culprit,
    DiffResult,
    Divergence,
    RowCounts,
    RunInfo,
)
from replay.diff.runs import Run, open_run
from replay.diff.settings import configuration_changes, input_changes, version_changes
from replay.diff.sigmas import sigma_differences
from replay.diff.statistics import describe_field, describe_local
from replay.diff.topics import TopicPairs, pair_topics, run_name, spec_of
from replay.diff.trace import trace_culprit
from replay.diff.verdict import judge
from replay.errors import MissingChannelError
from replay.log.columns import Columns
from replay.schemas.replay_pb2 import Manifest

# A dumped state has no unit: its numbers are judged where they appear in channels.
_CHECKPOINT_TOLERANCES: Final = {"state": Tolerance(math.inf, "1", Difference.EXACT)}


@dataclasses.dataclass(frozen=True, slots=True)
class DiffOptions:
    """How to compare.

    Attributes
    ----------
    run_names : mapping of str to str
        Run name of A to run name of B. Empty: if each log has one, they are paired.
    topics : tuple of str
        Compare only these topics of A (and of B where A has none); empty for all.
    allow_different_inputs : bool
        Compare though the manifests say that the runs are over different logs.
    context_rows : int
        Rows shown before and after the first difference.
    """

    run_names: Mapping[str, str] = dataclasses.field(default_factory=dict)
    topics: tuple[str, ...] = ()
    allow_different_inputs: bool = False
    context_rows: int = 3


def diff_logs(
    path_a: str | os.PathLike[str],
    path_b: str | os.PathLike[str],
    options: DiffOptions | None = None,
) -> DiffResult:
    """Compare two logs, A being what is expected and B what is new.

    Raises
    ------
    CorruptLogError
        Where a log is damaged: recover it first.
    MissingChannelError
        Where a topic of the options is in neither log.
    """
    with open_run(path_a) as a, open_run(path_b) as b:
        return diff_runs(a, b, options)


def diff_runs(a: Run, b: Run, options: DiffOptions | None = None) -> DiffResult:
    """Compare two runs, from files or from memory."""
    options = options or DiffOptions()
    family = lineage(a.manifest, b.manifest)
    names = options.run_names
    if family is not None:
        names = names or family.run_names
    pairs = pair_topics(a.schemas, b.schemas, names)
    wanted = _chosen(pairs, options.topics)
    channels = [
        _compare_channel(a, b, topic, other, options)
        for topic, other in pairs.common
        if topic in wanted and not TRACE.matches(topic)
    ]
    channels += [
        _one_sided(run, topic, status)
        for run, topics, status in (
            (a, pairs.only_a, ChannelStatus.MISSING),
            (b, pairs.only_b, ChannelStatus.EXTRA),
        )
        for topic in topics
        if topic in wanted and not (family is not None and topic in family.passed)
    ]
    channels.sort(key=lambda channel: (rank(channel.topic), channel.topic))
    manifest_a, manifest_b = a.manifest or Manifest(), b.manifest or Manifest()
    both_manifests = a.manifest is not None and b.manifest is not None
    related = family is not None
    inputs = input_changes(manifest_a, manifest_b) if both_manifests and not related else []
    differing = [c.topic for c in channels if c.status is not ChannelStatus.IDENTICAL]
    # Of runs over runs the stages are other ones: their traces have nothing to part from.
    culprit = None if related else _culprit(a, b, differing)
    verdict, reasons = judge(
        channels,
        None if options.topics else culprit,
        other_inputs=[change.key for change in inputs],
        allow_different_inputs=options.allow_different_inputs,
    )
    if family is not None:
        reasons = [family.text, *reasons]
    return DiffResult(
        verdict=verdict,
        exit_code=int(verdict.exit_code),
        reasons=reasons,
        a=_describe_run(a),
        b=_describe_run(b),
        channels=channels,
        run_names={old: new for old, new in pairs.run_names.items() if old != new},
        first_difference=_earliest(c.first_difference for c in channels),
        first_change=_earliest(c.first_change for c in channels),
        culprit=culprit,
        configuration=configuration_changes(manifest_a, manifest_b) if both_manifests else [],
        versions=version_changes(manifest_a, manifest_b) if both_manifests else [],
        inputs=inputs,
    )


def diff_columns(
    spec: ChannelSpec,
    a: Columns,
    b: Columns,
    *,
    topic_b: str | None = None,
    covariance: Columns | None = None,
    context_rows: int = 3,
) -> ChannelDiff:
    """Compare the rows of one channel.

    Parameters
    ----------
    spec : ChannelSpec
        Key and tolerances; its topic names the channel in the result.
    a, b : Columns
    topic_b : str, optional
        Topic of B where it is another.
    covariance : Columns, optional
        A's filter covariances, for differences of states in sigmas.
    context_rows : int
        Rows shown before and after the first difference.
    """
    joined = join(spec, a, b)
    found = np.bincount(joined.kinds, minlength=len(KINDS))
    rows = RowCounts(**{kind.value: int(found[i]) for i, kind in enumerate(KINDS)})
    reordered = joined.alignment.reordered
    return ChannelDiff(
        topic=spec.topic,
        topic_b=topic_b or spec.topic,
        message=spec.message,
        status=_status(joined, rows, reordered),
        rows_a=len(a),
        rows_b=len(b),
        rows=rows,
        reordered=reordered,
        fields=[describe_field(joined, outcome) for outcome in joined.outcomes.values()],
        fields_missing=joined.fields_missing,
        fields_extra=joined.fields_extra,
        local=describe_local(joined),
        sigmas=[] if covariance is None else sigma_differences(joined, covariance),
        first_difference=first_row(joined, beyond=False, context=context_rows),
        first_change=first_row(joined, beyond=True, context=context_rows),
        notes=[f"{reordered} rows stand in another order"] if reordered else [],
    )


def _status(joined: Joined, rows: RowCounts, reordered: int) -> ChannelStatus:
    if rows.beyond or joined.fields_missing or joined.fields_extra:
        return ChannelStatus.CHANGED
    if rows.within or reordered:
        return ChannelStatus.WITHIN_TOLERANCE
    return ChannelStatus.IDENTICAL


def _chosen(pairs: TopicPairs, topics: tuple[str, ...]) -> list[str]:
    """Topics to compare."""
    known = [*(topic for topic, _ in pairs.common), *pairs.only_a, *pairs.only_b]
    for topic in topics:
        if topic not in known:
            raise MissingChannelError(
                f"neither log has the channel {topic}", mend=f"choose from: {', '.join(known)}"
            )
    return list(topics) or known


def _compare_channel(a: Run, b: Run, topic: str, topic_b: str, options: DiffOptions) -> ChannelDiff:
    schema_a, schema_b = a.schemas[topic], b.schemas[topic_b]
    rows_a, rows_b = a.count(topic), b.count(topic_b)
    bare = ChannelDiff(
        topic=topic,
        topic_b=topic_b,
        message=schema_a,
        status=ChannelStatus.IDENTICAL,
        rows_a=rows_a,
        rows_b=rows_b,
        rows=RowCounts(equal=rows_a),
    )
    if schema_a != schema_b:
        note = f"A holds {schema_a}, B holds {schema_b}"
        return replace(bare, status=ChannelStatus.SCHEMA, rows=RowCounts(), notes=[note])
    digest_a, digest_b = a.digest(topic), b.digest(topic_b)
    if digest_a is not None and digest_a == digest_b and rows_a == rows_b:
        return bare
    spec = spec_of(topic, schema_a)
    if spec.message == CHECKPOINT.message:
        spec = dataclasses.replace(spec, tolerances=_CHECKPOINT_TOLERANCES)
    found = diff_columns(
        spec,
        a.read(topic),
        b.read(topic_b),
        topic_b=topic_b,
        covariance=_covariance_of(a, topic) if spec.message == FILTER_STATE.message else None,
        context_rows=options.context_rows,
    )
    if found.status is ChannelStatus.IDENTICAL and digest_a is not None:
        note = "equal values in other bytes"
        return replace(found, status=ChannelStatus.WITHIN_TOLERANCE, notes=[*found.notes, note])
    return found


def _covariance_of(run: Run, topic: str) -> Columns | None:
    name = run_name(topic)
    if name is None:
        return None
    covariance = FILTER_COVARIANCE.at(run=name)
    return run.read(covariance) if covariance in run.schemas else None


def _one_sided(run: Run, topic: str, status: ChannelStatus) -> ChannelDiff:
    count = run.count(topic)
    missing = status is ChannelStatus.MISSING
    return ChannelDiff(
        topic=topic,
        topic_b=topic,
        message=run.schemas[topic],
        status=status,
        rows_a=count if missing else 0,
        rows_b=0 if missing else count,
        rows=RowCounts(missing=count) if missing else RowCounts(extra=count),
    )


def _culprit(a: Run, b: Run, differing: list[str]) -> Culprit | None:
    """Where the traces part; of the channels that the stage touches, those that differ."""
    if not all(TRACE.topic in run.schemas for run in (a, b)):
        return None
    digests = [run.digest(TRACE.topic) for run in (a, b)]
    if digests[0] is not None and digests[0] == digests[1]:
        return None
    stages = a.manifest.stages if a.manifest else []
    found = trace_culprit(
        a.read(TRACE.topic),
        b.read(TRACE.topic),
        {stage.name: list(stage.outputs) for stage in stages},
        {stage.name: list(stage.inputs) for stage in stages},
    )
    if found is None:
        return None
    touched = [topic for topic in found.channels if topic in differing]
    return replace(found, channels=touched or found.channels)


def _earliest(found: Iterable[Divergence | None]) -> Divergence | None:
    known = [divergence for divergence in found if divergence is not None]
    return min(known, key=lambda d: (d.log_time_ns, rank(d.topic), d.at.time_ns), default=None)


def _describe_run(run: Run) -> RunInfo:
    manifest = run.manifest or Manifest()
    return RunInfo(
        path=run.path,
        channels=len(run.schemas),
        rows=sum(run.count(topic) for topic in run.schemas),
        manifest=run.manifest is not None,
        command=manifest.command,
        pipeline=manifest.pipeline,
        package_version=manifest.package_version,
    )
