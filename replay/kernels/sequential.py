"""Kalman updates with one scalar after another on the upper triangle of a covariance.

A scalar measurement z = h' x + e of variance r has, with b = P h and s = h' b + r, the
gain b / s and leaves P - b b' / s. Only the upper triangle is read and written, row by
row, so that what runs fastest is a loop along a row; :func:`mirror` fills the lower one
when the epoch is done. One subtraction of a product per element is symmetric by itself
and loses no more than the rounding of the covariance before: a state that begins with a
deviation of 100 m is known to a micrometre afterwards. What takes a measurement out
again is the same update with the variance minus r.
"""

from numba import njit

from replay.kernels.types import Array


@njit(cache=True)
def project(P: Array, n: int, h: Array, index: Array, count: int, b: Array) -> float:
    """Product b = P h, and h' P h.

    Parameters
    ----------
    P : float64 array (at least n, at least n)
        Its upper triangle is read.
    n : int
    h : float64 array (count,)
        Sensitivities to the states that `index` names.
    index : int64 array (count,)
    count : int
    b : float64 array (n,)
        Overwritten.
    """
    for i in range(n):
        b[i] = 0.0
    for c in range(count):
        p = index[c]
        value = h[c]
        for i in range(p):
            b[i] += P[i, p] * value
        row = P[p]
        for i in range(p, n):
            b[i] += row[i] * value
    spread = 0.0
    for c in range(count):
        spread += h[c] * b[index[c]]
    return spread


@njit(cache=True)
def _subtract(P: Array, n: int, b: Array, s: float) -> None:
    """Upper triangle of P - b b' / s."""
    for i in range(n):
        if b[i] != 0.0:
            k = b[i] / s
            row = P[i, i:n]
            tail = b[i:n]
            for j in range(n - i):
                row[j] -= k * tail[j]


@njit(cache=True)
def update(
    P: Array, n: int, h: Array, index: Array, count: int, z: float, r: float, dx: Array, b: Array
) -> None:
    """Use one scalar measurement.

    Parameters
    ----------
    P, n, h, index, count
        As in :func:`project`; the upper triangle of `P` is changed.
    z : float
        Innovation before any part of this epoch's `dx`.
    r : float
        Variance.
    dx : float64 array (n,)
        Correction so far, truth minus estimate; added to.
    b : float64 array (n,)
        Overwritten.
    """
    s = project(P, n, h, index, count, b) + r
    for c in range(count):
        z -= h[c] * dx[index[c]]
    y = z / s
    for i in range(n):
        dx[i] += b[i] * y
    _subtract(P, n, b, s)


@njit(cache=True)
def take_out(
    P: Array, n: int, h: Array, index: Array, count: int, z: float, r: float, dx: Array, b: Array
) -> None:
    """Undo the use of one scalar measurement among others, with the arguments of its use.

    Well-conditioned where others speak of the same too: where the variance of its
    residual, r - h' P h, is not small beside r.
    """
    update(P, n, h, index, count, z, -r, dx, b)


@njit(cache=True)
def mirror(P: Array, n: int) -> None:
    """Lower triangle from the upper one."""
    for i in range(n):
        row = P[i]
        for j in range(i):
            row[j] = P[j, i]
