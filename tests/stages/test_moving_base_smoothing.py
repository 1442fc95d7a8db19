"""The baseline between two receivers that move, smoothed: ambiguities of the end from the start."""

import dataclasses

import numpy as np
import pytest

from replay import channels, configuration
from replay.schemas import solution_pb2
from replay.stages.base import BASE, Context, Port
from replay.stages.rtk import Rtk
from replay.stages.rtk_config import MovingBaseConfig, RtkConfig
from replay.stages.smooth import Smoother
from replay.stages.smooth_config import SmoothConfig
from tests.stages.test_rtk import AXES, MM, drive, pair, still
from tests.stages.two_receivers import fixed_base, make_sky, run_stage, whole

APART = np.array([1.2, 0.9, 0.3]) @ AXES
EPOCHS = 40
TRANSITION = channels.FILTER_TRANSITION
READ = (TRANSITION, channels.SOLUTION, channels.RELATIVE_POSITION)


def two_that_move(mode):
    """What the filter says of two receivers on one vehicle, both coarsely placed."""
    sky = make_sky()
    base_path = drive([0, 0, 0], [12.0, 5.0, 0.2])
    block, _ = pair(
        sky, lambda t: base_path(t) + APART, range(EPOCHS), base_path=base_path,
        rover={"code": 0.4, "phase": 2 * MM}, base={"code": 0.4, "phase": 2 * MM},
    )  # fmt: skip
    coarse = block[Port(channels.COARSE, BASE).name]
    random = np.random.default_rng(3)
    values = dict(coarse.values)
    values["position_ecef_m"] = np.array([base_path(float(k)) for k in range(EPOCHS)])
    values["position_ecef_m"] += random.normal(size=(EPOCHS, 3)) * 3.0
    block[Port(channels.COARSE, BASE).name] = dataclasses.replace(coarse, values=values)
    return block, {"rtk": {"ambiguities": {"mode": mode}}}


def run(block, table, cls=MovingBaseConfig, record=True):
    parts = run_stage(Rtk(record=record), configuration.build(cls, [table]), [block])
    return {channel.name: whole(parts, channel) for channel in READ[0 if record else 1 :]}


def smooth(said, method="rts"):
    stage = Smoother("it", inertial=False, relative=True)
    topics = {channel.name: channel.at(run="it") for channel in READ}
    context = Context(topics, {}, lambda name: iter([said[name]]))
    config = configuration.build(SmoothConfig, [{"smooth": {"method": method}}])
    return stage.step(stage.start(config, context), said)[1]


def covariances(rows):
    c = rows["covariance_enu_m2"]
    return np.stack([c[:, [0, 1, 2]], c[:, [1, 3, 4]], c[:, [2, 4, 5]]], axis=1)


@pytest.fixture(scope="module")
def floats():
    block, table = two_that_move("float")
    return block, table, run(block, table)


def test_recording_changes_nothing_else(floats):
    block, table, said = floats
    plain = run(block, table, record=False)
    for name, rows in plain.items():
        for field in rows.values:
            assert np.array_equal(rows[field], said[name][field], equal_nan=True)


def test_the_baseline_of_the_first_epoch_is_as_good_as_that_of_the_last(floats):
    said = floats[2]
    forward, nodes = said[channels.RELATIVE_POSITION.name], said[TRANSITION.name]
    assert nodes.ragged("state_names").blobs()[0].startswith(b"baseline_ecef_x,")
    outputs = smooth(said)
    assert channels.SOLUTION.name not in outputs
    rows = outputs[channels.RELATIVE_POSITION.name]
    assert np.array_equal(rows.valid_time_ns, forward.valid_time_ns)
    assert np.array_equal(rows["status"], forward["status"])
    # What is wrong with the ambiguities in the end is common to all epochs; the rest is noise.
    was, now = (np.linalg.norm(r["baseline_ecef_m"].std(axis=0)) for r in (forward, rows))
    assert now < was / 10
    assert now < 10 * MM
    # East, north, up at the base differ by a millionth with where it is taken to be.
    np.testing.assert_allclose(
        np.linalg.norm(rows["baseline_enu_m"], axis=1), rows["length_m"], rtol=1e-12
    )
    np.testing.assert_allclose(rows["baseline_ecef_m"][-1], forward["baseline_ecef_m"][-1],
                               atol=1e-8)  # fmt: skip
    np.testing.assert_allclose(rows["heading_rad"][-1], forward["heading_rad"][-1], atol=1e-5)
    for before, after in zip(covariances(forward), covariances(rows), strict=True):
        assert np.linalg.eigvalsh((before - after) / np.trace(before)).min() > -1e-5
    assert rows["heading_std_rad"][0] < forward["heading_std_rad"][0] / 5


def test_smoothed_baselines_are_as_far_off_as_stated(floats):
    """All errors of a run go together: there is one value to test."""
    rows = smooth(floats[2])[channels.RELATIVE_POSITION.name]
    truth = np.linalg.norm(APART)
    sigma = rows["length_std_m"]
    assert np.abs((rows["length_m"] - truth) / sigma).max() < 4.0


def test_forward_and_backward_filters_combined_say_the_same(floats):
    """Ambiguities share 11 m that nothing measures: two digits are left of the covariance."""
    one, other = (
        smooth(floats[2], method)[channels.RELATIVE_POSITION.name]
        for method in ("rts", "combination")
    )
    np.testing.assert_allclose(other["baseline_ecef_m"], one["baseline_ecef_m"], atol=1e-5)
    np.testing.assert_allclose(other["length_std_m"], one["length_std_m"], rtol=2e-2)


def test_integers_that_the_states_do_not_know_are_smoothed_as_floats():
    said = run(*two_that_move("continuous"))
    fixed = said[channels.RELATIVE_POSITION.name]["status"] == solution_pb2.SOLUTION_STATUS_FIXED
    assert fixed.sum() > EPOCHS // 2
    rows = smooth(said)[channels.RELATIVE_POSITION.name]
    assert np.all(rows["status"][fixed] == solution_pb2.SOLUTION_STATUS_FLOAT)
    # Not about where the integers put it.
    assert np.abs(rows["baseline_ecef_m"] - APART).max() < 0.2


def test_over_a_base_that_stands_place_and_baseline_go_together():
    """The smoothed place less the smoothed baseline is the base's place."""
    noise = {"code": 0.4, "phase": 2 * MM}
    block, _ = pair(make_sky(), still([300, 200, 5]), range(20), rover=noise, base=noise)
    said = run(fixed_base(block), {"rtk": {"ambiguities": {"mode": "float"}}}, RtkConfig)
    outputs = smooth(said)
    place = outputs[channels.SOLUTION.name]["position_ecef_m"]
    apart = outputs[channels.RELATIVE_POSITION.name]["baseline_ecef_m"]
    own = said[channels.SOLUTION.name]["position_ecef_m"]
    base = own - said[channels.RELATIVE_POSITION.name]["baseline_ecef_m"]
    np.testing.assert_allclose(place - apart, base, atol=1e-8)
    assert np.abs(place - own)[0].max() > 1e-4
