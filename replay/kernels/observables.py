"""What a simulated receiver could see of one satellite: the truth, without noise.

The satellite is that of its true orbit's records, at the moment when what arrives was sent;
the range is the light-time solution with the Earth's rotation, and the rates are the
exact derivatives of the same formulas. Rates of the atmosphere are central differences
over a second. The atmosphere's delays are added to the range; that the signal left so
much earlier (0.1 us at most) would move the satellite by less than 0.1 mm of range.
"""

import math
from typing import Final

import numpy as np
from numba import njit

from replay.kernels.atmosphere import (
    beidou_pierce_point,
    day_of_year,
    klobuchar_l1,
    niell_hydrostatic,
    niell_wet,
    zenith_standard,
)
from replay.kernels.earth import EARTH_RATE_RAD_S, enu_axes, geodetic
from replay.kernels.elementary import log, sqrt
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S, satellite_state
from replay.kernels.rotation import rotate3
from replay.kernels.sight import elevation_azimuth, line_of_sight
from replay.kernels.sky_fields import (
    WAVES,
    gradient_delay,
    vertical_ionosphere,
    zenith_wet_field,
)
from replay.kernels.true_orbit import between_messages, true_state
from replay.kernels.types import Array, Record

_WEEK_NS = 604_800_000_000_000
_TYPICAL_TRAVEL_S = 0.075
_MARGIN = 0.02  # of the sine of the elevation, for the rough look at 75 ms
_HALF_STEP_S = 0.5
# The sine of an elevation changes no faster: 4 km/s seen from 19 000 km is half of the first;
# the second, per m/s of the receiver, is its motion over that and over the Earth's radius, twice.
_FASTEST_SINE = 4e-4
_FASTEST_SINE_MOVING = 4e-7
_KM = 1e-3
_TWICE_SCHWARZSCHILD_M = 2.0 * 3.986004418e14 / (SPEED_OF_LIGHT_M_S * SPEED_OF_LIGHT_M_S)

# What one satellite is at one epoch; delays in m on GPS L1, rates in m/s.
SIGHT_DTYPE: Final = np.dtype(
    [
        ("seen", "<i8"),  # 1 above the mask; the other fields are undefined below it
        ("travel_s", "<f8"),  # in vacuum
        ("travel_rate", "<f8"),  # s/s
        ("clock_s", "<f8"),  # satellite minus system time, with relativity
        ("clock_drift", "<f8"),  # s/s
        ("elevation", "<f8"),  # rad
        ("azimuth", "<f8"),  # rad
        ("ionosphere_m", "<f8"),  # on GPS L1
        ("ionosphere_rate", "<f8"),
        ("neutral_m", "<f8"),  # troposphere, and Shapiro's delay where it is wanted
        ("shapiro_m", "<f8"),  # the latter alone
        ("neutral_rate", "<f8"),
    ],
    align=True,
)

# The atmosphere that is true.
ATMOSPHERE_DTYPE: Final = np.dtype(
    [
        ("ionosphere", "<i8"),  # 1 is on
        ("troposphere", "<i8"),
        ("shapiro", "<i8"),
        ("alpha", "<f8", 4),  # Klobuchar's, times the scale
        ("beta", "<f8", 4),
        ("scale", "<f8"),
        ("humidity", "<f8"),  # 0 to 1
        ("ionosphere_spacing", "<f8"),  # s between nodes
        ("wet_spacing", "<f8"),  # s between nodes
        ("origin", "<f8", 3),  # m, ECEF, where gradients are nought
        ("axes", "<f8", (3, 3)),  # east, north, up there
        ("origin_latitude", "<f8"),  # rad, the same place
        ("origin_longitude", "<f8"),
        ("fields", "<i8"),  # 1 where the ionosphere has one of the next three
        ("slope", "<f8", 2),  # to the east and north, vertical, m on L1 per m
        ("wave", "<f8", 4),  # amplitude (m), wave numbers (rad/m), rate (rad/s)
        # height (m), direction's east and north part, speed (m/s), place at the start and
        # width (m)
        ("front", "<f8", 6),
        ("wet_gradient", "<f8", 2),  # m, to the east and north
        ("wet_fields", "<i8"),  # 1 where the troposphere has one of the next two
        ("wet_slope", "<f8", 2),  # zenith, m per m
        ("wet_waves", "<f8", (WAVES, 5)),  # of :func:`sky_fields.random_field`
    ],
    align=True,
)


@njit(cache=True)
def cubic(nodes: Array, x: float) -> float:
    """Value between equally spaced nodes, once continuously differentiable (Catmull-Rom).

    Parameters
    ----------
    nodes : float64 array (n,)
        At -1, 0, 1, ... steps.
    x : float
        Steps since the second node, from 0 to n - 3; beyond, as at the ends.
    """
    last = nodes.shape[0] - 3
    if x < 0.0:
        x = 0.0
    elif x > last:
        x = float(last)
    i = int(x)
    if i == last:
        i -= 1
    f = x - i
    a, b, c, d = nodes[i], nodes[i + 1], nodes[i + 2], nodes[i + 3]
    return b + 0.5 * f * (
        (c - a) + f * ((2.0 * a - 5.0 * b + 4.0 * c - d) + f * (3.0 * (b - c) + d - a))
    )


