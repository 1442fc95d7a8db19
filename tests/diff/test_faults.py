"""Each injected fault is found, named, and nothing else is reported."""

from __future__ import annotations

import dataclasses
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_runs import (
    COVARIANCE,
    EPOCHS,
    EVENTS,
    IMU,
    OBS,
    ORDER,
    SATELLITES,
    SIGNALS,
    SOLUTION,
    STAGES,
    STATE,
    TRACE,
    Channels,
    channels,
    edited,
    manifest,
    run,
    without_rows,
)

from replay.channels import find
from replay.diff import covariance
from replay.diff.compare import DiffOptions, diff_runs
from replay.diff.match import align
from replay.diff.result import (
    ChannelStatus,
    CulpritKind,
    DiffResult,
    RowKind,
    Side,
    Verdict,
    from_json,
    to_json,
)
from replay.errors import MissingChannelError, UsageError
from replay.log.columns import Ragged

GOOD = channels()
ROWS = st.integers(0, EPOCHS - 1)
AXES = st.integers(0, 2)
QUICK = settings(max_examples=25, deadline=None)

VECTORS = st.sampled_from(
    [
        (STATE, "position_ecef_m"),
        (STATE, "velocity_ecef_m_s"),
        (STATE, "gyro_bias_body_rad_s"),
        (STATE, "accel_bias_body_m_s2"),
        (SOLUTION, "position_ecef_m"),
        (SOLUTION, "velocity_enu_m_s"),
        (IMU, "specific_force_body_m_s2"),
        (SOLUTION, "attitude_rad"),
    ]
)


def compare(bad: Channels, good: Channels = GOOD) -> DiffResult:
    """Compare with the good run, and hold what must hold of every result."""
    result = diff_runs(run(good, "a"), run(bad, "b"))
    assert from_json(to_json(result)) == result
    swapped = diff_runs(run(bad, "b"), run(good, "a"))
    assert swapped.verdict == result.verdict
    assert (
        result.exit_code
        == {
            Verdict.IDENTICAL: 0,
            Verdict.WITHIN_TOLERANCE: 0,
            Verdict.CHANGED: 1,
            Verdict.INCOMPARABLE: 3,
        }[result.verdict]
    )
    for topic in {**good, **bad}:
        if topic == TRACE and topic in good and topic in bad:
            continue
        mine, other = result.channel(topic), swapped.channel(topic)
        assert (mine.rows.missing, mine.rows.extra) == (other.rows.extra, other.rows.missing)
        for kind in ("equal", "within", "value", "nan", "event"):
            assert getattr(mine.rows, kind) == getattr(other.rows, kind)
        for a, b in zip(mine.fields, other.fields, strict=True):
            assert (a.field, a.value, a.within, a.nan) == (b.field, b.value, b.within, b.nan)
    return result


def only(result: DiffResult, topic: str, field: str | None = None) -> None:
    """Nothing but this channel and this field is reported."""
    differing = [c.topic for c in result.channels if c.status is not ChannelStatus.IDENTICAL]
    assert differing == [topic]
    if field is not None:
        assert [f.field for f in result.channel(topic).fields] == [field]


@given(seed=st.integers(0, 100))
@settings(max_examples=5, deadline=None)
def test_equal_runs_are_identical(seed: int) -> None:
    result = compare(channels(seed), channels(seed))
    assert result.verdict is Verdict.IDENTICAL
    assert result.first_difference is None
    assert result.culprit is None
    assert all(c.rows.differing == 0 for c in result.channels)


@given(where=VECTORS, row=ROWS, axis=AXES, beyond=st.booleans(), sign=st.sampled_from([-1, 1]))
@QUICK
def test_changed_value(
    where: tuple[str, str], row: int, axis: int, beyond: bool, sign: int
) -> None:
    topic, field = where
    spec = find(topic)
    assert spec is not None
    tolerance = spec.tolerances[field].absolute
    change = sign * tolerance * (3.0 if beyond else 0.3)
    old = GOOD[topic][field][row, axis]
    result = compare(edited(GOOD, topic, field, row, old + change, axis))
    assert result.verdict is (Verdict.CHANGED if beyond else Verdict.WITHIN_TOLERANCE)
    only(result, topic, field)
    channel = result.channel(topic)
    kind = RowKind.VALUE if beyond else RowKind.WITHIN
    assert getattr(channel.rows, kind.value) == channel.rows.differing == 1
    worst = channel.fields[0].worst
    assert worst is not None
    assert worst.name == f"{field}.{'xyz'[axis]}"
    assert worst.max == pytest.approx(abs(change), rel=1e-4)
    assert worst.at is not None
    assert worst.at.time_ns == GOOD[topic].valid_time_ns[row]
    assert worst.rms == pytest.approx(abs(change) / np.sqrt(len(GOOD[topic])), rel=1e-4)
    assert worst.mean == pytest.approx(-change / len(GOOD[topic]), rel=1e-4)
    first = result.first_difference
    assert first is not None
    assert (first.topic, first.field, first.component) == (topic, field, "xyz"[axis])
    assert (first.kind, first.at) == (kind, worst.at)
    assert (result.first_change is not None) == beyond
    assert [r.here for r in first.around].count(True) == 1


