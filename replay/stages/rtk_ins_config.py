"""Settings of tightly coupled RTK/INS."""

from __future__ import annotations

from typing import Annotated, Literal

from replay.configuration import quantity
from replay.stages.rtk_config import Ambiguities, Base, Differences, Motion, Rtk
from replay.stages.tight_config import Tight, TightConfig

# Sections of their own, not other values of the shared ones: a table that sets one key of a
# section takes the section's own defaults for the rest.


class PatientTight(Tight, frozen=True):
    """Inertial rows wait for the base."""

    latency: Annotated[float, quantity("s", "inertial rows wait this long for an epoch")] = 0.6


class CarriedMotion(Motion, frozen=True):
    """The inertial system carries the position."""

    dynamics: Literal["static"] = "static"


class HeldAmbiguities(Ambiguities, frozen=True):
    """Integers are fed back soon: the inertial system bridges what breaks them."""

    mode: Literal["instantaneous", "continuous", "fix-and-hold", "float"] = "fix-and-hold"
    hold_count: int = 3
    proven: int = 3


class InertialRtk(Rtk, frozen=True):
    """Relative positioning on an inertial system."""

    differences: Differences = Differences()
    motion: CarriedMotion = CarriedMotion()
    ambiguities: HeldAmbiguities = HeldAmbiguities()


class RtkInsConfig(TightConfig, frozen=True):
    """Settings of `rtk-ins-tc`.

    Of `tight` the lever arm and the limits of an outage are read; inertial rows wait for the
    base's epoch (`tight.latency`, which is to be no less than `base.wait`). Integers that
    are believed are fed back: `continuous` keeps the filter float and only shows them,
    `instantaneous` forgets every ambiguity after its epoch.
    """

    name: str = "rtk-ins-tc"
    tight: PatientTight = PatientTight()
    base: Base = Base()
    rtk: InertialRtk = InertialRtk()

    def distance_noise(self) -> float:
        """Deviation of what grows with the distance (m/m), where nothing takes it off."""
        return self.rtk.differences.baseline_noise
