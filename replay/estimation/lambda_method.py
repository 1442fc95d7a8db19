"""LAMBDA: float ambiguities to integers, with what is needed to decide whether to believe them.

The arithmetic is in :mod:`replay.kernels.ambiguity` and :mod:`replay.kernels.ambiguity_search`.
All ambiguities are in cycles, and squared norms in the metric of the inverse covariance.
"""

from __future__ import annotations

import dataclasses
import enum
import math

import numpy as np
from numpy.typing import NDArray

from replay.kernels import ambiguity, ambiguity_search

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Most nodes of a search, about a second; up to 20 ambiguities it takes hundreds to thousands.
NODE_LIMIT = 100_000_000

_CHUNK = 4096
#: Failures that a simulated threshold rests on.
_LEAST_FAILURES = 10.0


class Status(enum.IntEnum):
    """How it went."""

    OK = ambiguity.OK
    NOT_POSITIVE_DEFINITE = ambiguity.NOT_POSITIVE_DEFINITE
    OUT_OF_RANGE = ambiguity.OUT_OF_RANGE
    """Too many ambiguities, too large or not a number, or a transform that outgrows its integers"""
    SEARCH_LIMIT = ambiguity.SEARCH_LIMIT
    """The search tree is too large. Of a strong model of more than some thirty ambiguities the best
    candidate is found at once, but the second is as hard as the shortest vector of a lattice: ask
    for one candidate and go by the success rate"""
    NO_SUBSET = ambiguity.NO_SUBSET
    """Not even the most precise combination has the success rate asked for"""


