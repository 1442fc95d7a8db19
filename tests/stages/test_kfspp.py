"""The filter of single points against one in numpy, and what it does when data misbehave."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pymap3d
import pytest
from scipy.stats import chi2

from replay import channels
from replay.errors import ConfigurationError
from replay.gnss.measurements import gather_epochs, select_signals
from replay.schemas import filter_pb2, solution_pb2
from replay.stages.base import Context
from replay.stages.kfspp import FilteredSinglePoint
from tests.simulate.observing import DRIVE, START_NS, C, base, make, receiver
from tests.stages.gnss_chain import (
    CLOCKS,
    COARSE,
    CORRECTIONS,
    EVENTS,
    OBS,
    RESIDUALS,
    SATELLITES,
    SOLUTION,
    edited,
    inputs_of,
    kfspp_config,
    run,
    solve,
    times_of,
    with_sights,
)

SECOND = 1_000_000_000
CLOCK = {"bias": "0.2 ms", "drift": "0.3 ppm", "walk": 1e-10}
NOISE = {"code": 0.5, "rate": 0.03}
PLAIN = {
    "atmosphere": {"shapiro": False},
    "spp": {"weighting": "sine", "range_std_scale": 0.0, "ionosphere_std": 0.0,
            "troposphere_std": 0.0, "system_scale": [1.0]},
    "kfspp": {"code_sigma": 0.5, "doppler_sigma": 0.03, "gate": 0.0},
}  # fmt: skip
EARTH_RATE = 7.2921151467e-5


@functools.cache
def driven():
    """A noisy drive of half a minute, with its sights."""
    made = make(receiver(clock=CLOCK, noise=NOISE), segments=DRIVE)
    inputs = inputs_of(made.rows)
    return made, inputs, with_sights(inputs, kfspp_config(PLAIN))


class Textbook:
    """An extended Kalman filter with dense matrices (Gelb 1974, table 6.1-1)."""

    def __init__(self, config, epoch):
        self.config = config
        self.x = np.zeros(16)
        self.x[:3], self.x[6:11] = epoch["x"], epoch["clock"]
        self.P = np.diag([1e4] * 6 + [1e8] * 5 + [1e6] * 5)
        self.time_ns = epoch["t"] - round(epoch["clock"] / C * 1e9)
        self.met = np.zeros(5, dtype=bool)

    def predict(self, to_ns):
        dt = (to_ns - self.time_ns) * 1e-9
        self.time_ns = to_ns
        F, Q = np.eye(16), np.zeros((16, 16))
        own = self.config.kfspp
        pairs = [(i, 3 + i, 0.0, own.velocity_noise) for i in range(3)]
        pairs += [(6 + i, 11 + i, own.clock_noise, own.drift_noise) for i in range(5)]
        for value, rate, q0, q1 in pairs:
            F[value, rate] = dt
            Q[value, value] = q0 * dt + q1 * dt**3 / 3
            Q[value, rate] = Q[rate, value] = q1 * dt**2 / 2
            Q[rate, rate] = q1 * dt
        self.x = F @ self.x
        self.P = F @ self.P @ F.T + Q

    def scalar(self, z, H, variance):
        S = H @ self.P @ H + variance
        K = self.P @ H / S
        self.x = self.x + K * z
        L = np.eye(16) - np.outer(K, H)
        self.P = L @ self.P @ L.T + variance * np.outer(K, K)

    def line(self, row):
        away = row["position"] - self.x[:3]
        distance = np.linalg.norm(away)
        return distance, away / distance

    def code(self, row):
        system = row["system"]
        distance, u = self.line(row)
        told = row["code"][0] + row["clock"] - row["group_delay"][0] - row["ionosphere"][0]
        told -= row["hydrostatic"] + row["wet"] + row["shapiro"]
        if not self.met[system]:
            # A clock that nothing has measured: where the first range says, unknown.
            self.met[system] = True
            self.x[6 + system], self.x[11 + system] = told - distance, 0.0
            for k in (6 + system, 11 + system):
                self.P[k, :] = self.P[:, k] = 0.0
            self.P[6 + system, 6 + system], self.P[11 + system, 11 + system] = 1e8, 1e6
        H = np.zeros(16)
        H[:3], H[6 + system] = -u, 1.0
        variance = (self.config.kfspp.code_sigma / np.sin(row["elevation"])) ** 2
        self.scalar(told - distance - self.x[6 + system], H, variance)

    def rate(self, row):
        system = row["system"]
        _, u = self.line(row)
        p, w, v = row["position"], row["velocity"], self.x[3:6]
        # Range rate by reception's time, solved for itself: transmission's time runs with it.
        rate = 0.0
        for _ in range(5):
            turned = np.array([p[1], -p[0], 0.0]) * EARTH_RATE * rate / C
            rate = u @ (w * (1.0 - rate / C) + turned - v)
        H = np.zeros(16)
        H[3:6], H[11 + system] = -u, 1.0
        variance = (self.config.kfspp.doppler_sigma / np.sin(row["elevation"])) ** 2
        told = row["range_rate"][0] + row["drift"]
        self.scalar(told - rate - self.x[11 + system], H, variance)


def test_it_is_the_textbooks_filter():
    _, inputs, sights = driven()
    config = kfspp_config(PLAIN)
    solution = run(FilteredSinglePoint(), config, sights).outputs[SOLUTION]
    found = gather_epochs(
        inputs[OBS], select_signals(config.gnss.signals, config.gnss.systems),
        sights[SATELLITES], sights[CORRECTIONS], sights[COARSE],
    )  # fmt: skip
    book = Textbook(config, found.epochs[0])
    assert len(solution) == len(found.epochs) > 30
    for k, epoch in enumerate(found.epochs):
        if k:
            reference = int(np.flatnonzero(book.met)[0])
            clock, drift = book.x[6 + reference], book.x[11 + reference]
            dt = (epoch["t"] - round(clock / C * 1e9) - book.time_ns) * 1e-9
            book.predict(epoch["t"] - round((clock + drift * dt) / C * 1e9))
        rows = found.rows[epoch["first"] : epoch["first"] + epoch["count"]]
        rows = rows[(rows["seen"] == 1) & (rows["elevation"] >= config.gnss.mask)]
        for row in rows:
            book.code(row)
        for row in rows:
            book.rate(row)
        assert abs(solution.valid_time_ns[k] - book.time_ns) <= 1
        assert np.abs(solution["position_ecef_m"][k] - book.x[:3]).max() < 1e-6
        lat, lon, _ = pymap3d.ecef2geodetic(*book.x[:3])
        axes = np.stack(pymap3d.ecef2enuv(*np.eye(3), lat, lon))
        np.testing.assert_allclose(solution["velocity_enu_m_s"][k], axes @ book.x[3:6], atol=1e-6)
        covariance = (axes @ book.P[:3, :3] @ axes.T)[np.triu_indices(3)]
        np.testing.assert_allclose(
            solution["position_covariance_enu_m2"][k], covariance, rtol=1e-5, atol=1e-6
        )
        std = np.sqrt(np.diag(axes @ book.P[3:6, 3:6] @ axes.T))
        np.testing.assert_allclose(solution["velocity_std_enu_m_s"][k], std, rtol=1e-6)


def outputs(inputs, *tables):
    return solve(inputs, kfspp_config(PLAIN, *tables))


def seconds(columns):
    return np.round((columns.valid_time_ns - START_NS) / 1e9).astype(int)


def test_at_rest_the_error_shrinks_as_the_filter_says():
    made = make(base(clock=CLOCK, noise=NOISE), segments=[{"kind": "hold", "duration": 60.0}])
    truth = made.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    found = outputs(inputs_of(made.rows, "base"), {"kfspp": {"velocity_noise": 1e-4}})[SOLUTION]
    lat, lon, _ = pymap3d.ecef2geodetic(*truth)
    enu = np.stack(pymap3d.ecef2enuv(*(found["position_ecef_m"] - truth).T, lat, lon), axis=1)
    covariance = found["position_covariance_enu_m2"][:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    squares = np.einsum("ni,nij,nj->n", enu, np.linalg.inv(covariance), enu)
    assert squares.max() < chi2.ppf(1.0 - 1e-5, 3)
    std = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    assert std[-1] < 0.4 * std[0]
    assert np.linalg.norm(enu[-1]) < 0.5 * std[0]
    assert np.abs(found["velocity_enu_m_s"][-20:]).max() < 0.03


def test_without_ranges_it_is_predicted():
    _, inputs, _ = driven()
    elapsed = np.round((inputs[OBS].valid_time_ns - START_NS) / 1e9)
    weak = (elapsed >= 15) & (elapsed < 20)
    cn0 = np.where(weak, 10.0, inputs[OBS]["cn0_dbhz"])
    dark = {**inputs, OBS: edited(inputs[OBS], cn0_dbhz=cn0)}
    found = outputs(dark, {"gnss": {"cn0_mask": 25.0}})
    solution, when = found[SOLUTION], seconds(found[SOLUTION])
    predicted = solution["status"] == solution_pb2.SOLUTION_STATUS_PREDICTED
    assert when[predicted].tolist() == [15, 16, 17, 18, 19]
    assert (solution["status"][~predicted] == solution_pb2.SOLUTION_STATUS_SINGLE).all()
    # On a straight line at constant velocity, ever less certain.
    first = int(np.flatnonzero(predicted)[0]) - 1
    lat, lon, _ = pymap3d.ecef2geodetic(*solution["position_ecef_m"][first])
    step = solution["velocity_enu_m_s"][first]
    for k in range(1, 6):
        dt = (solution.valid_time_ns[first + k] - solution.valid_time_ns[first]) / 1e9
        expected = np.array(pymap3d.enu2uvw(*(step * dt), lat, lon))
        moved = solution["position_ecef_m"][first + k] - solution["position_ecef_m"][first]
        np.testing.assert_allclose(moved, expected, atol=1e-6)
    up = solution["position_covariance_enu_m2"][first : first + 6, 5]
    assert (np.diff(up) > 0.0).all()
    assert solution["position_covariance_enu_m2"][first + 6, 5] < up[-1]


def test_a_gap_begins_it_anew():
    _, inputs, _ = driven()
    when = np.round((inputs[OBS].valid_time_ns - START_NS) / 1e9)
    for gap, resets in ((9, 0), (12, 1)):
        kept = inputs[OBS].take((when < 10) | (when >= 10 + gap - 1))
        found = outputs({**inputs, OBS: kept})
        events = found[EVENTS]["kind"].tolist() if EVENTS in found else []
        assert events == [filter_pb2.EVENT_KIND_RESET] * resets
        if resets:
            assert found[EVENTS]["value"][0] == pytest.approx(gap, abs=1e-3)
            # As certain as at its very beginning, and no more.
            solution = found[SOLUTION]
            at = int(np.flatnonzero(seconds(solution) == 10 + gap - 1)[0])
            first, again = solution["position_covariance_enu_m2"][[0, at]]
            np.testing.assert_allclose(again, first, rtol=0.3, atol=0.05)


def test_a_clock_that_is_set_does_not_move_the_place():
    jumpy = {"bias": "0.45 ms", "drift": "5 ppm", "jumps": True, "reported": True}
    made = make(base(clock=jumpy, noise=NOISE))
    truth = made.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    found = outputs(inputs_of(made.rows, "base"))
    clock = made.epochs("base")["clock_offset_s"]
    jump = int(np.flatnonzero(np.abs(np.diff(clock)) > 5e-4)[0]) + 1
    events = found[EVENTS]
    assert events["kind"].tolist() == [filter_pb2.EVENT_KIND_CLOCK_JUMP]
    assert events["value"][0] == pytest.approx(-1e-3 * C, abs=2.0)
    assert events.valid_time_ns[0] == made.epochs("base").valid_time_ns[jump]
    solution = found[SOLUTION]
    assert len(solution) == len(clock)
    assert np.linalg.norm(solution["position_ecef_m"] - truth, axis=1).max() < 3.0
    true_ns = made.epochs("base").valid_time_ns - 1e9 * clock
    assert np.abs(solution.valid_time_ns - true_ns).max() < 10.0
    gps = np.array(found[CLOCKS].ragged("system").texts()) == "G"
    np.testing.assert_allclose(found[CLOCKS]["offset_m"][gps], C * clock, atol=3.0)


def test_an_epoch_that_comes_late_is_told_and_left_out():
    _, _, sights = driven()
    config = kfspp_config(PLAIN)
    times = times_of(sights[OBS])
    moved, without = {}, {}
    for name, columns in sights.items():
        late = columns.valid_time_ns == times[10]
        log = np.where(late, times[12] + 1, columns.log_time_ns)
        shifted = dataclasses.replace(columns, log_time_ns=log)
        moved[name] = shifted.take(np.argsort(log, kind="stable").astype(np.int64))
        without[name] = columns.take(~late)
    found = run(FilteredSinglePoint(), config, moved).outputs
    assert found[EVENTS]["kind"].tolist() == [filter_pb2.EVENT_KIND_TIME_BACKWARD]
    assert found[EVENTS]["value"][0] == pytest.approx(-2.0, abs=1e-3)
    expected = run(FilteredSinglePoint(), config, without).outputs
    for name in ("position_ecef_m", "position_covariance_enu_m2"):
        assert found[SOLUTION][name].tobytes() == expected[SOLUTION][name].tobytes()


def test_outliers_do_not_pass_the_gate():
    _, inputs, _ = driven()
    usual = outputs(inputs, {"kfspp": {"gate": 5.0}})
    names, counts = np.unique(usual[RESIDUALS]["satellite"], return_counts=True)
    name = names[np.argmax(counts)]
    later = inputs[OBS].valid_time_ns > START_NS + 10 * SECOND
    bad = later & (inputs[OBS]["satellite"] == name)
    code = inputs[OBS]["pseudorange_m"] + np.where(bad, 50.0, 0.0)
    found = outputs(
        {**inputs, OBS: edited(inputs[OBS], pseudorange_m=code)}, {"kfspp": {"gate": 5.0}}
    )
    rows = found[RESIDUALS]
    own = (rows["satellite"] == name) & (rows["kind"] == filter_pb2.MEASUREMENT_KIND_PSEUDORANGE)
    own &= rows.valid_time_ns > START_NS + 10 * SECOND
    assert own.any()
    assert not rows["accepted"][own].any()
    away = found[SOLUTION]["position_ecef_m"] - usual[SOLUTION]["position_ecef_m"]
    assert np.abs(away).max() < 1.0


def test_the_ionosphere_free_pair_serves_the_filter_too():
    made = make(base(clock=CLOCK), sky={"ionosphere": {"scale": 3.0}})
    truth = made.rows[channels.RECEIVER.at(receiver="base")]["approximate_position_ecef_m"][0]
    inputs = inputs_of(made.rows, "base")
    none = {"atmosphere": {"ionosphere": "none"}}
    biased = outputs(inputs, none)[SOLUTION]["position_ecef_m"][-1]
    free = outputs(inputs, none, {"spp": {"ionosphere_free": True}})[SOLUTION]["position_ecef_m"]
    assert np.linalg.norm(biased - truth) > 2.0
    assert np.linalg.norm(free[-1] - truth) < 0.05


def test_a_system_that_comes_late_is_met_like_the_first():
    """A quarter of an hour of GPS alone; then the clock of Galileo is known as GPS's was."""
    hold = [{"kind": "hold", "duration": 900.0}]
    made = make(base(clock=CLOCK, noise=NOISE), segments=hold)
    inputs = inputs_of(made.rows, "base")
    rows = inputs[OBS]
    early = rows.valid_time_ns < START_NS + 890 * SECOND
    letters = rows["satellite"].astype("S1")
    keep = (letters == b"G") | (~early & (letters == b"E"))
    found = outputs({**inputs, OBS: rows.take(keep)})
    systems = np.array(found[CLOCKS].ragged("system").texts())
    galileo = np.flatnonzero(systems == "E")
    assert len(galileo) >= 9
    # Its clock is GPS's, in this sky.
    last = {letter: found[CLOCKS]["offset_m"][systems == letter][-1] for letter in "GE"}
    assert last["E"] == pytest.approx(last["G"], abs=2.0)
    std = found[CLOCKS]["offset_std_m"][galileo]
    assert (std > 0.0).all()
    assert std[0] < 2.0


def test_blocks_and_dumps_change_nothing():
    _, _, sights = driven()
    config = kfspp_config(PLAIN, {"kfspp": {"gate": 3.0}})
    whole = run(FilteredSinglePoint(), config, sights)
    times = times_of(sights[OBS])
    rng = np.random.default_rng(3)
    for edges in (times, times[::5], times[rng.random(len(times)) < 0.3]):
        for dump_at in (None, 1, 3):
            again = run(FilteredSinglePoint(), config, sights, edges, dump_at=dump_at)
            assert again.bytes() == whole.bytes()


def test_impossible_settings_are_refused():
    with pytest.raises(ConfigurationError, match="no satellite"):
        FilteredSinglePoint().start(kfspp_config({"gnss": {"exclude": ["X01"]}}), Context({}, {}))
