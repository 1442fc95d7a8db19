# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from replay.schemas import sights_pb2 as _sights_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class NetworkResolution(_message.Message):
    __slots__ = ("signal", "candidate_count", "fixed_count", "known_count", "ratio", "w_ratio", "threshold", "success_rate", "status")
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    CANDIDATE_COUNT_FIELD_NUMBER: _ClassVar[int]
    FIXED_COUNT_FIELD_NUMBER: _ClassVar[int]
    KNOWN_COUNT_FIELD_NUMBER: _ClassVar[int]
    RATIO_FIELD_NUMBER: _ClassVar[int]
    W_RATIO_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    SUCCESS_RATE_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    signal: str
    candidate_count: int
    fixed_count: int
    known_count: int
    ratio: float
    w_ratio: float
    threshold: float
    success_rate: float
    status: _sights_pb2.AmbiguityStatus
    def __init__(self, signal: _Optional[str] = ..., candidate_count: _Optional[int] = ..., fixed_count: _Optional[int] = ..., known_count: _Optional[int] = ..., ratio: _Optional[float] = ..., w_ratio: _Optional[float] = ..., threshold: _Optional[float] = ..., success_rate: _Optional[float] = ..., status: _Optional[_Union[_sights_pb2.AmbiguityStatus, str]] = ...) -> None: ...

class NetworkResidual(_message.Message):
    __slots__ = ("satellite", "reference", "signal", "residual_m", "residual_std_m")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_M_FIELD_NUMBER: _ClassVar[int]
    RESIDUAL_STD_M_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    reference: str
    signal: str
    residual_m: float
    residual_std_m: float
    def __init__(self, satellite: _Optional[str] = ..., reference: _Optional[str] = ..., signal: _Optional[str] = ..., residual_m: _Optional[float] = ..., residual_std_m: _Optional[float] = ...) -> None: ...

class BaselineError(_message.Message):
    __slots__ = ("satellite", "reference", "signal", "error_m", "error_rate_m_s", "error_acceleration_m_s2", "multipath_m", "error_std_m", "error_rate_std_m_s", "error_acceleration_std_m_s2", "multipath_std_m", "innovation_m", "innovation_std_m")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    ERROR_M_FIELD_NUMBER: _ClassVar[int]
    ERROR_RATE_M_S_FIELD_NUMBER: _ClassVar[int]
    ERROR_ACCELERATION_M_S2_FIELD_NUMBER: _ClassVar[int]
    MULTIPATH_M_FIELD_NUMBER: _ClassVar[int]
    ERROR_STD_M_FIELD_NUMBER: _ClassVar[int]
    ERROR_RATE_STD_M_S_FIELD_NUMBER: _ClassVar[int]
    ERROR_ACCELERATION_STD_M_S2_FIELD_NUMBER: _ClassVar[int]
    MULTIPATH_STD_M_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_M_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_STD_M_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    reference: str
    signal: str
    error_m: float
    error_rate_m_s: float
    error_acceleration_m_s2: float
    multipath_m: float
    error_std_m: float
    error_rate_std_m_s: float
    error_acceleration_std_m_s2: float
    multipath_std_m: float
    innovation_m: float
    innovation_std_m: float
    def __init__(self, satellite: _Optional[str] = ..., reference: _Optional[str] = ..., signal: _Optional[str] = ..., error_m: _Optional[float] = ..., error_rate_m_s: _Optional[float] = ..., error_acceleration_m_s2: _Optional[float] = ..., multipath_m: _Optional[float] = ..., error_std_m: _Optional[float] = ..., error_rate_std_m_s: _Optional[float] = ..., error_acceleration_std_m_s2: _Optional[float] = ..., multipath_std_m: _Optional[float] = ..., innovation_m: _Optional[float] = ..., innovation_std_m: _Optional[float] = ...) -> None: ...

class NetworkCorrection(_message.Message):
    __slots__ = ("satellite", "reference", "signal", "correction_m", "correction_std_m", "misfit_m", "station_count", "age_s")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    CORRECTION_M_FIELD_NUMBER: _ClassVar[int]
    CORRECTION_STD_M_FIELD_NUMBER: _ClassVar[int]
    MISFIT_M_FIELD_NUMBER: _ClassVar[int]
    STATION_COUNT_FIELD_NUMBER: _ClassVar[int]
    AGE_S_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    reference: str
    signal: str
    correction_m: float
    correction_std_m: float
    misfit_m: float
    station_count: int
    age_s: float
    def __init__(self, satellite: _Optional[str] = ..., reference: _Optional[str] = ..., signal: _Optional[str] = ..., correction_m: _Optional[float] = ..., correction_std_m: _Optional[float] = ..., misfit_m: _Optional[float] = ..., station_count: _Optional[int] = ..., age_s: _Optional[float] = ...) -> None: ...
