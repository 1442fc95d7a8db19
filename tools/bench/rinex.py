"""How fast a RINEX observation file becomes columns, beside RTKLIB in the same process.

Usage: python tools/bench/rinex.py [FILE]

Without a file, one of RINEX 3.04 is generated: 1800 epochs, 30 satellites, 2
signals. All times are CPU seconds from the plain text to values in memory; that of
RTKLIB and georinex includes reading the file from the cache of the operating system.
georinex is timed, once, where it is installed.
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import pyrtklib

from replay.importers.files import File, read_file
from replay.importers.findings import Findings
from replay.importers.rinex_files import unpack
from replay.importers.rinex_obs import read_rinex_obs

EPOCHS = 1800
SATELLITES = 30


def fastest(work: Callable[[], object], rounds: int = 3) -> float:
    """Shortest of some runs, CPU seconds of this process."""
    took = []
    for _ in range(rounds):
        start = time.process_time()
        work()
        took.append(time.process_time() - start)
    return min(took)


def generated() -> File:
    """A file of RINEX 3.04."""
    kinds = "C1C L1C D1C S1C C2W L2W D2W S2W"
    text = [
        f"{'     3.04':<20}{'OBSERVATION DATA':<20}{'G':<20}RINEX VERSION / TYPE",
        f"{'G    8 ' + kinds:<60}SYS / # / OBS TYPES",
        f"{'':<60}END OF HEADER",
    ]
    for epoch in range(EPOCHS):
        minute, second = divmod(epoch, 60)
        text.append(f"> 2026  1  1  0 {minute:2d}{second:11.7f}  0 {SATELLITES}")
        for satellite in range(1, SATELLITES + 1):
            near = 2e7 + 1e5 * satellite + epoch / 7.0
            values = (near, near * 5.255, -1234.567, 45.25)
            fields = "".join(f"{value:14.3f} 7" for value in values)
            text.append(f"G{satellite:02d}{fields}{fields}")
    data = ("\n".join(text) + "\n").encode()
    return File("generated", data, "", len(data))


def _georinex(path: Path) -> float:
    """CPU seconds of georinex, or 0 where it is not installed."""
    if importlib.util.find_spec("georinex") is None:
        return 0.0
    import georinex  # type: ignore[import-not-found]

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return fastest(lambda: georinex.load(path), rounds=1)


def main() -> None:
    """Print megabytes per second."""
    if len(sys.argv) > 1:
        file = unpack(read_file(Path(sys.argv[1]), Findings(), mend=""), Findings())
    else:
        file = generated()
    size = len(file.data) / 1e6
    rows = len(read_rinex_obs(file, Findings()).columns)
    ours = fastest(lambda: read_rinex_obs(file, Findings()))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.obs"
        path.write_bytes(file.data)

        def peer() -> None:
            observations = pyrtklib.obs_t()
            navigation, station = pyrtklib.nav_t(), pyrtklib.sta_t()
            pyrtklib.readrnx(str(path), 1, "", observations, navigation, station)
            pyrtklib.freeobs(observations)

        theirs = fastest(peer)
        slowest = _georinex(path)
    print(f"{file.name}: {size:.1f} MB, {rows} rows")
    print(f"read_rinex_obs  {size / ours:8.1f} MB/s")
    print(f"RTKLIB readrnx  {size / theirs:8.1f} MB/s, ratio {theirs / ours:.2f}")
    if slowest > 0.0:
        print(f"georinex.load   {size / slowest:8.2f} MB/s, ratio {slowest / ours:.0f}")


if __name__ == "__main__":
    main()
