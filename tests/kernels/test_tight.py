"""Satellites on an inertial system, against finite differences and the textbook's matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from replay.configuration import build
from replay.kernels import (
    antenna_measures,
    records,
    tight,
    tight_phases,
    tight_records,
    tight_update,
    update,
)
from replay.kernels.gnss_records import EPOCH_DTYPE, FIRST, MEASURED_DTYPE, SATELLITES, SYSTEMS
from replay.kernels.prediction import remove_sensor_errors
from replay.kernels.single_records import RESIDUAL_DTYPE
from replay.kernels.tight_records import CHANGE, CLOCK, CLONE, DRIFT, TIGHT_STATES
from replay.kernels.transition import trail_dtype
from replay.stages.gnss_ins_tc import tight_record
from replay.stages.tight_config import TightConfig
from tests.kernels.test_measurements import config
from tests.kernels.test_strapdown import start

C = 299792458.0
EARTH_RATE = 7.292115e-5
LEVER = np.array([0.8, -0.4, -1.2])
W_RAW = np.array([0.05, -0.1, 0.4])
F_RAW = np.array([0.7, 1.1, -9.9])
INERTIAL = 26  # states with scale factors, mounting, lever arm and squat
COUNT = INERTIAL + tight_records.PHASE_EXTRA
SECOND = 1_000_000_000
SIZES = np.array(
    [1.0] * 3
    + [0.1] * 3
    + [1e-5] * 3
    + [1e-4] * 3
    + [1e-3] * 3
    + [1e-4] * 6
    + [1e-5] * 2
    + [0.01] * 2
    + [1e-5]
    + [1.0] * (SYSTEMS + 5)
)
DEVIATIONS = SIZES * 3.0
STEPS = SIZES.copy()
STEPS[6:9] = 1e-3  # ranges are known to nanometres only
EPOCH = np.zeros(1, dtype=EPOCH_DTYPE)


def settings(**values):
    table = {"antenna": {"lever_arm": LEVER.tolist()}, "tight": {"phase": True, **values}}
    return tight_record(build(TightConfig, [table]))[0]


def covariance(seed=3):
    """A full, definite covariance whose deviations are those of the states."""
    random = np.random.default_rng(seed)
    A = random.normal(size=(COUNT, 3 * COUNT))
    P = A @ A.T
    scale = DEVIATIONS / np.sqrt(np.diag(P))
    return P * np.outer(scale, scale)


def filter_state():
    """A turning vehicle at 12 m/s that knows its clocks and its place an epoch ago."""
    s = records.new_state(TIGHT_STATES)[0]
    nav = start(roll=0.05, pitch=-0.08, heading=1.1)
    matrix = np.array(nav["C"])
    s["mode"] = records.RUNNING
    s["t"] = 5 * SECOND
    s["nav"]["r"] = nav["r"]
    s["nav"]["v"] = 12.0 * matrix[:, 0] + [0.3, -0.2, 0.1]
    q = Rotation.from_matrix(matrix).as_quat()
    s["nav"]["q"] = [q[3], q[0], q[1], q[2]]
    s["nav"]["C"] = matrix
    s["bg"], s["ba"] = [0.001, 0.002, -0.001], [0.01, -0.02, 0.03]
    s["w_raw"], s["f_raw"] = W_RAW, F_RAW
    s["nav"]["f_e"] = matrix @ F_RAW
    s["moved_t"] = s["t"]
    s["extra"] = tight_records.PHASE_EXTRA
    s["aux"][:SYSTEMS] = 100.0 * np.arange(1, SYSTEMS + 1)
    s["aux"][DRIFT] = 3.0
    s["aux"][CLONE : CLONE + 3] = nav["r"] - 12.0 * matrix[:, 0] + 0.2
    s["P"][:COUNT, :COUNT] = covariance()
    g = tight_records.new_tight_state()[0]
    g["known"], g["drift_known"] = 1, 1
    g["clock_t"] = s["t"]
    g["clone_t"] = s["t"] - SECOND
    g["epoch_t"] = 4 * SECOND
    return s, g


def no_trail():
    """The trail of a filter that does not record."""
    return np.zeros(1, dtype=trail_dtype(TIGHT_STATES))[0]


def workspace(s):
    work = np.zeros(1, dtype=records.work_dtype(TIGHT_STATES))[0]
    remove_sensor_errors(s, work)
    return work


def antenna_of(s):
    """Position and velocity of the antenna, straight from their definition."""
    matrix = np.array(s["nav"]["C"])
    w = (W_RAW - s["bg"]) / (1.0 + s["sg"])
    turning = np.array([0.0, 0.0, EARTH_RATE])
    x = s["nav"]["r"] + matrix @ LEVER
    v = s["nav"]["v"] + matrix @ np.cross(w, LEVER) - np.cross(turning, matrix @ LEVER)
    return x, v


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
        row["signal"] = [12593, 12594, 0]
        row["seen"] = 1
        row["position"] = x + 2.2e7 * direction
        row["velocity"] = random.normal(size=3) * 2000.0
        row["clock"], row["drift"] = random.normal() * 1e4, random.normal() * 0.01
        row["elevation"] = np.arcsin(direction @ up)
        row["cn0"] = 45.0
        row["group_delay"][:2] = random.normal(size=2)
        row["ionosphere"][:2] = random.uniform(1.0, 5.0, size=2)
        row["hydrostatic"], row["wet"], row["shapiro"] = 2.5, 0.2, 0.01
        row["range_std"] = 2.0
        row["lock_lost"] = 0
        for name in ("code", "phase", "range_rate"):
            row[name] = np.nan
    return rows


def ranges(s, rows):
    """Range and the clock of its system, by state."""
    x, _ = antenna_of(s)
    return np.linalg.norm(rows["position"] - x, axis=1) + s["aux"][rows["system"]]


def range_rates(s, rows):
    """Rate in time of reception, by bringing both ends forward by a moment.

    A signal received dt later was emitted later by dt less the growth of its travel
    time, and the Earth turns meanwhile by as much less.
    """
    x, v = antenna_of(s)
    h = 1e-3
    found = []
    for row in rows:
        travel = np.linalg.norm(row["position"] - x) / C
        values = []
        for dt in (-h, h):
            grown = 0.0
            for _ in range(5):
                at = row["position"] + row["velocity"] * (dt - grown)
                angle = EARTH_RATE * grown
                at = at + np.array([angle * at[1], -angle * at[0], 0.0])
                grown = np.linalg.norm(at - (x + v * dt)) / C - travel
            values.append((grown + travel) * C)
        found.append((values[1] - values[0]) / (2.0 * h))
    return np.array(found) + s["aux"][DRIFT]


def changes(s, rows, earlier):
    """Change of a phase: range now less range at the cloned place, and the clock's change."""
    x, _ = antenna_of(s)
    now = np.linalg.norm(rows["position"] - x, axis=1)
    then = np.linalg.norm(earlier - s["aux"][CLONE : CLONE + 3], axis=1)
    return now - then + s["aux"][CHANGE]