@given(row=st.integers(0, len(GOOD[OBS]) - 1))
@QUICK
def test_dropped_and_added_row(row: int) -> None:
    time = int(GOOD[OBS].valid_time_ns[row])
    bad = without_rows(GOOD, OBS, [row])
    for good, new, kind, side in (
        (GOOD, bad, RowKind.MISSING, Side.A),
        (bad, GOOD, RowKind.EXTRA, Side.B),
    ):
        result = compare(new, good)
        assert result.verdict is Verdict.CHANGED
        only(result, OBS)
        channel = result.channel(OBS)
        assert channel.fields == []
        assert getattr(channel.rows, kind.value) == channel.rows.differing == 1
        first = result.first_change
        assert first is not None
        assert (first.kind, first.side, first.at.time_ns) == (kind, side, time)
        satellite, signal = row // len(SIGNALS) % len(SATELLITES), row % len(SIGNALS)
        assert first.at.key == {"satellite": SATELLITES[satellite], "signal": SIGNALS[signal]}
        assert all(r.at.key == first.at.key for r in first.around)


@given(epoch=ROWS, satellite=st.integers(0, len(SATELLITES) - 1))
@QUICK
def test_dropped_satellite_of_one_epoch(epoch: int, satellite: int) -> None:
    width = len(SATELLITES) * len(SIGNALS)
    rows = [epoch * width + satellite * len(SIGNALS) + i for i in range(len(SIGNALS))]
    channel = compare(without_rows(GOOD, OBS, rows)).channel(OBS)
    assert channel.rows.missing == channel.rows.differing == len(SIGNALS)
    assert channel.first_change is not None
    assert channel.first_change.at.key["satellite"] == SATELLITES[satellite]


@given(row=ROWS, axis=AXES)
@QUICK
def test_not_a_number(row: int, axis: int) -> None:
    bad = edited(GOOD, SOLUTION, "velocity_enu_m_s", row, np.nan, axis)
    result = compare(bad)
    assert result.verdict is Verdict.CHANGED
    only(result, SOLUTION, "velocity_enu_m_s")
    assert result.channel(SOLUTION).rows.nan == 1
    assert result.first_change is not None
    assert result.first_change.kind is RowKind.NAN
    assert result.first_change.component == "xyz"[axis]
    assert result.first_change.at.time_ns == GOOD[SOLUTION].valid_time_ns[row]
    assert compare(bad, bad).verdict is Verdict.IDENTICAL


def test_signs_that_bits_alone_show() -> None:
    zero = edited(GOOD, SOLUTION, "velocity_enu_m_s", 2, 0.0, 1)
    minus = edited(GOOD, SOLUTION, "velocity_enu_m_s", 2, -0.0, 1)
    result = compare(minus, zero)
    assert result.verdict is Verdict.WITHIN_TOLERANCE
    only(result, SOLUTION, "velocity_enu_m_s")
    assert result.first_difference is not None
    assert result.first_difference.component == "y"
    assert (result.first_difference.a, result.first_difference.b) == ("0.0", "-0.0")


@given(row=ROWS)
@QUICK
def test_quaternion_sign_and_full_turn(row: int) -> None:
    q = GOOD[STATE]["q_body_to_ecef"][row]
    flipped = compare(edited(GOOD, STATE, "q_body_to_ecef", row, -q))
    assert flipped.verdict is Verdict.WITHIN_TOLERANCE
    only(flipped, STATE, "q_body_to_ecef")
    turned = edited(
        GOOD, SOLUTION, "attitude_rad", row, GOOD[SOLUTION]["attitude_rad"][row] + 2 * np.pi
    )
    result = compare(turned)
    assert result.verdict is Verdict.WITHIN_TOLERANCE
    only(result, SOLUTION, "attitude_rad")


