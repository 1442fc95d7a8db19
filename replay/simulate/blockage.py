"""Which satellites are hidden, weakened or reflected, satellite by satellite and epoch by epoch."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from replay import time
from replay.kernels import elementary, tracking
from replay.simulate.noise import Floats, uniforms
from replay.simulate.sky import Blockage

Ints = npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What stands between a receiver and one satellite.

    Attributes
    ----------
    states : int64 array (e,)
        BLOCKED, DIRECT or REFLECTED of :mod:`replay.kernels.tracking`.
    losses : float64 array (e,), dB
    """

    states: Ints
    losses: Floats


def surroundings(
    blockages: Sequence[Blockage],
    receiver: str,
    seed: int,
    elapsed_ns: Ints,
    headings: Floats,
    sights: Mapping[str, npt.NDArray[np.void]],
) -> dict[str, Surroundings]:
    """Surroundings of every satellite.

    Parameters
    ----------
    blockages : sequence of Blockage
        Those of this receiver.
    receiver : str
    seed : int
    elapsed_ns : int64 array (e,)
        Epochs since the start.
    headings : float64 array (e,), rad
        Of the road.
    sights : mapping of satellite to array (e,) of SIGHT_DTYPE
    """
    count = len(elapsed_ns)
    found = {
        name: Surroundings(np.full(count, tracking.DIRECT, dtype=np.int64), np.zeros(count))
        for name in sights
    }
    for index, blockage in enumerate(blockages):
        if blockage.kind in ("canyon", "trees"):
            _beside(
                blockage, f"{receiver}.blockage{index}", seed, elapsed_ns, headings, sights, found
            )
            continue
        for rows in _spans(blockage, elapsed_ns):
            for name in _hidden(blockage, rows, sights):
                found[name].states[rows] = tracking.BLOCKED
    return found


def _spans(blockage: Blockage, elapsed_ns: Ints) -> Iterator[slice]:
    """Epochs of each time that a blockage comes."""
    last = int(elapsed_ns[-1]) if len(elapsed_ns) else -1
    begin, end = (round(t * time.NS_PER_S) for t in (blockage.begin, blockage.end))
    every = round(blockage.every * time.NS_PER_S)
    while begin <= last:
        rows = slice(*np.searchsorted(elapsed_ns, [begin, end]).tolist())
        if rows.stop > rows.start:
            yield rows
        if every == 0:
            return
        begin, end = begin + every, end + every


def _hidden(blockage: Blockage, rows: slice, sights: Mapping[str, Any]) -> list[str]:
    """Satellites that a roof or an outage takes, by where they are when it begins."""
    first = rows.start
    seen = sorted(
        (float(table["elevation"][first]), name)
        for name, table in sights.items()
        if table["seen"][first]
    )
    if blockage.kind == "outage":
        seen.reverse()
    kept = {name for _, name in seen[: blockage.keep]}
    return [name for name in sights if name not in kept]


def _beside(
    blockage: Blockage,
    source: str,
    seed: int,
    elapsed_ns: Ints,
    headings: Floats,
    sights: Mapping[str, Any],
    found: Mapping[str, Surroundings],
) -> None:
    """Put walls or trees beside the road."""
    inside = np.zeros(len(elapsed_ns), dtype=np.uint8)
    for rows in _spans(blockage, elapsed_ns):
        inside[rows] = 1
    trees = blockage.kind == "trees"
    for name, table in sights.items():
        tracking.obstruct(
            table,
            inside,
            headings,
            float(elementary.tan(blockage.left)),
            float(elementary.tan(blockage.right)),
            blockage.loss_db if trees else 0.0,
            0.0 if trees else blockage.reflected,
            uniforms(seed, f"{source}.{name}", len(elapsed_ns)),
            found[name].states,
            found[name].losses,
        )
