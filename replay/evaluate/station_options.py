"""How a person says where a point stands still, and how it is to be measured."""

from __future__ import annotations

from typing import Final

from replay.configuration import to_si
from replay.errors import UsageError
from replay.evaluate.station import MEAN, Reference, StationOptions

_AXES: Final = 3
_LEAST_M: Final = 6.0e6  # from the Earth's centre, so that latitudes are not taken for metres
_MOST_M: Final = 7.0e6


def station_options(
    *, reference: str | None, limit: str, hold: str, start_up: str, session: str | None
) -> StationOptions:
    """Options of texts such as "10 cm" and "6 h".

    Raises
    ------
    UsageError
        For a text that says nothing of the kind.
    """
    return StationOptions(
        reference=None if reference is None else parse_reference(reference),
        limit_m=_positive(limit, "m", "limit"),
        hold_s=to_si(hold, "s", "hold"),
        start_up_s=to_si(start_up, "s", "start-up"),
        session_s=None if session is None else _positive(session, "s", "session"),
    )


def parse_reference(text: str) -> Reference:
    """`mean`, or three numbers with commas between them, metres, ECEF.

    Raises
    ------
    UsageError
        For anything else, and for a point that is not near the Earth's surface.
    """
    if text == MEAN:
        return "mean"
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != _AXES:
        raise UsageError(
            f"{text!r} is no place",
            mend="write --reference X,Y,Z in metres, ECEF, or --reference mean",
        )
    x, y, z = values
    if not _LEAST_M < (x * x + y * y + z * z) ** 0.5 < _MOST_M:
        raise UsageError(
            f"{text!r} is no place near the Earth's surface", mend="write metres, ECEF"
        )
    return x, y, z


def _positive(text: str, unit: str, name: str) -> float:
    value = to_si(text, unit, name)
    if not value > 0.0:
        raise UsageError(f"{name}: {text!r} is not above nought")
    return value
