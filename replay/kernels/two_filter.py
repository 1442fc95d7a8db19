"""Smoothing by two filters, one from each end, combined (Fraser and Potter 1969).

The first filter is the recorded one: at each node its error (truth minus estimate) has the
covariance P. The second one runs backwards and knows nothing at the end. It is an information
filter: of the error e at a node all later measurements together have the likelihood
exp(z' e - e' Y e / 2) but for a factor, with Y = 0 at the end of the run. Together they say
P_s = (I + P Y)^-1 P and x_s = P_s z.

The measurements of a node are not recorded, but what they did is: the covariance fell from
P' to P and the estimate moved by dx, so that their information is P^-1 - P'^-1 and
P^-1 dx. Both are computed with P' = L L': with C = L^-1 P L'^-1 they are
L'^-1 (C^-1 - I) L^-1 and L'^-1 C^-1 L^-1 dx; states that are functions of others (a copy of a
position) have no column in L. Before the measurements the backward filter has Y + P^-1 - P'^-1
and, as the error before is that after and dx, z + Y dx + P^-1 dx. Over the time between two
nodes, with e = Phi e_before + noise of covariance Q = P' - Phi P_before Phi', it becomes
Phi' (I + Y Q)^-1 Y Phi and Phi' (I + Y Q)^-1 z.

It says what :mod:`replay.kernels.smoother` says, in another way and with more work; it is there to
compare with. Both round where states are known badly alone and well together, but elsewhere: here
the information is the difference of inverses, there the inverse stands on both sides.
"""

import numpy as np
from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.smoother import (
    OK,
    OTHER_STATES,
    OTHER_TIME,
    backward_solve,
    factor,
    forward_solve,
    transpose,
    unpack,
)
from replay.kernels.types import Array


@njit(cache=True)
def solve_square(A: Array, n: int, B: Array, m: int) -> None:
    """B (n, m) becomes A^-1 B; by elimination with the largest pivot of each column.

    Parameters
    ----------
    A : float64 array (n, n)
        Regular; overwritten.
    n : int
    B : float64 array (n, m)
        Changed.
    m : int
    """
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
            for j in range(m):
                B[k, j], B[best, j] = B[best, j], B[k, j]
        pivot, row, known = 1.0 / A[k, k], A[k], B[k]
        for i in range(k + 1, n):
            f = A[i, k] * pivot
            if f == 0.0:
                continue
            target, other = A[i], B[i]
            for j in range(k + 1, n):
                target[j] -= f * row[j]
            for j in range(m):
                other[j] -= f * known[j]
    for k in range(n - 1, -1, -1):
        known = B[k]
        for i in range(k + 1, n):
            f = A[k, i]
            if f != 0.0:
                other = B[i]
                for j in range(m):
                    known[j] -= f * other[j]
        pivot = 1.0 / A[k, k]
        for j in range(m):
            known[j] *= pivot


@njit(cache=True)
def multiply(A: Array, B: Array, n: int, m: int, width: int, out: Array) -> None:
    """A (n, m) times B (m, width) into `out`; nought in A costs nothing."""
    for i in range(n):
        target = out[i]
        for j in range(width):
            target[j] = 0.0
        for k in range(m):
            f = A[i, k]
            if f != 0.0:
                source = B[k]
                for j in range(width):
                    target[j] += f * source[j]


@njit(cache=True)
def symmetric(A: Array, n: int) -> None:
    """A becomes the mean of itself and its transpose."""
    for i in range(n):
        for j in range(i + 1, n):
            v = 0.5 * (A[i, j] + A[j, i])
            A[i, j] = v
            A[j, i] = v


@njit(cache=True)
def forward_vector(U: Array, n: int, scale: Array, x: Array) -> None:
    """L^-1 x in place, where `factor` gave U of L' and `scale`."""
    for a in range(n):
        total = scale[a] * x[a]
        for b in range(a):
            total -= U[b, a] * x[b]
        x[a] = total * U[a, a]


