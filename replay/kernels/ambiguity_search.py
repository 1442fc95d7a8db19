"""Search for the integer vectors nearest to float ambiguities, and what is made of them."""

import numpy as np
from numba import njit

from replay.kernels.ambiguity import (
    COUNT_LIMIT,
    FLOAT_LIMIT,
    NO_SUBSET,
    OK,
    OUT_OF_RANGE,
    SEARCH_LIMIT,
    component_success,
    factorise,
    nearest,
    reduce,
)
from replay.kernels.elementary import log, sincos, sqrt
from replay.kernels.types import Array

#: Largest integer in the decorrelated space.
_Z_LIMIT = 1073741824.0
_INFINITE = np.inf
_TWO_PI = 6.283185307179586


@njit(cache=True)
def quadratic_form(L: Array, D: Array, w: Array, first: int, work: Array) -> float:
    """W' (L' D L)^-1 w for the components from `first` on; `work` (n,) is overwritten."""
    n = D.shape[0]
    total = 0.0
    for k in range(n - 1, first - 1, -1):
        u = float(w[k])
        for i in range(k + 1, n):
            u -= L[i, k] * work[i]
        work[k] = u
        total += u * u / D[k]
    return total


@njit(cache=True)
def search(z: Array, L: Array, D: Array, first: int, limit: int, found: Array, norms: Array) -> int:
    """The integer vectors nearest to `z` in the metric of (L' D L)^-1, nearest first.

    Depth first from the last component, each level in zig-zag from its conditional estimate,
    within an ellipsoid through the worst of the vectors kept, which shrinks (de Jonge and
    Tiberius, 1996; Chang et al., 2005). Of vectors equally far the one found first comes first.

    Parameters
    ----------
    z : float64 array (n,)
    L : float64 array (n, n)
    D : float64 array (n,)
    first : int
        The components from here on take part.
    limit : int
        Most nodes to visit.
    found : float64 array (p, n)
        Overwritten from column `first` on with integers.
    norms : float64 array (p,)
        Overwritten with squared norms.

    Returns
    -------
    int
        :data:`OK`, :data:`OUT_OF_RANGE`, or :data:`SEARCH_LIMIT`, the vectors then being perhaps
        not the nearest and norms infinite where too few were found.
    """
    n = D.shape[0]
    count = norms.shape[0]
    for c in range(count):
        norms[c] = _INFINITE
    for i in range(first, n):
        if not -_Z_LIMIT < z[i] < _Z_LIMIT:
            return OUT_OF_RANGE
    S = np.zeros((n, n))
    weight = np.empty(n)
    centre = np.empty(n)
    trial = np.empty(n)
    step = np.empty(n)
    below = np.zeros(n + 1)
    for i in range(first, n):
        weight[i] = 1.0 / D[i]
        S[n - 1, i] = z[i]
    worst = _INFINITE
    k = n - 1
    centre[k] = z[k]
    trial[k] = nearest(z[k])
    step[k] = 1.0 if centre[k] >= trial[k] else -1.0
    for _ in range(limit):
        y = centre[k] - trial[k]
        total = below[k + 1] + y * y * weight[k]
        if total < worst:
            if k > first:
                below[k] = total
                for i in range(first, k):
                    S[k - 1, i] = S[k, i] - y * L[k, i]
                k -= 1
                centre[k] = S[k, k]
                trial[k] = nearest(centre[k])
                step[k] = 1.0 if centre[k] >= trial[k] else -1.0
                continue
            place = count - 1
            while place > 0 and total < norms[place - 1]:
                norms[place] = norms[place - 1]
                for i in range(first, n):
                    found[place, i] = found[place - 1, i]
                place -= 1
            norms[place] = total
            for i in range(first, n):
                found[place, i] = trial[i]
            worst = norms[count - 1]
        else:
            if k == n - 1:
                return OK
            k += 1
        trial[k] += step[k]
        step[k] = -step[k] - 1.0 if step[k] > 0.0 else -step[k] + 1.0
    return SEARCH_LIMIT


