"""Runs over recordings against what they gave before: check, and update with a reason."""

from __future__ import annotations

import enum
import hashlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import msgspec

from replay.batch.baseline_file import (
    Baseline,
    Case,
    Digest,
    Entry,
    Recorded,
    save_baseline,
    sealed,
)
from replay.batch.figures import Figures, Number, key_figures, moved
from replay.batch.recordings import Recording, degrade_input, make_input, why_not
from replay.configuration import parse_assignments
from replay.engine.job import make_job
from replay.engine.manifest import package_version, read_manifest
from replay.engine.run import replay_log
from replay.errors import ExitCode, MissingChannelError, UsageError
from replay.evaluate import evaluate_run
from replay.log.digest import ChannelDigest
from replay.log.reader import LogReader

_HASH_DIGITS: Final = 16


class Verdict(enum.Enum):
    """What a check of one case says."""

    EQUAL = "equal"
    CHANGED = "changed"
    EDITED = "edited by hand"
    UNRECORDED = "not recorded yet"
    SKIPPED = "skipped"


class ChannelChange(msgspec.Struct, frozen=True, kw_only=True):
    """A channel that differs; None where there is none.

    Attributes
    ----------
    topic : str
    kind : str
        "input" or "output".
    recorded, found : Digest or None
    """

    topic: str
    kind: str
    recorded: Digest | None
    found: Digest | None


class FigureChange(msgspec.Struct, frozen=True, kw_only=True):
    """A figure that moved; None where there is none.

    Attributes
    ----------
    name : str
    recorded, found : number or None
    """

    name: str
    recorded: Number | None
    found: Number | None


