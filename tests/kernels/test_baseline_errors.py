"""Filters of errors between stations against dense algebra and the theory of linear filters."""

import numpy as np
import pytest
from scipy import linalg, stats

from replay.kernels import baseline_errors as kernel

NS = 1_000_000_000
T0 = 1_300_000_000 * NS
H = np.array([1.0, 0.0, 0.0, 1.0])
L1, L2 = ord("1") + 256 * ord("C"), ord("2") + 256 * ord("W")
TAU = 30.0
NOISE = 2e-7


def settings(**changes):
    cfg = np.zeros(1, dtype=kernel.ERRORS_CONFIG_DTYPE)
    cfg["sigma"] = 1.0, 1e-3, 1e-6
    cfg["noise"], cfg["tau"] = NOISE, TAU
    cfg["gate"], cfg["rejections"], cfg["gap"] = 0.0, 5, 60 * NS
    for name, value in changes.items():
        cfg[name] = value
    return cfg[0]


def table(rows):
    """Residuals from tuples of seconds, satellite, reference, signal, residual, two variances."""
    out = np.zeros(len(rows), dtype=kernel.RESIDUAL_ROW_DTYPE)
    for k, (t, satellite, reference, signal, z, noise, multipath) in enumerate(rows):
        out[k]["t"] = out[k]["log_t"] = T0 + round(t * NS)
        out[k]["satellite"], out[k]["reference"], out[k]["signal"] = satellite, reference, signal
        out[k]["z"], out[k]["noise"], out[k]["multipath"] = z, noise, multipath
    return out


class Run:
    """Filters that go on from call to call."""

    def __init__(self):
        self.filters = np.zeros(0, dtype=kernel.FILTER_DTYPE)
        self.last = -1

    def take(self, rows, cfg):
        count = len(self.filters)
        filters = np.zeros(count + len(rows), dtype=kernel.FILTER_DTYPE)
        filters[:count] = self.filters
        out = np.zeros(len(rows), dtype=kernel.ERROR_ROW_DTYPE)
        count, self.last, written = kernel.run_errors(filters, count, self.last, cfg, rows, out)
        self.filters = filters[:count].copy()
        return out[:written]

    def of(self, satellite, signal=L1):
        found = self.filters[
            (self.filters["satellite"] == satellite) & (self.filters["signal"] == signal)
        ]
        assert len(found) == 1
        return found[0]


def discrete(T, multipath):
    """Transition and process noise by matrix exponentials (Van Loan 1978)."""
    A = np.zeros((4, 4))
    A[0, 1] = A[1, 2] = 1.0
    A[3, 3] = -1.0 / TAU
    G = np.diag([0.0, 0.0, NOISE**2, 2.0 * multipath / TAU])
    big = np.zeros((8, 8))
    big[:4, :4], big[:4, 4:], big[4:, 4:] = -A, G, A.T
    e = linalg.expm(big * T)
    F = e[4:, 4:].T
    return F, F @ e[:4, 4:]


def textbook(times, z, noise, multipath):
    """States, deviations and innovations of a dense filter."""
    x, P = np.zeros(4), np.diag([1.0, 1e-6, 1e-12, multipath])
    found, last = [], None
    for t, value in zip(times, z, strict=True):
        innovation = spread = np.nan
        if last is not None:
            F, Q = discrete(t - last, multipath)
            x, P = F @ x, F @ P @ F.T + Q
            innovation, spread = value - H @ x, np.sqrt(H @ P @ H + noise)
        K = P @ H / (H @ P @ H + noise)
        x = x + K * (value - H @ x)
        joseph = np.eye(4) - np.outer(K, H)
        P = joseph @ P @ joseph.T + noise * np.outer(K, K)
        found.append((x, np.sqrt(np.diag(P)), innovation, spread))
        last = t
    return found


