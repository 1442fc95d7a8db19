"""Orbits, clocks and corrections of the satellites of each epoch.

For every satellite: the broadcast message to use, its state at transmission, told in
ECEF at reception, and each term between range and pseudorange. Elevation and
atmosphere need the antenna's position to some metres; where it is not given, a
least-squares position from plain ranges serves, which starts from the epoch before.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.coarse_position import coarse_position, place_epoch
from replay.kernels.earth import enu_axes, geodetic
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import (
    GALILEO,
    SATELLITES,
    SLOTS,
    SYSTEMS,
)
from replay.kernels.least_squares import geometric_range
from replay.kernels.notes import append_note
from replay.kernels.orbits import (
    SPEED_OF_LIGHT_M_S,
    clock_polynomial,
    group_delay,
    relativistic_clock,
    rotate_to_reception,
    satellite_state,
    transmission_offset,
)
from replay.kernels.path_delays import PLACE, model_atmosphere, prepare_place
from replay.kernels.sight import elevation_azimuth
from replay.kernels.types import Array, Record

SIGHTS_CONFIG_DTYPE: Final = np.dtype(
    [
        ("max_age", "<f8", SYSTEMS),  # s between reception and reference time
        ("latest", "<i8"),  # 1: the message sent last, else the one nearest in time
        ("fnav", "<i8"),  # 1: Galileo F/NAV before I/NAV
        ("unhealthy", "<i8"),  # 1: use satellites that say they are unhealthy
        ("ionosphere", "<i8"),  # 0 none, 1 Klobuchar for all, 2 each system's own
        ("troposphere", "<i8"),  # 0 none; Saastamoinen and: 1 Niell, 2 1/sin, 3 GMF
        ("meteorology", "<i8"),  # 0 standard atmosphere, 1 MOPS, 2 GPT
        ("humidity", "<f8"),  # 0 to 1
        ("shapiro", "<i8"),
        ("fixed", "<i8"),  # 1: the antenna stands at `position`
        ("position", "<f8", 3),  # m, ECEF
        ("coast", "<f8"),  # s for which an old position serves
    ],
    align=True,
)

SIGHTS_STATE_DTYPE: Final = np.dtype(
    [
        ("x", "<f8", 3),  # m, ECEF: last coarse position
        ("clock", "<f8", SYSTEMS),  # m
        ("t", "<i8"),  # ns of the last coarse position, minus one before the first
        ("offset", "<f8"),  # m, the receiver's clock then
        ("alpha", "<f8", (2, 4)),  # broadcast ionosphere: Klobuchar, BeiDou
        ("beta", "<f8", (2, 4)),
        ("known", "<i8", 2),  # whether the log brought one
        ("missing", "<i8", SATELLITES),  # 1 where the lack of a message has been told
    ],
    align=True,
)

EVENT_NO_EPHEMERIS: Final = 13
EVENT_TOO_FEW: Final = 14
EVENT_NOT_CONVERGED: Final = 15

# A broadcast ionosphere: Klobuchar's is number 0, BeiDou's 1.
IONOSPHERE_DTYPE: Final = np.dtype(
    [("available", "<i8"), ("model", "<i8"), ("alpha", "<f8", 4), ("beta", "<f8", 4)], align=True
)

NOTE_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("kind", "<i8"),
        ("satellite", "<i8"),  # minus one for none
        ("value", "<f8"),
    ],
    align=True,
)


@njit(cache=True)
def choose_message(
    messages: Array,
    available: Array,
    first: int,
    end: int,
    t: int,
    log_t: int,
    system: int,
    cfg: Record,
) -> int:
    """Number of the broadcast message to use, or minus one.

    Parameters
    ----------
    messages : array of EPHEMERIS_DTYPE
        Those of one satellite stand from `first` to `end`.
    available : int64 array, ns
        Log time of each: a later one is not known yet.
    t, log_t : int, ns
        Of the epoch.
    system : int
    cfg : record of SIGHTS_CONFIG_DTYPE
    """
    best = -1
    best_rank = 0
    best_age = 0.0
    limit = cfg["max_age"][system]
    for k in range(first, end):
        if available[k] > log_t:
            continue
        message = messages[k]
        if message["health"] != 0 and cfg["unhealthy"] == 0:
            continue
        age = (t - message["toe_ns"]) * 1e-9
        if age > limit or age < -limit:
            continue
        rank = 0
        if system == GALILEO:
            source = message["source"]
            is_fnav = source & 2 != 0 and source & 5 == 0
            rank = 1 if is_fnav != (cfg["fnav"] == 1) else 0
        distance = abs(age)
        if cfg["latest"] == 1:
            distance = (t - message["transmitted_ns"]) * 1e-9
            if distance < 0.0:
                distance = 1e9 - distance
        if best < 0 or rank < best_rank or (rank == best_rank and distance <= best_age):
            best = k
            best_rank = rank
            best_age = distance
    return best


@njit(cache=True)
def locate(row: Record, message: Record, t: int, state: Array) -> bool:
    """Satellite's state at transmission, by the pseudorange of its first filled slot.

    The position is left in ECEF at transmission; False where there is no pseudorange.
    """
    code = row["code"][0]
    for slot in range(1, SLOTS):
        if code != code:
            code = row["code"][slot]
    if code != code or not 1e6 < code < 1e9:
        return False
    offset = transmission_offset(message, t, code)
    satellite_state(message, t, offset, state)
    polynomial, rate = clock_polynomial(message, t, offset)
    relativity, relative_rate = relativistic_clock(message, t, offset)
    for i in range(3):
        row["position"][i] = state[i]
        row["velocity"][i] = state[3 + i]
    row["polynomial"] = polynomial * SPEED_OF_LIGHT_M_S
    row["relativity"] = relativity * SPEED_OF_LIGHT_M_S
    row["clock"] = (polynomial + relativity) * SPEED_OF_LIGHT_M_S
    row["drift"] = (rate + relative_rate) * SPEED_OF_LIGHT_M_S
    row["age"] = (t - message["toe_ns"]) * 1e-9
    row["issue"] = message["iode"]
    row["health"] = message["health"]
    row["range_std"] = message["accuracy_m"]
    for slot in range(SLOTS):
        if row["signal"][slot] != 0:
            delay = group_delay(message, row["signal"][slot] % 256 - 48)
            # Where the message does not tell, nothing is modelled.
            row["group_delay"][slot] = delay * SPEED_OF_LIGHT_M_S if delay == delay else 0.0
    return True


@njit(cache=True)
def to_reception(row: Record, sent: Array, x: Array, state: Array, u: Array) -> float:
    """Turn position and velocity into ECEF at reception; the range (m), line of sight in `u`.

    `sent` (6,) are both in ECEF at transmission. `distance` and `sagnac` are filled. Two
    rounds of the light-time equation leave less than a micrometre.
    """
    for i in range(3):
        row["position"][i] = sent[i]
    distance = geometric_range(row, x, u)
    travel = distance / SPEED_OF_LIGHT_M_S
    for _ in range(2):
        for i in range(6):
            state[i] = sent[i]
        rotate_to_reception(travel, state)
        dx, dy, dz = state[0] - x[0], state[1] - x[1], state[2] - x[2]
        travel = sqrt(dx * dx + dy * dy + dz * dz) / SPEED_OF_LIGHT_M_S
    for i in range(3):
        row["position"][i] = state[i]
        row["velocity"][i] = state[3 + i]
    turned = geometric_range(row, x, u)
    row["distance"] = distance
    row["sagnac"] = turned - distance
    return turned


@njit(cache=True)
def view(rows: Array, sent: Array, s: Record, cfg: Record, t: int, axes: Array, u: Array) -> None:
    """What lies between the satellites of an epoch and the position of the state.

    `sent` (n, 6) holds positions and velocities in ECEF at transmission; `axes` (3, 3) and
    `u` (3,) are overwritten.
    """
    x = s["x"]
    state, place = np.zeros(8), np.zeros(PLACE)
    place[0], place[1], place[2] = geodetic(x[0], x[1], x[2])
    prepare_place(cfg, place, t)
    enu_axes(x[0], x[1], x[2], axes)
    for k in range(rows.shape[0]):
        row = rows[k]
        if row["seen"] == 1:
            to_reception(row, sent[k], x, state, u)
            row["elevation"], row["azimuth"] = elevation_azimuth(axes, u[0], u[1], u[2])
            model_atmosphere(row, x, t, s, cfg, place)


@njit(cache=True)
def note(
    notes: Array, counts: Array, t: int, log_t: int, kind: int, sat: int, value: float
) -> None:
    """Append one event; beyond the room that there is, only count it."""
    if counts[0] < notes.shape[0]:
        append_note(notes, counts, 0, t, log_t, kind, sat, value)
    else:
        counts[1] += 1


@njit(cache=True)
def learn_ionosphere(s: Record, models: Array, first: int, log_t: int) -> int:
    """Take the broadcast ionospheres that are known by now; how many were taken so far."""
    k = first
    while k < models.shape[0] and models[k]["available"] <= log_t:
        model = models[k]["model"]
        for i in range(4):
            s["alpha"][model, i] = models[k]["alpha"][i]
            s["beta"][model, i] = models[k]["beta"][i]
        s["known"][model] = 1
        k += 1
    return k


@njit(cache=True)
def run_sights(
    state: Array,
    config: Array,
    models: Array,
    messages: Array,
    available: Array,
    starts: Array,
    epochs: Array,
    rows: Array,
    scratch: Array,
    notes: Array,
    counts: Array,
) -> int:
    """Fill the rows of all epochs of a block.

    Parameters
    ----------
    state, config, scratch : arrays of one record each
        SIGHTS_STATE_DTYPE, SIGHTS_CONFIG_DTYPE, SOLVE_DTYPE.
    models : array of IONOSPHERE_DTYPE
        Not used yet, in the order of their arrival.
    messages : array of EPHEMERIS_DTYPE
        Grouped by satellite.
    available : int64 array, ns
        Log time of each message.
    starts : int64 array (SATELLITES + 1,)
        Where each satellite's messages begin.
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
        `seen` becomes 1 where everything is known.
    notes : array of NOTE_DTYPE
    counts : int64 array (2,)
        Notes written; notes for which there was no room.

    Returns
    -------
    int
        How many of the models were taken; the others are later than the epochs.
    """
    taken = 0
    s, cfg, work = state[0], config[0], scratch[0]
    u = np.zeros(3)
    sat_state = np.zeros(8)
    sent = np.zeros((SATELLITES, 6))
    observed = np.zeros(SATELLITES)
    weight = np.zeros(SATELLITES)
    for e in range(epochs.shape[0]):
        t, log_t = epochs[e]["t"], epochs[e]["log_t"]
        taken = learn_ionosphere(s, models, taken, log_t)
        part = rows[epochs[e]["first"] : epochs[e]["first"] + epochs[e]["count"]]
        for k in range(part.shape[0]):
            row = part[k]
            sat = row["satellite"]
            chosen = choose_message(
                messages, available, starts[sat], starts[sat + 1], t, log_t, row["system"], cfg
            )
            if chosen < 0:
                if s["missing"][sat] == 0:
                    s["missing"][sat] = 1
                    note(notes, counts, t, log_t, EVENT_NO_EPHEMERIS, sat, 0.0)
                continue
            s["missing"][sat] = 0
            if locate(row, messages[chosen], t, sat_state):
                row["seen"] = 1
        epoch = epochs[e]
        epoch["placed"] = 0
        fresh = True
        if cfg["fixed"] == 1:
            for i in range(3):
                s["x"][i] = cfg["position"][i]
            s["t"] = t
        else:
            status = coarse_position(part, s, cfg, t, observed, weight, work, u)
            if status > 0:
                s["t"] = t
            else:
                fresh = False
                kind = EVENT_TOO_FEW if status == -1 else EVENT_NOT_CONVERGED
                known = s["t"] >= 0 and (t - s["t"]) * 1e-9 <= cfg["coast"]
                if not known:
                    s["t"] = -1
                    for i in range(SYSTEMS):
                        s["clock"][i] = 0.0
                    note(notes, counts, t, log_t, kind, -1, float(part.shape[0]))
                    for k in range(part.shape[0]):
                        part[k]["seen"] = 0
                    continue
        for k in range(part.shape[0]):
            for i in range(3):
                sent[k, i] = part[k]["position"][i]
                sent[k, 3 + i] = part[k]["velocity"][i]
        view(part, sent, s, cfg, t, work["axes"], u)
        if place_epoch(epoch, part, s, cfg, observed, weight, work, u, fresh):
            # Tens of metres, without an atmosphere, are centimetres of troposphere.
            view(part, sent, s, cfg, t, work["axes"], u)
    return taken


def new_sights_state(alpha: Array, beta: Array) -> Array:
    """One state record of a stage that has seen nothing.

    Klobuchar's coefficients `alpha`, `beta` (4,) serve until the log brings some.
    """
    state = np.zeros(1, dtype=SIGHTS_STATE_DTYPE)
    state["t"] = -1
    state["alpha"][0, 0] = alpha
    state["beta"][0, 0] = beta
    return state
