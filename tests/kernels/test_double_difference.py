"""A group's clock without a prior is the double difference: against dense linear algebra."""

import numpy as np
import pytest

from replay.kernels import double_difference as dd
from replay.kernels.rtk_records import MEASURE_DTYPE

STATES = 9


def group(generator, count):
    """Measurements of three coordinates and an ambiguity each, as dense rows and as records."""
    H = np.zeros((count, STATES))
    measures = np.zeros(count, dtype=MEASURE_DTYPE)
    for k in range(count):
        row = generator.normal(size=3)
        H[k, :3], H[k, 3 + k] = row, 1.0
        measures[k]["h"][:4] = [*row, 1.0]
        measures[k]["index"][:4] = [0, 1, 2, 3 + k]
    measures["count"] = 4
    measures["use"] = 1
    measures["r"] = generator.uniform(0.5, 3.0, count)
    measures["z"] = generator.normal(size=count)
    return H, measures


def updated(P, measures):
    n = STATES + 1
    A, dx = np.zeros((n, n)), np.zeros(n)
    A[:STATES, :STATES] = P
    work = np.zeros(8), np.zeros(8, dtype=np.int64), np.zeros(n), np.zeros(n)
    dd.use_group(measures, 0, len(measures), A, n, dx, *work)
    return A, dx


def covariance(generator):
    root = generator.normal(size=(STATES, STATES))
    return root @ root.T + np.eye(STATES)


@pytest.mark.parametrize("pivot", [0, 3, 5])
def test_the_update_is_that_of_correlated_double_differences(pivot):
    generator = np.random.default_rng(4)
    P = covariance(generator)
    H, measures = group(generator, 6)
    A, dx = updated(P, measures)
    # Differences to any one satellite, with the covariance that they share.
    D = np.delete(np.eye(6), pivot, axis=0)
    D[:, pivot] = -1.0
    S = D @ (H @ P @ H.T + np.diag(measures["r"])) @ D.T
    K = P @ H.T @ D.T @ np.linalg.inv(S)
    np.testing.assert_allclose(dx[:STATES], K @ D @ measures["z"], atol=1e-12)
    np.testing.assert_allclose(A[:STATES, :STATES], P - K @ D @ H @ P, atol=1e-12)
    assert (A == A.T).all()
    assert not A[STATES].any()


def test_one_satellite_alone_says_nothing():
    generator = np.random.default_rng(5)
    P = covariance(generator)
    _, measures = group(generator, 1)
    A, dx = updated(P, measures)
    np.testing.assert_array_equal(A[:STATES, :STATES], P)
    assert not dx.any()


def test_residuals_have_the_variance_that_they_are_told_to_have():
    generator = np.random.default_rng(6)
    P = covariance(generator)
    H, measures = group(generator, 6)
    measures["use"][2] = 0
    A, dx = updated(P, measures)
    starts = np.array([0, 6])
    dd.residuals(measures, starts, 1, A, STATES + 1, dx, np.zeros(10), np.zeros(10))
    # The same by normal equations, where the clock needs no prior either.
    G = np.column_stack([H, np.ones(6)])
    used = measures["use"] == 1
    weighted = G[used].T / measures["r"][used]
    normal = weighted @ G[used]
    normal[:STATES, :STATES] += np.linalg.inv(P)
    after = np.linalg.inv(normal)
    K = after @ weighted
    left = measures["z"] - G @ (K @ measures["z"][used])
    share = np.einsum("ki,ij,kj->k", G, after, G)
    want = np.where(used, measures["r"] - share, measures["r"] + share)
    np.testing.assert_allclose(measures["residual"], left, atol=1e-11)
    np.testing.assert_allclose(measures["spread"], want, atol=1e-11)
    # And by drawing noise and states: one part in thirty of 20 000 samples.
    samples = 20_000
    states = np.linalg.cholesky(P) @ generator.normal(size=(STATES, samples))
    noise = generator.normal(size=(6, samples)) * np.sqrt(measures["r"])[:, None]
    z = H @ states + noise
    drawn = (z - G @ (K @ z[used])).var(axis=1)
    np.testing.assert_allclose(drawn, want, rtol=1 / 30)


def test_the_worst_is_the_one_furthest_beyond_its_own_gate():
    measures = np.zeros(4, dtype=MEASURE_DTYPE)
    measures["use"] = [1, 1, 0, 1]
    measures["kind"] = [0, 1, 1, 1]
    measures["r"] = 1.0
    measures["spread"] = [1.0, 0.25, 1.0, 0.001]
    measures["residual"] = [4.5, -2.2, 90.0, 90.0]
    # The last one is untestable, the one before it not in use.
    assert dd.worst_measure(measures, 4, 4.0, 4.0) == 0
    assert dd.worst_measure(measures, 4, 5.0, 4.0) == 1
    assert dd.worst_measure(measures, 4, 5.0, 5.0) == -1
