"""Columns to protobuf and back, against protobuf's own implementation."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool
from google.protobuf.message import DecodeError
from google.protobuf.message_factory import GetMessageClass
from hypothesis import example, given, settings
from hypothesis import strategies as st
from log_samples import MESSAGES, assert_same, google_messages, random_columns, same_column

from replay.errors import DataError, SchemaError
from replay.log import schema
from replay.log._codec_loops import TOO_LONG
from replay.log.codec import Codec, codec_for
from replay.log.columns import Columns, Payloads, Ragged, concatenate

_F = descriptor_pb2.FieldDescriptorProto
_TYPES = {
    name[5:].lower(): number
    for name, number in _F.Type.items()
    if name not in ("TYPE_GROUP", "TYPE_MESSAGE", "TYPE_ENUM")
}


def _everything():
    """A message with every scalar type alone, optional, and repeated packed and not."""
    file = descriptor_pb2.FileDescriptorProto(name="every.proto", package="every", syntax="proto3")
    message = file.message_type.add(name="Every")
    vector = file.message_type.add(name="Pair")
    for number, name in ((1, "a"), (9, "b")):
        vector.field.add(name=name, number=number, type=_F.TYPE_DOUBLE, label=_F.LABEL_OPTIONAL)
    number = 1
    for name, kind in _TYPES.items():
        message.field.add(name=name, number=number, type=kind, label=_F.LABEL_OPTIONAL)
        number += 1
        message.oneof_decl.add(name=f"_maybe_{name}")
        message.field.add(
            name=f"maybe_{name}",
            number=number,
            type=kind,
            label=_F.LABEL_OPTIONAL,
            proto3_optional=True,
            oneof_index=len(message.oneof_decl) - 1,
        )
        number += 1
        if name in ("string", "bytes"):
            continue
        for packed in (True, False):
            field = message.field.add(
                name=f"many_{name}_{packed}", number=number, type=kind, label=_F.LABEL_REPEATED
            )
            field.options.packed = packed
            number += 1
    message.field.add(
        name="pair", number=2000, type=_F.TYPE_MESSAGE, type_name=".every.Pair",
        label=_F.LABEL_OPTIONAL,
    )  # fmt: skip
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return pool.FindMessageTypeByName("every.Every")


EVERY = _everything()
DESCRIPTORS = {name: schema.descriptor(name) for name in MESSAGES} | {"every.Every": EVERY}
CODECS = {name: Codec(descriptor) for name, descriptor in DESCRIPTORS.items()}


def _without_utf8(descriptor):
    """The same message with its texts as bytes, which protobuf does not look into."""
    pool = descriptor_pool.DescriptorPool()
    done = set()

    def add(file):
        if file.name not in done:
            done.add(file.name)
            for dependency in file.dependencies:
                add(dependency)
            proto = descriptor_pb2.FileDescriptorProto()
            file.CopyToProto(proto)
            for field in (field for message in proto.message_type for field in message.field):
                field.type = _F.TYPE_BYTES if field.type == _F.TYPE_STRING else field.type
            pool.Add(proto)

    add(descriptor.file)
    return pool.FindMessageTypeByName(descriptor.full_name)


LENIENT = {name: _without_utf8(descriptor) for name, descriptor in DESCRIPTORS.items()}
names = st.sampled_from(sorted(CODECS))
seeds = st.integers(0, 2**32 - 1)


def payloads_of(blobs: list[bytes]) -> Payloads:
    ragged = Ragged.from_blobs(blobs)
    return Payloads(ragged.offsets[:-1], np.diff(ragged.offsets), ragged.values)


@settings(deadline=None, max_examples=120)
@given(names, seeds, st.integers(0, 12))
def test_what_is_encoded_comes_back_bit_for_bit(name, seed, count):
    codec = CODECS[name]
    columns = random_columns(codec.layout, count, np.random.default_rng(seed))
    decoded = codec.decode(codec.encode(columns))
    assert not decoded.bad.any()
    for field in codec.layout.fields:
        assert same_column(columns.values[field.name], decoded.values[field.name]), field.name
        if field.optional:
            there = decoded.present[field.name]
            assert np.array_equal(there, columns.present[field.name])


@settings(deadline=None, max_examples=80)
@given(names, seeds)
def test_protobuf_parses_what_is_encoded(name, seed):
    codec, descriptor = CODECS[name], DESCRIPTORS[name]
    columns = random_columns(codec.layout, 6, np.random.default_rng(seed))
    expected = google_messages(descriptor, codec.layout, columns)
    for blob, message in zip(codec.encode(columns).blobs(), expected, strict=True):
        parsed = GetMessageClass(descriptor).FromString(blob)
        # Not ==, which calls no NaN equal.
        assert parsed.SerializeToString(deterministic=True) == message.SerializeToString(
            deterministic=True
        )


@settings(deadline=None, max_examples=80)
@given(names, seeds)
def test_what_protobuf_serializes_is_decoded(name, seed):
    """Protobuf leaves out zeros and packs, or does not, as the schema says."""
    codec, descriptor = CODECS[name], DESCRIPTORS[name]
    columns = random_columns(codec.layout, 6, np.random.default_rng(seed))
    messages = google_messages(descriptor, codec.layout, columns)
    decoded = codec.decode(payloads_of([m.SerializeToString() for m in messages]))
    assert not decoded.bad.any()
    for field in codec.layout.fields:
        assert same_column(columns.values[field.name], decoded.values[field.name]), field.name


def mutate(blob: bytes, rng) -> bytes:
    changed = bytearray(blob)
    for _ in range(rng.integers(1, 4)):
        kind = rng.integers(0, 4)
        at = int(rng.integers(0, len(changed) + 1))
        if kind == 0 and at < len(changed):
            changed[at] ^= 1 << rng.integers(0, 8)
        elif kind == 1:
            del changed[at:]
        elif kind == 2:
            changed[at:at] = rng.bytes(rng.integers(1, 6))
        else:
            changed += blob[at:]
    return bytes(changed)


@settings(deadline=None, max_examples=250)
@given(names, seeds, st.binary(max_size=40))
@example("replay.ImuSample", 0, b"\x0b\x0c")
@example("replay.ImuSample", 0, b"\x80\x80\x80\x80\x80\x80\x80\x80\x80\x80\x01")
@example("replay.ImuSample", 0, b"\x0a\xff\xff\xff\xff\x07")
@example("replay.FilterEvent", 0, b"\x1a\x03\xed\xa0\x80")
def test_broken_bytes_are_judged_as_protobuf_judges_them(name, seed, junk):
    """No row raises; a row is bad where protobuf refuses it, else its values are protobuf's."""
    codec, descriptor = CODECS[name], DESCRIPTORS[name]
    rng = np.random.default_rng(seed)
    columns = random_columns(codec.layout, 3, rng)
    blobs = [mutate(blob, rng) for blob in codec.encode(columns).blobs()] + [junk]
    # Bytes before and behind, which a read past a row's end would show.
    data = np.frombuffer(b"\xff" * 9 + b"".join(blobs) + b"\x08" * 9, dtype=np.uint8)
    ragged = Ragged.from_blobs(blobs)
    payloads = Payloads(ragged.offsets[:-1] + 9, np.diff(ragged.offsets), data)
    decoded = codec.decode(payloads)
    good = []
    for row, blob in enumerate(blobs):
        try:
            message = GetMessageClass(descriptor).FromString(blob)
        except DecodeError:
            if not decoded.bad[row]:
                # A text that a later one replaces: protobuf looks into it, we do not.
                GetMessageClass(LENIENT[name]).FromString(blob)
            continue
        if decoded.bad[row] != TOO_LONG:
            assert not decoded.bad[row], (decoded.bad[row], blob.hex())
            good.append((row, message))
    for row, message in good:
        values = {k: v.take([row]) if isinstance(v, Ragged) else v[[row]]
                  for k, v in decoded.values.items()}  # fmt: skip
        present = {k: v[[row]] for k, v in decoded.present.items()}
        again = google_messages(
            descriptor, codec.layout, Columns.build([0], values, present=present)
        )[0]
        message.DiscardUnknownFields()
        for field in codec.layout.fields:
            # A vector that is not `optional` reads as zeros where protobuf has none.
            if field.components and not field.optional and not message.HasField(field.name):
                again.ClearField(field.name)
        assert again.SerializeToString(deterministic=True) == message.SerializeToString(
            deterministic=True
        )


