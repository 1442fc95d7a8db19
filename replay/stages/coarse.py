"""Coarse positions of a log that tells satellites and corrections, but not where the receiver was.

Recordings whose ranges are corrected already bring orbits of their own; each epoch is
then placed by single-point positioning, with the settings of the section `spp`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import channels
from replay.configuration import Section
from replay.gnss.measurements import Selection, select_signals
from replay.kernels import single_point, single_records
from replay.kernels.gnss_records import SYSTEMS
from replay.kernels.least_squares import SOLVE_DTYPE
from replay.kernels.sights import NOTE_DTYPE
from replay.stages.base import (
    Block,
    Context,
    Outputs,
    Port,
    StageSpec,
    dump_arrays,
    restore_arrays,
)
from replay.stages.gnss_columns import EVENT_TEXT, event_columns
from replay.stages.sight_columns import coarse_columns
from replay.stages.spp import single_config
from replay.stages.spp_config import SppConfig
from replay.stages.waiting import read_epochs

Array = np.ndarray[Any, Any]

_LAST_DTYPE: Final = np.dtype([("t", "<i8"), ("x", "<f8", 3), ("clock", "<f8")])
_S: Final = 1e-9


@dataclasses.dataclass(frozen=True, slots=True)
class CoarseState:
    """The last position, one record; its time is -1 before the first."""

    selection: Selection
    config: Array
    scratch: Array
    last: Array


class CoarsePositions:
    """The stage `coarse`."""

    spec = StageSpec(
        name="coarse",
        version=1,
        inputs=(
            Port(channels.GNSS_OBS),
            Port(channels.SATELLITES),
            Port(channels.CORRECTIONS),
        ),
        outputs=(Port(channels.COARSE), Port(channels.GNSS_EVENTS)),
        trigger=Port(channels.GNSS_OBS),
    )

    def start(self, config: Section, context: Context) -> CoarseState:
        """State before the first row."""
        if not isinstance(config, SppConfig):
            raise TypeError("coarse takes an SppConfig")
        last = np.zeros(1, dtype=_LAST_DTYPE)
        last["t"] = -1
        return CoarseState(
            selection=select_signals(config.gnss.signals, config.gnss.systems),
            config=single_config(config.gnss, config.spp),
            scratch=np.zeros(1, dtype=SOLVE_DTYPE),
            last=last,
        )

    def step(self, state: CoarseState, block: Block) -> tuple[CoarseState, Outputs]:
        """Take a block of epochs."""
        found = read_epochs(block, state.selection)
        if found is None:
            return state, {}
        epochs = found.epochs
        # The iteration finds its way from the Earth's centre, too.
        epochs["placed"] = 1
        solved = np.zeros(len(epochs) + 1, dtype=single_records.SINGLE_ROW_DTYPE)
        residuals = np.zeros(len(found.rows), dtype=single_records.RESIDUAL_DTYPE)
        notes = np.zeros(len(found.rows) + 2 * len(epochs), dtype=NOTE_DTYPE)
        counts = np.zeros(3, dtype=np.int64)
        single_point.run_single(
            state.config, epochs, found.rows, state.scratch, solved, residuals, notes, counts
        )
        _place(epochs, solved[: counts[0]], state.last)
        few = notes[: counts[2]]
        few = few[few["kind"] != single_records.EVENT_EXCLUDED]
        columns = {
            channels.COARSE: coarse_columns(epochs),
            channels.GNSS_EVENTS: event_columns(few, EVENT_TEXT),
        }
        return state, {channel.name: rows for channel, rows in columns.items() if len(rows)}

    def finish(self, state: CoarseState) -> Outputs:
        """Nothing is left to say."""
        return {}

    def dump(self, state: CoarseState) -> bytes:
        """The state as bytes."""
        return dump_arrays({"last": state.last})

    def restore(self, state: CoarseState, data: bytes) -> CoarseState:
        """The state of a dump."""
        arrays = restore_arrays(data, {"last": _LAST_DTYPE})
        return dataclasses.replace(state, last=arrays["last"])


def _place(epochs: Array, solved: Array, last: Array) -> None:
    """Fill where the epochs were; one without a solution has the position of the last."""
    place = 0
    for epoch in epochs:
        epoch["used"] = 0
        if place < len(solved) and solved["epoch_t"][place] == epoch["t"]:
            row = solved[place]
            place += 1
            epoch["used"] = int(row["count"].sum())
            # As orbits are computed with: the clock of the first system that is used.
            clock = next(row["clock"][k] for k in range(SYSTEMS) if np.isfinite(row["clock"][k]))
            last[0] = (epoch["t"], row["r"], clock)
        epoch["placed"] = int(last["t"][0] >= 0)
        epoch["x"] = last["x"][0]
        epoch["clock"] = last["clock"][0]
        epoch["age"] = (epoch["t"] - last["t"][0]) * _S
