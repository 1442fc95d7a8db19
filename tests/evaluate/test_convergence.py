"""Convergence, scatter and repeatability of a point that stands still, in closed form."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from rich.console import Console
from small_channels import ORIGIN, at, place, solution_rows, truth_rows

from replay.errors import UsageError
from replay.evaluate import RunChannels, evaluate_channels, print_evaluation
from replay.evaluate.convergence import convergence_of
from replay.evaluate.station import (
    StationOptions,
    reference_rows,
    repeatability_of,
    still_point,
)
from replay.evaluate.station_options import parse_reference, station_options
from replay.schemas import solution_pb2

FLOAT = solution_pb2.SOLUTION_STATUS_FLOAT
FIXED = solution_pb2.SOLUTION_STATUS_FIXED
STEP = 30.0


def decaying(hours: float, tau_s: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Times and errors exp(-t / tau), m, of each axis."""
    t = np.arange(0.0, hours * 3600.0, STEP)
    return t, np.exp(-t[:, None] / np.array(tau_s))


def test_an_exponential_keeps_within_the_limit_from_tau_times_ln_ten_on():
    t, enu = decaying(2.0, (300.0, 600.0, 1200.0))
    found = convergence_of(at(t), enu, limit_m=0.1, hold_s=600.0)
    for axis, tau in (("east", 300.0), ("north", 600.0), ("up", 1200.0)):
        due = STEP * np.ceil(tau * np.log(10.0) / STEP)
        assert found.to_the_end_s[axis] == due
        assert found.held_s[axis] == due  # it never leaves again
    assert found.to_the_end_s["each"] == found.to_the_end_s["up"]
    flat = np.hypot(enu[:, 0], enu[:, 1])
    assert found.to_the_end_s["horizontal"] == t[flat <= 0.1][0]
    assert found.to_the_end_s["3d"] == t[np.linalg.norm(enu, axis=1) <= 0.1][0]


def test_a_late_excursion_counts_to_the_end_and_not_for_those_who_hold():
    t = np.arange(0.0, 7200.0, STEP)
    enu = np.zeros((len(t), 3))
    enu[:10, 2] = 0.2  # the first five minutes
    enu[180, 2] = -0.11  # at 90 min
    found = convergence_of(at(t), enu, limit_m=0.1, hold_s=600.0)
    assert found.held_s["up"] == 300.0
    assert found.to_the_end_s["up"] == 181 * STEP
    assert found.to_the_end_s["east"] == found.held_s["east"] == 0.0


def test_never_within_or_outside_at_the_last_is_none():
    t = np.arange(0.0, 1800.0, STEP)
    enu = np.zeros((len(t), 3))
    enu[-1, 0] = 0.5
    enu[::2, 1] = 0.5
    found = convergence_of(at(t), enu, limit_m=0.1, hold_s=600.0)
    assert found.to_the_end_s["east"] is None and found.held_s["east"] == 0.0
    assert found.to_the_end_s["north"] == (len(t) - 1) * STEP  # the last row alone
    assert found.held_s["north"] is None
    empty = convergence_of(at([]), np.empty((0, 3)))
    assert set(empty.to_the_end_s.values()) == set(empty.held_s.values()) == {None}


def test_a_missing_epoch_ends_a_stretch_that_holds():
    t = np.arange(0.0, 1800.0, STEP)
    t = t[t != 300.0]
    found = convergence_of(at(t), np.zeros((len(t), 3)), hold_s=600.0)
    assert found.held_s["up"] == 330.0
    assert found.to_the_end_s["up"] == 0.0


def test_seconds_count_from_the_start_that_is_given_and_a_limit_is_within():
    t = np.array([60.0, 90.0, 120.0])
    found = convergence_of(
        at(t), np.array([[0.2] * 3, [0.1] * 3, [0.1] * 3]), start_ns=int(at(0.0)), limit_m=0.1
    )
    assert found.to_the_end_s["each"] == 90.0


def run_of(t, enu, status=FLOAT, **more):
    return RunChannels(
        run="ppp",
        solution=solution_rows(t, place(enu), status=status),
        truth=truth_rows(t, place(np.zeros((len(t), 3)))),
        **more,
    )


