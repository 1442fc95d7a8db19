"""The ionosphere's second order: the index of refraction, a dipole's laws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import constants

from replay.kernels.higher_ionosphere import dipole_field, field_along_ray, second_order

L1 = 1575.42e6


def index(f, density, field):
    """Index of refraction of a right-handed wave along the field (Appleton and Hartree).

    Without its one: the difference is what counts, and would be lost.
    """
    e, m = constants.e, constants.m_e
    x = density * e**2 / (constants.epsilon_0 * m * (2 * np.pi * f) ** 2)
    y = e * field / (m * 2 * np.pi * f)
    square = -x / (1.0 - y)
    return square / (1.0 + np.sqrt(1.0 + square))


@pytest.mark.parametrize("f", [L1, 1227.60e6, 1176.45e6])
@pytest.mark.parametrize("field", [4e-5, -2e-5, 5e-6])
def test_it_is_the_index_of_refraction(f, field):
    """100 TECU in 200 km: the phase's part odd in the field, and the code's by f dn/df."""
    length, density = 200e3, 1e18 / 200e3
    odd = length * (index(f, density, field) - index(f, density, -field)) / 2
    found = second_order(1e18, field, f)
    assert -0.5 * found == pytest.approx(odd, rel=2e-3)
    h = 1e3
    groups = [
        index(f, density, b) + f * (index(f + h, density, b) - index(f - h, density, b)) / (2 * h)
        for b in (field, -field)
    ]
    assert found == pytest.approx(length * (groups[0] - groups[1]) / 2, rel=2e-2)


def test_a_dipole():
    """Field lines go in at the northern magnetic pole, with twice the field of the equator."""
    moment = np.array([-1450.9, 4652.5, -29404.8])
    size = np.linalg.norm(moment)
    north = -moment / size
    at_pole = np.array(dipole_field(*(6371.2e3 * north)))
    np.testing.assert_allclose(at_pole, -2 * size * 1e-9 * north, atol=1e-12)
    across = np.cross(north, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    at_equator = np.array(dipole_field(*(6371.2e3 * across)))
    np.testing.assert_allclose(at_equator, size * 1e-9 * north, atol=1e-12)
    np.testing.assert_allclose(dipole_field(*(2 * 6371.2e3 * across)), at_equator / 8, atol=1e-15)
    # No sources: the divergence is nought.
    at, h = np.array([4.1e6, -2.0e6, 5.2e6]), 1e3
    divergence = sum(
        (dipole_field(*(at + h * axis))[k] - dipole_field(*(at - h * axis))[k]) / (2 * h)
        for k, axis in enumerate(np.eye(3))
    )
    assert divergence == pytest.approx(0.0, abs=1e-17)


def test_along_the_ray():
    """Straight above a northern station the wave comes down along the field; north to it."""
    x = np.array([3582105.0, 532590.0, 5232754.8])
    up = x / np.linalg.norm(x)
    found = field_along_ray(x, *up)
    field = np.array(dipole_field(*(up * (6371.2e3 + 450e3))))
    assert found == pytest.approx(-field @ up, rel=1e-12)
    assert found > 3e-5
    level = np.cross(up, np.cross([0.0, 0.0, 1.0], up))
    slant = np.cos(0.6) * level / np.linalg.norm(level) + np.sin(0.6) * up
    hit = x + slant * 720e3
    for _ in range(60):
        hit += slant * (6371.2e3 + 450e3 - np.linalg.norm(hit))
    due = -np.array(dipole_field(*hit)) @ slant
    assert field_along_ray(x, *slant) == pytest.approx(due, rel=1e-9)
