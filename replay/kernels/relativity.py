"""Effect of an orbit's eccentricity on the satellite's clock, from position and velocity.

For satellites of precise orbits; of a broadcast message :mod:`replay.kernels.orbits` has it.
The delay in the Earth's gravity is :func:`replay.kernels.observables.shapiro`.
"""

from numba import njit

from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.types import Array


@njit(cache=True)
def eccentricity_clock(r: Array, v: Array) -> float:
    """Periodic relativistic effect on the satellite's clock, -2 r v / c^2, in s.

    IS-GPS-200N 20.3.3.3.3.1; IERS Conventions (2010), eq. 10.10. It is added to clocks that
    do not contain it, as those of the IGS. The Earth's turn does not matter: r times (omega
    x r) is nought, so the velocity may be that in ECEF.

    Parameters
    ----------
    r, v : float64 arrays (3,), m and m/s
        Of the satellite's centre of mass, ECEF or inertial, both at one moment.
    """
    along = r[0] * v[0] + r[1] * v[1] + r[2] * v[2]
    return -2.0 * along / (SPEED_OF_LIGHT_M_S * SPEED_OF_LIGHT_M_S)