def correct(s, dx):
    """Feed back a correction of all states in use."""
    padded = np.append(dx, np.zeros(TIGHT_STATES - COUNT))
    update.feed_back(s, config(), padded, np.zeros((2, 4)))


def sensitivities(measure):
    """Central differences of a measurement over every state, as `feed_back` changes it."""
    columns = []
    for j in range(COUNT):
        values = []
        for sign in (1.0, -1.0):
            s, _ = filter_state()
            dx = np.zeros(COUNT)
            dx[j] = sign * STEPS[j]
            correct(s, dx)
            values.append(measure(s))
        columns.append((values[0] - values[1]) / (2.0 * STEPS[j]))
    return np.stack(columns, axis=1)


def dense_update(P, H, z, variance):
    """Correction and covariance of all measurements at once."""
    S = H @ P @ H.T + np.diag(variance)
    K = np.linalg.solve(S, H @ P).T
    whole = np.eye(len(P)) - K @ H
    return K @ z, whole @ P @ whole.T + K @ np.diag(variance) @ K.T


def assert_states_equal(s, wanted, tolerance=1e-6):
    """Two states, in deviations of each error state."""
    for name, first in (("bg", 9), ("ba", 12), ("sg", 15), ("sa", 18), ("mount", 21)):
        scale = DEVIATIONS[first]
        np.testing.assert_allclose(s[name], wanted[name], rtol=0, atol=tolerance * scale)
    np.testing.assert_allclose(s["nav"]["r"], wanted["nav"]["r"], rtol=0, atol=tolerance * 3)
    np.testing.assert_allclose(s["nav"]["v"], wanted["nav"]["v"], rtol=0, atol=tolerance)
    np.testing.assert_allclose(s["nav"]["C"], wanted["nav"]["C"], rtol=0, atol=tolerance * 1e-4)
    np.testing.assert_allclose(s["aux"], wanted["aux"], rtol=0, atol=tolerance * 3)


