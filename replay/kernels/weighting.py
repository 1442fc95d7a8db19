"""How much a range of a satellite is believed: variances by elevation and strength."""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import pow, sin
from replay.kernels.types import Record

ROBUST_NONE: Final = 0
ROBUST_HUBER: Final = 1
ROBUST_IGG3: Final = 2

EQUAL: Final = 0
SINE: Final = 1
THRESHOLD: Final = 2
DOUBLE_ANGLE: Final = 3
STRENGTH: Final = 4
SUM: Final = 5

WEIGHT_DTYPE: Final = np.dtype(
    [
        ("model", "<i8"),
        ("range_scale", "<f8"),  # on the deviation that the system states
        ("ionosphere", "<f8"),  # deviation as a part of the modelled delay
        ("troposphere", "<f8"),  # m, deviation in the zenith
    ],
    align=True,
)

_HALF: Final = 0.5


@njit(cache=True)
def noise_factor(model: int, elevation: float, cn0: float) -> float:
    """Variance over that of a satellite in the zenith.

    Parameters
    ----------
    model : int
        EQUAL; SINE: 1 / sin(E)^2; THRESHOLD: 1 from 30 degrees on, below 1 / (2 sin E)^2,
        which is continuous; DOUBLE_ANGLE: below 30 degrees 1 / sin(2E)^2, as Tang et al.
        (2021) eq. 5 is printed, which jumps by a third at 30 degrees; STRENGTH: by C/N0 over
        45 dB-Hz; SUM: (1 + 1 / sin(E)^2) / 2.
    elevation : float, rad
        Above zero.
    cn0 : float, dB-Hz
        NaN is taken as 40.
    """
    s = sin(elevation)
    if model == SINE:
        return 1.0 / (s * s)
    if model == THRESHOLD:
        return 1.0 if s >= _HALF else 1.0 / (4.0 * s * s)
    if model == DOUBLE_ANGLE:
        if s >= _HALF:
            return 1.0
        d = sin(2.0 * elevation)
        return 1.0 / (d * d)
    if model == STRENGTH:
        strength = cn0 if cn0 == cn0 else 40.0
        return pow(10.0, 0.1 * (45.0 - strength))
    if model == SUM:
        return 0.5 * (1.0 + 1.0 / (s * s))
    return 1.0


@njit(cache=True)
def code_variance(row: Record, slot: int, sigma: float, w: Record) -> float:
    """Variance (m^2) of a corrected pseudorange: noise, orbit and clock, atmosphere."""
    value = sigma * sigma * noise_factor(w["model"], row["elevation"], row["cn0"][slot])
    orbit = w["range_scale"] * row["range_std"]
    ionosphere = w["ionosphere"] * row["ionosphere"][slot]
    troposphere = w["troposphere"] / (sin(row["elevation"]) + 0.1)
    return value + orbit * orbit + ionosphere * ionosphere + troposphere * troposphere
