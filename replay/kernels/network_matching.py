"""Which errors of a network's baselines serve which epoch of a rover, by log times alone."""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.types import Array

ERROR_EPOCH_DTYPE: Final = np.dtype(
    [
        ("baseline", "<i8"),  # from 0
        ("t", "<i8"),  # ns
        ("log_t", "<i8"),  # ns
        ("first", "<i8"),  # its first row
        ("count", "<i8"),
    ],
    align=True,
)
"""Errors of a baseline at one epoch."""


@njit(cache=True)
def match_errors(
    rover_t: Array, rover_log: Array, epochs: Array, baselines: int, now: int, last: int,
    tolerance: int, wait: int, max_age: int, late: int, chosen: Array, release: Array,
) -> int:  # fmt: skip
    """Say which rover epochs can be worked on by now, with which errors, and since when.

    A rover's epoch waits until every baseline that lives has errors that are no more than
    `tolerance` earlier, or until a row comes that is `wait` later than it in the log. A
    baseline lives whose newest errors so far are no more than `max_age` earlier than the
    epoch. Then of each baseline the newest errors serve that are no more than `tolerance`
    later and no more than `max_age` earlier.

    Parameters
    ----------
    rover_t, rover_log : int64 arrays (n,), ns
        Epochs that wait, in the order of their arrival.
    epochs : array (m,) of ERROR_EPOCH_DTYPE
        In the order of their arrival; valid times of one baseline rise.
    baselines : int
    now : int, ns
        Log time up to which rows are known.
    last : int, ns
        Log time of the release before.
    tolerance, wait, max_age : int, ns
    late : int, ns
        Errors so much older than the newest ones of their baseline are not remembered.
    chosen : int64 array (n, baselines)
        Filled: place in `epochs` or minus one.
    release : int64 array (n,), ns
        Filled: log time of the row that made the epoch ready.

    Returns
    -------
    int
        How many of the rover's epochs are ready.
    """
    n, m = rover_t.shape[0], epochs.shape[0]
    newest = np.full(baselines, -1)
    arrived, heard = 0, 0
    for k in range(n):
        at = max(rover_log[k], last)
        while True:
            if at > now:
                return k
            while arrived < m and epochs[arrived]["log_t"] <= at:
                newest[epochs[arrived]["baseline"]] = arrived
                arrived += 1
            ready = at >= rover_log[k] + wait
            if not ready:
                ready = True
                for b in range(baselines):
                    if newest[b] < 0:
                        continue
                    t = epochs[newest[b]]["t"]
                    if rover_t[k] - max_age <= t < rover_t[k] - tolerance:
                        ready = False
            if ready:
                break
            # The next row of any kind.
            while heard < n and rover_log[heard] <= at:
                heard += 1
            after = -1
            if arrived < m:
                after = epochs[arrived]["log_t"]
            if heard < n and (after < 0 or rover_log[heard] < after):
                after = rover_log[heard]
            if after < 0:
                return k
            at = after
        last = at
        release[k] = at
        left = 0
        for b in range(baselines):
            chosen[k, b] = -1
            if newest[b] >= 0:
                left += 1
        for j in range(arrived - 1, -1, -1):
            if left == 0:
                break
            b = epochs[j]["baseline"]
            t = epochs[j]["t"]
            if chosen[k, b] != -1 or t > rover_t[k] + tolerance:
                continue
            left -= 1
            # Minus two: nothing that serves comes before it either.
            old = t < rover_t[k] - max_age or t < epochs[newest[b]]["t"] - late
            chosen[k, b] = -2 if old else j
        for b in range(baselines):
            chosen[k, b] = max(chosen[k, b], -1)
    return n
