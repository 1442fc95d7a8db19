"""Settings of satellites, atmosphere, receivers and what stands in their way.

In a scenario: `[sky]`, one `[[receivers]]` each, what they have in common in `[receiver]`,
`[[antennas]]`, `[[blockage]]` and `[[slips]]`. Numbers in dB and dB-Hz are plain; the others
may have a unit.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

from replay.configuration import Section, Table, build, literal, merge, quantity
from replay.errors import ConfigurationError
from replay.gnss.signals import frequency_hz
from replay.simulate.air import SIGNED, Ionosphere, Troposphere
from replay.simulate.antennas import Antenna, check_worn, read_antennas
from replay.simulate.constellation import SYSTEMS

KINDS: Final = ("vehicle", "static")
BLOCKAGES: Final = ("canyon", "trees", "roof", "outage")
FILTERS: Final = ("butterworth", "gauss-markov")


class Ephemerides(Section, frozen=True):
    """How far the satellites are from what they broadcast; standard deviations."""

    orbit: Annotated[float, quantity("m", "along and across the track; radial a third")] = 0.0
    clock: Annotated[float, quantity("m", "clock offset")] = 0.0
    clock_tau: Annotated[float, quantity("s", "in which its drift makes as much")] = 7200.0


class Sky(Section, frozen=True):
    """What all receivers share."""

    systems: str = "GEC"
    # A log with /gnss/nav, from the scenario's folder; none is the built-in constellation.
    navigation: str = ""
    shapiro: bool = False
    errors: Ephemerides = Ephemerides()
    ionosphere: Ionosphere = Ionosphere()
    troposphere: Troposphere = Troposphere()


class Clock(Section, frozen=True):
    """Receiver's clock against GPS time."""

    bias: Annotated[float, quantity("s", "at the start")] = 0.0
    drift: Annotated[float, quantity("1", "at the start")] = 0.0
    walk: Annotated[float, quantity("1", "of the drift, in a second")] = 0.0
    jumps: bool = False  # of a millisecond, to stay within half of one
    reported: bool = False  # the epochs tell the true offset


class Noise(Section, frozen=True):
    """White noise, standard deviations in the zenith."""

    code: Annotated[float, quantity("m", "pseudorange")] = 0.0
    carrier: Annotated[float, quantity("m", "carrier phase")] = 0.0
    rate: Annotated[float, quantity("m/s", "Doppler as a range rate")] = 0.0
    weighted: bool = True  # 1 / sin(elevation)
    code_bias: Annotated[float, quantity("m", "of each signal, drawn once")] = 0.0


class Multipath(Section, frozen=True):
    """Correlated errors, standard deviations in the zenith; they grow with 1 / sin(elevation)."""

    filter: str = "gauss-markov"
    code: Annotated[float, quantity("m", "in pseudoranges")] = 0.0
    carrier: Annotated[float, quantity("m", "in carrier phases")] = 0.0
    tau: Annotated[float, quantity("s", "of gauss-markov")] = 30.0
    cutoff: Annotated[float, quantity("Hz", "of butterworth")] = 0.01
    detour: Annotated[float, quantity("m", "mean, of reflected signals")] = 15.0
    detour_loss_db: float = 10.0


class Strength(Section, frozen=True):
    """Carrier-to-noise density, dB-Hz."""

    zenith: float = 50.0
    drop: float = 12.0  # to the horizon, with the sine of the elevation
    sigma: float = 0.5
    code_threshold: float = 25.0
    carrier_threshold: float = 30.0


class Tracking(Section, frozen=True):
    """Lock and its loss."""

    acquisition: Annotated[float, quantity("s", "from sight to the first measurement")] = 2.0
    slips_per_hour: float = 0.0  # of each signal
    largest_slip: int = 10  # cycles
    flagged: Annotated[float, quantity("1", "probability that a slip is told")] = 1.0


