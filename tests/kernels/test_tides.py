"""Tides: the examples that the IERS publish, RTKLIB, closed forms."""

from __future__ import annotations

import datetime

import numpy as np
import pytest

from replay.kernels.sun_moon import sun_moon_ecef
from replay.kernels.tides import (
    doodson_arguments,
    ocean_arguments,
    ocean_loading,
    permanent_tide,
    pole_tide,
    secular_pole,
    solid_tide,
    solid_tide_of,
)

# Station, date of UTC's midnight, UTC - GPS (s), Sun, Moon, displacement: the test cases in
# the head of the routine DEHANTTIDEINEL of the IERS Conventions (2010).
PUBLISHED = [
    (
        (4075578.385, 931852.890, 4801570.154), (2009, 4, 13), -15.0,
        (137859926952.015, 54228127881.4350, 23509422341.6960),
        (-179996231.920342, -312468450.131567, -169288918.592160),
        (0.07700420357108125891, 0.06304056321824967613, 0.05516568152597246810),
    ),
    (
        (1112189.660, -4842955.026, 3985352.284), (2012, 7, 13), -16.0,
        (-54537460436.2357, 130244288385.279, 56463429031.5996),
        (300396716.912, 243238281.451, 120548075.939),
        (-0.02036831479592075833, 0.05658254776225972449, -0.07597679676871742227),
    ),
    (
        (1112200.5696, -4842957.8511, 3985345.9122), (2015, 7, 15), -17.0,
        (100210282451.6279, 103055630398.3160, 56855096480.4475),
        (369817604.4348, 1897917.5258, 120804980.8284),
        (0.00509570869172363845, 0.0828663025983528700, -0.0636634925404189617),
    ),
]  # fmt: skip

STATIONS = np.array(
    [
        (3582105.0, 532590.0, 5232754.8),
        (-2694045.0, -4293642.0, 3857878.0),
        (-4460996.0, 2682557.0, -3674443.0),
        (6378137.0, 1.0, 2.0),
        (10.0, -5.0, 6356752.0),
    ]
)


def gps_ns(*date, utc_minus_gps_s=-18.0):
    """GPS time of a moment of UTC."""
    since = datetime.datetime(*date) - datetime.datetime(1980, 1, 6)
    return int(since.total_seconds() * 10**9) - round(utc_minus_gps_s * 10**9)


@pytest.mark.parametrize(("x", "date", "offset", "sun", "moon", "due"), PUBLISHED)
def test_solid_tide_as_published(x, date, offset, sun, moon, due):
    out = np.zeros(3)
    at = gps_ns(*date, utc_minus_gps_s=offset)
    solid_tide_of(np.array(x), at, offset, np.array(sun), np.array(moon), out)
    # 0.03 mm: the published routine's Moon's longitude, see the module.
    np.testing.assert_allclose(out, due, atol=4e-5)


def test_frequencies_of_the_published_subroutine():
    """With no bodies only the corrections by frequency are left: the example of STEP2DIU.

    T = 0.1059411362080767 centuries is 2010-08-06 at 0 h; the long-period part, which that
    routine does not have, is that of the equation in the test.
    """
    x = np.array([4075578.385, 931852.890, 4801570.154])
    at = gps_ns(2010, 8, 6, utc_minus_gps_s=-15.0)
    far = np.array([1e30, 0.0, 0.0])
    out = np.zeros(3)
    solid_tide_of(x, at, -15.0, far, far, out)
    _, s, h, p, n, _ = doodson_arguments(at, -15.0)
    r = np.linalg.norm(x)
    sin_phi, cos_phi = x[2] / r, np.hypot(x[0], x[1]) / r
    angles = np.array([n, 2 * h, s - p, 2 * s, 2 * s + n])
    table = np.array(
        [
            (0.47, 0.16, 0.23, 0.07), (-0.20, -0.11, -0.12, -0.05), (-0.11, -0.09, -0.08, -0.04),
            (-0.13, -0.15, -0.11, -0.07), (-0.05, -0.06, -0.05, -0.03),
        ]
    )  # fmt: skip
    up = (1.5 * sin_phi**2 - 0.5) * (table[:, 0] @ np.cos(angles) + table[:, 1] @ np.sin(angles))
    north = 2 * sin_phi * cos_phi * (
        table[:, 2] @ np.cos(angles) + table[:, 3] @ np.sin(angles)
    )  # fmt: skip
    lon = np.arctan2(x[1], x[0])
    long_period = 1e-3 * (
        up * x / r
        + north * np.array([-sin_phi * np.cos(lon), -sin_phi * np.sin(lon), cos_phi])
    )  # fmt: skip
    due = [0.4193085327321284701e-2, 0.1456681241014607395e-2, 0.5123366597450316508e-2]
    np.testing.assert_allclose(out - long_period, due, atol=4e-5)


