"""Weights of stations against numpy's pseudo-inverse, planes and the stations themselves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.kernels import interpolation as kernel

KM = 1e3
METHODS = (kernel.LIM, kernel.LCM, kernel.DIM)
# Lee (2010): four stations on a rectangle of 95 km by 115 km, the master in a corner.
RECTANGLE = np.array([[95.0, 0.0], [0.0, 115.0], [95.0, 115.0]]) * KM


def weights(method, place, rover, used=None):
    place = np.asarray(place, dtype=float).reshape(-1, 2)
    use = np.ones(len(place), dtype=bool) if used is None else np.array(used)
    out = np.full(len(place), np.nan)
    kernel.station_weights(method, place, use, float(rover[0]), float(rover[1]), out)
    return out


def network(rng, count):
    """Stations around the master that are not on a line."""
    angle = np.arange(count) * 2.0 + rng.uniform(0.0, 0.5, count)
    return rng.uniform(30, 150, count)[:, None] * KM * np.stack([np.cos(angle), np.sin(angle)], 1)


@pytest.mark.parametrize("count", [2, 3, 4, 7])
@pytest.mark.parametrize("method", [kernel.LIM, kernel.LCM])
def test_a_plane_through_the_master_is_reproduced(method, count):
    rng = np.random.default_rng(count)
    for _ in range(20):
        place, rover = network(rng, count), rng.uniform(-100, 100, 2) * KM
        slopes = rng.normal(0.0, 3e-6, 2)
        found = weights(method, place, rover) @ (place @ slopes)
        assert abs(found - rover @ slopes) < 1e-13


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_numpy_finds_the_same_weights(count):
    rng = np.random.default_rng(10 + count)
    for _ in range(20):
        place, rover = network(rng, count), rng.uniform(-100, 100, 2) * KM
        plane = rover @ np.linalg.pinv(place)
        np.testing.assert_allclose(weights(kernel.LIM, place, rover), plane, atol=1e-12)
        # Kilometres, so that the condition on the sum weighs like those on the places.
        B = np.vstack([np.ones(count + 1), np.vstack([[0.0, 0.0], place]).T / (100 * KM)])
        least = np.linalg.pinv(B) @ np.r_[1.0, rover / (100 * KM)]
        found = weights(kernel.LCM, place, rover)
        if count >= 2:
            np.testing.assert_allclose(found, least[1:], atol=1e-12)
            assert abs(least[0] - (1.0 - found.sum())) < 1e-12
        else:
            # One station: the rover counts by where it stands along the line.
            np.testing.assert_allclose(found, plane, atol=1e-12)


def test_two_stations_leave_no_choice_of_plane():
    rng = np.random.default_rng(5)
    for _ in range(50):
        place, rover = network(rng, 2), rng.uniform(-100, 100, 2) * KM
        lim, lcm = (weights(m, place, rover) for m in (kernel.LIM, kernel.LCM))
        np.testing.assert_allclose(lim, lcm, atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("at", [0, 1])
def test_a_rover_at_a_station_has_its_errors(method, at):
    place = np.array([[80.0, 20.0], [-30.0, 90.0]]) * KM
    np.testing.assert_allclose(weights(method, place, place[at]), np.eye(2)[at], atol=1e-14)


@pytest.mark.parametrize("method", METHODS)
def test_a_rover_at_the_master_has_no_errors(method):
    place = np.array([[80.0, 20.0], [-30.0, 90.0]]) * KM
    np.testing.assert_allclose(weights(method, place, (0.0, 0.0)), 0.0, atol=1e-15)
    place = RECTANGLE
    assert np.abs(weights(kernel.DIM, place, (0.0, 0.0))).max() == 0.0
    assert np.abs(weights(kernel.LIM, place, (0.0, 0.0))).max() == 0.0


def test_inverse_distances():
    place = RECTANGLE
    rover = np.array([40.0, 30.0]) * KM
    inverse = 1.0 / np.linalg.norm(np.vstack([[0.0, 0.0], place]) - rover, axis=1)
    found = weights(kernel.DIM, place, rover)
    np.testing.assert_allclose(found, (inverse / inverse.sum())[1:], rtol=1e-14)


def test_stations_on_a_line_give_the_slope_along_it_alone():
    along = np.array([0.6, 0.8])
    place = np.array([50.0, 120.0, -70.0])[:, None] * KM * along
    rover = np.array([30.0, -10.0]) * KM
    np.testing.assert_allclose(
        weights(kernel.LIM, place, rover), rover @ np.linalg.pinv(place, rcond=1e-9), atol=1e-13
    )
    across = np.array([-0.8, 0.6])
    for method in (kernel.LIM, kernel.LCM):
        found = weights(method, place, rover)
        np.testing.assert_allclose(found @ place, (rover @ along) * along, rtol=1e-12)
        np.testing.assert_allclose(
            weights(method, place, rover + 40 * KM * across), found, atol=1e-12
        )


@given(
    st.lists(st.floats(-150, 150), min_size=2, max_size=2),
    st.floats(-9e-3, 9e-3),
    st.sampled_from([kernel.LIM, kernel.LCM]),
)
@settings(max_examples=50, deadline=None)
def test_stations_nearly_on_a_line_make_no_large_weights(rover, off, method):
    place = np.array([[60.0, 0.0], [140.0, 140.0 * off]]) * KM
    found = weights(method, place, np.array(rover) * KM)
    assert np.abs(found).max() < 3.0


def test_a_station_that_is_not_used_is_not_there():
    rng = np.random.default_rng(6)
    place, rover = network(rng, 5), rng.uniform(-100, 100, 2) * KM
    used = np.array([True, False, True, True, False])
    for method in METHODS:
        found = weights(method, place, rover, used)
        assert (found[~used] == 0.0).all()
        np.testing.assert_array_equal(found[used], weights(method, place[used], rover))


def test_misfit_is_what_least_squares_leaves():
    rng = np.random.default_rng(7)
    errors = rng.normal(0.0, 0.1, 3)
    use = np.ones(3, dtype=bool)
    slopes = np.linalg.lstsq(RECTANGLE, errors, rcond=None)[0]
    left = errors - RECTANGLE @ slopes
    found = kernel.plane_misfit(RECTANGLE, use, errors)
    assert found == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-12)
    use[1] = False
    assert kernel.plane_misfit(RECTANGLE, use, errors) == 0.0
    line = np.array([[10.0, 20.0], [20.0, 40.0]]) * KM
    two = np.ones(2, dtype=bool)
    assert kernel.plane_misfit(line, two, np.array([0.1, 0.2])) == pytest.approx(0.0, abs=1e-15)
    assert kernel.plane_misfit(line, two, np.array([0.1, 0.1])) == pytest.approx(
        np.sqrt(np.mean(np.square(np.array([0.1, 0.1]) - 0.06 * np.array([1.0, 2.0])))), rel=1e-9
    )


def prediction(weights, place, rover, sigmas, slope=0.0, curvature=0.0):
    return kernel.prediction_sigma(
        weights, place, np.ones(len(weights), dtype=bool), *rover, sigmas, slope, curvature
    )


def test_deviation_of_errors_that_share_the_master():
    rng = np.random.default_rng(8)
    w = np.array([0.7, -0.2, 0.4])
    rover = (0.0, 0.0)
    one = np.array([1.0, 0.0, 0.0])
    assert prediction(one, RECTANGLE, rover, np.full(3, 0.02)) == pytest.approx(0.02, rel=1e-15)
    own, master = rng.normal(size=(400_000, 3)), rng.normal(size=(400_000, 1))
    sampled = np.std((own - master) @ w)
    assert prediction(w, RECTANGLE, rover, np.full(3, np.sqrt(2.0))) == pytest.approx(
        sampled, rel=0.01
    )


def test_deviation_of_a_field_is_that_of_drawn_fields():
    """Slopes and symmetric second derivatives drawn; any weights, any rover."""
    rng = np.random.default_rng(9)
    slope, curvature = 4e-6, 3e-11
    w, rover = np.array([0.5, 0.1, 0.2]), np.array([40.0, 70.0]) * KM
    n = 400_000
    g = slope * rng.normal(size=(n, 2))
    # The covariance of x' K x / 2 is curvature^2 (x . y)^2 / 2 for these second derivatives.
    d = curvature * rng.normal(size=(n, 2))
    c = curvature / np.sqrt(2.0) * rng.normal(size=n)

    def field(x):
        quadratic = 0.5 * (d[:, 0] * x[0] ** 2 + d[:, 1] * x[1] ** 2)
        return g @ x + np.sqrt(2.0) * (quadratic + c * x[0] * x[1])

    miss = field(rover) - sum(a * field(x) for a, x in zip(w, RECTANGLE, strict=True))
    found = prediction(w, RECTANGLE, rover, np.zeros(3), slope, curvature)
    assert found == pytest.approx(np.std(miss), rel=0.01)


def test_one_station_does_not_know_the_slope_across():
    place, rover = np.array([[100.0, 0.0]]) * KM, np.array([50.0, 30.0]) * KM
    found = prediction(np.array([0.5]), place, rover, np.zeros(1), slope=4e-6)
    assert found == pytest.approx(4e-6 * 30 * KM, rel=1e-12)


def test_collocation_is_the_best_linear_prediction():
    rover, slope, curvature = np.array([40.0, 70.0]) * KM, 4e-6, 3e-12
    sigmas = np.array([0.01, 0.02, 0.03])
    use = np.ones(3, dtype=bool)

    def kernel_of(a, b):
        dot = a @ b.T
        return slope**2 * dot + 0.5 * curvature**2 * dot**2

    noise = 0.5 * np.outer(sigmas, sigmas) + 0.5 * np.diag(sigmas**2) + 1e-8 * np.eye(3)
    want = np.linalg.solve(
        kernel_of(RECTANGLE, RECTANGLE) + noise, kernel_of(RECTANGLE, rover[None])[:, 0]
    )
    w = np.zeros(3)
    kernel.collocation_weights(RECTANGLE, use, *rover, sigmas, slope, curvature, w)
    np.testing.assert_allclose(w, want, rtol=1e-9)
    best = prediction(w, RECTANGLE, rover, sigmas, slope, curvature)
    rng = np.random.default_rng(10)
    for step in rng.normal(0.0, 0.05, (20, 3)):
        assert prediction(w + step, RECTANGLE, rover, sigmas, slope, curvature) > best
    use[1] = False
    kernel.collocation_weights(RECTANGLE, use, *rover, sigmas, slope, curvature, w)
    two = [0, 2]
    want = np.linalg.solve(
        (kernel_of(RECTANGLE, RECTANGLE) + noise)[np.ix_(two, two)],
        kernel_of(RECTANGLE, rover[None])[two, 0],
    )
    np.testing.assert_allclose(w[two], want, rtol=1e-9)
    assert w[1] == 0.0


@given(st.floats(0, 1e10), st.floats(-1e10, 1e10), st.floats(0, 1e10))
@settings(max_examples=200, deadline=None)
def test_pseudo_inverse_of_what_is_clearly_definite_or_flat(a, b, c):
    """Random symmetric matrices, made semidefinite; numpy with the same threshold."""
    root = np.array([[a, b], [0.0, c]]) / 1e5
    M = root.T @ root
    values = np.linalg.eigvalsh(M)
    if values[1] < 1e-6 or 0.9e-4 < values[0] / values[1] < 1.1e-4:
        return
    x, y, z, rank = kernel.pseudo_inverse(M[0, 0], M[0, 1], M[1, 1])
    want = np.linalg.pinv(M, rcond=1e-4, hermitian=True)
    assert rank == np.linalg.matrix_rank(M, tol=1e-4 * values[1], hermitian=True)
    np.testing.assert_allclose([[x, y], [y, z]], want, atol=1e-9 * np.abs(want).max())
