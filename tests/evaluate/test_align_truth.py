"""Truth between its rows: exact for cubic motion, none across gaps, angles the short way."""

from __future__ import annotations

import numpy as np
import pytest
from small_channels import FIXED, FLOAT, at, place, truth_rows

from replay.evaluate.align import align, known_rows, truth_positions
from replay.evaluate.geometry import enu_axes, turn

UM = 1e-6


def polynomial(t, powers):
    return np.column_stack([np.polyval(p, t) for p in powers])


def rates(t, powers):
    return np.column_stack([np.polyval(np.polyder(p), t) for p in powers])


CUBIC = ([0.02, -0.3, 5.0, 1.0], [-0.01, 0.2, 9.0, -4.0], [0.003, 0.01, -0.5, 2.0])
ROTATE = enu_axes(place([[0.0, 0.0, 0.0]]))[0]


def moving_truth(t, **others):
    position = place(polynomial(t, CUBIC))
    velocity = turn(enu_axes(position), rates(t, CUBIC) @ ROTATE)
    return truth_rows(t, position, velocity=velocity, **others)


def test_cubic_motion_is_interpolated_exactly():
    truth = moving_truth(np.arange(0.0, 10.0, 1.0))
    t = np.linspace(0.0, 9.0, 137)
    found = truth_positions(align(at(t), truth.valid_time_ns), truth)
    # The half nanosecond of the times counts at 10 m/s.
    np.testing.assert_allclose(found, place(polynomial(t, CUBIC)), atol=0.1 * UM)


def test_without_velocity_the_way_is_straight():
    t = np.array([0.0, 1.0, 2.0])
    truth = truth_rows(t, place([[0, 0, 0], [10, 0, 0], [10, 20, 0]]))
    found = truth_positions(align(at([0.25, 1.5]), truth.valid_time_ns), truth)
    np.testing.assert_allclose(found, place([[2.5, 0, 0], [10, 10, 0]]), atol=UM)


def test_a_row_without_velocity_makes_only_its_own_intervals_straight():
    truth = moving_truth(np.arange(0.0, 6.0))
    velocity = truth["velocity_enu_m_s"]
    velocity[1] = np.nan
    t = np.array([0.5, 1.5, 2.5])
    found = truth_positions(align(at(t), truth.valid_time_ns), truth)
    position = truth["position_ecef_m"]
    np.testing.assert_allclose(found[0], (position[0] + position[1]) / 2, atol=UM)
    np.testing.assert_allclose(found[1], (position[1] + position[2]) / 2, atol=UM)
    np.testing.assert_allclose(found[2], place(polynomial(t, CUBIC))[2], atol=UM)


def test_gaps_are_not_bridged_but_their_edges_are_known():
    truth_s = np.r_[0:5, 8:12].astype(float)
    aligned = align(at([3.5, 4.0, 4.5, 7.9, 8.0, 8.5]), at(truth_s))
    np.testing.assert_array_equal(aligned.rows, [0, 1, 4, 5])


def test_an_interval_of_twice_the_median_is_bridged_with_its_jitter():
    truth_s = np.array([0.0, 1.0, 2.0, 4.0005, 5.0005])
    assert len(align(at([3.0]), at(truth_s)).rows) == 1
    truth_s[3:] += 0.01
    assert len(align(at([3.0]), at(truth_s)).rows) == 0


def test_nothing_is_known_outside_of_truth():
    aligned = align(at([-0.1, 0.0, 2.0, 2.1]), at([0.0, 1.0, 2.0]))
    np.testing.assert_array_equal(aligned.rows, [1, 2])


@pytest.mark.parametrize("truth_s", [[], [1.0]])
def test_few_rows_of_truth(truth_s):
    aligned = align(at([0.5, 1.0, 1.5]), at(truth_s))
    np.testing.assert_array_equal(aligned.rows, [1] if truth_s else [])
    assert np.isfinite(aligned.fraction).all()


def test_angles_go_the_short_way_over_north():
    aligned = align(at([0.5]), at([0.0, 1.0]))
    angles = np.radians([[0.0, 0.0, 359.0], [0.0, 0.0, 3.0]])
    middle = np.degrees(aligned.angles(angles))[0, 2] % 360.0
    assert middle == pytest.approx(1.0)


def test_rows_are_chosen_by_field_and_quality_and_put_in_order():
    t = np.array([0.0, 2.0, 1.0, 1.0, 3.0])
    truth = truth_rows(
        t, place(np.zeros((5, 3))), quality=np.array([FIXED, FIXED, FLOAT, FIXED, FLOAT])
    )
    np.testing.assert_array_equal(
        known_rows(truth, "position_ecef_m").valid_time_ns, at([0, 1, 2, 3])
    )
    fixed = known_rows(truth, "position_ecef_m", fixed_only=True)
    np.testing.assert_array_equal(fixed.valid_time_ns, at([0, 1, 2]))
    assert len(known_rows(truth, "attitude_rad")) == 0