class Receiver(Section, frozen=True):
    """One receiver. A vehicle's rides on the trajectory, maybe some seconds behind."""

    name: str
    kind: str = "vehicle"
    rate: Annotated[float, quantity("Hz", "of epochs")] = 1.0
    signals: tuple[str, ...] = ("G1C", "E1C", "C2I")
    mask: Annotated[float, quantity("rad", "lowest elevation")] = 0.17453292519943295
    latency: Annotated[float, quantity("s", "from epoch to availability")] = 0.0
    lever_arm: tuple[Annotated[float, quantity("m", "body, IMU to antenna")], ...] = (0.0, 0.0, 0.0)
    antenna: str = ""  # of [[antennas]]; none measures at its reference point
    delay: Annotated[float, quantity("s", "behind the vehicle on its path")] = 0.0
    latitude: Annotated[float, quantity("rad", "of a static one, geodetic")] = 0.0
    longitude: Annotated[float, quantity("rad", "of a static one, east")] = 0.0
    height: Annotated[float, quantity("m", "of a static one")] = 0.0
    position: tuple[Annotated[float, quantity("m", "of a static one, ECEF instead")], ...] = ()
    # [begin, end) of each, s since the start
    gaps: tuple[tuple[Annotated[float, quantity("s", "since the start")], ...], ...] = ()
    clock: Clock = Clock()
    noise: Noise = Noise()
    multipath: Multipath = Multipath()
    strength: Strength = Strength()
    tracking: Tracking = Tracking()


class Blockage(Section, frozen=True):
    """What hides satellites for a time: walls (canyon), trees, a roof, or an outage."""

    kind: str
    begin: Annotated[float, quantity("s", "since the start")]
    end: Annotated[float, quantity("s", "since the start")]
    every: Annotated[float, quantity("s", "again after so long; 0 is once")] = 0.0
    receivers: tuple[str, ...] = ()  # none named: every vehicle's
    left: Annotated[float, quantity("rad", "elevation straight to the left")] = 0.0
    right: Annotated[float, quantity("rad", "elevation straight to the right")] = 0.0
    loss_db: float = 12.0  # of trees
    reflected: Annotated[float, quantity("1", "share of hidden ones seen by reflection")] = 0.0
    keep: int = 0  # satellites left: the lowest under a roof, the highest in an outage


class Slip(Section, frozen=True):
    """One cycle slip."""

    receiver: str
    satellite: str
    time: Annotated[float, quantity("s", "since the start; the first epoch not before it")]
    cycles: int
    signal: str = ""  # as `1C`; none: every signal of the satellite


@dataclasses.dataclass(frozen=True, slots=True)
class Setup:
    """All that concerns observations; without receivers there are none.

    Attributes
    ----------
    sky : Sky
    receivers : tuple of Receiver
    blockages : tuple of Blockage
    slips : tuple of Slip
    antennas : tuple of Antenna
    folder : Path
        Of the scenario: names of files are from there.
    """

    sky: Sky = dataclasses.field(default_factory=Sky)
    receivers: tuple[Receiver, ...] = ()
    blockages: tuple[Blockage, ...] = ()
    slips: tuple[Slip, ...] = ()
    antennas: tuple[Antenna, ...] = ()
    folder: Path = dataclasses.field(default=Path(), compare=False)

    def to_toml(self) -> str:
        """Canonical TOML; empty without receivers."""
        if not self.receivers:
            return ""
        lines = [*_lines("[sky]", "sky", self.sky)]
        for name, sections in (
            ("receivers", self.receivers),
            ("antennas", self.antennas),
            ("blockage", self.blockages),
            ("slips", self.slips),
        ):
            for section in sections:
                lines += _lines(f"[[{name}]]", name, section)
        return "\n".join(lines)


def _lines(head: str, path: str, section: Section) -> Iterator[str]:
    """Lines of a table, its inner tables after it."""
    yield head
    inner, lists = [], []
    for name in section.__struct_fields__:
        value = getattr(section, name)
        if isinstance(value, Section):
            inner.append((f"{path}.{name}", value))
        elif isinstance(value, tuple) and value and isinstance(value[0], Section):
            lists.append((f"{path}.{name}", value))
        else:
            yield f"{name} = {literal(value)}"
    yield ""
    for name, value in inner:
        yield from _lines(f"[{name}]", name, value)
    for name, values in lists:
        for value in values:
            yield from _lines(f"[[{name}]]", name, value)


