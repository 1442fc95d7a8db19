"""Settings of tightly coupled GNSS/INS filters."""

from __future__ import annotations

from typing import Annotated

from replay.configuration import Section, quantity
from replay.stages.loose_config import (
    Alignment,
    Filter,
    Imu,
    NonHolonomic,
    Output,
    Stops,
)
from replay.stages.smoothing_config import Smoothing
from replay.stages.spp_config import Spp, SppConfig


class Tight(Section, frozen=True):
    """How the satellites of an epoch are used on the inertial system."""

    code: bool = True
    doppler: bool = True
    phase: bool = False
    code_sigma: Annotated[float, quantity("m", "of a pseudorange in the zenith")] = 2.0
    doppler_sigma: Annotated[float, quantity("m/s", "of a range rate in the zenith")] = 0.1
    phase_sigma: Annotated[float, quantity("m", "of one carrier phase in the zenith")] = 0.004
    phase_gap: Annotated[float, quantity("s", "between epochs that are differenced")] = 2.5
    clock_noise: Annotated[float, quantity("1", "m^2/s, density of the clock")] = 0.05
    drift_noise: Annotated[float, quantity("1", "m^2/s^3, density of its drift")] = 0.05
    code_gate: Annotated[float, quantity("1", "innovation over deviation; 0 lets all in")] = 4.0
    doppler_gate: Annotated[float, quantity("1", "likewise")] = 4.0
    phase_gate: Annotated[float, quantity("1", "likewise")] = 4.0
    jump: Annotated[
        float, quantity("m", "of the middle innovation: the clock has been set by as much")
    ] = 5.0
    rejections: int = 20
    outage_limit: Annotated[float, quantity("s", "without a satellite")] = 1.5
    latency: Annotated[float, quantity("s", "inertial rows wait this long for an epoch")] = 0.0


class TightConfig(SppConfig, frozen=True):
    """Settings of `gnss-ins-tc`; weights and exclusions are those of the section `spp`."""

    name: str = "gnss-ins-tc"
    spp: Spp = Spp()
    tight: Tight = Tight()
    filter: Filter = Filter()
    alignment: Alignment = Alignment()
    stops: Stops = Stops()
    non_holonomic: NonHolonomic = NonHolonomic()
    imu: Imu = Imu()
    output: Output = Output()
    smoothing: Smoothing = Smoothing()
