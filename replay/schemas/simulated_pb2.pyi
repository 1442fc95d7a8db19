# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class SignalTruth(_message.Message):
    __slots__ = ("satellite", "signal", "range_m", "satellite_clock_m", "receiver_clock_m", "ionosphere_m", "troposphere_m", "shapiro_m", "orbit_error_m", "code_delay_m", "code_multipath_m", "carrier_multipath_m", "code_noise_m", "carrier_noise_m", "ambiguity_cycles", "antenna_m", "solid_tide_m", "pole_tide_m", "wind_up_m", "carrier_delay_m")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    RANGE_M_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_CLOCK_M_FIELD_NUMBER: _ClassVar[int]
    RECEIVER_CLOCK_M_FIELD_NUMBER: _ClassVar[int]
    IONOSPHERE_M_FIELD_NUMBER: _ClassVar[int]
    TROPOSPHERE_M_FIELD_NUMBER: _ClassVar[int]
    SHAPIRO_M_FIELD_NUMBER: _ClassVar[int]
    ORBIT_ERROR_M_FIELD_NUMBER: _ClassVar[int]
    CODE_DELAY_M_FIELD_NUMBER: _ClassVar[int]
    CODE_MULTIPATH_M_FIELD_NUMBER: _ClassVar[int]
    CARRIER_MULTIPATH_M_FIELD_NUMBER: _ClassVar[int]
    CODE_NOISE_M_FIELD_NUMBER: _ClassVar[int]
    CARRIER_NOISE_M_FIELD_NUMBER: _ClassVar[int]
    AMBIGUITY_CYCLES_FIELD_NUMBER: _ClassVar[int]
    ANTENNA_M_FIELD_NUMBER: _ClassVar[int]
    SOLID_TIDE_M_FIELD_NUMBER: _ClassVar[int]
    POLE_TIDE_M_FIELD_NUMBER: _ClassVar[int]
    WIND_UP_M_FIELD_NUMBER: _ClassVar[int]
    CARRIER_DELAY_M_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    signal: str
    range_m: float
    satellite_clock_m: float
    receiver_clock_m: float
    ionosphere_m: float
    troposphere_m: float
    shapiro_m: float
    orbit_error_m: float
    code_delay_m: float
    code_multipath_m: float
    carrier_multipath_m: float
    code_noise_m: float
    carrier_noise_m: float
    ambiguity_cycles: int
    antenna_m: float
    solid_tide_m: float
    pole_tide_m: float
    wind_up_m: float
    carrier_delay_m: float
    def __init__(self, satellite: _Optional[str] = ..., signal: _Optional[str] = ..., range_m: _Optional[float] = ..., satellite_clock_m: _Optional[float] = ..., receiver_clock_m: _Optional[float] = ..., ionosphere_m: _Optional[float] = ..., troposphere_m: _Optional[float] = ..., shapiro_m: _Optional[float] = ..., orbit_error_m: _Optional[float] = ..., code_delay_m: _Optional[float] = ..., code_multipath_m: _Optional[float] = ..., carrier_multipath_m: _Optional[float] = ..., code_noise_m: _Optional[float] = ..., carrier_noise_m: _Optional[float] = ..., ambiguity_cycles: _Optional[int] = ..., antenna_m: _Optional[float] = ..., solid_tide_m: _Optional[float] = ..., pole_tide_m: _Optional[float] = ..., wind_up_m: _Optional[float] = ..., carrier_delay_m: _Optional[float] = ...) -> None: ...
