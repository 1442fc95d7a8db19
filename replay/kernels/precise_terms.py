"""Terms of precise positioning: tides, the satellite's antenna, wind-up, biases, ionosphere.

Every term is what it adds to the range that is measured. Tides move the antenna by a
displacement d: the range grows by -u d, with u the direction from the antenna to the satellite.
"""

from typing import Final

import numpy as np
from numba import njit

from replay.kernels.elementary import atan2, sqrt
from replay.kernels.gnss_records import SLOTS
from replay.kernels.higher_ionosphere import field_along_ray, second_order
from replay.kernels.ionosphere_maps import slant_tec, tecu_delay
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.precise_records import Products
from replay.kernels.product_series import earth_rotation, signal_bias
from replay.kernels.satellite_antenna import satellite_antenna_range
from replay.kernels.satellite_attitude import NOMINAL
from replay.kernels.sun_moon import sun_moon_ecef
from replay.kernels.tides import (
    OCEAN_TIDES,
    ocean_arguments,
    ocean_loading,
    pole_tide,
    secular_pole,
    solid_tide_of,
)
from replay.kernels.types import Array, Record
from replay.kernels.wind_up import wind_up

# Rows of the array of bodies and displacements of an epoch.
SUN: Final = 0
MOON: Final = 1
SOLID: Final = 2
POLE: Final = 3
OCEAN: Final = 4
EPOCH_SHAPE: Final = (5, 3)

_NAN: Final = float("nan")
_ARCSEC: Final = 206264.80624709636  # of a radian
_ROTATION_BEYOND_S: Final = 129_600.0  # a file of one day has one epoch, at its noon
_TECU: Final = 1e16
_CODE: Final = 67  # C
_PHASE: Final = 76  # L
# After longer a satellite may have turned by half a turn: at noon they do so in a quarter hour.
_WIND_UP_GAP_NS: Final = 900_000_000_000


@njit(cache=True)
def universal_time(products: Products, t: int, pole: Array) -> tuple[float, bool]:
    """UT1 less GPS time (s), and whether the pole is known; UTC serves where it is not.

    `pole` (4,) is that of :func:`replay.kernels.product_series.earth_rotation`.
    """
    leap = 0
    for k in range(products.leaps.shape[0]):
        if products.leaps[k]["t"] <= t:
            leap = products.leaps[k]["seconds"]
    if earth_rotation(products.rotation, t, _ROTATION_BEYOND_S, pole):
        return pole[2] - leap, True
    return -float(leap), False


@njit(cache=True)
def prepare_epoch(
    cfg: Record, products: Products, t: int, x: Array, axes: Array, epoch: Array
) -> None:
    """Sun and Moon of an epoch, and how the tides move the antenna.

    Parameters
    ----------
    cfg : record of PRECISE_SIGHTS_CONFIG_DTYPE
    products : Products
    t : int, ns
    x : float64 array (3,), m, ECEF
    axes : float64 array (3, 3)
        Rows east, north, up in ECEF.
    epoch : float64 array EPOCH_SHAPE
        Filled: Sun, Moon, displacements, m, ECEF; NaN for what is not known or not wanted.
    """
    pole = np.zeros(4)
    ut1, pole_known = universal_time(products, t, pole)
    sun_moon_ecef(t, ut1, epoch[SUN], epoch[MOON])
    for k in range(SOLID, OCEAN + 1):
        for i in range(3):
            epoch[k, i] = _NAN
    if cfg["solid_tide"] == 1:
        solid_tide_of(x, t, ut1, epoch[SUN], epoch[MOON], epoch[SOLID])
    if cfg["pole_tide"] == 1 and pole_known:
        xs, ys = secular_pole(t)
        pole_tide(x, pole[0] * _ARCSEC - xs, ys - pole[1] * _ARCSEC, epoch[POLE])
    if cfg["ocean_loading"] == 1 and products.amplitudes.shape[0] == 3:
        arguments = np.zeros(OCEAN_TIDES)
        ocean_arguments(t, ut1, arguments)
        east, north, up = ocean_loading(arguments, products.amplitudes, products.phases)
        for i in range(3):
            epoch[OCEAN, i] = east * axes[0, i] + north * axes[1, i] + up * axes[2, i]


@njit(cache=True)
def add_tides(epoch: Array, u: Array, out: Record) -> None:
    """Tides of a satellite's range into a record of TERMS_DTYPE; `u` (3,) to the satellite."""
    d = epoch[SOLID]
    out["solid_tide"] = -(u[0] * d[0] + u[1] * d[1] + u[2] * d[2])
    d = epoch[POLE]
    out["pole_tide"] = -(u[0] * d[0] + u[1] * d[1] + u[2] * d[2])
    d = epoch[OCEAN]
    out["ocean_loading"] = -(u[0] * d[0] + u[1] * d[1] + u[2] * d[2])


@njit(cache=True)
def choose_satellite_pattern(
    patterns: Array, first: int, end: int, band: int, frequency: float, t: int
) -> int:
    """Number of the pattern of a satellite's antenna for a signal, or minus one.

    Where the antenna was not calibrated on the signal's band, the nearest frequency of the same
    satellite serves: files of the IGS give most GPS satellites L1 and L2 alone, and L2's serves
    for L5.

    Parameters
    ----------
    patterns : array of PATTERN_DTYPE
        Those of the satellite stand from `first` to `end`.
    band : int
        RINEX; minus one for any.
    frequency : float, Hz
    t : int, ns
    """
    best = -1
    nearest = 0.0
    for k in range(first, end):
        pattern = patterns[k]
        if pattern["valid_from"] != 0 and t < pattern["valid_from"]:
            continue
        if pattern["valid_until"] != 0 and t > pattern["valid_until"]:
            continue
        if pattern["band"] == band:
            return k
        distance = abs(pattern["frequency"] - frequency)
        if best < 0 or distance < nearest:
            best = k
            nearest = distance
    return best


