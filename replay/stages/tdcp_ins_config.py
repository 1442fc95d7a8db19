"""Settings of the inertial system that is held by displacements."""

from __future__ import annotations

from typing import Annotated, Literal

from replay.configuration import Section, quantity
from replay.stages.loose_config import Alignment, Filter, Imu, NonHolonomic, Output, Stops
from replay.stages.smoothing_config import Smoothing
from replay.stages.tdcp_config import TdcpConfig


class TdcpIns(Section, frozen=True):
    """How displacements are used.

    `position`: the sum of displacements since the chain began, with one deviation for
    each axis that does not grow, as Tang et al. (2021) do; `displacement`: each
    displacement by itself with its own covariance, so that errors of the sum grow as
    they do.
    """

    measurement: Literal["position", "displacement"] = "position"
    position_std: Annotated[float, quantity("m", "of the sum, each axis")] = 0.03
    displacement_floor: tuple[
        Annotated[float, quantity("m", "east, north, up; added in quadrature")], ...
    ] = (0.002, 0.002, 0.003)
    displacement_scale: Annotated[float, quantity("1", "on the stated deviation")] = 1.0
    velocity: bool = True
    velocity_floor: tuple[
        Annotated[float, quantity("m/s", "east, north, up; added in quadrature")], ...
    ] = (0.01, 0.01, 0.02)
    gate: Annotated[float, quantity("1", "chi-square of 3; 0 lets all in")] = 60.0
    rejections: int = 5
    anchor: bool = False
    outage_limit: Annotated[float, quantity("s", "without a displacement")] = 1.5
    latency: Annotated[float, quantity("s", "inertial rows wait this long for an epoch")] = 0.0


class TdcpInsConfig(TdcpConfig, frozen=True):
    """Settings of `tdcp-ins`."""

    name: str = "tdcp-ins"
    tdcp_ins: TdcpIns = TdcpIns()
    filter: Filter = Filter()
    alignment: Alignment = Alignment()
    stops: Stops = Stops()
    non_holonomic: NonHolonomic = NonHolonomic()
    imu: Imu = Imu()
    output: Output = Output()
    smoothing: Smoothing = Smoothing()
