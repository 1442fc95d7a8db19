"""The filter's errors are as large as it says, over drives whose errors are known."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from replay import channels
from replay.log.columns import Columns
from tests.engine.drives import (
    FIX,
    IMU,
    SECOND,
    StageRun,
    between,
    short_config,
    short_scenario,
)

SEEDS = tuple(range(101, 113))
SETTLED_S = 60.0
TRUTH = channels.TRUTH.topic

# A drive that the filter's model describes exactly: white GNSS noise, white inertial noise
# with biases drawn once, a vehicle that does not lean.
MODEL: dict[str, Any] = {
    "vehicle": {"roll_per_g": 0.0, "pitch_per_g": 0.0},
    "imu": {
        "rate": 100.0,
        "grade": "perfect",
        "errors": {
            "gyro_noise": "0.3 deg/sqrt(h)",
            "accel_noise": "0.04 m/s/sqrt(h)",
            "gyro_bias": "0.05 deg/s",
            "accel_bias": "2 mg",
        },
    },
    "gnss": {
        "grade": "perfect",
        "rate": 4.0,
        "outages": [],
        "lever_arm": [-0.4, 0.15, -1.2],
        "errors": {
            "horizontal_noise": 0.02,
            "vertical_noise": 0.04,
            "horizontal_velocity_noise": 0.03,
            "vertical_velocity_noise": 0.05,
        },
    },
    "truth": {"rate": 20.0},
    "segments": [
        {"kind": "hold", "duration": 9.0},
        {"kind": "speed", "to": 12.0, "acceleration": 2.0},
        {"kind": "straight", "duration": 8.0},
        {"kind": "turn", "angle": "90 deg", "radius": 25.0},
        {"kind": "speed", "to": 5.0},
        {"kind": "turn", "angle": "-120 deg", "radius": 20.0},
        {"kind": "speed", "to": 15.0},
        {"kind": "straight", "duration": 10.0},
        {"kind": "turn", "angle": "80 deg", "radius": 30.0},
        {"kind": "speed", "to": 0.0, "acceleration": 2.0},
        {"kind": "hold", "duration": 5.0},
        {"kind": "speed", "to": 12.0},
        {"kind": "turn", "angle": "-90 deg", "radius": 25.0},
        {"kind": "straight", "duration": 12.0},
        {"kind": "turn", "angle": "60 deg", "radius": 25.0},
        {"kind": "straight", "duration": 8.0},
    ],
}
# GNSS and inertial sensors alone, each with the noise that it was made with.
PLAIN: dict[str, Any] = {
    "gnss": {"position_floor": 0.0, "velocity_floor": 0.0},
    "stops": {"zero_velocity": False, "zero_rate": False},
    "non_holonomic": {"enabled": False},
}


@functools.cache
def drive(seed: int) -> dict[str, Columns]:
    from replay.simulate import make_channels, read_scenario

    return make_channels(read_scenario(short_scenario(**MODEL, seed=seed)))


def run_over(rows: Mapping[str, Columns], *tables: Mapping[str, Any]) -> StageRun:
    return StageRun(rows, short_config(PLAIN, *tables, scenario=short_scenario(**MODEL)))


@functools.cache
def plain_run(seed: int) -> StageRun:
    return run_over(drive(seed))


@dataclasses.dataclass(frozen=True)
class Errors:
    """Truth minus estimate at the filter's epochs, ECEF, with its covariance."""

    elapsed_s: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    attitude: np.ndarray
    body: Rotation  # body to ECEF, true
    covariance: np.ndarray

    def normalized(self, name: str) -> np.ndarray:
        """Squared error in units of the covariance, of each epoch."""
        first = {"position": 0, "velocity": 3, "attitude": 6}[name]
        block = self.covariance[:, first : first + 3, first : first + 3]
        error = getattr(self, name)
        solved = np.linalg.solve(block, error[..., None])[..., 0]
        return np.asarray(np.einsum("ni,ni->n", error, solved))


def true_body(truth: Columns) -> tuple[np.ndarray, Rotation]:
    """Velocity in ECEF and attitude body to ECEF, by libraries that others wrote."""
    r = truth["position_ecef_m"]
    lat, lon, _ = pymap3d.ecef2geodetic(*r.T)
    v = np.column_stack(pymap3d.enu2uvw(*truth["velocity_enu_m_s"].T, lat, lon))
    axes = [
        np.column_stack(pymap3d.enu2uvw(*unit, lat, lon))
        for unit in ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0))
    ]
    ned_to_ecef = Rotation.from_matrix(np.stack(axes, axis=2))
    body_to_ned = Rotation.from_euler("ZYX", truth["attitude_rad"][:, ::-1])
    return v, ned_to_ecef * body_to_ned


