"""What a filter writes for a smoother: room for its nodes, and the nodes as columns."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, Final, TypeVar

import numpy as np

from replay import channels
from replay.kernels.transition import NODE_DTYPE, trail_dtype
from replay.log.columns import Columns, Ragged, starts
from replay.stages.base import Port, StageSpec

Array = np.ndarray[Any, Any]
Nodes = tuple[Array, Array, Array, Array]
ResultT = TypeVar("ResultT")

_FIRST_ROOM: Final = (256, 1 << 18, 1 << 16)
_QUATERNION: Final = 4


class Recorder:
    """Nodes of a filter, of one block after the other.

    Parameters
    ----------
    states : int
        Error states that the filter has room for.
    on : bool
        Whether it records at all. Where it does not, nothing is kept and nothing written.
    name_of : callable
        Name of a state by the number that the filter gives it.

    Attributes
    ----------
    trail : array of one `trail_dtype(states)`
        What crosses from one block to the next; the compiled loop works on it, or on a copy
        that is brought back.
    """

    def __init__(self, states: int, on: bool, name_of: Callable[[int], str]) -> None:
        self.on = on
        self.trail = np.zeros(1, dtype=trail_dtype(states))
        self.trail["on"] = int(on)
        self._name_of = name_of
        self._names: dict[bytes, str] = {}
        self._room = _FIRST_ROOM if on else (0, 0, 0)
        self._nodes = self._new_nodes()

    def run(self, call: Callable[[Nodes], ResultT], *changed: Array) -> ResultT:
        """Call the compiled loop, again where its nodes found no room.

        Parameters
        ----------
        call : callable
            Given room for nodes; makes its other outputs anew at each call.
        changed : arrays
            That the loop changes, the recorder's trail among them where it does.
        """
        saved = [array.copy() for array in changed] if self.on else []
        while True:
            self._nodes = self._new_nodes()
            result = call(self._nodes)
            used = self._nodes[3]
            if not self.on or all(n <= room for n, room in zip(used, self._room, strict=True)):
                return result
            rows, values, places = (max(int(n), r) for n, r in zip(used, self._room, strict=True))
            self._room = (rows, values, places)
            for array, was in zip(changed, saved, strict=True):
                array[...] = was

    def lend(self, work: Array) -> Array:
        """Scratch of an inertial filter with the trail in it."""
        if self.on:
            work["trail"] = self.trail
        return work

    def take_back(self, work: Array) -> None:
        """Keep the trail of such a scratch."""
        if self.on:
            self.trail[...] = work["trail"]

    def _new_nodes(self) -> Nodes:
        rows, values, places = self._room
        return (
            np.zeros(rows, dtype=NODE_DTYPE),
            np.empty(values),
            np.empty(places, dtype=np.int64),
            np.zeros(3, dtype=np.int64),
        )

    def arrays(self) -> dict[str, Array]:
        """What a dump must hold, by name."""
        return {"trail": self.trail} if self.on else {}

    def types(self) -> dict[str, np.dtype[Any]]:
        """Types of :meth:`arrays`."""
        return {"trail": self.trail.dtype} if self.on else {}

    def restored(self, arrays: dict[str, Array]) -> Recorder:
        """The recorder of a dump; takes its own out of `arrays`."""
        if self.on:
            self.trail[...] = arrays.pop("trail")
        return self

    def outputs(self) -> dict[str, Columns]:
        """Rows of the last call by channel; nothing where the filter does not record."""
        if not self.on:
            return {}
        return {channels.FILTER_TRANSITION.name: self.columns()}

    def columns(self) -> Columns:
        """Rows of `replay.FilterTransition` of the last call."""
        rows, values, places, used = self._nodes
        rows = rows[: used[0]]
        n, nonzero, updated = rows["n"], rows["nonzero"], rows["updated"]
        triangle = n * (n + 1) // 2
        begins, lengths = rows["values"].copy(), {}
        for name, length in (
            ("value", nonzero),
            ("predicted_upper_triangle", triangle),
            ("correction", n * updated),
            ("updated_upper_triangle", triangle * updated),
            ("estimate", n),
        ):
            lengths[name] = (begins.copy(), length)
            begins += length
        columns: dict[str, Array | Ragged] = {
            name: pieces(values, begin, length) for name, (begin, length) in lengths.items()
        }
        whole = places.astype(np.uint32)
        columns["row"] = pieces(whole, rows["places"], nonzero)
        columns["column"] = pieces(whole, rows["places"] + nonzero, nonzero)
        columns["state_names"] = Ragged.from_texts(
            [
                self._text(places[begin : begin + count])
                for begin, count in zip(rows["places"] + 2 * nonzero, n, strict=True)
            ]
        )
        first = np.arange(len(rows), dtype=np.int64) * _QUATERNION
        columns["q_body_to_ecef"] = pieces(
            np.ascontiguousarray(rows["q"]).reshape(-1), first, _QUATERNION * rows["inertial"]
        )
        columns["since_ns"] = np.ascontiguousarray(rows["since"])
        for name, field in (
            ("dimension_before", "before"),
            ("dimension", "n"),
            ("solution", "solution"),
        ):
            columns[name] = rows[field].astype(np.uint32)
        return Columns.build(rows["t"], columns, log_time_ns=rows["log_t"])

    def _text(self, numbers: Array) -> str:
        """Names of states, by their numbers."""
        key = numbers.tobytes()
        if key not in self._names:
            if len(self._names) > 1024:
                self._names.clear()
            self._names[key] = ",".join(self._name_of(int(number)) for number in numbers)
        return self._names[key]


def pieces(values: Array, begins: Array, lengths: Array) -> Ragged:
    """Rows of `values` that begin at `begins` and have the given lengths."""
    lengths = np.ascontiguousarray(lengths, dtype=np.int64)
    offsets = starts(lengths)
    source = np.repeat(begins - offsets[:-1], lengths)
    return Ragged(offsets, values[source + np.arange(offsets[-1])])


def recording(spec: StageSpec, record: bool) -> StageSpec:
    """The spec of a stage that writes transitions too, where it is to record."""
    if not record:
        return spec
    return dataclasses.replace(spec, outputs=(*spec.outputs, Port(channels.FILTER_TRANSITION)))
