"""Corrected pseudoranges with satellite positions, a matrix of the iXR program's MATLAB files.

Each row is a satellite at an epoch: a pseudorange of GPS or QZSS L1 C/A from which
satellite clock, ionosphere, troposphere and group delay are taken off, the satellite's
position with the Earth's turning during the flight, range rate, velocity and clock rate.
The range rate is that of the model

    range_rate = u . (v_satellite - v_receiver) + c * receiver_drift - c * satellite_drift

with u from receiver to satellite. Three things are put right, so that the channels hold
what their schema says:

* The time of week is GPS time, the offset of the receiver's clock taken off. The channels
  hold the receiver's own epoch, as everywhere: least squares give the offset, and as the
  receiver counts whole milliseconds, rounding to them takes away its error.
* The file turns positions by the pseudorange over c, which is the flight and the clock
  offset; the part of the offset (7 ms, 2.6 m of the receiver's position) is undone.
* The velocity is that of the Earth-fixed axes of transmission less the second-order term
  w^2 t r of a position already turned (w Earth rate, t flight, r from the Earth's axis).
  The term is put back and the velocity turned into the axes of reception. At rest this
  takes a bias of 9 mm/s off the velocity that the range rates give.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from replay import channels, time
from replay.errors import ForeignFileError
from replay.gnss.signals import frequency_hz
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.geodesy import Places
from replay.importers.matlab import read_mat
from replay.importers.spec import Stream
from replay.importers.table import Float64, Int64, Mask, Table
from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.elementary import atan2, sincos
from replay.kernels.ephemeris import SYSTEM_GPS
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.log.columns import Column, Columns

_COLUMNS: Final = (
    "epoch", "week", "tow", "prn", "pseudorange", "x", "y", "z", "range_rate", "clock_rate",
    "vx", "vy", "vz", "elevation", "cn0", "drift",
)  # fmt: skip
_TURN: Final = 2.0 * math.pi
_SIGNAL: Final = b"1C"
_WAVELENGTH_M: Final = SPEED_OF_LIGHT_M_S / frequency_hz(SYSTEM_GPS, 1)
# From the Earth's centre GPS satellites are at 26 600 km, those of QZSS beyond 38 000 km.
_QZSS_RADIUS_M: Final = 34.0e6
_MILLISECOND_NS: Final = 1_000_000
_CLOSE_NS: Final = 10_000  # of a whole millisecond: a position's error of 3 km
_ITERATIONS: Final = 8
_UNKNOWNS: Final = 4
_NO_ISSUE: Final = -1
_UNMODELLED: Final = (
    "sagnac_m", "satellite_clock_m", "relativity_m", "group_delay_m", "ionosphere_m",
    "hydrostatic_m", "wet_m", "hydrostatic_mapping", "wet_mapping",
)  # fmt: skip


def corrected_ranges_stream(file: File, findings: Findings, stream: Stream) -> dict[str, Columns]:
    """Observations, satellites and (empty) corrections of every row.

    Distance, azimuth and the receiver's epoch are those of a position and clock offset
    that least squares give for each epoch from its own pseudoranges.

    Raises
    ------
    ForeignFileError
        Where the file holds no such matrix, or no epoch has four satellites.
    """
    table = read_mat(file, "", _COLUMNS)
    table = table.take(_usable(table, findings))
    times = np.zeros(len(table), dtype=np.int64)
    weeks = table.number("week")
    for week in np.unique(weeks):
        rows = weeks == week
        times[rows] = time.from_week(int(week), table.number("tow")[rows])
    position = np.stack([table.number(name) for name in "xyz"], axis=1)
    qzss = _lengths(position) > _QZSS_RADIUS_M
    names = _names(table.number("prn").astype(np.int64), qzss)
    order = np.lexsort((names, times)).astype(np.int64)
    table, times, names, position = table.take(order), times[order], names[order], position[order]
    solved = _solutions(table, times, position, file)
    clock_s = solved[:, 3] / SPEED_OF_LIGHT_M_S
    places, position = _turn(solved[:, :3], -clock_s), _turn(position, -clock_s)
    times = _own_epochs(times, clock_s, file, findings)
    satellite: dict[str, Column] = {"satellite": names}
    signal: dict[str, Column] = {**satellite, "signal": np.full(len(table), _SIGNAL)}
    toward = position - places
    distance = _lengths(toward)
    zero = np.zeros(len(table))
    observations = {
        "pseudorange_m": table.number("pseudorange"),
        "doppler_hz": -table.number("range_rate") / _WAVELENGTH_M,
        "cn0_dbhz": table.number("cn0"),
    }
    sights: dict[str, Column] = {
        "position_ecef_m": position,
        "velocity_ecef_m_s": _velocities(table, position, distance / SPEED_OF_LIGHT_M_S),
        "clock_s": zero,
        "clock_drift_s_s": table.number("clock_rate"),
        "elevation_rad": table.number("elevation") * (_TURN / 360.0),
        "azimuth_rad": _azimuths(toward, places),
        "range_std_m": zero,
        "ephemeris_age_s": zero,
        "issue": np.full(len(table), _NO_ISSUE, dtype=np.int64),
        "health": np.zeros(len(table), dtype=np.int64),
    }
    findings.notes += [
        f"{file.name}: distance and azimuth are those from each epoch's own least-squares "
        "position, not from the truth",
        f"{file.name}: satellite positions were turned back by the clock offset, velocities into "
        "the axes of reception",
        f"{file.name}: the last column, a receiver drift for each row, has no field",
    ]
    epochs, counts = np.unique(times, return_counts=True)
    receiver = stream.receiver
    return {
        channels.RECEIVER_EPOCH.at(receiver=receiver): Columns.build(
            epochs,
            {
                "flag": np.zeros(len(epochs), dtype=np.uint32),
                "satellite_count": counts.astype(np.uint32),
            },
        ),
        channels.GNSS_OBS.at(receiver=receiver): Columns.build(
            times,
            signal | observations,
            present=dict.fromkeys(observations, np.ones(len(table), dtype=np.bool_)),
        ),
        channels.SATELLITES.at(receiver=receiver): Columns.build(times, satellite | sights),
        channels.CORRECTIONS.at(receiver=receiver): Columns.build(
            times, signal | {"distance_m": distance} | dict.fromkeys(_UNMODELLED, zero)
        ),
    }


def _usable(table: Table, findings: Findings) -> Int64:
    """Rows that hold numbers throughout and a satellite that can be named."""
    keep = np.ones(len(table), dtype=np.bool_)
    prn, week = table.number("prn"), table.number("week")
    for what, hit in (
        (
            "a number is missing; row skipped",
            ~np.all([np.isfinite(table.number(name)) for name in _COLUMNS[:-1]], axis=0),
        ),
        (
            "the satellite or the week is no whole number; row skipped",
            (prn != np.floor(prn)) | (prn < 1) | (prn > 99) | (week != np.floor(week)) | (week < 0),
        ),
    ):
        mend = "line numbers are rows of the matrix: mend the row"
        findings.rows(what, table.file.name, table.lines[keep & hit], mend)
        keep &= ~hit
    rows = np.flatnonzero(keep)
    key = np.stack([week[rows], table.number("tow")[rows], prn[rows]], axis=1)
    far = np.abs(table.number("z")[rows])  # QZSS and GPS share numbers
    _, first = np.unique(np.column_stack([key, far]), axis=0, return_index=True)
    twice = np.setdiff1d(np.arange(len(rows)), first)
    what = "a row stands twice; the first one kept"
    findings.rows(what, table.file.name, table.lines[rows[twice]], "remove one")
    return rows[np.sort(first)].astype(np.int64)


def _names(prn: Int64, qzss: Mask) -> npt.NDArray[np.bytes_]:
    letters = np.empty((len(prn), 3), dtype=np.uint8)
    letters[:, 0] = np.where(qzss, ord("J"), ord("G"))
    letters[:, 1] = ord("0") + prn // 10
    letters[:, 2] = ord("0") + prn % 10
    return letters.view("S3").reshape(-1)


def _own_epochs(times: Int64, clock_s: Float64, file: File, findings: Findings) -> Int64:
    """Epochs by the receiver's clock."""
    own = times + np.rint(clock_s * time.NS_PER_S).astype(np.int64)
    whole = (own + _MILLISECOND_NS // 2) // _MILLISECOND_NS * _MILLISECOND_NS
    off = int(np.abs(own - whole).max())
    first, last = (float(clock_s[k] * 1e3) for k in (0, -1))
    text = f"{file.name}: the clock offset, {first:.3f} ms at first and {last:.3f} ms at last, was "
    if off < _CLOSE_NS:
        text += f"put back into the times; they lay within {off} ns of whole milliseconds"
        own = whole
    else:
        text += "put back into the times, with the error of least squares"
    findings.notes.append(text)
    return own


def _solutions(table: Table, times: Int64, satellites: Float64, file: File) -> Float64:
    """Position and clock offset (m) for every row, by Gauss-Newton steps from its epoch's ranges.

    They are weighted by elevation. An epoch of fewer than four satellites, or of four
    that lie badly, has the solution of the one before. Sums run row by row, so that
    they are the same on every machine.
    """
    _, epoch = np.unique(times, return_inverse=True)
    ranges = table.number("pseudorange")
    weight = np.maximum(table.number("elevation"), 1.0) / 90.0
    weight = weight * weight
    state = np.zeros((int(epoch[-1]) + 1, _UNKNOWNS))
    for _ in range(_ITERATIONS):
        toward = satellites - state[epoch, :3]
        distance = _lengths(toward)
        rows = [*(-toward[:, k] / distance for k in range(3)), np.ones(len(ranges))]
        residual = ranges - distance - state[epoch, 3]
        normal = [[_sums(epoch, weight * one * other) for other in rows] for one in rows]
        right = [_sums(epoch, weight * one * residual) for one in rows]
        state = state + _solve(normal, right)
    good = np.isfinite(state).all(axis=1) & (np.bincount(epoch) >= _UNKNOWNS)
    if not good.any():
        raise ForeignFileError("no epoch has four satellites", where=file.name, mend="take more")
    last = np.maximum.accumulate(np.where(good, np.arange(len(good)), int(np.argmax(good))))
    return np.asarray(state[last][epoch])


def _sums(group: Int64, values: Float64) -> Float64:
    """Sum of the values of each group, added in their order."""
    return np.bincount(group, weights=values).astype(np.float64)


def _solve(normal: list[list[Float64]], right: list[Float64]) -> Float64:
    """Solutions (m, n) of m systems of n equations, by elimination; NaN where singular."""
    a = [row.copy() for row in normal]
    b = list(right)
    count = len(b)
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(count):
            for i in range(k + 1, count):
                factor = a[i][k] / a[k][k]
                a[i] = [a[i][j] - factor * a[k][j] for j in range(count)]
                b[i] = b[i] - factor * b[k]
        found: list[Float64] = [np.zeros(0)] * count
        for k in reversed(range(count)):
            rest = b[k]
            for j in range(k + 1, count):
                rest = rest - a[k][j] * found[j]
            found[k] = rest / a[k][k]
    return np.stack(found, axis=1)


def _velocities(table: Table, position: Float64, travel_s: Float64) -> Float64:
    """Velocities in the axes of reception."""
    given = np.stack([table.number(f"v{axis}") for axis in "xyz"], axis=1)
    outward = position * np.array([1.0, 1.0, 0.0])
    rate = EARTH_RATE_RAD_S * EARTH_RATE_RAD_S * travel_s
    return _turn(given + rate[:, None] * outward, travel_s)


def _turn(vectors: Float64, elapsed_s: Float64) -> Float64:
    """Vectors (n, 3) in the Earth-fixed axes of a time later by `elapsed_s`."""
    angles = [sincos(EARTH_RATE_RAD_S * elapsed) for elapsed in elapsed_s.tolist()]
    sine, cosine = np.array(angles).T
    x, y, z = vectors.T
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=1)


def _lengths(vectors: Float64) -> Float64:
    """Lengths of vectors (n, 3)."""
    x, y, z = vectors[:, 0], vectors[:, 1], vectors[:, 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def _azimuths(toward: Float64, places: Float64) -> Float64:
    """Of directions in ECEF, from true north, in [0, 2 pi)."""
    enu = Places.from_ecef(places).ecef_to_enu(toward)
    azimuth = np.array([atan2(east, north) for east, north, _ in enu.tolist()])
    azimuth = np.where(azimuth < 0.0, azimuth + _TURN, azimuth)
    return np.where(azimuth >= _TURN, 0.0, azimuth)
