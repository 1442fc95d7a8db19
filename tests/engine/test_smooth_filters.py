"""Every filter's nodes are those of a Kalman filter, and smoothing them gives smaller errors.

One short drive with a base, on two frequencies, with an outage that leaves three satellites.
"""

from pathlib import Path

import numpy as np
import pytest

from replay import channels
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.evaluate.errors_enu import position_errors, velocity_errors
from replay.log.reader import LogReader
from replay.simulate import simulate
from tests.engine.test_smooth import matrices

SCENARIO = Path(__file__).parents[2] / "recordings" / "tang-short" / "scenario.toml"
SHORT = {
    "blockage": [{"kind": "outage", "begin": 30.0, "end": 37.0, "keep": 3}],
    "segments": [
        {"kind": "hold", "duration": 8.0},
        {"kind": "speed", "to": 10.0},
        {"kind": "turn", "angle": "90 deg", "radius": 30.0},
        {"kind": "straight", "duration": 12.0},
        {"kind": "turn", "angle": "-70 deg", "radius": 30.0},
        {"kind": "speed", "to": 3.0},
        {"kind": "straight", "duration": 12.0},
        {"kind": "speed", "to": 12.0},
        {"kind": "straight", "duration": 6.0},
    ],
}
FILTERS = {
    "kfspp": ("kfspp", {}),
    "tdcp": ("tdcp-ins", {}),
    "tdcp-each": ("tdcp-ins", {"tdcp_ins": {"measurement": "displacement"}}),
    "tight": ("gnss-ins-tc", {"tight": {"phase": True}}),
    "tight-21": ("gnss-ins-tc", {"filter": {"states": 21}}),
    "velocity": (
        "rtk",
        {"rtk": {"motion": {"dynamics": "velocity", "process_noise": 2.0, "ionosphere": True}}},
    ),
    "acceleration": (
        "rtk",
        {"rtk": {"motion": {"dynamics": "acceleration", "process_noise": 1.0}}},
    ),
    "free": ("rtk", {"rtk": {"motion": {"dynamics": "kinematic", "troposphere": True}}}),
    "rtk-ins": ("rtk-ins-tc", {"rtk": {"motion": {"ionosphere": True, "troposphere": True}}}),
}
# Codes that are late alike by metres make all positions wrong alike: there speed tells.
BETTER = {
    "kfspp": velocity_errors,
    "tight": velocity_errors,
    "tight-21": velocity_errors,
    "velocity": position_errors,
    "rtk-ins": position_errors,
}


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    path = tmp_path_factory.mktemp("drive") / "in.mcap"
    simulate(SCENARIO, path, tables=[SHORT])
    return path


@pytest.mark.parametrize("case", FILTERS)
def test_nodes_are_those_of_a_kalman_filter(case, drive, tmp_path):
    """P' - Phi P Phi' and P' - P have no negative eigenvalue; constants stay constants.

    States that go on have a column of Phi: no node forgets them all. Smoothed, the solution has
    a row for each node that had one, and is nearer to the truth.
    """
    pipeline, table = FILTERS[case]
    log = tmp_path / "run.mcap"
    with LogReader(drive) as reader:
        tables = [{"smoothing": {"record": True}}, table]
        replay_log(reader, log, make_job(reader, pipeline, tables=tables))
    with LogReader(log) as reader:
        nodes = reader.read(channels.FILTER_TRANSITION.at(run=pipeline))
        replay_log(reader, tmp_path / "smoothed.mcap", make_job(reader, "smooth", tables=[]))
    assert len(nodes) > 30
    linked, chosen = 0, range(1, len(nodes), 1 if nodes["dimension"].max() < 40 else 5)
    for k in chosen:
        after = matrices(nodes, k - 1)[2]
        phi, predicted, updated = matrices(nodes, k)
        scale = 1.0 / np.sqrt(np.maximum(np.diag(predicted), 1e-300))
        weigh = np.outer(scale, scale)
        assert np.linalg.eigvalsh((predicted - updated) * weigh).min() > -1e-12
        if nodes["dimension_before"][k]:
            assert nodes["since_ns"][k] == nodes.valid_time_ns[k - 1]
            noise = (predicted - phi @ after @ phi.T) * weigh
            assert np.linalg.eigvalsh(noise).min() > -1e-12
            linked += np.count_nonzero(phi) >= min(phi.shape) // 2
    assert linked > 0.9 * len(chosen)
    with LogReader(tmp_path / "smoothed.mcap") as reader:
        truth = reader.read(channels.TRUTH.topic)
        forward = reader.read(channels.SOLUTION.at(run=pipeline))
        backward = reader.read(channels.SOLUTION.at(run=f"{pipeline}-smoothed"))
    assert np.array_equal(backward.valid_time_ns, nodes.valid_time_ns[nodes["solution"] > 0])
    assert np.all(np.isin(backward.valid_time_ns, forward.valid_time_ns))
    if case in BETTER:
        was, now = (
            np.sqrt(np.mean(BETTER[case](rows, truth).values ** 2)) for rows in (forward, backward)
        )
        assert now < was
