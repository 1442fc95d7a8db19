"""Settings of single-point positioning."""

from __future__ import annotations

from typing import Annotated, Literal

from replay.configuration import Section, quantity
from replay.stages.gnss_config import GnssConfig

Weighting = Literal["equal", "sine", "threshold", "double-angle", "strength", "sum"]


class Spp(Section, frozen=True):
    """How pseudoranges and Doppler become a position and a velocity."""

    code_sigma: Annotated[float, quantity("m", "of a pseudorange in the zenith")] = 1.0
    system_scale: tuple[Annotated[float, quantity("1", "on it; GPS, GLO, GAL, BDS, QZSS")], ...] = (
        1.0,
        3.0,
        1.0,
        1.0,
        1.0,
    )
    doppler_sigma: Annotated[float, quantity("m/s", "of a range rate in the zenith")] = 0.05
    weighting: Weighting = "sum"
    range_std_scale: Annotated[
        float, quantity("1", "on the deviation that the system states for orbit and clock")
    ] = 0.3
    ionosphere_std: Annotated[float, quantity("1", "as a part of the modelled delay")] = 0.3
    troposphere_std: Annotated[float, quantity("m", "in the zenith")] = 0.1
    ionosphere_free: bool = False
    robust: Literal["none", "huber", "igg3"] = "none"
    raim: bool = True
    confidence: Annotated[float, quantity("1", "that a good epoch passes the test")] = 0.999
    exclusions: int = 4
    velocity: bool = True
    pdop: Annotated[float, quantity("1", "largest that is believed")] = 30.0


class SppConfig(GnssConfig, frozen=True):
    """Settings of `spp`."""

    name: str = "spp"
    spp: Spp = Spp()
