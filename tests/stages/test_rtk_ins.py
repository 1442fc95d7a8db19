"""Tightly coupled RTK/INS over short drives of which everything is known."""

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
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.errors import ConfigurationError
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.schemas import filter_pb2, solution_pb2
from replay.simulate import read_scenario, write_log
from replay.simulate.defaults import fitting_defaults
from replay.simulate.write import make_all
from replay.stages.base import BASE, Context, Port
from replay.stages.rtk import Rtk
from replay.stages.rtk_config import RtkConfig
from replay.stages.rtk_ins_config import RtkInsConfig
from replay.stages.rtk_ins_tc import RtkInertial
from replay.stages.satellites import Satellites
from tests.simulate import observing
from tests.stages.gnss_chain import Ran, logged, run

MM = 1e-3
NS = 1_000_000_000
LEVER = np.array([-0.4, 0.15, -1.2])
SIGNALS = ("G1C", "G2W", "E1C", "E7Q")
FIXED = solution_pb2.SOLUTION_STATUS_FIXED
FLOAT = solution_pb2.SOLUTION_STATUS_FLOAT
DGNSS = solution_pb2.SOLUTION_STATUS_DGNSS
BASE_OBS = Port(channels.GNSS_OBS, BASE).name
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
    {"kind": "straight", "duration": 12.0},
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
    """Rover with lever arm and a base two kilometres away, two epochs in a second."""
    errors = {"noise": QUIET} if noise else {}
    clock = {"bias": "0.1 ms", "drift": "0.1 ppm"}
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
                               clock=clock, **errors),
            observing.receiver("base", kind="static", latitude="30.51 deg",
                               longitude="114.317 deg", height="40 m", rate=2.0,
                               signals=list(SIGNALS), **errors),
        ],
        "segments": TURNS,
    }  # fmt: skip


@functools.cache
def drive(noise: bool = False, seed: int = 4) -> Drive:
    """What the pipeline's last stage reads of such a drive."""
    scenario = read_scenario(scenario_table(noise, seed))
    rows, _ = make_all(scenario)
    inputs = {
        channels.IMU.name: logged(channels.IMU.name, rows[channels.IMU.topic]),
    }
    for role, receiver in (("receiver", "rover"), (BASE, "base")):
        obs = Port(channels.GNSS_OBS, role).name
        topic = channels.GNSS_OBS.at(receiver=receiver)
        inputs[obs] = logged(channels.GNSS_OBS.name, rows[topic])
        read = {
            obs: inputs[obs],
            channels.NAV.name: logged(channels.NAV.name, rows[channels.NAV.topic]),
        }
        place = pymap3d.geodetic2ecef(30.51, 114.317, 40.0)
        antenna = {"base_position": [float(v) for v in place]}
        found = run(Satellites(role), settings(antenna=antenna), read).outputs
        for channel in (channels.SATELLITES, channels.CORRECTIONS, channels.COARSE):
            name = Port(channel, role).name
            inputs[name] = logged(channel.name, found[name])
    return Drive(inputs, rows[channels.TRUTH.topic], fitting_defaults(scenario.settings))


PLAIN = {
    "atmosphere": {"ionosphere": "none", "troposphere": "none", "shapiro": False},
    "stops": {"zero_velocity": False, "zero_rate": False},
    "non_holonomic": {"enabled": False},
    "imu": {"interval": 0.01},
    "antenna": {"lever_arm": LEVER.tolist()},
    "rtk": {
        "differences": {"code_sigma": [0.3], "phase_sigma": [0.002], "weighting": "sine"},
    },
}
"""Satellites and inertial sensors alone, each with the noise that it was made with."""


def settings(*tables: dict[str, Any], cls: Any = RtkInsConfig, **table: Any) -> Any:
    return configuration.build(
        cls,
        [configuration.known_part(cls, PLAIN), *tables, table],
    )


@dataclasses.dataclass(frozen=True)
class Errors:
    """Rows of the solution against truth: estimate less truth.

    Attributes
    ----------
    time_s : (n,), since the start
    position : (n, 3), m, ECEF
    attitude : (n, 3), rad, truth less estimate about north, east, down
    """

    time_s: np.ndarray
    status: np.ndarray
    position: np.ndarray
    attitude: np.ndarray
    solution: Columns

    def epochs(self) -> np.ndarray:
        """Which rows stand at an epoch of the receiver with a base."""
        return self.status >= DGNSS

    def after(self, seconds: float) -> np.ndarray:
        return self.epochs() & (self.time_s > seconds)


