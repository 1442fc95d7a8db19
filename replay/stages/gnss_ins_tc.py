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
from replay.errors import ConfigurationError, DataError
from replay.gnss.measurements import Selection, gather_epochs, select_signals
from replay.ins.states import state_names
from replay.kernels import records, tight, tight_records
from replay.kernels.gnss_records import EPOCH_DTYPE, MEASURED_DTYPE
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.kernels.single_point import RESIDUAL_DTYPE, SINGLE_ROW_DTYPE
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
from replay.stages.inertial_settings import config_record
from replay.stages.loose_config import Gnss, LooseConfig
from replay.stages.spp import single_config
from replay.stages.tight_config import TightConfig

Array = np.ndarray[Any, Any]

_NS: Final = 1_000_000_000
_EVENT_ROOM: Final = 4096
_STATES: Final = tight_records.TIGHT_STATES


@dataclasses.dataclass(slots=True)
class TightState:
    """Everything that crosses from one block to the next."""

    settings: TightConfig
    selection: Selection
    config: Array
    tight_config: Array
    filter: Array
    tight: Array
    epochs: Array  # that wait for a sample after them
    rows: Array
    held_t: Array  # inertial samples that wait for late epochs
    held_log_t: Array
    held_w: Array
    held_f: Array


class TightInertial:
    """The stage `gnss-ins-tc`."""

    spec = StageSpec(
        name="gnss-ins-tc",
        version=1,
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

    def start(self, config: Section, context: Context) -> TightState:
        """State before the first row."""
        if not isinstance(config, TightConfig):
            raise TypeError("gnss-ins-tc takes a TightConfig")
        return TightState(
            settings=config,
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            config=inertial_config(config, context),
            tight_config=tight_record(config),
            filter=records.new_state(_STATES),
            tight=tight_records.new_tight_state(),
            epochs=np.zeros(0, dtype=EPOCH_DTYPE),
            rows=np.zeros(0, dtype=MEASURED_DTYPE),
            held_t=np.zeros(0, dtype=np.int64),
            held_log_t=np.zeros(0, dtype=np.int64),
            held_w=np.zeros((0, 3)),
            held_f=np.zeros((0, 3)),
        )

    def step(self, state: TightState, block: Block) -> tuple[TightState, Outputs]:
        """Take a block of inertial samples and epochs."""
        imu = block.get(channels.IMU.name)
        observations = block.get(channels.GNSS_OBS.name)
        if observations is not None:
            found = gather_epochs(
                observations,
                state.selection,
                block.get(channels.SATELLITES.name),
                block.get(channels.CORRECTIONS.name),
                block.get(channels.COARSE.name),
            )
            found.epochs["first"] += len(state.rows)
            state.epochs = np.concatenate([state.epochs, found.epochs])
            state.rows = np.concatenate([state.rows, found.rows])
        if imu is not None:
            latency = round(state.settings.tight.latency * _NS)
            state.held_t = np.concatenate([state.held_t, imu.valid_time_ns])
            state.held_log_t = np.concatenate([state.held_log_t, imu.log_time_ns + latency])
            state.held_w = np.concatenate([state.held_w, imu["angular_rate_body_rad_s"]])
            state.held_f = np.concatenate([state.held_f, imu["specific_force_body_m_s2"]])
        ends = [int(rows.log_time_ns[-1]) for rows in (imu, observations) if rows is not None]
        if not ends:
            return state, {}
        ready = int(np.searchsorted(state.held_log_t, max(ends), side="right"))
        return state, self._run(state, ready)

    def finish(self, state: TightState) -> Outputs:
        """Nothing: what waited for late epochs would be written after the log's end."""
        return {}

    def dump(self, state: TightState) -> bytes:
        """State as bytes."""
        return dump_arrays({name: getattr(state, name) for name in _dump_types()})

    def restore(self, state: TightState, data: bytes) -> TightState:
        """State of a dump."""
        arrays: dict[str, Any] = restore_arrays(data, _dump_types())
        return dataclasses.replace(state, **arrays)

    def _run(self, state: TightState, ready: int) -> Outputs:
        count = len(state.epochs)
        names = state_names(
            int(state.config["states"][0]),
            mounting=bool(state.config["mounting"][0]),
            lever=bool(state.config["lever"][0]),
            squat=bool(state.config["squat"][0]),
        )
        states = len(names)
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
        taken = tight.run_tight(
            state.filter,
            state.tight,
            state.config,
            state.tight_config,
            np.zeros(1, dtype=records.work_dtype(_STATES)),
            np.zeros(1, dtype=SOLVE_DTYPE),
            state.held_t[:ready],
            state.held_log_t[:ready],
            state.held_w[:ready],
            state.held_f[:ready],
            state.epochs,
            state.rows,
            (
                solutions, epochs, covariances, innovations, events, counts,
                satellites, residuals, tally,
            ),
        )  # fmt: skip
        if counts[4]:
            raise DataError(
                f"{counts[4]} events of one block found no room",
                where=self.spec.name,
                mend="report this with the log: what happened would not be told",
            )
        state.held_t, state.held_log_t = state.held_t[ready:], state.held_log_t[ready:]
        state.held_w, state.held_f = state.held_w[ready:], state.held_f[ready:]
        used = int(state.epochs["first"][taken]) if taken < count else len(state.rows)
        state.epochs, state.rows = state.epochs[taken:].copy(), state.rows[used:]
        state.epochs["first"] -= used
        epochs, satellites = epochs[: counts[1]], satellites[: tally[1]]
        outputs = {
            channels.FILTER_INNOVATIONS: by_time(
                residual_columns(residuals[: tally[0]]),
                innovation_columns(innovations[: counts[2]]),
            ),
            channels.FILTER_CLOCKS: clock_columns(satellites),
            channels.FILTER_GEOMETRY: geometry_columns(satellites),
            channels.FILTER_STATE: state_columns(epochs),
            channels.FILTER_COVARIANCE: covariance_columns(epochs, covariances[: counts[1]], names),
            channels.FILTER_EVENTS: event_columns(events[: counts[3]]),
            channels.SOLUTION: solution_columns(solutions[: counts[0]]),
        }
        return {channel.name: rows for channel, rows in outputs.items() if len(rows)}


def by_time(satellites: Columns, constraints: Columns) -> Columns:
    """Innovations of satellites and of constraints in the order of their log times."""
    joined = concatenate([satellites, constraints])
    return joined.take(np.argsort(joined.log_time_ns, kind="stable").astype(np.int64))


def _dump_types() -> dict[str, np.dtype[Any]]:
    return {
        "filter": records.state_dtype(_STATES),
        "tight": tight_records.TIGHT_STATE_DTYPE,
        "epochs": EPOCH_DTYPE,
        "rows": MEASURED_DTYPE,
        "held_t": np.dtype(np.int64),
        "held_log_t": np.dtype(np.int64),
        "held_w": np.dtype(np.float64),
        "held_f": np.dtype(np.float64),
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
