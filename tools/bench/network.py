"""Rows about a network of reference stations: epochs per CPU second, and the study's time.

Run from the root of the checkout: ``python -m tools.bench --only network [--quick]``. The log
is the flight of case 1 after Lee (2010): a rover with an inertial unit of 64 Hz, four stations,
about ten satellites of GPS, two frequencies, 1 Hz; `--quick` flies the first three of its seven
lines and leaves the study out. The stations alone are six baselines with their integers, three
of them with filtered errors; the rover's run has three baselines, corrections and the tightly
coupled filter. `replay run` is a process of its own: whole, with its start, and by the
difference between the whole flight and half of it.

No program that is free to use does the same, so that there is no peer. As a yardstick RTKLIB's
`rtkpos` positions one of the stations against the master, 94 km away, on the same observations
and in this process: kinematic, two frequencies, with states for ionosphere and troposphere.
Beside it is what one baseline with its satellites costs here. Each does something that the
other does not: RTKLIB solves a position; the stage here knows both positions, fixes the wide
lane first, and tells what is left of the phases.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from replay import channels
from replay.batch.lee2010_degradation.members import AS_IS, SCENARIO, members
from replay.channels import GNSS_OBS, NAV, NETWORK_RESIDUALS
from replay.engine.job import make_job
from replay.engine.pipelines import find_pipeline
from replay.log.columns import Columns, concatenate
from replay.log.reader import LogReader
from replay.simulate import simulate
from replay.stages.base import BASE, Context, Port
from replay.time import NS_PER_S
from tools.bench.children import run_replay
from tools.bench.row import Row

MASTER, STATION = "mref", "ref1"
STATIONS = (MASTER, STATION, "ref2", "ref3")
AIM_STUDY_S = 60.0
ROUNDS = 3


def fastest(work: Callable[[], object]) -> float:
    """Shortest of some runs, CPU seconds of this process."""
    took = []
    for _ in range(ROUNDS):
        start = time.process_time()
        work()
        took.append(time.process_time() - start)
    return min(took)


def make_log(folder: Path, *, quick: bool) -> Path:
    """The flight."""
    path = folder / "flight.mcap"
    short = next(member for member in members() if member.label == AS_IS)
    simulate(SCENARIO, path, tables=short.tables if quick else ())
    return path


def run_stages(log: Path, stations: tuple[str, ...]) -> tuple[float, dict[str, Columns]]:
    """CPU seconds of the stages of `network`, columns in and columns out, and what came out."""
    with LogReader(log) as reader:
        setting = {"network": {"stations": list(stations)}}
        job = make_job(reader, "network", tables=[setting])
        rows = {NAV.name: reader.read(NAV.at())}
        for name in (MASTER, *stations):
            role = BASE if name == MASTER else name
            for spec in (GNSS_OBS, channels.RECEIVER):
                rows[Port(spec, role).name] = reader.read(spec.at(receiver=name))
        topics = list(reader.channels)
    stages = find_pipeline("network").stages(job.config, topics)

    def work() -> dict[str, Columns]:
        block = dict(rows)
        for stage in stages:
            state = stage.start(job.config, Context({}, rows))
            state, outputs = stage.step(state, block)
            late = stage.finish(state)
            for port in {**outputs, **late}:
                parts = [part[port] for part in (outputs, late) if port in part]
                block[port] = concatenate(parts)
        return block

    return fastest(work), work()


def bench_network(*, quick: bool) -> list[Row]:
    """The stations, the rover, RTKLIB's yardstick and the study."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = make_log(folder, quick=quick)
        rows = [*_stages_rows(log), *_yardstick(log)]
        for pipeline, words in (
            ("network", "four stations, six baselines"),
            ("network-ins-tc", "network, rover and inertial unit"),
        ):
            rows += _process_rows(pipeline, words, log, folder)
        if not quick:
            rows.append(_study_row(folder))
    return rows


def _stages_rows(log: Path) -> list[Row]:
    took, block = run_stages(log, STATIONS[1:])
    epochs = len(np.unique(block[Port(GNSS_OBS, BASE).name].valid_time_ns))
    pairs = sum(len(rows) for port, rows in block.items() if NETWORK_RESIDUALS.name in port)
    return [
        Row("network, stations' stages, no files", f"{epochs / took:,.0f} epochs/s"),
        Row(
            "network, the same, by double differences (pair of satellites, baseline, signal)",
            f"{pairs / took:,.0f} 1/s",
        ),
    ]


def _process_rows(pipeline: str, words: str, log: Path, folder: Path) -> list[Row]:
    """Rows about `replay run`, from a recorded log to a written one."""
    with LogReader(log) as reader:
        times = np.unique(reader.read(GNSS_OBS.at(receiver=MASTER)).valid_time_ns)
    half = len(times) // 2
    until = f"{int(times[half]) // NS_PER_S}"

    def cost(*more: str) -> tuple[float, int]:
        out = folder / "out.mcap"
        least = min(
            run_replay(["run", pipeline, str(log), "-o", str(out), *more]).cpu_s
            for _ in range(ROUNDS)
        )
        topic = channels.COARSE.at(receiver=MASTER)
        with LogReader(out) as reader:
            return least, reader.channels[topic].message_count

    (full_s, full), (half_s, part) = cost(), cost("--to", until)
    return [
        Row(f"{pipeline} ({words}), `replay run`, whole", f"{full / full_s:,.0f} epochs/s"),
        Row(
            f"{pipeline}, `replay run`, one more epoch",
            f"{(full - part) / (full_s - half_s):,.0f} epochs/s",
        ),
    ]


def _study_row(folder: Path) -> Row:
    words = ["study", "lee2010", "-o", str(folder / "study"), "--discard-logs"]
    run_replay(words)
    took = min(run_replay(words).wall_s for _ in range(2))
    return Row(
        "study lee2010, three cases in one command, two processes, warm",
        f"{took:.1f} s wall",
        aim=f"< {AIM_STUDY_S:g} s",
        met=took < AIM_STUDY_S,
    )


def _yardstick(log: Path) -> list[Row]:
    """One baseline here and by RTKLIB."""
    took, block = run_stages(log, (STATION,))
    epochs = len(np.unique(block[Port(GNSS_OBS, BASE).name].valid_time_ns))
    name = "network, one baseline with its satellites, no files"
    ours = f"{epochs / took:,.0f} epochs/s"
    try:
        from tools.bench.rtklib_baseline import Baseline
    except ImportError:
        return [Row(name, ours, "RTKLIB is not here")]
    with LogReader(log) as reader:
        baseline = Baseline(reader, STATION, MASTER)
    peer_s = fastest(partial(baseline.solve))
    return [
        Row(
            name,
            ours,
            f"yardstick, RTKLIB rtkpos: {baseline.epochs / peer_s:,.0f} epochs/s,"
            f" {100.0 * baseline.fixed / baseline.epochs:.0f} % fixed",
            epochs / took / (baseline.epochs / peer_s),
        )
    ]
