"""Differences between biases of codes as biases of single observations.

A clock of a satellite refers to an ionosphere-free pair of codes: relative to it that combination
of the pair has no bias. With this, a difference (DSB) between the two codes gives the bias of
each, and further differences those of other codes; where the log has the bias of an observation
itself (OSB), differences to it go on from there. Biases are subtracted from what was observed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.gnss.signals import frequency_hz
from replay.kernels.gnss_records import FIRST, SYSTEM_LETTERS
from replay.kernels.product_series import BIAS_DTYPE, observation_number

Array = npt.NDArray[Any]
Int64 = npt.NDArray[np.int64]
References = dict[str, tuple[str, str]]

REFERENCES: Final[Mapping[str, tuple[str, str]]] = {
    "G": ("C1W", "C2W"),
    "R": ("C1P", "C2P"),
    "E": ("C1C", "C5Q"),
    "C": ("C2I", "C6I"),
    "J": ("C1C", "C2L"),
}
"""Codes that clocks of the IGS refer to, where the products do not say."""

_REFER: Final = re.compile(r"clocks refer to ([A-Z]) (C\w\w) (C\w\w)")


def clock_references(details: Iterable[str]) -> References:
    """Codes that clocks refer to, by system, as details of `replay.ProductInfo` say."""
    found = dict(REFERENCES)
    for detail in details:
        for system, first, second in _REFER.findall(detail):
            found[system] = (first, second)
    return found


def single_biases(
    rows: Array, number: Int64, references: Mapping[str, tuple[str, str]]
) -> tuple[Array, Int64]:
    """Biases of observations alone: those that are given, and what differences add to them.

    Parameters
    ----------
    rows : array (n,) of BIAS_DTYPE
    number : int64 array (n,)
        Dense numbers of the satellites.
    references : mapping of a system's letter to two codes

    Returns
    -------
    tuple of array (m,) of BIAS_DTYPE, int64 array (m,)
        A bias that is given is never replaced. Differences that are joined neither to one nor
        to both codes that the clock refers to say nothing and are left out.
    """
    differences = rows["second"] != 0
    made: list[tuple[Any, ...]] = []
    made_of: list[int] = []
    for satellite in np.unique(number[differences]):
        own = rows[number == satellite]
        system = SYSTEM_LETTERS[int(np.searchsorted(FIRST, satellite, side="right")) - 1]
        pair = references.get(system)
        spans = dict.fromkeys(
            (int(row["t"]), int(row["until"])) for row in own if row["second"] != 0
        )
        for span in spans:
            given, edges = _within(own, span)
            for observation, value in _solve(given, edges, system, pair).items():
                if observation not in given:
                    made.append((*span, observation, 0, value, np.nan))
                    made_of.append(int(satellite))
    added = np.array(made, dtype=BIAS_DTYPE)
    kept = ~differences
    return (
        np.concatenate([rows[kept], added]),
        np.concatenate([number[kept], np.array(made_of, dtype=np.int64)]),
    )


def _within(
    own: Array, span: tuple[int, int]
) -> tuple[dict[int, float], dict[tuple[int, int], float]]:
    """Biases and differences of a satellite that are valid throughout a span."""
    whole = (own["t"] <= span[0]) & (
        (own["until"] == 0) | ((span[1] != 0) & (own["until"] >= span[1]))
    )
    given: dict[int, float] = {}
    edges: dict[tuple[int, int], float] = {}
    for row in own[whole]:
        first, second, value = int(row["first"]), int(row["second"]), float(row["value"])
        if second == 0:
            given[first] = value
        else:
            edges[first, second] = value
    return given, edges


def _solve(
    given: Mapping[int, float],
    edges: Mapping[tuple[int, int], float],
    system: str,
    pair: tuple[str, str] | None,
) -> dict[int, float]:
    """Biases of all observations that differences join to something known."""
    known = _spread(dict(given), edges)
    if pair is None:
        return known
    first, second = (observation_number(*code.encode()) for code in pair)
    if first in known or second in known:
        return known
    relative = _spread({first: 0.0}, edges)
    if second not in relative:
        return known
    squares = [frequency_hz(system, int(code[1])) ** 2 for code in pair]
    # Of the combination nothing is left: alpha b1 - (alpha - 1) b2 = 0 with b1 - b2 given.
    alpha = squares[0] / (squares[0] - squares[1])
    bias = (alpha - 1.0) * relative[second]
    return known | {code: value + bias for code, value in relative.items()}


def _spread(known: dict[int, float], edges: Mapping[tuple[int, int], float]) -> dict[int, float]:
    """What differences add to biases that are known; the first way that is found counts."""
    grown = True
    while grown:
        grown = False
        for (first, second), value in edges.items():
            if first in known and second not in known:
                known[second] = known[first] - value
                grown = True
            elif second in known and first not in known:
                known[first] = known[second] + value
                grown = True
    return known