def compare(found: Ran, made: Drive) -> Errors:
    solution = found.outputs["SOLUTION"]
    truth = made.truth
    times = truth.valid_time_ns
    inside = (solution.valid_time_ns > times[0]) & (solution.valid_time_ns < times[-1])
    solution = solution.take(inside)
    origin = truth["position_ecef_m"][0]
    curve = CubicSpline((times - times[0]) / NS, truth["position_ecef_m"] - origin)
    at = (solution.valid_time_ns - times[0]) / NS
    ours = Rotation.from_euler("ZYX", solution["attitude_rad"][:, ::-1])
    theirs = Slerp(
        (times - times[0]) / NS, Rotation.from_euler("ZYX", truth["attitude_rad"][:, ::-1])
    )(at)
    return Errors(
        time_s=at,
        status=solution["status"],
        position=solution["position_ecef_m"] - (curve(at) + origin),
        attitude=(theirs * ours.inv()).as_rotvec(),
        solution=solution,
    )


def replay(made: Drive, *tables: dict[str, Any], inputs: Any = None, **keys: Any) -> Ran:
    config = settings(configuration.known_part(RtkInsConfig, made.defaults), PLAIN, *tables)
    return run(RtkInertial(), config, inputs or made.inputs, **keys)


def local(made: Drive, found: Errors) -> np.ndarray:
    """Errors of the position in east, north, up, m."""
    latitude, longitude, _ = pymap3d.ecef2geodetic(*made.truth["position_ecef_m"][0])
    return np.array(pymap3d.uvw2enu(*found.position.T, latitude, longitude)).T


def nees(made: Drive, found: Errors) -> np.ndarray:
    """Squared error of the position over its covariance; three on average."""
    error = local(made, found)
    full = np.zeros((len(error), 3, 3))
    upper = np.triu_indices(3)
    full[:, upper[0], upper[1]] = found.solution["position_covariance_enu_m2"]
    full[:, upper[1], upper[0]] = found.solution["position_covariance_enu_m2"]
    return np.einsum("ki,kij,kj->k", error, np.linalg.inv(full), error)


def covariances(found: Ran) -> np.ndarray:
    """(n, states, states), of the inertial system, full."""
    rows = found.outputs["FILTER_COVARIANCE"]
    size = int(rows["dimension"][0])
    full = np.zeros((len(rows), size, size))
    upper = np.triu_indices(size)
    triangles = rows.ragged("upper_triangle").values.reshape(len(rows), -1)
    full[:, upper[0], upper[1]] = triangles
    full[:, upper[1], upper[0]] = triangles
    return full


def events(found: Ran, kind: str) -> list[tuple[float, str]]:
    """Time since the start and text of events of a kind."""
    rows = found.outputs["FILTER_EVENTS"]
    mine = rows["kind"] == filter_pb2.EventKind.Value(f"EVENT_KIND_{kind}")
    times = (rows.valid_time_ns[mine] - observing.START_NS) / NS
    texts = [text for text, keep in zip(rows.ragged("detail").texts(), mine, strict=True) if keep]
    return list(zip(times.tolist(), texts, strict=True))


def of_role(name: str, role: str) -> bool:
    """Whether a port is one of a receiver's own."""
    return name.startswith(f"{BASE}.") if role == BASE else name in ROVER


ROVER = tuple(
    c.name for c in (channels.GNSS_OBS, channels.SATELLITES, channels.CORRECTIONS, channels.COARSE)
)


def without(inputs: dict[str, Columns], role: str, begin: float, end: float) -> dict[str, Columns]:
    """No rows of a receiver in a stretch of time (s)."""
    edges = observing.START_NS + round(begin * NS), observing.START_NS + round(end * NS)
    return {
        name: rows.take((rows.valid_time_ns < edges[0]) | (rows.valid_time_ns >= edges[1]))
        if of_role(name, role)
        else rows
        for name, rows in inputs.items()
    }


