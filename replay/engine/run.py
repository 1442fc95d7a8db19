"""Runs of logs: into a log with its manifest, and again to see whether they come out the same."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from replay.engine.job import Job
from replay.engine.manifest import MANIFEST, make_manifest, manifest_metadata, read_manifest
from replay.engine.replayer import Progress, Replayer, Result
from replay.engine.sink import DigestSink, require_another_file
from replay.errors import ExitCode, IncomparableError, UsageError
from replay.log.reader import LogReader
from replay.log.writer import LogWriter

JOB = "replay.job"
_TOML = "toml"


def replay_log(
    reader: LogReader,
    target: Path,
    job: Job,
    *,
    resume: Path | None = None,
    progress: Progress | None = None,
) -> Result:
    """Run a job over a log and write the run's log.

    Parameters
    ----------
    reader : LogReader
        The input.
    target : Path
    job : Job
    resume : Path, optional
        Log of the same job that ended early; recover it first where it is damaged.
    progress : callable, optional
        Told the fraction done.

    Raises
    ------
    UsageError
        Where the earlier run was of another job, or `target` is the input.
    LogError
        Where the input cannot be read.
    """
    require_another_file(reader.path, target)
    replayer = Replayer(reader, job)
    text = job.text()
    with LogWriter(target) as writer:
        # Written first, so that a run that ends early still says what it was.
        writer.add_metadata(JOB, {_TOML: text})
        for name, values in sorted(reader.metadata.items()):
            if name not in (MANIFEST, JOB):
                writer.add_metadata(name, values)
        for attachment in reader.attachments:
            writer.add_attachment(
                attachment.name,
                attachment.data,
                media_type=attachment.media_type,
                log_time_ns=attachment.log_time_ns,
                create_time_ns=attachment.create_time_ns,
            )
        if resume is None:
            result = replayer.run(writer, progress=progress)
        else:
            with LogReader(resume) as earlier:
                found = earlier.metadata.get(JOB, {}).get(_TOML)
                if found != text:
                    raise UsageError(
                        "the earlier run was of another job",
                        where=str(resume),
                        mend="resume with the same pipeline, settings, range and checkpoints",
                    )
                result = replayer.run(writer, resume=earlier, progress=progress)
        manifest = make_manifest(
            command="run",
            configuration=text,
            pipeline=job.pipeline,
            stages=replayer.stage_records(),
            inputs=result.inputs,
            outputs=result.outputs,
            notes=result.notes,
        )
        writer.add_metadata(MANIFEST, manifest_metadata(manifest))
    return result


@dataclasses.dataclass(frozen=True, slots=True)
class ChannelVerdict:
    """One output channel, recorded against run again.

    Attributes
    ----------
    topic : str
    recorded, found : str
        Digests; empty where the channel is not there.
    """

    topic: str
    recorded: str
    found: str

    @property
    def equal(self) -> bool:
        """Whether both runs gave the same bytes."""
        return self.recorded == self.found


@dataclasses.dataclass(frozen=True, slots=True)
class Verification:
    """Every output channel of a run against the same run done again."""

    channels: tuple[ChannelVerdict, ...]

    @property
    def exit_code(self) -> ExitCode:
        """0 where all are equal, else 1."""
        return ExitCode.OK if all(c.equal for c in self.channels) else ExitCode.FAILURE


def verify_run(run: Path, source: Path, *, progress: Progress | None = None) -> Verification:
    """Do a recorded run again over its input and compare every output channel's digest.

    What the file `run` itself holds is compared too, so that a changed row is seen
    even where its chunk's checksum was mended.

    Raises
    ------
    IncomparableError
        Where the run has no manifest or the input is not the one it was made from.
    """
    with LogReader(run) as recorded, LogReader(source) as reader:
        manifest = read_manifest(recorded.metadata, str(run))
        if manifest.command != "run":
            raise IncomparableError(
                f"the log was made by {manifest.command!r}, not by a run", where=str(run)
            )
        job = Job.from_text(manifest.configuration)
        held = recorded.digests()
        replayer = Replayer(reader, job)
        result = replayer.run(DigestSink(), progress=progress)
    for digest in manifest.inputs:
        found = result.inputs.get(digest.topic)
        if found is None or found.sha256 != digest.sha256:
            raise IncomparableError(
                f"{digest.topic} is not what the run was made from",
                where=f"{source}: {found.sha256 if found else 'no such channel'}; "
                f"manifest of {run}: {digest.sha256}",
                mend="verify against the input of this very run",
            )
    verdicts = []
    for digest in manifest.outputs:
        again = result.outputs.get(digest.topic)
        stored = held.get(digest.topic)
        kept = stored is not None and stored.sha256 == digest.sha256
        verdicts.append(
            ChannelVerdict(
                digest.topic,
                digest.sha256 if kept else (stored.sha256 if stored else ""),
                again.sha256 if again else "",
            )
        )
    return Verification(tuple(verdicts))
