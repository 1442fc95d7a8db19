"""Runs over runs: a smoothed run is compared with the one it was made from, row by row."""

from __future__ import annotations

import dataclasses

from small_runs import channels

from replay.channels import SOLUTION
from replay.diff.compare import diff_runs
from replay.diff.lineage import lineage
from replay.diff.result import Verdict
from replay.diff.runs import MemoryRun
from replay.schemas.replay_pb2 import ChannelDigest, Manifest

IMU = "/imu/raw"


def manifest(inputs: dict[str, str], outputs: dict[str, str]) -> Manifest:
    def digests(table: dict[str, str]) -> list[ChannelDigest]:
        return [ChannelDigest(topic=topic, sha256=sha) for topic, sha in table.items()]

    return Manifest(inputs=digests(inputs), outputs=digests(outputs))


def names(run: str) -> str:
    return SOLUTION.at(run=run)


FORWARD = manifest({IMU: "1"}, {names("lc"): "2"})
LATER = manifest({IMU: "1", names("lc"): "2"}, {names("lc-smoothed"): "3"})


def test_one_log_made_over_another() -> None:
    found = lineage(FORWARD, LATER)
    assert found is not None
    assert found.run_names == {"lc": "lc-smoothed"}
    assert found.passed == {names("lc")}
    assert found.text == "B was made over A: lc-smoothed beside lc"
    turned = lineage(LATER, FORWARD)
    assert turned is not None
    assert turned.run_names == {"lc-smoothed": "lc"}
    assert turned.text.startswith("A was made over B")


def test_runs_that_are_no_relations() -> None:
    assert lineage(FORWARD, None) is None
    assert lineage(FORWARD, FORWARD) is None
    # Over another recording, or over another run of that name.
    assert lineage(manifest({IMU: "9"}, {names("lc"): "2"}), LATER) is None
    assert lineage(manifest({IMU: "1"}, {names("lc"): "9"}), LATER) is None
    # Another run over the same recording alone.
    assert lineage(FORWARD, manifest({IMU: "1"}, {names("spp"): "4"})) is None


def test_the_later_run_stands_beside_the_earlier_one() -> None:
    """The solution of one log is the later run of the other: equal rows, nothing extra."""
    rows = channels()
    (solution,) = (topic for topic in rows if SOLUTION.matches(topic))
    lc = SOLUTION.parts(solution)["run"]
    one = {IMU: rows[IMU], solution: rows[solution]}
    two = {**one, names(f"{lc}-smoothed"): dataclasses.replace(rows[solution])}
    first = manifest({IMU: "1"}, {solution: "2"})
    second = manifest({IMU: "1", solution: "2"}, {names(f"{lc}-smoothed"): "3"})
    result = diff_runs(MemoryRun("a", one, manifest=first), MemoryRun("b", two, manifest=second))
    assert result.verdict is Verdict.IDENTICAL
    assert {(c.topic, c.topic_b) for c in result.channels} == {
        (IMU, IMU), (solution, names(f"{lc}-smoothed"))
    }  # fmt: skip
    assert result.inputs == []
    assert result.culprit is None
    assert "made over" in result.reasons[0]
