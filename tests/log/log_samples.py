"""Rows to write and ways to compare what came back."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass

from replay.log.columns import Columns, Ragged
from replay.log.layout import Kind, Layout
from replay.log.writer import LogWriter

MESSAGES = [
    "replay.ImuSample",
    "replay.GnssFix",
    "replay.GnssObservation",
    "replay.FilterState",
    "replay.FilterCovariance",
    "replay.Innovation",
    "replay.FilterEvent",
    "replay.Solution",
    "replay.Truth",
    "replay.Trace",
    "replay.Checkpoint",
    "replay.ChannelDigest",
]
T0 = 1_300_000_000_000_000_000
ODD = np.array(
    [0x7FF8000000000001, 0xFFF0000000000000, 0x7FF4000000000123, 0x8000000000000000, 1, 0],
    dtype=np.uint64,
).view(np.float64)  # NaNs with payload bits, -inf, -0.0, the least subnormal, 0
TEXTS = ["", "a", "Grüße", "𝛼𝛽", "x" * 300]


def numbers(rng, dtype, shape):
    dtype = np.dtype(dtype)
    if dtype.kind == "b":
        return rng.integers(0, 2, shape).astype(bool)
    if dtype.kind == "f":
        values = rng.standard_normal(shape).astype(dtype)
        odd = rng.random(shape) < 0.2
        with np.errstate(invalid="ignore"):  # a signalling NaN as float32
            values[odd] = rng.choice(ODD, odd.sum()).astype(dtype)
        return values
    info = np.iinfo(dtype)
    values = rng.integers(info.min, info.max, shape, dtype=dtype, endpoint=True)
    small = rng.random(shape) < 0.5
    values[small] = rng.integers(0, 3, small.sum())
    return values


def random_columns(layout: Layout, count: int, rng, *, start=T0, step=5_000_000) -> Columns:
    values, present = {}, {}
    for field in layout.fields:
        if field.kind is Kind.SCALAR:
            column = numbers(rng, field.dtype, count)
        elif field.kind is Kind.VECTOR:
            column = numbers(rng, field.dtype, (count, len(field.components)))
        elif field.kind is Kind.TEXT:
            letters = rng.integers(48, 91, (count, field.dtype.itemsize)).astype(np.uint8)
            column = letters.view(field.dtype).reshape(-1)
        elif field.kind is Kind.REPEATED:
            lengths = rng.integers(0, 5, count)
            offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
            column = Ragged(offsets, numbers(rng, field.dtype, int(offsets[-1])))
        elif field.utf8:
            column = Ragged.from_texts([TEXTS[i] for i in rng.integers(0, len(TEXTS), count)])
        else:
            column = Ragged.from_blobs([rng.bytes(k) for k in rng.integers(0, 200, count)])
        if field.optional:
            mask = rng.random(count) < rng.choice([0.0, 0.5, 1.0])
            present[field.name] = mask
            if isinstance(column, np.ndarray):
                column[~mask] = np.nan if column.dtype.kind == "f" else 0
            else:
                rows = zip(column.blobs(), mask, strict=True)
                column = Ragged.from_blobs([blob if there else b"" for blob, there in rows])
        values[field.name] = column
    valid = start + np.arange(count, dtype=np.int64) * step
    return Columns.build(valid, values, present=present)


def same_column(a, b) -> bool:
    if isinstance(a, Ragged):
        return a.blobs() == b.blobs() and a.values.dtype == b.values.dtype
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def assert_same(a: Columns, b: Columns) -> None:
    """Equal to the last bit, NaN payloads included."""
    for name in ("log_time_ns", "valid_time_ns", "sequence"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name
    assert a.values.keys() == b.values.keys()
    for name, column in a.values.items():
        assert same_column(column, b.values[name]), name
        assert np.array_equal(a.is_present(name), b.is_present(name)), name


def google_messages(descriptor, layout: Layout, columns: Columns) -> list[Message]:
    """The same rows as protobuf's own objects."""
    made = []
    for row in range(len(columns)):
        message = GetMessageClass(descriptor)()
        for field in layout.fields:
            if not columns.is_present(field.name)[row]:
                continue
            column = columns.values[field.name]
            if field.kind is Kind.VECTOR:
                nested = getattr(message, field.name)
                nested.SetInParent()
                names = sorted(nested.DESCRIPTOR.fields, key=lambda f: f.number)
                for inner, value in zip(names, column[row], strict=True):
                    setattr(nested, inner.name, float(value))
            elif field.kind is Kind.REPEATED:
                getattr(message, field.name).extend(column.row(row).tolist())
            elif field.kind is Kind.TEXT:
                setattr(message, field.name, column[row].decode())
            elif field.kind is Kind.BYTES:
                blob = column.row(row).tobytes()
                setattr(message, field.name, blob.decode() if field.utf8 else blob)
            else:
                setattr(message, field.name, column[row].item())
        made.append(message)
    return made


def write_log(path: Path, channels: Mapping[str, tuple[str, Columns]], **options) -> Path:
    with LogWriter(path, **options) as writer:
        for topic, (message, _) in channels.items():
            writer.add_channel(topic, message)
        writer.write({topic: columns for topic, (_, columns) in channels.items()})
    return path
