"""Positions to ECEF and vectors between ECEF and local east, north, up.

Sines and cosines are those of the kernels, not numpy's: a log's digest must not
depend on the machine that imported it.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from replay.importers.table import Float64
from replay.kernels import earth
from replay.kernels.elementary import sincos


@dataclasses.dataclass(frozen=True, slots=True)
class Places:
    """Positions with the directions of their local axes.

    Attributes
    ----------
    ecef_m : float64 array (n, 3), m
    sin_lat, cos_lat, sin_lon, cos_lon : float64 array (n,)
    """

    ecef_m: Float64
    sin_lat: Float64
    cos_lat: Float64
    sin_lon: Float64
    cos_lon: Float64

    @classmethod
    def from_geodetic(cls, lat_rad: Float64, lon_rad: Float64, height_m: Float64) -> Places:
        """Places of geodetic WGS-84 coordinates; rows that are not finite give NaN."""
        out = np.full((len(lat_rad), 7), math.nan)
        rows = zip(lat_rad.tolist(), lon_rad.tolist(), height_m.tolist(), strict=True)
        for i, (lat, lon, height) in enumerate(rows):
            if math.isfinite(lat) and math.isfinite(lon) and math.isfinite(height):
                angles = (*sincos(lat), *sincos(lon))
                out[i] = (*earth.ecef_from_geodetic(*angles, height), *angles)
        return cls(np.ascontiguousarray(out[:, :3]), *(out[:, k].copy() for k in range(3, 7)))

    @classmethod
    def from_ecef(cls, ecef_m: Float64) -> Places:
        """Places of ECEF positions (n, 3), m; rows that are not finite give NaN."""
        out = np.full((len(ecef_m), 4), math.nan)
        for i, (x, y, z) in enumerate(ecef_m.tolist()):
            if math.isfinite(x) and math.isfinite(y) and math.isfinite(z):
                out[i] = earth.surface_normal(x, y, z)[:4]
        return cls(ecef_m, *(out[:, k].copy() for k in range(4)))

    def enu_to_ecef(self, enu: Float64) -> Float64:
        """East, north, up components (n, 3) as ECEF ones."""
        e, n, u = enu[:, 0], enu[:, 1], enu[:, 2]
        outward = self.cos_lat * u - self.sin_lat * n
        x = -self.sin_lon * e + self.cos_lon * outward
        y = self.cos_lon * e + self.sin_lon * outward
        z = self.cos_lat * n + self.sin_lat * u
        return np.stack([x, y, z], axis=1)

    def ecef_to_enu(self, ecef: Float64) -> Float64:
        """ECEF components (n, 3) as east, north, up ones."""
        x, y, z = ecef[:, 0], ecef[:, 1], ecef[:, 2]
        outward = self.cos_lon * x + self.sin_lon * y
        e = -self.sin_lon * x + self.cos_lon * y
        n = self.cos_lat * z - self.sin_lat * outward
        u = self.cos_lat * outward + self.sin_lat * z
        return np.stack([e, n, u], axis=1)


def gravity_reaction(roll_rad: Float64, pitch_rad: Float64, gravity_m_s2: float) -> Float64:
    """Specific force (n, 3) of a body at rest, forward, right, down: minus gravity in body axes."""
    out = np.empty((len(roll_rad), 3))
    for i, (roll, pitch) in enumerate(zip(roll_rad.tolist(), pitch_rad.tolist(), strict=True)):
        sine_roll, cosine_roll = sincos(roll)
        sine_pitch, cosine_pitch = sincos(pitch)
        out[i] = (sine_pitch, -sine_roll * cosine_pitch, -cosine_roll * cosine_pitch)
    return out * gravity_m_s2