def test_a_body_overhead_of_a_rigid_geometry():
    """Over a station on the equator: h2, h3 times the equilibrium height, straight up.

    Of degree 2, out of phase and by latitude nothing is left where the body is in the meridian
    and in the plane of the equator; the Love number's part by latitude is -0.0006 P2(0).
    """
    x = np.array([6378136.6, 0.0, 0.0])
    moon = np.array([3.8e8, 0.0, 0.0])
    far = np.array([0.0, 0.0, 1e30])
    none, out = np.zeros(3), np.zeros(3)
    at = gps_ns(2020, 6, 25)
    solid_tide_of(x, at, -18.0, far, np.array([1e30, 0.0, 0.0]), none)
    solid_tide_of(x, at, -18.0, far, moon, out)
    ratio = 6378136.6 / 3.8e8
    height = 0.0123000371 * 6378136.6 * ratio**3
    due = height * (0.6078 + 0.0003) + height * ratio * 0.292
    assert (out - none)[0] == pytest.approx(due, abs=1e-9)
    # The imaginary parts of l2 give a semidiurnal displacement to the east alone.
    assert (out - none)[1] == pytest.approx(1.5 * 0.0007 * height, abs=1e-9)
    assert (out - none)[2] == pytest.approx(0.0, abs=1e-9)


def test_mean_over_years_is_the_permanent_tide():
    """18.6 years of the tide leave its constant part: it is in the displacement.

    Less what the long-period corrections (18.6 years) and the beating of the sampling leave.
    """
    out, constant = np.zeros(3), np.zeros(3)
    start = gps_ns(2000, 1, 1)
    for x in STATIONS[:3]:
        count = 27000
        total = np.zeros(3)
        for k in range(count):
            solid_tide(x, start + int(k * 18.6134 * 365.25 * 86400e9 / count), -18.0, out)
            total += out
        permanent_tide(x, constant)
        np.testing.assert_allclose(total / count, constant, atol=5e-4)
        # h2 of 0.6078 for 0.6026: 0.1207 m for the 0.1196 m of eq. 7.14a.
        up = x / np.linalg.norm(x)
        sine = up[2]
        assert constant @ up == pytest.approx(-0.1206 * (1.5 * sine**2 - 0.5), abs=3e-4)


def rtklib_displacement(rtklib, x, date, option, erp, blq=None):
    time = rtklib.epoch2time(filled(rtklib, date))
    out = filled(rtklib, (0.0, 0.0, 0.0))
    odisp = filled(rtklib, np.zeros(66) if blq is None else blq)
    rtklib.tidedisp(time, filled(rtklib, x), option, erp, odisp, out)
    return np.array([out[k] for k in range(3)])


def filled(rtklib, numbers):
    out = rtklib.Arr1Ddouble(len(numbers))
    for k, number in enumerate(numbers):
        out[k] = float(number)
    return out


@pytest.fixture
def rotation(tmp_path):
    """RTKLIB with an ERP file: pole of 0.25" and 0.43", UT1 - UTC of -0.22 s."""
    rtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
    path = tmp_path / "made.erp"
    rows = [f"{59024.5 + k:8.2f} 250000 430000 -2200000 0 1 1 1 1 1 1 1 0 0" for k in range(3)]
    path.write_text("\n".join(["version 2", *rows, ""]))
    erp = rtklib.erp_t()
    assert rtklib.readerp(str(path), erp) == 1
    return rtklib, erp


DATE = (2020, 6, 25, 7, 30, 0)


def test_solid_tide_is_near_rtklibs(rotation):
    """RTKLIB has of the corrections by frequency K1 alone, out of phase the radial part alone.

    Its Sun and Moon serve here: it precesses places of date once more, by 0.28 deg in 2020.
    """
    rtklib, erp = rotation
    out = np.zeros(3)
    erpv = filled(rtklib, (0.0, 0.0, -0.22, 0.0, 0.0))
    sun, moon, gmst = (filled(rtklib, np.zeros(n)) for n in (3, 3, 1))
    rtklib.sunmoonpos(rtklib.epoch2time(filled(rtklib, DATE)), erpv, sun, moon, gmst)
    bodies = np.array([[body[k] for k in range(3)] for body in (sun, moon)])
    for x in STATIONS[:3]:
        solid_tide_of(x, gps_ns(*DATE), -18.22, bodies[0], bodies[1], out)
        np.testing.assert_allclose(out, rtklib_displacement(rtklib, x, DATE, 1, erp), atol=2.5e-3)


