"""Nominal constellations as broadcast ephemerides, and orbits that differ from them.

Numbers that describe a constellation are published; which satellite stands in which
slot, eccentricities, clocks, group delays and harmonic terms are drawn. The elements
hold at the beginning of the week, so that the sky repeats with the constellation and
not with the calendar. Consecutive messages of a satellite are one orbit: only the
reference time moves, and with it what the formulas let run on (anomaly, node, clock).
GLONASS, whose message is a state vector, is in :mod:`replay.simulate.glonass`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay import time
from replay.kernels import elementary
from replay.kernels.earth import SEMI_MAJOR_AXIS_M
from replay.kernels.ephemeris import EPHEMERIS_DTYPE
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S, is_geostationary, orbit_constants
from replay.log.columns import Columns
from replay.simulate import glonass
from replay.simulate.noise import normals, uniforms

Records = npt.NDArray[np.void]

SYSTEMS: Final = "GRECJ"

_DEG: Final = math.pi / 180.0
_TURN: Final = 2.0 * math.pi
_J2: Final = 1.0826298e-3
_KM: Final = 1e3
_HOUR_S: Final = 3600
_DAY_S: Final = 86_400
_BEIDOU_S: Final = 14  # BDT is behind GPS time

# GPS SPS Performance Standard (4th edition, 2008), tables 3.2-1 and 3.2-2: the 24 slots and
# the halves of the three that are expandable. Longitude of the node, arguments of latitude, deg.
_GPS: Final = (
    (272.847, (268.126, 161.786, 11.676, 41.806)),
    (332.847, (94.916, 66.356, 173.336, 309.976, 204.376)),
    (32.847, (111.876, 11.796, 339.666, 241.556)),
    (92.847, (135.226, 282.676, 257.976, 35.156, 167.356)),
    (152.847, (197.046, 302.596, 66.066, 333.686)),
    (212.847, (238.886, 0.456, 334.016, 105.206, 135.346)),
)
# Spares beside the slots, to the 31 that are usual; where they stand is assumed.
_GPS_SPARES: Final = ((0, 100.0), (2, 60.0), (3, 320.0), (4, 130.0))
_GALILEO_NODES: Final = (317.632, 77.632, 197.632)  # Galileo OS Service Definition 1.2, annex C
_GALILEO_PRN: Final = (
    *(2, 3, 4, 5, 7, 8, 9, 10), *(11, 12, 13, 15, 19, 21, 24, 25), *(26, 27, 30, 31, 33, 34, 36, 1),
)  # fmt: skip
_BEIDOU_PRN: Final = (*range(19, 31), *range(32, 38), *range(41, 47))
_BEIDOU_2_MEO: Final = ((11, 40.0), (12, 85.0), (14, 190.0))  # number, argument of latitude
# Longitudes where they cross the equator, deg: BeiDou-2 and BeiDou-3, BDS-SIS-ICD B1I 3.0, 4.1
# and the system's reports.
_BEIDOU_GEO: Final = {
    1: 140.0, 2: 84.0, 3: 110.5, 4: 160.0, 5: 58.75, 59: 140.0, 60: 80.0, 61: 110.5,
}  # fmt: skip
_BEIDOU_IGSO: Final = {
    6: (118.0, 0.0), 7: (118.0, 120.0), 8: (118.0, 240.0), 9: (95.0, 60.0), 10: (95.0, 180.0),
    13: (95.0, 300.0), 16: (112.0, 30.0), 38: (110.5, 90.0), 39: (110.5, 210.0),
    40: (110.5, 330.0),
}  # fmt: skip
_QZSS_IGSO: Final = {2: (139.0, 0.0), 4: (139.0, 120.0), 1: (139.0, 240.0)}
_QZSS_GEO: Final = {3: 127.0}

# Per system: seconds between reference times, from the reference time to the broadcast of
# the message (negative is before), fit interval, accuracy (m), standard deviations of af0 (s),
# af1 (s/s) and the group delays (s), spread of the eccentricity.
_HABITS: Final = {
    "G": (7200, -7200, 4 * _HOUR_S, 2.0, 2e-4, 4e-12, 5e-9, 6e-3),
    "E": (1800, 600, 0, 3.12, 1e-3, 3e-12, 3e-9, 3e-4),
    "C": (3600, 60, 0, 2.0, 3e-4, 1e-11, 8e-9, 1e-3),
    "J": (3600, 0, 2 * _HOUR_S, 2.0, 2e-4, 3e-12, 3e-9, 0.0),
    "R": (glonass.EVERY_S, glonass.SENT_S, 0, 0.0, 0.0, 0.0, 0.0, 0.0),
}
_GALILEO_INAV: Final = 517  # RINEX 3.05, table A8: I/NAV E1-B and E5b-I, clock of E5b and E1
_GPS_L5: Final = (1, 3, 4, 6, 8, 9, 10, 11, 14, 18, 23, 24, 25, 26, 27, 28, 30, 32)
_GPS_L2C: Final = (*_GPS_L5, 5, 7, 12, 15, 17, 29, 31)
_LAST_BEIDOU_2: Final = 18


def name_of(record: Any) -> str:
    """RINEX name of a record's satellite."""
    return f"{chr(int(record['system']))}{int(record['prn']):02d}"


