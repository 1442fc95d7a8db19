"""Observations of a station that is not there: the master's, moved and freed of their errors."""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.types import Array, Record

MOVED_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns
        ("log_t", "<i8"),  # ns
        ("satellite", "<i8"),  # dense number
        ("signal", "<i8"),  # two characters, first one low
        ("frequency", "<f8"),  # Hz
        ("code", "<f8"),  # m
        ("phase", "<f8"),  # cycle
        # Virtual station less master, as modelled: all but the ionosphere, and that.
        ("shift", "<f8"),  # m
        ("delay", "<f8"),  # m, adds to the code
        ("cn0", "<f8"),  # dB-Hz, NaN is absent
        ("lock_time", "<f8"),  # s, NaN is absent
        ("lost", "<i8"),  # RINEX LLI bits, minus one where absent
        ("channel", "<i8"),  # of GLONASS, 99 where absent
    ],
    align=True,
)
"""One signal of one satellite at one epoch of the master, and of the virtual station."""

SHIFT_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns
        ("log_t", "<i8"),  # ns
        ("satellite", "<i8"),
        ("signal", "<i8"),
        ("frequency", "<f8"),  # Hz
        ("value", "<f8"),  # m, of the phase
    ],
    align=True,
)
"""A correction of the network."""


@njit(cache=True)
def range_differences(satellites: Array, a: Array, b: Array) -> Array:
    """Ranges from `b` less those from `a` (n,), m.

    Parameters
    ----------
    satellites : float64 array (n, 3), m, ECEF
    a, b : float64 arrays (3,), m, ECEF
    """
    out = np.zeros(satellites.shape[0])
    for k in range(satellites.shape[0]):
        near, far = 0.0, 0.0
        for i in range(3):
            x, y = satellites[k, i] - a[i], satellites[k, i] - b[i]
            near += x * x
            far += y * y
        out[k] = sqrt(far) - sqrt(near)
    return out


@njit(cache=True)
def code_correction(corrections: Array, first: int, end: int, own: int) -> float:
    """Correction (m) of a code, from those of the phases of its satellite.

    A phase's correction is what is the same on all frequencies less the ionosphere's delay,
    which goes with the inverse square of the frequency; of a code it is their sum. The
    frequency that is farthest from the code's own tells them apart; without another one the
    correction is zero.

    Parameters
    ----------
    corrections : array of SHIFT_DTYPE
    first, end : int
        Those of one epoch.
    own : int
        That of the code's signal.
    """
    c = corrections[own]
    farthest, best = -1, 0.0
    for j in range(first, end):
        other = corrections[j]
        if other["satellite"] != c["satellite"]:
            continue
        apart = abs(other["frequency"] - c["frequency"])
        if apart > best:
            farthest, best = j, apart
    if farthest < 0:
        return 0.0
    ratio = c["frequency"] / corrections[farthest]["frequency"]
    delay = (c["value"] - corrections[farthest]["value"]) / (ratio * ratio - 1.0)
    return c["value"] + 2.0 * delay


@njit(cache=True)
def _move(source: Record, row: Record, phase: float, code: float, log_t: int) -> None:
    row["t"] = source["t"]
    row["log_t"] = log_t
    row["satellite"] = source["satellite"]
    row["signal"] = source["signal"]
    row["frequency"] = source["frequency"]
    row["code"] = source["code"] + (source["shift"] + source["delay"] + code)
    cycles = (source["shift"] - source["delay"] + phase) * source["frequency"] / SPEED_OF_LIGHT_M_S
    row["phase"] = source["phase"] + cycles
    row["shift"] = source["shift"]
    row["delay"] = source["delay"]
    row["cn0"] = source["cn0"]
    row["lock_time"] = source["lock_time"]
    row["lost"] = source["lost"]
    row["channel"] = source["channel"]


@njit(cache=True)
def move_epochs(
    held: Array, corrections: Array, tolerance: int, late: int, out: Array
) -> tuple[int, int]:
    """Virtual observations of the master's epochs for which there are corrections.

    Parameters
    ----------
    held : array (n,) of MOVED_DTYPE
        In the order of log time and valid time.
    corrections : array (m,) of SHIFT_DTYPE
        Likewise. An epoch takes the first of the master's epochs within the tolerance that
        none took before and that had come by then.
    tolerance : int, ns
    late : int, ns
        Epochs of the master that are so much older than its newest one are not remembered.
    out : array (n,) of MOVED_DTYPE
        Filled. Signals without a correction are left out.

    Returns
    -------
    tuple of two ints
        Rows of `held` that no later corrections can take; rows of `out`.
    """
    n, m = held.shape[0], corrections.shape[0]
    start, written, arrived, newest = 0, 0, 0, -1
    i = 0
    while i < m:
        t, log_t = corrections[i]["t"], corrections[i]["log_t"]
        end = i
        while end < m and corrections[end]["t"] == t and corrections[end]["log_t"] == log_t:
            end += 1
        while arrived < n and held[arrived]["log_t"] <= log_t:
            newest = max(newest, held[arrived]["t"])
            arrived += 1
        a = start
        while a < arrived:
            b = a
            while b < n and held[b]["t"] == held[a]["t"] and held[b]["log_t"] == held[a]["log_t"]:
                b += 1
            own = held[a]["t"]
            if own >= t - tolerance and own >= newest - late:
                if own <= t + tolerance:
                    for r in range(a, b):
                        for j in range(i, end):
                            if (
                                corrections[j]["satellite"] == held[r]["satellite"]
                                and corrections[j]["signal"] == held[r]["signal"]
                            ):
                                code = code_correction(corrections, i, end, j)
                                _move(held[r], out[written], corrections[j]["value"], code, log_t)
                                written += 1
                                break
                    start = b
                break
            a = b
        i = end
    return start, written
