"""What is odd in a log that is whole: named, counted, never silent."""

from __future__ import annotations

import numpy as np
import pytest
from log_samples import MESSAGES, T0, random_columns, write_log
from test_log_mcap import message, raw_log

from replay.errors import CorruptLogError, DataError, LogError, MissingChannelError, SchemaError
from replay.log import records, schema
from replay.log.codec import codec_for
from replay.log.columns import Columns, Ragged
from replay.log.describe import describe
from replay.log.reader import LogReader
from replay.log.recover import diagnose
from replay.log.writer import LogWriter


def imu(valid, **changes):
    count = len(valid)
    log = T0 + np.arange(count)
    values = {
        "angular_rate_body_rad_s": np.arange(3 * count, dtype=float).reshape(count, 3),
        "specific_force_body_m_s2": np.zeros((count, 3)),
    }
    return Columns.build(T0 + np.asarray(valid), values | changes, log_time_ns=log)


def described(tmp_path, columns):
    path = write_log(tmp_path / "a.mcap", {"/imu/raw": ("replay.ImuSample", columns)})
    return describe(path).channels[0]


def test_a_missing_channel_names_the_nearest(tmp_path):
    path = write_log(tmp_path / "a.mcap", {"/imu/raw": ("replay.ImuSample", imu([0]))})
    with LogReader(path) as reader:
        for read in (
            lambda: reader.read("/imu/row"),
            lambda: next(reader.batches(["/imu/row"])),
            lambda: next(reader.batches(decode=["/imu/row"])),
            lambda: next(reader.batches(payloads=["/imu/row"])),
        ):
            with pytest.raises(MissingChannelError, match="nearest is /imu/raw"):
                read()


def test_an_unknown_message_names_the_nearest(tmp_path):
    nearest = r"nearest is replay\.ImuSample"
    with pytest.raises(SchemaError, match=nearest), LogWriter(tmp_path / "a.mcap") as writer:
        writer.add_channel("/imu/raw", "replay.ImuSamples")
    with pytest.raises(LogError, match="twice"), LogWriter(tmp_path / "a.mcap") as writer:
        writer.add_channel("/imu/raw", "replay.ImuSample")
        writer.add_channel("/imu/raw", "replay.ImuSample")


@pytest.mark.parametrize("data", [b"", b"\xff\xff", schema.descriptor_set("replay.Trace")])
def test_a_schema_that_cannot_be_read_leaves_payloads(tmp_path, data):
    parts = [
        records.Schema(1, "replay.ImuSample", "protobuf", data).build(),
        records.Channel(1, 1, "/imu/raw", "protobuf", {}).build(),
        message(1, T0, b"abc"),
    ]
    with LogReader(raw_log(tmp_path / "a.mcap", parts)) as reader:
        assert reader.read("/imu/raw").payloads.blobs() == [b"abc"]
        with pytest.raises(SchemaError, match=r"replay\.ImuSample cannot be read"):
            next(reader.batches(decode=["/imu/raw"]))


def test_messages_of_a_channel_that_nothing_defines(tmp_path):
    path = raw_log(tmp_path / "a.mcap", [message(8, T0, b"abc")])
    with pytest.raises(CorruptLogError, match="nothing defines channel 8"):
        LogReader(path)
    with LogReader(path, strict=False) as reader:
        assert reader.report.losses[0].count == 1
        assert list(reader.batches()) == []


def test_a_payload_that_is_no_protobuf(tmp_path):
    codec = codec_for("replay.ImuSample")
    blobs = codec.encode(imu(range(5))).blobs()
    blobs[3] = blobs[3][:-1]
    ragged = Ragged.from_blobs(blobs)
    path = tmp_path / "a.mcap"
    parts = [
        records.Schema(1, "replay.ImuSample", "protobuf",
                       schema.descriptor_set("replay.ImuSample")).build(),
        records.Channel(1, 1, "/imu/raw", "protobuf", {}).build(),
        *[message(1, T0 + i, blob, i) for i, blob in enumerate(blobs)],
    ]  # fmt: skip
    raw_log(path, parts)
    with LogReader(path) as reader:
        with pytest.raises(CorruptLogError, match=r"past the end(.|\n)*/imu/raw.*sequence 3"):
            reader.read("/imu/raw")
        assert reader.read("/imu/raw", end_ns=T0 + 3).sequence.tolist() == [0, 1, 2]
    health = diagnose(path)
    assert health.message_counts == {"/imu/raw": 4}
    assert (health.report.losses[0].count, health.report.losses[0].unit) == (1, "rows")
    assert "no checksum" in health.notes[0]
    assert len(ragged) == 5


def test_regular_rows_have_a_rate_and_no_oddity(tmp_path):
    found = described(tmp_path, imu(np.arange(50) * 5_000_000))
    assert found.rate_hz == 200
    assert (found.backward, found.duplicates, found.not_finite) == (0, 0, {})
    assert len(found.gaps_ns) == 0
    assert found.digest.message_count == 50
    assert found.valid_span_ns == (T0, T0 + 49 * 5_000_000)


def test_gaps_and_backward_valid_times(tmp_path):
    valid = np.arange(50) * 1000
    valid[30:] += 10_000
    valid[10], valid[11] = valid[11], valid[10]
    found = described(tmp_path, imu(valid))
    assert found.backward == 1
    assert found.gaps_ns.tolist() == [[T0 + 29_000, T0 + 40_000]]


def test_rows_that_repeat(tmp_path):
    columns = imu(np.arange(9) // 2 * 1000)
    columns["angular_rate_body_rad_s"][:] = 1.0
    assert described(tmp_path, columns).duplicates == 4


def test_values_that_are_no_number(tmp_path):
    temperature = np.array([1.0, np.nan, np.inf, 2.0])
    columns = imu(range(4), temperature_c=temperature)
    columns["specific_force_body_m_s2"][2, 1] = np.nan
    found = described(tmp_path, columns)
    assert found.not_finite == {"specific_force_body_m_s2": 1, "temperature_c": 2}
    absent = imu(range(4), temperature_c=np.full(4, np.nan))
    masked = Columns.build(
        absent.valid_time_ns, absent.values, present={"temperature_c": np.zeros(4, dtype=bool)}
    )
    assert described(tmp_path, masked).not_finite == {}


def test_every_message_is_described(tmp_path):
    rng = np.random.default_rng(0)
    channels = {
        f"/x/{name.split('.')[1]}": (name, random_columns(codec_for(name).layout, 5, rng))
        for name in MESSAGES
    }
    found = describe(write_log(tmp_path / "a.mcap", channels))
    assert [channel.digest.message_count for channel in found.channels] == [5] * len(MESSAGES)
    assert not found.report
    assert found.library == "gnss-ins-replay"
    assert found.compression["zstd"].chunks == 1


def test_raw_channels_take_payloads_only(tmp_path):
    with pytest.raises(DataError, match="payloads only"), LogWriter(tmp_path / "a.mcap") as writer:
        writer.add_raw_channel(
            "/j", schema_name="", schema_encoding="", schema_data=b"", message_encoding="json"
        )
        writer.write({"/j": imu([0])})
