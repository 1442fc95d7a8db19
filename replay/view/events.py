"""Events of a filter in words, for the timeline and for the page."""

from __future__ import annotations

import dataclasses

from replay.log.columns import Columns
from replay.view import labels
from replay.view.fields import doubles, integers, texts


@dataclasses.dataclass(frozen=True, slots=True)
class Event:
    """One event.

    Attributes
    ----------
    time_ns : int, GPS ns
    kind : str
    level : str
        INFO, WARN, ERROR or CRITICAL.
    value : float
        Unit in `detail`.
    detail : str
    """

    time_ns: int
    kind: str
    level: str
    value: float
    detail: str

    @property
    def text(self) -> str:
        """Kind and detail in one line; the value only where no detail tells it."""
        if self.detail:
            return f"{self.kind}: {self.detail}"
        return f"{self.kind} ({self.value:g})" if self.value else self.kind


def events_of(columns: Columns) -> list[Event]:
    """Rows of FilterEvent as events."""
    return [
        Event(time_ns, labels.event_kind(kind), labels.event_level(kind), value, text)
        for time_ns, kind, value, text in zip(
            columns.valid_time_ns.tolist(),
            integers(columns, "kind").tolist(),
            doubles(columns, "value").tolist(),
            texts(columns, "detail"),
            strict=True,
        )
    ]
