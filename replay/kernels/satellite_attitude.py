"""How a navigation satellite stands: its axes by the Sun, and how it turns where it cannot follow.

Axes as those of the IGS (Montenbruck et al. 2015, Adv. Space Res. 56, 1015-1029): z to the
Earth's centre, y along the axis of the solar panels, x on the side of the Sun. The yaw angle is
that from the along-track direction to x, about z. The orbit angle mu counts along the orbit from
the point farthest from the Sun (midnight), beta is the Sun's height over the orbital plane.

Nominally x stays in the plane of Sun and satellite: yaw = atan2(-tan beta, sin mu). About noon
and midnight that may need a faster turn than the satellite can make, and in the Earth's shadow
some do not see the Sun. Each model here is a closed form of beta, mu and mu's rate, without a
memory of earlier epochs:

======== ==================================================================================
model    what it is
======== ==================================================================================
NOMINAL  always nominal
GPS_IIA  Kouba (2009), GPS Solut. 13:1-12: noon turn at 0.12 deg/s at most; through the shadow
         always at that rate (positive, by the yaw bias of +0.5 deg), then back to nominal the
         shorter way; the 30 minutes after the shadow are uncertain; the noon turn goes the
         other way round where beta is positive and below the bias
GPS_IIR  Kouba (2009): noon and midnight turns at 0.20 deg/s at most
GPS_IIF  Dilssner (2010), InsideGNSS 5(6): noon turn at 0.11 deg/s at most; through the shadow at
         the constant rate that ends it nominally; the noon turn goes the other way round where
         beta is negative and above the bias of -0.7 deg (Kuang et al. 2017, GPS Solut. 21)
GLO_M    Dilssner et al. (2011), Adv. Space Res. 47: noon turn at 0.25 deg/s, centred at noon;
         from the beginning of the shadow at 0.25 deg/s to the angle of its end, then fixed
GAL_IOV  EUSPA, Galileo satellite metadata: auxiliary Sun where beta < 2 deg and the Sun's
         direction along the track is within 15 deg of noon and midnight
GAL_FOC  the same source: cosine law where beta < 4.1 deg and within 10 deg of either
BDS_2    orbit normal (yaw 0) where beta < 4 deg, as the MEO and IGSO of BeiDou-2
QZS_1    orbit normal where beta < 20 deg
NORMAL   always orbit normal: geostationary satellites
======== ==================================================================================

A beta that changes its sign within a turn is not foreseen, nor are rates by space vehicle (GPS
IIA: 0.08 to 0.14 deg/s). The law of GAL_FOC ends with a jump of up to 2 deg. Satellites of other
blocks (GPS III, BeiDou-3, GLONASS-K) are best taken as NOMINAL, and left out or given less
weight about noon and midnight of low beta.
"""

from typing import Final

from numba import njit

from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.elementary import acos, asin, atan2, cos, sin, sincos, sqrt
from replay.kernels.rotation import cross3
from replay.kernels.types import Array

NOMINAL: Final = 0
GPS_IIA: Final = 1
GPS_IIR: Final = 2
GPS_IIF: Final = 3
GLO_M: Final = 4
GAL_IOV: Final = 5
GAL_FOC: Final = 6
BDS_2: Final = 7
QZS_1: Final = 8
NORMAL: Final = 9

# Flags of :func:`yaw_angle`, to be added.
TURNING: Final = 1  # not nominal
UNCERTAIN: Final = 2  # after the shadow of a GPS IIA

_PI: Final = 3.141592653589793
_HALF_PI: Final = 1.5707963267948966
_TWO_PI: Final = 6.283185307179586
_DEG: Final = _PI / 180.0
_EARTH_M: Final = 6378137.0
_SUN_M: Final = 695_700_000.0
_IIA_RATE: Final = 0.12 * _DEG
_IIR_RATE: Final = 0.20 * _DEG
_IIF_RATE: Final = 0.11 * _DEG
_GLO_RATE: Final = 0.25 * _DEG
_IIA_BIAS: Final = 0.5 * _DEG
_IIF_BIAS: Final = 0.7 * _DEG  # negative
_RECOVERY_S: Final = 1800.0
_IOV_SINE_Y: Final = 0.03489949670250097  # sin 2 deg
_IOV_SINE_X: Final = 0.25881904510252074  # sin 15 deg
_FOC_BETA: Final = 4.1 * _DEG
_FOC_COS: Final = 0.984807753012208  # cos 10 deg
_FOC_PERIOD_S: Final = 5656.0
_BDS_BETA: Final = 4.0 * _DEG
_QZS_BETA: Final = 20.0 * _DEG


