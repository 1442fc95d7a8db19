"""RTKLIB's relative positioning of two receivers of a log, in this process."""

from __future__ import annotations

import numpy as np
import pyrtklib

from replay.channels import GNSS_OBS, NAV, RECEIVER
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.time import NS_PER_S

WEEK_NS = 604_800 * NS_PER_S
SLOTS = {"1C": (0, pyrtklib.CODE_L1C), "2W": (1, pyrtklib.CODE_L2W)}
ELEMENTS = {
    "e": "eccentricity", "i0": "i0", "OMG0": "omega0", "omg": "omega", "M0": "m0",
    "deln": "delta_n", "OMGd": "omega_dot", "idot": "i_dot", "crc": "crc", "crs": "crs",
    "cuc": "cuc", "cus": "cus", "cic": "cic", "cis": "cis", "toes": "toe_s", "f0": "af0",
    "f1": "af1", "f2": "af2", "iode": "iode", "iodc": "iodc", "code": "source",
}  # fmt: skip
FIXED = 1
MASK_DEG = 10.0


def gtime(time_ns: int) -> pyrtklib.gtime_t:
    """RTKLIB's time."""
    week, rest = divmod(int(time_ns), WEEK_NS)
    return pyrtklib.gpst2time(week, rest / NS_PER_S)


class Baseline:
    """Epochs of two receivers of GPS, as RTKLIB takes them.

    Parameters
    ----------
    reader : LogReader
    rover, base : str
        Receivers; both stand still, and the position of `base` is known.
    """

    def __init__(self, reader: LogReader, rover: str, base: str) -> None:
        self.fixed = 0
        self._navigation(reader.read(NAV.at()))
        place = reader.read(RECEIVER.at(receiver=base))["approximate_position_ecef_m"][0]
        self._base = [float(value) for value in place]
        # Receivers' clocks put one epoch some microseconds apart.
        sides = [_by_second(reader.read(GNSS_OBS.at(receiver=name))) for name in (rover, base)]
        common = sorted(set(sides[0]) & set(sides[1]))
        self._epochs = [_epoch([side[second] for side in sides]) for second in common]
        self.epochs = len(self._epochs)

    def solve(self) -> None:
        """All epochs, one after the other."""
        option = pyrtklib.prcopt_default
        option.mode = pyrtklib.PMODE_KINEMA
        option.navsys = pyrtklib.SYS_GPS
        option.nf = 2
        option.elmin = float(np.radians(MASK_DEG))
        option.modear = 1
        option.thresar[0] = 3.0
        option.ionoopt = pyrtklib.IONOOPT_EST
        option.tropopt = pyrtklib.TROPOPT_EST
        for axis in range(3):
            option.rb[axis] = self._base[axis]
        state = pyrtklib.rtk_t()
        pyrtklib.rtkinit(state, option)
        self.fixed = 0
        for data, count in self._epochs:
            pyrtklib.rtkpos(state, data[0], count, self._nav)
            self.fixed += state.sol.stat == FIXED
        pyrtklib.rtkfree(state)

    def _navigation(self, rows: Columns) -> None:
        gps = rows.take(np.array([name[:1] == b"G" for name in rows["satellite"].tolist()]))
        self._table = pyrtklib.Arr1Deph_t(len(gps))
        for row in range(len(gps)):
            message = self._table[row]
            message.sat = pyrtklib.satno(pyrtklib.SYS_GPS, int(gps["satellite"][row][1:]))
            for theirs, ours in ELEMENTS.items():
                setattr(message, theirs, gps[ours][row].item())
            message.A = gps["sqrt_a"][row].item() ** 2
            message.toe, message.toc = gtime(gps["toe_ns"][row]), gtime(gps["toc_ns"][row])
            message.ttr = gtime(gps["transmitted_ns"][row])
            message.week = int(gps["toe_ns"][row]) // WEEK_NS
            message.tgd[0] = gps["group_delay_1_s"][row].item()
        self._nav = pyrtklib.nav_t()
        self._nav.eph = self._table
        self._nav.n = self._nav.nmax = len(gps)


def _by_second(rows: Columns) -> dict[int, Columns]:
    seconds = (rows.valid_time_ns + NS_PER_S // 2) // NS_PER_S
    cuts = np.flatnonzero(np.diff(seconds)) + 1
    starts = np.concatenate([[0], cuts])
    ends = np.concatenate([cuts, [len(rows)]])
    return {
        int(seconds[a]): rows.take(slice(int(a), int(b))) for a, b in zip(starts, ends, strict=True)
    }


def _epoch(sides: list[Columns]) -> tuple[pyrtklib.Arr1Dobsd_t, int]:
    """Observations of both receivers at one epoch, sorted as RTKLIB wants them."""
    found: list[tuple[int, int, dict[str, tuple[float, float, float]], int]] = []
    for number, rows in enumerate(sides, start=1):
        satellites: dict[int, dict[str, tuple[float, float, float]]] = {}
        for row in range(len(rows)):
            name, signal = rows["satellite"][row].decode(), rows["signal"][row].decode()
            if name[0] == "G" and signal in SLOTS:
                satellites.setdefault(int(name[1:]), {})[signal] = (
                    float(rows["pseudorange_m"][row]),
                    float(rows["carrier_phase_cycles"][row]),
                    float(rows["doppler_hz"][row]),
                )
        time_ns = int(rows.valid_time_ns[0])
        found += [(number, sat, satellites[sat], time_ns) for sat in sorted(satellites)]
    data = pyrtklib.Arr1Dobsd_t(len(found))
    for place, (receiver, satellite, signals, time_ns) in enumerate(found):
        one = data[place]
        one.time, one.rcv = gtime(time_ns), receiver
        one.sat = pyrtklib.satno(pyrtklib.SYS_GPS, satellite)
        for signal, (code, phase, doppler) in signals.items():
            slot, kind = SLOTS[signal]
            one.code[slot], one.SNR[slot] = kind, 45_000
            one.P[slot], one.L[slot], one.D[slot] = code, phase, doppler
    return data, len(found)
