"""Logs changed on purpose: what was asked for, said in the manifest, and nothing else."""

from __future__ import annotations

import dataclasses
import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from replay import channels, configuration
from replay.engine.job import make_job
from replay.engine.manifest import DEFAULTS, read_manifest
from replay.engine.run import replay_log
from replay.engine.transforms import TRANSFORM, Transform, Transformed, transform_log
from replay.errors import ExitCode, MissingChannelError, ReplayError, UsageError
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.log.writer import LogWriter
from replay.simulate import read_scenario, write_log
from tests.engine.drives import (
    EVENTS,
    FIX,
    IMU,
    PIPELINE,
    SECOND,
    SOLUTION,
    TRUTH,
    rewrite,
    run_to_file,
    shifted,
)
from tests.simulate import observing

ROVER = channels.GNSS_OBS.at(receiver="rover")
BASE = channels.GNSS_OBS.at(receiver="base")
FIELDS = ("angular_rate_body_rad_s", "specific_force_body_m_s2")


@pytest.fixture(scope="module")
def observed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a minute at rest: a rover with fixes, a base, GPS and Galileo."""
    path = tmp_path_factory.mktemp("observed") / "in.mcap"
    table = {
        "start": {"time": observing.START, **observing.HERE},
        "receivers": [
            observing.receiver(signals=["G1C", "G2W", "E1C"]),
            observing.base(signals=["G1C"]),
        ],
        "segments": [{"kind": "hold", "duration": 30.0}],
        "defaults": {"gnss": {"receiver": "rover", "base": "base"}},
    }
    write_log(read_scenario(table), path)
    return path


def transformed(source: Path, target: Path, **words: Any) -> Transformed:
    return transform_log(source, target, configuration.build(Transform, [words]))


def read(path: Path, topic: str) -> Columns:
    with LogReader(path) as reader:
        return reader.read(topic, payloads=True)


def digests(path: Path) -> dict[str, str]:
    with LogReader(path) as reader:
        return {topic: digest.sha256 for topic, digest in reader.digests().items()}


def labels(rows: Columns) -> set[str]:
    pairs = zip(rows["satellite"].tolist(), rows["signal"].tolist(), strict=True)
    return {(satellite + b" " + signal).decode() for satellite, signal in pairs}


# Rate of inertial samples


@pytest.mark.parametrize("method", ["integrate", "decimate"])
def test_fewer_inertial_samples(short_log: Path, tmp_path: Path, method: str) -> None:
    target = tmp_path / "out.mcap"
    transformed(short_log, target, imu_rate=10.0, imu_method=method)
    old, new = read(short_log, IMU), read(target, IMU)
    count = -(-(len(old) - 1) // 5)
    assert new.valid_time_ns[:-1].tolist() == old.valid_time_ns[::5][:count].tolist()
    assert new.valid_time_ns[-1] == old.valid_time_ns[-1]
    assert new.sequence.tolist() == list(range(count + 1))
    before, after = digests(short_log), digests(target)
    assert {t for t in before if before[t] != after[t]} == {IMU}
    for field in FIELDS:
        assert new[field][0].tolist() == old[field][0].tolist()
    if method == "decimate":
        assert new["angular_rate_body_rad_s"][1].tolist() == old[FIELDS[0]][5].tolist()
    else:
        # At rest, nothing cones but noise: the mean is the mean.
        mean = old[FIELDS[0]][1:6].mean(axis=0)
        np.testing.assert_allclose(new[FIELDS[0]][1], mean, atol=1e-7)


def test_a_run_takes_the_new_rate(short_log: Path, tmp_path: Path) -> None:
    transformed(short_log, tmp_path / "out.mcap", imu_rate=25.0)
    run_to_file(tmp_path / "out.mcap", tmp_path / "run.mcap")
    texts = read(tmp_path / "run.mcap", EVENTS).ragged("detail").texts()
    assert any("complete" in text or "heading" in text for text in texts)
    assert not any("inertial samples" in text for text in texts)


def test_the_rate_that_it_has(short_log: Path, tmp_path: Path) -> None:
    transformed(short_log, tmp_path / "out.mcap", imu_rate=50.0)
    assert digests(tmp_path / "out.mcap") == digests(short_log)


def test_defaults_lose_the_interval(short_log: Path, tmp_path: Path) -> None:
    source, target = tmp_path / "in.mcap", tmp_path / "out.mcap"
    rewrite(short_log, source, dict, metadata=False)
    with LogReader(source) as reader:
        rows = {topic: reader.read(topic, payloads=True) for topic in reader.channels}
    with LogWriter(source) as writer:
        for topic in rows:
            spec = channels.find(topic)
            assert spec is not None
            writer.add_channel(topic, spec.message)
        text = "[stops]\ninterval = 0.25\n\n[imu]\ngap = 0.5\ninterval = 0.02\n"
        writer.add_metadata(DEFAULTS, {"toml": text})
        writer.write(rows)
    transformed(source, target, imu_rate=10.0)
    with LogReader(target) as reader:
        told = tomllib.loads(reader.metadata[DEFAULTS]["toml"])
    assert told == {"stops": {"interval": 0.25}, "imu": {"gap": 0.5}}


@pytest.mark.parametrize("rate", [30.0, 49.0, 51.0, 200.0])
def test_a_rate_that_does_not_divide(short_log: Path, tmp_path: Path, rate: float) -> None:
    with pytest.raises(UsageError, match="50 Hz cannot become") as caught:
        transformed(short_log, tmp_path / "out.mcap", imu_rate=rate)
    assert "25" in caught.value.mend
    assert list(tmp_path.iterdir()) == []


def test_samples_that_are_lost_are_counted(short_log: Path, tmp_path: Path) -> None:
    source = tmp_path / "in.mcap"

    def edit(rows: dict[str, Columns]) -> dict[str, Columns]:
        return {**rows, IMU: shifted(rows[IMU], 100, valid_ns=-SECOND)}

    rewrite(short_log, source, edit)
    done = transformed(source, tmp_path / "out.mcap", imu_rate=10.0)
    assert done.losses.exit_code is ExitCode.LOSS
    assert [loss.count for loss in done.losses.losses] == [1]


def test_an_imu_that_ends_early_holds_nothing_up(short_log: Path, tmp_path: Path) -> None:
    """Rows leave in order although an interval was still open when the samples ended."""
    source, target = tmp_path / "in.mcap", tmp_path / "out.mcap"

    def edit(rows: dict[str, Columns]) -> dict[str, Columns]:
        return {**rows, IMU: rows[IMU].take(slice(0, 503))}

    rewrite(short_log, source, edit)
    transformed(source, target, imu_rate=10.0)
    old, new = read(source, IMU), read(target, IMU)
    assert new.valid_time_ns[-2:].tolist() == old.valid_time_ns[[500, 502]].tolist()
    assert digests(source)[TRUTH] == digests(target)[TRUTH]


# Satellites and signals


def test_names_are_taken_out_of_every_receiver(observed: Path, tmp_path: Path) -> None:
    old = read(observed, ROVER)
    gps = sorted(name for name in labels(old) if name.startswith("G"))[0].split()[0]
    target = tmp_path / "out.mcap"
    done = transformed(
        observed, target, remove_systems=["E"], remove_satellites=[gps], remove_signals=["G2W"]
    )
    expected = {
        name
        for name in labels(old)
        if not (name.startswith(("E", gps)) or (name[0] == "G" and name.endswith("2W")))
    }
    assert labels(read(target, ROVER)) == expected
    assert not any(name.startswith(gps) for name in labels(read(target, BASE)))
    assert done.removed[ROVER] == len(old) - len(read(target, ROVER))
    assert done.removed[BASE] > 0
    before, after = digests(observed), digests(target)
    assert {t for t in before if before[t] != after[t]} == {ROVER, BASE}


@pytest.mark.parametrize(
    ("words", "what"),
    [
        ({"remove_systems": ["R"]}, "no observation of R"),
        ({"remove_satellites": ["G99"]}, "no observation of G99"),
        ({"remove_signals": ["G5Q"]}, "no observation of G5Q"),
        ({"remove_satellites": ["G5"]}, "'G5' is no satellite"),
        ({"remove_systems": ["GPS"]}, "'GPS' is no system"),
        ({"remove_signals": ["2W"]}, "'2W' is no signal"),
        ({"noise": ["/imu/raw=1"]}, "is no noise|no noise can be"),
        ({"noise": ["/imu/raw.temperature=1"]}, "no noise for temperature"),
        ({"noise": ["/truth.position=1"]}, "no noise can be added to /truth"),
        ({"noise": ["/imu/raw.angular_rate=1 m"]}, "no quantity in rad/s"),
        ({"noise": ["/imu/raw.angular_rate=-1"]}, "0 or more"),
        ({"noise": ["/imu/raw.angular_rate=1", "/imu/raw.angular_rate=2"]}, "told twice"),
        ({"time_offset": ["/imu/raw"]}, "no time offset"),
        ({"time_offset": ["/imu/raw=1", "/imu/raw=2"]}, "told twice"),
        ({"imu_rate": 10.0, "imu_method": "mean"}, "no method 'mean'"),
        ({"imu_rate": -10.0}, "imu_rate is -10"),
        ({}, "does nothing"),
        ({"outage": ["10,5,keep=low:0"]}, "neither a number"),
    ],
)
def test_what_cannot_be_done(
    observed: Path, tmp_path: Path, words: dict[str, Any], what: str
) -> None:
    with pytest.raises(UsageError, match=what):
        transformed(observed, tmp_path / "out.mcap", **words)
    assert list(tmp_path.iterdir()) == []


def test_channels_that_are_not_there(short_log: Path, tmp_path: Path) -> None:
    for words in (
        {"noise": ["/gnss/rover/obs.doppler=1"]},
        {"time_offset": ["/imu/raww=1"]},
    ):
        with pytest.raises(MissingChannelError):
            transformed(short_log, tmp_path / "out.mcap", **words)
    with pytest.raises(UsageError, match="no observations"):
        transformed(short_log, tmp_path / "out.mcap", remove_systems=["G"])


# Outages


def test_the_lowest_satellites_stay(observed: Path, tmp_path: Path) -> None:
    """Of a log without elevations: the weakest, among those that a removal leaves."""
    old = read(observed, ROVER)
    with LogReader(observed) as reader:
        begin = reader.start_ns + 10 * SECOND
    now = old.take(old.valid_time_ns == old.valid_time_ns[old.valid_time_ns >= begin].min())
    strength: dict[str, float] = {}
    for name, value in zip(now["satellite"].tolist(), now["cn0_dbhz"].tolist(), strict=True):
        strength[name.decode()] = max(value, strength.get(name.decode(), 0.0))
    weakest = sorted(strength, key=lambda name: (strength[name], name))
    target = tmp_path / "out.mcap"
    transformed(observed, target, outage=["10,5,keep=low:3"], remove_satellites=[weakest[0]])
    new = read(target, ROVER)
    inside = new.take((new.valid_time_ns >= begin) & (new.valid_time_ns < begin + 5 * SECOND))
    assert {name.decode() for name in inside["satellite"].tolist()} == set(weakest[1:4])


def test_the_lowest_satellites_stay_where_the_log_has_elevations(
    observed: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run.mcap"
    with LogReader(observed) as reader:
        replay_log(reader, run, make_job(reader, "spp", tables=[]))
    sights = read(run, channels.SATELLITES.at(receiver="rover"))
    target = tmp_path / "out.mcap"
    transformed(run, target, outage=["12,3,keep=low:2"])
    new = read(target, ROVER)
    with LogReader(run) as reader:
        begin = reader.start_ns + 12 * SECOND
    inside = new.take((new.valid_time_ns >= begin) & (new.valid_time_ns < begin + 3 * SECOND))
    now = sights.valid_time_ns == sights.valid_time_ns[sights.valid_time_ns >= begin].min()
    lowest = np.argsort(sights["elevation_rad"][now])[:2]
    assert set(inside["satellite"].tolist()) == set(sights["satellite"][now][lowest].tolist())


# Noise


def test_noise_has_its_deviation_and_is_no_other_noise(short_log: Path, tmp_path: Path) -> None:
    one, again, other, twice = (tmp_path / f"{n}.mcap" for n in ("one", "again", "other", "twice"))
    words: dict[str, Any] = {
        "noise": ["/imu/raw.angular_rate=2 deg/s", "/imu/raw.specific_force=0.3 m/s^2"]
    }
    transformed(short_log, one, **words)
    transformed(short_log, again, **words)
    transformed(short_log, other, seed=1, **words)
    transformed(one, twice, **words)
    assert one.read_bytes() == again.read_bytes()
    old = read(short_log, IMU)
    added = {}
    for path in (one, other, twice):
        new = read(path, IMU)
        assert new.valid_time_ns.tolist() == old.valid_time_ns.tolist()
        added[path] = np.hstack([new[field] - old[field] for field in FIELDS])
    size = np.repeat([np.radians(2.0), 0.3], 3)
    first, second = added[one] / size, (added[twice] - added[one]) / size
    slack = 5 / np.sqrt(2 * len(old))  # five deviations of an estimated deviation
    for values in (first, second, added[other] / size):
        assert np.abs(values.std(axis=0) - 1).max() < slack
        assert np.abs(values.mean(axis=0)).max() < 5 / np.sqrt(len(old))
    # Six components, two seeds and two steps: nothing repeats.
    everything = np.corrcoef(np.hstack([first, second, added[other] / size]).T)
    assert np.abs(everything - np.eye(18)).max() < 6 / np.sqrt(len(old))


def test_noise_on_observations(observed: Path, tmp_path: Path) -> None:
    target = tmp_path / "out.mcap"
    transformed(
        observed,
        target,
        noise=[
            f"{ROVER}.pseudorange=2 m",
            f"{ROVER}.carrier_phase=0.01 cycle",
            f"{ROVER}.doppler=0.5",
        ],
    )
    old, new = read(observed, ROVER), read(target, ROVER)
    for field, size in (
        ("pseudorange_m", 2.0),
        ("carrier_phase_cycles", 0.01),
        ("doppler_hz", 0.5),
    ):
        there = old.is_present(field)
        assert new.is_present(field).tolist() == there.tolist()
        added = (new[field] - old[field])[there]
        assert added.std() == pytest.approx(size, rel=5 / np.sqrt(2 * len(added)))
    assert new["cn0_dbhz"].tolist() == old["cn0_dbhz"].tolist()
    assert digests(target)[BASE] == digests(observed)[BASE]


# Time offsets


@pytest.mark.parametrize("offset_s", [0.123456789, -3.5])
def test_a_channel_moves(short_log: Path, tmp_path: Path, offset_s: float) -> None:
    target = tmp_path / "out.mcap"
    transformed(short_log, target, time_offset=[f"{FIX}={offset_s}"])
    old, new = read(short_log, FIX), read(target, FIX)
    assert set(new.valid_time_ns - old.valid_time_ns) == {round(offset_s * 1e9)}
    assert set(new.log_time_ns - old.log_time_ns) == {round(offset_s * 1e9)}
    assert old.payloads is not None and new.payloads is not None
    assert old.payloads.blobs() == new.payloads.blobs()
    before, after = digests(short_log), digests(target)
    assert {t for t in before if before[t] != after[t]} == {FIX}
    back = tmp_path / "back.mcap"
    transformed(target, back, time_offset=[f"{FIX}={-offset_s}"])
    assert digests(back) == before


# All of it


ALL: dict[str, Any] = {
    "remove_satellites": ["E"],
    "outage": ["8,4,keep=3"],
    "imu_rate": "20 Hz",
    "noise": [f"{ROVER}.pseudorange=1", "/imu/raw.angular_rate=0.1 deg/s"],
    "seed": 7,
    "time_offset": ["/imu/raw=5 ms"],
}


def all_words(observed: Path) -> dict[str, Any]:
    names = sorted(name for name in labels(read(observed, ROVER)) if name.startswith("E"))
    return {**ALL, "remove_satellites": [names[0].split()[0]]}


def test_one_after_the_other_is_all_at_once(observed: Path, tmp_path: Path) -> None:
    """In the stated order; the noise of a later step is another one, so it is left out here."""
    words = {k: v for k, v in all_words(observed).items() if k not in ("noise", "seed")}
    transformed(observed, tmp_path / "whole.mcap", **words)
    source = observed
    for number, (name, value) in enumerate(words.items()):
        target = tmp_path / f"{number}.mcap"
        transformed(source, target, **{name: value})
        source = target
    assert digests(source) == digests(tmp_path / "whole.mcap")
    with LogReader(source) as reader:
        told = json.loads(reader.metadata[TRANSFORM]["json"])["transforms"]
    # Outages have a record of their own.
    assert len(told) == len(words) - 1


def test_the_manifest_does_it_again(observed: Path, tmp_path: Path) -> None:
    target, again = tmp_path / "out.mcap", tmp_path / "again.mcap"
    transformed(observed, target, **all_words(observed))
    with LogReader(observed) as before, LogReader(target) as after:
        manifest = read_manifest(after.metadata, "out")
        assert manifest.command == "transform"
        assert {d.topic: d.sha256 for d in manifest.inputs} == digests(observed)
        assert {d.topic: d.sha256 for d in manifest.outputs} == digests(target)
        assert before.metadata[DEFAULTS] == after.metadata[DEFAULTS]
        assert len(manifest.notes) > 5
    table = tomllib.loads(manifest.configuration)
    assert "keep=low" not in table["outage"][0] and table["outage"][0].count("+") == 2
    transformed(observed, again, **table)
    assert again.read_bytes() == target.read_bytes()


def test_batches_change_nothing(
    observed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    transformed(observed, tmp_path / "whole.mcap", **all_words(observed))
    batches = LogReader.batches

    def small(self: LogReader, *args: Any, **words: Any) -> Any:
        return batches(self, *args, **{**words, "target_rows": 37})

    monkeypatch.setattr(LogReader, "batches", small)
    transformed(observed, tmp_path / "small.mcap", **all_words(observed))
    assert digests(tmp_path / "small.mcap") == digests(tmp_path / "whole.mcap")


def test_results_of_runs_do_not_stay(short_run: Path, tmp_path: Path) -> None:
    target = tmp_path / "out.mcap"
    done = transformed(short_run, target, imu_rate=25.0)
    with LogReader(short_run) as before, LogReader(target) as after:
        assert set(after.channels) == {IMU, FIX, TRUTH}
        assert "replay.job" not in after.metadata
        dropped = set(before.channels) - set(after.channels)
        count = before.channels[SOLUTION].message_count
    assert f"{count} rows of {SOLUTION} dropped: results of a run" in done.notes
    assert sum("dropped" in note for note in done.notes) == len(dropped)
    with pytest.raises(UsageError, match="is a result of a run"):
        transformed(short_run, target, time_offset=[f"/solution/{PIPELINE}=1"])


def test_attachments_are_carried_over(short_log: Path, tmp_path: Path) -> None:
    source, target = tmp_path / "in.mcap", tmp_path / "out.mcap"
    with LogReader(short_log) as reader, LogWriter(source) as writer:
        rows = reader.read(IMU, payloads=True)
        writer.add_channel(IMU, "replay.ImuSample")
        writer.add_attachment("note.txt", b"hello", media_type="text/plain", log_time_ns=5)
        writer.add_metadata("mine", {"a": "b"})
        writer.write({IMU: dataclasses.replace(rows, values={}, present={})})
    transformed(source, target, imu_rate=10.0)
    with LogReader(target) as reader:
        (kept,) = reader.attachments
        assert (kept.name, kept.data, kept.log_time_ns) == ("note.txt", b"hello", 5)
        assert reader.metadata["mine"] == {"a": "b"}


def test_a_log_is_not_written_onto_itself(short_log: Path) -> None:
    with pytest.raises(ReplayError, match="its own input"):
        transformed(short_log, short_log, imu_rate=10.0)
