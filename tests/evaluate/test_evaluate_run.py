"""A whole evaluation: its figures, its JSON, its table, and logs that lack something."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from rich.console import Console
from small_channels import (
    FIXED,
    place,
    position_innovations,
    solution_rows,
    truth_rows,
)

from replay import channels
from replay.errors import MissingChannelError, UsageError
from replay.evaluate import RunChannels, evaluate_channels, evaluate_run, print_evaluation
from replay.evaluate.statistics import by_axis, statistics_of
from replay.log.columns import Columns
from replay.log.writer import LogWriter

T = np.arange(0.0, 20.0, 0.5)
N = len(T)
FIGURES = {"mean", "std", "rms", "p95", "max"}


def offset_run(**truth):
    still = np.zeros((N, 3))
    return RunChannels(
        run="a",
        solution=solution_rows(T, place(still + np.array([3.0, 4.0, 12.0]))),
        truth=truth_rows(T, place(still), **truth),
        innovations=position_innovations(T),
    )


def test_statistics_of_a_known_series():
    figures = statistics_of(np.array([-3.0, 1.0, 1.0, 1.0]))
    assert figures.mean == 0.0
    assert figures.std == figures.rms == pytest.approx(np.sqrt(3.0))
    assert figures.max == 3.0
    assert figures.p95 == pytest.approx(1.0 + 0.85 * 2.0)
    one = statistics_of(np.array([-2.0]))
    assert (one.mean, one.std, one.rms, one.p95, one.max) == (-2.0, 0.0, 2.0, 2.0, 2.0)
    assert statistics_of(np.empty(0)) is None
    assert by_axis(np.empty((0, 3)), ("a", "b", "c")) is None


def test_a_constant_offset_in_every_axis():
    found = evaluate_channels(offset_run())
    for axis, due in (("east", 3), ("north", 4), ("up", 12), ("horizontal", 5), ("3d", 13)):
        figures = found.position_error_m[axis]
        assert figures.mean == pytest.approx(due, abs=1e-4)
        assert figures.std < 1e-6
        assert figures.max == pytest.approx(due, abs=1e-4)


def test_json_has_its_keys_and_nulls():
    plain = json.loads(json.dumps(evaluate_channels(offset_run()).to_json_dict(), allow_nan=False))
    assert set(plain["position_error_m"]) == {"east", "north", "up", "horizontal", "3d"}
    assert set(plain["position_error_m"]["3d"]) == FIGURES
    assert plain["velocity_error_m_s"] is None
    assert plain["attitude_error_deg"] is None
    assert plain["outages"] == []
    assert plain["outage_summary"]["count"] == 0
    assert plain["outage_summary"]["horizontal_median_m"] is None
    assert plain["nees"]["velocity"] is None
    assert plain["nees"]["position"]["dimension"] == 3
    assert plain["nis"]["position"]["east"]["count"] == N
    assert plain["counts"]["compared_rows"] == N


def test_attitude_is_in_degrees():
    tilted = offset_run(attitude=np.tile(np.radians([-1.0, 0.5, 359.0]), (N, 1)))
    figures = evaluate_channels(tilted).attitude_error_deg
    assert [round(figures[a].mean, 9) for a in ("roll", "pitch", "heading")] == [1.0, -0.5, 1.0]


def test_rows_without_truth_are_counted():
    run = offset_run()
    half = RunChannels(run="a", solution=run.solution, truth=run.truth.take(slice(0, N // 2)))
    counts = evaluate_channels(half).counts
    assert (counts.compared_rows, counts.without_truth_rows) == (N // 2, N // 2)


def test_only_fixed_truth_on_request():
    run = offset_run(quality=np.where(np.arange(N) < 10, FIXED, 0))
    counts = evaluate_channels(run, fixed_truth_only=True).counts
    assert counts.fixed_truth_only
    assert (counts.truth_rows, counts.compared_rows) == (10, 10)


def test_a_single_row_of_each():
    run = offset_run()
    row = slice(5, 6)
    one = RunChannels(run="a", solution=run.solution.take(row), truth=run.truth.take(row))
    found = evaluate_channels(one)
    assert found.position_error_m["3d"].max == pytest.approx(13.0, abs=1e-4)
    assert found.outages == ()


def test_no_overlap_gives_nulls_not_noughts():
    run = offset_run()
    elsewhere = truth_rows(T + 100.0, place(np.zeros((N, 3))))
    found = evaluate_channels(RunChannels(run="a", solution=run.solution, truth=elsewhere))
    assert found.position_error_m is None
    assert found.nees.position is None
    print_evaluation(found, Console(file=io.StringIO(), width=120))


def test_empty_channels_are_refused():
    run = offset_run()
    nothing = run.solution.take(slice(0, 0))
    with pytest.raises(MissingChannelError, match="solution has no row"):
        evaluate_channels(RunChannels(run="a", solution=nothing, truth=run.truth))


def test_the_table_shows_every_part():
    run = offset_run(attitude=np.zeros((N, 3)), velocity=np.zeros((N, 3)))
    out = io.StringIO()
    print_evaluation(evaluate_channels(run), Console(file=out, width=140))
    text = out.getvalue()
    for word in ("position [m]", "velocity [m/s]", "attitude [deg]", "13.0000", "NEES position"):
        assert word in text
    assert "NIS position east" in text


def write(path, topics: dict[str, tuple[str, Columns]]):
    with LogWriter(path) as writer:
        for topic, (message, _) in topics.items():
            writer.add_channel(topic, message)
        writer.write({topic: columns for topic, (_, columns) in topics.items()})
    return path


def test_a_log_is_read_and_evaluated(tmp_path):
    run = offset_run()
    solution, truth = ("replay.Solution", run.solution), ("replay.Truth", run.truth)
    one, two = channels.SOLUTION.at(run="a"), channels.SOLUTION.at(run="b")
    path = write(tmp_path / "one.mcap", {one: solution, "/truth": truth})
    found = evaluate_run(path)
    assert found.run == "a"
    assert found.position_error_m["3d"].mean == pytest.approx(13.0, abs=1e-4)
    assert found == evaluate_run(path, run="a")

    both = write(tmp_path / "two.mcap", {one: solution, two: solution, "/truth": truth})
    assert evaluate_run(both, run="b").run == "b"
    with pytest.raises(UsageError, match="several") as several:
        evaluate_run(both)
    assert "a, b" in several.value.mend
    with pytest.raises(MissingChannelError, match="no solution of c"):
        evaluate_run(both, run="c")

    with pytest.raises(MissingChannelError, match="no truth") as caught:
        evaluate_run(write(tmp_path / "blind.mcap", {one: solution}))
    assert caught.value.mend
    with pytest.raises(MissingChannelError, match="no solution"):
        evaluate_run(write(tmp_path / "still.mcap", {"/truth": truth}))
