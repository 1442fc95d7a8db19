"""Settings of a network of reference stations and of what uses its corrections."""

from __future__ import annotations

from typing import Annotated, Literal

from replay.configuration import Section, quantity
from replay.stages.gnss_config import GnssConfig
from replay.stages.rtk_config import RtkConfig
from replay.stages.rtk_ins_config import RtkInsConfig
from replay.stages.spp_config import Weighting


class Network(Section, frozen=True):
    """Which stations there are; the master is `gnss.base`."""

    # Beside the master; none named: every receiver of the log but the rover.
    stations: tuple[str, ...] = ()
    # `star` has a baseline from the master to each station, `all` also those between them.
    baselines: Literal["star", "all"] = "star"


class Integers(Section, frozen=True):
    """How the integers between two reference stations are found: wide lane, then L1, then L2."""

    code_sigma: tuple[
        Annotated[float, quantity("m", "of one receiver in the zenith, by signal slot")], ...
    ] = (0.3,)
    phase_sigma: tuple[
        Annotated[float, quantity("m", "of one receiver in the zenith, by signal slot")], ...
    ] = (0.005,)
    # Multipath: epochs that come closer to each other tell less than they seem to.
    code_correlation: Annotated[float, quantity("s", "of the codes' errors")] = 6.0
    phase_correlation: Annotated[float, quantity("s", "of the phases' errors")] = 2.0
    weighting: Weighting = "sum"
    ionosphere_sigma: Annotated[float, quantity("1", "slant, m per m of baseline")] = 4e-6
    ionosphere_noise: Annotated[float, quantity("1", "walk in 1 s, m per m of baseline")] = 1e-7
    wet_sigma: Annotated[float, quantity("m", "zenith, of each station")] = 0.05
    wet_noise: Annotated[float, quantity("m", "walk in 1 s, zenith, of each station")] = 1e-5
    orbit_sigma: Annotated[float, quantity("1", "m per m of baseline, of a phase")] = 5e-8
    ambiguity_sigma: Annotated[float, quantity("m", "when it begins")] = 30.0
    ambiguity_noise: Annotated[float, quantity("m", "walk of an ambiguity in 1 s")] = 1e-5
    code_gate: Annotated[float, quantity("1", "deviations of a residual that are believed")] = 4.0
    phase_gate: Annotated[float, quantity("1", "deviations of a residual that are believed")] = 4.0
    gap: Annotated[float, quantity("s", "without a phase that ends an ambiguity")] = 5.0
    geometry_free: Annotated[float, quantity("m", "jump between frequencies that is a slip")] = 0.05
    rejections: int = 3
    test: Literal["w-ratio", "ratio"] = "w-ratio"
    threshold: Annotated[float, quantity("1", "of the test")] = 3.0
    success: Annotated[float, quantity("1", "least bootstrapped success rate")] = 0.999
    mask: Annotated[float, quantity("rad", "elevation below which none is tried")] = 0.1745
    lock: int = 2
    confirm: int = 3  # epochs that the same integers must pass before they are used
    doubt: int = 10  # epochs in a row that speak for another integer before it is taken
    tolerance: Annotated[float, quantity("s", "by which epochs of one nominal time differ")] = 0.1
    wait: Annotated[float, quantity("s", "of log time, for the other station's epoch")] = 0.5


class Errors(Section, frozen=True):
    """The filter of each double difference between stations: Lee (2010), eqs. 1 to 4."""

    error_sigma: Annotated[float, quantity("m", "before the first residual")] = 1.0
    rate_sigma: Annotated[float, quantity("m/s", "before the first residual")] = 1e-3
    acceleration_sigma: Annotated[float, quantity("m/s^2", "before the first residual")] = 1e-6
    acceleration_noise: Annotated[
        float, quantity("1", "m/s^2 in sqrt(s), walk of the acceleration")
    ] = 4e-6
    # Less than `integers.phase_sigma`, which is of multipath and noise together.
    multipath_sigma: Annotated[float, quantity("m", "of one receiver in the zenith")] = 0.004
    multipath_tau: Annotated[float, quantity("s", "its correlation time")] = 30.0
    gate: Annotated[float, quantity("1", "innovation over its deviation; 0 lets all in")] = 5.0
    rejections: int = 5  # in a row, after which the filter of a double difference begins anew
    gap: Annotated[float, quantity("s", "without a residual that ends it")] = 60.0


class Interpolation(Section, frozen=True):
    """How the errors at the stations become those at the rover."""

    # Plane through the master, linear combination, inverse distances, collocation.
    method: Literal["lim", "lcm", "dim", "lsc"] = "lim"
    slope: Annotated[float, quantity("1", "m per m, deviation of the errors' slopes")] = 4e-6
    curvature: Annotated[float, quantity("1", "1/m, deviation of their second derivatives")] = 5e-13
    # Longer than the stations' interval: of older errors nobody waits for the next ones.
    max_age: Annotated[float, quantity("s", "of a station's errors; carried on by their rate")] = (
        10.0
    )
    tolerance: Annotated[float, quantity("s", "by which epochs of one nominal time differ")] = 0.1
    wait: Annotated[float, quantity("s", "of log time, for the stations' errors")] = 0.4


class NetworkConfig(GnssConfig, frozen=True):
    """Settings of `network`: the stations alone."""

    name: str = "network"
    network: Network = Network(baselines="all")
    integers: Integers = Integers()
    errors: Errors = Errors()
    interpolation: Interpolation = Interpolation()


class NetworkRtkConfig(RtkConfig, frozen=True):
    """Settings of `network-rtk`."""

    name: str = "network-rtk"
    mode: Literal["network", "single"] = "network"
    network: Network = Network()
    integers: Integers = Integers()
    errors: Errors = Errors()
    interpolation: Interpolation = Interpolation()

    def distance_noise(self) -> float:
        """What neither the network nor a state of the filter takes off is in the weight."""
        return _distance_noise(super().distance_noise(), self)


class NetworkInsConfig(RtkInsConfig, frozen=True):
    """Settings of `network-ins-tc`; `single` leaves the network out, with the same log."""

    name: str = "network-ins-tc"
    mode: Literal["network", "single"] = "network"
    network: Network = Network()
    integers: Integers = Integers()
    errors: Errors = Errors()
    interpolation: Interpolation = Interpolation()

    def distance_noise(self) -> float:
        """What neither the network nor a state of the filter takes off is in the weight."""
        return _distance_noise(super().distance_noise(), self)


def _distance_noise(own: float, config: NetworkRtkConfig | NetworkInsConfig) -> float:
    if config.mode == "single" and config.rtk.motion.ionosphere:
        return own
    return max(own, config.interpolation.slope)


NetworkSettings = NetworkConfig | NetworkRtkConfig | NetworkInsConfig
"""What the stages of a network are started with."""
