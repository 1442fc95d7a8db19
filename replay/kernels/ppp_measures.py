"""One receiver's codes, phases and Doppler as measurements of a filter, uncombined.

Kan et al. (2022), eq. 5, of slot j of a satellite of system S, modelled terms taken off:

    P_j = rho + c dt + T_S + m dZ + m_g (G_N cos A + G_E sin A) + g_j I + B_(S,j)
    L_j = rho + c dt + T_S + m dZ + m_g (G_N cos A + G_E sin A) - g_j I + N_j

with g_j = (f_L1 / f_j)^2: slant delays are those on the frequency of GPS L1 for all
systems alike, less what a model has taken off, and ambiguities are in metres.
"""

from typing import Final

from numba import njit

from replay.kernels.elementary import sin, sincos
from replay.kernels.gnss_records import SLOTS
from replay.kernels.least_squares import geometric_range, reduced_code, reduced_phase
from replay.kernels.ppp_records import (
    CODE,
    DOPPLER,
    IONOSPHERE,
    IONOSPHERE_COMBINATION,
    IONOSPHERE_CONSTRAINED,
    PHASE,
    VELOCITY,
    VIEWS,
)
from replay.kernels.ppp_states import SECOND, excess_variance, ionosphere_factor
from replay.kernels.single_solve import predicted_range_rate
from replay.kernels.types import Array, Record
from replay.kernels.weighting import noise_factor

# Parts of a delay by which it falls with a metre of height: the hydrostatic one with
# pressure (5.2 * 2.26e-5), the wet one with the vapour of the standard atmosphere.
_HYDROSTATIC_FALL: Final = 1.18e-4
_WET_FALL: Final = 4.4e-4
# Chen and Herring (1997).
_GRADIENT_OFFSET: Final = 0.0032


@njit(cache=True)
def view_rows(
    rows: Array, cfg: Record, x: Array, coarse: Array, up: Array, views: Array, u: Array
) -> int:
    """Satellites that can be used, and what is computed of each.

    Parameters
    ----------
    rows : array of MEASURED_DTYPE
    cfg : record of PPP_CONFIG_DTYPE
    x, coarse : float64 arrays (3,), m, ECEF
        The antenna, and where its delays were computed.
    up : float64 array (3,)
        Of the horizon, ECEF.
    views : array of VIEW_DTYPE
        Filled.
    u : float64 array (3,)
        Scratch.

    Returns
    -------
    int
        How many; at most VIEWS.
    """
    count = 0
    higher = 0.0
    for c in range(3):
        higher += up[c] * (x[c] - coarse[c])
    for k in range(rows.shape[0]):
        row = rows[k]
        if row["seen"] == 0 or cfg["excluded"][row["satellite"]] == 1 or count == VIEWS:
            continue
        if not row["elevation"] >= cfg["mask"]:
            continue
        view = views[count]
        view["rover"] = k
        view["satellite"] = row["satellite"]
        view["system"] = row["system"]
        view["elevation"] = row["elevation"]
        fall = _HYDROSTATIC_FALL * row["hydrostatic"] + _WET_FALL * row["wet"]
        view["computed"] = geometric_range(row, x, u) - fall * higher
        for c in range(3):
            view["u"][c] = -u[c] - fall * up[c]
        known = False
        for slot in range(cfg["slots"]):
            there = row["code"][slot] == row["code"][slot] or (
                row["phase"][slot] == row["phase"][slot]
            )
            known = known or (there and _told(row, slot))
        if known:
            count += 1
    return count


@njit(cache=True)
def _told(row: Record, slot: int) -> bool:
    """Whether corrections of a signal are known."""
    return bool(row["group_delay"][slot] == row["group_delay"][slot])


@njit(cache=True)
def _variance(row: Record, slot: int, sigma: float, scale: float, cfg: Record) -> float:
    """Variance (m^2) of a measurement itself."""
    sigma *= scale * cfg["satellite_scale"][row["satellite"]]
    return sigma * sigma * noise_factor(cfg["weighting"], row["elevation"], row["cn0"][slot])


