"""What ionosphere, troposphere and gravity add to the path of a signal, by the settings."""

from typing import Final

from numba import njit

from replay.kernels.atmosphere import (
    BEIDOU_REFERENCE_HZ,
    KLOBUCHAR_REFERENCE_HZ,
    day_of_year,
    klobuchar_b1i,
    klobuchar_l1,
    niell_hydrostatic,
    niell_wet,
    scale_ionosphere,
    zenith_standard,
)
from replay.kernels.elementary import log, sin, sqrt
from replay.kernels.gnss_records import BEIDOU, SLOTS
from replay.kernels.mapping import gmf, gmf_coefficients, modified_julian_date
from replay.kernels.meteorology import gpt, gpt_zenith, mops_zenith
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.types import Array, Record

PLACE: Final = 10
"""Numbers that :func:`prepare_place` keeps of an epoch."""

_EARTH_MU_M3_S2: Final = 3.986004418e14
_DAY_S: Final = 86400
_BEIDOU_LESS_GPS_S: Final = 14
_GPS_BEGINNING_MJD: Final = 44244
_LOWEST_M: Final = -500.0
_HIGHEST_M: Final = 15000.0
_LOWEST_RAD: Final = 0.017453292519943295  # one degree: below it nothing is modelled
_NAN: Final = float("nan")


@njit(cache=True)
def zenith_delays(cfg: Record, place: Array, t: int) -> tuple[float, float]:
    """Zenith hydrostatic and wet delay (m) at a place, by the meteorology that is asked for."""
    latitude, longitude, height = place[0], place[1], place[2]
    if not _LOWEST_M < height < _HIGHEST_M:
        return _NAN, _NAN
    if cfg["meteorology"] == 1:
        return mops_zenith(latitude, height, place[3])
    if cfg["meteorology"] == 2:
        date = _GPS_BEGINNING_MJD + t // (_DAY_S * 1_000_000_000)
        return gpt_zenith(latitude, longitude, height, float(date), cfg["humidity"])
    return zenith_standard(latitude, height, cfg["humidity"])


@njit(cache=True)
def prepare_place(cfg: Record, place: Array, t: int) -> None:
    """What the delays of an epoch have in common.

    Parameters
    ----------
    cfg : record of SIGHTS_CONFIG_DTYPE
    place : float64 array (PLACE,)
        Latitude, longitude (rad) and height (m) are given; filled are the day of the year,
        zenith hydrostatic and wet delay (m; NaN where the height is that of no antenna), and
        with GMF its three coefficients and the height above the geoid (m).
    t : int, ns
    """
    place[3] = day_of_year(t)
    place[4], place[5] = zenith_delays(cfg, place, t)
    if cfg["troposphere"] == 3:
        day = modified_julian_date(t)
        place[6], place[7], place[8] = gmf_coefficients(place[0], place[1], day)
        # Of GPT the undulation of the geoid alone, which does not change with the day.
        _, _, undulation = gpt(place[0], place[1], place[2], day)
        place[9] = place[2] - undulation


@njit(cache=True)
def model_atmosphere(row: Record, x: Array, t: int, s: Record, cfg: Record, place: Array) -> None:
    """Ionosphere, troposphere and relativity of the path.

    `place` (PLACE,) is that of :func:`prepare_place`.
    """
    elevation = row["elevation"]
    if elevation < _LOWEST_RAD:
        return
    latitude, longitude, height = place[0], place[1], place[2]
    if cfg["ionosphere"] != 0:
        second = (t // 1_000_000_000) % _DAY_S + (t % 1_000_000_000) * 1e-9
        if cfg["ionosphere"] == 2 and row["system"] == BEIDOU and s["known"][1] == 1:
            reference = BEIDOU_REFERENCE_HZ
            delay = klobuchar_b1i(
                s["alpha"][1], s["beta"][1], latitude, longitude, elevation, row["azimuth"],
                second - _BEIDOU_LESS_GPS_S,
            )  # fmt: skip
        else:
            reference = KLOBUCHAR_REFERENCE_HZ
            delay = klobuchar_l1(
                s["alpha"][0], s["beta"][0], latitude, longitude, elevation, row["azimuth"], second
            )
        for slot in range(SLOTS):
            if row["signal"][slot] != 0:
                row["ionosphere"][slot] = scale_ionosphere(delay, reference, row["frequency"][slot])
    dry, wet = place[4], place[5]
    if cfg["troposphere"] != 0 and dry == dry:
        if cfg["troposphere"] == 1:
            dry_map = niell_hydrostatic(elevation, latitude, height, place[3])
            wet_map = niell_wet(elevation, latitude)
        elif cfg["troposphere"] == 3:
            dry_map, wet_map = gmf(elevation, place[9], place[6], place[7], place[8])
        else:
            dry_map = 1.0 / sin(elevation)
            wet_map = dry_map
        row["hydrostatic_mapping"] = dry_map
        row["wet_mapping"] = wet_map
        row["hydrostatic"] = dry * dry_map
        row["wet"] = wet * wet_map
    if cfg["shapiro"] == 1:
        position = row["position"]
        a = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
        b = sqrt(position[0] * position[0] + position[1] * position[1] + position[2] * position[2])
        r = row["distance"] + row["sagnac"]
        # Petit and Luzum (2010), IERS Conventions, eq. 11.17.
        factor = 2.0 * _EARTH_MU_M3_S2 / (SPEED_OF_LIGHT_M_S * SPEED_OF_LIGHT_M_S)
        row["shapiro"] = factor * log((a + b + r) / (a + b - r))
