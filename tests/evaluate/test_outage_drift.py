"""Outages are found and their drift is that of the last row before help came."""

from __future__ import annotations

import json

import numpy as np
import pytest
from small_channels import (
    OUTAGE,
    PREDICTED,
    UPDATED,
    at,
    place,
    position_innovations,
    solution_rows,
    truth_rows,
)

from replay.errors import DataError
from replay.evaluate import RunChannels, evaluate_channels
from replay.evaluate.outages import Span, cut_spans, inside, natural_spans

UPDATES = np.r_[np.arange(0.0, 10.01, 1.0), np.arange(20.0, 25.01, 1.0)]


def drifting_run(*, metadata=None, last_s=25.0, rejected=(), innovations=True):
    """Updates each second but for 10 to 20 s, in which the solution drifts east."""
    t = np.round(np.arange(0.0, last_s + 0.01, 0.25), 2)
    updated = np.isin(t, UPDATES)
    error = np.where((t > 10.0) & (t < 20.0), 0.1 * (t - 10.0) ** 2, 0.0)
    # The filter writes a row at the update's own time before it uses the update.
    before = int(np.searchsorted(t, 20.0)) if last_s >= 20.0 else len(t)
    if last_s >= 20.0:
        t = np.insert(t, before, 20.0)
        error = np.insert(error, before, 10.0)
        updated = np.insert(updated, before, False)
    silent = (t > 10.0) & (t <= 20.0) & ~updated
    status = np.where(updated, UPDATED, np.where(silent, OUTAGE, PREDICTED))
    enu = np.column_stack([error, -0.5 * error, 0.25 * error])
    heading = np.column_stack([np.zeros((len(t), 2)), np.radians(0.2 * error)])
    used = np.setdiff1d(UPDATES[last_s >= UPDATES], rejected)
    everything = np.r_[used, np.asarray(rejected, dtype=float)]
    order = np.argsort(everything)
    accepted = np.isin(everything, used)[order]
    truth_s = np.arange(0.0, last_s + 0.01, 0.5)
    return RunChannels(
        run="r",
        solution=solution_rows(t, place(enu), attitude=heading, status=status),
        truth=truth_rows(
            truth_s, place(np.zeros((len(truth_s), 3))), attitude=np.zeros((len(truth_s), 3))
        ),
        innovations=position_innovations(everything[order], accepted) if innovations else None,
        metadata={} if metadata is None else metadata,
    )


def degrade(*spans):
    listed = [{"start_ns": int(at(a)), "end_ns": int(at(b))} for a, b in spans]
    return {"replay.degrade": {"json": json.dumps({"outages": listed})}}


def test_a_gap_of_updates_is_an_outage_with_its_drift():
    found = evaluate_channels(drifting_run())
    (outage,) = found.outages
    assert (outage.start_s, outage.end_s, outage.duration_s) == (10.0, 20.0, 10.0)
    assert outage.ended
    assert not outage.cut
    assert outage.drift_time_ns == at(20.0)
    assert outage.east_drift_m == pytest.approx(10.0, abs=1e-5)
    assert outage.north_drift_m == pytest.approx(-5.0, abs=1e-5)
    assert outage.up_drift_m == pytest.approx(2.5, abs=1e-4)
    assert outage.horizontal_drift_m == pytest.approx(np.hypot(10, 5), abs=1e-4)
    assert outage.drift_3d_m == pytest.approx(np.sqrt(100 + 25 + 6.25), abs=1e-4)
    assert outage.heading_drift_deg == pytest.approx(2.0, abs=1e-9)
    assert outage.horizontal_max_m == pytest.approx(outage.horizontal_drift_m)
    assert found.outage_summary.count == 1
    assert found.outage_summary.horizontal_max_m == outage.horizontal_drift_m


def test_outages_are_kept_out_of_the_errors_at_epochs():
    found = evaluate_channels(drifting_run())
    assert found.position_error_m["3d"].max < 1e-6
    assert found.position_error_all_m["3d"].max > 10.0
    assert found.counts.epoch_rows == len(UPDATES)


def test_what_was_cut_is_taken_from_the_metadata():
    (outage,) = evaluate_channels(drifting_run(metadata=degrade((10.5, 19.5)))).outages
    assert (outage.start_s, outage.end_s) == (10.5, 19.5)
    assert outage.cut
    assert outage.drift_time_ns == at(20.0)
    assert outage.east_drift_m == pytest.approx(10.0, abs=1e-5)


def test_a_rejected_position_does_not_end_an_outage():
    (outage,) = evaluate_channels(drifting_run(rejected=[20.0])).outages
    assert outage.end_s == 21.0
    # The row before the update at 21 s.
    assert outage.drift_time_ns == at(20.75)


def test_rejections_are_counted_by_epoch():
    counts = evaluate_channels(drifting_run(rejected=[20.0])).counts
    assert counts.position_rejections == 1
    assert counts.position_updates == len(UPDATES) - 1


def test_without_innovations_updated_rows_tell():
    found = evaluate_channels(drifting_run(innovations=False))
    assert [o.duration_s for o in found.outages] == [10.0]
    assert found.counts.position_rejections is None
    assert found.nis is None


def test_an_outage_at_the_end_drifts_to_the_last_row():
    (outage,) = evaluate_channels(drifting_run(last_s=15.0)).outages
    assert not outage.ended
    assert outage.east_drift_m == pytest.approx(2.5, abs=1e-5)


def test_a_cut_before_the_solution_began_is_left_out():
    assert evaluate_channels(drifting_run(metadata=degrade((-20.0, -5.0)))).outages == ()


def test_drift_without_truth_is_absent():
    run = drifting_run()
    short = RunChannels(
        run="r",
        solution=run.solution,
        truth=run.truth.take(run.truth.valid_time_ns < at(19.0)),
        innovations=run.innovations,
    )
    found = evaluate_channels(short)
    assert found.outages[0].east_drift_m is None
    assert found.outage_summary.count == 1
    assert found.outage_summary.horizontal_median_m is None


def test_short_gaps_are_no_outages():
    times = np.r_[0:10:0.5, 11.4:15:0.5]  # 1.9 s: over three intervals, under two seconds
    assert natural_spans(at(times), int(at(15.0))) == ()
    slow = np.r_[0.0:10.0:1.0, 12.0:15.0:1.0]  # 3 s are over two seconds, but three intervals
    assert natural_spans(at(slow), int(at(14.0))) == ()
    longer = np.r_[0:10:0.5, 11.7:15:0.5]
    assert natural_spans(at(longer), int(at(15.0))) == (Span(int(at(9.5)), int(at(11.7))),)


def test_inside_leaves_out_the_ends():
    spans = [Span(int(at(1.0)), int(at(3.0)))]
    np.testing.assert_array_equal(inside(at([1.0, 2.0, 3.0]), spans), [False, True, False])


def test_metadata_that_cannot_be_read_is_told():
    assert cut_spans({}) is None
    assert cut_spans({"replay.degrade": {"json": '{"outages": []}'}}) == ()
    with pytest.raises(DataError, match=r"replay\.degrade"):
        cut_spans({"replay.degrade": {"json": "[]"}})


def test_the_drift_is_read_before_the_update_where_the_receivers_clock_is_ahead():
    # Outages are told by the receiver's clock, 0.12 ms ahead: true times of its epochs lie before.
    found = evaluate_channels(drifting_run(metadata=degrade((10.0, 20.00012)))).outages
    assert [outage.ended for outage in found] == [True]
    assert found[0].drift_time_ns == at(20.0)
    assert found[0].east_drift_m == pytest.approx(10.0, abs=1e-6)