@njit(cache=True)
def _name(m: Record, state: int, h: float, x: Array) -> None:
    """Let a measurement depend on one more state, what is predicted of it taken off."""
    m["index"][m["count"]] = state
    m["h"][m["count"]] = h
    m["count"] += 1
    m["z"] -= h * x[state]


@njit(cache=True)
def _open(m: Record, kind: int, v: int, slot: int, satellite: int, z: float, r: float) -> None:
    m["kind"] = kind
    m["pair"] = v
    m["slot"] = slot
    m["satellite"] = satellite
    m["z"] = z
    m["r"] = r
    m["count"] = 0
    m["use"] = 1


@njit(cache=True)
def _shared(m: Record, view: Record, row: Record, slopes: Array, s: Record, x: Array) -> None:
    """What codes and phases depend on alike: position, clocks, troposphere."""
    for c in range(3):
        m["index"][c] = c
        m["h"][c] = view["u"][c]
    m["count"] = 3
    m["z"] -= view["computed"]
    _name(m, s["clock"], 1.0, x)
    between = s["between"][view["system"]]
    if view["system"] != s["reference"] and between >= 0:
        _name(m, between, 1.0, x)
    _name(m, s["wet"], row["wet_mapping"], x)
    if s["gradient"] >= 0:
        _name(m, s["gradient"], slopes[0], x)
        _name(m, s["gradient"] + 1, slopes[1], x)


@njit(cache=True)
def _slopes(row: Record, slopes: Array) -> None:
    """Mapping of the gradients north and east."""
    sine, cosine = sincos(row["elevation"])
    mapping = 1.0 / (sine * sine / cosine + _GRADIENT_OFFSET)
    east, north = sincos(row["azimuth"])
    slopes[0] = mapping * north
    slopes[1] = mapping * east


@njit(cache=True)
def build_measures(
    rows: Array, views: Array, count: int, s: Record, cfg: Record, x: Array, dt: float,
    measures: Array, slopes: Array,
) -> int:  # fmt: skip
    """All measurements of an epoch but Doppler: of the ionosphere, then codes, then phases.

    Parameters
    ----------
    rows : array of MEASURED_DTYPE
    views : array of VIEW_DTYPE
    count : int
        Views.
    s, cfg : records of PPP_STATE_DTYPE, PPP_CONFIG_DTYPE
    x : float64 array
        Predicted states; the views are about its position.
    dt : float, s
        Since the epoch before.
    measures : array of PPP_MEASURE_DTYPE
        Filled.
    slopes : float64 array (2,)
        Scratch.

    Returns
    -------
    int
        Measurements.
    """
    total = 0
    if cfg["ionosphere"] == IONOSPHERE_CONSTRAINED:
        # An error of the model that lasts is not a new measurement at every epoch.
        repeat = max(1.0, cfg["constraint_time"] / dt) if dt > 0.0 else 1.0
        for v in range(count):
            sigma = cfg["constraint_sigma"] / max(0.2, sin(views[v]["elevation"]))
            sat = views[v]["satellite"]
            m = measures[total]
            total += 1
            _open(m, IONOSPHERE, v, 0, sat, 0.0, sigma * sigma * repeat)
            _name(m, s["slant"][sat], 1.0, x)
    combined = cfg["ionosphere"] == IONOSPHERE_COMBINATION
    for kind in range(2):
        for v in range(count):
            view = views[v]
            row = rows[view["rover"]]
            _slopes(row, slopes)
            if combined:
                total += _combined(kind, v, view, row, slopes, s, cfg, x, measures[total])
                continue
            for slot in range(cfg["slots"]):
                total += _single(kind, v, slot, view, row, slopes, s, cfg, x, measures[total])
    return total


