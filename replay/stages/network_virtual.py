"""A virtual reference station: the master's observations as if it stood near the rover.

It stands where the rover was at its first epoch. The master's codes and phases are moved
there by the differences of the ranges and of all that is modelled, for the satellites of the
master's own epochs, and take on the errors that the network tells of the rover. These are of
the place where the rover is now, not of where the station stands: that is what a rover wants
that drives away. A phase takes its correction as it is; a code takes that part which is the
same on all frequencies with the same sign and the ionosphere's with the other one, where two
frequencies tell them apart, else nothing.

Corrections are differences between satellites: when a system's reference changes, all its
phases of a signal jump together. Differences between satellites do not see it. Doppler is not
moved and not given.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.gnss.measurements import SATELLITE_NAMES, Selection, select_signals, signal_names
from replay.kernels import virtual_station as kernel
from replay.log.columns import Columns, Ragged
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
    NAME_DTYPE,
    named_rows,
    rising_epochs,
    rows_of,
    satellite_numbers,
)
from replay.stages.network_config import NetworkSettings
from replay.stages.satellites import Satellites, SatellitesState

Array = np.ndarray[Any, Any]

VIRTUAL: Final = "vrs"
"""Name of the receiver that is not there."""

_NS: Final = 1_000_000_000
_LATE_NS: Final = 10 * _NS
_NO_CHANNEL: Final = 99
_COMMON: Final = (
    "distance_m",
    "sagnac_m",
    "satellite_clock_m",
    "relativity_m",
    "group_delay_m",
    "hydrostatic_m",
    "wet_m",
)
_WHERE_MODELLED: Final = ("shapiro_m", "antenna_m")
_TYPES: Final[dict[str, np.dtype[Any]]] = {
    "place": np.dtype(np.float64),
    "since": np.dtype(np.int64),
    "newest": np.dtype(np.int64),
    "held": kernel.MOVED_DTYPE,
    "inner": np.dtype(np.uint8),
}
_OBSERVATIONS: Final = Port(channels.GNSS_OBS, BASE)
_MODELLED: Final = Port(channels.CORRECTIONS, BASE)
_SIGHTS: Final = Port(channels.SATELLITES, BASE)


@dataclasses.dataclass(slots=True)
class NetworkVirtualState:
    """Everything that crosses from one block to the next."""

    selection: Selection
    times: tuple[int, int]  # ns: tolerance, latest
    inner: SatellitesState
    master: Array  # m, ECEF
    place: Array  # m, ECEF, NaN before the rover's first epoch
    since: Array  # ns, log time from which it is known
    newest: Array  # ns, one element: the master's latest epoch, minus one before the first
    held: Array  # the master's observations that wait for corrections


class NetworkVirtual:
    """The stage `network-virtual`."""

    spec = StageSpec(
        name="network-virtual",
        version=1,
        inputs=(
            _OBSERVATIONS,
            _SIGHTS,
            _MODELLED,
            Port(channels.NAV),
            Port(channels.NAV_IONOSPHERE, optional=True),
            Port(channels.RECEIVER, BASE, optional=True),
            Port(channels.COARSE),
            Port(channels.NETWORK_CORRECTIONS),
        ),
        outputs=(Port(channels.GNSS_OBS, VIRTUAL), Port(channels.RECEIVER, VIRTUAL)),
        trigger=Port(channels.NETWORK_CORRECTIONS),
    )

    def __init__(self) -> None:
        # What is modelled at the virtual station: the base's stage at another place.
        self._model = Satellites(BASE)

    def start(self, config: Section, context: Context) -> NetworkVirtualState:
        """State before the first row."""
        if not isinstance(config, NetworkSettings):
            raise TypeError("network-virtual takes settings of a network")
        own = config.interpolation
        inner = self._model.start(config, context)
        return NetworkVirtualState(
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            times=(round(own.tolerance * _NS), round(own.wait * _NS) + _LATE_NS),
            inner=inner,
            master=np.array(inner.config["position"][0]),
            place=np.full(3, np.nan),
            since=np.full(1, np.iinfo(np.int64).max, dtype=np.int64),
            newest=np.full(1, -1, dtype=np.int64),
            held=np.zeros(0, dtype=kernel.MOVED_DTYPE),
        )

    def step(self, state: NetworkVirtualState, block: Block) -> tuple[NetworkVirtualState, Outputs]:
        """Take a block."""
        outputs: Outputs = {}
        coarse = block.get(channels.COARSE.name)
        if coarse is not None and np.isnan(state.place[0]):
            state.place[:] = coarse["position_ecef_m"][0]
            state.since[0] = coarse.log_time_ns[0]
            outputs[Port(channels.RECEIVER, VIRTUAL).name] = _information(coarse)
        self._hold(state, block)
        corrections = block.get(channels.NETWORK_CORRECTIONS.name)
        if corrections is None:
            self._forget(state)
            return state, outputs
        rows = _shift_records(corrections, state.selection)
        out = np.zeros(len(state.held), dtype=kernel.MOVED_DTYPE)
        spent, written = kernel.move_epochs(state.held, rows, *state.times, out)
        state.held = state.held[spent:].copy()
        self._forget(state)
        if written:
            outputs[Port(channels.GNSS_OBS, VIRTUAL).name] = _observations(out[:written])
        return state, outputs

    def finish(self, state: NetworkVirtualState) -> Outputs:
        """Nothing is left to say."""
        return {}

    def dump(self, state: NetworkVirtualState) -> bytes:
        """The state as bytes."""
        inner = np.frombuffer(self._model.dump(state.inner), dtype=np.uint8)
        own = {name: getattr(state, name) for name in _TYPES if name != "inner"}
        return dump_arrays({**own, "inner": inner})

    def restore(self, state: NetworkVirtualState, data: bytes) -> NetworkVirtualState:
        """The state of a dump."""
        arrays: dict[str, Any] = restore_arrays(data, _TYPES)
        inner = self._model.restore(state.inner, arrays.pop("inner").tobytes())
        return dataclasses.replace(state, **arrays, inner=inner)

    def _hold(self, state: NetworkVirtualState, block: Block) -> None:
        """Keep the master's observations with the way from there to the virtual station."""
        part = dict(block)
        observations = part.pop(_OBSERVATIONS.name, None)
        modelled, sights = part.pop(_MODELLED.name, None), part.pop(_SIGHTS.name, None)
        if observations is not None:
            observations = observations.take(observations.log_time_ns >= state.since[0])
            if len(observations) and sights is not None:
                part[_OBSERVATIONS.name] = _heard_there(
                    observations, sights, state.master, state.place
                )
                state.inner.config["position"] = state.place
        state.inner, found = self._model.step(state.inner, part)
        there = found.get(_MODELLED.name)
        if observations is None or modelled is None or there is None:
            return
        moved = _moved_records(observations, modelled, there, state.selection)
        starts, counts = rising_epochs(moved, int(state.newest[0]))
        if len(starts):
            state.newest[0] = moved["t"][starts[-1]]
            state.held = np.concatenate([state.held, moved[rows_of(starts, counts)]])

    @staticmethod
    def _forget(state: NetworkVirtualState) -> None:
        """Drop epochs of the master that are too old for any correction to come."""
        state.held = state.held[state.held["t"] >= state.newest[0] - state.times[1]]


