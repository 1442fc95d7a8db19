"""Constellations are what the systems say of themselves, and messages are one orbit each."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from replay import time
from replay.kernels import orbits
from replay.simulate.constellation import constellation, messages, name_of, perturb, refer, sends

MONDAY = time.parse_calendar("2020-11-30T06:00:00")
WEEK_END = time.parse_calendar("2020-12-05T20:00:00")


def state(record, time_ns):
    out = np.zeros(8)
    orbits.satellite_state(record, int(time_ns), 0.0, out)
    return out


@pytest.mark.parametrize("start", [MONDAY, WEEK_END])
@pytest.mark.parametrize("system", list("GECJ"))
def test_consecutive_messages_are_one_orbit(system, start):
    step = 2 * 3_600_000_000_000
    for satellite in constellation(system, 7, start):
        origin = int(satellite["toe_ns"])
        first = (start - origin) // step
        near = [refer(satellite, origin + (first + k) * step) for k in range(-4, 7)]
        for before, after in itertools.pairwise(near):
            at = (int(before["toe_ns"]) + int(after["toe_ns"])) // 2
            a, b = state(before, at), state(after, at)
            np.testing.assert_allclose(a[:3], b[:3], atol=1e-5)
            np.testing.assert_allclose(a[3:6], b[3:6], atol=1e-8)
            assert a[6] == pytest.approx(b[6], abs=1e-15)


def test_geostationary_satellites_stand_still():
    for satellite in constellation("C", 7, MONDAY):
        if not orbits.is_geostationary(satellite):
            continue
        near = refer(satellite, MONDAY // 10**9 * 10**9)
        for hours in (-2, 0, 2):
            s = state(near, MONDAY + hours * 3600 * 10**9)
            longitude = math.degrees(math.atan2(s[1], s[0]))
            wanted = {1: 140.0, 2: 84.0, 3: 110.5, 4: 160.0, 5: 58.75, 59: 140.0, 60: 80.0}
            wanted[61] = 110.5
            # Twice the eccentricity of at most some thousandths is what it swings by.
            assert abs(longitude - wanted[int(satellite["prn"])]) < 0.7
            assert abs(s[2]) < 100.0
            assert 4.20e7 < np.linalg.norm(s[:3]) < 4.24e7
            assert np.linalg.norm(s[3:6]) < 30.0


def test_inclined_geosynchronous_satellites_cross_the_equator_in_their_place():
    for satellite in constellation("C", 7, MONDAY):
        if int(satellite["prn"]) not in (6, 7, 8, 9, 38):
            continue
        near = refer(satellite, MONDAY // 10**9 * 10**9)
        track = [state(near, MONDAY + k * 60 * 10**9) for k in range(1440)]
        z = np.array([s[2] for s in track])
        up = np.flatnonzero((z[:-1] < 0.0) & (z[1:] >= 0.0))
        assert len(up) == 1
        s = track[int(up[0])]
        wanted = {6: 118.0, 7: 118.0, 8: 118.0, 9: 95.0, 38: 110.5}[int(satellite["prn"])]
        assert abs(math.degrees(math.atan2(s[1], s[0])) - wanted) < 1.0
        assert math.degrees(math.asin(np.abs(z).max() / np.linalg.norm(s[:3]))) == pytest.approx(
            55.0, abs=0.5
        )


def test_medium_orbits_have_their_period_and_planes():
    wanted = {"G": (31, 11.967, 6), "E": (24, 14.08, 3), "C": (45, 12.88, 0)}
    for system, (count, hours, planes) in wanted.items():
        satellites = constellation(system, 7, MONDAY)
        assert len(satellites) == count
        low = satellites[satellites["sqrt_a"] < 6000.0]
        period = 2 * math.pi * np.sqrt(low["sqrt_a"] ** 6 / 3.986e14) / 3600.0
        np.testing.assert_allclose(period, hours, rtol=2e-3)
        assert (low["eccentricity"] < 0.021).all()
        if planes:
            assert len(np.unique(low["omega0"].round(6))) == planes


@pytest.mark.parametrize("place", [(30.5, 114.3), (52.0, 4.4)])
def test_enough_satellites_are_up_all_day(place):
    latitude, longitude = np.radians(place)
    up = np.array(
        [
            np.cos(latitude) * np.cos(longitude),
            np.cos(latitude) * np.sin(longitude),
            np.sin(latitude),
        ]
    )
    for system, least in (("G", 5), ("E", 3), ("C", 4)):
        satellites = [refer(s, MONDAY) for s in constellation(system, 7, MONDAY)]
        for hour in range(0, 24, 2):
            places = np.array([state(s, MONDAY + hour * 3600 * 10**9)[:3] for s in satellites])
            line = places - 6.371e6 * up
            sine = line @ up / np.linalg.norm(line, axis=1)
            assert np.count_nonzero(sine > math.sin(math.radians(10.0))) >= least


def test_messages_are_sent_when_they_are_due():
    end = MONDAY + 3 * 3600 * 10**9 + 5
    rows = messages(constellation("GEC", 7, MONDAY), MONDAY, end)
    assert (np.diff(rows.log_time_ns) >= 0).all()
    assert (rows.log_time_ns == np.maximum(rows["transmitted_ns"], MONDAY)).all()
    for name, count in ((b"G01", 2), (b"E02", 7), (b"C06", 4)):
        own = rows["satellite"] == name
        assert np.count_nonzero(own) == count
        assert np.count_nonzero(rows["transmitted_ns"][own] <= MONDAY) == 1
        assert len(set(rows["iode"][own].tolist())) == count
    beidou = rows["satellite"].astype("U1") == "C"
    # BeiDou's own hours.
    assert (rows["toe_s"][beidou] % 3600.0 == 0.0).all()
    assert ((rows["toe_ns"][beidou] // 10**9 - 14) % 3600 == 0).all()
    assert ((rows["toe_s"] >= 0.0) & (rows["toe_s"] < 604_800.0)).all()


def test_true_orbits_are_off_by_the_deviation_asked_for():
    draws = np.random.default_rng(5)
    errors = []
    for satellite in constellation("GEC", 7, MONDAY):
        near = refer(satellite, MONDAY // 10**9 * 10**9)
        for _ in range(4):
            true = perturb(near, 2.0, 1.0, 7200.0, draws.standard_normal(6))
            a, b = state(near, MONDAY), state(true, MONDAY)
            r, v = a[:3], a[3:6] + np.cross([0, 0, 7.2921e-5], a[:3])
            radial = r / np.linalg.norm(r)
            cross = np.cross(r, v) / np.linalg.norm(np.cross(r, v))
            along = np.cross(cross, radial)
            off = b[:3] - a[:3]
            errors.append([off @ radial, off @ along, off @ cross, 299792458.0 * (b[6] - a[6])])
            assert name_of(true) == name_of(satellite)
    radial, along, cross, clock = np.sqrt(np.mean(np.square(errors), axis=0))
    assert radial == pytest.approx(2.0 / 3.0, rel=0.25)
    assert 1.5 < along < 3.5
    assert 1.5 < cross < 3.0
    assert clock == pytest.approx(1.0, rel=0.15)


def test_satellites_send_what_their_generation_has():
    beidou = {name_of(s): s for s in constellation("C", 7, MONDAY)}
    assert sends(beidou["C06"], "7I") and not sends(beidou["C20"], "7I")
    assert sends(beidou["C20"], "5P") and not sends(beidou["C06"], "5P")
    assert sends(beidou["C06"], "2I") and sends(beidou["C20"], "2I")
