"""Loosely coupled GNSS/INS: inertial samples and fixes in, state and solution out.

15 or 21 error states in ECEF, closed loop; position and velocity updates with
lever arm; optional stops and non-holonomic updates. The arithmetic is in
:mod:`replay.kernels.loose`; this file brings columns to it and back.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.kernels import loose, records
from replay.log.columns import Columns
from replay.stages.base import Block, Context, Outputs, Port, StageSpec, dump_arrays, restore_arrays
from replay.stages.inertial_columns import (
    covariance_columns,
    event_columns,
    innovation_columns,
    solution_columns,
    state_columns,
)
from replay.stages.inertial_settings import config_record, name_of, names_of, require_room
from replay.stages.loose_config import LooseConfig
from replay.stages.transitions import Nodes, Recorder, recording
from replay.stages.waiting import SAMPLE_TYPES, HeldSamples

Array = np.ndarray[Any, Any]

_NS: Final = 1_000_000_000
_EVENT_ROOM: Final = 4096
_CLONE_NAMES: Final = ("clone_ecef_x", "clone_ecef_y", "clone_ecef_z")


@dataclasses.dataclass(slots=True)
class LooseState(HeldSamples):
    """Everything that crosses from one block to the next."""

    settings: LooseConfig
    config: Array
    filter: Array
    pending: Array  # fixes that wait for a sample after them
    recorder: Recorder


class GnssInsLoose:
    """The stage `gnss-ins-lc`.

    Parameters
    ----------
    record : bool
        Whether it writes transitions for a smoother.
    """

    spec = StageSpec(
        name="gnss-ins-lc",
        version=2,
        inputs=(Port(channels.IMU), Port(channels.GNSS_FIX)),
        outputs=(
            Port(channels.FILTER_INNOVATIONS),
            Port(channels.FILTER_STATE),
            Port(channels.FILTER_COVARIANCE),
            Port(channels.FILTER_EVENTS),
            Port(channels.SOLUTION),
        ),
        trigger=Port(channels.GNSS_FIX),
    )

    def __init__(self, record: bool = False) -> None:
        self.spec = recording(type(self).spec, record)
        self._record = record

    def start(self, config: Section, context: Context) -> LooseState:
        """State before the first row."""
        if not isinstance(config, LooseConfig):
            raise TypeError("gnss-ins-lc takes a LooseConfig")
        record = config_record(config, context)
        return LooseState(
            settings=config,
            config=record,
            filter=records.new_state(),
            pending=np.zeros(0, dtype=records.FIX_DTYPE),
            recorder=Recorder(
                records.MAX_STATES, self._record, name_of(names_of(record), _CLONE_NAMES)
            ),
        )

    def step(self, state: LooseState, block: Block) -> tuple[LooseState, Outputs]:
        """Take a block of inertial samples and fixes."""
        imu = block.get(channels.IMU.name)
        fixes = block.get(channels.GNSS_FIX.name)
        if fixes is not None:
            state.pending = np.concatenate([state.pending, _fix_records(fixes)])
        return state, self._take(state, imu, fixes)

    def _take(self, state: LooseState, imu: Columns | None, fixes: Columns | None) -> Outputs:
        """Take inertial samples; `fixes` are pending already."""
        if imu is not None:
            state.hold(imu, state.settings.gnss.latency)
        ends = [
            int(rows.log_time_ns[-1]) for rows in (imu, fixes) if rows is not None and len(rows)
        ]
        if not ends:
            return {}
        ready = state.ready(max(ends))
        return self._run(state, ready)

    def finish(self, state: LooseState) -> Outputs:
        """Nothing: what waited for late fixes would be written after the log's end."""
        del state
        return {}

    def dump(self, state: LooseState) -> bytes:
        """State as bytes."""
        own = {name: getattr(state, name) for name in _dump_types()}
        return dump_arrays({**own, **state.recorder.arrays()})

    def restore(self, state: LooseState, data: bytes) -> LooseState:
        """State of a dump."""
        arrays: dict[str, Any] = restore_arrays(data, {**_dump_types(), **state.recorder.types()})
        recorder = state.recorder.restored(arrays)
        return dataclasses.replace(state, recorder=recorder, **arrays)

    def _run(self, state: LooseState, ready: int) -> Outputs:
        recorder, names = state.recorder, names_of(state.config)
        taken, solutions, epochs, covariances, innovations, events, counts = recorder.run(
            lambda nodes: self._filter(state, ready, len(names), nodes),
            state.filter,
            recorder.trail,
        )
        require_room(int(counts[4]), self.spec.name)
        state.release(ready)
        state.pending = state.pending[taken:]
        epochs = epochs[: counts[1]]
        outputs = {
            channels.FILTER_INNOVATIONS.name: innovation_columns(innovations[: counts[2]]),
            channels.FILTER_STATE.name: state_columns(epochs),
            channels.FILTER_COVARIANCE.name: covariance_columns(
                epochs, covariances[: counts[1]], names
            ),
            channels.FILTER_EVENTS.name: event_columns(events[: counts[3]]),
            channels.SOLUTION.name: solution_columns(solutions[: counts[0]]),
            **recorder.outputs(),
        }
        return {name: rows for name, rows in outputs.items() if len(rows)}

    @staticmethod
    def _filter(
        state: LooseState, ready: int, states: int, nodes: Nodes
    ) -> tuple[int, Array, Array, Array, Array, Array, Array]:
        """The compiled loop over the rows at hand: fixes taken, and rows of the outputs."""
        samples, fixes = ready, len(state.pending)
        # Rows that a block can give at most: predictions, one before and one at each fix.
        solutions = np.zeros(samples + 2 * fixes, dtype=records.SOLUTION_DTYPE)
        epochs = np.zeros(fixes, dtype=records.EPOCH_DTYPE)
        covariances = np.zeros((fixes, states * (states + 1) // 2))
        innovations = np.zeros(8 * samples + 6 * fixes, dtype=records.INNOVATION_DTYPE)
        events = np.zeros(3 * (samples + fixes) + _EVENT_ROOM, dtype=records.EVENT_DTYPE)
        counts = np.zeros(5, dtype=np.int64)
        work = state.recorder.lend(np.zeros(1, dtype=records.WORK_DTYPE))
        taken = loose.run_block(
            state.filter,
            state.config,
            work,
            state.held_t[:ready],
            state.held_log_t[:ready],
            state.held_w[:ready],
            state.held_f[:ready],
            state.pending,
            solutions,
            epochs,
            covariances,
            innovations,
            events,
            counts,
            nodes,
        )
        state.recorder.take_back(work)
        return taken, solutions, epochs, covariances, innovations, events, counts


def _dump_types() -> dict[str, np.dtype[Any]]:
    return {
        "filter": records.STATE_DTYPE,
        "pending": records.FIX_DTYPE,
        **SAMPLE_TYPES,
    }


def _fix_records(fixes: Columns) -> Array:
    rows = np.zeros(len(fixes), dtype=records.FIX_DTYPE)
    rows["t"] = fixes.valid_time_ns
    rows["log_t"] = fixes.log_time_ns
    rows["r"] = fixes["position_ecef_m"]
    rows["R"] = fixes["position_covariance_enu_m2"]
    rows["lever"] = fixes["antenna_lever_arm_body_m"]
    moving = fixes.is_present("velocity_ecef_m_s") & fixes.is_present(
        "velocity_covariance_enu_m2_s2"
    )
    rows["has_v"] = moving
    if moving.any():
        rows["v"] = fixes["velocity_ecef_m_s"]
        rows["V"] = fixes["velocity_covariance_enu_m2_s2"]
    used = np.concatenate([rows["v"], rows["V"]], axis=1)[moving]
    finite = np.isfinite(rows["lever"]).all(axis=1)
    finite[moving] &= np.isfinite(used).all(axis=1)
    # The compiled loop looks at the position alone before it leaves a fix out.
    rows["r"][~finite] = np.nan
    return rows
