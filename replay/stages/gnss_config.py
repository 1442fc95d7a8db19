"""Settings that every GNSS pipeline shares: signals, orbits, atmosphere."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from replay.configuration import Section, quantity

SIGNALS: Final = (
    *("G1C", "G1W", "G1X", "G2W", "G2L", "G2X", "G2S", "G2C", "G5Q", "G5X", "G5I"),
    *("R1C", "R1P", "R2C", "R2P"),
    *("E1C", "E1X", "E1B", "E7Q", "E7X", "E7I", "E5Q", "E5X", "E5I"),
    *("C2I", "C2X", "C7I", "C7D", "C7X", "C6I", "C6X"),
    *("J1C", "J1X", "J1Z", "J2L", "J2X", "J2S", "J5Q", "J5X", "J5I"),
)
"""Signals in the order in which they are taken; see :mod:`replay.gnss.measurements`."""


class Gnss(Section, frozen=True):
    """Which receivers, satellites and signals."""

    receiver: str = ""
    base: str = ""
    systems: str = "GRECJ"
    signals: tuple[str, ...] = SIGNALS
    exclude: tuple[str, ...] = ()
    mask: Annotated[float, quantity("rad", "elevation below which nothing is used")] = 0.2618
    cn0_mask: Annotated[float, quantity("dB-Hz", "below which a signal is not used")] = 0.0


class Orbits(Section, frozen=True):
    """Which broadcast message is used."""

    choice: Literal["nearest", "latest"] = "nearest"
    galileo: Literal["inav", "fnav"] = "inav"
    unhealthy: bool = False
    max_age: tuple[
        Annotated[float, quantity("s", "to the reference time; GPS, GLO, GAL, BDS, QZSS")], ...
    ] = (7201.0, 1800.0, 14400.0, 21600.0, 7201.0)


class Atmosphere(Section, frozen=True):
    """What is modelled on the way of the signal."""

    ionosphere: Literal["none", "klobuchar", "system", "map"] = "klobuchar"
    alpha: tuple[
        Annotated[float, quantity("1", "Klobuchar, s/semicircle^n, where the log has none")], ...
    ] = (0.0, 0.0, 0.0, 0.0)
    beta: tuple[
        Annotated[float, quantity("1", "Klobuchar, s/semicircle^n, where the log has none")], ...
    ] = (0.0, 0.0, 0.0, 0.0)
    troposphere: Literal["none", "niell", "cosecant", "gmf"] = "niell"
    meteorology: Literal["standard", "mops", "gpt"] = "standard"
    humidity: Annotated[float, quantity("1", "relative, at every height; not of mops")] = 0.7
    shapiro: bool = True


class Antenna(Section, frozen=True):
    """Where the antennas are taken to be."""

    base_position: tuple[
        Annotated[float, quantity("m", "ECEF, of the base's antenna; empty takes the log's")], ...
    ] = ()
    coast: Annotated[float, quantity("s", "an old position serves for orbits this long")] = 60.0
    calibrated: bool = True  # use calibrations where the log has them
    # Pipelines without inertial samples do not use it; their evaluation does.
    lever_arm: tuple[Annotated[float, quantity("m", "body, IMU to antenna")], ...] = (
        0.0,
        0.0,
        0.0,
    )


class GnssConfig(Section, frozen=True):
    """Settings that all stages of GNSS pipelines read."""

    name: str = ""
    gnss: Gnss = Gnss()
    orbits: Orbits = Orbits()
    atmosphere: Atmosphere = Atmosphere()
    antenna: Antenna = Antenna()