@given(row=ROWS, axis=AXES, angle=st.sampled_from([1e-7, 3e-6, 0.1, 3.0]))
@QUICK
def test_rotation_is_told_by_its_angle(row: int, axis: int, angle: float) -> None:
    q = GOOD[STATE]["q_body_to_ecef"][row]
    half = np.zeros(3)
    half[axis] = np.sin(angle / 2)
    scalar = np.cos(angle / 2)
    new = np.concatenate(
        [[scalar * q[0] - half @ q[1:]], scalar * q[1:] + q[0] * half + np.cross(half, q[1:])]
    )
    result = compare(edited(GOOD, STATE, "q_body_to_ecef", row, new))
    assert result.verdict is (Verdict.CHANGED if angle > 1e-6 else Verdict.WITHIN_TOLERANCE)
    only(result, STATE, "q_body_to_ecef")
    worst = result.channel(STATE).fields[0].worst
    assert worst is not None
    assert worst.name == "q_body_to_ecef.angle"
    assert worst.max == pytest.approx(angle, rel=1e-6, abs=1e-15)


def test_quaternion_of_other_length_is_no_rotation() -> None:
    q = GOOD[STATE]["q_body_to_ecef"][1]
    for scale in (2.0, 0.0):
        assert compare(edited(GOOD, STATE, "q_body_to_ecef", 1, scale * q)).first_change is not None


@given(row=ROWS, scale=st.sampled_from([0.25, 1 - 1e-8, 1 + 1e-8, 1.5, 100.0]))
@QUICK
def test_scaled_covariance(row: int, scale: float) -> None:
    triangle = GOOD[COVARIANCE].ragged("upper_triangle").row(row)
    result = compare(edited(GOOD, COVARIANCE, "upper_triangle", row, triangle * scale))
    beyond = abs(scale - 1) > 1e-6
    assert result.verdict is (Verdict.CHANGED if beyond else Verdict.WITHIN_TOLERANCE)
    only(result, COVARIANCE, "upper_triangle")
    field = result.channel(COVARIANCE).fields[0]
    assert {c.name for c in field.components} == {
        "upper_triangle.eigenvalue_min - 1",
        "upper_triangle.eigenvalue_max - 1",
    }
    for part in field.components:
        assert part.max == pytest.approx(abs(scale - 1), rel=1e-5)
    assert field.indefinite_a == field.indefinite_b == 0


@given(row=ROWS)
@QUICK
def test_indefinite_covariance(row: int) -> None:
    triangle = GOOD[COVARIANCE].ragged("upper_triangle").row(row).copy()
    triangle[ORDER] = -1.0
    result = compare(edited(GOOD, COVARIANCE, "upper_triangle", row, triangle))
    assert result.verdict is Verdict.CHANGED
    only(result, COVARIANCE, "upper_triangle")
    field = result.channel(COVARIANCE).fields[0]
    assert (field.indefinite_a, field.indefinite_b, field.value) == (0, 1, 1)
    assert result.first_change is not None
    assert result.first_change.at.time_ns == GOOD[COVARIANCE].valid_time_ns[row]


@given(row=st.integers(0, 2))
@settings(max_examples=3, deadline=None)
def test_events(row: int) -> None:
    removed = compare(without_rows(GOOD, EVENTS, [row]))
    only(removed, EVENTS)
    assert removed.verdict is Verdict.CHANGED
    assert removed.channel(EVENTS).rows.event == removed.channel(EVENTS).rows.differing == 1
    first = removed.first_change
    assert first is not None
    assert (first.kind, first.side) == (RowKind.EVENT, Side.A)
    assert first.at.key["kind"] in ("ALIGNMENT_COMPLETE", "OUTAGE_BEGIN", "OUTAGE_END")
    reworded = compare(edited(GOOD, EVENTS, "detail", row, "other words"))
    only(reworded, EVENTS, "detail")
    assert reworded.first_change is not None
    assert reworded.first_change.kind is RowKind.EVENT
    assert reworded.first_change.b == "other words"
    same_length = GOOD[EVENTS].ragged("detail").texts()[row].upper()
    only(compare(edited(GOOD, EVENTS, "detail", row, same_length)), EVENTS, "detail")
    other_kind = compare(edited(GOOD, EVENTS, "kind", row, 8))
    assert other_kind.channel(EVENTS).rows.event == 2


