"""Biases of satellites' signals against the satellite's clock, as observations hold them."""

from __future__ import annotations

import math
from typing import Any, Final

from replay.kernels.orbits import SPEED_OF_LIGHT_M_S, group_delay
from replay.simulate.constellation import name_of
from replay.simulate.noise import normals
from replay.simulate.product_settings import SatelliteBiases

_HIDDEN_DELAY_M: Final = 1.0  # of signals whose delay no message tells; assumed


def code_bias_s(record: Any, signal: str, settings: SatelliteBiases, seed: int) -> float:
    """What the code of a signal holds more than its satellite's clock says, s.

    Parameters
    ----------
    record : record of EPHEMERIS_DTYPE
        What the satellite broadcasts: its clock is meant, and the group delay is of it.
    signal : str
        As `G1C`.
    settings : SatelliteBiases
    seed : int
    """
    band = int(signal[1])
    told = float(group_delay(record, band))
    if math.isnan(told):
        hidden = float(normals(seed, f"delay.{name_of(record)}.{band}", 1, 1)[0, 0])
        told = _HIDDEN_DELAY_M / SPEED_OF_LIGHT_M_S * hidden
    if settings.code == 0.0:
        return told
    return told + settings.code / SPEED_OF_LIGHT_M_S * _draw(record, signal, seed)[0]


def carrier_bias_cycles(record: Any, signal: str, settings: SatelliteBiases, seed: int) -> float:
    """What the phase of a signal holds more, cycles; parameters as of :func:`code_bias_s`."""
    if settings.carrier == 0.0:
        return 0.0
    return settings.carrier * _draw(record, signal, seed)[1]


def _draw(record: Any, signal: str, seed: int) -> tuple[float, float]:
    source = f"bias.{name_of(record)}.{signal[1:]}"
    code, carrier = normals(seed, source, 1, 2)[0].tolist()
    return code, carrier
