"""Satellite position, velocity and clock from a broadcast ephemeris.

Keplerian messages: IS-GPS-200N tables 20-IV and 20-V (GPS), IS-QZSS-PNT (the same
algorithm), Galileo OS SIS ICD 2.1 table 61, BDS-SIS-ICD B1I 3.0 section 5.2.4.12
(with the rotation of geostationary satellites). GLONASS is in
:mod:`replay.kernels.glonass`. Velocities are the derivatives of the same formulas.

A time is `time_ns`, GPS nanoseconds, plus `offset_s`, a small number of seconds: the
time since a message's reference is then good to 1e-12 s, which is nanometres of orbit.
Frame is ECEF at that time.

An array `state` has eight elements: position (3, m), velocity (3, m/s), clock offset
(s, satellite minus system time, with the relativistic term) and clock drift (s/s).
"""

import math

from numba import njit

from replay.kernels import glonass
from replay.kernels.earth import EARTH_RATE_RAD_S
from replay.kernels.elementary import atan2, sincos, sqrt
from replay.kernels.ephemeris import (
    SYSTEM_BEIDOU,
    SYSTEM_GALILEO,
    SYSTEM_GLONASS,
    SYSTEM_GPS,
    SYSTEM_QZSS,
)
from replay.kernels.types import Array, Record

SPEED_OF_LIGHT_M_S = 299792458.0

MU_GPS_M3_S2 = 3.986005e14  # IS-GPS-200N, table 20-IV; IS-QZSS-PNT the same
MU_M3_S2 = 3.986004418e14  # Galileo OS SIS ICD 2.1, table 61; BDS-SIS-ICD B1I 3.0, 5.2.4.12
OMEGA_E_RAD_S = 7.2921151467e-5  # IS-GPS-200N, table 20-IV; Galileo and QZSS the same
OMEGA_E_BEIDOU_RAD_S = 7.2921150e-5  # BDS-SIS-ICD B1I 3.0, 5.2.4.12

# Ratios of squared carrier frequencies, E1 or L1 over the other, from multiples of 10.23 MHz.
_GAMMA_L2 = (77.0 * 77.0) / (60.0 * 60.0)  # IS-GPS-200N, 20.3.3.3.3.2
_GAMMA_E5A = (154.0 * 154.0) / (115.0 * 115.0)
_GAMMA_E5B = (154.0 * 154.0) / (118.0 * 118.0)

# B2I, which TGD2 is for, is sent by BeiDou-2 alone; BeiDou-3 has B2b in the same band.
_LAST_BEIDOU_2 = 18

_SIN_5_DEG = 0.08715574274765817
_COS_5_DEG = 0.9961946980917455
_TWO_PI = 6.283185307179586
_NEWTON_ROUNDS = 8
_LIGHT_TIME_ROUNDS = 3
_TYPICAL_TRAVEL_S = 0.075
_NAN = math.nan


@njit(cache=True)
def eccentric_anomaly(M: float, e: float) -> float:
    """Kepler's equation E - e sin E = M by always eight Newton rounds from M + e sin M.

    Parameters
    ----------
    M : float, rad
        Mean anomaly, any.
    e : float
        Eccentricity; converged to rounding up to 0.7.

    Returns
    -------
    float, rad
        In about [-pi, pi].
    """
    m = M - _TWO_PI * math.floor(M / _TWO_PI + 0.5)
    s, c = sincos(m)
    E = m + e * s
    for _ in range(_NEWTON_ROUNDS):
        s, c = sincos(E)
        E -= (E - e * s - m) / (1.0 - e * c)
    return E


@njit(cache=True)
def elapsed_s(reference_ns: int, time_ns: int, offset_s: float) -> float:
    """Seconds from `reference_ns` to `time_ns` + `offset_s`."""
    return (time_ns - reference_ns) / 1e9 + offset_s


