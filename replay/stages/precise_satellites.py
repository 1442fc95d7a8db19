"""Orbits, clocks and corrections of what a receiver tracks, from precise products.

Channels are those of the stage `satellites`, so that every later stage reads either. The
arithmetic is in :mod:`replay.kernels.precise_sights`.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from typing import Any, Final

import msgspec
import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import MissingChannelError
from replay.gnss.antennas import ANTENNA_TYPES, Antennas
from replay.gnss.ephemerides import ephemeris_records
from replay.gnss.measurements import (
    Epochs,
    Selection,
    gather_epochs,
    select_signals,
)
from replay.gnss.product_store import STORE_TYPES, ProductStore, leap_table
from replay.gnss.products import interpolation_record
from replay.kernels import antenna_pattern, ionosphere_maps, precise_sights, sights
from replay.kernels import precise_records as records
from replay.kernels.ephemeris import EPHEMERIS_DTYPE
from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.log.columns import Columns, concatenate
from replay.stages.base import (
    RECEIVER,
    Block,
    Context,
    Outputs,
    Port,
    StageSpec,
    dump_arrays,
    restore_arrays,
)
from replay.stages.precise_config import PreciseConfig
from replay.stages.precise_events import frame_events, precise_event_columns
from replay.stages.satellites import by_satellite, config_record, ionosphere_records, klobuchar
from replay.stages.sight_columns import coarse_columns, correction_columns, sight_columns

Array = np.ndarray[Any, Any]

_NOTES_PER_EPOCH: Final = 8
_NOTES_PER_SATELLITE: Final = 4 + SLOTS
_TERMS: Final = {
    "satellite_antenna_m": "satellite_antenna",
    "solid_tide_m": "solid_tide",
    "pole_tide_m": "pole_tide",
    "ocean_loading_m": "ocean_loading",
    "wind_up_m": "wind_up",
    "phase_bias_m": "phase_bias",
    "higher_ionosphere_m": "higher_ionosphere",
}
_LAYERS: Final = {
    "thin": ionosphere_maps.THIN_LAYER,
    "modified": ionosphere_maps.MODIFIED_LAYER,
}


@dataclasses.dataclass(slots=True)
class PreciseSatellitesState:
    """Everything that crosses from one block to the next."""

    selection: Selection
    config: Array
    settings: Array
    calibrated: bool
    level: bool
    kernel: Array
    precise: Array
    models: Array
    messages: Array
    available: Array
    frames: Array
    store: ProductStore
    antennas: Antennas


class PreciseSatellites:
    """The stage `precise-satellites`.

    Parameters
    ----------
    role : str
        Whose observations.

    Notes
    -----
    A product serves from its log time on, which is the start of the log for those that an
    import brings. Terms that the log has not what they need for are absent. The antenna of the
    receiver is level; with `antenna.oriented` its mark points north, as that of a permanent
    station does, so that its offset and pattern are used whole. Of a vehicle's antenna the
    heading would turn the phases of all satellites alike, which the receiver's clock takes up:
    wind-up is modelled as for a mark to the north either way.
    """

    def __init__(self, role: str = RECEIVER) -> None:
        self.role = role
        observations = Port(channels.GNSS_OBS, role)
        self.spec = StageSpec(
            name="precise-satellites" if role == RECEIVER else f"{role}-precise-satellites",
            version=2,
            inputs=(
                observations,
                *(
                    Port(channel, optional=True)
                    for channel in (
                        channels.PRECISE_ORBIT,
                        channels.PRECISE_CLOCK,
                        channels.SIGNAL_BIAS,
                        channels.EARTH_ROTATION,
                        channels.IONOSPHERE_MAP,
                        channels.PRODUCTS,
                        channels.ANTENNAS,
                        channels.NAV,
                        channels.NAV_IONOSPHERE,
                    )
                ),
                Port(channels.OCEAN_LOADING, role, optional=True),
                Port(channels.RECEIVER, role, optional=True),
            ),
            outputs=(
                Port(channels.SATELLITES, role),
                Port(channels.CORRECTIONS, role),
                Port(channels.COARSE, role),
                Port(channels.GNSS_EVENTS, role),
            ),
            trigger=observations,
        )

    def start(self, config: Section, context: Context) -> PreciseSatellitesState:
        """State before the first row.

        Raises
        ------
        MissingChannelError
            Where the log lacks what the settings ask for.
        """
        if not isinstance(config, PreciseConfig):
            raise TypeError("precise-satellites takes a PreciseConfig")
        _check_channels(config, context)
        own = config.products
        interpolation = interpolation_record(
            degree=own.degree, beyond_s=own.beyond, clock_beyond_s=own.clock_beyond
        )
        return PreciseSatellitesState(
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            config=_sights_record(config),
            settings=_settings_record(config),
            calibrated=config.antenna.calibrated,
            level=not config.antenna.oriented,
            kernel=sights.new_sights_state(*klobuchar(config)),
            precise=records.new_precise_state(),
            models=np.zeros(0, dtype=sights.IONOSPHERE_DTYPE),
            messages=np.zeros(0, dtype=EPHEMERIS_DTYPE),
            available=np.zeros(0, dtype=np.int64),
            frames=np.zeros(0, dtype=np.uint8),
            store=ProductStore(interpolation, leap_table()),
            antennas=Antennas(),
        )

    def step(
        self, state: PreciseSatellitesState, block: Block
    ) -> tuple[PreciseSatellitesState, Outputs]:
        """Take a block of observations and products."""
        parts: dict[str, list[Columns]] = {}
        for part in _by_arrival(block, self.role):
            events = self._learn(state, part)
            if events is not None:
                parts.setdefault(Port(channels.GNSS_EVENTS, self.role).name, []).append(events)
            observations = part.get(Port(channels.GNSS_OBS, self.role).name)
            if observations is not None:
                for channel, rows in _solve(state, observations).items():
                    if len(rows):
                        parts.setdefault(Port(channel, self.role).name, []).append(rows)
        return state, {name: concatenate(found) for name, found in parts.items()}

    def finish(self, state: PreciseSatellitesState) -> Outputs:
        """Nothing is left to say."""
        return {}

    def dump(self, state: PreciseSatellitesState) -> bytes:
        """The state as bytes."""
        own = {name: getattr(state, name) for name in _OWN_TYPES}
        return dump_arrays({**own, **state.store.arrays(), **state.antennas.arrays()})

    def restore(self, state: PreciseSatellitesState, data: bytes) -> PreciseSatellitesState:
        """The state of a dump."""
        arrays = restore_arrays(data, {**_OWN_TYPES, **STORE_TYPES, **ANTENNA_TYPES})
        own: dict[str, Any] = {name: arrays[name] for name in _OWN_TYPES}
        return dataclasses.replace(
            state,
            **own,
            store=state.store.of_arrays(arrays),
            antennas=Antennas.of_arrays(arrays),
        )

    def _learn(self, state: PreciseSatellitesState, part: Block) -> Columns | None:
        """Keep what came besides observations; events of what is wrong with it."""
        store = state.store
        for channel, learn in (
            (Port(channels.PRECISE_ORBIT), store.learn_orbits),
            (Port(channels.PRECISE_CLOCK), store.learn_clocks),
            (Port(channels.SIGNAL_BIAS), store.learn_biases),
            (Port(channels.EARTH_ROTATION), store.learn_rotation),
            (Port(channels.IONOSPHERE_MAP), store.learn_maps),
            (Port(channels.OCEAN_LOADING, self.role), store.learn_loading),
            (Port(channels.PRODUCTS), store.learn_details),
            (Port(channels.ANTENNAS), store.learn_antennas),
            (Port(channels.ANTENNAS), state.antennas.learn),
            (Port(channels.RECEIVER, self.role), state.antennas.wear),
        ):
            rows = part.get(channel.name)
            if rows is not None:
                learn(rows)
        nav = part.get(channels.NAV.name)
        if nav is not None:
            state.messages = np.concatenate([state.messages, ephemeris_records(nav)])
            state.available = np.concatenate([state.available, nav.log_time_ns])
        models = part.get(channels.NAV_IONOSPHERE.name)
        if models is not None:
            state.models = np.concatenate([state.models, ionosphere_records(models)])
        files = part.get(channels.PRODUCTS.name)
        if files is None:
            return None
        known = state.frames.tobytes().decode().splitlines()
        events = frame_events(known, files)
        state.frames = np.frombuffer("\n".join(known).encode(), dtype=np.uint8)
        return events


_OWN_TYPES: Final[dict[str, np.dtype[Any]]] = {
    "kernel": sights.SIGHTS_STATE_DTYPE,
    "precise": records.PRECISE_SIGHTS_STATE_DTYPE,
    "models": sights.IONOSPHERE_DTYPE,
    "messages": EPHEMERIS_DTYPE,
    "available": np.dtype(np.int64),
    "frames": np.dtype(np.uint8),
}


def _by_arrival(block: Block, role: str) -> Iterator[dict[str, Columns]]:
    """A block in parts: products that come at one log time, and epochs up to the next ones.

    Epochs before a product must not know it, wherever the log is cut into blocks. Messages and
    what the receiver says of its antenna are used from their log times on by the loops.
    """
    alone = {channels.NAV.name, channels.NAV_IONOSPHERE.name, Port(channels.RECEIVER, role).name}
    observations = Port(channels.GNSS_OBS, role).name
    first = {name: rows for name, rows in block.items() if name in alone}
    others = {name: rows for name, rows in block.items() if name not in alone}
    times = [rows.log_time_ns for name, rows in others.items() if name != observations]
    arrivals = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *times]))
    edges = [-1, *arrivals.tolist(), np.iinfo(np.int64).max]
    for start, end in itertools.pairwise(edges):
        part = dict(first)
        first = {}
        for name, rows in others.items():
            low = int(np.searchsorted(rows.log_time_ns, start, side="left"))
            high = int(np.searchsorted(rows.log_time_ns, end, side="left"))
            if high > low:
                part[name] = rows if high - low == len(rows) else rows.take(slice(low, high))
        if part:
            yield part


def _solve(
    state: PreciseSatellitesState, observations: Columns
) -> dict[channels.ChannelSpec, Columns]:
    """Rows of all outputs for some observations."""
    found = gather_epochs(observations, state.selection)
    broadcast = records.Broadcast(*by_satellite(state.messages, state.available))
    terms = np.full(len(found.rows), np.nan, dtype=records.TERMS_DTYPE)
    room = _NOTES_PER_SATELLITE * SATELLITES + _NOTES_PER_EPOCH * len(found.epochs)
    notes = np.zeros(room + len(found.rows), dtype=sights.NOTE_DTYPE)
    counts = np.zeros(2, dtype=np.int64)
    taken = precise_sights.run_precise_sights(
        state.kernel, state.precise, state.config, state.settings, state.models,
        state.store.known(), broadcast, found.epochs, found.rows, terms,
        np.zeros(1, dtype=SOLVE_DTYPE), notes, counts,
    )  # fmt: skip
    state.models = state.models[taken:]
    further = {"antenna_m": _antenna_m(state, found)}
    further |= {name: np.ascontiguousarray(terms[field]) for name, field in _TERMS.items()}
    return {
        channels.SATELLITES: sight_columns(found),
        channels.CORRECTIONS: correction_columns(found, further),
        channels.COARSE: coarse_columns(found.epochs),
        channels.GNSS_EVENTS: precise_event_columns(notes[: counts[0]]),
    }


def _antenna_m(state: PreciseSatellitesState, found: Epochs) -> Array:
    """What the receiver's antenna adds to each signal, `(rows, SLOTS)`, m; NaN is absent."""
    added = np.full((len(found.rows), SLOTS), np.nan)
    antennas = state.antennas
    if state.calibrated and antennas.known:
        antenna_pattern.model_antenna(
            found.epochs, found.rows, antennas.worn, antennas.patterns, antennas.values,
            state.level, added,
        )  # fmt: skip
    return added


