"""Weights of satellites: closed forms, and where they are continuous."""

import numpy as np
import pytest

from replay.kernels import weighting
from replay.kernels.gnss_records import MEASURED_DTYPE

ELEVATIONS = np.radians([3.0, 10.0, 20.0, 29.9, 30.1, 45.0, 70.0, 90.0])


@pytest.mark.parametrize("elevation", ELEVATIONS)
def test_closed_forms(elevation):
    sine = np.sin(elevation)
    low = elevation < np.radians(30.0)
    expected = {
        weighting.EQUAL: 1.0,
        weighting.SINE: 1.0 / sine**2,
        weighting.THRESHOLD: 1.0 / (2.0 * sine) ** 2 if low else 1.0,
        weighting.DOUBLE_ANGLE: 1.0 / np.sin(2.0 * elevation) ** 2 if low else 1.0,
        weighting.SUM: 0.5 * (1.0 + 1.0 / sine**2),
    }
    for model, value in expected.items():
        found = weighting.noise_factor(model, elevation, 30.0)
        assert found == pytest.approx(value, rel=1e-14), model


def test_strength_is_a_tenth_for_ten_decibel():
    factor = weighting.noise_factor(weighting.STRENGTH, 0.5, 45.0)
    assert factor == pytest.approx(1.0, rel=1e-15)
    assert weighting.noise_factor(weighting.STRENGTH, 0.5, 35.0) == pytest.approx(10.0, rel=1e-14)
    assert weighting.noise_factor(weighting.STRENGTH, 0.5, 55.0) == pytest.approx(0.1, rel=1e-14)
    unknown = weighting.noise_factor(weighting.STRENGTH, 0.5, float("nan"))
    assert unknown == weighting.noise_factor(weighting.STRENGTH, 0.5, 40.0)


def jump(model):
    """What is below over what is above 30 degrees."""
    below, above = np.radians(30.0) - 1e-9, np.radians(30.0) + 1e-9
    return weighting.noise_factor(model, below, 45.0) / weighting.noise_factor(model, above, 45.0)


def test_at_thirty_degrees_the_threshold_is_continuous_and_the_printed_equation_is_not():
    assert jump(weighting.THRESHOLD) == pytest.approx(1.0, abs=1e-7)
    # 1 / sin(60 deg)^2 = 4/3: Tang et al. (2021), eq. 5, as it is printed.
    assert jump(weighting.DOUBLE_ANGLE) == pytest.approx(4.0 / 3.0, abs=1e-7)


def test_variance_is_noise_orbit_and_atmosphere():
    row = np.zeros(1, dtype=MEASURED_DTYPE)
    row["elevation"], row["cn0"], row["range_std"], row["ionosphere"] = 0.4, 41.0, 2.0, 6.0
    weight = np.zeros(1, dtype=weighting.WEIGHT_DTYPE)
    weight["model"], weight["range_scale"] = weighting.SINE, 0.5
    weight["ionosphere"], weight["troposphere"] = 0.25, 0.2
    sine = np.sin(0.4)
    expected = (0.7 / sine) ** 2 + 1.0**2 + 1.5**2 + (0.2 / (sine + 0.1)) ** 2
    assert weighting.code_variance(row[0], 0, 0.7, weight[0]) == pytest.approx(expected, rel=1e-14)
