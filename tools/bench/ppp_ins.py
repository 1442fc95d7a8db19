"""Rows about `ppp-ins-tc`: an hour at 200 Hz as a whole process, and a step and an epoch of it.

Run from the root of the checkout: ``python -m tools.bench --only ppp-ins [--quick]``. The log
is the simulated drive of the study `kan2022`, a town at 1 Hz on two frequencies with an
inertial unit of 200 Hz and precise products, driven twice; with scale factors, GPS and
Galileo the filter has between 45 and 80 states.

The peer is the same arithmetic as a person would write it with numpy, on random numbers of
the same sizes: the dense product Phi P Phi' + Q at every sample, Joseph's form of each
scalar measurement at every epoch. It does no more than that: no strapdown, no satellites.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from replay import channels
from replay.log.reader import LogReader
from replay.simulate import simulate
from replay.time import NS_PER_S
from tools.bench.children import Cost, run_replay
from tools.bench.row import Row

SCENARIO = Path(__file__).resolve().parents[2] / "replay" / "batch" / "kan2022" / "drive.toml"
PIPELINE = "ppp-ins-tc"
SETTINGS = ("filter.states=21",)
HOUR_S = 3600
RATE_HZ = 200
AIM_WALL_S = 15.0
ROUNDS = 3
_SCALARS_A_STATE = 1.0
"""Scalar measurements of an epoch over states: code, phase, Doppler on two frequencies of a
satellite against its slant delay and two ambiguities, beside the states that all share."""
PEER_STEPS = 2000
PEER_EPOCHS = 20


def make_log(folder: Path) -> Path:
    """The drive twice, which is an hour and a little."""
    path = folder / "drive.mcap"
    table = {
        "repeat": 2,
        "sky": {"systems": "GE"},
        "receiver": {"signals": ["G1C", "G2W", "E1C", "E5Q"]},
        "truth": {"rate": 1.0, "signals": False},
    }
    simulate(SCENARIO, path, tables=[table])
    return path


def bench_ppp_ins(*, quick: bool) -> list[Row]:
    """The whole process and, by the difference, what one more second costs."""
    seconds = 900 if quick else HOUR_S
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log, out = make_log(folder), folder / "out.mcap"
        with LogReader(log) as reader:
            start = int(reader.read(channels.TRUTH.topic).valid_time_ns[0]) // NS_PER_S
        words = ["run", PIPELINE, str(log), "-o", str(out)]
        for setting in SETTINGS:
            words += ["--set", setting]
        run_replay([*words, "--to", f"{start + seconds // 2}"])

        def cheapest(length: int) -> Cost:
            until = [*words, "--to", f"{start + length}"]
            return min((run_replay(until) for _ in range(ROUNDS)), key=lambda cost: cost.cpu_s)

        part, whole = cheapest(seconds // 2), cheapest(seconds)
        states = _states(out)
    more = (whole.cpu_s - part.cpu_s) / (seconds - seconds // 2)
    step_s, scalar_s = _peer(states)
    scalars = _SCALARS_A_STATE * states
    peer = RATE_HZ * step_s + scalars * scalar_s
    hour = whole.wall_s * HOUR_S / seconds if quick else whole.wall_s
    return [
        Row(
            f"{PIPELINE}, {seconds // 60} min of {RATE_HZ} Hz and 1 Hz, {states} states,"
            " `replay run`, warm",
            f"{whole.wall_s:.1f} s wall, {whole.cpu_s:.1f} s CPU",
            aim=f"an hour < {AIM_WALL_S:g} s",
            met=hour < AIM_WALL_S,
        ),
        Row(
            f"{PIPELINE}, one more second of it",
            f"{1e3 * more:.2f} ms",
            f"numpy, the covariance alone: {1e3 * peer:.1f} ms",
            peer / more,
        ),
    ]


def _states(out: Path) -> int:
    """Most error states at once: those of the unit and the receiver, three of each satellite."""
    with LogReader(out) as reader:
        covariance = reader.read(channels.FILTER_COVARIANCE.at(run=PIPELINE))
        phases = reader.read(channels.FILTER_PHASES.at(run=PIPELINE))
        slants = reader.read(channels.FILTER_IONOSPHERE.at(run=PIPELINE))
    common = 6  # clock, drift, another system's clock, wet delay, two gradients
    most = sum(
        int(np.unique(rows.valid_time_ns, return_counts=True)[1].max()) for rows in (phases, slants)
    )
    return int(covariance["dimension"][0]) + common + most


def _peer(states: int) -> tuple[float, float]:
    """CPU seconds of one propagation and of one scalar update with dense matrices."""
    random = np.random.default_rng(1)
    P, Phi, Q = np.eye(states), np.eye(states), 1e-6 * np.eye(states)
    Phi[:9, :21] += 1e-3 * random.normal(size=(9, 21))
    begin = time.process_time()
    for _ in range(PEER_STEPS):
        P = Phi @ P @ Phi.T + Q
    step = (time.process_time() - begin) / PEER_STEPS
    P, one = np.eye(states), np.eye(states)
    begin = time.process_time()
    for _ in range(PEER_EPOCHS):
        for h in random.normal(size=(states, states)):
            b = P @ h
            K = b / (h @ b + 1.0)
            left = one - np.outer(K, h)
            P = left @ P @ left.T + np.outer(K, K)
    return step, (time.process_time() - begin) / (PEER_EPOCHS * states)
