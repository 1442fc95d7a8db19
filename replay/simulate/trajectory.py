"""A motion, what is exact along it, and what perfect inertial sensors read there."""

from __future__ import annotations

import dataclasses
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from replay.kernels import elementary
from replay.kernels.earth import ecef_from_geodetic
from replay.kernels.manoeuvres import BODY_DTYPE
from replay.kernels.trajectory import (
    POSE_DTYPE,
    new_motion,
    poses_at,
    sense_motion,
)
from replay.simulate.noise import Floats

Records = npt.NDArray[np.void]


def ecef_of(latitude_rad: float, longitude_rad: float, height_m: float) -> Floats:
    """ECEF position (3,), m of geodetic coordinates."""
    sin_lat, cos_lat = elementary.sincos(latitude_rad)
    sin_lon, cos_lon = elementary.sincos(longitude_rad)
    return np.array(ecef_from_geodetic(sin_lat, cos_lat, sin_lon, cos_lon, height_m))


class Motion(Protocol):
    """What moves: exact at any time."""

    def sense(self, interval_s: float, positions: Floats, rates: Floats, forces: Floats) -> None:
        """Fill positions (n + 1, 3) at equal steps and perfect means (n, 3) over each."""

    def fill(self, interval_s: float, positions: Floats, times_s: Floats, poses: Records) -> None:
        """Fill poses (m,) of POSE_DTYPE at ascending times, given the positions of `sense`."""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Manoeuvres:
    """A motion along pieces.

    Attributes
    ----------
    pieces : array of PIECE_DTYPE
    body : array (1,) of BODY_DTYPE
    start : float64 array (3,), m, ECEF
    """

    pieces: Records
    body: Records
    start: Floats

    def sense(self, interval_s: float, positions: Floats, rates: Floats, forces: Floats) -> None:
        """Integrate the velocity; see :class:`Motion`."""
        positions[0] = self.start
        sense_motion(self.pieces, self.body[0], interval_s, positions, rates, forces, new_motion())

    def fill(self, interval_s: float, positions: Floats, times_s: Floats, poses: Records) -> None:
        """Go on from the position before each time; see :class:`Motion`."""
        poses_at(self.pieces, self.body[0], interval_s, positions, times_s, new_motion(), poses)


def make_body(**fields: Any) -> Records:
    """How a body follows its path, array (1,) of BODY_DTYPE; what is not said is 0."""
    body = np.zeros(1, dtype=BODY_DTYPE)
    for name, value in fields.items():
        body[name] = value
    return body


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """An exact motion and what perfect inertial sensors read along it.

    Attributes
    ----------
    motion : Motion
    interval_s : float, s
        Between inertial samples.
    positions : float64 array (n + 1, 3), m, ECEF
        At the start and at the end of every sample.
    rates : float64 array (n, 3), rad/s, body
        Mean angular rate relative to inertial space over each sample.
    forces : float64 array (n, 3), m/s^2, body
        Mean specific force over each sample.
    """

    motion: Motion
    interval_s: float
    positions: Floats
    rates: Floats
    forces: Floats

    @classmethod
    def follow(cls, motion: Motion, interval_s: float, samples: int) -> Trajectory:
        """A motion for a number of inertial samples."""
        positions = np.empty((samples + 1, 3))
        rates, forces = np.empty((samples, 3)), np.empty((samples, 3))
        motion.sense(interval_s, positions, rates, forces)
        return cls(motion, interval_s, positions, rates, forces)

    @classmethod
    def drive(
        cls, pieces: Records, body: Records, start_ecef_m: Floats, interval_s: float, samples: int
    ) -> Trajectory:
        """Motion along pieces from a point, for a number of inertial samples."""
        return cls.follow(Manoeuvres(pieces, body, start_ecef_m), interval_s, samples)

    def poses(self, times_s: Floats) -> np.ndarray[Any, Any]:
        """Poses (POSE_DTYPE) at ascending times since the start, s."""
        poses = np.zeros(len(times_s), dtype=POSE_DTYPE)
        self.motion.fill(self.interval_s, self.positions, times_s, poses)
        return poses

    def speeds(self) -> Floats:
        """Mean speed (n,), m/s over each sample."""
        step = self.positions[1:] - self.positions[:-1]
        squares = step * step
        return np.asarray(np.sqrt(squares[:, 0] + squares[:, 1] + squares[:, 2]) / self.interval_s)
