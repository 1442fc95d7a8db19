"""Tightly coupled RTK/INS: differences to a base as measurements of an inertial system.

15 or 21 inertial error states and the ambiguities of single differences in one filter.
A rover's epoch waits for the base's, and inertial rows wait as long (`tight.latency`).
The arithmetic is in :mod:`replay.kernels.tight_rtk`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import ConfigurationError
from replay.gnss.measurements import Selection, select_signals
from replay.kernels import records, rtk_records, tight_rtk, tight_rtk_states
from replay.kernels.epoch_matching import LATE_NS
from replay.kernels.gnss_records import SLOTS
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.kernels.sights import NOTE_DTYPE
from replay.kernels.single_records import RESIDUAL_DTYPE, SINGLE_ROW_DTYPE
from replay.log.columns import Columns
from replay.stages.base import (
    BASE,
    RECEIVER,
    Block,
    Context,
    Outputs,
    Port,
    StageSpec,
    dump_arrays,
    restore_arrays,
)
from replay.stages.gnss_columns import event_columns as gnss_event_columns
from replay.stages.gnss_columns import geometry_columns, residual_columns
from replay.stages.gnss_ins_tc import by_time, inertial_config, tight_record
from replay.stages.inertial_columns import (
    covariance_columns,
    event_columns,
    innovation_columns,
    solution_columns,
    state_columns,
)
from replay.stages.inertial_settings import names_of, require_room
from replay.stages.rtk import rtk_config
from replay.stages.rtk_columns import (
    RTK_EVENT_TEXT,
    ambiguity_columns,
    resolution_columns,
)
from replay.stages.rtk_ins_config import RtkInsConfig
from replay.stages.spp import single_config
from replay.stages.state_names import name_of
from replay.stages.transitions import Nodes, Recorder, recording
from replay.stages.waiting import EPOCH_READS, EPOCH_TYPES, SAMPLE_TYPES, HeldEpochs, HeldSamples

Array = np.ndarray[Any, Any]

_NS: Final = 1_000_000_000
_EVENT_ROOM: Final = 4096
_NEVER: Final = -(2**62)
_STATES: Final = tight_rtk_states.RTK_TIGHT_STATES


@dataclasses.dataclass(slots=True)
class RtkInsState(HeldSamples, HeldEpochs):
    """Everything that crosses from one block to the next."""

    settings: RtkInsConfig
    selection: Selection
    config: Array
    tight_config: Array
    rtk_config: Array
    filter: Array
    kernel: Array
    recorder: Recorder


class RtkInertial:
    """The stage `rtk-ins-tc`.

    Parameters
    ----------
    corrected : bool
        Whether a network of stations tells the rover's errors against the base.
    record : bool
        Whether it writes transitions for a smoother.
    """

    def __init__(self, corrected: bool = False, record: bool = False) -> None:
        self.corrected = corrected
        self._record = record
        network = (Port(channels.NETWORK_CORRECTIONS),) if corrected else ()
        spec = StageSpec(
            name="rtk-ins-tc",
            version=3,
            inputs=(
                Port(channels.IMU),
                *(Port(channel, role) for role in (RECEIVER, BASE) for channel in EPOCH_READS),
                *network,
            ),
            outputs=(
                Port(channels.FILTER_INNOVATIONS),
                Port(channels.FILTER_GEOMETRY),
                Port(channels.FILTER_AMBIGUITIES),
                Port(channels.FILTER_RESOLUTION),
                Port(channels.FILTER_STATE),
                Port(channels.FILTER_COVARIANCE),
                Port(channels.FILTER_EVENTS),
                Port(channels.SOLUTION),
            ),
            trigger=Port(channels.GNSS_OBS),
        )
        self.spec = recording(spec, record)

    def start(self, config: Section, context: Context) -> RtkInsState:
        """State before the first row."""
        if not isinstance(config, RtkInsConfig):
            raise TypeError("rtk-ins-tc takes an RtkInsConfig")
        if config.tight.latency < config.base.wait:
            raise ConfigurationError(
                f"tight.latency of {config.tight.latency} s is less than base.wait",
                mend="inertial rows must wait at least as long as an epoch waits for the base",
            )
        inertial = inertial_config(config, context)
        names = names_of(inertial)
        return RtkInsState(
            settings=config,
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            config=inertial,
            tight_config=tight_record(config),
            rtk_config=rtk_config(config, single_config(config.gnss, config.spp), context),
            filter=records.new_state(_STATES),
            kernel=rtk_records.new_rtk_state(),
            recorder=Recorder(_STATES, self._record, name_of(names, first_slot=1)),
        )

    def step(self, state: RtkInsState, block: Block) -> tuple[RtkInsState, Outputs]:
        """Take a block of inertial samples and of epochs of both receivers."""
        waiting = len(state.epochs)
        state.take(block, state.selection)
        if self.corrected:
            state.expect_corrections(waiting)
            state.correct(block)
        imu = block.get(channels.IMU.name)
        if imu is not None:
            state.now[0] = max(int(state.now[0]), int(imu.log_time_ns[-1]))
            state.hold(imu, state.settings.tight.latency)
        return state, self._run(state)

    def finish(self, state: RtkInsState) -> Outputs:
        """Nothing: what waited would be written after the log's end."""
        return {}

    def dump(self, state: RtkInsState) -> bytes:
        """State as bytes."""
        own = {name: getattr(state, name) for name in _dump_types()}
        return dump_arrays({**own, **state.recorder.arrays()})

    def restore(self, state: RtkInsState, data: bytes) -> RtkInsState:
        """State of a dump."""
        arrays: dict[str, Any] = restore_arrays(data, {**_dump_types(), **state.recorder.types()})
        recorder = state.recorder.restored(arrays)
        return dataclasses.replace(state, recorder=recorder, **arrays)

    @staticmethod
    def _release(state: RtkInsState) -> tuple[Array, Array]:
        """Epochs that can be used by now, and their base epochs.

        An epoch that is still without its base's when its wait is over is ready then, row or
        no row: the inertial rows go on, and what they have passed comes too late.
        """
        count = len(state.epochs)
        base = state.settings.base
        wait = round(base.wait * _NS)
        times = np.concatenate([state.base_epochs["t"], np.full(count, _NEVER)])
        arrivals = np.concatenate([state.base_epochs["log_t"], state.epochs["log_t"] + wait])
        order = np.argsort(arrivals, kind="stable").astype(np.int64)
        partner, release, ready = state.match_times(
            times[order], arrivals[order], int(state.now[0]), round(base.tolerance * _NS), wait,
            round(base.max_age * _NS),
        )  # fmt: skip
        state.late_corrections(release[:ready])
        found = partner >= 0
        partner[found] = order[partner[found]]
        epochs = state.epochs[:ready].copy()
        epochs["log_t"] = release[:ready]
        return epochs, partner[:ready]

    def _run(self, state: RtkInsState) -> Outputs:
        epochs, partner = self._release(state)
        ready = state.ready(int(state.now[0]))
        recorder, names = state.recorder, names_of(state.config)
        taken, out = recorder.run(
            lambda nodes: self._filter(state, ready, epochs, partner, len(names), nodes),
            state.filter,
            state.kernel,
            recorder.trail,
        )
        solutions, rows, covariances, innovations, events, counts, _ = out[:7]
        geometry, residuals, ambiguities, resolutions, notes, tally = out[7:]
        require_room(int(counts[4]), self.spec.name)
        if taken:
            state.released[0] = epochs["log_t"][taken - 1]
        state.release(ready)
        state.forget(taken)
        times = state.base_epochs["t"]
        if len(times):
            # Epochs that wait for inertial samples ask for old ones of the base.
            oldest = min(int(times.max()), int(state.epochs["t"].min(initial=times.max())))
            oldest -= LATE_NS + round(state.settings.base.max_age * _NS)
            state.forget_base(oldest)
        rows, geometry = rows[: counts[1]], geometry[: tally[0]]
        columns: dict[str, Columns] = {
            channels.FILTER_INNOVATIONS.name: by_time(
                residual_columns(residuals[: tally[2]]),
                innovation_columns(innovations[: counts[2]]),
            ),
            channels.FILTER_GEOMETRY.name: geometry_columns(geometry),
            channels.FILTER_AMBIGUITIES.name: ambiguity_columns(ambiguities[: tally[3]]),
            channels.FILTER_RESOLUTION.name: resolution_columns(resolutions[: tally[4]]),
            channels.FILTER_STATE.name: state_columns(rows),
            channels.FILTER_COVARIANCE.name: covariance_columns(
                rows, covariances[: counts[1]], names
            ),
            channels.FILTER_EVENTS.name: by_time(
                event_columns(events[: counts[3]]),
                gnss_event_columns(notes[: tally[5]], RTK_EVENT_TEXT),
            ),
            channels.SOLUTION.name: solution_columns(solutions[: counts[0]]),
            **recorder.outputs(),
        }
        return {name: found for name, found in columns.items() if len(found)}

    @staticmethod
    def _filter(
        state: RtkInsState, ready: int, epochs: Array, partner: Array, states: int, nodes: Nodes
    ) -> tuple[int, tuple[Any, ...]]:
        """The compiled loop over the rows at hand: epochs taken, and rows of the outputs."""
        count = len(epochs)
        end = int(epochs["first"][-1] + epochs["count"][-1]) if count else 0
        solutions = np.zeros(ready + 2 * count, dtype=records.SOLUTION_DTYPE)
        rows = np.zeros(count, dtype=records.EPOCH_DTYPE)
        covariances = np.zeros((count, states * (states + 1) // 2))
        innovations = np.zeros(8 * ready + 8, dtype=records.INNOVATION_DTYPE)
        events = np.zeros(4 * (ready + count) + _EVENT_ROOM, dtype=records.EVENT_DTYPE)
        counts = np.zeros(5, dtype=np.int64)
        geometry = np.zeros(count, dtype=SINGLE_ROW_DTYPE)
        residuals = np.zeros(2 * SLOTS * end, dtype=RESIDUAL_DTYPE)
        ambiguities = np.zeros(SLOTS * end, dtype=rtk_records.AMBIGUITY_ROW_DTYPE)
        resolutions = np.zeros(count, dtype=rtk_records.RESOLUTION_ROW_DTYPE)
        notes = np.zeros(count * (4 + SLOTS * rtk_records.PAIRS), dtype=NOTE_DTYPE)
        tally = np.zeros(6, dtype=np.int64)
        work = state.recorder.lend(np.zeros(1, dtype=records.work_dtype(_STATES)))
        out = (
            solutions, rows, covariances, innovations, events, counts, nodes,
            geometry, residuals, ambiguities, resolutions, notes, tally,
        )  # fmt: skip
        taken = tight_rtk.run_tight_rtk(
            state.filter, state.kernel, state.config, state.tight_config, state.rtk_config,
            work, np.zeros(1, dtype=SOLVE_DTYPE),
            state.held_t[:ready], state.held_log_t[:ready], state.held_w[:ready],
            state.held_f[:ready], epochs, state.rows, state.base_epochs, state.base_rows, partner,
            out,
        )  # fmt: skip
        state.recorder.take_back(work)
        return taken, out


def _dump_types() -> dict[str, np.dtype[Any]]:
    return {
        "filter": records.state_dtype(_STATES),
        "kernel": rtk_records.RTK_STATE_DTYPE,
        **EPOCH_TYPES,
        **SAMPLE_TYPES,
    }
