"""Aircraft and walkers move as they say, and what is sensed is derived from that exactly."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from replay.errors import ConfigurationError
from replay.kernels.earth import EARTH_RATE_RAD_S, gravity
from replay.simulate.motion import move
from replay.simulate.scenario import read_scenario
from replay.simulate.trajectory import Trajectory

DEG = math.pi / 180.0
PLACE = {"latitude": "35.2 deg", "longitude": "128.7 deg", "height": "700 m", "heading": "40 deg"}
LINES = [
    {"kind": "straight", "duration": 3.0},
    {"kind": "attitude", "pitch": "3 deg", "roll": "-4 deg", "yaw": "2 deg", "duration": 2.0},
    {"kind": "climb", "height": "30 m", "rate": "3 m/s"},
    {"kind": "attitude", "duration": 2.0},
    {"kind": "turn", "angle": "90 deg", "bank": "25 deg", "ramp": 3.0},
    {"kind": "straight", "duration": 3.0},
]
STEPS = [
    {"kind": "hold", "duration": 2.0},
    {"kind": "speed", "to": 1.4, "acceleration": 1.0},
    {"kind": "straight", "duration": 30.0},
    {"kind": "turn", "angle": "90 deg", "radius": "2 m"},
    {"kind": "attitude", "yaw": "-30 deg", "duration": 1.0},
    {"kind": "straight", "duration": 5.0},
    {"kind": "stop", "duration": 2.0, "acceleration": 1.0},
]


def fly(segments: list[dict[str, Any]], *, rate: float = 100.0, **sections: Any) -> Trajectory:
    table = {
        "start": {**PLACE, "speed": 55.0},
        "vehicle": {"kind": "air"},
        "imu": {"rate": rate},
        "segments": segments,
        **sections,
    }
    return move(read_scenario(table)).trajectory


def walk(segments: list[dict[str, Any]], *, rate: float = 100.0, **gait: Any) -> Trajectory:
    return fly(segments, rate=rate, start=PLACE, vehicle={"kind": "foot"}, gait=gait)


def poses(trajectory: Trajectory) -> np.ndarray[Any, Any]:
    return trajectory.poses(np.arange(len(trajectory.positions)) * trajectory.interval_s)


def heights(trajectory: Trajectory) -> np.ndarray[Any, Any]:
    return np.asarray(pymap3d.ecef2geodetic(*trajectory.positions.T)[2])


@pytest.mark.parametrize("moved", [fly(LINES, rate=400.0), walk(STEPS, rate=400.0)])
def test_forces_and_rates_are_derivatives_of_the_motion(moved):
    at = poses(moved)
    h = moved.interval_s
    # Differences over one sample on either side of its middle, of second order in h.
    middle = (np.arange(len(moved.forces)) + 0.5) * h
    half = 0.25 * h
    change = (moved.poses(middle + half)["v"] - moved.poses(middle - half)["v"]) / (2.0 * half)
    pose = moved.poses(middle)
    down = np.array([gravity(*r) for r in pose["r"]])
    coriolis = np.cross([0.0, 0.0, 2.0 * EARTH_RATE_RAD_S], pose["v"])
    force = np.einsum("nji,nj->ni", pose["C"], change - down + coriolis)
    np.testing.assert_allclose(moved.forces, force, atol=5e-4)
    body = Rotation.from_matrix(at["C"])
    step = (body[:-1].inv() * body[1:]).as_rotvec() / h
    earth = Rotation.from_matrix(pose["C"]).inv().apply([0.0, 0.0, EARTH_RATE_RAD_S])
    np.testing.assert_allclose(moved.rates, step + earth, atol=2e-6)
    speed = np.diff(at["r"], axis=0) / h
    np.testing.assert_allclose(pose["v"], speed, atol=2e-5)


def test_a_banked_turn_is_coordinated():
    moved = fly([{"kind": "turn", "angle": "180 deg", "bank": "25 deg", "ramp": 4.0}])
    at = poses(moved)
    assert at["attitude"][:, 0].max() == pytest.approx(25.0 * DEG, rel=1e-9)
    # To the right: the right wing is down, and heading grows.
    assert at["attitude"][-1, 2] == pytest.approx(220.0 * DEG, abs=1e-6)
    radius = 55.0**2 / (9.80665 * math.tan(25.0 * DEG))
    assert at["w_eb"][len(at) // 2, 1:] @ [math.sin(25 * DEG), math.cos(25 * DEG)] == pytest.approx(
        55.0 / radius, rel=1e-3
    )
    # No side force but Coriolis (2 w v = 8 mm/s^2) and what gravity is off its standard.
    assert np.abs(moved.forces[:, 1]).max() < 0.02
    steady = len(moved.forces) // 2
    assert -moved.forces[steady, 2] == pytest.approx(9.80665 / math.cos(25.0 * DEG), rel=2e-3)


@pytest.mark.parametrize(
    "how", [{"rate": "3 m/s"}, {"angle": "4 deg"}, {"angle": "8 deg", "ramp": "2 s"}]
)
@pytest.mark.parametrize("height", [60.0, -45.0])
def test_a_climb_gains_its_height_and_ends_level(how, height):
    moved = fly([{"kind": "climb", "height": height, **how}, {"kind": "straight", "duration": 2.0}])
    up = heights(moved)
    assert up[-1] - up[0] == pytest.approx(height, abs=1e-4)
    at = poses(moved)
    assert abs(at["v_enu"][-1, 2]) < 1e-12
    np.testing.assert_allclose(np.linalg.norm(at["v_enu"], axis=1), 55.0, rtol=1e-12)
    steepest = math.asin(3.0 / 55.0) if "rate" in how else float(how["angle"].split()[0]) * DEG
    largest = at["v_enu"][np.argmax(np.abs(at["v_enu"][:, 2])), 2]
    assert largest == pytest.approx(math.copysign(55.0 * math.sin(steepest), height), rel=1e-9)
    assert at["attitude"][:, 1].max() <= steepest + 1e-12


def test_attitude_turns_the_body_and_leaves_the_path():
    level = fly([{"kind": "straight", "duration": 8.0}])
    turned = fly(
        [
            {"kind": "straight", "duration": 1.0},
            {"kind": "attitude", "roll": "5 deg", "pitch": "-2 deg", "yaw": "3 deg", "duration": 2},
            {"kind": "straight", "duration": 1.0},
            {"kind": "attitude", "roll": "5 deg", "duration": 2},
            {"kind": "straight", "duration": 2.0},
        ]
    )
    np.testing.assert_allclose(turned.positions, level.positions, rtol=0.0, atol=1e-6)
    held, end = turned.poses(np.array([3.5, 7.5]))["attitude"]
    np.testing.assert_allclose(held, np.array([5.0, -2.0, 43.0]) * DEG, atol=1e-12)
    np.testing.assert_allclose(end, np.array([5.0, 0.0, 40.0]) * DEG, atol=1e-12)


def test_steps_have_their_size_and_their_cadence_and_cease_with_the_walk():
    moved = walk(STEPS, cadence="2 Hz", bounce="2 cm", sway="3 cm", yaw=0.05, speed="1.4 m/s")
    times = np.arange(500, 3000) * 0.01
    up = heights(moved)
    steady = up[500:3000]
    assert np.ptp(steady) == pytest.approx(0.04, rel=2e-3)
    spectrum = np.abs(np.fft.rfft(steady - steady.mean()))
    assert np.fft.rfftfreq(len(steady), 0.01)[spectrum.argmax()] == pytest.approx(2.0, abs=0.05)
    # Sideways and heading at half of it, about the course.
    at = moved.poses(times)
    right = at["v_enu"][:, 0] * math.cos(40 * DEG) - at["v_enu"][:, 1] * math.sin(40 * DEG)
    assert right.max() == pytest.approx(0.03 * 2.0 * math.pi, rel=1e-3)
    heading = at["attitude"][:, 2] - 40.0 * DEG
    assert heading.max() == pytest.approx(0.05, rel=1e-3)
    assert np.count_nonzero(np.diff(heading > 1e-6)) == pytest.approx(50, abs=1)
    assert abs(up[-1] - up[0]) < 1e-3
    assert moved.speeds()[-100:].max() < 1e-9
    assert np.ptp(moved.rates[-50:], axis=0).max() == 0.0


def test_a_stop_brakes_and_stands():
    moved = fly([{"kind": "stop", "acceleration": 5.0, "duration": 4.0}], start=PLACE)
    assert len(moved.rates) == 400
    rolling = fly([{"kind": "stop", "acceleration": 5.0, "ramp": 1.0, "duration": 4.0}])
    assert len(rolling.rates) == pytest.approx(100.0 * (55.0 / 5.0 + 1.0 + 4.0), abs=1)
    assert rolling.speeds()[-399:].max() < 1e-9


@pytest.mark.parametrize(
    ("segments", "word"),
    [
        ([{"kind": "climb", "height": 50.0}], "an angle or a rate"),
        ([{"kind": "climb", "height": 1.0, "angle": "8 deg"}], "bending the path"),
        ([{"kind": "climb", "height": 50.0, "rate": 60.0}], "climbs at"),
        ([{"kind": "climb", "height": 50.0, "angle": 8.0}], "angle is 458"),
        (
            [
                {"kind": "slope", "to": 0.1, "duration": 5.0},
                {"kind": "climb", "height": 50.0, "rate": 2.0},
            ],
            "level flight",
        ),
        ([{"kind": "attitude", "roll": 5.0, "duration": 1.0}], "roll is 286"),
        ([{"kind": "turn", "angle": 1.0, "bank": 25.0}], "bank is"),
        ([{"kind": "turn", "angle": 1.0, "bank": 0.3, "radius": 50.0}], "one of the three"),
    ],
)
def test_what_cannot_be_flown_is_refused(segments, word):
    with pytest.raises(ConfigurationError) as caught:
        fly(segments)
    assert word in f"{caught.value.what} {caught.value.mend}"
    assert caught.value.mend


@pytest.mark.parametrize(
    ("sections", "word"),
    [
        ({"vehicle": {"kind": "boat"}}, "vehicle.kind"),
        ({"gait": {"cadence": 0.0}}, "gait.cadence"),
        ({"gait": {"surge": "20 cm"}}, "gait.surge"),
        ({"start": {"speed": -1.0}}, "start.speed"),
    ],
)
def test_impossible_settings_are_refused(sections, word):
    with pytest.raises(ConfigurationError, match=word):
        read_scenario({"segments": LINES, **sections})
