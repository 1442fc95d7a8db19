"""Short simulated drives, and ways to replay, cut and rewrite them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from replay import channels, configuration
from replay.engine.job import Job, make_job
from replay.engine.replayer import Replayer, Result
from replay.engine.run import replay_log
from replay.engine.sink import DigestSink
from replay.log import codec
from replay.log.columns import Columns, Ragged, concatenate
from replay.log.reader import LogReader
from replay.log.writer import LogWriter
from replay.schemas import filter_pb2
from replay.simulate import make_channels, read_scenario, simulate, write_log
from replay.simulate.defaults import fitting_defaults
from replay.stages.base import Context
from replay.stages.gnss_ins_lc import GnssInsLoose
from replay.stages.loose_config import LooseConfig

PIPELINE = "gnss-ins-lc"
IMU = channels.IMU.topic
FIX = channels.GNSS_FIX.at(receiver="rover")
TRUTH = channels.TRUTH.topic
TRACE = channels.TRACE.topic
CHECKPOINT = channels.CHECKPOINT.topic
SOLUTION = channels.SOLUTION.at(run=PIPELINE)
EVENTS = channels.FILTER_EVENTS.at(run=PIPELINE)
STATE = channels.FILTER_STATE.at(run=PIPELINE)
COVARIANCE = channels.FILTER_COVARIANCE.at(run=PIPELINE)
INNOVATIONS = channels.FILTER_INNOVATIONS.at(run=PIPELINE)
OUTPUTS = sorted([SOLUTION, EVENTS, STATE, COVARIANCE, INNOVATIONS, TRACE])
TOWN = Path(__file__).parents[2] / "recordings" / "drive" / "scenario.toml"
SECOND = 1_000_000_000

# Everything that the filter knows: stops, an outage, turns, 21 states and the vehicle's five.
FULL = {
    "filter": {"states": 21, "gyro_scale_sigma": 2e-3, "accel_scale_sigma": 2e-3},
    "non_holonomic": {
        "enabled": True,
        "mounting": True,
        "mounting_noise": 1e-5,
        "estimate_lever_arm": True,
        "estimate_squat": True,
        "lever_arm": [0.2, 0.0, 0.5],
    },
}


def short_scenario(**over: Any) -> dict[str, Any]:
    """A minute: rest, a drive with an outage in a turn, a stop, a second drive."""
    table: dict[str, Any] = {
        "seed": 11,
        "start": {"latitude": "52 deg", "longitude": "4.4 deg", "heading": "35 deg"},
        "vehicle": {"roll_per_g": "3 deg", "pitch_per_g": "2 deg"},
        "imu": {"rate": 50.0, "grade": "industrial"},
        "gnss": {"rate": 4.0, "lever_arm": [-0.4, 0.15, -1.2], "outages": [[24.0, 29.0]]},
        "truth": {"rate": 5.0},
        "segments": [
            {"kind": "hold", "duration": 9.0},
            {"kind": "speed", "to": 12.0, "acceleration": 2.0},
            {"kind": "straight", "duration": 4.0},
            {"kind": "turn", "angle": "80 deg", "radius": 25.0},
            {"kind": "speed", "to": 0.0, "acceleration": 2.0},
            {"kind": "hold", "duration": 6.0},
            {"kind": "speed", "to": 10.0, "acceleration": 2.0},
            {"kind": "turn", "angle": "-70 deg", "radius": 25.0},
            {"kind": "straight", "duration": 3.0},
        ],
    }
    configuration.merge(table, over)
    return table


def short_rows(**over: Any) -> dict[str, Columns]:
    """Channels of :func:`short_scenario`."""
    return make_channels(read_scenario(short_scenario(**over)))


def short_config(
    *tables: Mapping[str, Any], scenario: Mapping[str, Any] | None = None
) -> LooseConfig:
    """Settings that fit a scenario, the short one by default, and `tables` over them."""
    made = read_scenario(scenario or short_scenario())
    return configuration.build(LooseConfig, [fitting_defaults(made.settings), *tables])


@pytest.fixture(scope="session")
def short_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Log of :func:`short_scenario`."""
    path = tmp_path_factory.mktemp("short") / "in.mcap"
    write_log(read_scenario(short_scenario()), path)
    return path