@njit(cache=True)
def _decorrelated(
    a: Array, Q: Array, L: Array, D: Array, Zt: Array, inverse: Array, z: Array
) -> int:
    """Factorise, reduce, and transform the fractions of `a`."""
    n = a.shape[0]
    if n > COUNT_LIMIT:
        return OUT_OF_RANGE
    for i in range(n):
        if not -FLOAT_LIMIT <= a[i] <= FLOAT_LIMIT:
            return OUT_OF_RANGE
    status = factorise(Q, L, D)
    if status == OK:
        status = reduce(L, D, Zt, inverse)
    if status != OK:
        return status
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += Zt[i, j] * (a[j] - nearest(a[j]))
        z[i] = total
    return OK


@njit(cache=True)
def resolve(
    a: Array,
    Q: Array,
    limit: int,
    fixed: Array,
    norms: Array,
    L: Array,
    D: Array,
    Zt: Array,
    inverse: Array,
) -> tuple[int, float]:
    """The integer vectors nearest to float ambiguities.

    Parameters
    ----------
    a : float64 array (n,)
        Float ambiguities [cycle], at most :data:`FLOAT_LIMIT`.
    Q : float64 array (n, n)
        Their covariance [cycle^2]; the lower triangle is used.
    limit : int
        Most nodes of the search to visit.
    fixed : int64 array (p, n)
        Overwritten with the vectors, nearest first.
    norms : float64 array (p,)
        Overwritten with their squared norms.
    L, D, Zt, inverse
        Overwritten as in :func:`replay.kernels.ambiguity.reduce`.

    Returns
    -------
    status : int
    separation : float
        Squared norm of the second less the first; 0 where there is no second.
    """
    n, count = a.shape[0], norms.shape[0]
    z = np.empty(n)
    status = _decorrelated(a, Q, L, D, Zt, inverse, z)
    if status != OK:
        return status, 0.0
    found = np.zeros((count, n))
    status = search(z, L, D, 0, limit, found, norms)
    if status != OK:
        return status, 0.0
    for c in range(count):
        for i in range(n):
            total = int(nearest(a[i]))
            for k in range(n):
                total += int(found[c, k]) * inverse[k, i]
            fixed[c, i] = total
    return OK, _separation(L, D, found, 0, z)


@njit(cache=True)
def _separation(L: Array, D: Array, found: Array, first: int, work: Array) -> float:
    """Squared norm of the second vector less the first."""
    if found.shape[0] < 2:
        return 0.0
    n = D.shape[0]
    difference = np.zeros(n)
    for k in range(first, n):
        difference[k] = found[1, k] - found[0, k]
    return quadratic_form(L, D, difference, first, work)


@njit(cache=True)
def w_ratio(best: float, second: float, separation: float) -> float:
    """Difference of two quadratic forms over its standard deviation.

    J. Wang, M. Stewart, M. Tsakiri (1998), "A discrimination test procedure for ambiguity
    resolution on-the-fly", J. Geodesy 72.

    Parameters
    ----------
    best, second : float
        Squared norms of the two best candidates.
    separation : float
        Squared norm of their difference: the variance of second - best is four times that, for
        second - best is linear in the float ambiguities.

    Returns
    -------
    float
        Of unit variance and mean sqrt(separation) / 2 where the best is right.
    """
    return (second - best) / (2.0 * sqrt(separation)) if separation > 0.0 else 0.0


@njit(cache=True)
def subset_start(D: Array, least: float) -> int:
    """First ambiguity of the largest subset with a bootstrapped success of `least`; n for none."""
    i = D.shape[0]
    value = 1.0
    while i > 0:
        value *= component_success(D[i - 1])
        if not value >= least:
            return i
        i -= 1
    return i


