"""Damage: every whole message comes back, nothing wrong does, and the loss is told."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from log_samples import T0, random_columns, write_log
from mcap.writer import CompressionType, IndexType
from test_log_mcap import write_foreign

from replay.errors import CorruptLogError, ExitCode, LogError, UsageError
from replay.log.codec import codec_for
from replay.log.reader import LogReader
from replay.log.recover import diagnose, recover
from replay.log.writer import LogWriter

KINDS = {
    "/imu/raw": ("replay.ImuSample", 40, 1),
    "/gnss/rover/obs": ("replay.GnssObservation", 20, 2),
    "/filter/a/events": ("replay.FilterEvent", 8, 5),
}
CASES = 150  # per kind of file


def sample():
    rng = np.random.default_rng(5)
    return {
        topic: (name, random_columns(codec_for(name).layout, rows, rng, step=step * 1000))
        for topic, (name, rows, step) in KINDS.items()
    }


@functools.cache
def whole(kind: str, folder) -> tuple[bytes, list[tuple[int, int, dict]], dict]:
    """File, its chunks (offset, end, payloads per topic) and all rows per topic."""
    path = folder / f"{kind}.mcap"
    channels = sample()
    if kind.startswith("mcap"):
        _, compression, crc = kind.split("-")
        bare = {"index_types": IndexType.NONE, "use_statistics": False, "repeat_channels": False}
        write_foreign(
            path,
            channels,
            compression=CompressionType[compression],
            enable_data_crcs=crc == "data",
            use_chunking=crc != "data",
            **(bare if crc == "bare" else {}),
        )
    else:
        with LogWriter(path, compression=kind, chunk_bytes=1500) as writer:
            for topic, (name, _) in channels.items():
                writer.add_channel(topic, name)
            writer.add_metadata("first", {"a": "1"})
            for a, b in ((T0, T0 + 10_000), (T0 + 10_000, T0 + 50_000)):
                writer.write(
                    {
                        topic: columns.take((columns.log_time_ns >= a) & (columns.log_time_ns < b))
                        for topic, (_, columns) in channels.items()
                    }
                )
                writer.digests()
            writer.add_attachment("f", b"123" * 40, media_type="text/plain")
            writer.add_metadata("last", {"b": "2"})
    with LogReader(path) as reader:
        rows = all_rows(reader)
        chunks = []
        for block in reader.structure.blocks:
            if block.head is not None:
                loaded = reader._load(block)
                ids = {i: t for t, info in reader.channels.items() for i in info.ids}
                inside = {}
                for i, blob in zip(loaded.channel, loaded.rows.payloads.blobs(), strict=True):
                    inside.setdefault(ids[int(i)], []).append(blob)
                chunks.append((block.offset, block.offset + block.length, inside))
    return path.read_bytes(), chunks, rows


def all_rows(reader) -> dict[str, list[tuple]]:
    found = {topic: [] for topic in reader.channels}
    for batch in reader.batches(decode=(), payloads=list(reader.channels), target_rows=7):
        for topic, c in batch.items():
            times = zip(c.log_time_ns.tolist(), c.valid_time_ns.tolist(), strict=True)
            found[topic] += list(zip(times, c.payloads.blobs(), strict=True))
    return found


def is_subsequence(part, of) -> bool:
    rest = iter(of)
    return all(row in rest for row in part)


def damage(data: bytes, kind: str, rng) -> tuple[bytes, int, int]:
    """Damaged bytes, and between which bytes they differ from the whole."""
    at = int(rng.integers(0, len(data)))
    changed = bytearray(data)
    if kind == "cut":
        return data[:at], at, len(data)
    if kind == "flip":
        changed[at] ^= 1 << rng.integers(0, 8)
        return bytes(changed), at, at + 1
    end = min(len(data), at + int(rng.integers(1, 400)))
    changed[at:end] = bytes(end - at) if kind == "zeros" else rng.bytes(end - at)
    return bytes(changed), at, end


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("damage")


@pytest.mark.parametrize("how", ["cut", "flip", "zeros", "noise"])
@pytest.mark.parametrize("kind", ["lz4", "zstd", "none", "mcap-LZ4-chunks", "mcap-NONE-data"])
def test_damage(folder, kind, how):
    data, chunks, truth = whole(kind, folder)
    rng = np.random.default_rng([len(kind), len(how)])
    path, out = folder / "damaged.mcap", folder / "recovered.mcap"
    total = sum(map(len, truth.values()))
    for _ in range(CASES):
        broken, begin, end = damage(data, how, rng)
        if broken == data:
            continue
        path.write_bytes(broken)
        try:
            with LogReader(path) as reader:
                # Damage that strict reading does not see changes no row.
                assert all_rows(reader) == truth, (begin, end)
        except CorruptLogError as error:
            assert str(path) in str(error), begin
            assert "byte " in str(error)
            assert "replay recover" in str(error)
        try:
            report = recover(path, out)
        except CorruptLogError:
            assert begin < 8, begin
            continue
        with LogReader(out) as reader:
            assert not reader.report
            rows = all_rows(reader)
            for record in reader.metadata_records:
                assert record.values in ({"a": "1"}, {"b": "2"}, {"x": "y"}) or kind[:4] == "mcap"
            assert all(a.data in (b"123" * 40, b"123") for a in reader.attachments)
        for topic, got in rows.items():
            assert is_subsequence(got, truth[topic]), (begin, end, topic)
        for offset, chunk_end, inside in chunks:
            if chunk_end <= begin or (offset >= end and how != "cut"):
                if kind.startswith("mcap") and begin < chunks[0][1]:
                    continue  # the definitions of all channels stand in the first chunk alone
                for topic, blobs in inside.items():
                    assert is_subsequence(blobs, [blob for _, blob in rows[topic]]), (begin, end)
        if not report:
            assert sum(map(len, rows.values())) == total, (begin, end)


@pytest.mark.parametrize("how", ["cut", "flip", "zeros", "noise"])
def test_damage_without_any_summary(folder, how):
    """Nothing counts the chunks here, so a lost one may go unseen; no row is wrong for that."""
    data, _, truth = whole("mcap-ZSTD-bare", folder)
    rng = np.random.default_rng(len(how))
    path = folder / "damaged.mcap"
    for _ in range(CASES):
        path.write_bytes(damage(data, how, rng)[0])
        for strict in (True, False):
            try:
                with LogReader(path, strict=strict) as reader:
                    for topic, got in all_rows(reader).items():
                        assert is_subsequence(got, truth[topic])
            except CorruptLogError as error:
                assert "byte " in str(error)


def test_every_single_bit_of_a_small_log(folder):
    """No bit of a log of ours can be flipped without being seen or without harm."""
    channels = {"/imu/raw": ("replay.ImuSample", sample()["/imu/raw"][1].take(slice(0, 4)))}
    path = write_log(folder / "small.mcap", channels, compression="none", chunk_bytes=120)
    data = path.read_bytes()
    with LogReader(path) as reader:
        truth = all_rows(reader)
    broken = folder / "broken.mcap"
    for at in range(0, len(data), 3):
        changed = bytearray(data)
        changed[at] ^= 1 << (at // 3 % 8)
        broken.write_bytes(changed)
        with pytest.raises(CorruptLogError):
            LogReader(broken)
        with LogReader(broken, strict=False) as reader:
            assert reader.report.exit_code == ExitCode.LOSS
            got = all_rows(reader)
        assert is_subsequence(got["/imu/raw"], truth["/imu/raw"])
        # One chunk at most is lost to one bit.
        assert len(got["/imu/raw"]) >= 3


def test_a_log_cut_inside_an_attached_log_does_not_yield_that_log(tmp_path):
    inner = write_log(tmp_path / "inner.mcap", sample(), chunk_bytes=1000).read_bytes()
    outer = tmp_path / "outer.mcap"
    with LogWriter(outer, compression="none") as writer:
        writer.add_channel("/imu/raw", "replay.ImuSample")
        writer.write({"/imu/raw": sample()["/imu/raw"][1].take(slice(0, 5))})
        writer.digests()
        writer._flush_chunk()
        writer.add_attachment("inner", inner, media_type="application/mcap")
    data = outer.read_bytes()
    at = data.index(inner)
    for cut in range(at - 20, len(data), 97):
        (tmp_path / "cut.mcap").write_bytes(data[:cut])
        with LogReader(tmp_path / "cut.mcap", strict=False) as reader:
            assert reader.report
            assert list(reader.channels) == ["/imu/raw"]
            assert len(reader.read("/imu/raw")) == 5


@pytest.mark.parametrize("summary", [True, False])
def test_a_length_that_leads_past_a_chunk_does_not_lose_it(tmp_path, summary):
    path = write_log(tmp_path / "a.mcap", sample(), chunk_bytes=1500)
    with LogReader(path) as reader:
        truth = all_rows(reader)
        first, second = reader.structure.blocks[:2]
    data = bytearray(path.read_bytes())
    index = first.offset + first.length
    beyond = second.offset + second.length
    data[index + 1 : index + 9] = (beyond - index - 9).to_bytes(8, "little")
    path.write_bytes(data if summary else data[:-50])
    with LogReader(path, strict=False) as reader:
        assert reader.report
        assert all_rows(reader) == truth


def test_the_report_names_bytes_times_and_count(tmp_path):
    path = write_log(tmp_path / "a.mcap", sample(), chunk_bytes=1500)
    with LogReader(path) as reader:
        block = reader.structure.blocks[2]
        count = len(reader._load(block).channel)
        before = reader.structure.blocks[1]
    data = bytearray(path.read_bytes())
    data[block.offset + 80] ^= 1
    path.write_bytes(data)
    with pytest.raises(CorruptLogError, match=f"byte {block.offset}, last good log time 2021-03"):
        LogReader(path)
    report = recover(path, tmp_path / "b.mcap")
    (loss,) = report.losses
    assert (loss.count, loss.unit) == (count, "messages")
    assert f"bytes {block.offset} to {block.offset + block.length}" in loss.where
    assert "2021-03" in loss.where
    assert before.end_ns >= T0
    health = diagnose(path)
    assert health.exit_code == ExitCode.LOSS
    assert sum(health.message_counts.values()) == 68 - count
    assert diagnose(tmp_path / "b.mcap").exit_code == ExitCode.OK


@pytest.mark.parametrize("content", [b"", b"\x89MC", b"no log at all" * 100, bytes(5000)])
def test_what_is_no_log_is_said_to_be_none(tmp_path, content):
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    for strict in (True, False):
        with pytest.raises(CorruptLogError, match="no MCAP"):
            LogReader(path, strict=strict)
    with pytest.raises(LogError, match="cannot be read"):
        LogReader(tmp_path / "none.mcap")


def test_a_log_is_not_recovered_onto_itself(tmp_path):
    path = write_log(tmp_path / "a.mcap", sample())
    with pytest.raises(UsageError):
        recover(path, path)


def test_checksums_can_be_left_alone(tmp_path):
    path = write_log(tmp_path / "a.mcap", sample(), compression="none")
    data = bytearray(path.read_bytes())
    data[200] ^= 1
    path.write_bytes(data)
    with LogReader(path, check_crc=False) as reader:
        assert len(reader.read("/imu/raw")) == 40
