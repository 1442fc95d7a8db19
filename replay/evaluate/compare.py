"""Several methods against one truth: every run of every log given."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from replay.channels import SOLUTION
from replay.engine.manifest import MANIFEST, read_manifest
from replay.errors import MissingChannelError
from replay.evaluate import outages
from replay.evaluate.ambiguities import WRONG_FIX_LIMIT_M
from replay.evaluate.errors_enu import Errors, position_change_errors, position_errors
from replay.evaluate.read import RunChannels, read_run, runs_of
from replay.evaluate.report import Evaluation
from replay.evaluate.run import evaluate_channels
from replay.evaluate.status import updated
from replay.log.reader import LogReader


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Method:
    """One run of one log, with its errors at its epochs of GNSS.

    Attributes
    ----------
    name : str
        Of the run; with the log's name before it where runs of one name are compared.
    log : Path
    data : RunChannels
        The solution in the order of time.
    evaluation : Evaluation
    position, change : Errors
        Of the position and of its change from epoch to epoch, east, north, up [m].
    """

    name: str
    log: Path
    data: RunChannels
    evaluation: Evaluation
    position: Errors
    change: Errors


def read_methods(
    logs: Sequence[Path],
    *,
    fixed_truth_only: bool = False,
    wrong_fix_limit_m: float = WRONG_FIX_LIMIT_M,
) -> list[Method]:
    """Every run of the logs, in their order, against the truth in its own log.

    A run that a later one only took over from another of the logs, as a smoother takes its
    filter's, stands once.

    Parameters
    ----------
    logs : sequence of Path
    fixed_truth_only : bool
        Leave out rows of truth whose ambiguities are not fixed.
    wrong_fix_limit_m : float, m
        Horizontal error over which a fixed position counts as wrong.

    Raises
    ------
    MissingChannelError
        Where a log has no solution or no truth.
    LogError
        Where one cannot be read.
    """
    found: list[tuple[Path, RunChannels]] = []
    repeated = _passed_through(logs)
    for place, log in enumerate(logs):
        names = runs_of(log)
        if not names:
            raise MissingChannelError(
                "the log has no solution",
                where=str(log),
                mend="compare logs that `replay run` made",
            )
        found += [(log, read_run(log, run=name)) for name in names if (place, name) not in repeated]
    return [
        make_method(
            data,
            log=log,
            name=name,
            fixed_truth_only=fixed_truth_only,
            wrong_fix_limit_m=wrong_fix_limit_m,
        )
        for (log, data), name in zip(found, _names(found), strict=True)
    ]


def _passed_through(logs: Sequence[Path]) -> set[tuple[int, str]]:
    """Place of a log and name of a run that it took over from another of the logs."""
    made: set[tuple[str, str]] = set()
    taken: list[tuple[int, str, str]] = []
    for place, log in enumerate(logs):
        with LogReader(log) as reader:
            if MANIFEST not in reader.metadata:
                continue
            manifest = read_manifest(reader.metadata, str(log))
        made |= {(d.topic, d.sha256) for d in manifest.outputs if SOLUTION.matches(d.topic)}
        taken += [(place, d.topic, d.sha256) for d in manifest.inputs if SOLUTION.matches(d.topic)]
    return {
        (place, SOLUTION.parts(topic)["run"])
        for place, topic, digest in taken
        if (topic, digest) in made
    }


def make_method(
    data: RunChannels,
    *,
    log: Path,
    name: str,
    fixed_truth_only: bool = False,
    wrong_fix_limit_m: float = WRONG_FIX_LIMIT_M,
) -> Method:
    """A method of channels that were read."""
    solution = data.solution.take(np.argsort(data.solution.valid_time_ns, kind="stable"))
    data = dataclasses.replace(data, solution=solution)
    evaluation = evaluate_channels(
        data, fixed_truth_only=fixed_truth_only, wrong_fix_limit_m=wrong_fix_limit_m
    )
    spans = [outages.Span(o.start_ns, o.end_ns) for o in evaluation.outages]
    epochs = updated(solution) & ~outages.inside(solution.valid_time_ns, spans)
    position = position_errors(
        solution, data.truth, fixed_only=fixed_truth_only, antenna_arm_m=data.antenna_arm_m
    )
    return Method(
        name=name,
        log=log,
        data=data,
        evaluation=evaluation,
        position=position.take(epochs[position.rows]),
        change=position_change_errors(
            solution,
            data.truth,
            epochs,
            fixed_only=fixed_truth_only,
            antenna_arm_m=data.antenna_arm_m,
        ),
    )


def _names(found: Sequence[tuple[Path, RunChannels]]) -> list[str]:
    """Names of runs; told apart by their log, and by a number where that is the same too."""
    runs = Counter(data.run for _, data in found)
    names = [d.run if runs[d.run] == 1 else f"{p.stem}:{d.run}" for p, d in found]
    seen: Counter[str] = Counter()
    told: list[str] = []
    for name in names:
        seen[name] += 1
        told.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return told


def to_json_dict(methods: Sequence[Method]) -> dict[str, Any]:
    """Every method's evaluation by name, as plain values."""
    return {
        "methods": [
            {"name": m.name, "log": str(m.log), **m.evaluation.to_json_dict()} for m in methods
        ]
    }
