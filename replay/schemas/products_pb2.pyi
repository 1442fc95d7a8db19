# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from replay.schemas import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class BiasKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    BIAS_KIND_UNKNOWN: _ClassVar[BiasKind]
    BIAS_KIND_OSB: _ClassVar[BiasKind]
    BIAS_KIND_DSB: _ClassVar[BiasKind]
    BIAS_KIND_ISB: _ClassVar[BiasKind]
BIAS_KIND_UNKNOWN: BiasKind
BIAS_KIND_OSB: BiasKind
BIAS_KIND_DSB: BiasKind
BIAS_KIND_ISB: BiasKind

class ProductInfo(_message.Message):
    __slots__ = ("source", "format", "version", "agency", "frame", "time_system", "kind", "detail", "first_ns", "last_ns", "interval_s", "row_count")
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    FORMAT_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    AGENCY_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    TIME_SYSTEM_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    FIRST_NS_FIELD_NUMBER: _ClassVar[int]
    LAST_NS_FIELD_NUMBER: _ClassVar[int]
    INTERVAL_S_FIELD_NUMBER: _ClassVar[int]
    ROW_COUNT_FIELD_NUMBER: _ClassVar[int]
    source: str
    format: str
    version: str
    agency: str
    frame: str
    time_system: str
    kind: str
    detail: str
    first_ns: int
    last_ns: int
    interval_s: float
    row_count: int
    def __init__(self, source: _Optional[str] = ..., format: _Optional[str] = ..., version: _Optional[str] = ..., agency: _Optional[str] = ..., frame: _Optional[str] = ..., time_system: _Optional[str] = ..., kind: _Optional[str] = ..., detail: _Optional[str] = ..., first_ns: _Optional[int] = ..., last_ns: _Optional[int] = ..., interval_s: _Optional[float] = ..., row_count: _Optional[int] = ...) -> None: ...

class PreciseOrbit(_message.Message):
    __slots__ = ("satellite", "position_ecef_m", "velocity_ecef_m_s", "clock_s", "position_std_ecef_m", "clock_std_s", "orbit_predicted", "manoeuvre", "clock_predicted", "clock_event")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    POSITION_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_ECEF_M_S_FIELD_NUMBER: _ClassVar[int]
    CLOCK_S_FIELD_NUMBER: _ClassVar[int]
    POSITION_STD_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    CLOCK_STD_S_FIELD_NUMBER: _ClassVar[int]
    ORBIT_PREDICTED_FIELD_NUMBER: _ClassVar[int]
    MANOEUVRE_FIELD_NUMBER: _ClassVar[int]
    CLOCK_PREDICTED_FIELD_NUMBER: _ClassVar[int]
    CLOCK_EVENT_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    position_ecef_m: _geometry_pb2.Vector3
    velocity_ecef_m_s: _geometry_pb2.Vector3
    clock_s: float
    position_std_ecef_m: _geometry_pb2.Vector3
    clock_std_s: float
    orbit_predicted: bool
    manoeuvre: bool
    clock_predicted: bool
    clock_event: bool
    def __init__(self, satellite: _Optional[str] = ..., position_ecef_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., velocity_ecef_m_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., clock_s: _Optional[float] = ..., position_std_ecef_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., clock_std_s: _Optional[float] = ..., orbit_predicted: _Optional[bool] = ..., manoeuvre: _Optional[bool] = ..., clock_predicted: _Optional[bool] = ..., clock_event: _Optional[bool] = ...) -> None: ...

class PreciseClock(_message.Message):
    __slots__ = ("satellite", "station", "clock_s", "clock_std_s")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    STATION_FIELD_NUMBER: _ClassVar[int]
    CLOCK_S_FIELD_NUMBER: _ClassVar[int]
    CLOCK_STD_S_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    station: str
    clock_s: float
    clock_std_s: float
    def __init__(self, satellite: _Optional[str] = ..., station: _Optional[str] = ..., clock_s: _Optional[float] = ..., clock_std_s: _Optional[float] = ...) -> None: ...

class SignalBias(_message.Message):
    __slots__ = ("satellite", "station", "system", "kind", "observation", "second_observation", "value_s", "value_std_s", "slope_s_s", "valid_from_ns", "valid_until_ns")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    STATION_FIELD_NUMBER: _ClassVar[int]
    SYSTEM_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    OBSERVATION_FIELD_NUMBER: _ClassVar[int]
    SECOND_OBSERVATION_FIELD_NUMBER: _ClassVar[int]
    VALUE_S_FIELD_NUMBER: _ClassVar[int]
    VALUE_STD_S_FIELD_NUMBER: _ClassVar[int]
    SLOPE_S_S_FIELD_NUMBER: _ClassVar[int]
    VALID_FROM_NS_FIELD_NUMBER: _ClassVar[int]
    VALID_UNTIL_NS_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    station: str
    system: str
    kind: BiasKind
    observation: str
    second_observation: str
    value_s: float
    value_std_s: float
    slope_s_s: float
    valid_from_ns: int
    valid_until_ns: int
    def __init__(self, satellite: _Optional[str] = ..., station: _Optional[str] = ..., system: _Optional[str] = ..., kind: _Optional[_Union[BiasKind, str]] = ..., observation: _Optional[str] = ..., second_observation: _Optional[str] = ..., value_s: _Optional[float] = ..., value_std_s: _Optional[float] = ..., slope_s_s: _Optional[float] = ..., valid_from_ns: _Optional[int] = ..., valid_until_ns: _Optional[int] = ...) -> None: ...

