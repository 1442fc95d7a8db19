"""Satellites of a real sky: broadcast messages out of a log."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from replay import channels, time
from replay.errors import ConfigurationError, ReplayError
from replay.gnss.ephemerides import ephemeris_columns, ephemeris_records, satellite_names
from replay.kernels.ephemeris import SYSTEM_GALILEO
from replay.log.columns import Columns
from replay.log.reader import LogReader

Records = npt.NDArray[np.void]

# How far from its reference time a message is taken for the truth, s.
LIMITS_S: Final = {"G": 7200.0, "R": 1800.0, "E": 7200.0, "C": 7200.0, "J": 7200.0}
_CLOSEST_S: Final = 300  # a message that follows another sooner is not taken for the truth


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class RealSky:
    """Messages of a time.

    Attributes
    ----------
    satellites : list of arrays of EPHEMERIS_DTYPE
        Healthy messages of each satellite by reference time: its true orbit.
    messages : Columns
        What is broadcast: rows of `replay.BroadcastEphemeris`.
    """

    satellites: list[Records]
    messages: Columns


def read_sky(path: Path, systems: str, start_ns: int, end_ns: int) -> RealSky:
    """Messages of a log that a span needs.

    Parameters
    ----------
    path : Path
        Log with a channel of broadcast orbits, such as `replay import` makes of RINEX.
    systems : str
        RINEX letters.
    start_ns, end_ns : int, ns, GPS

    Raises
    ------
    ConfigurationError
        Where the log cannot be read or has no message of the span.
    """
    topic = channels.NAV.topic
    try:
        with LogReader(path) as reader:
            rows = reader.read(topic)
    except ReplayError as error:
        raise ConfigurationError(
            f"sky.navigation: {error.what}", where=str(path),
            mend=f"name a log with {topic}, as `replay import` makes of a navigation file",
        ) from error  # fmt: skip
    records = ephemeris_records(rows)
    letters = np.array([ord(system) for system in systems])
    sent = np.where(records["transmitted_ns"] != 0, records["transmitted_ns"], records["toe_ns"])
    limit_ns = np.array(
        [round(LIMITS_S.get(chr(n), 0.0)) * time.NS_PER_S for n in records["system"].tolist()],
        dtype=np.int64,
    )
    # Twice the limit: a span that one message at either side brackets is gone through whole.
    near = (records["toe_ns"] >= start_ns - 2 * limit_ns) & (
        records["toe_ns"] <= end_ns + 2 * limit_ns
    )
    wanted = near & np.isin(records["system"], letters)
    records, sent = records[wanted], sent[wanted]
    healthy = records[records["health"] == 0]
    names = satellite_names(healthy)
    satellites = [_orbit(healthy[names == name]) for name in np.unique(names)]
    if not satellites:
        raise ConfigurationError(
            f"no healthy message of {systems} near {time.to_text(start_ns)}",
            where=str(path),
            mend="see start.time and sky.systems, or name another log in sky.navigation",
        )
    told = sent <= end_ns
    messages = ephemeris_columns(records[told], np.maximum(sent[told], start_ns))
    return RealSky(satellites, messages)


def preferred(records: Records) -> Records:
    """Those of Galileo's I/NAV where there are some: a receiver uses one kind."""
    inav = (records["system"] != SYSTEM_GALILEO) | (records["source"] & 5 != 0)
    return records[inav] if inav.any() else records


def _orbit(records: Records) -> Records:
    """By reference time; of those that are close to each other the first, the last sent of it."""
    records = preferred(records)
    order = np.lexsort((-records["transmitted_ns"], records["toe_ns"]))
    kept: list[int] = []
    for row in order.tolist():
        toe = int(records["toe_ns"][row])
        if not kept or toe - int(records["toe_ns"][kept[-1]]) >= _CLOSEST_S * time.NS_PER_S:
            kept.append(row)
    return records[np.array(kept, dtype=np.int64)]
