"""Tightly coupled PPP/INS: codes, phases and Doppler with precise orbits on an inertial system.

15 or 21 inertial error states and those of precise point positioning in one filter, whose
part of the satellites grows and shrinks with them. The arithmetic is in
:mod:`replay.kernels.tight_ppp`; this file brings columns to it and back.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import ConfigurationError
from replay.gnss.measurements import Selection, select_signals
from replay.kernels import (
    ppp_output,
    ppp_records,
    records,
    tight_ppp,
    tight_ppp_records,
)
from replay.kernels.gnss_records import (
    EPOCH_DTYPE,
    MEASURED_DTYPE,
    SLOTS,
)
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.kernels.single_records import RESIDUAL_DTYPE, SINGLE_ROW_DTYPE
from replay.stages.base import (
    Block,
    Context,
    Outputs,
    Port,
    StageSpec,
    dump_arrays,
    restore_arrays,
)
from replay.stages.gnss_columns import clock_columns, geometry_columns, residual_columns
from replay.stages.gnss_columns import event_columns as gnss_event_columns
from replay.stages.gnss_ins_tc import by_time
from replay.stages.inertial_columns import (
    covariance_columns,
    event_columns,
    innovation_columns,
    solution_columns,
    state_columns,
)
from replay.stages.inertial_settings import config_record, names_of, require_room
from replay.stages.loose_config import Gnss, LooseConfig
from replay.stages.ppp import clock_codes, ppp_config
from replay.stages.ppp_columns import PPP_EVENT_TEXT, new_precise_rows, precise_columns
from replay.stages.ppp_ins_config import PppInsConfig
from replay.stages.state_names import name_of
from replay.stages.transitions import Nodes, Recorder, recording
from replay.stages.waiting import SAMPLE_TYPES, HeldSamples, forget_epochs, join_epochs, read_epochs

Array = np.ndarray[Any, Any]

_EVENT_ROOM: Final = 4096
_STATES: Final = tight_ppp_records.PPP_TIGHT_STATES
_CLOCKS: Final = {"white": tight_ppp_records.WHITE, "walk": tight_ppp_records.WALK}


@dataclasses.dataclass(slots=True)
class PppInsState(HeldSamples):
    """Everything that crosses from one block to the next."""

    settings: PppInsConfig
    selection: Selection
    codes: Selection | None
    config: Array
    own_config: Array
    ppp_config: Array
    filter: Array
    own: Array
    kernel: Array
    epochs: Array  # that wait for a sample after them
    rows: Array
    recorder: Recorder


class PppInertial:
    """The stage `ppp-ins-tc`.

    Parameters
    ----------
    record : bool
        Whether it writes transitions for a smoother.
    """

    spec = StageSpec(
        name="ppp-ins-tc",
        version=2,
        inputs=(
            Port(channels.IMU),
            Port(channels.GNSS_OBS),
            Port(channels.SATELLITES),
            Port(channels.CORRECTIONS),
            Port(channels.COARSE),
            Port(channels.SIGNAL_BIAS, optional=True),
        ),
        outputs=(
            Port(channels.FILTER_INNOVATIONS),
            Port(channels.FILTER_CLOCKS),
            Port(channels.FILTER_GEOMETRY),
            Port(channels.FILTER_TROPOSPHERE),
            Port(channels.FILTER_IONOSPHERE),
            Port(channels.FILTER_BIASES),
            Port(channels.FILTER_PHASES),
            Port(channels.FILTER_AMBIGUITIES),
            Port(channels.FILTER_RESOLUTION),
            Port(channels.FILTER_STATE),
            Port(channels.FILTER_COVARIANCE),
            Port(channels.FILTER_EVENTS),
            Port(channels.SOLUTION),
        ),
        trigger=Port(channels.GNSS_OBS),
    )

    def __init__(self, record: bool = False) -> None:
        self.spec = recording(type(self).spec, record)
        self._record = record

    def start(self, config: Section, context: Context) -> PppInsState:
        """State before the first row."""
        if not isinstance(config, PppInsConfig):
            raise TypeError("ppp-ins-tc takes a PppInsConfig")
        inertial = _inertial_config(config, context)
        return PppInsState(
            settings=config,
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            codes=clock_codes(config, context),
            config=inertial,
            own_config=_own_config(config),
            ppp_config=ppp_config(config, context),
            filter=records.new_state(_STATES),
            own=tight_ppp_records.new_tight_ppp_state(),
            kernel=ppp_records.new_ppp_state(),
            epochs=np.zeros(0, dtype=EPOCH_DTYPE),
            rows=np.zeros(0, dtype=MEASURED_DTYPE),
            recorder=Recorder(_STATES, self._record, name_of(names_of(inertial))),
        )

    def step(self, state: PppInsState, block: Block) -> tuple[PppInsState, Outputs]:
        """Take a block of inertial samples and epochs."""
        imu = block.get(channels.IMU.name)
        observations = block.get(channels.GNSS_OBS.name)
        found = read_epochs(block, state.selection, codes=state.codes)
        if found is not None:
            state.epochs, state.rows = join_epochs(state.epochs, state.rows, found)
        if imu is not None:
            state.hold(imu, state.settings.tight.latency)
        ends = [int(rows.log_time_ns[-1]) for rows in (imu, observations) if rows is not None]
        if not ends:
            return state, {}
        return state, self._run(state, state.ready(max(ends)))

    def finish(self, state: PppInsState) -> Outputs:
        """Nothing: what waited for late epochs would be written after the log's end."""
        return {}

    def dump(self, state: PppInsState) -> bytes:
        """State as bytes."""
        own = {name: getattr(state, name) for name in _dump_types()}
        return dump_arrays({**own, **state.recorder.arrays()})

    def restore(self, state: PppInsState, data: bytes) -> PppInsState:
        """State of a dump."""
        arrays: dict[str, Any] = restore_arrays(data, {**_dump_types(), **state.recorder.types()})
        recorder = state.recorder.restored(arrays)
        return dataclasses.replace(state, recorder=recorder, **arrays)

    def _run(self, state: PppInsState, ready: int) -> Outputs:
        recorder, names = state.recorder, names_of(state.config)
        taken, out = recorder.run(
            lambda nodes: self._filter(state, ready, len(names), nodes),
            state.filter, state.own, state.kernel, recorder.trail,
        )  # fmt: skip
        solutions, epochs, covariances, innovations, events, counts, _ = out[:7]
        geometry, residuals, own = out[7], out[8], out[9:]
        notes, tally = own[2], own[-1]
        require_room(int(counts[4]), self.spec.name)
        state.release(ready)
        state.epochs, state.rows = forget_epochs(state.epochs, state.rows, taken)
        epochs, geometry = epochs[: counts[1]], geometry[: tally[ppp_output.SOLUTIONS]]
        columns = {
            channels.FILTER_INNOVATIONS.name: by_time(
                residual_columns(residuals[: tally[ppp_output.INNOVATIONS]]),
                innovation_columns(innovations[: counts[2]]),
            ),
            channels.FILTER_CLOCKS.name: clock_columns(geometry),
            channels.FILTER_GEOMETRY.name: geometry_columns(geometry),
            **precise_columns(own),
            channels.FILTER_STATE.name: state_columns(epochs),
            channels.FILTER_COVARIANCE.name: covariance_columns(
                epochs, covariances[: counts[1]], names
            ),
            channels.FILTER_EVENTS.name: by_time(
                event_columns(events[: counts[3]]),
                gnss_event_columns(notes[: tally[ppp_output.NOTES]], PPP_EVENT_TEXT),
            ),
            channels.SOLUTION.name: solution_columns(solutions[: counts[0]]),
            **recorder.outputs(),
        }
        return {name: found for name, found in columns.items() if len(found)}

    @staticmethod
    def _filter(
        state: PppInsState, ready: int, states: int, nodes: Nodes
    ) -> tuple[int, tuple[Any, ...]]:
        """The compiled loop over the rows at hand: epochs taken, and rows of the outputs."""
        count, rows = len(state.epochs), len(state.rows)
        out = (
            # Rows that a block can give at most: predictions, one before and one at each epoch.
            np.zeros(ready + 2 * count, dtype=records.SOLUTION_DTYPE),
            np.zeros(count, dtype=records.EPOCH_DTYPE),
            np.zeros((count, states * (states + 1) // 2)),
            np.zeros(8 * ready + 8, dtype=records.INNOVATION_DTYPE),
            np.zeros(4 * (ready + count) + _EVENT_ROOM, dtype=records.EVENT_DTYPE),
            np.zeros(5, dtype=np.int64),
            nodes,
            np.zeros(count, dtype=SINGLE_ROW_DTYPE),
            np.zeros((3 * SLOTS + 1) * rows, dtype=RESIDUAL_DTYPE),
            # Per epoch a fix or its loss, a reset.
            *new_precise_rows(count, rows, notes=3),
        )
        work = state.recorder.lend(np.zeros(1, dtype=records.work_dtype(_STATES)))
        taken = tight_ppp.run_tight_ppp(
            state.filter, state.own, state.kernel, state.config, state.own_config,
            state.ppp_config, work, np.zeros(1, dtype=SOLVE_DTYPE), state.held_t[:ready],
            state.held_log_t[:ready], state.held_w[:ready], state.held_f[:ready], state.epochs,
            state.rows, out,
        )  # fmt: skip
        state.recorder.take_back(work)
        return taken, out


def _dump_types() -> dict[str, np.dtype[Any]]:
    return {
        "filter": records.state_dtype(_STATES),
        "own": tight_ppp_records.TIGHT_PPP_STATE_DTYPE,
        "kernel": ppp_records.PPP_STATE_DTYPE,
        "epochs": EPOCH_DTYPE,
        "rows": MEASURED_DTYPE,
        **SAMPLE_TYPES,
    }


def _own_config(config: PppInsConfig) -> Array:
    """Settings of what this filter has beside its parts, as the compiled loop reads them."""
    lever_arm = config.antenna.lever_arm
    if len(lever_arm) != 3:
        raise ConfigurationError(
            f"antenna.lever_arm has {len(lever_arm)} numbers",
            mend="give forward, right, down of the antenna from the IMU",
        )
    own = config.tight
    record = np.zeros(1, dtype=tight_ppp_records.TIGHT_PPP_CONFIG_DTYPE)
    record["lever"] = lever_arm
    record["clock"] = _CLOCKS[own.clock]
    record["doppler"] = int(own.doppler)
    record["wind_up"] = int(own.wind_up)
    for name in ("clock_noise", "drift_noise", "jump"):
        record[name] = getattr(own, name)
    return record


def _inertial_config(config: PppInsConfig, context: Context) -> Array:
    """Settings of the inertial part, as the record of the loosely coupled filter."""
    inertial = LooseConfig(
        filter=config.filter,
        alignment=config.alignment,
        gnss=Gnss(outage_limit=config.tight.outage_limit),
        stops=config.stops,
        non_holonomic=config.non_holonomic,
        imu=config.imu,
        output=config.output,
    )
    return config_record(inertial, context)
