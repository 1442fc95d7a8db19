"""Local axes and attitudes as matrices, row by row of a channel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pymap3d

Floats = npt.NDArray[np.float64]


def enu_axes(ecef_m: Floats) -> Floats:
    """Matrices (n, 3, 3) whose rows are east, north and up in ECEF at points (n, 3), m."""
    if len(ecef_m) == 0:
        return np.empty((0, 3, 3))
    # One point comes back as plain numbers.
    latitude, longitude, _ = np.atleast_1d(
        *pymap3d.ecef2geodetic(ecef_m[:, 0], ecef_m[:, 1], ecef_m[:, 2], deg=False)
    )
    sin_lat, cos_lat = np.sin(latitude), np.cos(latitude)
    sin_lon, cos_lon = np.sin(longitude), np.cos(longitude)
    nought = np.zeros_like(sin_lat)
    east = np.stack([-sin_lon, cos_lon, nought], axis=-1)
    north = np.stack([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat], axis=-1)
    up = np.stack([cos_lat * cos_lon, cos_lat * sin_lon, sin_lat], axis=-1)
    return np.stack([east, north, up], axis=1)


def body_to_enu(attitude_rad: Floats) -> Floats:
    """Matrices (n, 3, 3) of roll, pitch, heading (n, 3), rad (Groves 2e, eq. 2.24, rows ENU)."""
    sin_r, sin_p, sin_h = np.sin(attitude_rad).T
    cos_r, cos_p, cos_h = np.cos(attitude_rad).T
    north = [
        cos_p * cos_h,
        sin_r * sin_p * cos_h - cos_r * sin_h,
        cos_r * sin_p * cos_h + sin_r * sin_h,
    ]
    east = [
        cos_p * sin_h,
        sin_r * sin_p * sin_h + cos_r * cos_h,
        cos_r * sin_p * sin_h - sin_r * cos_h,
    ]
    up = [sin_p, -sin_r * cos_p, -cos_r * cos_p]
    return np.stack([np.stack(row, axis=-1) for row in (east, north, up)], axis=1)


def turn(matrices: Floats, vectors: Floats) -> Floats:
    """Each vector (n, 3) turned by its matrix (n, 3, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))


def turn_back(matrices: Floats, vectors: Floats) -> Floats:
    """Each vector (n, 3) turned by the transpose of its matrix (n, 3, 3)."""
    return np.asarray(np.einsum("nji,nj->ni", matrices, vectors))


def symmetric(packed: Floats) -> Floats:
    """Upper triangles (n, 6) as matrices (n, 3, 3)."""
    return packed[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)


def wrapped(angles_rad: Floats) -> Floats:
    """Angles in [-pi, pi)."""
    return np.asarray(np.mod(angles_rad + np.pi, 2.0 * np.pi) - np.pi)
