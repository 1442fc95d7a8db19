"""A point that stands still: its reference, its sessions, how well they repeat."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, Literal

import msgspec
import numpy as np

from replay.errors import MissingChannelError
from replay.evaluate.align import Rows, known_rows
from replay.evaluate.convergence import EACH, HOLD_S, LIMIT_M, Convergence, convergence_of
from replay.evaluate.errors_enu import Errors
from replay.evaluate.geometry import Floats
from replay.evaluate.statistics import LOCAL_AXES, Statistics, by_local_axis
from replay.evaluate.status import updated
from replay.log.columns import Columns
from replay.schemas import gnss_pb2, solution_pb2
from replay.time import NS_PER_S

MEAN: Final = "mean"
STILL_M: Final = 1e-3  # a truth that moves less than this stands still
Reference = Literal["mean"] | tuple[float, float, float]


class StationOptions(msgspec.Struct, frozen=True, kw_only=True):
    """How a point that stands still is measured.

    Attributes
    ----------
    reference : "mean", or tuple of 3 float (m, ECEF), or None
        Where the point is, instead of the log's truth; "mean": at the mean of the last half of
        the run's positions.
    limit_m : float, m
        Of convergence.
    hold_s : float, s
        How long errors must keep within the limit for the second kind of convergence.
    start_up_s : float, s
        Left out of the figures that begin at a fixed time.
    session_s : float, s, or None
        Length of sessions that the run is cut into; None: one session.
    """

    reference: Reference | None = None
    limit_m: float = LIMIT_M
    hold_s: float = HOLD_S
    start_up_s: float = 3600.0
    session_s: float | None = None


class Session(msgspec.Struct, frozen=True, kw_only=True):
    """A stretch of a run.

    Attributes
    ----------
    start_s, end_s : float, s
        Since the start of the run.
    epochs : int
    convergence : Convergence or None
        None for all sessions but the first, in which the filter goes on from the one before.
    converged_error_m : dict of Statistics or None
        From the epoch on from which east, north and up keep within the limit to the end.
    started_error_m : dict of Statistics or None
        From `start_up_s` of the run on.
    first_fix_s : float or None, s
        To the first epoch with integer ambiguities; since the start of the session.
    fixed_share : float
        Of the epochs.
    float_error_m, fixed_error_m : dict of Statistics or None
        At epochs with float and with integer ambiguities.
    mean_error_m, last_error_m : tuple of 3 float or None, m
        East, north, up: mean from `start_up_s` on, and of the last epoch.
    """

    start_s: float
    end_s: float
    epochs: int
    convergence: Convergence | None
    converged_error_m: dict[str, Statistics] | None
    started_error_m: dict[str, Statistics] | None
    first_fix_s: float | None
    fixed_share: float
    float_error_m: dict[str, Statistics] | None
    fixed_error_m: dict[str, Statistics] | None
    mean_error_m: tuple[float, float, float] | None
    last_error_m: tuple[float, float, float] | None


class Repeatability(msgspec.Struct, frozen=True, kw_only=True):
    """How far coordinates of sessions are from their mean.

    Attributes
    ----------
    sessions : int
    std_m : dict of float, m
        East, north, up and horizontal, with one less than the count as divisor; the horizontal
        one is the root of the sum of squares of east and north.
    greatest_m : dict of float, m
        Greatest distance from the mean, of the same.
    """

    sessions: int
    std_m: dict[str, float]
    greatest_m: dict[str, float]


class Station(msgspec.Struct, frozen=True, kw_only=True):
    """A run of a point that stands still.

    Attributes
    ----------
    reference : str
        "truth", "given" or "mean".
    reference_ecef_m : tuple of 3 float, m
    options : StationOptions
    sessions : tuple of Session
    repeatability : Repeatability or None
        Of the sessions' means; None where fewer than two have one.
    """

    reference: str
    reference_ecef_m: tuple[float, float, float]
    options: StationOptions
    sessions: tuple[Session, ...]
    repeatability: Repeatability | None


def reference_rows(solution: Columns, reference: Reference) -> Columns:
    """Truth of a point that stands still while a solution lasts.

    Parameters
    ----------
    solution : Columns of replay.Solution
    reference : "mean", or tuple of 3 float (m, ECEF)

    Raises
    ------
    MissingChannelError
        Where the mean is asked for of a solution without rows.
    """
    times = solution.valid_time_ns
    if len(times) == 0:
        raise MissingChannelError(
            "the solution has no row", mend="look at the run's events, and at its input"
        )
    first, last = int(times.min()), int(times.max())
    if reference == MEAN:
        late = times >= first + (last - first) // 2
        place = solution["position_ecef_m"].astype(np.float64)[late].mean(axis=0)
    else:
        place = np.array(reference, dtype=np.float64)
    # Fixed, so that those who leave out truth that is not fixed keep it.
    quality = np.full(2, gnss_pb2.FIX_QUALITY_PPP_FIXED, dtype=np.int32)
    return Columns.build(
        np.array([first, max(last, first + 1)], dtype=np.int64),
        {
            "position_ecef_m": np.tile(place, (2, 1)),
            "lever_arm_body_m": np.zeros((2, 3)),
            "quality": quality,
        },
    )


def still_point(truth: Columns) -> Floats | None:
    """Where a truth that stands still is (3,), m, ECEF; None where it moves or is not known."""
    known = known_rows(truth, "position_ecef_m")
    if len(known) == 0:
        return None
    places = known["position_ecef_m"]
    if float(np.linalg.norm(places - places[0], axis=1).max()) > STILL_M:
        return None
    return np.asarray(places[0], dtype=np.float64)


def station_of(
    solution: Columns,
    position: Errors,
    reference_ecef_m: Floats,
    options: StationOptions,
    *,
    name: str = "truth",
    start_ns: int | None = None,
) -> Station:
    """Figures of a run of a point that stands still.

    Parameters
    ----------
    solution : Columns of replay.Solution
        In the order of time.
    position : Errors
        East, north, up [m] of rows of the solution.
    reference_ecef_m : float64 array (3,), m
    options : StationOptions
    name : str
        What the reference is.
    start_ns : int or None, GPS ns
        Start of the run; None: its first row.
    """
    epochs = position.take(updated(solution)[position.rows])
    status = solution["status"][epochs.rows]
    begin = int(solution.valid_time_ns[0]) if start_ns is None else start_ns
    length_ns = None if options.session_s is None else round(options.session_s * NS_PER_S)
    number = (
        np.zeros(len(epochs), dtype=np.int64)
        if length_ns is None
        else (epochs.times_ns - begin) // length_ns
    )
    sessions = tuple(
        _session(
            epochs.take(number == k),
            status[number == k],
            options,
            run_start_ns=begin,
            start_ns=begin + int(k) * (length_ns or 0),
        )
        for k in np.unique(number)
    )
    x, y, z = (float(value) for value in reference_ecef_m)
    return Station(
        reference=name,
        reference_ecef_m=(x, y, z),
        options=options,
        sessions=sessions,
        repeatability=repeatability_of(
            [s.mean_error_m for s in sessions if s.mean_error_m is not None]
        ),
    )


def _session(
    errors: Errors,
    status: Rows,
    options: StationOptions,
    *,
    run_start_ns: int,
    start_ns: int,
) -> Session:
    times, enu = errors.times_ns, errors.values
    convergence = (
        convergence_of(
            times, enu, start_ns=start_ns, limit_m=options.limit_m, hold_s=options.hold_s
        )
        if start_ns == run_start_ns
        else None
    )
    settled = None if convergence is None else convergence.to_the_end_s[EACH]
    started = times - run_start_ns >= options.start_up_s * NS_PER_S
    fixed = status == solution_pb2.SOLUTION_STATUS_FIXED
    floating = status == solution_pb2.SOLUTION_STATUS_FLOAT
    return Session(
        start_s=(start_ns - run_start_ns) / NS_PER_S,
        end_s=(int(times[-1]) - run_start_ns) / NS_PER_S,
        epochs=len(errors),
        convergence=convergence,
        converged_error_m=(
            None
            if settled is None
            else by_local_axis(enu[times - start_ns >= round(settled * NS_PER_S)])
        ),
        started_error_m=by_local_axis(enu[started]),
        first_fix_s=float(times[fixed][0] - start_ns) / NS_PER_S if fixed.any() else None,
        fixed_share=float(np.mean(fixed)),
        float_error_m=by_local_axis(enu[floating]),
        fixed_error_m=by_local_axis(enu[fixed]),
        mean_error_m=_triple(enu[started].mean(axis=0)) if started.any() else None,
        last_error_m=_triple(enu[-1]),
    )


def _triple(values: Floats) -> tuple[float, float, float]:
    east, north, up = (float(value) for value in values)
    return east, north, up


def repeatability_of(coordinates_m: Sequence[Sequence[float]]) -> Repeatability | None:
    """How far coordinates (k, 3), east, north, up [m], are from their mean; None of one."""
    if len(coordinates_m) <= 1:
        return None
    values = np.array(coordinates_m, dtype=np.float64)
    away = values - values.mean(axis=0)
    std = np.std(values, axis=0, ddof=1)
    greatest = np.abs(away).max(axis=0)
    names = (*LOCAL_AXES, "horizontal")
    return Repeatability(
        sessions=len(values),
        std_m=dict(zip(names, map(float, (*std, np.hypot(std[0], std[1]))), strict=True)),
        greatest_m=dict(
            zip(
                names,
                map(float, (*greatest, np.hypot(away[:, 0], away[:, 1]).max())),
                strict=True,
            )
        ),
    )
