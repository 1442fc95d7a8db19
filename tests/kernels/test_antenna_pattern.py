"""What an antenna adds to a range: closed forms, RTKLIB's and scipy's numbers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from replay.kernels.antenna_pattern import (
    PATTERN_DTYPE,
    antenna_range,
    choose_pattern,
    pattern_value,
)
from replay.kernels.gnss_records import BEIDOU, GALILEO, GLONASS, GPS, QZSS

ZENITHS = np.radians(np.arange(0.0, 91.0, 5.0))
AZIMUTHS = np.radians(np.arange(0.0, 361.0, 10.0))
L1, L2, L5 = 1575.42e6, 1227.60e6, 1176.45e6


def made(offset=(0.0, 0.0, 0.0), seed=3):
    """A pattern of random numbers, its values by zenith angle and by azimuth too."""
    generator = np.random.default_rng(seed)
    mean = generator.normal(0.0, 0.003, len(ZENITHS))
    whole = generator.normal(0.0, 0.003, (len(AZIMUTHS), len(ZENITHS)))
    whole[-1] = whole[0]
    pattern = np.zeros(1, dtype=PATTERN_DTYPE)
    pattern["offset"] = offset
    pattern["zenith_step"], pattern["zenith_count"] = np.radians(5.0), len(ZENITHS)
    pattern["azimuth_step"], pattern["azimuth_count"] = np.radians(10.0), len(AZIMUTHS)
    # Not at the start of the numbers.
    pattern["first"] = 2
    return pattern, np.concatenate([[9.0, 9.0], mean, whole.reshape(-1)]), mean, whole


def directions(count=200, lowest=0.0):
    generator = np.random.default_rng(5)
    return zip(
        generator.uniform(np.radians(lowest), np.pi / 2, count),
        generator.uniform(0.0, 2 * np.pi, count),
        strict=True,
    )


def test_offset_and_mean_pattern_are_rtklibs():
    """`antmodel` has no azimuth: the azimuth's rows are left out here."""
    rtklib = pytest.importorskip("pyrtklib", reason="no wheel for this Python")
    north, east, up = 0.0123, -0.0456, 0.1357
    pattern, values, mean, _ = made((north, east, up))
    pattern["azimuth_count"] = 0
    theirs = rtklib.pcv_t()
    off, var = theirs.off, theirs.var
    off[0, 0], off[0, 1], off[0, 2] = east, north, up
    for k, value in enumerate(mean):
        var[0, k] = value
    out, delta, azel = (rtklib.Arr1Ddouble(n) for n in (rtklib.NFREQ, 3, 2))
    for k in range(3):
        delta[k] = 0.0
    for elevation, azimuth in [*directions(), (0.0, 1.0), (np.pi / 2, 2.0), (-0.1, 3.0)]:
        azel[0], azel[1] = azimuth, elevation
        rtklib.antmodel(theirs, delta, azel, 1, out)
        ours = antenna_range(pattern[0], values, elevation, azimuth, False)
        assert ours == pytest.approx(out[0], abs=1e-9)


def test_between_azimuths_and_zenith_angles_it_is_linear():
    """As scipy's interpolation on the same grid."""
    pattern, values, mean, whole = made()
    grid = RegularGridInterpolator((AZIMUTHS, ZENITHS), whole)
    for elevation, azimuth in directions():
        due = grid((azimuth, np.pi / 2 - elevation))
        for turns in (0.0, 2 * np.pi, -2 * np.pi):
            found = pattern_value(pattern[0], values, elevation, azimuth + turns, False)
            assert found == pytest.approx(due, abs=1e-12)
        due = np.interp(np.pi / 2 - elevation, ZENITHS, mean)
        assert pattern_value(pattern[0], values, elevation, azimuth, True) == pytest.approx(
            due, abs=1e-12
        )


def test_a_grid_that_ends_above_the_horizon_goes_on_with_its_edge():
    pattern, values, mean, _ = made()
    pattern["azimuth_count"], pattern["zenith_count"] = 0, 17
    found = pattern_value(pattern[0], values, np.radians(2.0), 1.0, False)
    assert found == mean[16]


def test_a_height_adds_minus_its_sine():
    pattern, values, _, _ = made((0.0, 0.0, 0.1))
    values[:] = 0.0
    for elevation, azimuth in directions(20):
        for level in (False, True):
            found = antenna_range(pattern[0], values, elevation, azimuth, level)
            assert found == pytest.approx(-0.1 * np.sin(elevation), abs=1e-15)


def test_a_horizontal_offset_counts_where_the_antenna_points_north():
    """Towards a satellite in the north the antenna is nearer by its offset to the north."""
    pattern, values, _, _ = made((0.02, -0.01, 0.0))
    values[:] = 0.0
    assert antenna_range(pattern[0], values, 0.0, 0.0, False) == pytest.approx(-0.02)
    assert antenna_range(pattern[0], values, 0.0, np.pi / 2, False) == pytest.approx(0.01)
    assert antenna_range(pattern[0], values, 0.0, 0.0, True) == 0.0


def patterns(*rows):
    """Patterns of antenna, system, band, frequency."""
    found = np.zeros(len(rows), dtype=PATTERN_DTYPE)
    for row, (antenna, system, band, frequency) in zip(found, rows, strict=True):
        row["antenna"], row["system"], row["band"], row["frequency"] = (
            antenna, system, band, frequency,
        )  # fmt: skip
    return found


@pytest.mark.parametrize(
    ("system", "band", "frequency", "place"),
    [
        (GPS, 1, L1, 1),
        (GPS, 2, L2, 2),
        (GPS, 5, L5, 2),
        (GLONASS, 1, 1602.0e6, 3),
        (GLONASS, 2, 1246.0e6, 2),
        (GALILEO, 1, L1, 1),
        (GALILEO, 5, L5, 2),
        (BEIDOU, 2, 1561.098e6, 1),
        (QZSS, 1, L1, 1),
    ],
)
def test_gps_stands_in_where_a_system_was_not_calibrated(system, band, frequency, place):
    known = patterns((8, GALILEO, 1, L1), (7, GPS, 1, L1), (7, GPS, 2, L2), (7, GLONASS, 1, 1.6e9))
    assert choose_pattern(known, 7, system, band, frequency, 100, 100) == place
    assert choose_pattern(known, 6, system, band, frequency, 100, 100) == -1


def test_a_pattern_serves_while_it_is_known_and_valid():
    known = patterns((7, GPS, 1, L1))
    known["available"], known["valid_from"], known["valid_until"] = 50, 100, 200
    answers = [choose_pattern(known, 7, GPS, 1, L1, t, 60) for t in (99, 100, 200, 201)]
    assert answers == [-1, 0, 0, -1]
    assert choose_pattern(known, 7, GPS, 1, L1, 150, 49) == -1
    known["valid_from"] = known["valid_until"] = 0
    assert choose_pattern(known, 7, GPS, 1, L1, 10**18, 60) == 0
