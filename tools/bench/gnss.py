"""Rows about positioning: epochs per CPU second, beside RTKLIB on the same observations.

Run from the root of the checkout: ``python -m tools.bench.gnss [--quick]``. The observations
are the Riverside drive's of the shared recordings (GPS, Galileo, BeiDou, one frequency, 1 Hz).
RTKLIB runs in this process through its own `postpos`, whose time holds the reading of RINEX
and the writing of its solution; what reading takes is measured alone and taken off in the
rows without files. Ours there are the stages from observations and messages to solutions, as
columns. `replay run` is a process of its own: whole, with its start, and by the difference
between the whole drive and half of it.
"""

from __future__ import annotations

import argparse
import gzip
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pyrtklib
from rich.console import Console

from replay import channels
from replay.configuration import build
from replay.engine.pipelines import find_pipeline
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.stages.base import BASE, RECEIVER, Context, Port
from replay.stages.rtk import Rtk
from replay.stages.rtk_config import RtkConfig
from replay.stages.satellites import Satellites
from tools.bench.children import run_replay
from tools.bench.row import Row, speed_row, summary

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data" / "riverside-drive-2020-193"
SPEC = ROOT / "recordings" / "specs" / "riverside-drive-2020-193.toml"
BASE_POSITION = (-2430697.699, -4704189.202, 3544329.104)
MASK_DEG = 15.0
HALF = "1278553932"  # GPS seconds, the middle of the drive
ROUNDS = 3


def fastest(work: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Shortest of some runs, CPU seconds of this process."""
    took = []
    for _ in range(rounds):
        start = time.process_time()
        work()
        took.append(time.process_time() - start)
    return min(took)


def unpack(folder: Path) -> list[str]:
    """Plain RINEX of rover, base and messages."""
    names = []
    for name in ("rover.obs", "base.obs"):
        path = folder / name
        path.write_bytes(gzip.decompress((DATA / f"{name}.gz").read_bytes()))
        names.append(str(path))
    return [*names, str(DATA / "rover.nav")]


def read_by_rtklib(files: list[str]) -> None:
    """Bring files into RTKLIB's memory."""
    for number, name in enumerate(files):
        observations, messages = pyrtklib.obs_t(), pyrtklib.nav_t()
        pyrtklib.readrnx(name, number + 1, "", observations, messages, pyrtklib.sta_t())


def solve_by_rtklib(files: list[str], out: Path, mode: int) -> None:
    """One run of `postpos`."""
    options = pyrtklib.prcopt_default
    options.mode = mode
    options.navsys = pyrtklib.SYS_GPS | pyrtklib.SYS_GAL | pyrtklib.SYS_CMP
    options.nf = 1
    options.elmin = float(np.radians(MASK_DEG))
    options.modear = 1
    options.thresar[0] = 3.0
    options.ionoopt = pyrtklib.IONOOPT_BRDC
    options.tropopt = pyrtklib.TROPOPT_SAAS
    options.refpos = 0
    for axis in range(3):
        options.rb[axis] = BASE_POSITION[axis]
    name = pyrtklib.Arr1Dchar(1024)
    for place, letter in enumerate(str(out)):
        name[place] = letter
    status = pyrtklib.postpos(
        pyrtklib.gtime_t(), pyrtklib.gtime_t(), 0.0, 0.0, options, pyrtklib.solopt_default,
        pyrtklib.filopt_t(), files, len(files), name, "", "",
    )  # fmt: skip
    if status != 0 or not out.exists():
        raise RuntimeError(f"RTKLIB gave {status} and no solution")


def recorded(path: Path) -> dict[str, Columns]:
    """What the log has for the stages."""
    with LogReader(path) as reader:
        rows = {
            Port(channels.GNSS_OBS, role).name: reader.read(channels.GNSS_OBS.at(receiver=name))
            for role, name in ((RECEIVER, "rover"), (BASE, "base"))
        }
        rows[channels.NAV.name] = reader.read(channels.NAV.at())
    return rows


def run_stages(pipeline: str, rows: dict[str, Columns]) -> int:
    """The stages of a pipeline over all rows, columns in and columns out; epochs solved."""
    found = find_pipeline(pipeline)
    config = build(found.config, [{"antenna": {"base_position": list(BASE_POSITION)}}])
    block = dict(rows)
    for stage in found.stages(config, ()):
        state = stage.start(config, Context({}, {}))
        _, outputs = stage.step(state, block)
        block.update(outputs)
    return len(block[channels.SOLUTION.name])


def relative_loop(rows: dict[str, Columns]) -> float:
    """CPU seconds of the stage `rtk` alone, given orbits and corrections."""
    config = build(RtkConfig, [{"antenna": {"base_position": list(BASE_POSITION)}}])
    block = dict(rows)
    for stage in (Satellites(), Satellites(BASE)):
        block.update(stage.step(stage.start(config, Context({}, {})), block)[1])
    stage = Rtk()
    return fastest(lambda: stage.step(stage.start(config, Context({}, {})), block))


def bench_gnss(*, quick: bool) -> list[Row]:
    """SPP and RTK against RTKLIB; no rows where the recordings are not here."""
    if not DATA.is_dir():
        return [Row("SPP and RTK, epochs/s", f"recordings are not here: {DATA}")]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = folder / "in.mcap"
        run_replay(["import", str(SPEC), "--data", str(DATA), "-o", str(log)])
        files = unpack(folder)
        rows_in = recorded(log)
        for title, pipeline, mode, inputs in (
            ("SPP", "spp", pyrtklib.PMODE_SINGLE, [files[0], files[2]]),
            ("RTK, L1", "rtk", pyrtklib.PMODE_KINEMA, files),
        ):
            whole = fastest(partial(solve_by_rtklib, inputs, folder / "out.pos", mode))
            read = fastest(partial(read_by_rtklib, inputs))
            count = run_stages(pipeline, rows_in)
            took = fastest(partial(run_stages, pipeline, rows_in))
            rows.append(
                speed_row(
                    f"{title}, orbits and filter, no files",
                    "epochs/s",
                    count / took,
                    count / (whole - read),
                    "RTKLIB",
                    1.0,
                )
            )
            if not quick:
                rows += whole_process(title, pipeline, log, folder, count, whole)
        alone = count / relative_loop(rows_in)
        rows.append(Row("RTK, L1, the stage alone, orbits given", f"{alone:,.0f} epochs/s"))
    return rows


def whole_process(
    title: str, pipeline: str, log: Path, folder: Path, count: int, peer_s: float
) -> list[Row]:
    """Rows about `replay run`, from a recorded log to a written one."""

    def cost(*words: str) -> float:
        return min(
            run_replay(["run", pipeline, str(log), "-o", str(folder / "w.mcap"), *words]).cpu_s
            for _ in range(3)
        )

    full, half = cost(), cost("--to", HALF)
    with LogReader(folder / "w.mcap") as reader:
        short = reader.channels[f"/solution/{pipeline}"].message_count
    return [
        speed_row(f"{title}, `replay run`, its start included", "epochs/s", count / full,
                  count / peer_s, "RTKLIB with RINEX", 1.0),
        speed_row(f"{title}, `replay run`, one more epoch", "epochs/s",
                  (count - short) / (full - half), count / peer_s, "RTKLIB with RINEX", 1.0),
    ]  # fmt: skip


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m tools.bench.gnss", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="compiled loops only")
    Console().print(summary(bench_gnss(quick=parser.parse_args().quick)))


if __name__ == "__main__":
    main()
