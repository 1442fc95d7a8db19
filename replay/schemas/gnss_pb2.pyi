# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from replay.schemas import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class FixQuality(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    FIX_QUALITY_UNKNOWN: _ClassVar[FixQuality]
    FIX_QUALITY_SINGLE: _ClassVar[FixQuality]
    FIX_QUALITY_DGNSS: _ClassVar[FixQuality]
    FIX_QUALITY_PPP_FLOAT: _ClassVar[FixQuality]
    FIX_QUALITY_PPP_FIXED: _ClassVar[FixQuality]
    FIX_QUALITY_RTK_FLOAT: _ClassVar[FixQuality]
    FIX_QUALITY_RTK_FIXED: _ClassVar[FixQuality]
    FIX_QUALITY_FUSED: _ClassVar[FixQuality]
FIX_QUALITY_UNKNOWN: FixQuality
FIX_QUALITY_SINGLE: FixQuality
FIX_QUALITY_DGNSS: FixQuality
FIX_QUALITY_PPP_FLOAT: FixQuality
FIX_QUALITY_PPP_FIXED: FixQuality
FIX_QUALITY_RTK_FLOAT: FixQuality
FIX_QUALITY_RTK_FIXED: FixQuality
FIX_QUALITY_FUSED: FixQuality

class GnssFix(_message.Message):
    __slots__ = ("position_ecef_m", "position_covariance_enu_m2", "antenna_lever_arm_body_m", "quality", "velocity_ecef_m_s", "velocity_covariance_enu_m2_s2", "satellite_count", "differential_age_s", "ambiguity_ratio")
    POSITION_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    POSITION_COVARIANCE_ENU_M2_FIELD_NUMBER: _ClassVar[int]
    ANTENNA_LEVER_ARM_BODY_M_FIELD_NUMBER: _ClassVar[int]
    QUALITY_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_ECEF_M_S_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_COVARIANCE_ENU_M2_S2_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_COUNT_FIELD_NUMBER: _ClassVar[int]
    DIFFERENTIAL_AGE_S_FIELD_NUMBER: _ClassVar[int]
    AMBIGUITY_RATIO_FIELD_NUMBER: _ClassVar[int]
    position_ecef_m: _geometry_pb2.Vector3
    position_covariance_enu_m2: _geometry_pb2.SymmetricMatrix3
    antenna_lever_arm_body_m: _geometry_pb2.Vector3
    quality: FixQuality
    velocity_ecef_m_s: _geometry_pb2.Vector3
    velocity_covariance_enu_m2_s2: _geometry_pb2.SymmetricMatrix3
    satellite_count: int
    differential_age_s: float
    ambiguity_ratio: float
    def __init__(self, position_ecef_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., position_covariance_enu_m2: _Optional[_Union[_geometry_pb2.SymmetricMatrix3, _Mapping]] = ..., antenna_lever_arm_body_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., quality: _Optional[_Union[FixQuality, str]] = ..., velocity_ecef_m_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., velocity_covariance_enu_m2_s2: _Optional[_Union[_geometry_pb2.SymmetricMatrix3, _Mapping]] = ..., satellite_count: _Optional[int] = ..., differential_age_s: _Optional[float] = ..., ambiguity_ratio: _Optional[float] = ...) -> None: ...

class GnssObservation(_message.Message):
    __slots__ = ("satellite", "signal", "pseudorange_m", "carrier_phase_cycles", "doppler_hz", "cn0_dbhz", "loss_of_lock", "signal_strength", "lock_time_s", "glonass_channel", "pseudorange_std_m", "carrier_phase_std_cycles", "doppler_std_hz")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    PSEUDORANGE_M_FIELD_NUMBER: _ClassVar[int]
    CARRIER_PHASE_CYCLES_FIELD_NUMBER: _ClassVar[int]
    DOPPLER_HZ_FIELD_NUMBER: _ClassVar[int]
    CN0_DBHZ_FIELD_NUMBER: _ClassVar[int]
    LOSS_OF_LOCK_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_STRENGTH_FIELD_NUMBER: _ClassVar[int]
    LOCK_TIME_S_FIELD_NUMBER: _ClassVar[int]
    GLONASS_CHANNEL_FIELD_NUMBER: _ClassVar[int]
    PSEUDORANGE_STD_M_FIELD_NUMBER: _ClassVar[int]
    CARRIER_PHASE_STD_CYCLES_FIELD_NUMBER: _ClassVar[int]
    DOPPLER_STD_HZ_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    signal: str
    pseudorange_m: float
    carrier_phase_cycles: float
    doppler_hz: float
    cn0_dbhz: float
    loss_of_lock: int
    signal_strength: int
    lock_time_s: float
    glonass_channel: int
    pseudorange_std_m: float
    carrier_phase_std_cycles: float
    doppler_std_hz: float
    def __init__(self, satellite: _Optional[str] = ..., signal: _Optional[str] = ..., pseudorange_m: _Optional[float] = ..., carrier_phase_cycles: _Optional[float] = ..., doppler_hz: _Optional[float] = ..., cn0_dbhz: _Optional[float] = ..., loss_of_lock: _Optional[int] = ..., signal_strength: _Optional[int] = ..., lock_time_s: _Optional[float] = ..., glonass_channel: _Optional[int] = ..., pseudorange_std_m: _Optional[float] = ..., carrier_phase_std_cycles: _Optional[float] = ..., doppler_std_hz: _Optional[float] = ...) -> None: ...
