"""The page of the study: one picture, one table, and what was changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any, Final

from replay.batch.lee2010_degradation.figures import Row
from replay.batch.lee2010_degradation.picture import picture_chart
from replay.batch.lee2010_degradation.tables import table_of
from replay.batch.study import Done
from replay.view.markup import Table, figure, page, section

TITLE: Final = "A network of reference stations, degraded"
_ABOUT: Final = (
    "Case 1 after Lee (2010), Sensors 10, 9424, with one thing changed at a time: fewer reference"
    " stations, a greater distance of all of them, a rougher ionosphere, poorer inertial units,"
    " other methods of interpolation. The flight ends after its third line."
)
_STYLE: Final = (
    "<style>.runs td { white-space: nowrap } .runs table { font-size: 12px }"
    " .runs th, .runs td { padding-right: 8px }</style>"
)
_SAME: Final = (
    "Four stations, 58 km, the ionosphere of case 1, the tactical unit and the plane are one and"
    " the same run, which stands in each group. One station is the master alone, without"
    " corrections."
)
_FITTED: Final = (
    "“Network” has the settings of case 1, whatever the sky. “Fitted” knows what is true of the sky"
    " of case 1: how much the orbits' errors make between stations, and that errors change in"
    " proportion to the distance."
)


def report_html(rows: Sequence[Row], done: Sequence[Done], *, command: str) -> str:
    """The page as text."""
    chart = picture_chart(rows)
    parts = [
        _STYLE,
        f"<h1>{escape(TITLE)}</h1><p class='sub'>{escape(_ABOUT)} {escape(_span_said(rows))}</p>",
        section("Picture", [figure(chart, "Errors and fixed epochs along what is changed")]),
        section(
            "Table",
            [
                f"<p>{escape(_SAME)} {escape(_FITTED)} {escape(_seeds_said(rows))}</p>",
                f"<div class='dense runs'>{table_of(rows).html()}</div>",
            ],
        ),
        section("What was changed", [_members(done), _variants(done)]),
        section("How it was made", [f"<pre>{escape(command)}</pre>"]),
    ]
    return page(TITLE, "\n".join(parts))


def _seeds_said(rows: Sequence[Row]) -> str:
    count = max(len(row.runs) for row in rows)
    return "One seed." if count == 1 else f"Figures are means over {count} seeds."


def _span_said(rows: Sequence[Row]) -> str:
    first = rows[0].runs[0].network
    return (
        f"Figures are of the epochs of GNSS from {first.settling_s:g} s after the filter's"
        f" alignment to the end, {first.until_s:.0f} s after the first solution: {first.rows}"
        " epochs a run."
    )


def _members(done: Sequence[Done]) -> str:
    """What goes over the scenario of case 1 in each log, but for the flight's end."""
    rows: list[tuple[str, str]] = []
    for item in done:
        if item.member.number > 0:
            continue
        found = [text for table in item.member.tables for text in _told(table)]
        rows.append((item.member.label, ", ".join(found) or "nothing"))
    caption = "Logs: what goes over the scenario of case 1."
    return f"<div class='dense'>{Table(('log', 'settings'), tuple(rows), caption, 2).html()}</div>"


def _told(table: Mapping[str, Any], path: str = "") -> Iterator[str]:
    """Settings of a table; of a list of named tables those that are places."""
    for key, value in table.items():
        name = f"{path}{key}"
        if key == "segments" or name == "start.time":
            continue
        if isinstance(value, Mapping):
            yield from _told(value, f"{name}.")
        elif name == "receivers":
            for item in value:
                place = [item[axis] for axis in ("latitude", "longitude") if axis in item]
                if place:
                    yield f"{item['name']} at {' '.join(place)}"
        else:
            yield f"{name} = {value}"


def _variants(done: Sequence[Done]) -> str:
    known = {variant.name: variant for item in done for variant in item.member.variants}
    rows = tuple(
        (name, variant.pipeline, ", ".join(variant.settings)) for name, variant in known.items()
    )
    caption = "Runs over a log: pipeline, and what goes over its settings and the log's."
    table = Table(("run", "pipeline", "settings"), rows, caption, 3)
    return f"<div class='dense'>{table.html()}</div>"