SectionT = TypeVar("SectionT", bound=Section)


def _with_common(table: Table) -> Any:
    """Tables of the receivers over what the section `receiver` says of all of them."""
    common, own = table.pop("receiver", {}), table.pop("receivers", [])
    if not isinstance(common, Mapping):
        raise ConfigurationError("receiver is no table", mend="write [receiver]")
    if not isinstance(own, list) or not all(isinstance(one, Mapping) for one in own):
        return own  # told by `_many`
    tables: list[Table] = []
    for one in own:
        both: Table = {}
        merge(both, common)
        merge(both, one)
        tables.append(both)
    return tables


def take_setup(table: Table, folder: Path = Path()) -> Setup:
    """Take the sections of observations out of a scenario's table.

    Parameters
    ----------
    table : dict
    folder : Path
        What names of files are relative to.

    Raises
    ------
    ConfigurationError
        For an unknown key, a wrong type, an impossible value.
    """
    given = [name for name in ("sky", "antennas", "blockage", "slips") if name in table]
    sky = _read(Sky, table.pop("sky", {}), "sky")
    receivers = _many(Receiver, _with_common(table), "receivers")
    antennas = read_antennas(table.pop("antennas", []))
    blockages = _many(Blockage, table.pop("blockage", []), "blockage")
    slips = _many(Slip, table.pop("slips", []), "slips")
    if given and not receivers:
        raise ConfigurationError(
            f"there is a section {given[0]!r} but no receiver observes",
            mend="write [[receivers]] with a name",
        )
    _check_sky(sky)
    names = [receiver.name for receiver in receivers]
    for index, receiver in enumerate(receivers):
        _check_receiver(receiver, f"receivers[{index}]", sky)
        if receiver.antenna:
            check_worn(receiver.antenna, receiver.signals, antennas, f"receivers[{index}]")
        if receiver.name in names[:index]:
            raise ConfigurationError(f"two receivers are called {receiver.name!r}")
    for index, blockage in enumerate(blockages):
        _check_blockage(blockage, f"blockage[{index}]", names)
    for index, slip in enumerate(slips):
        _known(slip.receiver, names, f"slips[{index}]")
    return Setup(sky, receivers, blockages, slips, antennas, folder)


def _read(cls: type[SectionT], table: Any, where: str) -> SectionT:
    if not isinstance(table, Mapping):
        raise ConfigurationError(f"{where} is no table", mend=f"write [{where}]")
    try:
        return build(cls, [table])
    except ConfigurationError as error:
        raise ConfigurationError(error.what, where=where, mend=error.mend) from error


def _many(cls: type[SectionT], tables: Any, name: str) -> tuple[SectionT, ...]:
    if not isinstance(tables, list):
        raise ConfigurationError(f"{name} is no list", mend=f"write [[{name}]], one each")
    return tuple(_read(cls, table, f"{name}[{i}]") for i, table in enumerate(tables))


def _known(name: str, names: list[str], where: str) -> None:
    if name not in names:
        known = ", ".join(names)
        raise ConfigurationError(f"no receiver {name!r}", where=where, mend=f"known: {known}")


def _check(section: Section, where: str, allowed: tuple[str, ...] = ()) -> None:
    """Refuse negative numbers in a section and those below it."""
    for name in section.__struct_fields__:
        value = getattr(section, name)
        if isinstance(value, Section):
            _check(value, f"{where}.{name}", allowed)
        elif isinstance(value, float | int) and name not in allowed and not value >= 0:
            raise ConfigurationError(f"{where}.{name} is {value}", mend="write 0 or more")


def _refuse(faults: tuple[tuple[bool, str, str], ...], where: str) -> None:
    for wrong, what, mend in faults:
        if wrong:
            raise ConfigurationError(what, where=where, mend=mend)