def sends(record: Any, signal: str) -> bool:
    """Whether a satellite sends a signal of its system, such as `7I`."""
    system, prn = chr(int(record["system"])), int(record["prn"])
    if system == "G" and signal[0] == "5":
        return prn in _GPS_L5
    if system == "G" and signal[0] == "2" and signal[1] in "SLX":
        return prn in _GPS_L2C
    if system == "R":
        return signal[0] in "12"  # as M satellites do: no CDMA
    if system == "C":
        old = prn <= _LAST_BEIDOU_2
        if signal == "7I":
            return old
        return signal in ("2I", "6I") or not old
    return True


def constellation(systems: Iterable[str], seed: int, start_ns: int) -> Records:
    """Satellites of systems, one record each, with elements at the week's beginning.

    Parameters
    ----------
    systems : iterable of str
        RINEX letters out of SYSTEMS.
    seed : int
    start_ns : int, ns, GPS
        Its week counts; the messages of GLONASS are those of that time.

    Returns
    -------
    array (n,) of EPHEMERIS_DTYPE, by system as given and number
    """
    made: list[Any] = []
    for system in systems:
        if system == "R":
            made += glonass.satellites(seed, start_ns)
            continue
        origin = start_ns // time.NS_PER_WEEK * time.NS_PER_WEEK
        origin += _BEIDOU_S * time.NS_PER_S if system == "C" else 0
        slots = sorted(_SLOTS[system]())
        made += [_satellite(system, slot, seed, origin) for slot in slots]
    return np.array(made, dtype=EPHEMERIS_DTYPE)


# A slot: number, semi-major axis (m), inclination, node and argument of latitude (rad).
Slot = tuple[int, float, float, float, float]


def _gps() -> Iterator[Slot]:
    slots = [(node, u) for node, us in _GPS for u in us]
    slots += [(_GPS[plane][0], u) for plane, u in _GPS_SPARES]
    for number, (node, u) in enumerate(slots):
        yield number + 1, 26559.71 * _KM, 55.0 * _DEG, node * _DEG, u * _DEG


def _walker(prns: tuple[int, ...], nodes: tuple[float, ...], a: float, i: float) -> Iterator[Slot]:
    """Walker's 24/3/1: eight in each of three planes, the next plane 15 degrees ahead."""
    for index, prn in enumerate(prns):
        plane, place = divmod(index, 8)
        yield prn, a, i, nodes[plane] * _DEG, (45.0 * place + 15.0 * plane) * _DEG


def _galileo() -> Iterator[Slot]:
    yield from _walker(_GALILEO_PRN, _GALILEO_NODES, 29599.8 * _KM, 56.0 * _DEG)


def _beidou() -> Iterator[Slot]:
    nodes = (0.0, 120.0, 240.0)
    yield from _walker(_BEIDOU_PRN, nodes, 27906.1 * _KM, 55.0 * _DEG)
    for prn, u in _BEIDOU_2_MEO:
        yield prn, 27906.1 * _KM, 55.0 * _DEG, 60.0 * _DEG, u * _DEG
    yield from _geosynchronous("C", _BEIDOU_IGSO, 55.0 * _DEG)
    # In the message's own frame, which is tilted by 5 degrees about the axis of its node.
    for prn, longitude in _BEIDOU_GEO.items():
        yield prn, _synchronous("C"), 5.0 * _DEG, math.pi, longitude * _DEG - math.pi


def _qzss() -> Iterator[Slot]:
    yield from _geosynchronous("J", _QZSS_IGSO, 41.0 * _DEG)
    for prn, longitude in _QZSS_GEO.items():
        yield prn, _synchronous("J"), 0.1 * _DEG, 0.0, longitude * _DEG


def _geosynchronous(
    system: str, places: dict[int, tuple[float, float]], inclination: float
) -> Iterator[Slot]:
    for prn, (longitude, u) in places.items():
        yield prn, _synchronous(system), inclination, (longitude - u) * _DEG, u * _DEG


