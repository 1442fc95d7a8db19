"""Settings of the loosely coupled GNSS/INS filter.

Defaults describe a consumer MEMS unit in a road vehicle. A log may bring better
ones (its importer knows the instrument): `replay.defaults` in its metadata.
"""

from __future__ import annotations

from typing import Annotated

from replay.configuration import Section, quantity


class Filter(Section):
    """States and process noise."""

    states: int = 21
    gyro_noise: Annotated[float, quantity("rad/sqrt(s)", "angle random walk")] = 2.0e-4
    accel_noise: Annotated[float, quantity("m/s/sqrt(s)", "velocity random walk")] = 3.0e-3
    gyro_bias_sigma: Annotated[float, quantity("rad/s", "Gauss-Markov deviation")] = 5.0e-4
    gyro_bias_tau: Annotated[float, quantity("s", "0 is a constant")] = 500.0
    accel_bias_sigma: Annotated[float, quantity("m/s^2", "Gauss-Markov deviation")] = 0.05
    accel_bias_tau: Annotated[float, quantity("s", "0 is a constant")] = 500.0
    gyro_scale_sigma: Annotated[float, quantity("1", "Gauss-Markov deviation")] = 5.0e-3
    gyro_scale_tau: Annotated[float, quantity("s", "0 is a constant")] = 0.0
    accel_scale_sigma: Annotated[float, quantity("1", "Gauss-Markov deviation")] = 5.0e-3
    accel_scale_tau: Annotated[float, quantity("s", "0 is a constant")] = 0.0


class Alignment(Section):
    """First attitude and what is known at its time."""

    rest_time: Annotated[float, quantity("s", "rest before levelling")] = 2.0
    course_speed: Annotated[float, quantity("m/s", "from which course is heading")] = 3.0
    course_turn_rate: Annotated[float, quantity("rad/s", "up to which it is")] = 0.1
    tilt_sigma: Annotated[float, quantity("rad", "roll and pitch")] = 0.02
    heading_sigma: Annotated[float, quantity("rad", "heading")] = 0.1
    velocity_sigma: Annotated[float, quantity("m/s", "each axis")] = 0.3
    gyro_bias_sigma: Annotated[float, quantity("rad/s", "each axis")] = 2.0e-3
    accel_bias_sigma: Annotated[float, quantity("m/s^2", "each axis")] = 0.2


class Gnss(Section):
    """How fixes are used."""

    receiver: str = ""
    use_velocity: bool = True
    latency: Annotated[float, quantity("s", "inertial rows wait this long for a fix")] = 0.0
    position_gate: Annotated[float, quantity("1", "chi-square of 3; 0 lets all in")] = 25.0
    velocity_gate: Annotated[float, quantity("1", "chi-square of 3; 0 lets all in")] = 25.0
    position_floor: Annotated[float, quantity("m", "added in quadrature")] = 0.01
    velocity_floor: Annotated[float, quantity("m/s", "added in quadrature")] = 0.02
    position_scale: Annotated[float, quantity("1", "on the stated deviation")] = 1.0
    velocity_scale: Annotated[float, quantity("1", "on the stated deviation")] = 1.0
    rejections: int = 10
    outage_limit: Annotated[float, quantity("s", "without a position")] = 1.5


class Stops(Section):
    """Zero velocity and zero angular rate at detected stops."""

    zero_velocity: bool = False
    zero_rate: bool = False
    window: Annotated[float, quantity("s", "of inertial samples")] = 1.0
    interval: Annotated[float, quantity("s", "between updates")] = 0.2
    accel_spread: Annotated[float, quantity("m/s^2", "largest deviation at rest")] = 0.15
    gyro_spread: Annotated[float, quantity("rad/s", "largest deviation at rest")] = 0.02
    rate: Annotated[float, quantity("rad/s", "largest mean rate at rest")] = 0.01
    speed: Annotated[float, quantity("m/s", "largest speed that is believed a stop")] = 0.5
    velocity_sigma: Annotated[float, quantity("m/s", "of a stop")] = 0.02
    rate_sigma: Annotated[float, quantity("rad/s", "of a stop")] = 2.0e-3


class NonHolonomic(Section):
    """Wheels do not slip: no velocity to the right or down at a point of the vehicle."""

    enabled: bool = False
    interval: Annotated[float, quantity("s", "between updates")] = 0.1
    right_sigma: Annotated[float, quantity("m/s", "slip to the right")] = 0.1
    down_sigma: Annotated[float, quantity("m/s", "slip down")] = 0.1
    turn_sigma: Annotated[float, quantity("m", "added per rad/s of turning")] = 0.3
    speed: Annotated[float, quantity("m/s", "below which it is not used")] = 1.0
    gate: Annotated[float, quantity("1", "chi-square of 2; 0 lets all in")] = 14.0
    lever_arm: tuple[
        Annotated[float, quantity("m", "body, IMU to the point that does not slip")], ...
    ] = (0.0, 0.0, 0.0)
    mounting: bool = True
    mounting_sigma: Annotated[float, quantity("rad", "pitch and yaw at the start")] = 0.03
    mounting_noise: Annotated[float, quantity("rad/sqrt(s)", "their random walk")] = 1.0e-5


class Imu(Section):
    """What is said of the inertial channel."""

    interval: Annotated[float, quantity("s", "nominal; 0 takes the median of the log")] = 0.0
    gap: Annotated[float, quantity("s", "interval that is a gap; 0 is 5 nominal ones")] = 0.0


class Output(Section):
    """What is written how often."""

    solution_interval: Annotated[float, quantity("s", "between predicted rows")] = 0.1


class LooseConfig(Section):
    """Settings of `gnss-ins-lc`."""

    name: str = "gnss-ins-lc"
    filter: Filter = Filter()
    alignment: Alignment = Alignment()
    gnss: Gnss = Gnss()
    stops: Stops = Stops()
    non_holonomic: NonHolonomic = NonHolonomic()
    imu: Imu = Imu()
    output: Output = Output()
