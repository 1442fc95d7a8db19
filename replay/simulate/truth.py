"""The sky as it is, and where each receiver truly was when its clock said so."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay import time
from replay.errors import ConfigurationError
from replay.kernels import elementary
from replay.kernels.ephemeris import EPHEMERIS_DTYPE
from replay.kernels.noise import gauss_markov
from replay.kernels.observables import walk_clock
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.trajectory import antenna_fixes
from replay.log.columns import Columns
from replay.simulate import glonass
from replay.simulate.air import NODES_PER_TAU, air_record
from replay.simulate.constellation import constellation, messages, name_of, perturb, refer
from replay.simulate.ground import displace
from replay.simulate.navigation import LIMITS_S, read_sky
from replay.simulate.noise import Floats, normals
from replay.simulate.sky import Ephemerides, Receiver, Setup, Sky
from replay.simulate.trajectory import Trajectory, ecef_of

Records = npt.NDArray[np.void]
Ints = npt.NDArray[np.int64]

_MILLISECOND: Final = 1e-3
_PER_KM: Final = 1e3


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """When and along what observations are made.

    Attributes
    ----------
    trajectory : Trajectory
    origin : float64 array (3,), m, ECEF
        Start of the vehicle.
    start_ns, end_ns : int, ns
        Of the log, GPS, and how long it is.
    seed : int
    signals : bool
        Whether the terms of each measurement are written.
    """

    trajectory: Trajectory
    origin: Floats
    start_ns: int
    end_ns: int
    seed: int
    signals: bool = False


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class TrueSky:
    """Satellites as they are, and the atmosphere.

    Attributes
    ----------
    satellites : list of arrays (m,) of EPHEMERIS_DTYPE
        True orbit and clock of each, as :mod:`replay.kernels.true_orbit` takes them.
    limits_s : list of float, s
        How far from their reference times those hold.
    broadcast : array (n,) of EPHEMERIS_DTYPE
        A message of each.
    messages : Columns
        All that are broadcast, rows of `replay.BroadcastEphemeris`.
    atmosphere : array (1,) of ATMOSPHERE_DTYPE
    residuals : list of float64 arrays (3, m)
        Of each satellite, as :func:`replay.kernels.observables.delays` takes them.
    common_wet : float64 array (m,), m
        Zenith wet delay at nodes.
    """

    satellites: list[Records]
    limits_s: list[float]
    broadcast: Records
    messages: Columns
    atmosphere: Records
    residuals: list[Floats]
    common_wet: Floats


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Epochs:
    """Epochs of a receiver: its clock, and where its antenna truly was.

    Attributes
    ----------
    elapsed_ns : int64 array (e,)
        Reading of its clock since the start.
    clock : float64 array (e, 2)
        Bias (s) and drift (s/s).
    positions, velocities : float64 arrays (e, 3), m and m/s, ECEF
    crust : float64 array (e, 3), m, ECEF
        The same places on ground that no tide moves, which are those of the truth.
    tides : tuple of two float64 arrays (e, 3), m, ECEF, or None
        What solid Earth tide and pole tide add; None without tides.
    headings : float64 array (e,), rad
    interval_s : float, s
    """

    elapsed_ns: Ints
    clock: Floats
    positions: Floats
    velocities: Floats
    headings: Floats
    interval_s: float
    crust: Floats
    tides: tuple[Floats, Floats] | None = None


def make_sky(setup: Setup, scene: Scene) -> TrueSky:
    """Broadcast and true orbits, and nodes of what wanders."""
    sky, seed = setup.sky, scene.seed
    end_ns = scene.start_ns + scene.end_ns
    if sky.navigation:
        real = read_sky(setup.folder / sky.navigation, sky.systems, scene.start_ns, end_ns)
        orbits, sent = real.satellites, real.messages
        broadcast = np.concatenate([records[:1] for records in orbits])
        limits = [LIMITS_S[name_of(record)[0]] for record in broadcast]
    else:
        broadcast = constellation(sky.systems, seed, scene.start_ns)
        orbits = [_made_orbit(record, scene.start_ns, end_ns) for record in broadcast]
        sent = messages(broadcast, scene.start_ns, end_ns)
        limits = [math.inf] * len(orbits)
    true = [_off(records, sky.errors, seed, scene.start_ns) for records in orbits]
    iono, tropo = sky.ionosphere, sky.troposphere
    air = air_record(iono, tropo, sky.shapiro, scene.origin, seed)
    span_s = scene.end_ns / time.NS_PER_S
    residuals = []
    for record in broadcast:
        series = wander(seed, f"ionosphere.{name_of(record)}", iono.tau, span_s, 3)
        series[0] *= iono.residual
        series[1:] *= iono.gradient * _PER_KM
        residuals.append(series)
    wet = tropo.wet * wander(seed, "troposphere.wet", tropo.tau, span_s, 1)[0]
    return TrueSky(true, limits, broadcast, sent, air, residuals, wet)


def _made_orbit(record: Any, start_ns: int, end_ns: int) -> Records:
    """Records of a satellite of the built-in constellation over a span."""
    if name_of(record)[0] == "R":
        times = glonass.reference_times(record, start_ns, end_ns)
    else:
        # Near the log, so that differences of rates have not grown since the week's start.
        times = [start_ns // time.NS_PER_S * time.NS_PER_S]
    return np.array([refer(record, toe_ns) for toe_ns in times], dtype=EPHEMERIS_DTYPE)


def _off(records: Records, errors: Ephemerides, seed: int, start_ns: int) -> Records:
    """The same satellite where it truly is."""
    draw = normals(seed, f"ephemeris.{name_of(records[0])}", 1, 6)[0]
    since = (records["toc_ns"] - start_ns // time.NS_PER_S * time.NS_PER_S) / time.NS_PER_S
    drift = errors.clock / errors.clock_tau * draw[5]
    if name_of(records[0])[0] == "R":
        offset = errors.clock * draw[4] + drift * since
        true = glonass.perturb(records, errors.orbit, offset, draw[:4])
        true["af1"] += drift / SPEED_OF_LIGHT_M_S
        return true
    true = np.array(
        [perturb(one, errors.orbit, errors.clock, errors.clock_tau, draw) for one in records],
        dtype=EPHEMERIS_DTYPE,
    )
    true["af0"] += drift * since / SPEED_OF_LIGHT_M_S
    return true


def wander(seed: int, source: str, tau_s: float, span_s: float, count: int) -> Floats:
    """Gauss-Markov sequences (count, n) of unit variance at nodes, for cubics between them."""
    spacing = tau_s / NODES_PER_TAU
    rows = math.ceil(span_s / spacing) + 5  # one to spare at either end
    series = normals(seed, source, rows, count)
    decay = float(elementary.exp(-spacing / tau_s))
    drive = math.sqrt(-float(elementary.expm1(-2.0 * spacing / tau_s)))
    gauss_markov(1.0, decay, drive, series)
    return np.ascontiguousarray(series.T)


def make_epochs(receiver: Receiver, scene: Scene, sky: Sky) -> Epochs:
    """Epochs by the receiver's clock, and the antenna at their true times."""
    epochs = _still_ground(receiver, scene)
    if not sky.tides:
        return epochs
    times = scene.start_ns + epochs.elapsed_ns
    solid, polar, rates = displace(epochs.crust, times, scene.start_ns, sky.pole)
    return dataclasses.replace(
        epochs,
        positions=epochs.crust + solid + polar,
        velocities=epochs.velocities + rates,
        tides=(solid, polar),
    )


