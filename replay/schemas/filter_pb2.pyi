# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from replay.schemas import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class MeasurementKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MEASUREMENT_KIND_UNKNOWN: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_POSITION: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_VELOCITY: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_ZERO_VELOCITY: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_ZERO_ANGULAR_RATE: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_NON_HOLONOMIC: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_HEADING: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_PSEUDORANGE: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_CARRIER_PHASE: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_DOPPLER: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_TIME_DIFFERENCED_PHASE: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_DISPLACEMENT: _ClassVar[MeasurementKind]
    MEASUREMENT_KIND_IONOSPHERE: _ClassVar[MeasurementKind]

class MeasurementAxis(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    MEASUREMENT_AXIS_NONE: _ClassVar[MeasurementAxis]
    MEASUREMENT_AXIS_EAST: _ClassVar[MeasurementAxis]
    MEASUREMENT_AXIS_NORTH: _ClassVar[MeasurementAxis]
    MEASUREMENT_AXIS_UP: _ClassVar[MeasurementAxis]
    MEASUREMENT_AXIS_FORWARD: _ClassVar[MeasurementAxis]
    MEASUREMENT_AXIS_RIGHT: _ClassVar[MeasurementAxis]
    MEASUREMENT_AXIS_DOWN: _ClassVar[MeasurementAxis]

class EventKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    EVENT_KIND_UNKNOWN: _ClassVar[EventKind]
    EVENT_KIND_ALIGNMENT_LEVELLED: _ClassVar[EventKind]
    EVENT_KIND_ALIGNMENT_COMPLETE: _ClassVar[EventKind]
    EVENT_KIND_MEASUREMENT_REJECTED: _ClassVar[EventKind]
    EVENT_KIND_OUTAGE_BEGIN: _ClassVar[EventKind]
    EVENT_KIND_OUTAGE_END: _ClassVar[EventKind]
    EVENT_KIND_STOP_BEGIN: _ClassVar[EventKind]
    EVENT_KIND_STOP_END: _ClassVar[EventKind]
    EVENT_KIND_IMU_GAP: _ClassVar[EventKind]
    EVENT_KIND_TIME_BACKWARD: _ClassVar[EventKind]
    EVENT_KIND_NOT_FINITE: _ClassVar[EventKind]
    EVENT_KIND_RESET: _ClassVar[EventKind]
    EVENT_KIND_SATELLITE_EXCLUDED: _ClassVar[EventKind]
    EVENT_KIND_NO_EPHEMERIS: _ClassVar[EventKind]
    EVENT_KIND_TOO_FEW_SATELLITES: _ClassVar[EventKind]
    EVENT_KIND_NOT_CONVERGED: _ClassVar[EventKind]
    EVENT_KIND_CYCLE_SLIP: _ClassVar[EventKind]
    EVENT_KIND_SLIP_REPAIRED: _ClassVar[EventKind]
    EVENT_KIND_CHAIN_BROKEN: _ClassVar[EventKind]
    EVENT_KIND_AMBIGUITIES_FIXED: _ClassVar[EventKind]
    EVENT_KIND_AMBIGUITIES_LOST: _ClassVar[EventKind]
    EVENT_KIND_CLOCK_JUMP: _ClassVar[EventKind]
    EVENT_KIND_BASE_LOST: _ClassVar[EventKind]
    EVENT_KIND_INTEGER_REPAIRED: _ClassVar[EventKind]
    EVENT_KIND_STATION_LOST: _ClassVar[EventKind]
    EVENT_KIND_STATION_FOUND: _ClassVar[EventKind]
    EVENT_KIND_PRODUCT_LACKING: _ClassVar[EventKind]
    EVENT_KIND_PRODUCT_CONTINUED: _ClassVar[EventKind]
    EVENT_KIND_FRAMES_DIFFER: _ClassVar[EventKind]
MEASUREMENT_KIND_UNKNOWN: MeasurementKind
MEASUREMENT_KIND_POSITION: MeasurementKind
MEASUREMENT_KIND_VELOCITY: MeasurementKind
MEASUREMENT_KIND_ZERO_VELOCITY: MeasurementKind
MEASUREMENT_KIND_ZERO_ANGULAR_RATE: MeasurementKind
MEASUREMENT_KIND_NON_HOLONOMIC: MeasurementKind
MEASUREMENT_KIND_HEADING: MeasurementKind
MEASUREMENT_KIND_PSEUDORANGE: MeasurementKind
MEASUREMENT_KIND_CARRIER_PHASE: MeasurementKind
MEASUREMENT_KIND_DOPPLER: MeasurementKind
MEASUREMENT_KIND_TIME_DIFFERENCED_PHASE: MeasurementKind
MEASUREMENT_KIND_DISPLACEMENT: MeasurementKind
MEASUREMENT_KIND_IONOSPHERE: MeasurementKind
MEASUREMENT_AXIS_NONE: MeasurementAxis
MEASUREMENT_AXIS_EAST: MeasurementAxis
MEASUREMENT_AXIS_NORTH: MeasurementAxis
MEASUREMENT_AXIS_UP: MeasurementAxis
MEASUREMENT_AXIS_FORWARD: MeasurementAxis
MEASUREMENT_AXIS_RIGHT: MeasurementAxis
MEASUREMENT_AXIS_DOWN: MeasurementAxis
EVENT_KIND_UNKNOWN: EventKind
EVENT_KIND_ALIGNMENT_LEVELLED: EventKind
EVENT_KIND_ALIGNMENT_COMPLETE: EventKind
EVENT_KIND_MEASUREMENT_REJECTED: EventKind
EVENT_KIND_OUTAGE_BEGIN: EventKind
EVENT_KIND_OUTAGE_END: EventKind
EVENT_KIND_STOP_BEGIN: EventKind
EVENT_KIND_STOP_END: EventKind
EVENT_KIND_IMU_GAP: EventKind
EVENT_KIND_TIME_BACKWARD: EventKind
EVENT_KIND_NOT_FINITE: EventKind
EVENT_KIND_RESET: EventKind
EVENT_KIND_SATELLITE_EXCLUDED: EventKind
EVENT_KIND_NO_EPHEMERIS: EventKind
EVENT_KIND_TOO_FEW_SATELLITES: EventKind
EVENT_KIND_NOT_CONVERGED: EventKind
EVENT_KIND_CYCLE_SLIP: EventKind
EVENT_KIND_SLIP_REPAIRED: EventKind
EVENT_KIND_CHAIN_BROKEN: EventKind
EVENT_KIND_AMBIGUITIES_FIXED: EventKind
EVENT_KIND_AMBIGUITIES_LOST: EventKind
EVENT_KIND_CLOCK_JUMP: EventKind
EVENT_KIND_BASE_LOST: EventKind
EVENT_KIND_INTEGER_REPAIRED: EventKind
EVENT_KIND_STATION_LOST: EventKind
EVENT_KIND_STATION_FOUND: EventKind
EVENT_KIND_PRODUCT_LACKING: EventKind
EVENT_KIND_PRODUCT_CONTINUED: EventKind
EVENT_KIND_FRAMES_DIFFER: EventKind

class FilterState(_message.Message):
    __slots__ = ("position_ecef_m", "velocity_ecef_m_s", "q_body_to_ecef", "gyro_bias_body_rad_s", "accel_bias_body_m_s2", "gyro_scale_factor", "accel_scale_factor", "mounting_angles_rad", "non_slip_point_body_m", "squat_rad_s2_m")
    POSITION_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_ECEF_M_S_FIELD_NUMBER: _ClassVar[int]
    Q_BODY_TO_ECEF_FIELD_NUMBER: _ClassVar[int]
    GYRO_BIAS_BODY_RAD_S_FIELD_NUMBER: _ClassVar[int]
    ACCEL_BIAS_BODY_M_S2_FIELD_NUMBER: _ClassVar[int]
    GYRO_SCALE_FACTOR_FIELD_NUMBER: _ClassVar[int]
    ACCEL_SCALE_FACTOR_FIELD_NUMBER: _ClassVar[int]
    MOUNTING_ANGLES_RAD_FIELD_NUMBER: _ClassVar[int]
    NON_SLIP_POINT_BODY_M_FIELD_NUMBER: _ClassVar[int]
    SQUAT_RAD_S2_M_FIELD_NUMBER: _ClassVar[int]
    position_ecef_m: _geometry_pb2.Vector3
    velocity_ecef_m_s: _geometry_pb2.Vector3
    q_body_to_ecef: _geometry_pb2.Quaternion
    gyro_bias_body_rad_s: _geometry_pb2.Vector3
    accel_bias_body_m_s2: _geometry_pb2.Vector3
    gyro_scale_factor: _geometry_pb2.Vector3
    accel_scale_factor: _geometry_pb2.Vector3
    mounting_angles_rad: _geometry_pb2.Vector3
    non_slip_point_body_m: _geometry_pb2.Vector3
    squat_rad_s2_m: float
    def __init__(self, position_ecef_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., velocity_ecef_m_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., q_body_to_ecef: _Optional[_Union[_geometry_pb2.Quaternion, _Mapping]] = ..., gyro_bias_body_rad_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., accel_bias_body_m_s2: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., gyro_scale_factor: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., accel_scale_factor: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., mounting_angles_rad: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., non_slip_point_body_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., squat_rad_s2_m: _Optional[float] = ...) -> None: ...

class FilterCovariance(_message.Message):
    __slots__ = ("dimension", "state_names", "upper_triangle")
    DIMENSION_FIELD_NUMBER: _ClassVar[int]
    STATE_NAMES_FIELD_NUMBER: _ClassVar[int]
    UPPER_TRIANGLE_FIELD_NUMBER: _ClassVar[int]
    dimension: int
    state_names: str
    upper_triangle: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, dimension: _Optional[int] = ..., state_names: _Optional[str] = ..., upper_triangle: _Optional[_Iterable[float]] = ...) -> None: ...

