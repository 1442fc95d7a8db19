"""The replayer: a log through a pipeline into a log.

Rows go through in blocks; each stage takes its inputs' rows and its outputs are
rows for the stages after it. What was recorded passes through untouched, so that
the result can be replayed itself; a run that begins later takes along what the log
knew by then (:mod:`replay.engine.standing`). No wall clock, no environment, no random state.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from replay import channels, time
from replay.channels import CHECKPOINT, IMU_UNIT, TRACE, ChannelSpec
from replay.engine.blocks import Batch, head, merge_rows, until
from replay.engine.floating_point import require_ieee_arithmetic
from replay.engine.graph import Node, bind
from replay.engine.job import Job
from replay.engine.pipelines import find_pipeline
from replay.engine.sink import Sink, announce_as_recorded
from replay.engine.standing import standing_rows
from replay.engine.trace import StageTrace
from replay.errors import CorruptLogError, LossReport, UsageError
from replay.log import codec
from replay.log.backwards import backwards
from replay.log.columns import Columns, Ragged
from replay.log.digest import ChannelDigest
from replay.log.reader import LogReader
from replay.schemas import replay_pb2
from replay.stages.base import BASE, RECEIVER, Context

Progress = Callable[[float], None]


@dataclasses.dataclass(frozen=True, slots=True)
class Result:
    """What a run gave.

    Attributes
    ----------
    inputs, outputs : mapping of topic to ChannelDigest
    first_ns, last_ns : int, GPS ns
        Log times of the first and last row.
    losses : LossReport
        What was skipped on the way.
    notes : tuple of str
    """

    inputs: Mapping[str, ChannelDigest]
    outputs: Mapping[str, ChannelDigest]
    first_ns: int
    last_ns: int
    losses: LossReport
    notes: tuple[str, ...]


class Replayer:
    """One run of a job.

    Parameters
    ----------
    reader : LogReader
        The input.
    job : Job
    """

    def __init__(self, reader: LogReader, job: Job) -> None:
        require_ieee_arithmetic()
        self.reader = reader
        self.job = job
        self.recorded = {
            topic: info
            for topic, info in reader.channels.items()
            if channels.find(topic) not in (TRACE, CHECKPOINT)
        }
        section = getattr(job.config, "gnss", None)
        receivers = {role: str(getattr(section, role, "")) for role in (RECEIVER, BASE)}
        receivers[IMU_UNIT.name] = str(getattr(getattr(job.config, "imu", None), "name", ""))
        pipeline = find_pipeline(job.pipeline)
        name = pipeline.run_name(job.config, list(self.recorded))
        stages = pipeline.stages(job.config, list(self.recorded))
        self.nodes = bind(stages, self._depths(), run=name, receivers=receivers)
        self.traces = [StageTrace(node) for node in self.nodes]
        self.states = [self._start(node) for node in self.nodes]
        self.depth = 1 + max(node.depth for node in self.nodes)
        self._numbered: dict[str, int] = {}
        self._trace_rows = 0
        self._checkpoint_rows = 0
        self._first_ns = -1
        self._last_ns = -1

    def run(
        self, sink: Sink, *, resume: LogReader | None = None, progress: Progress | None = None
    ) -> Result:
        """Take every row of the input; rows go to `sink`.

        Parameters
        ----------
        sink : Sink
        resume : LogReader, optional
            A log of the same job that ended early; its rows up to its last whole
            checkpoint are taken over.
        progress : callable, optional
            Told the fraction done.
        """
        self._announce(sink)
        start_ns = self.job.start_ns
        decode = {topic for node in self.nodes for topic in node.inputs.values()}
        if resume is not None:
            start_ns = self._take_over(resume, sink)
        elif start_ns is not None:
            for known in standing_rows(self.reader, start_ns, decode=list(decode)):
                self._step(known, sink)
        batches = self.reader.batches(
            list(self.recorded),
            decode=[topic for topic in self.recorded if topic in decode],
            payloads=list(self.recorded),
            start_ns=start_ns,
            end_ns=self.job.end_ns,
        )
        begin = self.reader.start_ns if self.job.start_ns is None else self.job.start_ns
        end = self.reader.end_ns if self.job.end_ns is None else self.job.end_ns
        for batch, checkpoint_ns in self._cut(batches):
            if batch:
                self._step(batch, sink)
                if progress is not None and end > begin:
                    progress(min(1.0, (self._last_ns - begin) / (end - begin)))
            if checkpoint_ns is not None:
                self._checkpoint(checkpoint_ns, sink)
        self._finish(sink)
        digests = sink.digests()
        return Result(
            {topic: digests[topic] for topic in sorted(self.recorded)},
            {topic: digests[topic] for topic in sorted(digests) if topic not in self.recorded},
            self._first_ns,
            self._last_ns if self._first_ns >= 0 else -1,
            self.reader.report,
            self._notes(),
        )

    def stage_records(self) -> list[replay_pb2.StageRecord]:
        """Stages for the manifest."""
        return [
            replay_pb2.StageRecord(
                name=node.stage.spec.name,
                version=node.stage.spec.version,
                inputs=list(node.inputs.values()),
                outputs=list(node.outputs.values()),
            )
            for node in self.nodes
        ]

    def _depths(self) -> dict[str, int]:
        return {topic: info.depth for topic, info in self.recorded.items()}

    def _start(self, node: Node) -> Any:
        topics = {**node.inputs, **node.outputs}
        heads = {
            name: head(self.reader, topic)
            for name, topic in node.inputs.items()
            if topic in self.recorded
        }

        def rows_backwards(name: str) -> Iterator[Columns]:
            return backwards(
                self.reader,
                node.inputs[name],
                start_ns=self.job.start_ns,
                end_ns=self.job.end_ns,
            )

        return node.stage.start(self.job.config, Context(topics, heads, rows_backwards))

    def _announce(self, sink: Sink) -> None:
        for topic, info in self.recorded.items():
            announce_as_recorded(sink, topic, info)
        for node in self.nodes:
            specs = {port.name: port.channel for port in node.stage.spec.outputs}
            for name, topic in node.outputs.items():
                sink.add_channel(topic, specs[name].message, depth=node.depth)
        sink.add_channel(TRACE.topic, TRACE.message, depth=self.depth)
        if self.job.checkpoint_every_s > 0:
            sink.add_channel(CHECKPOINT.topic, CHECKPOINT.message, depth=self.depth)

    def _cut(self, batches: Iterator[dict[str, Columns]]) -> Iterator[tuple[Batch, int | None]]:
        """Batches, cut where a checkpoint is due, with the time of the checkpoint after each."""
        every = self.job.checkpoint_every_s * time.NS_PER_S
        for batch in batches:
            whole = {topic: rows for topic, rows in batch.items() if len(rows)}
            if not whole:
                continue
            self._begin(whole)
            last = max(int(rows.log_time_ns[-1]) for rows in whole.values())
            if every > 0:
                seen = max(self._last_ns, self._first_ns)
                due = self._first_ns + ((seen - self._first_ns) // every + 1) * every
                while due <= last:
                    yield until(whole, due, included=True), due
                    whole = until(whole, due, included=False)
                    due += every
            yield whole, None

    def _begin(self, batch: Batch) -> None:
        """Note the first row of the stretch; what was known before it is not of it."""
        if self._first_ns < 0:
            begin = self.job.start_ns or 0
            times = [rows.log_time_ns[rows.log_time_ns >= begin] for rows in batch.values()]
            self._first_ns = min((int(t[0]) for t in times if len(t)), default=-1)

    def _step(self, batch: Batch, sink: Sink) -> None:
        rows = dict(batch)
        for node_index, node in enumerate(self.nodes):
            block = {name: rows[topic] for name, topic in node.inputs.items() if topic in rows}
            state, outputs = node.stage.step(self.states[node_index], block)
            self.states[node_index] = state
            rows.update(self._encoded(node, outputs))
        self._last_ns = max(int(columns.log_time_ns[-1]) for columns in batch.values())
        self._write(rows, [trace.update(rows) for trace in self.traces], sink)

    def _finish(self, sink: Sink) -> None:
        rows: dict[str, Columns] = {}
        for node, state in zip(self.nodes, self.states, strict=True):
            rows.update(self._encoded(node, self._at_end(node.stage.finish(state))))
        self._write(rows, [trace.finish(self._last_ns) for trace in self.traces], sink)

    def _at_end(self, outputs: Mapping[str, Columns]) -> dict[str, Columns]:
        """What a stage says after the log's last row comes no earlier than that row."""
        return {
            name: dataclasses.replace(
                rows, log_time_ns=np.maximum(rows.log_time_ns, np.int64(self._last_ns))
            )
            for name, rows in outputs.items()
        }

    def _encoded(self, node: Node, outputs: Mapping[str, Columns]) -> dict[str, Columns]:
        """Rows of a stage by topic, numbered through the whole run, with their payloads."""
        specs = {port.name: port.channel for port in node.stage.spec.outputs}
        rows: dict[str, Columns] = {}
        for name, columns in outputs.items():
            topic = node.outputs[name]
            first = self._numbered.get(topic, 0)
            self._numbered[topic] = first + len(columns)
            sequence = np.arange(first, first + len(columns), dtype=np.uint32)
            rows[topic] = encoded(specs[name], dataclasses.replace(columns, sequence=sequence))
        return rows

    def _write(self, rows: Mapping[str, Columns], traces: list[Columns | None], sink: Sink) -> None:
        """Write rows, and the trace rows of all stages merged by time."""
        parts = [part for part in traces if part is not None]
        written = dict(rows)
        if parts:
            merged = merge_rows(parts)
            count = len(merged)
            merged.sequence[:] = np.arange(self._trace_rows, self._trace_rows + count)
            self._trace_rows += count
            written[TRACE.topic] = encoded(TRACE, merged)
        if written:
            sink.write(written)

    def _checkpoint(self, at_ns: int, sink: Sink) -> None:
        names, steps, blobs = [], [], []
        for node, state, trace in zip(self.nodes, self.states, self.traces, strict=True):
            own = trace.dump()
            names.append(node.stage.spec.name)
            steps.append(trace.step)
            blobs.append(len(own).to_bytes(8, "little") + own + node.stage.dump(state))
        rows = Columns.build(
            np.full(len(names), at_ns, dtype=np.int64),
            {
                "stage": Ragged.from_texts(names),
                "step": np.array(steps, dtype=np.uint64),
                "state": Ragged.from_blobs(blobs),
            },
            sequence_start=self._checkpoint_rows,
        )
        self._checkpoint_rows += len(names)
        sink.write({CHECKPOINT.topic: encoded(CHECKPOINT, rows)})

    def _take_over(self, resume: LogReader, sink: Sink) -> int:
        """Copy an earlier run up to its last checkpoint; the log time to go on from."""
        if CHECKPOINT.topic not in resume.channels:
            raise UsageError(
                "the earlier run holds no checkpoint", mend="run with --checkpoint-every SECONDS"
            )
        saved = resume.read(CHECKPOINT.topic)
        if len(saved) < len(self.nodes):
            raise UsageError("the earlier run ended before its first checkpoint")
        times, stages = np.unique(saved.valid_time_ns, return_counts=True)
        at_ns = int(times[stages == len(self.nodes)][-1])
        chosen = saved.take(saved.valid_time_ns == at_ns)
        by_stage = dict(
            zip(chosen.ragged("stage").texts(), chosen.ragged("state").blobs(), strict=True)
        )
        for index, (node, trace) in enumerate(zip(self.nodes, self.traces, strict=True)):
            blob = by_stage[node.stage.spec.name]
            length = int.from_bytes(blob[:8], "little")
            trace.restore(blob[8 : 8 + length])
            self.states[index] = node.stage.restore(self.states[index], blob[8 + length :])
        topics = list(resume.channels)
        counts = dict.fromkeys(topics, 0)
        copied = [StageTrace(node) for node in self.nodes]
        for batch in resume.batches(topics, decode=[], payloads=topics, end_ns=at_ns + 1):
            kept = {topic: rows for topic, rows in batch.items() if len(rows)}
            if not kept:
                continue
            self._begin(kept)
            for topic, rows in kept.items():
                counts[topic] += len(rows)
            for trace in copied:
                trace.update(kept)
            sink.write(kept)
        self._numbered = {topic: count for topic, count in counts.items() if count}
        self._trace_rows = counts[TRACE.topic]
        self._checkpoint_rows = counts[CHECKPOINT.topic]
        self._require_whole(resume, at_ns, counts, copied)
        self._last_ns = at_ns
        return at_ns + 1

    def _require_whole(
        self, resume: LogReader, at_ns: int, counts: Mapping[str, int], copied: list[StageTrace]
    ) -> None:
        """Refuse an earlier run that lost rows before its last checkpoint.

        Recovery leaves out a damaged chunk; a checkpoint after the hole hides it.
        """
        expected = dict.fromkeys(self.recorded, 0)
        if self.job.start_ns is not None:
            for known in standing_rows(self.reader, self.job.start_ns, decode=[]):
                for topic, rows in known.items():
                    expected[topic] += len(rows)
        for batch in self.reader.batches(
            list(self.recorded), decode=[], start_ns=self.job.start_ns, end_ns=at_ns + 1
        ):
            for topic, rows in batch.items():
                expected[topic] += len(rows)
        every = self.job.checkpoint_every_s * time.NS_PER_S
        expected[TRACE.topic] = sum(trace.step for trace in self.traces)
        expected[CHECKPOINT.topic] = len(self.nodes) * ((at_ns - self._first_ns) // every)
        holed = {topic for topic, count in expected.items() if counts.get(topic, 0) != count}
        for found, saved in zip(copied, self.traces, strict=True):
            holed |= {t for t, digest in found.digests.items() if digest != saved.digests[t]}
        if holed:
            raise CorruptLogError(
                f"the earlier run lacks rows of {', '.join(sorted(holed))}",
                where=f"{resume.path}, before its checkpoint at {time.to_text(at_ns)}",
                mend="it was damaged before its end: run again without --resume",
            )

    def _notes(self) -> tuple[str, ...]:
        return tuple(str(loss) for loss in self.reader.report.losses)


def encoded(spec: ChannelSpec, columns: Columns) -> Columns:
    """The same rows with their payloads."""
    return dataclasses.replace(columns, payloads=codec.codec_for(spec.message).encode(columns))
