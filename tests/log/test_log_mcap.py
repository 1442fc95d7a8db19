"""The `mcap` package and Rerun read what we write; we read what `mcap` writes."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from log_samples import T0, assert_same, google_messages, random_columns, write_log
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType, IndexType, Writer
from mcap_protobuf.decoder import DecoderFactory

from replay.errors import SchemaError
from replay.log import records, schema
from replay.log.codec import codec_for
from replay.log.columns import Columns
from replay.log.describe import describe
from replay.log.reader import LogReader
from replay.log.recover import recover
from replay.log.writer import LogWriter

IMU, OBS, STATE = "/imu/raw", "/gnss/rover/obs", "/filter/a/state"


def sample(rows=400, seed=3):
    rng = np.random.default_rng(seed)
    kinds = {
        IMU: ("replay.ImuSample", 1),
        OBS: ("replay.GnssObservation", 7),
        STATE: ("replay.FilterState", 10),
    }
    return {
        topic: (name, random_columns(codec_for(name).layout, rows // step, rng, step=step * 5000))
        for topic, (name, step) in kinds.items()
    }


@pytest.mark.parametrize("compression", ["lz4", "zstd", "none"])
@pytest.mark.parametrize("chunk_bytes", [500, 8192, 1 << 20])
def test_mcap_reads_what_we_write(tmp_path, compression, chunk_bytes):
    channels = sample()
    path = tmp_path / "a.mcap"
    options = {"compression": compression, "chunk_bytes": chunk_bytes}
    with LogWriter(path, **options) as writer:
        for topic, (message, _) in channels.items():
            writer.add_channel(topic, message, depth=int(topic == STATE), metadata={"k": "v"})
        writer.add_channel("/truth", "replay.Truth")
        writer.add_metadata("run", {"b": "2", "a": "1"})
        writer.write({topic: columns for topic, (_, columns) in channels.items()})
        writer.add_attachment("igs.atx", b"xyz" * 50, media_type="text/plain", log_time_ns=T0)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        statistics = reader.get_summary().statistics
        assert statistics.message_count == sum(len(c) for _, c in channels.values())
        assert (statistics.channel_count, statistics.attachment_count) == (4, 1)
        rows = {topic: [] for topic in channels}
        for _, channel, message, decoded in reader.iter_decoded_messages():
            assert channel.metadata["k"] == "v"
            rows[channel.topic].append((message, decoded))
        assert [m.metadata["a"] for m in reader.iter_metadata()] == ["1"]
        assert [a.data for a in reader.iter_attachments()] == [b"xyz" * 50]
    for topic, (name, columns) in channels.items():
        assert [m.log_time for m, _ in rows[topic]] == columns.log_time_ns.tolist()
        assert [m.sequence for m, _ in rows[topic]] == columns.sequence.tolist()
        expected = google_messages(schema.descriptor(name), codec_for(name).layout, columns)
        for (_, decoded), message in zip(rows[topic], expected, strict=True):
            assert decoded.SerializeToString(deterministic=True) == message.SerializeToString(
                deterministic=True
            )
    with path.open("rb") as file:  # compares the checksum of the data section too
        assert sum(1 for _ in NonSeekingReader(file, validate_crcs=True).iter_messages()) > 0


OPTIONS = [
    {"compression": compression, "use_chunking": chunked, "index_types": index, **others}
    for compression, chunked, index, others in itertools.product(
        [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD],
        [True, False],
        [IndexType.ALL, IndexType.NONE],
        [
            {"enable_crcs": True, "enable_data_crcs": True},
            {"enable_crcs": False},
            {"repeat_channels": False, "repeat_schemas": False, "use_statistics": False},
        ],
    )
]


def write_foreign(path: Path, channels, *, order=None, **options):
    """The rows by the `mcap` package, in the order of time or as `order` shuffles them."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=4000, **options)
        writer.start()
        rows = []
        for topic, (name, columns) in channels.items():
            data = FileDescriptorSet.FromString(schema.descriptor_set(name)).SerializeToString()
            schema_id = writer.register_schema(name, "protobuf", data)
            channel_id = writer.register_channel(topic, "protobuf", schema_id)
            blobs = codec_for(name).encode(columns).blobs()
            times = zip(columns.log_time_ns, columns.valid_time_ns, columns.sequence, strict=True)
            rows += [(channel_id, *map(int, t), b) for t, b in zip(times, blobs, strict=True)]
        rows.sort(key=lambda row: row[1])
        if order is not None:
            rows = [rows[i] for i in order(len(rows))]
        for channel_id, log_time, publish_time, sequence, blob in rows:
            writer.add_message(channel_id, log_time, blob, publish_time, sequence)
        writer.add_metadata("about", {"x": "y"})
        writer.add_attachment(1, 2, "f", "text/plain", b"123")
        writer.finish()
    return path


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_we_read_what_mcap_writes(tmp_path, options):
    channels = sample()
    path = write_foreign(tmp_path / "a.mcap", channels, **options)
    for strict in (True, False):
        with LogReader(path, strict=strict) as reader:
            assert not reader.report
            assert list(reader.channels) == sorted(channels)
            assert (reader.start_ns, reader.end_ns) == (T0, channels[IMU][1].log_time_ns[-1])
            assert reader.metadata == {"about": {"x": "y"}}
            assert [a.data for a in reader.attachments] == [b"123"]
            for topic, (_, columns) in channels.items():
                assert reader.channels[topic].message_count == len(columns)
                assert_same(reader.read(topic), columns)


