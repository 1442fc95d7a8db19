"""What a simulated vehicle does, one manoeuvre after the other.

In a scenario each is a table of `[[segments]]` with its `kind`. Manoeuvres change
speed, course, grade or attitude from whatever they are, so that a list can be repeated.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, get_args

from replay.configuration import Section, build, quantity
from replay.errors import ConfigurationError


class Hold(Section, frozen=True):
    """Stand still."""

    kind: str
    duration: Annotated[float, quantity("s", "of standing")]


class Straight(Section, frozen=True):
    """Drive on as before."""

    kind: str
    duration: Annotated[float, quantity("s", "of driving")]


class Speed(Section, frozen=True):
    """Accelerate or brake to a speed."""

    kind: str
    to: Annotated[float, quantity("m/s", "speed at the end")]
    acceleration: Annotated[float, quantity("m/s^2", "largest, of either sign")] = 1.5
    ramp: Annotated[float, quantity("s", "in which the acceleration builds up")] = 1.0


class Stop(Section, frozen=True):
    """Brake to rest and stand."""

    kind: str
    duration: Annotated[float, quantity("s", "of standing; 0 goes on at once")] = 0.0
    acceleration: Annotated[float, quantity("m/s^2", "largest")] = 1.5
    ramp: Annotated[float, quantity("s", "in which the acceleration builds up")] = 1.0


class Turn(Section, frozen=True):
    """Turn by an angle: on a radius, in a time, or as a banked aircraft does."""

    kind: str
    angle: Annotated[float, quantity("rad", "to the right; negative is to the left")]
    radius: Annotated[float, quantity("m", "of the tightest part; 0: see the others")] = 0.0
    duration: Annotated[float, quantity("s", "of the turn; 0: see the others")] = 0.0
    bank: Annotated[float, quantity("rad", "whose coordinated turn it is; 0: see the others")] = 0.0
    ramp: Annotated[float, quantity("s", "in which the turn rate builds up")] = 1.0


class Slope(Section, frozen=True):
    """Come to a slope of the road and stay on it."""

    kind: str
    to: Annotated[float, quantity("1", "rise over run at the end; negative is down")]
    duration: Annotated[float, quantity("s", "of the change")]


class Climb(Section, frozen=True):
    """Climb or descend from level flight to level flight, at the same speed along the path."""

    kind: str
    height: Annotated[float, quantity("m", "gained; negative is a descent")]
    angle: Annotated[float, quantity("rad", "of the path, more than 0; 0: see rate")] = 0.0
    rate: Annotated[float, quantity("m/s", "of height, more than 0; 0: see angle")] = 0.0
    ramp: Annotated[float, quantity("s", "in which the path bends, at either end")] = 5.0


class Attitude(Section, frozen=True):
    """Turn the body to angles relative to its path, which stay; the path goes on as before."""

    kind: str
    duration: Annotated[float, quantity("s", "of the change")]
    roll: Annotated[float, quantity("rad", "at the end, right side down")] = 0.0
    pitch: Annotated[float, quantity("rad", "at the end, nose up")] = 0.0
    yaw: Annotated[float, quantity("rad", "at the end, to the right of the course")] = 0.0


class LaneChange(Section, frozen=True):
    """Move sideways and drive on in the direction of before."""

    kind: str
    offset: Annotated[float, quantity("m", "to the right; negative is to the left")]
    duration: Annotated[float, quantity("s", "of the change")]


Segment = Hold | Straight | Speed | Stop | Turn | Slope | Climb | Attitude | LaneChange

KINDS: Final[dict[str, type[Segment]]] = dict(
    zip(
        (
            "hold",
            "straight",
            "speed",
            "stop",
            "turn",
            "slope",
            "climb",
            "attitude",
            "lane_change",
        ),
        get_args(Segment),
        strict=True,
    )
)


def read_segments(tables: Any) -> tuple[Segment, ...]:
    """Segments of the tables of a scenario.

    Raises
    ------
    ConfigurationError
        For an unknown kind or key, a wrong type, no table at all.
    """
    if not isinstance(tables, list) or not tables:
        raise ConfigurationError(
            "a scenario needs segments", mend=f"write [[segments]] with a kind: {', '.join(KINDS)}"
        )
    return tuple(_read(table, f"segments[{index}]") for index, table in enumerate(tables))


def _read(table: Any, where: str) -> Segment:
    kind = table.get("kind") if isinstance(table, Mapping) else None
    if kind not in KINDS:
        raise ConfigurationError(
            f"no kind of segment: {kind!r}", where=where, mend=f"one of {', '.join(KINDS)}"
        )
    try:
        return build(KINDS[kind], [table])
    except ConfigurationError as error:
        raise ConfigurationError(error.what, where=f"{where} ({kind})", mend=error.mend) from error
