"""First attitude: from rest and the course, forward or backward, or in motion."""

import numpy as np
import pymap3d
import pytest

from replay.configuration import build
from replay.kernels import earth, rotation
from replay.log.columns import Columns
from replay.stages.base import Context
from replay.stages.gnss_ins_lc import GnssInsLoose
from replay.stages.loose_config import LooseConfig

RATE_HZ = 100
PLACE = (47.0, 8.0, 500.0)
DEGREE = np.pi / 180


def straight_run(*, roll, pitch, heading, rest_s, acceleration, drive_s, gyro_bias=(0.0, 0.0, 0.0)):
    """Sensors and fixes of a body that rests and then runs along its forward axis."""
    r0 = np.array(pymap3d.geodetic2ecef(*PLACE))
    axes, C_b_n = np.zeros((3, 3)), np.zeros((3, 3))
    earth.enu_axes(*r0, axes)
    rotation.matrix_from_euler(roll, pitch, heading, C_b_n)
    C = np.array([axes[1], axes[0], -axes[2]]).T @ C_b_n
    step_ns = 10**9 // RATE_HZ
    count = round((rest_s + drive_s) * RATE_HZ)
    times = 10**18 + step_ns * np.arange(1, count + 1, dtype=np.int64)
    t = (times - 10**18) * 1e-9
    moving = t - 0.5 / RATE_HZ > rest_s
    gravity = C.T @ np.array(earth.gravity(*r0))
    forces = np.tile(-gravity, (count, 1))
    forces[moving, 0] += acceleration
    rates = np.tile(C.T @ [0, 0, earth.EARTH_RATE_RAD_S] + np.array(gyro_bias), (count, 1))
    imu = Columns.build(
        times, {"angular_rate_body_rad_s": rates, "specific_force_body_m_s2": forces}
    )
    rows = np.arange(RATE_HZ // 4, count, RATE_HZ // 4)
    since = np.clip(t[rows] - rest_s, 0.0, None)
    fixes = Columns.build(
        times[rows],
        {
            "position_ecef_m": r0 + 0.5 * acceleration * np.outer(since**2, C[:, 0]),
            "velocity_ecef_m_s": acceleration * np.outer(since, C[:, 0]),
            "position_covariance_enu_m2": np.tile([1e-4, 0, 0, 1e-4, 0, 1e-4], (len(rows), 1)),
            "velocity_covariance_enu_m2_s2": np.tile([1e-4, 0, 0, 1e-4, 0, 1e-4], (len(rows), 1)),
            "antenna_lever_arm_body_m": np.zeros((len(rows), 3)),
        },
    )
    return imu, fixes


def align(imu, fixes, **alignment):
    stage = GnssInsLoose()
    config = build(LooseConfig, [{"alignment": alignment}])
    heads = {"IMU": imu.take(slice(0, 100)), "GNSS_FIX": fixes.take(slice(0, 10))}
    state = stage.start(config, Context({}, heads))
    _, outputs = stage.step(state, {"IMU": imu, "GNSS_FIX": fixes})
    return outputs["SOLUTION"], outputs["FILTER_STATE"]


def off(found, expected):
    return abs((found - expected + np.pi) % (2 * np.pi) - np.pi)


@pytest.mark.parametrize("heading", [0.0, 1.0, 3.0, 5.5])
@pytest.mark.parametrize("acceleration", [1.0, -1.0])
def test_rest_and_course_give_attitude_and_bias(heading, acceleration):
    bias = (0.002, -0.003, 0.001)
    imu, fixes = straight_run(
        roll=0.03, pitch=-0.05, heading=heading, rest_s=6, acceleration=acceleration, drive_s=4,
        gyro_bias=bias,
    )  # fmt: skip
    solution, states = align(imu, fixes)
    roll, pitch, found = solution["attitude_rad"][0]
    assert roll == pytest.approx(0.03, abs=0.01 * DEGREE)
    assert pitch == pytest.approx(-0.05, abs=0.01 * DEGREE)
    assert off(found, heading) < 0.05 * DEGREE
    # The mean rate at rest holds the Earth's rate too; the bias must not.
    np.testing.assert_allclose(states["gyro_bias_body_rad_s"][0], bias, atol=2e-6)


def test_a_log_that_begins_in_motion_is_levelled_with_the_acceleration_gnss_sees():
    imu, fixes = straight_run(
        roll=0.02, pitch=0.04, heading=2.0, rest_s=0, acceleration=1.5, drive_s=6
    )
    solution, _ = align(imu, fixes)
    roll, pitch, found = solution["attitude_rad"][0]
    assert roll == pytest.approx(0.02, abs=0.5 * DEGREE)
    assert pitch == pytest.approx(0.04, abs=0.5 * DEGREE)
    assert off(found, 2.0) < 0.5 * DEGREE


def test_no_attitude_without_motion():
    imu, fixes = straight_run(roll=0.0, pitch=0.0, heading=0.0, rest_s=8, acceleration=0, drive_s=2)
    stage = GnssInsLoose()
    config = build(LooseConfig, [])
    heads = {"IMU": imu.take(slice(0, 100)), "GNSS_FIX": fixes.take(slice(0, 10))}
    _, outputs = stage.step(
        stage.start(config, Context({}, heads)), {"IMU": imu, "GNSS_FIX": fixes}
    )
    assert "SOLUTION" not in outputs
    details = outputs["FILTER_EVENTS"].ragged("detail").texts()
    assert any("levelled" in text for text in details)
