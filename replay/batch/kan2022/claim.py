"""The paper's claim put to the test: that a slower inertial unit drifts less.

Seeds are pairs: of one seed the motion, the observations and the unit's errors are the same, and
only what became of its samples differs. Integrated, a slow sample holds all that the fast ones
held; decimated, it holds one of them and its noise stands for all. If slowness itself helped,
both would drift less.

The paper's drift is the position difference at the end of an outage, which holds what PPP has not
converged from before it; an error of the outage may make that larger or smaller. What the
outage added is the difference at its end less that before it, and it is this that is judged.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Final

from replay.batch.kan2022.paired import Paired, holm, paired
from replay.batch.kan2022.plan import DECIMATE, INTEGRATE
from replay.batch.kan2022.runs import Kind, Runs, drift_sizes_cm

_SPATIAL: Final = 3  # column of the drift in space
_LEVEL: Final = 0.05
_FEW_SEEDS: Final = 2
_METRES_FROM_CM: Final = 200.0


@dataclasses.dataclass(frozen=True, slots=True)
class Comparison:
    """Drift of one kind less that of another.

    Attributes
    ----------
    first, second : Kind
    pair : Paired
        In cm.
    adjusted : float
        Probability after Holm, among all comparisons of a unit.
    """

    first: Kind
    second: Kind
    pair: Paired
    adjusted: float


def comparisons(runs: Runs, grade: str, *, added: bool = True) -> list[Comparison]:
    """Each slower rate against the log's own, and decimated against integrated.

    Parameters
    ----------
    runs : Runs
    grade : str
    added : bool
        Compare what the outages added; else the differences at their ends, as the paper has them.
    """
    kinds = runs.tight(grade, outage=True)
    if not kinds:
        return []
    fastest = kinds[0]
    pairs = [(kind, fastest) for kind in kinds[1:]]
    integrated = {kind.rate_hz: kind for kind in kinds if kind.method == INTEGRATE}
    pairs += [
        (kind, integrated[kind.rate_hz])
        for kind in kinds
        if kind.method == DECIMATE and kind.rate_hz in integrated
    ]
    found: list[tuple[Kind, Kind, Paired]] = []
    for first, second in pairs:
        values = [
            drift_sizes_cm(runs, kind, added=added)[:, _SPATIAL].tolist()
            for kind in (first, second)
        ]
        pair = paired(values[0], values[1])
        if pair is not None:
            found.append((first, second, pair))
    adjusted = holm([pair.probability for _, _, pair in found])
    return [Comparison(*item, p) for item, p in zip(found, adjusted, strict=True)]


def claim_said(runs: Runs, grade: str) -> str:
    """What the comparisons say of the claim."""
    found = comparisons(runs, grade)
    if not found:
        return ""
    if len(runs.seeds) < _FEW_SEEDS:
        return "One seed tells nothing of the claim: a difference may be chance."
    parts: list[str] = []
    against_fastest = [item for item in found if item.second.rate_hz > item.first.rate_hz]
    slower: dict[str, list[Comparison]] = {}
    for method, words in ((INTEGRATE, "integrated"), (DECIMATE, "decimated")):
        own = [item for item in against_fastest if item.first.method == method]
        if own:
            less = [item for item in own if _less(item)]
            slower[method] = less
            more = [item for item in own if _more(item)]
            rest = [item for item in own if item not in less and item not in more]
            parts.append(
                f"With samples {words},"
                f" {_rates(less, f'drift less than {own[0].second.rate_hz} Hz')},"
                f" {_rates(more, 'drift more')}{_rest(rest)}."
            )
    own = [item for item in found if item.second.rate_hz == item.first.rate_hz]
    more = [item for item in own if _more(item)]
    less = [item for item in own if _less(item)]
    if own:
        parts.append(
            f"Decimated against integrated at the same rate: {_rates(more, 'drift more')},"
            f" {_rates(less, 'drift less')}."
        )
    dropped = [item for item in found if item.first.method == DECIMATE and _more(item)]
    parts.append(_verdict(slower, dropping_harms=bool(dropped)))
    return " ".join(parts)


def _less(item: Comparison) -> bool:
    return item.pair.mean < 0.0 and item.adjusted < _LEVEL


def _more(item: Comparison) -> bool:
    return item.pair.mean > 0.0 and item.adjusted < _LEVEL


def _rates(items: list[Comparison], does: str) -> str:
    if not items:
        return f"none of the rates is shown to {does}"
    rates = _listed([f"{item.first.rate_hz} Hz" for item in items])
    by = _listed([_size(abs(item.pair.mean)) for item in items])
    return f"{rates} {does} (by {by})"


def _rest(items: list[Comparison]) -> str:
    """The widest interval, so that "not shown" is not read as "equal"."""
    bounds = [abs(v) for i in items for v in (i.pair.low, i.pair.high) if math.isfinite(v)]
    if not bounds:
        return ""
    whose = _listed([f"{item.first.rate_hz} Hz" for item in items])
    return (
        f"; the mean difference of {whose} lies within {_size(max(bounds))} of nought (95 %),"
        " whichever its sign"
    )


def _size(value_cm: float) -> str:
    """A length as a person takes it in."""
    if value_cm >= _METRES_FROM_CM:
        return f"{value_cm / 100.0:.1f} m"
    return f"{value_cm:.1f} cm" if value_cm >= 1.0 else f"{10.0 * value_cm:.1f} mm"


def _listed(words: list[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def _verdict(slower: dict[str, list[Comparison]], *, dropping_harms: bool) -> str:
    integrated, decimated = bool(slower.get(INTEGRATE)), bool(slower.get(DECIMATE))
    if integrated and decimated:
        return "Slower samples drift less either way, so the paper's effect is seen here."
    if integrated:
        return "Slower samples drift less where they are integrated, not where they are dropped."
    if decimated:
        return (
            "Slower samples drift less only where samples are dropped: an effect of how that is"
            " done, not of the rate."
        )
    said = "That a slower unit drifts less is not seen, in whatever way samples are made fewer."
    if dropping_harms:
        said += (
            " What the way does is the opposite: dropped samples take with them what the unit felt"
            " between those that stay, and the drift grows."
        )
    return said + (
        " The paper has one drive and two outages, which do not tell the effect of a rate from"
        " chance."
    )
