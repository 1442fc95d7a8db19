"""Small scenarios with observations, and the interface documents' formulas once more in numpy."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np

from replay import channels, time
from replay.log.columns import Columns
from replay.simulate import read_scenario
from replay.simulate.write import make_all

C = 299792458.0
WGS84_RATE = 7.292115e-5
START = "2020-11-30T06:00:00"
START_NS = time.parse_calendar(START)
HERE = {"latitude": "30.5 deg", "longitude": "114.3 deg", "height": "25 m"}
NO_AIR = {"ionosphere": {"enabled": False}, "troposphere": {"enabled": False}}
STEADY = {"sigma": 0.0}
DRIVE = [
    {"kind": "hold", "duration": 5.0},
    {"kind": "speed", "to": 15.0},
    {"kind": "turn", "angle": "90 deg", "radius": 60.0},
    {"kind": "straight", "duration": 20.0},
]


def receiver(name: str = "rover", **keys: Any) -> dict[str, Any]:
    """A perfect receiver, but for what is given."""
    perfect = {"name": name, "signals": ["G1C", "G2W", "E1C", "E7Q", "C2I", "C6I"]}
    return {**perfect, "strength": STEADY, "mask": "10 deg", **keys}


def base(name: str = "base", **keys: Any) -> dict[str, Any]:
    """The same on a pillar."""
    return receiver(name, kind="static", **HERE, **keys)


@dataclasses.dataclass(frozen=True)
class Made:
    """Rows and hidden facts of a scenario."""

    rows: dict[str, Columns]
    slips: list[dict[str, Any]]
    arcs: list[list[Any]]

    def observations(self, name: str) -> Columns:
        return self.rows[channels.GNSS_OBS.at(receiver=name)]

    def epochs(self, name: str) -> Columns:
        return self.rows[channels.RECEIVER_EPOCH.at(receiver=name)]


def make(*receivers: dict[str, Any], segments: Any = None, **keys: Any) -> Made:
    """A scenario of receivers; 30 s at rest where no segments are given."""
    table = {
        "seed": 4,
        "start": {"time": START, **HERE, "heading": "20 deg"},
        "gnss": {"fixes": False},
        "truth": {"rate": 10.0},
        "receivers": list(receivers),
        "segments": segments or [{"kind": "hold", "duration": 30.0}],
        **keys,
    }
    rows, told = make_all(read_scenario(table))
    return Made(rows, json.loads(told["slips"]), json.loads(told["arcs"]))


def series(columns: Columns, satellite: str, signal: str) -> dict[str, np.ndarray]:
    """Fields of one signal by name, with its times."""
    chosen = (columns["satellite"] == satellite.encode()) & (columns["signal"] == signal.encode())
    fields = ("pseudorange_m", "carrier_phase_cycles", "doppler_hz", "cn0_dbhz", "lock_time_s")
    found = {name: columns[name][chosen] for name in fields}
    found["flag"] = columns["loss_of_lock"][chosen]
    found["time"] = columns.valid_time_ns[chosen]
    return found


def signals_of(columns: Columns) -> list[tuple[str, str]]:
    """Satellites and signals that were observed."""
    pairs = zip(columns["satellite"].tolist(), columns["signal"].tolist(), strict=True)
    return sorted({(a.decode(), b.decode()) for a, b in pairs})


def message(made: Made, satellite: str) -> dict[str, float]:
    """The first ephemeris of a satellite."""
    nav = made.rows[channels.NAV.topic]
    row = np.flatnonzero(nav["satellite"] == satellite.encode())[0]
    return {name: nav[name][row].item() for name in nav.values}


def orbit(m: dict[str, Any], t: float) -> tuple[np.ndarray, float]:
    """ECEF position and clock `t` seconds after toe, straight from the documents' tables."""
    beidou, galileo = m["satellite"][:1] == b"C", m["satellite"][:1] == b"E"
    mu = 3.986004418e14 if beidou or galileo else 3.986005e14
    rate = 7.2921150e-5 if beidou else 7.2921151467e-5
    a, e = m["sqrt_a"] ** 2, m["eccentricity"]
    M = m["m0"] + (math.sqrt(mu / a**3) + m["delta_n"]) * t
    E = M
    for _ in range(30):
        E = M + e * math.sin(E)
    phi = math.atan2(math.sqrt(1 - e * e) * math.sin(E), math.cos(E) - e) + m["omega"]
    u = phi + m["cus"] * math.sin(2 * phi) + m["cuc"] * math.cos(2 * phi)
    r = a * (1 - e * math.cos(E)) + m["crs"] * math.sin(2 * phi) + m["crc"] * math.cos(2 * phi)
    i = m["i0"] + m["i_dot"] * t + m["cis"] * math.sin(2 * phi) + m["cic"] * math.cos(2 * phi)
    plane = np.array([r * math.cos(u), r * math.sin(u), 0.0])
    still = beidou and int(m["satellite"][1:]) in (*range(1, 6), *range(59, 64))
    turning = m["omega_dot"] - (0.0 if still else rate)
    place = turn_z(-(m["omega0"] + turning * t - rate * m["toe_s"])) @ turn_x(-i) @ plane
    if still:
        place = turn_z(rate * t) @ turn_x(math.radians(-5.0)) @ place
    clock = m["af0"] + m["af1"] * t - 2 * math.sqrt(mu * a) * e * math.sin(E) / C**2
    return place, clock


def turn_z(angle: float) -> np.ndarray:
    """Rotation of axes about the third."""
    s, c = math.sin(angle), math.cos(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def turn_x(angle: float) -> np.ndarray:
    """Rotation of axes about the first."""
    s, c = math.sin(angle), math.cos(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


def travel_and_clock(
    m: dict[str, Any], place: np.ndarray, time_ns: int, offset_s: float
) -> tuple[float, float]:
    """Travel time of what arrives at a place and true time, and the satellite's clock then."""
    since = (time_ns - m["toe_ns"]) / 1e9 + offset_s
    travel = 0.07
    for _ in range(6):
        satellite, clock = orbit(m, since - travel)
        travel = float(np.linalg.norm(turn_z(WGS84_RATE * travel) @ satellite - place)) / C
    return travel, clock


def group_delay(m: dict[str, Any], signal: str) -> float:
    """Of the code, as the documents say, s."""
    system = m["satellite"][:1].decode()
    first, second = m["group_delay_1_s"], m["group_delay_2_s"]
    return {
        "G1C": first,
        "G2W": (77 / 60) ** 2 * first,
        "E1C": second,
        "E7Q": (154 / 118) ** 2 * second,
        "C2I": first,
        "C6I": 0.0,
    }[system + signal]


FREQUENCY = {
    "G1C": 1575.42e6,
    "G2W": 1227.6e6,
    "E1C": 1575.42e6,
    "E7Q": 1207.14e6,
    "C2I": 1561.098e6,
    "C6I": 1268.52e6,
}