def later(
    inputs: dict[str, Columns], role: str, seconds: float, begin: float = 0.0, end: float = 1e6
) -> dict[str, Columns]:
    """Rows of a receiver in a stretch of time come later."""
    made = {}
    for name, rows in inputs.items():
        if of_role(name, role):
            since = (rows.valid_time_ns - observing.START_NS) / NS
            moved = np.where((since >= begin) & (since < end), round(seconds * NS), 0)
            log = rows.log_time_ns + moved
            rows = dataclasses.replace(rows, log_time_ns=log, payloads=None)
            rows = rows.take(np.argsort(log, kind="stable").astype(np.int64))
        made[name] = rows
    return made


def test_without_noise_every_epoch_is_fixed_and_exact():
    made = drive()
    ran = replay(made)
    found = compare(ran, made)
    epochs = found.epochs()
    assert epochs.sum() > 95
    assert (found.status[epochs] == FIXED).all()
    assert np.abs(found.position[epochs]).max() < 0.1 * MM
    # Between epochs the inertial unit carries it: it has no noise, but its steps have a length.
    assert np.abs(found.position[found.time_s > 20.0]).max() < 2 * MM
    turned = found.after(20.0)
    assert np.degrees(np.abs(found.attitude[turned])).max() < 1e-3
    assert len(events(ran, "AMBIGUITIES_FIXED")) == 1
    assert not events(ran, "CYCLE_SLIP")


def test_the_pipeline_over_a_log_says_the_same(tmp_path):
    table = {
        **scenario_table(False, 4),
        "defaults": {"gnss": {"receiver": "rover", "base": "base"}},
    }
    source, target = tmp_path / "in.mcap", tmp_path / "out.mcap"
    write_log(read_scenario(table), source)
    with LogReader(source) as reader:
        # The log knows its lever arm, its base and its sensors.
        own = {name: PLAIN[name] for name in ("atmosphere", "stops", "non_holonomic", "rtk")}
        replay_log(reader, target, make_job(reader, "rtk-ins-tc", tables=[own]))
    with LogReader(target) as reader:
        solution = reader.read(channels.SOLUTION.at(run="rtk-ins-tc"))
    made = drive()
    found = compare(Ran({"SOLUTION": solution}, None, None), made)
    epochs = found.epochs()
    assert epochs.sum() > 95
    assert (found.status[epochs] == FIXED).all()
    assert np.abs(found.position[epochs]).max() < 0.1 * MM


def test_one_key_of_a_section_leaves_the_others_as_they_are():
    table = {"rtk": {"differences": {"frequencies": 1}, "ambiguities": {"threshold": 2.5}}}
    config = configuration.build(RtkInsConfig, [table, {"tight": {"outage_limit": 3.0}}])
    assert config.rtk.ambiguities.threshold == 2.5
    plain = RtkInsConfig()
    assert config.rtk.motion == plain.rtk.motion
    assert config.rtk.ambiguities.mode == plain.rtk.ambiguities.mode == "fix-and-hold"
    assert config.rtk.ambiguities.hold_count == plain.rtk.ambiguities.hold_count
    assert config.tight.latency == plain.tight.latency


@pytest.mark.parametrize("table", [{"tight": {"latency": 0.3}}, {"base": {"wait": 0.7}}])
def test_inertial_rows_must_wait_as_long_as_epochs(table):
    with pytest.raises(ConfigurationError, match="latency"):
        RtkInertial().start(settings(table), Context({}, {}))


def test_other_dynamics_are_refused():
    with pytest.raises(ConfigurationError, match="dynamics"):
        settings({"rtk": {"motion": {"dynamics": "kinematic"}}})


SEEDS = range(30, 42)


@functools.cache
def noisy(mode: str) -> list[tuple[Drive, Ran, Errors]]:
    """Runs over drives whose noise is what the filter is told."""
    runs = []
    for seed in SEEDS:
        made = drive(True, seed)
        ran = replay(made, {"rtk": {"ambiguities": {"mode": mode}}})
        runs.append((made, ran, compare(ran, made)))
    return runs


@pytest.mark.parametrize(
    ("mode", "status", "least"),
    [
        ("float", FLOAT, 1.0),
        ("continuous", FIXED, 1.0),
        # An integer is fed back with a deviation that it does not have.
        ("fix-and-hold", FIXED, 0.25),
        ("instantaneous", FIXED, 0.25),
    ],
)
def test_position_errors_are_as_large_as_the_filter_says(mode, status, least):
    freedom = 3 * len(SEEDS)
    # Errors of one drive hang together; those of one epoch of many drives do not.
    for place in (0, 1, 8, 20, 60, -1):
        total = 0.0
        for made, _, found in noisy(mode):
            epochs = np.flatnonzero(found.epochs())
            assert found.status[epochs[place]] == status
            total += nees(made, found)[epochs[place]]
        assert least * chi2.ppf(5e-4, freedom) < total < chi2.ppf(1.0 - 5e-4, freedom)


