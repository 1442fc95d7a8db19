"""Error functions and the chi-square distribution."""

from numba import njit

from replay.kernels._bits import float_bits, from_bits
from replay.kernels.elementary import exp, sqrt

_HIGH_WORD = -(1 << 32)
PI = 3.141592653589793


@njit(cache=True)
def _erf_small(x: float) -> float:
    """(erf(x) - x) / x for magnitudes below 0.84375."""
    z = x * x
    r = -2.37630166566501626084e-05
    r = -5.77027029648944159157e-03 + z * r
    r = -2.84817495755985104766e-02 + z * r
    r = -3.25042107247001499370e-01 + z * r
    r = 1.28379167095512558561e-01 + z * r
    s = -3.96022827877536812320e-06
    s = 1.32494738004321644526e-04 + z * s
    s = 5.08130628187576562776e-03 + z * s
    s = 6.50222499887672944485e-02 + z * s
    s = 3.97917223959155352819e-01 + z * s
    return r / (1.0 + z * s)


@njit(cache=True)
def _erf_middle(x: float) -> float:
    """Value of erf(x) less 0.845062911510467529297, for x from 0.84375 to 1.25."""
    t = x - 1.0
    p = -2.16637559486879084300e-03
    p = 3.54783043256182359371e-02 + t * p
    p = -1.10894694282396677476e-01 + t * p
    p = 3.18346619901161753674e-01 + t * p
    p = -3.72207876035701323847e-01 + t * p
    p = 4.14856118683748331666e-01 + t * p
    p = -2.36211856075265944077e-03 + t * p
    q = 1.19844998467991074170e-02
    q = 1.36370839120290507362e-02 + t * q
    q = 1.26171219808761642112e-01 + t * q
    q = 7.18286544141962662868e-02 + t * q
    q = 5.40397917702171048937e-01 + t * q
    q = 1.06420880400844228286e-01 + t * q
    return p / (1.0 + t * q)


@njit(cache=True)
def _erfc_tail(x: float) -> float:
    """Value of erfc(x) for x from 1.25 to 28."""
    s = 1.0 / (x * x)
    if x < 2.857142857142857:
        p = -9.81432934416914548592e00
        p = -8.12874355063065934246e01 + s * p
        p = -1.84605092906711035994e02 + s * p
        p = -1.62396669462573470355e02 + s * p
        p = -6.23753324503260060396e01 + s * p
        p = -1.05586262253232909814e01 + s * p
        p = -6.93858572707181764372e-01 + s * p
        p = -9.86494403484714822705e-03 + s * p
        q = -6.04244152148580987438e-02
        q = 6.57024977031928170135e00 + s * q
        q = 1.08635005541779435134e02 + s * q
        q = 4.29008140027567833386e02 + s * q
        q = 6.45387271733267880336e02 + s * q
        q = 4.34565877475229228821e02 + s * q
        q = 1.37657754143519042600e02 + s * q
        q = 1.96512716674392571292e01 + s * q
    else:
        p = -4.83519191608651397019e02
        p = -1.02509513161107724954e03 + s * p
        p = -6.37566443368389627722e02 + s * p
        p = -1.60636384855821916062e02 + s * p
        p = -1.77579549177547519889e01 + s * p
        p = -7.99283237680523006574e-01 + s * p
        p = -9.86494292470009928597e-03 + s * p
        q = -2.24409524465858183362e01
        q = 4.74528541206955367215e02 + s * q
        q = 2.55305040643316442583e03 + s * q
        q = 3.19985821950859553908e03 + s * q
        q = 1.53672958608443695994e03 + s * q
        q = 3.25792512996573918826e02 + s * q
        q = 3.03380607434824582924e01 + s * q
    ratio = p / (1.0 + s * q)
    z = from_bits(float_bits(x) & _HIGH_WORD)
    return exp(-z * z - 0.5625) * exp((z - x) * (z + x) + ratio) / x


@njit(cache=True)
def erf(x: float) -> float:
    """Error function; off by less than 1 ulp (0.75 found), NaN for NaN."""
    y = -x if x < 0.0 else x
    if y < 0.84375:
        return x + x * _erf_small(x)
    if y < 1.25:
        value = 0.845062911510467529297 + _erf_middle(y)
    elif y < 6.0:
        value = 1.0 - _erfc_tail(y)
    elif y >= 6.0:
        value = 1.0
    else:
        return y
    return -value if x < 0.0 else value


@njit(cache=True)
def erfc(x: float) -> float:
    """One less the error function; off by less than 3 ulp (2.3 found) where not subnormal."""
    if x < -0.84375:
        return 1.0 + erf(-x)
    if x < 0.25:
        return 1.0 - (x + x * _erf_small(x))
    if x < 0.84375:
        return 0.5 - (x - 0.5 + x * _erf_small(x))
    if x < 1.25:
        return 1.0 - 0.845062911510467529297 - _erf_middle(x)
    if x < 28.0:
        return _erfc_tail(x)
    return 0.0 if x >= 28.0 else x


@njit(cache=True)
def chi2_cdf(x: float, n: int) -> float:
    """Probability that chi-square of `n` degrees of freedom is below `x`; within 1e-14.

    The closed sums for even and odd `n` (Abramowitz and Stegun, 26.4.4 and 26.4.5).
    """
    if not x > 0.0:
        return 0.0
    half = 0.5 * x
    tail = 0.0
    if n % 2 == 0:
        term = exp(-half)
        for k in range(n // 2):
            tail += term
            term *= half / (k + 1.0)
    else:
        tail = erfc(sqrt(half))
        # exp(-x/2) (x/2)^(k + 1/2) / Gamma(k + 3/2)
        term = exp(-half) * sqrt(half) * 2.0 / sqrt(PI)
        for k in range(n // 2):
            tail += term
            term *= half / (k + 1.5)
    return 1.0 - tail if tail < 1.0 else 0.0