def _check_channels(config: PreciseConfig, context: Context) -> None:
    """Refuse settings that the log has nothing for."""
    wanted = []
    if config.products.source == "precise":
        wanted.append((channels.PRECISE_ORBIT, "--set products.source=broadcast"))
    else:
        wanted.append((channels.NAV, "--set products.source=precise"))
    if config.atmosphere.ionosphere == "map":
        wanted.append((channels.IONOSPHERE_MAP, "--set atmosphere.ionosphere=none"))
    for channel, instead in wanted:
        if context.topics and channel.name not in context.topics:
            raise MissingChannelError(
                f"precise-satellites needs a channel {channel.topic} ({channel.about})",
                where="the log has none",
                mend=f"import the log with such products, or {instead}",
            )


def _sights_record(config: PreciseConfig) -> Array:
    """Settings that are those of the stage `satellites`; maps are apart."""
    if config.atmosphere.ionosphere != "map":
        return config_record(config)
    without = msgspec.structs.replace(config.atmosphere, ionosphere="none")
    return config_record(msgspec.structs.replace(config, atmosphere=without))


def _settings_record(config: PreciseConfig) -> Array:
    own, terms = config.products, config.terms
    record = np.zeros(1, dtype=records.PRECISE_SIGHTS_CONFIG_DTYPE)
    record["broadcast"] = int(own.source == "broadcast")
    record["biases"] = int(own.biases)
    record["nominal"] = int(own.attitude == "nominal")
    record["range_std"] = own.range_std * math.sqrt(0.5)  # each has half of the variance
    for name in terms.__struct_fields__:
        record[name] = int(getattr(terms, name))
    record["maps"] = int(config.atmosphere.ionosphere == "map")
    record["layer"] = _LAYERS[config.atmosphere.map_layer]
    return record