def test_fixed_positions_are_right_and_better_than_float_ones():
    worst, rms = {}, {}
    for mode in ("float", "fix-and-hold", "continuous", "instantaneous"):
        errors = []
        for _, _, found in noisy(mode):
            use = found.epochs()
            if mode != "float":
                assert (found.status[use] == FIXED).mean() > 0.97
                use = found.status == FIXED
            errors.append(np.linalg.norm(found.position[use], axis=1))
        joined = np.concatenate(errors)
        worst[mode] = joined.max()
        rms[mode] = np.sqrt((joined**2).mean())
    # A wrong integer of the rover's first signal is worth a decimetre.
    assert max(worst[mode] for mode in worst if mode != "float") < 0.03
    assert max(rms[mode] for mode in rms if mode != "float") < 0.006 < rms["float"]


def test_covariances_stay_definite():
    for _, ran, _ in noisy("fix-and-hold")[:3]:
        for P in covariances(ran):
            scale = 1.0 / np.sqrt(np.diag(P))
            assert np.linalg.eigvalsh(P * np.outer(scale, scale)).min() > 0.0
        s = ran.state.filter[0]
        n = 15 + int(s["extra"])
        P = s["P"][:n, :n]
        assert n > 30
        np.testing.assert_array_equal(P, P.T)
        scale = 1.0 / np.sqrt(np.diag(P))
        assert np.linalg.eigvalsh(P * np.outer(scale, scale)).min() > 0.0


def test_continuous_mode_shows_integers_that_the_filter_does_not_keep():
    made = drive(True, 30)
    shown, plain = (
        replay(made, {"rtk": {"ambiguities": {"mode": mode}}}) for mode in ("continuous", "float")
    )
    a, b = compare(shown, made), compare(plain, made)
    fixed = a.status == FIXED
    assert fixed.sum() > 90
    for name in ("FILTER_STATE", "FILTER_COVARIANCE"):
        one, two = shown.outputs[name], plain.outputs[name]
        for field in one.values:
            if field != "state_names":
                left, right = one.values[field], two.values[field]
                left, right = getattr(left, "values", left), getattr(right, "values", right)
                np.testing.assert_array_equal(left, right)
    late = fixed & (a.time_s < 20.0)
    gain = np.linalg.norm(b.position[late], axis=1) / np.linalg.norm(a.position[late], axis=1)
    assert np.median(gain) > 2.0
    variance = "position_covariance_enu_m2"
    assert (a.solution[variance][fixed][:, 0] <= b.solution[variance][fixed][:, 0]).all()


def plain_rtk(made: Drive, table: dict[str, Any], inputs: Any = None) -> Columns:
    """The same without inertial sensors."""
    config = configuration.build(
        RtkConfig, [configuration.known_part(RtkConfig, t) for t in (PLAIN, table)]
    )
    chosen = {k: v for k, v in (inputs or made.inputs).items() if k != channels.IMU.name}
    return run(Rtk(), config, chosen).outputs["SOLUTION"]


def test_inertial_sensors_help_integers_of_single_epochs():
    """One frequency, every epoch for itself: the prediction is what else there is."""
    table = {"rtk": {"differences": {"frequencies": 1}, "ambiguities": {"mode": "instantaneous"}}}
    aided, alone, epochs = 0, 0, 0
    for seed in SEEDS:
        made = drive(True, seed)
        found = compare(replay(made, table), made)
        use = found.epochs()
        epochs += use.sum()
        fixed = found.status == FIXED
        assert np.linalg.norm(found.position[fixed], axis=1).max() < 0.05
        aided += fixed.sum()
        other = plain_rtk(made, table)
        same = np.isin(
            other.valid_time_ns // 10_000_000, found.solution.valid_time_ns[use] // 10_000_000
        )
        assert same.sum() == use.sum()
        alone += (other["status"][same] == FIXED).sum()
    assert epochs > 1100
    assert aided >= alone
    assert aided / epochs > 0.99 > alone / epochs


def first_fix(times: np.ndarray, status: np.ndarray, after: float) -> float:
    """Time of the first fixed row from a time on."""
    return float(times[(times >= after - 0.01) & (status == FIXED)][0])


