"""RTKLIB's precise point positioning of a station's files, in this process.

RTKLIB 2.4.3 comes from the package `pyrtklib`, its fork demo5 from `pyrtklib5`, which is not
needed but for what 2.4.3 cannot: without the ionosphere-free combination its first ambiguity
is divided by nought (udbias_ppp, tomojitakasu/RTKLIB issue 703) and no position comes out.

What both programs are given alike: files of orbits, clocks and antennas, systems, mask,
phase centres of satellites and station, wind-up, solid Earth tides, a wet delay in the
zenith that is estimated. The rest is RTKLIB's own default.
"""

from __future__ import annotations

import dataclasses
import gzip
import importlib
import importlib.util
import time
from pathlib import Path
from typing import Any

import hatanaka
import numpy as np
import numpy.typing as npt

from replay.errors import UsageError
from replay.importers.spec import Spec
from replay.time import NS_PER_S

WEEK_NS = 604_800 * NS_PER_S
FIXED, FLOAT = 1, 2
PPP = 6  # RTKLIB's quality of a float PPP
SUFFIX = {
    "rinex-obs": "rnx",
    "rinex-nav": "nav",
    "sp3": "sp3",
    "rinex-clk": "clk",
    "antex": "atx",
    "erp": "erp",
}
PROGRAMS = {"2.4.3": "pyrtklib", "demo5": "pyrtklib5"}
SYSTEMS = {"G": "SYS_GPS", "R": "SYS_GLO", "E": "SYS_GAL", "C": "SYS_CMP", "J": "SYS_QZS"}
IONOSPHERES = {
    "free": "IONOOPT_IFLC",  # ionosphere-free combination
    "estimated": "IONOOPT_EST",  # uncombined, one slant delay per satellite
}

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, slots=True)
class Setting:
    """What is told to both programs.

    Attributes
    ----------
    systems : str
        Letters.
    static : bool
        One position for the whole session, or a new one every epoch.
    ionosphere : str
        "free" or "estimated".
    mask_deg : float
    program : str
        Of RTKLIB: "2.4.3" or "demo5".
    frequencies : int
        Of RTKLIB, where it does not combine them.
    """

    systems: str = "G"
    static: bool = False
    ionosphere: str = "free"
    mask_deg: float = 10.0
    program: str = "2.4.3"
    frequencies: int = 2

    @property
    def name(self) -> str:
        """For a person."""
        return f"{self.systems} {'static' if self.static else 'kinematic'}"


