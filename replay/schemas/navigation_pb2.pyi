# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from replay.schemas import geometry_pb2 as _geometry_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class IonosphereModel(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    IONOSPHERE_MODEL_UNKNOWN: _ClassVar[IonosphereModel]
    IONOSPHERE_MODEL_KLOBUCHAR: _ClassVar[IonosphereModel]
    IONOSPHERE_MODEL_BEIDOU: _ClassVar[IonosphereModel]
    IONOSPHERE_MODEL_NEQUICK: _ClassVar[IonosphereModel]
IONOSPHERE_MODEL_UNKNOWN: IonosphereModel
IONOSPHERE_MODEL_KLOBUCHAR: IonosphereModel
IONOSPHERE_MODEL_BEIDOU: IonosphereModel
IONOSPHERE_MODEL_NEQUICK: IonosphereModel

class BroadcastEphemeris(_message.Message):
    __slots__ = ("satellite", "toe_ns", "toc_ns", "transmitted_ns", "iode", "iodc", "health", "source", "accuracy_m", "fit_s", "af0", "af1", "af2", "group_delay_1_s", "group_delay_2_s", "toe_s", "sqrt_a", "eccentricity", "i0", "omega0", "omega", "m0", "delta_n", "omega_dot", "i_dot", "cuc", "cus", "crc", "crs", "cic", "cis", "position_m", "velocity_m_s", "acceleration_m_s2", "frequency_channel")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    TOE_NS_FIELD_NUMBER: _ClassVar[int]
    TOC_NS_FIELD_NUMBER: _ClassVar[int]
    TRANSMITTED_NS_FIELD_NUMBER: _ClassVar[int]
    IODE_FIELD_NUMBER: _ClassVar[int]
    IODC_FIELD_NUMBER: _ClassVar[int]
    HEALTH_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    ACCURACY_M_FIELD_NUMBER: _ClassVar[int]
    FIT_S_FIELD_NUMBER: _ClassVar[int]
    AF0_FIELD_NUMBER: _ClassVar[int]
    AF1_FIELD_NUMBER: _ClassVar[int]
    AF2_FIELD_NUMBER: _ClassVar[int]
    GROUP_DELAY_1_S_FIELD_NUMBER: _ClassVar[int]
    GROUP_DELAY_2_S_FIELD_NUMBER: _ClassVar[int]
    TOE_S_FIELD_NUMBER: _ClassVar[int]
    SQRT_A_FIELD_NUMBER: _ClassVar[int]
    ECCENTRICITY_FIELD_NUMBER: _ClassVar[int]
    I0_FIELD_NUMBER: _ClassVar[int]
    OMEGA0_FIELD_NUMBER: _ClassVar[int]
    OMEGA_FIELD_NUMBER: _ClassVar[int]
    M0_FIELD_NUMBER: _ClassVar[int]
    DELTA_N_FIELD_NUMBER: _ClassVar[int]
    OMEGA_DOT_FIELD_NUMBER: _ClassVar[int]
    I_DOT_FIELD_NUMBER: _ClassVar[int]
    CUC_FIELD_NUMBER: _ClassVar[int]
    CUS_FIELD_NUMBER: _ClassVar[int]
    CRC_FIELD_NUMBER: _ClassVar[int]
    CRS_FIELD_NUMBER: _ClassVar[int]
    CIC_FIELD_NUMBER: _ClassVar[int]
    CIS_FIELD_NUMBER: _ClassVar[int]
    POSITION_M_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_M_S_FIELD_NUMBER: _ClassVar[int]
    ACCELERATION_M_S2_FIELD_NUMBER: _ClassVar[int]
    FREQUENCY_CHANNEL_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    toe_ns: int
    toc_ns: int
    transmitted_ns: int
    iode: int
    iodc: int
    health: int
    source: int
    accuracy_m: float
    fit_s: float
    af0: float
    af1: float
    af2: float
    group_delay_1_s: float
    group_delay_2_s: float
    toe_s: float
    sqrt_a: float
    eccentricity: float
    i0: float
    omega0: float
    omega: float
    m0: float
    delta_n: float
    omega_dot: float
    i_dot: float
    cuc: float
    cus: float
    crc: float
    crs: float
    cic: float
    cis: float
    position_m: _geometry_pb2.Vector3
    velocity_m_s: _geometry_pb2.Vector3
    acceleration_m_s2: _geometry_pb2.Vector3
    frequency_channel: int
    def __init__(self, satellite: _Optional[str] = ..., toe_ns: _Optional[int] = ..., toc_ns: _Optional[int] = ..., transmitted_ns: _Optional[int] = ..., iode: _Optional[int] = ..., iodc: _Optional[int] = ..., health: _Optional[int] = ..., source: _Optional[int] = ..., accuracy_m: _Optional[float] = ..., fit_s: _Optional[float] = ..., af0: _Optional[float] = ..., af1: _Optional[float] = ..., af2: _Optional[float] = ..., group_delay_1_s: _Optional[float] = ..., group_delay_2_s: _Optional[float] = ..., toe_s: _Optional[float] = ..., sqrt_a: _Optional[float] = ..., eccentricity: _Optional[float] = ..., i0: _Optional[float] = ..., omega0: _Optional[float] = ..., omega: _Optional[float] = ..., m0: _Optional[float] = ..., delta_n: _Optional[float] = ..., omega_dot: _Optional[float] = ..., i_dot: _Optional[float] = ..., cuc: _Optional[float] = ..., cus: _Optional[float] = ..., crc: _Optional[float] = ..., crs: _Optional[float] = ..., cic: _Optional[float] = ..., cis: _Optional[float] = ..., position_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., velocity_m_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., acceleration_m_s2: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., frequency_channel: _Optional[int] = ...) -> None: ...

class BroadcastIonosphere(_message.Message):
    __slots__ = ("system", "model", "coefficients")
    SYSTEM_FIELD_NUMBER: _ClassVar[int]
    MODEL_FIELD_NUMBER: _ClassVar[int]
    COEFFICIENTS_FIELD_NUMBER: _ClassVar[int]
    system: str
    model: IonosphereModel
    coefficients: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, system: _Optional[str] = ..., model: _Optional[_Union[IonosphereModel, str]] = ..., coefficients: _Optional[_Iterable[float]] = ...) -> None: ...

class TimeCorrection(_message.Message):
    __slots__ = ("scales", "a0_s", "a1", "reference_s", "week")
    SCALES_FIELD_NUMBER: _ClassVar[int]
    A0_S_FIELD_NUMBER: _ClassVar[int]
    A1_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_S_FIELD_NUMBER: _ClassVar[int]
    WEEK_FIELD_NUMBER: _ClassVar[int]
    scales: str
    a0_s: float
    a1: float
    reference_s: float
    week: int
    def __init__(self, scales: _Optional[str] = ..., a0_s: _Optional[float] = ..., a1: _Optional[float] = ..., reference_s: _Optional[float] = ..., week: _Optional[int] = ...) -> None: ...
