"""Errors of a solution, solution minus truth, in local axes at the truth.

A solution is about the IMU's origin, truth about a point at its own lever arm. The
solution is moved there with its own attitude and turn rate, because that is what its
user would do. A row that has no attitude is about an antenna: where the antenna's lever
arm and the truth's attitude are known, truth is moved there; else the row is compared as
it stands.
"""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from replay.evaluate.align import Aligned, Rows, align, known_rows, truth_positions
from replay.evaluate.geometry import Floats, body_to_enu, enu_axes, turn, turn_back, wrapped
from replay.log.columns import Columns
from replay.schemas import solution_pb2

Mask = npt.NDArray[np.bool_]

LONGEST_STEP: Final = 1.5  # of median intervals between consecutive epochs
_PAIR: Final = 2


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Solution minus truth where both are known.

    Attributes
    ----------
    rows : int64 array (m,)
        Rows of the solution that the errors belong to.
    times_ns : int64 array (m,), GPS ns
    values : float64 array (m, 3)
        Components and unit after the function.
    """

    rows: Rows
    times_ns: Rows
    values: Floats

    def __len__(self) -> int:
        return len(self.rows)

    def take(self, keep: Mask) -> Errors:
        """Some of the errors, by a mask (m,)."""
        return Errors(self.rows[keep], self.times_ns[keep], self.values[keep])


def position_errors(
    solution: Columns,
    truth: Columns,
    *,
    fixed_only: bool = False,
    antenna_arm_m: Floats | None = None,
) -> Errors:
    """Position errors at the truth's point.

    Parameters
    ----------
    solution : Columns of replay.Solution
    truth : Columns of replay.Truth
    fixed_only : bool
        Use rows of truth with fixed ambiguities only.
    antenna_arm_m : float64 array (3,), optional
        Body, IMU to the antenna that rows without attitude are about.

    Returns
    -------
    Errors
        East, north, up [m].
    """
    aligned, point, reference = _points(solution, truth, fixed_only, antenna_arm_m)
    return _finite(solution, aligned, turn(enu_axes(reference), point - reference))


def position_change_errors(
    solution: Columns,
    truth: Columns,
    epochs: Mask,
    *,
    fixed_only: bool = False,
    antenna_arm_m: Floats | None = None,
) -> Errors:
    """Errors of the change of position from each epoch to the next.

    What the solution says of r_k - r_(k-1) less what truth says of it (Tang et al. 2021,
    table 4). A constant error has no part in it.

    Parameters
    ----------
    solution, truth, fixed_only, antenna_arm_m
        As in :func:`position_errors`; rows of the solution in the order of time.
    epochs : bool array (n,)
        Rows of the solution that are epochs. Only those count as consecutive that are at
        most 1.5 median intervals of them apart and both have truth. Where a solution is
        chained from epoch to epoch, the epochs at which a chain begins are no change.

    Returns
    -------
    Errors
        East, north, up at the later epoch [m]; rows are those of the later epoch.
    """
    rows = np.flatnonzero(epochs)
    if len(rows) < _PAIR:
        return _none()
    times = solution.valid_time_ns[rows]
    last = np.append(np.diff(times) > 0, True)  # of one time the last row is the epoch's
    rows, times = rows[last], times[last]
    aligned, point, reference = _points(solution, truth, fixed_only, antenna_arm_m)
    errors = np.full((len(solution), 3), np.nan)
    errors[aligned.rows] = point - reference
    places = np.full((len(solution), 3), np.nan)
    places[aligned.rows] = reference
    steps = np.diff(times)
    if len(steps) == 0:
        return _none()
    change = errors[rows[1:]] - errors[rows[:-1]]
    keep = steps <= LONGEST_STEP * float(np.median(steps))
    keep &= np.isfinite(change).all(axis=1)
    chained = solution["status"] == solution_pb2.SOLUTION_STATUS_CHAINED
    if chained.any():
        keep &= chained[rows[1:]]
    later = rows[1:][keep]
    return Errors(later, solution.valid_time_ns[later], turn(enu_axes(places[later]), change[keep]))


def _points(
    solution: Columns, truth: Columns, fixed_only: bool, antenna_arm_m: Floats | None
) -> tuple[Aligned, Floats, Floats]:
    """The solution at the truth's point, and truth, ECEF (m, 3) [m], where truth is known.

    Truth of an antenna's rows is that of the antenna where it can be had.
    """
    known = known_rows(truth, "position_ecef_m", fixed_only=fixed_only)
    aligned = align(solution.valid_time_ns, known.valid_time_ns)
    reference = truth_positions(aligned, known)
    origin = solution["position_ecef_m"][aligned.rows].astype(np.float64)
    arm_enu = turn(_attitudes(solution, aligned), _lever_arms(aligned, known))
    antenna = of_antenna(solution)[aligned.rows]
    arm_enu[antenna] = 0.0
    if antenna_arm_m is not None and "attitude_rad" in known.values and antenna.any():
        turned = body_to_enu(aligned.angles(known["attitude_rad"].astype(np.float64)))
        away = turn(turned, antenna_arm_m - _lever_arms(aligned, known))
        away[~(antenna & np.isfinite(away).all(axis=1))] = 0.0
        reference = reference + turn_back(enu_axes(reference), away)
    return aligned, origin + turn_back(enu_axes(origin), arm_enu), reference


def velocity_errors(solution: Columns, truth: Columns, *, fixed_only: bool = False) -> Errors:
    """Velocity errors at the truth's point; truth is interpolated on straight lines.

    Parameters
    ----------
    solution, truth, fixed_only
        As in :func:`position_errors`.

    Returns
    -------
    Errors
        East, north, up [m/s]; none where truth has no velocity.
    """
    known = known_rows(truth, "velocity_enu_m_s", fixed_only=fixed_only)
    aligned = align(solution.valid_time_ns, known.valid_time_ns)
    if len(aligned.rows) == 0 or "velocity_enu_m_s" not in solution.values:
        return _none()
    rate = _optional(solution, "angular_rate_body_rad_s", aligned)
    swing = turn(_attitudes(solution, aligned), np.cross(rate, _lever_arms(aligned, known)))
    swing[of_antenna(solution)[aligned.rows]] = 0.0
    velocity = solution["velocity_enu_m_s"][aligned.rows].astype(np.float64) + swing
    reference = aligned.linear(known["velocity_enu_m_s"].astype(np.float64))
    return _finite(solution, aligned, velocity - reference)


def attitude_errors(solution: Columns, truth: Columns, *, fixed_only: bool = False) -> Errors:
    """Differences of roll, pitch and heading; truth is interpolated on straight lines.

    Parameters
    ----------
    solution, truth, fixed_only
        As in :func:`position_errors`.

    Returns
    -------
    Errors
        Roll, pitch, heading [rad] in [-pi, pi); none where truth has no attitude.
    """
    known = known_rows(truth, "attitude_rad", fixed_only=fixed_only)
    aligned = align(solution.valid_time_ns, known.valid_time_ns)
    if len(aligned.rows) == 0 or "attitude_rad" not in solution.values:
        return _none()
    reference = aligned.angles(known["attitude_rad"].astype(np.float64))
    found = solution["attitude_rad"][aligned.rows].astype(np.float64)
    return _finite(solution, aligned, wrapped(found - reference))


def rotation_errors(solution: Columns, truth: Columns, *, fixed_only: bool = False) -> Errors:
    """Attitude errors as rotation vectors from truth to solution.

    These, not differences of Euler angles, are what the solution's attitude deviations
    are about.

    Parameters
    ----------
    solution, truth, fixed_only
        As in :func:`position_errors`.

    Returns
    -------
    Errors
        About east, north, up [rad]; none where truth has no attitude.
    """
    known = known_rows(truth, "attitude_rad", fixed_only=fixed_only)
    aligned = align(solution.valid_time_ns, known.valid_time_ns)
    if len(aligned.rows) == 0 or "attitude_rad" not in solution.values:
        return _none()
    reference = body_to_enu(aligned.angles(known["attitude_rad"].astype(np.float64)))
    found = _attitudes(solution, aligned)
    finite = np.isfinite(found).all(axis=(1, 2))
    vectors = np.full((len(found), 3), np.nan)
    difference = np.einsum("nij,nkj->nik", found[finite], reference[finite])
    if finite.any():
        vectors[finite] = Rotation.from_matrix(difference).as_rotvec()
    return _finite(solution, aligned, vectors)


def of_antenna(solution: Columns) -> Mask:
    """Which rows (n,) of a solution have no attitude, so that they are about an antenna."""
    if "attitude_rad" not in solution.values:
        return np.ones(len(solution), dtype=np.bool_)
    return ~solution.is_present("attitude_rad")


def _optional(solution: Columns, field: str, aligned: Aligned) -> Floats:
    if field not in solution.values:
        return np.full((len(aligned.rows), 3), np.nan)
    return solution[field][aligned.rows].astype(np.float64)


def _attitudes(solution: Columns, aligned: Aligned) -> Floats:
    return body_to_enu(_optional(solution, "attitude_rad", aligned))


def _lever_arms(aligned: Aligned, truth: Columns) -> Floats:
    return aligned.linear(truth["lever_arm_body_m"].astype(np.float64))


def _finite(solution: Columns, aligned: Aligned, values: Floats) -> Errors:
    keep = np.isfinite(values).all(axis=1)
    rows = aligned.rows[keep]
    return Errors(rows, solution.valid_time_ns[rows], values[keep])


def _none() -> Errors:
    none = np.empty(0, dtype=np.int64)
    return Errors(none, none, np.empty((0, 3)))
