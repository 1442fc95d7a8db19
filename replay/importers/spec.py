"""The import spec: what files hold and which channels become of them.

Everything that a person had to find out about a recording stands here, so that
an import can be repeated by anyone who has the files.

```toml
title = "…"                       # and origin, licence, notes
[sources.imu]                     # a file, by a name of its own
file = "imu.csv.gz"               # gzip or plain, told by its first bytes
columns = ["ax", "ay", "tick"]    # names; leave out where the file has a header
[channels.imu]                    # a channel, by a name of its own
kind = "imu"
source = "imu"
mounting = ["yaw -5.35 deg"]      # see replay.importers.mounting
[channels.imu.time]               # see replay.importers.clock
[channels.imu.fields]
specific_force_body_m_s2 = { columns = ["ax", "-ay", "az"], unit = "g" }
[streams.rover]                   # a file of several channels with times of its own
source = "rover"                  # its format is one of replay.importers.streams
receiver = "rover"
[streams.before]                  # a log that the files above are added to: all that was
source = "before"                 # recorded in it; its source is of format "log"
[defaults.filter]                 # for the configuration of pipelines over the log
[expect]                          # channel name, or stream name and topic -> digest
"rover /gnss/rover/obs" = "…"
```
"""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

import msgspec

from replay import channels, configuration
from replay.channels import ChannelSpec
from replay.configuration import STANDARD_GRAVITY_M_S2, Section, quantity
from replay.errors import ConfigurationError, UsageError

Kind = Literal["imu", "gnss_fix", "truth"]
SectionT = TypeVar("SectionT", bound=Section)

_COMMON: Final = frozenset({"position_geodetic", "position_ecef_m", "velocity_enu_m_s"})
FIELDS_OF: Final[dict[str, frozenset[str]]] = {
    "imu": frozenset({"angular_rate_body_rad_s", "specific_force_body_m_s2", "temperature_c"}),
    "gnss_fix": _COMMON
    | {
        "velocity_ecef_m_s",
        "position_std_enu_m",
        "position_covariance_rtklib",
        "velocity_std_enu_m_s",
        "velocity_covariance_rtklib",
        "satellite_count",
        "differential_age_s",
        "ambiguity_ratio",
    },
    "truth": _COMMON | {"position_std_enu_m", "attitude_rad"},
}
CHANNEL_OF: Final[dict[str, ChannelSpec]] = {
    "imu": channels.IMU,
    "gnss_fix": channels.GNSS_FIX,
    "truth": channels.TRUTH,
}


class Source(Section, frozen=True):
    """A file: `columns` names the columns of one that has no header line.

    A channel reads tables: `csv`, `rtklib-pos` and `matlab`, of which `variable`
    names the matrix. A stream reads the formats of :mod:`replay.importers.streams`.
    """

    file: str
    format: str = "csv"
    variable: str = ""
    columns: tuple[str, ...] = ()
    delimiter: Annotated[str, msgspec.Meta(min_length=1, max_length=1)] = ","


class Time(Section, frozen=True):
    """How the valid time of a row is found; see :mod:`replay.importers.clock`."""

    columns: tuple[str, ...]
    scale: Literal["gps_week", "gps_calendar", "utc_calendar", "unix", "relative", "ticks"]
    unit: Literal["s", "ms", "us", "ns", "min", "h"] = "s"
    week: int = 0
    epoch: str = ""
    host_tag: str = ""
    recorded_line_end: Literal["crlf", "lf"] = "lf"
    fit: Literal["linear", "span"] = "linear"
    offset: Annotated[float, quantity("s", "valid time = time read + offset")] = 0.0
    latency: Annotated[float, quantity("s", "log time = valid time + latency")] = 0.0
    repeats: Literal["keep", "drop"] = "keep"
    steady: Annotated[float, quantity("s", "time constant of a polled sensor's clock")] = 0.0


class Absence(Section, frozen=True):
    """A value is absent in rows where `column` holds exactly `equals`."""

    column: str = ""
    equals: float = 0.0


class Value(Section, frozen=True):
    """Columns of a field in their order, `-` before a name negates; or constants."""

    columns: tuple[str, ...] = ()
    constant: tuple[float, ...] = ()
    unit: str = ""
    absent_when: Absence = Absence()
    absent_before: str = ""

    @property
    def given(self) -> bool:
        """Whether the spec says anything of the field."""
        return bool(self.columns or self.constant)


class Fields(Section, frozen=True):
    """Fields of every kind of channel; :data:`FIELDS_OF` tells which belong to which."""

    angular_rate_body_rad_s: Value = Value()
    specific_force_body_m_s2: Value = Value()
    temperature_c: Value = Value()
    position_geodetic: Value = Value()
    position_ecef_m: Value = Value()
    position_std_enu_m: Value = Value()
    position_covariance_rtklib: Value = Value()
    velocity_enu_m_s: Value = Value()
    velocity_ecef_m_s: Value = Value()
    velocity_std_enu_m_s: Value = Value()
    velocity_covariance_rtklib: Value = Value()
    attitude_rad: Value = Value()
    satellite_count: Value = Value()
    differential_age_s: Value = Value()
    ambiguity_ratio: Value = Value()


