"""Sun, Moon and sidereal time against the IAU's routines."""

from __future__ import annotations

import erfa
import numpy as np
import pytest

from replay.kernels.sun_moon import (
    ASTRONOMICAL_UNIT_M,
    delaunay_arguments,
    sidereal_angle,
    sun_moon_ecef,
    terrestrial_centuries,
)

GPS_EPOCH_JD = 2444244.5
DAYS = np.random.default_rng(1).uniform(0.0, 365.25 * 80, 400)
UT1_MINUS_GPS_S = -17.7


def around(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def between(a, b):
    return np.linalg.norm(np.cross(a, b)) / np.linalg.norm(a) / np.linalg.norm(b)


def nanoseconds(days):
    return round(days * 86400) * 10**9


def dates(ns):
    """Terrestrial time and UT1 as days since the beginning of GPS time."""
    gps = ns / 86400e9
    return gps + 51.184 / 86400, gps + UT1_MINUS_GPS_S / 86400


def test_time_and_fundamental_arguments():
    for days in DAYS[:50]:
        ns = nanoseconds(days)
        t = terrestrial_centuries(ns)
        assert t == pytest.approx((dates(ns)[0] - 7300.5) / 36525.0, abs=1e-15)
        due = (erfa.fal03(t), erfa.falp03(t), erfa.faf03(t), erfa.fad03(t), erfa.faom03(t))
        np.testing.assert_allclose(around(np.array(delaunay_arguments(t)) - due), 0.0, atol=1e-11)


def test_sidereal_time():
    for days in DAYS[:100]:
        ns = nanoseconds(days)
        tt, ut1 = dates(ns)
        due = erfa.gmst06(GPS_EPOCH_JD, ut1, GPS_EPOCH_JD, tt)
        # A day has 6 rad and a double of days since 1980 some 1e-12.
        assert around(sidereal_angle(ns, UT1_MINUS_GPS_S) - due) == pytest.approx(0.0, abs=2e-10)


def test_sun_and_moon():
    """Geometric places in the frame of IAU 2006/2000A without polar motion, 1980 to 2060."""
    sun, moon = np.zeros(3), np.zeros(3)
    worst = np.zeros(4)
    for days in DAYS:
        ns = nanoseconds(days)
        tt, ut1 = dates(ns)
        turn = erfa.c2t06a(GPS_EPOCH_JD, tt, GPS_EPOCH_JD, ut1, 0.0, 0.0)
        earth, _ = erfa.epv00(GPS_EPOCH_JD, tt)
        due_sun = turn @ -earth["p"] * ASTRONOMICAL_UNIT_M
        due_moon = turn @ erfa.moon98(GPS_EPOCH_JD, tt)["p"] * ASTRONOMICAL_UNIT_M
        sun_moon_ecef(ns, UT1_MINUS_GPS_S, sun, moon)
        found = [
            between(sun, due_sun),
            abs(np.linalg.norm(sun) / np.linalg.norm(due_sun) - 1.0),
            between(moon, due_moon),
            abs(np.linalg.norm(moon) / np.linalg.norm(due_moon) - 1.0),
        ]
        worst = np.maximum(worst, found)
    assert np.all(worst < [9e-5, 2e-5, 1.4e-4, 7e-5]), worst


def test_ut1_turns_the_sky():
    """A second later by UT1 alone, everything has gone west by 15.04 seconds of arc."""
    a, b, moon = np.zeros(3), np.zeros(3), np.zeros(3)
    ns = nanoseconds(14000.25)
    sun_moon_ecef(ns, -18.0, a, moon)
    sun_moon_ecef(ns, -17.0, b, moon)
    turn = around(np.arctan2(b[1], b[0]) - np.arctan2(a[1], a[0]))
    assert turn == pytest.approx(-7.292115e-5, rel=1e-6)
    assert b[2] == pytest.approx(a[2], abs=1.0)
