"""Tightly coupled PPP/INS over short drives of which everything is known."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np
import pymap3d
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp
from scipy.stats import chi2

from replay import channels, configuration
from replay.errors import ConfigurationError
from replay.log.columns import Columns
from replay.schemas import filter_pb2, solution_pb2
from replay.simulate import read_scenario
from replay.simulate.defaults import fitting_defaults
from replay.simulate.write import make_all
from replay.stages.base import Context
from replay.stages.ppp_ins_config import PppInsConfig
from replay.stages.ppp_ins_tc import PppInertial
from replay.stages.satellites import Satellites
from tests.simulate import observing
from tests.stages.gnss_chain import Ran, edited, logged, run

MM = 1e-3
NS = 1_000_000_000
LIGHT_MS = 299792.458
LEVER = np.array([-0.4, 0.15, -1.2])
SIGNALS = ("G1C", "G2W", "E1C", "E7Q")
FLOAT = solution_pb2.SOLUTION_STATUS_FLOAT
UPDATED = solution_pb2.SOLUTION_STATUS_UPDATED
OBS = channels.GNSS_OBS.name
START_S = 9.0  # the vehicle rests before
TURNS = [
    {"kind": "hold", "duration": START_S},
    {"kind": "speed", "to": 12.0, "acceleration": 2.0},
    {"kind": "turn", "angle": "90 deg", "radius": 40.0},
    {"kind": "straight", "duration": 6.0},
    {"kind": "turn", "angle": "-120 deg", "radius": 30.0},
    {"kind": "speed", "to": 6.0},
    {"kind": "speed", "to": 14.0},
    {"kind": "turn", "angle": "60 deg", "radius": 50.0},
    {"kind": "straight", "duration": 30.0},
    {"kind": "turn", "angle": "90 deg", "radius": 40.0},
    {"kind": "straight", "duration": 8.0},
]
QUIET = {"code": 0.3, "carrier": 0.002, "rate": 0.03}
WHITE = {"gyro_noise": "0.15 deg/sqrt(h)", "accel_noise": "0.02 m/s/sqrt(h)"}


@dataclasses.dataclass(frozen=True)
class Drive:
    """Inputs of the pipeline's last stage, and the truth."""

    inputs: dict[str, Columns]
    truth: Columns
    defaults: dict[str, Any]


def scenario_table(noise: bool, seed: int) -> dict[str, Any]:
    """A rover with a lever arm under broadcast orbits that are exact, two epochs in a second."""
    errors = {"noise": QUIET} if noise else {}
    return {
        "seed": seed,
        "start": {"time": observing.START, **observing.HERE, "heading": "20 deg"},
        "vehicle": {"roll_per_g": 0.0, "pitch_per_g": 0.0},
        "gnss": {"fixes": False},
        "imu": {"rate": 100.0, "grade": "perfect", "errors": WHITE if noise else {}},
        "truth": {"rate": 20.0},
        "sky": observing.NO_AIR,
        "receivers": [
            observing.receiver(signals=list(SIGNALS), lever_arm=LEVER.tolist(), rate=2.0,
                               clock={"bias": "0.1 ms", "drift": "0.1 ppm"}, **errors),
        ],
        "segments": TURNS,
    }  # fmt: skip


@functools.cache
def drive(noise: bool = False, seed: int = 4) -> Drive:
    """What the pipeline's last stage reads of such a drive."""
    scenario = read_scenario(scenario_table(noise, seed))
    rows, _ = make_all(scenario)
    obs = logged(OBS, rows[channels.GNSS_OBS.at(receiver="rover")])
    read = {OBS: obs, channels.NAV.name: logged(channels.NAV.name, rows[channels.NAV.topic])}
    found = run(Satellites(), settings(), read).outputs
    inputs = {channels.IMU.name: logged(channels.IMU.name, rows[channels.IMU.topic]), OBS: obs}
    for channel in (channels.SATELLITES, channels.CORRECTIONS, channels.COARSE):
        inputs[channel.name] = logged(channel.name, found[channel.name])
    return Drive(inputs, rows[channels.TRUTH.topic], fitting_defaults(scenario.settings))


