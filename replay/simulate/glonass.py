"""GLONASS: slots, frequency channels, and one numerical orbit that every message is taken from.

A message is the state of the orbit at its reference time with the acceleration of the
message; the kernel that receivers use carries it on. Reference times are on the step of
that integration, so that consecutive messages are one orbit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay import time
from replay.kernels import elementary, glonass
from replay.kernels.ephemeris import EPHEMERIS_DTYPE, SYSTEM_GLONASS
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.simulate.noise import Floats, normals

Records = npt.NDArray[np.void]
Vector = tuple[float, float, float]

EVERY_S: Final = 1800  # between reference times; each message is meant for a quarter of an hour
SENT_S: Final = -900  # from the reference time to the broadcast
_MOSCOW_S: Final = 10_800
_DAY_S: Final = 86_400
_TB_S: Final = 900

# GLONASS ICD 5.1 (2008), section 3.3.3 and appendix 2.1: three planes of eight, 64.8 degrees, a
# turn in 11 h 15 min 44 s, neighbouring planes 15 degrees apart in the argument of latitude.
_PERIOD_S: Final = 40_544.0
_INCLINATION: Final = math.radians(64.8)
_PLANES: Final = 3
_IN_PLANE: Final = 8
_SKEW: Final = math.radians(15.0)
_TURN: Final = 2.0 * math.pi
# Channels of slots 1 to 24; satellites opposite each other in a plane share one.
CHANNELS: Final = (
    *(1, -4, 5, 6, 1, -4, 5, 6), *(-2, -7, 0, -1, -2, -7, 0, -1), *(4, -3, 3, 2, 4, -3, 3, 2),
)  # fmt: skip
_AF0_S: Final = 1e-4
_AF1: Final = 1e-12
_ACCELERATION_M_S2: Final = 1e-6


def satellites(seed: int, start_ns: int) -> Iterator[Any]:
    """The message of each slot whose time of validity holds the start.

    Parameters
    ----------
    seed : int
    start_ns : int, ns, GPS
    """
    leap_ns = time.leap_seconds(start_ns) * time.NS_PER_S
    half_hour = EVERY_S * time.NS_PER_S
    toe_ns = (start_ns - leap_ns) // half_hour * half_hour + half_hour // 2 + leap_ns
    week_ns = start_ns // time.NS_PER_WEEK * time.NS_PER_WEEK
    for slot in range(_PLANES * _IN_PLANE):
        yield _satellite(slot, seed, toe_ns, (toe_ns - week_ns) / time.NS_PER_S)


def _satellite(slot: int, seed: int, toe_ns: int, since_s: float) -> Any:
    """A circular orbit at its place, `since_s` after the week's beginning."""
    plane, place = divmod(slot, _IN_PLANE)
    draw = normals(seed, f"constellation.R{slot + 1:02d}", 1, 8)[0]
    n = _TURN / _PERIOD_S
    a = float(elementary.pow(glonass.MU_M3_S2 / (n * n), 1.0 / 3.0))
    ratio = glonass.RADIUS_M / a
    sin_i, cos_i = elementary.sincos(_INCLINATION)
    drift = -1.5 * glonass.J2 * n * ratio * ratio * cos_i
    node = _TURN / _PLANES * plane + (drift - glonass.OMEGA_E_RAD_S) * since_s
    u = _TURN / _IN_PLANE * place + _SKEW * plane + n * since_s
    sin_u, cos_u = elementary.sincos(u - _TURN * math.floor(u / _TURN))
    sin_o, cos_o = elementary.sincos(node - _TURN * math.floor(node / _TURN))
    position = (
        a * (cos_u * cos_o - sin_u * cos_i * sin_o),
        a * (cos_u * sin_o + sin_u * cos_i * cos_o),
        a * sin_u * sin_i,
    )
    speed = a * n
    record = np.zeros((), dtype=EPHEMERIS_DTYPE)
    record["system"], record["prn"] = SYSTEM_GLONASS, slot + 1
    record["frequency_channel"] = CHANNELS[slot]
    record["accuracy_m"] = 5.0
    record["af0"], record["af1"] = _AF0_S * draw[0], _AF1 * draw[1]
    record["position_m"] = position
    # Axes turn: the Earth's rate times the position comes off.
    record["velocity_m_s"] = (
        speed * (-sin_u * cos_o - cos_u * cos_i * sin_o) + glonass.OMEGA_E_RAD_S * position[1],
        speed * (-sin_u * sin_o + cos_u * cos_i * cos_o) - glonass.OMEGA_E_RAD_S * position[0],
        speed * cos_u * sin_i,
    )
    record["acceleration_m_s2"] = _ACCELERATION_M_S2 * draw[2:5]
    _date(record, toe_ns)
    return record


