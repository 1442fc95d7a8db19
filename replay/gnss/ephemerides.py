"""Broadcast ephemerides between the channel `/gnss/nav` and the records of the kernels."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.errors import DataError
from replay.kernels.ephemeris import EPHEMERIS_DTYPE, SYSTEM_GLONASS
from replay.log.columns import Column, Columns

Records = npt.NDArray[Any]
"""Array (n,) of EPHEMERIS_DTYPE."""

_EVERY: Final = (
    "toe_ns", "toc_ns", "transmitted_ns", "iode", "iodc", "health", "source", "accuracy_m",
    "fit_s", "af0", "af1", "af2", "group_delay_1_s", "group_delay_2_s", "toe_s",
)  # fmt: skip
_KEPLER: Final = (
    "sqrt_a", "eccentricity", "i0", "omega0", "omega", "m0", "delta_n", "omega_dot", "i_dot",
    "cuc", "cus", "crc", "crs", "cic", "cis",
)  # fmt: skip
_GLONASS: Final = ("position_m", "velocity_m_s", "acceleration_m_s2", "frequency_channel")
_ZERO: Final = ord("0")
_NINE: Final = ord("9")
_NAME_BYTES: Final = 3


def ephemeris_records(columns: Columns) -> Records:
    """Rows of `replay.BroadcastEphemeris` as records, in their order.

    Parameters
    ----------
    columns : Columns
        As a log gives them, or as :func:`ephemeris_columns` makes them.

    Returns
    -------
    array (n,) of EPHEMERIS_DTYPE
        What a row lacks is zero.

    Raises
    ------
    DataError
        Where a satellite is no letter and two digits.
    """
    records = np.zeros(len(columns), dtype=EPHEMERIS_DTYPE)
    letters = _letters(columns["satellite"])
    records["system"] = letters[:, 0]
    records["prn"] = (letters[:, 1] - _ZERO) * 10 + letters[:, 2] - _ZERO
    for name in (*_EVERY, *_KEPLER, *_GLONASS):
        if name in columns.values:
            present = columns.is_present(name)
            records[name][present] = columns[name][present]
    return records


def ephemeris_columns(records: Records, log_time_ns: npt.ArrayLike | None = None) -> Columns:
    """Records as rows of `replay.BroadcastEphemeris`, in the order of their log times.

    The valid time is when the message was sent, or the orbit's reference time where
    that is unknown (zero).

    Parameters
    ----------
    records : array (n,) of EPHEMERIS_DTYPE
    log_time_ns : int64 array (n,) or int, optional
        When each message became known, GPS nanoseconds; left out, the valid time.

    Returns
    -------
    Columns
        Rows of equal log time stand in the order of their valid times, equal ones of
        those as in `records`.
    """
    sent = records["transmitted_ns"]
    valid = np.where(sent != 0, sent, records["toe_ns"])
    log = valid if log_time_ns is None else np.broadcast_to(log_time_ns, valid.shape)
    order = np.lexsort((valid, log))
    records = records[order]
    glonass = records["system"] == SYSTEM_GLONASS
    values: dict[str, Column] = {"satellite": satellite_names(records)}
    present = dict.fromkeys(_KEPLER, ~glonass) | dict.fromkeys(_GLONASS, glonass)
    for name in (*_EVERY, *_KEPLER, *_GLONASS):
        values[name] = np.ascontiguousarray(records[name])
    return Columns.build(valid[order], values, log_time_ns=log[order], present=present)


def satellite_names(records: Records) -> npt.NDArray[np.bytes_]:
    """RINEX 3 names, `S3` array (n,)."""
    letters = np.empty((len(records), _NAME_BYTES), dtype=np.uint8)
    letters[:, 0] = records["system"]
    letters[:, 1] = records["prn"] // 10 + _ZERO
    letters[:, 2] = records["prn"] % 10 + _ZERO
    return letters.view(f"S{_NAME_BYTES}").reshape(-1)


def _letters(column: npt.NDArray[np.generic]) -> npt.NDArray[np.int64]:
    """Bytes of every satellite's name, (n, 3)."""
    if column.dtype == np.dtype(f"S{_NAME_BYTES}"):
        letters = np.ascontiguousarray(column).view(np.uint8).reshape(-1, _NAME_BYTES)
        digits = letters[:, 1:]
        if ((digits >= _ZERO) & (digits <= _NINE)).all():
            return letters.astype(np.int64)
    raise DataError(
        "a satellite is not named by a letter and two digits",
        where="replay.BroadcastEphemeris.satellite",
        mend="write RINEX 3 names, such as G05",
    )
