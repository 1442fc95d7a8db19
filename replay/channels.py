"""The only table of topics.

It says what each channel carries, how its rows are told apart and how far two runs
may differ before a person has to look.

A topic is a pattern; `{name}` stands for one path element that a run or a
receiver chooses. Nothing else in the package spells a topic.
"""

from __future__ import annotations

import dataclasses
import enum
import re
from collections.abc import Mapping
from typing import Final

from replay.errors import SchemaError


class Difference(enum.Enum):
    """How two values of a field are subtracted."""

    LINEAR = "linear"
    ANGLE = "angle"  # wrapped to plus or minus pi
    ROTATION = "rotation"  # of quaternions: the angle between the two attitudes
    EXACT = "exact"  # enumerations, counts, text
    COVARIANCE = "covariance"  # by definiteness and extreme generalised eigenvalues


@dataclasses.dataclass(frozen=True, slots=True)
class Tolerance:
    """How far a field may differ.

    Attributes
    ----------
    absolute : float
        In `unit`; for COVARIANCE, how far a generalised eigenvalue may stand from one.
    unit : str
        Unit of the field.
    difference : Difference
        How two values are subtracted.
    """

    absolute: float
    unit: str
    difference: Difference = Difference.LINEAR


@dataclasses.dataclass(frozen=True, slots=True)
class ChannelSpec:
    """One kind of channel.

    Attributes
    ----------
    name : str
        How code refers to it.
    topic : str
        Pattern with `{...}` for the parts that are chosen.
    message : str
        Full name of the protobuf message.
    key : tuple of str
        Fields that tell rows of one valid time apart.
    tolerances : mapping of field name to Tolerance
        A field that is not named is compared exactly.
    about : str
        One line for a person.
    """

    name: str
    topic: str
    message: str
    about: str
    key: tuple[str, ...] = ()
    tolerances: Mapping[str, Tolerance] = dataclasses.field(default_factory=dict)

    def __hash__(self) -> int:
        """By name: a mapping of tolerances has no hash."""
        return hash(self.name)

    def at(self, **parts: str) -> str:
        """Topic with its parts filled in."""
        return self.topic.format(**parts)

    def matches(self, topic: str) -> bool:
        """Whether a topic is of this kind."""
        return _pattern(self.topic).fullmatch(topic) is not None

    def parts(self, topic: str) -> dict[str, str]:
        """The chosen parts of a topic of this kind."""
        match = _pattern(self.topic).fullmatch(topic)
        if match is None:
            raise SchemaError(f"{topic} is no {self.topic}")
        return match.groupdict()


def _pattern(topic: str) -> re.Pattern[str]:
    return re.compile(re.sub(r"\\{(\w+)\\}", r"(?P<\1>[^/]+)", re.escape(topic)))


_M = Tolerance(1e-4, "m")
_M_S = Tolerance(1e-4, "m/s")
_RAD = Tolerance(1e-6, "rad", Difference.ANGLE)
_M2 = Tolerance(1e-6, "m^2")

