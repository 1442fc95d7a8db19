"""One run against truth: from channels to an evaluation."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from replay import channels
from replay.errors import MissingChannelError, UsageError
from replay.evaluate import consistency, outages
from replay.evaluate.align import Rows, known_rows
from replay.evaluate.errors_enu import (
    Errors,
    attitude_errors,
    position_errors,
    rotation_errors,
    velocity_errors,
)
from replay.evaluate.report import Counts, Evaluation
from replay.evaluate.statistics import ANGLES, by_axis, by_local_axis
from replay.log.columns import Columns, concatenate
from replay.log.reader import LogReader
from replay.schemas import filter_pb2, gnss_pb2, solution_pb2

_SAME_TIMES: Final = 0.5  # share of truth's times that are fixes' from which it was made of them
_RTK: Final = (gnss_pb2.FIX_QUALITY_RTK_FIXED, gnss_pb2.FIX_QUALITY_RTK_FLOAT)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RunChannels:
    """Channels of one run.

    Attributes
    ----------
    run : str
    solution, truth : Columns
    innovations, fixes : Columns or None
        None where the log does not have them.
    metadata : mapping of record name to mapping
        Of the log.
    """

    run: str
    solution: Columns
    truth: Columns
    innovations: Columns | None = None
    fixes: Columns | None = None
    metadata: Mapping[str, Mapping[str, str]] = dataclasses.field(default_factory=dict)


def evaluate_run(
    run_log: Path, *, run: str | None = None, fixed_truth_only: bool = False
) -> Evaluation:
    """Errors, drifts and consistency of a run in a log, against the log's truth.

    Parameters
    ----------
    run_log : Path
    run : str, optional
        Name of the run; may be left out where the log has one.
    fixed_truth_only : bool
        Leave out rows of truth whose ambiguities are not fixed.

    Raises
    ------
    MissingChannelError
        Where the log has no solution, or no truth.
    UsageError
        Where it has several runs and none was named.
    LogError
        Where it cannot be read.
    """
    return evaluate_channels(read_run(run_log, run=run), fixed_truth_only=fixed_truth_only)


def read_run(run_log: Path, *, run: str | None = None) -> RunChannels:
    """Channels of a run in a log; errors as in :func:`evaluate_run`."""
    with LogReader(run_log) as reader:
        topics = sorted(reader.channels)
        name = _run_name(topics, run, str(run_log))
        if channels.TRUTH.topic not in topics:
            raise MissingChannelError(
                "the log has no truth",
                where=f"{run_log}, {channels.TRUTH.topic}",
                mend="import or simulate the input with truth and run again",
            )
        innovations = channels.FILTER_INNOVATIONS.at(run=name)
        fixes = [reader.read(topic) for topic in topics if channels.GNSS_FIX.matches(topic)]
        return RunChannels(
            run=name,
            solution=reader.read(channels.SOLUTION.at(run=name)),
            truth=reader.read(channels.TRUTH.topic),
            innovations=reader.read(innovations) if innovations in topics else None,
            fixes=concatenate(fixes) if fixes else None,
            metadata={key: dict(values) for key, values in reader.metadata.items()},
        )


def _run_name(topics: list[str], run: str | None, where: str) -> str:
    names = [channels.SOLUTION.parts(t)["run"] for t in topics if channels.SOLUTION.matches(t)]
    if run is None and len(names) == 1:
        return names[0]
    if run in names:
        return str(run)
    if run is not None or not names:
        raise MissingChannelError(
            f"the log has no solution of {run}" if run else "the log has no solution",
            where=where,
            mend=f"it has {', '.join(names)}" if names else "evaluate a log that `replay run` made",
        )
    raise UsageError(
        "the log has several runs", where=where, mend=f"choose one of {', '.join(names)}"
    )


def evaluate_channels(data: RunChannels, *, fixed_truth_only: bool = False) -> Evaluation:
    """Errors, drifts and consistency of a run whose channels were read.

    Raises
    ------
    MissingChannelError
        Where the solution or truth has no row.
    """
    for name, columns in (("solution", data.solution), ("truth", data.truth)):
        if len(columns) == 0:
            raise MissingChannelError(
                f"the {name} has no row", mend="look at the run's events, and at its input"
            )
    # Rows of one time keep their order: the row before an update stands before it.
    solution = data.solution.take(np.argsort(data.solution.valid_time_ns, kind="stable"))
    position = position_errors(solution, data.truth, fixed_only=fixed_truth_only)
    velocity = velocity_errors(solution, data.truth, fixed_only=fixed_truth_only)
    attitude = attitude_errors(solution, data.truth, fixed_only=fixed_truth_only)
    rotation = rotation_errors(solution, data.truth, fixed_only=fixed_truth_only)
    updates, rejections = _position_updates(data, solution)
    spans = outages.cut_spans(data.metadata)
    if spans is None:
        spans = outages.natural_spans(updates, int(solution.valid_time_ns[-1]))
    spans = tuple(span for span in spans if span.end_ns > solution.valid_time_ns[0])
    measured = tuple(outages.measure(s, solution, updates, position, attitude) for s in spans)
    epoch = solution["status"] == solution_pb2.SOLUTION_STATUS_UPDATED
    epoch &= ~outages.inside(solution.valid_time_ns, spans)

    def at_epochs(errors: Errors) -> Errors:
        return errors.take(epoch[errors.rows])

    known = known_rows(data.truth, "position_ecef_m", fixed_only=fixed_truth_only)
    return Evaluation(
        run=data.run,
        start_ns=int(solution.valid_time_ns[0]),
        position_error_m=by_local_axis(at_epochs(position).values),
        position_error_all_m=by_local_axis(position.values),
        velocity_error_m_s=by_local_axis(at_epochs(velocity).values),
        velocity_error_all_m_s=by_local_axis(velocity.values),
        attitude_error_deg=by_axis(np.degrees(at_epochs(attitude).values), ANGLES),
        attitude_error_all_deg=by_axis(np.degrees(attitude.values), ANGLES),
        outages=measured,
        outage_summary=outages.summarize(measured),
        nees=consistency.nees(
            solution,
            at_epochs(position),
            at_epochs(velocity),
            at_epochs(rotation),
            truth_is_measurement=_truth_is_measurement(data, updates),
        ),
        nis=None if data.innovations is None else consistency.nis(data.innovations),
        counts=Counts(
            solution_rows=len(solution),
            truth_rows=len(known),
            fixed_truth_only=fixed_truth_only,
            compared_rows=len(position),
            without_truth_rows=len(solution) - len(position),
            epoch_rows=len(at_epochs(position)),
            velocity_rows=len(velocity),
            attitude_rows=len(attitude),
            position_updates=None if data.innovations is None else len(updates),
            position_rejections=rejections,
        ),
    )


def _position_updates(data: RunChannels, solution: Columns) -> tuple[Rows, int | None]:
    """Times of used positions, ascending, and how many epochs were refused (None: not told).

    Without innovations the fixes that came count, and without those the updated rows.
    """
    if data.innovations is not None:
        rows = data.innovations["kind"] == filter_pb2.MEASUREMENT_KIND_POSITION
        accepted = data.innovations["accepted"].astype(np.bool_)
        used = np.unique(data.innovations.valid_time_ns[rows & accepted])
        refused = np.unique(data.innovations.valid_time_ns[rows & ~accepted])
        return used, len(np.setdiff1d(refused, used))
    if data.fixes is not None:
        return np.unique(data.fixes.valid_time_ns), None
    updated = solution["status"] == solution_pb2.SOLUTION_STATUS_UPDATED
    return np.unique(solution.valid_time_ns[updated]), None


def _truth_is_measurement(data: RunChannels, updates: Rows) -> bool:
    """Whether truth was made of the same RTK fixes that the filter used."""
    if not np.isin(data.truth["quality"], _RTK).any():
        return False
    fixes = updates if data.fixes is None else data.fixes.valid_time_ns
    return bool(np.mean(np.isin(data.truth.valid_time_ns, fixes)) >= _SAME_TIMES)