@njit(cache=True)
def _clip(x: float) -> float:
    """Argument of acos and asin, which rounding may have put beyond one."""
    return 1.0 if x > 1.0 else (-1.0 if x < -1.0 else x)


@njit(cache=True)
def _half_turn(angle: float) -> float:
    """The same angle (rad) from -pi to pi; meant for a few turns."""
    while angle > _PI:
        angle -= _TWO_PI
    while angle < -_PI:
        angle += _TWO_PI
    return angle


@njit(cache=True)
def orbit_angles(r: Array, v: Array, sun: Array) -> tuple[float, float, float]:
    """The Sun over the orbital plane, the satellite along the orbit.

    Parameters
    ----------
    r, v : float64 arrays (3,), m and m/s, ECEF
        Of the satellite; the velocity is relative to the turning Earth.
    sun : float64 array (3,), m, ECEF

    Returns
    -------
    beta : float, rad
    mu : float, rad
        From midnight, -pi to pi.
    mu_rate : float, rad/s
    """
    vx, vy = v[0] - EARTH_RATE_RAD_S * r[1], v[1] + EARTH_RATE_RAD_S * r[0]
    nx, ny, nz = cross3(r[0], r[1], r[2], vx, vy, v[2])
    n = sqrt(nx * nx + ny * ny + nz * nz)
    rr = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    s = sqrt(sun[0] * sun[0] + sun[1] * sun[1] + sun[2] * sun[2])
    sine = (nx * sun[0] + ny * sun[1] + nz * sun[2]) / (n * s)
    # Along the track, times r n; the Sun is at noon where it stands over the satellite.
    tx, ty, tz = cross3(nx, ny, nz, r[0], r[1], r[2])
    along = (tx * sun[0] + ty * sun[1] + tz * sun[2]) / n
    over = r[0] * sun[0] + r[1] * sun[1] + r[2] * sun[2]
    return asin(_clip(sine)), atan2(along, -over), n / rr


@njit(cache=True)
def in_shadow(r: Array, sun: Array) -> float:
    """How deep a satellite is in the Earth's shadow: 0 in the light, 1 in the umbra.

    Half way in the penumbra it is about one half: the edge of a round Earth passes over the
    Sun's disc, taken as linear.

    Parameters
    ----------
    r, sun : float64 arrays (3,), m
        Satellite and Sun, the same axes.
    """
    dx, dy, dz = sun[0] - r[0], sun[1] - r[1], sun[2] - r[2]
    d = sqrt(dx * dx + dy * dy + dz * dz)
    rr = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    between = acos(_clip(-(dx * r[0] + dy * r[1] + dz * r[2]) / (d * rr)))
    earth = asin(_clip(_EARTH_M / rr))
    disc = asin(_clip(_SUN_M / d))
    depth = 0.5 + 0.5 * (earth - between) / disc
    return 0.0 if depth < 0.0 else (1.0 if depth > 1.0 else depth)


@njit(cache=True)
def nominal_yaw(beta: float, mu: float) -> float:
    """Nominal yaw angle (rad, -pi to pi): Bar-Sever (1996), J. Geod. 70, eq. 4."""
    sin_beta, cos_beta = sincos(beta)
    return atan2(-sin_beta, cos_beta * sin(mu))


@njit(cache=True)
def _progress(beta: float, nu: float) -> float:
    """How far the nominal turn is, 0 to pi, at an angle `nu` after its middle; beta >= 0."""
    sin_beta, cos_beta = sincos(beta)
    return atan2(sin_beta, -cos_beta * sin(nu))


