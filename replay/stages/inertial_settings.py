"""Settings of inertial filters as the record that the compiled loops read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from replay import channels
from replay.errors import ConfigurationError, DataError
from replay.ins.states import state_names
from replay.kernels import records
from replay.kernels.output_rows import EXTRA_NAME
from replay.stages.base import Context
from replay.stages.loose_config import LooseConfig

Array = np.ndarray[Any, Any]

_NS: Final = 1_000_000_000
_GAP_INTERVALS: Final = 5.0


def config_record(config: LooseConfig, context: Context) -> Array:
    """One record of CONFIG_DTYPE.

    Raises
    ------
    ConfigurationError
        Where a value cannot be, or the inertial interval cannot be told from the log.
    """
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


def names_of(record: Array) -> tuple[str, ...]:
    """Names of the error states of a record of CONFIG_DTYPE."""
    return state_names(
        int(record["states"][0]),
        mounting=bool(record["mounting"][0]),
        lever=bool(record["lever"][0]),
        squat=bool(record["squat"][0]),
    )


def name_of(names: Sequence[str], extras: Sequence[str] = ()) -> Callable[[int], str]:
    """Name of a state by the number that an inertial filter gives it in a node."""

    def find(number: int) -> str:
        return names[number] if number < EXTRA_NAME else extras[number - EXTRA_NAME]

    return find


def require_room(lost: int, stage: str) -> None:
    """Refuse to go on where events of a block found no room.

    Raises
    ------
    DataError
        Where `lost` is not nought.
    """
    if lost:
        raise DataError(
            f"{lost} events of one block found no room",
            where=stage,
            mend="report this with the log: what happened would not be told",
        )
