"""Ambiguity resolution: published example, brute force, RTKLIB, invariants and simulation."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf
from scipy import stats

from replay.estimation import lambda_method as lm
from replay.kernels import ambiguity as am
from replay.kernels import ambiguity_search as search
from replay.kernels import distributions

rtklib = pytest.importorskip("pyrtklib")

PUBLISHED_Q = np.array([[6.290, 5.978, 0.544], [5.978, 6.292, 2.340], [0.544, 2.340, 6.288]])
PUBLISHED_A = np.array([5.450, 3.100, 2.970])


def random_covariance(rng, n, *, rank=3, noise=0.02, scale=1.0):
    """A few precise phases and an imprecise geometry, as in a short observation span."""
    A = rng.normal(size=(n, min(rank, n)))
    return scale * (A @ A.T + noise * (np.eye(n) + 0.3))


def reduced(Q):
    n = len(Q)
    L, D = np.empty((n, n)), np.empty(n)
    Zt, inverse = np.empty((n, n), np.int64), np.empty((n, n), np.int64)
    assert am.factorise(Q, L, D) == am.OK
    assert am.reduce(L, D, Zt, inverse) == am.OK
    return L, D, Zt, inverse


def brute_force(a, Q, count, half):
    centre = np.rint(a).astype(int)
    grid = np.array(list(itertools.product(range(-half, half + 1), repeat=len(a)))) + centre
    inverse = np.linalg.inv(Q)
    norms = np.einsum("ij,jk,ik->i", grid - a, inverse, grid - a)
    order = np.argsort(norms, kind="stable")[:count]
    return grid[order], norms[order]


def of_rtklib(a, Q, count):
    n = len(a)
    A, C = rtklib.Arr1Ddouble(n), rtklib.Arr1Ddouble(n * n)
    F, s = rtklib.Arr1Ddouble(n * count), rtklib.Arr1Ddouble(count)
    for i in range(n):
        A[i] = float(a[i])
    for i, value in enumerate(Q.ravel()):
        C[i] = float(value)
    assert getattr(rtklib, "lambda")(n, count, A, C, F, s) == 0
    fixed = np.array([F[i] for i in range(n * count)]).reshape(count, n)
    return fixed, np.array([s[i] for i in range(count)])


def determinant(M):
    """Exact, by Bareiss's elimination with fractions."""
    rows = [[Fraction(int(v)) for v in row] for row in M]
    value = Fraction(1)
    for i in range(len(rows)):
        pivot = next((r for r in range(i, len(rows)) if rows[r][i]), None)
        if pivot is None:
            return 0
        if pivot != i:
            rows[i], rows[pivot] = rows[pivot], rows[i]
            value = -value
        value *= rows[i][i]
        for r in range(i + 1, len(rows)):
            factor = rows[r][i] / rows[i][i]
            rows[r] = [x - factor * y for x, y in zip(rows[r], rows[i], strict=True)]
    return value


def bootstrapped(L, D, samples, rng):
    """Part of the samples that sequential rounding gets right."""
    n = len(D)
    z = rng.normal(size=(samples, n)) * np.sqrt(D) @ L
    right = np.ones(samples, bool)
    for k in range(n - 1, -1, -1):
        right &= np.rint(z[:, k]) == 0
        z -= (z[:, k] - np.rint(z[:, k]))[:, None] * np.where(np.arange(n) < k, L[k], 0.0)
    return right.mean()


# ------------------------------------------------------------------------------- special functions


def test_erf_and_erfc_against_mpmath():
    rng = np.random.default_rng(1)
    x = np.r_[rng.uniform(-6, 6, 3000), rng.uniform(-1, 1, 2000), rng.uniform(1, 3, 2000)]
    x = np.r_[x, 10.0 ** rng.uniform(-300, 0, 200), 0.84375, 1.25, 1 / 0.35, 6.0, 5.999999]
    with mp.workprec(200):
        worst = max(
            abs(mpf(distributions.erf(v)) - mp.erf(v)) / mpf(math.ulp(distributions.erf(v)))
            for v in x
        )
        y = np.r_[x, rng.uniform(6, 26, 1000)]
        worst_c = max(
            abs(mpf(distributions.erfc(v)) - mp.erfc(v)) / mpf(math.ulp(distributions.erfc(v)))
            for v in y
        )
    print(f"erf {float(worst):.2f} ulp, erfc {float(worst_c):.2f} ulp")
    assert worst < 1.0
    assert worst_c < 3.0


