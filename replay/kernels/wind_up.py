"""Phase wind-up: what the antennas' orientation adds to a carrier phase.

The phase of a circularly polarised wave is that of the angle between the two antennas' dipoles
as seen along the ray; it is added to the phase that is measured, in cycles the same on every
frequency. Only its fraction follows from the orientations: the whole cycles are carried on from
epoch to epoch in a state. Code does not have it.
"""

import math
from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import atan2, sincos
from replay.kernels.rotation import cross3
from replay.kernels.types import Array

_TWO_PI: Final = 6.283185307179586


@njit(cache=True)
def _dipole(
    k: tuple[float, float, float], x: Array, y: Array, side: float
) -> tuple[float, float, float]:
    """Effective dipole of crossed ones: x - k (k x) + side k cross y (Wu et al. 1993, eq. 20)."""
    along = k[0] * x[0] + k[1] * x[1] + k[2] * x[2]
    c0, c1, c2 = cross3(k[0], k[1], k[2], y[0], y[1], y[2])
    return (
        x[0] - k[0] * along + side * c0,
        x[1] - k[1] * along + side * c1,
        x[2] - k[2] * along + side * c2,
    )


@njit(cache=True)
def orientation_phase(satellite: Array, receiver: Array, ux: float, uy: float, uz: float) -> float:
    """Fraction of the wind-up, cycles from -0.5 to 0.5.

    Wu, Wu, Hajj, Bertiger, Lichten (1993), Manuscripta Geodaetica 18, 91-98, eq. 20 to 23.

    Parameters
    ----------
    satellite : float64 array (3, 3)
        Rows x, y, z of the satellite in ECEF (:mod:`replay.kernels.satellite_attitude`).
    receiver : float64 array (3, 3)
        Rows x, y, z of the antenna in ECEF; z is its boresight. For one that is level and
        points north that is north, west, up (:func:`level_antenna`).
    ux, uy, uz : float
        Unit vector from the satellite to the receiver, ECEF.
    """
    k = (ux, uy, uz)
    s0, s1, s2 = _dipole(k, satellite[0], satellite[1], -1.0)
    r0, r1, r2 = _dipole(k, receiver[0], receiver[1], 1.0)
    c0, c1, c2 = cross3(s0, s1, s2, r0, r1, r2)
    return atan2(ux * c0 + uy * c1 + uz * c2, s0 * r0 + s1 * r1 + s2 * r2) / _TWO_PI


@njit(cache=True)
def level_antenna(axes: Array, heading: float, out: Array) -> None:
    """Axes of a level antenna.

    Parameters
    ----------
    axes : float64 array (3, 3)
        Rows east, north, up in ECEF.
    heading : float, rad
        Where its x-axis points, clockwise from north. Its turn adds the same cycles to all
        satellites, which a clock of the phases takes up.
    out : float64 array (3, 3)
        Rows become x, y, z of the antenna: for heading nought north, west, up.
    """
    s, c = sincos(heading)
    for i in range(3):
        out[0, i] = c * axes[1, i] + s * axes[0, i]
        out[1, i] = s * axes[1, i] - c * axes[0, i]
        out[2, i] = axes[2, i]


@njit(cache=True)
def carry_on(fraction: float, before: float) -> float:
    """Whole wind-up (cycles) nearest to that of the epoch before, which may be NaN.

    It is right as long as the orientation turns by less than half a turn between epochs.
    """
    if before != before:
        return fraction
    return fraction + math.floor(before - fraction + 0.5)


@njit(cache=True)
def wind_up(
    satellite: Array, receiver: Array, ux: float, uy: float, uz: float, state: Array, number: int
) -> float:
    """Wind-up of one satellite, cycles; parameters as of :func:`orientation_phase`.

    Parameters
    ----------
    state : float64 array (n,), cycles
        Last wind-up by satellite, NaN (:func:`new_state`) before the first; `number` of it is
        used and updated. It is set to NaN again where a satellite's phase begins anew.
    number : int
    """
    value = carry_on(orientation_phase(satellite, receiver, ux, uy, uz), state[number])
    state[number] = value
    return value


def new_state(satellites: int) -> Array:
    """State of :func:`wind_up` before the first epoch."""
    return np.full(satellites, np.nan)
