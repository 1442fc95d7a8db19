"""Filter settings that fit a simulated log, so that a run over it needs none.

What an importer knows of its instrument, the simulator knows of its own: noise is
taken as it was made, and what holds for alignment and stops follows from it. Only
what follows from the scenario is said; the rest is left to the pipeline.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import msgspec

from replay.configuration import STANDARD_GRAVITY_M_S2, Table, merge
from replay.simulate.scenario import tables_toml
from replay.simulate.settings import Imu, Settings, Unit
from replay.simulate.sky import Receiver, Setup, Sky

# What is left to a perfect unit: a filter needs some noise, and integration has its own.
_LEAST_GYRO_NOISE: Final = 1e-7  # rad/sqrt(s)
_LEAST_ACCEL_NOISE: Final = 1e-6  # m/s/sqrt(s)
_LEAST_GYRO_BIAS: Final = 1e-7  # rad/s
_LEAST_ACCEL_BIAS: Final = 1e-4  # m/s^2
_LEAST_TILT: Final = 1e-4  # rad
_FLYING_TILT: Final = 0.01  # rad
_LEAST_REST: Final = 1e-3  # m/s^2: rest ends before the detector sees that it does

_REST_TIME_S: Final = 5.0
_BLOCK_S: Final = 0.1
_INTERVAL_S: Final = 0.25
_SPREAD: Final = 5.0  # deviations of a block's mean; sixty of them are looked at
_LEAST_ACCEL_SPREAD: Final = 0.01  # m/s^2
_LEAST_GYRO_SPREAD: Final = 5e-4  # rad/s
_LEAST_STOP_RATE: Final = 1e-3  # rad/s
_STOP_SPEED: Final = 0.3  # m/s: simulated braking is as smooth as rest, but for its last metre
_COURSE_SPEED: Final = 3.0  # m/s
_LEAST_HEADING: Final = 0.01  # rad: a course is the heading but for the body's lean
_WALKING_SPEED: Final = 1.0  # m/s
_WALKING_HEADING: Final = 0.15  # rad: steps sway, and the body turns about its course
_SLIP: Final = 0.02  # m/s
_HOUR_S: Final = 3600.0
_LEAST_WET: Final = 0.01  # m: mapping functions differ
_LEAST_WET_NOISE: Final = 1e-5  # m/sqrt(s)
_SYSTEMS_ALIKE: Final = (1.0,) * 5
_BRAKING_M_S: Final = 15.0  # at 1 m/s^2 from this speed the lean shows as so much slip


def fitting_defaults(settings: Settings) -> Table:
    """Sections of a pipeline's configuration for a scenario's sensors and vehicle."""
    errors = settings.imu.errors
    receiver = settings.gnss.errors
    gyro_noise = max(errors.gyro_noise, _LEAST_GYRO_NOISE)
    accel_noise = max(errors.accel_noise, _LEAST_ACCEL_NOISE)
    gyro_sigma, gyro_tau = _one_process(
        errors.gyro_bias, errors.gyro_drift, errors.gyro_drift_tau, errors.gyro_walk
    )
    accel_sigma, accel_tau = _one_process(
        errors.accel_bias, errors.accel_drift, errors.accel_drift_tau, errors.accel_walk
    )
    accel_sigma = max(accel_sigma, _LEAST_ACCEL_BIAS)
    scaled = errors.gyro_scale > 0.0 or errors.accel_scale > 0.0
    gyro_at_rest = _root_sum_square(gyro_noise / math.sqrt(_REST_TIME_S), errors.gyro_drift)
    accel_at_rest = _root_sum_square(accel_noise / math.sqrt(_REST_TIME_S), errors.accel_drift)
    lean = settings.vehicle.pitch_per_g / STANDARD_GRAVITY_M_S2
    # In flight nothing is at rest: the attitude of straight and level flight is all there is.
    flying = settings.start.speed > 0.0
    tilt = _FLYING_TILT if flying else max(accel_sigma / STANDARD_GRAVITY_M_S2, _LEAST_TILT)
    gyro_known = gyro_sigma if flying else 2.0 * gyro_at_rest
    walking = settings.vehicle.kind == "foot"
    course_speed = _WALKING_SPEED if walking else _COURSE_SPEED
    # Only of wheels is known that they neither slip nor leave the road, and where they are.
    wheels = settings.vehicle.kind == "road" and not settings.trajectory.log
    return {
        "filter": {
            "states": 21 if scaled else 15,
            "gyro_noise": _three(gyro_noise),
            "accel_noise": _three(accel_noise),
            "gyro_bias_sigma": _three(max(gyro_sigma, _LEAST_GYRO_BIAS)),
            "gyro_bias_tau": gyro_tau,
            "accel_bias_sigma": _three(accel_sigma),
            "accel_bias_tau": accel_tau,
            "gyro_scale_sigma": _three(errors.gyro_scale),
            "accel_scale_sigma": _three(errors.accel_scale),
        },
        "alignment": {
            "rest_time": _REST_TIME_S,
            "rest_sigma": max(accel_at_rest, _LEAST_REST),
            "course_speed": course_speed,
            "tilt_sigma": tilt,
            "heading_sigma": _root_sum_square(
                receiver.horizontal_velocity_noise / course_speed,
                _WALKING_HEADING if walking else _LEAST_HEADING,
            ),
            "velocity_sigma": max(receiver.vertical_velocity_noise, 0.02),
            "gyro_bias_sigma": _three(max(gyro_known, _LEAST_GYRO_BIAS)),
            "accel_bias_sigma": _three(accel_sigma),
        },
        "gnss": {"latency": settings.gnss.latency},
        "stops": {
            "zero_velocity": True,
            "zero_rate": True,
            "block": _BLOCK_S,
            "interval": _INTERVAL_S,
            "accel_spread": max(_SPREAD * accel_noise / math.sqrt(_BLOCK_S), _LEAST_ACCEL_SPREAD),
            "gyro_spread": max(_SPREAD * gyro_noise / math.sqrt(_BLOCK_S), _LEAST_GYRO_SPREAD),
            "rate": max(_SPREAD * gyro_at_rest, _LEAST_STOP_RATE),
            "speed": _STOP_SPEED,
            "velocity_sigma": 0.01,
            # The update takes the mean over the time since the last one.
            "rate_sigma": _three(gyro_noise / math.sqrt(_INTERVAL_S)),
        },
        "non_holonomic": {
            "enabled": wheels,
            "right_sigma": _SLIP,
            "down_sigma": _SLIP + _BRAKING_M_S * lean,
            "lever_arm": _three(0.0),  # the IMU is the point that moves along the road
            "estimate_lever_arm": False,
            "mounting": False,
        },
    }


def defaults_toml(
    settings: Settings, over: Mapping[str, Any] | None = None, setup: Setup | None = None
) -> str:
    """Canonical TOML of :func:`fitting_defaults`, with tables that go over it.

    Of the receivers of `setup` the one that `over` names in its section `gnss`, or the first
    that rides on the vehicle, tells where the antenna stands, and where there are precise
    products what its signals are worth.
    """
    receivers = () if setup is None else setup.receivers
    tables = fitting_defaults(settings)
    named = (over or {}).get("gnss", {}).get("receiver", "")
    riding = [receiver for receiver in receivers if receiver.kind == "vehicle"]
    riding.sort(key=lambda receiver: receiver.name != named)
    if riding:
        tables["antenna"] = {"lever_arm": riding[0].lever_arm}
        if setup is not None and setup.products is not None:
            tables["ppp"] = {"measurements": _signals(riding[0]), "delays": _delays(setup.sky)}
            tables["tight"] = {"wind_up": setup.sky.wind_up}
            # What hangs over the simulated ground is the standard atmosphere, in every season.
            tables["atmosphere"] = {"meteorology": "standard"}
    merge(tables, over or {})
    return tables_toml(tables)


def _signals(receiver: Receiver) -> dict[str, Any]:
    """What a filter that takes noise for white has to think of a receiver's signals.

    Of errors that last, n epochs tell no more than few: with a correlation of r from one
    epoch to the next a mean over many has the variance of white noise that is (1 + r) / (1 - r)
    times as large.
    """
    noise, multipath = receiver.noise, receiver.multipath
    lasting = 1.0
    if multipath.tau > 0.0:
        correlation = math.exp(-1.0 / (receiver.rate * multipath.tau))
        lasting = math.sqrt((1.0 + correlation) / (1.0 - correlation))
    return {
        "code_sigma": (_root_sum_square(noise.code, lasting * multipath.code),),
        "phase_sigma": (_root_sum_square(noise.carrier, lasting * multipath.carrier),),
        "doppler_sigma": noise.rate,
        "code_scale": _SYSTEMS_ALIKE,
        "weighting": "sine",
    }


def _delays(sky: Sky) -> dict[str, Any]:
    """What is known of the zenith's wet delay, and how fast it wanders."""
    air = sky.troposphere
    return {
        "wet_sigma": max(_root_sum_square(air.wet, air.local_wet), _LEAST_WET),
        "wet_noise": max(air.wet * math.sqrt(2.0 / air.tau), _LEAST_WET_NOISE),
    }


