import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.kernels import covariance, earth
from replay.kernels.strapdown import NAVIGATION_DTYPE, mechanize
from tests.kernels.test_strapdown import start


def spd(rng, n):
    a = rng.normal(size=(n, n))
    return a @ a.T + n * np.eye(n)


def transition(n, r, C, f_e, f_b, w_b, dt, decay):
    """Dense transition matrix, written down from the equations of the module."""

    def skew(v):
        return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])

    omega = skew([0, 0, earth.EARTH_RATE_RAD_S])
    radius = np.linalg.norm(r)
    up = r / radius
    gradient = (
        earth.GRAVITATIONAL_CONSTANT_M3_S2 / radius**3 * (3 * np.outer(up, up) - np.eye(3))
        - omega @ omega
    )
    phi = np.diag(np.concatenate([np.ones(9), decay[9:n]]))
    phi[0:3, 3:6] = np.eye(3) * dt
    phi[3:6, 0:3] = gradient * dt
    phi[3:6, 3:6] -= 2 * omega * dt
    phi[3:6, 6:9] = -skew(f_e) * dt
    phi[3:6, 12:15] = -C * dt
    phi[6:9, 6:9] -= omega * dt
    phi[6:9, 9:12] = -C * dt
    if n >= 21:
        phi[3:6, 18:21] = -C @ np.diag(f_b) * dt
        phi[6:9, 15:18] = -C @ np.diag(w_b) * dt
    return phi


@pytest.mark.parametrize("n", [15, 21, 25])
def test_sparse_propagation_is_the_dense_one(n):
    rng = np.random.default_rng(n)
    nav = start(roll=0.1, pitch=0.2, heading=2.0)
    C, r = np.array(nav["C"]), np.array(nav["r"])
    f_b, w_b = rng.normal(0, 5, 3), rng.normal(0, 0.5, 3)
    f_e = C @ f_b
    P0, dt = spd(rng, n), 0.02
    decay = np.concatenate([np.ones(9), rng.uniform(0.9, 1.0, n - 9)])
    noise = rng.uniform(0, 1e-3, n)
    P = P0.copy()
    covariance.propagate(
        P, n, n >= 21, r, C, f_e, f_b, w_b, dt, decay, noise, n, np.zeros((26, 26))
    )
    phi = transition(n, r, C, f_e, f_b, w_b, dt, decay)
    Q = np.diag(noise)
    for block in (slice(3, 6), slice(6, 9)):
        Q[block, block] = C @ np.diag(noise[block]) @ C.T
    expected = phi @ P0 @ phi.T + Q
    np.testing.assert_allclose(P, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    assert (P == P.T).all()
    np.linalg.cholesky(P)


def perturbed(nav, error, bg, ba, sg, sa):
    """The true state of an error vector (truth minus estimate) and its true sensor errors."""
    truth = np.zeros(1, dtype=NAVIGATION_DTYPE)[0]
    truth["r"] = nav["r"] + error[0:3]
    truth["v"] = nav["v"] + error[3:6]
    C = Rotation.from_rotvec(error[6:9]).as_matrix() @ nav["C"]
    truth["C"] = C
    q = Rotation.from_matrix(C).as_quat()
    truth["q"] = [q[3], q[0], q[1], q[2]]
    return truth, bg + error[9:12], ba + error[12:15], sg + error[15:18], sa + error[18:21]


def derivative_of_mechanisation(nav, w_raw, f_raw, dt):
    """Error after an interval by error before it, by central differences."""

    def advance(error):
        zeros = np.zeros(3)
        truth, bg, ba, sg, sa = perturbed(nav, error, zeros, zeros, zeros, zeros)
        w = (w_raw - bg) / (1 + sg)
        f = (f_raw - ba) / (1 + sa)
        mechanize(truth, *(w * dt), *(f * dt), dt, np.zeros((2, 4)))
        return truth

    sizes = np.array([10.0] * 3 + [0.1] * 3 + [1e-3] * 3 + [1e-3] * 3 + [0.1] * 3 + [1e-3] * 6)
    found = np.zeros((9, 21))
    for j in range(21):
        error = np.zeros(21)
        error[j] = sizes[j]
        plus, minus = advance(error), advance(-error)
        turn = Rotation.from_matrix(plus["C"] @ minus["C"].T).as_rotvec()
        column = np.concatenate([plus["r"] - minus["r"], plus["v"] - minus["v"], turn])
        found[:, j] = column / (2 * sizes[j])
    return found


def test_the_transition_matrix_is_the_derivative_of_the_mechanisation():
    """What the first-order matrix leaves out is of second order in the interval."""
    nav = start(roll=0.1, pitch=-0.05, heading=0.7)
    nav["v"] = [10.0, -5.0, 3.0]
    w_raw, f_raw = np.array([0.2, -0.3, 0.4]), np.array([1.0, 2.0, -9.5])
    C = np.array(nav["C"])
    left = []
    for dt in (0.2, 0.1, 0.05):
        found = derivative_of_mechanisation(nav, w_raw, f_raw, dt)
        expected = transition(21, np.array(nav["r"]), C, C @ f_raw, f_raw, w_raw, dt, np.ones(21))[
            :9
        ]
        left.append(np.abs(found - expected).max(axis=1))
    for coarse, fine in itertools.pairwise(left):
        ratio = coarse / fine
        assert (ratio > 3.5).all()
        assert (ratio < 4.5).all()
