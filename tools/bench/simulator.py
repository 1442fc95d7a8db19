"""A row about the simulator: inertial samples per second of an hour of town at 100 Hz.

Run from the root of the checkout: ``python -m tools.bench --only simulator [--quick]``. Ours
is motion from manoeuvres, perfect samples and all errors of an industrial unit.

gnss-ins-sim, the simulator that is best known, stands on no package index and publishes no
time, so that it cannot be measured here. The peer is `inu` 2.5.7 (MIT), whose `mech_inv`
gets samples from positions and attitudes that it is given, by first differences: much less
work, without the motion, without errors, and off by half a sample. So there is no aim.
It is not a dependency of this project: install it in an environment of its own, and name
that environment's Python in the variable REPLAY_BENCH_INU; without it the row has no peer.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import pymap3d

from replay.simulate import imu
from replay.simulate.motion import Moved, move
from replay.simulate.scenario import Scenario, load_scenario
from tools.bench.row import Row

SCENARIO = Path(__file__).resolve().parents[2] / "recordings" / "tang-drive" / "scenario.toml"
EVERY_ERROR = {
    "gyro_walk": "1 deg/h",
    "accel_walk": "10 ug",
    "gyro_g_sensitivity": "10 deg/h",
    "misalignment": "0.5 mrad",
    "gyro_increment": "1 arcsec",
    "accel_increment": "0.1 mm/s",
}
PEER = """
import sys, time
import numpy as np
import inu
data = np.load(sys.argv[1])
took = []
for _ in range(3):
    start = time.process_time()
    inu.mech_inv(data["llh"], data["rpy"], 0.01)
    took.append(time.process_time() - start)
print(min(took))
"""
ROUNDS = 3


def fly(scenario: Scenario) -> Moved:
    """Motion and samples of a scenario, with errors."""
    moved = move(scenario)
    motion, settings = moved.trajectory, scenario.settings
    imu.measure(
        motion.rates,
        motion.forces,
        motion.speeds(),
        motion.interval_s,
        settings.imu.errors,
        settings.seed,
    )
    return moved


def bench_simulator(*, quick: bool) -> list[Row]:
    """Samples per CPU second, beside an inverse mechanisation of the same poses."""
    repeat = 1 if quick else 6
    tables = [{"repeat": repeat, "imu": {"grade": "industrial", "errors": EVERY_ERROR}}]
    scenario = load_scenario(SCENARIO, tables)
    moved = fly(scenario)  # compiles
    took = []
    for _ in range(ROUNDS):
        start = time.process_time()
        fly(scenario)
        took.append(time.process_time() - start)
    samples = len(moved.trajectory.rates)
    ours = samples / min(took)
    name = f"simulator: motion and IMU with all errors, {samples / 1e3:.0f} k samples"
    interpreter = os.environ.get("REPLAY_BENCH_INU")
    if not interpreter:
        about = "none (inu: see tools/bench/simulator.py)"
        return [Row(name, f"{ours / 1e6:.3g} M samples/s", about)]
    peer = samples / peer_s(interpreter, moved)
    told = f"inu, differences of given poses: {peer / 1e6:.3g} M samples/s"
    return [Row(name, f"{ours / 1e6:.3g} M samples/s", told, ours / peer)]


def peer_s(interpreter: str, moved: Moved) -> float:
    """CPU seconds that inu takes for the samples of a motion."""
    trajectory = moved.trajectory
    poses = trajectory.poses(np.arange(len(trajectory.rates)) * trajectory.interval_s)
    llh = np.array(pymap3d.ecef2geodetic(*poses["r"].T, deg=False))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "poses.npz"
        np.savez(path, llh=llh, rpy=np.ascontiguousarray(poses["attitude"].T))
        done = subprocess.run(
            [interpreter, "-c", PEER, str(path)], check=True, capture_output=True, text=True
        )
    return float(done.stdout)
