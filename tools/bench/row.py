"""One line of the summary: a capability, what it costs, what a peer costs."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

from rich.table import Table


@dataclasses.dataclass(frozen=True, slots=True)
class Row:
    """A measured capability.

    Attributes
    ----------
    capability : str
    ours, peer : str
        With unit; the peer by name, or empty.
    ratio : float or None
        How many times better than the peer, unless the capability says otherwise.
    aim : str
        As a person reads it, or empty.
    met : bool or None
        None where there is no aim.
    """

    capability: str
    ours: str
    peer: str = ""
    ratio: float | None = None
    aim: str = ""
    met: bool | None = None


def speed_row(
    capability: str, unit: str, ours: float, peer: float, peer_name: str, least_ratio: float
) -> Row:
    """A row about two speeds, larger ones being better."""
    return Row(
        capability,
        f"{_short(ours)} {unit}",
        f"{peer_name}: {_short(peer)} {unit}",
        ours / peer,
        f"ratio ≥ {least_ratio:g}",
        ours / peer >= least_ratio,
    )


def summary(rows: Iterable[Row]) -> Table:
    """The table that everything ends in."""
    table = Table(title="Summary", title_justify="left")
    for name in ("capability", "ours", "peer", "ratio", "aim", "met?"):
        table.add_column(name, justify="right" if name == "ratio" else "left", overflow="fold")
    for row in rows:
        ratio = "" if row.ratio is None else f"{row.ratio:.3g}"
        met = {True: "[green]yes[/]", False: "[bold red]no[/]", None: ""}[row.met]
        table.add_row(row.capability, row.ours, row.peer, ratio, row.aim, met)
    return table


def _short(value: float) -> str:
    for factor, prefix in ((1e6, "M"), (1e3, "k")):
        if value >= factor:
            return f"{value / factor:.3g} {prefix}"
    return f"{value:.3g} "
