"""The Earth below a scenario: how it turns, and how tides move its ground."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from replay import time
from replay.kernels.ground_motion import ground_motion
from replay.kernels.tides import secular_pole
from replay.log.columns import Columns
from replay.simulate.noise import Floats

Ints = npt.NDArray[np.int64]

_ARCSEC: Final = np.pi / 648_000.0
_DAY_NS: Final = 86_400 * time.NS_PER_S
_UT1_UTC_S: Final = 0.0


def ut1_minus_gps_s(start_ns: int) -> float:
    """UT1 less GPS time: that of UTC, whose difference from UT1 is nought here."""
    return _UT1_UTC_S - time.leap_seconds(start_ns)


def pole_of(start_ns: int, offset_rad: tuple[float, ...]) -> Floats:
    """Pole (2,), rad of a scenario: the secular pole of its start and an offset."""
    xs, ys = secular_pole(start_ns)
    return np.array([xs * _ARCSEC + offset_rad[0], ys * _ARCSEC + offset_rad[1]])


def rotation_columns(start_ns: int, end_ns: int, offset_rad: tuple[float, ...]) -> Columns:
    """Rows of `replay.EarthRotation`, at midnights around a span, known from its start on."""
    first, last = start_ns // _DAY_NS - 1, end_ns // _DAY_NS + 2
    times = np.arange(first, last + 1, dtype=np.int64) * _DAY_NS
    pole = pole_of(start_ns, offset_rad)
    nothing = np.zeros(len(times))
    return Columns.build(
        times,
        {
            "polar_x_rad": np.full(len(times), pole[0]),
            "polar_y_rad": np.full(len(times), pole[1]),
            "ut1_utc_s": np.full(len(times), _UT1_UTC_S),
            "length_of_day_s": nothing,
            "polar_x_rate_rad_s": nothing.copy(),
            "polar_y_rate_rad_s": nothing.copy(),
        },
        log_time_ns=np.full(len(times), start_ns),
    )


def displace(
    positions: Floats, times_ns: Ints, start_ns: int, offset_rad: tuple[float, ...]
) -> tuple[Floats, Floats, Floats]:
    """What tides do to places of the crust.

    Parameters
    ----------
    positions : float64 array (e, 3), m, ECEF
    times_ns : int64 array (e,), GPS
    start_ns : int, ns
        Of the scenario.
    offset_rad : tuple of two float, rad
        Pole less the secular pole.

    Returns
    -------
    solid, polar : float64 arrays (e, 3), m, ECEF
        Of the solid Earth tide and of the pole tide.
    rates : float64 array (e, 3), m/s, ECEF
        Of both.
    """
    solid, polar, rates = (np.zeros_like(positions) for _ in range(3))
    pole = pole_of(start_ns, offset_rad)
    ground_motion(positions, times_ns, ut1_minus_gps_s(start_ns), pole, solid, polar, rates)
    return solid, polar, rates
