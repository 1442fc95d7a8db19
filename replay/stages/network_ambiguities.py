"""Integers of the baselines between reference stations, and what is left of their phases.

One stage per baseline: epochs of a station wait for those of the other one with the same
nominal time. Positions are known; the arithmetic is in
:mod:`replay.kernels.network_ambiguities`.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import ConfigurationError
from replay.gnss.measurements import SATELLITE_NAMES, Selection, select_signals, signal_names
from replay.kernels import elementary, network_ambiguities, network_records, rtk_records
from replay.kernels.gnss_records import SLOTS
from replay.kernels.sights import NOTE_DTYPE
from replay.log.columns import Columns
from replay.stages.base import (
    Block,
    Context,
    Outputs,
    Port,
    StageSpec,
    dump_arrays,
    restore_arrays,
)
from replay.stages.gnss_columns import event_columns
from replay.stages.network_config import NetworkSettings
from replay.stages.rtk_columns import RTK_EVENT_TEXT, ambiguity_columns, step_columns
from replay.stages.spp import excluded_satellites
from replay.stages.spp_config import WEIGHTINGS
from replay.stages.waiting import (
    EPOCH_READS,
    EPOCH_TYPES,
    HeldEpochs,
    longest_gap,
    nominal_interval,
)

Array = np.ndarray[Any, Any]

_NS: Final = 1_000_000_000
_FREQUENCIES: Final = 2
_POSITION_SIGMA_M: Final = 1e-4
_LEAST: Final = 4
_REMEMBERED_S: Final = 300.0
_TESTS: Final = {"ratio": rtk_records.TEST_RATIO, "w-ratio": rtk_records.TEST_W_RATIO}
_EVENT_TEXT: Final = {
    **RTK_EVENT_TEXT,
    network_records.EVENT_INTEGER_REPAIRED: "{satellite}: its integer was wrong by {value:.0f}",
    network_records.EVENT_STATION_LOST: "one of the stations has no epoch",
    network_records.EVENT_STATION_FOUND: "both stations have epochs again, after {value:.1f} s",
}


@dataclasses.dataclass(slots=True)
class BaselineState(HeldEpochs):
    """Everything that crosses from one block to the next."""

    selection: Selection
    config: Array
    integers_config: Array
    times: tuple[int, int]  # ns: tolerance, wait
    kernel: Array
    integers: Array
    x: Array
    P: Array


class NetworkAmbiguities:
    """The stage of one baseline.

    Parameters
    ----------
    master, station : str
        Roles of both ends; differences are station less master.
    baseline : str
        Name in topics.
    """

    def __init__(self, master: str, station: str, baseline: str) -> None:
        self.roles = (station, master)
        self.baseline = baseline
        self.spec = StageSpec(
            name=f"{baseline}-ambiguities",
            version=1,
            inputs=tuple(Port(channel, role) for role in self.roles for channel in EPOCH_READS),
            outputs=tuple(
                Port(channel, baseline)
                for channel in (
                    channels.NETWORK_AMBIGUITIES,
                    channels.NETWORK_RESOLUTION,
                    channels.NETWORK_RESIDUALS,
                    channels.NETWORK_EVENTS,
                )
            ),
            trigger=Port(channels.GNSS_OBS, station),
        )

    def start(self, config: Section, context: Context) -> BaselineState:
        """State before the first row."""
        if not isinstance(config, NetworkSettings):
            raise TypeError(f"{self.spec.name} takes the settings of a network")
        settings = config.integers
        observations = Port(channels.GNSS_OBS, self.roles[0])
        interval = nominal_interval(context, observations)
        gap = longest_gap(settings.gap, interval)
        return BaselineState(
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            config=_float_record(config, gap, interval),
            integers_config=_integers_record(config, interval),
            times=(round(settings.tolerance * _NS), round(settings.wait * _NS)),
            kernel=rtk_records.new_rtk_state(),
            integers=np.zeros(1, dtype=network_records.INTEGERS_STATE_DTYPE),
            x=np.zeros(rtk_records.ROOM),
            P=np.zeros((rtk_records.ROOM, rtk_records.ROOM)),
        )

    def step(self, state: BaselineState, block: Block) -> tuple[BaselineState, Outputs]:
        """Take a block of epochs of both stations."""
        state.take(block, state.selection, self.roles)
        return state, self._run(state, int(state.now[0]), state.times[1])

    def finish(self, state: BaselineState) -> Outputs:
        """Epochs that still wait for the other station are lost to the baseline."""
        return {}

    def dump(self, state: BaselineState) -> bytes:
        """The state as bytes."""
        n = int(state.kernel["n"][0])
        return dump_arrays(
            {
                **{name: getattr(state, name) for name in _dump_types()},
                "x": state.x[:n],
                "P": state.P[:n, :n],
            }
        )

    def restore(self, state: BaselineState, data: bytes) -> BaselineState:
        """The state of a dump."""
        arrays: dict[str, Any] = restore_arrays(data, _dump_types())
        n = int(arrays["kernel"]["n"][0])
        x, P = np.zeros_like(state.x), np.zeros_like(state.P)
        x[:n] = arrays["x"]
        P[:n, :n] = arrays["P"]
        return dataclasses.replace(state, **{**arrays, "x": x, "P": P})

    def _run(self, state: BaselineState, now: int, wait: int) -> Outputs:
        # An epoch older than this one's is of no use: both are of one moment or none is.
        partner, release, ready = state.match(now, state.times[0], wait, state.times[0])
        if ready == 0:
            state.forget_unasked(state.times[0])
            return {}
        epochs = state.epochs[:ready]
        end = int(epochs["first"][-1] + epochs["count"][-1])
        ambiguities = np.zeros(3 * end, dtype=rtk_records.AMBIGUITY_ROW_DTYPE)
        steps = np.zeros(2 * ready, dtype=network_records.STEP_ROW_DTYPE)
        residuals = np.zeros(2 * end, dtype=network_records.RESIDUAL_ROW_DTYPE)
        notes = np.zeros(ready * (4 + 5 * rtk_records.PAIRS), dtype=NOTE_DTYPE)
        counts = np.zeros(6, dtype=np.int64)
        network_ambiguities.run_baseline(
            state.kernel, state.integers, state.x, state.P, state.config, state.integers_config,
            epochs, state.rows, state.base_epochs, state.base_rows, partner, release,
            ambiguities, steps, residuals, notes, counts,
        )  # fmt: skip
        state.released[0] = release[ready - 1]
        state.forget(ready)
        state.forget_unasked(state.times[0])
        of = network_ambiguities
        columns: dict[channels.ChannelSpec, Columns] = {
            channels.NETWORK_AMBIGUITIES: ambiguity_columns(ambiguities[: counts[of.AMBIGUITIES]]),
            channels.NETWORK_RESOLUTION: step_columns(steps[: counts[of.STEPS]]),
            channels.NETWORK_RESIDUALS: _residual_columns(residuals[: counts[of.RESIDUALS]]),
            channels.NETWORK_EVENTS: event_columns(notes[: counts[of.NOTES]], _EVENT_TEXT),
        }
        return {
            Port(channel, self.baseline).name: rows
            for channel, rows in columns.items()
            if len(rows)
        }


def _growth(tau_s: float, interval_s: float) -> float:
    """Deviation of white noise that averages as slowly as a correlated one of unit deviation.

    The mean of many epochs of a first-order Gauss-Markov process has the variance of white
    noise times (1 + f) / (1 - f), where f = exp(-interval / tau).
    """
    if not tau_s > 0.0:
        return 1.0
    fade = float(elementary.exp(-interval_s / tau_s))
    return math.sqrt((1.0 + fade) / (1.0 - fade))


def _float_record(config: NetworkSettings, gap_s: float, interval_s: float) -> Array:
    """Settings of the float filter as the record that the compiled loop reads."""
    settings = config.integers
    record = np.zeros(1, dtype=rtk_records.RTK_CONFIG_DTYPE)
    for name in ("code_sigma", "phase_sigma"):
        values = getattr(settings, name)
        if len(values) not in (1, SLOTS):
            raise ConfigurationError(f"integers.{name} has {SLOTS} numbers or one")
        scale = _growth(getattr(settings, name.replace("sigma", "correlation")), interval_s)
        record[name] = scale * np.array(values)
    record["mask"] = config.gnss.mask
    record["cn0_mask"] = config.gnss.cn0_mask
    record["excluded"] = excluded_satellites(config.gnss)
    record["system_scale"] = 1.0
    record["slots"] = _FREQUENCIES
    record["weighting"] = WEIGHTINGS[settings.weighting]
    record["baseline_noise"] = settings.orbit_sigma
    record["dynamics"] = rtk_records.STATIC
    record["position_sigma"] = _POSITION_SIGMA_M
    record["ionosphere"] = 1
    record["troposphere"] = 1
    for name in (
        *("ambiguity_sigma", "ambiguity_noise", "ionosphere_sigma", "ionosphere_noise"),
        *("wet_sigma", "wet_noise", "geometry_free", "code_gate", "phase_gate", "rejections"),
    ):
        record[name] = getattr(settings, name)
    record["gap"] = gap_s
    record["mode"] = rtk_records.CONTINUOUS
    record["max_age"] = _REMEMBERED_S
    return record


def _integers_record(config: NetworkSettings, interval_s: float) -> Array:
    settings = config.integers
    record = np.zeros(1, dtype=network_records.INTEGERS_CONFIG_DTYPE)
    for name in ("threshold", "success", "mask", "lock", "confirm", "doubt"):
        record[name] = getattr(settings, name)
    record["test"] = _TESTS[settings.test]
    record["phase_scale"] = _growth(settings.phase_correlation, interval_s)
    record["least"] = _LEAST
    return record


def _residual_columns(rows: Array) -> Columns:
    return Columns.build(
        rows["t"],
        {
            "satellite": SATELLITE_NAMES[rows["satellite"]],
            "reference": SATELLITE_NAMES[rows["reference"]],
            "signal": signal_names(rows["signal"]),
            "residual_m": np.ascontiguousarray(rows["residual"]),
            "residual_std_m": np.ascontiguousarray(rows["sigma"]),
        },
        log_time_ns=rows["log_t"],
    )


def _dump_types() -> dict[str, np.dtype[Any]]:
    return {
        "kernel": rtk_records.RTK_STATE_DTYPE,
        "integers": network_records.INTEGERS_STATE_DTYPE,
        **EPOCH_TYPES,
        "x": np.dtype(np.float64),
        "P": np.dtype(np.float64),
    }
