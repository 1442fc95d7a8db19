"""One run against truth: from channels to an evaluation."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from replay.errors import MissingChannelError
from replay.evaluate import consistency, outages
from replay.evaluate.align import Rows, known_rows
from replay.evaluate.ambiguities import WRONG_FIX_LIMIT_M, ambiguities_of, fixed_rows
from replay.evaluate.availability import availability_of
from replay.evaluate.errors_enu import (
    Errors,
    attitude_errors,
    of_antenna,
    position_change_errors,
    position_errors,
    rotation_errors,
    velocity_errors,
)
from replay.evaluate.read import RunChannels, read_run
from replay.evaluate.report import Counts, Evaluation
from replay.evaluate.satellites import geometry_of
from replay.evaluate.station import Station, StationOptions, station_of, still_point
from replay.evaluate.statistics import ANGLES, by_axis, by_local_axis
from replay.evaluate.status import updated
from replay.log.columns import Columns
from replay.schemas import filter_pb2, gnss_pb2

_SAME_TIMES: Final = 0.5  # share of truth's times that are fixes' from which it was made of them
_RTK: Final = (gnss_pb2.FIX_QUALITY_RTK_FIXED, gnss_pb2.FIX_QUALITY_RTK_FLOAT)


def evaluate_run(
    run_log: Path,
    *,
    run: str | None = None,
    fixed_truth_only: bool = False,
    wrong_fix_limit_m: float = WRONG_FIX_LIMIT_M,
    station: StationOptions | None = None,
) -> Evaluation:
    """Errors, drifts and consistency of a run in a log, against the log's truth.

    Parameters
    ----------
    run_log : Path
    run : str, optional
        Name of the run; may be left out where the log has one, or one of the name that
        its manifest gives.
    fixed_truth_only : bool
        Leave out rows of truth whose ambiguities are not fixed.
    wrong_fix_limit_m : float, m
        Horizontal error over which a fixed position counts as wrong.
    station : StationOptions, optional
        How a point that stands still is measured, and where it is.

    Raises
    ------
    MissingChannelError
        Where the log has no solution, or no truth.
    UsageError
        Where it has several runs and none was named.
    LogError
        Where it cannot be read.
    """
    return evaluate_channels(
        read_run(run_log, run=run, reference=station.reference if station else None),
        fixed_truth_only=fixed_truth_only,
        wrong_fix_limit_m=wrong_fix_limit_m,
        station=station,
    )


def evaluate_channels(
    data: RunChannels,
    *,
    fixed_truth_only: bool = False,
    wrong_fix_limit_m: float = WRONG_FIX_LIMIT_M,
    station: StationOptions | None = None,
) -> Evaluation:
    """Errors, drifts and consistency of a run whose channels were read.

    What the run or truth does not have is None in the evaluation.

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
    position = position_errors(
        solution, data.truth, fixed_only=fixed_truth_only, antenna_arm_m=data.antenna_arm_m
    )
    velocity = velocity_errors(solution, data.truth, fixed_only=fixed_truth_only)
    attitude = attitude_errors(solution, data.truth, fixed_only=fixed_truth_only)
    rotation = rotation_errors(solution, data.truth, fixed_only=fixed_truth_only)
    updates, rejections = _position_updates(data, solution)
    spans = outages.cut_spans(data.metadata)
    if spans is None:
        spans = outages.natural_spans(updates, int(solution.valid_time_ns[-1]))
    spans = tuple(span for span in spans if span.end_ns > solution.valid_time_ns[0])
    measured = tuple(outages.measure(s, solution, updates, position, attitude) for s in spans)
    epoch = updated(solution) & ~outages.inside(solution.valid_time_ns, spans)
    change = position_change_errors(
        solution, data.truth, epoch, fixed_only=fixed_truth_only, antenna_arm_m=data.antenna_arm_m
    )

    def at_epochs(errors: Errors) -> Errors:
        return errors.take(epoch[errors.rows])

    known = known_rows(data.truth, "position_ecef_m", fixed_only=fixed_truth_only)
    return Evaluation(
        run=data.run,
        solution_of=_point(solution),
        start_ns=int(solution.valid_time_ns[0]),
        position_error_m=by_local_axis(at_epochs(position).values),
        position_error_all_m=by_local_axis(position.values),
        position_change_error_m=by_local_axis(change.values),
        position_error_fixed_m=by_local_axis(
            position.take(fixed_rows(solution)[position.rows]).values
        ),
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
        geometry=geometry_of(data.geometry),
        ambiguities=ambiguities_of(
            solution, updated(solution), position, data.resolution, wrong_fix_limit_m
        ),
        availability=availability_of(solution, data.observations_ns),
        station=_station(data, solution, position, station or StationOptions()),
        counts=Counts(
            solution_rows=len(solution),
            truth_rows=len(known),
            fixed_truth_only=fixed_truth_only,
            compared_rows=len(position),
            without_truth_rows=len(solution) - len(position),
            epoch_rows=len(at_epochs(position)),
            change_pairs=len(change),
            velocity_rows=len(velocity),
            attitude_rows=len(attitude),
            position_updates=None if rejections is None else len(updates),
            position_rejections=rejections,
        ),
    )


def _station(
    data: RunChannels, solution: Columns, position: Errors, options: StationOptions
) -> Station | None:
    """Figures of a point that stands still; None where truth moves."""
    place = still_point(data.truth)
    if place is None or len(position) == 0:
        return None
    seen = data.observations_ns
    given = "given" if isinstance(options.reference, tuple) else options.reference
    return station_of(
        solution,
        position,
        place,
        options,
        name=given or "truth",
        start_ns=int(seen[0]) if seen is not None and len(seen) else None,
    )


def _position_updates(data: RunChannels, solution: Columns) -> tuple[Rows, int | None]:
    """Times of used positions, ascending, and how many epochs were refused (None: not told).

    A filter that is given ranges or phases has no positions: its updated rows count.
    Without innovations the fixes that came count, and without those the updated rows.
    """
    if data.innovations is not None:
        rows = data.innovations["kind"] == filter_pb2.MEASUREMENT_KIND_POSITION
        if rows.any() or data.geometry is None:
            accepted = data.innovations["accepted"].astype(np.bool_)
            used = np.unique(data.innovations.valid_time_ns[rows & accepted])
            refused = np.unique(data.innovations.valid_time_ns[rows & ~accepted])
            return used, len(np.setdiff1d(refused, used))
    elif data.fixes is not None and data.geometry is None:
        return np.unique(data.fixes.valid_time_ns), None
    return np.unique(solution.valid_time_ns[updated(solution)]), None


def _point(solution: Columns) -> str:
    """What a solution is about: "imu", "antenna", or "both" where attitude comes and goes."""
    antenna = of_antenna(solution)
    if antenna.all():
        return "antenna"
    return "both" if antenna.any() else "imu"


def _truth_is_measurement(data: RunChannels, updates: Rows) -> bool:
    """Whether truth was made of the same RTK fixes that the filter used."""
    if not np.isin(data.truth["quality"], _RTK).any():
        return False
    fixes = updates if data.fixes is None else data.fixes.valid_time_ns
    return bool(np.mean(np.isin(data.truth.valid_time_ns, fixes)) >= _SAME_TIMES)