def test_erf_at_the_ends():
    assert distributions.erf(math.inf) == 1.0 and distributions.erf(-math.inf) == -1.0
    assert distributions.erfc(math.inf) == 0.0 and distributions.erfc(-math.inf) == 2.0
    assert math.isnan(distributions.erf(math.nan)) and math.isnan(distributions.erfc(math.nan))
    assert distributions.erf(0.0) == 0.0 and distributions.erfc(0.0) == 1.0


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 20, 33, 64])
def test_chi_square_distribution(n):
    for x in np.r_[0.0, 1e-6, np.linspace(0.01, 4 * n + 20, 60)]:
        assert distributions.chi2_cdf(x, n) == pytest.approx(stats.chi2.cdf(x, n), abs=1e-14)


# ------------------------------------------------------------------------------- published example


def test_example_of_de_jonge_and_tiberius():
    solution = lm.resolve(PUBLISHED_A, PUBLISHED_Q)
    assert solution.status is lm.Status.OK
    assert solution.candidates.tolist() == [[5, 3, 4], [6, 4, 4]]
    assert solution.norms == pytest.approx([0.2183, 0.3073], abs=5e-5)
    grid, norms = brute_force(PUBLISHED_A, PUBLISHED_Q, 2, 6)
    assert solution.candidates.tolist() == grid.tolist()
    assert solution.norms == pytest.approx(norms, rel=1e-12)
    # The diagonal of the decorrelated covariance in the report: 4.476, 1.146, 0.626.
    L, D, _, _ = reduced(PUBLISHED_Q)
    assert np.diag(L.T * D @ L) == pytest.approx([4.476, 1.146, 0.626], abs=1e-12)


# --------------------------------------------------------------------------- brute force, RTKLIB


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 4), st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_search_finds_what_brute_force_finds(n, seed, count):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    Q = root @ root.T + 0.3 * np.eye(n)
    a = rng.uniform(-20, 20, n)
    solution = lm.resolve(a, Q, candidates=count)
    # The ellipsoid through the worst candidate lies within the box.
    half = math.ceil(math.sqrt(solution.norms[-1] * Q.diagonal().max())) + 1
    if (2 * half + 1) ** n > 300_000:
        return
    grid, norms = brute_force(a, Q, count, half)
    assert solution.norms == pytest.approx(norms, rel=1e-9)
    assert solution.candidates.tolist() == grid.tolist()


@pytest.mark.parametrize("n", range(1, 13))
def test_agrees_with_rtklib(n):
    rng = np.random.default_rng(100 + n)
    for _ in range(40):
        Q = random_covariance(rng, n, scale=10.0 ** rng.uniform(-2, 0.5))
        a = rng.uniform(-1e3, 1e3, n)
        fixed, norms = of_rtklib(a, Q, 2)
        solution = lm.resolve(a, Q)
        # RTKLIB transforms back in floats.
        assert solution.candidates.tolist() == np.rint(fixed).tolist()
        assert np.abs(fixed - np.rint(fixed)).max() < 1e-6
        # RTKLIB inverts Q; neither is exact where Q is ill conditioned.
        assert solution.norms == pytest.approx(norms, rel=1e-6)


# ------------------------------------------------------------------------------------- invariants


@pytest.mark.parametrize("n", [1, 2, 5, 12, 25, 60])
def test_transform_is_unimodular_and_decorrelates(n):
    rng = np.random.default_rng(n)
    Q = random_covariance(rng, n)
    L, D, Zt, inverse = reduced(Q)
    assert abs(determinant(Zt)) == 1
    # Python's integers do not overflow: Z' times the transposed inverse.
    exact = Zt.astype(object) @ inverse.T.astype(object)
    assert (exact == np.eye(n, dtype=int)).all()
    assert np.array_equal(np.triu(L), np.eye(n))
    assert np.abs(np.tril(L, -1)).max(initial=0.0) <= 0.5 + 1e-9
    np.testing.assert_allclose(L.T * D @ L, Zt @ Q @ Zt.T, rtol=1e-8, atol=1e-9)
    assert np.log(D).sum() == pytest.approx(np.linalg.slogdet(Q)[1], rel=1e-8, abs=1e-6)
    # Lovász's condition, which is what the permutations are for.
    for j in range(n - 1):
        assert D[j] + L[j + 1, j] ** 2 * D[j + 1] >= D[j + 1] * (1 - 1e-6)