_SLOTS: Final = {"G": _gps, "E": _galileo, "C": _beidou, "J": _qzss}


def _synchronous(system: str) -> float:
    """Semi-major axis (m) of one turn with the Earth."""
    mu, rate = orbit_constants(ord(system))
    return float(elementary.pow(mu / (rate * rate), 1.0 / 3.0))


def _satellite(system: str, slot: Slot, seed: int, origin_ns: int) -> Any:
    prn, a, inclination, node, u = slot
    _, _, fit_s, accuracy, af0, af1, delay, spread = _HABITS[system]
    draw = normals(seed, f"constellation.{system}{prn:02d}", 1, 16)[0]
    phase = float(uniforms(seed, f"constellation.{system}{prn:02d}.perigee", 1)[0]) * _TURN
    record = np.zeros((), dtype=EPHEMERIS_DTYPE)
    record["system"], record["prn"] = ord(system), prn
    record["toe_ns"] = record["toc_ns"] = origin_ns
    record["fit_s"], record["accuracy_m"] = fit_s, accuracy
    record["source"] = _GALILEO_INAV if system == "E" else 0
    record["af0"], record["af1"] = af0 * draw[0], af1 * draw[1]
    record["group_delay_1_s"] = delay * draw[2]
    record["group_delay_2_s"] = 0.0 if system in "GJ" else delay * draw[3]
    record["sqrt_a"] = math.sqrt(a)
    eccentricity = 0.075 if system == "J" and inclination > 0.1 else abs(spread * draw[4])
    record["eccentricity"] = min(eccentricity, 0.02) if system != "J" else eccentricity
    record["i0"], record["omega0"] = inclination, node
    # QZSS has its perigee in the south: it is slow over Japan.
    record["omega"] = -0.5 * math.pi if system == "J" and inclination > 0.1 else phase - math.pi
    record["m0"] = _wrap(_mean_anomaly(u - float(record["omega"]), record))
    if is_geostationary(record):
        return record
    mu, _ = orbit_constants(ord(system))
    cosine = float(elementary.cos(inclination))
    ratio = SEMI_MAJOR_AXIS_M / a
    rate = 1.5 * _J2 * math.sqrt(mu / (a * a * a)) * ratio * ratio
    record["omega_dot"] = -rate * cosine
    if a < 40_000.0 * _KM:
        record["delta_n"] = 0.5 * rate * (3.0 * cosine * cosine - 1.0)
        for at, (name, size) in enumerate(
            (("cuc", 4e-6), ("cus", 6e-6), ("crc", 150.0), ("crs", 80.0), ("cic", 8e-8),
             ("cis", 8e-8))
        ):  # fmt: skip
            record[name] = size * draw[8 + at]
    return record


def _mean_anomaly(true: float, record: Any) -> float:
    """Mean anomaly (rad) of a true one."""
    e = float(record["eccentricity"])
    s, c = elementary.sincos(true)
    d = 1.0 + e * c
    root = math.sqrt(1.0 - e * e)
    E = float(elementary.atan2(root * s / d, (e + c) / d))
    return E - e * float(elementary.sin(E))


def _wrap(angle: float) -> float:
    """An angle in [-pi, pi)."""
    return angle - _TURN * math.floor(angle / _TURN + 0.5)


def refer(record: Any, toe_ns: int) -> Any:
    """The same orbit and clock with another reference time."""
    if chr(int(record["system"])) == "R":
        return glonass.refer(record, toe_ns)
    moved = record.copy()
    system = int(record["system"])
    elapsed = (toe_ns - int(record["toe_ns"])) / time.NS_PER_S
    mu, earth = orbit_constants(system)
    own_ns = toe_ns - (_BEIDOU_S * time.NS_PER_S if chr(system) == "C" else 0)
    toe_s = own_ns % time.NS_PER_WEEK / time.NS_PER_S
    a = float(record["sqrt_a"]) * float(record["sqrt_a"])
    n = math.sqrt(mu / (a * a * a)) + float(record["delta_n"])
    moved["toe_ns"] = moved["toc_ns"] = toe_ns
    moved["toe_s"] = toe_s
    moved["m0"] = _wrap(float(record["m0"]) + n * elapsed)
    moved["af0"] = float(record["af0"]) + float(record["af1"]) * elapsed
    was_s = float(record["toe_s"])
    if is_geostationary(record):
        # The tilted frame turns with the reference time: its node stays, the perigee goes back.
        moved["omega0"] = _wrap(float(record["omega0"]) + earth * (toe_s - was_s))
        moved["omega"] = _wrap(float(record["omega"]) - earth * elapsed)
    else:
        # Whole weeks between the reference times: the node is counted from the week's start.
        weeks = toe_s - was_s - elapsed
        node = float(record["omega0"]) + float(record["omega_dot"]) * elapsed + earth * weeks
        moved["omega0"] = _wrap(node)
    return moved


