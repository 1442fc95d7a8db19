"""Elementary functions that give the same bits on every processor.

libm does not: glibc picks another variant where there is fused multiply-add, and other systems have
other libraries. These use only + - * / and sqrt, which IEEE 754 rounds in one way, comparisons and
operations on the bit pattern, in a written order. All are ``@njit(cache=True)`` scalar functions of
float64 for use in kernels, and can be called from Python. Arguments of other number types are
converted.

============  ==========================================  =====================================
function      largest error found [ulp]                   arguments
============  ==========================================  =====================================
sin           0.77                                        any, near multiples of pi/2 too
cos           0.78                                        any, near multiples of pi/2 too
sincos        as sin, cos (bit for bit)
tan           0.85                                        any, near multiples of pi/2 too
atan          0.81                                        any
atan2         0.80                                        any, subnormal and huge too
asin          0.71                                        -1 to 1
acos          0.65                                        -1 to 1
exp           0.52 (0.75 where the result is subnormal)   any
expm1         0.51                                        any
log           0.52                                        any positive, subnormal too
log1p         0.52                                        above -1
pow           0.52 (0.75 where the result is subnormal)   base > 0, result from 1e-323 to 1.7e308
sqrt          0.50 (correctly rounded)                    0 and more
hypot         0.51 (0.75 where the result is subnormal)   any
============  ==========================================  =====================================

The error is the distance from the exact value (mpmath, 260 bits) in units of the last place of the
binade that the exact value is in; the table has the worst of 1e5 to 4e5 arguments in each of
several ranges for every function, rounded up. 0.5 is the best there can be.

Values for zeros, infinities and NaN follow C99, Annex F, except that floating-point exceptions are
not raised and every NaN returned is the same one (0x7ff8000000000000), since processors differ in
the sign of the NaN that an invalid operation makes and in which of two NaN they propagate.

Sources: polynomials for sin, cos and atan and the rational function for asin from fdlibm (Sun
Microsystems, 1993); exp, log and pow by tables (Tang, ACM TOMS 15:144, 1989, and 16:378, 1990);
reduction of large angles after Payne and Hanek (1983) with 192 bits of 2/pi.
"""

from replay.kernels._arc import acos, asin, atan, atan2
from replay.kernels._explog import exp, expm1, hypot, log, log1p, pow, sqrt
from replay.kernels._trig import cos, sin, sincos, tan

__all__ = [
    "acos",
    "asin",
    "atan",
    "atan2",
    "cos",
    "exp",
    "expm1",
    "hypot",
    "log",
    "log1p",
    "pow",
    "sin",
    "sincos",
    "sqrt",
    "tan",
]
