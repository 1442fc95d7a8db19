"""What a receiver's antenna adds to code and phase: offset and pattern of its phase centre.

The range that is measured ends at the phase centre, the position that is wanted is that of
the antenna's reference point: the antenna adds the pattern in the direction of the satellite
less the component of the offset in that direction (Rothacher and Schmid, ANTEX 1.4, 2010;
RTKLIB's `antmodel` has the same sign). Code gets what phase gets.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import cos, sin
from replay.kernels.gnss_records import GPS, SLOTS
from replay.kernels.types import Array, Record

# One frequency of one antenna. Its numbers stand in an array for all: first the pattern by
# zenith angle, then the one by azimuth and zenith angle, row by row of one azimuth.
PATTERN_DTYPE: Final = np.dtype(
    [
        ("available", "<i8"),  # ns, log time from which it is known
        ("valid_from", "<i8"),  # ns, 0 for always
        ("valid_until", "<i8"),  # ns, 0 for always
        ("antenna", "<i8"),  # number of its name
        ("system", "<i8"),  # 0 to 4
        ("band", "<i8"),  # RINEX
        ("frequency", "<f8"),  # Hz
        ("offset", "<f8", 3),  # m, north, east, up
        ("zenith_start", "<f8"),  # rad
        ("zenith_step", "<f8"),  # rad
        ("zenith_count", "<i8"),
        ("azimuth_step", "<f8"),  # rad
        ("azimuth_count", "<i8"),  # 0: by zenith angle alone
        ("first", "<i8"),  # place of its numbers
    ],
    align=True,
)

# The antenna that a receiver has from a log time on.
WORN_DTYPE: Final = np.dtype(
    [
        ("log_t", "<i8"),  # ns
        ("antenna", "<i8"),  # number of its name
        ("bare", "<i8"),  # number of the name without a radome
    ],
    align=True,
)

_HALF_PI: Final = 1.5707963267948966
_TURN: Final = 6.283185307179586


@njit(cache=True)
def choose_pattern(
    patterns: Array, antenna: int, system: int, band: int, frequency: float, t: int, log_t: int
) -> int:
    """Number of an antenna's pattern for a signal, or minus one.

    Where the antenna was not calibrated on the frequency of the system, GPS's frequency
    nearest to it serves: files of the IGS up to 2022 have few receiver antennas with more
    than GPS and GLONASS.

    Parameters
    ----------
    patterns : array of PATTERN_DTYPE
    antenna, system, band : int
    frequency : float, Hz
    t, log_t : int, ns
        Valid and log time of the epoch.
    """
    best = -1
    nearest = 0.0
    for k in range(patterns.shape[0]):
        pattern = patterns[k]
        if pattern["antenna"] != antenna or pattern["available"] > log_t:
            continue
        if pattern["valid_from"] != 0 and t < pattern["valid_from"]:
            continue
        if pattern["valid_until"] != 0 and t > pattern["valid_until"]:
            continue
        if pattern["system"] == system and pattern["band"] == band:
            return k
        if pattern["system"] == GPS:
            distance = abs(pattern["frequency"] - frequency)
            if best < 0 or distance < nearest:
                best = k
                nearest = distance
    return best


@njit(cache=True)
def _between(values: Array, first: int, count: int, place: float) -> float:
    """Linear interpolation at a place on a grid of `count` values; its ends go on."""
    if place <= 0.0:
        return float(values[first])
    if place >= count - 1:
        return float(values[first + count - 1])
    k = int(place)
    part = place - k
    return float(values[first + k] * (1.0 - part) + values[first + k + 1] * part)


@njit(cache=True)
def pattern_value(
    pattern: Record, values: Array, elevation: float, azimuth: float, level: bool
) -> float:
    """Pattern (m) in a direction, linear between its points; beyond its edge as at its edge.

    Parameters
    ----------
    pattern : record of PATTERN_DTYPE
    values : float64 array, m
    elevation, azimuth : float, rad
        Azimuth from north.
    level : bool
        Use the mean over azimuths.
    """
    count = pattern["zenith_count"]
    place = (_HALF_PI - elevation - pattern["zenith_start"]) / pattern["zenith_step"]
    first = pattern["first"]
    if level or pattern["azimuth_count"] < 2:
        return _between(values, first, count, place)
    turn = azimuth
    while turn < 0.0:
        turn += _TURN
    while turn >= _TURN:
        turn -= _TURN
    across = turn / pattern["azimuth_step"]
    k = min(int(across), pattern["azimuth_count"] - 2)
    part = across - k
    low = _between(values, first + (k + 1) * count, count, place)
    high = _between(values, first + (k + 2) * count, count, place)
    return low * (1.0 - part) + high * part


@njit(cache=True)
def antenna_range(
    pattern: Record, values: Array, elevation: float, azimuth: float, level: bool
) -> float:
    """What an antenna adds to range and phase (m); parameters as of :func:`pattern_value`.

    `level` says that nothing is known of the antenna but that it points up: the
    horizontal offset is left out with the azimuth.
    """
    offset = pattern["offset"]
    along = offset[2] * sin(elevation)
    if not level:
        flat = cos(elevation)
        along += offset[0] * flat * cos(azimuth) + offset[1] * flat * sin(azimuth)
    return pattern_value(pattern, values, elevation, azimuth, level) - along


@njit(cache=True)
def model_antenna(
    epochs: Array,
    rows: Array,
    worn: Array,
    patterns: Array,
    values: Array,
    level: bool,
    out: Array,
) -> None:
    """Fill what the antenna adds to each signal of the epochs of a block.

    Parameters
    ----------
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
    worn : array of WORN_DTYPE
        In the order of log time; an epoch has the last that is not later.
    patterns : array of PATTERN_DTYPE
    values : float64 array, m
    level : bool
        As of :func:`antenna_range`.
    out : float64 array (rows, SLOTS), m
        Stays as it is where nothing is known.
    """
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        have = -1
        for k in range(worn.shape[0]):
            if worn[k]["log_t"] <= epoch["log_t"]:
                have = k
        if have < 0:
            continue
        for n in range(epoch["first"], epoch["first"] + epoch["count"]):
            row = rows[n]
            if row["seen"] != 1:
                continue
            for slot in range(SLOTS):
                code = row["signal"][slot]
                if code == 0:
                    continue
                band = code % 256 - 48
                chosen = choose_pattern(
                    patterns, worn[have]["antenna"], row["system"], band,
                    row["frequency"][slot], epoch["t"], epoch["log_t"],
                )  # fmt: skip
                if chosen < 0:
                    chosen = choose_pattern(
                        patterns, worn[have]["bare"], row["system"], band,
                        row["frequency"][slot], epoch["t"], epoch["log_t"],
                    )  # fmt: skip
                if chosen >= 0:
                    out[n, slot] = antenna_range(
                        patterns[chosen], values, row["elevation"], row["azimuth"], level
                    )
