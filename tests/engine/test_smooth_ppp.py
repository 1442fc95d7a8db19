"""Precise point positioning recorded and smoothed: simulated drive, and a real station."""

from pathlib import Path

import numpy as np
import pytest

from replay import channels
from replay.engine.job import make_job
from replay.engine.run import replay_log, verify_run
from replay.errors import ExitCode
from replay.evaluate.errors_enu import position_errors
from replay.importers import import_log
from replay.log.reader import LogReader
from replay.simulate import simulate
from tests.conftest import ROOT
from tests.stages.precise_logs import FOLDERS, SIGNALS, folder_of

SCENARIO = Path(__file__).parents[2] / "recordings" / "kan-short" / "scenario.toml"
LEVER_M = np.array([-0.40, 0.15, -1.20])
"""Of the rover's antenna, as the scenario has it."""
SHORT = {
    "segments": [
        {"kind": "hold", "duration": "40 s"},
        {"kind": "speed", "to": "45 km/h"},
        {"kind": "straight", "duration": "30 s"},
        {"kind": "turn", "angle": "90 deg", "radius": "60 m"},
        {"kind": "straight", "duration": "40 s"},
        {"kind": "stop", "duration": "15 s"},
    ],
}
RECORD = {"smoothing": {"record": True}}
FORWARD, BACKWARD = (channels.SOLUTION.at(run=run) for run in ("ppp", "ppp-smoothed"))
TRANSITION = channels.FILTER_TRANSITION.at(run="ppp")
SECOND = 1_000_000_000


def run(log, target, pipeline, *tables, **keys):
    with LogReader(log) as reader:
        return replay_log(reader, target, make_job(reader, pipeline, tables=tables, **keys))


def read(log, *topics):
    with LogReader(log) as reader:
        return [reader.read(topic) for topic in topics]


def covariances(rows):
    c = rows["position_covariance_enu_m2"]
    return np.stack([c[:, [0, 1, 2]], c[:, [1, 3, 4]], c[:, [2, 4, 5]]], axis=1)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    path = tmp_path_factory.mktemp("drive") / "in.mcap"
    simulate(SCENARIO, path, tables=[SHORT])
    return path


@pytest.fixture(scope="module")
def recorded(drive, tmp_path_factory):
    target = tmp_path_factory.mktemp("ppp") / "run.mcap"
    run(drive, target, "ppp", RECORD)
    return target


@pytest.fixture(scope="module")
def smoothed(recorded, tmp_path_factory):
    target = tmp_path_factory.mktemp("ppp") / "smoothed.mcap"
    run(recorded, target, "smooth")
    return target


def test_recording_changes_nothing_else(drive, recorded, tmp_path):
    """Every channel but the trace has the same digest with and without the transitions."""
    plain = run(drive, tmp_path / "plain.mcap", "ppp")
    with LogReader(recorded) as reader:
        found = reader.digests()
    assert TRANSITION in found
    assert TRANSITION not in plain.outputs
    for topic, digest in plain.outputs.items():
        if topic != channels.TRACE.topic:
            assert found[topic].sha256 == digest.sha256


