"""What a satellite's antenna adds to code and phase: offset and pattern of its phase centre.

Precise orbits are of the centre of mass, the signal leaves the phase centre: as for the
receiver's antenna (:mod:`replay.kernels.antenna_pattern`) the range gains the pattern less the
component of the offset towards the other end. Patterns are those of ANTEX 1.4 (Rothacher and
Schmid 2010) for satellites: the offset's three numbers are x, y, z of the satellite, the angle
of the pattern is that at the satellite between z and the ray, the azimuth goes from y towards x.
"""

from typing import Final

from numba import njit

from replay.kernels.antenna_pattern import pattern_value
from replay.kernels.elementary import atan2, sqrt
from replay.kernels.rotation import rotate3, rotate3_back
from replay.kernels.types import Array, Record

_HALF_PI: Final = 1.5707963267948966


@njit(cache=True)
def nadir_azimuth(axes: Array, ux: float, uy: float, uz: float) -> tuple[float, float]:
    """Angle from the satellite's z (rad) and azimuth from y towards x (rad, -pi to pi).

    Parameters
    ----------
    axes : float64 array (3, 3)
        Rows x, y, z of the satellite in ECEF.
    ux, uy, uz : float
        From the satellite to the receiver, ECEF, of any length.
    """
    x, y, z = rotate3(axes, ux, uy, uz)
    return atan2(sqrt(x * x + y * y), z), atan2(x, y)


@njit(cache=True)
def phase_centre(pattern: Record, axes: Array, out: Array) -> None:
    """Phase centre less centre of mass, m, ECEF, into `out` (3,).

    Parameters
    ----------
    pattern : record of PATTERN_DTYPE
        Its `offset` is x, y, z of the satellite.
    axes : float64 array (3, 3)
        Rows x, y, z of the satellite in ECEF.
    """
    offset = pattern["offset"]
    out[0], out[1], out[2] = rotate3_back(axes, offset[0], offset[1], offset[2])


@njit(cache=True)
def satellite_antenna_range(
    pattern: Record, values: Array, axes: Array, ux: float, uy: float, uz: float, level: bool
) -> tuple[float, float]:
    """What a satellite's antenna adds to range and phase (m).

    Parameters
    ----------
    pattern : record of PATTERN_DTYPE
        Of the satellite and the frequency.
    values : float64 array, m
    axes : float64 array (3, 3)
        Rows x, y, z of the satellite in ECEF.
    ux, uy, uz : float
        Unit vector from the satellite to the receiver, ECEF.
    level : bool
        Use the mean over azimuths.

    Returns
    -------
    offset, variation : float, m
        To be added to the distance from the centre of mass: minus the offset's component
        towards the receiver, and the pattern.
    """
    x, y, z = rotate3(axes, ux, uy, uz)
    offset = pattern["offset"]
    nadir = atan2(sqrt(x * x + y * y), z)
    variation = pattern_value(pattern, values, _HALF_PI - nadir, atan2(x, y), level)
    return -(offset[0] * x + offset[1] * y + offset[2] * z), variation
