"""Smoothing backwards over the nodes of a filter (Rauch, Tung and Striebel 1965).

The equations are x_s = x + C (x_s' - x'), P_s = P + C (P_s' - P') C' with C = P Phi' P'^-1,
where x, P are those after the update of a node, x', P' those predicted for the next one and
Phi the transition matrix between them. They are written with what goes back from node to node
(Bryson and Frazier 1963): l = Phi' P'^-1 (x_s' - x') and
L = Phi' P'^-1 (P_s' - P') P'^-1 Phi, so that x_s = x + P l and P_s = P + P L P. At a node
without an update l and L are the same before and after it: nothing is solved there. Phi is
sparse, and need not be square: states come and go.

All states are errors, truth minus estimate; that of a closed loop is nought after an update, so
that x_s is how wrong the filter's estimate was.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.types import Array

_NO_PIVOT: Final = 1e-13
"""A state whose variance is less than this part of its own, given the ones before it, is a
function of them."""

OK: Final = 0
OTHER_STATES: Final = 1
OTHER_TIME: Final = 2


@njit(cache=True)
def unpack(values: Array, at: int, n: int, P: Array) -> None:
    """Symmetric matrix of `n` rows from the upper triangle at `at`, row by row."""
    for i in range(n):
        row = P[i]
        for j in range(i, n):
            row[j] = values[at + j - i]
        at += n - i
    for i in range(n):
        for j in range(i):
            P[i, j] = P[j, i]


@njit(cache=True)
def factor(P: Array, n: int, scale: Array, U: Array) -> None:
    """P = D^-1 U' U D^-1 with U upper and D diagonal; dependent states get a row of zeros.

    Parameters
    ----------
    P : float64 array (n, n)
    n : int
    scale : float64 array (n,)
        Filled: the diagonal of D.
    U : float64 array (n, n)
        Filled: upper triangle; the diagonal holds 1 / pivot.
    """
    for i in range(n):
        scale[i] = 1.0 / sqrt(P[i, i]) if P[i, i] > 0.0 else 0.0
    for i in range(n):
        for j in range(i, n):
            U[i, j] = P[i, j] * scale[i] * scale[j]
    for k in range(n):
        row = U[k]
        pivot = row[k]
        if not pivot > _NO_PIVOT:
            for j in range(k, n):
                row[j] = 0.0
            continue
        root = 1.0 / sqrt(pivot)
        for j in range(k + 1, n):
            row[j] *= root
        row[k] = root
        for i in range(k + 1, n):
            target = U[i]
            f = row[i]
            for j in range(i, n):
                target[j] -= f * row[j]


@njit(cache=True)
def combine(
    target: Array, coefficients: Array, X: Array, k: int, end: int, first: int, last: int
) -> None:
    """Add rows `k` to `end` - 1 of X, each times its coefficient, to columns of a row.

    Four rows at a time, so that the row is loaded and stored a quarter as often.
    """
    while k + 4 <= end:
        a, b, c, d = coefficients[k], coefficients[k + 1], coefficients[k + 2], coefficients[k + 3]
        x0, x1, x2, x3 = X[k], X[k + 1], X[k + 2], X[k + 3]
        for j in range(first, last):
            target[j] += (a * x0[j] + b * x1[j]) + (c * x2[j] + d * x3[j])
        k += 4
    while k < end:
        a, x0 = coefficients[k], X[k]
        for j in range(first, last):
            target[j] += a * x0[j]
        k += 1


@njit(cache=True)
def forward_solve(U: Array, n: int, scale: Array, X: Array, upper: bool, f: Array) -> None:
    """X (n, n) becomes U'^-1 D X; with `upper` only what stands right of the diagonal and on it."""
    for k in range(n):
        row = X[k]
        first = k if upper else 0
        for i in range(k):
            f[i] = -U[i, k]
        for c in range(first, n):
            row[c] *= scale[k]
        combine(row, f, X, 0, k, first, n)
        for c in range(first, n):
            row[c] *= U[k, k]