@pytest.fixture(scope="session")
def short_run(short_log: Path) -> Path:
    """Log of a run over `short_log`, with its own settings."""
    path = short_log.with_name("run.mcap")
    run_to_file(short_log, path)
    return path


def job_of(reader: LogReader, *tables: Mapping[str, Any], **more: Any) -> Job:
    """A job of the one pipeline."""
    return make_job(reader, PIPELINE, tables=list(tables), **more)


def run_to_file(
    source: Path, target: Path, *tables: Mapping[str, Any], resume: Path | None = None, **more: Any
) -> Result:
    """Replay into a log."""
    with LogReader(source) as reader:
        return replay_log(reader, target, job_of(reader, *tables, **more), resume=resume)


def run_digests(
    source: Path,
    *tables: Mapping[str, Any],
    reader: Callable[[Path], LogReader] = LogReader,
    **more: Any,
) -> dict[str, str]:
    """Digest of every channel that a replay makes."""
    with reader(source) as opened:
        result = Replayer(opened, job_of(opened, *tables, **more)).run(DigestSink())
    return {topic: digest.sha256 for topic, digest in result.outputs.items()}


def long_drive(target: Path) -> float:
    """Write 25 minutes at 200 Hz with outages; the seconds that it is long."""
    tables = [
        {
            "repeat": 5,
            "imu": {"rate": 200.0},
            "truth": {"rate": 1.0},
            "gnss": {"outages": [[168.0, 183.0], [640.0, 660.0], [1150.0, 1180.0]]},
        }
    ]
    return simulate(TOWN, target, tables=tables).duration_s


def rewrite(
    source: Path,
    target: Path,
    edit: Callable[[dict[str, Columns]], Mapping[str, Columns]],
    *,
    metadata: bool = True,
) -> Path:
    """Copy a log with its rows edited; rows that have no payloads are encoded anew."""
    with LogReader(source) as reader, LogWriter(target) as writer:
        rows = {topic: reader.read(topic, payloads=True) for topic in reader.channels}
        edited = edit(rows)
        for topic in edited:
            spec = channels.find(topic)
            assert spec is not None
            depth = reader.channels[topic].depth if topic in reader.channels else 0
            writer.add_channel(topic, spec.message, depth=depth)
        if metadata:
            for record in reader.metadata_records:
                writer.add_metadata(record.name, record.values)
        writer.write(edited)
    return target


def changed(columns: Columns, field: str, row: int, value: Any) -> Columns:
    """Rows with one value replaced, to be encoded anew."""
    column = columns[field].copy()
    column[row] = value
    return dataclasses.replace(columns, values={**columns.values, field: column}, payloads=None)


def shifted(columns: Columns, row: int, *, valid_ns: int = 0, log_ns: int = 0) -> Columns:
    """Rows with the times of one moved."""
    valid, log = columns.valid_time_ns.copy(), columns.log_time_ns.copy()
    valid[row] += valid_ns
    log[row] += log_ns
    moved = dataclasses.replace(columns, valid_time_ns=valid, log_time_ns=log)
    return moved.take(np.argsort(log, kind="stable").astype(np.int64))


