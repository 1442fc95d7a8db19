"""Taking fixes and observations away: those of the stretch, and nothing else."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from replay import channels
from replay.engine.degrade import DEGRADE, Outage, plan_outages, remove_fixes
from replay.engine.job import make_job
from replay.engine.manifest import read_manifest
from replay.engine.run import replay_log
from replay.errors import UsageError
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.simulate import read_scenario, write_log
from tests.engine.drives import EVENTS, FIX, IMU, SECOND, SOLUTION, TRACE, TRUTH, run_to_file
from tests.simulate import observing


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


# Observations


OBSERVATIONS = channels.GNSS_OBS.at(receiver="rover")
BASE = channels.GNSS_OBS.at(receiver="base")


@pytest.fixture(scope="module")
def observed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a minute at rest: a rover with fixes, a base, GPS and Galileo."""
    path = tmp_path_factory.mktemp("observed") / "in.mcap"
    rover = observing.receiver(signals=["G1C", "G2W", "E1C"])
    table = {
        "start": {"time": observing.START, **observing.HERE},
        "receivers": [rover, observing.base(signals=["G1C"])],
        "segments": [{"kind": "hold", "duration": 30.0}],
        "defaults": {"gnss": {"receiver": "rover", "base": "base"}},
    }
    write_log(read_scenario(table), path)
    return path


def names_between(columns: Columns, outage: Outage) -> set[str]:
    inside = (columns.valid_time_ns >= outage.start_ns) & (columns.valid_time_ns < outage.end_ns)
    return {name.decode() for name in columns["satellite"][inside].tolist()}


def test_a_full_outage_takes_observations_of_the_rover_alone(
    observed: Path, tmp_path: Path
) -> None:
    target = tmp_path / "out.mcap"
    (cut,) = plan_outages(observed, ["10,5"])
    removed = remove_fixes(observed, target, [cut])
    assert set(removed) == {OBSERVATIONS, FIX}
    with LogReader(observed) as before, LogReader(target) as after:
        old, new = before.read(OBSERVATIONS), after.read(OBSERVATIONS)
        inside = (old.valid_time_ns >= cut.start_ns) & (old.valid_time_ns < cut.end_ns)
        assert removed[OBSERVATIONS] == inside.sum() > 0
        assert new.valid_time_ns.tolist() == old.valid_time_ns[~inside].tolist()
        for topic in set(before.channels) - {OBSERVATIONS, FIX}:
            assert after.digests()[topic] == before.digests()[topic]


def test_the_strongest_satellites_stay(observed: Path, tmp_path: Path) -> None:
    """Of a log without elevations: those with the largest C/N0 at the outage's first epoch."""
    target = tmp_path / "out.mcap"
    first, second = plan_outages(observed, ["5,5,keep=3", "20,5,keep=4"])
    remove_fixes(observed, target, [first, second])
    with LogReader(observed) as before, LogReader(target) as after:
        old, new = before.read(OBSERVATIONS), after.read(OBSERVATIONS)
        assert len(after.read(FIX)) < len(before.read(FIX))
        told = json.loads(after.metadata[DEGRADE]["json"])["outages"]
    for cut, count, tell in ((first, 3, told[0]), (second, 4, told[1])):
        kept = names_between(new, cut)
        assert len(kept) == count == len(cut.keep)
        assert kept == set(cut.keep)
        assert tell["keep"] == list(cut.keep)
        now = old.valid_time_ns == old.valid_time_ns[old.valid_time_ns >= cut.start_ns].min()
        strength = {}
        for name, value in zip(old["satellite"][now], old["cn0_dbhz"][now], strict=True):
            strength[name.decode()] = max(value, strength.get(name.decode(), 0.0))
        weakest = min(strength[name] for name in kept)
        assert all(strength[name] <= weakest for name in set(strength) - kept)
        # Nothing of what stays is missing.
        mine = (old.valid_time_ns >= cut.start_ns) & (old.valid_time_ns < cut.end_ns)
        mine &= np.isin(old["satellite"], np.array(cut.keep, dtype="S3"))
        rest = (new.valid_time_ns >= cut.start_ns) & (new.valid_time_ns < cut.end_ns)
        assert rest.sum() == mine.sum()


def test_the_highest_satellites_stay_where_the_log_has_elevations(
    observed: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run.mcap"
    with LogReader(observed) as reader:
        replay_log(reader, run, make_job(reader, "spp", tables=[]))
    (cut,) = plan_outages(run, ["12,3,keep=3"])
    with LogReader(run) as reader:
        rows = reader.read(channels.SATELLITES.at(receiver="rover"))
    now = rows.valid_time_ns == rows.valid_time_ns[rows.valid_time_ns >= cut.start_ns].min()
    order = np.argsort(-rows["elevation_rad"][now])[:3]
    assert [name.decode() for name in rows["satellite"][now][order]] == list(cut.keep)


def test_named_satellites_stay(observed: Path, tmp_path: Path) -> None:
    with LogReader(observed) as reader:
        names = sorted(names_between(reader.read(OBSERVATIONS), Outage(0, 2**62)))
    cuts = plan_outages(observed, [f"5,2,keep={names[0]}+{names[-1]}"], every_s=10.0)
    assert [cut.keep for cut in cuts] == [(names[0], names[-1])] * 3
    remove_fixes(observed, tmp_path / "out.mcap", cuts)
    with LogReader(tmp_path / "out.mcap") as reader:
        rows = reader.read(OBSERVATIONS)
    assert [names_between(rows, cut) for cut in cuts] == [{names[0], names[-1]}] * 3


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("10,5,keep=0", "neither a number"),
        ("10,5,keep=G5", "neither a number"),
        ("10,5,keep=", "neither a number"),
        ("5000,5,keep=3", "no observation to keep"),
        ("10,keep=3", "no outage"),
    ],
)
def test_what_cannot_be_kept(observed: Path, text: str, what: str) -> None:
    with pytest.raises(UsageError, match=what):
        plan_outages(observed, [text])


def test_there_are_no_satellites_in_fixes(short_log: Path) -> None:
    with pytest.raises(UsageError, match="0 channels of observations"):
        plan_outages(short_log, ["10,5,keep=3"])