@njit(cache=True)
def travel_rate(
    state: Array, ux: float, uy: float, uz: float, vx: float, vy: float, vz: float
) -> float:
    """Derivative of the travel time by the time of reception, s/s.

    From c tau = |R(w tau) s(t - tau) - r(t)|, differentiated with tau's own rate.

    Parameters
    ----------
    state : float64 array (8,)
        Of the satellite, ECEF at reception.
    ux, uy, uz : float
        Unit vector from receiver to satellite.
    vx, vy, vz : float, m/s
        Receiver, ECEF.
    """
    along = ux * state[3] + uy * state[4] + uz * state[5]
    turning = EARTH_RATE_RAD_S * (ux * state[1] - uy * state[0])
    own = ux * vx + uy * vy + uz * vz
    return (along - own) / (SPEED_OF_LIGHT_M_S + along - turning)


@njit(cache=True)
def shapiro(x: float, y: float, z: float, state: Array) -> float:
    """Delay (m) of a signal in the Earth's gravity (Petit and Luzum 2010, eq. 11.17)."""
    r = sqrt(x * x + y * y + z * z)
    s = sqrt(state[0] * state[0] + state[1] * state[1] + state[2] * state[2])
    d, _, _, _ = line_of_sight(x, y, z, state[0], state[1], state[2])
    return _TWICE_SCHWARZSCHILD_M * log((s + r + d) / (s + r - d))


@njit(cache=True)
def delays(
    atmosphere: Record,
    residuals: Array,
    wet: Array,
    time_ns: int,
    offset_s: float,
    since_s: float,
    x: float,
    y: float,
    z: float,
    state: Array,
    axes: Array,
) -> tuple[float, float]:
    """Ionosphere on GPS L1 and everything that is not dispersive, m.

    Parameters
    ----------
    atmosphere : record of ATMOSPHERE_DTYPE
    residuals : float64 array (3, n)
        Of this satellite: vertical ionospheric delay (m on L1) beyond the model, its
        gradient to the east and to the north (m/km), at nodes.
    wet : float64 array (n,), m
        Zenith wet delay beyond the standard atmosphere's, at nodes.
    time_ns, offset_s : int, ns and float, s
        Time of reception.
    since_s : float, s
        The same since the third node.
    x, y, z : float, m
        Receiver, ECEF.
    state : float64 array (8,)
        Satellite, ECEF at reception.
    axes : float64 array (3, 3)
        Scratch.
    """
    enu_axes(x, y, z, axes)
    _, ux, uy, uz = line_of_sight(x, y, z, state[0], state[1], state[2])
    elevation, azimuth = elevation_azimuth(axes, ux, uy, uz)
    latitude, longitude, height = geodetic(x, y, z)
    dispersive = 0.0
    if atmosphere["ionosphere"] != 0:
        of_week = (time_ns % _WEEK_NS) / 1e9 + offset_s
        model = klobuchar_l1(
            atmosphere["alpha"], atmosphere["beta"], latitude, longitude, elevation, azimuth,
            of_week,
        )  # fmt: skip
        phi, lam, slant = beidou_pierce_point(latitude, longitude, elevation, azimuth)
        at = 1.0 + since_s / atmosphere["ionosphere_spacing"]
        o = atmosphere["origin"]
        east, north, _ = rotate3(atmosphere["axes"], x - o[0], y - o[1], z - o[2])
        vertical = cubic(residuals[0], at) + _KM * (
            east * cubic(residuals[1], at) + north * cubic(residuals[2], at)
        )
        if atmosphere["fields"] != 0:
            vertical += vertical_ionosphere(atmosphere, phi, lam, since_s)
        dispersive = atmosphere["scale"] * model + slant * vertical
    neutral = 0.0
    if atmosphere["troposphere"] != 0:
        hydrostatic, zenith_wet = zenith_standard(latitude, height, atmosphere["humidity"])
        zenith_wet += cubic(wet, 1.0 + since_s / atmosphere["wet_spacing"])
        if atmosphere["wet_fields"] != 0:
            o = atmosphere["origin"]
            east, north, _ = rotate3(atmosphere["axes"], x - o[0], y - o[1], z - o[2])
            zenith_wet += zenith_wet_field(atmosphere, east, north, since_s)
        neutral = hydrostatic * niell_hydrostatic(
            elevation, latitude, height, day_of_year(time_ns)
        ) + zenith_wet * niell_wet(elevation, latitude)
        gradient = atmosphere["wet_gradient"]
        if gradient[0] != 0.0 or gradient[1] != 0.0:
            neutral += gradient_delay(gradient[0], gradient[1], elevation, azimuth)
    if atmosphere["shapiro"] != 0:
        neutral += shapiro(x, y, z, state)
    return dispersive, neutral


