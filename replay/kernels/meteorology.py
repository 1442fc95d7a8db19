"""Pressure, temperature and water vapour by place and season, without a weather station.

MOPS is the model of RTCA DO-229D, appendix A.4.2.4, which is that of UNB3 (Collins and
Langley 1997): a table by latitude with an annual wave. GPT is that of Boehm, Heinkelmann,
Schuh (2007): pressure and temperature by spherical harmonics, with an annual wave.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels._gpt import COEFFICIENTS
from replay.kernels.atmosphere import at_latitude, vapour_pressure, zenith_hydrostatic, zenith_wet
from replay.kernels.elementary import cos, pow, sin, sincos, sqrt
from replay.kernels.spherical_harmonics import spherical_harmonics

_TWO_PI: Final = 6.283185307179586
_YEAR_DAYS: Final = 365.25
_KELVIN: Final = 273.15

# RTCA DO-229D, table A-2: pressure (hPa), temperature (K), vapour pressure (hPa), lapse rate
# of temperature (K/m), lapse of water vapour (1) at 15, 30, 45, 60, 75 degrees; mean and wave.
_MEAN: Final = (
    (1013.25, 1017.25, 1015.75, 1011.75, 1013.00),
    (299.65, 294.15, 283.15, 272.15, 263.65),
    (26.31, 21.79, 11.66, 6.78, 4.11),
    (6.30e-3, 6.05e-3, 5.58e-3, 5.39e-3, 4.53e-3),
    (2.77, 3.15, 2.57, 1.81, 1.55),
)
_WAVE: Final = (
    (0.0, -3.75, -2.25, -1.75, -0.50),
    (0.0, 7.00, 11.00, 15.00, 14.50),
    (0.0, 8.85, 7.24, 5.36, 3.39),
    (0.0, 0.25e-3, 0.32e-3, 0.81e-3, 0.62e-3),
    (0.0, 0.33, 0.46, 0.74, 0.30),
)
_MINIMUM_NORTH_DAY: Final = 28.0
_MINIMUM_SOUTH_DAY: Final = 211.0
_K1: Final = 77.604  # K/hPa
_K2: Final = 382000.0  # K^2/hPa
_DRY_AIR: Final = 287.054  # J/(kg K)
_MEAN_GRAVITY: Final = 9.784  # m/s^2, of the column of air
_GRAVITY: Final = 9.80665  # m/s^2

_DEGREE: Final = 9
_GPT_DAY: Final = 44266.0  # 28 January 1980 as modified Julian date, counted from 1


@njit(cache=True)
def mops_surface(latitude: float, day: float) -> tuple[float, float, float, float, float]:
    """Meteorology at the level of the sea (RTCA DO-229D, A.4.2.4).

    Parameters
    ----------
    latitude : float, rad
    day : float, day
        Of the year, 1 at the beginning of 1 January.

    Returns
    -------
    tuple of five floats
        Pressure (hPa), temperature (K), vapour pressure (hPa), lapse rate of temperature
        (K/m), lapse of water vapour (1).
    """
    start = _MINIMUM_NORTH_DAY if latitude >= 0.0 else _MINIMUM_SOUTH_DAY
    wave = cos(_TWO_PI * (day - start) / _YEAR_DAYS)
    return (
        at_latitude(_MEAN[0], latitude) - at_latitude(_WAVE[0], latitude) * wave,
        at_latitude(_MEAN[1], latitude) - at_latitude(_WAVE[1], latitude) * wave,
        at_latitude(_MEAN[2], latitude) - at_latitude(_WAVE[2], latitude) * wave,
        at_latitude(_MEAN[3], latitude) - at_latitude(_WAVE[3], latitude) * wave,
        at_latitude(_MEAN[4], latitude) - at_latitude(_WAVE[4], latitude) * wave,
    )


@njit(cache=True)
def mops_zenith(latitude: float, height_m: float, day: float) -> tuple[float, float]:
    """Zenith hydrostatic and wet delay (m) of RTCA DO-229D, A.4.2.4.

    Parameters
    ----------
    latitude : float, rad
    height_m : float, m
        Above the sea.
    day : float, day
        Of the year, 1 at the beginning of 1 January.
    """
    pressure, temperature, vapour, lapse, water = mops_surface(latitude, day)
    dry = 1e-6 * _K1 * _DRY_AIR * pressure / _MEAN_GRAVITY
    wet = 1e-6 * _K2 * _DRY_AIR / (_MEAN_GRAVITY * (water + 1.0) - lapse * _DRY_AIR)
    wet *= vapour / temperature
    cooling = 1.0 - lapse * height_m / temperature
    exponent = _GRAVITY / (_DRY_AIR * lapse)
    return dry * pow(cooling, exponent), wet * pow(cooling, (water + 1.0) * exponent - 1.0)


@njit(cache=True)
def mops_mapping(elevation: float) -> float:
    """Slant over zenith delay of RTCA DO-229D, A.4.2.4; elevation in rad, of 5 degrees and more."""
    s = sin(elevation)
    return 1.001 / sqrt(0.002001 + s * s)


@njit(cache=True)
def gpt(
    latitude: float, longitude: float, height_m: float, modified_julian_date: float
) -> tuple[float, float, float]:
    """Pressure, temperature and the geoid (Boehm, Heinkelmann, Schuh 2007).

    Parameters
    ----------
    latitude, longitude : float, rad
        Geodetic.
    height_m : float, m
        Above the ellipsoid.
    modified_julian_date : float, day

    Returns
    -------
    pressure : float, hPa
    temperature : float, deg C
    undulation : float, m
        Of the geoid over the ellipsoid.
    """
    sin_lat, cos_lat = sincos(latitude)
    sin_lon, cos_lon = sincos(longitude)
    x, y, z = cos_lat * cos_lon, cos_lat * sin_lon, sin_lat
    # Unnormalised harmonics: v holds the cosine terms, w the sine terms.
    v, w = np.empty((_DEGREE + 1, _DEGREE + 1)), np.empty((_DEGREE + 1, _DEGREE + 1))
    spherical_harmonics(x, y, z, v, w)
    sums = np.zeros(5)
    for k in range(5):
        i = 0
        for n in range(_DEGREE + 1):
            for m in range(n + 1):
                sums[k] += COEFFICIENTS[2 * k, i] * v[n, m] + COEFFICIENTS[2 * k + 1, i] * w[n, m]
                i += 1
    wave = cos(_TWO_PI * (modified_julian_date - _GPT_DAY) / _YEAR_DAYS)
    height = height_m - sums[0]
    pressure = (sums[1] + sums[2] * wave) * pow(1.0 - 0.0000226 * height, 5.225)
    return pressure, sums[3] + sums[4] * wave - 0.0065 * height, sums[0]


@njit(cache=True)
def gpt_zenith(
    latitude: float, longitude: float, height_m: float, modified_julian_date: float, humidity: float
) -> tuple[float, float]:
    """Zenith hydrostatic and wet delay (m) of Saastamoinen in GPT's pressure and temperature.

    Parameters
    ----------
    latitude, longitude : float, rad
    height_m : float, m
        Above the ellipsoid.
    modified_julian_date : float, day
    humidity : float
        Relative, 0 to 1: GPT says nothing of water vapour.
    """
    pressure, celsius, undulation = gpt(latitude, longitude, height_m, modified_julian_date)
    kelvin = celsius + _KELVIN
    return (
        zenith_hydrostatic(pressure, latitude, height_m - undulation),
        zenith_wet(kelvin, vapour_pressure(kelvin, humidity)),
    )
