"""Numbers by which filters of satellites name their states to a smoother: one table for all.

A number below :data:`FIRST` is the place of a state of motion, or of an inertial system, in the
order of the filter's own list. :func:`replay.stages.state_names.satellite_name` makes words of
the others.
"""

from typing import Final

from numba import njit

from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.types import Array, Record

FIRST: Final = 1000
CLOCK: Final = 1000
CLOCK_DRIFT: Final = 1001
WET_DELAY: Final = 1002
GRADIENT: Final = 1003
"""North; the next one is east."""
BETWEEN: Final = 1100
"""And the system: its clock from the receiver's."""
BIAS: Final = 1200
"""And system times SLOTS plus slot: of a code."""
WET_ENDS: Final = 2000
"""Of the rover; the next one is that of the base."""
BASELINE: Final = 2100
"""And the axis: position relative to a base that is only coarsely known itself."""
SLANT: Final = 3000
"""And the satellite: delay of the ionosphere."""
AMBIGUITY: Final = 10000
"""And satellite times SLOTS plus slot."""


@njit(cache=True)
def name_phases(slants: Array, ambiguities: Array, shift: int, name: Array) -> None:
    """Number slant delays and ambiguities.

    Parameters
    ----------
    slants, ambiguities : int64 arrays (SATELLITES,), (SATELLITES, SLOTS)
        Which state each one is, minus one for none.
    shift : int
        How far behind these places the states stand.
    name : int64 array
        Filled.
    """
    for satellite in range(SATELLITES):
        if slants[satellite] >= 0:
            name[shift + slants[satellite]] = SLANT + satellite
        for slot in range(SLOTS):
            if ambiguities[satellite, slot] >= 0:
                name[shift + ambiguities[satellite, slot]] = AMBIGUITY + SLOTS * satellite + slot


@njit(cache=True)
def name_precise(s: Record, shift: int, name: Array) -> None:
    """Number the states of precise point positioning behind those of the motion.

    Parameters
    ----------
    s : record of PPP_STATE_DTYPE
    shift : int
        How far behind the places in `s` the states stand.
    name : int64 array
        Filled.
    """
    if s["clock"] >= 0:
        name[shift + s["clock"]] = CLOCK
    if s["drift"] >= 0:
        name[shift + s["drift"]] = CLOCK_DRIFT
    if s["wet"] >= 0:
        name[shift + s["wet"]] = WET_DELAY
    if s["gradient"] >= 0:
        name[shift + s["gradient"]] = GRADIENT
        name[shift + s["gradient"] + 1] = GRADIENT + 1
    between, bias = s["between"], s["bias"]
    for system in range(between.shape[0]):
        if between[system] >= 0:
            name[shift + between[system]] = BETWEEN + system
        for slot in range(SLOTS):
            if bias[system, slot] >= 0:
                name[shift + bias[system, slot]] = BIAS + SLOTS * system + slot
    name_phases(s["slant"], s["amb"], shift, name)


@njit(cache=True)
def name_differences(s: Record, shift: int, name: Array) -> None:
    """Number the states of relative positioning behind those of the motion.

    Parameters
    ----------
    s : record of RTK_STATE_DTYPE
    shift : int
        How far behind the places in `s` the states stand.
    name : int64 array
        Filled.
    """
    if s["wet"] >= 0:
        for end in range(2):
            name[shift + s["wet"] + end] = WET_ENDS + end
    name_phases(s["slant"], s["amb"], shift, name)
