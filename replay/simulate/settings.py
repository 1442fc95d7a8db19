"""Settings of a scenario: all of it but segments, satellites and receivers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Final

from replay import time
from replay.configuration import Section, quantity
from replay.errors import ConfigurationError
from replay.simulate import gnss, imu

VEHICLES: Final = ("road", "air", "foot")
_LARGEST_LATITUDE_RAD: Final = 1.55  # local axes turn too fast closer to a pole
_LOWEST_IMU_RATE_HZ: Final = 10.0  # below, the integration of the motion is not exact enough


class Start(Section, frozen=True):
    """When and where the vehicle stands at first."""

    time: str = "2025-06-01T12:00:00"  # calendar date of GPS time
    latitude: Annotated[float, quantity("rad", "geodetic")] = 0.0
    longitude: Annotated[float, quantity("rad", "east")] = 0.0
    height: Annotated[float, quantity("m", "above the ellipsoid")] = 0.0
    heading: Annotated[float, quantity("rad", "clockwise from north")] = 0.0
    speed: Annotated[float, quantity("m/s", "level; of an aircraft in flight")] = 0.0


class Recorded(Section, frozen=True):
    """A motion from the truth of a log, in the place of start and segments."""

    log: str = ""  # path of an MCAP log, relative to the scenario's folder
    begin: Annotated[float, quantity("s", "since its first row")] = 0.0
    end: Annotated[float, quantity("s", "since its first row; 0: to its last")] = 0.0
    spacing: Annotated[
        float, quantity("s", "between knots of the curve; 0: 0.2 s, but not less than a row")
    ] = 0.0


class Vehicle(Section, frozen=True):
    """How the body follows its path."""

    kind: str = "road"  # road, air (banks into turns), foot (with a gait)
    roll_per_g: Annotated[float, quantity("rad", "out of the turn, per g sideways")] = 0.0
    pitch_per_g: Annotated[float, quantity("rad", "nose up, per g forward")] = 0.0


class Gait(Section, frozen=True):
    """What steps do to one on foot: amplitudes at `speed`, in proportion to it at others."""

    cadence: Annotated[float, quantity("Hz", "steps")] = 1.9
    speed: Annotated[float, quantity("m/s", "at which it has these amplitudes")] = 1.4
    bounce: Annotated[float, quantity("m", "up and down, at each step")] = 0.02
    surge: Annotated[float, quantity("m", "forward and back, at each step")] = 0.01
    sway: Annotated[float, quantity("m", "left and right, at every other step")] = 0.02
    roll: Annotated[float, quantity("rad", "at every other step")] = 0.03
    pitch: Annotated[float, quantity("rad", "at each step")] = 0.02
    yaw: Annotated[float, quantity("rad", "at every other step")] = 0.05


class Imu(Section, frozen=True):
    """The inertial unit; `errors` go over those of the grade."""

    rate: Annotated[float, quantity("Hz", "of samples")] = 100.0
    grade: str = "industrial"
    errors: imu.ImuErrors = imu.ImuErrors()


class Unit(Section, frozen=True):
    """A further inertial unit in the same place, on a channel of its own name."""

    name: str
    rate: Annotated[float, quantity("Hz", "of samples")] = 100.0
    grade: str = "navigation"
    errors: imu.ImuErrors = imu.ImuErrors()


class Gnss(Section, frozen=True):
    """The receiver; `errors` go over those of the grade."""

    receiver: str = "rover"
    fixes: bool = True  # False leaves the channel out
    rate: Annotated[float, quantity("Hz", "of fixes")] = 4.0
    grade: str = "rtk"
    velocity: bool = True
    latency: Annotated[float, quantity("s", "from epoch to availability")] = 0.0
    lever_arm: tuple[Annotated[float, quantity("m", "body, IMU to antenna")], ...] = (0.0, 0.0, 0.0)
    # [begin, end) of each, s since the start
    outages: tuple[tuple[Annotated[float, quantity("s", "since the start")], ...], ...] = ()
    errors: gnss.GnssErrors = gnss.GnssErrors()


class Truth(Section, frozen=True):
    """How often truth is written, and of what."""

    rate: Annotated[float, quantity("Hz", "of rows")] = 50.0
    signals: bool = False  # every term of every measurement of the receivers


class Settings(Section, frozen=True):
    """A scenario without its segments."""

    name: str = "drive"
    seed: int = 1
    repeat: int = 1
    start: Start = Start()
    trajectory: Recorded = Recorded()
    vehicle: Vehicle = Vehicle()
    gait: Gait = Gait()
    imu: Imu = Imu()
    gnss: Gnss = Gnss()
    truth: Truth = Truth()


def check(settings: Settings) -> None:
    """Refuse impossible settings.

    Raises
    ------
    ConfigurationError
        That names the key and how to mend it.
    """
    try:
        time.parse_calendar(settings.start.time)
    except ValueError as error:
        raise ConfigurationError(
            f"start.time: {error}", mend="write 2025-06-01T12:00:00, in GPS time"
        ) from error
    faults = (
        (settings.seed < 0, f"seed is {settings.seed}", "write 0 or more"),
        (settings.repeat < 1, f"repeat is {settings.repeat}", "write 1 or more"),
        (
            abs(settings.start.latitude) > _LARGEST_LATITUDE_RAD,
            f"start.latitude is {math.degrees(settings.start.latitude):g} deg",
            "stay away from the poles; a number alone is in rad, write '52 deg'",
        ),
        (
            settings.imu.rate < _LOWEST_IMU_RATE_HZ,
            f"imu.rate is {settings.imu.rate:g} Hz",
            f"write {_LOWEST_IMU_RATE_HZ:g} Hz or more",
        ),
        (settings.start.speed < 0.0, "start.speed is negative", "write 0 or more"),
        (
            settings.vehicle.kind not in VEHICLES,
            f"vehicle.kind is {settings.vehicle.kind!r}",
            f"one of {', '.join(VEHICLES)}",
        ),
        (
            not settings.gait.cadence > 0.0,
            f"gait.cadence is {settings.gait.cadence:g} Hz",
            "more than 0",
        ),
        (
            not settings.gait.speed > 0.0,
            f"gait.speed is {settings.gait.speed:g} m/s",
            "more than 0",
        ),
        (
            settings.gait.surge * 2.0 * math.pi * settings.gait.cadence >= settings.gait.speed,
            f"gait.surge is {settings.gait.surge:g} m",
            "write less: the walker would go backward in each step",
        ),
        (not settings.gnss.rate > 0.0, f"gnss.rate is {settings.gnss.rate:g} Hz", "more than 0"),
        (not settings.truth.rate > 0.0, f"truth.rate is {settings.truth.rate:g} Hz", "more than 0"),
        (settings.gnss.latency < 0.0, "gnss.latency is negative", "write 0 or more"),
        (
            "/" in settings.gnss.receiver or not settings.gnss.receiver,
            f"gnss.receiver is {settings.gnss.receiver!r}",
            "write a name without a slash",
        ),
        (
            len(settings.gnss.lever_arm) != 3,
            "gnss.lever_arm has not three numbers",
            "write [forward, right, down]",
        ),
    )
    for wrong, what, mend in faults:
        if wrong:
            raise ConfigurationError(what, mend=mend)
    for outage in settings.gnss.outages:
        if len(outage) != 2 or not 0.0 <= outage[0] < outage[1]:
            raise ConfigurationError(
                f"gnss.outages holds {list(outage)}", mend="write [begin, end] in s since the start"
            )
    _check_recorded(settings)
    imu.check(settings.imu.errors)
    gnss.check(settings.gnss.errors)


def check_units(units: Sequence[Unit]) -> None:
    """Refuse impossible further inertial units.

    Raises
    ------
    ConfigurationError
        That names the unit and how to mend it.
    """
    names = [unit.name for unit in units]
    for index, unit in enumerate(units):
        where = f"imus[{index}]"
        if not unit.name or "/" in unit.name:
            raise ConfigurationError(
                f"the name is {unit.name!r}", where=where, mend="write one without a slash"
            )
        if unit.name in names[:index]:
            raise ConfigurationError(f"two inertial units are called {unit.name!r}", where=where)
        if unit.rate < _LOWEST_IMU_RATE_HZ:
            raise ConfigurationError(
                f"rate is {unit.rate:g} Hz",
                where=where,
                mend=f"write {_LOWEST_IMU_RATE_HZ:g} Hz or more",
            )
        imu.check(unit.errors)


def _check_recorded(settings: Settings) -> None:
    recorded = settings.trajectory
    if not recorded.log:
        if recorded != Recorded():
            raise ConfigurationError("trajectory has no log", mend="write its path")
        return
    told = (
        ("start", settings.start != Start()),
        ("vehicle", settings.vehicle != Vehicle(kind=settings.vehicle.kind)),
        ("gait", settings.gait != Gait()),
        ("repeat", settings.repeat != 1),
    )
    for name, given in told:
        if given:
            raise ConfigurationError(
                f"{name} has no meaning with trajectory.log",
                mend="leave it out: the log says where and how it moved",
            )
    if recorded.begin < 0.0 or recorded.spacing < 0.0 or recorded.end < 0.0:
        raise ConfigurationError("trajectory has a negative number", mend="write 0 or more")
    if recorded.end > 0.0 and recorded.end <= recorded.begin:
        raise ConfigurationError(
            f"trajectory.end is {recorded.end:g} s", mend="write more than trajectory.begin"
        )
