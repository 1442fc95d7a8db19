"""A network of stations from scenario to solution: the whole chain on four minutes of flight."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from replay import channels
from replay.configuration import merge
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.errors import MissingChannelError, UsageError
from replay.evaluate.network_run import network_figures, read_network_run, solution_errors
from replay.log.reader import LogReader
from replay.schemas import solution_pb2
from replay.simulate.scenario import read_scenario
from replay.simulate.write import write_log
from tests.engine.drives import content

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "recordings" / "network" / "scenario.toml"
SKY = ROOT / "replay" / "batch" / "lee2010" / "sky.toml"
NS = 1_000_000_000
CM = 1e-2
# By then the stations know the integers of all satellites.
SETTLED_S = 90.0


def scenario(*, away: dict[str, list[list[float]]] | None = None) -> dict:
    """The recording's scenario; stations may be away for some time."""
    table = tomllib.loads(SKY.read_text())
    own = tomllib.loads(SCENARIO.read_text())
    del own["include"]
    merge(table, own)
    for receiver in table["receivers"]:
        receiver["gaps"] = (away or {}).get(receiver["name"], [])
    return table


def simulated(path: Path, table: dict) -> Path:
    write_log(read_scenario(table), path)
    return path


def run(log: Path, out: Path, pipeline: str = "network-ins-tc", **settings) -> Path:
    with LogReader(log) as reader:
        replay_log(reader, out, make_job(reader, pipeline, tables=[settings]))
    return out


@pytest.fixture(scope="module")
def flight(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("flight")
    return simulated(folder / "in.mcap", scenario())


@pytest.fixture(scope="module")
def network(flight) -> Path:
    return run(flight, flight.parent / "network.mcap", network={"baselines": "all"})


def test_every_integer_is_the_simulated_one_and_triangles_close(network):
    found = network_figures(read_network_run(network), settling_s=SETTLED_S)
    assert found.epochs.basis == "integers"
    assert found.epochs.fixed > 0.99 * found.epochs.attempted
    assert found.epochs.wrong == 0
    assert found.stations is not None
    assert len(found.stations.baselines) == 6
    for lanes in found.stations.baselines.values():
        assert all(lane.judged > 1000 and lane.wrong == 0 for lane in lanes.values())
    assert len(found.stations.closures) == 4
    assert all(c.checked > 1000 and c.exceptions == 0 for c in found.stations.closures)


def test_decimetres_of_error_become_centimetres(network, flight):
    whole = network_figures(read_network_run(network), settling_s=SETTLED_S)
    alone = run(flight, flight.parent / "single.mcap", mode="single")
    single = network_figures(read_network_run(alone), settling_s=SETTLED_S)
    for axis in ("north", "east", "height"):
        error = whole.position_cm[axis]
        assert abs(error.mean) + error.std < 3.0
    worst = max(abs(e.mean) + e.std for e in single.position_cm.values())
    assert worst > 10.0
    for signal in whole.residuals.values():
        assert signal.after_rms_m < 0.2 * signal.before_rms_m
    with LogReader(alone) as reader:
        assert not any(channels.NETWORK_CORRECTIONS.matches(t) for t in reader.channels)


def test_a_run_over_the_recorded_corrections_gives_the_same(network):
    """Stages whose outputs are in the log are not run again, and nothing is lost by it."""
    again = run(network, network.parent / "again.mcap", name="again")
    with LogReader(network) as first, LogReader(again) as second:
        a = first.read(channels.SOLUTION.at(run="network-ins-tc"))
        b = second.read(channels.SOLUTION.at(run="again"))
    assert content("SOLUTION", a) == content("SOLUTION", b)


def test_a_station_that_drops_out_is_done_without(tmp_path):
    away = {"ref1": [[100.0, 160.0]]}
    log = simulated(tmp_path / "in.mcap", scenario(away=away))
    found = read_network_run(run(log, tmp_path / "run.mcap"))
    assert found.corrections is not None
    with LogReader(log) as reader:
        start = reader.start_ns
    t = (found.corrections.valid_time_ns - start) / NS
    stations = found.corrections["station_count"]
    # Its errors serve for ten seconds more; afterwards two stations are left.
    assert stations[(t > 95.0) & (t < 99.0)].max() == 3
    assert stations[(t > 112.0) & (t < 158.0)].max() == 2
    assert stations[t > 200.0].max() == 3
    figures = network_figures(found, settling_s=SETTLED_S)
    assert figures.epochs.wrong == 0
    errors, _ = solution_errors(found, start + int(SETTLED_S) * NS)
    assert np.abs(errors.values).max() < 10.0 * CM


def test_a_network_must_be_told_its_master_and_have_stations(flight, tmp_path):
    out = tmp_path / "out.mcap"
    with pytest.raises(UsageError, match="master"):
        run(flight, out, gnss={"receiver": "rover", "base": ""})
    with pytest.raises(MissingChannelError, match="nowhere"):
        run(flight, out, network={"stations": ["ref1", "nowhere"]})
    with pytest.raises(UsageError, match="none of them the rover"):
        run(flight, out, network={"stations": ["rover"]})


def test_a_virtual_station_serves_a_rover_without_a_network(flight, tmp_path):
    """Its observations with the plain pipeline: integers at once, as from a base nearby."""
    virtual = run(flight, tmp_path / "virtual.mcap", "network-virtual")
    out = run(
        virtual, tmp_path / "rtk.mcap", "rtk",
        gnss={"receiver": "rover", "base": "vrs", "systems": "G"}, base={"max_age": 2.0},
    )  # fmt: skip
    with LogReader(out) as reader:
        solution = reader.read(channels.SOLUTION.at(run="rtk"))
        truth = reader.read(channels.TRUTH.topic)
        start = reader.start_ns
    late = (solution.valid_time_ns - start) / NS > 90.0
    fixed = solution["status"] == solution_pb2.SOLUTION_STATUS_FIXED
    assert fixed[late].mean() > 0.95
    true = np.array(
        [
            np.interp(
                solution.valid_time_ns[late & fixed],
                truth.valid_time_ns,
                truth["position_ecef_m"][:, axis],
            )
            for axis in range(3)
        ]
    ).T
    assert (late & fixed).sum() > 50
    miss = np.linalg.norm(solution["position_ecef_m"][late & fixed] - true, axis=1)
    assert np.sqrt(np.mean(miss**2)) < 5.0 * CM
