"""Drift of a filter at the end of outages whose windows are shifted through a log.

Run: `python tools/measure_outages.py LOG [--step SECONDS] [--set key=value ...]`. The windows
are those of the README: 15 s, the first 40 s after the first row, one every 45 s.
`--pipeline gnss-ins-tc --keep 3` leaves the three best satellites of each outage (see
`replay degrade --help`), so that what few satellites are worth can be compared with none.
With `--smooth` each run is smoothed, too: then the largest error within each outage is told of
both, for at the end of it a smoothed run has the next position as well.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from replay.configuration import parse_assignments
from replay.engine.degrade import plan_outages, remove_fixes
from replay.engine.job import make_job
from replay.engine.pipelines import find_pipeline
from replay.engine.run import replay_log
from replay.evaluate import evaluate_run
from replay.log.reader import LogReader


def main() -> None:
    """Print median, 99th percentile and worst horizontal drift over all shifts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path)
    parser.add_argument("--pipeline", default="gnss-ins-lc")
    parser.add_argument("--begin", type=float, default=40.0, help="first outage, s after first row")
    parser.add_argument("--length", type=float, default=15.0, help="seconds of an outage")
    parser.add_argument("--every", type=float, default=45.0, help="seconds between outages")
    parser.add_argument("--leave-last", type=float, default=30.0, help="seconds that stay whole")
    parser.add_argument("--keep", default="", help="number or names of satellites that stay")
    parser.add_argument("--step", type=float, default=1.0, help="seconds between shifts")
    parser.add_argument("--smooth", action="store_true", help="the run smoothed beside it")
    parser.add_argument("--fixed-truth-only", action="store_true", help="as of replay evaluate")
    parser.add_argument("--set", action="append", default=[], help="as of replay run")
    arguments = parser.parse_args()
    keep = f",keep={arguments.keep}" if arguments.keep else ""
    drifts: list[tuple[float, float]] = []
    largest: dict[str, list[float]] = {}
    unknown = 0
    assignments = [*arguments.set, *(["smoothing.record=true"] if arguments.smooth else [])]
    with tempfile.TemporaryDirectory() as scratch:
        cut, run = Path(scratch) / "cut.mcap", Path(scratch) / "run.mcap"
        for shift in np.arange(0.0, arguments.every, arguments.step).tolist():
            planned = plan_outages(
                arguments.log,
                [f"{arguments.begin + shift},{arguments.length:g}{keep}"],
                every_s=arguments.every,
                leave_last_s=arguments.leave_last,
            )
            remove_fixes(arguments.log, cut, planned)
            with LogReader(cut) as reader:
                tables = [parse_assignments(assignments)]
                replay_log(reader, run, make_job(reader, arguments.pipeline, tables=tables))
            name = str(getattr(find_pipeline(arguments.pipeline).config(), "name", ""))
            outages = evaluate_run(
                run, run=name, fixed_truth_only=arguments.fixed_truth_only
            ).outages
            if arguments.smooth:
                smoothed = Path(scratch) / "smoothed.mcap"
                with LogReader(run) as reader:
                    replay_log(reader, smoothed, make_job(reader, "smooth", tables=[]))
                after = evaluate_run(
                    smoothed, run=f"{name}-smoothed", fixed_truth_only=arguments.fixed_truth_only
                ).outages
                for words, these in (("forward", outages), ("smoothed", after)):
                    known = [o.horizontal_max_m for o in these if o.horizontal_max_m is not None]
                    largest.setdefault(words, []).extend(known)
            for outage in outages:
                if outage.horizontal_drift_m is None or outage.drift_3d_m is None:
                    unknown += 1
                else:
                    drifts.append((outage.horizontal_drift_m, outage.drift_3d_m))
    print(f"{len(drifts)} outages of {arguments.length:g} s, {unknown} more without truth")
    for name, values in zip(("horizontal", "3d"), np.array(drifts).reshape(-1, 2).T, strict=True):
        print(f"{name} drift: {_told(values)}")
    for name, found in largest.items():
        print(f"largest horizontal error in an outage, {name}: {_told(np.array(found))}")


def _told(values: np.ndarray) -> str:
    return (
        f"median {np.median(values):.2f} m, rms {np.sqrt(np.mean(values * values)):.2f} m, "
        f"99 % {np.percentile(values, 99):.2f} m, worst {values.max():.2f} m"
    )


if __name__ == "__main__":
    main()