@njit(cache=True)
def is_geostationary(record: Record) -> bool:
    """Whether a BeiDou satellite's message is in the geostationary form: C01 to C05, C59 on.

    The table of ranging codes of BDS-SIS-ICD B1I 3.0 leaves PRN 1 to 5 and 59 to 63 to them.
    """
    return record["system"] == SYSTEM_BEIDOU and (record["prn"] <= 5 or record["prn"] >= 59)


@njit(cache=True)
def orbit_constants(system: int) -> tuple[float, float]:
    """Gravitational constant (m^3/s^2) and the Earth's rate (rad/s) of a system's algorithm."""
    if system == SYSTEM_GALILEO:
        return MU_M3_S2, OMEGA_E_RAD_S
    if system == SYSTEM_BEIDOU:
        return MU_M3_S2, OMEGA_E_BEIDOU_RAD_S
    return MU_GPS_M3_S2, OMEGA_E_RAD_S


@njit(cache=True)
def keplerian(record: Record, tk: float, out: Array) -> None:
    """Position and velocity `tk` seconds after toe from Keplerian elements.

    Parameters
    ----------
    record : Record of `EPHEMERIS_DTYPE`
        Not GLONASS. A record without an orbit (`sqrt_a` zero) is a ZeroDivisionError.
    tk : float, s
    out : array (6 or more,), m and m/s, ECEF at that time
    """
    mu, omega_e = orbit_constants(record["system"])
    e = record["eccentricity"]
    a = record["sqrt_a"] * record["sqrt_a"]
    n = sqrt(mu / (a * a * a)) + record["delta_n"]
    se, ce = sincos(eccentric_anomaly(record["m0"] + n * tk, e))
    root = sqrt(1.0 - e * e)
    d = 1.0 - e * ce
    e_rate = n / d
    phi = atan2(root * se, ce - e) + record["omega"]
    phi_rate = root * e_rate / d
    s2, c2 = sincos(2.0 * phi)
    u = phi + record["cus"] * s2 + record["cuc"] * c2
    r = a * d + record["crs"] * s2 + record["crc"] * c2
    i = record["i0"] + record["i_dot"] * tk + record["cis"] * s2 + record["cic"] * c2
    u_rate = phi_rate * (1.0 + 2.0 * (record["cus"] * c2 - record["cuc"] * s2))
    r_rate = a * e * se * e_rate + 2.0 * phi_rate * (record["crs"] * c2 - record["crc"] * s2)
    i_rate = record["i_dot"] + 2.0 * phi_rate * (record["cis"] * c2 - record["cic"] * s2)
    su, cu = sincos(u)
    px = r * cu
    py = r * su
    px_rate = r_rate * cu - py * u_rate
    py_rate = r_rate * su + px * u_rate
    geostationary = is_geostationary(record)
    node_rate = record["omega_dot"]
    if not geostationary:
        node_rate -= omega_e
    node = record["omega0"] + node_rate * tk - omega_e * record["toe_s"]
    so, co = sincos(node)
    si, ci = sincos(i)
    x = px * co - py * ci * so
    y = px * so + py * ci * co
    z = py * si
    vx = px_rate * co - py_rate * ci * so + py * si * so * i_rate - y * node_rate
    vy = px_rate * so + py_rate * ci * co - py * si * co * i_rate + x * node_rate
    vz = py_rate * si + py * ci * i_rate
    if geostationary:
        # BDS-SIS-ICD B1I 3.0, 5.2.4.12: R_Z(omega_e tk) R_X(-5 deg).
        y, z = y * _COS_5_DEG - z * _SIN_5_DEG, y * _SIN_5_DEG + z * _COS_5_DEG
        vy, vz = vy * _COS_5_DEG - vz * _SIN_5_DEG, vy * _SIN_5_DEG + vz * _COS_5_DEG
        s, c = sincos(omega_e * tk)
        x, y = x * c + y * s, y * c - x * s
        vx, vy = vx * c + vy * s + omega_e * y, vy * c - vx * s - omega_e * x
    out[0] = x
    out[1] = y
    out[2] = z
    out[3] = vx
    out[4] = vy
    out[5] = vz


