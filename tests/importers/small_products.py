"""Small files of precise products with known contents, and a recording that they go with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import small_rinex

from replay import time
from replay.importers import ImportResult, import_log
from replay.log.columns import Columns
from replay.log.reader import LogReader

record = small_rinex.record
MIDNIGHT = time.parse_calendar("2020-07-12T00:00:00")


def sp3_head(
    satellites: list[str], *, version: str = "c", day: int = 12, epochs: int = 2,
    frame: str = "IGb14", scale: str = "GPS", interval_s: float = 900.0,
) -> str:  # fmt: skip
    cells = [*satellites, *["  0"] * (17 - len(satellites))]
    return (
        f"#{version}P2020  7 {day:2d}  0  0  0.00000000 {epochs:7d} ORBIT {frame:<5} HLM  IGS\n"
        f"## 2114      0.00000000 {interval_s:14.8f} 59042 0.0000000000000\n"
        f"+  {len(satellites):3d}   {''.join(cells)}\n"
        f"++       {'  5' * 17}\n"
        f"%c M  cc {scale} ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc\n"
        "%c cc cc ccc ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc\n"
        "%f  1.2500000  1.025000000  0.00000000000  0.000000000000000\n"
        "%f  0.0000000  0.000000000  0.00000000000  0.000000000000000\n"
        "/* PCV:IGS14_2108 OL/AL:FES2012  NONE     NN ORB:CoN CLK:CoN\n"
    )


def sp3_epoch(minute: int, *, day: int = 12, second: float = 0.0) -> str:
    return f"*  2020  7 {day:2d} {minute // 60:2d} {minute % 60:2d} {second:11.8f}\n"


def sp3_row(
    satellite: str, position_km: tuple[float, float, float], clock_us: float, tail: str = ""
) -> str:
    numbers = "".join(f"{value:14.6f}" for value in (*position_km, clock_us))
    return f"P{satellite}{numbers}{tail}".rstrip() + "\n"


def clock_head(*, version: float = 3.0, scale: str = "GPS", frame: str = "IGb14") -> str:
    return (
        record(f"{version:9.2f}{'':11}C{'':19}M", "RINEX VERSION / TYPE")
        + record(f"   {scale}", "TIME SYSTEM ID")
        + record("     2    AS    AR", "# / TYPES OF DATA")
        + record("GRG  CNES", "ANALYSIS CENTER")
        + record(f"     1    {frame}", "# OF SOLN STA / TRF")
        + record("", "END OF HEADER")
    )


def clock_row(kind: str, name: str, second: float, *values: float, day: int = 12) -> str:
    minute, rest = divmod(second, 60.0)
    numbers = "".join(f"{value:19.12E} " for value in values)
    date = f"2020  7 {day:2d} {int(minute) // 60:2d} {int(minute) % 60:2d} {rest:9.6f}"
    return f"{kind} {name:<4} {date} {len(values):2d}   {numbers.rstrip()}\n"


class Recording:
    """A recording of small RINEX files that products are added to."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.spec = small_rinex.write(folder)
        self.plain = small_rinex.SPEC

    def run(
        self, *files: tuple[str, str, str | bytes], options: str = "", strict: bool = False
    ) -> ImportResult:
        """Import with files of (stream, format, contents); those of one stream go together."""
        text = self.plain
        streams: dict[str, list[str]] = {}
        for number, (stream, form, contents) in enumerate(files):
            name = f"product{number}"
            data = contents if isinstance(contents, bytes) else contents.encode()
            (self.folder / name).write_bytes(data)
            text += f'\n[sources.{name}]\nfile = "{name}"\nformat = "{form}"\n'
            streams.setdefault(stream, []).append(name)
        for stream, sources in streams.items():
            listed = ", ".join(f'"{source}"' for source in sources)
            text += f"\n[streams.{stream}]\nsource = [{listed}]\n{options}\n"
        self.spec.write_text(text)
        out = self.folder / "out.mcap"
        return import_log(self.spec, self.folder, out, strict=strict)

    def read(self, topic: str) -> Columns:
        with LogReader(self.folder / "out.mcap") as log:
            return log.read(topic)


def seconds(columns: Columns) -> np.ndarray:
    """Valid times after midnight of 2020-07-12, GPS."""
    return (columns.valid_time_ns - MIDNIGHT) / time.NS_PER_S
