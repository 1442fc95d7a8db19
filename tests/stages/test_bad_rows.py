"""What is wrong with a row becomes an event at its time, and the filter goes on."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from replay import channels
from replay.errors import ConfigurationError
from replay.log.columns import Columns, concatenate
from tests.engine.drives import (
    FIX,
    IMU,
    SECOND,
    StageRun,
    changed,
    shifted,
    short_config,
    short_rows,
)

Rows = dict[str, Columns]
RUNNING = 1601  # inertial sample in the middle of the drive, 32 s
FIX_AT = 90  # fix likewise, 27.75 s later than the outage's begin


@functools.cache
def good() -> tuple[Rows, StageRun]:
    rows = short_rows()
    return rows, StageRun(rows, short_config())


def run_with(rows: Rows, *tables: dict) -> StageRun:  # type: ignore[type-arg]
    made = StageRun(rows, short_config(*tables))
    assert made.finite()
    assert made.solution.valid_time_ns[-1] == good()[1].solution.valid_time_ns[-1]
    return made


def extra(made: StageRun, kind: str) -> list[tuple[int, int, float, str]]:
    """Events of a kind that the whole drive does not have."""
    known = set(good()[1].events_of(kind))
    return [event for event in made.events_of(kind) if event not in known]


def end_error_m(made: StageRun, rows: Rows) -> float:
    """Distance from truth at the last row that both have."""
    truth = rows[channels.TRUTH.topic]
    _, mine, theirs = np.intersect1d(
        made.solution.valid_time_ns, truth.valid_time_ns, return_indices=True
    )
    error = made.solution["position_ecef_m"][mine[-1]] - truth["position_ecef_m"][theirs[-1]]
    return float(np.linalg.norm(error))


def test_the_whole_drive_has_no_complaint() -> None:
    rows, made = good()
    assert made.finite()
    for kind in ("NOT_FINITE", "TIME_BACKWARD", "IMU_GAP", "MEASUREMENT_REJECTED", "RESET"):
        assert not made.events_of(kind), kind
    assert end_error_m(made, rows) < 0.1


@pytest.mark.parametrize("field", ["angular_rate_body_rad_s", "specific_force_body_m_s2"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, [0.0, np.nan, 0.0]])
def test_sample_that_is_not_finite(field: str, value: object) -> None:
    rows, _ = good()
    made = run_with({**rows, IMU: changed(rows[IMU], field, RUNNING, value)})
    at = int(rows[IMU].valid_time_ns[RUNNING])
    (event,) = extra(made, "NOT_FINITE")
    assert event[0] == at
    assert event[3] == "inertial sample skipped: not a finite number"
    assert end_error_m(made, rows) < 0.1


def test_samples_that_are_not_finite_while_aligning() -> None:
    rows, _ = good()
    imu = rows[IMU]
    for row in range(100, 110):
        imu = changed(imu, "specific_force_body_m_s2", row, np.nan)
    made = run_with({**rows, IMU: imu})
    times = [event[0] for event in extra(made, "NOT_FINITE")]
    assert times == rows[IMU].valid_time_ns[100:110].tolist()
    assert made.events_of("ALIGNMENT_COMPLETE")


@pytest.mark.parametrize("back_ns", [40_000_000, 5 * SECOND])
def test_time_that_goes_backward(back_ns: int) -> None:
    rows, _ = good()
    made = run_with({**rows, IMU: shifted(rows[IMU], RUNNING, valid_ns=-back_ns)})
    (event,) = extra(made, "TIME_BACKWARD")
    assert event[0] == rows[IMU].valid_time_ns[RUNNING] - back_ns
    # The sample before it is 20 ms older than this one should have been.
    late_s = back_ns / SECOND - 0.02
    assert event[2] == pytest.approx(late_s, abs=1e-9)
    assert event[3] == f"inertial sample skipped: {late_s:.6f} s before the filter's time"
    assert end_error_m(made, rows) < 0.1


def test_sample_given_twice() -> None:
    rows, whole = good()
    twice = np.sort(np.append(np.arange(len(rows[IMU])), RUNNING))
    made = run_with({**rows, IMU: rows[IMU].take(twice)})
    (event,) = extra(made, "TIME_BACKWARD")
    assert event[0] == rows[IMU].valid_time_ns[RUNNING]
    assert event[2] == 0.0
    # The second one is skipped, so that nothing else changes.
    solution = made.solution["position_ecef_m"]
    assert solution.tobytes() == whole.solution["position_ecef_m"].tobytes()


@pytest.mark.parametrize(("missing", "gap"), [(3, False), (5, True), (40, True)])
def test_gap_of_the_inertial_unit(missing: int, gap: bool) -> None:
    rows, _ = good()
    keep = np.ones(len(rows[IMU]), dtype=bool)
    keep[RUNNING : RUNNING + missing] = False
    made = run_with({**rows, IMU: rows[IMU].take(keep)})
    found = extra(made, "IMU_GAP")
    assert len(found) == gap
    if gap:
        assert found[0][0] == rows[IMU].valid_time_ns[RUNNING + missing]
        assert found[0][2] == pytest.approx(0.02 * (missing + 1), abs=1e-9)
        assert found[0][3] == f"interval of {0.02 * (missing + 1):.3f} s between inertial samples"
    assert end_error_m(made, rows) < 0.3


def test_gap_limit_of_the_settings() -> None:
    rows, _ = good()
    keep = np.ones(len(rows[IMU]), dtype=bool)
    keep[RUNNING : RUNNING + 3] = False
    made = run_with({**rows, IMU: rows[IMU].take(keep)}, {"imu": {"gap": 0.07}})
    assert len(extra(made, "IMU_GAP")) == 1


@pytest.mark.parametrize("field", ["position_ecef_m", "position_covariance_enu_m2"])
@pytest.mark.parametrize("part", [0, 2, -1])
def test_fix_that_is_not_finite(field: str, part: int) -> None:
    rows, _ = good()
    value = rows[FIX][field][FIX_AT].copy()
    value[part] = np.nan
    made = run_with({**rows, FIX: changed(rows[FIX], field, FIX_AT, value)})
    (event,) = extra(made, "NOT_FINITE")
    assert event[0] == rows[FIX].valid_time_ns[FIX_AT]
    assert event[3] == "GNSS fix skipped: not a finite number"
    assert end_error_m(made, rows) < 0.1


@pytest.mark.parametrize(
    "field", ["velocity_ecef_m_s", "velocity_covariance_enu_m2_s2", "antenna_lever_arm_body_m"]
)
@pytest.mark.parametrize("row", [20, 46, FIX_AT])
def test_fix_with_another_number_that_is_not_finite(field: str, row: int) -> None:
    """At rest, where it would align the filter, and on the way; whatever the gate."""
    rows, _ = good()
    poor = {**rows, FIX: changed(rows[FIX], field, row, np.nan)}
    for table in ({}, {"gnss": {"velocity_gate": 0.0, "position_gate": 0.0}}):
        made = run_with(poor, table)
        assert [event[0] for event in extra(made, "NOT_FINITE")] == [
            int(rows[FIX].valid_time_ns[row])
        ]
        assert end_error_m(made, rows) < 0.1


def test_fix_before_the_first_sample() -> None:
    rows, _ = good()
    first = int(rows[IMU].valid_time_ns[0])
    fix = shifted(rows[FIX], 0, valid_ns=-SECOND, log_ns=-SECOND)
    made = run_with({**rows, FIX: fix})
    (event,) = extra(made, "TIME_BACKWARD")
    assert fix.valid_time_ns[0] < first <= event[0]
    assert event[3].startswith("1 GNSS fixes skipped")


def test_fixes_long_before_the_first_sample() -> None:
    """The receiver runs, the inertial unit starts at 20 s, in motion."""
    rows, _ = good()
    start_ns = int(rows[IMU].valid_time_ns[0]) + 20 * SECOND
    imu = rows[IMU].take(rows[IMU].valid_time_ns >= start_ns)
    made = run_with({**rows, IMU: imu})
    count = int((rows[FIX].valid_time_ns < imu.valid_time_ns[0]).sum())
    assert count > 50
    (event,) = extra(made, "TIME_BACKWARD")
    assert event[2] == count
    assert made.solution.valid_time_ns[0] >= imu.valid_time_ns[0]


def test_late_fix_without_waiting() -> None:
    rows, _ = good()
    fix = shifted(rows[FIX], FIX_AT, log_ns=100_000_000)
    made = run_with({**rows, FIX: fix})
    (event,) = extra(made, "TIME_BACKWARD")
    assert event[0] == rows[FIX].valid_time_ns[FIX_AT]
    assert 0.08 <= event[2] <= 0.12
    # It is told when it is known, not before.
    row = made.outputs["FILTER_EVENTS"]
    at = row.valid_time_ns.tolist().index(event[0])
    assert row.log_time_ns[at] >= event[0] + 100_000_000


def test_late_fixes_with_waiting_are_as_good_as_timely_ones() -> None:
    """Every fix 90 ms late and a filter that waits: the same numbers, later."""
    rows, whole = good()
    fix = rows[FIX]
    late = dataclasses.replace(fix, log_time_ns=fix.log_time_ns + 90_000_000)
    made = StageRun({**rows, FIX: late}, short_config({"gnss": {"latency": 0.1}}))
    count = len(made.solution)
    assert count > 0.95 * len(whole.solution)
    for field in ("position_ecef_m", "attitude_rad", "velocity_std_enu_m_s"):
        assert made.solution[field].tobytes() == whole.solution[field][:count].tobytes()
    assert np.array_equal(
        made.solution.log_time_ns, whole.solution.log_time_ns[:count] + 100_000_000
    )


def test_rejections_are_counted_and_then_believed() -> None:
    """A receiver that is off by 30 m from some time on: rejected, and in the end believed."""
    rows, _ = good()
    limit = 4
    positions = rows[FIX]["position_ecef_m"].copy()
    positions[150:] += 30.0
    values = {**rows[FIX].values, "position_ecef_m": positions}
    moved = {**rows, FIX: dataclasses.replace(rows[FIX], values=values)}
    made = run_with(moved, {"gnss": {"rejections": limit}})
    rejected = made.events_of("MEASUREMENT_REJECTED")
    assert [event[2] for event in rejected[:limit]] == [1.0, 2.0, 3.0, 4.0]
    assert [event[0] for event in rejected[:limit]] == rows[FIX].valid_time_ns[150:154].tolist()
    reset = made.events_of("RESET")[0]
    assert reset[0] == rows[FIX].valid_time_ns[154]
    assert reset[2] == limit
    assert reset[3] == "position believed after 4 rejections in a row"
    innovations = made.outputs["FILTER_INNOVATIONS"]
    position = innovations["kind"] == 1
    refused = np.unique(innovations.valid_time_ns[position & ~innovations["accepted"]])
    assert refused.tolist() == [event[0] for event in rejected]


def test_a_reset_brings_the_filter_to_the_receiver() -> None:
    """Believed means that the filter is where the receiver is: 30 m off on each axis."""
    rows, _ = good()
    positions = rows[FIX]["position_ecef_m"].copy()
    positions[150:] += 30.0
    values = {**rows[FIX].values, "position_ecef_m": positions}
    moved = {**rows, FIX: dataclasses.replace(rows[FIX], values=values)}
    made = run_with(moved, {"gnss": {"rejections": 4}})
    assert len(made.events_of("RESET")) == 1
    assert end_error_m(made, rows) == pytest.approx(30.0 * np.sqrt(3.0), abs=1.0)


def test_rejections_without_end_where_none_is_set() -> None:
    rows, _ = good()
    positions = rows[FIX]["position_ecef_m"].copy()
    positions[160:] += 30.0
    values = {**rows[FIX].values, "position_ecef_m": positions}
    moved = {**rows, FIX: dataclasses.replace(rows[FIX], values=values)}
    made = run_with(moved, {"gnss": {"rejections": 0}})
    assert not made.events_of("RESET")
    assert len(made.events_of("MEASUREMENT_REJECTED")) == len(positions) - 160


def test_outage_begins_and_ends() -> None:
    rows, made = good()
    times = rows[FIX].valid_time_ns
    place = int(np.argmax(np.diff(times)))
    before, after = int(times[place]), int(times[place + 1])
    assert (after - before) / SECOND == pytest.approx(5.25)
    (begin,), (end,) = made.events_of("OUTAGE_BEGIN"), made.events_of("OUTAGE_END")
    # The first sample that is more than 1.5 s after the last fix.
    assert begin[0] == rows[IMU].valid_time_ns[rows[IMU].valid_time_ns > before + 1.5 * SECOND][0]
    assert begin[3].startswith("no position for 1.5")
    assert end[0] == after
    assert end[2] == pytest.approx(5.25)
    assert end[3] == "position again after 5.25 s"
    status = made.solution["status"]
    inside = (made.solution.valid_time_ns > begin[0]) & (made.solution.valid_time_ns < after)
    assert set(status[inside].tolist()) == {3}
    assert (
        3 not in status[~inside & (made.solution.valid_time_ns != after)][1:].tolist()
        or (made.solution.valid_time_ns[~inside & (status == 3)] == begin[0]).all()
    )


def test_stops_begin_and_end() -> None:
    _, made = good()
    begins, ends = made.events_of("STOP_BEGIN"), made.events_of("STOP_END")
    truth = good()[0][channels.TRUTH.topic]
    speed = np.linalg.norm(truth["velocity_enu_m_s"], axis=1)
    assert begins and len(begins) == len(ends)
    for begin, end in zip(begins, ends, strict=True):
        inside = (truth.valid_time_ns > begin[0]) & (truth.valid_time_ns < end[0] - SECOND)
        assert inside.any()
        assert speed[inside].max() < 0.05


def test_settings_that_cannot_be() -> None:
    rows, _ = good()
    for table, word in (
        ({"filter": {"states": 16}}, "16"),
        ({"output": {"solution_interval": 0.0}}, "solution_interval"),
        ({"filter": {"gyro_noise": [1e-4, 1e-4]}}, "gyro_noise"),
        ({"non_holonomic": {"lever_arm_sigma": [1.0, 1.0, 1.0]}}, "lever"),
    ):
        with pytest.raises(ConfigurationError, match=word):
            StageRun(rows, short_config(table))


def test_interval_that_cannot_be_told() -> None:
    rows, _ = good()
    one = {**rows, IMU: rows[IMU].take(slice(0, 1))}
    with pytest.raises(ConfigurationError, match="interval") as caught:
        StageRun(one, short_config())
    assert caught.value.where == IMU
    assert "imu.interval" in caught.value.mend
    made = StageRun(one, short_config({"imu": {"interval": 0.02}}))
    assert not made.outputs


def test_two_drives_in_one_log_are_one_gap() -> None:
    """Ten minutes of nothing between two drives: named, and the filter stays finite."""
    rows, _ = good()
    later = {
        topic: dataclasses.replace(
            columns,
            valid_time_ns=columns.valid_time_ns + 660 * SECOND,
            log_time_ns=columns.log_time_ns + 660 * SECOND,
        )
        for topic, columns in rows.items()
    }
    both = {topic: concatenate([rows[topic], later[topic]]) for topic in rows}
    made = StageRun(both, short_config())
    assert made.finite()
    gaps = made.events_of("IMU_GAP")
    assert [event[0] for event in gaps] == [int(later[IMU].valid_time_ns[0])]


def test_a_fix_of_a_time_that_was_used_is_not_used_again() -> None:
    rows, _ = good()
    fix = rows[FIX]
    twice = fix.take(np.sort(np.append(np.arange(len(fix)), FIX_AT)))
    made = run_with({**rows, FIX: twice})
    (event,) = extra(made, "TIME_BACKWARD")
    assert event[0] == fix.valid_time_ns[FIX_AT]
    assert event[2] == 0.0