PLAIN = {
    "atmosphere": {"ionosphere": "none", "troposphere": "none", "shapiro": False},
    "stops": {"zero_velocity": False, "zero_rate": False},
    "non_holonomic": {"enabled": False},
    "imu": {"interval": 0.01},
    "antenna": {"lever_arm": LEVER.tolist()},
    # These skies do not wind phases up.
    "tight": {"wind_up": False},
    "ppp": {
        "measurements": {
            "code_sigma": [0.3], "phase_sigma": [0.002], "doppler_sigma": 0.03,
            "code_scale": [1.0], "phase_scale": [1.0], "weighting": "sine",
            "range_std_scale": 0.0,
        },
        "delays": {"wet_sigma": 1e-3, "gradients": False},
    },
}  # fmt: skip
"""Satellites and inertial sensors alone, each with the noise that it was made with."""


def settings(*tables: dict[str, Any]) -> PppInsConfig:
    return configuration.build(PppInsConfig, [PLAIN, *tables])


@dataclasses.dataclass(frozen=True)
class Errors:
    """Rows of the solution against truth: estimate less truth.

    Attributes
    ----------
    time_s : (n,), since the start
    position, velocity : (n, 3), m, ECEF, and m/s, east, north, up
    attitude : (n, 3), rad, truth less estimate about north, east, down
    """

    time_s: np.ndarray
    status: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    attitude: np.ndarray
    solution: Columns

    def epochs(self) -> np.ndarray:
        """Which rows stand at an epoch of the receiver."""
        return (self.status == FLOAT) | (self.status == UPDATED)


def compare(found: Ran, made: Drive) -> Errors:
    solution = found.outputs["SOLUTION"]
    truth = made.truth
    times = truth.valid_time_ns
    inside = (solution.valid_time_ns > times[0]) & (solution.valid_time_ns < times[-1])
    solution = solution.take(inside)
    origin = truth["position_ecef_m"][0]
    since = (times - times[0]) / NS
    curve = CubicSpline(since, truth["position_ecef_m"] - origin)
    speed = CubicSpline(since, truth["velocity_enu_m_s"])
    at = (solution.valid_time_ns - times[0]) / NS
    ours = Rotation.from_euler("ZYX", solution["attitude_rad"][:, ::-1])
    theirs = Slerp(since, Rotation.from_euler("ZYX", truth["attitude_rad"][:, ::-1]))(at)
    return Errors(
        time_s=at,
        status=solution["status"],
        position=solution["position_ecef_m"] - (curve(at) + origin),
        velocity=solution["velocity_enu_m_s"] - speed(at),
        attitude=(theirs * ours.inv()).as_rotvec(),
        solution=solution,
    )


def replay(made: Drive, *tables: dict[str, Any], inputs: Any = None, **keys: Any) -> Ran:
    config = configuration.build(
        PppInsConfig, [configuration.known_part(PppInsConfig, made.defaults), PLAIN, *tables]
    )
    return run(PppInertial(), config, inputs or made.inputs, **keys)


def local(made: Drive, found: Errors) -> np.ndarray:
    """Errors of the position in east, north, up, m."""
    latitude, longitude, _ = pymap3d.ecef2geodetic(*made.truth["position_ecef_m"][0])
    return np.array(pymap3d.uvw2enu(*found.position.T, latitude, longitude)).T


def events(found: Ran, kind: str) -> list[tuple[float, str]]:
    """Time since the start and text of events of a kind."""
    rows = found.outputs["FILTER_EVENTS"]
    mine = rows["kind"] == filter_pb2.EventKind.Value(f"EVENT_KIND_{kind}")
    times = (rows.valid_time_ns[mine] - observing.START_NS) / NS
    texts = [text for text, keep in zip(rows.ragged("detail").texts(), mine, strict=True) if keep]
    return list(zip(times.tolist(), texts, strict=True))


def seconds(rows: Columns) -> np.ndarray:
    return (rows.valid_time_ns - observing.START_NS) / NS


