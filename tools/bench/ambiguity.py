"""Time ambiguity resolution against RTKLIB's LAMBDA (pyrtklib) on the same problems.

Run as ``python tools/bench/ambiguity.py``. Each problem is a set of double differences of carrier
phases: a position known to some decimetres, phases to millimetres. Both sides get prepared arrays
and look for the two best candidates; of the repeats, one side in turn with the other, the best
counts. The last columns say whether all integers agree, and how many problems were left out because
RTKLIB gave up on them after its 10 000 nodes; ours solved those too.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyrtklib
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from replay.estimation import lambda_method
from replay.kernels import ambiguity_search

Floats = NDArray[np.float64]
Problem = tuple[Floats, Floats]

#: Wavelength of L1 [m].
_WAVELENGTH = 0.1903
_NODES = 10_000_000
_rtklib_lambda = getattr(pyrtklib, "lambda")


def problem(rng: np.random.Generator, n: int, position: float, phase: float) -> Problem:
    """Float ambiguities and their covariance.

    Parameters
    ----------
    rng : Generator
    n : int
    position, phase : float
        Standard deviations [m].
    """
    sight = rng.normal(size=(n + 1, 3))
    sight /= np.linalg.norm(sight, axis=1)[:, None]
    geometry = position * (sight[1:] - sight[0]) / _WAVELENGTH
    noise = (phase / _WAVELENGTH) ** 2 * (np.eye(n) + 1.0)
    Q = geometry @ geometry.T + noise
    Q = 0.5 * (Q + Q.T)
    return rng.integers(-1000, 1000, n) + np.linalg.cholesky(Q) @ rng.normal(size=n), Q


class Ours:
    """The kernel, with its arrays at hand."""

    def __init__(self, n: int) -> None:
        self.fixed, self.norms = np.empty((2, n), np.int64), np.empty(2)
        self.work = (np.empty((n, n)), np.empty(n))
        self.integers = (np.empty((n, n), np.int64), np.empty((n, n), np.int64))

    def __call__(self, a: Floats, Q: Floats) -> None:
        """Resolve."""
        status, _ = ambiguity_search.resolve(
            a, Q, _NODES, self.fixed, self.norms, *self.work, *self.integers
        )
        assert status == 0


class Rtklib:
    """RTKLIB's `lambda` on its own arrays."""

    def __init__(self, a: Floats, Q: Floats) -> None:
        n = a.size
        self.n = n
        self.a, self.Q = pyrtklib.Arr1Ddouble(n), pyrtklib.Arr1Ddouble(n * n)
        for i in range(n):
            self.a[i] = float(a[i])
        for i, value in enumerate(Q.ravel()):
            self.Q[i] = float(value)
        self.fixed, self.norms = pyrtklib.Arr1Ddouble(2 * n), pyrtklib.Arr1Ddouble(2)

    def __call__(self) -> bool:
        """Resolve; False after RTKLIB's 10 000 nodes."""
        code: int = _rtklib_lambda(self.n, 2, self.a, self.Q, self.fixed, self.norms)
        return code == 0

    def integers(self) -> list[int]:
        """Both candidates."""
        return [round(self.fixed[i]) for i in range(2 * self.n)]


def seconds(run: Callable[[], None]) -> float:
    """Time of one run."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--problems", type=int, default=100)
    options = parser.parse_args()
    table = Table(title="Two best integer vectors, µs a problem, best of the repeats")
    for name in (
        "ambiguities",
        "position, phase",
        "kernel",
        "front end",
        "RTKLIB",
        "ratio",
        "same",
        "refused",
    ):
        table.add_column(name, justify="right")
    for n, position, phase in (
        (6, 0.5, 0.003),
        (12, 0.5, 0.003),
        (20, 0.5, 0.003),
        (20, 0.5, 0.006),
    ):
        rng = np.random.default_rng(n)
        ours = Ours(n)
        problems: list[Problem] = []
        theirs: list[Rtklib] = []
        same, refused = True, 0
        while len(problems) < options.problems and refused < 10 * options.problems:
            a, Q = problem(rng, n, position, phase)
            ours(a, Q)
            peer = Rtklib(a, Q)
            if not peer():
                refused += 1
                continue
            same &= ours.fixed.ravel().tolist() == peer.integers()
            problems.append((a, Q))
            theirs.append(peer)
        best = [1e9, 1e9, 1e9]

        def kernel(ours: Ours = ours, problems: list[Problem] = problems) -> None:
            for a, Q in problems:
                ours(a, Q)

        def front(problems: list[Problem] = problems) -> None:
            for a, Q in problems:
                lambda_method.resolve(a, Q)

        def rtklib(theirs: list[Rtklib] = theirs) -> None:
            for peer in theirs:
                peer()

        for _ in range(options.repeats):
            for side, run in enumerate((kernel, front, rtklib)):
                best[side] = min(best[side], seconds(run))
        cost = [1e6 * value / len(problems) for value in best]
        table.add_row(
            str(n),
            f"{position:g} m, {1e3 * phase:g} mm",
            *(f"{value:.1f}" for value in cost),
            f"{cost[2] / cost[0]:.1f}",
            "yes" if same else "[red]no[/]",
            str(refused),
        )
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
