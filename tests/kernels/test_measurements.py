"""Every sensitivity of the loosely coupled filter against finite differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.kernels import constraints, gnss_update, records, update
from replay.schemas import filter_pb2, solution_pb2
from tests.kernels.test_strapdown import start

SIZES = np.array(  # of position, velocity, attitude, biases, scale factors, those of the vehicle
    [1.0] * 3
    + [0.1] * 3
    + [1e-5] * 3
    + [1e-4] * 3
    + [1e-3] * 3
    + [1e-4] * 6
    + [1e-5] * 2
    + [0.01] * 2
    + [1e-5]
)
LEVER = [0.8, -0.4, -1.2]
W_RAW = np.array([0.05, -0.1, 0.4])
F_RAW = np.array([0.7, 1.1, -9.9])
WINDOW = 0.25


def config(**values):
    cfg = np.zeros(1, dtype=records.CONFIG_DTYPE)
    defaults = {
        "states": 21, "mounting": 1, "lever": 1, "squat": 1,
        "imu_interval": 0.01, "stop_interval": 0.1,
        "nhc_right_sigma": 0.1, "nhc_down_sigma": 0.1, "zero_velocity_sigma": 0.1,
        "zero_rate_sigma": 0.1, "position_scale": 1.0, "velocity_scale": 1.0,
        "nhc_speed": 0.1, "position_floor": 0.0,
    }  # fmt: skip
    for name, value in {**defaults, **values}.items():
        cfg[name] = value
    return cfg[0]


def state_with(error):
    """A filter state that is `error` (truth minus estimate) away from the base state, as truth."""
    state = records.new_state()[0]
    nav = start(roll=0.05, pitch=-0.08, heading=1.1)
    forward = np.array(nav["C"])[:, 0]
    state["nav"]["r"] = nav["r"] + error[0:3]
    state["nav"]["v"] = 12.0 * forward + [0.3, -0.2, 0.1] + error[3:6]
    C = Rotation.from_rotvec(error[6:9]).as_matrix() @ np.array(nav["C"])
    q = Rotation.from_matrix(C).as_quat()
    state["nav"]["q"] = [q[3], q[0], q[1], q[2]]
    state["nav"]["C"] = C
    state["bg"] = [0.001, 0.002, -0.001] + error[9:12]
    state["ba"] = error[12:15]
    state["sg"] = error[15:18]
    state["sa"] = error[18:21]
    state["mount"] = [0.01, -0.02] + error[21:23]
    state["point"] = [-1.0, 0.2, 0.6] + np.array([error[23], 0.0, error[24]])
    state["w_raw"], state["f_raw"] = W_RAW, F_RAW
    w = (W_RAW - state["bg"]) / (1 + state["sg"])
    f = (F_RAW - state["ba"]) / (1 + state["sa"])
    state["nav"]["f_e"] = C @ f
    state["squat"] = 0.003 + error[25]
    state["w_smooth"] = w
    state["f_smooth"] = [1.5, 0.0, 0.0]
    for _ in range(20):
        constraints.push_sample(state, state["w_raw"], state["f_raw"])
    state["P"] = np.eye(records.MAX_STATES)
    return state, w, f


def sensitivities(measure, cfg, k):
    """H as the kernel fills it, dense, and by central differences of the innovation."""

    def innovation(error):
        state, w, f = state_with(error)
        work = np.zeros(1, dtype=records.WORK_DTYPE)[0]
        work["w"], work["f"] = w, f
        rows = np.zeros(16, dtype=records.INNOVATION_DTYPE)
        counts = np.zeros(5, dtype=np.int64)
        assert measure(state, cfg, work, rows, counts, error)
        return rows["z"][:k].copy(), work

    base, work = innovation(np.zeros(26))
    count = int(np.argmax(np.append(work["index"][1:], -1) <= 0) + 1)
    dense = np.zeros((k, 26))
    for column in range(count):
        dense[:, work["index"][column]] += work["H"][:k, column]
    numeric = np.zeros((k, 26))
    for j in range(26):
        error = np.zeros(26)
        error[j] = SIZES[j]
        # The innovation is measured minus predicted, and falls as the estimate grows.
        numeric[:, j] = (innovation(-error)[0] - innovation(error)[0]) / (2 * SIZES[j])
    return dense, numeric, base


def fix_record():
    fix = np.zeros(1, dtype=records.FIX_DTYPE)
    state, _, _ = state_with(np.zeros(26))
    fix["r"] = state["nav"]["r"] + [0.2, 0.1, -0.3]
    fix["v"] = state["nav"]["v"]
    fix["R"] = [[1.0, 0.1, 0.2, 2.0, 0.3, 3.0]]
    fix["V"] = fix["R"]
    fix["lever"] = LEVER
    fix["has_v"] = 1
    return fix[0]


def test_position():
    fix, cfg = fix_record(), config()

    def measure(s, cfg, work, rows, counts, error):
        return gnss_update.position_update(s, cfg, work, fix, True, 0, 0, rows, counts)

    dense, numeric, _ = sensitivities(measure, cfg, 3)
    np.testing.assert_allclose(dense, numeric, atol=2e-6)


def test_velocity_of_an_instant():
    fix, cfg = fix_record(), config()

    def measure(s, cfg, work, rows, counts, error):
        return gnss_update.velocity_update(s, cfg, work, fix, True, 0, 0, rows, counts)

    dense, numeric, _ = sensitivities(measure, cfg, 3)
    # The Earth's rate times the lever arm is left out: 1e-4 m/s per rad.
    np.testing.assert_allclose(dense, numeric, atol=3e-4)


def test_mean_velocity_over_a_window():
    fix, cfg = fix_record(), config(velocity_window=WINDOW)
    now = round(WINDOW * 1e9)

    def measure(s, cfg, work, rows, counts, error):
        # What the velocity was over the window, if the error grew as the error model says.
        acceleration = (
            -np.cross(s["nav"]["f_e"], error[6:9]) - np.array(s["nav"]["C"]) @ error[12:15]
        )
        mean_error = error[3:6] - 0.5 * WINDOW * acceleration
        base, _, _ = state_with(np.zeros(26))
        s["moved"] = WINDOW * (base["nav"]["v"] + mean_error)
        s["moved_t"], s["t"] = 0, now
        return gnss_update.velocity_update(s, cfg, work, fix, True, now, now, rows, counts)

    dense, numeric, _ = sensitivities(measure, cfg, 3)
    # Scale factors act through the state here and not through the displacement that is given;
    # the lever arm's part is the mean over the window, the model takes it at the end.
    used = np.r_[0:6, 12:15, 21:26]
    np.testing.assert_allclose(dense[:, used], numeric[:, used], atol=2e-5)
    turn = np.linalg.norm(np.cross(W_RAW, LEVER)) + np.linalg.norm(LEVER) / WINDOW
    np.testing.assert_allclose(dense[:, 6:9], numeric[:, 6:9], atol=turn)


def test_zero_velocity():
    cfg = config()

    def measure(s, cfg, work, rows, counts, error):
        s["nav"]["v"] = error[3:6]
        return constraints.zero_velocity_update(s, cfg, work, 0, 0, rows, counts)

    dense, numeric, _ = sensitivities(measure, cfg, 3)
    np.testing.assert_allclose(dense, numeric, atol=1e-9)


def test_zero_rate():
    cfg = config()

    def measure(s, cfg, work, rows, counts, error):
        return constraints.zero_rate_update(s, cfg, work, 0, 0, rows, counts)

    dense, numeric, _ = sensitivities(measure, cfg, 3)
    np.testing.assert_allclose(dense, numeric, atol=1e-4)  # the Earth's rate turns with attitude


def test_non_holonomic():
    cfg = config()

    def measure(s, cfg, work, rows, counts, error):
        work["w"] = s["w_smooth"]
        return constraints.non_holonomic_update(s, cfg, work, 0, 0, rows, counts)

    dense, numeric, _ = sensitivities(measure, cfg, 2)
    # The Earth's rate turns with attitude, as before; times a lever arm of a metre.
    np.testing.assert_allclose(dense, numeric, atol=2e-4)


def test_feedback_adds_truth_minus_estimate():
    cfg = config()
    dx = np.zeros(26)
    dx[:] = SIZES * np.random.default_rng(1).normal(size=26)
    estimate, _, _ = state_with(np.zeros(26))
    truth, _, _ = state_with(dx)
    update.feed_back(estimate, cfg, dx, np.zeros((2, 4)))
    for name in ("bg", "ba", "sg", "sa", "mount", "point", "squat"):
        np.testing.assert_allclose(estimate[name], truth[name], atol=1e-14)
    np.testing.assert_allclose(estimate["nav"]["r"], truth["nav"]["r"], atol=1e-8)
    np.testing.assert_allclose(estimate["nav"]["v"], truth["nav"]["v"], atol=1e-13)
    np.testing.assert_allclose(estimate["nav"]["C"], truth["nav"]["C"], atol=1e-12)


@pytest.mark.parametrize(
    ("prefix", "enum", "names"),
    [
        ("KIND", filter_pb2.MeasurementKind, {
            "POSITION": "POSITION", "VELOCITY": "VELOCITY", "ZERO_VELOCITY": "ZERO_VELOCITY",
            "ZERO_RATE": "ZERO_ANGULAR_RATE", "NON_HOLONOMIC": "NON_HOLONOMIC"}),
        ("AXIS", filter_pb2.MeasurementAxis, {
            "EAST": "EAST", "FORWARD": "FORWARD", "RIGHT": "RIGHT"}),
        ("EVENT", filter_pb2.EventKind, {
            "LEVELLED": "ALIGNMENT_LEVELLED", "ALIGNED": "ALIGNMENT_COMPLETE",
            "REJECTED": "MEASUREMENT_REJECTED", "OUTAGE_BEGIN": "OUTAGE_BEGIN",
            "OUTAGE_END": "OUTAGE_END", "STOP_BEGIN": "STOP_BEGIN", "STOP_END": "STOP_END",
            "IMU_GAP": "IMU_GAP", "TIME_BACKWARD": "TIME_BACKWARD", "NOT_FINITE": "NOT_FINITE",
            "RESET": "RESET"}),
        ("STATUS", solution_pb2.SolutionStatus, {
            "PREDICTED": "PREDICTED", "UPDATED": "UPDATED", "OUTAGE": "OUTAGE"}),
    ],
)  # fmt: skip
def test_numbers_of_the_kernels_are_those_of_the_schemas(prefix, enum, names):
    long = {"KIND": "MEASUREMENT_KIND", "AXIS": "MEASUREMENT_AXIS", "EVENT": "EVENT_KIND",
            "STATUS": "SOLUTION_STATUS"}[prefix]  # fmt: skip
    for ours, theirs in names.items():
        assert getattr(records, f"{prefix}_{ours}") == enum.Value(f"{long}_{theirs}")
