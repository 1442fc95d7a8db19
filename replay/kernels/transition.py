"""How a filter came from update to update, written down for a smoother that goes back.

A filter that records keeps a trail: the transition matrix since its last node. A node is a
moment at which the filter says something: an update, or a solution without one. From node to
node all is linear in the error states (truth minus estimate): what time does to them, states
that end, begin, move to another place or are copied. At a node stand the covariance before the
update and after it, and the sum of what the update added to the states.

The order of calls at a node: everything that time does (`carry_*`, `repack`), what makes the
filter doubt, :func:`open_node` (the covariance is now the predicted one), measurements with
:func:`add_correction`, :func:`close_node`, and only then what belongs to the way to the next
node, copies of states for instance. A state that begins anew between two measurements of a node
(:func:`forget`) must not have been measured in it before; then it is the same as if it had
begun before the update.
"""

from typing import Any, Final

import numpy as np
from numba import njit

from replay.kernels.covariance import ATTITUDE, POSITION, transition_columns
from replay.kernels.rotation import cross3
from replay.kernels.types import Array, Record

SILENT: Final = 0  # the filter gave no solution
OWN: Final = 1  # its solution is that of the states
GIVEN_INTEGERS: Final = 2  # its solution knows more than the states do

NODE_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns
        ("log_t", "<i8"),  # ns
        ("since", "<i8"),  # ns, of the node before
        ("before", "<i8"),  # states after the node before; 0 where there is none
        ("n", "<i8"),  # states
        ("updated", "<i8"),  # 1 where measurements were used
        ("solution", "<i8"),  # SILENT, OWN, GIVEN_INTEGERS
        ("inertial", "<i8"),  # 1 where `q` is known
        ("q", "<f8", 4),  # body to ECEF
        ("values", "<i8"),  # where its numbers begin
        ("places", "<i8"),  # where its whole numbers begin
        ("nonzero", "<i8"),  # values of the transition matrix
    ],
    align=True,
)
"""A node. Its numbers: transition matrix, predicted upper triangle, where updated the correction
and the updated triangle, estimates. Its whole numbers: rows, columns, names of the states."""


def trail_dtype(states: int) -> "np.dtype[np.void]":
    """Record of what a filter with room for so many states keeps of the way since its last node."""
    return np.dtype(
        [
            ("on", "<i8"),  # 1 where nodes are recorded
            ("since", "<i8"),  # ns
            ("before", "<i8"),  # states after the last node, 0 where there is none
            ("T", "<f8", (states, states)),  # [j, i]: state i now for state j then
            # Within a node.
            ("open", "<i8"),
            ("updated", "<i8"),
            ("prior", "<f8", (states, states)),
            ("correction", "<f8", states),
            # What the filter fills in before it closes a node.
            ("name", "<i8", states),  # number by which the stage knows each state's name
            ("estimate", "<f8", states),
            ("inertial", "<i8"),
            ("q", "<f8", 4),
        ],
        align=True,
    )


@njit(cache=True)
def begin_trail(trail: Record) -> None:
    """The filter begins (anew): nothing before has to do with what is now."""
    trail["before"] = 0
    trail["open"] = 0
    trail["updated"] = 0


@njit(cache=True)
def part_trail(trail: Record) -> None:
    """What this node says must not go back to the nodes before it; it may be an open one."""
    trail["before"] = 0


@njit(cache=True)
def carry_rate(trail: Record, i: int, j: int, dt: float) -> None:
    """State `i` gains `dt` times state `j`."""
    T = trail["T"]
    for k in range(trail["before"]):
        T[k, i] += dt * T[k, j]


@njit(cache=True)
def carry_decay(trail: Record, i: int, factor: float) -> None:
    """State `i` shrinks by a factor: a Gauss-Markov process, or 0 for white noise."""
    T = trail["T"]
    for k in range(trail["before"]):
        T[k, i] *= factor


@njit(cache=True)
def carry_inertial(trail: Record, states: int, scaled: bool, decay: Array, work: Array) -> None:
    """What :func:`replay.kernels.covariance.propagate` has just done to the covariance.

    Parameters
    ----------
    trail : record
    states : int
        15 or 21: inertial states, which come first.
    scaled : bool
    decay : float64 array
    work : float64 array
        As `propagate` has left it.
    """
    T = trail["T"]
    count = min(states, trail["before"])
    transition_columns(T, count, scaled, work)
    for k in range(count):
        for i in range(9, states):
            T[k, i] *= decay[i]


@njit(cache=True)
def repack(trail: Record, first: int, n: int, source: Array) -> None:
    """States from `first` on stand in another order now.

    Parameters
    ----------
    trail : record
    first, n : int
        Now there are `n` states; those before `first` stay where they are.
    source : int64 array (n,)
        Of states `first` to n - 1: where each one stood, minus one where it is new.
    """
    T = trail["T"]
    row = np.empty(n)
    for k in range(trail["before"]):
        for i in range(first, n):
            row[i] = T[k, source[i]] if source[i] >= 0 else 0.0
        for i in range(first, n):
            T[k, i] = row[i]