def test_after_an_outage_integers_come_back_at_once():
    """Ten seconds without satellites; one frequency, which alone needs several epochs."""
    table = {"rtk": {"differences": {"frequencies": 1}}}
    waits: dict[str, list[float]] = {"inertial": [], "alone": []}
    for seed in SEEDS:
        made = drive(True, seed)
        inputs = without(made.inputs, "receiver", 30.0, 40.0)
        ran = replay(made, table, inputs=inputs)
        found = compare(ran, made)
        assert len(events(ran, "OUTAGE_BEGIN")) == len(events(ran, "OUTAGE_END")) == 1
        waits["inertial"].append(first_fix(found.time_s, found.status, 40.0) - 40.0)
        fixed = found.status == FIXED
        assert np.linalg.norm(found.position[fixed], axis=1).max() < 0.05
        other = plain_rtk(made, table, inputs)
        times = (other.valid_time_ns - observing.START_NS) / NS
        waits["alone"].append(first_fix(times, other["status"], 40.0) - 40.0)
    assert max(waits["inertial"]) < 0.6  # the second epoch at most
    assert np.mean(waits["inertial"]) < np.mean(waits["alone"])


def test_a_base_that_is_lost_serves_until_it_is_too_old():
    """Epochs without a partner of their own time wait, and are still in time."""
    made = drive()
    inputs = without(made.inputs, BASE, 22.0, 52.0)
    # No row of a receiver comes between the end of the wait and that of the latency.
    table = {"base": {"max_age": 5.0, "wait": 0.2}, "tight": {"latency": 0.3}}
    ran = replay(made, table, inputs=inputs)
    found = compare(ran, made)
    assert not events(ran, "TIME_BACKWARD")
    epochs = found.epochs()
    old = epochs & (found.time_s > 22.0 - 0.01) & (found.time_s < 26.6)
    assert old.sum() == 10
    assert (found.status[old] == FIXED).all()
    # The base's clock is gone with the differences, and broadcast clocks are exact here.
    assert np.abs(found.position[old]).max() < MM
    gone = (found.time_s > 26.7) & (found.time_s < 51.99)
    assert not (epochs & gone).any()
    lost = events(ran, "BASE_LOST")
    assert len(lost) == 1
    assert lost[0][0] == pytest.approx(27.0, abs=0.01)
    # The inertial unit has no noise; what is left is how well it was known.
    assert np.abs(found.position[gone]).max() < 0.2
    back = epochs & (found.time_s > 51.99)
    assert (found.status[back] == FIXED).all()
    assert np.abs(found.position[back]).max() < 0.2 * MM


@pytest.mark.parametrize("seen", [True, False])
def test_a_slip_that_is_not_told_does_no_harm(seen):
    """One cycle on one signal: between frequencies it shows, else in the residuals."""
    made = drive(True, 31)
    obs = made.inputs[channels.GNSS_OBS.name]
    name = replay(made).outputs["FILTER_AMBIGUITIES"]["satellite"][0]
    slipped = (obs["satellite"] == name) & (obs["signal"] == b"1C")
    slipped &= obs.valid_time_ns >= observing.START_NS + 35 * NS
    phase = obs["carrier_phase_cycles"] + slipped
    values = {**obs.values, "carrier_phase_cycles": phase}
    inputs = {**made.inputs, channels.GNSS_OBS.name: dataclasses.replace(obs, values=values)}
    limit = 0.05 if seen else 1e9
    ran = replay(made, {"rtk": {"motion": {"geometry_free": limit}}}, inputs=inputs)
    found = compare(ran, made)
    epochs = found.epochs()
    assert (found.status[epochs] == FIXED).all()
    assert np.linalg.norm(found.position[epochs], axis=1).max() < 0.03
    if seen:
        slips = events(ran, "CYCLE_SLIP")
        assert {text.split(":")[0] for _, text in slips} == {name.decode()}
        assert {round(time, 2) for time, _ in slips} == {35.0}
    rows = ran.outputs["FILTER_AMBIGUITIES"]
    mine = (rows["satellite"] == name) & (rows["signal"] == b"1C")
    times = (rows.valid_time_ns - observing.START_NS) / NS
    before = rows["integer_cycles"][mine & (times < 34.9)][-1]
    after = rows["integer_cycles"][mine & (times > 40.0)]
    assert len(after) > 10
    assert (after == before + 1).all()