def without(inputs: dict[str, Columns], begin: float, end: float, keep: int = 0) -> Any:
    """Observations of `keep` satellites alone in a stretch of time (s)."""
    obs = inputs[OBS]
    times = seconds(obs)
    gone = (times >= begin) & (times < end)
    left = highest(inputs)[:keep]
    return {**inputs, OBS: obs.take(~gone | np.isin(obs["satellite"], left))}


def highest(inputs: dict[str, Columns]) -> np.ndarray:
    """Satellites of GPS, the highest first."""
    rows = inputs[channels.SATELLITES.name]
    rows = rows.take(np.char.startswith(rows["satellite"].astype(str), "G"))
    names = np.unique(rows["satellite"])
    mean = [rows["elevation_rad"][rows["satellite"] == name].mean() for name in names]
    return names[np.argsort(mean)[::-1]]


def test_without_noise_it_is_exact():
    made = drive()
    ran = replay(made)
    found = compare(ran, made)
    epochs = found.epochs() & (found.time_s > 20.0)
    assert epochs.sum() > 120
    assert (found.status[epochs] == FLOAT).all()
    # What steps of 10 ms leave while the vehicle sets out and turns is in the ambiguities.
    assert np.abs(found.position[epochs]).max() < 4 * MM
    assert np.abs(found.velocity[epochs]).max() < 2 * MM
    assert np.degrees(np.abs(found.attitude[epochs])).max() < 5e-3
    # Between epochs the inertial unit carries it: it has no noise, but its steps have a length.
    assert np.abs(found.position[found.time_s > 20.0]).max() < 5 * MM
    for kind in ("CYCLE_SLIP", "CLOCK_JUMP", "RESET"):
        assert not events(ran, kind)
    assert ran.outputs["FILTER_INNOVATIONS"]["accepted"].all()


def test_it_says_what_it_knows_of_receiver_and_sky():
    made = drive()
    outputs = replay(made).outputs
    for channel in (channels.FILTER_TROPOSPHERE, channels.FILTER_IONOSPHERE,
                    channels.FILTER_BIASES, channels.FILTER_PHASES):  # fmt: skip
        assert channel.name in outputs or channel is channels.FILTER_BIASES
    late = {name: rows.take(seconds(rows) > 60.0) for name, rows in outputs.items()}
    assert np.abs(late["FILTER_TROPOSPHERE"]["wet_m"]).max() < 5 * MM
    delays = late["FILTER_IONOSPHERE"]
    # Galileo is seen on one frequency here, and its clock goes with all its delays.
    two = np.char.startswith(delays["satellite"].astype(str), "G")
    assert np.abs(delays["delay_m"][two]).max() < 5 * MM
    assert delays["delay_std_m"][~two].min() > 10.0 * delays["delay_std_m"][two].max()
    clocks = late["FILTER_CLOCKS"]
    # 0.1 ppm of the speed of light.
    assert clocks["drift_m_s"] == pytest.approx(29.979, abs=0.01)
    phases = late["FILTER_PHASES"]
    two = np.char.startswith(phases["satellite"].astype(str), "G")
    assert phases["ambiguity_std_m"][two].max() < 0.3
    assert phases["epoch_count"].max() > 120


SEEDS = range(30, 42)


@functools.cache
def noisy() -> list[tuple[Drive, Ran, Errors]]:
    """Runs over drives whose noise is what the filter is told."""
    runs = []
    for seed in SEEDS:
        made = drive(True, seed)
        ran = replay(made)
        runs.append((made, ran, compare(ran, made)))
    return runs


def nees(made: Drive, found: Errors) -> np.ndarray:
    """Squared error of the position over its covariance; three on average."""
    error = local(made, found)
    full = np.zeros((len(error), 3, 3))
    upper = np.triu_indices(3)
    full[:, upper[0], upper[1]] = found.solution["position_covariance_enu_m2"]
    full[:, upper[1], upper[0]] = found.solution["position_covariance_enu_m2"]
    return np.einsum("ki,kij,kj->k", error, np.linalg.inv(full), error)


