"""Records of GNSS epochs: what was measured on each satellite, and what is known of it.

Satellites have a dense number, so that arrays over all of them are small: GPS from 0,
GLONASS from 32, Galileo from 64, BeiDou from 104, QZSS from 168. Systems have a number
from 0 in the same order.
"""

from typing import Final

import numpy as np
from numba import njit

SLOTS: Final = 3
"""Signals of one satellite that are looked at together, at most."""

SYSTEMS: Final = 5
SYSTEM_LETTERS: Final = "GRECJ"
GPS: Final = 0
GLONASS: Final = 1
GALILEO: Final = 2
BEIDOU: Final = 3
QZSS: Final = 4
FIRST: Final = (0, 32, 64, 104, 168)
COUNT: Final = (32, 32, 40, 64, 12)
NOT_YET: Final = 2**62
"""In place of the log time of what has not come."""
SATELLITES: Final = 180
"""Satellites of all systems."""

EPOCH_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns, valid time: the receiver's clock reading, GPS
        ("log_t", "<i8"),  # ns
        ("first", "<i8"),  # its first row
        ("count", "<i8"),  # its rows
        # To some metres; known where `placed` is 1.
        ("placed", "<i8"),
        ("x", "<f8", 3),  # m, ECEF
        ("clock", "<f8"),  # m, c times receiver less GPS time
        ("age", "<f8"),  # s
        ("used", "<i8"),  # satellites
        ("needed", "<i8"),  # ns, log time of what else it waited for, 0 for nothing
    ],
    align=True,
)

# One satellite at one epoch of one receiver. NaN is absent.
MEASURED_DTYPE: Final = np.dtype(
    [
        ("satellite", "<i8"),  # dense number
        ("system", "<i8"),  # 0 to 4
        ("prn", "<i8"),
        ("signal", "<i8", SLOTS),  # two characters, first one low; 0 where the slot is empty
        ("frequency", "<f8", SLOTS),  # Hz
        ("code", "<f8", SLOTS),  # m
        ("phase", "<f8", SLOTS),  # m, carrier phase times wavelength
        ("range_rate", "<f8", SLOTS),  # m/s, from Doppler
        ("cn0", "<f8", SLOTS),  # dB-Hz
        ("lock_lost", "<i8", SLOTS),  # RINEX LLI bits
        ("lock_time", "<f8", SLOTS),  # s
        # What follows is known where `seen` is 1.
        ("seen", "<i8"),
        ("position", "<f8", 3),  # m, ECEF at reception
        ("velocity", "<f8", 3),  # m/s, ECEF at reception
        ("clock", "<f8"),  # m, c times the satellite's clock offset
        ("drift", "<f8"),  # m/s
        ("elevation", "<f8"),  # rad
        ("azimuth", "<f8"),  # rad
        ("range_std", "<f8"),  # m
        ("age", "<f8"),  # s
        ("issue", "<i8"),
        ("health", "<i8"),
        # Terms of the corrections.
        ("distance", "<f8"),  # m, ECEF at transmission
        ("sagnac", "<f8"),  # m
        ("polynomial", "<f8"),  # m, c times the clock without relativity
        ("relativity", "<f8"),  # m, c times its effect on the clock
        ("group_delay", "<f8", SLOTS),  # m, adds to the pseudorange
        ("ionosphere", "<f8", SLOTS),  # m, adds to the pseudorange
        ("hydrostatic", "<f8"),  # m
        ("wet", "<f8"),  # m
        ("hydrostatic_mapping", "<f8"),
        ("wet_mapping", "<f8"),
        ("shapiro", "<f8"),  # m, 0 where not modelled
        ("phase_known", "<i8", SLOTS),  # 1: the satellite's bias of the phase is known, and off
        # From a network of stations, known where `network_known` is 1, else 0.
        ("network_known", "<i8", SLOTS),
        ("network", "<f8", SLOTS),  # m, error of the phase against the master's
        ("network_code", "<f8", SLOTS),  # m, of the pseudorange
        ("network_std", "<f8", SLOTS),  # m
    ],
    align=True,
)


@njit(cache=True)
def satellite_number(system: int, prn: int) -> int:
    """Dense number of a satellite, or -1 for one that has none."""
    if system < 0 or system >= SYSTEMS or prn < 1 or prn > COUNT[system]:
        return -1
    return FIRST[system] + prn - 1


@njit(cache=True)
def system_of_letter(letter: int) -> int:
    """0 to 4 for the RINEX letter of a system as a number, else -1."""
    if letter == 71:
        return GPS
    if letter == 82:
        return GLONASS
    if letter == 69:
        return GALILEO
    if letter == 67:
        return BEIDOU
    if letter == 74:
        return QZSS
    return -1
