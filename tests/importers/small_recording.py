# ruff: noqa: E501
"""A small foreign recording, made by closed forms, and the spec that imports it."""

from __future__ import annotations

import gzip
import struct
from pathlib import Path

import numpy as np

TICKS = 1000 + 8 * np.arange(200)  # ms of a counter that runs 1.25 times too slowly
SCALE = 1.25
START_S = 1_752_003_261  # 2025-07-08 19:34:21 as seconds since 1970 of a GPS calendar
HEADER = (
    "%  GPST            latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) "
    "sdne(m) sdeu(m) sdun(m) age(s) ratio vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun"
)

SPEC = """\
title = "small"
origin = "https://example.org/small"
licence = "CC0-1.0"

[sources.imu]
file = "imu.csv"
columns = ["ax", "ay", "az", "gx", "gy", "gz", "tick"]

[sources.rtk]
file = "fix.pos.gz"
format = "rtklib-pos"

[channels.imu]
kind = "imu"
source = "imu"
mounting = ["axes forward-left-up"]

[channels.imu.time]
columns = ["tick"]
scale = "ticks"
unit = "ms"
host_tag = "imu.csv.tag"
recorded_line_end = "crlf"
offset = "-0.1 s"

[channels.imu.fields]
angular_rate_body_rad_s = { columns = ["gx", "gy", "gz"], unit = "deg/s" }
specific_force_body_m_s2 = { columns = ["ax", "ay", "az"], unit = "g" }

[channels.fix]
kind = "gnss_fix"
source = "rtk"
lever_arm = ["10 cm", -0.05, -0.65]

[channels.fix.time]
columns = ["time"]
scale = "gps_calendar"
latency = "80 ms"

[channels.fix.fields]
position_geodetic = { columns = ["latitude", "longitude", "height"], unit = "deg" }
position_covariance_rtklib = { columns = ["sdn", "sde", "sdu", "sdne", "sdeu", "sdun"], unit = "m" }
velocity_enu_m_s = { columns = ["ve", "vn", "vu"], unit = "m/s" }
velocity_covariance_rtklib = { columns = ["sdvn", "sdve", "sdvu", "sdvne", "sdveu", "sdvun"], unit = "m/s" }
satellite_count = { columns = ["ns"] }

[channels.fix.quality]
column = "Q"
map = { 1 = "RTK_FIXED", 2 = "RTK_FLOAT" }

[defaults.filter]
gyro_noise = "0.3 deg/sqrt(h)"

[defaults.non_holonomic]
enabled = true
lever_arm = [-1.0, 0.0, 0.3]
"""


def imu_lines() -> list[str]:
    """Rows of the inertial file."""
    return [f"0.1,{0.001 * i:.3f},1.0,{0.5 * i:.1f},-1.0,90.0,{t}" for i, t in enumerate(TICKS)]


def pos_lines() -> list[str]:
    """Rows of the solution file, quality 1 and 2 in turn."""
    return [
        f"2025/07/08 19:34:2{i}.250 40.1 -105.1{i} 1600.5 {1 + i % 2} 21 0.02 0.01 0.03 "
        "-0.004 0.005 -0.006 0.0 3.5 1.0 2.0 -0.5 0.05 0.06 0.07 0.001 -0.002 0.003"
        for i in range(1, 8)
    ]


def tag_bytes(lines: list[str], line_end: int = 2) -> bytes:
    """Time tags of the inertial file: each line arrives whole, 100 ms after its tick's time."""
    head = b"TIMETAG RTKLIB demo5".ljust(60, b"\0") + struct.pack("<IId", 7, START_S, 0.25)
    ends = np.cumsum([len(line) + line_end for line in lines])
    elapsed = (SCALE * (TICKS - TICKS[0])).astype(int) + 100
    pairs = zip(elapsed.tolist(), ends.tolist(), strict=True)
    return head + b"".join(struct.pack("<II", ms, end) for ms, end in pairs)


def write(folder: Path) -> Path:
    """Write all files into a folder; the path of the spec."""
    lines = imu_lines()
    (folder / "imu.csv").write_text("\n".join(lines) + "\n")
    (folder / "imu.csv.tag").write_bytes(tag_bytes(lines))
    text = "\n".join([HEADER, *pos_lines()]) + "\n"
    (folder / "fix.pos.gz").write_bytes(gzip.compress(text.encode()))
    spec = folder / "small.toml"
    spec.write_text(SPEC)
    return spec
