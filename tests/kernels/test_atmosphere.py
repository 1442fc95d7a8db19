import datetime

import numpy as np
import pytest

from replay.kernels import atmosphere
from replay.time import from_calendar

pyrtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")

MICROMETRE = 1e-6
MILLIMETRE = 1e-3

# GPS message of 2021-01-01 (file AMEL00NLD_R_20210010000_01D_MN.rnx).
ALPHA = np.array([7.4510e-09, -1.4900e-08, -5.9600e-08, 1.1920e-07])
BETA = np.array([90110.0, -65540.0, -131100.0, 458800.0])
PLACES = [(52.0, 4.4, 40.0), (-33.9, 151.2, 120.0), (1.0, -60.0, 800.0), (78.9, 11.9, 3.0)]


def c_array(values):
    out = pyrtklib.Arr1Ddouble(len(values))
    for i, value in enumerate(values):
        out[i] = float(value)
    return out


def gps_moment(moment: datetime.datetime):
    return pyrtklib.epoch2time(c_array(list(moment.timetuple()[:6])))


def test_klobuchars_model_is_rtklibs():
    rng = np.random.default_rng(3)
    coefficients = c_array([*ALPHA, *BETA])
    night = day = 0
    for _ in range(2000):
        latitude, elevation = rng.uniform(-1.5, 1.5), rng.uniform(0.05, 1.57)
        longitude, azimuth = rng.uniform(-3.1, 3.1), rng.uniform(0.0, 6.28)
        time_s = float(rng.integers(0, 604_800))
        theirs = pyrtklib.ionmodel(
            pyrtklib.gpst2time(2138, time_s),
            coefficients,
            c_array([latitude, longitude, 0.0]),
            c_array([azimuth, elevation]),
        )
        ours = atmosphere.klobuchar_l1(ALPHA, BETA, latitude, longitude, elevation, azimuth, time_s)
        assert ours == pytest.approx(theirs, abs=MICROMETRE)
        floor = 5e-9 * 299792458.0 * (1.0 + 16.0 * (0.53 - elevation / np.pi) ** 3)
        night += abs(ours - floor) < 1e-9
        day += ours > floor + 0.1
    assert night > 100
    assert day > 100


def test_klobuchars_model_by_a_worked_example():
    # The example of the widely used Matlab function klobuchar.m: 23.784 m.
    delay = atmosphere.klobuchar_l1(
        np.array([0.3820e-7, 0.1490e-7, -0.1790e-6, 0.0]),
        np.array([0.1430e6, 0.0, -0.3280e6, 0.1130e6]),
        *np.radians([40.0, -100.0, 20.0, 210.0]),
        593_100.0,
    )
    assert delay == pytest.approx(23.784, abs=5e-4)


def test_beidous_pierce_point_is_rtklibs():
    rng = np.random.default_rng(4)
    for _ in range(500):
        latitude, elevation = rng.uniform(-1.2, 1.2), rng.uniform(0.1, 1.57)
        longitude, azimuth = rng.uniform(-3.0, 3.0), rng.uniform(0.0, 6.28)
        point = pyrtklib.Arr1Ddouble(3)
        slant = pyrtklib.ionppp(
            c_array([latitude, longitude, 0.0]),
            c_array([azimuth, elevation]),
            6378.0,
            375.0,
            point,
        )
        phi, lam, ours = atmosphere.beidou_pierce_point(latitude, longitude, elevation, azimuth)
        assert ours == pytest.approx(slant, rel=1e-12)
        assert phi == pytest.approx(point[0], abs=1e-12)
        if abs(latitude) < 1.0:  # RTKLIB goes over the pole, which the ICD does not
            assert lam == pytest.approx(point[1], abs=1e-12)


