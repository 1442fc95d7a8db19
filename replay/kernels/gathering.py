"""Rows of observations, sights and corrections to one record per satellite and epoch.

All channels are in the order of log time, valid time and satellite; rows of one epoch
share both times. The loops walk them side by side. Valid times need not rise: an epoch
that arrives late is an epoch like any other.
"""

import numpy as np
from numba import njit

from replay.kernels.gnss_records import NOT_YET, SLOTS, satellite_number, system_of_letter
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.types import Array, Record

_NAN = float("nan")
_RANK = 64  # a choice is slot * _RANK + rank


@njit(cache=True)
def _number(text: Array) -> tuple[int, int, int]:
    """System, PRN and dense number of a satellite's three characters; -1 where unknown."""
    system = system_of_letter(text[0])
    tens = text[1] - 48
    if text[1] == 32:
        tens = 0
    prn = 10 * tens + text[2] - 48
    return system, prn, satellite_number(system, prn)


@njit(cache=True)
def _before(log_t: int, t: int, epoch: Record) -> bool:
    """Whether a row of another channel stands before an epoch in the log."""
    return log_t < epoch["log_t"] or (log_t == epoch["log_t"] and t < epoch["t"])


@njit(cache=True)
def _of(log_t: int, t: int, epoch: Record) -> bool:
    """Whether a row of another channel belongs to an epoch."""
    return log_t == epoch["log_t"] and t == epoch["t"]


@njit(cache=True)
def _clear(row: Record) -> None:
    row["seen"] = 0
    for k in range(SLOTS):
        row["signal"][k] = 0
        row["frequency"][k] = _NAN
        row["code"][k] = _NAN
        row["phase"][k] = _NAN
        row["range_rate"][k] = _NAN
        row["cn0"][k] = _NAN
        row["lock_lost"][k] = 0
        row["lock_time"][k] = _NAN
        row["group_delay"][k] = _NAN
        row["ionosphere"][k] = 0.0
    row["distance"] = _NAN
    row["sagnac"] = 0.0
    row["polynomial"] = 0.0
    row["relativity"] = 0.0
    row["hydrostatic"] = 0.0
    row["wet"] = 0.0
    row["hydrostatic_mapping"] = 0.0
    row["wet_mapping"] = 0.0
    row["shapiro"] = 0.0


@njit(cache=True)
def gather(
    t: Array,
    log_t: Array,
    satellite: Array,
    signal: Array,
    values: Array,
    channel: Array,
    lost: Array,
    choice: Array,
    frequency: Array,
    epochs: Array,
    rows: Array,
    counts: Array,
) -> None:
    """One record per satellite and epoch, each slot filled with its best signal.

    Parameters
    ----------
    t, log_t : int64 arrays (n,), ns
    satellite : uint8 array (n, 3)
    signal : uint8 array (n, 2)
    values : float64 array (n, 5)
        Pseudorange (m), carrier phase (cycle), Doppler (Hz), C/N0 (dB-Hz), lock time (s);
        NaN is absent.
    channel : int64 array (n,)
        GLONASS frequency channel, 99 where unknown.
    lost : int64 array (n,)
        RINEX loss-of-lock bits.
    choice : int64 array (5, 10, 128)
        By system, band and attribute: slot * 64 + rank, lower ranks first; -1 for a signal
        that is not asked for.
    frequency : float64 array (5, 10, 2)
        By system and band: Hz of channel 0, Hz per GLONASS channel.
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
        Filled; room for n each.
    counts : int64 array (3,)
        Filled: epochs, rows, observations of satellites without a number.
    """
    for k in range(3):
        counts[k] = 0
    best = [0, 0, 0]
    current = -1
    epoch_t = -1
    epoch_log_t = -1
    for i in range(t.shape[0]):
        system, prn, number = _number(satellite[i])
        if number < 0:
            counts[2] += 1
            continue
        if counts[0] == 0 or t[i] != epoch_t or log_t[i] != epoch_log_t:
            epoch_t = t[i]
            epoch_log_t = log_t[i]
            epoch = epochs[counts[0]]
            epoch["t"] = t[i]
            epoch["log_t"] = log_t[i]
            epoch["first"] = counts[1]
            epoch["count"] = 0
            epoch["placed"] = 0
            counts[0] += 1
            current = -1
        band = signal[i, 0] - 48
        attribute = signal[i, 1]
        if band < 0 or band > 9 or attribute > 127:
            continue
        chosen = choice[system, band, attribute]
        if chosen < 0:
            continue
        if number != current:
            current = number
            row = rows[counts[1]]
            counts[1] += 1
            epochs[counts[0] - 1]["count"] += 1
            row["satellite"] = number
            row["system"] = system
            row["prn"] = prn
            _clear(row)
            for k in range(SLOTS):
                best[k] = _RANK
        slot = chosen // _RANK
        rank = chosen % _RANK
        code, phase = values[i, 0], values[i, 1]
        if code != code and phase != phase:
            continue
        row = rows[counts[1] - 1]
        # A signal with a range is better than one without, whatever its rank.
        if code != code:
            rank += _RANK // 2
        if rank >= best[slot]:
            continue
        f = frequency[system, band, 0]
        if frequency[system, band, 1] != 0.0:
            if channel[i] == 99:
                continue
            f += frequency[system, band, 1] * channel[i]
        if not f > 0.0:
            continue
        best[slot] = rank
        wavelength = SPEED_OF_LIGHT_M_S / f
        row["signal"][slot] = signal[i, 0] + 256 * attribute
        row["frequency"][slot] = f
        row["code"][slot] = code
        row["phase"][slot] = phase * wavelength
        row["range_rate"][slot] = -values[i, 2] * wavelength
        row["cn0"][slot] = values[i, 3]
        row["lock_time"][slot] = values[i, 4]
        row["lock_lost"][slot] = lost[i]


