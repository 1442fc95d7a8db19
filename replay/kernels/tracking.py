"""What a simulated receiver makes of one signal: obstruction, lock, noise, slips.

From the true sights of :mod:`replay.kernels.observables` and prepared random numbers.
A carrier phase refers to the clock that the message is for, without group delays and
with whole cycles only, so that double differences of phases are whole numbers but for
geometry, atmosphere and noise; group delays and receiver biases are in the code alone.
Biases of the phase and its wind-up come on top where a scenario wants them.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import exp, sin, sincos
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.types import Array

BLOCKED: Final = 0
DIRECT: Final = 1
REFLECTED: Final = 2

# One signal of one satellite at one receiver.
SIGNAL_DTYPE: Final = np.dtype(
    [
        ("wavelength_m", "<f8"),
        ("ionosphere", "<f8"),  # delay over that on GPS L1
        ("code_delay_m", "<f8"),  # of satellite and receiver, in the code alone
        ("zenith_dbhz", "<f8"),
        ("drop_db", "<f8"),  # from the zenith to the horizon
        ("cn0_sigma_db", "<f8"),
        ("code_threshold_dbhz", "<f8"),
        ("carrier_threshold_dbhz", "<f8"),
        ("code_sigma_m", "<f8"),  # in the zenith, as are the others
        ("carrier_sigma_m", "<f8"),
        ("rate_sigma_m_s", "<f8"),
        ("code_multipath_m", "<f8"),
        ("carrier_multipath_m", "<f8"),
        ("weighted", "<i8"),  # 1: noise grows with 1 / sin(elevation)
        ("reflection_m", "<f8"),  # mean detour of a signal that comes by reflection
        ("reflection_db", "<f8"),  # loss at it
        ("acquisition", "<i8"),  # epochs from sight to the first measurement
        ("slip_probability", "<f8"),  # per epoch
        ("largest_slip", "<i8"),  # cycles
        ("flag_probability", "<f8"),  # that a slip is told
    ],
    align=True,
)

# Columns of the standard normal numbers of `track`.
CODE, CARRIER, RATE, CN0, CODE_MULTIPATH, CARRIER_MULTIPATH = range(6)
# Columns of its uniform numbers.
AMBIGUITY, SLIP, SIZE, FLAG = range(4)

# What a receiver writes of a signal at an epoch.
MEASUREMENT_DTYPE: Final = np.dtype(
    [
        ("code", "<i8"),  # 1 where there is a pseudorange
        ("carrier", "<i8"),  # 1 where there are carrier phase and Doppler
        ("pseudorange_m", "<f8"),
        ("carrier_cycles", "<f8"),
        ("doppler_hz", "<f8"),
        ("cn0_dbhz", "<f8"),
        ("lock_s", "<f8"),
        ("flag", "<i8"),  # of RINEX: 1 is loss of lock
        ("ambiguity", "<i8"),  # cycles, what is in the carrier phase
        ("slip", "<i8"),  # cycles, what was added to it at this epoch within an arc
        ("code_noise_m", "<f8"),  # what is in the pseudorange
        ("code_multipath_m", "<f8"),
        ("carrier_noise_m", "<f8"),  # what is in the carrier phase
        ("carrier_multipath_m", "<f8"),
    ],
    align=True,
)

_LARGEST_AMBIGUITY = 1048576.0
_DECIBEL = 0.11512925464970229  # ln(10) / 20


@njit(cache=True)
def low_pass(pole: float, gain: float, series: Array) -> None:
    """White noise through Butterworth's first-order low-pass, in place (bilinear transform).

    Parameters
    ----------
    pole : float
        Of the filter.
    gain : float
        Of both of its taps; sqrt((1 - pole) / 2) keeps the variance of white noise.
    series : float64 array (n,)
        Standard normal numbers; overwritten. The first value has the stationary variance.
    """
    if series.shape[0] == 0:
        return
    before = series[0]
    value = before
    for n in range(1, series.shape[0]):
        white = series[n]
        value = pole * value + gain * (white + before)
        before = white
        series[n] = value


@njit(cache=True)
def obstruct(
    sights: Array,
    inside: Array,
    headings: Array,
    left: float,
    right: float,
    loss_db: float,
    reflected: float,
    uniforms: Array,
    states: Array,
    losses: Array,
) -> None:
    """Long walls or rows of trees to both sides of a road.

    A wall parallel to the road hides a direction whose upward part is less than the
    tangent of the wall's elevation straight across, times the part across.

    Parameters
    ----------
    sights : array (e,) of SIGHT_DTYPE
    inside : uint8 array (e,)
        Whether the receiver is between them.
    headings : float64 array (e,), rad
        Of the road.
    left, right : float
        Tangents of their elevations straight across.
    loss_db : float
        Of trees, half to one and a half times; nought for walls.
    reflected : float
        Probability that a hidden satellite is received by reflection.
    uniforms : float64 array (e,)
    states : int64 array (e,)
        Overwritten where walls hide.
    losses : float64 array (e,), dB
        Added to where trees hide.
    """
    hidden = False
    by_reflection = False
    for k in range(sights.shape[0]):
        if inside[k] == 0 or sights[k]["seen"] == 0:
            hidden = False
            continue
        up, level = sincos(sights[k]["elevation"])
        across = level * sin(sights[k]["azimuth"] - headings[k])
        limit = right * across if across > 0.0 else -left * across
        if up >= limit:
            hidden = False
            continue
        if loss_db > 0.0:
            losses[k] += loss_db * (0.5 + uniforms[k])
        else:
            if not hidden:
                by_reflection = uniforms[k] < reflected
            if states[k] != BLOCKED:
                states[k] = REFLECTED if by_reflection else BLOCKED
        hidden = True


@njit(cache=True)
def track(
    sights: Array,
    states: Array,
    losses: Array,
    clock: Array,
    antenna: Array,
    carrier_alone: Array,
    signal: Array,
    normals: Array,
    uniforms: Array,
    listed: Array,
    interval_s: float,
    out: Array,
) -> None:
    """Measurements of one signal.

    Parameters
    ----------
    sights : array (e,) of SIGHT_DTYPE
    states : int64 array (e,)
        BLOCKED, DIRECT, REFLECTED. By reflection there is a code, but no carrier.
    losses : float64 array (e,), dB
        Noise grows with them.
    clock : float64 array (e, 2)
        Receiver's bias (s) and drift (s/s).
    antenna : float64 array (e, 2)
        What it adds to code and phase (m), and the rate of that (m/s).
    carrier_alone : float64 array (e, 2)
        Wind-up and biases, which only the phase has (m), and the rate of that (m/s).
    signal : array (1,) of SIGNAL_DTYPE
    normals : float64 array (e, 6)
        The two of multipath are correlated in time, of unit variance.
    uniforms : float64 array (e, 4)
    listed : int64 array (e,), cycles
        Slips that the scenario wants; one where no arc goes on is lost.
    interval_s : float, s
        Between epochs.
    out : array (e,) of MEASUREMENT_DTYPE
        Written.
    """
    s = signal[0]
    c = SPEED_OF_LIGHT_M_S
    waiting = 0
    locked = False
    ever = False
    ambiguity = 0
    begun = 0
    for k in range(sights.shape[0]):
        sight, m, n = sights[k], out[k], normals[k]
        m["code"] = 0
        m["carrier"] = 0
        m["slip"] = 0
        m["flag"] = 0
        strength = 0.0
        by_reflection = states[k] == REFLECTED
        heard = sight["seen"] != 0 and states[k] != BLOCKED
        loss = losses[k]
        weight = 1.0
        if heard:
            sine = sin(sight["elevation"])
            if s["weighted"] != 0:
                weight = 1.0 / sine
            if by_reflection:
                loss += s["reflection_db"]
            strength = (
                s["zenith_dbhz"] - s["drop_db"] * (1.0 - sine) - loss + s["cn0_sigma_db"] * n[CN0]
            )
            heard = strength >= s["code_threshold_dbhz"]
        if not heard:
            locked = False
            waiting = s["acquisition"]
            continue
        if waiting > 0:
            waiting -= 1
            locked = False
            continue
        noisy = weight * exp(_DECIBEL * loss) if loss > 0.0 else weight
        b, b_rate = clock[k, 0], clock[k, 1]
        free = c * (b + sight["travel_s"] - sight["clock_s"]) + sight["neutral_m"]
        free += antenna[k, 0]
        delay = s["ionosphere"] * sight["ionosphere_m"]
        code = free + delay + s["code_delay_m"]
        noise = s["code_sigma_m"] * noisy * n[CODE]
        multipath = s["code_multipath_m"] * weight * n[CODE_MULTIPATH]
        code += noise
        code += multipath
        if by_reflection:
            detour = n[CODE_MULTIPATH]
            detour = s["reflection_m"] * 1.2533141373155001 * (detour if detour > 0.0 else -detour)
            code += detour
            multipath += detour
        m["code"] = 1
        m["code_noise_m"] = noise
        m["code_multipath_m"] = multipath
        m["pseudorange_m"] = code
        m["cn0_dbhz"] = strength
        if by_reflection or strength < s["carrier_threshold_dbhz"]:
            locked = False
            continue
        u = uniforms[k]
        if not locked:
            locked = True
            begun = k
            ambiguity = int(u[AMBIGUITY] * _LARGEST_AMBIGUITY) - int(0.5 * _LARGEST_AMBIGUITY)
            m["flag"] = 1 if ever else 0
            ever = True
        else:
            slip = listed[k]
            if u[SLIP] < s["slip_probability"]:
                # The lower half of the interval is a slip down, the upper one a slip up.
                size = 1 + int(u[SIZE] * s["largest_slip"])
                slip += size if 2.0 * u[SLIP] < s["slip_probability"] else -size
            if slip != 0:
                ambiguity += slip
                m["slip"] = slip
                if u[FLAG] < s["flag_probability"]:
                    m["flag"] = 1
        phase = free - delay
        phase += carrier_alone[k, 0]
        noise = s["carrier_sigma_m"] * noisy * n[CARRIER]
        multipath = s["carrier_multipath_m"] * weight * n[CARRIER_MULTIPATH]
        phase += noise
        phase += multipath
        m["carrier_noise_m"] = noise
        m["carrier_multipath_m"] = multipath
        # Per second of the receiver's own clock, as it counts.
        pace = 1.0 - b_rate
        rate = c * (1.0 - (1.0 + sight["clock_drift"]) * (1.0 - sight["travel_rate"]) * pace)
        rate += pace * (sight["neutral_rate"] - s["ionosphere"] * sight["ionosphere_rate"])
        rate += pace * antenna[k, 1]
        rate += pace * carrier_alone[k, 1]
        rate += s["rate_sigma_m_s"] * noisy * n[RATE]
        m["carrier"] = 1
        m["carrier_cycles"] = phase / s["wavelength_m"] + ambiguity
        m["doppler_hz"] = -rate / s["wavelength_m"]
        m["lock_s"] = (k - begun) * interval_s
        m["ambiguity"] = ambiguity
