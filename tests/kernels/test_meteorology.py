"""Meteorology by place and season: RTKLIB's tropospheric model of SBAS, the IERS test case."""

import numpy as np
import pytest

from replay.kernels import meteorology
from replay.kernels.atmosphere import zenith_hydrostatic, zenith_standard

WEEKS = (2100, 2114, 2135, 2140)


@pytest.mark.parametrize("latitude", [-88.0, -60.0, -33.3, -15.0, 0.0, 7.0, 15.0, 41.0, 75.0, 90.0])
@pytest.mark.parametrize("height", [0.0, 350.0, 4000.0])
def test_mops_is_rtklibs_model_of_sbas(latitude, height):
    pyrtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
    place, azel, variance = (pyrtklib.Arr1Ddouble(n) for n in (3, 2, 1))
    place[0], place[1], place[2] = np.radians(latitude), 0.3, height
    for week in WEEKS:
        for elevation in np.radians([6.0, 30.0, 90.0]):
            azel[0], azel[1] = 0.0, elevation
            time = pyrtklib.gpst2time(week, 5784.0)
            # It remembers the zenith delay of its last place, whatever the time.
            place[0] = 0.5
            pyrtklib.sbstropcorr(time, place, azel, variance)
            place[0] = np.radians(latitude)
            expected = pyrtklib.sbstropcorr(time, place, azel, variance)
            day = pyrtklib.time2doy(time)
            zenith = meteorology.mops_zenith(np.radians(latitude), height, day)
            slant = sum(zenith) * meteorology.mops_mapping(elevation)
            assert slant == pytest.approx(expected, rel=1e-13)


def test_mops_at_the_nodes_of_its_table():
    """RTCA DO-229D, table A-2: 45 degrees, at the coldest and at a mean day."""
    node = np.radians(45.0)
    cold = meteorology.mops_surface(node, 28.0)
    assert cold == pytest.approx((1018.0, 272.15, 4.42, 5.26e-3, 2.11), rel=1e-12)
    mean = meteorology.mops_surface(node, 28.0 + 365.25 / 4)
    assert mean == pytest.approx((1015.75, 283.15, 11.66, 5.58e-3, 2.57), rel=1e-12)
    # The south is half a year behind, by the document's 211 days.
    assert meteorology.mops_surface(-node, 211.0) == pytest.approx(cold, rel=1e-12)
    # In the tropics there are no seasons.
    assert meteorology.mops_surface(0.1, 28.0) == meteorology.mops_surface(0.1, 200.0)


def test_gpt_is_the_test_case_of_the_iers():
    """Header of GPT.F, IERS Conventions (2010), chapter 9."""
    pressure, temperature, undulation = meteorology.gpt(
        0.6708665767, -1.393397187, 812.546, 55055.0
    )
    assert pressure == pytest.approx(918.0710638757363995, rel=1e-14)
    assert temperature == pytest.approx(19.31914181012882992, rel=1e-13)
    assert undulation == pytest.approx(-42.19185643717770517, rel=1e-13)


@pytest.mark.parametrize("model", ["mops", "gpt"])
def test_models_agree_with_the_standard_atmosphere_in_a_mean_place(model):
    """45 degrees north in spring at 300 m: a few centimetres in the zenith."""
    latitude, longitude, height = np.radians(45.0), np.radians(8.0), 300.0
    standard = zenith_standard(latitude, height, 0.5)
    if model == "mops":
        found = meteorology.mops_zenith(latitude, height, 28.0 + 365.25 / 4)
    else:
        found = meteorology.gpt_zenith(latitude, longitude, height, 58970.0, 0.5)
    assert found[0] == pytest.approx(standard[0], abs=0.03)
    assert found[1] == pytest.approx(standard[1], abs=0.06)


def test_gpt_gives_the_zenith_delay_of_its_pressure():
    """Above the sea, not above the ellipsoid: 42 m of geoid are half a centimetre."""
    place = (0.6708665767, -1.393397187, 812.546)
    dry, _ = meteorology.gpt_zenith(*place, 55055.0, 0.7)
    expected = zenith_hydrostatic(918.0710638757364, place[0], 812.546 + 42.1918564371777)
    assert dry == pytest.approx(expected, rel=1e-14)