@njit(cache=True)
def attitude_of(cfg: Record, products: Products, satellite: int, t: int) -> int:
    """Attitude model of a satellite, by the block that its antenna's calibration names."""
    if cfg["nominal"] == 1:
        return NOMINAL
    first, end = products.pattern_starts[satellite], products.pattern_starts[satellite + 1]
    k = choose_satellite_pattern(products.patterns, first, end, -1, 0.0, t)
    return int(products.attitudes[k]) if k >= 0 else NOMINAL


@njit(cache=True)
def add_satellite_antenna(
    products: Products, row: Record, t: int, axes: Array, u: Array, out: Record
) -> None:
    """What the satellite's antenna adds to each signal; `u` (3,) points to the satellite."""
    satellite = row["satellite"]
    first, end = products.pattern_starts[satellite], products.pattern_starts[satellite + 1]
    for slot in range(SLOTS):
        if row["signal"][slot] == 0:
            continue
        band = row["signal"][slot] % 256 - 48
        k = choose_satellite_pattern(products.patterns, first, end, band, row["frequency"][slot], t)
        if k >= 0:
            offset, variation = satellite_antenna_range(
                products.patterns[k], products.values, axes, -u[0], -u[1], -u[2], False
            )
            out["satellite_antenna"][slot] = offset + variation


@njit(cache=True)
def add_wind_up(
    s: Record, row: Record, t: int, axes: Array, receiver: Array, u: Array, out: Record
) -> None:
    """Wind-up of each signal's phase.

    Parameters
    ----------
    s : record of PRECISE_SIGHTS_STATE_DTYPE
        After a gap of a quarter of an hour the whole cycles begin anew.
    row : record of MEASURED_DTYPE
    t : int, ns
    axes, receiver : float64 arrays (3, 3)
        Of the satellite and of the receiver's antenna, rows in ECEF.
    u : float64 array (3,)
        To the satellite.
    out : record of TERMS_DTYPE
    """
    satellite = row["satellite"]
    if abs(t - s["wind_up_t"][satellite]) > _WIND_UP_GAP_NS:
        s["wind_up"][satellite] = _NAN
    s["wind_up_t"][satellite] = t
    cycles = wind_up(axes, receiver, -u[0], -u[1], -u[2], s["wind_up"], satellite)
    for slot in range(SLOTS):
        if row["signal"][slot] != 0:
            out["wind_up"][slot] = cycles * (SPEED_OF_LIGHT_M_S / row["frequency"][slot])


@njit(cache=True)
def add_biases(products: Products, row: Record, t: int, out: Record) -> int:
    """Biases of codes into `row`, those of phases into `out`.

    Returns
    -------
    int
        Bits of the slots whose code has none, though the products have biases.
    """
    first = products.bias_starts[row["satellite"]]
    end = products.bias_starts[row["satellite"] + 1]
    lacking = 0
    for slot in range(SLOTS):
        signal = row["signal"][slot]
        if signal == 0:
            continue
        row["group_delay"][slot] = 0.0
        code = signal_bias(products.biases, first, end, _CODE + 256 * signal, 0, t)
        if code == code:
            row["group_delay"][slot] = code * SPEED_OF_LIGHT_M_S
        elif products.biases.shape[0] > 0:
            lacking |= 1 << slot
        phase = signal_bias(products.biases, first, end, _PHASE + 256 * signal, 0, t)
        if phase == phase:
            out["phase_bias"][slot] = phase * SPEED_OF_LIGHT_M_S
    return lacking


@njit(cache=True)
def map_content(products: Products, row: Record, x: Array, t: int, layer: int) -> float:
    """Electron content (TECU) of a satellite's ray by the maps; NaN where there is none."""
    latitude = atan2(x[2], sqrt(x[0] * x[0] + x[1] * x[1]))
    longitude = atan2(x[1], x[0])
    content, _ = slant_tec(
        products.maps, products.tec, products.rms, t, latitude, longitude, row["azimuth"],
        row["elevation"], layer,
    )  # fmt: skip
    return content


@njit(cache=True)
def add_map(products: Products, row: Record, x: Array, t: int, layer: int) -> bool:
    """Delays of the ionosphere by the maps into `row`; False where they have none."""
    content = map_content(products, row, x, t, layer)
    if content != content:
        return False
    for slot in range(SLOTS):
        if row["signal"][slot] != 0:
            row["ionosphere"][slot] = content * tecu_delay(row["frequency"][slot])
    return True


@njit(cache=True)
def add_higher_ionosphere(
    products: Products, row: Record, x: Array, t: int, layer: int, u: Array, out: Record
) -> None:
    """Second order of the ionosphere: electrons by the maps, else by what is modelled."""
    content = map_content(products, row, x, t, layer) if products.maps.shape[0] > 0 else _NAN
    if content != content:
        for slot in range(SLOTS - 1, -1, -1):
            if row["signal"][slot] != 0 and row["ionosphere"][slot] > 0.0:
                content = row["ionosphere"][slot] / tecu_delay(row["frequency"][slot])
    if content != content:
        return
    field = field_along_ray(x, u[0], u[1], u[2])
    for slot in range(SLOTS):
        if row["signal"][slot] != 0:
            out["higher_ionosphere"][slot] = second_order(
                content * _TECU, field, row["frequency"][slot]
            )
