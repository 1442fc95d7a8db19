"""Errors that data sheets name beside noise and bias: g-sensitivity, pulses, a walking bias."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

from replay.errors import ConfigurationError
from replay.simulate import imu
from replay.simulate.defaults import fitting_defaults
from replay.simulate.scenario import read_scenario

DT = 0.01
G = 9.80665


def measured(rates: Any, forces: Any, seed: int = 3, **errors: float) -> imu.ImuData:
    return imu.measure(rates, forces, np.zeros(len(rates)), DT, imu.ImuErrors(**errors), seed)


def nought(rows: int) -> np.ndarray[Any, Any]:
    return np.zeros((rows, 3))


def test_gyros_err_in_proportion_to_force_with_the_deviation_of_a_data_sheet():
    size = 1e-4  # rad/s at 1 g
    factors = []
    for seed in range(60):
        # One g along each axis in turn gives the columns of the matrix.
        rates = measured(nought(3), G * np.eye(3), seed, gyro_g_sensitivity=size).rates
        doubled = measured(nought(3), 2.0 * G * np.eye(3), seed, gyro_g_sensitivity=size).rates
        np.testing.assert_allclose(doubled, 2.0 * rates, rtol=1e-12)
        factors.append(rates)
    square = np.mean(np.square(factors)) / size**2
    low, high = stats.chi2.ppf([1e-4, 1.0 - 1e-4], 540) / 540
    assert low < square < high


def test_whole_pulses_lose_nothing():
    rng = np.random.default_rng(1)
    rates, forces = rng.normal(size=(5000, 3)) * 0.02, rng.normal(size=(5000, 3)) + [0.0, 0.0, -G]
    angle, velocity = 3e-5, 1e-3
    data = measured(rates, forces, gyro_increment=angle, accel_increment=velocity)
    for values, true, pulse in ((data.rates, rates, angle), (data.forces, forces, velocity)):
        pulses = values * DT / pulse
        np.testing.assert_allclose(pulses, np.rint(pulses), atol=1e-6)
        # The sum is never off by more than half a pulse, however long it runs.
        off = np.cumsum(values - true, axis=0) * DT
        assert np.abs(off).max() < 0.5 * pulse * (1.0 + 1e-6)
        assert np.abs(off).max() > 0.4 * pulse


def test_a_walking_bias_has_grown_to_its_size_in_an_hour():
    walk = 2e-5
    ends = []
    for seed in range(100):
        rows = 3600
        data = imu.measure(
            nought(rows), nought(rows), np.zeros(rows), 1.0, imu.ImuErrors(gyro_walk=walk), seed
        )
        np.testing.assert_array_equal(data.rates, data.gyro_bias)
        ends.append(data.gyro_bias[[899, 3599]])
    quarter, whole = np.mean(np.square(ends), axis=(0, 2)) / walk**2
    low, high = stats.chi2.ppf([1e-4, 1.0 - 1e-4], 300) / 300
    assert low < whole < high
    assert 0.25 * low < quarter < 0.25 * high


def test_the_filter_is_told_of_a_walking_bias():
    table = {
        "imu": {"grade": "perfect", "errors": {"gyro_bias": 3e-4, "gyro_walk": 4e-4}},
        "segments": [{"kind": "hold", "duration": 2.0}],
    }
    told = fitting_defaults(read_scenario(table).settings)["filter"]
    sigma, tau = told["gyro_bias_sigma"][0], told["gyro_bias_tau"]
    assert sigma == pytest.approx(5e-4)
    # Driving noise of the process: that of the walk.
    assert 2.0 * sigma**2 / tau == pytest.approx(4e-4**2 / 3600.0)


def test_what_is_not_asked_for_changes_no_sample():
    rng = np.random.default_rng(2)
    rates, forces = rng.normal(size=(50, 3)), rng.normal(size=(50, 3))
    plain = measured(rates, forces, gyro_noise=1e-3, accel_bias=0.1)
    more = measured(rates, forces, gyro_noise=1e-3, accel_bias=0.1, gyro_g_sensitivity=1e-9)
    np.testing.assert_array_equal(plain.forces, more.forces)
    assert 0.0 < np.abs(plain.rates - more.rates).max() < 1e-8


def test_two_ways_of_rounding_are_refused():
    with pytest.raises(ConfigurationError, match="gyro_increment and gyro_resolution"):
        imu.check(imu.ImuErrors(gyro_increment=1e-5, gyro_resolution=1e-3))


def test_data_sheet_units_are_read():
    table = {
        "imu": {
            "errors": {"gyro_g_sensitivity": "10 deg/h", "accel_increment": "0.5 mm/s"},
        },
        "segments": [{"kind": "hold", "duration": 2.0}],
    }
    errors = read_scenario(table).settings.imu.errors
    assert errors.gyro_g_sensitivity == pytest.approx(math.radians(10.0) / 3600.0)
    assert errors.accel_increment == pytest.approx(5e-4)


def test_only_wheels_are_held_to_their_road_and_a_walker_aligns_at_walking_speed():
    def told(**sections: Any) -> Any:
        table = {"segments": [{"kind": "hold", "duration": 2.0}], **sections}
        return fitting_defaults(read_scenario(table).settings)

    road, air, foot = (told(vehicle={"kind": kind}) for kind in ("road", "air", "foot"))
    assert [d["non_holonomic"]["enabled"] for d in (road, air, foot)] == [True, False, False]
    assert foot["alignment"]["course_speed"] < 1.4 < road["alignment"]["course_speed"]
    # In flight no rest has told the gyro bias.
    flying = told(vehicle={"kind": "air"}, start={"speed": 55.0}, imu={"grade": "industrial"})
    known = flying["alignment"]["gyro_bias_sigma"]
    assert known == flying["filter"]["gyro_bias_sigma"]
    assert known[0] > told(imu={"grade": "industrial"})["alignment"]["gyro_bias_sigma"][0]
