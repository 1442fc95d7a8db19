"""The Earth of WGS-84: size, spin, gravity and local axes, without trigonometry.

Gravity is that of the normal field: zonal harmonics J2 to J8 of the level
ellipsoid, which agree with Somigliana's closed formula on the surface to better
than 1e-9 m/s^2, plus the centrifugal term, in ECEF components.
"""

from numba import njit

from replay.kernels.elementary import atan2, sqrt
from replay.kernels.types import Array

SEMI_MAJOR_AXIS_M = 6378137.0  # NIMA TR8350.2, table 3.1
FLATTENING = 1.0 / 298.257223563  # NIMA TR8350.2, table 3.1
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)
SEMI_MINOR_AXIS_M = SEMI_MAJOR_AXIS_M * (1.0 - FLATTENING)
SECOND_ECCENTRICITY_SQUARED = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)
EARTH_RATE_RAD_S = 7.292115e-5  # NIMA TR8350.2, table 3.1
GRAVITATIONAL_CONSTANT_M3_S2 = 3.986004418e14  # NIMA TR8350.2, table 3.1

# Even zonal harmonics of the level ellipsoid (Heiskanen and Moritz 1967, eq. 2-92), from
# J2 = 1.082629821e-3, the value that belongs to the four defining constants above.
_J2 = 1.0826298213129219e-3
_E4 = ECCENTRICITY_SQUARED * ECCENTRICITY_SQUARED
_R = 5.0 * _J2 / ECCENTRICITY_SQUARED
_J4 = -3.0 * _E4 / 35.0 * (1.0 - 2.0 + 2.0 * _R)
_J6 = 3.0 * _E4 * ECCENTRICITY_SQUARED / 63.0 * (1.0 - 3.0 + 3.0 * _R)
_J8 = -3.0 * _E4 * _E4 / 99.0 * (1.0 - 4.0 + 4.0 * _R)


