"""Sensor errors have the statistics that their configuration says, source by source."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from replay.configuration import build
from replay.errors import ConfigurationError
from replay.kernels.trajectory import POSE_DTYPE
from replay.simulate import gnss, imu
from replay.simulate.noise import correlated, normals, uniforms

DT = 0.01
N = 60_000


def errors_of(**values):
    return imu.ImuErrors(**values)


def measured(errors, *, rates=None, forces=None, speeds=0.0, seed=7, rows=N):
    nought = np.zeros((rows, 3))
    return imu.measure(
        nought if rates is None else rates,
        nought if forces is None else forces,
        np.full(rows, speeds),
        DT,
        errors,
        seed,
    )


def test_normal_numbers_are_normal_and_independent():
    drawn = normals(3, "a", 40_000, 3)
    assert stats.kstest(drawn.reshape(-1), "norm").pvalue > 1e-3
    assert np.abs(np.corrcoef(drawn.T) - np.eye(3)).max() < 5.0 / math.sqrt(len(drawn))
    other = normals(3, "b", 40_000, 3)
    assert abs(np.corrcoef(drawn[:, 0], other[:, 0])[0, 1]) < 5.0 / math.sqrt(len(drawn))


def test_a_stream_depends_on_seed_and_source_alone():
    np.testing.assert_array_equal(uniforms(1, "a", 10), uniforms(1, "a", 20)[:10])
    assert not np.array_equal(uniforms(1, "a", 10), uniforms(2, "a", 10))
    assert not np.array_equal(uniforms(1, "a", 10), uniforms(1, "b", 10))


@pytest.mark.parametrize("window_s", [0.1, 1.0])
def test_white_noise_averages_as_a_random_walk(window_s):
    density = 3e-3
    data = measured(errors_of(gyro_noise=density))
    length = round(window_s / DT)
    means = data.rates.reshape(-1, length, 3).mean(axis=1)
    degrees = means.size
    low, high = stats.chi2.ppf([1e-4, 1.0 - 1e-4], degrees) / degrees
    assert low < np.mean(means * means) / (density**2 / window_s) < high
    np.testing.assert_array_equal(data.forces, 0.0)


def test_drift_has_its_deviation_and_its_correlation():
    tau, sigma = 5.0, 2.0
    series = correlated(5, "x", 400_000, sigma=sigma, tau_s=tau, interval_s=0.1)
    # About 3 * 400000 * 0.1 / (2 tau) independent numbers.
    assert np.std(series) == pytest.approx(sigma, rel=0.03)
    lag = round(tau / 0.1)
    product = np.mean(series[lag:] * series[:-lag]) / np.mean(series * series)
    assert product == pytest.approx(math.exp(-1.0), abs=0.03)


def test_drift_begins_in_its_stationary_state():
    first = np.array(
        [correlated(s, "x", 1, sigma=1.0, tau_s=1e6, interval_s=0.01)[0] for s in range(400)]
    )
    low, high = stats.chi2.ppf([1e-4, 1.0 - 1e-4], first.size) / first.size
    assert low < np.mean(first * first) < high


def test_bias_and_scale_have_the_signs_of_the_filters_states():
    rates = np.tile([0.1, -0.2, 0.3], (50, 1))
    data = measured(errors_of(gyro_bias=0.01, gyro_scale=0.02), rates=rates, rows=50)
    scale = 0.02 * normals(7, "imu.gyro.scale", 1)[0]
    bias = 0.01 * normals(7, "imu.gyro.bias", 1)[0]
    np.testing.assert_allclose((data.rates - data.gyro_bias) / (1.0 + scale), rates, rtol=1e-14)
    np.testing.assert_array_equal(data.gyro_bias, np.tile(bias, (50, 1)))


def test_misalignment_mixes_axes_only():
    forces = np.tile([0.0, 0.0, -9.8], (10, 1))
    data = measured(errors_of(misalignment=1e-3), forces=forces, rows=10)
    off = 1e-3 * normals(7, "imu.accel.misalignment", 3)
    np.testing.assert_allclose(data.forces[0], [-9.8 * off[0, 2], -9.8 * off[1, 2], -9.8])


def test_resolution_rounds():
    data = measured(errors_of(accel_noise=1e-2, accel_resolution=0.05))
    steps = data.forces / 0.05
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)


def test_vibration_shakes_a_moving_vehicle_but_carries_it_nowhere():
    errors = errors_of(vibration_velocity=1e-3, vibration_angle=1e-5)
    still, moving = measured(errors), measured(errors, speeds=10.0)
    np.testing.assert_array_equal(still.forces, 0.0)
    assert np.std(moving.forces) == pytest.approx(math.sqrt(2.0) * 1e-3 / DT, rel=0.02)
    assert np.abs(np.cumsum(moving.forces, axis=0) * DT).max() < 6e-3


def test_a_source_that_is_added_shifts_no_other():
    plain = measured(errors_of(gyro_noise=1e-3), rows=100)
    more = measured(errors_of(gyro_noise=1e-3, gyro_resolution=0.0, accel_noise=1.0), rows=100)
    np.testing.assert_array_equal(plain.rates, more.rates)


@pytest.mark.parametrize("grade", sorted(imu.IMU_GRADES))
def test_grades_of_units_can_be_read(grade):
    imu.check(build(imu.ImuErrors, [imu.IMU_GRADES[grade]]))


def test_grades_get_worse():
    order = ("perfect", "navigation", "tactical", "industrial", "consumer")
    read = [build(imu.ImuErrors, [imu.IMU_GRADES[grade]]) for grade in order]
    for name in ("accel_noise", "gyro_bias", "accel_bias", "gyro_drift", "gyro_scale"):
        values = [getattr(errors, name) for errors in read]
        assert values == sorted(values), name
    # Honeywell HG1700: 0.125 deg/sqrt(h) = 3.6361e-5 rad/sqrt(s)
    assert read[2].gyro_noise == pytest.approx(3.6361e-5, rel=1e-4)


def test_impossible_errors_are_refused():
    with pytest.raises(ConfigurationError, match="gyro_noise"):
        imu.check(errors_of(gyro_noise=-1.0))
    with pytest.raises(ConfigurationError, match="drift_tau"):
        imu.check(errors_of(accel_drift=1.0, accel_drift_tau=0.0))
    with pytest.raises(ConfigurationError, match="drift_tau"):
        gnss.check(gnss.GnssErrors(vertical_drift=1.0, drift_tau=0.0))
    with pytest.raises(ConfigurationError, match="stated_scale"):
        gnss.check(gnss.GnssErrors(stated_scale=0.0))


def poses_at_the_equator(count):
    """Level, heading north, on the equator at longitude 0: east is y, north z, up x."""
    poses = np.zeros(count, dtype=POSE_DTYPE)
    poses["r"] = [6378137.0, 0.0, 0.0]
    poses["C"] = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
    poses["v"] = [0.0, 0.0, 10.0]
    poses["w_eb"] = [0.0, 0.0, 0.5]
    return poses


def test_lever_arm_against_a_hand_computation():
    made = gnss.fix(poses_at_the_equator(1), (1.0, 2.0, -3.0), 0.25, gnss.GnssErrors(), 1)
    # 1 m forward is north (z), 2 m right is east (y), 3 m above is up (x).
    np.testing.assert_allclose(made.positions[0], [6378140.0, 2.0, 1.0], atol=1e-9)
    # w x l = (0, 0, 0.5) x (1, 2, -3) = (-1, 0.5, 0): north loses 1 m/s, east gains 0.5 m/s.
    np.testing.assert_allclose(made.velocities[0], [0.0, 0.5, 9.0], atol=1e-12)


def test_fix_errors_have_the_stated_deviations():
    errors = build(gnss.GnssErrors, [gnss.GNSS_GRADES["spp"], {"drift_tau": "0.5 s"}])
    poses = poses_at_the_equator(20_000)
    made = gnss.fix(poses, (0.0, 0.0, 0.0), 1.0, errors, 11)
    enu = (made.positions - poses["r"])[:, [1, 2, 0]]
    sigma = np.sqrt(made.position_covariances[0][[0, 3, 5]])
    np.testing.assert_allclose(sigma[[0, 2]], [math.hypot(0.8, 1.2), math.hypot(1.5, 2.5)])
    np.testing.assert_allclose(np.std(enu, axis=0), sigma, rtol=0.03)
    velocity = (made.velocities - poses["v"])[:, [1, 2, 0]]
    stated = np.sqrt(made.velocity_covariances[0][[0, 3, 5]])
    np.testing.assert_allclose(np.std(velocity, axis=0), stated, rtol=0.03)


def test_stated_deviations_can_be_wrong_on_purpose():
    errors = gnss.GnssErrors(horizontal_noise=1.0, vertical_noise=2.0, stated_scale=0.5)
    made = gnss.fix(poses_at_the_equator(3), (0.0, 0.0, 0.0), 1.0, errors, 11)
    np.testing.assert_allclose(made.position_covariances[0], [0.25, 0, 0, 0.25, 0, 1.0])