@njit(cache=True)
def see(
    satellite: Array,
    atmosphere: Array,
    residuals: Array,
    wet: Array,
    limit_s: float,
    times_ns: Array,
    offsets_s: Array,
    start_ns: int,
    positions: Array,
    velocities: Array,
    mask_rad: float,
    sine_of_mask: float,
    sights: Array,
) -> None:
    """One satellite from every place of a receiver.

    Parameters
    ----------
    satellite : array (n,) of EPHEMERIS_DTYPE
        Its true orbit and clock, as in :mod:`replay.kernels.true_orbit`.
    atmosphere : array (1,) of ATMOSPHERE_DTYPE
    residuals, wet : float64 arrays (3, n) and (n,)
        As in :func:`delays`.
    limit_s : float, s
        How far from its reference time a record of the orbit holds.
    times_ns, offsets_s : int64 and float64 arrays (e,)
        True times of reception, GPS, rising.
    start_ns : int, ns
        Time of the third node.
    positions, velocities : float64 arrays (e, 3), m and m/s, ECEF
        Of the antenna at those times.
    mask_rad, sine_of_mask : float
        Lowest elevation.
    sights : array (e,) of SIGHT_DTYPE
        Written.
    """
    air = atmosphere[0]
    state = np.empty(8)
    other = np.empty(8)
    moved = np.empty(8)
    axes = np.empty((3, 3))
    h = _HALF_STEP_S
    fastest = 0.0
    for k in range(velocities.shape[0]):
        v = velocities[k]
        fastest = max(fastest, v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    fastest = _FASTEST_SINE + _FASTEST_SINE_MOVING * sqrt(fastest)
    below_until = times_ns[0] if times_ns.shape[0] > 0 else 0
    for k in range(times_ns.shape[0]):
        out = sights[k]
        out["seen"] = 0
        time_ns, offset = times_ns[k], offsets_s[k]
        if time_ns < below_until:
            continue
        r, v = positions[k], velocities[k]
        x, y, z = r[0], r[1], r[2]
        which, _, _ = between_messages(satellite, time_ns, offset, limit_s)
        if which < 0:
            continue
        satellite_state(satellite[which], time_ns, offset - _TYPICAL_TRAVEL_S, state)
        enu_axes(x, y, z, axes)
        _, ux, uy, uz = line_of_sight(x, y, z, state[0], state[1], state[2])
        missing = sine_of_mask - _MARGIN - (axes[2, 0] * ux + axes[2, 1] * uy + axes[2, 2] * uz)
        if missing > 0.0:
            below_until = time_ns + int(missing / fastest * 1e9)
            continue
        travel = true_state(satellite, time_ns, offset, limit_s, x, y, z, state, other)
        _, ux, uy, uz = line_of_sight(x, y, z, state[0], state[1], state[2])
        elevation, azimuth = elevation_azimuth(axes, ux, uy, uz)
        if elevation < mask_rad:
            continue
        out["seen"] = 1
        out["travel_s"] = travel
        out["travel_rate"] = travel_rate(state, ux, uy, uz, v[0], v[1], v[2])
        out["clock_s"] = state[6]
        out["clock_drift"] = state[7]
        out["elevation"] = elevation
        out["azimuth"] = azimuth
        since = (time_ns - start_ns) / 1e9 + offset
        iono, neutral = delays(air, residuals, wet, time_ns, offset, since, x, y, z, state, axes)
        out["ionosphere_m"] = iono
        out["neutral_m"] = neutral
        out["shapiro_m"] = shapiro(x, y, z, state) if air["shapiro"] != 0 else 0.0
        iono_change = 0.0
        neutral_change = 0.0
        for side in (-1.0, 1.0):
            for i in range(3):
                moved[i] = state[i] + side * h * state[3 + i]
            iono, neutral = delays(
                air, residuals, wet, time_ns, offset + side * h, since + side * h,
                x + side * h * v[0], y + side * h * v[1], z + side * h * v[2], moved, axes,
            )  # fmt: skip
            iono_change += side * iono
            neutral_change += side * neutral
        out["ionosphere_rate"] = iono_change / (2.0 * h)
        out["neutral_rate"] = neutral_change / (2.0 * h)


@njit(cache=True)
def walk_clock(
    bias_s: float, drift: float, walk: float, interval_s: float, jump_s: float, normals: Array,
    out: Array,
) -> None:  # fmt: skip
    """Clock of a receiver: its drift walks at random, its bias is the drift's integral.

    Parameters
    ----------
    bias_s, drift : float, s and s/s
        At the beginning, one interval before the first epoch.
    walk : float, s/s/sqrt(s)
    interval_s : float, s
        Between epochs.
    jump_s : float, s
        The bias is brought back by jumps of this size when it exceeds half of it; 0 never.
    normals : float64 array (e,)
        Standard normal numbers.
    out : float64 array (e, 2)
        Written: bias (s, receiver minus GPS time) and drift (s/s) at each epoch.
    """
    step = walk * sqrt(interval_s)
    for k in range(normals.shape[0]):
        before = drift
        drift += step * normals[k]
        bias_s += 0.5 * interval_s * (before + drift)
        if jump_s > 0.0:
            bias_s -= jump_s * math.floor(bias_s / jump_s + 0.5)
        out[k, 0] = bias_s
        out[k, 1] = drift
