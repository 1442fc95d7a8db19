"""A replay that goes on from a checkpoint ends as one that was never interrupted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from replay.engine.manifest import MANIFEST
from replay.engine.run import verify_run
from replay.errors import CorruptLogError, ExitCode, UsageError
from replay.log.reader import LogReader
from replay.log.recover import recover
from replay.log.writer import LogWriter
from replay.simulate import read_scenario, write_log
from tests.engine.drives import (
    CHECKPOINT,
    FULL,
    IMU,
    OUTPUTS,
    SECOND,
    TRUTH,
    rewrite,
    run_to_file,
    short_scenario,
)

TABLES = (FULL, {"gnss": {"latency": 0.1}})
EVERY = 5


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("checkpoints") / "in.mcap"
    write_log(read_scenario(short_scenario(gnss={"latency": 0.1})), path)
    return path


@pytest.fixture(scope="module")
def run(source: Path) -> Path:
    """The run that nothing interrupts."""
    path = source.with_name("run.mcap")
    run_to_file(source, path, *TABLES, checkpoint_every_s=EVERY)
    return path


def digests(path: Path) -> dict[str, str]:
    with LogReader(path) as reader:
        return {topic: digest.sha256 for topic, digest in reader.digests().items()}


def small_chunks(source: Path, target: Path) -> Path:
    """The same rows in chunks of a few seconds, so that a cut leaves some of them."""
    with LogReader(source) as reader, LogWriter(target, chunk_bytes=20_000) as writer:
        for topic, info in reader.channels.items():
            writer.add_raw_channel(
                topic,
                schema_name=info.schema_name,
                schema_encoding=info.schema_encoding,
                schema_data=info.schema_data,
                message_encoding=info.message_encoding,
                depth=info.depth,
            )
        for record in reader.metadata_records:
            if record.name != MANIFEST:
                writer.add_metadata(record.name, record.values)
        for batch in reader.batches(decode=[], payloads=list(reader.channels)):
            writer.write(batch)
    return target


def test_checkpoints_change_no_other_channel(source: Path, run: Path, tmp_path: Path) -> None:
    without = tmp_path / "without.mcap"
    run_to_file(source, without, *TABLES)
    with_them = digests(run)
    saved = with_them.pop(CHECKPOINT)
    assert saved
    assert digests(without) == with_them
    with LogReader(run) as reader:
        times = reader.read(CHECKPOINT).valid_time_ns
        assert np.all(np.diff(times) == EVERY * SECOND)
        assert times[0] == reader.start_ns + EVERY * SECOND
        assert len(times) == (reader.end_ns - reader.start_ns) // (EVERY * SECOND)


@pytest.mark.parametrize("kept", [0.2, 0.5, 0.93, 1.0])
def test_resume_of_a_truncated_run(source: Path, run: Path, tmp_path: Path, kept: float) -> None:
    cut, whole, resumed = (tmp_path / name for name in ("cut.mcap", "whole.mcap", "out.mcap"))
    data = small_chunks(run, whole).read_bytes()
    cut.write_bytes(data[: int(kept * len(data))])
    losses = recover(cut, whole)
    assert bool(losses) == (kept < 1.0)
    with LogReader(whole) as reader:
        rows = reader.read(CHECKPOINT)
        assert 1 <= len(rows) <= len(np.unique(rows.valid_time_ns))
        assert (reader.end_ns < rows.valid_time_ns[0] + 40 * SECOND) == (kept < 0.9)
    run_to_file(source, resumed, *TABLES, checkpoint_every_s=EVERY, resume=whole)
    assert digests(resumed) == digests(run)
    with LogReader(resumed) as reader, LogReader(run) as uninterrupted:
        assert reader.metadata == uninterrupted.metadata
        for topic in OUTPUTS:
            again, first = reader.read(topic), uninterrupted.read(topic)
            assert again.sequence.tobytes() == first.sequence.tobytes(), topic
    assert verify_run(resumed, source).exit_code is ExitCode.OK


@pytest.mark.parametrize("topic", [IMU, TRUTH, *OUTPUTS])
def test_resume_refuses_a_run_with_a_hole(
    source: Path, run: Path, tmp_path: Path, topic: str
) -> None:
    """Recovery leaves out a damaged chunk; later checkpoints must not hide that."""
    start_ns = 0

    def hole(rows):  # type: ignore[no-untyped-def]
        nonlocal start_ns
        start_ns = int(rows[IMU].log_time_ns[0])
        times = rows[topic].log_time_ns - start_ns
        out = (times > 17 * SECOND) & (times < 24 * SECOND)
        if not out.any():
            out = times < 24 * SECOND
        assert out.any()
        return {**rows, topic: rows[topic].take(~out)}

    damaged = rewrite(run, tmp_path / "hole.mcap", hole)
    resumed = tmp_path / "resumed.mcap"
    with pytest.raises(CorruptLogError, match=topic) as caught:
        run_to_file(source, resumed, *TABLES, checkpoint_every_s=EVERY, resume=damaged)
    assert str(damaged) in caught.value.where
    assert not resumed.exists()


def test_resume_with_another_job(source: Path, run: Path, tmp_path: Path) -> None:
    for tables, more in (
        ((), {"checkpoint_every_s": EVERY}),
        (TABLES, {"checkpoint_every_s": EVERY + 1}),
        (TABLES, {"checkpoint_every_s": EVERY, "start_ns": 1}),
    ):
        with pytest.raises(UsageError, match="another job") as caught:
            run_to_file(source, tmp_path / "out.mcap", *tables, resume=run, **more)
        assert str(run) in caught.value.where
        assert not (tmp_path / "out.mcap").exists()


def test_resume_without_checkpoints(source: Path, tmp_path: Path) -> None:
    earlier = tmp_path / "earlier.mcap"
    run_to_file(source, earlier)
    with pytest.raises(UsageError, match="no checkpoint") as caught:
        run_to_file(source, tmp_path / "out.mcap", resume=earlier)
    assert "--checkpoint-every" in caught.value.mend


def test_resume_before_the_first_checkpoint(source: Path, tmp_path: Path) -> None:
    earlier = tmp_path / "earlier.mcap"
    run_to_file(source, earlier, checkpoint_every_s=500)
    with pytest.raises(UsageError, match="before its first checkpoint"):
        run_to_file(source, tmp_path / "out.mcap", checkpoint_every_s=500, resume=earlier)


def test_resume_of_a_log_that_is_no_run(source: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="another job"):
        run_to_file(source, tmp_path / "out.mcap", checkpoint_every_s=EVERY, resume=source)