@njit(cache=True)
def backward_vector(U: Array, n: int, scale: Array, x: Array) -> None:
    """L'^-1 x in place."""
    for a in range(n - 1, -1, -1):
        total = x[a]
        for b in range(a + 1, n):
            total -= U[a, b] * x[b]
        x[a] = total * U[a, a]
    for a in range(n):
        x[a] *= scale[a]


@njit(cache=True)
def measured_information(
    n: int, prior: Array, P: Array, dx: Array, J: Array, j: Array, room: tuple[Array, ...]
) -> None:
    """Information of the measurements that brought a covariance from `prior` to P by `dx`.

    Parameters
    ----------
    n : int
    prior, P : float64 arrays (n, n)
    dx : float64 array (n,)
    J, j : float64 arrays (n, n), (n,)
        Filled: H' R^-1 H, and P^-1 dx.
    room : tuple of three float64 arrays (n, n) and two (n,)
    """
    U, W, X, scale, y = room
    factor(prior, n, scale, U)
    # C = L^-1 P L'^-1, and L^-1 dx as one more column of the same.
    for a in range(n):
        for b in range(n):
            J[a, b] = P[a, b]
    forward_solve(U, n, scale, J, False, y)
    transpose(J, n, n, W)
    forward_solve(U, n, scale, W, False, y)
    symmetric(W, n)
    for a in range(n):
        j[a] = dx[a]
    forward_vector(U, n, scale, j)
    # The inverse of C through its own factor; what is a function of other states stays nought.
    for a in range(n):
        for b in range(n):
            X[a, b] = 1.0 if a == b and U[a, a] > 0.0 else 0.0
    _solve_factored(n, W, X, j, J, y)
    for a in range(n):
        if U[a, a] > 0.0:
            X[a, a] -= 1.0
    symmetric(X, n)
    # L'^-1 X L^-1, with L'^-1 = D U^-1.
    backward_solve(U, n, X, False, y)
    for a in range(n):
        for b in range(n):
            X[a, b] *= scale[a]
    transpose(X, n, n, J)
    backward_solve(U, n, J, False, y)
    for a in range(n):
        for b in range(n):
            J[a, b] *= scale[a]
    symmetric(J, n)
    backward_vector(U, n, scale, j)


@njit(cache=True)
def _solve_factored(n: int, C: Array, X: Array, x: Array, F: Array, y: Array) -> None:
    """X (n, n) and x (n,) become C^-1 X and C^-1 x; F (n, n), y (n,) are overwritten."""
    scale = np.zeros(n)
    factor(C, n, scale, F)
    forward_solve(F, n, scale, X, False, y)
    backward_solve(F, n, X, False, y)
    for a in range(n):
        for b in range(n):
            X[a, b] *= scale[a]
    forward_vector(F, n, scale, x)
    backward_vector(F, n, scale, x)


@njit(cache=True)
def _through_time(
    n: int, before: int, P: Array, later: Array, phi: Array, Y: Array, z: Array,
    room: tuple[Array, ...],
) -> None:  # fmt: skip
    """The information at a node of `n` states goes back to the node before it.

    `P` is the covariance after that one, `later` the predicted one of the node, `phi` (n, before)
    the transition between them.
    """
    A, B, Q, scale, _ = room
    multiply(phi, P, n, before, before, A)
    for i in range(n):
        for j in range(n):
            total = 0.0
            for k in range(before):
                if phi[j, k] != 0.0:
                    total += A[i, k] * phi[j, k]
            Q[i, j] = later[i, j] - total
    symmetric(Q, n)
    # Units that make the predicted variances one: the pivots are then of one kind.
    for i in range(n):
        scale[i] = sqrt(later[i, i]) if later[i, i] > 0.0 else 1.0
    for i in range(n):
        for j in range(n):
            Y[i, j] *= scale[i] * scale[j]
            Q[i, j] /= scale[i] * scale[j]
        z[i] *= scale[i]
    multiply(Y, Q, n, n, n, A)
    for i in range(n):
        A[i, i] += 1.0
        for j in range(n):
            B[i, j] = Y[i, j]
        B[i, n] = z[i]
    solve_square(A, n, B, n + 1)
    for i in range(n):
        for j in range(n):
            B[i, j] /= scale[i] * scale[j]
        z[i] = B[i, n] / scale[i]
    symmetric(B, n)
    multiply(B, phi, n, n, before, Q)
    for i in range(before):
        total = 0.0
        for k in range(n):
            total += phi[k, i] * z[k]
        scale[i] = total
        for j in range(before):
            total = 0.0
            for k in range(n):
                if phi[k, i] != 0.0:
                    total += phi[k, i] * Q[k, j]
            Y[i, j] = total
    for i in range(before):
        z[i] = scale[i]
    symmetric(Y, before)