EDGES = observing.START_NS + np.cumsum(
    np.random.default_rng(2).choice([10_000_000, 130_000_000, 500_000_000, 1_700_000_000], 90)
)


@pytest.mark.parametrize(
    "case", ["plain", "late base", "very late base", "late epoch", "outage", "inertial gap"]
)
@pytest.mark.parametrize("mode", ["fix-and-hold", "instantaneous"])
def test_cutting_the_log_and_resuming_change_no_bit(case, mode):
    made = drive(True, 31)
    inputs = {
        "plain": lambda: made.inputs,
        "late base": lambda: later(made.inputs, BASE, 0.3),
        "very late base": lambda: later(made.inputs, BASE, 0.8),
        "late epoch": lambda: later(made.inputs, "receiver", 1.6, 30.0, 30.3),
        "outage": lambda: without(made.inputs, "receiver", 30.0, 38.0),
        "inertial gap": lambda: {
            **made.inputs,
            "IMU": made.inputs["IMU"].take(
                (made.inputs["IMU"].valid_time_ns < observing.START_NS + 30 * NS)
                | (made.inputs["IMU"].valid_time_ns > observing.START_NS + 49 * NS)
            ),
        },
    }[case]()
    table = {"rtk": {"ambiguities": {"mode": mode}}, "base": {"max_age": 3.0}}
    whole = replay(made, table, inputs=inputs)
    pieces = replay(made, table, inputs=inputs, edges=EDGES.tolist(), dump_at=37)
    assert len(EDGES) > 80
    assert whole.bytes() == pieces.bytes()
    assert compare(whole, made).epochs().sum() > 40


def test_a_base_that_comes_within_the_wait_changes_nothing_but_log_times():
    made = drive(True, 31)
    one = replay(made)
    two = replay(made, inputs=later(made.inputs, BASE, 0.45))
    for name in ("SOLUTION", "FILTER_STATE", "FILTER_RESOLUTION"):
        a, b = one.outputs[name], two.outputs[name]
        # The log is longer by the base's last epoch.
        np.testing.assert_array_equal(a.valid_time_ns, b.valid_time_ns[: len(a)])
        for field in a.values:
            np.testing.assert_array_equal(a.values[field], b.values[field][: len(a)])
    # Later than that, and the base's epoch before has to do.
    three = compare(replay(made, inputs=later(made.inputs, BASE, 0.8)), made)
    use = three.epochs()
    assert (three.status[use] == FIXED).all()
    assert np.linalg.norm(three.position[use], axis=1).max() < 0.03
    assert not np.array_equal(three.position, compare(one, made).position)


def test_breaks_in_an_epoch_that_comes_too_late_are_heeded():
    made = drive(True, 31)
    obs = made.inputs[channels.GNSS_OBS.name]
    name = obs["satellite"][0]
    told = (obs["satellite"] == name) & (
        np.abs((obs.valid_time_ns - observing.START_NS) / NS - 30.0) < 0.1
    )
    assert told.sum() == 2
    values = {**obs.values, "loss_of_lock": np.where(told, 1, obs["loss_of_lock"])}
    inputs = {**made.inputs, channels.GNSS_OBS.name: dataclasses.replace(obs, values=values)}
    ran = replay(made, inputs=later(inputs, "receiver", 1.6, 29.9, 30.1))
    late = events(ran, "TIME_BACKWARD")
    assert len(late) == 1
    slips = events(ran, "CYCLE_SLIP")
    assert [text.split(":")[0] for _, text in slips] == [name.decode()] * 2
    assert {round(time, 1) for time, _ in slips} == {32.0}


def test_a_wrong_lever_arm_shows_in_the_turns():
    made = drive(True, 31)

    def size(lever: np.ndarray) -> float:
        ran = replay(made, {"antenna": {"lever_arm": lever.tolist()}})
        rows = ran.outputs["FILTER_INNOVATIONS"]
        kind = filter_pb2.MEASUREMENT_KIND_CARRIER_PHASE
        phases = rows.take((rows["kind"] == kind) & rows["accepted"])
        return float(np.mean((phases["innovation"] / phases["innovation_std"]) ** 2))

    assert size(LEVER) < 1.2
    assert size(LEVER + [0.0, 0.3, 0.0]) > 1.3 * size(LEVER)
