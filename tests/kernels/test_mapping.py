"""Mapping functions: examples that the IERS publish, RTKLIB, closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import lpmv

from replay.kernels.atmosphere import day_of_year, niell_hydrostatic, niell_wet
from replay.kernels.mapping import (
    GRADIENT_TOTAL,
    gmf,
    gmf_coefficients,
    gradient_mapping,
    modified_julian_date,
    spherical_harmonics,
    vienna_hydrostatic,
    vienna_wet,
    vmf1,
)
from replay.kernels.sky_fields import gradient_delay

# Test cases in the heads of the routines GMF, VMF1 and VMF1_HT of the IERS Conventions (2010).
LATITUDE, LONGITUDE, DAY = 0.6708665767, -1.393397187, 55055.0
ELEVATION = np.pi / 2 - 1.278564131


def test_global_mapping_functions_as_published():
    found = gmf(ELEVATION, 844.715, *gmf_coefficients(LATITUDE, LONGITUDE, DAY))
    due = (3.425245519339138678, 3.449589116182419257)
    np.testing.assert_allclose(found, due, rtol=1e-14)


def test_vienna_mapping_functions_as_published():
    given = (0.00127683, 0.00060955)
    found = vmf1(ELEVATION, *given, LATITUDE, 0.0, DAY)
    np.testing.assert_allclose(found, (3.424342122738070593, 3.448299714692572238), rtol=1e-14)
    found = vmf1(ELEVATION, *given, LATITUDE, 824.17, DAY)
    np.testing.assert_allclose(found, (3.425088087972572470, 3.448299714692572238), rtol=1e-14)


def test_harmonics_are_scipys():
    v, w = np.zeros((10, 10)), np.zeros((10, 10))
    for latitude, longitude in ((0.3, 1.0), (-1.2, -2.5), (0.0, 3.0)):
        z, flat = np.sin(latitude), np.cos(latitude)
        spherical_harmonics(flat * np.cos(longitude), flat * np.sin(longitude), z, v, w)
        for n in range(10):
            for m in range(n + 1):
                due = (-1) ** m * lpmv(m, n, z)  # without Condon and Shortley's sign
                scale = 1e-13 * max(1.0, float(np.max(np.abs(v))))
                assert v[n, m] == pytest.approx(due * np.cos(m * longitude), abs=scale)
                assert w[n, m] == pytest.approx(due * np.sin(m * longitude), abs=scale)


def test_global_mapping_functions_are_near_niells():
    """All over the Earth at 5 degrees: hydrostatic 1.5 %, wet 3 % (Boehm et al. 2006, fig. 1)."""
    e = np.radians(5.0)
    for latitude in np.radians((-70.0, -40.0, -5.0, 20.0, 45.0, 70.0)):
        for longitude in np.radians((-150.0, -20.0, 60.0, 140.0)):
            for day in (55197.0, 55378.0):  # January and July 2010
                dry, wet = gmf(e, 100.0, *gmf_coefficients(latitude, longitude, day))
                of_year = 1.0 + day - 55197.0
                assert dry == pytest.approx(
                    niell_hydrostatic(e, latitude, 100.0, of_year), rel=0.015
                )
                assert wet == pytest.approx(niell_wet(e, latitude), rel=0.03)


def test_in_the_zenith_they_are_one():
    place = gmf_coefficients(-0.5, 2.0, 58849.3)
    assert gmf(np.pi / 2, 1500.0, *place) == pytest.approx((1.0, 1.0), abs=1e-14)
    # The zenith's sine of rounding is one; VMF3 takes b and c as they come.
    assert vienna_hydrostatic(np.pi / 2, 1.2e-3, 3.1e-3, 0.07, 900.0) == pytest.approx(1.0)
    assert vienna_wet(np.pi / 2, 6e-4, 1.6e-3, 0.05) == pytest.approx(1.0)


def test_niells_functions_are_rtklibs():
    rtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
    place, azel, wet, epoch = (rtklib.Arr1Ddouble(n) for n in (3, 2, 1, 6))
    for k, value in enumerate((2020, 6, 25, 0, 0, 0)):
        epoch[k] = value
    time = rtklib.epoch2time(epoch)
    ns = 14781 * 86_400_000_000_000  # the same day, from 1980-01-06
    for latitude, height in ((0.9, 60.0), (-0.4, 1200.0), (0.2, 300.0), (-1.4, 2800.0)):
        for elevation in np.radians((4.0, 10.0, 35.0, 80.0)):
            place[0], place[1], place[2] = latitude, 0.1, height
            azel[0], azel[1] = 0.5, elevation
            dry = rtklib.tropmapf(time, place, azel, wet)
            # RTKLIB takes the geoid off the height.
            found = niell_hydrostatic(elevation, latitude, height, day_of_year(ns))
            assert found == pytest.approx(dry, abs=4e-3 if elevation < 0.1 else 4e-4)
            assert niell_wet(elevation, latitude) == pytest.approx(wet[0], abs=1e-9)


def test_gradients_are_chens_and_herrings():
    for elevation, azimuth in ((0.1, 0.3), (0.5, 2.5), (1.2, 5.0)):
        east, north = gradient_mapping(elevation, azimuth, GRADIENT_TOTAL)
        m = 1.0 / (np.sin(elevation) * np.tan(elevation) + 0.0032)
        assert east == pytest.approx(m * np.sin(azimuth), rel=1e-12)
        assert north == pytest.approx(m * np.cos(azimuth), rel=1e-12)
        due = gradient_delay(0.7e-3, -0.4e-3, elevation, azimuth)
        assert 0.7e-3 * east - 0.4e-3 * north == pytest.approx(due, rel=1e-12)
    assert gradient_mapping(np.pi / 2, 1.0, GRADIENT_TOTAL) == pytest.approx((0.0, 0.0), abs=1e-15)


def test_modified_julian_date():
    """MJD 44244 is 1980-01-06, 59025 is 2020-06-25."""
    day = 86_400_000_000_000
    assert modified_julian_date(0) == 44244.0
    assert modified_julian_date(14781 * day + day // 4) == 59025.25
