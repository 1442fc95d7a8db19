"""Settings of precise products, `[products]`, and of satellites' biases, `[sky.biases]`."""

from __future__ import annotations

from typing import Annotated

from replay.configuration import Section, quantity


class SatelliteBiases(Section, frozen=True):
    """Biases of each satellite's signals, drawn once; standard deviations.

    Those of the code come on top of the group delays that messages tell.
    """

    code: Annotated[float, quantity("m", "of each signal's code")] = 0.0
    carrier: Annotated[float, quantity("1", "cycles, of each signal's phase")] = 0.0


class Products(Section, frozen=True):
    """Orbits, clocks and biases that are computed afterwards; errors as standard deviations.

    They describe the true satellites: a centre of mass that is the phase centre too, and clocks
    without the periodic relativity from which every signal differs by its bias.
    """

    orbit_interval: Annotated[float, quantity("s", "between orbits")] = 900.0
    clock_interval: Annotated[float, quantity("s", "between clocks")] = 30.0
    margin: Annotated[float, quantity("s", "of orbits before and after the drive")] = 9000.0
    orbit_error: Annotated[float, quantity("m", "of each axis; it wanders within hours")] = 0.0
    clock_error: Annotated[float, quantity("m", "wanders within hours")] = 0.0
    clock_noise: Annotated[float, quantity("m", "white, of each value")] = 0.0
    code_biases: bool = True
    phase_biases: bool = False  # what fixing of ambiguities needs
    agency: str = "SIM"
    frame: str = "IGS20"
