"""Normalised squares of known noise against chi-square; cautions; NIS by kind and axis."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from small_channels import (
    FIXED,
    innovation_rows,
    place,
    solution_rows,
    truth_rows,
)

from replay.evaluate import RunChannels, evaluate_channels
from replay.evaluate.consistency import (
    CAUTION_MEASUREMENT,
    consistency_of,
    covariance_squares,
    nis,
)
from replay.evaluate.errors_enu import Errors
from replay.schemas import filter_pb2

SIGMA = np.array([0.5, 1.0, 2.0])
N = 4000


def noisy_run(*, scale=1.0, quality=0):
    rng = np.random.default_rng(5)
    t = np.arange(N) * 0.25
    noise = scale * SIGMA * rng.standard_normal((N, 3))
    velocity = 0.01 * scale * SIGMA * rng.standard_normal((N, 3))
    angles = 1e-4 * scale * SIGMA * rng.standard_normal((N, 3))
    solution = solution_rows(t, place(noise), velocity=velocity, sigma=SIGMA)
    solution.values["velocity_std_enu_m_s"][:] = 0.01 * SIGMA
    # Heading nought and level: roll is about north, pitch about east, heading about minus up.
    solution.values["attitude_rad"][:] = angles[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
    solution.values["attitude_std_rad"][:] = 1e-4 * SIGMA
    still = np.zeros((N, 3))
    truth = truth_rows(t, place(still), velocity=still, attitude=still, quality=quality)
    return RunChannels(run="r", solution=solution, truth=truth)


def test_noise_of_the_stated_size_is_consistent():
    nees = evaluate_channels(noisy_run()).nees
    for block in (nees.position, nees.velocity, nees.attitude):
        assert block.count == N
        assert block.bounds_95[0] < block.mean < block.bounds_95[1]
        assert block.inside_fraction == pytest.approx(0.95, abs=0.015)
    low, high = stats.chi2.ppf([0.025, 0.975], 3 * N) / N
    assert nees.position.bounds_95 == (pytest.approx(low), pytest.approx(high))
    assert nees.position.sample_bound_95 == pytest.approx(stats.chi2.ppf(0.95, 3))


def test_optimism_shows():
    nees = evaluate_channels(noisy_run(scale=2.0)).nees
    assert nees.position.mean == pytest.approx(12.0, rel=0.05)
    assert nees.position.inside_fraction < 0.7


def test_correlated_covariance_is_used_in_full():
    matrix = np.array([[4.0, 1.5, -0.5], [1.5, 2.0, 0.3], [-0.5, 0.3, 1.0]])
    error = np.array([[1.0, -2.0, 0.5]])
    packed = matrix[np.triu_indices(3)][None]
    zero = np.zeros(1, dtype=np.int64)
    squares, rejected = covariance_squares(Errors(zero, zero, error), packed)
    assert squares[0] == pytest.approx(float(error[0] @ np.linalg.inv(matrix) @ error[0]))
    assert rejected == 0


def test_covariances_that_are_none_are_left_out():
    rows = np.arange(3)
    packed = np.array([[1.0, 0, 0, 1, 0, 1], [1, 2, 0, 1, 0, 1], [np.nan, 0, 0, 1, 0, 1]])
    squares, rejected = covariance_squares(Errors(rows, rows, np.ones((3, 3))), packed)
    assert squares.tolist() == [3.0]
    assert rejected == 2


def test_truth_made_of_the_fixes_is_cautioned():
    assert not evaluate_channels(noisy_run()).nees.truth_is_measurement
    nees = evaluate_channels(noisy_run(quality=FIXED)).nees
    assert nees.truth_is_measurement
    assert CAUTION_MEASUREMENT in nees.cautions


def test_an_independent_rtk_truth_is_not():
    run = noisy_run(quality=FIXED)
    fixes = run.solution.take(np.arange(0, N, 20))
    other = RunChannels(run="r", solution=run.solution, truth=run.truth, fixes=fixes)
    assert not evaluate_channels(other).nees.truth_is_measurement


def test_nis_by_kind_and_axis():
    rng = np.random.default_rng(6)
    kind = np.tile(
        [filter_pb2.MEASUREMENT_KIND_POSITION, filter_pb2.MEASUREMENT_KIND_NON_HOLONOMIC], N // 2
    )
    axis = np.tile([filter_pb2.MEASUREMENT_AXIS_UP, filter_pb2.MEASUREMENT_AXIS_RIGHT], N // 2)
    values = rng.standard_normal(N)
    values[1::2] *= 3.0
    accepted = np.abs(values) < 6.0
    found = nis(innovation_rows(np.arange(N), kind, axis, values, accepted))
    assert list(found) == ["position", "non_holonomic"]
    up, right = found["position"]["up"], found["non_holonomic"]["right"]
    assert up.bounds_95[0] < up.mean < up.bounds_95[1]
    assert up.rejected == 0
    assert right.mean > right.bounds_95[1]
    assert right.rejected == int(np.count_nonzero(~accepted))
    assert right.count + right.rejected == N // 2


def test_no_sample_no_figure():
    assert consistency_of(np.empty(0), 3) is None
