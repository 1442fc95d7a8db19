"""Integer ambiguities: decorrelation of their covariance, success rates and test statistics.

The float ambiguities have the covariance Q = L' D L, `L` being unit lower triangular and `D`
diagonal, so that D[i] is the variance of ambiguity i given those after it. The Z-transform
z = Z' a, `Z` being integer with determinant +1 or -1, leaves integers integers and makes the
covariance Z' Q Z nearly diagonal, the most precise last. The search is in
:mod:`replay.kernels.ambiguity_search`. All is in cycles.

References
----------
.. [1] P. Teunissen (1995), "The least-squares ambiguity decorrelation adjustment".
.. [2] P. de Jonge, C. Tiberius (1996), "The LAMBDA method for integer ambiguity estimation:
   implementation aspects", LGR series 12, Delft.
.. [3] X.-W. Chang, X. Yang, T. Zhou (2005), "MLAMBDA: a modified LAMBDA method for integer
   least-squares estimation", J. Geodesy 79.
.. [4] P. Teunissen (1998), "Success probability of integer GPS ambiguity rounding and
   bootstrapping", J. Geodesy 72; P. Teunissen, D. Odijk (1997), "Ambiguity dilution of precision".
"""

import numpy as np
from numba import njit

from replay.kernels._bits import ROUND_MAGIC
from replay.kernels.distributions import PI, chi2_cdf, erf, erfc
from replay.kernels.elementary import exp, log, pow, sqrt
from replay.kernels.types import Array

OK = 0
NOT_POSITIVE_DEFINITE = 1
OUT_OF_RANGE = 2
SEARCH_LIMIT = 3
NO_SUBSET = 4

#: Largest entry of `Z` and of its inverse. With :data:`FLOAT_LIMIT` and :data:`COUNT_LIMIT` every
#: sum of 64 products stays below 2**62, so that integers are exact.
ENTRY_LIMIT = 16777216.0
#: Largest float ambiguity.
FLOAT_LIMIT = 2147483648.0
#: Most ambiguities at once.
COUNT_LIMIT = 64

#: A conditional variance below this part of the variance (times n) is rounding error.
_SINGULAR = 4.44e-16
#: Neighbours change places only for a gain above rounding error, so that the loop ends.
_SWAP = 1.0 - 1e-9

#: Entries that no permutation asks about are reduced only where they exceed this.
_LAZY = 4.0

_SQRT_8 = 2.8284271247461903


@njit(cache=True)
def nearest(x: float) -> float:
    """Nearest integer, halves to even; for magnitudes below 2**51."""
    return (x + ROUND_MAGIC) - ROUND_MAGIC


# ------------------------------------------------------------------- factorisation, decorrelation


@njit(cache=True)
def factorise(Q: Array, L: Array, D: Array) -> int:
    """Q = L' D L.

    Parameters
    ----------
    Q : float64 array (n, n)
        The lower triangle is used.
    L : float64 array (n, n)
        Overwritten.
    D : float64 array (n,)
        Overwritten.

    Returns
    -------
    int
        :data:`OK`, or :data:`NOT_POSITIVE_DEFINITE` (also for NaN), `L` and `D` then being of no
        use.
    """
    n = D.shape[0]
    for i in range(n):
        for j in range(n):
            L[i, j] = Q[i, j] if j <= i else 0.0
    for i in range(n - 1, -1, -1):
        d = L[i, i]
        if not d > _SINGULAR * n * Q[i, i] or not d < 1e300:
            return NOT_POSITIVE_DEFINITE
        D[i] = d
        for j in range(i):
            factor = L[i, j] / d
            for k in range(j + 1):
                L[j, k] -= factor * L[i, k]
        for j in range(i):
            L[i, j] /= d
        L[i, i] = 1.0
    return OK


@njit(cache=True)
def _fits(row: Array) -> bool:
    """Whether all entries are within :data:`ENTRY_LIMIT`."""
    outside = 0
    for value in row:
        outside |= int(abs(value) > ENTRY_LIMIT)
    return outside == 0


@njit(cache=True)
def _gauss(U: Array, Z: Array, inverse: Array, i: int, j: int) -> bool:
    """Take from ambiguity j so many times ambiguity i that U[j, i] is at most a half.

    `U` is L'. The integers are floats, which vectorise; they stay far below 2**53.
    """
    mu = nearest(U[j, i])
    if mu == 0.0:
        return True
    if not -ENTRY_LIMIT <= mu <= ENTRY_LIMIT:
        return False
    ui, uj = U[i, i:], U[j, i:]
    for k in range(ui.shape[0]):
        uj[k] -= mu * ui[k]
    zi, zj, wi, wj = Z[i], Z[j], inverse[i], inverse[j]
    for k in range(zi.shape[0]):
        zj[k] -= mu * zi[k]
    for k in range(wi.shape[0]):
        wi[k] += mu * wj[k]
    return _fits(zj) and _fits(wi)


