"""What an imperfect inertial unit makes of perfect rates and specific forces.

measured = (I + scale + misalignment) true + bias + drift + walk + noise + vibration, for
gyros also g-sensitivity times the specific force; then rounded, either each value to the
resolution or their sum to whole increments. Scale and bias have the sign that the
filter's states have.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Annotated, Any, Final

import numpy as np

from replay.configuration import STANDARD_GRAVITY_M_S2, Section, quantity
from replay.errors import ConfigurationError
from replay.simulate.noise import Floats, correlated, normals

_HOUR_S: Final = 3600.0
_MOVING_M_S: Final = 1.0  # at this speed vibration has its full size


class ImuErrors(Section, frozen=True):
    """Standard deviations of an inertial unit's errors, the same for the three axes."""

    gyro_noise: Annotated[float, quantity("rad/sqrt(s)", "angle random walk")] = 0.0
    accel_noise: Annotated[float, quantity("m/s/sqrt(s)", "velocity random walk")] = 0.0
    gyro_bias: Annotated[float, quantity("rad/s", "drawn once")] = 0.0
    accel_bias: Annotated[float, quantity("m/s^2", "drawn once")] = 0.0
    gyro_drift: Annotated[float, quantity("rad/s", "Gauss-Markov deviation")] = 0.0
    gyro_drift_tau: Annotated[float, quantity("s", "its correlation time")] = 300.0
    accel_drift: Annotated[float, quantity("m/s^2", "Gauss-Markov deviation")] = 0.0
    accel_drift_tau: Annotated[float, quantity("s", "its correlation time")] = 300.0
    gyro_walk: Annotated[float, quantity("rad/s", "random walk of the bias in an hour")] = 0.0
    accel_walk: Annotated[float, quantity("m/s^2", "random walk of the bias in an hour")] = 0.0
    gyro_scale: Annotated[float, quantity("1", "drawn once")] = 0.0
    accel_scale: Annotated[float, quantity("1", "drawn once")] = 0.0
    misalignment: Annotated[float, quantity("rad", "of each axis to each other")] = 0.0
    gyro_g_sensitivity: Annotated[
        float, quantity("rad/s", "at 1 g, of each gyro to each axis of force; drawn once")
    ] = 0.0
    gyro_increment: Annotated[float, quantity("rad", "of whole pulses; 0 is none")] = 0.0
    accel_increment: Annotated[float, quantity("m/s", "of whole pulses; 0 is none")] = 0.0
    gyro_resolution: Annotated[float, quantity("rad/s", "last digit; 0 is none")] = 0.0
    accel_resolution: Annotated[float, quantity("m/s^2", "last digit; 0 is none")] = 0.0
    vibration_velocity: Annotated[float, quantity("m/s", "of the moving vehicle")] = 0.0
    vibration_angle: Annotated[float, quantity("rad", "of the moving vehicle")] = 0.0


