"""The pipelines by name: which stages run, in which order, with which settings."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable, Collection, Mapping
from typing import Any, Final

from replay.configuration import Section
from replay.errors import UsageError
from replay.stages.base import Stage

Stages = tuple[Stage[Any], ...]
Parts = tuple[type[Section], Stages | Callable[[Any, Collection[str]], Stages]]
"""Settings that all stages are started with, and the stages, every input before its reader.

Where the log decides which stages there are, a function of the settings and its topics.
"""


@dataclasses.dataclass(frozen=True, slots=True)
class Pipeline:
    """A name for a graph of stages.

    Attributes
    ----------
    name : str
    about : str
        One line for a person.
    parts : callable
        Settings and stages. It imports them, so that a run loads its own kernels alone.
    """

    name: str
    about: str
    parts: Callable[[], Parts]

    @property
    def config(self) -> type[Section]:
        """Settings; their `name` names the run."""
        return self.parts()[0]

    def stages(self, config: Section, topics: Collection[str]) -> Stages:
        """The stages over a log, in an order in which every input stands before its reader."""
        found = self.parts()[1]
        return found(config, topics) if callable(found) else found


def _gnss_ins_lc() -> Parts:
    from replay.stages.gnss_ins_lc import GnssInsLoose
    from replay.stages.loose_config import LooseConfig

    return LooseConfig, (GnssInsLoose(),)


def _gnss_ins_tc() -> Parts:
    from replay.stages.gnss_ins_tc import TightInertial
    from replay.stages.satellites import Satellites
    from replay.stages.tight_config import TightConfig

    return TightConfig, (Satellites(), TightInertial())


def _spp() -> Parts:
    from replay.stages.satellites import Satellites
    from replay.stages.spp import SinglePoint
    from replay.stages.spp_config import SppConfig

    return SppConfig, (Satellites(), SinglePoint())


def _kfspp() -> Parts:
    from replay.stages.kfspp import FilteredSinglePoint
    from replay.stages.satellites import Satellites
    from replay.stages.spp_config import KfsppConfig

    return KfsppConfig, (Satellites(), FilteredSinglePoint())


def _tdcp() -> Parts:
    from replay.stages.satellites import Satellites
    from replay.stages.tdcp import TimeDifferencedPhase
    from replay.stages.tdcp_config import TdcpConfig

    return TdcpConfig, (Satellites(), TimeDifferencedPhase())


def _tdcp_ins() -> Parts:
    from replay.stages.satellites import Satellites
    from replay.stages.tdcp import TimeDifferencedPhase
    from replay.stages.tdcp_ins import TdcpInertial
    from replay.stages.tdcp_ins_config import TdcpInsConfig

    return TdcpInsConfig, (Satellites(), TimeDifferencedPhase(), TdcpInertial())


def _rtk() -> Parts:
    from replay.stages.rtk import Rtk
    from replay.stages.rtk_config import RtkConfig
    from replay.stages.satellites import Satellites

    return RtkConfig, (Satellites(), Satellites("base"), Rtk())


def _rtk_ins_tc() -> Parts:
    from replay.stages.rtk_ins_config import RtkInsConfig
    from replay.stages.rtk_ins_tc import RtkInertial
    from replay.stages.satellites import Satellites

    return RtkInsConfig, (Satellites(), Satellites("base"), RtkInertial())


def _moving_base() -> Parts:
    from replay.stages.rtk import MovingBaseSatellites, Rtk
    from replay.stages.rtk_config import MovingBaseConfig
    from replay.stages.satellites import Satellites

    return MovingBaseConfig, (Satellites(), MovingBaseSatellites(), Rtk())


def _network() -> Parts:
    from replay.stages.network import find_layout, station_stages
    from replay.stages.network_config import NetworkConfig

    def stages(config: NetworkConfig, topics: Collection[str]) -> Stages:
        return tuple(station_stages(config, find_layout(config, topics)))

    return NetworkConfig, stages


def _network_rtk() -> Parts:
    from replay.stages.network import rover_stages
    from replay.stages.network_config import NetworkRtkConfig
    from replay.stages.rtk import Rtk

    def stages(config: NetworkRtkConfig, topics: Collection[str]) -> Stages:
        return (*rover_stages(config, topics), Rtk(corrected=config.mode == "network"))

    return NetworkRtkConfig, stages


def _network_ins_tc() -> Parts:
    from replay.stages.network import rover_stages
    from replay.stages.network_config import NetworkInsConfig
    from replay.stages.rtk_ins_tc import RtkInertial

    def stages(config: NetworkInsConfig, topics: Collection[str]) -> Stages:
        return (*rover_stages(config, topics), RtkInertial(corrected=config.mode == "network"))

    return NetworkInsConfig, stages


def _network_virtual() -> Parts:
    from replay.stages.network import corrected_stages
    from replay.stages.network_config import NetworkConfig
    from replay.stages.network_virtual import NetworkVirtual

    def stages(config: NetworkConfig, topics: Collection[str]) -> Stages:
        return (*corrected_stages(config, topics), NetworkVirtual())

    return NetworkConfig, stages


_ALL: Final = (
    Pipeline(
        "gnss-ins-lc",
        "loosely coupled GNSS/INS: position and velocity fixes with inertial samples",
        _gnss_ins_lc,
    ),
    Pipeline(
        "gnss-ins-tc",
        "tightly coupled GNSS/INS without a base: ranges, Doppler, changes of carrier phase",
        _gnss_ins_tc,
    ),
    Pipeline(
        "spp",
        "single-point positioning: pseudoranges to position, Doppler to velocity",
        _spp,
    ),
    Pipeline(
        "kfspp",
        "filtered single-point positioning: constant velocity over code and Doppler",
        _kfspp,
    ),
    Pipeline(
        "tdcp",
        "displacements from time-differenced carrier phases, chained to positions",
        _tdcp,
    ),
    Pipeline(
        "tdcp-ins",
        "inertial samples held by displacements from time-differenced carrier phases",
        _tdcp_ins,
    ),
    Pipeline(
        "rtk",
        "relative positioning to a fixed base: codes and phases, integer ambiguities",
        _rtk,
    ),
    Pipeline(
        "rtk-ins-tc",
        "tightly coupled RTK/INS: differences to a base, integers, inertial samples",
        _rtk_ins_tc,
    ),
    Pipeline(
        "network",
        "reference stations: integers and errors of their baselines",
        _network,
    ),
    Pipeline(
        "network-rtk",
        "relative positioning with corrections from a network of reference stations",
        _network_rtk,
    ),
    Pipeline(
        "network-ins-tc",
        "tightly coupled RTK/INS with corrections from a network of reference stations",
        _network_ins_tc,
    ),
    Pipeline(
        "network-virtual",
        "a virtual reference station near the rover, from a network of reference stations",
        _network_virtual,
    ),
    Pipeline(
        "moving-base",
        "relative positioning of two receivers that both move: baseline, heading",
        _moving_base,
    ),
)

PIPELINES: Final[Mapping[str, Pipeline]] = {pipeline.name: pipeline for pipeline in _ALL}


def find_pipeline(name: str) -> Pipeline:
    """Pipeline of a name.

    Raises
    ------
    UsageError
        For an unknown name; the nearest known one is named.
    """
    if name in PIPELINES:
        return PIPELINES[name]
    near = difflib.get_close_matches(name, PIPELINES, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    raise UsageError(
        f"no pipeline {name!r}", mend=f"{hint}`replay pipelines` lists: {', '.join(PIPELINES)}"
    )
