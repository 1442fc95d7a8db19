"""Precise point positioning of permanent stations, ours and RTKLIB's on the same files.

Run: `python tools/ppp_stations.py [--station esbc] [--systems G GE GER] [--modes kinematic
static] [--hours 24 6] [--every 1] [--no-ours] [--set key=value ...]`.

A station stands still. Of each set of systems, mode and session the table tells how east, north
and up scatter about their own mean and are off from the reference, from the first hour on; the
minutes until all three keep within 10 cm, to the end of the session and for ten minutes; CPU
seconds and epochs per CPU second. A session begins anew; of static sessions the last positions
are compared. Of lengths with more than four sessions, as `--hours 1`, a further table sums up
the minutes until all three had kept within 10 cm for ten minutes: a session that never did
counts with its whole length in the mean. Both programs get the same files, systems and mask,
and stop where the orbits end.

Without `--reference` it is RTKLIB's static position of the whole span with the last of the
systems; where RTKLIB gives none, as for files without navigation messages, which it needs
besides precise orbits, it is the mean of ours. CPU seconds are those of this process, all of it:
RTKLIB's from its files to its file, whose reading is told beside; ours from a log to a log.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rtklib_ppp import FIXED, FLOAT, Files, Setting, Track, available, solve, unpack

from replay import channels
from replay.configuration import merge, parse_assignments
from replay.engine.job import make_job
from replay.engine.run import replay_log
from replay.errors import UsageError
from replay.evaluate.convergence import EACH, Convergence, convergence_of
from replay.evaluate.geometry import Floats, enu_axes, turn, turn_back
from replay.evaluate.station import repeatability_of
from replay.evaluate.station_table import minutes
from replay.evaluate.statistics import LOCAL_AXES
from replay.importers import import_log, load_spec
from replay.log.reader import LogReader
from replay.log.writer import LogWriter
from replay.schemas import solution_pb2
from replay.time import NS_PER_S

ROOT = Path(__file__).resolve().parents[1]
SPECS = ROOT / "recordings" / "specs"
DATA = ROOT.parent / "shared" / "data"
STATIONS = {"esbc": "ppp-esbc-2020-177", "ccj2": "ppp-ccj2-2021-210"}
SYSTEMS = {"esbc": ["G", "GE", "GER"], "ccj2": ["G", "GE", "GEJ"]}
HOURS = {"esbc": [24, 6], "ccj2": [1]}
HOUR_NS = 3600 * NS_PER_S
MM = 1e3
MANY = 4  # sessions that are told one by one alone
QUALITIES = {
    solution_pb2.SOLUTION_STATUS_FIXED: FIXED,
    solution_pb2.SOLUTION_STATUS_FLOAT: FLOAT,
}
Span = tuple[int, int]


def cut(log: Path, receiver: str, span: Span, target: Path) -> None:
    """The log with the receiver's rows of a span (first and last included) alone.

    Products, which are all known from the start of the log, stay.
    """
    own = {
        spec.at(receiver=receiver) for spec in (channels.GNSS_OBS, channels.RECEIVER_EPOCH)
    }  # fmt: skip
    with LogReader(log) as reader, LogWriter(target) as writer:
        for name, values in reader.metadata.items():
            writer.add_metadata(name, values)
        topics = list(reader.channels)
        for topic in topics:
            writer.add_channel(topic, reader.channel(topic).schema_name)
        for batch in reader.batches(topics, decode=[], payloads=topics):
            for topic in own & set(batch):
                times = batch[topic].valid_time_ns
                batch[topic] = batch[topic].take((times >= span[0]) & (times <= span[1]))
            writer.write(batch)


def run_ours(log: Path, target: Path, receiver: str, tables: Sequence[Mapping[str, Any]]) -> Track:
    """Positions of the pipeline `ppp`, of the mark below the antenna as RTKLIB's are."""
    begin = time.process_time()
    with LogReader(log) as reader:
        replay_log(reader, target, make_job(reader, "ppp", tables=tables))
    cpu_s = time.process_time() - begin
    with LogReader(target) as reader:
        rows = reader.read(channels.SOLUTION.at(run="ppp"))
        info = reader.read(channels.RECEIVER.at(receiver=receiver))
        geometry = channels.FILTER_GEOMETRY.at(run="ppp")
        used = reader.read(geometry) if geometry in reader.channels else None
    quality = np.array([QUALITIES.get(int(status), 0) for status in rows["status"]], dtype=np.int64)
    known = quality > 0
    counts = np.zeros(1, dtype=np.int64)
    if used is not None:
        names = [name for name in used.values if name.endswith("_count")]
        counts = sum(used[name].astype(np.int64) for name in names)
    places = rows["position_ecef_m"][known]
    if info.is_present("antenna_offset_enu_m")[0]:
        offset = np.tile(info["antenna_offset_enu_m"][0], (len(places), 1))
        places = places - turn_back(enu_axes(places), offset)
    return Track(
        rows.valid_time_ns[known],
        places,
        quality[known],
        counts,
        cpu_s,
    )


