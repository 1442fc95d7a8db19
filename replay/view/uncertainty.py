"""Standard deviations and ellipsoids from covariances."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from replay.evaluate.geometry import Floats
from replay.log.columns import Columns
from replay.view.fields import texts


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Sigmas:
    """Standard deviations of named states.

    Attributes
    ----------
    times_ns : int64 array (n,), GPS ns
    values : mapping of state name to array (n,)
        In the unit of the state; NaN where a row does not have the state.
    """

    times_ns: npt.NDArray[np.int64]
    values: Mapping[str, Floats]

    def at(self, times_ns: npt.NDArray[np.int64], prefix: str, suffixes: Iterable[str]) -> Floats:
        """One state's standard deviations at given times.

        Parameters
        ----------
        times_ns : int64 array (m,), GPS ns
        prefix : str
            Beginning of the state's name, "gyro_bias".
        suffixes : iterable of str
            Its ends, the first that is found counts: "_x", "_roll", or "" for the whole name.

        Returns
        -------
        array (m,)
            NaN at times that the covariance does not have, or where there is no such state.
        """
        found = [
            name
            for end in suffixes
            for name in self.values
            if name == prefix + end or (end and name.startswith(prefix) and name.endswith(end))
        ]
        if not found or len(self.times_ns) == 0:
            return np.full(len(times_ns), np.nan)
        place = np.minimum(np.searchsorted(self.times_ns, times_ns), len(self.times_ns) - 1)
        hit = self.times_ns[place] == times_ns
        return np.where(hit, self.values[found[0]][place], np.nan)


def sigmas_of(covariance: Columns) -> Sigmas:
    """Square roots of the diagonals of FilterCovariance rows; the rest is let go."""
    count = len(covariance)
    values: dict[str, Floats] = {}
    triangles = covariance.ragged("upper_triangle")
    for names, rows in _rows_by_names(covariance):
        size = len(names)
        lengths = triangles.offsets[rows + 1] - triangles.offsets[rows]
        rows = rows[lengths == size * (size + 1) // 2]
        order = np.arange(size)
        diagonal = order * size - order * (order - 1) // 2
        picked = triangles.values[triangles.offsets[rows][:, None] + diagonal]
        deviations = np.sqrt(np.maximum(picked.astype(np.float64), 0.0))
        for name, column in zip(names, deviations.T, strict=True):
            values.setdefault(name, np.full(count, np.nan))[rows] = column
    return Sigmas(covariance.valid_time_ns, values)


def _rows_by_names(
    covariance: Columns,
) -> list[tuple[Sequence[str], npt.NDArray[np.int64]]]:
    rows: dict[str, list[int]] = {}
    for index, text in enumerate(texts(covariance, "state_names")):
        rows.setdefault(text, []).append(index)
    return [
        ([name.strip() for name in text.split(",")], np.asarray(index, dtype=np.int64))
        for text, index in rows.items()
    ]


def join_sigmas(parts: Sequence[Sigmas]) -> Sigmas:
    """Parts end to end, sorted by time."""
    names = dict.fromkeys(name for part in parts for name in part.values)
    times = np.concatenate([part.times_ns for part in parts])
    order = np.argsort(times, kind="stable")
    values = {
        name: np.concatenate(
            [part.values.get(name, np.full(len(part.times_ns), np.nan)) for part in parts]
        )[order]
        for name in names
    }
    return Sigmas(times[order], values)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Ellipsoids:
    """Axes of 1-sigma ellipsoids.

    Attributes
    ----------
    half_sizes : array (n, 3)
        Square roots of the eigenvalues, ascending, in the covariance's unit's root.
    quaternions_xyzw : array (n, 4)
        Turn the ellipsoid's axes into those of the covariance.
    """

    half_sizes: Floats
    quaternions_xyzw: Floats


def ellipsoids(covariances: Floats) -> Ellipsoids:
    """Ellipsoids of covariance matrices (n, 3, 3), which must be finite."""
    eigenvalues, vectors = np.linalg.eigh(covariances)
    vectors[np.linalg.det(vectors) < 0.0, :, 0] *= -1.0  # a rotation, not a reflection
    return Ellipsoids(
        np.sqrt(np.maximum(eigenvalues, 0.0)), Rotation.from_matrix(vectors).as_quat()
    )


def attitude_angle_sigmas(attitude_rad: Floats, std_about_enu_rad: Floats) -> Floats:
    """Standard deviations about east, north, up as those of roll, pitch and heading.

    The kinematic equations of the angles, with the three errors taken as
    independent, which is all that the solution channel tells.

    Parameters
    ----------
    attitude_rad : array (n, 3), rad
        Roll, pitch, heading.
    std_about_enu_rad : array (n, 3), rad

    Returns
    -------
    array (n, 3), rad
    """
    pitch, heading = attitude_rad[:, 1], attitude_rad[:, 2]
    east, north, up = (std_about_enu_rad**2).T
    forward = np.cos(heading) ** 2 * north + np.sin(heading) ** 2 * east
    right = np.sin(heading) ** 2 * north + np.cos(heading) ** 2 * east
    roll_variance = forward / np.cos(pitch) ** 2
    heading_variance = up + np.tan(pitch) ** 2 * forward
    sigmas: Floats = np.sqrt(np.stack([roll_variance, right, heading_variance], axis=-1))
    return sigmas
