# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from replay.schemas import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class AntennaCalibration(_message.Message):
    __slots__ = ("antenna", "serial", "frequency", "offset_neu_m", "zenith_start_rad", "zenith_end_rad", "zenith_step_rad", "azimuth_step_rad", "pattern_m", "azimuth_pattern_m", "valid_from_ns", "valid_until_ns")
    ANTENNA_FIELD_NUMBER: _ClassVar[int]
    SERIAL_FIELD_NUMBER: _ClassVar[int]
    FREQUENCY_FIELD_NUMBER: _ClassVar[int]
    OFFSET_NEU_M_FIELD_NUMBER: _ClassVar[int]
    ZENITH_START_RAD_FIELD_NUMBER: _ClassVar[int]
    ZENITH_END_RAD_FIELD_NUMBER: _ClassVar[int]
    ZENITH_STEP_RAD_FIELD_NUMBER: _ClassVar[int]
    AZIMUTH_STEP_RAD_FIELD_NUMBER: _ClassVar[int]
    PATTERN_M_FIELD_NUMBER: _ClassVar[int]
    AZIMUTH_PATTERN_M_FIELD_NUMBER: _ClassVar[int]
    VALID_FROM_NS_FIELD_NUMBER: _ClassVar[int]
    VALID_UNTIL_NS_FIELD_NUMBER: _ClassVar[int]
    antenna: str
    serial: str
    frequency: str
    offset_neu_m: _geometry_pb2.Vector3
    zenith_start_rad: float
    zenith_end_rad: float
    zenith_step_rad: float
    azimuth_step_rad: float
    pattern_m: _containers.RepeatedScalarFieldContainer[float]
    azimuth_pattern_m: _containers.RepeatedScalarFieldContainer[float]
    valid_from_ns: int
    valid_until_ns: int
    def __init__(self, antenna: _Optional[str] = ..., serial: _Optional[str] = ..., frequency: _Optional[str] = ..., offset_neu_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., zenith_start_rad: _Optional[float] = ..., zenith_end_rad: _Optional[float] = ..., zenith_step_rad: _Optional[float] = ..., azimuth_step_rad: _Optional[float] = ..., pattern_m: _Optional[_Iterable[float]] = ..., azimuth_pattern_m: _Optional[_Iterable[float]] = ..., valid_from_ns: _Optional[int] = ..., valid_until_ns: _Optional[int] = ...) -> None: ...
