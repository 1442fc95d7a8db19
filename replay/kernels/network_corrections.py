"""Corrections of a rover's epochs from the errors of a network's baselines.

Which errors serve which epoch is in :mod:`replay.kernels.network_matching`, the weights of
the stations are in :mod:`replay.kernels.interpolation`.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import COUNT, FIRST, SYSTEMS
from replay.kernels.interpolation import (
    LSC,
    collocation_weights,
    plane_misfit,
    prediction_sigma,
    station_weights,
)
from replay.kernels.types import Array, Record

_NS: Final = 1e-9
_ROOM: Final = 64  # satellites of one system, at most

PLACE_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns
        ("log_t", "<i8"),  # ns
        ("x", "<f8", 3),  # m, ECEF
    ],
    align=True,
)
"""A rover's epoch."""


CORRECTION_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("satellite", "<i8"),
        ("reference", "<i8"),
        ("signal", "<i8"),
        ("value", "<f8"),  # m
        ("sigma", "<f8"),  # m
        ("misfit", "<f8"),  # m
        ("stations", "<i8"),
        ("age", "<f8"),  # s
    ],
    align=True,
)

assert max(COUNT) <= _ROOM


@njit(cache=True)
def _groups(epochs: Array, rows: Array, chosen: Array, system: Array, signal: Array) -> int:
    """Fill the pairs of system and signal that there are, in the order of their text."""
    count = 0
    for b in range(chosen.shape[0]):
        if chosen[b] < 0:
            continue
        epoch = epochs[chosen[b]]
        for r in range(epoch["first"], epoch["first"] + epoch["count"]):
            s, code = rows[r]["system"], rows[r]["signal"]
            order = (code % 256) * 256 + code // 256
            k = count
            found = False
            while k > 0:
                other = (signal[k - 1] % 256) * 256 + signal[k - 1] // 256
                if system[k - 1] == s and other == order:
                    found = True
                    break
                if system[k - 1] < s or (system[k - 1] == s and other < order):
                    break
                k -= 1
            if found:
                continue
            for j in range(count, k, -1):
                system[j] = system[j - 1]
                signal[j] = signal[j - 1]
            system[k] = s
            signal[k] = code
            count += 1
    return count


@njit(cache=True)
def _collect(
    epochs: Array, rows: Array, chosen: Array, t: int, system: int, signal: int,
    value: Array, sigma: Array, known: Array, reference: Array,
) -> None:  # fmt: skip
    """Fill one group's errors by baseline and satellite, carried on to a time.

    The deviation grows by those of the rate and of the acceleration as if all were fully
    correlated, which is the most that it can be.
    """
    for b in range(chosen.shape[0]):
        reference[b] = -1
        for p in range(_ROOM):
            known[b, p] = False
        if chosen[b] < 0:
            continue
        epoch = epochs[chosen[b]]
        dt = (t - epoch["t"]) * _NS
        half = 0.5 * dt * dt
        for r in range(epoch["first"], epoch["first"] + epoch["count"]):
            row = rows[r]
            if row["system"] != system or row["signal"] != signal:
                continue
            if reference[b] < 0:
                reference[b] = row["reference"]
                p = row["reference"] - FIRST[system]
                known[b, p] = True
                value[b, p] = 0.0
                sigma[b, p] = 0.0
            if row["reference"] != reference[b]:
                continue
            x, s = row["x"], row["sigma"]
            p = row["satellite"] - FIRST[system]
            known[b, p] = True
            value[b, p] = x[0] + dt * x[1] + half * x[2]
            sigma[b, p] = s[0] + abs(dt) * s[1] + half * s[2]


@njit(cache=True)
def common_reference(known: Array, reference: Array, first: int) -> int:
    """The satellite that all of a group becomes the difference to, or minus one.

    The baselines' own where they agree. Else the one that most baselines have; of several,
    the one that most are differences to already; of several, the lowest number.

    Parameters
    ----------
    known : bool array (baselines, satellites of the system)
    reference : int64 array (baselines,)
        Dense numbers, or minus one for a baseline that has nothing.
    first : int
        Dense number of the system's first satellite.
    """
    best, most, own = -1, 0, 0
    for p in range(known.shape[1]):
        have, here = 0, 0
        for b in range(known.shape[0]):
            if reference[b] < 0:
                continue
            have += int(known[b, p])
            here += int(reference[b] == first + p)
        if have > most or (have == most and have > 0 and here > own):
            best, most, own = first + p, have, here
    agreed = -1
    for b in range(known.shape[0]):
        if reference[b] < 0:
            continue
        if agreed >= 0 and reference[b] != agreed:
            return best
        agreed = reference[b]
    return agreed


@njit(cache=True)
def _to_reference(
    value: Array, sigma: Array, known: Array, reference: Array, to: int, first: int
) -> None:
    """Make all errors of a group differences to one satellite.

    Variances add, as when a filter changes its reference: the most that they can be, as long
    as both hold the old reference's errors with the same sign. A baseline that has not got
    the satellite is left out.
    """
    p = to - first
    for b in range(known.shape[0]):
        if reference[b] < 0 or reference[b] == to:
            continue
        if not known[b, p]:
            reference[b] = -1
            for k in range(_ROOM):
                known[b, k] = False
            continue
        shift, spread = value[b, p], sigma[b, p]
        for k in range(_ROOM):
            if known[b, k]:
                value[b, k] -= shift
                sigma[b, k] = sqrt(sigma[b, k] * sigma[b, k] + spread * spread)
        sigma[b, p] = 0.0
        reference[b] = to


