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
from replay.errors import ConfigurationError, DataError
from replay.ins.states import state_names
from replay.kernels import loose, records
from replay.log.columns import Columns, Ragged
from replay.stages.base import Block, Context, Outputs, Port, StageSpec, dump_arrays, restore_arrays
from replay.stages.loose_config import LooseConfig

Array = np.ndarray[Any, Any]

_NS: Final = 1_000_000_000
_GAP_INTERVALS: Final = 5.0
_NOTES: Final = ("inertial sample", "GNSS fix")
_EARLY_TEXT: Final = "{value:.0f} GNSS fixes skipped: older than the inertial samples at hand"
_EVENT_TEXT: Final = {
    records.EVENT_LEVELLED: "levelled after {value:.1f} s at rest",
    records.EVENT_ALIGNED: "heading from course: {value:.4f} rad",
    records.EVENT_REJECTED: "position rejected by its innovation, {value:.0f} in a row",
    records.EVENT_OUTAGE_BEGIN: "no position for {value:.2f} s",
    records.EVENT_OUTAGE_END: "position again after {value:.2f} s",
    records.EVENT_STOP_BEGIN: "stop, filter speed {value:.3f} m/s",
    records.EVENT_STOP_END: "moving, filter speed {value:.3f} m/s",
    records.EVENT_IMU_GAP: "interval of {value:.3f} s between inertial samples",
    records.EVENT_TIME_BACKWARD: "{note} skipped: {value:.6f} s before the filter's time",
    records.EVENT_NOT_FINITE: "{note} skipped: not a finite number",
    records.EVENT_RESET: "position believed after {value:.0f} rejections in a row",
}
_EVENT_ROOM: Final = 4096


@dataclasses.dataclass(slots=True)
class LooseState:
    """Everything that crosses from one block to the next."""

    settings: LooseConfig
    config: Array
    filter: Array
    pending: Array  # fixes that wait for a sample after them
    held_t: Array  # inertial samples that wait for late fixes
    held_log_t: Array
    held_w: Array
    held_f: Array
    written: Array  # rows so far, per output channel