def test_a_dense_filter_finds_the_same():
    rng = np.random.default_rng(1)
    pairs = [(3, 9, L1), (3, 9, L2), (40, 41, L1), (110, 120, L1)]
    times = np.cumsum(rng.choice([1.0, 0.5, 7.0, 20.0], 120))
    seen = rng.uniform(size=(120, len(pairs))) < 0.8
    z = np.cumsum(rng.normal(0.0, 0.003, (120, len(pairs))), axis=0)
    rows = [
        (t, s, ref, signal, z[k, p], 4e-5 * (1 + p), 6e-5 / (1 + p))
        for k, t in enumerate(times)
        for p, (s, ref, signal) in enumerate(pairs)
        if seen[k, p]
    ]
    rows = table(rows)
    rows["system"] = np.array([0 if s < 32 else 2 if s < 104 else 3 for s in rows["satellite"]])
    out = Run().take(rows, settings(gap=10_000 * NS))
    assert len(out) == seen.sum()
    for p, (s, _, signal) in enumerate(pairs):
        own = out[(out["satellite"] == s) & (out["signal"] == signal)]
        use = seen[:, p]
        want = textbook(times[use], z[use, p], 4e-5 * (1 + p), 6e-5 / (1 + p))
        for place, name in enumerate(("x", "sigma", "innovation", "innovation_sigma")):
            expected = np.array([row[place] for row in want])
            scale = np.nanmax(np.abs(expected), axis=0)
            error = np.abs(own[name] - expected) / scale
            assert np.array_equal(np.isnan(own[name]), np.isnan(expected))
            assert np.nanmax(error) < 1e-8, name


