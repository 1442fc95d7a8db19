"""The first row of a channel that differs, and the rows around it."""

from __future__ import annotations

import numpy as np

from replay.diff.fields import EQUAL, WITHIN, FieldOutcome
from replay.diff.join import KINDS, LOG_TIME, Joined
from replay.diff.match import ABSENT
from replay.diff.result import (
    ContextRow,
    Divergence,
    RowKind,
    Side,
    finite,
)
from replay.diff.statistics import component_of, shown_value


def first_row(joined: Joined, *, beyond: bool, context: int) -> Divergence | None:
    """Find the first row that differs at all, or `beyond` tolerance, with `context` rows around.

    First is by log time: a smoother's early valid times are late knowledge.
    """
    rows = np.flatnonzero(joined.kinds > (WITHIN if beyond else EQUAL))
    if not len(rows):
        return None
    log_times = joined.log_times()[rows]
    row = int(rows[np.argmin(log_times)])
    log_time = int(log_times.min())
    kind = KINDS[joined.kinds[row]]
    if joined.alignment.matched[row]:
        return _of_matched(joined, row, log_time, kind, context)
    side = Side.B if joined.alignment.a[row] == ABSENT else Side.A
    name = _telling_field(joined)
    return Divergence(
        topic=joined.spec.topic,
        at=joined.place(row),
        log_time_ns=log_time,
        kind=kind,
        side=side,
        a=_text(joined, name, row, Side.A, None),
        b=_text(joined, name, row, Side.B, None),
        around=_around(joined, row, name, None, context),
    )


def _of_matched(joined: Joined, row: int, log_time: int, kind: RowKind, context: int) -> Divergence:
    index = _matched_index(joined, row)
    outcome = max(joined.outcomes.values(), key=lambda o: int(o.severity[index]))
    size = np.abs(outcome.difference[index])
    size = np.where(outcome.differs[index], np.where(np.isnan(size), np.inf, size), -1.0)
    k = int(np.argmax(size))
    part = component_of(joined, outcome, k)
    return Divergence(
        topic=joined.spec.topic,
        at=joined.place(row),
        log_time_ns=log_time,
        kind=kind,
        side=Side.BOTH,
        field=outcome.name,
        component=outcome.components[k],
        a=_text(joined, outcome.name, row, Side.A, part),
        b=_text(joined, outcome.name, row, Side.B, part),
        difference=finite(outcome.difference[index, k]),
        tolerance=finite(outcome.tolerance.absolute),
        unit=outcome.unit,
        around=_around(joined, row, outcome.name, (outcome, k), context),
    )


def _matched_index(joined: Joined, row: int) -> int:
    return int(np.count_nonzero(joined.alignment.matched[:row]))


def _telling_field(joined: Joined) -> str:
    """Choose the field that shows a one-sided row best: the first that has a tolerance."""
    fields = [name for name in joined.a.values if name in joined.b.values]
    judged = [name for name in fields if name in joined.spec.tolerances]
    free = [name for name in fields if name not in joined.spec.key]
    return (judged or free or [LOG_TIME])[0]


def _text(joined: Joined, name: str, row: int, side: Side, part: int | None) -> str:
    """Show a field of one run's row of the alignment; empty where the run has no such row."""
    rows, columns = (
        (joined.alignment.a, joined.a) if side is Side.A else (joined.alignment.b, joined.b)
    )
    index = int(rows[row])
    return "" if index == ABSENT else shown_value(joined, name, columns, index, part)


def _around(
    joined: Joined,
    row: int,
    name: str,
    judged: tuple[FieldOutcome, int] | None,
    context: int,
) -> list[ContextRow]:
    """Rows of the same key before and after; of events, which are few, rows of every key."""
    same_key = joined.alignment.key == joined.alignment.key[row]
    rows = (
        np.arange(len(same_key))
        if joined.kinds[row] == KINDS.index(RowKind.EVENT)
        else (np.flatnonzero(same_key))
    )
    here = int(np.searchsorted(rows, row))
    found = []
    for near in rows[max(0, here - context) : here + context + 1]:
        difference = None
        part = None
        if judged is not None:
            outcome, k = judged
            part = component_of(joined, outcome, k)
            if joined.alignment.matched[near]:
                difference = finite(outcome.difference[_matched_index(joined, near), k])
        found.append(
            ContextRow(
                at=joined.place(int(near)),
                kind=KINDS[joined.kinds[near]],
                a=_text(joined, name, int(near), Side.A, part),
                b=_text(joined, name, int(near), Side.B, part),
                difference=difference,
                here=bool(near == row),
            )
        )
    return found