class CaseCheck(msgspec.Struct, frozen=True, kw_only=True):
    """One case of a recording, recorded against run again.

    Attributes
    ----------
    recording, case : str
    verdict : Verdict
    channels : tuple of ChannelChange
    figures : tuple of FigureChange
    notes : tuple of str
        Why it was skipped, what else changed.
    """

    recording: str
    case: str
    verdict: Verdict
    channels: tuple[ChannelChange, ...] = ()
    figures: tuple[FigureChange, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def exit_code(self) -> ExitCode:
        """1 where it is not as recorded."""
        fine = self.verdict in (Verdict.EQUAL, Verdict.SKIPPED)
        return ExitCode.OK if fine else ExitCode.FAILURE


def check(recordings: Sequence[Recording], data: Path | None = None) -> Iterator[CaseCheck]:
    """Make every input again, run every case, compare; a verdict as each is done.

    Parameters
    ----------
    recordings : sequence of Recording
    data : Path, optional
        Folder of the files of real recordings; those without files are skipped.
    """
    for recording in recordings:
        reason = why_not(recording, data)
        cases = recording.baseline.cases
        for name in cases if reason else ():
            yield CaseCheck(
                recording=recording.name, case=name, verdict=Verdict.SKIPPED, notes=(reason,)
            )
        if not reason:
            for name, found in _run_cases(recording, data):
                yield compare(recording.name, name, cases[name].recorded, found)


def update(recordings: Sequence[Recording], reason: str, data: Path | None = None) -> Iterator[str]:
    """Run every case and write what it gives into the baselines; says what became of each.

    A baseline whose cases give what they gave is left alone. History is kept.

    Parameters
    ----------
    recordings, data
        As for :func:`check`.
    reason : str
        Why the results are to be others now.

    Raises
    ------
    UsageError
        Where the reason is empty.
    """
    if not reason.strip():
        raise UsageError("an update needs a reason", mend='say why: --reason "TEXT"')
    for recording in recordings:
        missing = why_not(recording, data)
        if missing:
            yield f"{recording.name}: left alone, {missing}"
            continue
        cases: dict[str, Case] = {}
        changed: list[str] = []
        for name, found in _run_cases(recording, data):
            cases[name] = case = recording.baseline.cases[name]
            checked = compare(recording.name, name, case.recorded, found)
            if checked.verdict is not Verdict.EQUAL or checked.notes:
                cases[name] = msgspec.structs.replace(case, recorded=sealed(found))
                changed.append(name)
        if not changed:
            yield f"{recording.name}: as recorded, left alone"
            continue
        entry = Entry(reason=reason.strip(), package=package_version(), cases=tuple(changed))
        history = (*recording.baseline.history, entry)
        baseline: Baseline = msgspec.structs.replace(
            recording.baseline, cases=cases, history=history
        )
        save_baseline(recording.path, baseline)
        yield f"{recording.name}: {', '.join(changed)} written to {recording.path}"


def compare(recording: str, case: str, recorded: Recorded | None, found: Recorded) -> CaseCheck:
    """What a case gave before against what it gives now."""
    if recorded is None:
        note = "`replay baseline update --reason TEXT` records it"
        return CaseCheck(recording=recording, case=case, verdict=Verdict.UNRECORDED, notes=(note,))
    channels = (
        *_channels("input", recorded.inputs, found.inputs),
        *_channels("output", recorded.outputs, found.outputs),
    )
    figures = tuple(
        FigureChange(name=name, recorded=old, found=new)
        for name, old, new in moved(recorded.figures, found.figures, same_bits=not channels)
    )
    notes = _notes(recorded, found, channels)
    verdict = Verdict.CHANGED if channels or figures else Verdict.EQUAL
    if not recorded.whole:
        verdict = Verdict.EDITED
        notes = ("the recorded part was edited: its seal does not fit", *notes)
    elif figures and not channels:
        notes = ("figures moved, rows did not: the evaluation changed", *notes)
    return CaseCheck(
        recording=recording,
        case=case,
        verdict=verdict,
        channels=channels,
        figures=figures,
        notes=notes,
    )


def _channels(
    kind: str, recorded: Mapping[str, Digest], found: Mapping[str, Digest]
) -> Iterator[ChannelChange]:
    for topic in sorted({*recorded, *found}):
        old, new = recorded.get(topic), found.get(topic)
        if old != new:
            yield ChannelChange(topic=topic, kind=kind, recorded=old, found=new)


def _notes(
    recorded: Recorded, found: Recorded, channels: Sequence[ChannelChange]
) -> tuple[str, ...]:
    """What may be why."""
    notes: list[str] = []
    if recorded.package != found.package:
        notes.append(f"package {recorded.package} -> {found.package}")
    for stage in sorted({*recorded.stages, *found.stages}):
        old, new = recorded.stages.get(stage), found.stages.get(stage)
        if old != new:
            notes.append(f"stage {stage}: version {old or 'none'} -> {new or 'none'}")
    if recorded.configuration != found.configuration:
        notes.append("the configuration is another one: `set`, or a default")
    kinds = {change.kind for change in channels}
    if "input" in kinds:
        notes.append("the input is another one: scenario, spec, or the code that makes the log")
    elif (
        kinds and recorded.configuration == found.configuration and recorded.stages == found.stages
    ):
        notes.append("same input, configuration and stage versions: was StageSpec.version raised?")
    return tuple(notes)


def _run_cases(recording: Recording, data: Path | None) -> Iterator[tuple[str, Recorded]]:
    with tempfile.TemporaryDirectory() as scratch:
        source = Path(scratch) / "input.mcap"
        make_input(recording, data, source)
        for name, case in recording.baseline.cases.items():
            log = degrade_input(case, source, Path(scratch) / "degraded.mcap")
            yield name, _run_case(case, log, Path(scratch) / "run.mcap")


def _run_case(case: Case, source: Path, target: Path) -> Recorded:
    with LogReader(source) as reader:
        job = make_job(reader, case.pipeline, tables=[parse_assignments(case.settings)])
        result = replay_log(reader, target, job)
    with LogReader(target) as reader:
        stages = read_manifest(reader.metadata, str(target)).stages
    return Recorded(
        package=package_version(),
        configuration=hashlib.sha256(job.text().encode()).hexdigest()[:_HASH_DIGITS],
        stages={stage.name: stage.version for stage in stages},
        inputs=_digests(result.inputs),
        outputs=_digests(result.outputs),
        figures=_figures(target),
    )


def _digests(digests: Mapping[str, ChannelDigest]) -> dict[str, Digest]:
    return {t: Digest(rows=d.message_count, sha256=d.sha256) for t, d in sorted(digests.items())}


def _figures(run: Path) -> Figures:
    try:
        return key_figures(evaluate_run(run))
    except MissingChannelError:
        return {}
