"""Broadcast ephemerides as records, the five systems in one type.

A field that a system's message lacks is zero. Times are GPS nanoseconds whatever
the system's own scale; `toe_s` keeps the seconds of the system's own week, which
the orbit formulas use.
"""

from typing import Final

import numpy as np

SYSTEM_GPS: Final = ord("G")
SYSTEM_GLONASS: Final = ord("R")
SYSTEM_GALILEO: Final = ord("E")
SYSTEM_BEIDOU: Final = ord("C")
SYSTEM_QZSS: Final = ord("J")

EPHEMERIS_DTYPE: Final = np.dtype(
    [
        ("system", "<i8"),  # RINEX letter as a number
        ("prn", "<i8"),  # number within the system, as in RINEX 3
        ("toe_ns", "<i8"),  # reference time of the orbit, GPS time
        ("toc_ns", "<i8"),  # reference time of the clock, GPS time
        ("transmitted_ns", "<i8"),  # when the message was sent, GPS time
        ("iode", "<i8"),
        ("iodc", "<i8"),
        ("health", "<i8"),  # 0 is healthy
        ("source", "<i8"),  # Galileo data sources, BeiDou satellite type where stated
        ("accuracy_m", "<f8"),  # URA or SISA
        ("fit_s", "<f8"),  # for how long it is meant, 0 where not stated
        ("af0", "<f8"),  # s; GLONASS: minus tau_n
        ("af1", "<f8"),  # s/s; GLONASS: gamma_n
        ("af2", "<f8"),  # s/s^2
        ("group_delay_1_s", "<f8"),  # TGD; Galileo BGD E5a/E1; BeiDou TGD1 (B1/B3)
        ("group_delay_2_s", "<f8"),  # Galileo BGD E5b/E1; BeiDou TGD2 (B2/B3)
        ("toe_s", "<f8"),  # s of the system's week
        ("sqrt_a", "<f8"),  # sqrt(m)
        ("eccentricity", "<f8"),
        ("i0", "<f8"),  # rad
        ("omega0", "<f8"),  # rad, longitude of the ascending node at the week's start
        ("omega", "<f8"),  # rad, argument of perigee
        ("m0", "<f8"),  # rad
        ("delta_n", "<f8"),  # rad/s
        ("omega_dot", "<f8"),  # rad/s
        ("i_dot", "<f8"),  # rad/s
        ("cuc", "<f8"),  # rad
        ("cus", "<f8"),  # rad
        ("crc", "<f8"),  # m
        ("crs", "<f8"),  # m
        ("cic", "<f8"),  # rad
        ("cis", "<f8"),  # rad
        ("position_m", "<f8", 3),  # GLONASS, PZ-90 at toe
        ("velocity_m_s", "<f8", 3),  # GLONASS
        ("acceleration_m_s2", "<f8", 3),  # GLONASS, lunisolar
        ("frequency_channel", "<i8"),  # GLONASS, -7 to 6
    ],
    align=True,
)
