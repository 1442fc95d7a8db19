"""Rows of `/truth/{receiver}/signals`: every term of every measurement, as it was put in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.log.columns import Columns
from replay.simulate.noise import Floats

Records = npt.NDArray[np.void]

_CARRIER: Final = ("carrier_noise_m", "carrier_multipath_m")
_TIDES: Final = ("solid_tide_m", "pole_tide_m")
_PHASE_ONLY: Final = ("wind_up_m", "carrier_delay_m")


def signal_truth(
    names: tuple[str, str],
    times: tuple[Any, Any],
    kept: tuple[Records, Records],
    clock_s: Floats,
    orbit_error_m: Floats,
    settings: Any,
    antenna_m: Floats | None = None,
    extra: Mapping[str, Floats] | None = None,
) -> Columns:
    """Rows of one signal of one satellite.

    Parameters
    ----------
    names : tuple of str
        Satellite and signal.
    times : tuple of two int64 arrays (n,), ns
        Valid and log time.
    kept : tuple of arrays (n,) of SIGHT_DTYPE and MEASUREMENT_DTYPE
        The epochs that were measured.
    clock_s : float64 array (n,), s
        Receiver's clock.
    orbit_error_m : float64 array (n,), m
        NaN where no healthy message is known yet.
    settings : record of SIGNAL_DTYPE
    antenna_m : float64 array (n,), m, or None
        What the antenna adds; None for a receiver without one.
    extra : mapping of field to float64 array (n,), m, optional
        Further terms. Those of tides are taken off the range, which they are in.

    Returns
    -------
    Columns
        Where there is no carrier phase its noise and multipath are NaN and its ambiguity 0.
    """
    sights, measured = kept
    carrier = measured["carrier"] != 0
    count = len(sights)
    values: dict[str, npt.NDArray[Any]] = {
        "satellite": np.full(count, names[0], dtype="S3"),
        "signal": np.full(count, names[1], dtype="S2"),
        "range_m": SPEED_OF_LIGHT_M_S * sights["travel_s"],
        "satellite_clock_m": SPEED_OF_LIGHT_M_S * sights["clock_s"],
        "receiver_clock_m": SPEED_OF_LIGHT_M_S * clock_s,
        "ionosphere_m": float(settings["ionosphere"]) * sights["ionosphere_m"],
        "troposphere_m": sights["neutral_m"] - sights["shapiro_m"],
        "shapiro_m": sights["shapiro_m"].copy(),
        "orbit_error_m": orbit_error_m,
        "code_delay_m": np.full(count, float(settings["code_delay_m"])),
        "code_multipath_m": measured["code_multipath_m"].copy(),
        "code_noise_m": measured["code_noise_m"].copy(),
        "ambiguity_cycles": np.where(carrier, measured["ambiguity"], 0),
    }
    for name in _CARRIER:
        values[name] = np.where(carrier, measured[name], np.nan)
    if antenna_m is not None:
        values["antenna_m"] = antenna_m
    for name, term in (extra or {}).items():
        values[name] = np.where(carrier, term, np.nan) if name in _PHASE_ONLY else term
        if name in _TIDES:
            values["range_m"] = values["range_m"] - term
    return Columns.build(times[0], values, log_time_ns=times[1])
