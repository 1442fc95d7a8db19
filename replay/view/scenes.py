"""Stretches of a drive that are worth a closer look: a curve, a crossroads, a covered street."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.evaluate.geometry import Floats
from replay.evaluate.satellites import ALL, satellite_counts
from replay.log.columns import Columns
from replay.time import NS_PER_S
from replay.view.fields import doubles
from replay.view.frame import LocalFrame

_MOVING_M_S: Final = 2.0
_STANDING_M_S: Final = 0.5
_CURVE_S: Final = 8
_CROSSROADS_S: Final = 50
_COVERED_S: Final = 30
_RADIUS_M: Final = 35.0  # shown around a scene's middle: errors of a metre are to be seen
_MOST_AROUND_S: Final = 60  # before and after the middle
_LEAST_TURN_RAD: Final = np.radians(30.0)
_LONGEST_STOP_S: Final = 15.0  # a longer stop is no better a crossroads
_LARGEST_TURN_RAD: Final = np.pi
_GAP_S: Final = 5.0
_FEWEST_ROWS: Final = 3
Times = npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, slots=True)
class Stretch:
    """A part of the drive.

    Attributes
    ----------
    title : str
    start_ns, end_ns : int, GPS ns
    """

    title: str
    start_ns: int
    end_ns: int


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Drive:
    """Truth once a second: place (n, 2) [m], speed (n,) [m/s] and heading [rad]."""

    start_ns: int
    place: Floats
    speed: Floats
    heading: Floats
    known: npt.NDArray[np.bool_]

    def around(self, title: str, middle: int) -> Stretch:
        """What lies near one second's place, from entering to leaving."""
        away = self.place - self.place[middle]
        out = np.flatnonzero(np.hypot(away[:, 0], away[:, 1]) > _RADIUS_M)
        before, after = out[out < middle], out[out > middle]
        first = max(0, middle - _MOST_AROUND_S, int(before[-1]) if len(before) else 0)
        end = len(self.speed) - 1
        last = min(end, middle + _MOST_AROUND_S, int(after[0]) if len(after) else end)
        return Stretch(title, self.start_ns + first * NS_PER_S, self.start_ns + last * NS_PER_S)


