"""The pipelines by name: which stages run, in which order, with which settings."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable, Collection, Mapping
from typing import Any, Final

from replay.channels import COARSE, CORRECTIONS, SATELLITES, ChannelSpec
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
    unnamed : callable, optional
        Name of a run over a log with given topics, where the settings leave it empty.
    unsmoothed : str
        Why its runs cannot be smoothed; empty for those of a filter that can record.
    """

    name: str
    about: str
    parts: Callable[[], Parts]
    unnamed: Callable[[Any, Collection[str]], str] | None = None
    unsmoothed: str = ""

    @property
    def config(self) -> type[Section]:
        """Settings; their `name` names the run."""
        return self.parts()[0]

    def stages(self, config: Section, topics: Collection[str]) -> Stages:
        """The stages over a log, in an order in which every input stands before its reader."""
        found = self.parts()[1]
        return found(config, topics) if callable(found) else found

    def run_name(self, config: Section, topics: Collection[str]) -> str:
        """Name of a run over a log with these topics."""
        name = str(getattr(config, "name", self.name))
        return name if name or self.unnamed is None else self.unnamed(config, topics)


def _sights(usual: Stage[Any], config: Any, topics: Collection[str]) -> Stages:
    """The stage of orbits and corrections; only that of positions where a log brings the rest."""
    from replay.stages.coarse import CoarsePositions

    def brings(channel: ChannelSpec) -> bool:
        name = config.gnss.receiver
        return channel.at(receiver=name) in topics if name else any(map(channel.matches, topics))

    corrected = brings(SATELLITES) and brings(CORRECTIONS) and not brings(COARSE)
    return (CoarsePositions() if corrected else usual,)


def _gnss_ins_lc() -> Parts:
    from replay.stages.gnss_ins_lc import GnssInsLoose
    from replay.stages.loose_config import LooseConfig

    def stages(config: LooseConfig, topics: Collection[str]) -> Stages:
        return (GnssInsLoose(config.smoothing.record),)

    return LooseConfig, stages


def _gnss_ins_tc() -> Parts:
    from replay.stages.gnss_ins_tc import TightInertial
    from replay.stages.satellites import Satellites
    from replay.stages.tight_config import TightConfig

    def stages(config: TightConfig, topics: Collection[str]) -> Stages:
        return (Satellites(), TightInertial(config.smoothing.record))

    return TightConfig, stages


def _spp() -> Parts:
    from replay.stages.satellites import Satellites
    from replay.stages.spp import SinglePoint
    from replay.stages.spp_config import SppConfig

    return SppConfig, (Satellites(), SinglePoint())


def _kfspp() -> Parts:
    from replay.stages.kfspp import FilteredSinglePoint
    from replay.stages.satellites import Satellites
    from replay.stages.spp_config import KfsppConfig

    def stages(config: KfsppConfig, topics: Collection[str]) -> Stages:
        last = FilteredSinglePoint(config.smoothing.record)
        return (*_sights(Satellites(), config, topics), last)

    return KfsppConfig, stages


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

    def stages(config: TdcpInsConfig, topics: Collection[str]) -> Stages:
        last = TdcpInertial(config.smoothing.record)
        return (Satellites(), TimeDifferencedPhase(), last)

    return TdcpInsConfig, stages


def _ppp() -> Parts:
    from replay.stages.ppp import Ppp
    from replay.stages.ppp_config import PppConfig
    from replay.stages.precise_satellites import PreciseSatellites

    def stages(config: PppConfig, topics: Collection[str]) -> Stages:
        return (*_sights(PreciseSatellites(), config, topics), Ppp(config.smoothing.record))

    return PppConfig, stages


def _ppp_ins_tc() -> Parts:
    from replay.stages.ppp_ins_config import PppInsConfig
    from replay.stages.ppp_ins_tc import PppInertial
    from replay.stages.precise_satellites import PreciseSatellites

    def stages(config: PppInsConfig, topics: Collection[str]) -> Stages:
        last = PppInertial(config.smoothing.record)
        return (*_sights(PreciseSatellites(), config, topics), last)

    return PppInsConfig, stages