def errors_of(made: StageRun, rows: Mapping[str, Columns]) -> Errors:
    truth, states = rows[TRUTH], made.states
    times, theirs, mine = np.intersect1d(
        truth.valid_time_ns, states.valid_time_ns, return_indices=True
    )
    at = truth.take(theirs)
    v, body = true_body(at)
    q = states["q_body_to_ecef"][mine]
    assert np.allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-12)
    estimate = Rotation.from_quat(q, scalar_first=True)
    return Errors(
        (times - rows[IMU].valid_time_ns[0]) / SECOND,
        at["position_ecef_m"] - states["position_ecef_m"][mine],
        v - states["velocity_ecef_m_s"][mine],
        (body * estimate.inv()).as_rotvec(),
        body,
        made.covariances[mine],
    )


def settled_means(name: str, *tables: Mapping[str, Any]) -> np.ndarray:
    """Mean over the settled part of each drive of the squared normalised error."""
    found = []
    for seed in SEEDS:
        rows = drive(seed)
        made = run_over(rows, *tables) if tables else plain_run(seed)
        errors = errors_of(made, rows)
        found.append(float(errors.normalized(name)[errors.elapsed_s > SETTLED_S].mean()))
    return np.array(found)


def limits(count: int, freedom: int) -> tuple[float, float]:
    """Where the mean of `count` independent chi-squares lies, but for one in a thousand.

    Errors of one drive hang together in time, so a drive counts as one sample: the
    true limits are narrower.
    """
    total = count * freedom
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], total) / count
    return float(low), float(high)


@pytest.mark.parametrize("name", ["position", "velocity", "attitude"])
def test_errors_are_as_large_as_stated(name: str) -> None:
    low, high = limits(len(SEEDS), 3)
    assert low < settled_means(name).mean() < high


def test_innovations_are_as_large_as_stated() -> None:
    """Innovations are white, so every one counts: the limits are narrow."""
    for kind in (1, 2):
        values = []
        for seed in SEEDS:
            rows = plain_run(seed).outputs["FILTER_INNOVATIONS"]
            late = rows.valid_time_ns > rows.valid_time_ns[0] + 30 * SECOND
            values.append(rows["normalized"][(rows["kind"] == kind) & late])
        z = np.concatenate(values)
        assert len(z) > 8000
        assert np.mean(z * z) == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / len(z)) + 0.02)
        assert abs(np.mean(z)) < 4.0 / math.sqrt(len(z))
        lag = np.mean(z[:-3] * z[3:])
        assert abs(lag) < 4.0 / math.sqrt(len(z)) + 0.01


@pytest.mark.parametrize(
    ("name", "table"),
    [
        ("attitude", {"filter": {"gyro_noise": "0.003 deg/sqrt(h)"}}),
        ("velocity", {"gnss": {"velocity_scale": 0.2}}),
        ("position", {"gnss": {"position_scale": 0.2, "position_gate": 0.0}}),
    ],
)
def test_a_filter_that_is_too_sure_is_found_out(name: str, table: Mapping[str, Any]) -> None:
    """The figures above can fail."""
    assert settled_means(name, table).mean() > limits(len(SEEDS), 3)[1]


def test_a_filter_that_is_too_modest_is_found_out() -> None:
    assert (
        settled_means("position", {"gnss": {"position_scale": 5.0}}).mean()
        < limits(len(SEEDS), 3)[0]
    )


def test_stops_and_wheels_keep_the_filter_honest() -> None:
    """Constraints that hold exactly: errors no larger than stated, and attitude better."""
    table = {
        "stops": {"zero_velocity": True, "zero_rate": True},
        "non_holonomic": {"enabled": True},
    }
    for name in ("position", "velocity", "attitude"):
        assert settled_means(name, table).mean() < limits(len(SEEDS), 3)[1], name
    seed = SEEDS[0]
    helped = errors_of(run_over(drive(seed), table), drive(seed)).covariance[-1]
    alone = errors_of(plain_run(seed), drive(seed)).covariance[-1]
    assert np.trace(helped[6:9, 6:9]) < np.trace(alone[6:9, 6:9])


def test_wrong_lever_arm_shows() -> None:
    """30 cm too far forward: the position is off by that much, backward, and it is noticed."""
    seed = SEEDS[0]
    rows = drive(seed)
    levers = rows[FIX]["antenna_lever_arm_body_m"] + np.array([0.3, 0.0, 0.0])
    values = {**rows[FIX].values, "antenna_lever_arm_body_m": levers}
    wrong = {**rows, FIX: dataclasses.replace(rows[FIX], values=values)}
    made = run_over(wrong, {"gnss": {"position_gate": 0.0, "velocity_gate": 0.0}})
    errors = errors_of(made, rows)
    late = errors.elapsed_s > SETTLED_S
    in_body = errors.body.inv().apply(errors.position)[late]
    assert np.median(in_body[:, 0]) == pytest.approx(0.3, abs=0.1)
    assert abs(np.median(in_body[:, 1])) < 0.1
    assert errors.normalized("position")[late].mean() > 10.0 * limits(1, 3)[1]
    right = errors_of(plain_run(seed), rows)
    assert np.abs(right.body.inv().apply(right.position)[late]).max() < 0.1