@njit(cache=True)
def _swap(U: Array, D: Array, Z: Array, inverse: Array, j: int, total: float) -> None:
    """Let ambiguities j and j + 1 change places; `total` is the new D[j + 1]."""
    n = D.shape[0]
    old = U[j, j + 1]
    eta = D[j] / total
    lam = D[j + 1] * old / total
    D[j] = eta * D[j + 1]
    D[j + 1] = total
    for k in range(j):
        a, b = U[k, j], U[k, j + 1]
        U[k, j] = b - old * a
        U[k, j + 1] = eta * a + lam * b
    U[j, j + 1] = lam
    for k in range(j + 2, n):
        value = U[j, k]
        U[j, k] = U[j + 1, k]
        U[j + 1, k] = value
    for k in range(n):
        z, w = Z[j, k], inverse[j, k]
        Z[j, k] = Z[j + 1, k]
        Z[j + 1, k] = z
        inverse[j, k] = inverse[j + 1, k]
        inverse[j + 1, k] = w


@njit(cache=True)
def reduce(L: Array, D: Array, Zt: Array, inverse: Array) -> int:
    """Decorrelate a factorised covariance by integer Gauss steps and permutations.

    The order of the steps is that of MLAMBDA [3]_: a column is reduced only when its permutation
    pays, then only as far as precision needs it, and all are at the end.

    Parameters
    ----------
    L : float64 array (n, n)
    D : float64 array (n,)
        Factors of Q on entry and of Z' Q Z on return.
    Zt : int64 array (n, n)
        Overwritten with Z'.
    inverse : int64 array (n, n)
        Overwritten with the inverse of `Z`: a' = z' inverse.

    Returns
    -------
    int
        :data:`OK` or :data:`OUT_OF_RANGE`.
    """
    n = D.shape[0]
    U = np.empty((n, n))
    Z, W = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            U[j, i] = L[i, j]
        Z[i, i] = 1.0
        W[i, i] = 1.0
    j = n - 2
    while j >= 0:
        rest = U[j, j + 1] - nearest(U[j, j + 1])
        total = D[j] + rest * rest * D[j + 1]
        if total < _SWAP * D[j + 1]:
            for i in range(j + 1, n):
                if (i == j + 1 or abs(U[j, i]) > _LAZY) and not _gauss(U, Z, W, i, j):
                    return OUT_OF_RANGE
            total = D[j] + U[j, j + 1] * U[j, j + 1] * D[j + 1]
            _swap(U, D, Z, W, j, total)
            if j < n - 2:
                j += 1
        else:
            j -= 1
    for j in range(n - 2, -1, -1):
        for i in range(j + 1, n):
            if not _gauss(U, Z, W, i, j):
                return OUT_OF_RANGE
    for i in range(n):
        for j in range(n):
            L[i, j] = U[j, i]
            Zt[i, j] = int(Z[i, j])
            inverse[i, j] = int(W[i, j])
    return OK


# ---------------------------------------------------------------------- success rates, statistics


@njit(cache=True)
def component_success(variance: float) -> float:
    """2 Phi(1 / (2 sigma)) - 1: the probability that rounding one ambiguity finds its integer."""
    return erf(1.0 / (_SQRT_8 * sqrt(variance)))


@njit(cache=True)
def bootstrapped_success(D: Array, first: int) -> float:
    """Probability that bootstrapping finds all integers from `first` on [4]_.

    The product of 2 Phi(1 / (2 sigma)) - 1 over the conditional standard deviations; a lower bound
    for integer least squares.
    """
    value = 1.0
    for i in range(first, D.shape[0]):
        value *= component_success(D[i])
    return value


@njit(cache=True)
def bootstrapped_failure(D: Array, first: int) -> float:
    """One less :func:`bootstrapped_success`, exact to its last digits where it is small."""
    value = 0.0
    for i in range(first, D.shape[0]):
        p = erfc(1.0 / (_SQRT_8 * sqrt(D[i])))
        value += p - value * p
    return value


@njit(cache=True)
def adop(D: Array) -> float:
    """Ambiguity dilution of precision [cycle]: det(Q)^(1/2n), the same for every Z [4]_."""
    total = 0.0
    for i in range(D.shape[0]):
        total += log(D[i])
    return exp(total / (2.0 * D.shape[0]))


@njit(cache=True)
def adop_success(value: float, n: int) -> float:
    """Upper bound of the bootstrapped success of `n` ambiguities from their ADOP [4]_."""
    p = erf(1.0 / (_SQRT_8 * value))
    total = 1.0
    for _ in range(n):
        total *= p
    return total


@njit(cache=True)
def ils_success_bound(value: float, n: int) -> float:
    """Upper bound of the success of integer least squares from the ADOP.

    The pull-in region has the volume one, and no such region holds more probability than the
    ellipsoid: P(chi2(n) < c / ADOP^2) with c = Gamma(n/2 + 1)^(2/n) / pi (Hassibi and Boyd, 1998).
    """
    # Gamma(n/2 + 1), at most 3e35 for 64.
    gamma = 1.0 if n % 2 == 0 else 0.5 * sqrt(PI)
    k = 1.0 if n % 2 == 0 else 1.5
    while k <= 0.5 * n:
        gamma *= k
        k += 1.0
    return chi2_cdf(pow(gamma, 2.0 / n) / (PI * value * value), n)
