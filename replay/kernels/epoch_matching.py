"""Which epochs of two receivers belong together, and when that is known."""

from typing import Final

from numba import njit

from replay.kernels.gnss_records import NOT_YET
from replay.kernels.types import Array

LATE_NS: Final = 10_000_000_000
"""By this much a base epoch may be older than the base's newest one and still be used."""


@njit(cache=True)
def match_epochs(
    rover_t: Array, rover_log: Array, base_t: Array, base_log: Array, needed: Array, now: int,
    last: int, tolerance: int, wait: int, max_age: int, partner: Array, release: Array,
) -> int:  # fmt: skip
    """Say which rover epochs can be worked on by now, with which base epoch, and since when.

    A rover's epoch waits for a base epoch that is no more than `tolerance` earlier, or until
    a row comes that is `wait` later than it; then the newest base epoch serves that is no
    more than `tolerance` later than the rover's and no more than `max_age` earlier. A base
    epoch that is LATE_NS older than the base's newest one is no longer remembered.

    Parameters
    ----------
    rover_t, rover_log : int64 arrays (n,), ns
        Epochs that wait, in the order of their arrival.
    base_t, base_log : int64 arrays (m,), ns
    needed : int64 array (n,), ns
        Log time of whatever else a rover's epoch waits for, :data:`NOT_YET` before it came.
    now : int, ns
        Log time up to which rows are known.
    last : int, ns
        Log time of the release before.
    tolerance, wait, max_age : int, ns
    partner : int64 array (n,)
        Filled: base epoch or minus one.
    release : int64 array (n,), ns
        Filled: log time of the row that made the epoch ready.

    Returns
    -------
    int
        How many of the rover's epochs are ready.
    """
    n, m = rover_t.shape[0], base_t.shape[0]
    same, old, late_rover, late_base, arrived = 0, 0, 0, 0, 0
    newest = -1
    for k in range(n):
        if k > 0 and rover_t[k] < rover_t[k - 1]:
            same, old = 0, 0
        while same < m and base_t[same] < rover_t[k] - tolerance:
            same += 1
        while old < m and base_t[old] < rover_t[k] - max_age:
            old += 1
        deadline = rover_log[k] + wait
        while late_rover < n and rover_log[late_rover] < deadline:
            late_rover += 1
        while late_base < m and base_log[late_base] < deadline:
            late_base += 1
        at = -1
        if same < m and needed[k] != NOT_YET:
            at = max(base_log[same], needed[k])
        if late_base < m and (at < 0 or base_log[late_base] < at):
            at = base_log[late_base]
        if late_rover < n and (at < 0 or rover_log[late_rover] < at):
            at = rover_log[late_rover]
        if at < 0 or at > now:
            return k
        at = max(at, rover_log[k], last)
        last = at
        while arrived < m and base_log[arrived] <= at:
            newest = max(newest, base_t[arrived])
            arrived += 1
        release[k] = at
        best = -1
        for j in range(old, arrived):
            age = rover_t[k] - base_t[j]
            if age < -tolerance or age > max_age or base_t[j] < newest - LATE_NS:
                continue
            if best < 0 or base_t[j] > base_t[best]:
                best = j
        partner[k] = best
    return n
