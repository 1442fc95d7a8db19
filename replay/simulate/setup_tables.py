"""A scenario's sections of observations, read and checked."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

from replay.configuration import Section, Table, build, merge
from replay.errors import ConfigurationError
from replay.gnss.signals import frequency_hz
from replay.simulate.air import SIGNED
from replay.simulate.antennas import check_worn, read_antennas
from replay.simulate.constellation import SYSTEMS
from replay.simulate.product_settings import Products
from replay.simulate.sky import Blockage, Receiver, Setup, Sky, Slip

KINDS: Final = ("vehicle", "static")
BLOCKAGES: Final = ("canyon", "trees", "roof", "outage")
FILTERS: Final = ("butterworth", "gauss-markov")

SectionT = TypeVar("SectionT", bound=Section)


def _with_common(table: Table) -> Any:
    """Tables of the receivers over what the section `receiver` says of all of them."""
    common, own = table.pop("receiver", {}), table.pop("receivers", [])
    if not isinstance(common, Mapping):
        raise ConfigurationError("receiver is no table", mend="write [receiver]")
    if not isinstance(own, list) or not all(isinstance(one, Mapping) for one in own):
        return own  # told by `read_many`
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
    given = [name for name in ("sky", "antennas", "blockage", "slips", "products") if name in table]
    sky = _read(Sky, table.pop("sky", {}), "sky")
    told = table.pop("products", None)
    products = None if told is None else _read(Products, told, "products")
    receivers = read_many(Receiver, _with_common(table), "receivers")
    antennas = read_antennas(table.pop("antennas", []))
    blockages = read_many(Blockage, table.pop("blockage", []), "blockage")
    slips = read_many(Slip, table.pop("slips", []), "slips")
    if given and not receivers:
        raise ConfigurationError(
            f"there is a section {given[0]!r} but no receiver observes",
            mend="write [[receivers]] with a name",
        )
    _check_sky(sky)
    _check_products(products, sky)
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
    return Setup(sky, receivers, blockages, slips, antennas, products, folder)


def _read(cls: type[SectionT], table: Any, where: str) -> SectionT:
    if not isinstance(table, Mapping):
        raise ConfigurationError(f"{where} is no table", mend=f"write [{where}]")
    try:
        return build(cls, [table])
    except ConfigurationError as error:
        raise ConfigurationError(error.what, where=where, mend=error.mend) from error


def read_many(cls: type[SectionT], tables: Any, name: str) -> tuple[SectionT, ...]:
    """Sections of a list of tables.

    Raises
    ------
    ConfigurationError
        For an unknown key, a wrong type, what is no list.
    """
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
            (len(sky.pole) != 2, "pole has not two numbers", "write [x, y]"),
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


def _check_products(products: Products | None, sky: Sky) -> None:
    if products is None:
        return
    _check(products, "products")
    _refuse(
        (
            (
                min(products.orbit_interval, products.clock_interval) == 0.0,
                "an interval is 0 s",
                "write more than 0",
            ),
            (
                bool(sky.navigation),
                "there are none of a real sky: its orbits go over from message to message, "
                "which no polynomial follows",
                "leave out sky.navigation or [products]",
            ),
        ),
        "products",
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
