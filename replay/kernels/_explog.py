"""Deterministic exponentials, logarithms and powers; use `replay.kernels.elementary`.

Table-driven after Tang (ACM TOMS 15, 1989, and 16, 1990): 2**(i/128) and log(c) at 128 points each
leave arguments so small that short Taylor series suffice and only the last addition rounds
noticeably. The tables are worked out in `replay.kernels._tables`. Nothing here divides.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from replay.kernels._bits import (
    ROUND_MAGIC,
    float_bits,
    from_bits,
    power_of_two,
    split_high,
    square_root,
    two_product,
    two_sum,
)
from replay.kernels._tables import (
    EXP_BITS,
    EXP_TAIL,
    LN2_HI,
    LN2_LO,
    LN2_STEP_HI,
    LN2_STEP_LO,
    LOG_HI,
    LOG_LO,
    LOG_OFFSET,
    LOG_RECIP,
    STEPS_PER_UNIT,
    TABLE_BITS,
)

_TABLE_MASK = (1 << TABLE_BITS) - 1
_INDEX_SHIFT = 52 - TABLE_BITS
_EXPONENT_MASK = -(1 << 52)
_MIN_NORMAL = 2.2250738585072014e-308
#: Beyond these exp overflows, and rounds to zero.
_EXP_MAX = 709.782712893384
_EXP_MIN = -745.1332191019412


@njit(cache=True, error_model="numpy")
def _exp_reduced(x: float, x_err: float) -> tuple[int, float]:
    """Return k and p with exp(x + x_err) = 2**(k/128) (1 + p), p relative to the table's entry."""
    shifted = x * STEPS_PER_UNIT + ROUND_MAGIC
    fk = shifted - ROUND_MAGIC
    k = float_bits(shifted) - float_bits(ROUND_MAGIC)
    r = ((x - fk * LN2_STEP_HI) - fk * LN2_STEP_LO) + x_err
    r2 = r * r
    series = r2 * (0.5 + r * (1.0 / 6.0)) + (r2 * r2) * (1.0 / 24.0 + r * (1.0 / 120.0))
    return k, r + (EXP_TAIL[k & _TABLE_MASK] + series)


@njit(cache=True, error_model="numpy")
def _exp_extreme(x: float, x_err: float) -> float:
    """Return exp(x + x_err) where it overflows, is subnormal or nearly either."""
    if x != x:
        return np.nan
    if x > _EXP_MAX + 1.0:
        return np.inf
    if x < _EXP_MIN - 1.0:
        return 0.0
    k, p = _exp_reduced(x, x_err)
    scale = from_bits(EXP_BITS[k & _TABLE_MASK])
    exponent = k >> TABLE_BITS
    half = exponent >> 1
    # The last product is the only one that can round or overflow.
    return (scale + scale * p) * power_of_two(half) * power_of_two(exponent - half)


@njit(cache=True, error_model="numpy")
def _exp_sum(x: float, x_err: float) -> float:
    """Return exp(x + x_err); x_err is less than an ulp of x or so."""
    if not abs(x) < 700.0:  # so that even scale * p below is a normal number
        return _exp_extreme(x, x_err)
    k, p = _exp_reduced(x, x_err)
    scale = from_bits(EXP_BITS[k & _TABLE_MASK] + ((k >> TABLE_BITS) << 52))
    return scale + scale * p


@njit(cache=True, error_model="numpy")
def exp(x: float) -> float:
    """Return e**`x`: infinity above 709.78, subnormal below -708.39.

    Parameters
    ----------
    x : float64, 1
        Any.

    Returns
    -------
    float64, 0 and above
    """
    return _exp_sum(np.float64(x), 0.0)


