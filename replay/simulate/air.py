"""The true atmosphere: its settings, and the record that kernels take."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final

import numpy as np
import numpy.typing as npt

from replay.configuration import Section, quantity
from replay.kernels import elementary
from replay.kernels.earth import enu_axes, geodetic
from replay.kernels.observables import ATMOSPHERE_DTYPE
from replay.kernels.sky_fields import WAVES
from replay.log.columns import Columns, Ragged
from replay.schemas import navigation_pb2
from replay.simulate.noise import Floats, normals, uniforms

NODES_PER_TAU: Final = 10.0
_TURN: Final = 2.0 * math.pi


class Wave(Section, frozen=True):
    """A travelling ionospheric disturbance: a plane wave of vertical delay."""

    amplitude: Annotated[float, quantity("m", "vertical, L1")] = 0.0
    length: Annotated[float, quantity("m", "from crest to crest")] = 200e3
    speed: Annotated[float, quantity("m/s", "of the crests")] = 150.0
    direction: Annotated[float, quantity("rad", "where it goes, clockwise from north")] = 0.0


class Front(Section, frozen=True):
    """A storm's edge: a ramp of vertical delay, straight, at constant speed."""

    height: Annotated[float, quantity("m", "behind it more than ahead, vertical, L1")] = 0.0
    width: Annotated[float, quantity("m", "of the ramp")] = 50e3
    speed: Annotated[float, quantity("m/s", "of the ramp")] = 200.0
    direction: Annotated[float, quantity("rad", "where it goes, clockwise from north")] = 0.0
    place: Annotated[float, quantity("m", "of its rear at the start, along direction")] = 0.0


class Ionosphere(Section, frozen=True):
    """The true ionosphere: Klobuchar's formula, and what is beyond.

    Slope, wave and front are fields over the points where signals pierce the shell,
    common to all satellites; residual and gradient are each satellite's own.
    """

    enabled: bool = True
    # The example of many textbooks: a quiet ionosphere in middle latitudes. CODE publishes
    # such numbers for each day; of 2017-01-01 (CGIM0010.17N):
    #   alpha = [1.2821e-8, -9.6222e-9, -3.5982e-7, -6.0901e-7]
    #   beta = [1.0840e5, -1.3197e5, -2.6331e5, 4.0570e5]
    alpha: tuple[float, ...] = (1.1176e-8, 1.4901e-8, -5.9605e-8, -1.1921e-7)
    beta: tuple[float, ...] = (1.1674e5, 1.4746e5, -1.3107e5, -3.9322e5)
    broadcast_alpha: tuple[float, ...] = ()  # none: the true ones
    broadcast_beta: tuple[float, ...] = ()
    scale: Annotated[float, quantity("1", "true delay over that of alpha and beta")] = 1.0
    residual: Annotated[float, quantity("m", "vertical, L1, each satellite's own")] = 0.0
    gradient: Annotated[float, quantity("1", "m per m, each satellite's own; ppm")] = 0.0
    tau: Annotated[float, quantity("s", "correlation time of both")] = 1800.0
    slope_east: Annotated[float, quantity("1", "vertical m on L1 per m at pierce points")] = 0.0
    slope_north: Annotated[float, quantity("1", "vertical m on L1 per m at pierce points")] = 0.0
    wave: Wave = Wave()
    front: Front = Front()


class WetField(Section, frozen=True):
    """Zenith wet delay that differs from place to place, smoothly; it drifts with the wind."""

    sigma: Annotated[float, quantity("m", "standard deviation")] = 0.0
    length: Annotated[float, quantity("m", "where the correlation is exp(-1/2)")] = 50e3
    wind: Annotated[float, quantity("m/s", "speed of the drift")] = 10.0
    direction: Annotated[float, quantity("rad", "where it drifts, clockwise from north")] = 0.0


class Troposphere(Section, frozen=True):
    """The true troposphere: Saastamoinen's zenith delay, Niell's mapping, and a wet remainder."""

    enabled: bool = True
    humidity: Annotated[float, quantity("1", "of the standard atmosphere")] = 0.7
    wet: Annotated[float, quantity("m", "zenith wet delay beyond, common to all")] = 0.0
    local_wet: Annotated[float, quantity("m", "beyond that, each receiver's own")] = 0.0
    tau: Annotated[float, quantity("s", "correlation time of both")] = 7200.0
    # Of the delay at one place with the azimuth, as of Chen and Herring (1997).
    gradient_east: Annotated[float, quantity("m", "horizontal gradient")] = 0.0
    gradient_north: Annotated[float, quantity("m", "horizontal gradient")] = 0.0
    # Of the zenith wet delay from place to place; a scale height of 2 km would make the
    # gradient above 2 km times this.
    wet_slope_east: Annotated[float, quantity("1", "zenith m per m; ppm is mm per km")] = 0.0
    wet_slope_north: Annotated[float, quantity("1", "zenith m per m; ppm is mm per km")] = 0.0
    field: WetField = WetField()