def test_enumeration_and_presence() -> None:
    result = compare(edited(GOOD, SOLUTION, "status", 4, 3))
    only(result, SOLUTION, "status")
    assert result.first_change is not None
    assert (result.first_change.a, result.first_change.b) == ("UPDATED", "OUTAGE")
    columns = GOOD[OBS]
    present = columns.present["doppler_hz"].copy()
    present[7] = False
    bad = {**GOOD, OBS: dataclasses.replace(columns, present={"doppler_hz": present})}
    result = compare(bad)
    only(result, OBS, "doppler_hz")
    assert result.channel(OBS).fields[0].presence == result.channel(OBS).rows.value == 1
    assert result.first_change is not None
    assert result.first_change.b == "absent"


@given(step=ROWS, stage=st.integers(0, len(STAGES) - 1), field=st.sampled_from(["input", "output"]))
@QUICK
def test_trace_names_stage_and_step(step: int, stage: int, field: str) -> None:
    bad = GOOD
    # Rolling digests stay apart once they are.
    for later in range(step, EPOCHS):
        row = later * len(STAGES) + stage
        bad = edited(bad, TRACE, f"{field}_digest", row, np.uint64(7 + later))
    result = compare(bad)
    assert result.verdict is Verdict.CHANGED
    assert all(c.status is ChannelStatus.IDENTICAL for c in result.channels)
    culprit = result.culprit
    assert culprit is not None
    kind = CulpritKind.INPUT if field == "input" else CulpritKind.OUTPUT
    assert (culprit.kind, culprit.stage, culprit.step) == (kind, STAGES[stage], step)


def test_trace_that_stops() -> None:
    result = compare(without_rows(GOOD, TRACE, [len(GOOD[TRACE]) - 1]))
    assert result.culprit is not None
    assert result.culprit.kind is CulpritKind.MISSING_STEP
    assert (result.culprit.stage, result.culprit.side) == (STAGES[-1], Side.A)


@given(row=ROWS, topic=st.sampled_from([STATE, SOLUTION, COVARIANCE]))
@QUICK
def test_shifted_time(row: int, topic: str) -> None:
    times = GOOD[topic].valid_time_ns.copy()
    times[row] += 1
    bad = {**GOOD, topic: dataclasses.replace(GOOD[topic], valid_time_ns=times)}
    result = compare(bad)
    only(result, topic)
    rows = result.channel(topic).rows
    assert (rows.missing, rows.extra, rows.differing) == (1, 1, 2)
    assert result.channel(topic).fields == []
    late = GOOD[topic].log_time_ns.copy()
    late[row] += 1
    result = compare({**GOOD, topic: dataclasses.replace(GOOD[topic], log_time_ns=late)})
    assert result.verdict is Verdict.CHANGED
    only(result, topic, "log_time_ns")


def test_missing_channel_and_other_schema() -> None:
    bad = {topic: columns for topic, columns in GOOD.items() if topic != SOLUTION}
    result = compare(bad)
    assert result.verdict is Verdict.CHANGED
    assert result.channel(SOLUTION).status is ChannelStatus.MISSING
    assert result.channel(SOLUTION).rows.missing == EPOCHS
    a = run(GOOD)
    result = diff_runs(a, run(GOOD, schemas={**a.schemas, SOLUTION: "replay.Truth"}))
    assert result.verdict is Verdict.INCOMPARABLE
    assert result.exit_code == 3
    only(result, SOLUTION)
    assert SOLUTION in result.reasons[0]
    assert diff_runs(run({IMU: GOOD[IMU]}), run({OBS: GOOD[OBS]})).verdict is Verdict.INCOMPARABLE


def test_reordered_rows_are_other_bits() -> None:
    order = np.arange(len(GOOD[OBS]))
    order[[0, 1]] = order[[1, 0]]
    result = compare({**GOOD, OBS: GOOD[OBS].take(order)})
    assert result.verdict is Verdict.WITHIN_TOLERANCE
    only(result, OBS)
    assert result.channel(OBS).reordered == 1
    assert result.channel(OBS).rows.differing == 0


def test_duplicates_are_matched_in_order() -> None:
    twice = {**GOOD, SOLUTION: GOOD[SOLUTION].take(np.repeat(np.arange(EPOCHS), 2))}
    assert compare(twice, twice).verdict is Verdict.IDENTICAL
    rows = compare(without_rows(twice, SOLUTION, [5]), twice).channel(SOLUTION).rows
    assert (rows.missing, rows.differing) == (1, 1)


