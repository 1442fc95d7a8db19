"""Fields of the atmosphere that all receivers and satellites share, in space and time.

Ionosphere: vertical delay on GPS L1 over places where lines of sight pierce it (the shell
of BDS-SIS-ICD B1I 3.0, 5.2.4.7): a slope, a travelling wave, a moving front. Troposphere:
zenith wet delay over places of receivers (a slope, and a random field that drifts with the
wind), and the horizontal gradient of what is above one.
"""

import math
from typing import Final

from numba import njit

from replay.kernels.elementary import cos, sin, sincos
from replay.kernels.types import Array, Record

WAVES: Final = 24  # of which a random field is made

_SHELL_M = 6378e3 + 375e3
_TWO_PI = 6.283185307179586
_CHEN_HERRING = 0.0032  # Petit and Luzum (2010), IERS Conventions, eq. 9.12


@njit(cache=True)
def shell_distance(
    latitude: float, longitude: float, origin_latitude: float, origin_longitude: float
) -> tuple[float, float]:
    """East and north distance (m) along the ionosphere's shell; angles in rad."""
    turned = longitude - origin_longitude
    turned -= _TWO_PI * math.floor(turned / _TWO_PI + 0.5)
    return _SHELL_M * cos(origin_latitude) * turned, _SHELL_M * (latitude - origin_latitude)


@njit(cache=True)
def vertical_ionosphere(
    air: Record, latitude: float, longitude: float, since_s: float
) -> float:  # fmt: skip
    """Vertical delay of slope, wave and front, m on GPS L1.

    Parameters
    ----------
    air : record of ATMOSPHERE_DTYPE
    latitude, longitude : float, rad
        Of the pierce point, geographic.
    since_s : float, s
        Since the start.
    """
    east, north = shell_distance(
        latitude, longitude, air["origin_latitude"], air["origin_longitude"]
    )
    delay = air["slope"][0] * east + air["slope"][1] * north
    wave = air["wave"]
    if wave[0] != 0.0:
        delay += wave[0] * sin(wave[1] * east + wave[2] * north - wave[3] * since_s)
    front = air["front"]
    if front[0] != 0.0:
        # Behind the front's line there is its whole height, ahead of its width nothing.
        ahead = front[1] * east + front[2] * north - front[4] - front[3] * since_s
        share = 1.0 - ahead / front[5]
        if share > 1.0:
            share = 1.0
        elif share < 0.0:
            share = 0.0
        delay += front[0] * share
    return delay


@njit(cache=True)
def random_field(waves: Array, east: float, north: float, since_s: float) -> float:
    """Sum of plane waves.

    Parameters
    ----------
    waves : float64 array (n, 5)
        Amplitude, wave numbers to the east and north (rad/m), rate (rad/s), phase (rad).
    east, north : float, m
    since_s : float, s
    """
    total = 0.0
    for k in range(waves.shape[0]):
        w = waves[k]
        total += w[0] * cos(w[1] * east + w[2] * north - w[3] * since_s + w[4])
    return total


@njit(cache=True)
def zenith_wet_field(air: Record, east: float, north: float, since_s: float) -> float:
    """Zenith wet delay (m) of slope and random field at a receiver, from its distance (m)."""
    delay = air["wet_slope"][0] * east + air["wet_slope"][1] * north
    if air["wet_waves"][0, 0] != 0.0:
        delay += random_field(air["wet_waves"], east, north, since_s)
    return delay


@njit(cache=True)
def gradient_delay(east_m: float, north_m: float, elevation: float, azimuth: float) -> float:
    """Delay (m) of a horizontal gradient: Chen and Herring (1997), J. Geophys. Res. 102(B9).

    m(e) (G_n cos a + G_e sin a), m = 1 / (sin e tan e + 0.0032).

    Parameters
    ----------
    east_m, north_m : float, m
        Gradient vector.
    elevation, azimuth : float, rad
    """
    s, c = sincos(elevation)
    sin_az, cos_az = sincos(azimuth)
    mapping = c / (s * s + _CHEN_HERRING * c)
    return mapping * (north_m * cos_az + east_m * sin_az)
