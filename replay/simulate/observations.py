"""Observations of simulated receivers: what each saw, measured and lost, as rows of the log."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay import channels, time
from replay.errors import ConfigurationError
from replay.gnss.ephemerides import ephemeris_records
from replay.gnss.signals import frequency_hz
from replay.kernels import elementary, tracking
from replay.kernels.atmosphere import KLOBUCHAR_REFERENCE_HZ
from replay.kernels.noise import gauss_markov
from replay.kernels.observables import SIGHT_DTYPE, see
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.tracking import MEASUREMENT_DTYPE, SIGNAL_DTYPE
from replay.kernels.true_orbit import broadcast_errors
from replay.log.columns import Columns, Ragged, concatenate
from replay.simulate.air import ionosphere_message
from replay.simulate.antennas import calibration_columns
from replay.simulate.biases import carrier_bias_cycles, code_bias_s
from replay.simulate.blockage import Surroundings, surroundings
from replay.simulate.constellation import name_of, sends
from replay.simulate.navigation import preferred
from replay.simulate.noise import Floats, normals, uniforms
from replay.simulate.phase_centres import PhaseCentres, worn_antennas
from replay.simulate.physical import WindUp, tide_ranges
from replay.simulate.products import product_channels
from replay.simulate.signal_truth import signal_truth
from replay.simulate.sky import Receiver, Setup
from replay.simulate.truth import Epochs, Scene, TrueSky, make_epochs, make_sky, wander

SIMULATED: Final = "replay.simulated"

Records = npt.NDArray[np.void]
Ints = npt.NDArray[np.int64]

_MILLISECOND: Final = 1e-3
_HOUR_S: Final = 3600.0
_TIDES: Final = ("solid_tide_m", "pole_tide_m")


def observe(setup: Setup, scene: Scene) -> tuple[dict[str, Columns], dict[str, str]]:
    """Channels of navigation data, products, antennas, receivers, and what was done to them.

    Returns
    -------
    rows : dict of topic to Columns
    metadata : dict of str to str
        JSON texts: `slips` and `arcs`, the whole cycles in each stretch of carrier phase.
    """
    sky = make_sky(setup, scene)
    rows = {
        channels.NAV.topic: sky.messages,
        channels.NAV_IONOSPHERE.topic: ionosphere_message(
            setup.sky.ionosphere, setup.sky.systems, scene.start_ns
        ),
    }
    told = [antenna for antenna in worn_antennas(setup) if antenna.calibrated]
    if told:
        rows[channels.ANTENNAS.topic] = calibration_columns(told, scene.start_ns)
    rows.update(product_channels(setup, scene, sky))
    slips: list[dict[str, Any]] = []
    arcs: list[list[Any]] = []
    for receiver in setup.receivers:
        epochs = make_epochs(receiver, scene, setup.sky)
        around = [s for s in setup.blockages if _concerns(s.receivers, receiver)]
        part = _Part(setup, scene, sky, receiver, epochs, around)
        measured = part.measure()
        at = {"receiver": receiver.name}
        rows[channels.RECEIVER.at(**at)] = _information(receiver, epochs, scene)
        rows[channels.RECEIVER_EPOCH.at(**at)] = part.epoch_rows(measured)
        rows[channels.GNSS_OBS.at(**at)] = measured
        if part.terms is not None:
            rows[channels.SIGNAL_TRUTH.at(**at)] = part.terms
        slips += part.slips
        arcs += part.arcs
        _check_slips(setup, receiver, epochs, part.slips, scene.start_ns)
    return rows, {"slips": json.dumps(slips), "arcs": json.dumps(arcs, separators=(",", ":"))}


def _check_slips(
    setup: Setup, receiver: Receiver, epochs: Epochs, made: list[dict[str, Any]], start_ns: int
) -> None:
    """Refuse a listed slip that found no carrier phase to break."""
    for slip in setup.slips:
        if slip.receiver != receiver.name:
            continue
        row = np.searchsorted(epochs.elapsed_ns, round(slip.time * time.NS_PER_S))
        at = epochs.elapsed_ns[row] + start_ns if row < len(epochs.elapsed_ns) else -1
        if not any(
            one["satellite"] == slip.satellite
            and one["time_ns"] == at
            and slip.signal in ("", one["signal"])
            for one in made
        ):
            raise ConfigurationError(
                f"no carrier phase of {slip.satellite} {slip.signal} goes on at {slip.time:g} s",
                where=f"slips of {receiver.name}",
                mend="choose a satellite that is tracked then",
            )


def _concerns(names: tuple[str, ...], receiver: Receiver) -> bool:
    return receiver.name in names or (not names and receiver.kind == "vehicle")


class _Part:
    """One receiver's share."""

    def __init__(
        self, setup: Setup, scene: Scene, sky: TrueSky, receiver: Receiver, epochs: Epochs,
        around: list[Any],
    ) -> None:  # fmt: skip
        self.setup, self.scene, self.sky = setup, scene, sky
        self.receiver, self.epochs = receiver, epochs
        self.around = around
        self.centres = PhaseCentres(receiver, setup, scene, epochs)
        self.wind_up = WindUp(receiver, setup, scene, sky, epochs)
        self.slips: list[dict[str, Any]] = []
        self.arcs: list[list[Any]] = []
        self.terms: Columns | None = None  # filled by `measure` where they are asked for
        spans = np.zeros(len(epochs.elapsed_ns), dtype=np.bool_)
        for begin_s, end_s in receiver.gaps:
            spans |= (epochs.elapsed_ns >= round(begin_s * time.NS_PER_S)) & (
                epochs.elapsed_ns < round(end_s * time.NS_PER_S)
            )
        self.awake = ~spans
        self.biases = {
            signal: receiver.noise.code_bias
            * float(normals(scene.seed, f"{receiver.name}.{signal}.bias", 1, 1)[0, 0])
            for signal in receiver.signals
        }
        self.carrier_biases = {
            signal: receiver.noise.carrier_bias
            * float(normals(scene.seed, f"{receiver.name}.{signal}.carrier_bias", 1, 1)[0, 0])
            for signal in receiver.signals
        }

    def measure(self) -> Columns:
        """Rows of all satellites and signals, sorted by time, satellite, signal."""
        sights = self._sights()
        around = surroundings(
            self.around, self.receiver.name, self.scene.seed, self.epochs.elapsed_ns,
            self.epochs.headings, sights,
        )  # fmt: skip
        parts, order, terms = [], [], []
        for index, name in enumerate(sorted(sights)):
            number = next(n for n, r in enumerate(self.sky.broadcast) if name_of(r) == name)
            off = self._orbit_errors(name, sights[name]) if self.scene.signals else None
            turned = self.wind_up.of(number, sights[name])
            tides = tide_ranges(self.epochs, sights[name]) if self.scene.signals else ()
            for signal in sorted(self.receiver.signals):
                if signal[0] == name[0] and sends(self.sky.broadcast[number], signal[1:]):
                    settings = self._settings(number, signal)
                    channel = int(self.sky.broadcast[number]["frequency_channel"])
                    antenna = self.centres.of(signal, channel, sights[name])
                    wavelength = float(settings["wavelength_m"][0])
                    bias_m = wavelength * self._carrier_bias(number, signal)
                    alone = wavelength * turned
                    alone[:, 0] += bias_m
                    table = self._signal(
                        name, signal, settings, sights[name], around[name], antenna, alone
                    )
                    rows = np.flatnonzero(table["code"])
                    parts.append(self._columns(number, signal[1:], table, rows))
                    order.append(rows * len(sights) + index)
                    if off is not None:
                        kept = sights[name][rows], table[rows]
                        extra = {
                            field: tide[rows] for field, tide in zip(_TIDES, tides, strict=False)
                        }
                        if self.wind_up.there:
                            extra["wind_up_m"] = wavelength * turned[rows, 0]
                        if self.setup.sky.biases.carrier or self.receiver.noise.carrier_bias:
                            extra["carrier_delay_m"] = np.full(len(rows), bias_m)
                        terms.append(
                            signal_truth(
                                (name, signal[1:]), self._times(rows), kept,
                                self.epochs.clock[rows, 0], off[rows], settings[0],
                                antenna[rows, 0] if self.centres.there else None, extra,
                            )
                        )  # fmt: skip
        if not parts:
            raise ConfigurationError(
                "no satellite sends any of its signals", where=self.receiver.name,
                mend="see sky.systems, signals and mask",
            )  # fmt: skip
        # Parts come by satellite and signal: a stable sort by epoch and satellite keeps both.
        rows = np.argsort(np.concatenate(order), kind="stable")
        if terms:
            self.terms = _renumbered(concatenate(terms).take(rows))
        return _renumbered(concatenate(parts).take(rows))

    def _times(self, rows: Ints) -> tuple[Ints, Ints]:
        """Valid and log times of epochs, ns."""
        valid = self.scene.start_ns + self.epochs.elapsed_ns[rows]
        return valid, valid + round(self.receiver.latency * time.NS_PER_S)

    def _orbit_errors(self, name: str, sights: Records) -> Floats:
        """True less broadcast range and clock of a satellite at every epoch, m."""
        own = self.sky.messages.take(self.sky.messages["satellite"] == name.encode())
        known = ephemeris_records(own)
        kept = preferred(known)
        logged = own.log_time_ns[np.isin(known["source"], kept["source"])]
        valid, log = self._times(np.arange(len(sights)))
        out = np.empty(len(sights))
        broadcast_errors(
            kept, logged, valid, log, -self.epochs.clock[:, 0], self.epochs.positions, sights, out
        )
        return out

    def _sights(self) -> dict[str, Records]:
        """True sights of the satellites that are above the mask at some epoch."""
        scene, epochs, sky = self.scene, self.epochs, self.sky
        tropo = self.setup.sky.troposphere
        span_s = scene.end_ns / time.NS_PER_S
        source = f"{self.receiver.name}.troposphere"
        own = wander(scene.seed, source, tropo.tau, span_s, 1)[0]
        wet = sky.common_wet + tropo.local_wet * own
        times = scene.start_ns + epochs.elapsed_ns
        offsets = -epochs.clock[:, 0]
        sine = float(elementary.sin(self.receiver.mask))
        systems = {signal[0] for signal in self.receiver.signals}
        found = {}
        for index, record in enumerate(sky.broadcast):
            name = name_of(record)
            if name[0] not in systems:
                continue
            sights = np.zeros(len(times), dtype=SIGHT_DTYPE)
            see(
                sky.satellites[index], sky.atmosphere, sky.residuals[index], wet,
                sky.limits_s[index], times, offsets, scene.start_ns, epochs.positions,
                epochs.velocities, self.receiver.mask, sine, sights,
            )  # fmt: skip
            if sights["seen"].any():
                found[name] = sights
        return found

    def _signal(
        self, name: str, signal: str, settings: Records, sights: Records, around: Surroundings,
        antenna: Floats, alone: Floats,
    ) -> Records:  # fmt: skip
        """Measurements of one signal of one satellite at every epoch."""
        receiver, scene, count = self.receiver, self.scene, len(sights)
        source = f"{receiver.name}.{name}.{signal[1:]}"
        noise = normals(scene.seed, source, count, 6)
        self._correlate(noise)
        draws = uniforms(scene.seed, f"{source}.slips", 4 * count).reshape(count, 4)
        listed = np.zeros(count, dtype=np.int64)
        for slip in self.setup.slips:
            if (slip.receiver, slip.satellite) == (receiver.name, name) and (
                slip.signal in ("", signal[1:])
            ):
                at = np.searchsorted(self.epochs.elapsed_ns, round(slip.time * time.NS_PER_S))
                if at < count:
                    listed[at] += slip.cycles
        states = np.where(self.awake, around.states, tracking.BLOCKED)
        out = np.zeros(count, dtype=MEASUREMENT_DTYPE)
        tracking.track(
            sights, states, around.losses, self.epochs.clock, antenna, alone, settings, noise,
            draws, listed, self.epochs.interval_s, out,
        )  # fmt: skip
        self._remember(name, signal[1:], out)
        return out

    def _correlate(self, noise: Floats) -> None:
        """Turn the columns of multipath into correlated ones."""
        settings = self.receiver.multipath
        columns = noise[:, tracking.CODE_MULTIPATH : tracking.CARRIER_MULTIPATH + 1]
        interval = self.epochs.interval_s
        if settings.filter == "butterworth":
            pole = butterworth_pole(settings.cutoff, interval)
            gain = math.sqrt(0.5 * (1.0 - pole))
            for column in range(columns.shape[1]):
                tracking.low_pass(pole, gain, columns[:, column])
            return
        decay = float(elementary.exp(-interval / settings.tau))
        drive = math.sqrt(-float(elementary.expm1(-2.0 * interval / settings.tau)))
        gauss_markov(1.0, decay, drive, columns)

    def _carrier_bias(self, number: int, signal: str) -> float:
        """Of satellite and receiver together, cycles."""
        given, record = self.setup.sky.biases, self.sky.broadcast[number]
        own = carrier_bias_cycles(record, signal, given, self.scene.seed)
        return own + self.carrier_biases[signal]

    def _settings(self, number: int, signal: str) -> Records:
        """Numbers of one signal for the kernel."""
        r, record = self.receiver, self.sky.broadcast[number]
        band = int(signal[1])
        frequency = frequency_hz(signal[0], band, int(record["frequency_channel"]))
        ratio = KLOBUCHAR_REFERENCE_HZ / frequency
        told = code_bias_s(record, signal, self.setup.sky.biases, self.scene.seed)
        one = np.zeros(1, dtype=SIGNAL_DTYPE)
        values = {
            "wavelength_m": SPEED_OF_LIGHT_M_S / frequency,
            "ionosphere": ratio * ratio,
            "code_delay_m": SPEED_OF_LIGHT_M_S * told + self.biases[signal],
            "zenith_dbhz": r.strength.zenith,
            "drop_db": r.strength.drop,
            "cn0_sigma_db": r.strength.sigma,
            "code_threshold_dbhz": r.strength.code_threshold,
            "carrier_threshold_dbhz": r.strength.carrier_threshold,
            "code_sigma_m": r.noise.code,
            "carrier_sigma_m": r.noise.carrier,
            "rate_sigma_m_s": r.noise.rate,
            "code_multipath_m": r.multipath.code,
            "carrier_multipath_m": r.multipath.carrier,
            "weighted": r.noise.weighted,
            "reflection_m": r.multipath.detour,
            "reflection_db": r.multipath.detour_loss_db,
            "acquisition": round(r.tracking.acquisition / self.epochs.interval_s),
            "slip_probability": r.tracking.slips_per_hour * self.epochs.interval_s / _HOUR_S,
            "largest_slip": r.tracking.largest_slip,
            "flag_probability": r.tracking.flagged,
        }
        for name, value in values.items():
            one[name] = value
        return one

    def _remember(self, satellite: str, signal: str, table: Records) -> None:
        """Slips, and arcs as (receiver, satellite, signal, first, last ns, cycles at first)."""
        times = self.scene.start_ns + self.epochs.elapsed_ns
        carrier = table["carrier"] != 0
        slipped = np.flatnonzero(table["slip"])
        for row in slipped.tolist():
            self.slips.append(
                {
                    "receiver": self.receiver.name,
                    "satellite": satellite,
                    "signal": signal,
                    "time_ns": int(times[row]),
                    "cycles": int(table["slip"][row]),
                    "flagged": bool(table["flag"][row]),
                }
            )
        begin = np.flatnonzero(carrier & (table["lock_s"] == 0.0))
        until = np.append(begin, len(table))[1:]
        held = np.flatnonzero(carrier)
        for first, after in zip(begin.tolist(), until.tolist(), strict=True):
            last = held[np.searchsorted(held, after) - 1]
            self.arcs.append(
                [self.receiver.name, satellite, signal, int(times[first]), int(times[last]),
                 int(table["ambiguity"][first])]
            )  # fmt: skip

    def _columns(self, number: int, signal: str, table: Records, rows: Ints) -> Columns:
        """Rows of one signal."""
        kept, record = table[rows], self.sky.broadcast[number]
        carrier = kept["carrier"] != 0
        valid, log = self._times(rows)
        values = {
            "satellite": np.full(len(rows), name_of(record), dtype="S3"),
            "signal": np.full(len(rows), signal, dtype="S2"),
            "pseudorange_m": kept["pseudorange_m"].copy(),
            "carrier_phase_cycles": np.where(carrier, kept["carrier_cycles"], np.nan),
            "doppler_hz": np.where(carrier, kept["doppler_hz"], np.nan),
            "cn0_dbhz": kept["cn0_dbhz"].copy(),
            "loss_of_lock": kept["flag"].astype(np.uint32),
            "lock_time_s": np.where(carrier, kept["lock_s"], np.nan),
        }
        present = {
            field: carrier
            for field in ("carrier_phase_cycles", "doppler_hz", "loss_of_lock", "lock_time_s")
        }
        if any(name[0] == "R" for name in self.receiver.signals):
            channel = int(record["frequency_channel"])
            values["glonass_channel"] = np.full(len(rows), channel, dtype=np.int32)
            present["glonass_channel"] = np.full(len(rows), name_of(record)[0] == "R")
        return Columns.build(valid, values, log_time_ns=log, present=present)

    def epoch_rows(self, measured: Columns) -> Columns:
        """One row per epoch that is not in a gap; satellites are counted once."""
        times = self.scene.start_ns + self.epochs.elapsed_ns[self.awake]
        satellites = np.asarray(measured["satellite"])
        first = np.ones(len(measured), dtype=np.bool_)
        first[1:] = (satellites[1:] != satellites[:-1]) | (
            measured.valid_time_ns[1:] != measured.valid_time_ns[:-1]
        )
        edges = np.searchsorted(measured.valid_time_ns[first], np.append(times, times[-1:] + 1))
        values: dict[str, npt.NDArray[Any]] = {
            "flag": np.zeros(len(times), dtype=np.uint32),
            "satellite_count": np.diff(edges).astype(np.uint32),
        }
        if self.receiver.clock.reported:
            values["clock_offset_s"] = self.epochs.clock[self.awake, 0].copy()
        latency = round(self.receiver.latency * time.NS_PER_S)
        return Columns.build(times, values, log_time_ns=times + latency)


def butterworth_pole(cutoff_hz: float, interval_s: float) -> float:
    """Pole of the bilinear transform of 1 / (1 + s / w), pre-warped to its cutoff."""
    warped = float(elementary.tan(math.pi * cutoff_hz * interval_s))
    return (1.0 - warped) / (1.0 + warped)


def _renumbered(columns: Columns) -> Columns:
    """The same rows, numbered from nought."""
    sequence = np.arange(len(columns), dtype=np.uint32)
    return dataclasses.replace(columns, sequence=sequence)


def _information(receiver: Receiver, epochs: Epochs, scene: Scene) -> Columns:
    """What is known of a receiver; of a vehicle's, the first place of its reference point."""
    return Columns.build(
        [scene.start_ns],
        {
            "marker": Ragged.from_texts([receiver.name]),
            "receiver": Ragged.from_texts(["simulated"]),
            "antenna": Ragged.from_texts([receiver.antenna]),
            "approximate_position_ecef_m": epochs.crust[:1].copy(),
            "antenna_offset_enu_m": np.zeros((1, 3)),
            "interval_s": np.array([epochs.interval_s]),
            "header": Ragged.from_blobs([b""]),
        },
    )
