"""The smoother against the joint Gaussian of all nodes, the textbook's recursion, two filters."""

import dataclasses
import itertools

import numpy as np
import pytest

from replay.kernels import smoother
from replay.kernels.transition import (
    NODE_DTYPE,
    OWN,
    SILENT,
    add_correction,
    begin_trail,
    carry_decay,
    carry_rate,
    close_node,
    forget,
    open_node,
    repack,
    trail_dtype,
)
from replay.stages.transitions import Recorder

ROOM = 12


@dataclasses.dataclass
class Node:
    """One node of a linear problem: x = Phi x_before + noise of covariance Q, then y = H x + v."""

    phi: np.ndarray
    noise: np.ndarray
    h: np.ndarray
    r: np.ndarray
    y: np.ndarray
    source: list[int]  # of each state, minus one where it is new
    rates: list[tuple[int, int, float]]
    decays: list[tuple[int, float]]
    before: np.ndarray | None = None  # covariances and estimates of the filter
    after: np.ndarray | None = None
    predicted: np.ndarray | None = None
    updated: np.ndarray | None = None


def problem(seed=1, nodes=14):
    """States that come, go, change places, decay and drive each other; some are constants."""
    random = np.random.default_rng(seed)
    made: list[Node] = []
    n = 5
    for k in range(nodes):
        if k == 0:
            source = [-1] * n
        else:
            kept = [j for j in range(n) if random.random() > 0.15]
            random.shuffle(kept)
            born = [-1] * int(random.integers(0, 3))
            source = (kept + born)[:9] or [0]
        m = len(source)
        pack = np.zeros((m, n if k else 0))
        fresh = np.zeros(m)
        for i, old in enumerate(source):
            if old >= 0:
                pack[i, old] = 1.0
            else:
                fresh[i] = random.uniform(0.5, 4.0)
        step = np.eye(m)
        rates = [(0, m - 1, 0.5), (1, 0, -0.3)] if m > 2 else []
        decays = [(m - 1, 0.9)]
        for i, j, dt in rates:
            step[i] += dt * step[j]
        for i, factor in decays:
            step[i] *= factor
        walk = np.where(random.random(m) > 0.5, 0.1, 0.0)  # the others are constants
        count = int(random.integers(0, 3))
        h = random.normal(size=(count, m))
        made.append(
            Node(
                step @ pack, step @ np.diag(fresh) @ step.T + np.diag(walk),
                h, np.eye(count) * 0.04, np.zeros(count), source, rates, decays,
            )
        )  # fmt: skip
        n = m
    truth = np.zeros(0)
    for node in made:
        drawn = random.multivariate_normal(np.zeros(len(node.noise)), node.noise)
        truth = node.phi @ truth + drawn if len(truth) else drawn
        node.y = node.h @ truth + 0.2 * random.normal(size=len(node.y))
    return made


def run_filter(made):
    """A Kalman filter by the book; estimates and covariances into the nodes."""
    x, P = np.zeros(0), np.zeros((0, 0))
    for node in made:
        x = node.phi @ x if len(x) else np.zeros(len(node.noise))
        P = node.phi @ P @ node.phi.T + node.noise if P.size else node.noise
        node.before, node.predicted = P, x
        if len(node.y):
            gain = P @ node.h.T @ np.linalg.inv(node.h @ P @ node.h.T + node.r)
            x = x + gain @ (node.y - node.h @ x)
            A = np.eye(len(P)) - gain @ node.h
            P = A @ P @ A.T + gain @ node.r @ gain.T
        node.after, node.updated = P, x
    return made


def columns_of(made, solution=OWN):
    """What a filter that runs through the problem writes, by way of its trail."""
    recorder = Recorder(ROOM, True, lambda number: f"s{number}")
    trail = recorder.trail[0]
    begin_trail(trail)

    def call(nodes):
        for k, node in enumerate(made):
            n = len(node.noise)
            repack(trail, 0, n, np.array(node.source, dtype=np.int64))
            for i, j, dt in node.rates:
                carry_rate(trail, i, j, dt)
            for i, factor in node.decays:
                carry_decay(trail, i, factor)
            if len(node.y):
                open_node(trail, node.before, n)
                add_correction(trail, node.updated - node.predicted, n)
            trail["estimate"][:n] = node.updated
            trail["name"][:n] = np.arange(n)
            close_node(trail, node.after, n, 1000 * k, 1000 * k, solution, nodes)

    recorder.run(call, recorder.trail)
    return recorder.columns()


