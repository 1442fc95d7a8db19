"""Mapping functions of the troposphere: GMF, and Vienna's from coefficients that are given.

What depends on place and day alone is apart from what depends on the elevation, so that an
epoch pays for the spherical harmonics once. Niell's functions are in
:mod:`replay.kernels.atmosphere`, which also has the continued fraction.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels._gmf import COEFFICIENTS
from replay.kernels.atmosphere import continued_fraction
from replay.kernels.elementary import cos, sin, sincos
from replay.kernels.spherical_harmonics import spherical_harmonics

_PI: Final = 3.141592653589793
_TWO_PI: Final = 6.283185307179586
_YEAR_DAYS: Final = 365.25
_DEGREE: Final = 9
_REFERENCE_DAY: Final = 44266.0  # 28 January 1980 as modified Julian date, counted from 1
_DAY_NS: Final = 86_400_000_000_000
_GPS_EPOCH_DAY: Final = 44244  # modified Julian date of 1980-01-06

_HYDROSTATIC_B: Final = 0.0029
_WET_B: Final = 0.00146
_WET_C: Final = 0.04391
_HEIGHT: Final = (2.53e-5, 5.49e-3, 1.14e-3)  # Niell (1996), table 3

# Chen and Herring (1997), J. Geophys. Res. 102(B9), eq. 16 and below.
GRADIENT_HYDROSTATIC: Final = 0.0031
GRADIENT_WET: Final = 0.0007
GRADIENT_TOTAL: Final = 0.0032


@njit(cache=True)
def modified_julian_date(time_ns: int) -> float:
    """Modified Julian date (day) of a GPS time (ns since 1980-01-06), in GPS's scale."""
    day = time_ns // _DAY_NS
    return _GPS_EPOCH_DAY + day + (time_ns - day * _DAY_NS) / _DAY_NS


@njit(cache=True)
def vmf1_hydrostatic_c(latitude: float, day: float) -> float:
    """Third coefficient of VMF1's and GMF's hydrostatic function.

    Boehm, Werl, Schuh (2006), J. Geophys. Res. 111, B02406, eq. 7 and table 5 (of the
    corrected print), as in the IERS Conventions (2010), chapter 9.

    Parameters
    ----------
    latitude : float, rad
    day : float, day
        Modified Julian date.
    """
    phase, c11, c10 = 0.0, 0.005, 0.001
    if latitude < 0.0:
        phase, c11, c10 = _PI, 0.007, 0.002
    season = cos(_TWO_PI * (day - _REFERENCE_DAY) / _YEAR_DAYS + phase)
    return 0.062 + ((season + 1.0) * c11 / 2.0 + c10) * (1.0 - cos(latitude))


@njit(cache=True)
def gmf_coefficients(latitude: float, longitude: float, day: float) -> tuple[float, float, float]:
    """Place and season of the global mapping functions (Boehm et al. 2006, GRL 33, L07304).

    Parameters
    ----------
    latitude, longitude : float, rad
    day : float, day
        Modified Julian date.

    Returns
    -------
    hydrostatic_a, hydrostatic_c, wet_a : float
        For :func:`vienna_hydrostatic` and :func:`vienna_wet`.
    """
    sin_lat, cos_lat = sincos(latitude)
    sin_lon, cos_lon = sincos(longitude)
    v, w = np.empty((_DEGREE + 1, _DEGREE + 1)), np.empty((_DEGREE + 1, _DEGREE + 1))
    spherical_harmonics(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat, v, w)
    sums = np.zeros(4)
    for k in range(4):
        i = 0
        for n in range(_DEGREE + 1):
            for m in range(n + 1):
                sums[k] += COEFFICIENTS[2 * k, i] * v[n, m] + COEFFICIENTS[2 * k + 1, i] * w[n, m]
                i += 1
    season = cos(_TWO_PI * (day - _REFERENCE_DAY) / _YEAR_DAYS)
    return (
        (sums[0] + sums[1] * season) * 1e-5,
        vmf1_hydrostatic_c(latitude, day),
        (sums[2] + sums[3] * season) * 1e-5,
    )