def test_position_errors_are_as_large_as_the_filter_says():
    freedom = 3 * len(SEEDS)
    # Errors of one drive hang together; those of one epoch of many drives do not.
    for place in (0, 1, 8, 20, 60, 100, -1):
        total = 0.0
        for made, _, found in noisy():
            epochs = np.flatnonzero(found.epochs())
            total += nees(made, found)[epochs[place]]
        assert chi2.ppf(5e-4, freedom) < total < chi2.ppf(1.0 - 5e-4, freedom), place


def test_velocity_and_attitude_are_as_good_as_the_filter_says():
    freedom = 3 * len(SEEDS)
    for place in (20, 60, 100, -1):
        totals = np.zeros(2)
        for _, _, found in noisy():
            k = np.flatnonzero(found.epochs())[place]
            totals[0] += np.sum(
                (found.velocity[k] / found.solution["velocity_std_enu_m_s"][k]) ** 2
            )
            angles = found.attitude[k]
            totals[1] += np.sum((angles[:2] / found.solution["attitude_std_rad"][k, :2].max()) ** 2)
        # Three axes that hang together a little: a wider interval than theirs.
        assert (totals < 1.7 * chi2.ppf(1.0 - 5e-4, freedom)).all(), (place, totals)
        assert totals[0] > 0.3 * freedom


def test_covariances_stay_definite():
    for _, ran, _ in noisy()[:3]:
        s = ran.state.filter[0]
        n = 15 + int(s["extra"])
        P = s["P"][:n, :n]
        assert n > 45
        np.testing.assert_array_equal(P, P.T)
        scale = 1.0 / np.sqrt(np.diag(P))
        assert np.linalg.eigvalsh(P * np.outer(scale, scale)).min() > 0.0


@pytest.mark.parametrize("gap", [10.0, 60.0])
def test_three_satellites_drift_less_than_none(gap):
    """Thirty seconds; ambiguities of the others begin anew after it, or live on."""
    worst = {}
    for keep in (0, 3):
        errors = []
        for made, _, _ in noisy()[:4]:
            ran = replay(
                made,
                {"ppp": {"phases": {"gap": gap}}},
                inputs=without(made.inputs, 40.0, 70.0, keep),
            )
            found = compare(ran, made)
            end = (found.time_s > 69.0) & (found.time_s < 69.9)
            errors.append(np.linalg.norm(found.position[end], axis=1).max())
            back = found.epochs() & (found.time_s > 72.0)
            assert back.sum() > 20
            assert not events(ran, "RESET")
            assert np.linalg.norm(found.position[back], axis=1).max() < 1.5
            assert len(events(ran, "OUTAGE_BEGIN")) == (1 if keep == 0 else 0)
            ages = ran.outputs["FILTER_PHASES"]
            ages = ages.take(seconds(ages) > 75.0)
            lived_on = ages["epoch_count"][~np.isin(ages["satellite"], highest(made.inputs)[:3])]
            assert (lived_on.max() > 60) == (gap > 30.0)
        worst[keep] = max(errors)
    assert worst[3] < 0.5 * worst[0]


def test_what_the_unit_carries_across_a_gap_is_not_lost():
    """Ambiguities that live on bring the position back at once."""
    errors = {}
    for gap in (10.0, 60.0):
        found = []
        for made, _, _ in noisy()[:4]:
            ran = replay(
                made, {"ppp": {"phases": {"gap": gap}}}, inputs=without(made.inputs, 40.0, 60.0)
            )
            errs = compare(ran, made)
            at = errs.epochs() & (errs.time_s > 60.6) & (errs.time_s < 64.0)
            found.append(np.sqrt((errs.position[at] ** 2).sum(axis=1).mean()))
        errors[gap] = float(np.mean(found))
    assert errors[60.0] < errors[10.0]


def test_a_wrong_lever_arm_is_worse():
    made = drive()

    def size(lever: np.ndarray) -> float:
        found = compare(replay(made, {"antenna": {"lever_arm": lever.tolist()}}), made)
        use = found.epochs() & (found.time_s > 25.0)
        return float(np.sqrt((found.position[use] ** 2).sum(axis=1).mean()))

    assert size(LEVER + [0.0, 0.3, 0.0]) > 50.0 * size(LEVER)


