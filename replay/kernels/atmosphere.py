"""Delays of the ionosphere and the troposphere, each term by itself.

Delays are metres, positive, of a pseudorange; the ionosphere advances the carrier
phase by as much. Latitude is geodetic; angles are radians.
"""

import math

from numba import njit

from replay.kernels.elementary import asin, cos, exp, pow, sin, sincos, sqrt
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.types import Array

_PI = 3.141592653589793
_TWO_PI = 6.283185307179586
_DAY_S = 86400.0
_DAY_NS = 86_400_000_000_000
_NIGHT_S = 5e-9
_NOON_S = 50400.0
_SHORTEST_PERIOD_S = 72000.0
_LONGEST_PERIOD_S = 172800.0  # BDS-SIS-ICD B1I 3.0, 5.2.4.7; GPS has no such bound

KLOBUCHAR_REFERENCE_HZ = 1575.42e6  # GPS L1
BEIDOU_REFERENCE_HZ = 1561.098e6  # B1I
_BEIDOU_EARTH_M = 6378e3  # BDS-SIS-ICD B1I 3.0, 5.2.4.7
_BEIDOU_SHELL_M = 375e3


@njit(cache=True)
def klobuchar_l1(
    alpha: Array,
    beta: Array,
    latitude: float,
    longitude: float,
    elevation: float,
    azimuth: float,
    time_s: float,
) -> float:
    """Ionospheric delay on GPS L1 by Klobuchar's model (IS-GPS-200N, 20.3.3.5.2.5).

    Parameters
    ----------
    alpha, beta : array (4,)
        Of the message: s / semicircle^n, n = 0 to 3.
    latitude, longitude : float, rad
        Geodetic.
    elevation, azimuth : float, rad
        Elevation above zero.
    time_s : float, s
        GPS time of day or of week.

    Returns
    -------
    float, m
    """
    e = elevation / _PI
    psi = 0.0137 / (e + 0.11) - 0.022
    sin_az, cos_az = sincos(azimuth)
    phi = latitude / _PI + psi * cos_az
    if phi > 0.416:
        phi = 0.416
    elif phi < -0.416:
        phi = -0.416
    lam = longitude / _PI + psi * sin_az / cos(phi * _PI)
    geomagnetic = phi + 0.064 * cos((lam - 1.617) * _PI)
    t = 43200.0 * lam + time_s
    t -= _DAY_S * math.floor(t / _DAY_S)
    u = 0.53 - e
    slant = 1.0 + 16.0 * u * u * u
    amplitude = alpha[0] + geomagnetic * (
        alpha[1] + geomagnetic * (alpha[2] + geomagnetic * alpha[3])
    )
    period = beta[0] + geomagnetic * (beta[1] + geomagnetic * (beta[2] + geomagnetic * beta[3]))
    if amplitude < 0.0:
        amplitude = 0.0
    if period < _SHORTEST_PERIOD_S:
        period = _SHORTEST_PERIOD_S
    x = _TWO_PI * (t - _NOON_S) / period
    delay = _NIGHT_S
    if -1.57 < x < 1.57:
        x2 = x * x
        delay += amplitude * (1.0 - x2 / 2.0 + x2 * x2 / 24.0)
    return SPEED_OF_LIGHT_M_S * slant * delay


@njit(cache=True)
def _within_one(x: float) -> float:
    """Argument of asin, which rounding may have put beyond one."""
    if x > 1.0:
        return 1.0
    if x < -1.0:
        return -1.0
    return x


@njit(cache=True)
def beidou_pierce_point(
    latitude: float, longitude: float, elevation: float, azimuth: float
) -> tuple[float, float, float]:
    """Where the line of sight meets BeiDou's ionosphere (BDS-SIS-ICD B1I 3.0, 5.2.4.7).

    Parameters
    ----------
    latitude, longitude : float, rad
    elevation, azimuth : float, rad

    Returns
    -------
    latitude, longitude : float, rad
        Geographic, on a sphere of 6378 km plus 375 km.
    slant : float
        Slant over vertical delay there.
    """
    k = _BEIDOU_EARTH_M / (_BEIDOU_EARTH_M + _BEIDOU_SHELL_M) * cos(elevation)
    psi = 0.5 * _PI - elevation - asin(k)
    sin_psi, cos_psi = sincos(psi)
    sin_az, cos_az = sincos(azimuth)
    sin_lat, cos_lat = sincos(latitude)
    phi = asin(_within_one(sin_lat * cos_psi + cos_lat * sin_psi * cos_az))
    lam = longitude + asin(_within_one(sin_psi * sin_az / cos(phi)))
    return phi, lam, 1.0 / sqrt(1.0 - k * k)