SIGNED: Final = (
    "slope_east", "slope_north", "direction", "height", "place", "gradient_east",
    "gradient_north", "wet_slope_east", "wet_slope_north",
)  # fmt: skip
"""Names of settings that may be negative."""


def air_record(
    ionosphere: Ionosphere, troposphere: Troposphere, shapiro: bool, origin: Floats, seed: int
) -> npt.NDArray[np.void]:
    """Array (1,) of ATMOSPHERE_DTYPE.

    Parameters
    ----------
    ionosphere : Ionosphere
    troposphere : Troposphere
    shapiro : bool
        Whether gravity delays signals.
    origin : float64 array (3,), m, ECEF
        Distances are from there.
    seed : int
    """
    air = np.zeros(1, dtype=ATMOSPHERE_DTYPE)
    air["ionosphere"], air["troposphere"] = ionosphere.enabled, troposphere.enabled
    air["shapiro"], air["alpha"], air["beta"] = shapiro, ionosphere.alpha, ionosphere.beta
    air["scale"], air["humidity"] = ionosphere.scale, troposphere.humidity
    air["ionosphere_spacing"] = ionosphere.tau / NODES_PER_TAU
    air["wet_spacing"] = troposphere.tau / NODES_PER_TAU
    air["origin"] = origin
    x, y, z = origin.tolist()
    enu_axes(x, y, z, air["axes"][0])
    air["origin_latitude"], air["origin_longitude"], _ = geodetic(x, y, z)
    _ionospheric_fields(air, ionosphere)
    air["wet_gradient"] = troposphere.gradient_east, troposphere.gradient_north
    air["wet_slope"] = troposphere.wet_slope_east, troposphere.wet_slope_north
    air["wet_waves"][0] = _wet_waves(troposphere.field, seed)
    air["wet_fields"] = bool(np.any(air["wet_slope"])) or troposphere.field.sigma > 0.0
    return air


def ionosphere_message(ionosphere: Ionosphere, systems: str, start_ns: int) -> Columns:
    """Broadcast coefficients: the same numbers for each system that has such a model."""
    models: Mapping[str, int] = {
        "G": navigation_pb2.IONOSPHERE_MODEL_KLOBUCHAR,
        "J": navigation_pb2.IONOSPHERE_MODEL_KLOBUCHAR,
        "C": navigation_pb2.IONOSPHERE_MODEL_BEIDOU,
    }
    senders = sorted(set(systems) & set(models)) or ["G"]
    alpha = ionosphere.broadcast_alpha or ionosphere.alpha
    beta = ionosphere.broadcast_beta or ionosphere.beta
    count = len(senders)
    return Columns.build(
        np.full(count, start_ns),
        {
            "system": np.array(senders, dtype="S1"),
            "model": np.array([models[system] for system in senders], dtype=np.int32),
            "coefficients": Ragged.from_matrix(np.tile(np.array([*alpha, *beta]), (count, 1))),
        },
    )


def _heading(direction: float) -> tuple[float, float]:
    """East and north part of a direction."""
    east, north = elementary.sincos(direction)
    return float(east), float(north)


def _ionospheric_fields(air: Any, ionosphere: Ionosphere) -> None:
    wave, front = ionosphere.wave, ionosphere.front
    air["slope"] = ionosphere.slope_east, ionosphere.slope_north
    east, north = _heading(wave.direction)
    k = _TURN / wave.length
    air["wave"] = wave.amplitude, k * east, k * north, k * wave.speed
    east, north = _heading(front.direction)
    air["front"] = front.height, east, north, front.speed, front.place, front.width
    air["fields"] = bool(np.any(air["slope"])) or wave.amplitude > 0.0 or front.height != 0.0


def _wet_waves(field: WetField, seed: int) -> Floats:
    """Plane waves whose mean covariance over draws is sigma^2 exp(-d^2 / (2 length^2)).

    Their wave vectors are normal with deviation 1 / length, their phases uniform (Rahimi
    and Recht 2007, random Fourier features); the pattern moves as one (Taylor 1938).
    """
    waves = np.zeros((WAVES, 5))
    waves[:, 0] = field.sigma * math.sqrt(2.0 / WAVES)
    waves[:, 1:3] = normals(seed, "troposphere.field", WAVES, 2) / field.length
    east, north = _heading(field.direction)
    waves[:, 3] = field.wind * (waves[:, 1] * east + waves[:, 2] * north)
    waves[:, 4] = _TURN * uniforms(seed, "troposphere.field.phase", WAVES)
    return waves
