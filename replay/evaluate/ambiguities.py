"""How often integers were fixed, and how often wrongly."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np
import numpy.typing as npt

from replay.evaluate.errors_enu import Errors
from replay.evaluate.satellites import Spread, spread_of
from replay.evaluate.status import word
from replay.log.columns import Columns
from replay.schemas import solution_pb2

WRONG_FIX_LIMIT_M: Final = 0.10
_CARRIER: Final = (
    solution_pb2.SOLUTION_STATUS_FLOAT,
    solution_pb2.SOLUTION_STATUS_FIXED,
)


class Ambiguities(msgspec.Struct, frozen=True, kw_only=True):
    """Integers over a run.

    Attributes
    ----------
    epochs : int
        Epochs of GNSS with a solution.
    share : dict of float
        Of these epochs by status, "fixed", "float", "single" and others that occur.
    fixed_epochs : int
    fixed_with_truth : int
        Fixed epochs whose error is known.
    wrong_fix_limit_m : float, m
    wrong_fixes : int or None
        Fixed epochs whose horizontal error is over the limit; None where no fixed epoch
        has truth.
    longest_wrong_run : int or None
        Most wrong fixes one after the other.
    ratio : Spread or None
        Second over best squared norm of the attempts; None where the log has none.
    attempts, accepted : int or None
        Of resolution, and how many of them fixed something.
    """

    epochs: int
    share: dict[str, float]
    fixed_epochs: int
    fixed_with_truth: int
    wrong_fix_limit_m: float
    wrong_fixes: int | None
    longest_wrong_run: int | None
    ratio: Spread | None
    attempts: int | None
    accepted: int | None


def ambiguities_of(
    solution: Columns,
    epochs: npt.NDArray[np.bool_],
    position: Errors,
    resolution: Columns | None,
    limit_m: float = WRONG_FIX_LIMIT_M,
) -> Ambiguities | None:
    """Figures of a run; None where it knows no ambiguities.

    Parameters
    ----------
    solution : Columns of replay.Solution
    epochs : bool array (n,)
        Rows that are epochs of GNSS.
    position : Errors
        East, north, up [m] of rows of the solution.
    resolution : Columns of replay.AmbiguityResolution, or None
    limit_m : float, m
        Horizontal error over which a fix is wrong.
    """
    status = solution["status"]
    if resolution is None and not np.isin(status, _CARRIER).any():
        return None
    rows = np.flatnonzero(epochs)
    count = len(rows)
    kinds, numbers = np.unique(status[rows], return_counts=True)
    share = {"fixed": 0.0, "float": 0.0, "single": 0.0}
    share |= {word(int(k)): int(n) / count for k, n in zip(kinds, numbers, strict=True)}
    fixed = fixed_rows(solution)
    wrong, with_truth = _wrong(len(solution), fixed, position, limit_m)
    attempted = resolution is not None and len(resolution) > 0
    return Ambiguities(
        epochs=count,
        share=share,
        fixed_epochs=int(np.count_nonzero(fixed[rows])),
        fixed_with_truth=with_truth,
        wrong_fix_limit_m=limit_m,
        wrong_fixes=int(np.count_nonzero(wrong)) if with_truth else None,
        longest_wrong_run=longest_run(wrong[rows]) if with_truth else None,
        ratio=spread_of(resolution["ratio"].astype(np.float64)) if resolution is not None else None,
        attempts=len(resolution) if resolution is not None and attempted else None,
        accepted=(
            int(np.count_nonzero(resolution["fixed_count"]))
            if resolution is not None and attempted
            else None
        ),
    )


def fixed_rows(solution: Columns) -> npt.NDArray[np.bool_]:
    """Which rows (n,) have integer ambiguities."""
    return np.asarray(solution["status"] == solution_pb2.SOLUTION_STATUS_FIXED)


def _wrong(
    count: int, fixed: npt.NDArray[np.bool_], position: Errors, limit_m: float
) -> tuple[npt.NDArray[np.bool_], int]:
    """Rows (n,) that are wrong fixes, and how many fixed rows have truth."""
    known = fixed[position.rows]
    horizontal = np.hypot(position.values[:, 0], position.values[:, 1])
    wrong = np.zeros(count, dtype=np.bool_)
    wrong[position.rows[known & (horizontal > limit_m)]] = True
    return wrong, int(np.count_nonzero(known))


def longest_run(mask: npt.NDArray[np.bool_]) -> int:
    """Most true values one after the other."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))
