"""Electron content along a line of sight from maps of the ionosphere.

Schaer, Gurtner and Feltens, "IONEX: The IONosphere Map EXchange Format Version 1", 1998: values
between two maps from both, each turned about the Earth's axis with the Sun (their equation 3),
bilinear within a map (their figure 1); slant by a thin layer.

Maps stand in the order of their times, those of one time in the order of their heights.
"""

import math
from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import asin, atan2, cos, sin, sincos, sqrt
from replay.kernels.types import Array, Record

MAP_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns
        ("gap", "<i8"),  # 1: nothing joins it to the epoch before
        ("first", "<i8"),  # place of its first value
        ("height", "<f8"),  # m
        ("radius", "<f8"),  # m
        ("latitude", "<f8"),  # rad, geocentric, first row
        ("latitude_step", "<f8"),  # rad
        ("latitudes", "<i8"),
        ("longitude", "<f8"),  # rad, first column
        ("longitude_step", "<f8"),  # rad
        ("longitudes", "<i8"),
    ],
    align=True,
)

THIN_LAYER: Final = 0
"""Mapping by the angle at the layer."""
MODIFIED_LAYER: Final = 1
"""The same with 0.9782 times the zenith angle, as CODE does it over 506.7 km."""

_MODIFIED: Final = 0.9782
_HALF_PI: Final = 1.5707963267948966
_TWO_PI: Final = 6.283185307179586
_DAY_S: Final = 86_400.0
_NEAR: Final = 1e-9
_NAN: Final = math.nan


@njit(cache=True)
def tecu_delay(frequency_hz: float) -> float:
    """Metres that one TECU delays a code (and advances a phase), 40.3e16 / f^2."""
    return 40.3e16 / (frequency_hz * frequency_hz)


@njit(cache=True)
def map_value(values: Array, grid: Record, latitude: float, longitude: float) -> float:
    """Bilinear value of one map; NaN off its grid or where a corner is absent.

    Beyond the last row towards a pole, by less than a step, the last row serves.

    Parameters
    ----------
    values : float64 array
        Of all maps.
    grid : record of MAP_DTYPE
    latitude, longitude : float, rad
        Geocentric.
    """
    rows, columns = grid["latitudes"], grid["longitudes"]
    y = (latitude - grid["latitude"]) / grid["latitude_step"]
    if not -1.0 < y < rows:
        return _NAN
    y = min(max(y, 0.0), rows - 1.0)
    turn = _TWO_PI / abs(grid["longitude_step"])
    x = (longitude - grid["longitude"]) / grid["longitude_step"]
    x -= turn * math.floor(x / turn)
    if x > turn - _NEAR:
        x = 0.0
    i = min(int(y), rows - 2)
    j = int(x)
    # A map may leave out the column that closes the circle.
    closes = abs(columns - turn) < 1e-6
    if j >= columns - 1:
        if x - (columns - 1) < _NEAR:
            j = columns - 2
        elif not closes:
            return _NAN
    after = j + 1 if j + 1 < columns else 0
    q, p = y - i, x - j
    at = grid["first"] + i * columns
    south = at + columns
    return (1.0 - q) * ((1.0 - p) * values[at + j] + p * values[at + after]) + q * (
        (1.0 - p) * values[south + j] + p * values[south + after]
    )


@njit(cache=True)
def pierce_point(
    latitude: float, longitude: float, azimuth: float, elevation: float, ratio: float
) -> tuple[float, float]:
    """Where a line of sight goes through the layer, on the sphere (rad).

    Parameters
    ----------
    latitude, longitude : float, rad
        Of the receiver, geocentric.
    azimuth, elevation : float, rad
    ratio : float
        Radius of the receiver's sphere over that of the layer.
    """
    angle = _HALF_PI - elevation - asin(ratio * cos(elevation))
    s, c = sincos(angle)
    sp, cp = sincos(latitude)
    sa, ca = sincos(azimuth)
    sine = sp * c + cp * s * ca
    there = asin(min(max(sine, -1.0), 1.0))
    east = s * sa
    along = cp * c - sp * s * ca
    return there, longitude + atan2(east, along)


@njit(cache=True)
def layer_mapping(elevation: float, ratio: float, model: int) -> float:
    """Slant over vertical content of a thin layer.

    Parameters
    ----------
    elevation : float, rad
    ratio : float
        Radius of the receiver's sphere over that of the layer.
    model : int
        THIN_LAYER or MODIFIED_LAYER.
    """
    zenith = _HALF_PI - elevation
    s = ratio * sin(_MODIFIED * zenith if model == MODIFIED_LAYER else zenith)
    return 1.0 / sqrt(1.0 - s * s)


@njit(cache=True)
def epoch_before(maps: Array, time_ns: int) -> int:
    """First map of the last epoch that is not after a time; -1 where all are."""
    low, high = 0, maps.shape[0]
    while low < high:
        middle = (low + high) // 2
        if maps[middle]["t"] <= time_ns:
            low = middle + 1
        else:
            high = middle
    k = low - 1
    while k > 0 and maps[k - 1]["t"] == maps[k]["t"]:
        k -= 1
    return k


@njit(cache=True)
def slant_tec(
    maps: Array,
    tec: Array,
    rms: Array,
    time_ns: int,
    latitude: float,
    longitude: float,
    azimuth: float,
    elevation: float,
    model: int,
) -> tuple[float, float]:
    """Electron content along a line of sight, and its standard deviation.

    Parameters
    ----------
    maps : array of MAP_DTYPE
    tec, rms : float64 arrays, TECU
        Values of all maps; of `rms` NaN where not stated.
    time_ns : int, ns
    latitude, longitude : float, rad
        Of the receiver, geocentric.
    azimuth, elevation : float, rad
    model : int
        THIN_LAYER or MODIFIED_LAYER.

    Returns
    -------
    tuple of two float, TECU
        NaN before the first map, after the last, in a gap and where a map has no value.
    """
    k = epoch_before(maps, time_ns)
    if k < 0:
        return _NAN, _NAN
    layers = 1
    while k + layers < maps.shape[0] and maps[k + layers]["t"] == maps[k]["t"]:
        layers += 1
    t0 = maps[k]["t"]
    weight = 0.0
    later = k
    if time_ns > t0:
        later = k + layers
        if later + layers > maps.shape[0] or maps[later]["gap"] == 1:
            return _NAN, _NAN
        weight = (time_ns - t0) / (maps[later]["t"] - t0)
    total, variance = 0.0, 0.0
    for layer in range(layers):
        grid, after = maps[k + layer], maps[later + layer]
        ratio = grid["radius"] / (grid["radius"] + grid["height"])
        there, east = pierce_point(latitude, longitude, azimuth, elevation, ratio)
        slant = layer_mapping(elevation, ratio, model)
        # The ionosphere stays under the Sun: at an earlier map's time it stood further east.
        turned = east + (time_ns - t0) / 1e9 * (_TWO_PI / _DAY_S)
        turned_after = east + (time_ns - after["t"]) / 1e9 * (_TWO_PI / _DAY_S)
        value = map_value(tec, grid, there, turned)
        deviation = map_value(rms, grid, there, turned)
        if weight > 0.0:
            value += weight * (map_value(tec, after, there, turned_after) - value)
            deviation += weight * (map_value(rms, after, there, turned_after) - deviation)
        total += slant * value
        variance += (slant * deviation) * (slant * deviation)
    return total, sqrt(variance)
