"""Tightly coupled GNSS/INS without a base: pseudoranges, Doppler, changes of carrier phase.

15 or 21 inertial error states, a clock for each system and a drift; where carrier phases
are used, the antenna's position at the epoch before is a state too, so that the change
of a phase measures the way between two epochs whatever the position is worth. The
arithmetic is in :mod:`replay.kernels.tight`; this file brings columns to it and back.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import ConfigurationError
from replay.gnss.measurements import Selection, select_signals
from replay.kernels import records, tight, tight_records
from replay.kernels.gnss_records import EPOCH_DTYPE, MEASURED_DTYPE, SYSTEM_LETTERS
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.kernels.single_records import RESIDUAL_DTYPE, SINGLE_ROW_DTYPE
from replay.log.columns import Columns, concatenate
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
from replay.stages.inertial_columns import (
    covariance_columns,
    event_columns,
    innovation_columns,
    solution_columns,
    state_columns,
)
from replay.stages.inertial_settings import config_record, name_of, names_of, require_room
from replay.stages.loose_config import Gnss, LooseConfig
from replay.stages.spp import single_config
from replay.stages.tight_config import TightConfig
from replay.stages.transitions import Nodes, Recorder, recording
from replay.stages.waiting import SAMPLE_TYPES, HeldSamples, forget_epochs, join_epochs, read_epochs

Array = np.ndarray[Any, Any]

_NS: Final = 1_000_000_000
_EVENT_ROOM: Final = 4096
_STATES: Final = tight_records.TIGHT_STATES
_EXTRA_NAMES: Final = (
    *(f"clock_{letter}" for letter in SYSTEM_LETTERS),
    "clock_drift",
    *(f"clone_ecef_{axis}" for axis in "xyz"),
    "clock_change",
)


@dataclasses.dataclass(slots=True)
class TightState(HeldSamples):
    """Everything that crosses from one block to the next."""

    settings: TightConfig
    selection: Selection
    config: Array
    tight_config: Array
    filter: Array
    tight: Array
    epochs: Array  # that wait for a sample after them
    rows: Array
    recorder: Recorder


class TightInertial:
    """The stage `gnss-ins-tc`.

    Parameters
    ----------
    record : bool
        Whether it writes transitions for a smoother.
    """

    spec = StageSpec(
        name="gnss-ins-tc",
        version=2,
        inputs=(
            Port(channels.IMU),
            Port(channels.GNSS_OBS),
            Port(channels.SATELLITES),
            Port(channels.CORRECTIONS),
            Port(channels.COARSE, optional=True),
        ),
        outputs=(
            Port(channels.FILTER_INNOVATIONS),
            Port(channels.FILTER_CLOCKS),
            Port(channels.FILTER_GEOMETRY),
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

    def start(self, config: Section, context: Context) -> TightState:
        """State before the first row."""
        if not isinstance(config, TightConfig):
            raise TypeError("gnss-ins-tc takes a TightConfig")
        inertial = inertial_config(config, context)
        return TightState(
            settings=config,
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            config=inertial,
            tight_config=tight_record(config),
            filter=records.new_state(_STATES),
            tight=tight_records.new_tight_state(),
            epochs=np.zeros(0, dtype=EPOCH_DTYPE),
            rows=np.zeros(0, dtype=MEASURED_DTYPE),
            recorder=Recorder(_STATES, self._record, name_of(names_of(inertial), _EXTRA_NAMES)),
        )

    def step(self, state: TightState, block: Block) -> tuple[TightState, Outputs]:
        """Take a block of inertial samples and epochs."""
        imu = block.get(channels.IMU.name)
        observations = block.get(channels.GNSS_OBS.name)
        found = read_epochs(block, state.selection)
        if found is not None:
            state.epochs, state.rows = join_epochs(state.epochs, state.rows, found)
        if imu is not None:
            state.hold(imu, state.settings.tight.latency)
        ends = [int(rows.log_time_ns[-1]) for rows in (imu, observations) if rows is not None]
        if not ends:
            return state, {}
        ready = state.ready(max(ends))
        return state, self._run(state, ready)

    def finish(self, state: TightState) -> Outputs:
        """Nothing: what waited for late epochs would be written after the log's end."""
        return {}

    def dump(self, state: TightState) -> bytes:
        """State as bytes."""
        own = {name: getattr(state, name) for name in _dump_types()}
        return dump_arrays({**own, **state.recorder.arrays()})

    def restore(self, state: TightState, data: bytes) -> TightState:
        """State of a dump."""
        arrays: dict[str, Any] = restore_arrays(data, {**_dump_types(), **state.recorder.types()})
        recorder = state.recorder.restored(arrays)
        return dataclasses.replace(state, recorder=recorder, **arrays)

    def _run(self, state: TightState, ready: int) -> Outputs:
        recorder, names = state.recorder, names_of(state.config)
        taken, rows = recorder.run(
            lambda nodes: self._filter(state, ready, len(names), nodes),
            state.filter,
            state.tight,
            recorder.trail,
        )
        solutions, epochs, covariances, innovations, events, counts, _ = rows[:7]
        satellites, residuals, tally = rows[7:]
        require_room(int(counts[4]), self.spec.name)
        state.release(ready)
        state.epochs, state.rows = forget_epochs(state.epochs, state.rows, taken)
        epochs, satellites = epochs[: counts[1]], satellites[: tally[1]]
        outputs = {
            channels.FILTER_INNOVATIONS.name: by_time(
                residual_columns(residuals[: tally[0]]),
                innovation_columns(innovations[: counts[2]]),
            ),
            channels.FILTER_CLOCKS.name: clock_columns(satellites),
            channels.FILTER_GEOMETRY.name: geometry_columns(satellites),
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
        state: TightState, ready: int, states: int, nodes: Nodes
    ) -> tuple[int, tuple[Any, ...]]:
        """The compiled loop over the rows at hand: epochs taken, and rows of the outputs."""
        count = len(state.epochs)
        # Rows that a block can give at most: predictions, one before and one at each epoch.
        solutions = np.zeros(ready + 2 * count, dtype=records.SOLUTION_DTYPE)
        epochs = np.zeros(count, dtype=records.EPOCH_DTYPE)
        covariances = np.zeros((count, states * (states + 1) // 2))
        innovations = np.zeros(8 * ready + 8, dtype=records.INNOVATION_DTYPE)
        events = np.zeros(4 * (ready + count) + _EVENT_ROOM, dtype=records.EVENT_DTYPE)
        counts = np.zeros(5, dtype=np.int64)
        satellites = np.zeros(count, dtype=SINGLE_ROW_DTYPE)
        residuals = np.zeros(5 * len(state.rows), dtype=RESIDUAL_DTYPE)
        tally = np.zeros(2, dtype=np.int64)
        work = state.recorder.lend(np.zeros(1, dtype=records.work_dtype(_STATES)))
        out = (
            solutions, epochs, covariances, innovations, events, counts, nodes,
            satellites, residuals, tally,
        )  # fmt: skip
        taken = tight.run_tight(
            state.filter,
            state.tight,
            state.config,
            state.tight_config,
            work,
            np.zeros(1, dtype=SOLVE_DTYPE),
            state.held_t[:ready],
            state.held_log_t[:ready],
            state.held_w[:ready],
            state.held_f[:ready],
            state.epochs,
            state.rows,
            out,
        )
        state.recorder.take_back(work)
        return taken, out


def by_time(first: Columns, second: Columns) -> Columns:
    """Rows of satellites and of the inertial system in the order of their log times."""
    joined = concatenate([first, second])
    return joined.take(np.argsort(joined.log_time_ns, kind="stable").astype(np.int64))


def _dump_types() -> dict[str, np.dtype[Any]]:
    return {
        "filter": records.state_dtype(_STATES),
        "tight": tight_records.TIGHT_STATE_DTYPE,
        "epochs": EPOCH_DTYPE,
        "rows": MEASURED_DTYPE,
        **SAMPLE_TYPES,
    }


def tight_record(config: TightConfig) -> Array:
    """Settings of the satellites' part as the record that the compiled loop reads."""
    own = config.tight
    lever_arm = config.antenna.lever_arm
    if len(lever_arm) != 3:
        raise ConfigurationError(
            f"antenna.lever_arm has {len(lever_arm)} numbers",
            mend="give forward, right, down of the antenna from the IMU",
        )
    record = np.zeros(1, dtype=tight_records.TIGHT_CONFIG_DTYPE)
    record["single"] = single_config(config.gnss, config.spp)
    record["single"]["code_sigma"] = own.code_sigma
    record["single"]["doppler_sigma"] = own.doppler_sigma
    record["lever"] = lever_arm
    for name in ("code", "doppler", "phase"):
        record[name] = int(getattr(own, name))
    for name in (
        *("phase_sigma", "phase_gap", "clock_noise", "drift_noise"),
        *("code_gate", "doppler_gate", "phase_gate", "jump", "rejections"),
    ):
        record[name] = getattr(own, name)
    return record


def inertial_config(config: TightConfig, context: Context) -> Array:
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
