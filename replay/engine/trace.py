"""The trace: per stage and step, rolling digests of what went in and what came out.

A step of a stage ends at each log time at which its trigger has rows. Two runs
first part at the first step whose inputs were equal and whose outputs were not.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.engine.graph import Node
from replay.kernels import hashing
from replay.log.columns import Columns, Ragged
from replay.stages.base import dump_arrays, restore_arrays

UInt64 = npt.NDArray[np.uint64]
_TYPES: Final[dict[str, np.dtype[Any]]] = {
    "step": np.dtype(np.int64),
    "digests": np.dtype(np.uint64),
    "last_log_t": np.dtype(np.int64),
}


@dataclasses.dataclass(slots=True)
class StageTrace:
    """Rolling digests of one stage.

    Parameters
    ----------
    node : Node
        The stage in its place.
    """

    node: Node
    step: int = 0
    last_log_t: int = -1
    digests: dict[str, np.uint64] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        for topic in (*self.node.inputs.values(), *self.node.outputs.values()):
            self.digests[topic] = np.uint64(0)

    def update(self, rows: Mapping[str, Columns]) -> Columns | None:
        """Trace rows of a block.

        Parameters
        ----------
        rows : mapping of topic to Columns
            With payloads; inputs and outputs of the stage, and maybe others.
        """
        trigger = rows.get(self.node.trigger)
        times = np.unique(trigger.log_time_ns) if trigger is not None else np.zeros(0, np.int64)
        inputs = self._at(self.node.inputs.values(), rows, times)
        outputs = self._at(self.node.outputs.values(), rows, times)
        for topic in self.node.inputs.values():
            if topic in rows and len(rows[topic]):
                self.last_log_t = max(self.last_log_t, int(rows[topic].log_time_ns[-1]))
        return self._rows(times, inputs, outputs)

    def finish(self, at_ns: int) -> Columns | None:
        """One more step for what followed the last trigger, at the end of the log (GPS ns)."""
        if self.last_log_t < 0:
            return None
        times = np.array([at_ns], dtype=np.int64)
        inputs = self._at(self.node.inputs.values(), {}, times)
        outputs = self._at(self.node.outputs.values(), {}, times)
        return self._rows(times, inputs, outputs)

    def _at(
        self, topics: Iterable[str], rows: Mapping[str, Columns], times: npt.NDArray[np.int64]
    ) -> UInt64:
        """Digest over some topics as it stood at each of the times."""
        total = np.zeros(len(times), dtype=np.uint64)
        for topic in sorted(topics):
            seed = self.digests[topic]
            columns = rows.get(topic)
            if columns is None or len(columns) == 0:
                at = np.full(len(times), seed, dtype=np.uint64)
            else:
                chain = np.empty(len(columns) + 1, dtype=np.uint64)
                chain[0] = seed
                payloads = columns.payloads
                assert payloads is not None  # the engine encodes before it traces
                self.digests[topic] = np.uint64(
                    hashing.rolling_digest(
                        seed,
                        columns.log_time_ns,
                        columns.valid_time_ns,
                        np.ascontiguousarray(payloads.offsets),
                        np.ascontiguousarray(payloads.lengths),
                        payloads.data,
                        chain[1:],
                    )
                )
                at = chain[np.searchsorted(columns.log_time_ns, times, side="right")]
            hashing.combine_rows(total, at)
        return total

    def _rows(
        self, times: npt.NDArray[np.int64], inputs: UInt64, outputs: UInt64
    ) -> Columns | None:
        count = len(times)
        if count == 0:
            return None
        rows = Columns.build(
            times,
            {
                "stage": Ragged.from_texts([self.node.stage.spec.name] * count),
                "step": np.arange(self.step, self.step + count, dtype=np.uint64),
                "input_digest": inputs,
                "output_digest": outputs,
            },
        )
        self.step += count
        return rows

    def dump(self) -> bytes:
        """Rolling digests as bytes."""
        return dump_arrays(
            {
                "step": np.array([self.step], dtype=np.int64),
                "digests": np.array([self.digests[t] for t in sorted(self.digests)], np.uint64),
                "last_log_t": np.array([self.last_log_t], dtype=np.int64),
            }
        )

    def restore(self, data: bytes) -> None:
        """Go on from a dump."""
        arrays = restore_arrays(data, _TYPES)
        self.step = int(arrays["step"][0])
        self.last_log_t = int(arrays["last_log_t"][0])
        self.digests = dict(zip(sorted(self.digests), arrays["digests"], strict=True))