@njit(cache=True)
def backward_solve(U: Array, n: int, X: Array, lower: bool, f: Array) -> None:
    """X (n, n) becomes U^-1 X; with `lower` only what stands left of the diagonal and on it.

    Its rows still lack the factors D.
    """
    for k in range(n - 1, -1, -1):
        row = X[k]
        last = k + 1 if lower else n
        for i in range(k + 1, n):
            f[i] = -U[k, i]
        combine(row, f, X, k + 1, n, 0, last)
        for c in range(last):
            row[c] *= U[k, k]


@njit(cache=True)
def solve_both(U: Array, n: int, scale: Array, X: Array, Y: Array, f: Array) -> None:
    """Symmetric X becomes P^-1 X P^-1 for the P of :func:`factor`; Y (n, n), f (n,) overwritten."""
    forward_solve(U, n, scale, X, False, f)
    transpose(X, n, n, Y)
    # U'^-1 D X D U^-1 is symmetric: half of it will do.
    forward_solve(U, n, scale, Y, True, f)
    for i in range(n):
        for j in range(i):
            Y[i, j] = Y[j, i]
    backward_solve(U, n, Y, False, f)
    transpose(Y, n, n, X)
    backward_solve(U, n, X, True, f)
    for i in range(n):
        for j in range(i + 1):
            X[i, j] *= scale[i] * scale[j]
            X[j, i] = X[i, j]


@njit(cache=True)
def solve_vector(U: Array, n: int, scale: Array, x: Array) -> None:
    """X (n,) becomes P^-1 x for the P of :func:`factor`."""
    for i in range(n):
        x[i] *= scale[i]
    for k in range(n):
        x[k] *= U[k, k]
        for i in range(k + 1, n):
            x[i] -= U[k, i] * x[k]
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            x[k] -= U[k, i] * x[i]
        x[k] *= U[k, k]
    for i in range(n):
        x[i] *= scale[i]


@njit(cache=True)
def sandwich(P: Array, Lam: Array, shown: int, n: int, W: Array, out: Array) -> None:
    """Of P L P the first `shown` rows and columns into `out`, exactly symmetric; W overwritten."""
    for i in range(shown):
        target = W[i]
        for c in range(n):
            target[c] = 0.0
        combine(target, P[i], Lam, 0, n, 0, n)
    for i in range(shown):
        target = out[i]
        for c in range(i, shown):
            target[c] = 0.0
        combine(target, W[i], P, 0, n, i, shown)
    for i in range(shown):
        for j in range(i):
            out[i, j] = out[j, i]


@njit(cache=True)
def transpose(A: Array, n: int, m: int, out: Array) -> None:
    """Transpose of A (n, m) into `out` (m, n)."""
    for i in range(n):
        for j in range(m):
            out[j, i] = A[i, j]


@njit(cache=True)
def _through_update(
    n: int, prior: Array, P: Array, gained: Array, values: Array, correction: int, lam: Array,
    Lam: Array, room: tuple[Array, Array, Array, Array],
) -> None:  # fmt: skip
    """What goes back, from after an update to before it.

    l' = P'^-1 (dx + P l) and L' = P'^-1 (P + P L P - P') P'^-1; `gained` is P L P.
    """
    U, W, scale, y = room
    factor(prior, n, scale, U)
    for i in range(n):
        total = values[correction + i]
        for j in range(n):
            total += P[i, j] * lam[j]
        y[i] = total
    solve_vector(U, n, scale, y)
    for i in range(n):
        lam[i] = y[i]
        for j in range(n):
            Lam[i, j] = (P[i, j] - prior[i, j]) + gained[i, j]
    solve_both(U, n, scale, Lam, W, y)


