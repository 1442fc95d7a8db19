"""Fixes of a simulated receiver: white and slowly wandering errors, and what it says of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Annotated, Any, Final

import numpy as np
import numpy.typing as npt

from replay.configuration import Section, quantity
from replay.errors import ConfigurationError
from replay.kernels.trajectory import antenna_fixes
from replay.schemas import gnss_pb2
from replay.simulate.noise import Floats, correlated, normals

_SOURCE: Final = "gnss"
_FLOOR_M: Final = 1e-3  # no receiver states less; a filter cannot use a variance of nought
_FLOOR_M_S: Final = 1e-3


class GnssErrors(Section, frozen=True):
    """Standard deviations of a receiver's errors; horizontal ones hold for east and for north."""

    horizontal_noise: Annotated[float, quantity("m", "white")] = 0.0
    vertical_noise: Annotated[float, quantity("m", "white")] = 0.0
    horizontal_drift: Annotated[float, quantity("m", "Gauss-Markov deviation")] = 0.0
    vertical_drift: Annotated[float, quantity("m", "Gauss-Markov deviation")] = 0.0
    drift_tau: Annotated[float, quantity("s", "correlation time of the drift")] = 60.0
    horizontal_velocity_noise: Annotated[float, quantity("m/s", "white")] = 0.0
    vertical_velocity_noise: Annotated[float, quantity("m/s", "white")] = 0.0
    stated_scale: Annotated[float, quantity("1", "stated over true deviation")] = 1.0


GNSS_GRADES: Final[Mapping[str, Mapping[str, Any]]] = {
    "perfect": {},
    # About what data sheets of RTK receivers state (1 cm + 1 ppm horizontal, 2 cm + 1 ppm
    # vertical, 0.03 to 0.05 m/s); the split into white and wandering parts is assumed.
    "rtk": {
        "horizontal_noise": "8 mm",
        "vertical_noise": "15 mm",
        "horizontal_drift": "5 mm",
        "vertical_drift": "10 mm",
        "drift_tau": "60 s",
        "horizontal_velocity_noise": "3 cm/s",
        "vertical_velocity_noise": "5 cm/s",
    },
    # Single-point positions in the open: well inside the 8 m horizontal and 13 m vertical
    # (95 %) of the GPS SPS Performance Standard (5th edition, 2020); the numbers are assumed.
    "spp": {
        "horizontal_noise": "0.8 m",
        "vertical_noise": "1.5 m",
        "horizontal_drift": "1.2 m",
        "vertical_drift": "2.5 m",
        "drift_tau": "300 s",
        "horizontal_velocity_noise": "5 cm/s",
        "vertical_velocity_noise": "10 cm/s",
    },
}
_QUALITIES: Final = {
    "perfect": gnss_pb2.FIX_QUALITY_RTK_FIXED,
    "rtk": gnss_pb2.FIX_QUALITY_RTK_FIXED,
    "spp": gnss_pb2.FIX_QUALITY_SINGLE,
}


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Fixes:
    """Positions and velocities of an antenna.

    Attributes
    ----------
    positions : float64 array (n, 3), m, ECEF
    velocities : float64 array (n, 3), m/s, ECEF
    position_covariances : float64 array (n, 6), m^2
        Upper triangle, east, north, up; as the receiver states it.
    velocity_covariances : float64 array (n, 6), m^2/s^2
    """

    positions: Floats
    velocities: Floats
    position_covariances: Floats
    velocity_covariances: Floats


def check(errors: GnssErrors) -> None:
    """Refuse impossible errors.

    Raises
    ------
    ConfigurationError
        For a negative number, a drift without a correlation time, a scale of nought.
    """
    for name in errors.__struct_fields__:
        if not getattr(errors, name) >= 0.0:
            raise ConfigurationError(
                f"gnss.errors.{name} is {getattr(errors, name)}", mend="write 0 or more"
            )
    drifting = errors.horizontal_drift > 0.0 or errors.vertical_drift > 0.0
    if drifting and errors.drift_tau == 0.0:
        raise ConfigurationError(
            "gnss.errors.drift_tau is 0 but the drift is not", mend="give a correlation time"
        )
    if errors.stated_scale == 0.0:
        raise ConfigurationError("gnss.errors.stated_scale is 0", mend="write more than 0")


def quality(grade: str) -> int:
    """`FixQuality` of a grade."""
    return int(_QUALITIES[grade])


def fix(
    poses: npt.NDArray[np.void],
    lever_arm_m: tuple[float, ...],
    interval_s: float,
    errors: GnssErrors,
    seed: int,
) -> Fixes:
    """Fixes at the times of poses.

    Parameters
    ----------
    poses : array (n,) of POSE_DTYPE
        At every epoch, also those of outages, so that an outage shifts no number.
    lever_arm_m : three floats, m, body
        IMU to antenna.
    interval_s : float, s
        Between poses.
    errors : GnssErrors
    seed : int
    """
    count = len(poses)
    position = normals(seed, f"{_SOURCE}.position.noise", count)
    position *= _axes(errors.horizontal_noise, errors.vertical_noise)
    position += correlated(
        seed, f"{_SOURCE}.position.drift", count,
        sigma=1.0 if errors.horizontal_drift or errors.vertical_drift else 0.0,
        tau_s=errors.drift_tau, interval_s=interval_s,
    ) * _axes(errors.horizontal_drift, errors.vertical_drift)  # fmt: skip
    velocity = normals(seed, f"{_SOURCE}.velocity.noise", count)
    velocity *= _axes(errors.horizontal_velocity_noise, errors.vertical_velocity_noise)
    positions, velocities = np.empty((count, 3)), np.empty((count, 3))
    antenna_fixes(poses, np.array(lever_arm_m), position, velocity, positions, velocities)
    return Fixes(
        positions,
        velocities,
        _stated(
            count,
            errors.horizontal_noise * errors.horizontal_noise
            + errors.horizontal_drift * errors.horizontal_drift,
            errors.vertical_noise * errors.vertical_noise
            + errors.vertical_drift * errors.vertical_drift,
            _FLOOR_M,
            errors.stated_scale,
        ),
        _stated(
            count,
            errors.horizontal_velocity_noise * errors.horizontal_velocity_noise,
            errors.vertical_velocity_noise * errors.vertical_velocity_noise,
            _FLOOR_M_S,
            errors.stated_scale,
        ),
    )


def _axes(horizontal: float, vertical: float) -> Floats:
    return np.array([horizontal, horizontal, vertical])


def _stated(count: int, horizontal: float, vertical: float, floor: float, scale: float) -> Floats:
    """Packed covariances (count, 6) of variances, as the receiver states them."""
    least = floor * floor
    h = max(horizontal * (scale * scale), least)
    v = max(vertical * (scale * scale), least)
    return np.tile([h, 0.0, 0.0, h, 0.0, v], (count, 1))
