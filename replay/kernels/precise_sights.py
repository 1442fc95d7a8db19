"""Orbits, clocks and corrections of the satellites of each epoch, with precise products.

As :mod:`replay.kernels.sights`, whose records it fills, with positions of centres of mass from
SP3, clocks of their own, and the further terms of :mod:`replay.kernels.precise_terms`. With
orbits and clocks of broadcast messages all the other terms are the same, but for the
satellite's antenna: those orbits are of its phase centre.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels import precise_terms as terms_of
from replay.kernels.coarse_position import coarse_position, place_epoch
from replay.kernels.earth import enu_axes, geodetic
from replay.kernels.elementary import sqrt
from replay.kernels.gnss_records import SATELLITES, SLOTS, SYSTEMS
from replay.kernels.least_squares import geometric_range
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.path_delays import PLACE, model_atmosphere, prepare_place
from replay.kernels.precise_orbits import (
    FOUND,
    IN_GAP,
    OUTSIDE,
    WORK_SHAPE,
    precise_clock,
    precise_position,
    relativity,
    relativity_rate,
    row_before,
)
from replay.kernels.precise_records import (
    CLOCK,
    CONTINUED,
    KIND,
    NO_BIAS,
    NO_MAP,
    NO_SATELLITE,
    Broadcast,
    Products,
)
from replay.kernels.satellite_attitude import satellite_axes
from replay.kernels.sight import elevation_azimuth
from replay.kernels.sights import (
    EVENT_NOT_CONVERGED,
    EVENT_TOO_FEW,
    choose_message,
    learn_ionosphere,
    locate,
    note,
    to_reception,
)
from replay.kernels.types import Array, Record
from replay.kernels.wind_up import level_antenna

# Error of an orbit over what the last point of its polynomial changed: at 15 minutes past orbits
# of 15 minutes it is 0.19 (root mean square of 80 satellites, degree 10), before that less.
_CONTINUED_ERROR: Final = 0.2
_NEAR_NS: Final = 1_000_000_000  # past an epoch by less is the light's travel
_LOWEST_RAD: Final = 0.017453292519943295  # below it no atmosphere is modelled
# The height that the troposphere is modelled at must not follow the noise of the codes: 10 m are
# 3 mm of zenith delay. It is a mean that lags, and stays within this of the height itself.
_HEIGHT_S: Final = 600.0
_HEIGHT_LAG_M: Final = 20.0


@njit(cache=True)
def beyond_epochs(rows: Array, first: int, end: int, time_ns: int) -> tuple[int, int]:
    """How far a time is from where rows are joined, and the step of the rows there.

    Parameters
    ----------
    rows : array with fields `t` and `gap`
        Those of one satellite stand from `first` to `end`, two at least.
    time_ns : int, ns

    Returns
    -------
    excess : int, ns
        Nought between two rows that nothing parts; in a gap the distance to its nearer side.
    step : int, ns
        Of the two rows on that side.
    """
    k = row_before(rows, first, end, time_ns)
    if k < first:
        return int(rows[first]["t"] - time_ns), int(rows[first + 1]["t"] - rows[first]["t"])
    if k + 1 < end and rows[k + 1]["gap"] == 0:
        return 0, int(rows[k + 1]["t"] - rows[k]["t"])
    excess = int(time_ns - rows[k]["t"])
    if k + 2 < end and rows[k + 1]["t"] - time_ns < excess:
        step = int(rows[k + 2]["t"] - rows[k + 1]["t"])
        return int(rows[k + 1]["t"] - time_ns), step
    return excess, int(rows[k]["t"] - rows[max(k - 1, first)]["t"])


@njit(cache=True)
def _stated(rows: Array, first: int, end: int, time_ns: int, fallback: float) -> float:
    """Deviation that the product states for the last epoch that is not later."""
    std = rows[max(row_before(rows, first, end, time_ns), first)]["std"]
    return std if std == std else fallback


@njit(cache=True)
def locate_precise(
    row: Record, products: Products, t: int, cfg: Record, state: Array, work: Array
) -> tuple[int, int]:
    """Satellite's state at transmission, by the pseudorange of its first filled slot.

    An orbit is continued by one step of its own epochs at most, whatever the settings allow:
    two steps on, a polynomial of degree 10 is kilometres wrong.

    Parameters
    ----------
    row : record of MEASURED_DTYPE
        The position is left in ECEF at transmission.
    products : Products
    t : int, ns
        The receiver's clock at reception.
    cfg : record of PRECISE_SIGHTS_CONFIG_DTYPE
    state, work : float64 arrays (8,) and WORK_SHAPE, overwritten

    Returns
    -------
    lacking : int
        FOUND; minus one for no pseudorange; else what lacks, KIND times the status of
        :mod:`replay.kernels.precise_orbits`, with CLOCK added where it is the clock.
    continued : int
        KIND times CONTINUED where the orbit is continued past its epochs, with CLOCK added
        where it is the clock, 0 where neither is.
    """
    code = row["code"][0]
    for slot in range(1, SLOTS):
        if code != code:
            code = row["code"][slot]
    if code != code or not 1e6 < code < 1e9:
        return -1, 0
    satellite, settings = row["satellite"], products.interpolation[0]
    offset = -code / SPEED_OF_LIGHT_M_S
    first, end = products.clock_starts[satellite], products.clock_starts[satellite + 1]
    status = precise_clock(products.clocks, first, end, t, offset, settings["clock_beyond"], state)
    if status != FOUND:
        return KIND * status + CLOCK, 0
    sent = t + int(offset * 1e9)
    std = _stated(products.clocks, first, end, sent, cfg["range_std"] / SPEED_OF_LIGHT_M_S)
    clock_std = std * SPEED_OF_LIGHT_M_S
    excess, _ = beyond_epochs(products.clocks, first, end, sent)
    continued = KIND * CONTINUED + CLOCK if excess > _NEAR_NS else 0
    # So far the clock was read at the satellite's own time, which is off by the clock itself.
    state[6] -= state[7] * state[6]
    offset -= state[6]
    first, end = products.orbit_starts[satellite], products.orbit_starts[satellite + 1]
    status, change = precise_position(products.orbits, first, end, t, offset, settings, state, work)
    if status != FOUND:
        return KIND * status, 0
    excess, step = beyond_epochs(products.orbits, first, end, sent)
    if excess > step + _NEAR_NS:
        outside = sent < products.orbits[first]["t"] or sent > products.orbits[end - 1]["t"]
        return KIND * (OUTSIDE if outside else IN_GAP), 0
    if excess > _NEAR_NS:
        continued = KIND * CONTINUED
    orbit_std = _stated(products.orbits, first, end, sent, cfg["range_std"])
    effect = relativity(state)
    # The clock's relativity moves the moment by some 20 ns, in which the orbit is straight.
    for i in range(3):
        state[i] -= state[3 + i] * effect
        row["position"][i] = state[i]
        row["velocity"][i] = state[3 + i]
    row["polynomial"] = state[6] * SPEED_OF_LIGHT_M_S
    row["relativity"] = effect * SPEED_OF_LIGHT_M_S
    row["clock"] = (state[6] + effect) * SPEED_OF_LIGHT_M_S
    row["drift"] = (state[7] + relativity_rate(state)) * SPEED_OF_LIGHT_M_S
    last = max(row_before(products.orbits, first, end, sent), first)
    row["age"] = (t - products.orbits[last]["t"]) * 1e-9
    row["issue"] = -1
    row["health"] = 0
    # Between epochs what the last point changed is far above the error.
    change *= _CONTINUED_ERROR if continued == KIND * CONTINUED else 0.0
    row["range_std"] = sqrt(orbit_std * orbit_std + clock_std * clock_std + change * change)
    return FOUND, continued


@njit(cache=True)
def _locate_all(
    rows: Array, s: Record, p: Record, products: Products, broadcast: Broadcast, terms: Array,
    cfg: Record, own: Record, t: int, log_t: int, notes: Array, counts: Array, state: Array,
    work: Array,
) -> None:  # fmt: skip
    """Where the satellites of an epoch were, and the biases of their signals."""
    for k in range(rows.shape[0]):
        row = rows[k]
        satellite = row["satellite"]
        if own["broadcast"] == 1:
            first, end = broadcast.starts[satellite], broadcast.starts[satellite + 1]
            chosen = choose_message(
                broadcast.messages, broadcast.available, first, end, t, log_t, row["system"], cfg
            )
            if chosen < 0:
                if p["lacking"][satellite] == 0:
                    p["lacking"][satellite] = NO_SATELLITE
                    note(notes, counts, t, log_t, NO_SATELLITE, satellite, 0.0)
                continue
            p["lacking"][satellite] = 0
            if locate(row, broadcast.messages[chosen], t, state):
                row["seen"] = 1
            continue
        lacking, continued = locate_precise(row, products, t, own, state, work)
        if lacking < 0:
            continue
        if lacking != FOUND:
            if p["lacking"][satellite] != lacking:
                note(notes, counts, t, log_t, NO_SATELLITE + lacking, satellite, 0.0)
            p["lacking"][satellite] = lacking
            continue
        p["lacking"][satellite] = 0
        if continued != p["continued"][satellite]:
            p["continued"][satellite] = continued
            if continued != 0:
                note(notes, counts, t, log_t, NO_SATELLITE + continued, satellite, 0.0)
        row["seen"] = 1
        if own["biases"] == 0:
            for slot in range(SLOTS):
                row["group_delay"][slot] = 0.0
            continue
        without = terms_of.add_biases(products, row, t, terms[k])
        for slot in range(SLOTS):
            signal = row["signal"][slot]
            if (without >> slot) & 1 == 1 and p["unbiased"][satellite, slot] != signal:
                p["unbiased"][satellite, slot] = signal
                kind = NO_SATELLITE + KIND * NO_BIAS
                note(notes, counts, t, log_t, kind, satellite, float(signal))


@njit(cache=True)
def view_precise(
    rows: Array, sent: Array, s: Record, p: Record, products: Products, cfg: Record, own: Record,
    t: int, place: Array, axes: Array, u: Array,
) -> bool:  # fmt: skip
    """As :func:`replay.kernels.sights.view`; whether the maps had all that was asked of them."""
    x = s["x"]
    state = np.zeros(8)
    place[0], place[1], place[2] = geodetic(x[0], x[1], x[2])
    if p["heights"] > 0:
        place[2] = p["height"]
    prepare_place(cfg, place, t)
    enu_axes(x[0], x[1], x[2], axes)
    whole = True
    for k in range(rows.shape[0]):
        row = rows[k]
        if row["seen"] != 1:
            continue
        to_reception(row, sent[k], x, state, u)
        row["elevation"], row["azimuth"] = elevation_azimuth(axes, u[0], u[1], u[2])
        model_atmosphere(row, x, t, s, cfg, place)
        if own["maps"] == 1 and row["elevation"] >= _LOWEST_RAD:
            whole &= terms_of.add_map(products, row, x, t, own["layer"])
    return whole


@njit(cache=True)
def smooth_height(p: Record, x: Array, t: int) -> None:
    """Take the height of a position (3,) (m, ECEF) into the mean that the state keeps."""
    _, _, height = geodetic(x[0], x[1], x[2])
    if p["heights"] == 0:
        p["height"] = height
    else:
        step = abs(t - p["height_t"]) * 1e-9
        weight = max(1.0 / (p["heights"] + 1), step / (step + _HEIGHT_S))
        p["height"] += weight * (height - p["height"])
        if p["height"] > height + _HEIGHT_LAG_M:
            p["height"] = height + _HEIGHT_LAG_M
        if p["height"] < height - _HEIGHT_LAG_M:
            p["height"] = height - _HEIGHT_LAG_M
    p["heights"] += 1
    p["height_t"] = t


@njit(cache=True)
def _add_terms(
    rows: Array, s: Record, p: Record, products: Products, own: Record, t: int, terms: Array,
    place_axes: Array, u: Array,
) -> None:  # fmt: skip
    """Terms beyond those of MEASURED_DTYPE of all satellites of an epoch."""
    x = s["x"]
    epoch = np.zeros(terms_of.EPOCH_SHAPE)
    axes, receiver = np.zeros((3, 3)), np.zeros((3, 3))
    terms_of.prepare_epoch(own, products, t, x, place_axes, epoch)
    level_antenna(place_axes, 0.0, receiver)
    antenna = own["satellite_antenna"] == 1 and own["broadcast"] == 0
    for k in range(rows.shape[0]):
        row = rows[k]
        if row["seen"] != 1:
            continue
        geometric_range(row, x, u)
        terms_of.add_tides(epoch, u, terms[k])
        if antenna or own["wind_up"] == 1:
            model = terms_of.attitude_of(own, products, row["satellite"], t)
            satellite_axes(model, row["position"], row["velocity"], epoch[terms_of.SUN], axes)
            if antenna:
                terms_of.add_satellite_antenna(products, row, t, axes, u, terms[k])
            if own["wind_up"] == 1:
                terms_of.add_wind_up(p, row, t, axes, receiver, u, terms[k])
        if own["higher_ionosphere"] == 1 and row["elevation"] >= _LOWEST_RAD:
            terms_of.add_higher_ionosphere(products, row, x, t, own["layer"], u, terms[k])


@njit(cache=True)
def run_precise_sights(
    state: Array,
    precise: Array,
    config: Array,
    settings: Array,
    models: Array,
    products: Products,
    broadcast: Broadcast,
    epochs: Array,
    rows: Array,
    terms: Array,
    scratch: Array,
    notes: Array,
    counts: Array,
) -> int:
    """Fill the rows of all epochs of a block.

    Parameters
    ----------
    state, precise : arrays of one record each
        SIGHTS_STATE_DTYPE and PRECISE_SIGHTS_STATE_DTYPE.
    config, settings, scratch : arrays of one record each
        SIGHTS_CONFIG_DTYPE, PRECISE_SIGHTS_CONFIG_DTYPE, SOLVE_DTYPE.
    models : array of IONOSPHERE_DTYPE
        Not used yet, in the order of their arrival.
    products : Products
        Known at all these epochs.
    broadcast : Broadcast
        Each message from its log time on.
    epochs, rows : arrays of EPOCH_DTYPE and MEASURED_DTYPE
        `seen` becomes 1 where everything is known.
    terms : array of TERMS_DTYPE
        One for each of `rows`, NaN throughout; filled with what is known.
    notes : array of NOTE_DTYPE
    counts : int64 array (2,)
        Notes written; notes for which there was no room.

    Returns
    -------
    int
        How many of the models were taken; the others are later than the epochs.
    """
    taken = 0
    s, p, cfg, own, work = state[0], precise[0], config[0], settings[0], scratch[0]
    u, place = np.zeros(3), np.zeros(PLACE)
    sat_state, points = np.zeros(8), np.zeros(WORK_SHAPE)
    sent = np.zeros((SATELLITES, 6))
    observed, weight = np.zeros(SATELLITES), np.zeros(SATELLITES)
    for e in range(epochs.shape[0]):
        epoch = epochs[e]
        t, log_t = epoch["t"], epoch["log_t"]
        taken = learn_ionosphere(s, models, taken, log_t)
        first, end = epoch["first"], epoch["first"] + epoch["count"]
        part, more = rows[first:end], terms[first:end]
        _locate_all(
            part, s, p, products, broadcast, more, cfg, own, t, log_t, notes, counts, sat_state,
            points,
        )  # fmt: skip
        epoch["placed"] = 0
        status = coarse_position(part, s, cfg, t, observed, weight, work, u)
        fresh = status > 0
        if fresh:
            s["t"] = t
        elif s["t"] < 0 or not (t - s["t"]) * 1e-9 <= cfg["coast"]:
            s["t"] = -1
            for i in range(SYSTEMS):
                s["clock"][i] = 0.0
            kind = EVENT_TOO_FEW if status == -1 else EVENT_NOT_CONVERGED
            note(notes, counts, t, log_t, kind, -1, float(part.shape[0]))
            for k in range(part.shape[0]):
                part[k]["seen"] = 0
            continue
        for k in range(part.shape[0]):
            for i in range(3):
                sent[k, i] = part[k]["position"][i]
                sent[k, 3 + i] = part[k]["velocity"][i]
        axes = work["axes"]
        whole = view_precise(part, sent, s, p, products, cfg, own, t, place, axes, u)
        place_epoch(epoch, part, s, cfg, observed, weight, work, u, fresh)
        if fresh:
            # Tens of metres, without an atmosphere, are centimetres of troposphere.
            smooth_height(p, s["x"], t)
            whole = view_precise(part, sent, s, p, products, cfg, own, t, place, axes, u)
        if not whole and p["no_map"] == 0:
            note(notes, counts, t, log_t, NO_SATELLITE + KIND * NO_MAP, -1, 0.0)
        p["no_map"] = 0 if whole else 1
        _add_terms(part, s, p, products, own, t, more, axes, u)
    return taken
