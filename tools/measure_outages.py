"""Drift of `gnss-ins-lc` at the end of 15 s outages whose windows are shifted through a log.

Run: `python tools/measure_outages.py LOG [--step SECONDS] [--set key=value ...]`. The windows
are those of the README: the first 40 s after the first row, one every 45 s.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from replay.configuration import parse_assignments
from replay.engine.degrade import plan_outages, remove_fixes
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.evaluate import evaluate_run
from replay.log.reader import LogReader


def main() -> None:
    """Print median, 99th percentile and worst horizontal drift over all shifts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path)
    parser.add_argument("--step", type=float, default=1.0, help="seconds between shifts")
    parser.add_argument("--set", action="append", default=[], help="as of replay run")
    arguments = parser.parse_args()
    drifts: list[float] = []
    with tempfile.TemporaryDirectory() as scratch:
        cut, run = Path(scratch) / "cut.mcap", Path(scratch) / "run.mcap"
        for shift in np.arange(0.0, 45.0, arguments.step).tolist():
            window = f"{40.0 + shift},15"
            planned = plan_outages(arguments.log, [window], every_s=45.0, leave_last_s=30.0)
            remove_fixes(arguments.log, cut, planned)
            with LogReader(cut) as reader:
                tables = [parse_assignments(arguments.set)]
                replay_log(reader, run, make_job(reader, "gnss-ins-lc", tables=tables))
            found = [outage.horizontal_drift_m for outage in evaluate_run(run).outages]
            drifts += [drift for drift in found if drift is not None]
    print(
        f"{len(drifts)} outages, horizontal drift: median {np.median(drifts):.2f} m, "
        f"99 % {np.percentile(drifts, 99):.2f} m, worst {max(drifts):.2f} m"
    )


if __name__ == "__main__":
    main()