def _rtk() -> Parts:
    from replay.stages.rtk import Rtk
    from replay.stages.rtk_config import RtkConfig
    from replay.stages.satellites import Satellites

    def stages(config: RtkConfig, topics: Collection[str]) -> Stages:
        return (Satellites(), Satellites("base"), Rtk(record=config.smoothing.record))

    return RtkConfig, stages


def _rtk_ins_tc() -> Parts:
    from replay.stages.rtk_ins_config import RtkInsConfig
    from replay.stages.rtk_ins_tc import RtkInertial
    from replay.stages.satellites import Satellites

    def stages(config: RtkInsConfig, topics: Collection[str]) -> Stages:
        last = RtkInertial(record=config.smoothing.record)
        return (Satellites(), Satellites("base"), last)

    return RtkInsConfig, stages


def _moving_base() -> Parts:
    from replay.stages.rtk import MovingBaseSatellites, Rtk
    from replay.stages.rtk_config import MovingBaseConfig
    from replay.stages.satellites import Satellites

    def stages(config: MovingBaseConfig, topics: Collection[str]) -> Stages:
        return (Satellites(), MovingBaseSatellites(), Rtk(record=config.smoothing.record))

    return MovingBaseConfig, stages


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
        last = Rtk(corrected=config.mode == "network", record=config.smoothing.record)
        return (*rover_stages(config, topics), last)

    return NetworkRtkConfig, stages


def _network_ins_tc() -> Parts:
    from replay.stages.network import rover_stages
    from replay.stages.network_config import NetworkInsConfig
    from replay.stages.rtk_ins_tc import RtkInertial

    def stages(config: NetworkInsConfig, topics: Collection[str]) -> Stages:
        last = RtkInertial(corrected=config.mode == "network", record=config.smoothing.record)
        return (*rover_stages(config, topics), last)

    return NetworkInsConfig, stages


def _network_virtual() -> Parts:
    from replay.stages.network import corrected_stages
    from replay.stages.network_config import NetworkConfig
    from replay.stages.network_virtual import NetworkVirtual

    def stages(config: NetworkConfig, topics: Collection[str]) -> Stages:
        return (*corrected_stages(config, topics), NetworkVirtual())

    return NetworkConfig, stages


def _smooth() -> Parts:
    from replay.channels import FILTER_STATE, RELATIVE_POSITION
    from replay.stages.smooth import Smoother
    from replay.stages.smooth_choice import find_run
    from replay.stages.smooth_config import SmoothConfig

    def stages(config: SmoothConfig, topics: Collection[str]) -> Stages:
        run = find_run(config, topics, _unsmoothed())
        inertial = FILTER_STATE.at(run=run) in topics
        return (Smoother(run, inertial, relative=RELATIVE_POSITION.at(run=run) in topics),)

    return SmoothConfig, stages


def _smoothed(config: Any, topics: Collection[str]) -> str:
    from replay.stages.smooth_choice import find_run

    return f"{find_run(config, topics, _unsmoothed())}-smoothed"


def _unsmoothed() -> dict[str, str]:
    """Pipelines whose runs cannot be smoothed, and why."""
    return {p.name: p.unsmoothed for p in _ALL if p.unsmoothed}


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
        unsmoothed="every epoch is solved by itself, nothing goes on from one to the next",
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
        unsmoothed="displacements are solved one by one, no filter carries them",
    ),
    Pipeline(
        "tdcp-ins",
        "inertial samples held by displacements from time-differenced carrier phases",
        _tdcp_ins,
    ),
    Pipeline(
        "ppp",
        "precise point positioning: uncombined codes and phases, precise orbits and clocks",
        _ppp,
    ),
    Pipeline(
        "ppp-ins-tc",
        "tightly coupled PPP/INS: codes, phases, Doppler, precise orbits, inertial samples",
        _ppp_ins_tc,
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
        unsmoothed="it gives corrections of a network, and the place of no receiver",
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
        unsmoothed="it gives observations of a virtual station, and the place of no receiver",
    ),
    Pipeline(
        "moving-base",
        "relative positioning of two receivers that both move: baseline, heading",
        _moving_base,
    ),
    Pipeline(
        "smooth",
        "smoothing of a run that was made with smoothing.record, backwards through its log",
        _smooth,
        _smoothed,
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
