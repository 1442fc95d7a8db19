"""Slopes, waves, fronts and gradients of the atmosphere against geometry of their own."""

from __future__ import annotations

import math

import numpy as np
import pymap3d
import pytest

from replay import channels
from replay.kernels.sky_fields import random_field, vertical_ionosphere, zenith_wet_field
from replay.simulate.air import Front, Ionosphere, Troposphere, Wave, WetField, air_record
from replay.simulate.trajectory import ecef_of
from tests.simulate.observing import HERE, START_NS, C, base, make, message, orbit, turn_z

PPM = 1e-6
LATITUDE, LONGITUDE = math.radians(30.5), math.radians(114.3)
ORIGIN = np.array(ecef_of(LATITUDE, LONGITUDE, 25.0))
EARTH_M, SHELL_M = 6378e3, 6378e3 + 375e3
AWAY = {"latitude": "31.2 deg", "longitude": "113.1 deg", "height": "300 m"}
ON_L1 = ["G1C"]
NO_TROPOSPHERE = {"troposphere": {"enabled": False}}
NO_IONOSPHERE = {"ionosphere": {"enabled": False}}


def terms(sky):
    """Rows of truth and the run, of a base at the origin and one that is away."""
    away = {**base("away", signals=ON_L1), **AWAY}
    return make(
        base(signals=ON_L1),
        away,
        sky={"systems": "G", **sky},
        truth={"rate": 10.0, "signals": True},
    )


def difference(one, other, receiver, field):
    """Values of a term in one run less those in another, on G1C, with satellites and times."""
    a, b = (m.rows[channels.SIGNAL_TRUTH.at(receiver=receiver)] for m in (one, other))
    rows = np.flatnonzero(a["signal"] == b"1C")[::17]
    np.testing.assert_array_equal(a["satellite"], b["satellite"])
    names = [name.decode() for name in a["satellite"][rows]]
    return (a[field] - b[field])[rows], names, a.valid_time_ns[rows]


def direction(made, receiver, satellite, time_ns):
    """Azimuth and elevation, rad, and the receiver's latitude and longitude."""
    info = made.rows[channels.RECEIVER.at(receiver=receiver)]
    place = info["approximate_position_ecef_m"][0]
    m = message(made, satellite)
    travel = 0.075
    for _ in range(4):
        at, _ = orbit(m, (int(time_ns) - m["toe_ns"]) / 1e9 - travel)
        at = turn_z(7.292115e-5 * travel) @ at
        travel = float(np.linalg.norm(at - place)) / C
    latitude, longitude, height = pymap3d.ecef2geodetic(*place)
    azimuth, elevation, _ = pymap3d.ecef2aer(*at, latitude, longitude, height)
    return *np.radians([azimuth, elevation]), *np.radians([latitude, longitude])


def pierce(azimuth, elevation, latitude, longitude):
    """Distances east and north of the origin on the shell, and slant, by vectors."""
    up = np.array(
        [math.cos(latitude) * math.cos(longitude), math.cos(latitude) * math.sin(longitude),
         math.sin(latitude)]
    )  # fmt: skip
    east = np.array([-math.sin(longitude), math.cos(longitude), 0.0])
    north = np.cross(up, east)
    level = math.sin(azimuth) * east + math.cos(azimuth) * north
    ray = math.cos(elevation) * level + math.sin(elevation) * up
    along = EARTH_M * math.sin(elevation)
    s = math.sqrt(along**2 + SHELL_M**2 - EARTH_M**2) - along
    at = EARTH_M * up + s * ray
    phi, lam = math.asin(at[2] / SHELL_M), math.atan2(at[1], at[0])
    slant = SHELL_M / (at @ ray)
    return (
        SHELL_M * math.cos(LATITUDE) * (lam - LONGITUDE),
        SHELL_M * (phi - LATITUDE),
        slant,
    )


@pytest.mark.parametrize("receiver", ["base", "away"])
def test_slope_and_wave_lie_over_pierce_points(receiver):
    wave = {"amplitude": "0.4 m", "length": "150 km", "speed": 120.0, "direction": "50 deg"}
    fields = {"slope_east": "3 ppm", "slope_north": "-5 ppm", "wave": wave}
    made = terms({"ionosphere": fields, **NO_TROPOSPHERE})
    found, names, times = difference(made, terms(NO_TROPOSPHERE), receiver, "ionosphere_m")
    for delay, name, time_ns in zip(found, names, times, strict=True):
        east, north, slant = pierce(*direction(made, receiver, name, time_ns))
        ahead = east * math.sin(math.radians(50.0)) + north * math.cos(math.radians(50.0))
        phase = 2.0 * math.pi * (ahead - 120.0 * (time_ns - START_NS) / 1e9) / 150e3
        vertical = 3 * PPM * east - 5 * PPM * north + 0.4 * math.sin(phase)
        assert delay == pytest.approx(slant * vertical, abs=1e-5)
    assert len(found) > 5
    assert np.ptp(found) > 0.5


def test_a_front_is_a_ramp_that_moves():
    front = Front(height=3.0, width=60e3, speed=250.0, direction=math.radians(90.0), place=-20e3)
    air = air_record(Ionosphere(front=front), Troposphere(), False, ORIGIN, 1)[0]

    def at(east_m, since_s):
        turned = east_m / (SHELL_M * math.cos(LATITUDE))
        return vertical_ionosphere(air, LATITUDE, LONGITUDE + turned, since_s)

    assert at(-20.001e3, 0.0) == 3.0
    assert at(40.001e3, 0.0) == 0.0
    assert at(10e3, 0.0) == pytest.approx(1.5, abs=1e-9)
    assert at(11e3, 0.0) - at(10e3, 0.0) == pytest.approx(-3.0 / 60.0, abs=1e-9)
    assert at(10e3 + 250.0 * 400.0, 400.0) == pytest.approx(1.5, abs=1e-9)


