"""Single-point positioning: an epoch's pseudoranges to a position, Doppler to a velocity.

Every epoch is solved on its own. The innovations are residuals after the adjustment:
`innovation_std` is then that of the residual, and `accepted` says whether the satellite
was used. The solution's time is the epoch's with the receiver's clock error taken off.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import ConfigurationError
from replay.gnss.measurements import SATELLITE_NAMES, Selection, select_signals
from replay.kernels import single_point, single_records, weighting
from replay.kernels.gnss_records import SYSTEMS
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.kernels.sights import NOTE_DTYPE
from replay.schemas import solution_pb2
from replay.stages.base import Block, Context, Outputs, Port, StageSpec
from replay.stages.gnss_columns import (
    EVENT_TEXT,
    antenna_solution_columns,
    clock_columns,
    event_columns,
    geometry_columns,
    residual_columns,
)
from replay.stages.gnss_config import Gnss
from replay.stages.spp_config import WEIGHTINGS, Spp, SppConfig
from replay.stages.waiting import read_epochs

Array = np.ndarray[Any, Any]

_ROBUST: Final = {
    "none": weighting.ROBUST_NONE,
    "huber": weighting.ROBUST_HUBER,
    "igg3": weighting.ROBUST_IGG3,
}


@dataclasses.dataclass(frozen=True, slots=True)
class SppState:
    """Nothing crosses from one epoch to the next."""

    selection: Selection
    config: Array
    scratch: Array
    placed: bool  # whether the log says where each epoch was, to some metres


class SinglePoint:
    """The stage `spp`."""

    spec = StageSpec(
        name="spp",
        version=1,
        inputs=(
            Port(channels.GNSS_OBS),
            Port(channels.SATELLITES),
            Port(channels.CORRECTIONS),
            Port(channels.COARSE, optional=True),
        ),
        outputs=(
            Port(channels.FILTER_INNOVATIONS),
            Port(channels.FILTER_CLOCKS),
            Port(channels.FILTER_GEOMETRY),
            Port(channels.FILTER_EVENTS),
            Port(channels.SOLUTION),
        ),
        trigger=Port(channels.GNSS_OBS),
    )

    def start(self, config: Section, context: Context) -> SppState:
        """State before the first row."""
        if not isinstance(config, SppConfig):
            raise TypeError("spp takes an SppConfig")
        return SppState(
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            config=single_config(config.gnss, config.spp),
            scratch=np.zeros(1, dtype=SOLVE_DTYPE),
            placed=channels.COARSE.name in context.topics,
        )

    def step(self, state: SppState, block: Block) -> tuple[SppState, Outputs]:
        """Take a block of epochs."""
        found = read_epochs(block, state.selection)
        if found is None:
            return state, {}
        if not state.placed:
            # The iteration finds its way from the Earth's centre, too.
            found.epochs["placed"] = 1
        solutions = np.zeros(len(found.epochs) + 1, dtype=single_records.SINGLE_ROW_DTYPE)
        residuals = np.zeros(len(found.rows), dtype=single_records.RESIDUAL_DTYPE)
        notes = np.zeros(len(found.rows) + 2 * len(found.epochs), dtype=NOTE_DTYPE)
        counts = np.zeros(3, dtype=np.int64)
        single_point.run_single(
            state.config, found.epochs, found.rows, state.scratch,
            solutions, residuals, notes, counts,
        )  # fmt: skip
        solved = solutions[: counts[0]]
        solved["status"] = solution_pb2.SOLUTION_STATUS_SINGLE
        columns = {
            channels.FILTER_INNOVATIONS: residual_columns(residuals[: counts[1]]),
            channels.FILTER_CLOCKS: clock_columns(solved),
            channels.FILTER_GEOMETRY: geometry_columns(solved),
            channels.FILTER_EVENTS: event_columns(notes[: counts[2]], EVENT_TEXT),
            channels.SOLUTION: antenna_solution_columns(solved),
        }
        return state, {channel.name: rows for channel, rows in columns.items() if len(rows)}

    def finish(self, state: SppState) -> Outputs:
        """Nothing is left to say."""
        return {}

    def dump(self, state: SppState) -> bytes:
        """Nothing crosses from one epoch to the next."""
        return b""

    def restore(self, state: SppState, data: bytes) -> SppState:
        """The state of the start."""
        return state


def excluded_satellites(gnss: Gnss) -> Array:
    """1 for each satellite (180,) that is not to be used, by its dense number.

    Raises
    ------
    ConfigurationError
        Where a satellite is unknown.
    """
    excluded = np.zeros(len(SATELLITE_NAMES), dtype=np.int64)
    names = [name.decode() for name in SATELLITE_NAMES]
    for name in gnss.exclude:
        if name not in names:
            raise ConfigurationError(
                f"gnss.exclude: no satellite {name!r}", mend='write them as "G05"'
            )
        excluded[names.index(name)] = 1
    return excluded


def single_config(gnss: Gnss, spp: Spp) -> Array:
    """Settings as the record that the compiled loop reads.

    Raises
    ------
    ConfigurationError
        Where a satellite is unknown or a list has the wrong length.
    """
    record = np.zeros(1, dtype=single_records.SINGLE_CONFIG_DTYPE)
    record["excluded"] = excluded_satellites(gnss)
    if len(spp.system_scale) not in (1, SYSTEMS):
        raise ConfigurationError(f"spp.system_scale has {SYSTEMS} numbers or one")
    record["mask"] = gnss.mask
    record["cn0_mask"] = gnss.cn0_mask
    record["code_sigma"] = spp.code_sigma
    record["system_scale"] = spp.system_scale
    record["doppler_sigma"] = spp.doppler_sigma
    record["weight"]["model"] = WEIGHTINGS[spp.weighting]
    record["weight"]["range_scale"] = spp.range_std_scale
    record["weight"]["ionosphere"] = 0.0 if spp.ionosphere_free else spp.ionosphere_std
    record["weight"]["troposphere"] = spp.troposphere_std
    record["free"] = int(spp.ionosphere_free)
    record["robust"] = _ROBUST[spp.robust]
    record["raim"] = int(spp.raim)
    record["confidence"] = spp.confidence
    record["exclusions"] = spp.exclusions
    record["velocity"] = int(spp.velocity)
    record["pdop"] = spp.pdop
    return record