@dataclasses.dataclass(frozen=True, slots=True)
class Files:
    """Plain files, ready for RTKLIB."""

    inputs: tuple[str, ...]
    antennas: str
    rotation: str


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Positions of one session.

    Attributes
    ----------
    times_ns : int64 array (n,), GPS ns
    positions : float64 array (n, 3), m, ECEF
    quality : int64 array (n,)
        1 fixed, 2 float.
    satellites : int64 array (n,)
        Used.
    cpu_s : float
        CPU seconds of this process.
    """

    times_ns: Ints
    positions: Floats
    quality: Ints
    satellites: Ints
    cpu_s: float


def unpack(spec: Spec, folder: Path, scratch: Path) -> Files:
    """The files of an import spec without gzip and Hatanaka, named as RTKLIB tells kinds by."""
    inputs: list[str] = []
    antennas = rotation = ""
    for name, source in spec.sources.items():
        suffix = SUFFIX.get(source.format)
        if suffix is None:
            continue
        target = scratch / f"{name}.{suffix}"
        data = (folder / source.file).read_bytes()
        target.write_bytes(hatanaka.decompress(data) if suffix == "rnx" else _gunzip(data))
        if suffix == "atx":
            antennas = str(target)
        elif suffix == "erp":
            rotation = str(target)
        else:
            inputs.append(str(target))
    if not any(name.endswith(".rnx") for name in inputs):
        raise UsageError("the spec has no RINEX observations", where=str(spec.path))
    return Files(tuple(inputs), antennas, rotation)


def _gunzip(data: bytes) -> bytes:
    return gzip.decompress(data) if data.startswith(b"\x1f\x8b") else data


def available(program: str) -> bool:
    """Whether a version of RTKLIB is installed."""
    return importlib.util.find_spec(PROGRAMS[program]) is not None


def solve(
    files: Files, setting: Setting, target: Path, start_ns: int = 0, end_ns: int = 0
) -> Track:
    """RTKLIB's `postpos`, from the files to a file.

    Parameters
    ----------
    files : Files
    setting : Setting
    target : Path
        RTKLIB's file of positions.
    start_ns, end_ns : int, GPS ns
        First and last epoch; 0: of the file.

    Returns
    -------
    Track
        Without rows where RTKLIB finds no position.
    """
    lib = importlib.import_module(PROGRAMS[setting.program])
    option, output, extra = _options(lib, setting), lib.solopt_default, lib.filopt_t()
    output.posf, output.timef, output.timeu = lib.SOLF_XYZ, 0, 9
    _fill(extra.satantp, files.antennas)
    _fill(extra.rcvantp, files.antennas)
    _fill(extra.eop, files.rotation)
    name: Any = str(target)
    if setting.program == "2.4.3":
        name = lib.Arr1Dchar(1024)
        _fill(name, str(target))
    target.unlink(missing_ok=True)
    begin = time.process_time()
    status = lib.postpos(
        _gtime(lib, start_ns), _gtime(lib, end_ns), 0.0, 0.0, option, output, extra,
        list(files.inputs), len(files.inputs), name, "", "",
    )  # fmt: skip
    cpu_s = time.process_time() - begin
    if status != 0 or not target.exists():
        raise UsageError(f"RTKLIB ends with {status}")
    return _read(target, cpu_s)


def _options(lib: Any, setting: Setting) -> Any:
    option = lib.prcopt_default
    option.mode = lib.PMODE_PPP_STATIC if setting.static else lib.PMODE_PPP_KINEMA
    option.nf = setting.frequencies
    option.navsys = sum(getattr(lib, SYSTEMS[letter]) for letter in setting.systems)
    option.elmin = float(np.radians(setting.mask_deg))
    option.sateph = lib.EPHOPT_PREC
    option.ionoopt = getattr(lib, IONOSPHERES[setting.ionosphere])
    option.tropopt = lib.TROPOPT_EST
    option.tidecorr = 1  # solid Earth
    option.modear = lib.ARMODE_OFF
    # Phase centres of satellites and station, wind-up, satellites in eclipse left out.
    for place in range(4):
        option.posopt[place] = 1
    option.anttype[0, 0] = "*"  # the station's antenna as its file names it
    return option


def _fill(array: Any, text: str) -> None:
    for place, letter in enumerate(text + "\0"):
        array[place] = letter


def _gtime(lib: Any, time_ns: int) -> Any:
    if time_ns == 0:
        return lib.gtime_t()
    week, rest = divmod(time_ns, WEEK_NS)
    return lib.gpst2time(week, rest / NS_PER_S)


def _read(path: Path, cpu_s: float) -> Track:
    rows = [line.split() for line in path.read_text().splitlines() if not line.startswith("%")]
    times = [int(row[0]) * WEEK_NS + round(float(row[1]) * 1e9) for row in rows]
    quality = np.array([int(row[5]) for row in rows], dtype=np.int64)
    places = np.array([[float(value) for value in row[2:5]] for row in rows]).reshape(-1, 3)
    known = np.isfinite(places).all(axis=1)
    return Track(
        np.array(times, dtype=np.int64)[known],
        places[known],
        np.where(quality == PPP, FLOAT, quality)[known],
        np.array([int(row[6]) for row in rows], dtype=np.int64)[known],
        cpu_s,
    )
