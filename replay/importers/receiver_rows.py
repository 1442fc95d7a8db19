"""Rows of channels from what the formats of receivers give, whatever the format."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay import channels, time
from replay.gnss.ephemerides import ephemeris_columns
from replay.importers.findings import Findings
from replay.importers.geodesy import Places
from replay.importers.navbits import Ionosphere
from replay.importers.table import Float64, Int64, Mask
from replay.kernels.ephemeris import EPHEMERIS_DTYPE
from replay.log.columns import Column, Columns, Ragged

Names = npt.NDArray[np.bytes_]

LOST: Final = 1  # RINEX 3.05, loss-of-lock indicator: bit 0
HALF_CYCLE: Final = 2  # bit 1: the ambiguity may be a half cycle
NO_CHANNEL: Final = -99
_DOUBLES: Final = (
    "pseudorange_m", "carrier_phase_cycles", "doppler_hz", "cn0_dbhz", "lock_time_s",
    "pseudorange_std_m", "carrier_phase_std_cycles", "doppler_std_hz",
)  # fmt: skip


def names_of(letters: npt.NDArray[np.uint8], numbers: Int64) -> Names:
    """RINEX 3 satellites, `S3` array (n,), of letters and numbers 1 to 99."""
    text = np.empty((len(letters), 3), dtype=np.uint8)
    text[:, 0] = letters
    text[:, 1] = numbers // 10 + ord("0")
    text[:, 2] = numbers % 10 + ord("0")
    return text.view("S3").reshape(-1)


def observation_columns(
    times_ns: Int64,
    satellites: Names,
    signals: Names,
    values: dict[str, Float64],
    loss_of_lock: Int64,
    glonass_channels: Int64,
    where: str,
    findings: Findings,
) -> Columns:
    """Rows of `replay.GnssObservation`, sorted by time, satellite, signal.

    Parameters
    ----------
    times_ns : int64 array (n,), ns
    satellites, signals : S3 and S2 array (n,)
    values : mapping of field to float64 array (n,)
        Of the fields that are doubles; what is left out, and NaN, is absent.
    loss_of_lock : int64 array (n,)
        RINEX bits; absent where the carrier phase is.
    glonass_channels : int64 array (n,)
        NO_CHANNEL where absent.
    where : str
        File, for findings.
    findings : Findings
        A signal that stands twice in an epoch is counted; the first is kept.
    """
    order = np.lexsort((signals, satellites, times_ns))
    again = np.zeros(len(order), dtype=np.bool_)
    t, s, b = times_ns[order], satellites[order], signals[order]
    again[1:] = (t[1:] == t[:-1]) & (s[1:] == s[:-1]) & (b[1:] == b[:-1])
    if again.any():
        what = "a signal of a satellite stands twice in an epoch; the first kept"
        mend = "is the file two recordings, one after the other?"
        findings.loss(what, where, int(again.sum()), "rows", mend)
    keep = order[~again]
    fields: dict[str, Column] = {"satellite": satellites[keep], "signal": signals[keep]}
    present: dict[str, Mask] = {}
    for name in _DOUBLES:
        column = values[name][keep] if name in values else np.full(len(keep), np.nan)
        fields[name] = column
        present[name] = np.isfinite(column)
    present["loss_of_lock"] = present["carrier_phase_cycles"]
    fields["loss_of_lock"] = np.where(present["loss_of_lock"], loss_of_lock[keep], 0).astype(
        np.uint32
    )
    fields["signal_strength"] = np.zeros(len(keep), dtype=np.uint32)
    present["signal_strength"] = np.zeros(len(keep), dtype=np.bool_)
    present["glonass_channel"] = glonass_channels[keep] != NO_CHANNEL
    fields["glonass_channel"] = np.where(
        present["glonass_channel"], glonass_channels[keep], 0
    ).astype(np.int32)
    return Columns.build(times_ns[keep], fields, present=present)


def lost_lock(
    times_ns: Int64, satellites: Names, signals: Names, lock_s: Float64, *, exact: bool
) -> Mask:
    """Where a signal's lock broke since its row before.

    Its lock time fell or, where it is exact and not a lower bound, is zero or
    shorter than what has passed.
    """
    order = np.lexsort((times_ns, signals, satellites))
    t, s, b, lock = times_ns[order], satellites[order], signals[order], lock_s[order]
    lost = lock <= 0.0 if exact else np.zeros(len(order), dtype=np.bool_)
    if len(order) > 1:
        same = (s[1:] == s[:-1]) & (b[1:] == b[:-1])
        fell = lock[1:] < lock[:-1]
        if exact:
            fell |= lock[1:] < np.diff(t) / time.NS_PER_S - 1e-3
        lost[1:] |= same & fell
    out = np.zeros(len(order), dtype=np.bool_)
    out[order] = lost
    return out


def epoch_columns(
    times_ns: Int64, flags: Int64, counts: Int64, clock_offsets_s: Float64 | None = None
) -> Columns:
    """Rows of `replay.ReceiverEpoch`, in the order of their times."""
    order = np.argsort(times_ns, kind="stable")
    offsets = np.full(len(times_ns), np.nan) if clock_offsets_s is None else clock_offsets_s
    return Columns.build(
        times_ns[order],
        {
            "flag": flags[order].astype(np.uint32),
            "satellite_count": counts[order].astype(np.uint32),
            "clock_offset_s": offsets[order],
        },
        present={"clock_offset_s": np.isfinite(offsets[order])},
    )


def fix_columns(
    times_ns: Int64,
    places: Places,
    position_covariance: Float64,
    quality: Int64,
    lever_arm_m: Sequence[float],
    *,
    velocity_enu: Float64 | None = None,
    velocity_covariance: Float64 | None = None,
    satellite_count: Int64 | None = None,
    differential_age_s: Float64 | None = None,
) -> Columns:
    """Rows of `replay.GnssFix`.

    Parameters
    ----------
    times_ns : int64 array (n,), ns
    places : Places
    position_covariance : float64 array (n, 6), m^2
        Upper triangle of east, north, up.
    quality : int64 array (n,)
        Of `replay.FixQuality`.
    lever_arm_m : sequence of 3 float, m
        IMU to antenna, body.
    velocity_enu, velocity_covariance : float64 array (n, 3) and (n, 6), m/s and m^2/s^2
        Absent where NaN.
    satellite_count : int64 array (n,)
        Absent where negative.
    differential_age_s : float64 array (n,), s
    """
    count = len(times_ns)
    velocity = np.full((count, 3), np.nan) if velocity_enu is None else velocity_enu
    spread = np.full((count, 6), np.nan) if velocity_covariance is None else velocity_covariance
    number = np.full(count, -1) if satellite_count is None else satellite_count
    age = np.full(count, np.nan) if differential_age_s is None else differential_age_s
    fields: dict[str, Column] = {
        "position_ecef_m": places.ecef_m,
        "position_covariance_enu_m2": position_covariance,
        "antenna_lever_arm_body_m": np.tile(np.asarray(lever_arm_m, dtype=np.float64), (count, 1)),
        "quality": quality,
        "velocity_ecef_m_s": places.enu_to_ecef(velocity),
        "velocity_covariance_enu_m2_s2": spread,
        "satellite_count": np.maximum(number, 0).astype(np.uint32),
        "differential_age_s": age,
        "ambiguity_ratio": np.full(count, np.nan),
    }
    present: dict[str, Mask] = {
        "velocity_ecef_m_s": _whole(velocity),
        "velocity_covariance_enu_m2_s2": _whole(spread),
        "satellite_count": number >= 0,
        "differential_age_s": np.isfinite(age),
        "ambiguity_ratio": np.zeros(count, dtype=np.bool_),
    }
    return ordered(Columns.build(times_ns, fields, present=present))


def truth_columns(
    times_ns: Int64,
    ecef_m: Float64,
    quality: Int64,
    lever_arm_m: Sequence[float],
    *,
    velocity_enu: Float64,
    attitude_rad: Float64,
    position_std_enu_m: Float64,
) -> Columns:
    """Rows of `replay.Truth`; what is NaN is absent."""
    count = len(times_ns)
    none = np.zeros((count, 3))
    fields: dict[str, Column] = {
        "position_ecef_m": ecef_m,
        "lever_arm_body_m": np.tile(np.asarray(lever_arm_m, dtype=np.float64), (count, 1)),
        "quality": quality,
        "velocity_enu_m_s": velocity_enu,
        "attitude_rad": attitude_rad,
        "position_std_enu_m": position_std_enu_m,
        "gyro_bias_body_rad_s": none,
        "accel_bias_body_m_s2": none,
    }
    present: dict[str, Mask] = {
        "velocity_enu_m_s": _whole(velocity_enu),
        "attitude_rad": _whole(attitude_rad),
        "position_std_enu_m": _whole(position_std_enu_m),
        "gyro_bias_body_rad_s": np.zeros(count, dtype=np.bool_),
        "accel_bias_body_m_s2": np.zeros(count, dtype=np.bool_),
    }
    return ordered(Columns.build(times_ns, fields, present=present))


def truth_of_fixes(fix: Columns) -> Columns:
    """A receiver's own solution taken as the truth."""
    places = Places.from_ecef(np.asarray(fix["position_ecef_m"], dtype=np.float64))
    velocity = np.asarray(fix["velocity_ecef_m_s"], dtype=np.float64).copy()
    velocity[~fix.is_present("velocity_ecef_m_s")] = np.nan
    spread = np.asarray(fix["position_covariance_enu_m2"], dtype=np.float64)
    return truth_columns(
        fix.valid_time_ns,
        places.ecef_m,
        np.asarray(fix["quality"], dtype=np.int64),
        np.asarray(fix["antenna_lever_arm_body_m"], dtype=np.float64)[0].tolist(),
        velocity_enu=places.ecef_to_enu(velocity),
        attitude_rad=np.full((len(fix), 3), np.nan),
        position_std_enu_m=np.sqrt(spread[:, [0, 3, 5]]),
    )


