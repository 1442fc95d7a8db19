"""Sweeps: every combination once, a row for each, whatever becomes of it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import distributed
import pyarrow.dataset
import pytest

from replay.batch.sweep.case import run_case
from replay.batch.sweep.file import Case, cases_of, label_of, load_sweep
from replay.batch.sweep.rows import flatten, read_rows, row_files, row_path
from replay.batch.sweep.run import Options, Swept, run_sweep
from replay.batch.sweep.table import pivot
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.engine.transforms import Transform, transform_log
from replay.errors import ConfigurationError, ExitCode, UsageError
from replay.evaluate import evaluate_run
from replay.log.reader import LogReader
from replay.simulate import simulate

DRIVE = """
seed = 11
[start]
latitude = "52 deg"
longitude = "4.4 deg"
[imu]
rate = 50.0
grade = "industrial"
[gnss]
rate = 4.0
[truth]
rate = 5.0
[[segments]]
kind = "hold"
duration = 9.0
[[segments]]
kind = "speed"
to = 12.0
acceleration = 2.0
[[segments]]
kind = "straight"
duration = 9.0
[[segments]]
kind = "turn"
angle = "80 deg"
radius = 25.0
[[segments]]
kind = "straight"
duration = 11.0
"""
SWEEP = """
name = "tiny"
scenario = ["scenario.toml"]
pipeline = ["gnss-ins-lc"]
figures = ["position_error_m.*", "outage_summary.*", "counts.*"]
table = ["position_error_m.horizontal.rms"]
[grid]
imu_rate = [50, 10]
outage = ["", "25,5"]
"""
RMS = "figure.position_error_m.horizontal.rms"


@pytest.fixture()
def file(tmp_path: Path) -> Path:
    (tmp_path / "scenario.toml").write_text(DRIVE)
    (tmp_path / "sweep.toml").write_text(SWEEP)
    return tmp_path / "sweep.toml"


def cases(file: Path) -> tuple[Case, ...]:
    return cases_of(load_sweep(file), file.parent)


def swept(file: Path, **options: Any) -> Swept:
    told: list[str] = []
    result = run_sweep(
        file,
        cases(file),
        Options(file.parent / "out", **{"jobs": 1, **options}),
        told=lambda case, row: told.append(case.key),
    )
    assert len(told) == len(set(told)) == result.done
    return result


def rows_of(file: Path) -> list[dict[str, Any]]:
    return read_rows(file.parent / "out").to_pylist()


def test_every_combination_once(file: Path) -> None:
    assert swept(file) == Swept(cases=4, done=4, failed=0, lossy=0, foreign=0)
    rows = rows_of(file)
    points = {(row["grid.imu_rate"], row["grid.outage"]) for row in rows}
    assert points == {(50.0, "none"), (50.0, "25,5"), (10.0, "none"), (10.0, "25,5")}
    assert all(row["error"] == "" for row in rows)
    folder = file.parent / "out"
    assert {path.parent.name for path in row_files(folder)} == {"imu_rate=50", "imu_rate=10"}
    # Any reader of data sets finds the rows; logs are gone.
    found = pyarrow.dataset.dataset(row_files(folder), partitioning="hive").to_table()
    assert found.num_rows == 4
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


def test_a_row_is_what_the_commands_give(file: Path) -> None:
    swept(file)
    log, changed, run = (file.parent / name for name in ("a.mcap", "b.mcap", "c.mcap"))
    simulate(file.parent / "scenario.toml", log)
    transform_log(log, changed, Transform(imu_rate=10.0, outage=("25,5",)))
    with LogReader(changed) as reader:
        replay_log(reader, run, make_job(reader, "gnss-ins-lc", tables=[]))
    evaluation = evaluate_run(run)
    (row,) = [r for r in rows_of(file) if r["grid.imu_rate"] == 10 and r["grid.outage"] == "25,5"]
    assert evaluation.position_error_m is not None
    assert row[RMS] == evaluation.position_error_m["horizontal"].rms
    assert row["figure.outage_summary.count"] == 1.0
    assert row["figure.counts.solution_rows"] == evaluation.counts.solution_rows
    assert not any(name.startswith("figure.nees") for name in row)
    with LogReader(run) as reader:
        for topic, digest in reader.digests().items():
            assert digest.sha256 in row["inputs" if topic in changed_topics(row) else "outputs"]


def changed_topics(row: dict[str, Any]) -> set[str]:
    return set(json.loads(row["inputs"]))


def test_resume_runs_what_has_no_row(file: Path) -> None:
    swept(file)
    before = {path: path.stat().st_mtime_ns for path in row_files(file.parent / "out")}
    gone = list(before)[1]
    content = next(r for r in rows_of(file) if r["case"] == gone.stem)
    gone.unlink()
    with pytest.raises(UsageError, match="holds rows"):
        swept(file)
    assert swept(file, resume=True).done == 1
    after = {path: path.stat().st_mtime_ns for path in row_files(file.parent / "out")}
    assert {path for path in before if before[path] != after[path]} == {gone}
    again = next(r for r in rows_of(file) if r["case"] == gone.stem)
    clocks = {"simulate_s", "transform_s", "run_s", "evaluate_s"}
    assert {k: v for k, v in again.items() if k not in clocks} == {
        k: v for k, v in content.items() if k not in clocks
    }
    assert swept(file, resume=True).done == 0


def test_what_decides_a_case_is_in_its_key(file: Path) -> None:
    known = {case.key for case in cases(file)}
    assert known == {case.key for case in cases(file)}
    file.write_text(SWEEP.replace('"25,5"', '"25,6"'))
    assert len(known & {case.key for case in cases(file)}) == 2
    for other in (
        SWEEP.replace("[grid]", '[transform]\nnoise = ["/imu/raw.angular_rate=1"]\n[grid]'),
        SWEEP.replace("[grid]", "[over]\nseed = 12\n[grid]"),
        SWEEP.replace("name =", 'settings = ["filter.states=15"]\nname ='),
        SWEEP.replace("name =", "fixed_truth_only = true\nname ="),
    ):
        file.write_text(other)
        assert not known & {case.key for case in cases(file)}
    file.write_text(SWEEP)
    (file.parent / "scenario.toml").write_text(DRIVE.replace("seed = 11", "seed = 12"))
    assert not known & {case.key for case in cases(file)}


def test_a_case_that_fails_is_a_row(file: Path) -> None:
    file.write_text(
        SWEEP.replace("[50, 10]", "[10, 30]").replace('["", "25,5"]', '["25,5", "500,5"]')
    )
    result = swept(file)
    assert (result.done, result.failed) == (4, 3)
    assert result.exit_code is ExitCode.LOSS
    errors = {(r["grid.imu_rate"], r["grid.outage"]): r["error"] for r in rows_of(file)}
    assert errors[10.0, "25,5"] == ""
    assert "no GNSS row" in errors[10.0, "500,5"]
    assert "50 Hz cannot become" in errors[30.0, "25,5"]
    # What failed is known to have failed.
    assert swept(file, resume=True) == Swept(cases=4, done=0, failed=3, lossy=0, foreign=0)
    made = pivot(file.parent / "out")
    assert [(line.rows, line.failed) for line in made.lines] == [(1, 0), (1, 1), (1, 1), (1, 1)]


def test_a_scenario_that_cannot_be_made_is_a_row(file: Path) -> None:
    file.write_text(
        SWEEP.split("[grid]")[0] + '[grid]\n"scenario.imu.grade" = ["perfect", "wooden"]\n'
    )
    assert (swept(file).done, swept(file, resume=True).failed) == (2, 1)
    assert ["wooden" in row["error"] for row in rows_of(file)].count(True) == 1


def test_seeds_are_those_of_scenario_and_noise(file: Path) -> None:
    noise = '[transform]\nnoise = ["/imu/raw.angular_rate=0.1 deg/s"]\n'
    file.write_text(SWEEP.split("[grid]")[0] + noise + "[grid]\nseed = [3, 4]\n")
    made = cases(file)
    assert [case.transform["seed"] for case in made] == [3, 4]
    assert [dict(case.source.tables[0])["seed"] for case in made] == [3, 4]
    swept(file)
    first, second = (row[RMS] for row in rows_of(file))
    (line,) = pivot(file.parent / "out").lines
    name = RMS.removeprefix("figure.")
    assert line.rows == 2
    assert line.mean[name] == pytest.approx((first + second) / 2)
    assert line.spread[name] == pytest.approx(abs(first - second) / 2**0.5)


def test_settings_and_logs(file: Path) -> None:
    simulate(file.parent / "scenario.toml", file.parent / "drive.mcap")
    file.write_text(
        'log = ["drive.mcap"]\npipeline = ["gnss-ins-lc"]\n'
        '[grid]\n"settings.filter.states" = [15, 21]\n'
    )
    swept(file)
    states = [row["configuration"].count("states = 15") for row in rows_of(file)]
    assert sorted(states) == [0, 1]
    assert (file.parent / "drive.mcap").exists()


def test_the_table_has_the_order_of_the_file(file: Path) -> None:
    swept(file)
    made = pivot(file.parent / "out")
    assert (made.title, made.keys) == ("tiny", ("imu_rate", "outage"))
    points = [line.point for line in made.lines]
    assert points == [(50.0, "none"), (50.0, "25,5"), (10.0, "none"), (10.0, "25,5")]
    with pytest.raises(UsageError, match="no rows"):
        pivot(file.parent / "nowhere")


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ('pipeline = ["gnss-ins-lc"]', "needs logs"),
        ('scenario = ["scenario.toml"]', "needs pipelines"),
        (SWEEP.replace("gnss-ins-lc", "gnss"), "no pipeline|unknown pipeline"),
        (SWEEP.replace("imu_rate", "imu_speed"), "unknown key grid.imu_speed"),
        (SWEEP.replace("figures", "figure"), "unknown key figure"),
        (SWEEP.replace("[50, 10]", "[]"), "no value"),
        (SWEEP.replace("[50, 10]", "[50, 50.0]"), "twice"),
        ("name =", "no TOML"),
    ],
)
def test_what_is_no_sweep(file: Path, text: str, what: str) -> None:
    file.write_text(text)
    with pytest.raises(UsageError, match=what):
        cases(file)


def test_a_log_that_is_not_there(file: Path) -> None:
    file.write_text('log = ["none.mcap"]\npipeline = ["gnss-ins-lc"]\n')
    with pytest.raises(UsageError, match="cannot be read") as caught:
        cases(file)
    assert not isinstance(caught.value, ConfigurationError)


def test_flatten() -> None:
    nested = {"a": {"b": [1, {"c": True}], "d": None}, "e": "word", "f": 2.5}
    assert dict(flatten(nested)) == {"a.b.0": 1.0, "a.b.1.c": 1.0, "e": "word", "f": 2.5}


@pytest.mark.parametrize(
    ("value", "folder"),
    [
        (20250601, "seed=20250601"),
        (0.125, "seed=0.125"),
        (1e-9, "seed=1e-09"),
        ("a/b=c", "seed=a%2Fb%3Dc"),
        ([], "seed=none"),
        (True, "seed=true"),
    ],
)
def test_folders_have_the_whole_value(file: Path, value: Any, folder: str) -> None:
    (case, *_) = cases(file)
    made = dataclasses.replace(case, grid={"seed": label_of(value)})
    assert row_path(file.parent, made).parent.name == folder


def test_the_unexpected_is_a_row_too(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def breaks(*_: object, **words: object) -> None:
        raise ZeroDivisionError("by nought")

    monkeypatch.setattr("replay.batch.sweep.case.evaluate_run", breaks)
    case = cases(file)[0]
    log = file.parent / "a.mcap"
    simulate(file.parent / "scenario.toml", log)
    row = run_case(case, (log, 0.0, ""))
    assert row["error"] == "ZeroDivisionError: by nought"


def test_threads_of_a_cluster_give_the_same_rows(file: Path) -> None:
    swept(file)
    alone = {row["case"]: (row["outputs"], row[RMS]) for row in rows_of(file)}
    for path in row_files(file.parent / "out"):
        path.unlink()
    assert swept(file, jobs=2, threads=True).done == 4
    assert {row["case"]: (row["outputs"], row[RMS]) for row in rows_of(file)} == alone
    assert all(row_path(file.parent / "out", case).exists() for case in cases(file))


@pytest.mark.heavy
def test_processes_give_the_same_rows(file: Path) -> None:
    swept(file)
    alone = {row["case"]: (row["outputs"], row[RMS]) for row in rows_of(file)}
    for path in row_files(file.parent / "out"):
        path.unlink()
    assert swept(file, jobs=2).done == 4
    assert {row["case"]: (row["outputs"], row[RMS]) for row in rows_of(file)} == alone


def test_a_running_scheduler_gives_the_same_rows(file: Path) -> None:
    swept(file)
    alone = {row["case"]: (row["outputs"], row[RMS]) for row in rows_of(file)}
    for path in row_files(file.parent / "out"):
        path.unlink()
    library: Any = distributed
    with library.LocalCluster(
        n_workers=1,
        threads_per_worker=2,
        processes=False,
        protocol="tcp",
        dashboard_address="127.0.0.1:0",
        memory_limit=0,
    ) as cluster:
        address = cluster.scheduler_address
        assert address.startswith("tcp://")
        assert swept(file, scheduler=address).done == 4
        # The cluster is not the sweep's own: it runs on.
        with library.Client(address) as client:
            assert client.submit(pow, 3, 4).result() == 81
    assert {row["case"]: (row["outputs"], row[RMS]) for row in rows_of(file)} == alone


def test_rows_of_other_code_are_told(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert swept(file).outdated == 0
    monkeypatch.setattr("replay.batch.sweep.run.code_digest", lambda: "another")
    again = swept(file, resume=True)
    assert (again.done, again.outdated) == (0, 4)
    row_files(file.parent / "out")[0].unlink()
    monkeypatch.setattr("replay.batch.sweep.case.code_digest", lambda: "another")
    again = swept(file, resume=True)
    assert (again.done, again.outdated) == (1, 3)


def test_no_scheduler(file: Path) -> None:
    with pytest.raises(UsageError, match="no Dask scheduler"):
        swept(file, scheduler="tcp://127.0.0.1:1", patience_s=0.2)


def test_a_pipeline_goes_over_the_log_of_the_one_before(file: Path) -> None:
    file.write_text(SWEEP.replace("[grid]", 'then = ["gnss-ins-lc"]\n[grid]').replace(
        '[50, 10]', '[50]').replace('["", "25,5"]', '[""]'))  # fmt: skip
    (case,) = cases(file)
    assert case.then == ("gnss-ins-lc",)
    swept(file)
    (after,) = rows_of(file)
    assert after["error"] == ""
    file.write_text(SWEEP.replace("[50, 10]", "[50]").replace('["", "25,5"]', '[""]'))
    (before,) = cases(file)
    assert before.key != case.key
    # The same pipeline over the same samples, under another name.
    log = file.parent / "a.mcap"
    simulate(file.parent / "scenario.toml", log)
    row = run_case(before, (log, 0.0, ""))
    assert after[RMS] == row[RMS]
