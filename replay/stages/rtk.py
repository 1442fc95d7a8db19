"""Relative positioning: a rover's codes and phases against a base's.

A rover's epoch waits for the base's epoch of the same nominal time, or for as long as it
is told to; what it gives bears the log time of the row that made it ready. The base
stands still, or moves: then only the position relative to it is precise, and the solution
is that of the rover alone. The arithmetic is in :mod:`replay.kernels.rtk`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import ConfigurationError
from replay.gnss.measurements import Selection, select_signals
from replay.kernels import rtk, rtk_records, single_records
from replay.kernels.gnss_records import SLOTS, SYSTEMS
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.kernels.sights import NOTE_DTYPE
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
from replay.stages.gnss_columns import (
    antenna_solution_columns,
    event_columns,
    geometry_columns,
    residual_columns,
)
from replay.stages.rtk_columns import (
    RTK_EVENT_TEXT,
    ambiguity_columns,
    baseline_columns,
    resolution_columns,
)
from replay.stages.rtk_config import RtkConfig
from replay.stages.rtk_ins_config import RtkInsConfig
from replay.stages.satellites import Satellites
from replay.stages.spp import single_config
from replay.stages.spp_config import WEIGHTINGS
from replay.stages.state_names import name_of
from replay.stages.transitions import Nodes, Recorder, recording
from replay.stages.waiting import (
    EPOCH_READS,
    EPOCH_TYPES,
    HeldEpochs,
    longest_gap,
    nominal_interval,
)

Array = np.ndarray[Any, Any]

_NS: Final = 1_000_000_000
_DYNAMICS: Final = ("static", "kinematic", "velocity", "acceleration")
_MODES: Final = ("instantaneous", "continuous", "fix-and-hold", "float")
_TESTS: Final = ("ratio", "w-ratio")
_PARTIALS: Final = ("none", "elevation", "success")


@dataclasses.dataclass(slots=True)
class RtkState(HeldEpochs):
    """Everything that crosses from one block to the next."""

    selection: Selection
    config: Array
    single: Array
    times: tuple[int, int, int]  # ns: tolerance, wait, largest age
    kernel: Array
    x: Array
    P: Array
    recorder: Recorder


class Rtk:
    """The stage `rtk`.

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
            name="rtk",
            version=2,
            inputs=(
                *(Port(channel, role) for role in (RECEIVER, BASE) for channel in EPOCH_READS),
                *network,
            ),
            outputs=(
                Port(channels.FILTER_INNOVATIONS),
                Port(channels.FILTER_GEOMETRY),
                Port(channels.FILTER_AMBIGUITIES),
                Port(channels.FILTER_RESOLUTION),
                Port(channels.RELATIVE_POSITION),
                Port(channels.FILTER_EVENTS),
                Port(channels.SOLUTION),
            ),
            trigger=Port(channels.GNSS_OBS),
        )
        self.spec = recording(spec, record)

    def start(self, config: Section, context: Context) -> RtkState:
        """State before the first row."""
        if not isinstance(config, RtkConfig):
            raise TypeError("rtk takes an RtkConfig")
        single = single_config(config.gnss, config.spp)
        single["velocity"] = 1
        base = config.base
        return RtkState(
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            config=rtk_config(config, single, context),
            single=single,
            times=(round(base.tolerance * _NS), round(base.wait * _NS), round(base.max_age * _NS)),
            kernel=rtk_records.new_rtk_state(),
            x=np.zeros(rtk_records.ROOM),
            P=np.zeros((rtk_records.ROOM, rtk_records.ROOM)),
            recorder=Recorder(rtk_records.ROOM, self._record, name_of(first_slot=1)),
        )

    def step(self, state: RtkState, block: Block) -> tuple[RtkState, Outputs]:
        """Take a block of epochs of both receivers."""
        waiting = len(state.epochs)
        state.take(block, state.selection)
        if self.corrected:
            state.expect_corrections(waiting)
            state.correct(block)
        return state, self._run(state, int(state.now[0]))

    def finish(self, state: RtkState) -> Outputs:
        """Epochs that still wait for the base, with what there is of it."""
        partner, release, _ = self._match(state, np.iinfo(np.int64).max // 4, wait=0)
        release[:] = np.maximum(release, state.now[0])
        return self._work(state, len(state.epochs), partner, release)

    def dump(self, state: RtkState) -> bytes:
        """The state as bytes."""
        n = int(state.kernel["n"][0])
        return dump_arrays(
            {
                **{name: getattr(state, name) for name in _dump_types()},
                "x": state.x[:n],
                "P": state.P[:n, :n],
                **state.recorder.arrays(),
            }
        )

    def restore(self, state: RtkState, data: bytes) -> RtkState:
        """The state of a dump."""
        arrays: dict[str, Any] = restore_arrays(data, {**_dump_types(), **state.recorder.types()})
        recorder = state.recorder.restored(arrays)
        n = int(arrays["kernel"]["n"][0])
        x, P = np.zeros_like(state.x), np.zeros_like(state.P)
        x[:n] = arrays["x"]
        P[:n, :n] = arrays["P"]
        return dataclasses.replace(state, **{**arrays, "x": x, "P": P, "recorder": recorder})

    @staticmethod
    def _match(state: RtkState, now: int, *, wait: int) -> tuple[Array, Array, int]:
        tolerance, _, max_age = state.times
        return state.match(now, tolerance, wait, max_age)

    def _run(self, state: RtkState, now: int) -> Outputs:
        partner, release, ready = self._match(state, now, wait=state.times[1])
        return self._work(state, ready, partner, release)

    def _work(self, state: RtkState, ready: int, partner: Array, release: Array) -> Outputs:
        """Work on the first `ready` epochs of those that wait."""
        if ready == 0:
            state.forget_unasked(state.times[2])
            return {}
        state.late_corrections(release[:ready])
        recorder = state.recorder
        found = recorder.run(
            lambda nodes: self._filter(state, ready, partner, release, nodes),
            state.kernel, state.x, state.P, recorder.trail,
        )  # fmt: skip
        solutions, baselines, innovations, ambiguities, resolutions, notes, counts = found
        state.released[0] = release[ready - 1]
        state.forget(ready)
        state.forget_unasked(state.times[2])
        columns: dict[str, Columns] = {
            channels.FILTER_INNOVATIONS.name: residual_columns(innovations[: counts[2]]),
            channels.FILTER_GEOMETRY.name: geometry_columns(solutions[: counts[0]]),
            channels.FILTER_AMBIGUITIES.name: ambiguity_columns(ambiguities[: counts[3]]),
            channels.FILTER_RESOLUTION.name: resolution_columns(resolutions[: counts[4]]),
            channels.RELATIVE_POSITION.name: baseline_columns(baselines[: counts[1]]),
            channels.FILTER_EVENTS.name: event_columns(notes[: counts[5]], RTK_EVENT_TEXT),
            channels.SOLUTION.name: antenna_solution_columns(solutions[: counts[0]]),
            **recorder.outputs(),
        }
        return {name: rows for name, rows in columns.items() if len(rows)}

    @staticmethod
    def _filter(
        state: RtkState, ready: int, partner: Array, release: Array, nodes: Nodes
    ) -> tuple[Array, ...]:
        """The compiled loop over the first `ready` epochs: outputs and their counts."""
        epochs = state.epochs[:ready]
        end = int(epochs["first"][-1] + epochs["count"][-1])
        solutions = np.zeros(ready, dtype=single_records.SINGLE_ROW_DTYPE)
        baselines = np.zeros(ready, dtype=rtk_records.BASELINE_ROW_DTYPE)
        innovations = np.zeros(2 * SLOTS * end, dtype=single_records.RESIDUAL_DTYPE)
        ambiguities = np.zeros(SLOTS * end, dtype=rtk_records.AMBIGUITY_ROW_DTYPE)
        resolutions = np.zeros(ready, dtype=rtk_records.RESOLUTION_ROW_DTYPE)
        # Per epoch the base's loss, too few differences, a fix or its loss; and breaks.
        notes = np.zeros(ready * (4 + SLOTS * rtk_records.PAIRS), dtype=NOTE_DTYPE)
        counts = np.zeros(6, dtype=np.int64)
        rtk.run_rtk(
            state.kernel, state.x, state.P, state.config, state.single,
            np.zeros(1, dtype=SOLVE_DTYPE), epochs, state.rows, state.base_epochs,
            state.base_rows, partner, release, solutions, baselines, innovations, ambiguities,
            resolutions, notes, counts, state.recorder.trail, nodes,
        )  # fmt: skip
        return solutions, baselines, innovations, ambiguities, resolutions, notes, counts


class MovingBaseSatellites(Satellites):
    """The stage `base-satellites` for a base that knows its position no better than the rover."""

    def __init__(self) -> None:
        super().__init__(BASE)

    def start(self, config: Section, context: Context) -> Any:
        """State before the first row: the base finds its own coarse position."""
        return Satellites(RECEIVER).start(config, context)


def _dump_types() -> dict[str, np.dtype[Any]]:
    return {
        "kernel": rtk_records.RTK_STATE_DTYPE,
        **EPOCH_TYPES,
        "x": np.dtype(np.float64),
        "P": np.dtype(np.float64),
    }


def rtk_config(config: RtkConfig | RtkInsConfig, single: Array, context: Context) -> Array:
    """Settings as the record that the compiled loop reads.

    Raises
    ------
    ConfigurationError
        Where a list has the wrong length or a number cannot be.
    """
    differences, motion = config.rtk.differences, config.rtk.motion
    ambiguities, base = config.rtk.ambiguities, config.base
    record = np.zeros(1, dtype=rtk_records.RTK_CONFIG_DTYPE)
    if not 1 <= differences.frequencies <= SLOTS:
        raise ConfigurationError(f"rtk.differences.frequencies is from 1 to {SLOTS}")
    for name, count in (("code_sigma", SLOTS), ("phase_sigma", SLOTS), ("system_scale", SYSTEMS)):
        values = getattr(differences, name)
        if len(values) not in (1, count):
            raise ConfigurationError(f"rtk.differences.{name} has {count} numbers or one")
        record[name] = values
    if base.moving and base.max_age > 10.0:
        raise ConfigurationError(
            f"base.max_age is {base.max_age} s: a base that moves is not where it was",
            mend="--set base.max_age=1",
        )
    if base.moving and motion.dynamics != "kinematic":
        # A position about a base that jumps from epoch to epoch cannot be carried on.
        raise ConfigurationError(
            f"rtk.motion.dynamics is {motion.dynamics!r} and the base moves",
            mend='--set rtk.motion.dynamics="kinematic", or say base.moving=false',
        )
    record["mask"] = config.gnss.mask
    record["cn0_mask"] = config.gnss.cn0_mask
    record["excluded"] = single["excluded"]
    record["slots"] = differences.frequencies
    record["weighting"] = WEIGHTINGS[differences.weighting]
    for name in ("clock_stability", "code_gate", "phase_gate"):
        record[name] = getattr(differences, name)
    for name in motion.__struct_fields__:
        if name not in ("dynamics", "ionosphere", "troposphere"):
            record[name] = getattr(motion, name)
    record["baseline_noise"] = config.distance_noise()
    record["gap"] = longest_gap(motion.gap, nominal_interval(context, Port(channels.GNSS_OBS)))
    record["dynamics"] = _DYNAMICS.index(motion.dynamics)
    record["ionosphere"] = int(motion.ionosphere)
    record["troposphere"] = int(motion.troposphere)
    for name in ambiguities.__struct_fields__:
        if name not in ("mode", "test", "mask", "partial"):
            record[name] = getattr(ambiguities, name)
    record["mode"] = _MODES.index(ambiguities.mode)
    record["test"] = _TESTS.index(ambiguities.test)
    record["partial"] = _PARTIALS.index(ambiguities.partial)
    record["mask_resolve"] = ambiguities.mask
    record["max_age"] = base.max_age
    record["moving"] = int(base.moving)
    record["length"] = base.length
    record["length_sigma"] = base.length_sigma
    return record