def our_tables(setting: Setting, assignments: Sequence[str]) -> list[dict[str, Any]]:
    """Our settings: RTKLIB's where both have them, else the defaults."""
    table: dict[str, Any] = {
        "gnss": {"systems": setting.systems, "mask": float(np.radians(setting.mask_deg))},
        "ppp": {"motion": {"dynamics": "static" if setting.static else "kinematic"}},
    }
    merge(table, parse_assignments(assignments))
    return [table]


def off(track: Track, place: Floats) -> Floats:
    """East, north, up (n, 3), m, of a track from a place."""
    axes = enu_axes(np.tile(place, (len(track.positions), 1)))
    return turn(axes, track.positions - place)


class Report:
    """The table, row by row."""

    def __init__(self, title: str) -> None:
        self.table = Table(title=title, title_justify="left")
        heads = ["program", "systems", "mode", "session", "epochs", "satellites", "fixed %"]
        heads += [f"{kind} {axis}" for kind in ("std", "mean", "rms") for axis in "ENU"]
        heads += ["min to end", "min held", "CPU s", "epochs/s"]
        for number, name in enumerate(heads):
            self.table.add_column(name, justify="left" if number < 4 else "right")
        self.ends: dict[tuple[str, str], list[tuple[float, ...]]] = {}
        self.starts: dict[tuple[str, str], list[tuple[Convergence | None, float]]] = {}

    def add(
        self, program: str, setting: Setting, span: Span, length: str, first_ns: int, track: Track,
        place: Floats,
    ) -> None:  # fmt: skip
        """One run of one session."""
        hours = [(t - first_ns) / HOUR_NS for t in span]
        session = f"{hours[0]:.0f} to {hours[1]:.1f} h"
        mode = setting.name.split()[1]
        length_s = (span[1] - span[0]) / NS_PER_S
        starts = self.starts.setdefault((f"{program} {setting.name}", length), [])
        if len(track.times_ns) == 0:
            self.table.add_row(program, setting.systems, mode, session, "0")
            starts.append((None, length_s))
            return
        enu = off(track, place)
        start = min(HOUR_NS, (span[1] - span[0]) // 2)
        late = track.times_ns - span[0] >= start
        found = convergence_of(track.times_ns, enu, start_ns=span[0])
        starts.append((found, length_s))
        numbers = np.concatenate(
            [f(enu[late]) for f in (_std, _mean, _rms)] if late.any() else [np.full(9, np.nan)]
        )
        self.table.add_row(
            program,
            setting.systems,
            mode,
            session,
            f"{len(track.times_ns)}",
            f"{np.mean(track.satellites):.1f}",
            f"{100.0 * np.mean(track.quality == FIXED):.1f}",
            *(f"{MM * value:.1f}" for value in numbers),
            minutes(found.to_the_end_s[EACH]),
            minutes(found.held_s[EACH]),
            f"{track.cpu_s:.2f}",
            f"{len(track.times_ns) / track.cpu_s:.0f}",
        )
        if setting.static:
            key = (f"{program} {setting.systems}", length)
            self.ends.setdefault(key, []).append(tuple(enu[-1]))
        for word, quality in (("float", FLOAT), ("fixed", FIXED)):
            rows = late & (track.quality == quality)
            if rows.any() and (track.quality == FIXED).any():
                std = _std(enu[rows])
                cells = [f"{MM * value:.1f}" for value in std]
                flat = f"horizontal {MM * float(np.hypot(std[0], std[1])):.1f}"
                self.table.add_row(f"  {word}", flat, "", "", str(rows.sum()), "", "", *cells)

    def convergence(self) -> Table | None:
        """Minutes to convergence over many sessions; None where there are few."""
        table = Table(title="Minutes to 10 cm, held for ten minutes", title_justify="left")
        for name in ("program", "session", "count", "never", "mean", "median", "most"):
            table.add_column(name)
        for axis in LOCAL_AXES:
            table.add_column(f"mean {axis}")
        for (program, session), starts in self.starts.items():
            if len(starts) > MANY:
                each, *axes = (minutes_held(starts, name) for name in (EACH, *LOCAL_AXES))
                never = [found is None or found.held_s[EACH] is None for found, _ in starts]
                cells = [np.mean(each), np.median(each), np.max(each), *map(np.mean, axes)]
                words = [f"{value:.1f}" for value in cells]
                table.add_row(program, session, str(len(starts)), str(sum(never)), *words)
        return table if table.row_count else None

    def repeatability(self) -> Table:
        """Last positions of static sessions about their mean."""
        table = Table(title="Last positions of static sessions, mm", title_justify="left")
        for name in ("program", "session", "count", "std E", "std N", "std U", "horizontal"):
            table.add_column(name)
        for name in ("most E", "most N", "most U", "most horizontal"):
            table.add_column(name)
        for (program, session), ends in self.ends.items():
            found = repeatability_of(ends)
            if found is not None:
                cells = [*found.std_m.values(), *found.greatest_m.values()]
                words = [f"{MM * value:.1f}" for value in cells]
                table.add_row(program, session, str(found.sessions), *words)
        return table


def minutes_held(starts: Sequence[tuple[Convergence | None, float]], axis: str) -> list[float]:
    """Minutes until the error of an axis was held, the length (s) of a session where never."""
    held = [None if found is None else found.held_s[axis] for found, _ in starts]
    return [
        (length if s is None else s) / 60.0 for s, (_, length) in zip(held, starts, strict=True)
    ]


def _std(enu: Floats) -> Floats:
    return np.std(enu, axis=0)


def _mean(enu: Floats) -> Floats:
    return np.mean(enu, axis=0)


def _rms(enu: Floats) -> Floats:
    return np.sqrt(np.mean(enu * enu, axis=0))


def spans_of(
    first_ns: int, last_ns: int, hours: Sequence[float], every: float | None = None
) -> dict[Span, str]:
    """Sessions of given lengths, by which they are told, the last cut where the orbits end.

    One begins where the one before it ends, or every so many hours.
    """
    found: dict[Span, str] = {}
    for length in hours:
        length_ns = round(length * HOUR_NS)
        step_ns = length_ns if every is None else round(every * HOUR_NS)
        for begin in range(first_ns, last_ns, step_ns):
            found.setdefault((begin, min(begin + length_ns - NS_PER_S, last_ns)), f"{length:g} h")
    return found


def bounds(log: Path, receiver: str) -> Span:
    """First epoch, and the last that the orbits reach."""
    with LogReader(log) as reader:
        times = reader.read(channels.GNSS_OBS.at(receiver=receiver)).valid_time_ns
        orbits = reader.read(channels.PRECISE_ORBIT.at()).valid_time_ns
    return int(times.min()), int(min(times.max(), orbits.max()))


def theirs(files: Files, setting: Setting, target: Path, span: Span) -> Track | None:
    """RTKLIB's positions; None where it gives none, as without navigation messages."""
    try:
        if setting.program == "2.4.3":
            track = solve(files, setting, target, *span)
        else:  # both versions are not to be had in one process
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                track = pool.submit(solve, files, setting, target, *span).result()
    except UsageError:
        return None
    return track if len(track.times_ns) else None


def measure(arguments: argparse.Namespace, station: str, scratch: Path, console: Console) -> None:
    """One station."""
    name = STATIONS[station]
    folder = arguments.data / name
    log = scratch / "in.mcap"
    import_log(SPECS / f"{name}.toml", folder, log)
    files = unpack(load_spec(SPECS / f"{name}.toml"), folder, scratch)
    systems = arguments.systems or SYSTEMS[station]
    first, last = bounds(log, station)
    whole = Setting(systems[-1], static=True, mask_deg=arguments.mask)
    target = scratch / "rtklib.pos"
    best = theirs(files, whole, target, (first, last))
    if arguments.reference:
        place, words = np.array(arguments.reference), "as given"
    elif best is not None:
        place, words = best.positions[-1], f"RTKLIB, {whole.name}, whole span"
    else:
        track = run_ours(log, scratch / "out.mcap", station, our_tables(whole, arguments.set))
        place, words = track.positions[-1], f"ours, {whole.name}, whole span"
    report = Report(f"{name}, mm; mean and rms from {np.round(place, 4)} m ({words})")
    warm = True
    spans = spans_of(first, last, arguments.hours or HOURS[station], arguments.every)
    for span, length in spans.items():
        part = scratch / "part.mcap"
        cut(log, station, span, part)
        for letters in systems:
            for mode in arguments.modes:
                setting = Setting(letters, static=mode == "static", mask_deg=arguments.mask)
                for program, peer in peers(setting, arguments.demo5):
                    track = theirs(files, peer, target, span)
                    if track is not None:
                        report.add(program, setting, span, length, first, track, place)
                if arguments.no_ours:
                    continue
                tables = our_tables(setting, arguments.set)
                if warm:  # what is compiled on first use costs nothing after
                    run_ours(part, scratch / "out.mcap", station, tables)
                    warm = False
                track = run_ours(part, scratch / "out.mcap", station, tables)
                report.add("replay", setting, span, length, first, track, place)
    console.print(report.table)
    console.print(report.repeatability())
    convergence = report.convergence()
    if convergence is not None:
        console.print(convergence)
    reading = theirs(files, Setting(), target, (first, first + NS_PER_S))
    if reading is None:
        console.print("RTKLIB gives no position of these files.")
    else:
        console.print(f"RTKLIB's reading alone: {reading.cpu_s:.2f} s of its CPU seconds.")


def peers(setting: Setting, demo5: bool) -> list[tuple[str, Setting]]:
    """RTKLIB as it is to be run, by name."""
    found = [("RTKLIB 2.4.3", setting)]
    # demo5 has no position as soon as GLONASS is among the systems.
    if demo5 and "R" not in setting.systems:
        more = {"program": "demo5", "mask_deg": setting.mask_deg}
        plain = Setting(setting.systems, setting.static, **more)
        uncombined = Setting(setting.systems, setting.static, "estimated", frequencies=3, **more)
        found += [("RTKLIB demo5", plain), ("RTKLIB demo5, uncombined", uncombined)]
    return found


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--station", nargs="+", choices=STATIONS, default=list(STATIONS))
    parser.add_argument("--systems", nargs="+", help="letters, as G GE GER")
    parser.add_argument("--modes", nargs="+", default=["kinematic", "static"],
                        choices=("kinematic", "static"))  # fmt: skip
    parser.add_argument("--hours", type=float, nargs="+", help="lengths of sessions")
    parser.add_argument("--every", type=float, help="hours from one start to the next")
    parser.add_argument("--mask", type=float, default=10.0, help="degrees")
    parser.add_argument("--reference", type=float, nargs=3, help="ECEF, m")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the stations' folders")
    parser.add_argument("--demo5", action="store_true", help="demo5 too; needs pyrtklib5")
    parser.add_argument("--no-ours", action="store_true", help="RTKLIB alone")
    parser.add_argument("--set", action="append", default=[], help="as of replay run")
    arguments = parser.parse_args()
    if arguments.demo5 and not available("demo5"):
        parser.error("pyrtklib5 is not installed: pip install pyrtklib5")
    console = Console(width=230)
    for station in arguments.station:
        with tempfile.TemporaryDirectory() as scratch:
            measure(arguments, station, Path(scratch), console)


if __name__ == "__main__":
    main()
