"""A network of permanent stations, each left out in turn and positioned as if it moved.

Run: `python tools/leave_one_out.py LOG [--set key=value ...]` on a log with several static
receivers, such as that of `recordings/specs/nl-network-2021-001.toml`. Of each station it
prints how often `network-rtk` fixed its integers, and how its positions scatter and are off
from the header's mark and antenna, with the whole network and from the nearest station alone.
Before that it prints the integers of all baselines: when they were first known, how many, and
their sums around triangles, which are nought where all are right.
"""

import argparse
import tempfile
from itertools import combinations
from pathlib import Path

import numpy as np
import pymap3d
from rich.console import Console
from rich.table import Table

from replay import channels
from replay.configuration import parse_assignments
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.evaluate.network_run import read_stations
from replay.log.reader import LogReader
from replay.schemas import solution_pb2

_CM = 100.0
_WRONG_CM = 10.0


def antenna_places(log: Path) -> dict[str, np.ndarray]:
    """ECEF position (m) of each receiver's antenna as its header states it."""
    places = {}
    with LogReader(log) as reader:
        for topic in reader.channels:
            if not channels.RECEIVER.matches(topic):
                continue
            info = reader.read(topic)
            mark = info["approximate_position_ecef_m"][0]
            offset = np.zeros(3)
            if info.is_present("antenna_offset_enu_m")[0]:
                offset = info["antenna_offset_enu_m"][0]
            latitude, longitude, _ = pymap3d.ecef2geodetic(*mark)
            step = pymap3d.enu2uvw(*offset, latitude, longitude)
            places[channels.RECEIVER.parts(topic)["receiver"]] = mark + np.array(step)
    return places


def run(log: Path, out: Path, pipeline: str, tables: list[dict]) -> None:
    """One pipeline over the log."""
    with LogReader(log) as reader:
        replay_log(reader, out, make_job(reader, pipeline, tables=tables))


def figures(out: Path, place: np.ndarray, converged_s: float) -> list[str]:
    """Share fixed, mean and deviation of east, north, up, and wrong fixes, once converged."""
    with LogReader(out) as reader:
        topic = next(t for t in reader.channels if channels.SOLUTION.matches(t))
        solution = reader.read(topic)
        start = reader.start_ns
    latitude, longitude, height = pymap3d.ecef2geodetic(*place)
    x, y, z = solution["position_ecef_m"].T
    enu = _CM * np.array(pymap3d.ecef2enu(x, y, z, latitude, longitude, height))
    late = solution.valid_time_ns - start > converged_s * 1e9
    fixed = late & (solution["status"] == solution_pb2.SOLUTION_STATUS_FIXED)
    share = 100.0 * fixed.sum() / late.sum()
    mean, std = enu[:, fixed].mean(axis=1), enu[:, fixed].std(axis=1)
    off = np.hypot(*(enu[:2, fixed] - mean[:2, None]))
    return [
        f"{share:.1f}",
        *(f"{m:+.2f} +- {s:.2f}" for m, s in zip(mean, std, strict=True)),
        f"{np.hypot(std[0], std[1]):.2f}",
        str(int((off > _WRONG_CM).sum())),
    ]


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path)
    parser.add_argument("--converged", type=float, default=3600.0, help="seconds left out")
    parser.add_argument("--systems", default="G", help="letters of the systems to use")
    parser.add_argument("--set", action="append", default=[], help="as of replay run")
    arguments = parser.parse_args()
    console = Console(width=150)
    places = antenna_places(arguments.log)
    common = [{"gnss": {"systems": arguments.systems}}, parse_assignments(arguments.set)]
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "run.mcap"
        names = sorted(places)
        whole = {"gnss": {"receiver": "none", "base": names[0]}}
        run(arguments.log, out, "network", [whole, {"network": {"stations": names[1:]}}, *common])
        stations = read_stations(out)
        table = Table("baseline", "km", "first integers after [s]", "all [s]", "known [%]")
        for name, lanes in stations.baselines.items():
            ends = name.split("-")
            distance = np.linalg.norm(places[ends[0]] - places[ends[1]]) / 1e3
            lane = lanes["1C"]
            known = 100.0 * lane.fixed / lane.rows
            table.add_row(
                name,
                f"{distance:.0f}",
                f"{lane.first_fix_s}",
                f"{lane.all_fixed_s}",
                f"{known:.1f}",
            )
        console.print(table)
        for closure in stations.closures:
            triangle = " ".join(closure.stations)
            console.print(f"{triangle}: {closure.checked} sums, {closure.exceptions} not nought")
        table = Table(
            "station", "mode", "fixed [%]", "east [cm]", "north [cm]", "up [cm]",
            "horizontal std [cm]", f"over {_WRONG_CM:.0f} cm",
        )  # fmt: skip
        distances = {
            pair: np.linalg.norm(places[pair[0]] - places[pair[1]])
            for pair in combinations(names, 2)
        }
        for left_out in names:
            others = [name for name in names if name != left_out]
            nearest = min(others, key=lambda o, s=left_out: distances[min(o, s), max(o, s)])
            km = distances[min(nearest, left_out), max(nearest, left_out)] / 1e3
            rest = [name for name in others if name != nearest]
            chosen = {
                "gnss": {"receiver": left_out, "base": nearest},
                "network": {"stations": rest},
            }
            for mode in ("single", "network"):
                run(arguments.log, out, "network-rtk", [chosen, {"mode": mode}, *common])
                row = figures(out, places[left_out], arguments.converged)
                table.add_row(left_out, f"{mode}, {nearest} {km:.0f} km", *row)
        console.print(table)


if __name__ == "__main__":
    main()
