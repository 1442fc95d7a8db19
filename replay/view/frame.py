"""Where things are: ECEF, geodetic and local east-north-up, all vectorised.

Attitude is roll, pitch, heading: turned in the order heading, pitch, roll they
take north-east-down axes into body axes (forward, right, down).
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt
import pymap3d

Floats = npt.NDArray[np.float64]


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


def ecef_to_enu_matrices(latitude_deg: npt.ArrayLike, longitude_deg: npt.ArrayLike) -> Floats:
    """Matrices whose rows are the east, north and up directions in ECEF.

    Parameters
    ----------
    latitude_deg, longitude_deg : array (n,), deg

    Returns
    -------
    array (n, 3, 3)
    """
    latitude = np.radians(np.atleast_1d(np.asarray(latitude_deg, dtype=np.float64)))
    longitude = np.radians(np.atleast_1d(np.asarray(longitude_deg, dtype=np.float64)))
    sin_lat, cos_lat = np.sin(latitude), np.cos(latitude)
    sin_lon, cos_lon = np.sin(longitude), np.cos(longitude)
    zero = np.zeros_like(latitude)
    east = np.stack([-sin_lon, cos_lon, zero], axis=-1)
    north = np.stack([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat], axis=-1)
    up = np.stack([cos_lat * cos_lon, cos_lat * sin_lon, sin_lat], axis=-1)
    return np.stack([east, north, up], axis=1)


def body_to_enu_matrices(attitude_rad: Floats) -> Floats:
    """Matrices that turn body components into east, north, up.

    Parameters
    ----------
    attitude_rad : array (n, 3), rad
        Roll, pitch, heading.

    Returns
    -------
    array (n, 3, 3)
    """
    sin_r, sin_p, sin_h = np.sin(attitude_rad).T
    cos_r, cos_p, cos_h = np.cos(attitude_rad).T
    north = [
        cos_h * cos_p,
        cos_h * sin_p * sin_r - sin_h * cos_r,
        cos_h * sin_p * cos_r + sin_h * sin_r,
    ]
    east = [
        sin_h * cos_p,
        sin_h * sin_p * sin_r + cos_h * cos_r,
        sin_h * sin_p * cos_r - cos_h * sin_r,
    ]
    up = [sin_p, -cos_p * sin_r, -cos_p * cos_r]
    return np.stack([np.stack(row, axis=-1) for row in (east, north, up)], axis=1)


def rotate(matrices: Floats, vectors: Floats) -> Floats:
    """Each vector turned by its matrix: arrays (n, 3, 3) and (n, 3)."""
    turned: Floats = np.einsum("nij,nj->ni", matrices, vectors)
    return turned


def symmetric(packed: Floats) -> Floats:
    """`SymmetricMatrix3` columns (xx, xy, xz, yy, yz, zz) as matrices (n, 3, 3)."""
    return packed[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)


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
        matrix = ecef_to_enu_matrices(self.origin_geodetic[0], self.origin_geodetic[1])[0]
        enu: Floats = (ecef_m - self.origin_ecef_m) @ matrix.T
        return enu

    def attitude_matrices(self, attitude_rad: Floats, ecef_m: Floats) -> Floats:
        """Body to this frame's axes; the attitude is relative to the local axes at `ecef_m`.

        The axes of two places 10 km apart differ by 0.1 deg, so this is not the same
        as :func:`body_to_enu_matrices`.
        """
        here = geodetic(ecef_m)
        local = ecef_to_enu_matrices(here[:, 0], here[:, 1])
        origin = ecef_to_enu_matrices(self.origin_geodetic[0], self.origin_geodetic[1])[0]
        turned: Floats = np.einsum(
            "ij,nkj,nkl->nil", origin, local, body_to_enu_matrices(attitude_rad)
        )
        return turned

    def covariance_matrices(self, packed_enu: Floats, ecef_m: Floats) -> Floats:
        """Packed covariances in the local axes at `ecef_m` as matrices in this frame's axes."""
        here = geodetic(ecef_m)
        local = ecef_to_enu_matrices(here[:, 0], here[:, 1])
        origin = ecef_to_enu_matrices(self.origin_geodetic[0], self.origin_geodetic[1])[0]
        turn = np.einsum("ij,nkj->nik", origin, local)
        turned: Floats = np.einsum("nij,njk,nlk->nil", turn, symmetric(packed_enu), turn)
        return turned


def shifted_ecef(
    position_ecef_m: Floats, attitude_rad: Floats, lever_arm_body_m: Floats
) -> tuple[Floats, Floats]:
    """Points at a lever arm from the IMU.

    Parameters
    ----------
    position_ecef_m : array (n, 3), m
        IMU origin.
    attitude_rad : array (n, 3), rad
        Roll, pitch, heading there.
    lever_arm_body_m : array (n, 3), m

    Returns
    -------
    point_ecef_m : array (n, 3), m
    body_to_enu : array (n, 3, 3)
    """
    here = geodetic(position_ecef_m)
    turn = body_to_enu_matrices(attitude_rad)
    offset_enu = rotate(turn, lever_arm_body_m)
    to_enu = ecef_to_enu_matrices(here[:, 0], here[:, 1])
    return position_ecef_m + rotate(np.swapaxes(to_enu, 1, 2), offset_enu), turn
