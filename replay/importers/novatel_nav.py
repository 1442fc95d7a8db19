"""Fixes and ephemerides of NovAtel receivers: BESTPOS, BESTVEL, GPSEPHEM, RAWEPHEM."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.importers.findings import Findings
from replay.importers.geodesy import Places
from replay.importers.navbits import Bits, near, new_record
from replay.importers.navbits_gps import LnavAssembler
from replay.importers.receiver_rows import Navigation, fix_columns
from replay.importers.table import Float64, Int64
from replay.kernels.elementary import sincos
from replay.kernels.ephemeris import SYSTEM_GPS
from replay.log.columns import Columns
from replay.schemas import gnss_pb2

BESTPOS: Final = 42
BESTVEL: Final = 99
GPSEPHEM: Final = 7
RAWEPHEM: Final = 41

POS_BODY: Final = np.dtype(
    [
        ("status", "<u4"), ("kind", "<u4"), ("place", "<f8", 3), ("undulation", "<f4"),
        ("datum", "<u4"), ("std", "<f4", 3), ("station", "S4"), ("age", "<f4"),
        ("solution_age", "<f4"), ("tracked", "u1"), ("used", "u1"), ("rest", "u1", 6),
    ]
)  # fmt: skip
VEL_BODY: Final = np.dtype(
    [
        ("status", "<u4"), ("kind", "<u4"), ("latency", "<f4"), ("age", "<f4"),
        ("horizontal", "<f8"), ("track", "<f8"), ("up", "<f8"), ("reserved", "<f4"),
    ]
)  # fmt: skip
EPHEM_BODY: Final = np.dtype(
    [
        ("prn", "<u4"), ("tow", "<f8"), ("health", "<u4"), ("iode", "<u4"), ("iode2", "<u4"),
        ("week", "<u4"), ("zweek", "<u4"), ("toe_s", "<f8"), ("a", "<f8"), ("delta_n", "<f8"),
        ("m0", "<f8"), ("eccentricity", "<f8"), ("omega", "<f8"), ("cuc", "<f8"),
        ("cus", "<f8"), ("crc", "<f8"), ("crs", "<f8"), ("cic", "<f8"), ("cis", "<f8"),
        ("i0", "<f8"), ("i_dot", "<f8"), ("omega0", "<f8"), ("omega_dot", "<f8"),
        ("iodc", "<u4"), ("toc", "<f8"), ("group_delay_1_s", "<f8"), ("af0", "<f8"),
        ("af1", "<f8"), ("af2", "<f8"), ("spoof", "<u4"), ("n", "<f8"), ("variance", "<f8"),
    ]
)  # fmt: skip
RAW_BODY: Final = np.dtype(
    [("prn", "<u4"), ("week", "<u4"), ("seconds", "<u4"), ("subframes", "u1", (3, 30))]
)
_COMPUTED: Final = 0
_QUALITY: Final = {
    **dict.fromkeys((16,), gnss_pb2.FIX_QUALITY_SINGLE),
    **dict.fromkeys((17, 18), gnss_pb2.FIX_QUALITY_DGNSS),
    **dict.fromkeys((32, 33, 34), gnss_pb2.FIX_QUALITY_RTK_FLOAT),
    **dict.fromkeys((48, 49, 50, 51), gnss_pb2.FIX_QUALITY_RTK_FIXED),
    **dict.fromkeys((68, 69, 77, 78), gnss_pb2.FIX_QUALITY_PPP_FLOAT),
    **dict.fromkeys((52, 53, 54, 55, 56, 73, 74, 79, 80), gnss_pb2.FIX_QUALITY_FUSED),
}
_RAD: Final = math.pi / 180.0


def fixes(
    rows: npt.NDArray[np.void],
    times: Int64,
    velocities: npt.NDArray[np.void],
    velocity_times: Int64,
    lever_arm_m: Sequence[float],
    where: str,
    findings: Findings,
) -> Columns | None:
    """BESTPOS with the BESTVEL of the same time, as far as the receiver solved them."""
    solved = rows["status"] == _COMPUTED
    if not solved.all():
        left = int((~solved).sum())
        findings.notes.append(f"{where}: {left} BESTPOS messages hold no solution")
    if not solved.any():
        return None
    rows, times = rows[solved], times[solved]
    place = rows["place"]
    height = place[:, 2] + rows["undulation"]
    places = Places.from_geodetic(place[:, 0] * _RAD, place[:, 1] * _RAD, height)
    std = rows["std"].astype(np.float64)
    covariance = np.zeros((len(rows), 6))
    covariance[:, [0, 3, 5]] = std[:, [1, 0, 2]] * std[:, [1, 0, 2]]
    quality = [_QUALITY.get(kind, gnss_pb2.FIX_QUALITY_UNKNOWN) for kind in rows["kind"].tolist()]
    return fix_columns(
        times,
        places,
        covariance,
        np.array(quality, dtype=np.int64),
        lever_arm_m,
        velocity_enu=_velocity(times, velocities, velocity_times),
        satellite_count=rows["used"].astype(np.int64),
        differential_age_s=rows["age"].astype(np.float64),
    )


def _velocity(times: Int64, rows: npt.NDArray[np.void], row_times: Int64) -> Float64:
    """East, north, up (n, 3) of BESTVEL at the given times, NaN where there is none."""
    out = np.full((len(times), 3), np.nan)
    at = {t: i for i, t in enumerate(row_times.tolist()) if rows["status"][i] == _COMPUTED}
    for i, moment in enumerate(times.tolist()):
        if moment in at:
            row = rows[at[moment]]
            sine, cosine = sincos(float(row["track"]) * _RAD)
            speed = float(row["horizontal"])
            out[i] = (speed * sine, speed * cosine, float(row["up"]))
    return out


def add_ephemerides(
    parsed: npt.NDArray[np.void],
    parsed_times: Int64,
    raw: npt.NDArray[np.void],
    raw_times: Int64,
    navigation: Navigation,
) -> None:
    """GPSEPHEM and RAWEPHEM."""
    for row, now_ns in zip(parsed, parsed_times.tolist(), strict=True):
        navigation.add(_gps(row, now_ns), now_ns)
    for row, now_ns in zip(raw, raw_times.tolist(), strict=True):
        assembler = LnavAssembler("G")
        for subframe in row["subframes"]:
            bits = Bits(int.from_bytes(subframe.tobytes(), "big"), 240)
            record, _ = assembler.add(int(row["prn"]), bits, now_ns)
            if record is not None:
                navigation.add(record, now_ns)


def _gps(row: Any, now_ns: int) -> Any:
    record = new_record(SYSTEM_GPS, int(row["prn"]))
    for name in (
        "health", "iode", "iodc", "toe_s", "delta_n", "m0", "eccentricity", "omega", "cuc", "cus",
        "crc", "crs", "cic", "cis", "i0", "i_dot", "omega0", "omega_dot", "group_delay_1_s",
        "af0", "af1", "af2",
    ):  # fmt: skip
        record[name] = row[name]
    record["sqrt_a"] = math.sqrt(float(row["a"]))
    record["accuracy_m"] = math.sqrt(float(row["variance"]))
    record["toe_ns"] = near(float(row["toe_s"]), now_ns)
    record["toc_ns"] = near(float(row["toc"]), now_ns)
    record["transmitted_ns"] = near(float(row["tow"]), now_ns)
    return record