def test_what_is_broadcast_need_not_be_true():
    code = {"alpha": [1.2821e-8, -9.6222e-9, -3.5982e-7, -6.0901e-7]}
    code["beta"] = [1.0840e5, -1.3197e5, -2.6331e5, 4.0570e5]
    told = {"broadcast_alpha": [1e-8, 0.0, 0.0, 0.0], "broadcast_beta": [9e4, 0.0, 0.0, 0.0]}
    same = terms({"ionosphere": code})
    other = terms({"ionosphere": {**code, **told}})
    found, _, _ = difference(same, other, "base", "ionosphere_m")
    assert not found.any()
    topic = channels.NAV_IONOSPHERE.topic
    numbers = [m.rows[topic].ragged("coefficients").row(0).tolist() for m in (same, other)]
    assert numbers[0] == [*code["alpha"], *code["beta"]]
    assert numbers[1] == [*told["broadcast_alpha"], *told["broadcast_beta"]]


def test_the_wet_gradient_is_chens_and_herrings():
    made = terms({"troposphere": {"gradient_east": "2 mm", "gradient_north": "-1 mm"}})
    found, names, times = difference(made, terms({}), "away", "troposphere_m")
    for delay, name, time_ns in zip(found, names, times, strict=True):
        azimuth, elevation, _, _ = direction(made, "away", name, time_ns)
        mapping = 1.0 / (math.sin(elevation) * math.tan(elevation) + 0.0032)
        expected = mapping * (2e-3 * math.sin(azimuth) - 1e-3 * math.cos(azimuth))
        assert delay == pytest.approx(expected, abs=1e-7)
    assert np.abs(found).max() > 5e-3


def test_the_wet_slope_is_that_of_the_zenith_delay():
    made = terms({"troposphere": {"wet_slope_east": "0.4 ppm", "wet_slope_north": "1 ppm"}})
    place = made.rows[channels.RECEIVER.at(receiver="away")]["approximate_position_ecef_m"][0]
    origin = (float(HERE[k].split()[0]) for k in ("latitude", "longitude", "height"))
    east, north, _ = pymap3d.ecef2enu(*place, *origin)
    here, _, _ = difference(made, terms({}), "base", "troposphere_m")
    assert np.abs(here).max() < 1e-9
    # As much as the same zenith delay for all makes at this receiver: mapped the same way.
    zenith = 0.4 * PPM * east + PPM * north
    wetter = terms({"troposphere": {"wet_slope_north": 1e-5}})
    once, _, _ = difference(made, terms({}), "away", "troposphere_m")
    tenfold, _, _ = difference(wetter, terms({}), "away", "troposphere_m")
    np.testing.assert_allclose(once, tenfold * zenith / (1e-5 * north), rtol=1e-6)
    assert 1.0 < (once / zenith).min() < 1.5
    assert (once / zenith).max() < 6.0


def test_the_wet_field_has_its_size_and_length_and_goes_with_the_wind():
    field = WetField(sigma=0.02, length=40e3, wind=12.0, direction=math.radians(30.0))
    distances = (0.0, 1e3, 40e3, 80e3, 200e3)
    products = np.zeros((1500, len(distances)))
    for seed in range(len(products)):
        air = air_record(Ionosphere(), Troposphere(field=field), False, ORIGIN, seed)[0]
        here = zenith_wet_field(air, 5e3, -3e3, 100.0)
        products[seed] = [here * zenith_wet_field(air, 5e3 + d, -3e3, 100.0) for d in distances]
        if seed % 100 == 0:
            x, y = 12.0 * math.sin(field.direction), 12.0 * math.cos(field.direction)
            later = zenith_wet_field(air, 5e3 + 3600.0 * x, -3e3 + 3600.0 * y, 3700.0)
            assert later == pytest.approx(here, abs=1e-12)
    expected = 0.02**2 * np.exp(-np.square(distances) / (2.0 * 40e3**2))
    spread = products.std(axis=0) / math.sqrt(len(products))
    assert (np.abs(products.mean(axis=0) - expected) < 4.0 * spread).all()
    assert spread[0] < 0.05 * expected[0]


def test_a_field_of_one_wave_is_that_wave():
    waves = np.array([[2.0, 1e-4, -2e-4, 0.01, 0.5]])
    assert random_field(waves, 3e3, 4e3, 20.0) == pytest.approx(2.0 * math.cos(-0.2), abs=1e-12)


def test_near_stations_have_near_wet_delays():
    near = {**base("away", signals=ON_L1), **HERE, "latitude": "30.51 deg"}
    sky = {"systems": "G", "troposphere": {"field": {"sigma": "5 cm"}}, **NO_IONOSPHERE}
    still = {"systems": "G", **NO_IONOSPHERE}
    asked = {"rate": 10.0, "signals": True}
    made, plain = (make(base(signals=ON_L1), near, sky=s, truth=asked) for s in (sky, still))
    a, names, _ = difference(made, plain, "base", "troposphere_m")
    b, others, _ = difference(made, plain, "away", "troposphere_m")
    assert names == others
    assert np.abs(a).max() > 0.01
    # 1.1 km is a 45th of the length: the slope's deviation is sigma / length.
    assert np.abs(a - b).max() < 6.0 * 5.0 * 0.05 * 1.11 / 50.0


def test_waves_have_lengths():
    with pytest.raises(Exception, match="length"):
        make(base(), sky={"ionosphere": {"wave": {"length": 0.0}}})
    assert Wave().amplitude == 0.0
