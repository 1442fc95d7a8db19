"""RANGE and RANGECMP of NovAtel receivers (OEM7 commands and logs, 3.146 and 3.147)."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from replay.gnss.signals import wavelength_m
from replay.importers.findings import Findings
from replay.importers.frames import Frames
from replay.importers.receiver_rows import (
    HALF_CYCLE,
    LOST,
    NO_CHANNEL,
    lost_lock,
    names_of,
    observation_columns,
)
from replay.importers.table import Int64
from replay.log.columns import Columns

RANGE: Final = 43
RANGECMP: Final = 140

_ROW: Final = np.dtype(
    [
        ("prn", "<u2"), ("channel", "<u2"), ("pseudorange", "<f8"), ("pseudorange_std", "<f4"),
        ("carrier", "<f8"), ("carrier_std", "<f4"), ("doppler", "<f4"), ("cn0", "<f4"),
        ("lock", "<f4"), ("status", "<u4"),
    ]
)  # fmt: skip
_PACKED: Final = np.dtype([("status", "<u4"), ("words", "<u4", 5)])
_LETTERS: Final = {0: "G", 1: "R", 2: "S", 3: "E", 4: "C", 5: "J"}
# Table "Channel tracking status": signal types, with the RINEX codes of RINEX 3.05.
SIGNALS: Final = {
    (0, 0): "1C", (0, 5): "2P", (0, 9): "2W", (0, 14): "5Q", (0, 16): "1L", (0, 17): "2S",
    (1, 0): "1C", (1, 1): "2C", (1, 5): "2P", (1, 6): "3Q",
    (2, 0): "1C", (2, 6): "5I",
    (3, 2): "1C", (3, 6): "6B", (3, 7): "6C", (3, 12): "5Q", (3, 17): "7Q", (3, 20): "8Q",
    (4, 0): "2I", (4, 1): "7I", (4, 2): "6I", (4, 4): "2I", (4, 5): "7I", (4, 6): "6I",
    (4, 7): "1P", (4, 9): "5P", (4, 11): "7D",
    (5, 0): "1C", (5, 14): "5Q", (5, 16): "1L", (5, 17): "2S", (5, 27): "6L",
}  # fmt: skip
_PRN_LESS: Final = {1: 37, 2: 100, 5: 192}
_GLONASS: Final = 1
_PHASE_LOCK: Final = 1 << 10
_PARITY_KNOWN: Final = 1 << 11
_CODE_LOCK: Final = 1 << 12
_ROLLOVER: Final = 8_388_608.0  # cycles
_STD_M: Final = np.array(
    [0.050, 0.075, 0.113, 0.169, 0.253, 0.380, 0.570, 0.854, 1.281, 2.375, 4.750, 9.500, 19.0,
     38.0, 76.0, 152.0]
)  # fmt: skip


def decode_range(
    frames: Frames,
    bodies: Int64,
    lengths: Int64,
    times_ns: Int64,
    packed: bool,
    where: str,
    findings: Findings,
) -> Columns | None:
    """Observations of all RANGE or RANGECMP messages.

    Parameters
    ----------
    frames : Frames
    bodies, lengths : int64 array (n,)
        First byte and length of each message's body.
    times_ns : int64 array (n,), ns
    packed : bool
        Whether they are RANGECMP.
    """
    size = _PACKED.itemsize if packed else _ROW.itemsize
    counts = frames.records(bodies, np.dtype([("n", "<u4")]))["n"].astype(np.int64)
    short = lengths != 4 + counts * size
    if short.any():
        what = "a RANGE message has not the length that it says; skipped"
        findings.loss(what, where, int(short.sum()), "messages", "is the receiver known?")
        bodies, counts, times_ns = bodies[~short], counts[~short], times_ns[~short]
    epoch = np.repeat(np.arange(len(bodies)), counts)
    place = np.arange(len(epoch)) - np.repeat(np.cumsum(counts) - counts, counts)
    at = bodies[epoch] + 4 + place * size
    rows = _unpack(frames.records(at, _PACKED)) if packed else frames.records(at, _ROW)
    return _observations(times_ns[epoch], rows, packed, where, findings)


def _unpack(rows: npt.NDArray[np.void]) -> npt.NDArray[np.void]:
    """RANGECMP as RANGE; the carrier's turns are restored with its wavelength later."""
    words = rows["words"].astype(np.int64)
    out = np.zeros(len(rows), dtype=_ROW)
    out["status"] = rows["status"]
    doppler = words[:, 0] & 0xFFFFFFF
    out["doppler"] = np.where(doppler >= 1 << 27, doppler - (1 << 28), doppler) / 256.0
    out["pseudorange"] = ((words[:, 1] << 4) | (words[:, 0] >> 28)) / 128.0
    carrier = words[:, 2]
    out["carrier"] = np.where(carrier >= 1 << 31, carrier - (1 << 32), carrier) / 256.0
    out["pseudorange_std"] = _STD_M[words[:, 3] & 15]
    out["carrier_std"] = ((words[:, 3] >> 4 & 15) + 1) / 512.0
    out["prn"] = words[:, 3] >> 8 & 255
    out["lock"] = ((words[:, 3] >> 16 & 0xFFFF) | (words[:, 4] & 31) << 16) / 32.0
    out["cn0"] = 20.0 + (words[:, 4] >> 5 & 31)
    out["channel"] = words[:, 4] >> 10 & 63
    return out


