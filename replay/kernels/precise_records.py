"""Records of the stage of precise orbits: settings, state and terms of the corrections."""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.types import Array

PRECISE_SIGHTS_CONFIG_DTYPE: Final = np.dtype(
    [
        ("broadcast", "<i8"),  # 1: orbits and clocks of broadcast messages
        ("biases", "<i8"),
        ("nominal", "<i8"),  # 1: every satellite looks at the Sun, whatever its block
        ("range_std", "<f8"),  # m, of orbit or clock where the products state none
        ("satellite_antenna", "<i8"),
        ("wind_up", "<i8"),
        ("solid_tide", "<i8"),
        ("pole_tide", "<i8"),
        ("ocean_loading", "<i8"),
        ("higher_ionosphere", "<i8"),
        ("maps", "<i8"),  # 1: the ionosphere is that of maps
        ("layer", "<i8"),  # THIN_LAYER or MODIFIED_LAYER
    ],
    align=True,
)

PRECISE_SIGHTS_STATE_DTYPE: Final = np.dtype(
    [
        ("wind_up", "<f8", SATELLITES),  # cycles, NaN before the first
        ("wind_up_t", "<i8", SATELLITES),  # ns
        ("lacking", "<i8", SATELLITES),  # kind of note that has been told, 0 for none
        ("continued", "<i8", SATELLITES),  # the same of orbits and clocks past their epochs
        ("unbiased", "<i8", (SATELLITES, SLOTS)),  # signal whose lack of a bias has been told
        ("no_map", "<i8"),  # 1 where the lack of a map has been told
        ("height", "<f8"),  # m, of the antenna, smoothed
        ("heights", "<i8"),  # epochs in it
        ("height_t", "<i8"),  # ns
    ],
    align=True,
)

TERMS_DTYPE: Final = np.dtype(
    [
        ("solid_tide", "<f8"),  # m; NaN is absent, here and below
        ("pole_tide", "<f8"),  # m
        ("ocean_loading", "<f8"),  # m
        ("satellite_antenna", "<f8", SLOTS),  # m
        ("wind_up", "<f8", SLOTS),  # m
        ("phase_bias", "<f8", SLOTS),  # m
        ("higher_ionosphere", "<f8", SLOTS),  # m
    ],
    align=True,
)
"""Terms of one satellite at one epoch beyond those of MEASURED_DTYPE."""

LEAP_DTYPE: Final = np.dtype([("t", "<i8"), ("seconds", "<i8")], align=True)
"""GPS less UTC (s) from a GPS time (ns) on."""

# Notes: the number of the event's kind, and thousands for what it was.
NO_SATELLITE: Final = 13
KIND: Final = 1000
CLOCK: Final = 10 * KIND  # is added where the clock lacks, not the orbit
CONTINUED: Final = 5
NO_BIAS: Final = 6
NO_MAP: Final = 7


class Products(NamedTuple):
    """Everything that a compiled loop reads of products.

    Attributes
    ----------
    orbits, clocks, biases : arrays of PRECISE_ORBIT_DTYPE, PRECISE_CLOCK_DTYPE, BIAS_DTYPE
        Grouped by satellite; the `starts` (SATELLITES + 1,) say where each begins.
    rotation : array of ROTATION_DTYPE
    maps : array of MAP_DTYPE
    tec, rms : float64 arrays, TECU
    patterns : array of PATTERN_DTYPE
        Of satellites, grouped by satellite.
    attitudes : int64 array
        Attitude model that goes with each pattern.
    values : float64 array, m
        Of all patterns.
    amplitudes, phases : float64 arrays (3, 11), m and rad
        Ocean loading as of :func:`replay.kernels.tides.ocean_loading`; empty where not known.
    leaps : array of LEAP_DTYPE
    interpolation : array (1,) of PRECISE_CONFIG_DTYPE
    """

    orbits: NDArray[Any]
    orbit_starts: NDArray[Any]
    clocks: NDArray[Any]
    clock_starts: NDArray[Any]
    biases: NDArray[Any]
    bias_starts: NDArray[Any]
    rotation: NDArray[Any]
    maps: NDArray[Any]
    tec: NDArray[Any]
    rms: NDArray[Any]
    patterns: NDArray[Any]
    pattern_starts: NDArray[Any]
    attitudes: NDArray[Any]
    values: NDArray[Any]
    amplitudes: NDArray[Any]
    phases: NDArray[Any]
    leaps: NDArray[Any]
    interpolation: NDArray[Any]


class Broadcast(NamedTuple):
    """Broadcast messages, grouped by satellite, and when each became known (ns)."""

    messages: NDArray[Any]
    available: NDArray[Any]
    starts: NDArray[Any]


def new_precise_state() -> Array:
    """One state record of a stage that has seen nothing."""
    state = np.zeros(1, dtype=PRECISE_SIGHTS_STATE_DTYPE)
    state["wind_up"] = np.nan
    state["height"] = np.nan
    return state
