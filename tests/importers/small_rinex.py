"""Small RINEX files with known contents, and the spec that imports them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from replay import time

POSITION = (-2430649.9956, -4703693.1521, 3544979.9129)
FIRST = time.parse_calendar("2020-07-12T01:36:23.994")
SENT = (5400.0, 5430.0)  # seconds of the week 2114; the first epoch is at 5783.994

SPEC = """\
title = "small"
origin = "https://example.org/small"
licence = "CC0-1.0"

[sources.obs]
file = "rover.obs"
format = "rinex-obs"

[sources.nav]
file = "one.nav"
format = "rinex-nav"

[sources.nav2]
file = "two.nav"
format = "rinex-nav"

[streams.rover]
source = "obs"

[streams.nav]
source = ["nav", "nav2"]
"""


def record(text: str, label: str) -> str:
    return f"{text:<60}{label}\n"


HEADER = (
    record(f"{'3.03':>9}{'':11}{'OBSERVATION DATA':<20}M", "RINEX VERSION / TYPE")
    + record("MARK", "MARKER NAME")
    + record(f"{'123':<20}{'TRIMBLE NETR9':<20}{'5.37':<20}", "REC # / TYPE / VERS")
    + record(f"{'7':<20}{'TRM57971.00     NONE':<20}", "ANT # / TYPE")
    + record("".join(f"{part:14.4f}" for part in POSITION), "APPROX POSITION XYZ")
    + record(f"{1.5:14.4f}{0.25:14.4f}{-0.125:14.4f}", "ANTENNA: DELTA H/E/N")
    + record("G    2 C1C L1C", "SYS / # / OBS TYPES")
    + record("E    1 C1X", "SYS / # / OBS TYPES")
    + record(f"{1.0:10.3f}", "INTERVAL")
    + record("", "END OF HEADER")
)


def epoch(second: int, *, flag: int = 0) -> str:
    """Two satellites, pseudoranges that tell the second."""
    return (
        f"> 2020  7 12  1 36 {second + 0.994:10.7f}  {flag}  2       {1e-6 * second:15.12f}\n"
        f"G05{20e6 + second:14.3f}  {110e6 + second:14.3f}  \n"
        f"E11{23e6 + second:14.3f}  \n"
    )


EPOCHS = (23, 24, 26)


def ephemeris(prn: int, sent_s: float, toe_s: float = 7200.0) -> str:
    """A GPS message whose numbers tell their place."""
    numbers = [1e-5 * prn, 1e-12, 0.0, 17.0, *(k + 0.5 for k in range(1, 8)), toe_s]
    numbers += [*(k + 0.5 for k in range(9, 17)), 1.0, 2114.0, 0.0, 2.0, 0.0, -1e-8, 17.0]
    numbers += [sent_s, 4.0]
    rows = [numbers[:3], *(numbers[at : at + 4] for at in range(3, len(numbers), 4))]
    text = f"G{prn:02d} 2020 07 12 02 00 00"
    for index, row in enumerate(rows):
        text += ("    " if index else "") + "".join(f"{n:19.12E}" for n in row) + "\n"
    return text


NAV_HEADER = (
    record(f"{'3.04':>9}{'':11}{'N: GNSS NAV DATA':<20}M", "RINEX VERSION / TYPE")
    + record("GPSA   1.0000E-08  2.0000E-08  3.0000E-08  4.0000E-08", "IONOSPHERIC CORR")
    + record("GPSB   8.0000E+04  1.6000E+04 -1.0000E+05 -6.0000E+04", "IONOSPHERIC CORR")
    + record("GAL    4.1000E+01  5.0000E-02  1.2500E-02  0.0000E+00", "IONOSPHERIC CORR")
    + record("GAUT  1.8626451492E-09-8.881784197E-16 259200 2114", "TIME SYSTEM CORR")
    + record("", "END OF HEADER")
)


def write(folder: Path) -> Path:
    """Write all files into a folder; the path of the spec."""
    body = "".join(epoch(second) for second in EPOCHS)
    (folder / "rover.obs").write_text(HEADER + body)
    (folder / "one.nav").write_text(NAV_HEADER + ephemeris(5, SENT[1]) + ephemeris(7, SENT[0]))
    (folder / "two.nav").write_text(NAV_HEADER + ephemeris(5, SENT[1]) + ephemeris(9, 6000.0))
    spec = folder / "small.toml"
    spec.write_text(SPEC)
    return spec


def times(*seconds: float) -> np.ndarray:
    """Epochs of seconds of the minute, by the receiver's clock."""
    return FIRST + np.array([round((s - 23) * 1e9) for s in seconds])
