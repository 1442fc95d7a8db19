"""Measurement update of a Kalman filter for vectors of up to three components.

The measurement is whitened with the Cholesky factor of its covariance and then
used one scalar after another, which gives the result of the joint update without
an inverse. Each scalar update is the Joseph form with its product expanded,
P - k b' - b k' + s k k' with b = P h and s = h' b + 1: written on one triangle and
mirrored, it leaves P exactly symmetric.
"""

from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.types import Array


@njit(cache=True)
def cholesky3(R: Array, k: int, L: Array) -> bool:
    """Lower Cholesky factor of the leading k by k block of `R`; False where it has none."""
    for i in range(k):
        for j in range(i + 1):
            s = R[i, j]
            for m in range(j):
                s -= L[i, m] * L[j, m]
            if i == j:
                if not s > 0.0:
                    return False
                L[i, i] = sqrt(s)
            else:
                L[i, j] = s / L[j, j]
    return True


@njit(cache=True)
def forward_square3(L: Array, z: Array, k: int) -> float:
    """Z' (L L')^-1 z for the leading k components."""
    y0 = z[0] / L[0, 0]
    total = y0 * y0
    if k > 1:
        y1 = (z[1] - L[1, 0] * y0) / L[1, 1]
        total += y1 * y1
        if k > 2:
            y2 = (z[2] - L[2, 0] * y0 - L[2, 1] * y1) / L[2, 2]
            total += y2 * y2
    return total


@njit(cache=True)
def innovation_covariance(
    P: Array, n: int, H: Array, index: Array, count: int, R: Array, k: int, PH: Array, S: Array
) -> None:
    """PH = P H' (k, n) and S = H P H' + R (k, k).

    `H` (k, count) holds the columns of the states that `index` (count,) names; the rest are zero.
    """
    for a in range(k):
        for i in range(n):
            s = 0.0
            for c in range(count):
                s += P[i, index[c]] * H[a, c]
            PH[a, i] = s
    for a in range(k):
        for b in range(a + 1):
            s = R[a, b]
            for c in range(count):
                s += H[b, c] * PH[a, index[c]]
            S[a, b] = s
            S[b, a] = s


@njit(cache=True)
def scalar_update(
    P: Array, n: int, h: Array, index: Array, count: int, z: float, dx: Array, b: Array, gain: Array
) -> None:
    """Use one scalar measurement of unit variance.

    Parameters
    ----------
    P : float64 array (n, n)
        Symmetric; changed in place.
    n : int
    h : float64 array (count,)
        Sensitivities to the states that `index` names.
    index : int64 array (count,)
    count : int
    z : float
        Innovation before any part of this epoch's `dx`, over the standard deviation.
    dx : float64 array (n,)
        Correction so far, truth minus estimate; added to.
    b, gain : float64 array (n,)
        Overwritten.
    """
    s = 1.0
    y = z
    for i in range(n):
        value = 0.0
        for c in range(count):
            value += P[i, index[c]] * h[c]
        b[i] = value
    for c in range(count):
        s += h[c] * b[index[c]]
        y -= h[c] * dx[index[c]]
    for i in range(n):
        gain[i] = b[i] / s
        dx[i] += gain[i] * y
    for i in range(n):
        ki = gain[i]
        bi = b[i] - s * ki
        for j in range(i, n):
            # Grouped so that the rounding error of the gain enters squared only.
            value = P[i, j] - ki * b[j] - bi * gain[j]
            P[i, j] = value
            P[j, i] = value


@njit(cache=True)
def whitened_update(
    P: Array,
    n: int,
    H: Array,
    index: Array,
    count: int,
    z: Array,
    R: Array,
    k: int,
    dx: Array,
    L: Array,
    h: Array,
    b: Array,
    gain: Array,
) -> bool:
    """Use a measurement of k components with covariance `R`; False where `R` is not definite.

    Parameters
    ----------
    P, n, index, count, dx, b, gain
        As in :func:`scalar_update`.
    H : float64 array (k, count)
    z : float64 array (k,)
    R : float64 array (k, k)
    L : float64 array (3, 3)
        Overwritten.
    h : float64 array (3, at least count + 1)
        Overwritten.
    """
    if not cholesky3(R, k, L):
        return False
    for a in range(k):
        for c in range(count):
            value = H[a, c]
            for m in range(a):
                value -= L[a, m] * h[m, c]
            h[a, c] = value / L[a, a]
        value = z[a]
        for m in range(a):
            value -= L[a, m] * h[m, count]
        h[a, count] = value / L[a, a]
    for a in range(k):
        scalar_update(P, n, h[a], index, count, h[a, count], dx, b, gain)
    return True