def unit_toml(settings: Settings, unit: Unit) -> str:
    """Canonical TOML of what differs where a further inertial unit is chosen."""
    own = Imu(rate=unit.rate, grade=unit.grade, errors=unit.errors)
    told = fitting_defaults(msgspec.structs.replace(settings, imu=own))
    usual = fitting_defaults(settings)
    return tables_toml(
        {
            name: {key: value for key, value in section.items() if value != usual[name][key]}
            for name, section in told.items()
        }
    )


def _three(value: float) -> tuple[float, float, float]:
    return value, value, value


def _root_sum_square(a: float, b: float) -> float:
    """Length of (a, b); `math.hypot` does not promise the same bits everywhere."""
    return math.sqrt(a * a + b * b)


def _one_process(bias: float, drift: float, tau_s: float, walk: float) -> tuple[float, float]:
    """Deviation and correlation time of one process for constant, drifting and walking parts.

    The deviation is that of the sum after an hour; the noise that drives it,
    2 sigma^2 / tau, is that of drift and walk. A correlation time of 0 is a constant.
    """
    variance = bias * bias + drift * drift + walk * walk
    if walk > 0.0:
        density = walk * walk / _HOUR_S + (2.0 * drift * drift / tau_s if drift > 0.0 else 0.0)
        return math.sqrt(variance), 2.0 * variance / density
    if drift == 0.0:
        return math.sqrt(variance), 0.0
    return math.sqrt(variance), tau_s * variance / (drift * drift)
