"""The motion obeys its own derivatives, and mechanising perfect samples gives it back."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numba import njit
from scipy.spatial.transform import Rotation

from replay.errors import ConfigurationError
from replay.kernels.earth import EARTH_RATE_RAD_S, gravity
from replay.kernels.rotation import matrix_from_quaternion, quaternion_from_matrix
from replay.kernels.strapdown import NAVIGATION_DTYPE, mechanize
from replay.simulate.planning import plan
from replay.simulate.segments import read_segments
from replay.simulate.trajectory import Trajectory, ecef_of, make_body

DEG = math.pi / 180.0
ARCSECOND = DEG / 3600.0
CM = 1e-2
UM = 1e-6

TOWN = [
    {"kind": "hold", "duration": 5.0},
    {"kind": "speed", "to": 15.0, "acceleration": 2.0},
    {"kind": "turn", "angle": "90 deg", "radius": 40.0},
    {"kind": "slope", "to": "5 %", "duration": 4.0},
    {"kind": "straight", "duration": 4.0},
    {"kind": "lane_change", "offset": 3.0, "duration": 5.0},
    {"kind": "slope", "to": "0 %", "duration": 4.0},
    {"kind": "turn", "angle": "-70 deg", "duration": 6.0},
    {"kind": "speed", "to": 0.0, "acceleration": 2.5},
]
LEAN = np.array([5.0, 2.0]) * DEG / 9.80665
BODY = make_body(roll_per_lateral=LEAN[0], pitch_per_forward=LEAN[1])


def drive(
    segments: list[dict[str, Any]], *, rate: int = 100, repeat: int = 1, heading: float = 0.4
) -> tuple[Trajectory, float]:
    pieces, duration = plan(read_segments(segments), heading, repeat)
    start = ecef_of(52.0 * DEG, 4.4 * DEG, 44.0)
    return Trajectory.drive(pieces, BODY, start, 1.0 / rate, int(duration * rate)), duration


@njit
def run_mechanization(nav, w, f, dt, scratch):
    n = nav[0]
    for k in range(w.shape[0]):
        mechanize(
            n, w[k, 0] * dt, w[k, 1] * dt, w[k, 2] * dt, f[k, 0] * dt, f[k, 1] * dt, f[k, 2] * dt,
            dt, scratch,
        )  # fmt: skip


def closure(rate: int, seconds: float) -> tuple[float, float]:
    """Position (m) and attitude (rad) that mechanising perfect samples is off at the end."""
    trajectory, _ = drive(TOWN, rate=rate, repeat=math.ceil(seconds / drive(TOWN)[1]))
    samples = int(seconds * rate)
    ends = trajectory.poses(np.array([0.0, samples / rate]))
    nav = np.zeros(1, dtype=NAVIGATION_DTYPE)
    nav["r"], nav["v"] = ends["r"][0], ends["v"][0]
    quaternion_from_matrix(ends["C"][0], nav["q"][0])
    matrix_from_quaternion(nav["q"][0], nav["C"][0])
    run_mechanization(
        nav, trajectory.rates[:samples], trajectory.forces[:samples], 1.0 / rate, np.zeros((2, 4))
    )
    turned = Rotation.from_matrix(nav["C"][0] @ ends["C"][1].T).magnitude()
    return float(np.linalg.norm(nav["r"][0] - ends["r"][1])), float(turned)


def test_mechanising_perfect_samples_gives_the_motion_back():
    position, attitude = closure(200, 600.0)
    # What is left is the truncation of `mechanize`, of second order in the interval.
    assert position < 5.0 * CM
    assert attitude < 0.01 * ARCSECOND


def test_what_is_left_of_the_closure_shrinks_with_the_interval():
    coarse, fine = closure(100, 120.0)[0], closure(400, 120.0)[0]
    assert fine < coarse / 8.0


def test_velocity_is_the_derivative_of_position():
    trajectory, duration = drive(TOWN)
    times = np.linspace(1.0, duration - 1.0, 500)
    h = 1e-2
    before, after = trajectory.poses(times - h), trajectory.poses(times + h)
    numeric = (after["r"] - before["r"]) / (2.0 * h)
    np.testing.assert_allclose(trajectory.poses(times)["v"], numeric, atol=2e-4)


def test_local_velocity_is_that_of_ecef():
    trajectory, duration = drive(TOWN)
    poses = trajectory.poses(np.linspace(0.0, duration - 0.1, 200))
    np.testing.assert_allclose(
        np.linalg.norm(poses["v"], axis=1), np.linalg.norm(poses["v_enu"], axis=1), atol=1e-12
    )


def test_attitude_turns_as_the_gyros_say():
    trajectory, _ = drive(TOWN)
    count = len(trajectory.rates)
    poses = trajectory.poses(np.arange(count + 1) * trajectory.interval_s)
    body = Rotation.from_matrix(poses["C"])
    step = (body[:-1].inv() * body[1:]).as_rotvec() / trajectory.interval_s
    earth = body[:-1].inv().apply([0.0, 0.0, EARTH_RATE_RAD_S])
    np.testing.assert_allclose(trajectory.rates, step + earth, atol=1e-5)
    middle = 0.5 * (poses["w_eb"][:-1] + poses["w_eb"][1:])
    np.testing.assert_allclose(middle, step, atol=1e-4)


def test_specific_force_is_acceleration_less_gravity():
    trajectory, _ = drive(TOWN, rate=400)
    times = (np.arange(800, len(trajectory.forces) - 1, 97) + 0.5) * trajectory.interval_s
    h = 4e-3
    pose = trajectory.poses(times)
    change = (trajectory.poses(times + h)["v"] - trajectory.poses(times - h)["v"]) / (2.0 * h)
    down = np.array([gravity(*r) for r in pose["r"]])
    coriolis = np.cross([0.0, 0.0, 2.0 * EARTH_RATE_RAD_S], pose["v"])
    force = np.einsum("nji,nj->ni", pose["C"], change - down + coriolis)
    rows = np.rint(times / trajectory.interval_s - 0.5).astype(int)
    np.testing.assert_allclose(trajectory.forces[rows], force, atol=2e-4)


def test_at_rest_only_gravity_and_the_earth_are_sensed():
    trajectory, _ = drive([{"kind": "hold", "duration": 2.0}])
    sensed = np.linalg.norm(trajectory.rates, axis=1)
    np.testing.assert_allclose(sensed, EARTH_RATE_RAD_S, rtol=1e-12)
    g = np.linalg.norm(gravity(*trajectory.positions[0]))
    np.testing.assert_allclose(np.linalg.norm(trajectory.forces, axis=1), g, rtol=1e-12)
    assert np.abs(trajectory.positions - trajectory.positions[0]).max() < UM


def test_poses_between_samples_do_not_depend_on_the_sample_rate():
    coarse, duration = drive(TOWN, rate=20)
    fine, _ = drive(TOWN, rate=200)
    times = np.linspace(0.0, duration - 0.2, 333)
    np.testing.assert_allclose(coarse.poses(times)["r"], fine.poses(times)["r"], atol=UM)


def test_a_turn_has_its_angle_its_radius_and_its_lean():
    trajectory, duration = drive(
        [
            {"kind": "speed", "to": 10.0},
            {"kind": "turn", "angle": "-120 deg", "radius": 50.0, "ramp": 1.0},
            {"kind": "straight", "duration": 2.0},
        ],
        heading=1.0,
    )
    poses = trajectory.poses(np.arange(0.0, duration, 0.01))
    assert poses["attitude"][-1, 2] == pytest.approx((1.0 - 120.0 * DEG) % (2.0 * math.pi))
    assert poses["w_eb"][:, 2].min() == pytest.approx(-10.0 / 50.0, rel=5e-3)
    # The body rolls to the right, out of a turn to the left.
    assert poses["attitude"][:, 0].max() == pytest.approx(LEAN[0] * 10.0**2 / 50.0, rel=5e-3)


def test_speed_slope_and_lane_change_end_where_they_say():
    trajectory, duration = drive(
        [
            {"kind": "speed", "to": "50 km/h", "acceleration": 2.0},
            {"kind": "slope", "to": "5 %", "duration": 3.0},
            {"kind": "straight", "duration": 2.0},
        ]
    )
    end = trajectory.poses(np.array([duration - 0.01]))
    v = end["v_enu"][0]
    assert np.linalg.norm(v) == pytest.approx(50.0 / 3.6, rel=1e-12)
    assert v[2] / math.hypot(v[0], v[1]) == pytest.approx(0.05, rel=1e-9)

    sideways, duration = drive(
        [
            {"kind": "speed", "to": 12.0},
            {"kind": "lane_change", "offset": 3.5, "duration": 6.0},
            {"kind": "straight", "duration": 1.0},
        ],
        heading=0.0,
    )
    ends = sideways.poses(np.array([0.0, duration - 0.01]))
    east = np.array([-math.sin(4.4 * DEG), math.cos(4.4 * DEG), 0.0])
    assert (ends["r"][1] - ends["r"][0]) @ east == pytest.approx(3.5, rel=0.02)
    assert math.sin(ends["attitude"][1, 2]) == pytest.approx(0.0, abs=1e-5)


def test_speed_is_exactly_nought_after_braking():
    trajectory, _ = drive([*TOWN, {"kind": "hold", "duration": 3.0}], repeat=3)
    assert trajectory.speeds()[-200:].max() < 1e-6


@pytest.mark.parametrize(
    ("segments", "word"),
    [
        ([{"kind": "turn", "angle": 1.0, "radius": 20.0}], "rest"),
        ([{"kind": "lane_change", "offset": 1.0, "duration": 3.0}], "rest"),
        ([{"kind": "speed", "to": 5.0}, {"kind": "hold", "duration": 1.0}], "5 m/s"),
        ([{"kind": "speed", "to": 5.0}, {"kind": "turn", "angle": 1.0}], "radius or a duration"),
        ([{"kind": "speed", "to": -5.0}], "reverse"),
        ([{"kind": "straight", "duration": 0.0}], "duration is 0"),
        (
            [{"kind": "speed", "to": 5.0}, {"kind": "lane_change", "offset": 9.0, "duration": 2.0}],
            "swing",
        ),
    ],
)
def test_what_cannot_be_driven_is_refused(segments, word):
    with pytest.raises(ConfigurationError, match=word) as caught:
        plan(read_segments(segments), 0.0, 1)
    assert caught.value.where.startswith(f"segments[{len(segments) - 1}]")
    assert caught.value.mend
