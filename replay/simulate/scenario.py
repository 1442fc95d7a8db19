"""A scenario: what is driven, with which sensors, from which seed. Read from TOML."""

from __future__ import annotations

import dataclasses
import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Final

from replay import time
from replay.configuration import Section, Table, build, literal, merge, quantity, to_toml
from replay.errors import ConfigurationError, UsageError
from replay.simulate import gnss, imu
from replay.simulate.segments import Segment, read_segments
from replay.simulate.sky import Setup, take_setup

_LARGEST_LATITUDE_RAD: Final = 1.55  # local axes turn too fast closer to a pole
_LOWEST_IMU_RATE_HZ: Final = 10.0  # below, the integration of the motion is not exact enough


class Start(Section, frozen=True):
    """When and where the vehicle stands at first."""

    time: str = "2025-06-01T12:00:00"  # calendar date of GPS time
    latitude: Annotated[float, quantity("rad", "geodetic")] = 0.0
    longitude: Annotated[float, quantity("rad", "east")] = 0.0
    height: Annotated[float, quantity("m", "above the ellipsoid")] = 0.0
    heading: Annotated[float, quantity("rad", "clockwise from north")] = 0.0


class Vehicle(Section, frozen=True):
    """How the body leans on its springs."""

    roll_per_g: Annotated[float, quantity("rad", "out of the turn, per g sideways")] = 0.0
    pitch_per_g: Annotated[float, quantity("rad", "nose up, per g forward")] = 0.0


class Imu(Section, frozen=True):
    """The inertial unit; `errors` go over those of the grade."""

    rate: Annotated[float, quantity("Hz", "of samples")] = 100.0
    grade: str = "industrial"
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
    """How often truth is written."""

    rate: Annotated[float, quantity("Hz", "of rows")] = 50.0


class Settings(Section, frozen=True):
    """A scenario without its segments."""

    name: str = "drive"
    seed: int = 1
    repeat: int = 1
    start: Start = Start()
    vehicle: Vehicle = Vehicle()
    imu: Imu = Imu()
    gnss: Gnss = Gnss()
    truth: Truth = Truth()


@dataclasses.dataclass(frozen=True, slots=True)
class Scenario:
    """Settings and manoeuvres.

    Attributes
    ----------
    settings : Settings
    segments : tuple of Segment
    setup : Setup
        Satellites and receivers that observe them.
    defaults : Table
        Sections of pipelines' configurations that go over those that fit the sensors.
    """

    settings: Settings
    segments: tuple[Segment, ...]
    setup: Setup = dataclasses.field(default_factory=Setup)
    defaults: Table = dataclasses.field(default_factory=dict)

    def to_toml(self) -> str:
        """Canonical TOML; reading it gives an equal scenario."""
        parts = [to_toml(self.settings)]
        for segment in self.segments:
            keys = (f"{k} = {literal(getattr(segment, k))}" for k in segment.__struct_fields__)
            parts.append("\n".join(("[[segments]]", *keys)) + "\n")
        if self.setup.receivers:
            parts.append(self.setup.to_toml())
        if self.defaults:
            parts.append(tables_toml({"defaults": self.defaults}))
        return "\n".join(parts)


def tables_toml(tables: Mapping[str, Any], path: tuple[str, ...] = ()) -> str:
    """TOML of tables in tables."""
    lines = [f"{k} = {literal(v)}" for k, v in tables.items() if not isinstance(v, Mapping)]
    text = "\n".join([f"[{'.'.join(path)}]", *lines]) + "\n" if path and lines else ""
    inner = [tables_toml(v, (*path, k)) for k, v in tables.items() if isinstance(v, Mapping)]
    return "\n".join(part for part in (text, *inner) if part)


def load_scenario(path: Path, tables: Iterable[Mapping[str, Any]] = ()) -> Scenario:
    """Scenario of a TOML file.

    Parameters
    ----------
    path : Path
    tables : iterable of mapping
        Go over the file's, key by key.

    Raises
    ------
    UsageError
        Where the file cannot be read.
    ConfigurationError
        For an unknown key, a wrong type, an impossible value.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"the scenario cannot be read: {error}", where=str(path)) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"the scenario is no TOML: {error}", where=str(path)) from error
    for over in tables:
        merge(table, over)
    try:
        return read_scenario(table)
    except ConfigurationError as error:
        where = f"{path}, {error.where}" if error.where else str(path)
        raise ConfigurationError(error.what, where=where, mend=error.mend) from error


def read_scenario(table: Mapping[str, Any]) -> Scenario:
    """Scenario of a table.

    Raises
    ------
    ConfigurationError
        For an unknown key, a wrong type, an impossible value.
    """
    rest: Table = {}
    merge(rest, table)
    segments = read_segments(rest.pop("segments", None))
    setup = take_setup(rest)
    defaults = rest.pop("defaults", {})
    if not isinstance(defaults, dict):
        raise ConfigurationError("defaults is no table", mend="write [defaults.SECTION]")
    _apply_grade(rest, "imu", Imu().grade, imu.IMU_GRADES)
    _apply_grade(rest, "gnss", Gnss().grade, gnss.GNSS_GRADES)
    settings = build(Settings, [rest])
    _check(settings)
    return Scenario(settings, segments, setup, defaults)


def _apply_grade(
    table: Table, section: str, default: str, grades: Mapping[str, Mapping[str, Any]]
) -> None:
    """Put the errors of a sensor's grade under those that the table gives."""
    given = table.setdefault(section, {})
    if not isinstance(given, dict):
        return  # told by `build`
    grade = given.get("grade", default)
    if grade not in grades:
        near = difflib.get_close_matches(str(grade), grades, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ConfigurationError(
            f"{section}.grade: no grade {grade!r}", mend=f"{hint}known: {', '.join(grades)}"
        )
    errors: Table = dict(grades[grade])
    over = given.get("errors", {})
    if isinstance(over, Mapping):
        merge(errors, over)
        given["errors"] = errors


def _check(settings: Settings) -> None:
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
    imu.check(settings.imu.errors)
    gnss.check(settings.gnss.errors)
