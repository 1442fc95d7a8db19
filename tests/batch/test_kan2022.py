"""The study of the inertial rate: its arithmetic in closed form, its runs as a sweep."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from replay.batch import studies
from replay.batch.kan2022 import published
from replay.batch.kan2022.claim import claim_said, comparisons
from replay.batch.kan2022.figures import drift_curves, figures_of, shown
from replay.batch.kan2022.measure import (
    ATTITUDE,
    OUTAGES,
    PATH,
    PDOP,
    POSITION,
    QUANTITIES,
    SATELLITES,
    TIME,
    UPDATED,
    VELOCITY,
    measures_of,
    rows_at,
)
from replay.batch.kan2022.paired import holm, paired
from replay.batch.kan2022.plan import ALONE, PLAN, REFERENCE, TIGHT, Plan, kind_of, plan_cases
from replay.batch.kan2022.report import report_html
from replay.batch.kan2022.run import study_of
from replay.batch.kan2022.runs import (
    Kind,
    Run,
    Runs,
    drift_sizes_cm,
    drifts_cm,
    greatest_drifts_cm,
    improvement_percent,
    load_runs,
    rms_of,
)
from replay.batch.kan2022.tables import (
    accuracy_table,
    aim_table,
    all_tables,
    comparison_table,
    drift_table,
    to_json,
)
from replay.batch.study import Options
from replay.batch.sweep import table as sweep_table
from replay.batch.sweep.file import Case
from replay.batch.sweep.rows import ERROR, read_rows, read_series, row_files, row_path
from replay.batch.sweep_study import ROWS, run_sweep_study, study_cases
from replay.batch.workers import Workers
from replay.cli import main
from replay.errors import ExitCode, UsageError
from replay.evaluate.geometry import enu_axes, turn_back
from replay.evaluate.outages import DEGRADE
from replay.evaluate.read import RunChannels
from replay.log.columns import Columns
from replay.schemas import solution_pb2
from replay.simulate import load_scenario
from replay.time import NS_PER_S
from replay.view.labels import NONE
from tests.view.fake_run import START_NS, _ecef_origin

SECONDS = 120
SPAN = (60, 90)  # of the outage, s
AT_S = np.arange(SECONDS)
TIMES = START_NS + AT_S * NS_PER_S
FIRST = Kind(TIGHT, "unit", "integrate", 200)


def planted(
    kind: Kind,
    seed: int,
    size: float,
    *,
    begin: int = 0,
    drift_cm: tuple[float, float, float] | None = None,
) -> Run:
    """A run whose errors in every axis are as large as `size` at each epoch, of either sign."""
    sign = np.where(AT_S % 2 == 0, 1.0, -1.0)
    series: dict[str, Any] = {TIME: TIMES, UPDATED: np.ones(SECONDS)}
    for quantity, axes in QUANTITIES.items():
        for index, axis in enumerate(axes):
            values = sign * size * (index + 1)
            series[f"{quantity}.{axis}"] = np.where(begin <= AT_S, values, np.nan)
    for index, name in enumerate(PATH):
        series[name] = _ecef_origin()[0][index] + 0.0 * AT_S
    series[SATELLITES] = np.full(SECONDS, 7.0)
    series[PDOP] = np.full(SECONDS, 2.0)
    figures: dict[str, float] = {}
    if drift_cm is not None:
        series[OUTAGES] = TIMES[list(SPAN)]
        for axis, value in zip(("east", "north", "up"), drift_cm, strict=True):
            figures[f"outage.1.{axis}.before_m"] = 0.0
            figures[f"outage.1.{axis}.end_m"] = value / 100.0
            figures[f"outage.1.{axis}.most_m"] = abs(value) / 100.0
    return Run(kind, seed, figures, series)


def all_runs(seeds: int = 5, *, slower_by_cm: float = 0.0) -> Runs:
    """Runs of every kind; slower units drift less by so much, give or take a little."""
    rng = np.random.default_rng(1)
    found: list[Run] = []
    for seed in range(seeds):
        usual = rng.uniform(50.0, 150.0)
        found.append(planted(Kind(REFERENCE), seed, 0.01))
        for outage in (False, True):
            alone = planted(Kind(ALONE, outage=outage), seed, 0.2)
            if outage:
                alone.series[SATELLITES][SPAN[0] : SPAN[1]] = 3.0
            found.append(alone)
            for method, rates in (("integrate", (200, 100)), ("decimate", (100,))):
                for rate in rates:
                    less = slower_by_cm if rate < 200 else 0.0
                    drift = usual - less + rng.normal(0.0, 0.5)
                    kind = Kind(TIGHT, "unit", method, rate, outage)
                    found.append(
                        planted(kind, seed, 0.1, drift_cm=(drift, 0.0, 0.0) if outage else None)
                    )
    return Runs(tuple(found))


def test_paired_is_what_scipy_says() -> None:
    rng = np.random.default_rng(3)
    first, second = rng.normal(5.0, 2.0, 10), rng.normal(4.0, 2.0, 10)
    found = paired(first.tolist(), second.tolist())
    expected = stats.ttest_rel(first, second)
    low, high = expected.confidence_interval(0.95)
    assert found is not None
    assert found.count == 10
    np.testing.assert_allclose(
        [found.mean, found.low, found.high, found.probability],
        [np.mean(first - second), low, high, expected.pvalue],
        rtol=1e-12,
    )
    assert found.smaller == np.sum(first < second)


def test_pairs_that_are_not_there() -> None:
    assert paired([], []) is None
    assert paired([1.0, np.nan], [np.nan, 1.0]) is None
    (one, same) = paired([3.0, np.nan], [1.0, 2.0]), paired([1.0, 2.0], [1.0, 2.0])
    assert one is not None and (one.count, one.mean) == (1, 2.0) and np.isnan(one.low)
    assert same is not None and (same.low, same.high, same.probability) == (0.0, 0.0, 1.0)


def test_holm_is_the_worked_example() -> None:
    # S. Holm, Scand. J. Statist. 6 (1979): four tests of 0.01, 0.04, 0.03, 0.005.
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    assert np.isnan(holm([np.nan, 0.5])[0]) and holm([np.nan, 0.5])[1] == 0.5
    assert holm([0.9, 0.8]) == [1.0, 1.0]


def test_the_papers_figures_hang_together_as_it_is_said() -> None:
    implied = published.implied_ppp_cm(
        published.OUTAGE_POSITION_CM[200], published.OUTAGE_IMPROVEMENT_PERCENT[200]
    )
    assert published.OUTAGE_PPP_CM[0] == pytest.approx(implied[0], abs=0.01)
    assert implied[1] == pytest.approx(46.90, abs=0.01)
    # An improvement rounded to 0.1 % cannot be that of the value that is printed.
    printed = published.OUTAGE_PPP_CM[2]
    improvement = 100.0 * (1.0 - published.OUTAGE_POSITION_CM[200][2] / printed)
    assert improvement == pytest.approx(36.2, abs=0.05)
    assert abs(improvement - published.OUTAGE_IMPROVEMENT_PERCENT[200][2]) > 0.5
    apart = published.OUTAGE_STARTS_S[1] - published.OUTAGE_STARTS_S[0]
    starts = [float(text.split(",")[0]) for text in PLAN.outages]
    assert starts[1] - starts[0] == apart
    # What the drift of the last second alone makes of an hour's root mean square.
    rms = published.OUTAGE_POSITION_CM[200][0]
    squares = published.DRIFT_CM[200][0] ** 2 - published.DRIFT_CM[100][0] ** 2
    assert rms - np.sqrt(rms**2 - squares / 3600.0) == pytest.approx(0.26, abs=0.005)


def test_root_mean_squares_and_improvement() -> None:
    runs = all_runs()
    tight, alone = rms_of(runs, FIRST), rms_of(runs, Kind(ALONE))
    assert tight is not None and alone is not None
    np.testing.assert_allclose(tight.mean(POSITION), [10.0, 20.0, 30.0])
    np.testing.assert_allclose(tight.mean(VELOCITY), [10.0, 20.0, 30.0])
    np.testing.assert_allclose(tight.mean(ATTITUDE), [0.1, 0.2, 0.3])
    np.testing.assert_allclose(tight.spread(POSITION), [0.0, 0.0, 0.0], atol=1e-12)
    better = improvement_percent(tight.mean(POSITION), alone.mean(POSITION))
    np.testing.assert_allclose(better, [50.0, 50.0, 50.0])
    against = rms_of(runs, FIRST, against_reference=True)
    assert against is not None
    np.testing.assert_allclose(against.mean(POSITION), [9.0, 18.0, 27.0])


def test_ppp_has_no_position_with_three_satellites() -> None:
    runs = all_runs()
    found = rms_of(runs, Kind(ALONE, outage=True))
    assert found is not None
    np.testing.assert_allclose(found.availability, 1.0 - (SPAN[1] - SPAN[0]) / SECONDS)
    whole = rms_of(runs, Kind(ALONE))
    assert whole is not None and (whole.availability == 1.0).all()


def test_all_runs_of_a_seed_are_measured_from_the_same_epoch() -> None:
    late = planted(Kind(ALONE), 0, 0.1, begin=30)
    early = planted(FIRST, 0, 0.1)
    early.series["position_m.east"][:30] = 50.0
    runs = Runs((late, early))
    assert runs.begin_ns(0) == TIMES[30]
    found = rms_of(runs, FIRST)
    assert found is not None
    np.testing.assert_allclose(found.mean(POSITION), [10.0, 20.0, 30.0])
    assert rms_of(runs, FIRST, since_s=SECONDS) is None


def test_a_heading_is_compared_the_short_way_round() -> None:
    one, other = planted(FIRST, 0, 0.0), planted(Kind(REFERENCE), 0, 0.0)
    one.series["attitude_deg.heading"][:] = 179.0
    other.series["attitude_deg.heading"][:] = -179.0
    np.testing.assert_allclose(one.against(other, ATTITUDE)[:, 2], -2.0)


def test_drifts_are_rms_over_outages_and_most_of_any() -> None:
    run = planted(dataclasses.replace(FIRST, outage=True), 0, 0.1, drift_cm=(3.0, 0.0, -4.0))
    figures = dict(run.figures)
    for axis, value in zip(("east", "north", "up"), (-4.0, 0.0, 3.0), strict=True):
        figures[f"outage.2.{axis}.end_m"] = value / 100.0
        figures[f"outage.2.{axis}.most_m"] = 2.0 * abs(value) / 100.0
    series = {**run.series, OUTAGES: TIMES[[10, 40, *SPAN]]}
    runs = Runs((dataclasses.replace(run, figures=figures, series=series),))
    np.testing.assert_allclose(drifts_cm(runs, run.kind), [[[3, 0, -4], [-4, 0, 3]]])
    np.testing.assert_allclose(
        drift_sizes_cm(runs, run.kind), [[np.sqrt(12.5), 0.0, np.sqrt(12.5), 5.0]]
    )
    np.testing.assert_allclose(greatest_drifts_cm(runs, run.kind), [[8.0, 0.0, 6.0]])
    assert np.isnan(drift_sizes_cm(runs, FIRST)).all()
    before = {f"outage.{n}.{a}.before_m": 0.01 for n in (1, 2) for a in ("east", "north", "up")}
    (one,) = runs.runs
    runs = Runs((dataclasses.replace(one, figures={**figures, **before}),))
    np.testing.assert_allclose(
        drift_sizes_cm(runs, run.kind, added=True), [np.sqrt([14.5, 1.0, 14.5, 30.0])]
    )


@pytest.mark.parametrize(
    ("slower_by_cm", "says"),
    [(0.0, "is not seen"), (20.0, "either way"), (-20.0, "100 Hz drift more")],
)
def test_the_claim_follows_the_drifts(slower_by_cm: float, says: str) -> None:
    runs = all_runs(slower_by_cm=slower_by_cm)
    found = comparisons(runs, "unit")
    assert [(c.first.rate_hz, c.first.method, c.second.rate_hz) for c in found] == [
        (100, "integrate", 200), (100, "decimate", 200), (100, "decimate", 100),
    ]  # fmt: skip
    assert says in claim_said(runs, "unit")
    assert found[0].pair.mean == pytest.approx(-slower_by_cm, abs=1.0)
    assert all(item.adjusted >= item.pair.probability for item in found)
    said = claim_said(runs, "unit")
    if slower_by_cm:  # all three are shown to differ: nothing is left to be bounded
        assert "lies within" not in said
        assert f"(by {abs(found[0].pair.mean):.1f} cm)" in said
    else:
        assert said.count("of 100 Hz lies within") == 2
        widest = max(abs(found[0].pair.low), abs(found[0].pair.high))
        told = f"{widest:.1f} cm" if widest >= 1.0 else f"{10.0 * widest:.1f} mm"
        assert f"within {told} of nought" in said
    assert "One seed tells nothing" in claim_said(all_runs(1), "unit")


def test_dropping_alone_is_told_from_slowness() -> None:
    runs = all_runs()
    changed = [
        planted(r.kind, r.seed, 0.1, drift_cm=(r.figures["outage.1.east.end_m"] * 100 - 20, 0, 0))
        if r.kind.method == "decimate" and r.kind.outage
        else r
        for r in runs.runs
    ]
    assert "an effect of how that is done" in claim_said(Runs(tuple(changed)), "unit")


def test_tables_have_ours_beside_the_published() -> None:
    runs = all_runs()
    table = accuracy_table(runs, "unit", outage=True)
    lines = {row[:3]: row for row in table.rows}
    assert lines["PPP", "", "published"][3:6] == ("16.94", NONE, "80.82")
    ours = lines["200 Hz", "integrated", "ours"]
    assert ours[3] == "10.00" and ours[6] == "50.0" and ours[-1] == "100.0"
    assert lines["PPP", "", "ours"][-1] == "75.0"
    assert ("100 Hz", "decimated", "ours") in lines
    drift = drift_table(runs, "unit")
    (row,) = [r for r in drift.rows if r[0] == "200 Hz" and r[2] == "published"]
    assert row[3:6] == ("143.6", "37.3", "141.3")
    assert len(comparison_table(runs, "unit").rows) == 3
    (position, *rest) = aim_table(runs).rows
    assert position[1:] == ("10.0 / 7.6", "20.0 / 19.5", "30.0 / 55.5", "1 of 3")
    assert rest[0][1].endswith("/ 34.2") and rest[0][2] == "0.0 / 20.0"
    content = json.loads(to_json(runs, "kan2022"))
    assert len(content["tables"]) == len(all_tables(runs))
    # JSON keeps no NaN, which most readers refuse.
    assert "NaN" not in to_json(runs, "kan2022").decode()


def test_figures_are_the_papers() -> None:
    runs = all_runs()
    found = shown(runs)
    assert found is not None
    made = figures_of(found)
    assert [item.number for item in made] == [3, 4, 5, 6, 7, 8, 9, 10]
    position = next(item for item in made if item.number == 7)
    assert [curve.label for curve in position.panels[0].curves] == ["PPP", "200 Hz", "100 Hz"]
    (span,) = found.spans()
    times, values = drift_curves(found, dataclasses.replace(FIRST, outage=True), span)
    assert (times[0], times[-1]) == (span.start_ns - NS_PER_S, span.end_ns)
    run = runs.find(dataclasses.replace(FIRST, outage=True), found.seed)
    assert run is not None
    assert values[-1, 0] == pytest.approx(100.0 * run.figures["outage.1.east.end_m"])
    with Workers() as workers:
        text = report_html(runs, found, made, PLAN, command="replay", workers=workers)
    for number in range(2, 12):
        assert f"Figure {number}." in text
    for words in published.CONTRADICTIONS:
        assert words[:40].replace("“", "") in text.replace("“", "")


def test_an_epoch_has_the_last_row_of_its_time() -> None:
    solution = np.array([0, 100, 200, 200, 300]) * 1_000_000
    epochs = np.array([-200, 0, 199, 200, 240, 500]) * 1_000_000
    np.testing.assert_array_equal(rows_at(solution, epochs), [-1, 0, 3, 3, 3, -1])
    np.testing.assert_array_equal(rows_at(solution[:0], epochs), [-1] * 6)


@pytest.mark.parametrize("clock_s", [0.0, 0.0001])
def test_measures_of_a_planted_run(clock_s: float) -> None:
    """A solution off by an error that grows in the outage, which began at 60 s.

    Its epochs come before those of the receiver by the error of a clock.
    """
    step_s = 0.1
    at_s = np.arange(0.0, SECONDS - 1 + step_s / 2, step_s)
    times = START_NS + np.round(at_s * 1e9).astype(np.int64)
    inside = (at_s >= SPAN[0]) & (at_s < SPAN[1])
    grown = np.where(inside, 0.01 * (at_s - SPAN[0]) ** 2, 0.0)
    # A row before and one after the update that ends the outage.
    rows = np.append(np.arange(len(at_s)), np.searchsorted(at_s, SPAN[1] - 1e-6))
    times = times - round(clock_s * 1e9)
    order = np.argsort(times[rows], kind="stable")
    rows = rows[order]
    again = np.append(False, np.diff(rows) == 0)
    first_of_end = np.append(again[1:], False)
    off = grown[rows].copy()
    off[first_of_end] = 0.01 * (SPAN[1] - SPAN[0]) ** 2
    origin = np.asarray(_ecef_origin()[0])
    enu = np.column_stack([0.1 + off, 0.2 + 0.0 * off, 0.3 - 2.0 * off])
    ecef = np.tile(origin, (len(rows), 1))
    whole = np.abs(at_s[rows] - np.round(at_s[rows])) < 1e-9
    status = np.where(
        whole & ~inside[rows] & ~first_of_end,
        solution_pb2.SOLUTION_STATUS_UPDATED,
        solution_pb2.SOLUTION_STATUS_PREDICTED,
    ).astype(np.int32)
    level = np.zeros((len(rows), 3))
    solution = Columns.build(
        times[rows],
        {
            "position_ecef_m": ecef + turn_back(enu_axes(ecef), enu),
            "velocity_enu_m_s": level + [0.01, 0.02, 0.03],
            "attitude_rad": level + np.radians([0.1, 0.2, 0.3]),
            "angular_rate_body_rad_s": level,
            "status": status,
        },
        log_time_ns=times[rows],
    )
    zeros = np.zeros((SECONDS, 3))
    truth = Columns.build(
        TIMES,
        {
            "position_ecef_m": np.tile(origin, (SECONDS, 1)),
            "velocity_enu_m_s": zeros,
            "attitude_rad": zeros,
            "lever_arm_body_m": zeros,
            "quality": np.zeros(SECONDS, dtype=np.int32),
        },
        log_time_ns=TIMES,
    )
    outage = {"start_ns": int(TIMES[SPAN[0]]), "end_ns": int(TIMES[SPAN[1]])}
    data = RunChannels(
        "run", solution, truth, observations_ns=TIMES,
        metadata={DEGRADE: {"json": json.dumps({"outages": [outage]})}},
    )  # fmt: skip
    found = measures_of(data)
    inside_s = (SPAN[0] <= AT_S) & (SPAN[1] > AT_S)
    expected = 0.1 + np.where(inside_s, 0.01 * (AT_S - SPAN[0]) ** 2.0, 0.0)
    # Before its first row truth is not known.
    np.testing.assert_allclose(found.series["position_m.east"][1:], expected[1:], atol=1e-6)
    np.testing.assert_array_equal(found.series[OUTAGES], TIMES[list(SPAN)])
    assert found.figures["velocity_m_s.up.rms"] == pytest.approx(0.03)
    assert found.figures["attitude_deg.heading.rms"] == pytest.approx(0.3)
    length = SPAN[1] - SPAN[0]
    assert found.figures["outage.1.east.end_m"] == pytest.approx(0.1 + 0.01 * length**2)
    assert found.figures["outage.1.up.end_m"] == pytest.approx(0.3 - 0.02 * length**2)
    assert found.figures["outage.1.up.most_m"] == pytest.approx(0.02 * length**2 - 0.3)
    assert found.figures["outage.1.north.before_m"] == pytest.approx(0.2)


# What follows runs things: a drive of a minute, fixes in the place of observations.

DRIVE = """\
seed = 5
[start]
latitude = "30.5 deg"
longitude = "114.3 deg"
[imu]
rate = 50.0
[gnss]
rate = 2.0
[truth]
rate = 2.0
[[segments]]
kind = "hold"
duration = 9.0
[[segments]]
kind = "speed"
to = 12.0
acceleration = 2.0
[[segments]]
kind = "straight"
duration = 12.0
[[segments]]
kind = "turn"
angle = "80 deg"
radius = 25.0
[[segments]]
kind = "straight"
duration = 14.0
"""


@pytest.fixture()
def plan(tmp_path: Path) -> Plan:
    (tmp_path / "scenario.toml").write_text(DRIVE)
    return Plan(
        scenario=tmp_path / "scenario.toml",
        units={"industrial": {"imu": {"grade": "industrial"}}},
        outages=("24,5", "34,4"),
        rates_hz=(50, 10),
        alone="gnss-ins-lc",
        tight="gnss-ins-lc",
        reference="gnss-ins-lc",
        reference_settings=("filter.states=15",),
        then=(),
    )


def ran(plan: Plan, folder: Path, seeds: int = 1) -> tuple[tuple[Case, ...], list[str]]:
    options = Options(folder, seeds=seeds, jobs=1)
    cases, count = study_cases(study_of(plan), options)
    told: list[str] = []
    run_sweep_study(cases, options, told=lambda case, row: told.append(case.key))
    assert len(told) == count
    return tuple(cases), told


def test_every_run_of_the_plan_once(plan: Plan) -> None:
    cases = plan_cases(plan, Options(Path(), seeds=2))
    # A reference, PPP with and without outages, and three of samples with and without: twice.
    assert len(cases) == len({case.key for case in cases}) == 2 * (1 + 2 + 6)
    seeds = [case.grid["seed"] for case in cases]
    assert seeds == sorted(seeds) and set(seeds) == {5.0, 6.0}
    # All runs of a seed and unit are over the same log.
    assert {kind_of(case.sweep)[0] for case in cases} == {ALONE, TIGHT, REFERENCE}
    with pytest.raises(UsageError, match="no unit"):
        plan_cases(plan, Options(Path(), labels=("wooden",)))


def test_the_study_goes_on_where_it_stopped(plan: Plan, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    cases, told = ran(plan, folder)
    assert len(told) == len(cases) == 9
    assert read_rows(folder / ROWS).column(ERROR).to_pylist() == [""] * 9
    before = {path: path.read_bytes() for path in row_files(folder / ROWS)}
    assert ran(plan, folder)[1] == []
    gone = row_path(folder / ROWS, cases[4])
    gone.unlink()
    assert ran(plan, folder)[1] == [cases[4].key]
    assert {path for path, data in before.items() if path.read_bytes() != data} <= {gone}
    more, told = ran(plan, folder, seeds=2)
    assert len(told) == 9 and {c.grid["seed"] for c in more if c.key in told} == {6.0}
    assert not [path for path in folder.rglob("*.mcap")]
    # The rows are those of a sweep like any other.
    made = sweep_table.pivot(folder / ROWS)
    assert sum(line.rows for line in made.lines) == 18
    series = read_series(row_path(folder / ROWS, cases[0]))
    assert len(series[TIME]) == len(series["position_m.east"]) > 50


def test_rows_become_tables_report_and_recording(plan: Plan, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    cases, _ = ran(plan, folder)
    options = Options(folder, jobs=1)
    with Workers() as workers:
        files = study_of(plan).present(cases, options, workers)
    assert set(files) == {"tables", "report", "recording"}
    assert files["recording"].stat().st_size > 10_000
    text = files["report"].read_text()
    assert "Figure 10." in text and "Missing" not in text
    content = json.loads(files["tables"].read_text())
    tight = [kind for kind in content["kinds"] if kind["run"] == TIGHT and kind["outages"]]
    assert np.array(tight[0]["drift_cm"]).shape == (1, 2, 3)
    runs = load_runs(cases, folder / ROWS)
    fast = runs.find(Kind(TIGHT, "industrial", "integrate", 50), 5)
    alone = runs.find(Kind(ALONE), 5)
    assert fast is not None and alone is not None
    # The same pipeline over the same samples is the same, whatever it is called here.
    if fast.figures["epochs"] == alone.figures["epochs"]:
        np.testing.assert_allclose(fast.times_ns, alone.times_ns)


def test_a_run_that_failed_is_told_and_tried_again(plan: Plan, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    wrong = dataclasses.replace(plan, outages=("24,5", "500,5"), rates_hz=(50,))
    cases, told = ran(wrong, folder)
    assert len(told) == 5
    runs = load_runs(cases, folder / ROWS)
    assert len(runs.runs) == 3 and len(runs.failed) == 2
    assert all("no GNSS row" in text for text in runs.failed)
    with Workers() as workers:
        files = study_of(wrong).present(cases, Options(folder, jobs=1), workers)
    assert "2 runs are not in here" in files["report"].read_text()
    assert set(ran(wrong, folder)[1]) == {c.key for c in cases if c.grid.get("outage") != "none"
                                          and c.sweep != REFERENCE}  # fmt: skip


def test_the_command(
    plan: Plan,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    small = dataclasses.replace(plan, rates_hz=(50,))
    monkeypatch.setitem(studies.STUDIES, "kan2022", lambda: study_of(small))
    words = ["study", "kan2022", "-o", str(tmp_path / "out"), "--jobs", "1"]
    for rows in (0, 5):
        monkeypatch.setattr("sys.argv", ["replay", *words])
        with pytest.raises(SystemExit) as left:
            main()
        assert left.value.code == int(ExitCode.OK)
        assert f"5 runs, {rows} of them have a row" in capsys.readouterr().out
    assert (tmp_path / "out" / "recording.rrd").exists()


def test_the_outages_lie_where_the_vehicle_drives_in_the_open() -> None:
    ours = load_scenario(PLAN.scenario)
    # No blockage is near, and none is at its end.
    for text in PLAN.outages:
        start, length = (float(word) for word in text.split(",")[:2])
        for item in ours.setup.blockages:
            assert item.end < start or item.begin > start + length