class StageRun:
    """The stage alone over rows in memory.

    Parameters
    ----------
    rows : mapping of topic to Columns
        Inertial samples and fixes, and maybe others.
    config : LooseConfig
    edges : sequence of int, ns
        Log times after which a block ends.
    """

    def __init__(
        self, rows: Mapping[str, Columns], config: LooseConfig, edges: Iterable[int] = ()
    ) -> None:
        self.stage = GnssInsLoose()
        inputs = {channels.IMU.name: rows[IMU], channels.GNSS_FIX.name: rows[FIX]}
        heads = {name: columns.take(slice(0, 1024)) for name, columns in inputs.items()}
        topics = {channels.IMU.name: IMU, channels.GNSS_FIX.name: FIX}
        self.state = self.stage.start(config, Context(topics, heads))
        parts: dict[str, list[Columns]] = {}
        self.blocks = cut(inputs, edges)
        for block in self.blocks:
            self.state, outputs = self.stage.step(self.state, block)
            for name, columns in outputs.items():
                parts.setdefault(name, []).append(columns)
        for name, columns in self.stage.finish(self.state).items():
            parts.setdefault(name, []).append(columns)
        self.outputs = {name: concatenate(pieces) for name, pieces in parts.items()}

    def bytes(self) -> dict[str, tuple[bytes, ...]]:
        """Times, numbers and payloads of every output channel."""
        return {name: content(name, columns) for name, columns in sorted(self.outputs.items())}

    def events(self) -> list[tuple[int, int, float, str]]:
        """Valid time, kind, value and text of each event."""
        rows = self.outputs[channels.FILTER_EVENTS.name]
        return list(
            zip(
                rows.valid_time_ns.tolist(),
                rows["kind"].tolist(),
                rows["value"].tolist(),
                rows.ragged("detail").texts(),
                strict=True,
            )
        )

    def events_of(self, kind: str) -> list[tuple[int, int, float, str]]:
        """Events of one kind, by the end of its name in the schema."""
        number = filter_pb2.EventKind.Value(f"EVENT_KIND_{kind}")
        return [event for event in self.events() if event[1] == number]

    @property
    def solution(self) -> Columns:
        return self.outputs[channels.SOLUTION.name]

    @property
    def states(self) -> Columns:
        return self.outputs[channels.FILTER_STATE.name]

    @property
    def covariances(self) -> np.ndarray:
        """(n, states, states), full."""
        rows = self.outputs[channels.FILTER_COVARIANCE.name]
        size = int(rows["dimension"][0])
        triangles = rows.ragged("upper_triangle").values.reshape(len(rows), -1)
        full = np.zeros((len(rows), size, size))
        upper = np.triu_indices(size)
        full[:, upper[0], upper[1]] = triangles
        full[:, upper[1], upper[0]] = triangles
        return full

    def finite(self) -> bool:
        """Whether every number of every output is finite."""
        for columns in self.outputs.values():
            for column in columns.values.values():
                values = column.values if isinstance(column, Ragged) else column
                if values.dtype.kind == "f" and not np.isfinite(values).all():
                    return False
        return True


def content(name: str, columns: Columns) -> tuple[bytes, ...]:
    """Times, numbers and payloads of some rows."""
    spec = {s.name: s for s in channels.CHANNELS}[name]
    payloads = codec.codec_for(spec.message).encode(columns)
    times = (columns.log_time_ns, columns.valid_time_ns)
    return (*(part.tobytes() for part in times), *payloads.blobs())


def cut(inputs: Mapping[str, Columns], edges: Iterable[int]) -> list[dict[str, Columns]]:
    """Blocks that end after each of some log times."""
    ends = sorted({*edges, max(int(c.log_time_ns[-1]) for c in inputs.values())})
    blocks = []
    places = {
        name: np.searchsorted(columns.log_time_ns, ends, side="right")
        for name, columns in inputs.items()
    }
    starts = dict.fromkeys(inputs, 0)
    for index in range(len(ends)):
        block = {}
        for name, columns in inputs.items():
            stop = int(places[name][index])
            if stop > starts[name]:
                block[name] = columns.take(slice(starts[name], stop))
            starts[name] = stop
        blocks.append(block)
    return blocks


def log_times(rows: Mapping[str, Columns]) -> np.ndarray:
    """Every log time of the stage's inputs, once."""
    return np.unique(np.concatenate([rows[IMU].log_time_ns, rows[FIX].log_time_ns]))


def between(rows: Mapping[str, Columns], start_ns: int, end_ns: int) -> dict[str, Columns]:
    """Rows by log time, half open."""
    return {
        topic: columns.take((columns.log_time_ns >= start_ns) & (columns.log_time_ns < end_ns))
        for topic, columns in rows.items()
    }


def first_difference(a: Sequence[Any], b: Sequence[Any]) -> int:
    """Place of the first difference; the length where there is none."""
    for index, (left, right) in enumerate(zip(a, b, strict=False)):
        if left != right:
            return index
    return min(len(a), len(b))