IMU: Final = ChannelSpec(
    "IMU",
    "/imu/raw",
    "replay.ImuSample",
    "inertial samples",
    tolerances={
        "angular_rate_body_rad_s": Tolerance(1e-9, "rad/s"),
        "specific_force_body_m_s2": Tolerance(1e-9, "m/s^2"),
    },
)
IMU_UNIT: Final = ChannelSpec(
    "IMU_UNIT",
    "/imu/{unit}/raw",
    IMU.message,
    "samples of a further inertial unit, which `imu.name` puts in the place of the first",
    tolerances=IMU.tolerances,
)
GNSS_FIX: Final = ChannelSpec(
    "GNSS_FIX",
    "/gnss/{receiver}/fix",
    "replay.GnssFix",
    "positions and velocities of a GNSS antenna",
    tolerances={
        "position_ecef_m": _M,
        "velocity_ecef_m_s": _M_S,
        "position_covariance_enu_m2": _M2,
        "velocity_covariance_enu_m2_s2": Tolerance(1e-6, "m^2/s^2"),
    },
)
GNSS_OBS: Final = ChannelSpec(
    "GNSS_OBS",
    "/gnss/{receiver}/obs",
    "replay.GnssObservation",
    "code, carrier, Doppler and strength per satellite and signal",
    key=("satellite", "signal"),
    tolerances={
        "pseudorange_m": Tolerance(1e-4, "m"),
        "carrier_phase_cycles": Tolerance(1e-4, "cycle"),
        "doppler_hz": Tolerance(1e-4, "Hz"),
        "cn0_dbhz": Tolerance(1e-3, "dB-Hz"),
    },
)
RECEIVER: Final = ChannelSpec(
    "RECEIVER",
    "/gnss/{receiver}/receiver",
    "replay.ReceiverInfo",
    "receiver, antenna and stated position",
    tolerances={
        "approximate_position_ecef_m": _M,
        "antenna_offset_enu_m": _M,
        "interval_s": Tolerance(1e-9, "s"),
    },
)
ANTENNAS: Final = ChannelSpec(
    "ANTENNAS",
    "/gnss/antennas",
    "replay.AntennaCalibration",
    "phase centres of antennas",
    key=("antenna", "serial", "frequency"),
)
RECEIVER_EPOCH: Final = ChannelSpec(
    "RECEIVER_EPOCH",
    "/gnss/{receiver}/epochs",
    "replay.ReceiverEpoch",
    "what a receiver said of each epoch",
    tolerances={"clock_offset_s": Tolerance(1e-12, "s")},
)
NAV: Final = ChannelSpec(
    "NAV",
    "/gnss/nav",
    "replay.BroadcastEphemeris",
    "broadcast orbits and clocks",
    key=("satellite", "source", "toe_ns"),
)
NAV_IONOSPHERE: Final = ChannelSpec(
    "NAV_IONOSPHERE",
    "/gnss/nav/ionosphere",
    "replay.BroadcastIonosphere",
    "broadcast ionosphere",
    key=("system", "model"),
)
NAV_TIME: Final = ChannelSpec(
    "NAV_TIME",
    "/gnss/nav/time",
    "replay.TimeCorrection",
    "broadcast differences of time scales",
    key=("scales",),
)
PRODUCTS: Final = ChannelSpec(
    "PRODUCTS",
    "/gnss/products",
    "replay.ProductInfo",
    "what files of precise products say of themselves",
    key=("source",),
)
# Products are computed afterwards; their log time is the start of the log, so that a replay
# may use all of them from its first row on. The valid time is the epoch of the value.
PRECISE_ORBIT: Final = ChannelSpec(
    "PRECISE_ORBIT",
    "/gnss/orbit",
    "replay.PreciseOrbit",
    "precise orbits (SP3), all of them known from the start of the log",
    key=("satellite",),
)
PRECISE_CLOCK: Final = ChannelSpec(
    "PRECISE_CLOCK",
    "/gnss/clock",
    "replay.PreciseClock",
    "precise clocks (RINEX CLK), all of them known from the start of the log",
    key=("satellite", "station"),
)
SIGNAL_BIAS: Final = ChannelSpec(
    "SIGNAL_BIAS",
    "/gnss/bias",
    "replay.SignalBias",
    "biases of signals (SINEX-BIAS), all of them known from the start of the log",
    key=("satellite", "station", "system", "kind", "observation", "second_observation"),
)
EARTH_ROTATION: Final = ChannelSpec(
    "EARTH_ROTATION",
    "/gnss/earth_rotation",
    "replay.EarthRotation",
    "pole and rotation of the Earth (ERP), all known from the start of the log",
)
IONOSPHERE_MAP: Final = ChannelSpec(
    "IONOSPHERE_MAP",
    "/gnss/ionosphere_map",
    "replay.IonosphereMap",
    "maps of the ionosphere (IONEX), all of them known from the start of the log",
    key=("height_m",),
)
OCEAN_LOADING: Final = ChannelSpec(
    "OCEAN_LOADING",
    "/gnss/{receiver}/ocean_loading",
    "replay.OceanLoading",
    "tides that the ocean makes of a station's ground (BLQ)",
    key=("station",),
)
SATELLITES: Final = ChannelSpec(
    "SATELLITES",
    "/gnss/{receiver}/satellites",
    "replay.SatelliteSight",
    "orbit, clock, elevation and azimuth per satellite",
    key=("satellite",),
    tolerances={
        "position_ecef_m": _M,
        "velocity_ecef_m_s": _M_S,
        "clock_s": Tolerance(1e-12, "s"),
        "clock_drift_s_s": Tolerance(1e-15, "s/s"),
        "elevation_rad": _RAD,
        "azimuth_rad": _RAD,
        "range_std_m": _M,
        "ephemeris_age_s": Tolerance(1e-6, "s"),
    },
)
CORRECTIONS: Final = ChannelSpec(
    "CORRECTIONS",
    "/gnss/{receiver}/corrections",
    "replay.SignalCorrections",
    "every term between range and pseudorange, per satellite and signal",
    key=("satellite", "signal"),
    tolerances={
        "distance_m": _M,
        "sagnac_m": _M,
        "satellite_clock_m": _M,
        "relativity_m": _M,
        "group_delay_m": _M,
        "ionosphere_m": _M,
        "hydrostatic_m": _M,
        "wet_m": _M,
        "hydrostatic_mapping": Tolerance(1e-6, "1"),
        "wet_mapping": Tolerance(1e-6, "1"),
        "shapiro_m": _M,
        "antenna_m": _M,
        "satellite_antenna_m": _M,
        "solid_tide_m": _M,
        "pole_tide_m": _M,
        "ocean_loading_m": _M,
        "wind_up_m": _M,
        "phase_bias_m": _M,
        "higher_ionosphere_m": _M,
    },
)
COARSE: Final = ChannelSpec(
    "COARSE",
    "/gnss/{receiver}/coarse",
    "replay.CoarsePosition",
    "position and clock that orbits and corrections were computed with",
    tolerances={
        "position_ecef_m": _M,
        "clock_offset_m": _M,
        "age_s": Tolerance(1e-9, "s"),
    },
)
GNSS_EVENTS: Final = ChannelSpec(
    "GNSS_EVENTS",
    "/gnss/{receiver}/events",
    "replay.FilterEvent",
    "what was wrong with a receiver's data",
    key=("kind", "detail"),
    tolerances={"value": Tolerance(1e-6, "1")},
)
SLIPS: Final = ChannelSpec(
    "SLIPS",
    "/gnss/{receiver}/slips",
    "replay.CycleSlip",
    "breaks of carrier phases",
    key=("satellite", "signal", "detector"),
    tolerances={
        "statistic": Tolerance(1e-6, "cycle"),
        "threshold": Tolerance(1e-6, "cycle"),
        "size_cycles": Tolerance(1e-6, "cycle"),
    },
)
DISPLACEMENT: Final = ChannelSpec(
    "DISPLACEMENT",
    "/gnss/{receiver}/displacement",
    "replay.Displacement",
    "position change from carrier phases",
    tolerances={
        "displacement_ecef_m": _M,
        "covariance_enu_m2": _M2,
        "unit_weight_std": Tolerance(1e-6, "1"),
    },
)
TRUTH: Final = ChannelSpec(
    "TRUTH",
    "/truth",
    "replay.Truth",
    "the best knowledge of position, velocity and attitude",
    tolerances={
        "position_ecef_m": _M,
        "velocity_enu_m_s": _M_S,
        "attitude_rad": _RAD,
    },
)
NETWORK_AMBIGUITIES: Final = ChannelSpec(
    "NETWORK_AMBIGUITIES",
    "/network/{baseline}/ambiguities",
    "replay.DoubleDifferenceAmbiguity",
    "ambiguities between two reference stations; the wide lane is the signal WL",
    key=("satellite", "signal"),
    tolerances={
        "float_cycles": Tolerance(1e-4, "cycle"),
        "float_std_cycles": Tolerance(1e-4, "cycle"),
        "integer_cycles": Tolerance(1e-9, "cycle"),
    },
)
NETWORK_RESOLUTION: Final = ChannelSpec(
    "NETWORK_RESOLUTION",
    "/network/{baseline}/resolution",
    "replay.NetworkResolution",
    "tests of the integers between two reference stations",
    key=("signal",),
    tolerances={
        "ratio": Tolerance(1e-4, "1"),
        "w_ratio": Tolerance(1e-4, "1"),
        "threshold": Tolerance(1e-6, "1"),
        "success_rate": Tolerance(1e-6, "1"),
    },
)
NETWORK_RESIDUALS: Final = ChannelSpec(
    "NETWORK_RESIDUALS",
    "/network/{baseline}/residuals",
    "replay.NetworkResidual",
    "phases between two reference stations less everything that is known",
    key=("satellite", "signal"),
    tolerances={"residual_m": _M, "residual_std_m": _M},
)
NETWORK_ERRORS: Final = ChannelSpec(
    "NETWORK_ERRORS",
    "/network/{baseline}/errors",
    "replay.BaselineError",
    "filtered errors between two reference stations that grow with the distance",
    key=("satellite", "signal"),
    tolerances={
        "error_m": _M,
        "error_rate_m_s": Tolerance(1e-6, "m/s"),
        "error_acceleration_m_s2": Tolerance(1e-8, "m/s^2"),
        "multipath_m": _M,
        "error_std_m": _M,
        "error_rate_std_m_s": Tolerance(1e-6, "m/s"),
        "error_acceleration_std_m_s2": Tolerance(1e-8, "m/s^2"),
        "multipath_std_m": _M,
        "innovation_m": _M,
        "innovation_std_m": _M,
    },
)
NETWORK_EVENTS: Final = ChannelSpec(
    "NETWORK_EVENTS",
    "/network/{baseline}/events",
    "replay.FilterEvent",
    "slips, repaired integers, stations lost, of a baseline between reference stations",
    key=("kind", "detail"),
    tolerances={"value": Tolerance(1e-6, "1")},
)
NETWORK_CORRECTIONS: Final = ChannelSpec(
    "NETWORK_CORRECTIONS",
    "/network/{rover}/corrections",
    "replay.NetworkCorrection",
    "errors of a rover's phases against the master station, from the network",
    key=("satellite", "signal"),
    tolerances={
        "correction_m": _M,
        "correction_std_m": _M,
        "misfit_m": _M,
        "age_s": Tolerance(1e-9, "s"),
    },
)
SIGNAL_TRUTH: Final = ChannelSpec(
    "SIGNAL_TRUTH",
    "/truth/{receiver}/signals",
    "replay.SignalTruth",
    "what a simulator put into each signal",
    key=("satellite", "signal"),
    tolerances={
        name: _M
        for name in (
            "range_m",
            "satellite_clock_m",
            "receiver_clock_m",
            "ionosphere_m",
            "troposphere_m",
            "shapiro_m",
            "orbit_error_m",
            "code_delay_m",
            "code_multipath_m",
            "carrier_multipath_m",
            "code_noise_m",
            "carrier_noise_m",
            "antenna_m",
            "solid_tide_m",
            "pole_tide_m",
            "wind_up_m",
            "carrier_delay_m",
        )
    },
)
FILTER_STATE: Final = ChannelSpec(
    "FILTER_STATE",
    "/filter/{run}/state",
    "replay.FilterState",
    "state of a filter after each epoch",
    tolerances={
        "position_ecef_m": _M,
        "velocity_ecef_m_s": _M_S,
        "q_body_to_ecef": Tolerance(1e-6, "rad", Difference.ROTATION),
        "gyro_bias_body_rad_s": Tolerance(1e-8, "rad/s"),
        "accel_bias_body_m_s2": Tolerance(1e-6, "m/s^2"),
        "gyro_scale_factor": Tolerance(1e-7, "1"),
        "accel_scale_factor": Tolerance(1e-7, "1"),
        "mounting_angles_rad": _RAD,
        "non_slip_point_body_m": _M,
        "squat_rad_s2_m": Tolerance(1e-7, "rad/(m/s^2)"),
    },
)
FILTER_COVARIANCE: Final = ChannelSpec(
    "FILTER_COVARIANCE",
    "/filter/{run}/covariance",
    "replay.FilterCovariance",
    "covariance of a filter's error states after each epoch",
    tolerances={"upper_triangle": Tolerance(1e-6, "1", Difference.COVARIANCE)},
)
FILTER_TRANSITION: Final = ChannelSpec(
    "FILTER_TRANSITION",
    "/filter/{run}/transition",
    "replay.FilterTransition",
    "how a filter came from update to update, for a smoother",
    tolerances={
        "value": Tolerance(1e-9, "1"),
        "predicted_upper_triangle": Tolerance(1e-6, "1"),
        "correction": Tolerance(1e-6, "1"),
        "updated_upper_triangle": Tolerance(1e-6, "1"),
    },
)
FILTER_INNOVATIONS: Final = ChannelSpec(
    "FILTER_INNOVATIONS",
    "/filter/{run}/innovations",
    "replay.Innovation",
    "every scalar measurement as a filter met it",
    key=("kind", "axis", "satellite", "signal"),
    tolerances={
        "innovation": Tolerance(1e-4, "m"),
        "innovation_std": Tolerance(1e-4, "m"),
        "measurement_std": Tolerance(1e-6, "m"),
        "normalized": Tolerance(1e-3, "1"),
    },
)
FILTER_EVENTS: Final = ChannelSpec(
    "FILTER_EVENTS",
    "/filter/{run}/events",
    "replay.FilterEvent",
    "alignment, outages, stops, rejections",
    key=("kind",),
    tolerances={"value": Tolerance(1e-6, "1")},
)
FILTER_CLOCKS: Final = ChannelSpec(
    "FILTER_CLOCKS",
    "/filter/{run}/clocks",
    "replay.ReceiverClock",
    "receiver clock against each system",
    key=("system",),
    tolerances={
        "offset_m": _M,
        "offset_std_m": _M,
        "drift_m_s": _M_S,
        "drift_std_m_s": _M_S,
    },
)
FILTER_GEOMETRY: Final = ChannelSpec(
    "FILTER_GEOMETRY",
    "/filter/{run}/geometry",
    "replay.GnssGeometry",
    "satellites used and dilution of precision",
    tolerances={
        name: Tolerance(1e-6, "1")
        for name in (
            "gdop",
            "pdop",
            "hdop",
            "vdop",
            "gps_pdop",
            "glonass_pdop",
            "galileo_pdop",
            "beidou_pdop",
        )
    },
)
FILTER_TROPOSPHERE: Final = ChannelSpec(
    "FILTER_TROPOSPHERE",
    "/filter/{run}/troposphere",
    "replay.ZenithDelay",
    "delay of the troposphere in the zenith, estimated",
    tolerances={
        name: _M
        for name in (
            "hydrostatic_m",
            "wet_m",
            "wet_std_m",
            "gradient_north_m",
            "gradient_north_std_m",
            "gradient_east_m",
            "gradient_east_std_m",
        )
    },
)
FILTER_IONOSPHERE: Final = ChannelSpec(
    "FILTER_IONOSPHERE",
    "/filter/{run}/ionosphere",
    "replay.SlantIonosphere",
    "slant delays of the ionosphere, estimated",
    key=("satellite",),
    tolerances={"delay_m": _M, "delay_std_m": _M},
)
FILTER_BIASES: Final = ChannelSpec(
    "FILTER_BIASES",
    "/filter/{run}/receiver_biases",
    "replay.ReceiverBias",
    "biases of the receiver between codes, estimated",
    key=("system", "signal"),
    tolerances={"bias_m": _M, "bias_std_m": _M},
)
FILTER_PHASES: Final = ChannelSpec(
    "FILTER_PHASES",
    "/filter/{run}/phases",
    "replay.PhaseAmbiguity",
    "ambiguities of carrier phases, estimated",
    key=("satellite", "signal"),
    tolerances={"ambiguity_m": _M, "ambiguity_std_m": _M},
)
FILTER_AMBIGUITIES: Final = ChannelSpec(
    "FILTER_AMBIGUITIES",
    "/filter/{run}/ambiguities",
    "replay.DoubleDifferenceAmbiguity",
    "ambiguities as differences to a reference satellite, real and integer",
    key=("satellite", "signal"),
    tolerances={
        "float_cycles": Tolerance(1e-4, "cycle"),
        "float_std_cycles": Tolerance(1e-4, "cycle"),
        "integer_cycles": Tolerance(1e-9, "cycle"),
    },
)
FILTER_RESOLUTION: Final = ChannelSpec(
    "FILTER_RESOLUTION",
    "/filter/{run}/resolution",
    "replay.AmbiguityResolution",
    "tests of the integers of each epoch",
    tolerances={
        "ratio": Tolerance(1e-4, "1"),
        "w_ratio": Tolerance(1e-4, "1"),
        "threshold": Tolerance(1e-6, "1"),
        "success_rate": Tolerance(1e-6, "1"),
    },
)
RELATIVE_POSITION: Final = ChannelSpec(
    "RELATIVE_POSITION",
    "/filter/{run}/baseline",
    "replay.RelativePosition",
    "position relative to the base",
    tolerances={
        "baseline_ecef_m": _M,
        "baseline_enu_m": _M,
        "covariance_enu_m2": _M2,
        "length_m": _M,
        "length_std_m": _M,
        "heading_rad": _RAD,
        "heading_std_rad": Tolerance(1e-6, "rad"),
        "pitch_rad": Tolerance(1e-6, "rad"),
        "pitch_std_rad": Tolerance(1e-6, "rad"),
        "base_age_s": Tolerance(1e-9, "s"),
    },
)
SOLUTION: Final = ChannelSpec(
    "SOLUTION",
    "/solution/{run}",
    "replay.Solution",
    "position, velocity and attitude with their uncertainty",
    tolerances={
        "position_ecef_m": _M,
        "velocity_enu_m_s": _M_S,
        "attitude_rad": _RAD,
        "angular_rate_body_rad_s": Tolerance(1e-8, "rad/s"),
        "position_covariance_enu_m2": _M2,
        "velocity_std_enu_m_s": _M_S,
        "attitude_std_rad": Tolerance(1e-6, "rad"),
    },
)
TRACE: Final = ChannelSpec(
    "TRACE", "/replay/trace", "replay.Trace", "digests per stage and step", key=("stage",)
)
CHECKPOINT: Final = ChannelSpec(
    "CHECKPOINT",
    "/replay/checkpoint",
    "replay.Checkpoint",
    "states from which a replay can go on",
    key=("stage",),
)

