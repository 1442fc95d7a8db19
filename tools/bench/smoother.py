"""Rows about smoothing: nodes per second against the textbook's recursion in numpy.

Run from the root of the checkout: ``python -m tools.bench --only smoother [--quick]``. The nodes
are those of random filters with 21 and with 60 states, one of which in ten is without an
update as a predicted solution is; the peer solves the same ones with `numpy.linalg`, in this
process. `replay run smooth` is a process of its own over an hour of the loosely coupled filter.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.log.columns import Columns, Ragged
from replay.log.reader import LogReader
from replay.stages.smooth import smooth_backwards
from tools.bench.children import run_replay
from tools.bench.replaying import PIPELINE, make_log
from tools.bench.row import Row, speed_row

Array = np.ndarray[Any, Any]
STATES = (21, 60)
NODES = 600
ROUNDS = 3
PLAIN_EVERY = 10  # nodes, one of which has no update
AIM_RATIO = 1.0
AIM_HOUR_S = 20.0


def make_nodes(states: int) -> Columns:
    """Nodes of a filter whose states all have to do with each other."""
    random = np.random.default_rng(states)
    P = np.eye(states)
    rows: dict[str, list[Array]] = {
        name: []
        for name in ("row", "column", "value", "predicted_upper_triangle", "correction",
                     "updated_upper_triangle", "estimate")
    }  # fmt: skip
    upper = np.triu_indices(states)
    for k in range(NODES):
        phi = np.eye(states)
        phi[:9, : min(21, states)] += 0.05 * random.normal(size=(9, min(21, states)))
        prior = 0.9 * phi @ P @ phi.T + 0.1 * np.eye(states)
        prior = (prior + prior.T) / 2.0
        places = np.nonzero(phi)
        rows["row"].append(places[0].astype(np.uint32))
        rows["column"].append(places[1].astype(np.uint32))
        rows["value"].append(phi[places])
        rows["predicted_upper_triangle"].append(prior[upper])
        rows["estimate"].append(np.zeros(states))
        if k % PLAIN_EVERY == 0:
            P = prior
            rows["correction"].append(np.zeros(0))
            rows["updated_upper_triangle"].append(np.zeros(0))
            continue
        h = random.normal(size=(12, states))
        gain = np.linalg.solve(h @ prior @ h.T + np.eye(12), h @ prior).T
        P = prior - gain @ h @ prior
        P = (P + P.T) / 2.0
        rows["correction"].append(gain @ random.normal(size=12))
        rows["updated_upper_triangle"].append(P[upper])
    times = np.arange(NODES, dtype=np.int64) * 1_000_000_000
    dimension = np.full(NODES, states, dtype=np.uint32)
    before = dimension.copy()
    before[0] = 0
    for name in ("row", "column", "value"):
        rows[name][0] = rows[name][0][:0]
    return Columns.build(
        times,
        {
            "since_ns": np.concatenate([times[:1], times[:-1]]),
            "dimension": dimension,
            "dimension_before": before,
            "solution": np.ones(NODES, dtype=np.uint32),
            **{name: _ragged(parts) for name, parts in rows.items()},
        },
    )


def _ragged(parts: list[Array]) -> Ragged:
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int64)
    return Ragged(offsets, np.concatenate(parts))


def textbook(nodes: Columns) -> tuple[Array, Array]:
    """Smoothed errors and covariance of the first node, by Rauch, Tung and Striebel."""
    n = int(nodes["dimension"][0])
    upper = np.triu_indices(n)

    def symmetric(triangle: Array) -> Array:
        P = np.zeros((n, n))
        P[upper] = triangle
        return P + np.triu(P, 1).T

    x, S = np.zeros(n), np.zeros((n, n))
    for k in range(len(nodes) - 1, -1, -1):
        prior = symmetric(nodes.ragged("predicted_upper_triangle").row(k))
        after = nodes.ragged("updated_upper_triangle").row(k)
        P = symmetric(after) if len(after) else prior
        if k == len(nodes) - 1:
            S = P
        else:
            phi = np.zeros((n, n))
            phi[nodes.ragged("row").row(k + 1), nodes.ragged("column").row(k + 1)] = nodes.ragged(
                "value"
            ).row(k + 1)
            later = symmetric(nodes.ragged("predicted_upper_triangle").row(k + 1))
            correction = nodes.ragged("correction").row(k + 1)
            ahead = x + correction if len(correction) else x
            gain = np.linalg.solve(later, phi @ P).T
            x = gain @ ahead
            S = P + gain @ (S - later) @ gain.T
    return x, S


def _fastest(work: Any, nodes: Columns) -> float:
    took = []
    for _ in range(ROUNDS):
        start = time.process_time()
        work(nodes)
        took.append(time.process_time() - start)
    return len(nodes) / min(took)


def _ours(nodes: Columns) -> Any:
    return smooth_backwards(iter([nodes]), "bench").take(1)


def bench_smoother(*, quick: bool) -> list[Row]:
    """Nodes of two sizes, and an hour's run."""
    rows = []
    for states in STATES:
        nodes = make_nodes(states)
        found, (x, S) = _ours(nodes), textbook(nodes)
        upper = np.triu_indices(9)
        shown = S[upper] if found.shown[0] == len(upper[0]) else S[:9, :9][upper]
        np.testing.assert_allclose(found.errors, x, atol=1e-9)
        np.testing.assert_allclose(found.covariances[: len(shown)], shown, atol=1e-9)
        ours, peer = _fastest(_ours, nodes), _fastest(textbook, nodes)
        name = f"smoothing, {states} states"
        rows.append(speed_row(name, "nodes/s", ours, peer, "numpy", AIM_RATIO))
    seconds = 600 if quick else 3600
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        source, run = make_log(folder, seconds), folder / "run.mcap"
        with LogReader(source) as reader:
            tables = [{"smoothing": {"record": True}}]
            replay_log(reader, run, make_job(reader, PIPELINE, tables=tables))
        words = ["run", "smooth", str(run), "-o", str(folder / "smoothed.mcap")]
        run_replay(words)
        cost = min((run_replay(words) for _ in range(2)), key=lambda c: c.wall_s)
        size = run.stat().st_size / 1e6
    rows.append(
        Row(
            f"run smooth, {seconds / 3600:.2g} h, 21 to 26 states, 10 Hz, warm",
            f"{cost.wall_s:.1f} s wall, {cost.cpu_s:.1f} s CPU, {cost.own_mb:.0f} MB of its own, "
            f"of a log of {size:.0f} MB",
            aim="" if quick else f"wall < {AIM_HOUR_S:g} s",
            met=None if quick else cost.wall_s < AIM_HOUR_S,
        )
    )
    return rows