def run_codes(s, g, tcfg, rows):
    cfg, work = config(), workspace(s)
    x, v, u = np.zeros(3), np.zeros(3), np.zeros(3)
    found = np.zeros(64, dtype=RESIDUAL_DTYPE)
    counts, weight = np.zeros(2, dtype=np.int64), np.zeros(SATELLITES)
    antenna_measures.antenna(s, work, tcfg["lever"], x, v)
    tight_update.use_codes(s, g, cfg, tcfg, work, EPOCH[0], rows, weight, x, u, found, counts)
    return found[: counts[0]]


def run_dopplers(s, g, tcfg, rows):
    cfg, work = config(), workspace(s)
    x, v, u, scratch = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(SATELLITES)
    found, counts = np.zeros(64, dtype=RESIDUAL_DTYPE), np.zeros(2, dtype=np.int64)
    antenna_measures.antenna(s, work, tcfg["lever"], x, v)
    tight_update.use_dopplers(
        s, g, cfg, tcfg, work, EPOCH[0], rows, x, v, u, scratch, found, counts
    )
    return found[: counts[0]]


def run_changes(s, g, tcfg, rows):
    cfg, work = config(), workspace(s)
    x, v, u = np.zeros(3), np.zeros(3), np.zeros(3)
    scratch = np.zeros(3 * SATELLITES)
    found, counts = np.zeros(64, dtype=RESIDUAL_DTYPE), np.zeros(2, dtype=np.int64)
    antenna_measures.antenna(s, work, tcfg["lever"], x, v)
    tight_phases.use_phase_changes(
        s, g, cfg, tcfg, work, EPOCH[0], rows, x, u, scratch, found, counts
    )
    return found[: counts[0]]


def corrections(rows, slot=0):
    """What a pseudorange has beside range and receiver clock."""
    air = rows["hydrostatic"] + rows["wet"] + rows["shapiro"] + rows["ionosphere"][:, slot]
    return air + rows["group_delay"][:, slot] - rows["clock"]