@pytest.mark.parametrize("n", [2, 6, 20])
def test_norms_are_those_of_the_original_space(n):
    rng = np.random.default_rng(n)
    Q, a = random_covariance(rng, n), rng.uniform(-50, 50, n)
    solution = lm.resolve(a, Q, candidates=4)
    miss = solution.candidates - a
    assert solution.norms == pytest.approx(
        np.einsum("ij,ij->i", miss, np.linalg.solve(Q, miss.T).T), rel=1e-8
    )
    assert (np.diff(solution.norms) >= 0).all()
    apart = (solution.candidates[1] - solution.candidates[0]).astype(float)
    assert solution.separation == pytest.approx(apart @ np.linalg.solve(Q, apart), rel=1e-8)
    assert solution.adop == pytest.approx(math.exp(np.linalg.slogdet(Q)[1] / (2 * n)), rel=1e-8)


def test_large_integer_parts_change_nothing():
    rng = np.random.default_rng(4)
    Q = random_covariance(rng, 10)
    a = np.rint(rng.uniform(-20, 20, 10)) + rng.integers(-16, 17, 10) / 64.0
    shift = rng.integers(-(10**8), 10**8, 10)
    near, far = lm.resolve(a, Q), lm.resolve(a + shift, Q)
    assert (far.candidates - shift == near.candidates).all()
    assert far.norms.tobytes() == near.norms.tobytes()
    one = lm.resolve_partial(a, Q, 0.5)
    two = lm.resolve_partial(a + shift, Q, 0.5)
    assert (two.values - one.values == two.combinations @ shift).all()


@settings(max_examples=30, deadline=None)
@given(st.integers(2, 20), st.integers(0, 2**32 - 1))
def test_order_of_the_ambiguities_does_not_matter(n, seed):
    rng = np.random.default_rng(seed)
    Q, a = random_covariance(rng, n), rng.uniform(-50, 50, n)
    order = rng.permutation(n)
    one, two = lm.resolve(a, Q), lm.resolve(a[order], Q[np.ix_(order, order)])
    assert one.candidates[:, order].tolist() == two.candidates.tolist()
    assert one.norms == pytest.approx(two.norms, rel=1e-7)


# ------------------------------------------------------------------------------------- robustness


@pytest.mark.parametrize(
    "Q",
    [
        np.zeros((2, 2)),
        -np.eye(2),
        np.ones((2, 2)),
        np.array([[1.0, 2.0], [2.0, 1.0]]),
        np.full((2, 2), np.nan),
        np.diag([np.inf, 1.0]),
    ],
)
def test_covariance_that_is_not_positive_definite(Q):
    a = np.array([0.2, 0.7])
    for found in (lm.resolve(a, Q), lm.resolve_partial(a, Q, 0.9)):
        assert found.status is lm.Status.NOT_POSITIVE_DEFINITE
        assert found.norms.size == 0 and math.isnan(found.success_rate)
        assert not lm.validate(found, lm.Test.W_RATIO, 0.0).accepted
    with pytest.raises(ValueError, match="not positive definite"):
        lm.failure_rate_threshold(Q, 0.01)


def test_singular_covariance_of_higher_rank():
    root = np.random.default_rng(0).normal(size=(12, 5))
    assert lm.resolve(np.zeros(12), root @ root.T).status is lm.Status.NOT_POSITIVE_DEFINITE


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e12])
def test_float_that_is_no_ambiguity(value):
    assert lm.resolve(np.array([0.1, value]), np.eye(2)).status is lm.Status.OUT_OF_RANGE


def test_too_many_ambiguities_and_too_many_nodes():
    assert lm.resolve(np.zeros(65), np.eye(65)).status is lm.Status.OUT_OF_RANGE
    solution = lm.resolve(np.full(5, 0.4), np.eye(5), node_limit=5)
    assert solution.status is lm.Status.SEARCH_LIMIT
    assert solution.norms.size == 0 and 0 < solution.success_rate < 1


