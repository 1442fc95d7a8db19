"""Time the deterministic elementary functions against libm as numba calls it.

Run as ``python tools/bench/elementary.py``. Each function goes over the same 1e6 random arguments
in a compiled loop, ours and libm's in turn in one process; the best of the repeats counts.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from replay.kernels import elementary as el

Array = NDArray[np.float64]


def _loop(function: Callable[..., Any], arity: int) -> Callable[[Array, Array, Array], None]:
    """Return a compiled loop that applies `function` to each argument."""
    if arity == 1:

        @njit
        def loop1(x: Array, y: Array, out: Array) -> None:
            for i in range(x.size):
                out[i] = function(x[i])

        return loop1

    @njit
    def loop2(x: Array, y: Array, out: Array) -> None:
        for i in range(x.size):
            out[i] = function(x[i], y[i])

    return loop2


@njit
def _our_sincos(x: float) -> float:
    s, c = el.sincos(x)
    return s + c


@njit
def _libm_sincos(x: float) -> float:
    return math.sin(x) + math.cos(x)


@njit
def _libm_pow(x: float, y: float) -> float:
    return x**y


def _cases(n: int) -> list[tuple[str, str, Callable[..., Any], Callable[..., Any], Array, Array]]:
    """Return name, range, ours, libm's and the arguments of each comparison."""
    rng = np.random.default_rng(20240501)

    def span(low: float, high: float) -> Array:
        return rng.uniform(low, high, n)

    none = np.zeros(n)
    base = np.exp(span(math.log(1e-6), math.log(1e6)))
    return [
        ("sin", "±π", el.sin, math.sin, span(-math.pi, math.pi), none),
        ("sin", "±1e6", el.sin, math.sin, span(-1e6, 1e6), none),
        ("sin", "±1e15", el.sin, math.sin, span(-1e15, 1e15), none),
        ("cos", "±π", el.cos, math.cos, span(-math.pi, math.pi), none),
        ("sincos", "±π", _our_sincos, _libm_sincos, span(-math.pi, math.pi), none),
        ("tan", "±1.5", el.tan, math.tan, span(-1.5, 1.5), none),
        ("atan", "±3", el.atan, math.atan, span(-3, 3), none),
        ("atan2", "±1, ±1", el.atan2, math.atan2, span(-1, 1), span(-1, 1)),
        ("asin", "±1", el.asin, math.asin, span(-1, 1), none),
        ("acos", "±1", el.acos, math.acos, span(-1, 1), none),
        ("exp", "±20", el.exp, math.exp, span(-20, 20), none),
        ("expm1", "±1", el.expm1, math.expm1, span(-1, 1), none),
        ("log", "1e-6 to 1e6", el.log, math.log, base, none),
        ("log1p", "±0.9", el.log1p, math.log1p, span(-0.9, 0.9), none),
        ("pow", "1e±6, ±30", el.pow, _libm_pow, base, span(-30, 30)),
        ("pow", "0.1 to 1.1, 5.256", el.pow, _libm_pow, span(0.1, 1.1), np.full(n, 5.256)),
        ("hypot", "±1, ±1", el.hypot, math.hypot, span(-1, 1), span(-1, 1)),
    ]


def _best(
    loops: list[Callable[[Array, Array, Array], None]], x: Array, y: Array, repeats: int
) -> list[float]:
    """Return the shortest time of each loop in ns per element, the loops taken in turn."""
    out = np.empty_like(x)
    best = [math.inf] * len(loops)
    for loop in loops:
        loop(x, y, out)
    for _ in range(repeats):
        for i, loop in enumerate(loops):
            start = time.perf_counter()
            loop(x, y, out)
            best[i] = min(best[i], time.perf_counter() - start)
    return [b * 1e9 / x.size for b in best]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=1_000_000, help="arguments per function")
    parser.add_argument("-r", "--repeats", type=int, default=7)
    options = parser.parse_args()
    table = Table(title="Elementary functions, ns per call")
    for column in ("function", "arguments"):
        table.add_column(column)
    for column in ("ours", "libm", "ours/libm"):
        table.add_column(column, justify="right")
    for name, span, ours, libm, x, y in _cases(options.n):
        arity = 2 if name in ("atan2", "pow", "hypot") else 1
        a, b = _best([_loop(ours, arity), _loop(libm, arity)], x, y, options.repeats)
        table.add_row(name, span, f"{a:.2f}", f"{b:.2f}", f"{a / b:.2f}")
    Console().print(table)


if __name__ == "__main__":
    main()
