# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from replay.schemas import geometry_pb2 as _geometry_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ReceiverInfo(_message.Message):
    __slots__ = ("marker", "receiver", "antenna", "approximate_position_ecef_m", "antenna_offset_enu_m", "interval_s", "header")
    MARKER_FIELD_NUMBER: _ClassVar[int]
    RECEIVER_FIELD_NUMBER: _ClassVar[int]
    ANTENNA_FIELD_NUMBER: _ClassVar[int]
    APPROXIMATE_POSITION_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    ANTENNA_OFFSET_ENU_M_FIELD_NUMBER: _ClassVar[int]
    INTERVAL_S_FIELD_NUMBER: _ClassVar[int]
    HEADER_FIELD_NUMBER: _ClassVar[int]
    marker: str
    receiver: str
    antenna: str
    approximate_position_ecef_m: _geometry_pb2.Vector3
    antenna_offset_enu_m: _geometry_pb2.Vector3
    interval_s: float
    header: bytes
    def __init__(self, marker: _Optional[str] = ..., receiver: _Optional[str] = ..., antenna: _Optional[str] = ..., approximate_position_ecef_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., antenna_offset_enu_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., interval_s: _Optional[float] = ..., header: _Optional[bytes] = ...) -> None: ...

class ReceiverEpoch(_message.Message):
    __slots__ = ("flag", "satellite_count", "clock_offset_s")
    FLAG_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_COUNT_FIELD_NUMBER: _ClassVar[int]
    CLOCK_OFFSET_S_FIELD_NUMBER: _ClassVar[int]
    flag: int
    satellite_count: int
    clock_offset_s: float
    def __init__(self, flag: _Optional[int] = ..., satellite_count: _Optional[int] = ..., clock_offset_s: _Optional[float] = ...) -> None: ...
