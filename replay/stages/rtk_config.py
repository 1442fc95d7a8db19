"""Settings of relative positioning."""

from __future__ import annotations

from typing import Annotated, Literal

from replay.configuration import Section, quantity
from replay.stages.smoothing_config import Smoothing
from replay.stages.spp_config import SppConfig, Weighting


class Base(Section, frozen=True):
    """Which epoch of the base serves, and what is known of the base."""

    moving: bool = False
    max_age: Annotated[float, quantity("s", "of a base epoch, against the rover's")] = 30.0
    tolerance: Annotated[float, quantity("s", "by which epochs of one nominal time differ")] = 0.1
    wait: Annotated[float, quantity("s", "of log time, for the base's epoch to come")] = 0.5
    length: Annotated[float, quantity("m", "of the baseline where it is known, else 0")] = 0.0
    length_sigma: Annotated[float, quantity("m", "of it")] = 0.01


class Differences(Section, frozen=True):
    """What differences between the receivers are worth."""

    frequencies: int = 3
    code_sigma: tuple[
        Annotated[float, quantity("m", "of one receiver in the zenith, by signal slot")], ...
    ] = (1.0,)
    phase_sigma: tuple[
        Annotated[float, quantity("m", "of one receiver in the zenith, by signal slot")], ...
    ] = (0.004,)
    system_scale: tuple[
        Annotated[float, quantity("1", "on the code's; GPS, GLO, GAL, BDS, QZSS")], ...
    ] = (1.0, 3.0, 1.0, 1.0, 1.0)
    weighting: Weighting = "sum"
    clock_stability: Annotated[
        float, quantity("1", "s per s of a satellite's clock, over the base's age")
    ] = 5e-12
    baseline_noise: Annotated[float, quantity("1", "m per m of baseline")] = 0.0
    code_gate: Annotated[float, quantity("1", "deviations of a residual that are believed")] = 4.0
    phase_gate: Annotated[float, quantity("1", "deviations of a residual that are believed")] = 4.0


class Motion(Section, frozen=True):
    """How the states go on from one epoch to the next."""

    dynamics: Literal["static", "kinematic", "velocity", "acceleration"] = "kinematic"
    position_sigma: Annotated[float, quantity("m", "before the first measurement")] = 100.0
    velocity_sigma: Annotated[float, quantity("m/s", "before the first measurement")] = 10.0
    acceleration_sigma: Annotated[float, quantity("m/s^2", "before the first measurement")] = 3.0
    process_noise: Annotated[
        float, quantity("1", "m, m/s or m/s^2 in a second, of the last state of the motion")
    ] = 0.0
    ambiguity_sigma: Annotated[float, quantity("m", "when it begins")] = 30.0
    ambiguity_noise: Annotated[float, quantity("m", "walk of an ambiguity in 1 s")] = 2e-5
    ionosphere: bool = False
    ionosphere_sigma: Annotated[float, quantity("1", "slant, m per m of baseline")] = 2e-6
    ionosphere_noise: Annotated[float, quantity("1", "walk in 1 s, m per m of baseline")] = 1e-7
    troposphere: bool = False
    wet_sigma: Annotated[float, quantity("m", "zenith, of each end")] = 0.1
    wet_noise: Annotated[float, quantity("m", "walk in 1 s, zenith, of each end")] = 1e-4
    gap: Annotated[float, quantity("s", "without a phase that ends an ambiguity")] = 5.0
    geometry_free: Annotated[float, quantity("m", "jump between frequencies that is a slip")] = 0.05
    rejections: int = 2


class Ambiguities(Section, frozen=True):
    """How real ambiguities become integers."""

    mode: Literal["instantaneous", "continuous", "fix-and-hold", "float"] = "continuous"
    test: Literal["ratio", "w-ratio"] = "ratio"
    threshold: Annotated[float, quantity("1", "of the test")] = 3.0
    success: Annotated[float, quantity("1", "least bootstrapped success rate")] = 0.0
    mask: Annotated[float, quantity("rad", "elevation below which none is tried")] = 0.2618
    lock: int = 0
    least: int = 4
    partial: Literal["none", "elevation", "success"] = "elevation"
    drops: int = 5
    unit_weight: Annotated[float, quantity("1", "largest of the fixed phases' residuals")] = 3.0
    apart: Annotated[
        float, quantity("m", "between fixed and float position, per axis, beside four deviations")
    ] = 1.0
    proven: int = 10
    confirm: int = 5
    hold_count: int = 10
    hold_sigma: Annotated[float, quantity("1", "cycles, of an integer that is fed back")] = 0.03
    hold_mask: Annotated[float, quantity("rad", "elevation below which none is held")] = 0.2618


class Rtk(Section, frozen=True):
    """Relative positioning."""

    differences: Differences = Differences()
    motion: Motion = Motion()
    ambiguities: Ambiguities = Ambiguities()


class RtkConfig(SppConfig, frozen=True):
    """Settings of `rtk`; those of `spp` are for the receivers alone."""

    name: str = "rtk"
    base: Base = Base()
    rtk: Rtk = Rtk()
    smoothing: Smoothing = Smoothing()

    def distance_noise(self) -> float:
        """Deviation of what grows with the distance (m/m), where nothing takes it off."""
        return self.rtk.differences.baseline_noise


class MovingBaseConfig(RtkConfig, frozen=True):
    """Settings of `moving-base`."""

    name: str = "moving-base"
    base: Base = Base(moving=True, max_age=1.0)
