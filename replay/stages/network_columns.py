"""Errors between reference stations and a rover's corrections: columns to records and back."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from replay.gnss.measurements import SATELLITE_NAMES, Selection, characters, signal_names
from replay.kernels.baseline_errors import ERROR_ROW_DTYPE, RESIDUAL_ROW_DTYPE
from replay.kernels.gnss_records import COUNT, FIRST, SLOTS, SYSTEM_LETTERS
from replay.log.columns import Column, Columns, Ragged

Array = np.ndarray[Any, Any]

_RANK: Final = 64  # a choice of a Selection is slot * _RANK + rank
_STATES: Final = ("error_m", "error_rate_m_s", "error_acceleration_m_s2", "multipath_m")
_DEVIATIONS: Final = (
    "error_std_m",
    "error_rate_std_m_s",
    "error_acceleration_std_m_s2",
    "multipath_std_m",
)

NAME_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns
        ("log_t", "<i8"),  # ns
        ("satellite", "<i8"),  # dense number
        ("system", "<i8"),
        ("signal", "<i8"),  # two characters, first one low
    ]
)
"""What tells rows of satellites and signals apart."""


def satellite_numbers(names: Array) -> tuple[Array, Array]:
    """Dense numbers and systems of satellites `(n,)`; minus one for those without a number."""
    text = characters(names, 3).astype(np.int64)
    system = np.array([SYSTEM_LETTERS.find(chr(c)) for c in range(256)])[text[:, 0]]
    prn = 10 * (text[:, 1] - ord("0")) + text[:, 2] - ord("0")
    known = (system >= 0) & (prn >= 1) & (prn <= np.array(COUNT)[system])
    return np.where(known, np.array(FIRST)[system] + prn - 1, -1), np.where(known, system, -1)


def named_rows(columns: Columns) -> tuple[Array, Columns]:
    """Times and names of rows as records of NAME_DTYPE, and the columns in the same order.

    Rows of one log time stand by epoch, satellite and signal; mostly they do so already.
    Satellites without a number are left out, as everywhere.
    """
    satellite, system = satellite_numbers(columns["satellite"])
    text = characters(columns["signal"], 2).astype(np.int64)
    order = np.lexsort(
        (text[:, 1], text[:, 0], satellite, columns.valid_time_ns, columns.log_time_ns)
    )
    keep = order[satellite[order] >= 0].astype(np.int64)
    rows = np.zeros(len(keep), dtype=NAME_DTYPE)
    rows["t"] = columns.valid_time_ns[keep]
    rows["log_t"] = columns.log_time_ns[keep]
    rows["satellite"] = satellite[keep]
    rows["system"] = system[keep]
    rows["signal"] = text[keep, 0] + 256 * text[keep, 1]
    return rows, columns.take(keep)


def rising_epochs(rows: Array, newest: int) -> tuple[Array, Array]:
    """First row and number of rows of each epoch that is later than all before it.

    Parameters
    ----------
    rows : array with `t` and `log_t`
        Rows of one epoch stand together.
    newest : int, ns
        The latest epoch before these rows.
    """
    change = (np.diff(rows["t"]) != 0) | (np.diff(rows["log_t"]) != 0)
    starts = np.flatnonzero(np.concatenate([[True], change])[: len(rows)])
    counts = np.diff(np.concatenate([starts, [len(rows)]]))
    t = rows["t"][starts]
    before = np.maximum.accumulate(np.concatenate([[newest], t]))[:-1]
    return starts[t > before], counts[t > before]


def rows_of(starts: Array, counts: Array) -> Array:
    """Numbers of the rows of epochs that are given by :func:`rising_epochs`, epoch by epoch."""
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    index: Array = np.arange(total) + np.repeat(starts - (ends - counts), counts)
    return index


def _fixed_texts(column: Column, width: int) -> Array:
    """Texts as a stage hands them on or as a log gives them back; empty for another length."""
    if not isinstance(column, Ragged):
        return column
    texts = [text if len(text) == width else b"" for text in column.blobs()]
    return np.array(texts, dtype=f"S{width}")


def _difference_records(columns: Columns, dtype: np.dtype[Any]) -> tuple[Array, Columns]:
    """Records with their times and names, in order, and the columns that they are of."""
    names, columns = named_rows(columns)
    rows = np.zeros(len(names), dtype=dtype)
    for name in NAME_DTYPE.names or ():
        rows[name] = names[name]
    rows["reference"], system = satellite_numbers(_fixed_texts(columns.values["reference"], 3))
    same = system == rows["system"]
    return (rows, columns) if same.all() else (rows[same], columns.take(same))


def residual_records(columns: Columns, selection: Selection, share: Array) -> Array:
    """Records of RESIDUAL_ROW_DTYPE.

    Parameters
    ----------
    columns : Columns of `replay.NetworkResidual`
    selection : Selection
        Which signal fills which slot; what it does not know counts as of the first.
    share : float64 array (SLOTS,)
        Part of a residual's variance that is multipath.
    """
    rows, columns = _difference_records(columns, RESIDUAL_ROW_DTYPE)
    band = rows["signal"] % 256 - ord("0")
    attribute = rows["signal"] // 256
    sound = (band >= 0) & (band <= 9) & (attribute < 128)
    choice = selection.choice[
        rows["system"], np.where(sound, band, 0), np.where(sound, attribute, 0)
    ]
    slot = np.clip(choice // _RANK, 0, SLOTS - 1)
    deviation = columns["residual_std_m"].astype(np.float64)
    variance = deviation * deviation
    rows["z"] = columns["residual_m"]
    rows["multipath"] = variance * share[slot]
    rows["noise"] = variance * (1.0 - share[slot])
    return rows


def error_records(columns: Columns) -> Array:
    """Records of ERROR_ROW_DTYPE from columns of `replay.BaselineError`."""
    rows, columns = _difference_records(columns, ERROR_ROW_DTYPE)
    for place, (state, deviation) in enumerate(zip(_STATES, _DEVIATIONS, strict=True)):
        rows["x"][:, place] = columns[state]
        rows["sigma"][:, place] = columns[deviation]
    rows["innovation"] = columns["innovation_m"]
    rows["innovation_sigma"] = columns["innovation_std_m"]
    return rows


def error_columns(rows: Array) -> Columns:
    """Columns from records of ERROR_ROW_DTYPE."""
    values: dict[str, Any] = {
        "satellite": SATELLITE_NAMES[rows["satellite"]],
        "reference": SATELLITE_NAMES[rows["reference"]],
        "signal": signal_names(rows["signal"]),
        "innovation_m": np.ascontiguousarray(rows["innovation"]),
        "innovation_std_m": np.ascontiguousarray(rows["innovation_sigma"]),
    }
    for place, (state, deviation) in enumerate(zip(_STATES, _DEVIATIONS, strict=True)):
        values[state] = np.ascontiguousarray(rows["x"][:, place])
        values[deviation] = np.ascontiguousarray(rows["sigma"][:, place])
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"])


def correction_columns(rows: Array) -> Columns:
    """Columns from records of CORRECTION_ROW_DTYPE."""
    return Columns.build(
        rows["t"],
        {
            "satellite": SATELLITE_NAMES[rows["satellite"]],
            "reference": SATELLITE_NAMES[rows["reference"]],
            "signal": signal_names(rows["signal"]),
            "correction_m": np.ascontiguousarray(rows["value"]),
            "correction_std_m": np.ascontiguousarray(rows["sigma"]),
            "misfit_m": np.ascontiguousarray(rows["misfit"]),
            "station_count": rows["stations"].astype(np.uint32),
            "age_s": np.ascontiguousarray(rows["age"]),
        },
        log_time_ns=rows["log_t"],
    )
