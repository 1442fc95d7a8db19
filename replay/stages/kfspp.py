"""Filtered single-point positioning: a Kalman filter of constant velocity over the epochs.

Position, velocity, and a clock with its drift for each system, from pseudoranges and
Doppler (Tang et al. 2021, eqs 6 to 9). Where no range could be used the status is
PREDICTED.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.gnss.measurements import Epochs, Selection, select_signals
from replay.kernels import kinematic
from replay.kernels.gnss_records import SYSTEM_LETTERS
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.kernels.sights import NOTE_DTYPE
from replay.kernels.single_records import RESIDUAL_DTYPE, SINGLE_ROW_DTYPE
from replay.schemas import solution_pb2
from replay.stages.base import (
    Block,
    Context,
    Outputs,
    Port,
    StageSpec,
    dump_arrays,
    restore_arrays,
)
from replay.stages.gnss_columns import (
    EVENT_TEXT,
    antenna_solution_columns,
    clock_columns,
    event_columns,
    geometry_columns,
    residual_columns,
)
from replay.stages.spp import single_config
from replay.stages.spp_config import KfsppConfig
from replay.stages.transitions import Nodes, Recorder, recording
from replay.stages.waiting import read_epochs

Array = np.ndarray[Any, Any]

_NAMES: Final = (
    *(f"{kind}_ecef_{axis}" for kind in ("position", "velocity") for axis in "xyz"),
    *(f"clock_{letter}" for letter in SYSTEM_LETTERS),
    *(f"clock_drift_{letter}" for letter in SYSTEM_LETTERS),
)
_TEXT: Final = {
    **EVENT_TEXT,
    kinematic.EVENT_CLOCK_JUMP: "the receiver set its clock by {value:.3f} m",
    kinematic.EVENT_TIME_BACKWARD: "an epoch {value:.3f} s after the one before is left out",
    kinematic.EVENT_RESET: "the filter begins anew after {value:.3f} s",
}


@dataclasses.dataclass(slots=True)
class KfsppState:
    """Everything that crosses from one block to the next."""

    selection: Selection
    config: Array
    kernel: Array
    scratch: Array
    recorder: Recorder


class FilteredSinglePoint:
    """The stage `kfspp`.

    Parameters
    ----------
    record : bool
        Whether it writes transitions for a smoother.
    """

    spec = StageSpec(
        name="kfspp",
        version=1,
        inputs=(
            Port(channels.GNSS_OBS),
            Port(channels.SATELLITES),
            Port(channels.CORRECTIONS),
            Port(channels.COARSE),
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

    def __init__(self, record: bool = False) -> None:
        self.spec = recording(type(self).spec, record)
        self._record = record

    def start(self, config: Section, context: Context) -> KfsppState:
        """State before the first row."""
        if not isinstance(config, KfsppConfig):
            raise TypeError("kfspp takes a KfsppConfig")
        own = config.kfspp
        record = np.zeros(1, dtype=kinematic.KINEMATIC_CONFIG_DTYPE)
        record["single"] = single_config(config.gnss, config.spp)
        record["single"]["code_sigma"] = own.code_sigma
        record["single"]["doppler_sigma"] = own.doppler_sigma
        for name in ("velocity_noise", "clock_noise", "drift_noise", "gate", "gap", "jump"):
            record[name] = getattr(own, name)
        record["rejections"] = own.rejections
        kernel = np.zeros(1, dtype=kinematic.KINEMATIC_STATE_DTYPE)
        kernel["t"] = -1
        return KfsppState(
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            config=record,
            kernel=kernel,
            scratch=np.zeros(1, dtype=SOLVE_DTYPE),
            recorder=Recorder(kinematic.STATES, self._record, _NAMES.__getitem__),
        )

    def step(self, state: KfsppState, block: Block) -> tuple[KfsppState, Outputs]:
        """Take a block of epochs."""
        found = read_epochs(block, state.selection)
        if found is None:
            return state, {}
        recorder = state.recorder
        solutions, innovations, notes, counts = recorder.run(
            lambda nodes: self._filter(state, found, nodes), state.kernel, recorder.trail
        )
        solved = solutions[: counts[0]]
        solved["status"] = np.where(
            solved["status"] > 0,
            solution_pb2.SOLUTION_STATUS_SINGLE,
            solution_pb2.SOLUTION_STATUS_PREDICTED,
        )
        columns = {
            channels.FILTER_INNOVATIONS.name: residual_columns(innovations[: counts[1]]),
            channels.FILTER_CLOCKS.name: clock_columns(solved),
            channels.FILTER_GEOMETRY.name: geometry_columns(solved),
            channels.FILTER_EVENTS.name: event_columns(notes[: counts[2]], _TEXT),
            channels.SOLUTION.name: antenna_solution_columns(solved),
            **recorder.outputs(),
        }
        return state, {name: rows for name, rows in columns.items() if len(rows)}

    @staticmethod
    def _filter(
        state: KfsppState, found: Epochs, nodes: Nodes
    ) -> tuple[Array, Array, Array, Array]:
        """The compiled loop over the epochs at hand: solutions, innovations, notes, counts."""
        solutions = np.zeros(len(found.epochs), dtype=SINGLE_ROW_DTYPE)
        innovations = np.zeros(2 * len(found.rows), dtype=RESIDUAL_DTYPE)
        notes = np.zeros(2 * len(found.epochs), dtype=NOTE_DTYPE)
        counts = np.zeros(3, dtype=np.int64)
        kinematic.run_kinematic(
            state.kernel, state.config, found.epochs, found.rows, state.scratch,
            solutions, innovations, notes, counts, state.recorder.trail, nodes,
        )  # fmt: skip
        return solutions, innovations, notes, counts

    def finish(self, state: KfsppState) -> Outputs:
        """Nothing is left to say."""
        return {}

    def dump(self, state: KfsppState) -> bytes:
        """The state as bytes."""
        return dump_arrays({"kernel": state.kernel, **state.recorder.arrays()})

    def restore(self, state: KfsppState, data: bytes) -> KfsppState:
        """The state of a dump."""
        types = {"kernel": kinematic.KINEMATIC_STATE_DTYPE, **state.recorder.types()}
        arrays = restore_arrays(data, types)
        recorder = state.recorder.restored(arrays)
        return dataclasses.replace(state, kernel=arrays["kernel"], recorder=recorder)
