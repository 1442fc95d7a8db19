"""Differences to a base on an inertial system, against finite differences and dense matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.kernels import records, rtk_update, tight_rtk_epoch, tight_rtk_states, update
from replay.kernels.integers import ATTEMPT_DTYPE, CANDIDATE_DTYPE
from replay.kernels.rtk_records import (
    MEASURE_DTYPE,
    MEASURE_STATES,
    ROOM,
    RTK_CONFIG_DTYPE,
)
from replay.kernels.tight_rtk_states import LEAD, RTK_TIGHT_STATES
from tests.kernels.test_measurements import config
from tests.kernels.test_strapdown import start

LEVER = np.array([0.8, -0.4, -1.2])
INERTIAL = 26  # states with scale factors, mounting, lever arm and squat
EXTRA = 9
COUNT = INERTIAL + EXTRA


def definite(random, n):
    A = random.normal(size=(n, 3 * n))
    return A @ A.T / (3 * n)


def filter_state(seed=1):
    """A vehicle whose inertial states and ambiguities all depend on each other."""
    s = records.new_state(RTK_TIGHT_STATES)[0]
    nav = start(roll=0.05, pitch=-0.08, heading=1.1)
    matrix = np.array(nav["C"])
    s["mode"] = records.RUNNING
    s["nav"]["r"] = nav["r"]
    q = Rotation.from_matrix(matrix).as_quat()
    s["nav"]["q"] = [q[3], q[0], q[1], q[2]]
    s["nav"]["C"] = matrix
    s["extra"] = EXTRA
    random = np.random.default_rng(seed)
    s["aux"][:EXTRA] = random.normal(size=EXTRA) * 5.0
    s["P"][:COUNT, :COUNT] = definite(random, COUNT)
    return s


def workspace():
    return np.zeros(1, dtype=records.work_dtype(RTK_TIGHT_STATES))[0]


def antenna_of(s):
    return np.array(s["nav"]["r"]) + np.array(s["nav"]["C"]) @ LEVER


def arm_of(s):
    return np.array(s["nav"]["C"]) @ LEVER


def antenna_jacobian():
    """Of the antenna's position, by feeding small errors back; and nothing else moves it."""
    G = np.zeros((3, COUNT))
    for k in range(COUNT):
        ends = []
        for sign in (1.0, -1.0):
            s = filter_state()
            dx = np.zeros(RTK_TIGHT_STATES)
            dx[k] = sign * 1e-3
            update.feed_back(s, config(), dx, np.zeros((2, 4)))
            ends.append(antenna_of(s))
        G[:, k] = (ends[0] - ends[1]) / 2e-3
    return G


def to_antenna():
    """From the joint states to the antenna's position and the states behind it."""
    T = np.zeros((LEAD + EXTRA, COUNT))
    T[:LEAD] = antenna_jacobian()
    T[LEAD:, INERTIAL:] = np.eye(EXTRA)
    return T


def test_covariance_of_the_antenna_and_the_ambiguities():
    s = filter_state()
    out = np.zeros((LEAD + EXTRA, LEAD + EXTRA))
    tight_rtk_states.antenna_covariance(s["P"], COUNT, INERTIAL, arm_of(s), out)
    P, T = np.array(s["P"])[:COUNT, :COUNT], to_antenna()
    # Positions of 6e6 m difference to 1e-9 m over 2e-3.
    np.testing.assert_allclose(out, T @ P @ T.T, atol=5e-6)
    np.testing.assert_array_equal(out, out.T)


def some_measures(random, states, total=14):
    """Differences in two groups, each with some states behind the position."""
    measures = np.zeros(total, dtype=MEASURE_DTYPE)
    for k, m in enumerate(measures):
        count = 3 + int(random.integers(0, 5))
        m["kind"], m["pair"], m["slot"] = k % 2, k, k % 3
        m["group"] = 0 if k < total // 2 else 1
        m["satellite"] = 10 + k
        m["z"] = random.normal()
        m["r"] = random.uniform(0.2, 2.0)
        m["use"] = 1
        m["count"] = count
        m["index"][:3] = [0, 1, 2]
        m["index"][3:count] = LEAD + random.permutation(states)[: count - 3]
        m["h"][:count] = random.normal(size=count)
    return measures


