"""Errors against hand computations: offset, lever arm, turn rate, wrap at north."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_channels import FIXED, FLOAT, local_velocity, moved, place, solution_rows, truth_rows

from replay.evaluate.errors_enu import (
    attitude_errors,
    position_errors,
    rotation_errors,
    velocity_errors,
)
from replay.evaluate.geometry import body_to_enu

UM = 1e-6
T = np.arange(0.0, 5.0, 0.5)
N = len(T)
PATH = np.column_stack([3.0 * T, 4.0 * T, np.zeros(N)])
LEVER = np.array([1.0, 2.0, -3.0])


def same(rows, value):
    return np.tile(np.asarray(value, dtype=np.float64), (rows, 1))


def test_a_constant_offset_comes_back():
    truth = truth_rows(T, place(PATH))
    solution = solution_rows(T, place(PATH + np.array([0.3, -0.2, 0.1])))
    errors = position_errors(solution, truth)
    np.testing.assert_allclose(errors.values, same(N, [0.3, -0.2, 0.1]), atol=10 * UM)
    np.testing.assert_array_equal(errors.rows, np.arange(N))
    np.testing.assert_array_equal(errors.times_ns, solution.valid_time_ns)


def test_lever_arm_against_a_hand_computation():
    # Heading east: forward is east, right is south, down is down.
    attitude = same(N, [0.0, 0.0, np.pi / 2])
    truth = truth_rows(T, place(PATH + np.array([1.0, -2.0, 3.0])), lever=LEVER)
    errors = position_errors(solution_rows(T, place(PATH), attitude=attitude), truth)
    # Local axes at two points 18 m apart differ by 3 urad.
    np.testing.assert_allclose(errors.values, 0.0, atol=30 * UM)


def test_the_solutions_own_attitude_carries_the_lever_arm():
    true, found = same(N, [0.1, -0.2, 1.0]), same(N, [0.1, -0.2, 1.01])
    truth = truth_rows(T, moved(place(PATH), true, LEVER), lever=LEVER)
    errors = position_errors(solution_rows(T, place(PATH), attitude=found), truth)
    due = (body_to_enu(found[:1]) - body_to_enu(true[:1]))[0] @ LEVER
    np.testing.assert_allclose(errors.values, same(N, due), atol=10 * UM)


def test_velocity_at_the_lever_arm_has_the_turn_in_it():
    # Heading north, turning right at 0.5 rad/s: w x l = (-1, 0.5, 0) forward and right.
    velocity = local_velocity(place(PATH), same(N, [3.0, 4.0, 0.0]))
    truth = truth_rows(T, place(PATH), velocity=velocity + np.array([0.5, -1.0, 0.0]), lever=LEVER)
    solution = solution_rows(T, place(PATH), velocity=velocity, rate=same(N, [0.0, 0.0, 0.5]))
    np.testing.assert_allclose(velocity_errors(solution, truth).values, 0.0, atol=1e-12)


def test_attitude_errors_wrap_at_north():
    truth = truth_rows(T, place(PATH), attitude=same(N, np.radians([1.0, 2.0, 359.5])))
    solution = solution_rows(T, place(PATH), attitude=same(N, np.radians([1.5, 1.0, 0.25])))
    degrees = np.degrees(attitude_errors(solution, truth).values)
    np.testing.assert_allclose(degrees, same(N, [0.5, -1.0, 0.75]), atol=1e-9)


def test_rotation_errors_are_about_local_axes():
    attitude = same(N, [0.1, -0.2, 2.0])
    psi = np.array([1e-3, -2e-3, 3e-3])
    north_up = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    body = north_up @ Rotation.from_rotvec(psi).as_matrix() @ body_to_enu(attitude[:1])[0]
    roll = np.arctan2(body[2, 1], body[2, 2])
    pitch, heading = -np.arcsin(body[2, 0]), np.arctan2(body[1, 0], body[0, 0])
    solution = solution_rows(T, place(PATH), attitude=same(N, [roll, pitch, heading]))
    errors = rotation_errors(solution, truth_rows(T, place(PATH), attitude=attitude))
    np.testing.assert_allclose(errors.values, same(N, psi), atol=1e-12)


def test_what_truth_does_not_have_gives_no_error():
    truth = truth_rows(T, place(PATH))
    solution = solution_rows(T, place(PATH))
    for function in (velocity_errors, attitude_errors, rotation_errors):
        assert len(function(solution, truth)) == 0


def test_rows_without_truth_are_left_out():
    truth = truth_rows(T[2:5], place(PATH[2:5]))
    errors = position_errors(solution_rows(T, place(PATH)), truth)
    np.testing.assert_array_equal(errors.rows, [2, 3, 4])


def test_only_fixed_truth_on_request():
    quality = np.where(np.arange(N) < 4, FIXED, FLOAT)
    truth = truth_rows(T, place(PATH), quality=quality)
    errors = position_errors(solution_rows(T, place(PATH)), truth, fixed_only=True)
    np.testing.assert_array_equal(errors.rows, [0, 1, 2, 3])


def test_a_solution_that_is_no_number_is_no_error():
    position = place(PATH)
    position[3] = np.nan
    attitude = np.zeros((N, 3))
    attitude[4] = np.nan
    truth = truth_rows(T, place(PATH), attitude=np.zeros((N, 3)))
    solution = solution_rows(T, position, attitude=attitude)
    assert 3 not in position_errors(solution, truth).rows
    np.testing.assert_array_equal(
        rotation_errors(solution, truth).rows, [r for r in range(N) if r != 4]
    )


def test_a_single_row():
    truth = truth_rows(T[:1], place(PATH[:1]), velocity=[[0.0, 0.0, 0.0]])
    solution = solution_rows(T[:1], place(PATH[:1] + np.array([0.0, 0.0, 1.0])))
    assert position_errors(solution, truth).values[0, 2] == pytest.approx(1.0, abs=1e-5)