@njit(cache=True)
def clock_polynomial(record: Record, time_ns: int, offset_s: float) -> tuple[float, float]:
    """Clock offset (s) and drift (s/s) of the broadcast polynomial, without relativity.

    IS-GPS-200N 20.3.3.3.3.1 and its like in the other systems' documents; for GLONASS
    -tau_n + gamma_n (t - tb). The time is system time. It is the clock of the
    ionosphere-free pair that the message is meant for: for one signal subtract
    :func:`group_delay`.
    """
    t = elapsed_s(record["toc_ns"], time_ns, offset_s)
    return (
        record["af0"] + t * (record["af1"] + t * record["af2"]),
        record["af1"] + 2.0 * t * record["af2"],
    )


@njit(cache=True)
def relativistic_clock(record: Record, time_ns: int, offset_s: float) -> tuple[float, float]:
    """Relativistic effect of the eccentricity on the satellite's clock: offset (s), drift (s/s).

    -2 sqrt(mu) / c^2 * e sqrt(A) sin E (IS-GPS-200N 20.3.3.3.3.1 and the other systems'
    documents) and its derivative. Zero for GLONASS, whose clock terms contain it.
    """
    if record["system"] == SYSTEM_GLONASS:
        return 0.0, 0.0
    mu, _ = orbit_constants(record["system"])
    e = record["eccentricity"]
    a = record["sqrt_a"] * record["sqrt_a"]
    n = sqrt(mu / (a * a * a)) + record["delta_n"]
    tk = elapsed_s(record["toe_ns"], time_ns, offset_s)
    se, ce = sincos(eccentric_anomaly(record["m0"] + n * tk, e))
    k = -2.0 * sqrt(mu) * e * record["sqrt_a"] / (SPEED_OF_LIGHT_M_S * SPEED_OF_LIGHT_M_S)
    return k * se, k * ce * n / (1.0 - e * ce)


@njit(cache=True)
def satellite_clock(record: Record, time_ns: int, offset_s: float) -> tuple[float, float]:
    """Polynomial and relativistic term: clock offset (s) and drift (s/s)."""
    offset, drift = clock_polynomial(record, time_ns, offset_s)
    r_offset, r_drift = relativistic_clock(record, time_ns, offset_s)
    return offset + r_offset, drift + r_drift


@njit(cache=True)
def satellite_state(record: Record, time_ns: int, offset_s: float, state: Array) -> None:
    """Position, velocity, clock offset and drift at a time of transmission.

    Parameters
    ----------
    record : Record of `EPHEMERIS_DTYPE`
    time_ns, offset_s : int, ns and float, s
        System time of transmission, as GPS time. Neither age nor health is looked at.
    state : array (8,)
        Filled as the module says; ECEF at the time of transmission.
    """
    tk = elapsed_s(record["toe_ns"], time_ns, offset_s)
    if record["system"] == SYSTEM_GLONASS:
        glonass.integrate(record, tk, state)
    else:
        keplerian(record, tk, state)
    offset, drift = satellite_clock(record, time_ns, offset_s)
    state[6] = offset
    state[7] = drift