def _heard_there(observations: Columns, sights: Columns, master: Array, place: Array) -> Columns:
    """Observations with pseudoranges that tell when the signals left that arrive elsewhere.

    A satellite goes up to a metre while the light is longer on its way to one place than to
    another one 100 km off.
    """
    rows, observations = named_rows(observations)
    seen = np.zeros(len(sights), dtype=NAME_DTYPE)
    seen["t"] = sights.valid_time_ns
    seen["log_t"] = sights.log_time_ns
    seen["satellite"] = satellite_numbers(sights["satellite"])[0]
    wanted = rows.copy()
    wanted["signal"] = 0
    at = _match(wanted, seen)
    farther = kernel.range_differences(
        np.ascontiguousarray(sights["position_ecef_m"]), master, place
    )
    ranges = observations["pseudorange_m"] + np.where(at >= 0, farther[at], 0.0)
    values = {**observations.values, "pseudorange_m": ranges}
    return dataclasses.replace(observations, values=values, payloads=None)


def _frequencies(rows: Array, channel: Array, selection: Selection) -> Array:
    """Hz of each row's signal; 0 where it has none."""
    band = np.clip(rows["signal"] % 256 - ord("0"), 0, 9)
    found = selection.frequency[rows["system"], band]
    return np.where(
        (found[:, 1] != 0.0) & (channel == _NO_CHANNEL), 0.0, found[:, 0] + channel * found[:, 1]
    )


def _match(wanted: Array, rows: Array) -> Array:
    """For each wanted row the row of the same times, satellite and signal, or minus one."""
    keys = [
        np.stack([part[name] for name in ("log_t", "t", "satellite", "signal")], axis=1)
        for part in (rows, wanted)
    ]
    _, number = np.unique(np.concatenate(keys), axis=0, return_inverse=True)
    number = number.reshape(-1)
    place = np.full(len(number), -1, dtype=np.int64)
    place[number[: len(rows)]] = np.arange(len(rows))
    return place[number[len(rows) :]]


