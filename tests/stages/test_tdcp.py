"""Displacements of simulated observations, and the inertial system that they hold."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from replay import channels
from replay.evaluate.geometry import body_to_enu, enu_axes, turn_back
from replay.log import codec
from replay.log.columns import Columns, concatenate
from replay.schemas import sights_pb2, solution_pb2
from replay.stages.base import Context
from replay.stages.gnss_config import Antenna
from replay.stages.satellites import Satellites
from replay.stages.tdcp import TimeDifferencedPhase
from replay.stages.tdcp_config import Tdcp, TdcpConfig
from replay.stages.tdcp_ins import TdcpInertial
from replay.stages.tdcp_ins_config import TdcpIns, TdcpInsConfig
from tests.simulate.observing import NO_AIR, START_NS, make, receiver

LEVER = (-0.4, 0.15, -1.2)
NS = 1_000_000_000
DRIVE = [
    {"kind": "hold", "duration": 10.0},
    {"kind": "speed", "to": 14.0},
    {"kind": "turn", "angle": "60 deg", "radius": 80.0},
    {"kind": "straight", "duration": 10.0},
    {"kind": "turn", "angle": "-60 deg", "radius": 50.0},
    {"kind": "straight", "duration": 20.0},
]
NOISE = {"code": "0.3 m", "carrier": "2 mm", "rate": "3 cm/s"}
STATUS = solution_pb2.SolutionStatus.Value


def as_read(topic, columns):
    """Rows as a log gives them, with every field."""
    kind = codec.codec_for(channels.find(topic).message)
    decoded = kind.decode(kind.encode(columns))
    return dataclasses.replace(columns, values=decoded.values, present=decoded.present)


class Through:
    """Rows of a simulated log through stages, cut after some log times."""

    def __init__(self, rows, stages, config, cuts=(), freeze=None):
        self.rows = {}
        for name, topic in {
            "IMU": channels.IMU.topic,
            "GNSS_OBS": channels.GNSS_OBS.at(receiver="rover"),
            "NAV": channels.NAV.topic,
        }.items():
            if topic in rows:
                self.rows[name] = as_read(topic, rows[topic])
        parts: dict[str, list[Columns]] = {}
        heads = {name: part.take(slice(0, 200)) for name, part in self.rows.items()}
        states = [stage.start(config, Context({}, heads)) for stage in stages]
        begin = -1
        for end in (*cuts, 2**62):
            block = {}
            for name, part in self.rows.items():
                inside = (part.log_time_ns > begin) & (part.log_time_ns <= end)
                if inside.any():
                    block[name] = part.take(np.flatnonzero(inside))
            begin = end
            for k, stage in enumerate(stages):
                if freeze:
                    fresh = stage.start(config, Context({}, heads))
                    states[k] = stage.restore(fresh, stage.dump(states[k]))
                seen = {port.name: block[port.name] for port in stage.spec.inputs
                        if port.name in block}  # fmt: skip
                states[k], made = stage.step(states[k], seen)
                block.update(made)
                for name, part in made.items():
                    parts.setdefault(f"{stage.spec.name}.{name}", []).append(part)
        self.made = {name: concatenate(pieces) for name, pieces in parts.items()}

    def __getitem__(self, name):
        return self.made[name]


def antenna(made, times):
    """Truth of the antenna (n, 3) at times that truth has, within a microsecond."""
    truth = made.rows[channels.TRUTH.topic]
    row = np.searchsorted(truth.valid_time_ns, np.asarray(times) - 1000)
    assert np.abs(truth.valid_time_ns[row] - times).max() < 1000
    r = truth["position_ecef_m"][row].astype(float)
    arm = np.einsum("nij,j->ni", body_to_enu(truth["attitude_rad"][row].astype(float)), LEVER)
    return r + turn_back(enu_axes(r), arm)


@functools.cache
def perfect():
    return make(receiver(lever_arm=list(LEVER)), sky=NO_AIR, segments=DRIVE)


@functools.cache
def drive(**keys):
    """A drive with noise, an inertial unit, and what is given."""
    one = receiver(lever_arm=list(LEVER), noise=NOISE, clock={"bias": "0.1 ms", "drift": "0.1 ppm"})
    # Truth is at whole seconds, the clock's error moves epochs off them by 0.1 ms.
    return make(one, segments=DRIVE, imu={"rate": "100 Hz", "grade": "industrial"},
                sky={"systems": "GEC"}, **{k: list(v) for k, v in keys.items()})  # fmt: skip


def plain(**keys):
    base = TdcpConfig()
    atmosphere = {"ionosphere": "none", "troposphere": "none", "shapiro": False}
    air = type(base.atmosphere)(**atmosphere)
    return TdcpConfig(atmosphere=air, tdcp=Tdcp(**keys))


def test_perfect_phases_give_the_way_of_the_antenna():
    made = perfect()
    run = Through(made.rows, [Satellites(), TimeDifferencedPhase()], plain())
    moved = run["tdcp.DISPLACEMENT"]
    assert len(moved) > 50
    steps = antenna(made, moved.valid_time_ns) - antenna(made, moved["since_ns"])
    np.testing.assert_allclose(moved["displacement_ecef_m"], steps, rtol=0, atol=1e-5)
    assert "tdcp.SLIPS" not in run.made
    solution = run["tdcp.SOLUTION"]
    assert not solution.is_present("velocity_enu_m_s").any()
    assert solution["status"][0] == STATUS("SOLUTION_STATUS_SINGLE")
    np.testing.assert_allclose(
        np.diff(solution["position_ecef_m"], axis=0), moved["displacement_ecef_m"], atol=1e-8
    )


def test_slips_that_were_not_told_are_taken_off():
    slips = [
        {"receiver": "rover", "satellite": "G16", "signal": "1C", "time": "20 s", "cycles": 3},
        {"receiver": "rover", "satellite": "C16", "signal": "6I", "time": "31 s", "cycles": -1},
        {"receiver": "rover", "satellite": "C16", "signal": "2I", "time": "31 s", "cycles": 12},
    ]
    one = receiver(lever_arm=list(LEVER), noise=NOISE)
    made = make(one, segments=DRIVE, slips=slips)
    run = Through(made.rows, [Satellites(), TimeDifferencedPhase()], TdcpConfig())
    rows = run["tdcp.SLIPS"]
    told = {
        (row["satellite"].encode(), row["signal"].encode()): row["cycles"] for row in made.slips
    }
    assert len(told) == 3
    real = rows["detector"] != sights_pb2.SLIP_DETECTOR_GAP
    real &= rows["size_cycles"] != 0.0
    found = {
        (sat, signal): size
        for sat, signal, size in zip(
            rows["satellite"][real].tolist(),
            rows["signal"][real].tolist(),
            rows["size_cycles"][real].tolist(),
            strict=True,
        )
    }
    assert found == told
    assert rows["repaired"][real].all()


def test_blocks_and_dumps_change_nothing():
    made = drive()
    stages = lambda: [Satellites(), TimeDifferencedPhase(), TdcpInertial()]  # noqa: E731
    config = TdcpInsConfig(antenna=Antenna(lever_arm=LEVER))
    whole = Through(made.rows, stages(), config)
    cuts = [START_NS + round(t * NS) for t in (3.2, 15.0, 15.004, 22.7, 22.75, 31.0, 31.0001, 40.0)]
    pieces = Through(made.rows, stages(), config, cuts=cuts, freeze=True)
    assert whole.made.keys() == pieces.made.keys()
    for name, columns in whole.made.items():
        other = pieces[name]
        assert columns.valid_time_ns.tobytes() == other.valid_time_ns.tobytes(), name
        for field, values in columns.values.items():
            if isinstance(values, np.ndarray):
                assert values.tobytes() == other[field].tobytes(), (name, field)


def changes(made, run):
    """Errors (n, 3) of the changes of the IMU's place between epochs, ECEF."""
    truth = made.rows[channels.TRUTH.topic]
    solution = run["tdcp-ins.SOLUTION"]
    updated = solution["status"] == STATUS("SOLUTION_STATUS_UPDATED")
    t = solution.valid_time_ns[updated]
    row = np.searchsorted(truth.valid_time_ns, t - 500_000)
    # Epochs are 0.1 ms off the rows of truth.
    enu = truth["velocity_enu_m_s"][row].astype(float)
    r = truth["position_ecef_m"][row].astype(float)
    late = ((t - truth.valid_time_ns[row]) / NS)[:, None]
    place = r + turn_back(enu_axes(r), enu) * late
    error = solution["position_ecef_m"][updated] - place
    close = np.diff(t) < 1.5 * NS
    return t[1:][close], np.diff(error, axis=0)[close], error