def test_transform_that_outgrows_its_integers():
    Q = np.array([[1e18, 1e9], [1e9, 1.5]])
    assert lm.resolve(np.array([0.3, 0.4]), Q).status is lm.Status.OUT_OF_RANGE


def test_one_ambiguity():
    solution = lm.resolve(np.array([3.2]), np.array([[0.04]]), candidates=3)
    assert solution.candidates.ravel().tolist() == [3, 4, 2]
    assert solution.norms == pytest.approx([1.0, 16.0, 36.0])
    assert solution.adop == pytest.approx(0.2)
    expected = 2 * stats.norm.cdf(2.5) - 1
    assert solution.success_rate == pytest.approx(expected, rel=1e-14)
    assert solution.bootstrapped_bound == pytest.approx(expected, rel=1e-14)
    assert solution.least_squares_bound == pytest.approx(expected, rel=1e-14)


def test_equal_variances_need_no_transform():
    _, D, Zt, _ = reduced(0.01 * np.eye(6))
    assert np.array_equal(Zt, np.eye(6)) and (D == 0.01).all()
    solution = lm.resolve(np.full(6, 0.5), 0.01 * np.eye(6), candidates=64)
    assert len({tuple(c) for c in solution.candidates}) == 64
    assert solution.norms == pytest.approx(np.full(64, 150.0))


def test_sixty_ambiguities():
    rng = np.random.default_rng(60)
    Q = random_covariance(rng, 60, rank=4, noise=0.002)
    truth = rng.integers(-(10**6), 10**6, 60)
    a = truth + np.linalg.cholesky(Q) @ rng.normal(size=60)
    solution = lm.resolve(a, Q)
    assert solution.status is lm.Status.OK
    assert (solution.candidates[0] == truth).all()
    assert solution.success_rate > 0.99


def test_strong_model_whose_second_candidate_is_too_far():
    rng = np.random.default_rng(40)
    A = 2.6 * rng.normal(size=(40, 3))
    Q = A @ A.T + 2.5e-4 * (np.eye(40) + 1.0)
    Q = 0.5 * (Q + Q.T)
    truth = rng.integers(-1000, 1000, 40)
    a = truth + np.linalg.cholesky(Q) @ rng.normal(size=40)
    two = lm.resolve(a, Q, node_limit=100_000)
    assert two.status is lm.Status.SEARCH_LIMIT and two.success_rate > 0.999
    one = lm.resolve(a, Q, candidates=1, node_limit=100_000)
    assert one.status is lm.Status.OK and (one.candidates[0] == truth).all()


def test_same_bits_again():
    rng = np.random.default_rng(9)
    Q, a = random_covariance(rng, 15), rng.uniform(-5, 5, 15)
    one, two = lm.resolve_partial(a, Q, 0.9), lm.resolve_partial(a, Q, 0.9)
    assert one.covariance.tobytes() == two.covariance.tobytes()
    assert one.ambiguities.tobytes() == two.ambiguities.tobytes()


def test_wrong_arguments():
    with pytest.raises(ValueError, match="shape"):
        lm.resolve(np.zeros(2), np.eye(3))
    with pytest.raises(ValueError, match="symmetric"):
        lm.resolve(np.zeros(2), np.array([[1.0, 0.5], [0.0, 1.0]]))
    with pytest.raises(ValueError, match="candidates"):
        lm.resolve(np.zeros(2), np.eye(2), candidates=0)
    with pytest.raises(ValueError, match="success rate"):
        lm.resolve_partial(np.zeros(2), np.eye(2), 1.5)
    one = lm.resolve(np.zeros(2), np.eye(2), candidates=1)
    with pytest.raises(ValueError, match="two best"):
        lm.validate(one, lm.Test.F_RATIO, 2.0)


# ---------------------------------------------------------------------------------- success rates


