"""RTKLIB's solutions of RINEX files against those of this project and against the truth.

Run: `python tools/compare_rtklib.py SPEC FOLDER [--mode kinematic] [--systems GEC]
[--position X Y Z] [--set key=value ...]`. RTKLIB comes from the package `pyrtklib`.

The import spec names the files: sources of the formats `rinex-obs` (the streams of the
receivers `rover` and, for kinematic, `base`) and `rinex-nav`. Both programs get the same
elevation mask, systems, frequencies, Klobuchar's ionosphere and Saastamoinen's troposphere
mapped by 1 / sin; where the files have no ionosphere, RTKLIB's built-in coefficients serve
both. Single points are computed twice here: with RTKLIB's variances and without tests of
residuals ("same settings"), and with the defaults of `spp` ("own defaults").

The truth is the log's, or a point that stands still (`--position`).
"""

from __future__ import annotations

import argparse
import dataclasses
import gzip
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyrtklib

from replay import channels
from replay.configuration import merge, parse_assignments
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.errors import UsageError
from replay.evaluate.align import align
from replay.evaluate.geometry import enu_axes, turn
from replay.importers import import_log, load_spec
from replay.importers.spec import Spec
from replay.log.reader import LogReader
from replay.schemas import solution_pb2

GZIP = b"\x1f\x8b"
WEEK_NS = 604_800_000_000_000
SAME_EPOCH_NS = 50_000_000
FIXED, FLOAT, SINGLE = 1, 2, 5
# RTKLIB 2.4.3, rtkcmn.c and pntpos.c: what serves where a file has no ionosphere, and the
# deviations of code, broadcast orbit, ionosphere and troposphere.
ALPHA = (0.1118e-7, -0.7451e-8, -0.5961e-7, 0.1192e-6)
BETA = (0.1167e6, -0.2294e6, -0.1311e6, 0.1049e7)
WEIGHTS = {
    "code_sigma": 0.3 * 2.0**0.5,
    "weighting": "sum",
    "range_std_scale": 1.0,
    "ionosphere_std": 0.5,
    "troposphere_std": 0.3,
    "system_scale": [1.0, 1.5, 1.0, 1.0, 1.0],
    "raim": False,
}
SYSTEMS = {
    "G": pyrtklib.SYS_GPS,
    "R": pyrtklib.SYS_GLO,
    "E": pyrtklib.SYS_GAL,
    "C": pyrtklib.SYS_CMP,
    "J": pyrtklib.SYS_QZS,
}
QUALITIES = {
    solution_pb2.SOLUTION_STATUS_FIXED: FIXED,
    solution_pb2.SOLUTION_STATUS_FLOAT: FLOAT,
    solution_pb2.SOLUTION_STATUS_SINGLE: SINGLE,
}

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Positions of one program.

    Attributes
    ----------
    times_ns : int64 array (n,), GPS ns
        Ascending.
    positions : float64 array (n, 3), m, ECEF
    quality : int64 array (n,)
        As RTKLIB counts: 1 fixed, 2 float, 5 single; 0 for anything else.
    """

    times_ns: Ints
    positions: Floats
    quality: Ints

    def fixed(self) -> Track:
        """Those with fixed ambiguities."""
        keep = self.quality == FIXED
        return Track(self.times_ns[keep], self.positions[keep], self.quality[keep])


@dataclasses.dataclass(frozen=True, slots=True)
class Files:
    """Plain RINEX files and the position of the base (m, ECEF)."""

    rover: Path
    base: Path | None
    nav: tuple[Path, ...]
    base_position: tuple[float, ...]


def unpack(spec: Spec, folder: Path, scratch: Path) -> Files:
    """The spec's RINEX files, without gzip."""
    names: dict[str, Path] = {}
    nav: list[Path] = []
    place: tuple[float, ...] = ()
    for stream in spec.streams.values():
        for source in stream.sources:
            kind = spec.sources[source].format
            if kind not in ("rinex-obs", "rinex-nav"):
                continue
            data = (folder / spec.sources[source].file).read_bytes()
            # RTKLIB tells a compressed file by its name alone.
            plain = scratch / f"{source}.rnx"
            plain.write_bytes(gzip.decompress(data) if data.startswith(GZIP) else data)
            if kind == "rinex-nav":
                nav.append(plain)
            else:
                names[stream.receiver] = plain
                if stream.receiver == "base":
                    place = stream.position_ecef_m
    if "rover" not in names or not nav:
        raise UsageError("the spec has no RINEX of a rover with navigation", where=str(spec.path))
    return Files(names["rover"], names.get("base"), tuple(nav), place)