@pytest.mark.parametrize("measurement", ["position", "displacement"])
def test_the_inertial_system_moves_as_the_vehicle(measurement):
    made = drive()
    config = TdcpInsConfig(
        antenna=Antenna(lever_arm=LEVER),
        tdcp_ins=TdcpIns(measurement=measurement, velocity=measurement == "position"),
    )
    run = Through(made.rows, [Satellites(), TimeDifferencedPhase(), TdcpInertial()], config)
    t, change, _ = changes(made, run)
    assert len(t) > 25
    settled = change[5:]
    assert np.sqrt(np.mean(settled**2, axis=0)).max() < 0.01
    innovations = run["tdcp-ins.FILTER_INNOVATIONS"]
    assert innovations["accepted"].all()
    # The place itself stays as uncertain as the code position of the beginning.
    cov = run["tdcp-ins.SOLUTION"]["position_covariance_enu_m2"]
    assert cov[-1, [0, 3, 5]].min() > 0.9 * 2.0**2


def test_the_inertial_system_carries_the_place_over_a_break():
    """Codes 40 m off after a break move the chain of phases, not the inertial system."""
    made = drive()
    rows = dict(made.rows)
    topic = channels.GNSS_OBS.at(receiver="rover")
    obs = rows[topic]
    since = (obs.valid_time_ns - START_NS) / NS
    obs = obs.take(np.flatnonzero((since < 30.5) | (since > 36.5)))
    names = obs["satellite"].astype("U3")
    later = (obs.valid_time_ns - START_NS) / NS > 33.0
    # Ranges of the east too long: the code position goes there.
    shift = np.array([40.0 * (number_of(n) % 3 - 1) for n in names])
    values = {**obs.values, "pseudorange_m": obs["pseudorange_m"] + np.where(later, shift, 0.0)}
    rows[topic] = obs.__class__.build(
        obs.valid_time_ns,
        values,
        log_time_ns=obs.log_time_ns,
        present={name: obs.is_present(name) for name in values},
    )
    config = TdcpInsConfig(antenna=Antenna(lever_arm=LEVER), tdcp=Tdcp(max_gap=2.0))
    run = Through(rows, [Satellites(), TimeDifferencedPhase(), TdcpInertial()], config)
    chain = run["tdcp.SOLUTION"]
    restarts = np.flatnonzero(chain["status"] == STATUS("SOLUTION_STATUS_SINGLE"))
    assert len(restarts) == 2
    _, _, error = changes(made, run)
    places = chain["position_ecef_m"]
    jump = np.linalg.norm(
        places[restarts[1]]
        - antenna_near(made, chain.valid_time_ns[restarts[1]])
        - (places[restarts[1] - 1] - antenna_near(made, chain.valid_time_ns[restarts[1] - 1]))
    )
    assert jump > 5.0
    assert np.linalg.norm(error[-1] - error[5]) < 1.0


def number_of(name):
    """A number of a satellite, the same everywhere."""
    return int(name[1:])


def antenna_near(made, time_ns):
    """Truth of the antenna (3,) at a time 0.1 ms off its rows."""
    return antenna(made, [round(time_ns / 1e8) * 10**8])[0]
