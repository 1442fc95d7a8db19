"""Smoothing of a run: against the truth of simulated drives, and as a part of the engine."""

import tracemalloc

import numpy as np
import pytest

from replay import channels
from replay.engine.job import make_job
from replay.engine.replayer import Replayer
from replay.engine.run import replay_log, verify_run
from replay.engine.sink import DigestSink
from replay.errors import ExitCode, MissingChannelError
from replay.evaluate.errors_enu import attitude_errors, position_errors, velocity_errors
from replay.log.backwards import backwards
from replay.log.reader import LogReader
from replay.stages.smooth_pass import smooth_backwards
from tests.engine.drives import FULL, PIPELINE, SECOND, TRUTH

RECORD = {"smoothing": {"record": True}}
EVERYTHING = {**FULL, **RECORD, "stops": {"zero_velocity": True, "zero_rate": True}}
SMOOTHED = f"{PIPELINE}-smoothed"
TRANSITION = channels.FILTER_TRANSITION.at(run=PIPELINE)
OUTAGE_S = (24.0, 29.0)


def run(log, target, pipeline=PIPELINE, *tables):
    with LogReader(log) as reader:
        return replay_log(reader, target, make_job(reader, pipeline, tables=tables))


def read(log, topic):
    with LogReader(log) as reader:
        return reader.read(topic)


@pytest.fixture(scope="module")
def recorded(short_log, tmp_path_factory):
    """A run with every update that the loosely coupled filter knows."""
    target = tmp_path_factory.mktemp("smooth") / "run.mcap"
    run(short_log, target, PIPELINE, EVERYTHING)
    return target


@pytest.fixture(scope="module")
def smoothed(recorded, tmp_path_factory):
    target = tmp_path_factory.mktemp("smooth") / "smoothed.mcap"
    run(recorded, target, "smooth")
    return target


def matrices(columns, k):
    """Transition matrix, predicted and updated covariance of a node."""
    n, before = int(columns["dimension"][k]), int(columns["dimension_before"][k])
    phi = np.zeros((n, before))
    rows, places = columns.ragged("row").row(k), columns.ragged("column").row(k)
    phi[rows, places] = columns.ragged("value").row(k)
    found = [phi]
    for name in ("predicted_upper_triangle", "updated_upper_triangle"):
        triangle = columns.ragged(name).row(k)
        P = np.zeros((n, n))
        P[np.triu_indices(n)] = triangle if len(triangle) else P[np.triu_indices(n)]
        found.append(P + np.triu(P, 1).T if len(triangle) else found[-1])
    return found


def test_recording_changes_nothing_else(short_log, recorded, tmp_path):
    """Every channel but the trace has the same digest with and without the transitions."""
    plain = run(short_log, tmp_path / "plain.mcap", PIPELINE, {**EVERYTHING, "smoothing": {}})
    with LogReader(recorded) as reader:
        found = reader.digests()
    assert TRANSITION not in plain.outputs
    for topic, digest in plain.outputs.items():
        if topic != channels.TRACE.topic:
            assert found[topic].sha256 == digest.sha256


def test_nodes_follow_each_other_and_lack_noise_alone(recorded):
    """What a predicted covariance has beyond Phi P Phi' is that of noise: not negative.

    Nodes: one for each solution, and one for each update between them.
    """
    nodes = read(recorded, TRANSITION)
    said = read(recorded, channels.SOLUTION.at(run=PIPELINE))
    assert np.array_equal(nodes.valid_time_ns[nodes["solution"] > 0], said.valid_time_ns)
    assert np.count_nonzero(nodes["solution"] == 0) > 50
    updated = np.diff(nodes.ragged("correction").offsets) > 0
    assert np.all(updated[nodes["solution"] == 0])
    assert nodes["dimension_before"][0] == 0
    assert np.all(nodes["since_ns"][1:] == nodes.valid_time_ns[:-1])
    before = matrices(nodes, 0)[2]
    for k in range(1, len(nodes)):
        phi, predicted, after = matrices(nodes, k)
        scale = 1.0 / np.sqrt(np.diag(predicted))
        noise = (predicted - phi @ before @ phi.T) * np.outer(scale, scale)
        assert np.linalg.eigvalsh(noise).min() > -1e-12
        gained = (predicted - after) * np.outer(scale, scale)
        assert np.linalg.eigvalsh(gained).min() > -1e-12
        before = after


def outage_of(errors, log):
    with LogReader(log) as reader:
        start = reader.start_ns
    since = (errors.times_ns - start) / SECOND
    return errors.values[(since > OUTAGE_S[0]) & (since < OUTAGE_S[1])]