def imu(**changes):
    values = {
        "angular_rate_body_rad_s": np.zeros((2, 3)),
        "specific_force_body_m_s2": np.zeros((2, 3)),
    }
    return Columns.build([0, 1], values | changes)


def test_an_optional_field_without_column_is_absent_and_without_mask_present():
    codec = codec_for("replay.ImuSample")
    assert not codec.decode(codec.encode(imu())).present["temperature_c"].any()
    given_all = codec.decode(codec.encode(imu(temperature_c=np.array([np.nan, 1.0]))))
    assert given_all.present["temperature_c"].all()
    assert np.isnan(given_all.values["temperature_c"][0])


def test_high_rate_messages_have_one_length():
    lengths = codec_for("replay.ImuSample").encode(imu()).lengths
    assert set(lengths.tolist()) == {58}


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"typo": np.zeros(2)}, "typo"),
        ({"specific_force_body_m_s2": np.zeros((2, 2))}, "shape"),
        ({"specific_force_body_m_s2": np.array([["a"] * 3] * 2)}, "float64 is due"),
        ({"temperature_c": Ragged.from_blobs([b"", b""])}, "ragged"),
    ],
)
def test_a_column_that_does_not_fit_is_named(changes, word):
    with pytest.raises(DataError, match=word):
        codec_for("replay.ImuSample").encode(imu(**changes))