@njit(cache=True)
def _limited(beta: float, nu: float, nu_rate: float, rate: float, back: bool) -> float:
    """Progress of a turn that starts as the nominal rate becomes `rate` (rad/s); beta >= 0.

    The nominal rate is nu_rate tan(beta) cos(nu) / (sin^2 nu + tan^2 beta): where it is
    `rate`, cos nu solves a quadratic equation. From there on the satellite turns at `rate`
    until the nominal turn, that was faster and becomes slower, is reached again; the other
    way round with `back`.
    """
    sin_beta, cos_beta = sincos(beta)
    tan_beta = sin_beta / cos_beta
    k = nu_rate / rate * tan_beta
    cosine = 0.5 * (sqrt(k * k + 4.0 * (1.0 + tan_beta * tan_beta)) - k)
    nominal = _progress(beta, nu)
    if cosine >= 1.0:
        return nominal
    start = -acos(cosine)
    if nu <= start:
        return nominal
    turned = rate * (nu - start) / nu_rate
    if back:
        made = _progress(beta, start) - turned
        return made if made > nominal - _TWO_PI else nominal
    made = _progress(beta, start) + turned
    return made if made < nominal else nominal


@njit(cache=True)
def _centred(beta: float, nu: float, nu_rate: float, rate: float) -> float:
    """Progress of a turn at `rate` that is half done at its middle; beta >= 0."""
    line = _HALF_PI + rate * nu / nu_rate
    nominal = _progress(beta, nu)
    if nu < 0.0:
        return line if line > nominal else nominal
    return line if line < nominal else nominal


@njit(cache=True)
def _shadow_half_width(beta: float, radius: float) -> float:
    """Orbit angle (rad) from midnight to the edge of a cylindrical shadow; 0 for none."""
    ratio = _EARTH_M / radius
    cosine = sqrt(1.0 - ratio * ratio) / cos(beta)
    return acos(cosine) if cosine < 1.0 else 0.0


@njit(cache=True)
def _shadow_iia(
    beta: float, mu: float, mu_rate: float, half: float, nominal: float
) -> tuple[float, int]:
    """Yaw of a GPS IIA through the shadow and after it; nothing changes elsewhere."""
    if mu <= -half or (mu - half) / mu_rate >= _RECOVERY_S:
        return nominal, 0
    entry = nominal_yaw(beta, -half)
    if mu < half:
        return _half_turn(entry + _IIA_RATE * (mu + half) / mu_rate), TURNING
    left = _half_turn(entry + _IIA_RATE * 2.0 * half / mu_rate)
    behind = _half_turn(nominal_yaw(beta, half) - left)
    made = _IIA_RATE * (mu - half) / mu_rate
    # The nominal yaw moves on meanwhile.
    to_go = behind + _half_turn(nominal - nominal_yaw(beta, half))
    if made >= abs(to_go):
        return nominal, UNCERTAIN
    return _half_turn(left + (made if behind >= 0.0 else -made)), TURNING + UNCERTAIN


@njit(cache=True)
def _galileo_iov(beta: float, mu: float) -> tuple[float, int]:
    """Auxiliary Sun of the first four Galileo satellites."""
    sin_beta, cos_beta = sincos(beta)
    x, y = cos_beta * sin(mu), -sin_beta
    ax, ay = abs(x), abs(y)
    if ay >= _IOV_SINE_Y or ax >= _IOV_SINE_X:
        return atan2(y, x), 0
    side = -_IOV_SINE_Y if beta >= 0.0 else _IOV_SINE_Y
    y = 0.5 * (side + y) + 0.5 * (side - y) * cos(_PI * ax / _IOV_SINE_X)
    return atan2(y, x), TURNING


@njit(cache=True)
def _galileo_foc(beta: float, mu: float, mu_rate: float) -> tuple[float, int]:
    """Cosine law of the other Galileo satellites, from where the Sun is 10 deg from the nadir."""
    nominal = nominal_yaw(beta, mu)
    cos_beta = cos(beta)
    collinear = abs(cos_beta * cos(mu))
    if abs(beta) >= _FOC_BETA or collinear <= _FOC_COS:
        return nominal, 0
    nu = mu if abs(mu) < _HALF_PI else _half_turn(mu - _PI)
    half = acos(_clip(_FOC_COS / cos_beta))
    begin = nominal_yaw(beta, mu - nu - half)
    middle = -_HALF_PI if beta >= 0.0 else _HALF_PI
    since = (nu + half) / mu_rate
    return middle + (begin - middle) * cos(_TWO_PI * since / _FOC_PERIOD_S), TURNING