class GnssInsLoose:
    """The stage `gnss-ins-lc`."""

    spec = StageSpec(
        name="gnss-ins-lc",
        version=1,
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

    def start(self, config: Section, context: Context) -> LooseState:
        """State before the first row."""
        if not isinstance(config, LooseConfig):
            raise TypeError("gnss-ins-lc takes a LooseConfig")
        record = _config_record(config, context)
        return LooseState(
            settings=config,
            config=record,
            filter=records.new_state(),
            pending=np.zeros(0, dtype=records.FIX_DTYPE),
            held_t=np.zeros(0, dtype=np.int64),
            held_log_t=np.zeros(0, dtype=np.int64),
            held_w=np.zeros((0, 3)),
            held_f=np.zeros((0, 3)),
            written=np.zeros(len(self.spec.outputs), dtype=np.int64),
        )

    def step(self, state: LooseState, block: Block) -> tuple[LooseState, Outputs]:
        """Take a block of inertial samples and fixes."""
        imu = block.get(channels.IMU.name)
        fixes = block.get(channels.GNSS_FIX.name)
        if fixes is not None:
            state.pending = np.concatenate([state.pending, _fix_records(fixes)])
        if imu is not None:
            latency = round(state.settings.gnss.latency * _NS)
            state.held_t = np.concatenate([state.held_t, imu.valid_time_ns])
            state.held_log_t = np.concatenate([state.held_log_t, imu.log_time_ns + latency])
            state.held_w = np.concatenate([state.held_w, imu["angular_rate_body_rad_s"]])
            state.held_f = np.concatenate([state.held_f, imu["specific_force_body_m_s2"]])
        ends = [
            int(rows.log_time_ns[-1]) for rows in (imu, fixes) if rows is not None and len(rows)
        ]
        if not ends:
            return state, {}
        ready = int(np.searchsorted(state.held_log_t, max(ends), side="right"))
        return state, self._run(state, ready)

    def finish(self, state: LooseState) -> Outputs:
        """Nothing: what waited for late fixes would be written after the log's end."""
        del state
        return {}

    def dump(self, state: LooseState) -> bytes:
        """State as bytes."""
        return dump_arrays({name: getattr(state, name) for name in _dump_types()})

    def restore(self, state: LooseState, data: bytes) -> LooseState:
        """State of a dump."""
        arrays: dict[str, Any] = restore_arrays(data, _dump_types())
        return dataclasses.replace(state, **arrays)

    def _run(self, state: LooseState, ready: int) -> Outputs:
        samples, fixes = ready, len(state.pending)
        names = state_names(
            int(state.config["states"][0]),
            mounting=bool(state.config["mounting"][0]),
            lever=bool(state.config["lever"][0]),
            squat=bool(state.config["squat"][0]),
        )
        states = len(names)
        # Rows that a block can give at most: predictions, one before and one at each fix.
        solutions = np.zeros(samples + 2 * fixes, dtype=records.SOLUTION_DTYPE)
        epochs = np.zeros(fixes, dtype=records.EPOCH_DTYPE)
        covariances = np.zeros((fixes, states * (states + 1) // 2))
        innovations = np.zeros(8 * samples + 6 * fixes, dtype=records.INNOVATION_DTYPE)
        events = np.zeros(3 * (samples + fixes) + _EVENT_ROOM, dtype=records.EVENT_DTYPE)
        counts = np.zeros(5, dtype=np.int64)
        taken = loose.run_block(
            state.filter,
            state.config,
            np.zeros(1, dtype=records.WORK_DTYPE),
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
        )
        if counts[4]:
            raise DataError(
                f"{counts[4]} events of one block found no room",
                where=self.spec.name,
                mend="report this with the log: what happened would not be told",
            )
        state.held_t, state.held_log_t = state.held_t[ready:], state.held_log_t[ready:]
        state.held_w, state.held_f = state.held_w[ready:], state.held_f[ready:]
        state.pending = state.pending[taken:]
        epochs = epochs[: counts[1]]
        outputs = {
            channels.FILTER_INNOVATIONS.name: _innovation_columns(innovations[: counts[2]]),
            channels.FILTER_STATE.name: _state_columns(epochs),
            channels.FILTER_COVARIANCE.name: _covariance_columns(
                epochs, covariances[: counts[1]], names
            ),
            channels.FILTER_EVENTS.name: _event_columns(events[: counts[3]]),
            channels.SOLUTION.name: _solution_columns(solutions[: counts[0]]),
        }
        for index, spec in enumerate(self.spec.outputs):
            rows = outputs[spec.name]
            first = int(state.written[index])
            rows.sequence[:] = np.arange(first, first + len(rows), dtype=np.uint32)
            state.written[index] += len(rows)
        return {name: rows for name, rows in outputs.items() if len(rows)}


def _dump_types() -> dict[str, np.dtype[Any]]:
    return {
        "filter": records.STATE_DTYPE,
        "pending": records.FIX_DTYPE,
        "held_t": np.dtype(np.int64),
        "held_log_t": np.dtype(np.int64),
        "held_w": np.dtype(np.float64),
        "held_f": np.dtype(np.float64),
        "written": np.dtype(np.int64),
    }


def _config_record(config: LooseConfig, context: Context) -> Array:
    if config.filter.states not in (15, 21):
        raise ConfigurationError(
            f"filter.states is {config.filter.states}", mend="take 15, or 21 with scale factors"
        )
    if config.output.solution_interval <= 0.0:
        raise ConfigurationError("output.solution_interval is more than zero seconds")
    interval = config.imu.interval
    if interval <= 0.0:
        times = context.heads[channels.IMU.name].valid_time_ns
        steps = np.diff(times)
        steps = steps[steps > 0]
        if len(steps) == 0:
            raise ConfigurationError(
                "the inertial channel's interval cannot be told from its first rows",
                where=context.topics[channels.IMU.name],
                mend="--set imu.interval=SECONDS",
            )
        interval = float(np.sort(steps)[len(steps) // 2]) / _NS
    filter_, gnss, stops, nhc = config.filter, config.gnss, config.stops, config.non_holonomic
    align = config.alignment
    values = {
        **{name: getattr(filter_, name) for name in filter_.__struct_fields__},
        "mounting": int(nhc.enabled and nhc.mounting),
        "mounting_sigma": nhc.mounting_sigma,
        "mounting_noise": nhc.mounting_noise,
        "lever": int(nhc.enabled and nhc.estimate_lever_arm),
        "lever_sigma": nhc.lever_arm_sigma,
        "squat": int(nhc.enabled and nhc.estimate_squat),
        "squat_sigma": nhc.squat_sigma,
        "rest_sigma": align.rest_sigma,
        "gyro_bias_initial": align.gyro_bias_sigma,
        "accel_bias_initial": align.accel_bias_sigma,
        "tilt_initial": align.tilt_sigma,
        "heading_initial": align.heading_sigma,
        "velocity_initial": align.velocity_sigma,
        "rest_time": align.rest_time,
        "course_speed": align.course_speed,
        "course_turn_rate": align.course_turn_rate,
        **{
            name: getattr(gnss, name)
            for name in gnss.__struct_fields__
            if name not in ("receiver", "latency")
        },
        "zero_velocity": int(stops.zero_velocity),
        "zero_rate": int(stops.zero_rate),
        "stop_window": stops.window,
        "stop_interval": stops.interval,
        "stop_block": max(1, round(stops.block / interval)),
        "stop_accel": stops.accel_spread,
        "stop_gyro": stops.gyro_spread,
        "stop_rate": stops.rate,
        "stop_speed": stops.speed,
        "zero_velocity_sigma": stops.velocity_sigma,
        "zero_rate_sigma": stops.rate_sigma,
        "non_holonomic": int(nhc.enabled),
        "nhc_interval": nhc.interval,
        "nhc_smoothing": nhc.smoothing,
        "nhc_right_sigma": nhc.right_sigma,
        "nhc_down_sigma": nhc.down_sigma,
        "nhc_rate_sigma": nhc.turn_sigma,
        "nhc_speed": nhc.speed,
        "nhc_gate": nhc.gate,
        "nhc_lever": nhc.lever_arm,
        "solution_interval": round(config.output.solution_interval * _NS),
        "imu_interval": interval,
        "imu_gap": config.imu.gap or _GAP_INTERVALS * interval,
    }
    record = np.zeros(1, dtype=records.CONFIG_DTYPE)
    for name in records.CONFIG_DTYPE.names or ():
        try:
            record[name] = values[name]
        except ValueError as error:
            wanted = records.CONFIG_DTYPE[name].shape[0]
            raise ConfigurationError(
                f"{name.replace('nhc_', '')} has {wanted} numbers, not {len(values[name])}",
                mend="give one number for all, or one for each",
            ) from error
    return record


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


def _columns(rows: Array, values: dict[str, Array | Ragged]) -> Columns:
    contiguous = {
        name: value if isinstance(value, Ragged) else np.ascontiguousarray(value)
        for name, value in values.items()
    }
    return Columns.build(rows["t"], contiguous, log_time_ns=rows["log_t"])


def _innovation_columns(rows: Array) -> Columns:
    count = len(rows)
    return _columns(
        rows,
        {
            "kind": rows["kind"].astype(np.int32),
            "axis": rows["axis"].astype(np.int32),
            "satellite": np.full(count, b"---", dtype="S3"),
            "signal": np.full(count, b"--", dtype="S2"),
            "innovation": rows["z"],
            "innovation_std": rows["s"],
            "measurement_std": rows["r"],
            "normalized": rows["z"] / rows["s"],
            "accepted": rows["accepted"].astype(np.bool_),
        },
    )


def _state_columns(rows: Array) -> Columns:
    return _columns(
        rows,
        {
            "position_ecef_m": rows["r"],
            "velocity_ecef_m_s": rows["v"],
            "q_body_to_ecef": rows["q"],
            "gyro_bias_body_rad_s": rows["bg"],
            "accel_bias_body_m_s2": rows["ba"],
            "gyro_scale_factor": rows["sg"],
            "accel_scale_factor": rows["sa"],
            "mounting_angles_rad": rows["mount"],
            "non_slip_point_body_m": rows["point"],
            "squat_rad_s2_m": rows["squat"],
        },
    )


def _covariance_columns(rows: Array, triangles: Array, names: tuple[str, ...]) -> Columns:
    return _columns(
        rows,
        {
            "dimension": np.full(len(rows), len(names), dtype=np.uint32),
            "state_names": Ragged.from_texts([",".join(names)] * len(rows)),
            "upper_triangle": Ragged.from_matrix(triangles),
        },
    )


def _event_columns(rows: Array) -> Columns:
    details = [
        _EARLY_TEXT.format(value=float(row["value"]))
        if row["note"] == loose.NOTE_EARLY
        else _EVENT_TEXT[int(row["kind"])].format(
            value=float(row["value"]), note=_NOTES[int(row["note"])]
        )
        for row in rows
    ]
    return _columns(
        rows,
        {
            "kind": rows["kind"].astype(np.int32),
            "value": rows["value"],
            "detail": Ragged.from_texts(details),
        },
    )


def _solution_columns(rows: Array) -> Columns:
    return _columns(
        rows,
        {
            "position_ecef_m": rows["r"],
            "velocity_enu_m_s": rows["v_enu"],
            "attitude_rad": rows["attitude"],
            "angular_rate_body_rad_s": rows["w_eb"],
            "position_covariance_enu_m2": rows["cov"],
            "velocity_std_enu_m_s": rows["v_std"],
            "attitude_std_rad": rows["a_std"],
            "status": rows["status"].astype(np.int32),
        },
    )
