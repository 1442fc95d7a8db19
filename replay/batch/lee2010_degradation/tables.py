"""The table of the study: a row per run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgspec

from replay.batch.lee2010.tables import markdown_of
from replay.batch.lee2010_degradation.figures import ATTITUDE, POSITION, Row
from replay.batch.lee2010_degradation.members import ALONE, FITTED, SINGLE
from replay.batch.study import Done
from replay.evaluate.network_run import MeanStd
from replay.view.labels import NONE
from replay.view.markup import Table

_INDENT: Final = "\u00a0\u00a0"
_HEAD: Final = (
    "changed", "run",
    *(f"{name} [cm]" for name in POSITION),
    *(f"{name} [arcmin]" for name in ATTITUDE),
    "fixed [%]", "wrong [%]", "stations fixed [%]", "stations wrong", "before [cm]", "after [cm]",
)  # fmt: skip
_WORDS: Final = {
    SINGLE: "master alone",
    FITTED: "network, fitted",
    ALONE: "network, no IMU",
}


def words_of(variant: str) -> str:
    """How a run is called."""
    return _WORDS.get(variant, "network")


def table_of(rows: Sequence[Row]) -> Table:
    """The table."""
    lines: list[tuple[str, ...]] = []
    before: Row | None = None
    for row in rows:
        if before is None or row.sweep is not before.sweep:
            lines.append((row.sweep.title, *[""] * (len(_HEAD) - 1)))
        new = before is None or row.setting is not before.setting
        before = row
        fixed, wrong = row.shares
        stations = row.stations
        lines.append(
            (
                _INDENT + row.setting.text if new else "",
                words_of(row.variant),
                *(_pair(row.both(name)) for name in POSITION),
                *(_number(row.about_truth(name)) for name in ATTITUDE),
                f"{100.0 * fixed:.1f}",
                f"{100.0 * wrong:.1f}",
                f"{100.0 * stations[0]:.1f}" if stations else NONE,
                str(stations[1]) if stations else NONE,
                _number(row.residual_cm(after=False)),
                _number(row.residual_cm(after=True)),
            )
        )
    return Table(
        _HEAD,
        tuple(lines),
        caption="North, east, height: estimate less truth, mean by its size ± standard deviation."
        " Heading, pitch, roll: root mean square about truth. Fixed, wrong: epochs of the rover"
        " whose integers passed the test, and those of them with an integer that is not the"
        " simulated one, of all epochs. Stations: integers between reference stations that are"
        " fixed, of all rows, and how many rows are wrong. Before, after: rms of the rover's"
        " double-difference residuals on L1 without and with the corrections.",
        text_columns=2,
    )


def _pair(item: MeanStd | None) -> str:
    return NONE if item is None else f"{item.mean:.1f} ± {item.std:.1f}"


def _number(value: float | None) -> str:
    return NONE if value is None else f"{value:.1f}"


def to_markdown(table: Table) -> str:
    """The table as Markdown text."""
    return markdown_of(table) + "\n"


def to_json(rows: Sequence[Row], done: Sequence[Done], name: str) -> bytes:
    """The table, and every figure of every run, signs and all."""
    table = table_of(rows)
    content = {
        "study": name,
        "seeds": max(len(row.runs) for row in rows),
        "table": {
            "caption": table.caption,
            "head": list(table.head),
            "rows": [list(line) for line in table.rows],
        },
        "rows": [
            {
                "changed": row.sweep.title,
                "to": row.setting.text,
                "run": words_of(row.variant),
                "member": row.setting.member,
                "variant": row.variant,
                "distance_km": row.distance_km,
                "fixed": row.shares[0],
                "wrong": row.shares[1],
            }
            for row in rows
        ],
        "members": [
            {
                "member": item.member.label,
                "seed": item.member.number,
                "figures": {k: msgspec.to_builtins(v) for k, v in item.figures.items()},
                "losses": list(item.losses),
            }
            for item in done
        ],
    }
    return msgspec.json.format(msgspec.json.encode(content), indent=2) + b"\n"
