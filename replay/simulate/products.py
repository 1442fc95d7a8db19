"""Precise products of a simulated sky: rows of orbits, clocks, biases and Earth rotation.

Clocks are those that messages are for, without the periodic relativity: every signal differs
from them by the bias that is written for it, of the code and, where a scenario wants it, of the
phase. All rows are known from the start of the log on.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay import channels, time
from replay.gnss.signals import frequency_hz
from replay.kernels import elementary
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.precise_orbits import relativity
from replay.kernels.true_orbit import states_at
from replay.log.columns import Columns, Ragged
from replay.schemas import products_pb2
from replay.simulate.biases import carrier_bias_cycles, code_bias_s
from replay.simulate.constellation import name_of, sends
from replay.simulate.ground import rotation_columns
from replay.simulate.noise import Floats, normals
from replay.simulate.product_settings import Products
from replay.simulate.sky import Setup
from replay.simulate.truth import Scene, TrueSky

Ints = npt.NDArray[np.int64]

_CLOCK_MARGIN_S: Final = 600.0
_TURN: Final = 2.0 * math.pi
# Periods of errors, s: half and a quarter of a day, and shorter; each has an equal share.
_ORBIT_PERIODS_S: Final = (43_200.0, 21_600.0, 14_400.0)
_CLOCK_PERIODS_S: Final = (21_600.0, 7_200.0, 2_400.0)


def product_channels(setup: Setup, scene: Scene, sky: TrueSky) -> dict[str, Columns]:
    """Channels of the products of a scenario, none where it has no `[products]`."""
    settings = setup.products
    if settings is None:
        return {}
    orbits = _epochs(scene, settings.orbit_interval, settings.margin)
    clocks = _epochs(scene, settings.clock_interval, min(settings.margin, _CLOCK_MARGIN_S))
    biases = _biases(setup, scene, sky, settings)
    rotation = rotation_columns(scene.start_ns, scene.start_ns + scene.end_ns, setup.sky.pole)
    rows = {
        channels.PRECISE_ORBIT.topic: _orbits(orbits, scene, sky, settings),
        channels.PRECISE_CLOCK.topic: _clocks(clocks, scene, sky, settings),
        channels.EARTH_ROTATION.topic: rotation,
    }
    if len(biases):
        rows[channels.SIGNAL_BIAS.topic] = biases
    rows[channels.PRODUCTS.topic] = _information(rows, scene, settings)
    return rows


def _epochs(scene: Scene, interval_s: float, margin_s: float) -> Ints:
    """Whole intervals of GPS time around the drive, ns."""
    step = round(interval_s * time.NS_PER_S)
    margin = round(margin_s * time.NS_PER_S)
    first = (scene.start_ns - margin) // step
    last = -(-(scene.start_ns + scene.end_ns + margin) // step)
    return np.arange(first, last + 1, dtype=np.int64) * step


def _true(times: Ints, sky: TrueSky, number: int) -> Floats:
    """States (n, 8) of a satellite; the clock without the periodic relativity."""
    states = np.empty((len(times), 8))
    states_at(sky.satellites[number], sky.limits_s[number], times, states)
    states[:, 6] -= [float(relativity(state)) for state in states]
    return states


def _wander(
    times: Ints, scene: Scene, source: str, sigma: float, periods_s: Iterable[float], count: int
) -> Floats:
    """Smooth errors (n, count) of a standard deviation: a few waves of random phase and size."""
    out = np.zeros((len(times), count))
    if sigma == 0.0:
        return out
    since = (times - scene.start_ns) / time.NS_PER_S
    periods = tuple(periods_s)
    draw = normals(scene.seed, source, len(periods), 2 * count)
    for row, period in enumerate(periods):
        for n, t in enumerate(since.tolist()):
            s, c = elementary.sincos(_TURN * (t / period - math.floor(t / period)))
            for i in range(count):
                out[n, i] += float(draw[row, 2 * i]) * c + float(draw[row, 2 * i + 1]) * s
    return out * (sigma / math.sqrt(len(periods)))


def _merged(times: Ints, parts: list[tuple[str, Floats]]) -> tuple[Ints, npt.NDArray[Any], Floats]:
    """Rows of all satellites in the order of time, then of satellites."""
    count = len(parts)
    names = np.tile(np.array([name for name, _ in parts], dtype="S3"), len(times))
    values = np.stack([value for _, value in parts], axis=1).reshape(len(times) * count, -1)
    return np.repeat(times, count), names, values


def _orbits(times: Ints, scene: Scene, sky: TrueSky, settings: Products) -> Columns:
    parts = []
    for number, record in enumerate(sky.broadcast):
        name = name_of(record)
        source, sigma = f"products.{name}.orbit", settings.orbit_error
        error = _wander(times, scene, source, sigma, _ORBIT_PERIODS_S, 3)
        parts.append((name, _true(times, sky, number)[:, :3] + error))
    valid, names, values = _merged(times, sorted(parts, key=lambda part: part[0]))
    no = np.zeros(len(valid), dtype=np.bool_)
    stated = settings.orbit_error > 0.0
    return Columns.build(
        valid,
        {
            "satellite": names,
            "position_ecef_m": np.ascontiguousarray(values),
            "position_std_ecef_m": np.full((len(valid), 3), settings.orbit_error),
            "orbit_predicted": no,
            "manoeuvre": no.copy(),
            "clock_predicted": no.copy(),
            "clock_event": no.copy(),
        },
        log_time_ns=np.full(len(valid), scene.start_ns),
        present={"position_std_ecef_m": np.full(len(valid), stated)},
    )


def _clocks(times: Ints, scene: Scene, sky: TrueSky, settings: Products) -> Columns:
    parts = []
    for number, record in enumerate(sky.broadcast):
        name = name_of(record)
        source = f"products.{name}.clock"
        off = _wander(times, scene, source, settings.clock_error, _CLOCK_PERIODS_S, 1)
        if settings.clock_noise > 0.0:
            white = normals(scene.seed, f"{source}.noise", len(times), 1)
            off += settings.clock_noise * white
        true = _true(times, sky, number)[:, 6:7]
        parts.append((name, true + off / SPEED_OF_LIGHT_M_S))
    valid, names, values = _merged(times, sorted(parts, key=lambda part: part[0]))
    sigma = (
        math.sqrt(
            settings.clock_error * settings.clock_error
            + settings.clock_noise * settings.clock_noise
        )
        / SPEED_OF_LIGHT_M_S
    )
    return Columns.build(
        valid,
        {
            "satellite": names,
            "station": Ragged.from_texts([""] * len(valid)),
            "clock_s": np.ascontiguousarray(values[:, 0]),
            "clock_std_s": np.full(len(valid), sigma),
        },
        log_time_ns=np.full(len(valid), scene.start_ns),
        present={"clock_std_s": np.full(len(valid), sigma > 0.0)},
    )


def _biases(setup: Setup, scene: Scene, sky: TrueSky, settings: Products) -> Columns:
    """Biases of all signals that some receiver takes, of each satellite that sends them."""
    signals = sorted({signal for receiver in setup.receivers for signal in receiver.signals})
    found: list[tuple[str, str, float]] = []
    for record in sorted(sky.broadcast, key=name_of):
        name = name_of(record)
        for signal in signals:
            if signal[0] != name[0] or not sends(record, signal[1:]):
                continue
            given = setup.sky.biases
            if settings.code_biases:
                bias = code_bias_s(record, signal, given, scene.seed)
                found.append((name, f"C{signal[1:]}", bias))
            if settings.phase_biases:
                channel = int(record["frequency_channel"])
                cycles = carrier_bias_cycles(record, signal, given, scene.seed)
                bias = cycles / frequency_hz(signal[0], int(signal[1]), channel)
                found.append((name, f"L{signal[1:]}", bias))
    count = len(found)
    nothing = np.zeros(count, dtype=np.int64)
    return Columns.build(
        np.full(count, scene.start_ns),
        {
            "satellite": np.array([name for name, _, _ in found], dtype="S3"),
            "station": Ragged.from_texts([""] * count),
            "system": Ragged.from_texts([name[0] for name, _, _ in found]),
            "kind": np.full(count, products_pb2.BIAS_KIND_OSB, dtype=np.int64),
            "observation": Ragged.from_texts([name for _, name, _ in found]),
            "second_observation": Ragged.from_texts([""] * count),
            "value_s": np.array([value for _, _, value in found], dtype=np.float64),
            "value_std_s": np.zeros(count),
            "slope_s_s": np.zeros(count),
            "valid_from_ns": nothing,
            "valid_until_ns": nothing.copy(),
        },
        present=dict.fromkeys(("value_std_s", "slope_s_s"), np.zeros(count, dtype=np.bool_)),
    )


def _information(rows: dict[str, Columns], scene: Scene, settings: Products) -> Columns:
    """What products say of themselves, one row each."""
    kinds = {
        channels.PRECISE_ORBIT.topic: ("orbit", "FIT", "positions of the true centres of mass"),
        channels.PRECISE_CLOCK.topic: ("clock", "AS", "biases of all signals are on top"),
        channels.SIGNAL_BIAS.topic: ("biases", "ABSOLUTE", "of codes, and of phases if wanted"),
        channels.EARTH_ROTATION.topic: ("earth rotation", "", "UT1 is UTC"),
    }
    told = [topic for topic in kinds if topic in rows]
    first = [int(rows[topic].valid_time_ns[0]) for topic in told]
    last = [int(rows[topic].valid_time_ns[-1]) for topic in told]
    steps = [np.diff(np.unique(rows[topic].valid_time_ns)) for topic in told]
    interval = [float(np.median(one)) / time.NS_PER_S if len(one) else 0.0 for one in steps]
    count = len(told)

    def text(values: Iterable[str]) -> Ragged:
        return Ragged.from_texts(list(values))

    return Columns.build(
        np.array(first, dtype=np.int64),
        {
            "source": text(f"simulated {kinds[topic][0]}" for topic in told),
            "format": text(["simulated"] * count),
            "version": text([""] * count),
            "agency": text([settings.agency] * count),
            "frame": text([settings.frame] * count),
            "time_system": text(["GPS"] * count),
            "kind": text(kinds[topic][1] for topic in told),
            "detail": text(kinds[topic][2] for topic in told),
            "first_ns": np.array(first, dtype=np.int64),
            "last_ns": np.array(last, dtype=np.int64),
            "interval_s": np.array(interval),
            "row_count": np.array([len(rows[topic]) for topic in told], dtype=np.int32),
        },
        log_time_ns=np.full(count, scene.start_ns),
    )