def beidou_in_degrees(alpha, beta, latitude, longitude, elevation, azimuth, time_s):
    """The steps of BDS-SIS-ICD B1I 3.0, 5.2.4.7, in numpy and degrees."""
    k = 6378.0 / (6378.0 + 375.0) * np.cos(np.radians(elevation))
    psi = 90.0 - elevation - np.degrees(np.arcsin(k))
    phi = np.degrees(
        np.arcsin(
            np.sin(np.radians(latitude)) * np.cos(np.radians(psi))
            + np.cos(np.radians(latitude)) * np.sin(np.radians(psi)) * np.cos(np.radians(azimuth))
        )
    )
    lam = longitude + np.degrees(
        np.arcsin(np.sin(np.radians(psi)) * np.sin(np.radians(azimuth)) / np.cos(np.radians(phi)))
    )
    t = (time_s + lam * 240.0) % 86400.0
    powers = np.abs(phi / 180.0) ** np.arange(4)
    a2 = max(0.0, float(alpha @ powers))
    a4 = min(max(float(beta @ powers), 72000.0), 172800.0)
    vertical = 5e-9
    if abs(t - 50400.0) < a4 / 4.0:
        vertical += a2 * np.cos(2.0 * np.pi * (t - 50400.0) / a4)
    return 299792458.0 * vertical / np.sqrt(1.0 - k * k)


@pytest.mark.parametrize("scale", [0.5, 1.0, 3.0])  # the period is bounded on both sides
def test_beidous_model_follows_the_document(scale):
    alpha = np.array([1.1176e-08, 2.9802e-08, -4.1723e-07, 6.5565e-07])
    beta = scale * np.array([1.2288e5, -8.1920e4, 7.8643e5, -9.8304e5])
    rng = np.random.default_rng(5)
    for _ in range(300):
        latitude, elevation = rng.uniform(-70.0, 70.0), rng.uniform(5.0, 90.0)
        longitude, azimuth = rng.uniform(-180.0, 180.0), rng.uniform(0.0, 360.0)
        time_s = float(rng.uniform(0.0, 604_800.0))
        ours = atmosphere.klobuchar_b1i(
            alpha, beta, *np.radians([latitude, longitude, elevation, azimuth]), time_s
        )
        expected = beidou_in_degrees(alpha, beta, latitude, longitude, elevation, azimuth, time_s)
        assert ours == pytest.approx(expected, abs=MICROMETRE)


def test_beidous_model_at_noon_in_the_zenith():
    alpha = np.array([2e-8, 0.0, 0.0, 0.0])
    beta = np.array([1e5, 0.0, 0.0, 0.0])
    here = (0.3, 0.0, np.pi / 2, 0.0)
    noon = atmosphere.klobuchar_b1i(alpha, beta, *here, 50400.0)
    assert noon == pytest.approx(25e-9 * 299792458.0, rel=1e-12)
    night = atmosphere.klobuchar_b1i(alpha, beta, *here, 0.0)
    assert night == pytest.approx(5e-9 * 299792458.0, rel=1e-12)


@pytest.mark.parametrize("latitude", [-90.0, -85.0, 85.0, 90.0])
def test_the_models_are_finite_at_the_poles(latitude):
    for azimuth in np.linspace(0.0, 360.0, 73):
        for elevation in (5.0, 30.0, 85.0, 90.0):
            here = np.radians([latitude, 20.0, elevation, azimuth])
            assert 1.0 < atmosphere.klobuchar_l1(ALPHA, BETA, *here, 5e4) < 50.0
            assert 1.0 < atmosphere.klobuchar_b1i(ALPHA, BETA, *here, 5e4) < 50.0


def test_the_ionosphere_falls_with_the_square_of_the_frequency():
    l2 = atmosphere.scale_ionosphere(3.0, atmosphere.KLOBUCHAR_REFERENCE_HZ, 1227.60e6)
    assert l2 == pytest.approx(3.0 * (77.0 / 60.0) ** 2, rel=1e-15)


