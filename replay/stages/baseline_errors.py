"""Errors between two reference stations that grow with their distance, filtered.

Residuals of double differences in, their errors, rates, accelerations and multipath out, one
filter for each satellite and signal (Lee 2010, eqs 1 to 4). A satellite has a row at the
epochs at which it has a residual; in between its filter goes on unseen. The arithmetic is in
:mod:`replay.kernels.baseline_errors`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import ConfigurationError
from replay.gnss.measurements import Selection, select_signals
from replay.kernels import baseline_errors as kernel
from replay.kernels.gnss_records import SLOTS
from replay.stages.base import (
    Block,
    Context,
    Outputs,
    Port,
    StageSpec,
    dump_arrays,
    restore_arrays,
)
from replay.stages.network_columns import error_columns, residual_records
from replay.stages.network_config import NetworkSettings

Array = np.ndarray[Any, Any]

_NS: Final = 1_000_000_000
_TYPES: Final[dict[str, np.dtype[Any]]] = {
    "last": np.dtype(np.int64),
    "filters": kernel.FILTER_DTYPE,
}


@dataclasses.dataclass(slots=True)
class BaselineErrorsState:
    """Everything that crosses from one block to the next."""

    selection: Selection
    share: Array
    config: Array
    last: Array  # ns, one element: last epoch, minus one before the first
    filters: Array


class BaselineErrors:
    """The stage `BASELINE-errors`.

    Parameters
    ----------
    baseline : str
        Role of its channels.
    """

    def __init__(self, baseline: str) -> None:
        residuals = Port(channels.NETWORK_RESIDUALS, baseline)
        self.residuals = residuals.name
        self.errors = Port(channels.NETWORK_ERRORS, baseline).name
        self.spec = StageSpec(
            name=f"{baseline}-errors",
            version=1,
            inputs=(residuals,),
            outputs=(Port(channels.NETWORK_ERRORS, baseline),),
            trigger=residuals,
        )

    def start(self, config: Section, context: Context) -> BaselineErrorsState:
        """State before the first row."""
        if not isinstance(config, NetworkSettings):
            raise TypeError(f"{self.spec.name} takes settings of a network")
        return BaselineErrorsState(
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            share=multipath_share(config),
            config=_config_record(config),
            last=np.full(1, -1, dtype=np.int64),
            filters=np.zeros(0, dtype=kernel.FILTER_DTYPE),
        )

    def step(self, state: BaselineErrorsState, block: Block) -> tuple[BaselineErrorsState, Outputs]:
        """Take a block of residuals; epochs that are no later than the one before go unused."""
        residuals = block.get(self.residuals)
        if residuals is None:
            return state, {}
        rows = residual_records(residuals, state.selection, state.share)
        count = len(state.filters)
        filters = np.zeros(count + len(rows), dtype=kernel.FILTER_DTYPE)
        filters[:count] = state.filters
        out = np.zeros(len(rows), dtype=kernel.ERROR_ROW_DTYPE)
        count, last, written = kernel.run_errors(
            filters, count, int(state.last[0]), state.config[0], rows, out
        )
        state.filters = filters[:count].copy()
        state.last[0] = last
        return state, {self.errors: error_columns(out[:written])} if written else {}

    def finish(self, state: BaselineErrorsState) -> Outputs:
        """Nothing is left to say."""
        return {}

    def dump(self, state: BaselineErrorsState) -> bytes:
        """The state as bytes."""
        return dump_arrays({name: getattr(state, name) for name in _TYPES})

    def restore(self, state: BaselineErrorsState, data: bytes) -> BaselineErrorsState:
        """The state of a dump."""
        arrays: dict[str, Any] = restore_arrays(data, _TYPES)
        return dataclasses.replace(state, **arrays)


def multipath_share(config: NetworkSettings) -> Array:
    """Part of a residual's variance that is multipath `(SLOTS,)`; the rest is white noise.

    `integers.phase_sigma` is of multipath and noise together, `errors.multipath_sigma` of
    multipath alone, both of one receiver in the zenith. A residual's deviation is that of
    four phases at their elevations; multipath is taken to grow with it.

    Raises
    ------
    ConfigurationError
        Where nothing would be left for noise.
    """
    sigmas = config.integers.phase_sigma
    if len(sigmas) not in (1, SLOTS):
        raise ConfigurationError(f"integers.phase_sigma has {SLOTS} numbers or one")
    multipath = config.errors.multipath_sigma
    if not 0.0 <= multipath < min(sigmas):
        raise ConfigurationError(
            f"errors.multipath_sigma is {multipath} m, all of integers.phase_sigma {min(sigmas)} m",
            mend=f"--set errors.multipath_sigma={0.8 * min(sigmas):.4g}",
        )
    ratio = multipath / np.broadcast_to(np.array(sigmas), SLOTS)
    return np.ascontiguousarray(ratio * ratio)


def _config_record(config: NetworkSettings) -> Array:
    errors = config.errors
    if not errors.multipath_tau > 0.0:
        raise ConfigurationError(f"errors.multipath_tau is {errors.multipath_tau} s, not above 0")
    record = np.zeros(1, dtype=kernel.ERRORS_CONFIG_DTYPE)
    record["sigma"] = errors.error_sigma, errors.rate_sigma, errors.acceleration_sigma
    record["noise"] = errors.acceleration_noise
    record["tau"] = errors.multipath_tau
    record["gate"] = errors.gate
    record["rejections"] = errors.rejections
    record["gap"] = round(errors.gap * _NS)
    return record
