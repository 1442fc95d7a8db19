"""What is seen from a receiver: range, line of sight, elevation, azimuth, dilution."""

from numba import njit

from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.elementary import atan2, sqrt
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.rotation import rotate3
from replay.kernels.types import Array

_TWO_PI = 6.283185307179586


@njit(cache=True)
def line_of_sight(
    x: float, y: float, z: float, sx: float, sy: float, sz: float
) -> tuple[float, float, float, float]:
    """Distance (m) and unit vector from the receiver to the satellite.

    Parameters
    ----------
    x, y, z : float, m
        Receiver, ECEF.
    sx, sy, sz : float, m
        Satellite, the same axes. With ECEF at reception the distance is the geometric
        range; with ECEF at transmission :func:`sagnac` is to be added.

    Returns
    -------
    tuple of four floats: distance, three components
    """
    dx = sx - x
    dy = sy - y
    dz = sz - z
    r = sqrt(dx * dx + dy * dy + dz * dz)
    return r, dx / r, dy / r, dz / r


@njit(cache=True)
def sagnac(x: float, y: float, sx: float, sy: float) -> float:
    """Closed form of the Sagnac effect on a range, to first order in the Earth's rate.

    Adding it to the distance between the receiver (x, y) in ECEF at reception and the
    satellite (sx, sy) in ECEF at transmission (m) leaves less than 1 mm.
    """
    return EARTH_RATE_RAD_S * (sx * y - sy * x) / SPEED_OF_LIGHT_M_S


@njit(cache=True)
def elevation_azimuth(axes: Array, ux: float, uy: float, uz: float) -> tuple[float, float]:
    """Elevation and azimuth of a direction.

    Parameters
    ----------
    axes : array (3, 3)
        Rows east, north, up in ECEF, as of :func:`replay.kernels.earth.enu_axes`.
    ux, uy, uz : float
        Direction from the receiver, ECEF, of any length.

    Returns
    -------
    elevation : float, rad
    azimuth : float, rad
        Clockwise from true north, in [0, 2 pi); 0 in the zenith.
    """
    east, north, up = rotate3(axes, ux, uy, uz)
    level = sqrt(east * east + north * north)
    azimuth = atan2(east, north)
    if azimuth < 0.0:
        azimuth += _TWO_PI
        if azimuth >= _TWO_PI:
            azimuth = 0.0
    return atan2(up, level), azimuth


@njit(cache=True)
def design_row(axes: Array, ux: float, uy: float, uz: float, clock: int, row: Array) -> None:
    """Row of the design matrix of :func:`dilution`: minus the line of sight in ENU, clocks.

    Parameters
    ----------
    axes : array (3, 3)
        Rows east, north, up in ECEF.
    ux, uy, uz : float
        Unit vector to the satellite, ECEF.
    clock : int
        Which of the receiver's clocks, 0 and on.
    row : array (k,)
        Filled; k is three and the number of clocks.
    """
    for i in range(row.shape[0]):
        row[i] = 0.0
    east, north, up = rotate3(axes, ux, uy, uz)
    row[0] = -east
    row[1] = -north
    row[2] = -up
    row[3 + clock] = 1.0


@njit(cache=True)
def invert_positive(A: Array) -> bool:
    """Inverse in place of a symmetric positive definite matrix (k, k), by Cholesky.

    Returns
    -------
    bool
        False if it is not positive definite, or singular within 1e-12 of a diagonal
        element; `A` is then spoilt.
    """
    k = A.shape[0]
    for j in range(k):
        diagonal = A[j, j]
        d = diagonal
        for m in range(j):
            d -= A[j, m] * A[j, m]
        if not d > 1e-12 * diagonal:
            return False
        root = sqrt(d)
        A[j, j] = root
        for i in range(j + 1, k):
            s = A[i, j]
            for m in range(j):
                s -= A[i, m] * A[j, m]
            A[i, j] = s / root
    # The lower triangle becomes the inverse of the factor, column by column.
    for j in range(k):
        A[j, j] = 1.0 / A[j, j]
        for i in range(j + 1, k):
            s = 0.0
            for m in range(j, i):
                s -= A[i, m] * A[m, j]
            A[i, j] = s / A[i, i]
    for i in range(k):
        for j in range(i + 1):
            s = 0.0
            for m in range(i, k):
                s += A[m, i] * A[m, j]
            A[i, j] = s
    for i in range(k):
        for j in range(i):
            A[j, i] = A[i, j]
    return True


@njit(cache=True)
def dilution(design: Array, cofactor: Array, out: Array) -> bool:
    """Dilution of precision.

    Parameters
    ----------
    design : array (n, k)
        Rows of :func:`design_row`; a clock column without a satellite makes it singular.
    cofactor : array (k, k)
        Filled with the inverse of the normal matrix; east, north, up, clocks.
    out : array (5,)
        GDOP (all clocks), PDOP, HDOP, VDOP, TDOP (first clock); unchanged if singular.

    Returns
    -------
    bool
        False if the geometry does not determine position and clocks.
    """
    n, k = design.shape
    for i in range(k):
        for j in range(i + 1):
            s = 0.0
            for m in range(n):
                s += design[m, i] * design[m, j]
            cofactor[i, j] = s
            cofactor[j, i] = s
    if n < k or not invert_positive(cofactor):
        return False
    horizontal = cofactor[0, 0] + cofactor[1, 1]
    clocks = 0.0
    for i in range(3, k):
        clocks += cofactor[i, i]
    out[0] = sqrt(horizontal + cofactor[2, 2] + clocks)
    out[1] = sqrt(horizontal + cofactor[2, 2])
    out[2] = sqrt(horizontal)
    out[3] = sqrt(cofactor[2, 2])
    out[4] = sqrt(cofactor[3, 3])
    return True
