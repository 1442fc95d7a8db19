"""Fixes, ephemerides and sensors of Septentrio receivers (SBF reference guide, 4.2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay import time
from replay.importers.findings import Findings
from replay.importers.geodesy import Places
from replay.importers.navbits import SEMICIRCLE_RAD, accuracy_m, near, new_record
from replay.importers.navbits_beidou import BDT_BEHIND_S
from replay.importers.navbits_galileo import SOURCE_FNAV, SOURCE_INAV_E1, sisa_m
from replay.importers.navbits_gps import fit_s
from replay.importers.receiver_rows import fix_columns
from replay.importers.sbf_meas import satellite
from replay.importers.table import Float64, Int64
from replay.log.columns import Columns
from replay.schemas import gnss_pb2

_TAIL: Final = [
    ("undulation", "<f4"), ("velocity", "<f4", 3), ("course", "<f4"), ("clock", "<f8"),
    ("drift", "<f4"), ("scale", "u1"), ("datum", "u1"), ("satellites", "u1"), ("wide", "u1"),
    ("reference", "<u2"), ("age", "<u2"), ("signals", "<u4"), ("alert", "u1"), ("bases", "u1"),
    ("ppp", "<u2"), ("latency", "<u2"), ("horizontal", "<u2"), ("vertical", "<u2"),
]  # fmt: skip
PVT: Final = np.dtype([("mode", "u1"), ("error", "u1"), ("place", "<f8", 3), *_TAIL])
"""PVTGeodetic and PVTCartesian after the time stamp."""
COVARIANCE: Final = np.dtype([("mode", "u1"), ("error", "u1"), ("c", "<f4", 10)])
"""PosCovGeodetic and VelCovGeodetic after the time stamp."""

_KEPLER_GPS: Final = [
    ("toc", "<u4"), ("af2", "<f4"), ("af1", "<f4"), ("af0", "<f4"), ("crs", "<f4"),
    ("delta_n", "<f4"), ("m0", "<f8"), ("cuc", "<f4"), ("eccentricity", "<f8"), ("cus", "<f4"),
    ("sqrt_a", "<f8"), ("toe_s", "<u4"), ("cic", "<f4"), ("omega0", "<f8"), ("cis", "<f4"),
    ("i0", "<f8"), ("crc", "<f4"), ("omega", "<f8"), ("omega_dot", "<f4"), ("i_dot", "<f4"),
    ("week_toc", "<u2"), ("week_toe", "<u2"),
]  # fmt: skip
GPS_NAV: Final = np.dtype(
    [
        ("prn", "u1"), ("r", "u1"), ("week", "<u2"), ("l2", "u1"), ("accuracy", "u1"),
        ("health", "u1"), ("l2p", "u1"), ("iodc", "<u2"), ("iode", "u1"), ("iode3", "u1"),
        ("fit", "u1"), ("r2", "u1"), ("group_delay_1_s", "<f4"), *_KEPLER_GPS,
    ]
)  # fmt: skip
BDS_NAV: Final = np.dtype(
    [
        ("prn", "u1"), ("r", "u1"), ("week", "<u2"), ("accuracy", "u1"), ("health", "u1"),
        ("iodc", "u1"), ("iode", "u1"), ("r2", "<u2"), ("group_delay_1_s", "<f4"),
        ("group_delay_2_s", "<f4"), *_KEPLER_GPS,
    ]
)  # fmt: skip
GAL_NAV: Final = np.dtype(
    [
        ("prn", "u1"), ("origin", "u1"), ("sqrt_a", "<f8"), ("m0", "<f8"),
        ("eccentricity", "<f8"), ("i0", "<f8"), ("omega", "<f8"), ("omega0", "<f8"),
        ("omega_dot", "<f4"), ("i_dot", "<f4"), ("delta_n", "<f4"), ("cuc", "<f4"),
        ("cus", "<f4"), ("crc", "<f4"), ("crs", "<f4"), ("cic", "<f4"), ("cis", "<f4"),
        ("toe_s", "<u4"), ("toc", "<u4"), ("af2", "<f4"), ("af1", "<f4"), ("af0", "<f8"),
        ("week_toe", "<u2"), ("week_toc", "<u2"), ("iode", "<u2"), ("flags", "<u2"),
        ("prs", "u1"), ("sisa_e5a", "u1"), ("sisa_e5b", "u1"), ("sisa_e6", "u1"),
        ("group_delay_1_s", "<f4"), ("group_delay_2_s", "<f4"),
    ]
)  # fmt: skip
GLO_NAV: Final = np.dtype(
    [
        ("prn", "u1"), ("channel", "u1"), ("position", "<f8", 3), ("velocity", "<f4", 3),
        ("acceleration", "<f4", 3), ("gamma", "<f4"), ("tau", "<f4"), ("dtau", "<f4"),
        ("toe_s", "<u4"), ("week_toe", "<u2"), ("p1", "u1"), ("p2", "u1"), ("age", "u1"),
        ("health", "u1"), ("tb", "<u2"),
    ]
)  # fmt: skip
_ANGLES: Final = ("delta_n", "m0", "omega0", "i0", "omega", "omega_dot", "i_dot")
_NO_VALUE: Final = -1.9e10  # floats that are not known are -2e10
_INAV: Final = 2
_QUALITY: Final = {
    1: gnss_pb2.FIX_QUALITY_SINGLE,
    2: gnss_pb2.FIX_QUALITY_DGNSS,
    4: gnss_pb2.FIX_QUALITY_RTK_FIXED,
    5: gnss_pb2.FIX_QUALITY_RTK_FLOAT,
    6: gnss_pb2.FIX_QUALITY_DGNSS,
    7: gnss_pb2.FIX_QUALITY_RTK_FIXED,
    8: gnss_pb2.FIX_QUALITY_RTK_FLOAT,
    10: gnss_pb2.FIX_QUALITY_PPP_FLOAT,
}


def fixes(
    rows: npt.NDArray[np.void],
    times: Int64,
    geodetic: bool,
    position: dict[int, Float64],
    velocity: dict[int, Float64],
    lever_arm_m: Sequence[float],
    where: str,
    findings: Findings,
) -> Columns | None:
    """PVTGeodetic or PVTCartesian as rows of `replay.GnssFix`.

    Covariances are those of PosCovGeodetic and VelCovGeodetic of the same time; for
    positions without, the block's own accuracies stand, which are twice the root mean
    square of the horizontal and the vertical error.

    Parameters
    ----------
    position, velocity : dict of time to float64 array (10,)
        Of north (latitude), east, up as the blocks give them.
    """
    place, speed = rows["place"], rows["velocity"].astype(np.float64)
    kind = rows["mode"] & 15
    solved = (rows["error"] == 0) & (kind != 0) & (place > _NO_VALUE).all(axis=1)
    known = np.array([t in position for t in times.tolist()], dtype=np.bool_)
    stated = (rows["horizontal"] != 65535) & (rows["vertical"] != 65535)
    usable = solved & (known | stated)
    if not usable.all():
        left = int((~usable).sum())
        findings.notes.append(f"{where}: {left} PVT blocks hold no solution or no accuracy")
    if not usable.any():
        return None
    rows, times, place, speed = rows[usable], times[usable], place[usable], speed[usable]
    speed[(speed < _NO_VALUE).any(axis=1)] = np.nan
    if geodetic:
        places = Places.from_geodetic(place[:, 0], place[:, 1], place[:, 2])
        speed = speed[:, [1, 0, 2]]
    else:
        places = Places.from_ecef(place)
        speed = places.ecef_to_enu(speed)
    covariance = np.zeros((len(rows), 6))
    horizontal, vertical = rows["horizontal"] * 0.005, rows["vertical"] * 0.005
    covariance[:, 0] = covariance[:, 3] = horizontal * horizontal / 2.0
    covariance[:, 5] = vertical * vertical
    spread = np.full((len(rows), 6), np.nan)
    for i, moment in enumerate(times.tolist()):
        if moment in position:
            covariance[i] = _triangle(position[moment], (1, 4, 7, 0, 5, 2))
        if moment in velocity:
            spread[i] = _triangle(velocity[moment], (1, 4, 7, 0, 5, 2))
    count = rows["satellites"].astype(np.int64)
    return fix_columns(
        times,
        places,
        covariance,
        np.array([_QUALITY.get(k, 0) for k in (rows["mode"] & 15).tolist()], dtype=np.int64),
        lever_arm_m,
        velocity_enu=speed,
        velocity_covariance=spread,
        satellite_count=np.where(count == 255, -1, count),
        differential_age_s=np.where(rows["age"] == 65535, np.nan, rows["age"] * 0.01),
    )


def _triangle(block: Float64, order: tuple[int, ...]) -> Float64:
    """East, north, up from a block of north-north, east-east, up-up, clock, north-east, ..."""
    return np.array([float(block[k]) for k in order])


def gps(row: Any, now_ns: int) -> Any:
    """Ephemeris of GPSNav."""
    record = _kepler(row, ord("G"), int(row["prn"]))
    record["iodc"], record["iode"] = row["iodc"], row["iode"]
    record["health"], record["group_delay_1_s"] = row["health"], row["group_delay_1_s"]
    record["accuracy_m"] = accuracy_m(int(row["accuracy"]))
    record["fit_s"] = fit_s("G", int(row["fit"]), int(row["iodc"]))
    return _dated(record, row, now_ns, 0)


def beidou(row: Any, now_ns: int) -> Any:
    """Ephemeris of BDSNav."""
    name = satellite(int(row["prn"]))
    record = _kepler(row, ord("C"), int(name[1:]) if name else int(row["prn"]))
    for field in ("iodc", "iode", "health", "group_delay_1_s", "group_delay_2_s"):
        record[field] = row[field]
    record["accuracy_m"] = accuracy_m(int(row["accuracy"]))
    return _dated(record, row, now_ns, BDT_BEHIND_S)


def galileo(row: Any, now_ns: int) -> Any:
    """Ephemeris of GALNav, whose flags say for each signal: known, validity, status."""
    record = _kepler(row, ord("E"), int(row["prn"]) - 70)
    inav = row["origin"] == _INAV
    record["source"] = SOURCE_INAV_E1 if inav else SOURCE_FNAV
    record["iode"] = record["iodc"] = row["iode"]
    record["accuracy_m"] = sisa_m(int(row["sisa_e5b"] if inav else row["sisa_e5a"]))
    flags, health = int(row["flags"]), 0
    for at, validity, status in ((0, 0, 1), (4, 6, 7), (8, 3, 4)):
        if flags >> at & 1:
            health |= (flags >> (at + 1) & 1) << validity | (flags >> (at + 2) & 3) << status
    record["health"] = health
    for field in ("group_delay_1_s", "group_delay_2_s"):
        record[field] = row[field] if row[field] > _NO_VALUE else 0.0
    return _dated(record, row, now_ns, 0)


def glonass(row: Any, now_ns: int) -> Any:
    """Ephemeris of GLONav, whose reference time is one of GPS time."""
    record = new_record(ord("R"), int(satellite(int(row["prn"]))[1:] or 0))
    for field, name in (
        ("position_m", "position"), ("velocity_m_s", "velocity"),
        ("acceleration_m_s2", "acceleration"),
    ):  # fmt: skip
        record[field] = row[name].astype(np.float64) * 1e3
    record["af0"], record["af1"] = -row["tau"], row["gamma"]
    toe = near(float(row["toe_s"]), now_ns)
    record["toe_ns"] = record["toc_ns"] = toe
    record["transmitted_ns"] = now_ns
    record["frequency_channel"] = int(row["channel"]) - 8
    record["health"], record["iode"] = int(row["health"]) >> 2 & 1, int(row["tb"]) // 15
    record["toe_s"] = _utc_of_week(toe)
    return record


def _utc_of_week(gps_ns: int) -> float:
    utc = gps_ns - time.leap_seconds(gps_ns) * time.NS_PER_S
    return utc % time.NS_PER_WEEK / time.NS_PER_S


def _kepler(row: Any, system: int, prn: int) -> Any:
    record = new_record(system, prn)
    for name in (
        "af0", "af1", "af2", "toe_s", "sqrt_a", "eccentricity", "i0", "omega0", "omega", "m0",
        "delta_n", "omega_dot", "i_dot", "cuc", "cus", "crc", "crs", "cic", "cis",
    ):  # fmt: skip
        value = float(row[name])
        record[name] = value * SEMICIRCLE_RAD if name in _ANGLES else value
    return record


def _dated(record: Any, row: Any, now_ns: int, ahead_s: int) -> Any:
    record["toe_ns"] = near(float(row["toe_s"]), now_ns, ahead_s)
    record["toc_ns"] = near(float(row["toc"]), now_ns, ahead_s)
    record["transmitted_ns"] = now_ns
    return record


def sensors(
    blocks: Sequence[tuple[int, memoryview]],
) -> tuple[Int64, Float64, Float64, Float64]:
    """Samples of ExtSensorMeas that hold acceleration and angular rate.

    Returns
    -------
    int64 array (n,), ns; float64 arrays (n, 3), rad/s and m/s^2; (n,), degC
    """
    times, rates, forces, degrees = [], [], [], []
    warmth = math.nan
    for time_ns, block in blocks:
        count, size = block[14], block[15]
        rate = force = None
        for n in range(count):
            part = block[16 + n * size : 16 + (n + 1) * size]
            if part[2] in (0, 1):
                values = np.frombuffer(part[4:28], dtype="<f8")
                if (values > _NO_VALUE).all():
                    if part[2] == 0:
                        force = values
                    else:
                        rate = values * (math.pi / 180.0)
            elif part[2] == 3:
                number = int.from_bytes(part[4:6], "little", signed=True)
                warmth = math.nan if number == -32768 else number * 0.01
        if rate is not None and force is not None:
            times.append(time_ns)
            rates.append(rate)
            forces.append(force)
            degrees.append(warmth)
    return (
        np.array(times, dtype=np.int64),
        np.array(rates, dtype=np.float64).reshape(-1, 3),
        np.array(forces, dtype=np.float64).reshape(-1, 3),
        np.array(degrees, dtype=np.float64),
    )
