"""Bits of navigation messages, and what the systems' messages have in common."""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import numpy as np

from replay import time
from replay.kernels.ephemeris import EPHEMERIS_DTYPE

SEMICIRCLE_RAD: Final = 3.1415926535898  # IS-GPS-200N, 20.3.3.4.3.3; Galileo and BeiDou the same
WEEK_S: Final = 604_800
NO_ACCURACY_M: Final = -1.0  # as RINEX writes "no accuracy prediction" of Galileo
_HALF_WEEK_NS: Final = time.NS_PER_WEEK // 2


class Bits:
    """A message's bits, read from the first on.

    Parameters
    ----------
    value : int
        The bits as one number, the first of them on top.
    length : int
    at : int
        Where reading begins.
    """

    __slots__ = ("at", "length", "value")

    def __init__(self, value: int, length: int, at: int = 0) -> None:
        self.value = value
        self.length = length
        self.at = at

    def skip(self, count: int) -> None:
        """Pass some bits."""
        self.at += count

    def u(self, count: int) -> int:
        """Unsigned number."""
        self.at += count
        if self.at > self.length:
            raise ValueError("the message is too short")
        return (self.value >> (self.length - self.at)) & ((1 << count) - 1)

    def s(self, count: int) -> int:
        """Two's complement number."""
        number = self.u(count)
        return number - (1 << count) if number >> (count - 1) else number

    def sign_magnitude(self, count: int) -> int:
        """Number with a sign bit, as GLONASS has them."""
        number = self.u(count)
        top = 1 << (count - 1)
        return -(number - top) if number & top else number


@dataclasses.dataclass(frozen=True, slots=True)
class Ionosphere:
    """A broadcast ionosphere.

    Attributes
    ----------
    system : str
        RINEX letter.
    model : int
        Of `replay.IonosphereModel`.
    coefficients : tuple of float
    time_ns : int
        When it was known, GPS nanoseconds.
    """

    system: str
    model: int
    coefficients: tuple[float, ...]
    time_ns: int


def new_record(system: int, prn: int) -> Any:
    """An empty ephemeris."""
    record = np.zeros((), dtype=EPHEMERIS_DTYPE)
    record["system"], record["prn"] = system, prn
    return record


def near(seconds_of_week: float, reference_ns: int, ahead_s: int = 0) -> int:
    """Seconds of a system's week as the moment nearest to a reference.

    Parameters
    ----------
    seconds_of_week : float, s
    reference_ns : int, ns
        GPS time, right within half a week.
    ahead_s : int, s
        GPS time less the system's.
    """
    in_week = round(seconds_of_week * time.NS_PER_S) + ahead_s * time.NS_PER_S
    turns = (reference_ns - in_week + _HALF_WEEK_NS) // time.NS_PER_WEEK
    return in_week + turns * time.NS_PER_WEEK


def accuracy_m(index: int) -> float:
    """User range accuracy of GPS, QZSS and BeiDou (m): IS-GPS-200N, 20.3.3.3.1.3.

    The nominal values, as RINEX writes them; 15 says that there is no prediction.
    """
    if index <= 6:
        return (2.0, 2.8, 4.0, 5.7, 8.0, 11.3, 16.0)[index]
    return float(2 ** (index - 2))