@njit(cache=True)
def join_sights(
    epochs: Array,
    rows: Array,
    t: Array,
    log_t: Array,
    satellite: Array,
    vectors: Array,
    values: Array,
    integers: Array,
) -> None:
    """Fill what is known of each satellite.

    Parameters
    ----------
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
    t, log_t : int64 arrays (n,), ns
    satellite : uint8 array (n, 3)
    vectors : float64 array (n, 6)
        Position (m) and velocity (m/s), ECEF at reception.
    values : float64 array (n, 6)
        Clock (s), drift (s/s), elevation, azimuth (rad), range deviation (m), age (s).
    integers : int64 array (n, 2)
        Issue and health.
    """
    i = 0
    n = t.shape[0]
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        while i < n and _before(log_t[i], t[i], epoch):
            i += 1
        k = epoch["first"]
        end = epoch["first"] + epoch["count"]
        start = i
        while k < end:
            row = rows[k]
            j = start
            while j < n and _of(log_t[j], t[j], epoch):
                _, _, number = _number(satellite[j])
                if number == row["satellite"]:
                    row["seen"] = 1
                    for c in range(3):
                        row["position"][c] = vectors[j, c]
                        row["velocity"][c] = vectors[j, 3 + c]
                    row["clock"] = values[j, 0] * SPEED_OF_LIGHT_M_S
                    row["drift"] = values[j, 1] * SPEED_OF_LIGHT_M_S
                    row["elevation"] = values[j, 2]
                    row["azimuth"] = values[j, 3]
                    row["range_std"] = values[j, 4]
                    row["age"] = values[j, 5]
                    row["issue"] = integers[j, 0]
                    row["health"] = integers[j, 1]
                    start = j + 1
                    break
                j += 1
            k += 1


@njit(cache=True)
def join_corrections(
    epochs: Array,
    rows: Array,
    t: Array,
    log_t: Array,
    satellite: Array,
    signal: Array,
    values: Array,
) -> None:
    """Fill the terms of the corrections, and take what the antenna adds off code and phase.

    Parameters
    ----------
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
    t, log_t : int64 arrays (n,), ns
    satellite : uint8 array (n, 3)
    signal : uint8 array (n, 2)
    values : float64 array (n, 14)
        Fields of `replay.SignalCorrections` from `distance_m` to `shapiro_m`; what else adds
        to the code and what to the phase, taken off both here; 1 where the phase's bias is
        known.
    """
    i = 0
    n = t.shape[0]
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        while i < n and _before(log_t[i], t[i], epoch):
            i += 1
        j = i
        for k in range(epoch["first"], epoch["first"] + epoch["count"]):
            row = rows[k]
            p = j
            while p < n and _of(log_t[p], t[p], epoch):
                _, _, number = _number(satellite[p])
                if number == row["satellite"]:
                    code = signal[p, 0] + 256 * signal[p, 1]
                    for slot in range(SLOTS):
                        if row["signal"][slot] == code:
                            row["code"][slot] -= values[p, 11]
                            row["phase"][slot] -= values[p, 12]
                            row["phase_known"][slot] = 1 if values[p, 13] == 1.0 else 0
                            row["group_delay"][slot] = values[p, 4]
                            row["ionosphere"][slot] = values[p, 5]
                            row["distance"] = values[p, 0]
                            row["sagnac"] = values[p, 1]
                            row["polynomial"] = -values[p, 2]
                            row["relativity"] = -values[p, 3]
                            row["hydrostatic"] = values[p, 6]
                            row["wet"] = values[p, 7]
                            row["hydrostatic_mapping"] = values[p, 8]
                            row["wet_mapping"] = values[p, 9]
                            row["shapiro"] = (
                                values[p, 10] if values[p, 10] == values[p, 10] else 0.0
                            )
                    j = p + 1
                elif number > row["satellite"]:
                    break
                p += 1