class FilterTransition(_message.Message):
    __slots__ = ("since_ns", "dimension_before", "dimension", "state_names", "row", "column", "value", "predicted_upper_triangle", "correction", "updated_upper_triangle", "estimate", "q_body_to_ecef", "solution")
    SINCE_NS_FIELD_NUMBER: _ClassVar[int]
    DIMENSION_BEFORE_FIELD_NUMBER: _ClassVar[int]
    DIMENSION_FIELD_NUMBER: _ClassVar[int]
    STATE_NAMES_FIELD_NUMBER: _ClassVar[int]
    ROW_FIELD_NUMBER: _ClassVar[int]
    COLUMN_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    PREDICTED_UPPER_TRIANGLE_FIELD_NUMBER: _ClassVar[int]
    CORRECTION_FIELD_NUMBER: _ClassVar[int]
    UPDATED_UPPER_TRIANGLE_FIELD_NUMBER: _ClassVar[int]
    ESTIMATE_FIELD_NUMBER: _ClassVar[int]
    Q_BODY_TO_ECEF_FIELD_NUMBER: _ClassVar[int]
    SOLUTION_FIELD_NUMBER: _ClassVar[int]
    since_ns: int
    dimension_before: int
    dimension: int
    state_names: str
    row: _containers.RepeatedScalarFieldContainer[int]
    column: _containers.RepeatedScalarFieldContainer[int]
    value: _containers.RepeatedScalarFieldContainer[float]
    predicted_upper_triangle: _containers.RepeatedScalarFieldContainer[float]
    correction: _containers.RepeatedScalarFieldContainer[float]
    updated_upper_triangle: _containers.RepeatedScalarFieldContainer[float]
    estimate: _containers.RepeatedScalarFieldContainer[float]
    q_body_to_ecef: _containers.RepeatedScalarFieldContainer[float]
    solution: int
    def __init__(self, since_ns: _Optional[int] = ..., dimension_before: _Optional[int] = ..., dimension: _Optional[int] = ..., state_names: _Optional[str] = ..., row: _Optional[_Iterable[int]] = ..., column: _Optional[_Iterable[int]] = ..., value: _Optional[_Iterable[float]] = ..., predicted_upper_triangle: _Optional[_Iterable[float]] = ..., correction: _Optional[_Iterable[float]] = ..., updated_upper_triangle: _Optional[_Iterable[float]] = ..., estimate: _Optional[_Iterable[float]] = ..., q_body_to_ecef: _Optional[_Iterable[float]] = ..., solution: _Optional[int] = ...) -> None: ...