@given(sizes=st.lists(st.floats(1e-9, 1e3), min_size=2, max_size=5))
@QUICK
def test_severity_rises_with_the_difference(sizes: list[float]) -> None:
    severities = []
    old = GOOD[SOLUTION]["position_ecef_m"][3, 0]
    for size in sorted(sizes):
        result = compare(edited(GOOD, SOLUTION, "position_ecef_m", 3, old + size, 0))
        severities.append(result.verdict.severity)
    assert severities == sorted(severities)


def test_manifest_tells_configuration_versions_and_inputs() -> None:
    mine, other = manifest(noise=1.0, window=3), manifest(noise=2.0, robust="true")
    other.stages[1].version = 2
    result = diff_runs(run(GOOD, manifest=mine), run(GOOD, manifest=other))
    assert result.verdict is Verdict.IDENTICAL
    assert [(s.key, s.a, s.b) for s in result.configuration] == [
        ("filter.noise", "1.0", "2.0"),
        ("filter.robust", None, "true"),
        ("filter.window", "3", None),
    ]
    assert [(s.key, s.a, s.b) for s in result.versions] == [("stage filter", "1", "2")]
    other.inputs[0].sha256 = "bb"
    a, b = run(GOOD, manifest=mine), run(GOOD, manifest=other)
    result = diff_runs(a, b)
    assert result.verdict is Verdict.INCOMPARABLE
    assert [change.key for change in result.inputs] == [IMU]
    allowed = diff_runs(a, b, DiffOptions(allow_different_inputs=True))
    assert allowed.verdict is Verdict.IDENTICAL


def test_run_names_are_paired() -> None:
    renamed = {topic.replace("/ekf", "/loose"): columns for topic, columns in GOOD.items()}
    result = diff_runs(run(GOOD), run(renamed))
    assert result.verdict is Verdict.IDENTICAL
    assert result.run_names == {"ekf": "loose"}
    two = {**renamed, **GOOD}
    chosen = diff_runs(run(GOOD), run(two), DiffOptions(run_names={"ekf": "loose"}))
    assert chosen.channel(SOLUTION).topic_b == "/solution/loose"
    with pytest.raises(UsageError, match="no run named"):
        diff_runs(run(GOOD), run(two), DiffOptions(run_names={"ekf": "tight"}))


def test_chosen_topics() -> None:
    bad = edited(GOOD, SOLUTION, "status", 4, 3)
    options = DiffOptions(topics=(STATE,))
    assert diff_runs(run(GOOD), run(bad), options).verdict is Verdict.IDENTICAL
    with pytest.raises(MissingChannelError):
        diff_runs(run(GOOD), run(bad), DiffOptions(topics=("/nothing",)))


def test_sigmas_and_local_position() -> None:
    old = GOOD[STATE]["position_ecef_m"][3]
    result = compare(edited(GOOD, STATE, "position_ecef_m", 3, old + np.array([0.3, 0.0, 0.4])))
    channel = result.channel(STATE)
    triangle = GOOD[COVARIANCE].ragged("upper_triangle").row(3)
    full = np.zeros((ORDER, ORDER))
    full[np.triu_indices(ORDER)] = triangle
    full = full + np.triu(full, 1).T
    delta = np.array([0.3, 0.0, 0.4])
    expected = np.sqrt(delta @ np.linalg.solve(full[:3, :3], delta))
    sigma = {s.field: s for s in channel.sigmas}
    assert sigma["position_ecef_m"].max == pytest.approx(expected, rel=1e-6)
    joint = np.zeros(6)
    joint[:3] = delta
    expected = np.sqrt(joint @ np.linalg.solve(full[:6, :6], joint))
    assert sigma["position_ecef_m + velocity_ecef_m_s"].max == pytest.approx(expected, rel=1e-6)
    local = {part.name: part for part in channel.local}
    assert local["3d"].max == pytest.approx(0.5, rel=1e-6)
    # A - B, and B stands higher, for the vertical there points along +x and +z.
    assert local["up"].mean is not None
    assert local["up"].mean < 0.0
    assert local["horizontal"].max is not None
    assert local["up"].max is not None
    assert np.hypot(local["horizontal"].max, local["up"].max) == pytest.approx(0.5, rel=1e-6)


