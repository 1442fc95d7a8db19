"""Time `replay diff` on an hour of log against a row-by-row comparison with the mcap package.

Run as ``python tools/bench/diff.py``. The log has an IMU at 200 Hz, a filter of 21 states and
its solution at 10 Hz, and 60 GNSS observations a second. The peer reads both logs with
`mcap.reader` and `mcap_protobuf` and compares the messages of one topic and time with `==`;
it tells no kind of difference, no tolerance and no statistics.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from google.protobuf import descriptor_pool
from google.protobuf.descriptor import FieldDescriptor
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from replay.channels import FILTER_COVARIANCE, FILTER_STATE, GNSS_OBS, IMU, SOLUTION, ChannelSpec
from replay.diff import diff_logs
from replay.log.columns import Column, Columns, Ragged
from replay.log.writer import LogWriter
from replay.time import NS_PER_S

START_NS = 1_400_000_000 * NS_PER_S
STATES = 21
SATELLITES = 30
SIGNALS = ("1C", "5Q")
GROUPS = (
    "position_ecef", "velocity_ecef", "attitude_ecef", "gyro_bias", "accel_bias", "gyro_scale",
    "accel_scale",
)  # fmt: skip


def _columns(spec: ChannelSpec, times: np.ndarray, values: dict[str, Column]) -> Columns:
    """Columns with noise in each vector and number that is not given."""
    rng = np.random.default_rng(len(times))
    filled = dict(values)
    for field in descriptor_pool.Default().FindMessageTypeByName(spec.message).fields:
        if field.name in filled or field.containing_oneof is not None:
            continue
        if field.message_type is not None:
            filled[field.name] = rng.normal(size=(len(times), len(field.message_type.fields)))
        elif field.type == FieldDescriptor.TYPE_DOUBLE and not field.is_repeated:
            filled[field.name] = rng.normal(size=len(times))
    return Columns.build(times, filled)


def _run(seconds: int) -> dict[str, tuple[ChannelSpec, Columns]]:
    """Channels of a run."""
    rng = np.random.default_rng(1)
    imu = START_NS + np.arange(1, 200 * seconds + 1) * (NS_PER_S // 200)
    epochs = START_NS + np.arange(1, 10 * seconds + 1) * (NS_PER_S // 10)
    whole = np.repeat(epochs[9::10], SATELLITES * len(SIGNALS))
    names = [(f"G{s + 1:02d}", c) for s in range(SATELLITES) for c in SIGNALS]
    root = rng.normal(size=(len(epochs), STATES, STATES)) * 0.05 + np.eye(STATES)
    triangle = (root @ root.transpose(0, 2, 1))[(slice(None), *np.triu_indices(STATES))]
    states = ",".join(f"{group}_{axis}" for group in GROUPS for axis in "xyz")
    position = np.array([3.9e6, 0.3e6, 5.0e6]) + rng.normal(size=(len(epochs), 3))
    return {
        IMU.topic: (IMU, _columns(IMU, imu, {})),
        GNSS_OBS.at(receiver="rover"): (
            GNSS_OBS,
            _columns(GNSS_OBS, whole, {
                "satellite": Ragged.from_texts([s for s, _ in names] * seconds),
                "signal": Ragged.from_texts([c for _, c in names] * seconds),
                "pseudorange_m": 2.2e7 + rng.normal(size=len(whole)),
                "carrier_phase_cycles": 1.1e8 + rng.normal(size=len(whole)),
            }),
        ),
        FILTER_STATE.at(run="ekf"): (
            FILTER_STATE, _columns(FILTER_STATE, epochs, {"position_ecef_m": position})
        ),
        FILTER_COVARIANCE.at(run="ekf"): (
            FILTER_COVARIANCE,
            _columns(FILTER_COVARIANCE, epochs, {
                "dimension": np.full(len(epochs), STATES, dtype=np.uint32),
                "state_names": Ragged.from_texts([states] * len(epochs)),
                "upper_triangle": Ragged.from_matrix(triangle),
            }),
        ),
        SOLUTION.at(run="ekf"): (
            SOLUTION, _columns(SOLUTION, epochs, {
                "position_ecef_m": position,
                "status": np.full(len(epochs), 2, dtype=np.int32),
            })
        ),
    }  # fmt: skip


def _scaled(columns: Columns) -> Columns:
    """Every number a little greater, and one row in a thousand gone."""
    values = {
        name: Ragged(c.offsets, c.values * 1.000001)
        if isinstance(c, Ragged) and c.values.dtype.kind == "f"
        else c * 1.000001
        if isinstance(c, np.ndarray) and c.dtype.kind == "f"
        else c
        for name, c in columns.values.items()
    }
    keep = np.arange(len(columns)) % 1000 != 0
    return dataclasses.replace(columns, values=values).take(keep)


def _write(path: Path, run: dict[str, tuple[ChannelSpec, Columns]], *, scaled: bool) -> None:
    with LogWriter(path) as log:
        for topic, (spec, _) in run.items():
            log.add_channel(topic, spec.message)
        log.write({t: _scaled(c) if scaled else c for t, (_, c) in run.items()})


def _peer(path_a: Path, path_b: Path) -> None:
    """Compare message by message."""
    rows: list[dict[tuple[str, int, str], object]] = []
    for path in (path_a, path_b):
        found: dict[tuple[str, int, str], object] = {}
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            for _, channel, message, decoded in reader.iter_decoded_messages():
                key = f"{getattr(decoded, 'satellite', '')}{getattr(decoded, 'signal', '')}"
                found[channel.topic, message.publish_time, key] = decoded
        rows.append(found)
    a, b = rows
    differing = [key for key in a if key in b and a[key] != b[key]]
    len(differing), len(a.keys() - b.keys()), len(b.keys() - a.keys())


def _seconds(call: Callable[[], object], repeats: int) -> float:
    best = float("inf")
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - begin)
    return best


def main() -> None:
    """Print seconds and rows per second."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=3600, help="of log")
    parser.add_argument("--peer-seconds", type=int, default=120, help="of log, for the slow peer")
    parser.add_argument("--repeats", type=int, default=2)
    chosen = parser.parse_args()
    table = Table("case", "rows", "seconds", "rows/s")
    with tempfile.TemporaryDirectory() as folder:
        for seconds, label, peer in (
            (chosen.seconds, f"{chosen.seconds} s of log", False),
            (chosen.peer_seconds, f"{chosen.peer_seconds} s of log", True),
        ):
            paths = [Path(folder) / f"{name}{seconds}.mcap" for name in ("a", "same", "other")]
            run = _run(seconds)
            for path in paths:
                _write(path, run, scaled=path is paths[2])
            rows = sum(len(columns) for _, columns in run.values())
            cases = [
                (f"replay diff, {label}, equal", lambda p=paths: diff_logs(p[0], p[1])),
                (f"replay diff, {label}, every row differs", lambda p=paths: diff_logs(p[0], p[2])),
            ]
            if peer:
                cases.append(
                    (
                        f"mcap row by row, {label}, every row differs",
                        lambda p=paths: _peer(p[0], p[2]),
                    )
                )
            for name, call in cases:
                took = _seconds(call, chosen.repeats)
                table.add_row(name, str(rows), f"{took:.2f}", f"{rows / took:,.0f}")
    Console().print(table)


if __name__ == "__main__":
    main()