def test_antenna():
    s, _ = filter_state()
    x, v = np.zeros(3), np.zeros(3)
    antenna_measures.antenna(s, workspace(s), settings()["lever"], x, v)
    wanted = antenna_of(s)
    np.testing.assert_allclose(x, wanted[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(v, wanted[1], rtol=0, atol=1e-9)


def test_ranges_are_used_as_all_at_once():
    """Rows, clocks and one-by-one use, against differences of the range and the dense update."""
    s, g = filter_state()
    rows = satellites(s)
    errors = np.random.default_rng(1).normal(size=len(rows)) * 5.0
    rows["code"][:, 0] = ranges(s, rows) + corrections(rows) + errors
    H = sensitivities(lambda state: ranges(state, rows))
    before = s["P"][:COUNT, :COUNT].copy()
    tcfg = settings(code_gate=0.0)
    found = run_codes(s, g, tcfg, rows)
    assert found["accepted"].all()
    assert found["satellite"].tolist() == rows["satellite"].tolist()
    dx, P = dense_update(before, H, errors, found["r"] ** 2)
    wanted, _ = filter_state()
    correct(wanted, dx)
    assert_states_equal(s, wanted)
    scale = np.outer(DEVIATIONS, DEVIATIONS)
    np.testing.assert_allclose(s["P"][:COUNT, :COUNT] / scale, P / scale, rtol=0, atol=1e-6)
    # The first innovation is told with its own deviation.
    assert found["z"][0] == pytest.approx(errors[0], abs=1e-6)
    assert found["s"][0] == pytest.approx(np.sqrt(H[0] @ before @ H[0] + found["r"][0] ** 2))


def test_range_rates_are_used_as_all_at_once():
    s, g = filter_state()
    rows = satellites(s)
    errors = np.random.default_rng(2).normal(size=len(rows)) * 0.2
    rows["code"][:, 0] = 2.2e7
    rows["range_rate"][:, 0] = range_rates(s, rows) - rows["drift"] + errors
    H = sensitivities(lambda state: range_rates(state, rows))
    # The row leaves out how the line of sight turns with the position, and the Earth's rate
    # times the lever arm (1e-4 m/s per rad).
    assert np.abs(H[:, :3]).max() < 2e-4
    H[:, :3] = 0.0
    before = s["P"][:COUNT, :COUNT].copy()
    found = run_dopplers(s, g, settings(doppler_gate=0.0), rows)
    assert found["accepted"].all()
    dx, P = dense_update(before, H, errors, found["r"] ** 2)
    wanted, _ = filter_state()
    correct(wanted, dx)
    assert_states_equal(s, wanted, tolerance=5e-4)
    scale = np.outer(DEVIATIONS, DEVIATIONS)
    np.testing.assert_allclose(s["P"][:COUNT, :COUNT] / scale, P / scale, rtol=0, atol=5e-4)


def phases(s, g, rows, errors):
    """Phases of two epochs that fit a state, but for `errors` (m) of the two slots."""
    random = np.random.default_rng(6)
    earlier = rows["position"] - rows["velocity"]
    for slot in range(2):
        air = rows["hydrostatic"] + rows["wet"] + rows["shapiro"] - rows["ionosphere"][:, slot]
        ambiguity = random.uniform(1e6, 2e7, size=len(rows))
        change = changes(s, rows, earlier)
        rows["phase"][:, slot] = ambiguity + change + air - rows["clock"] + errors[slot]
        g["earlier"]["phase"][rows["satellite"], slot] = ambiguity
    for row, place in zip(rows, earlier, strict=True):
        one = g["earlier"][row["satellite"]]
        one["t"] = g["epoch_t"]
        one["signal"] = row["signal"]
        one["position"] = place
    return earlier


def test_changes_of_phase_are_used_as_all_at_once():
    """Both ends of the way have a sensitivity: where the antenna is and where it was."""
    s, g = filter_state()
    rows = satellites(s)
    errors = np.random.default_rng(5).normal(size=(2, len(rows))) * 0.01
    s["aux"][CHANGE] = 40.0
    earlier = phases(s, g, rows, errors)
    H = sensitivities(lambda state: changes(state, rows, earlier))
    # One line of sight serves both ends: a satellite's is turned by some 1e-4 in a second.
    there = H[:, INERTIAL + CLONE : INERTIAL + CLONE + 3]
    assert np.abs(there + H[:, :3]).max() < 3e-4
    there[:] = -H[:, :3]
    before = s["P"][:COUNT, :COUNT].copy()
    before[INERTIAL + CHANGE] = 0.0
    before[:, INERTIAL + CHANGE] = 0.0
    before[INERTIAL + CHANGE, INERTIAL + CHANGE] = 100.0
    found = run_changes(s, g, settings(phase_gate=0.0), rows)
    assert len(found) == 2 * len(rows)
    assert found["accepted"].all()
    # The clock's change starts from the middle of all.
    middle = np.median(errors)
    z = (errors - middle).T.reshape(-1)
    dx, P = dense_update(before, np.repeat(H, 2, axis=0), z, found["r"] ** 2)
    wanted, _ = filter_state()
    wanted["aux"][CHANGE] = 40.0 + middle
    correct(wanted, dx)
    assert_states_equal(s, wanted)
    scale = np.outer(DEVIATIONS, DEVIATIONS)
    np.testing.assert_allclose(s["P"][:COUNT, :COUNT] / scale, P / scale, rtol=0, atol=1e-6)


@pytest.mark.parametrize("why", ["lock", "signal", "gap", "epoch", "nan"])
def test_a_phase_that_does_not_go_on_is_not_differenced(why):
    s, g = filter_state()
    rows = satellites(s)
    phases(s, g, rows, np.zeros((2, len(rows))))
    before = s["P"].copy()
    lost = rows["satellite"][2]
    if why == "lock":
        rows["lock_lost"][2] = [1, 0, 0]
    elif why == "signal":
        g["earlier"]["signal"][lost, 0] = 12600
    elif why == "epoch":
        g["earlier"]["t"][lost] -= SECOND
    elif why == "nan":
        rows["phase"][2, 0] = np.nan
    else:
        g["clone_t"] -= 5 * SECOND
    found = run_changes(s, g, settings(), rows)
    if why == "gap":
        assert len(found) == 0
        assert np.array_equal(s["P"], before)
    else:
        gone = 2 if why == "epoch" else 1
        assert len(found) == 2 * len(rows) - gone
        assert (found["satellite"] == lost).sum() == 2 - gone


def test_a_late_range_is_gated_and_changes_nothing():
    """100 m of detour on one satellite: refused, and the rest are used as if it were not there."""
    s, g = filter_state()
    s["P"][:COUNT, :COUNT] = np.diag(np.diag(s["P"][:COUNT, :COUNT]))
    rows = satellites(s)
    rows["code"][:, 0] = ranges(s, rows) + corrections(rows)
    rows["code"][3, 0] += 100.0
    found = run_codes(s, g, settings(), rows)
    assert found["accepted"].tolist() == [1, 1, 1, 0, 1, 1, 1, 1]
    other, g = filter_state()
    other["P"][:COUNT, :COUNT] = np.diag(np.diag(other["P"][:COUNT, :COUNT]))
    run_codes(other, g, settings(), np.delete(rows, 3))
    assert s.tobytes() == other.tobytes()


def test_the_cloned_place_has_the_antennas_covariance():
    """P of the grown state is G P G', whatever the clone held before."""
    s, g = filter_state()
    before = s["P"][:COUNT, :COUNT].copy()
    rows = satellites(s)
    x = antenna_of(s)[0]
    tight_phases.remember(s, g, config(), settings(), workspace(s), EPOCH[0], rows, x)
    G = np.eye(COUNT)
    place = slice(INERTIAL + CLONE, INERTIAL + CLONE + 3)
    G[place] = sensitivities(lambda state: antenna_of(state)[0])
    wanted = G @ before @ G.T
    after = s["P"][:COUNT, :COUNT]
    scale = np.outer(DEVIATIONS, DEVIATIONS)
    np.testing.assert_allclose(after / scale, wanted / scale, rtol=0, atol=1e-7)
    assert np.array_equal(after, after.T)
    assert np.array_equal(s["aux"][CLONE : CLONE + 3], x)
    assert g["clone_t"] == s["t"]
    # The way from the clone to the antenna is none, and known to be none.
    way = sensitivities(lambda state: antenna_of(state)[0] - state["aux"][CLONE : CLONE + 3])
    assert np.abs(way @ after @ way.T).max() < 1e-9


@pytest.mark.parametrize("dt", [0.01, 1.0, 7.0])
def test_clocks_are_carried_by_their_drift(dt):
    s, g = filter_state()
    tcfg = settings(clock_noise=0.3, drift_noise=0.07)
    before, aux = s["P"][:COUNT, :COUNT].copy(), s["aux"].copy()
    s["t"] += round(dt * 1e9)
    tight.carry_clocks(s, g, config(), tcfg, no_trail())
    first = INERTIAL + CLOCK
    clocks = np.arange(first, first + SYSTEMS)
    drift = INERTIAL + DRIFT
    F, Q = np.eye(COUNT), np.zeros((COUNT, COUNT))
    F[clocks, drift] = dt
    Q[np.ix_(clocks, clocks)] = 0.3 * dt + 0.07 * dt**3 / 3.0
    Q[clocks, clocks] += 1e-6 * dt  # what tells the systems' clocks apart
    Q[clocks, drift] = Q[drift, clocks] = 0.07 * dt**2 / 2.0
    Q[drift, drift] = 0.07 * dt
    after = s["P"][:COUNT, :COUNT]
    scale = np.outer(DEVIATIONS, DEVIATIONS)
    wanted = (F @ before @ F.T + Q) / scale
    np.testing.assert_allclose(after / scale, wanted, rtol=1e-12, atol=1e-12)
    assert np.array_equal(after, after.T)
    aux[:SYSTEMS] += dt * aux[DRIFT]
    np.testing.assert_allclose(s["aux"], aux, rtol=1e-14)
    assert g["clock_t"] == s["t"]
    # And not twice.
    tight.carry_clocks(s, g, config(), tcfg, no_trail())
    assert np.array_equal(s["P"][:COUNT, :COUNT], after)


@pytest.mark.parametrize(("shift", "late", "told"), [(10.0, 0, 10.0), (299792.458, 1, 299792.458)])
def test_a_clock_that_was_set_is_found(shift, late, told):
    """All ranges longer by as much, one of them late by 100 m besides."""
    s, g = filter_state()
    know_clocks(s, 1.0)
    rows = satellites(s)
    rows["code"][:, 0] = ranges(s, rows) + corrections(rows) + shift
    rows["code"][:late, 0] += 100.0
    aux = s["aux"].copy()
    x = antenna_of(s)[0]
    found = tight_update.meet_clocks(
        s, g, config(), settings(), rows, x, np.zeros(3), np.zeros(SATELLITES), no_trail()
    )
    assert found == pytest.approx(told, abs=1e-3)
    np.testing.assert_allclose(s["aux"][:SYSTEMS], aux[:SYSTEMS] + told, atol=1e-3)
    P = s["P"][INERTIAL : INERTIAL + SYSTEMS, :COUNT]
    assert np.array_equal(P[:, INERTIAL : INERTIAL + SYSTEMS], 1e6 * np.eye(SYSTEMS))


def know_clocks(s, sigma):
    """Clocks of a deviation (m) each, independent of all else."""
    clocks = slice(INERTIAL, INERTIAL + SYSTEMS)
    s["P"][clocks, :COUNT] = 0.0
    s["P"][:COUNT, clocks] = 0.0
    s["P"][clocks, clocks] = sigma * sigma * np.eye(SYSTEMS)


@pytest.mark.parametrize(("sigma", "told"), [(2.4, 10.0), (2.6, 0.0)])
def test_a_clock_that_drifted_is_no_set_clock(sigma, told):
    """10 m are a jump for a clock known to four deviations less, and its own error for another."""
    s, g = filter_state()
    know_clocks(s, sigma)
    rows = satellites(s)
    rows["code"][:, 0] = ranges(s, rows) + corrections(rows) + 10.0
    x = antenna_of(s)[0]
    found = tight_update.meet_clocks(
        s, g, config(), settings(), rows, x, np.zeros(3), np.zeros(SATELLITES), no_trail()
    )
    assert found == pytest.approx(told, abs=1e-3)


def test_late_ranges_are_no_set_clock():
    """Five of eight satellites reflected, late by different lengths."""
    s, g = filter_state()
    rows = satellites(s)
    rows["code"][:, 0] = ranges(s, rows) + corrections(rows)
    rows["code"][:5, 0] += [8.0, 15.0, 40.0, 70.0, 120.0]
    before = s.tobytes()
    x = antenna_of(s)[0]
    found = tight_update.meet_clocks(
        s, g, config(), settings(), rows, x, np.zeros(3), np.zeros(SATELLITES), no_trail()
    )
    assert found == 0.0
    assert s.tobytes() == before


def test_the_time_of_an_epoch_is_its_reading_less_the_clock():
    """The filter's clock, carried by its drift; a coarse one only where the receiver set it."""
    s, g = filter_state()
    epoch = np.zeros(1, dtype=EPOCH_DTYPE)[0]
    epoch["t"] = s["t"] + 2 * SECOND
    expected = s["aux"][0] + 2.0 * s["aux"][DRIFT]
    assert tight.epoch_time(s, g, epoch) == epoch["t"] - round(expected / C * 1e9)
    epoch["placed"], epoch["clock"] = 1, expected + 200.0
    assert tight.epoch_time(s, g, epoch) == epoch["t"] - round(expected / C * 1e9)
    epoch["clock"] = expected + 299792.458
    assert tight.epoch_time(s, g, epoch) == epoch["t"] - round(epoch["clock"] / C * 1e9)
    g["known"] = 0
    epoch["clock"] = 50.0
    assert tight.epoch_time(s, g, epoch) == epoch["t"] - round(50.0 / C * 1e9)
    epoch["placed"] = 0
    assert tight.epoch_time(s, g, epoch) == epoch["t"]