def smooth(columns, cuts=(), kernel=smoother.smooth_nodes):
    """Smoothed estimates and covariances of each node; None where nothing is asked for."""
    edges = [0, *cuts, len(columns)]
    room = 1 + int(columns["dimension"].max())
    carry = np.zeros(3, dtype=np.int64)
    squares = 1 if kernel is smoother.smooth_nodes else 3
    kept = [np.zeros(room), *(np.zeros((room, room)) for _ in range(squares))]
    found = []
    for begin, end in zip(edges[-2::-1], edges[:0:-1], strict=True):
        part = columns.take(slice(begin, end))
        n = part["dimension"].astype(np.int64)
        shown = np.where(part["solution"] == SILENT, -1, n).astype(np.int64)
        x_at = np.concatenate([[0], np.cumsum(n)])
        P_at = np.concatenate([[0], np.cumsum(n * (n + 1) // 2)])
        x, P = np.zeros(x_at[-1]), np.zeros(P_at[-1])
        code = kernel(
            carry, *kept, part.valid_time_ns, part["since_ns"],
            part["dimension_before"].astype(np.int64), n, shown,
            (part.ragged("value").offsets, part.ragged("row").values.astype(np.int64),
             part.ragged("column").values.astype(np.int64), part.ragged("value").values),
            *((part.ragged(name).offsets, part.ragged(name).values)
              for name in ("predicted_upper_triangle", "correction", "updated_upper_triangle")),
            (x_at, x), (P_at, P),
        )  # fmt: skip
        assert code == smoother.OK
        rows = []
        for k in range(len(part)):
            full = np.zeros((n[k], n[k]))
            full[np.triu_indices(n[k])] = P[P_at[k] : P_at[k + 1]]
            full = full + np.triu(full, 1).T
            estimate = part.ragged("estimate").row(k)
            rows.append((estimate + x[x_at[k] : x_at[k + 1]], full))
        found = rows + found
    return found


def batch(made):
    """Mean and covariance of each node's states given all measurements: one joint Gaussian."""
    sizes = [len(node.noise) for node in made]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    S = np.zeros((starts[-1], starts[-1]))
    for k, node in enumerate(made):
        here = slice(starts[k], starts[k + 1])
        if k:
            old = slice(starts[k - 1], starts[k])
            S[here, : starts[k]] = node.phi @ S[old, : starts[k]]
            S[: starts[k], here] = S[here, : starts[k]].T
            S[here, here] = node.phi @ S[old, old] @ node.phi.T
        S[here, here] += node.noise
    count = sum(len(node.y) for node in made)
    H, y = np.zeros((count, len(S))), np.zeros(count)
    at = 0
    for k, node in enumerate(made):
        H[at : at + len(node.y), starts[k] : starts[k + 1]] = node.h
        y[at : at + len(node.y)] = node.y
        at += len(node.y)
    R = 0.04 * np.eye(count)
    gain = np.linalg.solve(H @ S @ H.T + R, H @ S).T
    mean, cov = gain @ y, S - gain @ H @ S
    return [(mean[a:b], cov[a:b, a:b]) for a, b in itertools.pairwise(starts)]


def two_filters(made):
    """The forward filter combined with what an information filter from the end says."""
    n = len(made[-1].noise)
    Y, z = np.zeros((n, n)), np.zeros(n)
    found = []
    for k in range(len(made) - 1, -1, -1):
        node = made[k]
        A = np.eye(len(node.after)) + node.after @ Y
        P = np.linalg.solve(A, node.after)
        found.insert(0, (np.linalg.solve(A, node.updated + node.after @ z), P))
        Y = Y + node.h.T @ np.linalg.inv(node.r) @ node.h if len(node.y) else Y
        z = z + node.h.T @ np.linalg.inv(node.r) @ node.y if len(node.y) else z
        B = np.eye(len(Y)) + Y @ node.noise
        if k:
            z = node.phi.T @ np.linalg.solve(B, z)
            Y = node.phi.T @ np.linalg.solve(B, Y) @ node.phi
    return found


@pytest.mark.parametrize("seed", range(6))
def test_smoothing_is_the_joint_solution_of_all_nodes(seed):
    """Also where states come and go, stand elsewhere, are constants, or nothing is measured."""
    made = run_filter(problem(seed))
    assert {len(node.noise) for node in made} != {5}
    found = smooth(columns_of(made))
    for (x, P), (mean, cov) in zip(found, batch(made), strict=True):
        np.testing.assert_allclose(x, mean, atol=1e-10, rtol=1e-10)
        np.testing.assert_allclose(P, cov, atol=1e-10, rtol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_forward_and_backward_filters_combined_say_the_same(seed):
    """The two-filter form (Fraser and Potter 1969) of the same problem."""
    made = run_filter(problem(seed))
    for (x, P), (mean, cov) in zip(smooth(columns_of(made)), two_filters(made), strict=True):
        np.testing.assert_allclose(x, mean, atol=1e-9)
        np.testing.assert_allclose(P, cov, atol=1e-9)


def test_what_comes_later_never_makes_it_worse():
    """The filtered covariance less the smoothed one is not negative; at the end it is nought."""
    made = run_filter(problem(3))
    found = smooth(columns_of(made))
    gained = 0
    for (_, P), node in zip(found, made, strict=True):
        values = np.linalg.eigvalsh(node.after - P)
        assert values.min() > -1e-12
        gained += values.max() > 1e-3
    assert gained > len(made) // 2
    np.testing.assert_allclose(found[-1][1], made[-1].after, atol=1e-14)
    np.testing.assert_allclose(found[-1][0], made[-1].updated, atol=1e-14)


def test_it_does_not_matter_where_the_log_is_cut():
    """Bit for bit."""
    columns = columns_of(run_filter(problem(2)))
    whole = smooth(columns)
    for cuts in ((1,), (7,), (3, 4, 9), tuple(range(1, len(columns)))):
        for (x, P), (y, Q) in zip(whole, smooth(columns, cuts), strict=True):
            assert x.tobytes() == y.tobytes()
            assert P.tobytes() == Q.tobytes()


def test_a_filter_that_begins_anew_is_two_runs():
    """Nothing goes back over a node that has none before it."""
    first, second = run_filter(problem(4, 6)), run_filter(problem(5, 6))
    columns = columns_of(first + second)
    assert columns["dimension_before"][6] != 0
    apart = columns["dimension_before"].copy()
    apart[6] = 0
    values = {**columns.values, "dimension_before": apart}
    found = smooth(dataclasses.replace(columns, values=values))
    for got, made in ((found[:6], first), (found[6:], second)):
        for (x, P), (mean, cov) in zip(got, batch(made), strict=True):
            np.testing.assert_allclose(x, mean, atol=1e-10)
            np.testing.assert_allclose(P, cov, atol=1e-10)


def test_a_copy_of_a_state_is_no_hindrance():
    """A covariance that is exactly singular, as right after a copy of the position."""
    Q = 0.0 * np.eye(2)
    start = Node(
        np.zeros((1, 0)), np.eye(1), np.zeros((0, 1)), np.eye(0), np.zeros(0), [-1], [], []
    )
    twice = Node(
        np.ones((2, 1)),
        Q,
        np.array([[1.0, 0.0]]),
        0.04 * np.eye(1),
        np.array([1.3]),
        [0, 0],
        [],
        [],
    )
    later = Node(
        np.eye(2), np.diag([0.5, 0.0]), np.array([[1.0, -1.0]]), 0.04 * np.eye(1),
        np.array([0.7]), [0, 1], [], [],
    )  # fmt: skip
    made = run_filter([start, twice, later])
    for (x, P), (mean, cov) in zip(smooth(columns_of(made)), batch(made), strict=True):
        np.testing.assert_allclose(x, mean, atol=1e-12)
        np.testing.assert_allclose(P, cov, atol=1e-12)


def test_a_state_that_begins_anew_within_a_node():
    """`forget` after the node was opened is the same as before it."""
    random = np.random.default_rng(8)
    A = random.normal(size=(4, 9))
    P = A @ A.T
    trails = np.zeros(2, dtype=trail_dtype(ROOM))
    trails["on"], trails["before"] = 1, 4
    for trail, early in zip(trails, (True, False), strict=True):
        trail["T"][:4, :4] = random.normal(size=(4, 4)) if early else trails[0]["T"][:4, :4]
    trails[1]["T"] = trails[0]["T"]
    anew = P.copy()
    anew[2], anew[:, 2] = 0.0, 0.0
    anew[2, 2] = 7.0
    forget(trails[0], 2, 7.0)
    open_node(trails[0], anew, 4)
    open_node(trails[1], P, 4)
    forget(trails[1], 2, 7.0)
    for name in ("T", "prior", "correction"):
        assert np.array_equal(trails[0][name], trails[1][name])
    assert np.all(trails[0]["T"][:4, 2] == 0.0)


def test_nodes_that_find_no_room_are_asked_for_again():
    """The second call has room for all; what the loop changes is put back before it."""
    recorder = Recorder(3, True, str)
    trail, state = recorder.trail[0], np.zeros(1)
    calls = []

    def call(nodes):
        calls.append(len(nodes[1]))
        for k in range(600):
            state[0] += 1.0
            trail["estimate"][:3] = state[0]
            close_node(trail, np.eye(3), 3, k, k, OWN, nodes)
        return nodes[0].dtype

    assert recorder.run(call, state, recorder.trail) == NODE_DTYPE
    rows = recorder.columns()
    assert len(rows) == 600
    assert state[0] == 600.0
    assert np.array_equal(rows.ragged("estimate").values[::3], np.arange(1.0, 601.0))
    assert len(calls) == 2
