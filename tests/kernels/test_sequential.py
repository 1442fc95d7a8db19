"""Scalar updates on an upper triangle, against the dense formulas in extended precision."""

import numpy as np
import pytest

from replay.kernels.sequential import mirror, take_out, update


def dense(P, H, z, r):
    """Joint update in the widest float there is: information form, then its inverse."""
    wide = np.longdouble
    P, dx = P.astype(wide), np.zeros(len(P), dtype=wide)
    for h, value, variance in zip(H.astype(wide), z.astype(wide), r.astype(wide), strict=True):
        b = P @ h
        s = h @ b + variance
        # Joseph's form, which loses nothing to cancellation.
        gain = b / s
        A = np.eye(len(P), dtype=wide) - np.outer(gain, h)
        P = A @ P @ A.T + variance * np.outer(gain, gain)
        dx = dx + gain * (value - h @ dx)
    return P, dx


def problem(seed, n, count, priors):
    generator = np.random.default_rng(seed)
    P = np.diag(priors**2)
    index = np.stack([np.sort(generator.choice(n, 6, replace=False)) for _ in range(count)])
    h = generator.normal(size=(count, 6))
    H = np.zeros((count, n))
    for k in range(count):
        H[k, index[k]] = h[k]
    z = H @ (generator.normal(size=n) * priors)
    return P, index, h, H, z


def use(P, index, h, z, r, step=update, order=None):
    n = len(P)
    dx, b = np.zeros(n), np.zeros(n)
    for k in range(len(z)) if order is None else order:
        step(P, n, h[k], index[k], len(h[k]), z[k], r[k], dx, b)
    return dx, b


@pytest.mark.parametrize("seed", range(4))
def test_equals_the_dense_filter(seed):
    n = 30
    P, index, h, H, z = problem(seed, n, 60, np.full(n, 2.0))
    r = np.random.default_rng(seed + 9).uniform(0.01, 1.0, 60)
    expected, shift = dense(P, H, z, r)
    dx, _ = use(P, index, h, z, r)
    mirror(P, n)
    assert np.abs(P - expected).max() < 1e-13
    assert np.abs(dx - shift).max() < 1e-12
    assert np.array_equal(P, P.T)


@pytest.mark.parametrize("seed", range(4))
def test_keeps_its_digits_from_wide_priors_to_millimetres(seed):
    # Position and clocks to 100 m, ambiguities to 300 m; codes of 0.5 m, then phases of 3 mm.
    n = 24
    generator = np.random.default_rng(seed)
    priors = np.where(np.arange(n) < 8, 100.0, 300.0)
    P, index, h, H, z = problem(seed, n, 96, priors)
    r = np.concatenate([np.full(48, 0.25), np.full(48, 9e-6)])
    z = z + generator.normal(size=96) * np.sqrt(r)
    expected, shift = dense(P, H, z, r)
    dx, _ = use(P, index, h, z, r)
    mirror(P, n)
    deviation = np.sqrt(np.diag(expected).astype(float))
    assert deviation.max() < 0.05
    assert np.abs((P - expected) / np.outer(deviation, deviation)).max() < 1e-3
    assert np.abs((dx - shift) / deviation).max() < 1e-3
    assert np.linalg.eigvalsh(P).min() > 0.0


def test_taking_a_measurement_out_is_never_having_used_it():
    n = 20
    P, index, h, _, z = problem(5, n, 50, np.full(n, 10.0))
    r = np.full(50, 0.04)
    z[17] += 25.0
    without = P.copy()
    shift, _ = use(without, index, h, z, r, order=[k for k in range(50) if k != 17])
    dx, b = use(P, index, h, z, r)
    take_out(P, n, h[17], index[17], 6, z[17], r[17], dx, b)
    mirror(P, n)
    mirror(without, n)
    assert np.abs(P - without).max() < 1e-10
    assert np.abs(dx - shift).max() < 1e-10


def test_the_lower_triangle_is_not_read():
    n = 12
    P, index, h, _, z = problem(7, n, 20, np.full(n, 3.0))
    r = np.full(20, 0.5)
    spoiled = P.copy()
    spoiled[np.tril_indices(n, -1)] = np.nan
    dx, _ = use(P, index, h, z, r)
    other, _ = use(spoiled, index, h, z, r)
    mirror(P, n)
    mirror(spoiled, n)
    assert np.array_equal(P, spoiled)
    assert np.array_equal(dx, other)
