# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from replay.schemas import geometry_pb2 as _geometry_pb2
from replay.schemas import gnss_pb2 as _gnss_pb2
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SolutionStatus(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SOLUTION_STATUS_UNKNOWN: _ClassVar[SolutionStatus]
    SOLUTION_STATUS_PREDICTED: _ClassVar[SolutionStatus]
    SOLUTION_STATUS_UPDATED: _ClassVar[SolutionStatus]
    SOLUTION_STATUS_OUTAGE: _ClassVar[SolutionStatus]
    SOLUTION_STATUS_SINGLE: _ClassVar[SolutionStatus]
    SOLUTION_STATUS_DGNSS: _ClassVar[SolutionStatus]
    SOLUTION_STATUS_FLOAT: _ClassVar[SolutionStatus]
    SOLUTION_STATUS_FIXED: _ClassVar[SolutionStatus]
    SOLUTION_STATUS_CHAINED: _ClassVar[SolutionStatus]
SOLUTION_STATUS_UNKNOWN: SolutionStatus
SOLUTION_STATUS_PREDICTED: SolutionStatus
SOLUTION_STATUS_UPDATED: SolutionStatus
SOLUTION_STATUS_OUTAGE: SolutionStatus
SOLUTION_STATUS_SINGLE: SolutionStatus
SOLUTION_STATUS_DGNSS: SolutionStatus
SOLUTION_STATUS_FLOAT: SolutionStatus
SOLUTION_STATUS_FIXED: SolutionStatus
SOLUTION_STATUS_CHAINED: SolutionStatus

class Solution(_message.Message):
    __slots__ = ("position_ecef_m", "velocity_enu_m_s", "attitude_rad", "angular_rate_body_rad_s", "position_covariance_enu_m2", "velocity_std_enu_m_s", "attitude_std_rad", "status")
    POSITION_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_ENU_M_S_FIELD_NUMBER: _ClassVar[int]
    ATTITUDE_RAD_FIELD_NUMBER: _ClassVar[int]
    ANGULAR_RATE_BODY_RAD_S_FIELD_NUMBER: _ClassVar[int]
    POSITION_COVARIANCE_ENU_M2_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_STD_ENU_M_S_FIELD_NUMBER: _ClassVar[int]
    ATTITUDE_STD_RAD_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    position_ecef_m: _geometry_pb2.Vector3
    velocity_enu_m_s: _geometry_pb2.Vector3
    attitude_rad: _geometry_pb2.Vector3
    angular_rate_body_rad_s: _geometry_pb2.Vector3
    position_covariance_enu_m2: _geometry_pb2.SymmetricMatrix3
    velocity_std_enu_m_s: _geometry_pb2.Vector3
    attitude_std_rad: _geometry_pb2.Vector3
    status: SolutionStatus
    def __init__(self, position_ecef_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., velocity_enu_m_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., attitude_rad: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., angular_rate_body_rad_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., position_covariance_enu_m2: _Optional[_Union[_geometry_pb2.SymmetricMatrix3, _Mapping]] = ..., velocity_std_enu_m_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., attitude_std_rad: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., status: _Optional[_Union[SolutionStatus, str]] = ...) -> None: ...

class Truth(_message.Message):
    __slots__ = ("position_ecef_m", "lever_arm_body_m", "quality", "velocity_enu_m_s", "attitude_rad", "position_std_enu_m", "gyro_bias_body_rad_s", "accel_bias_body_m_s2")
    POSITION_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    LEVER_ARM_BODY_M_FIELD_NUMBER: _ClassVar[int]
    QUALITY_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_ENU_M_S_FIELD_NUMBER: _ClassVar[int]
    ATTITUDE_RAD_FIELD_NUMBER: _ClassVar[int]
    POSITION_STD_ENU_M_FIELD_NUMBER: _ClassVar[int]
    GYRO_BIAS_BODY_RAD_S_FIELD_NUMBER: _ClassVar[int]
    ACCEL_BIAS_BODY_M_S2_FIELD_NUMBER: _ClassVar[int]
    position_ecef_m: _geometry_pb2.Vector3
    lever_arm_body_m: _geometry_pb2.Vector3
    quality: _gnss_pb2.FixQuality
    velocity_enu_m_s: _geometry_pb2.Vector3
    attitude_rad: _geometry_pb2.Vector3
    position_std_enu_m: _geometry_pb2.Vector3
    gyro_bias_body_rad_s: _geometry_pb2.Vector3
    accel_bias_body_m_s2: _geometry_pb2.Vector3
    def __init__(self, position_ecef_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., lever_arm_body_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., quality: _Optional[_Union[_gnss_pb2.FixQuality, str]] = ..., velocity_enu_m_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., attitude_rad: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., position_std_enu_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., gyro_bias_body_rad_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., accel_bias_body_m_s2: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ...) -> None: ...
