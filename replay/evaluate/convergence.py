"""How long until the position of a point that stands still keeps within a limit."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np
import numpy.typing as npt

from replay.evaluate.align import Rows
from replay.evaluate.errors_enu import LONGEST_STEP
from replay.evaluate.geometry import Floats
from replay.evaluate.statistics import HORIZONTAL, LOCAL_AXES, SPATIAL
from replay.time import NS_PER_S

LIMIT_M: Final = 0.10
HOLD_S: Final = 600.0
EACH: Final = "each"  # east, north and up, all three
Mask = npt.NDArray[np.bool_]


class Convergence(msgspec.Struct, frozen=True, kw_only=True):
    """Seconds from the start of a session until errors keep within a limit.

    Keys are east, north, up, horizontal and 3d (lengths), and each: east, north and up, each
    of them within the limit. None: never.

    Attributes
    ----------
    limit_m : float, m
    to_the_end_s : dict of float or None, s
        To the first epoch from which all errors to the end of the session are within.
    held_s : dict of float or None, s
        To the first epoch of the first stretch of `hold_s` seconds all of whose epochs are
        within; an epoch that is missing ends a stretch.
    hold_s : float, s
    """

    limit_m: float
    to_the_end_s: dict[str, float | None]
    held_s: dict[str, float | None]
    hold_s: float


def convergence_of(
    times_ns: Rows,
    enu_m: Floats,
    *,
    start_ns: int | None = None,
    limit_m: float = LIMIT_M,
    hold_s: float = HOLD_S,
) -> Convergence:
    """When errors came within a limit.

    Parameters
    ----------
    times_ns : int64 array (n,), GPS ns
        Ascending.
    enu_m : float64 array (n, 3), m
        Errors east, north, up.
    start_ns : int or None, GPS ns
        What the seconds count from; None: the first of the times.
    limit_m : float, m
        An error of this size is within.
    hold_s : float, s
    """
    begin = int(times_ns[0]) if start_ns is None and len(times_ns) else int(start_ns or 0)
    size = np.abs(enu_m)
    flat = np.hypot(enu_m[:, 0], enu_m[:, 1])
    sizes = {name: size[:, axis] for axis, name in enumerate(LOCAL_AXES)} | {
        HORIZONTAL: flat,
        SPATIAL: np.hypot(flat, enu_m[:, 2]),
        EACH: size.max(axis=1, initial=0.0),
    }

    def seconds(row: int | None) -> float | None:
        return None if row is None else (int(times_ns[row]) - begin) / NS_PER_S

    within = {name: values <= limit_m for name, values in sizes.items()}
    return Convergence(
        limit_m=limit_m,
        to_the_end_s={name: seconds(settled_row(mask)) for name, mask in within.items()},
        held_s={name: seconds(held_row(times_ns, mask, hold_s)) for name, mask in within.items()},
        hold_s=hold_s,
    )


def settled_row(within: Mask) -> int | None:
    """First row from which every row to the last is true; None where the last is not."""
    outside = np.flatnonzero(~within)
    row = int(outside[-1]) + 1 if len(outside) else 0
    return row if row < len(within) else None


def held_row(times_ns: Rows, within: Mask, hold_s: float) -> int | None:
    """First row of the first unbroken stretch of true rows that is at least so long.

    Rows more than one and a half median intervals apart do not belong to one stretch.
    """
    if len(within) == 0:
        return None
    steps = np.diff(times_ns)
    longest = LONGEST_STEP * float(np.median(steps)) if len(steps) else 0.0
    first: int | None = None
    for row in range(len(within)):
        if not within[row] or (row > 0 and steps[row - 1] > longest):
            first = None
        if not within[row]:
            continue
        first = row if first is None else first
        if times_ns[row] - times_ns[first] >= hold_s * NS_PER_S:
            return first
    return None
