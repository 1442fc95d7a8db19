"""The pipelines by name: which stages run, in which order, with which settings."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable, Mapping
from typing import Any, Final

from replay.configuration import Section
from replay.errors import UsageError
from replay.stages.base import Stage
from replay.stages.gnss_ins_lc import GnssInsLoose
from replay.stages.gnss_ins_tc import TightInertial
from replay.stages.kfspp import FilteredSinglePoint
from replay.stages.loose_config import LooseConfig
from replay.stages.rtk import MovingBaseSatellites, Rtk
from replay.stages.rtk_config import MovingBaseConfig, RtkConfig
from replay.stages.rtk_ins_config import RtkInsConfig
from replay.stages.rtk_ins_tc import RtkInertial
from replay.stages.satellites import Satellites
from replay.stages.spp import SinglePoint
from replay.stages.spp_config import KfsppConfig, SppConfig
from replay.stages.tdcp import TimeDifferencedPhase
from replay.stages.tdcp_config import TdcpConfig
from replay.stages.tdcp_ins import TdcpInertial
from replay.stages.tdcp_ins_config import TdcpInsConfig
from replay.stages.tight_config import TightConfig


@dataclasses.dataclass(frozen=True, slots=True)
class Pipeline:
    """A name for a graph of stages.

    Attributes
    ----------
    name : str
    about : str
        One line for a person.
    config : type
        Settings that all its stages are started with; their `name` names the run.
    stages : callable
        Makes the stages, in an order in which every input stands before its reader.
    """

    name: str
    about: str
    config: type[Section]
    stages: Callable[[], tuple[Stage[Any], ...]]


_ALL: Final = (
    Pipeline(
        "gnss-ins-lc",
        "loosely coupled GNSS/INS: position and velocity fixes with inertial samples",
        LooseConfig,
        lambda: (GnssInsLoose(),),
    ),
    Pipeline(
        "gnss-ins-tc",
        "tightly coupled GNSS/INS without a base: ranges, Doppler, changes of carrier phase",
        TightConfig,
        lambda: (Satellites(), TightInertial()),
    ),
    Pipeline(
        "spp",
        "single-point positioning: pseudoranges to position, Doppler to velocity",
        SppConfig,
        lambda: (Satellites(), SinglePoint()),
    ),
    Pipeline(
        "kfspp",
        "filtered single-point positioning: constant velocity over code and Doppler",
        KfsppConfig,
        lambda: (Satellites(), FilteredSinglePoint()),
    ),
    Pipeline(
        "tdcp",
        "displacements from time-differenced carrier phases, chained to positions",
        TdcpConfig,
        lambda: (Satellites(), TimeDifferencedPhase()),
    ),
    Pipeline(
        "tdcp-ins",
        "inertial samples held by displacements from time-differenced carrier phases",
        TdcpInsConfig,
        lambda: (Satellites(), TimeDifferencedPhase(), TdcpInertial()),
    ),
    Pipeline(
        "rtk",
        "relative positioning to a fixed base: codes and phases, integer ambiguities",
        RtkConfig,
        lambda: (Satellites(), Satellites("base"), Rtk()),
    ),
    Pipeline(
        "rtk-ins-tc",
        "tightly coupled RTK/INS: differences to a base, integers, inertial samples",
        RtkInsConfig,
        lambda: (Satellites(), Satellites("base"), RtkInertial()),
    ),
    Pipeline(
        "moving-base",
        "relative positioning of two receivers that both move: baseline, heading",
        MovingBaseConfig,
        lambda: (Satellites(), MovingBaseSatellites(), Rtk()),
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
