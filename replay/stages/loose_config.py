"""Settings of the loosely coupled GNSS/INS filter.

Defaults describe a consumer MEMS unit. A log may bring better ones (its importer
knows the instrument and the vehicle): `replay.defaults` in its metadata.

Where three numbers are asked for, one stands for all three.
"""

from __future__ import annotations

from typing import Annotated

from replay.configuration import Section, quantity
from replay.stages.smoothing_config import Smoothing


class Filter(Section, frozen=True):
    """States and process noise."""

    states: int = 15
    gyro_noise: tuple[
        Annotated[float, quantity("rad/sqrt(s)", "angle random walk, body axes")], ...
    ] = (3.0e-4, 3.0e-4, 3.0e-4)
    accel_noise: tuple[
        Annotated[float, quantity("m/s/sqrt(s)", "velocity random walk, body axes")], ...
    ] = (5.0e-3, 5.0e-3, 5.0e-3)
    gyro_bias_sigma: tuple[
        Annotated[float, quantity("rad/s", "Gauss-Markov deviation, body axes")], ...
    ] = (3.0e-4, 3.0e-4, 3.0e-4)
    gyro_bias_tau: Annotated[float, quantity("s", "correlation time; 0 is a constant")] = 1000.0
    accel_bias_sigma: tuple[
        Annotated[float, quantity("m/s^2", "Gauss-Markov deviation, body axes")], ...
    ] = (0.04, 0.04, 0.04)
    accel_bias_tau: Annotated[float, quantity("s", "correlation time; 0 is a constant")] = 1000.0
    gyro_scale_sigma: tuple[
        Annotated[float, quantity("1", "Gauss-Markov deviation, body axes")], ...
    ] = (5.0e-3, 5.0e-3, 5.0e-3)
    gyro_scale_tau: Annotated[float, quantity("s", "correlation time; 0 is a constant")] = 0.0
    accel_scale_sigma: tuple[
        Annotated[float, quantity("1", "Gauss-Markov deviation, body axes")], ...
    ] = (5.0e-3, 5.0e-3, 5.0e-3)
    accel_scale_tau: Annotated[float, quantity("s", "correlation time; 0 is a constant")] = 0.0


class Alignment(Section, frozen=True):
    """First attitude and what is known at its time."""

    rest_time: Annotated[float, quantity("s", "rest before levelling")] = 3.0
    rest_sigma: Annotated[
        float, quantity("m/s^2", "of gravity at rest; ties tilt to bias; 0 does not")
    ] = 0.05
    course_speed: Annotated[float, quantity("m/s", "from which course is heading")] = 1.0
    course_turn_rate: Annotated[float, quantity("rad/s", "up to which it is")] = 0.1
    tilt_sigma: Annotated[float, quantity("rad", "roll and pitch")] = 0.05
    heading_sigma: Annotated[float, quantity("rad", "heading")] = 0.07
    velocity_sigma: Annotated[float, quantity("m/s", "each axis")] = 0.3
    gyro_bias_sigma: tuple[Annotated[float, quantity("rad/s", "body axes")], ...] = (
        3.0e-4,
        3.0e-4,
        3.0e-4,
    )
    accel_bias_sigma: tuple[Annotated[float, quantity("m/s^2", "body axes")], ...] = (
        0.1,
        0.1,
        0.1,
    )


class Gnss(Section, frozen=True):
    """How fixes are used."""

    receiver: str = ""
    use_velocity: bool = True
    velocity_window: Annotated[
        float, quantity("s", "over which the receiver averages velocity; 0 is an instant")
    ] = 0.0
    latency: Annotated[float, quantity("s", "inertial rows wait this long for a fix")] = 0.0
    position_gate: Annotated[float, quantity("1", "chi-square of 3; 0 lets all in")] = 60.0
    velocity_gate: Annotated[float, quantity("1", "chi-square of 3; 0 lets all in")] = 60.0
    position_floor: tuple[
        Annotated[float, quantity("m", "east, north, up; added in quadrature")], ...
    ] = (0.01, 0.01, 0.02)
    velocity_floor: tuple[
        Annotated[float, quantity("m/s", "east, north, up; added in quadrature")], ...
    ] = (0.03, 0.03, 0.05)
    position_scale: Annotated[float, quantity("1", "on the stated deviation")] = 1.0
    velocity_scale: Annotated[float, quantity("1", "on the stated deviation")] = 1.0
    rejections: int = 8
    outage_limit: Annotated[float, quantity("s", "without a position")] = 1.5