def choose_scenes(truth: Columns, geometry: Sequence[Columns]) -> list[Stretch]:
    """The sharpest curve, the stretch with most turning and standing, that with fewest satellites.

    Parameters
    ----------
    truth : Columns of replay.Truth
    geometry : sequence of Columns of replay.GnssGeometry
        Of the methods; those of the method that saw most satellites count.

    Returns
    -------
    list of Stretch
        In this order; what a drive does not have is not in it.
    """
    drive = _drive(truth)
    if drive is None:
        return []
    found: list[Stretch] = []
    taken = np.zeros(len(drive.speed), dtype=np.bool_)
    curve = _curve(drive)
    if curve is not None:
        found.append(drive.around("Curve", curve + _CURVE_S // 2))
        taken[curve : curve + _CURVE_S] = True
    crossroads = _crossroads(drive, taken)
    if crossroads is not None:
        within = slice(crossroads, crossroads + _CROSSROADS_S)
        turning = np.abs(np.diff(drive.heading[within]))
        found.append(drive.around("Crossroads", crossroads + int(np.argmax(turning))))
    covered = _covered(drive, geometry)
    if covered is not None:
        found.append(drive.around("Fewest satellites", covered + _COVERED_S // 2))
    return found


def _drive(truth: Columns) -> _Drive | None:
    position = doubles(truth, "position_ecef_m")
    rows = np.flatnonzero(np.isfinite(position).all(axis=1))
    if len(rows) < _FEWEST_ROWS:
        return None
    times = truth.valid_time_ns[rows]
    enu = LocalFrame.at(position[rows[0]]).enu(position[rows])
    seconds = (times - times[0]) / NS_PER_S
    grid = np.arange(0.0, np.floor(seconds[-1]) + 1.0)
    if len(grid) < _FEWEST_ROWS:
        return None
    place = np.column_stack([np.interp(grid, seconds, enu[:, axis]) for axis in range(2)])
    after = np.clip(np.searchsorted(seconds, grid), 1, len(seconds) - 1)
    known = (seconds[after] - seconds[after - 1]) <= _GAP_S
    velocity = np.gradient(place, axis=0)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    heading = np.arctan2(velocity[:, 0], velocity[:, 1])
    moving = speed > _MOVING_M_S
    if moving.any():  # a vehicle that stands keeps its heading
        last = np.maximum.accumulate(np.where(moving, np.arange(len(grid)), -1))
        heading = heading[np.maximum(last, int(np.argmax(moving)))]
    return _Drive(int(times[0]), place, speed, np.unwrap(heading), known)


def _sums(values: Floats, width: int) -> Floats:
    """Sums of `width` neighbours, (n - width + 1,)."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(total[width:] - total[:-width])


def _curve(drive: _Drive) -> int | None:
    """First second of the window with the largest change of heading while moving."""
    width = _CURVE_S
    if len(drive.speed) <= width:
        return None
    turn = np.abs(drive.heading[width:] - drive.heading[:-width])
    good = ((drive.speed > _MOVING_M_S) & drive.known).astype(np.float64)
    turn[_sums(good, width)[: len(turn)] < width] = 0.0
    best = int(np.argmax(turn))
    return best if turn[best] >= _LEAST_TURN_RAD else None


def _crossroads(drive: _Drive, taken: npt.NDArray[np.bool_]) -> int | None:
    """First second of the window with most standing and turning, both of which it must have."""
    width = _CROSSROADS_S
    if len(drive.speed) <= width:
        return None
    standing = _sums((drive.speed < _STANDING_M_S).astype(np.float64), width)
    turning = _sums(np.abs(np.diff(drive.heading, prepend=drive.heading[0])), width)
    score = (
        np.minimum(standing, _LONGEST_STOP_S) / _LONGEST_STOP_S
        + np.minimum(turning, _LARGEST_TURN_RAD) / _LARGEST_TURN_RAD
    )
    bad = (taken | ~drive.known).astype(np.float64)
    score[(standing < 1.0) | (turning < _LEAST_TURN_RAD) | (_sums(bad, width) > 0.0)] = 0.0
    best = int(np.argmax(score))
    return best if score[best] > 0.0 else None


def _covered(drive: _Drive, geometry: Sequence[Columns]) -> int | None:
    """First second of the moving window with fewest satellites; epochs without count as none."""
    known = [g for g in geometry if len(g)]
    if not known or len(drive.speed) <= _COVERED_S:
        return None
    totals = [satellite_counts(g)[ALL] for g in known]
    most = int(np.argmax([total.mean() for total in totals]))
    second = (known[most].valid_time_ns - drive.start_ns + NS_PER_S // 2) // NS_PER_S
    inside = (second >= 0) & (second < len(drive.speed))
    count = np.zeros(len(drive.speed))
    count[second[inside]] = totals[most][inside]
    interval = np.median(np.diff(known[most].valid_time_ns)) if len(known[most]) > 1 else NS_PER_S
    if interval > 1.5 * NS_PER_S:  # not an epoch for every second
        filled = np.maximum.accumulate(np.where(count > 0, np.arange(len(count)), 0))
        count = count[filled]
    moving = _sums((drive.speed > _MOVING_M_S).astype(np.float64), _COVERED_S)
    ends = np.flatnonzero(np.isin(np.arange(len(drive.speed)), second))
    total = _sums(count, _COVERED_S)
    total[moving < _COVERED_S / 2] = np.inf
    if len(ends):  # before the first epoch and after the last there is no receiver, not no sky
        total[: ends[0]] = np.inf
        total[max(ends[-1] - _COVERED_S + 1, 0) :] = np.inf
    best = int(np.argmin(total))
    return best if np.isfinite(total[best]) else None