class Innovation(_message.Message):
    __slots__ = ("kind", "axis", "satellite", "signal", "innovation", "innovation_std", "measurement_std", "normalized", "accepted")
    KIND_FIELD_NUMBER: _ClassVar[int]
    AXIS_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_FIELD_NUMBER: _ClassVar[int]
    INNOVATION_STD_FIELD_NUMBER: _ClassVar[int]
    MEASUREMENT_STD_FIELD_NUMBER: _ClassVar[int]
    NORMALIZED_FIELD_NUMBER: _ClassVar[int]
    ACCEPTED_FIELD_NUMBER: _ClassVar[int]
    kind: MeasurementKind
    axis: MeasurementAxis
    satellite: str
    signal: str
    innovation: float
    innovation_std: float
    measurement_std: float
    normalized: float
    accepted: bool
    def __init__(self, kind: _Optional[_Union[MeasurementKind, str]] = ..., axis: _Optional[_Union[MeasurementAxis, str]] = ..., satellite: _Optional[str] = ..., signal: _Optional[str] = ..., innovation: _Optional[float] = ..., innovation_std: _Optional[float] = ..., measurement_std: _Optional[float] = ..., normalized: _Optional[float] = ..., accepted: _Optional[bool] = ...) -> None: ...

class FilterEvent(_message.Message):
    __slots__ = ("kind", "value", "detail")
    KIND_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    kind: EventKind
    value: float
    detail: str
    def __init__(self, kind: _Optional[_Union[EventKind, str]] = ..., value: _Optional[float] = ..., detail: _Optional[str] = ...) -> None: ...