@njit(cache=True)
def gravitation(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Normal gravitation (no centrifugal part) at an ECEF position.

    Parameters
    ----------
    x, y, z : float, m
        ECEF position, not the Earth's centre.

    Returns
    -------
    tuple of three floats, m/s^2, ECEF
    """
    r2 = x * x + y * y + z * z
    r = sqrt(r2)
    s = z / r
    q = SEMI_MAJOR_AXIS_M * SEMI_MAJOR_AXIS_M / r2
    # Legendre polynomials by their recursion; derivatives by P'(n+1) = P'(n-1) + (2n+1) P(n).
    p1 = s
    p2 = 1.5 * s * s - 0.5
    p3 = (5.0 * s * p2 - 2.0 * p1) / 3.0
    p4 = (7.0 * s * p3 - 3.0 * p2) / 4.0
    p5 = (9.0 * s * p4 - 4.0 * p3) / 5.0
    p6 = (11.0 * s * p5 - 5.0 * p4) / 6.0
    p7 = (13.0 * s * p6 - 6.0 * p5) / 7.0
    p8 = (15.0 * s * p7 - 7.0 * p6) / 8.0
    d2 = 3.0 * s
    d3 = 1.0 + 5.0 * p2
    d4 = d2 + 7.0 * p3
    d5 = d3 + 9.0 * p4
    d6 = d4 + 11.0 * p5
    d7 = d5 + 13.0 * p6
    d8 = d6 + 15.0 * p7
    d9 = d7 + 17.0 * p8
    radial = 1.0 - q * (_J2 * d3 + q * (_J4 * d5 + q * (_J6 * d7 + q * (_J8 * d9))))
    polar = q * (_J2 * d2 + q * (_J4 * d4 + q * (_J6 * d6 + q * (_J8 * d8))))
    k = -GRAVITATIONAL_CONSTANT_M3_S2 / (r2 * r)
    return k * x * radial, k * y * radial, k * (z * radial + r * polar)


@njit(cache=True)
def gravity(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Normal gravity: gravitation and the centrifugal acceleration (Groves 2e, eq. 2.133).

    Parameters
    ----------
    x, y, z : float, m
        ECEF position.

    Returns
    -------
    tuple of three floats, m/s^2, ECEF
    """
    gx, gy, gz = gravitation(x, y, z)
    w2 = EARTH_RATE_RAD_S * EARTH_RATE_RAD_S
    return gx + w2 * x, gy + w2 * y, gz


@njit(cache=True)
def surface_normal(x: float, y: float, z: float) -> tuple[float, float, float, float, float]:
    """Sines and cosines of geodetic latitude and longitude, and the height.

    Bowring's iteration (1976) on the tangent of the reduced latitude, with square
    roots only; three rounds leave less than 1e-15 rad from the centre's
    neighbourhood up to satellite heights.

    Parameters
    ----------
    x, y, z : float, m
        ECEF position.

    Returns
    -------
    sin_latitude, cos_latitude, sin_longitude, cos_longitude : float
    height : float, m
        Above the ellipsoid.
    """
    p = sqrt(x * x + y * y)
    if p > 0.0:
        sin_lon = y / p
        cos_lon = x / p
    else:
        sin_lon = 0.0
        cos_lon = 1.0
    # (sb, cb): sine and cosine of the reduced latitude, up to a common factor.
    sb = SEMI_MAJOR_AXIS_M * z
    cb = SEMI_MINOR_AXIS_M * p
    sin_lat = 0.0
    cos_lat = 1.0
    for _ in range(3):
        h = sqrt(sb * sb + cb * cb)
        sb /= h
        cb /= h
        sl = z + SECOND_ECCENTRICITY_SQUARED * SEMI_MINOR_AXIS_M * sb * sb * sb
        cl = p - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS_M * cb * cb * cb
        h = sqrt(sl * sl + cl * cl)
        sin_lat = sl / h
        cos_lat = cl / h
        sb = (1.0 - FLATTENING) * sin_lat
        cb = cos_lat
    n = SEMI_MAJOR_AXIS_M / sqrt(1.0 - ECCENTRICITY_SQUARED * sin_lat * sin_lat)
    # Projection on the normal: well conditioned at the equator and at the poles alike.
    height = p * cos_lat + z * sin_lat - n * (1.0 - ECCENTRICITY_SQUARED * sin_lat * sin_lat)
    return sin_lat, cos_lat, sin_lon, cos_lon, height


@njit(cache=True)
def geodetic(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Geodetic latitude, longitude (rad) and ellipsoidal height (m) of an ECEF position (m)."""
    sin_lat, cos_lat, sin_lon, cos_lon, height = surface_normal(x, y, z)
    return atan2(sin_lat, cos_lat), atan2(sin_lon, cos_lon), height


@njit(cache=True)
def enu_axes(x: float, y: float, z: float, out: Array) -> None:
    """Rows of `out` (3, 3) become the east, north and up unit vectors in ECEF: C_e_l."""
    sin_lat, cos_lat, sin_lon, cos_lon, _ = surface_normal(x, y, z)
    out[0, 0] = -sin_lon
    out[0, 1] = cos_lon
    out[0, 2] = 0.0
    out[1, 0] = -sin_lat * cos_lon
    out[1, 1] = -sin_lat * sin_lon
    out[1, 2] = cos_lat
    out[2, 0] = cos_lat * cos_lon
    out[2, 1] = cos_lat * sin_lon
    out[2, 2] = sin_lat


@njit(cache=True)
def local_covariance(axes: Array, P: Array, out: Array) -> None:
    """Upper triangle of `axes` P `axes`', P being the leading 3 by 3 block.

    Parameters
    ----------
    axes : float64 array (3, 3)
        As :func:`enu_axes` fills them.
    P : float64 array, ECEF
    out : float64 array (6,), east, north, up
        Filled, row after row.
    """
    place = 0
    for a in range(3):
        for b in range(a, 3):
            total = 0.0
            for i in range(3):
                for j in range(3):
                    total += axes[a, i] * P[i, j] * axes[b, j]
            out[place] = total
            place += 1


@njit(cache=True)
def ecef_from_geodetic(
    sin_lat: float, cos_lat: float, sin_lon: float, cos_lon: float, height: float
) -> tuple[float, float, float]:
    """ECEF position (m) from sines and cosines of geodetic coordinates and the height (m)."""
    n = SEMI_MAJOR_AXIS_M / sqrt(1.0 - ECCENTRICITY_SQUARED * sin_lat * sin_lat)
    return (
        (n + height) * cos_lat * cos_lon,
        (n + height) * cos_lat * sin_lon,
        (n * (1.0 - ECCENTRICITY_SQUARED) + height) * sin_lat,
    )
