"""Settings of satellites, atmosphere, receivers and what stands in their way.

In a scenario: `[sky]`, one `[[receivers]]` each, what they have in common in `[receiver]`,
`[[antennas]]`, `[[blockage]]`, `[[slips]]` and `[products]`. Numbers in dB and dB-Hz are plain;
the others may have a unit.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from replay.configuration import Section, literal, quantity
from replay.simulate.air import Ionosphere, Troposphere
from replay.simulate.antennas import Antenna
from replay.simulate.product_settings import Products, SatelliteBiases


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
    wind_up: bool = False  # of the carrier phase; satellites stand nominally
    tides: bool = False  # move the ground: solid Earth tide and pole tide
    # Pole less the secular pole, towards Greenwich and towards 90 degrees west.
    pole: tuple[Annotated[float, quantity("rad", "of the Earth's rotation")], ...] = (0.0, 0.0)
    errors: Ephemerides = Ephemerides()
    biases: SatelliteBiases = SatelliteBiases()
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
    carrier_bias: Annotated[float, quantity("1", "cycles, of each signal, drawn once")] = 0.0


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
    products : Products or None
    folder : Path
        Of the scenario: names of files are from there.
    """

    sky: Sky = dataclasses.field(default_factory=Sky)
    receivers: tuple[Receiver, ...] = ()
    blockages: tuple[Blockage, ...] = ()
    slips: tuple[Slip, ...] = ()
    antennas: tuple[Antenna, ...] = ()
    products: Products | None = None
    folder: Path = dataclasses.field(default=Path(), compare=False)

    def to_toml(self) -> str:
        """Canonical TOML; empty without receivers."""
        if not self.receivers:
            return ""
        lines = [*table_lines("[sky]", "sky", self.sky)]
        if self.products is not None:
            lines += table_lines("[products]", "products", self.products)
        for name, sections in (
            ("receivers", self.receivers),
            ("antennas", self.antennas),
            ("blockage", self.blockages),
            ("slips", self.slips),
        ):
            for section in sections:
                lines += table_lines(f"[[{name}]]", name, section)
        return "\n".join(lines)


def table_lines(head: str, path: str, section: Section) -> Iterator[str]:
    """Lines of a section as a table of TOML, its inner tables after it."""
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
        yield from table_lines(f"[{name}]", name, value)
    for name, values in lists:
        for value in values:
            yield from table_lines(f"[[{name}]]", name, value)
