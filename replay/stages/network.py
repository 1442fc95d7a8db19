"""Which stages a network of reference stations needs, and how they are called."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from itertools import combinations
from typing import Any

from replay import channels
from replay.errors import MissingChannelError, UsageError
from replay.stages.base import BASE, RECEIVER, Stage
from replay.stages.baseline_errors import BaselineErrors
from replay.stages.network_ambiguities import NetworkAmbiguities
from replay.stages.network_config import NetworkInsConfig, NetworkRtkConfig, NetworkSettings
from replay.stages.network_corrections import NetworkCorrections
from replay.stages.satellites import Satellites


@dataclasses.dataclass(frozen=True, slots=True)
class Layout:
    """Stations of a network.

    Attributes
    ----------
    master : str
        Receiver that the rover's differences are to.
    stations : tuple of str
        The others.
    """

    master: str
    stations: tuple[str, ...]

    @property
    def baselines(self) -> tuple[str, ...]:
        """Names of the baselines from the master, in the order of stations."""
        return tuple(f"{self.master}-{station}" for station in self.stations)


def find_layout(config: NetworkSettings, topics: Collection[str]) -> Layout:
    """Master and stations of a log: those that are named, else all but the rover.

    Raises
    ------
    MissingChannelError
        Where a station that is named has no observations in the log.
    UsageError
        Where the log leaves open which receiver is the master, or has no other station.
    """
    spec = channels.GNSS_OBS
    there = sorted(spec.parts(topic)["receiver"] for topic in topics if spec.matches(topic))
    rover = config.gnss.receiver or "rover"
    master = config.gnss.base
    if not master:
        raise UsageError(
            "which station is the master?",
            where=f"the log has receivers {', '.join(there) or 'none'}",
            mend="choose one: --set gnss.base=NAME",
        )
    stations = config.network.stations
    if not stations:
        stations = tuple(name for name in there if name not in (rover, master))
    for name in (master, *stations):
        if name not in there:
            raise MissingChannelError(
                f"the log has no observations of the station {name}",
                where=f"the log has receivers {', '.join(there) or 'none'}",
                mend="--set network.stations=[...], --set gnss.base=NAME",
            )
    if not stations or rover in stations or master in (rover, *stations):
        raise UsageError(
            "a network has a master and other stations, none of them the rover",
            where=f"master {master}, stations {', '.join(stations) or 'none'}, rover {rover}",
            mend="--set network.stations=[...], --set gnss.base=NAME, --set gnss.receiver=NAME",
        )
    return Layout(master, stations)


def station_stages(config: NetworkSettings, layout: Layout) -> list[Stage[Any]]:
    """Stages from observations of the stations to the errors of their baselines."""
    stages: list[Stage[Any]] = [Satellites(BASE)]
    stages += [Satellites(station) for station in layout.stations]
    ends = [(BASE, layout.master), *((name, name) for name in layout.stations)]
    if config.network.baselines == "all":
        pairs = list(combinations(ends, 2))
    else:
        pairs = [(ends[0], end) for end in ends[1:]]
    for (first, first_name), (second, second_name) in pairs:
        stages.append(NetworkAmbiguities(first, second, f"{first_name}-{second_name}"))
    stages += [BaselineErrors(name) for name in layout.baselines]
    return stages


def corrected_stages(config: NetworkSettings, topics: Collection[str]) -> tuple[Stage[Any], ...]:
    """All stages from observations to the network's corrections of a rover."""
    layout = find_layout(config, topics)
    return (
        Satellites(RECEIVER),
        *station_stages(config, layout),
        NetworkCorrections(layout.stations, layout.baselines),
    )


def rover_stages(
    config: NetworkRtkConfig | NetworkInsConfig, topics: Collection[str]
) -> tuple[Stage[Any], ...]:
    """All stages before the rover's own filter; only those of the receivers in mode `single`."""
    if config.mode == "single":
        return (Satellites(RECEIVER), Satellites(BASE))
    return corrected_stages(config, topics)