@njit(cache=True)
def _combine(n: int, P: Array, Y: Array, z: Array, room: tuple[Array, ...]) -> None:
    """The first of `room` becomes (I + P Y)^-1 P, the fourth this times z."""
    S, A, B, x, scale = room
    for i in range(n):
        scale[i] = sqrt(P[i, i]) if P[i, i] > 0.0 else 1.0
    for i in range(n):
        for j in range(n):
            S[i, j] = P[i, j] / (scale[i] * scale[j])
            B[i, j] = Y[i, j] * (scale[i] * scale[j])
    multiply(S, B, n, n, n, A)
    for i in range(n):
        A[i, i] += 1.0
    solve_square(A, n, S, n)
    for i in range(n):
        for j in range(n):
            S[i, j] *= scale[i] * scale[j]
    symmetric(S, n)
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += S[i, j] * z[j]
        x[i] = total


@njit(cache=True)
def combine_nodes(
    carry: Array,
    z: Array,
    Y: Array,
    later: Array,
    phi: Array,
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
    """Go back over the nodes of a batch, as :func:`replay.kernels.smoother.smooth_nodes` does.

    Parameters
    ----------
    carry : int64 array (3,)
        Of the node after the batch: states of the node before it, 0 where it has none, the
        time (ns) of that, and its own states. Changed: of the batch's first node.
    z, Y : float64 arrays (room,), (room, room)
        Information before the measurements of the node after the batch; changed.
    later, phi : float64 arrays (room, room)
        Its predicted covariance, and the transition to it; changed.
    t, since, before, dimension, shown, transition, predicted, correction, updated, x, covariance
        As `smooth_nodes` takes them.

    Returns
    -------
    int
        OK, or why the nodes do not follow each other.
    """
    size = z.shape[0]
    P, J = np.zeros((size, size)), np.zeros((size, size))
    dx, j, mean, spare = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    room = (np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, size)), mean, spare)
    starts, row, column, value = transition
    for k in range(t.shape[0] - 1, -1, -1):
        n = dimension[k]
        is_update = correction[0][k + 1] > correction[0][k]
        if is_update:
            unpack(updated[1], updated[0][k], n, P)
        else:
            unpack(predicted[1], predicted[0][k], n, P)
        if carry[0] == 0:
            z[:] = 0.0
            Y[:, :] = 0.0
        elif carry[0] != n:
            return OTHER_STATES
        elif carry[1] != t[k]:
            return OTHER_TIME
        else:
            _through_time(carry[2], n, P, later, phi, Y, z, room)
        if shown[k] >= 0:
            _combine(n, P, Y, z, room)
            at, place = x[0][k], covariance[0][k]
            for i in range(n):
                x[1][at + i] = mean[i]
            for i in range(shown[k]):
                for c in range(i, shown[k]):
                    covariance[1][place] = room[0][i, c]
                    place += 1
        unpack(predicted[1], predicted[0][k], n, later)
        if is_update:
            for i in range(n):
                dx[i] = correction[1][correction[0][k] + i]
            measured_information(n, later, P, dx, J, j, room)
            for i in range(n):
                total = 0.0
                for c in range(n):
                    total += Y[i, c] * dx[c]
                z[i] += total + j[i]
            for i in range(n):
                for c in range(n):
                    Y[i, c] += J[i, c]
        for i in range(n):
            for c in range(before[k]):
                phi[i, c] = 0.0
        for c in range(starts[k], starts[k + 1]):
            phi[row[c], column[c]] = value[c]
        carry[0] = before[k]
        carry[1] = since[k]
        carry[2] = n
    return OK