@njit(cache=True)
def correct_epoch(
    method: int, field: Array, place: Array, rover: Array, t: int, log_t: int, epochs: Array,
    rows: Array, chosen: Array, out: Array, written: int,
) -> int:  # fmt: skip
    """Corrections of one epoch.

    Parameters
    ----------
    method : int
        Of :mod:`replay.kernels.interpolation`.
    field : float64 array (2,)
        Deviations of its slopes (m/m) and second derivatives (1/m).
    place : float64 array (baselines, 2), m
        Stations, east and north of the master.
    rover : float64 array (2,), m
        Likewise.
    t, log_t : int, ns
        Of the rover's epoch, and of what is written.
    epochs : array of ERROR_EPOCH_DTYPE
    rows : array of ERROR_ROW_DTYPE
    chosen : int64 array (baselines,)
        Places in `epochs`, or minus one.
    out : array of CORRECTION_ROW_DTYPE
        Filled from `written` on, by satellite and signal. Room for the rows of the chosen
        epochs twice.
    written : int

    Returns
    -------
    int
        Rows of `out`.
    """
    count = chosen.shape[0]
    total = 0
    for b in range(count):
        if chosen[b] >= 0:
            total += epochs[chosen[b]]["count"]
    system, signal = np.zeros(total, dtype=np.int64), np.zeros(total, dtype=np.int64)
    groups = _groups(epochs, rows, chosen, system, signal)
    value, sigma = np.zeros((groups, count, _ROOM)), np.zeros((groups, count, _ROOM))
    known = np.zeros((groups, count, _ROOM), dtype=np.bool_)
    reference = np.zeros((groups, count), dtype=np.int64)
    common = np.zeros(groups, dtype=np.int64)
    for g in range(groups):
        first = FIRST[system[g]]
        _collect(epochs, rows, chosen, t, system[g], signal[g], value[g], sigma[g], known[g],
                 reference[g])  # fmt: skip
        common[g] = common_reference(known[g], reference[g], first)
        _to_reference(value[g], sigma[g], known[g], reference[g], common[g], first)
    used, before = np.zeros(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    weights, errors, sigmas = np.zeros(count), np.zeros(count), np.zeros(count)
    start = 0
    for s in range(SYSTEMS):
        end = start
        while end < groups and system[end] == s:
            end += 1
        for p in range(COUNT[s] if end > start else 0):
            for g in range(start, end):
                same, stations, age = True, 0, 0
                for b in range(count):
                    used[b] = known[g, b, p]
                    same = same and used[b] == before[b]
                    errors[b] = value[g, b, p]
                    sigmas[b] = sigma[g, b, p]
                    if used[b]:
                        behind = t - epochs[chosen[b]]["t"]
                        age = behind if stations == 0 else max(age, behind)
                        stations += 1
                if stations == 0:
                    continue
                if method == LSC:
                    collocation_weights(
                        place, used, rover[0], rover[1], sigmas, field[0], field[1], weights
                    )
                elif not same:
                    station_weights(method, place, used, rover[0], rover[1], weights)
                    for b in range(count):
                        before[b] = used[b]
                row = out[written]
                written += 1
                row["t"] = t
                row["log_t"] = log_t
                row["satellite"] = FIRST[s] + p
                row["reference"] = common[g]
                row["signal"] = signal[g]
                row["value"] = 0.0
                for b in range(count):
                    row["value"] += weights[b] * errors[b] if used[b] else 0.0
                misfit = plane_misfit(place, used, errors)
                row["misfit"] = misfit
                row["sigma"] = 0.0
                if row["satellite"] != common[g]:
                    # Stations that do not agree say that the field is not what it is taken for.
                    spread = prediction_sigma(
                        weights, place, used, rover[0], rover[1], sigmas, field[0], field[1]
                    )
                    row["sigma"] = sqrt(spread * spread + misfit * misfit)
                row["stations"] = stations
                row["age"] = age * _NS
        start = end
    return written


@njit(cache=True)
def _local(axes: Array, origin: Array, x: Array, out: Array) -> None:
    """East and north (m) of a place against another."""
    for k in range(2):
        out[k] = 0.0
        for i in range(3):
            out[k] += axes[k, i] * (x[i] - origin[i])


@njit(cache=True)
def run_corrections(
    method: int, field: Array, axes: Array, master: Array, stations: Array, places: Array,
    epochs: Array, rows: Array, chosen: Array, release: Array, out: Array,
) -> int:  # fmt: skip
    """Corrections of epochs that are ready; how many rows were written.

    Parameters
    ----------
    method : int
    field : float64 array (2,)
    axes : float64 array (3, 3)
        East, north and up of the master as rows, ECEF.
    master : float64 array (3,), m, ECEF
    stations : float64 array (baselines, 3), m, ECEF
    places : array (n,) of PLACE_DTYPE
    epochs : array of ERROR_EPOCH_DTYPE
    rows : array of ERROR_ROW_DTYPE
    chosen : int64 array (n, baselines)
    release : int64 array (n,), ns
    out : array of CORRECTION_ROW_DTYPE
    """
    plane = np.zeros((stations.shape[0], 2))
    for b in range(stations.shape[0]):
        _local(axes, master, stations[b], plane[b])
    rover = np.zeros(2)
    written = 0
    for k in range(places.shape[0]):
        place: Record = places[k]
        _local(axes, master, place["x"], rover)
        written = correct_epoch(
            method,
            field,
            plane,
            rover,
            place["t"],
            release[k],
            epochs,
            rows,
            chosen[k],
            out,
            written,
        )
    return written