@njit(cache=True)
def klobuchar_b1i(
    alpha: Array,
    beta: Array,
    latitude: float,
    longitude: float,
    elevation: float,
    azimuth: float,
    time_s: float,
) -> float:
    """Ionospheric delay on BeiDou B1I by its eight parameters (BDS-SIS-ICD B1I 3.0, 5.2.4.7).

    As Klobuchar's, but with the geographic latitude of the pierce point without sign,
    a whole cosine and the spherical slant factor.

    Parameters
    ----------
    alpha, beta : array (4,)
        Of the message: s / semicircle^n, n = 0 to 3.
    latitude, longitude : float, rad
    elevation, azimuth : float, rad
    time_s : float, s
        BeiDou time of day or of week (GPS time less 14 s).

    Returns
    -------
    float, m
    """
    phi, lam, slant = beidou_pierce_point(latitude, longitude, elevation, azimuth)
    p = phi / _PI
    if p < 0.0:
        p = -p
    amplitude = alpha[0] + p * (alpha[1] + p * (alpha[2] + p * alpha[3]))
    period = beta[0] + p * (beta[1] + p * (beta[2] + p * beta[3]))
    if amplitude < 0.0:
        amplitude = 0.0
    if period < _SHORTEST_PERIOD_S:
        period = _SHORTEST_PERIOD_S
    elif period > _LONGEST_PERIOD_S:
        period = _LONGEST_PERIOD_S
    t = time_s + lam * 43200.0 / _PI
    t -= _DAY_S * math.floor(t / _DAY_S)
    delay = _NIGHT_S
    from_noon = t - _NOON_S
    if -0.25 * period < from_noon < 0.25 * period:
        delay += amplitude * cos(_TWO_PI * from_noon / period)
    return SPEED_OF_LIGHT_M_S * slant * delay


@njit(cache=True)
def scale_ionosphere(delay_m: float, reference_hz: float, frequency_hz: float) -> float:
    """First-order ionospheric delay on another frequency: by the inverse square."""
    ratio = reference_hz / frequency_hz
    return delay_m * (ratio * ratio)


@njit(cache=True)
def standard_atmosphere(height_m: float) -> tuple[float, float]:
    """Pressure (hPa) and temperature (K) of the standard atmosphere (ISO 2533) up to 11 km.

    Parameters
    ----------
    height_m : float, m
        Above the sea; values out of -1000 to 11000 are taken as those.
    """
    h = height_m
    if h < -1000.0:
        h = -1000.0
    elif h > 11000.0:
        h = 11000.0
    temperature = 288.15 - 0.0065 * h
    return 1013.25 * pow(temperature / 288.15, 5.255877), temperature


@njit(cache=True)
def vapour_pressure(temperature_k: float, relative_humidity: float) -> float:
    """Partial pressure of water vapour (hPa); humidity from 0 to 1 (RTKLIB manual, E.5)."""
    return (
        6.108 * relative_humidity * exp((17.15 * temperature_k - 4684.0) / (temperature_k - 38.45))
    )


@njit(cache=True)
def zenith_hydrostatic(pressure_hpa: float, latitude: float, height_m: float) -> float:
    """Zenith hydrostatic delay (m) of Saastamoinen (1972) as in Davis et al. (1985).

    Parameters
    ----------
    pressure_hpa : float, hPa
        At the antenna.
    latitude : float, rad
    height_m : float, m
    """
    return 0.0022768 * pressure_hpa / (1.0 - 0.00266 * cos(2.0 * latitude) - 0.00028e-3 * height_m)


@njit(cache=True)
def zenith_wet(temperature_k: float, vapour_pressure_hpa: float) -> float:
    """Zenith wet delay (m) of Saastamoinen (1972)."""
    return 0.002277 * (1255.0 / temperature_k + 0.05) * vapour_pressure_hpa


@njit(cache=True)
def zenith_standard(
    latitude: float, height_m: float, relative_humidity: float
) -> tuple[float, float]:
    """Zenith hydrostatic and wet delay (m) of Saastamoinen in the standard atmosphere.

    Parameters
    ----------
    latitude : float, rad
    height_m : float, m
        Above the sea, up to 11 km.
    relative_humidity : float
        0 to 1, taken as the same at every height; 0.7 is customary.
    """
    pressure, temperature = standard_atmosphere(height_m)
    return (
        zenith_hydrostatic(pressure, latitude, height_m),
        zenith_wet(temperature, vapour_pressure(temperature, relative_humidity)),
    )


