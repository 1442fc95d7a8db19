"""Blocks of a log to rows in the order of time, in bounded memory.

A block is opened when the rows before its first log time are wanted, and its
rows wait until no block that is still closed can hold an earlier one. Where
blocks do not overlap in time, which is so in every log of this project, one
block at a time is open.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from replay.log.rows import Rows, join_rows
from replay.log.source import Block, Loaded

Pieces = dict[str, list[Rows]]
_FAR = (1 << 63) - 1


class _Pool:
    """Rows that wait, per topic in pieces of ordered rows."""

    def __init__(self) -> None:
        self._pieces: Pieces = {}

    def add(self, topic: str, rows: Rows) -> None:
        if len(rows):
            self._pieces.setdefault(topic, []).append(rows.ordered())

    def _ready(self, before_ns: int) -> list[npt.NDArray[np.int64]]:
        times = (rows.log_time_ns for pieces in self._pieces.values() for rows in pieces)
        return [t if t[-1] < before_ns else t[: np.searchsorted(t, before_ns)] for t in times]

    def cut(self, before_ns: int, target_rows: int, *, final: bool) -> int | None:
        """Log time before which the next batch ends, or None where too few rows are ready.

        The batch gets as many whole log times as fit into `target_rows`, or one.
        """
        ready = self._ready(before_ns)
        count = sum(len(times) for times in ready)
        if count <= target_rows:
            return before_ns if final and count else None
        times = np.concatenate(ready)
        # The row that no longer fits: its log time is left for the next batch, unless
        # it is the first one's too.
        beyond = int(np.partition(times, target_rows)[target_rows])
        return beyond if (times < beyond).any() else beyond + 1

    def take(self, before_ns: int) -> Pieces:
        """Rows before a log time, out of the pool."""
        taken: Pieces = {}
        for topic in sorted(self._pieces):
            rest: list[Rows] = []
            for rows in self._pieces[topic]:
                stop = int(np.searchsorted(rows.log_time_ns, before_ns))
                if stop:
                    whole = stop == len(rows)
                    taken.setdefault(topic, []).append(rows if whole else rows.take(slice(stop)))
                if stop < len(rows):
                    rest.append(rows.take(slice(stop, None)) if stop else rows)
            self._pieces[topic] = rest
        return {topic: in_order(pieces) for topic, pieces in taken.items()}


def in_order(pieces: list[Rows]) -> list[Rows]:
    """Pieces of one topic such that they follow each other; joined only where they overlap."""
    for earlier, later in itertools.pairwise(pieces):
        end = (int(earlier.log_time_ns[-1]), int(earlier.sequence[-1]))
        if end > (int(later.log_time_ns[0]), int(later.sequence[0])):
            return [join_rows(pieces).ordered()]
    return pieces


def stream(
    blocks: Sequence[Block],
    load: Callable[[Block], Loaded | None],
    topic_of: Mapping[int, str],
    *,
    start_ns: int | None,
    end_ns: int | None,
    target_rows: int,
) -> Iterator[Pieces]:
    """Rows of the wanted topics, batch by batch.

    Parameters
    ----------
    blocks : sequence of Block
        Any order.
    load : callable
        Messages of a block, or None where it is damaged and that has been reported.
    topic_of : mapping of channel id to topic
        The channels that are wanted.
    start_ns, end_ns : int or None
        Log times, half open.
    target_rows : int
        Rows of a batch, of all topics together.

    Yields
    ------
    Pieces
        Every row precedes those of the next batch by log time.
    """
    begin = 0 if start_ns is None else start_ns
    end = _FAR if end_ns is None else end_ns
    wanted = frozenset(topic_of)
    waiting = sorted(
        (
            block
            for block in blocks
            if block.end_ns >= begin
            and block.start_ns < end
            and (block.channels is None or block.channels & wanted)
        ),
        key=lambda block: (block.start_ns, block.offset),
    )
    table, topics = _topic_table(topic_of)
    pool = _Pool()
    for number, block in enumerate(waiting):
        loaded = load(block)
        if loaded is not None:
            for topic, rows in _split(loaded, table, topics):
                pool.add(topic, _window(rows, begin, end))
        final = number == len(waiting) - 1
        floor = _FAR if final else waiting[number + 1].start_ns
        while (cut := pool.cut(floor, target_rows, final=final)) is not None:
            yield pool.take(cut)


def _topic_table(topic_of: Mapping[int, str]) -> tuple[npt.NDArray[np.int32], list[str]]:
    """Channel id to place in the list of topics, -1 for those that are not wanted."""
    topics = sorted(set(topic_of.values()))
    place = {topic: k for k, topic in enumerate(topics)}
    table = np.full(1 << 16, -1, dtype=np.int32)
    for channel_id, topic in topic_of.items():
        table[channel_id] = place[topic]
    return table, topics


def _split(
    loaded: Loaded, table: npt.NDArray[np.int32], topics: Sequence[str]
) -> Iterator[tuple[str, Rows]]:
    channel = loaded.channel
    if len(channel) == 0:
        return
    if (channel == channel[0]).all():
        if table[channel[0]] >= 0:
            yield topics[table[channel[0]]], loaded.rows
        return
    places = table[channel]
    order = np.argsort(places, kind="stable").astype(np.int64)
    places = places[order]
    starts = np.flatnonzero(np.diff(places, prepend=-2))
    for start, stop in zip(starts, [*starts[1:], len(places)], strict=True):
        if places[start] >= 0:
            yield topics[places[start]], loaded.rows.take(order[start:stop])


def _window(rows: Rows, begin: int, end: int) -> Rows:
    times = rows.log_time_ns
    inside = (times >= begin) & (times < end)
    return rows if inside.all() else rows.take(np.flatnonzero(inside))