# A Gauss-Markov process whose largest Allan deviation is B has the deviation B / 0.618
# (IEEE Std 952-1997, annex C): drifts below are 1.6 times the in-run bias instability.
# "Assumed" marks what the data sheet does not tell.
IMU_GRADES: Final[Mapping[str, Mapping[str, Any]]] = {
    "perfect": {},
    # Honeywell HG9900, brochure N61-1638-000-000: 0.0035 deg/h, 0.002 deg/sqrt(h), 5 ppm;
    # 25 ug, 100 ppm. Accelerometer noise and drifts are assumed.
    "navigation": {
        "gyro_noise": "0.002 deg/sqrt(h)",
        "accel_noise": "10 ug/sqrt(Hz)",
        "gyro_bias": "0.0035 deg/h",
        "accel_bias": "25 ug",
        "gyro_drift": "0.001 deg/h",
        "gyro_drift_tau": "1 h",
        "accel_drift": "5 ug",
        "accel_drift_tau": "1 h",
        "gyro_scale": "5 ppm",
        "accel_scale": "100 ppm",
    },
    # Honeywell HG1700 AG58, brochure N61-1619-000-001: 1 deg/h, 0.125 deg/sqrt(h), 150 ppm;
    # 1 mg, 0.065 ft/s/sqrt(h), 300 ppm. Drifts are assumed.
    "tactical": {
        "gyro_noise": "0.125 deg/sqrt(h)",
        "accel_noise": "0.0198 m/s/sqrt(h)",
        "gyro_bias": "1 deg/h",
        "accel_bias": "1 mg",
        "gyro_drift": "0.5 deg/h",
        "gyro_drift_tau": "600 s",
        "accel_drift": "50 ug",
        "accel_drift_tau": "600 s",
        "gyro_scale": "150 ppm",
        "accel_scale": "300 ppm",
    },
    # Analog Devices ADIS16470, data sheet: 0.34 deg/sqrt(h), in-run 8 deg/h; 0.037 m/s/sqrt(h),
    # in-run 13 ug. Turn-on biases, scale factors and correlation times are assumed.
    "industrial": {
        "gyro_noise": "0.34 deg/sqrt(h)",
        "accel_noise": "0.037 m/s/sqrt(h)",
        "gyro_bias": "0.1 deg/s",
        "accel_bias": "2 mg",
        "gyro_drift": "13 deg/h",
        "accel_drift": "21 ug",
        "gyro_scale": "0.1 %",
        "accel_scale": "0.1 %",
        "vibration_velocity": "1 mm/s",
        "vibration_angle": "20 arcsec",
    },
    # The same unit in a vehicle, whose biases and scale factors were taken out once: TDK
    # ICM-20602, data sheet DS-000176: 4 mdeg/s/sqrt(Hz), 100 ug/sqrt(Hz). What is left at turn-on
    # (a tenth of the data sheet's 1 %, 0.2 deg/s, 5 mg), the in-run instabilities (10 deg/h and
    # 40 ug) and correlation times are assumed.
    "icm-20602": {
        "gyro_noise": "0.004 deg/s/sqrt(Hz)",
        "accel_noise": "100 ug/sqrt(Hz)",
        "gyro_bias": "0.2 deg/s",
        "accel_bias": "5 mg",
        "gyro_drift": "16 deg/h",
        "gyro_drift_tau": "200 s",
        "accel_drift": "65 ug",
        "accel_drift_tau": "200 s",
        "gyro_scale": "0.1 %",
        "accel_scale": "0.1 %",
        "vibration_velocity": "1 mm/s",
        "vibration_angle": "20 arcsec",
    },
    # TDK ICM-20602, data sheet DS-000176: 4 mdeg/s/sqrt(Hz), 100 ug/sqrt(Hz), sensitivity 1 %.
    # Biases, drifts and correlation times are assumed.
    "consumer": {
        "gyro_noise": "0.004 deg/s/sqrt(Hz)",
        "accel_noise": "100 ug/sqrt(Hz)",
        "gyro_bias": "1 deg/s",
        "accel_bias": "20 mg",
        "gyro_drift": "30 deg/h",
        "gyro_drift_tau": "200 s",
        "accel_drift": "100 ug",
        "accel_drift_tau": "200 s",
        "gyro_scale": "1 %",
        "accel_scale": "1 %",
        "vibration_velocity": "1 mm/s",
        "vibration_angle": "20 arcsec",
    },
}


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ImuData:
    """Samples of a unit and the biases that are in them.

    Attributes
    ----------
    rates : float64 array (n, 3), rad/s, body
    forces : float64 array (n, 3), m/s^2, body
    gyro_bias : float64 array (n, 3), rad/s, body
    accel_bias : float64 array (n, 3), m/s^2, body
    """

    rates: Floats
    forces: Floats
    gyro_bias: Floats
    accel_bias: Floats


def check(errors: ImuErrors) -> None:
    """Refuse impossible errors.

    Raises
    ------
    ConfigurationError
        For a negative number, a drift without a correlation time, two ways of rounding.
    """
    for name in errors.__struct_fields__:
        if not getattr(errors, name) >= 0.0:
            raise ConfigurationError(
                f"imu.errors.{name} is {getattr(errors, name)}", mend="write 0 or more"
            )
    for sensor in ("gyro", "accel"):
        if getattr(errors, f"{sensor}_drift") > 0.0 and getattr(errors, f"{sensor}_drift_tau") == 0:
            raise ConfigurationError(
                f"imu.errors.{sensor}_drift_tau is 0 but the drift is not",
                mend=f"give a correlation time, or use {sensor}_bias for a constant",
            )
        if getattr(errors, f"{sensor}_increment") > 0.0 < getattr(errors, f"{sensor}_resolution"):
            raise ConfigurationError(
                f"imu.errors has {sensor}_increment and {sensor}_resolution",
                mend="a unit sends whole pulses or rounded values: leave one of them out",
            )