# The order is the rank that breaks ties between rows of one time and one depth.
CHANNELS: Final[tuple[ChannelSpec, ...]] = (
    IMU,
    IMU_UNIT,
    RECEIVER,
    ANTENNAS,
    NAV,
    NAV_IONOSPHERE,
    NAV_TIME,
    PRODUCTS,
    PRECISE_ORBIT,
    PRECISE_CLOCK,
    SIGNAL_BIAS,
    EARTH_ROTATION,
    IONOSPHERE_MAP,
    OCEAN_LOADING,
    RECEIVER_EPOCH,
    GNSS_OBS,
    GNSS_FIX,
    TRUTH,
    SIGNAL_TRUTH,
    SATELLITES,
    CORRECTIONS,
    COARSE,
    GNSS_EVENTS,
    SLIPS,
    DISPLACEMENT,
    NETWORK_AMBIGUITIES,
    NETWORK_RESOLUTION,
    NETWORK_RESIDUALS,
    NETWORK_EVENTS,
    NETWORK_ERRORS,
    NETWORK_CORRECTIONS,
    FILTER_INNOVATIONS,
    FILTER_CLOCKS,
    FILTER_GEOMETRY,
    FILTER_TROPOSPHERE,
    FILTER_IONOSPHERE,
    FILTER_BIASES,
    FILTER_PHASES,
    FILTER_AMBIGUITIES,
    FILTER_RESOLUTION,
    RELATIVE_POSITION,
    FILTER_STATE,
    FILTER_COVARIANCE,
    FILTER_TRANSITION,
    FILTER_EVENTS,
    SOLUTION,
    TRACE,
    CHECKPOINT,
)


def find(topic: str) -> ChannelSpec | None:
    """Kind of a topic, or None for a topic that this project does not know."""
    for spec in CHANNELS:
        if spec.matches(topic):
            return spec
    return None


def rank(topic: str) -> int:
    """Place of a topic among rows of one time and depth; unknown topics come last."""
    for index, spec in enumerate(CHANNELS):
        if spec.matches(topic):
            return index
    return len(CHANNELS)