def imu_columns(
    times_ns: Int64, rate_rad_s: Float64, force_m_s2: Float64, temperature_c: Float64 | None = None
) -> Columns:
    """Rows of `replay.ImuSample`, in the order of their times."""
    degrees = np.full(len(times_ns), np.nan) if temperature_c is None else temperature_c
    fields: dict[str, Column] = {
        "angular_rate_body_rad_s": rate_rad_s,
        "specific_force_body_m_s2": force_m_s2,
        "temperature_c": degrees,
    }
    present = {"temperature_c": np.isfinite(degrees)}
    return ordered(Columns.build(times_ns, fields, present=present))


def position_columns(
    times_ns: Sequence[int], positions_m: Sequence[Sequence[float]], receiver: Sequence[str]
) -> Columns:
    """Rows of `replay.ReceiverInfo` that state a position and a receiver's type."""
    count = len(times_ns)
    no = np.zeros(count, dtype=np.bool_)
    empty = Ragged.from_texts([""] * count)
    return Columns.build(
        np.array(times_ns, dtype=np.int64),
        {
            "marker": empty,
            "receiver": Ragged.from_texts(receiver),
            "antenna": empty,
            "approximate_position_ecef_m": np.array(positions_m, dtype=np.float64).reshape(-1, 3),
            "antenna_offset_enu_m": np.zeros((count, 3)),
            "interval_s": np.zeros(count),
            "header": empty,
        },
        present={"antenna_offset_enu_m": no, "interval_s": no},
    )


