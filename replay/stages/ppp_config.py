"""Settings of precise point positioning."""

from __future__ import annotations

from typing import Annotated, Literal

from replay.configuration import Section, quantity
from replay.stages.gnss_config import Gnss
from replay.stages.precise_config import PreciseConfig
from replay.stages.smoothing_config import Smoothing
from replay.stages.spp_config import Weighting


class PppGnss(Gnss, frozen=True):
    """Which receiver, satellites and signals.

    The first two bands of a system are those that clocks of analysis centres are made of.
    """

    signals: tuple[str, ...] = (
        *("G1C", "G1W", "G1X", "G2W", "G2L", "G2X", "G2S", "G2C", "G5Q", "G5X", "G5I"),
        *("R1P", "R1C", "R2P", "R2C"),
        *("E1C", "E1X", "E1B", "E5Q", "E5X", "E5I", "E7Q", "E7X", "E7I"),
        *("C2I", "C2X", "C6I", "C6X", "C7I", "C7D", "C7X"),
        *("J1C", "J1X", "J1Z", "J2L", "J2X", "J2S", "J5Q", "J5X", "J5I"),
    )
    mask: Annotated[float, quantity("rad", "elevation below which nothing is used")] = 0.1222


class Measurements(Section, frozen=True):
    """What codes, phases and Doppler are worth."""

    frequencies: int = 2
    code_sigma: tuple[Annotated[float, quantity("m", "in the zenith, by signal slot")], ...] = (
        0.6,
    )
    phase_sigma: tuple[Annotated[float, quantity("m", "in the zenith, by signal slot")], ...] = (
        0.003,
    )
    doppler_sigma: Annotated[float, quantity("m/s", "in the zenith")] = 0.05
    code_scale: tuple[
        Annotated[float, quantity("1", "on the code's; GPS, GLO, GAL, BDS, QZSS")], ...
    ] = (1.0, 3.0, 1.0, 2.0, 1.5)
    phase_scale: tuple[
        Annotated[float, quantity("1", "on the phase's; GPS, GLO, GAL, BDS, QZSS")], ...
    ] = (1.0, 1.0, 1.0, 1.5, 1.0)
    high_scale: Annotated[
        float, quantity("1", "on both, of BeiDou's satellites in 24 h orbits")
    ] = 3.0
    range_std_scale: Annotated[
        float, quantity("1", "on what orbit and clock deviate beyond products.range_std")
    ] = 1.0
    range_walk: Annotated[
        float, quantity("1", "share of that deviation by which ambiguities walk in 1 s with it")
    ] = 2e-3
    weighting: Weighting = "sum"
    code_gate: Annotated[float, quantity("1", "deviations of a residual that are believed")] = 4.0
    phase_gate: Annotated[float, quantity("1", "deviations of a residual that are believed")] = 4.0
    rounds: int = 24


class Motion(Section, frozen=True):
    """How position and clocks go on from one epoch to the next."""

    dynamics: Literal["static", "kinematic", "velocity"] = "kinematic"
    position_sigma: Annotated[float, quantity("m", "before the first measurement")] = 100.0
    velocity_sigma: Annotated[float, quantity("m/s", "before the first measurement")] = 10.0
    process_noise: Annotated[
        float, quantity("1", "m or m/s in a second, of the last state of the motion")
    ] = 0.0
    clock_sigma: Annotated[float, quantity("m", "of the clock that codes tell")] = 100.0
    drift_noise: Annotated[float, quantity("m/s", "walk of the clock's drift in 1 s")] = 0.1
    system_noise: Annotated[float, quantity("m", "walk between systems' clocks in 1 s")] = 1e-4
    bias_sigma: Annotated[float, quantity("m", "of a bias between codes")] = 20.0
    bias_noise: Annotated[float, quantity("m", "walk of it in 1 s")] = 1e-4


class Delays(Section, frozen=True):
    """What the filter knows of troposphere and ionosphere before it measures them."""

    wet_sigma: Annotated[float, quantity("m", "zenith, about the model")] = 0.2
    wet_noise: Annotated[float, quantity("m", "walk in 1 s, zenith")] = 1e-4
    gradients: bool = True
    gradient_sigma: Annotated[float, quantity("m", "of each")] = 1e-3
    gradient_noise: Annotated[float, quantity("m", "walk in 1 s")] = 3e-6
    ionosphere: Literal["free", "constrained", "combination"] = "free"
    ionosphere_sigma: Annotated[float, quantity("m", "slant on L1, about the model")] = 100.0
    ionosphere_noise: Annotated[
        float, quantity("m", "walk in 1 s on L1 in the zenith; negative: begins anew each epoch")
    ] = 4e-3
    constraint_sigma: Annotated[float, quantity("m", "of the model, zenith on L1")] = 0.5
    constraint_time: Annotated[float, quantity("s", "that the model's error lasts")] = 1800.0


class Phases(Section, frozen=True):
    """How long ambiguities live."""

    sigma: Annotated[float, quantity("m", "when one begins")] = 100.0
    noise: Annotated[float, quantity("m", "walk of one in 1 s")] = 1e-5
    gap: Annotated[float, quantity("s", "without a phase that ends one")] = 10.0
    geometry_free: Annotated[
        float, quantity("m", "jump between frequencies that is a slip, zenith; 0: no test")
    ] = 0.03
    geometry_free_rate: Annotated[float, quantity("m/s", "added")] = 5e-4
    wide_lane: Annotated[
        float, quantity("1", "cycles of a jump that is a slip, zenith; 0: no test")
    ] = 2.0
    rejections: int = 2
    failures: int = 3


class Ambiguities(Section, frozen=True):
    """How real ambiguities become integers."""

    mode: Literal["float", "continuous", "fix-and-hold"] = "float"
    test: Literal["ratio", "w-ratio"] = "ratio"
    threshold: Annotated[float, quantity("1", "of the test")] = 3.0
    success: Annotated[float, quantity("1", "least bootstrapped success rate")] = 0.99
    mask: Annotated[float, quantity("rad", "elevation below which none is tried")] = 0.2618
    lock: int = 4
    least: int = 4
    partial: Literal["none", "elevation", "success"] = "elevation"
    drops: int = 8
    apart: Annotated[
        float, quantity("m", "between fixed and float position, per axis, beside four deviations")
    ] = 0.1
    proven: int = 10
    confirm: int = 5
    agree: int = 5
    lane_sigma: Annotated[
        float, quantity("m", "of a wide lane, by codes' biases and lasting reflections")
    ] = 0.08
    hold_count: int = 10
    hold_sigma: Annotated[float, quantity("1", "cycles, of an integer that is fed back")] = 0.03
    hold_mask: Annotated[float, quantity("rad", "elevation below which none is held")] = 0.2618


class Ppp(Section, frozen=True):
    """Precise point positioning."""

    measurements: Measurements = Measurements()
    motion: Motion = Motion()
    delays: Delays = Delays()
    phases: Phases = Phases()
    ambiguities: Ambiguities = Ambiguities()


class PppConfig(PreciseConfig, frozen=True):
    """Settings of `ppp`."""

    name: str = "ppp"
    gnss: PppGnss = PppGnss()
    ppp: Ppp = Ppp()
    smoothing: Smoothing = Smoothing()
