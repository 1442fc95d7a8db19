"""How fast an inertial CSV file becomes columns, beside numpy.loadtxt in the same process.

Usage: python tools/bench/importers.py [ROWS]

The import's own time covers everything from the file to the log on the disk; the
reader's time is what compares with numpy.loadtxt.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from replay.importers import import_log
from replay.importers.delimited import read_csv
from replay.importers.files import read_file
from replay.importers.findings import Findings

NAMES = ("t", "gx", "gy", "gz", "ax", "ay", "az")
SPEC = """\
title = "bench"
origin = "none"
licence = "CC0-1.0"
[sources.imu]
file = "imu.csv"
columns = ["t", "gx", "gy", "gz", "ax", "ay", "az"]
[channels.imu]
kind = "imu"
source = "imu"
mounting = ["yaw 3 deg", "axes forward-left-up"]
[channels.imu.time]
columns = ["t"]
scale = "relative"
epoch = "2026-01-01T00:00:00"
[channels.imu.fields]
angular_rate_body_rad_s = { columns = ["gx", "gy", "gz"], unit = "rad/s" }
specific_force_body_m_s2 = { columns = ["ax", "ay", "az"], unit = "m/s^2" }
"""


def fastest(work: Callable[[], object], rounds: int = 3) -> float:
    """Shortest of some runs, CPU seconds of this process."""
    took = []
    for _ in range(rounds):
        start = time.process_time()
        work()
        took.append(time.process_time() - start)
    return min(took)


def main() -> None:
    """Print rows per second."""
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else 300_000
    rng = np.random.default_rng(1)
    table = np.column_stack([np.arange(rows) * 0.005, rng.normal(size=(rows, 6))])
    with tempfile.TemporaryDirectory() as folder:
        data, spec = Path(folder), Path(folder) / "bench.toml"
        spec.write_text(SPEC)
        text = data / "imu.csv"
        np.savetxt(text, table, fmt="%.9f", delimiter=",")

        def read() -> object:
            findings = Findings()
            return read_csv(read_file(text, findings, mend=""), NAMES, frozenset(), findings)

        works: dict[str, Callable[[], object]] = {
            "numpy.loadtxt": lambda: np.loadtxt(text, delimiter=","),
            "reader": read,
            "whole import": lambda: import_log(spec, data, data / "out.mcap"),
        }
        print(f"{rows} rows of 7 columns, {text.stat().st_size / 1e6:.1f} MB")
        for name, work in works.items():
            seconds = fastest(work)
            print(f"{name:14s} {seconds:7.3f} s CPU {rows / seconds / 1e6:7.2f} M rows/s")


if __name__ == "__main__":
    main()