@njit(cache=True)
def yaw_angle(
    model: int, beta: float, mu: float, mu_rate: float, radius: float
) -> tuple[float, int]:
    """Yaw angle of a satellite and what there is to say of it.

    Parameters
    ----------
    model : int
        One of those of this module; others are taken as NOMINAL.
    beta, mu, mu_rate : float, rad and rad/s
        Of :func:`orbit_angles`.
    radius : float, m
        The satellite's distance from the Earth's centre.

    Returns
    -------
    yaw : float, rad
        From along-track to x, about z (to the Earth), -pi to pi.
    flags : int
        TURNING, UNCERTAIN, or nought.
    """
    nominal = nominal_yaw(beta, mu)
    size = abs(beta)
    if model == NORMAL or (model == BDS_2 and size < _BDS_BETA) or (
        model == QZS_1 and size < _QZS_BETA
    ):  # fmt: skip
        return 0.0, TURNING
    if model == GAL_IOV:
        return _galileo_iov(beta, mu)
    if model == GAL_FOC:
        return _galileo_foc(beta, mu, mu_rate)
    if model < GPS_IIA or model > GLO_M:
        return nominal, 0
    if abs(mu) < _HALF_PI:
        half = _shadow_half_width(beta, radius)
        if model == GPS_IIA:
            return _shadow_iia(beta, mu, mu_rate, half, nominal) if half > 0.0 else (nominal, 0)
        at = _progress(size, mu)
        if model == GPS_IIR:
            made = _limited(size, mu, mu_rate, _IIR_RATE, False)
        elif abs(mu) >= half:
            return nominal, 0
        else:
            begin, end = _progress(size, -half), _progress(size, half)
            if model == GPS_IIF:
                made = begin + (end - begin) * (mu + half) / (2.0 * half)
            else:
                made = min(begin + _GLO_RATE * (mu + half) / mu_rate, end)
        if made == at:
            return nominal, 0
        return (made - _PI if beta >= 0.0 else _PI - made), TURNING
    nu = _half_turn(mu - _PI)
    at = _progress(size, nu)
    if model == GLO_M:
        made = _centred(size, nu, mu_rate, _GLO_RATE)
    elif model == GPS_IIR:
        made = _limited(size, nu, mu_rate, _IIR_RATE, False)
    elif model == GPS_IIF:
        made = _limited(size, nu, mu_rate, _IIF_RATE, -_IIF_BIAS < beta < 0.0)
    else:
        made = _limited(size, nu, mu_rate, _IIA_RATE, 0.0 < beta < _IIA_BIAS)
    if made == at:
        return nominal, 0
    return _half_turn(-made if beta >= 0.0 else made), TURNING


@njit(cache=True)
def satellite_axes(model: int, r: Array, v: Array, sun: Array, axes: Array) -> int:
    """Axes of a satellite.

    Parameters
    ----------
    model : int
        One of those of this module.
    r, v : float64 arrays (3,), m and m/s, ECEF
        Velocity relative to the turning Earth.
    sun : float64 array (3,), m, ECEF
    axes : float64 array (3, 3)
        Rows become the unit vectors x, y, z in ECEF.

    Returns
    -------
    int
        Flags of :func:`yaw_angle`.
    """
    beta, mu, rate = orbit_angles(r, v, sun)
    radius = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    yaw, flags = yaw_angle(model, beta, mu, rate, radius)
    vx, vy = v[0] - EARTH_RATE_RAD_S * r[1], v[1] + EARTH_RATE_RAD_S * r[0]
    nx, ny, nz = cross3(r[0], r[1], r[2], vx, vy, v[2])
    n = sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / n, ny / n, nz / n
    zx, zy, zz = -r[0] / radius, -r[1] / radius, -r[2] / radius
    tx, ty, tz = cross3(zx, zy, zz, nx, ny, nz)  # along the track
    s, c = sincos(yaw)
    # About z from along-track: the next direction is against the orbit's normal.
    axes[0, 0] = c * tx - s * nx
    axes[0, 1] = c * ty - s * ny
    axes[0, 2] = c * tz - s * nz
    axes[1, 0] = -s * tx - c * nx
    axes[1, 1] = -s * ty - c * ny
    axes[1, 2] = -s * tz - c * nz
    axes[2, 0], axes[2, 1], axes[2, 2] = zx, zy, zz
    return flags
