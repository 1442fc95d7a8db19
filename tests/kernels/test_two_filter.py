"""Forward and backward filters combined: the joint Gaussian of all nodes, and the smoother."""

import numpy as np
import pytest

from replay.kernels.two_filter import combine_nodes, measured_information, solve_square
from tests.kernels.test_smoother import Node, batch, columns_of, problem, run_filter, smooth


def combined(columns, cuts=()):
    return smooth(columns, cuts, combine_nodes)


@pytest.mark.parametrize("seed", range(6))
def test_the_combination_is_the_joint_solution_of_all_nodes(seed):
    """Also where states come and go, stand elsewhere, are constants, or nothing is measured."""
    made = run_filter(problem(seed))
    for (x, P), (mean, cov) in zip(combined(columns_of(made)), batch(made), strict=True):
        np.testing.assert_allclose(x, mean, atol=1e-9)
        np.testing.assert_allclose(P, cov, atol=1e-9)


def test_it_does_not_matter_where_the_log_is_cut():
    """Bit for bit."""
    columns = columns_of(run_filter(problem(2)))
    whole = combined(columns)
    for cuts in ((1,), (7,), (3, 4, 9), tuple(range(1, len(columns)))):
        for (x, P), (y, Q) in zip(whole, combined(columns, cuts), strict=True):
            assert x.tobytes() == y.tobytes()
            assert P.tobytes() == Q.tobytes()


def test_a_copy_of_a_state_is_no_hindrance():
    """A covariance that is exactly singular, as right after a copy of the position."""
    start = Node(
        np.zeros((1, 0)), np.eye(1), np.zeros((0, 1)), np.eye(0), np.zeros(0), [-1], [], []
    )
    twice = Node(
        np.ones((2, 1)), np.zeros((2, 2)), np.array([[1.0, 0.0]]), 0.04 * np.eye(1),
        np.array([1.3]), [0, 0], [], [],
    )  # fmt: skip
    later = Node(
        np.eye(2), np.diag([0.5, 0.0]), np.array([[1.0, -1.0]]), 0.04 * np.eye(1),
        np.array([0.7]), [0, 1], [], [],
    )  # fmt: skip
    made = run_filter([start, twice, later])
    for (x, P), (mean, cov) in zip(combined(columns_of(made)), batch(made), strict=True):
        np.testing.assert_allclose(x, mean, atol=1e-12)
        np.testing.assert_allclose(P, cov, atol=1e-12)


@pytest.mark.parametrize("count", [1, 3, 7])
def test_what_a_covariance_lost_is_the_information_of_the_measurements(count):
    """H' R^-1 H and H' R^-1 (y - H x), from nothing but the covariances and the correction."""
    random = np.random.default_rng(count)
    n = 6
    A = random.normal(size=(n, n))
    prior = A @ A.T + 0.1 * np.eye(n)
    H, R = random.normal(size=(count, n)), np.diag(random.uniform(0.01, 1.0, count))
    y = random.normal(size=count)
    gain = prior @ H.T @ np.linalg.inv(H @ prior @ H.T + R)
    P = prior - gain @ H @ prior
    J, j = np.zeros((n, n)), np.zeros(n)
    room = (np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n), np.zeros(n))
    measured_information(n, prior, 0.5 * (P + P.T), gain @ y, J, j, room)
    information = H.T @ np.linalg.inv(R) @ H
    scale = np.abs(information).max()
    np.testing.assert_allclose(J, information, atol=1e-9 * scale)
    # About the error before the update: H' R^-1 y.
    np.testing.assert_allclose(j, H.T @ np.linalg.inv(R) @ y, atol=1e-9 * scale)


def test_elimination_takes_the_largest_pivot():
    """Of a matrix that has a nought where the first pivot would stand."""
    random = np.random.default_rng(5)
    A = random.normal(size=(9, 9))
    A[0, 0] = 0.0
    B = random.normal(size=(9, 4))
    X = np.hstack([B, np.zeros((9, 3))])
    solve_square(A.copy(), 9, X, 4)
    np.testing.assert_allclose(A @ X[:, :4], B, atol=1e-12)
    assert np.all(X[:, 4:] == 0.0)