def test_standard_atmosphere_is_that_of_the_tables():
    # ISO 2533, table 1 (geopotential height): pressure in hPa, temperature in K.
    for height, pressure, temperature in [
        (0.0, 1013.25, 288.15),
        (1000.0, 898.746, 281.65),
        (5000.0, 540.199, 255.65),
        (11000.0, 226.320, 216.65),
    ]:
        found = atmosphere.standard_atmosphere(height)
        assert found == (pytest.approx(pressure, abs=1e-2), pytest.approx(temperature, abs=1e-9))
    assert atmosphere.standard_atmosphere(1e6) == atmosphere.standard_atmosphere(11000.0)
    assert atmosphere.standard_atmosphere(-1e6) == atmosphere.standard_atmosphere(-1000.0)


@pytest.mark.parametrize("humidity", [0.0, 0.7, 1.0])
@pytest.mark.parametrize("height", [0.0, 100.0, 1600.0, 4000.0, 9000.0])
@pytest.mark.parametrize("latitude", [-80.0, 0.0, 45.0])
def test_saastamoinens_zenith_delay_is_rtklibs(latitude, height, humidity):
    t = pyrtklib.gpst2time(2138, 0.0)
    position = c_array([np.radians(latitude), 0.0, height])
    theirs = pyrtklib.tropmodel(t, position, c_array([0.0, np.pi / 2]), humidity)
    dry, wet = atmosphere.zenith_standard(np.radians(latitude), height, humidity)
    # RTKLIB rounds the constants of the atmosphere and takes 0 C as 273.16 K.
    assert dry + wet == pytest.approx(theirs, abs=0.5 * MILLIMETRE)


def test_zenith_delays_of_measured_weather():
    # At 45 degrees and sea level the factor is one: 2.2768 mm/hPa (Davis et al. 1985).
    dry = atmosphere.zenith_hydrostatic(1000.0, np.pi / 4, 0.0)
    assert dry == pytest.approx(2.2768, abs=1e-12)
    # Saturation at 20 C is 23.39 hPa; the formula is good to 1 %, or 2 mm of delay.
    vapour = atmosphere.vapour_pressure(293.15, 1.0)
    assert vapour == pytest.approx(23.39, rel=1e-2)
    assert atmosphere.vapour_pressure(293.15, 0.5) == pytest.approx(0.5 * vapour, rel=1e-15)
    wet = atmosphere.zenith_wet(293.15, 10.0)
    assert wet == pytest.approx(0.002277 * (1255.0 / 293.15 + 0.05) * 10.0, rel=1e-15)


@pytest.mark.parametrize("month", [1, 4, 7, 12])
@pytest.mark.parametrize(("latitude", "longitude", "height"), PLACES + [(10.0, 0.0, 0.0)])
def test_niells_mapping_functions_are_rtklibs(latitude, longitude, height, month):
    moment = datetime.datetime(2020, month, 28, 18, 0, 0)
    day = atmosphere.day_of_year(from_calendar(moment))
    phi = np.radians(latitude)
    for elevation in np.radians([3.0, 5.0, 10.0, 20.0, 45.0, 90.0]):
        wet = pyrtklib.Arr1Ddouble(1)
        position = c_array([phi, np.radians(longitude), height])
        hydrostatic = pyrtklib.tropmapf(
            gps_moment(moment), position, c_array([0.0, elevation]), wet
        )
        ours = atmosphere.niell_hydrostatic(elevation, phi, height, day)
        assert ours == pytest.approx(hydrostatic, rel=1e-12)
        assert atmosphere.niell_wet(elevation, phi) == pytest.approx(wet[0], rel=1e-12)


def test_mapping_functions_are_one_in_the_zenith():
    assert atmosphere.niell_hydrostatic(np.pi / 2, 0.9, 2000.0, 100.0) == pytest.approx(1.0)
    assert atmosphere.niell_wet(np.pi / 2, 0.9) == pytest.approx(1.0)


@pytest.mark.parametrize("year", [1980, 1999, 2000, 2020, 2021, 2023, 2024, 2099])
def test_day_of_year_is_the_calendars(year):
    for month, date in [(1, 6), (1, 31), (2, 28), (3, 1), (12, 31)]:
        moment = datetime.datetime(year, month, date, 6, 0, 0)
        found = atmosphere.day_of_year(from_calendar(moment))
        assert found == moment.timetuple().tm_yday + 0.25
