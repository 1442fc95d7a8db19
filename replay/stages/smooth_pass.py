"""The pass backwards over the nodes of a run, slice by slice, by either way of smoothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from replay.errors import DataError
from replay.kernels import smoother, two_filter
from replay.kernels.transition import SILENT
from replay.log.columns import Columns, starts
from replay.stages.spool import Found, Spool

Array = np.ndarray[Any, Any]

_NAVIGATION: Final = 9
_WHY: Final = {
    smoother.OTHER_STATES: "its number of states is not what the node after it goes back to",
    smoother.OTHER_TIME: "its time is not what the node after it goes back to",
}


class _Smoothing:
    """Rauch-Tung-Striebel: what goes back from node to node is a vector and a matrix."""

    _kernel: Any = staticmethod(smoother.smooth_nodes)
    _squares = 1
    _carried = 2

    def __init__(self) -> None:
        self.carry = np.zeros(self._carried, dtype=np.int64)
        self.vector = np.zeros(0)
        self.squares = [np.zeros((0, 0)) for _ in range(self._squares)]

    def make_room(self, size: int) -> None:
        """Room for nodes of fewer states than `size`."""
        if size > len(self.vector):
            self.vector = _grown(self.vector, size)
            self.squares = [_grown(square, size) for square in self.squares]

    def run(self, *arrays: Any) -> int:
        """Go back over the nodes of a slice."""
        return int(self._kernel(self.carry, self.vector, *self.squares, *arrays))


class _Combination(_Smoothing):
    """Two filters: beside these the covariance and the transition of the node after."""

    _kernel: Any = staticmethod(two_filter.combine_nodes)
    _squares = 3
    _carried = 3


_METHODS: Final = {"rts": _Smoothing, "combination": _Combination}


def smooth_backwards(slices: Iterator[Columns], where: str, method: str = "rts") -> Spool:
    """Go back over all nodes of a run.

    Parameters
    ----------
    slices : iterator of Columns of `replay.FilterTransition`
        The last slice first.
    where : str
        For messages.
    method : str
        `rts` or `combination`.

    Raises
    ------
    DataError
        Where a node does not follow the one before it: the log lacks some.
    """
    spool = Spool()
    smoothing = _METHODS[method]()
    for nodes in slices:
        largest = max(nodes["dimension"].max(), nodes["dimension_before"].max())
        smoothing.make_room(1 + int(max(largest, smoothing.carry[0])))
        found = _room(nodes)
        parts = {
            name: (nodes.ragged(name).offsets, nodes.ragged(name).values)
            for name in ("predicted_upper_triangle", "correction", "updated_upper_triangle")
        }
        transition = (
            nodes.ragged("value").offsets,
            nodes.ragged("row").values.astype(np.int64),
            nodes.ragged("column").values.astype(np.int64),
            nodes.ragged("value").values,
        )
        code = smoothing.run(
            nodes.valid_time_ns, nodes["since_ns"],
            nodes["dimension_before"].astype(np.int64), nodes["dimension"].astype(np.int64),
            found.shown, transition, parts["predicted_upper_triangle"], parts["correction"],
            parts["updated_upper_triangle"], (found.error_starts, found.errors),
            (found.covariance_starts, found.covariances),
        )  # fmt: skip
        if code != smoother.OK:
            raise DataError(
                f"a node does not follow the one before it: {_WHY[code]}",
                where=f"{where}, log times {int(nodes.log_time_ns[0])} to "
                f"{int(nodes.log_time_ns[-1])} ns",
                mend="the run lacks rows: make it again",
            )
        spool.put(found)
    return spool


def _grown(array: Array, size: int) -> Array:
    larger = np.zeros((size,) * array.ndim)
    larger[tuple(slice(0, n) for n in array.shape)] = array
    return larger


def _room(nodes: Columns) -> Found:
    """Room for what is asked of each node: all of an update, navigation of other solutions."""
    dimension = nodes["dimension"].astype(np.int64)
    lengths = np.diff(nodes.ragged("correction").offsets)
    asked = nodes["solution"] != SILENT
    part = np.minimum(dimension, _NAVIGATION)
    shown = np.where(asked, np.where(lengths > 0, dimension, part), -1).astype(np.int64)
    error_starts = starts(np.where(asked, dimension, 0).astype(np.int64))
    covariance_starts = starts(np.where(asked, shown * (shown + 1) // 2, 0).astype(np.int64))
    return Found(
        shown,
        error_starts,
        np.zeros(error_starts[-1]),
        covariance_starts,
        np.zeros(covariance_starts[-1]),
    )
