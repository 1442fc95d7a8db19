"""Names of error states, in the order of the covariance's rows."""

from __future__ import annotations

from typing import Final

_AXES: Final = ("x", "y", "z")
_CORE: Final = ("position_ecef", "velocity_ecef", "attitude_ecef", "gyro_bias", "accel_bias")
_SCALES: Final = ("gyro_scale", "accel_scale")


def state_names(states: int, *, mounting: bool, lever: bool, squat: bool) -> tuple[str, ...]:
    """Names of the 15 or 21 inertial error states, and of those of the vehicle.

    Order and meaning are those of :mod:`replay.kernels.covariance`.
    """
    groups = _CORE + (_SCALES if states == 21 else ())
    names = tuple(f"{group}_{axis}" for group in groups for axis in _AXES)
    if mounting:
        names += ("mounting_pitch", "mounting_yaw")
    if lever:
        names += ("non_slip_point_forward", "non_slip_point_down")
    if squat:
        names += ("squat",)
    return names