def test_two_steps_add_what_one_does():
    one, first, second = (np.zeros((3, 3)) for _ in range(3))
    kernel.motion_noise(0.3, 5.0, one)
    kernel.motion_noise(0.3, 2.0, first)
    kernel.motion_noise(0.3, 3.0, second)
    F = np.array([[1.0, 3.0, 4.5], [0.0, 1.0, 3.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(F @ first @ F.T + second, one, rtol=1e-13)


def test_a_parabola_without_noise_is_followed():
    times = np.arange(200.0)
    curve = 0.12 - 4e-4 * times + 0.5 * 3e-6 * times**2
    rows = table([(t, 5, 7, L1, z, 1e-12, 0.0) for t, z in zip(times, curve, strict=True)])
    out = Run().take(rows, settings(noise=0.0, sigma=(1e3, 1e2, 1.0)))
    late = slice(20, None)
    assert np.abs(out["x"][late, 0] - curve[late]).max() < 1e-6
    assert np.abs(out["x"][100:, 1] - (-4e-4 + 3e-6 * times[100:])).max() < 1e-7
    assert np.abs(out["x"][100:, 2] - 3e-6).max() < 1e-8
    assert (out["x"][:, 3] == 0.0).all()


def draw(rng, count, epochs, noise, multipath):
    """Truth and residuals of the filter's own model, T = 1 s."""
    F, Q = discrete(1.0, multipath)
    # The covariance is far from round: its root by eigenvectors of the scaled matrix.
    scale = np.sqrt(np.diag(Q))
    root = np.linalg.cholesky(Q / np.outer(scale, scale)) * scale[:, None]
    x = rng.normal(size=(count, 4)) * np.sqrt([1.0, 1e-6, 1e-12, multipath])
    truth = []
    for k in range(epochs):
        if k:
            x = x @ F.T + rng.normal(size=(count, 4)) @ root.T
        truth.append(x)
    truth = np.array(truth)
    return truth, truth @ H + rng.normal(0.0, np.sqrt(noise), (epochs, count))


def test_innovations_are_white_and_errors_as_large_as_it_says():
    rng = np.random.default_rng(2)
    noise, multipath, count, epochs = 4e-5, 6e-5, 150, 120
    truth, z = draw(rng, count, epochs, noise, multipath)
    run = Run()
    satellites = np.r_[0:100, 110:160]
    rows = [
        (float(k), s, 179, L1, z[k, p], noise, multipath)
        for k in range(epochs)
        for p, s in enumerate(satellites)
    ]
    out = run.take(table(rows), settings())
    normal = (out["innovation"] / out["innovation_sigma"]).reshape(epochs, count)[1:]
    n = normal.size
    low, high = stats.chi2.ppf([0.001, 0.999], n) / n
    assert low < np.mean(normal**2) < high
    for lag in (1, 2, 5, 30):
        correlation = np.sum(normal[lag:] * normal[:-lag])
        terms = normal[lag:].size
        assert abs(correlation) < 3.3 * np.sqrt(terms)
    squares = []
    for p, s in enumerate(satellites):
        f = run.of(s)
        scale = np.sqrt(np.diag(f["P"]))
        e = (truth[-1, p] - f["x"]) / scale
        squares.append(e @ np.linalg.solve(f["P"] / np.outer(scale, scale), e))
    low, high = stats.chi2.ppf([0.001, 0.999], 4 * count) / count
    assert low < np.mean(squares) < high


def test_it_settles_where_riccati_says():
    noise, multipath = 4e-5, 6e-5
    F, Q = discrete(1.0, multipath)
    # Balanced, so that the solver is as precise as the filter.
    s = np.array([1e-2, 1e-4, 1e-6, 1e-2])
    S = np.outer(s, s)
    P = linalg.solve_discrete_are(
        (F * s[None, :] / s[:, None]).T, (H * s)[:, None], Q / S, np.array([[noise]])
    )
    P = P * S
    P = P - np.outer(P @ H, H @ P) / (H @ P @ H + noise)
    rows = table([(float(k), 5, 7, L1, 0.0, noise, multipath) for k in range(6000)])
    out = Run().take(rows, settings())
    np.testing.assert_allclose(out["sigma"][-1], np.sqrt(np.diag(P)), rtol=1e-6)


def constellation(rng, satellites, epochs, sigma):
    """Errors (m) and what is measured of single satellites, station less master."""
    t = np.arange(epochs)[:, None]
    error = rng.normal(0.0, 0.1, satellites) + rng.normal(0.0, 1e-4, satellites) * t
    return error, error + rng.normal(0.0, sigma, (epochs, satellites))


def differences(measured, reference, noise, multipath, start=0, hidden=()):
    return [
        (float(start + k), s, reference, L1, z[s] - z[reference], noise, multipath)
        for k, z in enumerate(measured)
        for s in range(len(z))
        if s != reference and s not in hidden
    ]


def test_another_reference_changes_no_difference_between_satellites():
    rng = np.random.default_rng(3)
    _, measured = constellation(rng, 7, 100, 0.005)
    stay, change = Run(), Run()
    for run in (stay, change):
        run.take(table(differences(measured[:60], 2, 4e-5, 6e-5)), settings())
    # A gate that nothing passes: from here on states are only carried on.
    shut = settings(gate=1e-12, rejections=1000)
    a = stay.take(table(differences(measured[60:], 2, 4e-5, 6e-5, 60)), shut)
    b = change.take(table(differences(measured[60:], 5, 4e-5, 6e-5, 60, hidden=(4,))), shut)
    a = a["x"].reshape(40, 6, 4)
    b = b["x"].reshape(40, 5, 4)
    # Rows of satellites 0 1 3 4 5 6 to satellite 2, and of 0 1 2 3 6 to satellite 5.
    to_two = np.insert(a, 2, 0.0, axis=1)
    to_five = np.insert(np.insert(b, 4, np.nan, axis=1), 5, 0.0, axis=1)
    want = to_two - to_two[:, 5:6]
    for s in (0, 1, 2, 3, 5, 6):
        np.testing.assert_allclose(to_five[:, s], want[:, s], atol=1e-13)
    # The one that had no residuals has followed, too.
    np.testing.assert_allclose(change.of(4)["x"], want[-1, 4], atol=1e-13)
    assert change.of(4)["reference"] == 5


def test_what_is_carried_over_is_never_too_sure():
    """Noise alone: every satellite has its own, the filters think nothing of each other."""
    rng = np.random.default_rng(4)
    before, after = [], []
    for _ in range(60):
        error, measured = constellation(rng, 8, 120, np.sqrt(0.5 * 1e-4))
        run = Run()
        run.take(table(differences(measured[:100], 0, 1e-4, 1e-8)), settings())
        for s in range(1, 8):
            before.append((run.of(s)["x"][0] - error[99, s] + error[99, 0], run.of(s)["P"][0, 0]))
        kernel.follow(run.filters, len(run.filters), 0, L1, 3)
        for s in (0, 1, 2, 4, 5, 6, 7):
            after.append((run.of(s)["x"][0] - error[99, s] + error[99, 3], run.of(s)["P"][0, 0]))
    ratios = []
    for pairs in (before, after):
        misses, variances = np.array(pairs).T
        ratios.append(np.mean(misses**2) / np.mean(variances))
    assert 0.5 < ratios[0] < 1.2
    # The sum holds the old reference twice that is not in the difference at all.
    assert 0.4 < ratios[1] / ratios[0] < 0.75


def test_without_the_new_reference_all_begins_anew():
    rng = np.random.default_rng(5)
    _, measured = constellation(rng, 5, 40, 0.005)
    run = Run()
    run.take(table(differences(measured[:20], 0, 4e-5, 6e-5, hidden=(3,))), settings())
    out = run.take(table(differences(measured[20:], 3, 4e-5, 6e-5, 20)), settings())
    assert np.isnan(out["innovation"][:4]).all()
    assert not np.isnan(out["innovation"][4:]).any()
    assert (run.filters["reference"] == 3).all()


def test_other_signals_and_systems_keep_their_reference():
    run = Run()
    pairs = [(1, 0, L1, 0.1), (1, 0, L2, 0.2), (40, 50, L1, 0.3), (2, 0, L1, 0.4)]
    rows = table([(0.0, *pair, 1e-5, 1e-5) for pair in pairs])
    rows["system"][2] = 2
    run.take(rows, settings())
    run.take(table([(1.0, 2, 1, L1, 0.3, 1e-5, 1e-5)]), settings())
    kept = {(f["satellite"], f["signal"]): f["reference"] for f in run.filters}
    assert kept == {(0, L1): 1, (2, L1): 1, (1, L2): 0, (40, L1): 50}


def test_a_jump_is_left_out_and_then_believed():
    z = np.r_[np.zeros(100), np.full(20, 0.5)]
    rows = table([(float(k), 5, 7, L1, v, 4e-5, 6e-5) for k, v in enumerate(z)])
    out = Run().take(rows, settings(gate=5.0, rejections=4))
    far = np.abs(out["innovation"]) > 5.0 * out["innovation_sigma"]
    assert list(np.flatnonzero(far)) == [100, 101, 102]
    assert np.abs(out["x"][:103, 0]).max() < 1e-9
    assert list(np.flatnonzero(np.isnan(out["innovation"]))) == [0, 103]
    assert np.abs(out["x"][103:, 0] - 0.5).max() < 0.01


@pytest.mark.parametrize(("pause", "anew"), [(59.0, False), (61.0, True)])
def test_a_gap_ends_a_filter(pause, anew):
    other = [(float(k), 6, 7, L1, 0.1, 4e-5, 6e-5) for k in range(80)]
    rows = [row for t in range(80) for row in (
        *([(float(t), 5, 7, L1, 0.2, 4e-5, 6e-5)] if not 5 < t < 5 + pause else []), other[t],
    )]  # fmt: skip
    out = Run().take(table(rows), settings())
    own = out[out["satellite"] == 5]
    assert np.isnan(own["innovation"][1:]).sum() == int(anew)
    assert np.isnan(out[out["satellite"] == 6]["innovation"]).sum() == 1


def test_rows_that_are_not_newer_or_not_numbers_change_nothing():
    good = [(float(k), 5, 7, L1, 0.1 + 1e-4 * k, 4e-5, 6e-5) for k in range(20)]
    bad = [(8.5, 5, 7, L1, 3.0, 4e-5, 6e-5), (9.0, 5, 7, L1, 3.0, 4e-5, 6e-5)]
    blind = [(9.5, 5, 7, L1, np.nan, 4e-5, 6e-5)]
    one, two = Run(), Run()
    a = one.take(table(good), settings())
    b = two.take(table(good[:10] + bad + blind + good[10:]), settings())
    assert len(a) == len(b) == 20
    np.testing.assert_allclose(a["x"], b["x"], rtol=1e-9, atol=1e-15)