@pytest.mark.parametrize("scale", [0.03, 0.1, 0.3])
def test_success_rates_against_simulation(scale):
    rng = np.random.default_rng(7)
    Q = random_covariance(rng, 6, noise=0.2, scale=scale)
    L, D, _, _ = reduced(Q)
    samples = 100_000
    solution = lm.resolve(np.zeros(6), Q)
    p = solution.success_rate
    assert bootstrapped(L, D, samples, rng) == pytest.approx(
        p, abs=4 * math.sqrt(p * (1 - p) / samples) + 1e-6
    )
    assert solution.failure_rate == pytest.approx(1 - p, abs=1e-14)
    found = lm.failure_rate_threshold(Q, 0.01, samples=samples, seed=3)
    slack = 4 * math.sqrt(p * (1 - p) / samples) + 1e-6
    assert p - slack <= found.success_rate <= solution.least_squares_bound + slack
    assert p <= solution.bootstrapped_bound * (1 + 1e-12)


def test_small_failure_rates_keep_their_digits():
    D = np.full(4, 0.06**2)
    one = 2 * stats.norm.sf(1 / 0.12)
    assert am.bootstrapped_failure(D, 0) == pytest.approx(4 * one, rel=1e-10)


# ------------------------------------------------------------------------------------ ratio tests


def test_statistics_of_the_published_example():
    solution = lm.resolve(PUBLISHED_A, PUBLISHED_Q)
    best, second = solution.norms
    apart = np.array([1.0, 1.0, 0.0])
    separation = apart @ np.linalg.solve(PUBLISHED_Q, apart)

    def statistic(test, **more):
        return lm.validate(solution, test, 1.5, **more).statistic

    assert statistic(lm.Test.F_RATIO) == pytest.approx(second / best)
    assert statistic(lm.Test.F_RATIO, float_form=2.0) == pytest.approx((2 + second) / (2 + best))
    assert statistic(lm.Test.DIFFERENCE) == pytest.approx(second - best)
    assert statistic(lm.Test.W_RATIO) == pytest.approx((second - best) / (2 * separation**0.5))
    assert not lm.validate(solution, lm.Test.F_RATIO, 1.5).accepted
    assert lm.validate(solution, lm.Test.F_RATIO, 1.4).accepted


def test_w_ratio_is_normal_with_unit_variance():
    # Of two given integer vectors the first of which is right.
    rng = np.random.default_rng(5)
    Q = random_covariance(rng, 5)
    other = np.array([1.0, -1.0, 0.0, 2.0, 0.0])
    weight = np.linalg.inv(Q)
    a = rng.normal(size=(50_000, 5)) @ np.linalg.cholesky(Q).T
    best = np.einsum("ij,jk,ik->i", a, weight, a)
    second = np.einsum("ij,jk,ik->i", a - other, weight, a - other)
    separation = other @ weight @ other
    w = np.array([search.w_ratio(*x, separation) for x in zip(best, second, strict=True)])
    assert w.std() == pytest.approx(1.0, abs=0.02)
    assert w.mean() == pytest.approx(math.sqrt(separation) / 2, abs=0.03)


def test_float_that_is_integer():
    solution = lm.resolve(np.array([3.0, -2.0]), 0.01 * np.eye(2))
    assert lm.validate(solution, lm.Test.F_RATIO, 3.0).statistic == math.inf
    # The largest the W-ratio can be is half the distance of the candidates.
    w = lm.validate(solution, lm.Test.W_RATIO, 3.0).statistic
    assert w == pytest.approx(math.sqrt(solution.separation) / 2)


@pytest.mark.parametrize("scale", [0.1, 0.3])
def test_failure_rate_is_kept_on_other_samples(scale):
    rng = np.random.default_rng(11)
    Q = random_covariance(rng, 5, noise=0.2, scale=scale)
    wanted, samples = 0.01, 40_000
    threshold = lm.failure_rate_threshold(Q, wanted, samples=samples, seed=1)
    assert threshold.failure_rate <= wanted
    assert threshold.failure_rate >= wanted - 1.5 / samples or threshold.ratio == 1.0
    a = rng.normal(size=(20_000, 5)) @ np.linalg.cholesky(Q).T
    failed = accepted = 0
    for x in a:
        solution = lm.resolve(x, Q)
        test = lm.validate(solution, lm.Test.FIXED_FAILURE_RATE, threshold.ratio)
        accepted += test.accepted
        failed += test.accepted and bool(solution.candidates[0].any())
    assert failed / len(a) <= wanted + 5 * math.sqrt(wanted / len(a))
    assert accepted / len(a) == pytest.approx(threshold.fix_rate, abs=0.02)