@njit(cache=True)
def group_delay(record: Record, band: int) -> float:
    """What to subtract from the satellite's clock offset for a range on one signal.

    GPS and QZSS L1 and L2 (IS-GPS-200N 20.3.3.3.3.2), Galileo E1, E5a and E5b (broadcast
    group delays of OS SIS ICD 2.1, for either clock), BeiDou B1I, B2I and B3I (TGD1 and
    TGD2 of B1I ICD 3.0, clock of B3I), GLONASS G1 (zero).

    Parameters
    ----------
    record : Record of `EPHEMERIS_DTYPE`
        Of Galileo's `source` (as in RINEX), bit 8 says that the clock is that of E1 and
        E5a, otherwise it is taken as that of E1 and E5b; F/NAV alone, without a delay of
        E5b, is bit 1 without bits 0 and 2.
    band : int
        RINEX band, 1 to 9.

    Returns
    -------
    float, s
        NaN where the message does not tell (such as GPS L5, GLONASS G2, BeiDou B1C, B2b).
    """
    system = record["system"]
    first = record["group_delay_1_s"]
    second = record["group_delay_2_s"]
    if system in (SYSTEM_GPS, SYSTEM_QZSS):
        if band == 1:
            return first
        if band == 2:
            return _GAMMA_L2 * first
    elif system == SYSTEM_GALILEO:
        source = record["source"]
        clock = first if source & 256 != 0 else second
        if band == 1:
            return clock
        if band == 5:
            return clock + (_GAMMA_E5A - 1.0) * first
        if band == 7 and not (source & 2 != 0 and source & 5 == 0):
            return clock + (_GAMMA_E5B - 1.0) * second
    elif system == SYSTEM_BEIDOU:
        if band == 2:
            return first
        if band == 7 and record["prn"] <= _LAST_BEIDOU_2:
            return second
        if band == 6:
            return 0.0
    elif system == SYSTEM_GLONASS and band == 1:
        return 0.0
    return _NAN


@njit(cache=True)
def transmission_offset(record: Record, time_ns: int, pseudorange_m: float) -> float:
    """System time of transmission from a pseudorange (IS-GPS-200N 20.3.3.3.3.1).

    Parameters
    ----------
    record : Record of `EPHEMERIS_DTYPE`
    time_ns : int, ns
        Time of reception by the receiver's clock, which need not be right.
    pseudorange_m : float, m
        Measured by the same clock.

    Returns
    -------
    float, s
        To be added to `time_ns`; independent of the receiver's clock error.
    """
    by_satellite = -pseudorange_m / SPEED_OF_LIGHT_M_S
    offset = by_satellite
    for _ in range(2):
        clock, _ = satellite_clock(record, time_ns, offset)
        offset = by_satellite - clock
    return offset


@njit(cache=True)
def rotate_to_reception(travel_s: float, state: Array) -> None:
    """Turn position and velocity in place into ECEF at reception (Sagnac effect).

    Parameters
    ----------
    travel_s : float, s
        The Earth has turned for this long since transmission.
    state : array (6 or more,), m and m/s
    """
    s, c = sincos(EARTH_RATE_RAD_S * travel_s)
    x, y, vx, vy = state[0], state[1], state[3], state[4]
    state[0] = c * x + s * y
    state[1] = c * y - s * x
    state[3] = c * vx + s * vy
    state[4] = c * vy - s * vx


@njit(cache=True)
def state_at_reception(
    record: Record, time_ns: int, offset_s: float, x: float, y: float, z: float, state: Array
) -> float:
    """Satellite at the transmission of what arrives at a place and time, in ECEF at reception.

    Three rounds of the light-time equation from 75 ms; each gains five digits, so that
    the rest is nanometres.

    Parameters
    ----------
    record : Record of `EPHEMERIS_DTYPE`
    time_ns, offset_s : int, ns and float, s
        System time of reception (the receiver's clock error taken off).
    x, y, z : float, m
        Antenna of the receiver, ECEF.
    state : array (8,)
        Filled as the module says, but in ECEF at reception.

    Returns
    -------
    float, s
        Travel time in vacuum; times the speed of light, the geometric range with
        the Sagnac effect.
    """
    travel = _TYPICAL_TRAVEL_S
    for _ in range(_LIGHT_TIME_ROUNDS):
        satellite_state(record, time_ns, offset_s - travel, state)
        rotate_to_reception(travel, state)
        dx = state[0] - x
        dy = state[1] - y
        dz = state[2] - z
        travel = sqrt(dx * dx + dy * dy + dz * dz) / SPEED_OF_LIGHT_M_S
    return travel