def test_chunks_that_overlap_are_merged(tmp_path):
    """Rows in any order over many chunks come out in the order of time, in all batch sizes."""
    channels = sample()

    def order(count):
        # Blocks of 50 rows change places, and rows within reach of 20.
        rng = np.random.default_rng(1)
        return np.argsort(np.arange(count) + rng.integers(0, 120, count))

    path = write_foreign(tmp_path / "a.mcap", channels, order=order)
    with LogReader(path) as reader:
        for topic, (_, columns) in channels.items():
            assert_same(reader.read(topic), columns)
        for target in (1, 17, 100, 10_000):
            last = -1
            for batch in reader.batches(target_rows=target):
                first = min(int(c.log_time_ns[0]) for c in batch.values())
                assert first > last
                last = max(int(c.log_time_ns[-1]) for c in batch.values())
        assert reader.digests() == digests_after_rewriting(path, tmp_path)


def digests_after_rewriting(path, tmp_path):
    out = tmp_path / "again.mcap"
    assert not recover(path, out)
    with LogReader(out) as reader:
        return reader.digests()


def raw_log(path: Path, parts: list[bytes]) -> Path:
    """A log of hand-made records, without summary and checksums."""
    end = records.record(records.DATA_END, bytes(4))
    footer = records.record(records.FOOTER, bytes(20))
    head = records.MAGIC + records.Header("", "hand").build()
    path.write_bytes(head + b"".join(parts) + end + footer + records.MAGIC)
    return path


def message(channel, log_time, data, sequence=0):
    head = channel.to_bytes(2, "little") + sequence.to_bytes(4, "little")
    return records.record(0x05, head + log_time.to_bytes(8, "little") * 2 + data)


def test_one_topic_on_two_channels_merges_and_unknown_records_are_skipped(tmp_path):
    columns = random_columns(codec_for("replay.ImuSample").layout, 6, np.random.default_rng(0))
    blobs = codec_for("replay.ImuSample").encode(columns).blobs()
    described = records.Schema(4, "replay.ImuSample", "protobuf",
                               schema.descriptor_set("replay.ImuSample"))  # fmt: skip
    parts = [records.record(0x7E, b"later version"), described.build()]
    parts += [records.Channel(i, 4, IMU, "protobuf", {"from": str(i)}).build() for i in (7, 9)]
    parts.append(records.record(0x81, b"private"))
    parts += [message(7 + 2 * (i % 2), T0 + i, blobs[i]) for i in (0, 2, 4, 1, 3, 5)]
    with LogReader(raw_log(tmp_path / "a.mcap", parts)) as reader:
        assert reader.channels[IMU].ids == (7, 9)
        assert reader.channels[IMU].message_count == 6
        got = reader.read(IMU, payloads=True)
        assert got.log_time_ns.tolist() == [T0 + i for i in range(6)]
        assert got.payloads.blobs() == blobs
        assert reader.structure.notes()


