"""How tides move the ground below a simulated receiver."""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.tides import pole_tide, secular_pole, solid_tide
from replay.kernels.types import Array

_ARCSEC_PER_RAD: Final = 206264.80624709636
_HALF_STEP_NS: Final = 10_000_000_000


@njit(cache=True)
def _at(
    x: Array, time_ns: int, ut1_minus_gps_s: float, pole: Array, solid: Array, polar: Array
) -> None:
    solid_tide(x, time_ns, ut1_minus_gps_s, solid)
    xs, ys = secular_pole(time_ns)
    m1 = pole[0] * _ARCSEC_PER_RAD - xs
    m2 = ys - pole[1] * _ARCSEC_PER_RAD
    pole_tide(x, m1, m2, polar)


@njit(cache=True)
def ground_motion(
    positions: Array,
    times_ns: Array,
    ut1_minus_gps_s: float,
    pole: Array,
    solid: Array,
    polar: Array,
    rates: Array,
) -> None:
    """Displacements of the ground at every epoch.

    Parameters
    ----------
    positions : float64 array (e, 3), m, ECEF
    times_ns : int64 array (e,), ns, GPS
    ut1_minus_gps_s : float, s
    pole : float64 array (2,), rad
        Towards Greenwich, towards 90 degrees west.
    solid, polar : float64 arrays (e, 3), m, ECEF
        Written: solid Earth tide and pole tide.
    rates : float64 array (e, 3), m/s, ECEF
        Written: of both together, central differences over 20 s.
    """
    a, b, c, d = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(times_ns.shape[0]):
        t = times_ns[k]
        _at(positions[k], t, ut1_minus_gps_s, pole, solid[k], polar[k])
        _at(positions[k], t - _HALF_STEP_NS, ut1_minus_gps_s, pole, a, b)
        _at(positions[k], t + _HALF_STEP_NS, ut1_minus_gps_s, pole, c, d)
        for i in range(3):
            rates[k, i] = (c[i] + d[i] - a[i] - b[i]) / (2e-9 * _HALF_STEP_NS)
