"""Methods side by side: which are found, what they are called, what the table says."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from rich.console import Console
from small_channels import UPDATED, place, solution_rows, truth_rows

from replay import channels
from replay.errors import MissingChannelError
from replay.evaluate import evaluate_run, runs_of
from replay.evaluate.compare import read_methods, to_json_dict
from replay.evaluate.compare_table import markdown, print_comparison
from replay.log.reader import LogReader
from replay.log.writer import LogWriter

T = np.arange(0.0, 20.0)
STILL = np.zeros((len(T), 3))


def write(path, runs, *, manifest=None, truth=True):
    topics = {
        channels.SOLUTION.at(run=name): ("replay.Solution", solution_rows(T, place(STILL + error)))
        for name, error in runs.items()
    }
    if truth:
        topics["/truth"] = ("replay.Truth", truth_rows(T, place(STILL)))
    with LogWriter(path) as writer:
        for topic, (message, _) in topics.items():
            writer.add_channel(topic, message)
        writer.write({topic: columns for topic, (_, columns) in topics.items()})
        if manifest is not None:
            writer.add_metadata("replay.manifest", {"json": json.dumps(manifest)})
    return path


def test_every_run_of_every_log(tmp_path):
    one = write(tmp_path / "one.mcap", {"spp": np.array([1.0, 0, 0]), "tdcp": np.zeros(3)})
    two = write(tmp_path / "two.mcap", {"rtk": np.array([0, 0, 0.5])})
    methods = read_methods([one, two])
    assert [m.name for m in methods] == ["spp", "tdcp", "rtk"]
    east = [m.evaluation.position_error_m["east"].rms for m in methods]
    assert east == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
    np.testing.assert_allclose(methods[2].position.values[:, 2], 0.5, atol=1e-6)
    np.testing.assert_allclose(methods[0].change.values, 0.0, atol=1e-6)


def test_runs_of_one_name_are_told_apart(tmp_path):
    one = write(tmp_path / "one.mcap", {"spp": np.zeros(3)})
    two = write(tmp_path / "two.mcap", {"spp": np.zeros(3), "rtk": np.zeros(3)})
    assert [m.name for m in read_methods([one, two])] == ["one:spp", "rtk", "two:spp"]
    assert [m.name for m in read_methods([one, one])] == ["one:spp", "one:spp (2)"]


def test_the_run_of_the_manifest_is_the_logs_own(tmp_path):
    runs = {"spp": np.array([1.0, 0, 0]), "tdcp": np.zeros(3)}
    manifest = {"pipeline": "tdcp", "configuration": ""}
    log = write(tmp_path / "one.mcap", runs, manifest=manifest)
    assert runs_of(log) == ["tdcp", "spp"]
    assert evaluate_run(log).run == "tdcp"
    named = {"pipeline": "tdcp", "configuration": 'name = "spp"\n'}
    assert evaluate_run(write(tmp_path / "two.mcap", runs, manifest=named)).run == "spp"


def test_a_log_that_cannot_be_compared(tmp_path):
    blind = write(tmp_path / "blind.mcap", {"spp": np.zeros(3)}, truth=False)
    with pytest.raises(MissingChannelError, match="no truth"):
        read_methods([blind])
    none = write(tmp_path / "none.mcap", {})
    with pytest.raises(MissingChannelError, match="no solution") as caught:
        read_methods([none])
    assert str(none) in caught.value.where


def test_the_table_in_three_forms(tmp_path):
    methods = read_methods([write(tmp_path / "one.mcap", {"spp": np.array([3.0, 4.0, 1.25])})])
    out = io.StringIO()
    print_comparison(methods, Console(file=out, width=110))
    text = out.getvalue()
    for figure in ("3.000", "4.000", "1.250", "5.000", "spp"):
        assert figure in text, figure
    lines = markdown(methods).splitlines()
    assert lines[2].startswith("| spp | 0.000 / 0.000 / 0.000 | 3.000 / 4.000 / 1.250 |")
    assert lines[0].count("|") == lines[1].count("|") == lines[2].count("|")
    plain = json.loads(json.dumps(to_json_dict(methods), allow_nan=False))
    (only,) = plain["methods"]
    assert only["name"] == only["run"] == "spp"
    assert only["position_error_m"]["horizontal"]["rms"] == pytest.approx(5.0, abs=1e-6)
    assert methods[0].data.solution["status"][0] == UPDATED


def test_a_run_that_was_taken_over_stands_once(tmp_path):
    """A smoothed run's log holds its filter's, too; beside that log it is told once."""
    solution = channels.SOLUTION.at(run="rtk")
    one = write(tmp_path / "one.mcap", {"rtk": np.ones(3)})
    with LogReader(one) as reader:
        digest = {"topic": solution, "sha256": reader.digests()[solution].sha256}
    one = write(tmp_path / "one.mcap", {"rtk": np.ones(3)}, manifest={"outputs": [digest]})
    both = {"rtk": np.ones(3), "rtk-smoothed": np.zeros(3)}
    two = write(tmp_path / "two.mcap", both, manifest={"inputs": [digest]})
    assert [m.name for m in read_methods([one, two])] == ["rtk", "rtk-smoothed"]
    assert sorted(m.name for m in read_methods([two])) == ["rtk", "rtk-smoothed"]
    # Of another run of the same name nothing is left out.
    other = write(
        tmp_path / "other.mcap",
        {"rtk": np.zeros(3)},
        manifest={"outputs": [{"topic": solution, "sha256": "0" * 64}]},
    )
    names = [m.name for m in read_methods([other, two])]
    assert sorted(names) == ["other:rtk", "rtk-smoothed", "two:rtk"]