def _date(record: Any, toe_ns: int) -> None:
    """Write reference time, and what follows from it."""
    utc_s = toe_ns // time.NS_PER_S - time.leap_seconds(toe_ns)
    record["toe_ns"] = record["toc_ns"] = toe_ns
    record["toe_s"] = utc_s % (7 * _DAY_S)
    record["iode"] = (utc_s + _MOSCOW_S) % _DAY_S // _TB_S


def refer(record: Any, toe_ns: int) -> Any:
    """The same orbit and clock with another reference time."""
    moved = record.copy()
    elapsed = (toe_ns - int(record["toe_ns"])) / time.NS_PER_S
    state = np.zeros(6)
    glonass.integrate(record, elapsed, state)
    moved["position_m"], moved["velocity_m_s"] = state[:3], state[3:]
    moved["af0"] = float(record["af0"]) + float(record["af1"]) * elapsed
    _date(moved, toe_ns)
    return moved


def reference_times(record: Any, start_ns: int, end_ns: int) -> list[int]:
    """Reference times of messages that bracket a span (ns, GPS)."""
    every, origin = EVERY_S * time.NS_PER_S, int(record["toe_ns"])
    first = (start_ns - origin) // every
    last = -((origin - end_ns) // every)
    return [origin + number * every for number in range(first, last + 1)]


def perturb(records: Records, orbit_sigma_m: float, clock_m: Floats, draw: Floats) -> Records:
    """Messages of an orbit that is near another: turned as a whole, and higher or lower.

    Along the track and across it (a tilt of the plane) by `orbit_sigma_m`, in height by a
    third of it, as :func:`replay.simulate.constellation.perturb` shares errors out.

    Parameters
    ----------
    records : array (n,) of EPHEMERIS_DTYPE
        Of one satellite.
    orbit_sigma_m : float, m
    clock_m : float64 array (n,), m
        To be added to the clock at each reference time.
    draw : float64 array (4,)
        Standard normal numbers: along, two tilts, radial.
    """
    moved = records.copy()
    if not len(records):
        return moved
    earth = glonass.OMEGA_E_RAD_S
    r, v = _vectors(records[0])
    radius = math.sqrt(_dot(r, r))
    up = _scaled(r, 1.0 / radius)
    normal = _cross(r, v)
    normal = _scaled(normal, 1.0 / math.sqrt(_dot(normal, normal)))
    ahead = _cross(normal, up)
    size = orbit_sigma_m / radius
    turn = tuple(
        size * (float(draw[0]) * n + float(draw[1]) * u + float(draw[3]) * a)
        for n, u, a in zip(normal, up, ahead, strict=True)
    )
    growth = orbit_sigma_m / 3.0 / radius * float(draw[2])
    first_ns = int(records[0]["toe_ns"])
    for index, record in enumerate(records):
        since = (int(record["toe_ns"]) - first_ns) / time.NS_PER_S
        s, c = elementary.sincos(earth * since)
        # The same inertial direction in axes that have turned on.
        axis = (c * turn[0] + s * turn[1], c * turn[1] - s * turn[0], turn[2])
        r, v = _vectors(record)
        dr, dv = _cross(axis, r), _cross(axis, v)
        dr = tuple(d + growth * x for d, x in zip(dr, r, strict=True))
        dv = tuple(d + growth * x for d, x in zip(dv, v, strict=True))
        moved[index]["position_m"] += dr
        moved[index]["velocity_m_s"] += (dv[0] + earth * dr[1], dv[1] - earth * dr[0], dv[2])
        moved[index]["af0"] += float(clock_m[index]) / SPEED_OF_LIGHT_M_S
    return moved


def _vectors(record: Any) -> tuple[Vector, Vector]:
    """Position and inertial velocity in the axes of the moment."""
    x, y, z = record["position_m"].tolist()
    u, v, w = record["velocity_m_s"].tolist()
    earth = glonass.OMEGA_E_RAD_S
    return (x, y, z), (u - earth * y, v + earth * x, w)


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Any, b: Any) -> Any:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _scaled(a: Vector, factor: float) -> Vector:
    return (a[0] * factor, a[1] * factor, a[2] * factor)
