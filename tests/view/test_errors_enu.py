"""Errors against truth, compared with a computation that shares no code with it."""

from __future__ import annotations

import fake_run
import numpy as np
import pymap3d
from scipy.spatial.transform import Rotation, Slerp

from replay.log.columns import Columns
from replay.time import NS_PER_S
from replay.view.errors_enu import attitude_errors, position_errors, velocity_errors
from replay.view.frame import LocalFrame, body_to_enu_matrices, ecef_to_enu_matrices

MM = 1e-3


def _ned_to_enu() -> np.ndarray:
    return np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])


def _turn(rpy: np.ndarray) -> Rotation:
    """Body to east-north-up by scipy's intrinsic z-y-x."""
    return Rotation.from_matrix(_ned_to_enu()) * Rotation.from_euler("ZYX", rpy[:, ::-1])


def test_attitude_matrices_equal_scipy() -> None:
    rpy = np.random.default_rng(1).uniform(-3, 3, (50, 3)) * [1, 0.4, 1]
    np.testing.assert_allclose(body_to_enu_matrices(rpy), _turn(rpy).as_matrix(), atol=1e-14)


def test_local_frame_equals_pymap3d(channels: dict[str, Columns]) -> None:
    ecef = channels["/truth"]["position_ecef_m"]
    frame = LocalFrame.at(ecef[100])
    expected = np.column_stack(pymap3d.ecef2enu(*ecef.T, *frame.origin_geodetic))
    np.testing.assert_allclose(frame.enu(ecef), expected, atol=1e-6)


def test_position_errors_equal_an_independent_computation(channels: dict[str, Columns]) -> None:
    """Truth in closed form at the solution's own times, instead of an interpolation."""
    solution, truth = channels["/solution/tight"], channels["/truth"]
    errors = position_errors(solution, truth)
    t = (solution.valid_time_ns[errors.rows] - fake_run.START_NS) / NS_PER_S
    p, _, rpy = fake_run._motion(t)
    origin, axes = fake_run._ecef_origin()
    reference = origin + (p + _turn(rpy).apply(fake_run.TRUTH_LEVER)) @ axes
    position = solution["position_ecef_m"][errors.rows]
    lat, lon, _ = pymap3d.ecef2geodetic(*position.T)
    lever = _turn(solution["attitude_rad"][errors.rows]).apply(fake_run.TRUTH_LEVER)
    point = position + np.column_stack(pymap3d.enu2uvw(*lever.T, lat, lon))
    lat, lon, height = pymap3d.ecef2geodetic(*reference.T)
    expected = np.column_stack(pymap3d.ecef2enu(*point.T, lat, lon, height))
    assert len(errors.rows) > 1000
    # The truth's velocity is that of the IMU, so the curve between rows is off by its lever's rate.
    np.testing.assert_allclose(errors.values, expected, atol=2 * MM)


def test_exact_rows_give_exact_errors(channels: dict[str, Columns]) -> None:
    truth = channels["/truth"]
    count = len(truth)
    offset = np.array([0.3, -0.7, 1.1])
    lat, lon, _ = pymap3d.ecef2geodetic(*truth["position_ecef_m"].T)
    moved = truth["position_ecef_m"] + np.column_stack(
        pymap3d.enu2uvw(*np.tile(offset, (count, 1)).T, lat, lon)
    )
    bare = Columns.build(
        truth.valid_time_ns,
        {**truth.values, "lever_arm_body_m": np.zeros((count, 3))},
        present=truth.present,
    )
    solution = Columns.build(
        truth.valid_time_ns,
        {
            "position_ecef_m": moved,
            "velocity_enu_m_s": truth["velocity_enu_m_s"] + [0.1, 0.2, -0.3],
            "attitude_rad": truth["attitude_rad"] + np.radians([0.1, 0.2, 359.5]),
            "angular_rate_body_rad_s": np.zeros((count, 3)),
        },
    )
    np.testing.assert_allclose(
        position_errors(solution, bare).values, np.tile(offset, (count, 1)), atol=1e-6
    )
    np.testing.assert_allclose(
        velocity_errors(solution, bare).values, np.tile([0.1, 0.2, -0.3], (count, 1)), atol=1e-12
    )
    np.testing.assert_allclose(
        np.degrees(attitude_errors(solution, bare).values),
        np.tile([0.1, 0.2, -0.5], (count, 1)),
        atol=1e-9,
    )


def test_velocity_is_moved_to_the_point_of_truth(channels: dict[str, Columns]) -> None:
    solution, truth = channels["/solution/tight"], channels["/truth"]
    errors = velocity_errors(solution, truth)
    rows = errors.rows
    turn = _turn(solution["attitude_rad"][rows])
    extra = turn.apply(np.cross(solution["angular_rate_body_rad_s"][rows], fake_run.TRUTH_LEVER))
    t = truth.valid_time_ns - fake_run.START_NS
    at = solution.valid_time_ns[rows] - fake_run.START_NS
    reference = np.column_stack(
        [np.interp(at, t, truth["velocity_enu_m_s"][:, i]) for i in range(3)]
    )
    expected = solution["velocity_enu_m_s"][rows] + extra - reference
    np.testing.assert_allclose(errors.values, expected, atol=1e-9)


def test_attitude_errors_equal_slerp(channels: dict[str, Columns]) -> None:
    solution, truth = channels["/solution/tight"], channels["/truth"]
    errors = attitude_errors(solution, truth)
    t = (truth.valid_time_ns - fake_run.START_NS) / NS_PER_S
    at = (errors.times_ns - fake_run.START_NS) / NS_PER_S
    between = Slerp(t, Rotation.from_euler("ZYX", truth["attitude_rad"][:, ::-1]))(at)
    reference = between.as_euler("ZYX")[:, ::-1]
    difference = solution["attitude_rad"][errors.rows] - reference
    expected = np.mod(difference + np.pi, 2 * np.pi) - np.pi
    np.testing.assert_allclose(errors.values, expected, atol=1e-5)


def test_no_errors_across_gaps_nor_past_the_ends(channels: dict[str, Columns]) -> None:
    solution, truth = channels["/solution/tight"], channels["/truth"]
    t = (truth.valid_time_ns - fake_run.START_NS) / NS_PER_S
    holed = truth.take((t > 20) & (t < 100) & ~((t > 50.05) & (t < 60.05)))
    at = (position_errors(solution, holed).times_ns - fake_run.START_NS) / NS_PER_S
    assert at.min() >= 20.0 and at.max() <= 100.0
    assert not ((at > 50.1) & (at < 60.0)).any()
    assert ((at > 49) & (at < 50)).any() and ((at > 61) & (at < 62)).any()


def test_truth_without_velocity_or_attitude(channels: dict[str, Columns]) -> None:
    solution, truth = channels["/solution/tight"], channels["/truth"]
    none = np.zeros(len(truth), dtype=bool)
    bare = Columns.build(
        truth.valid_time_ns,
        truth.values,
        present={"velocity_enu_m_s": none, "attitude_rad": none},
    )
    assert len(velocity_errors(solution, bare).rows) == 0
    assert len(attitude_errors(solution, bare).rows) == 0
    straight = position_errors(solution, bare)
    curved = position_errors(solution, truth)
    np.testing.assert_allclose(straight.values, curved.values, atol=0.02)


def test_rotation_rows_are_orthonormal() -> None:
    matrices = ecef_to_enu_matrices([40.0, -33.0, 89.9], [-105.0, 151.0, 10.0])
    product = np.einsum("nij,nkj->nik", matrices, matrices)
    np.testing.assert_allclose(product, np.tile(np.eye(3), (3, 1, 1)), atol=1e-15)
