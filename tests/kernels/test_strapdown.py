import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from replay.kernels import earth, rotation
from replay.kernels.strapdown import NAVIGATION_DTYPE, mechanize

MILLIMETRE = 1e-3
ARCSECOND = np.pi / 180 / 3600


def start(latitude=40.0, longitude=-105.0, height=1600.0, roll=0.0, pitch=0.0, heading=0.0):
    nav = np.zeros(1, dtype=NAVIGATION_DTYPE)[0]
    nav["r"] = pymap3d.geodetic2ecef(latitude, longitude, height)
    axes, C_b_n = np.zeros((3, 3)), np.zeros((3, 3))
    earth.enu_axes(*nav["r"], axes)
    C_n_e = np.array([axes[1], axes[0], -axes[2]]).T
    rotation.matrix_from_euler(roll, pitch, heading, C_b_n)
    nav["C"] = C_n_e @ C_b_n
    rotation.quaternion_from_matrix(np.ascontiguousarray(nav["C"]), nav["q"])
    rotation.matrix_from_quaternion(nav["q"], nav["C"])
    return nav


def at_rest(nav):
    """Rate and specific force that sensors at rest on the Earth feel."""
    C = nav["C"]
    rate = C.T @ [0.0, 0.0, earth.EARTH_RATE_RAD_S]
    force = -C.T @ np.array(earth.gravity(*nav["r"]))
    return rate, force


def test_what_rests_on_the_earth_stays_there_for_an_hour():
    nav = start(roll=0.1, pitch=-0.2, heading=1.0)
    before, attitude = nav["r"].copy(), nav["C"].copy()
    rate, force = at_rest(nav)
    scratch = np.zeros((2, 4))
    dt = 0.01
    for _ in range(60 * 60 * 100):
        mechanize(nav, *(rate * dt), *(force * dt), dt, scratch)
    assert np.linalg.norm(nav["r"] - before) < MILLIMETRE
    turned = Rotation.from_matrix(nav["C"] @ attitude.T).magnitude()
    assert turned < 1e-3 * ARCSECOND


def test_constant_acceleration_follows_the_parabola():
    nav = start()
    before = nav["r"].copy()
    scratch = np.zeros((2, 4))
    dt, steps, push = 0.005, 2000, 2.0
    forward = nav["C"][:, 0].copy()
    for _ in range(steps):
        rate, _ = at_rest(nav)
        # Force that cancels gravity and Coriolis, and pushes forward: a straight line in ECEF.
        gravity = np.array(earth.gravity(*nav["r"]))
        coriolis = 2 * np.cross([0.0, 0.0, earth.EARTH_RATE_RAD_S], nav["v"])
        half = nav["v"] + 0.5 * dt * push * forward
        coriolis = 2 * np.cross([0.0, 0.0, earth.EARTH_RATE_RAD_S], half)
        force = nav["C"].T @ (push * forward - gravity + coriolis)
        mechanize(nav, *(rate * dt), *(force * dt), dt, scratch)
    t = dt * steps
    np.testing.assert_allclose(nav["v"], push * t * forward, atol=1e-4)
    # Gravity is held over each step in the inputs here: centimetres in a hundred metres.
    np.testing.assert_allclose(nav["r"] - before, 0.5 * push * t * t * forward, atol=2e-3)


def coning(count_per_turn: int, turns: int) -> float:
    """Attitude error after classical coning, rad: the axis of rotation itself goes round."""
    cone, rate = 0.05, 2 * np.pi * 5.0
    dt = 1.0 / (5.0 * count_per_turn)

    def attitude(t):
        return Rotation.from_rotvec(np.array([0.0, np.cos(rate * t), np.sin(rate * t)]) * cone)

    nav = start()
    # Free of the Earth: measure against the same motion composed with the Earth's turning.
    q0 = Rotation.from_matrix(nav["C"]) * attitude(0.0)
    base = Rotation.from_matrix(nav["C"])
    rotation.quaternion_from_matrix(q0.as_matrix(), nav["q"])
    rotation.matrix_from_quaternion(nav["q"], nav["C"])
    scratch = np.zeros((2, 4))
    fine = 64
    for step in range(turns * count_per_turn):
        t0 = step * dt
        total = np.zeros(3)
        for k in range(fine):
            a = attitude(t0 + dt * k / fine)
            b = attitude(t0 + dt * (k + 1) / fine)
            total += (a.inv() * b).as_rotvec()
        spin = nav["C"].T @ [0.0, 0.0, earth.EARTH_RATE_RAD_S]
        theta = total + spin * dt
        mechanize(nav, *theta, 0.0, 0.0, 0.0, dt, scratch)
    end = base * attitude(turns * count_per_turn * dt)
    return (end.inv() * Rotation.from_matrix(nav["C"])).magnitude()


def test_coning_is_compensated():
    # Without compensation the drift is cone^2 rate / 2 per second: 39 mrad/s here.
    uncompensated = 0.5 * 0.05**2 * 2 * np.pi * 5.0 * 2.0
    assert coning(40, 10) < 2e-3 * uncompensated
    # Fourth order: half the interval, at least eight times less error.
    assert coning(20, 10) / coning(40, 10) > 8.0


def test_splitting_an_interval_changes_next_to_nothing():
    rng = np.random.default_rng(5)
    rate, force = rng.normal(0, 0.5, (200, 3)), rng.normal(0, 3, (200, 3)) + [0, 0, -9.8]
    whole, split = start(), start()
    scratch = np.zeros((2, 4))
    for w, f in zip(rate, force, strict=True):
        mechanize(whole, *(w * 0.01), *(f * 0.01), 0.01, scratch)
        for part in (0.003, 0.007):
            mechanize(split, *(w * part), *(f * part), part, scratch)
    assert np.linalg.norm(whole["r"] - split["r"]) < 2e-3
    assert Rotation.from_matrix(whole["C"] @ split["C"].T).magnitude() < 2e-3


@pytest.mark.parametrize("ratio", [0.5, 1.0, 3.0])
def test_linear_rate_and_force_are_exact_to_third_order(ratio):
    """Coning and sculling with unequal intervals, against fine integration."""
    a, b = np.array([0.3, -0.2, 0.4]), np.array([2.0, 3.0, -1.0])
    c, d = np.array([1.0, 2.0, -9.0]), np.array([20.0, -30.0, 10.0])
    second = 0.01
    first = second * ratio

    def increments(begin, end):
        return (
            a * (end - begin) + 0.5 * b * (end**2 - begin**2),
            c * (end - begin) + 0.5 * d * (end**2 - begin**2),
        )

    scratch = np.zeros((2, 4))
    coarse = start()
    fine = start()
    for begin, end in [(-first, 0.0), (0.0, second)]:
        theta, velocity = increments(begin, end)
        mechanize(coarse, *theta, *velocity, end - begin, scratch)
    for k in range(400):
        begin = -first + (first + second) * k / 400
        end = -first + (first + second) * (k + 1) / 400
        theta, velocity = increments(begin, end)
        mechanize(fine, *theta, *velocity, end - begin, scratch)
    # The first interval has none before it; its own error is that of no compensation.
    bound = np.linalg.norm(np.cross(a, b)) * first**3 / 12
    assert Rotation.from_matrix(coarse["C"] @ fine["C"].T).magnitude() < bound + 3e-8
    push = np.linalg.norm(np.cross(a, d) + np.cross(c, b)) * first**3 / 12
    assert np.linalg.norm(coarse["v"] - fine["v"]) < push + 3e-6