def _check_sky(sky: Sky) -> None:
    _check(sky, "sky", SIGNED)
    unknown = [system for system in sky.systems if system not in SYSTEMS]
    times = (sky.errors.clock_tau, sky.ionosphere.tau, sky.troposphere.tau)
    air, field = sky.ionosphere, sky.troposphere.field
    told = (air.broadcast_alpha, air.broadcast_beta)
    _refuse(
        (
            (
                bool(unknown),
                f"systems has {''.join(unknown)!r}",
                f"letters of {SYSTEMS}",
            ),
            (len(set(sky.systems)) != len(sky.systems), "systems names one twice", "name it once"),
            (min(times) == 0.0, "a correlation time is 0", "write more than 0"),
            (
                len(sky.ionosphere.alpha) != 4 or len(sky.ionosphere.beta) != 4,
                "ionosphere.alpha and beta have four numbers each",
                "write the eight of the message",
            ),
            (
                any(len(numbers) not in (0, 4) for numbers in told),
                "ionosphere.broadcast_alpha and broadcast_beta have four numbers each, or none",
                "write the eight of the message",
            ),
            (
                min(air.wave.length, air.front.width, field.length) == 0.0,
                "a wave, a front or a field has no length",
                "write more than 0 m",
            ),
        ),
        "sky",
    )


def _check_receiver(receiver: Receiver, where: str, sky: Sky) -> None:
    _check(receiver, where, ("bias", "drift", "latitude", "longitude", "height"))
    static = receiver.kind == "static"
    _refuse(
        (
            (
                "/" in receiver.name or not receiver.name,
                f"the name is {receiver.name!r}",
                "write one without a slash",
            ),
            (
                receiver.kind not in KINDS,
                f"no kind {receiver.kind!r}",
                f"one of {', '.join(KINDS)}",
            ),
            (receiver.rate == 0.0, "rate is 0 Hz", "more than 0"),
            (
                len(receiver.lever_arm) != 3,
                "lever_arm has not three numbers",
                "[forward, right, down]",
            ),
            (len(receiver.position) not in (0, 3), "position has not three numbers", "[x, y, z]"),
            (
                static and not receiver.position and receiver.latitude == receiver.longitude == 0.0,
                "a static receiver has no position",
                "give latitude, longitude, height, or position",
            ),
            (
                receiver.multipath.filter not in FILTERS,
                f"multipath.filter is {receiver.multipath.filter!r}",
                f"one of {', '.join(FILTERS)}",
            ),
            (receiver.multipath.tau == 0.0, "multipath.tau is 0", "write more than 0"),
            (
                not 0.0 < receiver.multipath.cutoff < 0.5 * receiver.rate
                and receiver.multipath.filter == "butterworth",
                "multipath.cutoff is not below half of the rate",
                "write a lower one",
            ),
            (not receiver.signals, "no signals", 'write ["G1C", "C2I"]'),
        ),
        where,
    )
    for signal in receiver.signals:
        good = len(signal) == 3 and signal[0] in sky.systems and signal[1].isdigit()
        try:
            frequency_hz(signal[:1], int(signal[1])) if good else None
        except KeyError:
            good = False
        good = good and (signal[0] != "R" or signal[1] in "12")  # no satellite sends CDMA here
        if not good:
            raise ConfigurationError(
                f"no signal {signal!r}", where=where,
                mend="a system of sky.systems and its RINEX band and attribute, as G1C",
            )  # fmt: skip
    for gap in receiver.gaps:
        if len(gap) != 2 or not 0.0 <= gap[0] < gap[1]:
            raise ConfigurationError(f"gaps holds {list(gap)}", where=where, mend="[begin, end]")


def _check_blockage(blockage: Blockage, where: str, names: list[str]) -> None:
    _check(blockage, where)
    for name in blockage.receivers:
        _known(name, names, where)
    _refuse(
        (
            (
                blockage.kind not in BLOCKAGES,
                f"no kind {blockage.kind!r}",
                f"one of {', '.join(BLOCKAGES)}",
            ),
            (not blockage.begin < blockage.end, "it ends before it begins", "swap them"),
            (
                0.0 < blockage.every <= blockage.end - blockage.begin,
                "it comes again before it ends",
                "write a longer `every`",
            ),
            (max(blockage.left, blockage.right) > 1.5, "a wall is upright", "stay below 85 deg"),
        ),
        where,
    )
