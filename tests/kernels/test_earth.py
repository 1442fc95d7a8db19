import numpy as np
import pymap3d
import pytest

from replay.kernels import earth

MICROGAL = 1e-8  # m/s^2
MICROMETRE = 1e-6
NANORADIAN = 1e-9

PLACES = [(0.0, 0.0), (45.0, -93.0), (-33.9, 151.2), (89.999, 10.0), (90.0, 0.0), (-72.0, -2.0)]


def somigliana(latitude_rad: float) -> float:
    """Normal gravity on the ellipsoid of WGS-84 (NIMA TR8350.2, eq. 4-1)."""
    s2 = np.sin(latitude_rad) ** 2
    k = 0.00193185265241
    return 9.7803253359 * (1 + k * s2) / np.sqrt(1 - earth.ECCENTRICITY_SQUARED * s2)


@pytest.mark.parametrize(("latitude", "longitude"), PLACES)
def test_gravity_on_the_ellipsoid_is_somiglianas(latitude, longitude):
    position = pymap3d.geodetic2ecef(latitude, longitude, 0.0)
    g = np.array(earth.gravity(*map(float, position)))
    assert np.linalg.norm(g) == pytest.approx(somigliana(np.radians(latitude)), abs=MICROGAL)


@pytest.mark.parametrize(("latitude", "longitude"), PLACES)
def test_gravity_on_the_ellipsoid_stands_on_it(latitude, longitude):
    position = pymap3d.geodetic2ecef(latitude, longitude, 0.0)
    g = np.array(earth.gravity(*map(float, position)))
    axes = np.zeros((3, 3))
    earth.enu_axes(*map(float, position), axes)
    east, north, _ = axes @ g
    assert abs(east) < MICROGAL
    assert abs(north) < MICROGAL


def test_gravity_falls_with_height_as_the_free_air_gradient():
    here = np.array(earth.gravity(*map(float, pymap3d.geodetic2ecef(45.0, 7.0, 0.0))))
    above = np.array(earth.gravity(*map(float, pymap3d.geodetic2ecef(45.0, 7.0, 1000.0))))
    # Free-air gradient of the normal field at 45 degrees: 0.3086 mGal/m (Torge, Geodesy).
    assert np.linalg.norm(here) - np.linalg.norm(above) == pytest.approx(3.086e-3, rel=2e-3)


@pytest.mark.parametrize("height", [-100.0, 0.0, 1600.0, 12_000.0, 800_000.0, 20_200_000.0])
@pytest.mark.parametrize(("latitude", "longitude"), PLACES)
def test_geodetic_agrees_with_pymap3d(latitude, longitude, height):
    position = pymap3d.geodetic2ecef(latitude, longitude, height)
    found_latitude, found_longitude, found_height = earth.geodetic(*map(float, position))
    assert found_latitude == pytest.approx(np.radians(latitude), abs=1e-12)
    if latitude < 90.0:
        assert found_longitude == pytest.approx(np.radians(longitude), abs=1e-12)
    assert found_height == pytest.approx(height, abs=1e-8 * max(1.0, abs(height) / 1e4))


def test_axes_agree_with_pymap3d():
    latitude, longitude = 40.1, -105.15
    position = pymap3d.geodetic2ecef(latitude, longitude, 1600.0)
    axes = np.zeros((3, 3))
    earth.enu_axes(*map(float, position), axes)
    for row, enu in zip(axes, np.eye(3), strict=True):
        expected = pymap3d.enu2uvw(*enu, latitude, longitude)
        np.testing.assert_allclose(row, expected, atol=NANORADIAN * 1e-4)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
