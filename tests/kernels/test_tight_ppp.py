"""Codes, phases and range rates on an inertial system: finite differences and dense matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.kernels import (
    ppp_measures,
    ppp_states,
    ppp_update,
    records,
    tight_ppp_begin,
    tight_ppp_measures,
    tight_ppp_states,
    update,
)
from replay.kernels.gnss_records import FIRST, MEASURED_DTYPE, SATELLITES, SLOTS
from replay.kernels.ppp_records import (
    CODE,
    DOPPLER,
    MEASURE_STATES,
    MEASURES,
    PHASE,
    PPP_CONFIG_DTYPE,
    PPP_MEASURE_DTYPE,
    ROOM,
    VELOCITY,
    VIEW_DTYPE,
    VIEWS,
    new_ppp_state,
)
from replay.kernels.prediction import remove_sensor_errors
from replay.kernels.tight_ppp_records import (
    LEAD,
    PPP_TIGHT_STATES,
    TIGHT_PPP_CONFIG_DTYPE,
    WALK,
    WHITE,
    new_tight_ppp_state,
)
from replay.kernels.transition import trail_dtype
from replay.kernels.wind_up import orientation_phase
from tests.kernels.test_measurements import config
from tests.kernels.test_strapdown import start

C = 299792458.0
EARTH_RATE = 7.292115e-5
LEVER = np.array([0.8, -0.4, -1.2])
W_RAW = np.array([0.05, -0.1, 0.4])
F_RAW = np.array([0.7, 1.1, -9.9])
INERTIAL = 26  # states with scale factors, mounting, lever arm and squat
SECOND = 1_000_000_000
L1, L2, E5 = 1575.42e6, 1227.6e6, 1176.45e6
UP_FALL = (1.18e-4, 4.4e-4)  # of hydrostatic and wet delay with a metre of height


def settings(**values):
    cfg = np.zeros(1, dtype=PPP_CONFIG_DTYPE)
    usual = {
        "mask": 0.1, "slots": 2, "code_sigma": 0.5, "phase_sigma": 0.003, "doppler_sigma": 0.05,
        "code_scale": 1.0, "phase_scale": 1.0, "satellite_scale": 1.0, "code_gate": 1e9,
        "phase_gate": 1e9, "dynamics": VELOCITY, "position_sigma": 100.0, "velocity_sigma": 10.0,
        "clock_sigma": 100.0, "wet_sigma": 0.2, "gradients": 1, "gradient_sigma": 1e-3,
        "bias_sigma": 20.0, "ionosphere_sigma": 50.0, "ionosphere_noise": 4e-3, "rejections": 2,
        "ambiguity_sigma": 90.0, "gap": 10.0, "ionosphere": 1, "constraint_sigma": 1.0,
        "constraint_time": 600.0,
    }  # fmt: skip
    for name, value in {**usual, **values}.items():
        cfg[name] = value
    return cfg[0]


def inertial_state():
    """A turning vehicle at 12 m/s with errors of all its sensors."""
    s = records.new_state(PPP_TIGHT_STATES)[0]
    nav = start(roll=0.05, pitch=-0.08, heading=1.1)
    matrix = np.array(nav["C"])
    s["mode"] = records.RUNNING
    s["t"] = 5 * SECOND
    s["nav"]["r"] = nav["r"]
    s["nav"]["v"] = 12.0 * matrix[:, 0] + [0.3, -0.2, 0.1]
    q = Rotation.from_matrix(matrix).as_quat()
    s["nav"]["q"] = [q[3], q[0], q[1], q[2]]
    s["nav"]["C"] = matrix
    s["nav"]["f_e"] = matrix @ F_RAW
    s["bg"], s["ba"], s["sg"] = [0.001, 0.002, -0.001], [0.01, -0.02, 0.03], [2e-3, -1e-3, 3e-3]
    s["w_raw"], s["f_raw"] = W_RAW, F_RAW
    s["moved_t"] = s["t"]
    return s


def workspace(s):
    work = np.zeros(1, dtype=records.work_dtype(PPP_TIGHT_STATES))[0]
    remove_sensor_errors(s, work)
    return work


def no_trail():
    """The trail of a filter that does not record."""
    return np.zeros(1, dtype=trail_dtype(PPP_TIGHT_STATES))[0]


def antenna_of(s):
    """Position and velocity of the antenna, straight from their definition."""
    matrix = np.array(s["nav"]["C"])
    w = (W_RAW - s["bg"]) / (1.0 + s["sg"])
    turning = np.array([0.0, 0.0, EARTH_RATE])
    x = s["nav"]["r"] + matrix @ LEVER
    v = s["nav"]["v"] + matrix @ np.cross(w, LEVER) - np.cross(turning, matrix @ LEVER)
    return x, v


def coarse_of(s):
    """Where the delays were computed: some metres away."""
    return s["nav"]["r"] + [30.0, -20.0, 10.0]


def satellites(s, count=8):
    """Satellites of three systems above the vehicle, with every term of the models."""
    random = np.random.default_rng(8)
    x, _ = antenna_of(s)
    up = x / np.linalg.norm(x)
    rows = np.zeros(count, dtype=MEASURED_DTYPE)
    for k in range(count):
        side = np.cross(up, random.normal(size=3))
        direction = up + random.uniform(0.2, 1.2) * side / np.linalg.norm(side)
        direction /= np.linalg.norm(direction)
        row = rows[k]
        row["system"] = (0, 2, 3)[k % 3]
        row["prn"] = k + 1
        row["satellite"] = FIRST[row["system"]] + k
        row["signal"] = [12593, 12594, 12595]
        row["frequency"] = [L1, L2, E5]
        row["seen"] = 1
        row["position"] = x + 2.2e7 * direction
        row["velocity"] = random.normal(size=3) * 2000.0
        row["clock"], row["drift"] = random.normal() * 1e4, random.normal() * 0.01
        row["elevation"], row["azimuth"] = np.arcsin(direction @ up), random.uniform(0.0, 6.2)
        row["cn0"] = 45.0
        row["group_delay"] = random.normal(size=3)
        row["ionosphere"] = random.uniform(1.0, 5.0, size=3)
        row["hydrostatic"], row["wet"], row["shapiro"] = 2.5, 0.2, 0.01
        row["hydrostatic_mapping"], row["wet_mapping"] = 1.1, random.uniform(1.0, 4.0)
        row["code"], row["phase"] = 2.2e7, 2.2e7 + random.normal(size=3) * 30.0
        row["range_rate"] = random.normal(size=3) * 100.0
    return rows


def range_rate(row, x, v):
    """Rate in time of reception, by bringing both ends forward by a moment.

    In long numbers: plain ones tell a range of 2e7 m to 4e-9 m, and a rate to 4e-6 m/s.
    """
    x, v = x.astype(np.longdouble), v.astype(np.longdouble)
    start, speed = row["position"].astype(np.longdouble), row["velocity"].astype(np.longdouble)
    h = np.longdouble(1e-3)
    travel = np.sqrt(np.sum((start - x) ** 2)) / C
    values = []
    for dt in (-h, h):
        grown = np.longdouble(0.0)
        for _ in range(5):
            at = start + speed * (dt - grown)
            angle = EARTH_RATE * grown
            at = at + np.array([angle * at[1], -angle * at[0], 0.0 * angle])
            grown = np.sqrt(np.sum((at - (x + v * dt)) ** 2)) / C - travel
        values.append((grown + travel) * C)
    return float((values[1] - values[0]) / (2.0 * h))


class Filter:
    """A joint filter that has met its satellites, and everything that its epoch needs."""

    def __init__(self, rows=None, **values):
        self.s, self.q, self.cfg = inertial_state(), new_ppp_state()[0], settings(**values)
        self.rows = satellites(self.s) if rows is None else rows
        self.work = workspace(self.s)
        self.views = np.zeros(VIEWS, dtype=VIEW_DTYPE)
        self.x, self.P = np.zeros(ROOM), np.zeros((ROOM, ROOM))
        self.up = self.s["nav"]["r"] / np.linalg.norm(self.s["nav"]["r"])
        self.coarse = coarse_of(self.s)
        self.count = self.look()
        self.n = self.predict(5 * SECOND)
        random = np.random.default_rng(11)
        self.s["aux"][: self.n - LEAD] = random.normal(size=self.n - LEAD) * 5.0

    def look(self):
        place, _ = antenna_of(self.s)
        return ppp_measures.view_rows(
            self.rows, self.cfg, place, self.coarse, self.up, self.views, np.zeros(3)
        )

    def predict(self, t):
        place, speed = antenna_of(self.s)
        source, grow = np.zeros(ROOM, dtype=np.int64), np.zeros(ROOM)
        A, n = ppp_states.predict(
            self.rows, self.views, self.count, t, 55.0, self.q, self.cfg, self.x, self.P, place,
            speed, np.zeros((SATELLITES, SLOTS), dtype=np.int64), source, grow,
        )  # fmt: skip
        J = np.zeros((PPP_TIGHT_STATES, PPP_TIGHT_STATES))
        self.size = tight_ppp_states.repack_states(
            self.s, config(), A, n, source, grow, J, no_trail()
        )
        return n

    def measures(self):
        """Measurements of the antenna and of the joint states, of the state as it is."""
        place, speed = antenna_of(self.s)
        self.look()
        self.x[:3], self.x[3:6] = place, speed
        self.x[LEAD : self.n] = self.s["aux"][: self.n - LEAD]
        measures = np.zeros(MEASURES, dtype=PPP_MEASURE_DTYPE)
        total = ppp_measures.build_measures(
            self.rows, self.views, self.count, self.q, self.cfg, self.x, 1.0, measures, np.zeros(2)
        )
        total = tight_ppp_measures.add_rates(
            self.rows, self.views, self.count, self.q, self.cfg, self.x, measures, total,
            np.zeros(3),
        )  # fmt: skip
        joint = np.zeros(MEASURES, dtype=PPP_MEASURE_DTYPE)
        G, index, known = self.antenna()
        tight_ppp_measures.to_joint(measures, total, INERTIAL, G, index, known, joint)
        return measures[:total], joint[:total]

    def antenna(self):
        G, index = np.zeros((LEAD, 15)), np.zeros(15, dtype=np.int64)
        known = tight_ppp_states.antenna_rows(self.s, config(), self.work, LEVER, G, index)
        return G, index, known

    def correct(self, state, size):
        dx = np.zeros(PPP_TIGHT_STATES)
        dx[state] = size
        update.feed_back(self.s, config(), dx, np.zeros((2, 4)))
        remove_sensor_errors(self.s, self.work)

    def computed(self, m):
        """What a measurement should read, from the definitions alone."""
        s, q, row = self.s, self.q, self.rows[self.views[m["pair"]]["rover"]]
        aux, sat, slot, system = s["aux"], m["satellite"], m["slot"], row["system"]
        x, v = antenna_of(s)
        if m["kind"] == DOPPLER:
            return range_rate(row, x, v) + aux[q["drift"] - LEAD] - row["drift"]
        slant = aux[q["slant"][sat] - LEAD]
        if m["kind"] not in (CODE, PHASE):
            return slant
        value = np.linalg.norm(row["position"] - x) + aux[q["clock"] - LEAD] - row["clock"]
        if system != q["reference"]:
            value += aux[q["between"][system] - LEAD]
        fall = UP_FALL[0] * row["hydrostatic"] + UP_FALL[1] * row["wet"]
        value += row["hydrostatic"] + row["wet"] - fall * (self.up @ (x - self.coarse))
        value += row["shapiro"] + row["wet_mapping"] * aux[q["wet"] - LEAD]
        E, A = row["elevation"], row["azimuth"]
        slope = 1.0 / (np.sin(E) * np.tan(E) + 0.0032)
        gradient = aux[q["gradient"] - LEAD : q["gradient"] - LEAD + 2]
        value += slope * (np.cos(A) * gradient[0] + np.sin(A) * gradient[1])
        delay = (L1 / row["frequency"][slot]) ** 2 * slant + row["ionosphere"][slot]
        if m["kind"] == PHASE:
            return value - delay + aux[q["amb"][sat, slot] - LEAD]
        value += delay + row["group_delay"][slot]
        bias = q["bias"][system, slot]
        return value + (aux[bias - LEAD] if bias >= 0 else 0.0)

    def observed(self, m):
        row = self.rows[self.views[m["pair"]]["rover"]]
        field = {CODE: "code", PHASE: "phase", DOPPLER: "range_rate"}.get(int(m["kind"]))
        return 0.0 if field is None else row[field][m["slot"]]


def dense_rows(measures, n):
    H = np.zeros((len(measures), n))
    for row, m in zip(H, measures, strict=True):
        np.add.at(row, m["index"][: m["count"]], m["h"][: m["count"]])
    return H


STEPS = np.array([1.0] * 3 + [0.1] * 3 + [1e-3] * 3 + [1e-4] * 3 + [1e-2] * 3 + [1e-3] * 6)


def test_measurements_are_those_of_the_paper():
    f = Filter()
    _, joint = f.measures()
    kinds = joint["kind"].tolist()
    assert kinds.count(CODE) == kinds.count(PHASE) == kinds.count(DOPPLER) == 16
    for m in joint:
        # Range rates leave out what is second order in the speed over that of light.
        tolerance = 1e-5 if m["kind"] == DOPPLER else 1e-7
        assert m["z"] == pytest.approx(f.observed(m) - f.computed(m), abs=tolerance)


def test_sensitivities_are_those_of_finite_differences():
    f = Filter()
    _, joint = f.measures()
    H = dense_rows(joint, f.size)
    wanted = np.zeros_like(H)
    for state in range(f.size):
        step = STEPS[state] if state < len(STEPS) else 1.0
        ends = []
        for sign in (1.0, -1.0):
            other = Filter()
            other.correct(state, sign * step)
            ends.append(np.array([other.computed(m) for m in joint]))
        wanted[:, state] = (ends[0] - ends[1]) / (2.0 * step)
    rates = joint["kind"] == DOPPLER
    # Ranges of 2e7 m are known to 4e-9 m; a turn by 1e-3 rad is not straight.
    tolerance = np.where(np.arange(f.size) < 21, 2e-5, 1e-7)
    assert (np.abs(H - wanted)[~rates] < tolerance).all()
    # Of range rates the filter leaves out what is second order in speeds over that of light.
    scale = np.abs(wanted[rates]).max(axis=0)
    assert (np.abs(H - wanted)[rates] < 3e-5 * scale + 1e-7).all()
    assert np.abs(H[rates][:, 9:12]).max() > 0.5  # lever arm times biases of the gyroscopes
    assert np.abs(H[rates][:, 15:18]).max() > 0.1
    assert np.abs(H[:, 21:26]).max() == 0.0
    assert (H[:, INERTIAL:] != 0.0).any(axis=0).all()


def test_a_measurement_has_room_for_all_its_states():
    f = Filter()
    _, joint = f.measures()
    assert joint["count"].max() <= MEASURE_STATES
    assert set(joint["count"][joint["kind"] == DOPPLER]) == {16}


def definite(random, n):
    A = random.normal(size=(n, 3 * n))
    return A @ A.T / (3 * n)


def test_covariance_of_the_antenna_and_the_states_behind_it():
    f = Filter()
    P = definite(np.random.default_rng(2), f.size)
    f.s["P"][: f.size, : f.size] = P
    T = np.zeros((f.n, f.size))
    T[LEAD:, INERTIAL:] = np.eye(f.n - LEAD)
    for state in range(21):
        ends = []
        for sign in (1.0, -1.0):
            other = Filter()
            other.correct(state, sign * STEPS[state])
            ends.append(np.concatenate(antenna_of(other.s)))
        T[:LEAD, state] = (ends[0] - ends[1]) / (2.0 * STEPS[state])
    n = tight_ppp_states.antenna_view(f.s, config(), *f.antenna(), f.x, f.P)
    assert n == f.n
    np.testing.assert_allclose(f.P[:n, :n], T @ P @ T.T, atol=2e-5)
    np.testing.assert_array_equal(f.P[:n, :n], f.P[:n, :n].T)
    np.testing.assert_array_equal(f.x[LEAD:n], f.s["aux"][: n - LEAD])


def test_update_of_an_epoch_is_that_of_dense_matrices():
    f = Filter()
    P = definite(np.random.default_rng(3), f.size)
    f.s["P"][: f.size, : f.size] = P
    _, joint = f.measures()
    joint["z"] = np.random.default_rng(4).normal(size=len(joint))
    H, R = dense_rows(joint, f.size), np.diag(joint["r"])
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    dx = np.zeros(f.size)
    ppp_update.update_epoch(joint, len(joint), f.s["P"], f.size, f.cfg, dx)
    left = np.eye(f.size) - K @ H
    np.testing.assert_allclose(dx, K @ joint["z"], atol=1e-7)
    found = f.s["P"][: f.size, : f.size]
    np.testing.assert_allclose(found, left @ P @ left.T + K @ R @ K.T, atol=1e-9)
    np.testing.assert_array_equal(found, found.T)


@pytest.mark.parametrize(
    "source",
    [
        [6, 7, 8, 9, 10, 11, 12],  # all live on
        [6, 7, 10, 8, 12],  # some end, the order is another
        [6, 7, -1, 9, -1, 12, 10, -1],  # some are born among them
        [-1, -1, -1],  # a filter that begins
    ],
)
def test_states_that_end_begin_and_stand_elsewhere(source):
    s = inertial_state()
    old, n = 7, LEAD + len(source)
    size = INERTIAL + len(source)
    P = definite(np.random.default_rng(5), INERTIAL + old)
    s["P"][:] = 66.0  # what is beyond the states is nothing
    s["P"][: INERTIAL + old, : INERTIAL + old] = P
    s["extra"] = old
    choice = np.zeros((size, INERTIAL + old))
    choice[:INERTIAL, :INERTIAL] = np.eye(INERTIAL)
    A, added = np.diag(np.arange(1.0, n + 1.0)), np.zeros(size)
    grow = 0.01 * np.arange(n)
    for k, place in enumerate(source):
        if place >= 0:
            choice[INERTIAL + k, INERTIAL + place - LEAD] = 1.0
        added[INERTIAL + k] = grow[LEAD + k] if place >= 0 else A[LEAD + k, LEAD + k]
    places = np.full(ROOM, -1, dtype=np.int64)
    places[LEAD:n] = source
    J = np.zeros((PPP_TIGHT_STATES, PPP_TIGHT_STATES))
    found = tight_ppp_states.repack_states(s, config(), A, n, places, grow, J, no_trail())
    assert found == size
    assert s["extra"] == len(source)
    np.testing.assert_array_equal(s["P"][:size, :size], choice @ P @ choice.T + np.diag(added))


@pytest.mark.parametrize("kind", [WALK, WHITE])
def test_the_clock_goes_on_by_its_drift(kind):
    f = Filter()
    P = definite(np.random.default_rng(6), f.size)
    f.s["P"][: f.size, : f.size] = P
    clock, drift = INERTIAL + f.q["clock"] - LEAD, INERTIAL + f.q["drift"] - LEAD
    g = new_tight_ppp_state()[0]
    g["clock_t"] = f.s["t"] - 2 * SECOND
    pcfg = np.zeros(1, dtype=TIGHT_PPP_CONFIG_DTYPE)[0]
    pcfg["clock"], pcfg["clock_noise"], pcfg["drift_noise"] = kind, 0.3, 0.7
    before = f.s["aux"].copy()
    tight_ppp_states.carry_clock(f.s, g, f.q, config(), pcfg, no_trail())
    Phi, Q, dt = np.eye(f.size), np.zeros((f.size, f.size)), 2.0
    Q[drift, drift] = 0.7 * dt
    if kind == WALK:
        Phi[clock, drift] = dt
        Q[clock, clock] = 0.3 * dt + 0.7 * dt**3 / 3.0
        Q[clock, drift] = Q[drift, clock] = 0.7 * dt**2 / 2.0
        before[clock - INERTIAL] += dt * before[drift - INERTIAL]
    found = f.s["P"][: f.size, : f.size]
    np.testing.assert_allclose(found, Phi @ P @ Phi.T + Q, atol=1e-12)
    np.testing.assert_array_equal(found, found.T)
    np.testing.assert_allclose(f.s["aux"], before, atol=1e-12)
    assert g["clock_t"] == f.s["t"]


@pytest.mark.parametrize(
    ("innovations", "step"),
    [
        ([300.1, 299.9, 300.2, 299.8, 0.3], 300.0),  # all but one
        ([300.1, 299.9, 1.0, 299.8, 0.3], 0.0),  # too few agree
        ([9.0, 9.1, 9.2, 9.3, 9.4], 0.0),  # less than a jump
        ([-2e5] * 5, -2e5),
    ],
)
def test_a_clock_that_was_set_is_told_from_reflected_signals(innovations, step):
    measures = np.zeros(6, dtype=PPP_MEASURE_DTYPE)
    measures["kind"] = [CODE] * 5 + [PHASE]
    measures["z"] = [*innovations, 7e5]
    found = tight_ppp_measures.clock_step(measures, 6, 25.0, 30.0, np.zeros(6))
    assert found == pytest.approx(step, abs=0.3)
    # The clock itself may be known no better.
    assert tight_ppp_measures.clock_step(measures, 6, 1e10, 30.0, np.zeros(6)) == 0.0


def test_every_state_has_a_name_of_its_own():
    f = Filter()
    name = np.full(PPP_TIGHT_STATES, -1, dtype=np.int64)
    tight_ppp_states.name_states(f.q, INERTIAL, name)
    own = name[INERTIAL : f.size]
    assert (own >= 1000).all()
    assert len(np.unique(own)) == f.size - INERTIAL
    assert (name[f.size :] == -1).all()


def test_what_the_receiver_alone_has_found_is_taken_over():
    """The joint filter says of the antenna and of all behind it what was known before."""
    f = Filter()
    random = np.random.default_rng(7)
    alone, unit = definite(random, f.n), definite(random, INERTIAL)
    x = random.normal(size=ROOM)
    x[:3] += np.array(f.s["nav"]["r"])
    P = np.zeros((ROOM, ROOM))
    P[: f.n, : f.n] = alone
    f.s["P"][:] = 66.0
    f.s["P"][:INERTIAL, :INERTIAL] = unit
    f.s["aux"][:] = 66.0
    f.s["extra"] = 0
    tight_ppp_begin.join(f.s, f.q, config(), f.work, LEVER, *f.antenna(), x, P)
    joint = f.s["P"][: f.size, : f.size]
    np.testing.assert_array_equal(joint, joint.T)
    assert np.linalg.eigvalsh(joint).min() > 0.0
    place, speed = antenna_of(f.s)
    np.testing.assert_allclose(np.concatenate([place, speed]), x[:LEAD], atol=2e-9)
    # Attitude, biases and the vehicle are as they were, and know nothing of satellites.
    np.testing.assert_array_equal(joint[6:INERTIAL, 6:INERTIAL], unit[6:, 6:])
    assert not joint[6:INERTIAL, INERTIAL:].any()
    f.x[:LEAD] = x[:LEAD]
    n = tight_ppp_states.antenna_view(f.s, config(), *f.antenna(), f.x, f.P)
    assert n == f.n
    np.testing.assert_allclose(f.P[:n, :n], alone, atol=1e-12)
    np.testing.assert_array_equal(f.x[:n], x[:n])


@pytest.mark.parametrize("elevation", [0.2, 0.8, 1.5])
def test_a_turn_of_the_antenna_winds_its_phases(elevation):
    """Against the dipoles of Wu et al., a satellite standing still."""
    ray = -np.array([0.0, np.cos(elevation), np.sin(elevation)])
    side = np.array([1.0, 0.0, 0.0])
    satellite = np.array([side, np.cross(ray, side), ray])
    g = new_tight_ppp_state()[0]
    cycles = []
    for heading in np.linspace(0.3, 9.0, 30):
        forward = np.array([np.sin(heading), np.cos(heading), 0.0])
        right = np.array([np.cos(heading), -np.sin(heading), 0.0])
        up = np.array([0.0, 0.0, 1.0])
        axes = np.array([forward, -right, up])
        cycles.append(orientation_phase(satellite, axes, *ray))
        body = np.stack([forward, right, -up], axis=1)
        found = tight_ppp_measures.heading_of(body, np.eye(3))
        if len(cycles) == 1:
            g["heading"] = found
        else:
            tight_ppp_measures.follow_turn(g, found)
    assert g["turn"] == pytest.approx(8.7, abs=1e-12)
    turned = np.unwrap(np.array(cycles) * 2.0 * np.pi)
    assert turned[-1] - turned[0] == pytest.approx(8.7, abs=1e-9)
    f = Filter()
    _, joint = f.measures()
    before = joint["z"].copy()
    tight_ppp_measures.unwind(joint, len(joint), f.views, f.rows, f.cfg, g["turn"])
    phases = joint["kind"] == PHASE
    wavelength = C / np.where(joint["slot"] == 0, L1, L2)
    wanted = -8.7 / (2.0 * np.pi) * wavelength * phases
    np.testing.assert_allclose(joint["z"] - before, wanted, atol=1e-8)