def test_unknown_channel_is_compared_exactly() -> None:
    made = {**GOOD, "/other": GOOD[IMU]}
    changed = edited(made, "/other", "specific_force_body_m_s2", 1, 9.0, 0)
    result = compare(changed, made)
    assert result.verdict is Verdict.CHANGED
    only(result, "/other", "specific_force_body_m_s2")


@pytest.mark.parametrize("topic", [topic for topic in GOOD if topic != TRACE])
def test_empty_channel(topic: str) -> None:
    empty = {**GOOD, topic: GOOD[topic].take(slice(0, 0))}
    assert compare(empty, empty).verdict is Verdict.IDENTICAL
    result = compare(empty)
    only(result, topic)
    rows = result.channel(topic).rows
    assert rows.missing + rows.event == rows.differing == len(GOOD[topic])


def test_covariance_of_other_order() -> None:
    matrix = GOOD[COVARIANCE].ragged("upper_triangle").values.reshape(EPOCHS, -1)
    small = {
        "dimension": np.full(EPOCHS, 9, dtype=np.uint32),
        "state_names": GOOD[COVARIANCE].values["state_names"],
        "upper_triangle": Ragged.from_matrix(matrix[:, :45]),
    }
    bad = {**GOOD, COVARIANCE: dataclasses.replace(GOOD[COVARIANCE], values=small)}
    result = compare(bad)
    only(result, COVARIANCE)
    assert {f.field for f in result.channel(COVARIANCE).fields} == {"dimension", "upper_triangle"}
    assert result.channel(COVARIANCE).rows.value == EPOCHS


def test_idle_states_do_not_make_a_covariance_indefinite() -> None:
    full = np.zeros((2, 3, 3))
    full[:, 0, 0], full[:, 2, 2] = 1.0, 4.0
    triangle = full[(slice(None), *np.triu_indices(3))]
    spread = covariance.compare(triangle, triangle * 1.5)
    assert (spread.indefinite_a, spread.indefinite_b) == (0, 0)
    assert spread.departure == pytest.approx(np.array([[0.0, 0.5]] * 2))


@given(
    times=st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), max_size=12),
    other=st.lists(st.tuples(st.integers(0, 3), st.integers(0, 2)), max_size=12),
)
@settings(max_examples=200, deadline=None)
def test_alignment_pairs_as_many_rows_as_there_are(
    times: list[tuple[int, int]], other: list[tuple[int, int]]
) -> None:
    a, b = (np.array(rows, dtype=np.int64).reshape(-1, 2) for rows in (times, other))
    found = align(a[:, 0], b[:, 0], a[:, 1], b[:, 1])
    assert sorted(found.a[found.a >= 0]) == list(range(len(a)))
    assert sorted(found.b[found.b >= 0]) == list(range(len(b)))
    expected = sum((Counter(times) & Counter(other)).values())
    assert np.count_nonzero(found.matched) == expected
    for i, j in zip(found.a[found.matched], found.b[found.matched], strict=True):
        assert times[i] == other[j]
        # The place among equals is the same in both runs.
        assert times[:i].count(times[i]) == other[:j].count(other[j])
    assert np.all(
        np.diff(
            [times[i][0] if i >= 0 else other[j][0] for i, j in zip(found.a, found.b, strict=True)]
        )
        >= 0
    )


def test_first_is_what_became_available_first() -> None:
    bad = edited(GOOD, SOLUTION, "status", 6, 3)
    bad = edited(bad, SOLUTION, "status", 2, 3)
    first = compare(bad).first_change
    assert first is not None
    assert first.at.time_ns == GOOD[SOLUTION].valid_time_ns[2]
    # A smoother gives the late epoch first: then that is where the runs part.
    log_times = GOOD[SOLUTION].log_time_ns[::-1].copy()
    late = [
        {**made, SOLUTION: dataclasses.replace(made[SOLUTION], log_time_ns=log_times)}
        for made in (GOOD, bad)
    ]
    first = compare(late[1], late[0]).first_change
    assert first is not None
    assert first.at.time_ns == GOOD[SOLUTION].valid_time_ns[6]


@given(eigenvalue=st.floats(1e-6, 1e6))
@QUICK
def test_covariance_distance_is_the_same_from_both_sides(eigenvalue: float) -> None:
    forth, back = covariance.distance(np.array([eigenvalue - 1.0, 1.0 / eigenvalue - 1.0]))
    assert forth == pytest.approx(back, rel=1e-9, abs=1e-9)
    assert forth == pytest.approx(max(eigenvalue, 1.0 / eigenvalue) - 1.0, rel=1e-9, abs=1e-9)