@njit(cache=True)
def resolve_partial(
    a: Array,
    Q: Array,
    least: float,
    limit: int,
    values: Array,
    norms: Array,
    conditional: Array,
    covariance: Array,
    L: Array,
    D: Array,
    Zt: Array,
    inverse: Array,
) -> tuple[int, int, float]:
    """Fix the largest decorrelated subset that has a given bootstrapped success rate.

    Teunissen, Joosten, Tiberius (1999), "Geometry-free ambiguity success rates in case of partial
    fixing": the decorrelated ambiguities from the last, most precise one on are taken.

    Parameters
    ----------
    a, Q, limit, norms, L, D, Zt, inverse
        As in :func:`resolve`.
    least : float
        Success rate asked for.
    values : int64 array (p, n)
        Overwritten from column `first` on: candidates for (Zt a)[first:].
    conditional : float64 array (n,)
        Overwritten with the ambiguities given that the best candidate is right.
    covariance : float64 array (n, n)
        Overwritten with their covariance, singular where anything is fixed.

    Returns
    -------
    status : int
    first : int
    separation : float
    """
    n, count = a.shape[0], norms.shape[0]
    z = np.empty(n)
    status = _decorrelated(a, Q, L, D, Zt, inverse, z)
    if status != OK:
        return status, n, 0.0
    first = subset_start(D, least)
    if first == n:
        return NO_SUBSET, n, 0.0
    found = np.zeros((count, n))
    status = search(z, L, D, first, limit, found, norms)
    if status != OK:
        return status, n, 0.0
    for k in range(n - 1, -1, -1):
        if k >= first:
            miss = z[k] - found[0, k]
            z[k] = found[0, k]
            for i in range(k):
                z[i] -= miss * L[k, i]
    for c in range(count):
        for k in range(first, n):
            total = int(found[c, k])
            for i in range(n):
                total += Zt[k, i] * int(nearest(a[i]))
            values[c, k] = total
    for i in range(n):
        fraction = 0.0
        for k in range(n):
            fraction += inverse[k, i] * z[k]
        conditional[i] = nearest(a[i]) + fraction
    # a = inverse' z, and z keeps L' D L of the components before first.
    root = np.zeros((first, n))
    for k in range(first):
        for i in range(n):
            value = 0.0
            for m in range(k + 1):
                value += L[k, m] * inverse[m, i]
            root[k, i] = value
    for i in range(n):
        for j in range(i + 1):
            value = 0.0
            for k in range(first):
                value += root[k, i] * root[k, j] * D[k]
            covariance[i, j] = value
            covariance[j, i] = value
    return OK, first, _separation(L, D, found, first, np.empty(n))


@njit(cache=True)
def simulate(L: Array, D: Array, uniform: Array, limit: int, ratio: Array, right: Array) -> int:
    """Search for the integers of simulated floats, of which zeros are the right ones.

    Parameters
    ----------
    L : float64 array (n, n)
    D : float64 array (n,)
        Decorrelated factors.
    uniform : float64 array (m, 2 * ((n + 1) // 2))
        From 0 to below 1; made normal by Box and Muller's method.
    limit : int
    ratio : float64 array (m,)
        Overwritten: squared norm of the best over that of the second.
    right : bool array (m,)
        Overwritten: whether the best is zero.

    Returns
    -------
    int
    """
    n = D.shape[0]
    z = np.empty(n)
    normal = np.empty(n + 1)
    found = np.zeros((2, n))
    norms = np.empty(2)
    for s in range(uniform.shape[0]):
        for k in range(0, n, 2):
            radius = sqrt(-2.0 * log(1.0 - uniform[s, k]))
            sine, cosine = sincos(_TWO_PI * uniform[s, k + 1])
            normal[k] = radius * cosine
            normal[k + 1] = radius * sine
        for k in range(n):
            normal[k] *= sqrt(D[k])
        for k in range(n):
            total = 0.0
            for i in range(k, n):
                total += L[i, k] * normal[i]
            z[k] = total
        status = search(z, L, D, 0, limit, found, norms)
        if status != OK:
            return status
        zero = True
        for k in range(n):
            if found[0, k] != 0.0:
                zero = False
        right[s] = zero
        ratio[s] = norms[0] / norms[1]
    return OK
