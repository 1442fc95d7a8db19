"""Records of precise point positioning to columns."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from replay import channels
from replay.gnss.measurements import SATELLITE_NAMES, signal_names
from replay.kernels import ppp_output, ppp_records
from replay.kernels.gnss_records import SLOTS, SYSTEM_LETTERS, SYSTEMS
from replay.kernels.rtk_records import AMBIGUITY_ROW_DTYPE, RESOLUTION_ROW_DTYPE
from replay.kernels.sights import NOTE_DTYPE
from replay.log.columns import Columns, Ragged
from replay.stages.rtk_columns import ambiguity_columns, resolution_columns

Array = np.ndarray[Any, Any]

PPP_EVENT_TEXT: Final = {
    ppp_records.EVENT_TIME_BACKWARD: "an epoch {value:.3f} s before the last one is left out",
    ppp_records.EVENT_RESET: "the filter begins anew after {value:.0f} epochs that did not fit",
    ppp_records.EVENT_TOO_FEW: "{value:.0f} satellites are too few for a position",
    ppp_records.EVENT_SLIP: "{satellite}: the phase broke, its ambiguity begins anew",
    ppp_records.EVENT_FIXED: "{value:.0f} ambiguities fixed",
    ppp_records.EVENT_FIX_LOST: "no integers after {value:.0f} fixed epochs",
    ppp_records.EVENT_CLOCK_JUMP: "the receiver set its codes by {value:.0f} ms",
}


def _plain(rows: Array, names: dict[str, str]) -> dict[str, Any]:
    return {name: np.ascontiguousarray(rows[field]) for name, field in names.items()}


def zenith_columns(rows: Array) -> Columns:
    """Columns from records of ZENITH_ROW_DTYPE."""
    values = _plain(
        rows, {"hydrostatic_m": "hydrostatic", "wet_m": "wet", "wet_std_m": "wet_sigma"}
    )
    present = {}
    for place, axis in enumerate(("north", "east")):
        for name, field in (("m", "gradient"), ("std_m", "gradient_sigma")):
            full = f"gradient_{axis}_{name}"
            values[full] = np.ascontiguousarray(rows[field][:, place])
            present[full] = np.isfinite(values[full])
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"], present=present)


def slant_columns(rows: Array) -> Columns:
    """Columns from records of SLANT_ROW_DTYPE."""
    values = {
        "satellite": SATELLITE_NAMES[rows["satellite"]],
        **_plain(rows, {"delay_m": "value", "delay_std_m": "sigma"}),
    }
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"])


def bias_columns(rows: Array) -> Columns:
    """Columns from records of BIAS_ROW_DTYPE."""
    values = {
        "system": Ragged.from_texts([SYSTEM_LETTERS[s] for s in rows["system"]]),
        "signal": signal_names(rows["signal"]),
        **_plain(rows, {"bias_m": "value", "bias_std_m": "sigma"}),
    }
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"])


def phase_columns(rows: Array) -> Columns:
    """Columns from records of PHASE_ROW_DTYPE."""
    values = {
        "satellite": SATELLITE_NAMES[rows["satellite"]],
        "signal": signal_names(rows["signal"]),
        **_plain(rows, {"ambiguity_m": "value", "ambiguity_std_m": "sigma"}),
        "epoch_count": rows["age"].astype(np.uint32),
    }
    return Columns.build(rows["t"], values, log_time_ns=rows["log_t"])


def new_precise_rows(epochs: int, rows: int, notes: int) -> tuple[Array, ...]:
    """Room for what a block gives beside solutions and innovations, as the kernels take it.

    Parameters
    ----------
    epochs, rows : int
        Of the block.
    notes : int
        Events of an epoch, at most, beside breaks of ambiguities, in view or not.

    Returns
    -------
    tuple of array
        Ambiguities, resolutions, notes, zenith delays, slant delays, biases, phases, counts.
    """
    return (
        np.zeros(SLOTS * rows, dtype=AMBIGUITY_ROW_DTYPE),
        np.zeros(epochs, dtype=RESOLUTION_ROW_DTYPE),
        np.zeros((notes + ppp_records.ROOM) * epochs, dtype=NOTE_DTYPE),
        np.zeros(epochs, dtype=ppp_records.ZENITH_ROW_DTYPE),
        np.zeros(rows, dtype=ppp_records.SLANT_ROW_DTYPE),
        np.zeros(SYSTEMS * SLOTS * epochs, dtype=ppp_records.BIAS_ROW_DTYPE),
        np.zeros(SLOTS * rows, dtype=ppp_records.PHASE_ROW_DTYPE),
        np.zeros(ppp_output.COUNTS, dtype=np.int64),
    )


def precise_columns(made: tuple[Array, ...]) -> dict[str, Columns]:
    """Columns of :func:`new_precise_rows` once filled; notes are the filter's own to tell."""
    ambiguities, resolutions, _, zeniths, slants, biases, phases, counts = made
    columns = {
        channels.FILTER_TROPOSPHERE: zenith_columns(zeniths[: counts[ppp_output.ZENITHS]]),
        channels.FILTER_IONOSPHERE: slant_columns(slants[: counts[ppp_output.SLANTS]]),
        channels.FILTER_BIASES: bias_columns(biases[: counts[ppp_output.BIASES]]),
        channels.FILTER_PHASES: phase_columns(phases[: counts[ppp_output.PHASES]]),
        channels.FILTER_AMBIGUITIES: ambiguity_columns(
            ambiguities[: counts[ppp_output.AMBIGUITIES]]
        ),
        channels.FILTER_RESOLUTION: resolution_columns(
            resolutions[: counts[ppp_output.RESOLUTIONS]]
        ),
    }
    return {channel.name: rows for channel, rows in columns.items()}
