"""From manoeuvres to a motion: pieces of smooth profiles, and what is exact along them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.errors import ConfigurationError
from replay.kernels import elementary
from replay.kernels.earth import ecef_from_geodetic
from replay.kernels.trajectory import (
    PIECE_DTYPE,
    POSE_DTYPE,
    new_motion,
    poses_at,
    sense_motion,
)
from replay.simulate.noise import Floats
from replay.simulate.segments import (
    Hold,
    LaneChange,
    Segment,
    Slope,
    Speed,
    Straight,
    Turn,
)

Records = npt.NDArray[np.void]

SPEED: Final = 0
HEADING: Final = 1
GRADE: Final = 2
_LARGEST_LANE_CHANGE_RAD: Final = 0.5  # beyond, the sideways path is no offset any more
_SHORTEST_S: Final = 1e-9


class _Plan:
    """Pieces so far, and the values at their end."""

    def __init__(self, heading_rad: float) -> None:
        self.time_s = 0.0
        self.values = [0.0, heading_rad, 0.0]
        self.pieces: list[tuple[float, float, list[float], list[float], list[float]]] = []

    def go_on(self, duration_s: float) -> None:
        """Change nothing."""
        self._add(duration_s, SPEED, 0.0, 0.0)

    def change(self, which: int, to: float, duration_s: float, ramp_s: float) -> None:
        """Bring a quantity to a value: its rate builds up, holds, and dies away."""
        rate = (to - self.values[which]) / (duration_s - ramp_s)
        self._add(ramp_s, which, 0.0, rate)
        self._add(duration_s - 2.0 * ramp_s, which, rate, 0.0)
        self._add(ramp_s, which, rate, -rate)
        self.values[which] = to  # the sum of the pieces is a rounding off it

    def _add(self, duration_s: float, which: int, rate: float, change: float) -> None:
        if duration_s < _SHORTEST_S:
            return
        rates, changes = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        rates[which], changes[which] = rate, change
        self.pieces.append((self.time_s, duration_s, list(self.values), rates, changes))
        self.time_s += duration_s
        # A smoothstep covers half of its rectangle.
        self.values[which] += duration_s * (rate + 0.5 * change)


def plan(segments: Iterable[Segment], heading_rad: float, repeat: int) -> tuple[Records, float]:
    """Pieces of a motion that begins at rest.

    Parameters
    ----------
    segments : iterable of Segment
    heading_rad : float, rad
        At the start.
    repeat : int
        How often the segments are driven.

    Returns
    -------
    pieces : array of PIECE_DTYPE
    duration_s : float, s

    Raises
    ------
    ConfigurationError
        For a manoeuvre that cannot be driven from where the one before it ended.
    """
    made = _Plan(heading_rad)
    numbered = list(enumerate(segments))
    for _ in range(repeat):
        for index, segment in numbered:
            try:
                _drive(made, segment)
            except ConfigurationError as error:
                raise ConfigurationError(
                    error.what, where=f"segments[{index}] ({segment.kind})", mend=error.mend
                ) from error
    return np.array(made.pieces, dtype=PIECE_DTYPE), made.time_s


def _drive(made: _Plan, segment: Segment) -> None:
    speed = made.values[SPEED]
    match segment:
        case Hold(duration=duration):
            if speed != 0.0:
                raise ConfigurationError(
                    f"the vehicle moves at {speed:g} m/s", mend="put a speed segment to 0 before"
                )
            made.go_on(_positive(duration, "duration"))
        case Straight(duration=duration):
            made.go_on(_positive(duration, "duration"))
        case Speed():
            _change_speed(made, segment)
        case Turn():
            _turn(made, segment)
        case Slope(to=to, duration=duration):
            _positive(duration, "duration")
            made.change(GRADE, float(elementary.atan(to)), duration, 0.5 * duration)
        case LaneChange():
            _change_lane(made, segment)


def _change_speed(made: _Plan, segment: Speed) -> None:
    if segment.to < 0.0:
        raise ConfigurationError("the vehicle does not reverse", mend="write a speed of 0 or more")
    least = abs(segment.to - made.values[SPEED]) / _positive(segment.acceleration, "acceleration")
    if least > 0.0:
        ramp = min(_positive(segment.ramp, "ramp"), least)
        made.change(SPEED, segment.to, least + ramp, ramp)


def _turn(made: _Plan, segment: Turn) -> None:
    speed = made.values[SPEED]
    if (segment.radius > 0.0) == (segment.duration > 0.0):
        raise ConfigurationError("a turn has a radius or a duration", mend="give one of the two")
    if speed == 0.0:
        raise ConfigurationError("a vehicle at rest does not turn", mend="accelerate before")
    to = made.values[HEADING] + segment.angle
    ramp = _positive(segment.ramp, "ramp")
    if segment.radius > 0.0:
        least = abs(segment.angle) * segment.radius / speed
        ramp = min(ramp, least)
        duration = least + ramp
    else:
        duration = segment.duration
        ramp = min(ramp, 0.5 * duration)
    if segment.angle != 0.0:
        made.change(HEADING, to, duration, ramp)


def _change_lane(made: _Plan, segment: LaneChange) -> None:
    speed = made.values[SPEED]
    duration = _positive(segment.duration, "duration")
    if speed == 0.0:
        raise ConfigurationError("a vehicle at rest does not change lanes", mend="accelerate")
    # Heading rises and falls along smoothsteps, so that its mean is half its largest value.
    swing = 2.0 * segment.offset / (speed * duration)
    if abs(swing) > _LARGEST_LANE_CHANGE_RAD:
        raise ConfigurationError(
            f"the lane change needs a swing of {math.degrees(swing):.0f} deg",
            mend="give it a longer duration, or a higher speed",
        )
    before = made.values[HEADING]
    made.change(HEADING, before + swing, 0.5 * duration, 0.25 * duration)
    made.change(HEADING, before, 0.5 * duration, 0.25 * duration)


def _positive(value: float, name: str) -> float:
    if not value > 0.0:
        raise ConfigurationError(f"{name} is {value:g}", mend=f"write a {name} of more than 0")
    return value


def ecef_of(latitude_rad: float, longitude_rad: float, height_m: float) -> Floats:
    """ECEF position (3,), m of geodetic coordinates."""
    sin_lat, cos_lat = elementary.sincos(latitude_rad)
    sin_lon, cos_lon = elementary.sincos(longitude_rad)
    return np.array(ecef_from_geodetic(sin_lat, cos_lat, sin_lon, cos_lon, height_m))


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """An exact motion and what perfect inertial sensors read along it.

    Attributes
    ----------
    pieces : array of PIECE_DTYPE
    lean : float64 array (2,), rad per m/s^2
        Roll per lateral, pitch per forward acceleration.
    interval_s : float, s
        Between inertial samples.
    positions : float64 array (n + 1, 3), m, ECEF
        At the start and at the end of every sample.
    rates : float64 array (n, 3), rad/s, body
        Mean angular rate relative to inertial space over each sample.
    forces : float64 array (n, 3), m/s^2, body
        Mean specific force over each sample.
    """

    pieces: Records
    lean: Floats
    interval_s: float
    positions: Floats
    rates: Floats
    forces: Floats

    @classmethod
    def drive(
        cls, pieces: Records, lean: Floats, start_ecef_m: Floats, interval_s: float, samples: int
    ) -> Trajectory:
        """Motion along pieces from a point, for a number of inertial samples."""
        positions = np.empty((samples + 1, 3))
        positions[0] = start_ecef_m
        rates, forces = np.empty((samples, 3)), np.empty((samples, 3))
        sense_motion(pieces, lean, interval_s, positions, rates, forces, new_motion())
        return cls(pieces, lean, interval_s, positions, rates, forces)

    def poses(self, times_s: Floats) -> np.ndarray[Any, Any]:
        """Poses (POSE_DTYPE) at ascending times since the start, s."""
        poses = np.zeros(len(times_s), dtype=POSE_DTYPE)
        poses_at(
            self.pieces, self.lean, self.interval_s, self.positions, times_s, new_motion(), poses
        )
        return poses

    def speeds(self) -> Floats:
        """Mean speed (n,), m/s over each sample."""
        step = self.positions[1:] - self.positions[:-1]
        squares = step * step
        return np.asarray(np.sqrt(squares[:, 0] + squares[:, 1] + squares[:, 2]) / self.interval_s)
