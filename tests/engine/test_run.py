"""A run: what it says of itself, what it leaves alone, what verification finds."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.engine.job import Job
from replay.engine.manifest import DEFAULTS, MANIFEST, package_version, read_manifest
from replay.engine.pipelines import find_pipeline
from replay.engine.replayer import Replayer
from replay.engine.run import verify_run
from replay.errors import ExitCode, IncomparableError, MissingChannelError, UsageError
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.log.writer import LogWriter
from replay.simulate import read_scenario, simulate, write_log
from replay.stages.loose_config import Filter, LooseConfig
from tests.engine.drives import (
    CHECKPOINT,
    FIX,
    IMU,
    OUTPUTS,
    PIPELINE,
    SECOND,
    SOLUTION,
    STATE,
    TOWN,
    TRACE,
    TRUTH,
    changed,
    job_of,
    rewrite,
    run_digests,
    run_to_file,
    short_scenario,
)


def digests(path: Path) -> dict[str, str]:
    with LogReader(path) as reader:
        return {topic: digest.sha256 for topic, digest in reader.digests().items()}


def test_recorded_channels_pass_through(short_log: Path, short_run: Path) -> None:
    before, after = digests(short_log), digests(short_run)
    assert sorted(before) == sorted([IMU, FIX, TRUTH])
    assert {topic: after[topic] for topic in before} == before
    assert sorted(after) == sorted([*before, *OUTPUTS])


def test_manifest_is_the_files_own_content(short_log: Path, short_run: Path) -> None:
    with LogReader(short_run) as run, LogReader(short_log) as source:
        manifest = read_manifest(run.metadata, "run")
        held, given_ = run.digests(), source.digests()
        assert {d.topic: (d.schema, d.message_count, d.sha256) for d in manifest.inputs} == {
            t: (d.schema, d.message_count, d.sha256) for t, d in given_.items()
        }
        assert {d.topic: (d.schema, d.message_count, d.sha256) for d in manifest.outputs} == {
            t: (held[t].schema, held[t].message_count, held[t].sha256) for t in OUTPUTS
        }
        job = job_of(source)
    assert manifest.command == "run"
    assert manifest.pipeline == PIPELINE
    assert manifest.package_version == package_version()
    assert manifest.configuration == job.text()
    assert Job.from_text(manifest.configuration) == job
    (stage,) = manifest.stages
    assert (stage.name, sorted(stage.inputs)) == (PIPELINE, [FIX, IMU])
    assert sorted([*stage.outputs, TRACE]) == OUTPUTS


def test_defaults_of_the_log_lie_under_what_is_set(short_log: Path) -> None:
    with LogReader(short_log) as reader:
        own = tomllib.loads(reader.metadata[DEFAULTS]["toml"])
        plain = job_of(reader).config
        over = job_of(reader, {"filter": {"gyro_bias_tau": 7.0}}).config
    assert isinstance(plain, LooseConfig)
    assert isinstance(over, LooseConfig)
    assert list(plain.filter.gyro_noise) == own["filter"]["gyro_noise"]
    assert plain.filter.gyro_noise != Filter().gyro_noise
    assert over.filter.gyro_bias_tau == 7.0 != plain.filter.gyro_bias_tau
    assert over.filter.gyro_noise == plain.filter.gyro_noise


@given(
    name=st.text(st.characters(codec="utf-8", exclude_categories=("Cs",)), min_size=1),
    noise=st.floats(0.0, 1.0),
    start=st.none() | st.integers(0, 2**62),
    end=st.none() | st.integers(0, 2**62),
    every=st.integers(0, 10**6),
)
def test_the_text_of_a_job_gives_the_job(
    name: str, noise: float, start: int | None, end: int | None, every: int
) -> None:
    config = LooseConfig(name=name, filter=Filter(gyro_noise=(noise, 2.0 * noise, noise)))
    job = Job(PIPELINE, config, start, end, every)
    assert Job.from_text(job.text()) == job
    assert Job.from_text(job.text()).text() == job.text()


def test_equal_runs_have_equal_bytes(short_log: Path, short_run: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.mcap"
    run_to_file(short_log, again)
    assert again.read_bytes() == short_run.read_bytes()


@pytest.mark.parametrize("window", [(None, 30), (20, None), (20, 40), (20, 20.02), (0, 0)])
def test_windows_select_by_log_time(
    short_log: Path, tmp_path: Path, window: tuple[float | None, float | None]
) -> None:
    target = tmp_path / "window.mcap"
    with LogReader(short_log) as reader:
        first, last = reader.start_ns, reader.end_ns
        all_rows = {topic: reader.read(topic).log_time_ns for topic in reader.channels}
    start, end = (None if t is None else first + round(t * SECOND) for t in window)
    result = run_to_file(short_log, target, {"imu": {"interval": 0.02}}, start_ns=start, end_ns=end)
    low, high = start or first, end or last + 1
    with LogReader(target) as reader:
        for topic, times in all_rows.items():
            wanted = times[(times >= low) & (times < high)]
            assert np.array_equal(reader.read(topic).log_time_ns, wanted), topic
        for topic in OUTPUTS:
            times = reader.read(topic).log_time_ns
            assert np.all((times >= low) & (times < high)), topic
    if result.first_ns >= 0:
        assert low <= result.first_ns <= result.last_ns < high
    assert verify_run(target, short_log).exit_code is ExitCode.OK


def test_a_run_can_be_run_over(short_run: Path, tmp_path: Path) -> None:
    """What an earlier run made is a recorded channel of the next, but for its trace."""
    second = tmp_path / "second.mcap"
    run_to_file(short_run, second, {"name": "again"})
    with LogReader(short_run) as before, LogReader(second) as after:
        old, new = before.digests(), after.digests()
        for topic in old.keys() - {TRACE}:
            assert new[topic] == old[topic], topic
            assert after.channels[topic].depth == before.channels[topic].depth, topic
        assert after.channels[SOLUTION].depth == 1
        assert after.channels["/solution/again"].depth == 1
        # The same rows, whatever the run is called.
        assert new["/solution/again"].sha256 == old[SOLUTION].sha256
        assert new[TRACE] == old[TRACE]
        assert after.metadata[DEFAULTS] == before.metadata[DEFAULTS]
    assert verify_run(second, short_run).exit_code is ExitCode.OK


def test_name_of_a_run_that_is_there(short_run: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="in the log already") as caught:
        run_to_file(short_run, tmp_path / "second.mcap")
    assert "--set name=" in caught.value.mend


@pytest.mark.parametrize("name", ["", "a/b", "/"])
def test_name_that_makes_no_topic(short_log: Path, name: str) -> None:
    with pytest.raises(UsageError, match="named"):
        run_digests(short_log, {"name": name})


def test_missing_channel_is_named(short_log: Path, tmp_path: Path) -> None:
    for topic, pattern in ((IMU, "/imu/raw"), (FIX, "/gnss/{receiver}/fix")):
        poor = rewrite(
            short_log,
            tmp_path / "poor.mcap",
            lambda rows, topic=topic: {t: c for t, c in rows.items() if t != topic},
        )
        with pytest.raises(MissingChannelError) as caught:
            run_digests(poor)
        assert pattern in caught.value.what
        assert TRUTH in caught.value.where
        assert caught.value.mend


@pytest.fixture(scope="module")
def two_receivers(short_log: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    def doubled(rows: dict[str, Columns]) -> dict[str, Columns]:
        moved = changed(rows[FIX], "position_ecef_m", 0, rows[FIX]["position_ecef_m"][1])
        return {**rows, "/gnss/other/fix": moved}

    return rewrite(short_log, tmp_path_factory.mktemp("two") / "two.mcap", doubled)


def test_two_receivers_need_a_choice(two_receivers: Path, short_log: Path) -> None:
    with pytest.raises(UsageError, match="/gnss/other/fix") as caught:
        run_digests(two_receivers)
    assert "--set gnss.receiver=" in caught.value.mend
    chosen = run_digests(two_receivers, {"gnss": {"receiver": "rover"}})
    assert chosen == run_digests(short_log)
    with pytest.raises(MissingChannelError, match="gnss"):
        run_digests(two_receivers, {"gnss": {"receiver": "base"}})


def test_unknown_pipeline_and_key(short_log: Path) -> None:
    with pytest.raises(UsageError, match="gnss-ins-ld") as caught:
        find_pipeline("gnss-ins-ld")
    assert "did you mean gnss-ins-lc?" in caught.value.mend
    with LogReader(short_log) as reader, pytest.raises(UsageError) as caught:
        job_of(reader, {"filter": {"gyro_noize": 1.0}})
    assert "filter.gyro_noize" in caught.value.what
    assert "filter.gyro_noise" in caught.value.mend


def test_a_failed_run_leaves_no_file(short_log: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        run_to_file(short_log, tmp_path / "out.mcap", {"filter": {"states": 16}})
    assert list(tmp_path.iterdir()) == []


def test_progress_goes_from_start_to_end(short_log: Path) -> None:
    from replay.engine.sink import DigestSink

    told: list[float] = []
    with LogReader(short_log) as reader:
        Replayer(reader, job_of(reader, checkpoint_every_s=5)).run(
            DigestSink(), progress=told.append
        )
    assert told == sorted(told)
    assert told[0] >= 0.0
    assert told[-1] == 1.0


def test_verify_of_an_untouched_run(short_log: Path, short_run: Path) -> None:
    verification = verify_run(short_run, short_log)
    assert verification.exit_code is ExitCode.OK
    assert sorted(c.topic for c in verification.channels) == OUTPUTS
    assert all(c.equal and len(c.found) == 64 for c in verification.channels)


def test_verify_of_a_run_with_checkpoints(short_log: Path, tmp_path: Path) -> None:
    run_to_file(short_log, tmp_path / "run.mcap", checkpoint_every_s=7)
    verification = verify_run(tmp_path / "run.mcap", short_log)
    assert verification.exit_code is ExitCode.OK
    assert CHECKPOINT in {c.topic for c in verification.channels}


@pytest.mark.parametrize("topic", [SOLUTION, STATE])
def test_verify_names_a_changed_channel(
    short_log: Path, short_run: Path, tmp_path: Path, topic: str
) -> None:
    """One value off by its last bit, the checksums being right."""

    def last_bit(rows: dict[str, Columns]) -> dict[str, Columns]:
        at = len(rows[topic]) // 2
        value = np.nextafter(rows[topic]["position_ecef_m"][at], 0.0)
        return {**rows, topic: changed(rows[topic], "position_ecef_m", at, value)}

    forged = rewrite(short_run, tmp_path / "forged.mcap", last_bit)
    verification = verify_run(forged, short_log)
    assert verification.exit_code is ExitCode.FAILURE
    assert [c.topic for c in verification.channels if not c.equal] == [topic]


def test_verify_names_a_channel_that_is_gone(
    short_log: Path, short_run: Path, tmp_path: Path
) -> None:
    poor = rewrite(
        short_run,
        tmp_path / "poor.mcap",
        lambda rows: {t: c for t, c in rows.items() if t != SOLUTION},
    )
    verification = verify_run(poor, short_log)
    assert verification.exit_code is ExitCode.FAILURE
    assert [c.topic for c in verification.channels if not c.equal] == [SOLUTION]


@pytest.mark.parametrize("topic", [IMU, FIX, TRUTH])
def test_verify_against_another_input(
    short_log: Path, short_run: Path, tmp_path: Path, topic: str
) -> None:
    other = rewrite(
        short_log,
        tmp_path / "other.mcap",
        lambda rows: {**rows, topic: rows[topic].take(slice(1, None))},
    )
    with pytest.raises(IncomparableError, match=topic) as caught:
        verify_run(short_run, other)
    assert caught.value.exit_code is ExitCode.LOSS
    assert str(other) in caught.value.where


def test_verify_needs_the_manifest_of_a_run(
    short_log: Path, short_run: Path, tmp_path: Path
) -> None:
    bare = rewrite(short_run, tmp_path / "bare.mcap", lambda rows: rows, metadata=False)
    with pytest.raises(IncomparableError, match="no manifest"):
        verify_run(bare, short_log)
    with pytest.raises(IncomparableError, match="simulate"):
        verify_run(short_log, short_log)
    with LogWriter(tmp_path / "broken.mcap") as writer:
        writer.add_metadata(MANIFEST, {"json": "{"})
    with pytest.raises(IncomparableError, match="cannot be read"):
        verify_run(tmp_path / "broken.mcap", short_log)


def test_an_empty_log_says_what_it_lacks(tmp_path: Path) -> None:
    with LogWriter(tmp_path / "empty.mcap"):
        pass
    with pytest.raises(MissingChannelError, match="imu"):
        run_digests(tmp_path / "empty.mcap")


def test_a_drive_without_velocity_runs(tmp_path: Path) -> None:
    """The course then comes from positions."""
    write_log(read_scenario(short_scenario(gnss={"velocity": False})), tmp_path / "in.mcap")
    run_to_file(tmp_path / "in.mcap", tmp_path / "run.mcap")
    with LogReader(tmp_path / "run.mcap") as reader:
        solution, truth = reader.read(SOLUTION), reader.read(TRUTH)
    _, mine, theirs = np.intersect1d(
        solution.valid_time_ns, truth.valid_time_ns, return_indices=True
    )
    assert len(mine) > 100
    error = solution["position_ecef_m"][mine[-20:]] - truth["position_ecef_m"][theirs[-20:]]
    assert np.abs(error).max() < 0.15


def test_the_town_drive_stays_on_the_road(tmp_path: Path) -> None:
    """The recording that users see first, against its truth."""
    simulate(TOWN, tmp_path / "in.mcap")
    run_to_file(tmp_path / "in.mcap", tmp_path / "run.mcap")
    with LogReader(tmp_path / "run.mcap") as reader:
        solution, truth = reader.read(SOLUTION), reader.read(TRUTH)
    _, mine, theirs = np.intersect1d(
        solution.valid_time_ns, truth.valid_time_ns, return_indices=True
    )
    error = solution["position_ecef_m"][mine] - truth["position_ecef_m"][theirs]
    distance = np.linalg.norm(error, axis=1)
    elapsed = (solution.valid_time_ns[mine] - truth.valid_time_ns[0]) / SECOND
    outage = (elapsed > 168.0) & (elapsed < 183.5)
    assert distance[~outage & (elapsed > 30.0)].max() < 0.15
    assert distance[outage].max() < 3.0
