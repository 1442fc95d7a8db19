"""Rows about what moves data: the log, recordings, the diff, imports, elementary functions."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from replay.diff import diff_logs
from replay.importers import import_log
from replay.importers.delimited import read_csv
from replay.importers.files import read_file
from replay.importers.findings import Findings
from tools.bench import diff, elementary, importers, log, view
from tools.bench.row import Row, speed_row


def bench_log(*, quick: bool) -> list[Row]:
    """An hour of a 200 Hz IMU into a log and out of it, against the `mcap` package."""
    rows = 72_000 if quick else 720_000
    columns = log.imu(rows)
    blobs = log.serialize(columns)
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        ours, theirs = Path(scratch) / "ours.mcap", Path(scratch) / "theirs.mcap"
        works: tuple[tuple[str, Callable[[], object], Callable[[], object], float], ...] = (
            (
                "log: write columns",
                lambda: log.write_ours(ours, columns, "zstd"),
                lambda: log.write_theirs(theirs, columns, None, "zstd"),
                10.0,
            ),
            (
                "log: write, peer given bytes",
                lambda: log.write_ours(ours, columns, "zstd"),
                lambda: log.write_theirs(theirs, columns, blobs, "zstd"),
                5.0,
            ),
            (
                "log: read into columns",
                lambda: log.read_ours(ours, decode=True),
                lambda: log.read_theirs(ours, decode=True),
                30.0,
            ),
            (
                "log: read payloads",
                lambda: log.read_ours(ours, decode=False),
                lambda: log.read_theirs(ours, decode=False),
                20.0,
            ),
        )
        for name, mine, peer, aim in works:
            fast = rows / log.least(mine, 5)
            slow = rows / log.least(peer, 1)
            found.append(speed_row(name, "rows/s", fast, slow, "mcap", aim))
    return found


def bench_view(*, quick: bool) -> list[Row]:
    """IMU samples into a Rerun recording, against a call per row."""
    samples, few = view._samples(360.0 if quick else 3600.0), view._samples(30.0)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.rrd"
        fast = len(samples) / min(view._by_columns(samples, out) for _ in range(2))
        slow = len(few) / view._by_rows(few, out)
    return [speed_row(".rrd: write IMU", "rows/s", fast, slow, "rerun set_time + log", 100.0)]


def bench_diff(*, quick: bool) -> list[Row]:
    """Two runs of which every row differs, against a comparison message by message."""
    seconds, peer_seconds = (300, 15) if quick else (3600, 60)
    speeds = []
    with tempfile.TemporaryDirectory() as folder:
        a, b = Path(folder) / "a.mcap", Path(folder) / "b.mcap"
        for length, compare in ((seconds, diff_logs), (peer_seconds, diff._peer)):
            run = diff._run(length)
            diff._write(a, run, scaled=False)
            diff._write(b, run, scaled=True)
            count = sum(len(columns) for _, columns in run.values())
            begin = time.perf_counter()
            compare(a, b)
            speeds.append(count / (time.perf_counter() - begin))
    peer = "mcap + protobuf =="
    return [speed_row("diff: every row differs", "rows/s", speeds[0], speeds[1], peer, 10.0)]


def bench_importers(*, quick: bool) -> list[Row]:
    """An inertial CSV file into columns and into a log, against numpy."""
    rows = 60_000 if quick else 300_000
    rng = np.random.default_rng(1)
    table = np.column_stack([np.arange(rows) * 0.005, rng.normal(size=(rows, 6))])
    with tempfile.TemporaryDirectory() as folder:
        data, spec = Path(folder), Path(folder) / "bench.toml"
        spec.write_text(importers.SPEC)
        text = data / "imu.csv"
        np.savetxt(text, table, fmt="%.9f", delimiter=",")

        def read() -> object:
            findings = Findings()
            file = read_file(text, findings, mend="")
            return read_csv(file, importers.NAMES, frozenset(), findings)

        works = (
            lambda: np.loadtxt(text, delimiter=","),
            read,
            lambda: import_log(spec, data, data / "out.mcap"),
        )
        # In turn, so that a busy neighbour meets all alike.
        took = [[importers.fastest(work, 1) for work in works] for _ in range(5)]
        peer, reader, whole = (rows / min(times) for times in zip(*took, strict=True))
    return [
        speed_row("import: read CSV", "rows/s", reader, peer, "numpy.loadtxt", 1.0),
        speed_row("import: CSV to log", "rows/s", whole, peer, "numpy.loadtxt alone", 0.5),
    ]


def bench_elementary(*, quick: bool) -> list[Row]:
    """Each function over a million arguments in a compiled loop, against libm."""
    ratios: dict[str, float] = {}
    speeds = []
    cases = elementary._cases(100_000 if quick else 1_000_000)
    for name, span, ours, libm, x, y in cases[:: 4 if quick else 1]:
        arity = 2 if name in ("atan2", "pow", "hypot") else 1
        loops = [elementary._loop(ours, arity), elementary._loop(libm, arity)]
        mine, peer = elementary._best(loops, x, y, 3)
        ratios[f"{name} {span}"] = peer / mine
        speeds.append((1e9 / mine, 1e9 / peer))
    mean, peer_mean = (math.exp(sum(map(math.log, s)) / len(s)) for s in zip(*speeds, strict=True))
    slowest = min(ratios, key=lambda name: ratios[name])
    return [
        speed_row(f"elementary: mean of {len(speeds)}", "calls/s", mean, peer_mean, "libm", 1.0),
        Row(f"elementary: slowest, {slowest}", "", "libm", ratios[slowest]),
    ]
