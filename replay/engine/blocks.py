"""Rows in blocks: the first ones of a channel, merged ones, those up to a time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from replay.log.columns import Columns, concatenate
from replay.log.reader import LogReader

Batch = Mapping[str, Columns]
_HEAD_ROWS: Final = 1024


def head(reader: LogReader, topic: str, rows: int = _HEAD_ROWS) -> Columns:
    """The first rows of a channel, the same however the log is cut."""
    parts: list[Columns] = []
    count = 0
    for batch in reader.batches([topic], target_rows=rows):
        if topic in batch:
            parts.append(batch[topic])
            count += len(batch[topic])
        if count >= rows:
            break
    if not parts:
        return Columns.build([], {})
    first = parts[0] if len(parts) == 1 else merge_rows(parts)
    return first.take(slice(0, rows))


def merge_rows(parts: list[Columns]) -> Columns:
    """Rows of all parts by log time, those of one time in the order of the parts."""
    joined = parts[0] if len(parts) == 1 else concatenate(parts)
    order = np.argsort(joined.log_time_ns, kind="stable").astype(np.int64)
    return joined.take(order)


def until(batch: Batch, at_ns: int, *, included: bool) -> dict[str, Columns]:
    """Rows up to a log time, or those after it."""
    result: dict[str, Columns] = {}
    for topic, rows in batch.items():
        cut = int(np.searchsorted(rows.log_time_ns, at_ns, side="right"))
        part = rows.take(slice(0, cut)) if included else rows.take(slice(cut, None))
        if len(part):
            result[topic] = part
    return result
