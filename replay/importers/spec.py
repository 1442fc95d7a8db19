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
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import msgspec

from replay import channels
from replay.channels import ChannelSpec
from replay.configuration import STANDARD_GRAVITY_M_S2, Section, quantity

Kind = Literal["imu", "gnss_fix", "truth"]

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