# Niell (1996), JGR 101(B2), tables 3 (hydrostatic) and 4 (wet), at 15, 30, 45, 60, 75 degrees.
_HYDROSTATIC_MEAN = (
    (1.2769934e-3, 1.2683230e-3, 1.2465397e-3, 1.2196049e-3, 1.2045996e-3),
    (2.9153695e-3, 2.9152299e-3, 2.9288445e-3, 2.9022565e-3, 2.9024912e-3),
    (62.610505e-3, 62.837393e-3, 63.721774e-3, 63.824265e-3, 64.258455e-3),
)
_HYDROSTATIC_AMPLITUDE = (
    (0.0, 1.2709626e-5, 2.6523662e-5, 3.4000452e-5, 4.1202191e-5),
    (0.0, 2.1414979e-5, 3.0160779e-5, 7.2562722e-5, 11.723375e-5),
    (0.0, 9.0128400e-5, 4.3497037e-5, 84.795348e-5, 170.37206e-5),
)
_WET = (
    (5.8021897e-4, 5.6794847e-4, 5.8118019e-4, 5.9727542e-4, 6.1641693e-4),
    (1.4275268e-3, 1.5138625e-3, 1.4572752e-3, 1.5007428e-3, 1.7599082e-3),
    (4.3472961e-2, 4.6729510e-2, 4.3908931e-2, 4.4626982e-2, 5.4736038e-2),
)
_HEIGHT = (2.53e-5, 5.49e-3, 1.14e-3)
_FIFTEEN_DEG = 15.0 * _PI / 180.0


@njit(cache=True)
def at_latitude(row: tuple[float, ...], latitude: float) -> float:
    """Linear in the absolute latitude (rad) between the columns, constant beyond them."""
    x = latitude / _FIFTEEN_DEG
    if x < 0.0:
        x = -x
    if x <= 1.0:
        return row[0]
    if x >= 5.0:
        return row[4]
    i = int(x)
    f = x - i
    return row[i - 1] * (1.0 - f) + row[i] * f


@njit(cache=True)
def continued_fraction(sin_elevation: float, a: float, b: float, c: float) -> float:
    """Mapping function of Marini, normalised to one in the zenith (Herring 1992)."""
    return (1.0 + a / (1.0 + b / (1.0 + c))) / (
        sin_elevation + a / (sin_elevation + b / (sin_elevation + c))
    )


@njit(cache=True)
def niell_hydrostatic(
    elevation: float, latitude: float, height_m: float, day_of_year: float
) -> float:
    """Hydrostatic mapping function of Niell (1996).

    Parameters
    ----------
    elevation : float, rad
        Above zero; meant for 3 degrees and more.
    latitude : float, rad
    height_m : float, m
        Above the sea.
    day_of_year : float, day
        1 at the beginning of 1 January.

    Returns
    -------
    float
        Slant over zenith delay.
    """
    year = (day_of_year - 28.0) / 365.25
    if latitude < 0.0:
        year += 0.5
    season = cos(_TWO_PI * year)
    a = at_latitude(_HYDROSTATIC_MEAN[0], latitude)
    b = at_latitude(_HYDROSTATIC_MEAN[1], latitude)
    c = at_latitude(_HYDROSTATIC_MEAN[2], latitude)
    a -= at_latitude(_HYDROSTATIC_AMPLITUDE[0], latitude) * season
    b -= at_latitude(_HYDROSTATIC_AMPLITUDE[1], latitude) * season
    c -= at_latitude(_HYDROSTATIC_AMPLITUDE[2], latitude) * season
    s = sin(elevation)
    by_height = 1.0 / s - continued_fraction(s, _HEIGHT[0], _HEIGHT[1], _HEIGHT[2])
    return continued_fraction(s, a, b, c) + by_height * height_m / 1000.0


@njit(cache=True)
def niell_wet(elevation: float, latitude: float) -> float:
    """Wet mapping function of Niell (1996): slant over zenith delay; arguments in rad."""
    return continued_fraction(
        sin(elevation),
        at_latitude(_WET[0], latitude),
        at_latitude(_WET[1], latitude),
        at_latitude(_WET[2], latitude),
    )


@njit(cache=True)
def day_of_year(time_ns: int) -> float:
    """Day of the year of a GPS time (ns since 1980-01-06), 1 at its beginning; to 2099."""
    day = time_ns // _DAY_NS
    fraction = (time_ns - day * _DAY_NS) / _DAY_NS
    in_cycle = (day + 5) % 1461  # since 1 January of a leap year
    if in_cycle >= 366:
        in_cycle = (in_cycle - 366) % 365
    return 1.0 + in_cycle + fraction
