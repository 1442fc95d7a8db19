"""RXM-RAWX of u-blox: measurements of an epoch (interface description F9 HPG 1.32, 3.17.5)."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from replay import channels, time
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.frames import Frames
from replay.importers.receiver_rows import (
    HALF_CYCLE,
    LOST,
    NO_CHANNEL,
    epoch_columns,
    lost_lock,
    names_of,
    observation_columns,
)
from replay.importers.table import Int64
from replay.log.columns import Columns

GPS: Final = 0
SBAS: Final = 1
GALILEO: Final = 2
BEIDOU: Final = 3
QZSS: Final = 5
GLONASS: Final = 6
NAVIC: Final = 7

LETTERS: Final = {
    GPS: "G", SBAS: "S", GALILEO: "E", BEIDOU: "C", QZSS: "J", GLONASS: "R", NAVIC: "I",
}  # fmt: skip
# Interface description, 1.5.4: signal identifiers; the codes are those of RINEX 3.05.
SIGNALS: Final = {
    (GPS, 0): "1C", (GPS, 3): "2L", (GPS, 4): "2S", (GPS, 6): "5I", (GPS, 7): "5Q",
    (SBAS, 0): "1C",
    (GALILEO, 0): "1C", (GALILEO, 1): "1B", (GALILEO, 3): "5I", (GALILEO, 4): "5Q",
    (GALILEO, 5): "7I", (GALILEO, 6): "7Q", (GALILEO, 8): "6B", (GALILEO, 9): "6C",
    (GALILEO, 10): "6A",
    (BEIDOU, 0): "2I", (BEIDOU, 1): "2I", (BEIDOU, 2): "7I", (BEIDOU, 3): "7I",
    (BEIDOU, 4): "6I", (BEIDOU, 10): "6I", (BEIDOU, 5): "1P", (BEIDOU, 6): "1D",
    (BEIDOU, 7): "5P", (BEIDOU, 8): "5D",
    (QZSS, 0): "1C", (QZSS, 1): "1Z", (QZSS, 4): "2S", (QZSS, 5): "2L", (QZSS, 8): "5I",
    (QZSS, 9): "5Q", (QZSS, 12): "1E",
    (GLONASS, 0): "1C", (GLONASS, 2): "2C",
    (NAVIC, 0): "5A",
}  # fmt: skip

_HEAD: Final = np.dtype(
    [
        ("tow_s", "<f8"), ("week", "<u2"), ("leap_s", "i1"), ("count", "u1"),
        ("state", "u1"), ("version", "u1"), ("reserved", "u1", 2),
    ]
)  # fmt: skip
_MEASUREMENT: Final = np.dtype(
    [
        ("pseudorange_m", "<f8"), ("carrier_cycles", "<f8"), ("doppler_hz", "<f4"),
        ("system", "u1"), ("satellite", "u1"), ("signal", "u1"), ("frequency", "u1"),
        ("lock_ms", "<u2"), ("cn0", "u1"), ("code_std", "u1"), ("carrier_std", "u1"),
        ("doppler_std", "u1"), ("tracking", "u1"), ("reserved", "u1"),
    ]
)  # fmt: skip
_CLOCK_RESET: Final = 2
_CODE_VALID: Final = 1
_CARRIER_VALID: Final = 2
_HALF_KNOWN: Final = 4
_HALF_TAKEN: Final = 8
_NO_STD: Final = 15
_SBAS_LESS: Final = 100
_UNKNOWN_SLOT: Final = 255
_PAYLOAD: Final = 6
_POWER_FAILURE: Final = 1


def decode_rawx(
    file: File, frames: Frames, offsets: Int64, lengths: Int64, receiver: str, findings: Findings
) -> tuple[dict[str, Columns], Int64]:
    """Observations and epochs of all RXM-RAWX frames.

    A measurement's time is the receiver's own, its clock error included. The epoch's
    flag is 1 where the receiver says that it reset its clock.

    Returns
    -------
    dict of topic to Columns
    int64 array (n,)
        Time of each frame, GPS nanoseconds.
    """
    heads = frames.records(offsets + _PAYLOAD, _HEAD)
    counts = heads["count"].astype(np.int64)
    short = lengths != 8 + _HEAD.itemsize + counts * _MEASUREMENT.itemsize
    if short.any():
        what = "an RXM-RAWX frame has not the length that it says; skipped"
        where = f"{file.name}, byte {int(offsets[short][0])}"
        findings.loss(what, where, int(short.sum()), "messages", "is the receiver known?")
        offsets, heads, counts = offsets[~short], heads[~short], counts[~short]
    times = np.zeros(len(heads), dtype=np.int64)
    for week in np.unique(heads["week"]):
        rows = heads["week"] == week
        times[rows] = time.from_week(int(week), heads["tow_s"][rows])

    epoch = np.repeat(np.arange(len(heads)), counts)
    place = np.arange(len(epoch)) - np.repeat(np.cumsum(counts) - counts, counts)
    at = offsets[epoch] + _PAYLOAD + _HEAD.itemsize + place * _MEASUREMENT.itemsize
    found = {}
    resets = (heads["state"] & _CLOCK_RESET) > 0
    if len(heads):
        flags = np.where(resets, _POWER_FAILURE, 0)
        topic = channels.RECEIVER_EPOCH.at(receiver=receiver)
        rows = frames.records(at, _MEASUREMENT)
        satellites = rows["system"].astype(np.int64) * 256 + rows["satellite"]
        seen = np.unique(np.stack([epoch, satellites], axis=1), axis=0)[:, 0]
        found[topic] = epoch_columns(times, flags, np.bincount(seen, minlength=len(heads)))
        if len(rows):
            found[channels.GNSS_OBS.at(receiver=receiver)] = _observations(
                file, times[epoch], rows, findings
            )
    if resets.any():
        text = f"{file.name}: the receiver reset its clock {int(resets.sum())} times"
        findings.notes.append(text)
    return found, times


def _observations(
    file: File, times: Int64, rows: npt.NDArray[np.void], findings: Findings
) -> Columns:
    system, number = rows["system"].astype(np.int64), rows["satellite"].astype(np.int64)
    table = np.zeros((256, 256), dtype="S2")
    for (one, signal), text in SIGNALS.items():
        table[one, signal] = text
    letter = np.zeros(256, dtype=np.uint8)
    for one, text in LETTERS.items():
        letter[one] = ord(text)
    signals = table[system, rows["signal"]]
    slots = (system == GLONASS) & (number == _UNKNOWN_SLOT)
    number = np.where(system == SBAS, number - _SBAS_LESS, number)
    known = (signals != b"") & (number >= 1) & (number <= 99)
    unknown = ~known & ~slots
    for hit, what in (
        (slots, "measurements of GLONASS satellites whose slot is not known; skipped"),
        (unknown, "measurements of signals without a RINEX code; skipped"),
    ):
        if hit.any():
            pairs = sorted(
                set(zip(system[hit].tolist(), rows["signal"][hit].tolist(), strict=True))
            )
            shown = ", ".join(f"gnssId {a} sigId {b}" for a, b in pairs)
            findings.loss(what, f"{file.name}, {shown}", int(hit.sum()), "rows", "none is known")
    times, rows, signals = times[known], rows[known], signals[known]
    satellites = names_of(letter[system[known]], number[known])
    tracking = rows["tracking"]
    has_carrier = (tracking & _CARRIER_VALID) > 0
    lock = rows["lock_ms"] * 1e-3
    code_std, carrier_std = rows["code_std"] & 15, rows["carrier_std"] & 15
    doppler_std = rows["doppler_std"] & 15
    doppler_hz = rows["doppler_hz"].astype(np.float64)
    cn0 = rows["cn0"].astype(np.float64)
    has_code = (tracking & _CODE_VALID) > 0
    values = {
        "pseudorange_m": np.where(has_code, rows["pseudorange_m"], np.nan),
        "carrier_phase_cycles": np.where(has_carrier, rows["carrier_cycles"], np.nan),
        "doppler_hz": doppler_hz,
        "cn0_dbhz": np.where(cn0 > 0.0, cn0, np.nan),
        "lock_time_s": lock,
        # 0.01 m, 0.002 Hz times powers of two; 0.004 cycle times the number.
        "pseudorange_std_m": np.where(has_code, np.ldexp(0.01, code_std.astype(np.int32)), np.nan),
        "carrier_phase_std_cycles": np.where(
            has_carrier & (carrier_std != _NO_STD), carrier_std * 0.004, np.nan
        ),
        "doppler_std_hz": np.ldexp(0.002, doppler_std.astype(np.int32)),
    }
    lost = lost_lock(times, satellites, signals, lock, exact=True)
    lost |= _half_moved(times, satellites, signals, (tracking & _HALF_TAKEN) > 0)
    half = (tracking & _HALF_KNOWN) == 0
    loss_of_lock = lost * np.int64(LOST) + half * np.int64(HALF_CYCLE)
    channel = np.where(
        rows["system"] == GLONASS, rows["frequency"].astype(np.int64) - 7, NO_CHANNEL
    )
    return observation_columns(
        times, satellites, signals, values, loss_of_lock, channel, file.name, findings
    )


def _half_moved(
    times: Int64,
    satellites: npt.NDArray[np.bytes_],
    signals: npt.NDArray[np.bytes_],
    taken: npt.NDArray[np.bool_],
) -> npt.NDArray[np.bool_]:
    """Where the half cycle that is taken off a phase changed since the row before."""
    order = np.lexsort((times, signals, satellites))
    s, b, h = satellites[order], signals[order], taken[order]
    moved = np.zeros(len(order), dtype=np.bool_)
    moved[1:] = (s[1:] == s[:-1]) & (b[1:] == b[:-1]) & (h[1:] != h[:-1])
    out = np.zeros(len(order), dtype=np.bool_)
    out[order] = moved
    return out
