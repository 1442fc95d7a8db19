"""The degradation of Lee's network: one thing is changed at a time, and the table tells it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from replay.batch.lee2010_degradation.figures import Row, RunFigures, rows_of
from replay.batch.lee2010_degradation.members import (
    AS_IS,
    DISTANCES_KM,
    IMUS,
    IONOSPHERES,
    REFERENCES,
    SCENARIO,
    SWEEPS,
    members,
)
from replay.batch.lee2010_degradation.run import STUDY, present
from replay.batch.lee2010_degradation.tables import table_of, to_markdown
from replay.batch.study import Done, Options, run_study
from replay.batch.workers import Workers
from replay.configuration import build
from replay.evaluate.network import EpochIntegers, LaneIntegers
from replay.evaluate.network_residuals import ResidualFigures
from replay.evaluate.network_run import MeanStd, NetworkFigures, StationFigures
from replay.simulate import load_scenario
from replay.simulate.imu import IMU_GRADES, ImuErrors
from replay.simulate.motion import move
from replay.simulate.scenario import Scenario
from replay.simulate.trajectory import ecef_of

MEMBERS = {member.label: member for member in members()}


def scenario_of(label: str) -> Scenario:
    member = MEMBERS[label]
    return load_scenario(member.scenario, member.tables)


def places(scenario: Scenario) -> dict[str, np.ndarray]:
    return {
        item.name: np.asarray(ecef_of(item.latitude, item.longitude, item.height))
        for item in scenario.setup.receivers
        if item.kind == "static"
    }


def test_every_row_has_its_run() -> None:
    runs = {(m.label, variant.name) for m in MEMBERS.values() for variant in m.variants}
    shown = {(s.member, run) for sweep in SWEEPS for s in sweep.settings for run in s.runs}
    assert shown == runs
    assert len(runs) == sum(len(m.variants) for m in MEMBERS.values())


@pytest.mark.parametrize("km", DISTANCES_KM)
def test_flight_and_stations_are_as_far_as_they_are_called(km: int) -> None:
    scenario, before = scenario_of(f"{km}km"), scenario_of(AS_IS)
    here, there = places(scenario), places(before)
    path = move(scenario).trajectory.positions
    away = np.linalg.norm(path - here["mref"], axis=1)
    assert np.mean(away) / 1e3 == pytest.approx(km, rel=0.01)
    # Latitude keeps its scale, longitude shrinks with its cosine.
    factor = np.mean(away) / np.mean(
        np.linalg.norm(move(before).trajectory.positions - there["mref"], axis=1)
    )
    np.testing.assert_array_equal(here["mref"], there["mref"])
    for name in ("ref1", "ref2", "ref3"):
        far, near = (np.linalg.norm(p[name] - p["mref"]) for p in (here, there))
        assert far / near == pytest.approx(factor, rel=0.02)
    assert scenario.segments == before.segments
    others = [r for r in scenario.setup.receivers if r.kind == "vehicle"]
    assert others == [r for r in before.setup.receivers if r.kind == "vehicle"]


def test_flight_is_the_beginning_of_that_of_case_1() -> None:
    short, whole = scenario_of(AS_IS), load_scenario(SCENARIO)
    count = len(short.segments)
    assert short.segments == whole.segments[:count] and count < len(whole.segments)
    assert short.settings == whole.settings and short.setup == whole.setup


@pytest.mark.parametrize("grade", IMUS)
def test_an_inertial_unit_has_the_errors_of_its_grade_and_no_other(grade: str) -> None:
    found, before = scenario_of(grade), scenario_of(AS_IS)
    wanted = build(ImuErrors, [IMU_GRADES[grade]])
    for name in ImuErrors.__struct_fields__:
        if not name.endswith("_tau") or name in IMU_GRADES[grade]:
            assert getattr(found.settings.imu.errors, name) == getattr(wanted, name), name
    assert found.setup == before.setup and found.segments == before.segments


def test_an_ionosphere_changes_the_ionosphere_alone() -> None:
    before = scenario_of(AS_IS)
    skies = []
    for label in IONOSPHERES:
        found = scenario_of(label)
        assert found.settings == before.settings and found.segments == before.segments
        assert found.setup.receivers == before.setup.receivers
        sky = found.setup.sky
        assert sky.troposphere == before.setup.sky.troposphere
        assert sky.ionosphere != before.setup.sky.ionosphere
        skies.append(sky.ionosphere)
    assert [sky.wave.amplitude for sky in skies] == [0.0, 0.01, 0.1, 0.3, 0.0]


def figures(north: MeanStd, fixed: int, wrong: int, stations_wrong: int) -> RunFigures:
    lane = LaneIntegers(
        rows=200, fixed=190, judged=190, wrong=stations_wrong, first_fix_s=1.0, all_fixed_s=2.0
    )
    residual = ResidualFigures(
        count=10, before_rms_m=0.15, before_max_m=0.4, after_rms_m=0.01, after_max_m=0.05
    )
    return RunFigures(
        distance_km=58.0,
        network=NetworkFigures(
            run="network", since_s=60.0, until_s=900.0, settling_s=60.0, rows=840,
            position_cm={"north": north, "east": MeanStd(0.0, 1.0), "height": MeanStd(0.0, 2.0)},
            attitude_arcmin={},
            epochs=EpochIntegers(
                epochs=100, attempted=80, fixed=fixed, whole=fixed, judged=fixed, wrong=wrong,
                basis="integers",
            ),
            stations=StationFigures(baselines={"mref-ref1": {"1C": lane, "2W": lane}}, closures=()),
            residuals={"1C": residual},
        ),
    )  # fmt: skip


@pytest.fixture
def done() -> list[Done]:
    """Two seeds of the log as it is, all runs alike."""
    member = MEMBERS[AS_IS]
    seeds = (figures(MeanStd(-3.0, 4.0), 60, 10, 0), figures(MeanStd(6.0, 8.0), 40, 0, 5))
    return [
        Done(
            dataclasses.replace(member, number=number),
            {},
            {variant.name: item for variant in member.variants},
            (),
            1.0,
        )
        for number, item in enumerate(seeds)
    ]


def test_a_row_is_the_mean_over_seeds_and_counts_are_sums(done: list[Done]) -> None:
    row = rows_of(done)[0]
    assert row.both("north") == MeanStd(4.5, 6.0)
    assert row.about_truth("north") == pytest.approx((5.0 + 10.0) / 2.0)
    assert row.both("heading") is None and row.about_truth("roll") is None
    assert row.shares == (0.5, 0.05)  # of all epochs, not of those tried
    assert row.stations == (0.95, 10)
    assert row.residual_cm(after=True) == pytest.approx(1.0)
    assert row.residual_cm(after=False) == pytest.approx(15.0)


def test_rows_follow_the_sweeps_and_lack_what_was_not_run(done: list[Done]) -> None:
    rows = rows_of(done)
    assert {row.setting.member for row in rows} == {AS_IS}
    assert [row.setting.text for row in rows if row.sweep is SWEEPS[0]] == ["4", "3", "2", "1"]
    table = table_of(rows)
    groups = [line[0] for line in table.rows if not any(line[1:])]
    assert groups == [sweep.title for sweep in SWEEPS]
    line = next(line for line in table.rows if line[0].strip() == "3")
    assert line[1:3] == ("network", "4.5 ± 6.0") and line[8:12] == ("50.0", "5.0", "95.0", "10")
    assert to_markdown(table).count("\n|") == len(table.rows) + 2


def test_table_picture_and_page_are_written(done: list[Done], tmp_path: Path) -> None:
    with Workers() as workers:
        files = present(done, Options(tmp_path, seeds=2), workers)
    assert set(files) == {"tables", "table", "report"}
    page = files["report"].read_text()
    assert page.count("<svg") == 1 and "means over 2 seeds" in page
    for words in ("Reference stations", "Ionosphere", "Inertial unit", "epochs fixed"):
        assert words in page
    content = json.loads(files["tables"].read_text())
    assert len(content["members"]) == 2 and content["seeds"] == 2
    signed = content["members"][0]["figures"]["network"]["network"]["position_cm"]["north"]["mean"]
    assert signed == -3.0


@pytest.mark.heavy
def test_a_plane_needs_three_stations_and_methods_of_one_plane_are_alike(tmp_path: Path) -> None:
    options = Options(tmp_path, labels=(AS_IS,), keep_logs=False)
    rows = {row.variant: row for row in rows_of(run_study(STUDY, options))}

    def worst_cm(name: str) -> float:
        found = [rows[name].about_truth(axis) for axis in ("north", "east", "height")]
        return max(value for value in found if value is not None)

    for name in ("network", "references-3", "lcm", "lsc"):
        assert rows[name].shares == (1.0, 0.0), name
        assert worst_cm(name) < 1.0, name
    for name in ("references-2", "single"):
        assert worst_cm(name) > 5.0, name
    assert all(row.shares[1] == 0.0 for name, row in rows.items() if name != "single")
    assert set(REFERENCES) <= set(rows) and isinstance(rows["network"], Row)