def run_rtklib(files: Files, arguments: argparse.Namespace, base: Sequence[float]) -> Track:
    """RTKLIB's `postpos` over the files."""
    option, output = pyrtklib.prcopt_default, pyrtklib.solopt_default
    kinematic = arguments.mode == "kinematic"
    option.mode = pyrtklib.PMODE_KINEMA if kinematic else pyrtklib.PMODE_SINGLE
    option.navsys = sum(SYSTEMS[letter] for letter in arguments.systems)
    option.elmin = float(np.radians(arguments.mask))
    modelled = arguments.ionosphere == "broadcast"
    option.ionoopt = pyrtklib.IONOOPT_BRDC if modelled else pyrtklib.IONOOPT_OFF
    option.tropopt = pyrtklib.TROPOPT_SAAS
    option.nf = arguments.frequencies
    option.modear = pyrtklib.ARMODE_CONT if arguments.ambiguities == "continuous" else (
        pyrtklib.ARMODE_INST
    )  # fmt: skip
    if kinematic:
        option.refpos = 0
        for axis in range(3):
            option.rb[axis] = base[axis]
    output.posf, output.timef, output.timeu = pyrtklib.SOLF_XYZ, 0, 9
    target = files.rover.with_suffix(".pos")
    name = pyrtklib.Arr1Dchar(1024)
    for place, letter in enumerate(str(target)):
        name[place] = letter
    observed = [files.rover, files.base] if kinematic else [files.rover]
    paths = [str(path) for path in (*observed, *files.nav)]
    begin = pyrtklib.gtime_t()
    status = pyrtklib.postpos(
        begin, begin, 0.0, 0.0, option, output, pyrtklib.filopt_t(), paths, len(paths), name, "", ""
    )
    if status != 0 or not target.exists():
        raise UsageError(f"RTKLIB ends with {status}")
    return read_positions(target)


def read_positions(path: Path) -> Track:
    """RTKLIB's file of week, seconds, x, y, z, quality."""
    rows = [line.split() for line in path.read_text().splitlines() if not line.startswith("%")]
    times = [int(r[0]) * WEEK_NS + round(float(r[1]) * 1e9) for r in rows]
    return Track(
        np.array(times, dtype=np.int64),
        np.array([[float(v) for v in r[2:5]] for r in rows]).reshape(-1, 3),
        np.array([int(r[5]) for r in rows], dtype=np.int64),
    )


def run_replay(log: Path, pipeline: str, tables: Sequence[Mapping[str, Any]]) -> Track:
    """Positions of one of the project's pipelines."""
    target = log.with_name(f"{pipeline}.mcap")
    with LogReader(log) as reader:
        replay_log(reader, target, make_job(reader, pipeline, tables=tables))
    with LogReader(target) as reader:
        rows = reader.read(channels.SOLUTION.at(run=pipeline))
    order = np.argsort(rows.valid_time_ns, kind="stable")
    quality = [QUALITIES.get(int(status), 0) for status in rows["status"]]
    return Track(
        rows.valid_time_ns[order],
        rows["position_ecef_m"][order],
        np.array(quality, dtype=np.int64)[order],
    )


def settings(arguments: argparse.Namespace, same: bool) -> dict[str, Any]:
    """Our settings: RTKLIB's where `same`, else the defaults but for what is measured."""
    tables: dict[str, Any] = {
        "gnss": {"systems": arguments.systems, "mask": float(np.radians(arguments.mask))},
        "atmosphere": {"ionosphere": "klobuchar", "alpha": list(ALPHA), "beta": list(BETA)},
    }
    if arguments.ionosphere == "none":
        tables["atmosphere"] = {"ionosphere": "none"}
    if same:
        tables["atmosphere"] |= {"troposphere": "cosecant", "shapiro": False}
        tables["spp"] = dict(WEIGHTS)
    if arguments.mode == "kinematic":
        tables["rtk"] = {
            "differences": {"frequencies": arguments.frequencies},
            "ambiguities": {"mode": arguments.ambiguities},
        }
    merge(tables, parse_assignments(arguments.set))
    return tables


def against(track: Track, times_ns: Ints, positions: Floats) -> Floats:
    """East, north, up (m) of a track less a reference that is interpolated."""
    found = align(track.times_ns, times_ns)
    reference = found.linear(positions)
    return turn(enu_axes(reference), track.positions[found.rows] - reference)


def between(ours: Track, theirs: Track) -> Floats:
    """East, north, up (m) of our positions less RTKLIB's of the same epochs."""
    place = np.searchsorted(theirs.times_ns, ours.times_ns - SAME_EPOCH_NS)
    place = np.minimum(place, max(len(theirs.times_ns) - 1, 0))
    if len(theirs.times_ns) == 0:
        return np.empty((0, 3))
    same = np.abs(theirs.times_ns[place] - ours.times_ns) <= SAME_EPOCH_NS
    reference = theirs.positions[place[same]]
    return turn(enu_axes(reference), ours.positions[same] - reference)