def dense_rows(measures, n):
    H = np.zeros((len(measures), n))
    for row, m in zip(H, measures, strict=True):
        row[m["index"][: m["count"]]] = m["h"][: m["count"]]
    return H


def test_measurements_of_the_antenna_become_those_of_the_joint_states():
    s = filter_state()
    measures = some_measures(np.random.default_rng(5), EXTRA)
    joint = np.zeros_like(measures)
    tight_rtk_states.to_joint(measures, len(measures), INERTIAL, arm_of(s), joint)
    got = dense_rows(joint, COUNT)
    np.testing.assert_allclose(got, dense_rows(measures, LEAD + EXTRA) @ to_antenna(), atol=5e-6)
    for name in ("kind", "pair", "slot", "group", "satellite", "z", "r", "use"):
        np.testing.assert_array_equal(joint[name], measures[name])


def test_a_measurement_of_a_phase_with_all_delays_has_room():
    # Position, attitude, an ambiguity, a slant delay and two wet ones.
    assert MEASURE_STATES >= 3 + 3 + 1 + 1 + 2
    # As many states as the differences may predict (one row of theirs is a clock's).
    assert RTK_TIGHT_STATES >= INERTIAL + (ROOM - 1) - LEAD


@pytest.mark.parametrize(
    "source",
    [
        list(range(LEAD, LEAD + EXTRA)),  # all live on
        [5, 3, 11, 4, 10],  # some are dropped, the order is another
        [-1, 7, -1, 3, 11, -1],  # some are born among them
        [-1, -1, -1],  # a filter that begins
        [],
    ],
)
def test_prior_of_states_dropped_born_and_reordered(source):
    s = filter_state()
    P = np.array(s["P"])[:COUNT, :COUNT]
    n = LEAD + len(source)
    size = INERTIAL + len(source)
    grow = 0.01 * np.arange(1, len(source) + 1)
    # What the dense filter says: chosen rows, priors of the new ones, growth of the old.
    choice = np.zeros((size, COUNT))
    choice[:INERTIAL, :INERTIAL] = np.eye(INERTIAL)
    added = np.zeros(size)
    for k, old in enumerate(source):
        if old < 0:
            added[INERTIAL + k] = 900.0
        else:
            choice[INERTIAL + k, INERTIAL + old - LEAD] = 1.0
            added[INERTIAL + k] = grow[k]
    want = choice @ P @ choice.T + np.diag(added)
    # What the prediction of the differences hands over: the same of its own states alone.
    A = np.full((n + 1, n + 1), 77.0)
    A[LEAD:n, LEAD:n] = want[INERTIAL:, INERTIAL:]
    J = np.full((size + 1, size + 1), 99.0)
    places = np.full(ROOM, -1, dtype=np.int64)
    places[:LEAD] = [0, 1, 2]
    places[LEAD:n] = source
    tight_rtk_states.joint_prior(s["P"], INERTIAL, A, n, places, J)
    np.testing.assert_array_equal(J[:size, :size], want)
    assert not J[size].any()
    assert not J[:, size].any()
    assert np.linalg.eigvalsh(J[:size, :size]).min() > 0.0


def settings(**values):
    cfg = np.zeros(1, dtype=RTK_CONFIG_DTYPE)
    for name, value in {"code_gate": 1e9, "phase_gate": 1e9, **values}.items():
        cfg[name] = value
    return cfg[0]


def dense_update(P, H, z, R):
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    left = np.eye(len(P)) - K @ H
    return K @ z, left @ P @ left.T + K @ R @ K.T


def test_update_of_an_epoch_is_that_of_dense_double_differences():
    """Receiver clocks taken off by differences within each group, covariances and all."""
    s = filter_state()
    P = np.array(s["P"])[:COUNT, :COUNT]
    measures = some_measures(np.random.default_rng(6), EXTRA)
    half = len(measures) // 2
    joint = np.zeros_like(measures)
    tight_rtk_states.to_joint(measures, len(measures), INERTIAL, arm_of(s), joint)
    J = np.zeros((COUNT + 1, COUNT + 1))
    J[:COUNT, :COUNT] = P
    new, dx = np.empty_like(J), np.zeros(COUNT + 1)
    starts = np.array([0, half, 2 * half], dtype=np.int64)
    rtk_update.update_epoch(
        joint, starts, 2, J, COUNT + 1, settings(), np.full(3, np.nan), np.zeros((3, 3)),
        np.zeros(ROOM), new, dx,
    )  # fmt: skip
    # Any reference does: the last of each group here.
    D = np.zeros((2 * half - 2, 2 * half))
    for group in range(2):
        rows = slice(group * (half - 1), (group + 1) * (half - 1))
        D[rows, group * half : (group + 1) * half - 1] = np.eye(half - 1)
        D[rows, (group + 1) * half - 1] = -1.0
    H = D @ dense_rows(joint, COUNT)
    want_dx, want_P = dense_update(P, H, D @ joint["z"], D @ np.diag(joint["r"]) @ D.T)
    np.testing.assert_allclose(dx[:COUNT], want_dx, atol=1e-12)
    np.testing.assert_allclose(new[:COUNT, :COUNT], want_P, atol=1e-12)


