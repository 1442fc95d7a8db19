"""Settings of precise point positioning on an inertial system."""

from __future__ import annotations

from typing import Annotated, Literal

from replay.configuration import Section, quantity
from replay.stages.loose_config import (
    Alignment,
    Filter,
    Imu,
    NonHolonomic,
    Output,
    Stops,
)
from replay.stages.ppp_config import Motion, Phases, Ppp, PppConfig
from replay.stages.smoothing_config import Smoothing

# Sections of their own, not other values of the shared ones: a table that sets one key of a
# section takes the section's own defaults for the rest.


class PppTight(Section, frozen=True):
    """How the receiver's clock goes on, and what is used on the inertial system."""

    doppler: bool = True
    wind_up: bool = True  # of phases, where the vehicle turns
    clock: Literal["walk", "white"] = "walk"  # goes on by its drift, or begins anew each epoch
    clock_noise: Annotated[float, quantity("1", "m^2/s, density of the clock")] = 0.05
    drift_noise: Annotated[float, quantity("1", "m^2/s^3, density of its drift")] = 0.05
    jump: Annotated[
        float, quantity("m", "of the middle innovation of codes: the clock has been set by it")
    ] = 30.0
    outage_limit: Annotated[float, quantity("s", "without a satellite")] = 1.5
    latency: Annotated[float, quantity("s", "inertial rows wait this long for an epoch")] = 0.0


class CarriedMotion(Motion, frozen=True):
    """How the antenna moves until the unit is aligned; then the unit carries it.

    `tight` says how the clock goes on after that.
    """

    dynamics: Literal["velocity"] = "velocity"
    process_noise: Annotated[float, quantity("m/s", "walk of the velocity in 1 s")] = 3.0


class BridgedPhases(Phases, frozen=True):
    """What the inertial system bridges need not begin anew."""

    gap: Annotated[float, quantity("s", "without a phase that ends one")] = 60.0
    failures: int = 5


class InertialPpp(Ppp, frozen=True):
    """Precise point positioning on an inertial system."""

    motion: CarriedMotion = CarriedMotion()
    phases: BridgedPhases = BridgedPhases()


class PppInsConfig(PppConfig, frozen=True):
    """Settings of `ppp-ins-tc`.

    Until the unit is aligned the receiver is positioned without it, as `ppp` does with
    `ppp.motion.dynamics` of velocity; what is known then is taken over.
    """

    name: str = "ppp-ins-tc"
    ppp: InertialPpp = InertialPpp()
    tight: PppTight = PppTight()
    filter: Filter = Filter()
    alignment: Alignment = Alignment()
    stops: Stops = Stops()
    non_holonomic: NonHolonomic = NonHolonomic()
    imu: Imu = Imu()
    output: Output = Output()
    smoothing: Smoothing = Smoothing()