def test_an_outage_is_bridged_from_both_ends(smoothed):
    """In the outage the largest error falls to less than a third; attitude and speed gain too."""
    truth = read(smoothed, TRUTH)
    forward = read(smoothed, channels.SOLUTION.at(run=PIPELINE))
    backward = read(smoothed, channels.SOLUTION.at(run=SMOOTHED))
    assert len(forward) == len(backward)
    assert np.array_equal(forward["status"], backward["status"])
    worst = [
        np.abs(outage_of(position_errors(rows, truth), smoothed)).max()
        for rows in (forward, backward)
    ]
    assert worst[1] < worst[0] / 3
    for errors in (position_errors, velocity_errors, attitude_errors):
        was, now = (np.mean(errors(rows, truth).values ** 2) for rows in (forward, backward))
        assert now < was


def test_smoothed_deviations_are_smaller_and_kept_by_states(smoothed):
    """Each state's deviation shrinks or stays; state and solution of an epoch are the same."""
    own = read(smoothed, channels.FILTER_COVARIANCE.at(run=PIPELINE))
    found = read(smoothed, channels.FILTER_COVARIANCE.at(run=SMOOTHED))
    n = int(own["dimension"][0])
    diagonal = np.concatenate([[0], np.cumsum(np.arange(n, 1, -1))])
    place = np.searchsorted(own.valid_time_ns, found.valid_time_ns)
    before = own.ragged("upper_triangle").values.reshape(len(own), -1)[place][:, diagonal]
    after = found.ragged("upper_triangle").values.reshape(len(found), -1)[:, diagonal]
    assert np.all(after <= before * (1.0 + 1e-9))
    assert np.median(after[:, :9] / before[:, :9]) < 0.8
    states = read(smoothed, channels.FILTER_STATE.at(run=SMOOTHED))
    solution = read(smoothed, channels.SOLUTION.at(run=SMOOTHED))
    assert np.array_equal(states.valid_time_ns, found.valid_time_ns)
    at = np.searchsorted(solution.valid_time_ns, states.valid_time_ns)
    assert np.array_equal(solution["position_ecef_m"][at], states["position_ecef_m"])
    norms = np.linalg.norm(states["q_body_to_ecef"], axis=1)
    np.testing.assert_allclose(norms, 1.0, atol=1e-12)


def test_the_end_is_where_the_filter_ended(short_log, tmp_path):
    """After the last node nothing is known that the filter did not know."""
    plain = {
        **RECORD,
        "non_holonomic": {"enabled": False},
        "stops": {"zero_velocity": False, "zero_rate": False},
    }
    run(short_log, tmp_path / "run.mcap", PIPELINE, plain)
    run(tmp_path / "run.mcap", tmp_path / "smoothed.mcap", "smooth")
    forward = read(tmp_path / "smoothed.mcap", channels.SOLUTION.at(run=PIPELINE))
    backward = read(tmp_path / "smoothed.mcap", channels.SOLUTION.at(run=SMOOTHED))
    for name, least in (
        ("position_ecef_m", 1e-8),
        ("velocity_enu_m_s", 1e-12),
        ("attitude_rad", 1e-14),
        ("angular_rate_body_rad_s", 1e-15),
        ("position_covariance_enu_m2", 1e-14),
        ("attitude_std_rad", 1e-14),
    ):
        np.testing.assert_allclose(backward[name][-1], forward[name][-1], atol=least, rtol=1e-12)
        assert np.abs(backward[name][10] - forward[name][10]).max() > least


def test_runs_are_equal_and_can_be_verified(recorded, smoothed, tmp_path):
    """Bit for bit, and also after a checkpoint."""
    again = run(recorded, tmp_path / "again.mcap", "smooth")
    with LogReader(smoothed) as reader:
        first = reader.digests()
    for topic, digest in again.outputs.items():
        assert first[topic].sha256 == digest.sha256
    assert verify_run(smoothed, recorded).exit_code is ExitCode.OK
    with LogReader(recorded) as reader:
        job = make_job(reader, "smooth", tables=[], checkpoint_every_s=7)
        replay_log(reader, tmp_path / "marked.mcap", job)
        result = replay_log(reader, tmp_path / "resumed.mcap", job, resume=tmp_path / "marked.mcap")
    for topic in (channels.SOLUTION.at(run=SMOOTHED), channels.FILTER_STATE.at(run=SMOOTHED)):
        assert result.outputs[topic].sha256 == first[topic].sha256


