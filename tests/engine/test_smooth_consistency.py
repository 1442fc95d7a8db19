"""Smoothed errors are as large as the smoothed covariances say, in an outage too.

Drives that the filter's model describes exactly: white noise, biases drawn once.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from replay import channels
from replay.configuration import merge
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.evaluate.errors_enu import position_errors
from replay.log.reader import LogReader
from replay.simulate import read_scenario, write_log
from tests.engine.drives import IMU, PIPELINE, SECOND, TRUTH, short_scenario
from tests.stages.test_filter_consistency import MODEL, PLAIN, errors_of, limits

SEEDS = tuple(range(201, 207))
OUTAGE_S = (70.0, 85.0)
MIDDLE_S = 77.5
SMOOTHED = f"{PIPELINE}-smoothed"


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """Per drive: errors of the smoothed states, and of both runs' solutions in the outage."""
    folder = tmp_path_factory.mktemp("drives")
    made = []
    for seed in SEEDS:
        table = short_scenario(**MODEL, seed=seed)
        merge(table, {"gnss": {"outages": [list(OUTAGE_S)]}})
        write_log(read_scenario(table), folder / "in.mcap")
        with LogReader(folder / "in.mcap") as reader:
            tables = [PLAIN, {"smoothing": {"record": True}}]
            replay_log(reader, folder / "run.mcap", make_job(reader, PIPELINE, tables=tables))
        with LogReader(folder / "run.mcap") as reader:
            job = make_job(reader, "smooth", tables=[])
            replay_log(reader, folder / "smoothed.mcap", job)
        with LogReader(folder / "smoothed.mcap") as reader:
            rows = {topic: reader.read(topic) for topic in (TRUTH, IMU)}
            solutions = [reader.read(channels.SOLUTION.at(run=r)) for r in (PIPELINE, SMOOTHED)]
            states = reader.read(channels.FILTER_STATE.at(run=SMOOTHED))
            covariances = reader.read(channels.FILTER_COVARIANCE.at(run=SMOOTHED))
        n = int(covariances["dimension"][0])
        full = np.zeros((len(covariances), n, n))
        i, j = np.triu_indices(n)
        full[:, i, j] = covariances.ragged("upper_triangle").values.reshape(len(full), -1)
        full[:, j, i] = full[:, i, j]
        errors = errors_of(SimpleNamespace(states=states, covariances=full), rows)
        made.append((errors, [middle(rows[TRUTH], rows[IMU], said) for said in solutions]))
    return made


def middle(truth, imu, solution):
    """Error (3,) and covariance (3, 3) of position in the middle of the outage; east, north, up."""
    errors = position_errors(solution, truth)
    since = (errors.times_ns - imu.valid_time_ns[0]) / SECOND
    at = int(np.argmin(np.abs(since - MIDDLE_S)))
    assert abs(since[at] - MIDDLE_S) < 0.1
    c = solution["position_covariance_enu_m2"][errors.rows[at]]
    return errors.values[at], np.array([[c[0], c[1], c[2]], [c[1], c[3], c[4]], [c[2], c[4], c[5]]])


@pytest.mark.parametrize("name", ["position", "velocity", "attitude"])
def test_smoothed_errors_are_as_large_as_stated(drives, name):
    """One value for each drive: the mean over the part that knows its heading."""
    means = [errors.normalized(name)[errors.elapsed_s > 30.0].mean() for errors, _ in drives]
    low, high = limits(len(SEEDS), 3)
    assert low < np.mean(means) < high


def test_in_the_middle_of_an_outage_they_are_small_and_as_stated(drives):
    """A sixth of the filter's own, and honest."""
    forward, backward = zip(*(found for _, found in drives), strict=True)
    size = [np.sqrt(np.mean([e @ e for e, _ in found])) for found in (forward, backward)]
    assert size[1] < size[0] / 6
    low, high = limits(len(SEEDS), 3)
    assert low < np.mean([e @ np.linalg.solve(C, e) for e, C in backward]) < high