@njit(cache=True)
def _through_time(
    n: int, before: int, first: int, last: int, row: Array, column: Array, value: Array,
    lam: Array, Lam: Array, room: tuple[Array, Array, Array, Array],
) -> None:  # fmt: skip
    """What goes back, from before an update to after the one before: Phi' l and Phi' L Phi."""
    W, X, _, y = room
    for j in range(before):
        y[j] = 0.0
        for i in range(n):
            X[j, i] = 0.0
    for k in range(first, last):
        i, j, v = row[k], column[k], value[k]
        y[j] += v * lam[i]
        target, source = X[j], Lam[i]
        for c in range(n):
            target[c] += v * source[c]
    transpose(X, before, n, W)
    for j in range(before):
        lam[j] = y[j]
        for i in range(before):
            Lam[j, i] = 0.0
    for k in range(first, last):
        i, j, v = row[k], column[k], value[k]
        target, source = Lam[j], W[i]
        for c in range(before):
            target[c] += v * source[c]
    for i in range(before):
        for j in range(i, before):
            v = 0.5 * (Lam[i, j] + Lam[j, i])
            Lam[i, j] = v
            Lam[j, i] = v


@njit(cache=True)
def _say(
    n: int, P: Array, lam: Array, gained: Array, shown: int, x: Array, at: int,
    covariance: Array, place: int,
) -> None:  # fmt: skip
    """x_s = P l, and of P_s = P + P L P the upper triangle of the first `shown` states."""
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += P[i, j] * lam[j]
        x[at + i] = total
    for i in range(shown):
        for j in range(i, shown):
            covariance[place] = P[i, j] + gained[i, j]
            place += 1


@njit(cache=True)
def smooth_nodes(
    carry: Array,
    lam: Array,
    Lam: Array,
    t: Array,
    since: Array,
    before: Array,
    dimension: Array,
    shown: Array,
    transition: tuple[Array, Array, Array, Array],
    predicted: tuple[Array, Array],
    correction: tuple[Array, Array],
    updated: tuple[Array, Array],
    x: tuple[Array, Array],
    covariance: tuple[Array, Array],
) -> int:
    """Go back over the nodes of a batch.

    Parameters
    ----------
    carry : int64 array (2,)
        Of the node after the batch: states of the node before it, 0 where it has none, and
        the time (ns) of that. Changed: of the batch's first node.
    lam, Lam : float64 arrays (room,), (room, room)
        What goes back; changed. Room is more than the states of any node.
    t, since, before, dimension : int64 arrays (nodes,)
        Time of a node and of the one before it (ns), their numbers of states.
    shown : int64 array (nodes,)
        Of how many states the smoothed covariance is wanted; minus one where nothing is.
    transition : int64 offsets (nodes + 1,), rows, columns, values
    predicted, correction, updated : int64 offsets (nodes + 1,), values
        Without an update the last two have no values.
    x, covariance : int64 offsets (nodes + 1,), values
        Filled: smoothed errors of all states, upper triangles of the states shown.

    Returns
    -------
    int
        OK, or why the nodes do not follow each other.
    """
    size = lam.shape[0]
    P, prior = np.zeros((size, size)), np.zeros((size, size))
    gained = np.zeros((size, size))
    room = (np.zeros((size, size)), np.zeros((size, size)), np.zeros(size), np.zeros(size))
    starts, row, column, value = transition
    for k in range(t.shape[0] - 1, -1, -1):
        n = dimension[k]
        if carry[0] == 0:
            lam[:] = 0.0
            Lam[:, :] = 0.0
        elif carry[0] != n:
            return OTHER_STATES
        elif carry[1] != t[k]:
            return OTHER_TIME
        is_update = correction[0][k + 1] > correction[0][k]
        unpack(predicted[1], predicted[0][k], n, prior)
        if is_update:
            unpack(updated[1], updated[0][k], n, P)
        after = P if is_update else prior
        known = n if is_update else max(0, shown[k])
        sandwich(after, Lam, known, n, room[0], gained)
        if shown[k] >= 0:
            _say(
                n, after, lam, gained, shown[k], x[1], x[0][k], covariance[1], covariance[0][k]
            )  # fmt: skip
        if is_update:
            _through_update(
                n, prior, P, gained, correction[1], correction[0][k], lam, Lam, room
            )  # fmt: skip
        _through_time(n, before[k], starts[k], starts[k + 1], row, column, value, lam, Lam, room)
        carry[0] = before[k]
        carry[1] = since[k]
    return OK
