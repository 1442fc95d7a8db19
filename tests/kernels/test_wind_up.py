"""Phase wind-up: dipoles as complex numbers, whole turns, continuity."""

from __future__ import annotations

import numpy as np
import pytest

from replay.kernels.earth import enu_axes
from replay.kernels.satellite_attitude import NOMINAL, satellite_axes
from replay.kernels.wind_up import (
    carry_on,
    level_antenna,
    new_state,
    orientation_phase,
    wind_up,
)


def turned(seed):
    axes, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return np.ascontiguousarray(axes * np.linalg.det(axes))


def around(cycles):
    return (cycles + 0.5) % 1.0 - 0.5


def receivers_axes(x, heading=0.0):
    axes, out = np.zeros((3, 3)), np.zeros((3, 3))
    enu_axes(*x, axes)
    level_antenna(axes, heading, out)
    return out


def test_it_is_the_phase_between_crossed_dipoles():
    """A right-handed wave is the phasor x - i y of the sender; so is what receives it.

    Aside of the boresight both are elliptical: their right-handed parts count. With z against
    the ray the receiver's second dipole is delayed like the sender's. The measured phase grows
    with the range, as the received phase falls.
    """
    tried = 0
    for seed in range(200):
        satellite, receiver = turned(seed), turned(seed + 1000)
        k = np.random.default_rng(seed + 2000).normal(size=3)
        k /= np.linalg.norm(k)
        # Where the dipoles see nothing of each other the angle is not defined: none is near.
        if satellite[2] @ k < 0.1 or receiver[2] @ k > -0.1:
            continue
        tried += 1
        across = np.cross(k, (0.6, 0.0, 0.8))
        across /= np.linalg.norm(across)
        right_handed = across - 1j * np.cross(k, across)
        sent = right_handed.conj() @ (satellite[0] - 1j * satellite[1])
        received = (receiver[0] - 1j * receiver[1]) @ right_handed * sent
        found = orientation_phase(satellite, receiver, *k)
        assert around(found + np.angle(received) / (2 * np.pi)) == pytest.approx(0.0, abs=1e-12)
    assert tried >= 10


def test_axes_of_a_level_antenna():
    x = np.array([3582105.0, 532590.0, 5232754.8])
    enu = np.zeros((3, 3))
    enu_axes(*x, enu)
    np.testing.assert_allclose(receivers_axes(x), [enu[1], -enu[0], enu[2]], atol=1e-15)
    east = receivers_axes(x, 0.5 * np.pi)
    np.testing.assert_allclose(east, [enu[0], enu[1], enu[2]], atol=1e-15)


def test_a_turn_of_the_receiver_is_a_cycle():
    """Clockwise by 360 deg: one cycle more, on every satellite."""
    x = np.array([3582105.0, 532590.0, 5232754.8])
    up = x / np.linalg.norm(x)
    for seed in range(4):
        offset = np.random.default_rng(seed).normal(size=3)
        k = -(up + 0.3 * offset / np.linalg.norm(offset))
        k /= np.linalg.norm(k)
        satellite = turned(seed)
        state = new_state(3)
        first = wind_up(satellite, receivers_axes(x), *k, state, 1)
        last = first
        for heading in np.radians(np.arange(0.0, 361.0, 15.0)):
            value = wind_up(satellite, receivers_axes(x, heading), *k, state, 1)
            assert abs(value - last) < 0.2
            last = value
        assert last == pytest.approx(first + 1.0, abs=1e-12)
        assert np.isnan(state[[0, 2]]).all()


def test_in_the_zenith_it_is_the_heading():
    """Sender straight above, its x to the north: the phase is the antenna's heading."""
    x = np.array([6378137.0, 0.0, 0.0])
    satellite = np.array([(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)])
    for heading in (-1.3, -0.2, 0.0, 0.7, 2.9):
        found = orientation_phase(satellite, receivers_axes(x, heading), -1.0, 0.0, 0.0)
        assert found == pytest.approx(heading / (2 * np.pi), abs=1e-12)


def test_a_turn_of_the_satellite_takes_it_back():
    """Its yaw by 360 deg about z, which looks down: the same turn seen from above the other way."""
    x = np.array([6378137.0, 0.0, 0.0])
    north, west = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])
    down = np.array([-1.0, 0.0, 0.0])
    state = new_state(1)
    values = []
    for angle in np.radians(np.arange(0.0, 361.0, 10.0)):
        first = np.cos(angle) * north + np.sin(angle) * np.cross(down, north)
        satellite = np.array([first, np.cross(down, first), down])
        values.append(wind_up(satellite, receivers_axes(x), *down, state, 0))
    assert abs(values[-1] - values[0]) == pytest.approx(1.0, abs=1e-12)
    assert west @ np.cross(down, north) == pytest.approx(-1.0)
    # From above, north over east: the sender turns clockwise, the receiver the other way by it.
    assert values[-1] - values[0] == pytest.approx(-1.0, abs=1e-12)


def test_carrying_on():
    assert carry_on(0.25, np.nan) == 0.25
    assert carry_on(-0.45, 3.48) == pytest.approx(3.55)
    assert carry_on(0.45, -2.48) == pytest.approx(-2.55)
    assert carry_on(0.1, 0.2) == 0.1


def test_a_pass_is_smooth():
    """Five hours of a satellite over a station that turns with the Earth: small steps."""
    x = np.array([3582105.0, 532590.0, 5232754.8])
    radius, rate, earth = 26_560_000.0, 2 * np.pi / 43082.0, 7.292115e-5
    sun = np.array([1.2e11, 0.6e11, 0.55e11])
    axes, state = np.zeros((3, 3)), new_state(1)
    values = []
    for t in np.arange(-9000.0, 9001.0, 30.0):
        # Inclined by 55 deg; ECEF is inertial turned back.
        u = rate * t + 1.0
        inertial = radius * np.array(
            [np.cos(u), np.sin(u) * np.cos(0.96), np.sin(u) * np.sin(0.96)]
        )
        c, s = np.cos(earth * t), np.sin(earth * t)
        turn = np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)])
        speed = radius * rate * np.array(
            [-np.sin(u), np.cos(u) * np.cos(0.96), np.cos(u) * np.sin(0.96)]
        )  # fmt: skip
        r = turn @ inertial
        v = turn @ speed - np.cross([0.0, 0.0, earth], r)
        satellite_axes(NOMINAL, r, v, turn @ sun, axes)
        k = (x - r) / np.linalg.norm(x - r)
        values.append(wind_up(axes, receivers_axes(x), *k, state, 0))
    assert np.max(np.abs(np.diff(values))) < 0.01
    assert np.ptp(values) > 0.05
