"""Where the Sun and the Moon are, and the angles of the Earth's turn and of the tides.

Geometric positions (without light time and aberration) of the centres, in ECEF: ecliptic
coordinates of date from short series, by the obliquity and the largest terms of nutation to
the true equator, by apparent sidereal time to the turning Earth. Polar motion (1e-6 rad) is
left out. Against the IAU 2006/2000A frames, VSOP's Earth and ELP's Moon as erfa has them, from
1980 to 2060: Sun 9e-5 rad and 2e-5 of its distance, Moon 1.4e-4 rad and 6e-5 of its distance,
which moves the solid Earth tide by less than 0.1 mm.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import cos, sin, sincos
from replay.kernels.types import Array

_PI: Final = 3.141592653589793
_TWO_PI: Final = 6.283185307179586
_DEG: Final = _PI / 180.0
_ARCSEC: Final = _DEG / 3600.0
_DAY_NS: Final = 86_400_000_000_000
_J2000_DAYS: Final = 7300.5  # JD 2451545.0 since 1980-01-06
_TT_MINUS_GPS_S: Final = 51.184
_CENTURY_DAYS: Final = 36525.0

ASTRONOMICAL_UNIT_M: Final = 149_597_870_700.0

# Chapront's lunar theory ELP 2000, its largest terms as in Meeus (1998), tables 47.A and 47.B:
# multiples of D, l', l, F; longitude (1e-6 deg), distance (m).
_MOON_LONGITUDE: Final = np.array(
    [
        (0, 0, 1, 0, 6288774, -20905355), (2, 0, -1, 0, 1274027, -3699111),
        (2, 0, 0, 0, 658314, -2955968), (0, 0, 2, 0, 213618, -569925),
        (0, 1, 0, 0, -185116, 48888), (0, 0, 0, 2, -114332, -3149),
        (2, 0, -2, 0, 58793, 246158), (2, -1, -1, 0, 57066, -152138),
        (2, 0, 1, 0, 53322, -170733), (2, -1, 0, 0, 45758, -204586),
        (0, 1, -1, 0, -40923, -129620), (1, 0, 0, 0, -34720, 108743),
        (0, 1, 1, 0, -30383, 104755), (2, 0, 0, -2, 15327, 10321),
        (0, 0, 1, 2, -12528, 0), (0, 0, 1, -2, 10980, 79661),
        (4, 0, -1, 0, 10675, -34782), (0, 0, 3, 0, 10034, -23210),
        (4, 0, -2, 0, 8548, -21636), (2, 1, -1, 0, -7888, 24208),
        (2, 1, 0, 0, -6766, 30824), (1, 0, -1, 0, -5163, -8379),
        (1, 1, 0, 0, 4987, -16675), (2, -1, 1, 0, 4036, -12831),
        (2, 0, 2, 0, 3994, -10445), (4, 0, 0, 0, 3861, -11650),
        (2, 0, -3, 0, 3665, 14403), (0, 1, -2, 0, -2689, -7003),
        (2, 0, -1, 2, -2602, 0), (2, -1, -2, 0, 2390, 10056),
        (1, 0, 1, 0, -2348, 6322), (2, -2, 0, 0, 2236, -9884),
        (0, 1, 2, 0, -2120, 5751), (0, 2, 0, 0, -2069, 0),
        (2, -2, -1, 0, 2048, -4950), (2, 0, 1, -2, -1773, 4130),
        (2, 0, 0, 2, -1595, 0), (4, -1, -1, 0, 1215, -3958),
        (0, 0, 2, 2, -1110, 0),
    ],
    dtype=np.float64,
)  # fmt: skip

# The same for latitude (1e-6 deg).
_MOON_LATITUDE: Final = np.array(
    [
        (0, 0, 0, 1, 5128122), (0, 0, 1, 1, 280602), (0, 0, 1, -1, 277693),
        (2, 0, 0, -1, 173237), (2, 0, -1, 1, 55413), (2, 0, -1, -1, 46271),
        (2, 0, 0, 1, 32573), (0, 0, 2, 1, 17198), (2, 0, 1, -1, 9266),
        (0, 0, 2, -1, 8822), (2, -1, 0, -1, 8216), (2, 0, -2, -1, 4324),
        (2, 0, 1, 1, 4200), (2, 1, 0, -1, -3359), (2, -1, -1, 1, 2463),
        (2, -1, 0, 1, 2211), (2, -1, -1, -1, 2065), (0, 1, -1, -1, -1870),
        (4, 0, -1, -1, 1828), (0, 1, 0, 1, -1794), (0, 0, 0, 3, -1749),
        (0, 1, -1, 1, -1565), (1, 0, 0, 1, -1491), (0, 1, 1, 1, -1475),
        (0, 1, 1, -1, -1410), (0, 1, 0, -1, -1344), (1, 0, 0, -1, -1335),
        (0, 0, 3, 1, 1107), (4, 0, 0, -1, 1021),
    ],
    dtype=np.float64,
)  # fmt: skip
_MOON_DISTANCE_M: Final = 385_000_560.0


@njit(cache=True)
def terrestrial_centuries(time_ns: int) -> float:
    """Julian centuries of terrestrial time since J2000 of a GPS time (ns since 1980-01-06)."""
    day = time_ns // _DAY_NS
    rest = (time_ns - day * _DAY_NS) / 1e9 + _TT_MINUS_GPS_S
    return ((day - _J2000_DAYS) + rest / 86400.0) / _CENTURY_DAYS


@njit(cache=True)
def sidereal_angle(time_ns: int, ut1_minus_gps_s: float) -> float:
    """Greenwich mean sidereal time (rad, from 0 to some turns), IAU 2006.

    Earth rotation angle (IERS Conventions 2010, eq. 5.15) and accumulated precession
    (eq. 5.32).

    Parameters
    ----------
    time_ns : int, ns
        GPS time since 1980-01-06.
    ut1_minus_gps_s : float, s
        UT1 - UTC less the leap seconds since 1980 (18 from 2017 on).
    """
    day = time_ns // _DAY_NS
    of_day = ((time_ns - day * _DAY_NS) / 1e9 + ut1_minus_gps_s) / 86400.0
    since = (day - _J2000_DAYS) + of_day
    # The whole turns of the days are left out: midnight is half a turn from noon.
    turns = 0.7790572732640 + 0.5 + of_day + 0.00273781191135448 * since
    t = terrestrial_centuries(time_ns)
    precession = 0.014506 + t * (4612.156534 + t * (1.3915817 - t * 4.4e-7))
    return _TWO_PI * turns + precession * _ARCSEC


@njit(cache=True)
def delaunay_arguments(t: float) -> tuple[float, float, float, float, float]:
    """Fundamental arguments l, l', F, D, Omega (rad) (IERS Conventions 2010, eq. 5.43).

    Mean anomalies of the Moon and the Sun, argument of the Moon's latitude, elongation of the
    Moon from the Sun, longitude of the Moon's node; `t` in Julian centuries of terrestrial
    time since J2000. Not reduced to one turn.
    """
    return (
        (485868.249036 + t * (1717915923.2178 + t * (31.8792 + t * (0.051635 - t * 0.0002447))))
        * _ARCSEC,
        (1287104.793048 + t * (129596581.0481 - t * (0.5532 - t * (0.000136 - t * 0.00001149))))
        * _ARCSEC,
        (335779.526232 + t * (1739527262.8478 - t * (12.7512 + t * (0.001037 - t * 0.00000417))))
        * _ARCSEC,
        (1072260.703692 + t * (1602961601.2090 - t * (6.3706 - t * (0.006593 - t * 0.00003169))))
        * _ARCSEC,
        (450160.398036 - t * (6962890.5431 - t * (7.4722 + t * (0.007702 - t * 0.00005939))))
        * _ARCSEC,
    )


@njit(cache=True)
def sun_of_date(t: float) -> tuple[float, float]:
    """Sun's longitude (rad, mean equinox of date, geometric) and distance (m).

    Meeus (1998), ch. 25, with the perturbations by Venus, Jupiter and the Moon of his
    Astronomical Formulae (1988), ch. 18. The latitude, below 1.3", is left out.

    Parameters
    ----------
    t : float
        Julian centuries of terrestrial time since J2000.
    """
    mean = 280.46646 + t * (36000.76983 + t * 0.0003032)
    anomaly = (357.52911 + t * (35999.05029 - t * 0.0001537)) * _DEG
    e = 0.016708634 - t * (0.000042037 + t * 0.0000001267)
    s1, c1 = sincos(anomaly)
    s2 = 2.0 * s1 * c1
    s3 = s1 * (3.0 - 4.0 * s1 * s1)
    centre = (
        (1.914602 - t * (0.004817 + t * 0.000014)) * s1
        + (0.019993 - t * 0.000101) * s2
        + 0.000289 * s3
    )
    u = t + 1.0  # the perturbations count from 1900
    sin_a, cos_a = sincos((153.23 + 22518.7541 * u) * _DEG)
    sin_b, cos_b = sincos((216.57 + 45037.5082 * u) * _DEG)
    sin_c, cos_c = sincos((312.69 + 32964.3577 * u) * _DEG)
    sin_d, cos_d = sincos((350.74 + u * (445267.1142 - u * 0.00144)) * _DEG)
    longitude = (
        mean
        + centre
        + 0.00134 * cos_a
        + 0.00154 * cos_b
        + 0.00200 * cos_c
        + 0.00179 * sin_d
        + 0.00178 * sin((231.19 + 20.20 * u) * _DEG)
    ) * _DEG
    distance = 1.000001018 * (1.0 - e * e) / (1.0 + e * cos(anomaly + centre * _DEG))
    distance += 1e-8 * (
        543.0 * sin_a
        + 1575.0 * sin_b
        + 1627.0 * sin_c
        + 3076.0 * cos_d
        + 927.0 * sin((353.40 + 65928.7155 * u) * _DEG)
    )
    return longitude, distance * ASTRONOMICAL_UNIT_M


@njit(cache=True)
def moon_of_date(
    t: float, l: float, lp: float, F: float, D: float, node: float  # noqa: E741
) -> tuple[float, float, float]:  # fmt: skip
    """Moon's longitude and latitude (rad, mean ecliptic and equinox of date), distance (m).

    Chapront's ELP 2000, the largest terms, as in Meeus (1998), ch. 47.

    Parameters
    ----------
    t : float
        Julian centuries of terrestrial time since J2000.
    l, lp, F, D, node : float, rad
        Of :func:`delaunay_arguments`.
    """
    mean = F + node
    e = 1.0 - t * (0.002516 + t * 0.0000074)
    longitude = distance = latitude = 0.0
    for k in range(_MOON_LONGITUDE.shape[0]):
        row = _MOON_LONGITUDE[k]
        s, c = sincos(row[0] * D + row[1] * lp + row[2] * l + row[3] * F)
        scale = 1.0
        for _ in range(int(abs(row[1]))):
            scale *= e
        longitude += row[4] * scale * s
        distance += row[5] * scale * c
    for k in range(_MOON_LATITUDE.shape[0]):
        row = _MOON_LATITUDE[k]
        s = sin(row[0] * D + row[1] * lp + row[2] * l + row[3] * F)
        latitude += row[4] * (e if row[1] != 0.0 else 1.0) * s
    a1 = (119.75 + 131.849 * t) * _DEG
    a2 = (53.09 + 479264.290 * t) * _DEG
    a3 = (313.45 + 481266.484 * t) * _DEG
    longitude += 3958.0 * sin(a1) + 1962.0 * sin(mean - F) + 318.0 * sin(a2)
    latitude += (
        -2235.0 * sin(mean)
        + 382.0 * sin(a3)
        + 175.0 * (sin(a1 - F) + sin(a1 + F))
        + 127.0 * sin(mean - l)
        - 115.0 * sin(mean + l)
    )
    return (
        mean + longitude * 1e-6 * _DEG,
        latitude * 1e-6 * _DEG,
        _MOON_DISTANCE_M + distance,
    )


@njit(cache=True)
def _place(
    longitude: float, latitude: float, distance: float, sin_e: float, cos_e: float,
    sin_g: float, cos_g: float, out: Array,
) -> None:  # fmt: skip
    """From the true ecliptic of date to ECEF, by obliquity and apparent sidereal time."""
    sin_lon, cos_lon = sincos(longitude)
    sin_lat, cos_lat = sincos(latitude)
    x = distance * cos_lat * cos_lon
    y = distance * cos_lat * sin_lon
    z = distance * sin_lat
    across = cos_e * y - sin_e * z
    out[0] = cos_g * x + sin_g * across
    out[1] = cos_g * across - sin_g * x
    out[2] = sin_e * y + cos_e * z


@njit(cache=True)
def sun_moon_ecef(time_ns: int, ut1_minus_gps_s: float, sun: Array, moon: Array) -> float:
    """Geocentric positions of Sun and Moon.

    Parameters
    ----------
    time_ns : int, ns
        GPS time since 1980-01-06.
    ut1_minus_gps_s : float, s
        UT1 - UTC less the leap seconds since 1980; an error of a second is 7e-5 rad.
    sun, moon : float64 arrays (3,), m, ECEF
        Written.

    Returns
    -------
    float, rad
        Greenwich mean sidereal time.
    """
    t = terrestrial_centuries(time_ns)
    l, lp, F, D, node = delaunay_arguments(t)  # noqa: E741
    sun_longitude, sun_distance = sun_of_date(t)
    moon_longitude, moon_latitude, moon_distance = moon_of_date(t, l, lp, F, D, node)
    # The largest terms of nutation (IERS Conventions 2010, table 5.3), to 0.1".
    sin_node, cos_node = sincos(node)
    sin_sun, cos_sun = sincos(2.0 * (F - D + node))
    sin_moon, cos_moon = sincos(2.0 * (F + node))
    in_longitude = (
        -17.2064 * sin_node
        - 1.3171 * sin_sun
        - 0.2276 * sin_moon
        + 0.4149 * sin_node * cos_node  # 0.2075 sin 2 Omega
        + 0.1476 * sin(lp)
        + 0.0711 * sin(l)
    ) * _ARCSEC
    obliquity = (
        84381.406
        - t * (46.836769 + t * 0.0001831)
        + 9.2052 * cos_node
        + 0.5730 * cos_sun
        + 0.0978 * cos_moon
        - 0.0897 * (2.0 * cos_node * cos_node - 1.0)
    ) * _ARCSEC
    sidereal = sidereal_angle(time_ns, ut1_minus_gps_s)
    sin_e, cos_e = sincos(obliquity)
    sin_g, cos_g = sincos(sidereal + in_longitude * cos_e)
    _place(sun_longitude + in_longitude, 0.0, sun_distance, sin_e, cos_e, sin_g, cos_g, sun)
    _place(
        moon_longitude + in_longitude, moon_latitude, moon_distance, sin_e, cos_e, sin_g, cos_g,
        moon,
    )  # fmt: skip
    return sidereal