class Code(Section, frozen=True):
    """Fix quality: a constant name, or a column of codes and a name for each."""

    constant: str = ""
    column: str = ""
    map: dict[str, str] = msgspec.field(default_factory=dict)


class Gravity(Section, frozen=True):
    """Gravity to put back into gravity-free accelerations of a levelled platform."""

    columns: tuple[str, ...] = ()
    unit: str = "deg"
    gravity: Annotated[float, quantity("m/s^2", "at the place")] = STANDARD_GRAVITY_M_S2


class Channel(Section, frozen=True):
    """A channel and where its rows come from.

    `fallback` names another channel that stands in where the file of `source` is
    missing; `loss` says in a sentence what is lost by using a channel, and makes
    the import end with exit code 3.
    """

    kind: Kind
    source: str
    time: Time
    receiver: str = "rover"
    join: tuple[str, ...] = ()
    fallback: str = ""
    loss: str = ""
    fields: Fields = Fields()
    quality: Code = Code()
    mounting: tuple[str, ...] = ()
    lever_arm: tuple[Annotated[float, quantity("m", "body, IMU to the point")], ...] = (
        0.0,
        0.0,
        0.0,
    )
    skip_when_zero: tuple[str, ...] = ()
    gravity_from_attitude: Gravity = Gravity()

    @property
    def topic(self) -> str:
        """Topic of the channel."""
        spec = CHANNEL_OF[self.kind]
        return spec.at(receiver=self.receiver) if self.kind == "gnss_fix" else spec.topic


class Stream(Section, frozen=True):
    """A file that has times of its own and gives several channels.

    `time_offset` is added to the times of a receiver whose stamps are off.
    `available` says when a navigation message is known: from the `start` of the log,
    as a program sees it that works on a finished recording, or from when it was
    `transmitted`; left out, the format's own way. `position_ecef_m` stands in for the
    approximate position that the file states. Of an ANTEX file the antennas are read that
    the receivers of the other streams name; `satellites` adds those of all satellites.
    Of precise orbits, clocks and maps all is read, or what lies at most `margin` from the
    rows of the other streams. `site` names the station of a BLQ file that the receiver is;
    left out, each receiver's marker tells.

    Of receivers' binary formats: `approximate_time` is a GPS date near the start for
    files that do not tell theirs; `lever_arm` goes with the receiver's own fixes, and
    `truth` makes them the truth too; the scales are those of raw inertial samples.
    """

    source: str | tuple[str, ...]
    receiver: str = "rover"
    time_offset: Annotated[float, quantity("s", "times = times read + offset")] = 0.0
    available: Literal["", "start", "transmitted"] = ""
    position_ecef_m: tuple[Annotated[float, quantity("m", "ECEF, of the mark")], ...] = ()
    approximate_time: str = ""
    lever_arm: tuple[Annotated[float, quantity("m", "body, IMU to the antenna of fixes")], ...] = (
        0.0,
        0.0,
        0.0,
    )
    truth: bool = False
    satellites: bool = False
    margin: Annotated[float, quantity("s", "of products around the log, 0 for all")] = 0.0
    site: str = ""
    gyro_scale: Annotated[float, quantity("rad", "of one count of raw inertial samples")] = 0.0
    accel_scale: Annotated[float, quantity("m/s", "of one count of raw inertial samples")] = 0.0

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of its sources."""
        return (self.source,) if isinstance(self.source, str) else self.source


class _Head(Section, frozen=True):
    title: str
    origin: str
    licence: str
    sources: dict[str, dict[str, Any]]
    channels: dict[str, dict[str, Any]] = msgspec.field(default_factory=dict)
    streams: dict[str, dict[str, Any]] = msgspec.field(default_factory=dict)
    notes: tuple[str, ...] = ()
    defaults: dict[str, dict[str, Any]] = msgspec.field(default_factory=dict)
    expect: dict[str, str] = msgspec.field(default_factory=dict)


@dataclasses.dataclass(frozen=True, slots=True)
class Spec:
    """A whole import spec.

    Attributes
    ----------
    path : Path
        Where it was read from.
    title, origin, licence : str
        What the recording is, its public address, its licence.
    notes : tuple of str
        For a person; they go into the manifest.
    sources, channels, streams : mapping of name to Source, Channel, Stream
    defaults : mapping of section to table
        Stored in the log for the configuration of pipelines.
    expect : mapping of channel name, or stream name and topic, to str
        SHA-256 of the rows.
    table : mapping
        The spec as it was read.
    """

    path: Path
    title: str
    origin: str
    licence: str
    notes: tuple[str, ...]
    sources: dict[str, Source]
    channels: dict[str, Channel]
    streams: dict[str, Stream]
    defaults: dict[str, dict[str, Any]]
    expect: dict[str, str]
    table: dict[str, Any]

    def primary(self) -> dict[str, Channel]:
        """Channels that are no other channel's fallback."""
        spare = {channel.fallback for channel in self.channels.values()}
        return {name: item for name, item in self.channels.items() if name not in spare}