def test_one_topic_with_two_kinds_of_message_is_refused(tmp_path):
    parts = [
        records.Channel(1, 0, "/a", "json", {}).build(),
        records.Channel(2, 0, "/a", "cbor", {}).build(),
        message(1, 5, b"{}"),
        message(2, 6, b"x"),
    ]
    path = raw_log(tmp_path / "a.mcap", parts)
    with pytest.raises(SchemaError, match="two kinds"):
        LogReader(path)
    with LogReader(path, strict=False) as reader:
        assert reader.report.losses[0].count == 1
        assert reader.read("/a").payloads.blobs() == [b"{}"]


def test_what_is_no_protobuf_stays_payload_and_passes_through(tmp_path):
    texts = [json.dumps({"i": i}).encode() for i in range(5)]
    parts = [records.Schema(1, "S", "jsonschema", b"{}").build()]
    parts += [records.Channel(3, 1, "/j", "json", {"a": "b"}).build()]
    parts += [message(3, 10 + i, text, i) for i, text in enumerate(texts)]
    path = raw_log(tmp_path / "a.mcap", parts)
    out = tmp_path / "b.mcap"
    assert not recover(path, out)
    for log in (path, out):
        with LogReader(log) as reader:
            info = reader.channels["/j"]
            assert (info.schema_name, info.schema_data, info.metadata) == ("S", b"{}", {"a": "b"})
            got = reader.read("/j")
            assert got.values == {}
            assert got.payloads.blobs() == texts
            with pytest.raises(SchemaError, match="json"):
                next(reader.batches(decode=["/j"]))
    assert "json" in describe(out).channels[0].undecodable


def test_payloads_pass_through_untouched(tmp_path):
    """Foreign bytes that our encoder would write otherwise keep their digest."""
    zero = google_messages(
        schema.descriptor("replay.ImuSample"),
        codec_for("replay.ImuSample").layout,
        Columns.build([T0], {"angular_rate_body_rad_s": np.zeros((1, 3)),
                             "specific_force_body_m_s2": np.ones((1, 3)),
                             "temperature_c": np.zeros(1)},
                      present={"temperature_c": np.zeros(1, bool)}),
    )[0].SerializeToString()  # fmt: skip
    parts = [
        records.Schema(1, "replay.ImuSample", "protobuf",
                       schema.descriptor_set("replay.ImuSample")).build(),
        records.Channel(3, 1, IMU, "protobuf", {}).build(),
        message(3, T0, zero),
    ]  # fmt: skip
    with LogReader(raw_log(tmp_path / "a.mcap", parts)) as reader:
        digests = reader.digests()
        with LogWriter(tmp_path / "b.mcap") as writer:
            writer.add_channel(IMU, "replay.ImuSample")
            for batch in reader.batches(payloads=[IMU]):
                writer.write(batch)
            assert writer.digests() == digests
    with LogReader(tmp_path / "b.mcap") as reader:
        assert reader.digests() == digests
        assert reader.read(IMU, payloads=True).payloads.blobs() == [zero]


def test_rerun_accepts_a_log(tmp_path):
    path = write_log(tmp_path / "a.mcap", sample())
    rerun = Path(sys.executable).with_name("rerun")
    done = subprocess.run([rerun, "mcap", "info", path], capture_output=True, text=True, check=True)
    assert "replay.GnssObservation" in done.stdout