def test_it_does_not_matter_how_rows_are_batched(recorded, smoothed, monkeypatch):
    """Forwards in batches of any size, backwards in slices of any number of chunks."""
    with LogReader(smoothed) as reader:
        expected = reader.digests()
    plain = LogReader.batches
    monkeypatch.setattr(
        LogReader,
        "batches",
        lambda self, *args, **keys: plain(self, *args, **{**keys, "target_rows": 997}),
    )
    with LogReader(recorded) as reader:
        sink = DigestSink()
        Replayer(reader, make_job(reader, "smooth", tables=[])).run(sink)
    for topic, digest in sink.digests().items():
        assert digest.sha256 == expected[topic].sha256


@pytest.mark.parametrize("chunks", [1, 3])
def test_rows_come_backwards_as_they_come_forwards(recorded, chunks):
    """All of them, in slices that follow each other, over any stretch of the log."""
    with LogReader(recorded) as reader:
        whole = reader.read(TRANSITION)
        middle = (reader.start_ns + reader.end_ns) // 2
        for start, end in ((None, None), (middle, None), (None, middle)):
            slices = list(backwards(reader, TRANSITION, start_ns=start, end_ns=end, chunks=chunks))
            assert len(slices) > 1
            times = np.concatenate([rows.log_time_ns for rows in reversed(slices)])
            keep = np.ones(len(whole), dtype=bool)
            if start is not None:
                keep &= whole.log_time_ns >= start
            if end is not None:
                keep &= whole.log_time_ns < end
            assert np.array_equal(times, whole.log_time_ns[keep])


def test_forward_and_backward_filters_combined_say_the_same(recorded, smoothed, tmp_path):
    """Position, velocity, attitude and their deviations; copies of states are singular there."""
    run(recorded, tmp_path / "combined.mcap", "smooth", {"smooth": {"method": "combination"}})
    topic = channels.SOLUTION.at(run=SMOOTHED)
    one, other = read(smoothed, topic), read(tmp_path / "combined.mcap", topic)
    np.testing.assert_allclose(other["position_ecef_m"], one["position_ecef_m"], atol=1e-6)
    np.testing.assert_allclose(other["velocity_enu_m_s"], one["velocity_enu_m_s"], atol=1e-7)
    turned = np.mod(other["attitude_rad"] - one["attitude_rad"] + np.pi, 2 * np.pi) - np.pi
    assert np.abs(turned).max() < 1e-7
    for name in ("position_covariance_enu_m2", "velocity_std_enu_m_s", "attitude_std_rad"):
        scale = np.abs(one[name]).max(axis=1)
        assert (np.abs(other[name] - one[name]).max(axis=1) / scale).max() < 1e-5


@pytest.mark.parametrize("method", ["rts", "combination"])
def test_memory_does_not_grow_with_the_log(recorded, method):
    """Twice the nodes, the same peak: a slice is in memory, the rest is on disk."""
    with LogReader(recorded) as reader:
        slices = list(backwards(reader, TRANSITION, chunks=1))
        nodes = slices[len(slices) // 2]
    # A run that goes on and on: the same slice as often as is asked for.
    first = dict(nodes.values)
    first["dimension_before"] = nodes["dimension_before"].copy()
    first["dimension_before"][0] = 0
    alone = type(nodes)(nodes.log_time_ns, nodes.valid_time_ns, nodes.sequence, first)
    peaks = []
    for count in (10, 100):
        tracemalloc.start()
        smooth_backwards((alone for _ in range(count)), "here", method)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0] + 20_000


def test_a_run_that_was_not_recorded_says_how_to(short_run):
    with LogReader(short_run) as reader:
        job = make_job(reader, "smooth", tables=[])
        with pytest.raises(MissingChannelError, match=r"smoothing\.record=true"):
            Replayer(reader, job)


def test_a_run_is_chosen_by_its_name(recorded, short_log, tmp_path):
    """Of two runs one must be named; the smoothed run is named after it, or as is asked for."""
    second = {**EVERYTHING, "name": "second"}
    run(recorded, tmp_path / "two.mcap", PIPELINE, second)
    with LogReader(tmp_path / "two.mcap") as reader:
        with pytest.raises(MissingChannelError, match=r"smooth\.run="):
            Replayer(reader, make_job(reader, "smooth", tables=[]))
        job = make_job(reader, "smooth", tables=[{"smooth": {"run": "second"}}])
        outputs = Replayer(reader, job).nodes[-1].outputs
        assert outputs["SOLUTION"] == "/solution/second-smoothed"
        named = make_job(reader, "smooth", tables=[{"name": "x", "smooth": {"run": "second"}}])
        assert Replayer(reader, named).nodes[-1].outputs["SOLUTION"] == "/solution/x"
