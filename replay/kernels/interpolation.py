"""From errors at reference stations to those at a rover: weights of the stations.

Every method makes the correction a weighted sum of the stations' errors, which are all against
the master; the master's own is zero. Coordinates are east and north of the master in its local
frame, the plane coordinates of Lee (2010). Over 150 km the plane shortens a distance by 1e-4
of it, and a rover 1 km higher stands 1.6e-4 of its distance further out: of errors of some
decimetres these parts are hundredths of a millimetre.

- Plane, "LIM" (Lee 2010, eqs 5 to 8): least squares for the slopes of a plane through the
  master.
- Linear combination, "LCM" (Han and Rizos 1996): of all sets of weights, the master's
  included, that sum to one and whose weighted mean of the stations is the rover's place, the
  one of least squares. It is a plane, too, but one that may miss the master's zero as it may
  miss the other stations' errors. With two stations both planes are the same one.
- Inverse distances, "DIM": what is nearer weighs more, the master included.
- Least-squares collocation, "LSC" (Raquet and Lachapelle 1998): the weights that are best for
  a field of given slope and curvature and stations of given deviations.

Where the stations stand on one line with the master, the slope across it is taken as zero,
which is the solution of least norm.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.types import Array

LIM: Final = 0
LCM: Final = 1
DIM: Final = 2
LSC: Final = 3

# Stations spread across a line by less than 1 % of what they are along it stand on it: a slope
# from so short a lever would multiply the stations' noise by a hundred.
_FLAT: Final = 1e-4
# m; nearer than this a rover is at the station.
_AT_STATION_M: Final = 1e-3
# m; no station's error is known better.
_LEAST_M: Final = 1e-4


@njit(cache=True)
def pseudo_inverse(a: float, b: float, c: float) -> tuple[float, float, float, int]:
    """Moore-Penrose inverse of [[a, b], [b, c]], positive semidefinite, and its rank.

    An eigenvalue of less than 1e-4 of the other is taken as zero.

    Returns
    -------
    tuple of three floats and an int
        Elements in the same order, and the rank.
    """
    half = 0.5 * (a + c)
    d = 0.5 * (a - c)
    root = sqrt(d * d + b * b)
    large = half + root
    if not large > 0.0:
        return 0.0, 0.0, 0.0, 0
    det = a * c - b * b
    # The small eigenvalue without the cancellation of half - root.
    small = det / large
    if small > _FLAT * large:
        return c / det, -b / det, a / det, 2
    # Eigenvector of the large one, from the row that does not cancel.
    if d >= 0.0:
        x, y = root + d, b
    else:
        x, y = b, root - d
    norm = x * x + y * y
    if not norm > 0.0:
        x, y, norm = 1.0, 0.0, 1.0
    scale = 1.0 / (norm * large)
    return x * x * scale, x * y * scale, y * y * scale, 1


@njit(cache=True)
def _plane_weights(place: Array, used: Array, east: float, north: float, weights: Array) -> int:
    a, b, c = 0.0, 0.0, 0.0
    for i in range(used.shape[0]):
        if used[i]:
            a += place[i, 0] * place[i, 0]
            b += place[i, 0] * place[i, 1]
            c += place[i, 1] * place[i, 1]
    ia, ib, ic, rank = pseudo_inverse(a, b, c)
    x = ia * east + ib * north
    y = ib * east + ic * north
    for i in range(used.shape[0]):
        weights[i] = x * place[i, 0] + y * place[i, 1] if used[i] else 0.0
    return rank


@njit(cache=True)
def _combination_weights(
    place: Array, used: Array, east: float, north: float, weights: Array
) -> None:
    """Equal weights, and what brings their mean from the middle of all stations to the rover."""
    count, mean_east, mean_north = 1.0, 0.0, 0.0
    for i in range(used.shape[0]):
        if used[i]:
            count += 1.0
            mean_east += place[i, 0]
            mean_north += place[i, 1]
    mean_east /= count
    mean_north /= count
    # The master stands at zero.
    a, b, c = mean_east * mean_east, mean_east * mean_north, mean_north * mean_north
    for i in range(used.shape[0]):
        if used[i]:
            x, y = place[i, 0] - mean_east, place[i, 1] - mean_north
            a += x * x
            b += x * y
            c += y * y
    ia, ib, ic, _ = pseudo_inverse(a, b, c)
    x, y = east - mean_east, north - mean_north
    p, q = ia * x + ib * y, ib * x + ic * y
    for i in range(used.shape[0]):
        weights[i] = 0.0
        if used[i]:
            weights[i] = 1.0 / count
            weights[i] += p * (place[i, 0] - mean_east) + q * (place[i, 1] - mean_north)


@njit(cache=True)
def _distance_weights(place: Array, used: Array, east: float, north: float, weights: Array) -> None:
    n = used.shape[0]
    total = 0.0
    nearest = -1
    d = sqrt(east * east + north * north)
    at_master = d < _AT_STATION_M
    if not at_master:
        total = 1.0 / d
    for i in range(n):
        weights[i] = 0.0
        if not used[i]:
            continue
        x, y = place[i, 0] - east, place[i, 1] - north
        d = sqrt(x * x + y * y)
        if d < _AT_STATION_M and nearest < 0:
            nearest = i
        elif d >= _AT_STATION_M:
            weights[i] = 1.0 / d
            total += weights[i]
    if at_master or nearest >= 0:
        for i in range(n):
            weights[i] = 1.0 if i == nearest and not at_master else 0.0
        return
    for i in range(n):
        weights[i] /= total


@njit(cache=True)
def station_weights(
    method: int, place: Array, used: Array, east: float, north: float, weights: Array
) -> None:
    """Weights of the stations' errors in the rover's.

    Parameters
    ----------
    method : int
        LIM, LCM or DIM.
    place : float64 array (n, 2), m
        East and north of the master.
    used : bool array (n,)
    east, north : float, m
        The rover, likewise.
    weights : float64 array (n,)
        Filled; zero for stations that are not used. What is missing to one is the master's.
    """
    if method == LIM:
        _plane_weights(place, used, east, north, weights)
    elif method == LCM:
        _combination_weights(place, used, east, north, weights)
    else:
        _distance_weights(place, used, east, north, weights)


@njit(cache=True)
def plane_misfit(place: Array, used: Array, errors: Array) -> float:
    """Root mean square of the stations' errors off the plane through the master.

    Parameters
    ----------
    place : float64 array (n, 2), m
    used : bool array (n,)
    errors : float64 array (n,), m

    Returns
    -------
    float, m
        Zero where the stations are no more than a plane needs.
    """
    a, b, c, p, q, count = 0.0, 0.0, 0.0, 0.0, 0.0, 0
    for i in range(used.shape[0]):
        if used[i]:
            x, y = place[i, 0], place[i, 1]
            a += x * x
            b += x * y
            c += y * y
            p += x * errors[i]
            q += y * errors[i]
            count += 1
    ia, ib, ic, rank = pseudo_inverse(a, b, c)
    if count <= rank:
        return 0.0
    slope_east = ia * p + ib * q
    slope_north = ib * p + ic * q
    total = 0.0
    for i in range(used.shape[0]):
        if used[i]:
            v = errors[i] - slope_east * place[i, 0] - slope_north * place[i, 1]
            total += v * v
    return sqrt(total / count)


@njit(cache=True)
def field_covariance(
    a_east: float, a_north: float, b_east: float, b_north: float, slope: float, curvature: float
) -> float:
    """Covariance (m^2) of the errors at two places, both against the master.

    Of a random field whose slopes have the deviation `slope` (m/m) and whose second
    derivatives have `curvature` (1/m), the same in all directions.
    """
    d = a_east * b_east + a_north * b_north
    return slope * slope * d + 0.5 * curvature * curvature * d * d


@njit(cache=True)
def _noise(i: int, j: int, sigmas: Array) -> float:
    """Covariance of what the filters of two stations do not know.

    Half of a variance is taken to be the master's, which all stations share.
    """
    part = 0.5 * sigmas[i] * sigmas[j]
    return 2.0 * part if i == j else part


@njit(cache=True)
def prediction_sigma(
    weights: Array, place: Array, used: Array, east: float, north: float, sigmas: Array,
    slope: float, curvature: float,
) -> float:  # fmt: skip
    """Deviation of a weighted sum of the stations' errors from the error at the rover.

    It has what the filters of the stations do not know, and what the weights cannot see of
    the field: slopes across a line of stations, or curvature between them.

    Parameters
    ----------
    weights : float64 array (n,)
    place : float64 array (n, 2), m
    used : bool array (n,)
    east, north : float, m
    sigmas : float64 array (n,), m
    slope, curvature : float
        As of :func:`field_covariance`.
    """
    total = field_covariance(east, north, east, north, slope, curvature)
    for i in range(weights.shape[0]):
        if not used[i]:
            continue
        x, y = place[i, 0], place[i, 1]
        total -= 2.0 * weights[i] * field_covariance(east, north, x, y, slope, curvature)
        for j in range(weights.shape[0]):
            if used[j]:
                k = field_covariance(x, y, place[j, 0], place[j, 1], slope, curvature)
                total += weights[i] * weights[j] * (k + _noise(i, j, sigmas))
    return sqrt(total) if total > 0.0 else 0.0


@njit(cache=True)
def collocation_weights(
    place: Array, used: Array, east: float, north: float, sigmas: Array, slope: float,
    curvature: float, weights: Array,
) -> None:  # fmt: skip
    """The weights whose :func:`prediction_sigma` is least: least-squares collocation.

    Parameters
    ----------
    As of :func:`prediction_sigma`; `weights` is filled.
    """
    n = used.shape[0]
    L, y = np.zeros((n, n)), np.zeros(n)
    for i in range(n):
        weights[i] = 0.0
        if not used[i]:
            L[i, i] = 1.0
            continue
        y[i] = field_covariance(east, north, place[i, 0], place[i, 1], slope, curvature)
        for j in range(i + 1):
            if used[j]:
                k = field_covariance(
                    place[i, 0], place[i, 1], place[j, 0], place[j, 1], slope, curvature
                )
                L[i, j] = k + _noise(i, j, sigmas)
                if i == j:
                    L[i, j] += _LEAST_M * _LEAST_M
    for i in range(n):
        for j in range(i + 1):
            value = L[i, j]
            for m in range(j):
                value -= L[i, m] * L[j, m]
            L[i, j] = sqrt(value) if i == j else value / L[j, j]
    for i in range(n):
        for m in range(i):
            y[i] -= L[i, m] * y[m]
        y[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        value = y[i]
        for m in range(i + 1, n):
            value -= L[m, i] * weights[m]
        weights[i] = value / L[i, i]
