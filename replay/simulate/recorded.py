"""A motion from the truth of a log, so that a real drive can be flown again.

A smooth curve goes through the recorded positions and attitudes
(:mod:`replay.kernels.splined_motion`); it is the truth of the new log, and its sensors are
exact to it. It is as near to the rows as their noise and the spacing of its knots let it be.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from replay import channels, time
from replay.errors import ConfigurationError, DataError, MissingChannelError
from replay.kernels.splined_motion import (
    COLUMNS,
    DEGREE,
    fit_spline,
    rows_of_truth,
    sense_spline,
    spline_poses,
)
from replay.log.columns import Columns
from replay.log.digest import ChannelDigest
from replay.log.reader import LogReader
from replay.simulate.noise import Floats
from replay.simulate.settings import Recorded

Records = npt.NDArray[np.void]
Ints = npt.NDArray[np.int64]

_LEAST_SPACING_S: Final = 0.2  # between knots: keeps the noise of rows out of accelerations
_LONGEST_GAP_S: Final = 1.0
_SMOOTHING: Final = 1e-9  # against 1 of a row: it decides only where rows do not
_ARCSECOND: Final = math.pi / 648000.0


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Splined:
    """A spline through recorded poses; see :class:`replay.simulate.trajectory.Motion`.

    Attributes
    ----------
    coefficients : float64 array (k + 5, 7)
    origin : float64 array (3,), m, ECEF
    spacing_s : float, s
        Between knots.
    offset_s : float, s
        From the spline's start to the motion's.
    """

    coefficients: Floats
    origin: Floats
    spacing_s: float
    offset_s: float

    def sense(self, interval_s: float, positions: Floats, rates: Floats, forces: Floats) -> None:
        """Evaluate the spline and its derivatives."""
        sense_spline(
            self.coefficients,
            self.origin,
            self.spacing_s,
            self.offset_s,
            interval_s,
            positions,
            rates,
            forces,
        )

    def fill(self, interval_s: float, positions: Floats, times_s: Floats, poses: Records) -> None:
        """Evaluate the spline; the grid is not needed."""
        spline_poses(self.coefficients, self.origin, self.spacing_s, self.offset_s, times_s, poses)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A motion and where it comes from.

    Attributes
    ----------
    motion : Splined
    start_ns, span_ns : int, ns
        GPS time of its start, a whole second, and how long it is.
    note : str
        What the curve leaves of the rows, for the manifest.
    digests : mapping of topic to ChannelDigest
        Of the truth that was read.
    """

    motion: Splined
    start_ns: int
    span_ns: int
    note: str
    digests: dict[str, ChannelDigest]


def read_motion(settings: Recorded, folder: Path) -> Recording:
    """Motion through the truth of a log.

    Parameters
    ----------
    settings : Recorded
    folder : Path
        Of the scenario; the log's path is relative to it.

    Raises
    ------
    LogError
        Where the log cannot be read or has no truth.
    DataError
        Where the truth has no attitude, too few rows or a gap.
    ConfigurationError
        Where the span holds nothing.
    """
    path = folder / settings.log
    topic = channels.TRUTH.topic
    with LogReader(path) as reader:
        if topic not in reader.channels:
            raise MissingChannelError(
                f"the log has no {topic}",
                where=str(path),
                mend="take a log with truth, or a run's solution written as truth",
            )
        rows = reader.read(topic)
        digests = {topic: reader.digests()[topic]}
    return _fit(settings, rows, digests, str(path))


def _fit(
    settings: Recorded, truth: Columns, digests: dict[str, ChannelDigest], where: str
) -> Recording:
    order = np.argsort(truth.valid_time_ns, kind="stable")
    attitudes = truth["attitude_rad"] if "attitude_rad" in truth.values else None
    known = np.zeros(len(truth), dtype=np.bool_)
    if attitudes is not None:
        finite = np.isfinite(np.hstack([attitudes, truth["position_ecef_m"]]))
        known[:] = finite.all(axis=1)
    if attitudes is None or not known.any():
        raise DataError(
            "the truth has no attitude",
            where=where,
            mend="take a log whose truth has roll, pitch and heading; a track of positions is "
            "no motion of a body",
        )
    order = order[known[order]]
    first_ns = int(truth.valid_time_ns[order[0]])
    begin_ns = first_ns + round(settings.begin * time.NS_PER_S)
    last_ns = int(truth.valid_time_ns[order[-1]])
    if settings.end > 0.0:
        last_ns = min(last_ns, first_ns + round(settings.end * time.NS_PER_S))
    # A whole second, so that epochs of receivers fall on whole seconds too.
    start_ns = -(-begin_ns // time.NS_PER_S) * time.NS_PER_S
    times_ns = truth.valid_time_ns[order]
    order = order[(times_ns >= begin_ns) & (times_ns <= last_ns)]
    times_ns = truth.valid_time_ns[order]
    if len(order) < COLUMNS or start_ns >= int(times_ns[-1]):
        raise ConfigurationError(
            f"trajectory: the span holds {len(order)} rows of truth with attitude",
            where=where,
            mend="give begin and end in s since the first row",
        )
    steps = np.diff(times_ns)
    usual_s = float(np.sort(steps)[len(steps) // 2]) / time.NS_PER_S
    spacing_s = settings.spacing if settings.spacing > 0.0 else max(_LEAST_SPACING_S, usual_s)
    longest = int(np.argmax(steps))
    gap_s = float(steps[longest]) / time.NS_PER_S
    if gap_s > max(_LONGEST_GAP_S, 2.0 * spacing_s):
        at_s = float(times_ns[longest] - first_ns) / time.NS_PER_S
        raise DataError(
            f"the truth has a gap of {gap_s:g} s from {at_s:g} s on",
            where=where,
            mend="take a span without it (trajectory.begin, trajectory.end), or a spacing of "
            "half of it",
        )
    if spacing_s < usual_s:
        raise ConfigurationError(
            f"trajectory.spacing is {spacing_s:g} s, but rows come every {usual_s:g} s",
            where=where,
            mend=f"write {usual_s:g} s or more, or 0",
        )
    base_ns = int(times_ns[0])
    times_s = (times_ns - base_ns) / time.NS_PER_S
    origin = truth["position_ecef_m"][order[0]].astype(np.float64)
    rows = np.empty((len(order), COLUMNS))
    rows_of_truth(
        np.ascontiguousarray(truth["position_ecef_m"][order]),
        np.ascontiguousarray(attitudes[order]),
        np.ascontiguousarray(truth["lever_arm_body_m"][order]),
        origin,
        rows,
    )
    count = max(1, math.ceil(float(times_s[-1]) / spacing_s))
    coefficients = np.empty((count + DEGREE, COLUMNS))
    fit_spline(times_s, rows, spacing_s, _SMOOTHING, coefficients)
    squares = rows * rows
    position = math.sqrt(math.fsum(squares[:, :3].ravel().tolist()) / len(rows))
    attitude = 2.0 * math.sqrt(math.fsum(squares[:, 3:].ravel().tolist()) / len(rows)) / _ARCSECOND
    note = (
        f"trajectory through {len(rows)} rows of truth, knots every {spacing_s:g} s: rms of what "
        f"is left {1e3 * position:.2g} mm, {attitude:.2g} arcsec"
    )
    offset_s = (start_ns - base_ns) / time.NS_PER_S
    motion = Splined(coefficients, origin, spacing_s, offset_s)
    return Recording(motion, start_ns, int(times_ns[-1]) - start_ns, note, digests)