def print_row(name: str, enu: Floats) -> None:
    """One line of the table."""
    if len(enu) == 0:
        print(f"{name:38} {0:6d}")
        return
    rms = np.sqrt(np.mean(enu**2, axis=0))
    spread = np.std(enu, axis=0)
    size = np.sqrt(np.sum(enu**2, axis=1))
    numbers = [*np.mean(enu, axis=0), *spread, *rms, np.sqrt(np.mean(size**2))]
    numbers += [np.percentile(size, 95), size.max()]
    print(f"{name:38} {len(enu):6d} " + " ".join(f"{value:8.4f}" for value in numbers))


def truth_of(log: Path, arguments: argparse.Namespace, times: Ints) -> tuple[Ints, Floats] | None:
    """Times and positions of the truth, if there is one."""
    if arguments.position:
        edges = np.array([times[0] - SAME_EPOCH_NS, times[-1] + SAME_EPOCH_NS])
        return edges, np.tile(np.array(arguments.position), (2, 1))
    with LogReader(log) as reader:
        if channels.TRUTH.topic not in reader.channels:
            return None
        rows = reader.read(channels.TRUTH.topic)
    return rows.valid_time_ns, rows["position_ecef_m"]


def compare(arguments: argparse.Namespace, scratch: Path) -> None:
    """Run both and print the table."""
    log = scratch / "in.mcap"
    import_log(arguments.spec, arguments.folder, log)
    files = unpack(load_spec(arguments.spec), arguments.folder, scratch)
    base: tuple[float, ...] = tuple(arguments.base or files.base_position)
    if arguments.mode == "kinematic" and len(base) != 3:
        with LogReader(log) as reader:
            info = reader.read(channels.RECEIVER.at(receiver="base"))
        base = tuple(float(v) for v in info["approximate_position_ecef_m"][0])
    theirs = run_rtklib(files, arguments, base)
    pipeline = "spp" if arguments.mode == "single" else "rtk"
    kinds = ("same settings", "own defaults") if pipeline == "spp" else ("own defaults",)
    tracks = {"RTKLIB": theirs}
    for kind in kinds:
        table = settings(arguments, kind == "same settings")
        if base and pipeline == "rtk":
            merge(table, {"gnss": {"base": "base"}, "antenna": {"base_position": list(base)}})
        tracks[f"replay, {kind}"] = run_replay(log, pipeline, [table])
    truth = truth_of(log, arguments, theirs.times_ns)
    print(f"{arguments.spec.stem}, {arguments.mode}, {arguments.systems}, m")
    names = [f"{kind} {axis}" for kind in ("mean", "std", "rms") for axis in "ENU"]
    heads = " ".join(f"{n:>8}" for n in [*names, "rms 3d", "95 %", "max"])
    print(f"{'':38} {'epochs':>6} {heads}")
    for name, track in tracks.items():
        if truth is not None:
            print_row(f"{name} - truth", against(track, *truth))
            if pipeline == "rtk":
                print_row(f"{name} - truth, fixed", against(track.fixed(), *truth))
        if name != "RTKLIB":
            print_row(f"{name} - RTKLIB", between(track, theirs))
            if pipeline == "rtk":
                print_row(f"{name} - RTKLIB, fixed", between(track.fixed(), theirs.fixed()))
    for name, track in tracks.items():
        share = 100.0 * float(np.mean(track.quality == FIXED)) if len(track.quality) else 0.0
        print(f"{name}: {len(track.quality)} epochs, {share:.1f} % fixed")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("spec", type=Path, help="import spec, such as recordings/specs/*.toml")
    parser.add_argument("folder", type=Path, help="folder of its files")
    parser.add_argument("--mode", choices=("single", "kinematic"), default="single")
    parser.add_argument("--systems", default="GEC", help="letters, default GEC")
    parser.add_argument("--mask", type=float, default=15.0, help="degrees")
    parser.add_argument("--ionosphere", choices=("broadcast", "none"), default="broadcast")
    parser.add_argument("--frequencies", type=int, default=1, help="of kinematic")
    parser.add_argument(
        "--ambiguities", choices=("continuous", "instantaneous"), default="continuous"
    )
    parser.add_argument("--position", type=float, nargs=3, help="of a rover at rest, ECEF, m")
    parser.add_argument("--base", type=float, nargs=3, help="ECEF, m; else the spec's, the file's")
    parser.add_argument("--set", action="append", default=[], help="as of replay run")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        compare(arguments, Path(scratch))


if __name__ == "__main__":
    main()
