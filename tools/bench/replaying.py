"""Rows about `replay run`: the whole process, cold and warm, its memory, and the filter alone.

The log is the simulated drive over and over at 200 Hz with one fix a second; its settings
are those that the log brings along, so that stops and wheels are used. The filter alone
runs with fixes only, as its peer does: see :mod:`tools.bench.numpy_filter`.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from replay.channels import GNSS_FIX, IMU, TRUTH
from replay.configuration import parse_assignments
from replay.engine.job import make_job
from replay.evaluate.geometry import body_to_enu, enu_axes, symmetric
from replay.kernels import loose
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.simulate import simulate
from replay.stages.base import Context
from replay.stages.gnss_ins_lc import GnssInsLoose
from replay.stages.loose_config import LooseConfig
from replay.time import NS_PER_S
from tools.bench.children import Cost, run_replay
from tools.bench.numpy_filter import NumpyFilter
from tools.bench.row import Row

SCENARIO = Path(__file__).resolve().parents[2] / "recordings" / "drive" / "scenario.toml"
PIPELINE = "gnss-ins-lc"
DRIVE_S = 300
FIXES_ONLY = ["non_holonomic.enabled=false", "stops.zero_velocity=false", "stops.zero_rate=false"]
PEER_SAMPLES = 20_000
PEER_PIECE = 1_000  # samples; the fastest piece counts
PEER_START_S = 60  # the car is under way
BLOCK_ROWS = 65536
HOUR_SAMPLES = 720_000
AIM_WALL_S = 4.0
AIM_STEP_US = 2.0
AIM_STEP_RATIO = 50.0
AIM_GROWTH = 1.2
AIM_RESIDENT_MB = 600.0


def make_log(folder: Path, seconds: int) -> Path:
    """The simulated drive over and over."""
    path = folder / f"{seconds}.mcap"
    table = {
        "repeat": seconds // DRIVE_S,
        "imu": {"rate": 200.0},
        "gnss": {"rate": 1.0, "outages": []},
        "truth": {"rate": 1.0},
    }
    simulate(SCENARIO, path, tables=[table])
    return path


def bench_process(*, quick: bool) -> list[Row]:
    """A whole `replay run` with an empty compile cache and with a full one."""
    seconds = 600 if quick else 3600
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        source = make_log(folder, seconds)
        words = ["run", PIPELINE, str(source), "-o", str(folder / "run.mcap")]
        if not quick:
            cold = run_replay(words, {"NUMBA_CACHE_DIR": str(folder / "cache")})
            rows.append(Row("run, 1 h at 200 Hz, cold cache", _times(cold)))
        run_replay(words)
        warm = min((run_replay(words) for _ in range(3)), key=lambda cost: cost.wall_s)
    aim = "" if quick else f"wall < {AIM_WALL_S:g} s"
    met = None if quick else warm.wall_s < AIM_WALL_S
    name = f"run, {seconds / 3600:.2g} h at 200 Hz, warm"
    return [*rows, Row(name, _times(warm), aim=aim, met=met)]


def bench_memory(*, quick: bool) -> list[Row]:
    """Peak memory of a run over a log and over one four times as long."""
    short_s, long_s = (600, 2400) if quick else (3600, 14400)
    costs: list[Cost] = []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for seconds in (short_s, long_s):
            source = make_log(folder, seconds)
            output = folder / "run.mcap"
            costs.append(run_replay(["run", PIPELINE, str(source), "-o", str(output)]))
            source.unlink()
    short, long = costs
    spans = f"{long_s / 3600:.2g} h log"
    other = f"{short_s / 3600:.2g} h log"
    rows = []
    for what, mine, peer in (
        ("resident, mapped log included", long.resident_mb, short.resident_mb),
        ("its own pages", long.own_mb, short.own_mb),
    ):
        ratio = mine / peer
        rows.append(
            Row(
                f"memory, {spans}: {what}",
                f"{mine:.0f} MB",
                f"{other}: {peer:.0f} MB",
                ratio,
                "" if quick else f"ratio ≤ {AIM_GROWTH:g}, < {AIM_RESIDENT_MB:.0f} MB",
                None if quick else ratio <= AIM_GROWTH and mine < AIM_RESIDENT_MB,
            )
        )
    return rows


def bench_filter(*, quick: bool) -> list[Row]:
    """The filter alone: nanoseconds a sample in the kernel, against dense numpy."""
    with tempfile.TemporaryDirectory() as scratch:
        source = make_log(Path(scratch), 600 if quick else 3600)
        peer_us, peer_error_m = _peer(source, 4_000 if quick else PEER_SAMPLES)
        peer = f"numpy, 21 states: {peer_us:.0f} us ({peer_us * HOUR_SAMPLES / 1e6:.0f} s an hour)"
        rows = []
        for states in (15, 21):
            step_us = _kernel(source, [f"filter.states={states}", *FIXES_ONLY])
            ours = f"{step_us:.2f} us a sample ({step_us * HOUR_SAMPLES / 1e6:.2f} s an hour)"
            name = f"filter alone, {states} states, fixes only"
            if states == 15:
                rows.append(Row(name, ours))
                continue
            ratio = peer_us / step_us
            aim = f"< {AIM_STEP_US:g} us, ratio ≥ {AIM_STEP_RATIO:g}"
            met = step_us < AIM_STEP_US and ratio >= AIM_STEP_RATIO
            rows.append(Row(name, ours, peer, ratio, aim, met))
        step_us = _kernel(source, [])
        rows.append(Row("filter alone, 21 states, stops and wheels", f"{step_us:.2f} us a sample"))
        rows.append(
            Row("    the peer's horizontal error against truth", f"{peer_error_m:.3f} m rms")
        )
    return rows


def _times(cost: Cost) -> str:
    return f"{cost.wall_s:.2f} s wall, {cost.cpu_s:.2f} s CPU"


def _job(reader: LogReader, settings: list[str]) -> LooseConfig:
    config = make_job(reader, PIPELINE, tables=[parse_assignments(settings)]).config
    assert isinstance(config, LooseConfig)
    return config


def _kernel(source: Path, settings: list[str]) -> float:
    """Microseconds an inertial sample in the compiled loop; the least of three runs."""
    with LogReader(source) as reader:
        config = _job(reader, settings)
        fixes = next(topic for topic in reader.channels if GNSS_FIX.matches(topic))
        topics = {IMU.name: IMU.topic, GNSS_FIX.name: fixes}
        names = {topic: name for name, topic in topics.items()}
        blocks = [
            {names[topic]: rows for topic, rows in batch.items()}
            for batch in reader.batches(list(names), target_rows=BLOCK_ROWS)
        ]
    heads = {name: next(b[name] for b in blocks if name in b) for name in topics}
    samples = sum(len(block[IMU.name]) for block in blocks)
    best = float("inf")
    for _ in range(3):
        spent = 0.0
        compiled = loose.run_block

        def timed(*arguments: Any, compiled: Any = compiled) -> Any:
            nonlocal spent
            begin = time.perf_counter()
            taken = compiled(*arguments)
            spent += time.perf_counter() - begin
            return taken

        stage = GnssInsLoose()
        state = stage.start(config, Context(topics, heads))
        with mock.patch.object(loose, "run_block", timed):
            for block in blocks:
                state, _ = stage.step(state, block)
        best = min(best, spent)
    return best / samples * 1e6


def _peer(source: Path, samples: int) -> tuple[float, float]:
    """Microseconds a sample of the numpy filter, and its rms error against truth, m."""
    with LogReader(source) as reader:
        config = _job(reader, FIXES_ONLY)
        start_ns = reader.start_ns // NS_PER_S * NS_PER_S + PEER_START_S * NS_PER_S
        end_ns = start_ns + samples * (NS_PER_S // 200) + 1
        span = {"start_ns": start_ns, "end_ns": end_ns}
        imu = reader.read(IMU.topic, **span)
        topic = next(topic for topic in reader.channels if GNSS_FIX.matches(topic))
        fixes, truth = reader.read(topic, **span), reader.read(TRUTH.topic, **span)
    axes = enu_axes(truth["position_ecef_m"])
    peer = NumpyFilter(
        config,
        np.array(truth["position_ecef_m"][0]),
        axes[0].T @ truth["velocity_enu_m_s"][0],
        axes[0].T @ body_to_enu(truth["attitude_rad"])[0],
    )
    R_r, R_v = (
        _in_ecef(fixes, "position_covariance_enu_m2"),
        _in_ecef(fixes, "velocity_covariance_enu_m2_s2"),
    )
    at = {int(t): k for k, t in enumerate(fixes.valid_time_ns)}
    known = {int(t): k for k, t in enumerate(truth.valid_time_ns)}
    rates, forces = imu["angular_rate_body_rad_s"], imu["specific_force_body_m_s2"]
    errors = []
    last_ns = start_ns
    marks = []
    for k, t in enumerate(imu.valid_time_ns.tolist()):
        if k % PEER_PIECE == 0:
            marks.append(time.perf_counter())
        if t > last_ns:
            peer.propagate(rates[k], forces[k], (t - last_ns) * 1e-9)
            last_ns = t
        if t in at and t > start_ns:
            n = at[t]
            peer.fix(
                fixes["position_ecef_m"][n],
                fixes["velocity_ecef_m_s"][n],
                fixes["antenna_lever_arm_body_m"][n],
                R_r[n],
                R_v[n],
            )
            if t in known:
                n = known[t]
                errors.append(axes[n] @ (peer.r - truth["position_ecef_m"][n]))
    fastest = float(np.diff(marks).min()) / PEER_PIECE
    horizontal = np.array(errors)[:, :2]
    return fastest * 1e6, float(np.sqrt(np.mean((horizontal**2).sum(axis=1))))


def _in_ecef(fixes: Columns, field: str) -> np.ndarray:
    """Covariances (n, 3, 3) in ECEF."""
    axes = enu_axes(fixes["position_ecef_m"])
    return np.asarray(axes.transpose(0, 2, 1) @ symmetric(fixes[field]) @ axes)