def test_a_drive_is_nearer_to_the_truth_and_errors_are_as_stated(smoothed):
    """One node for each solution; the last one stays; none is less sure than it was."""
    forward, backward, nodes, truth = read(
        smoothed, FORWARD, BACKWARD, TRANSITION, channels.TRUTH.topic
    )
    assert np.array_equal(backward.valid_time_ns, forward.valid_time_ns)
    assert np.array_equal(nodes.valid_time_ns, forward.valid_time_ns)
    assert np.array_equal(backward["status"], forward["status"])
    last = np.abs(backward["position_ecef_m"][-1] - forward["position_ecef_m"][-1])
    assert last.max() < 1e-8
    for was, now in zip(covariances(forward), covariances(backward), strict=True):
        assert np.linalg.eigvalsh((was - now) / np.trace(was)).min() > -1e-6
    errors = [position_errors(rows, truth, antenna_arm_m=LEVER_M) for rows in (forward, backward)]
    was, now = (np.sqrt(np.mean(found.values**2, axis=0)) for found in errors)
    # Speeds of the satellites' geometry are small in two minutes: what is gained is the noise.
    assert np.linalg.norm(now) < np.linalg.norm(was)
    scatter = [np.std(np.diff(found.values, axis=0), axis=0).max() for found in errors]
    assert scatter[1] < scatter[0] / 3
    found = errors[1]
    squares = [
        e @ np.linalg.solve(C, e) / 3
        for e, C in zip(found.values, covariances(backward)[found.rows], strict=True)
    ]
    # All errors of a run go together: of one draw of three values 99.9 % are below 16.3.
    assert np.mean(squares) < 16.3 / 3


def test_runs_are_equal_and_can_go_on_after_a_checkpoint(drive, recorded, smoothed, tmp_path):
    with LogReader(recorded) as reader:
        first = reader.digests()
    with LogReader(drive) as reader:
        job = make_job(reader, "ppp", tables=[RECORD], checkpoint_every_s=30)
        replay_log(reader, tmp_path / "marked.mcap", job)
        result = replay_log(reader, tmp_path / "resumed.mcap", job, resume=tmp_path / "marked.mcap")
    assert result.outputs[TRANSITION].sha256 == first[TRANSITION].sha256
    assert verify_run(smoothed, recorded).exit_code is ExitCode.OK


def test_forward_and_backward_filters_combined_say_the_same(recorded, smoothed, tmp_path):
    target = tmp_path / "combined.mcap"
    run(recorded, target, "smooth", {"smooth": {"method": "combination"}})
    (one,), (other,) = read(smoothed, BACKWARD), read(target, BACKWARD)
    np.testing.assert_allclose(other["position_ecef_m"], one["position_ecef_m"], atol=1e-6)
    P, Q = covariances(one), covariances(other)
    assert (np.abs(P - Q).max(axis=(1, 2)) / np.trace(P, axis1=1, axis2=2)).max() < 1e-6


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    """Two hours of a real station, kinematic, recorded and smoothed."""
    folder = tmp_path_factory.mktemp("esbc")
    name = FOLDERS["esbc"]
    import_log(ROOT / "recordings" / "specs" / f"{name}.toml", folder_of("esbc"), folder / "in")
    with LogReader(folder / "in") as reader:
        begin = int(read(folder / "in", channels.GNSS_OBS.at(receiver="esbc"))[0].log_time_ns[0])
        table = {
            "gnss": {"signals": SIGNALS["esbc"]}, "ppp": {"phases": {"gap": 65.0}}, **RECORD,
        }  # fmt: skip
        job = make_job(reader, "ppp", tables=[table], end_ns=begin + 2 * 3600 * SECOND)
        replay_log(reader, folder / "run", job)
    run(folder / "run", folder / "smoothed", "smooth")
    return folder / "smoothed"


def test_before_convergence_a_station_is_as_good_as_after_it(station):
    """The first half hour about where a day says that it stands: decimetres become centimetres."""
    mark = np.array([3582104.75, 532590.18, 5232755.13])
    mark += 0.216 * mark / np.linalg.norm(mark)
    forward, backward = read(station, FORWARD, BACKWARD)
    since = (forward.valid_time_ns - forward.valid_time_ns[0]) / SECOND
    early = since < 1800.0
    was, now = (
        np.sqrt(np.mean((rows["position_ecef_m"][early] - mark) ** 2))
        for rows in (forward, backward)
    )
    assert was > 0.05
    assert now < 0.03
    assert now < was / 4
    scatter = [rows["position_ecef_m"][early].std(axis=0).max() for rows in (forward, backward)]
    assert scatter[1] < scatter[0] / 10
