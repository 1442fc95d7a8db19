"""Displacements of a station: solid Earth tide, pole tide, loading by the ocean's tides.

Solid Earth tide: IERS Conventions (2010), section 7.1.1, with the theory of Mathews, Dehant,
Gipson (1997), J. Geophys. Res. 102(B9). The whole tide of degrees 2 and 3 is taken, its
constant part with the nominal Love numbers too: what is left after it is subtracted is a
position of the conventional tide-free system, that of the ITRF. :func:`permanent_tide` is what
brings it to the mean-tide system. Written from the text, not from the routine DEHANTTIDEINEL
that the IERS distribute; the corrections by frequency are the lines of tables 7.3 that it uses.
It adds the general precession to the Moon's mean longitude of date, the text does not: 0.03 mm.

All displacements are those of the crust: station = its conventional position + displacement.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import sincos, sqrt
from replay.kernels.sun_moon import (
    delaunay_arguments,
    sidereal_angle,
    sun_moon_ecef,
    terrestrial_centuries,
)
from replay.kernels.types import Array

_PI: Final = 3.141592653589793
_HALF_PI: Final = 1.5707963267948966
_DAY_NS: Final = 86_400_000_000_000
_J2000_NS: Final = 630_763_148_816_000_000  # GPS time of 2000-01-01 12:00 TT
_YEAR_NS: Final = 365.25 * 86400e9

_EARTH_M: Final = 6378136.6
_SUN_MASS: Final = 332946.0482  # of the Earth's
_MOON_MASS: Final = 0.0123000371
_H2: Final = 0.6078  # IERS Conventions (2010), table 7.2
_L2: Final = 0.0847
_H3: Final = 0.292
_L3: Final = 0.015
_H2_LATITUDE: Final = -0.0006
_L2_LATITUDE: Final = 0.0002
_H_DIURNAL_OUT: Final = -0.0025  # imaginary part, eq. 7.10
_L_DIURNAL_OUT: Final = -0.0007
_H_SEMIDIURNAL_OUT: Final = -0.0022  # eq. 7.11
_L_SEMIDIURNAL_OUT: Final = -0.0007
_L1_DIURNAL: Final = 0.0012  # eq. 7.8
_L1_SEMIDIURNAL: Final = 0.0024  # eq. 7.9
_PERMANENT_M: Final = -0.31460  # amplitude of the constant part in the potential, over g
_NORM_20: Final = 0.6307831305050401  # sqrt(5 / (4 pi))

# Multiples of s, h, p, N', ps beside one tau; radial in and out of phase, transverse in and out
# of phase, mm: IERS Conventions (2010), table 7.3a, to 0.01 mm.
_DIURNAL: Final = np.array(
    [
        (-3, 0, 2, 0, 0, -0.01, 0.0, 0.0, 0.0), (-3, 2, 0, 0, 0, -0.01, 0.0, 0.0, 0.0),
        (-2, 0, 1, -1, 0, -0.02, 0.0, 0.0, 0.0), (-2, 0, 1, 0, 0, -0.08, 0.0, -0.01, 0.01),
        (-2, 2, -1, 0, 0, -0.02, 0.0, 0.0, 0.0), (-1, 0, 0, -1, 0, -0.10, 0.0, 0.0, 0.0),
        (-1, 0, 0, 0, 0, -0.51, 0.0, -0.02, 0.03), (-1, 2, 0, 0, 0, 0.01, 0.0, 0.0, 0.0),
        (0, -2, 1, 0, 0, 0.01, 0.0, 0.0, 0.0), (0, 0, -1, 0, 0, 0.02, 0.0, 0.0, 0.0),
        (0, 0, 1, 0, 0, 0.06, 0.0, 0.0, 0.0), (0, 0, 1, 1, 0, 0.01, 0.0, 0.0, 0.0),
        (0, 2, -1, 0, 0, 0.01, 0.0, 0.0, 0.0), (1, -3, 0, 0, 1, -0.06, 0.0, 0.0, 0.0),
        (1, -2, 0, -1, 0, 0.01, 0.0, 0.0, 0.0), (1, -2, 0, 0, 0, -1.23, -0.07, 0.06, 0.01),
        (1, -1, 0, 0, -1, 0.02, 0.0, 0.0, 0.0), (1, -1, 0, 0, 1, 0.04, 0.0, 0.0, 0.0),
        (1, 0, 0, -1, 0, -0.22, 0.01, 0.01, 0.0), (1, 0, 0, 0, 0, 12.00, -0.80, -0.67, -0.03),
        (1, 0, 0, 1, 0, 1.73, -0.12, -0.10, 0.0), (1, 0, 0, 2, 0, -0.04, 0.0, 0.0, 0.0),
        (1, 1, 0, 0, -1, -0.50, -0.01, 0.03, 0.0), (1, 1, 0, 0, 1, 0.01, 0.0, 0.0, 0.0),
        (0, 1, 0, 1, -1, -0.01, 0.0, 0.0, 0.0), (1, 2, -2, 0, 0, -0.01, 0.0, 0.0, 0.0),
        (1, 2, 0, 0, 0, -0.11, 0.01, 0.01, 0.0), (2, -2, 1, 0, 0, -0.01, 0.0, 0.0, 0.0),
        (2, 0, -1, 0, 0, -0.02, 0.0, 0.0, 0.0),
    ]
)  # fmt: skip

# The same without tau: table 7.3b.
_LONG_PERIOD: Final = np.array(
    [
        (0, 0, 0, 1, 0, 0.47, 0.16, 0.23, 0.07),
        (0, 2, 0, 0, 0, -0.20, -0.11, -0.12, -0.05),
        (1, 0, -1, 0, 0, -0.11, -0.09, -0.08, -0.04),
        (2, 0, 0, 0, 0, -0.13, -0.15, -0.11, -0.07),
        (2, 0, 0, 1, 0, -0.05, -0.06, -0.05, -0.03),
    ]
)

# M2, S2, N2, K2, K1, O1, P1, Q1, Mf, Mm, Ssa, as in a file of ocean loading: multiples of tau, s,
# h, p and the quarters of a turn by Schwiderski's phases (IERS Conventions 2010, section 7.1.2).
OCEAN_TIDES: Final = 11
_OCEAN: Final = np.array(
    [
        (2, 0, 0, 0, 0), (2, 2, -2, 0, 0), (2, -1, 0, 1, 0), (2, 2, 0, 0, 0),
        (1, 1, 0, 0, 1), (1, -1, 0, 0, -1), (1, 1, -2, 0, -1), (1, -2, 0, 1, -1),
        (0, 2, 0, 0, 0), (0, 1, 0, -1, 0), (0, 0, 2, 0, 0),
    ],
    dtype=np.float64,
)  # fmt: skip


@njit(cache=True)
def doodson_arguments(
    time_ns: int, ut1_minus_gps_s: float
) -> tuple[float, float, float, float, float, float]:
    """Doodson's arguments tau, s, h, p, N', ps in rad (IERS Conventions 2010, eq. 6.8 and 5.43).

    Parameters
    ----------
    time_ns : int, ns
        GPS time since 1980-01-06.
    ut1_minus_gps_s : float, s
    """
    l, lp, F, D, node = delaunay_arguments(terrestrial_centuries(time_ns))  # noqa: E741
    s = F + node
    tau = sidereal_angle(time_ns, ut1_minus_gps_s) + _PI - s
    return tau, s, s - D, s - l, -node, s - D - lp


@njit(cache=True)
def _spherical(x: Array) -> tuple[float, float, float, float, float]:
    """Sine and cosine of geocentric latitude and longitude, distance (m)."""
    p = sqrt(x[0] * x[0] + x[1] * x[1])
    r = sqrt(p * p + x[2] * x[2])
    if p > 0.0:
        return x[2] / r, p / r, x[1] / p, x[0] / p, r
    return x[2] / r, 0.0, 0.0, 1.0, r


@njit(cache=True)
def _step1(
    x: Array, place: tuple[float, float, float, float, float], body: Array, mass: float, out: Array
) -> tuple[float, float, float]:
    """Tide of one body in the time domain (section 7.1.1.1).

    What is in phase is added to `out` (ECEF); the corrections out of phase and by latitude
    are given to the east, to the (geocentric) north and radially.
    """
    sin_phi, cos_phi, sin_lon, cos_lon, r = place
    sin_b, cos_b, sin_body, cos_body, distance = _spherical(body)
    ratio = _EARTH_M / distance
    k2 = mass * _EARTH_M * ratio * ratio * ratio
    k3 = k2 * ratio
    c = (x[0] * body[0] + x[1] * body[1] + x[2] * body[2]) / (r * distance)
    p2 = 1.5 * sin_phi * sin_phi - 0.5
    h2 = _H2 + _H2_LATITUDE * p2
    l2 = _L2 + _L2_LATITUDE * p2
    # eq. 7.5 and 7.6
    towards = 3.0 * k2 * l2 * c + k3 * _L3 * (7.5 * c * c - 1.5)
    upwards = k2 * h2 * (1.5 * c * c - 0.5) + k3 * _H3 * (2.5 * c * c - 1.5) * c - towards * c
    for i in range(3):
        out[i] += towards * body[i] / distance + upwards * x[i] / r
    # Sines and cosines of once and twice the difference of the longitudes.
    s1 = sin_lon * cos_body - cos_lon * sin_body
    c1 = cos_lon * cos_body + sin_lon * sin_body
    s2, c2 = 2.0 * s1 * c1, c1 * c1 - s1 * s1
    diurnal = k2 * 2.0 * sin_b * cos_b
    semidiurnal = k2 * cos_b * cos_b
    cos_2phi = cos_phi * cos_phi - sin_phi * sin_phi
    up = -0.75 * _H_DIURNAL_OUT * diurnal * 2.0 * sin_phi * cos_phi * s1
    up -= 0.75 * _H_SEMIDIURNAL_OUT * semidiurnal * cos_phi * cos_phi * s2
    north = -1.5 * _L_DIURNAL_OUT * diurnal * cos_2phi * s1
    north += 1.5 * _L_SEMIDIURNAL_OUT * semidiurnal * sin_phi * cos_phi * s2
    east = -1.5 * _L_DIURNAL_OUT * diurnal * sin_phi * c1
    east -= 1.5 * _L_SEMIDIURNAL_OUT * semidiurnal * cos_phi * c2
    north -= 1.5 * _L1_DIURNAL * diurnal * sin_phi * sin_phi * c1
    east += 1.5 * _L1_DIURNAL * diurnal * sin_phi * cos_2phi * s1
    north -= 1.5 * _L1_SEMIDIURNAL * semidiurnal * sin_phi * cos_phi * c2
    east -= 1.5 * _L1_SEMIDIURNAL * semidiurnal * sin_phi * sin_phi * cos_phi * s2
    return east, north, up


@njit(cache=True)
def _step2(
    place: tuple[float, float, float, float, float],
    arguments: tuple[float, float, float, float, float, float],
) -> tuple[float, float, float]:
    """Corrections by frequency (section 7.1.1.2): east, geocentric north, radial, m."""
    sin_phi, cos_phi, sin_lon, cos_lon, _ = place
    tau, s, h, p, n, ps = arguments
    east = north = up = 0.0
    cos_2phi = cos_phi * cos_phi - sin_phi * sin_phi
    sin_2phi = 2.0 * sin_phi * cos_phi
    for k in range(_DIURNAL.shape[0]):
        row = _DIURNAL[k]
        angle = tau + row[0] * s + row[1] * h + row[2] * p + row[3] * n + row[4] * ps
        sine, cosine = sincos(angle)
        sin_at = sine * cos_lon + cosine * sin_lon
        cos_at = cosine * cos_lon - sine * sin_lon
        up += (row[5] * sin_at + row[6] * cos_at) * sin_2phi  # eq. 7.12
        east += (row[7] * cos_at - row[8] * sin_at) * sin_phi
        north += (row[7] * sin_at + row[8] * cos_at) * cos_2phi
    zonal = 1.5 * sin_phi * sin_phi - 0.5
    for k in range(_LONG_PERIOD.shape[0]):
        row = _LONG_PERIOD[k]
        angle = row[0] * s + row[1] * h + row[2] * p + row[3] * n + row[4] * ps
        sine, cosine = sincos(angle)
        up += (row[5] * cosine + row[6] * sine) * zonal  # eq. 7.13
        north += (row[7] * cosine + row[8] * sine) * sin_2phi
    return 1e-3 * east, 1e-3 * north, 1e-3 * up


@njit(cache=True)
def _add_local(
    place: tuple[float, float, float, float, float], east: float, north: float, up: float,
    out: Array,
) -> None:  # fmt: skip
    """Add a displacement in spherical directions to one in ECEF."""
    sin_phi, cos_phi, sin_lon, cos_lon, _ = place
    level = up * cos_phi - north * sin_phi
    out[0] += level * cos_lon - east * sin_lon
    out[1] += level * sin_lon + east * cos_lon
    out[2] += up * sin_phi + north * cos_phi


@njit(cache=True)
def solid_tide_of(
    x: Array, time_ns: int, ut1_minus_gps_s: float, sun: Array, moon: Array, out: Array
) -> None:
    """Solid Earth tide with positions of Sun and Moon that are given.

    Parameters
    ----------
    x : float64 array (3,), m, ECEF
    time_ns, ut1_minus_gps_s : int, ns and float, s
        As of :func:`replay.kernels.sun_moon.sun_moon_ecef`.
    sun, moon : float64 arrays (3,), m, ECEF
    out : float64 array (3,), m, ECEF
        Written.
    """
    place = _spherical(x)
    for i in range(3):
        out[i] = 0.0
    e1, n1, u1 = _step1(x, place, sun, _SUN_MASS, out)
    e2, n2, u2 = _step1(x, place, moon, _MOON_MASS, out)
    e3, n3, u3 = _step2(place, doodson_arguments(time_ns, ut1_minus_gps_s))
    _add_local(place, e1 + e2 + e3, n1 + n2 + n3, u1 + u2 + u3, out)


@njit(cache=True)
def solid_tide(x: Array, time_ns: int, ut1_minus_gps_s: float, out: Array) -> None:
    """Solid Earth tide (m, ECEF) of a station `x` (m, ECEF); see :func:`solid_tide_of`."""
    bodies = np.empty((2, 3))
    sun_moon_ecef(time_ns, ut1_minus_gps_s, bodies[0], bodies[1])
    solid_tide_of(x, time_ns, ut1_minus_gps_s, bodies[0], bodies[1], out)


@njit(cache=True)
def permanent_tide(x: Array, out: Array) -> None:
    """Constant part of the solid tide: mean-tide less conventional tide-free position.

    IERS Conventions (2010), eq. 7.14, with the nominal Love numbers.

    Parameters
    ----------
    x : float64 array (3,), m, ECEF
    out : float64 array (3,), m, ECEF
        Written.
    """
    place = _spherical(x)
    sin_phi, cos_phi = place[0], place[1]
    p2 = 1.5 * sin_phi * sin_phi - 0.5
    scale = _NORM_20 * _PERMANENT_M
    for i in range(3):
        out[i] = 0.0
    up = scale * (_H2 + _H2_LATITUDE * p2) * p2
    north = scale * (_L2 + _L2_LATITUDE * p2) * 3.0 * sin_phi * cos_phi
    _add_local(place, 0.0, north, up, out)


@njit(cache=True)
def secular_pole(time_ns: int) -> tuple[float, float]:
    """Secular pole xs, ys (arcsec) of the IERS Conventions (2010) as revised in 2018, eq. 21.

    Parameters
    ----------
    time_ns : int, ns
        GPS time since 1980-01-06.
    """
    years = (time_ns - _J2000_NS) / _YEAR_NS
    return 1e-3 * (55.0 + 1.677 * years), 1e-3 * (320.5 + 3.460 * years)


@njit(cache=True)
def pole_tide(x: Array, m1: float, m2: float, out: Array) -> None:
    """Displacement by the pole's motion (IERS Conventions 2010, eq. 7.26).

    Parameters
    ----------
    x : float64 array (3,), m, ECEF
    m1, m2 : float, arcsec
        x_p - x_s and -(y_p - y_s) (eq. 7.24): the pole less :func:`secular_pole`.
    out : float64 array (3,), m, ECEF
        Written.
    """
    place = _spherical(x)
    sin_phi, cos_phi, sin_lon, cos_lon, _ = place
    along = m1 * cos_lon + m2 * sin_lon
    across = m1 * sin_lon - m2 * cos_lon
    for i in range(3):
        out[i] = 0.0
    up = -0.033 * 2.0 * sin_phi * cos_phi * along
    # The colatitude's cosine of twice itself is that of the latitude with the other sign.
    north = -0.009 * (cos_phi * cos_phi - sin_phi * sin_phi) * along
    _add_local(place, 0.009 * sin_phi * across, north, up, out)


@njit(cache=True)
def ocean_arguments(time_ns: int, ut1_minus_gps_s: float, out: Array) -> None:
    """Arguments of the 11 main tides (rad) with Schwiderski's phases, into `out` (11,).

    They are those of the routine ARG2 of the IERS Conventions (2010) to 3e-4 rad: it has
    rounded rates and the Sun's mean longitude with aberration.
    """
    tau, s, h, p, _, _ = doodson_arguments(time_ns, ut1_minus_gps_s)
    for k in range(OCEAN_TIDES):
        row = _OCEAN[k]
        out[k] = row[0] * tau + row[1] * s + row[2] * h + row[3] * p + row[4] * _HALF_PI


@njit(cache=True)
def ocean_loading(arguments: Array, amplitudes: Array, phases: Array) -> tuple[float, float, float]:
    """Displacement by the load of the ocean's tides (IERS Conventions 2010, eq. 7.15).

    The 11 main tides alone, without their companions and without modulation by the node,
    which leaves some per cent of the loading.

    Parameters
    ----------
    arguments : float64 array (11,), rad
        Of :func:`ocean_arguments`.
    amplitudes : float64 array (3, 11), m
        Rows radial, west, south as in a BLQ file; columns M2, S2, N2, K2, K1, O1, P1, Q1, Mf,
        Mm, Ssa.
    phases : float64 array (3, 11), rad
        Lags at Greenwich, positive as in a BLQ file.

    Returns
    -------
    east, north, up : float, m
    """
    radial = west = south = 0.0
    for k in range(OCEAN_TIDES):
        _, c = sincos(arguments[k] - phases[0, k])
        radial += amplitudes[0, k] * c
        _, c = sincos(arguments[k] - phases[1, k])
        west += amplitudes[1, k] * c
        _, c = sincos(arguments[k] - phases[2, k])
        south += amplitudes[2, k] * c
    return -west, -south, radial