def test_pole_tide_is_rtklibs(rotation):
    """RTKLIB has the mean pole of 2010, linear since then; the formula is given it here."""
    rtklib, erp = rotation
    years = (datetime.datetime(*DATE) - datetime.datetime(2000, 1, 1)) / datetime.timedelta(365.25)
    m1 = 0.25 - 1e-3 * (23.513 + 7.6141 * years)
    m2 = -(0.43 - 1e-3 * (358.891 - 0.6287 * years))
    out = np.zeros(3)
    for x in STATIONS[:3]:
        pole_tide(x, m1, m2, out)
        # Its local axes are those of the ellipsoid: a 300th of a displacement of 4 mm.
        np.testing.assert_allclose(out, rtklib_displacement(rtklib, x, DATE, 4, erp), atol=2e-5)


def test_secular_pole():
    """55.0 and 320.5 mas at 2000, 1.677 and 3.460 mas a year (IERS 2018)."""
    xs, ys = secular_pole(gps_ns(2020, 1, 1, 12))
    assert xs == pytest.approx(0.055 + 20 * 0.001677, abs=1e-6)
    assert ys == pytest.approx(0.3205 + 20 * 0.003460, abs=1e-6)


def test_ocean_arguments_as_published():
    """The example of ARG2: 2008, day 311.5, UT1."""
    due = np.array(
        [
            2.849663065753787805, 6.28318080000000023, 4.926040134021299366,
            1.608450491115348768, 2.375021572352622456, 0.4746414933980958040,
            3.908159227647345801, 2.551018561669245344, 5.041990012540757959,
            4.206816878908014701, 1.608463638294885811,
        ]
    )  # fmt: skip
    found = np.zeros(11)
    ocean_arguments(gps_ns(2008, 11, 6, 12, utc_minus_gps_s=-14.0), -14.0, found)
    np.testing.assert_allclose((found - due + np.pi) % (2 * np.pi) - np.pi, 0.0, atol=3e-4)


def test_ocean_loading_is_rtklibs(rotation):
    rtklib, erp = rotation
    generator = np.random.default_rng(4)
    amplitudes = generator.uniform(0.0, 0.02, (3, 11))
    phases = generator.uniform(-180.0, 180.0, (3, 11))
    blq = np.concatenate([amplitudes, phases]).T.reshape(-1)
    arguments = np.zeros(11)
    ut1_minus_gps_s = -18.22
    ocean_arguments(gps_ns(*DATE), ut1_minus_gps_s, arguments)
    enu = ocean_loading(arguments, amplitudes, np.radians(phases))
    for x in STATIONS[:3]:
        p = np.hypot(x[0], x[1])
        sin_lon, cos_lon = x[1] / p, x[0] / p
        east = np.array([-sin_lon, cos_lon, 0.0])
        due = rtklib_displacement(rtklib, x, DATE, 2, erp, blq)
        # The direction of up is that of the ellipsoid's normal; its length says the rest.
        assert due @ east == pytest.approx(enu[0], abs=2e-5)
        assert np.linalg.norm(due) == pytest.approx(np.linalg.norm(enu), abs=3e-5)


def test_one_tide_by_hand():
    """M2 alone with its own phase: the amplitudes, west and south turned to east and north."""
    arguments = np.zeros(11)
    ocean_arguments(gps_ns(*DATE), -18.22, arguments)
    amplitudes, phases = np.zeros((3, 11)), np.zeros((3, 11))
    amplitudes[:, 0] = 0.03, 0.004, 0.005
    phases[:, 0] = arguments[0]
    np.testing.assert_allclose(
        ocean_loading(arguments, amplitudes, phases), (-0.004, -0.005, 0.03), atol=1e-15
    )


def test_at_the_pole_nothing_breaks():
    out = np.zeros(3)
    sun, moon = np.zeros(3), np.zeros(3)
    at = gps_ns(*DATE)
    sun_moon_ecef(at, -18.2, sun, moon)
    near, pole = np.array([1e-3, 0.0, 6356752.0]), np.array([0.0, 0.0, 6356752.0])
    solid_tide_of(near, at, -18.2, sun, moon, out)
    kept = out.copy()
    solid_tide_of(pole, at, -18.2, sun, moon, out)
    np.testing.assert_allclose(out, kept, atol=1e-9)
