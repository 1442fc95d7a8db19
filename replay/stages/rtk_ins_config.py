"""Settings of tightly coupled RTK/INS."""

from __future__ import annotations

from replay.stages.rtk_config import Ambiguities, Base, Motion, Rtk
from replay.stages.tight_config import Tight, TightConfig


class RtkInsConfig(TightConfig, frozen=True):
    """Settings of `rtk-ins-tc`.

    Of `tight` the lever arm and the limits of an outage are read; inertial rows wait for the
    base's epoch (`tight.latency`, which is to be no less than `base.wait`). Integers that
    are believed are fed back: `continuous` keeps the filter float and only shows them,
    `instantaneous` forgets every ambiguity after its epoch.
    """

    name: str = "rtk-ins-tc"
    tight: Tight = Tight(latency=0.6)
    base: Base = Base()
    rtk: Rtk = Rtk(
        motion=Motion(dynamics="static"),
        ambiguities=Ambiguities(mode="fix-and-hold", hold_count=3, proven=3),
    )