class EarthRotation(_message.Message):
    __slots__ = ("polar_x_rad", "polar_y_rad", "ut1_utc_s", "length_of_day_s", "polar_x_rate_rad_s", "polar_y_rate_rad_s", "polar_x_std_rad", "polar_y_std_rad", "ut1_utc_std_s", "length_of_day_std_s")
    POLAR_X_RAD_FIELD_NUMBER: _ClassVar[int]
    POLAR_Y_RAD_FIELD_NUMBER: _ClassVar[int]
    UT1_UTC_S_FIELD_NUMBER: _ClassVar[int]
    LENGTH_OF_DAY_S_FIELD_NUMBER: _ClassVar[int]
    POLAR_X_RATE_RAD_S_FIELD_NUMBER: _ClassVar[int]
    POLAR_Y_RATE_RAD_S_FIELD_NUMBER: _ClassVar[int]
    POLAR_X_STD_RAD_FIELD_NUMBER: _ClassVar[int]
    POLAR_Y_STD_RAD_FIELD_NUMBER: _ClassVar[int]
    UT1_UTC_STD_S_FIELD_NUMBER: _ClassVar[int]
    LENGTH_OF_DAY_STD_S_FIELD_NUMBER: _ClassVar[int]
    polar_x_rad: float
    polar_y_rad: float
    ut1_utc_s: float
    length_of_day_s: float
    polar_x_rate_rad_s: float
    polar_y_rate_rad_s: float
    polar_x_std_rad: float
    polar_y_std_rad: float
    ut1_utc_std_s: float
    length_of_day_std_s: float
    def __init__(self, polar_x_rad: _Optional[float] = ..., polar_y_rad: _Optional[float] = ..., ut1_utc_s: _Optional[float] = ..., length_of_day_s: _Optional[float] = ..., polar_x_rate_rad_s: _Optional[float] = ..., polar_y_rate_rad_s: _Optional[float] = ..., polar_x_std_rad: _Optional[float] = ..., polar_y_std_rad: _Optional[float] = ..., ut1_utc_std_s: _Optional[float] = ..., length_of_day_std_s: _Optional[float] = ...) -> None: ...

class IonosphereMap(_message.Message):
    __slots__ = ("height_m", "base_radius_m", "latitude_first_rad", "latitude_step_rad", "latitude_count", "longitude_first_rad", "longitude_step_rad", "longitude_count", "tec_tecu", "rms_tecu")
    HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    BASE_RADIUS_M_FIELD_NUMBER: _ClassVar[int]
    LATITUDE_FIRST_RAD_FIELD_NUMBER: _ClassVar[int]
    LATITUDE_STEP_RAD_FIELD_NUMBER: _ClassVar[int]
    LATITUDE_COUNT_FIELD_NUMBER: _ClassVar[int]
    LONGITUDE_FIRST_RAD_FIELD_NUMBER: _ClassVar[int]
    LONGITUDE_STEP_RAD_FIELD_NUMBER: _ClassVar[int]
    LONGITUDE_COUNT_FIELD_NUMBER: _ClassVar[int]
    TEC_TECU_FIELD_NUMBER: _ClassVar[int]
    RMS_TECU_FIELD_NUMBER: _ClassVar[int]
    height_m: float
    base_radius_m: float
    latitude_first_rad: float
    latitude_step_rad: float
    latitude_count: int
    longitude_first_rad: float
    longitude_step_rad: float
    longitude_count: int
    tec_tecu: _containers.RepeatedScalarFieldContainer[float]
    rms_tecu: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, height_m: _Optional[float] = ..., base_radius_m: _Optional[float] = ..., latitude_first_rad: _Optional[float] = ..., latitude_step_rad: _Optional[float] = ..., latitude_count: _Optional[int] = ..., longitude_first_rad: _Optional[float] = ..., longitude_step_rad: _Optional[float] = ..., longitude_count: _Optional[int] = ..., tec_tecu: _Optional[_Iterable[float]] = ..., rms_tecu: _Optional[_Iterable[float]] = ...) -> None: ...

class OceanLoading(_message.Message):
    __slots__ = ("station", "model", "amplitude_up_west_south_m", "phase_up_west_south_rad")
    STATION_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    AMPLITUDE_UP_WEST_SOUTH_M_FIELD_NUMBER: _ClassVar[int]
    PHASE_UP_WEST_SOUTH_RAD_FIELD_NUMBER: _ClassVar[int]
    station: str
    model: str
    amplitude_up_west_south_m: _containers.RepeatedScalarFieldContainer[float]
    phase_up_west_south_rad: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, station: _Optional[str] = ..., model: _Optional[str] = ..., amplitude_up_west_south_m: _Optional[_Iterable[float]] = ..., phase_up_west_south_rad: _Optional[_Iterable[float]] = ...) -> None: ...
