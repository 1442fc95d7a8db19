import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.kernels import kalman
from tests.kernels.test_covariance import spd


def joint_update(P, H, R, z):
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    return P - K @ S @ K.T, K @ z


def update(P, H, index, R, z):
    n, k = len(P), len(z)
    dx, L = np.zeros(n), np.zeros((3, 3))
    H_full = np.zeros((3, len(index)))
    H_full[:k] = H[:, index]
    ok = kalman.whitened_update(
        P, n, H_full, index, len(index), z, R, k, dx, L, np.zeros((3, 30)), np.zeros(n), np.zeros(n)
    )
    return ok, dx


@pytest.mark.parametrize("k", [1, 2, 3])
@pytest.mark.parametrize("seed", range(5))
def test_sequential_updates_are_the_joint_one(k, seed):
    rng = np.random.default_rng(seed)
    n = 15
    P0 = spd(rng, n)
    index = np.sort(rng.choice(n, 7, replace=False))
    H = np.zeros((k, n))
    H[:, index] = rng.normal(size=(k, 7))
    R, z = spd(rng, k), rng.normal(size=k)
    R3 = np.eye(3)
    R3[:k, :k] = R
    P = P0.copy()
    ok, dx = update(P, H, index, R3, z)
    expected_P, expected_dx = joint_update(P0, H, R, z)
    assert ok
    np.testing.assert_allclose(P, expected_P, atol=1e-12 * np.abs(P0).max())
    np.testing.assert_allclose(dx, expected_dx, atol=1e-12 * np.abs(expected_dx).max())
    assert (P == P.T).all()


@given(st.floats(-3, 0), st.integers(0, 1000))
def test_precise_measurements_of_an_uncertain_state_leave_it_definite(exponent, seed):
    """Up to 1e10 between the variances: a hundred metres known to a millimetre."""
    rng = np.random.default_rng(seed)
    n = 15
    P = spd(rng, n) * 1e6
    index = np.arange(6)
    for _ in range(20):
        H = np.zeros((3, n))
        H[:, index] = rng.normal(size=(3, 6))
        update(P, H, index, np.eye(3) * 10.0**exponent, rng.normal(size=3))
    assert (P == P.T).all()
    assert np.diag(P).min() > 0.0
    scale = 1 / np.sqrt(np.diag(P))
    assert np.linalg.eigvalsh(P * np.outer(scale, scale)).min() > -1e-6


def test_what_is_not_definite_is_refused():
    P = np.eye(4)
    before = P.copy()
    ok, dx = update(P, np.eye(3, 4), np.arange(3), np.diag([1.0, -1.0, 1.0]), np.ones(3))
    assert not ok
    assert (before == P).all()
    assert (dx == 0.0).all()


def test_innovation_covariance_and_chi_square_are_the_dense_ones():
    rng = np.random.default_rng(3)
    n, k = 15, 3
    P, R, z = spd(rng, n), spd(rng, k), rng.normal(size=k)
    index = np.array([0, 4, 8, 11])
    H = np.zeros((k, n))
    H[:, index] = rng.normal(size=(k, 4))
    PH, S, L = np.zeros((3, n)), np.zeros((3, 3)), np.zeros((3, 3))
    packed = np.ascontiguousarray(H[:, index])
    kalman.innovation_covariance(P, n, packed, index, 4, R, k, PH, S)
    np.testing.assert_allclose(S, H @ P @ H.T + R, rtol=1e-13)
    assert kalman.cholesky3(S, k, L)
    np.testing.assert_allclose(L @ L.T, S, rtol=1e-13)
    assert kalman.forward_square3(L, z, k) == pytest.approx(z @ np.linalg.solve(S, z), rel=1e-12)
