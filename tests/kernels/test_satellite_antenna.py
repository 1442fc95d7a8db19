"""Satellites' antennas: RTKLIB's numbers and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from replay.kernels.antenna_pattern import PATTERN_DTYPE
from replay.kernels.satellite_antenna import (
    nadir_azimuth,
    phase_centre,
    satellite_antenna_range,
)
from replay.kernels.satellite_attitude import NOMINAL, satellite_axes


def made(offset=(0.0, 0.0, 0.0)):
    """A pattern by nadir angle from 0 to 14 deg, by degrees."""
    values = np.random.default_rng(3).normal(0.0, 0.005, 15)
    pattern = np.zeros(1, dtype=PATTERN_DTYPE)
    pattern["offset"] = offset
    pattern["zenith_step"], pattern["zenith_count"] = np.radians(1.0), 15
    return pattern, values


def towards(nadir, azimuth):
    """Unit vector in the satellite's axes; the azimuth goes from y towards x."""
    s = np.sin(nadir)
    return np.array([s * np.sin(azimuth), s * np.cos(azimuth), np.cos(nadir)])


def turned(seed=4):
    axes, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return np.ascontiguousarray(axes * np.linalg.det(axes))


def test_directions():
    axes = turned()
    for nadir, azimuth in ((0.1, 0.3), (0.24, -2.0), (0.01, 3.0)):
        found = nadir_azimuth(axes, *(axes.T @ towards(nadir, azimuth)))
        np.testing.assert_allclose(found, (nadir, azimuth), atol=1e-12)


def test_variation_is_rtklibs():
    rtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
    pattern, values = made()
    theirs = rtklib.pcv_t()
    var = theirs.var
    for k, value in enumerate(values):
        var[0, k] = value
    for k in range(len(values), 19):
        var[0, k] = values[-1]
    out = rtklib.Arr1Ddouble(rtklib.NFREQ)
    axes = turned()
    for nadir in np.radians((0.0, 0.4, 3.7, 9.99, 13.2, 14.0, 15.5)):
        rtklib.antmodel_s(theirs, float(nadir), out)
        _, found = satellite_antenna_range(
            pattern[0], values, axes, *(axes.T @ towards(nadir, 1.0)), True
        )
        assert found == pytest.approx(out[0], abs=1e-9)


def test_offset_is_rtklibs():
    """Its nominal attitude with its own Sun; equal offsets on both of its frequencies."""
    rtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
    offset = (0.279, -0.013, 1.51)
    pattern, _ = made(offset)
    nav = rtklib.nav_t()
    theirs = nav.pcvs[0].off
    for band in range(3):
        for k in range(3):
            theirs[band, k] = offset[k]
    epoch, rs, dant, erpv, sun, moon, gmst = (rtklib.Arr1Ddouble(n) for n in (6, 6, 3, 5, 3, 3, 1))
    for k in range(5):
        erpv[k] = 0.0
    axes, out = np.zeros((3, 3)), np.zeros(3)
    for hour, r in (
        (2, (15.1e6, -12.3e6, 18.2e6)), (9, (-20.1e6, 3.3e6, -17.0e6)), (17, (1e6, 26e6, 5e6))
    ):  # fmt: skip
        for k, value in enumerate((2020, 6, 25, hour, 0, 0)):
            epoch[k] = value
        v = np.cross((0.3, -0.5, 0.8), r)
        v *= 3000.0 / np.linalg.norm(v)
        for k in range(3):
            rs[k], rs[3 + k] = r[k], v[k]
        time = rtklib.epoch2time(epoch)
        rtklib.satantoff(time, rs, 1, nav, dant)
        rtklib.sunmoonpos(rtklib.gpst2utc(time), erpv, sun, moon, gmst)
        satellite_axes(NOMINAL, np.array(r), v, np.array([sun[k] for k in range(3)]), axes)
        phase_centre(pattern[0], axes, out)
        np.testing.assert_allclose(out, [dant[k] for k in range(3)], atol=1e-9)


def test_range_is_that_between_phase_centres():
    """The distance from the shifted antenna, to second order in a metre over 20 000 km."""
    pattern, values = made((0.2, -0.1, 2.4))
    axes, out = turned(), np.zeros(3)
    phase_centre(pattern[0], axes, out)
    ray = 2.2e7 * (axes.T @ towards(0.2, 0.7))
    k = ray / np.linalg.norm(ray)
    offset, _ = satellite_antenna_range(pattern[0], values, axes, *k, True)
    due = np.linalg.norm(ray - out) - np.linalg.norm(ray)
    assert offset == pytest.approx(due, abs=1e-7)


def test_azimuth_of_a_pattern():
    """Rows at 0 (towards y), 90 (towards x), 180, 270, 360 deg."""
    pattern, values = made()
    rows = np.repeat([[0.001], [0.002], [0.003], [0.004], [0.001]], 15, axis=1)
    pattern["azimuth_step"], pattern["azimuth_count"] = np.radians(90.0), 5
    numbers = np.concatenate([values, rows.reshape(-1)])
    axes = np.eye(3)
    s, c = np.sin(0.1), np.cos(0.1)
    for direction, due in (
        ((0.0, s, c), 0.001), ((s, 0.0, c), 0.002), ((0.0, -s, c), 0.003), ((-s, 0.0, c), 0.004)
    ):  # fmt: skip
        _, found = satellite_antenna_range(pattern[0], numbers, axes, *direction, False)
        assert found == pytest.approx(due, abs=1e-12)
