"""Settings of time-differenced carrier phases and of the search for cycle slips."""

from __future__ import annotations

from typing import Annotated, Literal

from replay.configuration import Section, quantity
from replay.stages.gnss_config import GnssConfig
from replay.stages.spp_config import Weighting


class Slips(Section, frozen=True):
    """How breaks of a carrier phase are found before it is used."""

    loss_of_lock: bool = True
    lock_time: bool = True
    half_cycles: bool = True
    gap: Annotated[float, quantity("s", "without a phase, from which it is a new one")] = 10.0
    geometry_free: Annotated[
        float, quantity("m", "jump of the difference of two phases in the zenith; 0: no test")
    ] = 0.025
    geometry_free_rate: Annotated[float, quantity("m/s", "added, for the ionosphere")] = 0.005
    wide_lane: Annotated[
        float, quantity("1", "deviations of the Melbourne-Wuebbena combination; 0: no test")
    ] = 5.0
    wide_lane_least: Annotated[float, quantity("1", "cycles, below which nothing is a slip")] = 1.5
    wide_lane_sigma: Annotated[
        float, quantity("1", "cycles, before it is known, in the zenith")
    ] = 0.3
    doppler: Annotated[
        float, quantity("1", "deviations of a phase from its Doppler; 0: no test")
    ] = 5.0
    doppler_sigma: Annotated[float, quantity("m/s", "of a range rate in the zenith")] = 0.05
    jerk: Annotated[float, quantity("1", "m/s^3 of the antenna, added")] = 5.0
    clock_jump: Annotated[float, quantity("m", "common to all signals: the clock's")] = 50.0


class Tdcp(Section, frozen=True):
    """How differences of phases in time become a displacement."""

    phase_sigma: Annotated[float, quantity("m", "of a phase in the zenith")] = 0.004
    drift_sigma: Annotated[
        float, quantity("m/s", "in the zenith, of orbit, clock and atmosphere")
    ] = 0.001
    weighting: Weighting = "sum"
    clocks: Literal["common", "system"] = "common"
    confidence: Annotated[float, quantity("1", "that a good epoch passes the test")] = 0.999
    robust: Literal["none", "huber", "igg3"] = "igg3"
    gate: Annotated[float, quantity("1", "deviations from which a phase is left out")] = 4.0
    exclusions: int = 8
    repair: bool = True
    half_cycles: bool = True
    repair_sigma: Annotated[
        float, quantity("1", "largest deviation of a jump over the step it is rounded to")
    ] = 0.15
    repair_gate: Annotated[float, quantity("1", "deviations off whole cycles")] = 3.0
    satellites: int = 5
    freedom: int = 1
    unit_limit: Annotated[float, quantity("1", "unit-weight deviation that is put up with")] = 3.0
    pdop: Annotated[float, quantity("1", "largest that is believed")] = 30.0
    max_gap: Annotated[float, quantity("s", "between two epochs of a difference")] = 5.0
    carry: Annotated[
        float, quantity("s", "for which the last velocity goes on where phases do not")
    ] = 0.0
    carry_acceleration: Annotated[float, quantity("m/s^2", "deviation while carried")] = 1.0
    initial_std: tuple[
        Annotated[float, quantity("m", "of a chain's first position; east, north, up")], ...
    ] = (2.0, 2.0, 4.0)


class TdcpConfig(GnssConfig, frozen=True):
    """Settings of `tdcp`."""

    name: str = "tdcp"
    slips: Slips = Slips()
    tdcp: Tdcp = Tdcp()
