"""Deterministic trigonometric functions; use them through `replay.kernels.elementary`.

The polynomials are those of fdlibm (Sun Microsystems, 1993: k_sin.c, k_cos.c); what surrounds them
is different. Both are always evaluated and one is selected, since that costs less than a branch
predicted wrongly; and tan is a quotient with its remainder, which keeps it within one ulp.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from replay.kernels._bits import (
    ROUND_MAGIC,
    carry_out,
    float_bits,
    from_bits,
    mul_high,
    quotient_tail,
    shift_right,
    split_high,
    two_product,
    two_sum,
)
from replay.kernels._tables import (
    PIO2_1,
    PIO2_2,
    PIO2_2T,
    PIO2_3,
    PIO2_3T,
    PIO2_HI,
    PIO2_LO,
    TWO_OVER_PI,
    TWO_OVER_PI_WORDS,
)

#: Cody-Waite holds to 2**20 quarter turns; see `_quadrant`.
_CODY_WAITE_LIMIT = 1647099.0

_LOW_WORD = 0xFFFFFFFF
_TWO_M32 = 1.0 / 4294967296.0
_TWO_M64 = _TWO_M32 * _TWO_M32
_TWO_M96 = _TWO_M64 * _TWO_M32
_TWO_M128 = _TWO_M64 * _TWO_M64


@njit(cache=True, error_model="numpy")
def _quadrant_huge(x: float) -> tuple[int, float, float]:
    """Reduce |x| >= 2**20 by Payne and Hanek's method; see `_quadrant`.

    x = m 2**e with a 53-bit m. Bits of 2/pi whose product with x is a multiple of 4 do not matter,
    so 192 bits of it, from there on, give the quadrant and 126 bits of the fraction, of which at
    most 62 can be zeros.
    """
    bits = float_bits(x)
    exponent = (bits >> 52 & 0x7FF) - 1075
    m = (bits & 0xFFFFFFFFFFFFF) | 0x10000000000000
    word = (exponent + 62) >> 6
    up = (exponent + 62) & 63
    down = 63 - up
    t0 = TWO_OVER_PI_WORDS[word]
    t1 = TWO_OVER_PI_WORDS[word + 1]
    t2 = TWO_OVER_PI_WORDS[word + 2]
    t3 = TWO_OVER_PI_WORDS[word + 3]
    # Two shifts, because one by 64 is undefined.
    w2 = t0 << up | shift_right(shift_right(t1, 1), down)
    w1 = t1 << up | shift_right(shift_right(t2, 1), down)
    w0 = t2 << up | shift_right(shift_right(t3, 1), down)
    # The upper 128 of the lower 192 bits of m * w.
    low_addend = mul_high(m, w0)
    low = m * w1 + low_addend
    high = m * w2 + mul_high(m, w1) + carry_out(low, low_addend)
    n = shift_right(high, 62)
    high = high << 2 | shift_right(low, 62)
    low = low << 2
    # Read as signed, the fraction lies in [-1/2, 1/2) and n is the nearest integer.
    n += shift_right(high, 63)
    # Exact floats of 32 bits each; the first carries the sign.
    a = float(high >> 32) * _TWO_M32
    b = float(high & _LOW_WORD) * _TWO_M64
    c = float(shift_right(low, 32)) * _TWO_M96
    d = float(low & _LOW_WORD) * _TWO_M128
    s, s_err = two_sum(a, b)
    t, t_err = two_sum(c, d)
    f, f_err = two_sum(s, t)
    f_err += s_err + t_err
    y, y_err = two_product(f, PIO2_HI)
    y_err += f * PIO2_LO + f_err * PIO2_HI
    y0 = y + y_err
    y1 = (y - y0) + y_err
    if bits < 0:
        return -n, -y0, -y1
    return n, y0, y1


@njit(cache=True, error_model="numpy")
def _quadrant(x: float) -> tuple[int, float, float]:
    """Return n (two low bits valid) and y0 + y1 = x - n pi/2, within pi/4 or very little more.

    x must be finite.

    Cody and Waite's method with pi/2 in three parts of 33, 33 and 53 bits, the first two products
    and the first difference being exact, and with four where more than 26 bits cancel.
    """
    if not abs(x) < _CODY_WAITE_LIMIT:
        return _quadrant_huge(x)
    shifted = x * TWO_OVER_PI + ROUND_MAGIC
    n = float_bits(shifted)
    fn = shifted - ROUND_MAGIC
    t, t_err = two_sum(x - fn * PIO2_1, -(fn * PIO2_2))
    if abs(t) > 1.0e-8 or fn == 0.0:
        w = fn * PIO2_2T - t_err
        y0 = t - w
        return n, y0, (t - y0) - w
    t, u_err = two_sum(t, -(fn * PIO2_3))
    w = fn * PIO2_3T - (t_err + u_err)
    y0 = t - w
    return n, y0, (t - y0) - w


@njit(cache=True, error_model="numpy")
def _sine_tail(y0: float, y1: float, z: float) -> float:
    """Return sin(y0 + y1) - y0 for |y0| <= pi/4, z = y0 y0."""
    z2 = z * z
    p = (8.33333333332248946124e-03 + z * -1.98412698298579493134e-04) + z2 * (
        (2.75573137070700676789e-06 + z * -2.50507602534068634195e-08)
        + z2 * 1.58969099521155010221e-10
    )
    v = z * y0
    # Kept as a difference so that a zero keeps its sign.
    return -((z * (0.5 * y1 - v * p) - y1) - v * -1.66666666666666324348e-01)


@njit(cache=True, error_model="numpy")
def _cosine_tail(y0: float, y1: float, z: float) -> float:
    """Return cos(y0 + y1) - 1 + z/2 for |y0| <= pi/4, z = y0 y0."""
    z2 = z * z
    p = (
        4.16666666666666019037e-02
        + z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05)
    ) + (z2 * z) * (
        -2.75573143513906633035e-07
        + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    )
    return z2 * p - y0 * y1


@njit(cache=True, error_model="numpy")
def _sine_cosine(y0: float, y1: float) -> tuple[float, float]:
    """Return sin and cos of y0 + y1, |y0| <= pi/4."""
    z = y0 * y0
    half = 0.5 * z
    w = 1.0 - half
    return (
        y0 + _sine_tail(y0, y1, z),
        w + (((1.0 - w) - half) + _cosine_tail(y0, y1, z)),
    )


@njit(cache=True, error_model="numpy")
def _negate_if(x: float, quadrant: int) -> float:
    """Return -x if `quadrant` has bit 1 set (the lower half of the circle), else x."""
    return from_bits(float_bits(x) ^ ((quadrant & 2) << 62))


@njit(cache=True, error_model="numpy")
def sin(x: float) -> float:
    """Return the sine of `x`.

    Parameters
    ----------
    x : float64, rad
        Any; infinities give NaN.

    Returns
    -------
    float64, -1 to 1
    """
    x = np.float64(x)
    if not abs(x) < np.inf:
        return np.nan
    n, y0, y1 = _quadrant(x)
    s, c = _sine_cosine(y0, y1)
    return _negate_if(c if n & 1 else s, n)


@njit(cache=True, error_model="numpy")
def cos(x: float) -> float:
    """Return the cosine of `x`.

    Parameters
    ----------
    x : float64, rad
        Any; infinities give NaN.

    Returns
    -------
    float64, -1 to 1
    """
    x = np.float64(x)
    if not abs(x) < np.inf:
        return np.nan
    n, y0, y1 = _quadrant(x)
    s, c = _sine_cosine(y0, y1)
    return _negate_if(s if n & 1 else c, n + 1)


@njit(cache=True, error_model="numpy")
def sincos(x: float) -> tuple[float, float]:
    """Return the sine and cosine of `x`, bit for bit those of `sin` and `cos`.

    Parameters
    ----------
    x : float64, rad
        Any; infinities give NaN.

    Returns
    -------
    tuple of two float64, -1 to 1
    """
    x = np.float64(x)
    if not abs(x) < np.inf:
        return np.nan, np.nan
    n, y0, y1 = _quadrant(x)
    s, c = _sine_cosine(y0, y1)
    if n & 1:
        s, c = c, s
    return _negate_if(s, n), _negate_if(c, n + 1)


@njit(cache=True, error_model="numpy")
def tan(x: float) -> float:
    """Return the tangent of `x`.

    The quotient of sine and cosine, each with its rounding error, and with the quotient's own
    remainder.

    Parameters
    ----------
    x : float64, rad
        Any; infinities give NaN.

    Returns
    -------
    float64
    """
    x = np.float64(x)
    if abs(x) < 1.0e-9:
        return x  # also keeps the sign of zero
    if not abs(x) < np.inf:
        return np.nan
    n, y0, y1 = _quadrant(x)
    z = y0 * y0
    yh = split_high(y0)
    yl = y0 - yh
    z_err = ((yh * yh - z) + 2.0 * yh * yl) + yl * yl
    tail = _sine_tail(y0, y1, z)
    s = y0 + tail
    s_err = (y0 - s) + tail
    half = 0.5 * z
    w = 1.0 - half
    tail = ((1.0 - w) - half) + (_cosine_tail(y0, y1, z) - 0.5 * z_err)
    c = w + tail
    c_err = (w - c) + tail
    if n & 1:
        s, s_err, c, c_err = -c, -c_err, s, s_err
    recip = 1.0 / c
    q = s / c
    return q + (quotient_tail(s, q, c, recip) + (s_err - q * c_err) * recip)