def _modelled(columns: Columns) -> tuple[Array, Array, Array]:
    """Names of rows, all that is modelled but the ionosphere (m), and the ionosphere (m)."""
    rows, columns = named_rows(columns)
    # The antenna is the master's alone: a station that is not there has none.
    total: Array = np.zeros(len(rows))
    for name in _WHERE_MODELLED:
        if name in columns.values:
            total = total + np.where(columns.is_present(name), columns[name], 0.0)
    for name in _COMMON:
        total = total + columns[name]
    return rows, total, columns["ionosphere_m"].astype(np.float64)


def _moved_records(
    observations: Columns, here: Columns, there: Columns, selection: Selection
) -> Array:
    """Records of MOVED_DTYPE of what is modelled at both places."""
    rows, observations = named_rows(observations)
    known = observations.is_present("glonass_channel")
    channel = np.where(known, observations["glonass_channel"].astype(np.int64), _NO_CHANNEL)
    frequency = _frequencies(rows, channel, selection)
    names, common, ionosphere = _modelled(here)
    other_names, other_common, other_ionosphere = _modelled(there)
    at, to = _match(rows, names), _match(rows, other_names)
    use = (at >= 0) & (to >= 0) & (frequency > 0.0)
    at, to = at[use], to[use]
    moved = np.zeros(int(use.sum()), dtype=kernel.MOVED_DTYPE)
    for name in ("t", "log_t", "satellite", "signal"):
        moved[name] = rows[name][use]
    moved["frequency"] = frequency[use]
    moved["code"] = observations["pseudorange_m"][use]
    moved["phase"] = observations["carrier_phase_cycles"][use]
    moved["shift"] = other_common[to] - common[at]
    moved["delay"] = other_ionosphere[to] - ionosphere[at]
    moved["cn0"] = observations["cn0_dbhz"][use]
    moved["lock_time"] = observations["lock_time_s"][use]
    lost = observations["loss_of_lock"].astype(np.int64)
    moved["lost"] = np.where(observations.is_present("loss_of_lock"), lost, -1)[use]
    moved["channel"] = channel[use]
    return moved


def _shift_records(corrections: Columns, selection: Selection) -> Array:
    rows, corrections = named_rows(corrections)
    shifts = np.zeros(len(rows), dtype=kernel.SHIFT_DTYPE)
    for name in ("t", "log_t", "satellite", "signal"):
        shifts[name] = rows[name]
    # Of GLONASS the ratio of frequencies serves, which all channels have alike.
    shifts["frequency"] = _frequencies(rows, np.zeros(len(rows), dtype=np.int64), selection)
    shifts["value"] = corrections["correction_m"]
    return shifts


def _observations(rows: Array) -> Columns:
    count = len(rows)
    lost, channel = rows["lost"] >= 0, rows["channel"] != _NO_CHANNEL
    values: dict[str, Any] = {
        "satellite": SATELLITE_NAMES[rows["satellite"]],
        "signal": signal_names(rows["signal"]),
        "pseudorange_m": np.ascontiguousarray(rows["code"]),
        "carrier_phase_cycles": np.ascontiguousarray(rows["phase"]),
        "doppler_hz": np.full(count, np.nan),
        "cn0_dbhz": np.ascontiguousarray(rows["cn0"]),
        "lock_time_s": np.ascontiguousarray(rows["lock_time"]),
        "loss_of_lock": np.where(lost, rows["lost"], 0).astype(np.uint32),
        "glonass_channel": np.where(channel, rows["channel"], 0).astype(np.int32),
    }
    present = {name: np.isfinite(values[name]) for name in list(values)[2:7]}
    present |= {"loss_of_lock": lost, "glonass_channel": channel}
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"], present=present)


def _information(coarse: Columns) -> Columns:
    nothing = Ragged.from_texts([""])
    return Columns.build(
        coarse.valid_time_ns[:1],
        {
            "marker": Ragged.from_texts([VIRTUAL]),
            "receiver": nothing,
            "antenna": nothing,
            "approximate_position_ecef_m": coarse["position_ecef_m"][:1].copy(),
            "antenna_offset_enu_m": np.zeros((1, 3)),
            "interval_s": np.full(1, np.nan),
            "header": nothing,
        },
        log_time_ns=coarse.log_time_ns[:1],
        present={"interval_s": np.zeros(1, dtype=np.bool_)},
    )
