"""Random sequences that simulated sensors add: they too must be the same everywhere."""

from numba import njit

from replay.kernels.elementary import log, sincos, sqrt
from replay.kernels.types import Array


@njit(cache=True)
def normals(uniforms: Array, out: Array) -> None:
    """Standard normal numbers from uniform ones (Box and Muller 1958).

    Parameters
    ----------
    uniforms : float64 array (n, 2)
        In [0, 1).
    out : float64 array (n, 2)
        Written.
    """
    for n in range(uniforms.shape[0]):
        radius = sqrt(-2.0 * log(1.0 - uniforms[n, 0]))
        s, c = sincos(6.283185307179586 * uniforms[n, 1])
        out[n, 0] = radius * c
        out[n, 1] = radius * s


@njit(cache=True)
def gauss_markov(sigma: float, decay: float, drive: float, series: Array) -> None:
    """First-order Gauss-Markov sequences, in place of the standard normal numbers they grow from.

    Parameters
    ----------
    sigma : float
        Stationary standard deviation; the first row is drawn from it.
    decay : float
        Correlation of neighbours.
    drive : float
        Square root of one minus its square.
    series : float64 array (n, k)
        Standard normal numbers; overwritten by k independent sequences.
    """
    for j in range(series.shape[1]):
        value = series[0, j]
        series[0, j] = sigma * value
        for n in range(1, series.shape[0]):
            value = decay * value + drive * series[n, j]
            series[n, j] = sigma * value
