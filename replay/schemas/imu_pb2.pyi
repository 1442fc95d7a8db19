# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from replay.schemas import geometry_pb2 as _geometry_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ImuSample(_message.Message):
    __slots__ = ("angular_rate_body_rad_s", "specific_force_body_m_s2", "temperature_c")
    ANGULAR_RATE_BODY_RAD_S_FIELD_NUMBER: _ClassVar[int]
    SPECIFIC_FORCE_BODY_M_S2_FIELD_NUMBER: _ClassVar[int]
    TEMPERATURE_C_FIELD_NUMBER: _ClassVar[int]
    angular_rate_body_rad_s: _geometry_pb2.Vector3
    specific_force_body_m_s2: _geometry_pb2.Vector3
    temperature_c: float
    def __init__(self, angular_rate_body_rad_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., specific_force_body_m_s2: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., temperature_c: _Optional[float] = ...) -> None: ...
