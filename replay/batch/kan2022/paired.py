"""Whether two runs of the same seeds differ: paired differences, their interval, their test."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy import stats

CONFIDENCE: Final = 0.95
_PAIR: Final = 2


@dataclasses.dataclass(frozen=True, slots=True)
class Paired:
    """Mean of the differences of pairs, with Student's interval.

    Attributes
    ----------
    count : int
        Pairs.
    mean : float
        Of first less second.
    low, high : float
        Of the mean, at 95 %; NaN of one pair.
    probability : float
        Of a mean as far from nought where there is no difference, two-sided; NaN of one pair.
    smaller : int
        Pairs whose first is the smaller.
    """

    count: int
    mean: float
    low: float
    high: float
    probability: float
    smaller: int


def paired(first: Sequence[float], second: Sequence[float]) -> Paired | None:
    """Compare values of the same seeds in the same order; None where there is no pair.

    Parameters
    ----------
    first, second : sequence of float
        As many of each; a pair with a NaN is left out.
    """
    difference = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    difference = difference[np.isfinite(difference)]
    count = len(difference)
    if count == 0:
        return None
    mean = float(np.mean(difference))
    smaller = int(np.count_nonzero(difference < 0.0))
    if count < _PAIR:
        return Paired(count, mean, np.nan, np.nan, np.nan, smaller)
    error = float(np.std(difference, ddof=1)) / np.sqrt(count)
    if error == 0.0:
        return Paired(count, mean, mean, mean, 1.0 if mean == 0.0 else 0.0, smaller)
    reach = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, count - 1)) * error
    probability = 2.0 * float(stats.t.sf(abs(mean) / error, count - 1))
    return Paired(count, mean, mean - reach, mean + reach, probability, smaller)


def holm(probabilities: Sequence[float]) -> list[float]:
    """Probabilities of several tests, adjusted after Holm (1979); NaN stays."""
    known = [(p, index) for index, p in enumerate(probabilities) if np.isfinite(p)]
    adjusted = [float("nan")] * len(probabilities)
    most = 0.0
    for rank, (probability, index) in enumerate(sorted(known)):
        most = max(most, min(1.0, (len(known) - rank) * probability))
        adjusted[index] = most
    return adjusted
