"""Corrections of a rover's phases from the errors at the stations around it.

A rover's epoch waits for the errors of every baseline that lives, or for as long as it is told
to; what it gives bears the log time of the row that made it ready. A station whose errors are
too old has dropped out: the others go on without it, and no epoch waits for it. Each satellite
is interpolated from the stations that have it (Lee 2010, eqs 5 to 8). The arithmetic is in
:mod:`replay.kernels.network_corrections` and :mod:`replay.kernels.interpolation`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.kernels import network_corrections as kernel
from replay.kernels import network_matching
from replay.kernels.baseline_errors import ERROR_ROW_DTYPE
from replay.kernels.earth import enu_axes
from replay.log.columns import Columns
from replay.stages.base import (
    BASE,
    Block,
    Context,
    Outputs,
    Port,
    StageSpec,
    dump_arrays,
    restore_arrays,
)
from replay.stages.network_columns import (
    correction_columns,
    error_records,
    rising_epochs,
    rows_of,
)
from replay.stages.network_config import NetworkSettings
from replay.stages.satellites import station_position

Array = np.ndarray[Any, Any]

_NS: Final = 1_000_000_000
_METHODS: Final = ("lim", "lcm", "dim", "lsc")
_LATE_NS: Final = 10 * _NS
"""By this much more than their age a rover may be behind the stations in the log."""

_TYPES: Final[dict[str, np.dtype[Any]]] = {
    "places": kernel.PLACE_DTYPE,
    "epochs": network_matching.ERROR_EPOCH_DTYPE,
    "rows": ERROR_ROW_DTYPE,
    "now": np.dtype(np.int64),
    "released": np.dtype(np.int64),
}


@dataclasses.dataclass(slots=True)
class NetworkCorrectionsState:
    """Everything that crosses from one block to the next."""

    method: int
    field: Array
    times: tuple[int, int, int, int]  # ns: tolerance, wait, largest age, latest
    master: Array  # m, ECEF
    axes: Array
    stations: Array  # m, ECEF
    places: Array  # epochs of the rover that wait
    epochs: Array  # errors, in the order of their arrival
    rows: Array
    now: Array  # ns, one element: log time of the last row
    released: Array  # ns, one element: of the last epoch's release


class NetworkCorrections:
    """The stage `network-corrections`.

    Parameters
    ----------
    stations : tuple of str
        Beside the master, which is the base.
    baselines : tuple of str
        From the master to each station, in the same order.
    """

    def __init__(self, stations: tuple[str, ...], baselines: tuple[str, ...]) -> None:
        if len(stations) != len(baselines):
            raise ValueError(f"{len(stations)} stations have {len(baselines)} baselines")
        self.stations = stations
        self.errors = tuple(Port(channels.NETWORK_ERRORS, baseline) for baseline in baselines)
        coarse = Port(channels.COARSE)
        self.spec = StageSpec(
            name="network-corrections",
            version=1,
            inputs=(
                coarse,
                *(Port(channels.RECEIVER, role, optional=True) for role in (BASE, *stations)),
                *self.errors,
            ),
            outputs=(Port(channels.NETWORK_CORRECTIONS),),
            trigger=coarse,
        )

    def start(self, config: Section, context: Context) -> NetworkCorrectionsState:
        """State before the first row."""
        if not isinstance(config, NetworkSettings):
            raise TypeError("network-corrections takes settings of a network")
        own = config.interpolation
        master = np.array(station_position(config, context, BASE))
        axes = np.zeros((3, 3))
        enu_axes(float(master[0]), float(master[1]), float(master[2]), axes)
        max_age = round(own.max_age * _NS)
        return NetworkCorrectionsState(
            method=_METHODS.index(own.method),
            field=np.array([own.slope, own.curvature]),
            times=(
                round(own.tolerance * _NS), round(own.wait * _NS), max_age, max_age + _LATE_NS,
            ),
            master=master,
            axes=axes,
            stations=np.array(
                [station_position(config, context, role) for role in self.stations]
            ).reshape(-1, 3),
            places=np.zeros(0, dtype=kernel.PLACE_DTYPE),
            epochs=np.zeros(0, dtype=network_matching.ERROR_EPOCH_DTYPE),
            rows=np.zeros(0, dtype=ERROR_ROW_DTYPE),
            now=np.zeros(1, dtype=np.int64),
            released=np.zeros(1, dtype=np.int64),
        )  # fmt: skip

    def step(
        self, state: NetworkCorrectionsState, block: Block
    ) -> tuple[NetworkCorrectionsState, Outputs]:
        """Take a block of the rover's epochs and of errors."""
        coarse = block.get(channels.COARSE.name)
        if coarse is not None:
            state.places = np.concatenate([state.places, _places(coarse)])
            state.now[0] = max(int(state.now[0]), int(coarse.log_time_ns[-1]))
        self._take_errors(state, block)
        return state, self._run(state, int(state.released[0]), state.times[1])

    def finish(self, state: NetworkCorrectionsState) -> Outputs:
        """Epochs that still wait, with what there is."""
        return self._run(state, int(state.now[0]), 0)

    def dump(self, state: NetworkCorrectionsState) -> bytes:
        """The state as bytes."""
        return dump_arrays({name: getattr(state, name) for name in _TYPES})

    def restore(self, state: NetworkCorrectionsState, data: bytes) -> NetworkCorrectionsState:
        """The state of a dump."""
        arrays: dict[str, Any] = restore_arrays(data, _TYPES)
        return dataclasses.replace(state, **arrays)

    def _take_errors(self, state: NetworkCorrectionsState, block: Block) -> None:
        """Keep the errors of a block; epochs that are no later than their baseline's last go."""
        parts, epochs = [state.rows], [state.epochs]
        count = len(state.rows)
        for place, port in enumerate(self.errors):
            columns = block.get(port.name)
            if columns is None:
                continue
            state.now[0] = max(int(state.now[0]), int(columns.log_time_ns[-1]))
            rows = error_records(columns)
            own = state.epochs["t"][state.epochs["baseline"] == place]
            starts, counts = rising_epochs(rows, int(own[-1]) if len(own) else -1)
            found = np.zeros(len(starts), dtype=network_matching.ERROR_EPOCH_DTYPE)
            found["baseline"] = place
            found["t"] = rows["t"][starts]
            found["log_t"] = rows["log_t"][starts]
            found["first"] = count + starts
            found["count"] = counts
            count += len(rows)
            parts.append(rows)
            epochs.append(found)
        if len(parts) == 1:
            return
        state.rows = np.concatenate(parts)
        joined = np.concatenate(epochs)
        # All that was here before came earlier; baselines of one log time in their order.
        state.epochs = joined[np.argsort(joined["log_t"], kind="stable")]

    def _run(self, state: NetworkCorrectionsState, last: int, wait: int) -> Outputs:
        count, baselines = len(state.places), len(self.errors)
        tolerance, _, max_age, late = state.times
        chosen = np.full((count, baselines), -1, dtype=np.int64)
        release = np.zeros(count, dtype=np.int64)
        ready = network_matching.match_errors(
            np.ascontiguousarray(state.places["t"]),
            np.ascontiguousarray(state.places["log_t"]),
            state.epochs, baselines, int(state.now[0]), last, tolerance, wait, max_age, late,
            chosen, release,
        )  # fmt: skip
        written = 0
        if ready:
            counts = np.concatenate([state.epochs["count"], [0]])
            out = np.zeros(2 * int(counts[chosen[:ready]].sum()), dtype=kernel.CORRECTION_ROW_DTYPE)
            written = kernel.run_corrections(
                state.method, state.field, state.axes, state.master, state.stations,
                state.places[:ready], state.epochs, state.rows, chosen, release, out,
            )  # fmt: skip
            state.places = state.places[ready:].copy()
            state.released[0] = release[ready - 1]
        _forget(state, baselines)
        if not written:
            return {}
        return {channels.NETWORK_CORRECTIONS.name: correction_columns(out[:written])}


def _places(coarse: Columns) -> Array:
    places = np.zeros(len(coarse), dtype=kernel.PLACE_DTYPE)
    places["t"] = coarse.valid_time_ns
    places["log_t"] = coarse.log_time_ns
    places["x"] = coarse["position_ecef_m"]
    return places


def _forget(state: NetworkCorrectionsState, baselines: int) -> None:
    """Drop errors that no epoch of the rover can ask for any more; rows stand by epochs."""
    keep = np.zeros(len(state.epochs), dtype=np.bool_)
    for place in range(baselines):
        own = state.epochs["baseline"] == place
        if own.any():
            keep |= own & (state.epochs["t"] >= state.epochs["t"][own].max() - state.times[3])
    state.epochs = state.epochs[keep]
    counts = state.epochs["count"]
    state.rows = state.rows[rows_of(state.epochs["first"], counts)]
    state.epochs["first"] = np.cumsum(counts) - counts
