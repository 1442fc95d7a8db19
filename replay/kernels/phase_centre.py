"""What a simulated receiver's antenna truly adds to its ranges, as it is mounted and turns.

The stage `satellites` knows of a rover's antenna no more than that it points up. Here the
direction of the satellite is that in the antenna's own axes: on a pillar east, north, up,
on a vehicle right, forward, up of the body, so that offset and pattern lean and turn with
it. Sign and interpolation are those of :mod:`replay.kernels.antenna_pattern`.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.antenna_pattern import antenna_range
from replay.kernels.earth import enu_axes
from replay.kernels.elementary import sincos
from replay.kernels.rotation import cross3, rotate3, rotate3_back
from replay.kernels.sight import elevation_azimuth
from replay.kernels.types import Array, Record

_HALF_STEP_S: Final = 1e-3  # of the difference that makes the rate


@njit(cache=True)
def mount_on_body(poses: Array, axes: Array, turning: Array) -> None:
    """Axes of an antenna whose mark points forward on a body.

    Parameters
    ----------
    poses : array (e,) of POSE_DTYPE
    axes : float64 array (e, 3, 3)
        Written: rows right, forward, up of the body in ECEF.
    turning : float64 array (e, 3), rad/s, ECEF
        Written: of the body against the Earth.
    """
    for k in range(poses.shape[0]):
        C, w = poses[k]["C"], poses[k]["w_eb"]
        for i in range(3):
            axes[k, 0, i] = C[i, 1]
            axes[k, 1, i] = C[i, 0]
            axes[k, 2, i] = -C[i, 2]
        turning[k, 0], turning[k, 1], turning[k, 2] = rotate3(C, w[0], w[1], w[2])


@njit(cache=True)
def _added(pattern: Record, values: Array, axes: Array, ux: float, uy: float, uz: float) -> float:
    elevation, azimuth = elevation_azimuth(axes, ux, uy, uz)
    return float(antenna_range(pattern, values, elevation, azimuth, False))


@njit(cache=True)
def sight_directions(sights: Array, positions: Array, out: Array) -> None:
    """Unit vectors (e, 3) to the satellite in ECEF, where it is seen."""
    enu = np.empty((3, 3))
    for k in range(sights.shape[0]):
        if sights[k]["seen"] == 0:
            continue
        r = positions[k]
        enu_axes(r[0], r[1], r[2], enu)
        up, level = sincos(sights[k]["elevation"])
        across, along = sincos(sights[k]["azimuth"])
        out[k, 0], out[k, 1], out[k, 2] = rotate3_back(enu, level * across, level * along, up)


@njit(cache=True)
def antenna_terms(
    pattern: Record,
    values: Array,
    axes: Array,
    turning: Array,
    positions: Array,
    sights: Array,
    interval_s: float,
    out: Array,
) -> None:
    """What an antenna adds to the ranges to one satellite, and how fast that changes.

    Parameters
    ----------
    pattern : record of PATTERN_DTYPE
    values : float64 array, m
        Of all patterns.
    axes : float64 array (e, 3, 3)
        Rows of the antenna's axes in ECEF: to the right of its mark, along it, up.
    turning : float64 array (e, 3), rad/s, ECEF
        Of those axes against the Earth.
    positions : float64 array (e, 3), m, ECEF
        Of the antenna's reference point.
    sights : array (e,) of SIGHT_DTYPE
    interval_s : float, s
        Between epochs.
    out : float64 array (e, 2), m and m/s
        Written: 0 where the satellite is not seen. How fast the satellite itself crosses
        the sky is taken from the epochs beside; it counts for hundredths of a mm/s.
    """
    count = sights.shape[0]
    directions = np.empty((count, 3))
    sight_directions(sights, positions, directions)
    h = _HALF_STEP_S
    d = np.empty(3)
    for k in range(count):
        out[k, 0] = 0.0
        out[k, 1] = 0.0
        if sights[k]["seen"] == 0:
            continue
        u = directions[k]
        out[k, 0] = _added(pattern, values, axes[k], u[0], u[1], u[2])
        first = k - 1 if k > 0 and sights[k - 1]["seen"] != 0 else k
        last = k + 1 if k + 1 < count and sights[k + 1]["seen"] != 0 else k
        w = turning[k]
        t0, t1, t2 = cross3(w[0], w[1], w[2], u[0], u[1], u[2])
        d[0], d[1], d[2] = -t0, -t1, -t2
        if last > first:
            span = (last - first) * interval_s
            for i in range(3):
                d[i] += (directions[last, i] - directions[first, i]) / span
        after = _added(pattern, values, axes[k], u[0] + h * d[0], u[1] + h * d[1], u[2] + h * d[2])
        before = _added(pattern, values, axes[k], u[0] - h * d[0], u[1] - h * d[1], u[2] - h * d[2])
        out[k, 1] = (after - before) / (2.0 * h)
