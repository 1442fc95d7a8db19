"""Studies: members run beside each other give what they give alone; Lee's tables and page."""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import msgspec
import pytest

from replay.batch.lee2010 import run as lee
from replay.batch.lee2010.published import ATTITUDE_ARCMIN, CASES, POSITION_CM, SUCCESS
from replay.batch.lee2010.tables import (
    attitude_table,
    by_case,
    markdown_of,
    position_table,
    success_table,
)
from replay.batch.studies import STUDIES, find_study
from replay.batch.study import (
    INPUT,
    Done,
    Measured,
    Member,
    Options,
    Study,
    Variant,
    chosen_members,
    discard_logs,
    run_study,
)
from replay.batch.sweep_study import SweepStudy
from replay.batch.workers import Workers
from replay.cli import main
from replay.errors import ConfigurationError, UsageError
from replay.evaluate import evaluate_run
from replay.evaluate.network_run import SETTLING_S, NetworkFigures
from replay.simulate import load_scenario
from tests.batch import fake_network
from tests.batch.fake_network import PLANTED
from tests.evaluate.test_network_figures import write

SCENARIO = """\
seed = 3
[imu]
rate = "50 Hz"
[[segments]]
kind = "hold"
duration = 8.0
[[segments]]
kind = "speed"
to = 12.0
[[segments]]
kind = "straight"
duration = 20.0
"""


def measure(log: Path, variant: Variant) -> Measured:
    """A figure of a run; in this module, so that another process finds it."""
    error = evaluate_run(log).position_error_m
    assert error is not None
    return Measured((variant.name, error["horizontal"].rms), log.stat().st_size)


def present(done: Sequence[Done], options: Options, workers: Workers) -> Mapping[str, Path]:
    path = options.folder / "figures.json"
    path.write_bytes(msgspec.json.encode([member.figures for member in done]))
    return {"figures": path}


@pytest.fixture
def study(tmp_path: Path) -> Study:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(SCENARIO)
    variants = (
        Variant("plain", "gnss-ins-lc"),
        Variant("bare", "gnss-ins-lc", ("filter.states=15",)),
    )

    def members() -> list[Member]:
        return [
            Member(label, scenario, ({"gnss": {"grade": grade}},), variants)
            for label, grade in (("case1", "rtk"), ("case2", "spp"))
        ]

    return Study("small", "a test", members, measure, present)


def run(study: Study, options: Options) -> list[dict[str, tuple[str, float]]]:
    return [dict(done.figures) for done in run_study(study, options)]


def test_processes_beside_each_other_give_what_one_gives(study: Study, tmp_path: Path) -> None:
    alone = run(study, Options(tmp_path / "one", seeds=2, jobs=1))
    beside = run(study, Options(tmp_path / "two", seeds=2, jobs=2))
    assert alone == beside
    assert [set(figures) for figures in alone] == [{"plain", "bare"}] * 4
    # Another grade and another seed are other data.
    assert len({figures["plain"][1] for figures in alone}) == 4


def test_costlier_runs_begin_first_and_few_logs_wait(study: Study, tmp_path: Path) -> None:
    def members() -> list[Member]:
        one = study.members()[0]
        costs = {"plain": 1.0, "bare": 2.0}
        variants = tuple(dataclasses.replace(v, cost=costs[v.name]) for v in one.variants)
        return [dataclasses.replace(one, label=f"m{i}", variants=variants) for i in range(4)]

    begun: list[str] = []

    class Watched(Workers):
        def submit(self, work: Callable[..., Any], *given: Any) -> Future[Any]:
            target = given[1]
            begun.append(f"{target.parent.name} {target.stem}")
            return super().submit(work, *given)

    with Watched() as workers:
        many = dataclasses.replace(study, members=members)
        done = run_study(many, Options(tmp_path / "out"), workers=workers)
    assert [d.member.label for d in done] == ["m0", "m1", "m2", "m3"]
    assert all(list(d.figures) == ["plain", "bare"] for d in done)
    assert begun == [
        "m0 input", "m1 input", "m0 bare", "m1 bare", "m0 plain",
        "m2 input", "m2 bare", "m1 plain", "m3 input", "m3 bare", "m2 plain", "m3 plain",
    ]  # fmt: skip


def test_logs_of_the_first_seed_stay_and_of_others_go(study: Study, tmp_path: Path) -> None:
    options = Options(tmp_path / "out", seeds=2, jobs=1, labels=("2",))
    done = run_study(study, options)
    assert [(d.member.label, d.member.number) for d in done] == [("case2", 0), ("case2", 1)]
    assert all(path.is_file() for path in done[0].logs.values())
    assert set(done[0].logs) == {INPUT, "plain", "bare"}
    # What is drawn is of the first seed, and of the log as it was written.
    sizes = {name: done[0].logs[name].stat().st_size for name in ("plain", "bare")}
    assert done[0].pictures == sizes and done[1].pictures == {}
    assert not any(path.exists() for path in done[1].logs.values())
    assert [p.name for p in (options.folder / "logs").iterdir()] == ["case2"]
    discard_logs(done[0].logs)
    assert list(options.folder.iterdir()) == []