def test_a_number_out_of_range_is_refused_and_one_in_range_is_taken():
    codec = codec_for("replay.FilterCovariance")
    ragged = Ragged.from_matrix(np.zeros((1, 3)))
    columns = {"state_names": Ragged.from_texts(["x"]), "upper_triangle": ragged}
    for good in (np.array([7], dtype=np.int64), np.array([7], dtype=np.uint8)):
        payloads = codec.encode(Columns.build([0], columns | {"dimension": good}))
        assert codec.decode(payloads).values["dimension"].tolist() == [7]
    for bad in (-1, 2**32):
        with pytest.raises(DataError, match="does not fit"):
            codec.encode(Columns.build([0], columns | {"dimension": np.array([bad])}))


def test_a_missing_field_that_is_not_optional_is_named():
    columns = Columns.build([0], {"angular_rate_body_rad_s": np.zeros((1, 3))})
    with pytest.raises(DataError, match="specific_force"):
        codec_for("replay.ImuSample").encode(columns)


def test_texts_may_come_as_numpy_strings_of_any_kind():
    codec = codec_for("replay.FilterEvent")
    plain = {"kind": np.array([1, 2]), "value": np.zeros(2)}
    texts = np.array(["ab", "c"])
    for given_texts in (texts, texts.astype("S"), Ragged.from_texts(["ab", "c"])):
        payloads = codec.encode(Columns.build([0, 1], plain | {"detail": given_texts}))
        assert codec.decode(payloads).values["detail"].texts() == ["ab", "c"]
    with pytest.raises(DataError, match="UTF-8"):
        codec.encode(Columns.build([0, 1], plain | {"detail": np.array([b"\xff", b"a"])}))


def test_offsets_outside_the_values_are_refused():
    columns = {"kind": np.array([1]), "value": np.zeros(1)}
    wild = Ragged(np.array([0, 99]), np.zeros(3, dtype=np.uint8))
    with pytest.raises(DataError, match="outside"):
        codec_for("replay.FilterEvent").encode(Columns.build([0], columns | {"detail": wild}))
    with pytest.raises(DataError, match="outside"):
        codec_for("replay.FilterEvent").decode(
            Payloads(np.array([5]), np.array([9]), np.zeros(3, dtype=np.uint8))
        )


def test_shapes_without_columns_are_refused_by_name():
    with pytest.raises(SchemaError, match="repeated"):
        codec_for("replay.Manifest")
    with pytest.raises(SchemaError, match=r"nearest is replay\.ImuSample"):
        codec_for("replay.ImuSampel")


def test_concatenated_columns_keep_payloads():
    codec = codec_for("replay.ImuSample")
    columns = random_columns(codec.layout, 4, np.random.default_rng(0))
    whole = dataclasses.replace(columns, payloads=codec.encode(columns))
    joined = concatenate([whole.take(slice(0, 1)), whole.take(slice(1, 4))])
    assert joined.payloads.blobs() == whole.payloads.blobs()
    assert_same(joined, whole)
