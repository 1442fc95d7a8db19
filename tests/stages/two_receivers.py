"""Two receivers under a made-up sky: observations, sights and corrections without a model error.

Satellites move along straight lines, ranges are plain distances, and clocks are what the
test says: whatever a stage finds that is not what was put in is the stage's doing.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from replay import channels
from replay.log.columns import Columns, concatenate
from replay.stages.base import BASE, Context, Port

C_M_S = 299_792_458.0
NS = 1_000_000_000
FREQUENCY = {"1C": 1575.42e6, "5Q": 1176.45e6, "2W": 1227.60e6}
BASE_POSITION = np.array([3_980_000.0, 600_000.0, 4_930_000.0])
READ = (channels.GNSS_OBS, channels.SATELLITES, channels.CORRECTIONS, channels.COARSE)


def local_axes(x):
    """East, north, up as rows."""
    up = x / np.linalg.norm(x)
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    return np.array([east, np.cross(up, east), up])


@dataclasses.dataclass(frozen=True)
class Sky:
    """Directions from the base, spread over the hemisphere."""

    names: tuple[bytes, ...]
    places: np.ndarray
    speeds: np.ndarray
    elevations: np.ndarray

    def at(self, t):
        return self.places + self.speeds * t


def make_sky(systems=("G", "E"), count=7, seed=1):
    generator = np.random.default_rng(seed)
    names, places, elevations = [], [], []
    axes = local_axes(BASE_POSITION)
    for system in systems:
        for k in range(count):
            elevation = np.radians(20.0 + 65.0 * k / (count - 1))
            azimuth = generator.uniform(0.0, 2.0 * np.pi)
            local = [
                np.cos(elevation) * np.sin(azimuth),
                np.cos(elevation) * np.cos(azimuth),
                np.sin(elevation),
            ]
            names.append(f"{system}{k + 1:02d}".encode())
            places.append(BASE_POSITION + 22_000_000.0 * (np.array(local) @ axes))
            elevations.append(elevation)
    speeds = generator.normal(0.0, 2000.0, (len(names), 3))
    return Sky(tuple(names), np.array(places), speeds, np.array(elevations))


def receive(sky, role, epochs, path, clock, integers, *, signals=("1C", "5Q"), code=0.0,
            phase=0.0, seed=0, late=0.0, lost=(), t0=1_300_000_000 * NS):  # fmt: skip
    """The four channels of one receiver.

    Parameters
    ----------
    path : callable
        Position (m, ECEF) at a time (s).
    clock : callable
        Offset (m) at a time.
    integers : array (satellites, signals)
        Or a callable of the time.
    code, phase : float, m
        Deviations of noise.
    late : float, s
        Log time less valid time.
    lost : collection of (epoch, satellite name)
        Where the loss-of-lock bit is set.
    """
    generator = np.random.default_rng(seed)
    rows = {"obs": [], "sights": [], "corrections": [], "coarse": []}
    for k in epochs:
        x, c = path(float(k)), clock(float(k))
        t = t0 + k * NS
        ambiguities = integers(float(k)) if callable(integers) else integers
        places = sky.at(float(k))
        ranges = np.linalg.norm(places - x, axis=1)
        for i, name in enumerate(sky.names):
            toward = (places[i] - x) / ranges[i]
            rate = float(toward @ (sky.speeds[i] - (path(k + 0.5) - path(k - 0.5))))
            rows["sights"].append((t, name, places[i], sky.speeds[i], sky.elevations[i]))
            for s, signal in enumerate(signals):
                wavelength = C_M_S / FREQUENCY[signal]
                p = ranges[i] + c + code * generator.normal()
                carrier = ranges[i] + c + phase * generator.normal()
                cycles = carrier / wavelength + ambiguities[i, s]
                lli = 1 if (k, name.decode()) in lost else 0
                rows["obs"].append((t, name, signal, p, cycles, -rate / wavelength, lli))
                rows["corrections"].append((t, name, signal, ranges[i]))
        rows["coarse"].append((t, x + [3.0, -2.0, 1.0], c))
    return {
        Port(channel, role).name: columns
        for channel, columns in zip(READ, _columns(rows, round(late * NS)), strict=True)
    }


def _columns(rows, late):
    def table(part, names):
        return dict(zip(names, zip(*part, strict=True), strict=True))

    obs = table(rows["obs"], ("t", "satellite", "signal", "p", "l", "d", "lost"))
    n = len(obs["t"])
    t = np.array(obs["t"], dtype=np.int64)
    no, yes = np.zeros(n, dtype=bool), np.ones(n, dtype=bool)
    yield Columns.build(
        t,
        {
            "satellite": np.array(obs["satellite"], dtype="S3"),
            "signal": np.array(obs["signal"], dtype="S2"),
            "pseudorange_m": np.array(obs["p"]),
            "carrier_phase_cycles": np.array(obs["l"]),
            "doppler_hz": np.array(obs["d"]),
            "cn0_dbhz": np.full(n, 45.0),
            "lock_time_s": np.full(n, np.nan),
            "loss_of_lock": np.array(obs["lost"], dtype=np.uint32),
            "glonass_channel": np.zeros(n, dtype=np.int32),
        },
        log_time_ns=t + late,
        present={"loss_of_lock": yes, "glonass_channel": no},
    )
    sights = table(rows["sights"], ("t", "satellite", "x", "v", "elevation"))
    t = np.array(sights["t"], dtype=np.int64)
    n = len(t)
    yield Columns.build(
        t,
        {
            "satellite": np.array(sights["satellite"], dtype="S3"),
            "position_ecef_m": np.array(sights["x"]),
            "velocity_ecef_m_s": np.array(sights["v"]),
            **{
                name: np.zeros(n)
                for name in ("clock_s", "clock_drift_s_s", "azimuth_rad", "range_std_m")
            },
            "elevation_rad": np.array(sights["elevation"]),
            "ephemeris_age_s": (t - t[0]) * 1e-9,
            "issue": np.ones(n, dtype=np.int32),
            "health": np.zeros(n, dtype=np.int32),
        },
        log_time_ns=t + late,
    )
    corrections = table(rows["corrections"], ("t", "satellite", "signal", "distance"))
    t = np.array(corrections["t"], dtype=np.int64)
    n = len(t)
    yield Columns.build(
        t,
        {
            "satellite": np.array(corrections["satellite"], dtype="S3"),
            "signal": np.array(corrections["signal"], dtype="S2"),
            "distance_m": np.array(corrections["distance"]),
            **{
                name: np.zeros(n)
                for name in (
                    "sagnac_m", "satellite_clock_m", "relativity_m", "group_delay_m",
                    "ionosphere_m", "hydrostatic_m", "wet_m", "hydrostatic_mapping",
                    "wet_mapping", "shapiro_m",
                )
            },
        },
        log_time_ns=t + late,
    )  # fmt: skip
    coarse = table(rows["coarse"], ("t", "x", "clock"))
    t = np.array(coarse["t"], dtype=np.int64)
    yield Columns.build(
        t,
        {
            "position_ecef_m": np.array(coarse["x"]),
            "clock_offset_m": np.array(coarse["clock"]),
            "age_s": np.zeros(len(t)),
            "satellite_count": np.full(len(t), 9, dtype=np.uint32),
        },
        log_time_ns=t + late,
    )


def fixed_base(block):
    """The base's coarse position is its true one."""
    coarse = block[Port(channels.COARSE, BASE).name]
    values = dict(coarse.values)
    values["position_ecef_m"] = np.tile(BASE_POSITION, (len(coarse), 1))
    return {**block, Port(channels.COARSE, BASE).name: dataclasses.replace(coarse, values=values)}


def run_stage(stage, config, blocks):
    """Outputs of a stage over blocks, rows of one channel one after the other."""
    state = stage.start(config, Context({}, {}))
    parts = []
    for block in blocks:
        state, outputs = stage.step(state, block)
        parts.append(outputs)
    parts.append(stage.finish(state))
    return parts


def whole(parts, channel):
    """All rows of a channel."""
    rows = [part[channel.name] for part in parts if channel.name in part]
    return concatenate(rows) if len(rows) > 1 else rows[0]
