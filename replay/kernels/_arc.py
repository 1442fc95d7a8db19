"""Deterministic inverse trigonometric functions; use `replay.kernels.elementary`.

The polynomial for atan and the rational function for asin are those of fdlibm (Sun Microsystems,
1993: s_atan.c, e_asin.c); what surrounds them is different. Remainders of quotients and roots that
fdlibm drops are carried, which keeps atan2 within one ulp, and intervals are selected by arithmetic
where a branch would often be predicted wrongly.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from replay.kernels._bits import (
    float_bits,
    from_bits,
    power_of_two,
    quotient_tail,
    shift_right,
    split_high,
    square_root,
    two_sum,
)
from replay.kernels._tables import (
    ATAN_BASE_HI,
    ATAN_BASE_LO,
    PI_HI,
    PI_LO,
    PIO2_HI,
    PIO2_LO,
)

_SIGN_BIT = -(1 << 63)


@njit(cache=True, error_model="numpy")
def _atan_reduced(t: float) -> float:
    """Return t - atan(t) for |t| <= 7/16."""
    z = t * t
    w = z * z
    even = 3.33333333333329318027e-01 + w * (
        (1.42857142725034663711e-01 + w * 9.09088713343650656196e-02)
        + (w * w)
        * (
            6.66107313738753120669e-02
            + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)
        )
    )
    odd = (-1.99999999998764832476e-01 + w * -1.11111104054623557880e-01) + (w * w) * (
        -7.69187620504482999495e-02
        + w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02)
    )
    return t * (z * even + w * odd)


@njit(cache=True, error_model="numpy")
def _atan_fraction(u: float, v: float) -> tuple[int, float, float]:
    """Return c, num, den with atan(u/v) = atan(c/2) + atan(num/den) for 0 <= u <= v.

    Both terms of `num` are within a factor 2 of each other, so it is exact; |num/den| <= 7/16.
    Without branches, which would often be predicted wrongly.
    """
    c = int(16.0 * u >= 7.0 * v) + int(16.0 * u >= 11.0 * v)
    half = 0.5 * float(c)
    return c, u - half * v, v + half * u


@njit(cache=True, error_model="numpy")
def atan(x: float) -> float:
    """Return the arctangent of `x`.

    Parameters
    ----------
    x : float64, 1
        Any.

    Returns
    -------
    float64, rad, -pi/2 to pi/2
    """
    x = np.float64(x)
    a = abs(x)
    if not a < 1.0e18:
        if x != x:
            return np.nan
        return from_bits(float_bits(PIO2_HI) | (float_bits(x) & _SIGN_BIT))
    swapped = int(a > 1.0)
    base, num, den = _atan_fraction(1.0 if a > 1.0 else a, a if a > 1.0 else 1.0)
    base += 3 * swapped
    t = from_bits(float_bits(num / den) ^ (swapped << 63))
    angle = ATAN_BASE_HI[base] + (t - (_atan_reduced(t) - ATAN_BASE_LO[base]))
    return from_bits(float_bits(angle) | (float_bits(x) & _SIGN_BIT))


@njit(cache=True, error_model="numpy")
def atan2(y: float, x: float) -> float:
    """Return the angle of the point (`x`, `y`).

    Signed zeros and infinities are as in C99 Annex F.9.1.4: the sign is that of `y` (zero
    included), a negative or minus zero `x` gives more than a quarter turn, and infinities count
    as equal.

    Parameters
    ----------
    y, x : float64, any common unit
        Any.

    Returns
    -------
    float64, rad, -pi to pi
    """
    y = np.float64(y)
    x = np.float64(x)
    u: float = abs(y)
    v: float = abs(x)
    swapped = int(u > v)
    negative = shift_right(float_bits(x), 63)
    base = 3 * swapped + 6 * negative
    sign = (swapped ^ negative) << 63
    u, v = (v, u) if u > v else (u, v)
    if not 1.0e-240 < v < 1.0e300:
        if x != x or y != y:
            return np.nan
        if v == np.inf:
            u = 1.0 if u == np.inf else 0.0
            v = 1.0
        elif v == 0.0:
            v = 1.0
        else:
            # Away from overflow and from subnormal remainders.
            scale = power_of_two(-200) if v > 1.0 else power_of_two(700)
            u *= scale
            v *= scale
    c, num, den = _atan_fraction(u, v)
    base += c
    recip = 1.0 / den
    t = num / den
    # The quotient's remainder: otherwise its rounding alone could be a whole ulp of the result.
    # Below 1e-18 it would underflow, and does not matter.
    t_err = quotient_tail(num, t, den, recip) if abs(t) > 1.0e-18 else 0.0
    part = t - (_atan_reduced(t) - t_err)
    part = from_bits(float_bits(part) ^ sign)
    angle = ATAN_BASE_HI[base] + (part + ATAN_BASE_LO[base])
    return from_bits(float_bits(angle) | (float_bits(y) & _SIGN_BIT))


@njit(cache=True, error_model="numpy")
def _asin_ratio(z: float) -> float:
    """Return asin(s)/s - 1 for z = s s <= 1/4."""
    z2 = z * z
    p = (1.66666666666666657415e-01 + z * -3.25565818622400915405e-01) + z2 * (
        (2.01212532134862925881e-01 + z * -4.00555345006794114027e-02)
        + z2 * (7.91534994289814532176e-04 + z * 3.47933107596021167570e-05)
    )
    q = (1.0 + z * -2.40339491173441421878e00) + z2 * (
        (2.02094576023350569471e00 + z * -6.88283971605453293030e-01)
        + z2 * 7.70381505559019352791e-02
    )
    return z * p / q


@njit(cache=True, error_model="numpy")
def _half_angle(a: float) -> tuple[float, float]:
    """Return s and e with asin(sqrt((1-a)/2)) = s + e, s rounded and e small, 1/2 <= a <= 1."""
    z = 0.5 * (1.0 - a)
    s = square_root(z)
    if s == 0.0:
        return 0.0, 0.0
    sh = split_high(s)
    sl = s - sh
    s_err = (((z - sh * sh) - 2.0 * sh * sl) - sl * sl) / (s + s)
    return s, s_err + s * _asin_ratio(z)


@njit(cache=True, error_model="numpy")
def asin(x: float) -> float:
    """Return the arcsine of `x`.

    Parameters
    ----------
    x : float64, 1
        -1 to 1; others give NaN.

    Returns
    -------
    float64, rad, -pi/2 to pi/2
    """
    x = np.float64(x)
    a = abs(x)
    if a < 0.5:
        return x + x * _asin_ratio(x * x)
    if not a <= 1.0:
        return np.nan
    s, e = _half_angle(a)
    high, low = two_sum(PIO2_HI, -2.0 * s)
    angle = high + (low + (PIO2_LO - 2.0 * e))
    return from_bits(float_bits(angle) | (float_bits(x) & _SIGN_BIT))


@njit(cache=True, error_model="numpy")
def acos(x: float) -> float:
    """Return the arccosine of `x`.

    Parameters
    ----------
    x : float64, 1
        -1 to 1; others give NaN.

    Returns
    -------
    float64, rad, 0 to pi
    """
    x = np.float64(x)
    a = abs(x)
    if a < 0.5:
        high, low = two_sum(PIO2_HI, -x)
        return high + (low + (PIO2_LO - x * _asin_ratio(x * x)))
    if not a <= 1.0:
        return np.nan
    s, e = _half_angle(a)
    if x > 0.0:
        return 2.0 * (s + e)
    high, low = two_sum(PI_HI, -2.0 * s)
    return high + (low + (PI_LO - 2.0 * e))