@njit(cache=True, error_model="numpy")
def expm1(x: float) -> float:
    """Return e**`x` - 1, accurate for small `x` too; -1 at -inf.

    Parameters
    ----------
    x : float64, 1
        Any.

    Returns
    -------
    float64, -1 and above
    """
    x = np.float64(x)
    if abs(x) < 1.0e-17:
        return x  # also keeps the sign of zero
    if not abs(x) < 700.0:
        return _exp_extreme(x, 0.0) - 1.0 if x == x else np.nan
    shifted = x * STEPS_PER_UNIT + ROUND_MAGIC
    fk = shifted - ROUND_MAGIC
    k = float_bits(shifted) - float_bits(ROUND_MAGIC)
    r_hi = x - fk * LN2_STEP_HI
    r_lo = fk * LN2_STEP_LO
    r = r_hi - r_lo
    r_err = (r_hi - r) - r_lo
    r2 = r * r
    # One term more than exp needs: what is left out counts against r here, and against 1 there.
    series = r2 * (0.5 + r * (1.0 / 6.0)) + (r2 * r2) * (
        (1.0 / 24.0 + r * (1.0 / 120.0)) + r2 * (1.0 / 720.0)
    )
    scale = from_bits(EXP_BITS[k & _TABLE_MASK] + ((k >> TABLE_BITS) << 52))
    # scale (1 + r + rest) - 1 as (scale - 1) + r + (scale - 1) r + scale rest: where the scale is
    # near 1 all but the first two terms are small, and where it is not, the first is large.
    high, high_err = two_sum(scale, -1.0)
    s, s_err = two_sum(high, r)
    rest: float = scale * (series + (r_err + EXP_TAIL[k & _TABLE_MASK] * (1.0 + r)))
    return s + ((s_err + high_err) + (high * r + rest))


@njit(cache=True, error_model="numpy")
def _log_reduced(bits: int, extra: float, add: bool) -> tuple[float, float, float, float]:
    """Reduce log(x), or if `add` is true log(x + extra), for the positive, normal x of `bits`.

    Returns w, w_err, r, r_err such that the logarithm is w + w_err + log(1 + r + r_err). |r| is
    below 1/127; w is zero or larger than 1.5 |r|, and with w_err exact to about 2**-95. `extra` is
    less than an ulp of x. `add` is a constant in every caller, so that no branch remains.
    """
    offset = bits - LOG_OFFSET
    i = offset >> _INDEX_SHIFT & _TABLE_MASK
    exponent = offset & _EXPONENT_MASK
    k = float(exponent >> 52)
    recip = LOG_RECIP[i]
    z = from_bits(bits - exponent)
    # Both products are exact, recip having 21 bits, and so is the difference.
    zh = split_high(z)
    a = zh * recip - 1.0
    b = (z - zh) * recip
    r = a + b
    r_err = (a - r) + b
    if add:
        # Such an x lies in [0.5, 2**60], so the power of two is normal.
        r, e = two_sum(r, extra * recip * from_bits(float_bits(1.0) - exponent))
        r_err += e
    return k * LN2_HI + LOG_HI[i], k * LN2_LO + LOG_LO[i], r, r_err


@njit(cache=True, error_model="numpy")
def _log_series(r: float) -> float:
    """Return (log(1 + r) - r + r**2/2) / r**3 for |r| < 1/127."""
    r2 = r * r
    return (1.0 / 3.0 - r * 0.25) + r2 * ((0.2 - r * (1.0 / 6.0)) + r2 * (1.0 / 7.0 - r * 0.125))


@njit(cache=True, error_model="numpy")
def _log_normal(bits: int, extra: float, add: bool) -> float:
    """Return log(x), or if `add` is true log(x + extra), for the positive, normal x of `bits`."""
    w, w_err, r, r_err = _log_reduced(bits, extra, add)
    high = w + r
    high_err = (w - high) + r
    r2 = r * r
    series = r2 * r * _log_series(r) - 0.5 * r2
    return high + (high_err + ((w_err + r_err) + series))


@njit(cache=True, error_model="numpy")
def log(x: float) -> float:
    """Return the natural logarithm of `x`; -inf at zero.

    Parameters
    ----------
    x : float64, 1
        0 and above; others give NaN.

    Returns
    -------
    float64
    """
    x = np.float64(x)
    if not _MIN_NORMAL <= x < np.inf:
        if x == 0.0:
            return -np.inf
        if not 0.0 < x < np.inf:
            return x if x > 0.0 else np.nan
        return _log_normal(float_bits(x * 4503599627370496.0) - (52 << 52), 0.0, False)
    return _log_normal(float_bits(x), 0.0, False)


@njit(cache=True, error_model="numpy")
def log1p(x: float) -> float:
    """Return log(1 + `x`), accurate for small `x` too; -inf at -1.

    Parameters
    ----------
    x : float64, 1
        -1 and above; others give NaN.

    Returns
    -------
    float64
    """
    x = np.float64(x)
    if abs(x) < 1.0e-17:
        return x  # also keeps the sign of zero
    if not -1.0 < x < 1.0e18:
        return log(x) if x > 0.0 else log(1.0 + x)
    total, error = two_sum(1.0, x)
    return _log_normal(float_bits(total), error, True)


