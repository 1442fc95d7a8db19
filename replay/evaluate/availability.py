"""At how many of a receiver's epochs a run has a position."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from replay.evaluate.align import Rows
from replay.log.columns import Columns

_NEAR: Final = 0.25  # of an interval: a solution may be told at the corrected time of its epoch


class Availability(msgspec.Struct, frozen=True, kw_only=True):
    """Epochs with a solution over epochs of observation.

    Attributes
    ----------
    observation_epochs, solution_epochs : int
    share : float
    """

    observation_epochs: int
    solution_epochs: int
    share: float


def availability_of(solution: Columns, observations_ns: Rows | None) -> Availability | None:
    """Availability; None where the log has no observations.

    Parameters
    ----------
    solution : Columns of replay.Solution
        In the order of time.
    observations_ns : int64 array (n,) or None, GPS ns
        Of the receiver's epochs, ascending, each once.
    """
    if observations_ns is None or len(observations_ns) == 0:
        return None
    known = np.isfinite(solution["position_ecef_m"].astype(np.float64)).all(axis=1)
    times = solution.valid_time_ns[known]
    count = 0
    if len(times):
        near = 0.0
        if len(observations_ns) > 1:
            near = _NEAR * float(np.median(np.diff(observations_ns)))
        after = np.minimum(np.searchsorted(times, observations_ns), len(times) - 1)
        before = np.maximum(after - 1, 0)
        apart = np.minimum(
            np.abs(times[after] - observations_ns), np.abs(times[before] - observations_ns)
        )
        count = int(np.count_nonzero(apart <= near))
    return Availability(
        observation_epochs=len(observations_ns),
        solution_epochs=count,
        share=count / len(observations_ns),
    )
