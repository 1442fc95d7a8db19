"""Taking fixes away: those of the stretch, and nothing else."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from replay.engine.degrade import DEGRADE, Outage, remove_fixes
from replay.engine.manifest import read_manifest
from replay.errors import UsageError
from replay.log.reader import LogReader
from tests.engine.drives import EVENTS, FIX, IMU, SECOND, SOLUTION, TRACE, TRUTH, run_to_file


@pytest.fixture(scope="module")
def start_ns(short_log: Path) -> int:
    with LogReader(short_log) as reader:
        return reader.start_ns


def outage(start_ns: int, begin_s: float, length_s: float) -> Outage:
    begin = start_ns + round(begin_s * SECOND)
    return Outage(begin, begin + round(length_s * SECOND))


def test_rows_of_the_stretch_are_gone(short_log: Path, start_ns: int, tmp_path: Path) -> None:
    target = tmp_path / "out.mcap"
    # 12 is the valid time of a fix: the first is included, the last is not.
    cuts = [outage(start_ns, 40.0, 3.3), outage(start_ns, 12.0, 5.0)]
    removed = remove_fixes(short_log, target, cuts)
    with LogReader(short_log) as before, LogReader(target) as after:
        fixes, kept = before.read(FIX, payloads=True), after.read(FIX, payloads=True)
        gone = np.zeros(len(fixes), dtype=bool)
        for cut in cuts:
            gone |= (fixes.valid_time_ns >= cut.start_ns) & (fixes.valid_time_ns < cut.end_ns)
        assert removed == {FIX: 20 + 14}
        assert gone.sum() == removed[FIX]
        rest = fixes.take(~gone)
        assert kept.valid_time_ns.tolist() == rest.valid_time_ns.tolist()
        assert kept.sequence.tolist() == rest.sequence.tolist()
        assert rest.payloads is not None and kept.payloads is not None
        assert kept.payloads.blobs() == rest.payloads.blobs()
        for topic in (IMU, TRUTH):
            assert after.digests()[topic] == before.digests()[topic]
        told = json.loads(after.metadata[DEGRADE]["json"])["outages"]
        assert told == [
            {"start_ns": c.start_ns, "end_ns": c.end_ns}
            for c in sorted(cuts, key=lambda c: c.start_ns)
        ]
        manifest = read_manifest(after.metadata, "out")
        assert manifest.command == "degrade"
        assert {d.topic: d.sha256 for d in manifest.inputs} == {
            t: d.sha256 for t, d in before.digests().items()
        }
        assert {d.topic: d.sha256 for d in manifest.outputs} == {
            t: d.sha256 for t, d in after.digests().items()
        }
        assert after.metadata["replay.defaults"] == before.metadata["replay.defaults"]


def test_the_run_notices(short_log: Path, start_ns: int, tmp_path: Path) -> None:
    remove_fixes(short_log, tmp_path / "out.mcap", [outage(start_ns, 40.0, 4.0)])
    run_to_file(tmp_path / "out.mcap", tmp_path / "run.mcap")
    with LogReader(tmp_path / "run.mcap") as reader:
        texts = reader.read(EVENTS).ragged("detail").texts()
        assert DEGRADE in reader.metadata
    assert sum(text.startswith("position again") for text in texts) == 2


def test_an_outage_that_takes_nothing(short_log: Path, start_ns: int, tmp_path: Path) -> None:
    for cuts in (
        [outage(start_ns, 25.0, 3.0)],  # the drive's own outage
        [outage(start_ns, 5000.0, 10.0)],
        [outage(start_ns, 12.0, 1.0), outage(start_ns, 12.3, 0.1)],
    ):
        with pytest.raises(UsageError, match="no GNSS row") as caught:
            remove_fixes(short_log, tmp_path / "out.mcap", cuts)
        assert str(short_log) in caught.value.where
        assert list(tmp_path.iterdir()) == []


def test_an_outage_has_a_length() -> None:
    with pytest.raises(UsageError, match="ends after it begins"):
        Outage(5, 5)


def test_outages_add_up(short_log: Path, start_ns: int, tmp_path: Path) -> None:
    """One after the other gives the rows of both at once."""
    first, second = outage(start_ns, 40.0, 3.0), outage(start_ns, 12.0, 5.0)
    one, two, both = (tmp_path / name for name in ("one.mcap", "two.mcap", "both.mcap"))
    remove_fixes(short_log, one, [first])
    remove_fixes(one, two, [second])
    remove_fixes(short_log, both, [first, second])
    with LogReader(two) as a, LogReader(both) as b:
        assert a.digests() == b.digests()
        assert a.metadata[DEGRADE] == b.metadata[DEGRADE]
        assert len(json.loads(a.metadata[DEGRADE]["json"])["outages"]) == 2


def test_a_run_can_be_degraded(short_run: Path, start_ns: int, tmp_path: Path) -> None:
    """Channels of a stage keep their place behind those that it reads."""
    remove_fixes(short_run, tmp_path / "out.mcap", [outage(start_ns, 40.0, 3.0)])
    with LogReader(short_run) as before, LogReader(tmp_path / "out.mcap") as after:
        assert {t: i.depth for t, i in after.channels.items()} == {
            t: i.depth for t, i in before.channels.items()
        }
        assert after.channels[SOLUTION].depth == 1
        assert after.channels[TRACE].depth == 2