def test_seeds_follow_that_of_the_scenario(study: Study, tmp_path: Path) -> None:
    members = chosen_members(study, Options(tmp_path, seeds=3, labels=("case1",)))
    seeds = [load_scenario(m.scenario, m.tables).settings.seed for m in members]
    assert seeds == [3, 4, 5]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (Options(Path("x"), labels=("4",)), "no case '4'"),
        (Options(Path("x"), seeds=0), "1 or more"),
        (Options(Path("x"), jobs=0), "1 or more"),
    ],
)
def test_what_cannot_be_is_said(study: Study, options: Options, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        chosen_members(study, options)


def test_an_error_of_another_process_keeps_its_words(study: Study, tmp_path: Path) -> None:
    def members() -> list[Member]:
        return [
            dataclasses.replace(m, tables=({"imu": {"grade": "golden"}},)) for m in study.members()
        ]

    broken = dataclasses.replace(study, members=members)
    with pytest.raises(ConfigurationError, match="no grade 'golden'") as caught:
        run_study(broken, Options(tmp_path / "out", jobs=2))
    assert "known: " in caught.value.mend and caught.value.where


def test_an_unknown_study() -> None:
    with pytest.raises(UsageError) as caught:
        find_study("lee2011")
    assert "lee2010" in caught.value.mend


def test_the_command_lists_and_asks(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for words, said in ((["study"], "lee2010"), (["study", "lee2010"], "-o DIR")):
        monkeypatch.setattr(sys, "argv", ["replay", *words])
        with pytest.raises(SystemExit):
            main()
        told = capsys.readouterr()
        assert said in told.out + told.err


def test_every_study_has_members_whose_scenarios_can_be_read() -> None:
    for name in STUDIES:
        found = find_study(name)
        assert found.name == name
        if isinstance(found, SweepStudy):
            for case in found.cases(Options(Path())):
                load_scenario(case.source.path, case.source.tables)
            continue
        assert found.members()
        for member in found.members():
            load_scenario(member.scenario, member.tables)


# Lee (2010)


def test_published_figures_have_every_case_and_mode() -> None:
    for table in (POSITION_CM, ATTITUDE_ARCMIN):
        assert tuple(table) == CASES == tuple(SUCCESS)
        assert all(set(modes) == {"single", "network"} for modes in table.values())


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> list[Done]:
    """Two seeds of one case, of which only the first has logs."""
    folder = tmp_path_factory.mktemp("lee")
    member = next(m for m in lee.members() if m.label == "case2")
    logs: dict[str, Path] = {}
    figures, pictures = {}, {}
    for mode in ("network", "single"):
        rows = fake_network.make_network(150.0, run=mode, single=mode == "single")
        logs[mode] = write(folder / f"{mode}.mcap", rows, fake_network.make_metadata(mode))
        measured = lee.measure(logs[mode], Variant(mode, "network-ins-tc"))
        figures[mode], pictures[mode] = measured.figures, measured.picture
    second = dict(figures)
    network = figures["network"]
    assert isinstance(network, NetworkFigures)
    worse = {
        axis: msgspec.structs.replace(item, mean=-2.0 * item.mean, std=2.0 * item.std)
        for axis, item in network.position_cm.items()
    }
    assert network.epochs is not None
    second["network"] = msgspec.structs.replace(
        network, position_cm=worse,
        epochs=msgspec.structs.replace(network.epochs, wrong=network.epochs.wrong + 2),
    )  # fmt: skip
    return [
        Done(member, logs, figures, (), 1.0, pictures),
        Done(dataclasses.replace(member, number=1), {}, second, (), 1.0),
    ]


def test_success_is_the_mean_and_the_worst_of_seeds(done: list[Done]) -> None:
    figures = done[0].figures["network"].epochs
    row = success_table(by_case(done)).rows[0]
    rates = [
        100.0 * (figures.fixed - PLANTED["wrong"] - more) / figures.attempted for more in (0, 2)
    ]
    assert row[:4] == ("Case 2", "100.0", f"{sum(rates) / 2:.2f}", f"{rates[1]:.2f}")
    assert row[8] == str(2 * PLANTED["wrong"] + 2)


def test_tables_tell_published_mean_and_worst(done: list[Done]) -> None:
    table = position_table(by_case(done))
    assert [row[2] for row in table.rows] == ["published", "ours, mean", "ours, worst"] * 2
    assert [row[:2] for row in table.rows[::3]] == [("Case 2", "single"), ("Case 2", "network")]
    assert table.rows[0][3:] == ("5.1 ± 11.4", "10.5 ± 32.8", "11.7 ± 34.7")
    north = done[0].figures["network"].position_cm["north"]
    mean, worst = table.rows[4][3], table.rows[5][3]
    assert mean == f"{1.5 * abs(north.mean):.1f} ± {1.5 * north.std:.1f}"
    assert worst == f"{2.0 * abs(north.mean):.1f} ± {2.0 * north.std:.1f}"
    one = position_table(by_case(done[:1]))
    assert [row[2] for row in one.rows] == ["published", "ours"] * 2
    attitude = attitude_table(by_case(done))
    assert attitude.rows[3][3:] == ("1.88 ± 2.28", "0.53 ± 0.64", "2.66 ± 1.27")
    assert markdown_of(one).count("\n|") == len(one.rows) + 2


def test_page_recording_and_tables_are_written(done: list[Done], tmp_path: Path) -> None:
    options = Options(tmp_path, seeds=2, labels=("2",))
    with Workers() as workers:
        files = lee.present(done, options, workers)
    assert {name: path.name for name, path in files.items()} == {
        "tables": "tables.json", "report": "report.html", "recording": "recording.rrd",
    }  # fmt: skip
    page = files["report"].read_text()
    for number in range(3, 11):
        assert f"<h2>Figure {number}. " in page
    assert "Assumptions" in page and "2 seeds" in page and f"{SETTLING_S:g} s after" in page
    assert "--seeds 2 --cases 2" in page
    content = json.loads(files["tables"].read_text())
    assert len(content["members"]) == 2 and content["published"]["success_percent"]["case1"] == 99.7
    signed = content["members"][1]["figures"]["network"]["position_cm"]["north"]["mean"]
    assert signed == -2.0 * done[0].figures["network"].position_cm["north"].mean
    assert files["recording"].stat().st_size > 50_000