def load_spec(path: Path) -> Spec:
    """Read and check a spec.

    Raises
    ------
    ConfigurationError
        For an unknown key or a value that cannot be, with the table's name.
    UsageError
        Where the file cannot be read or is no TOML.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"the import spec cannot be read: {error}", where=str(path)) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"the import spec is no TOML: {error}", where=str(path)) from error
    head = _section(_Head, table, str(path))
    spec = Spec(
        path=path,
        title=head.title,
        origin=head.origin,
        licence=head.licence,
        notes=head.notes,
        sources={
            name: _section(Source, part, f"{path}, [sources.{name}]")
            for name, part in head.sources.items()
        },
        channels={
            name: _section(Channel, part, f"{path}, [channels.{name}]")
            for name, part in head.channels.items()
        },
        streams={
            name: _section(Stream, part, f"{path}, [streams.{name}]")
            for name, part in head.streams.items()
        },
        defaults=head.defaults,
        expect=head.expect,
        table=table,
    )
    for name, channel in spec.channels.items():
        _check(spec, name, channel)
        _check_fallback(spec, name)
    _check_topics(spec)
    for name, stream in spec.streams.items():
        _check_stream(spec, name, stream)
    for name in spec.expect:
        if name not in spec.channels and name.partition(" ")[0] not in spec.streams:
            known = [*spec.channels, *(f"{stream} TOPIC" for stream in spec.streams)]
            raise ConfigurationError(
                f"the spec expects a digest of {name!r}, which is no channel",
                where=f"{path}, [expect]",
                mend=f"known: {', '.join(known)}",
            )
    return spec


def _section(cls: type[SectionT], table: dict[str, Any], where: str) -> SectionT:
    try:
        return configuration.build(cls, [table])
    except ConfigurationError as error:
        what = error.what.removeprefix("configuration: ")
        # The hint on a wrong type speaks of pipelines; here the spec's format is what helps.
        wrong_type = what != error.what
        mend = "the docstring of replay.importers.spec shows the format"
        raise ConfigurationError(
            what, where=where, mend=mend if wrong_type else error.mend
        ) from error


def _check(spec: Spec, name: str, channel: Channel) -> None:
    where = f"{spec.path}, [channels.{name}]"
    _check_sources(spec, (channel.source, *channel.join), where)
    if len(channel.lever_arm) != 3:
        raise ConfigurationError(
            f"lever_arm has {len(channel.lever_arm)} numbers", where=where, mend="write three"
        )
    for field in channel.fields.__struct_fields__:
        if getattr(channel.fields, field).given and field not in FIELDS_OF[channel.kind]:
            raise ConfigurationError(
                f"a channel of kind {channel.kind} has no field {field}",
                where=where,
                mend=f"its fields are {', '.join(sorted(FIELDS_OF[channel.kind]))}",
            )


def _check_sources(spec: Spec, names: tuple[str, ...], where: str) -> None:
    for source in names:
        if source not in spec.sources:
            known = ", ".join(spec.sources)
            raise ConfigurationError(f"no source {source!r}", where=where, mend=f"known: {known}")


def _check_stream(spec: Spec, name: str, stream: Stream) -> None:
    where = f"{spec.path}, [streams.{name}]"
    _check_sources(spec, stream.sources, where)
    if name in spec.channels or not name or " " in name:
        raise ConfigurationError(
            f"a stream cannot be called {name!r}",
            where=where,
            mend="take a name without blanks that no channel has",
        )
    if not stream.sources:
        raise ConfigurationError("the stream has no source", where=where, mend="name one")
    if len(stream.position_ecef_m) not in (0, 3):
        count = len(stream.position_ecef_m)
        raise ConfigurationError(
            f"position_ecef_m has {count} numbers", where=where, mend="write three"
        )


def _check_fallback(spec: Spec, name: str) -> None:
    where = f"{spec.path}, [channels.{name}]"
    known = f"known: {', '.join(spec.channels)}"
    seen, topic = {name}, spec.channels[name].topic
    while name := spec.channels[name].fallback:
        if name not in spec.channels:
            raise ConfigurationError(
                f"no channel {name!r} to fall back to", where=where, mend=known
            )
        if spec.channels[name].topic != topic:
            raise ConfigurationError(f"the fallback {name!r} is not of {topic}", where=where)
        if name in seen:
            raise ConfigurationError(f"the fallback {name!r} leads back to itself", where=where)
        seen.add(name)


def _check_topics(spec: Spec) -> None:
    topics: dict[str, str] = {}
    for name, channel in spec.primary().items():
        if channel.topic in topics:
            raise ConfigurationError(
                f"channels {topics[channel.topic]} and {name} are both {channel.topic}",
                where=str(spec.path),
                mend="give one another receiver, or make it the fallback of the other",
            )
        topics[channel.topic] = name
