"""Where things are: ECEF, geodetic and local east-north-up, all vectorised.

Attitude is roll, pitch, heading: turned in the order heading, pitch, roll they
take north-east-down axes into body axes (forward, right, down).
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pymap3d

from replay.evaluate.geometry import Floats, body_to_enu, enu_axes, symmetric


def geodetic(ecef_m: Floats) -> Floats:
    """ECEF to WGS 84 geodetic coordinates.

    Parameters
    ----------
    ecef_m : array (n, 3), m

    Returns
    -------
    array (n, 3)
        Latitude [deg], longitude [deg], height above the ellipsoid [m].
    """
    if len(ecef_m) == 0:
        return np.empty((0, 3))
    return np.column_stack(pymap3d.ecef2geodetic(ecef_m[:, 0], ecef_m[:, 1], ecef_m[:, 2]))


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class LocalFrame:
    """East, north, up on the plane that touches the ellipsoid's normal at one point.

    Attributes
    ----------
    origin_ecef_m : array (3,), m
    origin_geodetic : array (3,)
        Latitude [deg], longitude [deg], height [m].
    """

    origin_ecef_m: Floats
    origin_geodetic: Floats

    @classmethod
    def at(cls, ecef_m: Floats) -> LocalFrame:
        """Frame with its origin at one ECEF point (3,), m."""
        return cls(np.asarray(ecef_m, dtype=np.float64), geodetic(np.atleast_2d(ecef_m))[0])

    def enu(self, ecef_m: Floats) -> Floats:
        """ECEF points (n, 3), m to east, north, up (n, 3), m from the origin."""
        matrix = enu_axes(self.origin_ecef_m[np.newaxis])[0]
        enu: Floats = (ecef_m - self.origin_ecef_m) @ matrix.T
        return enu

    def attitude_matrices(self, attitude_rad: Floats, ecef_m: Floats) -> Floats:
        """Body to this frame's axes; the attitude is relative to the local axes at `ecef_m`.

        The axes of two places 10 km apart differ by 0.1 deg, so this is not the same
        as :func:`body_to_enu`.
        """
        local = enu_axes(ecef_m)
        origin = enu_axes(self.origin_ecef_m[np.newaxis])[0]
        turned: Floats = np.einsum("ij,nkj,nkl->nil", origin, local, body_to_enu(attitude_rad))
        return turned

    def covariance_matrices(self, packed_enu: Floats, ecef_m: Floats) -> Floats:
        """Packed covariances in the local axes at `ecef_m` as matrices in this frame's axes."""
        local = enu_axes(ecef_m)
        origin = enu_axes(self.origin_ecef_m[np.newaxis])[0]
        between = np.einsum("ij,nkj->nik", origin, local)
        turned: Floats = np.einsum("nij,njk,nlk->nil", between, symmetric(packed_enu), between)
        return turned