def test_sessions_of_known_offsets_repeat_by_their_scatter():
    """Four quarters at offsets whose mean and standard deviation are known."""
    t = np.arange(0.0, 4 * 3600.0, STEP)
    offsets = np.array([[1.0, 0.0, 4.0], [-1.0, 0.0, 4.0], [1.0, 0.0, -4.0], [-1.0, 0.0, -4.0]])
    enu = 1e-3 * np.repeat(offsets, len(t) // 4, axis=0)
    options = StationOptions(session_s=3600.0, start_up_s=0.0)
    station = evaluate_channels(run_of(t, enu), station=options).station
    assert station is not None and len(station.sessions) == 4
    np.testing.assert_allclose(
        [s.mean_error_m for s in station.sessions], 1e-3 * offsets, atol=1e-8
    )
    assert station.sessions[0].convergence is not None
    assert station.sessions[1].convergence is None  # goes on from the first
    found = station.repeatability
    assert found is not None
    assert found.std_m["east"] == pytest.approx(1e-3 * np.sqrt(4.0 / 3.0), rel=1e-4)
    assert found.std_m["horizontal"] == pytest.approx(found.std_m["east"], rel=1e-6)
    assert found.greatest_m["up"] == pytest.approx(4e-3, rel=1e-4)
    assert repeatability_of([(0.0, 0.0, 0.0)]) is None


def test_figures_after_convergence_after_the_start_up_and_of_each_status():
    t = np.arange(0.0, 7200.0, STEP)
    enu = np.zeros((len(t), 3))
    enu[t < 1800.0, 2] = 0.5
    wave = np.where(np.arange(len(t)) % 2 == 0, 1.0, -1.0)
    enu[:, 0] = 0.02 + np.where(t < 5400.0, 0.03, 0.004) * wave
    status = np.where(t < 5400.0, FLOAT, FIXED)
    evaluation = evaluate_channels(run_of(t, enu, status))
    station = evaluation.station
    assert station is not None
    (session,) = station.sessions
    assert session.convergence.to_the_end_s["each"] == 1800.0
    assert session.converged_error_m["up"].max == pytest.approx(0.0, abs=1e-6)
    assert session.converged_error_m["east"].mean == pytest.approx(0.02, abs=1e-6)
    assert session.started_error_m["east"].std == pytest.approx(
        np.sqrt((0.03**2 + 0.004**2) / 2.0), rel=1e-4
    )
    assert session.first_fix_s == 5400.0
    assert session.fixed_share == 0.25
    assert session.fixed_error_m["east"].std == pytest.approx(0.004, rel=1e-3)
    assert session.float_error_m["east"].std == pytest.approx(0.03, rel=1e-3)
    json.dumps(evaluation.to_json_dict())
    text = io.StringIO()
    print_evaluation(evaluation, Console(file=text, width=200))
    assert "30.0" in text.getvalue() and "first fix after 90.0 min" in text.getvalue()


def test_seconds_count_from_the_first_observation():
    t = np.arange(300.0, 7200.0, STEP)
    data = run_of(t, np.zeros((len(t), 3)), observations_ns=at(np.arange(0.0, 7200.0, STEP)))
    station = evaluate_channels(data).station
    assert station is not None
    assert station.sessions[0].convergence.to_the_end_s["each"] == 300.0


def test_a_truth_that_moves_has_no_station():
    t = np.arange(0.0, 600.0, STEP)
    path = place(np.column_stack([t, 0 * t, 0 * t]))
    moving = RunChannels("ppp", solution_rows(t, path, status=FLOAT), truth_rows(t, path))
    assert evaluate_channels(moving).station is None
    assert still_point(truth_rows(t, path)) is None


def test_the_mean_of_the_last_half_is_the_reference():
    t = np.arange(0.0, 7200.0 + STEP, STEP)
    enu = np.where((t >= 3600.0)[:, None], [0.0, 0.0, 0.0], [5.0, 0.0, 0.0])
    enu[t >= 3600.0, 1] = np.resize([0.01, -0.01], np.count_nonzero(t >= 3600.0))
    enu[-1, 1] = 0.0  # an odd count, so that they cancel
    solution = solution_rows(t, place(enu), status=FLOAT)
    truth = reference_rows(solution, "mean")
    np.testing.assert_allclose(still_point(truth), ORIGIN, atol=1e-6)
    given = reference_rows(solution, tuple(ORIGIN))
    data = RunChannels("ppp", solution, given)
    station = evaluate_channels(
        data, fixed_truth_only=True, station=StationOptions(reference=tuple(ORIGIN))
    ).station
    assert station is not None and station.reference == "given"
    assert station.sessions[0].epochs == len(t)  # all rows are served, the first and last too
    assert station.sessions[0].convergence.to_the_end_s["each"] == 3600.0


def test_what_a_person_writes():
    found = station_options(
        reference="3582104.75,532590.18,5232755.13",
        limit="5 cm",
        hold="20 min",
        start_up="0.5 h",
        session="6 h",
    )
    assert found.reference == (3582104.75, 532590.18, 5232755.13)
    assert (found.limit_m, found.hold_s, found.start_up_s) == (0.05, 1200.0, 1800.0)
    assert found.session_s == 21_600.0
    assert parse_reference("mean") == "mean"
    for text in ("here", "1,2", "52.1,4.4,30", "a,b,c"):
        with pytest.raises(UsageError):
            parse_reference(text)
    with pytest.raises(UsageError):
        station_options(reference=None, limit="0", hold="1", start_up="0", session=None)