@njit(cache=True)
def _single(
    kind: int, v: int, slot: int, view: Record, row: Record, slopes: Array, s: Record,
    cfg: Record, x: Array, m: Record,
) -> int:  # fmt: skip
    """One code or phase; how many measurements that is."""
    sat, system = view["satellite"], view["system"]
    value = reduced_code(row, slot) if kind == CODE else reduced_phase(row, slot)
    ambiguity = s["amb"][sat, slot]
    if value != value or not _told(row, slot) or (kind == PHASE and ambiguity < 0):
        return 0
    if row["cn0"][slot] < cfg["cn0_mask"]:
        return 0
    if kind == CODE:
        r = _variance(row, slot, cfg["code_sigma"][slot], cfg["code_scale"][system], cfg)
        r += excess_variance(row, cfg)
    else:
        r = _variance(row, slot, cfg["phase_sigma"][slot], cfg["phase_scale"][system], cfg)
    _open(m, kind, v, slot, sat, value, r)
    _shared(m, view, row, slopes, s, x)
    if kind == CODE and s["bias"][system, slot] >= 0:
        _name(m, s["bias"][system, slot], 1.0, x)
    factor = ionosphere_factor(row["frequency"][slot])
    _name(m, s["slant"][sat], factor if kind == CODE else -factor, x)
    if kind == PHASE:
        _name(m, ambiguity, 1.0, x)
    return 1


@njit(cache=True)
def _combined(
    kind: int, v: int, view: Record, row: Record, slopes: Array, s: Record, cfg: Record,
    x: Array, m: Record,
) -> int:  # fmt: skip
    """The ionosphere-free pair of two codes or phases; how many measurements that is."""
    sat, system = view["satellite"], view["system"]
    if kind == CODE:
        p0, p1 = reduced_code(row, 0), reduced_code(row, SECOND)
        s0, s1 = cfg["code_sigma"][0], cfg["code_sigma"][SECOND]
        scale = cfg["code_scale"][system]
    else:
        p0, p1 = reduced_phase(row, 0), reduced_phase(row, SECOND)
        s0, s1 = cfg["phase_sigma"][0], cfg["phase_sigma"][SECOND]
        scale = cfg["phase_scale"][system]
    ambiguity = s["amb"][sat, 0]
    if p0 != p0 or p1 != p1 or (kind == PHASE and ambiguity < 0):
        return 0
    if not _told(row, 0) or not _told(row, SECOND):
        return 0
    if row["cn0"][0] < cfg["cn0_mask"] or row["cn0"][SECOND] < cfg["cn0_mask"]:
        return 0
    g0, g1 = ionosphere_factor(row["frequency"][0]), ionosphere_factor(row["frequency"][SECOND])
    a, b = g1 / (g1 - g0), -g0 / (g1 - g0)
    r = a * a * _variance(row, 0, s0, scale, cfg) + b * b * _variance(row, SECOND, s1, scale, cfg)
    if kind == CODE:
        r += excess_variance(row, cfg)
    _open(m, kind, v, 0, sat, a * p0 + b * p1, r)
    _shared(m, view, row, slopes, s, x)
    if kind == PHASE:
        _name(m, ambiguity, 1.0, x)
    return 1


@njit(cache=True)
def add_doppler(
    rows: Array, views: Array, count: int, s: Record, cfg: Record, x: Array, measures: Array,
    total: int, u: Array,
) -> int:  # fmt: skip
    """Range rates as measurements of velocity and drift, after those of an epoch.

    Parameters
    ----------
    rows, views, count, s, cfg, x, measures
        As in :func:`build_measures`; velocity are the states 3 to 5 of `x`.
    total : int
        Measurements so far.
    u : float64 array (3,)
        Scratch.

    Returns
    -------
    int
        Measurements.
    """
    if cfg["dynamics"] != VELOCITY or s["drift"] < 0:
        return total
    for v in range(count):
        row = rows[views[v]["rover"]]
        for slot in range(SLOTS):
            rate = row["range_rate"][slot]
            if rate != rate or row["cn0"][slot] < cfg["cn0_mask"]:
                continue
            sigma = cfg["doppler_sigma"]
            r = sigma * sigma * noise_factor(cfg["weighting"], row["elevation"], row["cn0"][slot])
            m = measures[total]
            total += 1
            z = rate + row["drift"] - predicted_range_rate(row, x[:3], x[3:6], u)
            _open(m, DOPPLER, v, slot, views[v]["satellite"], z, r)
            for c in range(3):
                m["index"][c] = 3 + c
                m["h"][c] = -u[c]
            m["count"] = 3
            _name(m, s["drift"], 1.0, x)
            # One of them says it all: the receiver's loops share what they hear.
            break
    return total