@njit(cache=True, error_model="numpy")
def _pow_normal(bits: int, y: float) -> float:
    """Return x**y for the positive, normal (or scaled subnormal) x of pattern `bits`, finite y."""
    w, w_err, r, r_err = _log_reduced(bits, 0.0, False)
    # The logarithm to about 2**-66 of itself, since up to 10 bits of the exponent's 53 would be
    # before the point. That takes two terms more than `log` does.
    r2 = r * r
    series = _log_series(r) + (r2 * r2 * r2) * (1.0 / 9.0 - r * 0.1)
    rh = split_high(r)
    rl = r - rh
    r2_err = ((rh * rh - r2) + 2.0 * rh * rl) + rl * rl
    half = 0.5 * r2
    s = w + r
    s_err = (w - s) + r
    t = s - half
    t_err = (s - t) - half
    tail = (r2 * r) * series + ((s_err + t_err) + ((w_err - 0.5 * r2_err) + (r_err - r * r_err)))
    high = t + tail
    low = (t - high) + tail
    product = y * high
    if not abs(product) < 800.0:
        return np.inf if product > 0.0 else 0.0
    product, product_err = two_product(y, high)
    return _exp_sum(product, product_err + y * low)


@njit(cache=True, error_model="numpy")
def _pow_special(x: float, y: float) -> float:
    """Return x**y as C99 Annex F.9.4.4 has it, for any arguments."""
    if y == 0.0 or x == 1.0:
        return 1.0
    if x != x or y != y:
        return np.nan
    a = abs(x)
    if abs(y) == np.inf:
        if a == 1.0:
            return 1.0
        return np.inf if (a > 1.0) == (y > 0.0) else 0.0
    integer = True
    odd = False
    if abs(y) < 9007199254740992.0:
        whole = int(y)
        integer = float(whole) == y
        odd = integer and whole & 1 == 1
    if a == 0.0 or a == np.inf:
        magnitude = np.inf if (a == 0.0) == (y < 0.0) else 0.0
    elif x < 0.0 and not integer:
        return np.nan
    elif a < _MIN_NORMAL:
        magnitude = _pow_normal(float_bits(a * 4503599627370496.0) - (52 << 52), y)
    else:
        magnitude = _pow_normal(float_bits(a), y)
    return -magnitude if odd and float_bits(x) < 0 else magnitude


@njit(cache=True, error_model="numpy")
def pow(x: float, y: float) -> float:
    """Return `x` raised to the power `y`, with C99's values for zeros, infinities and NaN.

    A negative `x` has a power only if `y` is an integer; otherwise the result is NaN.

    Parameters
    ----------
    x, y : float64, 1
        Any; a negative `x` needs an integer `y`.

    Returns
    -------
    float64
    """
    x = np.float64(x)
    y = np.float64(y)
    if _MIN_NORMAL <= x < np.inf and abs(y) < np.inf:
        return _pow_normal(float_bits(x), y)
    return _pow_special(x, y)


@njit(cache=True, error_model="numpy")
def sqrt(x: float) -> float:
    """Return the square root of `x`, correctly rounded (one instruction).

    Parameters
    ----------
    x : float64, any
        0 and above; others give NaN.

    Returns
    -------
    float64, root of the unit
    """
    x = np.float64(x)
    return square_root(x) if x >= 0.0 else np.nan


@njit(cache=True, error_model="numpy")
def hypot(x: float, y: float) -> float:
    """Return the length of (`x`, `y`) without overflow on the way.

    Parameters
    ----------
    x, y : float64, any common unit
        Any.

    Returns
    -------
    float64, same unit, 0 and above
    """
    a = abs(np.float64(x))
    b = abs(np.float64(y))
    if a < b:
        a, b = b, a
    scale = 1.0
    if not (1.0e-140 < a < 1.0e150):
        if x != x or y != y:
            return np.inf if a == np.inf or b == np.inf else np.nan
        if a == 0.0 or a == np.inf:
            return a
        scale = power_of_two(600) if a > 1.0 else power_of_two(-600)
        a /= scale
        b /= scale
    elif x != x or y != y:
        return np.nan
    # One Newton step from the rounded root, on the residual a a + b b - h h taken exactly.
    h = square_root(a * a + b * b)
    aa, aa_err = two_product(a, a)
    bb, bb_err = two_product(b, b)
    hh, hh_err = two_product(h, h)
    residual = ((aa - hh) + bb) + ((aa_err - hh_err) + bb_err)
    return (h + residual / (h + h)) * scale