class Stops(Section, frozen=True):
    """Zero velocity and zero angular rate at detected stops."""

    zero_velocity: bool = False
    zero_rate: bool = False
    window: Annotated[float, quantity("s", "of inertial samples")] = 2.0
    block: Annotated[float, quantity("s", "averaged before the window is looked at")] = 0.1
    interval: Annotated[float, quantity("s", "between updates")] = 0.25
    accel_spread: Annotated[float, quantity("m/s^2", "of block means at rest, each axis")] = 0.1
    gyro_spread: Annotated[float, quantity("rad/s", "of block means, down axis")] = 2.6e-3
    rate: Annotated[float, quantity("rad/s", "mean rate at rest, down axis")] = 2.6e-3
    speed: Annotated[float, quantity("m/s", "largest speed that is believed a stop")] = 3.0
    velocity_sigma: Annotated[float, quantity("m/s", "of a stop")] = 0.05
    rate_sigma: tuple[Annotated[float, quantity("rad/s", "of a stop, body axes")], ...] = (
        2.6e-3,
        2.6e-3,
        1.0e-3,
    )


class NonHolonomic(Section, frozen=True):
    """Wheels do not slip: no velocity to the right or down at a point of the vehicle."""

    enabled: bool = False
    interval: Annotated[float, quantity("s", "between updates")] = 0.1
    smoothing: Annotated[float, quantity("s", "low-pass of the rate at the lever arm")] = 0.1
    right_sigma: Annotated[float, quantity("m/s", "slip to the right")] = 0.05
    down_sigma: Annotated[float, quantity("m/s", "slip down")] = 0.15
    turn_sigma: Annotated[float, quantity("m", "added per rad/s of turning")] = 0.0
    speed: Annotated[float, quantity("m/s", "below which it is not used")] = 0.3
    gate: Annotated[float, quantity("1", "chi-square of 2; 0 lets all in")] = 100.0
    lever_arm: tuple[
        Annotated[float, quantity("m", "body, IMU to the point that does not slip")], ...
    ] = (0.0, 0.0, 1.0)
    estimate_lever_arm: bool = True
    lever_arm_sigma: tuple[
        Annotated[float, quantity("m", "forward and down coordinate at the start")], ...
    ] = (1.0, 0.5)
    estimate_squat: bool = False
    squat_sigma: Annotated[
        float, quantity("rad/(m/s^2)", "pitching on the springs at the start")
    ] = 2.0e-3
    mounting: bool = True
    mounting_sigma: Annotated[float, quantity("rad", "pitch and yaw at the start")] = 0.02
    mounting_noise: Annotated[float, quantity("rad/sqrt(s)", "their random walk")] = 0.0


class Imu(Section, frozen=True):
    """What is said of the inertial channel."""

    name: str = ""  # of /imu/NAME/raw; empty is /imu/raw
    interval: Annotated[float, quantity("s", "nominal; 0 takes the median of the log")] = 0.0
    gap: Annotated[float, quantity("s", "interval that is a gap; 0 is 5 nominal ones")] = 0.0


class Output(Section, frozen=True):
    """What is written how often."""

    solution_interval: Annotated[float, quantity("s", "between predicted rows")] = 0.1


class LooseConfig(Section, frozen=True):
    """Settings of `gnss-ins-lc`."""

    name: str = "gnss-ins-lc"
    filter: Filter = Filter()
    alignment: Alignment = Alignment()
    gnss: Gnss = Gnss()
    stops: Stops = Stops()
    non_holonomic: NonHolonomic = NonHolonomic()
    imu: Imu = Imu()
    output: Output = Output()
    smoothing: Smoothing = Smoothing()