def _still_ground(receiver: Receiver, scene: Scene) -> Epochs:
    period_ns = round(time.NS_PER_S / receiver.rate)
    interval_s = period_ns / time.NS_PER_S
    elapsed = np.arange(1, scene.end_ns // period_ns + 1, dtype=np.int64) * period_ns
    clock = np.empty((len(elapsed), 2))
    settings = receiver.clock
    walk = normals(scene.seed, f"{receiver.name}.clock", len(elapsed), 1)[:, 0].copy()
    jump = _MILLISECOND if settings.jumps else 0.0
    walk_clock(settings.bias, settings.drift, settings.walk, interval_s, jump, walk, clock)
    if len(clock) and np.abs(clock[:, 0]).max() > interval_s:
        raise ConfigurationError(
            "the clock drifts away by more than an interval",
            where=receiver.name,
            mend="give it less drift, or jumps = true",
        )
    count = len(elapsed)
    if receiver.kind == "static":
        place = np.array(receiver.position) if receiver.position else ecef_of(
            receiver.latitude, receiver.longitude, receiver.height
        )  # fmt: skip
        still, places = np.zeros((count, 3)), np.tile(place, (count, 1))
        return Epochs(elapsed, clock, places, still, np.zeros(count), interval_s, places)
    true_s = elapsed / time.NS_PER_S - clock[:, 0] - receiver.delay
    poses = scene.trajectory.poses(np.maximum(true_s, 0.0))
    positions, velocities, none = np.empty((count, 3)), np.empty((count, 3)), np.zeros((count, 3))
    antenna_fixes(poses, np.array(receiver.lever_arm), none, none, positions, velocities)
    headings = np.ascontiguousarray(poses["attitude"][:, 2])
    return Epochs(elapsed, clock, positions, velocities, headings, interval_s, positions)
