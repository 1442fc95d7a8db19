"""Precise point positioning: one receiver's codes and phases with precise orbits and clocks.

The innovations are what is left of a measurement after the update: `innovation_std` is then
that of the residual, and `accepted` says whether the measurement was used. The arithmetic
is in :mod:`replay.kernels.ppp`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import ConfigurationError
from replay.gnss.measurements import Epochs, Selection, select_signals
from replay.kernels import ppp, ppp_output, ppp_records
from replay.kernels.gnss_records import BEIDOU, FIRST, SLOTS, SYSTEMS
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
from replay.stages.gnss_columns import (
    antenna_solution_columns,
    clock_columns,
    event_columns,
    geometry_columns,
    residual_columns,
)
from replay.stages.ppp_columns import PPP_EVENT_TEXT, new_precise_rows, precise_columns
from replay.stages.ppp_config import PppConfig
from replay.stages.spp import excluded_satellites
from replay.stages.spp_config import WEIGHTINGS
from replay.stages.state_names import name_of
from replay.stages.transitions import Nodes, Recorder, recording
from replay.stages.waiting import longest_gap, nominal_interval, read_epochs

Array = np.ndarray[Any, Any]

_DYNAMICS: Final = {
    "static": ppp_records.STATIC,
    "kinematic": ppp_records.KINEMATIC,
    "velocity": ppp_records.VELOCITY,
}
_IONOSPHERES: Final = {
    "free": ppp_records.IONOSPHERE_FREE,
    "constrained": ppp_records.IONOSPHERE_CONSTRAINED,
    "combination": ppp_records.IONOSPHERE_COMBINATION,
}
_MODES: Final = {"continuous": 1, "fix-and-hold": ppp_records.HOLD, "float": ppp_records.FLOAT_ONLY}
_TESTS: Final = ("ratio", "w-ratio")
_PARTIALS: Final = ("none", "elevation", "success")
# BeiDou satellites that stand, or come back after a day: PRN.
_HIGH: Final = (*range(1, 11), 13, 16, 31, 38, 39, 40, 56, 59, 60, 61, 62)


@dataclasses.dataclass(slots=True)
class PppState:
    """Everything that crosses from one block to the next."""

    selection: Selection
    codes: Selection | None
    config: Array
    kernel: Array
    x: Array
    P: Array
    recorder: Recorder


class Ppp:
    """The stage `ppp`.

    Parameters
    ----------
    record : bool
        Whether it writes transitions for a smoother.
    """

    _PLAIN: Final = StageSpec(
        name="ppp",
        version=2,
        inputs=(
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
            Port(channels.FILTER_EVENTS),
            Port(channels.SOLUTION),
        ),
        trigger=Port(channels.GNSS_OBS),
    )

    def __init__(self, record: bool = False) -> None:
        self._record = record
        self.spec = recording(self._PLAIN, record)

    def start(self, config: Section, context: Context) -> PppState:
        """State before the first row."""
        if not isinstance(config, PppConfig):
            raise TypeError("ppp takes a PppConfig")
        return PppState(
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            codes=clock_codes(config, context),
            config=ppp_config(config, context),
            kernel=ppp_records.new_ppp_state(),
            x=np.zeros(ppp_records.ROOM),
            P=np.zeros((ppp_records.ROOM, ppp_records.ROOM)),
            recorder=Recorder(ppp_records.ROOM, self._record, name_of()),
        )

    def step(self, state: PppState, block: Block) -> tuple[PppState, Outputs]:
        """Take a block of epochs."""
        found = read_epochs(block, state.selection, codes=state.codes)
        if found is None:
            return state, {}
        recorder = state.recorder
        made = recorder.run(
            lambda nodes: self._filter(state, found, nodes),
            state.kernel, state.x, state.P, recorder.trail,
        )  # fmt: skip
        solutions, innovations, own = made[0], made[1], made[2:]
        notes, counts = own[2], own[-1]
        solutions = solutions[: counts[ppp_output.SOLUTIONS]]
        columns = {
            channels.FILTER_INNOVATIONS.name: residual_columns(
                innovations[: counts[ppp_output.INNOVATIONS]]
            ),
            channels.FILTER_CLOCKS.name: clock_columns(solutions),
            channels.FILTER_GEOMETRY.name: geometry_columns(solutions),
            **precise_columns(own),
            channels.FILTER_EVENTS.name: event_columns(
                notes[: counts[ppp_output.NOTES]], PPP_EVENT_TEXT
            ),
            channels.SOLUTION.name: antenna_solution_columns(solutions),
            **recorder.outputs(),
        }
        return state, {name: rows for name, rows in columns.items() if len(rows)}

    @staticmethod
    def _filter(state: PppState, found: Epochs, nodes: Nodes) -> tuple[Array, ...]:
        """The compiled loop over a block: solutions, innovations, and the rest with its counts."""
        epochs, rows = len(found.epochs), len(found.rows)
        solutions = np.zeros(epochs, dtype=SINGLE_ROW_DTYPE)
        innovations = np.zeros((2 * SLOTS + 2) * rows, dtype=RESIDUAL_DTYPE)
        # Per epoch a jump of the clock, too few satellites or a reset, a fix or its loss.
        own = new_precise_rows(epochs, rows, notes=5)
        ambiguities, resolutions, notes, zeniths, slants, biases, phases, counts = own
        ppp.run_ppp(
            state.kernel, state.x, state.P, state.config, np.zeros(1, dtype=SOLVE_DTYPE),
            found.epochs, found.rows, solutions, innovations, ambiguities, resolutions, notes,
            zeniths, slants, biases, phases, counts, state.recorder.trail, nodes,
        )  # fmt: skip
        return (solutions, innovations, *own)

    def finish(self, state: PppState) -> Outputs:
        """Nothing is left to say."""
        return {}

    def dump(self, state: PppState) -> bytes:
        """The state as bytes."""
        n = int(state.kernel["n"][0])
        return dump_arrays(
            {
                "kernel": state.kernel,
                "x": state.x[:n],
                "P": state.P[:n, :n],
                **state.recorder.arrays(),
            }
        )

    def restore(self, state: PppState, data: bytes) -> PppState:
        """The state of a dump."""
        number = np.dtype(np.float64)
        types = {"kernel": ppp_records.PPP_STATE_DTYPE, "x": number, "P": number}
        arrays: dict[str, Any] = restore_arrays(data, {**types, **state.recorder.types()})
        recorder = state.recorder.restored(arrays)
        n = int(arrays["kernel"]["n"][0])
        x, P = np.zeros_like(state.x), np.zeros_like(state.P)
        x[:n] = arrays["x"]
        P[:n, :n] = arrays["P"]
        return dataclasses.replace(state, kernel=arrays["kernel"], x=x, P=P, recorder=recorder)


def clock_codes(config: PppConfig, context: Context) -> Selection | None:
    """Signals whose codes replace others, None where biases or broadcast clocks need none."""
    products = config.products
    biases = context.heads.get(Port(channels.SIGNAL_BIAS).name)
    biased = products.biases and biases is not None and len(biases) > 0
    if products.source != "precise" or biased or not products.clock_codes:
        return None
    return select_signals(products.clock_codes, config.gnss.systems)


def ppp_config(config: PppConfig, context: Context) -> Array:
    """Settings as the record that the compiled loop reads.

    Raises
    ------
    ConfigurationError
        Where a list has the wrong length or a number cannot be.
    """
    own = config.ppp
    measurements, motion, delays = own.measurements, own.motion, own.delays
    phases, ambiguities = own.phases, own.ambiguities
    record = np.zeros(1, dtype=ppp_records.PPP_CONFIG_DTYPE)
    if not 1 <= measurements.frequencies <= SLOTS:
        raise ConfigurationError(f"ppp.measurements.frequencies is from 1 to {SLOTS}")
    if delays.ionosphere == "combination" and measurements.frequencies < 2:
        raise ConfigurationError(
            "ppp.delays.ionosphere is a combination of two frequencies, "
            f"and ppp.measurements.frequencies is {measurements.frequencies}",
            mend="--set ppp.measurements.frequencies=2",
        )
    if delays.ionosphere == "combination" and ambiguities.mode != "float":
        raise ConfigurationError(
            "ambiguities of an ionosphere-free combination are no integers",
            mend="--set ppp.ambiguities.mode=float",
        )
    if delays.ionosphere == "constrained" and config.atmosphere.ionosphere == "none":
        raise ConfigurationError(
            "ppp.delays.ionosphere is constrained to a model, and there is none",
            mend="--set atmosphere.ionosphere=klobuchar",
        )
    for name, count in (
        *(("code_sigma", SLOTS), ("phase_sigma", SLOTS)),
        *(("code_scale", SYSTEMS), ("phase_scale", SYSTEMS)),
    ):
        values = getattr(measurements, name)
        if len(values) not in (1, count):
            raise ConfigurationError(f"ppp.measurements.{name} has {count} numbers or one")
        record[name] = values
    record["mask"] = config.gnss.mask
    record["cn0_mask"] = config.gnss.cn0_mask
    record["excluded"] = excluded_satellites(config.gnss)
    record["slots"] = measurements.frequencies
    record["weighting"] = WEIGHTINGS[measurements.weighting]
    record["range_scale"] = measurements.range_std_scale
    record["range_walk"] = measurements.range_walk
    record["range_usual"] = config.products.range_std
    record["satellite_scale"] = 1.0
    for prn in _HIGH:
        record["satellite_scale"][0, FIRST[BEIDOU] + prn - 1] = measurements.high_scale
    for name in ("doppler_sigma", "code_gate", "phase_gate", "rounds"):
        record[name] = getattr(measurements, name)
    for name in motion.__struct_fields__:
        if name != "dynamics":
            record[name] = getattr(motion, name)
    record["dynamics"] = _DYNAMICS[motion.dynamics]
    for name in delays.__struct_fields__:
        if name not in ("ionosphere", "gradients"):
            record[name] = getattr(delays, name)
    record["ionosphere"] = _IONOSPHERES[delays.ionosphere]
    record["gradients"] = int(delays.gradients)
    record["ambiguity_sigma"] = phases.sigma
    record["ambiguity_noise"] = phases.noise
    for name in ("geometry_free", "geometry_free_rate", "wide_lane", "rejections", "failures"):
        record[name] = getattr(phases, name)
    record["gap"] = longest_gap(phases.gap, nominal_interval(context, Port(channels.GNSS_OBS)))
    for name in ambiguities.__struct_fields__:
        if name not in ("mode", "test", "mask", "partial"):
            record[name] = getattr(ambiguities, name)
    record["mode"] = _MODES[ambiguities.mode]
    record["test"] = _TESTS.index(ambiguities.test)
    record["partial"] = _PARTIALS.index(ambiguities.partial)
    record["mask_resolve"] = ambiguities.mask
    return record
