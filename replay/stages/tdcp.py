"""Time-differenced carrier phases: the change of an antenna's position, epoch by epoch.

A chain begins at the coarse position of its first epoch, whose error it keeps: what is
accurate is how the position changes. Its covariance is that of the beginning and the sum
of those of the displacements. Averaging code positions would give a better beginning, but
not without moving positions that were told already.

The solution has no velocity: displacement over time is the mean velocity of an interval,
not that of the epoch. It can be had from the displacements.

Innovations are residuals after the adjustment, as in single-point positioning.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import ConfigurationError
from replay.gnss.measurements import SATELLITE_NAMES, Selection, select_signals
from replay.kernels import tdcp as kernel
from replay.kernels import tdcp_adjust, tdcp_records, weighting
from replay.kernels.gnss_records import SLOTS
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.kernels.sights import NOTE_DTYPE
from replay.kernels.single_records import RESIDUAL_DTYPE, SINGLE_ROW_DTYPE
from replay.kernels.slip_records import SLIP_ROW_DTYPE
from replay.log.columns import Columns
from replay.stages.base import Block, Context, Outputs, Port, StageSpec
from replay.stages.gnss_columns import (
    EVENT_TEXT,
    antenna_solution_columns,
    event_columns,
    geometry_columns,
    residual_columns,
)
from replay.stages.gnss_config import Gnss
from replay.stages.slip_columns import slip_columns, slip_config
from replay.stages.spp_config import WEIGHTINGS
from replay.stages.tdcp_config import Tdcp, TdcpConfig
from replay.stages.waiting import read_epochs

Array = np.ndarray[Any, Any]

_ROBUST: Final = {
    "none": weighting.ROBUST_NONE,
    "huber": weighting.ROBUST_HUBER,
    "igg3": weighting.ROBUST_IGG3,
}
_SLIPS_PER_PHASE: Final = 5
_AXES: Final = 3


@dataclasses.dataclass(slots=True)
class TdcpState:
    """Everything that crosses from one block to the next."""

    selection: Selection
    config: Array
    slips: Array
    kernel: Array


class TimeDifferencedPhase:
    """The stage `tdcp`."""

    spec = StageSpec(
        name="tdcp",
        version=1,
        inputs=(
            Port(channels.GNSS_OBS),
            Port(channels.SATELLITES),
            Port(channels.CORRECTIONS),
            Port(channels.COARSE),
        ),
        outputs=(
            Port(channels.SLIPS),
            Port(channels.DISPLACEMENT),
            Port(channels.FILTER_INNOVATIONS),
            Port(channels.FILTER_GEOMETRY),
            Port(channels.FILTER_EVENTS),
            Port(channels.SOLUTION),
        ),
        trigger=Port(channels.GNSS_OBS),
    )

    def start(self, config: Section, context: Context) -> TdcpState:
        """State before the first row."""
        if not isinstance(config, TdcpConfig):
            raise TypeError("tdcp takes a TdcpConfig")
        return TdcpState(
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            config=tdcp_config(config.gnss, config.tdcp),
            slips=slip_config(config.slips),
            kernel=tdcp_records.new_tdcp_state(),
        )

    def step(self, state: TdcpState, block: Block) -> tuple[TdcpState, Outputs]:
        """Take a block of epochs."""
        found = read_epochs(block, state.selection)
        if found is None:
            return state, {}
        epochs, phases = len(found.epochs), SLOTS * len(found.rows)
        solutions = np.zeros(epochs + 1, dtype=SINGLE_ROW_DTYPE)
        displacements = np.zeros(epochs + 1, dtype=tdcp_records.DISPLACEMENT_DTYPE)
        residuals = np.zeros(phases, dtype=RESIDUAL_DTYPE)
        slips = np.zeros(_SLIPS_PER_PHASE * phases, dtype=SLIP_ROW_DTYPE)
        notes = np.zeros(phases + 2 * epochs, dtype=NOTE_DTYPE)
        counts = np.zeros(5, dtype=np.int64)
        kernel.run_tdcp(
            state.kernel, state.config, state.slips, found.epochs, found.rows,
            np.zeros(1, dtype=SOLVE_DTYPE), solutions, displacements, residuals, slips, notes,
            counts,
        )  # fmt: skip
        solved = solutions[: counts[0]]
        columns = {
            channels.SLIPS: slip_columns(slips[: counts[3]]),
            channels.DISPLACEMENT: displacement_columns(displacements[: counts[1]]),
            channels.FILTER_INNOVATIONS: residual_columns(residuals[: counts[2]]),
            channels.FILTER_GEOMETRY: geometry_columns(
                solved[solved["status"] == tdcp_records.STATUS_CHAINED]
            ),
            channels.FILTER_EVENTS: event_columns(notes[: counts[4]], EVENT_TEXT),
            channels.SOLUTION: antenna_solution_columns(solved),
        }
        return state, {channel.name: rows for channel, rows in columns.items() if len(rows)}

    def finish(self, state: TdcpState) -> Outputs:
        """Nothing is left to say."""
        return {}

    def dump(self, state: TdcpState) -> bytes:
        """The state as bytes."""
        return bytes(state.kernel.tobytes())

    def restore(self, state: TdcpState, data: bytes) -> TdcpState:
        """The state of a dump."""
        made = np.frombuffer(data, dtype=tdcp_records.TDCP_STATE_DTYPE).copy()
        return dataclasses.replace(state, kernel=made)


def tdcp_config(gnss: Gnss, tdcp: Tdcp) -> Array:
    """Settings as the record that the compiled loop reads.

    Raises
    ------
    ConfigurationError
        Where a satellite is unknown or a list has the wrong length.
    """
    record = np.zeros(1, dtype=tdcp_adjust.TDCP_CONFIG_DTYPE)
    names = [name.decode() for name in SATELLITE_NAMES]
    for name in gnss.exclude:
        if name not in names:
            raise ConfigurationError(
                f"gnss.exclude: no satellite {name!r}", mend='write them as "G05"'
            )
        record["excluded"][0, names.index(name)] = 1
    if len(tdcp.initial_std) not in (1, _AXES):
        raise ConfigurationError("tdcp.initial_std has three numbers or one")
    record["mask"] = gnss.mask
    record["cn0_mask"] = gnss.cn0_mask
    record["weight"]["model"] = WEIGHTINGS[tdcp.weighting]
    record["clocks"] = int(tdcp.clocks == "system")
    record["robust"] = _ROBUST[tdcp.robust]
    record["repair"] = int(tdcp.repair)
    record["half"] = int(tdcp.half_cycles)
    for name in (
        "phase_sigma",
        "drift_sigma",
        "confidence",
        "gate",
        "exclusions",
        "repair_sigma",
        "repair_gate",
        "satellites",
        "freedom",
        "unit_limit",
        "pdop",
        "max_gap",
        "carry",
        "carry_acceleration",
        "initial_std",
    ):
        record[name] = getattr(tdcp, name)
    return record


def displacement_columns(rows: Array) -> Columns:
    """Displacements from records of DISPLACEMENT_DTYPE."""
    return Columns.build(
        rows["t"],
        {
            "since_ns": np.ascontiguousarray(rows["since"]),
            "displacement_ecef_m": np.ascontiguousarray(rows["d"]),
            "covariance_enu_m2": np.ascontiguousarray(rows["cov"]),
            "satellite_count": rows["count"].astype(np.uint32),
            "unit_weight_std": np.ascontiguousarray(rows["unit"]),
        },
        log_time_ns=rows["log_t"],
    )
