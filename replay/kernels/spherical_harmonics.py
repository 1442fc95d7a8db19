"""Spherical harmonics of a direction, as models of the atmosphere over the Earth use them."""

from numba import njit

from replay.kernels.types import Array


@njit(cache=True)
def spherical_harmonics(x: float, y: float, z: float, v: Array, w: Array) -> None:
    """Unnormalised harmonics of a direction: P_nm(z) times cosine and sine of m longitudes.

    By the recursions of Heiskanen and Moritz's functions (1967, eq. 1-62) in Cartesian form.

    Parameters
    ----------
    x, y, z : float
        Unit vector.
    v, w : float64 arrays (n + 1, n + 1)
        Filled on and below the diagonal: cosine and sine terms of degree and order.
    """
    top = v.shape[0] - 1
    v[0, 0], w[0, 0] = 1.0, 0.0
    for m in range(top + 1):
        if m > 0:
            v[m, m] = (2 * m - 1) * (x * v[m - 1, m - 1] - y * w[m - 1, m - 1])
            w[m, m] = (2 * m - 1) * (x * w[m - 1, m - 1] + y * v[m - 1, m - 1])
        if m < top:
            v[m + 1, m] = (2 * m + 1) * z * v[m, m]
            w[m + 1, m] = (2 * m + 1) * z * w[m, m]
        for n in range(m + 2, top + 1):
            v[n, m] = ((2 * n - 1) * z * v[n - 1, m] - (n + m - 1) * v[n - 2, m]) / (n - m)
            w[n, m] = ((2 * n - 1) * z * w[n - 1, m] - (n + m - 1) * w[n - 2, m]) / (n - m)
