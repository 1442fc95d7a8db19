"""State differences in the filter's own measure: sqrt(dx' P^-1 dx) with A's covariance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from replay.channels import Difference
from replay.diff.covariance import roots
from replay.diff.fields import numbers
from replay.diff.join import Joined
from replay.diff.result import SigmaDiff, finite
from replay.log.columns import Columns

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

# Error states by the field of FilterState that they correct, as FilterCovariance names them.
_XYZ: Final = ("x", "y", "z")
_STATES: Final[Mapping[str, tuple[str, ...]]] = {
    "position_ecef_m": tuple(f"position_ecef_{c}" for c in _XYZ),
    "velocity_ecef_m_s": tuple(f"velocity_ecef_{c}" for c in _XYZ),
    "q_body_to_ecef": tuple(f"attitude_ecef_{c}" for c in _XYZ),
    "gyro_bias_body_rad_s": tuple(f"gyro_bias_{c}" for c in _XYZ),
    "accel_bias_body_m_s2": tuple(f"accel_bias_{c}" for c in _XYZ),
    "gyro_scale_factor": tuple(f"gyro_scale_{c}" for c in _XYZ),
    "accel_scale_factor": tuple(f"accel_scale_{c}" for c in _XYZ),
    "mounting_angles_rad": ("mounting_roll", "mounting_pitch", "mounting_yaw"),
    "non_slip_point_body_m": tuple(f"non_slip_point_{c}" for c in ("forward", "right", "down")),
}
_TOGETHER: Final = (("position_ecef_m", "velocity_ecef_m_s"),)


def sigma_differences(joined: Joined, covariance: Columns) -> list[SigmaDiff]:
    """Difference of each field that differs, in sigmas, and of position with velocity.

    Parameters
    ----------
    joined : Joined
        Filter states.
    covariance : Columns
        A's covariances; a state is judged by the one of its valid time.
    """
    differing = [name for name in _STATES if name in joined.outcomes]
    groups: list[tuple[str, ...]] = [(name,) for name in differing]
    groups += [group for group in _TOGETHER if any(name in differing for name in group)]
    rows, partners = _covariance_rows(joined, covariance)
    if not len(rows):
        return []
    layouts = _layouts(covariance, partners)
    triangle = numbers(covariance.values["upper_triangle"])[partners]
    dimensions = np.asarray(covariance["dimension"], dtype=np.int64)[partners]
    found = [_group(joined, group, rows, triangle, dimensions, layouts) for group in groups]
    return [sigma for sigma in found if sigma is not None]


def _covariance_rows(joined: Joined, covariance: Columns) -> tuple[Int64, Int64]:
    """Find the matched rows that have a covariance of their valid time, and its row."""
    if not len(covariance):
        empty = np.zeros(0, dtype=np.int64)
        return empty, empty
    order = np.argsort(covariance.valid_time_ns, kind="stable")
    times = covariance.valid_time_ns[order]
    wanted = joined.a.valid_time_ns[joined.matched_a]
    # The last of equal times is what the filter believed after all updates of the epoch.
    slot = np.searchsorted(times, wanted, side="right") - 1
    rows = np.flatnonzero((slot >= 0) & (times[slot] == wanted))
    return rows, order[slot[rows]]


def _layouts(covariance: Columns, partners: Int64) -> list[tuple[Int64, dict[str, int]]]:
    """Rows by their list of state names: ambiguity states come and go."""
    column = covariance.values["state_names"]
    texts = (
        [bytes(text).decode() for text in column]
        if isinstance(column, np.ndarray)
        else column.texts()
    )
    names = np.array([texts[i] for i in partners])
    layouts = []
    for text in np.unique(names):
        states = {name.strip(): i for i, name in enumerate(str(text).split(","))}
        layouts.append((np.flatnonzero(names == text), states))
    return layouts


def _group(
    joined: Joined,
    fields: Sequence[str],
    rows: Int64,
    triangle: Float64,
    dimensions: Int64,
    layouts: Sequence[tuple[Int64, Mapping[str, int]]],
) -> SigmaDiff | None:
    known = [states for _, states in layouts]
    chosen = [
        (field, k, state)
        for field in fields
        for k, state in enumerate(_STATES[field])
        if all(state in states for states in known)
    ]
    if not chosen:
        return None
    change = np.stack([_error(joined, field)[rows, k] for field, k, _ in chosen], axis=1)
    block = np.zeros((len(rows), len(chosen), len(chosen)))
    for members, states in layouts:
        index = np.array([states[state] for _, _, state in chosen])
        low, high = np.minimum.outer(index, index), np.maximum.outer(index, index)
        order = dimensions[members, None, None]
        entry = low * order - low * (low - 1) // 2 + high - low
        block[members] = triangle[members[:, None, None], entry]
    root, definite = roots(block)
    sigmas = np.full(len(rows), np.nan)
    whitened = np.linalg.solve(root[definite], change[definite][:, :, None])[:, :, 0]
    sigmas[definite] = np.sqrt(np.einsum("ni,ni->n", whitened, whitened))
    finite_rows = np.flatnonzero(np.isfinite(sigmas))
    if not len(finite_rows):
        return None
    worst = int(finite_rows[np.argmax(sigmas[finite_rows])])
    values = sigmas[finite_rows]
    return SigmaDiff(
        field=" + ".join(fields),
        states=[state for _, _, state in chosen],
        rows=len(values),
        rms=finite(float(np.sqrt(np.mean(values * values)))),
        max=finite(sigmas[worst]),
        at=joined.matched_place(int(rows[worst])),
    )


def _error(joined: Joined, field: str) -> Float64:
    """Subtract a field as its error states count it `(m, 3)`."""
    a = numbers(joined.a.values[field])[joined.matched_a]
    b = numbers(joined.b.values[field])[joined.matched_b]
    tolerance = joined.spec.tolerances.get(field)
    rule = Difference.LINEAR if tolerance is None else tolerance.difference
    if rule is Difference.ROTATION:
        return _rotation_vector(a, b)
    if rule is Difference.ANGLE:
        return np.asarray(np.remainder(a - b + np.pi, 2.0 * np.pi) - np.pi)
    return a - b


def _rotation_vector(a: Float64, b: Float64) -> Float64:
    """Rotation that takes attitude B to attitude A, about ECEF axes, in radians."""
    scalar = np.einsum("ij,ij->i", a, b)
    vector = b[:, :1] * a[:, 1:] - a[:, :1] * b[:, 1:] - np.cross(a[:, 1:], b[:, 1:])
    vector = np.where(scalar[:, None] < 0.0, -vector, vector)
    length = np.linalg.norm(vector, axis=1)
    angle = 2.0 * np.arctan2(length, np.abs(scalar))
    ratio = np.divide(angle, length, out=np.full_like(angle, 2.0), where=length > 0.0)
    return np.asarray(vector * ratio[:, None])
