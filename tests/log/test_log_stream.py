"""Order, batches and memory."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_samples import T0, assert_same, random_columns, write_log
from mcap.reader import make_reader

from replay import channels as table
from replay.errors import DataError, LogError, MissingChannelError
from replay.log.codec import codec_for
from replay.log.columns import Columns, Ragged, concatenate
from replay.log.reader import LogReader
from replay.log.writer import LogWriter

KINDS = {
    "/imu/raw": ("replay.ImuSample", 0),
    "/gnss/rover/obs": ("replay.GnssObservation", 0),
    "/filter/a/state": ("replay.FilterState", 2),
    "/solution/a": ("replay.Solution", 1),
}


def ties(seed, rows=60):
    """Rows with many equal log times, within channels and between them."""
    rng = np.random.default_rng(seed)
    made = {}
    for topic, (name, _) in KINDS.items():
        columns = random_columns(codec_for(name).layout, rows, rng)
        log = np.sort(T0 + rng.integers(0, 25, rows))
        made[topic] = Columns.build(
            columns.valid_time_ns, columns.values, log_time_ns=log, present=columns.present
        )
    return made


def write(path, made, pieces=1, **options):
    """Write in pieces of log time, so that calls share a log time where pieces meet."""
    with LogWriter(path, **options) as writer:
        for topic, (name, depth) in KINDS.items():
            writer.add_channel(topic, name, depth=depth)
        edges = [T0 + 25 * k // pieces for k in range(pieces + 1)]
        for a, b in itertools.pairwise(edges):
            writer.write(
                {t: c.take((c.log_time_ns >= a) & (c.log_time_ns < b)) for t, c in made.items()}
            )
    return path


@pytest.mark.parametrize("pieces", [1, 2, 9])
@pytest.mark.parametrize("chunk_bytes", [300, 1 << 20])
def test_rows_stand_in_the_total_order(tmp_path, pieces, chunk_bytes):
    path = write(tmp_path / "a.mcap", ties(0), pieces, chunk_bytes=chunk_bytes)
    with path.open("rb") as file:
        rows = [
            (m.log_time, KINDS[c.topic][1], table.rank(c.topic), c.topic, m.sequence)
            for _, c, m in make_reader(file).iter_messages(log_time_order=False)
        ]
    assert rows == sorted(rows)
    assert len(rows) == 240


def test_rows_of_one_log_time_by_several_calls_are_put_in_order(tmp_path):
    made = ties(1)
    with LogWriter(tmp_path / "a.mcap") as writer:
        for topic, (name, depth) in KINDS.items():
            writer.add_channel(topic, name, depth=depth)
        for when in range(T0, T0 + 25):
            for topic in reversed(KINDS):
                rows = made[topic].take(made[topic].log_time_ns == when)
                writer.write({topic: rows.take(slice(None, None, -1))})
    whole = write(tmp_path / "b.mcap", made)
    assert whole.read_bytes() == (tmp_path / "a.mcap").read_bytes()


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), st.integers(1, 400), st.integers(200, 20000), st.data())
def test_batches_joined_are_the_whole(tmp_path_factory, seed, target, chunk_bytes, data):
    made = ties(seed)
    path = write(tmp_path_factory.mktemp("s") / "a.mcap", made, chunk_bytes=chunk_bytes)
    start = data.draw(st.none() | st.integers(T0 - 1, T0 + 26))
    end = data.draw(st.none() | st.integers(T0 - 1, T0 + 26))
    topics = data.draw(st.none() | st.lists(st.sampled_from(sorted(KINDS)), unique=True))
    parts = {topic: [] for topic in KINDS}
    last = -1
    with LogReader(path) as reader:
        for batch in reader.batches(topics, start_ns=start, end_ns=end, target_rows=target):
            times = np.concatenate([columns.log_time_ns for columns in batch.values()])
            assert list(batch) == sorted(batch)
            assert times.min() > last
            # More rows than asked for only where they are all of one log time.
            assert len(times) <= target or times.min() == times.max()
            last = times.max()
            for topic, columns in batch.items():
                parts[topic].append(columns)
    for topic, whole in made.items():
        inside = np.ones(len(whole), dtype=bool)
        if start is not None:
            inside &= whole.log_time_ns >= start
        if end is not None:
            inside &= whole.log_time_ns < end
        if topics is not None and topic not in topics:
            inside[:] = False
        if inside.any():
            assert_same(concatenate(parts[topic]), whole.take(inside))
        else:
            assert not parts[topic]


def test_reading_holds_a_few_chunks_at_a_time(tmp_path):
    """Rows that wait inside the reader are bounded by batch and chunk, not by the log."""
    columns = random_columns(codec_for("replay.ImuSample").layout, 40_000, np.random.default_rng(0))
    channels = {"/imu/raw": ("replay.ImuSample", columns)}
    path = write_log(tmp_path / "a.mcap", channels, chunk_bytes=50_000)
    with LogReader(path) as reader:
        opened = []
        load = reader._load
        reader._load = lambda block: opened.append(block) or load(block)
        done = 0
        for batch in reader.batches(target_rows=1000):
            done += len(batch["/imu/raw"])
            assert len(opened) * 500 <= done + 3000
        assert done == 40_000
        assert len(opened) == len(reader.structure.blocks)


def test_only_chunks_of_the_window_are_opened(tmp_path):
    columns = random_columns(codec_for("replay.ImuSample").layout, 5000, np.random.default_rng(0))
    channels = {"/imu/raw": ("replay.ImuSample", columns)}
    path = write_log(tmp_path / "a.mcap", channels, chunk_bytes=20_000)
    with LogReader(path) as reader:
        opened = []
        load = reader._load
        reader._load = lambda block: opened.append(block) or load(block)
        start, end = int(columns.log_time_ns[2000]), int(columns.log_time_ns[2100])
        assert_same(
            reader.read("/imu/raw", start_ns=start, end_ns=end), columns.take(slice(2000, 2100))
        )
        assert len(opened) <= 2


def test_an_empty_log_and_an_empty_channel(tmp_path):
    with LogWriter(tmp_path / "a.mcap"):
        pass
    with LogReader(tmp_path / "a.mcap") as reader:
        assert not reader.channels
        assert list(reader.batches()) == []
        assert (reader.start_ns, reader.end_ns) == (0, 0)
    with LogWriter(tmp_path / "b.mcap") as writer:
        writer.add_channel("/imu/raw", "replay.ImuSample", depth=3, metadata={"a": "b"})
    with LogReader(tmp_path / "b.mcap") as reader:
        info = reader.channels["/imu/raw"]
        assert (info.depth, info.metadata, info.message_count) == (3, {"a": "b"}, 0)
        empty = reader.read("/imu/raw")
        assert len(empty) == 0
        assert empty["angular_rate_body_rad_s"].shape == (0, 3)


def test_a_channel_announced_late_changes_no_span(tmp_path):
    columns = random_columns(codec_for("replay.ImuSample").layout, 9, np.random.default_rng(0))
    with LogWriter(tmp_path / "a.mcap", chunk_bytes=400) as writer:
        writer.add_channel("/imu/raw", "replay.ImuSample")
        writer.write({"/imu/raw": columns})
        writer.digests()
        writer._flush_chunk()
        writer.add_channel("/truth", "replay.Truth")
    with LogReader(tmp_path / "a.mcap") as reader:
        assert list(reader.channels) == ["/imu/raw", "/truth"]
        assert (reader.start_ns, reader.end_ns) == (T0, int(columns.log_time_ns[-1]))
        assert_same(reader.read("/imu/raw"), columns)


def test_digests_of_writer_and_reader_agree(tmp_path):
    made = ties(4)
    path = tmp_path / "a.mcap"
    with LogWriter(path, compression="none", chunk_bytes=700) as writer:
        for topic, (name, depth) in KINDS.items():
            writer.add_channel(topic, name, depth=depth)
        writer.write(made)
        digests = writer.digests()
        assert digests["/imu/raw"].message_count == 60
    other = write(tmp_path / "b.mcap", made, pieces=5)
    for log in (path, other):
        with LogReader(log) as reader:
            assert reader.digests() == digests


def test_log_time_may_not_go_backward(tmp_path):
    columns = random_columns(codec_for("replay.ImuSample").layout, 10, np.random.default_rng(0))
    with LogWriter(tmp_path / "a.mcap") as writer:
        writer.add_channel("/imu/raw", "replay.ImuSample")
        with pytest.raises(DataError, match=r"backward(.|\n)*/imu/raw, row 1, 2021"):
            writer.write({"/imu/raw": columns.take(np.array([1, 0]))})
        writer.write({"/imu/raw": columns.take(slice(5, 6))})
        with pytest.raises(DataError, match="backward"):
            writer.write({"/imu/raw": columns.take(slice(4, 5))})
        writer.write({"/imu/raw": columns.take(slice(5, 6))})  # the same time is in order


def test_a_failed_write_leaves_no_file(tmp_path):
    path = tmp_path / "a.mcap"
    with pytest.raises(MissingChannelError, match="/imu/raw"), LogWriter(path) as writer:
        writer.add_channel("/imu/raw", "replay.ImuSample")
        writer.write({"/imu/rav": ties(0)["/imu/raw"]})
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(LogError, match="written"):
        LogWriter(tmp_path / "no" / "a.mcap")


def test_a_message_larger_than_a_chunk_is_written(tmp_path):
    blobs = [b"x" * 5000, b"", b"y" * 70_000, b"z"]
    columns = Columns.build(
        [1, 2, 3, 4],
        {
            "stage": np.array([b"a"] * 4),
            "step": np.arange(4),
            "state": Ragged.from_blobs(blobs),
        },
    )
    channels = {"/replay/checkpoint": ("replay.Checkpoint", columns)}
    path = write_log(tmp_path / "a.mcap", channels, chunk_bytes=1000)
    with LogReader(path) as reader:
        assert reader.read("/replay/checkpoint").ragged("state").blobs() == blobs
        assert len(reader.structure.blocks) == 4
