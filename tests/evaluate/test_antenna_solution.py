"""A solution that knows no attitude, no velocity, no state."""

from __future__ import annotations

import dataclasses
import io
import json

import numpy as np
import pytest
from rich.console import Console
from small_channels import at, moved, place, solution_rows, truth_rows

from replay import channels
from replay.batch.figures import key_figures
from replay.evaluate import RunChannels, evaluate_channels, evaluate_run, print_evaluation
from replay.evaluate.errors_enu import position_errors, velocity_errors
from replay.log.columns import Columns
from replay.log.writer import LogWriter
from replay.schemas import solution_pb2

T = np.arange(0.0, 30.0)
N = len(T)
STILL = place(np.zeros((N, 3)))
SINGLE = solution_pb2.SOLUTION_STATUS_SINGLE
OPTIONAL = (
    "velocity_enu_m_s", "attitude_rad", "angular_rate_body_rad_s", "velocity_std_enu_m_s",
    "attitude_std_rad",
)  # fmt: skip


def antenna_rows(position, *, absent=OPTIONAL, whole=True, status=SINGLE):
    """A solution without some fields: as a log tells it, or (whole=False) without columns."""
    rows = solution_rows(T, position, status=status)
    values = dict(rows.values)
    for name in absent:
        values.pop(name)
        if whole:
            values[name] = np.full((N, 3), np.nan)
    present = {name: np.zeros(N, dtype=bool) for name in absent} if whole else {}
    return dataclasses.replace(rows, values=values, present=present)


@pytest.mark.parametrize("whole", [True, False])
def test_an_antenna_is_compared_as_it_stands(whole):
    offset = np.array([3.0, 4.0, 12.0])
    solution = antenna_rows(place(np.tile(offset, (N, 1))), whole=whole)
    attitude = np.tile([0.1, -0.2, 0.7], (N, 1))
    truth = truth_rows(T, STILL, lever=(1.0, 0.4, -0.8), attitude=attitude)
    np.testing.assert_allclose(
        position_errors(solution, truth).values, np.tile(offset, (N, 1)), atol=1e-4
    )
    found = evaluate_channels(RunChannels(run="a", solution=solution, truth=truth))
    assert found.solution_of == "antenna"
    assert found.position_error_m["3d"].mean == pytest.approx(13.0, abs=1e-4)
    assert found.velocity_error_m_s is None and found.attitude_error_deg is None
    assert found.nees.position is not None
    assert found.nees.velocity is None and found.nees.attitude is None
    assert (found.geometry, found.ambiguities, found.availability) == (None, None, None)
    assert found.position_error_fixed_m is None


def test_truth_is_moved_to_a_known_antenna():
    """With a lever arm of the antenna and attitude of truth no distance is left over."""
    arm, lever = np.array([-0.4, 0.15, -1.2]), (1.0, 0.4, -0.8)
    attitude = np.column_stack([0.02 * np.sin(T), 0.05 * np.cos(T), 0.2 * T])
    solution = antenna_rows(moved(STILL, attitude, arm))
    truth = truth_rows(T, moved(STILL, attitude, lever), lever=lever, attitude=attitude)
    found = position_errors(solution, truth, antenna_arm_m=arm)
    np.testing.assert_allclose(found.values, 0.0, atol=1e-6)
    left = position_errors(solution, truth)
    assert np.linalg.norm(left.values, axis=1).min() > 1.0
    bare = truth_rows(T, STILL)
    away = position_errors(solution, bare, antenna_arm_m=arm)
    np.testing.assert_allclose(np.linalg.norm(away.values, axis=1), np.linalg.norm(arm), atol=1e-6)


def test_rows_with_attitude_among_others_are_moved():
    lever = (1.0, 0.4, -0.8)
    attitude = np.tile([0.1, -0.2, 0.7], (N, 1))
    point = moved(STILL, attitude, lever)
    has = np.arange(N) >= 10
    rows = solution_rows(T, np.where(has[:, None], STILL, point), attitude=attitude)
    values = dict(rows.values) | {"attitude_rad": np.where(has[:, None], attitude, np.nan)}
    mixed = dataclasses.replace(rows, values=values, present={"attitude_rad": has})
    truth = truth_rows(T, point, lever=lever, attitude=attitude)
    np.testing.assert_allclose(position_errors(mixed, truth).values, 0.0, atol=1e-6)
    found = evaluate_channels(RunChannels(run="a", solution=mixed, truth=truth))
    assert found.solution_of == "both"
    assert found.counts.attitude_rows == N - 10


def test_attitude_that_is_lost_is_no_antenna():
    """Not a number where the field is there: the rows are left out, as ever."""
    rows = solution_rows(T, STILL, attitude=np.full((N, 3), np.nan))
    found = position_errors(rows, truth_rows(T, STILL, lever=(1.0, 0.0, 0.0)))
    assert len(found) == 0


def test_velocity_of_an_antenna():
    solution = antenna_rows(STILL, absent=OPTIONAL[1:])
    speed = np.tile([1.0, 2.0, -0.5], (N, 1))
    truth = truth_rows(T, STILL, velocity=speed, lever=(1.0, 0.0, 0.0))
    np.testing.assert_allclose(velocity_errors(solution, truth).values, -speed, atol=1e-12)


def test_what_is_not_known_is_null_and_said():
    found = evaluate_channels(
        RunChannels(run="a", solution=antenna_rows(STILL), truth=truth_rows(T, STILL))
    )
    plain = found.to_json_dict()
    for key in (
        "velocity_error_m_s", "attitude_error_deg", "geometry", "ambiguities", "availability",
        "position_error_fixed_m", "nis",
    ):  # fmt: skip
        assert plain[key] is None, key
    assert plain["position_change_error_m"]["up"]["std"] == pytest.approx(0.0, abs=1e-6)
    json.dumps(plain, allow_nan=False)
    out = io.StringIO()
    print_evaluation(found, Console(file=out, width=140))
    assert out.getvalue().count("not known to both") == 4
    assert "about an antenna" in out.getvalue()


def test_a_run_over_positions_keeps_its_key_figures():
    run = RunChannels(run="a", solution=solution_rows(T, STILL), truth=truth_rows(T, STILL))
    assert not any("change" in group for group in key_figures(evaluate_channels(run)))


def test_absent_fields_come_back_from_a_log(tmp_path):
    path = tmp_path / "spp.mcap"
    topic = channels.SOLUTION.at(run="spp")
    rows: dict[str, Columns] = {topic: antenna_rows(STILL), "/truth": truth_rows(T, STILL)}
    with LogWriter(path) as writer:
        writer.add_channel(topic, "replay.Solution")
        writer.add_channel("/truth", "replay.Truth")
        writer.write(rows)
    found = evaluate_run(path)
    assert found.solution_of == "antenna"
    assert found.counts.compared_rows == N
    assert found.start_ns == at(0.0)
