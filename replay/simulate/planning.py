"""From manoeuvres to pieces of smooth profiles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.configuration import STANDARD_GRAVITY_M_S2
from replay.errors import ConfigurationError
from replay.kernels import elementary
from replay.kernels.manoeuvres import PIECE_DTYPE, profile
from replay.kernels.trajectory import NODES, WEIGHTS
from replay.simulate.segments import (
    Attitude,
    Climb,
    Hold,
    LaneChange,
    Segment,
    Slope,
    Speed,
    Stop,
    Straight,
    Turn,
)

Records = npt.NDArray[np.void]

SPEED: Final = 0
HEADING: Final = 1
GRADE: Final = 2
ROLL: Final = 3
PITCH: Final = 4
YAW: Final = 5
_QUANTITIES: Final = 6
_LARGEST_TILT_RAD: Final = 1.2  # beyond, roll and heading become one
_PANELS: Final = 64  # of the integral over the bend of a climb
_LARGEST_LANE_CHANGE_RAD: Final = 0.5  # beyond, the sideways path is no offset any more
_SHORTEST_S: Final = 1e-9


class _Plan:
    """Pieces so far, and the values at their end."""

    def __init__(self, heading_rad: float, speed_m_s: float) -> None:
        self.time_s = 0.0
        self.values = [speed_m_s, heading_rad, 0.0, 0.0, 0.0, 0.0]
        self.pieces: list[tuple[float, float, list[float], list[float], list[float]]] = []

    def go_on(self, duration_s: float) -> None:
        """Change nothing."""
        self._add(duration_s, {}, {})

    def change(self, which: int, to: float, duration_s: float, ramp_s: float) -> None:
        """Bring a quantity to a value: its rate builds up, holds, and dies away."""
        self.change_all({which: to}, duration_s, ramp_s)

    def change_all(self, to: Mapping[int, float], duration_s: float, ramp_s: float) -> None:
        """Bring quantities to values at the same time."""
        rates = {
            which: (value - self.values[which]) / (duration_s - ramp_s)
            for which, value in to.items()
        }
        self._add(ramp_s, {}, rates)
        self._add(duration_s - 2.0 * ramp_s, rates, {})
        self._add(ramp_s, rates, {which: -rate for which, rate in rates.items()})
        for which, value in to.items():
            self.values[which] = value  # the sum of the pieces is a rounding off it

    def _add(
        self, duration_s: float, rates: Mapping[int, float], changes: Mapping[int, float]
    ) -> None:
        if duration_s < _SHORTEST_S:
            return
        rate = [rates.get(which, 0.0) for which in range(_QUANTITIES)]
        change = [changes.get(which, 0.0) for which in range(_QUANTITIES)]
        self.pieces.append((self.time_s, duration_s, list(self.values), rate, change))
        self.time_s += duration_s
        # A smoothstep covers half of its rectangle.
        for which in range(_QUANTITIES):
            self.values[which] += duration_s * (rate[which] + 0.5 * change[which])


def plan(
    segments: Iterable[Segment], heading_rad: float, repeat: int, speed_m_s: float = 0.0
) -> tuple[Records, float]:
    """Pieces of a motion that begins at rest or on a straight, level path.

    Parameters
    ----------
    segments : iterable of Segment
    heading_rad : float, rad
        At the start.
    repeat : int
        How often the segments are driven.
    speed_m_s : float, m/s
        At the start.

    Returns
    -------
    pieces : array of PIECE_DTYPE
    duration_s : float, s

    Raises
    ------
    ConfigurationError
        For a manoeuvre that cannot be driven from where the one before it ended.
    """
    made = _Plan(heading_rad, speed_m_s)
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
        case Stop():
            _stop(made, segment)
        case Turn():
            _turn(made, segment)
        case Slope(to=to, duration=duration):
            _positive(duration, "duration")
            made.change(GRADE, float(elementary.atan(to)), duration, 0.5 * duration)
        case Climb():
            _climb(made, segment)
        case Attitude():
            _change_attitude(made, segment)
        case LaneChange():
            _change_lane(made, segment)


def _change_speed(made: _Plan, segment: Speed) -> None:
    if segment.to < 0.0:
        raise ConfigurationError("the vehicle does not reverse", mend="write a speed of 0 or more")
    least = abs(segment.to - made.values[SPEED]) / _positive(segment.acceleration, "acceleration")
    if least > 0.0:
        ramp = min(_positive(segment.ramp, "ramp"), least)
        made.change(SPEED, segment.to, least + ramp, ramp)


def _stop(made: _Plan, segment: Stop) -> None:
    braking = Speed(kind="speed", to=0.0, acceleration=segment.acceleration, ramp=segment.ramp)
    _change_speed(made, braking)
    if segment.duration != 0.0:
        made.go_on(_positive(segment.duration, "duration"))


def _turn(made: _Plan, segment: Turn) -> None:
    speed = made.values[SPEED]
    if sum(value > 0.0 for value in (segment.radius, segment.duration, segment.bank)) != 1:
        raise ConfigurationError(
            "a turn has a radius or a duration or a bank", mend="give one of the three"
        )
    if speed == 0.0:
        raise ConfigurationError("a vehicle at rest does not turn", mend="accelerate before")
    if segment.bank > _LARGEST_TILT_RAD:
        raise ConfigurationError(
            f"bank is {math.degrees(segment.bank):g} deg",
            mend="a number alone is in rad; write '25 deg'",
        )
    to = made.values[HEADING] + segment.angle
    ramp = _positive(segment.ramp, "ramp")
    radius = segment.radius
    if segment.bank > 0.0:
        radius = speed * speed / (STANDARD_GRAVITY_M_S2 * float(elementary.tan(segment.bank)))
    if radius > 0.0:
        least = abs(segment.angle) * radius / speed
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


def _climb(made: _Plan, segment: Climb) -> None:
    speed = made.values[SPEED]
    if (segment.angle > 0.0) == (segment.rate > 0.0):
        raise ConfigurationError("a climb has an angle or a rate", mend="give one of the two")
    if made.values[GRADE] != 0.0 or speed == 0.0:
        raise ConfigurationError(
            "a climb begins in level flight", mend="put a slope segment to 0, or a speed, before"
        )
    ramp = _positive(segment.ramp, "ramp")
    angle = segment.angle
    if segment.rate > 0.0:
        if segment.rate >= speed:
            raise ConfigurationError(
                f"it climbs at {segment.rate:g} m/s but flies at {speed:g} m/s",
                mend="write a lower rate",
            )
        angle = float(elementary.asin(segment.rate / speed))
    if angle > _LARGEST_TILT_RAD:
        raise ConfigurationError(
            f"angle is {math.degrees(angle):g} deg", mend="a number alone is in rad; write '5 deg'"
        )
    if segment.height == 0.0:
        return
    bends = 2.0 * speed * ramp * _mean_rise(angle)
    steady = (abs(segment.height) - bends) / (speed * float(elementary.sin(angle)))
    if steady < 0.0:
        raise ConfigurationError(
            f"bending the path takes {bends:.1f} m of height, and {segment.height:g} m are wanted",
            mend="give it a smaller angle or rate, or a shorter ramp",
        )
    made.change(GRADE, math.copysign(angle, segment.height), ramp, 0.5 * ramp)
    if steady > 0.0:
        made.go_on(steady)
    made.change(GRADE, 0.0, ramp, 0.5 * ramp)


def _mean_rise(angle_rad: float) -> float:
    """Mean sine of a grade that goes from 0 to an angle as :meth:`_Plan.change` takes it."""
    bend = _Plan(0.0, 0.0)
    bend.change(GRADE, angle_rad, 1.0, 0.5)
    pieces = np.array(bend.pieces, dtype=PIECE_DTYPE)
    total = 0.0
    for panel in range(_PANELS):
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            t = (panel + node) / _PANELS
            grade = profile(pieces[int(t >= 0.5)], t, GRADE)[0]
            total += weight * float(elementary.sin(grade))
    return total / _PANELS


def _change_attitude(made: _Plan, segment: Attitude) -> None:
    duration = _positive(segment.duration, "duration")
    for name in ("roll", "pitch", "yaw"):
        angle = getattr(segment, name)
        limit = math.pi if name == "yaw" else _LARGEST_TILT_RAD
        if abs(angle) > limit:
            raise ConfigurationError(
                f"{name} is {math.degrees(angle):g} deg",
                mend=f"stay within {math.degrees(limit):.0f} deg; a number alone is in rad",
            )
    to = {ROLL: segment.roll, PITCH: segment.pitch, YAW: segment.yaw}
    made.change_all(to, duration, 0.5 * duration)


def _positive(value: float, name: str) -> float:
    if not value > 0.0:
        raise ConfigurationError(f"{name} is {value:g}", mend=f"write a {name} of more than 0")
    return value
