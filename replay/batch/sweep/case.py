"""One case: its log made or found, transformed, run, evaluated; a row whatever happens."""

from __future__ import annotations

import fnmatch
import json
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

from replay.batch.sweep.file import Case, Source
from replay.batch.sweep.measure import find_measure
from replay.batch.sweep.rows import CODE, ERROR, FIGURE, GRID, SERIES, Row, flatten
from replay.configuration import build, parse_assignments, to_toml
from replay.engine.job import make_job
from replay.engine.manifest import code_digest, package_version
from replay.engine.run import replay_log
from replay.engine.transforms import Transform, transform_log
from replay.errors import ReplayError
from replay.evaluate import evaluate_run
from replay.log.digest import ChannelDigest
from replay.log.reader import LogReader
from replay.simulate import simulate


def make_input(source: Source, folder: Path) -> tuple[Path, float, str]:
    """Log of a source: the path, the seconds that it took, and what went wrong, or nothing."""
    if not source.simulated:
        return source.path, 0.0, ""
    begin = time.monotonic()
    path = folder / f"{source.digest}.mcap"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            simulate(source.path, path, tables=source.tables)
    except Exception as error:
        return path, time.monotonic() - begin, _told(error)
    return path, time.monotonic() - begin, ""


def run_case(case: Case, made: tuple[Path, float, str]) -> Row:
    """Row of a case whose log :func:`make_input` made."""
    path, elapsed_s, wrong = made
    row: Row = {
        "case": case.key,
        "sweep": case.sweep,
        "package": package_version(),
        CODE: code_digest(),
        "source": case.source.name,
        "source_digest": case.source.digest,
        "pipeline": case.pipeline,
        "then": json.dumps(list(case.then)),
        "settings": json.dumps(list(case.settings)),
        **{f"{GRID}{name}": value for name, value in case.grid.items()},
        "transform": "",
        "configuration": "",
        "inputs": "",
        "outputs": "",
        "simulate_s": elapsed_s,
        "transform_s": 0.0,
        "run_s": 0.0,
        "evaluate_s": 0.0,
        "losses": "[]",
        ERROR: wrong,
    }
    if wrong:
        return row
    try:
        with tempfile.TemporaryDirectory(prefix="replay-sweep-") as scratch:
            _fill(row, case, path, Path(scratch))
    except Exception as error:  # the others go on; this one's row says why
        row[ERROR] = _told(error)
    return row


def failed_row(case: Case, error: BaseException) -> Row:
    """Row of a case that could not even be run, as where its process died."""
    return run_case(case, (case.source.path, 0.0, _told(error)))


def _fill(row: Row, case: Case, log: Path, scratch: Path) -> None:
    losses: list[str] = []
    begin = time.monotonic()
    if case.transform:
        settings = build(Transform, [case.transform])
        row["transform"] = to_toml(settings)
        if not settings.nothing:
            changed = scratch / "input.mcap"
            done = transform_log(log, changed, settings)
            losses += [str(loss) for loss in done.losses.losses]
            log = changed
    row["transform_s"] = time.monotonic() - begin
    begin = time.monotonic()
    run = scratch / "run.mcap"
    with LogReader(log) as reader:
        job = make_job(reader, case.pipeline, tables=[parse_assignments(case.settings)])
        result = replay_log(reader, run, job)
    row["configuration"] = job.text()
    row["inputs"] = _digests(result.inputs)
    losses += [str(loss) for loss in result.losses.losses]
    for number, pipeline in enumerate(case.then):
        after = scratch / f"then{number}.mcap"
        with LogReader(run) as reader:
            # By its name it is told from the run before, which stays in the log.
            job = make_job(reader, pipeline, tables=[{"name": f"{pipeline}-after"}])
            result = replay_log(reader, after, job)
        losses += [str(loss) for loss in result.losses.losses]
        run.unlink()
        run = after
    row["outputs"] = _digests(result.outputs)
    row["losses"] = json.dumps(losses)
    row["run_s"] = time.monotonic() - begin
    begin = time.monotonic()
    if case.measure:
        measured = find_measure(case.measure)(run)
        row |= {f"{FIGURE}{name}": value for name, value in measured.figures.items()}
        row |= {f"{SERIES}{name}": values for name, values in measured.series.items()}
    else:
        evaluation = evaluate_run(run, fixed_truth_only=case.fixed_truth_only).to_json_dict()
        for name, value in flatten(evaluation):
            if not case.figures or any(fnmatch.fnmatchcase(name, p) for p in case.figures):
                row[f"{FIGURE}{name}"] = value
    row["evaluate_s"] = time.monotonic() - begin


def _digests(digests: Mapping[str, ChannelDigest]) -> str:
    return json.dumps({topic: digest.sha256 for topic, digest in sorted(digests.items())})


def _told(error: BaseException) -> str:
    if isinstance(error, ReplayError):
        return str(error)
    return f"{type(error).__name__}: {error}"
