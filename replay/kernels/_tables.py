"""Constants and tables of the elementary functions, worked out in integers.

Each number is a truncated or correctly rounded value of a real number that is known here to 1280
bits. They are computed when the module is imported (a few milliseconds) with Python's unbounded
integers alone, so the tables are the same on every machine and there are no digits to mistype.
"""

from __future__ import annotations

from math import isqrt

import numpy as np
from numpy.typing import NDArray

#: Fractional bits of the fixed-point numbers below. 2/pi is needed to 1 216 bits (Payne-Hanek).
_BITS = 1280
_ONE = 1 << _BITS


def _atan_inverse(n: int) -> int:
    """Return atan(1/n) in fixed point by its Taylor series (n >= 2)."""
    total, power, k = 0, _ONE // n, 1
    while power:
        total += power // k if k % 4 == 1 else -(power // k)
        power //= n * n
        k += 2
    return total


def _log_ratio(num: int, den: int) -> int:
    """Return log(num/den) in fixed point as 2 atanh((num-den)/(num+den)), to about 140 bits."""
    one = 1 << 160
    step = one * (num - den) // (num + den)
    square = step * step >> 160
    total, power, k = 0, step, 1
    while power not in (0, -1):  # a negative power shifts down to -1, not to 0
        total += power // k
        power = power * square >> 160
        k += 2
    return 2 * total << (_BITS - 160)


def _to_float(value: int) -> float:
    """Round a fixed-point number to the nearest float64 (integer true division is exact)."""
    return value / _ONE


def _truncate(value: int, lsb: int) -> int:
    """Round a fixed-point number to the nearest multiple of 2**lsb."""
    unit = 1 << (_BITS + lsb)
    return (value + unit // 2) // unit * unit


def _pieces(value: int, *lsbs: int) -> list[float]:
    """Split into multiples of 2**lsb for each lsb, then the rest: a sum of short floats."""
    out = []
    for lsb in lsbs:
        part = _truncate(value, lsb)
        out.append(_to_float(part))
        value -= part
    return [*out, _to_float(value)]


def _double_double(value: int) -> tuple[float, float]:
    """Return the nearest float64 and the nearest float64 to what it lacks."""
    high = _to_float(value)
    numerator, denominator = high.as_integer_ratio()
    return high, _to_float(value - numerator * _ONE // denominator)


_PI = 4 * (4 * _atan_inverse(5) - _atan_inverse(239))  # Machin
_LN2 = _log_ratio(2, 1)

# ---- trigonometric -------------------------------------------------------------------------------

TWO_OVER_PI = _to_float(2 * _ONE * _ONE // _PI)
PIO2_HI, PIO2_LO = _double_double(_PI // 2)
PI_HI, PI_LO = _double_double(_PI)

# pi/2 in parts of 33 bits, whose products with integers up to 2**20 are exact; each ..T is the
# float64 nearest to all that the parts before it lack.
PIO2_1, PIO2_2, PIO2_2T = _pieces(_PI // 2, -32, -65)
PIO2_3, PIO2_3T = _pieces(_PI // 2, -32, -65, -98)[2:]


def _payne_hanek_words() -> NDArray[np.int64]:
    """Return 64 zero bits and the first 1 216 fractional bits of 2/pi, as 20 words."""
    fraction = 2 * _ONE * _ONE // _PI >> (_BITS - 1216)
    words = [fraction >> (1216 - 64 * i) & (2**64 - 1) for i in range(20)]
    return np.array(words, dtype=np.uint64).view(np.int64)


TWO_OVER_PI_WORDS = _payne_hanek_words()


def _atan_bases() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the angles that atan2 adds to a reduced arctangent, as high and low parts.

    Index: breakpoint (0, 1/2, 1) + 3 if |y| > |x| + 6 if x is negative.
    """
    angles = [0, _atan_inverse(2), _PI // 4]
    angles += [_PI // 2 - a for a in angles]
    angles += [_PI - a for a in angles]
    pairs = [_double_double(a) for a in angles]
    return np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])


ATAN_BASE_HI, ATAN_BASE_LO = _atan_bases()

# ---- exponential ---------------------------------------------------------------------------------

#: log2 of the number of entries of both the exponential's and the logarithm's tables.
TABLE_BITS = 7
_ENTRIES = 1 << TABLE_BITS

STEPS_PER_UNIT = _to_float(_ENTRIES * _ONE * _ONE // _LN2)
# ln2/128 so that multiples of the high part by integers below 2**18 are exact.
LN2_STEP_HI, LN2_STEP_LO = _pieces(_LN2 // _ENTRIES, -42)


def _exp_tables() -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the patterns of T = 2**(i/128) as float64 and the relative errors of those."""
    base = 2 * _ONE
    for _ in range(TABLE_BITS):
        base = isqrt(base << _BITS)
    bits, tail, power = [], [], _ONE
    for _ in range(_ENTRIES):
        high, low = _double_double(power)
        bits.append(int(np.float64(high).view(np.int64)))
        tail.append(low / high)
        power = power * base >> _BITS
    return np.array(bits, dtype=np.int64), np.array(tail)


EXP_BITS, EXP_TAIL = _exp_tables()

# ---- logarithm -----------------------------------------------------------------------------------

# ln2 so that multiples of the high part by integers below 2**11 are exact.
LN2_HI, LN2_LO = _pieces(_LN2, -42)

#: Significands are taken from [0.6875, 1.375), so that 1 is well inside and no cancellation can
#: happen between k*ln2 and the rest.
LOG_OFFSET = 0x3FE6000000000000


def _log_tables() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return R, about 1/c at 128 centres c, and -log(R) as high and low parts.

    R has 21 bits so that its product with half a significand is exact. The two intervals that
    meet at 1 have R = 1, which makes the logarithm accurate close to 1.
    """
    recip, high, low = [], [], []
    for i in range(_ENTRIES):
        ends = np.array(
            [LOG_OFFSET + (i << 52 - TABLE_BITS), LOG_OFFSET + (i + 1 << 52 - TABLE_BITS)]
        ).view(np.float64)
        lower, upper = (int(e * 2**10) for e in ends)
        scaled = 2**20 if 2**10 in (lower, upper) else round(2**31 / (lower + upper))
        hi, lo = _pieces(_log_ratio(2**20, scaled), -42)
        recip.append(scaled / 2**20)
        high.append(hi)
        low.append(lo)
    return np.array(recip), np.array(high), np.array(low)


LOG_RECIP, LOG_HI, LOG_LO = _log_tables()
