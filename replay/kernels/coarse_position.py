"""Where a receiver was to some metres, from ranges and clocks of satellites.

Orbits, elevations and the troposphere need a position; where none is given, a least-squares
one serves, which starts from the epoch before. The state is a record with `x`, `clock`, `t`
and `offset`, as SIGHTS_STATE_DTYPE of :mod:`replay.kernels.sights` has them.
"""

from typing import Final

from numba import njit

from replay.kernels.elementary import sin
from replay.kernels.gnss_records import SYSTEMS
from replay.kernels.least_squares import geometric_range, iterate, reduced_code
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.types import Array, Record

_OUTLIER_M: Final = 300.0
_ATTEMPTS: Final = 8


@njit(cache=True)
def coarse_position(
    rows: Array,
    s: Record,
    cfg: Record,
    t: int,
    observed: Array,
    weight: Array,
    work: Record,
    u: Array,
) -> int:
    """Position to some metres from ranges and clocks; as `iterate` answers.

    Where that fails, position and clocks stay as they were.
    """
    n = rows.shape[0]
    x = s["x"]
    old = s["x"].copy()
    old_clock = s["clock"].copy()
    cold = s["t"] < 0
    for k in range(n):
        row = rows[k]
        usable = row["seen"] == 1 and row["code"][0] == row["code"][0]
        weight[k] = 1.0 if usable else 0.0
        if usable:
            observed[k] = row["code"][0] + row["clock"] - row["group_delay"][0]
            if not cold:
                # What the Earth turns during the flight, to first order.
                wx, wy = row["position"][0], row["position"][1]
                observed[k] -= (7.2921151467e-5 / SPEED_OF_LIGHT_M_S) * (wx * x[1] - wy * x[0])
    if cold:
        for i in range(3):
            x[i] = 0.0
    status = 0
    for attempt in range(_ATTEMPTS):
        status = iterate(rows, observed, weight, 12, 1.0, x, s["clock"], work, u)
        if status < 0:
            s["x"][:] = old
            s["clock"][:] = old_clock
            return status
        if cold and attempt == 0:
            # The first position brings the Earth's turn, which moves it some tens of metres.
            for k in range(n):
                wx, wy = rows[k]["position"][0], rows[k]["position"][1]
                observed[k] -= (7.2921151467e-5 / SPEED_OF_LIGHT_M_S) * (wx * x[1] - wy * x[0])
            continue
        worst, place, used = 0.0, -1, 0
        for k in range(n):
            if weight[k] > 0.0:
                used += 1
                system = rows[k]["system"]
                z = observed[k] - geometric_range(rows[k], x, u) - s["clock"][system]
                if abs(z) > worst:
                    worst = abs(z)
                    place = k
        if worst < _OUTLIER_M or used <= work["unknowns"]:
            break
        weight[place] = 0.0
    return status


@njit(cache=True)
def place_epoch(
    epoch: Record,
    rows: Array,
    s: Record,
    cfg: Record,
    observed: Array,
    weight: Array,
    work: Record,
    u: Array,
    fresh: bool,
) -> bool:
    """Say where the epoch was: the coarse position once more, now with every correction.

    Returns
    -------
    bool
        Whether the position in the state has moved by that.
    """
    used = 0
    for k in range(rows.shape[0]):
        row = rows[k]
        usable = row["seen"] == 1 and weight[k] > 0.0 and fresh and cfg["fixed"] == 0
        z = reduced_code(row, 0)
        sine = sin(row["elevation"])
        weight[k] = sine * sine if usable and sine > 0.1 and z == z else 0.0
        observed[k] = z
        if weight[k] > 0.0:
            used += 1
    for i in range(3):
        epoch["x"][i] = s["x"][i]
    epoch["age"] = (epoch["t"] - s["t"]) * 1e-9
    epoch["used"] = used
    epoch["placed"] = 1
    if cfg["fixed"] == 1:
        _fixed_clock(epoch, rows, u)
        return False
    moved = False
    if fresh:
        clock = s["clock"].copy()
        if iterate(rows, observed, weight, 3, 1.0, epoch["x"], s["clock"], work, u) > 0:
            moved = True
            for i in range(3):
                s["x"][i] = epoch["x"][i]
        else:
            for i in range(3):
                epoch["x"][i] = s["x"][i]
            s["clock"][:] = clock
        for system in range(SYSTEMS - 1, -1, -1):
            if work["column"][system] > 0:
                s["offset"] = s["clock"][system]
    epoch["clock"] = s["offset"]
    return moved


@njit(cache=True)
def _fixed_clock(epoch: Record, rows: Array, u: Array) -> None:
    """Clock of a receiver that stands at a known position: the mean over its ranges."""
    total, used = 0.0, 0
    for k in range(rows.shape[0]):
        z = reduced_code(rows[k], 0)
        if rows[k]["seen"] == 1 and z == z:
            total += z - geometric_range(rows[k], epoch["x"], u)
            used += 1
    epoch["used"] = used
    epoch["clock"] = total / used if used > 0 else 0.0
    epoch["placed"] = 1 if used > 0 else 0
