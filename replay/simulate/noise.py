"""Random numbers of a simulation: one stream per error source, the same on every machine.

Each source has a generator of its own, keyed by the seed and the source's name, so
that a source that is added shifts no other. Only integer-made uniform numbers come
from numpy; normal ones are made by the project's own arithmetic, because numpy's
take logarithms from a library that differs between machines.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from replay.draws import stream
from replay.kernels import elementary
from replay.kernels.noise import gauss_markov
from replay.kernels.noise import normals as normals_of_uniforms

Floats = npt.NDArray[np.float64]


def uniforms(seed: int, source: str, count: int) -> Floats:
    """Uniform numbers in [0, 1) of one source, shape (count,)."""
    return stream(f"{seed}:{source}").random(count)


def normals(seed: int, source: str, rows: int, columns: int = 3) -> Floats:
    """Standard normal numbers of one source, shape (rows, columns)."""
    pairs = (rows * columns + 1) // 2
    out = np.empty((pairs, 2))
    normals_of_uniforms(uniforms(seed, source, 2 * pairs).reshape(pairs, 2), out)
    return out.reshape(-1)[: rows * columns].reshape(rows, columns)


def correlated(
    seed: int, source: str, rows: int, *, sigma: float, tau_s: float, interval_s: float
) -> Floats:
    """Three first-order Gauss-Markov sequences of one source, shape (rows, 3).

    Parameters
    ----------
    seed : int
    source : str
    rows : int
    sigma : float
        Stationary standard deviation; 0 gives zeros.
    tau_s : float, s
        Correlation time, more than zero where `sigma` is.
    interval_s : float, s
        Between rows.
    """
    if sigma == 0.0 or rows == 0:
        return np.zeros((rows, 3))
    series = normals(seed, source, rows)
    decay = float(elementary.exp(-interval_s / tau_s))
    drive = math.sqrt(-float(elementary.expm1(-2.0 * interval_s / tau_s)))
    gauss_markov(sigma, decay, drive, series)
    return series
