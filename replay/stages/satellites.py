"""Orbits, clocks and corrections of what a receiver tracks: observations and messages in.

Outputs are channels of their own, so that every later stage can be run again from
them, and every term can be looked at. The arithmetic is in :mod:`replay.kernels.sights`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.errors import ConfigurationError
from replay.gnss.antennas import ANTENNA_TYPES, Antennas
from replay.gnss.ephemerides import ephemeris_records
from replay.gnss.measurements import (
    Epochs,
    Selection,
    gather_epochs,
    select_signals,
)
from replay.kernels import antenna_pattern, sights
from replay.kernels.earth import enu_axes
from replay.kernels.ephemeris import EPHEMERIS_DTYPE
from replay.kernels.gnss_records import COUNT, FIRST, SATELLITES, SLOTS, SYSTEM_LETTERS
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.log.columns import Columns
from replay.schemas import navigation_pb2
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
from replay.stages.gnss_columns import EVENT_TEXT, event_columns
from replay.stages.gnss_config import GnssConfig
from replay.stages.sight_columns import coarse_columns, correction_columns, sight_columns

Array = np.ndarray[Any, Any]

_IONOSPHERES: Final = ("none", "klobuchar", "system")
_TROPOSPHERES: Final = ("none", "niell", "cosecant", "gmf")
_METEOROLOGIES: Final = ("standard", "mops", "gpt")
_MODELS: Final = {
    ("G", int(navigation_pb2.IONOSPHERE_MODEL_KLOBUCHAR)): 0,
    ("C", int(navigation_pb2.IONOSPHERE_MODEL_BEIDOU)): 1,
}
_NOTES_PER_EPOCH: Final = 8


@dataclasses.dataclass(slots=True)
class SatellitesState:
    """Everything that crosses from one block to the next."""

    selection: Selection
    config: Array
    kernel: Array
    scratch: Array
    models: Array
    messages: Array
    available: Array
    calibrated: bool
    level: bool
    antennas: Antennas


class Satellites:
    """The stage `satellites`, for the rover, the base or a station of a network.

    Parameters
    ----------
    role : str
        RECEIVER computes its own coarse position; the others stand at a known one.

    Notes
    -----
    Where the log has calibrations of the receiver's antenna, what it adds to code and phase
    is one of the corrections. Antennas of stations that stand still are mounted with their
    mark to the north, so that offset and pattern are used whole. Where the mark of the
    rover's antenna points is not known: of its offset only the height is used, and the mean
    of its pattern over azimuths.
    """

    def __init__(self, role: str = RECEIVER) -> None:
        self.role = role
        observations = Port(channels.GNSS_OBS, role)
        self.spec = StageSpec(
            name="satellites" if role == RECEIVER else f"{role}-satellites",
            version=1,
            inputs=(
                observations,
                Port(channels.NAV),
                Port(channels.NAV_IONOSPHERE, optional=True),
                Port(channels.RECEIVER, role, optional=True),
                Port(channels.ANTENNAS, optional=True),
            ),
            outputs=(
                Port(channels.SATELLITES, role),
                Port(channels.CORRECTIONS, role),
                Port(channels.COARSE, role),
                Port(channels.GNSS_EVENTS, role),
            ),
            trigger=observations,
        )

    def start(self, config: Section, context: Context) -> SatellitesState:
        """State before the first row."""
        if not isinstance(config, GnssConfig):
            raise TypeError("satellites takes a GnssConfig")
        record = config_record(config)
        if self.role != RECEIVER:
            record["fixed"] = 1
            record["position"] = station_position(config, context, self.role)
        return SatellitesState(
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            config=record,
            kernel=sights.new_sights_state(*klobuchar(config)),
            scratch=np.zeros(1, dtype=SOLVE_DTYPE),
            models=np.zeros(0, dtype=sights.IONOSPHERE_DTYPE),
            messages=np.zeros(0, dtype=EPHEMERIS_DTYPE),
            available=np.zeros(0, dtype=np.int64),
            calibrated=config.antenna.calibrated,
            level=self.role == RECEIVER,
            antennas=Antennas(),
        )

    def step(self, state: SatellitesState, block: Block) -> tuple[SatellitesState, Outputs]:
        """Take a block of observations and messages."""
        self._learn(state, block)
        observations = block.get(Port(channels.GNSS_OBS, self.role).name)
        if observations is None:
            return state, {}
        found = gather_epochs(observations, state.selection)
        messages, available, starts = by_satellite(state.messages, state.available)
        notes = np.zeros(SATELLITES + _NOTES_PER_EPOCH * len(found.epochs), dtype=sights.NOTE_DTYPE)
        counts = np.zeros(2, dtype=np.int64)
        taken = sights.run_sights(
            state.kernel, state.config, state.models, messages, available, starts,
            found.epochs, found.rows, state.scratch, notes, counts,
        )  # fmt: skip
        state.models = state.models[taken:]
        outputs: Outputs = {}
        columns = {
            channels.SATELLITES: sight_columns(found),
            channels.CORRECTIONS: correction_columns(
                found, {"antenna_m": _antenna_m(state, found)}
            ),
            channels.COARSE: coarse_columns(found.epochs),
            channels.GNSS_EVENTS: event_columns(notes[: counts[0]], EVENT_TEXT),
        }
        for channel, rows in columns.items():
            if len(rows):
                outputs[Port(channel, self.role).name] = rows
        return state, outputs

    def finish(self, state: SatellitesState) -> Outputs:
        """Nothing is left to say."""
        return {}

    def dump(self, state: SatellitesState) -> bytes:
        """The state as bytes."""
        return dump_arrays(
            {
                "kernel": state.kernel,
                "models": state.models,
                "messages": state.messages,
                "available": state.available,
                **state.antennas.arrays(),
            }
        )

    def restore(self, state: SatellitesState, data: bytes) -> SatellitesState:
        """The state of a dump."""
        arrays = restore_arrays(
            data,
            {
                "kernel": sights.SIGHTS_STATE_DTYPE,
                "models": sights.IONOSPHERE_DTYPE,
                "messages": EPHEMERIS_DTYPE,
                "available": np.dtype(np.int64),
                **ANTENNA_TYPES,
            },
        )
        return dataclasses.replace(
            state,
            kernel=arrays["kernel"],
            models=arrays["models"],
            messages=arrays["messages"],
            available=arrays["available"],
            antennas=Antennas.of_arrays(arrays),
        )

    def _learn(self, state: SatellitesState, block: Block) -> None:
        """Keep the messages of a block; each is used from its log time on."""
        nav = block.get(channels.NAV.name)
        if nav is not None:
            state.messages = np.concatenate([state.messages, ephemeris_records(nav)])
            state.available = np.concatenate([state.available, nav.log_time_ns])
        models = block.get(channels.NAV_IONOSPHERE.name)
        if models is not None:
            state.models = np.concatenate([state.models, ionosphere_records(models)])
        calibrations = block.get(channels.ANTENNAS.name)
        if calibrations is not None:
            state.antennas.learn(calibrations)
        info = block.get(Port(channels.RECEIVER, self.role).name)
        if info is not None:
            state.antennas.wear(info)


def _antenna_m(state: SatellitesState, found: Epochs) -> Array:
    """What the antenna adds to each signal, `(rows, SLOTS)`, m; NaN where not modelled."""
    added = np.full((len(found.rows), SLOTS), np.nan)
    antennas = state.antennas
    if state.calibrated and antennas.known:
        antenna_pattern.model_antenna(
            found.epochs, found.rows, antennas.worn, antennas.patterns, antennas.values,
            state.level, added,
        )  # fmt: skip
    return added


def ionosphere_records(models: Columns) -> Array:
    """Klobuchar's and BeiDou's coefficients; a set that is not eight numbers is left out."""
    coefficients = models.ragged("coefficients")
    systems = models.ragged("system").texts()
    rows = []
    for k in range(len(models)):
        values = coefficients.row(k).astype(np.float64)
        place = _MODELS.get((systems[k], int(models["model"][k])))
        if place is not None and len(values) == 8 and np.isfinite(values).all():
            rows.append((int(models.log_time_ns[k]), place, values[:4], values[4:]))
    return np.array(rows, dtype=sights.IONOSPHERE_DTYPE)


def station_position(config: GnssConfig, context: Context, role: str) -> tuple[float, ...]:
    """ECEF position (m) of the antenna of a receiver that stands still.

    For the base that of the configuration, else what the receiver's header says: the marker's
    position and the antenna's offset from it.

    Raises
    ------
    ConfigurationError
        Where neither the configuration nor the log has one.
    """
    given = config.antenna.base_position if role == BASE else ()
    if given:
        if len(given) != 3:
            raise ConfigurationError(
                f"antenna.base_position has {len(given)} numbers", mend="give x, y, z in ECEF"
            )
        return given
    port = Port(channels.RECEIVER, role)
    info = context.heads.get(port.name)
    if info is not None and len(info) and info.is_present("approximate_position_ecef_m")[0]:
        x, y, z = info["approximate_position_ecef_m"][0].tolist()
        if info.is_present("antenna_offset_enu_m")[0]:
            offset = info["antenna_offset_enu_m"][0].tolist()
            axes = np.zeros((3, 3))
            enu_axes(x, y, z, axes)
            x, y, z = (
                value + sum(axes[k, place] * offset[k] for k in range(3))
                for place, value in enumerate((x, y, z))
            )
        return x, y, z
    mend = "" if role != BASE else "--set antenna.base_position=[X, Y, Z], ECEF in m"
    raise ConfigurationError(
        f"the position of the {role} is not known",
        where=f"{context.topics.get(port.name, 'no channel ' + port.channel.topic)}",
        mend=mend or "leave the station out, or give its log a position",
    )


def klobuchar(config: GnssConfig) -> tuple[Array, Array]:
    """Coefficients for a log that brings none."""
    for name in ("alpha", "beta"):
        if len(getattr(config.atmosphere, name)) != 4:
            raise ConfigurationError(f"atmosphere.{name} has four numbers")
    return np.array(config.atmosphere.alpha), np.array(config.atmosphere.beta)


def config_record(config: GnssConfig) -> Array:
    """Settings as the record that the compiled loop reads."""
    orbits, atmosphere = config.orbits, config.atmosphere
    record = np.zeros(1, dtype=sights.SIGHTS_CONFIG_DTYPE)
    if len(orbits.max_age) not in (1, len(SYSTEM_LETTERS)):
        raise ConfigurationError(
            f"orbits.max_age has one number or {len(SYSTEM_LETTERS)}, not {len(orbits.max_age)}"
        )
    if atmosphere.ionosphere not in _IONOSPHERES:
        raise ConfigurationError(
            "maps of the ionosphere are used by pipelines with precise products alone",
            where="atmosphere.ionosphere",
            mend='take "klobuchar" or "system" here, or run a precise pipeline such as ppp',
        )
    record["max_age"] = orbits.max_age
    record["latest"] = int(orbits.choice == "latest")
    record["fnav"] = int(orbits.galileo == "fnav")
    record["unhealthy"] = int(orbits.unhealthy)
    record["ionosphere"] = _IONOSPHERES.index(atmosphere.ionosphere)
    record["troposphere"] = _TROPOSPHERES.index(atmosphere.troposphere)
    record["meteorology"] = _METEOROLOGIES.index(atmosphere.meteorology)
    record["humidity"] = atmosphere.humidity
    record["shapiro"] = int(atmosphere.shapiro)
    record["coast"] = config.antenna.coast
    return record


def by_satellite(messages: Array, available: Array) -> tuple[Array, Array, Array]:
    """Messages grouped by satellite, those of one in the order of their arrival."""
    system = np.full(128, -1, dtype=np.int64)
    for place, letter in enumerate(SYSTEM_LETTERS):
        system[ord(letter)] = place
    place = system[messages["system"]]
    known = (place >= 0) & (messages["prn"] >= 1) & (messages["prn"] <= np.array(COUNT)[place])
    number = np.where(known, np.array(FIRST)[place] + messages["prn"] - 1, SATELLITES)
    order = np.argsort(number, kind="stable")
    starts = np.searchsorted(number[order], np.arange(SATELLITES + 1)).astype(np.int64)
    return messages[order], available[order], starts
