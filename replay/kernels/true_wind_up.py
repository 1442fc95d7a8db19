"""Wind-up of a simulated carrier phase: satellite and antenna turn, and both count.

The formula is that of :mod:`replay.kernels.wind_up`; here the antenna turns with its vehicle
and the rate is told too, because a receiver's Doppler has it.
"""

import math
from typing import Final

import numpy as np
from numba import njit

from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.rotation import cross3
from replay.kernels.satellite_attitude import NOMINAL, satellite_axes
from replay.kernels.sight import line_of_sight
from replay.kernels.sun_moon import sun_moon_ecef
from replay.kernels.true_orbit import true_state
from replay.kernels.types import Array
from replay.kernels.wind_up import carry_on, orientation_phase

_HALF_STEP_S: Final = 1e-3  # of the difference that makes the rate


@njit(cache=True)
def antenna_axes(mount: Array, out: Array) -> None:
    """Axes that the formula wants, out of those of a mounted antenna.

    Parameters
    ----------
    mount : float64 array (e, 3, 3)
        Rows right of the mark, along it, up, in ECEF: east, north, up of one on a pillar.
    out : float64 array (e, 3, 3)
        Written: rows along the mark, to the left of it, up.
    """
    for k in range(mount.shape[0]):
        for i in range(3):
            out[k, 0, i] = mount[k, 1, i]
            out[k, 1, i] = -mount[k, 0, i]
            out[k, 2, i] = mount[k, 2, i]


@njit(cache=True)
def _fraction(
    state: Array, sun: Array, axes: Array, turning: Array, place: Array, velocity: Array,
    after_s: float, r: Array, v: Array, s: Array, turned: Array, body: Array,
) -> float:  # fmt: skip
    """Wind-up (cycles, -0.5 to 0.5) a moment after or before; `r` to `body` are scratch."""
    spin = EARTH_RATE_RAD_S * after_s
    s[0], s[1], s[2] = sun[0] + spin * sun[1], sun[1] - spin * sun[0], sun[2]
    for i in range(3):
        r[i] = state[i] + after_s * state[3 + i]
        v[i] = state[3 + i]
        t0, t1, t2 = cross3(turning[0], turning[1], turning[2], axes[i, 0], axes[i, 1], axes[i, 2])
        turned[i, 0] = axes[i, 0] + after_s * t0
        turned[i, 1] = axes[i, 1] + after_s * t1
        turned[i, 2] = axes[i, 2] + after_s * t2
    satellite_axes(NOMINAL, r, v, s, body)
    _, ux, uy, uz = line_of_sight(
        place[0] + after_s * velocity[0], place[1] + after_s * velocity[1],
        place[2] + after_s * velocity[2], r[0], r[1], r[2],
    )  # fmt: skip
    return orientation_phase(body, turned, -ux, -uy, -uz)


@njit(cache=True)
def true_wind_up(
    satellite: Array,
    limit_s: float,
    times_ns: Array,
    offsets_s: Array,
    positions: Array,
    velocities: Array,
    axes: Array,
    turning: Array,
    ut1_minus_gps_s: float,
    sights: Array,
    out: Array,
) -> None:
    """Wind-up of one satellite at every epoch.

    Parameters
    ----------
    satellite : array (n,) of EPHEMERIS_DTYPE
        Its true orbit, as in :mod:`replay.kernels.true_orbit`.
    limit_s : float, s
        How far from its reference time a record of the orbit holds.
    times_ns, offsets_s : int64 and float64 arrays (e,)
        True times of reception, GPS, rising.
    positions, velocities : float64 arrays (e, 3), m and m/s, ECEF
        Of the antenna.
    axes : float64 array (e, 3, 3)
        Of the antenna, :func:`antenna_axes`.
    turning : float64 array (e, 3), rad/s, ECEF
        Of those axes against the Earth.
    ut1_minus_gps_s : float, s
        As of :func:`replay.kernels.sun_moon.sun_moon_ecef`.
    sights : array (e,) of SIGHT_DTYPE
    out : float64 array (e, 2), cycles and cycles/s
        Written: nought where the satellite is not seen. Whole cycles go on from the epoch that
        it was last seen at, which is right while it turns by less than half a turn between.
        The satellite stands nominally.
    """
    state, other = np.empty(8), np.empty(8)
    sun, moon = np.empty(3), np.empty(3)
    r, v, s = np.empty(3), np.empty(3), np.empty(3)
    turned, body = np.empty((3, 3)), np.empty((3, 3))
    before = math.nan
    h = _HALF_STEP_S
    for k in range(times_ns.shape[0]):
        out[k, 0] = 0.0
        out[k, 1] = 0.0
        if sights[k]["seen"] == 0:
            continue
        p, motion = positions[k], velocities[k]
        true_state(satellite, times_ns[k], offsets_s[k], limit_s, p[0], p[1], p[2], state, other)
        sun_moon_ecef(times_ns[k], ut1_minus_gps_s, sun, moon)
        w = turning[k]
        now = _fraction(state, sun, axes[k], w, p, motion, 0.0, r, v, s, turned, body)
        later = _fraction(state, sun, axes[k], w, p, motion, h, r, v, s, turned, body)
        sooner = _fraction(state, sun, axes[k], w, p, motion, -h, r, v, s, turned, body)
        before = carry_on(now, before)
        out[k, 0] = before
        out[k, 1] = (carry_on(later, now) - carry_on(sooner, now)) / (2.0 * h)
