"""The table of channels against the schemas that it speaks of."""

from __future__ import annotations

import itertools
import re

import pytest
from google.protobuf.descriptor import Descriptor

from replay import channels
from replay.channels import CHANNELS, ChannelSpec, Difference
from replay.errors import SchemaError
from replay.log import codec, schema
from replay.stages.base import Port
from replay.stages.gnss_ins_lc import GnssInsLoose

NAMES = {
    "receiver": "r1",
    "unit": "u1",
    "rover": "rover",
    "run": "gnss-ins-lc",
    "network": "n1",
    "baseline": "b1",
}
PARAMETERS = pytest.mark.parametrize("spec", CHANNELS, ids=[spec.name for spec in CHANNELS])


def filled(spec: ChannelSpec) -> str:
    parts = re.findall(r"{(\w+)}", spec.topic)
    return spec.at(**{part: NAMES[part] for part in parts})


def message(spec: ChannelSpec) -> Descriptor:
    found: Descriptor = schema.foreign_descriptor(spec.message, schema.descriptor_set(spec.message))
    return found


@PARAMETERS
def test_message_exists(spec: ChannelSpec) -> None:
    assert message(spec).full_name == spec.message
    assert codec.codec_for(spec.message) is not None
    assert spec.about


@PARAMETERS
def test_fields_exist(spec: ChannelSpec) -> None:
    fields = message(spec).fields_by_name
    assert set(spec.tolerances) <= set(fields)
    assert set(spec.key) <= set(fields)
    assert not set(spec.key) & set(spec.tolerances)


@pytest.mark.parametrize("port", GnssInsLoose.spec.outputs, ids=lambda port: port.name)
def test_every_number_that_a_stage_makes_has_a_tolerance(port: Port) -> None:
    """Another version may differ in last bits: a person looks at what is more."""
    spec = port.channel
    for field in message(spec).fields:
        floating = (field.CPPTYPE_DOUBLE, field.CPPTYPE_FLOAT)
        if field.message_type is not None or field.cpp_type in floating:
            assert field.name in spec.tolerances, field.name


@PARAMETERS
def test_tolerances_fit_their_fields(spec: ChannelSpec) -> None:
    suffixes = {
        "_m": "m",
        "_m2": "m^2",
        "_rad": "rad",
        "_rad_s": "rad/s",
        "_m_s": "m/s",
        "_m_s2": "m/s^2",
        "_m2_s2": "m^2/s^2",
        "_hz": "Hz",
        "_cycles": "cycle",
        "_dbhz": "dB-Hz",
    }
    for name, tolerance in spec.tolerances.items():
        assert tolerance.absolute > 0.0
        ending = max((s for s in suffixes if name.endswith(s)), key=len, default=None)
        if ending is not None and name != "squat_rad_s2_m":
            assert tolerance.unit == suffixes[ending], name
        if tolerance.difference in (Difference.ANGLE, Difference.ROTATION):
            assert tolerance.unit == "rad", name


@PARAMETERS
def test_topic_goes_round(spec: ChannelSpec) -> None:
    topic = filled(spec)
    assert topic.startswith("/")
    assert "{" not in topic
    assert spec.matches(topic)
    assert spec.at(**spec.parts(topic)) == topic
    assert channels.find(topic) is spec
    assert not spec.matches(topic + "/more")
    assert not spec.matches("/x" + topic)


def test_ranks_are_their_own() -> None:
    ranks = [channels.rank(filled(spec)) for spec in CHANNELS]
    assert ranks == list(range(len(CHANNELS)))
    assert channels.rank("/unknown") == len(CHANNELS)
    assert channels.find("/unknown") is None
    assert channels.find("/gnss/a/b/fix") is None
    assert channels.find("/solution/") is None


def test_no_topic_is_of_two_kinds() -> None:
    for a, b in itertools.permutations(CHANNELS, 2):
        assert not b.matches(filled(a))
        assert a.name != b.name


def test_parts_of_another_topic() -> None:
    with pytest.raises(SchemaError, match="/truth"):
        channels.GNSS_FIX.parts("/truth")
    assert channels.GNSS_FIX.parts("/gnss/base-1/fix") == {"receiver": "base-1"}


def test_numbers_of_the_kernels_are_those_of_the_schemas() -> None:
    """Kernels import no schema, so they spell the numbers of enumerations themselves."""
    from replay.kernels import records
    from replay.schemas import filter_pb2, solution_pb2

    pairs = {
        "EVENT_LEVELLED": (filter_pb2.EventKind, "EVENT_KIND_ALIGNMENT_LEVELLED"),
        "EVENT_ALIGNED": (filter_pb2.EventKind, "EVENT_KIND_ALIGNMENT_COMPLETE"),
        "EVENT_REJECTED": (filter_pb2.EventKind, "EVENT_KIND_MEASUREMENT_REJECTED"),
        "EVENT_OUTAGE_BEGIN": (filter_pb2.EventKind, "EVENT_KIND_OUTAGE_BEGIN"),
        "EVENT_OUTAGE_END": (filter_pb2.EventKind, "EVENT_KIND_OUTAGE_END"),
        "EVENT_STOP_BEGIN": (filter_pb2.EventKind, "EVENT_KIND_STOP_BEGIN"),
        "EVENT_STOP_END": (filter_pb2.EventKind, "EVENT_KIND_STOP_END"),
        "EVENT_IMU_GAP": (filter_pb2.EventKind, "EVENT_KIND_IMU_GAP"),
        "EVENT_TIME_BACKWARD": (filter_pb2.EventKind, "EVENT_KIND_TIME_BACKWARD"),
        "EVENT_NOT_FINITE": (filter_pb2.EventKind, "EVENT_KIND_NOT_FINITE"),
        "EVENT_RESET": (filter_pb2.EventKind, "EVENT_KIND_RESET"),
        "KIND_POSITION": (filter_pb2.MeasurementKind, "MEASUREMENT_KIND_POSITION"),
        "KIND_VELOCITY": (filter_pb2.MeasurementKind, "MEASUREMENT_KIND_VELOCITY"),
        "KIND_ZERO_VELOCITY": (filter_pb2.MeasurementKind, "MEASUREMENT_KIND_ZERO_VELOCITY"),
        "KIND_ZERO_RATE": (filter_pb2.MeasurementKind, "MEASUREMENT_KIND_ZERO_ANGULAR_RATE"),
        "KIND_NON_HOLONOMIC": (filter_pb2.MeasurementKind, "MEASUREMENT_KIND_NON_HOLONOMIC"),
        "AXIS_EAST": (filter_pb2.MeasurementAxis, "MEASUREMENT_AXIS_EAST"),
        "AXIS_FORWARD": (filter_pb2.MeasurementAxis, "MEASUREMENT_AXIS_FORWARD"),
        "AXIS_RIGHT": (filter_pb2.MeasurementAxis, "MEASUREMENT_AXIS_RIGHT"),
        "STATUS_PREDICTED": (solution_pb2.SolutionStatus, "SOLUTION_STATUS_PREDICTED"),
        "STATUS_UPDATED": (solution_pb2.SolutionStatus, "SOLUTION_STATUS_UPDATED"),
        "STATUS_OUTAGE": (solution_pb2.SolutionStatus, "SOLUTION_STATUS_OUTAGE"),
    }
    named = [name for name in vars(records) if name.startswith(("EVENT_", "KIND_", "STATUS_"))]
    for name in named:
        if name != "EVENT_DTYPE":
            assert name in pairs
    for name, (enumeration, member) in pairs.items():
        assert getattr(records, name) == enumeration.Value(member), name