def perturb(
    record: Any, orbit_sigma_m: float, clock_sigma_m: float, tau_s: float, draw: Any
) -> Any:
    """The orbit and clock that a satellite really has, near what it broadcasts.

    Constant differences of elements and clock: a drift along the track and a tilt of the
    plane of `orbit_sigma_m` each, a radial wave of a third of it, as errors of broadcast
    orbits are shared out; a clock offset, and a drift that makes as much in `tau_s`.

    Parameters
    ----------
    record : record of EPHEMERIS_DTYPE
    orbit_sigma_m, clock_sigma_m : float, m
    tau_s : float, s
    draw : float64 array (6,)
        Standard normal numbers.
    """
    true = record.copy()
    a = float(record["sqrt_a"]) * float(record["sqrt_a"])
    light = SPEED_OF_LIGHT_M_S
    true["m0"] = float(record["m0"]) + orbit_sigma_m / a * draw[0]
    true["i0"] = float(record["i0"]) + orbit_sigma_m / a * draw[1]
    true["eccentricity"] = abs(
        float(record["eccentricity"]) + orbit_sigma_m / a * math.sqrt(2.0) / 3.0 * draw[2]
    )
    if not is_geostationary(record):
        true["omega0"] = float(record["omega0"]) + orbit_sigma_m / a * draw[3]
    true["af0"] = float(record["af0"]) + clock_sigma_m / light * draw[4]
    true["af1"] = float(record["af1"]) + clock_sigma_m / light / tau_s * draw[5]
    return true


def messages(satellites: Records, start_ns: int, end_ns: int) -> Columns:
    """What satellites broadcast: rows of `replay.BroadcastEphemeris`.

    Of each satellite the last message before the start, which is available at the start,
    and every one that is sent until the end.
    """
    sent = []
    for satellite in satellites:
        every_s, delay_s, *_ = _HABITS[chr(int(satellite["system"]))]
        every, delay = every_s * time.NS_PER_S, delay_s * time.NS_PER_S
        origin = int(satellite["toe_ns"])
        number = (start_ns - delay - origin) // every
        while origin + number * every + delay <= end_ns:
            message = refer(satellite, origin + number * every)
            message["transmitted_ns"] = int(message["toe_ns"]) + delay
            if chr(int(satellite["system"])) != "R":
                message["iode"] = message["iodc"] = number % (_DAY_S // every_s) + 1
            sent.append(message)
            number += 1
    table = np.array(sent, dtype=EPHEMERIS_DTYPE)
    log_ns = np.maximum(table["transmitted_ns"], start_ns)
    order = np.lexsort((np.arange(len(table)), log_ns))
    table, log_ns = table[order], log_ns[order]
    values: dict[str, npt.NDArray[Any]] = {
        "satellite": np.array([name_of(record) for record in table], dtype="S3")
    }
    kepler = table["system"] != ord("R")
    fields = _FIELDS if kepler.all() else (*_FIELDS, *_STATE)
    for name in fields:
        integer = name in ("iode", "iodc", "health", "source", "frequency_channel")
        values[name] = np.ascontiguousarray(
            table[name], dtype=np.int32 if integer else table[name].dtype
        )
    present = (
        {} if kepler.all() else dict.fromkeys(_KEPLER, kepler) | dict.fromkeys(_STATE, ~kepler)
    )
    return Columns.build(table["transmitted_ns"], values, log_time_ns=log_ns, present=present)


_COMMON: Final = (
    "toe_ns", "toc_ns", "transmitted_ns", "iode", "iodc", "health", "source", "accuracy_m",
    "fit_s", "af0", "af1", "af2", "group_delay_1_s", "group_delay_2_s", "toe_s",
)  # fmt: skip
_KEPLER: Final = (
    "sqrt_a", "eccentricity", "i0", "omega0", "omega", "m0", "delta_n", "omega_dot", "i_dot",
    "cuc", "cus", "crc", "crs", "cic", "cis",
)  # fmt: skip
_FIELDS: Final = (*_COMMON, *_KEPLER)
_STATE: Final = ("position_m", "velocity_m_s", "acceleration_m_s2", "frequency_channel")