def _observations(
    times: Int64, rows: npt.NDArray[np.void], packed: bool, where: str, findings: Findings
) -> Columns | None:
    status = rows["status"].astype(np.int64)
    system, kind = status >> 16 & 7, status >> 21 & 31
    table = np.zeros((8, 32), dtype="S2")
    for (one, signal), text in SIGNALS.items():
        table[one, signal] = text
    signals = table[system, kind]
    less = np.zeros(8, dtype=np.int64)
    letter = np.zeros(8, dtype=np.uint8)
    for one, text in _LETTERS.items():
        letter[one], less[one] = ord(text), _PRN_LESS.get(one, 0)
    number = rows["prn"] - less[system]
    known = (signals != b"") & (number >= 1) & (number <= 99)
    if not known.all():
        pairs = sorted(set(zip(system[~known].tolist(), kind[~known].tolist(), strict=True)))
        shown = ", ".join(f"system {a} signal {b}" for a, b in pairs)
        what = "measurements of satellites or signals without a RINEX code; skipped"
        findings.loss(what, f"{where}, {shown}", int((~known).sum()), "rows", "none is known")
    if not known.any():
        return None
    times, rows, status, system = times[known], rows[known], status[known], system[known]
    signals, satellites = signals[known], names_of(letter[system], number[known])
    channel = np.where(system == _GLONASS, rows["channel"].astype(np.int64) - 7, NO_CHANNEL)
    carrier = rows["carrier"].astype(np.float64)
    if packed:
        carrier = _with_turns(carrier, rows["pseudorange"], satellites, signals, channel)
    has_carrier, has_code = (status & _PHASE_LOCK) > 0, (status & _CODE_LOCK) > 0
    lock = rows["lock"].astype(np.float64)
    # NovAtel's accumulated range falls as the pseudorange grows.
    values = {
        "pseudorange_m": np.where(has_code, rows["pseudorange"], np.nan),
        "carrier_phase_cycles": np.where(has_carrier, -carrier, np.nan),
        "doppler_hz": np.where(has_carrier, rows["doppler"].astype(np.float64), np.nan),
        "cn0_dbhz": rows["cn0"].astype(np.float64),
        "lock_time_s": lock,
        "pseudorange_std_m": np.where(has_code, rows["pseudorange_std"], np.nan),
        "carrier_phase_std_cycles": np.where(has_carrier, rows["carrier_std"], np.nan),
    }
    lost = lost_lock(times, satellites, signals, lock, exact=False)
    half = (status & _PARITY_KNOWN) == 0
    loss = lost * np.int64(LOST) + half * np.int64(HALF_CYCLE)
    return observation_columns(times, satellites, signals, values, loss, channel, where, findings)


def _with_turns(
    carrier: npt.NDArray[np.float64],
    pseudorange: npt.NDArray[np.float64],
    satellites: npt.NDArray[np.bytes_],
    signals: npt.NDArray[np.bytes_],
    channel: Int64,
) -> npt.NDArray[np.float64]:
    """Carrier phases with the whole turns of 2^23 cycles that RANGECMP cuts off."""
    lengths = np.array(
        [
            wavelength_m(chr(name[0]), int(chr(code[0])), int(k) if name[0] == ord("R") else 0)
            if name[0] != ord("S")
            else wavelength_m("G", int(chr(code[0])))
            for name, code, k in zip(satellites.tolist(), signals.tolist(), channel, strict=True)
        ]
    )
    turns = (-pseudorange / lengths - carrier) / _ROLLOVER
    return np.asarray(carrier + np.floor(turns + 0.5) * _ROLLOVER)
