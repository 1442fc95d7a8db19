"""Rows about precise point positioning: epochs per CPU second, beside RTKLIB on the same files.

Run from the root of the checkout: ``python -m tools.bench.ppp [--quick]``. The files are those
of station ESBC of the shared recordings: GPS and Galileo, two frequencies, 30 s, 24 h, precise
orbits and clocks; `--quick` takes the first six hours. Both position as if the station moved,
uncombined, with a slant delay of the ionosphere per satellite. Programs take turns, and medians
are compared.

RTKLIB runs in this process through its own `postpos`, whose time holds the reading of its files
and the writing of its solution; what reading takes is measured alone and taken off in the row
without files. Ours there are the stages from observations and products to solutions, as columns.
`replay run` is a process of its own, whole, with its start.

RTKLIB 2.4.3 gives no position without the ionosphere-free combination (see tools/rtklib_ppp.py),
so that the uncombined peer is its fork demo5 where `pyrtklib5` is installed; it is said where it
is not. 2.4.3 with the combination, which estimates half as much, is told beside it.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich.console import Console

from replay import channels
from replay.engine.job import make_job
from replay.engine.pipelines import find_pipeline
from replay.importers import import_log, load_spec
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.stages.base import Context
from replay.time import NS_PER_S
from tools.bench.children import run_replay
from tools.bench.row import Row, speed_row, summary
from tools.rtklib_ppp import Files, Setting, available, solve, unpack

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data" / "ppp-esbc-2020-177"
SPEC = ROOT / "recordings" / "specs" / "ppp-esbc-2020-177.toml"
SYSTEMS = "GE"
MASK_DEG = 10.0
QUICK_NS = 6 * 3600 * NS_PER_S
ROUNDS = 3
TABLE = {
    "gnss": {"systems": SYSTEMS, "mask": float(np.radians(MASK_DEG))},
    "ppp": {"motion": {"dynamics": "kinematic"}},
}


def cost(work: Callable[[], object]) -> float:
    """CPU seconds of this process."""
    start = time.process_time()
    work()
    return time.process_time() - start


class Ours:
    """The stages of `ppp` over the rows of a log."""

    def __init__(self, log: Path, end_ns: int) -> None:
        with LogReader(log) as reader:
            job = make_job(reader, "ppp", tables=[TABLE])
            topics = list(reader.channels)
            self._stages = find_pipeline("ppp").stages(job.config, topics)
            self._config = job.config
            self._rows: dict[str, Columns] = {}
            for port in {port for stage in self._stages for port in stage.spec.inputs}:
                topic = _topic(port.channel)
                if topic in topics:
                    rows = reader.read(topic)
                    if port.channel is channels.GNSS_OBS:
                        rows = rows.take(rows.valid_time_ns <= end_ns)
                    self._rows[port.name] = rows

    def run(self) -> int:
        """Solve all epochs; how many were."""
        block = dict(self._rows)
        for stage in self._stages:
            state = stage.start(self._config, Context({}, self._rows))
            _, outputs = stage.step(state, block)
            block.update(outputs)
        return len(block[channels.SOLUTION.name])


def _topic(spec: channels.ChannelSpec) -> str:
    return spec.at(receiver="esbc") if "{receiver}" in spec.topic else spec.topic


def bench_ppp(*, quick: bool) -> list[Row]:
    """PPP against RTKLIB; no rows where the recordings are not here."""
    if not DATA.is_dir():
        return [Row("PPP, epochs/s", f"recordings are not here: {DATA}")]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = folder / "in.mcap"
        import_log(SPEC, DATA, log)
        files = unpack(load_spec(SPEC), DATA, folder)
        with LogReader(log) as reader:
            times = reader.read(channels.GNSS_OBS.at(receiver="esbc")).valid_time_ns
        first, last = int(times.min()), int(times.max())
        end = first + QUICK_NS - NS_PER_S if quick else last
        rows = _compared(files, folder, Ours(log, end), (first, end))
        if not quick:
            rows.append(_whole_process(log, folder))
    return rows


def _compared(files: Files, folder: Path, ours: Ours, span: tuple[int, int]) -> list[Row]:
    target = folder / "rtklib.pos"
    count = ours.run()  # what is compiled on first use costs nothing after
    peers = {"RTKLIB 2.4.3, ionosphere-free": Setting(SYSTEMS, mask_deg=MASK_DEG)}
    if available("demo5"):
        # Both versions are not to be had in one process; the one that is asked of us is demo5.
        peers = {
            "RTKLIB demo5, uncombined": Setting(
                SYSTEMS, ionosphere="estimated", mask_deg=MASK_DEG, program="demo5", frequencies=3
            )
        }
    took: dict[str, list[float]] = {name: [] for name in ("", *peers)}
    solved: dict[str, int] = {}
    for _ in range(ROUNDS):
        took[""].append(cost(ours.run))
        for name, setting in peers.items():
            reading = solve(files, setting, target, span[0], span[0] + NS_PER_S).cpu_s
            track = solve(files, setting, target, *span)
            solved[name] = len(track.times_ns)
            took[name].append(track.cpu_s - reading)
    own = count / statistics.median(took[""])
    return [
        speed_row(
            "PPP, kinematic, uncombined, G and E, orbits and filter, no files",
            "epochs/s",
            own,
            solved[name] / statistics.median(took[name]),
            name,
            1.0,
        )
        for name in peers
    ]


def _whole_process(log: Path, folder: Path) -> Row:
    out = folder / "out.mcap"
    words = ["run", "ppp", str(log), "-o", str(out), "--set", f"gnss.systems={SYSTEMS}"]
    took = statistics.median(run_replay(words).cpu_s for _ in range(ROUNDS))
    with LogReader(out) as reader:
        count = reader.channels[channels.SOLUTION.at(run="ppp")].message_count
    return Row("PPP, `replay run`, its start included", f"{count / took:,.0f} epochs/s")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m tools.bench.ppp", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the first six hours")
    Console().print(summary(bench_ppp(quick=parser.parse_args().quick)))


if __name__ == "__main__":
    main()