def measure(
    rates: Floats,
    forces: Floats,
    speeds: Floats,
    interval_s: float,
    errors: ImuErrors,
    seed: int,
    unit: str = "imu",
) -> ImuData:
    """Samples of an imperfect unit.

    Parameters
    ----------
    rates, forces : float64 arrays (n, 3), rad/s and m/s^2, body
        Perfect means over the intervals.
    speeds : float64 array (n,), m/s
        Of the vehicle; at rest nothing vibrates.
    interval_s : float, s
    errors : ImuErrors
    seed : int
    unit : str
        Name of its streams of random numbers; units of other names have other errors.
    """
    if errors.gyro_g_sensitivity > 0.0:
        rates = rates + _g_sensitivity(forces, errors.gyro_g_sensitivity, seed, unit)
    gyro, gyro_bias = _sensor("gyro", rates, speeds, interval_s, errors, seed, unit)
    accel, accel_bias = _sensor("accel", forces, speeds, interval_s, errors, seed, unit)
    return ImuData(gyro, accel, gyro_bias, accel_bias)


def _g_sensitivity(forces: Floats, size: float, seed: int, unit: str) -> Floats:
    """What specific force does to three gyros (n, 3), rad/s."""
    factors = (size / STANDARD_GRAVITY_M_S2) * normals(seed, f"{unit}.gyro.g_sensitivity", 3)
    out = np.zeros_like(forces)
    for i in range(3):
        for j in range(3):
            out[:, i] += factors[i, j] * forces[:, j]
    return out


def _sensor(
    name: str,
    true: Floats,
    speeds: Floats,
    interval_s: float,
    errors: ImuErrors,
    seed: int,
    unit: str,
) -> tuple[Floats, Floats]:
    """Measured values (n, 3) and biases (n, 3) of three gyros or three accelerometers."""
    rows = len(true)
    source = f"{unit}.{name}"
    scale = getattr(errors, f"{name}_scale") * normals(seed, f"{source}.scale", 1)[0]
    off = errors.misalignment * normals(seed, f"{source}.misalignment", 3)
    measured = np.empty_like(true)
    for i in range(3):
        measured[:, i] = true[:, i] * (1.0 + scale[i])
        for j in range(3):
            if i != j and errors.misalignment > 0.0:
                measured[:, i] += off[i, j] * true[:, j]
    bias = correlated(
        seed,
        f"{source}.drift",
        rows,
        sigma=getattr(errors, f"{name}_drift"),
        tau_s=getattr(errors, f"{name}_drift_tau"),
        interval_s=interval_s,
    )
    bias += getattr(errors, f"{name}_bias") * normals(seed, f"{source}.bias", 1)[0]
    walk = getattr(errors, f"{name}_walk")
    if walk > 0.0:
        steps = normals(seed, f"{source}.walk", rows)
        bias += (walk * math.sqrt(interval_s / _HOUR_S)) * np.cumsum(steps, axis=0)
    measured += bias
    density = getattr(errors, f"{name}_noise")
    if density > 0.0:
        measured += (density / math.sqrt(interval_s)) * normals(seed, f"{source}.noise", rows)
    size = errors.vibration_angle if name == "gyro" else errors.vibration_velocity
    if size > 0.0:
        measured += _vibration(size, speeds, interval_s, seed, f"{source}.vibration")
    resolution = getattr(errors, f"{name}_resolution")
    if resolution > 0.0:
        measured = np.rint(measured / resolution) * resolution
    increment = getattr(errors, f"{name}_increment")
    if increment > 0.0:
        measured = _count(measured, interval_s, increment)
    return measured, bias


def _count(values: Floats, interval_s: float, increment: float) -> Floats:
    """Values (n, 3) as whole pulses per interval; what is left of one goes on to the next."""
    pulses = np.rint(np.cumsum(values * (interval_s / increment), axis=0))
    pulses[1:] -= pulses[:-1].copy()
    return np.asarray(pulses * (increment / interval_s))


def _vibration(size: float, speeds: Floats, interval_s: float, seed: int, source: str) -> Floats:
    """Derivative of a white jitter of angle or velocity: its integral stays as small as it is.

    White noise on the samples instead would be a random walk of the vehicle itself.
    """
    moving = np.minimum(speeds / _MOVING_M_S, 1.0)
    jitter = np.zeros((len(speeds) + 1, 3))
    jitter[1:] = size * (normals(seed, source, len(speeds)) * moving[:, None])
    return (jitter[1:] - jitter[:-1]) / interval_s
