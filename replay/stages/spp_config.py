"""Settings of single-point positioning."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from replay.configuration import Section, quantity
from replay.kernels import weighting
from replay.stages.gnss_config import GnssConfig
from replay.stages.smoothing_config import Smoothing

Weighting = Literal["equal", "sine", "threshold", "double-angle", "strength", "sum"]
WEIGHTINGS: Final = {
    "equal": weighting.EQUAL,
    "sine": weighting.SINE,
    "threshold": weighting.THRESHOLD,
    "double-angle": weighting.DOUBLE_ANGLE,
    "strength": weighting.STRENGTH,
    "sum": weighting.SUM,
}
"""Numbers that the kernels have for :data:`Weighting`."""


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


class Kfspp(Section, frozen=True):
    """How the filter carries position, velocity and clocks from epoch to epoch.

    Tang et al. (2021) print 0.05 for the spectral densities of velocity, clock and drift,
    4.5 for the variance of a range and 0.18 for that of a range rate. A velocity density of
    0.05 m^2/s^3 is a vehicle that hardly accelerates, and the clock's 0.05 m^2/s leaves
    little to a quartz: the defaults here are a car's and a quartz's, the printed values
    are to be had by `--set`.
    """

    code_sigma: Annotated[float, quantity("m", "of a pseudorange in the zenith")] = 2.0
    doppler_sigma: Annotated[float, quantity("m/s", "of a range rate in the zenith")] = 0.1
    velocity_noise: Annotated[float, quantity("1", "m^2/s^3, density of acceleration")] = 2.0
    clock_noise: Annotated[float, quantity("1", "m^2/s, density of the clock")] = 0.05
    drift_noise: Annotated[float, quantity("1", "m^2/s^3, density of its drift")] = 0.05
    gate: Annotated[float, quantity("1", "innovation over its deviation; 0 lets all in")] = 5.0
    gap: Annotated[float, quantity("s", "after which it begins anew")] = 10.0
    jump: Annotated[float, quantity("m", "by which a clock has been set")] = 3000.0
    rejections: int = 5


class KfsppConfig(SppConfig, frozen=True):
    """Settings of `kfspp`; weights and exclusions are those of the section `spp`."""

    name: str = "kfspp"
    kfspp: Kfspp = Kfspp()
    smoothing: Smoothing = Smoothing()
