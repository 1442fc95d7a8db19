"""Spans without GNSS positions, and how far a solution has drifted at their ends."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Final

import msgspec
import numpy as np
import numpy.typing as npt

from replay.errors import DataError
from replay.evaluate.align import Rows
from replay.evaluate.errors_enu import Errors
from replay.evaluate.status import updated
from replay.log.columns import Columns
from replay.time import NS_PER_S

DEGRADE: Final = "replay.degrade"
GAP_INTERVALS: Final = 3.0  # one or two lost fixes are no outage
GAP_LEAST_S: Final = 2.0
_FEWEST_UPDATES: Final = 2
# Spans are told by the receiver's clock and solutions by true time: apart by no more than this.
_CLOCK_NS: Final = 10_000_000


@dataclasses.dataclass(frozen=True, slots=True, order=True)
class Span:
    """A span without positions.

    Attributes
    ----------
    start_ns, end_ns : int, GPS ns
    cut : bool
        Whether it was cut out of the log on purpose.
    """

    start_ns: int
    end_ns: int
    cut: bool = False


class Outage(msgspec.Struct, frozen=True, kw_only=True):
    """An outage and the drift at its end.

    The drift is the error of the last row of the solution before the first position
    update after the outage, against truth at that row's time; None where truth is not
    known then.

    Attributes
    ----------
    start_s, end_s : float, s
        Since the first row of the solution.
    duration_s : float, s
    start_ns, end_ns : int, GPS ns
    cut : bool
        Whether it was cut out of the log on purpose.
    ended : bool
        Whether a position update came after it.
    drift_time_ns : int or None, GPS ns
        Of the row whose error the drift is.
    east_drift_m, north_drift_m, up_drift_m, horizontal_drift_m, drift_3d_m : float or None, m
    heading_drift_deg : float or None, deg
    horizontal_max_m, max_3d_m : float or None, m
        Largest errors from the start to the drift.
    """

    start_s: float
    end_s: float
    duration_s: float
    start_ns: int
    end_ns: int
    cut: bool
    ended: bool
    drift_time_ns: int | None = None
    east_drift_m: float | None = None
    north_drift_m: float | None = None
    up_drift_m: float | None = None
    horizontal_drift_m: float | None = None
    drift_3d_m: float | None = None
    heading_drift_deg: float | None = None
    horizontal_max_m: float | None = None
    max_3d_m: float | None = None


class OutageSummary(msgspec.Struct, frozen=True, kw_only=True):
    """Horizontal drifts of all outages whose drift is known.

    Attributes
    ----------
    count : int
        Outages, with or without a known drift.
    horizontal_median_m, horizontal_max_m, horizontal_rms_m : float or None, m
    """

    count: int
    horizontal_median_m: float | None = None
    horizontal_max_m: float | None = None
    horizontal_rms_m: float | None = None


def cut_spans(metadata: Mapping[str, Mapping[str, str]]) -> tuple[Span, ...] | None:
    """Outages that a log's metadata tells of; None where it tells nothing.

    Raises
    ------
    DataError
        Where the record cannot be read.
    """
    record = metadata.get(DEGRADE)
    if record is None or "json" not in record:
        return None
    try:
        listed = json.loads(record["json"])["outages"]
        return tuple(
            sorted(Span(int(item["start_ns"]), int(item["end_ns"]), cut=True) for item in listed)
        )
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(
            f"the metadata record {DEGRADE} has no list of outages: {error!r}",
            mend="make the log again with `replay degrade`",
        ) from error


def natural_spans(update_times_ns: Rows, end_ns: int) -> tuple[Span, ...]:
    """Gaps between position updates that are no jitter.

    Parameters
    ----------
    update_times_ns : int64 array (n,), GPS ns
        Of used positions, ascending.
    end_ns : int, GPS ns
        Last time of the solution, so that updates that stop early count.

    Returns
    -------
    tuple of Span
        Gaps longer than three median intervals and than two seconds.
    """
    if len(update_times_ns) < _FEWEST_UPDATES:
        return ()
    steps = np.diff(update_times_ns)
    limit = max(GAP_INTERVALS * float(np.median(steps)), GAP_LEAST_S * NS_PER_S)
    times = update_times_ns
    if end_ns > times[-1]:
        times = np.append(times, end_ns)
    wide = np.flatnonzero(np.diff(times) > limit)
    return tuple(Span(int(times[i]), int(times[i + 1])) for i in wide)


def inside(times_ns: Rows, spans: Sequence[Span]) -> npt.NDArray[np.bool_]:
    """Which times lie within a span; its ends, where positions are, do not."""
    mask = np.zeros(len(times_ns), dtype=np.bool_)
    for span in spans:
        mask |= (times_ns > span.start_ns) & (times_ns < span.end_ns)
    return mask


def measure(
    span: Span, solution: Columns, update_times_ns: Rows, position: Errors, attitude: Errors
) -> Outage:
    """Drift of one outage.

    Parameters
    ----------
    span : Span
    solution : Columns of replay.Solution
    update_times_ns : int64 array (n,), GPS ns
        Of used positions, ascending.
    position, attitude : Errors
        East, north, up [m] and roll, pitch, heading [rad] of the solution.
    """
    first_ns = int(solution.valid_time_ns[0])
    row, ended = _drift_row(span, solution, update_times_ns)
    start_s = (span.start_ns - first_ns) / NS_PER_S
    duration_s = (span.end_ns - span.start_ns) / NS_PER_S
    outage = Outage(
        start_s=start_s,
        end_s=(span.end_ns - first_ns) / NS_PER_S,
        duration_s=duration_s,
        start_ns=span.start_ns,
        end_ns=span.end_ns,
        cut=span.cut,
        ended=ended,
    )
    if row is None:
        return outage
    at = np.flatnonzero(position.rows == row)
    if len(at) == 0:
        return outage
    during = (position.times_ns > span.start_ns) & (position.rows <= row)
    enu = position.values[at[0]]
    horizontal = np.hypot(position.values[during, 0], position.values[during, 1])
    spatial = np.linalg.norm(position.values[during], axis=1)
    heading = attitude.values[attitude.rows == row, 2]
    return msgspec.structs.replace(
        outage,
        drift_time_ns=int(solution.valid_time_ns[row]),
        east_drift_m=float(enu[0]),
        north_drift_m=float(enu[1]),
        up_drift_m=float(enu[2]),
        horizontal_drift_m=float(np.hypot(enu[0], enu[1])),
        drift_3d_m=float(np.linalg.norm(enu)),
        heading_drift_deg=float(np.degrees(heading[0])) if len(heading) else None,
        horizontal_max_m=float(horizontal.max()),
        max_3d_m=float(spatial.max()),
    )


def _drift_row(span: Span, solution: Columns, update_times_ns: Rows) -> tuple[int | None, bool]:
    """Last row before the first update after a span, and whether there is such an update.

    A filter may write a row at the very time of the update but before it, so that rows
    are told apart by their status and not by their time alone.
    """
    times = solution.valid_time_ns
    # A cut span leaves out fixes at its start and keeps those at its end, a gap keeps both.
    after = update_times_ns[update_times_ns >= span.end_ns - _CLOCK_NS]
    if len(after) == 0:
        row = len(times) - 1
    else:
        at_update = np.flatnonzero(updated(solution) & (times == after[0]))
        first = int(at_update[0]) if len(at_update) else int(np.searchsorted(times, after[0]))
        row = first - 1
    if row < 0 or times[row] <= span.start_ns:
        return None, len(after) > 0
    return row, len(after) > 0


def summarize(outages: Sequence[Outage]) -> OutageSummary:
    """Summary of the horizontal drifts."""
    drifts = np.array(
        [o.horizontal_drift_m for o in outages if o.horizontal_drift_m is not None],
        dtype=np.float64,
    )
    if len(drifts) == 0:
        return OutageSummary(count=len(outages))
    return OutageSummary(
        count=len(outages),
        horizontal_median_m=float(np.median(drifts)),
        horizontal_max_m=float(drifts.max()),
        horizontal_rms_m=float(np.sqrt(np.mean(drifts * drifts))),
    )
