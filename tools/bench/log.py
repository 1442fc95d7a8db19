"""Speed of the log against the `mcap` package: one hour of a 200 Hz IMU.

Run from the root of the checkout: `python tools/bench/log.py`. Both sides check
checksums, use the same compression and chunk size and run in this process; the
time is the least of several runs. What the `mcap` package writes is given to it
as messages of the generated class, which have to be filled from the arrays and
serialized, as `LogWriter` has to; and once serialized beforehand.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rich.console import Console
from rich.table import Table

from replay.log import schema
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.log.writer import LogWriter
from replay.schemas.imu_pb2 import ImuSample

TOPIC = "/imu/raw"
MESSAGE = "replay.ImuSample"
START_NS = 1_300_000_000_000_000_000
BATCH = 65536
CHUNK_BYTES = 1 << 20


def imu(rows: int) -> Columns:
    """Rows of an IMU whose output is quantised, as every real one's is, on a moving platform."""
    rng = np.random.default_rng(0)
    phase = np.arange(rows)[:, None] * np.array([[0.0011, 0.0017, 0.0005]])
    rate = np.round((0.1 * np.sin(phase) + rng.normal(0, 1e-3, (rows, 3))) * 2**21) * 2.0**-21
    force = np.round((np.cos(phase) + rng.normal(0, 1e-2, (rows, 3))) * 2**16) * 2.0**-16
    return Columns.build(
        START_NS + np.arange(rows, dtype=np.int64) * 5_000_000,
        {
            "angular_rate_body_rad_s": rate,
            "specific_force_body_m_s2": force - np.array([0.0, 0.0, 9.8125]),
            "temperature_c": 30.0 + np.floor(np.arange(rows) / 2000.0) * 0.0625,
        },
    )


def write_ours(path: Path, columns: Columns, compression: str) -> None:
    """Columns to a log; its digests are computed on the way."""
    with LogWriter(path, compression=compression, chunk_bytes=CHUNK_BYTES) as writer:
        writer.add_channel(TOPIC, MESSAGE)
        for begin in range(0, len(columns), BATCH):
            writer.write({TOPIC: columns.take(slice(begin, begin + BATCH))})
        writer.digests()


def serialize(columns: Columns) -> list[bytes]:
    """Payloads by the generated class."""
    blobs = []
    rate, force = columns["angular_rate_body_rad_s"], columns["specific_force_body_m_s2"]
    rows = zip(rate.tolist(), force.tolist(), columns["temperature_c"].tolist(), strict=True)
    for (a, b, c), (d, e, f), temperature in rows:
        message = ImuSample(temperature_c=temperature)
        gyro, accel = message.angular_rate_body_rad_s, message.specific_force_body_m_s2
        gyro.x, gyro.y, gyro.z = a, b, c
        accel.x, accel.y, accel.z = d, e, f
        blobs.append(message.SerializeToString())
    return blobs


def write_theirs(path: Path, columns: Columns, blobs: list[bytes] | None, compression: str) -> None:
    """The same rows by `mcap.writer`, serialized here or beforehand."""
    kinds = {"lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD, "none": CompressionType.NONE}
    with path.open("wb") as file:
        writer = Writer(
            file, compression=kinds[compression], chunk_size=CHUNK_BYTES, enable_data_crcs=True
        )
        writer.start()
        schema_id = writer.register_schema(MESSAGE, "protobuf", schema.descriptor_set(MESSAGE))
        channel_id = writer.register_channel(TOPIC, "protobuf", schema_id)
        for k, (when, blob) in enumerate(
            zip(columns.log_time_ns.tolist(), blobs or serialize(columns), strict=True)
        ):
            writer.add_message(channel_id, when, blob, when, k)
        writer.finish()


def read_ours(path: Path, *, decode: bool) -> int:
    """Rows of a log, decoded to columns or left as payloads."""
    count = 0
    topics = [TOPIC] if decode else []
    keep = [] if decode else [TOPIC]
    with LogReader(path) as reader:
        for batch in reader.batches(decode=topics, payloads=keep, target_rows=BATCH):
            count += len(batch[TOPIC])
    return count


def read_theirs(path: Path, *, decode: bool) -> int:
    """The same by `mcap.reader`, parsed by the generated class or not."""
    count = 0
    with path.open("rb") as file:
        for _, _, message in make_reader(file, validate_crcs=True).iter_messages():
            if decode:
                ImuSample.FromString(message.data)
            count += 1
    return count


def least(action: Callable[[], object], runs: int) -> float:
    """Least time of several runs [s]."""
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        action()
        times.append(time.perf_counter() - begin)
    return min(times)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=720_000)
    parser.add_argument("--runs", type=int, default=7, help="of ours")
    parser.add_argument("--peer-runs", type=int, default=2, help="of the mcap package")
    parser.add_argument("--compression", nargs="*", default=["zstd", "lz4", "none"])
    arguments = parser.parse_args()
    columns = imu(arguments.rows)
    blobs = serialize(columns)
    table = Table(title=f"{arguments.rows} rows of {MESSAGE}, chunks of {CHUNK_BYTES >> 10} KiB")
    headings = ("compression", "what", "ours [M rows/s]", "mcap [M rows/s]", "ratio", "file [MB]")
    for heading in headings:
        table.add_column(heading, justify="left" if heading in headings[:2] else "right")
    with tempfile.TemporaryDirectory() as scratch:
        for compression in arguments.compression:
            path, other = Path(scratch) / "ours.mcap", Path(scratch) / "theirs.mcap"

            def ours_write(path: Path = path, compression: str = compression) -> None:
                write_ours(path, columns, compression)

            written = least(ours_write, arguments.runs)
            size = f"{path.stat().st_size / 1e6:.1f}"
            for what, given in (("write from values", None), ("write, mcap from bytes", blobs)):

                def theirs_write(
                    given: list[bytes] | None = given,
                    other: Path = other,
                    compression: str = compression,
                ) -> None:
                    write_theirs(other, columns, given, compression)

                peer = least(theirs_write, arguments.peer_runs)
                add(table, compression, what, arguments.rows, written, peer, size)
            for what, decode in (("read, decoded", True), ("read, payloads", False)):
                mine = least(lambda path=path, d=decode: read_ours(path, decode=d), arguments.runs)
                peer = least(
                    lambda path=path, d=decode: read_theirs(path, decode=d), arguments.peer_runs
                )
                add(table, compression, what, arguments.rows, mine, peer, size)
    Console().print(table)


def add(
    table: Table, compression: str, what: str, rows: int, mine: float, peer: float, size: str
) -> None:
    """One line of the table."""
    ratio = f"{peer / mine:.0f}"
    table.add_row(
        compression, what, f"{rows / mine / 1e6:.2f}", f"{rows / peer / 1e6:.3f}", ratio, size
    )


if __name__ == "__main__":
    main()
