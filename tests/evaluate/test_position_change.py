"""Errors of the change of position: closed forms, and which epochs are consecutive."""

from __future__ import annotations

import numpy as np
import pytest
from small_channels import PREDICTED, UPDATED, moved, place, solution_rows, truth_rows

from replay.evaluate import RunChannels, evaluate_channels
from replay.evaluate.errors_enu import position_change_errors
from replay.schemas import solution_pb2

T = np.arange(0.0, 60.0)
N = len(T)
MM = 1e-3
PATH = np.column_stack([12.0 * T, 3.0 * T, 0.0 * T])
EVERY = np.ones(N, dtype=bool)


def changes(error, epochs=EVERY, times=T, **truth):
    solution = solution_rows(times, place(PATH + error))
    return position_change_errors(solution, truth_rows(T, place(PATH), **truth), epochs)


def test_a_constant_error_has_no_part_in_it():
    found = changes(np.array([3.0, -4.0, 12.0]))
    assert len(found) == N - 1
    np.testing.assert_allclose(found.values, 0.0, atol=1e-6)


def test_a_drift_is_its_rate_times_the_interval():
    rate = np.array([0.1, -0.2, 0.05])
    found = changes(T[:, None] * rate)
    # 700 m away the local axes are 1e-4 rad from those of the origin.
    np.testing.assert_allclose(found.values, np.tile(rate, (N - 1, 1)), atol=1e-4)


def test_a_random_walk_gives_back_its_steps():
    steps = np.random.default_rng(1).normal(0.0, 0.3, (N, 3))
    found = changes(np.cumsum(steps, axis=0))
    np.testing.assert_allclose(found.values, steps[1:], atol=2e-3)
    run = RunChannels(
        run="a",
        solution=solution_rows(T, place(PATH + np.cumsum(steps, axis=0))),
        truth=truth_rows(T, place(PATH)),
    )
    figures = evaluate_channels(run)
    east = figures.position_change_error_m["east"]
    assert east.rms == pytest.approx(np.sqrt(np.mean(steps[1:, 0] ** 2)), rel=5e-3)
    assert east.std == pytest.approx(np.std(steps[1:, 0]), rel=5e-3)
    assert figures.counts.change_pairs == N - 1


def test_independent_errors_give_their_differences():
    noise = np.random.default_rng(2).normal(0.0, 1.0, (N, 3))
    found = changes(noise)
    np.testing.assert_allclose(found.values, np.diff(noise, axis=0), atol=5e-3)


def test_where_a_chain_begins_is_no_change():
    """A chain of displacements that starts again 5 m off is judged by its displacements."""
    chained, single = solution_pb2.SOLUTION_STATUS_CHAINED, solution_pb2.SOLUTION_STATUS_SINGLE
    status = np.full(N, chained)
    status[[0, 20]] = single
    error = np.where(np.arange(N)[:, None] < 20, 1.0, 6.0) * np.ones(3)
    solution = solution_rows(T, place(PATH + error), status=status)
    found = position_change_errors(solution, truth_rows(T, place(PATH)), EVERY)
    assert len(found) == N - 2
    np.testing.assert_allclose(found.values, 0.0, atol=1e-3)


def test_no_pair_reaches_across_a_gap():
    epochs = EVERY.copy()
    epochs[20:25] = False  # five epochs away: one pair fewer than epochs less one
    found = changes(np.zeros(3), epochs)
    assert len(found) == N - 5 - 2
    assert 25 not in found.rows
    epochs = EVERY.copy()
    epochs[30] = False  # two intervals, which is more than one and a half
    assert len(changes(np.zeros(3), epochs)) == N - 1 - 2


def test_epochs_without_truth_take_no_part_and_join_nothing():
    solution = solution_rows(T, place(PATH + np.array([1.0, 0.0, 0.0])))
    kept = np.r_[0:30, 40:N]
    truth = truth_rows(T[kept], place(PATH[kept]))
    found = position_change_errors(solution, truth, EVERY)
    assert len(found) == 29 + 19
    assert not set(found.rows) & set(range(30, 41))


def test_rows_between_epochs_are_no_epochs():
    times = np.arange(0.0, 59.0, 0.25)
    path = np.column_stack([12.0 * times, 3.0 * times, 0.0 * times])
    wobble = np.where(np.mod(times, 1.0) == 0.0, 0.0, 5.0)[:, None] * np.array([1.0, 0.0, 0.0])
    status = np.where(np.mod(times, 1.0) == 0.0, UPDATED, PREDICTED)
    run = RunChannels(
        run="a",
        solution=solution_rows(times, place(path + wobble), status=status),
        truth=truth_rows(T, place(PATH)),
    )
    found = evaluate_channels(run)
    assert found.counts.change_pairs == 58
    assert found.position_change_error_m["3d"].max < MM


def test_two_rows_at_one_time_are_one_epoch():
    times = np.repeat(T[:10], 2)
    solution = solution_rows(times, place(np.repeat(PATH[:10], 2, axis=0)))
    found = position_change_errors(
        solution, truth_rows(T, place(PATH)), np.ones(20, dtype=np.bool_)
    )
    assert len(found) == 9
    np.testing.assert_allclose(found.values, 0.0, atol=1e-6)


def test_epochs_between_rows_of_truth():
    """Receivers tell 0.994 s where truth tells whole seconds: straight motion is exact."""
    times = T[:-1] + 0.994
    path = np.column_stack([12.0 * times, 3.0 * times, 0.0 * times])
    solution = solution_rows(times, place(path))
    found = position_change_errors(
        solution, truth_rows(T, place(PATH)), np.ones(N - 1, dtype=np.bool_)
    )
    assert len(found) == N - 2
    np.testing.assert_allclose(found.values, 0.0, atol=1e-5)


def test_at_the_truths_point_where_the_vehicle_turns():
    """The IMU stands still, the truth's point swings round it: both sides must swing."""
    attitude = np.column_stack([0.0 * T, 0.0 * T, 0.1 * T])
    still = place(np.zeros((N, 3)))
    lever = (2.0, 0.5, -1.0)
    solution = solution_rows(T, still, attitude=attitude)
    truth = truth_rows(T, moved(still, attitude, lever), attitude=attitude, lever=lever)
    found = position_change_errors(solution, truth, EVERY)
    np.testing.assert_allclose(found.values, 0.0, atol=1e-6)


@pytest.mark.parametrize("name", ["SINGLE", "DGNSS", "FLOAT", "FIXED", "CHAINED", "UPDATED"])
def test_every_status_of_an_update_is_an_epoch(name):
    status = getattr(solution_pb2, f"SOLUTION_STATUS_{name}")
    run = RunChannels(
        run="a",
        solution=solution_rows(T, place(PATH), status=status),
        truth=truth_rows(T, place(PATH)),
    )
    counts = evaluate_channels(run).counts
    assert (counts.epoch_rows, counts.change_pairs) == (N, N - 1)


def test_one_epoch_has_no_change():
    one = EVERY & (T == 7.0)
    assert len(changes(np.zeros(3), one)) == 0
    assert len(changes(np.zeros(3), EVERY & False)) == 0