def _whole(rows: Float64) -> Mask:
    """Rows without a NaN."""
    return np.asarray(np.isfinite(rows).all(axis=1))


def ordered(columns: Columns) -> Columns:
    """Rows in the order of their valid times, of equal ones the first alone."""
    times = columns.valid_time_ns
    step = np.diff(times)
    if (step > 0).all():
        return columns
    order = np.argsort(times, kind="stable").astype(np.int64)
    order = order[np.concatenate([[True], np.diff(times[order]) > 0])]
    kept = columns.take(order)
    return Columns.build(kept.valid_time_ns, kept.values, present=kept.present)


class Navigation:
    """Ephemerides and ionospheres as they come, each only where it brings something new."""

    def __init__(self) -> None:
        self._records: list[Any] = []
        self._known_ns: list[int] = []
        self._ionospheres: list[Ionosphere] = []
        self._last: dict[tuple[int, int, int], bytes] = {}
        self._last_ionosphere: dict[tuple[str, int], tuple[float, ...]] = {}

    def add(self, record: Any, known_ns: int) -> None:
        """An ephemeris that was whole at `known_ns`."""
        content = record.copy()
        content["transmitted_ns"] = 0
        key = (int(record["system"]), int(record["prn"]), int(record["source"]))
        if self._last.get(key) != content.tobytes():
            self._last[key] = content.tobytes()
            self._records.append(record)
            self._known_ns.append(max(known_ns, int(record["transmitted_ns"])))

    def add_ionosphere(self, ionosphere: Ionosphere) -> None:
        """An ionosphere."""
        key = (ionosphere.system, ionosphere.model)
        if self._last_ionosphere.get(key) != ionosphere.coefficients:
            self._last_ionosphere[key] = ionosphere.coefficients
            self._ionospheres.append(ionosphere)

    def columns(self) -> dict[str, Columns]:
        """Rows by topic."""
        found = {}
        if self._records:
            records = np.array(self._records, dtype=EPHEMERIS_DTYPE)
            found[channels.NAV.topic] = ephemeris_columns(records, np.array(self._known_ns))
        if self._ionospheres:
            found[channels.NAV_IONOSPHERE.topic] = _ionosphere_columns(self._ionospheres)
        return found


def _ionosphere_columns(rows: list[Ionosphere]) -> Columns:
    rows = sorted(rows, key=lambda row: row.time_ns)
    lengths = [len(row.coefficients) for row in rows]
    return Columns.build(
        np.array([row.time_ns for row in rows], dtype=np.int64),
        {
            "system": Ragged.from_texts([row.system for row in rows]),
            "model": np.array([row.model for row in rows], dtype=np.int64),
            "coefficients": Ragged(
                np.cumsum([0, *lengths]).astype(np.int64),
                np.array([n for row in rows for n in row.coefficients], dtype=np.float64),
            ),
        },
    )
