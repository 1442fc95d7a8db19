# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Trace(_message.Message):
    __slots__ = ("stage", "step", "input_digest", "output_digest")
    STAGE_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    INPUT_DIGEST_FIELD_NUMBER: _ClassVar[int]
    OUTPUT_DIGEST_FIELD_NUMBER: _ClassVar[int]
    stage: str
    step: int
    input_digest: int
    output_digest: int
    def __init__(self, stage: _Optional[str] = ..., step: _Optional[int] = ..., input_digest: _Optional[int] = ..., output_digest: _Optional[int] = ...) -> None: ...

class Checkpoint(_message.Message):
    __slots__ = ("stage", "step", "state")
    STAGE_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    stage: str
    step: int
    state: bytes
    def __init__(self, stage: _Optional[str] = ..., step: _Optional[int] = ..., state: _Optional[bytes] = ...) -> None: ...

class ChannelDigest(_message.Message):
    __slots__ = ("topic", "schema", "message_count", "sha256")
    TOPIC_FIELD_NUMBER: _ClassVar[int]
    SCHEMA_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_COUNT_FIELD_NUMBER: _ClassVar[int]
    SHA256_FIELD_NUMBER: _ClassVar[int]
    topic: str
    schema: str
    message_count: int
    sha256: str
    def __init__(self, topic: _Optional[str] = ..., schema: _Optional[str] = ..., message_count: _Optional[int] = ..., sha256: _Optional[str] = ...) -> None: ...

class StageRecord(_message.Message):
    __slots__ = ("name", "version", "inputs", "outputs")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    INPUTS_FIELD_NUMBER: _ClassVar[int]
    OUTPUTS_FIELD_NUMBER: _ClassVar[int]
    name: str
    version: int
    inputs: _containers.RepeatedScalarFieldContainer[str]
    outputs: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, name: _Optional[str] = ..., version: _Optional[int] = ..., inputs: _Optional[_Iterable[str]] = ..., outputs: _Optional[_Iterable[str]] = ...) -> None: ...

class Manifest(_message.Message):
    __slots__ = ("command", "package_version", "pipeline", "configuration", "stages", "inputs", "outputs", "notes")
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    PACKAGE_VERSION_FIELD_NUMBER: _ClassVar[int]
    PIPELINE_FIELD_NUMBER: _ClassVar[int]
    CONFIGURATION_FIELD_NUMBER: _ClassVar[int]
    STAGES_FIELD_NUMBER: _ClassVar[int]
    INPUTS_FIELD_NUMBER: _ClassVar[int]
    OUTPUTS_FIELD_NUMBER: _ClassVar[int]
    NOTES_FIELD_NUMBER: _ClassVar[int]
    command: str
    package_version: str
    pipeline: str
    configuration: str
    stages: _containers.RepeatedCompositeFieldContainer[StageRecord]
    inputs: _containers.RepeatedCompositeFieldContainer[ChannelDigest]
    outputs: _containers.RepeatedCompositeFieldContainer[ChannelDigest]
    notes: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, command: _Optional[str] = ..., package_version: _Optional[str] = ..., pipeline: _Optional[str] = ..., configuration: _Optional[str] = ..., stages: _Optional[_Iterable[_Union[StageRecord, _Mapping]]] = ..., inputs: _Optional[_Iterable[_Union[ChannelDigest, _Mapping]]] = ..., outputs: _Optional[_Iterable[_Union[ChannelDigest, _Mapping]]] = ..., notes: _Optional[_Iterable[str]] = ...) -> None: ...
