"""A row about the sweep: what a second process gains.

Run from the root of the checkout: ``python -m tools.bench --only sweep [--quick]``. The cases are
those of the study `kan2022` for one unit, cut short: simulated logs of the drive, PPP/INS at
four rates, evaluated; whole processes, everything compiled before. The peer is the same
sweep with one process, so that the ratio is what two of them gain; 2 would be all of it.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from tools.bench.children import run_replay
from tools.bench.row import Row

SCENARIO = Path(__file__).resolve().parents[2] / "replay" / "batch" / "kan2022" / "drive.toml"
JOBS = 2
AIM_RATIO = 1.6
SWEEP = """
name = "gain"
scenario = ["{scenario}"]
pipeline = ["ppp-ins-tc"]
figures = ["position_error_all_m.*"]
[grid]
seed = [{seeds}]
imu_rate = [200, 100, 50, 20]
"""


def bench_sweep(*, quick: bool) -> list[Row]:
    """One process against two over the same cases."""
    seeds = 1 if quick else 4
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "gain.toml"
        numbers = ", ".join(str(20220 + number) for number in range(seeds))
        file.write_text(SWEEP.format(scenario=SCENARIO, seeds=numbers))
        warm = folder / "warm.toml"
        warm.write_text(SWEEP.format(scenario=SCENARIO, seeds="1"))
        run_replay(["sweep", str(warm), "-o", str(folder / "warm"), "--jobs", "1"])
        one, two = (
            run_replay(["sweep", str(file), "-o", str(folder / f"{jobs}"), "--jobs", f"{jobs}"])
            for jobs in (1, JOBS)
        )
    cases = 4 * seeds
    ratio = one.wall_s / two.wall_s
    return [
        Row(
            f"`replay sweep` of {cases} runs of PPP/INS, {JOBS} processes",
            f"{two.wall_s:.1f} s, {cases / two.wall_s * 60.0:.0f} runs/min",
            f"one process: {one.wall_s:.1f} s",
            ratio,
            f"ratio ≥ {AIM_RATIO:g}",
            ratio >= AIM_RATIO,
        )
    ]
