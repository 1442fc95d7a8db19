"""Rows per second into a Rerun recording: whole columns against a call per row.

Both write the same three body rates and three specific forces, with the same
times, to a file each, in one process. Run it on a quiet machine:

    python tools/bench/view.py --seconds 600
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import rerun as rr
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from replay.log.columns import Columns
from replay.time import to_datetime64
from replay.view.recording import record

_RATE_HZ = 200
_START_NS = 1_400_000_000_000_000_000


def _samples(seconds: float) -> Columns:
    count = int(seconds * _RATE_HZ)
    noise = np.random.default_rng(0).standard_normal((count, 6))
    return Columns.build(
        _START_NS + np.arange(count, dtype=np.int64) * (1_000_000_000 // _RATE_HZ),
        {"angular_rate_body_rad_s": noise[:, :3], "specific_force_body_m_s2": noise[:, 3:]},
    )


def _by_columns(samples: Columns, out: Path) -> float:
    batches = [
        {"/imu/raw": samples.take(slice(first, first + 65_536))}
        for first in range(0, len(samples), 65_536)
    ]
    begin = time.perf_counter()
    record(batches, {}, out, name="columns")
    return time.perf_counter() - begin


def _by_rows(samples: Columns, out: Path) -> float:
    times = to_datetime64(samples.valid_time_ns)
    rate = np.degrees(samples["angular_rate_body_rad_s"].astype(np.float64))
    force = samples["specific_force_body_m_s2"].astype(np.float64)
    begin = time.perf_counter()
    stream = rr.RecordingStream("bench", send_properties=False)
    stream.save(out)
    for index in range(len(samples)):
        stream.set_time("gps_time", timestamp=times[index])
        stream.log("imu/angular_rate", rr.Scalars(rate[index]))
        stream.log("imu/specific_force", rr.Scalars(force[index]))
    stream.flush()
    stream.disconnect()
    return time.perf_counter() - begin


def main() -> None:
    """Measure both and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=3600.0, help="of samples, as columns")
    parser.add_argument("--row-seconds", type=float, default=60.0, help="of samples, row by row")
    parser.add_argument("--repeat", type=int, default=3, help="times; the best counts")
    wanted = parser.parse_args()
    table = Table(title="IMU samples into a recording (best of runs)")
    for name in ("way", "rows", "seconds", "rows/s", "file [MB]", "ratio"):
        table.add_column(name, justify="left" if name == "way" else "right")
    ways = (
        ("set_time + log per row", _by_rows, _samples(wanted.row_seconds)),
        ("send_columns (replay.view)", _by_columns, _samples(wanted.seconds)),
    )
    slowest = 0.0
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.rrd"
        for name, run, samples in ways:
            elapsed = min(run(samples, out) for _ in range(wanted.repeat))
            speed = len(samples) / elapsed
            slowest = slowest or speed
            megabytes = out.stat().st_size / 1e6
            table.add_row(
                name, f"{len(samples):,}", f"{elapsed:.3f}", f"{speed:,.0f}", f"{megabytes:.1f}",
                f"{speed / slowest:.0f}",
            )  # fmt: skip
    Console().print(table)


if __name__ == "__main__":
    main()