@njit(cache=True)
def forget(trail: Record, i: int, variance: float) -> None:
    """State `i` begins anew, independent of all others, with a variance."""
    T = trail["T"]
    for k in range(trail["before"]):
        T[k, i] = 0.0
    if trail["open"] == 1:
        prior = trail["prior"]
        for k in range(prior.shape[0]):
            prior[i, k] = 0.0
            prior[k, i] = 0.0
        prior[i, i] = variance
        trail["correction"][i] = 0.0


@njit(cache=True)
def copy_antenna(trail: Record, first: int, a0: float, a1: float, a2: float) -> None:
    """States `first` to `first` + 2 become the error of the antenna's place: dr + psi x a.

    Parameters
    ----------
    trail : record
    first : int
    a0, a1, a2 : float, m
        Lever arm, ECEF.
    """
    T = trail["T"]
    for k in range(trail["before"]):
        c0, c1, c2 = cross3(T[k, ATTITUDE], T[k, ATTITUDE + 1], T[k, ATTITUDE + 2], a0, a1, a2)
        T[k, first] = T[k, POSITION] + c0
        T[k, first + 1] = T[k, POSITION + 1] + c1
        T[k, first + 2] = T[k, POSITION + 2] + c2


@njit(cache=True)
def open_node(trail: Record, P: Array, n: int) -> None:
    """Keep the covariance before the first measurement of a node; does nothing after it."""
    if trail["open"] == 1:
        return
    prior, correction = trail["prior"], trail["correction"]
    for i in range(n):
        correction[i] = 0.0
        for j in range(n):
            prior[i, j] = P[i, j]
    trail["open"] = 1
    trail["updated"] = 0


@njit(cache=True)
def add_correction(trail: Record, dx: Array, n: int) -> None:
    """Measurements added `dx` (n,) to the states."""
    correction = trail["correction"]
    for i in range(n):
        correction[i] += dx[i]
    trail["updated"] = 1


@njit(cache=True)
def close_node(
    trail: Record,
    P: Array,
    n: int,
    t: int,
    log_t: int,
    solution: int,
    nodes: tuple[Any, ...],
) -> None:
    """Write a node, and begin the way to the next one.

    Parameters
    ----------
    trail : record
        With `name`, `estimate`, `inertial` and `q` filled in.
    P : float64 array
        Covariance after the update.
    n : int
        States.
    t, log_t : int, ns
    solution : int
        SILENT, OWN or GIVEN_INTEGERS.
    nodes : tuple
        Array of NODE_DTYPE, float64 array of numbers, int64 array of whole numbers, int64
        array (3,): how much of the three is used. Where there is no room nothing is
        written, but counted, so that the caller can come again with more.
    """
    rows, values, places, used = nodes
    open_node(trail, P, n)
    T, prior, correction = trail["T"], trail["prior"], trail["correction"]
    before = trail["before"]
    nonzero = 0
    for j in range(before):
        for i in range(n):
            if T[j, i] != 0.0:
                nonzero += 1
    triangle = n * (n + 1) // 2
    updated = trail["updated"]
    at, place = used[1], used[2]
    used[1] += nonzero + triangle + n + updated * (triangle + n)
    used[2] += 2 * nonzero + n
    row_number = used[0]
    used[0] += 1
    fits = used[0] <= rows.shape[0] and used[1] <= values.shape[0] and used[2] <= places.shape[0]
    if fits:
        row = rows[row_number]
        row["t"] = t
        row["log_t"] = log_t
        row["since"] = trail["since"] if before > 0 else t
        row["before"] = before
        row["n"] = n
        row["updated"] = updated
        row["solution"] = solution
        row["inertial"] = trail["inertial"]
        row["values"] = at
        row["places"] = place
        row["nonzero"] = nonzero
        for i in range(4):
            row["q"][i] = trail["q"][i]
        for j in range(before):
            for i in range(n):
                if T[j, i] != 0.0:
                    values[at] = T[j, i]
                    places[place] = i
                    places[place + nonzero] = j
                    at += 1
                    place += 1
        place += nonzero
        at = _put_triangle(prior, n, values, at)
        if updated == 1:
            for i in range(n):
                values[at + i] = correction[i]
            at = _put_triangle(P, n, values, at + n)
        for i in range(n):
            values[at + i] = trail["estimate"][i]
            places[place + i] = trail["name"][i]
    for j in range(n):
        for i in range(n):
            T[j, i] = 0.0
        T[j, j] = 1.0
    trail["before"] = n
    trail["since"] = t
    trail["open"] = 0
    trail["updated"] = 0


@njit(cache=True)
def _put_triangle(P: Array, n: int, values: Array, at: int) -> int:
    for i in range(n):
        for j in range(i, n):
            values[at] = P[i, j]
            at += 1
    return at