class Test(enum.Enum):
    """Statistics of the two best candidates; larger ones speak for the best."""

    __test__ = False  # not one of pytest's

    F_RATIO = "f-ratio"
    """Second squared norm over the best. With the float solution's own quadratic form added to
    both it is that of Frei and Beutler (1990), without that of Euler and Schaffrin (1991)"""
    DIFFERENCE = "difference"
    """Second squared norm less the best (Tiberius and de Jonge, 1995)"""
    W_RATIO = "w-ratio"
    """The difference over its standard deviation (Wang, Stewart and Tsakiri, 1998)"""
    FIXED_FAILURE_RATE = "fixed-failure-rate"
    """The ratio of squared norms, its threshold being that of :func:`failure_rate_threshold`
    (Verhagen and Teunissen, 2006)"""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What a search found.

    Attributes
    ----------
    status : Status
        Unless it is OK there are no candidates.
    norms : float64 array (p,)
        Squared norms of the candidates, ascending.
    separation : float
        Squared norm of the second candidate less the first, 0 where there is no second.
    success_rate, failure_rate : float
        Of bootstrapping what is fixed: a lower and an upper bound for integer least squares. NaN
        where the covariance is of no use.
    """

    status: Status
    norms: Floats
    separation: float
    success_rate: float
    failure_rate: float


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class IntegerSolution(Found):
    """All ambiguities as integers.

    Attributes
    ----------
    candidates : int64 array (p, n)
        Nearest first.
    adop : float
        Ambiguity dilution of precision [cycle].
    bootstrapped_bound : float
        Upper bound of the bootstrapped success rate, from the ADOP.
    least_squares_bound : float
        Upper bound of the success rate of integer least squares, from the ADOP.
    """

    candidates: Integers
    adop: float
    bootstrapped_bound: float
    least_squares_bound: float


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class PartialSolution(Found):
    """Some integer combinations of the ambiguities as integers.

    Attributes
    ----------
    combinations : int64 array (k, n)
        What is fixed: a filter may take `combinations @ a = values[0]` as a measurement.
    values : int64 array (p, k)
        Candidates, nearest first.
    ambiguities : float64 array (n,)
        The ambiguities given that the best candidate is right; the float ones where nothing is
        fixed.
    covariance : float64 array (n, n)
        Theirs; that of the float ones where nothing is fixed.
    """

    combinations: Integers
    values: Integers
    ambiguities: Floats
    covariance: Floats


@dataclasses.dataclass(frozen=True, slots=True)
class Validation:
    """Whether the best candidate is believed: where `statistic` reaches `threshold`."""

    test: Test
    statistic: float
    threshold: float
    accepted: bool


@dataclasses.dataclass(frozen=True, slots=True)
class RatioThreshold:
    """Threshold of the ratio test for a failure rate.

    Attributes
    ----------
    ratio : float
        Of the second squared norm to the best; 1 where every candidate may be believed.
    failure_rate : float
        Wrong candidates that were believed, as part of all samples.
    fix_rate : float
        Candidates that were believed, as part of all samples.
    success_rate : float
        Right best candidates, as part of all samples: the success rate of integer least squares.
        A rate p is uncertain by sqrt(p (1 - p) / samples).
    samples : int
    """

    ratio: float
    failure_rate: float
    fix_rate: float
    success_rate: float
    samples: int


def _checked(a: Floats, Q: Floats) -> tuple[Floats, Floats]:
    a = np.ascontiguousarray(a, np.float64)
    Q = np.ascontiguousarray(Q, np.float64)
    if a.ndim != 1 or not a.size:
        raise ValueError(f"the ambiguities must be a vector of one or more, not {a.shape}")
    if Q.shape != (a.size, a.size):
        raise ValueError(f"the covariance of {a.size} ambiguities cannot have the shape {Q.shape}")
    # A covariance that is not finite is for the kernels to refuse.
    if np.isfinite(Q).all() and float(np.abs(Q - Q.T).max()) > 1e-9 * float(np.abs(Q).max()):
        raise ValueError("the covariance is not symmetric")
    return a, Q


def resolve(
    a: Floats, Q: Floats, *, candidates: int = 2, node_limit: int = NODE_LIMIT
) -> IntegerSolution:
    """The integer vectors nearest to float ambiguities.

    Parameters
    ----------
    a : float64 array (n,)
        Float ambiguities, up to 64 and up to 2**31 cycles.
    Q : float64 array (n, n)
        Their covariance.
    candidates : int
        How many to find.
    node_limit : int
        Nodes of the search tree after which to give up.

    Returns
    -------
    IntegerSolution

    Raises
    ------
    ValueError
        Where shapes do not fit, the covariance is not symmetric or no candidates are asked for.
    """
    a, Q = _checked(a, Q)
    if candidates < 1:
        raise ValueError(f"cannot find {candidates} candidates")
    n = a.size
    fixed, norms = np.zeros((candidates, n), np.int64), np.empty(candidates)
    L, D = np.empty((n, n)), np.empty(n)
    Zt, inverse = np.empty((n, n), np.int64), np.empty((n, n), np.int64)
    code, separation = ambiguity_search.resolve(a, Q, node_limit, fixed, norms, L, D, Zt, inverse)
    status = Status(code)
    if status is not Status.OK:
        fixed, norms = fixed[:0], norms[:0]
    success = failure = dilution = upper = bound = math.nan
    if status in (Status.OK, Status.SEARCH_LIMIT):
        success = ambiguity.bootstrapped_success(D, 0)
        failure = ambiguity.bootstrapped_failure(D, 0)
        dilution = ambiguity.adop(D)
        upper = ambiguity.adop_success(dilution, n)
        bound = ambiguity.ils_success_bound(dilution, n)
    return IntegerSolution(
        status, norms, separation, success, failure, fixed, dilution, upper, bound
    )


def resolve_partial(
    a: Floats,
    Q: Floats,
    success_rate: float,
    *,
    candidates: int = 2,
    node_limit: int = NODE_LIMIT,
) -> PartialSolution:
    """Fix the largest decorrelated subset that has a bootstrapped success rate.

    Parameters
    ----------
    a, Q, candidates, node_limit
        As in :func:`resolve`.
    success_rate : float
        From 0, which fixes all, to 1.

    Returns
    -------
    PartialSolution

    Raises
    ------
    ValueError
        As in :func:`resolve`, or where `success_rate` is no probability.
    """
    a, Q = _checked(a, Q)
    if candidates < 1:
        raise ValueError(f"cannot find {candidates} candidates")
    if not 0.0 <= success_rate <= 1.0:
        raise ValueError(f"a success rate cannot be {success_rate}")
    n = a.size
    values, norms = np.zeros((candidates, n), np.int64), np.empty(candidates)
    conditional, covariance = np.empty(n), np.empty((n, n))
    L, D = np.empty((n, n)), np.empty(n)
    Zt, inverse = np.empty((n, n), np.int64), np.empty((n, n), np.int64)
    solution = (values, norms, conditional, covariance)
    code, first, separation = ambiguity_search.resolve_partial(
        a, Q, success_rate, node_limit, *solution, L, D, Zt, inverse
    )
    status = Status(code)
    if status is not Status.OK:
        nothing = np.zeros((0, n), np.int64)
        return PartialSolution(
            status, norms[:0], 0.0, math.nan, math.nan, nothing, nothing[:, :0], a.copy(), Q.copy()
        )
    return PartialSolution(
        status,
        norms,
        separation,
        ambiguity.bootstrapped_success(D, first),
        ambiguity.bootstrapped_failure(D, first),
        Zt[first:].copy(),
        values[:, first:].copy(),
        conditional,
        covariance,
    )


def validate(found: Found, test: Test, threshold: float, *, float_form: float = 0.0) -> Validation:
    """Test the best candidate against the second.

    Parameters
    ----------
    found : Found
        With two candidates or more, unless its status says that there are none: then nothing is
        accepted and the statistic is NaN.
    test : Test
    threshold : float
    float_form : float
        Quadratic form of the float solution's residuals, for the F-ratio.

    Returns
    -------
    Validation

    Raises
    ------
    ValueError
        Where there is one candidate only.
    """
    if found.status is not Status.OK:
        return Validation(test, math.nan, threshold, False)
    if found.norms.size < 2:
        raise ValueError("a test needs the two best candidates")
    best, second = float(found.norms[0]), float(found.norms[1])
    match test:
        case Test.F_RATIO:
            statistic = _over(float_form + second, float_form + best)
        case Test.FIXED_FAILURE_RATE:
            statistic = _over(second, best)
        case Test.DIFFERENCE:
            statistic = second - best
        case Test.W_RATIO:
            statistic = ambiguity_search.w_ratio(best, second, found.separation)
    return Validation(test, statistic, threshold, statistic >= threshold)


def _over(second: float, best: float) -> float:
    return second / best if best > 0.0 else math.inf


def failure_rate_threshold(
    Q: Floats,
    failure_rate: float,
    *,
    samples: int = 100_000,
    seed: int = 0,
    node_limit: int = NODE_LIMIT,
) -> RatioThreshold:
    """Threshold with which the ratio test believes a wrong candidate at most so often.

    Found by simulation of this covariance (Verhagen and Teunissen, 2013, "The ratio test for
    future GNSS ambiguity resolution", GPS Solutions 17), not from a table: floats are drawn around
    zero, and the threshold is the smallest with which no more than `failure_rate` of all samples
    are both wrong and believed. Depends on nothing but the arguments.

    Parameters
    ----------
    Q : float64 array (n, n)
    failure_rate : float
        Such as 0.001.
    samples : int
        At least ten times the inverse of `failure_rate`; it is then known to a third.
    seed : int
    node_limit : int
        For each sample.

    Returns
    -------
    RatioThreshold

    Raises
    ------
    ValueError
        Where there are too few samples, the covariance is not positive definite, or a search needs
        more nodes.
    """
    _, Q = _checked(np.zeros(len(Q)), Q)
    if not 0.0 < failure_rate < 1.0 or failure_rate * samples < _LEAST_FAILURES:
        raise ValueError(f"{samples} samples tell nothing of a failure rate of {failure_rate}")
    n = len(Q)
    L, D = np.empty((n, n)), np.empty(n)
    Zt, inverse = np.empty((n, n), np.int64), np.empty((n, n), np.int64)
    code = ambiguity.factorise(Q, L, D)
    if code == ambiguity.OK:
        code = ambiguity.reduce(L, D, Zt, inverse)
    ratio, right = np.empty(samples), np.empty(samples, np.bool_)
    generator = np.random.Generator(np.random.PCG64(seed))
    for start in range(0, samples, _CHUNK):
        if code != ambiguity.OK:
            break
        part = slice(start, min(start + _CHUNK, samples))
        uniform = generator.random((part.stop - start, n + n % 2))
        code = ambiguity_search.simulate(L, D, uniform, node_limit, ratio[part], right[part])
    if code != ambiguity.OK:
        raise ValueError(f"cannot simulate: {Status(code).name.lower().replace('_', ' ')}")
    wrong = np.sort(ratio[~right])
    allowed = math.floor(failure_rate * samples)
    # The first wrong one too many stays outside, whichever way a quotient is rounded.
    threshold = 1.0
    if wrong.size > allowed:
        threshold = max(1.0, (1.0 + 1e-12) / float(wrong[allowed]))
    believed = ratio * threshold <= 1.0
    return RatioThreshold(
        threshold,
        float(np.count_nonzero(believed & ~right)) / samples,
        float(np.count_nonzero(believed)) / samples,
        float(np.count_nonzero(right)) / samples,
        samples,
    )