def test_velocity_at_the_antenna_needs_the_lever_arm() -> None:
    """Without positions to say so, turning moves the antenna: the velocity tells."""
    rows = drive(SEEDS[0])
    levers = rows[FIX]["antenna_lever_arm_body_m"] + np.array([2.0, 0.0, 0.0])
    values = {**rows[FIX].values, "antenna_lever_arm_body_m": levers}
    wrong = {**rows, FIX: dataclasses.replace(rows[FIX], values=values)}
    figures = []
    for each in (rows, wrong):
        made = run_over(each, {"gnss": {"position_scale": 1000.0, "velocity_gate": 0.0}})
        innovations = made.outputs["FILTER_INNOVATIONS"]
        z = innovations["normalized"][innovations["kind"] == 2]
        figures.append(float(np.mean(z * z)))
    assert figures[0] < 1.2
    assert figures[1] > 2.0 * figures[0]


def test_heading_from_the_course() -> None:
    """At the first fix that is fast enough, over all drives."""
    squares, tilts = [], []
    for seed in SEEDS:
        rows = drive(seed)
        made = plain_run(seed)
        (levelled,) = made.events_of("ALIGNMENT_LEVELLED")
        (aligned,) = made.events_of("ALIGNMENT_COMPLETE")
        assert levelled[0] < aligned[0]
        truth = rows[TRUTH]
        at = truth.valid_time_ns.tolist().index(aligned[0])
        first = made.solution.take(slice(0, 1))
        assert first.valid_time_ns[0] == aligned[0]
        speed = np.linalg.norm(truth["velocity_enu_m_s"][at])
        assert speed > 2.5
        error = first["attitude_rad"][0] - truth["attitude_rad"][at]
        error[2] = math.remainder(error[2], math.tau)
        std = first["attitude_std_rad"][0]
        assert abs(error[2]) < 4.0 * std[2]
        squares.append((error[2] / std[2]) ** 2)
        tilts.append(np.abs(error[:2]).max() / std[:2].max())
    # The stated deviation holds more than the course's own noise, so it may be too large.
    assert np.mean(squares) < limits(len(SEEDS), 1)[1]
    assert max(tilts) < 4.5


# At 35 s the drive is in a steady turn, which is as smooth as rest.
@pytest.mark.parametrize("start_s", [16.0, 22.0, 35.0, 48.0])
def test_alignment_in_motion(start_s: float) -> None:
    """The log begins on the way: levelled with what GNSS sees, then as good as ever."""
    for seed in SEEDS[:4]:
        whole = drive(seed)
        first = int(whole[IMU].log_time_ns[0])
        rows = between(whole, first + round(start_s * SECOND), first + 10_000 * SECOND)
        made = run_over(rows)
        (aligned,) = made.events_of("ALIGNMENT_COMPLETE")
        assert aligned[0] - first < (start_s + 15.0) * SECOND
        assert made.finite()
        errors = errors_of(made, rows)
        end = errors.elapsed_s > errors.elapsed_s[-1] - 5.0
        angle = np.linalg.norm(errors.attitude[end], axis=1)
        assert angle.max() < math.radians(1.0)
        assert errors.normalized("attitude")[end].mean() < chi2.ppf(0.9999, 3)
        assert np.linalg.norm(errors.position[end], axis=1).max() < 0.15


def test_biases_are_found() -> None:
    """Gyro and accelerometer bias of the truth, within four deviations at the end."""
    for seed in SEEDS:
        truth, made = drive(seed)[TRUTH], plain_run(seed)
        for field, first in (("gyro_bias_body_rad_s", 9), ("accel_bias_body_m_s2", 12)):
            error = made.states[field][-1] - truth[field][-1]
            std = np.sqrt(np.diag(made.covariances[-1])[first : first + 3])
            assert np.all(np.abs(error) < 4.5 * std), field
        # And that is worth something: a tenth of what was not known at first.
        assert np.sqrt(made.covariances[-1][11, 11]) < 0.1 * math.radians(0.05)


def test_covariances_are_symmetric_and_definite() -> None:
    made = plain_run(SEEDS[0])
    for matrix in made.covariances[::20]:
        scale = np.sqrt(np.diag(matrix))
        assert np.linalg.eigvalsh(matrix / np.outer(scale, scale)).min() > 0.0
