"""Second-order effect of the ionosphere: that of the Earth's magnetic field on the waves.

The index of refraction of a right-handed wave has a term of the inverse cube of the frequency
(IERS Conventions 2010, section 9.4; Bassiri and Hajj 1993, Manuscripta Geodaetica 18). It does
not cancel in the ionosphere-free combination: some millimetres at 100 TECU. All electrons are
taken on a thin shell, in the field of a tilted dipole, which is good to a quarter of the term.
"""

from typing import Final

from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.types import Array

_SHELL_M: Final = 6371.2e3 + 450e3
_REFERENCE_M: Final = 6371.2e3
# Gauss coefficients g11, h11, g10 of IGRF-13 for 2020 (Alken et al. 2021), T.
_DIPOLE: Final = (-1450.9e-9, 4652.5e-9, -29404.8e-9)
# Half of the electrons' plasma constant (40.308 m^3/s^2) times the gyration's (27.992 GHz/T).
_SECOND: Final = 1.1284e12


@njit(cache=True)
def dipole_field(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Magnetic flux density (T, ECEF) of the Earth's dipole at an ECEF position (m)."""
    r = sqrt(x * x + y * y + z * z)
    ux, uy, uz = x / r, y / r, z / r
    ratio = _REFERENCE_M / r
    cube = ratio * ratio * ratio
    along = 3.0 * (_DIPOLE[0] * ux + _DIPOLE[1] * uy + _DIPOLE[2] * uz)
    return (
        cube * (along * ux - _DIPOLE[0]),
        cube * (along * uy - _DIPOLE[1]),
        cube * (along * uz - _DIPOLE[2]),
    )


@njit(cache=True)
def field_along_ray(x: Array, ux: float, uy: float, uz: float) -> float:
    """Component of the dipole's field along the propagation, where the ray meets the shell.

    Parameters
    ----------
    x : float64 array (3,), m, ECEF
        Receiver, below the shell of 450 km.
    ux, uy, uz : float
        Unit vector from the receiver to the satellite, ECEF.

    Returns
    -------
    float, T
        Positive where the wave goes along the field.
    """
    along = x[0] * ux + x[1] * uy + x[2] * uz
    square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    d = sqrt(along * along - square + _SHELL_M * _SHELL_M) - along
    bx, by, bz = dipole_field(x[0] + d * ux, x[1] + d * uy, x[2] + d * uz)
    return -(bx * ux + by * uy + bz * uz)


@njit(cache=True)
def second_order(electrons_m2: float, field_t: float, frequency_hz: float) -> float:
    """Second-order delay of the code (m); the phase gets minus half of it.

    Parameters
    ----------
    electrons_m2 : float, 1/m^2
        Along the ray: 1e16 a TECU, or the first-order delay times frequency^2 / 40.308.
    field_t : float, T
        Of :func:`field_along_ray`.
    frequency_hz : float, Hz
    """
    cube = frequency_hz * frequency_hz * frequency_hz
    return 2.0 * _SECOND * electrons_m2 * field_t / cube