def test_threshold_depends_on_the_seed_alone():
    Q = random_covariance(np.random.default_rng(2), 4, noise=0.2, scale=0.3)
    one = lm.failure_rate_threshold(Q, 0.01, samples=5000, seed=1)
    assert one == lm.failure_rate_threshold(Q, 0.01, samples=5000, seed=1)
    assert one != lm.failure_rate_threshold(Q, 0.01, samples=5000, seed=2)


def test_threshold_where_all_or_little_may_be_believed():
    strong = lm.failure_rate_threshold(1e-4 * np.eye(3), 0.01, samples=2000)
    assert (strong.ratio, strong.fix_rate, strong.success_rate) == (1.0, 1.0, 1.0)
    weak = lm.failure_rate_threshold(4.0 * np.eye(3), 0.01, samples=2000)
    assert weak.ratio > 3.0 and weak.failure_rate == 0.01 and weak.fix_rate < 0.03
    with pytest.raises(ValueError, match="samples tell nothing"):
        lm.failure_rate_threshold(np.eye(3), 1e-4, samples=2000)


def test_simulated_floats_have_the_covariance():
    L, D, _, _ = reduced(PUBLISHED_Q)
    uniform = np.random.default_rng(1).random((20_000, 4))
    ratio, right = np.empty(20_000), np.empty(20_000, bool)
    assert search.simulate(L, D, uniform, 10**6, ratio, right) == am.OK
    rng = np.random.default_rng(2)
    a = rng.normal(size=(20_000, 3)) @ np.linalg.cholesky(PUBLISHED_Q).T
    expected = np.mean([not lm.resolve(x, PUBLISHED_Q).candidates[0].any() for x in a])
    assert right.mean() == pytest.approx(expected, abs=5 * math.sqrt(0.035 / 20_000))
    assert (ratio >= 0).all() and (ratio <= 1).all()


# --------------------------------------------------------------------------------- partial fixing


@pytest.mark.parametrize("least", [0.5, 0.9, 0.999])
def test_largest_subset_with_the_success_rate(least):
    rng = np.random.default_rng(21)
    spread = np.diag(np.geomspace(0.03, 3.0, 10))
    Q = spread @ random_covariance(rng, 10, rank=2, noise=0.3) @ spread
    a = rng.uniform(-1e4, 1e4, 10)
    _, D, Zt, _ = reduced(Q)
    partial = lm.resolve_partial(a, Q, least)
    k = len(partial.combinations)
    assert 0 < k < 10
    assert partial.success_rate >= least > am.bootstrapped_success(D, 10 - k - 1)
    assert np.array_equal(partial.combinations, Zt[10 - k :])

    # The subset is a problem of its own, and the rest follows by conditioning.
    F = partial.combinations.astype(float)
    own = lm.resolve(F @ a, F @ Q @ F.T)
    assert own.candidates.tolist() == partial.values.tolist()
    assert own.norms == pytest.approx(partial.norms, rel=1e-6)
    assert own.separation == pytest.approx(partial.separation, rel=1e-6)
    gain = np.linalg.solve(F @ Q @ F.T, F @ Q).T
    assert partial.ambiguities == pytest.approx(a + gain @ (partial.values[0] - F @ a), abs=1e-6)
    assert partial.covariance == pytest.approx(Q - gain @ F @ Q, abs=1e-8)
    assert F @ partial.ambiguities == pytest.approx(partial.values[0].astype(float), abs=1e-6)


def test_all_and_nothing_of_a_partial_solution():
    rng = np.random.default_rng(22)
    Q, a = random_covariance(rng, 6), rng.uniform(-100, 100, 6)
    everything, full = lm.resolve_partial(a, Q, 0.0), lm.resolve(a, Q)
    assert everything.ambiguities == pytest.approx(full.candidates[0].astype(float), abs=1e-9)
    assert everything.norms == pytest.approx(full.norms)
    assert not everything.covariance.any()
    nothing = lm.resolve_partial(a, 10.0 * np.eye(6), 0.99)
    assert nothing.status is lm.Status.NO_SUBSET
    assert nothing.combinations.shape == (0, 6) and nothing.values.shape == (0, 0)
    assert np.array_equal(nothing.ambiguities, a)
