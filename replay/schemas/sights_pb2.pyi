# Made by tools/generate_schemas.py from schemas/*.proto. Edit those, not this.
from replay.schemas import geometry_pb2 as _geometry_pb2
from replay.schemas import solution_pb2 as _solution_pb2
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SlipDetector(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SLIP_DETECTOR_UNKNOWN: _ClassVar[SlipDetector]
    SLIP_DETECTOR_LOSS_OF_LOCK: _ClassVar[SlipDetector]
    SLIP_DETECTOR_GAP: _ClassVar[SlipDetector]
    SLIP_DETECTOR_GEOMETRY_FREE: _ClassVar[SlipDetector]
    SLIP_DETECTOR_MELBOURNE_WUBBENA: _ClassVar[SlipDetector]
    SLIP_DETECTOR_DOPPLER: _ClassVar[SlipDetector]
    SLIP_DETECTOR_TIME_DIFFERENCE: _ClassVar[SlipDetector]
    SLIP_DETECTOR_INERTIAL: _ClassVar[SlipDetector]

class AmbiguityStatus(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    AMBIGUITY_STATUS_UNKNOWN: _ClassVar[AmbiguityStatus]
    AMBIGUITY_STATUS_FLOAT: _ClassVar[AmbiguityStatus]
    AMBIGUITY_STATUS_FIXED: _ClassVar[AmbiguityStatus]
    AMBIGUITY_STATUS_REJECTED: _ClassVar[AmbiguityStatus]
    AMBIGUITY_STATUS_HELD: _ClassVar[AmbiguityStatus]
SLIP_DETECTOR_UNKNOWN: SlipDetector
SLIP_DETECTOR_LOSS_OF_LOCK: SlipDetector
SLIP_DETECTOR_GAP: SlipDetector
SLIP_DETECTOR_GEOMETRY_FREE: SlipDetector
SLIP_DETECTOR_MELBOURNE_WUBBENA: SlipDetector
SLIP_DETECTOR_DOPPLER: SlipDetector
SLIP_DETECTOR_TIME_DIFFERENCE: SlipDetector
SLIP_DETECTOR_INERTIAL: SlipDetector
AMBIGUITY_STATUS_UNKNOWN: AmbiguityStatus
AMBIGUITY_STATUS_FLOAT: AmbiguityStatus
AMBIGUITY_STATUS_FIXED: AmbiguityStatus
AMBIGUITY_STATUS_REJECTED: AmbiguityStatus
AMBIGUITY_STATUS_HELD: AmbiguityStatus

class SatelliteSight(_message.Message):
    __slots__ = ("satellite", "position_ecef_m", "velocity_ecef_m_s", "clock_s", "clock_drift_s_s", "elevation_rad", "azimuth_rad", "range_std_m", "ephemeris_age_s", "issue", "health")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    POSITION_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_ECEF_M_S_FIELD_NUMBER: _ClassVar[int]
    CLOCK_S_FIELD_NUMBER: _ClassVar[int]
    CLOCK_DRIFT_S_S_FIELD_NUMBER: _ClassVar[int]
    ELEVATION_RAD_FIELD_NUMBER: _ClassVar[int]
    AZIMUTH_RAD_FIELD_NUMBER: _ClassVar[int]
    RANGE_STD_M_FIELD_NUMBER: _ClassVar[int]
    EPHEMERIS_AGE_S_FIELD_NUMBER: _ClassVar[int]
    ISSUE_FIELD_NUMBER: _ClassVar[int]
    HEALTH_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    position_ecef_m: _geometry_pb2.Vector3
    velocity_ecef_m_s: _geometry_pb2.Vector3
    clock_s: float
    clock_drift_s_s: float
    elevation_rad: float
    azimuth_rad: float
    range_std_m: float
    ephemeris_age_s: float
    issue: int
    health: int
    def __init__(self, satellite: _Optional[str] = ..., position_ecef_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., velocity_ecef_m_s: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., clock_s: _Optional[float] = ..., clock_drift_s_s: _Optional[float] = ..., elevation_rad: _Optional[float] = ..., azimuth_rad: _Optional[float] = ..., range_std_m: _Optional[float] = ..., ephemeris_age_s: _Optional[float] = ..., issue: _Optional[int] = ..., health: _Optional[int] = ...) -> None: ...

class CoarsePosition(_message.Message):
    __slots__ = ("position_ecef_m", "clock_offset_m", "age_s", "satellite_count")
    POSITION_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    CLOCK_OFFSET_M_FIELD_NUMBER: _ClassVar[int]
    AGE_S_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_COUNT_FIELD_NUMBER: _ClassVar[int]
    position_ecef_m: _geometry_pb2.Vector3
    clock_offset_m: float
    age_s: float
    satellite_count: int
    def __init__(self, position_ecef_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., clock_offset_m: _Optional[float] = ..., age_s: _Optional[float] = ..., satellite_count: _Optional[int] = ...) -> None: ...

class SignalCorrections(_message.Message):
    __slots__ = ("satellite", "signal", "distance_m", "sagnac_m", "satellite_clock_m", "relativity_m", "group_delay_m", "ionosphere_m", "hydrostatic_m", "wet_m", "hydrostatic_mapping", "wet_mapping", "shapiro_m", "antenna_m", "satellite_antenna_m", "solid_tide_m", "pole_tide_m", "ocean_loading_m", "wind_up_m", "phase_bias_m", "higher_ionosphere_m")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_M_FIELD_NUMBER: _ClassVar[int]
    SAGNAC_M_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_CLOCK_M_FIELD_NUMBER: _ClassVar[int]
    RELATIVITY_M_FIELD_NUMBER: _ClassVar[int]
    GROUP_DELAY_M_FIELD_NUMBER: _ClassVar[int]
    IONOSPHERE_M_FIELD_NUMBER: _ClassVar[int]
    HYDROSTATIC_M_FIELD_NUMBER: _ClassVar[int]
    WET_M_FIELD_NUMBER: _ClassVar[int]
    HYDROSTATIC_MAPPING_FIELD_NUMBER: _ClassVar[int]
    WET_MAPPING_FIELD_NUMBER: _ClassVar[int]
    SHAPIRO_M_FIELD_NUMBER: _ClassVar[int]
    ANTENNA_M_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_ANTENNA_M_FIELD_NUMBER: _ClassVar[int]
    SOLID_TIDE_M_FIELD_NUMBER: _ClassVar[int]
    POLE_TIDE_M_FIELD_NUMBER: _ClassVar[int]
    OCEAN_LOADING_M_FIELD_NUMBER: _ClassVar[int]
    WIND_UP_M_FIELD_NUMBER: _ClassVar[int]
    PHASE_BIAS_M_FIELD_NUMBER: _ClassVar[int]
    HIGHER_IONOSPHERE_M_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    signal: str
    distance_m: float
    sagnac_m: float
    satellite_clock_m: float
    relativity_m: float
    group_delay_m: float
    ionosphere_m: float
    hydrostatic_m: float
    wet_m: float
    hydrostatic_mapping: float
    wet_mapping: float
    shapiro_m: float
    antenna_m: float
    satellite_antenna_m: float
    solid_tide_m: float
    pole_tide_m: float
    ocean_loading_m: float
    wind_up_m: float
    phase_bias_m: float
    higher_ionosphere_m: float
    def __init__(self, satellite: _Optional[str] = ..., signal: _Optional[str] = ..., distance_m: _Optional[float] = ..., sagnac_m: _Optional[float] = ..., satellite_clock_m: _Optional[float] = ..., relativity_m: _Optional[float] = ..., group_delay_m: _Optional[float] = ..., ionosphere_m: _Optional[float] = ..., hydrostatic_m: _Optional[float] = ..., wet_m: _Optional[float] = ..., hydrostatic_mapping: _Optional[float] = ..., wet_mapping: _Optional[float] = ..., shapiro_m: _Optional[float] = ..., antenna_m: _Optional[float] = ..., satellite_antenna_m: _Optional[float] = ..., solid_tide_m: _Optional[float] = ..., pole_tide_m: _Optional[float] = ..., ocean_loading_m: _Optional[float] = ..., wind_up_m: _Optional[float] = ..., phase_bias_m: _Optional[float] = ..., higher_ionosphere_m: _Optional[float] = ...) -> None: ...

class CycleSlip(_message.Message):
    __slots__ = ("satellite", "signal", "detector", "statistic", "threshold", "size_cycles", "repaired")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    DETECTOR_FIELD_NUMBER: _ClassVar[int]
    STATISTIC_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    SIZE_CYCLES_FIELD_NUMBER: _ClassVar[int]
    REPAIRED_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    signal: str
    detector: SlipDetector
    statistic: float
    threshold: float
    size_cycles: float
    repaired: bool
    def __init__(self, satellite: _Optional[str] = ..., signal: _Optional[str] = ..., detector: _Optional[_Union[SlipDetector, str]] = ..., statistic: _Optional[float] = ..., threshold: _Optional[float] = ..., size_cycles: _Optional[float] = ..., repaired: _Optional[bool] = ...) -> None: ...

class Displacement(_message.Message):
    __slots__ = ("since_ns", "displacement_ecef_m", "covariance_enu_m2", "satellite_count", "unit_weight_std")
    SINCE_NS_FIELD_NUMBER: _ClassVar[int]
    DISPLACEMENT_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_ENU_M2_FIELD_NUMBER: _ClassVar[int]
    SATELLITE_COUNT_FIELD_NUMBER: _ClassVar[int]
    UNIT_WEIGHT_STD_FIELD_NUMBER: _ClassVar[int]
    since_ns: int
    displacement_ecef_m: _geometry_pb2.Vector3
    covariance_enu_m2: _geometry_pb2.SymmetricMatrix3
    satellite_count: int
    unit_weight_std: float
    def __init__(self, since_ns: _Optional[int] = ..., displacement_ecef_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., covariance_enu_m2: _Optional[_Union[_geometry_pb2.SymmetricMatrix3, _Mapping]] = ..., satellite_count: _Optional[int] = ..., unit_weight_std: _Optional[float] = ...) -> None: ...

class ReceiverClock(_message.Message):
    __slots__ = ("system", "offset_m", "offset_std_m", "drift_m_s", "drift_std_m_s")
    SYSTEM_FIELD_NUMBER: _ClassVar[int]
    OFFSET_M_FIELD_NUMBER: _ClassVar[int]
    OFFSET_STD_M_FIELD_NUMBER: _ClassVar[int]
    DRIFT_M_S_FIELD_NUMBER: _ClassVar[int]
    DRIFT_STD_M_S_FIELD_NUMBER: _ClassVar[int]
    system: str
    offset_m: float
    offset_std_m: float
    drift_m_s: float
    drift_std_m_s: float
    def __init__(self, system: _Optional[str] = ..., offset_m: _Optional[float] = ..., offset_std_m: _Optional[float] = ..., drift_m_s: _Optional[float] = ..., drift_std_m_s: _Optional[float] = ...) -> None: ...

class GnssGeometry(_message.Message):
    __slots__ = ("gps_count", "glonass_count", "galileo_count", "beidou_count", "qzss_count", "gdop", "pdop", "hdop", "vdop", "gps_pdop", "glonass_pdop", "galileo_pdop", "beidou_pdop")
    GPS_COUNT_FIELD_NUMBER: _ClassVar[int]
    GLONASS_COUNT_FIELD_NUMBER: _ClassVar[int]
    GALILEO_COUNT_FIELD_NUMBER: _ClassVar[int]
    BEIDOU_COUNT_FIELD_NUMBER: _ClassVar[int]
    QZSS_COUNT_FIELD_NUMBER: _ClassVar[int]
    GDOP_FIELD_NUMBER: _ClassVar[int]
    PDOP_FIELD_NUMBER: _ClassVar[int]
    HDOP_FIELD_NUMBER: _ClassVar[int]
    VDOP_FIELD_NUMBER: _ClassVar[int]
    GPS_PDOP_FIELD_NUMBER: _ClassVar[int]
    GLONASS_PDOP_FIELD_NUMBER: _ClassVar[int]
    GALILEO_PDOP_FIELD_NUMBER: _ClassVar[int]
    BEIDOU_PDOP_FIELD_NUMBER: _ClassVar[int]
    gps_count: int
    glonass_count: int
    galileo_count: int
    beidou_count: int
    qzss_count: int
    gdop: float
    pdop: float
    hdop: float
    vdop: float
    gps_pdop: float
    glonass_pdop: float
    galileo_pdop: float
    beidou_pdop: float
    def __init__(self, gps_count: _Optional[int] = ..., glonass_count: _Optional[int] = ..., galileo_count: _Optional[int] = ..., beidou_count: _Optional[int] = ..., qzss_count: _Optional[int] = ..., gdop: _Optional[float] = ..., pdop: _Optional[float] = ..., hdop: _Optional[float] = ..., vdop: _Optional[float] = ..., gps_pdop: _Optional[float] = ..., glonass_pdop: _Optional[float] = ..., galileo_pdop: _Optional[float] = ..., beidou_pdop: _Optional[float] = ...) -> None: ...

class DoubleDifferenceAmbiguity(_message.Message):
    __slots__ = ("satellite", "reference", "signal", "float_cycles", "float_std_cycles", "integer_cycles", "status")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    REFERENCE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    FLOAT_CYCLES_FIELD_NUMBER: _ClassVar[int]
    FLOAT_STD_CYCLES_FIELD_NUMBER: _ClassVar[int]
    INTEGER_CYCLES_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    reference: str
    signal: str
    float_cycles: float
    float_std_cycles: float
    integer_cycles: float
    status: AmbiguityStatus
    def __init__(self, satellite: _Optional[str] = ..., reference: _Optional[str] = ..., signal: _Optional[str] = ..., float_cycles: _Optional[float] = ..., float_std_cycles: _Optional[float] = ..., integer_cycles: _Optional[float] = ..., status: _Optional[_Union[AmbiguityStatus, str]] = ...) -> None: ...

class AmbiguityResolution(_message.Message):
    __slots__ = ("candidate_count", "fixed_count", "ratio", "w_ratio", "threshold", "success_rate", "status")
    CANDIDATE_COUNT_FIELD_NUMBER: _ClassVar[int]
    FIXED_COUNT_FIELD_NUMBER: _ClassVar[int]
    RATIO_FIELD_NUMBER: _ClassVar[int]
    W_RATIO_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    SUCCESS_RATE_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    candidate_count: int
    fixed_count: int
    ratio: float
    w_ratio: float
    threshold: float
    success_rate: float
    status: AmbiguityStatus
    def __init__(self, candidate_count: _Optional[int] = ..., fixed_count: _Optional[int] = ..., ratio: _Optional[float] = ..., w_ratio: _Optional[float] = ..., threshold: _Optional[float] = ..., success_rate: _Optional[float] = ..., status: _Optional[_Union[AmbiguityStatus, str]] = ...) -> None: ...

class RelativePosition(_message.Message):
    __slots__ = ("baseline_ecef_m", "baseline_enu_m", "covariance_enu_m2", "length_m", "length_std_m", "heading_rad", "heading_std_rad", "pitch_rad", "pitch_std_rad", "base_age_s", "status")
    BASELINE_ECEF_M_FIELD_NUMBER: _ClassVar[int]
    BASELINE_ENU_M_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_ENU_M2_FIELD_NUMBER: _ClassVar[int]
    LENGTH_M_FIELD_NUMBER: _ClassVar[int]
    LENGTH_STD_M_FIELD_NUMBER: _ClassVar[int]
    HEADING_RAD_FIELD_NUMBER: _ClassVar[int]
    HEADING_STD_RAD_FIELD_NUMBER: _ClassVar[int]
    PITCH_RAD_FIELD_NUMBER: _ClassVar[int]
    PITCH_STD_RAD_FIELD_NUMBER: _ClassVar[int]
    BASE_AGE_S_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    baseline_ecef_m: _geometry_pb2.Vector3
    baseline_enu_m: _geometry_pb2.Vector3
    covariance_enu_m2: _geometry_pb2.SymmetricMatrix3
    length_m: float
    length_std_m: float
    heading_rad: float
    heading_std_rad: float
    pitch_rad: float
    pitch_std_rad: float
    base_age_s: float
    status: _solution_pb2.SolutionStatus
    def __init__(self, baseline_ecef_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., baseline_enu_m: _Optional[_Union[_geometry_pb2.Vector3, _Mapping]] = ..., covariance_enu_m2: _Optional[_Union[_geometry_pb2.SymmetricMatrix3, _Mapping]] = ..., length_m: _Optional[float] = ..., length_std_m: _Optional[float] = ..., heading_rad: _Optional[float] = ..., heading_std_rad: _Optional[float] = ..., pitch_rad: _Optional[float] = ..., pitch_std_rad: _Optional[float] = ..., base_age_s: _Optional[float] = ..., status: _Optional[_Union[_solution_pb2.SolutionStatus, str]] = ...) -> None: ...

class ZenithDelay(_message.Message):
    __slots__ = ("hydrostatic_m", "wet_m", "wet_std_m", "gradient_north_m", "gradient_north_std_m", "gradient_east_m", "gradient_east_std_m")
    HYDROSTATIC_M_FIELD_NUMBER: _ClassVar[int]
    WET_M_FIELD_NUMBER: _ClassVar[int]
    WET_STD_M_FIELD_NUMBER: _ClassVar[int]
    GRADIENT_NORTH_M_FIELD_NUMBER: _ClassVar[int]
    GRADIENT_NORTH_STD_M_FIELD_NUMBER: _ClassVar[int]
    GRADIENT_EAST_M_FIELD_NUMBER: _ClassVar[int]
    GRADIENT_EAST_STD_M_FIELD_NUMBER: _ClassVar[int]
    hydrostatic_m: float
    wet_m: float
    wet_std_m: float
    gradient_north_m: float
    gradient_north_std_m: float
    gradient_east_m: float
    gradient_east_std_m: float
    def __init__(self, hydrostatic_m: _Optional[float] = ..., wet_m: _Optional[float] = ..., wet_std_m: _Optional[float] = ..., gradient_north_m: _Optional[float] = ..., gradient_north_std_m: _Optional[float] = ..., gradient_east_m: _Optional[float] = ..., gradient_east_std_m: _Optional[float] = ...) -> None: ...

class SlantIonosphere(_message.Message):
    __slots__ = ("satellite", "delay_m", "delay_std_m")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    DELAY_M_FIELD_NUMBER: _ClassVar[int]
    DELAY_STD_M_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    delay_m: float
    delay_std_m: float
    def __init__(self, satellite: _Optional[str] = ..., delay_m: _Optional[float] = ..., delay_std_m: _Optional[float] = ...) -> None: ...

class ReceiverBias(_message.Message):
    __slots__ = ("system", "signal", "bias_m", "bias_std_m")
    SYSTEM_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    BIAS_M_FIELD_NUMBER: _ClassVar[int]
    BIAS_STD_M_FIELD_NUMBER: _ClassVar[int]
    system: str
    signal: str
    bias_m: float
    bias_std_m: float
    def __init__(self, system: _Optional[str] = ..., signal: _Optional[str] = ..., bias_m: _Optional[float] = ..., bias_std_m: _Optional[float] = ...) -> None: ...

class PhaseAmbiguity(_message.Message):
    __slots__ = ("satellite", "signal", "ambiguity_m", "ambiguity_std_m", "epoch_count")
    SATELLITE_FIELD_NUMBER: _ClassVar[int]
    SIGNAL_FIELD_NUMBER: _ClassVar[int]
    AMBIGUITY_M_FIELD_NUMBER: _ClassVar[int]
    AMBIGUITY_STD_M_FIELD_NUMBER: _ClassVar[int]
    EPOCH_COUNT_FIELD_NUMBER: _ClassVar[int]
    satellite: str
    signal: str
    ambiguity_m: float
    ambiguity_std_m: float
    epoch_count: int
    def __init__(self, satellite: _Optional[str] = ..., signal: _Optional[str] = ..., ambiguity_m: _Optional[float] = ..., ambiguity_std_m: _Optional[float] = ..., epoch_count: _Optional[int] = ...) -> None: ...
