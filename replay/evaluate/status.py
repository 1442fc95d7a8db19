"""What the statuses of a solution mean for an evaluation."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from replay.log.columns import Columns
from replay.schemas import solution_pb2

# Rows at whose very time a measurement of GNSS was used.
UPDATES: Final = (
    solution_pb2.SOLUTION_STATUS_UPDATED,
    solution_pb2.SOLUTION_STATUS_SINGLE,
    solution_pb2.SOLUTION_STATUS_DGNSS,
    solution_pb2.SOLUTION_STATUS_FLOAT,
    solution_pb2.SOLUTION_STATUS_FIXED,
    solution_pb2.SOLUTION_STATUS_CHAINED,
)
_WORDS: Final = {
    value.number: value.name.removeprefix("SOLUTION_STATUS_").lower()
    for value in solution_pb2.SolutionStatus.DESCRIPTOR.values
}


def updated(solution: Columns) -> npt.NDArray[np.bool_]:
    """Which rows of a solution are epochs of GNSS."""
    return np.isin(solution["status"], UPDATES)


def word(status: int) -> str:
    """Lower-case word of a status: "fixed"."""
    return _WORDS.get(status, str(status))
