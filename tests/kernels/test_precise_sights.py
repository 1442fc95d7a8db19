"""Parts of the loop over precise orbits: which pattern, wind-up after gaps, heights, GMF."""

from __future__ import annotations

import numpy as np
import pytest

from replay.kernels import path_delays, precise_records, precise_sights, precise_terms, sights
from replay.kernels.antenna_pattern import PATTERN_DTYPE
from replay.kernels.earth import enu_axes
from replay.kernels.gnss_records import MEASURED_DTYPE
from replay.kernels.mapping import gmf, gmf_coefficients
from replay.kernels.meteorology import gpt
from replay.kernels.wind_up import level_antenna, orientation_phase

SECOND = 1_000_000_000
C = 299792458.0
L1, L2, L5 = 1575.42e6, 1227.60e6, 1176.45e6
PLACE = np.array([3582105.0, 532590.0, 5232755.0])


def patterns(*bands):
    rows = np.zeros(len(bands), dtype=PATTERN_DTYPE)
    for row, (band, frequency, start, end) in zip(rows, bands, strict=True):
        row["band"], row["frequency"] = band, frequency
        row["valid_from"], row["valid_until"] = start, end
    return rows


def test_the_nearest_frequency_of_the_same_satellite_serves():
    rows = patterns((1, L1, 0, 0), (2, L2, 0, 0))

    def choose(band, frequency):
        return precise_terms.choose_satellite_pattern(rows, 0, 2, band, frequency, 5)

    assert choose(1, L1) == 0
    assert choose(2, L2) == 1
    assert choose(5, L5) == 1
    assert precise_terms.choose_satellite_pattern(rows, 2, 2, 1, L1, 5) == -1


def test_a_calibration_serves_while_it_is_valid():
    rows = patterns((1, L1, 10, 20), (1, L1, 21, 0))
    found = [precise_terms.choose_satellite_pattern(rows, 0, 2, 1, L1, t) for t in (5, 15, 25)]
    assert found == [-1, 0, 1]


def test_whole_cycles_of_wind_up_go_on_until_a_gap():
    """A satellite that turns by 100 deg a step, seen from below."""
    s = precise_records.new_precise_state()
    row = np.zeros(1, dtype=MEASURED_DTYPE)
    row["satellite"], row["signal"][0, 0], row["frequency"][0, 0] = 3, ord("1"), L1
    out = np.zeros(1, dtype=precise_records.TERMS_DTYPE)
    place_axes, receiver = np.zeros((3, 3)), np.zeros((3, 3))
    enu_axes(*PLACE, place_axes)
    level_antenna(place_axes, 0.0, receiver)
    u = np.ascontiguousarray(place_axes[2])
    east, north, up = place_axes

    def cycles(angle, t):
        axes = np.array(
            [
                np.cos(angle) * north + np.sin(angle) * east,
                np.cos(angle) * east - np.sin(angle) * north,
                -up,
            ]
        )
        precise_terms.add_wind_up(s[0], row[0], t, axes, receiver, u, out[0])
        fraction = orientation_phase(axes, receiver, *-u)
        found = out["wind_up"][0, 0] * L1 / C
        assert (found - fraction) == pytest.approx(round(found - fraction), abs=1e-9)
        return found

    step = np.radians(100.0)
    found = [cycles(k * step, k * 30 * SECOND) for k in range(12)]
    turns = np.diff(found) * 360.0
    np.testing.assert_allclose(np.abs(turns), 100.0, atol=1e-9)
    assert (np.sign(turns) == np.sign(turns[0])).all()
    assert abs(found[-1]) > 2.5
    again = cycles(11 * step, 11 * 30 * SECOND + 901 * SECOND)
    assert abs(again) <= 0.5


def test_the_height_of_the_air_lags_but_stays_near():
    """Noise of metres is averaged, a climb is followed within 20 m."""
    state = precise_records.new_precise_state()
    noise = np.random.default_rng(5).normal(0.0, 5.0, 400)
    axes = np.zeros((3, 3))
    enu_axes(*PLACE, axes)
    found = []
    for k, offset in enumerate(noise):
        precise_sights.smooth_height(state[0], PLACE + offset * axes[2], k * SECOND)
        found.append(float(state["height"][0]))
    assert np.std(found[200:]) < 0.5
    low = found[-1]
    for k in range(300):
        precise_sights.smooth_height(state[0], PLACE + 2.0 * k * axes[2], (400 + k) * SECOND)
    climbed = float(state["height"][0]) - low
    assert 2.0 * 299 - 21.0 < climbed < 2.0 * 299


@pytest.mark.parametrize("elevation", [0.1, 0.5, 1.4])
def test_gmf_of_the_plain_stage(elevation):
    """What the settings ask for by number 3 is GMF above the geoid of GPT."""
    t = 1_277_078_400 * SECOND
    day = 59025.0
    cfg = np.zeros(1, dtype=sights.SIGHTS_CONFIG_DTYPE)
    cfg["troposphere"], cfg["meteorology"] = 3, 2
    place = np.zeros(path_delays.PLACE)
    place[:3] = 0.96, 0.147, 60.0
    path_delays.prepare_place(cfg[0], place, t)
    row = np.zeros(1, dtype=MEASURED_DTYPE)
    row["elevation"] = elevation
    s = sights.new_sights_state(np.zeros(4), np.zeros(4))
    path_delays.model_atmosphere(row[0], PLACE, t, s[0], cfg[0], place)
    height = 60.0 - gpt(0.96, 0.147, 60.0, day)[2]
    dry, wet = gmf(elevation, height, *gmf_coefficients(0.96, 0.147, day))
    assert row["hydrostatic_mapping"][0] == dry
    assert row["wet_mapping"][0] == wet
    assert row["hydrostatic"][0] == place[4] * dry
    assert row["wet"][0] == place[5] * wet