def test_held_integers_are_measurements_of_the_joint_states():
    s = filter_state()
    P, aux, before = np.array(s["P"])[:COUNT, :COUNT], s["aux"].copy(), antenna_of(s)
    bias = s["bg"].copy()
    candidates = np.zeros(3, dtype=CANDIDATE_DTYPE)
    candidates["state"] = [LEAD + 1, LEAD + 4, LEAD + 7]
    candidates["base"] = [LEAD, LEAD, LEAD + 5]
    candidates["wavelength"] = [0.19, 0.24, 0.25]
    candidates["elevation"] = [0.6, 0.7, 0.2]
    candidates["integer"] = [12, -7, 4]
    held = 2  # the third is too low
    H, z = np.zeros((held, COUNT)), np.zeros(held)
    for k in range(held):
        c = candidates[k]
        H[k, INERTIAL + c["state"] - LEAD] = 1.0
        H[k, INERTIAL + c["base"] - LEAD] = -1.0
        z[k] = c["wavelength"] * c["integer"] - (aux[c["state"] - LEAD] - aux[c["base"] - LEAD])
    R = np.diag((0.03 * candidates["wavelength"][:held]) ** 2)
    dx, want = dense_update(P, H, z, R)
    rcfg = settings(hold_sigma=0.03, hold_mask=0.3)
    tight_rtk_epoch.hold_integers(s, config(), rcfg, workspace(), candidates, 3, INERTIAL)
    np.testing.assert_allclose(np.array(s["P"])[:COUNT, :COUNT], want, atol=1e-12)
    np.testing.assert_allclose(s["aux"][:EXTRA], aux[:EXTRA] + dx[INERTIAL:], atol=1e-12)
    np.testing.assert_allclose(s["bg"], bias + dx[9:12], atol=1e-12)
    turned = Rotation.from_rotvec(dx[6:9]).as_matrix() @ arm_of(filter_state())
    moved = before - arm_of(filter_state()) + dx[:3] + turned
    np.testing.assert_allclose(antenna_of(s), moved, atol=1e-8)


def test_the_position_shown_is_that_of_a_filter_told_where_the_antenna_is():
    """The antenna is known better; what that says of the inertial unit is Kalman's matter."""
    s = filter_state()
    P, T = np.array(s["P"])[:COUNT, :COUNT], to_antenna()
    random = np.random.default_rng(9)
    R, y = definite(random, 3) * 0.05, random.normal(size=3)
    dx, after = dense_update(P, T[:LEAD], y, R)
    A = np.zeros((ROOM, ROOM))
    A[: LEAD + EXTRA, : LEAD + EXTRA] = T @ P @ T.T
    x = np.zeros(ROOM)
    x[:3] = antenna_of(s)
    tried = np.zeros(1, dtype=ATTEMPT_DTYPE)[0]
    tried["x"] = x[:3] + T[:LEAD] @ dx
    tried["cov"] = T[:LEAD] @ after @ T[:LEAD].T
    work = workspace()
    axes = Rotation.random(random_state=3).as_matrix()
    work["axes"] = axes
    row = np.zeros(1, dtype=records.SOLUTION_DTYPE)[0]
    tight_rtk_epoch.show_fixed(s, work, tried, x, A, arm_of(s), row)
    np.testing.assert_allclose(row["r"], s["nav"]["r"] + dx[:3], atol=1e-5)
    local = axes @ after[:3, :3] @ axes.T
    np.testing.assert_allclose(row["cov"], local[np.triu_indices(3)], atol=2e-5)