@njit(cache=True)
def height_correction(sin_elevation: float, height_m: float) -> float:
    """What a hydrostatic function gains with the height (m): Niell (1996), eq. 6."""
    zero = continued_fraction(sin_elevation, _HEIGHT[0], _HEIGHT[1], _HEIGHT[2])
    return (1.0 / sin_elevation - zero) * height_m / 1000.0


@njit(cache=True)
def vienna_hydrostatic(elevation: float, a: float, b: float, c: float, height_m: float) -> float:
    """Hydrostatic mapping function of Vienna's form: slant over zenith delay.

    GMF: a and c of :func:`gmf_coefficients`, b of 0.0029. VMF1: a of the site or the grid, the
    same b, c of :func:`vmf1_hydrostatic_c`. VMF3: a, b and c of its own.

    Parameters
    ----------
    elevation : float, rad
        Above zero; meant for 3 degrees and more.
    a, b, c : float
    height_m : float, m
        Above where the coefficients hold: the station's height for GMF and for coefficients
        of a grid, 0 for coefficients of the site itself.
    """
    s = sin(elevation)
    return continued_fraction(s, a, b, c) + height_correction(s, height_m)


@njit(cache=True)
def vienna_wet(elevation: float, a: float, b: float, c: float) -> float:
    """Wet mapping function of Vienna's form; as :func:`vienna_hydrostatic`, without height."""
    return continued_fraction(sin(elevation), a, b, c)


@njit(cache=True)
def gmf(
    elevation: float, height_m: float, hydrostatic_a: float, hydrostatic_c: float, wet_a: float
) -> tuple[float, float]:
    """Global mapping functions, hydrostatic and wet: slant over zenith delay.

    Parameters
    ----------
    elevation : float, rad
    height_m : float, m
        Above the sea.
    hydrostatic_a, hydrostatic_c, wet_a : float
        Of :func:`gmf_coefficients`.
    """
    s = sin(elevation)
    return (
        continued_fraction(s, hydrostatic_a, _HYDROSTATIC_B, hydrostatic_c)
        + height_correction(s, height_m),
        continued_fraction(s, wet_a, _WET_B, _WET_C),
    )


@njit(cache=True)
def vmf1(
    elevation: float, hydrostatic_a: float, wet_a: float, latitude: float, height_m: float,
    day: float,
) -> tuple[float, float]:  # fmt: skip
    """Vienna mapping functions 1, hydrostatic and wet, from coefficients that are given.

    Boehm, Werl, Schuh (2006), J. Geophys. Res. 111, B02406.

    Parameters
    ----------
    elevation : float, rad
    hydrostatic_a, wet_a : float
        Of the site or interpolated in the grid.
    latitude : float, rad
    height_m : float, m
        Above where the coefficients hold: 0 for those of the site.
    day : float, day
        Modified Julian date.
    """
    c = vmf1_hydrostatic_c(latitude, day)
    return (
        vienna_hydrostatic(elevation, hydrostatic_a, _HYDROSTATIC_B, c, height_m),
        vienna_wet(elevation, wet_a, _WET_B, _WET_C),
    )


@njit(cache=True)
def gradient_mapping(elevation: float, azimuth: float, form: float) -> tuple[float, float]:
    """What a metre of horizontal gradient to the east and north adds to a slant delay.

    Chen and Herring (1997): 1 / (sin e tan e + C) times sine and cosine of the azimuth.

    Parameters
    ----------
    elevation, azimuth : float, rad
    form : float
        C: 0.0031 hydrostatic, 0.0007 wet, 0.0032 both.

    Returns
    -------
    east, north : float
    """
    s, c = sincos(elevation)
    sin_az, cos_az = sincos(azimuth)
    slope = c / (s * s + form * c)
    return slope * sin_az, slope * cos_az