@njit(cache=True)
def join_network(
    epochs: Array, rows: Array, t: Array, log_t: Array, satellite: Array, signal: Array,
    values: Array,
) -> None:  # fmt: skip
    """Fill what a network of stations says of the rover's errors.

    The two frequencies of a satellite tell the dispersive part from the rest, so that codes
    and further frequencies have corrections too. An epoch takes what came first.

    Parameters
    ----------
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
        `needed` is filled with the log time.
    t, log_t : int64 arrays (n,), ns
    satellite : uint8 array (n, 3)
    signal : uint8 array (n, 2)
    values : float64 array (n, 2), m
        Correction and its deviation.
    """
    n = t.shape[0]
    i = 0
    while i < n:
        end = i
        while end < n and t[end] == t[i] and log_t[end] == log_t[i]:
            end += 1
        for e in range(epochs.shape[0]):
            epoch = epochs[e]
            if epoch["t"] != t[i] or epoch["needed"] != NOT_YET:
                continue
            epoch["needed"] = log_t[i]
            for k in range(epoch["first"], epoch["first"] + epoch["count"]):
                for j in range(i, end):
                    _, _, number = _number(satellite[j])
                    if number == rows[k]["satellite"]:
                        _correct(rows[k], signal[j, 0] + 256 * signal[j, 1], values[j])
                _split(rows[k])
            break
        i = end


@njit(cache=True)
def _correct(row: Record, code: int, value: Array) -> None:
    for slot in range(SLOTS):
        if row["signal"][slot] == code:
            row["network_known"][slot] = 1
            row["network"][slot] = value[0]
            row["network_std"][slot] = value[1]


@njit(cache=True)
def _split(row: Record) -> None:
    """Corrections of codes and of a third phase from those of two phases."""
    if row["network_known"][0] == 0 or row["network_known"][1] == 0:
        return
    ratio = np.zeros(SLOTS)
    for slot in range(SLOTS):
        if row["frequency"][slot] > 0.0:
            part = row["frequency"][0] / row["frequency"][slot]
            ratio[slot] = part * part
    delay = (row["network"][0] - row["network"][1]) / (ratio[1] - ratio[0])
    rest = row["network"][0] + delay
    for slot in range(SLOTS):
        if ratio[slot] == 0.0:
            continue
        row["network_code"][slot] = rest + ratio[slot] * delay
        if row["network_known"][slot] == 0:
            row["network_known"][slot] = 1
            row["network"][slot] = rest - ratio[slot] * delay
            row["network_std"][slot] = row["network_std"][1]


@njit(cache=True)
def join_coarse(epochs: Array, t: Array, log_t: Array, values: Array, used: Array) -> None:
    """Fill where each epoch was, to some metres.

    Parameters
    ----------
    epochs : array of EPOCH_DTYPE
    t, log_t : int64 arrays (n,), ns
    values : float64 array (n, 5)
        Position (m, ECEF), clock (m), age (s).
    used : int64 array (n,)
        Satellites.
    """
    i = 0
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        while i < t.shape[0] and _before(log_t[i], t[i], epoch):
            i += 1
        if i < t.shape[0] and _of(log_t[i], t[i], epoch):
            epoch["placed"] = 1
            for c in range(3):
                epoch["x"][c] = values[i, c]
            epoch["clock"] = values[i, 3]
            epoch["age"] = values[i, 4]
            epoch["used"] = used[i]
