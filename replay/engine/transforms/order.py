"""Rows that leave in the order of their log times although some of them were moved."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from replay.log.columns import Columns, concatenate
from replay.log.rows import compact


class Reordering:
    """Holds rows back until none can come before them.

    Parameters
    ----------
    offsets_ns : mapping of topic to int, ns
        Added to valid and log times of these channels.

    Attributes
    ----------
    moved : dict of topic to int
        Rows whose times were moved.
    """

    def __init__(self, offsets_ns: Mapping[str, int]) -> None:
        self._offsets_ns = dict(offsets_ns)
        self._back_ns = min([0, *offsets_ns.values()])
        self._waiting: dict[str, list[Columns]] = {}
        self.moved = dict.fromkeys(offsets_ns, 0)

    def apply(
        self, batch: Mapping[str, Columns], latest_ns: int, open_since_ns: int | None, open_at: str
    ) -> dict[str, Columns]:
        """Take rows and give those that can leave.

        Parameters
        ----------
        batch : mapping of topic to Columns
            As they were read, payloads alone.
        latest_ns : int
            Log time that all rows to come are after, before they are moved.
        open_since_ns : int or None
            Log time of a row to come that is not after it.
        open_at : str
            Topic of that row.
        """
        for topic, rows in batch.items():
            if len(rows):
                self._waiting.setdefault(topic, []).append(self._move(topic, rows))
        before = latest_ns + self._back_ns
        if open_since_ns is not None:
            before = min(before, open_since_ns + self._offsets_ns.get(open_at, 0))
        return self._take(before)

    def finish(self) -> dict[str, Columns]:
        """All that waits."""
        return self._take(None)

    def _move(self, topic: str, rows: Columns) -> Columns:
        offset_ns = self._offsets_ns.get(topic, 0)
        if offset_ns:
            self.moved[topic] += len(rows)
        return Columns(
            rows.log_time_ns + offset_ns,
            rows.valid_time_ns + offset_ns,
            rows.sequence,
            {},
            {},
            rows.payloads,
        )

    def _take(self, before_ns: int | None) -> dict[str, Columns]:
        taken: dict[str, Columns] = {}
        for topic in sorted(self._waiting):
            rows = concatenate(self._waiting.pop(topic))
            stop = len(rows)
            if before_ns is not None:
                stop = int(np.searchsorted(rows.log_time_ns, before_ns))
            if stop:
                taken[topic] = rows.take(slice(0, stop))
            if stop < len(rows):
                self._waiting[topic] = [_lean(rows.take(slice(stop, None)))]
        return taken


def _lean(rows: Columns) -> Columns:
    """The same rows without the bytes of those that left."""
    if rows.payloads is None:
        return rows
    return dataclasses.replace(rows, payloads=compact(rows.payloads))