@pytest.mark.parametrize("phases", [True, False])
def test_a_receiver_that_sets_its_clock(phases):
    """By a millisecond: in codes alone, or in codes and phases."""
    made = drive(True, 31)
    obs = made.inputs[OBS]
    late = seconds(obs) >= 40.0
    values = {"pseudorange_m": obs["pseudorange_m"] + LIGHT_MS * late}
    if phases:
        wavelength = wavelengths(obs)
        values["carrier_phase_cycles"] = obs["carrier_phase_cycles"] + LIGHT_MS * late / wavelength
    inputs = {**made.inputs, OBS: edited(obs, **values)}
    ran = replay(made, inputs=inputs)
    found = compare(ran, made)
    assert len(events(ran, "CLOCK_JUMP")) == 1
    assert not events(ran, "RESET")
    plain = compare(replay(made), made)
    use = found.epochs() & (found.time_s > 42.0)
    assert (
        np.linalg.norm(found.position[use], axis=1).max()
        < 0.2 + np.linalg.norm(plain.position[plain.epochs() & (plain.time_s > 42.0)], axis=1).max()
    )


def wavelengths(obs: Columns) -> np.ndarray:
    """Of each row, m."""
    bands = {b"1": 1575.42e6, b"2": 1227.6e6, b"7": 1207.14e6}
    return np.array([299792458.0 / bands[signal[:1]] for signal in obs["signal"]])


def test_a_white_clock_is_good_for_nothing_less_than_four():
    """With three satellites the clock's way is what a fourth one would tell."""
    errors = {}
    for clock in ("walk", "white"):
        found = []
        for made, _, _ in noisy()[:4]:
            inputs = without(made.inputs, 40.0, 70.0, 3)
            errs = compare(replay(made, {"tight": {"clock": clock}}, inputs=inputs), made)
            end = (errs.time_s > 65.0) & (errs.time_s < 69.9)
            found.append(np.sqrt((errs.position[end] ** 2).sum(axis=1).mean()))
        errors[clock] = float(np.mean(found))
    assert errors["walk"] < errors["white"]


EDGES = observing.START_NS + np.cumsum(
    np.random.default_rng(2).choice([10_000_000, 130_000_000, 500_000_000, 1_700_000_000], 120)
)


@pytest.mark.parametrize("case", ["plain", "outage", "partial", "inertial gap", "smoothing"])
def test_cutting_the_log_and_resuming_change_no_bit(case):
    made = drive(True, 31)
    imu = made.inputs["IMU"]
    inputs = {
        "outage": lambda: without(made.inputs, 30.0, 38.0),
        "partial": lambda: without(made.inputs, 30.0, 50.0, 3),
        "inertial gap": lambda: {
            **made.inputs,
            "IMU": imu.take((seconds(imu) < 30.0) | (seconds(imu) > 49.0)),
        },
    }.get(case, lambda: made.inputs)()
    config = configuration.build(
        PppInsConfig, [configuration.known_part(PppInsConfig, made.defaults), PLAIN]
    )
    stage = functools.partial(PppInertial, case == "smoothing")
    whole = run(stage(), config, inputs)
    pieces = run(stage(), config, inputs, EDGES.tolist())
    assert whole.bytes() == pieces.bytes()
    if case != "smoothing":
        resumed = run(stage(), config, inputs, EDGES.tolist(), dump_at=37)
        assert whole.bytes() == resumed.bytes()
    assert compare(whole, made).epochs().sum() > 90


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"antenna": {"lever_arm": [1.0, 2.0]}}, "lever_arm"),
        ({"ppp": {"measurements": {"frequencies": 4}}}, "frequencies"),
    ],
)
def test_settings_that_cannot_be(table, words):
    with pytest.raises(ConfigurationError, match=words):
        PppInertial().start(settings(table), Context({}, {}))


def test_other_dynamics_are_refused():
    with pytest.raises(ConfigurationError, match="dynamics"):
        settings({"ppp": {"motion": {"dynamics": "kinematic"}}})
