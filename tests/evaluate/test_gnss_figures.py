"""Satellites, dilution of precision, integers, availability."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from rich.console import Console
from small_channels import at, place, solution_rows, truth_rows

from replay.batch.figures import key_figures
from replay.evaluate import RunChannels, evaluate_channels, print_evaluation
from replay.evaluate.ambiguities import longest_run
from replay.evaluate.availability import availability_of
from replay.evaluate.satellites import geometry_of
from replay.log.columns import Columns
from replay.schemas import solution_pb2

T = np.arange(0.0, 20.0)
N = len(T)
STILL = np.zeros((N, 3))
SINGLE = solution_pb2.SOLUTION_STATUS_SINGLE
FLOAT = solution_pb2.SOLUTION_STATUS_FLOAT
FIXED = solution_pb2.SOLUTION_STATUS_FIXED
NEVER = ("glonass_pdop", "galileo_pdop")


def geometry_rows(gps, beidou, pdop, has_beidou):
    n = len(gps)
    nought = np.zeros(n, dtype=np.uint32)
    values = {
        "gps_count": np.asarray(gps, dtype=np.uint32),
        "glonass_count": nought,
        "galileo_count": nought,
        "beidou_count": np.asarray(beidou, dtype=np.uint32),
        "qzss_count": nought,
        "pdop": np.asarray(pdop, dtype=np.float64),
        "gps_pdop": np.full(n, 2.5),
        "beidou_pdop": np.where(has_beidou, 4.0, np.nan),
    }
    values |= {name: np.full(n, np.nan) for name in (*NEVER, "gdop", "hdop", "vdop")}
    present = {name: np.isfinite(values[name]) for name in values if name.endswith("dop")}
    return Columns.build(at(T[:n]), values, present=present)


def resolution_rows(ratio, fixed):
    n = len(ratio)
    return Columns.build(
        at(T[:n]),
        {
            "candidate_count": np.full(n, 8, dtype=np.uint32),
            "fixed_count": np.asarray(fixed, dtype=np.uint32),
            "ratio": np.asarray(ratio, dtype=np.float64),
            "w_ratio": np.zeros(n),
            "threshold": np.full(n, 3.0),
            "success_rate": np.ones(n),
            "status": np.ones(n, dtype=np.int32),
        },
    )


def test_satellites_and_pdop_of_a_known_series():
    found = geometry_of(geometry_rows([5, 7, 9], [0, 4, 5], [4.0, 2.0, 1.5], [False, True, True]))
    assert found.epochs == 3
    assert set(found.satellites) == {"gps", "beidou", "all"}
    assert (found.satellites["all"].mean, found.satellites["all"].min) == (10.0, 5.0)
    assert found.satellites["beidou"].mean == 3.0
    assert set(found.pdop) == {"all", "gps", "beidou"}
    assert (found.pdop["all"].median, found.pdop["all"].max) == (2.0, 4.0)
    assert found.pdop["beidou"].count == 2  # epochs at which it was defined
    assert set(found.dop) == {"pdop"}
    assert geometry_of(None) is None
    assert geometry_of(geometry_rows([], [], [], np.array([], dtype=bool))) is None


@pytest.mark.parametrize(
    ("mask", "longest"),
    [([], 0), ([0, 0], 0), ([1], 1), ([1, 1, 0, 1], 2), ([0, 1, 1, 1], 3), ([1, 0, 1, 1, 0], 2)],
)
def test_longest_run(mask, longest):
    assert longest_run(np.array(mask, dtype=np.bool_)) == longest


def rtk_run(east_error, status, *, truth=T, **more):
    error = np.column_stack([east_error, np.zeros(N), np.zeros(N)])
    return RunChannels(
        run="rtk",
        solution=solution_rows(T, place(STILL + error), status=status),
        truth=truth_rows(truth, place(np.zeros((len(truth), 3)))),
        **more,
    )


def test_shares_wrong_fixes_and_their_longest_run():
    status = np.array([SINGLE] * 2 + [FLOAT] * 3 + [FIXED] * 15)
    error = np.zeros(N)
    error[[0, 3]] = 2.0  # not fixed: not wrong fixes
    error[[6, 7, 8, 12]] = 0.5
    found = evaluate_channels(rtk_run(error, status)).ambiguities
    assert found.share == pytest.approx({"single": 0.1, "float": 0.15, "fixed": 0.75})
    assert (found.epochs, found.fixed_epochs, found.fixed_with_truth) == (N, 15, 15)
    assert (found.wrong_fixes, found.longest_wrong_run) == (4, 3)
    assert found.ratio is None and found.attempts is None
    stricter = evaluate_channels(rtk_run(error, status), wrong_fix_limit_m=0.6).ambiguities
    assert (stricter.wrong_fixes, stricter.wrong_fix_limit_m) == (0, 0.6)


def test_an_epoch_that_is_not_fixed_ends_a_run_of_wrong_fixes():
    status = np.full(N, FIXED)
    status[7] = FLOAT
    error = np.zeros(N)
    error[5:10] = 0.5
    assert evaluate_channels(rtk_run(error, status)).ambiguities.longest_wrong_run == 2


def test_errors_of_fixed_rows_alone():
    status = np.where(np.arange(N) < 10, FLOAT, FIXED)
    found = evaluate_channels(rtk_run(np.where(np.arange(N) < 10, 1.0, 0.02), status))
    assert found.position_error_fixed_m["east"].rms == pytest.approx(0.02, abs=1e-6)
    assert found.position_error_m["east"].max == pytest.approx(1.0, abs=1e-6)


def test_fixes_without_truth_are_not_called_right():
    found = evaluate_channels(rtk_run(np.zeros(N), np.full(N, FIXED), truth=T + 100.0)).ambiguities
    assert found.fixed_epochs == N and found.fixed_with_truth == 0
    assert found.wrong_fixes is None and found.longest_wrong_run is None


def test_ratios_of_attempts():
    resolution = resolution_rows([1.0, 4.0, 10.0], [0, 8, 8])
    run = rtk_run(np.zeros(N), np.full(N, FLOAT), resolution=resolution)
    found = evaluate_channels(run).ambiguities
    assert (found.ratio.median, found.ratio.mean, found.ratio.min) == (4.0, 5.0, 1.0)
    assert (found.attempts, found.accepted) == (3, 2)


def test_no_integers_no_figures():
    assert evaluate_channels(rtk_run(np.zeros(N), np.full(N, SINGLE))).ambiguities is None


def test_availability():
    solution = solution_rows(T[:15], place(STILL[:15]))
    assert availability_of(solution, None) is None
    found = availability_of(solution, at(T))
    assert (found.observation_epochs, found.solution_epochs, found.share) == (20, 15, 0.75)
    # A solution at the corrected time of its epoch is that epoch's, one far off is not.
    assert availability_of(solution, at(T + 0.006)).solution_epochs == 15
    assert availability_of(solution, at(T + 0.4)).solution_epochs == 0
    lost = place(np.where(np.arange(15)[:, None] < 5, np.nan, STILL[:15]))
    assert availability_of(solution_rows(T[:15], lost), at(T)).solution_epochs == 10


def test_table_json_and_key_figures_tell_them():
    run = rtk_run(
        np.zeros(N),
        np.full(N, FIXED),
        geometry=geometry_rows([8] * N, [4] * N, [1.7] * N, np.ones(N, dtype=bool)),
        resolution=resolution_rows([6.0] * N, [8] * N),
        observations_ns=at(np.arange(0.0, 25.0)),
    )
    found = evaluate_channels(run)
    plain = json.loads(json.dumps(found.to_json_dict(), allow_nan=False))
    assert plain["ambiguities"]["share"]["fixed"] == 1.0
    assert plain["geometry"]["satellites"]["all"]["mean"] == 12.0
    assert plain["availability"]["share"] == 0.8
    figures = key_figures(found)
    assert figures["satellites_mean"] == {"gps": 8.0, "beidou": 4.0, "all": 12.0}
    assert figures["fixes"] == {"wrong": 0, "longest_wrong_run": 0}
    assert figures["availability"] == {"share": 0.8}
    out = io.StringIO()
    print_evaluation(found, Console(file=out, width=160))
    for words in ("100.0 % fixed", "wrong fixes: 0 of 20", "20 of 25", "beidou", "1.70"):
        assert words in out.getvalue(), words
