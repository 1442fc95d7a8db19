"""Reads a recording back, entity by entity."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pyarrow as pa
from rerun.chunk import RrdReader

from replay.time import to_datetime64


@dataclasses.dataclass
class Entity:
    """What a recording holds at one path."""

    times_ns: np.ndarray  # Unix-like nanoseconds of the timeline
    columns: dict[str, pa.ChunkedArray]
    static: dict[str, pa.Array]

    def values(self, name: str) -> np.ndarray:
        """Numbers of a component, end to end."""
        array = self.columns[name].combine_chunks()
        while not pa.types.is_primitive(array.type):
            array = array.flatten()
        return array.to_numpy(zero_copy_only=False)


def read_back(path: Path) -> dict[str, Entity]:
    """Entities of a recording by path; fails where a timeline is not ours."""
    temporal: dict[str, list[pa.RecordBatch]] = {}
    static: dict[str, dict[str, pa.Array]] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if chunk.is_static:
            names = [n for n in batch.schema.names if ":" in n]
            static.setdefault(chunk.entity_path, {}).update({n: batch[n] for n in names})
        else:
            assert list(chunk.timeline_names) == ["gps_time"]
            temporal.setdefault(chunk.entity_path, []).append(batch)
    out = {}
    for name in sorted({*temporal, *static}):
        batches = temporal.get(name, [])
        columns = {
            n: pa.chunked_array([b[n] for b in batches])
            for n in (batches[0].schema.names if batches else [])
            if ":" in n
        }
        times = [b["gps_time"].cast(pa.int64()).to_numpy() for b in batches]
        out[name] = Entity(
            np.concatenate(times) if times else np.empty(0, np.int64),
            columns,
            static.get(name, {}),
        )
    return out


def unix_like(times_ns: np.ndarray) -> np.ndarray:
    """What the recording should hold for GPS nanoseconds."""
    return to_datetime64(times_ns).astype(np.int64)
