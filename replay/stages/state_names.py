"""Words for the numbers by which filters name their states to a smoother."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from replay.gnss.measurements import SATELLITE_NAMES
from replay.kernels import state_names
from replay.kernels.gnss_records import SLOTS, SYSTEM_LETTERS

MOTION: Final = tuple(
    f"{kind}_ecef_{axis}" for kind in ("position", "velocity", "acceleration") for axis in "xyz"
)
"""States of a motion without inertial sensors."""
_SINGLE: Final = {
    state_names.CLOCK: "clock",
    state_names.CLOCK_DRIFT: "clock_drift",
    state_names.WET_DELAY: "wet_delay",
    state_names.GRADIENT: "gradient_north",
    state_names.GRADIENT + 1: "gradient_east",
    state_names.WET_ENDS: "wet_rover",
    state_names.WET_ENDS + 1: "wet_base",
    **{state_names.BASELINE + place: f"baseline_ecef_{axis}" for place, axis in enumerate("xyz")},
}


def satellite_name(number: int, first_slot: int = 0) -> str:
    """Name of a state that belongs to satellites or receivers.

    Parameters
    ----------
    number : int
        As :mod:`replay.kernels.state_names` has it.
    first_slot : int
        What the first slot of an ambiguity is called: 1 in relative positioning.
    """
    if number >= state_names.AMBIGUITY:
        satellite, slot = divmod(number - state_names.AMBIGUITY, SLOTS)
        return f"ambiguity_{SATELLITE_NAMES[satellite].decode()}_{slot + first_slot}"
    if number >= state_names.SLANT:
        return f"ionosphere_{SATELLITE_NAMES[number - state_names.SLANT].decode()}"
    if number in _SINGLE:
        return _SINGLE[number]
    if number >= state_names.BIAS:
        system, slot = divmod(number - state_names.BIAS, SLOTS)
        return f"bias_{SYSTEM_LETTERS[system]}_{slot}"
    return f"clock_{SYSTEM_LETTERS[number - state_names.BETWEEN]}"


def name_of(own: Sequence[str] = MOTION, first_slot: int = 0) -> Callable[[int], str]:
    """Name of any state of a filter by its number.

    Parameters
    ----------
    own : sequence of str
        States of its motion, or of its inertial system.
    first_slot : int
    """

    def find(number: int) -> str:
        return own[number] if number < state_names.FIRST else satellite_name(number, first_slot)

    return find
